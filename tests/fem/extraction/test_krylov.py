"""Krylov anti-oscillators: moments, bound, exhaustion, rigid-body modes, and the modes method."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.models.free_modes import sample_frequencies
from antiosc.reduce.extraction.eigenmodes import polish
from chains import receptance
from marks import FREE_ON_PURPOSE


def _push(structure: ao.Structure, direction: tuple[float, float, float]) -> np.ndarray:
    """A load of no symmetry along `direction`, spread over all nodes."""
    n = structure.K.getSize()[0]
    push = np.random.default_rng(1).uniform(0.5, 1.5, n) * np.resize(direction, n)
    push[structure.fixed] = 0.0
    return push


pytestmark = FREE_ON_PURPOSE


def block(n: int = 6, fix: str | list[str] = "all") -> ao.Structure:
    """A steel block, held at one end: hexahedra."""
    mesh = parts.box((n, n // 2 + 1, 2), (0.1, 0.06, 0.03))
    return ao.Structure(mesh, ao.Solid(**parts.STEEL), [ao.Support("left", fix)])


@pytest.fixture(scope="module")
def steel() -> ao.Structure:
    return block()


SITE = ao.Site(point=(0.07, 0.033, 0.03), direction=(0.2, 0.1, -1), radius=0.02)


@pytest.mark.parametrize("method", ["modes", "krylov"])
@pytest.mark.parametrize("held", [[27], [27, 28]])
def test_antioscillators_that_are_counted_carry_mass(rng, method, held):
    """Two sides that an uneven mesh makes a little unlike, and three masses on the axis."""
    half = rng.uniform(1e5, 3e5, 14)
    K = np.zeros((29, 29))
    for i, j, k in [
        *((i, i + 1, half[i]) for i in range(13)),
        *((13 + i, 14 + i, half[::-1][1 + i]) for i in range(13)),
        (13, 27, 2e5), (27, 28, 3e5), (0, 0, 1e5), (26, 26, 1e5), (28, 28, 2e5),
    ]:  # fmt: skip
        K[i, i] += k
        if i != j:
            K[j, j] += k
            K[i, j] = K[j, i] = -k
    uneven = np.where(np.arange(29) < 13, 1 + 1e-5 * np.arange(29), 1.0)
    structure = ao.Structure.from_matrices(K, np.diag(uneven))
    sites = {f"s{i}": ao.Site(dof=i) for i in held} if len(held) > 1 else ao.Site(dof=27)
    model = ao.extract(structure, sites, n=8, method=method)
    # of even sides: those that move alike, as half of them with half of mass 13
    axis = np.setdiff1d([*range(14), 28], held)
    alike = K[np.ix_(axis, axis)]
    alike[12:14, 12:14] *= [[1, np.sqrt(2)], [np.sqrt(2), 1]]
    exact = scipy.linalg.eigvalsh(alike)[:8]
    found = model.info["converged"] if method == "krylov" else 8
    assert model.n == 8
    assert model.mass_shares.min() > 1e-6
    assert found >= 3
    np.testing.assert_allclose(model.omega[:found] ** 2, exact[:found], rtol=1e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "lanczos"}, "lanczos"),
        ({"n": -1}, "n must be"),
        ({"n": 2.5}, "n must be"),
        ({"n": 10**6}, "dofs"),
        ({"tol": 0.0}, "tol"),
        ({"tol": 1.0}, "tol"),
        ({"band": 0.0}, "band"),
        ({"band": 100.0, "method": "modes"}, "takes method"),
        ({"band": 1e5, "n": 0}, "n must be"),
        ({"band": 1e5, "accuracy": -1}, "accuracy"),
        ({"damping": -0.1}, "ratios"),
        ({"damping": "much"}, "ratio"),
    ],
)
def test_bad_wishes(steel, options, words):
    with pytest.raises(ao.InputError, match=words):
        ao.extract(steel, SITE, **options)


@pytest.mark.slow
def test_a_body_that_slides_across_the_impact():
    structure = block(2, fix=["x", "y"])  # along z it slides
    site = ao.Site(vector=_push(structure, (1.0, 0.4, 0.0)))
    model = ao.extract(structure, site, n=40)
    assert structure.rigid_modes.shape[1] == 1
    assert model.k0 > 0
    K, M = (csr(matrix).toarray() for matrix in (structure.K, structure.M))
    omega = sample_frequencies(2 * model.omega[0], model.omega[0])[::20]
    exact = 1 / receptance(K, M, np.asarray(site.vector), omega)
    np.testing.assert_allclose(model.dynamic_stiffness(omega), exact, rtol=1e-8)


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4])
def test_close_modes_of_a_wide_spectrum_are_polished(apart):
    """Repeated and close eigenvalues at 1e-10 of the highest, where a dense solver mixes them."""
    rng = np.random.default_rng(1)
    Q = np.linalg.qr(rng.normal(size=(40, 40)))[0]
    smallest = 1e-10 * (1 + apart * np.arange(10))
    theta = np.concatenate([smallest, np.geomspace(1e-9, 1.0, 30)])
    H = (Q * theta) @ Q.T
    H = (H + H.T) / 2
    found, x = np.linalg.eigh(H)
    poles, x = polish(x / np.sqrt(found), lambda x: x.T @ x, lambda x: x.T @ H @ x)
    scale = np.sqrt(poles)
    exact = (x.T.astype(np.longdouble) @ H @ x).astype(float)
    assert np.abs(exact - np.eye(40)).max() < 1e-6
    assert np.abs(x.T @ x / np.outer(scale, scale) - np.eye(40)).max() < 1e-6
