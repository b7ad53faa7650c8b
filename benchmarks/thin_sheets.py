"""Impacts on sheets that stretch: a few modes against all degrees of freedom on the same mesh.

The reference (`tests/support/full_second_order.py`) has every nodal displacement, the whole
second-order strain (von Kármán's on flat sheets), the average acceleration and Newton's method in
each step. Of the disc there is von Kármán's theory without a mesh, too
(`tests/support/von_karman.py`).
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))

import antiosc as ao
from antiosc.reduce.extraction.stretching import with_stretch
from full_second_order import Full
from sheets import sheet
from von_karman import Disc

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}


def disc(n=10, radius=0.1, rise=0.0, thickness=1e-3):
    """A clamped disc or shallow cap of quadrilaterals mapped from a square."""

    def surface(s, t):
        x, y = 2 * s - 1, 2 * t - 1
        big = np.maximum(np.abs(x), np.abs(y))
        r = np.hypot(x, y)
        scale = np.where(r > 0, big / np.where(r > 0, r, 1.0), 1.0)
        scale = (1 - big**2) + big**2 * scale
        x, y = radius * x * scale, radius * y * scale
        return x, y, rise * (1 - (x**2 + y**2) / radius**2)

    mesh = sheet(n, surface, "triangle", 2)
    rim = ao.Support(lambda x: np.hypot(x[0], x[1]) > radius * (1 - 1e-3))
    return ao.Structure(mesh, ao.Shell(thickness=thickness, **STEEL), [rim]), ao.Site(
        (0, 0, rise), (0, 0, -1), snap=True
    )


def rectangle(n=(9, 6), thickness=1e-3):
    """A clamped plate of 300 × 200 mm, struck off its centre."""
    mesh = sheet(n, lambda s, t: (0.3 * s, 0.2 * t, 0 * s))

    def rim(x):
        return np.isclose(x[0] * (0.3 - x[0]), 0) | np.isclose(x[1] * (0.2 - x[1]), 0)

    part = ao.Structure(mesh, ao.Shell(thickness=thickness, **STEEL), [ao.Support(rim)])
    return part, ao.Site((0.1, 0.075, 0), (0, 0, -1), snap=True)


def laminate(n=(9, 6)):
    """An unsymmetric laminate with the edges of the rectangle."""
    layer = ao.Layer(130e9, 9e9, 0.3, 5e9, 5e9, 3.5e9, 1600.0, 0.25e-3)
    layers = [replace(layer, angle=angle) for angle in (0, 90, 0, 45)]
    mesh = sheet(n, lambda s, t: (0.3 * s, 0.2 * t, 0 * s))

    def rim(x):
        return np.isclose(x[0] * (0.3 - x[0]), 0) | np.isclose(x[1] * (0.2 - x[1]), 0)

    part = ao.Structure(mesh, ao.Laminate(layers, axis=(1, 0, 0)), [ao.Support(rim)])
    return part, ao.Site((0.1, 0.1, 0), (0, 0, -1), snap=True)


def folded(n=(8, 5)):
    """A sheet folded by 20 degrees along its middle, clamped all around."""
    rise = 0.15 * np.tan(np.radians(20.0))

    def surface(s, t):
        return 0.3 * s, 0.2 * t, rise * (1 - np.abs(2 * s - 1))

    mesh = sheet(n, surface)

    def rim(x):
        return np.isclose(x[0] * (0.3 - x[0]), 0) | np.isclose(x[1] * (0.2 - x[1]), 0)

    part = ao.Structure(mesh, ao.Shell(thickness=1e-3, **STEEL), [ao.Support(rim)])
    normal = np.array([-np.sin(np.radians(20.0)), 0, np.cos(np.radians(20.0))])
    return part, ao.Site((0.075, 0.1, rise / 2), tuple(-normal), snap=True)


CASES = {  # part, (mass, speed, k, duration)
    "disc, 0.4": (disc, (0.2, 0.83, 2e5, 6e-3)),
    "disc, 0.9": (disc, (0.2, 1.75, 2e5, 6e-3)),
    "disc, 1.8": (disc, (0.2, 4.3, 2e5, 6e-3)),
    "cap": (lambda: disc(rise=2e-3), (2.0, 0.2, 5e7, 20e-3)),
    "cap, snaps": (lambda: disc(rise=2e-3), (2.0, 1.0, 5e7, 20e-3)),
    "rectangle": (rectangle, (0.2, 1.5, 1e6, 8e-3)),
    "laminate": (laminate, (0.1, 2.0, 1e6, 6e-3)),
    "folded": (folded, (0.2, 1.5, 1e6, 6e-3)),
}


def main(names: list[str], steps: int = 300, counts: tuple = ("auto",)) -> None:
    """Print the errors of force and deflection for each case."""
    for name in names or list(CASES):
        make, (mass, speed, k, duration) = CASES[name]
        part, site = make()
        exponent = 1.5
        h = 1e-3
        started = time.perf_counter()
        full = Full(part, site)
        _, force, moved = full.impact(mass, speed, k, duration, steps)
        spent = time.perf_counter() - started
        print(
            f"{name}: {part.dofs} dofs, full {force.max():.5g} N, {1e3 * moved.max():.5g} mm,"
            f" {spent:.0f} s",
            flush=True,
        )
        if make is disc:
            known_force, known_most = Disc(0.1, h, **STEEL).impact(mass, speed, k, duration)
            print(f"  von Kármán {known_force:.5g} N, {1e3 * known_most:.5g} mm", flush=True)
        for count in (False, *counts):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                started = time.perf_counter()
                model = ao.extract(part, site, n=40, stretch=count)
                made = time.perf_counter() - started
                cpu = time.process_time()
                hit = ao.simulate(
                    model, ao.RigidMass(mass, velocity=speed), ao.Power(k, exponent), duration
                )
                cpu = time.process_time() - cpu
            taken = sum(one.size for one in hit.assembly.stretched.values())
            w = np.abs(hit.displacement).max()
            peak, most = hit.peak_force / force.max() - 1, w / moved.max() - 1
            known = hit.error.get("stretch peak_force", 0.0)
            print(
                f"  {count!s:6} {taken:2d} modes: peak {peak:+.2%} deflection {most:+.2%}"
                f" w/h {w / h:.2f} model {made:.2f} s run {1e3 * cpu:.1f} ms"
                f" drift {hit.energy.drift:.1e} m against m + 2 {known:.1e}",
                flush=True,
            )


def bend(part, motion) -> float:
    """Largest distance [m] of a flat free sheet's nodes from their plane, of motion (n, dofs)."""
    w = motion.reshape(len(motion), -1, 6)[:, :, 2]
    x = part.matrices.form.space.tabulate_dof_coordinates()
    plane = np.column_stack([np.ones(len(x)), x[:, :2]])
    return float(np.abs(w - (plane @ np.linalg.lstsq(plane, w.T, rcond=None)[0]).T).max())


