"""A point on a solid has no compliance; a patch has one, and its own half-space part comes off.

A steel block 40 × 40 × 20 mm, clamped at its underside and struck on its top, on meshes graded
toward the site.
"""

from __future__ import annotations

import warnings
from collections import Counter
from functools import cache
from math import factorial

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.mesh.surface import Faces
from antiosc.reduce.site import functional, sites
from antiosc.reduce.site.map_sites import surface_sample

SIZE = np.array([0.04, 0.04, 0.02])
TOP = (0.02, 0.02, 0.02)
STEEL = ao.Solid(**parts.STEEL)
RADII = (0.002, 0.004)


def graded(n: int, cell: str = "hexahedron") -> ao.Structure:
    """n × n × n/2 elements, at the site some 14 times smaller than far away."""
    mesh = parts.box(
        (n, n, n // 2 + 1), SIZE, cell, groups={"bottom": (2, lambda x: np.isclose(x[2], 0))}
    )
    x = mesh.dolfinx.geometry.x
    for axis in (0, 1):
        s = 2 * x[:, axis] / SIZE[axis] - 1
        x[:, axis] = SIZE[axis] / 2 * (1 + np.sign(s) * (0.15 * abs(s) + 0.85 * abs(s) ** 2.5))
    s = 1 - x[:, 2] / SIZE[2]
    x[:, 2] = SIZE[2] * (1 - (0.15 * s + 0.85 * s**2.5))
    return ao.Structure(mesh, STEEL, [ao.Support("bottom")])


def smallest(structure: ao.Structure) -> float:
    """Size of the elements at the site."""
    return float(np.diff(np.unique(structure.mesh.dolfinx.geometry.x[:, 0].round(9))).min())


def compliance(structure: ao.Structure, direction, radius=None) -> tuple[float, float]:
    """(1/k0, the part of it that is the patch's own)."""
    with warnings.catch_warnings():
        # a point has no limit, and the coarsest meshes do not resolve the patch: that is known here
        warnings.simplefilter("ignore", ao.AntioscWarning)
        site = ao.Site(TOP, direction, radius=radius)
        model = ao.extract(structure, site, n=0, method="modes")
    return 1 / model.k0, model.local_compliance


@pytest.fixture(scope="module")
def block():
    return cache(lambda cell: graded(12, cell))


@pytest.mark.slow
def test_point_and_patches_over_three_meshes(block):
    normal = (0, 0, -1)
    structures = [graded(6), graded(8), block("hexahedron")]
    sizes = np.array([smallest(s) for s in structures])
    point = np.array([compliance(s, normal)[0] for s in structures])
    # The point's compliance grows as 1/h: it knows no limit.
    np.testing.assert_allclose(point * sizes, point[-1] * sizes[-1], rtol=0.03)
    assert point[-1] > 2.9 * point[0]
    rest = []
    for radius in RADII:
        found = np.array([compliance(s, normal, radius) for s in structures])
        whole, local = found[:, 0], found[0, 1]
        assert local == pytest.approx(0.6 * (1 - 0.3**2) / 210e9 / radius)
        # The patch's converges, from below as all displacement methods do.
        first, second = np.diff(whole)
        assert first > second > 0
        assert whole[-1] / whole[-2] - 1 < 0.013
        rest.append(whole[-1] - local)
    # What the half-space takes off leaves the block's own share: no radius in it.
    rest = np.array(rest)
    np.testing.assert_allclose(
        rest, -9.0e-11, rtol=0.08
    )  # clamped, it is stiffer than a half-space
    assert abs(np.diff(rest)[0]) < 0.01 * 0.6 * (1 - 0.3**2) / 210e9 / RADII[0]


@pytest.mark.slow
def test_an_oblique_patch_is_the_sum_of_its_components():
    """In the middle of the square the block couples no direction with another."""
    directions = (0, 0, 1), (1, 0, 0), (3, 0, 4)
    block = graded(6)
    found = [compliance(block, d, 0.004) for d in directions]
    (n, t, oblique), local = zip(*found, strict=True)
    assert oblique == pytest.approx(0.64 * n + 0.36 * t, rel=1e-6)
    assert local[2] == pytest.approx(0.64 * local[0] + 0.36 * local[1])
    assert local[1] / local[0] == pytest.approx((2 - 0.3) / 2 / (1 - 0.3), rel=1e-12)


@pytest.mark.slow
def test_supports_under_a_patch_are_told():
    groups = {"held": (2, lambda x: np.isclose(x[2], 0.03) & (x[0] < 0.03 + 1e-9))}
    mesh = parts.box((12, 8, 2), (0.12, 0.08, 0.03), groups=groups)
    part = ao.Structure(mesh, ao.Solid(**parts.STEEL), [ao.Support("held")])
    site = ao.Site((0.032, 0.04, 0.03), (0, 0, -1), radius=0.01)
    with pytest.warns(ao.AccuracyWarning, match=r"only 50 % of its load area"):
        ao.extract(part, site, n=10)
    with warnings.catch_warnings(record=True, action="always") as said:
        ao.impact_map(part, radius=0.01, modes=30)
    assert any("a support is within two radii" in str(one.message) for one in said)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_moments_of_hertzs_pressure(cell):
    """Of a unit force p = (3/2πa²)√(1 - r²/a²): force 1, no moment, ∫p x² = a²/5, ∫p xy = 0.

    Quadratic elements carry these fields exactly, so bᵀu is what the load does on them.
    """
    part = ao.Structure(parts.box((5, 5, 2), SIZE, cell), STEEL)
    radius, x0, y0 = 0.01, 0.017, 0.022
    b = functional(part, ao.Site((x0, y0, SIZE[2]), (0, 0, -1), radius=radius)).b
    space = part.form.space
    x = space.tabulate_dof_coordinates()
    load = b.reshape(-1, 3)[:, 2]
    np.testing.assert_allclose(b.reshape(-1, 3)[:, :2], 0.0, atol=1e-12)
    u, v = x[:, 0] - x0, x[:, 1] - y0
    assert -load.sum() == pytest.approx(1.0, rel=1e-9)
    assert load @ u == pytest.approx(0.0, abs=1e-9 * radius)
    assert load @ v == pytest.approx(0.0, abs=1e-9 * radius)
    assert load @ (u * v) == pytest.approx(0.0, abs=1e-3 * radius**2)
    for square in (u * u, v * v):
        assert -load @ square == pytest.approx(radius**2 / 5, rel=1e-3)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_derivatives_of_a_face_are_those_of_its_points(cell):
    """Central differences of the positions, exact for faces of second order."""
    mesh = parts.box((2, 2, 2), (1.0, 1.0, 1.0), cell)
    mesh.dolfinx.geometry.x[:] = parts.bend(mesh.dolfinx.geometry.x)
    faces = Faces(mesh, False)
    every = np.arange(len(faces.facets))
    xi, step = np.tile([0.3, 0.2], (len(every), 1)), 1e-4
    _, derivatives = faces.at(every, xi)
    for axis in (0, 1):
        move = step * np.eye(2)[axis]
        ahead, back = faces.at(every, xi + move)[0], faces.at(every, xi - move)[0]
        np.testing.assert_allclose(derivatives[:, :, axis], (ahead - back) / (2 * step), atol=1e-8)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_the_triangles_of_a_body_cover_its_surface_once(cell):
    """Every edge lies in two of them, and their areas add up to that of the box."""
    sides = (0.12, 0.05, 0.04)
    part = ao.Structure(parts.box((3, 2, 2), sides, cell), ao.Solid(**parts.STEEL), order=1)
    found = surface_sample(part.matrices, None)
    triangles = found.elements.tolist()
    edges = Counter(frozenset(pair) for a, b, c in triangles for pair in ((a, b), (b, c), (c, a)))
    assert set(edges.values()) == {2}
    x = found.points[found.elements]
    areas = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
    a, b, c = sides
    assert areas.sum() == pytest.approx(2 * (a * b + b * c + c * a), rel=1e-12)


@pytest.mark.parametrize(
    ("cell", "direction"),
    [("hexahedron", (0, 0, -1)), ("hexahedron", (0.6, 0.8, 0)), ("tetrahedron", (2, 1, -2))],
)
@pytest.mark.slow
def test_own_compliance_of_a_patch_in_any_direction(block, cell, direction):
    """C(a) − C_half-space(a, direction) does not depend on the radius, normal to oblique."""
    whole, local = np.array([compliance(block(cell), direction, r) for r in RADII]).T
    rest = whole - local
    assert abs(rest[1] - rest[0]) < 0.03 * (local[0] - local[1])
    # and most of it is gone: without taking it off the two differ by the half-space's part
    assert whole[0] - whole[1] == pytest.approx(local[0] - local[1], rel=0.03)
    assert abs(rest).max() < 0.2 * local.min()


@pytest.mark.slow
def test_the_impact_does_not_depend_on_the_patch(block):
    """A steel ball at 1 m/s: the indentation of the patch is counted once, whatever its radius."""
    ball = ao.Sphere(radius=0.01, E=210e9, nu=0.3, rho=7850.0, velocity=1.0)
    law = ball.hertz(210e9, 0.3)
    peaks, bare = [], []
    for radius in RADII:
        site = ao.Site(TOP, (0, 0, -1), radius=radius)
        model = ao.extract(block("hexahedron"), site, n=12)
        hit = ao.simulate(model, ball, law, duration=2e-4)
        assert "was subtracted from Hertz's law" in " ".join(hit.details)
        peaks.append(hit.peak_force)
        twice = ao.AntiOscillators(m0=model.m0, k0=model.k0, m=model.m, omega=model.omega)
        bare.append(ao.simulate(twice, ball, law, duration=2e-4).peak_force)
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-3)
    # counted twice, the radius matters
    assert bare[1] / bare[0] > 1.02
    assert max(bare) < min(peaks)


