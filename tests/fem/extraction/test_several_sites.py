"""Models of several sites: receptances, tangential directions, and scenes against direct solves."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import antiosc as ao
from antiosc.reduce.site import functional
from chains import loose_chains, receptance
from marks import FREE_ON_PURPOSE
from parts import STEEL, box, line
from several import CORNERS, OMEGA, block_with_corners, sites_of

pytestmark = FREE_ON_PURPOSE


Array = NDArray[np.float64]


METHODS = ("krylov", "modes")


def _check_inverse(Z: Array, H: Array, limit: float) -> None:
    """Z is H⁻¹, with the sites scaled by their compliances at each frequency."""
    size = np.sqrt(np.abs(np.einsum("wpp->wp", H)))
    product = (Z @ H) * size[:, :, None] / size[:, None, :]
    assert np.abs(product - np.eye(H.shape[-1])).max() < limit


CASES = {
    "supported": ((12,), 1, 3),
    "free, p < r": ((5, 6, 5), 0, 2),
    "free, p = r": ((5, 7), 0, 2),
    "free, p > r": ((12,), 0, 3),
    "partly free": ((6, 6, 5), 1, 4),
    "one site": ((12,), 1, 1),
    "one site, free": ((9,), 0, 1),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_all_modes_are_the_structure(case, method, rng):
    sizes, held, p = CASES[case]
    K, M = loose_chains(sizes, held, rng)
    B = rng.standard_normal((len(K), p))
    structure = ao.Structure.from_matrices(K, M)
    model = ao.extract(structure, sites_of(B), len(K) - p, method)
    assert model.sites == tuple(f"s{i}" for i in range(p))
    assert model.k0.shape == model.m0.shape == (p, p)
    assert model.P.shape == (p, model.n)
    assert model.omega.shape == (model.n,)
    H = receptance(K, M, B, OMEGA)
    _check_inverse(model.dynamic_stiffness(OMEGA), H, 1e-9)
    found = model.site_modes().receptance(OMEGA)
    np.testing.assert_allclose(found, H, atol=1e-9 * np.abs(H).max())
    np.testing.assert_allclose(model.m0, np.linalg.inv(B.T @ np.linalg.solve(M, B)), rtol=1e-9)


@pytest.mark.parametrize("p", [1, 2])
def test_first_blocks_match_the_moments(p, rng):
    """N blocks of p vectors match 2N moments ΦᵀM TʲΦ of the constrained structure."""
    K, M = loose_chains((40,), 1, rng)
    B = rng.standard_normal((40, p))
    Y = np.linalg.solve(K, B)
    shapes = Y @ np.linalg.inv(B.T @ Y)
    T = np.linalg.solve(K, M) - Y @ np.linalg.solve(B.T @ Y, Y.T @ M)
    for blocks in (1, 2, 4):
        model = ao.extract(ao.Structure.from_matrices(K, M), sites_of(B), p * blocks)
        power = shapes
        for j in range(1, 2 * blocks + 2):
            power = T @ power
            exact = shapes.T @ M @ power
            moment = (model.P / model.omega ** (2 * j)) @ model.P.T
            error = np.abs(moment - exact).max() / np.abs(exact).max()
            assert error < 1e-11 if j <= 2 * blocks else error > 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_sites_that_cannot_move_independently(method, rng):
    K, M = loose_chains((14,), 1, rng)
    B = rng.standard_normal((14, 2))
    three = np.column_stack([B, 0.3 * B[:, 0] - 2 * B[:, 1]])
    model = ao.extract(ao.Structure.from_matrices(K, M), sites_of(three), 12, method)
    assert model.k0.shape == (2, 2)
    assert model.sites == ("s0", "s1", "s2")
    np.testing.assert_allclose(model.dependence @ three[:, model.info["independent"]].T, three.T)
    H = receptance(K, M, three, OMEGA)
    found = model.site_modes().receptance(OMEGA)
    np.testing.assert_allclose(found, H, atol=1e-9 * np.abs(H).max())


def test_a_repeated_frequency_is_kept_as_often_as_the_sites_see_it():
    """Five equal oscillators on two masses that are the sites: two of five can be told apart."""
    k, m = 1e4, 0.1
    K = np.diag([1e5, 2e5, *[k] * 5]).astype(float)
    M = np.diag([1.0, 2.0, *[m] * 5])
    for i, base in enumerate((0, 0, 1, 1, 1)):
        K[base, base] += k
        K[base, 2 + i] = K[2 + i, base] = -k
    model = ao.extract(
        ao.Structure.from_matrices(K, M), {"a": ao.Site(dof=0), "b": ao.Site(dof=1)}, 5, "modes"
    )
    assert model.n == 2
    assert model.info["modes_merged"] == 3
    np.testing.assert_allclose(model.m.sum(axis=0), np.diag([2 * m, 3 * m]), atol=1e-12)
    np.testing.assert_allclose(model.omega, np.sqrt(k / m), rtol=1e-9)


@pytest.fixture(scope="module")
def block() -> ao.Structure:
    return block_with_corners()


@pytest.mark.parametrize(
    ("sites", "words"),
    [
        ({}, "names no site"),
        ({"a:b": CORNERS["near"]}, "a text without ':'"),
        ({"": CORNERS["near"]}, "the name of a site"),
        ({1: CORNERS["near"]}, "the name of a site"),
        ({"a": (0.1, 0.02, 0.04)}, "site must be a Site"),
    ],
)
def test_bad_names(block, sites, words):
    with pytest.raises(ao.InputError, match=words):
        ao.extract(block, sites)


@pytest.mark.sample(-1)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("held", [0, 1])
def test_one_named_site_is_the_site_alone(held, method, rng):
    K, M = loose_chains((30,), held, rng)
    structure, site = ao.Structure.from_matrices(K, M), ao.Site(vector=rng.standard_normal(30))
    for n in (3, 8):
        alone = ao.extract(structure, site, n, method)
        named = ao.extract(structure, {"tip": site}, n, method)
        np.testing.assert_allclose(named.omega, alone.omega, rtol=1e-9)
        np.testing.assert_allclose(named.m[:, 0, 0], alone.m, rtol=1e-9)
        np.testing.assert_allclose(named.m0[0, 0], alone.m0, rtol=1e-9)
        np.testing.assert_allclose(named.k0[0, 0], alone.k0, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.sample(-1)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("held", [0, 1])
def test_every_truncation_is_passive(held, method, rng):
    K, M = loose_chains((25,), held, rng)
    B = rng.standard_normal((25, 3))
    structure = ao.Structure.from_matrices(K, M)
    least = np.linalg.inv(B.T @ np.linalg.solve(M, B))
    for n in range(12):
        model = ao.extract(structure, sites_of(B), n, method)
        assert model.n == n
        assert np.linalg.eigvalsh(model.m0 - least)[0] > -1e-12
        assert np.linalg.eigvalsh(model.k0)[0] > -1e-9 * np.abs(model.k0).max()
        shapes = model.shapes
        np.testing.assert_allclose(B.T @ shapes[:, :3], np.eye(3), atol=1e-11)
        np.testing.assert_allclose(shapes[:, :3].T @ M @ shapes[:, :3], model.m_st, atol=1e-11)
        np.testing.assert_allclose(shapes[:, :3].T @ M @ shapes[:, 3:], model.P, atol=1e-11)


@pytest.mark.slow
def test_the_other_site_free_is_the_site_alone(block):
    """The receptance of a site does not depend on which others the model has."""
    both = ao.extract(block, CORNERS, 60).site_modes()
    alone = ao.extract(block, CORNERS["far"], 40)
    omega = np.linspace(0.1, 1, 20) * 1.5 * alone.omega[0] * (1 + 0.01j)
    H = both.receptance(omega)[:, 1, 1]
    np.testing.assert_allclose(H * alone.dynamic_stiffness(omega), 1.0, atol=1e-7)


def _slanted(**options: object) -> ao.Site:
    return ao.Site((0.11, 0.02, 0.04), (0.1, 0.2, -1), radius=0.03, **options)


@pytest.mark.slow
def test_a_site_may_know_its_tangential_displacements(block):
    model = ao.extract(block, {"near": _slanted(tangential=True), "far": CORNERS["far"]}, 10)
    assert model.sites == ("near", "far")
    assert model.columns == {"near": (0, 1, 2), "far": (3,)}
    assert model.k0.shape == (4, 4)
    three = model.direction[:3]
    np.testing.assert_allclose(three @ three.T, np.eye(3), atol=1e-12)
    alone = ao.extract(block, _slanted(), 10)
    at_rest = model.site_modes().receptance(0.0).real
    assert at_rest[0, 0] == pytest.approx(1 / alone.k0, rel=1e-9)
    assert np.linalg.eigvalsh(at_rest)[0] > 0
    # where the plane of the site is turned, the displacement in space is the same one
    turned = ao.extract(block, {"near": ao.Site((0.11, 0.02, 0.04), (0, 0, -1), radius=0.03,
                                                tangential=True)}, 10)  # fmt: skip
    R = three @ turned.direction.T
    other = R @ turned.site_modes().receptance(0.0).real @ R.T
    np.testing.assert_allclose(other, at_rest[:3, :3], atol=1e-9 * at_rest.max())


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "slides"), [(0.05, True), (5.0, False)])
def test_an_oblique_blow_rubs(mu, slides):
    """A free block thrown askew on the floor: its momentum is what the contact's forces give."""
    free = ao.Structure(box((6, 3, 2)), ao.Solid(**STEEL))
    foot = ao.Site((0.1, 0.025, 0.0), (0, 0, 1), radius=0.025, tangential=True)
    model = ao.extract(free, {"foot": foot}, 12)
    scene = ao.Scene(
        {"block": model, "floor": ao.Obstacle()},
        [ao.Contact("block:foot", "floor", ao.Hertz(1e9), gap=1e-5, friction=mu)],
        motion={"block": ao.Motion(velocity=(1.0, 0.0, -0.5))},
    )
    hit = scene.run(2e-3)
    contact, momentum = hit["block:foot", "floor"], hit.bodies["block"].momentum
    change = momentum[-1] - momentum[0]
    assert contact.impulse > 0.5 * free.mass
    np.testing.assert_allclose(change[2], contact.impulse, rtol=1e-9)
    if slides:
        np.testing.assert_allclose(change[0], -mu * contact.impulse, rtol=0.02)
    else:
        assert abs(change[0]) < 0.5 * mu * contact.impulse
    assert hit.energy.drift < 2e-3


