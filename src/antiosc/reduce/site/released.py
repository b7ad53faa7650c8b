"""Reactions of supports and grounded springs, from motions in which one of them is released."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

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

#: An element is not strained by a rigid motion if its force over that of its terms is below this.
INTERNAL = 1e-9


@dataclass(frozen=True, eq=False)
class Element:
    """A grounded spring, or a term of the damping, on some rows of u.

    `name` and `point` (3,) [m]: those of an element that acts on the ground; `name` is "" for
    others.
    """

    name: str
    point: Array | None
    rows: slice
    term: Dissipation

    def forces(self, comm: MPI.Comm, u: Array) -> Array:
        """Forces c G u (j, k) for motions (rows of this rank, k) of all parts."""
        return np.asarray(self.term.c @ comm.allreduce(np.asarray(self.term.G @ u[self.rows])))

    def loads(self, comm: MPI.Comm, u: Array) -> Array:
        """Gᵀ c G u (rows of this rank, k)."""
        total = np.zeros(u.shape)
        total[self.rows] = (
            self.term.G.T @ self.forces(comm, u)
            if self.term.matrix is None
            else self.term.factor * multiply(self.term.matrix, u[self.rows])
        )
        return total

    def if_to_ground(self, comm: MPI.Comm, rigid: Array) -> Element:
        """The element; its name is removed if rigid motions do not strain it, so it is not
        grounded.
        """
        largest_force = np.abs(self.forces(comm, rigid)).max(initial=0.0)
        assert self.term.c is not None
        terms = np.abs(self.term.c) @ (abs(self.term.G) @ np.abs(rigid))
        is_grounded = largest_force > INTERNAL * terms.max(initial=0.0)
        if is_grounded:
            return self
        return replace(self, name="")


class Released:
    """The reactions of supports and grounded springs.

    They follow from motions in which one support is released: first each support of the structure
    and of its parts, then the ground ends of springs. Each element on the ground has the name of a
    support; dampers carry no static force.

    If a joint and supports fix the same motion, the constraints of the joint that follow from the
    supports carry no force, as in the assembly itself, which omits them.

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
        self._springs: list[Element] = []
        self._damping: list[Element] = []
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
        of each term.

        The terms of the damping are in the order of the structure's. Call `inertia` first.
        """
        u = self._of.expanded(shapes)
        return [(element.term.tau, self._by_damping(element, u)) for element in self._damping]

    def _by_damping(self, element: Element, u: Array) -> Array:
        """Reactions due to one term of the damping."""
        comm = self._of.comm
        loads = element.loads(comm, u)
        reactions = dot(comm, self._motions, loads)
        if element.name:
            rigid = self._of.places.rigid_motions(self.centres[element.name])
            column = 6 * list(self.centres).index(element.name)
            reactions[column : column + 6] -= dot(comm, rigid, loads)
        return reactions

    def _elements(self) -> tuple[list[Element], list[Element]]:
        """(grounded springs, all damping terms in the order of the structure)."""
        springs: list[Element] = []
        terms: list[Element] = []
        comm = self._of.comm
        rigid = self._of.places.rigid_motions(np.zeros(3))
        if self._assembly:
            attached = self._assembly.added
            for kind, springs_or_terms in (
                (springs, attached.springs()),
                (terms, attached.dissipation(on_u=True)),
            ):
                elements = [
                    Element(term.name, term.point, slice(None), term) for term in springs_or_terms
                ]
                kind += [element.if_to_ground(comm, rigid) for element in elements]
        for member in self._of.members():
            part = self._part(member)
            prefix = f"{member.name}:" if member.name else ""
            for kind, springs_or_terms in ((springs, [*part.springs]), (terms, part.dissipation())):
                for term in springs_or_terms:
                    point = None if term.point is None else member.at.placed(term.point[None])[0]
                    kind.append(Element(term.name and prefix + term.name, point, member.rows, term))
        springs = [spring for spring in springs if spring.name]
        return springs, sorted(terms, key=lambda one: one.term.matrix is not None)

    def _functional(self, site: Site) -> Functional:
        """The functional of a site on the dofs of all parts before joining."""
        if site.point is not None:
            return before_joining(self._of, [site], self._part)[0]
        if self._assembly:
            raise InputError("reactions of an assembly take sites at points, not dofs.")
        return algebraic(self._part(self._of.members()[0]), site)

    def _released(self, supports: Sequence[Support]) -> tuple[dict[str, Array], Array]:
        """(centre of each support or spring, forces on the free dofs for unit motions of each)."""
        centres: dict[str, Array] = {}
        places = self._of.places
        supported: list[tuple[str, IntArray, Array]] = []  # name, dofs, their motions
        for member in self._of.members():
            prefix = f"{member.name}:" if member.name else ""
            for name, dofs in dofs_by_support(member.part).items():
                centres[prefix + name] = centre = _centre(member, dofs)
                support_motions = member.places.rigid_motions(centre, dofs)
                supported.append((prefix + name, member.first + dofs, support_motions))
        constraints = self._assembly.constraints if self._assembly else None
        names = names_of(supports, centres) if constraints else []
        rows = constraints.rows if constraints else []
        if constraints and self._assembly:
            points = places.points
            for name, constraint in zip(names, rows, strict=False):
                centres[name] = points[np.unique(constraint.matrix.indices)].mean(axis=0)
        self._springs, self._damping = self._elements()
        grounds = [element for element in (*self._springs, *self._damping) if element.name]
        for element in grounds:
            points_of_name = [ground.point for ground in grounds if ground.name == element.name]
            points_known = [x for x in points_of_name if x is not None]
            centre = np.mean(points_known or places.points[element.term.G.indices], axis=0)
            centres.setdefault(element.name, centre)
        if not centres:
            raise InputError(
                "the structure has no supports, springs or dampers to the ground: it has no"
                " reactions."
            )
        column = {name: slice(6 * k, 6 * k + 6) for k, name in enumerate(centres)}
        motions = np.zeros((len(places.kind), 6 * len(centres)))
        for name, dofs, support_motions in supported:
            motions[dofs, column[name]] = support_motions
        if constraints:
            prescribed = [np.asarray(-constraint.matrix @ motions) for constraint in rows]
            for name, constraint, values in zip(names, rows, prescribed, strict=False):
                values[:, column[name]] += constraint.matrix @ places.rigid_motions(centres[name])
            eliminated = eliminate(
                rows,
                constraints.fixed,
                constraints.scale,
                np.vstack([np.zeros((0, motions.shape[1])), *prescribed]),
            )
            assert eliminated.particular is not None
            motions = motions + eliminated.particular
        self._motions = motions
        forces = -self._forces("K", motions)
        for spring in self._springs:
            rigid = places.rigid_motions(centres[spring.name])
            forces[:, column[spring.name]] += self._on_free(spring.loads(self._of.comm, rigid))
        return centres, forces

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
