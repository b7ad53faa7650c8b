"""How good bars of sheets that stretch are: random parts against all degrees of freedom.

Plates, shallow caps, unsymmetric laminates, folded sheets, plates of solids and beams between
walls, of random size, place and striker, deflect by 0.2 to 3 thicknesses. The reference has every
nodal displacement of the same mesh and the whole second-order strain, with the average acceleration
and Newton's method in each step (`tests/support/full_second_order.py`); its own error is a third of
what half as many steps change. A bar is the sum of the rows "stretch", "truncation" and "time"; one
holds if both peak force and impulse are inside, with the reference's own error. Seed 7 gave the
factor of safety, another one tries it.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/random_sheets.py --count 60 --page PAGE
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.integrate import trapezoid

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))

import antiosc as ao
from assemblies import box, line
from full_second_order import Full
from sheets import sheet

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
PLY = ao.Layer(130e9, 9e9, 0.3, 5e9, 5e9, 3.5e9, 1600.0, 1.0)
#: Cells along both sides of a sheet.
CELLS = 6, 5
STEPS, SEED = 800, 8
LEAST, MOST = 0.2, 3.0
HEAD = """# Random sheets that stretch: bars against all degrees of freedom

Written by `benchmarks/random_sheets.py --count {count}`. {held} of {inside} bars of parts that
deflect by {least:g} to {most:g} thicknesses hold, both of peak force and of impulse. "Told" are
those of which a warning says that they need more modes; a bar without end does not hold.

| part | bars that hold | w/h | linear, worst force | "auto", median | "auto", worst | told |
|---|---|---|---|---|---|---|
"""


@dataclass
class Sheet:
    """A part, its site, and what scales the blow: thickness, area times thickness."""

    part: ao.Structure
    site: ao.Site
    thickness: float
    mass: float


def clamped(mesh, material, a: float, b: float | None) -> ao.Structure:
    """Held along x = 0 and x = a, and y = 0 and y = b of what is wide."""

    def rim(x):
        ends = np.isclose(x[0] * (a - x[0]), 0)
        return ends if b is None else ends | np.isclose(x[1] * (b - x[1]), 0)

    return ao.Structure(mesh, material, [ao.Support(rim)])


def sizes(rng: np.random.Generator) -> tuple[float, float, float]:
    """Sides and thickness [m]."""
    a, ratio = rng.uniform(0.1, 0.4), rng.uniform(0.5, 1.0)
    return a, ratio * a, rng.uniform(0.5e-3, 2e-3)


def place(rng: np.random.Generator) -> tuple[float, float]:
    """A node's share of both sides, away from the edges."""
    return tuple(round(n * rng.uniform(0.25, 0.75)) / n for n in CELLS)


def of_surface(rng, rise, height, material) -> Sheet:
    """A sheet over a rectangle: `rise` times height(s, t); material(h)."""
    a, b, h = sizes(rng)
    s, t = place(rng)
    high = rise * h

    def surface(p, q):
        return a * p, b * q, high * height(p, q)

    part = clamped(sheet(CELLS, surface), material(h), a, b)
    site = ao.Site((a * s, b * t, high * height(s, t)), (0, 0, -1), snap=True)
    return Sheet(part, site, h, part.mass)


def steel(h: float) -> ao.Shell:
    return ao.Shell(thickness=h, **STEEL)


def plies(h: float) -> ao.Laminate:
    """Four unsymmetric plies."""
    angles = (0, 90, 0, 45)
    return ao.Laminate([replace(PLY, angle=g, thickness=h / 4) for g in angles], axis=(1, 0, 0))


def dome(s, t):
    return 16 * s * (1 - s) * t * (1 - t)


def plate(rng) -> Sheet:
    return of_surface(rng, 0.0, dome, steel)


def cap(rng) -> Sheet:
    return of_surface(rng, rng.uniform(-1.5, 1.5), dome, steel)


def laminate(rng) -> Sheet:
    return of_surface(rng, 0.0, dome, plies)


def folded(rng) -> Sheet:
    """Folded along its middle, by 3 to 30 thicknesses."""
    return of_surface(rng, rng.uniform(3.0, 30.0), lambda s, t: 1 - np.abs(2 * s - 1), steel)


def solid(rng) -> Sheet:
    """A plate of one layer of solids, thicker than the sheets."""
    a, b, _ = sizes(rng)
    h = a * rng.uniform(0.01, 0.02)
    s, t = place(rng)
    part = clamped(box((0, 0, 0), (a, b, h), (*CELLS, 1)), ao.Solid(**STEEL), a, b)
    return Sheet(part, ao.Site((a * s, b * t, h), (0, 0, -1), snap=True), h, part.mass)


def beam(rng) -> Sheet:
    """A beam between walls."""
    L, _, h = sizes(rng)
    section = ao.Section.rectangle(rng.uniform(2.0, 10.0) * h, h)
    material = ao.Beam(section=section, orientation=(0, 0, 1), **STEEL)
    part = clamped(line((0, 0, 0), (L, 0, 0), 20), material, L, None)
    site = ao.Site((round(20 * rng.uniform(0.2, 0.8)) / 20 * L, 0, 0), (0, 0, -1), snap=True)
    return Sheet(part, site, h, part.mass)


