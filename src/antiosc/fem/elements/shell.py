"""`Shell`, `Laminate`: Reissner–Mindlin plates and shells on triangles or quadrilaterals.

At every point of the surface the Jacobian determines the frame (e1, e2, n); with layers, their axis
and top do too. With the displacement u, the rotation vector θ of the normal and the arc length s_α
along e_α,

    membrane strain  sym(e_α·∂u/∂s_β)          shear strain  n·∂u/∂s_α + (θ×n)·e_α
    bending strain   sym(e_α·∂θ/∂s_β × n)      drilling      (e2·∂u/∂s1 − e1·∂u/∂s2)/2 − θ·n

The drilling strain is penalized with the shear modulus, so that θ·n is the in-plane rotation of the
surface and moments are transmitted at folds. The result does not depend on the sign of n, unless
the layers are unsymmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from math import factorial, prod, sqrt
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array, Box
from antiosc.base.checks import Checked, checked_by, floats, number, positive, store
from antiosc.base.errors import InputError
from antiosc.fem.elements import Layer, PlateSection, section_of_layers
from antiosc.fem.elements.weak_form import (
    DIRECTION_CHECK,
    Direction,
    Isotropic,
    Kind,
    Parts,
    WeakForm,
    axes_and_sides,
    coefficient,
    compat,
    jacobian_columns,
    measure,
    split_motion,
    ufl,
)

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from antiosc.fem.mesh import Mesh


class SectionFields(NamedTuple):
    """Constants of each cell's `PlateSection`, by the same names (UFL)."""

    A: Expr
    #: D − B A⁻¹ B (3, 3), N m
    bending: Expr
    S: Expr
    drilling: Expr
    #: A⁻¹ B (3, 3), m; None if no stack couples stretching with bending
    coupling: Expr
    I0: Expr
    #: None if every stack has its centre of mass at z = 0
    I1: Expr
    I2: Expr
    spin: Expr
    #: z of the middle of the section, m; None if it is 0 everywhere
    middle: Expr
    #: t² of the equivalent isotropic plate, m²
    t2_of_shear: Expr
    t2_of_stretch: Expr


def section_fields(mesh: Mesh, parts: Parts) -> SectionFields:
    """The section constants of all parts as cell-wise constant functions."""

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
    """Orthonormal tangents e1, e2 and normal n, each (3,) (UFL)."""

    e1: Expr
    e2: Expr
    n: Expr
    #: (2, gdim): e1 and e2 as rows, for derivatives along them
    along: Expr


class SurfaceStrains(NamedTuple):
    """Strains of the surface in its frame."""

    #: (ε1, ε2, γ12)
    membrane: Expr
    #: (κ1, κ2, 2κ12), 1/m
    bending: Expr
    #: (γ13, γ23)
    shear: Expr
    #: in-plane rotation of the surface less θ·n, the rotation about the normal
    drilling: Expr


def frames(mesh: Mesh, parts: Parts) -> Frame:
    """The frame at every point; e1 follows the axis of a laminate, if it has one."""
    a, b = jacobian_columns(mesh)
    normal = ufl.cross(a, b)
    area = ufl.sqrt(ufl.dot(normal, normal))
    n = normal / area
    if any(material.axis is not None or material.offset for material, _ in parts):
        axis, side = axes_and_sides(mesh, parts)
        n, a = side * n, axis - ufl.dot(axis, n) * n
    e1 = a / ufl.sqrt(ufl.dot(a, a))
    e2 = ufl.cross(n, e1)
    tangents = ufl.as_matrix([[e[i] for i in range(mesh.gdim)] for e in (e1, e2)])
    return Frame(e1, e2, n, tangents)


def tangential_slopes(frame: Frame, vector: Expr) -> tuple[Expr, Expr]:
    """Derivatives (3,) of a vector (3,) along e1 and along e2."""
    slopes = ufl.dot(ufl.grad(vector), ufl.transpose(frame.along))
    first, second = (ufl.as_vector([slopes[i, j] for i in range(3)]) for j in (0, 1))
    return first, second


