"""CAD files: ways to mesh them, and the names of their solids, faces and holes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MeshError, UnmeshableError
from antiosc.base.texts import piece_is_read
from antiosc.io.request import Request

#: Files that state the unit of their coordinates.
STATES_UNIT = (".step", ".stp", ".iges", ".igs")
#: (dimension, tag) -> names
Names = dict[tuple[int, int], list[str]]


# --- Ways to mesh ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Attempt:
    """One attempt to mesh a geometry: a factor on the element size, and gmsh options."""

    about: str
    share: float = 1.0
    options: Mapping[str, float] = field(default_factory=dict)
    #: repairs of the geometry, made as the file is opened
    healing: Mapping[str, float] = field(default_factory=dict)
    #: whether faces are flat between the corners of the cells
    flat: bool = False
    #: False of facets as they are, which are tried where sides cannot be unrolled
    cut: bool = True
    #: of a surface of triangles: edges from this angle on are kept, degrees
    sharp: float = 40.0
    #: whether elements are smaller at the points of `refine`
    refined: bool = True

    @property
    def curved(self) -> bool:
        """Whether the attempt is for surfaces with known curvature."""
        return bool(AROUND.keys() & self.options.keys())

    @property
    def unparametrised(self) -> bool:
        """Whether no side of a surface of triangles, or only small patches, must be unrolled."""
        return not self.cut or self.options == PATCHES

    @property
    def other_triangles(self) -> bool:
        """Whether faces are meshed by another algorithm than gmsh's default."""
        return "Mesh.Algorithm" in self.options

    def suits(self, is_cad: bool) -> bool:
        """Whether the attempt is for CAD files (`is_cad` true) or for triangulated surfaces
        (false).
        """
        if is_cad:
            return self.sharp == Attempt.sharp
        return not self.curved

    def prepare(self, gmsh: ModuleType, scripted: bool = False) -> None:
        """Set the options of gmsh; `scripted`: over those of a script, which may have failed."""
        options = dict(self.options)
        if scripted:
            first = not self.options
            options = {**NETGEN, **({} if first else USUAL), **options}
        for name, value in options.items():
            gmsh.option.setNumber(name, value)


#: Repairs of OpenCASCADE.
HEALING = {
    f"Geometry.OCC{name}": 1.0
    for name in ("FixDegenerated", "FixSmallEdges", "FixSmallFaces", "SewFaces", "MakeSolids")
}
#: Elements around a full turn: without them thin curved walls pierce each other.
AROUND, CLOSELY = ({"Mesh.MeshSizeFromCurvature": number} for number in (12.0, 20.0))
HXT = {"Mesh.Algorithm3D": 10.0}
#: For scripts: an optimiser that Debian's gmsh does not have, and gmsh's default algorithms.
NETGEN = {"Mesh.OptimizeNetgen": 0.0}
USUAL = {"Mesh.Algorithm": 6.0, "Mesh.Algorithm3D": 1.0, "Mesh.HighOrderOptimize": 0.0}
#: Angles, degrees, from which on edges are kept. For triangulated surfaces whose curved sides,
#: meshed anew, pierce each other, or touch themselves at a corner: from 10 on, cylinders keep their
#: facets; from 1 on, all sides are flat, so that the mesh has the surface of the file.
FACETED = (10.0, 1.0)
#: For triangulated surfaces whose sides cannot be parametrised, such as holes that touch the rim.
PATCHES = {"Mesh.ReparamMaxTriangles": 100.0}
#: The attempts in order; the first is gmsh's default. Of 91 CAD files by others, with elements of a
#: twentieth of their length, the first meshed 78 and elements that follow the curvature 3; 8 had no
#: shapes, and 2 took more than 200 s.
ATTEMPTS = (
    Attempt("as it is"),
    Attempt("with elements that follow the curvature", options=AROUND),
    *(Attempt(f"with all edges from {angle:g}° on", sharp=angle) for angle in FACETED),
    Attempt("at half the element size", share=0.5),
    Attempt("by HXT", options=HXT),
    Attempt("with elements that follow the curvature closely", options=CLOSELY),
    Attempt("without smaller elements at points (refine)", refined=False),
    Attempt("by other triangles (MeshAdapt)", options={"Mesh.Algorithm": 1, **AROUND}),
    Attempt("after repairs by OpenCASCADE", options=AROUND, healing=HEALING),
    Attempt("at a quarter of the element size", share=0.25, options=AROUND),
    Attempt("with flat facets", share=0.5, healing=HEALING, flat=True, refined=False),
    Attempt("with its facets as they are", flat=True, cut=False, sharp=1.0),
    Attempt("in small patches, which cut sharp edges", options=PATCHES, sharp=180.0),
)


