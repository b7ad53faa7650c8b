"""Shell elements against plate and shell theory, locking, patch tests, invariances, bad input."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.base.errors import InputError
from antiosc.closed_form.plates import SupportedPlate
from antiosc.fem.elements.shell import CUBIC, QUADRATIC, _dropped_of_cubics
from antiosc.fem.platform import compat
from sheets import (
    CELLS,
    NU,
    RHO,
    E,
    at,
    dof,
    edges,
    frequencies,
    plate,
    pressed,
    rectangle,
    sheet,
)


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


@pytest.mark.slow
@pytest.mark.sample(-1)
@pytest.mark.parametrize("cell", [*CELLS, pytest.param("one way", marks=pytest.mark.slow)])
def test_no_locking(cell):
    """Thin plates err at most twice as much as thick ones on the same mesh.

    Measured, thick and thin: triangles 3e-4 and 3e-4, clamped 6e-4 and 8e-4 (7e-4 and 1e-3 where
    all diagonals go one way); quadrilaterals 6e-4 and 7e-4, clamped 1.2e-3 and 1.7e-3.
    """
    for error in (plate_error, clamped_error):
        thick, thin = error(8, 1e-1, cell), error(8, 1e-4, cell)
        assert thin < 2e-3
        assert thin < 2 * thick


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


@pytest.mark.slow
@pytest.mark.sample
@pytest.mark.parametrize(("cell", "t"), [(c, t) for c in CELLS for t in (1e-1, 1e-3)])
def test_frequencies_converge_with_the_fourth_order(cell, t):
    coarse, fine = plate_error(4, t, cell), plate_error(8, t, cell)
    assert 3.5 < np.log2(coarse / fine) < 5.5
    assert fine < 1.5e-3


@pytest.mark.sample(-1)
@pytest.mark.parametrize(
    ("supports", "factors"),
    [
        pytest.param([], [13.468, 19.596, 24.270, 34.801, 34.801, 61.093], id="FV12"),
        pytest.param(
            [ao.Support(at(0, 0.0))],
            [3.4710, 8.5066, 21.285, 27.199, 30.955, 54.187],
            id="FV16",
            marks=pytest.mark.slow,
        ),
    ],
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
@pytest.mark.sample
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


# --- bad input --------------------------------------------------------------------------------


def test_a_triangle_without_area():
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0.0]])
    cells = np.array([[0, 1, 2], [0, 1, 3]])

    mesh = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells, x, "triangle", 1))
    with pytest.raises(
        InputError, match=r"1 of 2 triangle cells have no area, one at \(1, 0, 0\) m"
    ):
        ao.Structure(mesh, ao.Shell(E, NU, RHO, 0.01))


# --- Sheets that are struck beyond linear theory: which are told, and how much they stretch -------


SIZE = (0.5, 0.3)
RIM = {
    "rim": (1, lambda x: np.isclose(abs(x[0] - 0.25), 0.25) | np.isclose(abs(x[1] - 0.15), 0.15)),
    "left": (1, lambda x: np.isclose(x[0], 0.0)),
}


def model_of(thickness, *held, laminate=False):
    mesh = parts.plate((10, 6), SIZE, groups=RIM)
    mesh = ao.read_mesh(mesh.dolfinx) if not held else mesh
    sheet = ao.Shell(E=70e9, nu=0.33, rho=2700.0, thickness=thickness)
    if laminate:
        layer = ao.Layer.isotropic(70e9, 0.33, 2700.0, thickness / 2)
        sheet = ao.Laminate([layer, layer])
    plate = ao.Structure(mesh, sheet, [ao.Support(where) for where in held])
    return ao.extract(plate, ao.Site((0.25, 0.15, 0.0), (0, 0, -1)), n=10)


def struck(model):
    return ao.simulate(model, ao.RigidMass(0.2, 5.0), ao.Linear(1e6), 0.02)


@pytest.mark.parametrize("laminate", [False, True])
def test_a_clamped_thin_plate_is_told_of(laminate):
    model = model_of(1.5e-3, "rim", laminate=laminate)
    assert model.info.thickness == pytest.approx(1.5e-3)
    with pytest.warns(ao.AccuracyWarning, match=r"thickness 1\.5 mm of its sheet.*nonlinear"):
        hit = struck(model)
    times = abs(hit.displacement).max() / 1.5e-3
    assert 5 < times < 9
    assert f"{times:.2g}" in hit.message


def test_a_stiff_plate_a_cantilever_and_a_free_plate_are_not():
    assert "deflects" not in struck(model_of(20e-3, "rim")).message
    cantilever = model_of(1.5e-3, "left")
    assert cantilever.info.thickness is None
    hit = struck(cantilever)
    assert abs(hit.displacement).max() > 5 * 1.5e-3
    assert "deflects" not in hit.message
    assert "deflects" not in struck(model_of(1.5e-3)).message


@pytest.mark.slow
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
