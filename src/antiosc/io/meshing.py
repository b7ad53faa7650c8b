"""Meshing of gmsh's current model: sizes, size fields, a forecast of the number of cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import log, sqrt
from types import ModuleType

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MeshError
from antiosc.io.request import Request
from antiosc.io.size_field import SizeField

#: Size requested from gmsh over the wanted one: its edges come out up to 1.9 times longer.
SHORTER = 0.5
#: More cells than this are refused: gmsh would need some 20 GB.
MOST_CELLS = 10_000_000
#: Element sizes below this share of the part are below the resolution of its coordinates.
RESOLVED_SHARE = 1e-9
#: Cells that fill a unit of measure with edges of length 1, by dimension: regular simplices.
CELLS_PER_SIZE = (0.0, 1.0, 4 / sqrt(3), 6 * sqrt(2))


def generate(gmsh: ModuleType, ask: Request, scale: float) -> None:
    """Mesh gmsh's current model, whose unit is `scale` metres."""
    dim = gmsh.model.getDimension()
    if dim < 1:
        raise MeshError(f"{ask.name} contains no geometry (curves, surfaces or volumes).")
    refine = [([c / scale for c in point], local / scale) for point, local in ask.refine]
    ask = replace(ask, size=ask.size and ask.size / scale, refine=refine)
    _check_sizes(gmsh, ask, scale)
    # facets are flat: middle nodes off them would bend the part
    wanted = ask.order if ask.order is not None else (1 if dim == 1 or ask.solid else 2)
    gmsh.option.setNumber("Mesh.ElementOrder", 1)  # for the coarse meshes of `_mesh_coarsely`
    ask.allow(600)
    if ask.size is not None:
        expected = max(expected_cells(gmsh, ask, d, ask.size, scale) for d in range(1, dim + 1))
        gmsh.option.setNumber("Mesh.MeshSizeMax", ask.size)
        ask.allow(30 + 2e-3 * max(expected, 1e4))
    fields = [_graded_field(gmsh, point, local, ask) for point, local in ask.refine]
    if ask.sizes is not None:
        wished = SizeField(**ask.sizes)
        ask.allow(60 + 2e-3 * max(wished.expected(), 1e4))
        fields.append(wished.lay(gmsh, scale, flat=wanted == 1))
    if fields:
        smallest = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(smallest, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(smallest)
    # Unless a script asks for another algorithm, volumes are meshed by gmsh's Delaunay: HXT is
    # faster, but its meshes of one part differ from run to run.
    gmsh.option.setNumber("Mesh.ElementOrder", wanted)
    gmsh.model.mesh.generate(dim)


def _check_sizes(gmsh: ModuleType, ask: Request, scale: float) -> None:
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
        f"size={size * scale:g} m, more than {MOST_CELLS:.0e}: choose a larger size."
    )


def _mesh_coarsely(gmsh: ModuleType, dim: int) -> None:
    """Mesh the model with some thirty edges along it, for measurements."""
    gmsh.model.mesh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeMax", _extent(gmsh) / 30)
    gmsh.model.mesh.generate(dim)


def _extent(gmsh: ModuleType) -> float:
    """Longest edge of the box around the model, m."""
    box = np.array(gmsh.model.getBoundingBox(-1, -1))
    return float(np.max(box[3:] - box[:3]))


def _refined(ask: Request, dim: int) -> float:
    """Estimated number of additional cells at refined points: the integral of their size field."""
    far, (growth, reach) = ask.size or 1.0, ask.grading
    count = 0.0
    for _, local in ask.refine:
        ball = CELLS_PER_SIZE[dim] * (2 * reach / SHORTER) ** dim
        count += ball * (1 + log(1 + max(far / local, 0.0)) / growth)
    return count


def _bound(gmsh: ModuleType, dim: int, tag: int) -> float:
    """Length, area or volume of an entity; in gmsh's own kernel an upper bound, from its box."""
    mass = _mass(gmsh, dim, tag)
    if mass is not None or dim == 1:
        return _length(gmsh, tag) if mass is None else mass
    box = np.array(gmsh.model.getBoundingBox(dim, tag))
    a, b, c = box[3:] - box[:3]
    return float(a * b * c if dim == 3 else a * b + b * c + c * a)


def _mass(gmsh: ModuleType, dim: int, tag: int) -> float | None:
    try:
        return float(gmsh.model.occ.getMass(dim, tag))
    except Exception:  # not of OpenCASCADE
        return None


def _length(gmsh: ModuleType, tag: int) -> float:
    low, high = gmsh.model.getParametrizationBounds(1, tag)
    t = np.linspace(float(low[0]), float(high[0]), 33)
    x = np.reshape(gmsh.model.getValue(1, tag, t), (-1, 3))
    return float(np.linalg.norm(np.diff(x, axis=0), axis=1).sum())


def measure_of(gmsh: ModuleType, dim: int, tag: int) -> float:
    """Length, area or volume of an entity; in gmsh's own kernel from the mesh of its boundary."""
    mass = _mass(gmsh, dim, tag)
    if mass is not None or dim == 1:
        return _length(gmsh, tag) if mass is None else mass
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
    far = 1e22 if ask.size is None else float(ask.size)
    growth, reach = (float(each) for each in ask.grading)
    local = float(local)
    tag = gmsh.model.mesh.field.add("MathEval")
    distance = f"Sqrt((x-({x!r}))^2+(y-({y!r}))^2+(z-({z!r}))^2)"
    grown = f"{SHORTER * local!r}+{growth!r}*Max(0,{distance}-{reach * local!r})"
    gmsh.model.mesh.field.setString(tag, "F", f"Min({far!r},{grown})")
    return int(tag)
