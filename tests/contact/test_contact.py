"""Contact laws: their contract, published formulas, slopes, and energy over closed cycles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid

import antiosc as ao
from antiosc.engine.contact.laws import Punch
from antiosc.impact.histories.energy import replayed_energies
from law_formulas import permanent, restitution_of, unloading_power, virgin, whole
from laws import LAWS, laws
from scenes import HERTZ, rigid, thornton_restitution


@laws
def test_energy_balance_over_cycles(law, rng):
    """Work done = energy held + energy lost, along a random path with partings."""
    state = law.touch(1.0)
    delta, work, most = 0.0, 0.0, 0.0
    for leg in range(12):
        low = law.origin(state)
        target = low if leg % 4 == 3 else rng.uniform(low, 1.4e-4)
        path = np.linspace(delta, target, 1000)
        force = np.empty(path.size)
        for i, d in enumerate(path):
            force[i] = law.force(d, 0.0, state)
            state = law.advance(d, 0.0, state)
        work += trapezoid(force, path)
        delta, most = target, max(most, work)
        assert work == pytest.approx(
            law.energy(delta, state) + law.lost(state), rel=1e-4, abs=1e-5 * most
        )
        assert law.lost(state) >= -1e-12 * most
        if leg % 4 == 3:
            assert law.energy(delta, state) == pytest.approx(0.0, abs=1e-12 * most)
            state = law.touch(1.0, state)


@laws
def test_implicit_solution_fulfils_the_law(law, rng):
    deep = law.advance(9e-5, 0.0, law.touch(1.0))
    for state in (law.touch(1.0), deep, law.touch(1.0, deep)):
        for delta in rng.uniform(1e-6, 1.3e-4, 12):
            for alpha in (0.0, 1e-12, 1e-8, 1e-5, 1.0):
                held = 1e3 * alpha
                F = law.implicit(delta, alpha, 0.3, held, state, 7.0)
                there = law.force(delta - alpha * F, 0.3 - held * F, state)
                # F is known to rounding of the indentation
                by_delta, by_rate = law.tangent(delta - alpha * F, 0.3 - held * F, state)
                noise = 1e-13 * (by_delta * delta + by_rate * 0.3)
                assert there == pytest.approx(F, rel=1e-9, abs=noise + 1e-12)
        assert law.implicit(-1e-6, 1e-8, 0.3, 1e-5, state) == 0.0


@pytest.mark.parametrize("law", [ao.HuntCrossley, ao.LankaraniNikravesh, ao.Flores])
@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_damped_laws_obey_their_first_integral(law, exponent):
    contact = law(1e8, 0.7, exponent=exponent)
    hit = ao.simulate(rigid(0.5), ao.RigidMass(0.24, 1.3), contact, 1e-2, tol=1e-4)
    assert hit.restitution == pytest.approx(restitution_of(contact.factor), rel=1e-4)


def test_thornton_restitution_is_the_published_formula():
    mass = 0.24 * 0.5 / 0.74
    for ratio in (0.1, 0.4, 0.9):
        law = ao.Thornton(HERTZ, 3e-6)
        yield_speed = np.sqrt(0.8 * HERTZ * 3e-6**2.5 / mass)
        striker = ao.RigidMass(0.24, yield_speed / ratio)
        hit = ao.simulate(rigid(0.5), striker, law, 5e-3, tol=1e-4)
        assert hit.restitution == pytest.approx(thornton_restitution(ratio), rel=1e-4)
        lost = hit.energy.dissipated[-1] / (0.5 * mass * striker.velocity**2)
        assert lost == pytest.approx(1 - hit.restitution**2, rel=1e-3)


def test_restitution_and_damping_factor_are_inverse():
    """(1 + d)/(1 − e d) = exp(d (1 + e)): Gonthier's factor of e gives e back."""
    assert ao.Gonthier(1.0, 1.0).factor == 0
    for e in (0.02, 0.2, 0.5, 0.9, 0.999):
        d = ao.Gonthier(1.0, e).factor
        if e >= 0.2:  # below, d is 1/e but for rounding
            assert (1 + d) / (1 - e * d) == pytest.approx(np.exp(d * (1 + e)), rel=1e-9)
        assert restitution_of(d) == pytest.approx(e, rel=1e-6)
    assert restitution_of(1e6) == pytest.approx(1e-6, rel=1e-3)


