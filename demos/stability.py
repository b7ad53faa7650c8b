"""Where integrators fail: maps of energy drift over the number of anti-oscillators and the step.

Three charts. The first strikes the article's second beam with N = 1 ... 200 anti-oscillators and
steps over four decades, one panel for each fixed-step method; drawn in are the stability limit of
central differences, h omega_max = 2, and the same with the contact's stiffness on the residual
mass. The second takes N = 10 through hard scenes: stiff contact, m0 -> 0, light and heavy
impactors, grazing speed, rest under gravity, an anti-oscillator next to massless. The third draws
the error of the force over the step, finely, for a heavy mass on a soft structure whose light
residual mass has its mode far above the others: the exact integrator has windows of steps in which
the contact drives that mode, shaded where `antiosc.simulation.integrators.stability` predicts them.

Each run is one of: good; energy (drift above 1 % of the energy there is); wrong (force off by more
than 10 % in the L2 norm); diverged; and the seconds tell where a method only gets slow.

    .venv/bin/python demos/stability.py
"""

from __future__ import annotations

import argparse
import inspect
import json
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import options
from matplotlib.colors import ListedColormap

import antiosc as ao
from antiosc import files, plotting
from antiosc.closed_form import UniformBeam, pinned_pinned
from antiosc.simulation.history import force_difference
from antiosc.simulation.integrators import FIXED_STEP
from antiosc.simulation.integrators.stability import margin
from antiosc.simulation.simulate import assemble, scaled

ROOT = Path(__file__).resolve().parent.parent
BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
STRIKER = ao.RigidMass(0.24, 0.01)
HERTZ = 1.55e10
METHODS = tuple(FIXED_STEP)
CLASSES = ("good", "energy", "wrong", "diverged")
COLOURS = ListedColormap(["#4c9f70", "#f2c14e", "#e07a3f", "#8c2f39"])
#: Newmark's curve lies under the one of the conserving method, which is drawn after it.
WIDTHS = {"newmark": 6.0, "conserving": 1.5}
WINDOW = 3e-4  # s, about the first rise of the force


@dataclass(frozen=True)
class Scene:
    """What is struck by what, for how long; `unit` is the time that steps are counted in."""

    name: str
    model: ao.AntiOscillators
    impactor: ao.RigidMass
    law: ao.ContactLaw
    duration: float
    unit: float
    gravity: float = 0.0

    def run(
        self,
        method: str,
        step: float | None = None,
        tol: float | None = None,
        max_steps: int = 200_000,
    ) -> ao.History:
        return ao.simulate(
            self.model,
            self.impactor,
            self.law,
            self.duration,
            method,
            step=step,
            tol=tol,
            gravity=self.gravity,
            max_contacts=300,
            max_steps=max_steps,
        )


def main(
    most: int = 200,
    counts: int = 8,
    steps: int = 9,
    decades: float = 4.0,
    hard: bool = True,
    fine: int = 120,
    out: Path = ROOT / "out",
) -> dict[str, Any]:
    """Draw the charts; return the table of runs and the measured limits.

    Parameters
    ----------
    most : largest number of anti-oscillators
    counts : how many numbers of anti-oscillators, from 1
    steps : how many steps
    decades : over how many decades, up to 1e-4 s
    hard : whether to run the hard scenes as well
    fine : number of steps on the chart of windows
    out : folder of the charts and the table
    """
    out.mkdir(parents=True, exist_ok=True)
    full = pinned_pinned(BEAM).anti_oscillators(most)
    numbers = np.unique(np.geomspace(1, most, counts).round().astype(int))
    times = np.geomspace(10 ** (-4 - decades), 1e-4, steps)
    table = []
    for n in numbers:
        scene = Scene(
            f"N = {n}", full.truncated(int(n)), STRIKER, ao.Hertz(HERTZ), WINDOW, unit=1.0
        )
        table += survey(scene, times, n=int(n))
    chart_numbers(table, full, numbers, times, out / "stability.png")
    rows = list(table)
    if hard:
        scenes = hard_scenes(full.truncated(min(10, most)))
        ratios = np.geomspace(10 ** (0.5 - decades), 10**0.5, steps)
        hard_table = [row for s in scenes for row in survey(s, ratios * s.unit)]
        chart_scenes(hard_table, scenes, ratios, out / "stability_scenes.png")
        rows += hard_table + [adaptive(s, m) for s in scenes for m in ("exact", "DOP853", "Radau")]
    found = windows(fine, out / "stability_windows.png")
    rows += found
    files.write_text(out / "stability.json", json.dumps(rows, indent=1))
    return {"runs": rows, "limits": measured_limits(table), "windows": found}


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
    began = time.perf_counter()
    hit = scene.run(method, step=h)
    seconds = time.perf_counter() - began
    error = force_difference(hit.trajectory, truth.trajectory)[0]
    drift = hit.energy.drift
    top = float(hit.problem.omega.max())
    kind = "good"
    if hit.trajectory.diverged:
        kind = "diverged"
    elif not error <= 0.1:
        kind = "wrong"
    elif not drift <= 0.01:
        kind = "energy"
    return {
        "method": method,
        "step": h,
        "h_omega": h * top,
        "kind": kind,
        "error": min(error, 1e9),
        "drift": min(drift, 1e9),
        "contacts": len(hit.contacts),
        "seconds": seconds,
    }