def free_sheets() -> None:
    """What a sheet that nothing holds stretches: 300 × 200 × 1 mm, struck by 0.5 kg."""
    warnings.simplefilter("ignore")
    mesh = sheet((6, 4), lambda s, t: (0.3 * s, 0.2 * t, 0 * s))
    part, law = ao.Structure(mesh, ao.Shell(thickness=1e-3, **STEEL)), ao.Power(1e6, 1.5)
    places = {"middle": (0.15, 0.1), "off": (0.1, 0.1), "edge": (0.15, 0.0), "corner": (0.0, 0.0)}
    for name, at in places.items():
        site = ao.Site((*at, 0.0), (0, 0, -1), snap=True)
        full, model = Full(part, site), ao.extract(part, site, n=24, stretch="auto")
        for speed in (0.15, 0.3, 0.6, 1.0):
            _, force, _ = full.impact(0.5, speed, 1e6, 6e-3, 240)
            ball = ao.RigidMass(0.5, velocity=speed)
            linear, auto = (
                ao.simulate(one, ball, law, 6e-3).peak_force / force.max() - 1
                for one in (replace(model, stretch=None), model)
            )
            print(
                f"{name} bend/h {bend(part, full.motion) / 1e-3:.2f}: force linear {linear:+.2%}"
                f" auto {auto:+.2%}",
                flush=True,
            )


def fastest(model, speed: float, runs: int = 30) -> float:
    """The least wall time [s] of an impact on the disc."""
    ball, law = ao.RigidMass(0.2, velocity=speed), ao.Power(2e5, 1.5)
    spent = []
    for _ in range(runs):
        started = time.perf_counter()
        ao.simulate(model, ball, law, 6e-3)
        spent.append(time.perf_counter() - started)
    return min(spent)


def times() -> None:
    """Times of impacts on the disc with four motions, beside those of linear ones."""
    warnings.simplefilter("ignore")
    part, site = disc()
    linear, four = (ao.extract(part, site, n=40, stretch=count) for count in (False, 4))
    for speed in (0.4, 1.1, 3.0):
        one, other = fastest(linear, speed), fastest(four, speed)
        print(
            f"{speed} m/s: linear {1e3 * one:.2f} ms, four motions {1e3 * other:.2f} ms,"
            f" {other / one:.1f} times"
        )


def tensors() -> None:
    """CPU seconds of the second-order forces: of four motions, two to compare, and of "auto"."""
    warnings.simplefilter("ignore")
    for cells in ((10, 10), (43, 43)):
        part, site = rectangle(cells)
        model = ao.extract(part, site, n=20, shapes=True)
        for count in (4, "auto"):
            spent = []
            for _ in range(3):
                started = time.process_time()
                found = with_stretch(part, model, count).stretch
                spent.append(time.process_time() - started)
            print(f"{part.dofs} dofs, {found.size} motions: {min(spent):.2f} s", flush=True)


if __name__ == "__main__":
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("cases", nargs="*")
    reader.add_argument("--steps", type=int, default=300)
    reader.add_argument("--counts", nargs="*", default=["auto"])
    reader.add_argument("--times", action="store_true", help="times of impacts on the disc")
    reader.add_argument("--free", action="store_true", help="sheets that nothing holds")
    reader.add_argument("--tensors", action="store_true", help="times of second-order forces")
    asked = reader.parse_args()
    if asked.free:
        sys.exit(free_sheets())
    if asked.times:
        sys.exit(times())
    if asked.tensors:
        sys.exit(tensors())
    main(asked.cases, asked.steps, tuple(c if c == "auto" else int(c) for c in asked.counts))
