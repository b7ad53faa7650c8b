"""Branches that relax slowly have poles that nearly fall together: modes of their subspace."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.engine import first_order


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("share", [0.05, 1.0, 10.0])
@pytest.mark.parametrize("tau", [1e-3, 0.5, 5.0, 1e4])
@pytest.mark.parametrize("count", [8, 30])
def test_first_order_modes_have_the_receptance_of_slow_branches(count, tau, share, turned):
    omega = np.geomspace(300.0, 1e6, count)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(count, count)))[0]
    factor = np.sqrt(share) * (turn if turned else np.eye(count)) * omega
    branch = first_order.from_factors(np.zeros((0, count)), [(factor, tau)])
    modes = first_order.first_order(omega, branch)
    b = np.ones((count, 1))
    at = np.geomspace(100.0, 2e6, 25) * 1.03
    found = modes.receptance(b, at)[:, 0, 0]
    direct = [np.linalg.solve(np.diag(omega**2 - w**2) + branch.stiffness(w), b).sum() for w in at]
    np.testing.assert_allclose(found, direct, rtol=1e-5)
