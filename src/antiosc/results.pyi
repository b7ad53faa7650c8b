# Names of this module, for type checkers and for the module itself.

from antiosc.fields.fields import (
    Reactions as Reactions,
)
from antiosc.fields.margin import (
    Margin as Margin,
)
from antiosc.fields.peaks import (
    PeakField as PeakField,
)
from antiosc.fields.pictures import (
    SavedFields as SavedFields,
)
from antiosc.fields.prestressed import (
    PrestressedState as PrestressedState,
)
from antiosc.fields.spectra import (
    ShockSpectrum as ShockSpectrum,
    Spectrum as Spectrum,
)
from antiosc.impact.batch import (
    Batch as Batch,
)
from antiosc.impact.histories import (
    History as History,
    SceneHistory as SceneHistory,
)
from antiosc.impact.histories.energy import (
    Energy as Energy,
)
from antiosc.impact.histories.parts import (
    BodyHistory as BodyHistory,
    ContactHistory as ContactHistory,
)
from antiosc.impact.histories.tables import (
    SavedHistory as SavedHistory,
)
from antiosc.impact.histories.vibration import (
    BodyEnergy as BodyEnergy,
)
from antiosc.models.model_file import (
    ReducedMatrices as ReducedMatrices,
)
from antiosc.reduce.extraction.superposition import (
    StructureModes as StructureModes,
)
from antiosc.strikes.advice import (
    Advice as Advice,
)
from antiosc.strikes.map_results import (
    ImpactMap as ImpactMap,
)
from antiosc_studies.chance.nearby import (
    NearbyModels as NearbyModels,
)
from antiosc_studies.chance.sample import (
    Quantile as Quantile,
    Sample as Sample,
    Sensitivity as Sensitivity,
)
from antiosc_studies.drops.drop import (
    Drops as Drops,
)
from antiosc_studies.drops.fall import (
    Fall as Fall,
)
from antiosc_studies.drops.trajectory import (
    Peak as Peak,
)
from antiosc_studies.find import (
    FoundImpact as FoundImpact,
)
from antiosc_studies.gradients.gradient import (
    Gradient as Gradient,
)
from antiosc_studies.gradients.minimize import (
    Optimum as Optimum,
)
from antiosc_studies.gradients.of_part import (
    DesignMap as DesignMap,
)
from antiosc_studies.measured.compare import (
    ForceComparison as ForceComparison,
)
