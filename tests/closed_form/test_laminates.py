"""Stacks that Navier's solution of laminated plates takes, and those that it does not."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.base.errors import InputError
from antiosc.closed_form.plates import SupportedLaminate

A, D, S = np.diag([9e7, 4e7, 2e7]), np.diag([80.0, 30.0, 15.0]), np.diag([6e6, 5e6])


def laminate(A=A, B=((0, 0, 0),) * 3, D=D, S=S, inertia=(20.0, 0.0, 2e-5)):
    return SupportedLaminate(A, np.array(B, dtype=float), D, S, inertia, 0.4, 0.3)


def entry(matrix, i, j, share):
    changed = np.array(matrix, dtype=float)
    changed[i, j] = changed[j, i] = share * changed.max()
    return changed


SCALE = np.sqrt(A.max() * D.max())
TWIST, STRETCH, SHEAR = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
TWIST[0, 2] = TWIST[2, 0] = 0.1 * SCALE
STRETCH[1, 1] = 0.1 * SCALE
SHEAR[2, 2] = 0.1 * SCALE


@pytest.mark.parametrize("B", [TWIST, STRETCH, SHEAR, STRETCH + SHEAR])
def test_cross_plies_and_antisymmetric_angle_plies(B):
    omega = laminate(B=B).frequencies(1, 1)
    assert (np.diff(omega) > 0).all()
    assert omega[0] < laminate().frequencies(1, 1)[0]  # coupling makes a plate softer


@pytest.mark.parametrize(
    "changes",
    [
        {"A": entry(A, 0, 2, 0.1)},
        {"A": entry(A, 1, 2, 0.1)},
        {"D": entry(D, 0, 2, 0.1)},
        {"D": entry(D, 1, 2, 0.1)},
        {"S": entry(S, 0, 1, 0.1)},
        {"B": TWIST + STRETCH},
        {"B": TWIST + SHEAR},
        {"B": TWIST, "inertia": (20.0, 1e-3, 2e-5)},
    ],
)
def test_other_stacks_are_refused(changes):
    with pytest.raises(InputError, match="antisymmetric"):
        laminate(**changes)
