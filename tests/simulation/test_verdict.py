"""What is said of a run: cut during contact, nothing touched, restitution, the choice of n."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao
from scenes import HERTZ, case_two, rigid

CUT = "The run ends during contact .* up to 0.0005 s"
NOTHING = "nothing moves the bodies"
LAWS = [ao.Hertz(1e8), ao.Linear(1e5), ao.HuntCrossley(1e8, 0.7), ao.Thornton(1e8, 1e-5)]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("method", ["exact", "newmark", "DOP853"])
def test_a_run_that_ends_during_contact_says_so(law, method):
    if method == "DOP853" and law.has_memory:
        return
    with pytest.warns(ao.AccuracyWarning, match=CUT):
        hit = ao.simulate(rigid(1.0), ao.RigidMass(1.0, 1.0), law, 5e-4, method, gap=1e-4)
    assert hit.status == 3
    assert hit.message.startswith("The run ends during contact")
    # its figures are those so far
    assert hit.restitution is None
    assert hit.contact_time == pytest.approx(5e-4 - 1e-4, rel=1e-6)
    assert hit.impulse == pytest.approx(1.0 - hit.impactor_velocity[-1], rel=1e-6)
    assert hit.peak_force == hit.force[-1]


@pytest.mark.parametrize(
    ("scene", "says"),
    [
        ({"speed": -1.0}, "opens at 1 m/s"),
        ({"speed": 1.0, "initial_velocity": -3.0}, "opens at 2 m/s"),
        ({"speed": 1.0, "gap": 0.5}, r"0\.5 m .* closes at 1 m/s at first .* 0\.01 s"),
        ({"speed": 0.0, "gap": 0.5, "gravity": 9.81, "k0": 1e5}, r"closes at 9\.81 m/s\^2"),
        ({"speed": 0.0, "gap": 0.5, "gravity": -9.81, "k0": 1e5}, r"opens at 9\.81 m/s\^2"),
        ({"speed": 0.0}, NOTHING),
        ({"speed": 0.3, "initial_velocity": -0.3, "gap": 1e-3}, NOTHING),
    ],
)
def test_no_contact_is_said(scene, says):
    scene = dict(scene)
    striker, k0 = ao.RigidMass(0.7, scene.pop("speed")), scene.pop("k0", 0.0)
    body = ao.AntiOscillators(m0=1.0, k0=k0, m=[0.3], omega=[1e3])
    with pytest.warns(ao.AntioscWarning, match=f"Never touched: .*{says}"):
        hit = ao.simulate(body, striker, ao.Hertz(1e9), 0.01, **scene)
    assert hit.contacts == []
    assert hit.status == 0
    assert hit.message.startswith("Never touched")
    assert (hit.peak_force, hit.impulse, hit.contact_time, hit.restitution) == (0, 0, 0, None)


@pytest.mark.parametrize(
    ("duration", "speed", "status"), [(12e-3, 0.01, 0), (1e-3, 0.01, 3), (1e-3, -0.01, 0)]
)
@pytest.mark.parametrize("law", [ao.Hertz(HERTZ), ao.HuntCrossley(HERTZ, 0.7)])
def test_one_impact_has_one_verdict_and_one_contact_time(law, duration, speed, status):
    """Whole, cut during contact, and without any: of `simulate` and of the same scene."""
    model, _ = case_two(9)
    striker = ao.RigidMass(0.24, speed)
    told = []
    for run in (
        lambda: ao.simulate(model, striker, law, duration),
        lambda: ao.Scene({"a": model, "b": striker}, [ao.Contact("a", "b", law)]).run(duration),
    ):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            told.append((run(), [w.category for w in caught]))
    (hit, one), (scene, other) = told
    contact = scene["a", "b"]
    if status == 3 or isinstance(law, ao.Hertz):
        assert hit.status == status
    assert (scene.status, other) == (hit.status, one)
    assert contact.contact_time == pytest.approx(hit.contact_time, rel=1e-6)
    np.testing.assert_allclose(contact.contacts, hit.contacts, rtol=1e-6)
    if duration > 1e-3:
        assert contact.contact_time > 1.1 * sum(end - start for start, end in hit.contacts[:3])


class TestRestitution:
    """Newton's, of the rigid-body motions at the contact point."""

    def test_against_a_supported_structure_it_is_the_rebound(self):
        model, striker = case_two(9)
        hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 12e-3)
        w = hit.impactor_velocity
        assert hit.restitution == pytest.approx(-w[-1] / w[0], rel=1e-9)
        many = ao.simulate_many(model, striker, ao.Hertz(HERTZ), 12e-3)
        assert many.restitution[0] == pytest.approx(hit.restitution, rel=1e-6)

    def test_of_two_free_bodies_it_is_that_of_their_mean_motions(self):
        """1 - e is the energy that their vibrations take: m_red v² (1 - e²)/2."""
        model = ao.AntiOscillators(m0=0.2, k0=0.0, m=[0.5, 0.3], omega=[2e3, 9e3])
        hit = ao.simulate(model, ao.RigidMass(1.5, 2.0), ao.Hertz(1e9), 5e-3, initial_velocity=0.5)
        reduced = 1 / (1 / 1.5 + 1 / model.m_st)
        assert hit.impulse == pytest.approx(reduced * 2.5 * (1 + hit.restitution), rel=1e-6)
        _, v = hit.states(5e-3)
        shaken = hit.assembly.system.omega > 0
        left = 0.5 * np.sum(v[0, shaken] ** 2)
        left += hit.energy.strain[-1]
        lost = 0.5 * reduced * 2.5**2 * (1 - hit.restitution**2)
        assert left == pytest.approx(lost, rel=2e-3)
        many = ao.simulate_many(
            model, ao.RigidMass(1.5, 2.0), ao.Hertz(1e9), 5e-3, initial_velocity=0.5
        )
        assert many.restitution[0] == pytest.approx(hit.restitution, rel=1e-6)


