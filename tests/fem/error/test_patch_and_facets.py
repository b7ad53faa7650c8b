"""Shares of the error of k0: facets under the patch, recovered stresses."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.structure.structure import on_mesh
from antiosc.reduce.error.model_errors import _angles, error_energies, strain_errors
from parts import CELLS, STEEL, box, named, plate

pytestmark = pytest.mark.filterwarnings(
    "ignore:the facets at the site:antiosc.base.errors.AccuracyWarning"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("y", "radius", "factor"), [(0.04, 0.018, 2**0.5), (0.04, 0.036, 0.5**0.5)]
)
@pytest.mark.filterwarnings("ignore:an edge cuts the patch")
def test_second_radius_is_a_second_extraction(y, radius, factor):
    """The change of the part's compliance between two radii, from two models."""
    part = ao.Structure(box((6, 4, 2), (0.12, 0.08, 0.04)), ao.Solid(**STEEL), [ao.Support("left")])
    at = (0.08, y, 0.04), (0, 0, -1)
    one = ao.extract(part, ao.Site(*at, radius=radius), n=2, error="estimate")
    assert one.info["patch"]["cut"] == 0
    other = ao.extract(part, ao.Site(*at, radius=one.info["patch"]["radius"]), n=2)
    change = 1 / other.k0 - other.local_compliance - (1 / one.k0 - one.local_compliance)
    assert one.info["patch"]["radius"] == pytest.approx(factor * radius)
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
    found = _angles(x, np.array(corners))
    assert found == pytest.approx(np.full(count, angle))


def part(cell: str, order: int, n: int = 1, size=(0.3, 0.1, 0.05)) -> ao.Structure:
    """A block, or a plate of plane stress, held at its left end."""
    held = [ao.Support("left")]
    if cell in ("triangle", "quadrilateral"):
        material = ao.Solid(**STEEL, plane="stress", thickness=0.01)
        return ao.Structure(plate((6 * n, 2 * n), size[:2], cell), material, held, order=order)
    return ao.Structure(box((4 * n, 2 * n, n), size, cell), ao.Solid(**STEEL), held, order=order)


def nodal(structure: ao.Structure, field) -> np.ndarray:
    """The nodal values (rows, 1) of a field x (n, 3) -> displacements (n, 3)."""
    return parts.nodal(structure, lambda x: field(x.T).T)[:, None]


def of_cells(structure: ao.Structure, shapes: np.ndarray) -> np.ndarray:
    """Energies of the errors in some cells after the other."""
    blocks = strain_errors(on_mesh(structure), shapes)
    return np.concatenate([np.einsum("cmk,cmk->c", errors, errors) for _, errors in blocks])


def test_strains_jump_between_materials_without_an_error():
    """A bar of two moduli under tension: constant strains on both sides."""
    mesh = named(
        plate((6, 2), (0.3, 0.1), "triangle").dolfinx,
        {"left": (2, lambda x: x[0] < 0.1501), "right": (2, lambda x: x[0] > 0.1499)},
    )
    stiff, soft = (ao.Solid(E, 0.0, 7850.0, plane="stress", thickness=0.01) for E in (2e11, 5e10))

    def field(x):
        along = np.minimum(x[:, 0], 0.15) + 4 * np.maximum(x[:, 0] - 0.15, 0)
        return np.column_stack([along, 0 * along, 0 * along])

    two = ao.Structure(mesh, {"left": stiff, "right": soft}, [ao.Support(lambda x: x[0] < 1e-9)])
    one = ao.Structure(mesh, stiff, [ao.Support(lambda x: x[0] < 1e-9)])
    smeared = error_energies(on_mesh(one), nodal(one, field))[0, 0]
    assert abs(error_energies(on_mesh(two), nodal(two, field))[0, 0]) < 1e-9 * smeared


