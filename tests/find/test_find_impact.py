"""Blows found from signals: those of the model itself, of another mesh, and what cannot be told."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
from mpi4py import MPI

import antiosc as ao
from antiosc.models.body import ModalModel
from antiosc.models.free_modes import residual_parameters
from antiosc_studies.find import monitored_structure

pytestmark = pytest.mark.fem

SIZE, RATE, SAMPLES = (0.4, 0.3), 16e3, 128
POINTS = ((0.07, 0.06, 0), (0.33, 0.08, 0), (0.29, 0.25, 0), (0.11, 0.22, 0))
SENSORS = [ao.Sensor(point, (0, 0, 1)) for point in POINTS]
DOWN, MODES = (0, 0, -1), 14
BLOW, LAW, START = ao.RigidMass(0.3, 2.0), ao.Hertz(4e7), 4.7e-4


def edge(x: np.ndarray) -> np.ndarray:
    return np.any([np.isclose(x[i], end) for i in (0, 1) for end in (0, SIZE[i])], axis=0)


def plate(n=(8, 6), E=210e9) -> ao.Structure:
    mesh = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, [[0, 0], SIZE], n)
    material = ao.Shell(E, 0.3, 7850, 4e-3)
    return ao.Structure(
        ao.read_mesh(mesh, gdim=3), material, supports=[ao.Support(edge, ("x", "y", "z"))]
    )


@pytest.fixture(scope="module")
def part() -> ao.Structure:
    return plate()


def own_signals(
    part: ao.Structure, sensors, site: int, law: ao.ContactLaw = LAW
) -> tuple[np.ndarray, ao.History, np.ndarray]:
    """Signals of the model of find_impact itself at a vertex, the impact and its place."""
    known = monitored_structure(part, sensors, None, DOWN, None, MODES, None)
    seen, sites = known.free_sites, known.free_sites.map_sites.sites
    r, _ = residual_parameters(seen.omega, seen.b, seen.compliance, seen.inertia)
    modes = ao.ModalBody(seen.omega, seen.b[site], float(r[site]))
    body = ModalModel(modes, float(sites.local[site]), float(sites.radii[site]))
    hit = ao.simulate(body, BLOW, law, SAMPLES / RATE, tol=1e-6)
    t = np.arange(SAMPLES) / RATE - START
    on = t >= 0
    q, v = (x[:, : len(seen.omega)] for x in hit.states(t[on]))
    a = hit.force_at(t[on])[:, None] * seen.b[site] - seen.omega**2 * q
    signals = np.zeros((SAMPLES, len(sensors)))
    for s, sensor in enumerate(sensors):
        signals[on, s] = (q, v, a)[sensor.derivative] @ known.sensor_shapes[s]
    return signals, hit, sites.points[site]


def nearest(part: ao.Structure, point) -> int:
    sites = monitored_structure(
        part, SENSORS[:1], None, DOWN, None, 5, None
    ).free_sites.map_sites.sites
    return int(np.argmin(np.linalg.norm(sites.points - point, axis=1)))


@pytest.mark.slow
def test_the_signals_of_the_model_itself_return_the_blow(part: ao.Structure) -> None:
    kinds = ("acceleration", "velocity", "displacement", "strain")
    ways = (*[(0, 0, 1)] * 3, (1, 0, 0))
    sensors = [ao.Sensor(p, d, q) for p, d, q in zip(POINTS, ways, kinds, strict=True)]
    signals, hit, place = own_signals(part, sensors, nearest(part, (0.23, 0.13, 0)))
    found = ao.find_impact(part, sensors, signals, RATE, direction=DOWN, modes=MODES)
    assert found.status == 0, found.message
    assert np.linalg.norm(found.place - place) < 1e-4 * SIZE[0]
    assert found.start == pytest.approx(START, abs=1e-7)
    values = [found.mass, found.velocity, found.stiffness, found.peak_force, found.impulse]
    exact = [BLOW.mass, BLOW.velocity, LAW.stiffness, hit.peak_force, hit.impulse]
    assert values == pytest.approx(exact, rel=5e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("mass", "stiffness", "status"), [(0.3, 4e7, 0), (0.05, 4e8, 1)])
def test_another_mesh_with_noise_lies_within_the_bars(
    part: ao.Structure, mass: float, stiffness: float, status: int
) -> None:
    """A long pulse tells all; of a short one only the force is told."""
    other, place = plate((16, 13), E=1.01 * 210e9), (0.25, 0.12, 0)
    model = ao.extract(other, ao.Site(place, DOWN), n=60)
    hit = ao.simulate(model, ao.RigidMass(mass, 2.0), ao.Hertz(stiffness), SAMPLES / RATE)
    t = np.arange(SAMPLES) / RATE - START
    signals = np.zeros((SAMPLES, 4))
    for s, point in enumerate(POINTS):
        signals[t >= 0, s] = ao.probe(other, hit, point, "acceleration", t[t >= 0])[:, 2]
    size = np.sqrt(np.mean(signals**2, axis=0))
    signals += 0.04 * size * np.random.default_rng(0).standard_normal(signals.shape)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)
        found = ao.find_impact(
            part, SENSORS, signals, RATE, direction=DOWN, modes=MODES, damping=0.0
        )
    assert found.status == status, found.message
    assert (found.rank == found.unknowns) == (status == 0)
    assert np.isinf(found.bars["stiffness"]) == (status == 1)
    assert np.linalg.norm(found.place - place) < min(1.5 * found.bars["place"], 0.02 * SIZE[0])
    impulse = found.impulse / hit.impulse - 1
    assert abs(impulse) < min(1.5 * found.bars["impulse"], 0.03)
    assert abs(found.peak_force / hit.peak_force - 1) < 1.5 * found.bars["peak_force"]
    assert found.force.max() <= 1.001 * found.peak_force


def quick(part: ao.Structure, sensors, signals, **options) -> ao.FoundImpact:
    where = [(0.1, 0.1, 0), (0.1, 0.2, 0), (0.3, 0.1, 0), (0.3, 0.2, 0)]
    return ao.find_impact(part, sensors, signals, RATE, where, direction=DOWN, modes=12, **options)


@pytest.mark.slow
def test_one_sensor_on_both_axes_of_symmetry_does_not_tell_the_place(part: ao.Structure) -> None:
    sensors = [ao.Sensor((0.2, 0.15, 0), (0, 0, 1))]
    site = nearest(part, (0.1, 0.1, 0))
    signals, _, _ = own_signals(part, sensors, site)
    signals += 0.02 * signals.std() * np.random.default_rng(1).standard_normal(signals.shape)
    with pytest.warns(ao.AccuracyWarning, match="place"):
        found = quick(part, sensors, signals, unknown=("place",), impactor=BLOW, contact=LAW)
    assert found.status == 1
    assert len(found.others) == 1


@pytest.mark.slow
def test_a_blow_that_yields_is_found(part: ao.Structure) -> None:
    law = ao.ElasticPlastic(3e8, 0.01, 1e6)
    signals, hit, place = own_signals(part, SENSORS, nearest(part, (0.23, 0.13, 0)), law)
    assert hit.dent is not None
    given = {"unknown": ("place", "velocity"), "impactor": BLOW, "contact": law}
    found = ao.find_impact(part, SENSORS, signals, RATE, direction=DOWN, modes=MODES, **given)
    assert found.status == 0, found.message
    assert np.linalg.norm(found.place - place) < 1e-3 * SIZE[0]
    assert found.peak_force == pytest.approx(hit.peak_force, rel=2e-3)
    assert found.stiffness == pytest.approx(law.stiffness, rel=5e-3)


@pytest.mark.slow
def test_signals_without_a_blow_are_not_explained(part: ao.Structure) -> None:
    signals = np.random.default_rng(1).standard_normal((SAMPLES, 4))
    with pytest.warns(ao.AccuracyWarning, match="cannot tell|determine"):
        found = quick(part, SENSORS, signals, band=1.3e3)
    assert found.status != 0
    assert found.rank < found.unknowns or found.chi2 > 2


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"signals": np.ones((100, 3))}, "column"),
        ({"signals": np.ones((10, 4))}, "samples"),
        ({"signals": np.full((100, 4), np.nan)}, "finite"),
        ({"signals": np.zeros((100, 4))}, "zero"),
        ({"rate": 0.0}, "rate"),
        ({"sensors": []}, "Sensor"),
        ({"sensors": ["left"]}, "Sensor"),
        ({"unknown": "mass"}, "list"),
        ({"unknown": ["colour"]}, "unknown"),
        ({"unknown": ["place"]}, "RigidMass"),
        ({"unknown": ["place", "mass", "velocity"]}, "stiffness"),
        ({"unknown": ["mass", "velocity", "stiffness"]}, "place"),
        ({"contact": ao.ElasticPlastic(3e8, 0.01, 1e6)}, "leave it out"),
        ({"noise": [1.0, 2.0]}, "noise"),
        ({"frequency_error": 2.0}, "frequency_error"),
        ({"where": "nowhere"}, "nowhere"),
    ],
)
def test_bad_input(part: ao.Structure, change, word: str) -> None:
    random = np.random.default_rng(0).standard_normal((100, 4))
    given = {"sensors": SENSORS, "signals": random, "rate": RATE, "direction": DOWN, "modes": 5}
    with pytest.raises(ao.InputError, match=word):
        ao.find_impact(part, **{**given, **change})


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"quantity": "force"}, "quantity"),
        ({"direction": (0, 0, 0)}, "zero"),
        ({"length": 0.01}, "gauge"),
        ({"point": (np.nan, 0, 0)}, "finite"),
    ],
)
def test_bad_sensors(change, word: str) -> None:
    with pytest.raises(ao.InputError, match=word):
        ao.Sensor(**{"point": (0, 0, 0), "direction": (0, 0, 1), **change})
