"""Error control by step refinement: the error of the finer of two runs from their difference."""

from __future__ import annotations

from math import isfinite, log

# A halving of the step divides the error by 4 in the ideal case; less than 1.5 is not convergence.
_BEST, _WORST = 1 / 4, 2 / 3
_MOST_HALVINGS = 4.0
_AIM = 0.7  # share of the tolerance that the next run is aimed at
_SAFETY = 1.5  # on an extrapolated error until two rates agree
_LEAST = 0.05  # rates below this are not told apart
_AGREE = 0.1  # relative difference of two rates that confirm each other


class Refinement:
    """Estimated errors of a sequence of successively finer runs, and the next refinement.

    If every halving of the step multiplies the error by rho, two runs k halvings apart differ by
    D = e (1 - rho^k)/rho^k, e being the error of the finer one. Two successive differences give
    rho; before that e = D is taken, while the next step is chosen as for second order.

    A single rate may be accidental, if a yield point or a release lies between two steps. An
    extrapolated error is therefore multiplied by 1.5 until two successive rates agree. The peak is
    one value of the force, and its differences change sign from step to step; its error is never
    taken below that of the force. tests/simulation/test_estimates.py measures how often the
    estimates cover the true errors.
    """

    def __init__(self, tol: float) -> None:
        self.tol = tol
        self.halvings = 1.0  # between the last run and the next
        self.error = {"force": float("inf"), "peak": float("inf")}
        self._before: tuple[float, float] | None = None
        self._rate = 0.0  # the last one found

    @property
    def reached(self) -> bool:
        """Whether the last run meets the tolerance."""
        return max(self.error.values()) <= self.tol

    def update(self, force: float, peak: float) -> None:
        """Add the relative differences of the last two runs, `halvings` apart."""
        k = self.halvings
        before = self._before if force > 0 else None
        rate = _BEST if before is None else _rate(force / before[0], before[1], k)
        rho = max(rate, _BEST)
        likely = rho**k / (1 - rho**k)
        left = 1.0
        if before is not None:
            proven = abs(rate - self._rate) <= _AGREE * rho and rate >= (1 - _AGREE) * _BEST
            left, self._rate = (1.0 if proven else _SAFETY) * likely, rate
        self.error = {"force": force * left, "peak": max(force, peak) * left}
        self._before = (force, k) if force > 0 else None
        aim = max(force, peak) * likely / (_AIM * self.tol)
        if aim > 1 and isfinite(aim):
            self.halvings = min(max(log(aim) / log(1 / rho), 1.0), _MOST_HALVINGS)
        else:
            self.halvings = 1.0


def _rate(ratio: float, before: float, now: float) -> float:
    """rho from the ratio of two successive differences, over `before` and `now` halvings."""
    low, high = _LEAST, _WORST
    for _ in range(14):
        rho = 0.5 * (low + high)
        if rho**before * (1 - rho**now) / (1 - rho**before) < ratio:
            low = rho
        else:
            high = rho
    return high
