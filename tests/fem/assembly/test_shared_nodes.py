"""Meshes with different cells that share nodes, put together, against one mesh."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.assembly.assemble import assemble
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.reading import read_mesh
from antiosc.fem.platform import compat
from antiosc_decks.shared_nodes import SharedNodes
from assemblies import eigenfrequencies

pytestmark = pytest.mark.filterwarnings(
    "ignore:the joints leave:antiosc.base.errors.AntioscWarning"
)

SOLID = ao.Solid(70e9, 0.3, 2700.0)
SHELL = ao.Shell(70e9, 0.3, 2700.0, 0.01)


def joined_at_nodes(parts, numbers) -> ao.Structure:
    return assemble(parts, [SharedNodes(numbers)])


def made(x: np.ndarray, cells: np.ndarray, cell: str) -> tuple[Mesh, np.ndarray]:
    """(mesh of some cells of the points x, the number of each of its nodes)."""
    used, renumbered = np.unique(cells, return_inverse=True)
    mesh = compat.create_mesh(
        MPI.COMM_SELF, renumbered.reshape(cells.shape).astype(np.int64), x[used], cell, 1
    )
    return read_mesh(mesh), used


def lattice(counts: tuple[int, ...], size: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(points (n, dim), numbers of the points on the lattice)."""
    axes = [np.linspace(0, s, n + 1) for n, s in zip(counts, size, strict=True)]
    grid = np.meshgrid(*axes, indexing="ij")
    return np.stack(grid, -1).reshape(-1, len(counts)), np.arange(grid[0].size).reshape(
        grid[0].shape
    )


