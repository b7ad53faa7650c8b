"""A box of electronics is dropped in 26 orientations: on faces, edges and corners.

The box is a shell of ABS; two circuit boards stand in it on four spacers each, the upper one with a
heavy part. Its free modes are computed once; every orientation is a `drop` until the first impact
is over, in which one to four corners touch. The script prints the peak accelerations of the boards
and draws them over the orientations.

    .venv/bin/python benchmarks/drop_on_corners.py --help
"""

from __future__ import annotations

import time
from itertools import product
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from options import command, compared

import antiosc as ao
from antiosc import plotting

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parent.parent
ABS = {"E": 2.3e9, "nu": 0.36, "rho": 1050.0, "thickness": 3e-3}
LAMINATE = {"E": 22e9, "nu": 0.15, "rho": 1900.0, "thickness": 1.6e-3}
SIZE = np.array([0.16, 0.10, 0.05])  # of the box, as in meshes/enclosure.geo
MIDDLE = (0.08, 0.05)  # of the boards
BOARD, BELOW = (0.14, 0.08), (0.01, 0.01)  # size of a board, and its place from the box's corner
SCREWS = [(0.015, 0.015), (0.145, 0.015), (0.015, 0.085), (0.145, 0.085)]
HEIGHTS = {"lower": 0.012, "upper": 0.032}  # of the boards over the bottom
HEAVY = ((0.095, 0.06, 0.032), 0.04)  # a transformer: where (m), how heavy (kg)
NYLON = {"x": 2e5, "y": 2e5, "z": 3e6, "rx": 5.0, "ry": 5.0, "rz": 2.0}  # a spacer, N/m, N m/rad
CORNER = 4e6  # N/m^3/2, of a rounded corner of ABS on concrete
DAMPING = 0.02


def main(
    height: float = 0.75,
    n: int = 120,
    size: float = 16e-3,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Drop the box in all orientations; return the numbers of each.

    Parameters
    ----------
    height : of the fall, m
    n : free modes
    size : of the elements, m
    out : folder of the results
    """
    started = time.perf_counter()
    part = box(size)
    floor = ao.Floor(law=ao.Power(CORNER, 1.5))
    numbers, shown, body = {}, {}, None
    for name in orientations():
        kind, lowest = name.split()
        fall = ao.drop(
            body or part, height, floor=floor, until=1, modes=n, damping=DAMPING, **{kind: lowest}
        )
        if body is None:
            print(f"{part.describe()}; modes in {time.perf_counter() - started:.1f} s")
            body, started = fall.body, time.perf_counter()
        numbers[name], shown[name] = figures(fall)
    seconds = time.perf_counter() - started
    columns = {
        "corners": ("corners", 1.0, ".0f"),
        "peak force N": ("peak force", 1.0, ".0f"),
        "lower board g": ("lower", 1 / 9.81, ".0f"),
        "upper g": ("upper", 1 / 9.81, ".0f"),
    }
    compared.table("falls on", numbers, columns)
    print(f"{len(numbers)} orientations in {seconds:.1f} s, {seconds / len(numbers):.2f} s each")
    out.mkdir(parents=True, exist_ok=True)
    plot(numbers, shown, out / "drop_on_corners.png")
    print(f"written to {out}: drop_on_corners.png")
    return numbers


def box(size: float) -> ao.Structure:
    """The box with its boards and spacers."""
    mesh = ao.read_mesh(ROOT / "meshes/enclosure.geo", size=size)
    count = [max(4, round(length / size)) for length in BOARD]
    sheet = dolfinx.mesh.create_rectangle(MPI.COMM_SELF, [np.zeros(2), np.array(BOARD)], count)
    board = ao.Structure(ao.read_mesh(sheet), ao.Shell(**LAMINATE))
    parts = {"box": ao.Structure(mesh, ao.Shell(**ABS)), **dict.fromkeys(HEIGHTS, board)}
    spacers = [
        ao.Bushing(("box", (x, y, 0.0)), (name, (x, y, z)), NYLON, point=(x, y, z / 2))
        for name, z in HEIGHTS.items()
        for x, y in SCREWS
    ]
    at = {name: (*BELOW, z) for name, z in HEIGHTS.items()}
    return ao.assemble(parts, spacers, at, attached=[ao.PointMass(*HEAVY)])


def orientations() -> list[str]:
    """Names "face -z", "edge -x-z", "corner -x-y-z": what is lowest, 6 + 12 + 8 of them."""
    kinds = {1: "face", 2: "edge", 3: "corner"}
    names = []
    for signs in product((0, 1, -1), repeat=3):
        count = int(np.abs(signs).sum())
        if count:
            down = "".join("+-"[s < 0] + axis for s, axis in zip(signs, "xyz", strict=True) if s)
            names.append(f"{kinds[count]} {down}")
    return names


def figures(fall: ao.Fall) -> tuple[dict[str, float], tuple[Array, Array]]:
    """The numbers of the first impact, and the acceleration of the upper board over time."""
    boards = {name: fall.signal((*MIDDLE, z)) for name, z in HEIGHTS.items()}
    size = {name: np.linalg.norm(a, axis=1) for name, (_, a) in boards.items()}
    hit = fall.impacts[0]
    change = fall.episodes[-1].end.velocity - fall.episodes[0].start.velocity
    numbers = {name: float(a.max()) for name, a in size.items()} | {
        "peak force": hit.peak_force,
        "corners": float(hit.contacts),
        "impulse": hit.impulse,
        "momentum": fall.body.mass * float(change[2] + 9.81 * hit.contact_time),
        "lost": hit.lost,
    }
    t = boards["upper"][0]
    return numbers, (t - t[0], size["upper"])


def plot(
    numbers: dict[str, dict[str, float]], shown: dict[str, tuple[Array, Array]], path: Path
) -> None:
    """Peak accelerations of all orientations, and that of the upper board for the worst of each."""
    figure, axes = plotting.panels(1, 2, size=(9, 6))
    bars, lines = axes.ravel()
    names = sorted(numbers, key=lambda name: (len(name), name))
    place = np.arange(len(names))
    for shift, board in ((-0.2, "lower"), (0.2, "upper")):
        values = [numbers[name][board] / 9.81 for name in names]
        bars.barh(place + shift, values, height=0.4, label=f"{board} board")
    bars.set_yticks(place, names, fontsize=8)
    bars.set_xlabel("peak acceleration (g)")
    bars.legend()
    for kind in ("face", "edge", "corner"):
        of_kind = [name for name in names if name.startswith(kind)]
        worst = max(of_kind, key=lambda name: numbers[name]["upper"])
        t, a = shown[worst]
        lines.plot(t * 1e3, a / 9.81, label=worst, linewidth=1)
    lines.set_xlabel("time (ms)")
    lines.set_ylabel("acceleration of the upper board (g)")
    lines.legend()
    plotting.save_figure(figure, path, dpi=120)


if __name__ == "__main__":
    command(main)
