"""Stresses beside sharp inner edges and rigid supports: these have no limit, others converge."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.mesh.finer import longest_cell
from antiosc.fem.mesh.surface import volume_and_surface
from antiosc.fem.platform import compat
from antiosc.recovery import source
from antiosc.reduce.site.surface import inner_points
from static_loads import held

pytestmark = pytest.mark.fem
STEEL = ao.Solid(210e9, 0.3, 7850.0, yield_strength=250e6)
FORCE = 100.0
#: Legs of 60 × 20 mm and 60 × 10 mm, 10 mm thick; the inner edge is at x = 20 mm, y = 10 mm.
ANGLE = """\
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 0.06, 0.01, 0.01};
Box(2) = {0, 0, 0, 0.02, 0.06, 0.01};
BooleanUnion{ Volume{1}; Delete; }{ Volume{2}; Delete; }
"""


def bar(kind: str = "hexahedron") -> ao.Structure:
    """A bar of 200 × 20 × 20 mm, held at its left end."""
    mesh = parts.box((40, 4, 4), (0.2, 0.02, 0.02), kind)
    return ao.Structure(mesh, STEEL, [ao.Support("left")])


def angle(tmp_path, size: float) -> ao.Structure:
    """The angle, held at the end of the thick leg."""
    path = tmp_path / "angle.geo"
    path.write_text(ANGLE, encoding="utf-8")
    mesh = ao.read_mesh(path, size=size, refine=[[[0.02, 0.01, 0.005], size / 2]])
    return ao.Structure(mesh, STEEL, [ao.Support(plane=((0, 0.06, 0), (0, 1, 0)))])


def test_a_bar_is_judged_at_half_its_mean_thickness_from_the_clamp():
    """M = F (L - x) at the first nodes beyond the distance, at most a cell farther."""
    part, hit = held(
        bar("hexahedron"), ao.Site((0.19, 0.01, 0.02), (0, 0, -1), radius=7.5e-3), FORCE
    )
    margin = ao.peak_field(part, hit, body="part").margin()
    away = edges_of(part)[1]
    assert away == pytest.approx(0.2 * 0.02**2 / (4 * 0.2 * 0.02 + 2 * 0.02**2))
    x = margin.point[0]
    assert away < x <= away + 0.0055
    assert margin.value == pytest.approx(6 * FORCE * (0.19 - x) / 0.02**3, rel=0.08)
    assert "outside 4.8 mm of rigidly held faces" in margin.sentence
    everywhere = ao.peak_field(part, hit, body="part", r0=0.0).margin()
    assert everywhere.value > margin.value
    assert "no limit: here up to" in margin.sentence
    assert "no limit" not in everywhere.sentence


@pytest.mark.slow
def test_a_stress_beside_a_sharp_edge_converges_with_the_mesh(tmp_path):
    site = ao.Site((0.05, 0.01, 0.005), (0, -1, 0), radius=4.5e-3)
    judged, sharp = [], []
    for size in (4.5e-3, 3e-3):
        part, hit = held(angle(tmp_path, size), site, FORCE)
        peak = ao.peak_field(part, hit, body="part")
        margin = peak.margin()
        assert "sharp inner edges" in margin.scope
        judged.append((margin.value, *margin.stresses))
        sharp.append(peak.values.max())
    (coarse, low, high), (fine, *ends) = judged
    assert low < fine < high
    assert np.ptp(ends) < high - low
    assert abs(fine / coarse - 1) < 0.1 < sharp[1] / sharp[0] - 1


@pytest.mark.parametrize("rounded", [False, True])
def test_the_sharp_edge_of_an_angle_is_its_inner_one_and_a_fillet_is_none(tmp_path, rounded):
    """A fillet of one quadratic cell too: its faces are tangent to those beside it."""
    path = tmp_path / "angle.geo"
    around = "{0.019, 0.009, -1, 0.021, 0.011, 1}"
    fillet = f"e() = Curve In BoundingBox{around}; Fillet{{1}}{{e()}}{{0.003}}\n"
    path.write_text(ANGLE + rounded * fillet, encoding="utf-8")
    part = ao.Structure(ao.read_mesh(path, size=0.012), STEEL)
    edges, length = edges_of(part)
    surface = 2 * (0.06 * 0.01 + 0.02 * 0.05) + (0.06 + 0.06) * 2 * 0.01
    assert length == pytest.approx((0.06 * 0.01 + 0.02 * 0.05) * 0.01 / surface, rel=0.02)
    if rounded:
        assert len(edges) == 0
        return
    np.testing.assert_allclose(edges[:, :2] - (0.02, 0.01), 0, atol=1e-9)
    assert (edges[:, 2].min(), edges[:, 2].max()) == pytest.approx((0.0, 0.01))
    assert np.diff(np.sort(edges[:, 2])).max() < length / 2


def edges_of(part):
    """(points of sharp edges, volume over surface) of a part."""
    length = source(part).half_thickness(part)
    return inner_points(part.matrices, None, length / 4), length


@pytest.mark.parametrize("kind", ["tetrahedron", "hexahedron"])
def test_volume_and_surface_of_a_box(kind):
    assert volume_and_surface(parts.box((4, 2, 3), (0.2, 0.02, 0.03), kind)) == pytest.approx(
        (0.2 * 0.02 * 0.03, 2 * (0.2 * 0.02 + 0.2 * 0.03 + 0.02 * 0.03))
    )


def test_cells_of_thin_walls_are_no_longer_than_twice_their_thickness(tmp_path):
    """A plate of 60 × 30 × 1 mm: 3 mm along its side, 2 mm by its wall."""
    path = tmp_path / "plate.brep"
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    gmsh.model.occ.addBox(0, 0, 0, 0.06, 0.03, 1e-3)
    gmsh.model.occ.synchronize()
    gmsh.write(str(path))
    gmsh.finalize()
    with pytest.warns(ao.AntioscWarning, match="2.00 mm long"):
        mesh = ao.read_mesh(path)
    assert longest_cell(mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)[:, :4]]) < 4e-3
