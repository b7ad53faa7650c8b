"""Design maps: seconds after the hit, for plates of solids and of shells of 100 000 cells.

The model is that of a coarse plate; on the large one smooth fields stand for its shapes, for which
the time is the same. The check that the part is that of the model, a product with K, is left out.
On the coarse plate the sum of the map is compared with the derivative by the whole part.

.venv/bin/python benchmarks/design_map.py [cells along a side: solid, shell]
"""

from __future__ import annotations

import sys
import time
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from dolfinx import mesh
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.structure.structure import on_mesh
from antiosc_studies.gradients import of_part

SIDE, COARSE, REPEATS = 0.2, 18, 3


def main(solid: int = 46, shell: int = 223) -> dict[str, float]:
    """Seconds for a map by each parameter, printed."""
    found = {}
    for name, side, names in (
        ("solid", solid, ("E", "rho")),
        ("shell", shell, ("E", "rho", "thickness")),
    ):
        part, site = plate(name, COARSE)
        model = ao.extract(part, site, n=20)
        hit = struck(model)
        g = ao.gradient(hit, "peak_force", part=part)
        for by in names:
            map_ = ao.design_map(part, hit, "peak_force", by=by)
            off = abs(float(np.nansum(map_.slopes)) / getattr(g, by) - 1)
            print(f"{name} of {map_.slopes.size} cells by {by:9}: the sum is off by {off:.0e}")
        part, _ = plate(name, side)
        hit = struck(replace(model, shapes=smooth(on_mesh(part), model.n + 1)))
        for by in names:
            spent, wall, cells = least(part, hit, by)
            found[f"{name} {by}"] = spent
            told = f"{name} of {cells} cells, {part.dofs} dofs, by {by:9}"
            print(f"{told}: {spent:.2f} s of CPU, {wall:.2f} s of the clock", flush=True)
    return found


def plate(name: str, side: int) -> tuple[ao.Structure, ao.Site]:
    """A clamped plate with so many cells along a side, and where it is struck."""
    comm, top = MPI.COMM_WORLD, 0.0
    material: Any = ao.Shell(70e9, 0.33, 2700.0, 3e-3)
    if name == "solid":
        material, top = ao.Solid(70e9, 0.33, 2700.0), 0.02
        low, high = [0, 0, 0], [SIDE, SIDE, top]
        cells = mesh.create_box(comm, [low, high], [side, side, max(side // 6, 2)])
    else:
        cells = mesh.create_rectangle(comm, [[0, 0], [SIDE, SIDE]], [side, side])
    read = ao.read_mesh(cells, gdim=3)
    part = ao.Structure(read, material, [ao.Support(lambda x: x[0] < 1e-6)])
    return part, ao.Site((0.1, 0.1, top), (0, 0, -1), radius=6e-3, snap=True)


def struck(model: ao.AntiOscillators) -> ao.History:
    """The blow of a mass."""
    return ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Linear(model.k0), 2e-3)


def smooth(part: Any, count: int) -> np.ndarray:
    """Waves (rows, count) in all components of the motion."""
    space = part.form.space
    x, size = space.tabulate_dof_coordinates(), space.dofmap.index_map_bs
    waves = [
        np.sin((1 + k % 5) * np.pi * x[:, 0] / SIDE + c)
        * np.cos((1 + k // 5) * np.pi * x[:, 1] / SIDE)
        for k in range(count) for c in range(size)
    ]  # fmt: skip
    return np.reshape(waves, (count, size, len(x))).transpose(2, 1, 0).reshape(-1, count)


def least(part: ao.Structure, hit: ao.History, by: str) -> tuple[float, float, int]:
    """Seconds of CPU and of the clock of a map, the least of some, and its cells."""
    checked, spent = of_part.checked_shapes, []
    of_part.checked_shapes = lambda *_: None
    try:
        for _ in range(REPEATS):  # kernels are compiled in the first
            began = time.process_time(), time.perf_counter()
            map_ = ao.design_map(part, hit, "peak_force", by=by)
            spent.append((time.process_time() - began[0], time.perf_counter() - began[1]))
    finally:
        of_part.checked_shapes = checked
    cpu, wall = (min(one) for one in zip(*spent, strict=True))
    return cpu, wall, map_.slopes.size


if __name__ == "__main__":
    warnings.simplefilter("ignore", ao.AntioscWarning)
    main(*map(int, sys.argv[1:]))
