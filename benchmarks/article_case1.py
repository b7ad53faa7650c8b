"""The article's case 1: a pinned-free beam falls on a Hertz stop with its free end, at 3 m/s.

Four models of the beam meet the stop: linear Timoshenko elements without reduction (the article's
reference), anti-oscillators extracted from them, the analytic anti-oscillators (24)-(27), and the
analytic mode superposition. What the article leaves open is whether its reference has converged:
so the elements are also measured against the beam itself, 400 natural modes with static
correction, whose frequencies are those of the exact solution.

    .venv/bin/python benchmarks/article_case1.py        (figures go to benchmarks/pictures)
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from article_beam import (
    HERTZ,
    LENGTH,
    MASS,
    PICTURES,
    Errors,
    analytic,
    analytic_families,
    compare,
    convergence,
    corrected,
    early,
    euler_bernoulli,
    lasted,
    meshed,
    norms,
    order,
    plot_convergence,
    save,
    site,
)
from beam_modes import anti_oscillators, modes

import antiosc as ao
from antiosc import plotting
from antiosc.models.closed_form import pinned_free

COUNTS = (5, 10, 20, 35, 50, 70, 90, 120, 160)


def main(
    velocity: float = 3.0,
    stiffness: float = HERTZ,
    elements: int = 100,
    duration: float = 16e-3,
    step: float = 3e-8,
    reference_modes: int = 400,
    counts: tuple[int, ...] = COUNTS,
    refinements: tuple[tuple[int, int], ...] = ((1, 50), (1, 200), (2, 100), (2, 200), (2, 400)),
    check: bool = True,
) -> dict[str, Any]:
    """Run case 1; return its numbers and the histories that the figures show.

    Parameters
    ----------
    velocity : of the tip at the first touch, m/s
    stiffness : of Hertz's law, N m^-3/2
    elements : linear elements of the reference
    duration : simulated time, s
    step : of the exact method, s; the other integrator shows whether it is short enough
    reference_modes : natural modes, statically corrected, that stand for the exact beam
    counts : numbers of degrees of freedom of the convergence study
    refinements : (order, elements) of further meshes
    check : repeat the main runs with another integrator
    """
    contact = ao.Hertz(stiffness)

    def fall(model: ao.LinearBody, **options: Any) -> ao.History:
        options = options or {"step": step}
        return ao.simulate(
            model, ao.Obstacle(), contact, duration, initial_velocity=velocity, **options
        )

    beam = pinned_free(analytic())
    x = (LENGTH / 2, LENGTH)
    part = meshed(elements, pinned=())
    tip = site(LENGTH)

    models = {
        "FE": ao.full(part, tip),
        "FE, all AO": ao.extract(part, tip, n=part.dofs - 1, method="modes", tol=1e-15),
        "AO 9": anti_oscillators(beam, 9, x),
        "AO 50": anti_oscillators(beam, 50, x),
        "modes 10": modes(beam, 10, x),
        "modes 90": modes(beam, 90, x),
        "exact": corrected(beam, reference_modes, x),
    }
    # 9 AO and 10 modes rattle: their displacement settles with the step, their force does not
    hits = {name: fall(model) for name, model in models.items()}
    other = {}
    if check:
        for name in ("FE", "FE, all AO", "AO 50", "modes 90", "exact"):
            repeated = fall(models[name], method="DOP853", tol=1e-4)
            other[name] = compare(repeated, hits[name])

    meshes: dict[tuple[int, int], Mesh] = {}
    for degree, n in ((1, elements), *refinements):
        finer = meshed(n, pinned=(), order=degree)
        # the linear ones unreduced, of the quadratic ones what matters
        model = (
            ao.full(finer, tip)
            if degree == 1
            else ao.superposition(finer, tip, min(300, 2 * n), static_correction=True)
        )
        hit = fall(model)
        again = fall(model, method="DOP853", tol=1e-4) if check else hit
        meshes[degree, n] = Mesh(
            hit.peak_force,
            compare(hit, hits["exact"]),
            again.peak_force / hit.peak_force - 1,
            compare(again, hit).force,
        )

    table = convergence(analytic_families(beam), counts, fall, hits["exact"])
    ao50 = models["AO 50"]
    euler = pinned_free(euler_bernoulli()).anti_oscillators(5)
    time = np.linspace(0, duration, 800)
    exact = mid_span(hits["exact"], time)
    fe = ao.probe(part, hits["FE, all AO"], (LENGTH / 2, 0.0), times=time)[:, 1]
    return {
        "hits": hits,
        "models": models,
        "half_period": np.pi / ao50.omega[0],
        "half_period_euler": np.pi / euler.omega[0],
        "share_five": ao50.m[:5].sum() / ao50.m_st,
        "share_five_euler": euler.m.sum() / euler.m_st,
        "first_of_effective": ao50.m[0] / ao50.m_st,
        "first_of_beam": ao50.m[0] / MASS,
        "mass_balance": abs(ao50.m0 + ao50.m.sum() - beam.static_mass) / beam.static_mass,
        "untruncated": compare(hits["FE, all AO"], hits["FE"]),
        "against_fe": {name: compare(hits[name], hits["FE"]) for name in hits if name != "FE"},
        "against_exact": {
            name: compare(hits[name], hits["exact"]) for name in hits if name != "exact"
        },
        "early": {name: early(hits[name], hits["exact"], 2e-3) for name in hits},
        "mid_span_returns": float(time[np.flatnonzero(exact < 0)[-1]]),
        "mid_span": {
            name: mid_span_error(mid_span(hits[name], time), exact)
            for name in ("AO 9", "modes 10", "AO 50", "modes 90")
        }
        | {"FE": mid_span_error(fe, exact)},
        "time": time,
        "fe_mid_span": fe,
        "integrators": other,
        "meshes": meshes,
        "counts": counts,
        "convergence": table,
        "orders": {name: order(counts, errors) for name, errors in table.items()},
        "lasted": {name: lasted(hit) for name, hit in hits.items()},
        "peak": {name: hit.peak_force for name, hit in hits.items()},
        "contacts": {name: len(hit.contacts) for name, hit in hits.items()},
        "leaves_1mm": leaves(hits["exact"], 1e-3),
    }


class Mesh(NamedTuple):
    """What a mesh gives."""

    peak: float  # N
    errors: Errors  # against the exact beam
    other_peak: float  # of the other integrator, relative difference
    other_force: float  # the same for the force in L2


def mid_span(hit: ao.History, time: np.ndarray) -> np.ndarray:
    """Displacement of mid-span, positive away from the stop."""
    return hit.field(time)[:, 0]


def mid_span_error(ours: np.ndarray, exact: np.ndarray) -> float:
    """Largest difference over the largest value."""
    return float(np.abs(ours - exact).max() / np.abs(exact).max())


def leaves(hit: ao.History, height: float) -> float:
    """When the tip is first more than `height` above the stop for good, s."""
    return float(hit.time[np.flatnonzero(hit.displacement < height)[-1]])


def figures(result: dict[str, Any], folder: Path = PICTURES) -> list[Path]:
    """The article's figures 2, 3, 4, 7 and 9, and the convergence study."""
    hits, models = result["hits"], result["models"]
    paths = []

    def done(figure: Any, name: str) -> None:
        paths.append(folder / f"article_{name}.png")
        save(figure, paths[-1])

    figure, ((axis,),) = plotting.panels(1, 1, size=(6, 3.4))
    time = result["time"]
    axis.plot(time * 1e3, result["fe_mid_span"] * 1e3, "k", label="FE")
    for name, shift in (("AO 9", 2.0), ("modes 10", -2.0)):
        label = f"{name}, shifted by {shift:+.0f} mm"
        axis.plot(time * 1e3, mid_span(hits[name], time) * 1e3 + shift, label=label)
    axis.set(xlabel="time (ms)", ylabel="mid-span displacement (mm)")
    axis.legend(fontsize=8)
    done(figure, "fig2")

    for name, number in (("AO 50", "fig3"), ("modes 90", "fig4")):
        figure, grid = plotting.panels(3, 2, size=(9, 5), sharex="col", sharey=True)
        for row, (label, style) in zip(
            grid, (("FE", "0.4"), ("exact", "k"), (name, "C3")), strict=True
        ):
            for axis, until in zip(row, (16.0, 2.0), strict=True):
                axis.plot(hits[label].time * 1e3, hits[label].force, style, lw=0.8)
                axis.set(xlim=(0, until), title=label)
            row[0].set_ylabel("force (N)")
        for axis in grid[-1]:
            axis.set_xlabel("time (ms)")
        done(figure, number)

    figure, ((axis,),) = plotting.panels(1, 1, size=(6, 2.6))
    ao50 = models["AO 50"]
    axis.bar(np.arange(1, ao50.n + 1), ao50.m / ao50.m_st)
    axis.set(xlabel="anti-oscillator", ylabel="$m_i\\,/\\,m_{st}$", yscale="log")
    done(figure, "fig7")

    figure, ((axis,),) = plotting.panels(1, 1, size=(6, 3.4))
    hit = hits["exact"]
    axis.plot(hit.time * 1e3, hit.displacement * 1e3, label="tip")
    axis.plot(time * 1e3, mid_span(hit, time) * 1e3, label="mid-span")
    axis.axvline(lasted(hit) * 1e3, color="0.5", label="last contact")
    axis.axvline(result["half_period"] * 1e3, color="0.5", ls=":", label="half period of AO 1")
    axis.set(xlabel="time (ms)", ylabel="displacement (mm)")
    axis.legend(fontsize=8)
    done(figure, "fig9")

    path = folder / "article_convergence1.png"
    plot_convergence(result["counts"], norms(result["convergence"]), path)
    return [*paths, path]


if __name__ == "__main__":
    print(*figures(main()), sep="\n")
