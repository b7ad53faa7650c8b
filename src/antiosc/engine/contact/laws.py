"""Contact laws: powers of the indentation with or without damping, and laws that yield.

Powers F = k delta^n may be damped: F = k delta^n (1 + d delta'/v0) >= 0. v0 is the speed of
approach of the present contact (at least 1 % of the largest so far), and d follows from a
coefficient of restitution e. For two free rigid bodies the motion has the first integral
d (1 + e') = ln[(1 + d)/(1 - d e')] between d and the ratio e' of separation and closing speed, for
any k, n and masses; among the laws here only Gonthier's gives e' = e.

All laws with a permanent indentation have the same form. Virgin loading follows F_l(delta).
Unloading from a turning point (delta_t, F_t) decreases to the permanent indentation delta_p, which
depends on the largest indentation delta_m,

    F = F_t U((delta - delta_p)/(delta_t - delta_p)),

and reloading follows F = F_m V((delta - delta_p)/(delta_m - delta_p)) up to (delta_m, F_m). After
the bodies have separated, the next contact reloads from delta_p.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import atan, inf, log, log1p, pi, sqrt
from typing import ClassVar, Self

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike
from antiosc.base.checks import checked_by
from antiosc.base.errors import InputError
from antiosc.base.texts import engineering
from antiosc.engine import library
from antiosc.engine.contact.base import LARGEST_PATCH_SHARE, Compiled
from antiosc.engine.contact.geometry import (
    Radii,
    effective_modulus,
    hertz_stiffness,
    relative_curvatures,
)


def _range_check(text: str, fits: Callable[[float], bool]) -> Callable[[str, object], float]:
    """A check (name, value) -> number; InputError with the rule `text` unless `fits(number)`."""

    def check(name: str, value: object) -> float:
        result = checks.number(name, value)
        if not fits(result):
            raise InputError(f"{name} must lie in {text}; got {result:g}.")
        return result

    return check


#: exponent n of a force that grows as delta^n
_checked_exponent = _range_check("1 <= n <= 10 (1 linear, 1.5 Hertz)", lambda n: 1 <= n <= 10)
_checked_poisson = _range_check("0 <= nu < 0.5", lambda nu: 0 <= nu < 0.5)
_checked_restitution = _range_check("0 < e <= 1", lambda e: 0 < e <= 1)
_checked_share = _range_check("0 <= share <= 1", lambda share: 0 <= share <= 1)


@dataclass(frozen=True, init=False, eq=False, repr=False)
class PatchedLaw(Compiled):
    """Base of laws with a `compliance` c [m/N] >= 0: F = f(delta + c F).

    c is subtracted for a structure whose compliance contains the half-space compliance of a contact
    patch. At `valid_force` c is 0.7 of the flexibility of the law in loading or unloading. Beyond
    this force c is limited to that share, energies are inexact, `simulate` raises AccuracyError.
    """

    compliance: float = field(
        default=0.0, kw_only=True, metadata=checked_by(checks.nonnegative, "m/N")
    )

    def without(self, compliance: float) -> Self:
        return replace(self, compliance=compliance)

    def _changed_fields(self) -> list[tuple[str, str]]:
        return sorted(super()._changed_fields(), key=lambda fact: fact[0] == "compliance")


@dataclass(frozen=True, repr=False)
class Power(Compiled):
    """Contact law F = stiffness * delta^exponent.

    Parameters
    ----------
    stiffness : float
        Stiffness [N/m^exponent], > 0.
    exponent : float
        Exponent, >= 1.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N/m^exponent"))
    exponent: float = field(metadata=checked_by(_checked_exponent))

    kind: ClassVar[int] = library.POWER


@dataclass(frozen=True, repr=False)
class Linear(Compiled):
    """Contact law F = stiffness * delta >= 0: a spring that only pushes. `stiffness` in N/m."""

    stiffness: float = field(metadata=checked_by(checks.positive, "N/m"))

    kind: ClassVar[int] = library.LINEAR


