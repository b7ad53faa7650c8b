"""`strike` over meshes of lines: random beams and impacts, against closed forms.

Uniform Timoshenko beams of all ends, struck anywhere by masses of a hundredth to ten times their
own, are given as one to four lines, of degree 1 or 2. The truth is the closed form.

    .venv/bin/python benchmarks/strike_beams.py --help
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import options

import antiosc as ao
from antiosc.impact.histories.bars import QUANTITIES, differences
from antiosc.models.closed_form import StruckBeam, UniformBeam

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
#: Anti-oscillators and error of the time steps of the truth.
TRUE, TRUE_TOL = 200, 1e-6
TOLS = (0.1, 0.03, 0.01, 0.003)
ENDS = ("free", "pinned", "clamped")
#: A duration in contact times of the mass with the beam at rest.
CONTACTS = 4.0

PAGE = """# `strike` over meshes of lines

Written by `benchmarks/strike_beams.py --cases {cases} --seed {seed}`. Uniform Timoshenko beams of
random slenderness (10 to 100), ends, sites, masses and contact stiffnesses, given as one to four
lines of degree 1 or 2. The truth is the closed form with 200 anti-oscillators, so that the bars are
taken without the share of the model ([what this is](beam_model.md)). "Met": the bars, or the true
errors, of peak force, impulse and contact time are within the tolerance; "bars hold": all three
true errors are below their bars; "promised", "true", dofs and CPU seconds are medians.

{table}
"""


class Case(NamedTuple):
    """A beam along x from 0, and what strikes it."""

    length: float
    section: ao.Section
    ends: tuple[str, str]
    place: float
    lines: int
    order: int
    mass: float
    stiffness: float

    @property
    def impact(self) -> tuple[ao.RigidMass, ao.Hertz, float]:
        """Impactor, contact law, duration."""
        time = 3.2145 * (self.mass / self.stiffness) ** 0.4  # at 1 m/s
        return ao.RigidMass(self.mass, 1.0), ao.Hertz(self.stiffness), CONTACTS * time

    @property
    def beam(self) -> ao.Beam:
        return ao.Beam(**STEEL, section=self.section, orientation=(0, 0, 1))

    @property
    def site(self) -> ao.Site:
        return ao.Site((self.place, 0, 0), (0, 0, -1))

    def true(self) -> ao.History:
        """In closed form."""
        beam = UniformBeam.timoshenko(
            **STEEL, area=self.section.A, inertia=self.section.I, length=self.length
        )
        model = StruckBeam(beam, *self.ends, self.place).anti_oscillators(TRUE)
        return ao.simulate(model, *self.impact, tol=TRUE_TOL)

    def struck(self, tol: float) -> ao.History:
        """By `strike`."""
        mesh = options.line((0, 0, 0), (self.length, 0, 0), self.lines)
        x = (0.0, self.length)
        held = [
            ao.Support(at(x[k]), "all" if end == "clamped" else ["x", "y", "z", "rx"])
            for k, end in enumerate(self.ends)
            if end != "free"
        ]
        options_ = {"material": self.beam, "supports": held, "order": self.order}
        return ao.strike(mesh, self.site, *self.impact, tol=tol, **options_)


def at(x: float) -> Any:
    """Where a support is."""
    return lambda points: np.isclose(points[0], x, atol=1e-9)


def drawn(rng: np.random.Generator) -> Case:
    """A random case."""
    height = 10 ** rng.uniform(-2.3, -1.3)
    length = height * 10 ** rng.uniform(1, 2)
    ends = tuple(str(end) for end in rng.choice(ENDS, 2))
    tip = 1.0 if ends[1] == "free" else 0.3
    place = length * rng.choice([0.5, float(rng.uniform(0.1, 0.9)), tip])
    section = ao.Section.rectangle(height * 10 ** rng.uniform(-0.3, 0.3), height)
    mass = STEEL["rho"] * section.A * length * 10 ** rng.uniform(-2, 1)
    return Case(
        length, section, (ends[0], ends[1]), float(place), int(rng.integers(1, 5)),
        int(rng.integers(1, 3)), mass, 10 ** rng.uniform(8, 10),
    )  # fmt: skip


def main(
    cases: int = 20, seed: int = 0, tols: tuple[float, ...] = TOLS, page: str = ""
) -> list[dict[str, Any]]:
    """Strike random beams at each tolerance; print the page, return a row for each run."""
    rows: list[dict[str, Any]] = []
    for number in range(cases):
        case = drawn(np.random.default_rng([seed, number]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AntioscWarning)
            true = case.true()
            for tol in tols:
                started = time.process_time()
                hit = case.struck(tol)
                seconds = time.process_time() - started
                off, budget = differences(hit, true), hit.error_budget
                rows.append(
                    {
                        "number": number,
                        "asked": tol,
                        "promised": budget.numerical,
                        "true": max(off.values()),
                        "ratio": max(off[name] / budget[name].numerical for name in QUANTITIES),
                        "met": budget.numerical <= tol,
                        "dofs": hit.model.info["strike"][-1]["dofs"],
                        "n": hit.model.n,
                        "seconds": seconds,
                    }
                )
    text = PAGE.format(cases=cases, seed=seed, table=table(rows))
    print(text)
    if page:
        Path(page).write_text(text)
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """In Markdown, a row for each tolerance."""
    lines = [
        "| asked | answers | met by the bars | met in truth | bars hold | promised | true "
        "| worst true/bar | dofs | CPU s |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for tol in dict.fromkeys(row["asked"] for row in rows):
        own = [row for row in rows if row["asked"] == tol]

        def middle(name: str, own: Sequence[dict[str, Any]] = own) -> float:
            return float(np.median([row[name] for row in own]))

        lines.append(
            f"| {tol:.1%} | {len(own)} | {np.mean([r['met'] for r in own]):.0%} "
            f"| {np.mean([r['true'] <= tol for r in own]):.0%} "
            f"| {np.mean([r['ratio'] <= 1 for r in own]):.0%} "
            f"| {middle('promised'):.2g} | {middle('true'):.2g} "
            f"| {max(r['ratio'] for r in own):.2f} | {middle('dofs'):.0f} "
            f"| {middle('seconds'):.2g} |"
        )
    return "\n".join(lines)


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=options.count, default=20, help="random beams")
    parser.add_argument("--seed", type=options.seed, default=0, help="of the random beams")
    parser.add_argument("--page", default="", help="file for the page")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