# --- Opening --------------------------------------------------------------------------------------


def opened(gmsh: ModuleType, path: str, healing: Mapping[str, float] | None = None) -> float:
    """Open a file, with repairs if they are given; returns metres per unit of its coordinates.

    gmsh refuses a unit for IGES (4.8 of Debian 12 and 4.13 of Debian 13), and then uses
    OpenCASCADE's millimetres.

    Raises
    ------
    UnmeshableError
        The repairs leave fewer solids: of a bracket by others the faces alone, which would be read
        as a sheet.
    """
    iges = path.endswith((".iges", ".igs"))
    gmsh.option.setString("Geometry.OCCTargetUnit", "" if iges else "M")
    gmsh.open(path)
    if healing:
        solids = len(gmsh.model.getEntities(3))
        for name, value in healing.items():
            gmsh.option.setNumber(name, value)
        gmsh.clear()
        gmsh.open(path)
        if len(gmsh.model.getEntities(3)) < solids:
            raise UnmeshableError("Repairs by OpenCASCADE open its solids.")
    return 1e-3 if iges else 1.0


# --- Names ----------------------------------------------------------------------------------------

#: Name of a numbered face.
FACE = re.compile(r"face \d+")
#: Labels that programs write by themselves.
NO_NAME = re.compile(r"Shapes|SOLID|SHELL|COMPOUND|FACE|NONE|=>\[.*\]|Open CASCADE .*|Unnamed.*|")
#: Sample points of a face along each of its parameters.
GRID = 7
#: Sectors of a full turn that faces of a hole must cover.
SECTORS = 12
#: Curvatures, and axes over the radius, that differ by less are equal.
ALIKE = 1e-3


def label_of(text: str) -> str:
    """The name in a label such as "Shapes/assembly/nut_1/nut"; "" for names made by programs."""
    parts = [part.strip() for part in text.split("/")]
    return next((part for part in reversed(parts) if not NO_NAME.fullmatch(part)), "")


def names_of(gmsh: ModuleType, ask: Request, scale: float) -> Names:
    """Names of the solids, faces and holes of a CAD file.

    The solids are cut at each other (`fragments`), or all but one are removed (`piece`). `scale`:
    metres per unit of the model.
    """
    names = _labelled(gmsh, 3)
    if ask.fragments:
        names = _cut(gmsh, names, ask.name)
    elif ask.piece is not None:
        names = _alone(gmsh, names, ask.piece, ask.name)
    return {**names, **face_names(gmsh, scale)}


def in_order(names: Iterable[str]) -> list[str]:
    """Names sorted by the numbers in them, those of numbered faces last."""

    def key(name: str) -> list[tuple[float, str]]:
        words = re.split(r"(\d+(?:\.\d+)?)", name)
        return [(float(word), "") if k % 2 else (0.0, word) for k, word in enumerate(words)]

    return sorted(names, key=lambda name: (bool(FACE.fullmatch(name)), key(name)))


def _label(gmsh: ModuleType, entity: tuple[int, int]) -> str:
    """The label of an entity; "" without one."""
    return label_of(gmsh.model.getEntityName(*entity))


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


def _cut(gmsh: ModuleType, names: Names, name: str) -> Names:
    """Cut the solids at each other; returns the names of the pieces."""
    solids = gmsh.model.getEntities(3)
    if len(solids) < 2:
        raise MeshError(f"fragments joins solids; {name} has {len(solids)} of them.")
    _, pieces = gmsh.model.occ.fragment(solids, [], removeObject=True, removeTool=True)
    gmsh.model.occ.synchronize()
    cut: Names = {}
    for entity, pieces_of_solid in zip(solids, pieces, strict=False):
        for dim, tag in pieces_of_solid:
            if dim == 3:
                cut.setdefault((3, int(tag)), []).extend(names.get(entity, []))
    return cut