@dataclass(frozen=True, repr=False)
class Punch(PatchedLaw, Linear):
    """Law of a rigid flat punch on a half-space; only a patch compliance <= 0.7/k is subtracted."""

    def without(self, compliance: float) -> Self:
        return (
            self
            if compliance * self.stiffness > LARGEST_PATCH_SHARE
            else super().without(compliance)
        )


@dataclass(frozen=True, repr=False)
class Hertz(Compiled):
    """Hertz's law F = stiffness * delta^(3/2), optionally with an indentation smaller by c F.

    Parameters
    ----------
    stiffness : float
        k_H [N m^-3/2], > 0.
    compliance : float
        c [m/N], >= 0: the indentation is (F/k_H)^(2/3) - c F, for a structure whose compliance
        already contains the half-space compliance of a contact patch.

    Notes
    -----
    The law with c holds while the indentation grows with the force, F < F_lim = (2/(3c))^3/k_H^2.
    With rho = (F/F_lim)^(1/3), the remaining flexibility is 1 - rho times Hertz's, so that a
    relative error e of c becomes e rho/(1 - rho) in the tangent. `valid_force` has rho = 0.7: an
    error of 2 % in c is then less than 5 % in the tangent (the contact radius is 0.58 of the patch
    radius). Beyond, the law continues along its tangent, so that a run can complete; `simulate`
    then raises AccuracyError.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    compliance: float = field(default=0.0, metadata=checked_by(checks.nonnegative, "m/N"))

    kind: ClassVar[int] = library.HERTZ
    #: rho up to which a law with a compliance is valid
    END: ClassVar[float] = LARGEST_PATCH_SHARE

    @checks.within_range
    def __post_init__(self) -> None:
        super().__post_init__()
        # with s = F^(1/3): delta = a s^2 - c s^3 up to s = end, a straight line beyond
        k = self.stiffness
        c = self.compliance
        a = k ** (-2 / 3)
        end = self.END * 2 * a / (3 * c) if c > 0 else inf
        slope = (2 / 3) * a / end - c if c > 0 else 0.0
        checks.store(self, valid_force=end**3, _parameters=[k, c, a, end, slope])

    def parameters(self) -> list[float]:
        assert self._parameters is not None
        return self._parameters

    @classmethod
    @checks.within_range
    def from_radii(
        cls,
        radii1: Radii,
        E1: float,
        nu1: float,
        radii2: Radii = inf,
        E2: float | None = None,
        nu2: float | None = None,
        angle: float = 0.0,
    ) -> Hertz:
        """Hertz's law of two elastic bodies from their radii of curvature at the contact.

        Parameters
        ----------
        radii1, radii2 : float or (float, float)
            Principal radii [m] of each surface: one number for a sphere, `inf` for flat, negative
            for hollow, (r, inf) for a cylinder.
        E1, nu1, E2, nu2 : float
            Young's modulus [Pa] and Poisson's ratio; E2 None: body 2 is rigid; nu2 None: nu1.
        angle : float
            Angle between the planes of the first radii [degree]; 90 for crossed cylinders.
        """
        A, B = relative_curvatures(radii1, radii2, checks.number("angle", angle, "degree"))
        return cls(hertz_stiffness(effective_modulus(E1, nu1, E2, nu2), A, B))

    def without(self, compliance: float) -> Hertz:
        """This law minus `compliance` [m/N]."""
        return replace(self, compliance=compliance)


#: Exponent of Hertz's law.
HERTZ_EXPONENT = 1.5


@dataclass(frozen=True, repr=False)
class _Damped(PatchedLaw):
    """Base of damped laws: F = stiffness * delta^exponent * (1 + d * rate/v0), never negative.

    d: `factor`, from the restitution 0 < e <= 1; v0: speed of approach; stiffness [N/m^exponent];
    exponent >= 1.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N/m^exponent"))
    restitution: float = field(metadata=checked_by(_checked_restitution))
    exponent: float = field(default=HERTZ_EXPONENT, metadata=checked_by(_checked_exponent))
    factor: float = field(init=False, repr=False, compare=False)

    kind: ClassVar[int] = library.DAMPED
    size: ClassVar[int] = 2  # d/v0, fastest approach so far
    rate_dependent: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        factor = self._factor(self.restitution)
        checks.store(self, factor=factor, _parameters=[self.stiffness, self.exponent, factor])

    def without(self, compliance: float) -> Self:
        return super().without(compliance) if self.exponent == HERTZ_EXPONENT else self

    @staticmethod
    @abstractmethod
    def _factor(e: float) -> float:
        """The damping factor d for a coefficient of restitution e."""


