"""Files with meshes and geometries into plain arrays.

`read` lets the reader of the file type (`table`) read one file in a separate process (`isolation`,
`child`), and selects the cells that form the mesh (`selection`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from antiosc.base.errors import MeshError
from antiosc.io.by_gmsh import GEOMETRY, SCRIPTS
from antiosc.io.cad import CAD, STATES_UNIT
from antiosc.io.isolation import read_apart
from antiosc.io.merging import merged
from antiosc.io.neutral import FileMesh, RawMesh, kind_of, of_kind
from antiosc.io.request import GRADING, ModelOptions, Refinement
from antiosc.io.selection import Wanted, selected
from antiosc.io.size_field import SizeField
from antiosc.io.table import deck_endings, is_deck
from antiosc.io.unit_system import UnitSystem


def read(
    path: Path,
    size: float | None = None,
    order: int | None = None,
    refine: Sequence[Refinement] = (),
    *,
    cells: Wanted = None,
    trust: bool = False,
    timeout: float | None = None,
    unit: UnitSystem | None = None,
    merge: float | None = None,
    solid: bool = False,
    fragments: bool = False,
    sizes: SizeField | None = None,
    grading: Sequence[float] = GRADING,
) -> RawMesh:
    """Read or mesh the file `path`; see `antiosc.read_mesh`.

    `sizes`: element sizes all over a geometry; `grading`: of those around the points of `refine`.
    """
    cad: dict[str, Any] = {"solid": solid, "fragments": fragments}
    cad |= {"sizes": sizes, "grading": grading}
    content = _content(path, size, order, refine, trust, timeout, unit, merge, None, **cad)
    return selected(content, cells, order, path.name)


def outline(path: Path, unit: UnitSystem | None = None) -> FileMesh:
    """A geometry, not meshed: a line between the corners of its box [m], and its groups."""
    return _content(path, None, None, (), False, None, unit, None, None, outline=True)


def read_parts(
    path: Path,
    *,
    timeout: float | None,
    unit: UnitSystem,
    merge: float | None,
    model: ModelOptions,
) -> dict[str, RawMesh]:
    """Cells of a deck by their shape, with its model: one entry unless they are joined at nodes."""
    content = _content(path, None, None, (), False, timeout, unit, merge, model)
    if content.model is None or not content.model["joined"]:
        found = [selected(content, None, None, path.name)]
    else:
        labels = sorted(content.cells, key=lambda label: -kind_of(label).dim)
        found = [selected(_alone(content, label), None, None, path.name) for label in labels]
    return {raw.kind.shape: raw for raw in found}


def _alone(content: FileMesh, label: str) -> FileMesh:
    """The cells of one kind, with their groups and what supports fix of them."""
    mark = of_kind("", label)
    return replace(
        content,
        cells={label: content.cells[label]},
        groups={
            name: {label: parts[label]} for name, parts in content.groups.items() if label in parts
        },
        fixed={
            name.removesuffix(mark): entities
            for name, entities in content.fixed.items()
            if name.endswith(mark)
        },
    )


def _content(
    path: Path,
    size: float | None,
    order: int | None,
    refine: Sequence[Refinement],
    trust: bool,
    timeout: float | None,
    unit: UnitSystem | None,
    merge: float | None,
    model: ModelOptions | None,
    solid: bool = False,
    fragments: bool = False,
    sizes: SizeField | None = None,
    grading: Sequence[float] = GRADING,
    outline: bool = False,
) -> FileMesh:
    """All that the file holds; `model`: materials, sections, supports and joints of a deck too."""
    suffix = path.suffix.lower()
    geometry = suffix in GEOMETRY or solid
    if solid and suffix != ".stl":
        raise MeshError(f"solid=True fills the closed surface of an .stl file; got {path.name}.")
    if fragments and suffix not in CAD:
        raise MeshError(
            f"fragments=True joins the solids of CAD files ({', '.join(CAD)}); got {path.name}."
        )
    if geometry and size is None and suffix not in SCRIPTS and not outline:
        raise MeshError(
            f"{path.name} is a geometry, not a mesh: give the element size in metres, "
            "as in read_mesh(path, size=5e-3)."
        )
    if not geometry and (size is not None or refine):
        raise MeshError(
            f"{path.name} is a finished mesh: size= and refine= apply to geometry files only "
            f"({', '.join(GEOMETRY)})."
        )
    if unit is not None and suffix in STATES_UNIT:
        raise MeshError(f"{path.name} states its own unit of length: leave unit= out.")
    if merge is not None and geometry and suffix not in CAD:
        raise MeshError(f"{path.name} is a geometry: merge= applies to finished meshes and decks.")
    unit = unit or UnitSystem()
    if model is not None and not is_deck(path):
        raise MeshError(
            f"{path.name} is not a deck: read_model takes {', '.join(deck_endings())}; for a mesh "
            "use read_mesh and Structure."
        )
    options = {
        "unit": [unit.length, unit.force],
        "model": model,
        "size": None if size is None else float(size),
        "order": order,
        "refine": [([float(c) for c in point], float(local)) for point, local in refine],
        "solid": solid,
        "fragments": fragments,
        "trust": trust,
        "sizes": None if sizes is None else vars(sizes),
        "grading": list(grading),
        "outline": outline,
    }
    timeout = None if timeout is None else float(timeout)  # for JSON, as the size
    content = read_apart(path, geometry=geometry, options=options, timeout=timeout)
    content.points = content.points * unit.length
    if merge is not None:
        content = merged(content, merge)
    return content
