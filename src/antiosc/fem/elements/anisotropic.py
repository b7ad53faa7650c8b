"""`AnisotropicSolid`: linear elasticity with directions on 3-D meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array, Box
from antiosc.base.brief import Given
from antiosc.base.checks import array, kept, positive, store, within_range
from antiosc.base.errors import InputError
from antiosc.fem.elements.solid import general_form
from antiosc.fem.elements.weak_form import Kind, Parts, WeakForm
from antiosc.fem.mesh.mesh import Mesh

#: Axes of the entries of a stress or an engineering strain: 11, 22, 33, 23, 13, 12.
VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
#: Share of the largest entry up to which a stiffness matrix is symmetric.
SYMMETRY = 1e-9


@dataclass(frozen=True, eq=False)
class AnisotropicSolid(Given):
    """A linear-elastic solid with directions: wood, single crystals, unidirectional composites.

    Parameters
    ----------
    stiffness : array_like (6, 6)
        Stresses (σ11, σ22, σ33, σ23, σ13, σ12) of the strains (ε11, ε22, ε33, γ23, γ13, γ12) in the
        material's axes, Pa; symmetric and positive definite. See `orthotropic`.
    rho : float
        Density, kg/m³.
    axes : array_like (2, 3) or (3, 3), optional
        Directions 1 and 2 of the material (and 3, which follows), as rows; default x, y, z.

    It may fill groups of cells beside `Solid`. Sites on it are points: a patch has no known
    half-space compliance.

    Raises
    ------
    InputError
        A matrix that is not symmetric or not positive definite, axes that are not perpendicular.
    """

    kind: ClassVar[Kind] = Kind("solid", outside=True, point_load=False)
    patch_radius: ClassVar[None] = None

    stiffness: ArrayLike
    rho: float
    axes: ArrayLike | None = None

    def __post_init__(self) -> None:
        C = array("stiffness", self.stiffness, (6, 6))
        if np.abs(C - C.T).max() > SYMMETRY * np.abs(C).max():
            raise InputError("stiffness must be symmetric.")
        least = float(np.linalg.eigvalsh((C + C.T) / 2).min())
        if not least > 1e-12 * float(np.abs(C).max()):
            raise InputError(
                "stiffness must be positive definite, else the strain energy is not positive; its "
                f"least eigenvalue is {least:.3g} Pa."
            )
        store(self, stiffness=kept((C + C.T) / 2), rho=positive("rho", self.rho, "kg/m³"))
        store(self, axes=kept(_axes(self.axes)))

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
        """Three perpendicular planes of symmetry.

        E : (E1, E2, E3) in Pa; nu : (nu12, nu13, nu23), nu12 the contraction along 2 under stress
        along 1; G : (G12, G13, G23) in Pa.
        """
        moduli, ratios, shear = (
            array(name, value, (3,)) for name, value in (("E", E), ("nu", nu), ("G", G))
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
        for k, (i, j) in enumerate(VOIGT):
            number[i, j] = number[j, i] = k
        full = C[number[:, :, None, None], number[None, None]]
        R = np.asarray(self.axes)  # rows: the material's directions
        rotated = np.einsum("ia,jb,kc,ld,ijkl->abcd", R, R, R, R, full, optimize=True)
        i, j = np.array(VOIGT).T
        return np.asarray(rotated[i[:, None], j[:, None], i[None], j[None]])

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Displacements of degree `order`, as `Solid` has them."""
        return general_form(mesh, parts, order)

    def half_space_compliance(self, cosine: float) -> float:
        """InputError: it depends on the directions of the surface and of the material."""
        raise InputError(
            "a site with a radius on an AnisotropicSolid is not supported, for the half-space "
            "compliance of its patch is not known: leave radius=None, or make the cells around the "
            "site a Solid."
        )

    def dimensions(self, box: Box, materials: Sequence[Any]) -> Box:
        """The box."""
        return box

    def bar_speed(self) -> float:
        """√(E/ρ), m/s, along the stiffest of the material's directions."""
        S = np.linalg.inv(np.asarray(self.stiffness))
        return sqrt(float((1 / np.diag(S)[:3]).max()) / self.rho)

    def constants(self) -> tuple[float, float, float]:
        """InputError: the material has directions."""
        raise InputError(
            "advise needs an isotropic material; got an AnisotropicSolid: give the dimensions, and "
            "equivalent E, nu, rho of the part."
        )


def _axes(given: Any) -> Array:
    """Three perpendicular unit vectors as rows."""
    if given is None:
        return np.eye(3)
    rows = array("axes", given, (None, 3))
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