class HuntCrossley(_Damped):
    """Damping d = 3 (1 - e)/2. K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445."""

    @staticmethod
    def _factor(e: float) -> float:
        return 1.5 * (1 - e)


class LankaraniNikravesh(_Damped):
    """Damping d = 3 (1 - e^2)/4. H. Lankarani, P. Nikravesh, J. Mech. Des. 112 (1990) 369-376.

    Derived for e near 1: for e = 0.9, 0.7, 0.5 rigid bodies rebound with 0.91, 0.80, 0.73;
    `Gonthier` has no such limit.
    """

    @staticmethod
    def _factor(e: float) -> float:
        return 0.75 * (1 - e * e)


class Flores(_Damped):
    """Damping d = 8 (1 - e)/(5 e). P. Flores et al., Multibody Syst. Dyn. 25 (2011) 357-375.

    For e = 0.9, 0.7, 0.5 rigid bodies rebound with 0.89, 0.68, 0.47.
    """

    @staticmethod
    def _factor(e: float) -> float:
        return 1.6 * (1 - e) / e


class Gonthier(_Damped):
    """Damping d with the exact restitution e of free bodies: (1 + d)/(1 - e d) = exp(d (1 + e)).

    Y. Gonthier et al., Multibody Syst. Dyn. 11 (2004) 209-233; their d = (1 - e^2)/e is the
    closed-form approximation of this root.
    """

    @staticmethod
    def _factor(e: float) -> float:
        if e == 1:
            return 0.0

        from scipy.optimize import brentq  # loaded where it is used: it takes long

        def mismatch(d: float) -> float:
            return log1p(d) - d - (log1p(-e * d) + e * d)

        low, slope_at_end = 0.5 * (1 - e), 0.1  # d -> 3 (1 - e)/2 as e -> 1, d -> 1/e as e -> 0
        while mismatch((1 - slope_at_end) / e) < 0:
            slope_at_end *= 0.1
            if slope_at_end < 1e-15:
                return 1 / e
        return float(brentq(mismatch, low, (1 - slope_at_end) / e, xtol=1e-16, rtol=1e-14))


@dataclass(frozen=True, repr=False)
class Hysteretic(PatchedLaw):
    """Base of laws that yield; state: (deepest indentation, turning point [m], lost energy [J])."""

    has_memory: ClassVar[bool] = True
    size: ClassVar[int] = 3

    def permanent(self, deepest: float) -> float:
        """Permanent indentation delta_p [m] after the largest one, 0 <= delta_p < deepest."""
        return self.origin((deepest, 0.0, 0.0))


@lru_cache(maxsize=64)
def yield_factor(nu: float) -> float:
    """Ratio of Hertz's largest pressure at first yield to yield strength (Johnson 1985, 3.4)."""
    s = 0.48  # depth over the contact radius

    for _ in range(6):  # Newton on the slope of the stress along the axis
        denominator = 1 + s * s
        slope = (1 + nu) * (atan(1 / s) - s / denominator) - 3 * s / denominator**2
        second_slope = (
            -2 * (1 + nu) / denominator**2 - 3 / denominator**2 + 12 * s * s / denominator**3
        )
        s -= slope / second_slope

    return 1 / (1.5 / (1 + s * s) - (1 + nu) * (1 - s * atan(1 / s)))


