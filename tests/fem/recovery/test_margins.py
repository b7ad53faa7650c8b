"""Margins of safety, and strains, stresses and section forces of given displacement fields."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
import sheets
from antiosc.base.stresses import extreme_principal
from antiosc.base.texts import engineering
from antiosc.engine.contact.half_space import hertz_stresses, spread_difference
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.structure.structure import on_mesh
from antiosc.fields.deformed import deformed
from antiosc.fields.margin import Margin, Zones, margin_of, on_part
from antiosc.impact.histories.verdict import CONTACT_RADII, YieldingZone, yielding_zones
from antiosc.recovery import mesh_fields
from antiosc.recovery.place import Place
from antiosc.recovery.sharp_edges import interior_angle
from antiosc.recovery.tensors import PointsInCells, SheetAxes, evaluator, middle_strains
from sheets import sheet as mapped
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
        assert "leave_out" in peak.doubt
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
        assert margin.contact == yields
        assert ("apart from the contact, which itself yields. The" in margin.sentence) == yields
        assert not len(margin.beyond)  # a sheet has no zone of the contact


def test_the_margin_leaves_out_balls_that_are_given(strip):
    """Without the clamp's surroundings it is that of bending at the next section, F (L - x)/W."""
    part, hit = strip
    peak = ao.peak_field(part, hit, body="part", leave_out=[(0.0, 0.01, 0.0, 0.053)])
    worst = peak.margin()
    assert worst.value == pytest.approx(6 * 100.0 * (0.2 - 0.06) / (0.01 * 0.02**2), rel=0.02)
    assert worst.point[0] == pytest.approx(0.06)
    assert worst.nearer.value == ao.peak_field(part, hit, body="part").margin().value
    assert worst.sentence.startswith("yield is not reached outside the balls of leave_out")
    np.testing.assert_array_equal(peak.points[peak.judged], worst.point)
    whole = ao.peak_field(part, hit, body="part", leave_out=[(0.0, 0.0, 0.0, 1.0)]).margin()
    assert whole.value == worst.nearer.value
    assert not len(whole.beyond)
    with pytest.raises(ao.InputError, match="leave_out"):
        ao.peak_field(part, hit, body="part", leave_out=[(0.0, 0.01, 0.0)])


def hit_zone(hit):
    """The zone about the contact of a hit, on the part."""
    (zone,) = yielding_zones(hit.contact_histories, hit.name_of("structure"))
    return zone


def test_a_solid_is_judged_beyond_three_radii_of_a_contact_that_yields():
    """The largest value of the nodes that are farther, found by hand."""
    alu = ao.material("aluminium 6082-T6")
    site, patch = np.array([0.07, 0.02, 0.02]), 0.01
    part = ao.Structure(parts.box((10, 4, 2), (0.1, 0.04, 0.02)), alu, [ao.Support("left")])
    model = ao.extract(part, ao.Site(site, (0, 0, -1), radius=patch), n=12)
    for speed, yields in ((3.0, True), (1e-3, False)):
        ball = ao.Sphere(0.01, material="bearing steel 100Cr6", velocity=speed)
        hit = ao.simulate(model, ball, duration=4e-4)
        peak = ao.peak_field(part, hit)
        margin = peak.margin()
        contact = 3 * hit.dent.radius if yields else 0.0
        far = np.linalg.norm(peak.points - site, axis=1) > contact
        assert far.sum() < len(far)
        assert (hit.dent is not None) == margin.contact == yields
        x = peak.points - site
        radii, r = (contact / 3 or 1.0, patch), np.hypot(x[:, 0], x[:, 1])
        spread = yields * spread_difference(hit.peak_force, radii, alu.nu, r, -x[:, 2])
        k = int(np.argmax(np.where(far, peak.values + spread, 0.0)))
        assert margin.value == pytest.approx(peak.values[k], rel=1e-12)
        assert margin.spread == pytest.approx(spread[k], rel=1e-9)
        stress = max((peak.values + spread)[k], hit_zone(hit).edge_stress if yields else 0.0)
        assert margin.exposure == pytest.approx(stress / alu.yield_strength)
        assert ("reached outside 3 radii of the contact (" in margin.sentence) == yields
        assert ("by Hertz's pressure on" in margin.sentence) == yields == margin.at_edge
        if yields:
            np.testing.assert_allclose(margin.beyond, [[*site, contact]])
            unknown = hit_zone(hit)._replace(push=None).spread_error(peak.points)
            assert (unknown >= spread - 1e-3 * spread.max()).all()
            near = peak.values[~far].max()
            assert margin.nearer.value == pytest.approx(near, rel=1e-12)
            assert ("; nearer, up to" in margin.sentence) == (near > margin.value)


def test_a_coarse_mesh_has_hertz_s_stress_at_the_edge_of_what_is_left_out():
    """Three radii below the contact, where no node is: the closed form on the axis."""
    alu = ao.material("aluminium 6082-T6")
    site = np.array([0.05, 0.05, 0.1])
    block = parts.box((3, 3, 3), (0.1, 0.1, 0.1))
    part = ao.Structure(block, alu, [ao.Support("-z")])
    model = ao.extract(part, ao.Site(site, (0, 0, -1), radius=0.034), n=4)
    ball = ao.Sphere(0.005, material="bearing steel 100Cr6", velocity=1.0)
    hit = ao.simulate(model, ball, duration=1e-4)
    zone = hit_zone(hit)
    z = CONTACT_RADII
    nu = alu.nu
    along = -1 / (1 + z**2)
    across = -(1 + nu) * (1 - z * np.arctan2(1, z)) - along / 2
    pressure = 1.5 * hit.peak_force / np.pi / zone.radii[0] ** 2
    assert zone.edge_stress == pytest.approx(pressure * abs(along - across), rel=1e-6)
    peak = ao.peak_field(part, hit)
    margin = peak.margin()
    assert margin.at_edge
    assert margin.exposure == pytest.approx(zone.edge_stress / alu.yield_strength)
    assert peak.largest_mesh_error is None
    assert "at 3 radii of the contact by Hertz's pressure" in margin.sentence
    away = np.linalg.norm(peak.points - site, axis=1) > CONTACT_RADII * zone.radii[0]
    of_mesh = f"farther away, by the mesh, up to {engineering(peak.values[away].max(), 'Pa')} at"
    assert of_mesh in margin.sentence
    assert "too coarse" not in margin.sentence  # the mesh's own may be anywhere


