"""Reactions of supports, from motions in which one of them is released."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError, without_warnings
from antiosc.fem.assembly import MeshedParts
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.elimination import eliminate
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure import Dissipation
from antiosc.fem.structure.meshed import Member, MeshedStructure
from antiosc.fem.structure.support import Support, fixed_dofs
from antiosc.reduce.site import algebraic
from antiosc.reduce.site.at_points import before_joining
from antiosc.reduce.site.site import Functional, Site


class Released:
    """The reactions of the supports of a structure and of its parts.

    They follow from motions in which one support is released. If a joint and supports fix the same
    motion, the constraints of the joint that follow from the supports carry no force, as in the
    assembly itself, which omits them.

    Attributes
    ----------
    centres : support -> (3,) mean of its nodes, m.
    pulled : (rows of this rank, 6 S) forces that unit rigid motions of each of the S supports exert
        on the free dofs.
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
        self.centres, self.pulled = self._released(supports)

    def inertia(self, following: Array, rigid: Array) -> tuple[Array, Array]:
        """(M g, M r), rows of this rank, for the motions g of the supports and rigid motions r.

        `following` (rows of this rank, 6 S): the motions of the free dofs due to those of the
        supports; `rigid` as in `applied`.
        """
        self._motions = self._motions + self._of.expanded(following)
        return self._forces("M", self._motions), self._forces("M", rigid)

    def rigid(self) -> Array:
        """Unit translations (dofs of all parts before joining, 3) of the whole structure."""
        return self._of.places.rigid_motions(np.zeros(3))[:, :3]

    def applied(self, sites: Sequence[Site], rigid: Array) -> tuple[Array, Array]:
        """(bᵀg (P, 6 S), bᵀr (P, 3)) for the load vectors b of the sites along their contacts."""
        with without_warnings():  # they were told of when the model was extracted
            functionals_found = [self._functional(site) for site in sites]
        b = np.hstack([functional.B for functional in functionals_found])
        return dot(self._of.comm, b, self._motions), dot(self._of.comm, b, rigid)

    def damping(self, shapes: Array) -> list[tuple[float | None, Array]]:
        """(relaxation time, reactions (6 S, B) due to motions of the shapes (rows of this rank, B))
        of each term of the structure's damping, in its order. Call `inertia` first.
        """
        u = self._of.expanded(shapes)
        terms = [(slice(None), term) for term in self._attached()]
        for member in self._of.members():
            terms += [(member.rows, term) for term in self._part(member).dissipation()]
        terms.sort(key=lambda pair: pair[1].matrix is not None)
        return [(term.tau, self._by_term(term, rows, u)) for rows, term in terms]

    def _attached(self) -> list[Dissipation]:
        """The dampers of an assembly itself."""
        return self._assembly.added.dissipation(on_u=True) if self._assembly else []

    def _by_term(self, term: Dissipation, rows: slice, u: Array) -> Array:
        """Reactions due to one term of the damping on some rows, for motions u of all parts."""
        comm = self._of.comm
        if term.matrix is not None:
            loads = term.factor * multiply(term.matrix, u[rows])
        else:
            loads = term.G.T @ (term.c @ comm.allreduce(np.asarray(term.G @ u[rows])))
        return np.asarray(dot(comm, self._motions[rows], np.asarray(loads)))

    def _functional(self, site: Site) -> Functional:
        """The functional of a site on the dofs of all parts before joining."""
        if site.point is not None:
            return before_joining(self._of, [site], self._part)[0]
        if self._assembly:
            raise InputError("reactions of an assembly take sites at points, not dofs.")
        return algebraic(self._part(self._of.members()[0]), site)

    def _released(self, supports: Sequence[Support]) -> tuple[dict[str, Array], Array]:
        """(centre of each support, forces on the free dofs for unit motions of each)."""
        centres: dict[str, Array] = {}
        places = self._of.places
        moved: dict[str, tuple[IntArray, Array]] = {}  # dofs of a support, their motions
        for member in self._of.members():
            prefix = f"{member.name}:" if member.name else ""
            for name, dofs in dofs_by_support(member.part).items():
                centres[prefix + name] = centre = _centre(member, dofs)
                motions_of_dofs = member.places.rigid_motions(centre, dofs)
                moved[prefix + name] = member.first + dofs, motions_of_dofs

        # supports of the assembly are constraints between dofs
        constraints = self._assembly.constraints if self._assembly else None
        rows = constraints.rows if constraints else []
        names = names_of(supports, centres) if constraints else []
        for name, row in zip(names, rows, strict=False):
            centres[name] = places.points[np.unique(row.matrix.indices)].mean(axis=0)
        if not centres:
            raise InputError(
                "the structure has no supports: it has no reactions; the force of a spring to the"
                " ground is its stiffness times the displacement of its point (`probe`)."
            )

        column = {name: slice(6 * k, 6 * k + 6) for k, name in enumerate(centres)}
        motions = np.zeros((len(places.kind), 6 * len(centres)))
        for name, (dofs, motions_of_dofs) in moved.items():
            motions[dofs, column[name]] = motions_of_dofs
        if constraints:
            prescribed = [np.asarray(-row.matrix @ motions) for row in rows]
            for name, row, values in zip(names, rows, prescribed, strict=False):
                values[:, column[name]] += row.matrix @ places.rigid_motions(centres[name])
            all_values = np.vstack([np.zeros((0, motions.shape[1])), *prescribed])
            eliminated = eliminate(rows, constraints.fixed, constraints.scale, all_values)
            assert eliminated.particular is not None
            motions = motions + eliminated.particular
        self._motions = motions
        return centres, -self._forces("K", motions)

    def _part(self, member: Member) -> MeshedStructure:
        """A part without its supports and its prestress."""
        part = member.part.unloaded or member.part
        if not part.supports:
            return part
        if id(part) not in self._parts:
            self._parts[id(part)] = part.unsupported()
        return self._parts[id(part)]

    def _forces(self, which: str, motions: Array) -> Array:
        """K u or M u (`which`) on the free dofs, for motions u of the parts' dofs."""
        forces = np.zeros(motions.shape)
        for member in self._of.members():
            matrix = getattr(self._part(member), which)
            forces[member.rows] = multiply(matrix, motions[member.rows])
        if which == "K" and self._of.preload is not None:
            forces += self._of.preload.added(motions)
        free = self._on_free(forces)
        if self._assembly is None:
            return free
        attached = self._assembly.added
        extra = attached.forces(motions) if which == "K" else attached.inertial_loads(motions)[0]
        return np.asarray(free + extra)

    def _on_free(self, forces: Array) -> Array:
        """Forces on u (rows of this rank, k) as forces on the free dofs."""
        if self._assembly is not None:
            return np.asarray(self._of.joined(forces))
        forces[self._of.fixed[self._of.fixed < len(forces)]] = 0.0
        return forces


