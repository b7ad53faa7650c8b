"""The article's case 2: a mass strikes a pinned-pinned beam at mid-span.

The mass is half the beam's, it comes with 0.01, 1, 10 and 100 m/s. All models stem from 50 linear
Timoshenko elements: unreduced, natural modes, anti-oscillators. The article gives no Hertz
stiffness here; the sweep shows what follows from which, and case 1's value is used.

    .venv/bin/python benchmarks/article_case2.py        (figures go to benchmarks/pictures)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from article_beam import (
    HERTZ,
    LENGTH,
    MASS,
    PICTURES,
    Errors,
    Panel,
    analytic,
    analytic_families,
    compare,
    corrected,
    euler_bernoulli,
    lasted,
    meshed,
    meshed_families,
    norms,
    order,
    plot_convergence,
    save,
    site,
)
from beam_modes import frequencies

import antiosc as ao
from antiosc import plotting
from antiosc.models.closed_form import pinned_pinned

COUNTS = (4, 6, 9, 12, 15, 20, 30, 45, 70, 100, 140)
FE_COUNTS = tuple(range(3, 50))
SWEEP = (1e9, 1.5e9, 2e9, 2.5e9, 3e9, 4e9, 6e9, 8e9, 1e10, 1.55e10, 3e10, 1e11)
GOOD = (0.1, 0.05, 0.01)  # force errors in L2 that count as a good agreement


def main(
    velocities: Sequence[float] = (0.01, 1.0, 10.0, 100.0),
    stiffness: float = HERTZ,
    elements: int = 50,
    duration: float = 4e-3,
    tol: float = 1e-4,
    counts: tuple[int, ...] = COUNTS,
    sweep: Sequence[float] = SWEEP,
    fe_counts: Sequence[int] = FE_COUNTS,
    reference_modes: int = 200,
    check: bool | Sequence[str] = True,
) -> dict[str, Any]:
    """Run case 2; return its numbers and the histories that the figures show.

    Parameters
    ----------
    velocities : of the mass, m/s; the first is the article's
    stiffness : of Hertz's law, N m^-3/2
    elements : linear elements
    duration : simulated time, s
    tol : of the force histories' time integration
    counts : numbers of degrees of freedom of the convergence study
    sweep : Hertz stiffnesses of the sensitivity study
    fe_counts : numbers of degrees of freedom tried against the elements
    reference_modes : natural modes, statically corrected, that stand for the exact beam
    check : repeat the main runs, all or those of models of these names, with another integrator
    """

    def strike(
        model: ao.LinearBody, velocity: float = velocities[0], k: float = stiffness, **options: Any
    ) -> ao.History:
        options = {"tol": tol, "max_steps": 10_000_000} | options
        mass = ao.RigidMass(MASS / 2, velocity)
        return ao.simulate(model, mass, ao.Hertz(k), duration, **options)

    beam = pinned_pinned(analytic())
    part = meshed(elements, pinned=("right",))
    middle = site(LENGTH / 2)
    families = meshed_families(part, middle)
    models = {
        "FE": ao.full(part, middle),
        "FE, all AO": ao.extract(part, middle, n=part.dofs - 1, method="modes", tol=1e-15),
        "AO 9": families[0].model(9),
        "modes 5": families[1].model(5),
        "modes 8": families[1].model(8),
        "modes 10": families[1].model(10),
        "modes 15": families[1].model(15),
        "exact": corrected(beam, reference_modes),
    }
    hits = {name: strike(model) for name, model in models.items()}
    other = {}
    if check:
        for name in hits if check is True else check:
            repeated = strike(models[name], method="DOP853", tol=tol / 10)
            other[name] = compare(repeated, hits[name])

    reduced = {f.name: [f.model(n) for n in fe_counts] for f in families}
    analytic_models = {f.name: [f.model(n) for n in counts] for f in analytic_families(beam)}
    untruncated: dict[float, Errors] = {}
    needed: dict[float, Any] = {}
    needed_exact: dict[float, Any] = {}
    tables: dict[float, dict[str, list[Errors]]] = {}
    for velocity in velocities:
        reference = strike(models["FE"], velocity)
        same, plain = (
            strike(models[name], velocity, step=reference.step) for name in ("FE, all AO", "FE")
        )
        untruncated[velocity] = compare(same, plain)
        errors = {
            family.name: [
                compare(strike(m, velocity), reference).force for m in reduced[family.name]
            ]
            for family in families
        }
        needed[velocity] = {
            name: tuple(first_good(fe_counts, row, good) for good in GOOD)
            for name, row in errors.items()
        }
        exact = strike(models["exact"], velocity)
        tables[velocity] = {
            name: [compare(strike(m, velocity), exact) for m in row]
            for name, row in analytic_models.items()
        }
        needed_exact[velocity] = {
            name: tuple(first_good(counts, [e.force for e in row], good) for good in GOOD)
            for name, row in tables[velocity].items()
        }

    # the other integrator has repeated those of `stiffness` already
    swept = {k: sensitivity(models, k, strike, bool(check) and k != stiffness) for k in sweep}
    ao_exact = beam.anti_oscillators(60)
    constrained = frequencies(beam, 60, held=True)
    seen = np.isclose(constrained[:, None], ao_exact.omega, rtol=1e-9).any(axis=1)
    return {
        "hits": hits,
        "models": models,
        "half_period": np.pi / ao_exact.omega[0],
        "half_period_euler": np.pi / pinned_pinned(euler_bernoulli()).anti_oscillators(1).omega[0],
        "share_five": ao_exact.m[:5].sum() / ao_exact.m_st,
        "share_five_fe": models["AO 9"].m[:5].sum() / models["AO 9"].m_st,
        "share_first_five_modes": ao_exact.m[: np.count_nonzero(seen[:5])].sum() / ao_exact.m_st,
        "first_of_effective": ao_exact.m[0] / ao_exact.m_st,
        "first_of_beam": ao_exact.m[0] / MASS,
        "mass_balance": max(
            abs(models["FE, all AO"].truncated(n).m_st / models["FE, all AO"].m_st - 1)
            for n in range(models["FE, all AO"].n)
        ),
        "against_fe": {name: compare(hits[name], hits["FE"]) for name in hits if name != "FE"},
        "fe_against_exact": compare(hits["FE"], hits["exact"]),
        "integrators": other,
        "untruncated": untruncated,
        "needed": needed,
        "needed_exact": needed_exact,
        "sweep": swept,
        "stiffness_for": {
            name: {t: stiffness_for(t, swept, name) for t in (2.45, 2.4, 2.35)}
            for name in ("contact_time", "contact_time_fe")
        },
        "lasted": {name: lasted(hit) for name, hit in hits.items()},
        "peak": {name: hit.peak_force for name, hit in hits.items()},
        "contacts": {name: len(hit.contacts) for name, hit in hits.items()},
        "counts": counts,
        "convergence": tables,
        "orders": {
            velocity: {name: order(counts, errors) for name, errors in table.items()}
            for velocity, table in tables.items()
        },
    }


def first_good(counts: Sequence[int], errors: Sequence[float], good: float) -> int:
    """The count from which on every error is below `good`; 0 if there is none."""
    bad = np.flatnonzero(~(np.array(errors) < good))
    first = 0 if bad.size == 0 else int(bad[-1]) + 1
    return counts[first] if first < len(errors) else 0


def sensitivity(models: dict[str, Any], k: float, strike: Any, check: bool) -> dict[str, float]:
    """What one Hertz stiffness gives: contact times (ms), peaks (N), errors of the force in L2."""
    hits = {
        name: strike(models[name], k=k)
        for name in ("exact", "FE", "AO 9", "modes 5", "modes 8", "modes 10", "modes 15")
    }
    errors = {
        name: compare(hit, hits["FE"]).force
        for name, hit in hits.items()
        if name not in ("exact", "FE")
    }
    other = 0.0
    if check:
        again = {name: strike(models[name], k=k, method="DOP853") for name in ("exact", "FE")}
        other = max(compare(again[name], hits[name]).peak for name in again)
    return {
        "other_peak": other,
        "contact_time": lasted(hits["exact"]) * 1e3,
        "contact_time_fe": lasted(hits["FE"]) * 1e3,
        "peak": hits["exact"].peak_force,
        **errors,
    }


def stiffness_for(time: float, swept: dict[float, dict[str, float]], name: str) -> float:
    """The Hertz stiffness whose contact time (ms) is `time`, between those of the sweep."""
    k, times = np.array(list(swept)), np.array([row[name] for row in swept.values()])
    return float(np.exp(np.interp(-time, -times, np.log(k))))


def figures(result: dict[str, Any], folder: Path = PICTURES) -> list[Path]:
    """The article's figures 5, 6, 8 and 10, the sensitivity and the convergence study."""
    hits, models = result["hits"], result["models"]
    paths = []

    def done(figure: Any, name: str) -> None:
        paths.append(folder / f"article_{name}.png")
        save(figure, paths[-1])

    for names, number in ((("modes 5", "modes 10"), "fig5"), (("AO 9",), "fig6")):
        figure, ((axis,),) = plotting.panels(1, 1, size=(6, 3))
        axis.plot(hits["FE"].time * 1e3, hits["FE"].force, "0.75", lw=4, label="FE")
        for name in names:
            axis.plot(hits[name].time * 1e3, hits[name].force, lw=1, label=name)
        axis.set(xlim=(0, 3), xlabel="time (ms)", ylabel="force (N)")
        axis.legend(fontsize=8)
        done(figure, number)

    figure, ((axis,),) = plotting.panels(1, 1, size=(6, 2.6))
    full = models["FE, all AO"]
    axis.bar(np.arange(1, 11), full.m[:10] / full.m_st)
    axis.set(xlabel="anti-oscillator", ylabel="$m_i\\,/\\,m_{st}$")
    done(figure, "fig8")

    figure, ((axis,),) = plotting.panels(1, 1, size=(6, 3.4))
    hit = hits["exact"]
    axis.plot(hit.time * 1e3, hit.displacement * 1e6, "--", label="beam")
    axis.plot(hit.time * 1e3, hit.impactor_displacement * 1e6, label="mass")
    axis.axvline(lasted(hit) * 1e3, color="0.5", label="last contact")
    axis.axvline(result["half_period"] * 1e3, color="0.5", ls=":", label="half period of AO 1")
    axis.set(xlabel="time (ms)", ylabel="displacement (µm)")
    axis.legend(fontsize=8)
    done(figure, "fig10")

    figure, grid = plotting.panels(1, 2, size=(9, 3.4))
    axes = grid.ravel()
    k = np.array(list(result["sweep"]))
    rows = list(result["sweep"].values())
    for name, label in (("contact_time", "exact"), ("contact_time_fe", "FE")):
        axes[0].semilogx(k, [row[name] for row in rows], "o-", ms=3, label=label)
    axes[0].axhspan(2.35, 2.45, color="0.85", label="article, 2.4")
    axes[0].set(xlabel="Hertz stiffness (N m$^{-3/2}$)", ylabel="contact time (ms)")
    for name in ("AO 9", "modes 5", "modes 8", "modes 10", "modes 15"):
        axes[1].loglog(k, [row[name] for row in rows], "o-", ms=3, label=name)
    axes[1].set(xlabel="Hertz stiffness (N m$^{-3/2}$)", ylabel="force error, L2")
    for axis in axes:
        axis.legend(fontsize=8)
    done(figure, "stiffness")

    counts, tables = result["counts"], result["convergence"]
    paths += [folder / "article_convergence2.png", folder / "article_velocities.png"]
    plot_convergence(counts, norms(next(iter(tables.values()))), paths[-2])
    plot_convergence(counts, [Panel(f"{v:g} m/s", t) for v, t in tables.items()], paths[-1])
    return paths


if __name__ == "__main__":
    print(*figures(main()), sep="\n")
