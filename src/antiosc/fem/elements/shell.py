"""`Shell`, `Laminate`: Reissner–Mindlin plates and shells on triangles or quadrilaterals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import ufl
from numpy.typing import ArrayLike

from antiosc.base._types import Array, Box
from antiosc.base.checks import Checked, array, checked_by, number, positive, store
from antiosc.base.errors import InputError
from antiosc.fem.elements.material_axes import DIRECTION, Direction
from antiosc.fem.elements.sections import Layer, PlateSection, stacked
from antiosc.fem.elements.shell_strains import (
    Strains,
    areas_of,
    dropped,
    energies,
    frames,
    inertia,
    rise_of,
    section_fields,
    strains_of,
)
from antiosc.fem.elements.weak_form import Isotropic, Kind, Parts, WeakForm, measure
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat

if TYPE_CHECKING:
    from ufl.core.expr import Expr

#: Quadrilaterals: the fully integrated shares are t²/(t² + 10 h²) of the shear energy and
#: t²/(t² + 1000 s²) of the membrane energy, s being the rise of a curved cell over its chords.
FOR_SHEAR, FOR_MEMBRANE = 10.0, 1000.0
#: Radius of a site's patch over the thickness, where none is given: that at which a plate deforms
#: as a solid does without what its patch has of a half-space (compared by benchmarks/fidelity.py).
PATCH_RADIUS = 1.0


class Sheet(Checked):
    """Base of `Shell` and `Laminate`: the element, on one mesh for both kinds of section."""

    kind: ClassVar[Kind] = Kind("sheet", outside=False, point_load=False, sheet=True)

    #: directions of 0° and of the last layer; None: any, and the normal of the cells
    axis: Direction | None = None
    top: Direction | None = None
    #: of the middle of the section from the mesh, toward the top, m
    offset: float = 0.0

    @property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the surface of the mesh."""
        raise NotImplementedError

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Strain and kinetic energy of the shell; cubic triangles, quadratic quadrilaterals."""
        if mesh.tdim != 2:
            raise InputError(
                f"{type(self).__name__} needs a mesh of triangles or quadrilaterals; {mesh.name} "
                f"has {mesh.cell} cells (lines: Beam, volumes: Solid)."
            )
        if order != 2:
            raise InputError("Shell elements need order=2 of Structure, its default.")
        areas = areas_of(mesh)
        triangles = mesh.cell == "triangle"
        space = compat.lagrange(mesh.dolfinx, 3 if triangles else 2, 6)
        section = section_fields(mesh, parts)
        w, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        frame = frames(mesh, parts)
        X = compat.reference_coordinates(mesh.dolfinx) if triangles else None

        def strains(motion: Expr) -> Strains:
            found = strains_of(frame, motion, section.middle)
            if X is None:
                return found
            lost = dropped(mesh, X, motion, frame.n, frame.along)
            return found._replace(shear=found.shear - lost)

        membrane, shear, bending = energies(section, strains(w), strains(v))
        motion = inertia(section, frame, w, v)
        if triangles:
            curved = 2 * (mesh.order - 1)
            stiffness = [(membrane + shear + bending) * measure(mesh, 6 + curved)]
            mass = [motion * measure(mesh, 6 + curved)]
        else:
            for_shear = section.t2_of_shear / (section.t2_of_shear + FOR_SHEAR * areas)
            rise2 = rise_of(mesh) ** 2
            for_membrane = section.t2_of_stretch / (section.t2_of_stretch + FOR_MEMBRANE * rise2)
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
            moment=None if section.I1 is None else section.I1 * frame.n,
        )

    def half_space_compliance(self, cosine: float) -> float:
        """0: a shell does not deform through its thickness; the contact law describes it alone."""
        return 0.0

    def constants(self) -> tuple[float, float, float]:
        """InputError: layers have directions."""
        raise InputError(
            f"advise needs an isotropic material; got a {type(self).__name__}: give the "
            "dimensions, and equivalent E, nu, rho of the part."
        )

    @property
    def patch_radius(self) -> float:
        """Radius of a site's patch where none is given, m."""
        return PATCH_RADIUS * self.section.thickness

    def dimensions(self, box: Box, materials: Sequence[Sheet]) -> Box:
        """Length and width of the box; the least thickness."""
        return box[0], box[1], min(one.section.thickness for one in materials)


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
        middle surface. Areas, and the mass with them, are those of the mesh.
    top : sequence of 3 floats or function, optional
        As of `Laminate`; for an offset alone.
    yield_strength : float, optional
        For the margin of safety (`peak_field`), Pa.

    Components: x, y, z (displacements) and rx, ry, rz (rotations). Triangles, plane or curved, are
    cubic and fully integrated; in the shear strain the rotations are replaced by quadratics with
    the same moments along the edges, so that thin plates do not lock (`shell_strains`).
    Quadrilaterals are quadratic. Their shear strain is integrated at 2×2 points, with a share of
    full integration that vanishes with the thickness. The same holds for the membrane strain of
    curved quadrilaterals, which are for smooth surfaces only: use triangles where surfaces or
    stiffeners join. Flat quadrilaterals have fully integrated membrane strains. Orientations of
    neighbouring cells may differ: the energy does not depend on the sign of the normal.
    """

    thickness: float = field(metadata=checked_by(positive, "m"))
    offset: float = field(default=0.0, metadata=checked_by(number, "m"))
    top: Direction | None = field(default=None, metadata=DIRECTION)

    @cached_property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the surface of the mesh."""
        layer = Layer.isotropic(self.E, self.nu, self.rho, self.thickness)
        return stacked([layer]).shifted(self.offset)


