"""Files with meshes and geometries into plain arrays.

`read` has one file read in a process of its own (`isolation`, `child`) by the reader for its ending
(`table`), and selects the cells that make the mesh (`selection`).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from antiosc.errors import MeshError
from antiosc.fem.readers.by_gmsh import GEOMETRY, SCRIPTS
from antiosc.fem.readers.isolation import read_apart
from antiosc.fem.readers.neutral import KINDS, RawMesh
from antiosc.fem.readers.request import Refinement
from antiosc.fem.readers.selection import Wanted, selected

__all__ = ["GEOMETRY", "KINDS", "RawMesh", "Refinement", "Wanted", "read"]


def read(
    path: Path,
    size: float | None = None,
    order: int | None = None,
    refine: Sequence[Refinement] = (),
    *,
    cells: Wanted = None,
    trust: bool = False,
    timeout: float | None = None,
) -> RawMesh:
    """Read or mesh the file `path`; see `antiosc.read_mesh`."""
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
    options = {
        "size": size,
        "order": order,
        "refine": [([float(c) for c in point], float(local)) for point, local in refine],
        "trust": trust,
    }
    content = read_apart(path, geometry=geometry, options=options, timeout=timeout)
    return selected(content, cells, order, path.name)
