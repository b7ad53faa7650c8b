"""Error of the force against time and force evaluations, for every integrator.

Scenes: the article's second case with 9 and with 60 anti-oscillators, the same with a contact a
million times stiffer, and the bracket, if its model file is there (`make demo` writes it). The
truth of each scene is DOP853 at its tightest tolerance; the exact method is judged by it, not
by itself. Also measured, with the error beside the time:

- the default run at tol = 1e-3 over 4 ms, with 9 to 100 anti-oscillators, at 0.01 to 10 m/s,
- the exact method against solve_ivp's best method at equal error,
- the rate of `simulate_many` with 20 anti-oscillators at 0.01 to 10 m/s,
- the time of a scene against its number of contacts: a beam that is thrown onto 1 to 6 stops,
  onto 10 to 100 stiff ones of which at most ten are closed, and under 100 balls on one site.

Seconds are those of the processor, so that other work on the machine counts little. The exact
method runs in C; the others are Python.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/work_precision.py
"""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import error_charts
import numpy as np
import options

import antiosc as ao
from antiosc import plotting
from antiosc.base import files
from antiosc.engine.march import difference
from antiosc.impact.reference import FIXED_STEP_METHODS
from antiosc.models.closed_form import UniformBeam, pinned_pinned

ROOT = Path(__file__).resolve().parent.parent
BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
STRIKER = ao.RigidMass(0.24, 0.01)
HERTZ = 1.55e10
METHODS = ("exact", *FIXED_STEP_METHODS)
SOLVE_IVP = ("RK45", "DOP853", "LSODA", "Radau")
CONTACTS = (1, 2, 3, 4, 6)
MANY = (10, 30, 100)  # contacts, most of them open
CASE_TWO = 4e-3  # s
SPEEDS = (0.01, 0.1, 1.0, 10.0)  # m/s
SWEPT = 20  # anti-oscillators of the batch
EQUAL = 1e-3  # error at which methods are compared


@dataclass(frozen=True)
class Scene:
    name: str
    model: ao.AntiOscillators
    impactor: Any
    law: ao.ContactLaw
    duration: float
    steps: np.ndarray

    def run(self, method: str, **how: Any) -> ao.History:
        return ao.simulate(self.model, self.impactor, self.law, self.duration, method, **how)


def main(
    repeats: int = 5,
    numbers: Sequence[int] = (9, 60, 20, 100),
    scenes: int = 2048,
    bracket: Path = ROOT / "out" / "bracket.npz",
    out: Path = ROOT / "out",
) -> dict[str, Any]:
    """Measure and draw; return the numbers that are printed.

    Parameters
    ----------
    repeats : runs of which the median time is taken
    numbers : of anti-oscillators for the default run; the first two are charted as well
    scenes : in the batch
    bracket : model file of the bracket; left out if missing
    out : folder of the chart and the table
    """
    out.mkdir(parents=True, exist_ok=True)
    models = {n: pinned_pinned(BEAM).anti_oscillators(n) for n in sorted({SWEPT, *numbers})}
    table = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)
        for scene in charted(models, numbers, bracket):
            table += survey(scene, repeats)
        default = [default_run(models[n], n, v, repeats) for n in sorted(numbers) for v in SPEEDS]
        batch = batch_rate(models[SWEPT], scenes, repeats)
        contacts = [crowded(stops(p, n, 1e6), repeats) for n in numbers for p in CONTACTS]
        many = [crowded(stops(p, SWEPT, 1e8), repeats) for p in MANY]
        many.append(crowded(balls(MANY[-1], models[SWEPT]), repeats, duration=1e-3))
    chart(table, out / "work_precision.png")
    chart_contacts(contacts, out / "work_precision_contacts.png")
    result = {
        "table": table,
        "default": default,
        "speedup": speedups(table),
        "batch": batch,
        "contacts": contacts,
        "many": many,
    }
    files.write_text(out / "work_precision.json", json.dumps(result, indent=1))
    return result


def charted(
    models: dict[int, ao.AntiOscillators], numbers: Sequence[int], bracket: Path
) -> list[Scene]:
    law, steps = ao.Hertz(HERTZ), 4e-5 / 2.0 ** (np.arange(0, 17) / 2)
    few, many = models[numbers[0]], models[numbers[min(1, len(numbers) - 1)]]
    scenes = [
        Scene(f"case 2, {m.n} anti-oscillators", m, STRIKER, law, 8e-3, steps) for m in (few, many)
    ]
    stiff = ao.Hertz(1e6 * HERTZ)
    scenes.append(Scene("contact × 10⁶", few, STRIKER, stiff, 1e-4, steps / 300))
    if bracket.is_file():
        model = ao.AntiOscillators.load(bracket)
        ball = ao.Sphere(0.01, 2.1e11, 0.3, 7850.0, 2.0)
        contact = ball.hertz(7e10, 0.33, (0.018, np.inf))
        scenes.append(Scene("bracket", model, ball, contact, 5e-4, steps / 10))
    return scenes