#: Errors of `ElasticPlastic` at indentations over that at yield, of force and of restitution: the
#: largest that benchmarks/elastoplastic/compare.py prints, rounded up; beyond 300 a guess. Without
#: hardening they are 0.007 to 0.037 and 0.003 to 0.017; the rest is hardening by E/50.
MEASURED_INDENTATIONS = (1, 3, 10, 30, 100, 300, 1e4)
MEASURED_ERRORS = (
    (0.007, 0.008, 0.013, 0.028, 0.075, 0.15, 0.4),
    (0.003, 0.006, 0.012, 0.023, 0.045, 0.066, 0.2),
)
#: The same of force by strains that are not small, over indentation/radius: 0.11 at 0.25, 0.03 at
#: 0.063, below 0.01 at 0.011 (E*/Y = 50, 100, 244 at 100 yield indentations: finite_strain.csv); of
#: restitution 0.058, 0.023, 0.013.
STRAIN_ERRORS = 0.45, 0.3


@dataclass(frozen=True, repr=False)
class ElasticPlastic(Hysteretic):
    """Law of an elastic, perfectly plastic sphere on a flat: Hertz's up to yield, then fitted.

    Parameters
    ----------
    modulus : float
        E* [Pa], 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2.
    radius : float
        Relative radius [m], 1/R = 1/R1 + 1/R2.
    yield_strength : float
        Y [Pa] of the side that yields first, the softer one.
    nu : float
        Poisson's ratio of the side that yields first.
    elastic_share : float
        Share of the other side, which stays elastic, in the flexibility 1/E*: 0 if it is rigid,
        0.5 if it is equally stiff; also 0 if both sides are equal and both yield.
    compliance : float
        c [m/N], >= 0: half-space compliance of a patch, which the structure already contains.

    Attributes
    ----------
    stiffness : float
        Hertz's k [N m^-3/2].
    yield_indentation, yield_force : float
        Indentation [m] and force [N] at first yield; below, the law is Hertz's.

    Notes
    -----
    Force and permanent indentation are curves of x = delta/yield_indentation, fitted to finite
    elements (benchmarks/elastoplastic). For small strains one curve holds for all E*/Y; an elastic
    side changes it with its share to the power 1.5. For nu = 0.2 to 0.45 and shares up to 0.74, the
    force is within 2.8 % of finite elements up to x = 100, 3.7 % up to 300, the restitution within
    0.02; see `error_at`. The unloading force is proportional to the power 1.25 + 0.25/sqrt(x) of
    the indentation beyond the permanent one; reloading follows the same curve.
    """

    modulus: float = field(metadata=checked_by(checks.positive, "Pa"))
    radius: float = field(metadata=checked_by(checks.positive, "m"))
    yield_strength: float = field(metadata=checked_by(checks.positive, "Pa"))
    nu: float = field(default=0.3, metadata=checked_by(_checked_poisson))
    elastic_share: float = field(default=0.0, metadata=checked_by(_checked_share))
    stiffness: float = field(init=False, repr=False, compare=False)
    yield_indentation: float = field(init=False, repr=False, compare=False)

    kind: ClassVar[int] = library.ELASTIC_PLASTIC

    @checks.within_range
    def __post_init__(self) -> None:
        super().__post_init__()
        k = 4 / 3 * self.modulus * sqrt(self.radius)
        pressure = yield_factor(self.nu) * self.yield_strength
        y = self.radius * (pi * pressure / (2 * self.modulus)) ** 2
        numbers = [k, y, self.elastic_share**1.5, k ** (-2 / 3)]
        checks.store(self, stiffness=k, yield_indentation=y, _parameters=numbers)

    @property
    def yield_force(self) -> float:
        """Force [N] at first yield."""
        return self.stiffness * self.yield_indentation**1.5

    def error_at(self, depth: float) -> tuple[float, float]:
        """(relative error of force, error of restitution) at an indentation [m], patch included.

        They are the largest differences from small-strain finite elements with nu = 0.2 to 0.45,
        elastic shares up to 0.74, without hardening and with E/50 (benchmarks/elastoplastic), at
        equal indentation, plus the effect of finite strain. Beyond 300 yield indentations they are
        an increasing estimate; below yield they are 0.
        """
        depth = checks.nonnegative("depth", depth, "m")
        if depth <= self.yield_indentation:
            return 0.0, 0.0
        x = log(depth / self.yield_indentation)
        force, restitution = (
            np.interp(x, np.log(MEASURED_INDENTATIONS), row) for row in MEASURED_ERRORS
        )
        strain = depth / self.radius
        of_force, of_restitution = STRAIN_ERRORS
        return float(force) + of_force * strain, float(restitution) + of_restitution * strain


