"""The contact laws as the march takes them: a kind and a row of parameters."""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np

from antiosc._types import Array
from antiosc.contact import (
    ContactLaw,
    Hertz,
    Linear,
    Power,
    Stronge,
    Tabulated,
    TanSun,
    Thornton,
    YangSun,
)
from antiosc.contact.damped import _Damped
from antiosc.contact.table import _Curve
from antiosc.errors import InputError
from antiosc.simulation import march

#: numbers that a contact may remember
MEMORY = 8

_numbers = count()


def packed(law: ContactLaw) -> tuple[int, Array]:
    """Kind and parameters of a law; any law of one's own is called by its number."""
    values: list[float]
    exact = type(law)
    if exact is Linear:
        kind, values = march.LINEAR, [law.stiffness]  # type: ignore[attr-defined]
    elif isinstance(law, Hertz) and exact is Hertz:
        kind = march.HERTZ
        values = [law.stiffness, law.compliance, law._a, law._end, law._end_slope]
    elif isinstance(law, Power) and exact is Power:
        kind, values = march.POWER, [law.stiffness, law.exponent]
    elif isinstance(law, _Damped) and exact.__module__ == _Damped.__module__:
        kind, values = march.DAMPED, [law.stiffness, law.exponent, law.factor]
    elif isinstance(law, Thornton) and exact is Thornton:
        kind, values = march.THORNTON, [law.stiffness, law.yield_indentation]
    elif isinstance(law, Stronge) and exact is Stronge:
        kind, values = march.STRONGE, [law.stiffness, law.yield_indentation]
    elif isinstance(law, YangSun) and exact is YangSun:
        kind, values = march.YANG_SUN, [law.stiffness, law.critical]
    elif isinstance(law, TanSun) and exact is TanSun:
        kind, values = march.TAN_SUN, [law.stiffness, law.critical, law.slope]
    elif isinstance(law, Tabulated) and exact is Tabulated:
        kind, values = march.TABLE, _table(law)
    else:
        kind, values = march.USER, _own(law)
    return kind, np.array(values, dtype=float)


def _own(law: ContactLaw) -> list[float]:
    size = len(law.touch(1.0))
    if size > MEMORY - 2:
        raise InputError(
            f"the state of a contact law may hold up to {MEMORY - 2} numbers;"
            f" {type(law).__name__}.touch returns {size}."
        )
    number = next(_numbers)
    march.LAWS[number] = law
    return [float(number), float(size)]


def forget(kind: int, parameters: Array) -> None:
    """Let go of a law of one's own."""
    if kind == march.USER:
        march.LAWS.pop(int(parameters[0]), None)


def _table(law: Tabulated) -> list[float]:
    loading, unloading = _knots(law._loading), _knots(law._unload)
    n, m = len(law._loading.x), len(law._unload.x)
    head = [float(law.elastic), law._remains, float(n), float(m), float(5 + len(loading))]
    return [*head, *loading, *unloading]


def _knots(curve: _Curve) -> list[float]:
    """Knots, four rows of coefficients (a spare 0 each), value and slope at the end."""
    rows: list[Any] = [curve.x, *([*column, 0.0] for column in zip(*curve.c, strict=True))]
    return [float(value) for row in [*rows, curve.end] for value in row]