def strains_of(frame: Frame, w: Expr, middle: Expr | None) -> SurfaceStrains:
    """Strains at z = 0 of a motion `w` of six components; `middle`: z [m] of the section's middle,
    about which the drilling strain is taken; None for 0."""
    e1 = frame.e1
    e2 = frame.e2
    n = frame.n
    u, rotation = split_motion(w)

    u1, u2 = tangential_slopes(frame, u)
    r1, r2 = tangential_slopes(frame, rotation)
    gradient = ufl.as_matrix(
        [[ufl.dot(e1, u1), ufl.dot(e1, u2)], [ufl.dot(e2, u1), ufl.dot(e2, u2)]]
    )

    # θ × n = (θ·e2) e1 − (θ·e1) e2
    curvature = ufl.as_matrix(
        [[ufl.dot(e2, r1), ufl.dot(e2, r2)], [-ufl.dot(e1, r1), -ufl.dot(e1, r2)]]
    )
    shear = ufl.as_vector(
        [ufl.dot(n, u1) + ufl.dot(rotation, e2), ufl.dot(n, u2) - ufl.dot(rotation, e1)]
    )
    drilling = (gradient[1, 0] - gradient[0, 1]) / 2 - ufl.dot(rotation, n)
    if middle is not None:  # the rotation of the middle surface
        drilling += middle * (curvature[1, 0] - curvature[0, 1]) / 2
    return SurfaceStrains(
        _engineering_strains(gradient), _engineering_strains(curvature), shear, drilling
    )


def _engineering_strains(e: Expr) -> Expr:
    """(e11, e22, e12 + e21) of a tensor (2, 2)."""
    return ufl.as_vector([e[0, 0], e[1, 1], e[0, 1] + e[1, 0]])


def energies(
    section: SectionFields, a: SurfaceStrains, b: SurfaceStrains
) -> tuple[Expr, Expr, Expr]:
    """(membrane and drilling, shear, bending) parts of the bilinear energy density (UFL). Each is
    >= 0 for a = b, since the membrane strain is taken on the neutral surface, ε + A⁻¹Bκ."""

    def stretch(e: SurfaceStrains) -> Expr:
        if section.coupling is None:
            return e.membrane
        return e.membrane + section.coupling * e.bending

    membrane = ufl.inner(section.A * stretch(a), stretch(b))
    drilling = section.drilling * a.drilling * b.drilling
    shear = ufl.inner(section.S * a.shear, b.shear)
    return membrane + drilling, shear, ufl.inner(section.bending * a.bending, b.bending)


def inertia(section: SectionFields, frame: Frame, w: Expr, v: Expr) -> Expr:
    """Density of the mass form of a shell: motions u + z θ×n, and drilling rotations θ·n."""
    u, rotation = split_motion(w)
    u_v, turn_v = split_motion(v)
    motion = section.I0 * ufl.dot(u, u_v) + section.I2 * ufl.dot(rotation, turn_v)

    if section.I1 is not None:
        n = frame.n
        shifted = ufl.dot(u, ufl.cross(turn_v, n)) + ufl.dot(ufl.cross(rotation, n), u_v)
        motion += section.I1 * shifted
        about_n = ufl.dot(rotation, n) * ufl.dot(turn_v, n)
        motion += (section.spin - section.I2) * about_n

    return motion


def areas_of(mesh: Mesh) -> Expr:
    """Area [m²] of every cell, calculated from its corners, as a cell-wise function."""
    x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    first = x[:, 1] - x[:, 0]
    second = x[:, 2] - x[:, 0]
    if mesh.cell == "quadrilateral":  # the diagonals
        first = x[:, 3] - x[:, 0]
        second = x[:, 2] - x[:, 1]
    areas = compat.cellwise_function(mesh.dolfinx)
    areas.x.array[:] = np.linalg.norm(np.cross(first, second), axis=1) / 2
    return areas


