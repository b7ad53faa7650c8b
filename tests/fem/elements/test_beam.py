"""Timoshenko beams: sections, the classical element, exact static solutions, rotation in space."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import scipy.linalg
import scipy.sparse.linalg
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc import closed_form
from antiosc.base.errors import AntioscWarning
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from parts import STEEL, box, line, plate
from sheets import PLY

pytestmark = pytest.mark.fem

FLAT = ao.Section.rectangle(width=0.02, height=0.05)


def beam(section: ao.Section = FLAT, **extra) -> ao.Beam:
    return ao.Beam(**parts.ALUMINIUM, section=section, **extra)


def dofs_at(structure: ao.Structure, point, names) -> list[int]:
    """The dofs of the components `names` at the node nearest to `point`."""
    found = []
    for name in names:
        dofs, x = compat.dof_coordinates(structure.form.space, structure.form.components[name])
        target = np.zeros(3)
        target[: len(point)] = point
        found.append(int(dofs[np.argmin(np.linalg.norm(x - target, axis=1))]))
    return found


def solve(structure: ao.Structure, point, loads: dict[str, float]) -> dict[str, float]:
    """Motions at `point` under forces and moments there."""
    f = np.zeros(structure.K.getSize()[0])
    f[dofs_at(structure, point, loads)] = list(loads.values())
    u = scipy.sparse.linalg.spsolve(csr(structure.K).tocsc(), f)
    return {n: u[dofs_at(structure, point, [n])[0]] for n in structure.form.components}


# --- Sections -------------------------------------------------------------------------------------


def test_sections_by_their_definitions():
    r = ao.Section.rectangle(0.02, 0.05)
    assert (r.A, r.I, r.side) == pytest.approx((1e-3, 0.02 * 0.05**3 / 12, 0.05 * 0.02**3 / 12))
    square = ao.Section.rectangle(0.1, 0.1)
    assert square.torsion == pytest.approx(0.140577 * 1e-4, rel=1e-5)  # Timoshenko & Goodier, §109
    strip = ao.Section.rectangle(1.0, 1e-3)
    assert strip.torsion == pytest.approx(1e-9 / 3 * (1 - 0.630249e-3), rel=1e-6)
    d = ao.Section.circle(0.04)
    np.testing.assert_allclose([d.A, d.I], [np.pi * 0.02**2, np.pi * 0.02**4 / 4])
    assert d.torsion == pytest.approx(np.pi * 0.02**4 / 2)
    tube = ao.Section.tube(0.04, 0.001)
    thin = np.pi * 0.039 * 0.001
    np.testing.assert_allclose(tube.A, thin, rtol=1e-12)
    np.testing.assert_allclose(tube.I, thin * 0.0195**2 / 2, rtol=1e-3)
    full = ao.Section.tube(0.04, 0.02 * (1 - 1e-9))
    np.testing.assert_allclose(full.I, d.I, rtol=1e-8)


# --- One element ----------------------------------------------------------------------------------


# --- Mass and rigid motions -----------------------------------------------------------------------


# --- Statics --------------------------------------------------------------------------------------


@pytest.mark.sample
@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0, 1), (2, -1, 2)])
@pytest.mark.parametrize("order", [1, 2])
def test_orientation_in_space(direction, order):
    """Forces along and across the height, a torque and a pull, on a cantilever in space."""
    L = 0.6
    t = np.asarray(direction) / np.linalg.norm(direction)
    tilted = np.array([0.2, 1.0, 0.3])
    y = tilted - tilted @ t * t
    y /= np.linalg.norm(y)
    z = np.cross(t, y)
    b = beam(orientation=tuple(tilted))
    n = 4 if order == 2 else 40
    structure = ao.Structure(parts.line(L, n, direction), b, [ao.Support("left")], order=order)
    tip = L * t
    A, G, E = FLAT.A, b.G, b.E
    # the classical element's only error is known: see test_linear_elements_do_not_lock
    lack = 0 if order == 2 else (L / n) ** 2 / 12
    for axis, compliance in [
        (t, L / E / A),
        (y, L**3 / 3 / E / FLAT.I + L / G / A / FLAT.shear - L * lack / E / FLAT.I),
        (z, L**3 / 3 / E / FLAT.side + L / G / A / FLAT.shear - L * lack / E / FLAT.side),
    ]:
        u = solve(structure, tip, dict(zip("xyz", axis, strict=True)))
        moved = np.array([u[c] for c in "xyz"])
        np.testing.assert_allclose(moved, compliance * axis, rtol=0, atol=2e-8 * compliance)
    twisted = solve(structure, tip, dict(zip(("rx", "ry", "rz"), t, strict=True)))
    turn = np.array([twisted[c] for c in ("rx", "ry", "rz")])
    np.testing.assert_allclose(
        turn, L / G / FLAT.torsion * t, rtol=1e-8, atol=1e-12 * np.abs(turn).max()
    )


# --- Meshed beams against the closed forms: anti-oscillators, and the order at which they conve


LENGTH = 1.0
WIDTH = 0.0141421356237  # the article's case 2: 2 cm², 0.33 cm⁴
SECTION = ao.Section.rectangle(WIDTH, WIDTH)
BEAM = ao.Beam(E=67e9, nu=0.33, rho=2400.0, section=SECTION)
EXACT = closed_form.UniformBeam.timoshenko(
    E=67e9, nu=0.33, rho=2400.0, area=SECTION.A, inertia=SECTION.I, length=LENGTH
)
PIN, CLAMP = ("x", "y"), "all"
# ends held, site, closed form
CASES = {
    "cantilever, tip": ([("left", CLAMP)], 1.0, closed_form.cantilever(EXACT)),
    "pinned-pinned, mid-span": (
        [("left", PIN), ("right", "y")], 0.5, closed_form.pinned_pinned(EXACT)
    ),
    "pinned-free, tip": ([("left", PIN)], 1.0, closed_form.pinned_free(EXACT)),
    "free-free, at 0.3 L": ([], 0.3, closed_form.free_free(EXACT, 0.3)),
}  # fmt: skip
N = 5


def meshed(name: str, elements: int, order: int, n: int = N) -> ao.AntiOscillators:
    ends, site, _ = CASES[name]
    supports = [ao.Support(*end) for end in ends]
    structure = ao.Structure(parts.line(LENGTH, elements), BEAM, supports, order=order)
    return ao.extract(structure, ao.Site((site * LENGTH, 0), (0, 1)), n=n, method="modes")


def errors(model: ao.AntiOscillators, exact: ao.AntiOscillators) -> dict[str, np.ndarray]:
    return {
        "omega": np.abs(model.omega / exact.omega - 1),
        "m": np.abs(model.m / exact.m - 1),
    }


@pytest.mark.parametrize(("order", "rate"), [(2, 4.0), (1, 2.0)])
@pytest.mark.parametrize("name", CASES)
@pytest.mark.slow
def test_order_of_convergence(name, order, rate):
    """h⁴ with quadratic elements and two-point shear, h² with linear ones and one-point shear."""
    exact = CASES[name][2].anti_oscillators(N)
    counts = np.array([20, 40, 80]) if order == 2 else np.array([40, 80, 160])
    models = [meshed(name, int(count), order) for count in counts]
    for quantity in ("omega", "m"):
        found = np.array([errors(model, exact)[quantity] for model in models])
        rates = np.log2(found[-2] / found[-1])[1:4]  # the first mode reaches rounding
        assert rates.min() > rate - 0.25, (quantity, found)
        if quantity == "omega":  # the masses of some sites converge faster
            assert rates.max() < rate + 0.25, found


def test_a_solid_bar_becomes_the_beam():
    """Two-dimensional elasticity at a tenth in thickness: Timoshenko's k0 and first frequencies."""
    L, h, t = 1.0, 0.1, 0.02
    mesh = parts.plate((40, 4), (L, h))
    solid = ao.Solid(E=67e9, nu=0.3, rho=2400.0, plane="stress", thickness=t)
    structure = ao.Structure(mesh, solid, [ao.Support("left")])
    with pytest.warns(AntioscWarning, match="point"):
        model = ao.extract(structure, ao.Site((L, h / 2), (0, -1)), n=3, method="modes")
    exact = closed_form.cantilever(
        closed_form.UniformBeam.timoshenko(
            E=67e9, nu=0.3, rho=2400.0, area=h * t, inertia=t * h**3 / 12, length=L
        )
    ).anti_oscillators(3)
    np.testing.assert_allclose(model.omega[:2], exact.omega[:2], rtol=0.01)
    assert model.k0 == pytest.approx(exact.k0, rel=0.01)
    assert model.m_st == pytest.approx(exact.m_st, rel=0.01)


