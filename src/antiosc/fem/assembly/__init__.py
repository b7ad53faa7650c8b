"""Assemblies: parts with their own meshes, joined by linear constraints u = T q."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias, cast

from antiosc.base.errors import InputError
from antiosc.fem.structure.structure import NO_MESH, Structure

if TYPE_CHECKING:
    from antiosc.fem.structure.meshed import PartsMatrices

#: Matrices of one mesh, or of several that are joined.
MeshedParts: TypeAlias = "PartsMatrices"


def with_parts(structure: Structure, otherwise: str = NO_MESH) -> MeshedParts:
    """Matrices of a structure of meshed parts; InputError with `otherwise` if it has no mesh."""
    if not (structure.matrices.meshed or structure.matrices.assembled):
        raise InputError(otherwise)
    return cast("MeshedParts", structure.matrices)
