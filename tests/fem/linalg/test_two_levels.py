"""Conjugate gradients with two levels, against a factor of the same matrix."""

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import dolfinx
import meshio
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.fem.elements import tetrahedra
from antiosc.fem.linalg import iterative as cg, solver_choice
from antiosc.fem.linalg.iterative import TwoLevels
from antiosc.fem.linalg.solver import STRAIGHT_PRODUCTS, LevelSizes
from antiosc.reduce.extraction import site_shapes
from antiosc.reduce.extraction.krylov import Lanczos
from antiosc.reduce.extraction.model import stiffness_at_sites
from mpi import START, run_ranks

TIP = ao.Site((0.15, 0.021, 0.04), (0.1, 0.2, -1), radius=0.032)
HEEL = ao.Site((0.05, 0.021, 0.04), (0.0, 0.0, -1), radius=0.032)
ORTHOTROPIC = ao.AnisotropicSolid.orthotropic(
    E=(140e9, 10e9, 9e9), nu=(0.3, 0.25, 0.3), G=(5e9, 6e9, 3e9), rho=1600.0
)
SPRING = ao.Spring((0.2, 0.05, 0.04), {"z": 1e12})
MASS = ao.PointMass((0.1, 0.05, 0.04), mass=30.0)


@pytest.fixture(autouse=True)
def products_from_the_cells(monkeypatch):
    monkeypatch.setattr(tetrahedra, "LEAST_CELLWISE_DOFS", 0)


def mixed() -> ao.Mesh:
    """Hexahedra and wedges, which a reader cuts into tetrahedra."""
    steps = [
        np.linspace(0, size, n + 1) for size, n in zip((0.2, 0.05, 0.04), (6, 3, 2), strict=True)
    ]
    points = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1)
    number = np.arange(points[..., 0].size).reshape(points.shape[:3])
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    a, b, c, d = (np.stack([one[..., :-1], one[..., 1:]], axis=-1) for one in corners)
    bricks = np.stack([a, b, c, d], axis=-1)[:3].reshape(-1, 8)
    wedges = [np.stack(base, axis=-1)[3:].reshape(-1, 6) for base in ((a, b, c), (a, c, d))]
    cells = [("hexahedron", bricks), ("wedge", np.vstack(wedges))]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "mixed.vtu"
        meshio.Mesh(points.reshape(-1, 3), cells).write(file)
        return ao.read_mesh(file)


def made(solver: str, **given) -> ao.Structure:
    cell = given.pop("cell", "tetrahedron")
    material = given.pop("material", ao.Solid(**{**parts.STEEL, "nu": given.pop("nu", 0.3)}))
    left = ao.Support(lambda x: np.isclose(x[0], 0.0))
    held = [left] if given.pop("supports", ["left"]) else []
    mesh = mixed() if cell == "hexahedra and wedges" else parts.box((6, 3, 2), cell=cell)
    return ao.Structure(mesh, material, held, solver=solver, **given)


@pytest.mark.slow
def test_a_mass_at_a_corner_of_a_plate():
    """The interpolation stores zeros for nodes of other cells than those at the corner."""
    size = (0.2, 0.16, 0.02)
    mass = ao.PointMass(size, mass=1.0)
    found = []
    for solver in ("direct", "iterative"):
        mesh = parts.box((10, 8, 1), size, cell="tetrahedron")
        held = [ao.Support("left")]
        part = ao.Structure(mesh, ao.Solid(**parts.STEEL), held, attached=[mass], solver=solver)
        model = ao.extract(part, ao.Site((0.14, 0.08, 0.02), (0, 0, -1), radius=0.03), n=6)
        found.append(model.dynamic_stiffness(0.7 * model.omega[1]))
    assert abs(found[1] / found[0] - 1) <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("supports", [["left"], []], ids=["held", "free"])