def test_the_largest_stress_by_the_mesh_is_told_where_another_place_decides():
    """A node under the patch, whose stress a smaller one raises, has less than one far away."""
    points = np.array([[0.01, 0.0, 0.0], [0.05, 0.0, 0.0]])
    zones = SimpleNamespace(
        away=None, balls=[], spread_error=lambda at: np.where(at[:, 0] < 0.02, 8e7, 0.0)
    )
    stresses, strengths = np.array([2e7, 7.8e7]), np.full(2, 2.35e8)
    times, places = np.array([1e-4, 2e-4]), [Place()] * 2
    margin = margin_of("yield", stresses, strengths, points, times, places, zones)
    assert (margin.value, margin.stress) == (2e7, 1e8)
    margin = dataclasses.replace(margin, edge_stress=1.16e8)
    assert "farther away, by the mesh, up to 78.0 MPa at (50, 0, 0) mm, 200 µs)" in margin.sentence


@pytest.mark.parametrize("radii", [3.0, 12.0])
def test_a_thin_part_has_no_stress_of_a_half_space_at_the_edge(radii):
    """Where the mesh does not resolve the contact, the margin says so in its place."""
    alu = ao.material("aluminium 6082-T6")

    def struck(height):
        plate = parts.box((6, 6, 2), (0.1, 0.1, height))
        part = ao.Structure(plate, alu, [ao.Support("-z")])
        site = np.array([0.05, 0.05, height])
        model = ao.extract(part, ao.Site(site, (0, 0, -1), radius=0.017), n=4)
        ball = ao.Sphere(0.005, material="bearing steel 100Cr6", velocity=1.0)
        hit = ao.simulate(model, ball, duration=1e-4)
        return part, hit

    height = radii * hit_zone(struck(0.002)[1]).radii[0]
    part, hit = struck(height)
    thickness = height / hit_zone(hit).radii[0]
    margin = ao.peak_field(part, hit).margin()
    is_thin = thickness < 6
    assert is_thin == (radii == 3.0)
    assert (margin.edge_stress == 0.0) == is_thin
    assert margin.thin == pytest.approx(thickness if is_thin else np.inf)
    assert (f"is {int(10 * thickness) / 10:g} contact radii thick" in margin.sentence) == is_thin
    radius = hit_zone(hit).radii[0]
    mean = hit.peak_force / np.pi / radius**2  # of the axis, where a half-space bears most
    z = min(thickness, CONTACT_RADII)
    along = -1 / (1 + z**2)
    across = -(1 + alu.nu) * (1 - z * np.arctan2(1, z)) - along / 2
    of_axis = 1.5 * mean * abs(along - across)
    if is_thin:  # three radii are within it
        assert margin.thin_stress == pytest.approx(of_axis, rel=0.05)
        assert margin.stresses[1] >= 1.1 * margin.thin_stress
    assert (margin.thin_stress == 0.0) != is_thin
    assert ("This verdict may change with the mesh" in margin.sentence) == is_thin
    assert margin.needed_cells == (pytest.approx(radius) if is_thin else None)


def test_a_part_that_is_nearly_thick_enough_is_not_told_to_be_as_thick():
    margin = ao.results.Margin("yield", 0.9 * YIELD, YIELD, np.zeros(3), 0.0, contact=True)
    beyond = np.array([[0.0, 0.0, 0.0, 3e-3]])
    sentence = dataclasses.replace(margin, beyond=beyond, thin=5.97).sentence
    assert "is 5.9 contact radii thick there, too thin (less than 6)" in sentence


def _pascals(share: float) -> str:
    return engineering(share * YIELD, "Pa")


def test_a_margin_within_its_error_by_the_mesh_is_undecided():
    margin = ao.results.Margin("yield", 0.9 * YIELD, YIELD, np.zeros(3), 0.0)
    assert margin.sentence.startswith("yield is not reached")
    undecided = dataclasses.replace(margin, mesh_error=0.2 * YIELD)
    range_told = (
        f"stress {_pascals(0.7)} to {_pascals(1.1)} with its errors, strength {_pascals(1)}"
    )
    assert undecided.sentence.startswith(f"yield may be reached ({range_told}): the largest")
    assert not undecided.reached
    above = dataclasses.replace(undecided, value=1.19 * YIELD)
    assert above.sentence.startswith("yield may be reached")
    certain = dataclasses.replace(undecided, value=1.21 * YIELD)
    assert certain.sentence.startswith("yield is reached")


@pytest.mark.parametrize(
    ("stress", "verdict"), [(0.79, "is not"), (0.81, "may be"), (1.29, "may be"), (1.31, "is")]
)
def test_the_range_of_a_yield_strength_belongs_to_the_verdict(stress, verdict):
    margin = ao.results.Margin(
        "yield", stress * YIELD, YIELD, np.zeros(3), 0.0, strength_range=(0.8 * YIELD, 1.3 * YIELD)
    )
    assert margin.sentence.startswith(f"yield {verdict} reached")
    assert "taken as exact" not in margin.sentence
    exact = dataclasses.replace(margin, strength_range=None).sentence
    assert f"strength {engineering(YIELD, 'Pa')} (taken as exact: no range was given)" in exact
    low, high = (engineering(share * YIELD, "Pa") for share in (0.8, 1.3))
    assert f"{engineering(YIELD, 'Pa')} ({low} to {high})" in margin.sentence
    lowest = dataclasses.replace(margin, strength_range=None, strength=0.8 * YIELD)
    assert margin.least_margin == pytest.approx(lowest.margin)
    alone = f"margin of safety {1 / stress - 1:.3g} against {engineering(YIELD, 'Pa')}"
    assert f"{alone}, {0.8 / stress - 1:.3g} against {low}" in margin.sentence
    assert exact.endswith(alone)


