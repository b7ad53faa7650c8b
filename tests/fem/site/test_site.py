"""Sites: the functional b on and off the nodes, patches of pressure, and what cannot be struck."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.structure.structure import on_mesh
from antiosc.reduce.site import functional
from antiosc.reduce.site.sites import located_sites, warn_of_doubts
from marks import FREE_ON_PURPOSE
from parts import STEEL, box

pytestmark = FREE_ON_PURPOSE

SOLID = ao.Solid(**parts.STEEL)
PLANE = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)


def quadratic(x: np.ndarray) -> np.ndarray:
    return np.array(
        [1 + x[0] * x[1] - x[2] ** 2, 2 - x[1] ** 2 + x[0], x[0] ** 2 - 3 * x[1] * x[2]]
    )


def linear(x: np.ndarray) -> np.ndarray:
    return np.array([1 + x[0] - 2 * x[1], 0.5 - x[2] + x[1], 3 * x[0] + x[1] - x[2]])


def at(structure: ao.Structure, point, direction, **options) -> np.ndarray:
    """The load along this direction; one that leaves the material is turned into it."""
    with warnings.catch_warnings(action="ignore", category=ao.AntioscWarning):
        found = functional(structure, ao.Site(point, direction, **options))
    return np.sign(found.direction[: len(direction)] @ np.asarray(direction)) * found.b


POINTS = [
    (0.0, 0.0, 0.0), (0.2, 0.05, 0.04), (0.1, 0.025, 0.02), (0.05, 0.0, 0.013),
    (0.0731, 0.0312, 0.0207), (0.2, 0.011, 0.04), (0.1, 0.05, 0.0333),
]  # fmt: skip
PLANE_POINTS = [(0.0, 0.0), (0.1, 0.03), (0.2, 0.06), (0.0731, 0.0312), (0.025, 0.0313)]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", parts.CELLS)
def test_displacement_of_any_point_in_any_direction(cell, order):
    space = cell in ("tetrahedron", "hexahedron")
    mesh, dim = (parts.box if space else parts.plate)(cell=cell), 3 if space else 2
    structure = ao.Structure(mesh, SOLID if space else PLANE, order=order)
    field = quadratic if order == 2 else linear
    u = parts.nodal(structure, field)
    d = np.array([1.0, -2.0, 0.5])[:dim]
    for point in POINTS if space else PLANE_POINTS:
        expected = field(np.resize([*point, 0.0], 3)[:, None])[:dim, 0] @ d / np.linalg.norm(d)
        assert at(structure, point, d) @ u == pytest.approx(expected, rel=1e-12)
        assert at(structure, point, 7 * d) @ u == pytest.approx(expected, rel=1e-12)
        flat = at(structure, (*point, 0.0)[:3], (*d, 0.0)[:3])
        assert flat @ u == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_point_on_a_beam(dim, order):
    direction = (1.0, 2.0, -2.0)[:dim]
    structure = ao.Structure(
        parts.line(0.9, 3, direction),
        ao.Beam(**parts.STEEL, section=ao.Section.circle(0.02)),
        order=order,
    )
    field = quadratic if order == 2 else linear
    u = parts.nodal(structure, field)
    t = np.zeros(3)
    t[:dim] = np.asarray(direction) / np.linalg.norm(direction)
    d = np.array([0.3, -0.4, 1.2 * (dim == 3)])
    for s in (0.0, 0.3, 0.31234, 0.75, 0.9):
        expected = field((s * t)[:, None])[:, 0] @ d / np.linalg.norm(d)
        found = at(structure, (s * t)[:dim], d[:dim]) @ u
        assert found == pytest.approx(expected, rel=1e-10)


def test_a_point_outside_says_how_far_and_where_to_strike():
    structure = ao.Structure(parts.box(), SOLID)
    text = (
        r"\(0.1, 0.02, 0.05\) m is 0.01 m off the structure; "
        r"its nearest point is \(0.1, 0.02, 0.04\) m"
    )
    with pytest.raises(ao.InputError, match=text):
        at(structure, (0.1, 0.02, 0.05), (0, 0, -1))
    snapped = at(structure, (0.1, 0.02, 0.05), (0, 0, -1), snap=True)
    np.testing.assert_allclose(snapped, at(structure, (0.1, 0.02, 0.04), (0, 0, -1)), atol=1e-6)


def test_a_patch_inside_a_solid_snaps_to_its_surface():
    structure = ao.Structure(parts.box(), SOLID)
    on, inside, down = (0.1, 0.02, 0.04), (0.1, 0.02, 0.0375), (0, 0, -1)
    snapped = at(structure, inside, down, radius=1e-3, snap=True)
    np.testing.assert_allclose(snapped, at(structure, on, down, radius=1e-3), atol=1e-12)
    for z, way in ((0.04, (0, 0, -1)), (0.0, (0, 0, 1))):  # in the middle: the side struck
        middle = at(structure, (0.1, 0.02, 0.02), way, radius=1e-3, snap=0.021)
        side = at(structure, (0.1, 0.02, z), way, radius=1e-3)
        np.testing.assert_allclose(middle, side, atol=1e-12)
    for snap in (False, 2e-3):
        with pytest.raises(ao.InputError, match=r"0\.0025 m inside the part.*or snap"):
            at(structure, inside, down, radius=1e-3, snap=snap)


@pytest.mark.slow
def test_a_snap_reaches_two_hundredths_of_the_part_or_one_element():
    fine = ao.Structure(parts.box((40, 4, 4)), SOLID, order=1)  # 0.2 m long, elements of 15 mm
    coarse = ao.Structure(parts.box(), SOLID, order=1)  # elements of 60 mm
    off = (0.1, 0.02, 0.065)
    both = r"\(0.1, 0.02, 0.065\) m is 0.025 m off .* \(0.1, 0.02, 0.04\) m.*0.0168.* \(snap\)"
    with pytest.raises(ao.InputError, match=both):
        at(fine, off, (0, 0, -1), snap=True)
    with pytest.raises(ao.InputError, match=r"farther than 0\.024 m"):
        at(fine, off, (0, 0, -1), snap=0.024)
    on = at(fine, (0.1, 0.02, 0.04), (0, 0, -1))
    np.testing.assert_allclose(at(fine, off, (0, 0, -1), snap=0.026), on, atol=1e-6)
    at(coarse, off, (0, 0, -1), snap=True)
    millimetres = ao.Site((20, 40, 75), (0, 0, -1), snap=True)
    with pytest.raises(ao.InputError, match=r"87.* m off .* coordinates are in metres"):
        ao.extract(fine, {"a": ao.Site((*off[:2], 0.04), (0, 0, -1)), "b": millimetres})
    spring = ao.Bushing("a:right", "b:right", dict.fromkeys(("x", "y", "z", "rx", "ry", "rz"), 1e6))
    pair = ao.assemble({"a": coarse, "b": coarse}, [spring], at={"b": (0, 0, 1)})
    with pytest.raises(ao.InputError, match=r"\(0.1, 0.02, 0.64\) m is 0.36 m off"):
        ao.extract(pair, ao.Site((0.1, 0.02, 0.64), (0, 0, -1), snap=True, part="b"))
    with pytest.raises(ao.InputError, match="snap must be > 0"):
        ao.Site(off, (0, 0, -1), snap=-1e-3)


def test_a_patch_needs_a_surface():
    structure = ao.Structure(parts.box((4, 4, 4), (0.1, 0.1, 0.1)), SOLID)
    with pytest.raises(
        ao.InputError, match=r"lies about 0.05 m inside the part, deeper than its radius"
    ):
        functional(structure, ao.Site((0.05, 0.05, 0.05), (0, 0, -1), radius=0.01))


def test_a_radius_on_a_beam_is_refused():
    structure = ao.Structure(
        parts.line(1.0, 2), ao.Beam(**parts.STEEL, section=ao.Section.circle(0.02))
    )
    with pytest.raises(ao.InputError, match="a radius applies to solids and shells"):
        functional(structure, ao.Site((0.5, 0.0), (0, 1), radius=0.01))


def test_a_site_that_the_supports_hold():
    structure = ao.Structure(parts.box(), SOLID, [ao.Support("left", ("x", "z"))])
    with pytest.raises(
        ao.InputError, match=r"the site at \(0, 0.02, 0.01\) m is fixed by supports"
    ):
        at(structure, (0.0, 0.02, 0.01), (0, 0, -1))
    assert np.linalg.norm(at(structure, (0.0, 0.02, 0.01), (0, 1, -1))) > 0


def test_dof_and_vector_sites():
    structure = ao.Structure(parts.box(), SOLID, [ao.Support("left")])
    free = int(np.setdiff1d(np.arange(675), structure.fixed)[0])
    assert functional(structure, ao.Site(dof=free)).b[free] == 1.0
    with pytest.raises(ao.InputError, match="the site is fixed by supports"):
        functional(structure, ao.Site(dof=int(structure.fixed[0])))
    with pytest.raises(ao.InputError, match="dof must be a number from 0 to 674; got 675"):
        functional(structure, ao.Site(dof=675))
    with pytest.raises(ao.InputError, match=r"vector must have shape \(675\)"):
        functional(structure, ao.Site(vector=np.ones(3)))


# --- What is told of patches: which site of several, its numbers, and from where on ---------------


@pytest.fixture(scope="module")
def part():
    return on_mesh(ao.Structure(box((2, 1, 1), (0.2, 0.1, 0.1)), ao.Solid(**STEEL), order=1))


def told(part, count=3, **facts) -> list[str]:
    """The warnings of some sites with patches that are sound but for these facts."""
    points = np.tile([0.1, 0.05, 0.1], (count, 1))
    places = located_sites(
        part, points, np.tile([0.0, 0.0, -1.0], (count, 1)), np.full(count, 0.04)
    )
    sound = {"size": 0.01, "share": 1.0, "moving": 1.0, "local": 1e-9, "radii": 0.04}
    arrays = {name: np.full(count, value) for name, value in sound.items()}
    arrays |= {name: np.array(values) for name, values in facts.items()}
    with warnings.catch_warnings(record=True, action="always") as found:
        warn_of_doubts(part, replace(places, **arrays))
    return [str(one.message) for one in found]


@pytest.mark.slow
@pytest.mark.parametrize("cell", parts.CELLS)
def test_curved_cells(tmp_path, cell):
    """On cells of order 2 a linear field is exact at every point of the bent cube."""
    space = cell in ("tetrahedron", "hexahedron")
    path = parts.gmsh_cube(tmp_path / "cube.msh", cell, 2, bent=True)
    structure = ao.Structure(ao.read_mesh(path), SOLID if space else PLANE)
    u = parts.nodal(structure, linear)
    d = np.array([0.6, 0.0, 0.8]) if space else np.array([0.6, 0.8, 0.0])
    straight = np.random.default_rng(1).uniform(0, 1, (20, 3))
    straight[::4, 0] = 1.0  # some on a face
    straight[::5, 1] = 0.5  # some between cells
    straight[:, 2] *= space
    for point in (parts.bend if space else parts.bend_plane)(straight):
        expected = linear(point[:, None])[:, 0] @ d
        assert at(structure, point, d) @ u == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
@pytest.mark.slow
def test_a_patch_averages_with_hertz_weights(cell):
    """Exact for a translation; the centre's value for a linear field; a²/5 for x²."""
    mesh = parts.box((20, 20, 2), (0.1, 0.1, 0.02), cell)
    structure = ao.Structure(mesh, SOLID)
    p, d = np.array([0.053, 0.048, 0.02]), np.array([0.48, 0.6, -0.64])
    a = 0.02
    result = functional(structure, ao.Site(p, d, radius=a))
    ones = parts.nodal(structure, lambda x: np.outer(d, np.ones(x.shape[1])))
    assert result.b @ ones == pytest.approx(1.0, rel=1e-13)
    u = parts.nodal(structure, linear)
    assert result.b @ u == pytest.approx(linear(p[:, None])[:, 0] @ d, rel=1e-4)
    # ∫ w x² dS / ∫ w dS = a²/5 with w = √(1 − r²/a²)
    square = parts.nodal(structure, lambda x: np.outer(d, (x[0] - p[0]) ** 2))
    assert result.b @ square == pytest.approx(a**2 / 5, rel=5e-3)
    # The load lies on the face alone, not on the back nor the inside.
    below = parts.nodal(structure, lambda x: np.outer(d, x[2] < 0.0199))
    assert abs(result.b @ below) < 1e-12
    cosine = abs(d[2])
    assert result.local_compliance == pytest.approx(SOLID.half_space_compliance(cosine) / a)
    np.testing.assert_allclose(result.point, p)


def test_a_patch_on_a_plane_part_lies_on_its_edge():
    structure = ao.Structure(parts.plate((40, 8), (0.2, 0.04)), PLANE)
    a = 0.012
    result = functional(structure, ao.Site((0.103, 0.04), (0, -1), radius=a))
    down = parts.nodal(structure, lambda x: np.array([0 * x[0], -1 + 0 * x[0], 0 * x[0]]))
    assert result.b @ down == pytest.approx(1.0, rel=1e-13)
    square = parts.nodal(structure, lambda x: np.outer([0, -1, 0], (x[0] - 0.103) ** 2))
    assert result.b @ square == pytest.approx(a**2 / 4, rel=1e-2)  # along a line
    assert result.local_compliance == 0.0
