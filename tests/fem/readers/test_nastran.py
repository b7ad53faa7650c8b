"""Decks of Nastran and Abaqus as meshes and as structures: small decks, one for each feature."""

from __future__ import annotations

import math

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.platform import compat
from antiosc_decks import nastran_mesh as nastran
from antiosc_decks.nastran_mesh import CoordinateSystem
from antiosc_decks.sources import Sources
from paths import DECKS
from refusals import refused


def volume(mesh: ao.Mesh) -> float:
    return compat.integrate(compat.constant(mesh.dolfinx, 1.0) * measure(mesh, 7), mesh.dolfinx)


@pytest.mark.slow
def test_a_curved_solid_in_a_cylindrical_system_is_that_of_abaqus():
    ours, other = ao.read_mesh(DECKS / "tube.bdf"), ao.read_mesh(DECKS / "tube.inp")
    assert (ours.cell, ours.order, ours.n_cells) == ("hexahedron", 2, 3)
    assert volume(ours) == pytest.approx(volume(other), rel=1e-6)
    # the axis is x: a point (r, θ, z) lies at (z, r cos θ, r sin θ)
    x, y = ours.dolfinx.geometry.x, other.dolfinx.geometry.x[:, [2, 0, 1]]
    distance = np.linalg.norm(x[:, None] - y[None], axis=2)
    assert distance.min(axis=0).max() < 1e-6
    assert len(ours.group("4")[3]) == 3
    assert set(ours.group("SPC 1")) == {2}


@pytest.mark.parametrize("kind", "RCS")
def test_systems_agree_with_their_derivatives(kind):
    rng = np.random.default_rng(3)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    system = CoordinateSystem(rng.normal(size=3), axes, kind)
    c = np.array([1.3, 40.0, 25.0])
    x, step = system.point(c), 1e-6
    for k, row in enumerate(system.frame(x)):
        moved = c.copy()
        moved[k] += step
        along = system.point(moved) - x
        np.testing.assert_allclose(along / np.linalg.norm(along), row, atol=1e-6)


def test_systems_by_grids_and_within_each_other(tmp_path):
    """CORD1R, C and S by three grids, two in one card; CORD2 in another system."""
    text = "GRID,1,,1.,2.,3.\nGRID,2,,1.,3.,3.\nGRID,3,,1.,2.,5.\n"
    text += "CORD1R,11,1,2,3\nCORD1C,12,1,2,3,13,1,3,2\nCORD1S,14,1,2,3\n"
    text += "CORD2R,15,11,1.,2.,3.,1.,2.,5.,\n,4.,2.,3.\n"
    text += "GRID,21,11,1.,2.,3.\nGRID,22,12,2.,90.,3.\nGRID,23,13,2.,0.,1.\n"
    text += "GRID,24,14,2.,90.,90.\nGRID,25,14,2.,30.,0.\nGRID,26,15,1.,2.,3.\n"
    path = tmp_path / "part.bdf"
    path.write_text(text)
    found = nastran.read_deck(Sources(path, path.name))
    # system 11: z is y of the deck, x is z, y is x; system 13: z is z, x is y, y is -x
    expected = [(3, 5, 4), (3, 5, 3), (1, 4, 4), (3, 2, 3), (1, 2 + math.sqrt(3), 4), (5, 8, 5)]
    np.testing.assert_allclose(found.deck.points[3:], expected, atol=1e-12)
    for wrong, at, word in (
        ("CORD1R,16,1,2,9\nGRID,27,16\n", 15, "GRID 9"),
        ("CORD1R,16,1,2,27\nGRID,27,16\n", 16, "itself"),
        ("GRID,27,19\n", 15, "no coordinate system"),
        ("CORD2R,16,,0.,0.,0.,1.,0.,0.,\n,2.,0.,0.\nGRID,27,16\n", 15, "on one line"),
    ):
        path.write_text(text + wrong)
        with refused(at, word, ao.MeshError):
            nastran.read_deck(Sources(path, path.name))


