"""From pulses at all sites to the most probable blows, by Gauss-Newton from the best ones.

`scan` finds for all sites at once the half-sine pulse whose signals are nearest to the measured
ones. In the free modes the signal of sensor s is sum_j s_sj b_j g_j(t - t0), g_j being the response
of mode j to a pulse. For each duration of the pulse the best amplitude is in closed form; the
products of the measured signals with all delayed g_j come from one Fourier transform, and are the
same for all sites. The frequencies of the model have errors: the response of mode j is multiplied
by the mean of its phase factor, exp(-(e w_j t)²/2) for frequencies of relative standard deviation
e.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from antiosc import History
from antiosc.base._types import Array
from antiosc.base.progress import counting
from antiosc_studies.find.forward import Blow, Chart, Model, Signals
from antiosc_studies.measured.fit import covariance, lowered

#: Shortest duration of a trial pulse over the period of the band's top.
SHORTEST_PULSE = 0.4
#: Longest duration of a trial pulse over the record.
LONGEST_PULSE = 0.3
#: Number of durations.
PULSES = 9
#: Windows at which the energy of signals that the record's end cuts is known.
WINDOWS = 9
#: Frequency that stands for a rigid-body mode, over one over the record.
RIGID_FREQUENCY = 1e-3
#: Sites at a time.
AT_ONCE = 512


@dataclass(frozen=True, eq=False)
class Scan:
    """The half-sine pulse that fits the signals best, at each of P sites."""

    explained: Array  # (P,) share of the signals' weighted power that it explains
    #: duration, start, amplitude: (P,) those of the pulse [s], [s], [N]
    duration: Array
    start: Array
    amplitude: Array


def scan(model: Model, spread: float) -> Scan:
    """The best pulses of all sites; `spread`: relative standard deviation of the frequencies."""
    data = model.data
    omega = model.omega
    decay = model.decay
    b = model.table[:, :-2]
    n = len(data.values)
    T = data.duration
    size = fft.next_fast_len(2 * n, real=True)
    D = fft.rfft(data.values / data.sigma, size, axis=0)
    power = float(np.sum((data.values / data.sigma) ** 2))
    slow = RIGID_FREQUENCY / T
    lam = -decay + 1j * np.sqrt(np.maximum(omega**2 - decay**2, slow**2))
    ends = np.linspace(0, n, WINDOWS + 1).astype(int)[1:]
    longest = max(LONGEST_PULSE * T, 2 * data.dt)
    shortest = min(SHORTEST_PULSE * 2 * np.pi / data.band, longest)

    best = np.zeros((4, len(b)))
    for tau in np.geomspace(shortest, longest, PULSES):
        table = pulse_responses(lam, tau, data.time)
        fading = np.exp(-((spread * np.abs(lam.imag)[None] * data.time[:, None]) ** 2) / 2)
        Q = np.zeros((size // 2 + 1, len(lam)), dtype=complex)
        gram = np.zeros((WINDOWS, len(lam), len(lam)))
        for s, order in enumerate(model.orders):
            g = table[order] * fading * (model.rows[s] / data.sigma[s])
            Q += np.conj(fft.rfft(g, size, axis=0)) * D[:, s, None]
            first = 0
            for k, end in enumerate(ends):
                gram[k:] += g[first:end].T @ g[first:end]
                first = end
        products = fft.irfft(Q, size, axis=0)[: n - 1].T
        for first in range(0, len(b), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            _update_best(best[:, part], b[part], products, gram, ends, tau)

    explained, duration, lag, amplitude = best
    return Scan(explained / power, duration, lag * data.dt, amplitude)


def _update_best(
    best: Array, b: Array, products: Array, gram: Array, ends: Array, tau: float
) -> None:
    """Replace the best pulses (4, P) of sites b (P, J) where pulses of duration tau fit better."""
    lags = products.shape[1]
    energy = np.einsum("pj,kjl,pl->pk", b, gram, b, optimize=True)
    remaining = ends[-1] - np.arange(lags)
    position = np.interp(remaining, ends, np.arange(len(ends)))
    lower = np.floor(position).astype(int)
    upper = np.minimum(lower + 1, len(ends) - 1)

    # the energy of the longest lags is that of the shortest window at least
    E = energy[:, lower] + (position - lower) * (energy[:, upper] - energy[:, lower])
    A = np.maximum(b @ products, 0.0)
    gain = A**2 / np.maximum(E, np.finfo(float).tiny)
    lag = np.argmax(gain, axis=1)
    row = np.arange(len(b))
    improves = gain[row, lag] > best[0]
    amplitude = A[row, lag] / np.maximum(E[row, lag], np.finfo(float).tiny)
    new = np.array([gain[row, lag], np.full(len(b), tau), lag, amplitude])
    best[:, improves] = new[:, improves]


def pulse_responses(lam: Array, tau: float, t: Array) -> list[Array]:
    """Responses q, q', q'' (n, J) of modes lam = -d + i w to the half-sine sin(pi t/tau)."""
    until = np.minimum(t, tau)[:, None]
    rate = np.pi / tau
    delay = t[:, None] - until

    def driven(w: float) -> Array:
        # integral of exp(i w s) exp(lam (t - s)) from 0 to min(t, tau)
        return (np.exp(1j * w * until) - np.exp(lam * until)) / (1j * w - lam) * np.exp(lam * delay)

    z = (driven(rate) - driven(-rate)) / 2j
    force = np.where(delay > 0, 0.0, np.sin(rate * until))
    q = z.imag / lam.imag
    v = z.real + lam.real * q
    a = force - np.abs(lam) ** 2 * q + 2 * lam.real * v
    return [np.asarray(q), np.asarray(v), np.asarray(a)]


