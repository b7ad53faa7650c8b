"""Trusses: stiffness of bars by hand, frequencies of Nastran, decks of rods alone."""

from __future__ import annotations

from collections.abc import Iterator

import dolfinx
import numpy as np
import pytest
import scipy.linalg

import antiosc as ao
import parts
from antiosc.fem.platform import compat


def by_hand() -> tuple[np.ndarray, np.ndarray]:
    """K and M of the ten-bar truss, the four fixed dofs last."""
    K, M = np.zeros((12, 12)), np.zeros((12, 12))
    for pair, thick in zip(BARS, SECOND, strict=True):
        area = AREAS[int(thick)]
        along = np.diff(POINTS[pair], axis=0)[0]
        length = np.linalg.norm(along)
        row = np.zeros((6, 2))
        row[pair] = np.outer([-1, 1], along / length)
        K += E * area / length * np.outer(row, row)
        for node in pair:
            M[[2 * node, 2 * node + 1], [2 * node, 2 * node + 1]] += RHO * area * length / 2
    return K, M


pytestmark = pytest.mark.slow

#: The ten-bar truss: points over its bay and pairs of them.
POINTS = np.array([[2, 1], [2, 0], [1, 1], [1, 0], [0, 1], [0, 0]]) * 9.144
BARS = np.array([(4, 2), (2, 0), (5, 3), (3, 1), (2, 3), (0, 1), (4, 3), (5, 2), (2, 1), (3, 0)])
E, RHO, AREAS = 69e9, 2770.0, (1e-3, 3e-3)
SECOND = np.arange(10) >= 6  # the diagonals are thicker


@pytest.fixture(scope="module")
def truss() -> ao.Structure:
    mesh = parts.frame(POINTS, BARS, 1).dolfinx
    ends = mesh.geometry.x[compat.geometry_nodes(mesh)]
    slanted = np.all(np.ptp(ends, axis=1)[:, :2] > 1, axis=1)
    groups = {}
    for name, own in (("thin", ~slanted), ("thick", slanted)):
        cells = np.flatnonzero(own).astype(np.int32)
        groups[name] = dolfinx.mesh.meshtags(mesh, 1, cells, np.ones_like(cells)), 1
    families = {k: ao.Truss(E, 0.3, RHO, a) for k, a in zip(groups, AREAS, strict=True)}
    wall = ao.Support(lambda x: np.isclose(x[0], 0))
    return ao.Structure(ao.read_mesh(mesh, groups=groups), families, [wall])


def test_axial_forces_and_stresses(truss):
    """Of a blow, from the displacements of the ends of the bars."""
    site = ao.Site(tuple(POINTS[1]), (0, -1))
    hit = ao.simulate(ao.extract(truss, site, n=7), ao.RigidMass(5.0, 2.0), ao.Linear(1e7), 0.01)
    times = np.array([3e-3, 8e-3])
    for pair, thick in zip(BARS, SECOND, strict=True):
        area = AREAS[int(thick)]
        along = np.diff(POINTS[pair], axis=0)[0]
        length = np.linalg.norm(along)
        t = along / length
        a, b = (ao.probe(truss, hit, tuple(POINTS[n]), times=times) for n in pair)
        force = E * area / length * (b - a) @ t
        point = tuple(POINTS[pair[0]] + 0.45 * along)  # the diagonals cross at their middles
        assert np.abs(force).max() > 10
        found = ao.probe(truss, hit, point, "section_forces", times)
        np.testing.assert_allclose(found[:, 0], force, rtol=1e-9, atol=1e-9)
        stress = ao.probe(truss, hit, point, "stress", times)
        exact = (force / area)[:, None, None] * np.outer(t, t)
        np.testing.assert_allclose(stress[:, :2, :2], exact, rtol=1e-9, atol=1e-4)
        strain = ao.probe(truss, hit, point, "strain", times, axes="local")
        exact = (force / (E * area))[:, None, None] * np.diag([1, -0.3, -0.3])
        np.testing.assert_allclose(strain, exact, rtol=1e-9, atol=1e-15)
    with pytest.raises(ao.InputError, match="rotation"):
        ao.probe(truss, hit, tuple(POINTS[1]), "rotation", times)


def seventy_two_bars() -> Iterator[str]:
    """The 72-bar truss as a deck in inches: four storeys of 60 on a square of 120."""
    yield "SOL 103\nCEND\nSPC = 1\nBEGIN BULK\n"
    yield "MAT1,101,1.+7,3759398.,.33,2.59-4\nPROD,1,101,.5,999.\n"
    corners = [(0, 0), (120, 0), (120, 120), (0, 120)]
    for k in range(20):
        x, y = corners[k % 4]
        yield f"GRID,{k + 1},,{x}.,{y}.,{240 - 60 * (k // 4)}.\n"
        yield f"SPC1,1,{123456 if k >= 16 else 456},{k + 1}\n"
    pairs = []
    for top in range(0, 16, 4):
        for k in range(4):
            a, b = top + k, top + (k + 1) % 4
            pairs += [(a, a + 4), (a, b + 4), (b, a + 4), (a, b)]
        pairs += [(top, top + 2), (top + 1, top + 3)]
    for number, (a, b) in enumerate(pairs, 1):
        yield f"CROD,{number},1,{a + 1},{b + 1}\n"
    yield "ENDDATA\n"


#: rad/s: Simcenter Nastran, testing/system_verification/004_72_bar_truss of NASTRAN_CoFE (A.
#: Ricciardi), seven digits as printed.
NASTRAN = (
    *(159.9429, 159.9429, 244.6728, 430.7459, 463.1034),
    *(463.1034, 697.5760, 801.8895, 858.6545, 858.6545),
)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:of truss.bdf are not taken. the torsion of rods")
def test_seventy_two_bars_have_the_frequencies_of_nastran(tmp_path):
    path = tmp_path / "truss.bdf"
    path.write_text("".join(seventy_two_bars()))
    part = ao.read_model(path, unit="in")
    assert part.dofs == 48
    np.testing.assert_allclose(ao.natural_modes(part, 10).omega, NASTRAN, rtol=3e-7)


def test_stiffness_masses_and_frequencies_are_those_by_hand(truss):
    K, M = (matrix[:8, :8] for matrix in by_hand())
    assert truss.dofs == 8
    assert truss.mass == pytest.approx(np.trace(by_hand()[1]) / 2, rel=1e-12)
    exact = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True))
    np.testing.assert_allclose(ao.natural_modes(truss, 8).omega, exact, rtol=1e-10)
    model = ao.extract(truss, ao.Site(tuple(POINTS[1]), (0.6, -0.8)), n=3)
    b = np.zeros(8)
    b[2:4] = 0.6, -0.8
    assert model.k0 == pytest.approx(1 / (b @ np.linalg.solve(K, b)), rel=1e-10)