@pytest.mark.parametrize("law", [ao.Thornton(1e9, 1e-5), ao.ElasticPlastic(1e10, 5.6e-3, 4e7)])
def test_what_several_contacts_lose_is_the_work_around_their_loops(law):
    """Loaded twice, deeper the second time; plasticity keeps what unloading does not give back."""
    state, depth, force, spans = law.touch(1.0), [], [], []
    for deepest in (6e-5, 1e-4):
        first = len(depth)
        state = law.touch(1.0, state)
        path = np.linspace(law.origin(state), deepest, 4001)
        for delta in path:
            state = law.advance(delta, 0.0, state)
            depth.append(delta)
            force.append(law.force(delta, 0.0, state))
        for delta in np.linspace(deepest, law.origin(state), 4001)[1:]:
            depth.append(delta)
            force.append(law.force(delta, 0.0, state))
        spans.append((first, len(depth) - 1))
    depth, force = np.array(depth), np.array(force)
    _, lost, _ = replayed_energies(law, force, depth, spans, [1.0, 1.0])
    for _, end in spans:
        mean = (force[1 : end + 1] + force[:end]) / 2
        assert lost[end] == pytest.approx(mean @ np.diff(depth[: end + 1]), rel=1e-4)


@pytest.mark.slow
def test_the_work_of_loading_is_the_integral_of_the_force():
    """Of all plastic laws, deep beyond yield."""
    for law in LAWS.values():
        if not law.has_memory:
            continue
        depths = np.concatenate([np.linspace(0, 1.4e-4, 6001), np.linspace(1.4e-4, 2e-3, 6001)])
        forces = [law.force(d, 0.0, law.touch(1.0)) for d in depths]
        work = np.append(0.0, np.cumsum(np.diff(depths) * (np.add(forces[1:], forces[:-1])) / 2))
        for i in (60, 900, 6000, 8000, 12001):
            if law.compliance and forces[i] > law.valid_force:
                break
            assert law.loading_work(depths[i]) == pytest.approx(work[i], rel=2e-3)


PLASTIC = [law for law in LAWS.values() if law.has_memory and not getattr(law, "elastic", False)]
DEPTHS = (1e-9, 3e-6, 2e-5, 7e-5, 2e-4, 2e-3)


@laws
def test_forces_are_those_of_the_formulas(law: ao.ContactLaw) -> None:
    state = law.touch(0.8)
    assert law.force(-1e-6, 0.3, state) == 0.0
    for d in DEPTHS:
        expected = virgin(law, d)
        assert law.force(d, 0.0, state) == pytest.approx(expected, rel=1e-9)
        if law.rate_dependent:
            grip = 1 + law.factor * 0.3 / 0.8
            assert law.force(d, 0.3, state) == pytest.approx(expected * grip, rel=1e-9)
            assert law.force(d, -1e6, state) == 0.0


