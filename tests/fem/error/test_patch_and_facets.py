"""What else than the mesh a budget must tell: the patch's radius, facets of curved surfaces."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.error import model_errors
from antiosc.fem.error.model_errors import estimator, layers, mean_gaps
from antiosc.fem.platform import compat
from parts import STEEL, box, plate
from sheets import sheet

pytestmark = pytest.mark.filterwarnings(
    "ignore:the facets at the site:antiosc.base.errors.AccuracyWarning"
)


def ring(n: int, cell: str) -> ao.Mesh:
    """A ring of n elements around a quarter turn, plane."""

    def polar(s, t):
        return (1 + s) * np.cos(np.pi / 2 * t), (1 + s) * np.sin(np.pi / 2 * t)

    return sheet((2, n), polar, cell)


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_gaps_of_a_ring(cell):
    """What a polygon of n sides lacks of an arc; at each end half a side is not known as curved."""
    n, R = 15, 2.0
    part = ao.Structure(ring(n, cell), ao.Solid(**STEEL, plane="stress", thickness=0.02), order=1)
    gap, length = mean_gaps(part.faces)
    outer = np.linalg.norm(part.faces.centres, axis=1) > 1.9
    inner = np.linalg.norm(part.faces.centres, axis=1) < 1.01
    flat = ~(outer | inner)
    cut = R**2 / 2 * (np.pi / 2 - n * np.sin(np.pi / 2 / n)) * (n - 1) / n
    assert (gap * length)[outer].sum() == pytest.approx(cut, rel=5e-3)
    assert (gap * length)[inner].sum() == pytest.approx(-cut / 4, rel=5e-3)
    assert np.abs(gap[flat]).max() < 1e-15
    _, mass = layers(part)
    assert mass == pytest.approx(STEEL["rho"] * 0.02 * 0.75 * cut / part.mass, rel=5e-3)


def test_energy_of_layers_of_equal_strain():
    part = ao.Structure(box((2, 2, 2)), ao.Solid(**STEEL), order=1)
    _, x = compat.dof_coordinates(part.form.space, part.form.components["x"])
    u = np.zeros((part.rows, 1))
    u[compat.dof_coordinates(part.form.space, part.form.components["x"])[0], 0] = x[:, 0]
    volumes = np.random.default_rng(3).uniform(-1e-6, 2e-6, len(part.faces.facets))
    E, nu = STEEL["E"], STEEL["nu"]
    C = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    error, energy = estimator(part).gram_and_layers(u, volumes)
    assert energy[0] == pytest.approx(C * volumes.sum(), rel=1e-6)
    assert error[0, 0] < 1e-9 * C


def test_second_radius_is_a_second_extraction():
    """The change of the part's compliance between two radii, from two models."""
    part = ao.Structure(box((6, 4, 2), (0.12, 0.08, 0.04)), ao.Solid(**STEEL), [ao.Support("left")])
    at = (0.08, 0.04, 0.04), (0, 0, -1)
    one = ao.extract(part, ao.Site(*at, radius=0.018), n=2, error="estimate")
    other = ao.extract(part, ao.Site(*at, radius=one.info["patch"]["radius"]), n=2)
    change = 1 / other.k0 - other.local_compliance - (1 / one.k0 - one.local_compliance)
    assert one.info["patch"]["radius"] == pytest.approx(0.018 * 2**0.5)
    assert one.info["patch"]["compliance"] == pytest.approx(change, rel=1e-6)


SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
TETRAHEDRON = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], dtype=float)
CUBE = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
#: points, facets (quadrilaterals in tensor order), number of sides, angle between the facets
SOLIDS = {
    "square": (SQUARE, [(0, 1), (1, 2), (2, 3), (3, 0)], 4, 90.0),
    "tetrahedron": (
        *(TETRAHEDRON, [(0, 1, 2), (3, 0, 1), (2, 3, 0), (1, 2, 3)]),
        *(6, np.degrees(np.arccos(1 / 3))),
    ),
    "cube": (
        *(CUBE, [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 4, 5), (2, 3, 6, 7), (0, 2, 4, 6)]),
        *(8, 90.0),
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_every_common_side_of_two_facets_has_its_angle(name):
    x, corners, count, angle = SOLIDS[name]
    found = model_errors._angles(x, np.array(corners))
    assert found == pytest.approx(np.full(count, angle))


@pytest.mark.sample
@pytest.mark.parametrize("held", [True, False])
def test_a_budget_is_told_of_the_layers_outside_of_facets(held):
    """The energies of the shapes in them, and their mass; of a rigid motion there is none."""
    supports = [ao.Support(lambda x: np.isclose(x[1], 0))] if held else []
    solid = ao.Solid(**STEEL, plane="stress", thickness=0.02)
    part = ao.Structure(ring(6, "triangle"), solid, supports, order=1)
    site = ao.Site((2 * np.sin(np.pi / 12), 2 * np.cos(np.pi / 12)), (0, -1), radius=0.4)
    model = ao.extract(part, site, n=2, error="estimate")
    volumes, mass = layers(part)
    facts = model.info["geometry"]
    assert "angles of up to 15°" in facts["note"]
    assert facts["mass"] == mass
    energies = estimator(part).gram_and_layers(model.shapes, volumes)[1]
    if not held:
        assert abs(energies[0]) > 0  # rounding
        energies[0] = 0.0
    assert facts["stiffness"] == pytest.approx(energies.tolist(), rel=1e-9)
    assert "geometry" not in ao.extract(part, site, n=2).info


def test_a_point_has_no_patch():
    part = ao.Structure(plate(), ao.Solid(**STEEL, plane="stress"), [ao.Support("left")], order=1)
    with pytest.warns(ao.AccuracyWarning, match="point"):
        model = ao.extract(part, ao.Site((0.2, 0.06), (0, -1)), n=2, error="estimate")
    assert model.info.patch is None


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_gaps_of_a_tube(cell):
    n = 15
    mesh = box((n, 1, 2), (np.pi / 2, 1.0, 1.0), cell)
    x = mesh.dolfinx.geometry.x
    angle, radius = x[:, 0].copy(), 1 + x[:, 2]
    x[:, 0], x[:, 2] = radius * np.sin(angle), radius * np.cos(angle)
    part = ao.Structure(mesh, ao.Solid(**STEEL), order=1)
    faces = part.faces
    gap, area = mean_gaps(faces)
    outer = np.linalg.norm(faces.centres[:, ::2], axis=1) > 1.9
    cut = 2 * (np.pi / 2 - n * np.sin(np.pi / 2 / n)) * (n - 1) / n
    assert (gap * area)[outer].sum() == pytest.approx(cut, rel=0.03)
    assert layers(part)[1] == pytest.approx(STEEL["rho"] * (gap @ area) / part.mass, rel=1e-9)
    assert (gap * area).sum() == pytest.approx(0.75 * cut, rel=0.05)


def test_plane_parts_have_no_half_space():
    part = ao.Structure(plate(), ao.Solid(**STEEL, plane="stress"), [ao.Support("left")])
    model = ao.extract(part, ao.Site((0.1, 0.06), (0, -1), radius=0.02), n=2, error="estimate")
    assert set(model.info["patch"]) == {"faces"}
    assert model.info["patch"]["faces"] == pytest.approx(0.025)
