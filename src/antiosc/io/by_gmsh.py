"""Gmsh's mesh files, and geometries that gmsh meshes.

gmsh executes a file as a script if it does not begin like a mesh, and it reads options from files
in the same folder. Therefore gmsh gets a copy under a fixed name in an empty folder, after a check
of the first line of a mesh, or of every token of a script (`geo_script`). The number of cells is
estimated before a geometry is meshed. `cad` knows units, assemblies and names of CAD files,
`facets` closed surfaces of triangles.
"""

from __future__ import annotations

import inspect
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from math import log, sqrt
from pathlib import Path
from types import ModuleType

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MeshError, MissingDependencyError, UnmeshableError
from antiosc.io import cad, cad_curvature, cad_volume, facets, geo_script
from antiosc.io.cad import ATTEMPTS, Attempt, Names
from antiosc.io.geo_script import CAD
from antiosc.io.mesh_files import as_carried, known
from antiosc.io.neutral import CELLS, FileMesh, IntArray, Piece, Solid, joined
from antiosc.io.request import Request

#: What is said of a CAD file without shapes, and of a STEP file that says so of itself.
NO_SHAPES = (
    "it holds no shapes, as an assembly whose parts are files of their own; open one of these, or "
    "write the assembly with its parts in one file"
)
ANALYSIS, NO_ANALYSIS = (
    b"AP209",
    "it holds an analysis (STEP AP209), not the shape of a part; write the mesh as a deck of "
    "Nastran or Abaqus, or the shape as STEP AP203, AP214 or AP242",
)
#: Size requested from gmsh over the required one, since its edges are up to 1.9 times longer.
SHORTER = 0.5
#: More cells than this are refused: gmsh would need some 20 GB.
MOST_CELLS = 10_000_000
#: Element sizes below this share of the part are below the resolution of its coordinates.
RESOLVED_SHARE = 1e-9
#: Triangles of all faces by the short edges of their boundaries, and over those by the size, above
#: which these edges do not set the size within the faces. A plate of 480 mm with 322 small holes
#: had 213 000 triangles and 1 000 000 cells in 110 s, and 18 600 and 22 300 in 4 s without; the
#: estimate of triangles is 0.4 to 0.9 of what gmsh makes (nine CAD files by others).
MOST_CONTINUED, MOST_TIMES_CONTINUED = 20_000, 4.0
#: Number of regular simplices with edges of length 1 per unit of length, area or volume.
CELLS_PER_SIZE = (0.0, 1.0, 4 / sqrt(3), 6 * sqrt(2))


