"""Laminates against beams and solids, struck, and bad input."""

from __future__ import annotations

import pytest

pytest.importorskip("dolfinx")


from antiosc.closed_form.plates import SupportedPlate
from mpi import one_and_several
from paths import demo

pytestmark = [pytest.mark.fem, pytest.mark.slow]


SCRIPT = """
import json
import numpy as np
import antiosc as ao
from sheets import flipped, sheet, unsymmetric

mesh = sheet((8, 3), lambda s, t: (
    np.minimum(2 * s, 1.0), 0.4 * t + 0.1 * s**2, np.maximum(2 * s - 1, 0.0)**2), "triangle")
part = ao.Structure(mesh, ao.Laminate(unsymmetric(0.01), axis=lambda x: 1 + 0 * x),
    [ao.Support(lambda x: np.isclose(x[0], 0))])
site = ao.Site((0.52, 0.21, 0), (0, 0.3, 1), radius=0.06, snap=True)
model = ao.extract(part, site, n=4)
numbers = [part.dofs, part.mass, model.k0, model.m_st, *model.omega, *model.m]
x, cells = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.]]), np.array([[0, 1, 2], [1, 2, 3]])
from mpi4py import MPI
from antiosc.fem.platform import compat
few = slice(0 if MPI.COMM_WORLD.rank else 2)
bad = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells[few], x if not few.stop == 0 else x[:0],
    "triangle", 1))
try:
    ao.Structure(bad, ao.Laminate(unsymmetric(0.01)))
except ao.InputError as error:
    print(json.dumps([numbers, str(error)]))
"""


@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    one, two = one_and_several(SCRIPT)
    assert two[0] == pytest.approx(one[0], rel=1e-6)
    assert "opposite normals at 1 edges" in two[1] == one[1]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*deflects by")  # by more than half its thickness
def test_the_demo(tmp_path):
    """Panels of one mass; the plain one as Mindlin's series has it, the sandwich far stiffer."""
    numbers = demo("composite_panel").main(elements=10, n=16, duration=3e-3, out=tmp_path)
    for row in numbers.values():
        assert row["mass"] == pytest.approx(numbers["aluminium"]["mass"], rel=1e-12)
        assert row["impulse"] == pytest.approx(row["momentum"], rel=1e-6)
    t = numbers["aluminium"]["thickness"]
    plate = SupportedPlate(70e9, 0.33, 2700.0, t, 0.4, 0.3)
    exact = plate.mindlin_compliance(0.2, 0.15, radius=t)
    assert numbers["aluminium"]["k0"] == pytest.approx(1 / exact, rel=1e-2)
    assert numbers["sandwich"]["k0"] > 20 * numbers["carbon"]["k0"]
    assert numbers["carbon"]["k0"] > 2 * numbers["aluminium"]["k0"]
    assert (tmp_path / "composite_panel.png").stat().st_size > 0
