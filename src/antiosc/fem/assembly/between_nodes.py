"""Dofs between constrained nodes.

The displacements here are richer than those of a deck's elements. Where constraints determine all
nodes of an edge or a face of a cell, the dofs between these nodes follow by the functions of the
cell's map, by which the deck's own elements move there; where all nodes slide across one direction,
so do the dofs between them; where all lie on one cell to which they are tied, the dofs between them
follow that cell. Beams bend between their nodes: they follow where both nodes are of
one rigid body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import basix
import numpy as np
import scipy.sparse

from antiosc._types import Array, IntArray
from antiosc.fem import compat
from antiosc.fem.assembly.coincident_nodes import CoincidentNodes
from antiosc.fem.assembly.layout import Sparse
from antiosc.fem.assembly.numbered_nodes import Nodes, Term
from antiosc.fem.structure.member import DISPLACEMENTS, ROTATIONS

#: node that the deck does not have -> (node of the deck, weight) of those among which it lies
Among = Mapping[int, Sequence[tuple[int, float]]]


def between_nodes(
    nodes: Nodes, equations: Sequence[Sequence[Term]], own: Sparse, among: Among
) -> Sparse:
    """Constraints of the dofs between nodes; `own` are the functionals of the equations."""
    dependent: dict[int, dict[int, int]] = {}  # motion -> node -> its constraint
    sliding: dict[int, dict[int, list[Array]]] = {}  # 0 or 3 -> node -> directions held
    for row, terms in enumerate(equations):
        number, motion, _ = terms[0]
        if number < 0:
            continue
        if {n for n, _, _ in terms} == {number}:
            direction = np.zeros(3)
            for _, m, coefficient in terms:
                direction[m % 3] = coefficient
            sliding.setdefault(3 * (motion // 3), {}).setdefault(number, []).append(direction)
        else:
            dependent.setdefault(motion, {}).setdefault(number, row)
    found = [nodes.layout.nothing(0)]
    tied = CoincidentNodes(nodes, equations)
    for k in range(len(nodes.members)):
        for motion in dependent:
            found += _followers(nodes, k, motion, dependent, equations, own, among, tied)
        for first, directions in sliding.items():
            found += _sliders(nodes, k, first, directions, among)
    return scipy.sparse.vstack(found).tocsr()


def _dofs(
    nodes: Nodes, k: int, motion: int, some: Mapping[int, object], among: Among
) -> Iterator[tuple[int, list[int], Array]]:
    """(dof, nodes of its entity, their weights) of the dofs of one motion near `some` nodes.

    A dof in the place of a node of the deck is that node's own, and is left out.
    """
    member, table = nodes.members[k], nodes.tables[k]
    name = (ROTATIONS if motion >= 3 else DISPLACEMENTS)[motion % 3]
    path = member.part.form.components.get(name)
    touching = np.flatnonzero(np.isin(table, np.fromiter(some, dtype=int)).any(axis=1))
    if path is None or not len(touching):
        return
    mesh, space = member.part.mesh, member.part.form.space
    kind = getattr(basix.CellType, mesh.cell)
    X = np.asarray(compat.subspace(space, path).element.basix_element.points)
    cell_map = basix.create_element(basix.ElementFamily.P, kind, mesh.order)
    weights = np.asarray(cell_map.tabulate(0, X))[0, :, :, 0]
    needed = [np.flatnonzero(np.abs(row) > 1e-12) for row in weights]
    dofs = compat.cell_dofs(space, path, touching)
    done: set[int] = set()
    for at, cell in enumerate(touching):
        for d, near in enumerate(needed):
            column = member.first + int(dofs[at, d])
            if column not in done:
                done.add(column)
                found = _of_the_deck(table[cell, near], weights[d, near], among)
                if len(found) > 1 and any(n in some for n in found):
                    yield column, list(found), np.array(list(found.values()))


def _of_the_deck(numbers: IntArray, weights: Array, among: Among) -> dict[int, float]:
    """Weights of the deck's own nodes."""
    result: dict[int, float] = {}
    for number, weight in zip(numbers.tolist(), weights.tolist(), strict=True):
        for one, share in among.get(number, ((number, 1.0),)):
            result[one] = result.get(one, 0.0) + weight * share
    return result