def largest_first(gmsh: ModuleType) -> list[tuple[int, int]]:
    """The solids by their volumes: the rank of a piece. Of facets, as gmsh numbers them."""
    solids = list(gmsh.model.getEntities(3))
    volumes = {solid: gmsh.model.occ.getMass(*solid) for solid in gmsh.model.occ.getEntities(3)}
    return sorted(solids, key=lambda solid: -volumes.get(solid, 0.0))


def _alone(gmsh: ModuleType, names: Names, piece: int, name: str) -> Names:
    """Remove all solids but the `piece`-th largest; return the names of the remaining one."""
    solids = largest_first(gmsh)
    if not solids:  # of sheets: their pieces are those of the mesh
        return names
    if piece > len(solids):
        raise MeshError(f"{name} has {len(solids)} solids; there is no piece {piece}.")
    solid = solids.pop(piece - 1)
    gmsh.model.occ.remove(solids, recursive=True)
    gmsh.model.occ.synchronize()
    return {entity: label for entity, label in names.items() if entity == solid}


def left_out(gmsh: ModuleType, ask: Request) -> list[str]:
    """A sentence (in a list) on a solid that is read without the others."""
    count = len(gmsh.model.getEntities(3))
    if ask.piece is None or ask.fragments or count < 2:
        return []
    return [piece_is_read(ask.name, ask.piece, count)]


def face_names(gmsh: ModuleType, scale: float) -> Names:
    """Names of the outer faces: numbers, labels, colours if there are several, holes."""
    all_faces = gmsh.model.getEntities(2)
    if gmsh.model.getEntities(3):
        all_faces = [face for face in all_faces if len(gmsh.model.getAdjacencies(*face)[0]) == 1]
    names: Names = {face: [f"face {face[1]}"] for face in all_faces}
    # some programs give every face the name of its solid, which names none of them
    of_solids = {_label(gmsh, solid) for solid in gmsh.model.getEntities(3)}
    for face, (label,) in _labelled(gmsh, 2).items():
        if (
            face in names
            and _label(gmsh, face) not in of_solids
            and label not in (label_list for labels in names.values() for label_list in labels)
        ):
            names[face].append(label)
    colours = {face: _colour(gmsh, face) for face in all_faces}
    if len(set(colours.values())) > 1:
        for face, colour in colours.items():
            names[face] += [colour] if colour else []
    for hole, faces in _holes(gmsh, all_faces, scale):
        for face in faces:
            names[face].append(hole)
    return names


def _colour(gmsh: ModuleType, face: tuple[int, int]) -> str:
    """ "colour #rrggbb" of a face; "" if the file has none."""
    red, green, blue, has_colour = gmsh.model.getColor(*face)
    return f"colour #{red:02x}{green:02x}{blue:02x}" if has_colour else ""


@dataclass(frozen=True, eq=False)
class CylindricalFace:
    """A cylindrical face."""

    face: tuple[int, int]
    radius: float
    #: a point on the axis, next to the origin, and the axis' direction (3,)
    foot: Array
    axis: Array
    #: sectors of a full turn in which it has points
    sectors: frozenset[int]
    #: middle of the axis within the face (3,)
    middle: Array
    edges: frozenset[int]


