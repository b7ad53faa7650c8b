"""Margins of safety, and strains, stresses and section forces of given displacement fields."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

import antiosc as ao
import parts
import sheets
from antiosc.base.stresses import extreme_principal
from antiosc.base.texts import engineering
from antiosc.engine.contact.geometry import hertz_stresses, von_mises
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.structure.structure import on_mesh
from antiosc.fields.margin import ExcludedZones, NodalExposures, judged_margin
from antiosc.impact.histories.verdict import PLASTIC_ZONE_RADII, ContactZone
from antiosc.recovery import mesh_fields
from antiosc.recovery.place import Place
from antiosc.recovery.tensors import PointsInCells, SheetAxes, evaluator, middle_strains
from sheets import sheet as mapped
from static_loads import held

YIELD = 250e6


@pytest.fixture(scope="module")
def strip():
    """A cantilever strip, as a plane part: 0.2 m long, 20 mm high, 10 mm thick."""
    solid = ao.Solid(210e9, 0.0, 7850.0, plane="stress", thickness=0.01, yield_strength=YIELD)
    part = ao.Structure(parts.plate((20, 4), (0.2, 0.02)), solid, [ao.Support("left")])
    return held(part, ao.Site((0.2, 0.01), (0, -1), radius=6e-3), 100.0)


def test_the_margin_of_a_cantilever_is_that_of_bending_at_its_surface(strip):
    part, hit = strip
    expected = 6 * 100.0 * 0.2 / (0.01 * 0.02**2)  # F L/W at the clamp
    peak = ao.peak_field(part, hit, body="part")
    worst = peak.margin()
    assert worst.value == pytest.approx(expected, rel=0.02)
    assert worst.point[0] == pytest.approx(0.0, abs=1e-9)
    assert (worst.criterion, worst.strength) == ("yield", YIELD)
    assert worst.margin == pytest.approx(YIELD / worst.value - 1)
    assert not worst.reached
    np.testing.assert_allclose(peak.exposure, peak.values / YIELD)
    assert "it stays elastic" in peak.summary()


def test_without_a_strength_there_is_no_margin(strip):
    part, hit = strip
    with pytest.raises(ao.InputError, match="yield_strength"):
        ao.peak_field(part, hit, "displacement", body="part").margin()
    with pytest.raises(ao.InputError, match="Strengths"):
        ao.peak_field(part, hit, "tsai_wu", body="part")


#: Strengths of carbon and epoxy, Pa.
PLY = ao.Strengths(X_t=1500e6, X_c=1200e6, Y_t=40e6, Y_c=200e6, S=70e6, interlaminar=60e6)


def test_tsai_hill_of_an_off_axis_ply_is_the_closed_form():
    """Uniaxial strength σ: 1/σ² = c⁴/X² − c²s²/X² + s⁴/Y² + c²s²/S² (Azzi, Tsai 1965)."""
    for degrees in (0, 15, 30, 60, 90):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        stress = np.zeros((3, 3))
        stress[:2, :2] = [[c * c, -c * s], [-c * s, s * s]]  # 1 Pa along x, in the ply's axes
        X, Y, S = PLY.X_t, PLY.Y_t, PLY.S
        squared = (c**4 - c**2 * s**2) / X**2 + s**4 / Y**2 + c**2 * s**2 / S**2
        assert PLY.tsai_hill(1e6 * stress) == pytest.approx(1e6 * squared**0.5)


@pytest.mark.slow
def test_plies_of_a_cantilever_fail_in_compression_and_delaminate_in_the_middle():
    """A strip of 0° plies: σ1 = 6 F L/(b h²) at the clamp, τ13 = 3 F/(2 b h) in the middle."""
    b, h, L, F = 0.02, 4e-3, 0.18, 10.0
    layer = ao.Layer(
        **{"E1": 140e9, "E2": 9e9, "nu12": 0.0, "G12": 5e9, "G13": 5e9, "G23": 3e9},
        rho=1600.0, thickness=h / 2, strength=PLY,
    )  # fmt: skip
    mesh = sheets.sheet((20, 2), lambda s, t: (0.2 * s, b * t, 0 * s), "quadrilateral")
    end = ao.Support(lambda x: x[0] < 1e-9)
    part = ao.Structure(mesh, ao.Laminate([layer] * 2), [end])
    part, hit = held(part, ao.Site((L, b / 2, 0), (0, 0, -1), radius=6e-3), F)
    hill = ao.peak_field(part, hit, "tsai_hill", body="part")
    worst = hill.margin()
    assert worst.exposure == pytest.approx(6 * F * L / (b * h**2) / PLY.X_c, rel=0.02)
    assert worst.layer == "layer 0 (bottom)"  # it is pressed down: compression below
    shear = ao.peak_field(part, hit, "delamination", body="part")
    k = np.argmin(np.linalg.norm(shear.points - (L / 2, b / 2, 0), axis=1))
    assert shear.values[k] == pytest.approx(1.5 * F / (b * h) / PLY.interlaminar, rel=0.02)
    assert "layer 0" in hill.summary()
    with pytest.raises(ao.InputError, match="yield_strength"):
        ao.peak_field(part, hit, body="part").margin()


@pytest.mark.parametrize("round_", [False, True])
def test_stress_in_the_outline_of_a_beam_is_that_of_oblique_bending(round_):
    """σ = M_y z/I_y + M_z y/I_z at a corner, √(M_y² + M_z²) r/I on a circle, at the clamp."""
    h, b = 0.02, 0.01
    section = ao.Section.circle(h) if round_ else ao.Section.rectangle(b, h)
    mesh = parts.line(0.5, 20, (1.0, 0.0, 0.0))
    beam = ao.Beam(210e9, 0.3, 7850.0, section, orientation=(0, 1, 0))
    d = np.array([0.0, 0.6, 0.8])
    part, hit = held(ao.Structure(mesh, beam, [ao.Support("left")]), ao.Site((0.5, 0, 0), d), 20.0)
    My, Mz = 20.0 * 0.5 * d[2], 20.0 * 0.5 * d[1]
    corner = My * b / 2 / section.side + Mz * h / 2 / section.I
    expected = 10.0 * h / 2 / section.I if round_ else corner
    values = ao.peak_field(part, hit, body="part").values
    assert values.max() == pytest.approx(expected, rel=6e-3 if round_ else 1e-6)


# --- Stresses at surfaces and their estimated errors: a hole (Kirsch), corners, edges of suppor


STEEL = ao.Solid(210e9, 0.3, 7850.0, plane="stress")


def kirsch(x: np.ndarray, a: float, stress: float) -> np.ndarray:
    """Displacements (n, 2) around a hole under `stress` along x, plane stress (G. Kirsch, 1898)."""
    r, t = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
    G, k, s = 210e9 / 2.6, (3 - 0.3) / 1.3, a / r
    u = (k + 1) * np.cos(t) / s + 2 * s * ((1 + k) * np.cos(t) + np.cos(3 * t))
    v = (k - 3) * np.sin(t) / s + 2 * s * ((1 - k) * np.sin(t) + np.sin(3 * t))
    u, v = u - 2 * s**3 * np.cos(3 * t), v - 2 * s**3 * np.sin(3 * t)
    return stress * a / (8 * G) * np.stack([u, v], axis=1)


@pytest.mark.slow
def test_the_stress_at_a_hole_is_three_times_that_far_away_within_its_estimated_error():
    """The exact displacements at the nodes of quadratic cells: what is left is recovery."""
    found = []
    for n in (8, 16):
        ring = sheets.sheet(
            n, lambda s, t: ((1 + s) * np.cos(t * np.pi / 2), (1 + s) * np.sin(t * np.pi / 2)),
            order=2,
        )  # fmt: skip
        mesh = ao.read_mesh(ring.dolfinx, gdim=2) if ring.gdim == 3 else ring
        part = ao.Structure(mesh, STEEL)
        space = part.form.space
        shapes = kirsch(space.tabulate_dof_coordinates()[:, :2], 1.0, 1.0).reshape(-1, 1)
        nodes, _, six = mesh_fields.tensors_of_part(part, shapes, "stress", Place(), [0])
        x = part.mesh.dolfinx.geometry.x
        top = np.argmin(np.linalg.norm(x - (0, 1, 0), axis=1))
        value = float(extreme_principal(six[nodes == top, :, 0])[0])
        error = mesh_fields.stress_errors_of_part(part, shapes, np.ones((len(x), 1)))[top]
        assert abs(value - 3.0) < 3 * error < 1.0
        found.append((value, error))
    (coarse, more), (fine, less) = found
    assert abs(fine - 3) < 0.4 * abs(coarse - 3) < 0.1
    assert less < 0.5 * more


def ell(n: int) -> ao.Structure:
    """An L of squares, held at the end of one leg; its corner is at (1, 1)."""
    mesh = parts.plate((2 * n, 2 * n), (2.0, 2.0))
    import dolfinx

    kept = dolfinx.mesh.locate_entities(
        mesh.dolfinx, 2, lambda x: (x[0] < 1 + 1e-9) | (x[1] < 1 + 1e-9)
    )
    cut = ao.read_mesh(dolfinx.mesh.create_submesh(mesh.dolfinx, 2, kept)[0])
    return ao.Structure(cut, STEEL, [ao.Support(lambda x: x[1] > 2 - 1e-9)])


def test_a_re_entrant_corner_is_told_and_its_stress_grows_with_the_mesh():
    largest = []
    for n in (3, 6):
        part, hit = held(ell(n), ao.Site((2.0, 0.5), (0, -1), radius=0.4), 1e3)
        peak = ao.peak_field(part, hit, body="part")
        assert "would give one" in peak.summary()
        largest.append(peak.values.max())
    assert largest[1] > 1.2 * largest[0]


def _pascals(share: float) -> str:
    return engineering(share * YIELD, "Pa")


def test_a_margin_within_its_error_by_the_mesh_is_undecided():
    margin = ao.results.Margin("yield", 0.9 * YIELD, YIELD, np.zeros(3), 0.0)
    assert margin.sentence.startswith("it stays elastic")
    undecided = dataclasses.replace(margin, errors=(0.7 * YIELD, 1.1 * YIELD))
    range_told = (
        f"stress {_pascals(0.7)} to {_pascals(1.1)} with its errors, strength {_pascals(1)}"
    )
    assert undecided.sentence.startswith(f"it may bend for good ({range_told}")
    assert not undecided.reached
    certain = dataclasses.replace(undecided, value=1.2 * YIELD, errors=(1.1 * YIELD, 1.3 * YIELD))
    assert certain.sentence.startswith("it bends for good")
    unresolved = dataclasses.replace(margin, errors=(0.5 * YIELD, np.inf))
    assert unresolved.bounds[1] == np.inf
    assert "cannot say (the stress has no bar)" in unresolved.sentence


@pytest.mark.parametrize(
    ("stress", "verdict"),
    [
        (0.79, "stays elastic"),
        (0.81, "may bend for good"),
        (1.29, "may bend for good"),
        (1.31, "bends for good"),
    ],
)
def test_the_range_of_a_yield_strength_belongs_to_the_verdict(stress, verdict):
    margin = ao.results.Margin(
        "yield", stress * YIELD, YIELD, np.zeros(3), 0.0, strength_range=(0.8 * YIELD, 1.3 * YIELD)
    )
    assert margin.sentence.startswith(f"it {verdict}")
    assert "taken as exact" not in margin.sentence
    exact = dataclasses.replace(margin, strength_range=None).sentence
    assert f"strength {engineering(YIELD, 'Pa')} (taken as exact: no range was given)" in exact
    lowest = dataclasses.replace(margin, strength_range=None, strength=0.8 * YIELD)
    assert margin.least_margin == pytest.approx(lowest.margin)
    assert f"margin of safety {1 / stress - 1:.3g}, {0.8 / stress - 1:.3g}" in margin.sentence


def test_stresses_under_hertz_s_pressure():
    """The closed forms on the axis and on the surface (Johnson, 3.4)."""
    nu, a, pressure = 0.3, 1e-3, 1.5 / np.pi / 1e-6
    z = np.linspace(0.1, 5, 20)
    rr, tt, zz, rz = hertz_stresses(1.0, a, nu, 0 * z, a * z) / pressure
    on_axis = -1 / (1 + z**2)
    across = -(1 + nu) * (1 - z * np.arctan2(1, z)) - on_axis / 2
    np.testing.assert_allclose([rr, tt, zz, rz], [across, across, on_axis, 0 * z], atol=1e-4)
    x = np.linspace(1.1, 5, 20)
    surface = hertz_stresses(1.0, a, nu, a * x, 0 * x) / pressure
    radial = (1 - 2 * nu) / 3 / x**2
    np.testing.assert_allclose(surface, [radial, -radial, 0 * x, 0 * x], atol=1e-6)
    inside = hertz_stresses(1.0, a, nu, a * np.array([0.5, 1.0]), np.zeros(2)) / pressure
    np.testing.assert_allclose(inside[2], [-np.sqrt(0.75), 0.0], atol=1e-3)


def test_hertz_s_stress_is_small_beyond_what_the_margin_leaves_out():
    """Over its largest: on the surface and on the axis (Johnson, Contact Mechanics, 3.4)."""
    nu = 0.3

    def on_axis(z):
        along = -1 / (1 + z**2)
        across = -(1 + nu) * (1 - z * np.arctan2(1, z)) - along / 2
        return abs(along - across)

    largest = max(on_axis(np.linspace(0, 2, 2001)))
    assert largest == pytest.approx(0.62, abs=0.005)
    on_surface = np.sqrt(3) * (1 - 2 * nu) / 3 / PLASTIC_ZONE_RADII**2
    assert on_surface / largest == pytest.approx(0.04, abs=0.005)
    assert on_axis(PLASTIC_ZONE_RADII) / largest == pytest.approx(0.17, abs=0.005)


@pytest.mark.parametrize("criterion", ["tsai_hill", "tsai_wu"])
def test_at_each_strength_the_exposure_is_1(criterion):
    for entry, sizes in (((0, 0), (1500, -1200)), ((1, 1), (40, -200)), ((0, 1), (70, -70))):
        for size in sizes:
            stress = np.zeros((3, 3))
            stress[entry] = stress[entry[::-1]] = size * 1e6
            assert getattr(PLY, criterion)(stress) == pytest.approx(1.0)
            assert getattr(PLY, criterion)(stress / 3) == pytest.approx(1 / 3)


CARBON = ao.Layer(
    E1=140e9, E2=9e9, nu12=0.3, G12=5e9, G13=5e9, G23=3.5e9, rho=1600.0, thickness=1e-3
)
BEAM = ao.Beam(
    **parts.STEEL, section=ao.Section(A=3e-4, I=4e-9, I_side=2e-9, J=1e-9, shear_side=0.3),
    orientation=(0, 0.3, 1),
)  # fmt: skip


def field(part: ao.Structure, **functions: Callable[..., np.ndarray]) -> np.ndarray:
    """Dofs (n, 1) of a displacement given by functions of x, y, z."""
    form = on_mesh(part).form
    shapes = np.zeros((compat.local_size(form.space), 1))
    for name, function in functions.items():
        dofs, x = compat.dof_coordinates(form.space, form.components[name])
        shapes[dofs, 0] = function(*x.T)
    return shapes


def at_gauss(part: ao.Structure, shapes: np.ndarray, n: int):
    """Points of n Gauss points a direction in all cells, and their weights times |J|."""
    mesh = on_mesh(part).mesh
    x, w = np.polynomial.legendre.leggauss(n)
    x, w = (x + 1) / 2, w / 2
    if mesh.cell == "triangle":  # a square collapsed
        grid = np.array([(a, b * (1 - a)) for a in x for b in x])
        weight = np.array([p * q * (1 - a) for a, p in zip(x, w, strict=True) for q in w])
    else:
        mesh_of = np.meshgrid(*[x] * mesh.tdim, indexing="ij")
        grid = np.stack([m.ravel() for m in mesh_of], axis=1)
        weight = np.prod(np.meshgrid(*[w] * mesh.tdim, indexing="ij"), axis=0).ravel()
    cells = np.repeat(np.arange(mesh.n_cells), len(grid))
    at = PointsInCells(on_mesh(part), shapes, cells, np.tile(grid, (mesh.n_cells, 1)))
    J = at.J
    size = np.sqrt(np.linalg.det(np.einsum("pia,pib->pab", J, J)))
    return at, np.tile(weight, mesh.n_cells) * size


@pytest.mark.parametrize("cell", parts.CELLS)
def test_a_quadratic_field_has_its_own_strain(cell):
    plane = cell in ("triangle", "quadrilateral")
    if plane:
        solid = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
        part = ao.Structure(parts.plate((3, 2), cell=cell), solid, [ao.Support("left")])
    else:
        part = ao.Structure(parts.box((3, 2, 2), cell=cell), ao.Solid(**parts.STEEL))
    A = np.random.default_rng(1).standard_normal((3, 3, 3))
    A = A + np.swapaxes(A, 1, 2)  # u_i = x·A_i·x/2

    def component(i):
        def function(x, y, z):
            p = np.stack([x, y, z])
            return np.einsum("an,ab,bn->n", p, A[i], p) / 2

        return function

    names = "xy" if plane else "xyz"
    shapes = field(part, **{name: component(i) for i, name in enumerate(names)})
    at, _ = at_gauss(part, shapes, 2) if cell != "tetrahedron" else (None, None)
    if at is None:
        at = PointsInCells(
            on_mesh(part), shapes, np.array([1, 3]), np.array([[0.2, 0.3, 0.1], [0.5, 0, 0.2]])
        )
    x = on_mesh(part).mesh.geometry.at(at.cells, at.X)[0]
    g = np.einsum("iab,pb->pia", A, x)
    if plane:
        g[:, 2] = g[:, :, 2] = 0
    strain = (g + np.swapaxes(g, 1, 2)) / 2
    G, lame = 210e9 / 2.6, 210e9 * 0.3 / 1.3 / 0.4
    if plane:
        strain[:, 2, 2] = -0.3 / 0.7 * (strain[:, 0, 0] + strain[:, 1, 1])
    trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    stress = 2 * G * strain + lame * trace * np.eye(3)
    curl = (g - np.swapaxes(g, 1, 2)) / 2
    turned = curl[:, 1, 0][:, None] if plane else curl[:, [2, 0, 1], [1, 2, 0]]
    for quantity, exact in (("strain", strain), ("stress", stress), ("rotation", turned)):
        found = evaluator(on_mesh(part), quantity, Place())(at)[..., 0]
        np.testing.assert_allclose(found, exact, atol=1e-11 * np.abs(exact).max())
    if plane:
        assert np.abs(stress[:, 2]).max() < 1e-9 * np.abs(stress).max()


@pytest.mark.parametrize("plane", [True, False])
@pytest.mark.parametrize("order", [1, 2])
def test_section_forces_of_beams_carry_the_energy_of_K(plane, order):
    """uᵀKu is the integral of forces times strains, by the Gauss points of K, for random u."""
    direction = (3, 4) if plane else (1, 2, -2)
    part = ao.Structure(parts.line(0.8, 3, direction), BEAM, order=order)
    shapes = np.random.default_rng(2).standard_normal((part.size, 1))
    at, weight = at_gauss(part, shapes, order)
    forces = evaluator(on_mesh(part), "section_forces", Place())(at)[..., 0]
    s = BEAM.section
    stiffness = [BEAM.E * s.A, BEAM.G * s.A * s.shear, BEAM.E * s.I]
    if not plane:
        EA, GA, EI = stiffness
        stiffness = [EA, GA, BEAM.G * s.A * 0.3, BEAM.G * s.J, BEAM.E * s.I_side, EI]
    energy = weight @ (forces**2 / stiffness).sum(axis=1)
    assert energy == pytest.approx(float((shapes.T @ csr(part.K) @ shapes)[0, 0]), rel=1e-10)


def test_fibres_of_a_beam():
    """Bending about both axes and stretching: σ = N/A − M y/I …, and the signs by the geometry."""
    part = ao.Structure(parts.line(0.8, 3, (1, 0, 0)), ao.Beam(**parts.STEEL, section=BEAM.section,
                        orientation=(0, 0, 1)))  # fmt: skip
    a, b, c = 1e-3, 2e-2, 3e-2  # u = a x, w = b x²/2 (so θy = −b x), v = c x²/2 (θz = c x)
    shapes = field(
        part, x=lambda x, y, z: a * x, z=lambda x, y, z: b * x**2 / 2, ry=lambda x, y, z: -b * x,
        y=lambda x, y, z: c * x**2 / 2, rz=lambda x, y, z: c * x,
    )  # fmt: skip
    at = PointsInCells(on_mesh(part), shapes, np.array([1]), np.array([[0.3]]))
    up, side = 0.01, 0.004  # height is z, and the section's z = x × z = −y
    found = evaluator(on_mesh(part), "strain", Place(fibre=(up, side)))(at)[0, ..., 0]
    along = a - b * up - c * (-side)
    np.testing.assert_allclose(np.diag(found), [along, -0.3 * along, -0.3 * along], rtol=1e-12)
    stress = evaluator(on_mesh(part), "stress", Place(fibre=(up, side)))(at)[0, ..., 0]
    np.testing.assert_allclose(stress[0, 0], 210e9 * along, rtol=1e-12)
    assert np.abs(stress[1:]).max() < 1e-9 * stress[0, 0]


def skin(stack: str) -> ao.Shell | ao.Laminate:
    if stack == "shell":
        return ao.Shell(**parts.STEEL, thickness=4e-3)
    angles = (0, 90, 45, 20)  # unsymmetric
    return ao.Laminate([CARBON.rotated(a) for a in angles], axis=(1, 0.3, 0))


@pytest.mark.filterwarnings("ignore:the supports leave:antiosc.base.errors.AntioscWarning")
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_rigid_motions_of_any_sheet_have_no_strain(cell, order):
    """On flat and curved cells that lie askew; and a constant shear strain beside no rotation."""
    turn = np.linalg.qr(np.array([[2.0, 1, 0], [1, 3, 1], [-1, 0.5, 2]]))[0]

    def bowl(s, t):
        return tuple(np.tensordot(turn, np.stack([s, t, 0.3 * (s**2 - s * t)]), axes=1))

    part = ao.Structure(mapped(2, bowl, cell, order), skin("shell"))
    modes = on_mesh(part).rigid_modes
    at, weight = at_gauss(part, np.asarray(modes), 3)
    axes = SheetAxes(on_mesh(part))
    size = np.abs(modes).max()
    for strain in middle_strains(at, axes):
        assert np.abs(strain).max() < 1e-9 * size
    # a deflection alone: γ = (∂w/∂1, ∂w/∂2), whatever is interpolated
    plane = ao.Structure(mapped(2, lambda s, t: (s, t, 0 * s), cell), skin("shell"))
    at, _ = at_gauss(plane, field(plane, z=lambda x, y, z: 3 * x - 2 * y), 2)
    own = SheetAxes(on_mesh(plane))
    frame, found = own.frame(at), middle_strains(at, own).shear[..., 0]
    sign = frame.n[:, 2]
    for k, axis in enumerate((frame.e1, frame.e2)):
        np.testing.assert_allclose(found[:, k], sign * (axis @ [3.0, -2.0, 0.0]), atol=1e-10)
    assert (weight > 0).all()


@pytest.mark.parametrize("stack", ["shell", "laminate"])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_layers_of_a_bent_and_stretched_sheet(stack, cell):
    """The strain is ε + zκ of the polynomials; each layer has its own stress of it."""
    gdim = 3 if stack == "laminate" else 2  # for which others compile forms
    mesh = sheets.rectangle((3, 2), 0.3, 0.2, cell, gdim)
    part = ao.Structure(mesh, skin(stack))
    e, k = np.array([1e-3, -2e-3, 5e-4]), np.array([0.3, -0.2, 0.1])  # of x, y and shear
    shapes = field(
        part, x=lambda x, y, z: e[0] * x + e[2] * y / 2, y=lambda x, y, z: e[1] * y + e[2] * x / 2,
        z=lambda x, y, z: -(k[0] * x**2 + k[1] * y**2 + k[2] * x * y) / 2,
        rx=lambda x, y, z: -(k[1] * y + k[2] * x / 2), ry=lambda x, y, z: k[0] * x + k[2] * y / 2,
    )  # fmt: skip
    at = PointsInCells(on_mesh(part), shapes, np.array([0, 2]), np.array([[0.2, 0.3], [0.6, 0.3]]))
    places = [(None, "top", 2e-3), (None, "bottom", -2e-3), (None, "middle", 0.0)]
    if stack == "laminate":
        places += [(1, "top", 0.0), (3, "bottom", 1e-3)]
    for layer, surface, z in places:
        strain, stress = (
            evaluator(on_mesh(part), q, Place(surface, layer))(at)[..., 0]
            for q in ("strain", "stress")
        )
        xx, yy, xy = e + z * k
        plane = np.array([[xx, xy / 2], [xy / 2, yy]])
        for s in strain:
            np.testing.assert_allclose(s[:2, :2], plane, atol=1e-9 * np.abs(plane).max())
        if stack == "shell":
            expected = 210e9 / 0.91 * (0.7 * plane + 0.3 * np.trace(plane) * np.eye(2))
            np.testing.assert_allclose(
                strain[:, 2, 2], -0.3 / 0.7 * np.trace(plane), atol=1e-9 * np.abs(plane).max()
            )
        else:
            number = {None: {"top": 3, "bottom": 0, "middle": 2}[surface]}.get(layer, layer)
            turn = np.deg2rad((0, 90, 45, 20)[number]) + np.arctan2(0.3, 1)
            c, s_ = np.cos(turn), np.sin(turn)
            R = np.array([[c, s_], [-s_, c]])
            own = R @ plane @ R.T
            nu21 = 0.3 * 9 / 140
            Q = np.array([[140e9, 0.3 * 9e9], [0.3 * 9e9, 9e9]]) / (1 - 0.3 * nu21)
            s1, s2 = Q @ np.diag(own)
            t12 = 5e9 * 2 * own[0, 1]
            expected = R.T @ np.array([[s1, t12], [t12, s2]]) @ R
            local = evaluator(on_mesh(part), "stress", Place(surface, layer, local=True))(at)
            np.testing.assert_allclose(
                local[:, :2, :2, 0],
                np.broadcast_to([[s1, t12], [t12, s2]], (2, 2, 2)),
                atol=1e-8 * np.abs(expected).max(),
            )
        for s in stress:
            np.testing.assert_allclose(s[:2, :2], expected, atol=1e-8 * np.abs(expected).max())
            assert np.abs(s[2, 2]) < 1e-9 * np.abs(expected).max()


def test_shear_stresses_of_layers_are_in_equilibrium():
    """Their integral is the shear force, and the surfaces are free; 3/2 Q/t in the middle."""
    from antiosc.fem.elements import shear_stresses

    layers = [CARBON.rotated(a) for a in (0, 90, 45, 20)]
    x, w = np.polynomial.legendre.leggauss(3)
    whole = np.zeros((2, 2))
    for k in range(4):
        for a, weight in zip(x, w, strict=True):
            whole += weight / 2 * 1e-3 * shear_stresses(layers, k, (k - 2 + (a + 1) / 2) * 1e-3)
        np.testing.assert_allclose(
            shear_stresses(layers, max(k - 1, 0), (k - 2) * 1e-3),
            shear_stresses(layers, k, (k - 2) * 1e-3),
            atol=1e-6,
        )
    np.testing.assert_allclose(np.diag(whole), [1, 1], rtol=1e-10)
    assert np.abs(shear_stresses(layers, 3, 2e-3)).max() < 1e-9 * 250
    one = [ao.Layer.isotropic(210e9, 0.3, 7850.0, 4e-3)]
    np.testing.assert_allclose(shear_stresses(one, 0, 0.0), 1.5 / 4e-3 * np.eye(2), atol=1e-9)


@pytest.mark.parametrize("stack", ["shell", "laminate"])
def test_section_forces_of_triangles_carry_the_energy_of_K(stack):
    """For random deflections and rotations, the interpolated shear strain included."""
    part = ao.Structure(parts.plate((2, 2), (0.3, 0.2), "triangle"), skin(stack))
    rng = np.random.default_rng(3)
    form = on_mesh(part).form
    shapes = np.zeros((part.size, 1))
    for name in ("z", "rx", "ry"):
        dofs, _ = compat.dof_coordinates(form.space, form.components[name])
        shapes[dofs, 0] = rng.standard_normal(len(dofs)) * (0.01 if name == "z" else 1)
    at, weight = at_gauss(part, shapes, 5)
    axes = SheetAxes(on_mesh(part))
    forces = evaluator(on_mesh(part), "section_forces", Place())(at)[..., 0]
    strains = np.hstack([s[..., 0] for s in middle_strains(at, axes)])
    energy = weight @ (forces * strains).sum(axis=1)
    assert energy == pytest.approx(float((shapes.T @ csr(part.K) @ shapes)[0, 0]), rel=1e-9)


def row_of_nodes(values, error=0.02, size=1e-3) -> NodalExposures:
    """Nodes on the x axis with these exposures, 10 mm apart."""
    x = 0.01 * np.arange(len(values))
    points = np.column_stack([x, 0 * x, 0 * x])
    ones = np.ones(len(values))
    return NodalExposures(points, np.array(values), YIELD * ones, 0 * x, error * ones, size * ones)


def test_a_stress_that_the_mesh_does_not_resolve_has_no_bar():
    """By jumps of half of it, at the worst node or at one that may have more."""
    exposures = np.array([0.5, 0.4, 0.2])
    good = judged_margin("yield", row_of_nodes(exposures), ExcludedZones())
    assert good.errors == pytest.approx((0.49 * YIELD, 0.51 * YIELD))
    assert not good.note
    for errors, has_bar in (
        ([0.6, 0.02, 0.02], False),
        ([0.02, 0.6, 0.02], False),  # 0.64 at most
        ([0.02, 0.02, 1.0], True),  # 0.4 at most: twice the value
    ):
        nodes = row_of_nodes(exposures)._replace(error=np.array(errors))
        found = judged_margin("yield", nodes, ExcludedZones())
        assert found.has_bar == has_bar
        assert ("no bar" in found.sentence) != has_bar
        assert has_bar or "500 µm" in found.note  # half the size of the cells


def test_a_patch_larger_than_the_contact_widens_the_bar_beside_it():
    """By Hertz's stress on the contact less that on the patch; three radii are left out."""
    zone = ContactZone(np.zeros(3), 1e-3, 1e-3, 5000.0, 0.3)
    near = row_of_nodes([0.9, 0.3, 0.1])._replace(points=np.diag([0.0, 4e-3, 50e-3])[:, [1, 0, 2]])
    found = judged_margin("yield", near, ExcludedZones([zone]))
    assert found.scope == "outside 3 radii of the contact (3.0 mm)"
    assert found.errors == pytest.approx((0.294 * YIELD, 0.306 * YIELD))

    wide = judged_margin("yield", near, ExcludedZones([zone._replace(patch=4e-3)]))
    # the cells of the node at 4 mm reach what is left out
    r, z = 3e-3 * np.array([f(np.linspace(0, np.pi / 2, 50)) for f in (np.sin, np.cos)])
    one, other = (hertz_stresses(5000.0, radius, 0.3, r, z) for radius in (1e-3, 4e-3))
    assert wide.errors[1] == pytest.approx(0.306 * YIELD + von_mises(one - other).max(), rel=0.02)
    assert wide.has_bar


def test_a_contact_smaller_than_the_cells_leaves_the_verdict_open():
    """By modes of the whole body, which show nothing of it: neither end of the stress is known."""
    zone = ContactZone(np.zeros(3), 1e-4, np.inf, 100.0, 0.3)
    found = judged_margin("yield", row_of_nodes([0.9, 4.0, 0.1]), ExcludedZones([zone]))
    assert found.errors == (0.0, np.inf)
    assert found.answer == "it may bend for good"
    assert "the cells are larger than the contact" in found.note


def test_a_patch_on_a_sheet_hides_bending():
    """3 F (1 + nu) / (2 pi h^2) ln(patch / r) under it (Westergaard), nothing beside it."""
    zone = ContactZone(np.zeros(3), 1e-4, 5e-3, 100.0, 0.3, thickness=2e-3)
    hidden = zone.spread(5e-3, np.array([0.0, 2e-3, 6e-3]))
    unit = 1.5 * 100.0 * 1.3 / (np.pi * 4e-6)
    assert hidden == pytest.approx([unit * np.log(5 / 0.65), unit * np.log(2.5), 0.0])
