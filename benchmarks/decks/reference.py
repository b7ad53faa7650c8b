"""K of linear elastic solids in NumPy, to compare with: nothing of them is dolfinx's.

Displacements are quadratic on every cell: of degree two on triangles and tetrahedra, of degree two
in each direction on quadrilaterals and hexahedra. A node of them is the middle of some corners, so
that the numbers of these corners are its name. The quadrature points are basix', for on curved
cells the sums depend on them.
"""

from __future__ import annotations

from itertools import combinations, product

import basix
import numpy as np
import scipy.sparse as sp

SIMPLEX = {"triangle": 2, "tetrahedron": 3}
CUBE = {"quadrilateral": 2, "hexahedron": 3}


def stiffness(cell, x, corners, order, moduli):
    """(K, nodes) of cells with geometric nodes; K in extended precision.

    `x` (cells, n, dim): in dolfinx's order; `corners` (cells, k): numbers of the vertices; `moduli`
    (cells, 2): λ and μ. Dofs are node by node; `nodes` (n, dim) are their places.
    """
    dim = x.shape[2]
    points, names = _nodes(cell)
    of_map = np.array(basix.create_element(*_family(cell, order)).points)
    maps = _functions(of_map, _powers(cell, order))
    quadratic = _functions(points, _powers(cell, 2))
    keys = np.full((len(x), len(names), 2**dim), -1)
    for k, name in enumerate(names):
        keys[:, k, : len(name)] = np.sort(corners[:, list(name)], axis=1)
    every, number = np.unique(keys.reshape(-1, 2**dim), axis=0, return_inverse=True)
    number = number.reshape(len(x), len(names))
    places = np.zeros((len(every), dim))
    at, _ = maps(points)
    places[number] = np.einsum("qa,cad->cqd", at, x)
    K = _stiffness(x, maps, quadratic, moduli, _quadrature(cell, _degree(cell, order)))
    dofs = (number[:, :, None] * dim + np.arange(dim)).reshape(len(x), -1)
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    shape = (len(every) * dim,) * 2
    return _summed(K, rows, columns, shape), places


def _summed(own, rows, columns, shape):
    """The matrix of all cells, summed in the precision of theirs."""
    place = (rows.astype(np.int64) * shape[1] + columns).ravel()
    order = np.argsort(place, kind="stable")
    place, values = place[order], own.ravel()[order]
    first = np.flatnonzero(np.append(True, place[1:] != place[:-1]))
    row, column = np.divmod(place[first], shape[1])
    return sp.csc_matrix((np.add.reduceat(values, first), (row, column)), shape=shape)


def _degree(cell, order):
    """Degree of the quadrature."""
    if cell in CUBE:
        return 5
    return 2 if order == 1 else 4


def _nodes(cell):
    """Reference places of the quadratic nodes, and the corners that each lies in the middle of."""
    if cell in SIMPLEX:
        vertices = np.vstack([np.zeros(SIMPLEX[cell]), np.eye(SIMPLEX[cell])])
        names = [(k,) for k in range(len(vertices))]
        names += list(combinations(range(len(vertices)), 2))
    else:
        dim = CUBE[cell]  # dolfinx counts the first coordinate fastest
        vertices = np.array(list(product((0.0, 1.0), repeat=dim)))[:, ::-1]
        names = []
        for place in product((0.0, 0.5, 1.0), repeat=dim):
            near = [np.abs(v - place).max() <= 0.5 for v in vertices]
            names.append(tuple(int(k) for k in np.flatnonzero(near)))
    return np.array([vertices[list(name)].mean(axis=0) for name in names]), names


def _functions(nodes, powers):
    """A function of points: values (q, n) and gradients (q, n, dim) of the polynomials of nodes."""
    inverse = np.linalg.inv(_monomials(nodes, powers))

    def at(points):
        values = _monomials(points, powers) @ inverse
        gradients = [_monomials(points, powers, axis) @ inverse for axis in range(points.shape[1])]
        return values, np.stack(gradients, axis=2)

    return at


def _family(cell, degree):
    shape = getattr(basix.CellType, cell)
    variant = basix.LagrangeVariant.equispaced
    return basix.ElementFamily.P, shape, degree, variant


def _powers(cell, degree):
    dim = SIMPLEX.get(cell) or CUBE[cell]
    every = np.array(list(product(range(degree + 1), repeat=dim)))
    return every[every.sum(axis=1) <= degree] if cell in SIMPLEX else every


def _monomials(points, powers, axis=None):
    """(points, monomials), or their derivatives along an axis."""
    powers = powers.copy()
    factor = np.ones(len(powers))
    if axis is not None:
        factor = powers[:, axis].astype(float)
        powers[:, axis] = np.maximum(powers[:, axis] - 1, 0)
    return factor * np.prod(points[:, None, :] ** powers[None], axis=2)


def _quadrature(cell, degree):
    points, weights = basix.make_quadrature(getattr(basix.CellType, cell), degree)
    return np.array(points), np.array(weights)


def _stiffness(x, maps, quadratic, moduli, quadrature):
    points, weights = quadrature
    _, g = maps(points)
    _, slopes = quadratic(points)
    dim, n = x.shape[2], slopes.shape[1]
    # in extended precision: thin cells lose up to ten digits in the sums below
    K = np.zeros((len(x), n, dim, n, dim), dtype=np.longdouble)
    lam, mu = moduli.T.astype(np.longdouble)
    for q, w in enumerate(weights):
        J = np.einsum("ad,cae->cde", g[q].astype(np.longdouble), x.astype(np.longdouble))
        inverse, determinant = _inverse(J)
        size = np.abs(determinant) * w
        G = np.einsum("cde,ne->cnd", inverse, slopes[q].astype(np.longdouble))
        K += np.einsum("c,cai,cbj->caibj", lam * size, G, G)
        K += np.einsum("c,caj,cbi->caibj", mu * size, G, G)
        same = np.einsum("c,cak,cbk->cab", mu * size, G, G)
        for i in range(dim):
            K[:, :, i, :, i] += same
    return K.reshape(len(x), n * dim, n * dim)


def _inverse(J):
    """(inverse, determinant) of matrices (cells, d, d), by cofactors: NumPy's is in double."""
    if J.shape[1] == 2:
        determinant = J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]
        adjugate = np.stack(
            [np.stack([J[:, 1, 1], -J[:, 0, 1]], 1), np.stack([-J[:, 1, 0], J[:, 0, 0]], 1)], 1
        )
        return adjugate / determinant[:, None, None], determinant
    rows = [np.cross(J[:, (k + 1) % 3], J[:, (k + 2) % 3]) for k in range(3)]
    determinant = np.einsum("ci,ci->c", J[:, 0], rows[0])
    return np.stack(rows, axis=2) / determinant[:, None, None], determinant
