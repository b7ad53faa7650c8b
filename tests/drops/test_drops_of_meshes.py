"""Drops of meshes: what touches, with which radius and compliance, and the trial job."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.strikes import stress
from antiosc_studies.drops.body import free_body
from antiosc_studies.drops.impacts import Impacts
from parts import box

pytestmark = pytest.mark.fem

ALUMINIUM = ao.Solid(E=70e9, nu=0.33, rho=2700.0)
STEEL = ao.Solid(E=210e9, nu=0.3, rho=7800.0)


def meshed(folder: Path, shape: str, size: float) -> ao.Mesh:
    (folder / "part.geo").write_text(
        f'SetFactory("OpenCASCADE"); {shape}; Physical Volume("part") = {{1}};'
    )
    return ao.read_mesh(folder / "part.geo", size=size)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> ao.Structure:
    folder = tmp_path_factory.mktemp("case")
    mesh = meshed(folder, "Box(1) = {0, 0, 0, 0.12, 0.06, 0.012}", 0.03)
    return ao.Structure(mesh, ALUMINIUM)


@pytest.mark.slow
def test_the_trial_job(case: ao.Structure, tmp_path: Path) -> None:
    floor = ao.Floor(ao.Solid(E=30e9, nu=0.2, rho=2400.0), friction=0.3)
    fall = ao.drop(case, height=1.0, tilt=(10, 5, 0), floor=floor, until=2, modes=12)
    assert fall.impacts[0].speed_before == pytest.approx(np.sqrt(2 * 9.80665), rel=1e-3)
    assert fall.impacts[1].peak_force > 1.3 * fall.impacts[0].peak_force
    np.testing.assert_allclose(fall.impacts[0].place, [0.12, 0.0, 0.0], atol=1e-9)
    assert fall.peak("acceleration", at=(0.06, 0.03, 0.012), filter="CFC1000").g > 10
    stress = fall.worst("von_mises")
    first = [one.start.time for one in fall.episodes]
    assert 0 < stress.values.max() < 2e9
    assert set(np.unique(stress.impact)) <= {0, 1}
    assert (stress.times >= first[0]).all()
    for picture in (stress.plot(tmp_path / "a.png"), fall.plot(tmp_path / "b.png")):
        assert picture.stat().st_size > 0
    assert "radius" in fall.summary()


@pytest.mark.slow
def test_the_body_of_a_mesh(case: ao.Structure) -> None:
    """Its points are the corners, its residual compliance is what the modes leave of K^-1."""
    fall = ao.drop(case, 0.1, face="-z", floor=ao.Floor(STEEL), until=0.01, modes=12)
    body = fall.body
    assert len(body.points) == 8
    m, (a, b, c) = body.mass, (0.12, 0.06, 0.012)
    moments = m / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    np.testing.assert_allclose(np.diag(body.inertia), moments, rtol=1e-6)
    few = body.patches(np.array([0]))[1][0]
    more = ao.drop(case, 0.1, floor=ao.Floor(STEEL), until=0.01, modes=40).body
    left = more.patches(np.array([0]))[1][0]
    assert (np.linalg.eigvalsh(few) >= -1e-12 * np.trace(few)).all()
    assert (np.linalg.eigvalsh(few - left) >= -1e-2 * np.trace(few)).all()  # more modes, less left


@pytest.mark.slow
def test_the_law_of_a_ball_is_hertz_of_its_radius(tmp_path: Path) -> None:
    mesh = meshed(tmp_path, "Sphere(1) = {0, 0, 0, 0.02}", 0.006)
    part = ao.Structure(mesh, STEEL)
    law = ao.contact_between(part, ALUMINIUM, at=(0.0, 0.0, -0.02))
    known = ao.Hertz.from_radii(0.02, 210e9, 0.3, np.inf, 70e9, 0.33)
    assert law.stiffness == pytest.approx(known.stiffness, rel=0.05)
    fall = ao.drop(part, 0.05, floor=ao.Floor(STEEL), until=1, modes=3)
    rigid = ao.drop(ao.Sphere(0.02, 210e9, 0.3, 7800.0), 0.05, floor=ao.Floor(STEEL), until=1)
    assert fall.peak_force == pytest.approx(rigid.peak_force, rel=0.05)
    assert np.linalg.norm(fall.impacts[0].spin_after) < 2.0  # the force passes the centre


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_shallow_dome_touches_where_it_is(tmp_path: Path) -> None:
    """A cap of 3.4 mm of a sphere of 50 mm: the sphere goes on where the dome does not."""
    mesh = meshed(tmp_path, "Sphere(1) = {0, 0, 0, 0.05, 1.2, Pi/2, 2*Pi}", 0.006)
    part, height = ao.Structure(mesh, ALUMINIUM), 0.05 * (1 - np.sin(1.2))
    body = part
    for tilt in ((5, 0, 0), (90, 0, 0), (175, 0, 0)):
        fall = ao.drop(body, 0.1, tilt=tilt, floor=ao.Floor(STEEL), until=1, modes=3)
        body, place = fall.body, fall.impacts[0].place
        assert 0.05 - height - 1e-6 < place[2] < 0.05 + 1e-6
        assert np.hypot(*place[:2]) < 0.05 * np.cos(1.2) + 1e-6


@pytest.mark.slow
def test_the_radii_of_a_spheroid_at_its_points(tmp_path: Path) -> None:
    """Radii N = b^2 g around the axis and M = a^2 b^2 g^3 along it, g^2 = x^2/a^4 + r^2/b^4."""
    a, b = 0.02, 0.01
    shape = "Sphere(1) = {0, 0, 0, 0.01}; Dilate {{0, 0, 0}, {2, 1, 1}} { Volume{1}; } n = 1"
    body = free_body(ao.Structure(meshed(tmp_path, shape, 0.0028), STEEL), 1, None, None)
    skin = body.points + body.centre + body.ball_radii[:, None] * body.normals
    ends = [np.argmin(skin[:, 0]), np.argmax(skin[:, 0])]
    which = np.append(ends, np.arange(0, len(skin), 12))
    body.patches(which)
    x, y, z = skin[which].T
    g = np.sqrt(x**2 / a**4 + (y**2 + z**2) / b**4)
    true = np.sort([b**2 * g, a**2 * b**2 * g**3], axis=0).T
    np.testing.assert_allclose(np.sort(body.radii[which]), true, rtol=0.1)


def test_matrices_with_coordinates_have_sharp_corners() -> None:
    """Four nodes, each a vertex: the default radius is a quarter of the least side, or 1 mm."""
    x = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.05, 0], [0, 0, 0.002]])
    arms = [a - b for i, a in enumerate(x) for b in x[:i]]
    pairs = [(i, j) for i in range(4) for j in range(i)]
    K = np.zeros((12, 12))
    for (i, j), arm in zip(pairs, arms, strict=True):  # rods between the nodes
        along = np.zeros(12)
        along[3 * i : 3 * i + 3], along[3 * j : 3 * j + 3] = arm, -arm
        K += 1e8 * np.outer(along, along) / (arm @ arm)
    node, dof = np.repeat(np.arange(4), 3) + 1, np.tile([1, 2, 3], 4)
    part = ao.Structure.from_matrices(K, 0.1 * np.eye(12), map=(node, dof, np.repeat(x, 3, axis=0)))
    fall = ao.drop(part, 0.1, floor=ao.Floor(law=ao.Hertz(1e8)), until=1, modes=4)
    assert fall.body.radii == pytest.approx(0.002 / 4)
    assert any("radius of 500 µm" in note for note in fall.notes)


@pytest.mark.slow
def test_a_part_on_supports_does_not_fall(tmp_path: Path) -> None:
    mesh = meshed(tmp_path, "Box(1) = {0, 0, 0, 0.1, 0.05, 0.05}", 0.05)
    held = ao.Structure(mesh, STEEL, [ao.Support(lambda x: x[0] < 1e-6)])
    with pytest.raises(ao.InputError, match="supports"):
        ao.drop(held, 1.0, floor=ao.Floor(STEEL))


@pytest.mark.slow
def test_a_shell_falls_onto_its_edge_with_friction(tmp_path: Path) -> None:
    """What few modes leave out couples forces along the sheet and across it strongly."""
    (tmp_path / "part.geo").write_text(
        'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.2, 0.12};'
        'Physical Surface("part") = {1};'
    )
    mesh = ao.read_mesh(tmp_path / "part.geo", size=0.04, gdim=3)
    sheet = ao.Structure(mesh, ao.Shell(70e9, 0.33, 2700.0, 3e-3))
    floor = ao.Floor(ao.Solid(3e10, 0.2, 2400.0), friction=0.2)
    fall = ao.drop(sheet, 0.5, (60, 0, 0), floor, until=2, modes=8)  # its spin is at the limit
    _, energies = fall.energy()
    assert len(fall.impacts) == 2
    assert (np.diff(energies.sum(axis=1)) < 1e-3 * energies[0].sum()).all()


@pytest.mark.slow
def test_the_verdict_of_a_fall_takes_the_bar_of_each_impact(monkeypatch) -> None:
    """The largest error of a force of its impacts counts."""
    solid = ao.Solid(E=70e9, nu=0.33, rho=2700.0, yield_strength=2e9)
    part = ao.Structure(ao.box_mesh((0.12, 0.06, 0.012), size=0.03), solid)
    fall = ao.drop(part, 0.1, (10, 5, 0), ao.Floor(STEEL), until=3, modes=12)
    alone = [fall.worst(impacts=[k]).margin() for k in range(3)]
    stresses = [margin.value for margin in alone]
    judged = next(k for k in range(3) if stresses[k] == pytest.approx(max(stresses)))

    def margin_with(bars: list[float]) -> ao.Margin:
        pairs = zip(fall.impacts, bars, strict=True)
        rated = Impacts(replace(impact, law_error=bar) for impact, bar in pairs)
        monkeypatch.setitem(vars(fall), "impacts", rated)
        return fall.worst().margin()

    margin = margin_with([0.01, 0.02, 0.03])
    assert margin.value == pytest.approx(max(stresses))
    assert margin.force_error == 0.03
    assert margin.impact == judged + 1
    assert f", by impact {judged + 1}" in margin.sentence


@pytest.mark.slow
@pytest.mark.fem
def test_a_face_that_lands_flat_is_outside_of_the_method():
    """A steel bar on its end: waves, not the indentation of its corners, give the force."""
    bar = ao.Structure(box((2, 2, 6), (0.0254, 0.0254, 0.254)), ao.Solid(200e9, 0.3, 7850.0))
    flat, tilted = (
        ao.drop(bar, 1.0, until=1, tilt=tilt, modes=20) for tilt in ((0, 0, 0), (9, 4, 0))
    )
    assert "flat" in flat.summary().splitlines()[0]
    assert flat.law_error is None
    assert "outside of this method" in flat.no_bar()
    assert tilted.flat == ""


@pytest.mark.slow
def test_a_fall_ends_with_a_stress_to_a_tolerance():
    """In the hardest impact; the cells at the contact of the modes become small enough too."""
    steel = ao.Solid(210e9, 0.3, 7850.0, yield_strength=250e6)
    part = ao.Structure(ao.box_mesh((0.06, 0.02, 0.004), 0.008), steel)
    setting = {"height": 0.5, "tilt": (20.0, 30.0, 0.0), "until": 1, "modes": 16}
    fall = ao.drop(part, **setting)
    before, after = fall.worst(), fall.worst(tol=0.1)
    assert not before.margin().has_bar
    assert after.margin().has_bar
    assert max(stress.stress_bar(after)) <= 0.1 < max(stress.stress_bar(before))

    fine = ao.Structure(ao.box_mesh((0.06, 0.02, 0.004), 0.0025), steel)
    truth = ao.drop(fine, **setting).worst().margin()
    low, high = after.margin().errors
    assert low <= truth.value <= high
    with pytest.raises(ao.InputError, match="no impact"):
        ao.drop(part, 0.5, until=1e-3).worst(tol=0.1)
