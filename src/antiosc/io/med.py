"""MED files of Salome and code_aster, reduced to one mesh without results, as meshio reads them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from antiosc.io.neutral import IntArray

#: Group of the meshes, group of the results, names of a node's and of a mesh's dimension.
MESHES = "ENS_MAA"
RESULTS = "CHA"
SPACE = "ESP"
DIMENSION = "DIM"


def of_one_mesh(path: Path, name: str) -> tuple[Path, list[str], IntArray]:
    """(path of a copy with only the largest mesh, note on the others, its node numbers).

    The file itself if it is not HDF5: meshio then names the fault.
    """
    try:
        import h5py

        copy = Path(shutil.copyfile(path, "one.med"))
        with h5py.File(copy, "r+") as file:
            return copy, _cut_down(file, name), _numbers(file[MESHES])
    except (ImportError, OSError, KeyError):
        return path, [], np.zeros(0, dtype=np.int64)


def _cut_down(file: Any, name: str) -> list[str]:
    """Remove all but one mesh and one time from an open file; returns a note on the others."""
    if RESULTS in file:
        del file[RESULTS]
    meshes = file[MESHES]
    nodes = {key: _nodes(mesh) for key, mesh in meshes.items()}
    largest = max(nodes, key=lambda key: nodes[key])
    for key in set(nodes) - {largest}:
        del meshes[key]
    mesh = meshes[largest]
    mesh.attrs.setdefault(SPACE, mesh.attrs[DIMENSION])
    steps = [] if "NOE" in mesh else sorted(mesh)
    for step in steps[1:]:
        del mesh[step]
    if len(nodes) < 2:
        return []
    sizes = ", ".join(f"{key} of {count} nodes" for key, count in nodes.items())
    return [f"{name} holds {len(nodes)} meshes ({sizes}); {largest} is read."]


def _numbers(meshes: Any) -> IntArray:
    """Node numbers of the only mesh: its own, or from 1 as Salome counts."""
    (mesh,) = meshes.values()
    numbers = _first(mesh)["NOE"].get("NUM")
    if numbers is None:
        return np.arange(1, _nodes(mesh) + 1)
    return np.asarray(numbers, dtype=np.int64)


def _first(mesh: Any) -> Any:
    """A mesh at its first time step."""
    if "NOE" in mesh:
        return mesh
    return mesh[sorted(mesh)[0]]


def _nodes(mesh: Any) -> int:
    """Number of nodes of a mesh."""
    step = _first(mesh)
    if "NOE" in step:
        return int(step["NOE"]["COO"].attrs["NBR"])
    return 0
