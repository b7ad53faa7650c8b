"""Margins of safety: against closed forms of bending, of off-axis plies and of shear in plates."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
import sheets
from antiosc.results.pictures import deformed
from static_loads import held

pytestmark = pytest.mark.fem

YIELD = 250e6


@pytest.fixture(scope="module")
def strip():
    """A cantilever strip, as a plane part: 0.2 m long, 20 mm high, 10 mm thick."""
    solid = ao.Solid(210e9, 0.0, 7850.0, plane="stress", thickness=0.01, yield_strength=YIELD)
    part = ao.Structure(parts.plate((20, 4), (0.2, 0.02)), solid, [ao.Support("left")])
    return held(part, ao.Site((0.2, 0.01), (0, -1), radius=6e-3), 100.0)


def test_the_margin_of_a_cantilever_is_that_of_bending_at_its_surface(strip):
    part, hit = strip
    expected = 6 * 100.0 * 0.2 / (0.01 * 0.02**2)  # F L/W at the clamp
    peak = ao.peak_field(part, hit, body="part")
    worst = peak.margin()
    assert worst.value == pytest.approx(expected, rel=0.02)
    assert worst.point[0] == pytest.approx(0.0, abs=1e-9)
    assert (worst.criterion, worst.strength) == ("yield", YIELD)
    assert worst.margin == pytest.approx(YIELD / worst.value - 1)
    assert not worst.reached
    np.testing.assert_allclose(peak.exposure, peak.values / YIELD)
    assert "yield is not reached" in peak.summary()
    share = ao.peak_field(part, hit, "yield", body="part")
    np.testing.assert_allclose(share.values, peak.exposure, rtol=1e-9)
    assert share.margin().value == pytest.approx(worst.value)


def test_without_a_strength_there_is_no_margin(strip):
    part, hit = strip
    with pytest.raises(ao.InputError, match="yield_strength"):
        ao.peak_field(part, hit, "displacement", body="part").margin()
    with pytest.raises(ao.InputError, match="Strengths"):
        ao.peak_field(part, hit, "tsai_wu", body="part")


#: Strengths of carbon and epoxy, Pa.
PLY = ao.Strengths(X_t=1500e6, X_c=1200e6, Y_t=40e6, Y_c=200e6, S=70e6, interlaminar=60e6)


def test_tsai_hill_of_an_off_axis_ply_is_the_closed_form():
    """Uniaxial strength σ: 1/σ² = c⁴/X² − c²s²/X² + s⁴/Y² + c²s²/S² (Azzi, Tsai 1965)."""
    for degrees in (0, 15, 30, 60, 90):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        stress = np.zeros((3, 3))
        stress[:2, :2] = [[c * c, -c * s], [-c * s, s * s]]  # 1 Pa along x, in the ply's axes
        X, Y, S = PLY.X_t, PLY.Y_t, PLY.S
        squared = (c**4 - c**2 * s**2) / X**2 + s**4 / Y**2 + c**2 * s**2 / S**2
        assert PLY.tsai_hill(1e6 * stress) == pytest.approx(1e6 * squared**0.5)


@pytest.mark.slow
def test_plies_of_a_cantilever_fail_in_compression_and_delaminate_in_the_middle():
    """A strip of 0° plies: σ1 = 6 F L/(b h²) at the clamp, τ13 = 3 F/(2 b h) in the middle."""
    b, h, L, F = 0.02, 4e-3, 0.18, 10.0
    layer = ao.Layer(
        **{"E1": 140e9, "E2": 9e9, "nu12": 0.0, "G12": 5e9, "G13": 5e9, "G23": 3e9},
        rho=1600.0, thickness=h / 2, strength=PLY,
    )  # fmt: skip
    mesh = sheets.sheet((20, 2), lambda s, t: (0.2 * s, b * t, 0 * s), "quadrilateral")
    end = ao.Support(lambda x: x[0] < 1e-9)
    part = ao.Structure(mesh, ao.Laminate([layer] * 2), [end])
    part, hit = held(part, ao.Site((L, b / 2, 0), (0, 0, -1), radius=6e-3), F)
    hill = ao.peak_field(part, hit, "tsai_hill", body="part")
    worst = hill.margin()
    assert worst.exposure == pytest.approx(6 * F * L / (b * h**2) / PLY.X_c, rel=0.02)
    assert (worst.layer, worst.surface) == (0, "bottom")  # it is pressed down: compression below
    shear = ao.peak_field(part, hit, "delamination", body="part")
    k = np.argmin(np.linalg.norm(shear.points - (L / 2, b / 2, 0), axis=1))
    assert shear.values[k] == pytest.approx(1.5 * F / (b * h) / PLY.interlaminar, rel=0.02)
    assert "layer 0" in hill.summary()
    with pytest.raises(ao.InputError, match="yield_strength"):
        ao.peak_field(part, hit, "yield", body="part")


@pytest.mark.parametrize("round_", [False, True])
def test_stress_in_the_outline_of_a_beam_is_that_of_oblique_bending(round_):
    """σ = M_y z/I_y + M_z y/I_z at a corner, √(M_y² + M_z²) r/I on a circle, at the clamp."""
    h, b = 0.02, 0.01
    section = ao.Section.circle(h) if round_ else ao.Section.rectangle(b, h)
    mesh = parts.line(0.5, 20, (1.0, 0.0, 0.0))
    beam = ao.Beam(210e9, 0.3, 7850.0, section, orientation=(0, 1, 0))
    d = np.array([0.0, 0.6, 0.8])
    part, hit = held(ao.Structure(mesh, beam, [ao.Support("left")]), ao.Site((0.5, 0, 0), d), 20.0)
    My, Mz = 20.0 * 0.5 * d[2], 20.0 * 0.5 * d[1]
    corner = My * b / 2 / section.side + Mz * h / 2 / section.I
    expected = 10.0 * h / 2 / section.I if round_ else corner
    values = ao.peak_field(part, hit, body="part").values
    assert values.max() == pytest.approx(expected, rel=6e-3 if round_ else 1e-6)


def test_pictures_show_the_stress_and_mark_its_worst_point(strip, tmp_path):
    part, hit = strip
    peak = ao.peak_field(part, hit, body="part")
    found = deformed(part, hit, 0.0, "part", "von_mises")
    assert found.values.max() == pytest.approx(1e-6 * peak.values.max(), rel=1e-6)
    assert "MPa" in found.label
    assert np.ptp(found.moved - found.points, axis=0)[1] > 0.05 * 0.2
    path = peak.plot(tmp_path / "peak.png", view=(90, -90))
    assert path.stat().st_size > 5000
