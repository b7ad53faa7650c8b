"""Files with meshes and geometries into plain arrays.

`read` lets the reader of the file type (`table`) read one file in a separate process (`isolation`,
`child`), and selects the cells that form the mesh (`selection`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from antiosc.base.errors import MeshError
from antiosc.io.by_gmsh import GEOMETRY, SCRIPTS
from antiosc.io.isolation import read_apart
from antiosc.io.meshing import CAD, STATES_UNIT, SizeField
from antiosc.io.neutral import FileMesh, IntArray, Joints, Model, RawMesh, Term, kind_of, of_kind
from antiosc.io.request import ModelOptions, Refinement
from antiosc.io.selection import Wanted, selected
from antiosc.io.table import deck_endings, is_deck
from antiosc.io.unit_system import UnitSystem


def read(
    path: Path,
    size: float | None = None,
    order: int | None = None,
    refine: Sequence[Refinement] = (),
    *,
    cells: Wanted = None,
    timeout: float | None = None,
    unit: UnitSystem | None = None,
    merge: float | None = None,
    sizes: SizeField | None = None,
    **options: Any,
) -> RawMesh:
    """Read or mesh the file `path`; see `antiosc.read_mesh`.

    `sizes`: element sizes all over a geometry; `options`: others of a `Request`.
    """
    options |= {
        "size": None if size is None else float(size),
        "order": order,
        "refine": [([float(c) for c in point], float(local)) for point, local in refine],
        "sizes": None if sizes is None else vars(sizes),
    }
    return selected(_content(path, timeout, unit, merge, **options), cells, order, path.name)


def outline(path: Path, unit: UnitSystem | None = None) -> FileMesh:
    """A geometry, not meshed: a line between the corners of its box [m], and its groups."""
    return _content(path, None, unit, None, outline=True)


def read_parts(
    path: Path, *, timeout: float | None, unit: UnitSystem, merge: float | None, model: ModelOptions
) -> dict[str, RawMesh]:
    """Cells of a deck by their shape, with its model: one entry unless they are joined at nodes."""
    content = _content(path, timeout, unit, merge, model=model)
    contents = [content]
    if content.model is not None and content.model["joined"]:
        labels = sorted(content.cells, key=lambda label: -kind_of(label).dim)
        contents = [_alone(content, label) for label in labels]
    found = [selected(one, None, None, path.name) for one in contents]
    return {raw.kind.shape: raw for raw in found}


def _alone(content: FileMesh, label: str) -> FileMesh:
    """The cells of one kind, with their groups and what supports fix of them."""
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
    """All that the file holds; `options` are fields of a `Request`."""
    suffix = path.suffix.lower()
    solid, size = options.get("solid", False), options.get("size")
    geometry = suffix in GEOMETRY or solid
    if solid and suffix != ".stl":
        raise MeshError(f"solid=True fills the closed surface of an .stl file; got {path.name}.")
    if options.get("fragments") and suffix not in CAD:
        raise MeshError(
            f"fragments=True joins the solids of CAD files ({', '.join(CAD)}); got {path.name}."
        )
    if geometry and size is None and suffix not in SCRIPTS and not options.get("outline"):
        raise MeshError(
            f"{path.name} is a geometry, not a mesh: give the element size in metres, "
            "as in read_mesh(path, size=5e-3)."
        )
    if not geometry and (size is not None or options.get("refine")):
        raise MeshError(
            f"{path.name} is a finished mesh: size= and refine= apply to geometry files only "
            f"({', '.join(GEOMETRY)})."
        )
    if unit is not None and suffix in STATES_UNIT:
        raise MeshError(f"{path.name} states its own unit of length: leave unit= out.")
    if merge is not None and geometry and suffix not in CAD:
        raise MeshError(f"{path.name} is a geometry: merge= applies to finished meshes and decks.")
    unit = unit or UnitSystem()
    if options.get("model") is not None and not is_deck(path):
        raise MeshError(
            f"{path.name} is not a deck: read_model takes {', '.join(deck_endings())}; for a mesh "
            "use read_mesh and Structure."
        )
    options["unit"] = [unit.length, unit.force]
    timeout = None if timeout is None else float(timeout)  # for JSON, as the size
    content = read_apart(path, geometry=geometry, options=options, timeout=timeout)
    content.points = content.points * unit.length
    return content if merge is None else merged(content, merge)


# --- Coincident nodes -----------------------------------------------------------------------------


def merged(mesh: FileMesh, distance: float) -> FileMesh:
    """`mesh` with its nodes merged that are at most `distance` (m) apart.

    Decks of several parts and STL files need it.
    """
    n = len(mesh.points)
    pairs = cKDTree(mesh.points).query_pairs(distance, output_type="ndarray")
    if mesh.model and mesh.model["apart"]:  # the released ends of beams
        pairs = pairs[~np.isin(pairs, mesh.model["apart"]).any(axis=1)]
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    kept = np.sort(first)  # in the file's order
    new = np.empty(len(first), dtype=np.int64)
    new[label[kept]] = np.arange(len(kept))
    row = new[label]
    return replace(
        mesh,
        model=mesh.model and _renumbered(mesh.model, row),
        points=mesh.points[kept],
        cells={kind: row[block] for kind, block in mesh.cells.items()},
        node_sets={name: np.unique(row[nodes]) for name, nodes in mesh.node_sets.items()},
        fixed={n: {d: row[e] for d, e in parts.items()} for n, parts in mesh.fixed.items()},
    )


def _renumbered(model: Model, row: IntArray) -> Model:
    """The model with other numbers of its nodes; negative ones are points of no element."""
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
            (int(row[n]), [(int(row[m]), w) for m, w in others])
            for n, others in joints.get("among", [])
        ],
    }
    return {**model, "joints": renumbered}
