"""Search of the most probable impacts: a scan of pulses at all sites, then Gauss-Newton iterations.

`scan_pulses` finds for all sites together the half-sine pulse whose signals are nearest to the
measured signals. In the free modes the signal of sensor s is sum_j s_sj b_j g_j(t - t0), where g_j
is the response of mode j to a pulse. For each duration of the pulse the best amplitude has a closed
form; the products of the measured signals with all delayed g_j come from one Fourier transform and
are the same for all sites. The frequencies of the model have errors: the response of mode j is
multiplied by the mean of its phase factor, exp(-(e w_j t)²/2) for a relative standard deviation e
of the frequencies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from sys import float_info

import numpy as np
from scipy import fft

from antiosc import History
from antiosc.base._types import Array
from antiosc.base.progress import counting
from antiosc_studies.find.forward import CandidateImpact, ComputedSignals, LocalChart, SearchModel
from antiosc_studies.measured.fit import covariance, damped_step

#: Shortest duration of a trial pulse over the period of the band's top.
MIN_PULSE_PERIODS = 0.4
#: Longest duration of a trial pulse over the record.
MAX_PULSE_SHARE = 0.3
#: Number of durations.
PULSE_COUNT = 9
#: Windows at which the energy of signals that the record's end cuts is known.
WINDOW_COUNT = 9
#: Frequency that stands for a rigid-body mode, over one over the record.
RIGID_FREQUENCY = 1e-3
#: Sites at a time.
SITES_AT_ONCE = 512


@dataclass(frozen=True, eq=False)
class PulseScan:
    """The half-sine pulse that fits the signals best, at each of P sites."""

    power_share: Array  # (P,) share of the signals' weighted power that it explains
    #: duration, start, amplitude: (P,) those of the pulse [s], [s], [N]
    duration: Array
    start: Array
    amplitude: Array


def scan_pulses(model: SearchModel, frequency_sigma: float) -> PulseScan:
    """The best pulses of all sites.

    `frequency_sigma`: relative standard deviation of the frequencies.
    """
    data = model.data
    omega = model.omega
    decay = model.decay
    b = model.site_table[:, :-2]
    n = len(data.values)
    T = data.duration
    size = fft.next_fast_len(2 * n, real=True)
    D = fft.rfft(data.values / data.noise_sigma, size, axis=0)
    power = np.sum((data.values / data.noise_sigma) ** 2)
    slow = RIGID_FREQUENCY / T
    lam = -decay + 1j * np.sqrt(np.maximum(omega**2 - decay**2, slow**2))
    ends = np.linspace(0, n, WINDOW_COUNT + 1).astype(int)[1:]
    longest = max(MAX_PULSE_SHARE * T, 2 * data.dt)
    shortest = min(MIN_PULSE_PERIODS * 2 * np.pi / data.band, longest)

    best = np.zeros((4, len(b)))
    phase_errors = np.outer(data.time, frequency_sigma * lam.imag)
    fading = np.exp(-(phase_errors**2) / 2)
    for tau in np.geomspace(shortest, longest, PULSE_COUNT):
        table = pulse_responses(lam, tau, data.time)
        Q = np.zeros((size // 2 + 1, len(lam)), dtype=complex)
        gram = np.zeros((WINDOW_COUNT, len(lam), len(lam)))
        for s, order in enumerate(model.derivative_orders):
            g = table[order] * fading * (model.sensor_shapes[s] / data.noise_sigma[s])
            Q += np.conj(fft.rfft(g, size, axis=0)) * D[:, s, None]
            first = 0
            for k, end in enumerate(ends):
                gram[k:] += g[first:end].T @ g[first:end]
                first = end
        products = fft.irfft(Q, size, axis=0)[: n - 1].T
        for first in range(0, len(b), SITES_AT_ONCE):
            part = slice(first, first + SITES_AT_ONCE)
            _update_best_pulses(best[:, part], b[part], products, gram, ends, tau)

    explained, duration, lag, amplitude = best
    return PulseScan(explained / power, duration, lag * data.dt, amplitude)


def _update_best_pulses(
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
    gain = A**2 / np.maximum(E, float_info.min)
    lag = np.argmax(gain, axis=1)
    row = np.arange(len(b))
    improves = gain[row, lag] > best[0]
    amplitude = A[row, lag] / np.maximum(E[row, lag], float_info.min)
    new = np.array([gain[row, lag], np.full(len(b), tau), lag, amplitude])
    best[:, improves] = new[:, improves]


def pulse_responses(lam: Array, tau: float, t: Array) -> list[Array]:
    """Responses q, q', q'' (n, J) of modes lam = -d + i w to the half-sine sin(pi t/tau)."""
    until = np.minimum(t, tau)[:, None]
    rate = np.pi / tau
    delay = t[:, None] - until

    def driven_response(w: float) -> Array:
        # integral of exp(i w s) exp(lam (t - s)) from 0 to min(t, tau)
        return (np.exp(1j * w * until) - np.exp(lam * until)) / (1j * w - lam) * np.exp(lam * delay)

    z = (driven_response(rate) - driven_response(-rate)) / 2j
    force: Array = np.where(delay > 0, 0.0, np.sin(rate * until))
    q = z.imag / lam.imag
    v = z.real + lam.real * q
    a = force - np.abs(lam) ** 2 * q + 2 * lam.real * v
    return [q, v, a]


