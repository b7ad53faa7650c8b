"""Oblique blows of spheres with friction: sliding, sticking, and partial slip as the reference.

In the normalised speeds of Maw, Barber and Fawcett, Wear 38 (1976) 101-114 (recalled),

    psi = kappa v_t / (mu v_n),      kappa = 2 (1 - nu)/(2 - nu),

with v_t the tangential speed of the point that touches, a solid sphere slides all along where
psi_1 > 4 chi - 1, chi = 3.5 kappa/2, and rebounds then with psi_2 = psi_1 - 4 chi.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import beta

import antiosc as ao
from scene_cases import ball

NU, MU = 0.3, 0.2
KAPPA = 2 * (1 - NU) / (2 - NU)
CHI = 3.5 * KAPPA / 2
MASS, RADIUS = 0.3, 0.02


def struck(psi: float, law: ao.ContactLaw, tol: float = 1e-3, **options: float) -> ao.SceneHistory:
    """A solid sphere that falls on the floor at 1 m/s and psi."""
    moment = 0.4 * MASS * RADIUS**2
    body = ao.RigidBody(MASS, (moment,) * 3, {"foot": ((0, 0, -RADIUS), (0, 0, 1.0))})
    contact = ao.Contact("ball:foot", "floor", law, friction=MU, **options)
    start = ao.Motion(velocity=(psi * MU / KAPPA, 0, -1.0))
    scene = ao.Scene({"ball": body, "floor": ao.Obstacle()}, [contact], motion={"ball": start})
    return scene.run(1e-3, tol=tol)


def rebound(hit: ao.SceneHistory) -> float:
    """psi_2."""
    return float(hit.bodies["ball"].velocity("foot", (1, 0, 0))[-1]) * KAPPA / MU


@cache
def partial_slip(psi: float, steps: int = 1500, springs: int = 200) -> float:
    """psi_2 where the contact slips from its edge inward.

    Independent springs under the profile x^2/R, each with friction, stand for Hertz's and Mindlin's
    contact exactly: V. L. Popov, M. Hess, Method of dimensionality reduction (2015), recalled.
    Mass, radius and speed of approach are 1; the force is indentation^(3/2).
    """
    deepest = 1.25**0.4
    width = np.sqrt(deepest) / springs
    x = (np.arange(springs) + 0.5) * width
    d, v, speed, slide = 0.0, 1.0, psi * MU / KAPPA, np.zeros(springs)
    normal = tangential = 0.0
    h = 2 * deepest * 0.4 * float(beta(0.4, 0.5)) / steps
    for _ in range(2 * steps):
        v -= h / 2 * normal
        speed -= 3.5 * h / 2 * tangential
        d += h * v
        pressed = np.maximum(d - x * x, 0.0)
        most = MU / KAPPA * pressed
        slide = np.clip(slide + h * speed, -most, most)
        normal, tangential = 1.5 * width * pressed.sum(), 1.5 * KAPPA * width * slide.sum()
        v -= h / 2 * normal
        speed -= 3.5 * h / 2 * tangential
        if d <= 0.0:
            break
    return float(speed * KAPPA / MU)


@pytest.mark.slow
def test_the_reference_slides_as_published() -> None:
    for psi in (4 * CHI - 0.9, 6.0):
        assert partial_slip(psi) == pytest.approx(psi - 4 * CHI, abs=2e-3)
    assert partial_slip(4 * CHI - 1.3) > -1.3 + 5e-3  # it sticks at the end
    assert partial_slip(0.5) == pytest.approx(partial_slip(0.5, 3000, 400), abs=1e-3)


def on_a_patch(law: ao.ContactLaw, local: float, **options: float) -> ao.SceneHistory:
    """The sphere's mass, without spin, on a floor; its site gives way as a patch does."""
    b = np.zeros((6, 3))
    b[:3] = np.eye(3) / np.sqrt(MASS)
    momentum = np.zeros((6, 6))
    momentum[:3, :3] = np.sqrt(MASS) * np.eye(3)
    body = ao.SiteModes(
        np.zeros(6),
        b,
        {"foot": (0, 1, 2)},
        r=np.diag([local, local / KAPPA, local / KAPPA]),
        directions=[(0, 0, 1.0), (1.0, 0, 0), (0, 1.0, 0)],
        inertia=ao.Inertia(np.zeros(3), np.diag([MASS] * 3 + [1.0] * 3), momentum),
        local_compliance={"foot": local},
    )
    contact = ao.Contact("ball:foot", "floor", law, friction=2.0, **options)
    motion = {"ball": ao.Motion(velocity=(0.3, 0, -1.0))}
    return ao.Scene({"ball": body, "floor": ao.Obstacle()}, [contact], motion=motion).run(1e-3)