def test_a_peak_takes_the_range_of_its_material():
    strengths = {"yield_strength": YIELD, "yield_range": (0.9 * YIELD, 1.2 * YIELD)}
    steel = ao.Solid(210e9, 0.3, 7850.0, **strengths)
    mesh = ao.box_mesh((0.1, 0.02, 0.01), size=0.01)
    part = ao.Structure(mesh, steel, [ao.Support("-x")])
    model = ao.extract(part, ao.Site((0.09, 0.01, 0.01), (0, 0, -1), radius=0.012), n=6)
    hit = ao.simulate(model, ao.RigidMass(0.1, 0.1), ao.Linear(1e6), duration=2e-3)
    margin = ao.peak_field(part, hit).margin()
    assert margin.strength_range == (0.9 * YIELD, 1.2 * YIELD)


#: A square plate of 200 × 200 × 2 mm of which the edges are held, struck in its middle.
SQUARE = {"a": 0.2, "thickness": 2e-3, "middle": (0.103, 0.098, 0.0)}


@functools.cache
def struck_plate(size: float, fine: float, radius: float = 2e-3) -> tuple[ao.History, Margin]:
    """(impact, margin) of a ball on the plate; `fine`: size of the cells within 12 mm of it."""
    a = SQUARE["a"]
    spans = ((0, 0.09, size), (0.09, 0.12, fine), (0.12, a - size / 2, size), (a, a + size, size))
    edges = np.unique(np.round(np.concatenate([np.arange(*span) for span in spans]) / a, 6))
    n = len(edges) - 1

    def of_plate(s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, ...]:
        x, y = (a * np.interp(u, np.linspace(0, 1, n + 1), edges) for u in (s, t))
        return x, y, 0 * x

    shell = ao.Shell(210e9, 0.3, 7850.0, thickness=SQUARE["thickness"], yield_strength=1e9)
    on_edge = ao.Support(lambda x: (abs(x[:2] - 0.1) > 0.1 - 1e-9).any(axis=0), ("x", "y", "z"))
    part = ao.Structure(mapped(n, of_plate), shell, [on_edge])
    site = ao.Site(SQUARE["middle"], (0, 0, -1), radius=radius)
    ball = ao.Sphere(0.01, material="bearing steel 100Cr6", velocity=1.5)
    hit = ao.simulate(ao.extract(part, site, n=20), ball, duration=1e-4)
    margin = ao.peak_field(part, hit).margin()
    assert margin is not None
    return hit, margin


@pytest.mark.slow
def test_the_stress_of_a_sheet_does_not_depend_on_the_patch():
    """The bending that the contact has beyond the patch is added; patches of one and two
    thicknesses alone differ by F·3(1 + ν)/(2πt²)·ln 2.
    """
    (one, narrow), (other, wide) = (struck_plate(0.02, 2e-3, radius) for radius in (2e-3, 4e-3))
    force = other.peak_force / one.peak_force
    assert force == pytest.approx(1.0, rel=0.05)
    logarithm = 3 * one.peak_force * 1.3 / (2 * np.pi * 4e-6) * np.log(2)
    assert narrow.value - wide.value / force == pytest.approx(logarithm, rel=0.1)
    assert wide.stress / force == pytest.approx(narrow.stress, rel=0.02)
    assert narrow.spread > 0.2 * narrow.stress


@pytest.mark.parametrize("size", [0.03, 0.02, 0.01])
@pytest.mark.slow
def test_the_bar_of_a_stress_of_a_sheet_holds_that_of_cells_that_resolve_the_patch(size):
    _, fine = struck_plate(0.02, 2e-3)
    _, coarse = struck_plate(size, size)
    assert coarse.stresses[0] < fine.stress < coarse.stresses[1]
    assert fine.stresses[1] < 1.1 * fine.stress


@pytest.mark.parametrize("spread", [0.0, 1e-4, 0.1])
def test_a_stress_is_told_once_and_its_uncertain_part_where_it_shows(spread):
    ball = np.array([[0.0, 0.0, 0.0, 3.2e-3]])
    margin = ao.results.Margin(
        "yield", 0.4 * YIELD, YIELD, np.zeros(3), 0.0, contact=True, beyond=ball,
        spread=0.4 * YIELD * spread,
    )  # fmt: skip
    assert margin.sentence.count(engineering(margin.stress, "Pa")) == 1
    uncertain = f"({engineering(margin.spread, 'Pa')} of it for the radius of the patch)"
    assert (uncertain in margin.sentence) == (spread == 0.1)
    for value, share in ((0.8, 0.27), (1.2, 0.27), (0.5, 0.27), (2.0, 0.27), (2.0, 3.3)):
        judged = dataclasses.replace(margin, value=value * YIELD, force_error=share)
        is_open = value * (1 - share) < 1 <= value * (1 + share)
        assert ("may be" in judged.sentence) == is_open


@pytest.mark.parametrize(
    ("cause", "error"),
    [
        ("mesh at this place", {"mesh_error": 0.6 * YIELD}),
        ("mesh at a place", {"others": (0.0, 0.9 * YIELD)}),
        ("hollow", {"hollow_stress": 0.5 * YIELD}),
        ("thickness", {"thin_stress": 0.9 * YIELD}),
        ("force", {"force_error": 0.9}),
    ],
)
def test_the_widest_cause_is_that_without_which_the_largest_stress_falls_most(cause, error):
    others = {"mesh_error": 0.1 * YIELD, "hollow_stress": 0.05 * YIELD, "force_error": 0.1}
    others |= {"others": (0.0, 0.45 * YIELD), "thin_stress": 0.42 * YIELD}
    base = ao.results.Margin("yield", 0.4 * YIELD, YIELD, np.zeros(3), 0.0, contact=True, **others)
    wide = dataclasses.replace(base, **error)
    assert cause in wide.widest
    without = {
        name: dataclasses.replace(wide, **{name: (0.0, 0.0) if name == "others" else 0.0})
        for name in others
    }
    (name,) = error
    assert min(without, key=lambda one: without[one].stresses[1]) == name