#: Step of logarithms in differences, and of the start over the contact time.
LOG_STEP = 2e-3
#: Relative step of frequencies: small, since phase errors grow with time.
FREQUENCY_STEP = 1e-5
#: Step of the place over the spacing of sites.
PLACE_STEP = 0.02
#: Longest change of the place in one iteration over the spacing, …
MAX_PLACE_CHANGE = 1.5
#: … of logarithms: a factor of two, …
MAX_LOG_CHANGE = 0.7
#: … and of the start over the contact time.
MAX_START_CHANGE = 0.3
#: Decrease of chi² below which a search ends: far below the 1 of a standard deviation.
CONVERGED_CHI2_DECREASE = 0.01
#: Relative decrease of chi² below which a search ends.
CONVERGED_RELATIVE_DECREASE = 1e-6


@dataclass(frozen=True, eq=False)
class ProbableImpact:
    """The most probable impact near a start, with its uncertainty."""

    blow: CandidateImpact
    chart: LocalChart
    hit: History
    #: sum of squares of weighted residuals and of model errors over their expected sizes
    cost: float
    unknown_names: tuple[str, ...]
    #: covariance of the unknowns `names`: coordinates along `chart.axes` [m], logarithms, start [s]
    covariance: Array
    #: (2, .) derivatives of the logarithms of peak force and impulse by these unknowns
    strength_derivatives: Array
    chi2: float  # squared residual over its degrees of freedom
    signals: Array  # (n', m) computed signals over the noise