def adaptive(scene: Scene, method: str) -> dict[str, Any]:
    """A method that chooses its own step: it does not fail, it gets slow."""
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)
        hit = scene.run(method, tol=1e-3 if method == "exact" else 1e-2, max_steps=20_000)
    return {
        "scene": scene.name,
        "method": f"{method} (adaptive)",
        "kind": "good" if hit.status == 0 else f"status {hit.status}",
        "drift": hit.energy.drift,
        "contacts": len(hit.contacts),
        "evaluations": hit.trajectory.evaluations,
        "seconds": time.perf_counter() - began,
    }


def hard_scenes(model: ao.AntiOscillators) -> list[Scene]:
    """The cases that are known to be hard."""
    m = model.m.copy()
    m[-1] += model.m0  # the residual mass moves to the last anti-oscillator
    share = np.array(model.m)
    share[0] *= 1e-12

    def light(m0: float) -> ao.AntiOscillators:
        return ao.AntiOscillators(m0, model.k0, m, model.omega)

    base = ao.Hertz(HERTZ)
    cases = [
        ("as in the article", model, STRIKER, base),
        ("k_H x 1e3", model, STRIKER, ao.Hertz(1e3 * HERTZ)),
        ("k_H x 1e6", model, STRIKER, ao.Hertz(1e6 * HERTZ)),
        ("m0 x 1e-3", light(1e-3 * model.m0), STRIKER, base),
        ("m0 x 1e-6", light(1e-6 * model.m0), STRIKER, base),
        ("m0 x 1e-9", light(1e-9 * model.m0), STRIKER, base),
        ("m0 = 0", light(0.0), STRIKER, base),
        *(
            (f"mass ratio {ratio:.0e}", model, replace(STRIKER, mass=ratio * model.m_st), base)
            for ratio in (1e-6, 1e-3, 1e3, 1e6)
        ),
        ("1e-9 m/s", model, replace(STRIKER, velocity=1e-9), base),
        ("massless AO", ao.AntiOscillators(model.m0, model.k0, share, model.omega), STRIKER, base),
    ]
    scenes = []
    for name, body, striker, law in cases:
        first = _first_contact(body, striker, law)
        scenes.append(Scene(name, body, striker, law, 3 * first, first))
    rest = replace(STRIKER, velocity=0.0)
    period = 2 * np.pi / model.modal().omega[0]
    scenes.append(Scene("rest under gravity", model, rest, base, period, period / 30, 9.81))
    return scenes


def _first_contact(model: ao.AntiOscillators, striker: ao.RigidMass, law: ao.ContactLaw) -> float:
    """Length of the first contact, or of what is looked at of a long one [s]."""
    longest = 1e-3 if striker.velocity > 1e-6 else 1e-1
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)
        hit = ao.simulate(model, striker, law, longest, tol=0.03, max_contacts=2)
    start, end = hit.contacts[0]
    return end - start


