"""A part thrown by a machine strikes its guard: a polycarbonate panel bolted to a steel frame.

Posts and rails of square tube are beams with a mesh of their own, the panel is a shell, and bolts
join both: beams from the middle of the tube to the panel, by points of either mesh. The script
changes their number, and prints what the part, the panel and the frame do. It runs on one rank or
on several:

    .venv/bin/python demos/machine_guard.py --help
    mpirun -n 2 .venv/bin/python demos/machine_guard.py
"""

from __future__ import annotations

import time
from pathlib import Path

import command_line
import compared
import dolfinx
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

import antiosc as ao

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parent.parent
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
GLASS = {"E": 2.4e9, "nu": 0.38, "rho": 1200.0}  # polycarbonate
WIDE, LOW, TOP, HIGH = 1.2, 0.15, 1.75, 1.8  # of the frame, as in meshes/guard.geo
TUBE, WALL = 40e-3, 3e-3
BOLT = 8e-3
EDGE = 1e-3  # of the thrown part: radius of the corner that strikes, m


def main(
    bolts: tuple[int, ...] = (1, 3),
    thickness: float = 5e-3,
    size: float = 0.06,
    mass: float = 0.1,
    velocity: float = 10.0,
    n: int = 60,
    duration: float = 12e-3,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Strike the panel for each number of bolts; return the numbers of each.

    Parameters
    ----------
    bolts : spaces between bolts along each side of the panel
    thickness : of the panel, m
    size : of the elements of the panel, m
    mass, velocity : of the thrown part, kg and m/s
    n : anti-oscillators
    duration : of the runs, s
    out : folder of the results
    """
    first = MPI.COMM_WORLD.rank == 0
    panel = ao.Shell(**GLASS, thickness=thickness)
    contact = ao.Hertz.from_radii(EDGE, STEEL["E"], STEEL["nu"], E2=GLASS["E"], nu2=GLASS["nu"])
    middle = (WIDE / 2, -TUBE / 2, (LOW + TOP) / 2)
    site = ao.Site(middle, (0, -1, 0), part="panel")
    times = np.linspace(0, duration, 600)
    numbers, lines = {}, {}
    for spaces in bolts:
        started = time.perf_counter()
        part, count = guard(spaces, panel, size)
        model = ao.extract(part, site, n=n)
        hit = ao.simulate(model, ao.RigidMass(mass, velocity), contact, duration)
        sag = ao.probe(part, hit, middle, times=times, part="panel")[:, 1]
        post = ao.probe(part, hit, (0.0, 0.0, HIGH), times=times, part="frame")[:, 1]
        lines[f"{count} bolts"] = -1e3 * sag
        numbers[f"{count} bolts"] = {
            **compared.numbers(part, model, hit, mass, velocity),
            "sag": float(np.abs(sag).max()),
            "post": float(np.abs(post).max()),
            "seconds": time.perf_counter() - started,
        }
        ao.write_series(part, hit, out / f"machine_guard_{count}.pvd", times[:: len(times) // 20])
    if first:
        own = {"panel mm": ("sag", 1e3, ".2f"), "post mm": ("post", 1e3, ".3f")}
        compared.print_table("guard", numbers, own)
        label = "deflection of the panel (mm)"
        compared.plot(times, lines, label, out / "machine_guard.png")
        print(f"written to {out}: machine_guard.png, machine_guard_*.pvd")
    return numbers


def guard(spaces: int, panel: ao.Shell, size: float) -> tuple[ao.Structure, int]:
    """The guard, clamped at its feet, and the number of its bolts."""
    tube = ao.Beam(**STEEL, section=square_tube(TUBE, WALL), orientation=(0, 1, 0))
    mesh = ao.read_mesh(ROOT / "meshes/guard.geo", size=0.05)
    frame = ao.Structure(mesh, {"posts": tube, "rails": tube}, [ao.Support("feet")])
    height = TOP - LOW
    count = [max(4, round(length / size)) for length in (WIDE, height)]
    corners = [np.zeros(2), np.array([WIDE, height])]
    flat = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, count)
    sheet = ao.Structure(ao.read_mesh(flat), panel)
    upright = ao.Placement((0.0, -TUBE / 2, LOW), axis=(1, 0, 0), angle=np.pi / 2)
    shank = ao.Beam(**STEEL, section=ao.Section.circle(BOLT), orientation=(0, 0, 1))
    joints = [
        ao.Bolt(("frame", (x, 0.0, z)), ("panel", (x, -TUBE / 2, z)), shank)
        for x, z in places(spaces)
    ]
    whole = ao.assemble({"frame": frame, "panel": sheet}, joints, {"panel": upright})
    return whole, len(joints)


def places(spaces: int) -> list[tuple[float, float]]:
    """x and z (m) of the bolts around the panel, `spaces` to a side."""
    x, z = np.linspace(0, WIDE, spaces + 1), np.linspace(LOW, TOP, spaces + 1)
    ring = {(float(a), float(b)) for a in x for b in (LOW, TOP)}
    ring |= {(float(a), float(b)) for a in (0.0, WIDE) for b in z}
    return sorted(ring)


def square_tube(width: float, wall: float) -> ao.Section:
    """The section of a square tube."""
    inner = width - 2 * wall
    area, second = width**2 - inner**2, (width**4 - inner**4) / 12
    mean = width - wall  # Bredt: J = 4 A_m² t / perimeter
    return ao.Section(A=area, I=second, J=mean**3 * wall, shear=0.44)


if __name__ == "__main__":
    command_line.command(main)