class Search:
    """Gauss–Newton iteration on the place and the logarithms of the other unknowns of a model.

    sigma, share_sigma : relative standard deviations of natural frequencies, and of modes' shares.
    """

    def __init__(
        self, model: SearchModel, unknown: Sequence[str], sigma: float, share_sigma: float
    ) -> None:
        self.model = model
        self.logs = [name for name in unknown if name != "place"]
        self.sigma = sigma

        # the error of a mode's share has two parts: its value at the sensor, and that at the struck
        # place, which is common to all sensors
        count = len(model.sensor_shapes)
        share_covariance = share_sigma**2 * (np.eye(count) + 1) / 2
        self.unshared = np.linalg.inv(np.linalg.cholesky(share_covariance))

    def residuals(self, blow: CandidateImpact, signals: Array) -> Array:
        """Residuals of the signals, then errors of the model, each over its standard deviation."""
        misfit = signals - self.model.data.scaled_signals
        shares = self.unshared @ blow.share_changes
        frequencies = blow.frequency_changes / self.sigma
        return np.concatenate([misfit.ravel(), frequencies, shares.ravel()])

    def state_at(self, blow: CandidateImpact) -> tuple[LocalChart, Array, ComputedSignals]:
        """(chart at the place, modal data there, computed signals)."""
        chart = self.model.surface.chart(blow.place, blow.site)
        site_data = self.model.modes_at(chart, np.zeros(len(chart.axes)))
        return chart, site_data, self.model.computed_signals(blow, site_data)

    def refined_impact(self, blow: CandidateImpact, steps: int) -> ProbableImpact:
        """The impact of least cost near the start, after at most `steps` steps."""
        damping = 1e-3
        converged = False
        for step in range(steps + 1):
            chart, site_data, computed = self.state_at(blow)
            residual = self.residuals(blow, computed.signals)
            J, gains = self._residual_slopes(blow, chart, site_data, computed)
            if converged or step == steps:
                break

            # far from the blow, signal differences must not be explained by model errors
            data = computed.signals.size
            factor = np.ones(residual.size)
            factor[:data] = np.sqrt(data / max(np.sum(residual[:data] ** 2), data))

            rows = factor[:, None] * J
            weighted = factor * residual
            changed = partial(self._changed_residual, blow, chart, factor)
            lower, damping = damped_step(
                rows.T @ rows, rows.T @ weighted, weighted, damping, changed
            )
            if lower is None:
                break
            trial, new = lower
            former = blow.contact_time_estimate
            estimate = min(max(computed.hit.contact_time, former / 5), 5 * former)
            blow = replace(trial, contact_time_estimate=estimate)

            cost = np.sum(weighted**2)
            least = max(CONVERGED_CHI2_DECREASE, CONVERGED_RELATIVE_DECREASE * cost)
            converged = cost - new @ new < least

        return self._impact_with_uncertainty(blow, chart, computed, residual, J, gains)

    def _changed_residual(
        self, blow: CandidateImpact, chart: LocalChart, factor: Array, change: Array
    ) -> tuple[CandidateImpact, Array]:
        """(impact, its weighted residuals) after a change of all unknowns."""
        trial = self.changed_impact(blow, chart, change)
        return trial, factor * self.residuals(trial, self.state_at(trial)[2].signals)

    def changed_impact(
        self, blow: CandidateImpact, chart: LocalChart, change: Array
    ) -> CandidateImpact:
        """The impact after a change of all unknowns."""
        d = len(chart.axes)
        k = len(self.logs)
        length = float(np.linalg.norm(change[:d]))
        x = change[:d] * (MAX_PLACE_CHANGE / max(length, MAX_PLACE_CHANGE))
        place = blow.place
        site = blow.site
        if d:
            moved = chart.origin + chart.size * x @ chart.axes
            place, site = self.model.surface.nearest(moved, blow.site)
        factors = np.exp(np.clip(change[d : d + k], -MAX_LOG_CHANGE, MAX_LOG_CHANGE))
        pairs = zip(self.logs, factors.tolist(), strict=True)
        values = {name: getattr(blow, name) * factor for name, factor in pairs}
        later = np.clip(change[d + k], -MAX_START_CHANGE, MAX_START_CHANGE)
        start = blow.start + blow.contact_time_estimate * later
        T = self.model.data.duration
        J = len(blow.frequency_changes)
        model_changes = change[d + k + 1 :]

        return replace(
            blow,
            place=place,
            site=site,
            start=float(np.clip(start, -0.5 * T, 0.95 * T)),
            frequency_changes=np.clip(blow.frequency_changes + model_changes[:J], -0.2, 0.2),
            share_changes=blow.share_changes + model_changes[J:].reshape(blow.share_changes.shape),
            **values,
        )

    def _residual_slopes(
        self, blow: CandidateImpact, chart: LocalChart, site_data: Array, computed: ComputedSignals
    ) -> tuple[Array, Array]:
        """Derivatives of all residuals, and of peak force and impulse (gains), by the unknowns."""
        model = self.model
        columns = []
        gains = []

        def add_difference(other: CandidateImpact, at: Array, change: float) -> None:
            new = model.computed_signals(other, at)
            columns.append((new.signals - computed.signals).ravel() / change)
            gains.append((log_strength(new.hit) - log_strength(computed.hit)) / change)

        for i in range(len(chart.axes)):
            x = np.zeros(len(chart.axes))
            x[i] = PLACE_STEP
            add_difference(blow, model.modes_at(chart, x), PLACE_STEP)

        for name in self.logs:
            change = FREQUENCY_STEP if name == "E" else LOG_STEP
            value = {name: getattr(blow, name) * np.exp(change)}
            add_difference(replace(blow, **value), site_data, change)
        later = replace(blow, start=blow.start + LOG_STEP * blow.contact_time_estimate)
        add_difference(later, site_data, LOG_STEP)
        n, m, J = computed.modal_signals.shape
        p = len(columns)
        jacobian = np.zeros((n * m + J + m * J, p + J + m * J))
        jacobian[: n * m, :p] = np.transpose(columns)

        # all frequencies at once: each mode's own part of the change
        ratio = 1 + blow.frequency_changes
        moved = replace(blow, frequency_changes=ratio * (1 + FREQUENCY_STEP) - 1)
        parts = model.computed_signals(moved, site_data).modal_signals - computed.modal_signals
        by_frequency = parts * (1 + blow.share_changes) / (FREQUENCY_STEP * ratio)
        jacobian[: n * m, p : p + J] = by_frequency.reshape(n * m, J)
        for s in range(m):
            column = p + J + s * J
            jacobian[s : n * m : m, column : column + J] = computed.modal_signals[:, s]
        rows = np.arange(J)
        jacobian[n * m + rows, p + rows] = 1 / self.sigma
        jacobian[n * m + J :, p + J :] = np.kron(self.unshared, np.eye(J))
        return jacobian, np.transpose(gains)

    def _impact_with_uncertainty(
        self,
        blow: CandidateImpact,
        chart: LocalChart,
        computed: ComputedSignals,
        residual: Array,
        J: Array,
        gains: Array,
    ) -> ProbableImpact:
        """The most probable impact with its uncertainty, from the state at the end of a search."""
        d = len(chart.axes)
        k = len(self.logs)
        p = d + k + 1
        data = computed.signals.size
        inverse = covariance(J.T @ J)
        degrees = np.sum((J[:data] @ inverse) * J[:data])
        chi2 = float(residual[:data] @ residual[:data]) / max(data - degrees, 1.0)
        unit = np.concatenate([np.full(d, chart.size), np.ones(k), [blow.contact_time_estimate]])

        return ProbableImpact(
            blow,
            chart,
            computed.hit,
            cost=float(residual @ residual),
            unknown_names=(*("place",) * d, *self.logs, "start"),
            covariance=inverse[:p, :p] * unit * unit[:, None] * max(chi2, 1.0),
            strength_derivatives=gains / unit,
            chi2=chi2,
            signals=computed.signals,
        )


