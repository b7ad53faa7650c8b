"""Mesh files that cannot be used are refused in one sentence."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
from mpi4py import MPI

import antiosc as ao
from mesh_files import one_sentence, refused, write

pytestmark = pytest.mark.fem
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


def test_missing_file(tmp_path):
    with refused("check", ao.MeshError) as caught:
        ao.read_mesh(tmp_path / "part.msh")
    assert one_sentence(str(caught.value))


@pytest.mark.parametrize(
    "suffix", ["msh", "step", "brep", "geo", "vtu", "inp", "bdf", "med", "xyz", "stl"]
)
def test_a_file_of_something_else(tmp_path, suffix):
    path = tmp_path / f"part.{suffix}"
    path.write_text("Dear reader,\nthis is no mesh.\n")
    with refused(rf"part\.{suffix}", ao.MeshError) as caught:
        ao.read_mesh(path, size=0.1 if suffix in ("step", "brep", "geo") else None)
    assert one_sentence(str(caught.value)), str(caught.value)


@pytest.mark.parametrize("read", [ao.read_mesh, ao.read_model])
def test_a_communicator_without_processes(read):
    with refused("COMM_NULL"):
        read("meshes/lever.msh", comm=MPI.COMM_NULL)


def test_a_geometry_needs_a_size_and_a_mesh_takes_none(tmp_path):
    with refused("geometry"):
        ao.read_mesh("meshes/bracket.step")
    with refused("size"):
        ao.read_mesh("meshes/lever.msh", size=0.01)
    with refused(r"size must be > 0 \(in m\); got -1"):
        ao.read_mesh("meshes/bracket.step", size=-1)
    with refused(r"gdim must be 2 or 3; got 4"):
        ao.read_mesh("meshes/lever.msh", gdim=4)
    with refused(r"order must be 1 or 2; got 3"):
        ao.read_mesh("meshes/lever.msh", order=3)
    with refused(r"a size of refine must be > 0"):
        ao.read_mesh("meshes/bracket.step", size=0.1, refine=[((0, 0, 0), 0.0)])


def test_cells_that_no_element_carries(tmp_path):
    points = [*SQUARE, [0.5, 0.5, 0.0]]
    path = write(tmp_path / "part.vtu", points, ("polygon", [range(5)]))
    with refused(r"part\.vtu holds polygon cells", ao.MeshError):
        ao.read_mesh(path)
    path = write(tmp_path / "points.vtu", points, ("vertex", [[0], [1]]))
    with refused(r"points\.vtu contains no cells", ao.MeshError):
        ao.read_mesh(path)
    (tmp_path / "empty.off").write_text("OFF\n\n1 0 0\n\n0 0 0\n")
    with refused(r"empty\.off contains no cells", ao.MeshError):
        ao.read_mesh(tmp_path / "empty.off")


def test_pieces_that_share_no_node(tmp_path):
    points = [*SQUARE, *(SQUARE + np.array([1.5, 0, 0])), *(SQUARE + np.array([2.5, 0, 0]))]
    quads = [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]]
    path = write(tmp_path / "part.vtu", points, ("quad", quads))
    with refused(
        r"part\.vtu falls into 3 pieces that share no node \(1, 1, 1 cells\)", ao.MeshError
    ):
        ao.read_mesh(path)


def test_coordinates_that_are_not_numbers(tmp_path):
    points = SQUARE.copy()
    points[2, 1] = np.nan
    path = write(tmp_path / "part.vtu", points, ("quad", [[0, 1, 2, 3]]))
    with refused("coordinates", ao.MeshError):
        ao.read_mesh(path)


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
