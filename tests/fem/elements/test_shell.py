"""Shells: patches, membranes, bending, published plates, and meshes that are surfaces."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg

import antiosc as ao
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from assemblies import compliances
from plates import SupportedPlate
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


@pytest.mark.slow
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


# --- Sheets that are struck beyond linear theory: which are told, and how much they stretch -------


def struck(model):
    return ao.simulate(model, ao.RigidMass(0.2, 5.0), ao.Linear(1e6), 0.02)


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


def thin_plate_graded_to(point, cell, n=20):
    def graded(s, centre):
        side = np.where(s < 0.5, centre, 1 - centre)
        return centre + np.sign(s - 0.5) * side * np.abs(2 * s - 1) ** 1.5

    mesh = sheet(n, lambda s, t: (graded(s, point[0]), graded(t, point[1]), 0 * s), cell)
    return ao.Structure(mesh, ao.Shell(E, NU, RHO, 1e-3), SIMPLE)


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


@pytest.mark.sample(-1)
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


@pytest.mark.slow
@pytest.mark.parametrize(("n", "radius"), [(10, 0.1), (12, 0.05)])
def test_patch_compliance_is_mindlins(n, radius):
    """Independent of the mesh, and the double series' value."""
    exact = SupportedPlate(E, NU, RHO, 0.1, 1.0, 1.0).mindlin_compliance(0.45, 0.4, radius, 400)
    found = compliances(plate(n, 0.1), ao.Site((0.45, 0.4, 0), (0, 0, 1), radius=radius))
    assert found == pytest.approx(exact, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("point", "cell"), [((0.35, 0.3), "triangle")])
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
