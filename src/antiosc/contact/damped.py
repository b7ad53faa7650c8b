"""Laws with a damping that grows with the indentation: F = k delta^n (1 + d delta'/v0) >= 0.

v0 is the speed of approach of the present contact and d follows from a coefficient of restitution
e. For two free rigid bodies the motion has the first integral d (1 + e') = ln[(1 + d)/(1 - d e')]
between d and the ratio e' of parting and closing speed, whatever k, n and the masses
(`restitution_of`); of the laws here only Gonthier's returns e itself. In chatter v0 -> 0 and d/v0
would grow without bound: v0 is held above 1 % of the fastest approach so far.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from math import log1p
from typing import Any, ClassVar

from antiosc.base import checks, march
from antiosc.base.declared import checked_by
from antiosc.base.errors import InputError
from antiosc.contact.compiled import Compiled
from antiosc.contact.power import checked_exponent


def _checked_restitution(name: str, value: Any) -> float:
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
    """d = 3 (1 - e^2)/4. H. M. Lankarani, P. E. Nikravesh, J. Mech. Des. 112 (1990) 369-376."""

    @staticmethod
    def _factor(e: float) -> float:
        return 0.75 * (1 - e * e)


class Flores(_Damped):
    """d = 8 (1 - e)/(5 e). P. Flores et al., Multibody Syst. Dyn. 25 (2011) 357-375."""

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
