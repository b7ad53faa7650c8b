"""Contact laws: the force between two bodies as a function of their indentation."""

from antiosc.contact.base import ContactLaw, State
from antiosc.contact.damped import (
    Flores,
    Gonthier,
    HuntCrossley,
    LankaraniNikravesh,
    restitution_of,
)
from antiosc.contact.plastic import Hysteretic, Stronge, TanSun, Thornton, YangSun
from antiosc.contact.power import Hertz, Linear, Power
from antiosc.contact.table import Tabulated

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
