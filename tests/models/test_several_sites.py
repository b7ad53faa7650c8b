"""The model of several sites: against dense matrices, in free modes, truncated, saved, refused."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from numpy.typing import NDArray

import antiosc as ao
from chains import loose_chains, receptance

Array = NDArray[np.float64]


def by_hand(
    K: Array, M: Array, B: Array, n: int | None = None, **given: object
) -> ao.AntiOscillators:
    """The model from the textbook formulas, in dense algebra with the sites as coordinates."""
    p = B.shape[1]
    rest = scipy.linalg.null_space(B.T)
    T = np.hstack([B @ np.linalg.inv(B.T @ B), rest])  # x = T (u, y): B'x = u
    k, m = T.T @ K @ T, T.T @ M @ T
    x, phi = scipy.linalg.eigh(k[p:, p:], m[p:, p:])
    static = np.vstack([np.eye(p), -np.linalg.solve(k[p:, p:], k[p:, :p])])
    P = static.T @ m[:, p:] @ phi
    m_st = static.T @ m @ static
    model = ao.AntiOscillators(
        m0=m_st - P @ P.T,
        k0=static.T @ k @ static,
        P=P,
        omega=np.sqrt(x),
        sites=[f"s{i}" for i in range(p)],
        shapes=T @ np.hstack([static, np.vstack([np.zeros((p, phi.shape[1])), phi])]),
        **given,
    )
    return model if n is None else model.truncated(n)


OMEGA = np.geomspace(20, 2e3, 25) * (1 + 0.01j)


@pytest.mark.parametrize("p", [1, 2, 4])
@pytest.mark.parametrize("held", [0, 1])
def test_all_modes_are_the_structure(p, held, rng):
    K, M = loose_chains((10,), held, rng)
    B = rng.standard_normal((10, p))
    model = by_hand(K, M, B)
    H = receptance(K, M, B, OMEGA)
    one = np.broadcast_to(np.eye(p), H.shape)
    np.testing.assert_allclose(model.dynamic_stiffness(OMEGA) @ H, one, atol=1e-8)
    np.testing.assert_allclose(model.m0, np.linalg.inv(B.T @ np.linalg.solve(M, B)), rtol=1e-9)
    free = model.site_modes()
    np.testing.assert_allclose(free.receptance(OMEGA), H, atol=1e-8 * np.abs(H).max())
    exact = np.sqrt(np.abs(scipy.linalg.eigvalsh(K, M)))
    assert np.sum(free.omega == 0) == 1 - held
    np.testing.assert_allclose(free.omega[1 - held :], exact[1 - held :], rtol=1e-8)


def test_saved_and_loaded(tmp_path, rng):
    K, M = loose_chains((8,), 0, rng)
    model = by_hand(
        K,
        M,
        rng.standard_normal((8, 3)),
        columns={"s0": (0,), "s1": (1,), "s2": (2,)},
        direction=np.eye(3),
        radius=[None, 2e-3, None],
        local_compliance=[0.0, 1e-9, 0.0],
        participation=rng.standard_normal((8, 3)),
        damping=ao.Damping(0.01),
        info={"method": "by hand"},
    )
    path = tmp_path / "model.npz"
    model.save(path)
    again = ao.AntiOscillators.load(path)
    for name in ("k0", "m0", "P", "m", "omega", "rigid", "dependence", "direction"):
        np.testing.assert_array_equal(getattr(again, name), getattr(model, name))
    assert again.sites == model.sites == ("s0", "s1", "s2")
    assert again.columns == model.columns
    assert again.radius == model.radius == (None, 2e-3, None)
    assert again.info.as_dict() == {"method": "by hand"}
    assert again.shapes is None
    both = again.site_modes().receptance(OMEGA), model.site_modes().receptance(OMEGA)
    np.testing.assert_array_equal(*both)


@pytest.mark.parametrize("n", [0, 1, 3, 6])
def test_truncated_models_are_passive_and_their_compliance_is_the_whole(n, rng):
    K, M = loose_chains((10,), 1, rng)
    B = rng.standard_normal((10, 2))
    model = by_hand(K, M, B, n)
    assert model.n == n
    assert np.linalg.eigvalsh(model.m0)[0] > 0.0
    assert np.linalg.eigvalsh(model.k0)[0] > 0.0
    least = np.linalg.inv(B.T @ np.linalg.solve(M, B))
    assert np.linalg.eigvalsh(model.m0 - least)[0] > -1e-12
    np.testing.assert_allclose(model.m_st, by_hand(K, M, B).m_st, rtol=1e-10)
    at_rest = receptance(K, M, B, np.array([0j]))[0].real
    np.testing.assert_allclose(model.site_modes().receptance(0.0), at_rest, rtol=1e-9)


def test_free_modes_are_orthonormal_in_the_shapes(rng):
    K, M = loose_chains((9,), 0, rng)
    B = rng.standard_normal((9, 2))
    model = by_hand(K, M, B)
    free = model.site_modes()
    modes = free.field(free.shape.T)  # one mode after the other
    np.testing.assert_allclose(modes @ M @ modes.T, np.eye(9), atol=1e-9)
    stiffness = modes @ K @ modes.T
    np.testing.assert_allclose(stiffness, np.diag(free.omega**2), atol=1e-9 * free.omega[-1] ** 2)
    np.testing.assert_allclose(modes @ B, free.b, atol=1e-9)


def test_massless_sites_have_a_residual_compliance(rng):
    K, M = loose_chains((8,), 1, rng)
    full = by_hand(K, M, rng.standard_normal((8, 2)))
    m0 = full.m0 - full.m0  # exactly nothing
    model = ao.AntiOscillators(m0=m0, k0=full.k0, P=full.P, omega=full.omega, sites=["a", "b"])
    free = model.site_modes()
    assert free.omega.size == 6
    assert np.linalg.eigvalsh(free.r)[0] > 0
    product = model.dynamic_stiffness(OMEGA) @ free.receptance(OMEGA)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(2), product.shape), atol=1e-9)


def test_one_site_with_a_name_is_the_model_of_one_site():
    plain = ao.AntiOscillators(m0=0.1, k0=2e5, m=[0.3, 0.05], omega=[900.0, 4e3])
    named = ao.AntiOscillators(
        m0=[[0.1]], k0=[[2e5]], P=[np.sqrt([0.3, 0.05])], omega=[900.0, 4e3], sites=["tip"]
    )
    Z = named.dynamic_stiffness(OMEGA)
    np.testing.assert_allclose(Z[:, 0, 0], plain.dynamic_stiffness(OMEGA), rtol=1e-13)
    np.testing.assert_allclose(named.site_modes().omega, plain.modal().omega, rtol=1e-12)
    np.testing.assert_allclose(np.abs(named.site_modes().b[:, 0]), plain.modal().b, rtol=1e-11)
    np.testing.assert_allclose(named.m[:, 0, 0], plain.m)
    np.testing.assert_allclose(named.k[:, 0, 0], plain.k)


def test_sites_that_follow_others():
    """Three sites, the third midway between the first two, on a beam that is rigid there."""
    model = ao.AntiOscillators(
        m0=[[2.0, 0.5], [0.5, 1.0]], k0=np.diag([1e5, 3e5]), P=[[0.4], [0.7]], omega=[500.0],
        sites=["left", "right", "middle"], dependence=[[1, 0], [0, 1], [0.5, 0.5]],
    )  # fmt: skip
    H = model.site_modes().receptance(OMEGA)
    both = np.linalg.inv(model.dynamic_stiffness(OMEGA))
    np.testing.assert_allclose(H[:, :2, :2], both, rtol=1e-9)
    np.testing.assert_allclose(H[:, 2, 2], both.sum(axis=(1, 2)) / 4, rtol=1e-9)


def test_a_damped_receptance_is_that_of_the_matrices(rng):
    """[K + iω C - ω² M]⁻¹ with the modal damping C, and the residual compliance beside."""
    omega, decay = np.array([0.0, 40.0, 90.0]), np.array([2.0, 5.0, 0.0])
    b, r = rng.standard_normal((3, 2)), np.diag([1e-6, 3e-6])
    body = ao.SiteModes(omega, b, ["a", "b"], r=r, decay=decay)
    for w in (3.0, 55.0):
        dynamic = np.diag(omega**2 + 2j * w * decay - w**2)
        expected = b.T @ np.linalg.inv(dynamic) @ b + r
        np.testing.assert_allclose(body.receptance(w), expected, rtol=1e-12)
        one = ao.ModalBody(omega, b[:, 0], r=1e-6, decay=decay)
        np.testing.assert_allclose(one.receptance(w), expected[0, 0], rtol=1e-12)
    # what is pushed goes on by itself more and more slowly: the phase lags
    assert np.all(body.receptance(np.array([39.0]))[0].diagonal().imag < 0)