def mesh_model(gmsh: ModuleType, ask: Request, scale: float) -> None:
    """Mesh the current gmsh model, one unit of which is `scale` metres."""
    dim = gmsh.model.getDimension()
    if dim < 1:
        raise MeshError(f"{ask.name} contains no geometry (curves, surfaces or volumes).")
    refine = [([c / scale for c in point], local / scale) for point, local in ask.refine]
    ask = replace(ask, size=ask.size and ask.size / scale, refine=refine)
    _check_sizes(gmsh, ask, scale)
    # facets are flat: middle nodes off them would bend the part
    order = ask.order if ask.order is not None else (1 if dim == 1 or ask.solid else 2)
    gmsh.option.setNumber("Mesh.ElementOrder", 1)  # for `_mesh_coarsely` and `_edge_lengths`
    ask.allow(600)
    _follow_curvature(gmsh, ask.around)
    if ask.size is not None:
        expected = max(expected_cells(gmsh, ask, d, ask.size, scale) for d in range(1, dim + 1))
        gmsh.option.setNumber("Mesh.MeshSizeMax", ask.size)
        ask.allow((150 if ask.solid else 30) + 2e-3 * max(expected, 1e4))
        _keep_small_sizes_at_edges(gmsh, ask.size)
    fields = [_graded_field(gmsh, point, local, ask) for point, local in ask.refine]
    if ask.sizes is not None:
        size_field = SizeField(**ask.sizes)
        ask.allow(60 + 2e-3 * max(size_field.expected(), 1e4))
        fields.append(size_field.lay(gmsh, scale, flat=order == 1))
    if fields:
        smallest = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(smallest, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(smallest)
    # Unless a script asks for another algorithm, volumes are meshed by gmsh's Delaunay: HXT is
    # faster, but its meshes of one part differ from run to run.
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    _follow_curvature(gmsh, ask.around)  # a field of sizes has set less
    gmsh.model.mesh.generate(dim)


def _follow_curvature(gmsh: ModuleType, around: float) -> None:
    """Ask for at least so many elements around a full turn."""
    stated = gmsh.option.getNumber("Mesh.MeshSizeFromCurvature")
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", max(stated, around))


def _keep_small_sizes_at_edges(gmsh: ModuleType, size: float) -> None:
    """Let the size alone count away from the curves of CAD, if their short edges, which gmsh
    continues over whole faces, would make too many triangles.
    """
    areas: dict[int, float] = {}
    for dim, tag in gmsh.model.getEntities(2):
        area = _mass(gmsh, dim, tag)
        if area is None:  # clearing the mesh would clear triangles of the file
            return
        areas[tag] = area
    gmsh.model.mesh.generate(1)
    lengths = {tag: _edge_lengths(gmsh, tag) for _, tag in gmsh.model.getEntities(1)}
    continued = 0.0
    for tag, area in areas.items():
        around = gmsh.model.getBoundary([(2, tag)], oriented=False)
        edges = np.concatenate([[], *(lengths[curve] for _, curve in around)])
        continued += CELLS_PER_SIZE[2] * area / min(edges.mean(), size) ** 2 if edges.size else 0.0
    gmsh.model.mesh.clear()
    least = CELLS_PER_SIZE[2] * sum(areas.values()) / size**2
    if continued > max(MOST_CONTINUED, MOST_TIMES_CONTINUED * least):
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)


def _edge_lengths(gmsh: ModuleType, tag: int) -> Array:
    """Lengths of the edges of a meshed curve."""
    x = _corners(gmsh, 1, tag)
    return np.asarray(np.linalg.norm(x[:, 1] - x[:, 0], axis=1))


def _check_sizes(gmsh: ModuleType, ask: Request, scale: float) -> None:
    """MeshError for element sizes below the resolution of the part's coordinates."""
    extent = _extent(gmsh)
    for size in [ask.size, *(local for _, local in ask.refine)]:
        if size is not None and size < RESOLVED_SHARE * extent:
            raise MeshError(
                f"{ask.name} is {extent * scale:.3g} m long: elements of {size * scale:g} m are "
                f"below what its "
                f"coordinates resolve, and there would be about {extent / size:.0e} along one "
                "edge; choose a larger size."
            )


def expected_cells(gmsh: ModuleType, ask: Request, dim: int, size: float, scale: float) -> float:
    """Estimated number of cells of dimension `dim`; MeshError if it is far too large."""
    entities = gmsh.model.getEntities(dim)
    measures = [_bound]
    if dim > 1 and any(_mass(gmsh, d, tag) is None for d, tag in entities):
        measures.append(measure_of)  # which needs a mesh of the lower dimensions
    count = 0.0
    for measure in measures:
        if measure is measure_of:
            _mesh_coarsely(gmsh, dim - 1)
        count = CELLS_PER_SIZE[dim] * sum(measure(gmsh, d, tag) for d, tag in entities) / size**dim
        count += _refined(ask, dim)
        if measure is measure_of:
            gmsh.model.mesh.clear()
        if count <= MOST_CELLS:
            return count
    raise MeshError(
        f"{ask.name} would need about {count:.1e} {('', 'lines', 'faces', 'cells')[dim]} at "
        f"a size of {size * scale:g} m, more than {MOST_CELLS:.0e}: choose a larger size."
    )


def _mesh_coarsely(gmsh: ModuleType, dim: int) -> None:
    """Mesh the model with about thirty edges along it, for measurements."""
    gmsh.model.mesh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeMax", _extent(gmsh) / 30)
    gmsh.model.mesh.generate(dim)


