"""An assembly: a ball falls on a box; the circuit board in it stands on four spacers.

Beside it: the same box with springs as spacers. The chip's acceleration is filtered (SAE J211).
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import command_line
import compared
import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao
from antiosc import plotting

ROOT = Path(__file__).resolve().parent.parent
ABS = ao.material("ABS", thickness=3e-3)
LAMINATE = ao.Shell(E=22e9, nu=0.15, rho=1900.0, thickness=1.6e-3)  # glass in epoxy
NYLON = ao.material("PA66 dry")
BOARD = (0.14, 0.08)  # its size, m
SCREWS = {"sw": (0.015, 0.015), "se": (0.145, 0.015), "nw": (0.015, 0.085), "ne": (0.145, 0.085)}
WIDE, HIGH = 8e-3, 12e-3  # a spacer, m; below, its stiffness as a beam with shear, N/m and N m
SPRING = {"x": 2.914e6, "y": 2.914e6, "z": 1.6e7, "rx": 85.33, "ry": 85.33, "rz": 53.32}
CHIP, STRUCK = (0.095, 0.06, HIGH), (0.07, 0.05, 0.05)  # on the board, on the lid


def main(
    size: float = 12e-3, n: int = 120, duration: float = 6e-3, out: Path = ROOT / "out"
) -> dict[str, dict[str, float]]:
    """Drop the ball on both boxes; return their numbers.

    Parameters
    ----------
    size : of the elements of box and board, m
    n, duration : anti-oscillators, time simulated (s)
    out : folder of the results
    """
    ball = ao.Sphere(radius=8e-3, material="bearing steel 100Cr6", velocity=1.0)
    times, numbers, lines = np.linspace(0, duration, 1500), {}, {}
    for name, spacers in {"solid spacers": solids(), "springs": ({}, springs(), {})}.items():
        part = assembled(size, *spacers)
        model = ao.extract(part, ao.Site(STRUCK, (0, 0, -1), part="box"), n=n)
        hit = ao.simulate(model, ball, duration=duration)
        numbers[name] = compared.numbers(part, model, hit, ball.mass, ball.velocity)
        chip = partial(ao.probe, part, hit, CHIP, times=times, part="board")
        felt = chip("acceleration", filter="CFC1000")  # without it n decides
        numbers[name]["moved"] = float(np.abs(chip("displacement")).max())
        numbers[name]["chip"], lines[name] = float(np.abs(felt).max()), felt[:, 2] / 9.80665
    out.mkdir(parents=True, exist_ok=True)
    compared.print_table("spacers", numbers, {"chip g": ("chip", 1 / 9.80665, ".1f")})
    compared.plot(times, lines, "chip (g, CFC1000)", out / "board_on_spacers.png")
    arrow = {"point": STRUCK, "direction": (0, 0, -1)}
    plotting.plot_deformed(part, hit, out / "board_on_spacers_part.png", **arrow)
    return numbers


def solids() -> tuple[dict[str, ao.Structure], list[ao.Weld], dict[str, tuple[float, ...]]]:
    """Four solid spacers, their welds to box and board, and their places."""
    corners, hexahedra = [np.zeros(3), [WIDE, WIDE, HIGH]], dolfinx.mesh.CellType.hexahedron
    block = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, [2, 2, 3], hexahedra)
    groups = {}
    for name, z in {"bottom": 0.0, "top": HIGH}.items():
        at_z = partial(lambda z, x: np.isclose(x[2], z), z)
        faces = np.sort(dolfinx.mesh.locate_entities_boundary(block, 2, at_z))
        groups[name] = dolfinx.mesh.meshtags(block, 2, faces, np.ones_like(faces)), 1
    spacer = ao.Structure(ao.read_mesh(block, groups=groups), NYLON)
    joints = [ao.Weld(("box", (x, y, 0.0)), f"{name}:bottom") for name, (x, y) in SCREWS.items()]
    joints += [ao.Weld(("board", (x, y, HIGH)), f"{name}:top") for name, (x, y) in SCREWS.items()]
    at = {name: (x - WIDE / 2, y - WIDE / 2, 0.0) for name, (x, y) in SCREWS.items()}
    return dict.fromkeys(SCREWS, spacer), joints, at


def springs() -> list[ao.Bushing]:
    """The same as springs between box and board, at the middle of each spacer."""
    places = [((x, y, 0.0), (x, y, HIGH), (x, y, HIGH / 2)) for x, y in SCREWS.values()]
    return [ao.Bushing(("box", a), ("board", b), SPRING, middle) for a, b, middle in places]


def assembled(size: float, spacers: dict, joints: list, at: dict) -> ao.Structure:
    """Box, board and spacers; the box stands on its four corners."""
    mesh = ao.read_mesh(ROOT / "meshes/enclosure.geo", size=size)
    count = [max(4, round(length / size)) for length in BOARD]
    sheet = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, [np.zeros(2), np.array(BOARD)], count)
    corners = [((x, y, 0.0), 1e-6) for x in (0.0, 0.16) for y in (0.0, 0.10)]
    feet = [ao.Support(near=corner, fix=("x", "y", "z")) for corner in corners]
    board = ao.Structure(ao.read_mesh(sheet), LAMINATE)
    parts = {"box": ao.Structure(mesh, ABS, feet), "board": board}
    at = {"board": (0.01, 0.01, HIGH), **at}
    heavy = [ao.PointMass((0.05, 0.04, HIGH), 0.03)]  # a transformer
    return ao.assemble({**parts, **spacers}, joints, at, attached=heavy)


if __name__ == "__main__":
    command_line.command(main)
