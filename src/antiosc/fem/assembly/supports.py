"""Supports, masses, grounded springs and superelements of an assembly, in its own axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse

from antiosc.base._types import IntArray
from antiosc.base.checks import several
from antiosc.base.errors import InputError
from antiosc.fem.assembly.ends import Motion, group_end, motion
from antiosc.fem.assembly.joint import Stiffness
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.assembly.superelement import Condensed
from antiosc.fem.mesh.entities import largest
from antiosc.fem.structure.attachments import Damper, PointMass, Spring
from antiosc.fem.structure.meshed import DISPLACEMENTS, ROTATIONS, Member
from antiosc.fem.structure.support import Support


def support_rows(layout: Layout, supports: Any) -> list[Sparse]:
    """Functionals that the supports hold at zero."""
    items = several("supports", supports, Support, "Support(where, fix)")
    return [_rows(layout, support) for support in items]


def _rows(layout: Layout, support: Support) -> Sparse:
    names = support.components(["x", "y", "rz"] if layout.plane else DISPLACEMENTS + ROTATIONS)
    if isinstance(support.where, str) and (
        support.where in layout.points or support.where.split(":", 1)[0] in layout.condensed
    ):
        point = motion(layout, support.where, partly=True)
        all_six = scipy.sparse.vstack([point.displacements, point.rotations]).tocsr()
        if support.fix == "all":
            return all_six[np.flatnonzero(np.diff(all_six.indptr))]
        lost = [name for name in names if name in DISPLACEMENTS and not point.has(name)]
        if lost:
            raise InputError(
                f"the support {support.label} fixes {', '.join(lost)}, which this site does "
                "not have."
            )
        return all_six[[(DISPLACEMENTS + ROTATIONS).index(name) for name in names]]
    found = []
    for member, nodes in _nodes(layout, support):
        for kind in (DISPLACEMENTS, ROTATIONS):
            wanted = [kind.index(name) for name in names if name in kind]
            own = layout.at_nodes(member, nodes, kind)
            rows = (3 * np.arange(len(nodes))[:, None] + wanted).ravel().astype(int)
            found.append(own[rows])
    result = scipy.sparse.vstack([layout.nothing(0), *found]).tocsr()
    if not result.nnz:
        raise InputError(
            f"the support {support.label} fixes nothing: no node of the assembly that can "
            f"move along {', '.join(names)} lies there."
        )
    return result


def _nodes(layout: Layout, support: Support) -> Sequence[tuple[Member, IntArray]]:
    if isinstance(support.where, str):
        member, group = group_end(layout, "where", support.where)
        return [(member, member.nodes_of(group))]
    found: list[tuple[Member, IntArray]] = []
    for member in layout.members.values():
        found.append((member, np.flatnonzero(support.selected(member.nodes))))
    return found


def attachment(layout: Layout, one: PointMass | Spring | Damper) -> list[Stiffness]:
    """What a mass, a grounded spring or a damper adds, at each of its places."""
    values = one.values() if isinstance(one, PointMass) else _values(one)
    other = _places(layout, one.to)[0] if isinstance(one, Damper) and one.to is not None else None
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
        if other is not None:
            G = (
                G
                - scipy.sparse.vstack([other.displacements, other.rotations]).tocsr()[
                    [(DISPLACEMENTS + ROTATIONS).index(name) for name in names]
                ]
            )
        diagonal, zero = np.diag([given[name] for name in names]), np.zeros((len(names),) * 2)
        if isinstance(one, PointMass):
            found.append(Stiffness(G, zero, diagonal, one.mass))
        elif isinstance(one, Damper):
            own = {"c": diagonal} if one.tau is None else {"branches": [(diagonal, one.tau)]}
            found.append(Stiffness(G, zero, zero, **own))
        else:
            found.append(Stiffness(G, diagonal, zero))
    return found


def _values(one: Spring | Damper) -> dict[str, float]:
    return dict(one.stiffness) if isinstance(one, Spring) else one.values


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
