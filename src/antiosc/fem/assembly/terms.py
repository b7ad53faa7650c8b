"""Supports, attachments and superelements of an assembly as rows and terms of functionals of u."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.sparse

from antiosc.base._types import IntArray
from antiosc.base.checks import shown
from antiosc.base.errors import InputError
from antiosc.fem.assembly.ends import UNIT, EndMotion, group_end, motion
from antiosc.fem.assembly.joint import Stiffness
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.assembly.superelement import Superelement
from antiosc.fem.mesh.surface import largest
from antiosc.fem.structure import in_space
from antiosc.fem.structure.attachments import (
    Damper,
    PointMass,
    Spring,
    damper_to_itself,
    values_of,
)
from antiosc.fem.structure.meshed import Member
from antiosc.fem.structure.support import NumberedNodes, Support
from antiosc.io.matrices import COMPONENTS, DISPLACEMENTS, ROTATIONS


def support_rows(layout: Layout, support: Support) -> Sparse:
    """The functionals (m, n) of u that a support fixes at zero."""
    names = support.components(["x", "y", "rz"] if layout.plane else COMPONENTS)
    if isinstance(support.where, str) and (
        support.where in layout.points or support.where.split(":", 1)[0] in layout.condensed
    ):
        point = motion(layout, support.where, allow_partial=True)
        if support.fix == "all":
            return point.six[np.flatnonzero(np.diff(point.six.indptr))]
        absent = [name for name in names if name in DISPLACEMENTS and not point.has(UNIT[name])]
        if absent:
            raise InputError(
                f"the support {support.label} fixes {', '.join(absent)}, which this site does "
                "not have."
            )
        return point.components(names)
    rows_of_support = []
    for member, nodes in _nodes(layout, support):
        for kind in (DISPLACEMENTS, ROTATIONS):
            axes = [kind.index(name) for name in names if name in kind]
            motions = layout.at_nodes(member, nodes, kind)
            rows = (3 * np.arange(len(nodes))[:, None] + axes).ravel().astype(int)
            rows_of_support.append(motions[rows])
    result = scipy.sparse.vstack([layout.nothing(0), *rows_of_support]).tocsr()
    if not result.nnz:
        raise InputError(
            f"the support {support.label} fixes nothing: no node of the assembly that can "
            f"move along {', '.join(names)} lies there."
        )
    return result


def _nodes(layout: Layout, support: Support) -> list[tuple[Member, IntArray]]:
    if isinstance(support.where, str):
        member, group = group_end(layout, "where", support.where)
        return [(member, member.nodes_of(group))]
    if isinstance(support.where, NumberedNodes):
        numbered = [member for member in layout.members.values() if len(member.part.mesh.labels)]
        return [(member, member.nodes_of(support.where)) for member in numbered]
    return [
        (member, np.flatnonzero(support.selected(member.nodes)))
        for member in layout.members.values()
    ]


def attachment(layout: Layout, attached: PointMass | Spring | Damper) -> list[Stiffness]:
    """The terms of a mass, a grounded spring or a damper, one for each of its points."""
    values = values_of(attached, layout.plane)
    names = list(values)
    diagonal = np.diag(list(values.values()))
    zero = np.zeros_like(diagonal)
    other_point = None
    if isinstance(attached, Damper) and attached.to is not None:
        other_point = _places(layout, attached.to)[0]
    terms = []
    for end in _places(layout, attached.where):
        lack = end.lacking(names)
        if lack:
            raise InputError(
                f"{type(attached).__name__} at {attached.where!r} acts on {', '.join(lack)}, which"
                " this point does not have: points of solids have no rotations (act on a group or"
                " on a reference point)."
            )
        G = end.components(names)
        if other_point is not None:
            if isinstance(attached, Damper) and np.allclose(other_point.point, end.point):
                raise InputError(damper_to_itself(attached))
            G = G - other_point.components(names)
        if isinstance(attached, PointMass):
            terms.append(Stiffness(G, zero, diagonal, attached.mass))
        elif isinstance(attached, Spring):
            terms.append(Stiffness(G, diagonal, zero))
        elif attached.tau is None:
            terms.append(Stiffness(G, zero, zero, c=diagonal))
        else:
            terms.append(Stiffness(G, zero, zero, branches=[(diagonal, attached.tau)]))
        name = getattr(attached, "name", None) or ""
        terms[-1] = replace(terms[-1], name=name, point=end.point)
    return terms


def superelement(layout: Layout, part: Superelement) -> Stiffness:
    """K and M of a superelement as a term on the dofs of that superelement."""
    functionals = layout.units(np.arange(part.rows.start, part.rows.stop))
    return Stiffness(functionals, part.K, part.M, rigid=part.rigid)


def _places(layout: Layout, where: str | Sequence[float]) -> list[EndMotion]:
    """Motions of the points at which an attachment acts."""
    if not isinstance(where, str):
        if len(where) < 3 and not layout.plane:
            raise InputError(
                f"the point {shown(where)} of a mass, spring or damper has {len(where)} coordinates"
                " in an assembly in space: give x, y and z."
            )
        x = in_space(where)
        name = min(
            layout.members,
            key=lambda name: float(layout.members[name].closest(x[None]).distance[0]),
        )
        return [motion(layout, (name, tuple(x)))]
    part, _, group = where.partition(":")
    if group and part in layout.members:
        member = layout.members[part]
        if group in member.part.mesh.groups and largest(member.part.mesh, group)[0] == 0:
            return [
                motion(layout, (member.name, tuple(member.nodes[node])))
                for node in member.nodes_of(group)
            ]
    return [motion(layout, where, allow_partial=True)]