def test_a_stress_by_hertz_has_the_error_of_the_mesh_s_own_too():
    """A place of the mesh with nearly as much may have more, and another one within its error."""
    ball = np.array([[0.0, 0.0, 0.0, 3.2e-3]])
    own = 0.95 * YIELD, YIELD, np.array([0.1, 0.0, 0.0]), 0.0
    margin = ao.results.Margin("yield", *own, contact=True, beyond=ball, edge_stress=0.98 * YIELD)
    assert margin.at_edge
    margin = dataclasses.replace(margin, mesh_error=0.1 * YIELD)
    assert margin.stresses == pytest.approx((0.9 * 0.98 * YIELD, 1.1 * 0.98 * YIELD))
    rough = dataclasses.replace(margin, mesh_error=0.3 * YIELD)
    assert rough.stresses == pytest.approx((0.9 * 0.98 * YIELD, 1.25 * YIELD))
    among = dataclasses.replace(rough, others=(0.97 * YIELD, 1.4 * YIELD), force_error=0.1)
    assert among.stresses == pytest.approx((0.9 * 0.97 * YIELD, 1.1 * 1.4 * YIELD))


def test_the_spread_of_a_force_is_that_of_two_circles_on_a_half_space():
    """The closed forms on the axis, on the surface (Johnson, 3.4) and of a point (Boussinesq)."""
    nu, a, pressure = 0.3, 1e-3, 1.5 / np.pi / 1e-6
    z = np.linspace(0.1, 5, 20)
    rr, tt, zz, rz = hertz_stresses(1.0, a, nu, 0 * z, a * z) / pressure
    on_axis = -1 / (1 + z**2)
    across = -(1 + nu) * (1 - z * np.arctan2(1, z)) - on_axis / 2
    np.testing.assert_allclose([rr, tt, zz, rz], [across, across, on_axis, 0 * z], atol=1e-4)
    x = np.linspace(1.1, 5, 20)
    surface = hertz_stresses(1.0, a, nu, a * x, 0 * x) / pressure
    radial = (1 - 2 * nu) / 3 / x**2
    np.testing.assert_allclose(surface, [radial, -radial, 0 * x, 0 * x], atol=1e-6)
    inside = hertz_stresses(1.0, a, nu, a * np.array([0.5, 1.0]), np.zeros(2)) / pressure
    np.testing.assert_allclose(inside[2], [-np.sqrt(0.75), 0.0], atol=1e-3)
    angles = np.linspace(0.1, 1.5, 7)
    differences = []
    for distance in (0.1, 0.2):
        r, z = distance * np.sin(angles), distance * np.cos(angles)
        zz, rz = -3 / (2 * np.pi) * z**2 / distance**5 * np.array([z, r])
        np.testing.assert_allclose(hertz_stresses(1.0, a, nu, r, z)[2:], [zz, rz], rtol=1e-3)
        differences.append(spread_difference(1.0, (a, 3 * a), nu, r, z) * distance**2)
    np.testing.assert_allclose(differences[0] / differences[1], 4, rtol=0.01)  # Saint-Venant


@pytest.mark.slow
def test_two_patches_differ_by_no_more_than_their_spread():
    """Of a block of finite elements, outside three radii of the smaller patch, but for its mesh."""
    block = parts.box((12, 12, 6), (0.02, 0.02, 0.01))
    part = ao.Structure(block, ao.Solid(210e9, 0.3, 7850.0), [ao.Support(lambda x: x[2] < 1e-9)])
    site, radii = np.array([0.01, 0.01, 0.01]), (2e-3, 4e-3)
    fields = []
    for radius in radii:
        _, hit = held(part, ao.Site(site, (0, 0, -1), radius=radius), 100.0)
        fields.append(ao.peak_field(part, hit, body="part"))
    x = fields[0].points - site
    bound = spread_difference(100.0, radii, 0.3, np.hypot(x[:, 0], x[:, 1]), -x[:, 2])
    far = np.linalg.norm(x, axis=1) > 3 * radii[0]
    change = abs(fields[0].values - fields[1].values)[far]
    assert (change <= bound[far] + 0.1 * bound[far].max()).all()
    assert change.max() > 0.3 * bound[far].max()


@pytest.mark.slow
def test_a_patch_wider_than_a_plate_is_thick_has_the_bending_of_the_contact_in_its_spread():
    """Of a plate of finite elements that is held at its rim, outside three radii of the contact."""
    size, thickness, nu = 0.04, 3e-3, 0.3
    plate = parts.box((20, 20, 3), (size, size, thickness))
    rim = ao.Support(lambda x: (abs(x[:2] - size / 2) > size / 2 - 1e-9).any(axis=0))
    part = ao.Structure(plate, ao.Solid(210e9, nu, 7850.0), [rim])
    site, radii = np.array([size / 2, size / 2, thickness]), (1e-3, 8e-3)
    fields = []
    for radius in (2e-3, radii[1]):  # the least that the mesh resolves
        _, hit = held(part, ao.Site(site, (0, 0, -1), radius=radius), 100.0)
        fields.append(ao.peak_field(part, hit, body="part"))
    far = np.linalg.norm(fields[0].points - site, axis=1) > 3 * radii[0]
    zone = YieldingZone(site, np.array([0.0, 0.0, -1.0]), (2e-3, radii[1]), 100.0, nu)
    contact, model = (field.values[far] for field in fields)
    points = fields[0].points[far]
    assert (model + zone.spread_error(points)).max() < 0.8 * contact.max()
    bound = model + zone._replace(depth=thickness).spread_error(points)
    assert contact.max() < bound.max() < 1.4 * contact.max()


def under_contact_and_patch(part: ao.Structure, site: np.ndarray, radii: tuple[float, float]):
    """(peak fields of 100 N on patches of both radii, the zone of the contact with the first)."""
    fields = []
    for radius in radii:
        _, hit = held(part, ao.Site(site, (0, 0, -1), radius=radius), 100.0)
        fields.append(ao.peak_field(part, hit, body="part"))
    zone = YieldingZone(site, np.array([0.0, 0.0, -1.0]), radii, 100.0, 0.38)
    (measured,) = on_part(part, Zones.about([zone])).contacts
    return fields, measured


