"""Second-order forces of parts against their whole second-order strain energy and motion."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

import antiosc as ao
from antiosc.base.errors import InputError
from antiosc.base.stresses import von_mises
from antiosc.fem.assembly.assemble import assemble
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.impact.histories import linear_theory
from antiosc.recovery.mesh_fields import recovered
from antiosc.recovery.place import Place, Reach
from antiosc.reduce.extraction.stretching import second_order_energies
from antiosc.strikes import second_order
from antiosc_app import headline
from antiosc_app.scene_file.scene import stress_fields
from antiosc_decks.shared_nodes import SharedNodes
from assemblies import box, line
from full_second_order import Full
from sheets import sheet
from von_karman import Disc

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
SHELL = ao.Shell(thickness=1e-3, **STEEL)
LAYER = ao.Layer(130e9, 9e9, 0.3, 5e9, 5e9, 3.5e9, 1600.0, 0.25e-3)
#: unsymmetric, so that bending stretches the sheet to first order too
LAMINATE = ao.Laminate([replace(LAYER, angle=a) for a in (0, 90, 0, 45)], axis=(1, 0, 0))


def held(mesh, material):
    """A part held along x = 0, x = 0.3 and, if it has a width, y = 0 and y = 0.2."""

    def rim(x):
        ends = np.isclose(x[0] * (0.3 - x[0]), 0)
        return ends | (np.isclose(x[1] * (0.2 - x[1]), 0) if mesh.tdim == 2 else False)

    return ao.Structure(mesh, material, [ao.Support(rim)])


def plate(material=SHELL, cell="triangle", n=(6, 4), rise=0.0):
    """A rectangle, flat or a shallow cap, struck off its centre."""

    def surface(s, t):
        return 0.3 * s, 0.2 * t, 16 * rise * s * (1 - s) * t * (1 - t)

    site = ao.Site((0.1, 0.1, 16 * rise * 2 / 9 / 4), (0, 0, -1), snap=True)
    return held(sheet(n, surface, cell), material), site


def folded():
    def surface(s, t):
        return 0.3 * s, 0.2 * t, 0.05 * (1 - np.abs(2 * s - 1))

    return held(sheet((6, 4), surface), SHELL), ao.Site((0.1, 0.1, 0.033), (0, 0, -1), snap=True)


def bar(cells, material, d):
    """A bar of 0.3 × 0.01 × 0.004 m between two walls."""
    import dolfinx
    from mpi4py import MPI

    if d == 3:
        corners = [(0, 0, 0), (0.3, 0.01, 0.004)]
        kind = dolfinx.mesh.CellType.hexahedron
        made = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, cells, kind)
        site = ao.Site((0.1, 0.005, 0.004), (0, 0, -1), snap=True)
    else:
        corners = [(0, 0), (0.3, 0.004)]
        made = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, cells)
        site = ao.Site((0.1, 0.004), (0, -1), snap=True)
    mesh = ao.read_mesh(made)
    walls = ao.Support(lambda x: np.isclose(x[0] * (0.3 - x[0]), 0))
    return ao.Structure(mesh, material, [walls]), site


def beam_between_walls():
    """A beam of 0.3 m and 0.01 × 0.004 m, struck in the middle."""
    section = ao.Section.rectangle(0.01, 0.004)
    beam = ao.Beam(section=section, orientation=(0, 0, 1), shear=False, **STEEL)
    site = ao.Site((0.15, 0, 0), (0, 0, -1), snap=True)
    return held(line((0, 0, 0), (0.3, 0, 0), 40), beam), site


CASES = {
    "shell": plate,
    "quadrilaterals": lambda: plate(cell="quadrilateral"),
    "laminate": lambda: plate(LAMINATE),
    "cap": lambda: plate(rise=2e-3),
    "folded": folded,
    "solid": lambda: bar((12, 2, 1), ao.Solid(**STEEL), 3),
    "plane stress": lambda: bar((24, 2), ao.Solid(**STEEL, plane="stress", thickness=0.01), 2),
    "plane strain": lambda: bar((24, 2), ao.Solid(**STEEL, plane="strain"), 2),
}
IMPACTS = {**CASES, "beam": beam_between_walls}
#: Mass, speed, stiffness and duration of a blow on a part.
BLOWS = {
    "shell": (0.2, 1.5, 1e6, 4e-3),
    "cap": (0.5, 0.5, 1e7, 4e-3),
    "beam": (0.2, 4.0, 1e6, 4e-3),
    "laminate": (0.1, 1.0, 1e6, 4e-3),
    "folded": (0.2, 1.5, 1e6, 4e-3),
    "solid": (0.2, 2.5, 1e6, 4e-3),
}
SLOW = {"laminate", "folded", "solid"}


@functools.cache
def struck(case):
    """A part, its site, motion (113, dofs), times, forces and deflections of all its dofs."""
    part, site = IMPACTS[case]()
    full = Full(part, site)
    found = full.impact(*BLOWS[case], 112)
    return part, site, full.motion, *found


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of point loads on solids
@pytest.mark.parametrize("case", CASES)
def test_the_forces_have_the_energy_of_second_order_strain(case):
    part, site = CASES[case]()
    model = ao.extract(part, site, n=12, stretch=2)
    forces, body, full = model.stretch, model.modal(), Full(part, site)
    phi = body.field((body.shape @ forces.modes).T).T
    stiffness = forces.modes.T @ (body.omega[:, None] ** 2 * forces.modes)
    rng = np.random.default_rng(0)
    for size, close in ((0.02, 1e-3), (0.1, 3e-2)):
        a = rng.standard_normal((4, forces.size)) * size * 1e-3 / np.abs(phi).max()
        u = a @ phi.T + forces.pairs(a) @ forces.shapes.T
        beyond = [full.energy(each) for each in u] - 0.5 * np.einsum("ni,ij,nj->n", a, stiffness, a)
        found = forces.energy(a)
        scale = np.abs(found).max()
        # what is left is of fifth and sixth order
        assert np.abs(beyond - found).max() < close * scale


@pytest.mark.slow
def test_a_beam_between_walls_has_the_force_of_woinowsky_krieger():
    """F = k w (1 + c w²): the shape of its static deflection stretches by ∫w'²/2 = 12/5 w²/L."""
    part, site = beam_between_walls()
    model = ao.extract(part, site, n=12, stretch=1)
    forces, body = model.stretch, model.modal()
    one = forces.turned(np.eye(forces.size)[:, :1], body.omega)
    seen = float(one.modes[:, 0] @ body.b)
    L, EA = 0.3, 210e9 * 0.01 * 0.004
    static = 24 / 5 / L * 0.5  # of ∫w'²/2 for w = 1 in the middle, clamped at both ends
    energy = EA / (2 * L) * static**2
    assert one.cubic[0, 0, 0, 0] / seen**4 / 4 == pytest.approx(energy, rel=1e-3)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "case", [pytest.param(x, marks=[pytest.mark.slow] * (x in SLOW)) for x in BLOWS]
)
def test_an_impact_is_that_of_all_degrees_of_freedom(case):
    part, site, _, _, force, moved = struck(case)
    mass, speed, k, duration = BLOWS[case]
    model = ao.extract(part, site, n=24, stretch="auto")
    ball = ao.RigidMass(mass, velocity=speed)
    hit = ao.simulate(model, ball, ao.Power(k, 1.5), duration)
    linear = ao.simulate(replace(model, stretch=None), ball, ao.Power(k, 1.5), duration)
    assert abs(np.abs(linear.displacement).max() / moved.max() - 1) > 0.04
    assert hit.peak_force == pytest.approx(force.max(), rel=0.01)
    assert np.abs(hit.displacement).max() == pytest.approx(moved.max(), rel=0.01)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.slow
