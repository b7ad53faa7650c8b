"""`Solid` and `AnisotropicSolid`: linear elasticity on 2-D and 3-D meshes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import sqrt
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array, Box
from antiosc.base.checks import checked_by, choice, floats, positive, read_only, store, within_range
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr
from antiosc.fem.elements.weak_form import (
    Family,
    Isotropic,
    Kind,
    Parts,
    WeakForm,
    coefficient,
    compat,
    measure,
    ufl,
)

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from antiosc.fem.mesh import Mesh

#: K is integrated from strains if the ratio of a cell's edges exceeds this
THIN_CELL_RATIO = 8.0
#: and the ratio of the part's size to its shortest edge exceeds this.
THIN_PART_RATIO = 100.0
#: Up to so many cells the strains take little memory.
MOST_THIN_CELLS = 1000


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
    #: the compliance under a point load is infinite, but no default radius suits every part
    patch_radius: ClassVar[None] = None

    plane: Literal["stress", "strain"] | None = field(
        default=None, metadata=checked_by(choice, (None, "stress", "strain"))
    )
    thickness: float = field(default=1.0, metadata=checked_by(positive, "m"))

    @property
    def voigt(self) -> Array:
        """Stiffness (6, 6) [Pa]: (σ11, σ22, σ33, σ23, σ13, σ12) of engineering strains."""
        C = np.diag([2 * self.G] * 3 + [self.G] * 3)
        C[:3, :3] += self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu))
        return C

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Weak form with displacements of degree `order`. InputError if `order` is below the
        geometric order, or cells, space and `plane` do not fit."""
        _check_cells(mesh, order)
        return weak_form_of(mesh, parts, order)

    def half_space_compliance(self, cosine: float) -> float:
        """Displacement × radius / force of a patch with Hertz's pressure, m²/N.

        Load and displacement are weighted by √(1 − r²/a²) along one direction; `cosine` is that of
        its angle to the surface normal. The value is 0.6 (1 − ν²)/E along the normal and
        0.3 (2 − ν)(1 + ν)/E in the surface, from the fields of Johnson, *Contact Mechanics*
        (1985), (3.41a) and (3.91a). It is 0 for a plane part, as the compliance of a half-plane
        grows with its size.
        """
        if self.plane is not None:
            return 0.0
        normal = 0.6 * (1 - self.nu**2) / self.E
        tangential = 0.3 * (2 - self.nu) * (1 + self.nu) / self.E
        return cosine**2 * normal + (1 - cosine**2) * tangential

    def dimensions(self, box: Box, materials: Sequence[Solid]) -> Box:
        """The sides of the box; a plane part bends across its in-plane width, which comes last."""
        if self.plane is None:
            return box
        length, width, _ = box
        return length, self.thickness, width


def thickness_of(mesh: Mesh, parts: Parts) -> Expr:
    """Thickness [m] of plane parts, and 1 for other parts, as a UFL coefficient."""
    return coefficient(mesh, parts, lambda s: s.thickness if getattr(s, "plane", None) else 1.0)


def isotropic_stress(mesh: Mesh, parts: Parts) -> Callable[[Expr], Expr]:
    """Function from a strain tensor (gdim, gdim) of isotropic solids to the stress [Pa] (UFL)."""
    lame = coefficient(mesh, parts, _first_lame)
    shear = coefficient(mesh, parts, lambda s: s.E / (2 * (1 + s.nu)))

    def stress(strain: Expr) -> Expr:
        return lame * ufl.tr(strain) * ufl.Identity(mesh.gdim) + 2 * shear * strain

    return stress


def _check_cells(mesh: Mesh, order: int) -> None:
    """InputError unless cells have the dimension of space and a geometric order <= `order`."""
    if mesh.tdim != mesh.gdim:
        raise InputError(
            f"Solid needs cells of the dimension of the space; {mesh.name} has {mesh.cell} "
            f"cells in {mesh.gdim}-D (a plane part: read it with gdim 2; lines: use Beam)."
        )
    if order < mesh.order:
        raise InputError(
            f"displacements of order {order} on cells of geometric order {mesh.order} cannot "
            "represent rigid rotations: use order 2, or read the mesh with order 1."
        )


