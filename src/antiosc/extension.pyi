# Names for other packages besides the public ones, by what they are for; `extension.py` gives them.

# Contact laws, damping, and the run of an impact.
from antiosc.engine.contact.base import (
    Compiled as Compiled,
    is_compiled as is_compiled,
)
from antiosc.engine.contact.choice import (
    Choice as Choice,
    choose as choose,
)
from antiosc.engine.contact.dent import (
    RIM as RIM,
)
from antiosc.engine.contact.laws import (
    Hysteretic as Hysteretic,
)
from antiosc.engine.contact.line import (
    line_curve as line_curve,
)
from antiosc.engine.contact.peak_error import (
    LARGEST_STRAIN as LARGEST_STRAIN,
    LEAST_STRAIN as LEAST_STRAIN,
    error_of_peak as error_of_peak,
)
from antiosc.engine.damping import (
    StackedModes as StackedModes,
    from_factors as from_factors,
    in_coordinates as in_coordinates,
)

# Structures: their parts, joints, elements and matrices.
from antiosc.fem import (
    missing as missing,
)
from antiosc.fem.assembly import (
    with_parts as with_parts,
)
from antiosc.fem.assembly.assemble import (
    assemble_checked as assemble_checked,
)
from antiosc.fem.elements.shell import (
    GivenSheet as GivenSheet,
)
from antiosc.fem.elements.weak_form import (
    Family as Family,
    measure as measure,
)
from antiosc.fem.linalg import (
    cholmod as cholmod,
)
from antiosc.fem.linalg.solver import (
    SolverChoice as SolverChoice,
)
from antiosc.fem.linalg.solver_choice import (
    BYTES as BYTES,
    Plan as Plan,
)
from antiosc.fem.mesh import (
    distributed as distributed,
)
from antiosc.fem.mesh.closest import (
    projected as projected,
)
from antiosc.fem.mesh.curvature import (
    curvature as curvature,
)
from antiosc.fem.mesh.reading import (
    flattened as flattened,
    numbered_elements as numbered_elements,
)
from antiosc.fem.mesh.soundness import (
    sound as sound,
)
from antiosc.fem.mesh.surface import (
    Faces as Faces,
)
from antiosc.fem.reach import (
    SNAP_SHARE as SNAP_SHARE,
    Reach as Reach,
)
from antiosc.fem.structure import (
    placement as placement,
)
from antiosc.fem.structure.attachments import (
    Attachment as Attachment,
    attachments_of as attachments_of,
)
from antiosc.fem.structure.meshed import (
    DISPLACEMENTS as DISPLACEMENTS,
    ROTATIONS as ROTATIONS,
    Member as Member,
    MeshedStructure as MeshedStructure,
)
from antiosc.fem.structure.structure import (
    on_mesh as on_mesh,
    refuse_dampers as refuse_dampers,
    refuse_prestress as refuse_prestress,
)

# Fields and pictures of a history.
from antiosc.fields.deformed import (
    plot_deformed as plot_deformed,
)
from antiosc.fields.fields import (
    checked_shapes as checked_shapes,
    shapes_of as shapes_of,
)
from antiosc.fields.margin import (
    HertzContact as HertzContact,
    criteria_of as criteria_of,
)
from antiosc.fields.pictures import (
    MAP_QUANTITIES as MAP_QUANTITIES,
    outer_faces as outer_faces,
    plot_map as plot_map,
)
from antiosc.fields.second_order import (
    tensors_at_nodes as tensors_at_nodes,
)

