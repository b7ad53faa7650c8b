"""Drops of meshes: what touches, with which radius and compliance, and the trial job."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation.scene import exactly

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
    assert fall.impacts[0].speed_before == pytest.approx(np.sqrt(2 * 9.81), rel=1e-3)
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
    np.testing.assert_allclose(np.diag(body.tensor), moments, rtol=1e-6)
    few = body.sites(np.array([0]))[1][0]
    more = ao.drop(case, 0.1, floor=ao.Floor(STEEL), until=0.01, modes=40).body
    left = more.sites(np.array([0]))[1][0]
    assert (np.linalg.eigvalsh(few) >= 0).all()
    assert (np.linalg.eigvalsh(few - left) >= -1e-3 * np.trace(few)).all()  # more modes, less left


@pytest.mark.slow
def test_the_law_of_a_ball_is_hertz_of_its_radius(tmp_path: Path) -> None:
    mesh = meshed(tmp_path, "Sphere(1) = {0, 0, 0, 0.02}", 0.006)
    part = ao.Structure(mesh, STEEL)
    law = ao.contact_at(part, (0.0, 0.0, -0.02), ALUMINIUM)
    known = ao.Hertz.from_radii(0.02, 210e9, 0.3, np.inf, 70e9, 0.33)
    assert law.stiffness == pytest.approx(known.stiffness, rel=0.05)
    fall = ao.drop(part, 0.05, floor=ao.Floor(STEEL), until=1, modes=3)
    rigid = ao.drop(ao.Sphere(0.02, 210e9, 0.3, 7800.0), 0.05, floor=ao.Floor(STEEL), until=1)
    assert fall.peak_force == pytest.approx(rigid.peak_force, rel=0.05)
    assert np.linalg.norm(fall.impacts[0].spin_after) < 2.0  # the force passes the centre


@pytest.mark.slow
def test_sharp_and_flat_places(case: ao.Structure) -> None:
    with pytest.warns(ao.AccuracyWarning, match="radius"):
        ao.contact_at(case, (0.12, 0.06, 0.0), STEEL)
    law = ao.contact_at(case, (0.12, 0.06, 0.0), STEEL, radius=2e-3)
    known = ao.Hertz.from_radii(2e-3, 70e9, 0.33, np.inf, 210e9, 0.3)
    assert law.stiffness == pytest.approx(known.stiffness)


def test_a_part_on_supports_does_not_fall(tmp_path: Path) -> None:
    mesh = meshed(tmp_path, "Box(1) = {0, 0, 0, 0.1, 0.05, 0.05}", 0.05)
    held = ao.Structure(mesh, STEEL, [ao.Support(lambda x: x[0] < 1e-6)])
    with pytest.raises(ao.InputError, match="supports"):
        ao.drop(held, 1.0, floor=ao.Floor(STEEL))


def test_a_plate_gives_way_under_a_ball(tmp_path: Path) -> None:
    """An elastic floor is the plate of `simulate`; its motion goes on between the impacts."""
    plate = ao.AntiOscillators(m0=0.01, k0=1e6, m=[0.3], omega=[1500.0])
    ball, law, height = ao.Sphere(0.01, 200e9, 0.3, 7800.0), ao.Hertz(1e9), 0.05
    fall = ao.drop(ball, height, floor=ao.Floor(law=law, model=plate), until=2)
    hit = ao.simulate(
        plate, ao.RigidMass(ball.mass, velocity=np.sqrt(2 * 9.81 * height)), law, 1e-3
    )
    assert fall.impacts[0].peak_force == pytest.approx(hit.peak_force, rel=5e-3)
    assert np.abs(fall.episodes[1].start.floor).max() > 0


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
    with pytest.warns(ao.AccuracyWarning, match="spins"):
        fall = ao.drop(sheet, 0.5, (60, 0, 0), floor, until=2, modes=8)
    _, energies = fall.energy()
    assert len(fall.impacts) == 2
    assert (np.diff(energies.sum(axis=1)) < 1e-3 * energies[0].sum()).all()


def test_friction_that_jams_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A march that finds no forces at the start of an episode, as rounding decides in real jams."""

    def stuck(*given: Any) -> Any:
        found, why = exactly(*given)
        found.run.time = found.run.time[:1]
        return found, why

    monkeypatch.setattr("antiosc.studies.drops.episode.exactly", stuck)
    with pytest.raises(ao.AccuracyError, match="jams"):
        ao.drop(ao.Sphere(0.01, 200e9, 0.3, 7800.0), 0.1, floor=ao.Floor(friction=0.6))


