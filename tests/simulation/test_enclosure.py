"""The proved bounds of a force against structures of which every mode is known."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

import antiosc as ao
from antiosc.errors import InputError
from antiosc.impact.enclosure import MAX_ELASTIC_SHARE
from paths import demo

Array = NDArray[np.float64]
DURATION = 2e-3
#: Steps of the true forces, whose errors are below a fifth of the slack of their tests.
STEPS = 5_000
NONE = ao.Damping()
#: at the periods of the contact, some 1 ms, up to 5 % of the critical damping
DAMPING = NONE, ao.Damping(0.02), ao.Damping(alpha=300.0), ao.Damping(0.001, 50.0, 1e-5)


def bar(n: int, free: bool) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Stiffness and mass of a bar of n linear elements and 2 kg, held at one end or free."""
    h = 1.0 / n
    ends = np.ones(n + 1)
    ends[[0, -1]] = 0.5
    K = sp.diags([-np.ones(n), 4 * ends - 2 * (ends - 0.5) * 1.0, -np.ones(n)], [-1, 0, 1]).tolil()
    K.setdiag(2 * ends)
    M = sp.diags([np.ones(n) / 6, 2 * ends / 3, np.ones(n) / 6], [-1, 0, 1])
    K, M = 2e8 / h * sp.csr_matrix(K), 2.0 * h * sp.csr_matrix(M)
    if free:
        return K, M
    return K[1:, 1:], M[1:, 1:]


def true_forces(
    matrices: tuple[sp.csr_matrix, ...],
    sites: list[int],
    masses: list[float],
    k: float,
    time: Array,
    damping: ao.Damping = NONE,
) -> Array:
    """Forces (n, p) of rigid balls of 1 m/s at the times [s], by small steps in all modes."""
    K, M = matrices
    x, U = scipy.linalg.eigh(K.toarray(), M.toarray())
    p, none = len(sites), np.zeros(len(sites))
    omega = np.append(np.sqrt(np.where(x > 1e-7 * x[-1], x, 0.0)), none)  # the balls last
    decay = np.append(damping.decay(omega[:-p]), none)
    B = np.hstack([U[sites], -np.diag(1 / np.sqrt(masses))])
    h = time[-1] / STEPS

    A = np.zeros((omega.size, 4, 4))
    A[:, 0, 1] = A[:, 1, 2] = h
    A[:, 1, 0], A[:, 1, 1], A[:, 2, 3] = -h * omega**2, -2 * h * decay, 1
    steps = np.array([scipy.linalg.expm(each)[:2] for each in A]).transpose(1, 2, 0)
    (C, S, first, last), (own, rate, kick, late) = steps
    first, kick = first - last, kick - late

    give = (B * last) @ B.T
    q, v, F = np.zeros_like(omega), np.append(0.0 * x, np.sqrt(masses)), none
    forces = [F]
    for _ in range(STEPS):
        free = C * q + S * v + (F @ B) * first
        reach = -B @ free
        new = F
        for _ in range(60):  # Newton for F = k (reach - give F)^1.5
            gap = np.maximum(reach - give @ new, 0.0)
            slopes = np.eye(p) + 1.5 * k * np.sqrt(gap)[:, None] * give
            change = np.linalg.solve(slopes, new - k * gap**1.5)
            new = new - change
            if np.abs(change).max() < 1e-12 * (1.0 + np.abs(new).max()):
                break
        v = own * q + rate * v + (F @ B) * kick + (new @ B) * late
        q = free + (new @ B) * last
        F = new
        forces.append(F)

    # between the steps a force grows as the power 1.5 of time at a touch
    roots = np.cbrt(np.maximum(forces, 0.0) ** 2)
    return np.array([np.interp(time, h * np.arange(STEPS + 1), one) for one in roots.T]).T ** 1.5


@functools.cache
def model_of(free: bool, **options: object) -> tuple[ao.AntiOscillators, tuple[sp.csr_matrix, ...]]:
    """The model of a bar of 150 elements, struck at its end."""
    K, M = bar(150, free)
    part = ao.Structure.from_matrices(K, M)
    dof = K.shape[0] - 1
    return ao.extract(part, ao.Site(dof=dof), **{"n": 25, "proof": True, **options}), (K, M)  # type: ignore[return-value, arg-type]


