"""Reduced models as matrices, and their files read again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.io.matrices import fortran, read_pair
from antiosc_decks import matrices as dmig

ONE = ao.AntiOscillators(m0=0.02, k0=3e5, m=[0.3, 0.05, 0.2], omega=[900.0, 2500.0, 7000.0])
TWO = ao.AntiOscillators(
    m0=[[0.2, 0.01], [0.01, 0.1]],
    k0=[[3e5, -1e5], [-1e5, 2e5]],
    P=[[0.3, -0.1, 0.2], [0.1, 0.4, 0.05]],
    omega=[900.0, 2500.0, 7000.0],
    sites=("a", "b"),
)
OMEGA = np.array([10.0, 500.0, 1500.0, 3000.0, 9000.0])


def condensed(K, M, sites: int) -> np.ndarray:
    """Z(ω) of matrices by elimination of all dofs but the first `sites`."""
    found = []
    for omega in OMEGA:
        D = K - omega**2 * M
        inner = np.linalg.solve(D[sites:, sites:], D[sites:, :sites])
        found.append(D[:sites, :sites] - D[:sites, sites:] @ inner)
    return np.array(found)


@pytest.mark.parametrize("model", [ONE, TWO], ids=["one site", "two sites"])
def test_the_matrices_have_the_driving_point_of_the_model(model):
    own = model.to_matrices()
    p = len(model.sites) or 1
    Z = np.asarray(model.dynamic_stiffness(OMEGA)).reshape(-1, p, p)
    np.testing.assert_allclose(condensed(own.K, own.M, p), Z, rtol=1e-12, atol=1e-12 * abs(Z).max())
    assert own.labels.tolist() == [[k + 1, 0] for k in range(p + 3)]
    assert np.linalg.eigvalsh(own.M).min() > 0


@pytest.mark.parametrize("model", [ONE, TWO], ids=["one site", "two sites"])
@pytest.mark.parametrize(
    ("name", "tol"), [("x.mtx", 1e-12), ("x.op4", 1e-12), ("x.pch", 1e-10), ("x.dmig", 1e-10)]
)
def test_written_matrices_read_again(model, name, tol, tmp_path):
    p = len(model.sites) or 1
    dofs = ["z", "x"][:p]
    written = model.to_matrices([70, 71][:p], dofs, first=900001).save(tmp_path / name)
    assert all(path.is_file() for path in written)
    pair = read_pair(written[0], written[1] if name == "x.mtx" else written[0])
    assert abs(pair.K - pair.K.T).max() == 0
    order = np.arange(p + 3)
    if name.endswith(("pch", "dmig")):  # rows by their labels
        assert pair.labels[:p, 0].tolist() == [70, 71][:p]
        assert pair.labels[p:].tolist() == [[900001 + k, 0] for k in range(3)]
    K, M = (A.toarray()[np.ix_(order, order)] for A in (pair.K, pair.M))
    Z = np.asarray(model.dynamic_stiffness(OMEGA)).reshape(-1, p, p)
    np.testing.assert_allclose(condensed(K, M, p), Z, rtol=tol, atol=tol * abs(Z).max())
    files = (written[0], written[1]) if name == "x.mtx" else (written[0], written[0])
    rows = None if name.endswith(("pch", "dmig")) else written[-1]
    part = ao.Structure.from_files(*files, map=rows)
    again = ao.extract(part, ao.Site(node=70, dof="z"), n=3, tol=1e-14)
    if p == 1:
        assert again.k0 == pytest.approx(model.k0, rel=1e-9)
        np.testing.assert_allclose(again.omega, model.omega, rtol=1e-8)


def test_rigid_motions_that_hardly_move_the_sites_are_dofs_of_their_own():
    sliding = replace(TWO, m=None, slide=[[0.2, 0.0, 0.1], [-0.1, 0.0, 0.3]])
    own = sliding.to_matrices()
    Z = np.asarray(sliding.dynamic_stiffness(OMEGA))
    assert len(own.K) == 7
    np.testing.assert_allclose(condensed(own.K, own.M, 2), Z, rtol=1e-9, atol=1e-9 * abs(Z).max())


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"nodes": [1, 2]}, "must name the 1 site dofs"),
        ({"nodes": 0}, "nodes must be"),
        ({"dofs": "w"}, "dof must be one of"),
        ({"nodes": 5, "first": 4}, "meet the nodes of the sites"),
    ],
)
def test_numbers_that_do_not_fit(arguments, says):
    with pytest.raises(ao.InputError, match=says):
        ONE.to_matrices(**arguments)


def test_a_free_model_and_a_massless_site():
    free = ao.AntiOscillators(m0=0.0, k0=0.0, m=[2.0, 1.0], omega=[100.0, 200.0])
    own = free.to_matrices()
    np.testing.assert_allclose(
        condensed(own.K, own.M, 1).ravel(), free.dynamic_stiffness(OMEGA), rtol=1e-12
    )


@pytest.mark.parametrize(("low", "high", "off"), [(-9, 0, 6e-12), (0, 9, 6e-14)])
def test_numbers_in_sixteen_characters_keep_12_to_15_digits(rng, low, high, off):
    for value in rng.choice([-1.0, 1.0], 400) * 10 ** rng.uniform(low, high, 400):
        text = dmig._large(float(value))
        assert len(text) <= 16
        assert float(fortran(text.encode())) == pytest.approx(value, rel=off, abs=0)
