# Names for other packages besides the public ones, by what they are for; `extension.py` gives them.

# Structures: their parts, joints, elements and matrices.
from antiosc.fem import missing as missing
from antiosc.fem.assembly.assemble import assemble as assemble
from antiosc.fem.elements.shell import GivenSheet as GivenSheet
from antiosc.fem.elements.weak_form import Family as Family, measure as measure
from antiosc.fem.linalg import cholmod as cholmod
from antiosc.fem.mesh import distributed as distributed
from antiosc.fem.mesh.finer import longest_cell as longest_cell
from antiosc.fem.mesh.reading import (
    default_size as default_size,
    flattened as flattened,
    sound as sound,
    usual_size as usual_size,
)
from antiosc.fem.mesh.surface import Faces as Faces, projected as projected
from antiosc.fem.structure.attachments import (
    Attachment as Attachment,
    attachments_of as attachments_of,
)
from antiosc.fem.structure.structure import (
    on_mesh as on_mesh,
    refuse_dampers as refuse_dampers,
    refuse_prestress as refuse_prestress,
    with_parts as with_parts,
)

# Fields and pictures of a history.
from antiosc.fields.fields import (
    checked_shapes as checked_shapes,
    outer_faces as outer_faces,
    shapes_of as shapes_of,
    tensors_at_nodes as tensors_at_nodes,
)
from antiosc.fields.margin import ELASTIC as ELASTIC, criteria_of as criteria_of
from antiosc.fields.pictures import MAP_QUANTITIES as MAP_QUANTITIES
from antiosc.fields.probe import (
    ProbeError as ProbeError,
    probed_point as probed_point,
)

# Impacts: bodies, scenes, and what a history tells.
from antiosc.impact.bodies import SceneBody as SceneBody, scene_body as scene_body
from antiosc.impact.error_budget import SAFETY as SAFETY
from antiosc.impact.histories import budget_of as budget_of, error_scope as error_scope
from antiosc.impact.histories.bars import (
    DEFLECTION as DEFLECTION,
    OF_ALL_CONTACTS as OF_ALL_CONTACTS,
    QUANTITIES as QUANTITIES,
    ErrorBudget as ErrorBudget,
)
from antiosc.impact.histories.energy import impulses as impulses
from antiosc.impact.histories.run_end import (
    inexact_message as inexact_message,
    open_contacts as open_contacts,
)

# Defaults.
from antiosc.impact.histories.site_motion import LONGER as LONGER, parted as parted
from antiosc.impact.histories.verdict import (
    ContactZone as ContactZone,
    unknown_dent as unknown_dent,
    yield_share as yield_share,
)
from antiosc.impact.many import QUANTILES as QUANTILES, checked_levels as checked_levels
from antiosc.impact.scene import (
    check_range as check_range,
    integrate as integrate,
    integrate_exact as integrate_exact,
    simulate_impact as simulate_impact,
)
from antiosc.impact.scene_parts import SceneParts as SceneParts
from antiosc.impact.settings import Settings as Settings
from antiosc.impact.truncation import (
    TRUNCATION_SAFETY as TRUNCATION_SAFETY,
    softest_model as softest_model,
)
from antiosc.impact.two_bodies import Impact as Impact, assemble_pair as assemble_pair

# Displacements and strains at points of a structure.
from antiosc.recovery import source as source
from antiosc.recovery.place import NodeTensors as NodeTensors, Reach as Reach, place as place

# Sites and extraction.
from antiosc.reduce.error.model_errors import ModelErrors as ModelErrors
from antiosc.reduce.extraction.eigenmodes import ModeSolver as ModeSolver
from antiosc.reduce.site.surface import curvature as curvature
from antiosc.strikes.defaults import (
    expansion_of as expansion_of,
    next_count as next_count,
    patch_radius as patch_radius,
    usual_ball as usual_ball,
    usual_cell as usual_cell,
)

# Maps, and blows with a stretch.
from antiosc.strikes.impact_map import on_plane as on_plane
from antiosc.strikes.map_results import (
    doubts_text as doubts_text,
    hardest as hardest,
    left_out_text as left_out_text,
    low_band as low_band,
    trusted as trusted,
)
from antiosc.strikes.map_stresses import sides as sides
from antiosc.strikes.second_order import simulated as simulated, stretching as stretching
from antiosc.strikes.stress import (
    closed as closed,
    divided as divided,
    fields_by_strength as fields_by_strength,
    struck_again as struck_again,
)
from antiosc.strikes.tradeoff import (
    Tradeoff as Tradeoff,
    TradeoffMember as TradeoffMember,
    line_of as line_of,
)