def weak_form_of(mesh: Mesh, parts: Parts, order: int) -> WeakForm:
    """Weak form of isotropic and anisotropic solids, also mixed. InputError for an AnisotropicSolid
    in 2-D, and a `plane` that does not fit the dimension."""
    directed = any(isinstance(material, AnisotropicSolid) for material, _ in parts)
    if directed and mesh.gdim != 3:
        raise InputError(f"AnisotropicSolid is for 3-D meshes; {mesh.name} is 2-D.")

    for plane in (getattr(material, "plane", None) for material, _ in parts):
        if mesh.gdim == 2 and plane is None:
            raise InputError("Solid on a 2-D mesh needs the plane 'stress' or 'strain'.")
        if mesh.gdim == 3 and plane is not None:
            raise InputError(f"plane {plane!r} applies to 2-D meshes; {mesh.name} is 3-D.")

    space = compat.lagrange_space(mesh.dolfinx, order, mesh.gdim)
    u = ufl.TrialFunction(space)
    v = ufl.TestFunction(space)
    depth = thickness_of(mesh, parts)

    if directed:
        C = coefficient(mesh, parts, lambda s: s.voigt)
        work = ufl.inner(C * _voigt_strain(u), _voigt_strain(v))
    else:
        stress = isotropic_stress(mesh, parts)
        work = depth * ufl.inner(stress(ufl.sym(ufl.grad(u))), ufl.sym(ufl.grad(v)))

    density = depth * coefficient(mesh, parts, lambda s: s.rho)

    for_k, for_m = quadrature_degrees(mesh, order)
    strains = None
    if not directed and _is_thin(mesh):
        root = coefficient(mesh, parts, lambda s: np.linalg.cholesky(s.voigt).T)
        strains = root * _voigt_strain(u), for_k

    return WeakForm(
        space=space,
        stiffness=[work * measure(mesh, for_k)],
        mass=[density * ufl.inner(u, v) * measure(mesh, for_m)],
        components={name: (i,) for i, name in enumerate("xyz"[: mesh.gdim])},
        density=density,
        strains=strains,
    )


def _is_thin(mesh: Mesh) -> bool:
    """Whether rounding of K spoils the bending stiffness of a thin solid: the error is 3e-6 if its
    sides are as 300 : 30 : 1."""
    if mesh.gdim != 3 or mesh.n_cells > MOST_THIN_CELLS:
        return False

    ends = mesh.geometry.nodes[:, mesh.geometry.edges]
    lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    shortest = np.min(mesh.comm.allgather(lengths.min(initial=np.inf)))
    aspect = np.max(mesh.comm.allgather((lengths.max(axis=1) / lengths.min(axis=1)).max(initial=1)))
    return bool(aspect > THIN_CELL_RATIO and mesh.extent() > THIN_PART_RATIO * shortest)


def _voigt_strain(u: Expr) -> Expr:
    """(ε11, ε22, ε33, γ23, γ13, γ12) of a displacement."""
    return voigt_strain(ufl.sym(ufl.grad(u)))


def voigt_strain(e: Expr) -> Expr:
    """(ε11, ε22, ε33, γ23, γ13, γ12) of a strain tensor."""
    shear = [2 * e[1, 2], 2 * e[0, 2], 2 * e[0, 1]]
    return ufl.as_vector([e[0, 0], e[1, 1], e[2, 2], *shear])


def voigt_stiffness(material: Any, dim: int) -> Array:
    """Stiffness of a material in Voigt order: (6, 6) [Pa], or (3, 3) [N/m] for plane parts."""
    C = np.asarray(material.voigt)
    if dim == 3:
        return C
    in_plane = [0, 1, 5]
    plane = C[np.ix_(in_plane, in_plane)]
    if material.plane == "stress":  # the normal stress across the plane is zero
        plane = plane - np.outer(C[in_plane, 2], C[2, in_plane]) / C[2, 2]
    return np.asarray(material.thickness * plane)


def _first_lame(solid: Solid) -> float:
    """Lamé's λ; for plane stress the λ* for which the stress normal to the plane is zero."""
    if solid.plane == "stress":
        return solid.E * solid.nu / (1 - solid.nu**2)
    return solid.E * solid.nu / ((1 + solid.nu) * (1 - 2 * solid.nu))


def quadrature_degrees(mesh: Mesh, order: int) -> tuple[int, int]:
    """Quadrature degrees for K and M: exact on straight simplices, full Gauss rules otherwise."""
    if mesh.cell in ("quadrilateral", "hexahedron"):
        return 2 * order + 1, 2 * order + 1
    if mesh.order == 1:
        return 2 * order - 2, 2 * order
    return 2 * order, 2 * order + 1


#: Index pairs of a stress or an engineering strain: 11, 22, 33, 23, 13, 12.
VOIGT_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
#: Largest asymmetry of a stiffness matrix, relative to its largest entry.
LARGEST_ASYMMETRY = 1e-9