def log_strength(hit: History) -> Array:
    """Logarithms (2,) of peak force and impulse."""
    return np.log(np.maximum([hit.peak_force, hit.impulse], float_info.min))


#: Number of places at which searches start.
STARTING_PLACE_COUNT = 8
#: Their least distance over the spacing of sites.
MIN_PLACE_DISTANCE = 2.5
#: Initial masses of the impactor, over that of the structure.
INITIAL_MASS_RATIOS = (1e-3, 4e-3, 0.016, 0.064, 0.25, 1.0)
#: Number of searches that begin, …
MAX_STARTED_SEARCHES = 4
#: … and that are continued.
MAX_CONTINUED_SEARCHES = 2
STARTED_SEARCH_STEPS, CONTINUED_SEARCH_STEPS = 5, 25  # of searches that begin, that go on
#: A second search is not continued if its cost exceeds this times the first's.
HOPELESS_COST_RATIO = 10.0
#: chi² above which the best blow does not explain the signals.
POOR_CHI2 = 2.0
#: Factors on the mass of the impactor that are tried then: heavier ones may touch a second time,
#: which no small step from a lighter one does.
HEAVIER_MASS_FACTORS = (1.3, 2.0)
#: Contact time × velocity/approach of an impact on a rigid wall by Hertz's law:
#: 2 ∫₀¹ dx/√(1 − x^(5/2)).
HERTZ_TIME_FACTOR = 2.943
#: Impulse over mass × velocity of the first guess, between 1 (no rebound) and 2 (a rigid wall).
INITIAL_IMPULSE_RATIO = 1.6


