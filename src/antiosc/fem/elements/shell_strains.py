"""Strains and energies of shells in UFL, from the frames and the sections of their cells.

At every point of the surface a frame (e1, e2, n) follows from the Jacobian, and for layers from
their axis and top. With the displacement u and the rotation vector θ of the normal, and s_α the
lengths along e_α,

    membrane strain  sym(e_α·∂u/∂s_β)          shear strain  n·∂u/∂s_α + (θ×n)·e_α
    bending strain   sym(e_α·∂θ/∂s_β × n)      drilling      (e2·∂u/∂s1 − e1·∂u/∂s2)/2 − θ·n

The drilling strain is penalized with the shear modulus, so that θ·n is the in-plane rotation of the
surface and moments are transmitted at folds. The result does not depend on the sign of n, unless
the layers are unsymmetric.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial, prod
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import ufl

from antiosc.base._types import Array
from antiosc.base.checks import in_words
from antiosc.base.errors import InputError
from antiosc.fem.elements.material_axes import axes_and_sides
from antiosc.fem.elements.sections import PlateSection
from antiosc.fem.elements.weak_form import Parts, coefficient
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import agree

if TYPE_CHECKING:
    from ufl.core.expr import Expr

#: Share of its size² below which a cell has no area.
LEAST_AREA = 1e-10


class SectionFields(NamedTuple):
    """Cell-wise constants of the sheets (UFL)."""

    A: Expr
    #: D − B A⁻¹ B
    bending: Expr
    S: Expr
    drilling: Expr
    #: A⁻¹ B, None where no stack couples stretching with bending
    coupling: Expr
    I0: Expr
    #: None where no stack has its mass off the middle
    I1: Expr
    I2: Expr
    spin: Expr
    #: z of the middle, None where it is 0 everywhere
    middle: Expr
    #: t², and what stands for it in a stack
    t2_of_shear: Expr
    t2_of_stretch: Expr


def section_fields(mesh: Mesh, parts: Parts) -> SectionFields:
    """The constants of the sections of all parts, in each cell those of its own."""

    def constant(value: Callable[[PlateSection], float | Array]) -> Expr:
        return coefficient(mesh, parts, lambda sheet: value(sheet.section))

    sections = [material.section for material, _ in parts]
    coupled = any(s.B.any() for s in sections)
    return SectionFields(
        A=constant(lambda s: s.A),
        bending=constant(lambda s: s.bending),
        S=constant(lambda s: s.S),
        drilling=constant(lambda s: s.drilling),
        coupling=constant(lambda s: np.linalg.solve(s.A, s.B)) if coupled else None,
        I0=constant(lambda s: s.I0),
        I1=constant(lambda s: s.I1) if any(s.I1 for s in sections) else None,
        I2=constant(lambda s: s.I2),
        spin=constant(lambda s: s.spin),
        middle=constant(lambda s: s.middle) if any(s.middle for s in sections) else None,
        t2_of_shear=constant(lambda s: s.t2_of_shear),
        t2_of_stretch=constant(lambda s: s.t2_of_stretch),
    )


class Frame(NamedTuple):
    """Orthonormal e1, e2 (tangents) and n with three components, and derivatives along e1, e2."""

    e1: Expr
    e2: Expr
    n: Expr
    #: (2, gdim): the tangents in the coordinates of the mesh
    along: Expr


class Strains(NamedTuple):
    """Strains of the surface in its frame."""

    #: (ε1, ε2, γ12)
    membrane: Expr
    #: (κ1, κ2, 2κ12)
    bending: Expr
    #: (γ13, γ23)
    shear: Expr
    drilling: Expr


def frames(mesh: Mesh, parts: Parts) -> Frame:
    """The frame at every point: of the laminate where one has an axis."""
    J = ufl.Jacobian(mesh.dolfinx)
    zeros = [0] * (3 - mesh.gdim)
    a, b = (ufl.as_vector([*(J[i, j] for i in range(mesh.gdim)), *zeros]) for j in (0, 1))
    normal = ufl.cross(a, b)
    area = ufl.sqrt(ufl.dot(normal, normal))
    n = normal / area
    if any(material.axis is not None or material.offset for material, _ in parts):
        axis, side = axes_and_sides(mesh, parts)
        n, a = side * n, axis - ufl.dot(axis, n) * n
    e1 = a / ufl.sqrt(ufl.dot(a, a))
    e2 = ufl.cross(n, e1)
    along = ufl.as_matrix([[e[i] for i in range(mesh.gdim)] for e in (e1, e2)])
    return Frame(e1, e2, n, along)


def _halves(w: Expr) -> tuple[Expr, Expr]:
    """Displacement and rotation of a trial or test function."""
    return ufl.as_vector([w[i] for i in range(3)]), ufl.as_vector([w[i] for i in range(3, 6)])


def strains_of(frame: Frame, w: Expr, middle: Expr | None) -> Strains:
    """Strains of a trial or test function; `middle`: z of the middle of the section."""
    e1, e2, n = frame.e1, frame.e2, frame.n
    u, turn = _halves(w)
    # columns: the derivatives along e1 and e2
    du = ufl.dot(ufl.grad(u), ufl.transpose(frame.along))
    dr = ufl.dot(ufl.grad(turn), ufl.transpose(frame.along))

    def columns(of: Expr) -> tuple[Expr, Expr]:
        return tuple(ufl.as_vector([of[i, j] for i in range(3)]) for j in (0, 1))  # type: ignore

    (u1, u2), (r1, r2) = columns(du), columns(dr)
    gradient = ufl.as_matrix(
        [[ufl.dot(e1, u1), ufl.dot(e1, u2)], [ufl.dot(e2, u1), ufl.dot(e2, u2)]]
    )
    # θ × n = (θ·e2) e1 − (θ·e1) e2
    curvature = ufl.as_matrix(
        [[ufl.dot(e2, r1), ufl.dot(e2, r2)], [-ufl.dot(e1, r1), -ufl.dot(e1, r2)]]
    )
    shear = ufl.as_vector([ufl.dot(n, u1) + ufl.dot(turn, e2), ufl.dot(n, u2) - ufl.dot(turn, e1)])
    drilling = (gradient[1, 0] - gradient[0, 1]) / 2 - ufl.dot(turn, n)
    if middle is not None:  # the rotation of the middle surface
        drilling += middle * (curvature[1, 0] - curvature[0, 1]) / 2
    return Strains(_engineering(gradient), _engineering(curvature), shear, drilling)


def _engineering(e: Expr) -> Expr:
    """(e11, e22, e12 + e21)."""
    return ufl.as_vector([e[0, 0], e[1, 1], e[0, 1] + e[1, 0]])


def energies(section: SectionFields, a: Strains, b: Strains) -> tuple[Expr, Expr, Expr]:
    """(membrane and drilling, shear, bending) energy densities of two strain states.

    The membrane energy is that of ε + A⁻¹Bκ, the strain of the neutral surface. Each energy is
    therefore non-negative by itself, for any integration points.
    """

    def stretch(e: Strains) -> Expr:
        if section.coupling is None:
            return e.membrane
        return e.membrane + section.coupling * e.bending

    membrane = ufl.inner(section.A * stretch(a), stretch(b))
    drilling = section.drilling * a.drilling * b.drilling
    shear = ufl.inner(section.S * a.shear, b.shear)
    return membrane + drilling, shear, ufl.inner(section.bending * a.bending, b.bending)


def inertia(section: SectionFields, frame: Frame, w: Expr, v: Expr) -> Expr:
    """Kinetic energy density of the motions u + z θ×n, and of θ·n as of rotations of the middle."""
    (u, turn), (u_v, turn_v) = _halves(w), _halves(v)
    motion = section.I0 * ufl.dot(u, u_v) + section.I2 * ufl.dot(turn, turn_v)
    if section.I1 is not None:
        across = ufl.dot(u, ufl.cross(turn_v, frame.n)) + ufl.dot(ufl.cross(turn, frame.n), u_v)
        motion += section.I1 * across
        about_n = ufl.dot(turn, frame.n) * ufl.dot(turn_v, frame.n)
        motion += (section.spin - section.I2) * about_n
    return motion


def areas_of(mesh: Mesh) -> Expr:
    """Area of every cell from its corners, as a function; InputError if it is zero."""
    x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    first, second = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    if mesh.cell == "quadrilateral":  # the diagonals
        first, second = x[:, 3] - x[:, 0], x[:, 2] - x[:, 1]
    areas = compat.cellwise(mesh.dolfinx)
    areas.x.array[:] = np.linalg.norm(np.cross(first, second), axis=1) / 2
    owned = compat.cell_map(mesh.dolfinx).size_local
    size = np.maximum(np.sum(first**2, axis=1), np.sum(second**2, axis=1))
    bad = np.flatnonzero((areas.x.array <= LEAST_AREA * size)[:owned])
    total = mesh.comm.allreduce(len(bad))
    error = None
    if len(bad):
        at = in_words(x[bad[0]].mean(axis=0))
        error = InputError(
            f"{total} of {mesh.n_cells} {mesh.cell} cells have no area, one at {at}: "
            "remesh the surface, or remove these cells."
        )
    agree(mesh.comm, error)
    return areas


def rise_of(mesh: Mesh) -> Expr:
    """Distance of the middle of each quadrilateral from its corners along the normal, m."""
    rise = compat.cellwise(mesh.dolfinx)
    if mesh.order > 1:
        x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
        normal = np.cross(x[:, 3] - x[:, 0], x[:, 2] - x[:, 1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        offset = x[:, 8] - x[:, :4].mean(axis=1)
        rise.x.array[:] = np.abs(np.einsum("ij,ij->i", offset, normal))
    return rise


# -- Shear strains of triangles that do not lock: the rotations in them are interpolated (MITC).
#
# In a thin plate the normals follow the surface, θ×n = −∇w. With conforming cubics w this leaves
# only smooth functions w, which are few on a general mesh: the plate locks. Therefore the shear
# strain uses, in place of the cubic θ×n, its interpolant R in Nédélec's second edge element:
# quadratic, with the same moments against quadratics along every edge and the same three means
# inside. With w cubic, ∇w lies in that space, and cubic vectors with linear pressures are stable
# for Stokes' problem: what F. Brezzi, M. Fortin & R. Stenberg (Math. Models Methods Appl. Sci. 1,
# 1991, 125–151) ask of an element whose error does not grow as the thickness vanishes. Along edges
# R takes the values at three Gauss points.
#
# R reproduces quadratics. The difference of a cubic and its interpolant follows from the third
# derivatives, which are constants: it is a sum of fixed fields on the reference triangle.


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
    # the sums at each monomial are constants of a flat cell; powers of 3 would be calls in C
    terms: list[dict[tuple[int, int], Expr]] = [{}, {}]
    for (p, q), fields in zip(CUBIC, _dropped_of_cubics(), strict=True):
        which = [0] * p + [1] * q
        cubic = ufl.as_vector([third[(m, *which)] for m in range(3, 6)])
        cubic = cubic / (factorial(p) * factorial(q))
        for axis, field in zip(axes, fields, strict=True):
            size = ufl.dot(ufl.cross(cubic, n), axis)
            for own, factors in zip(terms, field.tolist(), strict=True):
                for power, factor in zip((*QUADRATIC, (p, q)), factors, strict=True):
                    if factor:
                        own[power] = own.get(power, 0) + factor * size
    covariant = [
        sum(prod([X[0]] * r + [X[1]] * s) * factor for (r, s), factor in own.items())
        for own in terms
    ]
    return ufl.dot(ufl.dot(along, ufl.transpose(inverse)), ufl.as_vector(covariant))


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