#: Step of logarithms in differences, and of the start over the contact time.
CHANGE = 2e-3
#: Relative step of frequencies: small, since phase errors grow with time.
CHANGE_FREQUENCY = 1e-5
#: Step of the place over the spacing of sites.
CHANGE_PLACE = 0.02
#: Longest change of the place in one iteration over the spacing, …
LONGEST_PLACE = 1.5
#: … of logarithms: a factor of two, …
LONGEST = 0.7
#: … and of the start over the contact time.
LONGEST_START = 0.3
#: Decrease of chi² below which a search ends: far below the 1 of a standard deviation.
CONVERGED = 0.01
#: Relative decrease of chi² below which a search ends.
ENOUGH = 1e-6


@dataclass(frozen=True, eq=False)
class ProbableImpact:
    """The most probable impact near a start, with its uncertainty."""

    blow: Blow
    chart: Chart
    hit: History
    #: sum of squares of weighted residuals and of model errors over their expected sizes
    cost: float
    names: tuple[str, ...]
    #: covariance of the unknowns `names`: coordinates along `chart.axes` [m], logarithms, start [s]
    covariance: Array
    gains: Array  # (2, .) derivatives of the logarithms of peak force and impulse by these unknowns
    chi2: float  # squared residual over its degrees of freedom
    signals: Array  # (n', m) computed signals over the noise