def test_an_impact_on_a_disc_is_that_of_von_karman():
    """Ritz and DOP853 without a mesh; the disc deflects by 0.9 thicknesses."""
    mass, speed, k, duration = 0.2, 1.75, 2e5, 6e-3
    force, moved = Disc(0.1, 1e-3, **STEEL).impact(mass, speed, k, duration)

    def disc(s, t):
        x, y = 2 * s - 1, 2 * t - 1
        return 0.1 * x * np.sqrt(1 - y * y / 2), 0.1 * y * np.sqrt(1 - x * x / 2), 0 * s

    rim = ao.Support(lambda x: np.hypot(x[0], x[1]) > 0.1 * (1 - 1e-3))
    part = ao.Structure(sheet(8, disc, "triangle", 2), SHELL, [rim])
    model = ao.extract(part, ao.Site((0, 0, 0), (0, 0, -1), snap=True), n=30, stretch="auto")
    hit = ao.simulate(model, ao.RigidMass(mass, speed), ao.Power(k, 1.5), duration)
    assert hit.peak_force == pytest.approx(force, rel=3e-3)
    assert np.abs(hit.displacement).max() == pytest.approx(moved, rel=3e-3)
    assert moved > 0.8e-3


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_free_sheet_stretches_as_all_of_its_degrees_of_freedom():
    """Where it bends in two directions at once; it has rigid-body motions."""
    mesh, site = plate()[0].matrices.mesh, plate()[1]
    part, law = ao.Structure(mesh, SHELL), ao.Power(1e6, 1.5)
    _, force, _ = Full(part, site).impact(0.5, 1.0, 1e6, 6e-3, 240)
    model, ball = ao.extract(part, site, n=24, stretch="auto"), ao.RigidMass(0.5, velocity=1.0)
    assert ao.simulate(model, ball, law, 6e-3).peak_force == pytest.approx(force.max(), rel=3e-3)
    linear = ao.simulate(replace(model, stretch=None), ball, law, 6e-3)
    assert linear.peak_force < 0.9 * force.max()
    many = ao.simulate_many(model, ball, law, 6e-3)
    assert many.peak_force[0] == ao.simulate(model, ball, law, 6e-3).peak_force
    struck = ao.strike(part, site, ball, law, 6e-3, tol=0.1)
    assert struck.peak_force == pytest.approx(force.max(), rel=3e-3)


