"""Non-public names that companion packages (readers, studies, reports) may use.

They may use all names of the modules in `MODULES`, most of which need only NumPy and SciPy, and
the listed names of the modules in `NAMES`. Both lists may change from version to version; the
public names of `antiosc` do not.
"""

#: Path of a module or package -> its content.
MODULES = {
    "antiosc.base": "errors, checks of arguments, files, texts, progress",
    "antiosc.engine": "the C library and its runs, contact laws and surfaces, damping",
    "antiosc.fem.assembly.joint": "the interface of joints",
    "antiosc.fem.assembly.layout": "the dofs of an assembly",
    "antiosc.fem.platform": "what all ranks must agree on, and the version of dolfinx",
    "antiosc.fem.structure.meshed": "the structure of a mesh, and a part of an assembly",
    "antiosc.impact.assembly": "the bodies and contacts of a scene, ready to be run",
    "antiosc.impact.states": "states of bodies at any time of a run",
    "antiosc.io": "readers of meshes, surfaces and matrices; the model of a deck",
    "antiosc.models": "bodies, models and their modes, damping and motion",
    "antiosc.plot": "charts, and pictures of surfaces",
    "antiosc.plotting": "whole pictures of maps and of deformed parts",
    "antiosc.reduce.site": "load vectors and surfaces of sites",
    "antiosc.strikes.free_sites": "the sites of a map, in the free modes of the structure",
    "antiosc_decks.from_deck": "a structure from the model of a deck",
    "antiosc_studies.drops": "falls: bodies, places at any time, pictures",
}

#: Path of a module -> names in it that packages may use, separated by spaces.
NAMES = {
    "antiosc.fem": "missing",
    "antiosc.fem.elements.shell": "GivenSheet",
    "antiosc.fem.elements.weak_form": "Family measure",
    "antiosc.fem.linalg": "cholmod",
    "antiosc.fem.mesh": "distributed",
    "antiosc.fem.mesh.finer": "longest_cell",
    "antiosc.fem.mesh.reading": "default_size flattened sound usual_size",
    "antiosc.fem.mesh.surface": "Faces projected",
    "antiosc.fem.structure.attachments": "Attachment attachments_of",
    "antiosc.fem.structure.structure": "on_mesh refuse_dampers refuse_prestress with_parts",
    "antiosc.fields.fields": "checked_shapes outer_faces shapes_of tensors_at_nodes",
    "antiosc.fields.margin": "ELASTIC criteria_of",
    "antiosc.fields.pictures": "MAP_QUANTITIES",
    "antiosc.fields.probe": "ProbeError probed_point",
    "antiosc.impact.bodies": "SceneBody scene_body",
    "antiosc.impact.error_budget": "SAFETY",
    "antiosc.impact.histories": "budget_of error_scope",
    "antiosc.impact.histories.bars": "DEFLECTION ErrorBudget OF_ALL_CONTACTS QUANTITIES",
    "antiosc.impact.histories.energy": "impulses",
    "antiosc.impact.histories.run_end": "inexact_message open_contacts",
    "antiosc.impact.histories.site_motion": "LONGER parted",
    "antiosc.impact.histories.verdict": "ContactZone unknown_dent yield_share",
    "antiosc.impact.many": "QUANTILES checked_levels",
    "antiosc.impact.scene": "check_range integrate integrate_exact simulate_impact",
    "antiosc.impact.scene_parts": "SceneParts",
    "antiosc.impact.settings": "Settings",
    "antiosc.impact.truncation": "TRUNCATION_SAFETY softest_model",
    "antiosc.impact.two_bodies": "Impact assemble_pair",
    "antiosc.recovery": "source",
    "antiosc.recovery.place": "NodeTensors Reach place",
    "antiosc.reduce.error.model_errors": "ModelErrors",
    "antiosc.reduce.extraction.eigenmodes": "ModeSolver",
    "antiosc.reduce.site.surface": "curvature",
    "antiosc.strikes.defaults": (
        "expansion_frequency next_count patch_radius default_ball_radius default_cell_size"
    ),
    "antiosc.strikes.impact_map": "on_plane",
    "antiosc.strikes.map_results": "doubts_text hardest left_out_text low_band_text trusted",
    "antiosc.strikes.map_stresses": "sides",
    "antiosc.strikes.second_order": "simulated stretching",
    "antiosc.strikes.stress": "closed divided fields_by_strength struck_again",
    "antiosc.strikes.tradeoff": "Tradeoff TradeoffMember line_of",
}
