"""A machine guard: a thrown rubber wheel strikes a polycarbonate panel, bolted to a steel frame.

Posts, rails and bolts are beams, the panel is a shell. How much does the number of bolts matter?
"""

from __future__ import annotations

from pathlib import Path

import command_line
import compared
import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao
from antiosc import plotting

ROOT = Path(__file__).resolve().parent.parent
STEEL = "steel S235"
WIDE, LOW, TOP, HIGH = 1.2, 0.15, 1.75, 1.8  # of the frame, as in meshes/guard.geo
TUBE, WALL = 40e-3, 3e-3  # square; its torsion is Bredt's, 4 A_m² t / perimeter
AREA, SECOND = TUBE**2 - (TUBE - 2 * WALL) ** 2, (TUBE**4 - (TUBE - 2 * WALL) ** 4) / 12
SQUARE = {"A": AREA, "I": SECOND, "J": (TUBE - WALL) ** 3 * WALL, "shear": 0.44}
BOLT = 8e-3


def main(
    bolts: tuple[int, ...] = (1, 3),
    thickness: float = 5e-3,
    size: float = 0.06,
    mass: float = 0.1,
    velocity: float = 1.2,
    n: int = 160,
    duration: float = 20e-3,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Strike the panel for each number of bolts; return its numbers.

    Parameters
    ----------
    bolts : spaces between bolts along each side of the panel
    thickness, size : of the panel and of its elements, m
    mass, velocity : of the thrown part, kg and m/s
    n, duration : anti-oscillators, time simulated (s)
    out : folder of the results
    """
    panel = ao.material("PC", thickness=thickness)
    thrown = ao.RigidMass(mass, velocity, tip_radius=0.03, material="rubber NR 60 IRHD")
    middle = (WIDE / 2, -TUBE / 2, (LOW + TOP) / 2)
    site = ao.Site(middle, (0, -1, 0), part="panel")
    times = np.linspace(0, duration, 600)
    numbers, lines = {}, {}
    for spaces in bolts:
        part, count = guard(spaces, panel, size)
        model = ao.extract(part, site, n=n)
        hit = ao.simulate(model, thrown, duration=duration)
        sag = ao.probe(part, hit, middle, times=times, part="panel")[:, 1]
        post = ao.probe(part, hit, (0.0, 0.0, HIGH), times=times, part="frame")[:, 1]
        lines[f"{count} bolts"] = -1e3 * sag
        moved = {"sag": float(np.abs(sag).max()), "post": float(np.abs(post).max())}
        numbers[f"{count} bolts"] = compared.numbers(part, model, hit, mass, velocity) | moved
        ao.write_series(part, hit, out / f"machine_guard_{count}.pvd", times[:: len(times) // 20])
    if MPI.COMM_WORLD.size == 1:
        picture, arrow = out / "machine_guard_part.png", {"point": middle, "direction": (0, -1, 0)}
        plotting.plot_deformed(part, hit, picture, **arrow, view=(15, -60))
    if MPI.COMM_WORLD.rank == 0:
        own = {"panel mm": ("sag", 1e3, ".2f"), "post mm": ("post", 1e3, ".3f")}
        compared.print_table("guard", numbers, own)
        compared.plot(times, lines, "deflection of the panel (mm)", out / "machine_guard.png")
    return numbers


def guard(spaces: int, panel: ao.Shell, size: float) -> tuple[ao.Structure, int]:
    """The guard, clamped at its feet, and the number of its bolts."""
    tube = ao.material(STEEL, section=ao.Section(**SQUARE), orientation=(0, 1, 0))
    mesh = ao.read_mesh(ROOT / "meshes/guard.geo", size=0.05)
    frame = ao.Structure(mesh, {"posts": tube, "rails": tube}, [ao.Support("feet")])
    sides = np.array([WIDE, TOP - LOW])
    count = [max(4, round(length / size)) for length in sides]
    flat = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, [np.zeros(2), sides], count)
    sheet = ao.Structure(ao.read_mesh(flat), panel)
    upright = ao.Placement((0.0, -TUBE / 2, LOW), axis=(1, 0, 0), angle=np.pi / 2)
    shank = ao.material(STEEL, section=ao.Section.circle(BOLT), orientation=(0, 0, 1))
    ends = [(("frame", (x, 0.0, z)), ("panel", (x, -TUBE / 2, z))) for x, z in places(spaces)]
    joints = [ao.Bolt(*pair, shank) for pair in ends]
    return ao.assemble({"frame": frame, "panel": sheet}, joints, {"panel": upright}), len(joints)


def places(spaces: int) -> list[tuple[float, float]]:
    """x and z (m) of the bolts around the panel, `spaces` to a side."""
    x, z = np.linspace(0, WIDE, spaces + 1), np.linspace(LOW, TOP, spaces + 1)
    ring = {(float(a), float(b)) for a in x for b in (LOW, TOP)}
    ring |= {(float(a), float(b)) for a in (0.0, WIDE) for b in z}
    return sorted(ring)


if __name__ == "__main__":
    command_line.command(main)
