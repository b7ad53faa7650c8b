"""Interface of an element family (Solid, Beam, …) to `Structure`, and shared functions.

A material is a frozen dataclass of its constants that answers as `Family` says. Its method
`weak_form(mesh, parts, order)` gets `parts`, a list of (material, cells), where `cells` are the
cells of this rank that the material fills. All materials of one structure are of one `Kind`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import sqrt
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
import ufl

from antiosc.base._types import Array, Box, IntArray
from antiosc.base.checks import array, nonnegative, poisson, positive, shown
from antiosc.base.declared import Checked, checked_by
from antiosc.base.errors import InputError
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat

if TYPE_CHECKING:
    from dolfinx import fem
    from ufl.core.expr import Expr


@dataclass(frozen=True)
class WeakForm:
    """The function space of an element family on a mesh and its bilinear forms."""

    #: the dolfinx function space
    space: fem.FunctionSpace
    #: bilinear forms whose sum is K; one quadrature degree each
    stiffness: Sequence[ufl.Form]
    #: bilinear forms whose sum is M
    mass: Sequence[ufl.Form]
    #: component ("x", …, "rz") -> path of the scalar subspace in `space`, in UFL's flat order
    components: Mapping[str, tuple[int, ...]]
    #: mass per unit of cell measure, a UFL expression (total mass = its integral)
    density: Expr
    #: mass moment per unit of cell measure about the mesh (UFL vector: kg/m along the normal of a
    #: sheet, kg along the height of a beam), where the mass does not lie on it
    moment: Expr | None = None
    #: twist shifts the centroids of beams that lie off their line
    swerves: bool = False
    #: strains times √stiffness of the trial function (UFL vector), and the quadrature degree with
    #: which their squares make K; None where K's entries alone are accurate enough
    strains: tuple[Expr, int] | None = None

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        (path, *_) = self.components.values()
        return int(compat.subspace(self.space, path).element.basix_element.degree)

    def along(self, direction: Sequence[float] | Expr) -> Expr:
        """The test function's displacement along `direction` (UFL)."""
        return self._contracted("xyz", direction)

    def momentum(self, direction: Sequence[float] | Expr) -> Expr:
        """Density of momentum along `direction`, the test function being the velocity (UFL)."""
        linear = self.density * self.along(direction)
        if self.moment is None:
            return linear
        # (θ × m)·d
        return linear + self._contracted(("rx", "ry", "rz"), ufl.cross(self.moment, direction))

    def _contracted(self, names: Sequence[str], vector: Sequence[float] | Expr) -> Expr:
        v = ufl.TestFunction(self.space)
        flat = list(self.components)
        return sum(vector[i] * v[flat.index(n)] for i, n in enumerate(names) if n in flat)


@dataclass(frozen=True)
class Kind:
    """What holds for all materials of one element family."""

    name: str
    #: whether an impactor touches the exterior facets of the mesh, or else the cells themselves
    outside: bool
    #: whether the compliance under a point load has a limit, so that a site takes no patch
    point_load: bool
    #: whether beams on edges of the cells may stiffen them
    sheet: bool = False


@runtime_checkable
class Family(Protocol):
    """A material with the properties of its element family that a structure needs."""

    @property
    def kind(self) -> Kind:
        """The facts of the family; one structure has materials of one kind."""
        ...

    @property
    def patch_radius(self) -> float | None:
        """Radius (m) of a site's patch where none is given; None: a point."""
        ...

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """The space and forms of `parts` on `mesh` with displacements of degree `order`."""
        ...

    def half_space_compliance(self, cosine: float) -> float:
        """Compliance times radius (m²/N) of a half-space patch; 0 where the family has none.

        `cosine`: of the angle between the load and the surface normal.
        """
        ...

    def dimensions(self, box: Box, materials: Sequence[Any]) -> Box:
        """Length, width and thickness (m) of a part with this `box` along the axes around it.

        `materials`: all of the part, of this kind.
        """
        ...

    def bar_speed(self) -> float:
        """Speed √(E/ρ) of waves in a bar, m/s."""
        ...

    def constants(self) -> tuple[float, float, float]:
        """(E [Pa], nu, rho [kg/m³]); InputError for a material with directions."""
        ...