@dataclass(frozen=True)
class Laminate(Sheet):
    """A plate or shell of orthotropic layers, perfectly bonded: composites, sandwiches.

    Parameters
    ----------
    layers : sequence of Layer
        From the bottom to the top.
    axis : sequence of 3 floats or function
        Direction of 0°, projected onto the surface in every cell. A function of points x (3, n)
        returns such vectors (3, n), for instance the hoop direction of a tank.
    top : sequence of 3 floats or function, optional
        A direction that points to the side of the surface on which the last layer lies. Default: +z
        on a plane mesh; in space the normals of the cells, which must then be consistent from cell
        to cell if the stack is not symmetric about its middle.
    offset : float
        Distance of the middle of the stack from the mesh toward the top, m; default 0.

    Angles count from the axis toward normal × axis; the normal points to the top. The element, its
    components and its cells are those of `Shell`; both may be used in one mesh, by group. `section`
    holds the matrices A, B, D, S in the axes of the laminate. The transverse shear stiffness S
    follows from the shear energy, not from a factor 5/6 (`antiosc.fem.elements.sections`).

    Raises
    ------
    InputError
        No layers; with the mesh: an axis along a normal, a top along the surface, opposite normals.
    """

    layers: Sequence[Layer]
    axis: Direction = field(default=(1.0, 0.0, 0.0), metadata=DIRECTION)
    top: Direction | None = field(default=None, metadata=DIRECTION)
    offset: float = field(default=0.0, metadata=checked_by(number, "m"))

    def __post_init__(self) -> None:
        if isinstance(self.layers, Sequence):
            store(self, layers=tuple(self.layers))
        super().__post_init__()
        _ = self.section  # which checks the layers

    @cached_property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the surface of the mesh, in the axes (0°, 90°, normal)."""
        return stacked(self.layers).shifted(self.offset)

    @property
    def thickness(self) -> float:
        """Sum of the layers' thicknesses, m."""
        return self.section.thickness

    def bar_speed(self) -> float:
        """√(E/ρ), m/s, of the mean E along the stiffer directions of the layers and mean ρ."""
        stiffness = sum(max(layer.E1, layer.E2) * layer.thickness for layer in self.layers)
        return sqrt(stiffness / sum(layer.rho * layer.thickness for layer in self.layers))


def _definite(name: str, value: ArrayLike, size: int) -> Array:
    """A stiffness as a symmetric, positive definite matrix, or InputError."""
    m = array(name, value, (size, size))
    symmetric = np.abs(m - m.T).max() <= 1e-9 * np.abs(m).max()
    if not symmetric or not np.linalg.eigvalsh(m).min() > 1e-12 * np.abs(m).max():
        raise InputError(
            f"the stiffness {name} of a shell must be symmetric and positive definite."
        )
    return np.asarray((m + m.T) / 2)


@dataclass(frozen=True, eq=False)
class GivenSheet(Sheet):
    """A plate or shell with a bending stiffness that does not follow from its membrane stiffness.

    Parameters
    ----------
    A, D : array_like (3, 3)
        Forces of (ε1, ε2, γ12), N/m, and moments of (κ1, κ2, 2κ12), N m.
    S : array_like (2, 2)
        Shear forces of (γ13, γ23), N/m.
    mass, inertia : float
        Per area, kg/m² and kg.
    thickness : float
        For sites, m.
    axis, top, offset
        As of `Laminate`.

    Raises
    ------
    InputError
        Stiffnesses that are not symmetric and positive definite.
    """

    A: ArrayLike = field(metadata=checked_by(_definite, 3))
    D: ArrayLike = field(metadata=checked_by(_definite, 3))
    S: ArrayLike = field(metadata=checked_by(_definite, 2))
    mass: float = field(metadata=checked_by(positive))
    inertia: float = field(metadata=checked_by(positive))
    thickness: float = field(metadata=checked_by(positive))
    axis: Direction = field(default=(1.0, 0.0, 0.0), metadata=DIRECTION)
    top: Direction | None = field(default=None, metadata=DIRECTION)
    offset: float = field(default=0.0, metadata=checked_by(number, "m"))

    @cached_property
    def section(self) -> PlateSection:
        """Stiffness and mass per area of the surface of the mesh."""
        A = np.asarray(self.A)
        return PlateSection(
            thickness=self.thickness,
            A=A,
            B=np.zeros((3, 3)),
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


@dataclass(frozen=True, eq=False)
class Nearest:
    """A direction in each cell: the given one (n, 3) of the nearest place (n, 3)."""

    places: ArrayLike
    directions: Sequence[Sequence[float]]

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Directions (3, n) at points (3, n)."""
        from scipy.spatial import cKDTree

        nearest = cKDTree(np.asarray(self.places)).query(x.T)[1]
        return np.asarray(self.directions)[nearest].T
