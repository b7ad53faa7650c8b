"""`source`: the module that gives the fields of a structure."""

from __future__ import annotations

from types import ModuleType

from antiosc.fem.assembly import with_parts
from antiosc.fem.structure.structure import Structure
from antiosc.recovery import node_fields


def source(structure: Structure) -> ModuleType:
    """Module that evaluates fields of the structure: of its mesh, or nodes of given matrices."""
    if structure.matrices.located:
        return node_fields
    with_parts(structure)
    from antiosc.recovery import mesh_fields  # needs dolfinx

    return mesh_fields
