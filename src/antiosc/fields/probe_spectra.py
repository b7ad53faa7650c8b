"""Shock response spectra at a point of a part, with their error bars."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.cfc import CLASSES, PASSED
from antiosc.base.errors import AccuracyWarning, InputError, warn, warnings_to, without_warnings
from antiosc.base.texts import ReprMixin, engineering, percent, range_text
from antiosc.fem.platform import on_root
from antiosc.fem.structure.structure import Structure
from antiosc.fields.probe import probe
from antiosc.fields.probe_error import (
    NOT_CONVERGED,
    ProbeError,
    budget_of,
    by_laws,
    linear,
    linear_run,
    repeated,
    with_fewer,
    with_force,
)
from antiosc.fields.spectra import SAMPLES_OF_A_PERIOD, ShockSpectrum, draw_spectrum, srs
from antiosc.impact.histories import History
from antiosc.impact.histories.factors import times_of
from antiosc.models.body import resolved_frequency
from antiosc.plot.charts import figure_or_path, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from antiosc.impact.histories.bars import ErrorBudget

#: Samples of a spectrum in one period of the highest frequency of the model, besides those that
#: `srs` needs of the highest that is resolved (of a bracket's spectrum 5 left 0.001 dB, 2 left
#: 0.006 dB);
HIGHEST_SAMPLES = 5
#: … and in a run at least, and at most times the anti-oscillators: 4 million took 0.5 GB, 8 million
#: 1.0 GB.
LEAST_SAMPLES, MOST_VALUES = 1001, 4_000_000
#: Octaves within which the largest difference of two spectra is the error at their middle, since
#: curves that are shifted cross. Of the bracket at 8 points (3 components, 0.5 to 20 kHz, 7 meshes
#: and n, against 110 000 dofs with n = 160) the bar held 98.4 to 100 % of the curves and 56 of 56
#: largest values (error 0.6 of the bar at most); without a window 82 to 99.7 %, and 52.
WINDOW = 0.5


@dataclass(frozen=True, eq=False, repr=False)
class ProbeSpectra(ReprMixin):
    """The shock response spectra at a point of a part.

    Attributes
    ----------
    spectra : component -> its spectrum, m/s², with its `bar` where the force has one.
    times : (n,) times of the velocity from which they are made, s.
    filter : channel frequency class through which the velocity is seen, or None.
    resolved : frequency in Hz up to which the model has the natural modes of its mesh or matrices;
        None if it is not known.
    error : relative error of the largest value that the filter passes; None if not estimated.
    asked : frequencies in Hz whose values are told besides.
    """

    spectra: Mapping[str, ShockSpectrum]
    times: Array
    filter: str | None = None
    resolved: float | None = None
    error: ProbeError | None = None
    asked: tuple[float, ...] = ()

    @property
    def component(self) -> str:
        """The component with the largest value that its filter passes."""
        return max(self.spectra, key=lambda name: float(self._passing(self.spectra[name]).max()))

    def _passing(self, spectrum: ShockSpectrum) -> Array:
        """Values (m,) of a spectrum, 0 beyond what the filter passes if it passes any of them."""
        beyond = spectrum.frequency > (np.inf if self.passed is None else self.passed)
        return np.where(beyond & ~beyond.all(), 0.0, spectrum.maximax)

    @property
    def peak(self) -> int:
        """Number of the frequency of the largest value that the filter passes, from 0."""
        return int(np.argmax(self._passing(self.largest)))

    @property
    def largest(self) -> ShockSpectrum:
        """The spectrum of that component."""
        return self.spectra[self.component]

    @property
    def passed(self) -> float | None:
        """Frequency in Hz up to which the filter leaves 0.707 or more; None without a filter."""
        return None if self.filter is None else PASSED * CLASSES[self.filter]

    @property
    def has_converged(self) -> bool:
        """Whether the largest value depends on the number of anti-oscillators by less than 10 %."""
        return self.error is None or self.error.truncation < NOT_CONVERGED

    @property
    def sentence(self) -> str:
        """The largest value with its bar, and up to which frequency the spectrum is the part's."""
        n = self.numbers()
        error = "" if self.error is None else f" {self.error}"
        value, frequency = engineering(n["value"], "m/s²", 4), engineering(n["frequency"], "Hz")
        largest = f"{self._seen}: largest {value}{error} at {frequency}{self._limits()}"
        told = "".join(f"; {self._told_at(frequency)}" for frequency in self.asked)
        return f"shock response spectrum (Q = {n['Q']:g}) {largest}{told}"

    def at(self, frequency: float) -> dict[str, Any]:
        """The value at a frequency in Hz, of the component with the largest one there.

        Returns
        -------
        dict
            `frequency`, `component`, `value` and its absolute `bar` in m/s² (None without one),
            interpolated between the frequencies of the spectrum.

        Raises
        ------
        InputError
            A frequency outside of the spectrum.
        """
        frequency = checks.positive("frequency", frequency)
        known = self.largest.frequency
        if not self._has(frequency):
            asked = engineering(frequency, "Hz")
            raise InputError(f"{self._range}: {asked} is outside.")

        def there(values: Array) -> float:
            return float(np.interp(np.log(frequency), np.log(known), values))

        values = {name: there(one.maximax) for name, one in self.spectra.items()}
        component = max(values, key=lambda name: values[name])
        bar = self.spectra[component].bar
        return {
            **{"frequency": frequency, "component": component, "value": values[component]},
            **{"unit": "m/s²", "bar": None if bar is None else there(bar)},
        }

    def _has(self, frequency: float) -> bool:
        """Whether a frequency in Hz lies in the spectrum."""
        known = self.largest.frequency
        return bool(known[0] <= frequency <= known[-1])

    @property
    def _range(self) -> str:
        """The frequencies of the spectrum, in words."""
        known = self.largest.frequency
        return f"the shock response spectrum has {range_text(known[0], known[-1], 'Hz')}"

    def _told_at(self, frequency: float) -> str:
        """The value at a frequency, in words."""
        of = f"at {engineering(frequency, 'Hz')}"
        if not self._has(frequency):
            return f"{of} not known: {self._range}"
        known = self.at(frequency)
        share = "no error bar"
        if known["bar"] is not None and known["value"]:
            share = f"± {percent(known['bar'] / known['value'])}"
        above = ", above what the model has" * (frequency > (self.resolved or np.inf))
        return (
            f"{of} {engineering(known['value'], 'm/s²', 4)} ({share}){above}, {known['component']}"
        )

    @property
    def _seen(self) -> str:
        """The component, and the filter through which it is seen."""
        return f"{self.component}{f' through {self.filter}' if self.filter else ''}"

    def _limits(self) -> str:
        """The end of the sentence."""
        frequency = self.largest.frequency
        told = []
        if self.passed is not None and frequency[-1] > self.passed:
            passed = engineering(self.passed, "Hz")
            told.append(
                f"; above {passed} the spectrum is that of the filtered signal, not of the part's"
                " motion: for it leave out the filter"
            )
        beyond = self.resolved is not None and self.numbers()["frequency"] > self.resolved
        if self.resolved is not None and (beyond or not told):
            known = engineering(self.resolved, "Hz")
            missing = ", and lacks those of this frequency" * beyond
            told.append(
                f"; the model has the natural modes of its mesh or matrices up to {known}{missing}"
            )
        return "".join(told)

    def numbers(self) -> dict[str, Any]:
        """The largest value in m/s² that the filter passes, its component, frequency in Hz and
        error.
        """
        spectrum = self.largest
        k = self.peak
        error = self.error
        shares: dict[str, Any] = dict.fromkeys(("truncation", "mesh", "force", "error"))
        if error is not None:
            shares |= {"truncation": error.truncation, "mesh": error.mesh, "force": error.force}
            shares["error"] = None if error.force is None else float(error)
        asked = [self.at(one) for one in self.asked if self._has(one)]
        return {
            **{"component": self.component, "value": float(spectrum.maximax[k]), "unit": "m/s²"},
            **{"frequency": float(spectrum.frequency[k]), "Q": spectrum.Q},
            **{"resolved": self.resolved, "filter": self.filter, "passed": self.passed},
            **shares,
            **({"at": asked} if self.asked else {}),
        }

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The spectrum of the component with the largest value; written to `path` if given."""
        figure = new_figure((7.0, 4.0), shown=path is None)
        axes = figure.subplots()
        if self.passed is not None:
            label = f"{self.filter} passes up to {engineering(self.passed, 'Hz')}"
            axes.axvline(self.passed, color="0.4", lw=1, label=label)
        draw_spectrum(self.largest, axes, "m/s²", f", {self._seen}")
        return figure_or_path(figure, path)

    def _facts(self) -> list[tuple[str, str]]:
        n = self.numbers()
        value, frequency = engineering(n["value"], "m/s²", 4), engineering(n["frequency"], "Hz")
        error = [] if self.error is None else [("error", str(self.error))]
        return [("largest", f"{self._seen}: {value} at {frequency}"), *error]


def even_times(history: History, omega: Array, resolved: float) -> Array:
    """Evenly spaced times [s] over a run for spectra, from the frequencies [rad/s] of its model and
    that which it resolves [Hz].
    """
    end = float(history.time[-1])
    highest = float(np.max(omega, initial=0.0)) / (2 * np.pi)
    rate = max(HIGHEST_SAMPLES * highest, SAMPLES_OF_A_PERIOD * min(resolved, highest))
    count = int(min(rate * end + 2, MOST_VALUES / max(omega.size, 1)))
    return np.linspace(0.0, end, max(count, LEAST_SAMPLES))


def spectra_at(
    structure: Structure,
    history: History,
    point: Sequence[float] | str | None = None,
    times: ArrayLike | None = None,
    frequencies: ArrayLike | None = None,
    Q: float = 10.0,
    parts: str = "all",
    **options: Any,
) -> ProbeSpectra:
    """The shock response spectra of the velocity at a point, without bars.

    Parameters
    ----------
    structure, history, point, **options
        As for `probe`; a history of a scene, too.
    times, frequencies, Q, parts
        As for `probe_srs`.

    Warns
    -----
    AccuracyWarning
        As `srs`, of the component with the largest value.
    """
    model: Any = history.of(options.get("body", "structure"))[0]
    resolved = None
    with contextlib.suppress(InputError):  # a model that was read lacks it
        resolved = resolved_frequency(model)
    even = even_times(history, model.omega, resolved or 0.0)
    t = times_of(history, even if times is None else times)
    velocity = probe(structure, history, point, "velocity", t, **options)
    spectra: dict[str, ShockSpectrum] = {}
    messages: dict[str, list[str]] = {}
    asked: dict[str, Any] = {"Q": Q, "parts": parts, "signal": "velocity", "resolved": resolved}
    for component, signal in zip("xyz", velocity.T, strict=False):
        own = messages[component] = []
        with warnings_to(own.append):
            spectra[component] = srs(t, signal, frequencies, **asked)
    found = ProbeSpectra(spectra, t, options.get("filter"), resolved)
    for message in messages[found.component]:  # of the others, which are smaller, it says nothing
        on_root(structure.comm, partial(warn, message, AccuracyWarning))
    return found


def compared(
    own: ProbeSpectra,
    fewer: Callable[..., ProbeSpectra],
    corrected: Callable[..., ProbeSpectra] | None,
    budget: ErrorBudget | None,
    by_law: Sequence[Sequence[Callable[..., ProbeSpectra]]] = (),
) -> ProbeSpectra:
    """Spectra with their bars.

    `fewer`, `corrected`: make those of the same impact with half the anti-oscillators, and on the
    model that is corrected for its mesh (None: without such a model), at given `times` and
    `frequencies`. `budget`: the error budget of the impact; None if it has none. `by_law`: make
    those of the same impact by the changed laws of each cause of the law's error.
    """
    asked = {"times": own.times, "frequencies": own.largest.frequency}
    mesh: dict[str, Array] = {}
    with without_warnings():  # they are those of the spectra themselves
        truncation = _apart(own, fewer(**asked))
        if corrected is not None:
            safety = 1.0 if budget is None else budget.safety
            mesh = _apart(own, corrected(**asked), safety)
        law = _by_causes(own, [[_apart(own, one(**asked)) for one in cause] for cause in by_law])
    peak = own.peak
    size = own.largest.maximax[peak] or 1.0

    def share(apart: dict[str, Array]) -> float:
        return float(apart[own.component][peak] / size)

    of_mesh = share(mesh) if mesh else None
    error = with_force(share(truncation), budget, of_mesh, share(law))
    rest = None if budget is None else budget.rest_of_force
    if budget is None or rest is None:
        return replace(own, error=error)
    of_law = budget["peak_force"].law or 0.0
    spectra = {}
    for name, one in own.spectra.items():
        by_force = rest * one.maximax + np.maximum(law[name] - of_law * one.maximax, 0.0)
        bar = truncation[name] + mesh.get(name, 0.0) + by_force
        spectra[name] = replace(one, bar=bar)
    return replace(own, spectra=spectra, error=error)


def _by_causes(own: ProbeSpectra, apart: Sequence[Sequence[dict[str, Array]]]) -> dict[str, Array]:
    """Component -> (m,) sum over the causes of the largest difference by each."""
    return {
        name: sum(
            (np.max([one[name] for one in cause], axis=0) for cause in apart if cause),
            np.zeros_like(spectrum.maximax),
        )
        for name, spectrum in own.spectra.items()
    }


def _apart(own: ProbeSpectra, other: ProbeSpectra, factor: float = 1.0) -> dict[str, Array]:
    """Component -> (m,) largest difference of two spectra within `WINDOW`, times the factor."""
    octaves = np.log2(own.largest.frequency)
    near = np.abs(octaves[:, None] - octaves) <= WINDOW / 2
    return {
        name: factor * (near * np.abs(one.maximax - other.spectra[name].maximax)).max(axis=1)
        for name, one in own.spectra.items()
    }


def probe_srs(
    structure: Structure,
    history: History,
    point: Sequence[float] | str | None = None,
    *,
    times: ArrayLike | None = None,
    frequencies: ArrayLike | None = None,
    Q: float = 10.0,
    parts: str = "all",
    **options: Any,
) -> ProbeSpectra:
    """Shock response spectra of the motion at a point, with their error bars.

    They are `srs` of the velocity of `probe`. The bar is the sum of three errors: the difference to
    the spectrum of the same impact with half of the anti-oscillators; the difference to that on the
    model that is corrected for its mesh, times the safety factor of `hit.error_budget` (of models
    with an estimate of the mesh's error); and the error of the force beside its truncation. Each
    difference is the largest within a quarter of an octave below and above. Without a bar of the
    force there is none: extract with `error="estimate"`. The damping of the part has no error in
    it. Of a part that stretches linear runs are compared.

    Parameters
    ----------
    structure, history, point, **options
        As for `probe`; the history is that of `simulate` or `strike`, whose impact is simulated
        twice more, and by other laws. With `filter` the spectra are those of the filtered signal.
    times : array_like (n,), optional
        Times of the velocity in s; default: even ones, 20 in a period of the highest frequency that
        the model resolves, and 5 in one of its highest.
    frequencies, Q, parts
        As for `srs`; the bar needs several frequencies in half an octave.

    Returns
    -------
    ProbeSpectra
        `.spectra` by component with their `bar`, `.error` of the largest value, `.plot()`.

    Raises
    ------
    InputError
        As `probe` and `srs`; a history that cannot be repeated, and a model with less than two
        anti-oscillators.

    Warns
    -----
    AccuracyWarning
        As `srs`, of the component with the largest value; if that value has not converged.
    """
    linear_history = linear_run(history)
    at = partial(spectra_at, structure, point=point, Q=Q, parts=parts, **options)
    own = at(history=linear_history, times=times, frequencies=frequencies)
    corrected = None
    if history.model.strain_error is not None:
        corrected = partial(at, history=repeated(history, linear(history).corrected()))
    budget = budget_of(history)
    changed = [[partial(at, history=hit) for hit in cause] for cause in by_laws(history)]
    found = compared(own, partial(at, history=with_fewer(history)), corrected, budget, changed)
    if not found.has_converged:
        on_root(structure.comm, partial(warn, NOT_SETTLED, AccuracyWarning))
    return found


#: Sentence on a spectrum whose largest value depends on the anti-oscillators.
NOT_SETTLED = (
    "The largest value of the shock response spectrum has not converged: with half the"
    " anti-oscillators it changes by a tenth or more; extract more anti-oscillators (n)."
)