@dataclass(frozen=True, eq=False)
class AnisotropicSolid(FieldsRepr):
    """A linear-elastic solid with directions: wood, single crystals, unidirectional composites.

    Parameters
    ----------
    stiffness : array_like (6, 6)
        Matrix from strains (ε11, ε22, ε33, γ23, γ13, γ12) to stresses (σ11, σ22, σ33, σ23, σ13,
        σ12) in the material's axes, Pa; symmetric and positive definite. See `orthotropic`.
    rho : float
        Density, kg/m³.
    axes : array_like (2, 3) or (3, 3), optional
        Directions 1 and 2 of the material (and 3, which follows), as rows; default x, y, z.

    A mesh may have groups of it and of `Solid`. Sites on it must be points, as the half-space
    compliance of a patch is not known.

    Raises
    ------
    InputError
        A matrix that is not symmetric or not positive definite, axes that are not perpendicular or
        not right-handed.
    """

    kind: ClassVar[Kind] = Kind("solid", outside=True, point_load=False)
    patch_radius: ClassVar[None] = None

    stiffness: ArrayLike
    rho: float
    axes: ArrayLike | None = None

    def __post_init__(self) -> None:
        C = floats("stiffness", self.stiffness, (6, 6))
        if np.abs(C - C.T).max() > LARGEST_ASYMMETRY * np.abs(C).max():
            raise InputError("stiffness must be symmetric.")
        smallest_eigenvalue = float(np.linalg.eigvalsh((C + C.T) / 2).min())
        if not smallest_eigenvalue > 1e-12 * float(np.abs(C).max()):
            raise InputError(
                f"stiffness must have eigenvalues > 0; got {smallest_eigenvalue:.3g} Pa."
            )

        store(self, stiffness=read_only((C + C.T) / 2), rho=positive("rho", self.rho, "kg/m³"))
        store(self, axes=read_only(_checked_axes(self.axes)))

    @classmethod
    @within_range
    def orthotropic(
        cls,
        E: Sequence[float],
        nu: Sequence[float],
        G: Sequence[float],
        rho: float,
        axes: ArrayLike | None = None,
    ) -> AnisotropicSolid:
        """A solid with three perpendicular planes of symmetry. E : (E1, E2, E3) in Pa; nu : (nu12,
        nu13, nu23), where nu12 is the contraction along 2 under stress along 1; G : (G12, G13, G23)
        in Pa. InputError if the strain energy is not positive."""
        moduli, ratios, shear = (
            floats(name, value, (3,)) for name, value in (("E", E), ("nu", nu), ("G", G))
        )
        for name, values in (("E", moduli), ("G", shear)):
            for value in values:
                positive(f"each of {name}", value, "Pa")

        S = np.diag(np.concatenate([1 / moduli, 1 / shear[::-1]]))
        for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
            S[i, j] = S[j, i] = -ratio / moduli[i]

        if np.linalg.eigvalsh(S).min() <= 0:
            raise InputError(
                "the strain energy of these constants is not positive: each nu_ij² must be below "
                "E_i/E_j, and 1 - nu12 nu21 - nu23 nu32 - nu13 nu31 - 2 nu21 nu32 nu13 above 0."
            )

        return cls(np.linalg.inv(S), rho, axes)

    @property
    def voigt(self) -> Array:
        """The stiffness matrix (6, 6) in the axes of the mesh, Pa."""
        C = np.asarray(self.stiffness)
        number = np.zeros((3, 3), dtype=int)
        for k, (i, j) in enumerate(VOIGT_PAIRS):
            number[i, j] = number[j, i] = k
        full = C[number[:, :, None, None], number[None, None]]
        R = np.asarray(self.axes)  # rows: the material's directions
        rotated = np.einsum("ia,jb,kc,ld,ijkl->abcd", R, R, R, R, full, optimize=True)
        i, j = np.array(VOIGT_PAIRS).T
        return np.asarray(rotated[i[:, None], j[:, None], i[None], j[None]])

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Weak form with displacements of degree `order`, as for `Solid`."""
        _check_cells(mesh, order)
        return weak_form_of(mesh, parts, order)

    def half_space_compliance(self, cosine: float) -> float:
        """Raise InputError: the compliance depends on the directions of surface and material."""
        raise InputError(
            "the patch of an AnisotropicSolid has no known compliance: leave the radius out, or "
            "make the cells around the site a Solid."
        )

    def dimensions(self, box: Box, materials: Sequence[Family]) -> Box:
        """The sides of the box."""
        return box

    def bar_speed(self) -> float:
        """√(E/ρ), m/s, along the stiffest of the material's directions."""
        S = np.linalg.inv(np.asarray(self.stiffness))
        return sqrt(float((1 / np.diag(S)[:3]).max()) / self.rho)

    def constants(self) -> tuple[float, float, float]:
        """Raise InputError: an anisotropic material has no single E, nu and rho."""
        raise InputError(
            "advise takes no AnisotropicSolid: give dimensions and equivalent E, nu, rho."
        )


def _checked_axes(axes: ArrayLike | None) -> Array:
    """The material axes as orthonormal rows (3, 3); InputError unless they are right-handed."""
    if axes is None:
        return np.eye(3)
    rows = floats("axes", axes, (None, 3))
    if len(rows) not in (2, 3):
        raise InputError(f"axes must be two or three directions (rows); got {len(rows)}.")
    length = np.linalg.norm(rows, axis=1)
    if not length.all():
        raise InputError("axes must not hold the zero vector.")
    units = rows / length[:, None]
    third = np.cross(units[0], units[1])
    cosines = [units[0] @ units[1], *([1 - third @ units[2]] if len(rows) == 3 else [])]
    if np.abs(cosines).max() > 1e-6:
        raise InputError("axes must be perpendicular to each other, and right-handed.")
    third /= np.linalg.norm(third)
    return np.stack([units[0], np.cross(third, units[0]), third])
