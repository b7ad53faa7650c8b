"""CAD files whose solids gmsh cannot mesh: their surface from OpenCASCADE's triangles, made anew.

OpenCASCADE divides each face of a solid into triangles for pictures, also faces that gmsh cannot
mesh; they need not fit together. gmsh writes them as X3D (only newer versions of it give them
directly), and fTetWild makes a closed surface of them: of several solids the one around all, which
joins those that touch or overlap.
"""

from __future__ import annotations

import contextlib
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import UnmeshableError
from antiosc.io import by_gmsh, cad, remade
from antiosc.io.facets import FacetSkin, areas
from antiosc.io.neutral import FileMesh, IntArray
from antiosc.io.request import Request

#: Triangles of one face in X3D: indices, and coordinates of the corners.
FACE = re.compile(r'DEF="setface\d*"\s+index="([^"]*)".*?point="([^"]*)"', re.DOTALL)
#: Angle [rad] and distance, over the size of a face, between neighbouring triangles and the face. A
#: bracket with 13 holes has 0.4 % too much volume with OpenCASCADE's 0.35 and 0.01.
NEAR = {"Mesh.StlAngularDeflection": 0.15, "Mesh.StlLinearDeflection": 0.003}


def read(ask: Request) -> FileMesh:
    """Read a CAD file; if that is asked for, as its surface made anew."""
    if not ask.remade:
        return by_gmsh.generate(ask)
    ask.allow(remade.TIME)
    gmsh = by_gmsh.session()
    for name, value in NEAR.items():
        gmsh.option.setNumber(name, value)
    source = shutil.copyfile(ask.path, f"mesh{Path(ask.path).suffix.lower()}")
    scale = cad.opened(gmsh, str(source))
    solids = gmsh.model.getEntities(3)
    together = ask.fragments and len(solids) > 1
    if not solids or (len(solids) > 1 and ask.piece is None and not together):
        raise UnmeshableError(f"{ask.name} is not one solid, whose surface could be made anew.")
    notes = cad.left_out(gmsh, ask)
    names = cad.names_of(gmsh, replace(ask, fragments=False), scale * ask.unit[0])
    faces, points, triangles = _triangles(gmsh)
    skin = FacetSkin(points, triangles, np.zeros(len(triangles), dtype=np.int64))
    anew = remade.made_anew(skin, ask.name, _volume(gmsh), together)
    of_face: dict[str, list[int]] = {}
    for (dim, tag), labels in names.items():
        for label in labels if dim == 2 else ():
            of_face.setdefault(label, []).append(tag)
    labelled = {
        label: np.flatnonzero(np.isin(faces, of_face[label])) for label in cad.in_order(of_face)
    }
    surface = remade.with_faces(anew, skin, labelled)
    surface.points *= scale
    surface.remarks = [*notes, *anew.remarks]
    return surface


def _volume(gmsh: ModuleType) -> float:
    """Volume of the solids; what several have in common counts once."""
    solids = gmsh.model.getEntities(3)
    if len(solids) > 1:
        with contextlib.suppress(Exception):  # gmsh raises nothing else
            gmsh.model.occ.fragment(solids, [], removeObject=True, removeTool=True)
            gmsh.model.occ.synchronize()
    return float(sum(gmsh.model.occ.getMass(*solid) for solid in gmsh.model.getEntities(3)))


def _triangles(gmsh: ModuleType) -> tuple[IntArray, Array, IntArray]:
    """OpenCASCADE's triangles (t, 3) of all faces, their corners, and the face of each."""
    faces = [tag for _, tag in gmsh.model.getEntities(2)]
    gmsh.model.removePhysicalGroups()
    for tag in faces:  # X3D has these names in place of those of the groups
        gmsh.model.removeEntityName(gmsh.model.getEntityName(2, tag))
    for tag in faces:  # X3D has one set for each physical group
        gmsh.model.addPhysicalGroup(2, [tag], tag)
    gmsh.option.setNumber("Print.X3dSurfaces", 2)
    gmsh.write("surface.x3d")
    sets = FACE.findall(Path("surface.x3d").read_text())
    points, triangles = [], []
    count = 0
    for indices, coordinates in sets:
        points.append(np.array(coordinates.split(), dtype=float).reshape(-1, 3))
        triangles.append(np.array(indices.split(), dtype=np.int64).reshape(-1, 3) + count)
        count += len(points[-1])
    if len(sets) != len(faces):
        raise UnmeshableError(f"OpenCASCADE gives triangles of {len(sets)} of {len(faces)} faces.")
    owners = np.repeat(faces, [len(block) for block in triangles])
    everything = np.vstack(points)
    all_triangles = np.vstack(triangles)
    sound = areas(everything, all_triangles) > 0  # others have no normal
    return owners[sound], everything, all_triangles[sound]
