"""Reactions of supports against the unreduced model, and their balance with force and inertia."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.site import functional

PLANE = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
SITE = ao.Site((0.08, 0.06), (0.2, -1), radius=0.034)
BALL, LAW = ao.RigidMass(mass=0.1, velocity=1.0), ao.Hertz(1e8)
DURATION = 6e-4
SUPPORTS = [ao.Support("left"), ao.Support("right", "y")]


def sheet(supports=SUPPORTS, n=(6, 3)):
    return ao.Structure(parts.plate(n, (0.2, 0.06)), PLANE, supports)


@pytest.fixture(scope="module")
def struck():
    part = sheet()
    return part, ao.simulate(ao.extract(part, SITE, 24), BALL, LAW, DURATION, tol=1e-6)


def test_reactions_and_inertia_balance_the_force(struck):
    part, hit = struck
    found = ao.reactions(part, hit, SITE)
    np.testing.assert_allclose(
        found.total + found.applied, found.inertia, atol=1e-8 * np.abs(found.applied).max()
    )
    along = np.array(SITE.direction) / np.linalg.norm(SITE.direction)
    np.testing.assert_allclose(found.applied[:, :2], np.outer(hit.force, along), atol=1e-6)
    assert list(found.force) == ["left", "right"]
    assert np.abs(found.force["right"][:, [0, 2]]).max() < 1e-8 * hit.peak_force
    assert np.abs(found.force["right"][:, 1]).max() > 0.05 * hit.peak_force
    np.testing.assert_allclose(found.centre["left"], [0, 0.03, 0], atol=1e-12)


@pytest.mark.slow
def test_reactions_are_those_of_the_unreduced_model(struck):
    """Rows of the supports, K_sf u + M_sf u'', under an independent integration with contact."""
    part, hit = struck
    times = np.linspace(0, DURATION, 121)
    free_part = sheet([])
    b = functional(free_part, SITE).b
    free = np.setdiff1d(np.arange(len(b)), part.fixed)
    K, M = (csr(A).toarray() for A in (free_part.K, free_part.M))
    inverse = np.linalg.inv(M[np.ix_(free, free)])
    own = K[np.ix_(free, free)]
    n = len(free)

    def slope(t, y):
        F = LAW.stiffness * max(y[2 * n] - b[free] @ y[:n], 0.0) ** 1.5
        pulled = inverse @ (b[free] * F - own @ y[:n])
        return np.concatenate([y[n : 2 * n], pulled, [y[2 * n + 1], -F / BALL.mass]])

    start = np.zeros(2 * n + 2)
    start[-1] = BALL.velocity
    y = solve_ivp(
        slope, (0, DURATION), start, "DOP853", times, rtol=1e-9, atol=1e-13, max_step=1e-5
    ).y
    u = np.zeros((len(b), len(times)))
    a = np.zeros_like(u)
    u[free] = y[:n]
    a[free] = np.array([slope(0, row)[n : 2 * n] for row in y.T]).T
    F = np.array([LAW.stiffness * max(v, 0.0) ** 1.5 for v in y[2 * n] - b[free] @ y[:n]])
    rows = K @ u + M @ a - np.outer(b, F)
    assert np.abs(rows[free]).max() < 1e-6 * F.max()
    found = ao.reactions(part, hit, SITE, times)
    form = part.form
    for name, value in (("left", 0.0), ("right", 0.2)):
        for axis, component in enumerate("xy"):
            dofs, x = compat.dof_coordinates(form.space, form.components[component])
            there = np.intersect1d(dofs[np.isclose(x[:, 0], value)], part.fixed)
            exact = rows[there].sum(axis=0) if len(there) else np.zeros(len(times))
            np.testing.assert_allclose(
                found.force[name][:, axis], exact, atol=5e-3 * np.abs(rows[part.fixed].sum(0)).max()
            )
        moment = np.zeros(len(times))
        for axis, component in enumerate("xy"):
            dofs, x = compat.dof_coordinates(form.space, form.components[component])
            keep = np.isclose(x[:, 0], value) & np.isin(dofs, part.fixed)
            arm = (x[keep] - found.centre[name])[:, 1 - axis] * (1, -1)[1 - axis]
            moment += arm @ rows[dofs[keep]]
        np.testing.assert_allclose(
            found.moment[name][:, 2], moment, atol=5e-3 * np.abs(moment).max() + 1e-6
        )


def test_what_has_no_reactions_is_refused(struck):
    part, hit = struck
    free = sheet([])
    run = ao.simulate(ao.extract(free, SITE, 4), BALL, LAW, DURATION)
    for structure, history, site, message in (
        (free, run, SITE, "no supports"),
        (part, hit, {"a": SITE, "b": SITE}, "1 directions of contact, the sites given 2"),
        (part, hit, "tip", "a Site"),
    ):
        with pytest.raises(ao.InputError, match=message):
            ao.reactions(structure, history, site)


def test_what_moves_the_whole_part_is_refused(struck):
    """A moving ground, and gravity on a part that may slide; the weight of a held part is none."""
    part, _ = struck
    ends = {"part": ao.extract(part, SITE, 4), "far": ao.Obstacle()}
    apart = [ao.Contact("part", "far", ao.Linear(1.0), gap=1.0)]
    shaken = ao.Scene(ends, apart, base=ao.Base([0.0, 1.0], [(0.2, -1, 0)] * 2))
    with pytest.raises(ao.InputError, match="moving"):
        ao.reactions(part, shaken.run(1e-5), SITE, body="part")
    hanging = ao.Scene(ends, apart, gravity=(0, -9.81, 0), preload=True)
    found = ao.reactions(part, hanging.run(1e-6), SITE, body="part")
    assert np.abs(found.total).max() < 1e-6 * 9.81 * part.mass
    with pytest.warns(ao.AntioscWarning, match="free to move"):
        slides = sheet([ao.Support("left", "y"), ao.Support("right", "y")])
    ends = {"part": ao.extract(slides, SITE, 4), "far": ao.Obstacle()}
    falling = ao.Scene(ends, apart, gravity=(0, -9.81, 0))
    with pytest.raises(ao.InputError, match="part"):
        ao.reactions(slides, falling.run(1e-5), SITE, body="part")


def test_a_clamped_shell_holds_force_and_moment():
    """At rest under F at the distance d: R = −F and M = F d about the clamp."""
    part = ao.Structure(
        parts.plate((8, 2), (0.3, 0.02), "triangle"),
        ao.Shell(E=70e9, nu=0.3, rho=2700.0, thickness=4e-3),
        [ao.Support("left")],
    )
    site = ao.Site((0.27, 0.01, 0), (0, 0, 1), radius=0.01)
    scene = ao.Scene(
        {"part": ao.extract(part, site, 6), "far": ao.Obstacle()},
        [ao.Contact("part", "far", ao.Linear(1.0), gap=1.0)],
        loads=[ao.Load("part", [0.0, 1.0], [5.0, 5.0])],
        preload=True,
    )
    found = ao.reactions(part, scene.run(1e-6), site, body="part")
    np.testing.assert_allclose(found.force["left"][-1], [0, 0, -5], atol=1e-6)
    np.testing.assert_allclose(found.moment["left"][-1], [0, 5 * 0.27, 0], atol=1e-5)


@pytest.mark.slow
def test_a_part_that_slides_and_a_scene():
    """A guide along x: the reactions along y balance, and those along x are zero."""
    with pytest.warns(ao.AntioscWarning, match="free to move"):
        part = sheet([ao.Support("left", "y"), ao.Support("right", "y")])
    hit = ao.simulate(ao.extract(part, SITE, 10), BALL, LAW, DURATION)
    found = ao.reactions(part, hit, SITE)
    scale = np.abs(found.applied).max()
    np.testing.assert_allclose(
        (found.total + found.applied)[:, 1], found.inertia[:, 1], atol=1e-8 * scale
    )
    np.testing.assert_allclose(found.applied[:, 0], found.inertia[:, 0], atol=1e-8 * scale)
    assert np.abs(found.total[:, 0]).max() < 1e-8 * scale
    two = {"one": SITE, "other": ao.Site((0.15, 0.0), (0, 1), radius=0.034)}
    held = sheet()
    scene = ao.Scene(
        {"part": ao.extract(held, two, 20), "ball": BALL, "stop": ao.Obstacle()},
        [ao.Contact("part:one", "ball", LAW), ao.Contact("part:other", "stop", LAW, gap=1e-7)],
    )
    run = scene.run(DURATION)
    both = ao.reactions(held, run, two, body="part")
    np.testing.assert_allclose(
        both.total + both.applied, both.inertia, atol=1e-8 * np.abs(both.applied).max()
    )
    assert run["part:other", "stop"].peak_force > 0
