"""Impact maps against direct extraction at the same sites, single impacts, and bad input."""

from __future__ import annotations

import dataclasses
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import meshio

import antiosc as ao
import parts
from antiosc.fem.site import functional
from antiosc.fem.site.map_sites import sites_of, surface
from antiosc.fem.site.sites import located
from antiosc.models.driving_point import stiffness_error
from antiosc.studies import maps
from antiosc.studies.map_results import hardest

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
            model.dynamic_stiffness, reference.dynamic_stiffness, mapped.band, reference.omega[0]
        )
        assert error <= 1.02 * mapped.error[i] + 1e-9
        assert model.k0 == pytest.approx(reference.k0, rel=1e-9)
        assert model.m_st == pytest.approx(reference.m_st, rel=1e-5)
    assert np.median(mapped.error) < 0.05


@pytest.mark.sample
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


def test_files(mapped, tmp_path):
    read = meshio.read(mapped.write(tmp_path / "map.vtu"))
    np.testing.assert_allclose(read.points, mapped.points)
    np.testing.assert_allclose(read.point_data["k0"], mapped.models.k0)
    assert len(read.cells_dict["triangle"]) == len(mapped.elements) > 30
    assert mapped.plot(tmp_path / "map.png", "k0").stat().st_size > 5000
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.png", "map.vtu"]
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
    assert "give the site a radius" in messages
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
            "impacts need all of impactor, contact and duration",
        ),
    ],
)
def test_bad_input(steel, options, words):
    warnings.simplefilter("ignore", UserWarning)
    with pytest.raises(ao.InputError, match=words):
        ao.impact_map(steel, **{"where": "top", **options})


def test_an_artefact_of_a_cut_patch_is_not_the_hardest_site(steel, tmp_path):
    """In a corner of a face a quarter of the patch carries the whole force."""
    middle, corner = (0.06, 0.04, 0.03), (0.12, 0.08, 0.03)
    with pytest.warns(ao.AccuracyWarning, match="cuts the patch"):
        found = ao.impact_map(
            steel, [middle, corner], direction=(0, 0, -1), radius=0.02, accuracy=1e9
        )
    assert found.doubtful.tolist() == [False, True]
    hard = dataclasses.replace(found, peak_force=np.array([1.0, 2.0]))
    assert hardest(hard) == 0
    assert "1 doubtful" in hard.summary()
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
        peak_force=forces, contact_time=forces, restitution=forces, impulse=forces, force=None
    )
    monkeypatch.setattr(maps, "simulate_many", lambda *_: batch)
    monkeypatch.setattr(maps, "peak_deflections", lambda *_: forces)
    points = [(0.06, 0.04, 0.03), (0.08, 0.04, 0.03)]
    options = {"direction": (0, 0, -1), "radius": 0.025, "accuracy": 1e9}
    found = ao.impact_map(steel, points, ball, law, 4e-4, **options)
    assert found.doubtful.tolist() == [False, True]
