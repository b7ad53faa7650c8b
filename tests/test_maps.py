"""Impact maps against direct extraction at the same sites, single impacts, and bad input."""

from __future__ import annotations

import dataclasses
import functools
import re
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from paths import MESHES

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import meshio
from scipy.spatial import cKDTree

import antiosc as ao
import parts
from antiosc.base.stresses import DEVIATOR, equivalent
from antiosc.base.texts import engineering, percent
from antiosc.fem.assembly import with_parts
from antiosc.impact.histories.bars import ErrorBar, ErrorBudget
from antiosc.models.doubts import EDGE, NEAR, NO_RESULT
from antiosc.models.driving_point import stiffness_error
from antiosc.reduce.site import functional
from antiosc.reduce.site.map_sites import sites_of, surface, thinned
from antiosc.reduce.site.sites import located
from antiosc.strikes import impact_map as maps, map_results, map_stresses
from antiosc.strikes.map_results import hardest, low_band
from antiosc_app import headline, live_meshes as sites
from antiosc_app.headline import caution_of_map, sentences_of_map
from antiosc_app.results import presentations
from antiosc_app.scene_file.run import SceneResults

pytestmark = pytest.mark.fem

SIZE = (0.12, 0.08, 0.03)


def top(x: np.ndarray) -> np.ndarray:
    return np.isclose(x[2], SIZE[2])


def block(n=(6, 4, 2), *, supported=True, cell="hexahedron", **options) -> ao.Structure:
    groups = {
        "left": (2, lambda x: np.isclose(x[0], 0)),
        "top": (2, top),
        "end": (2, lambda x: np.isclose(x[0], SIZE[0])),
    }
    mesh = parts.box(n, SIZE, cell, groups=groups)
    supports = [ao.Support("left")] if supported else []
    return ao.Structure(mesh, ao.Solid(**parts.STEEL), supports=supports, **options)


@pytest.fixture(scope="module")
def steel() -> ao.Structure:
    return block()


@pytest.fixture(scope="module")
def mapped(steel) -> ao.ImpactMap:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return ao.impact_map(steel, "top", n=16, modes=40)


