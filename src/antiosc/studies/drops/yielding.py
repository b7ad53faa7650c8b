"""Whether the contacts of a fall themselves yield."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import without_warnings
from antiosc.contact import ContactLaw, Hertz
from antiosc.contact.geometry import effective_modulus, hertz_stiffness, relative_curvatures
from antiosc.results.margin import HertzContact
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.episode import Episode
from antiosc.studies.drops.floor import Floor, law_of

#: How the law is given that yields.
REMEDY = "Floor(law={}), with the same friction"


def contact_yield(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> str:
    """That the pressure of a contact exceeds that at first yield; "" where not, or unknown.

    Known of contacts by Hertz's law of parts with a yield strength.
    """
    with without_warnings():
        found = list(_contacts(body, floor, episodes))
    return max(found, key=lambda one: one.share).told(REMEDY) if found else ""


def _contacts(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> Iterator[HertzContact]:
    """The contacts by Hertz's law whose strength is known."""
    if body.strengths is None:
        return
    for one in episodes:
        for i, force in zip(one.which.tolist(), one.forces()[1].max(axis=0), strict=True):
            strength, radii = float(body.strengths[i]), tuple(body.radii[i].tolist())
            stiffness = _stiffness(law_of(floor, radii, body.materials[i]))
            if force > 0 and strength > 0 and stiffness is not None:
                modulus = _modulus(stiffness, radii, body.materials[i])
                yield HertzContact(stiffness, modulus, float(force), strength)


def _stiffness(law: ContactLaw) -> float | None:
    """k_H [N m^-3/2] of a law by Hertz, with whatever damping; None of others."""
    stiffness, exponent = (getattr(law, name, None) for name in ("stiffness", "exponent"))
    return stiffness if isinstance(law, Hertz) or exponent == 1.5 else None


def _modulus(stiffness: float, radii: tuple[float, float], material: Array) -> float:
    """E* [Pa] of a law on a plane: from the radii, at most that of the part on a rigid floor.

    A stiffer law that is given is one of larger radii.
    """
    flat = relative_curvatures(radii, (np.inf, np.inf), 0.0)
    E, nu = material.tolist()
    return min(stiffness / hertz_stiffness(1.0, *flat), effective_modulus(E, nu, None, None))
