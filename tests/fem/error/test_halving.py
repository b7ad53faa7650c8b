"""The error of beams by a mesh of half the size, against finer meshes."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.error.bisection import excess, halved, interpolation, with_node
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.structure.structure import on_mesh
from antiosc.simulation.histories.parts import QUANTITIES
from parts import frame, line, named

pytestmark = pytest.mark.slow

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


@pytest.mark.sample
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


@pytest.mark.sample
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


def test_what_halving_does_not_take():
    part, _ = CASES["portal"]
    with pytest.raises(ao.InputError, match="Site"):
        ao.extract(part(4, 2), ao.Site(dof=20), n=2, error="estimate")


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


def test_a_node_at_the_site_keeps_groups():
    mesh = named(line(1.0, 6).dolfinx, {"thin": (1, lambda x: x[0] < 0.501)})
    cut = with_node(mesh, np.array([0.4, 0.0, 0.0]))
    assert cut.n_cells == 7
    assert len(cut.groups["thin"][1]) == 4
    assert np.min(np.abs(cut.dolfinx.geometry.x[:, 0] - 0.4)) < 1e-15
    assert with_node(cut, np.array([0.4, 0.0, 0.0])).n_cells == 7


@pytest.mark.sample
@pytest.mark.parametrize("order", [1, 2])
def test_interpolated_rigid_motions_have_no_strain(order):
    part = on_mesh(ao.Structure(frame(*IN_SPACE, 3), BEAM, order=order))
    fine = part.again(halved(part.mesh, np.array([0.0, 0.55, 0.11])))
    up = interpolation(part, fine)
    K = csr(fine.K)
    assert np.allclose(up @ np.ones(up.shape[1]), 1.0)
    moved = up @ part.rigid_modes
    assert np.abs(K @ moved).max() < 1e-9 * abs(K).max() * np.abs(moved).max()


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
