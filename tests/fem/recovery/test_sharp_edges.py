"""Stresses beside sharp inner edges and rigid supports: these have no limit, others converge."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fields.margin import Zones, is_within, margin_of
from antiosc.recovery.place import Place
from antiosc.recovery.sharp_edges import _corners, interior_angle, sharp_edges
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


@pytest.mark.parametrize("kind", ["hexahedron", "tetrahedron"])
def test_a_bar_is_judged_at_half_its_thickness_from_the_clamp(kind):
    """M = F (L - x) at the first nodes beyond the distance, at most a cell farther."""
    part, hit = held(bar(kind), ao.Site((0.19, 0.01, 0.02), (0, 0, -1), radius=7.5e-3), FORCE)
    margin = ao.peak_field(part, hit, body="part", sharp_edges=False).margin()
    assert margin.away.distances == pytest.approx((0.01, 0.01))
    assert (margin.away.edges, margin.away.supports) == (False, True)
    x = margin.point[0]
    assert 0.01 < x <= 0.015 + 1e-9
    assert margin.value == pytest.approx(6 * FORCE * (0.19 - x) / 0.02**3, rel=0.03)
    assert "outside 10 mm of rigidly held faces" in margin.sentence
    everywhere = ao.peak_field(part, hit, body="part").margin()
    assert margin.sharp.value == everywhere.value > margin.value
    assert "no limit: here up to" in margin.sentence
    assert "no limit" not in everywhere.sentence


def test_the_stress_at_a_clamp_is_told_beside_a_larger_one_under_a_contact():
    """By Hertz's pressure, which is no stress of the bar."""
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    values = np.array([90e6, 50e6, 400e6])
    place = [Place(), Place(), Place()]
    contact = SimpleNamespace(
        edge_stress=200e6,
        thin_stress=0.0,
        hollow_stress=0.0,
        unresolved_depth=np.inf,
        spread_error=lambda points: np.zeros(len(points)),
    )
    zones = Zones(
        balls=np.array([[0.2, 0, 0, 0.01]]),
        contacts=[contact],
        supports=np.array([[0.0, 0, 0, 0.01]]),
    )
    of_bar = "yield", values, np.full(3, 300e6), points, np.zeros(3), place
    margin = margin_of(*of_bar, zones)
    assert (margin.value, margin.stress, margin.sharp.value) == (50e6, 200e6, 90e6)
    small = "yield", np.array([40e6, 50e6, 400e6]), *of_bar[2:]
    assert margin_of(*small, zones).sharp is None


@pytest.mark.slow
def test_a_stress_beside_a_sharp_edge_converges_with_the_mesh(tmp_path):
    site = ao.Site((0.05, 0.01, 0.005), (0, -1, 0), radius=4.5e-3)
    judged, sharp = [], []
    for size in (4e-3, 2e-3):
        part, hit = held(angle(tmp_path, size), site, FORCE)
        margin = ao.peak_field(part, hit, body="part", sharp_edges=False).margin()
        assert margin.away.edges
        judged.append((margin.stress, *margin.stresses))
        sharp.append(margin.sharp.value)
    (coarse, low, high), (fine, *ends) = judged
    assert low < fine < high
    assert np.ptp(ends) < high - low
    assert abs(fine / coarse - 1) < 0.1 < sharp[1] / sharp[0] - 1


def test_a_span_of_a_run_has_the_interval_of_its_own_stresses(tmp_path):
    """Of a second span with a tenth of the motion all stresses and errors are a tenth."""
    site = ao.Site((0.05, 0.01, 0.005), (0, -1, 0), radius=4.5e-3)
    part, hit = held(angle(tmp_path, 4e-3), site, FORCE)
    whole = hit.at(hit.time)["part"]
    names = ("q", "v", "a", "forces")
    both = {name: getattr(whole, name) for name in names}
    both = {name: np.concatenate([values, 0.1 * values]) for name, values in both.items()}
    both["time"] = np.append(whole.time, whole.time[-1] + whole.time)
    run = replace(whole, spans=np.repeat([0, 1], whole.time.size), **both)
    margin = ao.peak_field(part, run, sharp_edges=False).margin()
    assert margin.away.edges
    strong, weak = margin.spans
    assert strong.others[1] > strong.stress  # elsewhere it may be more
    assert weak.stress == pytest.approx(0.1 * strong.stress)
    assert weak.stresses == pytest.approx(0.1 * np.array(strong.stresses))
    assert margin.stresses == strong.stresses
    elsewhere = replace(margin, others=(0.0, 2 * margin.stress))  # of another span
    assert elsewhere.stresses == strong.stresses


def test_the_sharp_edge_of_an_angle_is_its_inner_one(tmp_path):
    part = angle(tmp_path, 6e-3)
    edges, supports = sharp_edges(part, np.ones((part.rows, 1)))
    assert len(supports) == 0  # of shapes that move everywhere
    np.testing.assert_allclose(edges[:, :2] - (0.02, 0.01), 0, atol=1e-9)
    assert (edges[:, 2].min(), edges[:, 2].max()) == pytest.approx((0.0, 0.01))
    assert np.diff(np.sort(edges[:, 2])).max() < edges[0, 3] / 2


def test_a_node_between_two_corners_has_the_angle_of_its_own_edge(tmp_path):
    """Not that of a sharp edge at the end of it, where it was said to lie in the corner."""
    part = angle(tmp_path, 6e-3)
    inner = np.array([0.02, 0.01])
    cells = _corners(part)
    pairs = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
    ends = cells[:, pairs].reshape(-1, 2, 3)
    at_edge = np.linalg.norm(ends[..., :2] - inner, axis=-1) < 1e-9
    for middle in ends[at_edge.all(axis=1)].mean(axis=1)[:4]:
        assert interior_angle(part, middle) == pytest.approx(270)
    from_edge = ends[at_edge.sum(axis=1) == 1].mean(axis=1)
    angles = [interior_angle(part, middle) for middle in from_edge[:40]]
    assert max(angles) < 215


def test_points_within_any_of_many_balls_are_found():
    rng = np.random.default_rng(4)
    points = rng.random((300, 3))
    balls = np.column_stack([rng.random((40, 3)), rng.choice([0.05, 0.1], 40)])
    gaps = np.linalg.norm(points[:, None] - balls[None, :, :3], axis=2)
    np.testing.assert_array_equal(is_within(points, balls), (gaps <= balls[:, 3]).any(axis=1))


def test_a_part_that_is_all_edge_is_judged_everywhere():
    """A cube between two held faces has no point farther than half its side from both."""
    part = ao.Structure(parts.box((2, 2, 2), (0.02,) * 3), STEEL, [ao.Support("left")])
    part, hit = held(part, ao.Site((0.02, 0.01, 0.01), (-1, 0, 0), radius=0.012), FORCE)
    balls = [(0.02, 0.01, 0.01, 0.0165)]
    margin = ao.peak_field(part, hit, body="part", leave_out=balls, sharp_edges=False).margin()
    assert margin.away is None
    assert margin.value == ao.peak_field(part, hit, body="part", leave_out=balls).margin().value
