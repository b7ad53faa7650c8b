"""Shell elements against plate and shell theory, locking, patch tests, invariances, bad input."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg
from mpi4py import MPI

pytest.importorskip("dolfinx")

import dolfinx

import antiosc as ao
from antiosc.closed_form.plates import SupportedPlate
from antiosc.errors import AntioscWarning, InputError
from antiosc.fem import compat
from antiosc.fem.elements.mitc import CUBIC, QUADRATIC, _dropped_of_cubics
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.extraction.eigenmodes import ModeSolver
from antiosc.fem.extraction.static_mode import static_mode
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.site.functionals import functional
from sheets import (
    CELLS,
    NU,
    RHO,
    SIMPLE,
    E,
    at,
    dof,
    edges,
    frequencies,
    interpolated,
    loaded,
    plate,
    pressed,
    rectangle,
    sheet,
)

pytestmark = pytest.mark.fem

# --- plates -----------------------------------------------------------------------------------


@cache
def plate_error(n, t, cell):
    """Largest relative error of the first three flexural frequencies against Mindlin's."""
    theory = SupportedPlate(E, NU, RHO, t, 1.0, 1.0)
    exact = np.sort([theory.mindlin(m, k) for m, k in ((1, 1), (1, 2), (2, 1))])
    return np.abs(frequencies(plate(n, t, cell), 3) / exact - 1).max()


#: ωL²√(ρt/D) of the clamped square, ν = 0.3: the first two (the second is double).
#: t/L = 0.1: Liew, Xiang & Kitipornchai (1993); thin: Bardell (1991).
CLAMPED = {1e-1: (3.2954 * np.pi**2, 6.2858 * np.pi**2), 1e-4: (35.985, 73.394)}


@cache
def clamped_error(n, t, cell):
    """The same of a clamped plate, against published Ritz series of five digits."""
    unit = SupportedPlate(E, NU, RHO, t, 1.0, 1.0)
    found = frequencies(plate(n, t, cell, [ao.Support(edges(0, 1))]), 3)
    first, second = CLAMPED[t]
    factors = found * np.sqrt(unit.surface_density / unit.D)
    return np.abs(factors / [first, second, second] - 1).max()


@pytest.mark.parametrize("cell", [*CELLS, "one way"])
def test_no_locking(cell):
    """Thin plates err at most twice as much as thick ones on the same mesh.

    Measured, thick and thin: triangles 3e-4 and 3e-4, clamped 6e-4 and 8e-4 (7e-4 and 1e-3 where
    all diagonals go one way); quadrilaterals 6e-4 and 7e-4, clamped 1.2e-3 and 1.7e-3.
    """
    for error in (plate_error, clamped_error):
        thick, thin = error(8, 1e-1, cell), error(8, 1e-4, cell)
        assert thin < 2e-3
        assert thin < 2 * thick


@pytest.mark.parametrize("cell", [*CELLS, "one way"])
@pytest.mark.parametrize("t", [1e-1, 1e-4])
@pytest.mark.slow
def test_clamped_plates_converge_with_the_fourth_order(cell, t):
    coarse, fine = clamped_error(4, t, cell), clamped_error(8, t, cell)
    assert 3.3 < np.log2(coarse / fine) < 5.5


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.slow
def test_thirty_frequencies_and_none_between(cell):
    """A spurious mode would shift all that follow."""
    m = np.arange(1, 12)
    exact = np.sort(SupportedPlate(E, NU, RHO, 1e-4, 1.0, 1.0).kirchhoff(m[:, None], m).ravel())
    assert frequencies(plate(12, 1e-4, cell), 30) == pytest.approx(exact[:30], rel=1.5e-2)