@pytest.mark.slow
def test_a_step_beside_the_contact_is_no_plate_of_its_thickness():
    """A block whose rim is thinner, under two patches that both lie on the rim in part.

    The stresses of finite elements rise within the spread outside three radii, but for a tenth of
    the largest rise, and the spread is at most three times that.
    """
    rim = 12e-3
    block = parts.box((20, 16, 5), (0.02, 0.016, 5e-3))
    solid = without(block, lambda x: (x[:, 0] > rim) & (x[:, 2] < 3e-3))
    base = ao.Support(lambda x: x[2] < 1e-9)
    part = ao.Structure(solid, ao.Solid(2.1e9, 0.38, 1270.0), [base])
    site, radii = np.array([0.01, 8e-3, 5e-3]), (1.5e-3, 5e-3)
    fields, measured = under_contact_and_patch(part, site, radii)
    assert measured.depth == pytest.approx(5e-3)
    points = fields[0].points
    far = np.linalg.norm(points - site, axis=1) > 3 * radii[0]
    change = (fields[0].values - fields[1].values)[far]
    for thickness in (measured.depth, 2e-3):  # of a thin roof too: the part is thicker below
        spread = measured._replace(depth=thickness).spread_error(points[far])
        assert (change <= spread + 0.1 * change.max()).all()
        assert change.max() < spread.max() < 3 * change.max()


@pytest.mark.slow
def test_a_rib_between_slits_under_the_patch_is_within_the_bar():
    """The stress of finite elements under a contact on the rib, below its roof."""
    block = parts.box((20, 12, 10), (0.02, 0.012, 0.01))
    solid = without(
        block, lambda x: (x[:, 2] < 9e-3) & (abs(abs(x[:, 0] - 0.01) - 2.5e-3) < 0.6e-3)
    )
    base = ao.Support(lambda x: x[2] < 1e-9)
    part = ao.Structure(solid, ao.Solid(2.1e9, 0.38, 1270.0), [base])
    site, radii = np.array([0.01, 6e-3, 0.01]), (1.5e-3, 5e-3)
    fields, measured = under_contact_and_patch(part, site, radii)
    assert measured.hollow == pytest.approx(1e-3)
    points = fields[0].points
    far = np.linalg.norm(points - site, axis=1) > 3 * radii[0]
    contact, model = (field.values[far].max() for field in fields)
    assert model + measured.spread_error(points[far]).max() < contact
    assert contact < model + measured.hollow_stress
    assert measured._replace(hollow=np.inf).hollow_stress == 0.0
    margin = Margin("yield", 1.0, 50.0, site, 0.0, beyond=np.array([[0, 0, 0, 1.0]]))
    hollow = dataclasses.replace(margin, hollow_stress=2.0)
    assert hollow.stresses[1] == margin.stresses[1] + 2.0
    assert "a hollow lies under the patch" in hollow.sentence.lower()
    assert "narrows it" not in hollow.sentence  # no smaller patch holds
    advised = measured.smallest_patch
    assert radii[0] < 0.58 * advised < 1.1 * radii[0]  # the law of the contact holds up to 0.58
    assert Zones.about([measured]).hollow_patch == advised
    assert measured._replace(radii=(radii[0], advised)).smallest_patch == 0.0
    hollow = dataclasses.replace(hollow, hollow_patch=advised)
    assert f"down to a radius of {engineering(advised, 'm', 2)}, narrows it" in hollow.sentence


def test_a_plate_thinner_than_its_patch_has_no_hollow_by_rounding():
    """The largest and the least of its thicknesses differ by rounding alone."""
    zone = YieldingZone(
        np.zeros(3), None, (1e-3, 8e-3), 100.0, 0.3, depth=6e-3, hollow=6e-3 * 0.999
    )
    assert zone.hollow_stress == 0.0
    assert zone._replace(hollow=3e-3).hollow_stress > 0


def without(mesh: ao.Mesh, is_cut: Callable[[np.ndarray], np.ndarray]) -> ao.Mesh:
    """A mesh of hexahedra without the cells whose middles are cut."""
    geometry = mesh.dolfinx.geometry
    corners = compat.geometry_nodes(mesh.dolfinx)
    kept = corners[~is_cut(geometry.x[corners].mean(axis=1))]
    used, cells = np.unique(kept, return_inverse=True)
    whole = cells.reshape(kept.shape).astype(np.int64)
    made = compat.create_mesh(mesh.comm, whole, geometry.x[used], mesh.cell, 1)
    return ao.read_mesh(made)


def test_hertz_s_stress_is_small_beyond_what_the_margin_leaves_out():
    """Over its largest: on the surface and on the axis (Johnson, Contact Mechanics, 3.4)."""
    nu = 0.3

    def on_axis(z):
        along = -1 / (1 + z**2)
        across = -(1 + nu) * (1 - z * np.arctan2(1, z)) - along / 2
        return abs(along - across)

    largest = max(on_axis(np.linspace(0, 2, 2001)))
    assert largest == pytest.approx(0.62, abs=0.005)
    on_surface = np.sqrt(3) * (1 - 2 * nu) / 3 / CONTACT_RADII**2
    assert on_surface / largest == pytest.approx(0.04, abs=0.005)
    assert on_axis(CONTACT_RADII) / largest == pytest.approx(0.17, abs=0.005)


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


@pytest.mark.parametrize("turned", [False, True])
def test_sheets_that_meet_at_a_fold_are_not_compared(turned):
    """A cantilever with a fin across it: the fin has no stress, and the error of the cantilever,
    bent by a force at its end, stays that of one without a fin, whichever face is its top.
    """
    x, y = (
        grid.ravel() for grid in np.meshgrid(np.arange(9) / 40, np.arange(3) / 40, indexing="ij")
    )
    plate = np.column_stack([x, y, 0 * x])
    fin = np.array([(0.1, b / 40, z / 40) for z in (1, 2) for b in range(3)])
    rows = [
        (3 * i + j, 3 * i + 3 + j, 3 * i + 1 + j, 3 * i + 4 + j) for i in range(8) for j in (0, 1)
    ]
    above = [(12, 13, 27, 28), (13, 14, 28, 29), (27, 28, 30, 31), (28, 29, 31, 32)]
    if turned:  # the other face of every second cell is its top
        rows[::2] = [(a, c, b, d) for a, b, c, d in rows[::2]]
    shares = []
    for cells, points in ((rows, plate), (rows + above, np.vstack([plate, fin]))):
        made = compat.create_mesh(MPI.COMM_WORLD, np.array(cells), points, "quadrilateral", 1)
        shell = ao.Shell(210e9, 0.0, 7850.0, thickness=2e-3)
        part = ao.Structure(ao.read_mesh(made), shell, [ao.Support(lambda x: x[0] < 1e-9)])
        part, hit = held(part, ao.Site((0.19, 0.025, 0.0), (0, 0, -1)), 1.0)
        peak = ao.peak_field(part, hit, body="part")
        at_fin = np.isclose(peak.points[:, 0], 0.1) & np.isclose(peak.points[:, 2], 0)
        shares.append(float((peak.mesh_error / peak.values)[at_fin].max()))
    assert shares[1] < 0.05
    assert shares[1] < 3 * shares[0] + 1e-3


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