@pytest.mark.parametrize("given", [{}, {"tangential_stiffness": 3e6}])
def test_a_patch_gives_way_sideways_once(given: dict[str, float]) -> None:
    """Its compliance counts neither twice normally nor tangentially: the blow is that without."""
    law = ao.Hertz(1e9)
    with_patch, without = on_a_patch(law, 6e-8, **given), on_a_patch(law, 0.0, **given)
    one, two = with_patch["ball:foot", "floor"], without["ball:foot", "floor"]
    assert one.peak_force == pytest.approx(two.peak_force, rel=1e-3)
    rubbed = [float(np.abs(c.friction).max()) for c in (one, two)]
    assert rubbed[0] == pytest.approx(rubbed[1], rel=0.01)
    whole = [
        1 / h.assembly.system.contacts["tangential_stiffness"][0] for h in (with_patch, without)
    ]
    assert whole[0] + 6e-8 / KAPPA == pytest.approx(whole[1], rel=1e-9)


@pytest.mark.parametrize("method", ["newmark", "DOP853"])
def test_other_methods_refuse_friction(method: str) -> None:
    with pytest.raises(ao.InputError, match="friction"):
        struck(1.2, ao.Hertz(1e9)).assembly.scene.run(1e-3, method=method)


@pytest.mark.parametrize("vx", [0.1, 0.3])
def test_stick_then_slip_in_closed_form(vx: float) -> None:
    """Linear compliances: T = kt vx/w sin wt sticks until |T| = mu N; then it slides to the end.

    W. J. Stronge, Impact Mechanics, Cambridge 2000, ch. 5; sliding persists as N falls.
    """
    k, kt, mu = 1e7, 1e7 * 1.4 / 1.7, 0.5
    mass_t = 0.3 * 2 / 7
    W, w = np.sqrt(k / 0.3), np.sqrt(kt / mass_t)
    end = np.pi / W
    times = np.linspace(0, end, 20001)[1:]

    def room(t: float) -> float:
        return mu * k / W * np.sin(W * t) - abs(kt * vx / w * np.sin(w * t))

    i = int(np.argmax([room(t) < 0 for t in times]))
    slip = brentq(room, times[i - 1], times[i])
    side = np.sign(np.sin(w * slip))
    left = mu * k / W**2 * (np.cos(W * slip) - np.cos(W * end))  # impulse of friction
    expected = vx * np.cos(w * slip) - side * left / mass_t
    hit = ball(vx, mu, ao.Linear(k), kt).run(1e-3, tol=1e-4)
    assert hit.bodies["ball"].velocity("foot", (1, 0, 0))[-1] == pytest.approx(expected, abs=5e-4)
    total = hit.energy.kinetic + hit.energy.contact
    assert total.max() <= total[0] * (1 + 1e-5)  # friction makes no energy


