"""Impacts of two bodies by every method: motion, equations of each step, energies and impulses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from march_audit import motion

Array = NDArray[np.float64]
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
LAWS = {
    "hertz": ao.Hertz(1e9),
    "spring": ao.Linear(3e6),
    "damped": ao.HuntCrossley(1e9, 0.5),
    "plastic": ao.Thornton(1e9, 2e-6),
    "laminate": ao.YangSun(1e9, 1e-6),
}
METHODS = ["exact", "newmark", "conserving", "leapfrog", "DOP853"]
MASS, SPEED, GRAVITY, DURATION = 0.3, 1.5, -200.0, 1.5e-3


@cache
def impact(law: str, method: str, m0: float = 0.05) -> ao.History:
    """A damped free structure is struck twice by a mass that falls on it."""
    model = ao.AntiOscillators(
        m0=m0, k0=0.0, m=[0.4, 0.1, 0.05], omega=[2e3, 7e3, 1.2e4],
        participation=[m0, 0.4, 0.1, 0.05], damping=ao.Damping(ratio=0.02, alpha=30.0),
    )  # fmt: skip
    step = None if method == "exact" else 1e-5
    return ao.simulate(
        model, ao.RigidMass(MASS, SPEED), LAWS[law], DURATION, method, step=step, tol=1e-4,
        gravity=GRAVITY, gap=2e-5, initial_velocity=0.2,
    )  # fmt: skip


every = pytest.mark.parametrize(
    ("law", "method"),
    [
        (law, method)
        for law in LAWS
        for method in METHODS
        if method != "DOP853" or law in ("hertz", "laminate")
    ],
)


@pytest.mark.sample
@every
def test_motion_between_the_nodes_follows_from_the_force(law: str, method: str) -> None:
    """From each node on, under the parabola of force and gravity; at the nodes of the method."""
    hit = impact(law, method)
    p, t = hit.problem, hit.time
    h = np.diff(t)[:, None]
    q, v = hit.states(t[:-1])
    assert np.all(h > 0)
    since = 0.4 * h
    ends = [hit.force_at((t[:-1, None] + share * h)[:, 0]) for share in (0.0, 0.5, 0.999999)]
    f0, f1, f2 = (each[:, None] for each in ends)
    force = [f0, (4 * f1 - 3 * f0 - f2) / h, 4 * (f0 - 2 * f1 + f2) / h**2]
    push = np.stack([-each * p.beta for each in force])
    push[0] += p.load
    expected = motion(p.omega, p.decay, since, q, v, push)
    for mine, exact in zip(hit.states(t[:-1] + since[:, 0]), expected, strict=True):
        np.testing.assert_allclose(mine, exact, rtol=0, atol=1e-6 * np.abs(exact).max())


@every
def test_what_a_history_tells_fits_together(law: str, method: str) -> None:
    hit = impact(law, method)
    p, t = hit.problem, hit.time
    q, v = hit.states(t)
    size, force = hit.bodies[0].omega.size, hit.force
    u, w = -q[:, :size] @ p.beta[:size], q[:, size:] @ p.beta[size:]
    for mine, exact in (
        (hit.displacement, u),
        (hit.impactor_displacement, w),
        (hit.velocity, -v[:, :size] @ p.beta[:size]),
        (hit.impactor_velocity, v[:, size:] @ p.beta[size:]),
        (hit.indentation, w - u - 2e-5),
    ):
        np.testing.assert_allclose(mine, exact, rtol=0, atol=1e-9 * np.abs(exact).max())
    # forces are those of the law, and none between the contacts
    events = np.array(hit.contacts)
    assert len(events) >= 1
    inside = np.any((t[:, None] > events[:, 0]) & (t[:, None] < events[:, 1]), axis=1)
    outside = ~np.any((t[:, None] >= events[:, 0]) & (t[:, None] <= events[:, 1]), axis=1)
    assert not force[outside].any()
    if law in ("hertz", "spring"):
        own = [LAWS[law].force(float(d), 0.0, ()) for d in hit.indentation[inside]]
        atol = 1e-6 * force.max()
        np.testing.assert_allclose(force[inside], own, rtol=0, atol=atol)
    # impulses: of the parabolas of force up to each node, and of the momentum
    parts = [
        weight * np.diff(t) * hit.force_at(t[:-1] + share * np.diff(t))
        for share, weight in zip((POINTS + 1) / 2, WEIGHTS / 2, strict=True)
    ]
    area = np.append(0.0, np.cumsum(np.sum(parts, axis=0)))
    np.testing.assert_allclose(hit.cumulative_impulse, area, rtol=0, atol=1e-9 * area[-1])
    given = MASS * GRAVITY * t[-1]
    lost = MASS * (SPEED - hit.impactor_velocity[-1]) + given
    assert hit.impulse == pytest.approx(lost, rel=1e-7)
    assert hit.impulse == pytest.approx(area[-1], rel=1e-2)
    dense = hit.force_at(np.linspace(0, t[-1], 40_001))
    assert hit.peak_force == pytest.approx(dense.max(), rel=1e-3)


@every
def test_energies_are_those_of_the_motion_and_the_contact(law: str, method: str) -> None:
    hit = impact(law, method)
    p, energy = hit.problem, hit.energy
    q, v = hit.states(hit.time)
    np.testing.assert_allclose(energy.kinetic, np.sum(v**2, axis=1) / 2, rtol=1e-12)
    strain = np.sum((p.omega * q) ** 2, axis=1) / 2
    np.testing.assert_allclose(energy.strain, strain, rtol=0, atol=1e-12 * strain.max())
    np.testing.assert_allclose(energy.gravity, (q - q[0]) @ p.load, rtol=0, atol=1e-12)
    held = energy.kinetic + energy.strain + energy.contact
    limit = {"exact": 1e-3, "DOP853": 3e-3}.get(method, 2e-2)
    assert np.abs(energy.total - energy.total[0]).max() < limit * held.max()
    assert energy.dissipated[-1] > 0.02 * held.max()
    last = hit.trajectory.contacts[-1]
    assert (hit.restitution is None) == (not last.released)
    if last.released:
        rigid = p.omega == 0
        way = hit.states(np.array([hit.contacts[0][0], hit.contacts[-1][1]]))[1][:, rigid]
        speeds = way @ p.beta[rigid]
        assert hit.restitution == pytest.approx(-speeds[1] / speeds[0], rel=1e-6)


def pulled(hit: ao.History, q: Array, v: Array, force: Array) -> Array:
    p = hit.problem
    return p.load - force[:, None] * p.beta - p.omega**2 * q - 2 * p.decay * v


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", ["newmark", "conserving", "leapfrog"])
def test_steps_keep_the_equations_of_the_method(law: str, method: str) -> None:
    hit = impact(law, method)
    count = 0
    for contact in hit.trajectory.contacts:
        for segment in hit.trajectory.segments[slice(*contact.segments)]:
            (q, v), F = segment.states(), segment.force
            h = np.diff(segment.time)[:, None]
            assert F[0] == 0
            assert np.all(h <= 1e-5 * (1 + 1e-9))
            a = pulled(hit, q, v, F)
            if method == "newmark":
                pairs = [(np.diff(v, axis=0), h / 2 * (a[1:] + a[:-1]))]
                pairs.append((np.diff(q, axis=0), h / 2 * (v[1:] + v[:-1])))
            elif method == "leapfrog":
                half = v[:-1] + h / 2 * a[:-1]
                pairs = [(np.diff(q, axis=0), h * half), (v[1:] - half, h / 2 * a[1:])]
            else:
                pairs = [(np.diff(q, axis=0), h / 2 * (v[1:] + v[:-1]))]
                middle = pulled(hit, *((x[1:] + x[:-1]) / 2 for x in (q, v)), 0 * h[:, 0])
                beta, load = hit.problem.beta, hit.problem.load
                taken = (h * middle - np.diff(v, axis=0)) @ beta / (beta @ beta)
                assert taken.sum() == pytest.approx(contact.impulse, rel=1e-8)
                pairs.append((np.diff(v, axis=0), h * middle - taken[:, None] * beta))
                if law in ("hertz", "spring"):
                    work = [LAWS[law].potential(float(d), ()) for d in segment.indentation()]
                    pairs.append((np.diff(work), taken / h[:, 0] * np.diff(segment.indentation())))
                assert load.any()
            last = -1 if contact.released else None  # a release ends with no force
            for mine, exact in pairs:
                atol = 1e-8 * np.abs(exact).max()
                np.testing.assert_allclose(mine[:last], exact[:last], rtol=0, atol=atol)
            count += len(h)
    assert count > 20