def test_dropped_rotations_have_no_moment():
    """Tangents at three Gauss points of every edge; three means: all vanish, so they stay tied."""
    table = _dropped_of_cubics()

    def at_points(fields, X):
        """(8 cubics, points, 2)."""
        x, y = X.T
        quadratic = np.stack([x**r * y**s for r, s in QUADRATIC])
        for n, (p, q) in enumerate(CUBIC):
            for j in (0, 1):
                own = table[n, j, :, :6] @ quadratic + table[n, j, :, 6:] * x**p * y**q
                yield own.T

    g = np.array([-np.sqrt(0.6), 0, np.sqrt(0.6)])[:, None] / 2 + 0.5
    corners = np.array([[0, 0], [1, 0], [0, 1.0]])
    for a, b in ((0, 1), (0, 2), (1, 2)):
        tangent = corners[b] - corners[a]
        for field in at_points(table, corners[a] + g * tangent):
            assert field @ tangent == pytest.approx(np.zeros(3), abs=1e-14)
    s, w = np.polynomial.legendre.leggauss(5)
    u, v = np.meshgrid((s + 1) / 2, (s + 1) / 2)
    weight = np.outer(w, w) / 4 * (1 - v)
    inside = np.column_stack([(u * (1 - v)).ravel(), v.ravel()])
    for field in at_points(table, inside):
        mean = weight.ravel() @ field
        assert mean == pytest.approx(np.zeros(2), abs=1e-14)


@pytest.mark.parametrize(("cell", "t"), [(c, t) for c in CELLS for t in (1e-1, 1e-3)])
def test_frequencies_converge_with_the_fourth_order(cell, t):
    coarse, fine = plate_error(4, t, cell), plate_error(8, t, cell)
    assert 3.5 < np.log2(coarse / fine) < 5.5
    assert fine < 1.5e-3


def test_a_plane_mesh_and_one_in_space_make_the_same_plate():
    flat, space = plate(5, 1e-2, gdim=2), plate(5, 1e-2)
    assert frequencies(flat, 3) == pytest.approx(frequencies(space, 3), rel=1e-9)


@pytest.mark.parametrize("cell", CELLS)
def test_clamped_square_deflects_as_timoshenkos(cell):
    # Theory of Plates and Shells, table 35: 0.00126 q a⁴/D under pressure
    structure = plate(10, 1e-3, cell, [ao.Support(edges(0, 1))])
    y = pressed(structure, (0, 0, 1.0))
    D = SupportedPlate(E, NU, RHO, 1e-3, 1.0, 1.0).D
    assert y[dof(structure, (0.5, 0.5, 0), "z")] * D == pytest.approx(0.001265, rel=5e-3)


@pytest.mark.parametrize("t", [0.2, 1e-3])
def test_clamped_circle_under_pressure(t, tmp_path):
    """Mindlin: q R⁴/64D + q R²/4κGt at the centre; a curved mesh of a quarter."""

    (tmp_path / "disc.geo").write_text(
        "Point(1)={0,0,0}; Point(2)={1,0,0}; Point(3)={0,1,0};"
        "Line(1)={1,2}; Circle(2)={2,1,3}; Line(3)={3,1};"
        "Curve Loop(1)={1,2,3}; Plane Surface(1)={1};\n"
    )
    mesh = ao.read_mesh(tmp_path / "disc.geo", size=0.1, gdim=3)
    structure = ao.Structure(
        mesh,
        ao.Shell(E, NU, RHO, t),
        [
            ao.Support(lambda x: np.isclose(np.hypot(x[0], x[1]), 1, atol=1e-4)),
            ao.Support(at(0, 0.0), ("x", "ry", "rz")),
            ao.Support(at(1, 0.0), ("y", "rx", "rz")),
        ],
    )
    y = pressed(structure, (0, 0, 1.0))
    D, G = E * t**3 / 12 / (1 - NU**2), E / 2 / (1 + NU)
    exact = 1 / (64 * D) + 1 / (4 * 5 / 6 * G * t)
    assert y[dof(structure, (0, 0, 0), "z")] == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize(
    ("supports", "factors"),
    [
        ([], [13.468, 19.596, 24.270, 34.801, 34.801, 61.093]),
        ([ao.Support(at(0, 0.0))], [3.4710, 8.5066, 21.285, 27.199, 30.955, 54.187]),
    ],
    ids=["FV12", "FV16"],
)
@pytest.mark.parametrize("cell", CELLS)
def test_nafems_square_plates(cell, supports, factors):
    """The plates of NAFEMS's FV12 (free) and FV16 (cantilever), t/L = 0.005.

    Kirchhoff's factors ωL²√(ρt/D), ν = 0.3, from converged Ritz series; the values that NAFEMS
    prints come from Leissa's shorter ones and lie up to 1 % higher.
    """
    structure = ao.Structure(
        rectangle(10, 10.0, 10.0, cell), ao.Shell(200e9, 0.3, 8000.0, 0.05), supports
    )
    rigid = structure.rigid_modes.shape[1]
    unit = SupportedPlate(200e9, 0.3, 8000.0, 0.05, 10.0, 10.0)
    found = frequencies(structure, rigid + 6) * 100 * np.sqrt(unit.surface_density / unit.D)
    assert found[:rigid] == pytest.approx(np.zeros(rigid), abs=0.1)
    assert found[rigid:] == pytest.approx(factors, rel=4e-3)


