"""The comparison with CalculiX: meshes, decks, what is read; `make bench-peers` runs it."""

from __future__ import annotations

import importlib
from math import pi

import numpy as np
import pytest

from paths import BENCHMARKS

PRINTED = """

 statistics for slave set SBALL, master set SPART and time  0.2000000E-05

   total surface force (fx,fy,fz) and moment about the origin (mx,my,mz)

    0.000000E+00  3.000000E+00 -8.810663E+00  5.032654E-01 -5.093917E-01  0.000000E+00
"""

pytestmark = pytest.mark.fem


@pytest.fixture
def bodies(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.syspath_prepend(str(BENCHMARKS / "peers"))
    return importlib.import_module("bodies")


@pytest.fixture
def decks(bodies):
    return importlib.import_module("calculix_deck")


def volume(body) -> float:
    a, b, c, d = (body.x[body.cells[:, i]] for i in range(4))
    return float(np.sum(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)) / 6)


def middles_lie_between_their_ends(body, radius: float) -> None:
    """But for the arrow of the edge on a surface of this radius."""
    ends = (body.cells[:, [0, 1, 2, 0, 1, 2]], body.cells[:, [1, 2, 0, 3, 3, 3]])
    middle = (body.x[ends[0]] + body.x[ends[1]]) / 2
    length = np.linalg.norm(body.x[ends[0]] - body.x[ends[1]], axis=2)
    off = np.linalg.norm(middle - body.x[body.cells[:, 4:]], axis=2)
    arrow = radius - np.sqrt(np.maximum(radius**2 - length**2 / 4, 0.0))
    assert np.all(off < 1.1 * arrow + 1e-9)


@pytest.mark.slow
def test_the_quarters_are_whole_and_touch(bodies, decks, tmp_path):
    blow = bodies.plate(0.6)
    assert volume(blow.part) == pytest.approx(50 * 50 * 6, rel=1e-9)  # positive: as C3D10 has it
    assert volume(blow.ball) == pytest.approx(pi / 3 * 10**3, rel=0.05)  # straight edges cut it
    for body in (blow.part, blow.ball):
        middles_lie_between_their_ends(body, 10.0)
        assert sum(map(len, body.faces())) > 1
    path = tmp_path / "job.inp"
    for explicit in (False, True):
        decks.deck(blow, path, step=2e-6, duration=8e-5, k=1e6, explicit=explicit)
        text = path.read_text(encoding="ascii")
        for surface in ("SPART", "SBALL"):
            after = text.split(f"*SURFACE, NAME={surface}")[1].split("*")[0].splitlines()
            assert len(after) > 2, surface
        assert ("EXPLICIT" in text) == explicit
        assert ("DIRECT" in text) != explicit


def test_the_printed_force_is_read(decks, tmp_path):
    (tmp_path / "job.dat").write_text(PRINTED, encoding="ascii")
    t, force = decks.forces(tmp_path / "job.dat", np.array([0.0, 0.6, 0.8]))
    assert t.tolist() == [0.0, 2e-6]
    assert force == pytest.approx([0.0, 0.8 * 8.810663 - 1.8])
