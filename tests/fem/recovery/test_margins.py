"""Margins of safety: against closed forms of bending, of off-axis plies and of shear in plates."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts
import sheets
from antiosc.base.stresses import extreme_principal
from antiosc.fem.fields import mesh_fields
from antiosc.fem.fields.mesh_fields import interior_angle
from antiosc.fem.recovery import Place
from antiosc.results.pictures import deformed
from static_loads import held

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


# --- Stresses at surfaces and their estimated errors: a hole (Kirsch), corners, edges of suppor


STEEL = ao.Solid(210e9, 0.3, 7850.0, plane="stress")


def kirsch(x: np.ndarray, a: float, stress: float) -> np.ndarray:
    """Displacements (n, 2) around a hole under `stress` along x, plane stress (G. Kirsch, 1898)."""
    r, t = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
    G, k, s = 210e9 / 2.6, (3 - 0.3) / 1.3, a / r
    u = (k + 1) * np.cos(t) / s + 2 * s * ((1 + k) * np.cos(t) + np.cos(3 * t))
    v = (k - 3) * np.sin(t) / s + 2 * s * ((1 - k) * np.sin(t) + np.sin(3 * t))
    u, v = u - 2 * s**3 * np.cos(3 * t), v - 2 * s**3 * np.sin(3 * t)
    return stress * a / (8 * G) * np.stack([u, v], axis=1)


@pytest.mark.slow
def test_the_stress_at_a_hole_is_three_times_that_far_away_within_its_estimated_error():
    """The exact displacements at the nodes of quadratic cells: what is left is recovery."""
    found = []
    for n in (8, 16):
        ring = sheets.sheet(
            n, lambda s, t: ((1 + s) * np.cos(t * np.pi / 2), (1 + s) * np.sin(t * np.pi / 2)),
            order=2,
        )  # fmt: skip
        mesh = ao.read_mesh(ring.dolfinx, gdim=2) if ring.gdim == 3 else ring
        part = ao.Structure(mesh, STEEL)
        space = part.form.space
        shapes = kirsch(space.tabulate_dof_coordinates()[:, :2], 1.0, 1.0).reshape(-1, 1)
        nodes, _, six = mesh_fields.tensors_of_part(part, shapes, "stress", Place(), [0])
        x = part.mesh.dolfinx.geometry.x
        top = np.argmin(np.linalg.norm(x - (0, 1, 0), axis=1))
        value = float(extreme_principal(six[nodes == top, :, 0])[0])
        error = mesh_fields.jumps(part, shapes, np.ones((len(x), 1)))[top]
        assert abs(value - 3.0) < 3 * error < 1.0
        found.append((value, error))
    (coarse, more), (fine, less) = found
    assert abs(fine - 3) < 0.4 * abs(coarse - 3) < 0.1
    assert less < 0.5 * more


def ell(n: int) -> ao.Structure:
    """An L of squares, held at the end of one leg; its corner is at (1, 1)."""
    mesh = parts.plate((2 * n, 2 * n), (2.0, 2.0))
    import dolfinx

    kept = dolfinx.mesh.locate_entities(
        mesh.dolfinx, 2, lambda x: (x[0] < 1 + 1e-9) | (x[1] < 1 + 1e-9)
    )
    cut = ao.read_mesh(dolfinx.mesh.create_submesh(mesh.dolfinx, 2, kept)[0])
    return ao.Structure(cut, STEEL, [ao.Support(lambda x: x[1] > 2 - 1e-9)])


def test_a_re_entrant_corner_is_told_and_its_stress_grows_with_the_mesh():
    largest = []
    for n in (3, 6):
        part, hit = held(ell(n), ao.Site((2.0, 0.5), (0, -1), radius=0.4), 1e3)
        peak = ao.peak_field(part, hit, body="part")
        assert interior_angle(part, np.array([1.0, 1.0, 0.0])) == pytest.approx(270)
        assert "corner of 270" in peak.doubt
        largest.append(peak.values.max())
    assert largest[1] > 1.2 * largest[0]


def test_a_contact_that_yields_is_told_beside_the_margin():
    """The pressure is Hertz's of `contact_stress`; a soft blow and a part of rubber say nothing."""
    shell = ao.Shell(210e9, 0.3, 7850.0, thickness=8e-3, yield_strength=355e6)
    mesh = ao.read_mesh(parts.plate((8, 4), (0.2, 0.1)).dolfinx, gdim=3)
    part = ao.Structure(mesh, shell, [ao.Support(lambda x: x[0] < 1e-9)])
    model = ao.extract(part, ao.Site((0.1, 0.05, 0.0), (0, 0, -1)), n=20)
    for speed, yields in ((2.0, True), (1e-4, False)):
        ball = ao.Sphere(0.015, 210e9, 0.3, 7850.0, velocity=speed)
        hit = ao.simulate(model, ball, ball.hertz(210e9, 0.3), 3e-4)
        margin = ao.peak_field(part, hit).margin()
        pressure = ao.contact_stress(ball, hit.peak_force, 210e9, 0.3).pressure
        assert (pressure > 1.6 * 355e6) == yields
        assert bool(margin.contact) == yields
        assert ("Thornton" in margin.sentence) == yields
        if yields:
            assert f"{1e-9 * pressure:.2f} GPa" in margin.sentence