# --- shells -----------------------------------------------------------------------------------

SHELLS = [(cell, order) for cell in CELLS for order in (1, 2)]


# The benchmark has units of its own.
@pytest.mark.filterwarnings("ignore:.*units are SI")
@pytest.mark.parametrize(("cell", "order"), SHELLS)
def test_scordelis_lo_roof(cell, order):
    """Mid-side deflection 0.3024 (Scordelis & Lo 1964; shear-flexible theory lies 0.2 % lower)."""
    R, half, angle = 25.0, 25.0, np.deg2rad(40)
    mesh = sheet(
        8, lambda s, t: (half * s, R * np.sin(angle * t), R * np.cos(angle * t)), cell, order
    )
    supports = [
        ao.Support(at(0, 0.0), ("y", "z")),
        ao.Support(at(0, half), ("x", "ry", "rz")),
        ao.Support(at(1, 0.0), ("y", "rx", "rz")),
    ]
    structure = ao.Structure(mesh, ao.Shell(4.32e8, 0.0, 1.0, 0.25), supports)
    y = pressed(structure, (0, 0, -90.0))
    corner = (half, R * np.sin(angle), R * np.cos(angle))
    assert -y[dof(structure, corner, "z")] == pytest.approx(0.3020, rel=6e-3)


# The benchmark has units of its own.
@pytest.mark.filterwarnings("ignore:.*units are SI")
@pytest.mark.parametrize(("cell", "order"), SHELLS)
def test_pinched_cylinder(cell, order):
    """1.8248e-5 under the load (Lindberg et al. 1969); shear adds its logarithm there."""
    R = half = 300.0
    mesh = sheet(
        16,
        lambda s, t: (half * s, R * np.sin(np.pi / 2 * t), R * np.cos(np.pi / 2 * t)),
        cell,
        order,
    )
    supports = [
        ao.Support(at(0, 0.0), ("y", "z")),
        ao.Support(at(0, half), ("x", "ry", "rz")),
        ao.Support(at(1, 0.0), ("y", "rx", "rz")),
        ao.Support(at(2, 0.0), ("z", "rx", "ry")),
    ]
    structure = ao.Structure(mesh, ao.Shell(3e6, 0.3, 1.0, 3.0), supports)
    place = dof(structure, (half, 0, R), "z")
    assert loaded(structure, {place: 0.25})[place] == pytest.approx(1.8248e-5, rel=2e-2)


@pytest.mark.parametrize(("cell", "order"), [(cell, 2) for cell in CELLS])
def test_hemisphere_with_a_hole(cell, order):
    """Alternating loads at the equator: 0.094 (MacNeal & Harder 1985), 0.0935 in later work."""
    R, rise = 10.0, np.deg2rad(72)
    mesh = sheet(
        16,
        lambda s, t: (
            R * np.cos(rise * t) * np.cos(np.pi / 2 * s),
            R * np.cos(rise * t) * np.sin(np.pi / 2 * s),
            R * np.sin(rise * t),
        ),
        cell,
        order,
    )
    supports = [
        ao.Support(at(0, 0.0), ("x", "ry", "rz")),
        ao.Support(at(1, 0.0), ("y", "rx", "rz")),
        ao.Support(lambda x: np.isclose(x[0], R) & np.isclose(x[2], 0), "z"),
    ]
    structure = ao.Structure(mesh, ao.Shell(6.825e7, 0.3, 1.0, 0.04), supports)
    place = dof(structure, (R, 0, 0), "x")
    y = loaded(structure, {place: 1.0, dof(structure, (0, R, 0), "y"): -1.0})
    assert y[place] == pytest.approx(0.0937, rel=1e-2)


