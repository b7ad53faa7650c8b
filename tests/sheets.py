"""Structured meshes of sheets for tests, mapped to any surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from antiosc.fem import compat
from antiosc.fem.mesh import Mesh, read_mesh


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
