"""`FRF`: measured frequency responses between named sites, and the passive body fitted to them.

Between the sites m and n, at the circular frequency w,

    H_mn = sum_j b_jm b_jn D_j(w) - sum_k a_mk a_nk/w^2 + sum_k l_mk l_nk,
    D_j = 1/(w_j^2 - w^2 + 2i zeta_j w_j w)  viscous,  1/(w_j^2 (1 + 2i zeta_j) - w^2)  hysteretic:

with modes of rank one, rigid-body motions a, and a residual compliance l l'. Every term is
semidefinite, so that the body is passive for all parameters. The last modes are above the measured
band and have prior expectations (`TailModes`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from sys import float_info
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, ComplexArray, Index
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin

#: Columns of a measurement: (response, excitation) as numbers of sites.
SitePairs = list[tuple[int, int]]
# In parentheses: largest relative change of |Z| in the band for half and twice the value, models
# from 500 values of a supported and of a free part with four modes and 2 % noise.
#: The lowest mode above the band lies above the band's top by at least this share (8e-4, 1e-4).
TAIL_GAP = 0.02
#: Damping ratio of the tail if no mode is seen (none here).
TAIL_DAMPING = 0.01
#: Least squared displacement of a mode of the tail over the expected one.
MIN_TAIL_SQUARE = 1e-3
#: Highest frequency of the modes above the band over the band's top (5e-4, 4e-3).
TAIL_TOP_RATIO = 5.0
#: Least spacing of these modes over their frequency (3e-4, 1e-3).
MIN_TAIL_SPACING = 0.15
#: Number of modes in the band whose mean spacing and mean square they continue (5e-4, 1e-6).
CONTINUED_MODE_COUNT = 6
#: Standard deviation of the frequency of such a mode over the spacing (8e-4, 3e-4).
TAIL_FREQUENCY_SIGMA = 0.5
#: Standard deviation of its squared displacement over the mean (1e-4, 5e-5).
TAIL_SQUARE_SIGMA = 1.0
#: Variance of the relative mean square times the number of averaged modes.
MEAN_SQUARE_VARIANCE = 2.0
#: Standard deviation of the logarithm of a common factor on all spacings (2e-4, 2e-3).
SPACING_LOG_SIGMA = 0.3


@dataclass(frozen=True, eq=False)
class TailModes:
    """Expected modes above the band, with their uncertainty."""

    omega: Array  # (U,) [rad/s]
    frequency_sigma: Array  # (U,) relative standard deviations of the frequencies
    squares: Array  # (U, p) squared displacements [1/kg]
    square_sigma: Array  # (U,) relative standard deviations of the squares


@dataclass(frozen=True, eq=False)
class FittedModes:
    """The parameters of the fit."""

    #: omega, zeta: (J,) frequencies [rad/s] and damping ratios; the last U modes are the tail
    omega: Array
    zeta: Array
    b: Array  # (J, p) displacements of the sites in modes of unit mass [kg^-1/2]
    tail: TailModes  # prior expectations of the last U modes; their damping ratios are fixed
    #: root, rigid: (p, p) l and a, lower triangles [(m/N)^1/2], [kg^-1/2]; rigid None: supported
    residual_root: Array
    rigid: Array | None = None
    hysteretic: bool = False  # the form of the damping

    @property
    def n_band(self) -> int:
        """Number of modes in the band."""
        return len(self.omega) - len(self.tail.omega)

    def receptance(self, w: Array, pairs: SitePairs) -> ComplexArray:
        """H (W, M) of the pairs at circular frequencies (W,) [rad/s]."""
        D = dynamic_factors(w, self.omega, self.zeta, self.hysteretic)
        m, n = np.array(pairs).T
        residual = self.residual_root @ self.residual_root.T
        H = D @ (self.b[:, m] * self.b[:, n]) + residual[m, n]
        if self.rigid is not None:
            H = H - (self.rigid @ self.rigid.T)[m, n] / w[:, None] ** 2
        return H

    def jacobian(self, w: Array, pairs: SitePairs) -> ComplexArray:
        """Derivatives (W, M, n) of H by the fitted `values`."""
        D = dynamic_factors(w, self.omega, self.zeta, self.hysteretic)
        m, n = np.array(pairs).T
        column = w[:, None]
        p = self.b.shape[1]
        weight = (self.b[:, m] * self.b[:, n]).T  # (M, J)
        loss = self.zeta * self.omega * (self.omega if self.hysteretic else column)
        square = D * D
        by_zeta = -2j * loss * square
        by_omega = -2 * self.omega**2 * square + by_zeta * (2 if self.hysteretic else 1)
        band = slice(self.n_band)
        blocks = [by_omega[:, None, :] * weight, by_zeta[:, None, band] * weight[:, band]]

        # d(b_m b_n)/db_s = [m = s] b_n + [n = s] b_m, of every mode and site
        products = np.zeros((len(pairs), len(self.omega), p))
        columns = np.arange(len(pairs))
        products[columns, :, m] += self.b[:, n].T
        products[columns, :, n] += self.b[:, m].T
        blocks.append((D[:, None, :, None] * products).reshape(len(w), len(pairs), -1))
        for L, factor in ((self.rigid, -1 / column**2), (self.residual_root, np.ones_like(column))):
            if L is not None:
                blocks.append(factor[:, :, None] * _root_slopes(L, m, n))

        return np.concatenate(blocks, axis=2)

    def tail_deviations(self) -> Array:
        """Deviations (E,) of the tail from its expected values, in standard deviations."""
        omega = self.omega[self.n_band :]
        b = self.b[self.n_band :]
        tail = self.tail
        deviation = (b**2 - tail.squares) / (tail.square_sigma[:, None] * tail.squares)
        return np.append(np.log(omega / tail.omega) / tail.frequency_sigma, deviation)

    def tail_jacobian(self) -> Array:
        """Derivatives (E, n) of `tail_deviations` by `values`."""
        in_band = self.n_band
        tail = self.tail
        p = self.b.shape[1]
        U = len(tail.omega)
        J = np.zeros((U + U * p, sum(self.value_sizes)))
        J[np.arange(U), in_band + np.arange(U)] = 1 / tail.frequency_sigma
        first = len(self.omega) + in_band + in_band * p
        slope = 2 * self.b[in_band:] / (tail.square_sigma[:, None] * tail.squares)
        J[U + np.arange(U * p), first + np.arange(U * p)] = slope.ravel()
        return J

    @property
    def value_sizes(self) -> list[int]:
        """Numbers of omega, zeta, b, rigid and root among `values`, in this order."""
        triangle = len(self.residual_root) * (len(self.residual_root) + 1) // 2
        rigid = 0 if self.rigid is None else triangle
        return [len(self.omega), self.n_band, self.b.size, rigid, triangle]

    @property
    def values(self) -> Array:
        """All parameters: ln omega, ln zeta of modes in the band, b, a and l."""
        lower = _lower_indices(len(self.residual_root))
        parts = [np.log(self.omega), np.log(self.zeta[: self.n_band]), self.b.ravel()]
        return np.concatenate(
            parts + [L[lower] for L in (self.rigid, self.residual_root) if L is not None]
        )

    def with_values(self, values: Array) -> FittedModes:
        """The body with other `values`."""
        omega, zeta, b, rigid, root = np.split(values, np.cumsum(self.value_sizes)[:-1])
        p = len(self.residual_root)
        return replace(
            self,
            omega=np.exp(omega),
            zeta=np.append(np.exp(zeta), self.zeta[self.n_band :]),
            b=b.reshape(self.b.shape),
            residual_root=_lower_triangle(root, p),
            rigid=None if self.rigid is None else _lower_triangle(rigid, p),
        )

    def with_band_modes(self, omega: Array, zeta: Array, b: Array) -> FittedModes:
        """The body with other modes in the band, in any order: omega (n,), zeta (n,), b (n, p)."""
        order = np.argsort(omega)
        in_band = self.n_band
        return replace(
            self,
            omega=np.append(omega[order], self.omega[in_band:]),
            zeta=np.append(zeta[order], self.zeta[in_band:]),
            b=np.vstack((b[order], self.b[in_band:])),
        )


def dynamic_factors(w: Array, omega: Array, zeta: Array, hysteretic: bool) -> ComplexArray:
    """Dynamic factors D (W, J) of modes at circular frequencies (W,)."""
    frequencies = w[:, None]

    # in real numbers and in place: a complex quotient takes twice as long
    stiff = omega**2 - frequencies**2
    loss = 2 * zeta * omega * (omega if hysteretic else frequencies)
    size = stiff**2 + loss**2
    np.reciprocal(size, out=size)
    D = np.empty(size.shape, dtype=complex)
    np.multiply(stiff, size, out=D.real)
    np.multiply(-loss, size, out=D.imag)

    return D


def _root_slopes(L: Array, m: Index, n: Index) -> Array:
    """Derivatives (M, p(p+1)/2) of (L L')_mn by the lower triangle of L."""
    rows, columns = _lower_indices(len(L))
    by_m = (m[:, None] == rows) * L[n][:, columns]
    by_n = (n[:, None] == rows) * L[m][:, columns]
    return by_m + by_n


def _lower_triangle(values: Array, size: int) -> Array:
    """A lower triangle from its values."""
    L = np.zeros((size, size))
    L[_lower_indices(size)] = values
    return L


@cache
def _lower_indices(size: int) -> tuple[Index, Index]:
    """Row and column indices of a lower triangle."""
    return np.tril_indices(size)


# -- prior expectation of the modes above the band: they continue the last modes in it


def expected_tail(modes: FittedModes, top: float) -> TailModes:
    """Expected modes above `top` [rad/s], whose spacings grow from those of the last modes."""
    in_band = modes.n_band
    last = np.append(0.0, modes.omega[:in_band])[-CONTINUED_MODE_COUNT - 1 :]
    count = len(last) - 1
    spacing = max((last[-1] - last[0]) / count, 0.01 * top) if count else top
    rigid = modes.residual_root if modes.rigid is None else modes.rigid
    smallest_squares = np.sum(rigid**2, axis=1) * (top**2 if modes.rigid is None else 0.5)
    mean = np.sum(modes.b[in_band - count : in_band] ** 2, axis=0) / max(count, 1)
    b2 = np.maximum(mean, smallest_squares) + float_info.min
    frequencies = [max(last[-1] + spacing, (1 + 2 * TAIL_GAP) * top)]
    steps = []
    while frequencies[-1] < TAIL_TOP_RATIO * top or len(frequencies) < 3:
        steps.append(max(spacing, MIN_TAIL_SPACING * frequencies[-1]))
        frequencies.append(frequencies[-1] + steps[-1])

    omega = np.array(frequencies)
    step = np.array([*steps, steps[-1]])
    merged = np.maximum(step / spacing, 1.0)
    doubt = np.sqrt(TAIL_SQUARE_SIGMA**2 / merged + MEAN_SQUARE_VARIANCE / max(in_band, 0.5))
    return TailModes(omega, TAIL_FREQUENCY_SIGMA * step / omega, merged[:, None] * b2, doubt)


def with_tail(modes: FittedModes, tail: TailModes) -> FittedModes:
    """The modes in the band and, with random signs of their displacements, those of the tail."""
    in_band = modes.n_band
    U = len(tail.omega)
    typical = np.median(modes.zeta[:in_band]) if in_band else TAIL_DAMPING
    signs = np.random.default_rng(0).choice((-1.0, 1.0), tail.squares.shape)
    signs[:, 0] = 1.0

    return replace(
        modes,
        omega=np.append(modes.omega[:in_band], tail.omega),
        zeta=np.append(modes.zeta[:in_band], np.full(U, typical)),
        b=np.vstack((modes.b[:in_band], signs * np.sqrt(tail.squares))),
        tail=tail,
    )


def random_tail(tail: TailModes, top: float, random: np.random.Generator) -> TailModes:
    """Another tail above `top` [rad/s], drawn at random, with a factor common to all spacings."""
    U = len(tail.omega)
    stretch = np.exp(SPACING_LOG_SIGMA * random.standard_normal())
    omega = top + stretch * (tail.omega - top)
    omega = omega * np.exp(tail.frequency_sigma * random.standard_normal(U))
    changes = tail.square_sigma[:, None] * random.standard_normal(tail.squares.shape)
    squares = stretch * tail.squares * np.abs(1 + changes)
    omega = np.maximum(np.sort(omega), (1 + TAIL_GAP) * top)
    return replace(tail, omega=omega, squares=np.maximum(squares, MIN_TAIL_SQUARE * tail.squares))


Quantity = Literal["receptance", "mobility", "accelerance"]
#: Power of iw between the receptance and what was measured.
DERIVATIVE_ORDERS: dict[str, int] = {name: power for power, name in enumerate(get_args(Quantity))}
#: Least number of frequencies of a measurement.
MIN_FREQUENCY_LINES = 16
#: Largest number of values of a measurement: 0.3 GB of complex numbers.
MAX_MEASURED_VALUES = 20_000_000
#: Excess of a coherence above 1 that counts as rounding.
COHERENCE_ROUNDING = 1e-6
#: Least coherence that is used.
MIN_COHERENCE = 1e-4
#: Default number of averaged blows.
DEFAULT_AVERAGES = 5
#: Least |1 + w^2 m H| at which a sensor's mass can be removed.
MIN_SENSOR_FACTOR = 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class FRF(ReprMixin):
    """Frequency response functions: motion of sites per force on sites.

    Parameters
    ----------
    frequency : array_like, shape (K,)
        Frequencies [Hz], ascending; a line at 0 Hz is left out.
    values : array_like, complex, shape (K,), or (K, p, q)
        One driving point, or motions of p sites per force on q of them: m/N, m/(s N) or m/(s^2 N).
        With time as exp(iwt), motion and force of a site along one direction.
    quantity : "receptance", "mobility" or "accelerance"
        Displacement, velocity or acceleration per force.
    coherence : array_like, optional
        Coherence of each value, 0 to 1, from which the noise of an average (H1) of `averages`
        impacts follows.
    averages : int
        Number of averages of the coherence.
    sigma : array_like, optional
        Standard deviation of each complex value, instead of the coherence.
    sites : sequence of str
        Names of several sites, p.
    references : sequence of str, optional
        Names of the q sites on which the forces act; default: all.

    Raises
    ------
    InputError
        Numbers that are not finite, frequencies that do not ascend, arrays that do not fit.
    """

    frequency: Array
    values: ComplexArray
    quantity: Quantity
    coherence: Array | None = None
    averages: int = DEFAULT_AVERAGES
    sigma: Array | None = None
    sites: tuple[str, ...] = ()
    references: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        checks.choice("quantity", self.quantity, get_args(Quantity))
        f = checks.floats("frequency", self.frequency, (None,))
        values = checks.spectrum("values", self.values).astype(complex)
        names = _checked_names("sites", self.sites)
        forced = names if self.references is None else _checked_names("references", self.references)
        if self.references is not None and (unknown := sorted(set(forced) - set(names))):
            raise InputError(f"references name {checks.shown(unknown)}, not among the sites.")
        if values.size > MAX_MEASURED_VALUES:
            raise InputError(
                f"values has {values.size} entries; at most {MAX_MEASURED_VALUES} are taken."
            )

        shape = (len(f), len(names), len(forced)) if names else (len(f),)
        if values.shape != shape:
            raise InputError(
                f"values must have shape {shape}: frequencies, sites, references; got"
                f" {values.shape}."
            )
        if np.any(f < 0) or np.any(np.diff(f) <= 0):
            raise InputError("frequency must ascend, from 0 Hz or above.")

        nonzero = f > 0
        if np.count_nonzero(nonzero) < MIN_FREQUENCY_LINES:
            raise InputError(
                f"a measurement needs {MIN_FREQUENCY_LINES} frequencies above 0 Hz or more; got"
                f" {np.count_nonzero(nonzero)}."
            )

        arrays: dict[str, Array] = {}
        for name in ("coherence", "sigma"):
            if (given := getattr(self, name)) is not None:
                arrays[name] = checks.read_only(checks.floats(name, given, shape)[nonzero])

        if np.any(arrays.get("sigma", 1.0) <= 0):
            raise InputError("sigma must be > 0: it is the standard deviation of each value.")

        gamma = arrays.get("coherence", np.zeros(1))
        if np.any((gamma < 0) | (gamma > 1 + COHERENCE_ROUNDING)):
            raise InputError(
                f"coherence lies between 0 and 1; it ranges from {gamma.min():g} to"
                f" {gamma.max():g}."
            )

        if np.any(values[nonzero] == 0):
            raise InputError("values must not be 0 above 0 Hz: the measurement has dropouts.")

        checks.store(
            self,
            frequency=checks.read_only(f[nonzero]),
            values=checks.read_only(values[nonzero]),
            averages=checks.whole("averages", self.averages),
            sites=names,
            references=forced,
            **arrays,
        )

    def _facts(self) -> list[tuple[str, str]]:
        f = self.frequency
        noise = "coherence" if self.coherence is not None else ""
        if self.sigma is not None:
            noise = "sigma"
        lines = f"{f.size} lines, {f[0]:.5g} to {f[-1]:.5g} Hz"
        facts = [(self.quantity, lines), ("sites", ", ".join(self.sites)), ("noise", noise)]
        return [(name, text) for name, text in facts if text]

    @property
    def receptance(self) -> ComplexArray:
        """Displacement per force [m/N], with the shape of `values`."""
        return self.values / self._derivative_factor

    @property
    def receptance_sigma(self) -> Array | None:
        """Standard deviation [m/N] of the complex receptances; None if unknown."""
        scale = np.abs(self._derivative_factor)
        if self.sigma is not None:
            return self.sigma / scale
        if self.coherence is None:
            return None

        # of a complex H1 estimate: (1 - gamma^2)/(gamma^2 n) of |H|^2 (Bendat and Piersol)
        gamma = np.clip(self.coherence, MIN_COHERENCE, 1 - 1e-8)
        sigma = np.abs(self.values) / scale * np.sqrt((1 - gamma) / gamma / self.averages)
        return sigma

    @property
    def pairs(self) -> SitePairs:
        """(response, excitation) of the columns as numbers of sites."""
        if not self.sites:
            return [(0, 0)]
        assert self.references is not None
        reference_sites = [self.sites.index(name) for name in self.references]
        return [(m, n) for m in range(len(self.sites)) for n in reference_sites]

    @property
    def _derivative_factor(self) -> ComplexArray:
        """(iw)^power, with as many dimensions as `values`."""
        power = (2j * np.pi * self.frequency) ** DERIVATIVE_ORDERS[self.quantity]
        return power.reshape(-1, *[1] * (self.values.ndim - 1))

    def within(self, band: ArrayLike | None) -> FRF:
        """The lines within a band (low, high) [Hz]; InputError if it holds too few."""
        if band is None:
            return self

        low, high = checks.floats("band", band, (2,))
        if not 0 <= low < high:
            raise InputError(
                f"band must be (low, high) in Hz, 0 <= low < high; got {low:g}, {high:g}."
            )

        f = self.frequency
        in_band = (f >= low) & (f <= high)
        if np.count_nonzero(in_band) < MIN_FREQUENCY_LINES:
            raise InputError(
                f"the band {low:g} to {high:g} Hz holds {np.count_nonzero(in_band)} of the lines"
                f" from {f[0]:g} to {f[-1]:g} Hz; {MIN_FREQUENCY_LINES} or more are needed."
            )

        return replace(
            self,
            frequency=f[in_band],
            values=self.values[in_band],
            coherence=None if self.coherence is None else self.coherence[in_band],
            sigma=None if self.sigma is None else self.sigma[in_band],
        )

    def without_sensor(self, mass: float | Mapping[str, float]) -> FRF:
        """The responses without the mass m of the sensor: Z + w^2 m instead of Z.

        Parameters
        ----------
        mass : float, or {name of a site: float}
            Mass [kg]. With several sites the sensors must stay there during all measurements, and
            forces must act on all sites. The noise is converted like the responses.

        Raises
        ------
        InputError
            A mass below 0, forces on only some sites, or a sensor mass so large that nothing else
            remains at a frequency.
        """
        if isinstance(mass, Mapping):
            if unknown := sorted(set(map(str, mass)) - set(self.sites)):
                raise InputError(f"sensor_mass names {checks.shown(unknown)}, no site.")
            masses = [mass.get(site, 0.0) for site in self.sites]
            m = np.array([checks.nonnegative("sensor_mass", one, "kg") for one in masses])
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
        loading = np.eye(p) + x * m[:, None] * H
        if np.linalg.svd(loading, compute_uv=False).min() < MIN_SENSOR_FACTOR:
            raise InputError(
                f"a sensor of {m.max():g} kg moves almost alone at some frequency, so that its mass"
                " cannot be removed: check sensor_mass (in kg) and the units of the measurement."
            )

        inverse = np.linalg.inv(loading)
        sigma = self.receptance_sigma
        if sigma is not None:
            gain = np.abs(np.linalg.inv(np.eye(p) + x * H * m)) ** 2
            sigma = np.sqrt(gain @ sigma.reshape(-1, p, p) ** 2 @ np.abs(inverse) ** 2)
            sigma = sigma.reshape(self.values.shape) * np.abs(self._derivative_factor)

        values = (H @ inverse).reshape(self.values.shape) * self._derivative_factor
        return replace(self, values=values, sigma=sigma, coherence=None)


def checked_quantity(quantity: Quantity | None) -> Quantity:
    """The measured quantity; InputError if neither the file nor the caller states it."""
    if quantity is None:
        raise InputError(
            'the file does not tell what was measured: give quantity="accelerance", "mobility" or'
            ' "receptance".'
        )
    return quantity


def _checked_names(name: str, names_given: Sequence[str]) -> tuple[str, ...]:
    """Checked names, all different."""
    checks.instance(name, names_given, (list, tuple), "a list of names")
    names = tuple(checks.name(f"a name in {name}", one_name) for one_name in names_given)
    if len(set(names)) < len(names):
        raise InputError(f"{name} must be different names; got {checks.shown(names_given)}.")
    return names
