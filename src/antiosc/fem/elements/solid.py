"""`Solid`: linear elasticity on 2-D and 3-D meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
import ufl

from antiosc.base._types import Array, Box
from antiosc.base.checks import choice, positive
from antiosc.base.declared import checked_by
from antiosc.base.errors import InputError
from antiosc.fem.elements.weak_form import (
    Isotropic,
    Kind,
    Parts,
    WeakForm,
    coefficient,
    measure,
)
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat

#: Ratio of the edges of a cell, and of the part to its shortest edge, from which K is taken by its
#: strains; and the number of cells up to which the memory for these is small.
THIN_CELL, THIN_PART, MOST_THIN_CELLS = 8.0, 100.0, 1000
#: Corners of the edges of cells, dolfinx's numbers.
SOLID_EDGES = {
    "tetrahedron": [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)],
    "hexahedron": [
        *((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3)),
        *((4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)),
    ],
}


@dataclass(frozen=True)
class Solid(Isotropic):
    """An isotropic linear-elastic solid.

    Parameters
    ----------
    E : float
        Young's modulus, Pa.
    nu : float
        Poisson's ratio, -1 < nu < 0.5.
    rho : float
        Density, kg/m³.
    plane : None, "stress" or "strain"
        Required on 2-D meshes, and only there.
    thickness : float
        Thickness of a 2-D part, m.
    yield_strength : float, optional
        For the margin of safety (`peak_field`), Pa.
    """

    kind: ClassVar[Kind] = Kind("solid", outside=True, point_load=False)
    #: the compliance of a point grows without limit, but no radius is the right one everywhere
    patch_radius: ClassVar[None] = None

    plane: Literal["stress", "strain"] | None = field(
        default=None, metadata=checked_by(choice, (None, "stress", "strain"))
    )
    thickness: float = field(default=1.0, metadata=checked_by(positive, "m"))

    @property
    def voigt(self) -> Array:
        """Stresses (σ11, σ22, σ33, σ23, σ13, σ12) of unit strains, (6, 6), Pa."""
        shear = self.E / (2 * (1 + self.nu))
        C = np.diag([2 * shear] * 3 + [shear] * 3)
        C[:3, :3] += self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu))
        return C

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Displacements of degree `order`, which must not be below the geometric order."""
        _check_cells(mesh, order)
        if len({type(material) for material, _ in parts}) > 1:  # some have directions
            return general_form(mesh, parts, order)
        for material, _ in parts:
            _check_plane(material, mesh)
        space = compat.lagrange(mesh.dolfinx, order, mesh.gdim)
        u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        lame = coefficient(mesh, parts, _first_lame)
        shear = coefficient(mesh, parts, lambda s: s.E / (2 * (1 + s.nu)))
        depth = coefficient(mesh, parts, _depth)
        rho = coefficient(mesh, parts, lambda s: s.rho)
        strain, virtual = ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))
        stress = lame * ufl.tr(strain) * ufl.Identity(mesh.gdim) + 2 * shear * strain
        for_k, for_m = _degrees(mesh, order)
        return WeakForm(
            space=space,
            stiffness=[depth * ufl.inner(stress, virtual) * measure(mesh, for_k)],
            mass=[depth * rho * ufl.inner(u, v) * measure(mesh, for_m)],
            components={name: (i,) for i, name in enumerate("xyz"[: mesh.gdim])},
            density=depth * rho,
            strains=_strains(mesh, parts, u, for_k) if _is_thin(mesh) else None,
        )

    def half_space_compliance(self, cosine: float) -> float:
        """Displacement × radius / force of a patch with Hertz's pressure, m²/N.

        Load and displacement are weighted by √(1 − r²/a²) and taken along one direction, whose
        angle to the surface normal has this `cosine`: 0.6 (1 − ν²)/E along the normal,
        0.3 (2 − ν)(1 + ν)/E in the surface, from the fields of Johnson, *Contact Mechanics*
        (1985), (3.41a) and (3.91a). A plane part has no such value (the half-plane's compliance
        grows with its size): 0.
        """
        if self.plane is not None:
            return 0.0
        normal = 0.6 * (1 - self.nu**2) / self.E
        tangential = 0.3 * (2 - self.nu) * (1 + self.nu) / self.E
        return cosine**2 * normal + (1 - cosine**2) * tangential

    def dimensions(self, box: Box, materials: Sequence[Solid]) -> Box:
        """The box; of a plane part the thickness is the material's."""
        if self.plane is None:
            return box
        length, width, _ = box
        return length, self.thickness, width


