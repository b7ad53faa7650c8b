"""The law that a contact needs: Hertz's below yield, bit for bit, and told with its error."""

import re
from dataclasses import replace
from math import inf, pi, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

import antiosc as ao
from antiosc.base import materials
from antiosc.engine.contact.choice import choose_law, lacks_strength
from antiosc.engine.contact.geometry import effective_modulus
from antiosc.engine.contact.laws import yield_factor
from antiosc.engine.contact.peak_error import TABOR_STRAIN, error_of_peak, mean_strain_rate
from antiosc.engine.contact.surfaces import RIGID_MATTER, Matter, Surface, ball, matter_of

YIELDING = [name for name in materials.names() if materials.record(name).yield_strength]
STIFF = [name for name in materials.names() if not name.startswith(("wood", "rubber"))]
ALLOY, STEEL = matter_of("6061"), matter_of("100Cr6")


def model(surface: Surface | None, **more: object) -> ao.AntiOscillators:
    known = {} if surface is None else {"surfaces": {"": surface.as_dict()}}
    return ao.AntiOscillators(m0=0.02, k0=2e6, m=[0.3, 0.1], omega=[3e3, 2e4], info=known, **more)


def scenes():
    """200 blows, drawn: the struck model, the ball."""
    drawn = np.random.default_rng(44)
    for _ in range(200):
        struck, striker = drawn.choice(YIELDING), drawn.choice(STIFF)
        bent = 0.0 if drawn.random() < 0.3 else 10 ** drawn.uniform(0, 3)
        flat = 0.0 if drawn.random() < 0.5 else bent * drawn.random()
        surface = Surface(matter_of(str(struck)), (flat, bent), kind="curved")
        speed, radius = 10 ** drawn.uniform(-3.5, 0.7), 10 ** drawn.uniform(-3, -1.5)
        yield surface, ao.Sphere(radius, material=str(striker), velocity=speed)


@pytest.mark.slow
def test_of_200_scenes_those_below_yield_are_hertz():
    elastic = 0
    for surface, striker in scenes():
        hit = ao.simulate(model(surface), striker, duration=2e-3)
        law = hit.law
        strength = min(
            m.yield_strength for m in (surface.matter, striker.material) if m.yield_strength
        )
        assert isinstance(law, ao.ElasticPlastic)
        assert law.yield_strength == strength
        modulus = effective_modulus(surface.matter.E, surface.matter.nu, striker.E, striker.nu)
        round_one = len({*surface.curvatures}) == 1
        assert law.modulus == modulus if round_one else law.modulus > modulus
        pressure = 2 * law.modulus / pi * sqrt(hit.deepest / law.radius)
        if pressure > 1.6 * strength:
            beyond = hit.deepest > law.yield_indentation
            assert (hit.peak_force < law.stiffness * hit.deepest**1.5) == beyond
            continue
        elastic += 1
        usual = ao.simulate(model(surface), striker, ao.Hertz(law.stiffness), duration=2e-3)
        np.testing.assert_array_equal(hit.force, usual.force)
        np.testing.assert_array_equal(hit.time, usual.time)
        assert hit.dent is None
        (share,) = re.findall(r"([-.e\d]+) times that of first yield", hit.verdict)
        assert float(share) == pytest.approx(sqrt(hit.deepest / law.yield_indentation), rel=0.01)
    assert 40 < elastic < 160


@pytest.mark.parametrize(
    ("one", "other", "law"),
    [
        (Surface(ALLOY), ball(STEEL, 0.01), ao.ElasticPlastic),
        (Surface(matter_of("glass, soda-lime")), ball(matter_of("alumina"), 0.01), ao.Hertz),
        (Surface(Matter(70e9)), ball(Matter(210e9), 0.01), ao.Hertz),
        (Surface(Matter(3e6, 0.49, brittle=True, loss=0.2)), ball(STEEL, 0.01), ao.Gonthier),
        (Surface(Matter(9e9, 0.0, critical=8e-5)), ball(STEEL, 0.01), ao.YangSun),
        (Surface(ALLOY, radius=0.01), Surface(RIGID_MATTER), ao.Linear),
        (Surface(ALLOY, (100.0, 100.0), kind="edge"), Surface(RIGID_MATTER), ao.ElasticPlastic),
    ],
)
def test_the_table_of_laws(one, other, law):
    found = choose_law(one, other)
    assert isinstance(found.law, law)
    assert choose_law(other, one).law == found.law