@pytest.mark.slow
@pytest.mark.filterwarnings("error:.*deflects by")
def test_strike_takes_second_order_forces_where_the_linear_deflection_asks_for_them():
    part, site, _, _, force, _ = struck("shell")
    blow = ao.Power(1e6, 1.5), 4e-3
    hit = ao.strike(part, site, ao.RigidMass(0.2, velocity=1.5), *blow, tol=0.1)
    assert hit.peak_force == pytest.approx(force.max(), rel=0.01)
    assert hit.error_budget["peak_force"].stretch > 0
    slow = ao.strike(part, site, ao.RigidMass(0.2, velocity=0.01), *blow, tol=0.1)
    assert slow.model.stretch is None


def thin(solid):
    """A clamped plate of 0.2 × 0.2 × 0.002 m with a site in its middle."""
    sides = (0.2, 0.2, 0.002) if solid else (0.2, 0.2)
    steel = ao.Solid(**STEEL) if solid else ao.Shell(thickness=0.002, **STEEL)
    edges = [ao.Support(side) for side in ("-x", "+x", "-y", "+y")]
    patch = 0.006 if solid else None
    refine = [((0.1, 0.1, 0.002), 0.006)] if solid else []
    part = ao.Structure(ao.box_mesh(sides, 0.02, refine=refine), steel, edges)
    return part, ao.Site((0.1, 0.1, 0.002 * solid), (0, 0, -1), radius=patch, snap=True)


@pytest.mark.slow
def test_the_corrected_model_stretches_in_the_same_motions():
    """The free modes of both differ; the motions on which the forces act do not."""
    part, site = thin(solid=True)
    raw = ao.extract(part, site, n=12, stretch=4, error="estimate")
    soft = raw.corrected()
    motions = [motions_of(model) for model in (raw, soft)]
    assert motions[1] == pytest.approx(motions[0], abs=1e-6 * abs(motions[0]).max())


