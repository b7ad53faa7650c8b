"""Structured meshes of sheets for tests, mapped to any surface; sections, supports, responses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import dolfinx
import numpy as np
import scipy.sparse.linalg
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.reading import read_mesh
from antiosc.fem.platform import compat

E, NU, RHO = 70e9, 0.3, 2700.0
CELLS = ["triangle", "quadrilateral"]
#: the ply of Reddy's tables: E1/E2 = 40, G12 = G13 = 0.6 E2, G23 = 0.5 E2, ν12 = 0.25
PLY = ao.Layer(400e9, 10e9, 0.25, 6e9, 6e9, 5e9, 1500.0, 1e-3)
SHEET = ao.Shell(E, 0.0, RHO, 0.004)
RIB = ao.Beam(E, 0.0, RHO, ao.Section.rectangle(0.004, 0.03), orientation=(0, 0, 1), offset=0.017)


def sheet(
    n: int | tuple[int, int],
    surface: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, ...]],
    cell: str = "triangle",
    order: int = 1,
    comm: MPI.Comm = MPI.COMM_WORLD,
    alternate: bool = True,
) -> Mesh:
    """The surface (s, t) in [0, 1]² -> coordinates, n × n squares or twice as many triangles.

    Triangles: the diagonals turn from square to square, unless not `alternate`.
    """
    nx, ny = (n, n) if isinstance(n, int) else n
    s, t = np.meshgrid(
        np.linspace(0, 1, order * nx + 1), np.linspace(0, 1, order * ny + 1), indexing="ij"
    )
    x = np.stack([np.broadcast_to(c, s.shape) for c in surface(s, t)], axis=-1)
    number = np.arange(s.size).reshape(s.shape)
    i, j = (k.ravel() * order for k in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))

    def node(a: float, b: float) -> np.ndarray:
        return number[i + int(a * order), j + int(b * order)]

    if cell == "quadrilateral":
        corners = [(0, 0), (1, 0), (0, 1), (1, 1)]
        rows = [corners]
        middle = [(0.5, 0), (0, 0.5), (1, 0.5), (0.5, 1), (0.5, 0.5)]
        if order == 2:
            rows = [corners + middle]
        cells = np.column_stack([node(*p) for p in rows[0]])
    else:
        halves = {
            0: [[(0, 0), (1, 0), (0, 1)], [(1, 1), (0, 1), (1, 0)]],
            1: [[(1, 0), (1, 1), (0, 0)], [(0, 1), (0, 0), (1, 1)]],
        }
        parts = []
        for parity, triangles in halves.items():
            mine = ((i + j) // order * alternate) % 2 == parity
            for corners in triangles:
                nodes = list(corners)
                if order == 2:
                    a, b, c = map(np.array, corners)
                    nodes += [tuple((p + q) / 2) for p, q in ((b, c), (a, c), (a, b))]
                parts.append(np.column_stack([node(*p)[mine] for p in nodes]))
        cells = np.vstack(parts)
    points = x.reshape(-1, x.shape[-1])
    if comm.rank:
        cells, points = cells[:0], points[:0]
    return read_mesh(compat.create_mesh(comm, cells, points.copy(), cell, order))


def rectangle(
    n: int | tuple[int, int], a: float, b: float, cell: str = "triangle", gdim: int = 3
) -> Mesh:
    """[0, a] × [0, b], in space (z = 0) or in the plane."""
    return sheet(n, lambda s, t: (a * s, b * t, 0 * s)[:gdim], cell)


def edges(*axes, size=1.0):
    """Whether points lie on the edges across these axes of a square."""
    return lambda x: np.any([np.isclose(x[a], 0) | np.isclose(x[a], size) for a in axes], axis=0)


def at(axis, value):
    return lambda x: np.isclose(x[axis], value, atol=1e-6)


#: held as in Mindlin's double series: no rotation along the edge
SIMPLE = [
    ao.Support(edges(0, 1), "z"),
    ao.Support(edges(0), ("y", "rx")),
    ao.Support(edges(1), ("x", "ry")),
]


def plate(n, t, cell="triangle", supports=SIMPLE, **options):
    if cell == "one way":  # triangles, the diagonals parallel
        mesh = sheet(n, lambda s, v: (s, v, 0 * s), alternate=False)
    else:
        mesh = rectangle(n, 1.0, 1.0, cell, **options)
    return ao.Structure(mesh, ao.Shell(E, NU, RHO, t), supports)


def frequencies(structure, count):
    """Lowest natural circular frequencies."""
    free = np.setdiff1d(np.arange(structure.K.getSize()[0]), structure.fixed)
    K, M = (csr(matrix)[free][:, free].tocsc() for matrix in (structure.K, structure.M))
    values = scipy.sparse.linalg.eigsh(
        K, count, M, sigma=-structure.shift, return_eigenvectors=False, v0=np.ones(len(free))
    )
    return np.sqrt(np.maximum(np.sort(values), 0.0))


def dof(structure, point, component):
    dofs, x = compat.dof_coordinates(structure.form.space, structure.form.components[component])
    distance = np.linalg.norm(x - point, axis=1)
    assert distance.min() < 1e-6
    return dofs[distance.argmin()]


def loaded(structure, forces):
    """Static response to {dof: force}."""
    b = np.zeros(structure.K.getSize()[0])
    for number, force in forces.items():
        b[number] = force
    b[structure.fixed] = 0.0
    return structure.factorize().solve_checked(b)


def pressed(structure, force):
    """Static response to a force per area (3,)."""
    load = compat.assemble_functional(
        structure.form.along(force) * measure(structure.mesh, 6), structure.form.space
    )
    load[structure.fixed] = 0.0
    return structure.factorize().solve_checked(load)


def interpolated(structure, field):
    """Dof values of x (n, 3) -> {component: values}."""
    values = np.zeros(structure.K.getSize()[0])
    for name, path in structure.form.components.items():
        dofs, x = compat.dof_coordinates(structure.form.space, path)
        values[dofs] = field(x).get(name, 0.0)
    return values


def stack(angles, thickness, ply=PLY):
    """Equal plies of this total thickness."""
    return [replace(ply, angle=a, thickness=thickness / len(angles)) for a in angles]


def unsymmetric(thickness):
    """A stack that couples everything, its mass off the middle."""
    foil = ao.Layer.isotropic(E, NU, 5 * RHO, thickness / 5)
    return [*stack([20, 90, -35], 4 / 5 * thickness), foil]


def flipped(mesh, some):
    """The mesh with `some` of its cells turned over."""
    flip = {"triangle": [0, 2, 1], "quadrilateral": [0, 2, 1, 3]}[mesh.cell]
    cells = compat.geometry_nodes(mesh.dolfinx).astype(np.int64)
    cells[some] = cells[some][:, flip]
    x = mesh.dolfinx.geometry.x.copy()
    return ao.read_mesh(compat.create_mesh(mesh.comm, cells, x, mesh.cell, 1))


def grouped(mesh, edges=None, points=None):
    """The mesh with its cells as "sheet", and edges and vertices there as "rib" and "feet"."""
    cells = compat.cell_index_map(mesh.dolfinx)
    groups = {"sheet": {2: np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)}}
    for name, dim, where in (("rib", 1, edges), ("feet", 0, points)):
        if where is not None:
            found = dolfinx.mesh.locate_entities(mesh.dolfinx, dim, where)
            groups[name] = {dim: found.astype(np.int32)}
    return Mesh(mesh.dolfinx, groups, "the panel")
