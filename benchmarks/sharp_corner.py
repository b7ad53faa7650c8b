"""Peak force of a block that falls on a sharp corner, by the size of the cells there.

    python benchmarks/sharp_corner.py [--cells 12 4 2 1]

The corner radius, 1 mm unless it is given, bounds what the corner gives way: the force must not
depend on the mesh. A plastic block of 120 × 60 × 20 mm, 1 m, tilt (25, 30, 0), on concrete.
"""

from __future__ import annotations

import argparse
import time

import antiosc as ao

SIZE, LOW = (0.12, 0.06, 0.02), (0.12, 0.0, 0.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=float, nargs="+", default=[12, 4, 2, 1], help="in mm")
    plastic = ao.Solid(E=2.3e9, nu=0.36, rho=1050.0)
    floor = ao.Floor(ao.Solid(E=30e9, nu=0.2, rho=2400.0))
    print("cells mm    dofs   peak N   CPU s")
    for cell in parser.parse_args().cells:
        started = time.process_time()
        refined = [] if cell == 12 else [(LOW, cell / 1e3)]
        part = ao.Structure(ao.box_mesh(SIZE, 0.012, refine=refined), plastic)
        fall = ao.drop(part, 1.0, (25, 30, 0), floor, until=1, modes=12)
        spent = time.process_time() - started
        print(f"{cell:8g} {part.dofs:7d} {fall.peak_force:8.1f} {spent:7.1f}", flush=True)


if __name__ == "__main__":
    main()
