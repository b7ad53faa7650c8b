"""`monte_carlo`: runs with inputs drawn from distributions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from antiosc import ImpactMap, Many, simulate_many
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyWarning, AntioscError, InputError, warn, without_warnings
from antiosc.base.progress import counting
from antiosc.impact.many import QUANTILES, checked_levels

#: Runs that are simulated together as one batch.
BATCH_SIZE = 100
#: First runs, computed before all others: if all of them fail alike, the study ends. Of runs of
#: which a half fails, that is a chance of 0.1 %.
MIN_RUNS_BEFORE_STOP = 10
#: Most runs of a study.
MAX_RUNS = 10_000_000
#: Results of an impact that are kept.
IMPACT_QUANTITIES = ("peak_force", "impulse", "contact_time", "restitution")
#: Results of a run by name, or the message of its failure.
RunResults = dict[str, float] | str


def normal(mean: float, sigma: float | None = None, *, variation: float | None = None) -> Any:
    """The normal distribution of this mean and standard deviation, both in the input's unit.

    `variation` may be given instead of `sigma`: standard deviation over mean, as for `lognormal`.
    Returns a frozen distribution of scipy.stats, as do `lognormal` and `uniform`.
    """
    from scipy.stats import norm

    mean = checks.number("mean", mean)
    if (sigma is None) == (variation is None):
        raise InputError("sigma, or variation (sigma over the mean): normal takes one of them.")
    if variation is not None:
        sigma = checks.positive("variation", variation) * abs(mean)
    return norm(mean, checks.positive("sigma", sigma))


def lognormal(mean: float, variation: float) -> Any:
    """The lognormal distribution of this mean and coefficient of variation.

    `variation` is the standard deviation over the mean: lognormal(70e9, 0.03) is 70 GPa ± 3 %.
    """
    from scipy.stats import lognorm

    mean = checks.positive("mean", mean)
    variation = checks.positive("variation", variation)
    sigma = np.sqrt(np.log1p(variation**2))
    return lognorm(sigma, scale=mean * np.exp(-(sigma**2) / 2))


def uniform(low: float, high: float) -> Any:
    """The uniform distribution between `low` and `high`."""
    from scipy.stats import uniform as between

    low = checks.number("low", low)
    high = checks.number("high", high)
    if not low < high:
        raise InputError(f"low must be below high; got {low:g} and {high:g}.")
    return between(low, high - low)


def checked_inputs(inputs: object) -> dict[str, Any]:
    """The inputs of a study by name, distributions or sequences; InputError if not."""
    kind = 'a dict, such as {"velocity": normal(2.0, 0.1)}'
    by_name = dict(checks.instance("inputs", inputs, Mapping, kind))
    if not by_name:
        raise InputError("inputs is empty: name at least one input and its distribution.")

    for name, distribution in by_name.items():
        if not isinstance(name, str) or not all(map(str.isidentifier, name.split("."))):
            raise InputError(f"{checks.shown(name)} is no name of an argument.")
        is_text = isinstance(distribution, str)
        listed = not is_text and isinstance(distribution, Sequence | np.ndarray | ImpactMap)
        if not (listed and len(distribution)) and not hasattr(distribution, "ppf"):
            raise InputError(
                f"{name} must be a distribution with `ppf`, such as normal(2.0, 0.1) or one of"
                " scipy.stats, a sequence of values, or an ImpactMap; got"
                f" {checks.shown(distribution)}."
            )

    return by_name


def input_draws(inputs: Mapping[str, Any], n: int, seed: int) -> dict[str, np.ndarray]:
    """`n` independent draws of each input: numbers, or indices into a sequence of values.

    Sites of an `ImpactMap` are drawn by their areas. Draw i of an input depends only on `seed`, on
    i and on the position of the input, so that a larger `n` begins with the draws of a smaller one.
    """
    draws_by_name = {}
    streams = np.random.SeedSequence(seed).spawn(len(inputs))
    for stream, (name, distribution) in zip(streams, inputs.items(), strict=True):
        shares = np.random.default_rng(stream).random(n)
        if hasattr(distribution, "ppf"):
            draws_by_name[name] = input_quantiles(name, distribution, shares)
        else:
            of_map = isinstance(distribution, ImpactMap)
            weights = distribution.areas if of_map else np.ones(len(distribution))
            ends = np.cumsum(weights) / np.sum(weights)
            draws_by_name[name] = np.searchsorted(ends[:-1], shares, side="right")

    return draws_by_name


def input_quantiles(name: str, distribution: Any, shares: np.ndarray) -> np.ndarray:
    """Quantiles (n,) of an input at `shares`; InputError if `ppf` returns invalid ones."""
    try:
        values = distribution.ppf(shares)
    except Exception as error:  # of any package
        cause = f"{type(error).__name__}: {error}"
        raise InputError(
            f"ppf of {name} must take an array of shares; it failed ({cause})."
        ) from error
    return checks.floats(f"what ppf of {name} returns", values, shares.shape)


def drawn_value(distribution: Any, draw: Any) -> Any:
    """The argument of the run function for one draw: a number, a listed value or a model."""
    if hasattr(distribution, "ppf"):
        return float(draw)
    if isinstance(distribution, ImpactMap):
        return distribution.model(int(draw))
    return distribution[int(draw)]


def monte_carlo(
    run: Callable[..., Any],
    inputs: Mapping[str, Any],
    n: int = 1000,
    *,
    seed: int = 0,
    quantiles: Sequence[float] = QUANTILES,
) -> Many:
    """Repeat a run with independent random inputs: the distribution of its results.

    Parameters
    ----------
    run : callable
        A function of the inputs' names. It returns the arguments of `simulate`, (model, impactor,
        contact, duration), and the impacts are then simulated in batches; or a `History`; or
        numbers by name; or one number. Create objects that no input changes, such as a model, once
        outside of it. If it raises an AntioscError, the run counts as failed with this message.
    inputs : dict
        Name -> distribution: `normal`, `lognormal`, `uniform`, or any frozen distribution of
        scipy.stats; a sequence of equally probable values (points, models, laws); or an
        `ImpactMap`, for which the function gets the model at a site that is drawn by area.
    n : int
        Number of runs.
    seed : int
        Seed of the draws. With the same seed and a larger n, the first runs stay the same.
    quantiles : sequence of floats
        Probabilities of the quantiles in tables and pictures; default: the median and the ends of
        the middle 90 %. 1 % of the results are above the quantile 0.99.

    Returns
    -------
    Many

    Warns
    -----
    AccuracyWarning
        Some runs failed.

    Raises
    ------
    InputError
        Inputs that are not distributions; a `run` that returns something else.
    AntioscError
        All runs fail, or the first ten fail with the same message.
    """
    checks.function("run", run, "a function of the inputs")
    by_name = checked_inputs(inputs)
    levels = checked_levels(quantiles)
    size = checks.whole("n", n, most=MAX_RUNS)
    draws = input_draws(by_name, size, checks.whole("seed", seed, least=0))
    columns = [[drawn_value(by_name[name], draw) for draw in draws[name]] for name in by_name]
    arguments = [dict(zip(by_name, values, strict=True)) for values in zip(*columns, strict=True)]
    rows: list[RunResults] = []

    with counting("runs", size) as report:
        while len(rows) < size:
            count = BATCH_SIZE if rows else MIN_RUNS_BEFORE_STOP
            rows += rows_of_runs(run, arguments[len(rows) :][:count])
            report(len(rows))

            if len(rows) == MIN_RUNS_BEFORE_STOP < size:
                _refuse_if_all_failed(rows, size)

    sample = sample_of_runs("runs", draws, rows)
    return replace(sample, quantiles=levels)


def _refuse_if_all_failed(first: list[RunResults], size: int) -> None:
    """AntioscError if the first runs (of `size`) have all failed with the same message."""
    if isinstance(first[0], str) and first.count(first[0]) == len(first):
        raise AntioscError(
            f"the first {len(first)} of {size} runs failed alike, and the others were not begun:"
            f" {first[0]}"
        )


def rows_of_runs(run: Callable[..., Any], arguments: list[dict[str, Any]]) -> list[RunResults]:
    """Results of some runs; if `run` returns arguments, all impacts are simulated in one batch."""
    rows: list[RunResults] = [""] * len(arguments)
    scenes: dict[int, tuple[object, ...]] = {}

    with without_warnings():
        for i, values in enumerate(arguments):
            try:
                outcome = run(**values)
            except AntioscError as error:
                rows[i] = f"{type(error).__name__}: {error}"
                continue
            if isinstance(outcome, tuple):
                scenes[i] = outcome
            else:
                rows[i] = _results_of(outcome)
        if scenes:
            results = _batch_results(list(scenes.values()))
            for i, row in zip(scenes, results, strict=True):
                rows[i] = row

    return rows


def _batch_results(scenes: list[tuple[object, ...]]) -> list[RunResults]:
    """Results of impacts (model, impactor, contact, duration), simulated as one batch."""
    if any(len(scene) != 4 for scene in scenes):
        raise InputError("a tuple that `run` returns must be (model, impactor, contact, duration).")
    models, impactors, contacts, durations = map(list, zip(*scenes, strict=True))
    try:
        batch = simulate_many(models, impactors, contacts, durations)
    except AntioscError as error:  # of one scene, or of all
        if len(scenes) == 1:
            return [str(error)]
        return [r for s in scenes for r in _batch_results([s])]
    return [
        batch.failures.get(i) or {name: float(batch.values[name][i]) for name in IMPACT_QUANTITIES}
        for i in range(len(scenes))
    ]


def _results_of(outcome: object) -> RunResults:
    """The results of one run by name."""
    if all(hasattr(outcome, name) for name in IMPACT_QUANTITIES):
        outcome = {name: getattr(outcome, name) for name in IMPACT_QUANTITIES}
    if isinstance(outcome, Mapping):
        return {str(name): _result_number(str(name), value) for name, value in outcome.items()}
    return {"value": _result_number("what `run` returns", outcome)}


def _result_number(name: str, value: object) -> float:
    """A result as a float; NaN for None and for numbers that are not finite."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return np.nan
    return checks.number(name, value)


def sample_of_runs(what: str, drawn: dict[str, Array], rows: list[RunResults]) -> Many:
    """The sample of all runs (or falls: `what`); warns of failures, AntioscError if all failed."""
    failed = {i: row for i, row in enumerate(rows) if isinstance(row, str)}
    if len(failed) == len(rows):
        raise AntioscError(f"all {len(rows)} {what} failed, the first one so: {failed[0]}")
    if failed:
        told = f"{len(failed)} of {len(rows)} {what} failed and count as larger than all others"
        first = next(iter(failed.values()))
        warn(f"{told} (see .failures); the first one: {first}", AccuracyWarning)

    results = [{} if isinstance(row, str) else row for row in rows]
    names = dict.fromkeys(name for row in results for name in row)
    values = {name: np.array([row.get(name, np.nan) for row in results]) for name in names}
    return Many(values, failed, drawn, what=what)