def fluegge(m, n, R, L, t):
    """Lowest frequency of a cylinder between diaphragms, m half waves by n waves (Love–Timoshenko).

    The cubic of A. W. Leissa, Vibration of Shells (1973), eq. (2.35) with u, v, w as sin and cos.
    """
    lam, k = m * np.pi * R / L, t**2 / (12 * R**2)
    uu = lam**2 + (1 - NU) / 2 * n**2
    uv = (1 + NU) / 2 * lam * n
    uw = NU * lam
    vv = (1 - NU) / 2 * lam**2 + n**2 + k * (2 * (1 - NU) * lam**2 + n**2)
    vw = n + k * n * (n**2 + (2 - NU) * lam**2)
    ww = 1 + k * (lam**2 + n**2) ** 2
    matrix = np.array([[uu, uv, uw], [uv, vv, vw], [uw, vw, ww]])
    value = np.linalg.eigvalsh(matrix)[0]
    return np.sqrt(value * E / (RHO * (1 - NU**2))) / R


@pytest.mark.parametrize(("cell", "order"), [("triangle", 2), ("quadrilateral", 2)])
def test_cylinder_between_diaphragms(cell, order):
    """A quarter cylinder panel, its straight edges held as nodal lines of n = 2, 4, …"""
    R, L, t = 1.0, 1.0, 0.005
    angle = np.pi / 2
    mesh = sheet(
        (8, 16), lambda s, v: (L * s, R * np.sin(angle * v), R * np.cos(angle * v)), cell, order
    )
    held = [
        ao.Support(edges(0), ("y", "z", "rx")),
        ao.Support(at(1, 0.0), ("x", "z", "ry")),  # sin(nθ) vanishes: w, u and the axial rotation's
        ao.Support(at(2, 0.0), ("x", "y", "rz")),  # companions
    ]
    structure = ao.Structure(mesh, ao.Shell(E, NU, RHO, t), held)
    exact = np.sort([fluegge(m, n, R, L, t) for m in (1, 2) for n in (2, 4, 6, 8, 10, 12)])[:4]
    assert frequencies(structure, 4) == pytest.approx(exact, rel=5e-3)


# --- what must hold on any mesh ---------------------------------------------------------------


def warped(n, cell):
    """A plane mesh of distorted cells."""
    return sheet(
        n,
        lambda s, t: (
            s + 0.09 * np.sin(2 * np.pi * s) * np.sin(3 * t),
            t + 0.1 * np.sin(np.pi * t) * np.cos(4 * s),
            0 * s,
        ),
        cell,
    )


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("case", ["membrane", "bending", "twist"])
def test_patch(cell, case):
    """Constant strain on distorted cells: no force inside, the exact energy."""
    t = 0.01
    structure = ao.Structure(warped(4, cell), ao.Shell(E, NU, RHO, t))
    D, C = E * t**3 / 12 / (1 - NU**2), E * t / (1 - NU**2)

    def field(x):
        X, Y = x[:, 0], x[:, 1]
        return {
            # ε = [[1, .25], [.25, −.5]], turned by rz = (∂v/∂x − ∂u/∂y)/2
            "membrane": {"x": X + 0.4 * Y, "y": 0.1 * X - 0.5 * Y, "rz": -0.15},
            # rotation of the normal: θ = (∂w/∂y, −∂w/∂x, 0)
            "bending": {"z": X**2 / 2 - Y**2, "rx": -2 * Y, "ry": -X},
            "twist": {"z": X * Y, "rx": X, "ry": -Y},
        }[case]

    tensor = {
        "membrane": (C, np.array([[1, 0.25], [0.25, -0.5]])),
        "bending": (D, np.array([[1, 0], [0, -2.0]])),
        "twist": (D, np.array([[0, 1], [1, 0.0]])),
    }[case]
    stiffness, e = tensor
    exact = stiffness * ((1 - NU) * np.sum(e * e) + NU * np.trace(e) ** 2)
    y = interpolated(structure, field)
    force = multiply(structure.K, y)
    area = compat.integrate(
        structure.form.density * measure(structure.mesh, 3), structure.mesh.dolfinx
    )
    assert y @ force == pytest.approx(exact * area / (RHO * t), rel=1e-9)
    inner = np.ones(len(y), dtype=bool)
    for path in structure.form.components.values():
        dofs, x = compat.dof_coordinates(structure.form.space, path)
        inner[dofs[edges(0, 1)(x.T)]] = False
    # rounding of the membrane forces, which the bending patch does not have
    scale = np.abs(multiply(structure.K, np.abs(y) * np.sign(force))).max()
    assert np.abs(force[inner]).max() < 1e-11 * scale


