"""Contact laws: the force between two bodies as a function of their indentation."""

from antiosc.engine.contact.base import ContactLaw, State
from antiosc.engine.contact.laws import (
    ElasticPlastic,
    Flores,
    Gonthier,
    Hertz,
    HuntCrossley,
    Hysteretic,
    LankaraniNikravesh,
    Linear,
    Power,
    Tabulated,
    Thornton,
    YangSun,
)

__all__ = [
    "ContactLaw",
    "ElasticPlastic",
    "Flores",
    "Gonthier",
    "Hertz",
    "HuntCrossley",
    "Hysteretic",
    "LankaraniNikravesh",
    "Linear",
    "Power",
    "State",
    "Tabulated",
    "Thornton",
    "YangSun",
]