@pytest.mark.parametrize("law", PLASTIC, ids=lambda law: type(law).__name__)
def test_unloading_and_reloading_are_those_of_the_formulas(law: ao.ContactLaw) -> None:
    deepest = 8e-5
    state = law.advance(deepest, 0.0, law.touch(0.8))
    low, top = permanent(law, deepest), virgin(law, deepest)
    assert law.origin(state) == pytest.approx(low, rel=2e-3, abs=1e-12)
    low = law.origin(state)
    if isinstance(law, ao.Tabulated):
        assert law.force(deepest, 0.0, state) == pytest.approx(top, rel=1e-9)
        return
    laminate = isinstance(law, ao.YangSun)
    power, width = unloading_power(law, deepest), whole(law, deepest)[0] - low
    for share in (0.2, 0.7, 1.0):
        force, again = top * share**power, top * share ** (1.5 if laminate else power)
        d = low + share * width - law.compliance * force
        assert law.force(d, 0.0, state) == pytest.approx(force, rel=1e-9)
        d = low + share * width - law.compliance * again
        assert law.force(d, 0.0, law.touch(0.3, state)) == pytest.approx(again, rel=1e-9)


@laws
def test_slopes_and_energies_are_derivatives_and_integrals(law: ao.ContactLaw) -> None:
    state = law.touch(0.8)
    for d in DEPTHS[1:]:
        by_delta, by_rate = law.tangent(d, 0.1, state)
        h = 1e-5 * d
        slope = (law.force(d + h, 0.1, state) - law.force(d - h, 0.1, state)) / (2 * h)
        assert by_delta == pytest.approx(slope, rel=1e-3)
        rise = (law.force(d, 0.11, state) - law.force(d, 0.09, state)) / 0.02
        assert by_rate == pytest.approx(rise, rel=1e-6, abs=1e-9)
        if law.compliance and law.force(d, 0.0, state) > law.valid_force:
            continue  # without a patch energies are exact within the law's range
        path = np.linspace(0, d, 1001)
        force = [law.force(each, 0.0, state) for each in path]
        work = float(trapezoid(force, path))
        assert law.potential(d, state) == pytest.approx(work, rel=1e-4)
        np.testing.assert_allclose(law.energies(path, state)[-1], law.energy(d, state), rtol=1e-12)


STEEL = {"E": 210e9, "nu": 0.3}


def test_sphere_on_plane_and_sphere_on_sphere():
    E, nu, R = 2.1e11, 0.3, 0.01
    E_star = E / (1 - nu**2)
    law = ao.Hertz.from_radii(R, E, nu)
    assert law.stiffness == pytest.approx(4 / 3 * E_star * np.sqrt(R))
    pair = ao.Hertz.from_radii(R, E, nu, R, E, nu)
    assert pair.stiffness == pytest.approx(4 / 3 * (E_star / 2) * np.sqrt(R / 2))
    cup = ao.Hertz.from_radii(R, E, nu, -3 * R)
    assert cup.stiffness == pytest.approx(4 / 3 * E_star * np.sqrt(1.5 * R))


def test_ellipse_against_the_integral():
    """delta and the curvatures from the potential of Hertz's pressure, by direct quadrature.

    With semi-axes a, b and the peak pressure p0: A, B and delta are p0 a b/(2 E*) times integrals
    of ds/sqrt((a^2 + s)(b^2 + s) s) with weights 1/(a^2 + s), 1/(b^2 + s), 1.
    """
    from scipy.integrate import quad

    a, b, p0, E_star = 3e-4, 1e-4, 1e9, 1e11

    def integral(weight):
        # s = (u/(1-u))^2 takes the root singularity and the infinite range away
        def f(u):
            s = a * b * (u / (1 - u)) ** 2
            ds = 2 * a * b * u / (1 - u) ** 3
            return weight(s) * ds / np.sqrt((a * a + s) * (b * b + s) * s)

        return p0 * a * b / (2 * E_star) * quad(f, 0, 1, epsrel=1e-11)[0]

    A = integral(lambda s: 1 / (a * a + s))
    B = integral(lambda s: 1 / (b * b + s))
    delta = integral(lambda s: 1.0)
    force = 2 / 3 * np.pi * p0 * a * b
    law = ao.Hertz.from_radii((1 / (2 * A), 1 / (2 * B)), E_star, 0.0)
    assert law.force(delta, 0.0, ()) == pytest.approx(force, rel=1e-8)