def test_a_beam_beside_its_line_is_the_same_beam():
    """Its modes and what the ground moves; at the line twist adds e²L/(GJ) to what gives way."""
    section, L, e = ao.Section.rectangle(0.03, 0.01), 0.5, 0.05
    beams = [
        ao.Structure(
            parts.line(L, 20, (1.0, 0.0, 0.0)),
            ao.Beam(**parts.STEEL, section=section, orientation=(0, 0, 1), offset=offset),
            [ao.Support("left")],
        )
        for offset in (0.0, e)
    ]
    plain, beside = (beam.natural_modes(6) for beam in beams)
    np.testing.assert_allclose(beside.omega, plain.omega, rtol=1e-9)
    np.testing.assert_allclose(beside.effective_mass, plain.effective_mass, atol=1e-9)
    side = ao.Site((L, 0, 0), (0, 1, 0))
    before, after = (1 / ao.extract(beam, side, 4).k0 for beam in beams)
    G = parts.STEEL["E"] / (2 * (1 + parts.STEEL["nu"]))
    assert after - before == pytest.approx(e**2 * L / (G * section.torsion), rel=1e-8)
    model = ao.extract(beams[1], side, 4)
    hit = ao.simulate(model, ao.RigidMass(1.0, 0.1), ao.Linear(1e4), 1e-3)
    held = ao.reactions(beams[1], hit, side, [1e-3])
    root = ao.probe(beams[1], hit, (0.0, 0, 0), "section_forces", [1e-3])[0]
    assert root[2] == pytest.approx(held.total[0, 1], rel=0.02)


