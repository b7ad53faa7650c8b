"""The errors of shells of quadrilaterals: the divided mesh, closed forms, and much finer meshes."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.structure.structure import on_mesh
from antiosc.impact.histories.bars import QUANTITIES, relative_differences
from antiosc.reduce.error.division import divided_structure, interpolation_matrix
from antiosc.reduce.extraction import elastic_response
from marks import FREE_ON_PURPOSE
from sheets import NU as nu, RHO as rho, E, at, plate, sheet

pytestmark = [pytest.mark.fem, FREE_ON_PURPOSE]

ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
LENGTH, WIDTH = 1.0, 0.7
#: the tube has a radius of 0.3
SURFACES = {
    "plate": lambda s, t: (s, WIDTH * t, 0 * s),
    "skew": lambda s, t: (
        s + 0.4 * t + 0.06 * np.sin(5 * s) * np.sin(4 * t),
        WIDTH * t + 0.05 * np.sin(6 * s) * t * (1 - t),
        0 * s,
    ),
    "fold": lambda s, t: (np.minimum(s, 0.5), WIDTH * t, np.maximum(s - 0.5, 0)),
    "panel": lambda s, t: (np.sin(0.8 * s), WIDTH * t, np.cos(0.8 * s)),
    "tube": lambda s, t: (0.3 * np.sin(np.pi * s), WIDTH * t, 0.3 * np.cos(np.pi * s)),
}
ENDS = {
    "clamped": [ao.Support(at(1, 0.0)), ao.Support(at(1, WIDTH))],
    "simple": [ao.Support(at(1, 0.0), ("x", "y", "z")), ao.Support(at(1, WIDTH), ("x", "y", "z"))],
    "cantilever": [ao.Support(at(1, 0.0))],
    "free": [],
}


def mesh_of(shape: str, n: tuple[int, int], order: int = 1) -> ao.Mesh:
    return sheet(n, SURFACES[shape], "quadrilateral", order)


def struck(part: ao.Structure, point: tuple[float, ...], along: tuple[float, ...], **options):
    return ao.extract(part, ao.Site(point, along, snap=True), n=30, **options)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["skew", "tube"])
@pytest.mark.parametrize("order", [1, 2])
def test_the_divided_mesh_has_all_motions_of_the_mesh_on_the_same_surface(shape, order):
    """The mass of any motion, rigid motions, and what the supports hold are those of the mesh."""
    shell = ao.Shell(**ALUMINIUM, thickness=0.02)
    part = on_mesh(ao.Structure(mesh_of(shape, (6, 4), order), shell, ENDS["simple"]))
    fine = on_mesh(divided_structure(part))
    assert fine.mesh.n_cells == 4 * part.mesh.n_cells
    motions = np.random.default_rng(1).standard_normal((part.rows, 3))
    motions[part.fixed] = 0.0
    on_fine = interpolation_matrix(part, fine) @ motions
    assert np.abs(on_fine[fine.fixed]).max() < 1e-12
    mass = motions.T @ multiply(part.M, motions)
    rounding = (1e-3 if order > 1 else 1e-9) * np.trace(mass)  # curved cells: points of integration
    assert on_fine.T @ multiply(fine.M, on_fine) == pytest.approx(mass, abs=rounding)
    x = part.places.rigid_motions(np.zeros(3))
    assert interpolation_matrix(part, fine) @ x == pytest.approx(
        fine.places.rigid_motions(np.zeros(3)), abs=1e-9
    )


def test_answers_of_a_free_shell_are_those_of_one_held_at_points_up_to_a_rigid_motion():
    mesh = mesh_of("fold", (6, 4))
    shell = ao.Shell(**ALUMINIUM, thickness=0.02)
    free = ao.Structure(mesh, shell)
    forces = np.random.default_rng(2).standard_normal((free.rows, 2))
    motions = on_mesh(free).places.rigid_motions(np.zeros(3))
    forces -= motions @ np.linalg.lstsq(motions, forces, rcond=None)[0]
    corners = [
        ((0.0, 0.0, 0.0), ("x", "y", "z")),
        ((0.0, WIDTH, 0.0), ("x", "z")),
        ((0.5, 0.0, 0.5), ("z",)),
    ]
    held = ao.Structure(mesh, shell, [ao.Support(near=(x, 1e-6), fix=fix) for x, fix in corners])
    energy = forces.T @ elastic_response(free, free.factorize(), forces)
    forces[held.fixed] = 0.0  # their reactions vanish
    assert energy == pytest.approx(forces.T @ held.factorize().solve_block(forces), rel=1e-4)


@pytest.mark.slow
def test_the_corrected_model_has_the_first_frequencies_of_a_simply_supported_plate():
    """Mindlin's plate: w = sin sin, cells of a quarter of its side; the corrected model is within a
    fourth of the error of the mesh."""
    t = 0.01
    part = plate(4, t, "quadrilateral")
    model = ao.extract(part, ao.Site((0.5, 0.5, 0.0), (0, 0, -1)), n=12, error="estimate")
    D = E * t**3 / 12 / (1 - nu**2)
    wave = 2 * np.pi**2
    # ω² of Mindlin's plate to first order in the shear deformation and the rotary inertia
    shear = 1 + wave * t**2 / 12 * (1 + 2 * 6 / 5 / (1 - nu))
    exact = wave * np.sqrt(D / (rho * t) / shear)
    raw, corrected = (each.modal().omega[0] for each in (model, model.corrected()))
    assert abs(corrected - exact) < 0.25 * abs(raw - exact)
    assert raw > exact


#: so slow [m/s] that nothing stretches
SPEED = 1e-4
#: shape, ends, cells, thickness, order, place, mass over that of the shell, pulse over the period
CASES = [
    ("plate", "clamped", (6, 4), 0.001, 1, (0.3, 0.25, 0.0), 0.1, 0.1),
    ("skew", "simple", (6, 4), 0.02, 1, (0.6, 0.3, 0.0), 0.5, 1.0),
    ("fold", "clamped", (8, 4), 0.005, 1, (0.25, 0.3, 0.0), 0.1, 0.2),
    ("tube", "free", (10, 5), 0.001, 2, (0.21, 0.3, 0.21), 0.05, 0.3),
]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[1]}-{case[3]}")
def test_the_bar_holds_what_a_much_finer_mesh_changes_and_is_no_more_than_six_times_that(case):
    """Plates and shells, some thin enough to lock, against cells of a third of the size."""
    shape, ends, n, thickness, order, point, mass_share, pulse = case
    along = (0.0, 0.0, -1.0) if shape not in ("panel", "tube") else (-point[0], 0.0, -point[2])
    shell = ao.Shell(**ALUMINIUM, thickness=thickness)
    part, fine = (
        ao.Structure(mesh_of(shape, (k * n[0], k * n[1]), order), shell, ENDS[ends]) for k in (1, 3)
    )
    model = struck(part, point, along, error="estimate")
    truth = struck(fine, point, along)
    omega = model.modal().omega
    contact = pulse * 2 * np.pi / omega[omega > 1e-3 * omega[-1]][0]
    mass = mass_share * part.mass
    # of a rigid wall: contact time 2.94 δ/v, δ = (5 m v² / 4 k)^(2/5)
    law = ao.Hertz(1.25 * mass * SPEED**2 / (SPEED * contact / 2.94) ** 2.5)
    hit, true = (
        ao.simulate(each, ao.RigidMass(mass, SPEED), law, 2.5 * contact, tol=1e-5)
        for each in (model, truth)
    )
    errors = relative_differences(hit, true)
    bars = {name: hit.error_budget[name].mesh for name in QUANTITIES}
    comparable = 3 if len(hit.contacts) == len(true.contacts) else 2
    for name in list(QUANTITIES)[:comparable]:
        assert errors[name] <= bars[name] + 1e-5
    assert max(bars.values()) <= 6 * max(errors.values()) + 1e-4