def test_johnson_s_figures_for_steel():
    """τ = 0.31 p0 at 0.48 a, edge tension 0.133 p0 (Contact Mechanics, section 3.4)."""
    ball = ao.Sphere(0.01, **STEEL, rho=7850.0)
    found = ao.contact_stress(ball, 100.0, **STEEL)
    assert found.shear / found.pressure == pytest.approx(0.31, abs=2e-3)
    assert found.depth / found.radius == pytest.approx(0.48, abs=5e-3)
    assert found.tension / found.pressure == pytest.approx(0.1333, abs=1e-3)
    assert 2 / 3 * found.pressure * np.pi * found.radius**2 == pytest.approx(100.0)


@pytest.mark.parametrize("e", [0.02, 0.3, 0.6, 0.95, 1.0])
def test_gonthier_returns_the_restitution_it_was_given(e):
    hit = ao.simulate(rigid(0.5), ao.RigidMass(0.24, 1.3), ao.Gonthier(HERTZ, e), 2e-3, tol=1e-4)
    assert hit.restitution == pytest.approx(e, rel=1e-3)


@pytest.mark.parametrize("e", [0.4, 0.9])
def test_damping_factors_are_those_of_their_papers(e):
    """3 (1 - e)/2, 3 (1 - e²)/4 and 8 (1 - e)/(5 e)."""
    laws = (ao.HuntCrossley, ao.LankaraniNikravesh, ao.Flores)
    published = [1.5 * (1 - e), 0.75 * (1 - e**2), 1.6 * (1 - e) / e]
    assert [law(HERTZ, e).factor for law in laws] == pytest.approx(published, rel=1e-12)


def test_force_beyond_the_table():
    with pytest.raises(ao.AccuracyError, match="last point"):
        ao.simulate(rigid(1.0), ao.RigidMass(1.0, 30.0), LAWS["table"], 1e-2)


def test_hertz_without_patch_on_a_spring_is_hertz_on_the_stiffer_spring():
    """Compliance c in the structure and subtracted from the contact: the same as in neither."""
    k, c, stiff = 1e9, 2e-8, 1e7
    soft = 1 / (1 / stiff + c)
    with_patch = ao.AntiOscillators(m0=0, k0=soft, m=[], omega=[], local_compliance=c, radius=1e-3)
    without = ao.AntiOscillators(m0=0, k0=stiff, m=[], omega=[])
    striker = ao.RigidMass(0.01, 0.2)
    a = ao.simulate(with_patch, striker, ao.Hertz(k), 2e-3, tol=1e-5)
    b = ao.simulate(without, striker, ao.Hertz(k), 2e-3, tol=1e-5)
    assert a.peak_force == pytest.approx(b.peak_force, rel=1e-4)
    assert a.contact_time == pytest.approx(b.contact_time, rel=1e-4)
    assert "was subtracted" in " ".join(a.details)


class Spring(ao.ContactLaw):
    """A linear law of the caller's own."""

    def __init__(self, stiffness):
        self.stiffness = stiffness

    def force(self, delta, rate, state):
        return self.stiffness * max(delta, 0.0)

    def tangent(self, delta, rate, state):
        return self.stiffness * (delta > 0), 0.0

    def energy(self, delta, state):
        return 0.5 * self.stiffness * max(delta, 0.0) ** 2