@dataclass(frozen=True, repr=False)
class Thornton(Hysteretic):
    """Law of an elastic, perfectly plastic sphere. C. Thornton, J. Appl. Mech. 64 (1997) 383-386.

    For comparison only: against finite elements (benchmarks/elastoplastic) the force with a yield
    pressure of 1.6 Y is 19, 42, 57, 66, 72 % low at 3, 10, 30, 100, 300 yield indentations; with
    2.8 Y it is 6, -7, -27, -42, -52 % off: pressure and contact area grow, as in `ElasticPlastic`.

    Hertz's law up to the yield indentation. Beyond it, the pressure is limited and the force
    continues along the tangent. Unloading is Hertzian with the flattened radius R F_e/F_m, where
    F_m is the force and F_e Hertz's force at the largest indentation delta_m; the permanent
    indentation is delta_p = delta_m (1 - F_m/F_e).

    Parameters
    ----------
    stiffness : float
        Hertz's k_H [N m^-3/2].
    yield_indentation : float
        delta_y [m] at first yield.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    yield_indentation: float = field(metadata=checked_by(checks.positive, "m"))

    kind: ClassVar[int] = library.THORNTON

    @classmethod
    @checks.within_range
    def from_material(cls, E_star: float, radius: float, yield_pressure: float) -> Thornton:
        """The law from E* [Pa], relative radius [m] and contact pressure at yield p_y [Pa] (1.6 Y).

        delta_y = R (pi p_y/(2 E*))^2.
        """
        E = checks.positive("E_star", E_star, "Pa")
        R = checks.positive("radius", radius, "m")
        p = checks.positive("yield_pressure", yield_pressure, "Pa")
        return cls(4 / 3 * E * sqrt(R), R * (pi * p / (2 * E)) ** 2)


@dataclass(frozen=True, repr=False)
class YangSun(Hysteretic):
    """Indentation law of laminates. S. H. Yang, C. T. Sun, ASTM STP 787 (1982) 425-449.

    Loading: F = stiffness delta^1.5 (N m^-3/2). Unloading and reloading: powers 2.5 and 1.5 of
    delta - delta_p. The permanent indentation is delta_p = delta_m [1 - (critical/delta_m)^(2/5)]
    if the largest one delta_m exceeds `critical` [m], else 0.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    critical: float = field(metadata=checked_by(checks.positive, "m"))

    kind: ClassVar[int] = library.YANG_SUN


