"""Groups of a part as nodes, and as weighted points of its cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from antiosc._types import IntArray
from antiosc.fem.assembly.layout import Member
from antiosc.fem.mesh.entities import DEGREE, Quadrature, largest, quadrature
from antiosc.fem.structure.support import dofs_of_group


def nodes_of(member: Member, group: str) -> IntArray:
    """The nodes of the displacements in a group of a part."""
    form = member.part.form
    dofs = dofs_of_group(member.part.mesh, form, group, form.components["x"])
    return np.unique(np.asarray(dofs) // member.block)


def points_of(member: Member, group: str) -> Quadrature:
    """Points of a rule on the entities of the largest dimension in a group, in the assembly."""
    mesh = member.part.mesh
    own = quadrature(mesh, *largest(mesh, group), DEGREE)
    return replace(own, x=member.at.placed(own.x))