@pytest.mark.parametrize("radius", [2e-3, None])
def test_a_contact_that_yields_is_told(radius: float | None) -> None:
    """The pressure is 1.5 F/(pi R delta); a law that yields and a soft one say nothing."""
    solid = ao.Solid(E=2.3e9, nu=0.36, rho=1050.0, yield_strength=42e6)
    part = ao.Structure(ao.box_mesh((0.1, 0.05, 0.02), size=0.03), solid)
    floor = ao.Floor(STEEL)
    fall = ao.drop(part, 1.0, (20, 15, 0), floor, 1, modes=3, corner_radius=radius)
    R, E = radius or 1e-3, 1 / ((1 - 0.36**2) / 2.3e9 + (1 - 0.3**2) / 210e9)
    F = fall.peak_force  # of one corner
    pressure = 1.5 * F / (np.pi * R * (F / (4 / 3 * E * np.sqrt(R))) ** (2 / 3))
    (told,) = (note for note in fall.notes if "Thornton" in note)
    assert f", {pressure / 42e6:.3g} times the yield strength" in told
    assert f"Floor(law=Thornton.from_material({E:.4g}, {R:.4g}, 6.72e+07))" in told
    assert told in fall.summary()
    assert told == fall.worst("von_mises").margin().contact
    damped = ao.drop(fall.body, 1.0, (20, 15, 0), ao.Floor(STEEL, restitution=0.8), until=1)
    assert "Thornton" in damped.summary()
    law = ao.Thornton.from_material(E, R, 1.6 * 42e6)
    for gentle in (ao.Floor(law=law), ao.Floor(law=ao.Hertz(1e6))):
        soft = ao.drop(fall.body, 1.0, (20, 15, 0), gentle, until=1)
        assert soft.peak_force < F
        assert not soft.worst("von_mises").margin().contact
        assert "Thornton" not in soft.summary()


def test_a_dent_that_stays_is_not_a_part_that_sinks() -> None:
    """A corner parts in its dent, deeper than the next corner presses."""
    part = ao.Structure(ao.box_mesh((0.12, 0.06, 0.012), size=0.03), ALUMINIUM)
    floor = ao.Floor(law=ao.Thornton.from_material(2.236e10, 1e-3, 4.4e8), friction=0.3)
    fall = ao.drop(part, 1.0, (10, 5, 0), floor, until=2, modes=12)
    assert fall.status == "2 impacts"
    assert np.all(np.diff(fall.energy()[1].sum(axis=1)) < 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [(0, 0, 0), (1, 2, 0), (10, 5, 0)])
def test_a_stiff_mesh_lands_on_a_layer_as_a_rigid_block(
    case: ao.Structure, tilt: tuple[float, ...]
) -> None:
    half, floor = np.array([0.06, 0.03, 0.006]), ao.Floor(layer=ao.SoftLayer(0.01, 1e5))
    fall = ao.drop(case, 0.1, tilt, floor, until=1, modes=6)
    corners = half * np.array(list(product((-1, 1), repeat=3)))
    sites = {f"{i}": (p, (0, 0, 1)) for i, p in enumerate(corners)}
    rigid = ao.RigidBody(fall.body.mass, np.diag(fall.body.tensor), sites)
    known = ao.drop(rigid, 0.1, tilt, floor, until=1)
    assert fall.peak_force == pytest.approx(known.peak_force, rel=5e-3)
    assert fall.impacts[0].impulse == pytest.approx(known.impacts[0].impulse, rel=5e-3)
