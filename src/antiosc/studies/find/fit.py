"""Gauss–Newton for one blow, with the errors of the model as unknowns of known size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from antiosc.base._types import Array
from antiosc.simulation.histories.history import History
from antiosc.studies.find.forward import Blow, Seen, Struck
from antiosc.studies.find.surface import Chart
from antiosc.studies.measured.gauss_newton import covariance

#: Changes for differences: of logarithms and of the start over the contact time; of frequencies,
#: whose phases grow with time; of the place over the spacing of sites.
CHANGE, CHANGE_FREQUENCY, CHANGE_PLACE = 2e-3, 1e-5, 0.02
#: Longest steps: of the place over the spacing, of logarithms, of the start over the contact time.
LONGEST_PLACE, LONGEST, LONGEST_START = 1.5, 0.7, 0.3
#: Decrease of chi² that ends a search, and over chi² itself.
CONVERGED, ENOUGH = 0.01, 1e-6


@dataclass(frozen=True, eq=False)
class Fit:
    """The most probable blow near a start.

    Attributes
    ----------
    cost : squares of weighted residuals and of the model's errors over their expected sizes.
    covariance : of the unknowns `names`: coordinates along `chart.axes` [m], logarithms, start [s].
    gains : (2, .) derivatives of the logarithms of peak force and impulse by them.
    chi2 : residual over its degrees of freedom.
    signals : (n', m) over their noise.
    """

    blow: Blow
    chart: Chart
    hit: History
    cost: float
    names: tuple[str, ...]
    covariance: Array
    gains: Array
    chi2: float
    signals: Array


class Search:
    """Gauss–Newton on the unknowns of a model.

    Parameters
    ----------
    unknown : logarithms to be found, of mass, velocity, stiffness, E.
    spread, doubt : expected relative errors of the natural frequencies, and of the modes' shares.
    """

    def __init__(self, model: Struck, unknown: Sequence[str], spread: float, doubt: float) -> None:
        self.model, self.logs = model, [name for name in unknown if name != "place"]
        self.spread = spread
        # a mode's share in a signal is wrong by its value at the sensor and by that at the struck
        # place, which all sensors have in common
        count = len(model.rows)
        together = doubt**2 * (np.eye(count) + 1) / 2
        self.unshared = np.linalg.inv(np.linalg.cholesky(together))

    def cost(self, blow: Blow, signals: Array, trust: float = 1.0) -> tuple[float, Array]:
        """The cost, and all residuals; those of the signals times `trust`."""
        off = trust * (signals - self.model.data.compared).ravel()
        shares = self.unshared @ blow.share
        rest = np.concatenate([off, blow.frequency / self.spread, shares.ravel()])
        return float(rest @ rest), rest

    def at(self, blow: Blow) -> tuple[Chart, Array, Seen]:
        """The neighbourhood of the place, its values, and what the sensors see."""
        chart = self.model.surface.chart(blow.place, blow.site)
        there = self.model.modes_at(chart, np.zeros(len(chart.axes)))
        return chart, there, self.model.seen(blow, there)

    def refined(self, blow: Blow, steps: int) -> Fit:
        """The blow of least cost near the start, after so many steps at most."""
        damping, step = 1e-3, -1
        while True:
            step += 1
            chart, there, seen = self.at(blow)
            cost, rest = self.cost(blow, seen.signals)
            J, gains = self._slopes(blow, chart, there, seen)
            if step == steps:
                break
            # far from the blow the signals must not be laid to the errors of the model
            data = seen.signals.size
            trust = min(1.0, float(np.sqrt(data / max(np.sum(rest[:data] ** 2), 1.0))))
            cost, rest = self.cost(blow, seen.signals, trust)
            J[:data] *= trust
            normal, gradient = J.T @ J, J.T @ rest
            size = np.sqrt(np.maximum(np.diag(normal), 1e-28 * np.diag(normal).max()))
            unit = normal / size / size[:, None]
            new, trial = np.inf, blow
            while damping < 1e6:
                factor = scipy.linalg.cho_factor(unit + damping * np.eye(len(unit)))
                change = -scipy.linalg.cho_solve(factor, gradient / size) / size
                trial = self.moved(blow, chart, change)
                new = self.cost(trial, self.at(trial)[2].signals, trust)[0]
                if new < cost:
                    break
                damping *= 8
            if not new < cost:
                J[:data] /= trust
                cost, rest = self.cost(blow, seen.signals)
                break
            damping = max(damping / 30, 1e-9)
            lasting = float(np.clip(seen.hit.contact_time, 0.2 * blow.lasting, 5 * blow.lasting))
            blow = replace(trial, lasting=lasting)
            if cost - new < max(CONVERGED, ENOUGH * cost):
                steps = step + 1
        return self._finished(blow, chart, seen, cost, rest, J, gains)

    def moved(self, blow: Blow, chart: Chart, change: Array) -> Blow:
        """The blow after a change of all unknowns."""
        d, k = len(chart.axes), len(self.logs)
        x = change[:d] * min(1.0, LONGEST_PLACE / max(float(np.linalg.norm(change[:d])), 1e-300))
        place, site = blow.place, blow.site
        if d:
            place, site = self.model.surface.nearest(
                chart.origin + chart.size * x @ chart.axes, blow.site
            )
        logs = np.clip(change[d : d + k], -LONGEST, LONGEST)
        values = {
            name: getattr(blow, name) * float(np.exp(c))
            for name, c in zip(self.logs, logs, strict=True)
        }
        start = blow.start + blow.lasting * float(
            np.clip(change[d + k], -LONGEST_START, LONGEST_START)
        )
        T = self.model.data.duration
        J = len(blow.frequency)
        rest = change[d + k + 1 :]
        return replace(
            blow,
            place=place,
            site=site,
            start=float(np.clip(start, -0.5 * T, 0.95 * T)),
            frequency=np.clip(blow.frequency + rest[:J], -0.2, 0.2),
            share=blow.share + rest[J:].reshape(blow.share.shape),
            **values,
        )

    def _slopes(self, blow: Blow, chart: Chart, there: Array, seen: Seen) -> tuple[Array, Array]:
        """Derivatives of all residuals by all unknowns; `gains` in the units of the steps."""
        model, columns, gains = self.model, [], []

        def changed(other: Blow, at: Array, change: float) -> None:
            new = model.seen(other, at)
            columns.append((new.signals - seen.signals).ravel() / change)
            gains.append((strength(new.hit) - strength(seen.hit)) / change)

        for i in range(len(chart.axes)):
            x = np.zeros(len(chart.axes))
            x[i] = CHANGE_PLACE
            changed(blow, model.modes_at(chart, x), CHANGE_PLACE)
        for name in self.logs:
            change = CHANGE_FREQUENCY if name == "E" else CHANGE
            value = {name: getattr(blow, name) * float(np.exp(change))}
            changed(replace(blow, **value), there, change)
        changed(replace(blow, start=blow.start + CHANGE * blow.lasting), there, CHANGE)
        n, m, J = seen.parts.shape
        p = len(columns)
        found = np.zeros((n * m + J + m * J, p + J + m * J))
        found[: n * m, :p] = np.transpose(columns)
        # all frequencies at once: each mode's own part of the change
        other = replace(blow, frequency=(1 + blow.frequency) * (1 + CHANGE_FREQUENCY) - 1)
        moved = (model.seen(other, there).parts - seen.parts) * (1 + blow.share)
        by_frequency = moved / (CHANGE_FREQUENCY * (1 + blow.frequency))
        found[: n * m, p : p + J] = by_frequency.reshape(n * m, J)
        for s in range(m):
            at = p + J + s * J
            found[s : n * m : m, at : at + J] = seen.parts[:, s]
        rows = np.arange(J)
        found[n * m + rows, p + rows] = 1 / self.spread
        found[n * m + J :, p + J :] = np.kron(self.unshared, np.eye(J))
        return found, np.transpose(gains)

    def _finished(
        self, blow: Blow, chart: Chart, seen: Seen, cost: float, rest: Array, J: Array,
        gains: Array,
    ) -> Fit:  # fmt: skip
        d, k = len(chart.axes), len(self.logs)
        p, data = d + k + 1, seen.signals.size
        inverse = covariance(J.T @ J)
        used = float(np.sum((J[:data] @ inverse) * J[:data]))
        chi2 = float(rest[:data] @ rest[:data]) / max(data - used, 1.0)
        unit = np.concatenate([np.full(d, chart.size), np.ones(k), [blow.lasting]])
        main = inverse[:p, :p] * unit * unit[:, None] * max(chi2, 1.0)
        names = (*("place",) * d, *self.logs, "start")
        return Fit(blow, chart, seen.hit, cost, names, main, gains / unit, chi2, seen.signals)


def strength(hit: History) -> Array:
    """Logarithms (2,) of peak force and impulse."""
    return np.log(np.maximum([hit.peak_force, hit.impulse], np.finfo(float).tiny))