def motions_of(model):
    """The displacements (dofs, m) of the motions of second-order forces."""
    body = model.free_modes
    return body.field((body.shape @ model.stretch.modes).T).T


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_beam_between_walls_is_pulled_as_it_bends():
    """N = EA ∫w'²/(2L) = 12/5 EA (w/L)² of a static deflection w under a force in the middle."""
    part, site = beam_between_walls()
    model = ao.extract(part, site, n=12, stretch=2)
    hit = ao.simulate(model, ao.RigidMass(20.0, velocity=0.4), ao.Linear(1e5), 80e-3)
    k = int(np.argmax(np.abs(hit.displacement)))
    pull = 12 / 5 * 210e9 * 0.01 * 0.004 * (hit.displacement[k] / 0.3) ** 2
    found = ao.probe(part, hit, (0.1, 0, 0), "section_forces", [hit.time[k]])[0]
    assert found[0] == pytest.approx(pull, rel=0.01)
    largest = ao.peak_field(part, hit, fibre=(0.0, 0.0))
    assert largest.values.max() == pytest.approx(pull / (0.01 * 0.004), rel=0.01)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_reactions_of_a_part_that_stretches_are_refused():
    part, site = beam_between_walls()
    model = ao.extract(part, site, n=12, stretch=2)
    hit = ao.simulate(model, ao.RigidMass(20.0, velocity=0.4), ao.Linear(1e5), 1e-3)
    with pytest.raises(InputError, match="stretches"):
        ao.reactions(part, hit, site)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("case", "place"),
    [("shell", (0.08, 0.09, 0.0)), ("cap", (0.03, 0.03, 0.0)), ("solid", (0.03, 0.006, 0.0))],
)
def test_stresses_are_those_of_all_degrees_of_freedom(case, place):
    """Whole strains of the nodal displacements of the reference, on both faces of a sheet."""
    part, site, motion, times, _, _ = struck(case)
    mass, speed, k, duration = BLOWS[case]
    times = times[::8]
    model = ao.extract(part, site, n=24, stretch="auto")
    ball = ao.RigidMass(mass, velocity=speed)
    hit = ao.simulate(model, ball, ao.Power(k, 1.5), duration)
    linear = ao.simulate(replace(model, stretch=None), ball, ao.Power(k, 1.5), duration)
    for surface in ("top", "middle", "bottom") if case != "solid" else ("top",):
        asked = np.array([place]), None, "stress", Place(surface), Reach("the point")
        known = recovered(part, motion[::8].T, *asked, second_order=True)[0]
        known = von_mises(np.moveaxis(known, -1, 0))
        sides = {} if case == "solid" else {"surface": surface}
        found, flat = (
            von_mises(ao.probe(part, one, place, "stress", times, **sides)) for one in (hit, linear)
        )
        assert found == pytest.approx(known, abs=0.03 * known.max())
        assert np.abs(flat - known).max() > 0.12 * known.max()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_peaks_of_a_part_that_stretches_are_those_of_dense_times(tmp_path):
    part, site = plate()
    model = ao.extract(part, site, n=24, stretch=4)
    hit = ao.simulate(model, ao.RigidMass(0.2, velocity=1.5), ao.Power(1e6, 1.5), 3e-3)
    times = np.linspace(0, 3e-3, 4001)
    for quantity in ("von_mises", "velocity"):
        peak = ao.peak_field(part, hit, quantity)
        dense = ao.peak_field(part, hit, quantity, times)
        scale = dense.values.max()
        assert peak.values == pytest.approx(dense.values, abs=1e-3 * scale)
        assert peak.error is None
    moved = ao.probe(part, hit, (0.1, 0.05, 0.0), "displacement", times)
    speed = ao.probe(part, hit, (0.1, 0.05, 0.0), "velocity", times)
    sums = cumulative_trapezoid(speed, times, axis=0, initial=0)
    assert np.abs(sums - moved)[:, 0].max() < 0.01 * np.abs(moved[:, 0]).max()
    ao.save_fields(part, hit, tmp_path / "saved.npz", times[::100])
    saved = np.load(tmp_path / "saved.npz")
    node = int(np.argmin(np.linalg.norm(saved["points"] - [0.1, 0.05, 0.0], axis=1)))
    assert saved["factors"][20] @ saved["shapes"][node].T == pytest.approx(moved[2000], rel=1e-6)


