"""Impact maps against direct extraction at the same sites, single impacts, and bad input."""

from __future__ import annotations

import dataclasses
import functools
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from paths import MESHES

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import meshio

import antiosc as ao
import parts
from antiosc.base.stresses import VON_MISES_ROOT, von_mises_of_components
from antiosc.models.body import NO_RESULT
from antiosc.models.free_modes import stiffness_error
from antiosc.reduce.site import functional
from antiosc.reduce.site.map_sites import sites_of, surface_sample
from antiosc.reduce.site.sites import located_sites
from antiosc.strikes import impact_map as maps, map_stresses
from antiosc.strikes.map_results import hardest

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
    ground = surface_sample(structure, "top")
    np.testing.assert_allclose(ground.normals[:, 2].max(), 1.0)
    push = np.tile([0.6, 0.0, -0.8], (len(ground.points), 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for radius in (None, 0.02):
            radii = np.full(len(push), np.nan if radius is None else radius)
            found = located_sites(structure, ground.points, push, radii)
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
        ({"where": np.zeros((2, 4)), "direction": (0, 0, 1)}, r"points \(n, 2 or 3\)"),
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
    mesh = ao.read_mesh(MESHES / "bracket.msh", order=1)
    part = ao.Structure(mesh, ao.Solid(**parts.ALUMINIUM), order=1)
    ground = surface_sample(part, "eye")
    along = np.tile([0.0, 0.0, 1.0], (len(ground.points), 1))
    found = located_sites(part, ground.points, along, np.full(len(along), 4e-3))
    # b'u of a unit translation along z is 1, and its first moment is the patch's centre
    z = np.zeros(found.loads.shape[0])
    z[2::3] = 1.0
    np.testing.assert_allclose(found.loads.T @ z, 1.0, rtol=1e-12)
    assert (found.share > 0.99).sum() > 30


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
        field = ao.peak_field(part, hit, times=np.linspace(0, DURATION, 150))
        value, place, _ = field.largest(1)[0]
        assert found.exposure[i] == pytest.approx(value / YIELD, rel=0.03)
        assert found.peak_stress[i] == pytest.approx(value, rel=0.03)
        assert found.stress_points[i] == pytest.approx(place, abs=1e-9)


def finely(supports=True, where="top", radius=0.012, **options):
    part = block((12, 8, 3), supported=supports, cell="tetrahedron")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = ao.impact_map(part, where, BALL, duration=2e-4, radius=radius, **options)
    return part, found, [str(one.message) for one in told]


BALL = ao.Sphere(radius=0.01, material="bearing steel 100Cr6", velocity=1.0)


def test_the_largest_stress_is_that_of_all_tensors_at_all_times():
    random = np.random.default_rng(7)
    scales = 10.0 ** -np.arange(9)
    columns = random.standard_normal((400, 6, 9)) * scales
    x = np.cumsum(random.standard_normal((3000, 9)), axis=0) / scales
    weights = random.uniform(0, 1, 400)
    stress = von_mises_of_components(np.moveaxis(columns @ x.T, 1, -1)).max(axis=1) * weights
    parts = (VON_MISES_ROOT @ columns).astype(np.float32)
    most, at = map_stresses._largest_stress(parts, x, weights)
    assert at == stress.argmax()
    assert most == pytest.approx(stress.max(), rel=1e-4)
    _, _, bounds = map_stresses._principal_rotation(parts, x)
    assert (bounds * weights * (1 + map_stresses.BOUND_ROUNDING) >= stress).all()


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
def test_stress_needs_impacts_and_no_strength():
    part, found = struck(supports=True)
    assert found.exposure is None
    assert "exposure" not in found.quantities()
    with pytest.raises(ao.InputError):
        ao.impact_map(part, POINTS, direction=(0, 0, -1), radius=0.02, stress=True)


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
