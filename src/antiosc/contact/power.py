"""Laws F = k delta^n: linear, Hertz's and any exponent, elastic or with damping.

The damping grows with the indentation: F = k delta^n (1 + d delta'/v0) >= 0. v0 is the speed of
approach of the present contact and d follows from a coefficient of restitution e. For two free
rigid bodies the motion has the first integral d (1 + e') = ln[(1 + d)/(1 - d e')] between d and the
ratio e' of parting and closing speed, whatever k, n and the masses (`restitution_of`); of the laws
here only Gonthier's returns e itself. In chatter v0 -> 0 and d/v0 would grow without bound: v0 is
held above 1 % of the fastest approach so far.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from math import inf, log1p, sqrt
from typing import ClassVar

from antiosc.base import checks, march
from antiosc.base.checks import checked_by
from antiosc.base.errors import InputError, NotConvergedError
from antiosc.contact.base import Compiled, State
from antiosc.contact.geometry import Radii, effective_modulus, hertz_stiffness, relative_curvatures


def checked_exponent(name: str, value: object) -> float:
    """n of a force that grows as delta^n, 1 <= n <= 10, or InputError."""
    n = checks.number(name, value)
    if not 1 <= n <= 10:
        raise InputError(f"exponent must lie in 1 <= n <= 10 (1 linear, 1.5 Hertz); got {n:g}.")
    return n


@dataclass(frozen=True)
class Power(Compiled):
    """F = stiffness * delta^exponent.

    Parameters
    ----------
    stiffness : float
        [N/m^exponent], > 0.
    exponent : float
        >= 1.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N/m^exponent"))
    exponent: float = field(metadata=checked_by(checked_exponent))

    kind: ClassVar[int] = march.POWER


@dataclass(frozen=True)
class Linear(Compiled):
    """F = stiffness * delta, a spring that can only push. `stiffness` in N/m."""

    stiffness: float = field(metadata=checked_by(checks.positive, "N/m"))

    kind: ClassVar[int] = march.LINEAR

    def implicit(
        self,
        delta: float,
        alpha: float,
        rate: float,
        alpha_rate: float,
        state: State,
        guess: float = 0.0,
    ) -> float:
        return self.stiffness * delta / (1.0 + self.stiffness * alpha) if delta > 0 else 0.0


@dataclass(frozen=True)
class Hertz(Compiled):
    """Hertz's law F = stiffness * delta^(3/2), optionally minus the compliance of a patch.

    Parameters
    ----------
    stiffness : float
        k_H [N m^-3/2], > 0.
    compliance : float
        c [m/N], >= 0: the indentation is (F/k_H)^(2/3) - c F. This is for a structure whose
        compliance already contains the half-space compliance of a contact patch.

    Notes
    -----
    The law with c holds while the indentation grows with the force, F < F_lim = (2/(3c))^3/k_H^2;
    there the contact radius is 0.83 of the patch's. With rho = (F/F_lim)^(1/3) the flexibility left
    is 1 - rho of Hertz's own, so a relative error e in c becomes e rho/(1 - rho) in the tangent.
    `valid_force` is where rho = 0.7: an error of 2 % in c still is below 5 % in the tangent (the
    contact radius is then 0.58 of the patch radius). Beyond, the law continues along its tangent,
    so that a run can complete and report the peak force; `simulate` then raises AccuracyError.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N m^-3/2"))
    compliance: float = field(default=0.0, metadata=checked_by(checks.nonnegative, "m/N"))

    kind: ClassVar[int] = march.HERTZ
    #: rho at which the law with a compliance ends
    END: ClassVar[float] = 0.7

    # with s = F^(1/3): delta = a s^2 - c s^3 up to s = end, a straight line beyond
    _a: float = field(init=False, repr=False, compare=False)
    _end: float = field(init=False, repr=False, compare=False)
    _end_slope: float = field(init=False, repr=False, compare=False)

    @checks.within_range
    def __post_init__(self) -> None:
        super().__post_init__()
        k, c = self.stiffness, self.compliance
        a = k ** (-2 / 3)
        s = self.END * 2 * a / (3 * c) if c > 0 else inf
        slope = (2 / 3) * a / s - c if c > 0 else 0.0
        checks.store(self, _a=a, _end=s, _end_slope=slope, valid_force=s**3)

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
            Young's modulus [Pa] and Poisson's ratio; E2 None: body 2 is rigid; nu2 None: as nu1.
        angle : float
            Between the planes of the first radii [degree]; 90 for crossed cylinders.
        """
        A, B = relative_curvatures(radii1, radii2, checks.number("angle", angle, "degree"))
        return cls(hertz_stiffness(effective_modulus(E1, nu1, E2, nu2), A, B))

    def without(self, compliance: float) -> Hertz:
        """This law minus `compliance` [m/N]."""
        return replace(self, compliance=compliance)

    def out_of_range(self, peak: float, radius: float | None) -> str:
        # the contact radius goes with F^(1/3), the patch's compliance with 1/radius
        if radius is None:
            remedy = "use a larger patch radius"
        else:
            enough = 1.05 * radius * (peak / self.valid_force) ** (1 / 3)
            remedy = f"extract with a site radius of at least {enough:.3g} m (now {radius:g} m)"
        return (
            f"the peak force {peak:.4g} N exceeds {self.valid_force:.4g} N, up to which Hertz's law"
            f" without the patch's own compliance holds (contact radius below 0.58 of the patch"
            f" radius); {remedy}"
        )

    def implicit(
        self,
        delta: float,
        alpha: float,
        rate: float,
        alpha_rate: float,
        state: State,
        guess: float = 0.0,
    ) -> float:
        """Newton on a s^2 + (alpha - c) s^3 = delta with s = F^(1/3) and a = k_H^(-2/3)."""
        if delta <= 0.0:
            return 0.0
        a, end = self._a, self._end
        cubic = alpha - self.compliance
        if self.compliance > 0.0:
            reach = (a + cubic * end) * end * end
            if delta >= reach:
                return self.valid_force + (delta - reach) / (self._end_slope + alpha)
        if guess > 0.0 and cubic > 0.0:  # convex: from above the iteration falls to the root
            s = guess ** (1 / 3)
        else:
            s = sqrt(delta / a)
            if cubic > 0.0:
                s = min(s, (delta / cubic) ** (1 / 3))
        for _ in range(100):
            bend = cubic * s
            step = ((a + bend) * s * s - delta) / ((2.0 * a + 3.0 * bend) * s)
            s -= step
            if s > end:
                s = end
            if abs(step) <= 1e-8 * s:  # the error left is the square of that
                return s * s * s
        raise NotConvergedError(
            f"Hertz's force at the indentation {delta:g} m has not converged after 100 steps."
        )


