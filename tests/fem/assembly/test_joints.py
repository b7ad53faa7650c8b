"""Joints between parts against closed forms, transfer matrices, one mesh and dense solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

import antiosc as ao
import every_joint
from antiosc.fem.assembly.joints import beam_matrices
from assemblies import BEAM, NU, SOLID, E, box, dense, eigenfrequencies, free_dofs, line
from marks import FREE_ON_PURPOSE

pytestmark = [
    FREE_ON_PURPOSE,
    pytest.mark.filterwarnings("ignore:the joints leave:antiosc.base.errors.AntioscWarning"),
    pytest.mark.filterwarnings("ignore:the joints leave parts free"),
    pytest.mark.filterwarnings("ignore:the facets at the site"),
]


CLAMP = ao.Support("start")
EI = E * BEAM.section.I
GA = E / (2 * (1 + NU)) * BEAM.section.A * BEAM.section.shear


TIP = ao.Site((1.0, 0, 0), (0, 0.3, -1))


def whole() -> ao.Structure:
    return ao.Structure(line((0, 0, 0), (1, 0, 0), 20), BEAM, [CLAMP])


def test_a_weld_at_a_distance_is_a_rigid_arm():
    """A weight on an arm: force and moment on the end of the beam."""
    parts = {"beam": ao.Structure(line((0, 0, 0), (0.5, 0, 0), 10), BEAM, [CLAMP])}
    arm = ao.assemble(
        parts, [ao.Weld("beam:end", "hub")], points={"hub": (0.7, 0.0, 0.0)},
        attached=[ao.PointMass("hub", 2.0, 0.01)],
    )  # fmt: skip
    six = arm.layout.point_dofs("hub")
    q = np.zeros(arm.size)
    free = free_dofs(arm)
    K, _ = dense(arm)
    q[free] = np.linalg.solve(K, (arm.T.T[:, six[2]].toarray().ravel())[free])
    L, a = 0.5, 0.2
    exact = L**3 / (3 * EI) + a * L**2 / EI + a**2 * L / EI + L / GA
    assert (arm.T @ q)[six[2]] == pytest.approx(exact, rel=1e-9)
    assert arm.mass == pytest.approx(0.5 * 2700.0 * BEAM.section.A + 2.0, rel=1e-12)


@pytest.mark.slow
def test_a_mean_spreads_a_force_evenly():
    """A block pulled at a reference point that follows the mean of its face stretches evenly."""
    rolls = [ao.Support(f"{axis}0", axis) for axis in "xyz"]
    for cell in ("hexahedron", "tetrahedron"):
        part = ao.Structure(box((0, 0, 0), (2, 1, 1), (3, 2, 2), cell), SOLID, rolls)
        pulled = ao.assemble(
            {"block": part}, [ao.Mean("block:x1", "hub")], points={"hub": (2.5, 0.5, 0.5)}
        )
        x = pulled.layout.point_dofs("hub")[0]
        load = pulled.T.T[:, x].toarray().ravel()
        free = free_dofs(pulled)
        q = np.zeros(pulled.size)
        q[free] = np.linalg.solve(dense(pulled)[0], load[free])
        u = pulled.T @ q
        assert u[x] == pytest.approx(2 / E, rel=1e-9)
        nodes = pulled.layout.members["block"].nodes
        exact = nodes * np.array([1, -NU, -NU]) / E
        assert u[: nodes.size] == pytest.approx(exact.ravel(), abs=1e-9 * 2 / E)


def test_a_bolt_deforms_in_shear_by_the_coefficient_of_each_plane():
    """L³/3EI + L/GκA under a force along the height, and across it."""
    section = replace(BEAM.section, I_side=BEAM.section.I / 4, shear=0.7, shear_side=0.3)
    k, _ = beam_matrices(replace(BEAM, section=section), 0.3)
    flexibility = np.linalg.inv(k[6:, 6:])
    for row, I, shear in ((1, section.I, 0.7), (2, section.I_side, 0.3)):  # noqa: E741
        exact = 0.3**3 / (3 * E * I) + 0.3 / (BEAM.G * section.A * shear)
        assert flexibility[row, row] == pytest.approx(exact, rel=1e-9)


def test_an_assembly_of_one_part_is_the_part():
    """Without joints and supports; turned, it has the same inertia about its own axes."""
    block = ao.Structure(box((0, 0, 0), (1, 2, 3), (1, 1, 1)), SOLID)
    turned = ao.assemble({"block": block}, at={"block": ao.Placement(axis=(0, 0, 1), angle=0.5)})
    assert turned.rigid_modes.shape[1] == 6
    ours, own = (np.linalg.eigvalsh(s.rigid_inertia[0].matrix) for s in (turned, block))
    assert ours == pytest.approx(own, rel=1e-9)
    low, same = (eigenfrequencies(s, 9)[6:] for s in (turned, block))
    assert low == pytest.approx(same, rel=1e-7)


@pytest.mark.slow
def test_a_bolt_is_a_beam():
    """A cantilever of which a piece is a Bolt: static stiffness exact, mass and low modes near."""
    inner = ao.Structure(line((0, 0, 0), (0.5, 0, 0), 10), BEAM, [CLAMP])
    outer = ao.Structure(line((0.6, 0, 0), (1, 0, 0), 8), BEAM)
    joined = ao.assemble(
        {"inner": inner, "outer": outer}, [ao.Bolt("inner:end", "outer:start", BEAM)]
    )
    ours, theirs = ao.extract(joined, TIP, n=6), ao.extract(whole(), TIP, n=6)
    assert joined.mass == pytest.approx(whole().mass, rel=1e-12)
    assert ours.k0 == pytest.approx(theirs.k0, rel=1e-9)
    assert ours.omega[:3] == pytest.approx(theirs.omega[:3], rel=1e-4)


@pytest.mark.slow
def test_every_joint_against_dense_matrices():
    """Tie, Rigid, Mean, Weld, Hinge, Ball, Slider, Bolt, Bushing, Equation, superelement, mass."""
    part = every_joint.assembly()
    K, M, b = every_joint.dense(every_joint.parts())
    assert part.dofs == len(K)
    model = ao.extract(part, every_joint.SITE, n=40)
    for omega in np.array([0.0, 0.3, 0.77, 1.4, 2.5]) * model.omega[0]:
        exact = 1 / (b @ scipy.linalg.solve(K - omega**2 * M, b))
        assert model.dynamic_stiffness(omega).real == pytest.approx(exact, rel=1e-9)
