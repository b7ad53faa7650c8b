"""The error of k0 by halved meshes, of solids and of beams."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.structure.structure import on_mesh
from antiosc.impact import error_budget
from antiosc.impact.histories.bars import QUANTITIES
from antiosc.reduce.error.beam import excess, halved, interpolation, with_node
from antiosc.reduce.error.beam_facts import WAVES, tube_wall
from parts import frame, line, named

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
BAR = ao.Section.rectangle(width=0.02, height=0.01)
BALL = ao.Sphere(0.01, **STEEL, velocity=1.0)
IMPACT = BALL, BALL.hertz(STEEL["E"], STEEL["nu"]), 2e-4
HELD = [ao.Support("left"), ao.Support("right")]


def budget(mesh, material, site, supports=HELD):  # type: ignore[no-untyped-def]
    part = ao.Structure(mesh, material, supports)
    return ao.simulate(ao.extract(part, site, n=10, error="estimate"), *IMPACT).error_budget


def straight(section: ao.Section = BAR, length: float = 0.3, x: float = 0.5, **options):  # type: ignore[no-untyped-def]
    site = ao.Site((x * length, 0), (0, -1))
    return budget(line(length, 20), ao.Beam(**{**STEEL, **options}, section=section), site)


def test_bars_hold_the_share_of_the_model():
    found = straight()
    shares = [found[name].model for name in QUANTITIES]
    assert 0.005 < max(shares) < 0.1
    assert min(shares) >= 0.5 * max(shares)
    for name in QUANTITIES:
        assert found[name].without_law == pytest.approx(found[name].numerical + found[name].model)
    assert not any("Not included: the error of the beam model" in note for note in found.notes)
    assert "model" in str(found)


def test_all_changes_widen_the_share(monkeypatch):
    """A heavy mass on a short bar: compliance, values, frequencies and clamps all count."""
    part = ao.Structure(line(0.15, 20), ao.Beam(**STEEL, section=BAR), HELD)
    model = ao.extract(part, ao.Site((0.075, 0), (0, -1)), n=10, error="estimate")
    facts = model.info["model"]
    assert facts["clamps"] == pytest.approx(2 * 0.02 / 0.15)
    assert facts["compliance"] == pytest.approx(1 / (210e9 * np.sqrt(0.02 * 0.01)))
    impact = ao.RigidMass(2 * part.mass, 0.1), ao.Hertz(1e10), 2e-3

    def share() -> float:
        return max(bar.model for bar in ao.simulate(model, *impact).error_budget.values())

    whole = share()
    for name in ("LOCAL", "VALUES", "FREQUENCIES", "CLAMP"):
        with monkeypatch.context() as patch:
            patch.setattr(error_budget, name, 0.0)
            assert share() < 0.99 * whole, name
    free = ao.Structure(line(0.15, 20), ao.Beam(**STEEL, section=BAR))
    model = ao.extract(free, ao.Site((0.075, 0), (0, -1)), n=10, error="estimate")
    assert model.info["model"]["clamps"] == 0


REASONS = {
    "full rectangular": lambda: straight(ao.Section.circle(0.01)),
    "shorter than 5": lambda: straight(length=0.09),
    "nearer to an end": lambda: straight(x=0.1),
    "times the other": lambda: straight(ao.Section.rectangle(width=0.03, height=0.01)),
    "Poisson": lambda: straight(nu=0.1),
    "Timoshenko": lambda: straight(shear=False),
}


@pytest.mark.parametrize("reason", list(REASONS))
def test_there_is_no_figure_where_none_was_measured(reason):
    found = REASONS[reason]()
    assert all(bar.model == 0 for bar in found.values())
    (note,) = (each for each in found.notes if "the beam model itself" in each)
    assert reason in note


def test_frames_and_changes_of_section_have_no_figure():
    beam = ao.Beam(**STEEL, section=BAR)
    corner = frame([(0, 0), (0.3, 0), (0.3, 0.3)], [(0, 1), (1, 2)], 10)
    held = [ao.Support(lambda x: np.isclose(x[0], 0))]
    found = budget(corner, beam, ao.Site((0.15, 0), (0, -1)), held)
    assert any("one straight line" in note for note in found.notes)
    mesh = line(0.3, 20).dolfinx
    halves = {"thin": (1, lambda x: x[0] < 0.1501), "thick": (1, lambda x: x[0] > 0.1499)}
    thick = ao.Beam(**STEEL, section=ao.Section.rectangle(0.02, 0.02))
    site = ao.Site((0.09, 0), (0, -1))
    found = budget(named(mesh, halves), {"thin": beam, "thick": thick}, site, held)
    assert any("several sections" in note for note in found.notes)


TUBES = {  # diameter, wall, length, site [m]; mass [kg], velocity [m/s]
    "thick wall": (0.04, 0.003, 0.6, 0.15, 0.5, 1.5),
    "light striker": (0.05, 0.002, 0.4, 0.2, 0.02, 3.0),
    "near an end": (0.05, 0.002, 0.4, 0.07, 0.2, 1.0),
    "thin wall": (0.1, 0.003, 0.8, 0.3, 1.0, 1.0),
}


def tube_of_shells(path, d: float, t: float, length: float, x: float) -> ao.Structure:  # type: ignore[no-untyped-def]
    """A round tube of shells along x with a node at (x, radius, 0)."""
    radius = (d - t) / 2
    size = np.pi * radius / 6
    before, after = (round(part / size) for part in (x, length - x))
    path.write_text(
        f"r = {radius}; Point(1) = {{0, 0, 0}}; Point(2) = {{0, r, 0}}; Point(3) = {{0, 0, r}};\n"
        "Point(4) = {0, -r, 0}; Point(5) = {0, 0, -r};\n"
        "Circle(1) = {2, 1, 3}; Circle(2) = {3, 1, 4}; Circle(3) = {4, 1, 5};\n"
        "Circle(4) = {5, 1, 2}; Transfinite Curve{1:4} = 4;\n"
        f"Extrude {{{x}, 0, 0}} {{Curve{{1:4}}; Layers{{{before}}}; Recombine;}}\n"
        f"Extrude {{{length - x}, 0, 0}} {{Curve{{5:17:4}}; Layers{{{after}}}; Recombine;}}\n"
        "Physical Surface('tube') = {5:100};\n".replace("'", '"')
    )
    return ao.Structure(ao.read_mesh(path, gdim=3), ao.Shell(**STEEL, thickness=t))


@pytest.mark.parametrize("name", list(TUBES))
def test_bars_of_tubes_hold_the_dent_of_the_wall(name, tmp_path):
    """The same tube of shells, whose wall dents, lies within the bars by the share of the model."""
    d, t, length, x, mass, speed = TUBES[name]
    beam = ao.Beam(**STEEL, section=ao.Section.tube(d, t))
    model = ao.extract(
        ao.Structure(line(length, 40), beam), ao.Site((x, 0), (0, -1)), n=20, error="estimate"
    )
    shell_site = ao.Site((x, (d - t) / 2, 0), (0, -1, 0))
    shells = ao.extract(tube_of_shells(tmp_path / "tube.geo", d, t, length, x), shell_site, n=30)
    impact = ao.RigidMass(mass, speed), ao.Hertz(1.5e10), 0.01
    hit, true = (ao.simulate(body, *impact) for body in (model, shells))
    found = hit.error_budget
    for quantity in QUANTITIES:
        off = abs(getattr(true, quantity) / getattr(hit, quantity) - 1)
        assert off <= found[quantity].total, quantity
        assert off > found[quantity].numerical, quantity
    (note,) = (each for each in found.notes if "wall of the tube" in each)
    assert "model of shells" in note
    assert note in hit.summary()
    dent = flexibility(shells) - flexibility(model)
    assert 0.7 < dent / model.info["model"]["dent"] < 1.05


def flexibility(model: ao.AntiOscillators) -> float:
    """Compliance of the site without the rigid motions [m/N]."""
    modes = model.modal()
    elastic = modes.omega > 1e-3 * modes.omega.max()
    return float(np.sum((modes.b[elastic] / modes.omega[elastic]) ** 2) + modes.r)


def test_a_tube_in_a_frame_dents_as_a_straight_one():
    tube = ao.Beam(**STEEL, section=ao.Section.tube(0.04, 0.003))
    corner = frame([(0, 0), (0.6, 0), (0.6, 0.6)], [(0, 1), (1, 2)], 10)

    def dents(mesh: ao.Mesh, point: tuple[float, float], direction: tuple[float, float]) -> object:
        part = ao.Structure(mesh, tube)
        return ao.extract(part, ao.Site(point, direction), n=2, error="estimate").info["model"]

    straight_one = dents(line(0.6, 10), (0.3, 0), (0, -1))
    assert dents(corner, (0.3, 0), (0, -1)) == straight_one
    assert dents(corner, (0.6, 0.3), (1, 0)) == straight_one
    for point, direction in (((0.58, 0), (0, -1)), ((0.02, 0), (0, -1)), ((0.6, 0.58), (1, 0))):
        assert "a joint or a bend" in str(dents(corner, point, direction))
    assert "across its axis" in str(dents(corner, (0.3, 0), (-0.6, -0.8)))


def test_walls_without_a_figure_are_told_to_dent():
    box = ao.Section(A=4e-4, I=1e-7)
    for found in (straight(box), straight(ao.Section.tube(0.04, 0.002), x=0.05)):
        (note,) = (each for each in found.notes if "the beam model itself" in each)
        assert "a model of shells holds" in note
    assert tube_wall(ao.Section.tube(0.04, 0.002)) == pytest.approx((0.019, 0.002))
    for solid in (ao.Section.circle(0.02), ao.Section.tube(0.04, 0.006), BAR):
        assert tube_wall(solid) is None
    tube = ao.Section.tube(0.04, 0.002)  # in a deck without its outline
    area, second = tube.A, tube.I
    assert tube_wall(ao.Section(area, second, J=2 * second)) == pytest.approx((0.019, 0.002))
    for J in (None, 1.4 * second):
        assert tube_wall(ao.Section(area, second, J=J)) is None
    waves = np.arange(2, 2000)
    assert np.sum(waves / (waves**2 - 1) ** 1.5) + 1 / 2000 == pytest.approx(WAVES, rel=1e-4)


@pytest.mark.slow
def test_height_and_width_are_those_along_and_across_the_impact():
    """A beam in space lying on its side is the plane beam with its sides exchanged."""
    facts = []
    upright = ao.Section.rectangle(width=0.01, height=0.02)
    for section, orientation in ((BAR, (0, 1, 0)), (upright, (0, 0, 1))):
        material = ao.Beam(**STEEL, section=section, orientation=orientation)
        mesh = line(0.3, 20, (1.0, 0.0, 0.0))
        part = ao.Structure(mesh, material, HELD)
        site = ao.Site((0.15, 0, 0), (0, -1, 0))
        facts.append(ao.extract(part, site, n=10, error="estimate").info["model"])
    plane = ao.Structure(line(0.3, 20), ao.Beam(**STEEL, section=BAR), HELD)
    site = ao.Site((0.15, 0), (0, -1))
    facts.append(ao.extract(plane, site, n=10, error="estimate").info["model"])
    assert facts[0] == pytest.approx(facts[2], rel=1e-9)
    assert facts[1] == pytest.approx(facts[2], rel=1e-9)
    skew = ao.Site((0.15, 0, 0), (0, -0.6, 0.8))
    part = ao.Structure(
        line(0.3, 20, (1.0, 0.0, 0.0)),
        ao.Beam(**STEEL, section=BAR, orientation=(0, 1, 0)),
        HELD,
    )
    assert "not along a side" in ao.extract(part, skew, n=10, error="estimate").info["model"]


BEAM = ao.Beam(210e9, 0.3, 7850.0, ao.Section.rectangle(0.03, 0.03))
PORTAL = [(0, 0), (0, 1.0), (1.0, 1.0), (1.0, 0)], [(0, 1), (1, 2), (2, 3)]
IN_SPACE = [(0, 0, 0), (0, 1.0, 0.2), (1.0, 1.0, 0)], [(0, 1), (1, 2)]


def portal(n: int, order: int) -> ao.Structure:
    held = [ao.Support(lambda x: np.isclose(x[1], 0))]
    return ao.Structure(frame(*PORTAL, n), BEAM, held, order=order)


def free(n: int, order: int) -> ao.Structure:
    return ao.Structure(line(1.0, n), BEAM, order=order)


def in_space(n: int, order: int) -> ao.Structure:
    held = [ao.Support(lambda x: np.isclose(x[1], 0))]
    return ao.Structure(frame(*IN_SPACE, n), BEAM, held, order=order)


CASES = {
    "portal": (portal, ao.Site((0.5, 1.0), (0, -1))),
    "free": (free, ao.Site((0.25, 0.0), (0, -1))),
    "in space": (in_space, ao.Site((1.0, 1.0, 0.0), (0, 0.6, 0.8))),
}


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", list(CASES))
def test_frequencies_of_the_corrected_model(name, order):
    part, site = CASES[name]
    model = ao.extract(part(8, order), site, n=14, error="estimate")
    fine = ao.extract(part(64, order), site, n=14)
    raw, soft, true = (each.omega[:3] ** 2 for each in (model, model.corrected(), fine))
    assert np.all(raw > (1 + 1e-7) * true)
    assert np.all(np.abs(soft - true) < 0.2 * (raw - true))
    if model.k0 and order == 1:
        assert abs(model.corrected().k0 - fine.k0) < 0.2 * (model.k0 - fine.k0)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_bars_of_an_impact_hold(order):
    part, site = CASES["portal"]
    impact = ao.RigidMass(0.3, 1.0), ao.Hertz(1e8), 0.03
    hit = ao.simulate(ao.extract(part(8, order), site, n=16, error="estimate"), *impact)
    true = ao.simulate(ao.extract(part(48, 2), site, n=60), *impact, tol=1e-6)
    budget = hit.error_budget
    for name in QUANTITIES:
        off = abs(getattr(hit, name) / getattr(true, name) - 1)
        assert off <= budget[name].total
    assert budget.worst < (0.3, 0.05)[order - 1]
    coarse = "the mesh is coarse" in " ".join(budget.notes)
    assert coarse == (order == 1)


@pytest.mark.slow
def test_what_halving_does_not_take():
    part, _ = CASES["portal"]
    with pytest.raises(ao.InputError, match="Site"):
        ao.extract(part(4, 2), ao.Site(dof=20), n=2, error="estimate")


@pytest.mark.slow
def test_halves_keep_groups_and_materials():
    mesh = named(
        line(1.0, 6).dolfinx,
        {"thin": (1, lambda x: x[0] < 0.501), "thick": (1, lambda x: x[0] > 0.499)},
    )
    thick = ao.Beam(210e9, 0.3, 7850.0, ao.Section.rectangle(0.05, 0.05))
    part = on_mesh(ao.Structure(mesh, {"thin": BEAM, "thick": thick}))
    fine = part.again(halved(part.mesh, np.zeros(3)))
    assert fine.mesh.n_cells == 2 * part.mesh.n_cells
    assert fine.total_mass == pytest.approx(part.total_mass, rel=1e-12)
    assert {name: len(g[1]) for name, g in fine.mesh.groups.items()} == {"thin": 6, "thick": 6}
    assert fine.rigid_modes.shape[1] == 3


@pytest.mark.slow
def test_a_node_at_the_site_keeps_groups():
    mesh = named(line(1.0, 6).dolfinx, {"thin": (1, lambda x: x[0] < 0.501)})
    cut = with_node(mesh, np.array([0.4, 0.0, 0.0]))
    assert cut.n_cells == 7
    assert len(cut.groups["thin"][1]) == 4
    assert np.min(np.abs(cut.dolfinx.geometry.x[:, 0] - 0.4)) < 1e-15
    assert with_node(cut, np.array([0.4, 0.0, 0.0])).n_cells == 7


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_interpolated_rigid_motions_have_no_strain(order):
    part = on_mesh(ao.Structure(frame(*IN_SPACE, 3), BEAM, order=order))
    fine = part.again(halved(part.mesh, np.array([0.0, 0.55, 0.11])))
    up = interpolation(part, fine)
    K = csr(fine.K)
    assert np.allclose(up @ np.ones(up.shape[1]), 1.0)
    moved = up @ part.rigid_modes
    assert np.abs(K @ moved).max() < 1e-9 * abs(K).max() * np.abs(moved).max()


@pytest.mark.slow
def test_energies_in_excess_are_what_the_mesh_lacks():
    """Symmetric and exact where they can be; else a matrix that is near, with the same diagonal."""
    root = np.random.default_rng(6).normal(size=(4, 4))
    E = root @ root.T
    np.testing.assert_allclose(excess(E), E, rtol=1e-9)
    askew = E.copy()
    askew[0, 1] += 0.5
    askew[1, 0] -= 0.5
    np.testing.assert_allclose(excess(askew), E, rtol=1e-9)
    size = np.sqrt(np.outer(E.diagonal(), E.diagonal()))
    wild = E.copy()
    wild[0, 3] = wild[3, 0] = -5 * size[0, 3]
    found = excess(wild)
    assert np.linalg.eigvalsh(found)[0] > -1e-9 * found.max()
    np.testing.assert_allclose(found.diagonal(), E.diagonal(), rtol=1e-9)
    off = ~np.eye(4, dtype=bool)
    share = found[off] / np.clip(wild, -size, size)[off]
    assert share == pytest.approx(np.full(12, share[0]))
    assert 0.3 < share[0] < 1
    E[2] = E[:, 2] = 0.0
    np.testing.assert_allclose(excess(E), E, rtol=1e-9, atol=1e-12)
