# The public names and the modules that hold them: the one list of them, for type checkers and for
# the package itself, which loads a module when one of its names is first used.

from antiosc import (
    errors as errors,
    joints as joints,
    laws as laws,
    results as results,
)
from antiosc.base.cfc import cfc_filter as cfc_filter
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
from antiosc.engine.damping import DampingMatrix as DampingMatrix
from antiosc.fem.assembly.assemble import assemble as assemble
from antiosc.fem.assembly.bolts import Bolt as Bolt
from antiosc.fem.assembly.joints import (
    Ball as Ball,
    Bushing as Bushing,
    Equation as Equation,
    Hinge as Hinge,
    Mean as Mean,
    Rigid as Rigid,
    Slider as Slider,
    Weld as Weld,
)
from antiosc.fem.assembly.tie import Tie as Tie
from antiosc.fem.elements import (
    Layer as Layer,
    Section as Section,
)
from antiosc.fem.elements.beam import (
    Beam as Beam,
    Truss as Truss,
)
from antiosc.fem.elements.by_name import material as material
from antiosc.fem.elements.shell import (
    Laminate as Laminate,
    Shell as Shell,
)
from antiosc.fem.elements.solid import (
    AnisotropicSolid as AnisotropicSolid,
    Solid as Solid,
)
from antiosc.fem.mesh import Mesh as Mesh
from antiosc.fem.mesh.reading import (
    box_mesh as box_mesh,
    read_mesh as read_mesh,
)
from antiosc.fem.prestress import (
    Prestress as Prestress,
    Spin as Spin,
)
from antiosc.fem.structure import Placement as Placement
from antiosc.fem.structure.attachments import (
    Damper as Damper,
    PointMass as PointMass,
    Spring as Spring,
)
from antiosc.fem.structure.structure import Structure as Structure
from antiosc.fem.structure.support import Support as Support
from antiosc.fields.fields import (
    Reactions as Reactions,
    reactions as reactions,
    write_series as write_series,
)
from antiosc.fields.margin import Margin as Margin
from antiosc.fields.peaks import (
    PeakField as PeakField,
    PrestressedState as PrestressedState,
    peak_field as peak_field,
)
from antiosc.fields.pictures import (
    SavedFields as SavedFields,
    save_fields as save_fields,
)
from antiosc.fields.probe import (
    probe as probe,
    probe_error as probe_error,
    strain_gauge as strain_gauge,
)
from antiosc.fields.spectra import (
    ShockSpectrum as ShockSpectrum,
    Spectrum as Spectrum,
    spectrum as spectrum,
    srs as srs,
)
from antiosc.impact.batch import (
    simulate_many as simulate_many,
    sweep as sweep,
)
from antiosc.impact.bodies import (
    IMPACTORS as IMPACTORS,
    Impactor as Impactor,
    NamedImpactor as NamedImpactor,
    Obstacle as Obstacle,
    RigidBody as RigidBody,
    RigidMass as RigidMass,
    Sphere as Sphere,
    named_impactor as named_impactor,
)
from antiosc.impact.enclosure import Enclosure as Enclosure
from antiosc.impact.histories import (
    History as History,
    SceneHistory as SceneHistory,
)
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
from antiosc.impact.many import (
    Many as Many,
    Quantile as Quantile,
)
from antiosc.impact.scene import (
    Scene as Scene,
    simulate as simulate,
)
from antiosc.impact.scene_parts import (
    Base as Base,
    Contact as Contact,
    Load as Load,
)
from antiosc.impact.truncation import (
    choose_n as choose_n,
    truncation_error as truncation_error,
)
from antiosc.impact.two_bodies import impact_band as impact_band
from antiosc.models.anti_oscillators import AntiOscillators as AntiOscillators
from antiosc.models.body import (
    LinearBody as LinearBody,
    resolved_frequency as resolved_frequency,
)
from antiosc.models.free_modes import from_free_modes as from_free_modes
from antiosc.models.modal import (
    Damping as Damping,
    ModalBody as ModalBody,
    SiteModes as SiteModes,
)
from antiosc.models.motion import (
    Inertia as Inertia,
    ModalState as ModalState,
    Motion as Motion,
)
from antiosc.reduce.extraction.extract import extract as extract
from antiosc.reduce.extraction.superposition import (
    StructureModes as StructureModes,
    full as full,
    natural_modes as natural_modes,
    superposition as superposition,
)
from antiosc.reduce.site import Site as Site
from antiosc.strikes.advice import (
    Advice as Advice,
    advise as advise,
)
from antiosc.strikes.impact_map import impact_map as impact_map
from antiosc.strikes.map_results import ImpactMap as ImpactMap
from antiosc.strikes.strike import strike as strike
from antiosc.strikes.tradeoff import tradeoff as tradeoff
from antiosc_app.export import export as export
from antiosc_app.report import write_report as write_report
from antiosc_app.view import (
    View as View,
    view as view,
)
from antiosc_decks.from_deck import read_model as read_model
from antiosc_studies.between import contact_between as contact_between
from antiosc_studies.chance.monte_carlo import (
    lognormal as lognormal,
    monte_carlo as monte_carlo,
    normal as normal,
    uniform as uniform,
)
from antiosc_studies.drops.drop import drop as drop
from antiosc_studies.drops.ensemble import (
    Tilts as Tilts,
)
from antiosc_studies.drops.fall import Fall as Fall
from antiosc_studies.drops.floor import (
    Floor as Floor,
    SoftLayer as SoftLayer,
)
from antiosc_studies.drops.impacts import Peak as Peak
from antiosc_studies.find import (
    FoundImpact as FoundImpact,
    find_impact as find_impact,
)
from antiosc_studies.find.recording import Sensor as Sensor
from antiosc_studies.gradients.gradient import (
    Gradient as Gradient,
    gradient as gradient,
)
from antiosc_studies.gradients.per_cell import (
    DesignMap as DesignMap,
    design_map as design_map,
)
from antiosc_studies.measured import from_frf as from_frf
from antiosc_studies.measured.compare import (
    ForceComparison as ForceComparison,
    compare as compare,
)
from antiosc_studies.measured.frf import FRF as FRF
from antiosc_studies.measured.reading import read_frf as read_frf

__version__: str
