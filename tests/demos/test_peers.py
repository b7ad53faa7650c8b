"""The comparison with CalculiX: mesh, deck, what is read; the run is left to `make peers`."""

from __future__ import annotations

import importlib
from math import pi

import numpy as np
import pytest

from paths import DEMOS

pytestmark = pytest.mark.fem
PRINTED = """

 statistics for slave set SBALL, master set SPLATE and time  0.2000000E-05

   total surface force (fx,fy,fz) and moment about the origin (mx,my,mz)

    0.000000E+00  0.000000E+00 -8.810663E+00  5.032654E-01 -5.093917E-01  0.000000E+00
"""


@pytest.fixture
def module(monkeypatch):
    monkeypatch.syspath_prepend(str(DEMOS))
    monkeypatch.syspath_prepend(str(DEMOS / "peers"))
    return importlib.import_module("calculix_deck")


def volume(part) -> float:
    a, b, c, d = (part.x[part.cells[:, i]] for i in range(4))
    return float(np.sum(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)) / 6)


def test_the_quarters_are_whole_and_touch(module, tmp_path):
    blow = module.Blow()
    plate = module.meshed(blow, "plate", 1.0, 6.0, 0.7)
    ball = module.meshed(blow, "ball", 1.0, 4.0, 0.7)
    assert volume(plate) == pytest.approx(50 * 50 * 6, rel=1e-9)  # positive: C3D10's orientation
    assert volume(ball) == pytest.approx(pi / 3 * 10**3, rel=0.05)  # straight edges cut the sphere
    for part in (plate, ball):
        ends = (part.cells[:, [0, 1, 2, 0, 1, 2]], part.cells[:, [1, 2, 0, 3, 3, 3]])
        middle = (part.x[ends[0]] + part.x[ends[1]]) / 2
        # each middle node lies on its own edge, but for the arrow of the edge on a sphere of 10 mm
        length = np.linalg.norm(part.x[ends[0]] - part.x[ends[1]], axis=2)
        off = np.linalg.norm(middle - part.x[part.cells[:, 4:]], axis=2)
        assert np.all(off < 1.1 * (10 - np.sqrt(100 - length**2 / 4)) + 1e-9)
    path = tmp_path / "job.inp"
    module.deck(blow, plate, ball, path, step=2e-6, duration=8e-5, k=1e6)
    text = path.read_text(encoding="ascii")
    for surface in ("SPLATE", "SBALL"):
        after = text.split(f"*SURFACE, NAME={surface}")[1].split("*SURFACE")[0].splitlines()
        assert len(after) > 2, surface


def test_the_printed_force_is_read(module, tmp_path):
    (tmp_path / "job.dat").write_text(PRINTED, encoding="ascii")
    t, force = module.forces(tmp_path / "job.dat")
    assert t.tolist() == [0.0, 2e-6]
    assert force.tolist() == [0.0, 8.810663]