def test_the_stiffness_is_that_of_hertz():
    cylinder = Surface(ALLOY, (0.0, 1 / 0.018), kind="line")
    known = ao.Hertz.from_radii(0.01, STEEL.E, STEEL.nu, (inf, 0.018), ALLOY.E, ALLOY.nu)
    assert choose_law(cylinder, ball(STEEL, 0.01)).law.stiffness == pytest.approx(known.stiffness)
    crossed = Surface(STEEL, (0.0, 100.0), kind="line", along=(0.0, 1.0, 0.0))
    own = replace(cylinder, along=(1.0, 0.0, 0.0))
    known = ao.Hertz.from_radii(
        (inf, 0.018), ALLOY.E, ALLOY.nu, (inf, 0.01), STEEL.E, STEEL.nu, 90.0
    )
    assert choose_law(own, crossed).law.stiffness == pytest.approx(known.stiffness)


@pytest.mark.parametrize("ratio", [1.0, 1.5, 4.0, 30.0])
def test_an_ellipse_yields_where_its_own_pressure_says(ratio: float):
    """Of a spheroid on a plane: semi-axes by quadrature of Hertz's pressure, Johnson 3.3."""
    bent = (50.0, 50.0 * ratio)
    law = choose_law(Surface(RIGID_MATTER, bent, kind="curved"), Surface(ALLOY)).law
    E, d = ALLOY.E / (1 - ALLOY.nu**2), law.yield_indentation
    t = (np.arange(4000) + 0.5) * pi / 8000

    def integrals(squared: float) -> tuple[float, float]:
        """K and D of the modulus 1 - (b/a)^2."""
        root = np.sqrt(1 - (1 - squared) * np.sin(t) ** 2)
        return float(np.mean(1 / root)) * pi / 2, float(np.mean(np.sin(t) ** 2 / root)) * pi / 2

    def mismatch(squared: float) -> float:
        K, D = integrals(squared)
        return (K - D) / (squared * D) - ratio

    squared = brentq(mismatch, 1e-4, 1.0, xtol=1e-14) if ratio > 1 else 1.0
    K, D = integrals(squared)
    a = sqrt(d * D / (25.0 * K))
    b = a * sqrt(squared)
    pressure = d * E / (K * b)
    assert pressure == pytest.approx(yield_factor(ALLOY.nu) * ALLOY.yield_strength, rel=1e-6)
    assert law.yield_force == pytest.approx(2 / 3 * pi * a * b * pressure, rel=1e-6)


@pytest.mark.parametrize(
    ("one", "other", "word"),
    [
        (Surface(RIGID_MATTER), Surface(RIGID_MATTER), "rigid"),
        (Surface(ALLOY, (-120.0, -120.0), kind="curved"), ball(STEEL, 0.01), "fit into"),
        (Surface(ALLOY), Surface(RIGID_MATTER), "flat"),
    ],
)
def test_surfaces_without_a_law(one, other, word):
    with pytest.raises(ao.InputError, match=word):
        choose_law(one, other)


def test_a_model_without_a_surface_asks_for_a_law():
    striker = ao.Sphere(0.01, material="100Cr6", velocity=1.0)
    for body in (model(None), ao.RigidMass(1.0)):
        with pytest.raises(ao.InputError, match="give the law") as caught:
            ao.simulate(body, striker, duration=1e-3)
        assert str(caught.value).count(".") <= 2
    with pytest.raises(ao.InputError, match="tip_radius"):
        ao.simulate(model(Surface(ALLOY)), ao.RigidMass(0.1, 1.0), duration=1e-3)
    with pytest.raises(ao.InputError, match="duration"):
        ao.simulate(model(Surface(ALLOY)), striker)


def test_everything_that_strikes_takes_the_same_law(tmp_path):
    body = model(Surface(ALLOY, (0.0, 20.0), kind="line"))
    striker = ao.Sphere(0.01, material="100Cr6", velocity=1.0)
    hit = ao.simulate(body, striker, duration=2e-3)
    many = ao.simulate_many(body, [striker, striker], duration=2e-3)
    assert many.peak_force == pytest.approx([hit.peak_force] * 2, rel=1e-12)
    scene = ao.Scene({"a": body, "b": striker}, [ao.Contact("a", "b")])
    assert scene.contacts[0].law == hit.law
    path = tmp_path / "model.npz"
    body.save(path)
    again = ao.simulate(ao.AntiOscillators.load(path), striker, duration=2e-3)
    assert again.law == hit.law
    assert ao.impact_band(striker, "auto", body) > 0
    drawn = ao.monte_carlo(
        lambda v: (body, replace(striker, velocity=v), "auto", 2e-3), {"v": [1.0]}, n=1
    )
    assert drawn.values["peak_force"][0] == pytest.approx(hit.peak_force, rel=1e-3)