def _checked_restitution(name: str, value: object) -> float:
    e = checks.number(name, value)
    if not 0 < e <= 1:
        raise InputError(f"restitution must lie in 0 < e <= 1; got {e:g}.")
    return e


@dataclass(frozen=True)
class _Damped(Compiled):
    """F = stiffness * delta^exponent * (1 + d * rate/v0), never negative.

    Parameters
    ----------
    stiffness : float
        [N/m^exponent], > 0.
    restitution : float
        Coefficient of restitution e, 0 < e <= 1.
    exponent : float
        >= 1; 1.5 is Hertz's.
    """

    stiffness: float = field(metadata=checked_by(checks.positive, "N/m^exponent"))
    restitution: float = field(metadata=checked_by(_checked_restitution))
    exponent: float = field(default=1.5, metadata=checked_by(checked_exponent))
    factor: float = field(init=False, repr=False, compare=False)

    kind: ClassVar[int] = march.DAMPED
    size: ClassVar[int] = 2  # d/v0, fastest approach so far
    rate_dependent: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.store(self, factor=self._factor(self.restitution))

    @staticmethod
    @abstractmethod
    def _factor(e: float) -> float:
        """d for a coefficient of restitution e."""

    def parameters(self) -> list[float]:
        return [self.stiffness, self.exponent, self.factor]


class HuntCrossley(_Damped):
    """d = 3 (1 - e)/2. K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445."""

    @staticmethod
    def _factor(e: float) -> float:
        return 1.5 * (1 - e)


class LankaraniNikravesh(_Damped):
    """d = 3 (1 - e^2)/4. H. M. Lankarani, P. E. Nikravesh, J. Mech. Des. 112 (1990) 369-376.

    Derived for e near 1: rigid bodies with e = 0.9, 0.7, 0.5 part with 0.91, 0.80, 0.73; `Gonthier`
    has no such limit.
    """

    @staticmethod
    def _factor(e: float) -> float:
        return 0.75 * (1 - e * e)


class Flores(_Damped):
    """d = 8 (1 - e)/(5 e). P. Flores et al., Multibody Syst. Dyn. 25 (2011) 357-375.

    Rigid bodies with e = 0.9, 0.7, 0.5 part with 0.89, 0.68, 0.47.
    """

    @staticmethod
    def _factor(e: float) -> float:
        return 1.6 * (1 - e) / e


class Gonthier(_Damped):
    """d from (1 + d)/(1 - e d) = exp(d (1 + e)), so that free bodies part with e exactly.

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

        low, near = 0.5 * (1 - e), 0.1  # d -> 3 (1 - e)/2 as e -> 1, d -> 1/e as e -> 0
        while mismatch((1 - near) / e) < 0:
            near *= 0.1
            if near < 1e-15:
                return 1 / e
        return float(brentq(mismatch, low, (1 - near) / e, xtol=1e-16, rtol=1e-14))


def restitution_of(d: float) -> float:
    """Ratio e' of parting and closing speed of two free bodies for a damping factor d >= 0."""
    d = checks.nonnegative("d", d)
    if d == 0:
        return 1.0

    from scipy.optimize import brentq  # loaded where it is used: it takes long

    def mismatch(e: float) -> float:
        return log1p(d) - d - (log1p(-e * d) + e * d)

    high = min(1.0, (1 - 1e-15) / d)
    if mismatch(high) <= 0:  # the root lies within rounding of 1/d
        return high
    return float(brentq(mismatch, 0.0, high, xtol=1e-16))