# --- What element families tell of a part: its dimensions, its constants, its own indentation -----


ROUND, OBLONG = ao.Section.circle(0.1), ao.Section.rectangle(0.1, 0.2)


def arc() -> ao.Mesh:
    """One line of order 2."""
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0.1, 0]])
    mesh = compat.create_mesh(MPI.COMM_SELF, np.array([[0, 1, 2]]), x, "interval", 2)
    return ao.read_mesh(mesh)


def test_local_indentation_is_that_of_a_half_space_or_none():
    """Johnson's (3.41a) and (3.91a), weighted by the pressure; families without depth have none."""
    E, nu = STEEL["E"], STEEL["nu"]
    along, across = 0.6 * (1 - nu**2) / E, 0.3 * (2 - nu) * (1 + nu) / E
    steel = ao.Solid(**STEEL)
    for cosine in (0.0, 0.6, 1.0):
        exact = cosine**2 * along + (1 - cosine**2) * across
        assert steel.half_space_compliance(cosine) == pytest.approx(exact, rel=1e-12)
    section = ao.Section.circle(0.01)
    for other in (
        ao.Solid(**STEEL, plane="strain"),
        ao.Shell(**STEEL, thickness=0.01),
        ao.Laminate([PLY]),
        ao.Beam(**STEEL, section=section),
        ao.Truss(**STEEL, area=1e-4),
    ):
        assert other.half_space_compliance(0.6) == 0.0


@pytest.mark.parametrize(
    ("mesh", "material", "words"),
    [
        (lambda: line(1.0, 2), ao.Solid(**STEEL), "has interval cells in 2-D"),
        (lambda: plate((1, 1)), ao.Truss(**STEEL, area=1e-4), "Truss needs a mesh of lines"),
        (lambda: plate((1, 1)), ao.Beam(**STEEL, section=ROUND), "Beam needs a mesh of lines"),
        (lambda: arc(), ao.Beam(**STEEL, section=ROUND), "Beam elements are straight"),
        (lambda: arc(), ao.Truss(**STEEL, area=1e-4), "bars of a Truss are straight"),
        (lambda: line(1.0, 2), ao.Shell(**STEEL, thickness=0.1), "Shell needs a mesh of triangles"),
        (lambda: box((1, 1, 1)), ao.Laminate([PLY]), "Laminate needs a mesh of triangles"),
        (lambda: plate((1, 1)), ao.AnisotropicSolid(np.eye(6) * 1e9, 1e3), "is for 3-D meshes"),
        (
            lambda: line(1.0, 2),
            ao.Beam(**STEEL, section=OBLONG, orientation=(0, 1, 0), offset=0.1),
            "offset applies to beams in space",
        ),
        (
            lambda: line(1.0, 2, (1.0, 0, 0)),
            ao.Beam(**STEEL, section=OBLONG),
            "orientation",
        ),
    ],
)  # fmt: skip
def test_meshes_of_other_families_are_refused(mesh, material, words):
    with pytest.raises(ao.InputError, match=words):
        ao.Structure(mesh(), material)
