"""The curves of `ElasticPlastic`, fitted to small_strain.csv: the numbers of csrc/laws.c.

With s = (yield indentation/delta)^(1/4) the force is F_y P(s)/s^4 and unloading recovers the share
s^2 Q(s) of the indentation by the power n = 1.25 + 0.25 s^2. P(1) = Q(1) = 1 and P'(1) = -2: force
and slope leave Hertz's law without a jump. Q is such that unloading gives back the work that it
does in the finite elements. A side that stays elastic and has the share w of the flexibility adds
w^1.5 times other polynomials, which do not change what stands above.

    python benchmarks/elastoplastic/fit.py
"""

from __future__ import annotations

import numpy as np
from curves import Curves, curves
from numpy.polynomial import polynomial
from truth import CASES

#: The case that P and Q are fitted to, and those of what an elastic side adds.
FITTED, ELASTIC = "rigid", ("alike", "steel on aluminium", "soft sphere")
X = np.geomspace(1.05, 1000, 120)


def expanded(coefficients: np.ndarray) -> np.ndarray:
    """Coefficients by s of a polynomial in 1 - s."""
    total = np.zeros(1)
    for i, value in enumerate(coefficients):
        total = polynomial.polyadd(total, value * polynomial.polypow([1, -1], i))
    return total


def fitted(x: np.ndarray, wanted: np.ndarray, first: list[float], powers: range) -> np.ndarray:
    """Coefficients by s of a polynomial in 1 - s that begins with `first`; relative errors."""
    u = 1 - x**-0.25
    rest = (wanted - polynomial.polyval(u, first)) / wanted
    basis = np.stack([u**i for i in powers], axis=1) / wanted[:, None]
    found = np.linalg.lstsq(basis, rest, rcond=None)[0]
    return expanded(np.concatenate([first, found]))


def recovery(of: Curves) -> tuple[np.ndarray, np.ndarray]:
    """x and the Q by which unloading, with the law's power, gives back its work."""
    tops = np.array(sorted(of.unloading))
    power = 1.25 + 0.25 / np.sqrt(tops)
    back = np.array([of.work_back(top) for top in tops])
    return tops, (power + 1) * back / of.force(tops) / np.sqrt(tops)


def elastic_part(name: str) -> float:
    """w^1.5 of a case: w is the share of the flexibility that its sphere has."""
    case = CASES[name]
    return float((1 - (1 - case.nu**2) * case.modulus) ** 1.5)


def added(known: dict[str, Curves], P: np.ndarray, Q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What an elastic side adds to P and Q, by least squares of relative errors."""
    rows: list[list[np.ndarray]] = [[], []]
    rest: list[list[np.ndarray]] = [[], []]
    for name in ELASTIC:
        of, part = known[name], elastic_part(name)
        x = X[of.x[-1] >= X]
        for i, (at, wanted, base) in enumerate([(x, of.force(x) / x, P), (*recovery(of), Q)]):
            u = 1 - at**-0.25
            powers = range(2, 5) if i == 0 else range(1, 4)
            rows[i].append(np.stack([part * u**k for k in powers], axis=1) / wanted[:, None])
            rest[i].append(1 - polynomial.polyval(1 - u, base) / wanted)
    found = [
        np.linalg.lstsq(np.concatenate(a), np.concatenate(b), rcond=None)[0]
        for a, b in zip(rows, rest, strict=True)
    ]
    return expanded(np.append([0, 0], found[0])), expanded(np.append([0], found[1]))


def main() -> None:
    known = curves()
    of = known[FITTED]
    P = fitted(X, of.force(X) / X, [1.0, 2.0], range(2, 6))
    Q = fitted(*recovery(of), [1.0], range(1, 4))
    more = added(known, P, Q)
    names = "PRESSING", "RECOVERY", "PRESSING_ELASTIC", "RECOVERY_ELASTIC"
    for name, values in zip(names, (P, Q, *more), strict=True):
        print(name, ", ".join(f"{value:.8g}" for value in values))


if __name__ == "__main__":
    main()
