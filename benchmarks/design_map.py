"""Design maps: seconds of CPU after the hit, for plates of solids and of shells.

Those for 100 000 cells follow from two meshes: some tenths are the same for any.

OMP_NUM_THREADS=1 .venv/bin/python benchmarks/design_map.py [cells along a side]
"""

from __future__ import annotations

import sys
import time
import warnings

import numpy as np
from dolfinx import mesh
from mpi4py import MPI

import antiosc as ao

SIDE, REPEATS = 0.2, 4


def main(solid: int = 24, shell: int = 36) -> dict[str, float]:
    """Seconds for 100 000 cells by each parameter, printed."""
    found = {}
    for name, side, names in (
        ("solid", solid, ("E", "rho")),
        ("shell", shell, ("E", "rho", "thickness")),
    ):
        few, many = (seconds(name, each, names) for each in (side // 2, side))
        for by, (cells, spent) in many.items():
            fewer, before = few[by]
            pace = (spent - before) / (cells - fewer)
            found[f"{name} {by}"] = spent + pace * (1e5 - cells)
            print(f"{name} by {by:9}: {found[f'{name} {by}']:.1f} s for 100 000 cells", flush=True)
    return found


def seconds(name: str, side: int, names: tuple[str, ...]) -> dict[str, tuple[int, float]]:
    """Cells of a plate, and the least seconds of its map by each parameter."""
    comm, radius, found = MPI.COMM_WORLD, 0.3 * SIDE / side, {}
    if name == "solid":
        low, high = [0, 0, 0], [SIDE, SIDE, 0.02]
        cells = mesh.create_box(comm, [low, high], [side, side, max(side // 6, 2)])
        material, top = ao.Solid(70e9, 0.33, 2700.0), 0.02
    else:
        cells = mesh.create_rectangle(comm, [[0, 0], [SIDE, SIDE]], [side, side])
        material, top = ao.Shell(70e9, 0.33, 2700.0, 3e-3), 0.0
    read = ao.read_mesh(cells, gdim=3)
    part = ao.Structure(read, material, [ao.Support(lambda x: x[0] < 1e-6)])
    site = ao.Site((0.1, 0.1, top), (0, 0, -1), radius=max(radius, 6e-3), snap=True)
    model = ao.extract(part, site, n=20)
    hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Linear(model.k0), 2e-3)
    g = ao.gradient(hit, "peak_force", part=part)
    for by in names:
        spent = []
        for _ in range(REPEATS):  # kernels are compiled in the first
            began = time.process_time()
            map_ = ao.design_map(part, hit, "peak_force", by=by)
            spent.append(time.process_time() - began)
        off = abs(float(np.nansum(map_.slopes)) / getattr(g, by) - 1)
        found[by] = read.n_cells, min(spent)
        told = f"{read.n_cells} cells, {part.dofs} dofs, by {by:9}: {min(spent):.2f} s"
        print(f"{name} of {told}; the sum is off by {off:.0e}", flush=True)
    return found


if __name__ == "__main__":
    warnings.simplefilter("ignore", ao.AntioscWarning)
    main(*map(int, sys.argv[1:]))
