"""A small model that stretches, without a mesh."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

import antiosc as ao
from antiosc.models.stretch import Stretch


def symmetric(tensor):
    orders = list(itertools.permutations(range(tensor.ndim)))
    return sum(tensor.transpose(order) for order in orders) / len(orders)


def model(count=3, scale=1.0, size=3, damping=None):
    """Anti-oscillators with stable second-order forces in some combinations of their modes."""
    rng = np.random.default_rng(4)
    linear = ao.AntiOscillators(
        m0=0.02, k0=3e5, m=[0.08, 0.05, 0.03, 0.02], omega=[900.0, 2500.0, 5200.0, 9100.0],
        damping=damping,
    )  # fmt: skip
    omega = linear.modal().omega
    modes = np.linalg.qr(
        rng.standard_normal((omega.size, size)) / (1 + np.arange(omega.size))[:, None]
    )[0]
    stretched = rng.standard_normal((6, size, size))
    stretched = stretched + stretched.transpose(0, 2, 1)
    cubic = symmetric(np.einsum("pij,pkl->ijkl", stretched, stretched)) * 2e12 * scale**2
    quadratic = symmetric(rng.standard_normal((size,) * 3)) * 1.5e9 * scale
    return replace(linear, stretch=Stretch(modes, quadratic, cubic, count))
