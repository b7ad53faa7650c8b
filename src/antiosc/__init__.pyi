# The public names and the modules that hold them: the one list of them, for type checkers and for
# the package itself, which loads a module when one of its names is first used.

from antiosc.app.exports.export import (
    export as export,
)
from antiosc.app.report.report import (
    write_report as write_report,
)
from antiosc.base.errors import (
    AccuracyError as AccuracyError,
    AccuracyWarning as AccuracyWarning,
    AntioscError as AntioscError,
    AntioscWarning as AntioscWarning,
    InputError as InputError,
    MeshError as MeshError,
    MissingDependencyError as MissingDependencyError,
    NotConvergedError as NotConvergedError,
    NotDifferentiableError as NotDifferentiableError,
    OutOfMemoryError as OutOfMemoryError,
)
from antiosc.base.stresses import (
    Strengths as Strengths,
    delamination_load as delamination_load,
    principal as principal,
    tsai_hill as tsai_hill,
    von_mises as von_mises,
)
from antiosc.closed_form.soil import (
    SoilCone as SoilCone,
    soil_cone as soil_cone,
)
from antiosc.contact.base import (
    ContactLaw as ContactLaw,
)
from antiosc.contact.geometry import (
    ContactStress as ContactStress,
    contact_stress as contact_stress,
)
from antiosc.contact.plastic import (
    Stronge as Stronge,
    Tabulated as Tabulated,
    TanSun as TanSun,
    Thornton as Thornton,
    YangSun as YangSun,
)
from antiosc.contact.power import (
    Flores as Flores,
    Gonthier as Gonthier,
    Hertz as Hertz,
    HuntCrossley as HuntCrossley,
    LankaraniNikravesh as LankaraniNikravesh,
    Linear as Linear,
    Power as Power,
)
from antiosc.fem.assembly.assemble import (
    assemble as assemble,
)
from antiosc.fem.assembly.bushing import (
    Bolt as Bolt,
    Bushing as Bushing,
)
from antiosc.fem.assembly.from_deck import (
    read_model as read_model,
)
from antiosc.fem.assembly.pins import (
    Ball as Ball,
    Equation as Equation,
    Hinge as Hinge,
    Slider as Slider,
    Weld as Weld,
)
from antiosc.fem.assembly.spiders import (
    Mean as Mean,
    Rigid as Rigid,
)
from antiosc.fem.assembly.tie import (
    Tie as Tie,
)
from antiosc.fem.elements.beam import (
    Beam as Beam,
    Truss as Truss,
)
from antiosc.fem.elements.sections import (
    Layer as Layer,
    Section as Section,
)
from antiosc.fem.elements.shell import (
    Laminate as Laminate,
    Shell as Shell,
)
from antiosc.fem.elements.solid import (
    AnisotropicSolid as AnisotropicSolid,
    Solid as Solid,
)
from antiosc.fem.extraction.extract import (
    extract as extract,
)
from antiosc.fem.extraction.natural_modes import (
    StructureModes as StructureModes,
    natural_modes as natural_modes,
)
from antiosc.fem.extraction.superposition import (
    full as full,
    superposition as superposition,
)
from antiosc.fem.mesh.boxes import (
    box_mesh as box_mesh,
)
from antiosc.fem.mesh.mesh import (
    Mesh as Mesh,
)
from antiosc.fem.mesh.reading import (
    read_mesh as read_mesh,
)
from antiosc.fem.site.site import (
    Site as Site,
)
from antiosc.fem.structure.attachments import (
    Damper as Damper,
    Footing as Footing,
    PointMass as PointMass,
    Spring as Spring,
)
from antiosc.fem.structure.placement import (
    Placement as Placement,
)
from antiosc.fem.structure.structure import (
    Structure as Structure,
)
from antiosc.fem.structure.support import (
    Support as Support,
)
from antiosc.models.anti_oscillators import (
    AntiOscillators as AntiOscillators,
)
from antiosc.models.body import (
    LinearBody as LinearBody,
)
from antiosc.models.damping_matrix import (
    DampingMatrix as DampingMatrix,
)
from antiosc.models.free_modes import (
    from_free_modes as from_free_modes,
)
from antiosc.models.modal import (
    Damping as Damping,
    ModalBody as ModalBody,
)
from antiosc.models.motion import (
    Inertia as Inertia,
    ModalState as ModalState,
    Motion as Motion,
)
from antiosc.models.reduced_matrices import (
    ReducedMatrices as ReducedMatrices,
)
from antiosc.models.resolved import (
    resolved_frequency as resolved_frequency,
)
from antiosc.models.site_modes import (
    SiteModes as SiteModes,
)
from antiosc.results.fields import (
    save_fields as save_fields,
    write_series as write_series,
)
from antiosc.results.margin import (
    Margin as Margin,
)
from antiosc.results.peaks import (
    PeakField as PeakField,
    peak_field as peak_field,
)
from antiosc.results.probe import (
    probe as probe,
    strain_gauge as strain_gauge,
)
from antiosc.results.reactions import (
    Reactions as Reactions,
    reactions as reactions,
)
from antiosc.results.saved_fields import (
    SavedFields as SavedFields,
)
from antiosc.results.spectra import (
    ShockSpectrum as ShockSpectrum,
    Spectrum as Spectrum,
    spectrum as spectrum,
    srs as srs,
)
from antiosc.simulation.batch import (
    Batch as Batch,
    simulate_many as simulate_many,
)
from antiosc.simulation.bodies.bodies import (
    RigidBody as RigidBody,
)
from antiosc.simulation.bodies.impactors import (
    IMPACTORS as IMPACTORS,
    Impactor as Impactor,
    NamedImpactor as NamedImpactor,
    Obstacle as Obstacle,
    RigidMass as RigidMass,
    Sphere as Sphere,
    named_impactor as named_impactor,
)
from antiosc.simulation.errors.truncation import (
    choose_n as choose_n,
    truncation_error as truncation_error,
)
from antiosc.simulation.histories.body_motion import (
    BodyEnergy as BodyEnergy,
    body_energy as body_energy,
    vibration_share as vibration_share,
)
from antiosc.simulation.histories.energy import (
    Energy as Energy,
)
from antiosc.simulation.histories.history import (
    History as History,
    SceneHistory as SceneHistory,
)
from antiosc.simulation.histories.results import (
    SavedHistory as SavedHistory,
)
from antiosc.simulation.histories.scene_history import (
    BodyHistory as BodyHistory,
    ContactHistory as ContactHistory,
)
from antiosc.simulation.problem.scene_parts import (
    Base as Base,
    Contact as Contact,
    Load as Load,
)
from antiosc.simulation.problem.two_bodies import (
    impact_band as impact_band,
)
from antiosc.simulation.scene import (
    Scene as Scene,
)
from antiosc.simulation.simulate import (
    simulate as simulate,
)
from antiosc.simulation.sweep import sweep as sweep
from antiosc.studies.advice import (
    Advice as Advice,
    advise as advise,
)
from antiosc.studies.chance.monte_carlo import (
    lognormal as lognormal,
    monte_carlo as monte_carlo,
    normal as normal,
    uniform as uniform,
)
from antiosc.studies.chance.nearby import (
    NearbyModels as NearbyModels,
    nearby as nearby,
)
from antiosc.studies.chance.sample import (
    Quantile as Quantile,
    Sample as Sample,
    Sensitivity as Sensitivity,
)
from antiosc.studies.drops.drop import (
    drop as drop,
)
from antiosc.studies.drops.ensemble import (
    Drops as Drops,
    Tilts as Tilts,
)
from antiosc.studies.drops.fall import (
    Fall as Fall,
)
from antiosc.studies.drops.filters import (
    cfc_filter as cfc_filter,
)
from antiosc.studies.drops.floor import (
    Floor as Floor,
    SoftLayer as SoftLayer,
    contact_at as contact_at,
)
from antiosc.studies.drops.impacts import (
    Peak as Peak,
)
from antiosc.studies.find.find import (
    find_impact as find_impact,
)
from antiosc.studies.find.found import (
    FoundImpact as FoundImpact,
)
from antiosc.studies.find.sensor import (
    Sensor as Sensor,
)
from antiosc.studies.gradients.gradient import (
    Gradient as Gradient,
    gradient as gradient,
)
from antiosc.studies.gradients.minimize import (
    Optimum as Optimum,
    minimize as minimize,
)
from antiosc.studies.gradients.of_part import (
    DesignMap as DesignMap,
    design_map as design_map,
)
from antiosc.studies.map_results import (
    ImpactMap as ImpactMap,
)
from antiosc.studies.maps import (
    impact_map as impact_map,
)
from antiosc.studies.measured.compare import (
    ForceComparison as ForceComparison,
    compare as compare,
)
from antiosc.studies.measured.frf import (
    FRF as FRF,
)
from antiosc.studies.measured.from_frf import (
    from_frf as from_frf,
)
from antiosc.studies.measured.reading import (
    read_frf as read_frf,
)
from antiosc.studies.striking import (
    strike as strike,
)

__version__: str
