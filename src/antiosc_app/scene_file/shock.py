"""Shock response spectra of a probe, one for each component."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

import antiosc
from antiosc import History, ShockSpectrum, Structure, resolved_frequency
from antiosc.base._types import Array
from antiosc.base.cfc import CLASS_FREQUENCIES, HALF_POWER_RATIO
from antiosc.base.errors import InputError
from antiosc.base.texts import engineering, range_text

#: Samples in a period of the highest frequency of a model, and in one of the highest resolved one.
SAMPLES_PER_HIGHEST, SAMPLES_PER_RESOLVED = 5, 20
#: Least number of samples of a run, and most times the anti-oscillators.
MIN_SAMPLES, MAX_SAMPLES_TIMES_COUNT = 1001, 4_000_000


class ProbeShock(NamedTuple):
    """Shock response spectra [m/s²] by component, from a velocity.

    `reported_frequencies`: frequencies [Hz] at which values are reported; `filter`: the probe's
    filter.
    """

    spectra: Mapping[str, ShockSpectrum]
    reported_frequencies: tuple[float, ...] = ()
    filter: str | None = None

    @property
    def component(self) -> str:
        """The component with the largest value among the frequencies that the filter passes."""
        return max(self.spectra, key=lambda name: float(self._passed_spectrum(name).max()))

    def _passed_spectrum(self, name: str) -> Array:
        """Spectrum of the component `name`, 0 at frequencies that the filter does not pass.

        It is unchanged if the filter passes none of its frequencies.
        """
        spectrum = self.spectra[name]
        limit = np.inf if self.filter is None else HALF_POWER_RATIO * CLASS_FREQUENCIES[self.filter]
        beyond = spectrum.frequency > limit
        return np.where(beyond & ~beyond.all(), 0.0, spectrum.maximax)

    def numbers(self) -> dict[str, Any]:
        """Largest value, its component and frequency; under "at": at the reported frequencies."""
        name = self.component
        k = int(np.argmax(self._passed_spectrum(name)))
        spectrum = self.spectra[name]
        found: dict[str, Any] = {"component": name, "value": float(spectrum.maximax[k])}
        found |= {"unit": "m/s²", "frequency": float(spectrum.frequency[k]), "Q": spectrum.Q}
        found |= {
            "filter": self.filter,
            "at": [self._value_at(one) for one in self.reported_frequencies],
        }
        return found

    def _value_at(self, frequency: float) -> dict[str, Any]:
        """Largest component at a frequency [Hz], and its value, None outside of the spectrum."""
        known = self.spectra[self.component].frequency
        if not known[0] <= frequency <= known[-1]:
            return {"frequency": frequency, "value": None}
        values = {
            name: float(np.interp(np.log(frequency), np.log(known), one.maximax))
            for name, one in self.spectra.items()
        }
        component = max(values, key=lambda name: values[name])
        return {"frequency": frequency, "component": component, "value": values[component]}

    @property
    def sentence(self) -> str:
        """The numbers in words."""
        n = self.numbers()
        through = f" through {self.filter}" if self.filter else ""
        value, frequency = engineering(n["value"], "m/s²", 4), engineering(n["frequency"], "Hz")
        told = f"shock response spectrum (Q = {n['Q']:g}) {n['component']}{through}: largest"
        told += f" {value} (no error bar) at {frequency}"
        for one in n["at"]:
            told += f"; at {engineering(one['frequency'], 'Hz')} "
            if one["value"] is None:
                known = self.spectra[n["component"]].frequency
                told += f"not known, it has {range_text(known[0], known[-1], 'Hz')}"
            else:
                told += f"{engineering(one['value'], 'm/s²', 4)}, {one['component']}"
        return told


def shock_of(
    structure: Structure, history: History, asked: tuple[float, ...], **place: Any
) -> ProbeShock:
    """Shock response spectra of the velocity at a point.

    `asked`: frequencies [Hz] to be reported; `place`: further arguments of `antiosc.probe`.
    """
    model: Any = history.of(place.get("body", "structure"))[0]
    highest = float(np.max(model.omega, initial=0.0)) / (2 * np.pi)
    resolved = np.inf
    with contextlib.suppress(InputError):  # a model that was read lacks it
        resolved = resolved_frequency(model)

    end = float(history.time[-1])
    rate = max(SAMPLES_PER_HIGHEST * highest, SAMPLES_PER_RESOLVED * min(resolved, highest))
    count = max(
        int(min(rate * end + 2, MAX_SAMPLES_TIMES_COUNT / max(model.omega.size, 1))), MIN_SAMPLES
    )
    times = place.pop("times", np.linspace(0.0, end, count))
    velocity = antiosc.probe(structure, history, quantity="velocity", times=times, **place)
    spectra = {
        component: antiosc.srs(times, signal, signal="velocity", resolved=resolved)
        for component, signal in zip("xyz", velocity.T, strict=False)
    }
    return ProbeShock(spectra, asked, place.get("filter"))
