"""Shells on any mesh: what must hold on each, and sites."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg

import antiosc as ao
from antiosc.closed_form.plates import SupportedPlate
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.site import functional
from sheets import (
    CELLS,
    NU,
    RHO,
    SIMPLE,
    E,
    at,
    dof,
    edges,
    interpolated,
    loaded,
    plate,
    sheet,
)


def thin_plate_graded_to(point, cell, n=28):
    def graded(s, centre):
        side = np.where(s < 0.5, centre, 1 - centre)
        return centre + np.sign(s - 0.5) * side * np.abs(2 * s - 1) ** 1.5

    mesh = sheet(n, lambda s, t: (graded(s, point[0]), graded(t, point[1]), 0 * s), cell)
    return ao.Structure(mesh, ao.Shell(E, NU, RHO, 1e-3), SIMPLE)


SHELLS = [(cell, order) for cell in CELLS for order in (1, 2)]


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


@pytest.mark.sample
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


def compliance(structure, site):
    b = functional(structure, site).b
    return float(b @ structure.factorize().solve_checked(b))


@pytest.mark.sample
@pytest.mark.parametrize("n", [10, 16])
@pytest.mark.parametrize("radius", [0.1, 0.05])
def test_patch_compliance_is_mindlins(n, radius):
    """Independent of the mesh, and the double series' value."""
    exact = SupportedPlate(E, NU, RHO, 0.1, 1.0, 1.0).mindlin_compliance(0.45, 0.4, radius, 400)
    found = compliance(plate(n, 0.1), ao.Site((0.45, 0.4, 0), (0, 0, 1), radius=radius))
    assert found == pytest.approx(exact, rel=2e-3)


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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("point", "cell"), [((0.35, 0.3), "triangle"), ((0.5, 0.5), "quadrilateral")]
)
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
