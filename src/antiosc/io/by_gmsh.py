"""Gmsh's mesh files, and geometries that gmsh meshes.

gmsh executes a file as a script if it does not begin like a mesh, and it reads options from files
in the same folder. Therefore gmsh gets a copy under a fixed name in an empty folder, after a check
of the first line of a mesh, or of the words of a script (`checked_script`). CAD files have units,
assemblies, and names of their solids, faces and holes; `facets` reads surfaces of triangles.
"""

from __future__ import annotations

import inspect
import re
import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import factorial, sqrt
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MeshError, MissingDependencyError, UnmeshableError
from antiosc.base.texts import percent, piece_text
from antiosc.io import facets
from antiosc.io.conversion import checked_kind, with_supported_kinds
from antiosc.io.isolation import ELEMENTS_PER_TURN, Refinement, Request, checked_script, with_growth
from antiosc.io.neutral import (
    CELL_TYPES,
    CORNERS,
    EDGES,
    EntityNames,
    FileMesh,
    IntArray,
    Piece,
    connected_pieces,
    joined_groups,
    quadrilateral_faces,
)

#: Endings of CAD files, and those of files that state the unit of their coordinates.
CAD_ENDINGS = (".step", ".stp", ".brep", ".iges", ".igs")
ENDINGS_WITH_UNIT = (".step", ".stp", ".iges", ".igs")
#: Name of a numbered face.
NUMBERED_FACE = re.compile(r"face \d+")
#: Labels that programs write by themselves.
AUTOMATIC_LABEL = re.compile(
    r"Shapes|SOLID|SHELL|COMPOUND|FACE|NONE|=>\[.*\]|Open CASCADE .*|Unnamed.*|"
)
#: Radii, axes and angles that differ by this share are equal.
CYLINDER_TOLERANCE = 1e-3
#: Reasons in the error for a CAD file without shapes, and for one with an analysis.
NO_SHAPES_REASON = (
    "it holds no shapes, as an assembly whose parts are files of their own; open one of these, or "
    "write the assembly with its parts in one file"
)
ANALYSIS_SCHEMA, ANALYSIS_REASON = (
    b"AP209",
    "it holds an analysis (STEP AP209), not the shape of a part; write the mesh as a deck of "
    "Nastran or Abaqus, or the shape as STEP AP203, AP214 or AP242",
)
#: Size requested from gmsh over the required one, since its edges are up to 1.9 times longer.
GMSH_SIZE_FACTOR = 0.5
#: More cells than this are refused: gmsh would need some 20 GB.
MOST_CELLS = 10_000_000
#: Processor time [s] that a mesh may take, besides 2 ms a cell.
MESHING_TIME_LIMIT = 120.0
#: Least size of elements by the curvature over the one that is asked for.
LEAST_CURVATURE_SIZE = 0.02
#: Share of the volume by which a mesh may differ without a remark; phrase of the remark.
VOLUME_TOLERANCE, CORNERS_CUT_PHRASE = 5e-3, "elements cut off bends and holes"
#: Number of regular simplices with edges of length 1 per unit of length, area or volume.
REGULAR_CELL_DENSITY = (0.0, 1.0, 4 / sqrt(3), 6 * sqrt(2))


def open_cad(gmsh: ModuleType, path: str) -> float:
    """Open a file in gmsh; returns the unit of gmsh's coordinates [m]."""
    iges = path.endswith((".iges", ".igs"))
    gmsh.option.setString("Geometry.OCCTargetUnit", "" if iges else "M")
    gmsh.open(path)
    return 1e-3 if iges else 1.0


def entity_names(gmsh: ModuleType, request: Request, scale: float) -> EntityNames:
    """Names of solids, faces and holes of a CAD file, after cutting or selecting its solids."""
    names = _labels(gmsh, 3)
    if request.fragments:
        names = _cut_solids(gmsh, names, request.name)
    elif request.piece is not None:  # a file without solids stays as it is
        solids, piece = solids_by_volume(gmsh), request.piece
        if piece > len(solids) > 0:
            raise MeshError(f"{request.name} has {len(solids)} solids; there is no piece {piece}.")
        gmsh.model.occ.remove(solids[: piece - 1] + solids[piece:], recursive=True)
        gmsh.model.occ.synchronize()
    solids = gmsh.model.getEntities(3)
    return {s: names[s] for s in solids if s in names} | face_names(gmsh, scale)


