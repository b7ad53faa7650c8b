"""Sites, extractions and impacts that cannot be are refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

import antiosc as ao
import parts
from mesh_files import one_sentence, refused, write

SOLID = ao.Solid(**parts.STEEL)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


@pytest.fixture(scope="module")
def clamped():
    return ao.Structure(parts.box(), SOLID, [ao.Support("left")])


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({}, r"a Site needs one of: point with direction, dof, vector, or node"),
        ({"point": (0, 0, 0), "dof": 3}, r"a Site needs one of"),
        ({"point": (0, 0, 0)}, r"needs the direction of impact"),
        ({"point": (0, 0, 0), "direction": (0, 0, 0)}, r"direction must not be the zero vector"),
        (
            {"point": (0, 0, 0), "direction": (0, 1)},
            r"must both have 2 or 3 coordinates; got 3 and 2",
        ),
        ({"point": (0,), "direction": (1,)}, r"must both have 2 or 3 coordinates; got 1 and 1"),
        ({"point": (0, np.nan, 0), "direction": (0, 0, 1)}, r"point must be finite"),
        ({"point": (0, 0, 0), "direction": (0, np.inf, 1)}, r"direction must be finite"),
        ({"point": (0, 0, 0), "direction": (0, 0, 1), "radius": 0.0}, r"radius must be > 0"),
        ({"dof": 0, "radius": 0.1}, r"radius needs a mesh"),
        ({"dof": 0, "vector": [1.0]}, r"a Site needs one of"),
        ({"dof": -1}, r"dof must be a whole number >= 0"),
        ({"vector": "b"}, r"vector must"),
        ({"node": 3}, r"at a node needs one of: dof, as dof='z', or direction"),
        ({"node": 3, "dof": "z", "direction": (0, 0, 1)}, r"at a node needs one of"),
        ({"node": 3, "point": (0, 0, 0), "direction": (0, 0, 1)}, r"a Site needs one of"),
        ({"node": 3, "vector": [1.0], "dof": "z"}, r"a Site needs one of"),
        ({"node": -3, "dof": "z"}, r"node must be a whole number"),
        ({"node": 3, "direction": (0, 0, 0)}, r"direction must not be the zero vector"),
        ({"node": 3, "direction": (1,)}, r"must both have 2 or 3 coordinates"),
        ({"node": 3, "dof": "w"}, r"dof"),
        ({"dof": 0, "tangential": True}, r"tangential directions need a Site with a direction"),
        ({"dof": 0, "snap": "no"}, r"snap must be"),
        ({"dof": 0, "tangential": 3}, r"tangential must be"),
        ({"dof": 0, "part": "a"}, r"part= names the part of an assembly"),
        ({"point": (0, 0, 0), "direction": (0, 0, 1), "part": ""}, r"part must be a name"),
        ({"point": "", "direction": (0, 0, 1)}, r"point must be a name"),
        ({"point": "top"}, r"needs the direction of impact"),
    ],
)
def test_sites(clamped, arguments, text):
    with refused(text) as caught:
        ao.extract(clamped, ao.Site(**arguments))
    assert one_sentence(str(caught.value))


@pytest.mark.parametrize(
    ("K", "M", "text"),
    [
        ([[2, np.nan], [np.nan, 1]], np.eye(2), r"K holds NaN or infinite entries"),
        (np.eye(2), [[1, 0], [0, np.inf]], r"M holds NaN or infinite entries"),
        ([[2, 1], [0, 1]], np.eye(2), r"K must be symmetric"),
        (np.eye(2), [[1, 2], [0, 1]], r"M must be symmetric"),
        (np.eye(3), np.eye(2), r"K and M must be of one size; got \(3, 3\) and \(2, 2\)"),
        (np.ones((2, 3)), np.eye(2), r"K must be square; got 2 rows and 3 columns"),
        ("stiffness", np.eye(2), r"K must be a SciPy sparse, dense or PETSc matrix; got str"),
        (np.zeros((0, 0)), np.zeros((0, 0)), r"K must be square; got 0 rows"),
    ],
)
@pytest.mark.parametrize("sparse", [False, True])
def test_matrices(K, M, text, sparse):
    if sparse and not isinstance(K, str):
        K, M = (scipy.sparse.csr_matrix(np.asarray(A, dtype=float)) for A in (K, M))
    with refused(text):
        ao.Structure.from_matrices(K, M)


def test_rounding_in_foreign_matrices_is_no_asymmetry():
    """An entry of 1e-12 whose mirror was dropped."""
    K = np.array([[2e4, -1e4, 1e-9], [-1e4, 2e4, -1e4], [0, -1e4, 2e4]])
    assert ao.Structure.from_matrices(scipy.sparse.csr_matrix(K), np.eye(3)).dofs == 3


def test_loose_bodies_in_matrices():
    pairs = np.kron(np.eye(20), 1e4 * np.array([[1, -1], [-1, 1]]))
    with refused("matrices"):
        ao.Structure.from_matrices(pairs, np.eye(40))


def test_matrices_of_no_structure():
    with refused(r"K must be positive semidefinite; its diagonal has -2 in row 1"):
        ao.Structure.from_matrices(np.diag([1.0, -2.0, 3.0]), np.eye(3))
    with refused(r"M must be positive semidefinite; its diagonal has -1 in row 0"):
        ao.Structure.from_matrices(np.eye(3), np.diag([-1.0, 1.0, 1.0]))
    with refused("structure"):
        ao.Structure.from_matrices(np.eye(3), np.zeros((3, 3)))
    with refused(r"K is zero"):
        ao.Structure.from_matrices(np.zeros((3, 3)), np.eye(3))


def hinge(tmp_path: Path) -> ao.Mesh:
    """Two squares that touch in one corner: one turns about the other."""
    points = [*SQUARE, [2, 1, 0], [2, 2, 0], [1, 2, 0]]
    path = write(tmp_path / "hinge.vtu", points, ("quad", [[0, 1, 2, 3], [2, 4, 5, 6]]))
    return ao.read_mesh(path)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["modes", "krylov"])
@pytest.mark.parametrize("supports", [[ao.Support(lambda x: np.isclose(x[0], 0))], []],
                         ids=["supported", "free"])  # fmt: skip
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AntioscWarning")
def test_a_part_that_hangs_on_one_node(tmp_path, supports, method):
    """A mechanism: the factor may pass, but no number made with it may."""
    structure = ao.Structure(hinge(tmp_path), ao.Solid(**parts.STEEL, plane="stress"), supports)
    with refused("hinge", (ao.AccuracyError, ao.NotConvergedError)):
        ao.extract(structure, ao.Site((2.0, 2.0), (-1, 1)), n=3, method=method)