def survey(scene: Scene, repeats: int) -> list[dict[str, Any]]:
    """All methods over steps or tolerances against DOP853 at its tightest."""
    truth = scene.run("DOP853", tol=1e-6, step=float(scene.steps[6]))
    rows = []
    for method in METHODS:
        for h in scene.steps:
            rows.append(measure(scene, truth, method, {"step": float(h)}, repeats))
    for method in SOLVE_IVP:
        for tol in 10.0 ** np.arange(0, -6, -1):  # rtol is a hundredth of that
            row = measure(scene, truth, method, {"tol": min(tol, 0.5)}, 1)
            rows.append(row)
            if row["seconds"] > 5:
                break
    return rows


def measure(
    scene: Scene, truth: ao.History, method: str, how: dict[str, float], repeats: int
) -> dict[str, Any]:
    hit, seconds = timed(lambda: scene.run(method, **how), repeats)
    error = difference(hit.run, truth.run, np.inf)[0]
    failed = hit.status == 2
    return {
        "scene": scene.name,
        "method": method,
        **how,
        "error": float("inf") if failed else error,
        "seconds": seconds,
        "evaluations": hit.run.attempts,
    }


def timed(work: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """Result and median seconds of the processor."""
    seconds = []
    for _ in range(repeats):
        began = time.process_time()
        result = work()
        seconds.append(time.process_time() - began)
    return result, float(np.median(seconds))


def default_run(model: ao.AntiOscillators, n: int, speed: float, repeats: int) -> dict[str, Any]:
    """`simulate` as a user calls it, to an error of the force <= 1e-3."""
    law, striker = ao.Hertz(HERTZ), ao.RigidMass(STRIKER.mass, speed)
    model.modal()
    hit, seconds = timed(lambda: ao.simulate(model, striker, law, CASE_TWO), 20 * repeats)
    truth = ao.simulate(model, striker, law, CASE_TWO, "DOP853", tol=1e-5)
    error = difference(hit.run, truth.run, np.inf)[0]
    return {
        "n": n,
        "speed": speed,
        "seconds": seconds,
        "error": error,
        "estimate": hit.error["force"],
    }


def batch_rate(model: ao.AntiOscillators, scenes: int, repeats: int) -> dict[str, Any]:
    """Scenes a second of case 2 at all speeds, masses and contacts spread by 4, at 1e-3."""
    rng = np.random.default_rng(0)
    spread = rng.uniform(0.5, 2.0, (2, scenes))
    speeds = np.exp(rng.uniform(np.log(SPEEDS[0]), np.log(SPEEDS[-1]), scenes))
    strikers = ao.sweep(ao.RigidMass, mass=STRIKER.mass * spread[0], velocity=speeds)
    laws = ao.sweep(ao.Hertz, stiffness=HERTZ * spread[1])
    batch, seconds = timed(lambda: ao.simulate_many(model, strikers, laws, CASE_TWO), repeats)
    few = range(0, scenes, max(scenes // 20, 1))
    alone, each = timed(
        lambda: [ao.simulate(model, strikers[i], laws[i], CASE_TWO) for i in few], 1
    )
    gap = [abs(batch.peak_force[i] / h.peak_force - 1) for i, h in zip(few, alone, strict=True)]
    return {
        "scenes": scenes,
        "rate": scenes / seconds,
        "rate one by one": len(few) / each,
        "largest difference": max(gap),
        "largest error": float(batch.error.max()),
    }


def stops(p: int, n: int, stiffness: float) -> ao.Scene:
    """n modes of the pinned beam, which a pulse throws onto p stops."""
    j = np.arange(1, n + 1)
    x = (np.arange(p) + 1) / (p + 1)
    mass, omega = 2400.0 * 2e-4, (j * np.pi) ** 2 * np.sqrt(67e9 * 0.33e-8 / (2400.0 * 2e-4))
    shapes = np.sqrt(2 / mass) * np.sin(np.pi * j[:, None] * np.append(x, 0.45))
    sites = [f"s{i}" for i in range(p)]
    beam = ao.SiteModes(omega, shapes, [*sites, "pushed"])
    contacts = [ao.Contact("stop", f"beam:{s}", ao.Linear(stiffness), gap=1e-4) for s in sites]
    pulse = ao.Load("beam:pushed", [0.0, 1e-4, 2e-4], [0.0, 1e3, 0.0])
    return ao.Scene({"beam": beam, "stop": ao.Obstacle()}, contacts, loads=[pulse])


def balls(p: int, model: ao.AntiOscillators) -> ao.Scene:
    """p balls that strike one site of a beam one after the other."""
    share = np.arange(p) / p
    bodies: dict[str, Any] = {f"ball{i}": ao.RigidMass(2e-3, 1.0 + s) for i, s in enumerate(share)}
    contacts = [
        ao.Contact("beam", f"ball{i}", ao.Hertz(1e9), gap=1e-3 * s) for i, s in enumerate(share)
    ]
    return ao.Scene({"beam": model, **bodies}, contacts)


def crowded(scene: ao.Scene, repeats: int, duration: float = 3e-3) -> dict[str, Any]:
    """Time and errors of a scene with several contacts, and how many are closed at most."""
    hit, seconds = timed(lambda: scene.run(duration), repeats)
    truth = scene.run(duration, tol=1e-5)
    return {
        "n": hit.run.states.shape[2],
        "contacts": len(scene.contacts),
        "closed": int(np.count_nonzero(hit.run.force, axis=1).max()),
        "seconds": seconds,
        "steps": hit.run.steps,
        "touches": hit.run.touches,
        "error": difference(hit.run, truth.run, np.inf)[0],
        "estimate": hit.error["force"],
    }


def speedups(table: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Per scene: seconds of each method at the error `EQUAL`; exact against solve_ivp."""
    result = {}
    for scene in dict.fromkeys(r["scene"] for r in table):
        at = {
            method: seconds_at(
                [r for r in table if r["scene"] == scene and r["method"] == method], EQUAL
            )
            for method in (*METHODS, *SOLVE_IVP)
        }
        best = min(at[m] for m in SOLVE_IVP)
        result[scene] = {**at, "speedup": best / at["exact"]}
    return result


def seconds_at(rows: list[dict[str, Any]], error: float) -> float:
    """Least time of the runs that reach the error."""
    return min((r["seconds"] for r in rows if r["error"] <= error), default=float("inf"))


def chart(table: list[dict[str, Any]], path: Path) -> None:
    scenes = list(dict.fromkeys(r["scene"] for r in table))
    fig, axes = plotting.panels(len(scenes), 2, size=(8, 2.6 * len(scenes) + 0.6))
    names = {"seconds": "time (s)", "evaluations": "force evaluations"}
    styles = {m: "o-" for m in METHODS} | {m: "s--" for m in SOLVE_IVP}
    for row, scene in zip(axes, scenes, strict=True):
        mine = [r for r in table if r["scene"] == scene and 0 < r["error"] < 2]
        for ax, key in zip(row, names, strict=True):
            series = {}
            for method in styles:
                rows = [r for r in mine if r["method"] == method]
                series[method] = [r[key] for r in rows], [r["error"] for r in rows]
            error_charts.plot_errors(series, ax, styles=styles)
            ax.set_title(scene, fontsize=10)
        row[0].set_ylabel("error of the force (L2)")
    for ax, name in zip(axes[-1], names.values(), strict=True):
        ax.set_xlabel(name)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    error_charts.legend_below(fig, dict(zip(labels, handles, strict=True)), 4)
    plotting.save_figure(fig, path, dpi=120)


def chart_contacts(rows: list[dict[str, Any]], path: Path) -> None:
    fig, axes = plotting.panels(1, 2, size=(8, 3.6))
    for ax, of, unit in zip(axes.flat, ("scene", "step"), ("ms", "µs"), strict=True):
        for n in sorted({r["n"] for r in rows}):
            mine = [r for r in rows if r["n"] == n]
            each = [1e3 * r["seconds"] if of == "scene" else 1e6 * r["seconds"] / r["steps"]
                    for r in mine]  # fmt: skip
            ax.plot([r["contacts"] for r in mine], each, "o-", label=f"{n} modes")
        ax.set(xlabel="contacts", ylabel=f"time of a {of} ({unit})", ylim=(0, None))
    axes.flat[0].legend()
    plotting.save_figure(fig, path, dpi=120)


def report(result: dict[str, Any]) -> None:
    print(f"time to reach an error of {EQUAL:g}, ms")
    for scene, at in result["speedup"].items():
        listed = "  ".join(f"{m} {1e3 * s:.3g}" for m, s in at.items() if m != "speedup")
        print(f"  {scene}: {listed}")
        print(f"    exact is {at['speedup']:.0f} x faster than solve_ivp's best")
    for d in result["default"]:
        print(
            f"default run, {d['n']:>3} anti-oscillators, {d['speed']:>5g} m/s:"
            f" {1e3 * d['seconds']:.2f} ms, error {d['error']:.1e} (estimated {d['estimate']:.1e})"
        )
    b = result["batch"]
    print(
        f"batch of {b['scenes']}: {b['rate']:.0f} scenes/s, one by one {b['rate one by one']:.0f};"
        f" largest estimated error {b['largest error']:.1e},"
        f" largest difference to one by one {b['largest difference']:.0e}"
    )
    report_contacts(result["contacts"] + result["many"])
    first, *_, last = (r for r in result["many"] if r["n"] == SWEPT)
    slope = np.log(last["seconds"] / first["seconds"]) / np.log(
        last["contacts"] / first["contacts"]
    )
    print(f"exponent of the time over the number of stops: {slope:.2f}")


def report_contacts(rows: list[dict[str, Any]]) -> None:
    for r in rows:
        print(
            f"{r['n']:>3} modes, {r['contacts']} contacts, of which {r['closed']} closed at most:"
            f" {1e3 * r['seconds']:.2f} ms, {r['steps']} steps, {r['touches']} touches,"
            f" error {r['error']:.1e} (estimated {r['estimate']:.1e})"
        )


if __name__ == "__main__":
    report(options.command(main))