def naturally_sorted(names: Iterable[str]) -> list[str]:
    """Names sorted alphabetically and by the numbers in them; "face 1", "face 2", … come last."""

    def key(name: str) -> list[tuple[float, str]]:
        words = re.split(r"(\d+(?:\.\d+)?)", name)
        return [(float(word), "") if k % 2 else (0.0, word) for k, word in enumerate(words)]

    return sorted(names, key=lambda name: (bool(NUMBERED_FACE.fullmatch(name)), key(name)))


def _label(gmsh: ModuleType, entity: tuple[int, int]) -> str:
    """The name in a label such as "Shapes/assembly/nut_1/nut"; "" if a program generated it."""
    parts = [part.strip() for part in gmsh.model.getEntityName(*entity).split("/")]
    return next((part for part in reversed(parts) if not AUTOMATIC_LABEL.fullmatch(part)), "")


def _labels(gmsh: ModuleType, dim: int) -> EntityNames:
    """Names of the entities of dimension `dim`: their labels; equal labels are numbered."""
    names: EntityNames = {}
    counts: dict[str, int] = {}
    for entity in gmsh.model.getEntities(dim):
        label = _label(gmsh, entity)
        if label:
            counts[label] = counts.get(label, 0) + 1
            names[entity] = [label if counts[label] == 1 else f"{label} ({counts[label]})"]
    return names


# --- Solids ---------------------------------------------------------------------------------------


def _cut_solids(gmsh: ModuleType, names: EntityNames, name: str) -> EntityNames:
    """Cut the solids at each other; returns names of the pieces, derived from the solids' names."""
    solids = gmsh.model.getEntities(3)
    if len(solids) < 2:
        raise MeshError(f"fragments joins solids; {name} has {len(solids)} of them.")

    _, pieces = gmsh.model.occ.fragment(solids, [], removeObject=True, removeTool=True)
    gmsh.model.occ.synchronize()

    cut: EntityNames = {}
    for entity, pieces_of_solid in zip(solids, pieces, strict=False):
        for piece in pieces_of_solid:
            cut.setdefault(piece, []).extend(names.get(entity, []))
    return cut


def solids_by_volume(gmsh: ModuleType) -> list[tuple[int, int]]:
    """The solids (dimension, tag) by descending volume; solids of facets come last."""
    solids = list(gmsh.model.getEntities(3))
    volumes = {solid: gmsh.model.occ.getMass(*solid) for solid in gmsh.model.occ.getEntities(3)}
    return sorted(solids, key=lambda solid: -volumes.get(solid, 0.0))


# --- Faces ----------------------------------------------------------------------------------------


def face_names(gmsh: ModuleType, scale: float) -> EntityNames:
    """Names of the outer faces: "face <tag>", the file's labels, and names of holes."""
    faces = gmsh.model.getEntities(2)
    if gmsh.model.getEntities(3):
        faces = [face for face in faces if len(gmsh.model.getAdjacencies(*face)[0]) == 1]
    names: EntityNames = {face: [f"face {face[1]}"] for face in faces}

    # some programs give every face the name of its solid, which names none of them
    of_solids = {_label(gmsh, solid) for solid in gmsh.model.getEntities(3)}
    numbered = {label for labels in names.values() for label in labels}
    for face, (label,) in _labels(gmsh, 2).items():
        if face in names and label not in numbered and _label(gmsh, face) not in of_solids:
            names[face].append(label)

    if gmsh.model.getDimension() == 3:
        for hole, its_faces in _holes(gmsh, faces, scale):
            for face in its_faces:
                names[face].append(hole)
    return names