@pytest.mark.slow
def test_parts_with_common_nodes_stretch_as_one_mesh():
    """A plate in two meshes: tensors, forces and motion."""
    part, site = plate(n=(6, 4))
    mesh = part.mesh
    x = mesh.dolfinx.geometry.x
    cells = compat.geometry_nodes(mesh.dolfinx)
    left = x[cells].mean(axis=1)[:, 0] < 0.15
    meshes, numbers = {}, {}
    for name, chosen in (("left", cells[left]), ("right", cells[~left])):
        used, renumbered = np.unique(chosen, return_inverse=True)
        of_cells = renumbered.reshape(chosen.shape).astype(np.int64)
        made = compat.create_mesh(mesh.comm, of_cells, x[used], mesh.cell, mesh.order)
        meshes[name], numbers[name] = ao.Mesh(made), used
    whole = assemble(
        {name: held(each, SHELL) for name, each in meshes.items()}, [SharedNodes(numbers)]
    )
    ball, law = ao.RigidMass(0.2, velocity=1.0), ao.Power(1e6, 1.5)
    models = [ao.extract(structure, site, n=24, stretch="auto") for structure in (part, whole)]
    one, two = (ao.simulate(model, ball, law, 4e-3) for model in models)
    assert two.assembly.stretch_forces
    assert models[1].stretch.cubic[0, 0, 0, 0] == pytest.approx(
        models[0].stretch.cubic[0, 0, 0, 0], rel=1e-6
    )
    assert two.peak_force == pytest.approx(one.peak_force, rel=1e-4)  # of the steps
    deflections = [np.abs(hit.displacement).max() for hit in (one, two)]
    assert deflections[1] == pytest.approx(deflections[0], rel=1e-3)


def test_what_does_not_stretch_refuses_in_a_sentence():
    part, site = plate()
    for wrong in (19, "many", 0, True):
        with pytest.raises(InputError, match="stretch"):
            ao.extract(part, site, n=12, stretch=wrong)
    ends = [ao.Support(lambda x: np.isclose(x[0], 0)), ao.Support(lambda x: x[0] > 0.2, ["y", "z"])]
    truss = ao.Structure(line((0, 0, 0), (0.3, 0, 0), 1), ao.Truss(area=1e-4, **STEEL), ends)
    with pytest.raises(InputError, match="stretch"):
        ao.extract(truss, ao.Site((0.3, 0, 0), (1, 0, 0)), n=0, stretch="auto")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_friction_on_a_sheet_that_stretches_keeps_the_books():
    """A body that slides throughout: its momentum along is μ times the impulse across."""
    part, site = plate()
    sites = {"spot": replace(site, tangential=True)}
    model = ao.extract(part, sites, n=24, stretch=4)
    slider = ao.RigidBody(0.2, (1.0,) * 3, {"foot": ((0, 0, -0.01), (0, 0, 1))})  # hardly turns
    contact = ao.Contact("plate:spot", "slider:foot", ao.Power(1e6, 1.5), friction=0.1)
    start = {"slider": ao.Motion(velocity=(0.8, 0.0, -1.5))}
    hit = ao.Scene({"plate": model, "slider": slider}, [contact], motion=start).run(6e-3)
    assert set(hit.assembly.stretch_forces) == {"plate"}
    assert hit.energy.drift < 1e-5
    across = hit.contact_histories[0].impulse
    velocity = hit.at([6e-3])["slider"].velocity("foot", (1, 0, 0))[0]
    assert 0.2 * (0.8 - velocity) == pytest.approx(0.1 * across, rel=1e-3)
    assert hit.energy.dissipated[-1] == pytest.approx(0.1 * across * (0.8 + velocity) / 2, rel=0.05)


@pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning")
def solid_plate(rim):
    """A plate of solids, 100 × 80 × 4 mm, held where `rim` says."""
    mesh = box((0, 0, 0), (0.1, 0.08, 0.004), (8, 8, 1))
    return ao.Structure(mesh, ao.Solid(**STEEL), [ao.Support(rim)])


