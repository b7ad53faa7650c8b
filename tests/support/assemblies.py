"""Parts and dense solutions for tests of assemblies."""

from __future__ import annotations

from collections.abc import Callable

import dolfinx
import numpy as np
import scipy.linalg
import scipy.sparse.linalg
from mpi4py import MPI
from scipy.sparse.linalg import eigsh, norm

import antiosc as ao
from antiosc.fem.assembly.tie import Facets
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.reduce.site import functional

E, NU, RHO = 70e9, 0.3, 2700.0
SOLID = ao.Solid(E, NU, RHO)
BEAM = ao.Beam(E, NU, RHO, ao.Section.rectangle(0.01, 0.02), orientation=(0, 0, 1))

Where = Callable[[np.ndarray], np.ndarray]


def at(axis: int, value: float) -> Where:
    """Points whose coordinate has a value."""
    return lambda x: np.isclose(x[axis], value)


def grouped(mesh: dolfinx.mesh.Mesh, **where: Where) -> Mesh:
    """A mesh with groups of facets on its boundary."""
    dim = mesh.topology.dim - 1
    tags = {}
    for name, marker in where.items():
        facets = np.sort(dolfinx.mesh.locate_entities_boundary(mesh, dim, marker))
        tags[name] = dolfinx.mesh.meshtags(mesh, dim, facets, np.ones(len(facets), np.int32)), 1
    return ao.read_mesh(mesh, groups=tags)


def box(
    low: tuple, high: tuple, n: tuple, cell: str = "hexahedron", comm: MPI.Comm = MPI.COMM_SELF
) -> Mesh:
    """A block (or a rectangle) with groups "x0", "x1", … of its sides."""
    kind = getattr(dolfinx.mesh.CellType, cell)
    corners = [np.array(low, dtype=float), np.array(high, dtype=float)]
    make = dolfinx.mesh.create_box if len(low) == 3 else dolfinx.mesh.create_rectangle
    mesh = make(comm, corners, n, cell_type=kind)
    sides = {
        f"{'xyz'[axis]}{side}": at(axis, ends[axis])
        for axis in range(len(low))
        for side, ends in enumerate((low, high))
    }
    return grouped(mesh, **sides)


def line(start: tuple, end: tuple, n: int, comm: MPI.Comm = MPI.COMM_SELF) -> Mesh:
    """A line with groups "start" and "end" of one point each."""
    x = np.linspace(start, end, n + 1).astype(float)
    cells = np.column_stack([np.arange(n), np.arange(1, n + 1)]).astype(np.int64)
    if comm.rank:
        x, cells = x[:0], cells[:0]
    mesh = compat.create_mesh(comm, cells, x, "interval", 1)

    def near(point: tuple) -> Where:
        return lambda x: np.linalg.norm(x[: len(point)].T - np.array(point), axis=1) < 1e-9

    return grouped(mesh, start=near(start), end=near(end))


def free_dofs(structure: ao.Structure) -> np.ndarray:
    """Dofs that are not held and do not depend on others."""
    return np.setdiff1d(np.arange(structure.size), structure.fixed)


def dense(structure: ao.Structure) -> tuple[np.ndarray, np.ndarray]:
    """K and M of the free dofs."""
    free = free_dofs(structure)
    K, M = (csr(A)[free][:, free].toarray() for A in (structure.K, structure.M))
    return K, M


def eigenfrequencies(structure: ao.Structure, n: int) -> np.ndarray:
    """The lowest n circular frequencies, by ARPACK on the inverse of K + shift M."""
    free = free_dofs(structure)
    K, M = (csr(A)[free][:, free].tocsc() for A in (structure.K, structure.M))
    shift = 1e-6 * norm(K) / norm(M)  # M may be singular, K too
    start = np.random.default_rng(0).standard_normal(len(free))
    x = eigsh(K, n, M, sigma=-shift, v0=start, ncv=4 * n, return_eigenvectors=False)
    return np.sqrt(np.abs(np.sort(x)))


def lowest(structure: ao.Structure, count: int = 6) -> np.ndarray:
    """Lowest ω² of a supported structure, dense; M has zeros at fixed dofs."""
    K, M = (csr(A).toarray() for A in (structure.K, structure.M))
    values = scipy.linalg.eigvalsh((M + M.T) / 2, (K + K.T) / 2)
    return 1 / values[::-1][:count]


def compliances(structure: ao.Structure, *sites: ao.Site) -> np.ndarray:
    """bᵢᵀ K⁻¹ bⱼ by SciPy's sparse LU of the assembled K."""
    B = np.column_stack([functional(structure, site).b for site in sites])
    X = scipy.sparse.linalg.spsolve(csr(structure.K).tocsc(), B)
    return B.T @ X.reshape(B.shape)


def stiffness(structure: ao.Structure, site: ao.Site) -> float:
    return float(1 / compliances(structure, site)[0, 0])


def solved(structure: ao.Structure, b: np.ndarray) -> np.ndarray:
    """q under the load b."""
    free = free_dofs(structure)
    q = np.zeros(structure.size)
    q[free] = scipy.sparse.linalg.spsolve(csr(structure.K)[free][:, free].tocsc(), b[free])
    return q


def static(structure: ao.Structure, site: ao.Site) -> np.ndarray:
    """q under a unit force at a site."""
    return solved(structure, functional(structure, site).b)


def pulled(structure: ao.Structure, part: str, group: str, traction: np.ndarray) -> np.ndarray:
    """u of all parts under a traction (Pa, or N/m) on a group of facets."""
    member = structure.layout.members[part]
    facets = Facets(member, group)
    face, xi, weight = facets.rule()
    load = np.zeros(structure.layout.count)
    for axis, value in enumerate(traction):
        nodes = np.arange(len(member.nodes))
        load[structure.layout.dofs(member, nodes, "xyz"[axis])] = (
            value * facets.basis(face, xi).T @ weight
        )
    return structure.T @ solved(structure, structure.T.T @ load)