@pytest.mark.parametrize(
    ("damping", "expansion", "free"),
    [(one, *((None, False), (3000.0, True))[k % 2]) for k, one in enumerate(DAMPING)],
)
def test_the_true_force_lies_within_its_bounds(
    damping: ao.Damping, expansion: float | None, free: bool
) -> None:
    model, matrices = model_of(free, expansion=expansion, damping=damping)
    hit = ao.simulate(model, ao.RigidMass(0.3, 1.0), ao.Hertz(1e9), DURATION, proof=True)
    bounds = hit.enclosure
    F = true_forces(matrices, [matrices[0].shape[0] - 1], [0.3], 1e9, bounds.time, damping)[:, 0]
    slack = 4e-5 * F.max()  # of the linear steps of the truth
    assert np.all(bounds.lower - slack <= F)
    assert np.all(bounds.upper + slack >= F)
    low, high = bounds.peak
    assert low <= hit.peak_force <= high
    assert high - low < 0.05 * hit.peak_force
    assert bounds.impulse[0] <= hit.impulse <= bounds.impulse[1]
    assert "proved between" in hit.summary()


@pytest.mark.parametrize(
    ("depth", "share", "compliance"), [(1.5, 0.0, 0.0), (8.0, 0.5, 2e-10), (40.0, 0.3, 0.0)]
)
def test_a_contact_that_yields_has_bounds(depth: float, share: float, compliance: float) -> None:
    """Loading, unloading and the impulse, of a contact `depth` times as deep as at yield."""
    proof = demo("proof")
    proof.STEPS = 10_000
    model, matrices = model_of(False)
    mass, speed, radius = 0.3, 1.0, 0.1
    modulus = 0.75 * 1e9 / np.sqrt(radius)
    elastic = (1.25 * mass * speed**2 / 1e9) ** 0.4
    strength = modulus / np.pi * np.sqrt(elastic / radius / depth)
    law = ao.ElasticPlastic(modulus, radius, strength, 0.3, share, compliance=compliance)
    hit = ao.simulate(model, ao.RigidMass(mass, speed), law, DURATION, proof=True)
    bounds = hit.enclosure

    x, U = scipy.linalg.eigh(*(one.toarray() for one in matrices))
    omega, root = np.append(np.sqrt(x), 0.0), np.sqrt(mass)
    beta = np.append(-U[-1], 1 / root)[None]
    v = np.append(0.0 * x, speed * root)
    forces = proof.true_forces(
        omega, 0.0 * omega, beta, v, [proof.Yielding(law)], compliance, DURATION
    )[0]
    assert forces.max() > 1.2 * law.yield_force

    F = np.interp(bounds.time, np.linspace(0.0, DURATION, forces.size), forces)
    slack = 1e-5 * forces.max()
    assert np.all(bounds.lower - slack <= F)
    assert np.all(bounds.upper + slack >= F)
    low, high = bounds.peak
    assert low - slack <= forces.max() <= high + slack
    assert high - low < 0.1 * forces.max()
    impulse = (forces.sum() - forces[-1] / 2) * DURATION / proof.STEPS
    assert bounds.impulse[0] <= impulse <= bounds.impulse[1]


def test_a_contact_that_yields_is_as_the_proof_takes_it() -> None:
    """Convex loading, of falling curvature; deeper contacts are wider, and unload below the others.

    The proof sees where two of them cross: up to 1.12 times the indentation at yield.
    """
    x = np.concatenate([np.linspace(1.0, 3.0, 400), np.geomspace(3.01, 1e5, 400)])
    for share in (0.0, 0.3, MAX_ELASTIC_SHARE):
        law = demo("proof").Yielding(ao.ElasticPlastic(1e9, 0.1, 1e6, 0.3, share))
        depths = x * law.y
        force, slope = np.transpose([law.first(d) for d in depths])
        assert law.first(law.y * (1 + 1e-12))[0] >= law.first(law.y)[0] * (1 - 1e-9)
        assert law.first(law.y * (1 + 1e-12))[1] >= law.first(law.y)[1] * (1 - 1e-9)
        bend = np.diff(slope) / np.diff(depths)
        assert bend.min() > 0
        assert np.all(np.diff(bend) < 1e-6 * bend[:-1])

        rows = []
        for d in depths:
            law.press(d)
            rows.append(law.back)
        low, width, _, n = np.transpose(rows)
        assert np.all(np.diff(width) > 0)
        assert np.all(np.diff(n) < 0)
        by_depth = np.gradient(low, depths)
        falls = (1.25 - n) / (2 * depths) * width + n * by_depth >= 0
        stiffer = n * force >= slope * width
        assert np.all((falls & stiffer)[x > 1.12])


def test_a_model_of_more_vectors_proves_no_less_with_few() -> None:
    """The expansion is that of the contact time, whatever number of vectors a model has."""
    counts = []
    for n in (30, 90):
        model, _ = model_of(False, n=n, proof=1e-3)
        blow = ao.RigidMass(0.3, 1.0), ao.Hertz(1e9), DURATION
        hit = ao.simulate(model, *blow, n="proved", tol=0.05)
        counts.append(hit.enclosure.n)
    assert counts[1] <= 1.3 * counts[0]