class TestChoiceOfN:
    """The runs that choose n are made like the one that is asked for."""

    @pytest.mark.slow
    def test_a_massless_point_under_a_damped_law_is_left_to_the_exact_method(self):
        model, striker = case_two(6)
        law = ao.HuntCrossley(HERTZ, 0.7)
        hit = ao.simulate(model, striker, law, 2e-3, "DOP853", n="auto", tol=0.1, step=2e-5)
        assert 0 < hit.model.n <= 6


def sheet(thickness, **of):
    """A model on a spring of 1e5 N/m, of a sheet of that thickness [m]."""
    info = {} if thickness is None else {"thickness": thickness}
    return ao.AntiOscillators(m0=0.01, k0=1e5, m=[0.5], omega=[5e3], info=info, **of)


FAR = r"'structure' deflects by .* mm, .* times its thickness .* mm, more than 0.5"


@pytest.mark.parametrize("scene", [False, True])
def test_a_sheet_that_deflects_beyond_half_its_thickness_is_told(scene):
    def run(thickness):
        model, ball = sheet(thickness), ao.RigidMass(0.2, 1.0)
        if not scene:
            return ao.simulate(model, ball, ao.Linear(1e7), 0.02)
        bodies = {"structure": model, "impactor": ball}
        contacts = [ao.Contact("structure", "impactor", ao.Linear(1e7))]
        return ao.Scene(bodies, contacts).run(0.02)

    fine = run(None).at(np.linspace(0, 0.02, 20_001))["structure"]
    u = abs(fine.displacement("structure")).max()
    assert "deflects" not in run(u / 0.49).message
    with pytest.warns(ao.AccuracyWarning, match=FAR):
        hit = run(u / 0.52)
    assert float(hit.message.split(" times its")[0].split()[-1]) == pytest.approx(0.52, rel=0.01)
    assert 'stretch "auto"' in hit.message
