# Names of this module, for type checkers and for the module itself.

from antiosc.base.cfc import cfc_filter as cfc_filter
from antiosc.base.stresses import (
    delamination_load as delamination_load,
    principal as principal,
    von_mises as von_mises,
)
from antiosc.fields.fields import Reactions as Reactions
from antiosc.fields.margin import Margin as Margin
from antiosc.fields.peaks import PeakField as PeakField, PrestressedState as PrestressedState
from antiosc.fields.probe import probe_error as probe_error
from antiosc.fields.spectra import ShockSpectrum as ShockSpectrum
from antiosc.impact.enclosure import Enclosure as Enclosure
from antiosc.impact.histories import History as History, SceneHistory as SceneHistory
from antiosc.impact.histories.energy import Energy as Energy
from antiosc.impact.histories.parts import (
    BodyHistory as BodyHistory,
    ContactHistory as ContactHistory,
)
from antiosc.impact.histories.tables import SavedHistory as SavedHistory
from antiosc.impact.histories.vibration import (
    BodyEnergy as BodyEnergy,
    body_energy as body_energy,
    vibration_share as vibration_share,
)
from antiosc.impact.many import Many as Many, Quantile as Quantile
from antiosc.models.modal import SiteModes as SiteModes
from antiosc.models.motion import ModalState as ModalState
from antiosc.reduce.extraction.superposition import StructureModes as StructureModes
from antiosc.strikes.advice import Advice as Advice
from antiosc.strikes.map_results import ImpactMap as ImpactMap
from antiosc_app.view import View as View
from antiosc_studies.drops.fall import Fall as Fall
from antiosc_studies.drops.impacts import Peak as Peak
from antiosc_studies.find import FoundImpact as FoundImpact
from antiosc_studies.gradients.gradient import Gradient as Gradient
from antiosc_studies.gradients.per_cell import DesignMap as DesignMap
from antiosc_studies.measured.compare import ForceComparison as ForceComparison
from antiosc_studies.measured.frf import FRF as FRF