def _holes(
    gmsh: ModuleType, faces: Sequence[tuple[int, int]], scale: float
) -> Iterator[tuple[str, list[tuple[int, int]]]]:
    """Pairs ("hole 6 mm (1)", its faces): coaxial cylindrical faces that enclose empty space."""
    solid = gmsh.model.getDimension() == 3
    hollow = [cylinder for face in faces if solid and (cylinder := _hollow(gmsh, face)) is not None]
    joined: list[list[CylindricalFace]] = []
    for cylinder in hollow:
        neighbours = [hole for hole in joined if any(_beside(cylinder, face) for face in hole)]
        joined = [hole for hole in joined if hole not in neighbours]
        joined.append([cylinder, *(other for hole in neighbours for other in hole)])
    by_size: dict[str, list[list[CylindricalFace]]] = {}
    for hole in joined:
        if len(frozenset[int]().union(*(cylinder.sectors for cylinder in hole))) == SECTORS:
            name = f"hole {2e3 * scale * hole[0].radius:.4g} mm"
            by_size.setdefault(name, []).append(hole)
    for name, groups in sorted(by_size.items()):
        groups.sort(key=lambda hole: tuple(np.round(hole[0].middle, 6)))
        for number, hole in enumerate(groups, 1):
            yield f"{name} ({number})", [cylinder.face for cylinder in hole]


def _beside(first: CylindricalFace, second: CylindricalFace) -> bool:
    """Whether two cylinders share an edge, the axis and the radius."""
    tolerance = ALIKE * first.radius
    distance = float(np.linalg.norm(first.foot - second.foot))
    parallel = abs(float(first.axis @ second.axis)) > 1 - ALIKE
    if not first.edges & second.edges:
        return False
    return parallel and abs(first.radius - second.radius) < tolerance and distance < 10 * tolerance


def _hollow(gmsh: ModuleType, face: tuple[int, int]) -> CylindricalFace | None:
    """The cylinder of a face that encloses empty space; None for any other face."""
    tag = face[1]
    low, high = gmsh.model.getParametrizationBounds(*face)
    steps = np.linspace(0.01, 0.99, GRID)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    parameters = np.array(low) + grid * (np.array(high) - np.array(low))
    largest_curvature, smallest_curvature, across, along = gmsh.model.getPrincipalCurvatures(
        tag, parameters.ravel()
    )
    largest = np.abs(largest_curvature) > np.abs(smallest_curvature)
    bent = np.where(largest, largest_curvature, smallest_curvature)
    straight = np.where(largest, smallest_curvature, largest_curvature)
    axes = np.where(largest[:, None], np.reshape(along, (-1, 3)), np.reshape(across, (-1, 3)))
    curvature = float(np.abs(bent).max())
    flat = not np.isfinite(bent).all() or curvature <= 0
    if flat or np.ptp(bent) > ALIKE * curvature or np.abs(straight).max() > ALIKE * curvature:
        return None
    axis = axes[0] / np.linalg.norm(axes[0])
    if (np.abs(axes @ axis) < 1 - ALIKE).any():
        return None
    x = np.reshape(gmsh.model.getValue(2, tag, parameters.ravel()), (-1, 3))
    normals = np.reshape(gmsh.model.getNormal(tag, parameters.ravel()), (-1, 3))
    radius = 1 / curvature
    side = min((1, -1), key=lambda sign: _spread(x - sign * radius * normals, axis))
    centres = x - side * radius * normals
    if side > 0:  # gmsh's normals point out of the solid
        return None
    foot = centres[0] - axis * (centres[0] @ axis)
    curves = gmsh.model.getBoundary([face], oriented=False)
    edges = frozenset(curve for _, curve in curves)
    middle = centres.mean(axis=0)
    return CylindricalFace(face, radius, foot, axis, _sectors(centres - x, axis), middle, edges)


def _spread(points: Array, axis: Array) -> float:
    """Largest distance of points (n, 3) from their mean line along the axis."""
    offsets = points - np.outer(points @ axis, axis)
    return float(np.ptp(offsets, axis=0).max())


def _sectors(across: Array, axis: Array) -> frozenset[int]:
    """The angular sectors about the axis that directions (n, 3) span."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(np.round(axis, 6)))])
    second = np.cross(axis, first)
    angles = np.arctan2(across @ second, across @ first).reshape(GRID, GRID)
    fine: list[Array] = []
    for rows in (angles, angles.T):  # one of the parameters goes around
        unwrapped = np.unwrap(rows, axis=1)
        fine += [np.linspace(row[0], row[-1], 8 * SECTORS) for row in unwrapped]
    sectors = np.concatenate(fine) / (2 * np.pi) * SECTORS
    return frozenset(int(k) for k in np.floor(sectors) % SECTORS)
