"""How far beams are from solid bars, and whether the share "model" of their budgets holds it.

Bars of rectangular section, clamped or free, of several slendernesses and widths, are struck by
spheres and masses as Timoshenko beams and as solids (quadratic hexahedra, the corrected model).
Printed for each bar: the change of the compliance at the site beyond the half-space, times E √A,
and of the first bending frequencies; for each blow the difference of the worst of peak force,
impulse and contact time, the share "model" that the beam's budget has for it, and their ratio.

    .venv/bin/python benchmarks/beam_model.py --help
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from math import sqrt
from pathlib import Path
from typing import Any, NamedTuple

import dolfinx
import numpy as np
import options
from fidelity import power
from mpi4py import MPI

import antiosc as ao
from antiosc.impact.histories.bars import QUANTITIES, differences
from antiosc.strikes.advice import advise

#: Of all bars, m; radius of the solid's patch over the smaller side.
HEIGHT, PATCH = 0.01, 0.3
#: Lines of a beam (all sites are nodes), anti-oscillators of both, frequencies that are compared.
LINES, COUNT, COMPARED = 60, 40, 3
#: Spheres: radii [m] and velocities [m/s]; masses: over the bar's, tip radius, velocity.
SPHERES = [(R, v) for R in (2e-3, 5e-3, 10e-3, 20e-3) for v in (0.3, 3.0)]
MASSES = [(0.3, 0.02, 0.5), (3.0, 0.05, 0.1)]
#: Largest |b²| of the modes that are compared, as a share of 1/mass of the bar.
SEEN = 0.03

PAGE = """# Beams in place of solid bars

Written by `benchmarks/beam_model.py`. Steel bars of rectangular section, {height:g} mm high, struck
on their upper side; the truth is the corrected model of quadratic hexahedra. "Compliance": of the
site without the half-space, solid less beam, times E √A, for free bars without the rigid motions;
"frequencies": solid over beam less one, for the first three bending modes that the site sees.

{bars}

Blows: spheres of 2 to 20 mm radius at 0.3 and 3 m/s, masses of 0.3 and 3 times the bar's. "True" is
the worst relative difference of peak force, impulse and contact time to the solid's, "model" the
share of the beam's budget for it; the last column counts the quantities of all blows that are
within their shares. The last three bars played no part in the choice of the constants.

{blows}

{told}
"""


class Bar(NamedTuple):
    """Ends ("clamped" or "free"), length and width over the height, site over the length."""

    ends: tuple[str, str]
    length: float
    width: float
    site: float
    nu: float = 0.3

    @property
    def size(self) -> tuple[float, float, float]:
        return self.length * HEIGHT, self.width * HEIGHT, HEIGHT

    @property
    def steel(self) -> dict[str, float]:
        return {"E": 210e9, "nu": self.nu, "rho": 7850.0}

    @property
    def name(self) -> str:
        ends = "-".join(self.ends)
        return f"{ends}, L/h = {self.length:g}, w/h = {self.width:g}, ν = {self.nu:g}"

    @property
    def supports(self) -> list[ao.Support]:
        places = (0.0, self.size[0])
        held = [x for x, end in zip(places, self.ends, strict=True) if end == "clamped"]
        return [ao.Support(plane=((x, 0, 0), (1, 0, 0))) for x in held]


F, C = "free", "clamped"
BARS = (
    Bar((F, F), 5, 1, 0.5),
    Bar((C, C), 5, 1, 0.5),
    Bar((C, F), 5, 1, 0.6),
    Bar((C, C), 10, 1, 0.5),
    Bar((C, F), 10, 1, 0.7),
    Bar((F, F), 10, 0.5, 0.3),
    Bar((C, C), 10, 0.5, 0.3),
    Bar((C, C), 10, 2, 0.4),
    Bar((F, F), 10, 2, 0.5),
    Bar((F, F), 20, 0.5, 0.5),
    Bar((C, C), 20, 1, 0.5),
    Bar((C, F), 20, 1, 0.8),
    Bar((C, C), 40, 1, 0.5),
    Bar((F, F), 10, 1, 0.5, 0.2),
    Bar((C, F), 10, 1, 0.6, 0.4),
    # these played no part in the choice of the constants
    Bar((C, C), 9, 1.5, 0.45),
    Bar((C, F), 15, 0.7, 0.5),
    Bar((F, F), 30, 1, 0.4),
)


def solid(bar: Bar, fine: float) -> ao.AntiOscillators:
    """Hexahedra that grow away from the patch."""
    (length, width, height), radius = bar.size, PATCH * min(bar.size[1:])
    along = 2 * round(fine * (7 + bar.length / 2))
    across, through = max(4, 2 * round(4 * fine * bar.width)), max(3, round(6 * fine))
    kind = dolfinx.mesh.CellType.hexahedron
    corners, numbers = [np.zeros(3), np.ones(3)], [along, across, through]
    mesh = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, numbers, kind)
    x = mesh.geometry.x
    place = bar.site * length
    s = graded(x[:, 0], 2 * radius / 3 / length, along)
    x[:, 0] = np.where(s < 0, place * (1 + s), place + (length - place) * s)
    x[:, 1] = width * (1 + graded(x[:, 1], 2 * radius / 3 / width, across)) / 2
    x[:, 2] = height * (1 - (1 - x[:, 2]) ** power(radius / 3 / height, through))
    part = ao.Structure(ao.read_mesh(mesh), ao.Solid(**bar.steel), bar.supports)
    site = ao.Site((place, width / 2, height), (0, 0, -1), radius=radius)
    return ao.extract(part, site, n=COUNT, error="estimate").corrected()


def graded(x: Any, first: float, count: int) -> Any:
    """Coordinates from -1 to 1 with steps from `first` at 0, from uniform ones from 0 to 1."""
    s = 2 * x - 1
    return np.sign(s) * np.abs(s) ** power(first, count // 2)


def beam(bar: Bar) -> ao.AntiOscillators:
    """Timoshenko's beam, with its error estimate."""
    length, width, height = bar.size
    section = ao.Section.rectangle(width=width, height=height)
    material = ao.Beam(**bar.steel, section=section, orientation=(0, 0, 1))
    mesh = options.line((0, 0, 0), (length, 0, 0), LINES)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        part = ao.Structure(mesh, material, bar.supports)
    site = ao.Site((bar.site * length, 0, 0), (0, 0, -1))
    return ao.extract(part, site, n=COUNT, error="estimate")


