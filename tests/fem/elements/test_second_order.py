"""Second-order strain of curved sheets: the change of the force, and what is told of it.

The strain energy k q²/2 + g q³/2 of a static shape has 2 g = dk/dδ, the change of the linear
stiffness of the sheet whose surface is moved by δ times the shape: linear models alone tell it.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao
from antiosc.recovery import mesh_fields
from sheets import sheet

RADIUS, RISE = 0.1, 2e-3
STEEL = ao.Shell(210e9, 0.3, 7850.0, 1e-3)


def cap(rise, moved=None, n=10):
    """A shallow cap over a square, held at its rim; `moved` (nodes, 3): of its nodes."""

    def surface(s, t):
        x, y = (2 * s - 1) * RADIUS, (2 * t - 1) * RADIUS
        return x, y, rise * (1 - (x / RADIUS) ** 2) * (1 - (y / RADIUS) ** 2)

    mesh = sheet(n, surface)
    if moved is not None:
        mesh.dolfinx.geometry.x[:] += moved
    rim = ao.Support(lambda x: np.isclose(np.abs(x[:2]).max(axis=0), RADIUS))
    part = ao.Structure(mesh, STEEL, [rim])
    return part, ao.extract(part, ao.Site((0, 0, rise), (0, 0, -1), snap=True), n=10)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.slow
def test_the_share_is_the_change_of_the_linear_stiffness():
    part, model = cap(RISE, n=20)
    shape = mesh_fields.displacements_of_rank(part.matrices, model.shapes[:, :1])[:, :, 0]
    step = 2e-5
    stiffness = [cap(RISE, sign * step * shape, 20)[1].k0 for sign in (1, -1)]
    slope = (stiffness[0] - stiffness[1]) / (2 * step)
    share = model.info["second_order"][""]
    assert share < 0  # softer where it is pushed toward flat
    assert share == pytest.approx(0.75 * slope / model.k0, rel=0.04)


def told(rise, speed):
    _, model = cap(rise)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ao.simulate(model, ao.RigidMass(2.0, velocity=speed), ao.Hertz(5e7), 0.05)
    return " ".join(str(one.message) for one in caught if "times" in str(one.message))
