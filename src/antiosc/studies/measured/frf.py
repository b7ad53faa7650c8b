"""`FRF`: measured frequency responses between named sites, as receptances in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, ComplexArray
from antiosc.base.errors import InputError
from antiosc.base.texts import Brief
from antiosc.studies.measured.modes import Pairs

Quantity = Literal["receptance", "mobility", "accelerance"]
#: Power of iw between the receptance and what was measured.
POWER: dict[str, int] = {name: power for power, name in enumerate(get_args(Quantity))}
#: Fewest lines of a measurement, and most values.
FEWEST_LINES, MOST_VALUES = 16, 20_000_000
#: Coherence that rounding leaves above 1, and the least that counts.
COHERENCE_ROUNDING, LEAST_COHERENCE = 1e-6, 1e-4
#: Blows that were averaged where the measurement does not tell.
AVERAGES = 5
#: Least |1 + w^2 m H| at which a sensor's mass can be removed.
LEAST_SENSOR = 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class FRF(Brief):
    """Frequency response functions: motion of sites per force on sites.

    Parameters
    ----------
    frequency : array_like, shape (K,)
        [Hz], ascending; a line at 0 Hz is left out.
    values : array_like, complex, shape (K,), or (K, p, q)
        One driving point, or motions of p sites per force on q of them: m/N, m/(s N) or m/(s^2 N).
        With time as exp(iwt), motion and force of a site along one direction.
    quantity : "receptance", "mobility" or "accelerance"
        Displacement, velocity or acceleration per force.
    coherence : array_like, optional
        Of each value, 0 to 1: the noise of an average (H1) of `averages` blows follows from it.
    averages : int
        Number of averages of the coherence.
    sigma : array_like, optional
        Standard deviation of each complex value, in place of the coherence.
    sites : sequence of str
        Names of several sites, p.
    references : sequence of str, optional
        Names of the q sites on which the forces act; default: all.

    Raises
    ------
    InputError
        For numbers that are not finite, frequencies that do not ascend, and shapes that do not fit.
    """

    frequency: Array
    values: ComplexArray
    quantity: Quantity
    coherence: Array | None = None
    averages: int = AVERAGES
    sigma: Array | None = None
    sites: tuple[str, ...] = ()
    references: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        checks.choice("quantity", self.quantity, get_args(Quantity))
        f = checks.array("frequency", self.frequency, (None,))
        values = checks.spectrum("values", self.values).astype(complex)
        names = _names("sites", self.sites)
        forced = names if self.references is None else _names("references", self.references)
        if self.references is not None and (unknown := sorted(set(forced) - set(names))):
            raise InputError(f"references name {checks.shown(unknown)}, not among the sites.")
        if values.size > MOST_VALUES:
            raise InputError(f"values has {values.size} entries; at most {MOST_VALUES} are taken.")
        shape = (len(f), len(names), len(forced)) if names else (len(f),)
        if values.shape != shape:
            raise InputError(
                f"values must have shape {shape}: frequencies, sites, references; got"
                f" {values.shape}."
            )
        if np.any(f < 0) or np.any(np.diff(f) <= 0):
            raise InputError("frequency must ascend, from 0 Hz or above.")
        seen = f > 0
        if np.count_nonzero(seen) < FEWEST_LINES:
            raise InputError(
                f"a measurement needs {FEWEST_LINES} frequencies above 0 Hz or more; got"
                f" {np.count_nonzero(seen)}."
            )
        found: dict[str, Array] = {}
        for name in ("coherence", "sigma"):
            if getattr(self, name) is not None:
                found[name] = checks.kept(checks.array(name, getattr(self, name), shape)[seen])
        if self.sigma is not None and np.any(found["sigma"] <= 0):
            raise InputError("sigma must be > 0: it is the standard deviation of each value.")
        if self.coherence is not None:
            gamma = found["coherence"]
            if np.any((gamma < 0) | (gamma > 1 + COHERENCE_ROUNDING)):
                raise InputError(
                    f"coherence lies between 0 and 1; it ranges from {gamma.min():g} to"
                    f" {gamma.max():g}."
                )
        if np.any(values[seen] == 0):
            raise InputError("values must not be 0 above 0 Hz: the measurement has dropouts.")
        checks.store(
            self,
            frequency=checks.kept(f[seen]),
            values=checks.kept(values[seen]),
            averages=checks.whole("averages", self.averages),
            sites=names,
            references=forced,
            **found,
        )

    def _facts(self) -> list[tuple[str, str]]:
        f = self.frequency
        facts = [
            (self.quantity, f"{f.size} lines, {f[0]:.5g} to {f[-1]:.5g} Hz"),
            ("sites", ", ".join(self.sites)),
            (
                "noise",
                "sigma" if self.sigma is not None else "coherence" * (self.coherence is not None),
            ),
        ]
        return [(name, text) for name, text in facts if text]

    @property
    def receptance(self) -> ComplexArray:
        """Displacement per force [m/N], of the shape of `values`."""
        return self.values / self._power

    @property
    def receptance_sigma(self) -> Array | None:
        """Standard deviation [m/N] of the complex receptances; None where nothing is known."""
        scale = np.abs(self._power)
        if self.sigma is not None:
            return self.sigma / scale
        if self.coherence is None:
            return None
        # of a complex H1 estimate: (1 - gamma^2)/(gamma^2 n) of |H|^2 (Bendat and Piersol)
        gamma = np.clip(self.coherence, LEAST_COHERENCE, 1 - 1e-8)
        return np.asarray(
            np.abs(self.values) / scale * np.sqrt((1 - gamma) / gamma / self.averages)
        )

    @property
    def pairs(self) -> Pairs:
        """(response, excitation) of the columns, numbers of sites."""
        if not self.sites:
            return [(0, 0)]
        assert self.references is not None
        at = [self.sites.index(name) for name in self.references]
        return [(m, n) for m in range(len(self.sites)) for n in at]

    @property
    def _power(self) -> ComplexArray:
        """(iw)^power, of the dimensions of `values`."""
        iw = 2j * np.pi * self.frequency
        return np.asarray((iw ** POWER[self.quantity]).reshape(-1, *[1] * (self.values.ndim - 1)))

    def within(self, band: ArrayLike | None) -> FRF:
        """The lines within a band (low, high) [Hz]; InputError if it holds too few."""
        if band is None:
            return self
        low, high = checks.array("band", band, (2,))
        if not 0 <= low < high:
            raise InputError(
                f"band must be (low, high) in Hz, 0 <= low < high; got {low:g}, {high:g}."
            )
        f = self.frequency
        part = (f >= low) & (f <= high)
        if np.count_nonzero(part) < FEWEST_LINES:
            raise InputError(
                f"the band {low:g} to {high:g} Hz holds {np.count_nonzero(part)} of the lines from"
                f" {f[0]:g} to {f[-1]:g} Hz; {FEWEST_LINES} or more are needed."
            )
        return replace(
            self,
            frequency=f[part],
            values=self.values[part],
            coherence=None if self.coherence is None else self.coherence[part],
            sigma=None if self.sigma is None else self.sigma[part],
        )

    def without_sensor(self, mass: float | Mapping[str, float]) -> FRF:
        """The responses without the mass of the sensor at the site: Z + w^2 m in place of Z.

        Parameters
        ----------
        mass : float, or {name of a site: float}
            [kg]. Of several sites the sensors sit there during all measurements, and the forces
            must act on all sites. The noise changes with the responses.

        Raises
        ------
        InputError
            A mass below 0, forces on some sites alone, or a mass that moves alone at a frequency.
        """
        if isinstance(mass, Mapping):
            if unknown := sorted(set(map(str, mass)) - set(self.sites)):
                raise InputError(f"sensor_mass names {checks.shown(unknown)}, no site.")
            m = np.array(
                [checks.nonnegative("sensor_mass", mass.get(s, 0.0), "kg") for s in self.sites]
            )
        else:
            m = np.full(max(len(self.sites), 1), checks.nonnegative("sensor_mass", mass, "kg"))
        if not m.any():
            return self
        p = len(m)
        if self.references != self.sites:
            raise InputError(
                "a sensor's mass can be removed where the forces act on all sites; references lack"
                f" {checks.shown(sorted(set(self.sites) - set(self.references or ())))}."
            )
        H = self.receptance.reshape(-1, p, p)
        x = ((2 * np.pi * self.frequency) ** 2)[:, None, None]
        turn = np.eye(p) + x * m[:, None] * H
        if np.linalg.svd(turn, compute_uv=False).min() < LEAST_SENSOR:
            raise InputError(
                f"a sensor of {m.max():g} kg moves almost alone at some frequency, so that its mass"
                " cannot be removed: check sensor_mass (in kg) and the units of the measurement."
            )
        inverse = np.linalg.inv(turn)
        sigma = self.receptance_sigma
        if sigma is not None:
            left = np.abs(np.linalg.inv(np.eye(p) + x * H * m)) ** 2
            sigma = np.sqrt(left @ sigma.reshape(-1, p, p) ** 2 @ np.abs(inverse) ** 2)
            sigma = sigma.reshape(self.values.shape) * np.abs(self._power)
        values = (H @ inverse).reshape(self.values.shape) * self._power
        return replace(self, values=values, sigma=sigma, coherence=None)


def stated(quantity: Quantity | None) -> Quantity:
    """The quantity; InputError where neither the file nor the caller states it."""
    if quantity is None:
        raise InputError(
            'the file does not tell what was measured: give quantity="accelerance", "mobility" or'
            ' "receptance".'
        )
    return quantity


def _names(name: str, given: Sequence[str]) -> tuple[str, ...]:
    """Different names."""
    checks.instance(name, given, (list, tuple), "a list of names")
    found = tuple(checks.text(f"a name in {name}", each) for each in given)
    if len(set(found)) < len(found):
        raise InputError(f"{name} must be different names; got {checks.shown(given)}.")
    return found