def _extent(gmsh: ModuleType) -> float:
    """Longest edge of the box around the model, m."""
    box = np.array(gmsh.model.getBoundingBox(-1, -1))
    return float(np.max(box[3:] - box[:3]))


def _refined(ask: Request, dim: int) -> float:
    """Estimated number of additional cells at refined points: the integral of their size field."""
    outer_size = ask.size or 1.0
    growth, reach = ask.grading
    count = 0.0
    for _, local in ask.refine:
        ball = CELLS_PER_SIZE[dim] * (2 * reach / SHORTER) ** dim
        count += ball * (1 + log(1 + max(outer_size / local, 0.0)) / growth)
    return count


def _bound(gmsh: ModuleType, dim: int, tag: int) -> float:
    """Length, area or volume of an entity; in gmsh's own kernel an upper bound, that of its box."""
    mass = _mass(gmsh, dim, tag)
    if mass is not None or dim == 1:
        if mass is None:
            return _length(gmsh, tag)
        return mass
    box = np.array(gmsh.model.getBoundingBox(dim, tag))
    a, b, c = box[3:] - box[:3]
    return float(a * b * c if dim == 3 else a * b + b * c + c * a)


def _mass(gmsh: ModuleType, dim: int, tag: int) -> float | None:
    """Length, area or volume of an entity by OpenCASCADE; None if it fails."""
    try:
        return float(gmsh.model.occ.getMass(dim, tag))
    except Exception:  # not of OpenCASCADE
        return None


def _length(gmsh: ModuleType, tag: int) -> float:
    """Length of a curve."""
    low, high = gmsh.model.getParametrizationBounds(1, tag)
    t = np.linspace(float(low[0]), float(high[0]), 33)
    x = np.reshape(gmsh.model.getValue(1, tag, t), (-1, 3))
    return float(np.linalg.norm(np.diff(x, axis=0), axis=1).sum())


def measure_of(gmsh: ModuleType, dim: int, tag: int) -> float:
    """Length, area or volume of an entity; in gmsh's own kernel measured on its boundary mesh."""
    mass = _mass(gmsh, dim, tag)
    if mass is not None or dim == 1:
        if mass is None:
            return _length(gmsh, tag)
        return mass
    sides = gmsh.model.getBoundary([(dim, tag)], oriented=True)
    cells = [_corners(gmsh, dim - 1, abs(s))[:, :: -1 if s < 0 else 1] for _, s in sides]
    if not cells:
        return 0.0
    x = np.concatenate(cells)
    if dim == 2:  # of a plane one; of a curved one the plane that its boundary spans
        return float(np.linalg.norm(np.cross(x[:, 0], x[:, 1]).sum(axis=0))) / 2
    return float(abs(np.einsum("ni,ni->", x[:, 0], np.cross(x[:, 1], x[:, 2])))) / 6


def _corners(gmsh: ModuleType, dim: int, tag: int) -> Array:
    """Vertices (cells, dim + 1, 3) of the first-order simplices on a meshed entity."""
    kind, width = {1: (1, 2), 2: (2, 3)}[dim]
    _, nodes = gmsh.model.mesh.getElementsByType(kind, tag)
    tags, coordinates, _ = gmsh.model.mesh.getNodes(dim, tag, includeBoundary=True)
    tags = np.asarray(tags)
    order = np.argsort(tags)
    x = np.reshape(coordinates, (-1, 3))[order]
    return x[np.searchsorted(tags[order], nodes)].reshape(-1, width, 3)


def _graded_field(gmsh: ModuleType, point: Sequence[float], local: float, ask: Request) -> int:
    """A size field: edges of at most `local` around the point, growing to the size away from it."""
    x, y, z = (float(c) for c in (*point, 0.0)[:3])
    outer_size = 1e22 if ask.size is None else float(ask.size)
    growth, reach = (float(value) for value in ask.grading)
    local = float(local)
    tag = gmsh.model.mesh.field.add("MathEval")
    distance = f"Sqrt((x-({x!r}))^2+(y-({y!r}))^2+(z-({z!r}))^2)"
    grown = f"{SHORTER * local!r}+{growth!r}*Max(0,{distance}-{reach * local!r})"
    gmsh.model.mesh.field.setString(tag, "F", f"Min({outer_size!r},{grown})")
    return int(tag)