@pytest.mark.parametrize("radius", [inf, 0.02])
def test_a_model_without_a_mesh_takes_a_material(tmp_path, radius):
    striker = ao.Sphere(0.01, material="100Cr6", velocity=1.0)
    struck = model(None).with_surface("6061", radius)
    law = ao.simulate(struck, striker, duration=2e-3).law
    assert (
        law
        == choose_law(
            ball(ALLOY, radius) if radius < inf else Surface(ALLOY), striker.surface()
        ).law
    )
    struck.save(tmp_path / "model.npz")
    again = ao.AntiOscillators.load(tmp_path / "model.npz")
    assert ao.simulate(again, striker, duration=2e-3).law == law
    several = ao.AntiOscillators(
        m0=np.eye(2), k0=1e6 * np.eye(2), P=np.zeros((2, 0)), omega=[], sites=("a", "b")
    ).with_surface("6061", radius)
    assert ao.Scene({"x": several, "y": striker}, [ao.Contact("x:b", "y")]).contacts[0].law == law
    for wrong in ({"material": None}, {"material": "6061", "radius": 0.0}):
        with pytest.raises(ao.InputError):
            struck.with_surface(**wrong)


ERRORS = np.diag([1e3, 1e3, 1e3])


def budgets(errors=ERRORS):
    """The budgets of a blow: all known, no strength, a law of the caller's, and no yield."""
    alloy = model(Surface(ALLOY), strain_error=errors)
    unknown = model(Surface(Matter(69e9, 0.33)), strain_error=errors)
    fast = ao.Sphere(0.01, material="100Cr6", velocity=2.0)
    slow = replace(fast, velocity=1e-3)
    plain = ao.Sphere(0.01, 210e9, 0.3, 7850.0, 2.0)
    return {
        "known": ao.simulate(alloy, fast, duration=2e-3),
        "slow": ao.simulate(alloy, slow, duration=2e-2),
        "unknown": ao.simulate(unknown, fast, duration=2e-3),
        "half known": ao.simulate(alloy, plain, duration=2e-3),
        "given": ao.simulate(unknown, fast, ao.Hertz(7e9), duration=2e-3),
    }


@pytest.mark.slow
def test_the_row_of_the_law_is_what_other_strengths_change():
    hits = budgets()
    bar = hits["known"].error_budget["peak_force"]
    assert 0.01 < bar.law < 0.3
    assert bar.total == pytest.approx(bar.numerical + bar.law)
    assert hits["slow"].error_budget["peak_force"].law < 1e-9
    assert hits["unknown"].error_budget["peak_force"].total is None
    exact = replace(ALLOY, yield_range=None)
    sure = ao.simulate(
        model(Surface(exact), strain_error=np.diag([1e3, 1e3, 1e3])),
        hits["known"].impactor,
        duration=2e-3,
    )
    assert sure.error_budget["peak_force"].law < bar.law


@pytest.mark.parametrize("loss", [0.0, 0.1])
@pytest.mark.parametrize(("speed", "share"), [(3e-3, 0.0), (0.1, 0.49), (20.0, None)])
def test_large_strains_are_in_the_row_of_an_elastic_law(
    speed: float, share: float | None, loss: float
) -> None:
    """Rubber: none below a hundredth of the radius, not known from 0.4 of it on."""
    struck = model(Surface(ALLOY), strain_error=np.diag([1e3, 1e3, 1e3]))
    rubber = replace(matter_of("rubber NR 50"), loss=loss)
    tip = ao.Sphere(0.02, material=rubber, rho=1100.0, velocity=speed)
    hit = ao.simulate(struck, tip, duration=0.2)
    assert isinstance(hit.law, ao.Gonthier if loss else ao.ElasticPlastic)
    bar, strain = hit.error_budget["peak_force"], hit.indentation.max() / 0.02
    if share is None:
        assert strain > 0.4
        assert bar.total is None
        assert "pressed in by" in str(hit.error_budget)
    elif share:
        assert 0.01 < strain < 0.1
        largest = share * sqrt(strain)
        assert 0.8 * largest < bar.law < largest * 1.05
    else:
        assert strain < 0.01
        assert bar.law < 1e-9