CARBON = ao.Layer(
    E1=140e9, E2=9e9, nu12=0.3, G12=5e9, G13=5e9, G23=3.5e9, rho=1600.0, thickness=1e-3
)
BEAM = ao.Beam(
    **parts.STEEL, section=ao.Section(A=3e-4, I=4e-9, I_side=2e-9, J=1e-9, shear_side=0.3),
    orientation=(0, 0.3, 1),
)  # fmt: skip


def field(part: ao.Structure, **functions: Callable[..., np.ndarray]) -> np.ndarray:
    """Dofs (n, 1) of a displacement given by functions of x, y, z."""
    form = on_mesh(part).form
    shapes = np.zeros((compat.local_size(form.space), 1))
    for name, function in functions.items():
        dofs, x = compat.dof_coordinates(form.space, form.components[name])
        shapes[dofs, 0] = function(*x.T)
    return shapes


def at_gauss(part: ao.Structure, shapes: np.ndarray, n: int):
    """Points of n Gauss points a direction in all cells, and their weights times |J|."""
    mesh = on_mesh(part).mesh
    x, w = np.polynomial.legendre.leggauss(n)
    x, w = (x + 1) / 2, w / 2
    if mesh.cell == "triangle":  # a square collapsed
        grid = np.array([(a, b * (1 - a)) for a in x for b in x])
        weight = np.array([p * q * (1 - a) for a, p in zip(x, w, strict=True) for q in w])
    else:
        mesh_of = np.meshgrid(*[x] * mesh.tdim, indexing="ij")
        grid = np.stack([m.ravel() for m in mesh_of], axis=1)
        weight = np.prod(np.meshgrid(*[w] * mesh.tdim, indexing="ij"), axis=0).ravel()
    cells = np.repeat(np.arange(mesh.n_cells), len(grid))
    at = PointsInCells(on_mesh(part), shapes, cells, np.tile(grid, (mesh.n_cells, 1)))
    J = at.J
    size = np.sqrt(np.linalg.det(np.einsum("pia,pib->pab", J, J)))
    return at, np.tile(weight, mesh.n_cells) * size


@pytest.mark.parametrize("cell", parts.CELLS)
def test_a_quadratic_field_has_its_own_strain(cell):
    plane = cell in ("triangle", "quadrilateral")
    if plane:
        solid = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
        part = ao.Structure(parts.plate((3, 2), cell=cell), solid, [ao.Support("left")])
    else:
        part = ao.Structure(parts.box((3, 2, 2), cell=cell), ao.Solid(**parts.STEEL))
    A = np.random.default_rng(1).standard_normal((3, 3, 3))
    A = A + np.swapaxes(A, 1, 2)  # u_i = x·A_i·x/2

    def component(i):
        def function(x, y, z):
            p = np.stack([x, y, z])
            return np.einsum("an,ab,bn->n", p, A[i], p) / 2

        return function

    names = "xy" if plane else "xyz"
    shapes = field(part, **{name: component(i) for i, name in enumerate(names)})
    at, _ = at_gauss(part, shapes, 2) if cell != "tetrahedron" else (None, None)
    if at is None:
        at = PointsInCells(
            on_mesh(part), shapes, np.array([1, 3]), np.array([[0.2, 0.3, 0.1], [0.5, 0, 0.2]])
        )
    x = on_mesh(part).mesh.geometry.at(at.cells, at.X)[0]
    g = np.einsum("iab,pb->pia", A, x)
    if plane:
        g[:, 2] = g[:, :, 2] = 0
    strain = (g + np.swapaxes(g, 1, 2)) / 2
    G, lame = 210e9 / 2.6, 210e9 * 0.3 / 1.3 / 0.4
    if plane:
        strain[:, 2, 2] = -0.3 / 0.7 * (strain[:, 0, 0] + strain[:, 1, 1])
    trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    stress = 2 * G * strain + lame * trace * np.eye(3)
    curl = (g - np.swapaxes(g, 1, 2)) / 2
    turned = curl[:, 1, 0][:, None] if plane else curl[:, [2, 0, 1], [1, 2, 0]]
    for quantity, exact in (("strain", strain), ("stress", stress), ("rotation", turned)):
        found = evaluator(on_mesh(part), quantity, Place())(at)[..., 0]
        np.testing.assert_allclose(found, exact, atol=1e-11 * np.abs(exact).max())
    if plane:
        assert np.abs(stress[:, 2]).max() < 1e-9 * np.abs(stress).max()


@pytest.mark.parametrize("plane", [True, False])
@pytest.mark.parametrize("order", [1, 2])
def test_section_forces_of_beams_carry_the_energy_of_K(plane, order):
    """uᵀKu is the integral of forces times strains, by the Gauss points of K, for random u."""
    direction = (3, 4) if plane else (1, 2, -2)
    part = ao.Structure(parts.line(0.8, 3, direction), BEAM, order=order)
    shapes = np.random.default_rng(2).standard_normal((part.size, 1))
    at, weight = at_gauss(part, shapes, order)
    forces = evaluator(on_mesh(part), "section_forces", Place())(at)[..., 0]
    s = BEAM.section
    stiffness = [BEAM.E * s.A, BEAM.G * s.A * s.shear, BEAM.E * s.I]
    if not plane:
        EA, GA, EI = stiffness
        stiffness = [EA, GA, BEAM.G * s.A * 0.3, BEAM.G * s.J, BEAM.E * s.I_side, EI]
    energy = weight @ (forces**2 / stiffness).sum(axis=1)
    assert energy == pytest.approx(float((shapes.T @ csr(part.K) @ shapes)[0, 0]), rel=1e-10)


