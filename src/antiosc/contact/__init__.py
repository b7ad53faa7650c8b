"""Contact laws: the force between two bodies as a function of their indentation."""

from antiosc.contact.base import ContactLaw as ContactLaw, State as State
from antiosc.contact.laws import (
    Gonthier as Gonthier,
    Hertz as Hertz,
    Linear as Linear,
    Power as Power,
    Tabulated as Tabulated,
    restitution_of as restitution_of,
)
