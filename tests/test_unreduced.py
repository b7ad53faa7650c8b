"""The unreduced model in time, against many anti-oscillators on the same mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.strikes.unreduced import curve_results, run_newmark, unreduced_impact
from parts import STEEL, box, plate
from sheets import at, rectangle

pytestmark = [
    pytest.mark.fem,
    pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning"),
    pytest.mark.filterwarnings("ignore::antiosc.base.errors.AntioscWarning"),
]
SHEET = ao.Solid(**STEEL, plane="stress", thickness=0.01)
HELD = [ao.Support("left")]
EDGE = ao.Site((0.25, 0.1), (0, -1), radius=0.012)
TIP = ao.Site((0.55, 0.01), (0, -1), radius=0.004)
TOP = ao.Site((0.15, 0.02, 0.04), (0, 0, -1), radius=0.01)
BALL = ao.RigidMass(0.5, 1.0)
HERTZ = ao.Hertz(1e10)


def sheet() -> ao.Structure:
    return ao.Structure(plate((12, 4), (0.3, 0.1)), SHEET, HELD)


def slender() -> ao.Structure:
    """It meets the ball several times."""
    return ao.Structure(plate((24, 1), (0.6, 0.01)), SHEET, HELD)


def free() -> ao.Structure:
    return ao.Structure(box((4, 2, 2), cell="tetrahedron"), ao.Solid(**STEEL))


CASES = {
    "gap and gravity": (sheet, EDGE, HERTZ, 6e-4, {"gap": 1e-4, "gravity": 300.0}),
    "damped": (sheet, EDGE, ao.Gonthier(1e9, 0.6), 1.2e-3, {}),
    "plastic": (sheet, EDGE, ao.ElasticPlastic(115e9, 0.01, 3e8, 0.3), 1e-3, {}),
    "several contacts": (slender, TIP, HERTZ, 4e-3, {}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_force_is_that_of_many_anti_oscillators(name):
    made, site, law, duration, more = CASES[name]
    part = made()
    hit = ao.simulate(ao.extract(part, site, n=80), BALL, law, duration, tol=1e-6, **more)
    blow = unreduced_impact(part, site, hit, duration)
    curve = run_newmark(replace(blow, step=blow.step / 4)).curve
    true = hit.force_at(np.minimum(curve.time, duration))
    assert np.linalg.norm(curve.force - true) <= 3e-3 * np.linalg.norm(true)
    found = curve_results(curve)
    for quantity in ("peak_force", "impulse", "contact_time"):
        assert getattr(found, quantity) == pytest.approx(getattr(hit, quantity), rel=5e-4)


@pytest.mark.slow
def test_second_order_in_the_step():
    part = free()
    hit = ao.simulate(ao.extract(part, TOP, n=20), BALL, HERTZ, 4e-4)
    blow = unreduced_impact(part, TOP, hit, 3e-4)
    coarse, middle, fine = (run_newmark(replace(blow, step=1e-6 / k)).curve for k in (1, 2, 4))
    first = np.linalg.norm(coarse.force - middle.force[::2][: len(coarse.force)])
    second = np.linalg.norm(middle.force[::2] - fine.force[::4][: len(middle.force[::2])])
    assert np.log2(first / second) == pytest.approx(2.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["damped", "moving", "no contact", "elastic"])
def test_what_it_does_not_integrate_is_refused(what):
    part = free()
    model = ao.extract(part, TOP, n=10)
    ball = BALL
    more = {}
    if what == "damped":
        model = replace(model, damping=ao.Damping(0.02))
    if what == "moving":
        more = {"initial_velocity": 0.1}
    if what == "no contact":
        ball = ao.RigidMass(0.5, -1.0)
    if what == "elastic":
        ball = ao.Impactor(model, 1.0)
    hit = ao.simulate(model, ball, HERTZ, 4e-4, **more)
    with pytest.raises(ao.InputError, match={"moving": "at rest"}.get(what, what)):
        unreduced_impact(part, TOP, hit, 4e-4)


#: Name -> (a part in cells n times as small, its site, the contact).
BENT = {
    "in its plane": (
        lambda n: ao.Structure(plate((8 * n, 3 * n), (0.3, 0.1)), SHEET, HELD),
        EDGE,
        HERTZ,
    ),
    "a shell": (
        lambda n: ao.Structure(
            rectangle(5 * n, 0.3, 0.2), ao.Shell(**STEEL, thickness=4e-3), [ao.Support(at(0, 0.0))]
        ),
        ao.Site((0.1, 0.08, 0.0), (0, 0, -1), radius=2e-3),
        ao.Hertz(1e7),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BENT)
def test_the_bar_of_the_deflection_holds_against_all_dofs_of_a_finer_mesh(name):
    """Newmark has the force alone: the site is where the ball is, less the indentation."""
    made, site, law = BENT[name]
    model = ao.extract(made(1), site, n=20, error="estimate")
    duration = 4e-4 + np.pi / model.modal().omega[0]
    hit = ao.simulate(model, BALL, law, duration, tol=1e-5)
    bar = hit.error_budget.deflection
    blow = unreduced_impact(made(2), site, hit, duration)
    curve = run_newmark(replace(blow, step=min(blow.step, duration / 1000))).curve
    impulse = cumulative_trapezoid(curve.force, curve.time, initial=0.0) / BALL.mass
    ball = BALL.velocity * curve.time - cumulative_trapezoid(impulse, curve.time, initial=0.0)
    moved = np.abs(ball - curve.depth).max()
    assert hit.site_motion.largest_displacement == pytest.approx(moved, rel=bar.numerical)
    assert hit.error_budget.sides("deflection")[1] == bar.numerical
    assert bar.value == hit.site_motion.largest_displacement
    assert 1e-4 < bar.numerical < 0.3
