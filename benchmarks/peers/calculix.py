"""An impact in CalculiX with meshed contact and in antiosc, on the same mesh of the same part.

A steel sphere of 10 mm radius strikes the centre of a clamped steel plate, 100 x 100 x 6 mm, at
1 m/s (a quarter of both is meshed), or the eye of the aluminium bracket along its normal, at 2 m/s.
All bodies are meshed with quadratic tetrahedra. CalculiX (Debian's calculix-ccx) integrates both
bodies with contact between their surfaces, in implicit and, if asked, in explicit steps; antiosc
reads the part from the same deck and takes a rigid sphere and Hertz's law. The script prints the
figures of all forces, CalculiX's with each step and contact stiffness that is asked for, their
distance from antiosc's force and the CPU seconds, and draws the forces.

    .venv/bin/python benchmarks/peers/calculix.py --help
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

import bodies
import numpy as np
import options
from bodies import Blow
from calculix_deck import deck, forces, part_deck
from numpy.typing import NDArray

import antiosc as ao
from antiosc import plotting

Array = NDArray[np.float64]
Curve = tuple[Array, Array]
ROOT = Path(__file__).resolve().parents[2]
BLOWS = {"plate": bodies.plate, "bracket": bodies.bracket}
#: share of the peak below which the sphere has left
RELEASED = 0.02


def main(
    part: str = "plate",
    near: tuple[float, ...] = (0.35, 0.22),
    steps: tuple[float, ...] = (2e-6,),
    explicit: tuple[float, ...] = (),
    stiffnesses: tuple[float, ...] = (1e7,),
    duration: float = 8e-5,
    n: int = 60,
    out: Path = ROOT / "out" / "peers",
) -> dict[str, dict[str, float]]:
    """Run both programs; return the figures of each run.

    Parameters
    ----------
    part : "plate" or "bracket"
    near : sizes of the elements at the contact, mm; one mesh for each
    steps : of CalculiX's implicit dynamics, s
    explicit : steps of its explicit dynamics, s
    stiffnesses : of its contact, N/mm^3
    duration : simulated time, s
    n : anti-oscillators
    out : folder of the decks and of the picture
    """
    program = shutil.which("ccx")
    if program is None:
        raise ao.InputError("ccx was not found: install Debian's calculix-ccx.")
    out.mkdir(parents=True, exist_ok=True)
    numbers: dict[str, dict[str, float]] = {}
    curves: dict[str, Curve] = {}
    for size in near:
        blow = BLOWS[part](size)
        cells = (len(blow.part.cells), len(blow.ball.cells))
        print(f"{size:g} mm at the contact: {part} {cells[0]}, ball {cells[1]} cells")
        started = time.process_time()
        own = ours(blow, out, duration, n)
        name = f"antiosc, {size:g} mm"
        numbers[name] = {**figures(*own), "CPU s": time.process_time() - started}
        curves[name] = own
        show(name, numbers[name])
        runs = [(step, k, False) for k in stiffnesses for step in steps]
        runs += [(step, k, True) for k in stiffnesses for step in explicit]
        for step, k, forward in runs:
            method = "explicit" if forward else "implicit"
            name = f"ccx {method}, {size:g} mm, {step * 1e6:g} us, {k:g} N/mm3"
            job = f"ccx_{part}_{method}_{size:g}_{step:g}_{k:g}"
            file = out / f"{job}.inp"
            deck(blow, file, step=step, duration=duration, k=k, explicit=forward)
            seconds = run(program, out, job)
            t, piece = forces(out / f"{job}.dat", blow.direction)
            curves[name] = t, blow.pieces * piece
            numbers[name] = {**figures(*curves[name]), "CPU s": seconds}
            numbers[name]["L2 %"] = 100 * distance(own, curves[name])
            show(name, numbers[name])
    plot(curves, out / f"calculix_{part}.png")
    print(f"written to {out}: calculix_{part}.png")
    return numbers


def ours(blow: Blow, out: Path, duration: float, n: int) -> Curve:
    """The force on the whole part, by a piece of the part, of the mass and of the law."""
    path = out / "part.inp"
    part_deck(blow.part, path)
    part = ao.read_model(path, unit="mm")
    site = ao.Site(1e-3 * blow.point, blow.direction, radius=1e-3 * blow.patch, snap=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)  # planes of symmetry cut the patch
        model = ao.extract(part, site, n=n)
    # a piece of the force acts on a piece of the patch
    model = replace(model, local_compliance=blow.pieces * model.local_compliance)
    own, other = blow.ball.material, blow.part.material
    ball = ao.Sphere(1e-3 * blow.radius, E=1e6 * own.E, nu=own.nu, rho=1e12 * own.rho)
    radii = (1e-3 * blow.other_radii[0], 1e-3 * blow.other_radii[1])
    law = ball.hertz(1e6 * other.E, other.nu, radii=radii)
    mass = ao.RigidMass(ball.mass / blow.pieces, velocity=1e-3 * blow.speed)
    hit = ao.simulate(model, mass, ao.Hertz(law.stiffness / blow.pieces), duration=duration)
    return hit.time, blow.pieces * hit.force


def run(program: str, folder: Path, job: str) -> float:
    """CPU seconds of CalculiX on one thread."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with (folder / f"{job}.log").open("w", encoding="utf-8") as log:
        subprocess.run(
            [program, "-i", job],
            cwd=folder,
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


def distance(own: Curve, other: Curve) -> float:
    """How far a force lies from ours, in the mean square over time, relative to ours."""
    t = np.linspace(0.0, min(own[0][-1], other[0][-1]), 2000)
    a, b = np.interp(t, *own), np.interp(t, *other)
    return float(np.linalg.norm(b - a) / np.linalg.norm(a))


def show(name: str, row: dict[str, float]) -> None:
    print(f"{name:<46}" + "  ".join(f"{key} {value:.5g}" for key, value in row.items()), flush=True)


def plot(curves: dict[str, Curve], path: Path) -> None:
    """All forces over time."""
    figure, axes = plotting.panels(1, 1, size=(8, 4))
    (axis,) = axes.ravel()
    for name, (t, force) in curves.items():
        axis.plot(t * 1e6, force, "--" if name.startswith("antiosc") else "-", label=name, lw=1.2)
    axis.set_xlabel("time (µs)")
    axis.set_ylabel("contact force (N)")
    axis.legend(fontsize=8)
    plotting.save_figure(figure, path, dpi=120)


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    several = options.listed(options.positive)
    parser.add_argument("--part", choices=BLOWS, default="plate", help="what is struck")
    parser.add_argument("--near", type=several, default=(0.35, 0.22), help="mm at the contact")
    parser.add_argument("--steps", type=several, default=(2e-6,), help="of implicit dynamics, s")
    parser.add_argument("--explicit", type=several, default=(), help="steps of explicit ones, s")
    parser.add_argument("--stiffnesses", type=several, default=(1e7,), help="N/mm^3")
    parser.add_argument("--duration", type=options.positive, default=8e-5, help="s")
    parser.add_argument("--n", type=options.count, default=60, help="anti-oscillators")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "peers")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
