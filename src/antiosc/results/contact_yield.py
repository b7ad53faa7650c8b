"""Whether the contact itself yields, of which no mesh and no margin of a part's stresses tells."""

from __future__ import annotations

from typing import Any

from antiosc.base._types import Array
from antiosc.base.engineering import engineering
from antiosc.contact import Hertz
from antiosc.contact.geometry import effective_modulus
from antiosc.fem.assembly import with_parts
from antiosc.fem.structure.structure import Structure
from antiosc.simulation.histories.contact_stress import hertz_pressure

#: Largest pressure over the yield strength at which yield begins below a Hertzian contact
#: (K. L. Johnson, *Contact Mechanics* (1985), (6.9)).
FIRST_YIELD = 1.6


def contact_yield(structure: Structure, shapes: Array, history: Any) -> str:
    """That the pressure of an impact exceeds that at first yield; "" where not, or unknown.

    Known of the one contact of `simulate` by Hertz's law, of an elastic impactor and a part of one
    isotropic material.
    """
    contacts: Any = getattr(history, "contact_histories", ())
    law = history.assembly.scene.contacts[0].law if len(contacts) == 1 else None
    if not isinstance(law, Hertz) or not contacts[0].peak_force > 0:
        return ""
    members = with_parts(structure).fields(shapes, None)
    materials = {id(one): one for member, _ in members for one, _ in member.part.parts}
    striker = history.impactor
    own: list[Any] = [getattr(striker, name, None) for name in ("E", "nu")]
    own += [
        getattr(one, name, None)
        for one in materials.values()
        for name in ("E", "nu", "yield_strength")
    ]
    if len(own) != 5 or not all(isinstance(value, float) for value in own):
        return ""
    E, nu, part_E, part_nu, strength = own
    modulus = effective_modulus(E, nu, part_E, part_nu)
    pressure = hertz_pressure(law.stiffness, modulus, contacts[0].peak_force)
    if pressure <= FIRST_YIELD * strength:
        return ""
    return (
        f"under the contact itself the pressure is {engineering(pressure, 'Pa')}, above"
        f" {FIRST_YIELD:g} times the yield strength: it yields there, and Hertz's force is too high"
        " (see Thornton)"
    )
