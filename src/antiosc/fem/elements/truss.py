"""`Truss`: straight bars on line meshes that carry axial forces alone, joined by hinges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import sqrt
from typing import ClassVar

import ufl

from antiosc.base._types import Box
from antiosc.base.checks import positive
from antiosc.base.declared import checked_by
from antiosc.base.errors import InputError
from antiosc.fem.elements.weak_form import (
    Isotropic,
    Kind,
    Parts,
    WeakForm,
    coefficient,
    measure,
    tangent,
)
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat


@dataclass(frozen=True)
class Truss(Isotropic):
    """Bars of a truss: each cell of a mesh of lines is one, between two hinges.

    Parameters
    ----------
    E, nu, rho : float
        Young's modulus (Pa), Poisson's ratio, density (kg/m³).
    area : float
        Of the cross-section, m².
    yield_strength : float, optional
        For the margin of safety (`peak_field`), Pa.

    Components: x, y, z, or x, y in a plane. The elements are linear whatever the `order` of
    `Structure`, with half of the mass of a bar at each end. A node that only collinear bars hold is
    a mechanism: a bar that is divided into several cells needs supports or other bars there.
    """

    kind: ClassVar[Kind] = Kind("truss", outside=False, point_load=True)
    patch_radius: ClassVar[None] = None

    area: float = field(metadata=checked_by(positive, "m²"))

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Axial strain energy of the bars, and their masses at the ends."""
        if mesh.tdim != 1:
            raise InputError(
                f"Truss needs a mesh of lines; {mesh.name} has {mesh.cell} cells (use Solid)."
            )
        if mesh.order != 1:
            raise InputError("the bars of a Truss are straight; read the mesh with order=1.")
        space = compat.lagrange(mesh.dolfinx, 1, mesh.gdim)
        w, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        t = tangent(mesh)
        EA = coefficient(mesh, parts, lambda truss: truss.E * truss.area)
        density = coefficient(mesh, parts, lambda truss: truss.rho * truss.area)

        def strain(u: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
            return ufl.dot(ufl.dot(ufl.grad(u), t), t)

        at_ends = {"quadrature_rule": "GLL", "quadrature_degree": 1}
        return WeakForm(
            space=space,
            stiffness=[EA * strain(w) * strain(v) * measure(mesh, 0)],
            mass=[density * ufl.dot(w, v) * ufl.dx(domain=mesh.dolfinx, metadata=at_ends)],
            components={name: (i,) for i, name in enumerate("xyz"[: mesh.gdim])},
            density=density,
        )

    def half_space_compliance(self, cosine: float) -> float:
        """0: a bar has no local indentation; the contact law describes it alone."""
        return 0.0

    def dimensions(self, box: Box, materials: Sequence[Truss]) -> Box:
        """The length of the box; width and thickness of the thickest and thinnest square bars."""
        areas = [one.area for one in materials]
        return box[0], sqrt(max(areas)), sqrt(min(areas))
