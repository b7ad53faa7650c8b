"""Products with K of a block of quadratic elements: entries, dolfinx with FFCx's action, the cells.

    benchmarks/products.py [CELLS ALONG X [tetrahedron|hexahedron]]

The cells are those of csrc/elastic.c (tetrahedra), or FFCx's action called by csrc/cells.c.

Least milliseconds of ten products on one thread, and the largest difference from the product of the
entries over its largest number.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import multiply, with_entries
from antiosc.fem.platform import compat

STEEL = ao.Solid(210e9, 0.3, 7800.0)
FLAGS = "-O3", "-march=native", "-ffast-math"


def least(work: Callable[[], np.ndarray]) -> tuple[float, np.ndarray]:
    """(seconds, result) of the fastest of ten."""
    times = []
    for _ in range(10):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
    return min(times), result


def action(part: ao.Structure, x: np.ndarray) -> Callable[[], np.ndarray]:
    """The product by FFCx's kernel of the form whose trial function is x."""
    form = part.matrices.form
    u = compat.function_of(form.space, x)
    compiled = compat._compiled(ufl.action(form.stiffness[0], u), FLAGS)
    y = np.zeros(len(u.x.array))

    def product() -> np.ndarray:
        y[:] = 0.0
        dolfinx.fem.assemble_vector(y, compiled)
        return y

    return product


def main(along: int = 24, cell: str = "tetrahedron") -> None:
    """Print the table."""
    corners, cells = [np.zeros(3), np.array([0.2, 0.1, 0.08])], [along, along // 2, along // 2]
    mesh = dolfinx.mesh.create_box(
        MPI.COMM_SELF, corners, cells, getattr(dolfinx.mesh.CellType, cell)
    )
    held = ao.Support(lambda x: np.isclose(x[0], 0.0))
    part = ao.Structure(ao.read_mesh(mesh, comm=MPI.COMM_SELF), STEEL, [held])
    x = np.random.default_rng(0).standard_normal(part.rows)
    x[part.fixed] = 0.0
    free = np.setdiff1d(np.arange(part.rows), part.fixed)
    K = with_entries(part.K)
    source, target = K.createVecs()
    source.setArray(x)

    def entries() -> np.ndarray:
        K.mult(source, target)
        return target.array_r

    ways = {
        "entries (PETSc AIJ)": entries,
        "FFCx action": action(part, x),
        "cells": lambda: multiply(part.K, x),
    }
    exact = entries().copy()[free]
    print(f"{part.rows} dofs")
    for name, work in ways.items():
        seconds, y = least(work)
        error = np.abs(y[free] - exact).max() / np.abs(exact).max()
        print(f"{name:20s} {1e3 * seconds:8.2f} ms  {error:.0e}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:3])