class Search:
    """Gauss–Newton iteration on the place and the logarithms of the other unknowns of a model.

    spread, doubt : relative standard deviations of natural frequencies, and of modes' shares.
    """

    def __init__(self, model: Model, unknown: Sequence[str], spread: float, doubt: float) -> None:
        self.model = model
        self.logs = [name for name in unknown if name != "place"]
        self.spread = spread

        # the error of a mode's share has two parts: its value at the sensor, and that at the struck
        # place, which is common to all sensors
        count = len(model.rows)
        share_covariance = doubt**2 * (np.eye(count) + 1) / 2
        self.unshared = np.linalg.inv(np.linalg.cholesky(share_covariance))

    def residuals(self, blow: Blow, signals: Array) -> Array:
        """Residuals of the signals, then errors of the model, each over its standard deviation."""
        signal_errors = signals - self.model.data.compared
        shares = self.unshared @ blow.share
        return np.concatenate([signal_errors.ravel(), blow.frequency / self.spread, shares.ravel()])

    def at(self, blow: Blow) -> tuple[Chart, Array, Signals]:
        """(chart at the place, modal data there, computed signals)."""
        chart = self.model.surface.chart(blow.place, blow.site)
        site_data = self.model.modes_at(chart, np.zeros(len(chart.axes)))
        return chart, site_data, self.model.seen(blow, site_data)

    def refined(self, blow: Blow, steps: int) -> ProbableImpact:
        """The impact of least cost near the start, after at most `steps` steps."""
        damping = 1e-3
        step = -1
        while True:
            step += 1
            chart, site_data, computed = self.at(blow)
            residual = self.residuals(blow, computed.signals)
            J, gains = self._slopes(blow, chart, site_data, computed)
            if step == steps:
                break
            # far from the blow, signal differences must not be explained by model errors
            data = computed.signals.size
            factor = np.ones(residual.size)
            factor[:data] = min(1.0, float(np.sqrt(data / max(np.sum(residual[:data] ** 2), 1.0))))

            def moved(
                change: Array, blow: Blow = blow, chart: Chart = chart, factor: Array = factor
            ) -> tuple[Blow, Array]:
                trial = self.moved(blow, chart, change)
                return trial, factor * self.residuals(trial, self.at(trial)[2].signals)

            rows = factor[:, None] * J
            scaled_residual = factor * residual
            lowered_step, damping = lowered(
                rows.T @ rows, rows.T @ scaled_residual, scaled_residual, damping, moved
            )
            if lowered_step is None:
                break
            trial, new = lowered_step
            former = blow.contact_time_estimate
            estimate = min(max(computed.hit.contact_time, former / 5), 5 * former)
            blow = replace(trial, contact_time_estimate=estimate)

            cost_before = float(np.sum((factor * residual) ** 2))
            if cost_before - float(new @ new) < max(CONVERGED, ENOUGH * cost_before):
                steps = step + 1

        return self._finished(blow, chart, computed, residual, J, gains)

    def moved(self, blow: Blow, chart: Chart, change: Array) -> Blow:
        """The impact after a change of all unknowns."""
        d = len(chart.axes)
        k = len(self.logs)
        x = change[:d] * min(1.0, LONGEST_PLACE / max(float(np.linalg.norm(change[:d])), 1e-300))
        place = blow.place
        site = blow.site
        if d:
            moved = chart.origin + chart.size * x @ chart.axes
            place, site = self.model.surface.nearest(moved, blow.site)
        logs = np.clip(change[d : d + k], -LONGEST, LONGEST)
        values = {
            name: getattr(blow, name) * float(np.exp(c))
            for name, c in zip(self.logs, logs, strict=True)
        }
        later = float(np.clip(change[d + k], -LONGEST_START, LONGEST_START))
        start = blow.start + blow.contact_time_estimate * later
        T = self.model.data.duration
        J = len(blow.frequency)
        model_changes = change[d + k + 1 :]

        return replace(
            blow,
            place=place,
            site=site,
            start=float(np.clip(start, -0.5 * T, 0.95 * T)),
            frequency=np.clip(blow.frequency + model_changes[:J], -0.2, 0.2),
            share=blow.share + model_changes[J:].reshape(blow.share.shape),
            **values,
        )

    def _slopes(
        self, blow: Blow, chart: Chart, site_data: Array, computed: Signals
    ) -> tuple[Array, Array]:
        """Derivatives of all residuals, and of peak force and impulse (gains), by the unknowns."""
        model = self.model
        columns = []
        gains = []

        def add_difference(other: Blow, at: Array, change: float) -> None:
            new = model.seen(other, at)
            columns.append((new.signals - computed.signals).ravel() / change)
            gains.append((strength(new.hit) - strength(computed.hit)) / change)

        for i in range(len(chart.axes)):
            x = np.zeros(len(chart.axes))
            x[i] = CHANGE_PLACE
            add_difference(blow, model.modes_at(chart, x), CHANGE_PLACE)

        for name in self.logs:
            change = CHANGE_FREQUENCY if name == "E" else CHANGE
            value = {name: getattr(blow, name) * float(np.exp(change))}
            add_difference(replace(blow, **value), site_data, change)
        later = replace(blow, start=blow.start + CHANGE * blow.contact_time_estimate)
        add_difference(later, site_data, CHANGE)
        n, m, J = computed.parts.shape
        p = len(columns)
        jacobian = np.zeros((n * m + J + m * J, p + J + m * J))
        jacobian[: n * m, :p] = np.transpose(columns)

        # all frequencies at once: each mode's own part of the change
        moved_blow = replace(blow, frequency=(1 + blow.frequency) * (1 + CHANGE_FREQUENCY) - 1)
        part_changes = (model.seen(moved_blow, site_data).parts - computed.parts) * (1 + blow.share)
        by_frequency = part_changes / (CHANGE_FREQUENCY * (1 + blow.frequency))
        jacobian[: n * m, p : p + J] = by_frequency.reshape(n * m, J)
        for s in range(m):
            column = p + J + s * J
            jacobian[s : n * m : m, column : column + J] = computed.parts[:, s]
        rows = np.arange(J)
        jacobian[n * m + rows, p + rows] = 1 / self.spread
        jacobian[n * m + J :, p + J :] = np.kron(self.unshared, np.eye(J))
        return jacobian, np.transpose(gains)

    def _finished(
        self, blow: Blow, chart: Chart, computed: Signals, residual: Array, J: Array, gains: Array
    ) -> ProbableImpact:
        """The most probable impact with its uncertainty, from the state at the end of a search."""
        d = len(chart.axes)
        k = len(self.logs)
        p = d + k + 1
        data = computed.signals.size
        inverse = covariance(J.T @ J)
        degrees = float(np.sum((J[:data] @ inverse) * J[:data]))
        chi2 = float(residual[:data] @ residual[:data]) / max(data - degrees, 1.0)
        unit = np.concatenate([np.full(d, chart.size), np.ones(k), [blow.contact_time_estimate]])
        covariance_of_unknowns = inverse[:p, :p] * unit * unit[:, None] * max(chi2, 1.0)
        names = (*("place",) * d, *self.logs, "start")
        cost = float(residual @ residual)

        return ProbableImpact(
            blow,
            chart,
            computed.hit,
            cost,
            names,
            covariance_of_unknowns,
            gains / unit,
            chi2,
            computed.signals,
        )