@pytest.mark.slow
def test_tangential_directions_of_an_assembly():
    top = {"top": (2, lambda x: np.isclose(x[2], 0.05)), "foot": (2, lambda x: np.isclose(x[2], 0))}
    under = {"under": (2, lambda x: np.isclose(x[2], 0))}
    plate = ao.Structure(box((4, 3, 1), (0.2, 0.1, 0.01), groups=under), ao.Solid(**STEEL))
    post = ao.Structure(
        box((2, 2, 2), (0.02, 0.02, 0.05), groups=top), ao.Solid(**STEEL), [ao.Support("foot")]
    )
    both = ao.assemble(
        {"plate": plate, "post": post},
        joints=[ao.Tie("post:top", "plate:under")],
        at={"plate": (0, 0, 0.05)},
    )
    site = ao.Site((0.15, 0.05, 0.06), (0, 0.6, -0.8), radius=0.043, tangential=True)
    model = ao.extract(both, {"far": site}, 8)
    np.testing.assert_allclose(model.direction @ model.direction.T, np.eye(3), atol=1e-12)
    # the displacement in space is the same whatever directions it is taken along
    across = ao.Site((0.15, 0.05, 0.06), (0, 0, -1), radius=0.043, tangential=True)
    other = ao.extract(both, {"far": across}, 8)
    R = model.direction @ other.direction.T
    at_rest = R @ other.site_modes().receptance(0.0).real @ R.T
    found = model.site_modes().receptance(0.0).real
    np.testing.assert_allclose(found, at_rest, atol=1e-9 * np.abs(at_rest).max())


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_ground_that_moves_across_the_site_is_felt_or_refused():
    """A bar at 45 degrees, shaken along x, bends along z; one site's direction does not tell it."""
    section = ao.Section.rectangle(0.03, 0.01)
    bar = ao.Beam(**STEEL, section=section, orientation=(-1, 0, 1), shear=False)
    part = ao.Structure(line(0.5, 12, (1.0, 0.0, 1.0)), bar, [ao.Support("left")])
    tip = ao.Site((0.5 / np.sqrt(2), 0, 0.5 / np.sqrt(2)), (0, 0, 1))
    base = ao.Base([0.0, 9.0], [(-100.0, 0, 0)] * 2)

    def shaken(model: ao.AntiOscillators | ao.ModalBody, end: str) -> ao.History:
        stop = ao.Contact(end, "stop", ao.Linear(1e5), gap=1.0)
        with warnings.catch_warnings(action="ignore", category=ao.AntioscWarning):
            return ao.Scene({"bar": model, "stop": ao.Obstacle()}, [stop], base=base).run(1.0)

    damping = ao.Damping(alpha=300.0)
    for model in (ao.extract(part, tip, 6, damping=damping), ao.full(part, tip)):
        with pytest.raises(ao.InputError, match=r"100 m/s² across .* a site that has a name"):
            shaken(model, "bar")
    hit = shaken(ao.extract(part, {"tip": tip}, 6, damping=damping), "bar:tip")
    sag = STEEL["rho"] * section.A * 50.0 * 0.5**4 / (8 * STEEL["E"] * section.I)
    moved = hit.bodies["bar"].displacement("tip")
    assert moved[-1] == pytest.approx(-sag, rel=1e-3)  # and 5e-4 of it by stretching