# --- Wanted sizes ---------------------------------------------------------------------------------


#: Mean ratio of gmsh's edges to the requested size.
EDGE_OVER_SIZE = 1.1
#: Measured ratio of gmsh's cells to regular ones with the requested edges, by dimension.
CELLS_MADE = {2: 1.35, 3: 0.95}
#: Least number of flat faces around a full turn of a curved surface; with fewer, elements cut off
#: parts of a cylinder.
AROUND_FLAT = 12
#: The same number of curved faces.
AROUND_CURVED = 6
#: Gmsh's names of scalars on triangles and on tetrahedra.
LISTS = {3: "ST", 4: "SS"}


@dataclass
class SizeField:
    """Element sizes at the corners of simplices.

    Lists, as they are sent to the reading process: points (n, 3) in m, cells (c, dim + 1), and the
    sizes of edges wanted at the points (n,) in m.
    """

    points: list[list[float]]
    cells: list[list[int]]
    sizes: list[float]

    def expected(self) -> float:
        """Estimated number of cells."""
        x, cells, sizes = (np.array(a) for a in (self.points, self.cells, self.sizes))
        sides = x[cells[:, 1:]] - x[cells[:, :1]]
        dim = cells.shape[1] - 1
        measure = np.sqrt(np.abs(np.linalg.det(sides @ sides.transpose(0, 2, 1))))
        # regular simplices of edge 1 hold √2/12 and √3/4
        share = {2: 0.5 / (3**0.5 / 4), 3: (1 / 6) / (2**0.5 / 12)}[dim]
        return float(CELLS_MADE[dim] * share * np.sum(measure / sizes[cells].mean(axis=1) ** dim))

    def lay(self, gmsh: ModuleType, scale: float, flat: bool) -> int:
        """Add the sizes to the current gmsh model as a size field; return its tag. The unit is
        `scale` m.

        `flat`: the cells have flat faces, so that curved surfaces need more of them.
        """
        x = np.array(self.points)[np.array(self.cells)] / scale
        sizes = np.array(self.sizes)[np.array(self.cells)] / (scale * EDGE_OVER_SIZE)
        rows = np.concatenate([x.transpose(0, 2, 1).reshape(len(x), -1), sizes], axis=1)
        view = gmsh.view.add("sizes")
        gmsh.view.addListData(view, LISTS[sizes.shape[1]], len(rows), rows.ravel())
        tag = int(gmsh.model.mesh.field.add("PostView"))
        gmsh.model.mesh.field.setNumber(tag, "ViewTag", view)
        # the sizes decide everywhere, not only on the boundary
        for option in ("FromPoints", "ExtendFromBoundary"):
            gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", AROUND_FLAT if flat else AROUND_CURVED)
        return tag


SCRIPTS = (".geo", ".geo_unrolled")
GEOMETRY = (*SCRIPTS, *CAD)
#: First words of gmsh's mesh files; gmsh executes any other file as a script.
HEADERS = (b"$MeshFormat", b"$Comments", b"$NOD", b"$NOE", b"$PARA", b"$ELM", b"$PTS")

GMSH_KINDS = {number: label for label, (_, _, number) in CELLS.items()}


def read(ask: Request) -> FileMesh:
    """Read a mesh file (`.msh`)."""
    source = Path(ask.path)
    ask.allow(30 + 2e-6 * source.stat().st_size)
    if not ask.trust:
        with source.open("rb") as stream:
            beginning = stream.read(16)
        if not beginning.startswith(HEADERS):
            raise MeshError(
                f"{ask.name} does not begin as a Gmsh mesh ($MeshFormat): it is one of another "
                "program (GiD, Fluent, …); write it there as .inp, .bdf, .unv or .med."
            )
        source = Path(shutil.copyfile(source, "mesh.msh"))
    return _through_gmsh(ask, source)