def strength(hit: History) -> Array:
    """Logarithms (2,) of peak force and impulse."""
    return np.log(np.maximum([hit.peak_force, hit.impulse], np.finfo(float).tiny))


#: Number of places at which searches start.
PLACES = 8
#: Their least distance over the spacing of sites.
PLACE_DISTANCE = 2.5
#: Initial masses of the impactor, over that of the structure.
MASSES = (1e-3, 4e-3, 0.016, 0.064, 0.25, 1.0)
#: Number of searches that begin, …
MOST_STARTS = 4
#: … and that are continued.
MOST_FITS = 2
FIRST_STEPS, LAST_STEPS = 5, 25  # of searches that begin, that go on
#: A second search is not continued if its cost exceeds this times the first's.
HOPELESS = 10.0
#: chi² above which the best blow does not explain the signals.
POOR_CHI2 = 2.0
#: Factors on the mass of the impactor that are tried then: heavier ones may touch a second time,
#: which no small step from a lighter one does.
HEAVIER = (1.3, 2.0)
#: Contact time × velocity/approach of an impact on a rigid wall by Hertz's law:
#: 2 ∫₀¹ dx/√(1 − x^(5/2)).
HERTZ_TIME = 2.943
#: Impulse over mass × velocity of the first guess, between 1 (no rebound) and 2 (a rigid wall).
REBOUND = 1.6


