"""Meshes in XDMF files, read by all ranks, each its own part: no rank holds the whole."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import dolfinx
import numpy as np
from mpi4py import MPI

from antiosc.base.errors import MeshError
from antiosc.fem.platform import agreed, compat, on_root

if TYPE_CHECKING:
    from dolfinx.mesh import MeshTags  # the oldest dolfinx has no such name

SUFFIXES = (".xdmf", ".xmf")
#: Dimensions of the cells of tagged entities, by the first word of their type; others are volumes.
DIMENSIONS = {"polyvertex": 0, "polyline": 1, "edge": 1, "triangle": 2, "quadrilateral": 2}


@dataclass(frozen=True)
class Grids:
    """The grids of a file: the mesh, and tags as (name, dimension of the tagged entities)."""

    mesh: str
    tags: list[tuple[str, int]]


def grids(file: Path) -> Grids | None:
    """The grids of a file as dolfinx writes it; None for others: arrays in the text, fields."""
    if not file.is_file():
        return None
    try:
        elements = ElementTree.parse(file).findall("./Domain/Grid")
    except (OSError, ElementTree.ParseError) as error:
        raise MeshError(f"{file.name} cannot be read as XDMF ({error}).") from error
    if not elements or elements[0].find("Attribute") is not None:
        return None
    if any(element.get("Format") != "HDF" for element in elements[0].iter("DataItem")):
        return None
    name, *tag_names = (element.get("Name", "") for element in elements)
    tags = []
    for tagged, grid in zip(tag_names, elements[1:], strict=True):
        topology = grid.find("Topology")
        attribute = grid.find("Attribute")
        if topology is not None and attribute is not None:
            kind = topology.get("TopologyType", "").lower().partition("_")[0]
            tags.append((tagged, DIMENSIONS.get(kind, 3)))
    return Grids(name, tags)


def read(
    file: Path, comm: MPI.Comm, metres: float
) -> tuple[dolfinx.mesh.Mesh, dict[str, tuple[MeshTags, int]]] | None:
    """(The mesh of a file, its tags as groups); None where dolfinx does not read it.

    A group has the name of its grid and its number, as "faces 7". `metres`: per unit of length.
    """
    plan = on_root(comm, lambda: grids(file))
    if plan is None:
        return None

    def work() -> tuple[dolfinx.mesh.Mesh, dict[str, tuple[MeshTags, int]]]:
        try:
            with dolfinx.io.XDMFFile(comm, str(file), "r") as opened:
                mesh = opened.read_mesh(name=plan.mesh)
                mesh.geometry.x[:] *= metres
                return mesh, _groups(opened, mesh, plan.tags)
        except RuntimeError as error:
            reason = " ".join(str(error).split())[:150].rstrip(". ")
            raise MeshError(f"{file.name} cannot be read as dolfinx's XDMF ({reason}).") from error

    return agreed(comm, work)


def _groups(
    opened: dolfinx.io.XDMFFile, mesh: dolfinx.mesh.Mesh, tags: list[tuple[str, int]]
) -> dict[str, tuple[MeshTags, int]]:
    groups: dict[str, tuple[MeshTags, int]] = {}
    dim = mesh.topology.dim
    for name, at in tags:
        mesh.topology.create_connectivity(at, dim)
        mesh_tags = opened.read_meshtags(mesh, name=name)
        values = compat.communicator(mesh).allgather(np.unique(mesh_tags.values))
        for value in np.unique(np.concatenate(values)).tolist():
            groups[f"{name} {value}"] = mesh_tags, value
    return groups