def test_fibres_of_a_beam():
    """Bending about both axes and stretching: σ = N/A − M y/I …, and the signs by the geometry."""
    part = ao.Structure(parts.line(0.8, 3, (1, 0, 0)), ao.Beam(**parts.STEEL, section=BEAM.section,
                        orientation=(0, 0, 1)))  # fmt: skip
    a, b, c = 1e-3, 2e-2, 3e-2  # u = a x, w = b x²/2 (so θy = −b x), v = c x²/2 (θz = c x)
    shapes = field(
        part, x=lambda x, y, z: a * x, z=lambda x, y, z: b * x**2 / 2, ry=lambda x, y, z: -b * x,
        y=lambda x, y, z: c * x**2 / 2, rz=lambda x, y, z: c * x,
    )  # fmt: skip
    at = PointsInCells(on_mesh(part), shapes, np.array([1]), np.array([[0.3]]))
    up, side = 0.01, 0.004  # height is z, and the section's z = x × z = −y
    found = evaluator(on_mesh(part), "strain", Place(fibre=(up, side)))(at)[0, ..., 0]
    along = a - b * up - c * (-side)
    np.testing.assert_allclose(np.diag(found), [along, -0.3 * along, -0.3 * along], rtol=1e-12)
    stress = evaluator(on_mesh(part), "stress", Place(fibre=(up, side)))(at)[0, ..., 0]
    np.testing.assert_allclose(stress[0, 0], 210e9 * along, rtol=1e-12)
    assert np.abs(stress[1:]).max() < 1e-9 * stress[0, 0]


def skin(stack: str) -> ao.Shell | ao.Laminate:
    if stack == "shell":
        return ao.Shell(**parts.STEEL, thickness=4e-3)
    angles = (0, 90, 45, 20)  # unsymmetric
    return ao.Laminate([CARBON.rotated(a) for a in angles], axis=(1, 0.3, 0))


@pytest.mark.filterwarnings("ignore:the supports leave:antiosc.base.errors.AntioscWarning")
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_rigid_motions_of_any_sheet_have_no_strain(cell, order):
    """On flat and curved cells that lie askew; and a constant shear strain beside no rotation."""
    turn = np.linalg.qr(np.array([[2.0, 1, 0], [1, 3, 1], [-1, 0.5, 2]]))[0]

    def bowl(s, t):
        return tuple(np.tensordot(turn, np.stack([s, t, 0.3 * (s**2 - s * t)]), axes=1))

    part = ao.Structure(mapped(2, bowl, cell, order), skin("shell"))
    modes = on_mesh(part).rigid_modes
    at, weight = at_gauss(part, np.asarray(modes), 3)
    axes = SheetAxes(on_mesh(part))
    size = np.abs(modes).max()
    for strain in middle_strains(at, axes):
        assert np.abs(strain).max() < 1e-9 * size
    # a deflection alone: γ = (∂w/∂1, ∂w/∂2), whatever is interpolated
    plane = ao.Structure(mapped(2, lambda s, t: (s, t, 0 * s), cell), skin("shell"))
    at, _ = at_gauss(plane, field(plane, z=lambda x, y, z: 3 * x - 2 * y), 2)
    own = SheetAxes(on_mesh(plane))
    frame, found = own.frame(at), middle_strains(at, own).shear[..., 0]
    sign = frame.n[:, 2]
    for k, axis in enumerate((frame.e1, frame.e2)):
        np.testing.assert_allclose(found[:, k], sign * (axis @ [3.0, -2.0, 0.0]), atol=1e-10)
    assert (weight > 0).all()


@pytest.mark.filterwarnings("ignore:the supports leave:antiosc.base.errors.AntioscWarning")
@pytest.mark.parametrize("kind", ["tetrahedron", "beam", "triangle", "quadrilateral"])
def test_superposed_stresses_are_those_of_the_motions(kind):
    """Of more motions than a cell has dofs, as of each motion alone, which is not superposed."""
    if kind == "tetrahedron":
        part = ao.Structure(parts.box((2, 1, 1), cell=kind), ao.Solid(**parts.STEEL))
    elif kind == "beam":
        part = ao.Structure(parts.line(0.8, 3, (1, 2, -2)), BEAM)
    else:
        part = ao.Structure(mapped(2, lambda s, t: (s, t, s * t), kind, 2), skin("laminate"))
    meshed = on_mesh(part)
    motions = np.random.default_rng(4).standard_normal((compat.local_size(meshed.form.space), 150))
    place = Place(fibre=(0.01, 0.004))
    together = mesh_fields.tensors_of_part(meshed, motions, "stress", place, [0])[2]
    for k in (0, 149):
        alone = mesh_fields.tensors_of_part(meshed, motions[:, [k]], "stress", place, [0])[2]
        np.testing.assert_allclose(together[..., [k]], alone, atol=1e-11 * np.abs(alone).max())


