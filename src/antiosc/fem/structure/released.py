"""A structure of a mesh without its supports: the virtual motions that give the forces of these."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import numpy as np

from antiosc._types import Array, IntArray
from antiosc.errors import without_warnings
from antiosc.fem import compat
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.site.functionals import functionals
from antiosc.fem.site.site import Site
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.rigid_body_modes import about
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.fem.structure.support import Support, fixed_dofs


class ReleasedMesh:
    """The supports of a structure of one mesh, released one after the other.

    Attributes
    ----------
    centres : support -> (3,) mean of its nodes, m.
    pulled : (rows of this rank, 6 S) forces on the free dofs that follow unit rigid motions of
        each support.
    """

    def __init__(self, structure: Structure) -> None:
        part = on_mesh(structure)
        self._free = _unsupported(structure)
        self._comm = structure.comm
        self.centres: dict[str, Array] = {}
        columns = []
        for name, dofs in held_dofs(part, structure.supports, structure.rows).items():
            self.centres[name] = centre = self._centre(part, dofs)
            rigid = about(part.form, centre)
            motion = np.zeros_like(rigid)
            for own in dofs.values():
                motion[own] = rigid[own]
            columns.append(motion)
        self._motions = np.hstack(columns)
        self.pulled = -multiply(self._free.K, self._motions)
        self.pulled[structure.fixed[structure.fixed < structure.rows]] = 0.0

    def inertia(self, following: Array, rigid: Array) -> tuple[Array, Array]:
        """(M g, M r), rows of this rank, of the motions g of the supports.

        `following` (rows of this rank, 6 S) are the motions of the free dofs that follow them;
        `rigid` as in `applied`.
        """
        self._motions = self._motions + following
        return multiply(self._free.M, self._motions), multiply(self._free.M, rigid)

    def rigid(self) -> Array:
        """Unit translations (rows of this rank, 3) of the whole."""
        return about(on_mesh(self._free).form, np.zeros(3))[:, :3]

    def applied(self, sites: Sequence[Site], rigid: Array) -> tuple[Array, Array]:
        """(bᵀg (P, 6 S), bᵀr (P, 3)) of the directions of contact of the sites."""
        with without_warnings():  # they were told of when the model was extracted
            found = functionals(self._free, sites)
        b = np.column_stack([each.b for one in found for each in (one, *one.across)])
        return dot(self._comm, b, self._motions), dot(self._comm, b, rigid)

    def _centre(self, part: MeshedStructure, dofs: Mapping[str, IntArray]) -> Array:
        total, count = np.zeros(3), 0
        for component, own in dofs.items():
            numbers, x = compat.dof_coordinates(part.form.space, part.form.components[component])
            there = x[np.isin(numbers, own)]
            total, count = total + there.sum(axis=0), count + len(there)
        return np.asarray(self._comm.allreduce(total) / max(self._comm.allreduce(count), 1))


def _unsupported(structure: Structure) -> Structure:
    """The same structure without its supports."""
    assert structure.made_of is not None
    mesh, material, options = structure.made_of
    with without_warnings():  # it was warned of when the structure was made
        return Structure(mesh, material, **options)


def names_of(supports: Sequence[Support], taken: Container[str] = ()) -> list[str]:
    """Names of supports: their groups, or "support 1" and on."""
    names: list[str] = []
    for number, support in enumerate(supports, start=1):
        name = support.where if isinstance(support.where, str) else f"support {number}"
        names.append(f"{name} ({number})" if name in taken or name in names else name)
    return names


def held_dofs(
    part: MeshedStructure, supports: Sequence[Support], rows: int
) -> dict[str, dict[str, IntArray]]:
    """Support -> component -> dofs, of the first `rows` of this rank, that it holds first."""
    taken: dict[str, IntArray] = {}
    result: dict[str, dict[str, IntArray]] = {}
    for name, support in zip(names_of(supports), supports, strict=True):
        paths = fixed_dofs(part.mesh, part.form, [support])
        own = {}
        for component, path in part.form.components.items():
            dofs = np.setdiff1d(paths.get(path, []), taken.get(component, []))
            dofs = dofs[dofs < rows].astype(np.int32)
            taken[component] = np.union1d(taken.get(component, []), dofs).astype(np.int32)
            own[component] = dofs
        result[name] = own
    return result
