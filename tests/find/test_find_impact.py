"""Blows found from signals: those of the model itself, of another mesh, and what cannot be told."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
from mpi4py import MPI

import antiosc as ao
from antiosc.models.free_modes import residual
from antiosc.studies.find import scan, surface
from antiosc.studies.find.find import prepared
from antiosc.studies.find.forward import StruckPlace

pytestmark = pytest.mark.fem

SIZE, RATE, SAMPLES = (0.4, 0.3), 25e3, 250
POINTS = ((0.07, 0.06, 0), (0.33, 0.08, 0), (0.29, 0.25, 0), (0.11, 0.22, 0))
SENSORS = [ao.Sensor(point, (0, 0, 1)) for point in POINTS]
DOWN = (0, 0, -1)
BLOW, LAW, START = ao.RigidMass(0.12, 2.0), ao.Hertz(4e8), 4.7e-4


def edge(x: np.ndarray) -> np.ndarray:
    return np.any([np.isclose(x[i], end) for i in (0, 1) for end in (0, SIZE[i])], axis=0)


def plate(n=(12, 9), E=210e9) -> ao.Structure:
    mesh = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, [[0, 0], SIZE], n)
    material = ao.Shell(E, 0.3, 7850, 4e-3)
    return ao.Structure(ao.read_mesh(mesh, gdim=3), material, supports=[ao.Support(edge, ("x", "y", "z"))])


@pytest.fixture(scope="module")
def part() -> ao.Structure:
    return plate()


def own_signals(part: ao.Structure, sensors, site: int) -> tuple[np.ndarray, ao.History, np.ndarray]:
    """Signals of the model of find_impact itself at a vertex, the impact and its place."""
    known = prepared(part, sensors, None, DOWN, None, 60, None)
    seen, sites = known.seen, known.seen.found.sites
    r, _ = residual(seen.omega, seen.b, seen.compliance, seen.inertia)
    modes = ao.ModalBody(seen.omega, seen.b[site], float(r[site]))
    body = StruckPlace(modes, float(sites.local[site]), float(sites.radii[site]))
    hit = ao.simulate(body, BLOW, LAW, SAMPLES / RATE, tol=1e-6)
    t = np.arange(SAMPLES) / RATE - START
    on = t >= 0
    q, v = (x[:, : len(seen.omega)] for x in hit.states(t[on]))
    a = hit.force_at(t[on])[:, None] * seen.b[site] - seen.omega**2 * q
    signals = np.zeros((SAMPLES, len(sensors)))
    for s, sensor in enumerate(sensors):
        signals[on, s] = (q, v, a)[sensor.derivative] @ known.rows[s]
    return signals, hit, sites.points[site]


def nearest(part: ao.Structure, point) -> int:
    sites = prepared(part, SENSORS[:1], None, DOWN, None, 5, None).seen.found.sites
    return int(np.argmin(np.linalg.norm(sites.points - point, axis=1)))


def test_the_signals_of_the_model_itself_return_the_blow(part: ao.Structure) -> None:
    kinds = ("acceleration", "velocity", "displacement", "strain")
    ways = (*[(0, 0, 1)] * 3, (1, 0, 0))
    sensors = [ao.Sensor(p, d, q) for p, d, q in zip(POINTS, ways, kinds, strict=True)]
    signals, hit, place = own_signals(part, sensors, nearest(part, (0.23, 0.13, 0)))
    found = ao.find_impact(part, sensors, signals, RATE, direction=DOWN)
    assert found.status == 0, found.message
    assert np.linalg.norm(found.place - place) < 1e-4 * SIZE[0]
    assert found.start == pytest.approx(START, abs=1e-7)
    values = [found.mass, found.velocity, found.stiffness, found.peak_force, found.impulse]
    exact = [BLOW.mass, BLOW.velocity, LAW.stiffness, hit.peak_force, hit.impulse]
    assert values == pytest.approx(exact, rel=5e-4)
