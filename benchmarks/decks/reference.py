"""K and M of linear elastic solids in NumPy, to compare with: nothing of them is dolfinx's.

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


def matrices(cell, x, corners, order, moduli, rho):
    """(K, M, nodes) of cells with geometric nodes; K in extended precision.

    `x` (cells, n, dim): in dolfinx's order; `corners` (cells, k): numbers of the vertices; `moduli`
    (cells, 2): λ and μ; `rho` (cells,). Dofs are node by node; `nodes` (n, dim) are their places.
    """
    dim = x.shape[2]
    points, names = _nodes(cell)
    maps = _lagrange(cell, order)
    keys = np.full((len(x), len(names), 2**dim), -1)
    for k, name in enumerate(names):
        keys[:, k, : len(name)] = np.sort(corners[:, list(name)], axis=1)
    every, number = np.unique(keys.reshape(-1, 2**dim), axis=0, return_inverse=True)
    number = number.reshape(len(x), len(names))
    places = np.zeros((len(every), dim))
    at, _ = maps(points)
    places[number] = np.einsum("qa,cad->cqd", at, x)
    for_k, for_m = _degrees(cell, order)
    K = _stiffness(cell, x, maps, moduli, for_k)
    M = _mass(cell, x, maps, rho, for_m)
    dofs = (number[:, :, None] * dim + np.arange(dim)).reshape(len(x), -1)
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    shape = (len(every) * dim,) * 2
    return _summed(K, rows, columns, shape), _summed(M, rows, columns, shape), places


def _summed(own, rows, columns, shape):
    """The matrix of all cells, summed in the precision of theirs."""
    place = (rows.astype(np.int64) * shape[1] + columns).ravel()
    order = np.argsort(place, kind="stable")
    place, values = place[order], own.ravel()[order]
    first = np.flatnonzero(np.append(True, place[1:] != place[:-1]))
    row, column = np.divmod(place[first], shape[1])
    return sp.csc_matrix((np.add.reduceat(values, first), (row, column)), shape=shape)


def _degrees(cell, order):
    if cell in CUBE:
        return 5, 5
    return (2, 4) if order == 1 else (4, 5)


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


def _lagrange(cell, order):
    """Values (q, n) and gradients (q, n, dim) of the geometric map's functions at points."""
    if order == 2:
        nodes = np.array(basix.create_element(*_family(cell, 2)).points)
    else:
        nodes = np.array(basix.create_element(*_family(cell, 1)).points)
    powers = _powers(cell, order)
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


def _functions(cell, points):
    """The quadratic displacement's functions, nodes ordered as `_nodes` has them."""
    nodes, _ = _nodes(cell)
    powers = _powers(cell, 2)
    inverse = np.linalg.inv(_monomials(nodes, powers))
    values = _monomials(points, powers) @ inverse
    gradients = [_monomials(points, powers, axis) @ inverse for axis in range(points.shape[1])]
    return values, np.stack(gradients, axis=2)


def _stiffness(cell, x, maps, moduli, degree):
    points, weights = _quadrature(cell, degree)
    _, g = maps(points)
    _, slopes = _functions(cell, points)
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


def _mass(cell, x, maps, rho, degree):
    points, weights = _quadrature(cell, degree)
    _, g = maps(points)
    values, _ = _functions(cell, points)
    dim, n = x.shape[2], values.shape[1]
    M = np.zeros((len(x), n, dim, n, dim))
    for q, w in enumerate(weights):
        J = np.einsum("ad,cae->cde", g[q], x)
        size = rho * np.abs(np.linalg.det(J)) * w
        own = np.einsum("c,a,b->cab", size, values[q], values[q])
        for i in range(dim):
            M[:, :, i, :, i] += own
    return M.reshape(len(x), n * dim, n * dim)