def rise_of(mesh: Mesh) -> Expr:
    """Height [m] of a quadrilateral's middle node above the mean of its corners; 0 for order 1."""
    rise = compat.cellwise_function(mesh.dolfinx)

    if mesh.order > 1:
        x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
        normal = np.cross(x[:, 3] - x[:, 0], x[:, 2] - x[:, 1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        offset = x[:, 8] - x[:, :4].mean(axis=1)
        rise.x.array[:] = np.abs(np.einsum("ij,ij->i", offset, normal))
    return rise


# -- Shear strains of triangles, with interpolated rotations (MITC), so that they do not lock.
#
# In a thin plate the normals follow the surface, θ×n = −∇w. With conforming cubics w this leaves
# only smooth functions w, which are few on a general mesh: the plate locks. Therefore the shear
# strain uses, in place of the cubic θ×n, its interpolant R in Nédélec's second edge element:
# quadratic, with the same moments against quadratics along every edge and the same three means
# inside. With w cubic, ∇w lies in that space, and cubic vectors with linear pressures are stable
# for Stokes' problem. By F. Brezzi, M. Fortin & R. Stenberg (Math. Models Methods Appl. Sci. 1,
# 1991, 125–151), the error of such an element does not grow as the thickness vanishes. Along edges
# R takes the values at three Gauss points.
#
# R reproduces quadratics. The difference of a cubic and its interpolant follows from the third
# derivatives, which are constants: it is a sum of fixed fields on the reference triangle.


#: Exponents of ξ and η.
CUBIC_POWERS = ((3, 0), (2, 1), (1, 2), (0, 3))
QUADRATIC_POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  # those of lower degree


def dropped_shear(mesh: Mesh, X: Expr, motion: Expr, n: Expr, along: Expr) -> Expr:
    """The part (1 − R)(θ×n) along two tangents (UFL) that the shear strain omits. R projects cubics
    to quadratics with the same moments along edges; n is taken as constant.

    `X`: reference coordinates (2,); `motion`: test or trial function of six components; `along`
    (2, gdim): the tangents, as in `Frame`.
    """
    inverse = ufl.JacobianInverse(mesh.dolfinx)
    axes = jacobian_columns(mesh)
    third = compat.reference_derivatives(motion, 3)

    # the sums at each monomial are constants of a flat cell; powers of 3 would be calls in C
    terms: list[dict[tuple[int, int], Expr]] = [{}, {}]
    for (p, q), fields in zip(CUBIC_POWERS, _cubic_remainders(), strict=True):
        directions = [0] * p + [1] * q
        cubic = ufl.as_vector([third[(m, *directions)] for m in range(3, 6)])
        cubic = cubic / (factorial(p) * factorial(q))
        for axis, spread in zip(axes, fields, strict=True):
            size = ufl.dot(ufl.cross(cubic, n), axis)
            for term, factors in zip(terms, spread.tolist(), strict=True):
                for power, factor in zip((*QUADRATIC_POWERS, (p, q)), factors, strict=True):
                    if factor:
                        term[power] = term.get(power, 0) + factor * size

    covariant = [
        sum(prod([X[0]] * r + [X[1]] * s) * factor for (r, s), factor in term.items())
        for term in terms
    ]
    return ufl.dot(ufl.dot(along, ufl.transpose(inverse)), ufl.as_vector(covariant))


@cache
def _cubic_remainders() -> Array:
    """Coefficients (cubic, direction, component, 7) of cubics minus their quadratic interpolants:
    of the QUADRATIC_POWERS, then of the cubic."""
    lattice = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])

    def powers(X: Array, p: int, q: int) -> Array:
        return np.asarray(X[:, 0] ** p * X[:, 1] ** q)

    vandermonde = np.column_stack([powers(lattice, *power) for power in QUADRATIC_POWERS])
    result = np.zeros((4, 2, 2, 7))
    points = compat.edge_points()
    interpolation = compat.edge_interpolation(lattice)
    for nth, power in enumerate(CUBIC_POWERS):
        for direction in (0, 1):
            values = powers(points, *power)[:, None] * np.eye(2)[direction]
            interpolated = np.einsum("pcbn,nb->pc", interpolation, values)
            result[nth, direction, :, :6] = -np.linalg.solve(vandermonde, interpolated).T
            result[nth, direction, direction, 6] = 1

    # multiples of 1/120: without rounding, forms are compiled once
    return np.round(120 * result) / 120


