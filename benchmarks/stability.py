"""Where integrators fail: maps of energy drift over the number of anti-oscillators and the step.

Three charts. The first strikes the article's second beam with N = 1 ... 200 anti-oscillators and
steps over four decades, one panel for each fixed-step method; drawn in is the stability limit of
central differences, h omega_max = 2. The second draws the error of the force over the step, finely,
for a heavy mass on a soft structure whose light residual mass has its mode far above the others:
the exact method has windows of steps in which the contact drives that mode. The third is a rod on a
rigid wall, where other programs' integrators gain energy (`stability_rod.py`).

Each run is one of: good; energy (drift above 1 % of the energy there is); wrong (force off by more
than 10 % in the L2 norm).

    .venv/bin/python benchmarks/stability.py
"""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import options
import stability_rod
from stability_charts import METHODS, chart_numbers

import antiosc as ao
from antiosc import plotting
from antiosc.base import files
from antiosc.engine.march import difference
from antiosc.impact.two_bodies import Impact, assemble_pair
from antiosc.models.closed_form import UniformBeam, pinned_pinned

ROOT = Path(__file__).resolve().parent.parent
WINDOW = 3e-4  # s, about the first rise of the force
BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
STRIKER = ao.RigidMass(0.24, 0.01)
HERTZ = 1.55e10


@dataclass(frozen=True)
class Scene:
    """What is struck by what, for how long."""

    name: str
    model: ao.AntiOscillators
    impactor: ao.RigidMass
    law: ao.ContactLaw
    duration: float

    def run(self, method: str, step: float | None = None, tol: float | None = None) -> ao.History:
        return ao.simulate(
            self.model,
            self.impactor,
            self.law,
            self.duration,
            method,
            step=step,
            tol=tol,
            max_contacts=300,
            max_steps=200_000,
        )


def main(
    most: int = 200,
    counts: int = 8,
    steps: int = 9,
    decades: float = 4.0,
    fine: int = 120,
    out: Path = ROOT / "out",
) -> dict[str, Any]:
    """Draw the charts; return the table of runs.

    Parameters
    ----------
    most : largest number of anti-oscillators
    counts : how many numbers of anti-oscillators, from 1
    steps : how many steps
    decades : over how many decades, up to 1e-4 s
    fine : number of steps on the chart of windows
    out : folder of the charts and the table
    """
    out.mkdir(parents=True, exist_ok=True)
    full = pinned_pinned(BEAM).anti_oscillators(most)
    numbers = np.unique(np.geomspace(1, most, counts).round().astype(int))
    times = np.geomspace(10 ** (-4 - decades), 1e-4, steps)
    table = []
    for n in numbers:
        scene = Scene(f"N = {n}", full.truncated(int(n)), STRIKER, ao.Hertz(HERTZ), WINDOW)
        table += survey(scene, times, n=int(n))
    limits = [2 / full.truncated(int(n)).modal().omega.max() for n in numbers]
    chart_numbers(table, numbers, times, limits, out / "stability.png")
    found = windows(fine, out / "stability_windows.png")
    rows = table + found
    rod = stability_rod.survey()
    stability_rod.chart(rod, out / "stability_rod.png")
    files.write_text(out / "stability.json", json.dumps(rows, indent=1))
    return {"runs": rows, "windows": found, "rod": rod}


def survey(scene: Scene, times: np.ndarray, n: int | None = None) -> list[dict[str, Any]]:
    """All methods at all steps against a converged run."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)
        truth = scene.run("exact", tol=1e-4)
        return [
            {"scene": scene.name, "n": n, **attempt(scene, truth, method, float(h))}
            for method in METHODS
            for h in times
            if h <= scene.duration
        ]


def attempt(scene: Scene, truth: ao.History, method: str, h: float) -> dict[str, Any]:
    top = float(truth.assembly.system.omega.max())
    hit = scene.run(method, step=h)
    error = difference(hit.run, truth.run, np.inf)[0]
    kind = "good" if hit.energy.drift <= 0.01 else "energy"
    kind = kind if error <= 0.1 else "wrong"
    return {"method": method, "step": h, "h_omega": h * top, "kind": kind, "error": error}


def windows(count: int, path: Path) -> list[dict[str, Any]]:
    """The fixed-step methods over `count` steps about the exact method's windows."""
    model = ao.AntiOscillators(m0=2e-4, k0=7e6, m=[0.18, 0.01, 0.001], omega=[1.5e4, 6e4, 2.5e5])
    scene = Scene("windows", model, ao.RigidMass(10.0, 0.3), ao.Hertz(1.2e10), 1e-3)
    system = assemble_pair(Impact(scene.model, scene.impactor, scene.law, scene.duration)).system
    y = np.linspace(1.0, 8.0, count)
    times = y / system.omega.max()
    rows = survey(scene, times)
    fig, axes = plotting.panels(1, 1, size=(8, 4))
    ax = axes[0, 0]
    for method in METHODS:
        mine = [r for r in rows if r["method"] == method]
        x, y_error = [r["h_omega"] for r in mine], [r["error"] for r in mine]
        ax.semilogy(x, y_error, ".-", lw=1.5, label=method)
    ax.set(xlabel=r"step, $h\,\omega_{max}$", ylabel="error of the force", ylim=(3e-4, 3))
    ax.legend(fontsize=9, ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1))
    plotting.save_figure(fig, path, dpi=120)
    return rows


def report(result: dict[str, Any]) -> None:
    tally: dict[tuple[str, str], dict[str, int]] = {}
    for row in result["runs"]:
        part = "windows" if row["n"] is None else "N"
        kinds = tally.setdefault((row["method"], part), {})
        kinds[row["kind"]] = kinds.get(row["kind"], 0) + 1
    bad = [r for r in result["windows"] if r["method"] == "exact" and r["kind"] != "good"]
    if bad:
        span = ", ".join(f"{r['h_omega']:.2f}" for r in bad)
        print(f"exact, windows: fails at h omega_max = {span}")
    for (method, part), kinds in tally.items():
        print(f"{method:<20}{part:<9}" + "  ".join(f"{k} {v}" for k, v in kinds.items()))
    print(stability_rod.table(result["rod"]))


if __name__ == "__main__":
    report(options.command(main))
