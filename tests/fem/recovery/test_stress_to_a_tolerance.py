"""The largest stress of a blow is brought to a tolerance by smaller cells where it is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.strikes import stress

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]
STEEL = ao.Solid(210e9, 0.3, 7850.0, yield_strength=250e6)
#: A stepped bar of 20 and 10 mm with a fillet of 2 mm on the upper side.
STEPPED = """\
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 0.04, 0.02, 0.01};
Box(2) = {0.04, 0, 0, 0.05, 0.01, 0.01};
BooleanUnion{ Volume{1}; Delete; }{ Volume{2}; Delete; }
e() = Curve In BoundingBox{0.039, 0.009, -1, 0.041, 0.011, 1};
Fillet{1}{e()}{0.002}
"""
BOX = """\
SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.1, 0.02, 0.01};
Physical Volume("part") = {1}; Physical Surface("left") = {1};
"""
BLOCK = """\
SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.1, 0.02, 0.02};
"""
SITE = ao.Site((0.08, 0.01, 0.005), (0, -1, 0), radius=3e-3)
BALL = ao.RigidMass(0.05, 0.5)


@pytest.fixture(scope="module")
def stepped(tmp_path_factory):
    path = tmp_path_factory.mktemp("stepped") / "stepped.geo"
    path.write_text(STEPPED, encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_blow_ends_with_a_stress_to_a_tolerance(stepped):
    """At the fillet, where bending is largest; a mesh of half its cells is within the bar."""
    held = [ao.Support(plane=((0, 0, 0), (1, 0, 0)))]
    asked = {"tol": 0.2, "material": STEEL, "supports": held}
    hit = ao.strike(stepped, SITE, BALL, ao.Linear(1e7), 1e-3, stress_tol=0.2, **asked)
    (closed,) = hit.stresses.values()
    assert max(stress.stress_bar(closed)) <= 0.2
    assert "rounds of smaller cells" in closed.rounds
    assert max(stress.stress_bar(ao.peak_field(hit.structure, hit))) > 0.2

    point = closed.margin().point
    assert 0.036 < point[0] < 0.045
    fine = ao.read_mesh(stepped, size=8e-3, refine=[(tuple(point), 4.5e-4)])
    part = ao.Structure(fine, STEEL, held)
    again = hit.again(model=ao.extract(part, SITE, n=hit.model.n), law=hit.law)
    low, high = closed.margin().stresses
    assert low <= ao.peak_field(part, again).margin().value <= high


@pytest.mark.parametrize("cell", ["tetrahedron", "quadratic", "hexahedron"])
def test_cells_of_a_structure_are_bisected_or_stay_which_is_told(cell, tmp_path):
    """On a cantilever of cells of twice its thickness, straight or quadratic as decks have them."""
    straight = cell != "hexahedron"
    mesh = ao.box_mesh((0.1, 0.02, 0.01), 0.02)
    if cell == "quadratic":
        (tmp_path / "box.geo").write_text(BOX, encoding="ascii")
        mesh = ao.read_mesh(tmp_path / "box.geo", size=8e-3, order=2)
        assert mesh.order == 2
    if not straight:
        mesh = parts.box((10, 2, 1), (0.1, 0.02, 0.01), "hexahedron")
    held = ao.Support("-x" if cell == "tetrahedron" else "left")
    part = ao.Structure(mesh, STEEL, [held])
    site = ao.Site((0.09, 0.01, 0.01), (0, 0, -1), radius=8e-3)
    tol = {"tetrahedron": 0.2, "quadratic": 0.1, "hexahedron": 1e-3}[cell]
    hit = ao.strike(part, site, BALL, ao.Linear(1e6), 2e-3, tol=0.5, stress_tol=tol)
    (closed,) = hit.stresses.values()
    if straight:
        assert (
            max(stress.stress_bar(closed)) <= tol < max(stress.stress_bar(ao.peak_field(part, hit)))
        )
        return
    assert "cannot say above" in closed.rounds
    assert "refine divides straight triangles and tetrahedra" in closed.rounds


def test_rounds_end_before_they_cost_more_than_three_times_the_force():
    part = ao.Structure(ao.box_mesh((0.1, 0.04, 0.02), 0.02), STEEL, [ao.Support("-x")])
    model = ao.extract(part, ao.Site((0.08, 0.02, 0.02), (0, 0, -1), radius=0.02), n=3)
    hit = ao.simulate(model, BALL, ao.Linear(1e6), 1e-3)
    asked = []

    def finer(places):
        asked.append(places)
        return SimpleNamespace(dofs=90_000)

    found = stress.closed(hit, part, 1e-3, finer, None, stress.fields_by_strength)
    (field,) = found.fields.values()
    assert found.rounds == 0
    assert 1 < len(asked[0]) <= 5
    assert "cannot say above" in field.rounds
    assert "90000 dofs" in field.rounds
    assert "3 times that of 40000 dofs" in field.rounds


def test_cells_grow_around_a_place_as_asked():
    """Fewer cells are made where they grow faster, in cells that are bisected too."""
    place = (0.0, 0.0, 0.0), 5e-4
    slow, fast = (
        ao.box_mesh((0.06, 0.02, 0.01), 0.01, refine=[(*place, *growth)]) for growth in ((), (1.0,))
    )
    assert fast.n_cells < 0.9 * slow.n_cells


def test_bodies_that_do_not_touch_have_no_stress_to_refine():
    part = ao.Structure(ao.box_mesh((0.1, 0.04, 0.02), 0.02), STEEL, [ao.Support("-x")])
    model = ao.extract(part, ao.Site((0.08, 0.02, 0.02), (0, 0, -1), radius=0.02), n=3)
    hit = ao.simulate(model, BALL, ao.Linear(1e6), 1e-5, gap=1.0)
    assert hit.peak_force == 0

    found = stress.closed(hit, part, 0.2, None, None, stress.fields_by_strength)
    assert found.rounds == 0
    assert all(stress.stress_bar(field) == (0.0, 0.0) for field in found.fields.values())


def test_corners_of_quadratic_cells_do_not_count(tmp_path):
    """In the middles of edges the bars are narrower, and hold those of half the size."""
    path = tmp_path / "block.geo"
    path.write_text(BLOCK, encoding="ascii")
    site = ao.Site((0.05, 0.01, 0.02), (0, 0, -1), radius=2e-3)
    held = [ao.Support(plane=((0, 0, 0), (1, 0, 0)))]

    def bars(size):
        """(least, largest) stress [Pa] below the contact of nodes that count, and of corners."""
        mesh = ao.read_mesh(path, size=8e-3, order=2, refine=[((0.05, 0.01, 0.018), size)])
        part = ao.Structure(mesh, STEEL, held)
        hit = ao.simulate(ao.extract(part, site, n=8), BALL, ao.Linear(1e7), 3e-4)
        peak = ao.peak_field(part, hit, contacts=[])
        distance = np.linalg.norm(peak.points - site.point, axis=1)
        below = (distance > 3e-3) & (abs(peak.points[:, 0] - 0.05) < 0.02)
        low, high = peak.values - peak.mesh_error, peak.values + peak.mesh_error
        kinds = below & peak.counts, below & ~peak.counts
        return np.array([(low[kind].max(), high[kind].max()) for kind in kinds])

    coarse, (fine, _) = bars(3e-3), bars(1.5e-3)
    assert coarse[0, 0] < fine[0] < fine[1] < coarse[0, 1]
    assert np.ptp(coarse[1]) > 2 * np.ptp(coarse[0])