def most_probable(
    model: Model,
    scanned: Scan,
    unknown: Sequence[str],
    known: Mapping[str, float],
    weight: float,
    spread: float,
    doubt: float,
) -> list[ProbableImpact]:
    """The most probable impacts, the best first; a second one at another place if there is one.

    known : values of known quantities; weight : mass [kg] of the structure; spread, doubt : as for
    `Search`.
    """
    search = Search(model, unknown, spread, doubt)
    masses = [share * weight for share in MASSES] if "mass" in unknown else [known["mass"]]
    starts = [
        _scaled(search, _first_blow(model, scanned, i, mass, known))
        for i in _starting_places(model, scanned)
        for mass in masses
    ]
    starts.sort(key=lambda pair: pair[0])
    starting_impacts = []

    with counting("searching the blow", MOST_STARTS + MOST_FITS) as ready:
        for count, (_, blow) in enumerate(starts[:MOST_STARTS], start=1):
            starting_impacts.append(search.refined(blow, FIRST_STEPS))
            ready(count)
        starting_impacts.sort(key=lambda fit: fit.cost)
        fits = []
        for fit in _fits_to_continue(model, starting_impacts):
            fits.append(search.refined(fit.blow, LAST_STEPS))
            ready(MOST_STARTS + len(fits))
        best = min(fits, key=lambda fit: fit.cost)
        if best.chi2 > POOR_CHI2 and {"mass", "velocity"} <= set(unknown):
            for by in HEAVIER:  # of the same momentum, which may touch a second time
                mass, velocity = by * best.blow.mass, best.blow.velocity / by
                heavier = replace(best.blow, mass=mass, velocity=velocity)
                fits.append(search.refined(heavier, LAST_STEPS))

    return sorted(fits, key=lambda fit: fit.cost)


def _fits_to_continue(model: Model, fits: list[ProbableImpact]) -> list[ProbableImpact]:
    """The fits to continue: the best one, and the best at another place or else the second best."""
    first, *others = fits
    least_distance = PLACE_DISTANCE * model.surface.spacing(first.blow.site)
    lines = [fit.blow.place - first.blow.place for fit in others]
    apart = [np.linalg.norm(line) > least_distance for line in lines]
    elsewhere = [fit for fit, is_apart in zip(others, apart, strict=True) if is_apart]

    promising = [fit for fit in (*elsewhere, *others) if fit.cost < HOPELESS * first.cost]
    return [first, *promising][:MOST_FITS]


def _starting_places(model: Model, scanned: Scan) -> list[int]:
    """The sites whose pulses fit best, at a distance from one another."""
    site_numbers: list[int] = []
    points = model.surface.points
    for i in np.argsort(-scanned.explained, kind="stable").tolist():
        least_distance = PLACE_DISTANCE * model.surface.spacing(i)
        if all(np.linalg.norm(points[i] - points[k]) > least_distance for k in site_numbers):
            site_numbers.append(i)
        if len(site_numbers) == PLACES:
            break

    return site_numbers


def _first_blow(
    model: Model, scanned: Scan, i: int, mass: float, known: Mapping[str, float]
) -> Blow:
    """An impact whose pulse on a rigid wall is that of the scan at site i."""
    T = float(scanned.duration[i])
    impulse = 2 / np.pi * T * float(scanned.amplitude[i])
    velocity = max(impulse, float(np.finfo(float).tiny)) / (REBOUND * mass)
    approach = T * velocity / HERTZ_TIME
    exponent = model.exponent
    stiffness = (exponent + 1) / 2 * mass * velocity**2 / approach ** (exponent + 1)
    J = len(model.omega)
    m = len(model.rows)
    guess = {"velocity": velocity, "stiffness": stiffness, "E": 1.0, **known, "mass": mass}

    return Blow(
        model.surface.points[i],
        i,
        start=float(scanned.start[i]),
        contact_time_estimate=T,
        frequency=np.zeros(J),
        share=np.zeros((m, J)),
        **guess,
    )


def _scaled(search: Search, blow: Blow) -> tuple[float, Blow]:
    """(cost, impact) after its strength is scaled to fit the signals best."""
    model = search.model
    signals = search.at(blow)[2].signals.ravel()
    data = model.data.compared.ravel()
    power = float(signals @ signals)
    if power == 0.0:
        return float(data @ data), blow
    amplitude = max(float(signals @ data) / power, 0.1)

    # with this change of stiffness the force of a power law is proportional to the velocity
    change = {"velocity": amplitude, "stiffness": amplitude ** (1 - model.exponent)}
    new = {n: getattr(blow, n) * c for n, c in change.items() if n in search.logs}
    return float(np.sum((amplitude * signals - data) ** 2)), replace(blow, **new)
