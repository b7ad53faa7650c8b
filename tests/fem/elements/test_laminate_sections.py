"""Sections of laminates: membrane, coupling, bending and shear stiffness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("dolfinx")


import antiosc as ao
from antiosc.fem.elements.sections import stacked
from laminates import uniform
from sheets import (
    PLY,
    stack,
    unsymmetric,
)

pytestmark = pytest.mark.fem


@pytest.mark.parametrize("angle", [0, 30, 90, -45])
def test_a_homogeneous_section_has_five_sixths_of_its_shear_stiffness(angle):
    layers = stack([angle] * 5, 4e-3)
    section = stacked(layers)
    assert pytest.approx(5 / 6 * uniform(layers), rel=1e-12, abs=1e-6) == section.S
    Q = layers[0].plane_stress()
    assert pytest.approx(Q * 4e-3, rel=1e-12, abs=1e-3) == section.A
    assert pytest.approx(Q * 4e-3**3 / 12, rel=1e-12, abs=1e-9) == section.D
    assert not section.B.any()
    assert section.I1 == 0


def test_a_sandwich_shears_as_its_core():
    """Thin stiff faces: Gc d²/c, d between the middles of the faces (Allen 1969)."""
    face = ao.Layer.isotropic(70e9, 0.3, 2700.0, 0.2e-3)
    core = ao.Layer.isotropic(50e6, 0.3, 60.0, 20e-3)
    S = stacked([face, core, face]).S
    assert S[0, 0] == pytest.approx(core.G12 * 20.2e-3**2 / 20e-3, rel=3e-4)
    assert S[1, 1] == pytest.approx(S[0, 0], rel=1e-12)
    assert abs(S[0, 1]) < 1e-12 * S[0, 0]


def test_a_ply_at_an_angle():
    """1/Ex = c⁴/E1 + (1/G12 − 2ν12/E1) s²c² + s⁴/E2 (Jones, eq. 2.97), and whole turns."""
    for angle in (0, 20, 45, 70, 90, 200):
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        Q = PLY.rotated(angle).plane_stress()
        exact = c**4 / PLY.E1 + (1 / PLY.G12 - 2 * PLY.nu12 / PLY.E1) * (s * c) ** 2 + s**4 / PLY.E2
        assert np.linalg.inv(Q)[0, 0] == pytest.approx(exact, rel=1e-12)
    # fibres at +20°: stretching along 1 pulls them to shear of the positive sign
    assert PLY.rotated(20).plane_stress()[0, 2] > 0
    assert PLY.rotated(360 + 20).plane_stress() == pytest.approx(
        PLY.rotated(20).plane_stress(), rel=1e-12
    )


def test_sections_are_positive_definite():
    rng = np.random.default_rng(5)
    for _ in range(50):
        layers = [
            ao.Layer(
                *10 ** rng.uniform(7, 11, 2), 0.0, *10 ** rng.uniform(6, 10, 3), 1500.0, 1e-3, angle
            )
            for angle in rng.uniform(-90, 90, rng.integers(1, 6))
        ]
        layers = [
            replace(p, nu12=0.9 * rng.uniform(-1, 1) * np.sqrt(p.E1 / p.E2), thickness=t)
            for p, t in zip(layers, 10 ** rng.uniform(-4, -2, len(layers)), strict=True)
        ]
        s = stacked(layers)
        h = s.thickness
        whole = np.block([[s.A, s.B / h], [s.B / h, s.D / h**2]])
        assert np.linalg.eigvalsh(whole)[0] > 0
        assert np.linalg.eigvalsh(s.S)[0] > 0
        # equilibrium asks for more energy than uniform strain: S is below ∫G dz
        assert np.linalg.eigvalsh(uniform(layers) - s.S)[0] >= -1e-9 * s.S.max()
        assert s.I0 * s.I2 > s.I1**2


def test_a_flipped_section_is_that_of_its_flipped_stack():
    """Listed from the other side, and about the same 0° all angles change sign."""
    layers = unsymmetric(2e-3)
    here = stacked(layers).flipped
    there = stacked([p.rotated(-p.angle) for p in layers[::-1]])
    for name in ("A", "B", "D", "S", "I0", "I1", "I2"):
        one, other = np.asarray(getattr(here, name)), np.asarray(getattr(there, name))
        assert np.abs(one - other).max() < 1e-12 * np.abs(other).max(), name
        assert name == "S" or np.abs(other).min() > 0