@pytest.mark.slow
def test_a_bar_in_a_turned_system_bends_in_its_planes():
    beam = ao.read_model(DECKS / "bar.bdf")
    E, G, L, b, h = 2.1e11, 2.1e11 / 2.6, 2.0, 0.1, 0.2
    assert beam.mass == pytest.approx(7850 * L * b * h, rel=1e-12)
    for direction, width, height in (((0, 0, 1), b, h), ((1, 0, 0), h, b)):
        exact = L**3 / (3 * E * width * height**3 / 12) + L / (5 / 6 * G * b * h)
        model = ao.extract(beam, ao.Site((0, L, 0), direction), n=6)
        assert model.k0 == pytest.approx(1 / exact, rel=1e-8)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:not used of plate.bdf")
def test_a_plate_of_quadrilaterals_and_triangles():
    with pytest.warns(ao.AntioscWarning, match="5 elements; 3 of them .* 1 CELAS2, 1 CONM2"):
        mesh = ao.read_mesh(DECKS / "plate.bdf", unit="mm")
    assert (mesh.cell, mesh.n_cells) == ("triangle", 5)
    assert volume(mesh) == pytest.approx(0.025, rel=1e-12)
    assert len(mesh.group("skin")[2]) == len(mesh.group("2")[2]) == 5
    with pytest.warns(ao.AntioscWarning, match="not taken: 1 FORCE.*, the place of the nonstr"):
        plate = ao.read_model(DECKS / "plate.bdf", unit="mm")
    # kg in the deck: 7.85e-6 kg/mm³ × 2 mm + 1.57e-6 kg/mm² over 25000 mm², and 0.5 kg
    assert plate.mass == pytest.approx(25000 * (7.85e-6 * 2 + 1.57e-6) + 0.5, rel=1e-12)
    shells = [part.part.parts[0][0] for part in plate.matrices.members()]
    assert {(shell.E, shell.nu, shell.thickness) for shell in shells} == {(2.1e11, 0.3, 2e-3)}
    supports = [
        ao.Support(lambda x: x[0] < 1e-9),
        # 1 to 4 are held, which are two sides; z of 5 and 6, and so that of both quadrilaterals
        ao.Support(lambda x: (x[1] < 1e-9) & (x[0] < 0.2 + 1e-9)),
        ao.Support(lambda x: x[0] < 0.2 + 1e-9, "z"),
    ]
    by_hand = ao.Structure(
        mesh,
        ao.Shell(2.1e11, 0.3, shells[0].rho, 2e-3),
        supports,
        attached=[ao.PointMass((0.3, 0.05, 0), 0.5), ao.Spring((0.3, 0.05, 0), {"z": 25e3})],
    )
    # three cells are coarse: quadrilaterals beside a triangle are 2 % stiffer than five triangles
    corner = ao.Site((0.3, 0.05, 0), (0, 0, 1))
    with pytest.warns(ao.AccuracyWarning, match="edge"):
        k0 = [ao.extract(part, corner, n=4).k0 for part in (plate, by_hand)]
    assert k0[0] == pytest.approx(k0[1], rel=0.03)


@pytest.mark.slow
def test_curved_cells_keep_their_sides_when_they_are_cut():
    whole, mixed = (ao.read_mesh(DECKS / name) for name in ("tube.inp", "tube_mixed.inp"))
    assert (whole.cell, mixed.cell) == ("hexahedron", "tetrahedron")
    assert whole.order == mixed.order == 2
    exact = np.pi / 8 * (2**2 - 1)
    assert volume(whole) == pytest.approx(exact, rel=2e-5)
    assert volume(mixed) == pytest.approx(exact, rel=2e-4)
    x = mixed.dolfinx.geometry.x
    radius = np.hypot(x[:, 0], x[:, 1])
    outer = np.isclose(radius, 2, atol=5e-3)
    assert outer.sum() > 20
    np.testing.assert_allclose(radius[outer], 2, atol=1e-4)