def test_a_bar_in_closed_form():
    """Constant strains x_i + x_(i+1) of u = x²: the projection to hat functions, by hand."""
    n, length, E, area = 5, 0.3, 2e11, 0.1 * 0.01
    mesh = plate((n, 1), (length, 0.1), "quadrilateral")
    material = ao.Solid(E, 0.0, 7850.0, plane="stress", thickness=0.01)
    bar = ao.Structure(mesh, material, [ao.Support("left")], order=1)
    u = nodal(bar, lambda x: np.column_stack([x[:, 0] ** 2, 0 * x[:, 0], 0 * x[:, 0]]))
    h = length / n
    x = np.linspace(0, length, n + 1)
    strain = x[1:] + x[:-1]
    mass, load = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
    for i in range(n):
        mass[i : i + 2, i : i + 2] += h / 6 * np.array([[2, 1], [1, 2]])
        load[i : i + 2] += strain[i] * h / 2
    error = h * strain @ strain - load @ np.linalg.solve(mass, load)
    assert error_energies(on_mesh(bar), u)[0, 0] == pytest.approx(E * area * error, rel=1e-9)
    assert of_cells(bar, u).sum() == pytest.approx(E * area * error, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_k0_of_nested_meshes(cell, order):
    """k0 falls as meshes are nested; the estimate explains between half and twice of it."""
    site = ao.Site((0.25, 0.1), (0, -1), radius=0.03)
    coarse, fine = (ao.extract(part(cell, order, n), site, n=5, error="estimate") for n in (2, 4))
    finest = ao.extract(part(cell, 2, 8), site, n=5)
    assert coarse.k0 > fine.k0 > finest.k0
    for model in (coarse, fine):
        explained = (model.k0 - model.corrected().k0) / (model.k0 - finest.k0)
        assert 0.5 < explained < 2.0
        assert abs(model.corrected().k0 - finest.k0) < 0.5 * (model.k0 - finest.k0)


@pytest.mark.slow
@pytest.mark.parametrize("cell", CELLS)
def test_linear_elements_that_lock_have_no_bar(cell):
    """Of nearly incompressible solids; in plane stress, and with order 2, nothing locks."""
    plane = cell in ("triangle", "quadrilateral")
    mesh = plate((6, 2), cell=cell) if plane else box((3, 1, 1), cell=cell)
    point, direction = ((0.1, 0.06), (0, -1)) if plane else ((0.1, 0.025, 0.04), (0, 0, -1))
    site = ao.Site(point, direction, radius=0.02)

    def extracted(nu: float, order: int, kind: str | None) -> None:
        solid = ao.Solid(E=1e9, nu=nu, rho=1e3, plane=kind if plane else None)
        part = ao.Structure(mesh, solid, [ao.Support("left")], order=order)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "the facets at the site")
            ao.extract(part, site, n=2, error="estimate")

    with pytest.raises(ao.InputError, match="order 2"):
        extracted(0.499, 1, "strain")
    with pytest.raises(ao.InputError, match="order 2"):
        extracted(0.42, 1, "strain")
    extracted(0.3, 1, "strain")
    extracted(0.499, 2, "strain")
    if plane:
        extracted(0.499, 1, "stress")


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_strains_of_degree_one_have_no_error(cell, order):
    structure = part(cell, order)
    A = np.array([[1.0, 2.0, -1.0], [0.5, -1.0, 3.0], [2.0, 1.0, 1.0]])
    u = nodal(structure, lambda x: (x**order) @ A + (x[:, :1] * x[:, 1:2] if order == 2 else 0.0))
    scale = np.sum(error_energies(on_mesh(structure), nodal(structure, lambda x: np.sin(40 * x))))
    assert abs(error_energies(on_mesh(structure), u)[0, 0]) < 1e-9 * scale
    assert of_cells(structure, u).max() < 1e-12 * scale


@pytest.mark.parametrize("cell", CELLS)
def test_cells_add_up_to_the_whole(cell):
    structure = part(cell, 2)
    shapes = np.random.default_rng(1).normal(size=(structure.rows, 3))
    whole = error_energies(on_mesh(structure), shapes)
    assert np.linalg.eigvalsh(whole).min() > 0
    assert of_cells(structure, shapes).sum() == pytest.approx(np.trace(whole), rel=1e-9)
