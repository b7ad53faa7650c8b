"""`Sample`: the runs of a Monte Carlo study and their statistics."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, log
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr, Result
from antiosc.plot.charts import figure_or_path, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Share of the samples within a confidence interval.
CONFIDENCE = 0.95
#: Shares of the results below the quantiles that are told, unless others are asked for.
QUANTILES = (0.05, 0.5, 0.95)
#: Note on runs that failed: their number, and of how many.
FAILED = "{} {} failed and count as larger than all others"


@dataclass(frozen=True)
class Quantile(FieldsRepr):
    """A quantile or a probability with its confidence interval (low, high).

    An end is infinite if the sample is too small for it; `note` then gives the number of results
    that it takes, and of runs that lack the result.
    """

    value: float
    low: float
    high: float
    note: str = ""

    def __float__(self) -> float:
        return self.value


def quantile(sample: ArrayLike, q: float, confidence: float = 0.95) -> Quantile:
    """The quantile `q` of a sample, with its confidence interval between order statistics.

    The number of samples below the quantile is binomial, so that the interval holds for any
    distribution (H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed., section 7.1). Samples may
    be infinite, as those of runs that failed.
    """
    from scipy.stats import binom

    share = _share("q", q)
    level = _share("confidence", confidence)
    ordered = np.sort(np.asarray(sample, dtype=float))
    tail = (1 - level) / 2
    low, high = binom.ppf([tail, 1 - tail], len(ordered), share)
    # the order statistic beyond each end, or infinity if there is none
    lower = ordered[int(low) - 1] if low >= 1 else -np.inf
    upper = ordered[int(high)] if high < len(ordered) else np.inf
    lacking = [
        f"{len(ordered)} results are too few for the {end} end of the bar, "
        f"{ceil(log(tail) / log(p))}"
        " have one"
        for end, p, none in (("lower", 1 - share, low < 1), ("upper", share, high >= len(ordered)))
        if none
    ]
    with np.errstate(invalid="ignore"):
        value = float(np.quantile(ordered, share))
    if np.isnan(value):  # beside or among infinite ones
        value = float(ordered[ceil(share * (len(ordered) - 1))])
    return Quantile(value, float(lower), float(upper), "; ".join(lacking))


def finite_or_none(estimate: Quantile) -> float | None:
    """The value of a quantile as JSON has it: None where runs that failed decide on it."""
    return estimate.value if np.isfinite(estimate.value) else None


def probability(count: int, size: int, confidence: float = 0.95) -> Quantile:
    """The probability count/size with its interval (Clopper and Pearson, Biometrika 26 (1934)
    404).
    """
    from scipy.stats import binomtest

    level = _share("confidence", confidence)
    interval = binomtest(count, size).proportion_ci(level, "exact")
    return Quantile(count / size, float(interval.low), float(interval.high))


def levels_text(shares: Sequence[float]) -> str:
    """Shares as text: "5, 50 and 95 %"."""
    *others, last = (f"{100 * share:g}" for share in shares)
    return f"{' and '.join(filter(None, [', '.join(others), last]))} %"


def checked_levels(quantiles: Sequence[float]) -> tuple[float, ...]:
    """Different shares between 0 and 1, in order; InputError for others."""
    shares = checks.floats("quantiles", quantiles, (None,))
    if not len(shares):
        raise InputError("quantiles is empty: give shares such as (0.05, 0.5, 0.95).")
    return tuple(_share("each of quantiles", float(share)) for share in np.unique(shares))


def _share(name: str, value: float) -> float:
    share = checks.number(name, value)
    if not 0 < share < 1:
        raise InputError(f"{name} must lie between 0 and 1; got {share:g}.")
    return share


@dataclass(frozen=True, eq=False, repr=False)
class Sample(Result):
    """The runs of a Monte Carlo study.

    Attributes
    ----------
    inputs : name -> (n,) draws of each input; indices into it, if it is a sequence of values.
    values : name -> (n,) results in SI units, NaN where a run failed or lacks the result.
    failed : number of each run that failed -> its message.
    quantiles : shares of the results below the quantiles that tables and pictures have.
    """

    inputs: dict[str, Array]
    values: dict[str, Array]
    failed: dict[int, str]
    quantiles: tuple[float, ...] = QUANTILES

    def __len__(self) -> int:
        return len(next(iter(self.inputs.values())))

    @property
    def status(self) -> int:
        """1 if runs failed, else 0."""
        return int(bool(self.failed))

    @property
    def message(self) -> str:
        """Number of failed runs, as a sentence."""
        return f"{len(self.failed)} of {len(self)} runs failed." if self.failed else "Completed."

    def numbers(self) -> dict[str, object]:
        """Quantiles of each quantity with a finite result: name -> JSON value."""
        levels = {f"{100 * share:g} %": share for share in self.quantiles}
        available = [name for name, results in self.values.items() if np.isfinite(results).any()]
        return {
            "runs": len(self),
            **{
                name: {text: finite_or_none(self.quantile(name, q)) for text, q in levels.items()}
                for name in available
            },
            "status": self.status,
            "message": self.message,
        }

    def finite(self, quantity: str) -> Array:
        """(k,) finite results of a quantity; InputError if it is unknown or there are none."""
        results = self._of(quantity)
        results = results[np.isfinite(results)]
        if not len(results):
            raise InputError(f"no run has a finite {quantity}.")
        return results

    def quantile(self, quantity: str, q: float, confidence: float = CONFIDENCE) -> Quantile:
        """The quantile `q` of a quantity with its confidence interval; see `sample.quantile`.

        A run that failed counts as larger than all others.
        """
        return self._noted(quantity, quantile(self._with_failed(quantity), q, confidence))

    def exceedance(self, quantity: str, limit: float, confidence: float = CONFIDENCE) -> Quantile:
        """The probability that a quantity exceeds `limit`, with its confidence interval; runs that
        failed exceed it.
        """
        results = self._with_failed(quantity)
        limit = checks.number("limit", limit)
        share = probability(int(np.sum(results > limit)), len(results), confidence)
        return self._noted(quantity, share)

    def _with_failed(self, quantity: str) -> Array:
        """(k,) finite results of a quantity, and an infinite one for each run that failed."""
        return np.append(self.finite(quantity), np.full(len(self.failed), np.inf))

    def _noted(self, quantity: str, estimate: Quantile) -> Quantile:
        """The quantile with notes on the runs that failed or lack the quantity."""
        lacking = len(self) - len(self._with_failed(quantity))
        of = f"of {len(self)} runs"
        notes = [
            estimate.note,
            FAILED.format(len(self.failed), of) if self.failed else "",
            f"{lacking} {of} have no {quantity} and are left out" if lacking else "",
        ]
        return replace(estimate, note="; ".join(filter(None, notes)))

    def plot(
        self, path: str | os.PathLike[str] | None = None, quantity: str | None = None
    ) -> Figure | Path:
        """Histogram and quantiles of a quantity (default: the first).

        With `path` (PNG, PDF, SVG, …) the picture is written, and the path returned.
        """
        name = next(iter(self.values)) if quantity is None else quantity
        results = self.finite(name)
        figure, ((axes,),) = panels(1, 1, (6.4, 4.0), shown=path is None)
        axes.hist(results, bins="auto", color="tab:blue", alpha=0.6)
        for q in self.quantiles:
            estimate = self.quantile(name, q)
            if not np.isfinite(estimate.value):
                continue
            line = axes.axvline(estimate.value, color="black", linestyle="--" if q != 0.5 else "-")
            line.set_label(f"{100 * q:g} %: {estimate.value:.4g}")
            axes.axvspan(
                max(estimate.low, results.min()),
                min(estimate.high, results.max()),
                alpha=0.15,
                color="k",
            )
        axes.set(xlabel=name.replace("_", " "), ylabel="runs")
        axes.legend()
        return figure_or_path(figure, path)

    def _of(self, quantity: str) -> Array:
        """Results (n,) of a quantity."""
        return self.values[checks.choice("quantity", quantity, tuple(self.values))]

    def _facts(self) -> list[tuple[str, str]]:
        facts = [("runs", f"{len(self)} of {', '.join(self.inputs)}; {len(self.failed)} failed")]
        for name in list(self.values)[:3]:
            values = ", ".join(f"{self.quantile(name, s).value:.4g}" for s in self.quantiles)
            lacking = len(self) - len(self._with_failed(name))
            note = f", without {lacking} runs" if lacking else ""
            facts.append((name, f"{values} at {levels_text(self.quantiles)}{note}"))
        return facts
