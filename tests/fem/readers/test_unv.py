"""Universal files: as gmsh writes them, in the order of their nodes, with groups and units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import gmsh

import antiosc as ao
from antiosc.io import by_unv
from antiosc.io.shapes import EDGES

pytestmark = pytest.mark.fem
STEEL = ao.Solid(210e9, 0.3, 7850.0)


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> dict[str, Path]:
    """A cylinder with groups, by gmsh as .unv and .msh, of second order."""
    folder = tmp_path_factory.mktemp("unv")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 1)
        gmsh.model.occ.synchronize()
        for dim, tag, name in ((3, 1, "body"), (2, 2, "top"), (2, 3, "foot")):
            gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, [tag]), name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.8)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(3)
        for suffix in ("unv", "msh"):
            gmsh.write(str(folder / f"part.{suffix}"))
    finally:
        gmsh.finalize()
    return {suffix: folder / f"part.{suffix}" for suffix in ("unv", "msh")}


@pytest.mark.slow
def test_a_file_of_gmsh_is_the_mesh_that_it_was(written):
    mesh, other = (ao.read_mesh(written[suffix]) for suffix in ("unv", "msh"))
    assert (mesh.cell, mesh.order, mesh.n_cells) == (other.cell, other.order, other.n_cells)
    mass = ao.Structure(other, STEEL).mass
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(mass, rel=1e-7)  # digits of the file


@pytest.mark.parametrize("shape", by_unv.ORDER)
def test_second_order_nodes_go_round_the_elements(shape):
    """The middle nodes lie between the corners that the table says."""
    corners, mids = by_unv.ORDER[shape]
    assert sorted((*corners, *mids)) == list(range(len(corners) + len(mids)))
    for mid, (a, b) in zip(mids, EDGES[shape], strict=True):
        if abs(corners[a] - corners[b]) <= 2:  # neighbours of one ring
            assert min(corners[a], corners[b]) < mid < max(corners[a], corners[b])


BRICK = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]


def brick(per_metre: float | None = None) -> str:
    """A brick with a group of its cell and one of the nodes below."""
    text = ""
    if per_metre:
        text += f"    -1\n   164\n         5  mm\n {per_metre:.3E} 1.0D+00 1.0D+00\n    -1\n"
    text += "    -1\n  2411\n"
    for k, x in enumerate(BRICK):
        text += f"{k + 11:10d}{1:10d}{1:10d}{11:10d}\n"
        text += "".join(f"{c:25.16E}".replace("E", "D") for c in x) + "\n"
    text += "    -1\n    -1\n  2412\n" + f"{7:10d}{115:10d}" + f"{1:10d}" * 3 + f"{8:10d}\n"
    text += "".join(f"{k + 11:10d}" for k in range(8)) + "\n    -1\n"
    text += "    -1\n  2467\n" + f"{1:10d}" + f"{0:10d}" * 6 + f"{1:10d}\nbody\n"
    text += f"{8:10d}{7:10d}{0:10d}{0:10d}\n" + f"{2:10d}" + f"{0:10d}" * 6 + f"{4:10d}\nfoot\n"
    members = [f"{7:10d}{k + 11:10d}{0:10d}{0:10d}" for k in range(4)]
    return text + members[0] + members[1] + "\n" + members[2] + members[3] + "\n    -1\n"


def test_groups_of_nodes_and_elements(tmp_path):
    path = tmp_path / "brick.unv"
    path.write_text(brick())
    mesh = ao.read_mesh(path)
    assert {name: sorted(dims) for name, dims in mesh.groups.items()} == {"body": [3], "foot": [2]}
    part = ao.Structure(mesh, {"body": STEEL}, ao.Support("foot"))
    assert part.mass == pytest.approx(7850, rel=1e-12)
    assert not part.rigid_modes.size


def test_units_of_the_file_count_unless_others_are_given(tmp_path):
    path = tmp_path / "brick.unv"
    path.write_text(brick(1000.0))
    with pytest.warns(ao.AntioscWarning, match="1000 units of length in a metre"):
        mesh = ao.read_mesh(path)
    assert mesh.extent() == pytest.approx(np.sqrt(3) * 1e-3, rel=1e-12)
    assert ao.read_mesh(path, unit="cm").extent() == pytest.approx(np.sqrt(3) * 1e-2, rel=1e-12)


#: Finite-element descriptors of the universal file (dataset 2412): nodes by the last digit, what
#: they are by the rest: plane stress, plane strain, plate, membrane and thin shell.
DESCRIPTORS = {11: ("line", 2), 21: ("line", 2), 22: ("line", 2), 23: ("line", 3), 24: ("line", 3)}
DESCRIPTORS |= {111: ("tetra", 4), 112: ("wedge", 6), 113: ("wedge", 15), 115: ("hexahedron", 8)}
DESCRIPTORS |= {116: ("hexahedron", 20), 118: ("tetra", 10)}
for tens in (40, 50, 60, 70, 90):
    DESCRIPTORS |= {tens + 1: ("triangle", 3), tens + 2: ("triangle", 6)}
    DESCRIPTORS |= {tens + 4: ("quad", 4), tens + 5: ("quad", 8)}


def test_descriptors_of_elements():
    assert by_unv.ELEMENTS == DESCRIPTORS
    assert by_unv.WITH_ORIENTATION == (21, 22, 23, 24)
    for shape, (corners, mids) in by_unv.ORDER.items():
        count = max(n for _, n in DESCRIPTORS.values() if (shape, n) in DESCRIPTORS.values())
        assert sorted([*corners, *mids]) == list(range(count))
        assert len(mids) == len(EDGES[shape])
