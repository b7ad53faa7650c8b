"""Models of several sites in scenes: against unreduced systems, their fields, gravity."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import antiosc as ao
from antiosc.fem.site import functional
from chains import loose_chains
from marks import FREE_ON_PURPOSE
from parts import STEEL, box, line
from several import CORNERS, block_with_corners, sites_of

pytestmark = [pytest.mark.slow, FREE_ON_PURPOSE]

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def block() -> ao.Structure:
    return block_with_corners()


def test_motion_of_a_struck_structure_is_the_unreduced_one(rng):
    """A free chain that two hammers strike, one of them on its load too: at any time, anywhere."""
    K, M = loose_chains((10,), 0, rng)
    B = np.eye(10)[:, [1, 7]]
    model = ao.extract(ao.Structure.from_matrices(K, M), sites_of(B), 8)
    k, masses, speeds = 2e6, np.array([0.6, 0.4]), np.array([2.0, 1.0])
    load = ao.Load("chain:s1", [0.0, 2e-3, 4e-3], [0.0, -300.0, 0.0])
    hammers = {f"h{i}": ao.RigidMass(masses[i], speeds[i]) for i in range(2)}
    contacts = [ao.Contact(f"chain:s{i}", f"h{i}", ao.Linear(k)) for i in range(2)]
    scene = ao.Scene({"chain": model, **hammers}, contacts, loads=[load])
    hit = scene.run(8e-3, tol=1e-4)

    def slope(t: float, y: Array) -> Array:
        u, w = y[:10], y[10:12]
        force = k * np.maximum(w - B.T @ u, 0.0)
        push = np.interp(t, load.times, load.forces) * B[:, 1] + B @ force
        return np.concatenate([y[12:], (push - K @ u) / M.diagonal(), -force / masses])

    start = np.concatenate([np.zeros(22), speeds])
    times = np.linspace(0, 8e-3, 40)
    exact = solve_ivp(slope, (0, 8e-3), start, "DOP853", times, rtol=1e-10, atol=1e-13)
    found = hit.field(times, "chain")
    np.testing.assert_allclose(found, exact.y[:10].T, atol=2e-4 * np.abs(found).max())
    np.testing.assert_allclose(hit.field(8e-3), found[-1], rtol=1e-12)
    own = hit.bodies["chain"].displacement("s1")
    np.testing.assert_allclose(
        hit.field(hit.time, "chain") @ B[:, 1], own, atol=1e-9 * np.abs(own).max()
    )
    with pytest.raises(ao.InputError, match="no body 'rod' in the scene: name one of chain, h0"):
        hit.field(0.0, "rod")
    with pytest.raises(ao.InputError, match="t must lie within the run"):
        hit.field(1.0)


def test_a_ground_that_moves_across_the_site_is_felt_or_refused():
    """A bar at 45 degrees, shaken along x, bends along z; one site's direction does not tell it."""
    section = ao.Section.rectangle(0.03, 0.01)
    bar = ao.Beam(**STEEL, section=section, orientation=(-1, 0, 1), shear=False)
    part = ao.Structure(line(0.5, 12, (1.0, 0.0, 1.0)), bar, [ao.Support("left")])
    tip = ao.Site((0.5 / np.sqrt(2), 0, 0.5 / np.sqrt(2)), (0, 0, 1))
    base = ao.Base([0.0, 9.0], [(-100.0, 0, 0)] * 2)

    def shaken(model: ao.AntiOscillators | ao.ModalBody, end: str) -> ao.History:
        stop = ao.Contact(end, "stop", ao.Linear(1e5), gap=1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AntioscWarning)  # it never touches
            return ao.Scene({"bar": model, "stop": ao.Obstacle()}, [stop], base=base).run(1.0)

    damping = ao.Damping(alpha=300.0)
    for model in (ao.extract(part, tip, 6, damping=damping), ao.full(part, tip)):
        with pytest.raises(ao.InputError, match=r"100 m/s² across .* name the site"):
            shaken(model, "bar")
    hit = shaken(ao.extract(part, {"tip": tip}, 6, damping=damping), "bar:tip")
    sag = STEEL["rho"] * section.A * 50.0 * 0.5**4 / (8 * STEEL["E"] * section.I)
    moved = hit.bodies["bar"].displacement("tip")
    assert moved[-1] == pytest.approx(-sag, rel=1e-3)  # and 5e-4 of it by stretching


def test_a_field_tells_of_shaken_mass_that_no_site_sees():
    """A bar that sags along y under a steady ground; only a site along y has this in its model."""
    section = ao.Section.rectangle(0.03, 0.01)
    bar = ao.Beam(**STEEL, section=section, orientation=(0, 1, 0), shear=False)
    # what the support holds shakes nothing
    heavy = ao.PointMass((0, 0, 0), 50.0)
    part = ao.Structure(line(0.5, 12, (1.0, 0.0, 0.0)), bar, [ao.Support("left")], attached=[heavy])
    base = ao.Base([0.0, 9.0], [(0.0, -100.0, 0.0)] * 2)

    def sag(direction: tuple[float, float, float]) -> float:
        model = ao.extract(
            part, {"tip": ao.Site((0.5, 0, 0), direction)}, 6, damping=ao.Damping(alpha=300.0)
        )
        stop = ao.Contact("bar:tip", "stop", ao.Linear(1e5), gap=1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AntioscWarning)  # it never touches
            hit = ao.Scene({"bar": model, "stop": ao.Obstacle()}, [stop], base=base).run(1.0)
        return float(ao.probe(part, hit, (0.5, 0, 0), body="bar")[-1, 1])

    exact = STEEL["rho"] * section.A * 100.0 * 0.5**4 / (8 * STEEL["E"] * section.I)
    assert sag((0, 1, 0)) == pytest.approx(exact, rel=1e-3)
    with pytest.warns(ao.AccuracyWarning, match=r"1.2 kg along y, and the model carries 0%"):
        assert abs(sag((0, 0, 1))) < 1e-9 * exact