# Impacts: bodies, scenes, and what a history tells.
from antiosc.impact.auto_contact import (
    AUTO as AUTO,
    AnyLaw as AnyLaw,
    is_auto as is_auto,
    law_of as law_of,
)
from antiosc.impact.batch import (
    check_executor as check_executor,
    completed_calls as completed_calls,
    rows_of as rows_of,
)
from antiosc.impact.bodies import (
    GRAVITY as GRAVITY,
    SceneBody as SceneBody,
    scene_body as scene_body,
)
from antiosc.impact.coarse import (
    coarse_at as coarse_at,
)
from antiosc.impact.error_budget import (
    SAFETY as SAFETY,
)
from antiosc.impact.histories import (
    error_scope as error_scope,
)
from antiosc.impact.histories.energy import (
    energy_gain as energy_gain,
    impulses as impulses,
)
from antiosc.impact.histories.parts import (
    CAUSES as CAUSES,
    QUANTITIES as QUANTITIES,
    ErrorBudget as ErrorBudget,
)
from antiosc.impact.histories.run_end import (
    COMPLETED as COMPLETED,
    STOPPED as STOPPED,
    inexact_message as inexact_message,
    open_contacts as open_contacts,
)
from antiosc.impact.reference import (
    FIRST_STEPS as FIRST_STEPS,
    Settings as Settings,
)
from antiosc.impact.scene import (
    DEFAULT_TOL as DEFAULT_TOL,
    check_range as check_range,
    integrate as integrate,
    integrate_exact as integrate_exact,
    set_initial_forces as set_initial_forces,
    simulate_impact as simulate_impact,
)
from antiosc.impact.scene_parts import (
    SceneParts as SceneParts,
)
from antiosc.impact.truncation import (
    TRUNCATION_SAFETY as TRUNCATION_SAFETY,
    softest_model as softest_model,
)
from antiosc.impact.two_bodies import (
    BAND_OVER_PULSE as BAND_OVER_PULSE,
    Impact as Impact,
    assemble_pair as assemble_pair,
)

# Readers of files.
from antiosc.io.cad import (
    STATES_UNIT as STATES_UNIT,
)
from antiosc.io.conversion import (
    as_mesh as as_mesh,
    kept_apart as kept_apart,
)
from antiosc.io.table import (
    FIRST_BYTES as FIRST_BYTES,
)

# Models.
from antiosc.models.body import (
    Body as Body,
    MeasuredBand as MeasuredBand,
    ModalModel as ModalModel,
    ModelInfo as ModelInfo,
    checked_body as checked_body,
    info_of as info_of,
    site_points as site_points,
)
from antiosc.models.free_modes import (
    residual as residual,
)
from antiosc.models.modal import (
    as_damping as as_damping,
)
from antiosc.models.motion import (
    unit_vector as unit_vector,
)
from antiosc.models.stretch import (
    stretch_of as stretch_of,
)

# Displacements and strains at points of a structure.
from antiosc.recovery import (
    source as source,
)
from antiosc.recovery.place import (
    NodeTensors as NodeTensors,
    place as place,
)

# Sites and extraction.
from antiosc.reduce.error.bisection import (
    gathered as gathered,
)
from antiosc.reduce.error.model_errors import (
    ModelErrors as ModelErrors,
)
from antiosc.reduce.error.remeshing import (
    OfMesh as OfMesh,
)
from antiosc.reduce.extraction.eigenmodes import (
    ModeSolver as ModeSolver,
)
from antiosc.reduce.extraction.extract import (
    UNNAMED as UNNAMED,
    ErrorOption as ErrorOption,
    surfaces as surfaces,
)
from antiosc.reduce.extraction.oscillators import (
    DEFAULT_COUNT as DEFAULT_COUNT,
)
from antiosc.reduce.site import (
    Functional as Functional,
    functional as functional,
    functionals as functionals,
    point_of as point_of,
)
from antiosc.reduce.site.map_sites import (
    surface as surface,
)
from antiosc.reduce.site.sites import (
    located as located,
)
from antiosc.reduce.site.surface import (
    PlaneOf as PlaneOf,
    curvature_at as curvature_at,
    material_at as material_at,
    surface_at as surface_at,
)

# Maps, and blows with a stretch.
from antiosc.strikes.impact_map import (
    ABOVE as ABOVE,
    FreeSites as FreeSites,
    Where as Where,
    free_sites as free_sites,
    on_plane as on_plane,
    sides as sides,
)
from antiosc.strikes.map_results import (
    hardest as hardest,
    trusted as trusted,
)
from antiosc.strikes.second_order import (
    simulated as simulated,
    stretching as stretching,
)

# Decks.
from antiosc_decks.from_deck import (
    outline_of_deck as outline_of_deck,
)

# Falls.
from antiosc_studies.drops.body import (
    MODES as MODES,
)
from antiosc_studies.drops.fall import (
    WorstField as WorstField,
)
from antiosc_studies.drops.pictures import (
    at as at,
    surface_of as surface_of,
)
