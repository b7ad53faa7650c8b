"""Exported runs in other programs: FMPy and a C compiler beside a scene's run.

Random impacts are exported, and their forces and seconds compared with those of `Scene.run`.

    .venv/bin/python -m pip install fmpy        (it is not in Debian)
    .venv/bin/python benchmarks/exports.py --scenes 20
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import fmpy
import numpy as np
from fmpy.validation import validate_fmu

import antiosc as ao

STEPS = (1, 10, 100, 1000)  # communication steps over the duration
TOL = 1e-6


def main(scenes: int, seed: int) -> None:
    """Print the worst errors of random impacts, and median times."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(scenes):
        with tempfile.TemporaryDirectory() as folder:
            rows.append(_impact(Path(folder), rng, k))
    print(f"{scenes} random impacts, seed {seed}; relative errors: worst, seconds: median")
    for name in rows[0]:
        values = [row[name] for row in rows if name in row]
        worst = np.median(values) if name.endswith("s") else np.max(values)
        print(f"  {name:<48} {worst:.2g}")


def _impact(folder: Path, rng: np.random.Generator, k: int) -> dict[str, float]:
    """One random impact, exported in all forms."""
    n = int(rng.integers(1, 25))
    model = ao.AntiOscillators(
        m0=float(rng.choice([1e-4, 1e-3, 1e-2])),
        k0=float(10 ** rng.uniform(4, 7)),
        m=10 ** rng.uniform(-3, -0.5, n),
        omega=np.sort(10 ** rng.uniform(2.5, 5, n)),
    )
    radius, speed = float(rng.uniform(5e-3, 3e-2)), float(10 ** rng.uniform(-1.5, 0.7))
    ball = ao.Sphere(radius=radius, E=210e9, nu=0.3, rho=7850.0, velocity=speed)
    hertz = ball.hertz(E=70e9, nu=0.33)
    damped, plastic = ao.HuntCrossley(hertz.stiffness, 0.2), ao.Thornton(hertz.stiffness, 5e-6)
    law = (ao.Linear(1e7), hertz, damped, plastic)[k % 4]
    duration = 20 / ao.impact_band(ball, law)
    scene = ao.Scene({"part": model, "ball": ball}, [ao.Contact("part", "ball", law)])
    started = time.perf_counter()
    hit = scene.run(duration, tol=TOL)["part", "ball"]
    row = {"Scene.run, s": time.perf_counter() - started}
    for fmi in (2, 3):
        file = folder / f"fmi{fmi}.fmu"
        ao.export(model, file, ball, law, duration=duration, tol=TOL, fmi=fmi)
        row |= {f"FMI {fmi}: {name}": x for name, x in _in_fmpy(file, hit, duration).items()}
    ao.export(model, folder / "a.c", ball, law, duration=duration, tol=TOL)
    row["C file: force, L2"] = _in_c(folder, hit)
    return row


def _difference(hit: ao.ContactHistory, t: np.ndarray, found: np.ndarray) -> float:
    """L2 difference of forces from those of a history, the parabolas of its steps."""
    at = np.searchsorted(hit.time[::2], t, side="right") - 1
    at = 2 * np.clip(at, 0, (hit.time.size - 3) // 2)
    length = hit.time[at + 2] - hit.time[at]
    u = (t - hit.time[at]) / np.where(length > 0, length, np.inf)
    f0, f1, f2 = (hit.force[at + k] for k in range(3))
    force = f0 + u * (4 * f1 - 3 * f0 - f2 + 2 * u * (f0 - 2 * f1 + f2))
    return float(np.linalg.norm(found - force) / np.linalg.norm(force))


def _in_fmpy(file: Path, hit: ao.ContactHistory, duration: float) -> dict[str, float]:
    row = {"problems of validate_fmu": float(len(validate_fmu(str(file))))}
    peaks = []
    for steps in STEPS:
        h = duration / steps
        started = time.perf_counter()
        found = fmpy.simulate_fmu(str(file), stop_time=duration, output_interval=h, step_size=h)
        row[f"{STEPS[-1]} steps, s"] = time.perf_counter() - started
        peaks.append(float(found["peak_force"][-1]))
    row["force, L2"] = _difference(hit, found["time"], found["force"])
    row["peak force"] = abs(peaks[-1] / hit.peak_force - 1)
    row["peak force, from step to step"] = float(np.ptp(peaks)) / peaks[-1]
    return row


def _in_c(folder: Path, hit: ao.ContactHistory) -> float:
    build = ["cc", "-std=c99", "-O2", "-DA_MAIN", "-o", "a.out", "a.c", "-lm"]
    subprocess.run(build, cwd=folder, check=True)
    table = subprocess.run([folder / "a.out"], capture_output=True, text=True, check=True).stdout
    rows = np.array([line.split() for line in table.splitlines()], dtype=float)
    return _difference(hit, rows[:, 0], rows[:, 1])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    main(arguments.scenes, arguments.seed)