@pytest.mark.parametrize("count", [1, 2, 5, 12])
def test_rules_of_patches_are_exact(count):
    """Moments of Hertz's pressure on a disc, and on a segment (Catalan numbers)."""
    x, w = sites.segment_rule(count)
    assert (x.shape, w.sum()) == ((count, 1), pytest.approx(1))
    for k in range(count):
        exact = factorial(2 * k) / factorial(k) / factorial(k + 1) / 4**k
        assert w @ x[:, 0] ** (2 * k) == pytest.approx(exact)
        assert w @ x[:, 0] ** (2 * k + 1) == pytest.approx(0, abs=1e-14)
    x, w = sites.disc_rule(count)
    assert (x.shape, w.sum()) == ((2 * count**2, 2), pytest.approx(1))
    radial = 1.0  # 3 ∫ (1 - s²)^k s² ds
    for k in range(max(1, count - 1)):
        r = np.linalg.norm(x, axis=1)
        assert w @ r ** (2 * k) == pytest.approx(radial)
        for a in range(k + 1):
            b = k - a
            angular = factorial(2 * a) * factorial(2 * b) / (4**k * factorial(a) * factorial(b))
            angular /= factorial(k)
            assert w @ (x[:, 0] ** (2 * a) * x[:, 1] ** (2 * b)) == pytest.approx(radial * angular)
        assert w @ (x[:, 0] ** (2 * k) * x[:, 1]) == pytest.approx(0, abs=1e-14)
        radial *= (2 * k + 2) / (2 * k + 5)
