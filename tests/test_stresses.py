"""Equivalent stress, principal values and the Tsai–Hill index of tensors known by hand."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao


def turned(tensor: np.ndarray) -> np.ndarray:
    """The tensor seen from other axes."""
    Q, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))
    return Q @ tensor @ Q.T


@pytest.mark.parametrize(
    ("tensor", "equivalent"),
    [
        (np.diag([5.0, 0, 0]), 5.0),
        (np.diag([7.0, 7.0, 7.0]), 0.0),
        (np.array([[0, 2.0, 0], [2.0, 0, 0], [0, 0, 0]]), 2 * 3**0.5),
        (np.diag([3.0, -1.0, 0]), (9 + 3 + 1) ** 0.5),
    ],
)
def test_von_mises(tensor, equivalent):
    for t in (tensor, turned(tensor)):
        t = (t + t.T) / 2
        found = ao.von_mises([t, 2 * t])
        np.testing.assert_allclose(found, [equivalent, 2 * equivalent], atol=1e-8)
    six = [tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))]
    assert ao.von_mises(six) == pytest.approx(equivalent, abs=1e-9)


def test_tsai_hill_of_single_stresses_is_their_share_of_the_strength():
    ply = ao.Strengths(X_t=1500.0, X_c=1000.0, Y_t=40.0, Y_c=200.0, S=70.0)
    for entry, strength in (((0, 0), 1500.0), ((1, 1), 40.0), ((0, 1), 70.0)):
        s = np.zeros((3, 3))
        s[entry] = s[entry[::-1]] = strength / 2
        assert ply.tsai_hill(s) == pytest.approx(0.5)
    s = np.diag([-500.0, -60.0, 0.0])
    assert ply.tsai_hill(s) ** 2 == pytest.approx(0.25 - 500 * 60 / 1e6 + 0.09)


def test_the_delamination_load_releases_the_critical_energy():
    """By differences of the strain energies of clamped circular plates, sound and split."""
    D, G = 12.0, 700.0
    load = ao.delamination_load(D, G)

    def energy(a, radius=0.3):
        sound = radius**2 / (16 * np.pi * D)
        split = a**2 / (16 * np.pi) * (1 / (2 * D / 8) - 1 / D)
        return load**2 / 2 * (sound + split)

    for a in (0.01, 0.05):
        grown = a * (1 + 1e-6)
        released = (energy(grown) - energy(a)) / (np.pi * (grown**2 - a**2))
        assert released == pytest.approx(G, rel=1e-6)


@pytest.mark.parametrize("bad", [np.ones(5), np.ones((3, 2)), [[0, 1, 0], [0, 0, 0], [0, 0, 0]]])
def test_what_is_no_tensor_is_refused(bad):
    for function in (ao.von_mises, ao.principal):
        with pytest.raises(ao.InputError, match=r"symmetric|\.\.\., 3, 3"):
            function(bad)


def test_principal_values_come_largest_first():
    t = turned(np.diag([3.0, -1.0, 2.0]))
    np.testing.assert_allclose(ao.principal((t + t.T) / 2), [3, 2, -1], atol=1e-12)
