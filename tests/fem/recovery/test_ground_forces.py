"""Supports beside springs, dampers and footings: the whole model integrated, and balances."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import trapezoid

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.reduce.site import functional
from assemblies import dense, free_dofs

LENGTH, Z = 0.5, (0, 0, 1)
SECTION = ao.Section.rectangle(0.02, 0.01)
BEAM = ao.Beam(E=70e9, nu=0.3, rho=2700.0, section=SECTION, orientation=Z)
TIP, MIDDLE, QUARTER = (0.5, 0.0, 0.0), (0.25, 0.0, 0.0), (0.15, 0.0, 0.0)
BALL, LAW, DURATION = ao.RigidMass(0.1, velocity=1.0), ao.Linear(1e6), 8e-3
K_SPRING, C_TIP, C_SLOW, TAU = 3e4, 30.0, 60.0, 1e-3
STIFFNESS, DASHPOT = 2.3e5, 145.0
FOOTING = [
    ao.Spring(MIDDLE, {"z": STIFFNESS}, name="footing 1"),
    ao.Damper(MIDDLE, {"z": DASHPOT}, name="footing 1"),
    ao.PointMass(MIDDLE, 1e-9),
]


def bar(attached, supports=("left",), n=10):
    mesh = parts.line(LENGTH, n, (1.0, 0.0, 0.0))
    return ao.Structure(mesh, BEAM, [ao.Support(one) for one in supports], attached=attached)


def struck(part, site, n=20):
    hit = ao.simulate(ao.extract(part, site, n=n), BALL, LAW, DURATION)
    return hit, ao.reactions(part, hit, site, np.linspace(0, DURATION, 1601))


def whole(part, site, times, force):
    """Forces of the spring, the damper and the Maxwell damper, and of the clamp, of all dofs."""
    free = free_dofs(part)
    K, M = dense(part)
    b, at = (functional(part, ao.Site(x, Z)).b[free] for x in (site.point, MIDDLE))
    slow = functional(part, ao.Site(QUARTER, Z)).b[free]
    n, k, inverse = len(K), C_SLOW / TAU, np.linalg.inv(M)
    A = np.zeros((2 * n + 3, 2 * n + 3))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -inverse @ (K + k * np.outer(slow, slow))
    A[n : 2 * n, n : 2 * n] = -inverse @ (C_TIP * np.outer(b, b))
    A[n : 2 * n, 2 * n], A[n : 2 * n, -2] = k * inverse @ slow, inverse @ b
    A[2 * n, :n], A[2 * n, 2 * n], A[-2, -1] = slow / TAU, -1 / TAU, 1.0
    h = times[1] - times[0]
    step, state, states = scipy.linalg.expm(A * h), np.zeros(len(A)), []
    for now, after in zip(force, np.append(force[1:], force[-1]), strict=True):
        state[-2:] = now, (after - now) / h
        states.append(state.copy())
        state = step @ state
    states = np.array(states)
    u, v, a = states[:, :n], states[:, n : 2 * n], (states @ A.T)[:, n : 2 * n]
    spring, damper = -K_SPRING * u @ at, -C_TIP * v @ b
    maxwell = -k * (u @ slow - states[:, 2 * n])
    loose = bar([], ())
    rigid = parts.nodal(loose, lambda x: np.outer(Z, np.ones(x.shape[1])))
    inertia = (csr(loose.M) @ rigid)[free] @ a.T
    return spring, damper, maxwell, inertia - force - spring - damper - maxwell


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the supports leave")
def test_a_clamp_beside_springs_and_dampers_has_the_force_of_the_whole_model():
    attached = [
        ao.Spring(MIDDLE, {"z": K_SPRING}),
        ao.Damper(TIP, {"z": C_TIP}),
        ao.Damper(QUARTER, {"z": C_SLOW}, tau=TAU, name="slow"),
    ]
    part, site = bar(attached), ao.Site(TIP, Z)
    hit, found = struck(part, site)
    assert list(found.force) == ["left"]
    spring, _, _, clamp = whole(part, site, found.time, hit.force_at(found.time))
    size = np.abs(clamp).max()
    assert size > 0.05 * hit.peak_force
    np.testing.assert_allclose(found.force["left"][:, 2], clamp, atol=0.02 * size)
    moved = ao.probe(part, hit, MIDDLE, times=found.time)[:, 2]
    np.testing.assert_allclose(-K_SPRING * moved, spring, atol=0.02 * np.abs(spring).max())


@pytest.mark.slow
def test_springs_and_dampers_to_the_ground_carry_what_the_clamp_leaves():
    """Their laws with the motion of a probe; the same in a part and in an assembly."""
    site = ao.Site(TIP, Z)
    part = bar(FOOTING)
    hit, alone = struck(part, site)
    assert list(alone.force) == ["left"]
    moved = [ao.probe(part, hit, MIDDLE, q, alone.time)[:, 2] for q in ("displacement", "velocity")]
    law = -STIFFNESS * moved[0] - DASHPOT * moved[1]
    rest = (alone.inertia - alone.applied - alone.total)[:, 2]
    np.testing.assert_allclose(rest, law, atol=0.02 * np.abs(law).max())
    size = np.abs(alone.force["left"]).max()
    for whole_part in (
        ao.assemble({"bar": part}),
        ao.assemble({"bar": bar([])}, attached=FOOTING),
    ):
        found = ao.reactions(whole_part, struck_in(whole_part, site), replaced(site), alone.time)
        assert list(found.force) == ["bar:left"]
        np.testing.assert_allclose(found.force["bar:left"], alone.force["left"], atol=1e-4 * size)


def replaced(site):
    return ao.Site(site.point, site.direction, part="bar")


def struck_in(part, site):
    return ao.simulate(ao.extract(part, replaced(site), n=20), BALL, LAW, DURATION)


@pytest.mark.slow
def test_a_layer_that_relaxes_acts_on_the_supports():
    """Two halves of different materials: the clamp carries F and the inertia of the bar."""
    steel = ao.Beam(E=70e9, nu=0.3, rho=2700.0, section=SECTION, orientation=Z)
    soft = ao.Beam(E=70e9, nu=0.3, rho=2700.0, section=SECTION, orientation=Z, prony=[(1.0, 5e-3)])
    groups = {
        "left": (0, lambda x: np.isclose(x[0], 0)),
        "root": (1, lambda x: x[0] < LENGTH / 2 + 1e-9),
        "rest": (1, lambda x: x[0] > LENGTH / 2 - 1e-9),
    }
    mesh = parts.frame([(0, 0, 0), TIP], [(0, 1)], 10, groups=groups)
    part = ao.Structure(mesh, {"root": soft, "rest": steel}, [ao.Support("left")])
    site = ao.Site(TIP, Z)
    hit = ao.simulate(ao.extract(part, site, n=20), ao.RigidMass(5.0, 0.2), ao.Hertz(1e6), 0.05)
    found = ao.reactions(part, hit, site)
    np.testing.assert_allclose(
        found.total + found.applied, found.inertia, atol=1e-8 * np.abs(found.applied).max()
    )
    # about the clamp: M = F L - ∫ x dm u''
    points = np.linspace(0, LENGTH, 41)
    a = np.array([ao.probe(part, hit, (x, 0, 0), "acceleration", found.time)[:, 2] for x in points])
    moment = trapezoid(points[:, None] * a, points, axis=0) * BEAM.rho * SECTION.A
    exact = LENGTH * found.applied[:, 2] - moment
    np.testing.assert_allclose(found.moment["left"][:, 1], exact, atol=0.02 * np.abs(exact).max())
