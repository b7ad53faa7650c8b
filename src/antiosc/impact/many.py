"""`Many`: the results of many impacts, falls or draws, and their statistics."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, log
from pathlib import Path
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike, Figure
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr, Result
from antiosc.plot.charts import figure_or_path, panels

#: Default confidence level of the intervals.
CONFIDENCE_LEVEL = 0.95
#: Least distance of a share from 0 and 1: closer ones have no finite number of samples.
MIN_SHARE = 1e-12
#: Default probabilities of the quantiles that are printed.
QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Quantile(FieldsRepr):
    """A quantile or a probability with its confidence interval (low, high).

    A bound is infinite if the sample is too small; `note` then has the required number of results,
    and the number of runs that lack the result.
    """

    value: float
    low: float
    high: float
    note: str = ""

    def __float__(self) -> float:
        return self.value


def quantile(sample: ArrayLike, q: float, confidence: float = CONFIDENCE_LEVEL) -> Quantile:
    """The quantile `q` of a sample, with its confidence interval between order statistics.

    The number of samples below the quantile is binomial, so that the interval holds for any
    distribution (H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed., section 7.1). Samples may
    be infinite, as for runs that failed.
    """
    from scipy.stats import binom

    share = _checked_share("q", q)
    level = _checked_share("confidence", confidence)
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


def _checked_share(name: str, value: float) -> float:
    """The checked argument `name`: a share that differs from 0 and 1 by more than rounding."""
    share = checks.number(name, value)
    if not MIN_SHARE <= share <= 1 - MIN_SHARE:
        raise InputError(f"{name} must lie between 0 and 1; got {share:g}.")
    return share


def checked_levels(quantiles: Sequence[float]) -> tuple[float, ...]:
    """The distinct `quantiles`, ascending; InputError unless all are between 0 and 1."""
    shares = checks.floats("quantiles", quantiles, (None,))
    if not len(shares):
        raise InputError("quantiles is empty: give shares such as (0.05, 0.5, 0.95).")
    return tuple(_checked_share("each of quantiles", float(share)) for share in np.unique(shares))


@dataclass(frozen=True, eq=False, repr=False)
class Many(Result):
    """The results of many runs: impacts, falls, or runs with random inputs.

    Each entry of `values` and `facts` is also an attribute, such as `many.peak_force`.

    Attributes
    ----------
    values : name -> (n,) results of the runs in SI units, or (n, k) of the k impacts of each fall;
        NaN where a run failed or lacks the result.
    failures : messages of failed runs, by number of the run.
    inputs : name -> (n, ...) inputs drawn for the runs; for a sequence of values, indices into it.
    facts : name -> (n,) other data of the runs. Impacts: number of "contacts", "step" [s], "error"
        of the force (NaN if the user set the step) and "status" as in `History`, 2 for failed runs.
        Falls: number of "impacts", whether a contact "yields", and whether forces "missed" the
        tolerance.
    messages : messages of runs that did not end as requested or never touched, by number.
    force : for impacts, (times, forces) of each during contact, linear in between.
    what : "impacts", "falls" or "runs".
    note : a remark on all runs, as a sentence without its full stop.
    quantiles : probabilities of the quantiles in texts and pictures.
    """

    values: Mapping[str, Array]
    failures: Mapping[int, str]
    inputs: Mapping[str, Array] = field(default_factory=dict)
    facts: Mapping[str, Array] = field(default_factory=dict)
    messages: Mapping[int, str] = field(default_factory=dict)
    force: Sequence[tuple[Array, Array]] = ()
    what: str = "runs"
    note: str = ""
    quantiles: tuple[float, ...] = QUANTILES

    def __len__(self) -> int:
        return len(next(iter(self.values.values())))

    def __getattr__(self, name: str) -> Any:
        for results in (vars(self).get("values", {}), vars(self).get("facts", {})):
            if name in results:
                return results[name]
        raise AttributeError(f"{type(self).__name__} has no {name!r}")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.values, *self.facts})

    @property
    def status(self) -> int:
        """0 if all runs ended as requested, else 1."""
        return int(bool(self.failures or self.messages))

    @property
    def message(self) -> str:
        """Text: number of runs that failed, and that did not end as requested."""
        others = len(set(self.messages) - set(self.failures))
        told = [f"{len(self.failures)} of {len(self)} {self.what} failed"] if self.failures else []
        told += [f"{others} of {len(self)} did not end as asked"] if others else []
        return f"{', '.join(told)}." if told else "Completed."

    def largest(self, quantity: str, impact: int | None = None) -> Array:
        """Results (n,) of a quantity; for falls, the largest of each fall or, with `impact`, the
        result of its impact with this number (from 0)."""
        results = self.values[checks.choice("quantity", quantity, tuple(self.values))]
        if results.ndim == 1:
            return results
        if impact is not None:
            last = results.shape[1] - 1
            return results[:, checks.whole("impact", impact, least=0, most=last)]
        most = np.max(results, axis=1, initial=-np.inf, where=~np.isnan(results))
        return np.where(np.isfinite(most), most, np.nan)

    def finite(self, quantity: str, impact: int | None = None) -> Array:
        """Finite results (k,) of a quantity; InputError if there are none."""
        results = self.largest(quantity, impact)
        results = results[np.isfinite(results)]
        if not len(results):
            raise InputError(f"none of the {self.what} has a finite {quantity}.")
        return results

    def worst(self, quantity: str = "peak_force") -> int:
        """Number of the run with the largest result, without failed runs."""
        self.finite(quantity)
        return int(np.nanargmax(self.largest(quantity)))

    def quantile(
        self,
        quantity: str,
        q: float,
        confidence: float = CONFIDENCE_LEVEL,
        impact: int | None = None,
    ) -> Quantile:
        """The quantile `q` of a quantity, with a confidence interval between order statistics; for
        falls, of the largest value or of one impact.

        Failed runs count as larger than all others.
        """
        results = self._results_and_failures(quantity, impact)
        return self._with_notes(quantity, len(results), quantile(results, q, confidence))

    def exceedance(
        self, quantity: str, limit: float, confidence: float = CONFIDENCE_LEVEL
    ) -> Quantile:
        """The probability that a quantity exceeds `limit`, with its confidence interval; failed
        runs count as exceeding."""
        results = self._results_and_failures(quantity)
        limit = checks.number("limit", limit)
        count = int(np.sum(results > limit))

        from scipy.stats import binomtest

        # Clopper and Pearson, Biometrika 26 (1934) 404
        level = _checked_share("confidence", confidence)
        ends = binomtest(count, len(results)).proportion_ci(level, "exact")
        share = Quantile(count / len(results), float(ends.low), float(ends.high))
        return self._with_notes(quantity, len(results), share)

    def _results_and_failures(self, quantity: str, impact: int | None = None) -> Array:
        """Finite results (k,) of a quantity, plus an infinite one for each failed run."""
        return np.append(self.finite(quantity, impact), np.full(len(self.failures), np.inf))

    def _with_notes(self, quantity: str, counted: int, estimate: Quantile) -> Quantile:
        """The quantile with notes on the runs that failed or lack the quantity."""
        lacking = len(self) - counted
        of = f"of {len(self)} {self.what}"
        failed = f"{len(self.failures)} {of} failed and count as larger than all others"
        notes = [
            estimate.note,
            failed if self.failures else "",
            f"{lacking} {of} have no {quantity} and are left out" if lacking else "",
        ]
        return replace(estimate, note="; ".join(filter(None, notes)))

    def table(self) -> dict[str, Sequence[Any] | Array]:
        """Columns (n,) by name, with a row for each run: inputs that are numbers, results (largest
        of a fall), facts, failures.
        """
        drawn = {name: values for name, values in self.inputs.items() if np.ndim(values) == 1}
        results = {name: self.largest(name) for name in self.values}
        failed = [self.failures.get(i, "") for i in range(len(self))]
        return {**drawn, **results, **self.facts, "failure": failed}

    def numbers(self) -> dict[str, object]:
        """Quantiles of each quantity with a finite result, as JSON values by name; None where
        failed runs determine them."""
        found: dict[str, object] = {self.what: len(self)}

        for name in self._quantities():
            levels = {f"{100 * q:g} %": self.quantile(name, q).value for q in self.quantiles}
            found[name] = {q: value if np.isfinite(value) else None for q, value in levels.items()}

        return {**found, "status": self.status, "message": self.message}

    def plot(
        self, path: str | os.PathLike[str] | None = None, quantity: str | None = None
    ) -> Figure | Path:
        """Histogram and quantiles of a quantity (default: the first).

        With `path` (PNG, PDF, SVG, …) the picture is written and the path is returned.
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
            low = max(estimate.low, results.min())
            high = min(estimate.high, results.max())
            axes.axvspan(low, high, alpha=0.15, color="k")

        axes.set(xlabel=name.replace("_", " "), ylabel=self.what)
        axes.legend()
        return figure_or_path(figure, path)

    def _quantities(self) -> list[str]:
        """Names of the quantities with at least one finite result."""
        return [name for name in self.values if np.isfinite(self.largest(name)).any()]

    def _facts(self) -> list[tuple[str, str]]:
        """(label, value) pairs: number of runs, quantiles of the first three quantities."""
        varied = f" of {', '.join(self.inputs)}" if self.inputs else ""
        counted = " and count as the largest" if self.failures else ""
        rows = [(self.what, f"{len(self)}{varied}; {len(self.failures)} failed{counted}")]
        levels = " and ".join(f"{100 * q:g}" for q in self.quantiles[-2:])
        levels = ", ".join([*(f"{100 * q:g}" for q in self.quantiles[:-2]), levels])

        for name in self._quantities()[:3]:
            values = ", ".join(f"{self.quantile(name, q).value:.4g}" for q in self.quantiles)
            lacking = len(self) - len(self._results_and_failures(name))
            lacks = f", without {lacking} {self.what}" if lacking else ""
            rows.append((name, f"{values} at {levels} %{lacks}"))

        flags = {name: values for name, values in self.facts.items() if values.dtype == bool}
        counts = {name: int(flag.sum()) for name, flag in flags.items()}
        rows += [(name, f"{count} of {len(self)}") for name, count in counts.items() if count]
        others = {text: i for i, text in self.messages.items() if i not in self.failures}
        rows += [("message", text) for text in others]
        return rows + ([("note", self.note)] if self.note else [])
