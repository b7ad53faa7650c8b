"""What is refused of scenes, impacts and their results, each with its reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc.impact.histories.factors import checked_times, column_forces, shape_factors

UP = (0.0, 0.0, 1.0)
LAW = ao.Linear(1e6)
MASS, WALL = ao.RigidMass(1.0, 1.0), ao.Obstacle()
BODIES = {"m": MASS, "w": WALL}
TOUCH = ao.Contact("w", "m", LAW)
CUBE = ao.RigidBody(1.0, (1.0, 1.0, 1.0), {"foot": ((0, 0, -1), UP)})
#: known along z alone, without what gravity needs; across z too
FLAT = ao.SiteModes([0.0], [[1.0]], ["tip"], directions=[UP])
WIDE = ao.SiteModes([0.0, 9.0], [[1.0, 0.2], [0.1, 1.0]], {"tip": (0, 1)},
                    directions=[UP, (1.0, 0, 0)])  # fmt: skip
MODEL = ao.AntiOscillators(m0=0.1, k0=1e5, m=[0.2], omega=[900.0])
RIGID = ao.AntiOscillators(m0=1.0, k0=0.0, m=[], omega=[])
SPRING = ao.AntiOscillators(m0=0.0, k0=1e6, m=[], omega=[])


@dataclass(frozen=True)
class Brittle(ao.Linear):
    """A spring whose theory ends at 1 N."""

    valid_force: float = 1.0


class Forgetful(ao.Linear):
    """A law that remembers too many numbers."""

    def touch(self, speed: float, state: Any = None) -> Any:
        return (0.0,) * 7


def scene(bodies: dict[str, Any] | None = None, contacts: Any = None, **more: Any) -> ao.Scene:
    return ao.Scene({**BODIES, **(bodies or {})}, contacts or [TOUCH], **more)


def ran(*given: Any, **more: Any) -> ao.SceneHistory:
    return scene(*given, **more).run(1e-4)


def rubbing(body: Any, law: ao.ContactLaw = LAW) -> ao.Scene:
    return scene({"b": body}, [ao.Contact("b:tip", "w", law, friction=0.3)])


def many(**changes: Any) -> ao.Many:
    given = {"models": MODEL, "impactors": MASS, "contacts": LAW, "duration": 1e-4}
    return ao.simulate_many(**{**given, **changes})


REFUSED: list[tuple[Callable[[], Any], str]] = [
    (lambda: ran({"b": 3.0}), "body 'b' must have a modal"),
    (lambda: scene({"a:b": MASS}), "without ':'; got 'a:b'"),
    (lambda: ao.Scene({"w": WALL, "v": CUBE}, [ao.Contact("w", "v:nose", LAW)]).run(1e-4),
     "'v:nose' names no site of the body 'v'; it has v:foot"),
    (lambda: scene(contacts=[TOUCH, "w"]), "contacts must be Contact objects; got str"),
    (lambda: scene(base=3.0), "base must be a Base; got float"),
    (lambda: scene(motion={"x": 1.0}), r"motion names the bodies \['x'\]"),
    (lambda: ran(motion={"w": 1.0}), "body 'w' is an obstacle, which does not move"),
    (lambda: ran({"c": CUBE}, motion={"c": 1.0}), "'c' moves in space: give its start as a Motion"),
    (lambda: ran(loads=[ao.Load("w", [0.0], [1.0])]), "the load on 'w' acts on an obstacle"),
    (lambda: scene().run(1e-4, tol=1.0), "0 < tol < 1; got 1"),
    (lambda: rubbing(WIDE, ao.HuntCrossley(1e6, 0.5)).run(1e-4, method="DOP853"),
     "does not take friction"),
    (lambda: ran(gravity=UP), "gravity as a vector needs the direction of 'm'"),
    (lambda: ran({"b": WIDE, "c": CUBE}, [ao.Contact("c:foot", "w", LAW)],
                 base=ao.Base([0.0], [1.0])), "on 'b' needs what its motion carries"),
    (lambda: ran(contacts=[ao.Contact("w", "m", Forgetful(1e6))]), "up to 6 numbers; Forgetful"),
    (lambda: ao.RigidBody(1.0, (1.0, -1.0, 1.0), {}), "symmetric and positive definite"),
    (lambda: ao.RigidBody(1.0, (1.0, 1.0, 5.0), {}), "principal moments 1, 1, 5"),
    (lambda: ao.Scene({"c": CUBE, "m": MASS}, [ao.Contact("c:foot", "m", LAW)],
                      base=ao.Base([0.0], [9.81])).run(1e-4), "no body of the scene stands on"),
    (lambda: ao.Load("m", [0.0, 1e-320], [0.0, 1.0]), "must ascend"),
    (lambda: ao.Tabulated([0.0, 1e-320], [0.0, 1.0]), "must increase strictly"),
    (lambda: ao.AntiOscillators(m0=0.1, k0=1e5, m=[1e-320], omega=[900.0]), "every m must be > 0"),
    (lambda: ao.AntiOscillators(m0=0.1, k0=1e5, m=[0.1], omega=[1e-320]), "every omega must be"),
    (lambda: ao.RigidBody(1.0, (1, 1, 1), {"a": 3.0}), r"site 'a' must be \(point, direction\)"),
    (lambda: ao.RigidBody(1.0, (1, 1, 1), {"a": (UP, (0, 0, 0))}), "must not be a zero vector"),
    (lambda: ran().bodies["m"].angular_momentum(), "'m' does not know how it turns"),
    (lambda: ran({"b": FLAT}).bodies["b"].momentum, "'b' does not know what it carries"),
    (lambda: ran({"c": CUBE}).of("c"), "'c' is a RigidBody, which has no field"),
    (lambda: shape_factors(ran(), np.zeros(1), "m"), "has no displacement field"),
    (lambda: column_forces(ran({"c": CUBE}).bodies["c"], np.zeros(1), ""), "no displacement field"),
    (lambda: checked_times(ran().bodies["m"], [0.0]), "known at its own times: probe"),
    (lambda: ao.Scene({"v": WALL, "w": WALL, "m": ao.SiteModes([], np.zeros((0, 1)), ["a"])},
                      [ao.Contact("m", "w", LAW)]).run(1e-4), "nothing in the scene can move"),
    (lambda: ao.simulate(MODEL, MASS, LAW, 1e-4, gravity=UP), "knows the direction of impact"),
    (lambda: ao.simulate(WALL, MASS, LAW, 1e-4, n=3), "only AntiOscillators can be truncated"),
    (lambda: ao.simulate(MODEL, MASS, LAW, 1e-4, n="all"), "a number of anti-oscillators or"),
    (lambda: ao.truncation_error(MASS, lambda m, tol: None), "only AntiOscillators can be trunc"),
    (lambda: ao.truncation_error(MODEL, lambda m, tol: 3.0), "what run returns must be a History"),
    (lambda: ao.contact_stress(ao.Sphere(0.01, 2e11, 0.3, 7800.0), 10.0, 2e11, 0.3, radius=0.0),
     "radius must not be 0; inf is a flat surface"),
    (lambda: ao.contact_stress(ao.Sphere(0.01, 2e11, 0.3, 7800.0), 10.0, 2e11, 0.3, radius=-9e-3),
     "the hollow of radius -0.009 m"),
    (lambda: many(impactors=[MASS] * 3, contacts=[LAW] * 2), "one length; got impactors: 3"),
    (lambda: many(impactors=[]), "at least one scene"),
    (lambda: many(duration=[1e-4, -1e-4]), "scene 1: duration must be > 0"),
    (lambda: many(step=[1e-6, 1.0]), "scene 1: step must be <= the duration"),
    (lambda: ao.sweep(ao.RigidMass, mass=[1.0, 2.0], velocity=[1.0] * 3), "mass: 2, velocity: 3"),
    (lambda: ao.simulate(MODEL, MASS, LAW, 1e-4, "euler"), "method must be 'exact', 'newmark'"),
    (lambda: ao.simulate(MODEL, MASS, LAW, 1e-4, n=99), "n must be <= 1"),
    (lambda: ao.simulate(MODEL, WALL, LAW, 1e-4, initial_velocity=1.0), "supported body"),
    (lambda: ao.simulate(RIGID, MASS, LAW, 1e-4, gravity=9.81), "participation"),
    (lambda: ao.simulate_many(SPRING, WALL, LAW, 1e-4), "nothing can move"),
    (lambda: ao.choose_n(MODEL, lambda m, tol: None, tol=2.0), "0 < tol < 1"),
    (lambda: ao.Obstacle(velocity=1.0), "an obstacle is fixed"),
    (lambda: ao.Scene(BODIES, []), "at least one Contact"),
    (lambda: ran(contacts=[ao.Contact("x", "m", LAW)]), "no body 'x'"),
    (lambda: ran({"v": WALL}, [ao.Contact("w", "v", LAW)]), "both ends"),
    (lambda: scene(contacts=[TOUCH, ao.Contact("m", "w", LAW)]), "same ends"),
    (lambda: ran(contacts=[ao.Contact("w", "m", LAW, friction=0.3)]), "friction between"),
    (lambda: ao.Contact("m", "m", LAW), "must differ"),
    (lambda: ran()["m", "w"], "there is no contact"),
    (lambda: ao.Scene({"c": CUBE, "w": WALL}, [ao.Contact("c:foot", "w", LAW)], UP,
                      preload=True).run(1e-4), "no static equilibrium"),
    (lambda: ao.simulate(MODEL, MASS, ao.Thornton(1e9, 1e-6), 1e-4, "DOP853"), "remembers"),
    (lambda: ao.Power(1.0, 0.5), "exponent must lie in"),
    (lambda: ao.HuntCrossley(1.0, 1.1), r"0 < e <= 1; got 1.1"),
    (lambda: ao.Hertz.from_radii(0.0, 1.0, 0.3), "non-zero radii"),
    (lambda: ao.Hertz.from_radii((1.0, np.inf), 1.0, 0.3), "must part in every direction"),
    (lambda: ao.Hertz.from_radii((1.0, 2.0, 3.0), 1.0, 0.3), "a pair of principal radii"),
    (lambda: ao.Hertz.from_radii(1.0, 1.0, 0.3, 1.0, -np.inf), "E2 must be"),
    (lambda: ao.Tabulated([0], [0]), "needs at least 2 points"),
    (lambda: ao.named_impactor("IK02").hertz(70e9, 0.33), "tip"),
    (lambda: ao.RigidMass(0.1, 1.0).hertz(70e9, 0.33), "tip"),
    (lambda: ao.named_impactor("steel ball", 1.0), "give a diameter"),
    (lambda: ao.named_impactor("golf ball"), "give a velocity"),
    (lambda: ao.named_impactor("IK07", diameter=0.1), "diameter is for"),
    (lambda: ao.named_impactor("anvil"), "'anvil'"),
    *((lambda name=name: ao.IMPACTORS[name].law(), f"{name} has no stiffness")
      for name in sorted({*ao.IMPACTORS} - {"tennis ball"})),
    (lambda: ao.simulate(None, MASS, LAW, 1e-3), "extract"),
    (lambda: ao.simulate(MASS, RIGID, LAW, 1e-3), "order is simulate"),
    (lambda: ran().save("x.csv"), "to_csv"),
    (lambda: ao.Sphere(0.01, 210e9, 0.3), "rho or mass"),
    (lambda: ao.Sphere(0.01, 210e9, 0.3, rho=7850.0, mass=0.1), "rho or mass"),
    (lambda: ao.Tabulated([1, 2], [0, 1]), r"must start at \(0, 0\)"),
    (lambda: ao.Tabulated([0, 1, 2], [0, 1, 2], ([0.5, 1], [0, 1])), "unloading curve must run"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "words"), REFUSED, ids=[words for _, words in REFUSED])
def test_what_cannot_be_is_refused(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(ao.InputError, match=words):
        call()


def test_a_force_beyond_its_law_is_told_with_the_contact() -> None:
    brittle = scene(contacts=[ao.Contact("w", "m", Brittle(1e6))])
    with pytest.raises(ao.AccuracyError, match=r"the peak force .* exceeds 1 N"):
        brittle.run(4e-3)
    with pytest.raises(ao.AccuracyError, match=r"the peak force .* exceeds 1 N"):
        ao.simulate(MODEL, MASS, Brittle(1e6), 4e-3)


@pytest.mark.parametrize(
    ("degrees", "refused"), [(2.0, False), (3.0, True), (177.0, True), (178.0, False)]
)
def test_a_site_must_be_known_along_its_contact(degrees: float, refused: bool) -> None:
    """Or against it, to a cosine of 0.999, which is 2.56 degrees."""
    tilt = np.radians(degrees)
    other = ao.SiteModes([0.0], [[1.0]], ["tip"], directions=[(np.sin(tilt), 0, np.cos(tilt))])
    bodies, contact = {"a": FLAT, "b": other}, ao.Contact("a:tip", "b:tip", LAW, gap=1.0)
    if refused:
        with pytest.raises(ao.InputError, match="the contact at 'b:tip' is along"):
            ran(bodies, [contact])
    else:
        assert ran(bodies, [contact]).status == 0
