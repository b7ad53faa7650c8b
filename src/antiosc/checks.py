"""Input checks shared by all modules: each returns the value in its canonical form or raises."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from antiosc.errors import InputError


def number(name: str, value: Any, unit: str = "") -> float:
    """`value` as a finite float, or InputError."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number{_in(unit)}; got {value!r}.") from None
    if not np.isfinite(result):
        raise InputError(f"{name} must be finite{_in(unit)}; got {result}.")
    return result


def positive(name: str, value: Any, unit: str = "") -> float:
    """`value` as a finite float > 0, or InputError."""
    result = number(name, value, unit)
    if result <= 0:
        raise InputError(f"{name} must be > 0{_in(unit)}; got {result:g}.")
    return result


def nonnegative(name: str, value: Any, unit: str = "") -> float:
    """`value` as a finite float >= 0, or InputError."""
    result = number(name, value, unit)
    if result < 0:
        raise InputError(f"{name} must be >= 0{_in(unit)}; got {result:g}.")
    return result


def whole(name: str, value: Any, least: int = 1) -> int:
    """`value` as an int >= `least`, or InputError."""
    try:
        result = int(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} must be a whole number >= {least}; got {value!r}.") from None
    if result != value or result < least:
        raise InputError(f"{name} must be a whole number >= {least}; got {value!r}.")
    return result


def poisson(nu: Any) -> float:
    """Poisson's ratio of a stable isotropic material, -1 < nu < 0.5, or InputError."""
    result = number("nu", nu)
    if not -1 < result < 0.5:
        raise InputError(
            f"nu must lie in -1 < nu < 0.5 (0.5 is incompressible and has no finite"
            f" stiffness here); got {result:g}."
        )
    return result


def array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """`value` as a finite float array of `shape` (None: any length), or InputError."""
    try:
        result = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be an array of numbers; got {value!r}.") from None
    fits = result.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, result.shape, strict=True)
    )
    if not fits:
        wanted = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ")"
        raise InputError(f"{name} must have shape {wanted}; got {result.shape}.")
    bad = np.count_nonzero(~np.isfinite(result))
    if bad:
        raise InputError(f"{name} must be finite; {bad} of its {result.size} entries are not.")
    return result


def _in(unit: str) -> str:
    return f" (in {unit})" if unit else ""