def plate(n: int, bent: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(points, quadrilaterals of its left half, triangles of its right half)."""
    x, number = lattice((2 * n, n), (0.4, 0.2))
    x = np.column_stack([x, bent * np.maximum(x[:, 0] - 0.2, 0.0)])
    i, j = (k.ravel() for k in np.meshgrid(np.arange(2 * n), np.arange(n), indexing="ij"))
    corners = [number[i, j], number[i + 1, j], number[i, j + 1], number[i + 1, j + 1]]
    quads = np.column_stack(corners)
    left = i < n
    right = quads[~left]
    return x, quads[left], np.vstack([right[:, [0, 1, 2]], right[:, [3, 2, 1]]])


def blocks(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(points, hexahedra of the left half, tetrahedra of the right half of a bar)."""
    x, number = lattice((2 * n, n, n), (2.0, 1.0, 1.0))
    i, j, k = (
        m.ravel() for m in np.meshgrid(np.arange(2 * n), np.arange(n), np.arange(n), indexing="ij")
    )
    steps = [(a, b, c) for c in (0, 1) for b in (0, 1) for a in (0, 1)]
    hexes = np.column_stack([number[i + a, j + b, k + c] for a, b, c in steps])
    six = [[0, 1, 3, 7], [0, 1, 5, 7], [0, 4, 5, 7], [0, 2, 3, 7], [0, 4, 6, 7], [0, 2, 6, 7]]
    right = hexes[i >= n]
    return x, hexes[i < n], np.vstack([right[:, t] for t in six])


@pytest.mark.slow
@pytest.mark.parametrize("bent", [0.0, 0.5])
def test_triangles_beside_quadrilaterals_make_one_shell(bent):
    """A cantilever plate, flat and folded, is as stiff as one of triangles alone."""
    clamp = ao.Support(lambda x: np.isclose(x[0], 0.0))
    x, quads, triangles = plate(4, bent)
    parts, ids = {}, {}
    for name, cells, cell in (("q", quads, "quadrilateral"), ("t", triangles, "triangle")):
        mesh, ids[name] = made(x, cells, cell)
        parts[name] = ao.Structure(mesh, SHELL, [clamp] if name == "q" else [])
    both = joined_at_nodes(parts, ids)
    everywhere = np.vstack([quads[:, [0, 1, 2]], quads[:, [3, 2, 1]], triangles])
    whole = ao.Structure(made(x, everywhere, "triangle")[0], SHELL, [clamp])
    assert both.mass == pytest.approx(whole.mass, rel=1e-12)
    site = ao.Site((0.33, 0.11, 0.13 * bent), (0, 0, -1), radius=0.04)
    ours, theirs = ao.extract(both, site, n=6), ao.extract(whole, site, n=6)
    assert ours.k0 == pytest.approx(theirs.k0, rel=2e-3)
    assert ours.omega[:3] == pytest.approx(theirs.omega[:3], rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_hexahedra_beside_tetrahedra_strain_alike(order):
    """A bar in tension: the state of constant stress of a single part, and its rigid modes."""
    x, hexes, tets = blocks(2)
    parts, ids = {}, {}
    for name, cells, cell in (("h", hexes, "hexahedron"), ("t", tets, "tetrahedron")):
        mesh, ids[name] = made(x, cells, cell)
        parts[name] = ao.Structure(mesh, SOLID, order=order)
    both = joined_at_nodes(parts, ids)
    assert both.rigid_modes.shape[1] == 6
    whole = ao.Structure(made(x, blocks(2)[1], "hexahedron")[0], SOLID, order=order)
    assert both.mass == pytest.approx(2 * whole.mass, rel=1e-12)
    low = eigenfrequencies(both, 8)
    assert (low[:6] < 1e-4 * low[6]).all()
    # stretched along x: u = (x, -ν y, -ν z) is in the space, and its stress is constant
    field = {name: stretched(both.layout.members[name].nodes) for name in ("h", "t")}
    q = np.zeros(both.K.getSize()[0])
    for name, member in both.layout.members.items():
        q[member.rows] = field[name].ravel()
    assert both.T @ np.where(free(both), q, 0.0) == pytest.approx(q, abs=1e-12)


def stretched(x: np.ndarray) -> np.ndarray:
    return x * [1.0, -0.3, -0.3]


def free(structure: ao.Structure) -> np.ndarray:
    mask = np.ones(structure.K.getSize()[0], dtype=bool)
    mask[structure.fixed] = False
    return mask


@pytest.mark.slow
def test_a_skin_of_shell_on_a_solid_follows_it():
    """A shell on the top face of a block adds its mass, and the block stays one body."""
    x, number = lattice((2, 2, 2), (1.0, 1.0, 1.0))
    steps = [(a, b, c) for c in (0, 1) for b in (0, 1) for a in (0, 1)]
    i, j, k = (m.ravel() for m in np.meshgrid(*[np.arange(2)] * 3, indexing="ij"))
    hexes = np.column_stack([number[i + a, j + b, k + c] for a, b, c in steps])
    top = number[:, :, -1]
    quads = np.column_stack([top[:-1, :-1].ravel(), top[1:, :-1].ravel(), top[:-1, 1:].ravel(),
                             top[1:, 1:].ravel()])  # fmt: skip
    solid, of_solid = made(x, hexes, "hexahedron")
    shell, of_shell = made(x, np.vstack([quads[:, [0, 1, 2]], quads[:, [3, 2, 1]]]), "triangle")
    both = joined_at_nodes(
        {"solid": ao.Structure(solid, SOLID), "skin": ao.Structure(shell, SHELL)},
        {"solid": of_solid, "skin": of_shell},
    )
    assert both.rigid_modes.shape[1] == 6
    assert both.mass == pytest.approx(2700.0 * 1.01, rel=1e-12)
    inertia, _ = both.rigid_inertia
    assert inertia.point == pytest.approx([0.5, 0.5, 0.5])
    # the first moment about the middle of the block is that of the skin
    assert np.abs(inertia.matrix[:3, 3:]).max() == pytest.approx(27.0 * 0.5, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("ends", "follows"), [((0, 1), True), ((0, 3), False), ((1, 2), False)])
def test_a_beam_on_an_edge_follows_it_and_one_across_a_cell_its_ends_alone(ends, follows):
    """Both are of degree two: the node inside the beam is one of the sheet on its edges alone."""
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    sheet, of_sheet = made(x, np.array([[0, 1, 2, 3]]), "quadrilateral")
    rib, of_rib = made(x, np.array([ends]), "interval")
    beam = ao.Beam(70e9, 0.3, 2700.0, ao.Section.circle(0.02))
    parts = {"sheet": ao.Structure(sheet, SHELL), "rib": ao.Structure(rib, beam)}
    both = joined_at_nodes(parts, {"sheet": of_sheet, "rib": of_rib})
    assert both.dofs == parts["sheet"].dofs + (0 if follows else 6)
    assert both.rigid_modes.shape[1] == 6
    u = both.T @ np.random.default_rng(1).normal(size=both.size)
    rib_u, sheet_u = (u[both.layout.members[name].rows].reshape(-1, 6) for name in ("rib", "sheet"))
    at_rib, at_sheet = (both.layout.members[name].nodes for name in ("rib", "sheet"))
    for k, place in enumerate(at_rib):
        near = np.linalg.norm(at_sheet - place, axis=1)
        alike = np.allclose(rib_u[k], sheet_u[int(np.argmin(near))], atol=1e-9)
        inside = not np.isclose(np.abs(place[:2] - 0.5).max(), 0.5)
        assert alike == (near.min() < 1e-9 and not inside)
