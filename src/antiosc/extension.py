"""Names that other packages use of antiosc besides its public names: readers, studies, reports.

`MODULES` are open as a whole, by their paths: the rooms that need NumPy and SciPy alone, below the
impacts, and a few others, of the packages beside it too. The stub `extension.pyi` lists single
names, which are imported from here. Both may change from version to version; the public names of
`antiosc` stay.
"""

from antiosc.base import lazily

#: Path -> what it is for.
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

__all__, __getattr__, __dir__ = lazily.door(__file__)
