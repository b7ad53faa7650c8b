"""Quantiles and probabilities of a sample, with the bars of its finite size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.base.texts import Given


@dataclass(frozen=True)
class Quantile(Given):
    """A quantile with the bar (low, high) of its sampling; inf where the sample is too small."""

    value: float
    low: float
    high: float

    def __float__(self) -> float:
        return self.value


def quantile(sample: ArrayLike, q: float, confidence: float = 0.95) -> Quantile:
    """The quantile `q` of a sample, with the bar between its order statistics.

    The number of samples below the quantile is binomial, so that the bar holds for any
    distribution (H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed., section 7.1).
    """
    from scipy.stats import binom

    share, level = _share("q", q), _share("confidence", confidence)
    found = np.sort(np.asarray(sample, dtype=float))
    low, high = binom.ppf([(1 - level) / 2, (1 + level) / 2], len(found), share)
    # one of the sample beyond each end, or infinity where there is none
    lower = found[int(low) - 1] if low >= 1 else -np.inf
    upper = found[int(high)] if high < len(found) else np.inf
    return Quantile(float(np.quantile(found, share)), float(lower), float(upper))


def probability(count: int, size: int, confidence: float = 0.95) -> Quantile:
    """The share count/size with its bar (Clopper and Pearson, Biometrika 26 (1934) 404)."""
    from scipy.stats import binomtest

    level = _share("confidence", confidence)
    interval = binomtest(count, size).proportion_ci(level, "exact")
    return Quantile(count / size, float(interval.low), float(interval.high))


def _share(name: str, value: float) -> float:
    share = checks.number(name, value)
    if not 0 < share < 1:
        raise InputError(f"{name} must lie between 0 and 1; got {share:g}.")
    return share
