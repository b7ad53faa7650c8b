"""Stiffness of a ply in rotated axes against the rotation of the elasticity tensor."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao

PLY = ao.Layer(25e9, 1e9, 0.25, 0.5e9, 0.4e9, 0.2e9, 1500.0, 1e-3)
#: places of (11, 22, 12) in a tensor of two indices
PAIRS = ((0, 0), (1, 1), (0, 1))


def tensor(Q: np.ndarray) -> np.ndarray:
    """C (2, 2, 2, 2) of stresses (σ1, σ2, τ12) and strains (ε1, ε2, γ12)."""
    C = np.zeros((2, 2, 2, 2))
    for m, (i, j) in enumerate(PAIRS):
        for n, (k, g) in enumerate(PAIRS):
            for a, b in {(i, j), (j, i)}:
                for c, d in {(k, g), (g, k)}:
                    C[a, b, c, d] = Q[m, n]
    return C


@pytest.mark.parametrize("angle", [0.0, 17.0, 90.0, -60.0, 135.0, 180.0, 270.0, 450.0, -90.0])
def test_a_ply_at_any_angle(angle):
    turned = PLY.rotated(angle)
    phi = np.radians(angle)
    R = np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])
    exact = np.einsum("ai,bj,ck,dl,ijkl->abcd", R, R, R, R, tensor(PLY.plane_stress()))
    largest = np.abs(exact).max()
    np.testing.assert_allclose(tensor(turned.plane_stress()), exact, atol=1e-12 * largest)
    shear = R @ np.diag([PLY.G13, PLY.G23]) @ R.T
    np.testing.assert_allclose(turned.transverse_shear(), shear, atol=1e-12 * PLY.G13)
    if angle % 90 == 0:  # exactly, so that a cross-ply has no coupling
        assert turned.plane_stress()[2, 0] == turned.transverse_shear()[0, 1] == 0


def test_the_constants_of_a_ply():
    """Stresses under ε1, and ε under stress along 1: E1 and ν12."""
    S = np.linalg.inv(PLY.plane_stress())
    assert 1 / S[0, 0] == pytest.approx(PLY.E1)
    assert 1 / S[1, 1] == pytest.approx(PLY.E2)
    assert -S[1, 0] / S[0, 0] == pytest.approx(PLY.nu12)
    assert 1 / S[2, 2] == pytest.approx(PLY.G12)