def tube(rng) -> Sheet:
    """A piece of a tube, 59 to 150 thicknesses in radius, held all around; not of the six kinds."""
    radius = rng.uniform(0.02, 0.06)
    length, h = rng.uniform(1.5, 4.0) * radius, radius / rng.uniform(59.0, 150.0)
    angle = np.radians(rng.choice([90.0, 180.0, 240.0, 300.0]))
    s, t = place(rng)

    def surface(p, q):
        turn = angle * (q - 0.5)
        return length * p, radius * np.sin(turn), radius * np.cos(turn)

    def rim(x):
        sides = np.isclose(np.abs(x[1]), abs(radius * np.sin(angle / 2)))
        sides &= np.isclose(x[2], radius * np.cos(angle / 2))
        return np.isclose(x[0] * (length - x[0]), 0) | sides

    part = ao.Structure(sheet((7, 8), surface, "triangle", 2), steel(h), [ao.Support(rim)])
    turn = angle * (t - 0.5)
    inward = (0, -np.sin(turn), -np.cos(turn))
    return Sheet(part, ao.Site(surface(s, t), inward, snap=True), h, part.mass)


FAMILIES: dict[str, Callable[[np.random.Generator], Sheet]] = {
    "plate": plate,
    "cap": cap,
    "laminate": laminate,
    "folded": folded,
    "solid": solid,
    "beam": beam,
}
ALL = {**FAMILIES, "tube": tube}


@dataclass
class Found:
    """What one part gave: w/h, relative errors of the linear and of the "auto" force, its bar."""

    family: str
    deflection: float
    linear: float
    off: float
    bar: float
    holds: bool
    told: bool


def reference(one: Sheet, blow: tuple) -> tuple[np.ndarray, np.ndarray, float]:
    """Peak force and impulse, their relative errors, the deflection [m]."""
    full, found = Full(one.part, one.site), []
    for steps in (STEPS // 2, STEPS):
        time, force, moved = full.impact(*blow, steps)
        found.append([force.max(), trapezoid(force, time)])
    coarse, fine = map(np.array, found)
    return fine, np.abs(coarse / fine - 1) / 3, np.abs(moved).max()


def tried(family: str, rng: np.random.Generator) -> Found:
    """One random part, struck."""
    one = ALL[family](rng)
    h, k0 = one.thickness, ao.extract(one.part, one.site, n=2).k0
    mass = rng.uniform(0.3, 4.0) * one.mass
    speed = rng.uniform(0.2, 5.0) * h * np.sqrt(k0 / mass)
    k = rng.uniform(3.0, 30.0) * k0 / np.sqrt(h)
    duration = 3.0 * np.sqrt(mass / k0)
    known, doubt, moved = reference(one, (mass, speed, k, duration))
    model = ao.extract(one.part, one.site, n=40, stretch="auto", error="estimate")
    striker, law = ao.RigidMass(mass, velocity=speed), ao.Power(k, 1.5)
    hit = ao.simulate(model, striker, law, duration)
    linear = ao.simulate(replace(model, stretch=None), striker, law, duration)
    bars = [hit.error_budget[name] for name in ("peak_force", "impulse")]
    bar = np.array([each.stretch + each.truncation + each.time for each in bars])
    off = np.array([hit.peak_force, hit.impulse]) / known - 1
    holds = bool(np.all(np.isfinite(bar) & (np.abs(off) <= bar + doubt)))
    before = linear.peak_force / known[0] - 1
    told = "explicit finite element" in hit.message
    return Found(family, moved / h, before, off[0], bar[0], holds, told)


def row(family: str, found: list[Found]) -> str:
    """One line of the table."""
    held = sum(each.holds for each in found)
    w = [each.deflection for each in found]
    off = np.abs([each.off for each in found])
    linear = max((each.linear for each in found), key=abs)
    told = sum(each.told for each in found)
    return (
        f"| {family} | {held} of {len(found)} | {min(w):.2f} to {max(w):.2f} | {linear:+.0%} |"
        f" {np.median(off):.2%} | {off.max():.2%} | {told} |"
    )


def main(count: int, page: Path | None, kinds: list[str]) -> None:
    """Print each part, and write the page."""
    found = []
    for number in range(count):
        family = kinds[number % len(kinds)]
        one = tried(family, np.random.default_rng((SEED, number)))
        found.append(one)
        print(
            f"{number:2d} {family:8} w/h {one.deflection:.2f} linear {one.linear:+.1%}"
            f" auto {one.off:+.2%} bar {one.bar:.2%}"
            f" {'' if one.holds else 'OUTSIDE'} {'told' if one.told else ''}",
            flush=True,
        )
    inside = [one for one in found if LEAST <= one.deflection <= MOST]
    held = sum(one.holds for one in inside)
    head = HEAD.format(count=count, held=held, inside=len(inside), least=LEAST, most=MOST)
    groups = {name: [one for one in inside if one.family == name] for name in kinds}
    rows = [row(name, group) for name, group in groups.items() if group]
    text = head + "\n".join(rows) + "\n"
    print(text)
    if page is not None:
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--count", type=int, default=60)
    reader.add_argument("--page", type=Path, help="file that the table is written to")
    reader.add_argument("--only", nargs="*", choices=ALL, help="kinds; default: all but tubes")
    asked = reader.parse_args()
    warnings.simplefilter("ignore")
    main(asked.count, asked.page, asked.only or list(FAMILIES))
