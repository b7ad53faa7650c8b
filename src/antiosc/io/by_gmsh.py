"""Gmsh's mesh files, and geometries that are meshed by gmsh.

gmsh executes a file as a script if it does not begin like a mesh, and it reads options from files
in the same folder. Therefore gmsh gets a copy under a fixed name in an empty folder, after a check
of the first line of a mesh, or of every token of a script (`geo_script`).
"""

from __future__ import annotations

import inspect
import shutil
from pathlib import Path
from types import ModuleType

import numpy as np

from antiosc.base.errors import MeshError, MissingDependencyError
from antiosc.io import geo_script, meshing
from antiosc.io.meshing import CAD, Names, fill, named_solids, opened
from antiosc.io.mixed import as_carried, known
from antiosc.io.neutral import FileMesh, IntArray, joined
from antiosc.io.request import Request
from antiosc.io.shapes import CELLS

SCRIPTS = (".geo", ".geo_unrolled")
GEOMETRY = (*SCRIPTS, *CAD)
#: First words of gmsh's mesh files; gmsh executes any other file as a script.
HEADERS = (b"$MeshFormat", b"$Comments", b"$NOD", b"$NOE", b"$PARA", b"$ELM", b"$PTS")

GMSH_KINDS = {number: label for label, (_, _, number) in CELLS.items()}


def read(ask: Request) -> FileMesh:
    """A mesh file (`.msh`)."""
    source = Path(ask.path)
    ask.allow(30 + 2e-6 * source.stat().st_size)
    if not ask.trust:
        with source.open("rb") as stream:
            beginning = stream.read(16)
        if not beginning.startswith(HEADERS):
            raise MeshError(
                f"{ask.name} does not begin as a Gmsh mesh ($MeshFormat): it is another file, or "
                "it is damaged."
            )
        source = Path(shutil.copyfile(source, "mesh.msh"))
    return _through_gmsh(ask, source)


def generate(ask: Request) -> FileMesh:
    """A geometry, meshed."""
    source = Path(ask.path)
    suffix = source.suffix.lower()
    # a script may take long to build the geometry
    ask.allow((120 if suffix in SCRIPTS else 30) + 1e-5 * source.stat().st_size)
    if not ask.trust:
        own = Path(f"mesh{suffix}")
        if suffix in SCRIPTS:
            script = geo_script.harmless(source.read_text(encoding="latin-1"), ask.name)
            for name in script.merged:
                _copy_beside(source, name, ask.name)
            own.write_text(script.text, encoding="latin-1", newline="")
        else:
            shutil.copyfile(source, own)
        source = own
    return _through_gmsh(ask, source)


def _copy_beside(script: Path, name: str, shown: str) -> None:
    """Copy a geometry file that a script merges into the folder of the script's copy."""
    merged = script.with_name(name)
    if not merged.is_file():
        raise MeshError(f"{shown} merges {name}, but there is no such file in its folder.")
    shutil.copyfile(merged, name)


def _through_gmsh(ask: Request, path: Path) -> FileMesh:
    gmsh = _session()
    ask.seal()
    suffix = Path(ask.path).suffix.lower()
    try:
        stated = opened(gmsh, str(path))
        names = {}
        if ask.solid:
            fill(gmsh, ask)
        elif suffix in CAD:
            names = named_solids(gmsh, ask.fragments, ask.name)
        if ask.outline:
            return _outline(gmsh, names, stated)
        if suffix != ".msh":
            meshing.generate(gmsh, ask, stated * ask.unit[0])
        found = _arrays(gmsh, ask.name, names)
        found.points *= stated
        return found
    except MeshError:
        raise
    except Exception as error:
        reason = " ".join(str(error).replace(str(path), ask.name).split()).rstrip(".")
        reason = reason[:200] or "it is damaged"
        if gmsh.model.getDimension() > 0 and suffix in GEOMETRY:
            reason += "; a smaller size, or a repaired geometry, may help"
        raise MeshError(f"gmsh cannot read or mesh {ask.name}: {reason}.") from error


def _outline(gmsh: ModuleType, names: Names, scale: float) -> FileMesh:
    """A line between the corners of the box around gmsh's model, in all its groups."""
    corners = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)) * scale
    groups = gmsh.model.getPhysicalGroups()
    listed = [gmsh.model.getPhysicalName(dim, tag) or str(tag) for dim, tag in groups]
    listed += [name for several in names.values() for name in several]
    one = {"line": np.zeros(1, dtype=np.int64)}
    return FileMesh(corners, {"line": np.array([[0, 1]])}, "gmsh", dict.fromkeys(listed, one))


def _session() -> ModuleType:
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


def _arrays(gmsh: ModuleType, name: str, names: Names) -> FileMesh:
    """All cells, entity after entity, and the groups of gmsh's current model.

    `names`: of solids that are groups besides the physical ones.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    by_tag = np.argsort(tags).astype(np.int64)
    sorted_tags = np.asarray(tags)[by_tag]
    points = np.asarray(coordinates, dtype=float).reshape(-1, 3)

    def indices(node_tags: IntArray, width: int) -> IntArray:
        found = np.searchsorted(sorted_tags, node_tags)
        found[found == len(sorted_tags)] = 0
        if not len(sorted_tags) or not np.array_equal(sorted_tags[found], node_tags):
            raise MeshError(f"{name} has cells on nodes that it does not hold: it is damaged.")
        return by_tag[found].reshape(-1, width)

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
    found = FileMesh(points, cells, "gmsh", of_solids | groups, aids=bool(groups))
    return as_carried(found, name)


def _groups(
    gmsh: ModuleType, rows: dict[tuple[int, int], dict[str, IntArray]], name: str
) -> dict[str, dict[str, IntArray]]:
    found: dict[tuple[int, int], dict[str, list[IntArray]]] = {}
    for (dim, tag), blocks in rows.items():
        # the inverse query searches all entities for each group
        for group in gmsh.model.getPhysicalGroupsForEntity(dim, tag):
            for kind, members in blocks.items():
                found.setdefault((dim, abs(int(group))), {}).setdefault(kind, []).append(members)
    groups: dict[str, dict[str, IntArray]] = {}
    dims: set[tuple[str, int]] = set()
    for dim, tag in gmsh.model.getPhysicalGroups():
        label = gmsh.model.getPhysicalName(dim, tag) or str(tag)
        parts = found.get((dim, tag))
        if parts is None:
            continue
        if (label, dim) in dims:
            raise MeshError(
                f"{name} gives two groups of dimension {dim} the name {label!r}: name them apart."
            )
        dims.add((label, dim))
        groups.setdefault(label, {}).update({k: np.concatenate(r) for k, r in parts.items()})
    return groups