def _followers(
    nodes: Nodes,
    k: int,
    motion: int,
    dependent: Mapping[int, Mapping[int, int]],
    equations: Sequence[Sequence[Term]],
    own: Sparse,
    among: Among,
    tied: CoincidentNodes,
) -> Iterator[Sparse]:
    """Dofs that are the weighted sum of what their nodes are by their constraints."""
    rows = dependent[motion]
    beam = nodes.members[k].part.mesh.tdim == 1
    for column, numbers, weights in _dofs(nodes, k, motion, rows, among):
        if beam and not _in_one_body(numbers, dependent, equations, nodes.layout.plane):
            continue
        if not _determined(nodes, numbers, motion, rows, equations):
            continue
        total = nodes.layout.units(np.array([column]))
        there = None if beam else tied.displacement(numbers, weights, motion, rows)
        if there is not None:
            yield (total - there).tocsr()
            continue
        for node, weight in zip(numbers, weights, strict=True):
            follows = nodes.single(node, motion)
            if node in rows:  # by its constraint without its own term
                follows = follows - own[rows[node]] / equations[rows[node]][0][2]
            total = total - weight * follows
        yield total.tocsr()


def _in_one_body(
    numbers: Sequence[int],
    dependent: Mapping[int, Mapping[int, int]],
    equations: Sequence[Sequence[Term]],
    plane: bool,
) -> bool:
    """Whether all motions of nodes follow those of one point, which may be one of them."""
    leaders: set[int] = set()
    followers: list[set[int]] = []
    for motion in (0, 1, 5) if plane else range(6):
        own = dependent.get(motion, {})
        followers.append({n for n in numbers if n in own})
        leaders |= {term[0] for n in followers[-1] for term in equations[own[n]][1:]}
    alike = all(one == followers[0] for one in followers)
    return alike and len(leaders) == 1 and set(numbers) - followers[0] <= leaders


def _determined(
    nodes: Nodes,
    numbers: Sequence[int],
    motion: int,
    rows: Mapping[int, int],
    equations: Sequence[Sequence[Term]],
) -> bool:
    """Whether each node is dependent, fixed, or leads all that are dependent."""
    dependent = [n for n in numbers if n in rows]
    others = set(numbers) - set(dependent)
    if dependent and all(
        others <= {n for n, m, _ in equations[rows[node]][1:] if m == motion} for node in dependent
    ):
        return True
    return all(nodes.is_fixed(n, motion) for n in others)


def _sliders(
    nodes: Nodes, k: int, first: int, directions: Mapping[int, list[Array]], among: Among
) -> Iterator[Sparse]:
    """Dofs between nodes that slide across a direction, or are fixed."""
    axes = range(2 if nodes.layout.plane else 3)
    by_motion = [_dofs(nodes, k, first + c, directions, among) for c in axes]
    for found in zip(*by_motion, strict=True):
        columns = [column for column, _, _ in found]
        _, numbers, weights = found[0]
        sliding = [n for n in numbers if n in directions]
        fixed = [n for n in numbers if n not in directions]
        if not all(nodes.is_fixed(n, first + c) for n in fixed for c in axes):
            continue
        for i in range(min(len(directions[n]) for n in sliding)):
            mean = sum(
                w * directions[n][i]
                for n, w in zip(numbers, weights, strict=True)
                if n in directions
            )
            row = nodes.layout.units(np.array(columns))
            yield (scipy.sparse.csr_matrix(np.reshape(mean, (1, 3))[:, axes]) @ row).tocsr()
