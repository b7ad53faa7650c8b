"""Scenes of beams against the same systems integrated unreduced, and their order."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from antiosc.engine import library, march
from antiosc.engine.march import run
from antiosc.impact.assembly import assemble_scene
from antiosc.impact.states import contact_forces, steps_at
from direct import beam, force_error, free_modes, physical
from march_builds import built

Array = NDArray[np.float64]
EI, RHO_A, LENGTH = 20.0, 0.8, 0.5  # a strip of aluminium, 30 mm x 6 mm and half as stiff

Posed = tuple[ao.Scene, float, tuple[Array, Array]]


def sampled(n: int, clamped: bool, nodes: list[int]) -> tuple[Array, Array, Array]:
    """Stiffness, mass, and one column for the deflection of each of the nodes."""
    K, M = beam(n, EI, RHO_A, LENGTH, clamped)
    columns = np.zeros((len(K), len(nodes)))
    for i, node in enumerate(nodes):
        columns[2 * (node - clamped), i] = 1.0
    return K, M, columns


@cache
def bar_on_two_springs() -> Posed:
    """A free elastic beam falls on two springs, the one stiffer and lower."""
    K, M, columns = sampled(4, False, [0, 3])
    translation = np.zeros(len(K))
    translation[::2] = 1.0
    omega, b = free_modes(K, M, np.column_stack((columns, M @ translation)))
    momentum = np.zeros((omega.size, 6))
    momentum[:, 2] = b[:, 2]
    mass = RHO_A * LENGTH
    matrix = np.diag([mass, mass, mass, 1, 1, 1.0])
    inertia = ao.Inertia(np.zeros(3), matrix, momentum)
    up = [(0, 0, 1.0)] * 2
    body = ao.SiteModes(omega, b[:, :2], ("left", "right"), directions=up, inertia=inertia)
    ends, gaps = ("bar:left", "bar:right"), [2e-4, 0.0]
    law = ao.Linear(2e5)
    contacts = [ao.Contact(e, "floor", law, gap=g) for e, g in zip(ends, gaps, strict=True)]
    bodies, start = {"bar": body, "floor": ao.Obstacle()}, ao.Motion(velocity=(0, 0, -0.6))
    scene = ao.Scene(bodies, contacts, gravity=(0, 0, -9.81), motion={"bar": start})
    fall, pull = -0.6 * translation, -9.81 * M @ translation
    return scene, 6e-3, physical(K, M, -columns.T, np.array(gaps), 2e5, 1.0, fall, 6e-3, pull)


@cache
def beam_between_two_stops() -> Posed:
    """A cantilever whose tip a pulse throws against one stop and then the other."""
    K, M, columns = sampled(4, True, [2, 4])
    omega, b = free_modes(K, M, columns)
    law = ao.Hertz(5e8)
    pulse = [0, 2e-3, 4e-3], [0, 60.0, 0]
    ends = ("above", "beam:tip"), ("beam:tip", "below")
    contacts = [ao.Contact(*pair, law, gap=4e-4) for pair in ends]
    body = ao.SiteModes(omega, b, ("middle", "tip"))
    bodies = {"beam": body, "above": ao.Obstacle(), "below": ao.Obstacle()}
    scene = ao.Scene(bodies, contacts, loads=[ao.Load("beam:middle", *pulse)])
    rows = np.vstack((columns[:, 1], -columns[:, 1]))
    gaps, rest = np.full(2, 4e-4), np.zeros(len(K))

    def load(t):
        return columns[:, 0] * np.interp(t, *pulse)

    return scene, 0.012, physical(K, M, rows, gaps, 5e8, 1.5, rest, 0.012, load)


@cache
def two_beams_at_three_points() -> Posed:
    """A cantilever that a pulse bends down on another one, which it meets at three points."""
    n, nodes = 4, [2, 3, 4]
    K, M, columns = sampled(n, True, nodes)
    omega, b = free_modes(K, M, columns)
    gaps, names = np.array([1e-5, 0.0, 1e-5]), ("a", "b", "c")
    pulse = [0, 1e-3, 2e-3], [0, 150.0, 0]
    upper, lower = ao.SiteModes(omega, b, names), ao.SiteModes(1.3 * omega, b, names)
    contacts = [
        ao.Contact(f"lower:{s}", f"upper:{s}", ao.Power(3e7, 1.3), gap=float(g))
        for s, g in zip(names, gaps, strict=True)
    ]
    scene = ao.Scene({"upper": upper, "lower": lower}, contacts, loads=[ao.Load("upper:a", *pulse)])
    zero = np.zeros_like(K)
    both_K, both_M = np.block([[K, zero], [zero, 1.69 * K]]), np.block([[M, zero], [zero, M]])
    rows = np.hstack((columns.T, -columns.T))
    struck = np.concatenate((columns[:, 0], 0 * columns[:, 0]))
    rest = np.zeros(2 * len(K))

    def load(t):
        return struck * np.interp(t, *pulse)

    return scene, 8e-3, physical(both_K, both_M, rows, gaps, 3e7, 1.3, rest, 8e-3, load)


SCENES = [bar_on_two_springs, beam_between_two_stops, two_beams_at_three_points]
LONG = [
    pytest.param(posed, marks=[pytest.mark.slow] if i else []) for i, posed in enumerate(SCENES)
]


@pytest.mark.slow
@pytest.mark.parametrize("posed", SCENES)
def test_forces_are_those_of_the_unreduced_system(posed: Callable[[], Posed]) -> None:
    scene, duration, (t, force) = posed()
    hit = scene.run(duration)
    assert hit.status == 0
    assert np.all(force.max(axis=0) > 1)  # every contact touches
    assert force_error(hit, t, force) < 1e-3
    assert hit.energy.drift < 1e-3


@pytest.mark.parametrize("method", ["newmark", "leapfrog", "DOP853"])
@pytest.mark.parametrize("posed", LONG)
def test_other_methods_meet_their_tolerance(posed: Callable[[], Posed], method: str) -> None:
    scene, duration, (t, force) = posed()
    hit = scene.run(duration, method=method, tol=1e-2)
    assert hit.status == 0
    assert hit.error.get("force", 0.0) <= 1e-2  # solve_ivp states none
    assert force_error(hit, t, force) < 1e-2
    assert hit.energy.drift < 5e-3


@pytest.mark.parametrize("posed", LONG)
def test_order_over_four_halvings_of_the_step(posed: Callable[[], Posed]) -> None:
    """An eighth of the share of error halves the steps of a scheme of order three.

    The steps that events end do not halve: the order is measured over the steps taken, too.
    """
    scene, duration, (t, force) = posed()
    made = assemble_scene(scene, duration)
    runs = [
        run(
            made.system,
            duration,
            1e-3 / 8**i,
            scale=force.max(),
            fine=made.contact_time_estimate / 200,
        )
        for i in range(5)
    ]
    errors = [
        np.linalg.norm(contact_forces(r, *steps_at(r, t))[:, : force.shape[1]] - force)
        for r in runs
    ]
    gained = np.log2(errors[0] / errors[-1])
    assert gained / 4 > 1.7
    assert gained / np.log2(runs[-1].steps / runs[0].steps) > 1.7


@pytest.mark.slow
@pytest.mark.parametrize("posed", SCENES)
def test_sweeps_and_newtons_method_agree(
    posed: Callable[[], Posed], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, duration, _ = posed()
    made = assemble_scene(scene, duration)
    runs = []
    for compiled in (built(), built("SWEEPS=0")):
        monkeypatch.setattr(library, "library", compiled)
        monkeypatch.setattr(march, "_stored_workspaces", [])
        runs.append(run(made.system, duration / 2, 1e-3, fine=made.contact_time_estimate / 200))
    a, b = runs
    assert a.touches > 0
    assert a.time.size == b.time.size
    np.testing.assert_allclose(a.force, b.force, atol=1e-10 * a.force.max())
