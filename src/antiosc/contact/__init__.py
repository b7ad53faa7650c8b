"""Contact laws: the force between two bodies as a function of their indentation."""

from antiosc.contact.base import ContactLaw, State
from antiosc.contact.plastic import Hysteretic, Stronge, Tabulated, TanSun, Thornton, YangSun
from antiosc.contact.power import (
    Flores,
    Gonthier,
    Hertz,
    HuntCrossley,
    LankaraniNikravesh,
    Linear,
    Power,
    restitution_of,
)

__all__ = [
    "ContactLaw",
    "Flores",
    "Gonthier",
    "Hertz",
    "HuntCrossley",
    "Hysteretic",
    "LankaraniNikravesh",
    "Linear",
    "Power",
    "State",
    "Stronge",
    "Tabulated",
    "TanSun",
    "Thornton",
    "YangSun",
    "restitution_of",
]