def windows(count: int, path: Path) -> list[dict[str, Any]]:
    """The fixed-step methods over `count` steps about the exact integrator's windows."""
    model = ao.AntiOscillators(m0=2e-4, k0=7e6, m=[0.18, 0.01, 0.001], omega=[1.5e4, 6e4, 2.5e5])
    scene = Scene("windows", model, ao.RigidMass(10.0, 0.3), ao.Hertz(1.2e10), 1e-3, unit=1.0)
    problem, bodies = assemble(scene.model, scene.impactor, scene.law)
    problem, _ = scaled(problem, bodies, scene.duration)
    y = np.linspace(1.0, 6.0, count)
    times = y / problem.omega.max()
    size = (count, problem.omega.size)
    rooms = margin(
        np.broadcast_to(problem.omega, size),
        np.broadcast_to(problem.beta, size),
        np.full(count, problem.r),
        np.full(count, problem.stiffness),
        times,
    )
    rows = survey(scene, times)
    for row in rows:
        row["margin"] = float(min(rooms[int(np.argmin(np.abs(times - row["step"])))], 1e9))
    fig, axes = plotting.panels(1, 1, size=(8, 4))
    ax = axes[0, 0]
    for method in METHODS:
        mine = [r for r in rows if r["method"] == method]
        x, y_error = [r["h_omega"] for r in mine], [r["error"] for r in mine]
        ax.semilogy(x, y_error, ".-", lw=WIDTHS.get(method, 1.5), label=method)
    ax.fill_between(
        y, 0, 1, rooms < 1, transform=ax.get_xaxis_transform(), alpha=0.2, label="predicted window"
    )
    ax.set(xlabel=r"step, $h\,\omega_{max}$", ylabel="error of the force", ylim=(3e-4, 3))
    ax.legend(fontsize=8, ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1))
    plotting.save_figure(fig, path, dpi=120)
    return rows


def measured_limits(table: list[dict[str, Any]]) -> dict[str, dict[str, float | None]]:
    """Per method: the smallest h omega_max that failed, and the largest that was good."""
    limits = {}
    for method in METHODS:
        rows = [r for r in table if r["method"] == method]
        bad = [r["h_omega"] for r in rows if r["kind"] == "diverged"]
        good = [r["h_omega"] for r in rows if r["kind"] == "good"]
        limits[method] = {
            "first diverged": min(bad, default=None),
            "last good": max(good, default=None),
        }
    return limits


# -- charts


def chart_numbers(
    table: list[dict[str, Any]],
    full: ao.AntiOscillators,
    numbers: np.ndarray,
    times: np.ndarray,
    path: Path,
) -> None:
    fig, grid = plotting.panels(1, len(METHODS), size=(13, 4), sharey=True)
    axes = grid[0]
    edges_n, edges_h = _edges(numbers), _edges(times)
    limits = np.array([_limits(full.truncated(int(n))) for n in numbers])
    for ax, method in zip(axes, METHODS, strict=True):
        kinds = np.full((times.size, numbers.size), np.nan)
        for row in table:
            if row["method"] == method:
                i = int(np.argmin(np.abs(times - row["step"])))
                kinds[i, int(np.flatnonzero(numbers == row["n"])[0])] = CLASSES.index(row["kind"])
        image = ax.pcolormesh(edges_n, edges_h, kinds, cmap=COLOURS, vmin=-0.5, vmax=3.5)
        ax.plot(numbers, limits[:, 0], "k-", label=r"$h\,\omega_{max} = 2$")
        ax.plot(numbers, limits[:, 1], "k--", label="with the contact's stiffness")
        ax.set(xscale="log", yscale="log", title=method, xlabel="anti-oscillators N")
        ax.set_ylim(edges_h[0], edges_h[-1])
    axes[0].set_ylabel("step h [s]")
    axes[-1].legend(fontsize=8)
    bar = fig.colorbar(image, ax=axes, ticks=range(4))
    bar.ax.set_yticklabels(CLASSES)
    plotting.save_figure(fig, path, dpi=120)