def test_fields_of_a_scene(block, tmp_path):
    model = ao.extract(block, CORNERS, 30)
    scene = ao.Scene(
        {"part": model, "ball": ao.RigidMass(0.1, 1.0)},
        [ao.Contact("part:far", "ball", ao.Hertz(1e9))],
    )
    hit = scene.run(2e-4)
    times = hit.time[[len(hit.time) // 3, -2]]
    field = hit.field(times, "part")
    for name, site in CORNERS.items():
        own = hit.bodies["part"].displacement(name)
        at = own[[len(hit.time) // 3, -2]]
        np.testing.assert_allclose(
            field @ functional(block, site).b, at, atol=1e-9 * np.abs(own).max()
        )
    probed = ao.probe(block, hit, (0.2, 0.05, 0.04), times)
    assert probed.shape == (2, 3)
    assert np.abs(probed[1, 2]) > 1e-6
    listed = ao.write_series(block, hit, tmp_path / "run", times, body="part")
    assert listed.exists()
    with pytest.raises(ao.InputError, match="no displacement field"):
        ao.probe(block, hit, (0.2, 0.05, 0.04), times, body="ball")


def test_a_free_body_moves_as_a_whole():
    """A free block, struck at two corners: its momentum is that of the balls."""
    free = ao.Structure(box((8, 3, 2)), ao.Solid(**STEEL))
    sites = {
        name: ao.Site((x, 0.025, 0.04), (0, 0, -1), radius=0.022)
        for name, x in (("left", 0.03), ("right", 0.17))
    }
    model = ao.extract(free, sites, 12)
    assert model.rigid.shape == (2, 2)
    assert np.sum(model.site_modes().omega == 0) == 6
    law = ao.Hertz(1e9)
    scene = ao.Scene(
        {"part": model, "a": ao.RigidMass(0.2, 1.0), "b": ao.RigidMass(0.1, 1.0)},
        [ao.Contact("part:left", "a", law), ao.Contact("part:right", "b", law)],
        motion={"part": ao.Motion(velocity=(0.3, 0.0, 0.1), spin=(0.0, 0.0, 2.0))},
    )
    hit = scene.run(4e-4)
    impulse = hit["part:left", "a"].impulse + hit["part:right", "b"].impulse
    momentum = hit.bodies["part"].momentum
    np.testing.assert_allclose(momentum[0], free.mass * np.array([0.3, 0.0, 0.1]), atol=1e-9)
    np.testing.assert_allclose(momentum[-1] - momentum[0], [0, 0, -impulse], atol=1e-9)


def test_gravity_and_base_act_on_every_shape(block):
    """The modal forces of a uniform acceleration bend the block as a direct solve says."""
    free = ao.extract(block, CORNERS, 60).site_modes()
    for axis in np.eye(3):
        load = block.uniform_inertia(axis)
        sag = block.factorize().solve(load)
        sites = [functional(block, site).b for site in CORNERS.values()]
        found = free.b.T @ (free.weight @ axis / free.omega**2)
        np.testing.assert_allclose(found, [b @ sag for b in sites], rtol=1e-5, atol=1e-15)


def test_gravity_as_a_number_needs_one_direction(block):
    model = ao.extract(block, CORNERS, 10)
    contact = ao.Contact("part:far", "ball", ao.Hertz(1e9), gap=1e-3)
    bodies = {"part": model, "ball": ao.RigidMass(0.1, 1.0)}
    base = ao.Base([0.0, 1e-4], [100.0, 0.0])
    alike = ao.Scene(bodies, [contact], base=base).run(1e-4)
    way = np.array([0.1, 0.2, -1]) / np.linalg.norm([0.1, 0.2, -1])
    vector = ao.Base([0.0, 1e-4], [100.0 * way, 0 * way])
    turned = ao.Scene(bodies, [contact], base=vector).run(1e-4)
    both = (each.bodies["part"].displacement("near")[-1] for each in (alike, turned))
    np.testing.assert_allclose(*both, rtol=1e-6)
    sites = {**CORNERS, "side": ao.Site((0.12, 0.0, 0.02), (0, 1, 0), radius=0.022)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)  # coarse for that patch
        mixed = ao.extract(block, sites, 6)
    scene = ao.Scene({**bodies, "part": mixed}, [contact], base=base)
    with pytest.raises(ao.InputError, match="several directions: give gravity"):
        scene.run(1e-4)
