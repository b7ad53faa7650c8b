"""Damped bodies in impacts."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from scenes import random_model


class TestDamping:
    def test_modal_damping_of_a_single_oscillator(self):
        """A rigid body on a damped spring, struck: its later motion decays as the closed form."""
        m, k, zeta = 1.0, 1e4, 0.05
        w = np.sqrt(k / m)
        body = ao.AntiOscillators(m0=m, k0=k, m=[], omega=[], damping=ao.Damping(zeta))
        hit = ao.simulate(body, ao.RigidMass(0.01, 1.0), ao.Hertz(1e9), 1.0)
        after = hit.contacts[-1][1]
        t = np.linspace(after, 1.0, 50)
        (u0, v0), u = _site(hit, after), hit.coordinates(t)[:, 0]
        s, wd = t - after, w * np.sqrt(1 - zeta**2)
        decay = np.exp(-zeta * w * s)
        exact = decay * (u0 * np.cos(wd * s) + (v0 + zeta * w * u0) / wd * np.sin(wd * s))
        assert u == pytest.approx(exact, abs=1e-9 * np.abs(exact).max())

    def test_rayleigh_puts_dashpots_beside_the_springs(self, rng):
        """The modal decays are those of C = alpha M + beta K of the chain."""
        alpha, beta = 3.0, 1e-6
        model = random_model(rng, 3)
        damped = ao.AntiOscillators(
            model.m0, model.k0, model.m, model.omega, damping=ao.Damping(alpha=alpha, beta=beta)
        )
        K = np.diag(np.concatenate(([model.k0 + model.k.sum()], model.k)))
        K[0, 1:] = K[1:, 0] = -model.k
        M = np.diag(np.concatenate(([model.m0], model.m)))
        w = 2e3
        direct = np.linalg.inv(K - w**2 * M + 1j * w * (alpha * M + beta * K))[0, 0]
        assert damped.modal().receptance(w) == pytest.approx(direct, rel=1e-9)

    @pytest.mark.parametrize("ratio", [5, 1.0, [0.02, 3.0]])
    def test_per_cent_are_no_ratios(self, ratio):
        with pytest.raises(ao.InputError, match=r"0\.05 is 5 %"):
            ao.Damping(ratio)

    def test_a_high_ratio_is_told(self):
        with pytest.warns(ao.AntioscWarning, match=r"0\.05 is 5 %"):
            ao.Damping([0.02, 0.5])
        assert ao.Damping(0.2).ratio == 0.2


def _site(hit: ao.History, t: float) -> tuple[float, float]:
    q, v = hit.states(t)
    b, n = hit.assembly.bodies["structure"].B[:, 0], hit.assembly.spans["structure"].stop
    return float(q[0, :n] @ b), float(v[0, :n] @ b)