def on_rim(x):
    return np.isclose(x[0] * (0.1 - x[0]), 0) | np.isclose(x[1] * (0.08 - x[1]), 0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_solid_that_hardly_stretches_is_taken_as_linear():
    """The share of its bar holds what all degrees of freedom change; a harder blow stretches."""
    part = solid_plate(on_rim)
    site = ao.Site((0.05, 0.032, 0.004), (0, 0, -1), snap=True, radius=0.012)
    model = ao.extract(part, site, n=30, error="estimate")
    mass, k, duration = 0.05, 5e9, 4e-4

    def struck(speed):
        ball = ao.RigidMass(mass, velocity=speed)
        law = ao.Power(k, 1.5)
        run = functools.partial(ao.simulate, impactor=ball, contact=law, duration=duration)
        return second_order.simulated(part, model, run)

    slight = struck(30.0)
    assert not slight.assembly.stretch_forces
    assert 0.01 < slight.assembly.omitted_stretch_ratio < second_order.SLIGHT_ENERGY_RATIO
    full = Full(part, site)
    whole = full.impact(mass, 30.0, k, duration, 150)[1].max()
    full.forces, full.tangent = np.zeros_like, lambda _: csr(part.K) * 0
    effect = whole / full.impact(mass, 30.0, k, duration, 150)[1].max() - 1
    assert 2e-4 < abs(effect) < slight.error_budget["peak_force"].stretch < 0.08
    assert "taken as linear" in " ".join(slight.stretch_texts)
    harder = struck(60.0)
    assert harder.assembly.stretch_forces
    assert harder.assembly.omitted_stretch_ratio == 0.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_energies_of_second_order_strain_follow_the_amplitude():
    """Third and fourth order, the first as the derivatives of the whole energy have it."""
    part = solid_plate(on_rim)
    site = ao.Site((0.05, 0.04, 0.004), (0, 0, -1), snap=True, radius=0.012)
    model = ao.extract(part, site, n=20)
    body = model.free_modes
    static = body.field(body.shape @ (body.B[:, 0] / body.omega**2))
    motion = 2e-4 * static / np.abs(static).max()
    factors = np.array([1.0, 2.0, 4.0])
    energies = second_order_energies(part, motion[:, None] * factors)
    third, fourth = np.linalg.solve(np.column_stack([factors, factors**2])[:2], energies[:2])
    assert energies[2] == pytest.approx(4 * third + 16 * fourth, rel=1e-6)
    full = Full(part, site)
    linear = motion @ csr(part.K) @ motion / 2
    sizes = [full.energy(sign * motion) / linear - 1 for sign in (1, -1)]
    assert third == pytest.approx(abs(sizes[0] - sizes[1]) / 2, rel=1e-6)
    assert 0 < fourth < (sizes[0] + sizes[1]) / 2  # there what follows is not relaxed


@pytest.mark.slow
@pytest.mark.parametrize("solid", [False, True])
def test_a_blow_far_beyond_second_order_strain_is_refused_at_once(solid, monkeypatch):
    """A foil of 0.2 mm under 20 g took 8 minutes for bars of 3100 %."""
    part, site = thin(solid)

    def never(*_):
        raise AssertionError("second-order forces are of no use here")

    monkeypatch.setattr(second_order, "with_stretch", never)
    ball = ao.RigidMass(100.0, 6.0)
    with pytest.warns(ao.AccuracyWarning, match="deflects by") as warned:
        hit = ao.strike(part, site, ball, ao.Hertz(5e9), 40e-3, tol=0.5)
    assert hit.assembly.omitted_stretch_ratio == 0.0
    told = hit.assembly.theory_warning
    assert "no number here does" in told
    sentences = [str(one.message) for one in warned]
    assert [one for one in sentences if "deflects by" in one] == [told]
    assert told in hit.message
    assert "stretch" not in hit.message.replace(told, "")
    assert (
        second_order.second_order_energy_ratio(part, hit) > 0.8 * second_order.HOPELESS_ENERGY_RATIO
    )
    deflection = linear_theory.largest_deflection(hit, "structure")
    assert deflection > 12 * 2e-3
    budget = hit.error_budget
    assert budget.no_bar
    assert budget["peak_force"].total is None
    assert budget.unknown["mesh"].startswith("The part deflects by ")
    assert stress_fields(part, hit) == {}
    assert " deflects by " in headline.caution_of_impact(hit, budget)
