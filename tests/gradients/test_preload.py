"""Gradients of a scene that begins in equilibrium, its contacts closed, against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao

SIZES = {"k0": 2e6, "stiffness": 3e8, "ball": 0.1, "machine": 0.3, "m": 0.05, "omega": 3e3}

#: Couples the modes: N s/m, and the stiffness of a branch.
L = np.array([[12.0, 0.3, 0.2], [-5.0, 0.4, -0.3], [3.0, -0.2, 0.8]])
C, BRANCH = 2 * L.T @ L, np.diag([1e5, 0.0, 2e5])


def impulse(
    law: ao.ContactLaw, m0: float, damped: bool, tol: float, change: dict[str, float]
) -> ao.SceneHistory:
    """A machine that rests on a structure, which a ball strikes."""
    damping = ao.DampingMatrix(C, [(BRANCH, 2e-4)]) if damped else None
    x = {name: size * (1 + change.get(name, 0.0)) for name, size in SIZES.items()}
    part = ao.AntiOscillators(
        m0=m0, k0=x["k0"], m=[x["m"], 0.03], omega=[x["omega"], 8e3], damping=damping
    )
    scene = ao.Scene(
        {"part": part, "ball": ao.RigidMass(x["ball"], 1.0), "machine": ao.RigidMass(x["machine"])},
        [
            ao.Contact("part", "machine", replace(law, stiffness=x["stiffness"])),
            ao.Contact("part", "ball", ao.Hertz(3e8), gap=1e-5),
        ],
        gravity=500.0,
        preload=True,
    )
    return scene.run(2e-3, tol=tol)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The run ends during contact")
@pytest.mark.parametrize(
    ("law", "m0", "damped"),
    [
        (ao.Hertz(3e8), 0.04, False),
        (ao.HuntCrossley(3e8, 0.8), 0.04, True),
        (ao.Thornton(3e8, 2e-6), 0.0, True),
    ],
)
def test_a_machine_that_rests_on_what_is_struck(
    law: ao.ContactLaw, m0: float, damped: bool
) -> None:
    pair, h = ("part", "machine"), 1e-5
    hit = impulse(law, m0, damped, 1e-7, {})
    assert hit[pair].force[0] == pytest.approx(0.3 * 500.0)
    g = ao.gradient(hit, "impulse", contact=pair)
    part = g.bodies["part"]
    found = {
        "k0": part["k0"], "m": part["m"][0], "omega": part["omega"][0],
        "stiffness": g.contacts[pair]["stiffness"], "ball": g.bodies["ball"]["mass"],
        "machine": g.bodies["machine"]["mass"],
    }  # fmt: skip
    along = dict(zip(SIZES, (1.0, -2.0, 1.5, -1.0, 2.0, 0.5), strict=True))
    ends = [
        impulse(law, m0, damped, 1e-9, {n: s * h * x for n, x in along.items()})[pair].impulse
        for s in (-1, 1)
    ]
    slope = sum(found[name] * size * along[name] for name, size in SIZES.items())
    assert slope == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=0, abs=1e-5 * g.value)


def test_the_force_at_rest_on_a_damped_structure_beside_a_stop() -> None:
    """The weight is shared by the stiffness of the stop and that of structure and contact."""
    k0, k, weight = 2e6, 1e6, 0.3 * 500.0
    damping = ao.DampingMatrix(C, [(BRANCH, 2e-4)])
    part = ao.AntiOscillators(m0=0.0, k0=k0, m=[0.05, 0.03], omega=[3e3, 8e3], damping=damping)
    bodies = {"part": part, "stop": ao.Obstacle(), "machine": ao.RigidMass(0.3)}
    pairs = [("part", "machine"), ("stop", "machine")]
    contacts = [ao.Contact(*pair, ao.Linear(k)) for pair in pairs]
    hit = ao.Scene(bodies, contacts, gravity=500.0, preload=True).run(1e-4)
    g = ao.gradient(hit, "force", contact=pairs[0], time=0.0)
    both = k0 * k / (k0 + k)
    assert g.value == pytest.approx(weight * both / (both + k))
    slope = weight * k / (both + k) ** 2 * (both / k0) ** 2  # by both, and of both by k0
    assert g.bodies["part"]["k0"] == pytest.approx(slope, rel=1e-5)
    by_stop = -weight * both / (both + k) ** 2
    assert g.contacts[pairs[1]]["stiffness"] == pytest.approx(by_stop, rel=1e-5)
    assert g.bodies["machine"]["mass"] == pytest.approx(g.value / 0.3, rel=1e-5)
