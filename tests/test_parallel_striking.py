"""`strike` on two ranks: the same story and the same bar on both, near to that of one."""

from __future__ import annotations

import pytest

pytest.importorskip("dolfinx")

from mpi import one_and_several

pytestmark = [pytest.mark.fem, pytest.mark.mpi]

SCRIPT = """
    import json, warnings
    import antiosc as ao
    from parts import STEEL, plate
    warnings.simplefilter("ignore")
    hit = ao.strike(
        plate((6, 2), (0.3, 0.1), "triangle"), ao.Site((0.25, 0.1), (0, -1), radius=0.012),
        ao.RigidMass(0.5, 1.0), ao.Hertz(1e10), 1e-3, tol=0.005, order=1,
        material=ao.Solid(**STEEL, plane="stress", thickness=0.01), supports=[ao.Support("left")],
    )
    meshes = len(hit.model.info["strike"])
    print(json.dumps([hit.status, meshes, hit.peak_force, hit.error_budget.worst]))
"""


def test_two_ranks_meet_the_tolerance():
    one, two = one_and_several(SCRIPT)
    for status, meshes, _, bar in (one, two):
        assert status == 0
        assert meshes > 1
        assert bar <= 0.005
    assert two[2] == pytest.approx(one[2], rel=one[3] + two[3])