class Cylinder(NamedTuple):
    """A cylindrical face of a solid with empty space on its inside, as in a hole."""

    face: tuple[int, int]  # (2, tag)
    radius: float  # in gmsh's unit of length, as `middle`
    #: a point (3,) on the axis, and the unit direction (3,) of the axis
    middle: Array
    axis: Array
    #: angle that it spans [rad]
    angle: float
    edges: frozenset[int]  # tags of the curves that bound it

    def continues(self, other: Cylinder) -> bool:
        """Whether both cylinders have a common edge, one axis and one radius: parts of one hole."""
        aside = np.linalg.norm(np.cross(self.middle - other.middle, self.axis))
        parallel = abs(float(self.axis @ other.axis)) > 1 - CYLINDER_TOLERANCE
        same_radius = abs(self.radius - other.radius) < CYLINDER_TOLERANCE * self.radius
        beside = bool(self.edges & other.edges)
        coaxial = parallel and bool(aside < 10 * CYLINDER_TOLERANCE * self.radius)
        return beside and coaxial and same_radius


def _holes(
    gmsh: ModuleType, faces: Sequence[tuple[int, int]], scale: float
) -> Iterator[tuple[str, list[tuple[int, int]]]]:
    """Yield (name as "hole 6 mm (1)", faces) of each hole: coaxial faces over a full turn."""
    hollow = [c for face in faces if (c := _hollow_cylinder(gmsh, face))]
    pairs = [(i, j) for j, c in enumerate(hollow) for i in range(j) if c.continues(hollow[i])]
    label = connected_pieces([np.array(pairs, dtype=np.int64).reshape(-1, 2)], len(hollow))
    holes = [[c for c, k in zip(hollow, label, strict=True) if k == hole] for hole in set(label)]

    full_turn = 2 * np.pi * (1 - CYLINDER_TOLERANCE)
    by_size: dict[str, list[list[Cylinder]]] = {}
    for hole in holes:
        if sum(cylinder.angle for cylinder in hole) > full_turn:
            size = f"hole {2e3 * scale * hole[-1].radius:.4g} mm"
            by_size.setdefault(size, []).append(hole)

    for size, group in sorted(by_size.items()):
        group.sort(key=lambda hole: tuple(np.round(hole[-1].middle, 6)))
        for number, hole in enumerate(group, 1):
            yield f"{size} ({number})", [cylinder.face for cylinder in hole]


def _hollow_cylinder(gmsh: ModuleType, face: tuple[int, int]) -> Cylinder | None:
    """The cylinder of a face that encloses empty space; None for other faces."""
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


