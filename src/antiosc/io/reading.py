"""Files with meshes and geometries into plain arrays.

`read` lets the reader of the file type (`table`) read one file in a separate process (`isolation`,
`child`), and selects the cells that form the mesh: those of one kind and of the highest dimension.
Cells of lower dimension are faces, edges and points of these, and define groups. Cells that are not
would be lost silently; they raise an error unless the caller selects the cells.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from antiosc.base import progress
from antiosc.base.errors import InputError, MeshError, PiecesError, UnmeshableError
from antiosc.base.texts import piece_is_read
from antiosc.io import cad_volume, kept_surfaces, remade
from antiosc.io.by_gmsh import AROUND_CURVED, GEOMETRY, SCRIPTS, SizeField
from antiosc.io.cad import ATTEMPTS, STATES_UNIT
from antiosc.io.facets import SURFACES, nearest_triangles
from antiosc.io.geo_script import CAD
from antiosc.io.isolation import OVERTIME_WORDS, processor_time, read_apart
from antiosc.io.neutral import (
    EDGES_OF_KIND,
    FACETS,
    KINDS,
    SERENDIPITY,
    FileMesh,
    IntArray,
    Joints,
    Model,
    Piece,
    RawMesh,
    Term,
    UnitSystem,
    connected,
    kind_of,
    of_kind,
)
from antiosc.io.request import ModelOptions, Refinement
from antiosc.io.table import deck_endings, is_deck

#: Dimension, group or groups whose cells make the mesh.
Wanted = int | str | Sequence[str] | None
Rows = dict[str, IntArray]

_NOUNS = {1: "lines", 2: "faces", 3: "volumes"}


def selected(mesh: FileMesh, wanted: Wanted, order: int | None, name: str) -> RawMesh:
    """The `wanted` cells of a file as a mesh, by default those of the highest dimension."""
    dims = {label: kind_of(label).dim for label, block in mesh.cells.items() if len(block)}
    if max(dims.values(), default=0) == 0:
        dimensions = ", ".join(sorted(dims)) or "none"
        raise MeshError(
            f"{name} contains no cells: no lines, faces or volumes (found: {dimensions})."
        )
    rows = _every_row(mesh) if wanted is None else _wanted(mesh, wanted, name)
    top = max(dims[label] for label in rows)
    grouped = _grouped(mesh, [label for label in dims if dims[label] == top])
    aids = wanted is None and mesh.aids and bool(grouped)
    if aids:  # as gmsh itself writes files
        rows = grouped
    label, cell_rows = _one_kind({k: r for k, r in rows.items() if dims[k] == top}, name)
    raw = RawMesh(mesh.points, mesh.cells[label][cell_rows], kind_of(label), mesh.convention)
    raw.remarks = mesh.remarks
    raw.model = mesh.model
    raw.cad = mesh.cad
    raw.off = mesh.off
    raw.pieces = mesh.pieces
    raw.shares = cad_volume.shares(mesh.solids, cell_rows, raw.kind)
    if len(mesh.labels):
        raw.labels = np.full(len(mesh.points), -1, dtype=np.int64)
        raw.labels[: len(mesh.labels)] = mesh.labels
    if wanted is None:
        _check_lost(mesh, raw, aids, name)
    for group, parts in mesh.groups.items():
        _add_cells(raw, group, {k: mesh.cells[k][r] for k, r in parts.items() if dims[k] <= top})
    outer = _outer_facets(raw) if mesh.node_sets else None
    for group, nodes in mesh.node_sets.items():
        if outer is not None:
            _add_nodes(raw, group, nodes, outer)
    raw.groups.update(mesh.fixed)
    if order == 1 and raw.kind.order == 2:
        raw = _straightened(raw)
    elif raw.kind.shape == "interval" and raw.kind.order == 2:
        raw = replace(raw, cells=_ends_first(raw, name))
    return compact(raw)


def _every_row(mesh: FileMesh) -> Rows:
    return {label: np.arange(len(block)) for label, block in mesh.cells.items() if len(block)}


def _wanted(mesh: FileMesh, wanted: Wanted, name: str) -> Rows:
    """The rows selected by cells=."""
    if isinstance(wanted, int):
        rows = {k: r for k, r in _every_row(mesh).items() if kind_of(k).dim == wanted}
        if not rows:
            raise InputError(
                f"{name} contains no cells of dimension {wanted}, which cells asks for."
            )
        return rows
    names = [wanted] if isinstance(wanted, str) else list(wanted or ())
    for group in names:
        kinds = mesh.groups.get(group, {})
        if not any(kind_of(k).dim for k, rows in kinds.items() if len(rows)):
            group_names = [
                n for n, parts in mesh.groups.items() if any(kind_of(k).dim for k in parts)
            ]
            names_text = ", ".join(map(repr, sorted(group_names)[:20])) or "none"
            raise InputError(f"{name} has no group of cells {group!r}; it has: {names_text}.")
    return _joined([mesh.groups[group] for group in names])


def _grouped(mesh: FileMesh, labels: Sequence[str]) -> Rows:
    """The rows of these kinds that belong to any group."""
    parts = [{k: r for k, r in g.items() if k in labels} for g in mesh.groups.values()]
    return _joined(parts)


def _joined(parts: Sequence[Rows]) -> Rows:
    labels = dict.fromkeys(label for part in parts for label, rows in part.items() if len(rows))
    return {k: np.unique(np.concatenate([p[k] for p in parts if k in p])) for k in labels}


def _one_kind(rows: Rows, name: str) -> tuple[str, IntArray]:
    rows = {label: r for label, r in rows.items() if len(r)}
    if len(rows) > 1:
        counts = ", ".join(f"{len(r)} {label}" for label, r in sorted(rows.items()))
        raise MeshError(
            f"{name} mixes cell kinds ({counts}); one kind is needed: in gmsh recombine all "
            "surfaces or none (Mesh.RecombineAll)."
        )
    return next(iter(rows.items()))


#: Share of the faces of a surface that may enclose nothing: 6 of those of MINI-y-plate-rear.stl.
CRUMBS = 0.01
LEFT_OUT = "faces of its surface enclose nothing, and are left out."


def _check_lost(mesh: FileMesh, raw: RawMesh, aids: bool, name: str) -> None:
    """MeshError for cells of lower dimension that are not faces or edges of the selected ones.

    Curves and loose faces of a CAD file are only reported: they may be sketches, axes or
    construction planes, not beams and shells. So are a few faces of a surface of triangles that
    enclose nothing.
    """
    drawing = name.lower().endswith(CAD)
    surface = name.lower().endswith(SURFACES)
    strays = []
    place = 0
    lost = []
    for label, block in mesh.cells.items():
        kind = kind_of(label)
        if not 0 < kind.dim < raw.kind.dim:
            continue
        if aids:
            block = block[_grouped(mesh, [label]).get(label, np.zeros(0, dtype=np.int64))]
        sides = FACETS if kind.dim == raw.kind.dim - 1 else EDGES_OF_KIND
        facets = np.vstack([raw.cells[:, list(s)] for s in sides[raw.kind.shape]])
        is_loose = ~_among(block[:, : kind.vertices], facets)
        if drawing and is_loose.any():
            lost.append(("curves", "surfaces")[kind.dim - 1])
        elif surface and is_loose.any() and is_loose.mean() < CRUMBS:
            raw.remarks = [*raw.remarks, f"{is_loose.sum()} of {len(block)} {LEFT_OUT}"]
        elif is_loose.any():
            strays.append(f"{is_loose.sum()} {_NOUNS[kind.dim]} ({label})")
            place = int(block[is_loose][0, 0])
    if strays:
        at = ", ".join(f"{c:.4g}" for c in mesh.points[place])
        raise MeshError(
            f"{name} holds {len(raw.cells)} {_NOUNS[raw.kind.dim]} and besides "
            f"{' and '.join(strays)} that are not sides of them, one at ({at}) m: one mesh carries "
            f"one kind of cells, so say which are meant by cells, as {raw.kind.dim} (their "
            "dimension) or the name of their group."
        )
    if lost:
        raw.remarks = [
            *raw.remarks,
            f"{name} holds {' and '.join(sorted(set(lost)))} besides its {_NOUNS[raw.kind.dim]},"
            " such as sketches, axes or construction planes: these are left out.",
        ]


def _among(rows: IntArray, others: IntArray) -> NDArray[np.bool_]:
    """Mask of the `rows` that equal a row of `others` in any order of the entries."""
    if rows.shape[1] != others.shape[1]:
        return np.zeros(len(rows), dtype=bool)
    return np.isin(keys(rows), keys(others))


def keys(rows: IntArray) -> NDArray[np.uint64]:
    """A hash of each row that does not depend on the order of its entries.

    Two different rows have the same number with a probability of 1e-19.
    """
    mixed = np.zeros(len(rows), dtype=np.uint64)
    with np.errstate(over="ignore"):
        for column in np.sort(rows, axis=1).T:
            mixed = (mixed ^ column.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(29)
            mixed *= np.uint64(0xBF58476D1CE4E5B9)
            mixed ^= mixed >> np.uint64(32)
    return mixed


def positions(rows: NDArray[Any], among: NDArray[Any]) -> IntArray:
    """Index (n,) of each row in `among`, whatever the order of its entries; -1 if absent."""
    code = keys(among)
    order = np.argsort(code)
    row_keys = keys(rows)
    position = np.minimum(np.searchsorted(code[order], row_keys), max(len(code) - 1, 0))
    if not len(code):
        return np.full(len(rows), -1)
    return np.where(code[order][position] == row_keys, order[position], -1)


def _add_cells(raw: RawMesh, group: str, blocks: Rows) -> None:
    for label, block in blocks.items():
        _add(raw, group, kind_of(label).dim, block[:, : kind_of(label).vertices])


def _add(raw: RawMesh, group: str, dim: int, entities: IntArray) -> None:
    parts = raw.groups.setdefault(group, {})
    parts[dim] = np.vstack([parts[dim], entities]) if dim in parts else entities


def _outer_facets(raw: RawMesh) -> IntArray:
    """Facets (n, vertices) of only one cell."""
    if raw.kind.dim < 2:
        return np.zeros((0, 1), dtype=np.int64)
    facets = np.vstack([raw.cells[:, list(f)] for f in FACETS[raw.kind.shape]])
    _, first, count = np.unique(keys(facets), return_index=True, return_counts=True)
    return facets[first[count == 1]]


def _add_nodes(raw: RawMesh, group: str, nodes: IntArray, outer: IntArray) -> None:
    """Add a node set as boundary facets with all vertices in it, and remaining vertices.

    A support on a node set must also fix the mid-side motions between its nodes.
    """
    in_set = np.zeros(len(raw.points), dtype=bool)
    in_set[nodes] = True
    spanned = outer[in_set[outer].all(axis=1)] if len(outer) else outer
    if len(spanned):
        _add(raw, group, raw.kind.dim - 1, spanned)
        in_set[spanned.ravel()] = False
    remaining = np.unique(nodes[in_set[nodes]])
    loose_nodes = remaining[np.isin(remaining, raw.cells[:, : raw.kind.vertices])]
    if len(loose_nodes):
        _add(raw, group, 0, loose_nodes[:, None])


def _ends_first(raw: RawMesh, name: str) -> IntArray:
    """Second-order lines with the middle node last; in Abaqus files it is second."""
    x = raw.points[raw.cells]
    deviation = np.stack(
        [np.linalg.norm(x[:, k] - (x[:, k - 2] + x[:, k - 1]) / 2, axis=1) for k in range(3)]
    )
    length = np.linalg.norm(np.ptp(x, axis=1), axis=1)
    for middle in (2, 1):
        if (deviation[middle] <= 0.25 * length).all():
            return raw.cells[:, [k for k in range(3) if k != middle] + [middle]]
    raise MeshError(
        f"the second-order lines of {name} give their nodes in no known order: the middle one is "
        "neither the second nor the third of each; write straight lines of two nodes."
    )


def _straightened(raw: RawMesh) -> RawMesh:
    """The mesh without its mid-side nodes."""
    linear = next(k for k in KINDS.values() if k.shape == raw.kind.shape and k.order == 1)
    cells = raw.cells if raw.kind.dim > 1 else _ends_first(raw, "the file")
    return replace(raw, cells=cells[:, : linear.nodes], kind=linear)


def compact(raw: RawMesh) -> RawMesh:
    """The mesh without unused nodes and empty groups."""
    if raw.kind in SERENDIPITY.values():
        raise MeshError(
            f"second-order {raw.kind.shape} cells of {raw.kind.nodes} nodes (serendipity) have no "
            "counterpart here: write the mesh with all mid-face nodes, or read it with order 1 "
            "(straight edges)."
        )
    used_nodes = np.unique(raw.cells)
    points = raw.points[used_nodes]
    if not np.isfinite(points).all():
        raise MeshError("some node coordinates of the mesh are not finite.")
    new = np.full(len(raw.points), -1, dtype=np.int64)
    new[used_nodes] = np.arange(len(used_nodes))
    groups = {
        name: {
            dim: complete
            for dim, entities in parts.items()
            if len(complete := (e := new[entities])[(e >= 0).all(axis=1)])
        }
        for name, parts in raw.groups.items()
    }
    numbers = raw.numbers[used_nodes] if len(raw.numbers) else used_nodes
    labels = raw.labels[used_nodes] if len(raw.labels) else raw.labels
    cells = new[raw.cells]
    return replace(raw, points=points, cells=cells, groups=groups, numbers=numbers, labels=labels)


def read(
    path: Path,
    size: float | None = None,
    order: int | None = None,
    refine: Sequence[Refinement] = (),
    *,
    cells: Wanted = None,
    piece: int | None = None,
    timeout: float | None = None,
    unit: UnitSystem | None = None,
    merge: float | None = None,
    sizes: SizeField | None = None,
    sound: Callable[[RawMesh], RawMesh] = lambda raw: raw,
    **options: Any,
) -> RawMesh:
    """Read or mesh the file `path`; see `antiosc.read_mesh`.

    `sizes`: element sizes in the whole geometry; `sound`: checks the mesh, and may raise;
    `options`: other fields of a `Request`.
    """
    is_cad = path.suffix.lower() in CAD
    one_solid = (is_cad or options.get("solid")) and not options.get("fragments")
    options |= {
        "piece": piece if one_solid else None,
        "size": None if size is None else float(size),
        "order": order,
        "refine": [([float(c) for c in point], float(local)) for point, local in refine],
        "sizes": None if sizes is None else vars(sizes),
    }

    def read_once(file: Path, asked_for: Mapping[str, Any]) -> RawMesh:
        content = _content(file, timeout, unit, merge, **asked_for)
        raw = selected(content, cells, order, path.name)
        if piece is not None and not (one_solid and raw.kind.dim == 3):
            raw = one_piece(raw, piece, path.name)
        elif piece is not None and file != path:  # a surface made anew may enclose several
            raw = one_piece(raw, 1, path.name)
        in_cad = float(raw.shares.sum())
        raw.shares = raw.shares[:0]
        try:
            raw = sound(raw)
        except UnmeshableError as error:
            if merge is None:
                raise
            raise MeshError(  # of the joined nodes, which no other attempt avoids
                f"{str(error).rstrip('.')}; its nodes are joined up to {merge:g} m: take a smaller "
                "merge, or piece 1, the largest piece alone."
            ) from None
        if in_cad > 0:
            raw.volumes = cad_volume.of_mesh(raw.points, raw.cells), in_cad
        return raw

    def read_attempt(
        attempt: int, most: float | None = None, file: Path = path, told: str = "", **other: Any
    ) -> RawMesh:
        asked_for = {**options, **other, "attempt": attempt, "most": most, "told": told}
        plain = partial(read_once, file, asked_for)
        if ATTEMPTS[attempt].curved:
            return plain()

        def following(around: float) -> RawMesh:
            limit = min(most or cad_volume.MOST_TIME, cad_volume.MOST_TIME)
            return read_once(file, {**asked_for, "around": around, "most": limit})

        key = (*Asked(path, piece=options["piece"]).state, attempt, options["size"])
        least = 0.0 if sizes is None else AROUND_CURVED
        return cad_volume.followed(plain, following, key, path.name, least)

    geometry = path.suffix.lower() in GEOMETRY
    if not (geometry or options.get("solid")):
        return read_attempt(0)
    unit_length = (unit or UnitSystem()).length
    together = bool(options.get("fragments"))
    asked = Asked(path, options["size"], options["piece"], timeout, unit_length, together)
    if geometry and not is_cad:
        return _meshed(read_attempt, asked)
    return _filled(read_attempt, asked)


#: Endings of files that are proposed instead of one that cannot be meshed.
READ_INSTEAD = (*SURFACES, ".step", ".stp", ".msh", ".inp")


class Asked(NamedTuple):
    """A geometry that is to be meshed, with the options that count for that."""

    path: Path
    size: float | None = None
    piece: int | None = None
    timeout: float | None = None
    #: metres per unit of the file
    unit: float = 1.0
    #: whether the solids of a CAD file are joined
    together: bool = False
    #: whether it is the surface of a CAD file that is made anew
    anew: bool = False

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.path.name

    @property
    def is_cad(self) -> bool:
        """Whether the geometry has curvatures; that of triangles has none."""
        return not self.anew and self.path.suffix.lower() not in SURFACES

    @property
    def state(self) -> tuple[Path, int, int | None, bool]:
        """What of it and its file the way to mesh it depends on, besides the sizes."""
        time = 0
        with contextlib.suppress(OSError, ValueError):  # what is no file is told by its reader
            time = self.path.stat().st_mtime_ns
        return self.path.absolute(), time, 0 if self.together else self.piece, self.anew

    def remedies(self) -> str:
        """What can be done if it cannot be meshed."""
        size = "another size"
        if self.size is not None:
            size = f"another size than {self.size:g} m (--size of `antiosc new` and `antiosc open`)"
        beside = [self.path.with_suffix(end) for end in READ_INSTEAD]
        others = [file.name for file in beside if file != self.path and file.is_file()]
        instead = f"read {others[0]} instead, which is beside it, " if others else ""
        return (
            f"{instead}repair {self.name} in the program that wrote it, give it {size}, or mesh it"
            " there and give the mesh."
        )


#: The last surface that was made anew, by its file, the time of that and the piece, with the
#: reason: a part is read several times for one scene, each time with finer elements at the site.
_anew: dict[tuple[Path, int, int | None, bool], tuple[FileMesh, str]] = {}


def _filled(once: Callable[..., RawMesh], asked: Asked) -> RawMesh:
    """The mesh of a solid; if gmsh cannot fill its surface as it is, of that made anew."""
    state = asked.state
    key = kept_surfaces.key_of(asked.path, asked.size, 0 if asked.together else asked.piece)
    if state not in _anew:
        kept = kept_surfaces.load(key)
        if kept is None:
            try:
                return _meshed(once, asked)
            except UnmeshableError as error:
                kept = _made_anew(asked, error)
        _anew.clear()
        _anew[state] = kept
    surface, reason = _anew[state]
    with remade.as_file(surface, asked.path.stem) as file:
        again = partial(once, file=file, solid=True, piece=None, fragments=False)
        try:
            raw = _meshed(again, asked._replace(anew=True))
        except MeshError as error:
            _anew.clear()
            told = str(error).replace(file.name, asked.name)
            sentence = f"{reason}; nor can its surface be filled that was made anew: {told}"
            if isinstance(error, PiecesError):
                in_pieces = PiecesError(sentence)
                in_pieces.pieces = error.pieces
                raise in_pieces from error
            raise UnmeshableError(sentence) from error
    kept_surfaces.save(key, surface, reason)
    own = [remark.replace(file.name, asked.name) for remark in raw.remarks]
    raw.remarks = [f"gmsh cannot mesh {asked.name} as it is; {surface.remarks[-1]}", *own]
    raw.groups = _named(raw, surface, asked.unit)
    return raw


def _made_anew(asked: Asked, error: UnmeshableError) -> tuple[FileMesh, str]:
    """The surface of a file that gmsh cannot mesh, made anew, and the reason; else the error."""
    if not remade.installed():
        raise UnmeshableError(f"{str(error).rstrip('.')}; {remade.MISSING}.") from error
    options = {"remade": True, "piece": asked.piece, "fragments": asked.together}
    try:
        with progress.doing(f"making the surface of {asked.name} anew, which takes minutes"):
            surface = read_apart(
                asked.path, geometry=asked.is_cad, options=options, timeout=asked.timeout
            )
    except MeshError as second:
        if not asked.is_cad:
            raise
        raise UnmeshableError(
            f"{str(error).rstrip('.')}. Nor can its surface be made anew by fTetWild, in"
            f" {remade.TIME:g} s of processor time at most: {second}"
        ) from error
    return surface, str(error).partition("; nor ")[0].rstrip(".")


def _named(raw: RawMesh, surface: FileMesh, factor: float) -> dict[str, dict[int, IntArray]]:
    """The faces of a file as groups of the outer facets of a mesh.

    `surface`: that of the file made anew; `factor`: metres per unit of it.
    """
    facets = _outer_facets(raw)
    skin, faces = remade.of_file(surface, factor)
    nearest = nearest_triangles(skin, raw.points[facets])
    groups = {}
    for name, rows in faces.items():
        of_group = np.isin(nearest, rows)
        if of_group.any():
            groups[name] = {raw.kind.dim - 1: facets[of_group]}
    return groups


#: No further attempt to mesh a geometry begins after this processor time [s] of all before it: of
#: 27 CAD files by others the first attempt meshes all, in 7 s at most, and a second one of surf114
#: (pythonocc-demos) does not end in 30 s.
ATTEMPTS_TIME = 30.0
#: Words of gmsh's error on a surface of triangles whose sides it cannot unroll: attempts that need
#: not come next, and are made after this time too.
PARAMETRIZATION = "parametrization"
#: Words of gmsh's error on triangles that pierce each other.
PIERCED = "overlapping facets"
#: Share of its volume or size by which the mesh of a filled surface may be off it: a plate with
#: drilled holes lost 0.4 % of its volume to chords across these, and none with all edges kept.
MOST_OFF = 2e-3
#: Processor time [s] of an attempt after one whose mesh is off by more, or that did not end, or
#: after which the surface could be made anew.
NEARER_TIME = 40.0


#: Words of what is told of a mesh that another attempt made in the shape of the file; of one of a
#: surface that was made anew that is told alone.
MESHED_OTHERWISE = "is meshed in the shape of the file, by another attempt than the first,"
#: Of tetrahedra without volume, without which the part is the same.
NOT_READ = "flat cells that gmsh left at the surface are not read"
#: Words of remarks on how a mesh was made that has the shape of its file.
HOW_MADE = (MESHED_OTHERWISE, remade.ANEW, NOT_READ)


#: Attempts after the first that succeeded, by the state of the file, and what is told of them: the
#: next reading of that file, with other elements, begins with it.
_worked: dict[tuple[Path, int, int | None, bool], tuple[int, str]] = {}


def _meshed(once: Callable[..., RawMesh], asked: Asked) -> RawMesh:
    """The mesh of the first successful attempt; the first error if none succeeds in time.

    If all that succeed are off the surface of the file, the nearest one.
    """
    name, is_cad = asked.name, asked.is_cad
    if asked.state in _worked:
        number, sentence = _worked[asked.state]
        with contextlib.suppress(UnmeshableError):
            raw = once(number)
            if raw.off <= MOST_OFF:
                raw.remarks = [*raw.remarks, *filter(None, [sentence])]
                return raw
    limit: tuple[float, ...] = ()
    reason: UnmeshableError | None = None
    nearest: RawMesh | None = None
    to_try = [(k, attempt) for k, attempt in enumerate(ATTEMPTS) if attempt.suits(is_cad)]
    tried: list[str] = []
    start_time = processor_time()
    while to_try:
        if processor_time() - start_time > ATTEMPTS_TIME:
            late = nearest is None and not is_cad
            to_try = [entry for entry in to_try if late and entry[1].unparametrised]
            if not to_try:
                break
        number, attempt = to_try.pop(0)
        tried.append(attempt.about)
        try:
            with progress.doing(f"meshing {name} {attempt.about}"):
                raw = once(number, *limit, told=_tried_text(tried, len(to_try)))
        except UnmeshableError as error:
            limit = (NEARER_TIME,) if remade.installed() else limit
            if OVERTIME_WORDS in str(error) and is_cad:
                to_try = [entry for entry in to_try if entry[1].other_triangles]
                start_time, limit = processor_time(), (NEARER_TIME,)
            if PIERCED in str(error) and PARAMETRIZATION in str(reason):  # no other way is left
                to_try = [entry for entry in to_try if entry[1].unparametrised]
            reason = reason if reason and attempt.cut else error  # of the facets: of the file
            if PARAMETRIZATION in str(error):
                to_try.sort(key=lambda entry: not entry[1].unparametrised)
            continue
        first_remarks = raw.remarks
        if reason is not None:
            sentence = str(reason).rstrip(".")
            told = f"{sentence}; it is meshed {attempt.about}."
            if raw.off <= MOST_OFF:  # gmsh's error asks for nothing then
                told = f"{name} {MESHED_OTHERWISE} {attempt.about}." * (not asked.anew)
            raw.remarks = [*first_remarks, *filter(None, [told])]
            if raw.off <= MOST_OFF and asked.path.exists():
                _worked[asked.state] = number, told
        if raw.off <= MOST_OFF:
            return raw
        reason = reason or UnmeshableError(f"gmsh's mesh of {name} is {_off(raw)}")
        limit = (NEARER_TIME,)
        if nearest is None or raw.off < nearest.off:
            nearest = raw
    if nearest is not None:
        sentence = f"{name}: no mesh is nearer to its surface than this, {_off(nearest)}."
        nearest.remarks = [*nearest.remarks, sentence]
        return nearest
    words = str(reason)
    pierced = PIERCED in words
    fault = "its triangles pierce each other: " if pierced else ""
    others = f"; nor {', '.join(tried[1:])}" if tried[1:] else ""
    raise UnmeshableError(f"{words.rstrip('.')}{others}: {fault}{asked.remedies()}")


def _tried_text(tried: Sequence[str], left: int) -> str:
    """Which try to mesh a geometry it is, and of how many; "" of the first, which mostly works."""
    return f"try {len(tried)} of {len(tried) + left}, " if len(tried) > 1 else ""


def _off(raw: RawMesh) -> str:
    """By how much a mesh is off the surface of its file, in words."""
    return f"{100 * raw.off:.2g} % of its volume or size off the surface of the file"


# --- Pieces ---------------------------------------------------------------------------------------


def piece_of_cells(raw: RawMesh) -> IntArray:
    """Number of the connected piece of each cell (cells,), 0 for the largest.

    Piece 0 has the most cells; among pieces with equally many, it has the widest box.
    """
    label = connected([raw.cells], len(raw.points))[raw.cells[:, 0]]
    _, piece_index, count = np.unique(label, return_inverse=True, return_counts=True)
    if len(count) == 1:
        return piece_index.ravel()
    low = np.full((len(count), raw.points.shape[1]), np.inf)
    high = -low
    nodes = raw.points[raw.cells]
    np.minimum.at(low, piece_index.ravel(), nodes.min(axis=1))
    np.maximum.at(high, piece_index.ravel(), nodes.max(axis=1))
    widths = np.linalg.norm(high - low, axis=1)
    rank = np.empty(len(count), dtype=np.int64)
    rank[np.lexsort((-widths, -count))] = np.arange(len(count))
    return rank[piece_index.ravel()]


def one_piece(raw: RawMesh, piece: int, name: str) -> RawMesh:
    """The cells of one connected piece, 1 being the largest."""
    label = piece_of_cells(raw)
    count = int(label.max()) + 1
    if piece > count:
        raise MeshError(f"{name} has {count} pieces that share no node; there is no piece {piece}.")
    of_piece = label == piece - 1
    shares = raw.shares[of_piece] if len(raw.shares) else raw.shares
    raw = compact(replace(raw, cells=raw.cells[of_piece], shares=shares))
    raw.groups = {name: parts for name, parts in raw.groups.items() if parts}
    if count > 1:
        raw.remarks = [*raw.remarks, piece_is_read(name, piece, count)]
    return raw


#: Largest coordinate of a part: squares and volumes of it are numbers still.
FARTHEST = 1e30
#: Groups of elements by their numbers in the file.
NumberedElements = Mapping[str, Sequence[int]]


def pieces_of(raw: RawMesh) -> list[Piece]:
    """The pieces, the largest first."""
    label = piece_of_cells(raw)
    names = _piece_names(raw, label)
    order = np.argsort(label, kind="stable")
    parts = np.split(raw.cells[order], np.cumsum(np.bincount(label))[:-1])
    boxes = (
        (raw.points[cells].min(axis=(0, 1)), raw.points[cells].max(axis=(0, 1))) for cells in parts
    )
    return [Piece(names.get(k, ""), *box) for k, box in enumerate(boxes)]


def described_pieces(pieces: Sequence[Piece], most: int = 6) -> str:
    """Pieces in words: rank, name and size."""
    words = []
    for k, piece in enumerate(pieces[:most], 1):
        size = " × ".join(f"{1e3 * c:.3g}" for c in piece.high - piece.low)
        words.append(f"{k}{f' {piece.name!r}' if piece.name else ''}: {size} mm")
    return "; ".join(words) + "; …" * (len(pieces) > most)


def pieces_error(raw: RawMesh, what: str, remedy: str) -> PiecesError:
    """The error for a mesh of several connected pieces, with their description."""
    pieces = pieces_of(raw)
    error = PiecesError(f"{what} ({described_pieces(pieces)}): {remedy}")
    error.pieces = pieces
    return error


def _piece_names(raw: RawMesh, label: IntArray) -> dict[int, str]:
    """Names of groups that contain the first cell of each piece, by piece."""
    first = np.unique(label, return_index=True)[1]
    cell_keys = keys(raw.cells[first][:, : raw.kind.vertices])
    names: dict[int, str] = {}
    for name, parts in raw.groups.items():
        if raw.kind.dim in parts:
            cells_inside = np.flatnonzero(np.isin(cell_keys, keys(parts[raw.kind.dim])))
            if len(cells_inside) == 1:  # others are of several pieces
                names.setdefault(int(cells_inside[0]), name)
    return names


# --- Contents -------------------------------------------------------------------------------------


def outline(
    path: Path, unit: UnitSystem | None = None, timeout: float | None = None, **options: Any
) -> FileMesh:
    """The box and the groups of a geometry without meshing it: a line between the box's corners
    [m].

    `options`: "solid", "fragments" and "piece" of a `Request`.
    """
    return _content(path, timeout, unit, None, outline=True, **options)


def read_parts(
    path: Path,
    *,
    timeout: float | None,
    unit: UnitSystem,
    merge: float | None,
    model: ModelOptions,
    elements: NumberedElements,
) -> dict[str, RawMesh]:
    """Cells of a deck by shape, with its model; one entry unless the model joins several shapes."""
    content = _content(path, timeout, unit, merge, model=model, elements=elements)
    contents = [content]
    if content.model is not None and content.model["joined"]:
        labels = sorted(content.cells, key=lambda label: -kind_of(label).dim)
        contents = [_alone(content, label) for label in labels]
    meshes = [selected(raw, None, None, path.name) for raw in contents]
    return {raw.kind.shape: raw for raw in meshes}


def _alone(content: FileMesh, label: str) -> FileMesh:
    """The content of a file with the cells of one kind only, their groups and the supports on
    them.
    """
    mark = of_kind("", label)
    groups = {n: {label: parts[label]} for n, parts in content.groups.items() if label in parts}
    fixed = {n.removesuffix(mark): e for n, e in content.fixed.items() if n.endswith(mark)}
    return replace(content, cells={label: content.cells[label]}, groups=groups, fixed=fixed)


def _content(
    path: Path,
    timeout: float | None,
    unit: UnitSystem | None,
    merge: float | None,
    **options: Any,
) -> FileMesh:
    """The content of a file; `options` are fields of a `Request`."""
    suffix = path.suffix.lower()
    solid = options.get("solid", False)
    size = options.get("size")
    geometry = suffix in GEOMETRY or solid
    if solid and suffix not in SURFACES:
        raise MeshError(
            f"solid fills the closed surface of a file of triangles ({', '.join(SURFACES)}); "
            f"got {path.name}."
        )
    if options.get("fragments") and suffix not in CAD:
        raise MeshError(
            f"fragments joins the solids of CAD files ({', '.join(CAD)}); got {path.name}."
        )
    if geometry and size is None and suffix not in SCRIPTS and not options.get("outline"):
        raise MeshError(
            f"{path.name} is a geometry, not a mesh: give the element size in metres, as 5e-3."
        )
    if unit is not None and suffix in STATES_UNIT:
        raise MeshError(f"{path.name} states its own unit of length: leave unit out.")
    if merge is not None and geometry and suffix not in CAD:
        raise MeshError(f"{path.name} is a geometry: merge applies to finished meshes and decks.")
    unit = unit or UnitSystem()
    if options.get("model") is not None and not is_deck(path):
        raise MeshError(
            f"{path.name} is not a deck: read_model takes {', '.join(deck_endings())}; for a mesh "
            "use read_mesh and Structure."
        )
    options["unit"] = [unit.length, unit.force]
    timeout = None if timeout is None else float(timeout)  # for JSON, as the size
    content = read_apart(path, geometry=geometry, options=options, timeout=timeout)
    for group in options.get("elements") or {}:
        if group not in content.groups:
            raise MeshError(
                f"the elements of {path.name} have no numbers here, so that elements names none "
                f"for {group!r}; decks, universal files and Exodus files have them."
            )
    farthest = float(np.abs(content.points).max(initial=0.0))
    if not farthest < FARTHEST:
        raise MeshError(
            f"{path.name} has coordinates up to {farthest:.3g}, more than {FARTHEST:g}: it is "
            "damaged; write it anew in the program that made it."
        )
    content.points = content.points * unit.length
    content.solids = cad_volume.scaled(content.solids, unit.length)
    content.pieces = [piece.scaled(unit.length) for piece in content.pieces]
    content.cad = content.cad and content.cad.scaled(unit.length)
    if merge is None:
        return content
    return merged(content, merge)


# --- Coincident nodes -----------------------------------------------------------------------------


def merged(mesh: FileMesh, distance: float) -> FileMesh:
    """The mesh with nodes merged that are at most `distance` [m] apart.

    Decks of several parts and STL files need it.
    """
    n = len(mesh.points)
    pairs = cKDTree(mesh.points).query_pairs(distance, output_type="ndarray")
    if mesh.model and mesh.model["apart"]:  # the released ends of beams
        pairs = pairs[~np.isin(pairs, mesh.model["apart"]).any(axis=1)]
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    remaining = np.sort(first)  # in the file's order
    new = np.empty(len(first), dtype=np.int64)
    new[label[remaining]] = np.arange(len(remaining))
    row = new[label]
    return replace(
        mesh,
        model=mesh.model and _renumbered(mesh.model, row),
        points=mesh.points[remaining],
        labels=mesh.labels[remaining[remaining < len(mesh.labels)]],
        cells={kind: row[block] for kind, block in mesh.cells.items()},
        node_sets={name: np.unique(row[nodes]) for name, nodes in mesh.node_sets.items()},
        fixed={n: {d: row[e] for d, e in parts.items()} for n, parts in mesh.fixed.items()},
    )


def _renumbered(model: Model, row: IntArray) -> Model:
    """The model with new node numbers; negative ones are points that belong to no element."""
    joints = model["joints"]

    def new(terms: list[Term]) -> list[Term]:
        return [(int(row[n]) if n >= 0 else n, motion, c) for n, motion, c in terms]

    renumbered: Joints = {
        "equations": [new(terms) for terms in joints["equations"]],
        "springs": [(new(terms), value) for terms, value in joints["springs"]],
        "dampers": [(new(terms), value) for terms, value in joints["dampers"]],
        "masses": [([*map(new, rows)], M, mass) for rows, M, mass in joints["masses"]],
        "points": joints["points"],
        "among": [
            (int(row[n]), [(int(row[m]), w) for m, w in weighted_nodes])
            for n, weighted_nodes in joints.get("among", [])
        ],
    }
    return {**model, "joints": renumbered}
