"""Laws with a permanent indentation: loading, unloading and reloading follow different curves.

All have one form. Virgin loading follows F_l(delta). Unloading from a turning point (delta_t, F_t)
falls to the permanent indentation delta_p of the deepest indentation delta_m so far,

    F = F_t U((delta - delta_p)/(delta_t - delta_p)),

and reloading, up to (delta_m, F_m), climbs F = F_m V((delta - delta_p)/(delta_m - delta_p)). Where
U = V reloading goes back along the unloading curve. Once the bodies have parted, the next contact
reloads from delta_p.

`Tabulated` has such curves from measurements.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi, sqrt
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks, march
from antiosc.base._types import Array
from antiosc.base.checks import checked_by
from antiosc.base.errors import InputError
from antiosc.base.texts import engineering
from antiosc.contact.base import Compiled


class Hysteretic(Compiled):
    """Base of the laws of this module.

    The state is (delta_m, delta_t, lost): deepest indentation [m], turning point [m] from which
    unloading starts, and the energy lost so far [J].
    """

    has_memory: ClassVar[bool] = True
    size: ClassVar[int] = 3

    def permanent(self, deepest: float) -> float:
        """Permanent indentation delta_p [m] after a deepest one, 0 <= delta_p < deepest."""
        return self.origin((deepest, 0.0, 0.0))


@dataclass(frozen=True)
class Thornton(Hysteretic):
    """Elastic, perfectly plastic sphere. C. Thornton, J. Appl. Mech. 64 (1997) 383-386.

    Hertz's law up to the yield indentation; beyond, the pressure is cut off and the force goes on
    along the tangent; unloading is Hertzian with the flattened radius R F_e/F_m, F_e being Hertz's
    force at the deepest indentation, so that delta_p = delta_m (1 - F_m/F_e).

    Parameters
    ----------
    stiffness : float
        Hertz's k_H [N m^-3/2].
    yield_indentation : float
        delta_y [m] at first yield.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    yield_indentation: float = field(metadata=checked_by(checks.positive, "m"))

    kind: ClassVar[int] = march.THORNTON

    @classmethod
    @checks.within_range
    def from_material(cls, E_star: float, radius: float, yield_pressure: float) -> Thornton:
        """From E* [Pa], relative radius [m] and contact pressure at yield p_y [Pa] (1.6 Y).

        delta_y = R (pi p_y/(2 E*))^2.
        """
        E = checks.positive("E_star", E_star, "Pa")
        R = checks.positive("radius", radius, "m")
        p = checks.positive("yield_pressure", yield_pressure, "Pa")
        return cls(4 / 3 * E * sqrt(R), R * (pi * p / (2 * E)) ** 2)


@dataclass(frozen=True)
class Stronge(Hysteretic):
    """Elastic-plastic sphere. W. J. Stronge, Impact Mechanics, Cambridge 2000, ch. 6.

    Hertz up to yield at delta_y; then F/F_y = (2 x - 1)(1 + ln(2 x - 1)/3.3) with
    x = delta/delta_y, and the mean pressure stays 2.55 times that at yield from x = 84 on.
    Unloading is Hertzian from delta_m to delta_p = delta_m - delta_y sqrt(2 x_m - 1). Taken as
    printed, that would give back more than was put in for x_m < 1.9; there delta_p is the one
    without loss.

    Parameters
    ----------
    stiffness : float
        Hertz's k_H [N m^-3/2].
    yield_indentation : float
        delta_y [m] at first yield.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    yield_indentation: float = field(metadata=checked_by(checks.positive, "m"))

    kind: ClassVar[int] = march.STRONGE


@dataclass(frozen=True)
class _Laminate(Hysteretic):
    """F = k delta^1.5 on loading and reloading, unloading with the power 2.5."""

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    critical: float = field(metadata=checked_by(checks.positive, "m"))


@dataclass(frozen=True)
class YangSun(_Laminate):
    """Indentation of laminates. S. H. Yang, C. T. Sun, ASTM STP 787 (1982) 425-449.

    delta_p = delta_m [1 - (critical/delta_m)^(2/5)] beyond the critical indentation [m], else 0.
    `stiffness` in N m^-3/2.
    """

    kind: ClassVar[int] = march.YANG_SUN


def _checked_slope(name: str, value: object) -> float:
    slope = checks.number(name, value)
    if not 0 < slope < 1:
        raise InputError(f"slope must lie in 0 < slope < 1; got {slope:g}.")
    return slope


@dataclass(frozen=True)
class TanSun(_Laminate):
    """Indentation of laminates. T. M. Tan, C. T. Sun, J. Appl. Mech. 52 (1985) 6-12.

    delta_p = slope * (delta_m - critical) beyond the critical indentation [m], else 0, with
    0 < slope < 1. `stiffness` in N m^-3/2.
    """

    slope: float = field(default=0.5, metadata=checked_by(_checked_slope))

    kind: ClassVar[int] = march.TAN_SUN


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

    kind: ClassVar[int] = march.TABLE

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
        self.elastic = unloading is None
        self.valid_force = float(F[-1])
        self._points = len(x)
        self._reach = f"{engineering(x[-1], 'm')} and {engineering(F[-1], 'N')}"
        remains, xu, Fu = 0.0, x, F
        if unloading is not None:
            xu, Fu = _unloading(unloading, x, F)
            remains = float(xu[0] / xu[-1])
            xu, Fu = (xu - xu[0]) / (xu[-1] - xu[0]), Fu / Fu[-1]
        first, second = _knots(x, F), _knots(xu, Fu)
        head = [float(self.elastic), remains, float(x.size), float(xu.size), 5.0 + len(first)]
        self._parameters = [*head, *first, *second]
        if unloading is not None:
            self._check_loss(x)

    def _told(self) -> list[tuple[str, str]]:
        told = [("points", str(self._points)), ("up to", self._reach)]
        return told if self.elastic else [*told, ("unloading", "given")]

    def __repr__(self) -> str:
        return f"Tabulated({', '.join(' '.join(fact) for fact in self._told())})"

    def out_of_range(self, peak: float, radius: float | None) -> str:
        return (
            f"the peak force {peak:.4g} N exceeds the table's last point,"
            f" {self.valid_force:.4g} N; measure or extrapolate the curve further"
        )

    def parameters(self) -> list[float]:
        return self._parameters

    def _check_loss(self, depths: Array) -> None:
        for d in depths[1:]:
            work = self.loading_work(float(d))
            back = self.energy(float(d), (float(d), float(d), 0.0))
            if back > work * (1 + 1e-9):
                raise InputError(
                    f"unloading from {d:g} m would give back {back:g} J of {work:g} J put in;"
                    f" the unloading curve must lie below the loading curve."
                )


def _knots(x: Array, y: Array) -> list[float]:
    """Knots, four rows of coefficients (a spare 0 each), value and slope at the end."""
    from scipy.interpolate import PchipInterpolator  # loaded where it is used

    cubic = PchipInterpolator(x, y)
    rows = [x, *np.pad(cubic.c, ((0, 0), (0, 1))), [y[-1], cubic(x[-1], 1)]]
    return np.concatenate(rows).tolist()  # type: ignore[no-any-return]


def _unloading(unloading: tuple[ArrayLike, ArrayLike], x: Array, F: Array) -> tuple[Array, Array]:
    """The unloading curve, which must end where the loading curve (x, F) does."""
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
    return xu, Fu


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
