"""Shells on two ranks: the same numbers as on one."""

from __future__ import annotations

import pytest

from mpi import one_and_several

pytestmark = [pytest.mark.fem, pytest.mark.mpi]

SCRIPT = """
import json
import numpy as np
import antiosc as ao
from sheets import sheet

numbers = {}
for cell, order in (("triangle", 1), ("quadrilateral", 2)):
    # an L: two strips on a common edge, one of them curved
    mesh = sheet((8, 3), lambda s, t: (
        np.minimum(2 * s, 1.0), 0.4 * t + 0.1 * s**2, np.maximum(2 * s - 1, 0.0)**2), cell, order)
    held = [ao.Support(lambda x: np.isclose(x[0], 0))]
    for supports in (held, []):
        part = ao.Structure(mesh, ao.Shell(70e9, 0.3, 2700.0, 0.01), supports)
        site = ao.Site((0.52, 0.21, 0), (0, 0.3, 1), radius=0.06, snap=True)
        model = ao.extract(part, site, n=4, method="modes")
        numbers[f"{cell} {len(supports)}"] = [
            part.dofs, part.mass, part.rigid_modes.shape[1], model.k0, model.m_st,
            *model.omega, *model.m]
print(json.dumps(numbers))
"""


def test_two_ranks_find_what_one_finds():
    one, two = one_and_several(SCRIPT)
    for case, numbers in one.items():
        assert two[case] == pytest.approx(numbers, rel=1e-6), case
