"""Functions and objects of the caller that do not fit: one sentence each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import antiosc as ao

MODEL = ao.AntiOscillators(m0=0.1, k0=1e5, m=[0.1], omega=[1e3])


class Drawn:
    """A distribution whose `ppf` returns what it was made with, or raises it."""

    def __init__(self, found: Any) -> None:
        self.found = found

    def ppf(self, shares: np.ndarray) -> Any:
        if isinstance(self.found, Exception):
            raise self.found
        return self.found


def blow(x: Any) -> tuple[Any, ...]:
    return MODEL, ao.RigidMass(0.2, 1.0), ao.Hertz(1e8 * x[0]), 5e-3


def drawn(found: Any) -> Any:
    return ao.monte_carlo(lambda k: k, {"k": Drawn(found)}, n=4)


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: drawn("text"), "ppf of k"),
        (lambda: drawn(np.zeros((2, 2))), "shape"),
        (lambda: drawn(RuntimeError("boom")), "boom"),
    ],
)
def test_what_does_not_fit_is_told(call: Any, word: str) -> None:
    with pytest.raises(ao.AntioscError, match=word):
        call()


def test_x_of_a_gradient_belongs_to_a_function() -> None:
    hit = ao.simulate(*blow([1.0]))
    with pytest.raises(ao.InputError, match="part="):
        ao.gradient(hit, "peak_force", x=[1.0])
