"""Every joint in one assembly: Z(ω) and dofs against constrained matrices written by hand."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

pytest.importorskip("dolfinx")

import antiosc as ao
import every_joint

pytestmark = pytest.mark.fem


@pytest.mark.slow
def test_every_joint_against_dense_matrices():
    """Tie, Rigid, Mean, Weld, Hinge, Ball, Slider, Bolt, Bushing, Equation, superelement, mass."""
    part = every_joint.assembly()
    K, M, b = every_joint.dense(every_joint.parts())
    assert part.dofs == len(K)
    model = ao.extract(part, every_joint.SITE, n=40)
    for omega in np.array([0.0, 0.3, 0.77, 1.4, 2.5]) * model.omega[0]:
        exact = 1 / (b @ scipy.linalg.solve(K - omega**2 * M, b))
        assert model.dynamic_stiffness(omega).real == pytest.approx(exact, rel=1e-9)