#: Full integration of quadrilaterals: t²/(t² + 10 h²) of shear, t²/(t² + 1000 s²) of a rise s.
SHEAR_FACTOR = 10.0
MEMBRANE_FACTOR = 1000.0
#: Patch radius over thickness with which a plate deforms as a solid without its dent (measured).
PATCH_RADIUS = 1.0


class Sheet(Checked):
    """Base of `Shell` and `Laminate`: both have the same element and may share a mesh."""

    kind: ClassVar[Kind] = Kind("sheet", outside=False, point_load=False, sheet=True)

    #: direction of 0° (None: any), and direction toward the last layer (None: +z on a plane mesh,
    #: else the normals of the cells)
    axis: Direction | None = None
    top: Direction | None = None
    #: distance of the middle of the section from the mesh, toward the top, m
    offset: float = 0.0

    @property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the surface of the mesh."""
        raise NotImplementedError

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Strain and kinetic energy of the shell; cubic triangles, quadratic quadrilaterals.
        InputError unless the mesh is one of faces and `order` is 2."""
        if mesh.tdim != 2:
            raise InputError(
                f"{type(self).__name__} needs a mesh of triangles or quadrilaterals; {mesh.name} "
                f"has {mesh.cell} cells (lines: Beam, volumes: Solid)."
            )
        if order != 2:
            raise InputError("Shell elements need the order 2 of Structure, its default.")
        triangles = mesh.cell == "triangle"
        space = compat.lagrange_space(mesh.dolfinx, 3 if triangles else 2, 6)
        section = section_fields(mesh, parts)
        w = ufl.TrialFunction(space)
        v = ufl.TestFunction(space)
        frame = frames(mesh, parts)
        X = compat.reference_coordinates(mesh.dolfinx) if triangles else None

        def strains(motion: Expr) -> SurfaceStrains:
            full = strains_of(frame, motion, section.middle)
            if X is None:
                return full
            omitted = dropped_shear(mesh, X, motion, frame.n, frame.along)
            return full._replace(shear=full.shear - omitted)

        membrane, shear, bending = energies(section, strains(w), strains(v))
        motion = inertia(section, frame, w, v)

        if triangles:
            curved = 2 * (mesh.order - 1)
            stiffness = [(membrane + shear + bending) * measure(mesh, 6 + curved)]
            mass = [motion * measure(mesh, 6 + curved)]
        else:
            for_shear = section.t2_of_shear / (section.t2_of_shear + SHEAR_FACTOR * areas_of(mesh))
            rise2 = rise_of(mesh) ** 2
            for_membrane = section.t2_of_stretch / (section.t2_of_stretch + MEMBRANE_FACTOR * rise2)
            full = for_membrane * membrane + for_shear * shear + bending
            reduced = (1 - for_membrane) * membrane + (1 - for_shear) * shear
            stiffness = [full * measure(mesh, 5), reduced * measure(mesh, 3)]
            mass = [motion * measure(mesh, 5)]

        return WeakForm(
            space=space,
            stiffness=stiffness,
            mass=mass,
            components={name: (i,) for i, name in enumerate(("x", "y", "z", "rx", "ry", "rz"))},
            density=section.I0,
            mass_moment=None if section.I1 is None else section.I1 * frame.n,
        )

    def half_space_compliance(self, cosine: float) -> float:
        """0: a shell is rigid through its thickness; only the contact law has indentation."""
        return 0.0

    def constants(self) -> tuple[float, float, float]:
        """Raise InputError: orthotropic layers have no single E, nu and rho."""
        raise InputError(
            f"advise takes no {type(self).__name__}: give dimensions and equivalent E, nu, rho."
        )

    @property
    def patch_radius(self) -> float:
        """Default radius of a site's patch, m."""
        return PATCH_RADIUS * self.section.thickness

    def dimensions(self, box: Box, materials: Sequence[Sheet]) -> Box:
        """Length and width of the box; thickness of the thinnest sheet."""
        return box[0], box[1], min(material.section.thickness for material in materials)


