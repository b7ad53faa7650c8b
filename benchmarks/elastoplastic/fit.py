"""The curves of `ElasticPlastic`, fitted to small_strain.csv: the numbers of csrc/laws.c.

With s = (yield indentation/delta)^(1/4) the force is F_y P(s)/s^4 and unloading recovers the share
s^2 Q(s) of the indentation by the power n = 1.25 + 0.25 s^2. P(1) = Q(1) = 1 and P'(1) = -2: force
and slope leave Hertz's law without a jump. Q is such that unloading gives back the work that it
does in the finite elements.

    python benchmarks/elastoplastic/fit.py
"""

from __future__ import annotations

import numpy as np
from curves import Curves, curves
from numpy.polynomial import polynomial

#: cases that the law is fitted to: the mean of a rigid sphere and one that is as elastic
FITTED = ("rigid", "alike")


def expanded(coefficients: np.ndarray) -> np.ndarray:
    """Coefficients by s of a polynomial in 1 - s."""
    total = np.zeros(1)
    for i, value in enumerate(coefficients):
        total = polynomial.polyadd(total, value * polynomial.polypow([1, -1], i))
    return total


def fit_loading(x: np.ndarray, force: np.ndarray) -> np.ndarray:
    u = 1 - x**-0.25
    wanted = force / x
    basis = np.stack([u**i for i in range(2, 6)], axis=1) / wanted[:, None]
    found = np.linalg.lstsq(basis, (wanted - 1 - 2 * u) / wanted, rcond=None)[0]
    return expanded(np.concatenate([[1, 2], found]))


def fit_recovery(x: np.ndarray, recovers: np.ndarray) -> np.ndarray:
    u = 1 - x**-0.25
    wanted = recovers * np.sqrt(x)
    basis = np.stack([u**i for i in range(1, 4)], axis=1) / wanted[:, None]
    found = np.linalg.lstsq(basis, (wanted - 1) / wanted, rcond=None)[0]
    return expanded(np.concatenate([[1], found]))


def recovery(of: Curves) -> tuple[np.ndarray, np.ndarray]:
    """x and the share that unloading recovers by the law's power, for the work that comes back."""
    tops = np.array(sorted(of.unloading))
    power = 1.25 + 0.25 / np.sqrt(tops)
    back = np.array([of.work_back(top) for top in tops])
    return tops, (power + 1) * back / of.force(tops) / tops


def main() -> None:
    known = curves()
    used = [known[name] for name in FITTED if name in known]
    x = np.geomspace(1.05, 1000, 120)
    loading = np.concatenate([each.force(x[x <= each.x[-1]]) for each in used])
    places = np.concatenate([x[x <= each.x[-1]] for each in used])
    print("PRESSING", ", ".join(f"{value:.8g}" for value in fit_loading(places, loading)))
    tops, shares = (np.concatenate(each) for each in zip(*map(recovery, used), strict=True))
    print("RECOVERY", ", ".join(f"{value:.8g}" for value in fit_recovery(tops, shares)))


if __name__ == "__main__":
    main()