def _centre(member: Member, dofs: IntArray) -> Array:
    """Mean coordinates (3,) of dofs of a part, over all of its ranks."""
    coordinates = member.nodes[dofs // member.block]
    comm = member.part.comm
    total = comm.allreduce(coordinates.sum(axis=0))
    count = comm.allreduce(len(coordinates))
    return np.asarray(total / max(count, 1))


def names_of(supports: Sequence[Support], used: Container[str] = ()) -> list[str]:
    """Names of supports: their groups, or "support 1", "support 2", … that are not in `used`."""
    names: list[str] = []
    for number, support in enumerate(supports, start=1):
        name = support.where if isinstance(support.where, str) else f"support {number}"
        names.append(f"{name} ({number})" if name in used or name in names else name)
    return names


def dofs_by_support(part: MeshedStructure) -> dict[str, IntArray]:
    """Name of each support of a part -> its dofs on this rank; a dof counts for its first
    support.
    """
    rows = len(part.attached_inertia)
    result = {}
    fixed = np.zeros(0, dtype=int)
    for name, support in zip(names_of(part.supports), part.supports, strict=True):
        paths = fixed_dofs(part.mesh, part.form, [support])
        dofs = np.unique(np.concatenate([fixed[:0], *paths.values()]))
        result[name] = np.setdiff1d(dofs[dofs < rows], fixed)
        fixed = np.union1d(fixed, result[name])
    return result
