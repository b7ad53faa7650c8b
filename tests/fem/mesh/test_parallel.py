"""Meshes that all ranks read, each its own part."""

from __future__ import annotations

import json

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.base.errors import MeshError
from mpi import START, run_ranks

SIZE = (0.2, 0.1, 0.04)


@pytest.fixture
def file(tmp_path):
    """A block in mm with the faces of one end marked 7 and half of the cells 1."""
    corners = [[0, 0, 0], [1000 * one for one in SIZE]]
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, corners, [8, 4, 3])
    path = tmp_path / "block.xdmf"
    with dolfinx.io.XDMFFile(MPI.COMM_SELF, str(path), "w") as opened:
        opened.write_mesh(mesh)
        for name, dim, value, inside in (("faces", 2, 7, 0.0), ("cells", 3, 1, 100.0)):
            found = dolfinx.mesh.locate_entities(
                mesh, dim, lambda x, end=inside: x[0] <= end + 1e-6
            )
            mesh.topology.create_connectivity(dim, 3)
            tags = dolfinx.mesh.meshtags(mesh, dim, found, np.full(len(found), value, np.int32))
            tags.name = name
            opened.write_meshtags(tags)
    return path


MODEL = """
mesh = ao.read_mesh(sys.argv[1], trust=True, unit="mm")
own = compat.cell_map(mesh.dolfinx).size_local
part = ao.Structure(mesh, ao.Solid(**parts.STEEL), [ao.Support("faces 7")])
model = ao.extract(part, ao.Site((0.18, 0.05, 0.04), (0, 0, -1), radius=0.03), n=4)
print(json.dumps([sorted(mesh.groups), part.mass, model.k0, *model.omega[:2]]))
print(json.dumps(mesh.comm.allgather(own)))
"""


@pytest.mark.slow
def test_the_part_of_one_rank_and_of_two(file):
    models, cells = {}, {}
    for n in (1, 2):
        first = run_ranks(n, START + MODEL, str(file), alone=True)[0]
        models[n], cells[n] = map(json.loads, first.splitlines()[-2:])
    assert models[1][0] == models[2][0] == ["cells 1", "faces 7"]
    assert models[1][1] == pytest.approx(np.prod(SIZE) * 7850.0, rel=1e-9)
    np.testing.assert_allclose(models[2][1:], models[1][1:], rtol=1e-8)
    assert sum(cells[2]) == cells[1][0] == 8 * 4 * 3 * 6
    assert max(cells[2]) < 0.7 * cells[1][0]


DAMAGED = """
try:
    ao.read_mesh(sys.argv[1], trust=True)
except ao.errors.MeshError as error:
    print(json.dumps(str(error)))
"""


def test_a_damaged_file_is_refused_on_all_ranks(file):
    arrays = file.with_suffix(".h5")
    arrays.write_bytes(arrays.read_bytes()[:3000])
    for line in run_ranks(2, START + DAMAGED, str(file), alone=True):
        assert "block.xdmf cannot be read as dolfinx's XDMF" in line
    file.write_text("<Xdmf")
    with pytest.raises(MeshError, match="cannot be read as XDMF"):
        ao.read_mesh(file, trust=True)


def test_what_needs_one_rank_is_refused(file):
    with pytest.raises(ao.errors.InputError, match="read by all ranks as it is"):
        ao.read_mesh(file, trust=True, order=2)