@pytest.mark.parametrize(("cell", "order"), SHELLS)
@pytest.mark.parametrize("t", [1e-1, 2e-3])
def test_a_free_shell_has_six_zero_modes_and_its_mass(cell, order, t):
    """No spurious mode, the rigid ones exact: K R = 0 and RᵀMR from the body's inertia."""
    mesh = sheet(3, lambda s, v: (s, np.sin(1.2 * v), np.cos(1.2 * v)), cell, order)
    structure = ao.Structure(mesh, ao.Shell(E, NU, RHO, t))
    assert structure.rigid_modes.shape[1] == 6
    K, M = csr(structure.K).toarray(), csr(structure.M).toarray()
    assert (
        np.abs(K @ structure.rigid_modes).max()
        < 1e-12 * np.abs(K).max() * np.abs(structure.rigid_modes).max()
    )
    omega = np.sqrt(np.abs(scipy.linalg.eigvalsh(K, M, subset_by_index=(0, 7))))
    assert omega[5] < 0.05 * omega[6]
    push = interpolated(structure, lambda x: {"y": 1.0})
    assert push @ M @ push == pytest.approx(structure.mass, rel=1e-6 if order == 2 else 1e-12)
    area = 1.2 if order == 2 else 3 * 2 * np.sin(0.2)
    assert structure.mass == pytest.approx(RHO * t * area, rel=1e-4 if order == 2 else 1e-12)


def test_a_flat_free_sheet_of_quadrilaterals_has_six_zero_modes():
    structure = plate(4, 1e-3, "quadrilateral", [])
    K, M = csr(structure.K).toarray(), csr(structure.M).toarray()
    omega = np.sqrt(np.abs(scipy.linalg.eigvalsh(K, M, subset_by_index=(0, 7))))
    assert omega[5] < 0.05 * omega[6]


@pytest.mark.parametrize("cell", CELLS)
def test_the_sign_of_normals_does_not_matter(cell):
    """Half of the cells turned over: the same frequencies."""
    flip = {"triangle": [0, 2, 1], "quadrilateral": [0, 2, 1, 3]}[cell]
    straight = rectangle(4, 1.0, 1.0, cell)
    cells = compat.geometry_nodes(straight.dolfinx).copy()
    cells[::2] = cells[::2][:, flip]
    x = straight.dolfinx.geometry.x
    turned = ao.read_mesh(
        compat.create_mesh(straight.comm, cells.astype(np.int64), x.copy(), cell, 1)
    )
    found = [
        frequencies(ao.Structure(m, ao.Shell(E, NU, RHO, 0.02), SIMPLE), 4)
        for m in (straight, turned)
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-8)


def test_two_thicknesses_by_group():
    """A stepped cantilever strip against beam theory, ν = 0."""
    mesh = rectangle((8, 1), 2.0, 0.1)
    middle = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)].mean(axis=1)[:, 0]
    groups = {
        "root": {2: np.flatnonzero(middle < 1).astype(np.int32)},
        "tip": {2: np.flatnonzero(middle > 1).astype(np.int32)},
    }
    mesh = Mesh(mesh.dolfinx, groups, "the strip")
    thin, thick = ao.Shell(E, 0.0, RHO, 0.01), ao.Shell(E, 0.0, 2 * RHO, 0.02)
    structure = ao.Structure(mesh, {"root": thick, "tip": thin}, [ao.Support(at(0, 0.0))])
    assert structure.mass == pytest.approx(RHO * 0.1 * (0.01 + 2 * 0.02), rel=1e-12)
    y = loaded(structure, {dof(structure, (2, v, 0), "z"): 0.5 for v in (0, 0.1)})
    I_tip, I_root = 0.1 * 0.01**3 / 12, 0.1 * 0.02**3 / 12
    bending = 1 / (3 * E * I_tip) + (8 - 1) / (3 * E * I_root)
    shear = (1 / 0.01 + 1 / 0.02) / (5 / 6 * E / 2 * 0.1)
    assert y[dof(structure, (2, 0, 0), "z")] == pytest.approx(bending + shear, rel=1e-4)