def generate(ask: Request) -> FileMesh:
    """Mesh a geometry."""
    source = Path(ask.path)
    suffix = source.suffix.lower()
    # a script may take long to build the geometry
    ask.allow((120 if suffix in SCRIPTS else 30) + 1e-5 * source.stat().st_size)
    if not ask.trust:
        copy = Path(f"mesh{suffix}")
        if suffix in SCRIPTS:
            script = geo_script.harmless(
                _text_of(source), ask.name, partial(_beside, source, ask.name)
            )
            for name in script.merged:
                shutil.copyfile(_merged(source, ask.name, name), name)
            copy.write_text(script.text, encoding="latin-1", newline="")
        else:
            shutil.copyfile(source, copy)
        source = copy
    return _through_gmsh(ask, source)


def _text_of(script: Path) -> str:
    """The text of a script."""
    return script.read_text(encoding="latin-1")


def _beside(script: Path, script_name: str, name: str) -> str:
    """The text of a script that another script includes."""
    return _text_of(_merged(script, script_name, name))


def _merged(script: Path, script_name: str, name: str) -> Path:
    """A file that a script merges; MeshError if it is not there."""
    merged = script.with_name(name)
    if not merged.is_file():
        raise MeshError(
            f"{script_name} merges {name}, but there is no such file in its folder: put it there."
        )
    return merged


def _through_gmsh(ask: Request, path: Path) -> FileMesh:
    """The mesh of a file that gmsh opens."""
    gmsh = session()
    gmsh.option.setNumber("General.Terminal", 1)  # `child` tells its progress
    ask.seal()
    suffix = Path(ask.path).suffix.lower()
    attempt = ATTEMPTS[ask.attempt]
    try:
        attempt.prepare(gmsh)
        unit_scale = 1.0 if ask.solid else cad.opened(gmsh, str(path), attempt.healing)
        if suffix in CAD and gmsh.model.getDimension() < 1:
            with open(path, "rb") as file:
                reason = NO_ANALYSIS if ANALYSIS in file.read(1 << 14) else NO_SHAPES
            raise MeshError(f"gmsh cannot read {ask.name}: {reason}.")
        attempt.prepare(gmsh, scripted=suffix in SCRIPTS)
        notes: list[str] = []
        names: Names = {}
        filled = None
        if ask.solid:
            filled = facets.fill(gmsh, ask, attempt)
            notes = filled.skin.remarks
        elif suffix in CAD:
            notes = cad.left_out(gmsh, ask)
            names = cad.names_of(gmsh, ask, unit_scale * ask.unit[0])
        if ask.outline:
            labels = list(filled.faces) if filled else cad.in_order(chain(*names.values()))
            return _outline(gmsh, names, labels, unit_scale)
        if suffix != ".msh":
            mesh_model(gmsh, _as_attempted(ask, attempt), unit_scale * ask.unit[0])
        mesh = _arrays(gmsh, ask.name, names, suffix == ".msh")
        if filled is not None:
            mesh.groups |= facets.named(mesh, filled)
            notes += facets.deviation(mesh, filled.volume)
            mesh.off = facets.off(mesh, filled)
        mesh.points *= unit_scale
        mesh.solids = cad_volume.scaled(mesh.solids, unit_scale)
        mesh.remarks = [*notes, *mesh.remarks]
        mesh.cad = mesh.cad and mesh.cad.scaled(unit_scale)
        return mesh
    except MeshError:
        raise
    except Exception as error:
        reason = " ".join(str(error).replace(str(path), ask.name).split()).rstrip(".")
        reason = re.sub(r"(\b\w+ \d+) \1\b", r"\1", reason)  # gmsh says some surfaces twice
        reason = reason[:200] or "it gives no reason"
        if ask.solid or (gmsh.model.getDimension() > 0 and suffix in GEOMETRY):
            raise UnmeshableError(f"gmsh cannot mesh {ask.name}: {reason}.") from error
        raise MeshError(f"gmsh cannot read {ask.name}: {reason}.") from error


