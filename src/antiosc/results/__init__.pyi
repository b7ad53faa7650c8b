# Names of this module, for type checkers and for the module itself.

from antiosc.fem.extraction.superposition import (
    StructureModes as StructureModes,
)
from antiosc.maps.results import (
    ImpactMap as ImpactMap,
)
from antiosc.models.model_file import (
    ReducedMatrices as ReducedMatrices,
)
from antiosc.results.fields import (
    Reactions as Reactions,
)
from antiosc.results.margin import (
    Margin as Margin,
)
from antiosc.results.peaks import (
    PeakField as PeakField,
)
from antiosc.results.pictures import (
    SavedFields as SavedFields,
)
from antiosc.results.prestressed import (
    PrestressedState as PrestressedState,
)
from antiosc.results.spectra import (
    ShockSpectrum as ShockSpectrum,
    Spectrum as Spectrum,
)
from antiosc.simulation.batch import (
    Batch as Batch,
)
from antiosc.simulation.histories import (
    BodyEnergy as BodyEnergy,
    History as History,
    SceneHistory as SceneHistory,
)
from antiosc.simulation.histories.energy import (
    Energy as Energy,
)
from antiosc.simulation.histories.parts import (
    BodyHistory as BodyHistory,
    ContactHistory as ContactHistory,
)
from antiosc.simulation.histories.results import (
    SavedHistory as SavedHistory,
)
from antiosc.striking.advice import (
    Advice as Advice,
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
