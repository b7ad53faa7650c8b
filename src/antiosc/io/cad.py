"""CAD files: their unit, and the names of their solids, faces and holes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from types import ModuleType
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MeshError
from antiosc.base.texts import piece_is_read
from antiosc.io.isolation import Request
from antiosc.io.neutral import connected

#: Endings of CAD files, and those of files that state the unit of their coordinates.
CAD = (".step", ".stp", ".brep", ".iges", ".igs")
STATES_UNIT = (".step", ".stp", ".iges", ".igs")
#: (dimension, tag) -> names
Names = dict[tuple[int, int], list[str]]
#: Name of a numbered face.
FACE = re.compile(r"face \d+")
#: Labels that programs write by themselves.
NO_NAME = re.compile(r"Shapes|SOLID|SHELL|COMPOUND|FACE|NONE|=>\[.*\]|Open CASCADE .*|Unnamed.*|")
#: Radii, axes and angles that differ by this share are equal.
ALIKE = 1e-3


def opened(gmsh: ModuleType, path: str) -> float:
    """Open a file; returns metres per unit of its coordinates.

    gmsh refuses a unit for IGES (4.8 of Debian 12 and 4.13 of Debian 13), and then uses
    OpenCASCADE's millimetres.
    """
    iges = path.endswith((".iges", ".igs"))
    gmsh.option.setString("Geometry.OCCTargetUnit", "" if iges else "M")
    gmsh.open(path)
    return 1e-3 if iges else 1.0


def names_of(gmsh: ModuleType, ask: Request, scale: float) -> Names:
    """Names of the solids, faces and holes of a CAD file, after its solids are cut at each other
    (`fragments`), or all but one removed (`piece`); `scale`: metres per unit of the model.
    """
    names = _labelled(gmsh, 3)
    if ask.fragments:
        names = _cut(gmsh, names, ask.name)
    elif ask.piece is not None:
        _alone(gmsh, ask.piece, ask.name)
    solids = gmsh.model.getEntities(3)
    return {s: names[s] for s in solids if s in names} | face_names(gmsh, scale)


def in_order(names: Iterable[str]) -> list[str]:
    """Names sorted by the numbers in them, those of numbered faces last."""

    def key(name: str) -> list[tuple[float, str]]:
        words = re.split(r"(\d+(?:\.\d+)?)", name)
        return [(float(word), "") if k % 2 else (0.0, word) for k, word in enumerate(words)]

    return sorted(names, key=lambda name: (bool(FACE.fullmatch(name)), key(name)))


def _label(gmsh: ModuleType, entity: tuple[int, int]) -> str:
    """The name in a label such as "Shapes/assembly/nut_1/nut"; "" for names made by programs."""
    parts = [part.strip() for part in gmsh.model.getEntityName(*entity).split("/")]
    return next((part for part in reversed(parts) if not NO_NAME.fullmatch(part)), "")


def _labelled(gmsh: ModuleType, dim: int) -> Names:
    """Entities by label; a label of several entities gets numbers."""
    names: Names = {}
    counts: dict[str, int] = {}
    for entity in gmsh.model.getEntities(dim):
        label = _label(gmsh, entity)
        if label:
            counts[label] = counts.get(label, 0) + 1
            names[entity] = [label if counts[label] == 1 else f"{label} ({counts[label]})"]
    return names


# --- Solids ---------------------------------------------------------------------------------------


def _cut(gmsh: ModuleType, names: Names, name: str) -> Names:
    """Cut the solids at each other; returns the names of the pieces."""
    solids = gmsh.model.getEntities(3)
    if len(solids) < 2:
        raise MeshError(f"fragments joins solids; {name} has {len(solids)} of them.")

    _, pieces = gmsh.model.occ.fragment(solids, [], removeObject=True, removeTool=True)
    gmsh.model.occ.synchronize()

    cut: Names = {}
    for entity, pieces_of_solid in zip(solids, pieces, strict=False):
        for piece in pieces_of_solid:
            cut.setdefault(piece, []).extend(names.get(entity, []))
    return cut


def largest_first(gmsh: ModuleType) -> list[tuple[int, int]]:
    """The solids by their volumes: the rank of a piece. Of facets, as gmsh numbers them."""
    solids = list(gmsh.model.getEntities(3))
    volumes = {solid: gmsh.model.occ.getMass(*solid) for solid in gmsh.model.occ.getEntities(3)}
    return sorted(solids, key=lambda solid: -volumes.get(solid, 0.0))


def _alone(gmsh: ModuleType, piece: int, name: str) -> None:
    """Remove all solids but the `piece`-th largest; of sheets the pieces are those of the mesh."""
    solids = largest_first(gmsh)
    if piece > len(solids) > 0:
        raise MeshError(f"{name} has {len(solids)} solids; there is no piece {piece}.")
    gmsh.model.occ.remove(solids[: piece - 1] + solids[piece:], recursive=True)
    gmsh.model.occ.synchronize()


def left_out(gmsh: ModuleType, ask: Request) -> list[str]:
    """A sentence (in a list) on a solid that is read without the others."""
    count = len(gmsh.model.getEntities(3))
    if ask.piece is None or ask.fragments or count < 2:
        return []
    return [piece_is_read(ask.name, ask.piece, count)]


# --- Faces ----------------------------------------------------------------------------------------


def face_names(gmsh: ModuleType, scale: float) -> Names:
    """Names of the outer faces: numbers, labels, holes."""
    faces = gmsh.model.getEntities(2)
    if gmsh.model.getEntities(3):
        faces = [face for face in faces if len(gmsh.model.getAdjacencies(*face)[0]) == 1]
    names: Names = {face: [f"face {face[1]}"] for face in faces}

    # some programs give every face the name of its solid, which names none of them
    of_solids = {_label(gmsh, solid) for solid in gmsh.model.getEntities(3)}
    numbered = {label for labels in names.values() for label in labels}
    for face, (label,) in _labelled(gmsh, 2).items():
        if face in names and label not in numbered and _label(gmsh, face) not in of_solids:
            names[face].append(label)

    if gmsh.model.getDimension() == 3:
        for hole, its_faces in _holes(gmsh, faces, scale):
            for face in its_faces:
                names[face].append(hole)
    return names


class Cylinder(NamedTuple):
    """A cylindrical face that encloses empty space."""

    face: tuple[int, int]
    radius: float
    #: a point on the axis, and its direction (3,)
    middle: Array
    axis: Array
    #: angle that it spans [rad]
    angle: float
    edges: frozenset[int]

    def continues(self, other: Cylinder) -> bool:
        """Whether both share an edge, the axis and the radius."""
        aside = np.linalg.norm(np.cross(self.middle - other.middle, self.axis))
        parallel = abs(float(self.axis @ other.axis)) > 1 - ALIKE
        same_radius = abs(self.radius - other.radius) < ALIKE * self.radius
        beside = bool(self.edges & other.edges)
        return beside and parallel and same_radius and bool(aside < 10 * ALIKE * self.radius)


def _holes(
    gmsh: ModuleType, faces: Sequence[tuple[int, int]], scale: float
) -> Iterator[tuple[str, list[tuple[int, int]]]]:
    """Pairs ("hole 6 mm (1)", its faces): coaxial cylindrical faces that enclose empty space."""
    hollow = [c for face in faces if (c := _hollow(gmsh, face))]
    pairs = [(i, j) for j, c in enumerate(hollow) for i in range(j) if c.continues(hollow[i])]
    label = connected([np.array(pairs, dtype=np.int64).reshape(-1, 2)], len(hollow))
    holes = [[c for c, k in zip(hollow, label, strict=True) if k == hole] for hole in set(label)]

    by_size: dict[str, list[list[Cylinder]]] = {}
    for hole in holes:
        if sum(cylinder.angle for cylinder in hole) > 2 * np.pi * (1 - ALIKE):  # a full turn
            size = f"hole {2e3 * scale * hole[-1].radius:.4g} mm"
            by_size.setdefault(size, []).append(hole)

    for size, group in sorted(by_size.items()):
        group.sort(key=lambda hole: tuple(np.round(hole[-1].middle, 6)))
        for number, hole in enumerate(group, 1):
            yield f"{size} ({number})", [cylinder.face for cylinder in hole]


def _hollow(gmsh: ModuleType, face: tuple[int, int]) -> Cylinder | None:
    """The cylinder of a face that encloses empty space; None for any other face."""
    if gmsh.model.getType(*face) != "Cylinder":
        return None
    tag = face[1]
    low, high = (np.array(bound) for bound in gmsh.model.getParametrizationBounds(*face))

    # three points around the axis, which is where their normals meet
    around, along = np.array([0.2, 0.5, 0.7]), 0.5
    shares = np.column_stack([around, np.full(3, along)])
    parameters = (low + shares * (high - low)).ravel()
    x = np.reshape(gmsh.model.getValue(2, tag, parameters), (-1, 3))
    normals = np.reshape(gmsh.model.getNormal(tag, parameters), (-1, 3))
    axis = np.cross(normals[0], normals[1])
    axis = axis / np.linalg.norm(axis)
    apart, turn = x[1] - x[0], normals[1] - normals[0]
    radius = float(apart @ turn / (turn @ turn))
    if radius > 0:  # gmsh's normals point out of the solid
        return None

    middle = x[1] - radius * normals[1]
    edges = frozenset(curve for _, curve in gmsh.model.getBoundary([face], oriented=False))
    return Cylinder(face, -radius, middle, axis, float(high[0] - low[0]), edges)
