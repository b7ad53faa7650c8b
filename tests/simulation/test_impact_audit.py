"""Impacts of two bodies by the march and by DOP853: motion, energies and impulses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import antiosc as ao

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
LAWS = {
    "hertz": ao.Hertz(1e9),
    "spring": ao.Linear(3e6),
    "damped": ao.HuntCrossley(1e9, 0.5),
    "plastic": ao.Thornton(1e9, 2e-6),
    "laminate": ao.YangSun(1e9, 1e-6),
}
METHODS = ["exact", "DOP853"]
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
        if method != "DOP853" or law in ("hertz", "damped")
    ],
)


@every
def test_what_a_history_tells_fits_together(law: str, method: str) -> None:
    hit = impact(law, method)
    p, t = hit.assembly.system, hit.time
    q, v = hit.states(t)
    size, force = hit.assembly.stacked.spans["structure"].stop, hit.force
    node = np.arange(t.size) < t.size - 1
    u, w = -q[:, :size] @ p.beta[0][:size], q[:, size:] @ p.beta[0][size:]
    for mine, exact in (
        (hit.displacement, u),
        (hit.impactor_displacement, w),
        (hit.velocity, -v[:, :size] @ p.beta[0][:size]),
        (hit.impactor_velocity, v[:, size:] @ p.beta[0][size:]),
        (hit.indentation, w - u - 2e-5),
    ):
        atol = (4e-6 if method == "DOP853" else 1e-8) * np.abs(exact).max()
        np.testing.assert_allclose(mine[node], exact[node], rtol=0, atol=atol)
    # forces are those of the law, and none between the contacts
    events = np.array(hit.contacts)
    assert len(events) >= 1
    inside = node & np.any((t[:, None] > events[:, 0]) & (t[:, None] < events[:, 1]), axis=1)
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
    atol = (1e-8 if method == "exact" else 3e-6) * area[-1]  # parabolas may fall below 0
    np.testing.assert_allclose(hit.cumulative_impulse, area, rtol=0, atol=atol)
    given = MASS * GRAVITY * t[-1]
    lost = MASS * (SPEED - hit.impactor_velocity[-1]) + given
    assert hit.impulse == pytest.approx(lost, rel=1e-7)
    assert hit.impulse == pytest.approx(area[-1], rel=1e-2)
    dense = hit.force_at(np.linspace(0, t[-1], 40_001))
    assert hit.peak_force == pytest.approx(dense.max(), rel=1e-3)


@every
def test_energies_are_those_of_the_motion_and_the_contact(law: str, method: str) -> None:
    hit = impact(law, method)
    p, energy = hit.assembly.system, hit.energy
    q, v = hit.states(hit.time)
    strain, work = np.sum((p.omega * q) ** 2, axis=1) / 2, (q - q[0]) @ p.loads[0]
    for mine, exact in (
        (energy.kinetic, np.sum(v**2, axis=1) / 2), (energy.strain, strain), (energy.gravity, work)
    ):  # fmt: skip
        atol = 1e-12 * np.abs(exact).max()
        np.testing.assert_allclose(mine[:-1], exact[:-1], rtol=0, atol=atol)
    held = energy.kinetic + energy.strain + energy.contact
    limit = {"exact": 1e-3, "DOP853": 3e-3}[method]
    assert np.abs(energy.total - energy.total[0]).max() < limit * held.max()
    assert energy.dissipated[-1] > 0.02 * held.max()
    if hit.restitution is not None:
        rigid = p.omega == 0
        way = hit.states(np.array([hit.contacts[0][0], hit.contacts[-1][1]]))[1][:, rigid]
        speeds = way @ p.beta[0][rigid]
        assert hit.restitution == pytest.approx(-speeds[1] / speeds[0], rel=1e-6)
