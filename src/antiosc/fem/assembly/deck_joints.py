"""The parts of a deck joined at their nodes, by its constraints, springs and dampers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from antiosc.base._types import IntArray
from antiosc.fem.assembly.assemble import put_together
from antiosc.fem.assembly.joint import Joint
from antiosc.fem.assembly.node_constraints import NodeConstraints
from antiosc.fem.assembly.shared_nodes import SharedNodes
from antiosc.fem.linalg.solver_choice import Choice
from antiosc.fem.structure.attachments import Damper, PointMass, Spring
from antiosc.fem.structure.structure import Structure
from antiosc.fem.structure.support import Support


def point_name(number: int) -> str:
    """Name of a reference point, whose number is negative."""
    return f"point {-number}"


def attachments(model: dict[str, Any]) -> list[PointMass | Spring | Damper]:
    """Masses and springs of a deck; those on points of no element by the names of these."""
    masses = [PointMass(_where(at), mass, inertia) for at, mass, inertia in model["masses"]]
    return [*masses, *(Spring(_where(at), stiffness) for at, stiffness in model["springs"])]


def _where(at: Any) -> Any:
    return point_name(at) if isinstance(at, int) else at


def joined(
    parts: Mapping[str, Structure],
    numbers: Mapping[str, IntArray],
    model: dict[str, Any],
    supports: Sequence[Support],
    attached: Sequence[PointMass | Spring | Damper],
    solver: Choice,
) -> Structure:
    """One structure of the parts; `supports` may name groups of any part."""
    joints = model["joints"]
    points = {point_name(-1 - k): x for k, x in enumerate(joints["points"])}
    made: list[Joint] = [
        NodeConstraints(
            joints["equations"],
            joints["springs"],
            list(points),
            numbers,
            joints["masses"],
            dict(joints["among"]),
            joints["dampers"],
        )
    ]
    if len(parts) > 1:
        made.insert(0, SharedNodes(numbers, loose=True))
    point_supports = [Support(point_name(point), fix) for point, fix in model["fixed_points"]]
    for name, part in parts.items():
        point_supports += [
            Support(f"{name}:{group}", fix)
            for group, fix in model["supports"]
            if part.mesh.groups.get(group) and set(fix) <= set(part.form.components)
        ]
    return put_together(
        parts,
        made,
        points=points,
        supports=[*point_supports, *_of_parts(parts, supports)],
        attached=[*attachments(model), *attached],
        solver=solver,
        apart=model["held"],
    )


def _of_parts(parts: Mapping[str, Structure], supports: Sequence[Support]) -> list[Support]:
    """Supports on a group as supports on this group of every part that has it."""
    found = []
    for support in supports:
        where = support.where
        owners: list[str] = []
        if isinstance(where, str):
            owners = [name for name, part in parts.items() if where in part.mesh.groups]
        found += [replace(support, where=f"{name}:{where}") for name in owners] or [support]
    return found
