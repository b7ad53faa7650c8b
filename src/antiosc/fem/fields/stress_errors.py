"""Errors of the stresses of solids at their nodes, and the corners in which they are infinite."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.assembly import with_parts
from antiosc.fem.fields.mesh_fields import displacements_of_rank
from antiosc.fem.recovery import at_nodes as nodal
from antiosc.fem.recovery.corners import interior_angle
from antiosc.fem.structure.structure import Structure


def stress_jumps(
    structure: Structure, shapes: Array, factors: Array, part: str | None = None
) -> Array | None:
    """Estimated errors [Pa] of the von Mises stress at the points of `at_nodes`, on rank 0.

    `factors` (P, columns) of the shapes at each point. 0 in sheets and beams; None without solids.
    """
    if "solid" not in families(structure, shapes, part):
        return None
    parts = with_parts(structure).fields(shapes, part)
    found, start = [], 0
    for member, own in parts:
        comm = member.part.mesh.comm
        sizes = comm.allgather(len(member.part.mesh.dolfinx.geometry.x))
        first = start + sum(sizes[: comm.rank])
        here = np.zeros(sizes[comm.rank])
        if member.part.kind.name == "solid":
            here = nodal.jumps(member.part, own, factors[first : first + len(here)])
        found += comm.gather(here, root=0) or []
        start += sum(sizes)
    return np.concatenate(found) if found else np.zeros(0)


def families(structure: Structure, shapes: Array, part: str | None = None) -> set[str]:
    """Kinds of the parts that are looked at: "solid", "sheet", "beam", "truss"."""
    fields = with_parts(structure).fields(shapes, part)
    return {member.part.kind.name for member, _ in fields}


def corner_at(
    structure: Structure, shapes: Array, x: Array, part: str | None = None
) -> tuple[float, bool]:
    """(interior angle [degree] of the solid at its node x (3,), whether this node is held)."""
    parts = with_parts(structure).fields(shapes, part)
    best = (np.inf, 0.0, False)
    for member, own in parts:
        if member.part.kind.name != "solid":
            continue
        mesh, point = member.part.mesh, member.at.own(x[None])[0]
        distance = np.linalg.norm(mesh.dolfinx.geometry.x - point, axis=1)
        moves = np.abs(displacements_of_rank(member.part, own)[distance.argmin()]).max(initial=0)
        nearest = min(mesh.comm.allgather((float(distance.min()), bool(moves == 0))))
        if nearest[0] < best[0]:
            best = (nearest[0], interior_angle(member.part, point), nearest[1])
    return best[1:]
