"""The parts of an assembly: arguments of `assemble`, parts whole on every rank, rows of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy.sparse
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import coordinates, shown
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.names import known
from antiosc.fem.assembly.superelement import Superelement, of_matrices, of_model
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh.mesh import Mesh, local_groups
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import agreed, alike
from antiosc.fem.structure.matrices import NodalMatrices
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.placement import Placement, in_space, placement
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.models.anti_oscillators import AntiOscillators


def checked_parts(parts: object) -> dict[str, MeshedStructure | Superelement]:
    """Name -> the part."""
    if not isinstance(parts, Mapping) or not parts:
        raise InputError(f"parts must be a dict: name -> Structure; got {shown(parts)}.")
    for name in parts:
        _check_name("part", name)
    found = {name: _part(name, part) for name, part in parts.items()}
    if all(isinstance(part, Superelement) for part in found.values()):
        raise InputError("an assembly needs a part with a mesh; all parts are superelements.")
    return found


def _check_name(what: str, name: object) -> None:
    """InputError for what no joint can name."""
    if not isinstance(name, str) or not name.strip() or not name.isprintable() or ":" in name:
        raise InputError(
            f"a {what}'s name must be a text without a colon, on one line and not empty; got "
            f"{shown(name)}."
        )


def _part(name: str, part: object) -> MeshedStructure | Superelement:
    if isinstance(part, AntiOscillators):
        return of_model(name, part)
    if not isinstance(part, Structure):
        raise InputError(
            f"the part {name!r} must be a Structure, or a model of several sites; got "
            f"{shown(part)}."
        )
    if part.matrices.assembled:
        raise InputError(
            f"the part {name!r} is an assembly itself: give its parts and joints instead, or a "
            "model of its sites."
        )
    if isinstance(part.matrices, NodalMatrices):
        return of_matrices(name, part.matrices)
    text = "the part {!r} has no mesh, and its matrices no map= of nodes, dofs and coordinates."
    return on_mesh(part, text.format(name))


def checked_places(members: Mapping[str, object], at: object) -> dict[str, Placement]:
    """Name -> placement of the part."""
    given = {} if at is None else at
    if not isinstance(given, Mapping):
        raise InputError(f"at must be a dict: name -> Placement or (x, y, z); got {shown(at)}.")
    for name in given:
        if not isinstance(name, str) or name not in members:
            parts = known(name, members, "the parts")
            raise InputError(f"at names {shown(name)}, which is no part; {parts}.")
    return {name: placement(name, given.get(name)) for name in members}


def checked_points(members: Mapping[str, object], points: object) -> dict[str, Array]:
    """Name -> coordinates (3,) of a reference point [m]."""
    given = {} if points is None else points
    if not isinstance(given, Mapping):
        raise InputError(f"points must be a dict: name -> coordinates; got {shown(points)}.")
    found = {}
    for name, x in given.items():
        _check_name("point", name)
        if name in members:
            raise InputError(f"{name!r} names both a part and a reference point.")
        found[name] = in_space(coordinates(f"points[{name!r}]", x))
    return found


def whole(mesh: Mesh) -> Mesh:
    """A copy of `mesh` on this rank alone, with the same nodes, cells and groups on every rank.

    All ranks of the mesh must call it. Nodes keep the numbers with which the mesh was made, cells
    the order in which they were given.
    """
    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices, dtype=np.int64)
    found = mesh.comm.allgather((numbers, mesh.dolfinx.geometry.x[:, : mesh.gdim]))
    most = max((int(own.max()) for own, _ in found if len(own)), default=-1)
    points = np.zeros((most + 1, mesh.gdim))  # zero for numbers that no cell uses
    for own, x in found:
        points[own] = x
    count = compat.cell_map(mesh.dolfinx).size_local
    given = np.asarray(mesh.dolfinx.topology.original_cell_index)[:count]
    nodes = numbers[compat.geometry_nodes(mesh.dolfinx)[:count]]
    given, nodes = (
        np.concatenate(each) for each in zip(*mesh.comm.allgather((given, nodes)), strict=True)
    )
    cells = np.ascontiguousarray(nodes[np.argsort(given, kind="stable")])
    made = compat.create_mesh(MPI.COMM_SELF, cells, points, mesh.cell, mesh.order)
    return Mesh(made, local_groups(made, _groups(mesh, numbers)), mesh.name)


def _groups(mesh: Mesh, numbers: IntArray) -> dict[str, dict[int, IntArray]]:
    """The vertices of all entities of each group, by their numbers."""
    # a collective call of dolfinx: for every dimension on all ranks
    vertices = [numbers[compat.entity_vertices(mesh.dolfinx, d)] for d in range(mesh.tdim + 1)]
    own = {
        name: {dim: vertices[dim][entities] for dim, entities in parts.items()}
        for name, parts in mesh.groups.items()
    }
    joined: dict[str, dict[int, IntArray]] = {name: {} for name in own}
    for part in mesh.comm.allgather(own):
        for name, parts in part.items():
            for dim, entities in parts.items():
                before = joined[name].get(dim)
                joined[name][dim] = entities if before is None else np.vstack([before, entities])
    return joined


Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True)
class Share:
    """Rows `first` to `last` of an assembly, which this rank of `comm` has."""

    comm: MPI.Comm
    first: int
    last: int

    @classmethod
    def of(cls, comm: MPI.Comm, count: int, block: int) -> Share:
        """An equal share of `count` rows, in whole blocks of rows."""
        ends = [block * (count // block * rank // comm.size) for rank in range(comm.size)]
        return cls(comm, ends[comm.rank], [*ends, count][comm.rank + 1])

    @property
    def rows(self) -> slice:
        """The rows of this rank."""
        return slice(self.first, self.last)

    def own(self, q: NDArray[Scalar]) -> NDArray[Scalar]:
        """The rows of this rank of vectors that every rank has whole."""
        return q if self.comm.size == 1 else q[self.first : self.last]

    def whole(self, q: Array) -> Array:
        """Vectors whole, from the rows of each rank; all ranks must call it."""
        return q if self.comm.size == 1 else np.concatenate(self.comm.allgather(q))

    def matrix(self, whole: PETSc.Mat | None, block: int) -> PETSc.Mat:
        """The distributed matrix of one that rank 0 has whole; all ranks must call it."""
        if self.comm.size == 1:
            return whole
        spans = self.comm.gather((self.first, self.last))
        parts: list[scipy.sparse.csr_matrix] = []
        if whole is not None and spans is not None:
            rows = csr(whole)
            parts = [rows[first:last] for first, last in spans]
        own: scipy.sparse.csr_matrix = self.comm.scatter(parts)
        count = (self.last - self.first, own.shape[1])
        arrays = (own.indptr.astype(PETSc.IntType), own.indices.astype(PETSc.IntType), own.data)
        size = ((count[0], count[1]), (count[0], count[1]))
        result = PETSc.Mat().createAIJ(size, csr=arrays, comm=self.comm)
        result.assemble()
        result.setBlockSizes(block, block)
        return result


def communicator(parts: Mapping[str, MeshedStructure | Superelement]) -> MPI.Comm:
    """The communicator of the ranks that share an assembly; InputError where it is not one.

    Parts that every rank has for itself fit any.
    """
    meshed = {n: part.comm for n, part in parts.items() if isinstance(part, MeshedStructure)}
    shared = {name: comm for name, comm in meshed.items() if comm.size > 1}
    for name, comm in shared.items():
        first, other = next(iter(shared.items()))
        if not alike(comm, other):
            raise InputError(
                f"the parts {first!r} and {name!r} are shared by different MPI ranks: read their "
                "meshes with the same comm."
            )
    return next(iter({**shared, **meshed}.values()))


def on_every_rank(
    parts: Mapping[str, MeshedStructure | Superelement], comm: MPI.Comm
) -> dict[str, MeshedStructure | Superelement]:
    """The parts, whole on every rank; all ranks must call it."""
    if comm.size == 1:
        return dict(parts)
    made: dict[int, MeshedStructure] = {}  # one Structure may have several names
    shared = [p for p in parts.values() if not isinstance(p, Superelement) and p.comm.size > 1]
    meshes = {id(part): (part, whole(part.mesh)) for part in {id(p): p for p in shared}.values()}

    def work() -> None:
        for key, (part, mesh) in meshes.items():
            with without_warnings():  # they were told of the part
                made[key] = part.again(mesh)

    agreed(comm, work)
    return {name: made.get(id(part), part) for name, part in parts.items()}