def mesh_model(gmsh: ModuleType, request: Request, scale: float) -> None:
    """Mesh the current gmsh model, whose unit of length is `scale` metres."""
    dim = gmsh.model.getDimension()
    if dim < 1:
        raise MeshError(f"{request.name} contains no geometry (curves, surfaces or volumes).")
    of_cad = Path(request.path).suffix.lower() in CAD_ENDINGS

    # facets are flat: middle nodes off them would bend the part
    order = request.order if request.order is not None else (1 if dim == 1 or request.solid else 2)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    stated = gmsh.option.getNumber("Mesh.MeshSizeFromCurvature")
    around = max(stated, request.around if of_cad or request.around > ELEMENTS_PER_TURN else 0.0)
    request.limit_time(MESHING_TIME_LIMIT)

    fields = [_graded_size_field(gmsh, place, request, scale) for place in request.refine]
    if request.size is not None:
        _check_size(gmsh, request, dim, scale)
        gmsh.option.setNumber("Mesh.MeshSizeMax", request.size / scale)
        # at the tip of a cone elements by the curvature would have no end
        wanted = request.sizes["sizes"] if request.sizes else []
        smallest = min([request.size, *(place[1] for place in request.refine), *wanted])
        gmsh.option.setNumber("Mesh.MeshSizeMin", LEAST_CURVATURE_SIZE * smallest / scale)
    if of_cad:  # short edges of CAD would fill whole faces with small cells
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    if request.sizes is not None:
        size_field = SizeField(**request.sizes)
        request.limit_time(MESHING_TIME_LIMIT + 2e-3 * size_field.expected())
        fields.append(size_field.add_to(gmsh, scale))
        around = max(request.around, FLAT_FACES_PER_TURN if order == 1 else ELEMENTS_PER_TURN)

    if fields:
        smallest = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(smallest, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(smallest)

    # volumes by gmsh's Delaunay unless a script asks: meshes by HXT differ from run to run
    if request.around > ELEMENTS_PER_TURN:  # the second attempt
        gmsh.option.setNumber("Mesh.Algorithm", 6)
        gmsh.option.setNumber("Mesh.Algorithm3D", 1)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", around)
    gmsh.model.mesh.generate(dim)


def _check_size(gmsh: ModuleType, request: Request, dim: int, scale: float) -> None:
    """MeshError for too many cells; otherwise set a time limit for the expected number."""
    assert request.size is not None
    measure = sum(_measure(gmsh, dim, tag) for _, tag in gmsh.model.getEntities(dim))
    box = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
    along = float(np.ptp(box, axis=0).max()) * scale / request.size
    cells = REGULAR_CELL_DENSITY[dim] * measure * (scale / request.size) ** dim
    if max(cells, along) > MOST_CELLS:
        raise MeshError(
            f"{request.name} would need about {max(cells, along):.1e} cells at a size of "
            f"{request.size:g} m, more than {MOST_CELLS:.0e}: choose a larger size."
        )
    request.limit_time(MESHING_TIME_LIMIT + 2e-3 * cells)


def _measure(gmsh: ModuleType, dim: int, tag: int) -> float:
    """Length, area or volume of an OpenCASCADE entity; 0 for other entities."""
    try:
        return float(gmsh.model.occ.getMass(dim, tag))
    except Exception:  # gmsh raises nothing else
        return 0.0


def _graded_size_field(gmsh: ModuleType, place: Refinement, request: Request, scale: float) -> int:
    """Add a size field that grows from the size at `place` to `request.size`; returns its tag."""
    usual_growth, reach = request.grading
    point, local, growth = with_growth(place, usual_growth)
    x, y, z = (float(c) / scale for c in (*point, 0.0)[:3])
    outer_size = 1e22 if request.size is None else request.size / scale
    local = local / scale

    tag = gmsh.model.mesh.field.add("MathEval")
    distance = f"Sqrt((x-({x!r}))^2+(y-({y!r}))^2+(z-({z!r}))^2)"
    grown = f"{GMSH_SIZE_FACTOR * local!r}+{growth!r}*Max(0,{distance}-{reach * local!r})"
    gmsh.model.mesh.field.setString(tag, "F", f"Min({outer_size!r},{grown})")
    return int(tag)


# --- Wanted sizes ---------------------------------------------------------------------------------


#: Mean ratio of gmsh's edges to the requested size.
EDGE_SIZE_RATIO = 1.1
#: Measured ratio of gmsh's cells to regular ones with the requested edges, by dimension.
CELL_COUNT_RATIO = {2: 1.35, 3: 0.95}
#: Least number of flat faces around a full turn: with fewer, cells cut off parts of a cylinder.
FLAT_FACES_PER_TURN = 12.0
#: Gmsh's names of scalars on triangles and on tetrahedra.
SCALAR_VIEW_TYPES = {3: "ST", 4: "SS"}


@dataclass
class SizeField:
    """Element sizes [m] at the corners of simplices, as lists that JSON can hold."""

    points: list[list[float]]  # (n, 3) corners [m]
    cells: list[list[int]]  # rows in `points` of the corners of each simplex
    sizes: list[float]  # (n,) at `points`

    def expected(self) -> float:
        """Estimated number of cells of a mesh with these sizes."""
        x, cells, sizes = (np.array(a) for a in (self.points, self.cells, self.sizes))
        sides = x[cells[:, 1:]] - x[cells[:, :1]]
        dim = cells.shape[1] - 1
        measure = np.sqrt(np.abs(np.linalg.det(sides @ sides.transpose(0, 2, 1))))
        share = CELL_COUNT_RATIO[dim] * REGULAR_CELL_DENSITY[dim] / factorial(dim)
        return float(share * np.sum(measure / sizes[cells].mean(axis=1) ** dim))

    def add_to(self, gmsh: ModuleType, scale: float) -> int:
        """Add the sizes to gmsh's model, whose unit is `scale` m, as a field; returns its tag."""
        x = np.array(self.points)[np.array(self.cells)] / scale
        sizes = np.array(self.sizes)[np.array(self.cells)] / (scale * EDGE_SIZE_RATIO)
        rows = np.concatenate([x.transpose(0, 2, 1).reshape(len(x), -1), sizes], axis=1)
        view = gmsh.view.add("sizes")
        gmsh.view.addListData(view, SCALAR_VIEW_TYPES[sizes.shape[1]], len(rows), rows.ravel())
        tag = int(gmsh.model.mesh.field.add("PostView"))
        gmsh.model.mesh.field.setNumber(tag, "ViewTag", view)

        # the sizes decide everywhere, not only on the boundary
        for option in ("FromPoints", "ExtendFromBoundary"):
            gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
        return tag


SCRIPT_ENDINGS = (".geo", ".geo_unrolled")
GEOMETRY_ENDINGS = (*SCRIPT_ENDINGS, *CAD_ENDINGS)
#: First words of gmsh's mesh files; gmsh executes any other file as a script.
MESH_FILE_HEADERS = (b"$MeshFormat", b"$Comments", b"$NOD", b"$NOE", b"$PARA", b"$ELM", b"$PTS")

LABEL_OF_GMSH_TYPE = {number: label for label, (_, _, number) in CELL_TYPES.items()}


def read(request: Request) -> FileMesh:
    """Read a mesh file (`.msh`), or mesh a geometry."""
    source = Path(request.path)
    suffix = source.suffix.lower()

    # a script may take long to build the geometry
    request.limit_time((120 if suffix in SCRIPT_ENDINGS else 30) + 1e-5 * source.stat().st_size)
    if request.by_ftetwild:
        return facets.mesh_by_ftetwild(request)

    path = source if request.trust or request.solid else _checked_copy(source, suffix, request.name)
    gmsh = quiet_session()
    request.limit_output()

    try:
        return _mesh_of_file(gmsh, request, path, suffix)
    except MeshError:
        raise
    except Exception as error:
        reason = " ".join(str(error).replace(str(path), request.name).split()).rstrip(".")
        reason = re.sub(r"(\b\w+ \d+) \1\b", r"\1", reason)  # gmsh says some surfaces twice
        reason = reason[:200] or "it gives no reason"
        if request.solid or (gmsh.model.getDimension() > 0 and suffix in GEOMETRY_ENDINGS):
            raise UnmeshableError(f"gmsh cannot mesh {request.name}: {reason}.") from error
        raise MeshError(f"gmsh cannot read {request.name}: {reason}.") from error


def _checked_copy(source: Path, suffix: str, name: str) -> Path:
    """Path of the checked file's copy in the working folder; CAD files it merges are copied too."""
    copy = Path(f"mesh{suffix}")
    if suffix in SCRIPT_ENDINGS:
        text, merged = checked_script(source.read_text(encoding="latin-1"), name)
        for beside in merged:
            if not source.with_name(beside).is_file():
                raise MeshError(f"{name} merges {beside}, which is not in its folder.")
            shutil.copyfile(source.with_name(beside), beside)
        copy.write_text(text, encoding="latin-1", newline="")
        return copy

    with source.open("rb") as stream:
        beginning = stream.read(16)
    if suffix == ".msh" and not beginning.startswith(MESH_FILE_HEADERS):
        raise MeshError(
            f"{name} does not begin as a Gmsh mesh ($MeshFormat): write it as .inp, .bdf or .med."
        )
    return Path(shutil.copyfile(source, copy))


def _mesh_of_file(gmsh: ModuleType, request: Request, path: Path, suffix: str) -> FileMesh:
    """The mesh of the file at `path` in the file's unit, with names and remarks."""
    unit = 1.0 if request.solid else open_cad(gmsh, str(path))
    if suffix in CAD_ENDINGS and gmsh.model.getDimension() < 1:
        with open(path, "rb") as file:
            reason = ANALYSIS_REASON if ANALYSIS_SCHEMA in file.read(1 << 14) else NO_SHAPES_REASON
        raise MeshError(f"gmsh cannot read {request.name}: {reason}.")
    if suffix in SCRIPT_ENDINGS:  # an optimiser that Debian's gmsh does not have
        gmsh.option.setNumber("Mesh.OptimizeNetgen", 0)

    notes: list[str] = []
    names: EntityNames = {}
    if request.solid:
        surface, names = facets.add_filled_surface(gmsh, request)
        notes = surface.remarks
    elif suffix in CAD_ENDINGS:
        count = len(gmsh.model.getEntities(3))
        if request.piece is not None and not request.fragments and count > 1:
            notes = [piece_text(request.name, request.piece, count)]
        names = entity_names(gmsh, request, unit * request.unit[0])
    if request.outline:
        return _box_diagonals(gmsh, names, unit)

    if suffix != ".msh":
        mesh_model(gmsh, request, unit * request.unit[0])
    mesh = _mesh_from_gmsh(gmsh, request.name, names, numbered=suffix == ".msh")
    if request.order != 1 and suffix != ".msh":
        solids = [abs(_measure(gmsh, 3, tag)) for _, tag in gmsh.model.getEntities(3)]
        exact = surface.volume if request.solid else sum(solids) if all(solids) else 0.0
        notes += _volume_remarks(gmsh, request.name, exact)
    mesh.points *= unit
    mesh.remarks = [*notes, *mesh.remarks]
    return mesh


def _volume_remarks(gmsh: ModuleType, name: str, exact: float) -> list[str]:
    """A remark if the volume of the mesh differs from `exact`; otherwise []."""
    meshed = 0.0
    for kind in gmsh.model.mesh.getElementTypes(3):
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss3")
        det = gmsh.model.mesh.getJacobians(kind, points)[1]
        meshed += float(np.abs(det.reshape(-1, len(weights)) @ weights).sum())
    change = meshed / exact - 1 if exact else 0.0
    if abs(change) <= VOLUME_TOLERANCE:
        return []

    sense = "large" if change > 0 else "small"
    return [
        f"{name}: the mass of the mesh is {percent(abs(change))} too {sense} beside that of the "
        f"geometry, as {CORNERS_CUT_PHRASE}; a smaller size follows them."
    ]


def _box_diagonals(gmsh: ModuleType, names: EntityNames, scale: float) -> FileMesh:
    """Box diagonals of all solids, else of the model, as lines; each group contains all lines."""
    entities = solids_by_volume(gmsh) or [(-1, -1)]
    boxes = scale * np.array([gmsh.model.getBoundingBox(*entity) for entity in entities])
    lines = np.arange(2 * len(boxes)).reshape(-1, 2)

    groups = gmsh.model.getPhysicalGroups()
    group_names = [gmsh.model.getPhysicalName(dim, tag) or str(tag) for dim, tag in groups]
    group_names += naturally_sorted(chain(*names.values()))
    cells = {"line": np.arange(len(lines))}
    mesh = FileMesh(boxes.reshape(-1, 3), {"line": lines}, dict.fromkeys(group_names, cells))
    if len(entities) > 1:
        labels = [", ".join(names.get(entity, ())) for entity in entities]
        ends = zip(labels, boxes[:, :3], boxes[:, 3:], strict=True)
        mesh.pieces = [Piece(*each) for each in ends]
    return mesh


def quiet_session() -> ModuleType:
    """A gmsh session without output."""
    try:
        import gmsh
    except ImportError as error:
        raise MissingDependencyError("gmsh is not installed: see `antiosc info`.") from error
    except OSError as error:  # PyPI's gmsh comes without the libraries of the system that it needs
        raise MissingDependencyError(
            f"gmsh cannot be loaded ({error}): it needs libraries, on Debian by sudo apt install "
            "libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1 libgomp1."
        ) from error

    # gmsh 4.9 and later catch signals unless told not to
    newer = "interruptible" in inspect.signature(gmsh.initialize).parameters
    options = {"interruptible": False} if newer else {}
    gmsh.initialize(["antiosc"], readConfigFiles=False, **options)
    gmsh.option.setNumber("General.Terminal", 0)
    return gmsh


def _mesh_from_gmsh(gmsh: ModuleType, name: str, names: EntityNames, numbered: bool) -> FileMesh:
    """The mesh in gmsh's model with groups and `names`; `numbered`: with node numbers."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    by_tag = np.argsort(tags).astype(np.int64)
    sorted_tags = np.asarray(tags)[by_tag]
    points = np.asarray(coordinates, dtype=float).reshape(-1, 3)

    def indices(node_tags: IntArray, width: int) -> IntArray:
        positions = np.searchsorted(sorted_tags, node_tags)
        positions[positions == len(sorted_tags)] = 0
        if not len(sorted_tags) or not np.array_equal(sorted_tags[positions], node_tags):
            raise MeshError(f"{name} has cells on nodes that it does not hold: it is damaged.")
        return by_tag[positions].reshape(-1, width)

    blocks: dict[str, list[IntArray]] = {}
    rows: dict[tuple[int, int], dict[str, IntArray]] = {}
    count: dict[str, int] = {}
    orders: dict[str, IntArray] = {}
    for dim, tag in sorted(gmsh.model.getEntities()):
        kinds, _, nodes = gmsh.model.mesh.getElements(dim, tag)
        for kind, block in zip(kinds, nodes, strict=True):
            label = checked_kind(LABEL_OF_GMSH_TYPE.get(int(kind), f"gmsh type {kind}"), name)
            if label not in orders:
                orders[label] = _node_order(gmsh, int(kind), label)
            part = indices(block, CELL_TYPES[label][1])[:, orders[label]]
            start = count.get(label, 0)
            count[label] = start + len(part)
            blocks.setdefault(label, []).append(part)
            rows.setdefault((dim, tag), {})[label] = np.arange(start, count[label])

    cells = {label: np.vstack(parts) for label, parts in blocks.items()}
    groups = _groups(gmsh, rows, name)
    named = joined_groups(
        (label, kind, members)
        for entity, labels in names.items()
        for kind, members in rows.get(entity, {}).items()
        for label in labels
    )
    named = {label: named[label] for label in naturally_sorted(named)}

    mesh = FileMesh(points, cells, named | groups, of_gmsh=True, has_construction_aids=bool(groups))
    if numbered:
        mesh.labels = np.asarray(tags, dtype=np.int64)
    return with_supported_kinds(mesh, name)


def _node_order(gmsh: ModuleType, number: int, label: str) -> IntArray:
    """Permutation (nodes,) of the nodes of a cell kind from gmsh's order to VTK's."""
    shape, count, _ = CELL_TYPES[label]
    x = np.reshape(gmsh.model.mesh.getElementProperties(number)[4], (count, -1))
    corners = tuple(range(CORNERS[shape]))
    members = [*((k,) for k in corners), *EDGES[shape], *quadrilateral_faces(shape), corners]
    wanted = np.array([x[list(nodes)].mean(axis=0) for nodes in members[:count]])
    return np.asarray(np.linalg.norm(wanted[:, None] - x, axis=2).argmin(axis=1))


def _groups(
    gmsh: ModuleType, rows: dict[tuple[int, int], dict[str, IntArray]], name: str
) -> dict[str, dict[str, IntArray]]:
    """Physical groups: name or number -> {kind: rows of its cells}, from `rows` of each entity."""
    members: dict[tuple[int, int], list[tuple[str, IntArray]]] = {}
    for (dim, tag), blocks in rows.items():
        # the inverse query searches all entities for each group
        for group in gmsh.model.getPhysicalGroupsForEntity(dim, tag):
            members.setdefault((dim, abs(int(group))), []).extend(blocks.items())

    names: dict[tuple[str, int], list[tuple[str, IntArray]]] = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        label = gmsh.model.getPhysicalName(dim, tag) or str(tag)
        if (label, dim) in names:
            raise MeshError(f"{name} gives two groups of dimension {dim} the name {label!r}.")
        if (dim, tag) in members:
            names[label, dim] = members[dim, tag]
    return joined_groups((label, *part) for (label, _), parts in names.items() for part in parts)