@pytest.mark.parametrize("criterion", ["tsai_hill", "tsai_wu"])
def test_at_each_strength_the_exposure_is_1(criterion):
    for entry, sizes in (((0, 0), (1500, -1200)), ((1, 1), (40, -200)), ((0, 1), (70, -70))):
        for size in sizes:
            stress = np.zeros((3, 3))
            stress[entry] = stress[entry[::-1]] = size * 1e6
            assert getattr(PLY, criterion)(stress) == pytest.approx(1.0)
            assert getattr(PLY, criterion)(stress / 3) == pytest.approx(1 / 3)


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_interior_angles_of_a_box(cell):
    box = ao.Structure(parts.box((2, 2, 2), (1, 1, 1), cell), ao.Solid(1e9, 0.3, 1e3))
    corner = interior_angle(box, np.array([1.0, 1.0, 1.0]))
    assert corner == pytest.approx(90 if cell == "hexahedron" else 180)  # a diagonal of a face
    assert interior_angle(box, np.array([0.5, 0.5, 1.0])) == pytest.approx(180)
    assert interior_angle(box, np.array([0.5, 0.5, 0.5])) == 0


@pytest.mark.slow
def test_sheets_tell_that_their_error_is_not_known():
    shell = ao.Shell(210e9, 0.3, 7850.0, thickness=5e-3)
    mesh = ao.read_mesh(parts.plate((4, 2), (0.2, 0.1)).dolfinx, gdim=3)
    part = ao.Structure(mesh, shell, [ao.Support(lambda x: x[0] < 1e-9)])
    part, hit = held(part, ao.Site((0.15, 0.05, 0.0), (0, 0, -1)), 100.0)
    peak = ao.peak_field(part, hit, body="part")
    assert peak.mesh_error is None
    assert "not estimated" in peak.doubt
    assert peak.doubt in peak.summary()


def test_the_worst_of_two_materials_is_the_one_nearest_to_its_strength():
    """A bar under tension: equal stress, the half with the lower yield strength is worse."""
    mesh = parts.box(
        (4, 1, 1), (0.4, 0.1, 0.1),
        groups={"soft": (3, lambda x: x[0] < 0.2 + 1e-9), "hard": (3, lambda x: x[0] > 0.2 - 1e-9)},
    )  # fmt: skip
    soft, hard = (ao.Solid(70e9, 0.0, 2700.0, yield_strength=s) for s in (100e6, 900e6))
    part = ao.Structure(mesh, {"soft": soft, "hard": hard}, [ao.Support(lambda x: x[0] < 1e-9)])
    with pytest.warns(ao.AntioscWarning):
        part, hit = held(part, ao.Site((0.4, 0.05, 0.05), (1, 0, 0), radius=0.2), 1e4)
    peak = ao.peak_field(part, hit, body="part")
    worst = peak.margin()
    assert worst.strength == 100e6
    np.testing.assert_allclose(peak.exposure[peak.points[:, 0] < 0.15], 1e6 / 100e6, rtol=0.05)
