"""Materials of decks, in the decks' units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc.fem.readers.deck import Array, Place


@dataclass
class Material:
    """Linear elasticity and density in the deck's units."""

    name: str
    place: Place
    #: E1, E2, E3, nu12, nu13, nu23, G12, G13, G23; E3, nu13, nu23 may be nan (a lamina)
    constants: Array | None = None
    #: stresses (11, 22, 33, 23, 13, 12) of strains (6, 6), where `constants` do not say it all
    stiffness: Array | None = None
    #: stresses (11, 22, 12) of plane strains (3, 3), of a material of shells alone
    plane: Array | None = None
    density: float | None = None

    @property
    def isotropic(self) -> tuple[float, float] | None:
        """(E, nu) if the material is isotropic."""
        if self.constants is None:
            return None
        E1, E2, E3, n12, n13, n23, *G = self.constants
        alike = np.allclose([E2, E3], E1, rtol=1e-4) and np.allclose([n13, n23], n12, atol=1e-4)
        if alike and np.allclose(G, E1 / (2 * (1 + n12)), rtol=1e-4):
            return float(E1), float(n12)
        return None


def isotropic(E: float, nu: float) -> Array:
    """Constants of an isotropic material."""
    G = E / (2 * (1 + nu))
    return np.array([E, E, E, nu, nu, nu, G, G, G])


def of_stiffness(D: Array) -> Array:
    """Constants of an orthotropic stiffness matrix (6, 6); LinAlgError if it is singular."""
    S = np.linalg.inv(D)
    E = 1 / np.diag(S)[:3]
    return np.array([*E, -S[0, 1] * E[0], -S[0, 2] * E[0], -S[1, 2] * E[1], *(1 / np.diag(S)[3:])])
