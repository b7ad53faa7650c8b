"""The motion of a body between the nodes of a history."""

from __future__ import annotations

import numpy as np

import antiosc as ao
from antiosc.simulation.histories.body_motion import amplitudes, forces_of

MODEL = ao.AntiOscillators(
    m0=1e-3, k0=1e6, m=[0.3, 0.1], omega=[2e3, 9e3], shapes=np.eye(3), damping=ao.Damping(0.01)
)


def test_accelerations_between_nodes_are_derivatives_of_velocities():
    """Also while the contact force bends between two nodes."""
    hit = ao.simulate(MODEL, ao.RigidMass(0.05, 1.0), ao.Hertz(1e9), 1e-3, tol=1e-2)
    start, end = hit.contacts[0]
    nodes = hit.time[(hit.time > start) & (hit.time < end)]
    middles = (nodes[1:] + nodes[:-1]) / 2
    h = 1e-3 * np.diff(nodes)
    for lower in (0, 1):
        after, before = (amplitudes(hit, middles + s * h, "structure", lower) for s in (1, -1))
        slopes = (after - before) / (2 * h[:, None])
        found = amplitudes(hit, middles, "structure", lower + 1)
        np.testing.assert_allclose(found, slopes, atol=1e-4 * np.abs(found).max())
    np.testing.assert_allclose(forces_of(hit, middles, "structure")[:, 0], hit.force_at(middles))
