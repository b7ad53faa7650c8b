"""Design maps: seconds after the hit, for parts of many cells, and how far from re-extraction.

OMP_NUM_THREADS=1 .venv/bin/python benchmarks/design_map.py [cells]
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path

import numpy as np

import antiosc as ao

MESHES = Path(__file__).resolve().parent.parent / "meshes"
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}


def main(cells: int = 100_000) -> None:
    """Seconds of maps by each parameter of a bracket of tetrahedra, printed."""
    size = 5.24e-3 * (10_000 / cells) ** (1 / 3)
    mesh = ao.read_mesh(MESHES / "bracket.geo", size=size)
    part = ao.Structure(mesh, ao.Solid(70e9, 0.33, 2700.0), [ao.Support("clamp")])
    site = ao.Site((0.010, 0.030, 0.050), (-1, 0, 0), radius=6e-3, snap=True)
    model = ao.extract(part, site, n=20)
    hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 2e-3)
    print(f"{mesh.n_cells} cells, {part.dofs} dofs")
    for by in ("E", "rho"):
        g = ao.gradient(hit, "peak_force", part=part)
        spent = []
        for _ in range(3):
            began = time.process_time()
            found = ao.design_map(part, hit, "peak_force", by=by)
            spent.append(time.process_time() - began)
        whole = getattr(g, by)
        off = abs(np.nansum(found.slopes) / whole - 1)
        told = ", ".join(f"{each:.2f}" for each in spent)
        print(f"by {by:4} {told} s of CPU; the sum over all cells is off by {off:.1e}", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore", ao.AntioscWarning)
    main(*map(int, sys.argv[1:]))
