"""A law from measured curves of force against indentation."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np
from numpy.typing import ArrayLike

from antiosc import checks
from antiosc._types import Array
from antiosc.contact.base import State
from antiosc.contact.plastic import Hysteretic
from antiosc.errors import InputError


class Tabulated(Hysteretic):
    """Measured loading and unloading curves, interpolated monotonically (PCHIP).

    Parameters
    ----------
    indentation, force : array_like, shape (n,)
        Loading curve [m], [N]: both strictly increasing from (0, 0).
    unloading : (array_like, array_like), optional
        Indentation [m] and force [N] of the unloading curve, both strictly increasing from
        (delta_p, 0) to the loading curve's last point. Without it the law is elastic.

    Notes
    -----
    Unloading from another depth delta_m has the same shape, scaled by delta_m along the
    indentation and by F(delta_m) along the force; reloading goes back along it. Beyond the last
    point the loading curve goes on along its end tangent and `valid_force` is exceeded.
    """

    @checks.within_range
    def __init__(
        self,
        indentation: ArrayLike,
        force: ArrayLike,
        unloading: tuple[ArrayLike, ArrayLike] | None = None,
    ) -> None:
        x, F = _branch("loading", indentation, force)
        if x[0] != 0 or F[0] != 0:
            raise InputError(
                f"the loading curve must start at (0, 0); it starts at ({x[0]:g} m, {F[0]:g} N)."
            )
        self._loading = _Curve(x, F)
        self._unload, self._remains = self._loading, 0.0
        self.elastic = unloading is None
        self.valid_force = float(F[-1])
        if unloading is not None:
            if not isinstance(unloading, list | tuple) or len(unloading) != 2:
                raise InputError(
                    "unloading must be a pair (indentation, force) of the unloading curve; got"
                    f" {checks.shown(unloading)}."
                )
            xu, Fu = _branch("unloading", *unloading)
            meets = np.allclose((xu[-1], Fu[-1]), (x[-1], F[-1]), rtol=1e-9, atol=0)
            if Fu[0] != 0 or xu[0] < 0 or not meets:
                raise InputError(
                    f"the unloading curve must run from zero force at an indentation >= 0 to the"
                    f" end of the loading curve ({x[-1]:g} m, {F[-1]:g} N); it runs from"
                    f" ({xu[0]:g} m, {Fu[0]:g} N) to ({xu[-1]:g} m, {Fu[-1]:g} N)."
                )
            self._remains = float(xu[0] / xu[-1])
            self._unload = _Curve((xu - xu[0]) / (xu[-1] - xu[0]), Fu / Fu[-1])
            self._check_loss(x)

    def out_of_range(self, peak: float, radius: float | None) -> str:
        return (
            f"the peak force {peak:.4g} N exceeds the table's last point,"
            f" {self.valid_force:.4g} N; measure or extrapolate the curve further"
        )

    def advance(self, delta: float, rate: float, state: State) -> State:
        return state if self.elastic else super().advance(delta, rate, state)

    def energy(self, delta: float, state: State) -> float:
        return self.loading_work(delta) if self.elastic else super().energy(delta, state)

    def loading(self, delta: float) -> float:
        return self._loading.at(delta)[0]

    def loading_slope(self, delta: float) -> float:
        return self._loading.at(delta)[1]

    def loading_work(self, delta: float) -> float:
        return self._loading.at(delta)[2]

    def permanent(self, deepest: float) -> float:
        return self._remains * deepest

    def unload_shape(self, x: float) -> tuple[float, float, float]:
        return self._unload.at(x)

    def reload_shape(self, x: float) -> tuple[float, float, float]:
        return self._unload.at(x)

    def _check_loss(self, depths: Array) -> None:
        for d in depths[1:]:
            work = self.loading_work(float(d))
            back = self.energy(float(d), (float(d), float(d), 0.0))
            if back > work * (1 + 1e-9):
                raise InputError(
                    f"unloading from {d:g} m would give back {back:g} J of {work:g} J put in;"
                    f" the unloading curve must lie below the loading curve."
                )


class _Curve:
    """Monotone cubic through points, as plain floats: quick for one value at a time."""

    def __init__(self, x: Array, y: Array) -> None:
        from scipy.interpolate import PchipInterpolator  # loaded where it is used

        cubic = PchipInterpolator(x, y)
        self.x = x.tolist()
        self.c = cubic.c.T.tolist()
        self.area = cubic.antiderivative()(x).tolist()
        self.end = (float(y[-1]), float(cubic(x[-1], 1)))

    def at(self, x: float) -> tuple[float, float, float]:
        """Value, slope and integral from the first point, where the curve is 0."""
        if x <= self.x[0]:
            return (0.0, 0.0, 0.0)
        if x >= self.x[-1]:
            d, (value, slope) = x - self.x[-1], self.end
            return (value + slope * d, slope, self.area[-1] + d * (value + 0.5 * slope * d))
        i = bisect_right(self.x, x) - 1
        d, (a, b, c, e) = x - self.x[i], self.c[i]
        return (
            ((a * d + b) * d + c) * d + e,
            (3 * a * d + 2 * b) * d + c,
            self.area[i] + (((a * d / 4 + b / 3) * d + c / 2) * d + e) * d,
        )


def _branch(name: str, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Both arrays, checked to rise strictly together."""
    xs = checks.array(f"{name} indentation", x, (None,))
    ys = checks.array(f"{name} force", y, xs.shape)
    if xs.size < 2:
        raise InputError(f"the {name} curve needs at least 2 points; got {xs.size}.")
    for what, values, unit in (("indentation", xs, "m"), ("force", ys, "N")):
        falls = np.flatnonzero(np.diff(values) < checks.SMALLEST)
        if falls.size:
            i = int(falls[0])
            raise InputError(
                f"the {what} of the {name} curve must increase strictly; entries {i} and {i + 1}"
                f" are {values[i]:g} and {values[i + 1]:g} {unit}. Sort, smooth or thin the data."
            )
    return xs, ys
