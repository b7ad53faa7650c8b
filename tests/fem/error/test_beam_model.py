"""The error of k0 by halved meshes, of solids and of beams."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.structure.structure import on_mesh
from antiosc.impact.histories.bars import QUANTITIES
from antiosc.reduce.error.division import divided_mesh, interpolation_matrix
from parts import frame, line

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
    assert "beam theory itself" in " ".join(budget.notes)
    coarse = "the mesh is coarse" in " ".join(budget.notes)
    assert coarse == (order == 1)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_interpolated_rigid_motions_have_no_strain(order):
    part = on_mesh(ao.Structure(frame(*IN_SPACE, 3), BEAM, order=order))
    fine = part.reassembled(divided_mesh(part.mesh))
    up = interpolation_matrix(part, fine)
    K = csr(fine.K)
    assert np.allclose(up @ np.ones(up.shape[1]), 1.0)
    moved = up @ part.rigid_modes
    assert np.abs(K @ moved).max() < 1e-9 * abs(K).max() * np.abs(moved).max()