def _as_attempted(ask: Request, attempt: Attempt) -> Request:
    """The request with the sizes and the order of one attempt."""
    size = ask.size and attempt.share * ask.size
    order = 1 if attempt.flat else ask.order
    return replace(ask, size=size, order=order, refine=ask.refine if attempt.refined else [])


#: Largest number of solids that get facets, 0.2 s each, so that their boxes are near to these: that
#: of a tilted torus is 0.8 % too large then, and 7 % without, as it holds its control points.
MOST_TIGHT = 40
#: Distance of these facets from the surface, over the length of the model.
NEAR_FACETS = 1e-3
#: Padding of a box over the length of the model, up to which it ends at vertices: 2.8e-5 of a plate
#: of 354 mm in a file with tolerances of 0.01 mm.
PADDED = 1e-4


def _outline(gmsh: ModuleType, names: Names, labels: list[str], scale: float) -> FileMesh:
    """A line across the bounding box of each solid, the largest first, or of the model; each group,
    of the physical ones and the labels, has all lines.
    """
    entities = cad.largest_first(gmsh) or [(-1, -1)]
    boxes = np.array([gmsh.model.getBoundingBox(*entity) for entity in entities])
    if len(entities) <= MOST_TIGHT:
        boxes = _at_vertices(gmsh, entities, _tight(gmsh, entities, boxes))
    groups = gmsh.model.getPhysicalGroups()
    group_names = [gmsh.model.getPhysicalName(dim, tag) or str(tag) for dim, tag in groups]
    group_names += labels
    lines = np.arange(2 * len(boxes)).reshape(-1, 2)
    cells = {"line": np.arange(len(lines))}
    corners = boxes.reshape(-1, 3) * scale
    mesh = FileMesh(corners, {"line": lines}, "gmsh", dict.fromkeys(group_names, cells))
    of_solids = [", ".join(names.get(entity, ())) for entity in entities]
    ends = zip(of_solids, scale * boxes[:, :3], scale * boxes[:, 3:], strict=True)
    mesh.pieces = [Piece(*ends_of_solid) for ends_of_solid in ends] if len(entities) > 1 else []
    return mesh


def _tight(gmsh: ModuleType, entities: Sequence[tuple[int, int]], boxes: Array) -> Array:
    """The boxes (n, 6) of solids within those of their facets too, which are padded by the distance
    of these: of faces in planes the former are exact, of others the latter are near.
    """
    gmsh.option.setNumber("Mesh.StlLinearDeflection", NEAR_FACETS * _extent(gmsh))
    gmsh.option.setNumber("Geometry.OCCBoundsUseStl", 1)
    for entity in entities:  # this box itself is too small
        gmsh.model.getBoundingBox(*entity)
    gmsh.option.setNumber("Geometry.OCCBoundsUseStl", 0)
    padded = np.array([gmsh.model.getBoundingBox(*entity) for entity in entities])
    low, high = np.maximum(boxes, padded)[:, :3], np.minimum(boxes, padded)[:, 3:]
    return np.hstack([low, high])


def _at_vertices(gmsh: ModuleType, entities: Sequence[tuple[int, int]], boxes: Array) -> Array:
    """The boxes (n, 6), whose ends near the outermost vertices of an entity are those of these:
    OpenCASCADE's boxes are padded by the tolerances of the file.
    """
    near = PADDED * _extent(gmsh)
    exact = boxes.copy()
    for box, (dim, tag) in zip(exact, entities, strict=True):
        solid = [(dim, tag)] if dim > 0 else gmsh.model.getEntities(gmsh.model.getDimension())
        vertices = gmsh.model.getBoundary(solid, combined=False, recursive=True)
        points = [gmsh.model.getValue(0, abs(vertex), []) for _, vertex in vertices]
        if points:
            ends = np.ravel([np.min(points, axis=0), np.max(points, axis=0)])
            box[:] = np.where(abs(ends - box) < near, ends, box)
    return exact