@pytest.mark.slow
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
        with warnings.catch_warnings(action="ignore", category=ao.AntioscWarning):
            hit = ao.Scene({"bar": model, "stop": ao.Obstacle()}, [stop], base=base).run(1.0)
        return float(ao.probe(part, hit, (0.5, 0, 0), body="bar")[-1, 1])

    exact = STEEL["rho"] * section.A * 100.0 * 0.5**4 / (8 * STEEL["E"] * section.I)
    assert sag((0, 1, 0)) == pytest.approx(exact, rel=1e-3)
    with pytest.warns(ao.AccuracyWarning, match=r"1.2 kg along y, and the model carries 0 %"):
        assert abs(sag((0, 0, 1))) < 1e-9 * exact


@pytest.mark.slow
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
    probed = ao.probe(block, hit, (0.2, 0.05, 0.04), times=times)
    assert probed.shape == (2, 3)
    assert np.abs(probed[1, 2]) > 1e-6
    listed = ao.write_series(block, hit, tmp_path / "run", times, body="part")
    assert listed.exists()
    with pytest.raises(ao.InputError, match="no displacement field"):
        ao.probe(block, hit, (0.2, 0.05, 0.04), times=times, body="ball")


@pytest.mark.slow
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


@pytest.mark.slow
def test_lowest_krylov_ones_are_the_antiresonances(block):
    krylov = ao.extract(block, CORNERS, 24)
    modes = ao.extract(block, CORNERS, 8, "modes")
    count = min(krylov.info["converged"], 8)
    assert count >= 5
    np.testing.assert_allclose(krylov.omega[:count], modes.omega[:count], rtol=1e-6)
    np.testing.assert_allclose(krylov.m[:count], modes.m[:count], rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(krylov.k0, modes.k0, rtol=1e-11)
    np.testing.assert_allclose(krylov.m_st, modes.m_st, rtol=1e-11)