@dataclass(frozen=True)
class Shell(Isotropic, Sheet):
    """An isotropic plate or shell with shear deformation and rotary inertia.

    Parameters
    ----------
    E, nu, rho : float
        Young's modulus (Pa), Poisson's ratio, density (kg/m³).
    thickness : float
        Thickness, m.
    offset : float
        Distance of the middle surface from the mesh toward the top, m; default 0: the mesh is the
        middle surface. Areas and mass are computed on the mesh.
    top : sequence of 3 floats or function, optional
        As for `Laminate`; only an offset needs it.
    yield_strength : float, optional
        For the margin of safety (`peak_field`), Pa.

    Components: x, y, z (displacements) and rx, ry, rz (rotations). Triangles, plane or curved, are
    cubic and fully integrated; in the shear strain the rotations are replaced by quadratics with
    the same moments along the edges, so that thin plates do not lock (see `_cubic_remainders`).
    Quadrilaterals are quadratic. Their shear strain is integrated at 2×2 points, with a share of
    full integration that vanishes with the thickness. The same holds for the membrane strain of
    curved quadrilaterals, which are for smooth surfaces only: use triangles where surfaces or
    stiffeners join. Flat quadrilaterals have fully integrated membrane strains. Orientations of
    neighbouring cells may differ: the energy does not depend on the sign of the normal.
    """

    thickness: float = field(metadata=checked_by(positive, "m"))
    offset: float = field(default=0.0, metadata=checked_by(number, "m"))
    top: Direction | None = field(default=None, metadata=DIRECTION_CHECK)

    @cached_property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the surface of the mesh."""
        layer = Layer.isotropic(self.E, self.nu, self.rho, self.thickness)
        return section_of_layers([layer]).shifted(self.offset)


@dataclass(frozen=True)
class Laminate(Sheet):
    """A plate or shell of orthotropic layers, perfectly bonded: composites, sandwiches.

    Parameters
    ----------
    layers : sequence of Layer
        From the bottom to the top.
    axis : sequence of 3 floats or function
        Direction of 0°, projected onto the surface in every cell; default x. A function of points x
        (3, n) returns such vectors (3, n), for instance the hoop direction of a tank.
    top : sequence of 3 floats or function, optional
        A direction that points to the side of the surface on which the last layer lies. Default: +z
        on a plane mesh; in space the normals of the cells, which must then be consistent from cell
        to cell if the stack is not symmetric about its middle.
    offset : float
        Distance of the middle of the stack from the mesh toward the top, m; default 0.

    Angles count from the axis toward normal × axis; the normal points to the top. Element,
    components and cells are as for `Shell`; both may be used in one mesh, by group. `section` holds
    the matrices A, B, D, S in the axes of the laminate. The transverse shear stiffness S is
    computed from the shear energy, not with a factor 5/6 (`antiosc.fem.elements`).

    Raises
    ------
    InputError
        No layers; with the mesh: an axis along a normal, a top along the surface, opposite normals.
    """

    layers: Sequence[Layer]
    axis: Direction = field(default=(1.0, 0.0, 0.0), metadata=DIRECTION_CHECK)
    top: Direction | None = field(default=None, metadata=DIRECTION_CHECK)
    offset: float = field(default=0.0, metadata=checked_by(number, "m"))

    def __post_init__(self) -> None:
        if isinstance(self.layers, Sequence):
            store(self, layers=tuple(self.layers))
        super().__post_init__()
        _ = self.section  # which checks the layers

    @cached_property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the surface of the mesh, in the axes (0°, 90°, normal)."""
        return section_of_layers(self.layers).shifted(self.offset)

    @property
    def thickness(self) -> float:
        """Sum of the layers' thicknesses, m."""
        return self.section.thickness

    def bar_speed(self) -> float:
        """√(E/ρ) [m/s] from the mean E along the layers' stiffer directions and the mean ρ."""
        stiffness = sum(max(layer.E1, layer.E2) * layer.thickness for layer in self.layers)
        return sqrt(stiffness / sum(layer.rho * layer.thickness for layer in self.layers))