def most_probable_impacts(
    model: SearchModel,
    scanned: PulseScan,
    unknown_names: Sequence[str],
    known_values: Mapping[str, float],
    structure_mass: float,
    frequency_sigma: float,
    share_sigma: float,
) -> list[ProbableImpact]:
    """The most probable impacts, the best first; the second is at another place if possible.

    known_values : values of known quantities; structure_mass : [kg]; frequency_sigma, share_sigma :
    as for `Search`.
    """
    search = Search(model, unknown_names, frequency_sigma, share_sigma)
    masses = [share * structure_mass for share in INITIAL_MASS_RATIOS]
    if "mass" in known_values:
        masses = [known_values["mass"]]
    starts = [
        _scaled_to_signals(search, _initial_impact(model, scanned, i, mass, known_values))
        for i in _starting_places(model, scanned)
        for mass in masses
    ]
    starts.sort(key=lambda pair: pair[0])
    starting_impacts = []

    with counting("searching the blow", MAX_STARTED_SEARCHES + MAX_CONTINUED_SEARCHES) as ready:
        for count, (_, blow) in enumerate(starts[:MAX_STARTED_SEARCHES], start=1):
            starting_impacts.append(search.refined_impact(blow, STARTED_SEARCH_STEPS))
            ready(count)
        starting_impacts.sort(key=attrgetter("cost"))
        fits = []
        for fit in _fits_to_continue(model, starting_impacts):
            fits.append(search.refined_impact(fit.blow, CONTINUED_SEARCH_STEPS))
            ready(MAX_STARTED_SEARCHES + len(fits))
        best = min(fits, key=attrgetter("cost"))
        if best.chi2 > POOR_CHI2 and {"mass", "velocity"} <= set(unknown_names):
            for by in HEAVIER_MASS_FACTORS:  # of the same momentum, which may touch a second time
                mass, velocity = by * best.blow.mass, best.blow.velocity / by
                heavier = replace(best.blow, mass=mass, velocity=velocity)
                fits.append(search.refined_impact(heavier, CONTINUED_SEARCH_STEPS))

    return sorted(fits, key=attrgetter("cost"))


def _fits_to_continue(model: SearchModel, fits: list[ProbableImpact]) -> list[ProbableImpact]:
    """The fits to continue: the best fit, and the best at another place or else the second best."""
    first, *others = fits
    least_distance = MIN_PLACE_DISTANCE * model.surface.spacing(first.blow.site)
    place = first.blow.place
    apart = [fit for fit in others if np.linalg.norm(fit.blow.place - place) > least_distance]

    limit = HOPELESS_COST_RATIO * first.cost
    promising = [fit for fit in (*apart, *others) if fit.cost < limit]
    return [first, *promising][:MAX_CONTINUED_SEARCHES]


def _starting_places(model: SearchModel, scanned: PulseScan) -> list[int]:
    """The sites whose pulses fit best, at some distance from each other."""
    sites: list[int] = []
    points = model.surface.points
    for i in np.argsort(-scanned.power_share, kind="stable").tolist():
        least_distance = MIN_PLACE_DISTANCE * model.surface.spacing(i)
        if all(np.linalg.norm(points[i] - points[k]) > least_distance for k in sites):
            sites.append(i)
        if len(sites) == STARTING_PLACE_COUNT:
            break

    return sites


def _initial_impact(
    model: SearchModel, scanned: PulseScan, i: int, mass: float, known: Mapping[str, float]
) -> CandidateImpact:
    """An impact whose pulse on a rigid wall equals the pulse of the scan at site i."""
    T = float(scanned.duration[i])
    impulse = 2 / np.pi * T * float(scanned.amplitude[i])
    velocity = max(impulse, float_info.min) / (INITIAL_IMPULSE_RATIO * mass)
    approach = T * velocity / HERTZ_TIME_FACTOR
    exponent = model.law_exponent
    stiffness = (exponent + 1) / 2 * mass * velocity**2 / approach ** (exponent + 1)
    J = len(model.omega)
    m = len(model.sensor_shapes)
    guess = {"velocity": velocity, "stiffness": stiffness, **known, "mass": mass}

    return CandidateImpact(
        model.surface.points[i],
        i,
        start=float(scanned.start[i]),
        contact_time_estimate=T,
        frequency_changes=np.zeros(J),
        share_changes=np.zeros((m, J)),
        **guess,
    )


def _scaled_to_signals(search: Search, blow: CandidateImpact) -> tuple[float, CandidateImpact]:
    """(cost, impact) after its strength is scaled to fit the signals best."""
    model = search.model
    signals = search.state_at(blow)[2].signals.ravel()
    data = model.data.scaled_signals.ravel()
    power = float(signals @ signals)
    if power == 0.0:
        return float(data @ data), blow
    amplitude = max(float(signals @ data) / power, 0.1)

    # with this change of stiffness the force of a power law is proportional to the velocity
    change = {"velocity": amplitude, "stiffness": amplitude ** (1 - model.law_exponent)}
    new = {n: getattr(blow, n) * c for n, c in change.items() if n in search.logs}
    return np.sum((amplitude * signals - data) ** 2), replace(blow, **new)
