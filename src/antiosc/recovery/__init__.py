"""`source`: the module that gives the fields of a structure."""

from __future__ import annotations

from types import ModuleType

from antiosc.fem.assembly import with_parts
from antiosc.fem.structure.structure import Structure
from antiosc.recovery import node_fields


def source(structure: Structure) -> ModuleType:
    """Module for the fields of a structure: `mesh_fields`; of given matrices `node_fields`."""
    if structure.matrices.located:
        return node_fields
    with_parts(structure)
    from antiosc.recovery import mesh_fields  # needs dolfinx

    return mesh_fields
