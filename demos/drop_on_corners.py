"""A box of electronics is dropped in 26 orientations: on faces, edges and corners.

The box is a shell of ABS; two circuit boards stand in it on four spacers each, the upper one with a
heavy part. One model with ten sites is extracted (the eight corners and the middles of the boards,
each in three directions); every orientation is a `Scene` of that model, whose corners fall on the
floor, one to four of them at once. The script prints the peak accelerations of the boards and draws
them over the orientations. Rotations are small: a run covers the first blow.

    .venv/bin/python demos/drop_on_corners.py --help
"""

from __future__ import annotations

import time
import warnings
from itertools import product
from math import sqrt
from pathlib import Path

import command_line
import compared
import dolfinx
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

import antiosc as ao
from antiosc import plotting

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parent.parent
ABS = {"E": 2.3e9, "nu": 0.36, "rho": 1050.0, "thickness": 3e-3}
LAMINATE = {"E": 22e9, "nu": 0.15, "rho": 1900.0, "thickness": 1.6e-3}
SIZE = np.array([0.16, 0.10, 0.05])  # of the box, as in meshes/enclosure.geo
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
    duration: float = 4e-3,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Drop the box in all orientations; return the numbers of each.

    Parameters
    ----------
    height : of the fall, m
    n : anti-oscillators
    size : of the elements, m
    duration : of each run, from the touch, s
    out : folder of the results
    """
    started = time.perf_counter()
    part = box(size)
    with warnings.catch_warnings():
        # the patch of a corner is no half-space; the law of the contact holds its compliance
        warnings.filterwarnings("ignore", "an edge cuts the patch", ao.AccuracyWarning)
        model = ao.extract(part, sites(), n=n).site_modes()
    print(f"{part.describe()}, {part.mass:.3f} kg; model in {time.perf_counter() - started:.1f} s")
    started = time.perf_counter()
    numbers, shown = {}, {}
    for name, up in orientations().items():
        hit = dropped(model, up, sqrt(2 * 9.81 * height)).run(duration)
        numbers[name], shown[name] = figures(hit, part.mass)
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


def sites() -> dict[str, ao.Site]:
    """The corners of the box and the middles of the boards, in three directions each."""
    found = {}
    for i, corner in enumerate(product((0.0, 1.0), repeat=3)):
        point = tuple(SIZE * corner)
        found[f"corner {i}"] = ao.Site(point, (0, 0, 1), part="box", tangential=True)
    for name, z in HEIGHTS.items():
        middle = (SIZE[0] / 2, SIZE[1] / 2, z)
        found[name] = ao.Site(middle, (0, 0, 1), part=name, tangential=True)
    return found


def orientations() -> dict[str, Array]:
    """Name -> direction (3,) in the box that points up: 6 faces, 12 edges, 8 corners."""
    kinds = {1: "face", 2: "edge", 3: "corner"}
    found = {}
    for signs in product((0, 1, -1), repeat=3):
        count = int(np.abs(signs).sum())
        if count:
            # an edge or a corner strikes first where the box stands on it in balance
            up = np.array(signs) * SIZE if count > 1 else np.array(signs, dtype=float)
            down = "".join("+-"[s > 0] + axis for s, axis in zip(signs, "xyz", strict=True) if s)
            found[f"{kinds[count]} {down}"] = up / np.linalg.norm(up)
    return found


def dropped(model: ao.SiteModes, up: Array, speed: float) -> ao.Scene:
    """The scene of a fall on the corners; `up` in the axes of the box."""
    corners = [name for name in model.sites if name.startswith("corner")]
    assert model.directions is not None
    turned = np.zeros((model.b.shape[1], len(corners)))
    for k, name in enumerate(corners):
        columns = list(model.sites[name])
        turned[columns, k] = model.directions[columns] @ up
    keep = [c for name in HEIGHTS for c in model.sites[name]]
    change = np.column_stack((turned, np.eye(model.b.shape[1])[:, keep]))
    first = len(corners)
    named = {name: (k,) for k, name in enumerate(corners)}
    named |= {b: tuple(first + 3 * i + j for j in range(3)) for i, b in enumerate(HEIGHTS)}
    body = ao.SiteModes(
        model.omega,
        model.b @ change,
        named,
        r=change.T @ model.r @ change,
        directions=np.vstack((np.tile(up, (first, 1)), model.directions[keep])),
        decay=np.where(model.omega > 0, DAMPING * model.omega, 0.0),
        inertia=model.inertia,
    )
    heights = np.array([np.dot(SIZE * corner, up) for corner in product((0.0, 1.0), repeat=3)])
    gaps = np.round(heights - heights.min(), 12)
    contacts = [
        ao.Contact(f"box:{name}", "floor", ao.Power(CORNER, 1.5), gap=float(gap))
        for name, gap in zip(corners, gaps, strict=True)
    ]
    return ao.Scene(
        {"box": body, "floor": ao.Obstacle()},
        contacts,
        gravity=(-9.81 * up).tolist(),
        motion={"box": ao.Motion(velocity=(-speed * up).tolist())},
    )


def figures(hit: ao.SceneHistory, mass: float) -> tuple[dict[str, float], tuple[Array, Array]]:
    """The numbers of a run, and the acceleration of the upper board over time."""
    t = np.linspace(0, hit.time[-1], 4000)
    box = hit.at(t)["box"]
    boards = {
        name: np.linalg.norm([box.acceleration(name, axis) for axis in np.eye(3)], axis=0)
        for name in HEIGHTS
    }
    forces = [hit[c.a, c.b] for c in hit.assembly.scene.contacts]
    P = hit.bodies["box"].momentum
    gravity = np.array(hit.assembly.scene.gravity)
    return {
        "lower": boards["lower"].max(),
        "upper": boards["upper"].max(),
        "peak force": max(one.peak_force for one in forces),
        "corners": float(sum(one.impulse > 0 for one in forces)),
        "impulse": sum(one.impulse for one in forces),
        "momentum": float(np.linalg.norm(P[-1] - P[0] - mass * gravity * hit.time[-1])),
        "drift": hit.energy.drift,
        "status": float(hit.status),
        "force at the end": sum(float(one.force[-1]) for one in forces),
    }, (t, boards["upper"])


def plot(
    numbers: dict[str, dict[str, float]], shown: dict[str, tuple[Array, Array]], path: Path
) -> None:
    """Peak accelerations of all orientations, and that of the upper board for the worst of each."""
    figure, axes = plotting.panels(1, 2, size=(11, 5))
    bars, lines = axes.ravel()
    names = sorted(numbers, key=lambda name: (len(name), name))
    place = np.arange(len(names))
    for shift, board in ((-0.2, "lower"), (0.2, "upper")):
        values = [numbers[name][board] / 9.81 for name in names]
        bars.barh(place + shift, values, height=0.4, label=f"{board} board")
    bars.set_yticks(place, names, fontsize=7)
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
    command_line.command(main)