def test_natural_modes_of_two_levels(supports):
    """Solves of an eigenproblem go on beyond the error that is enough for a driving point."""
    exact, found = (made(one, supports=supports) for one in ("direct", "iterative"))
    modes = found.natural_modes(8)
    np.testing.assert_allclose(modes.frequency, exact.natural_modes(8).frequency, rtol=1e-8)
    before = found.factorize()
    assert before._ksp.rtol == cg.ITERATION_RESIDUAL


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"cell": "hexahedron"},
        {"supports": []},
        {"cell": "hexahedron", "nu": 0.499},
        {"cell": "hexahedra and wedges"},
        {"material": ORTHOTROPIC},
        {"attached": [SPRING, MASS]},
    ],
    ids=[
        *("tetrahedra", "hexahedra", "free", "hexahedra 0.499", "mixed", "orthotropic"),
        "attached",
    ],
)
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning")
def test_models_are_those_of_a_factor(given):
    direct, iterative = made("direct", **given), made("iterative", **given)
    assert type(iterative.factorize()) is TwoLevels
    sites = {"tip": TIP, "heel": HEEL}
    if "material" in given:  # the half-space of a patch is not known
        sites = {name: replace(site, radius=None) for name, site in sites.items()}
    a, b = (ao.extract(part, sites, n=12) for part in (direct, iterative))
    assert a.info["solver"].startswith("factor; forecast")
    assert "two levels" in b.info["solver"]
    for share in (0.1, 0.7, 1.3):
        Z, found = (np.asarray(m.dynamic_stiffness(share * a.omega[1])) for m in (a, b))
        assert np.linalg.norm(found - Z) <= 1e-6 * np.linalg.norm(Z)


@pytest.mark.slow
def test_the_factor_is_forecast_from_the_linear_elements():
    mesh = parts.box((9, 6, 6), cell="tetrahedron")
    part = ao.Structure(mesh, ao.Solid(**parts.STEEL), [ao.Support("left")])
    found = solver_choice.forecast_of(part.K, part.matrices.prolongation()).entries
    exact = part.factorize().entries
    assert exact / 2 <= found <= 2 * exact


def test_a_cycle_of_a_tiny_load():
    """A cycle is linear, in single precision too."""
    part = made("iterative", supports=[])
    cycle = part.factorize()._cycle
    load, result = part.K.createVecs()
    values = np.random.default_rng(0).standard_normal(part.rows)
    found = []
    for size in (1.0, 1e-36):
        load.setArray(size * values)
        cycle.apply(load, result)
        found.append(result.array_r / size)
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-5 * abs(found[0]).max())


@pytest.mark.slow
def test_what_its_solves_leave_out_is_in_the_bound(monkeypatch):
    """With the exact static shapes, far beyond what twenty vectors leave out."""
    monkeypatch.setattr(cg, "ITERATION_RESIDUAL", 1e-3)
    direct, iterative = made("direct"), made("iterative")
    loads = np.zeros((direct.rows, 1))
    loads[[-1, -5], 0] = 1.0, 0.5
    static = site_shapes(direct, direct.factorize(), loads)
    found = []
    for part in (direct, iterative):
        run = Lanczos(part, replace(static, solver=part.factorize()))
        for _ in range(21):
            run.advance(part.factorize().solve_block(run.load))
        x = np.linspace(0.5, 3.0, 9) ** 2 * (1 + 0.3j) * 4e7  # the first pole is 3.8e7
        Z = stiffness_at_sites(x, static.k0, *run.parameters(20))[:, 0, 0]
        found.append((Z, run.remainder(20)(x)))
    (exact, left), (Z, bound) = found
    error = abs(Z - exact)
    assert np.all(error > 1e3 * left)
    assert np.all(error <= bound)


BALL = ao.Sphere(radius=0.02, E=210e9, nu=0.3, rho=7800.0, velocity=1.0)
BLOW = (BALL, ao.Hertz(1e10))
STUDIES = {
    "map": lambda part: ao.impact_map(part, "+z", *BLOW, 2e-4, n=6, radius=0.03).peak_force,
    "error of the mesh": lambda part: [
        ao.simulate(ao.extract(part, TIP, n=6, error="estimate"), *BLOW, 2e-4).peak_force
    ],
    "stretch": lambda part: [
        ao.simulate(ao.extract(part, TIP, n=6, stretch=1), *BLOW, 2e-4).peak_force
    ],
    "superposition": lambda part: ao.superposition(part, TIP, 6).omega,
}