@pytest.mark.parametrize("stack", ["shell", "laminate"])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_layers_of_a_bent_and_stretched_sheet(stack, cell):
    """The strain is ε + zκ of the polynomials; each layer has its own stress of it."""
    part = ao.Structure(parts.plate((3, 2), (0.3, 0.2), cell), skin(stack))
    e, k = np.array([1e-3, -2e-3, 5e-4]), np.array([0.3, -0.2, 0.1])  # of x, y and shear
    shapes = field(
        part, x=lambda x, y, z: e[0] * x + e[2] * y / 2, y=lambda x, y, z: e[1] * y + e[2] * x / 2,
        z=lambda x, y, z: -(k[0] * x**2 + k[1] * y**2 + k[2] * x * y) / 2,
        rx=lambda x, y, z: -(k[1] * y + k[2] * x / 2), ry=lambda x, y, z: k[0] * x + k[2] * y / 2,
    )  # fmt: skip
    at = PointsInCells(on_mesh(part), shapes, np.array([0, 2]), np.array([[0.2, 0.3], [0.6, 0.3]]))
    places = [(None, "top", 2e-3), (None, "bottom", -2e-3), (None, "middle", 0.0)]
    if stack == "laminate":
        places += [(1, "top", 0.0), (3, "bottom", 1e-3)]
    for layer, surface, z in places:
        strain, stress = (
            evaluator(on_mesh(part), q, Place(surface, layer))(at)[..., 0]
            for q in ("strain", "stress")
        )
        xx, yy, xy = e + z * k
        plane = np.array([[xx, xy / 2], [xy / 2, yy]])
        for s in strain:
            np.testing.assert_allclose(s[:2, :2], plane, atol=1e-9 * np.abs(plane).max())
        if stack == "shell":
            expected = 210e9 / 0.91 * (0.7 * plane + 0.3 * np.trace(plane) * np.eye(2))
            np.testing.assert_allclose(
                strain[:, 2, 2], -0.3 / 0.7 * np.trace(plane), atol=1e-9 * np.abs(plane).max()
            )
        else:
            number = {None: {"top": 3, "bottom": 0, "middle": 2}[surface]}.get(layer, layer)
            turn = np.deg2rad((0, 90, 45, 20)[number]) + np.arctan2(0.3, 1)
            c, s_ = np.cos(turn), np.sin(turn)
            R = np.array([[c, s_], [-s_, c]])
            own = R @ plane @ R.T
            nu21 = 0.3 * 9 / 140
            Q = np.array([[140e9, 0.3 * 9e9], [0.3 * 9e9, 9e9]]) / (1 - 0.3 * nu21)
            s1, s2 = Q @ np.diag(own)
            t12 = 5e9 * 2 * own[0, 1]
            expected = R.T @ np.array([[s1, t12], [t12, s2]]) @ R
            local = evaluator(on_mesh(part), "stress", Place(surface, layer, local=True))(at)
            np.testing.assert_allclose(
                local[:, :2, :2, 0],
                np.broadcast_to([[s1, t12], [t12, s2]], (2, 2, 2)),
                atol=1e-8 * np.abs(expected).max(),
            )
        for s in stress:
            np.testing.assert_allclose(s[:2, :2], expected, atol=1e-8 * np.abs(expected).max())
            assert np.abs(s[2, 2]) < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("up", [1, -1])
def test_a_direction_names_the_surface(up):
    part = ao.Structure(parts.plate((2, 2), (0.3, 0.2), "triangle"), skin("shell"))
    shapes = field(part, ry=lambda x, y, z: x, z=lambda x, y, z: -(x**2) / 2)
    at = PointsInCells(on_mesh(part), shapes, np.array([0]), np.array([[0.2, 0.3]]))
    found = evaluator(on_mesh(part), "strain", Place((0.1, 0, up)))(at)
    assert found[0, 0, 0, 0] == pytest.approx(up * 2e-3, rel=1e-9)
    with pytest.raises(ao.InputError, match="along"):
        evaluator(on_mesh(part), "strain", Place((1.0, 0, 0.01)))(at)


def test_shear_stresses_of_layers_are_in_equilibrium():
    """Their integral is the shear force, and the surfaces are free; 3/2 Q/t in the middle."""
    from antiosc.fem.elements import shear_stresses

    layers = [CARBON.rotated(a) for a in (0, 90, 45, 20)]
    x, w = np.polynomial.legendre.leggauss(3)
    whole = np.zeros((2, 2))
    for k in range(4):
        for a, weight in zip(x, w, strict=True):
            whole += weight / 2 * 1e-3 * shear_stresses(layers, k, (k - 2 + (a + 1) / 2) * 1e-3)
        np.testing.assert_allclose(
            shear_stresses(layers, max(k - 1, 0), (k - 2) * 1e-3),
            shear_stresses(layers, k, (k - 2) * 1e-3),
            atol=1e-6,
        )
    np.testing.assert_allclose(np.diag(whole), [1, 1], rtol=1e-10)
    assert np.abs(shear_stresses(layers, 3, 2e-3)).max() < 1e-9 * 250
    one = [ao.Layer.isotropic(210e9, 0.3, 7850.0, 4e-3)]
    np.testing.assert_allclose(shear_stresses(one, 0, 0.0), 1.5 / 4e-3 * np.eye(2), atol=1e-9)


@pytest.mark.parametrize("stack", ["shell", "laminate"])
def test_section_forces_of_triangles_carry_the_energy_of_K(stack):
    """For random deflections and rotations, the interpolated shear strain included."""
    part = ao.Structure(parts.plate((2, 2), (0.3, 0.2), "triangle"), skin(stack))
    rng = np.random.default_rng(3)
    form = on_mesh(part).form
    shapes = np.zeros((part.size, 1))
    for name in ("z", "rx", "ry"):
        dofs, _ = compat.dof_coordinates(form.space, form.components[name])
        shapes[dofs, 0] = rng.standard_normal(len(dofs)) * (0.01 if name == "z" else 1)
    at, weight = at_gauss(part, shapes, 5)
    axes = SheetAxes(on_mesh(part))
    forces = evaluator(on_mesh(part), "section_forces", Place())(at)[..., 0]
    strains = np.hstack([s[..., 0] for s in middle_strains(at, axes)])
    energy = weight @ (forces * strains).sum(axis=1)
    assert energy == pytest.approx(float((shapes.T @ csr(part.K) @ shapes)[0, 0]), rel=1e-9)


def test_balls_that_are_given_do_not_replace_the_zone_of_the_contact():
    mesh = ao.box_mesh((0.06, 0.04, 0.02), size=0.005)
    part = ao.Structure(mesh, ao.Solid(70e9, 0.33, 2700.0, yield_strength=40e6), [ao.Support("-z")])
    model = ao.extract(part, ao.Site((0.03, 0.02, 0.02), (0, 0, -1), radius=0.006), n=8)
    ball = ao.Sphere(0.01, 210e9, 0.3, 7850.0, velocity=1.0)
    hit = ao.simulate(model, ball, ball.hertz(70e9, 0.33), duration=2e-4)
    alone = ao.peak_field(part, hit).margin()
    with_ball = ao.peak_field(part, hit, leave_out=[(0.0, 0.0, 0.0, 0.004)]).margin()
    np.testing.assert_array_equal(with_ball.beyond[1:], alone.beyond)
    assert len(alone.beyond) == 1
    before = "outside the balls of leave_out, and "
    assert with_ball.scope == alone.scope.replace("outside ", before)