def compliance(model: ao.AntiOscillators) -> float:
    """Of the site, without rigid motions and the half-space [m/N]."""
    modes = model.modal()
    moving = modes.omega > 0
    elastic = np.sum((modes.b[moving] / modes.omega[moving]) ** 2) + modes.r
    return float(elastic - model.local_compliance)


def frequencies(model: ao.AntiOscillators, bar: Bar) -> Any:
    """The first natural frequencies that the site sees."""
    modes = model.modal()
    mass = bar.steel["rho"] * float(np.prod(bar.size))
    return modes.omega[(modes.omega > 0) & (modes.b**2 > SEEN / mass)][:COMPARED]


def blows(bar: Bar) -> list[tuple[Any, float]]:
    """(impactor, duration)."""
    mass = bar.steel["rho"] * float(np.prod(bar.size))
    steel = {"E": 210e9, "nu": 0.3}
    found: list[Any] = [ao.Sphere(R, **steel, rho=7850.0, velocity=v) for R, v in SPHERES]
    found += [ao.RigidMass(m * mass, v, tip_radius=R, **steel) for m, R, v in MASSES]
    times = [advise(bar.size, one, **bar.steel).contact_time for one in found]
    spans = [3.0] * len(SPHERES) + [6.0] * len(MASSES)
    return [(one, k * t) for one, k, t in zip(found, spans, times, strict=True)]


def compared(bar: Bar, fine: float) -> dict[str, Any]:
    """All that is told of a bar."""
    true, model = solid(bar, fine), beam(bar)
    soft = model.corrected()
    area = bar.size[1] * bar.size[2]
    more = compliance(true) - compliance(soft)
    rows = []
    for impactor, duration in blows(bar):
        law = impactor.hertz(bar.steel["E"], bar.nu)
        runs = [ao.simulate(m, impactor, law, duration, tol=1e-5) for m in (true, model)]
        budget, off = runs[1].error_budget, differences(*runs)
        rows.append({name: (off[name], budget[name].model) for name in QUANTITIES})
    return {
        "compliance": more * bar.steel["E"] * sqrt(area),
        "frequencies": frequencies(true, bar) / frequencies(soft, bar) - 1,
        "blows": rows,
        "dofs": true.info["dofs"],
    }


def main(bars: int = len(BARS), fine: float = 1.0, page: str = "") -> list[dict[str, Any]]:
    """Compare the first `bars` bars; print the page, return what was found for each.

    `fine`: factor on the number of the solids' elements along every side.
    """
    found = []
    for bar in BARS[:bars]:
        found.append(compared(bar, fine))
        print(bar.name, found[-1]["compliance"], found[-1]["frequencies"], flush=True)
    text = PAGE.format(
        height=1e3 * HEIGHT,
        bars=table_of_bars(found),
        blows=table_of_blows(found),
        told=told(found),
    )
    print(text)
    if page:
        Path(page).write_text(text)
    return found


def table_of_bars(found: Sequence[dict[str, Any]]) -> str:
    """Compliances and frequencies."""
    lines = ["| bar | dofs | compliance | frequencies |", "|---|---|---|---|"]
    for bar, row in zip(BARS, found, strict=False):
        shown = ", ".join(f"{100 * each:+.2f} %" for each in row["frequencies"])
        lines.append(f"| {bar.name} | {row['dofs']} | {row['compliance']:.2f} | {shown} |")
    return "\n".join(lines)


def table_of_blows(found: Sequence[dict[str, Any]]) -> str:
    """The worst quantity of each blow."""
    lines = [
        "| bar | true: median, largest | model: median, largest | true/model: median, largest "
        "| within |",
        "|---|---|---|---|---|",
    ]
    for bar, row in zip(BARS, found, strict=False):
        true, share = (
            [max(pair[k] for pair in blow.values()) for blow in row["blows"]] for k in (0, 1)
        )
        every = ratios([row])
        lines.append(
            f"| {bar.name} | {np.median(true):.1%}, {max(true):.1%} "
            f"| {np.median(share):.1%}, {max(share):.1%} "
            f"| {np.median(every):.2f}, {max(every):.2f} | {within(every)} |"
        )
    return "\n".join(lines)


def ratios(found: Sequence[dict[str, Any]]) -> list[float]:
    """True error over the share, of all quantities of all blows."""
    pairs = [pair for row in found for blow in row["blows"] for pair in blow.values()]
    return [true / share for true, share in pairs]


def within(every: Sequence[float]) -> str:
    return f"{sum(each <= 1 for each in every)} of {len(every)}"


def told(found: Sequence[dict[str, Any]]) -> str:
    """All blows in a sentence."""
    every = ratios(found)
    return (
        f"{within(every)} quantities are within their shares; the ratio is {np.median(every):.2f} "
        f"in the median, {np.quantile(every, 0.95):.2f} for 95 %, at most {max(every):.2f}."
    )


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bars", type=options.count, default=len(BARS), help="bars of the list")
    parser.add_argument("--fine", type=options.positive, default=1.0, help="factor on elements")
    parser.add_argument("--page", default="", help="file for the page")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
