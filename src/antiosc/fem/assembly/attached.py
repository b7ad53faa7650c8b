"""Masses, grounded springs and superelements of an assembly, as stiffness and mass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse

from antiosc.errors import InputError
from antiosc.fem.assembly.ends import Motion, motion
from antiosc.fem.assembly.joint import Stiffness
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.assembly.superelement import Condensed
from antiosc.fem.mesh.entities import largest
from antiosc.fem.structure.attachments import PointMass, Spring
from antiosc.fem.structure.member import DISPLACEMENTS, ROTATIONS


def attachment(layout: Layout, one: PointMass | Spring) -> list[Stiffness]:
    """What a mass or a grounded spring adds, at each of its places."""
    values = one.values() if isinstance(one, PointMass) else dict(one.stiffness)
    found = []
    for end in _places(layout, one.where):
        given = {name: value for name, value in values.items() if value}
        if layout.plane and isinstance(one, PointMass):
            given = {name: value for name, value in given.items() if name in ("x", "y", "rz")}
        names = list(given)
        six = scipy.sparse.vstack([end.displacements, end.rotations]).tocsr()
        G = six[[(DISPLACEMENTS + ROTATIONS).index(name) for name in names]]
        lost = [
            name
            for name, n in zip(names, np.diff(G.indptr), strict=True)
            if not n or (name in DISPLACEMENTS and not end.has(name))
        ]
        if lost:
            raise InputError(
                f"{type(one).__name__} at {one.where!r} acts on {', '.join(lost)}, which this "
                "point does not have: points of solids have no rotations (act on a group or on a "
                "reference point)."
            )
        diagonal, zero = np.diag([given[name] for name in names]), np.zeros((len(names),) * 2)
        if isinstance(one, PointMass):
            found.append(Stiffness(G, zero, diagonal, one.mass))
        else:
            found.append(Stiffness(G, diagonal, zero))
    return found


def superelement(layout: Layout, one: Condensed) -> Stiffness:
    """K and M of a superelement on its own dofs."""
    part = one.part
    own = layout.units(np.arange(one.first, one.first + one.size))
    return Stiffness(own, part.K, part.M, rigid=part.rigid)


def _places(layout: Layout, where: str | Sequence[float]) -> list[Motion]:
    """The points at which an attachment acts."""
    if not isinstance(where, str):
        x = np.pad(np.array(where, dtype=float), (0, 3 - len(where)))
        name = min(
            layout.members,
            key=lambda name: float(layout.members[name].closest(x[None]).distance[0]),
        )
        return [motion(layout, (name, tuple(x)))]
    if ":" in where and where.split(":", 1)[0] in layout.members:
        member = layout.members[where.split(":", 1)[0]]
        group = where.split(":", 1)[1]
        if group in member.part.mesh.groups and largest(member.part.mesh, group)[0] == 0:
            return [
                motion(layout, (member.name, tuple(member.nodes[node])))
                for node in member.nodes_of(group)
            ]
    return [motion(layout, where, partly=True)]