@pytest.mark.parametrize("k", [3e6, 7e6, 8e6])
@pytest.mark.parametrize(
    "law",
    [
        ao.Linear,
        lambda k: ao.Power(k, 1.0),
        lambda k: ao.Tabulated([0.0, 1e-3], [0.0, 1e-3 * k]),
        lambda k: ao.HuntCrossley(k, restitution=1.0, exponent=1.0),
        Spring,
    ],
    ids=["linear", "power", "table", "damped", "own"],
)
def test_a_given_law_keeps_all_of_its_compliance(law, k):
    """2 kg at 0.1 m/s on a spring k0 with a patch: v sqrt(m k k0/(k + k0)), in a scene too."""
    k0, striker = 1.2e7, ao.RigidMass(2.0, 0.1)
    part = ao.AntiOscillators(m0=0, k0=k0, m=[], omega=[], local_compliance=2e-8, radius=3e-3)
    peak = 0.1 * np.sqrt(2 * k * k0 / (k + k0))
    hit = ao.simulate(part, striker, law(k), 5e-3, tol=1e-4)
    assert hit.peak_force == pytest.approx(peak, rel=1e-3)
    assert "taken as given" in " ".join(hit.details)
    scene = ao.Scene({"part": part, "ball": striker}, [ao.Contact("part", "ball", law(k))])
    assert scene.run(5e-3, tol=1e-4)["part", "ball"].peak_force == pytest.approx(peak, rel=1e-3)
    many = ao.simulate_many(part, [striker, striker], law(k), 5e-3, tol=1e-4)
    assert many.peak_force == pytest.approx(peak, rel=1e-3)


@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_permanent_indentation_of_a_laminate_takes_energy(speed):
    """A mass on a rigid body: m v²/2 = (2/5) F δm loads, F (δm - δp)/(7/2) comes back."""
    mass = 0.1
    deepest = (1.25 * mass * speed**2 / 1e9) ** 0.4
    assert deepest > 1e-5
    back = (1e-5 / deepest) ** 0.4 * 5 / 7
    law = ao.YangSun(1e9, 1e-5)
    hit = ao.simulate(rigid(1e9), ao.RigidMass(mass, speed), law, 2e-3, tol=1e-5)
    assert hit.indentation.max() == pytest.approx(deepest, rel=1e-4)
    assert hit.restitution == pytest.approx(np.sqrt(back), rel=1e-3)


def test_tables_are_equal_where_their_curves_are():
    table, again = (ao.Tabulated([0.0, 1e-4, 2e-4], [0.0, 10.0, 30.0]) for _ in range(2))
    other = ao.Tabulated([0.0, 1e-4, 2e-4], [0.0, 10.0, 40.0])
    assert table == again
    assert hash(table) == hash(again)
    assert table != other


def test_equal_crossed_cylinders_are_a_sphere():
    law = ao.Hertz.from_radii((0.01, np.inf), 2e11, 0.3, (0.01, np.inf), 2e11, 0.3, angle=90)
    ball = ao.Hertz.from_radii(0.01, 2e11, 0.3, np.inf, 2e11, 0.3)
    assert law.stiffness == pytest.approx(ball.stiffness)


def test_the_law_of_a_punch_on_a_half_space_loses_the_patch():
    """Compliance c in the structure and subtracted from the contact: the same as in neither."""
    c, stiff = 1e-10, 1e7
    given = {"m0": 0, "m": [], "omega": []}
    soft = 1 / (1 / stiff + c)
    patched = ao.AntiOscillators(**given, k0=soft, local_compliance=c, radius=1e-3)
    striker, law = ao.RigidMass(0.01, 0.2), Punch(2e8)
    a = ao.simulate(patched, striker, law, 2e-3, tol=1e-6)
    b = ao.simulate(ao.AntiOscillators(**given, k0=stiff), striker, law, 2e-3, tol=1e-6)
    assert a.peak_force == pytest.approx(b.peak_force, rel=1e-4)


def test_thornton_yield_from_material():
    E_star, R, p = 1.1e11, 0.01, 1.5e9
    law = ao.Thornton.from_material(E_star, R, p)
    assert law.stiffness == pytest.approx(ao.Hertz.from_radii(R, E_star, 0.0).stiffness)
    # the pressure cut-off: dF/d(area of contact) = p beyond yield, with area = pi R delta
    delta = 5 * law.yield_indentation
    assert law.tangent(delta, 0.0, law.touch(1.0))[0] == pytest.approx(np.pi * R * p)
