"""A steel ball falls on the lid of a box; the circuit board in it stands on four spacers.

Box, board and spacers have a mesh each: two of shells, four of solids. The spacers are welded to
both by the mean motion of their ends. Beside it stands the same box with spacers that are springs
of the stiffness of a short beam. The script prints the accelerations of a chip on the board, and
draws them. It runs on one rank or on several:

    .venv/bin/python demos/board_on_spacers.py --help
    mpirun -n 2 .venv/bin/python demos/board_on_spacers.py
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
ABS = {"E": 2.3e9, "nu": 0.36, "rho": 1050.0, "thickness": 3e-3}
LAMINATE = {"E": 22e9, "nu": 0.15, "rho": 1900.0, "thickness": 1.6e-3}
NYLON = {"E": 3e9, "nu": 0.35, "rho": 1150.0}
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
SIZE = np.array([0.16, 0.10, 0.05])  # of the box, as in meshes/enclosure.geo
BOARD, BELOW = (0.14, 0.08), (0.01, 0.01)  # size of the board, and its place from the box's corner
SCREWS = {"sw": (0.015, 0.015), "se": (0.145, 0.015), "nw": (0.015, 0.085), "ne": (0.145, 0.085)}
WIDE, HIGH = 8e-3, 12e-3  # a spacer, m
CHIP = (0.095, 0.06)  # on the board, m
TRANSFORMER = ((0.05, 0.04), 0.03)  # where (m), how heavy (kg)
STRUCK = (0.07, 0.05)  # on the lid, m
G0 = 9.81  # m/s²


def main(
    size: float = 8e-3,
    height: float = 0.05,
    radius: float = 8e-3,
    n: int = 60,
    duration: float = 6e-3,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Drop the ball on both boxes; return the numbers of each.

    Parameters
    ----------
    size : of the elements of box and board, m
    height : of the fall, m
    radius : of the ball, m
    n : anti-oscillators
    duration : of the runs, s
    out : folder of the results
    """
    first = MPI.COMM_WORLD.rank == 0
    ball = ao.Sphere(radius=radius, **STEEL, velocity=float(np.sqrt(2 * G0 * height)))
    contact = ball.hertz(ABS["E"], ABS["nu"])
    site = ao.Site((*STRUCK, SIZE[2]), (0, 0, -1), part="box")
    times = np.linspace(0, duration, 1500)
    numbers, lines = {}, {}
    for name, build in (("solid spacers", with_solids), ("springs", with_springs)):
        started = time.perf_counter()
        part = build(size)
        model = ao.extract(part, site, n=n)
        hit = ao.simulate(model, ball, contact, duration)
        chip = ao.probe(part, hit, (*CHIP, HIGH), "acceleration", times, part="board")
        moved = ao.probe(part, hit, (*CHIP, HIGH), "displacement", times, part="board")
        lines[name] = chip[:, 2] / G0
        numbers[name] = {
            **compared.numbers(part, model, hit, ball.mass, ball.velocity),
            "chip": float(np.abs(chip).max()),
            "moved": float(np.abs(moved).max()),
            "seconds": time.perf_counter() - started,
        }
    if first:
        out.mkdir(parents=True, exist_ok=True)
        compared.print_table("spacers", numbers, {"chip g": ("chip", 1 / G0, ".1f")})
        label = "acceleration of the chip (g)"
        compared.plot(times, lines, label, out / "board_on_spacers.png")
        print(f"written to {out}: board_on_spacers.png")
    return numbers


def with_solids(size: float) -> ao.Structure:
    """The box with its board on four solid spacers."""
    corners = [np.zeros(3), np.array([WIDE, WIDE, HIGH])]
    block = dolfinx.mesh.create_box(
        MPI.COMM_WORLD, corners, [2, 2, 3], dolfinx.mesh.CellType.hexahedron
    )
    groups = {"bottom": ends(block, 0.0), "top": ends(block, HIGH)}
    spacer = ao.Structure(ao.read_mesh(block, groups=groups), ao.Solid(**NYLON))
    joints = []
    for name, (x, y) in SCREWS.items():
        joints.append(ao.Weld(("box", (x, y, 0.0)), f"{name}:bottom"))
        joints.append(ao.Weld(("board", (x, y, HIGH)), f"{name}:top"))
    at = {name: (x - WIDE / 2, y - WIDE / 2, 0.0) for name, (x, y) in SCREWS.items()}
    return assembled(size, dict.fromkeys(SCREWS, spacer), joints, at)


def with_springs(size: float) -> ao.Structure:
    """The same with springs: those of a short beam from end to end, at its middle."""
    E, G = NYLON["E"], NYLON["E"] / (2 * (1 + NYLON["nu"]))
    area, second, torsion = WIDE**2, WIDE**4 / 12, 0.1406 * WIDE**4
    softer = 1 + 12 * E * second / (5 / 6 * G * area * HIGH**2)  # by its shear
    across = 12 * E * second / (HIGH**3 * softer)
    stiffness = {
        **dict.fromkeys(("x", "y"), across),
        "z": E * area / HIGH,
        **dict.fromkeys(("rx", "ry"), E * second / HIGH),
        "rz": G * torsion / HIGH,
    }
    joints = [
        ao.Bushing(("box", (x, y, 0.0)), ("board", (x, y, HIGH)), stiffness, (x, y, HIGH / 2))
        for x, y in SCREWS.values()
    ]
    return assembled(size, {}, joints, {})


def assembled(
    size: float,
    spacers: dict[str, ao.Structure],
    joints: list[ao.Weld] | list[ao.Bushing],
    at: dict[str, tuple[float, float, float]],
) -> ao.Structure:
    """Box, board and spacers; the box stands on its four corners."""
    mesh = ao.read_mesh(ROOT / "meshes/enclosure.geo", size=size)
    count = [max(4, round(length / size)) for length in BOARD]
    sheet = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, [np.zeros(2), np.array(BOARD)], count)
    box = ao.Structure(mesh, ao.Shell(**ABS), [ao.Support(feet, ("x", "y", "z"))])
    board = ao.Structure(ao.read_mesh(sheet), ao.Shell(**LAMINATE))
    (x, y), mass = TRANSFORMER
    return ao.assemble(
        {"box": box, "board": board, **spacers},
        joints,
        {"board": (*BELOW, HIGH), **at},
        attached=[ao.PointMass((x, y, HIGH), mass)],
    )


def feet(x: Array) -> Array:
    """The lower corners of the box."""
    at_end = [np.isclose(x[k], 0.0) | np.isclose(x[k], SIZE[k]) for k in (0, 1)]
    corner: Array = at_end[0] & at_end[1] & np.isclose(x[2], 0.0)
    return corner


def ends(block: dolfinx.mesh.Mesh, z: float) -> tuple[dolfinx.mesh.MeshTags, int]:
    """The faces of a spacer at a height, as a group."""
    faces = dolfinx.mesh.locate_entities_boundary(block, 2, lambda x: np.isclose(x[2], z))
    return dolfinx.mesh.meshtags(block, 2, np.sort(faces), np.ones(len(faces), np.int32)), 1


if __name__ == "__main__":
    command_line.command(main)