def test_a_fold_carries_bending_across():
    """An L of two strips, clamped at one end, pushed along the free leg's normal."""
    mesh = sheet(
        (8, 1),
        lambda s, t: (np.minimum(2 * s, 1.0), 0.05 * t, np.maximum(2 * s - 1, 0.0)),
        "triangle",
    )
    t = 0.01
    structure = ao.Structure(mesh, ao.Shell(E, 0.0, RHO, t), [ao.Support(at(0, 0.0))])
    y = loaded(structure, {dof(structure, (1, v, 1), "x"): 0.5 for v in (0, 0.05)})
    EI = E * 0.05 * t**3 / 12
    bending = 1 / (3 * EI) + 1 / EI  # the leg's own, and the base turning under the moment F·1
    assert y[dof(structure, (1, 0, 1), "x")] == pytest.approx(bending, rel=2e-3)


def test_one_strut_as_beam_shell_and_solid():
    """ν = 0, so that the clamp restrains no contraction: what is left is warping, (h/L)²."""
    length, width, height = 0.3, 0.02, 0.01
    held = [ao.Support(at(0, 0.0))]
    x = np.column_stack([np.linspace(0, length, 21), np.zeros((21, 2))])
    cells = np.column_stack([np.arange(20), np.arange(1, 21)])
    line = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells, x, "interval", 1))
    section = ao.Section.rectangle(width=width, height=height)
    bar = ao.Beam(E, 0.0, RHO, section, orientation=(0, 0, 1))
    box = dolfinx.mesh.create_box(
        MPI.COMM_WORLD,
        [np.zeros(3), np.array([length, width, height])],
        [24, 2, 2],
        dolfinx.mesh.CellType.hexahedron,
    )
    beam, shell, solid = (
        frequencies(part, 3)
        for part in (
            ao.Structure(line, bar, held),
            ao.Structure(rectangle((20, 2), length, width), ao.Shell(E, 0.0, RHO, height), held),
            ao.Structure(ao.read_mesh(box), ao.Solid(E, 0.0, RHO), held),
        )
    )
    # twice in the thickness' direction, between them once in the width's
    assert beam[1] / beam[0] == pytest.approx(width / height, rel=1e-2)
    assert shell == pytest.approx(beam, rel=2e-3)
    assert solid == pytest.approx(beam, rel=2e-3)


# --- sites ------------------------------------------------------------------------------------


def compliance(structure, site):
    b = functional(structure, site).b
    return float(b @ structure.factorize().solve_checked(b))


@pytest.mark.parametrize("n", [10, 16])
@pytest.mark.parametrize("radius", [0.1, 0.05])
def test_patch_compliance_is_mindlins(n, radius):
    """Independent of the mesh, and the double series' value."""
    exact = SupportedPlate(E, NU, RHO, 0.1, 1.0, 1.0).mindlin_compliance(0.45, 0.4, radius, 400)
    found = compliance(plate(n, 0.1), ao.Site((0.45, 0.4, 0), (0, 0, 1), radius=radius))
    assert found == pytest.approx(exact, rel=2e-3)


def test_the_default_radius_is_the_thickness():
    structure = plate(12, 0.1)
    site = ao.Site((0.45, 0.4, 0), (0, 0, 1))
    assert functional(structure, site).radius == pytest.approx(0.1)
    same = compliance(structure, ao.Site((0.45, 0.4, 0), (0, 0, 1), radius=0.1))
    assert compliance(structure, site) == pytest.approx(same, rel=1e-12)
    assert ao.extract(structure, site, n=2).radius == pytest.approx(0.1)


def test_the_weights_of_a_patch_are_its_motion():
    """bᵀu of constant, linear and quadratic deflections, exactly."""
    structure = plate(6, 0.02, supports=[])
    radius = 0.13
    b = functional(structure, ao.Site((0.5, 0.45, 0), (0, 0, 2), radius=radius)).b
    assert b @ interpolated(structure, lambda x: {"z": 1.0}) == pytest.approx(1, rel=1e-12)
    assert b @ interpolated(structure, lambda x: {"z": x[:, 0]}) == pytest.approx(0.5, rel=1e-12)
    # the mean of x² over √(1 − r²/a²): a²/5
    square = b @ interpolated(structure, lambda x: {"z": (x[:, 0] - 0.5) ** 2})
    assert square == pytest.approx(radius**2 / 5, rel=1e-9)
    assert b @ interpolated(structure, lambda x: {"x": 1.0, "rx": 5.0}) == pytest.approx(
        0, abs=1e-12
    )


def test_a_patch_over_the_edge_warns():
    with pytest.warns(AntioscWarning, match="an edge cuts the patch"):
        functional(plate(6, 0.02, supports=[]), ao.Site((0.01, 0.45, 0), (0, 0, 1), radius=0.1))