def _check_cells(mesh: Mesh, order: int) -> None:
    if mesh.tdim != mesh.gdim:
        raise InputError(
            f"Solid needs cells of the dimension of the space; {mesh.name} has {mesh.cell} "
            f"cells in {mesh.gdim}-D (a plane part: read it with gdim=2; lines: use Beam)."
        )
    if order < mesh.order:
        raise InputError(
            f"displacements of order {order} on cells of geometric order {mesh.order} cannot "
            "represent rigid rotations: use order=2, or read the mesh with order=1."
        )


def general_form(mesh: Mesh, parts: Parts, order: int) -> WeakForm:
    """The form of solids of which some have directions, by their matrices `voigt` (6, 6)."""
    _check_cells(mesh, order)
    if mesh.gdim != 3:
        raise InputError(f"AnisotropicSolid is for 3-D meshes; {mesh.name} is 2-D.")
    for material, _ in parts:
        if isinstance(material, Solid):
            _check_plane(material, mesh)
    space = compat.lagrange(mesh.dolfinx, order, 3)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    C = coefficient(mesh, parts, lambda s: s.voigt)
    rho = coefficient(mesh, parts, lambda s: s.rho)
    for_k, for_m = _degrees(mesh, order)
    return WeakForm(
        space=space,
        stiffness=[ufl.inner(C * _voigt_strain(u), _voigt_strain(v)) * measure(mesh, for_k)],
        mass=[rho * ufl.inner(u, v) * measure(mesh, for_m)],
        components={name: (i,) for i, name in enumerate("xyz")},
        density=rho,
    )


def _is_thin(mesh: Mesh) -> bool:
    """Whether cells are so thin that rounding of K's entries spoils the bending stiffness.

    Half a unit in their last place changed the stiffness of a plate of 300 × 30 × 1 by 3e-6.
    """
    if mesh.gdim != 3 or mesh.n_cells > MOST_THIN_CELLS:
        return False
    x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    corners = x[:, : len(mesh.geometry.corners)]
    ends = corners[:, SOLID_EDGES[mesh.cell]]
    lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    least = np.min(mesh.comm.allgather(lengths.min(initial=np.inf)))
    aspect = np.max(mesh.comm.allgather((lengths.max(axis=1) / lengths.min(axis=1)).max(initial=1)))
    return bool(aspect > THIN_CELL and mesh.extent() > THIN_PART * least)


def _strains(mesh: Mesh, parts: Parts, u: Any, degree: int) -> tuple[Any, int]:
    """Strains times √stiffness, and the degree of K's quadrature."""
    root = coefficient(mesh, parts, lambda s: np.linalg.cholesky(s.voigt).T)
    return root * _voigt_strain(u), degree


def _voigt_strain(u: Any) -> Any:
    """(ε11, ε22, ε33, γ23, γ13, γ12)."""
    e = ufl.sym(ufl.grad(u))
    shear = [2 * e[1, 2], 2 * e[0, 2], 2 * e[0, 1]]
    return ufl.as_vector([e[0, 0], e[1, 1], e[2, 2], *shear])


def _check_plane(solid: Solid, mesh: Mesh) -> None:
    if mesh.gdim == 2 and solid.plane is None:
        raise InputError("Solid on a 2-D mesh needs plane='stress' or plane='strain'.")
    if mesh.gdim == 3 and solid.plane is not None:
        raise InputError(f"plane={solid.plane!r} applies to 2-D meshes; {mesh.name} is 3-D.")


def _first_lame(solid: Solid) -> float:
    """λ, or λ* of plane stress, which makes the normal stress across the plane zero."""
    if solid.plane == "stress":
        return solid.E * solid.nu / (1 - solid.nu**2)
    return solid.E * solid.nu / ((1 + solid.nu) * (1 - 2 * solid.nu))


def _depth(solid: Solid) -> float:
    return 1.0 if solid.plane is None else solid.thickness


def _degrees(mesh: Mesh, order: int) -> tuple[int, int]:
    """Quadrature degrees of K and M: exact on straight simplices, full Gauss rules elsewhere.

    UFL's estimate would need thousands of points on curved cells.
    """
    if mesh.cell in ("quadrilateral", "hexahedron"):
        return 2 * order + 1, 2 * order + 1
    if mesh.order == 1:
        return 2 * order - 2, 2 * order
    return 2 * order, 2 * order + 1
