"""What other packages use of antiosc besides its public names: readers, studies, reports.

`MODULES` are open as a whole, by their paths. The stub `extension.pyi` lists single names, which
are imported from here. Both may change from version to version; the public names of `antiosc` stay.
"""

from antiosc.base import lazily

#: Path -> what it is for.
MODULES = {
    "antiosc.base": "errors, checks of arguments, files, texts, progress",
    "antiosc.engine.adjoint": "derivatives of a run of the C library",
    "antiosc.engine.contact.curvature": "the shape of a surface where it is touched",
    "antiosc.engine.contact.geometry": "Hertz's stiffness of two surfaces",
    "antiosc.engine.contact.surfaces": "shape and material of a surface, for the choice of a law",
    "antiosc.engine.library": "the C library: its structs and functions",
    "antiosc.engine.march": "one run of the C library",
    "antiosc.engine.system": "the bodies and contacts of a run as one struct of the C library",
    "antiosc.fem.assembly.joint": "the interface of joints",
    "antiosc.fem.assembly.layout": "the dofs of an assembly",
    "antiosc.fem.linalg.algebra": "products with matrices of SciPy and of PETSc",
    "antiosc.fem.platform": "what all ranks must agree on, and the version of dolfinx",
    "antiosc.impact.assembly": "the bodies and contacts of a scene, ready to be run",
    "antiosc.impact.states": "states of bodies at any time of a run",
    "antiosc.io.deck": "a deck as blocks of numbers",
    "antiosc.io.facets": "files of surfaces",
    "antiosc.io.matrices": "readers of matrices",
    "antiosc.io.neutral": "kinds of cells, units, the model of a deck",
    "antiosc.io.reading": "meshes of files and their pieces",
    "antiosc.io.request": "readers of mesh files",
    "antiosc.plot.charts": "charts",
    "antiosc.plot.surfaces": "pictures of surfaces",
}

__all__, __getattr__ = lazily.door(__file__)
