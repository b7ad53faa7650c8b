"""Contact laws: the force between two bodies as a function of their indentation."""

from antiosc.contact.base import ContactLaw, State
from antiosc.contact.power import Hertz, Linear, Power

__all__ = ["ContactLaw", "Hertz", "Linear", "Power", "State"]
