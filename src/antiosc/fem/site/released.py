"""A structure without its supports: the virtual motions that give the forces of these."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, without_warnings
from antiosc.fem.assembly import MeshedParts
from antiosc.fem.assembly.assemble import eliminate
from antiosc.fem.assembly.assembled import AssembledMatrices, rigid_motions
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.site import Functional, Site, algebraic
from antiosc.fem.site.at_points import before_joining
from antiosc.fem.structure.meshed import Member, MeshedStructure
from antiosc.fem.structure.support import Support, fixed_dofs


class Released:
    """The supports of a structure and of its parts, released one after the other.

    Where a joint and supports hold the same motion, the constraints of the joint that follow from
    the supports carry no force, as in the assembly itself, which leaves them out.

    Attributes
    ----------
    centres : support -> (3,) mean of its nodes, m.
    pulled : (rows of this rank, 6 S) forces on the dofs that follow unit rigid motions of each
        support.
    """

    def __init__(self, matrices: MeshedParts, supports: Sequence[Support]) -> None:
        self._of = matrices
        self._assembly = matrices if isinstance(matrices, AssembledMatrices) else None
        for name in self._assembly.layout.condensed if self._assembly else ():
            raise InputError(
                "reactions of an assembly with superelements are not known: the supports and the "
                f"inertia inside of the part {name!r} are not."
            )
        self._parts: dict[int, MeshedStructure] = {}
        self._motions = np.zeros((0, 0))
        self.centres, pulled = matrices.decided(lambda: self._released(supports))
        self.pulled: Array = matrices.own(pulled)

    def inertia(self, following: Array, rigid: Array) -> tuple[Array, Array]:
        """(M g, M r), rows of this rank, of the motions g of the supports.

        `following` (rows of this rank, 6 S) are the motions of the free dofs that follow them;
        `rigid` as in `applied`.
        """
        whole = self._assembly.share.whole(following) if self._assembly else following

        def work() -> tuple[Array, Array]:
            moved = self._assembly.T @ whole if self._assembly else whole
            self._motions = self._motions + moved
            return self._forces("M", self._motions), self._forces("M", rigid)

        moved, carried = self._of.decided(work)
        return self._of.own(moved), self._of.own(carried)

    def rigid(self) -> Array:
        """Unit translations (dofs of all parts before they are joined, 3) of the whole."""
        return self._rigid(np.zeros(3))[:, :3]

    def applied(self, sites: Sequence[Site], rigid: Array) -> tuple[Array, Array]:
        """(bᵀg (P, 6 S), bᵀr (P, 3)) of the directions of contact of the sites."""

        def work() -> tuple[Array, Array]:
            with without_warnings():  # they were told of when the model was extracted
                found = [self._functional(site) for site in sites]
            b = np.column_stack([each.b for one in found for each in (one, *one.across)])
            return dot(self._of.workers, b, self._motions), dot(self._of.workers, b, rigid)

        return self._of.decided(work)

    def _functional(self, site: Site) -> Functional:
        if site.point is not None:
            return before_joining(self._of, [site], self._part)[0]
        if self._assembly:
            raise InputError("reactions of an assembly take sites at points, not dofs.")
        return algebraic(self._part(self._of.members()[0]), site)

    def _rigid(self, point: Array) -> Array:
        """Six rigid motions about `point` on the dofs of all parts."""
        if self._assembly:
            return rigid_motions(self._assembly.layout, point)
        return self._of.members()[0].rigid(point)

    def _released(self, supports: Sequence[Support]) -> tuple[dict[str, Array], Array]:
        """(centres, pulled)."""
        centres: dict[str, Array] = {}
        held: list[tuple[str, IntArray, Array]] = []  # name, dofs, their motions
        for member in self._of.members():
            prefix = f"{member.name}:" if member.name else ""
            for name, dofs in held_dofs(member.part).items():
                centres[prefix + name] = centre = _centre(member, dofs)
                held.append((prefix + name, member.first + dofs, member.rigid(centre)[dofs]))
        constraints = self._assembly.constraints if self._assembly else None
        names = names_of(supports, centres) if constraints else []
        rows = constraints.rows if constraints else []
        if constraints and self._assembly:
            positions = self._assembly.layout.positions
            for name, one in zip(names, rows, strict=False):
                centres[name] = positions[np.unique(one.matrix.indices)].mean(axis=0)
        if not centres:
            raise InputError("the structure has no supports: it has no reactions.")
        column = {name: slice(6 * k, 6 * k + 6) for k, name in enumerate(centres)}
        motions = np.zeros((len(self.rigid()), 6 * len(centres)))
        for name, dofs, moved in held:
            motions[dofs, column[name]] = moved
        if constraints:
            prescribed = [np.asarray(-one.matrix @ motions) for one in rows]
            for name, one, values in zip(names, rows, prescribed, strict=False):
                values[:, column[name]] += one.matrix @ self._rigid(centres[name])
            found = eliminate(
                rows,
                constraints.fixed,
                constraints.scale,
                constraints.basis,
                np.vstack([np.zeros((0, motions.shape[1])), *prescribed]),
            )
            assert found.particular is not None
            motions = motions + found.particular
        self._motions = motions
        return centres, -self._forces("K", motions)

    def _part(self, member: Member) -> MeshedStructure:
        """A part without its supports."""
        part = member.part
        if not part.supports:
            return part
        if id(part) not in self._parts:
            self._parts[id(part)] = part.unsupported()
        return self._parts[id(part)]

    def _forces(self, which: str, motions: Array) -> Array:
        """K u or M u, on the dofs that are free, of motions of the parts' dofs."""
        forces = np.zeros(motions.shape)
        for member in self._of.members():
            matrix = getattr(self._part(member), which)
            forces[member.rows] = multiply(matrix, motions[member.rows])
        if self._assembly is None:
            forces[self._of.fixed[self._of.fixed < len(forces)]] = 0.0
            return forces
        added = self._assembly.added
        more = added.forces(motions) if which == "K" else added.inertial_loads(motions)[0]
        total = np.asarray(self._assembly.T.T @ forces + more)
        total[self._assembly.eliminated.dependent] = 0.0
        return total


def _centre(member: Member, dofs: IntArray) -> Array:
    """Mean (3,) of the places of dofs of a part, over all of its ranks."""
    there = member.nodes[dofs // member.block]
    comm = member.part.comm
    total, count = comm.allreduce(there.sum(axis=0)), comm.allreduce(len(there))
    return np.asarray(total / max(count, 1))


def names_of(supports: Sequence[Support], taken: Container[str] = ()) -> list[str]:
    """Names of supports: their groups, or "support 1" and on."""
    names: list[str] = []
    for number, support in enumerate(supports, start=1):
        name = support.where if isinstance(support.where, str) else f"support {number}"
        names.append(f"{name} ({number})" if name in taken or name in names else name)
    return names


def held_dofs(part: MeshedStructure) -> dict[str, IntArray]:
    """Support of a part -> its dofs of this rank that it is the first to hold."""
    rows, result = len(part.attached_inertia), {}
    taken = np.zeros(0, dtype=int)
    for name, support in zip(names_of(part.supports), part.supports, strict=True):
        paths = fixed_dofs(part.mesh, part.form, [support])
        dofs = np.unique(np.concatenate([taken[:0], *paths.values()]))
        result[name] = np.setdiff1d(dofs[dofs < rows], taken)
        taken = np.union1d(taken, result[name])
    return result
