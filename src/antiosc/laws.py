"""Contact laws, such as `antiosc.laws.Hertz`, and their results."""

from antiosc.engine.contact.base import ContactLaw as ContactLaw
from antiosc.engine.contact.dent import Dent as Dent
from antiosc.engine.contact.geometry import (
    ContactStress as ContactStress,
    contact_stress as contact_stress,
)
from antiosc.engine.contact.laws import (
    ElasticPlastic as ElasticPlastic,
    Flores as Flores,
    Gonthier as Gonthier,
    Hertz as Hertz,
    HuntCrossley as HuntCrossley,
    LankaraniNikravesh as LankaraniNikravesh,
    Linear as Linear,
    Power as Power,
    Tabulated as Tabulated,
    Thornton as Thornton,
    YangSun as YangSun,
)