class Tabulated(Hysteretic):
    """Law of measured loading and unloading curves, interpolated monotonically (PCHIP).

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
    indentation and by F(delta_m) along the force; reloading follows the same curve. The permanent
    indentation is thus a fixed share of the depth, but in a yielding contact the share grows with
    the depth (see `ElasticPlastic`): give an unloading curve from about the depth of the impact.
    Beyond the last point the loading curve continues along its end tangent, above `valid_force`.
    """

    kind: ClassVar[int] = library.TABLE

    @checks.within_range
    def __init__(
        self,
        indentation: ArrayLike,
        force: ArrayLike,
        unloading: tuple[ArrayLike, ArrayLike] | None = None,
    ) -> None:
        x, F = _checked_curve("loading", indentation, force)
        if x[0] != 0 or F[0] != 0:
            raise InputError(
                f"the loading curve must start at (0, 0); it starts at ({x[0]:g} m, {F[0]:g} N)."
            )
        self.elastic = unloading is None
        self._end = float(F[-1])
        self._points = len(x)
        self._reach = f"{engineering(x[-1], 'm')} and {engineering(F[-1], 'N')}"
        remains = 0.0
        xu = x
        Fu = F

        if unloading is not None:
            xu, Fu = _unloading(unloading, x, F)
            remains = float(xu[0] / xu[-1])
            xu = (xu - xu[0]) / (xu[-1] - xu[0])
            Fu = Fu / Fu[-1]

        first = _interpolant(x, F)
        second = _interpolant(xu, Fu)
        header = [float(self.elastic), remains, float(x.size), float(xu.size), 5.0 + len(first)]
        self._parameters = [*header, *first, *second]
        if unloading is not None:
            self._check_loss(x)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tabulated) and self._parameters == other._parameters

    def __hash__(self) -> int:
        return hash(tuple(self._parameters or ()))

    def without(self, compliance: float) -> Self:
        return self

    @cached_property
    def valid_force(self) -> float:
        return self._end

    def __repr__(self) -> str:
        unloading = "" if self.elastic else ", unloading given"
        return f"Tabulated(points {self._points}, up to {self._reach}{unloading})"

    def out_of_range(self, peak: float, radius: float | None) -> str:
        return (
            f"the peak force {peak:.4g} N exceeds the table's last point,"
            f" {self._end:.4g} N; measure or extrapolate the curve further"
        )

    def _check_loss(self, depths: Array) -> None:
        for d in depths[1:]:
            work = self.loading_work(float(d))
            returned = self.energy(float(d), (float(d), float(d), 0.0))
            if returned > work * (1 + 1e-9):
                raise InputError(
                    f"unloading from {d:g} m would give back {returned:g} J of {work:g} J put in;"
                    f" the unloading curve must lie below the loading curve."
                )


def _interpolant(x: Array, y: Array) -> list[float]:
    """PCHIP interpolant for C: knots, four rows of coefficients, last value, last slope."""
    from scipy.interpolate import PchipInterpolator  # loaded where it is used

    cubic = PchipInterpolator(x, y)
    rows = [x, *np.pad(cubic.c, ((0, 0), (0, 1))), [y[-1], cubic(x[-1], 1)]]
    return np.concatenate(rows).tolist()  # type: ignore[no-any-return]


def _unloading(unloading: tuple[ArrayLike, ArrayLike], x: Array, F: Array) -> tuple[Array, Array]:
    """The checked unloading curve, which must end at the last point of the loading curve (x, F)."""
    if not isinstance(unloading, list | tuple) or len(unloading) != 2:
        raise InputError(
            "unloading must be a pair (indentation, force) of the unloading curve; got"
            f" {checks.shown(unloading)}."
        )

    xu, Fu = _checked_curve("unloading", *unloading)
    ends_match = np.allclose((xu[-1], Fu[-1]), (x[-1], F[-1]), rtol=1e-9, atol=0)
    if Fu[0] != 0 or xu[0] < 0 or not ends_match:
        raise InputError(
            f"the unloading curve must run from no force to ({x[-1]:g} m, {F[-1]:g} N), the end of"
            f" loading; it runs from ({xu[0]:g} m, {Fu[0]:g} N) to ({xu[-1]:g} m, {Fu[-1]:g} N)."
        )

    return xu, Fu


def _checked_curve(name: str, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Indentations and forces of a curve as arrays, checked to increase strictly."""
    xs = checks.floats(f"{name} indentation", x, (None,))
    ys = checks.floats(f"{name} force", y, xs.shape)
    if xs.size < 2:
        raise InputError(f"the {name} curve needs at least 2 points; got {xs.size}.")

    for axis, values, unit in (("indentation", xs, "m"), ("force", ys, "N")):
        falls = np.flatnonzero(np.diff(values) < checks.MIN_MAGNITUDE)
        if falls.size:
            i = int(falls[0])
            raise InputError(
                f"the {axis} of the {name} curve must increase strictly; entries {i} and {i + 1}"
                f" are {values[i]:g} and {values[i + 1]:g} {unit}."
            )

    return xs, ys
