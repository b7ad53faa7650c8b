"""What an assembly costs beside one mesh with the same dofs: the table in benchmarks/speed.

A steel bar of hexahedra is cut in two. The halves have meshes that do not match and are tied. The
CPU seconds of assembly, joints, factorization and extraction are compared with those of the bar in
one mesh.

    .venv/bin/python benchmarks/assembly_speed.py --help
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import dolfinx
import numpy as np
import options
from mpi4py import MPI

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
LENGTH, SIDE = 0.3, 0.1
STEPS = ("assembly", "joints", "factorization", "extraction")
T = TypeVar("T")
#: Anti-oscillators of the models.
MANY = 20


def main(
    sizes: tuple[int, ...] = (8, 16), rounds: int = 2, out: Path = ROOT / "benchmarks/speed"
) -> dict[int, float]:
    """Measure each size; return the ratio of the CPU seconds.

    Parameters
    ----------
    sizes : elements along a side of the section
    rounds : of which the quickest counts
    out : folder of the table
    """
    lines, ratios = [], {}
    for size in sizes:
        rows = {}
        for name, build in (("one mesh", one), ("two, tied", two)):
            found = [measured(build, size) for _ in range(rounds)]
            rows[name] = min(found, key=lambda row: sum(row[step] for step in STEPS))
        totals = {name: sum(row[step] for step in STEPS) for name, row in rows.items()}
        ratios[size] = totals["two, tied"] / totals["one mesh"]
        ratios[size] *= rows["one mesh"]["dofs"] / rows["two, tied"]["dofs"]
        for name, row in rows.items():
            seconds = " | ".join(f"{row[step]:.2f}" for step in STEPS)
            ratio = f"{ratios[size]:.2f}" if name != "one mesh" else ""
            total = f"{totals[name]:.2f}"
            lines.append(f"| {row['dofs']:.0f} | {name} | {seconds} | {total} | {ratio} |")
        print(*lines[-2:], sep="\n")
    out.mkdir(parents=True, exist_ok=True)
    head = f"| dofs | bar | {' | '.join(STEPS)} | sum | ratio per dof |"
    text = [
        "# What an assembly costs beside one mesh",
        "",
        "Written by `benchmarks/assembly_speed.py`: CPU seconds of one process, the quickest of "
        f"{rounds} runs. {options.code_state()}",
        "",
        head,
        "|---" * (len(STEPS) + 4) + "|",
        *lines,
    ]
    (out / "assembly_speed.md").write_text("\n".join(text) + "\n")
    return ratios


def measured(build: Callable[[int, dict[str, float]], ao.Structure], size: int) -> dict[str, float]:
    """CPU seconds of the steps for a bar, and its dofs."""
    seconds = dict.fromkeys(STEPS, 0.0)
    part = build(size, seconds)
    site = ao.Site((LENGTH, SIDE / 2, SIDE / 2), (-1, 0, 0))
    clock(part.factorize, seconds, "factorization")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)  # a point load on a solid
        clock(lambda: ao.extract(part, site, n=MANY), seconds, "extraction")
    return {"dofs": part.dofs, **seconds}


def one(size: int, seconds: dict[str, float]) -> ao.Structure:
    """The bar in one mesh."""
    mesh = bar(LENGTH, (3 * size, size, size))
    return clock(lambda: steel(mesh, held=True), seconds, "assembly")


def two(size: int, seconds: dict[str, float]) -> ao.Structure:
    """The bar in two halves, whose meshes do not match."""
    half, long = LENGTH / 2, 3 * size // 2
    meshes = bar(half, (long, size, size)), bar(half, (long - 1, size + 1, size))
    parts = clock(
        lambda: {"left": steel(meshes[0], held=True), "right": steel(meshes[1], held=False)},
        seconds,
        "assembly",
    )
    tie, at = ao.Tie("left:end", "right:start"), {"right": (half, 0.0, 0.0)}
    return clock(lambda: ao.assemble(parts, [tie], at), seconds, "joints")


def bar(length: float, counts: tuple[int, int, int]) -> ao.Mesh:
    """A bar of hexahedra along x with groups of its ends."""
    corners = [np.zeros(3), np.array([length, SIDE, SIDE])]
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, corners, counts, dolfinx.mesh.CellType.hexahedron)
    groups = {}
    for name, x in (("start", 0.0), ("end", length)):
        faces = dolfinx.mesh.locate_entities_boundary(mesh, 2, lambda p, x=x: np.isclose(p[0], x))
        tags = dolfinx.mesh.meshtags(mesh, 2, np.sort(faces), np.ones(len(faces), np.int32))
        groups[name] = tags, 1
    return ao.read_mesh(mesh, groups=groups)


def steel(mesh: ao.Mesh, held: bool) -> ao.Structure:
    """A part of steel, held at its start or free."""
    return ao.Structure(mesh, ao.Solid(**STEEL), [ao.Support("start")] if held else [])


def clock(work: Callable[[], T], seconds: dict[str, float], step: str) -> T:
    """The result of `work`, whose CPU seconds are added to those of a step."""
    started = time.process_time()
    result = work()
    seconds[step] += time.process_time() - started
    return result


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--sizes", type=options.listed(options.count), default=(8, 16), help="elements to a side"
    )
    parser.add_argument("--rounds", type=options.count, default=2)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks/speed")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
