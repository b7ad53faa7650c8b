"""Mesh files that cannot be used are refused in one sentence."""

from __future__ import annotations

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from mesh_files import one_sentence, refused, write

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


def test_missing_file(tmp_path):
    with refused("check", ao.MeshError) as caught:
        ao.read_mesh(tmp_path / "part.msh")
    assert one_sentence(str(caught.value))


@pytest.mark.parametrize("read", [ao.read_mesh, ao.read_model])
def test_a_communicator_without_processes(read):
    with refused("COMM_NULL"):
        read("meshes/lever.msh", comm=MPI.COMM_NULL)


def test_cells_without_measure(tmp_path):
    line = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]]
    path = write(tmp_path / "line.vtu", line, ("line", [[0, 1], [1, 2], [2, 3]]))
    with refused(
        r"1 of 3 cells of line\.vtu have no length, one at \(1, 0, 0\) m: merge", ao.MeshError
    ):
        ao.read_mesh(path)
    faces = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]]
    path = write(tmp_path / "face.vtu", faces, ("triangle", [[0, 1, 2], [0, 2, 3]]))
    for gdim in (2, 3):
        with refused(r"1 of 2 cells of face\.vtu have no area", ao.MeshError):
            ao.read_mesh(path, gdim=gdim)


def test_what_is_no_file(tmp_path):
    with refused("read_mesh takes a file or a dolfinx mesh; got int 3"):
        ao.read_mesh(3)
    for wrong in (0.1, ((0.1, 0.2, 0.3), 0.1, 4), (0.1, 0.2)):
        with refused("refine"):
            ao.read_mesh("meshes/bracket.step", size=0.1, refine=[wrong])


def test_tags_that_mark_nothing():
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    tags = dolfinx.mesh.meshtags(
        mesh, 2, np.array([0], dtype=np.int32), np.array([3], dtype=np.int32)
    )
    with refused("group 'body': no entity of the mesh tags has the value 4"):
        ao.read_mesh(mesh, groups={"body": (tags, 4)})
    with refused("groups"):
        ao.read_mesh("meshes/lever.msh", groups={"body": (tags, 3)})


def test_cells_that_dolfinx_would_die_of(tmp_path):
    """Two cells with two sides in common; an inner node that is a corner, or a copy."""
    points = [*SQUARE, [0.5, 0.6, 0.0], [0.6, 0.4, 0.0], [0.6, 0.4, 0.0]]
    path = write(tmp_path / "pair.vtu", points, ("quad", [[0, 1, 2, 4], [0, 4, 2, 3]]))
    with refused(r"2 of 2 cells of pair\.vtu share two sides with another one", ao.MeshError):
        ao.read_mesh(path)
    points += [[0.5, 0, 0], [1, 0.5, 0], [0.5, 1, 0], [0, 0.5, 0]]
    for node, says in ((1, r"[12] of 2"), (6, r"1 of 2")):
        cells = [[0, 1, 2, 7, 8, 5], [0, 2, 3, node, 9, 10]]
        path = write(tmp_path / "part.vtu", points, ("triangle6", cells))
        with refused(rf"{says} cells of part\.vtu have a node inside a side", ao.MeshError):
            ao.read_mesh(path)
