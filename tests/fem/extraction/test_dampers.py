"""Models of structures with dampers, losses and layers that relax, against direct solves."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

import antiosc as ao

RNG = np.random.default_rng(0)
SIZE = 60
K = sp.diags([[2e6] * (SIZE - 1) + [1e6], [-1e6] * (SIZE - 1), [-1e6] * (SIZE - 1)], [0, 1, -1])
FREE = K - sp.csr_matrix(([1e6], ([0], [0])), (SIZE, SIZE))
M = 0.01 * sp.identity(SIZE)
ENDS = sp.csr_matrix(
    (np.array([1.0, 1.0, -1.0]), (np.array([0, 1, 1]), np.array([59, 30, 20]))), (2, SIZE)
)
C = ENDS.T @ sp.diags([30.0, 50.0]) @ ENDS
OMEGA = np.linspace(50, 5000, 40)
SITE = ao.Site(dof=45)


def chain(stiffness=K) -> ao.Structure:
    return ao.Structure.from_matrices(stiffness.tocsr(), M.tocsr(), C=C.tocsr(), backend="scipy")


def direct(stiffness, rows, omega=OMEGA) -> np.ndarray:
    """Receptances (W, r, r) between dofs."""
    found = []
    for w in omega:
        D = (stiffness - w**2 * M + 1j * w * C).toarray()
        found.append(np.linalg.inv(D)[np.ix_(rows, rows)])
    return np.array(found)


@pytest.mark.slow
def test_every_number_of_shapes_is_passive_and_many_are_exact():
    exact = direct(K, [45])[:, 0, 0]
    for n in (1, 2, 3, 5, 8, 13, 30):
        H = ao.extract(chain(), SITE, n=n).modal().receptance(OMEGA)
        assert (H.imag <= 0).all()
    np.testing.assert_allclose(H, exact, rtol=1e-6)


@pytest.mark.slow
def test_random_structures_are_passive_from_the_first_shape():
    for _ in range(5):
        A, B, L = RNG.normal(size=(12, 12)), RNG.normal(size=(12, 12)), RNG.normal(size=(2, 12))
        stiff, mass = A.T @ A + np.eye(12), B.T @ B + np.eye(12)
        part = ao.Structure.from_matrices(
            stiff, mass, C=10 ** RNG.uniform(-1, 2) * L.T @ L, backend="scipy"
        )
        for n in range(1, 11):
            body = ao.extract(part, ao.Site(dof=3), n=n).modal()
            w = np.geomspace(0.01, 100, 60)
            assert (body.receptance(w).imag <= 1e-12 * abs(body.receptance(w))).all()


def test_a_damping_matrix_at_the_site_itself_is_exact():
    """The constraint modes are still there: what they have of it is rounding."""
    one = sp.csr_matrix(([25.0], ([45], [45])), (SIZE, SIZE))
    part = ao.Structure.from_matrices(K.tocsr(), M.tocsr(), C=one, backend="scipy")
    bare = ao.Structure.from_matrices(K.tocsr(), M.tocsr(), backend="scipy")
    H = ao.extract(bare, SITE, n=25).modal().receptance(OMEGA)
    damped = ao.extract(part, SITE, n=25).modal().receptance(OMEGA)
    np.testing.assert_allclose(damped, 1 / (1 / H + 25j * OMEGA), rtol=1e-6)


def test_a_free_chain_braked_by_the_ground_at_several_sites():
    model = ao.extract(chain(FREE), {"a": SITE, "b": ao.Site(dof=10)}, n=34)
    H = model.site_modes().receptance(OMEGA)
    np.testing.assert_allclose(H, direct(FREE, [45, 10]), rtol=1e-6, atol=1e-12)


def test_what_does_not_take_dampers_and_no_damping_matrix():
    part = chain()
    for call in (
        lambda: ao.extract(part, SITE, n=5, method="modes"),
        lambda: ao.extract(part, SITE, n=5, damping=0.02),
        lambda: ao.extract(part, SITE, band=500.0),
        lambda: ao.superposition(part, SITE, 5),
        lambda: ao.full(part, SITE),
    ):
        with pytest.raises(ao.InputError, match="dampers"):
            call()
    with pytest.raises(ao.InputError, match="C must be positive semidefinite"):
        ao.Structure.from_matrices(K.tocsr(), M.tocsr(), C=-C.tocsr(), backend="scipy")
    with pytest.raises(ao.InputError, match="size"):
        ao.Structure.from_matrices(K.tocsr(), M.tocsr(), C=np.eye(3), backend="scipy")
