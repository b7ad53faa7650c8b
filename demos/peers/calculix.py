"""A plate struck by a sphere, in CalculiX with meshed contact and in antiosc on the same mesh.

A quarter of a clamped steel plate, 100 x 100 x 6 mm, and of a steel sphere of 10 mm radius at
1 m/s, both of quadratic tetrahedra. CalculiX (Debian's calculix-ccx) integrates both bodies with
contact between their surfaces; antiosc takes the same quarter of the plate, a rigid sphere and
Hertz's law. The script prints the figures of both forces, CalculiX's with each step and contact
stiffness that is asked for, and the CPU seconds of both, and draws the forces.

    .venv/bin/python demos/peers/calculix.py --help
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import options
from calculix_deck import Blow, Part, deck, forces, meshed
from numpy.typing import NDArray

import antiosc as ao
from antiosc import plotting

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[2]
#: share of the peak below which the sphere has left
RELEASED = 0.02


def main(
    near: tuple[float, ...] = (0.35, 0.22),
    steps: tuple[float, ...] = (2e-6,),
    stiffnesses: tuple[float, ...] = (1e7,),
    duration: float = 8e-5,
    out: Path = ROOT / "out" / "peers",
) -> dict[str, dict[str, float]]:
    """Run both programs; return the figures of each run.

    Parameters
    ----------
    near : sizes of the elements at the contact, mm; one mesh for each
    steps : of CalculiX, s
    stiffnesses : of its contact, N/mm^3
    duration : simulated time, s
    out : folder of the decks and of the picture
    """
    program = shutil.which("ccx")
    if program is None:
        raise ao.InputError("ccx was not found: install Debian's calculix-ccx.")
    out.mkdir(parents=True, exist_ok=True)
    blow = Blow()
    numbers: dict[str, dict[str, float]] = {}
    curves: dict[str, tuple[Array, Array]] = {}
    for size in near:
        plate = meshed(blow, "plate", size, 6.0, 0.7)
        ball = meshed(blow, "ball", size, 4.0, 0.7)
        print(f"{size:g} mm at the contact: plate {len(plate.cells)}, ball {len(ball.cells)} cells")
        name = f"antiosc, {size:g} mm"
        started = time.process_time()
        curves[name] = ours(blow, plate, out, duration)
        numbers[name] = figures(*curves[name])
        numbers[name]["CPU s"] = time.process_time() - started
        show(name, numbers[name])
        for step in steps:
            for k in stiffnesses:
                name = f"ccx, {size:g} mm, {step * 1e6:g} us, {k:g} N/mm3"
                job = out / f"ccx_{size:g}_{step:g}_{k:g}"
                deck(blow, plate, ball, job.with_suffix(".inp"), step=step, duration=duration, k=k)
                seconds = run(program, job)
                t, quarter = forces(job.with_suffix(".dat"))
                curves[name] = t, 4 * quarter
                numbers[name] = figures(*curves[name])
                numbers[name]["CPU s"] = seconds
                show(name, numbers[name])
    plot(curves, out / "calculix.png")
    print(f"written to {out}: calculix.png")
    return numbers


def ours(blow: Blow, plate: Part, out: Path, duration: float) -> tuple[Array, Array]:
    """The force on the whole plate, by a quarter of the plate, of the mass and of the law."""
    path = out / "plate.inp"
    lines = ["*NODE"]
    lines += [f"{i + 1}, {a:.9e}, {b:.9e}, {c:.9e}" for i, (a, b, c) in enumerate(plate.x)]
    lines.append("*ELEMENT, TYPE=C3D10, ELSET=PLATE")
    for i, cell in enumerate(plate.cells):
        lines.append(", ".join(str(n) for n in (i + 1, *(cell + 1))))
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    half = blow.half * 1e-3
    supports = [
        ao.Support(plane=((half, 0, 0), (1, 0, 0))),
        ao.Support(plane=((0, half, 0), (0, 1, 0))),
        ao.Support(lambda x: np.isclose(x[0], 0, atol=1e-9), fix="x"),
        ao.Support(lambda x: np.isclose(x[1], 0, atol=1e-9), fix="y"),
    ]
    E = blow.E * 1e6
    solid = ao.Solid(E=E, nu=blow.nu, rho=blow.rho * 1e12)
    part = ao.Structure(ao.read_mesh(path, unit="mm"), solid, supports)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)  # the planes of symmetry cut the patch
        model = ao.extract(part, ao.Site((0, 0, 0), (0, 0, -1), radius=1e-3), n=60)
    # a quarter of the force acts on a quarter of the patch
    model = replace(model, local_compliance=4 * model.local_compliance)
    ball = ao.Sphere(blow.radius * 1e-3, E=E, nu=blow.nu, rho=blow.rho * 1e12)
    law = ao.Hertz(ball.hertz(E, blow.nu).stiffness / 4)
    mass = ao.RigidMass(ball.mass / 4, velocity=blow.speed * 1e-3)
    hit = ao.simulate(model, mass, law, duration=duration)
    return hit.time, 4 * hit.force


def run(program: str, job: Path) -> float:
    """CPU seconds of CalculiX on one thread."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with job.with_suffix(".log").open("w", encoding="utf-8") as log:
        subprocess.run(
            [program, "-i", job.name],
            cwd=job.parent,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            check=True,
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def figures(t: Array, force: Array) -> dict[str, float]:
    """Peak, its time, release, impulse of a force."""
    peak = int(np.argmax(force))
    after = np.flatnonzero(force[peak:] < RELEASED * force[peak])
    end = t[peak + after[0]] if after.size else float("nan")
    return {
        "peak N": float(force[peak]),
        "at us": float(t[peak] * 1e6),
        "release us": float(end * 1e6),
        "impulse N s": float(np.sum((force[1:] + force[:-1]) / 2 * np.diff(t))),
    }


def show(name: str, row: dict[str, float]) -> None:
    print(f"{name:<34}" + "  ".join(f"{key} {value:.5g}" for key, value in row.items()), flush=True)


def plot(curves: dict[str, tuple[Array, Array]], path: Path) -> None:
    """All forces over time."""
    figure, axes = plotting.panels(1, 1, size=(8, 4))
    (axis,) = axes.ravel()
    for name, (t, force) in curves.items():
        axis.plot(t * 1e6, force, "--" if name.startswith("antiosc") else "-", label=name, lw=1.2)
    axis.set_xlabel("time (us)")
    axis.set_ylabel("contact force (N)")
    axis.legend(fontsize=8)
    plotting.save_figure(figure, path, dpi=120)


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    several = options.listed(options.positive)
    parser.add_argument("--near", type=several, default=(0.35, 0.22), help="mm at the contact")
    parser.add_argument("--steps", type=several, default=(2e-6,), help="of CalculiX, s")
    parser.add_argument("--stiffnesses", type=several, default=(1e7,), help="N/mm^3")
    parser.add_argument("--duration", type=options.positive, default=8e-5, help="s")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "peers")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