def test_a_site_on_a_plane_plate_is_struck_across_it():
    flat, space = plate(6, 0.05, gdim=2), plate(6, 0.05)
    site = ao.Site((0.4, 0.45, 0), (0, 0.5, 1))
    assert compliance(flat, site) == pytest.approx(compliance(space, site), rel=1e-9)


def thin_plate_graded_to(point, cell, n=28):
    def graded(s, centre):
        side = np.where(s < 0.5, centre, 1 - centre)
        return centre + np.sign(s - 0.5) * side * np.abs(2 * s - 1) ** 1.5

    mesh = sheet(n, lambda s, t: (graded(s, point[0]), graded(t, point[1]), 0 * s), cell)
    return ao.Structure(mesh, ao.Shell(E, NU, RHO, 1e-3), SIMPLE)


@pytest.mark.slow
@pytest.mark.parametrize("point", [(0.5, 0.5), (0.35, 0.3)])
@pytest.mark.parametrize("cell", [pytest.param("triangle", marks=pytest.mark.slow), CELLS[1]])
def test_thin_plate_anti_oscillators_are_kirchhoffs(point, cell):
    """t/L = 1e-3: k0, m_st, and the first five frequencies and masses within 0.5 %.

    The mesh is graded: under a point force the bending moments grow as ln r, so a uniform mesh
    converges with h² only.
    """

    structure = thin_plate_graded_to(point, cell)
    exact = SupportedPlate(E, NU, RHO, 1e-3, 1.0, 1.0).anti_oscillators(*point, 5)
    model = ao.extract(structure, ao.Site((*point, 0), (0, 0, 1)), n=5, method="modes", tol=1e-4)
    assert model.k0 == pytest.approx(exact.k0, rel=5e-3)
    assert model.m_st == pytest.approx(exact.m_st, rel=5e-3)
    assert model.omega == pytest.approx(exact.omega, rel=5e-3)
    assert model.m == pytest.approx(exact.m, rel=5e-3)


@pytest.mark.parametrize("point", [(0.5, 0.5), (0.35, 0.3)])
def test_constraint_modes_are_counted(point):
    """A mode that the site does not see, or the rest of a repeated one, is a constraint mode too.

    Up to the i-th anti-oscillator there are as many constraint modes as natural ones, and i of
    them carry mass.
    """
    theory = SupportedPlate(E, NU, RHO, 1e-3, 1.0, 1.0)
    exact = theory.anti_oscillators(*point, 5)
    m = np.arange(1, 20)
    natural = int(np.sum(theory.kirchhoff(m[:, None], m) < exact.omega[-1]))
    structure = thin_plate_graded_to(point, "quadrilateral", 14)
    site = functional(structure, ao.Site((*point, 0), (0, 0, 1)))
    static = static_mode(structure, site)
    modes = ModeSolver(structure, static).lowest(natural + 4)
    below = modes.omega < exact.omega[-1] * 1.02
    carry = (modes.phi.T @ static.m_phi) ** 2 > 1e-4 * static.mass
    assert np.sum(below) == natural
    assert np.sum(below & carry) == 5


# --- bad input --------------------------------------------------------------------------------


@pytest.mark.parametrize("thickness", [0.0, -1e-3, float("nan")])
def test_thickness_must_be_positive(thickness):
    with pytest.raises(InputError, match="thickness must be"):
        ao.Shell(E, NU, RHO, thickness)


def test_a_triangle_without_area():
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0.0]])
    cells = np.array([[0, 1, 2], [0, 1, 3]])

    mesh = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells, x, "triangle", 1))
    with pytest.raises(
        InputError, match=r"1 of 2 triangle cells have no area, one at \(1, 0, 0\) m"
    ):
        ao.Structure(mesh, ao.Shell(E, NU, RHO, 0.01))


def test_lines_volumes_and_linear_elements_are_refused():
    with pytest.raises(InputError, match="need order=2 of Structure"):
        ao.Structure(rectangle(2, 1, 1), ao.Shell(E, NU, RHO, 0.01), order=1)
    with pytest.raises(InputError, match="Shell needs a mesh of triangles or quadrilaterals"):
        ao.Structure(ao.read_mesh("meshes/beam.msh"), ao.Shell(E, NU, RHO, 0.01))
