# The public names and the modules that hold them, beside those of the namespaces: for type checkers
# and for the package itself, which loads a module when one of its names is first used.

from antiosc import errors as errors, joints as joints, laws as laws, results as results
from antiosc.base.stresses import Strengths as Strengths
from antiosc.engine.damping import DampingMatrix as DampingMatrix
from antiosc.errors import *
from antiosc.fem.assembly.assemble import assemble as assemble
from antiosc.fem.elements import Layer as Layer, Section as Section
from antiosc.fem.elements.beam import Beam as Beam, Truss as Truss
from antiosc.fem.elements.by_name import material as material
from antiosc.fem.elements.shell import Laminate as Laminate, Shell as Shell
from antiosc.fem.elements.solid import AnisotropicSolid as AnisotropicSolid, Solid as Solid
from antiosc.fem.mesh import Mesh as Mesh
from antiosc.fem.mesh.reading import box_mesh as box_mesh, read_mesh as read_mesh
from antiosc.fem.prestress import Prestress as Prestress, Spin as Spin
from antiosc.fem.structure import Placement as Placement
from antiosc.fem.structure.structure import Structure as Structure
from antiosc.fem.structure.support import Support as Support
from antiosc.fields.fields import reactions as reactions, write_series as write_series
from antiosc.fields.peaks import peak_field as peak_field
from antiosc.fields.pictures import save_fields as save_fields
from antiosc.fields.probe import probe as probe, strain_gauge as strain_gauge
from antiosc.fields.spectra import srs as srs
from antiosc.impact.batch import simulate_many as simulate_many, sweep as sweep
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
from antiosc.impact.scene import Scene as Scene, simulate as simulate
from antiosc.impact.scene_parts import Base as Base, Contact as Contact, Load as Load
from antiosc.impact.truncation import choose_n as choose_n, truncation_error as truncation_error
from antiosc.impact.two_bodies import impact_band as impact_band
from antiosc.joints import *
from antiosc.laws import *
from antiosc.models.anti_oscillators import AntiOscillators as AntiOscillators
from antiosc.models.body import LinearBody as LinearBody, resolved_frequency as resolved_frequency
from antiosc.models.free_modes import from_free_modes as from_free_modes
from antiosc.models.modal import Damping as Damping, ModalBody as ModalBody
from antiosc.models.motion import Inertia as Inertia, Motion as Motion
from antiosc.reduce.extraction.extract import extract as extract
from antiosc.reduce.extraction.superposition import (
    full as full,
    natural_modes as natural_modes,
    superposition as superposition,
)
from antiosc.reduce.site.site import Site as Site
from antiosc.results import *
from antiosc.strikes.advice import advise as advise
from antiosc.strikes.impact_map import impact_map as impact_map
from antiosc.strikes.strike import strike as strike
from antiosc.strikes.tradeoff import tradeoff as tradeoff
from antiosc_app.export import export as export
from antiosc_app.report import write_report as write_report
from antiosc_app.view import view as view
from antiosc_decks.from_deck import read_model as read_model
from antiosc_studies.between import contact_between as contact_between
from antiosc_studies.chance.monte_carlo import (
    lognormal as lognormal,
    monte_carlo as monte_carlo,
    normal as normal,
    uniform as uniform,
)
from antiosc_studies.drops.drop import drop as drop
from antiosc_studies.drops.ensemble import Tilts as Tilts
from antiosc_studies.drops.floor import Floor as Floor, SoftLayer as SoftLayer
from antiosc_studies.find import find_impact as find_impact
from antiosc_studies.find.recording import Sensor as Sensor
from antiosc_studies.gradients.gradient import gradient as gradient
from antiosc_studies.gradients.per_cell import design_map as design_map
from antiosc_studies.measured import from_frf as from_frf
from antiosc_studies.measured.compare import compare as compare
from antiosc_studies.measured.reading import read_frf as read_frf

__version__: str