def session() -> ModuleType:
    """A gmsh session without output."""
    try:
        import gmsh
    except ImportError as error:
        raise MissingDependencyError(
            "gmsh is not installed: sudo apt install python3-gmsh"
        ) from error
    # gmsh 4.9 and later catch signals unless told not to
    newer = "interruptible" in inspect.signature(gmsh.initialize).parameters
    options = {"interruptible": False} if newer else {}
    gmsh.initialize(["antiosc"], readConfigFiles=False, **options)
    gmsh.option.setNumber("General.Terminal", 0)
    return gmsh


def _arrays(gmsh: ModuleType, name: str, names: Names, numbered: bool) -> FileMesh:
    """All cells and groups of the current gmsh model, entity by entity.

    `names`: entity -> names of its groups, in addition to the physical ones; `numbered`: whether
    the node numbers are those of the file.
    """
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
    for dim, tag in sorted(gmsh.model.getEntities()):
        kinds, _, nodes = gmsh.model.mesh.getElements(dim, tag)
        for kind, block in zip(kinds, nodes, strict=True):
            label = known(GMSH_KINDS.get(int(kind), f"gmsh type {kind}"), name)
            part = indices(block, CELLS[label][1])
            start = count.get(label, 0)
            count[label] = start + len(part)
            blocks.setdefault(label, []).append(part)
            rows.setdefault((dim, tag), {})[label] = np.arange(start, count[label])
    cells = {label: np.vstack(parts) for label, parts in blocks.items()}
    groups = _groups(gmsh, rows, name)
    of_solids = joined(
        (label, kind, members)
        for entity, labels in names.items()
        for kind, members in rows.get(entity, {}).items()
        for label in labels
    )
    of_solids = {label: of_solids[label] for label in cad.in_order(of_solids)}
    mesh = FileMesh(points, cells, "gmsh", of_solids | groups, aids=bool(groups))
    if numbered:
        mesh.labels = np.asarray(tags, dtype=np.int64)
    mesh.solids = _solids(gmsh, rows)
    mesh = as_carried(mesh, name)
    surfaces = [tag for _, tag in gmsh.model.getEntities(2) if _mass(gmsh, 2, tag) is not None]
    mesh.cad = cad_curvature.at_nodes(gmsh, surfaces)
    return mesh


def _solids(gmsh: ModuleType, rows: dict[tuple[int, int], dict[str, IntArray]]) -> list[Solid]:
    """The solids of CAD whose cells, `rows` by entity, are tetrahedra."""
    solids = []
    for (dim, tag), blocks in rows.items():
        volume = _mass(gmsh, dim, tag) if dim == 3 else None
        if volume is not None and len(blocks) == 1:
            members = next(iter(blocks.values()))
            solids.append((int(members[0]), int(members[-1]) + 1, abs(volume)))
    return solids


def _groups(
    gmsh: ModuleType, rows: dict[tuple[int, int], dict[str, IntArray]], name: str
) -> dict[str, dict[str, IntArray]]:
    """The physical groups of the model, by name or number, as rows of its cells."""
    members_of: dict[tuple[int, int], dict[str, list[IntArray]]] = {}
    for (dim, tag), blocks in rows.items():
        # the inverse query searches all entities for each group
        for group in gmsh.model.getPhysicalGroupsForEntity(dim, tag):
            for kind, members in blocks.items():
                members_of.setdefault((dim, abs(int(group))), {}).setdefault(kind, []).append(
                    members
                )
    groups: dict[str, dict[str, IntArray]] = {}
    dims: set[tuple[str, int]] = set()
    for dim, tag in gmsh.model.getPhysicalGroups():
        label = gmsh.model.getPhysicalName(dim, tag) or str(tag)
        parts = members_of.get((dim, tag))
        if parts is None:
            continue
        if (label, dim) in dims:
            raise MeshError(
                f"{name} gives two groups of dimension {dim} the name {label!r}: name them apart."
            )
        dims.add((label, dim))
        groups.setdefault(label, {}).update({k: np.concatenate(r) for k, r in parts.items()})
    return groups