def at(structure: ao.Structure, where: str, i: int, **options) -> ao.Site:
    """The i-th site of a map, as the vector that the map used."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        sites = sites_of(structure, where, None, options.get("radius")).sites
    return ao.Site(vector=sites.loads[:, i].toarray()[:, 0])


@pytest.mark.slow
def test_bound_against_direct_extraction(steel, mapped):
    sites = range(0, len(mapped), 5)
    direct = ao.extract(steel, [at(steel, "top", i) for i in sites], n=60)
    for i, reference in zip(sites, direct, strict=True):
        model = mapped.model(i)
        error = stiffness_error(
            model.dynamic_stiffness,
            reference.dynamic_stiffness,
            2 * np.pi * mapped.band,
            reference.omega[0],
        )
        assert error <= 1.02 * mapped.error[i] + 1e-9
        assert model.k0 == pytest.approx(reference.k0, rel=1e-9)
        assert model.m_st == pytest.approx(reference.m_st, rel=1e-5)
    assert np.median(mapped.error) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_loads_of_a_surface_are_those_of_single_sites(cell):
    structure = block(cell=cell)
    ground = surface(structure, "top")
    np.testing.assert_allclose(ground.normals[:, 2].max(), 1.0)
    push = np.tile([0.6, 0.0, -0.8], (len(ground.points), 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for radius in (None, 0.02):
            radii = np.full(len(push), np.nan if radius is None else radius)
            found = located(structure, ground.points, push, radii)
            inner = np.flatnonzero((found.share > 0.99) & (found.moving > 0.1))
            assert len(inner) > 3
            for i in inner[::4]:
                one = functional(structure, ao.Site(ground.points[i], push[i], radius=radius))
                np.testing.assert_allclose(found.loads[:, i].toarray()[:, 0], one.b, atol=1e-12)


def sheet(cell="quadrilateral") -> ao.Structure:
    """A sheet of two thicknesses."""
    groups = {
        "left": (1, lambda x: np.isclose(x[0], 0)),
        "thin": (2, lambda x: x[0] < 0.1 + 1e-9),
        "thick": (2, lambda x: x[0] > 0.1 - 1e-9),
    }
    return ao.Structure(
        parts.plate((6, 4), cell=cell, groups=groups),
        {
            "thin": ao.Shell(**parts.STEEL, thickness=4e-3),
            "thick": ao.Shell(**parts.STEEL, thickness=8e-3),
        },
        [ao.Support("left")],
    )


@pytest.mark.slow
def test_impacts_are_single_impacts(steel):
    ball, law = ao.RigidMass(mass=0.05, velocity=1.0), ao.Hertz(1e10)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        result = ao.impact_map(steel, "end", ball, law, 4e-4)
    for i in (0, 5):
        hit = ao.simulate(result.model(i), ball, law, 4e-4)
        assert result.peak_force[i] == pytest.approx(hit.peak_force, rel=1e-3)
        assert result.contact_time[i] == pytest.approx(hit.contact_time, rel=1e-3)
        assert result.peak_deflection[i] == pytest.approx(hit.displacement.max(), rel=1e-3)


STEEL_BALL = ao.Sphere(0.01, material="bearing steel 100Cr6", velocity=1.0)
RUBBER_BALL = ao.Sphere(0.02, material="rubber NR 50", velocity=0.1)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")  # a coarse mesh
@pytest.mark.parametrize(
    ("name", "ball"),
    [
        ("aluminium 6061-T6", STEEL_BALL),
        ("titanium grade 2", STEEL_BALL),
        ("aluminium 6061-T6", RUBBER_BALL),
    ],
)
def test_the_error_by_the_law_is_that_of_the_hardest_blow_by_itself(name, ball):
    """Without a run for each cause, against the row "law" of a single impact."""
    part = ao.Structure(parts.box((6, 4, 2), SIZE), ao.material(name), [ao.Support("-x")])
    points = [(0.08, 0.04, 0.03), (0.06, 0.04, 0.03)]
    duration = 0.05 if ball is RUBBER_BALL else 1e-3
    given = {"duration": duration, "direction": (0, 0, -1), "radius": 2e-3}
    found = ao.impact_map(part, points, ball, **given)
    site = ao.Site(points[hardest(found)], (0, 0, -1), radius=2e-3)
    model = ao.extract(part, site, n=20, error="estimate")
    row = ao.simulate(model, ball, duration=duration).error_budget["peak_force"].law
    assert 0.98 * row < found.law_error < 1.5 * row
    assert f"off by {percent(found.law_error)}" in found.summary()
    slow = ao.impact_map(part, points, dataclasses.replace(STEEL_BALL, velocity=1e-3), **given)
    assert slow.law_error == 0
    assert "off by" not in slow.summary()
    assert ao.impact_map(part, points, ball, ao.Hertz(7e9), **given).law_error is None


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")
def test_the_blow_says_how_many_modes_and_anti_oscillators_a_sheet_needs():
    groups = {"left": (1, lambda x: np.isclose(x[0], 0))}
    sheet = ao.Structure(
        parts.plate((10, 6), groups=groups),
        ao.Shell(**parts.STEEL, thickness=2e-3),
        [ao.Support("left")],
    )
    ball, law = ao.RigidMass(mass=0.01, velocity=1.0), ao.Hertz(1e9)
    point = (0.11, 0.031)
    blow = ([point], ball, law, 4e-4)
    found = ao.impact_map(sheet, *blow, direction=(0, 0, -1))
    alone = ao.extract(sheet, ao.Site((*point, 0), (0, 0, -1)), n=120)
    force = ao.simulate(alone, ball, law, 4e-4).peak_force
    few = ao.impact_map(sheet, *blow, direction=(0, 0, -1), n=12, modes=20).peak_force[0]
    assert found.band == pytest.approx(ao.impact_band(ball, law))
    assert found.error.max() < 0.05
    assert abs(found.peak_force[0] / force - 1) < 0.1 * abs(few / force - 1)


@pytest.mark.slow
def test_files(mapped, tmp_path):
    read = meshio.read(mapped.write(tmp_path / "map.vtu"))
    np.testing.assert_allclose(read.points, mapped.points)
    np.testing.assert_allclose(read.point_data["k0"], mapped.models.k0)
    assert len(read.cells_dict["triangle"]) == len(mapped.elements) > 30
    assert mapped.plot(tmp_path / "map.png", "k0").stat().st_size > 5000
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.png", "map.vtu"]
    few = np.arange(len(mapped)) < 3
    for doubtful, told in ((few, ["doubtful sites"]), (~few | few, []), (few & ~few, [])):
        figure = dataclasses.replace(mapped, doubtful=doubtful).plot(quantity="k0")
        legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert legends == told  # where all are doubtful, they have the colours
    with pytest.raises(ao.InputError, match="quantity"):
        mapped.plot(tmp_path / "no.png", "peak_force")
    with pytest.raises(ao.InputError, match="write"):
        mapped.write(tmp_path / "none" / "map.vtu")


def test_sites_on_supports_are_counted(steel, mapped):
    assert mapped.skipped == 5  # the edge of the top that is clamped
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        ao.impact_map(steel, "top", accuracy=1e9)
    messages = " ".join(str(warning.message) for warning in said)
    assert "5 of 35 sites are left out" in messages
    assert "At 30 of 30 sites" in messages
    with pytest.raises(ao.InputError, match="site"):
        ao.impact_map(steel, "left")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"where": "none"}, "has no group 'none'"),
        ({"where": []}, "points need the direction"),
        ({"where": [], "direction": (0, 0, 1)}, "at least one point"),
        ({"where": np.zeros((2, 4)), "direction": (0, 0, 1)}, "points of 2 or 3 coordinates"),
        ({"direction": (0, 0, 0)}, "direction must not be the zero vector"),
        ({"n": 0}, "n must be a whole number >= 1"),
        ({"radius": -1.0}, "radius must be > 0"),
        ({"modes": 5, "band": 1e9}, "must end below the last of 5 free modes"),
        (
            {"impactor": ao.RigidMass(1.0, 1.0)},
            "impacts need both impactor and duration",
        ),
    ],
)
def test_bad_input(steel, options, words):
    warnings.simplefilter("ignore", UserWarning)
    with pytest.raises(ao.InputError, match=words):
        ao.impact_map(steel, **{"where": "top", **options})


@pytest.mark.slow
def test_a_map_tells_the_blow_that_deflects_a_held_sheet_most(recwarn):
    groups = {"ends": (1, lambda x: np.isclose(x[0], 0) | np.isclose(x[0], 0.2))}
    sheet = ao.Structure(
        parts.plate((10, 6), groups=groups),
        ao.Shell(**parts.STEEL, thickness=1e-3),
        [ao.Support("ends")],
    )
    points, options = [(0.02, 0.03), (0.09, 0.03)], {"direction": (0, 0, -1)}
    for speed, count in ((1e-3, 0), (2.0, 1)):
        blow = ao.RigidMass(0.05, speed), ao.Hertz(1e9), 2e-3
        found = ao.impact_map(sheet, points, *blow, **options)
        far = [str(one.message) for one in recwarn if "deflects by" in str(one.message)]
        assert len(far) == count
    ratio = found.peak_deflection[1] / 1e-3
    assert f"(90, 30, 0) mm: 'structure' deflects by {ratio:.3g} mm, {ratio:.3g} times" in far[0]


def test_an_artefact_of_a_cut_patch_is_not_the_hardest_site(steel, tmp_path):
    """In a corner of a face a quarter of the patch carries the whole force."""
    middle, corner = (0.06, 0.04, 0.03), (0.12, 0.08, 0.03)
    with pytest.warns(ao.AccuracyWarning) as told:
        found = ao.impact_map(
            steel, [middle, corner], direction=(0, 0, -1), radius=0.02, accuracy=1e9
        )
    (sentence,) = (str(one.message) for one in told if "edge" in str(one.message))
    assert map_results.doubts_text(found) in sentence  # one count, and each reason once
    assert found.doubtful.tolist() == [False, True]
    hard = dataclasses.replace(found, peak_force=np.array([1.0, 2.0]))
    assert hardest(hard) == 0
    assert "1 doubtful" in hard.summary()
    rows = dict(presentations(SceneResults(map=hard))[1].rows)
    assert "1 doubtful" in rows["sites"]
    assert rows["peak force"] == "1.000 N to 1.000 N"
    assert "radius of the patch, on cells not larger" in caution_of_map(hard)
    assert "1.00 N, arises at (60, 40, 30) mm" in sentences_of_map(hard)[0]
    most = dataclasses.replace(hard, doubtful=np.ones(2, dtype=bool))
    caution = caution_of_map(most)
    assert "2 doubtful sites: 1 where" in caution
    assert caution.startswith("No site is free of doubts")
    told = " ".join([caution, *sentences_of_map(most), most.summary()])
    assert "left out of" not in told.lower()  # the ranges are those of all sites
    assert "2.00 N, arises at (120, 80, 30) mm" in sentences_of_map(most)[0]
    rows = dict(presentations(SceneResults(map=most))[1].rows)
    assert "2 doubtful sites" in rows["sites"]
    assert rows["peak force"] == "1.000 N to 2.000 N"
    softest = f"k0 of {engineering(found.models.k0[0], 'N/m')}, is at (60, 40, 30) mm"
    assert softest in sentences_of_map(hard)[1]
    stressed = dataclasses.replace(hard, peak_stress=hard.peak_force, stress_points=hard.points)
    assert "largest stress 1.00 Pa at (60, 40, 30) mm" in stressed.summary()
    assert "and the largest stress" in stressed.summary()
    mesh = meshio.read(hard.write(tmp_path / "map.vtu"))
    assert mesh.point_data["doubtful"].tolist() == [0.0, 1.0]


def test_a_force_beyond_that_on_a_rigid_wall_is_doubtful(steel, monkeypatch):
    """A half-space that is taken out where it is not there makes a contact harder than rigid."""
    ball, law = ao.RigidMass(mass=0.05, velocity=1.0), ao.Hertz(1e10)
    wall = ao.simulate(ao.Obstacle(), ball, law, 4e-4).peak_force
    forces = np.array([0.5, 1.2]) * wall
    batch = SimpleNamespace(
        peak_force=forces, contact_time=forces, restitution=forces, impulse=forces, force=[None] * 2
    )
    monkeypatch.setattr(maps, "simulate_many", lambda *_: batch)
    monkeypatch.setattr(maps, "peak_deflections", lambda *_: forces)
    points = [(0.06, 0.04, 0.03), (0.08, 0.04, 0.03)]
    options = {"direction": (0, 0, -1), "radius": 0.025, "accuracy": 1e9}
    with pytest.warns(ao.AccuracyWarning, match="1 doubtful site: 1 where the force exceeds"):
        found = ao.impact_map(steel, points, ball, law, 4e-4, **options)
    assert found.doubtful.tolist() == [False, True]


@pytest.mark.slow
def test_free_body():
    free = block(supported=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        result = ao.impact_map(free, "top", n=14, modes=25)
    assert np.all(result.models.k0 == 0)
    for i in (0, 7, 20):
        direct = ao.extract(free, at(free, "top", i), n=40)
        error = stiffness_error(
            result.model(i).dynamic_stiffness,
            direct.dynamic_stiffness,
            2 * np.pi * result.band,
            direct.omega[0],
        )
        assert error <= 1.02 * result.error[i]
        assert result.models.m_st[i] == pytest.approx(direct.m_st, rel=1e-5)


@pytest.mark.slow
def test_a_patch_has_its_centre_at_the_site_on_any_mesh():
    """Force and moments of the load, and so m_CR of a free block, do not depend on the mesh."""
    site = ao.Site((0.071, 0.037, SIZE[2]), (0.3, -0.2, -1.0), radius=0.012)
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the patch is not resolved, which does not matter here
        for n in ((3, 2, 1), (5, 3, 2), (7, 6, 2)):
            for cell in ("hexahedron", "tetrahedron"):
                part = block(n, supported=False, cell=cell)
                found.append(ao.extract(part, site, n=0).m_st)
    np.testing.assert_allclose(found, found[0], rtol=1e-9)


@pytest.mark.slow
def test_curved_patch_carries_a_unit_force():
    mesh = ao.read_mesh(MESHES / "bracket.msh")
    part = ao.Structure(mesh, ao.Solid(**parts.ALUMINIUM))
    ground = surface(part, "eye")
    along = np.tile([0.0, 0.0, 1.0], (len(ground.points), 1))
    found = located(part, ground.points, along, np.full(len(along), 4e-3))
    # b'u of a unit translation along z is 1, and its first moment is the patch's centre
    z = np.zeros(found.loads.shape[0])
    z[2::3] = 1.0
    np.testing.assert_allclose(found.loads.T @ z, 1.0, rtol=1e-12)
    assert (found.share > 0.99).sum() > 30


@pytest.mark.slow
def test_sheets_of_two_thicknesses_have_patches_of_two_sizes():
    shell = sheet()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = ao.impact_map(shell, direction=(0, 0, -1))
        inner = np.flatnonzero(
            (np.abs(result.points[:, 1] - 0.03) < 0.02) & (result.points[:, 0] < 0.19)
        )
        for i in inner[::3]:
            direct = ao.extract(
                shell, ao.Site(result.points[i], (0, 0, -1), radius=result.radius[i])
            )
            assert result.models.k0[i] == pytest.approx(direct.k0, rel=1e-9)
    assert set(result.radius[inner]) == {4e-3, 8e-3}


@pytest.mark.slow
def test_the_half_space_is_that_of_the_material_at_the_site():
    groups = {
        "left": (2, lambda x: np.isclose(x[0], 0)),
        "steel": (3, lambda x: x[0] < SIZE[0] / 2 + 1e-9),
        "light": (3, lambda x: x[0] > SIZE[0] / 2 - 1e-9),
        "end": (2, lambda x: np.isclose(x[0], SIZE[0])),
    }
    mesh = parts.box((4, 4, 2), SIZE, groups=groups)
    materials = {"steel": ao.Solid(**parts.STEEL), "light": ao.Solid(**parts.ALUMINIUM)}
    part = ao.Structure(mesh, materials, [ao.Support("left")])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = ao.impact_map(part, "end", radius=0.01)
    expected = materials["light"].half_space_compliance(1.0) / 0.01
    np.testing.assert_allclose(result.local_compliance, expected)


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_given_points_of_a_sheet(cell):
    shell = sheet(cell)
    points = [(0.053, 0.021), (0.147, 0.034), (0.081, 0.042)]
    result = ao.impact_map(shell, points, direction=(0, 0, -1), accuracy=1e9)
    np.testing.assert_allclose(result.points[:, :2], points, atol=1e-12)
    for i, point in enumerate(points):
        direct = ao.extract(shell, ao.Site((*point, 0), (0, 0, -1)))
        assert result.model(i).radius == direct.radius
        assert result.models.k0[i] == pytest.approx(direct.k0, rel=1e-9)
    with pytest.raises(ao.InputError, match=r"1 of 4 points lie off the structure, one at \(0"):
        ao.impact_map(shell, [*[(*p, 0) for p in points], (0.05, 0.03, 1e-3)], direction=(0, 0, -1))


THIN, YIELD = (0.12, 0.08, 0.01), 50e6
STRIKER, LAW, DURATION = ao.RigidMass(0.05, 1.0), ao.Hertz(1e9), 4e-4
POINTS = [(0.03, 0.02, 0.01), (0.07, 0.05, 0.01), (0.09, 0.03, 0.01)]


@functools.cache
def struck(supports, **options) -> tuple[ao.Structure, ao.ImpactMap]:
    groups = {"left": (2, lambda x: np.isclose(x[0], 0))}
    mesh = parts.box((6, 4, 1), THIN, "hexahedron", groups=groups)
    steel = ao.Solid(**parts.STEEL, **options)
    part = ao.Structure(mesh, steel, [ao.Support("left")] if supports else [])
    found = ao.impact_map(
        part, POINTS, STRIKER, LAW, DURATION, direction=(0, 0, -1), radius=0.02, n=16, modes=30,
        band=6.4e3, accuracy=1.0, stress=True,
    )  # fmt: skip
    return part, found


@pytest.mark.slow
@pytest.mark.parametrize("supports", [True, False])
@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")  # a coarse mesh, few modes
def test_the_largest_stress_is_that_of_the_impact_by_itself(supports):
    part, found = struck(supports, yield_strength=YIELD)
    for i, point in enumerate(POINTS):
        site = ao.Site(point, (0, 0, -1), radius=0.02)
        hit = ao.simulate(ao.extract(part, site, n=40), STRIKER, LAW, DURATION)
        field = ao.peak_field(part, hit, "yield", times=np.linspace(0, DURATION, 150))
        value, place, _ = field.largest(1)[0]
        assert found.exposure[i] == pytest.approx(value, rel=0.03)
        assert found.peak_stress[i] == pytest.approx(value * YIELD, rel=0.03)
        assert found.stress_points[i] == pytest.approx(place, abs=1e-9)


def finely(supports=True, where="top", radius=0.012, **options):
    part = block((12, 8, 3), supported=supports, cell="tetrahedron")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = ao.impact_map(part, where, BALL, duration=2e-4, radius=radius, **options)
    return part, found, [str(one.message) for one in told]


BALL = ao.Sphere(radius=0.01, material="bearing steel 100Cr6", velocity=1.0)


@pytest.mark.slow
def test_a_support_near_a_patch_makes_its_site_doubtful():
    _, found, _ = finely()
    near = found.points[:, 0] < 2 * found.radius
    assert NEAR in set(found.reasons[near])
    assert NEAR not in found.reasons[~near & (found.points[:, 0] > 0.03)]
    assert NEAR not in finely(supports=False)[1].reasons


def test_a_map_of_one_face_is_not_told_to_map_one_face(steel):
    points, given = [(0.06, 0.04, 0.03)], {"direction": (0, 0, -1), "radius": 0.02}
    found = ao.impact_map(steel, points, **given, accuracy=1e9)
    for name, told in (("", True), ("top", False)):
        edges = dataclasses.replace(found, names=np.array([name]), doubtful=np.zeros(1, bool))
        sentence = map_results.left_out_text(map_results.doubted(edges, np.ones(1, bool), EDGE))
        assert ("map one face" in sentence) == told
        assert EDGE in sentence


def test_the_largest_stress_is_that_of_all_tensors_at_all_times():
    random = np.random.default_rng(7)
    scales = 10.0 ** -np.arange(9)
    columns = random.standard_normal((400, 6, 9)) * scales
    x = np.cumsum(random.standard_normal((3000, 9)), axis=0) / scales
    weights = random.uniform(0, 1, 400)
    stress = equivalent(np.moveaxis(columns @ x.T, 1, -1)).max(axis=1) * weights
    parts = (DEVIATOR @ columns).astype(np.float32)
    most, at = map_stresses._largest(parts, x, weights)
    assert at == stress.argmax()
    assert most == pytest.approx(stress.max(), rel=1e-4)
    _, _, bounds = map_stresses._bounded(parts, x)
    assert (bounds * weights * (1 + map_stresses.ROUNDING) >= stress).all()


@pytest.mark.slow
def test_stresses_are_those_of_sound_sites_and_of_no_more_than_asked_for():
    _, found, _ = finely(stress=5)
    sought = np.isfinite(found.peak_stress)
    assert sought.sum() == 5
    assert not found.doubtful[sought].any()
    assert sought[hardest(found)]
    sound = np.flatnonzero(~found.doubtful)
    gaps = np.linalg.norm(found.points[sound][:, None] - found.points[sought], axis=2).min(axis=1)
    assert gaps.max() < 0.035  # spread over the face: five of a face of 120 x 80 mm


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")  # a coarse mesh, few modes
def test_a_map_colours_by_danger():
    part, found = struck(supports=True, yield_strength=YIELD)
    own = sites.sites_of_map(found, part)[1]
    assert own["units"]["peak_stress"] == "Pa"
    assert own["quantities"]["exposure"] is found.exposure
    worst = int(found.exposure.argmax())
    told = found.summary().splitlines()[-1]
    assert engineering(found.peak_stress[worst], "Pa", 3) in told
    assert "refine" in told
    assert f"{found.exposure[worst]:.3g}" in " ".join(sentences_of_map(found))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")  # a coarse mesh, few modes
def test_stress_needs_impacts_and_no_strength():
    part, found = struck(supports=True)
    assert found.exposure is None
    assert "exposure" not in found.quantities()
    with pytest.raises(ao.InputError):
        ao.impact_map(part, POINTS, direction=(0, 0, -1), radius=0.02, stress=True)


def test_the_reasons_of_doubtful_sites_add_up_to_their_number(steel):
    points = [(0.06, 0.04, 0.03), (0.12, 0.08, 0.03), (0.08, 0.04, 0.03), (0.0, 0.0, 0.03)]
    found = ao.impact_map(steel, points[:1], direction=(0, 0, -1), radius=0.02, accuracy=1e9)
    many = dataclasses.replace(
        found, points=np.array(points), doubtful=np.zeros(4, dtype=bool), reasons=np.full(4, "")
    )
    first = map_results.doubted(many, np.array([True, True, False, False]), "it is cut")
    both = map_results.doubted(first, np.array([False, True, True, False]), "it is held")
    assert both.doubtful.tolist() == [True, True, True, False]
    told = map_results.doubts_text(both)
    assert told == "3 doubtful sites: 2 where it is cut, 1 where it is held"


@pytest.mark.slow
def test_what_reduces_the_error_of_a_map_is_told(steel):
    with pytest.warns(ao.AccuracyWarning, match="Z may be off") as told:
        ao.impact_map(steel, "top", n=2, accuracy=1e-9)
    (text,) = (str(one.message) for one in told if "Z may be off" in str(one.message))
    assert "(n or modes), or a lower band" in text
    ball = ao.Sphere(0.001, material="bearing steel 100Cr6", velocity=1.0)
    given = {"direction": (0, 0, -1), "radius": 0.02, "n": 2, "band": 1e3, "accuracy": 1e9}
    low = ao.impact_map(steel, [(0.06, 0.04, 0.03)], ball, ao.Hertz(1e8), 1e-4, **given)
    told = low_band(low)
    assert re.search(r"by itself, or take band = [\d.e+]+\.", told)


def test_a_stress_has_the_error_of_the_force_also_without_that_of_the_law():
    bar = ErrorBar(100.0, mesh=0.4, truncation=0.2, time=0.0, patch=0.07, law=None)
    budget = ErrorBudget({"peak_force": bar}, 0.0, unknown={"law": "no strength."})
    force = headline.force_bar(budget)
    margin = ao.results.Margin("yield", 5e6, 50e6, np.zeros(3), 0.0, (4e6, 6e6))
    field = ao.results.PeakField(
        "von_mises", "Pa", np.zeros((1, 3)), np.array([5e6]), np.zeros(1), [], None, np.ones(1)
    )
    peak = dataclasses.replace(field, mesh_error=np.array([1e6]), _margin=margin)
    shares = (1 - 0.8 * (1 - 0.67), 1.2 * 1.67 - 1)
    assert headline.stress_bar(peak, force) == pytest.approx(shares)


def test_fewer_sites_lie_apart_on_both_sides_of_a_plate():
    """No vertex is farther from a site than two of these from each other; triangles keep a side."""
    plate = parts.box((12, 8, 1), (0.12, 0.08, 2e-3), "tetrahedron")
    part = ao.Structure(plate, ao.Solid(**parts.STEEL))
    ground = surface(with_parts(part).members()[0].part, None)
    few = thinned(ground, 30)
    assert len(few.points) == 30
    assert thinned(ground, len(ground.points)) is ground
    heights = few.points[few.elements][:, :, 2]
    flat = np.abs(few.normals[few.elements][:, :, 2]).min(axis=1) > 0.9
    assert flat.any()
    assert np.ptp(heights[flat], axis=1).max() == 0  # none runs through the plate
    assert all((np.abs(few.points[:, 2] - z) < 1e-9).sum() > 5 for z in (0, 2e-3))
    with_normals = [np.hstack([x.points, 0.03 * x.normals]) for x in (ground, few)]
    far = cKDTree(with_normals[1]).query(with_normals[0])[0].max()
    assert far <= cKDTree(with_normals[1]).query(with_normals[1], 2)[0][:, 1].min() + 1e-9


@pytest.mark.slow
def test_a_small_patch_does_not_depend_on_a_large_one_beside_it():
    """Each is projected within its own radius, and no face that its lines cross is left out."""
    ball = parts.box((6, 6, 6), (0.02, 0.02, 0.02), "tetrahedron")
    part = with_parts(ao.Structure(ball, ao.Solid(**parts.STEEL))).members()[0].part
    points = np.array([[0.006, 0.007, 0.02], [0.011, 0.01, 0.02], [0.02, 0.009, 0.008]])
    directions = np.array([[0, 0, -1.0], [0.1, 0, -1.0], [-1.0, 0, 0]])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    radii = np.array([1e-3, 9e-3, 2.5e-3])
    together = located(part, points, directions, radii)
    for i in range(3):
        alone = located(part, points[i : i + 1], directions[i : i + 1], radii[i : i + 1])
        assert together.share[i] == pytest.approx(alone.share[0], rel=1e-12)
        apart = together.loads[:, i] - alone.loads[:, 0]
        assert abs(apart).max() < 1e-12 * abs(alone.loads).max()
    faces = part.faces
    count = len(faces.facets)
    random = np.random.default_rng(3)
    on_face = np.einsum("fv,fvd->fd", random.dirichlet(np.ones(3), count), faces.corners)
    along = random.standard_normal((count, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    heights = random.uniform(-0.02, 0.02, (count, 1))
    pairs = zip(*faces._crossed(on_face + heights * along, along, 0.02), strict=True)
    assert {(i, i) for i in range(count)} <= {(int(face), int(point)) for face, point in pairs}


@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
def test_a_map_takes_no_more_modes_than_the_part_has():
    part, given = block((1, 1, 1), order=1), {"direction": (0, 0, -1), "radius": 0.02}
    found = ao.impact_map(part, [(0.1, 0.02, 0.02)], modes=10**4, **given)
    assert found.models.omega.size <= part.dofs
    with pytest.raises(ao.InputError, match="lower the band"):
        ao.impact_map(part, [(0.1, 0.02, 0.02)], band=1e12, **given)


@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
def test_sites_without_a_result_are_marked_and_told_by_their_place(steel):
    """A heavy, fast ball on one small patch beside large ones."""
    points = [(0.06, 0.04, 0.03), (0.08, 0.04, 0.03)]
    forces = []

    def failed(models, *_):
        forces.append(len(models))
        nothing = np.array([1.0, np.nan])
        return SimpleNamespace(
            peak_force=nothing,
            contact_time=nothing,
            restitution=nothing,
            impulse=nothing,
            force=[None] * 2,
        )

    ball, law = ao.RigidMass(mass=0.05, velocity=1.0), ao.Hertz(1e10)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps, "simulate_many", failed)
        patch.setattr(maps, "peak_deflections", lambda *_: np.ones(2))
        options = {"direction": (0, 0, -1), "radius": 0.025, "accuracy": 1e9}
        found = ao.impact_map(steel, points, ball, law, 4e-4, **options)
    assert forces == [2]
    assert found.doubtful.tolist() == [False, True]
    assert found.reasons.tolist() == ["", NO_RESULT]
