"""The anti-oscillator model: identities of the driving point, truncation, files."""

from __future__ import annotations

import struct
import zipfile

import numpy as np
import pytest
import scipy.linalg as la

import antiosc as ao
from antiosc.models.motion import arrow_modes
from scenes import random_model


def spd(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    a, b = rng.standard_normal((2, n, n))
    return a @ a.T + n * np.eye(n), b @ b.T + n * np.eye(n)


def anti_oscillators(K: np.ndarray, M: np.ndarray, p: int) -> ao.AntiOscillators:
    """Article eq. (28)-(31) with dense matrices, site at dof p."""
    unit = np.zeros(K.shape[0])
    unit[p] = 1.0
    y = np.linalg.solve(K, unit)
    static = y / y[p]
    keep = np.arange(K.shape[0]) != p
    x, V = la.eigh(K[np.ix_(keep, keep)], M[np.ix_(keep, keep)])
    L = V.T @ (M @ static)[keep]
    return ao.AntiOscillators(
        m0=static @ M @ static - np.sum(L**2), k0=1 / y[p], m=L**2, omega=np.sqrt(x)
    )


def test_driving_point_stiffness_is_that_of_the_matrices(rng):
    K, M = spd(rng, 9)
    model = anti_oscillators(K, M, 4)
    for omega in rng.uniform(0.05, 3.0, 10):
        direct = 1 / np.linalg.inv(K - omega**2 * M)[4, 4]
        assert model.dynamic_stiffness(omega) == pytest.approx(direct, rel=1e-9)


def test_free_frequencies_interlace_and_agree(rng):
    K, M = spd(rng, 9)
    model = anti_oscillators(K, M, 0)
    free = model.modal().omega
    assert free == pytest.approx(np.sqrt(la.eigh(K, M, eigvals_only=True)), rel=1e-10)
    assert np.all(free[:-1] < model.omega)
    assert np.all(model.omega < free[1:])


@pytest.mark.parametrize("m0", [0.0, 1e-9, 1e-3, 1.0, 1e6])
@pytest.mark.parametrize("k0", [0.0, 1e-3, 1e6])
def test_free_modes_are_exact_for_any_ratio_of_masses(rng, m0, k0):
    omega = np.sort(rng.uniform(10.0, 1e5, 40))
    m = 10 ** rng.uniform(-12, 0, 40)
    x, shape = arrow_modes(k0, m0, m, omega**2)
    mass = np.concatenate(([m0], m))
    assert shape.T @ (mass[:, None] * shape) == pytest.approx(np.eye(x.size), abs=1e-11)
    model = ao.AntiOscillators(m0=m0, k0=k0, m=m, omega=omega)
    w = rng.uniform(1.0, 1e5, 8) * (1 + 1j)  # off the poles
    r = 0.0 if m0 > 0 else 1 / (k0 + np.sum(m * omega**2))
    H = np.sum(shape[0] ** 2 / (x - w[:, None] ** 2), axis=1) + r
    assert H * model.dynamic_stiffness(w) == pytest.approx(np.ones(8), rel=1e-11)


def test_equal_frequencies_act_as_one(rng):
    split = ao.AntiOscillators(m0=0.1, k0=10.0, m=[0.2, 0.3, 0.4], omega=[5.0, 5.0, 9.0])
    whole = ao.AntiOscillators(m0=0.1, k0=10.0, m=[0.5, 0.4], omega=[5.0, 9.0])
    assert split.modal().omega == pytest.approx(whole.modal().omega)
    assert split.modal().b == pytest.approx(whole.modal().b)
    assert split.modal().shape[1] == pytest.approx(split.modal().shape[2])


def test_truncation_returns_the_mass_and_keeps_the_static_answer(rng):
    model = random_model(rng, 6)
    short = model.truncated(2)
    assert short.n == 2
    assert short.m_st == pytest.approx(model.m_st)
    assert short.dynamic_stiffness(0.0) == model.k0
    assert short.participation.sum() == pytest.approx(model.participation.sum())
    # the low-frequency expansion k0 - x m_st - ... begins alike
    x = 1e-3 * model.omega[0]
    assert short.dynamic_stiffness(x) == pytest.approx(model.dynamic_stiffness(x), rel=1e-9)


def test_field_is_equation_eight(rng):
    shapes = rng.standard_normal((7, 3))
    model = ao.AntiOscillators(m0=1.0, k0=1.0, m=[1.0, 2.0], omega=[1.0, 2.0], shapes=shapes)
    lam = np.array([0.3, -0.2, 0.9])
    by_hand = lam[0] * shapes[:, 0] + (lam[1] - lam[0]) * shapes[:, 1]
    by_hand += (lam[2] - lam[0]) * shapes[:, 2]
    assert model.field(lam) == pytest.approx(by_hand)


class TestFile:
    def test_round_trip(self, rng, tmp_path):
        model = ao.AntiOscillators(
            m0=0.5,
            k0=1e5,
            m=rng.uniform(0.1, 1, 4),
            omega=np.arange(1.0, 5.0),
            local_compliance=1e-9,
            radius=2e-3,
            participation=rng.uniform(0, 1, 5),
            damping=ao.Damping(ratio=[0.01, 0.02], beta=1e-7),
            info={"dofs": 12},
        )
        model.save(tmp_path / "model.npz")
        back = ao.AntiOscillators.load(tmp_path / "model.npz")
        for name in ("m0", "k0", "local_compliance", "radius", "info", "damping"):
            assert getattr(back, name) == getattr(model, name)
        for name in ("m", "omega", "participation"):
            assert np.array_equal(getattr(back, name), getattr(model, name))
        assert back.modal().decay == pytest.approx(model.modal().decay)

    @pytest.mark.parametrize("text", ["((((", "{'descr':", "'''", "[1]"])
    def test_an_array_with_a_damaged_header(self, tmp_path, text):
        head = text.encode().ljust(118) + b"\n"
        with zipfile.ZipFile(tmp_path / "m.npz", "w") as archive:
            archive.writestr("m.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head)
        with pytest.raises(ao.InputError, match="damaged"):
            ao.AntiOscillators.load(tmp_path / "m.npz")


def test_centre_of_mass_and_momentum_about_another_point():
    """S of a rigid body about p, by hand: mass, first moments, Steiner's theorem."""
    point, centre, mass = np.array([1.0, 2, 3]), np.array([1.5, 2.2, 2.7]), 2.0
    c = centre - point
    cross = np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]])
    tensor = np.diag([1.0, 2, 3])
    matrix = np.block(
        [[mass * np.eye(3), -mass * cross], [mass * cross, tensor - mass * cross @ cross]]
    )
    inertia = ao.Inertia(point, matrix, np.zeros((0, 6)))
    assert inertia.mass == mass
    np.testing.assert_allclose(inertia.centre, centre)
    V, W = np.array([0.3, -0.2, 0.4]), np.array([2.0, -3.0, 5.0])
    momenta = matrix @ ao.Motion(V, W).at(inertia)
    np.testing.assert_allclose(momenta[:3], mass * V)
    np.testing.assert_allclose(inertia.moved(momenta, centre)[3:], tensor @ W)
    # the same motion told by another of its points
    about = np.array([0.0, 1.0, 0.0])
    same = ao.Motion(V + np.cross(W, about - centre), W, about).at(inertia)
    np.testing.assert_allclose(same, ao.Motion(V, W).at(inertia))


MODEL = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3], omega=[2e3], local_compliance=2e-8, radius=3e-3)


class Bare:
    """A foreign body: a free mass of 0.2 kg, and nothing but its modes."""

    def modal(self):
        root = 0.2**0.5
        return ao.ModalBody([0.0], [1 / root], weight=[root])


def with_more(**said):
    body = Bare()
    vars(body).update(said)
    return body


def test_a_foreign_striker_hits_as_a_rigid_mass_does():
    foreign = with_more(velocity=1.5, gap=1e-4)
    hits = [
        ao.simulate(MODEL, striker, ao.Linear(1e7), 2e-3, gap=gap)
        for striker, gap in ((foreign, None), (ao.RigidMass(0.2, 1.5), 1e-4))
    ]
    assert hits[0].contacts[0][0] == pytest.approx(1e-4 / 1.5, rel=1e-9)
    assert hits[0].peak_force == pytest.approx(hits[1].peak_force, rel=1e-9)
    assert hits[0].impactor is foreign
