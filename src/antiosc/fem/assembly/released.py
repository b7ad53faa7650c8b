"""An assembly without its supports: the virtual motions that give the forces of these."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from antiosc._types import Array
from antiosc.errors import InputError, without_warnings
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.elimination import eliminate
from antiosc.fem.assembly.layout import Member, Sparse
from antiosc.fem.assembly.motions import rigid_motions
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.mpi import on_root
from antiosc.fem.site.on_assembly import before_joining
from antiosc.fem.site.site import Site
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.released import held_dofs, names_of
from antiosc.fem.structure.structure import Structure


class ReleasedAssembly:
    """The supports of an assembly and of its parts, released one after the other.

    Where a joint and supports hold the same motion, the constraints of the joint that follow from
    the supports carry no force, as in the assembly itself, which leaves them out.

    Attributes
    ----------
    centres : support -> (3,) mean of its nodes, m.
    pulled : (rows of this rank, 6 S) forces on q that follow unit rigid motions of each support.
    """

    def __init__(self, structure: Structure) -> None:
        self._matrices = cast("AssembledMatrices", structure.matrices)
        for name in self._matrices.layout.condensed:
            raise InputError(
                f"reactions of an assembly with superelements are not known: the supports and the "
                f"inertia inside of the part {name!r} are not."
            )
        self._parts: dict[int, MeshedStructure] = {}
        self._motions = np.zeros((0, 0))
        centres, pulled = on_root(structure.comm, lambda: self._released(structure))
        self.centres: dict[str, Array] = centres
        self.pulled = self._matrices.share.own(pulled)

    def inertia(self, following: Array, rigid: Array) -> tuple[Array, Array]:
        """(M g in q, M r in q), rows of this rank, of the motions g of the supports.

        `following` (rows of this rank, 6 S) are the motions of q that follow them; `rigid` as in
        `applied`.
        """
        whole = self._matrices.share.whole(following)

        def work() -> tuple[Array, Array]:
            self._motions = self._motions + self._matrices.T @ whole
            return self._loads(self._motions), self._loads(rigid)

        own = self._matrices.share.own
        moved, carried = on_root(self._matrices.comm, work)
        return own(moved), own(carried)

    def rigid(self) -> Array:
        """Unit translations (n, 3) of the whole, of u."""
        return rigid_motions(self._matrices.layout, np.zeros(3))[:, :3]

    def applied(self, sites: Sequence[Site], rigid: Array) -> tuple[Array, Array]:
        """(bᵀg (P, 6 S), bᵀr (P, 3)) of the directions of contact of the sites."""

        def work() -> tuple[Array, Array]:
            columns = []
            for site in sites:
                if site.point is None:
                    raise InputError("reactions of an assembly take sites at points, not dofs.")
                with without_warnings():  # it was told when the model was extracted
                    found = before_joining(self._matrices, site, self._part)
                columns += [each.b for each in (found, *found.across)]
            b = np.column_stack(columns)
            return b.T @ self._motions, b.T @ rigid

        return on_root(self._matrices.comm, work)

    def _released(self, structure: Structure) -> tuple[dict[str, Array], Array]:
        """(centres, pulled), whole; on rank 0."""
        layout = self._matrices.layout
        constraints = self._matrices.constraints
        assert constraints is not None
        centres: dict[str, Array] = {}
        fixed: list[tuple[str, Array, Array]] = []  # name, dofs of u, their motions
        for member in layout.members.values():
            part = member.part
            for name, dofs in held_dofs(part, part.supports, len(part.attached_inertia)).items():
                rows = member.first + np.unique(np.concatenate(list(dofs.values())))
                centres[f"{member.name}:{name}"] = centre = layout.positions[rows].mean(axis=0)
                fixed.append((f"{member.name}:{name}", rows, rigid_motions(layout, centre)[rows]))
        names = names_of(structure.supports, centres)
        for name, one in zip(names, constraints.rows, strict=False):
            centres[name] = layout.positions[np.unique(one.matrix.indices)].mean(axis=0)
        if not centres:
            raise InputError("the structure has no supports: it has no reactions.")
        column = {name: slice(6 * k, 6 * k + 6) for k, name in enumerate(centres)}
        motions = np.zeros((layout.count, 6 * len(centres)))
        for name, rows, moved in fixed:
            motions[rows, column[name]] = moved
        prescribed = [np.asarray(-one.matrix @ motions) for one in constraints.rows]
        for name, one, values in zip(names, constraints.rows, prescribed, strict=False):
            values[:, column[name]] += one.matrix @ rigid_motions(layout, centres[name])
        found = eliminate(
            constraints.rows,
            constraints.fixed,
            constraints.scale,
            constraints.basis,
            np.vstack([np.zeros((0, motions.shape[1])), *prescribed]),
        )
        assert found.particular is not None
        self._motions = motions + found.particular
        return centres, -self._forces(self._motions)

    def _part(self, member: Member) -> MeshedStructure:
        """A part without its supports."""
        part = member.part
        if not part.supports:
            return part
        if id(part) not in self._parts:
            self._parts[id(part)] = part.unsupported()
        return self._parts[id(part)]

    def _forces(self, motions: Array) -> Array:
        """K u in q of motions of u."""
        forces = np.zeros(motions.shape)
        for member in self._matrices.layout.members.values():
            forces[member.rows] = multiply(self._part(member).K, motions[member.rows])
        return self._of_q(forces, self._matrices.added.forces(motions))

    def _loads(self, motions: Array) -> Array:
        """M u in q of motions of u."""
        loads = np.zeros(motions.shape)
        for member in self._matrices.layout.members.values():
            loads[member.rows] = multiply(self._part(member).M, motions[member.rows])
        return self._of_q(loads, self._matrices.added.inertial_loads(motions)[0])

    def _of_q(self, forces: Array, added: Array) -> Array:
        """Forces of u, and those of joints, which are of q already, on the dofs q."""
        T: Sparse = self._matrices.T
        total = np.asarray(T.T @ forces + added)
        total[self._matrices.eliminated.dependent] = 0.0
        return total
