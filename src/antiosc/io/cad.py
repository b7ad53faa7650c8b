"""What CAD files need besides meshing: units, assemblies, names of solids, closed surfaces."""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.neutral import IntArray
from antiosc.io.request import Request

CAD = (".step", ".stp", ".brep", ".iges", ".igs")
#: Files that state the unit of their coordinates.
STATES_UNIT = (".step", ".stp", ".iges", ".igs")
#: Angle between facets from which their common edge is an edge of the part, degrees.
SHARP_ANGLE = 40.0
#: (dimension, tag) -> names
Names = dict[tuple[int, int], list[str]]


def opened(gmsh: ModuleType, path: str) -> float:
    """Open a file; metres per unit of its coordinates then.

    gmsh refuses a unit for IGES (4.8 of Debian 12 and 4.13 of Debian 13), and gives OpenCASCADE's
    millimetres there without one.
    """
    iges = path.endswith((".iges", ".igs"))
    gmsh.option.setString("Geometry.OCCTargetUnit", "" if iges else "M")
    gmsh.open(path)
    return 1e-3 if iges else 1.0


def named_solids(gmsh: ModuleType, fragments: bool, name: str) -> Names:
    """The names of the solids of a CAD file, which are cut at each other if `fragments`."""
    solids = gmsh.model.getEntities(3)
    names: Names = {}
    seen: dict[str, int] = {}
    for entity in solids:
        label = gmsh.model.getEntityName(*entity).rpartition("/")[2].strip()
        if not label:
            continue
        seen[label] = seen.get(label, 0) + 1
        names[entity] = [label if seen[label] == 1 else f"{label} ({seen[label]})"]
    if not fragments:
        return names
    if len(solids) < 2:
        raise MeshError(f"fragments=True joins solids; {name} has {len(solids)} of them.")
    _, pieces = gmsh.model.occ.fragment(solids, [], removeObject=True, removeTool=True)
    gmsh.model.occ.synchronize()
    cut: Names = {}
    for entity, own in zip(solids, pieces, strict=False):
        for piece in own:
            if piece[0] == 3:
                cut.setdefault((3, int(piece[1])), []).extend(names.get(entity, []))
    return cut


def groups_of(
    names: Names, rows: dict[tuple[int, int], dict[str, IntArray]]
) -> dict[str, dict[str, IntArray]]:
    """Cells by the names of their solids."""
    found: dict[str, dict[str, list[IntArray]]] = {}
    for entity, labels in names.items():
        for kind, members in rows.get(entity, {}).items():
            for label in labels:
                found.setdefault(label, {}).setdefault(kind, []).append(members)
    return {
        label: {kind: np.concatenate(parts) for kind, parts in kinds.items()}
        for label, kinds in found.items()
    }


def fill(gmsh: ModuleType, ask: Request) -> None:
    """Make a solid of the triangles of an open STL file.

    Raises
    ------
    MeshError
        A surface that is not closed.
    """
    gmsh.model.mesh.removeDuplicateNodes()
    kinds, _, nodes = gmsh.model.mesh.getElements(2)
    triangles = [np.reshape(n, (-1, 3)) for k, n in zip(kinds, nodes, strict=True) if k == 2]
    if not triangles:
        raise MeshError(f"{ask.name} holds no triangles.")
    corners = np.vstack(triangles)
    edges = np.sort(np.vstack([corners[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    if (count != 2).any():
        raise MeshError(
            f"{ask.name} is not closed: {int((count != 2).sum())} of {len(count)} edges do not "
            "belong to two triangles; repair the surface (holes, facets twice), or read it as a "
            "sheet without solid=True."
        )
    gmsh.model.mesh.classifySurfaces(math.radians(SHARP_ANGLE), True, True, math.pi)
    gmsh.model.mesh.createGeometry()
    surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
    gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(surfaces)])
    gmsh.model.geo.synchronize()
