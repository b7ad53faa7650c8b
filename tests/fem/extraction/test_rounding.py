"""The share of rounding in the bounds of Z: constraint modes that are off by known amounts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.linalg

import antiosc as ao
from antiosc.fem.extraction import oscillators, site_shapes
from antiosc.fem.extraction.eigenmodes import Modes

N = 10
X = (np.linspace(0.3, 6.0, 40) * (1 + 0.02j)) ** 2


@pytest.fixture(scope="module")
def pair() -> tuple[np.ndarray, np.ndarray]:
    """Full matrices K and M."""
    rng = np.random.default_rng(3)
    r, s = rng.normal(size=(2, N, N))
    return r @ r.T + 10 * np.diag(np.arange(1.0, N + 1)), s @ s.T / N + np.eye(N)


def constrained(K: np.ndarray, M: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(ω², M-orthonormal modes) where the sites are held."""
    free = scipy.linalg.null_space(B.T)
    x, v = scipy.linalg.eigh(free.T @ K @ free, free.T @ M @ free)
    return x, free @ v


def found(pair, B: np.ndarray, modes: Modes):
    """(Z of these modes, bound on its rounding, loads in whose basis they are)."""
    part = ao.Structure.from_matrices(*pair)
    shapes = site_shapes(part, B)
    known = oscillators.lumped(part, shapes, modes)
    return known.stiffness(X), oscillators._rounding(part, known, X), B @ shapes.W


#: Errors of the modes: their frequencies, sizes, and parts of each other in them.
OFF: dict[str, Callable] = {
    "frequencies": lambda rng, n: (np.eye(n), 1 + 1e-5 * rng.normal(size=n)),
    "sizes": lambda rng, n: (np.diag(1 + 1e-5 * rng.normal(size=n)), np.ones(n)),
    "shapes": lambda rng, n: (np.eye(n) + 1e-5 * rng.normal(size=(n, n)), np.ones(n)),
}


@pytest.mark.sample
@pytest.mark.parametrize("sites", [[0], [0, 4, 7]])
@pytest.mark.parametrize("name", list(OFF))
def test_the_bound_holds_and_is_not_wide(pair, name, sites):
    K, M = pair
    B = np.eye(N)[:, sites]
    x, phi = constrained(K, M, B)
    largest = []
    for seed in range(4):
        mix, factor = OFF[name](np.random.default_rng(seed), len(x))
        Z, bound, load = found(pair, B, Modes(np.sqrt(x) * factor, phi @ mix, True))
        exact = np.array([np.linalg.inv(load.T @ np.linalg.solve(K - one * M, load)) for one in X])
        share = np.linalg.norm(Z - exact, 2, axis=(1, 2)) / bound
        assert share.max() < 1
        largest.append(share.max())
    assert max(largest) > 0.1


@pytest.mark.parametrize("sites", [[0], [0, 4, 7]])
def test_exact_modes_leave_the_rounding_of_the_entries(pair, sites):
    """64 ε of φᴴ(|K| + |x||M|)φ by the diagonals, φ the shape at that frequency."""
    K, M = pair
    B = np.eye(N)[:, sites]
    x, phi = constrained(K, M, B)
    _, bound, load = found(pair, B, Modes(np.sqrt(x), phi, True))
    for value, one in zip(bound, X, strict=True):
        shape = np.linalg.solve(K - one * M, load)
        shape = shape @ np.linalg.inv(load.T @ shape)
        parts = [np.linalg.norm(shape.conj().T @ (np.diag(A)[:, None] * shape), 2) for A in pair]
        entries = 64 * np.finfo(float).eps * (parts[0] + abs(one) * parts[1])
        assert 0.999 * entries < value < 2 * entries