def test_friction_acts_along_the_slip() -> None:
    """Also where the compliance of what has no mass couples directions."""
    r = 1e-7 * np.array([[2.0, -1.0, 0.5], [-1.0, 6.0, 1.0], [0.5, 1.0, 3.0]])
    axes = np.eye(3)[[2, 0, 1]]
    body = ao.SiteModes([0.0] * 3, np.eye(3), {"tip": (0, 1, 2)}, r=r, directions=axes)
    contact = ao.Contact("part:tip", "floor", ao.Hertz(1e8), friction=0.3)
    start = ao.ModalState([0.0] * 3, [-1.0, 0.5, 0.3])
    scene = ao.Scene({"part": body, "floor": ao.Obstacle()}, [contact], motion={"part": start})
    hit = scene.run(4e-3)
    normal, along = hit.run.force[1:, 0], hit.run.force[1:, 1:]
    size = np.hypot(*along.T)
    slides = (normal > 0) & (size > 0.3 * normal * (1 - 1e-9))
    slider = (
        hit.run.depth[:, 1:]
        - hit.run.force[:, 1:] / hit.assembly.system.contacts["tangential_stiffness"][0]
    )
    first, middle, last = slider[:-1:2], slider[1::2], slider[2::2]
    whole = slides[::2] & slides[1::2]  # steps that slide from their middle to their end
    assert whole.sum() > 10
    for slip, node in (
        (last - first, slice(0, None, 2)),
        (first - 4 * middle + 3 * last, slice(1, None, 2)),
    ):
        force = along[node]
        across = slip[:, 0] * force[:, 1] - slip[:, 1] * force[:, 0]
        assert (np.abs(across) <= 1e-6 * np.hypot(*slip.T) * size[node])[whole].all()
        assert (np.sum(slip * force, axis=1) >= 0)[whole].all()


@pytest.mark.parametrize("psi", [6.0, 9.0])
def test_gross_sliding(psi: float) -> None:
    """In a hundred steps."""
    hit = struck(psi, ao.Hertz(1e9))
    assert hit.run.steps < 100
    assert rebound(hit) == pytest.approx(psi - 4 * CHI, abs=1e-4 * KAPPA / MU)


@pytest.mark.parametrize(
    ("psi", "most"), [(0.25, 0.2), (0.6, 0.29), (1.0, 0.2), (1.5, 0.08), (2.5, 0.08), (4.5, 0.08)]
)
def test_difference_to_partial_slip(psi: float, most: float) -> None:
    """A single spring of constant stiffness in series with a slider; the bounds are documented."""
    assert rebound(struck(psi, ao.Hertz(1e9))) == pytest.approx(partial_slip(psi), abs=most)


def test_gross_sliding_with_spin() -> None:
    """The tangential impulse is mu (1 + e) times the normal one, along the sliding."""
    hit = ball(5.0, 0.2, ao.Hertz(1e9)).run(2e-3)
    P = hit.bodies["ball"].momentum
    change = (P[-1] - P[0]) / 0.3
    slide = np.array([5.0, 0.0]) + np.cross((3.0, 0, 5.0), (0, 0, -0.02))[:2]
    slide /= np.linalg.norm(slide)
    np.testing.assert_allclose(change[:2], -0.2 * 2 * slide, atol=1e-4)
    assert change[2] == pytest.approx(2.0, abs=1e-4)
    assert hit.energy.drift < 1e-3


def test_an_oscillator_that_is_let_go_rubs_as_one_that_swings() -> None:
    """From its turning point on, or a quarter of a period later at its fastest: the same blow."""
    omega, way = 1e3, 1e-4
    b = np.eye(3) / np.sqrt(MASS)
    body = ao.SiteModes(
        [omega] * 3, b, {"foot": (0, 1, 2)}, directions=[(0, 0, 1.0), (1.0, 0, 0), (0, 1.0, 0)]
    )
    contact = ao.Contact("body:foot", "floor", ao.Hertz(1e8), gap=way / 2, friction=MU)
    q = np.sqrt(MASS) * way * np.array([1.0, 0.3, 0.0])
    starts = ao.ModalState(q, np.zeros(3)), ao.ModalState(np.zeros(3), -omega * q)
    found = []
    for start, late in zip(starts, (np.pi / 2, 0.0), strict=True):
        scene = ao.Scene({"body": body, "floor": ao.Obstacle()}, [contact], motion={"body": start})
        hit = scene.run((late + 3.0) / omega, tol=1e-5)["body:foot", "floor"]
        found.append((hit.peak_force, float(np.abs(hit.friction).max()), hit.impulse))
    assert found[0][0] > 10.0
    np.testing.assert_allclose(found[0], found[1], rtol=1e-4)
