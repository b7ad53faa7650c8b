"""Shear strains of triangles that do not lock: the rotations in them are interpolated (MITC).

In a thin plate the normals follow the surface, θ×n = −∇w. With conforming cubics w this leaves only
smooth functions w, which are few on a general mesh: the plate locks. Therefore the shear strain
uses, in place of the cubic θ×n, its interpolant R in Nédélec's second edge element: quadratic, with
the same moments against quadratics along every edge and the same three means inside. With w cubic,
∇w lies in that space, and cubic vectors with linear pressures are stable for Stokes' problem: what
F. Brezzi, M. Fortin & R. Stenberg (Math. Models Methods Appl. Sci. 1, 1991, 125–151) ask of an
element whose error does not grow as the thickness vanishes. Along edges R takes the values at three
Gauss points.

R reproduces quadratics. The difference of a cubic and its interpolant follows from the third
derivatives, which are constants: it is a sum of fixed fields on the reference triangle.
"""

from __future__ import annotations

from math import factorial
from typing import TYPE_CHECKING

import numpy as np
import ufl

from antiosc._types import Array
from antiosc.fem import compat
from antiosc.fem.mesh.mesh import Mesh

if TYPE_CHECKING:
    from ufl.core.expr import Expr

#: Exponents of ξ and η.
CUBIC = ((3, 0), (2, 1), (1, 2), (0, 3))
QUADRATIC = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


def dropped(mesh: Mesh, X: Expr, motion: Expr, n: Expr, along: Expr) -> Expr:
    """Components of (1 − R)(θ×n) along two tangents (UFL).

    `X`: the reference coordinates, `motion`: the trial or test function, its last three components
    θ, `n`: the normal (3,), `along` (2, gdim): the tangents. On curved triangles, n and the
    reference directions of the point hold for the whole of θ.
    """
    J, inverse = ufl.Jacobian(mesh.dolfinx), ufl.JacobianInverse(mesh.dolfinx)
    zeros = [0] * (3 - mesh.gdim)
    axes = [ufl.as_vector([*(J[i, a] for i in range(mesh.gdim)), *zeros]) for a in (0, 1)]
    third = compat.reference_derivatives(motion, 3)
    covariant = [0, 0]
    for (p, q), fields in zip(CUBIC, _dropped_of_cubics(), strict=True):
        which = [0] * p + [1] * q
        cubic = ufl.as_vector([third[(m, *which)] for m in range(3, 6)])
        cubic = cubic / (factorial(p) * factorial(q))
        for axis, field in zip(axes, fields, strict=True):
            size = ufl.dot(ufl.cross(cubic, n), axis)
            for m in (0, 1):
                covariant[m] += size * _polynomial(field[m], (p, q), X)
    return ufl.dot(ufl.dot(along, ufl.transpose(inverse)), ufl.as_vector(covariant))


def _polynomial(factors: Array, cubic: tuple[int, int], X: Expr) -> Expr:
    powers = (*QUADRATIC, cubic)
    return sum(float(f) * X[0] ** r * X[1] ** s for f, (r, s) in zip(factors, powers, strict=True))


def _dropped_of_cubics() -> Array:
    """(1 − R) of the cubics ξᵖηᑫ along ξ and along η: (cubic, direction, component, factor).

    The factors are those of QUADRATIC and of the cubic itself.
    """
    lattice = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])

    def powers(X: Array, p: int, q: int) -> Array:
        return np.asarray(X[:, 0] ** p * X[:, 1] ** q)

    vandermonde = np.column_stack([powers(lattice, *power) for power in QUADRATIC])
    result = np.zeros((4, 2, 2, 7))
    points, interpolation = compat.edge_points(), compat.edge_interpolation(lattice)
    for number, power in enumerate(CUBIC):
        for direction in (0, 1):
            values = powers(points, *power)[:, None] * np.eye(2)[direction]
            near = np.einsum("pcbn,nb->pc", interpolation, values)
            result[number, direction, :, :6] = -np.linalg.solve(vandermonde, near).T
            result[number, direction, direction, 6] = 1
    # multiples of 1/120: without rounding, forms are compiled once
    return np.round(120 * result) / 120
