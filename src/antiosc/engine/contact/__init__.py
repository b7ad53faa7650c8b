"""Contact laws: the force between two bodies as a function of their indentation."""

from antiosc.engine.contact.base import ContactLaw as ContactLaw, State as State
from antiosc.engine.contact.laws import (
    ElasticPlastic as ElasticPlastic,
    Gonthier as Gonthier,
    Hertz as Hertz,
    Tabulated as Tabulated,
)