def fall_of_a_point(law: ao.ElasticPlastic, mass: float, speed: float, rate) -> float:
    """Peak force of a mass on a wall whose strength follows the strain rate at each moment."""
    depth, peak, h = 1e-3 * law.yield_indentation, 0.0, 2e-8
    while speed > 0:
        now = TABOR_STRAIN * speed / (2 * sqrt(depth * law.radius))
        hard = replace(law, yield_strength=rate(now))
        force = hard.force(depth, 0.0, hard.touch(1.0))
        peak = max(peak, force)
        speed -= h * force / mass
        depth += h * speed
    return peak


@pytest.mark.parametrize("name", ["1.4301", "S235", "titanium grade 2"])
def test_the_mean_strain_rate_gives_the_peak_of_a_strength_that_follows_it(name):
    """Cowper and Symonds at each moment of the approach, in an own integrator; told by the row."""
    metal, ball_mass, radius = replace(matter_of(name), yield_range=None), 0.03, 0.01
    errors = np.diag([1e3, 1e3, 1e3])
    still = ao.AntiOscillators(
        m0=30.0, k0=1.0, m=[1.0, 1.0], omega=[1e-3, 2e-3], strain_error=errors,
        info={"surfaces": {"": Surface(metal).as_dict()}},
    )  # fmt: skip
    striker = ao.RigidMass(ball_mass, 2.0, tip_radius=radius, material=RIGID_MATTER)
    hit = ao.simulate(still, striker, duration=1e-3, tol=1e-5)
    start, end = hit.contacts[0]
    rate_at_peak = mean_strain_rate(hit.law, hit.deepest, end - start)
    low, high = metal.strengths_at(rate_at_peak)
    assert low == metal.yield_strength
    D, q, *static = metal.rate

    def rate(now: float) -> float:
        return (static[0] if static else low) * (1 + (now / D) ** (1 / q))

    followed = fall_of_a_point(hit.law, ball_mass * 32 / 32.03, 2.0, rate)
    again = ao.simulate(still, striker, replace(hit.law, yield_strength=high), 1e-3, tol=1e-5)
    assert 0.9 * again.peak_force < followed < again.peak_force  # slow where it turns
    assert followed > 1.1 * hit.peak_force
    row = hit.error_budget["peak_force"].law
    assert followed < (1 + row) * hit.peak_force


def test_a_strength_that_may_be_lower_counts_before_the_usual_one_yields():
    """The usual strength stays elastic, the lowest does not: the row is the change by it."""
    weak = replace(ALLOY, yield_range=(0.3 * ALLOY.yield_strength, ALLOY.yield_strength))
    struck = model(Surface(weak), strain_error=np.diag([1e3, 1e3, 1e3]))
    ball = ao.Sphere(0.01, material="100Cr6", velocity=0.005)
    hit = ao.simulate(struck, ball, duration=5e-3)
    assert hit.dent is None
    other = replace(hit.law, yield_strength=weak.yield_range[0])
    change = abs(ao.simulate(struck, ball, other, duration=5e-3).peak_force / hit.peak_force - 1)
    assert change > 0.01
    assert hit.error_budget["peak_force"].law == pytest.approx(change, rel=0.05)
    choice = choose_law(Surface(weak), ball.surface())
    at_equal_work = error_of_peak(choice, hit.peak_force, hit.contact_time)
    assert change < at_equal_work < 1.5 * change  # a structure that gives way changes less
    exact = replace(weak, yield_range=None)
    alone = choose_law(Surface(exact), ball.surface())
    assert error_of_peak(alone, hit.peak_force, hit.contact_time) == 0.0


@pytest.mark.parametrize(
    ("E", "nu", "known"), [(20e6, 0.48, True), (20e6, 0.3, False), (200e6, 0.48, False)]
)
def test_a_rubber_by_its_constants_does_not_yield(E: float, nu: float, known: bool) -> None:
    tip = Surface(Matter(E, nu), curvatures=(100.0, 100.0))
    choice = choose_law(tip, Surface(ALLOY))
    assert lacks_strength(choice) != known
    assert ("with a rubber" in choice.kind) == known
    assert choice.soft_ball
    assert not choose_law(
        Surface(Matter(E, nu)), Surface(ALLOY, curvatures=(100.0, 100.0))
    ).soft_ball
