"""Files with meshes and geometries into plain arrays.

`read` lets the reader of the file type (`table`) read one file in a separate process (`isolation`,
`child`), and selects the cells that form the mesh (`selection`).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from antiosc.errors import MeshError
from antiosc.fem.readers.by_gmsh import GEOMETRY, SCRIPTS
from antiosc.fem.readers.isolation import read_apart
from antiosc.fem.readers.merging import merged
from antiosc.fem.readers.neutral import KINDS, RawMesh
from antiosc.fem.readers.request import ModelOptions, Refinement
from antiosc.fem.readers.selection import Wanted, selected
from antiosc.fem.readers.table import DECKS, is_deck
from antiosc.fem.readers.unit_system import UnitSystem

__all__ = ["GEOMETRY", "KINDS", "RawMesh", "Refinement", "UnitSystem", "Wanted", "read"]


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
    model: ModelOptions | None = None,
) -> RawMesh:
    """Read or mesh the file `path`; see `antiosc.read_mesh`.

    `model`: read materials, sections, supports and masses of a deck as well.
    """
    suffix = path.suffix.lower()
    geometry = suffix in GEOMETRY
    if geometry and size is None and suffix not in SCRIPTS:
        raise MeshError(
            f"{path.name} is a geometry, not a mesh: give the element size in metres, "
            "as in read_mesh(path, size=5e-3)."
        )
    if not geometry and (size is not None or refine):
        raise MeshError(
            f"{path.name} is a finished mesh: size= and refine= apply to geometry files only "
            f"({', '.join(GEOMETRY)})."
        )
    if geometry and (unit is not None or merge is not None):
        raise MeshError(
            f"{path.name} is a geometry: unit= and merge= apply to finished meshes and decks "
            "(STEP files state their own unit)."
        )
    unit = unit or UnitSystem()
    if model is not None and not is_deck(path):
        raise MeshError(
            f"{path.name} is not a deck: read_model takes {', '.join(DECKS)}; for a mesh use "
            "read_mesh and Structure."
        )
    options = {
        "unit": [unit.length, unit.force],
        "model": model,
        "size": None if size is None else float(size),
        "order": order,
        "refine": [([float(c) for c in point], float(local)) for point, local in refine],
        "trust": trust,
    }
    timeout = None if timeout is None else float(timeout)  # for JSON, as the size
    content = read_apart(path, geometry=geometry, options=options, timeout=timeout)
    content.points = content.points * unit.length
    if merge is not None:
        content = merged(content, merge)
    return selected(content, cells, order, path.name)
