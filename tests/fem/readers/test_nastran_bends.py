"""CBEND, and beams whose neutral axis lies beside the shear centre, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.io.deck import Place
from antiosc_decks.nastran_beams import BeamProfiles, arc
from antiosc_decks.nastran_cards import Entry

PLACE = Place("a deck", 1)
R, E = 2.0, 2e11
#: GEOM -> (vector, PBEND's RB and THETAB) of the quarter of a circle about the origin.
GEOMETRY = {1: ((-1.0, 0, 0), ""), 2: ((0, 3.0, 0), ""), 3: ((1.0, 1, 0), f"{R}"),
            4: ((1.0, 1, 0), ",90.")}  # fmt: skip


@pytest.mark.parametrize("kind", GEOMETRY)
def test_the_arc_of_a_bend(kind):
    v, last = GEOMETRY[kind]
    entry = Entry("CBEND", PLACE, ["1", "1", "1", "2", *map(str, v), str(kind)])
    bend = Entry("PBEND", PLACE, ["1", "1", "1.", "1.", "1.", "1.", *last.split(",")])
    ends = np.array([[R, 0, 0], [0, R, 0.0]])
    points, heights = arc(entry, bend, ends, np.array(v, dtype=float), 4)
    angle = np.radians(22.5) * np.arange(1, 4)
    np.testing.assert_allclose(points, R * np.stack([np.cos(angle), np.sin(angle), 0 * angle]).T,
                               atol=1e-12)  # fmt: skip
    angle = np.radians(22.5) * (np.arange(4) + 0.5)
    np.testing.assert_allclose(heights, -np.stack([np.cos(angle), np.sin(angle), 0 * angle]).T,
                               atol=1e-12)  # fmt: skip


def test_a_quarter_ring_bends_as_in_the_textbook(tmp_path):
    """At its tip: π/4 PR³/EI along the radius, (3π/4 − 2) PR³/EI across it, in its plane."""
    I = 1e-6  # noqa: E741
    path = tmp_path / "ring.bdf"
    path.write_text(f"GRID,1,,{R},0.,0.\nGRID,2,,0.,{R},0.\nCBEND,1,1,1,2,-1.,0.,0.,1\n"
                    f"PBEND,1,1,1.,{I},2.-6,1.-6\n"
                    f"MAT1,1,{E},,.3,7800.\nSPC1,1,123456,2\n")  # fmt: skip
    part = ao.read_model(path)
    assert part.mass == pytest.approx(7800 * np.pi / 2 * R, rel=2e-3)
    for direction, factor in (((1.0, 0, 0), np.pi / 4), ((0, 1.0, 0), 3 * np.pi / 4 - 2)):
        k0 = ao.extract(part, ao.Site((R, 0.0, 0.0), direction), n=2).k0
        assert k0 == pytest.approx(E * I / (factor * R**3), rel=4e-3)


def test_a_beam_bends_at_its_shear_centre(tmp_path):
    """A mass on the node of a massless channel: no twist, and the moment of the axial force."""
    L, I, A, N, m = 1.0, 1e-6, 1e-3, 0.1, 5.0  # noqa: E741
    path = tmp_path / "channel.bdf"
    path.write_text(
        f"GRID,1,,0.,0.,0.\nGRID,2,,{L},0.,0.\nCBEAM,1,1,1,2,0.,1.,0.\nCONM2,3,2,,{m}\n"
        f"PBEAM,1,1,{A},{I},2.-6,,1.-8,,\n,,,,,,,,,\n,0.,0.,,,,,,,\n,,,,,{N}\n"
        f"MAT1,1,{E},,.3\nSPC1,1,123456,1\n"
    )
    with pytest.warns(ao.AntioscWarning, match="couples twist with sway"):
        part = ao.read_model(path)
    found = ao.natural_modes(part, 3).frequency
    flexibility = np.array([[L**3 / 3, N * L**2 / 2], [N * L**2 / 2, I * L / A + N**2 * L]])
    values = 1 / np.linalg.eigvalsh(m * flexibility / (E * I))
    wanted = np.sqrt(sorted([*values, 3 * E * 2e-6 / (m * L**3)])) / (2 * np.pi)
    np.testing.assert_allclose(found, wanted, rtol=1e-4)


def test_the_neutral_axis_of_an_angle():
    """Beside the crossing of the middle lines of its legs; I12 = ∫ y z dA."""
    fields = ["1", "1", "", "L", *[""] * 4, "10.", "20.", "1.", "3."]
    one = BeamProfiles(Entry("PBEAML", PLACE, fields))
    A, legs = 10 + 19 * 3, np.array([[10, 0.5, 5.0], [57, 10.5, 1.5]])
    centroid = legs[:, 0] @ legs[:, 1:] / A
    np.testing.assert_allclose(one.neutral[0], centroid - [0.5, 1.5])
    y, z = (legs[:, 1:] - centroid).T
    mixed = legs[:, 0] @ (y * z)
    angle = np.arctan2(2 * mixed, 10 / 12 + 3 * 19**3 / 12 + legs[:, 0] @ (y**2 - z**2)
                       - 10**3 / 12 - 19 * 27 / 12) / 2  # fmt: skip
    assert one.at(0.0).angle == pytest.approx(angle)


def test_the_product_of_inertia_of_a_z():
    """-t a (a + w) (h + t)/2, as MYSTRAN has it."""
    fields = ["1", "1", "", "Z", *[""] * 4, "10.", "1.", "22.", "28."]
    ((_, one),) = BeamProfiles(Entry("PBARL", PLACE, fields)).stations
    assert one.profile.mixed == pytest.approx(-3 * 10 * 11 * 25 / 2)
    assert pytest.approx(2 * 33 + 22) == one.profile.A
