"""A series of displacement fields in one `.bp` folder, by dolfinx's VTXWriter (ADIOS2)."""

from __future__ import annotations

import os
import secrets
import shutil
from pathlib import Path

from antiosc.base import files
from antiosc.base._types import Array
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.fem.fields.mesh_fields import displacements_of_rank
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import on_root
from antiosc.fem.structure.structure import Structure, on_mesh

#: What a folder of ADIOS2 holds.
INDEX = "md.idx"


def write(target: Path, structure: Structure, shapes: Array, times: Array, factors: Array) -> None:
    """Write displacements, the sums of `shapes` (rows, k) with factors (n, k), at times (n,).

    Every rank writes its part of the mesh. The folder is complete or absent; one that is no series
    of ADIOS2 is left alone.

    Raises
    ------
    MissingDependencyError
        dolfinx was built without ADIOS2.
    InputError
        An assembly, given matrices; the system refuses to write there.
    """
    if structure.matrices.assembled:
        raise InputError("a .bp series holds one mesh: write the series of an assembly as .pvd.")
    part = on_mesh(structure, "given matrices have no mesh for a .bp series: write a .pvd.")
    if not compat.writes_vtx():
        raise MissingDependencyError(
            "a .bp series needs dolfinx with ADIOS2, which Debian has from 13 on: write a .pvd."
        )
    comm = part.comm
    staged = Path(on_root(comm, lambda: str(_staged(target))))
    try:
        fields = displacements_of_rank(part, shapes)
        mesh = part.mesh.dolfinx
        compat.write_vtx(mesh, staged, "displacement", times, (fields @ a for a in factors))
        on_root(comm, lambda: _moved(staged, target))
    finally:
        on_root(comm, lambda: shutil.rmtree(staged, ignore_errors=True))


def _staged(target: Path) -> Path:
    """Where the folder is written first, beside its place."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if os.path.lexists(target) and not (target / INDEX).is_file():
            raise InputError(
                f"cannot write the series to {str(target)!r}: what is there is no series of "
                "ADIOS2; choose another name."
            )
        if not os.access(target.parent, os.W_OK):
            raise PermissionError(13, "Permission denied")
    except OSError as error:
        raise files.cannot_write("the series", target, error) from error
    return target.with_name(f".antiosc-{secrets.token_hex(6)}.bp")


def _moved(staged: Path, target: Path) -> None:
    try:
        files.replace_folder(staged, target)
    except OSError as error:
        raise files.cannot_write("the series", target, error) from error
