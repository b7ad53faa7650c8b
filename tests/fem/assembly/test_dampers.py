"""Dampers of bushings in the damping ratios of a model, against direct solves with C."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.base.errors import AccuracyError, InputError
from antiosc.fem.site.functionals import functional
from assemblies import BEAM, dense, free_dofs, line

pytestmark = [
    pytest.mark.slow,
    pytest.mark.fem,
    pytest.mark.filterwarnings("ignore:the joints leave parts free"),
]

TIP = ao.Site((1, 0, 0), (0, 0, 1), part="a")
FAR = ao.Site((1, 0, 0), (0, 0, 1), part="b")
MIDDLE = ao.Site((0.6, 0, 0), (0, 0, 1), part="a")


def beams(c: float, spring: float = 0.0) -> ao.Structure:
    """Two cantilevers of different lengths, and a damper between their tips."""
    long = ao.Structure(line((0, 0, 0), (1, 0, 0), 8), BEAM, [ao.Support("start")])
    short = ao.Structure(line((1.8, 0, 0), (1, 0, 0), 6), BEAM, [ao.Support("start")])
    stiffness = {"z": spring} if spring else {}
    return ao.assemble(
        {"a": long, "b": short},
        [ao.Bushing("a:end", "b:end", stiffness, damping={"z": c}, point=(1, 0, 0))],
        {"b": (0.0, 0, 0)},
    )


def receptance(part: ao.Structure, site: ao.Site, c: float, omega: np.ndarray) -> np.ndarray:
    """bᵀ(K + iωC − ω²M)⁻¹b by dense solves; the damper acts on the difference of both tips."""
    K, M = dense(part)
    free = free_dofs(part)
    b, first, second = (functional(part, one).b[free] for one in (site, TIP, FAR))
    apart = first - second
    C = c * np.outer(apart, apart)
    return np.array([b @ np.linalg.solve(K + 1j * w * C - w**2 * M, b) for w in omega])


@pytest.mark.sample
@pytest.mark.parametrize("spring", [0.0, 2e4])
def test_the_receptance_is_that_with_the_damper(spring):
    """Within what the model says that it leaves out; without the damper it is far off."""
    c = 1.0
    sites = {"m": MIDDLE, "far": FAR}
    part = beams(c, spring)
    model = ao.extract(part, sites, n=16)
    coupling = model.info["damper_coupling"]
    assert 1e-3 < coupling < 0.1
    body = model.site_modes()
    peaks = body.omega[:5]
    exact = receptance(part, MIDDLE, c, peaks)
    assert np.abs(body.receptance(peaks)[:, 0, 0] / exact - 1).max() < 2 * coupling
    bare = ao.extract(beams(1e-9, spring), sites, n=16).site_modes()
    assert np.abs(bare.receptance(peaks)[:, 0, 0] / exact - 1).max() > 10


def test_what_the_site_does_not_see_is_not_left_out_silently():
    """Without a spring the other beam moves by the damper alone: no mode of the site has it."""
    with pytest.raises(AccuracyError, match="of the compliance at the ends of the dampers"):
        ao.extract(beams(2.0), MIDDLE, n=12)


def test_a_model_of_several_sites_has_the_same_ratios():
    part = beams(1.0, 2e4)
    one = ao.extract(part, MIDDLE, n=12)
    two = ao.extract(part, {"m": MIDDLE, "t": TIP}, n=12)
    assert one.damping is not None
    assert two.damping is not None
    np.testing.assert_allclose(two.damping.ratio[:4], one.damping.ratio[:4], rtol=1e-6)


def test_strong_dampers_and_those_that_brake_rigid_motions_are_refused():
    with pytest.raises(AccuracyError, match="the dampers couple the free modes"):
        ao.extract(beams(4000.0, 2e4), MIDDLE, n=12)
    free = ao.Structure(line((0, 0, 0), (1, 0, 0), 8), BEAM)
    part = ao.assemble(
        {"a": free},
        [ao.Bushing("a:end", "ground", damping={"z": 3.0})],
        points={"ground": (1, 0, 0)},
        supports=[ao.Support("ground")],
    )
    with pytest.raises(InputError, match="brakes a rigid-body motion"):
        ao.extract(part, MIDDLE, n=4)


def braked(c: float) -> ao.Structure:
    """A cantilever with a damper at its tip."""
    return ao.assemble(
        {"a": ao.Structure(line((0, 0, 0), (1, 0, 0), 6), BEAM, [ao.Support("start")])},
        [ao.Bushing("a:end", "ground", damping={"z": c})],
        points={"ground": (1, 0, 0)},
        supports=[ao.Support("ground")],
    )


def impulse(K, M, C, b, mass: float, stiffness: float, duration: float, steps: int) -> float:
    """Impulse of a mass with 1 m/s on a spring, by exponentials of the whole state matrix."""
    n, beside = len(K), np.append(b, -1.0)
    inverse = np.linalg.inv(scipy.linalg.block_diag(M, mass))
    moves = []
    for spring in (0.0, stiffness):
        A = np.zeros((2 * n + 2, 2 * n + 2))
        A[: n + 1, n + 1 :] = np.eye(n + 1)
        pressed = scipy.linalg.block_diag(K, 0.0) + spring * np.outer(beside, beside)
        A[n + 1 :] = -inverse @ np.hstack([pressed, scipy.linalg.block_diag(C, 0.0)])
        moves.append(scipy.linalg.expm(A * duration / steps))
    z, total = np.zeros(2 * n + 2), 0.0
    z[-1] = 1.0
    for k in range(steps):
        depth = -float(beside @ z[: n + 1])
        total += max(depth, 0.0)
        z = moves[k == 0 or depth > 0] @ z
    return stiffness * total * duration / steps


@pytest.mark.sample
@pytest.mark.parametrize("share", [0.005, 0.03])
def test_an_impact_states_the_coupling_that_it_neglects_and_is_refused_beyond_tol(share):
    """The error of the impulse against a solution in all states."""
    bare = braked(1e-9)
    K, M = dense(bare)
    free = free_dofs(bare)
    b = functional(bare, TIP).b[free]
    k0 = 1 / (b @ np.linalg.solve(K, b))
    mass, law = 0.3 * bare.mass, ao.Linear(20 * k0)
    duration = 3 * np.pi * np.sqrt(mass / law.stiffness)
    c = share * np.sqrt(mass * law.stiffness)
    part = braked(c)
    model = ao.extract(part, TIP, n=12)
    ball = ao.RigidMass(mass, 1.0)
    hit = ao.simulate(model, ball, law, duration, tol=0.2)
    ratios = ao.simulate(replace(model, info={}), ball, law, duration, tol=1e-5)
    true = impulse(K, M, c * np.outer(b, b), b, mass, law.stiffness, duration, 8000)
    off = abs(ratios.impulse / true - 1)
    assert off > 2e-4
    assert 0.95 * off - 1e-4 < hit.error["dampers"]
    assert "dampers" in hit.message
    with pytest.raises(AccuracyError, match="couple"):
        ao.simulate(model, ball, law, duration, tol=1e-4)


def test_a_scene_warns_that_it_does_not_know_the_coupling():
    model = ao.extract(braked(1.0), {"tip": TIP}, n=4)
    bodies = {"part": model, "ball": ao.RigidMass(0.1, 1.0)}
    scene = ao.Scene(bodies, [ao.Contact("part:tip", "ball", ao.Linear(1e5))])
    with pytest.warns(ao.AccuracyWarning, match="dampers couple"):
        scene.run(4e-3)


def test_what_takes_no_dampers_says_so():
    part = beams(4.0, 2e4)
    for call in (lambda: ao.full(part, MIDDLE), lambda: ao.superposition(part, MIDDLE, 3)):
        with pytest.raises(InputError, match="does not take the dampers of an assembly"):
            call()
    with pytest.raises(InputError, match="need the shapes of the model"):
        ao.extract(part, MIDDLE, n=3, shapes=False)
    with pytest.raises(InputError, match="the damping of z must be"):
        beams(-1.0)
    with pytest.raises(InputError, match=r"needs a stiffness.*or a damping"):
        ao.Bushing("a:end", "b:end")