def chart_scenes(
    table: list[dict[str, Any]], scenes: list[Scene], ratios: np.ndarray, path: Path
) -> None:
    fig, grid = plotting.panels(1, len(METHODS), size=(13, 5), sharey=True)
    axes = grid[0]
    names = [s.name for s in scenes]
    for ax, method in zip(axes, METHODS, strict=True):
        kinds = np.full((len(names), ratios.size), np.nan)
        for row in table:
            if row["method"] == method:
                j = names.index(row["scene"])
                i = int(np.argmin(np.abs(np.log(ratios * scenes[j].unit / row["step"]))))
                kinds[j, i] = CLASSES.index(row["kind"])
        image = ax.pcolormesh(
            _edges(ratios), np.arange(len(names) + 1), kinds, cmap=COLOURS, vmin=-0.5, vmax=3.5
        )
        for j, scene in enumerate(scenes):
            limit = 2 / scene.model.modal().omega.max() / scene.unit
            ax.plot([limit, limit], [j, j + 1], "k-", lw=2)
        ax.set(xscale="log", title=method, xlabel="step / first contact")
        ax.set_xlim(_edges(ratios)[0], _edges(ratios)[-1])
    axes[0].set_yticks(np.arange(len(names)) + 0.5, names)
    bar = fig.colorbar(image, ax=axes, ticks=range(4))
    bar.ax.set_yticklabels(CLASSES)
    plotting.save_figure(fig, path, dpi=120)


def _limits(model: ao.AntiOscillators) -> tuple[float, float]:
    """Largest stable steps of central differences, without and with the contact's stiffness.

    The contact is linearised at the indentation of a mass m_st on a fixed plane.
    """
    body = model.modal()
    mass = 1 / (1 / STRIKER.mass + 1 / model.m_st)
    deepest = (1.25 * mass * STRIKER.velocity**2 / HERTZ) ** 0.4
    k = 1.5 * HERTZ * np.sqrt(deepest)
    b = np.append(body.b, 1 / np.sqrt(STRIKER.mass))
    K = np.diag(np.append(body.omega**2, 0.0)) + k * np.outer(b, b)
    return 2 / body.omega.max(), 2 / np.sqrt(np.linalg.eigvalsh(K)[-1])


def _edges(values: np.ndarray) -> np.ndarray:
    """Cell edges half-way between values on a logarithmic axis."""
    logs = np.log(values)
    if logs.size == 1:
        return np.exp(np.array([logs[0] - 0.5, logs[0] + 0.5]))
    inner = 0.5 * (logs[1:] + logs[:-1])
    first, last = 2 * logs[0] - inner[0], 2 * logs[-1] - inner[-1]
    return np.exp(np.concatenate(([first], inner, [last])))


def report(result: dict[str, Any]) -> None:
    tally: dict[tuple[str, str], dict[str, int]] = {}
    for row in result["runs"]:
        part = "windows" if "margin" in row else "hard" if row.get("n") is None else "N"
        kinds = tally.setdefault((row["method"], part), {})
        kinds[row["kind"]] = kinds.get(row["kind"], 0) + 1
    bad = [r for r in result["windows"] if r["method"] == "exact" and r["kind"] != "good"]
    if bad:
        span = ", ".join(f"{r['h_omega']:.2f}" for r in bad)
        print(f"exact, windows: fails at h omega_max = {span}")
    for (method, part), kinds in tally.items():
        print(f"{method:<20}{part:<9}" + "  ".join(f"{k} {v}" for k, v in kinds.items()))
    for method, limits in result["limits"].items():
        listed = "  ".join(
            f"{k} {'-' if v is None else format(v, '.3g')}" for k, v in limits.items()
        )
        print(f"{method:<20}h omega_max: {listed}")
    for row in result["runs"]:
        if "adaptive" in row["method"]:
            print(
                f"{row['scene']:<20}{row['method']:<20}{row['kind']:<10}"
                f"{row['evaluations']:>9} evaluations {row['seconds']:>8.3f} s"
                f"  drift {row['drift']:.0e}"
            )


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--most", type=options.count, default=200)
    parser.add_argument("--counts", type=options.count, default=8)
    parser.add_argument("--steps", type=options.count, default=9)
    parser.add_argument("--decades", type=options.positive, default=4.0)
    parser.add_argument("--hard", action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument("--fine", type=options.count, default=120)
    parser.add_argument("--out", type=Path, default=ROOT / "out")
    report(options.run(parser, main, arguments))


if __name__ == "__main__":
    command()