@pytest.mark.slow
@pytest.mark.parametrize("study", STUDIES.values(), ids=STUDIES)
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning")
def test_studies_take_the_iterative_solver(study):
    exact, found = (np.asarray(study(made(one))) for one in ("direct", "iterative"))
    np.testing.assert_allclose(found, exact, rtol=1e-4)


@pytest.fixture
def factors_are_slow(monkeypatch):
    """A factor takes as long as two levels with thirty iterations, and parts count as large."""
    monkeypatch.setattr(solver_choice, "LEAST_TIMED_DOFS", 1)
    own = solver_choice.seconds_of_factor

    def thirty(entries: float, columns: float) -> float:
        sizes = LevelSizes(80.0 * made("direct").size, STRAIGHT_PRODUCTS, entries)
        return sizes.cost(30.5, 1.0).seconds if columns < 2 else own(entries, columns)

    monkeypatch.setattr(solver_choice, "seconds_of_factor", thirty)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning")
def test_what_needs_a_factor_has_one(factors_are_slow):
    """Modes and maps ask for more right-hand sides than a model of one site."""
    exact, part = made("direct", supports=[]), made("auto", supports=[])
    first = ao.extract(part, TIP, n=6)
    assert "two levels" in first.info["solver"]
    omega = part.natural_modes(9).omega
    assert type(part.factorize()) is solver_choice.CholmodFactor
    np.testing.assert_allclose(omega[6:], exact.natural_modes(9).omega[6:], rtol=1e-8)
    found = [ao.impact_map(one, "+z", *BLOW, 2e-4, n=6, radius=0.03) for one in (exact, part)]
    np.testing.assert_allclose(found[1].peak_force, found[0].peak_force, rtol=1e-6)
    again = ao.extract(part, TIP, n=6)
    assert again.info["solver"].startswith("factor")
    x = 0.7 * again.omega[1]
    assert first.dynamic_stiffness(x) == pytest.approx(again.dynamic_stiffness(x), rel=1e-6)


OVER_RANKS = """
from antiosc.fem.elements import tetrahedra
from antiosc.fem.linalg import solver

kept = tetrahedra.LEAST_CELLWISE_DOFS, solver.MOST_COARSE_ENTRIES
tetrahedra.LEAST_CELLWISE_DOFS = 0
site = ao.Site((0.15, 0.021, 0.04), (0.1, 0.2, -1), radius=0.032)
found = []
for most, held in ((1e9, []), (0, [ao.Support("left")])):
    solver.MOST_COARSE_ENTRIES = most
    mesh = parts.box((6, 3, 2), cell="tetrahedron")
    part = ao.Structure(mesh, ao.Solid(**parts.STEEL), held, solver="iterative")
    model = ao.extract(part, site, n=8)
    Z = model.dynamic_stiffness(np.array([0.1, 0.7, 1.3]) * model.omega[1])
    steps = part.factorize()._ksp.getIterationNumber() if most else 0
    found.append(["two levels" in model.info["solver"], steps, *np.real(Z)])
print(json.dumps(found))
tetrahedra.LEAST_CELLWISE_DOFS, solver.MOST_COARSE_ENTRIES = kept
"""


@pytest.mark.mpi
def test_over_ranks():
    one, two = (json.loads(run_ranks(n, START + OVER_RANKS)[0]) for n in (1, 2))
    assert all(uses for uses, *_ in two)
    for a, b in zip(two, one, strict=True):
        assert abs(a[1] - b[1]) <= 2  # iterations
    np.testing.assert_allclose([x[2:] for x in two], [x[2:] for x in one], rtol=1e-6)


@pytest.mark.slow
def test_a_proof_takes_a_factor_where_conjugate_gradients_are_faster():
    corners = [[0.0, 0.0, 0.0], [0.2, 0.1, 0.08]]
    kind = dolfinx.mesh.CellType.tetrahedron
    mesh = ao.read_mesh(dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, [20, 10, 8], kind))
    part = ao.Structure(mesh, ao.material("S355"), [ao.Support("-x")])
    assert isinstance(part.factorize(), TwoLevels)
    site = ao.Site((0.18, 0.03, 0.08), (0.0, 0.0, -1.0), radius=0.02)
    model = ao.extract(part, site, n=10, proof=1e-4)
    hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), 1e-4, proof=True)
    low, high = hit.enclosure.peak
    assert low <= hit.peak_force <= high