def test_a_residual_that_is_too_small_is_seen() -> None:
    """The bounds hold for the residual of the model, and not for a hundredth of it."""
    model, matrices = model_of(False, n=6)
    known = model.recurrence
    assert known is not None
    H = known.H.copy()
    H[known.n :, : known.n] *= 0.01
    small = replace(known, H=H)
    outside = []
    for recurrence in (known, small):
        blow = ao.RigidMass(0.02, 1.0)
        one = replace(model, recurrence=recurrence)
        hit = ao.simulate(one, blow, ao.Hertz(1e11), 5e-4, tol=1e-6, proof=True)
        F = true_forces(matrices, [matrices[0].shape[0] - 1], [0.02], 1e11, hit.enclosure.time)[
            :, 0
        ]
        slack = 1e-4 * F.max()
        inside = (hit.enclosure.lower - slack <= F) & (hit.enclosure.upper + slack >= F)
        outside.append(not inside.all())
    assert outside == [False, True]


@pytest.mark.parametrize(
    ("damping", "free"), [(NONE, True), (ao.Damping(0.005, 50.0, 1e-6), False)]
)
def test_two_sites_of_one_body_have_bounds(damping: ao.Damping, free: bool) -> None:
    matrices = bar(150, free)
    dofs = [matrices[0].shape[0] - 1, 60]
    sites = {"end": ao.Site(dof=dofs[0]), "middle": ao.Site(dof=dofs[1])}
    part = ao.Structure.from_matrices(*matrices)
    model = ao.extract(part, sites, n=50, proof=1e-3, damping=damping)
    bodies = {"bar": model, "a": ao.RigidMass(0.3, 1.0), "b": ao.RigidMass(0.1, 1.0)}
    pairs = ("bar:end", "a"), ("bar:middle", "b")
    hit = ao.Scene(bodies, [ao.Contact(*pair, ao.Hertz(1e9)) for pair in pairs]).run(
        1.5e-3, proof=True
    )

    bounds = [hit[pair].enclosure for pair in pairs]
    truth = true_forces(matrices, dofs, [0.3, 0.1], 1e9, bounds[0].time, damping)
    for one, F in zip(bounds, truth.T, strict=True):
        slack = 4e-5 * F.max()
        assert np.all(one.lower - slack <= F)
        assert np.all(one.upper + slack >= F)
        assert one.peak[0] <= F.max() + slack
        assert one.peak[1] - one.peak[0] < 0.05 * F.max()


def test_a_ball_between_two_bars_has_bounds_of_both_forces() -> None:
    ends = {"first": model_of(True)[0], "second": model_of(False)[0]}
    contacts = [ao.Contact(a, b, ao.Hertz(1e9)) for a, b in (("first", "ball"), ("ball", "second"))]
    bodies = {**ends, "ball": ao.RigidMass(0.3, 0.0)}
    scene = ao.Scene(bodies, contacts, motion={"first": -1.0})
    hit = scene.run(1e-3, proof=True)
    exact = scene.run(1e-3, tol=1e-7)
    for pair in (("first", "ball"), ("ball", "second")):
        low, high = hit[pair].enclosure.peak
        assert 0 < low < exact[pair].peak_force < high < 1.3 * low
    assert hit.summary().count("proved between") == 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (lambda: {"contact": ao.laws.HuntCrossley(1e9, 0.7)}, "convex law"),
        (lambda: {"contact": ao.ElasticPlastic(1e9, 0.1, 1e6, 0.3, 0.7)}, "stays elastic"),
        (lambda: {"model": model_of(False, damping=(0.01, 0.02))[0]}, "single modes"),
        (lambda: {"model": model_of(False, proof=False)[0]}, "residual is known"),
        (
            lambda: {
                "initial_velocity": 0.1,
                "model": model_of(True)[0].truncated(3),
                "impactor": model_of(False, proof=False)[0],
            },
            "residual is known",
        ),
    ],
)
def test_what_is_outside_the_proof_is_refused(
    changes: Callable[[], dict[str, object]], words: str
) -> None:
    model, _ = model_of(False)
    arguments = {"model": model, "impactor": ao.RigidMass(0.3, 1.0), "contact": ao.Hertz(1e10)}
    with pytest.raises(InputError, match=words):
        ao.simulate(**{**arguments, "duration": 1e-3, **changes()}, proof=True)  # type: ignore[arg-type]
