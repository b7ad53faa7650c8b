"""Uncertain inputs: their distributions, and the draws of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.studies.map_results import ImpactMap


def normal(mean: float, sigma: float) -> Any:
    """The normal distribution of this mean and standard deviation, both in the input's unit.

    Returns a frozen distribution of scipy.stats, as do `lognormal` and `uniform`.
    """
    from scipy.stats import norm

    return norm(checks.number("mean", mean), checks.positive("sigma", sigma))


def lognormal(mean: float, variation: float) -> Any:
    """The lognormal distribution of this mean and coefficient of variation.

    `variation` is the standard deviation over the mean: lognormal(70e9, 0.03) is 70 GPa ± 3 %.
    """
    from scipy.stats import lognorm

    mean, variation = checks.positive("mean", mean), checks.positive("variation", variation)
    spread = np.sqrt(np.log1p(variation**2))
    return lognorm(spread, scale=mean * np.exp(-(spread**2) / 2))


def uniform(low: float, high: float) -> Any:
    """The uniform distribution between `low` and `high`."""
    from scipy.stats import uniform as between

    low, high = checks.number("low", low), checks.number("high", high)
    if not low < high:
        raise InputError(f"low must be below high; got {low:g} and {high:g}.")
    return between(low, high - low)


def is_name(name: Any) -> bool:
    """Whether a function can take an argument of this name: "mass", "impactor.mass"."""
    return isinstance(name, str) and all(part.isidentifier() for part in name.split("."))


def checked(inputs: Any) -> dict[str, Any]:
    """The inputs of a study, each a distribution or a sequence of values; InputError if not."""
    kind = 'a dict, such as {"velocity": normal(2.0, 0.1)}'
    given = dict(checks.instance("inputs", inputs, Mapping, kind))
    if not given:
        raise InputError("inputs is empty: name at least one input and its distribution.")
    for name, what in given.items():
        if not is_name(name):
            raise InputError(f"{checks.shown(name)} is no name of an argument.")
        many = isinstance(what, Sequence | np.ndarray | ImpactMap) and not isinstance(what, str)
        if not (many and len(what)) and not hasattr(what, "ppf"):
            raise InputError(
                f"{name} must be a distribution with `ppf`, such as normal(2.0, 0.1) or one of"
                " scipy.stats, a sequence of values, or an ImpactMap; got"
                f" {checks.shown(what)}."
            )
    return given


def draws(inputs: Mapping[str, Any], n: int, seed: int) -> dict[str, np.ndarray]:
    """`n` independent draws of each input: numbers, or indices of values, of sites by their areas.

    Draw i of an input depends on `seed`, on i and on the place of the input alone, so that a
    larger `n` begins with the draws of a smaller one.
    """
    found = {}
    streams = np.random.SeedSequence(seed).spawn(len(inputs))
    for stream, (name, what) in zip(streams, inputs.items(), strict=True):
        shares = np.random.default_rng(stream).random(n)
        if hasattr(what, "ppf"):
            found[name] = np.asarray(what.ppf(shares), dtype=float)
            if found[name].shape != (n,) or not np.all(np.isfinite(found[name])):
                raise InputError(f"the distribution of {name} gives values that are not finite.")
        else:
            weights = what.areas if isinstance(what, ImpactMap) else np.ones(len(what))
            ends = np.cumsum(weights) / np.sum(weights)
            found[name] = np.searchsorted(ends[:-1], shares, side="right")
    return found


def value(what: Any, drawn: Any) -> Any:
    """What the function of a study is given for a draw of an input."""
    if hasattr(what, "ppf"):
        return float(drawn)
    return what.model(int(drawn)) if isinstance(what, ImpactMap) else what[int(drawn)]
