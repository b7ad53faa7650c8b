"""How time and memory of a shell's extraction grow with its size.

A thin supported plate of triangles, struck off its centre: seconds of each stage, microseconds of
assembly per dof, and the peak memory of the process so far.

    .venv/bin/python benchmarks/shell_size.py --help
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Sequence

import dolfinx
import numpy as np
import options
from mpi4py import MPI

import antiosc as ao

ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
SIDE, THICKNESS = 1.0, 2e-3


def main(elements: tuple[int, ...] = (10, 24, 42, 62), n: int = 20) -> list[dict[str, float]]:
    """Extract `n` anti-oscillators of plates with these elements along a side."""
    rows = []
    print("    dofs  assembly (s)  us/dof  factorization (s)  modes (s)  total (s)  memory (GB)")
    for count in elements:
        kind = dolfinx.mesh.CellType.triangle
        corners = [np.zeros(2), np.full(2, SIDE)]
        mesh = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [count, count], kind)
        started = time.perf_counter()
        shell = ao.Shell(**ALUMINIUM, thickness=THICKNESS)
        edges = ao.Support(on_edges, ("x", "y", "z"))
        part = ao.Structure(ao.read_mesh(mesh), shell, [edges])
        model = ao.extract(part, ao.Site((0.41, 0.37, 0), (0, 0, -1)), n=n)
        spent = model.info["seconds"]
        row = {
            "dofs": part.dofs,
            "assembly": spent["assembly"],
            "per_dof": 1e6 * spent["assembly"] / part.dofs,
            "factorization": spent["factorization"],
            "modes": spent["modes"],
            "total": time.perf_counter() - started,
            "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        }
        rows.append(row)
        print(
            f"{row['dofs']:8d} {row['assembly']:13.2f} {row['per_dof']:7.1f} "
            f"{row['factorization']:18.2f} {row['modes']:10.2f} {row['total']:10.2f} "
            f"{row['memory']:12.2f}"
        )
    return rows


def on_edges(x: np.ndarray) -> np.ndarray:
    """Whether points x (3, n) lie on the edges of the square."""
    return np.asarray((np.isclose(x[:2], 0) | np.isclose(x[:2], SIDE)).any(axis=0))


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    sizes = options.listed(options.count)
    parser.add_argument("--elements", type=sizes, default=(10, 24, 42, 62), help="a,b,…")
    parser.add_argument("--n", type=options.count, default=20, help="anti-oscillators")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