#: (material, cells of this rank that it fills)
Parts = Sequence[tuple[Any, IntArray]]


def _checked_prony(name: str, value: object) -> tuple[tuple[float, float], ...]:
    """Pairs (ratio, relaxation time) > 0."""
    pairs = array(name, list(value) if isinstance(value, list | tuple) else value, None)
    if not pairs.size:
        return ()
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not (pairs > 0).all():
        raise InputError(
            "prony must list pairs (stiffness over the long-term one, relaxation time in s), all "
            f"> 0; got {shown(value)}."
        )
    return tuple((ratio, tau) for ratio, tau in pairs.tolist())


@dataclass(frozen=True)
class Isotropic(Checked):
    """The constants of a material without directions, as `Family` asks for them.

    `yield_strength` (Pa), optional: with it `peak_field` tells the margin of safety.
    `loss` is its loss factor, for damping ratios by modal strain energy; `prony` its stiffness
    that relaxes, pairs (share of E, time in s): E(t) = E (1 + Σ share exp(-t/time)).
    """

    E: float = field(metadata=checked_by(positive, "Pa"))
    nu: float = field(metadata=checked_by(lambda _, nu: poisson(nu)))
    rho: float = field(metadata=checked_by(positive, "kg/m³"))
    yield_strength: float | None = field(
        default=None, kw_only=True, metadata=checked_by(positive, "Pa")
    )
    loss: float = field(default=0.0, kw_only=True, metadata=checked_by(nonnegative))
    prony: Sequence[tuple[float, float]] = field(
        default=(), kw_only=True, metadata=checked_by(_checked_prony)
    )

    @property
    def G(self) -> float:
        """Shear modulus, Pa."""
        return self.E / (2 * (1 + self.nu))

    def half_space_compliance(self, cosine: float) -> float:
        """0: no local indentation; the contact law describes it alone."""
        return 0.0

    def bar_speed(self) -> float:
        """Speed √(E/ρ) of waves in a bar, m/s."""
        return sqrt(self.E / self.rho)

    def constants(self) -> tuple[float, float, float]:
        """(E [Pa], nu, rho [kg/m³])."""
        return self.E, self.nu, self.rho


def coefficient(mesh: Mesh, parts: Parts, value: Callable[[Any], float | Array]) -> Expr:
    """`value(material)`, a number or a matrix, of each cell (UFL)."""
    if len(parts) == 1:  # kernels read it once, not of every cell
        return compat.constant(mesh.dolfinx, value(parts[0][0]))
    shape = np.shape(value(parts[0][0]))
    size = int(np.prod(shape, dtype=int))
    function = compat.cellwise(mesh.dolfinx, size if shape else 0)
    values = function.x.array.reshape(-1, size)
    for material, cells in parts:
        values[cells] = np.ravel(value(material))
    if not shape:
        return function
    rows, columns = shape
    return ufl.as_matrix([[function[columns * i + j] for j in range(columns)] for i in range(rows)])


def restricted(forms: Sequence[ufl.Form], mesh: Mesh, cells: IntArray) -> list[ufl.Form]:
    """The forms of some cells alone."""
    inside = compat.cellwise(mesh.dolfinx, 0)
    inside.x.array[cells] = 1.0
    return [
        ufl.Form([one.reconstruct(integrand=inside * one.integrand()) for one in form.integrals()])
        for form in forms
    ]


def measure(mesh: Mesh, degree: int | None) -> ufl.Measure:
    """Integration over the cells with a fixed quadrature degree (None: UFL's estimate)."""
    metadata = {} if degree is None else {"quadrature_degree": degree}
    return ufl.Measure("dx", domain=mesh.dolfinx, metadata=metadata)


def tangent(mesh: Mesh) -> Expr:
    """Unit vector along the cells of a mesh of lines (UFL)."""
    J = ufl.Jacobian(mesh.dolfinx)
    t = ufl.as_vector([J[i, 0] for i in range(mesh.gdim)])
    return t / ufl.sqrt(ufl.dot(t, t))