def _definite_matrix(name: str, value: ArrayLike, size: int) -> Array:
    """`value` as a symmetric, positive definite matrix; otherwise InputError."""
    m = floats(name, value, (size, size))
    symmetric = np.abs(m - m.T).max() <= 1e-9 * np.abs(m).max()
    if not symmetric or not np.linalg.eigvalsh(m).min() > 1e-12 * np.abs(m).max():
        raise InputError(f"the stiffness {name} of a shell must be symmetric, positive definite.")
    return np.asarray((m + m.T) / 2)


@dataclass(frozen=True, eq=False)
class GivenSheet(Sheet):
    """A plate or shell whose bending stiffness is independent of its membrane stiffness.

    Parameters
    ----------
    A, D : array_like (3, 3)
        Membrane stiffness, N/m: in-plane forces = A (ε1, ε2, γ12); bending stiffness, N m:
        moments = D (κ1, κ2, 2κ12).
    S : array_like (2, 2)
        Transverse shear stiffness, N/m: shear forces = S (γ13, γ23).
    mass, inertia : float
        Mass per area, kg/m², and rotary inertia per area, kg.
    thickness : float
        Thickness, m, for patch radii and dimensions; the given stiffness and mass do not depend on
        it.
    axis, top, offset
        As for `Laminate`.
    B : array_like (3, 3)
        Coupling stiffness, N: forces = B × curvatures, moments = B × strains; default 0.

    Raises
    ------
    InputError
        S, or the stiffness (6, 6) of A, B and D, that is not symmetric and positive definite.
    """

    A: ArrayLike = field(metadata=checked_by(floats, (3, 3)))
    D: ArrayLike = field(metadata=checked_by(floats, (3, 3)))
    S: ArrayLike = field(metadata=checked_by(_definite_matrix, 2))
    mass: float = field(metadata=checked_by(positive))
    inertia: float = field(metadata=checked_by(positive))
    thickness: float = field(metadata=checked_by(positive))
    axis: Direction = field(default=(1.0, 0.0, 0.0), metadata=DIRECTION_CHECK)
    top: Direction | None = field(default=None, metadata=DIRECTION_CHECK)
    offset: float = field(default=0.0, metadata=checked_by(number, "m"))
    B: ArrayLike = field(default=((0.0,) * 3,) * 3, metadata=checked_by(floats, (3, 3)))

    def __post_init__(self) -> None:
        super().__post_init__()
        A, B, D = np.asarray(self.A), np.asarray(self.B), np.asarray(self.D)
        t = np.sqrt(np.abs(D).max() / (np.abs(A).max() or 1.0))  # of the size of the thickness
        _definite_matrix("A, B, D", np.block([[t * t * A, t * B], [t * B, D]]), 6)

    @cached_property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the shell surface."""
        A = np.asarray(self.A)
        return PlateSection(
            thickness=self.thickness,
            A=A,
            B=np.asarray(self.B),
            D=np.asarray(self.D),
            S=np.asarray(self.S),
            drilling=float(A[2, 2]),
            I0=self.mass,
            I1=0.0,
            I2=self.inertia,
        ).shifted(self.offset)

    def bar_speed(self) -> float:
        """√(E/ρ), m/s, along the stiffer direction."""
        return sqrt(float((1 / np.diag(np.linalg.inv(np.asarray(self.A))))[:2].max()) / self.mass)
