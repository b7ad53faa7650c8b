"""Displacements, strains, stresses and section forces of a structure, from motions of its dofs.

`source` returns the module for a structure: `mesh_fields` for a structure with a mesh,
`node_fields` for K and M with coordinates of their nodes.
"""

from __future__ import annotations

from types import ModuleType

from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.recovery import node_fields


def source(structure: Structure) -> ModuleType:
    """Module for a structure's fields: `mesh_fields`, or `node_fields` if it has only K and M."""
    if structure.matrices.located:
        return node_fields
    with_parts(structure)
    from antiosc.recovery import mesh_fields  # needs dolfinx

    return mesh_fields
