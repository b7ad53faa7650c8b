"""Displacements, strains, stresses and section forces of a structure, from motions of its dofs.

`source` gives the module that does this for a structure: `mesh_fields` for one with a mesh,
`node_fields` for given matrices with coordinates of their nodes.
"""

from __future__ import annotations

from types import ModuleType

from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.recovery import node_fields


def source(structure: Structure) -> ModuleType:
    """Module for the fields of a structure: `mesh_fields`; of given matrices `node_fields`."""
    if structure.matrices.located:
        return node_fields
    with_parts(structure)
    from antiosc.recovery import mesh_fields  # needs dolfinx

    return mesh_fields
