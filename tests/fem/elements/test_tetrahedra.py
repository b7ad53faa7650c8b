"""Products from the cells against the entries that dolfinx assembles."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.fem.elements import tetrahedra
from antiosc.fem.elements.tetrahedra import Tetrahedra
from antiosc.fem.linalg.iterative import coarse_matrix
from antiosc.fem.linalg.petsc_algebra import (
    CELLS_KEY,
    csr,
    multiply,
    multiply_linear,
    sum_of,
    with_entries,
)
from antiosc.fem.platform import compat
from mpi import START, run_ranks

STEEL, RUBBER = ao.Solid(**parts.STEEL), ao.Solid(1e9, 0.45, 1100.0)
HELD = [
    ao.Support(lambda x: np.isclose(x[1], 0.0), ["x", "z"]),
    ao.Support(lambda x: np.isclose(x[0], 0.0), ["x", "y"]),
]


@pytest.fixture(autouse=True)
def of_small_parts(monkeypatch):
    monkeypatch.setattr(tetrahedra, "LEAST_CELLWISE_DOFS", 0)


def skewed(order: int = 1) -> ao.Mesh:
    """Cells of two groups that are all different, in number no multiple of the lanes; of order 2
    some of them are curved.
    """
    if order == 1:
        corners = [[0.0, 0.0, 0.0], [0.2, 0.1, 0.08]]
        kind = dolfinx.mesh.CellType.tetrahedron
        mesh = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, [3, 3, 3], kind)
    else:
        with TemporaryDirectory() as folder:
            file = parts.gmsh_cube(Path(folder) / "cube.msh", "tetrahedron", 2, n=3)
            mesh = ao.read_mesh(file).dolfinx
        mesh.geometry.x[:] *= [0.2, 0.1, 0.08]
    x = mesh.geometry.x
    moved = (x[:, 1:2] > 0) & (x[:, :1] > (0.0 if order == 1 else 0.1))
    x[:] += 0.005 * np.sin(40 * x[:, [1, 2, 0]]) * moved
    count = mesh.topology.index_map(3).size_local
    groups = {}
    for name, cells in (("soft", range(count // 3)), ("hard", range(count // 3, count))):
        cells = np.array(cells, dtype=np.int32)
        groups[name] = dolfinx.mesh.meshtags(mesh, 3, cells, np.ones_like(cells)), 1
    return ao.read_mesh(mesh, groups=groups)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2], ids=["straight", "curved"])
def test_products_are_those_of_the_entries(order):
    part = ao.Structure(skewed(order), {"soft": RUBBER, "hard": STEEL}, HELD)
    K, M = part.K, part.M
    cells = K.getAttr(CELLS_KEY).cells
    assert type(cells) is Tetrahedra
    assert all(len(kind.nodes) for kind in cells._kinds)
    assert len(cells._kinds) == order
    assert M.getAttr(CELLS_KEY) is not None
    A = sum_of(K, 3e9, M)
    vector, result = A.createVecs()
    for x in np.random.default_rng(0).standard_normal((3, part.rows)):
        for matrix in (K, M, A):
            exact = csr(matrix) @ x
            size = abs(csr(matrix)) @ abs(x)
            rounding = 1e-13 if order == 1 else 1e-11  # a file rounds its nodes
            assert np.all(abs(multiply(matrix, x) - exact) <= rounding * (size + 1e-300))
        vector.setArray(x)
        A.mult(vector, result)
        np.testing.assert_array_equal(result.array_r, multiply(A, x))
    block = np.random.default_rng(1).standard_normal((part.rows, 5))
    np.testing.assert_array_equal(multiply(A, block)[:, 4], multiply(A, block[:, 4]))


def test_a_cell_that_is_folded_at_a_point_has_the_product_of_its_entries():
    """dolfinx takes the size of det J at every point of quadrature."""
    mesh = skewed(2)
    nodes = compat.geometry_nodes(mesh.dolfinx)[-1]
    x = mesh.dolfinx.geometry.x
    x[nodes[9]] = 1.5 * x[nodes[1]] - 0.5 * x[nodes[0]]  # the middle of this edge, beyond its end
    K = ao.Structure(ao.read_mesh(mesh.dolfinx), STEEL, HELD).K
    curved = K.getAttr(CELLS_KEY).cells._kinds[1]
    places = curved._positions[: -tetrahedra.VECTOR_PADDING].reshape(-1, 3)[curved.nodes]
    slopes = np.einsum("cni,qna->cqia", places, curved._rules[0][1])
    assert np.any(np.ptp(np.sign(np.linalg.det(slopes)), axis=1))
    u = np.random.default_rng(0).standard_normal(K.getSize()[0])
    exact = csr(with_entries(K)) @ u
    assert abs(multiply(K, u) - exact).max() <= 1e-11 * abs(exact).max()


def test_smoothing_in_single_precision_does_not_see_where_the_part_is():
    mesh = skewed(2)
    mesh.dolfinx.geometry.x[:] += 1e2
    held = ao.Support(lambda x: np.isclose(x[1], 1e2))
    cells = ao.Structure(mesh, STEEL, [held]).K.getAttr(CELLS_KEY).cells.simplified()
    u = cells.vector(np.float64)
    u[:] = np.random.default_rng(0).standard_normal(len(u))
    found, exact = cells.vector(np.float32), cells.vector(np.float64)
    cells.add(1.0, 1e9, u, exact)
    single = cells.vector(np.float32)
    single[:] = u
    cells.add(1.0, 1e9, single, found)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-5 * abs(exact).max())


CARRIED = [
    ao.PointMass((0.0, 0.1, 0.08), mass=1.0),
    ao.Spring((0.2, 0.05, 0.04), {"y": 1e12, "z": 1e9}),
]


@pytest.mark.slow
@pytest.mark.parametrize("attached", [[], CARRIED], ids=["bare", "attached"])
@pytest.mark.parametrize("order", [1, 2], ids=["straight", "curved"])
def test_what_the_solver_takes_from_the_cells_is_that_of_the_entries(order, attached):
    part = ao.Structure(skewed(order), {"soft": RUBBER, "hard": STEEL}, HELD, attached=attached)
    P = part.matrices.prolongation()
    x = np.random.default_rng(0).standard_normal(part.rows)
    linear = csr(P) @ x[: P.getSize()[1]]
    for matrix in (part.K, part.M, sum_of(part.K, 3e9, part.M)):
        diagonal = matrix.getDiagonal().array  # of the cells: there are no entries yet
        entries = with_entries(matrix)
        whole = csr(entries)
        size = abs(whole) @ abs(x) + 1e-300
        assert np.all(abs(multiply(matrix, x) - whole @ x) <= 1e-11 * size)
        size = abs(whole) @ abs(linear) + 1e-300
        assert np.all(abs(multiply_linear(matrix, linear) - whole @ linear) <= 1e-11 * size)
        most = whole.diagonal().max()
        np.testing.assert_allclose(diagonal, whole.diagonal(), rtol=0, atol=1e-12 * most)
        product = matrix.getAttr(CELLS_KEY)
        blocks = product.cells.blocks(product.k, product.m)
        rows = np.arange(part.rows)[:, None]
        exact = whole.toarray()[rows, rows // 3 * 3 + np.arange(3)]
        np.testing.assert_allclose(blocks, exact, rtol=0, atol=1e-12 * most)
        one, other = (csr(coarse_matrix(a, P)) for a in (matrix, entries))
        near = 1e-12 if order == 1 else 1e-2  # linear elements have fewer points on curved cells
        assert abs(one - other).max() <= near * abs(other).max()


OVER_RANKS = """
from antiosc.fem.elements import tetrahedra
from antiosc.fem.elements.tetrahedra import Tetrahedra
from antiosc.fem.linalg.iterative import coarse_matrix
from antiosc.fem.linalg.petsc_algebra import multiply, with_entries
from mpi4py.MPI import MAX

kept, tetrahedra.LEAST_CELLWISE_DOFS = tetrahedra.LEAST_CELLWISE_DOFS, 0
mesh = parts.box((6, 3, 2), cell="tetrahedron")
part = ao.Structure(mesh, ao.Solid(**parts.STEEL), [ao.Support("left")])
x = np.random.default_rng(part.comm.rank).standard_normal(part.rows)
differences = []
for matrix in (part.K, part.M):
    diagonal = matrix.getDiagonal().array_r  # of the cells: there are no entries yet
    source, exact = matrix.createVecs()
    source.setArray(x)
    with_entries(matrix).mult(source, exact)
    size = part.comm.allreduce(abs(exact.array_r).max(), MAX)
    differences.append(abs(multiply(matrix, x) - exact.array_r).max() / size)
    assembled = with_entries(matrix).getDiagonal().array_r
    differences.append(abs(diagonal - assembled).max() / size)
tetrahedra.LEAST_CELLWISE_DOFS = kept
print(json.dumps(differences))
"""


@pytest.mark.mpi
def test_over_ranks():
    """A rank between two others has ghosts of both."""
    lines = run_ranks(3, START + OVER_RANKS)
    for line in lines:
        assert max(json.loads(line)) <= 1e-13
