"""Placements are rigid motions, and ends of joints see those of what they hold."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import every_joint
from antiosc.fem.assembly.joint import motion_of_end
from antiosc.fem.assembly.layout import Layout, checked_parts, checked_places, checked_points
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.structure import Placement, skew
from antiosc.fem.structure.loads import UNIT_MOTIONS
from assemblies import BEAM, NU, RHO, SOLID, E, box, line
from refusals import refused
from sheets import sheet

TURNED = Placement((0.3, -0.2, 0.4), (1, 2, -1), 1.1, about=(0.1, 0.0, 0.2))
FRAME = every_joint.FRAME


def whole(mesh: Mesh) -> Mesh:
    """The mesh with a group of all cells, and of two points."""
    count = compat.cell_index_map(mesh.dolfinx).size_local
    cells = {mesh.tdim: np.arange(count, dtype=np.int32)}
    groups = {**mesh.groups, "all": cells, "two": {0: np.array([0, 1], dtype=np.int32)}}
    return Mesh(mesh.dolfinx, groups, mesh.name)


@pytest.fixture(scope="module")
def layout() -> Layout:
    arc = sheet((2, 1), lambda s, t: (np.cos(s), np.sin(s), 0.5 * t), order=2)
    parts = {
        "block": ao.Structure(whole(box((0, 0, 0), (1, 2, 3), (1, 2, 1))), SOLID, order=2),
        "cut": ao.Structure(whole(box((0, 0, 0), (1, 2, 3), (1, 1, 1), "tetrahedron")), SOLID),
        "rod": ao.Structure(whole(line((0, 0, 0), (1, 0, 0), 3)), BEAM),
        "arc": ao.Structure(whole(arc), ao.Shell(E, NU, RHO, 0.01)),
        "ecu": every_joint.parts()["ecu"],
    }
    checked = checked_parts(parts)
    places = checked_places(checked, {name: TURNED for name in parts if name != "cut"})
    return Layout(checked, places, checked_points(checked, {"hub": (3.0, 1.0, -2.0)}))


def placed(*x: float) -> tuple[float, ...]:
    return tuple(TURNED.placed(np.array([x]))[0])


#: Ends, their places, and which rotations they have: all, none, or all but those about an axis.
ENDS = {
    "point": ("hub", (3.0, 1.0, -2.0), "all"),
    "face": ("block:x1", placed(1.0, 1.0, 1.5), "all"),
    "volume": ("cut:all", (0.5, 1.0, 1.5), "all"),
    "inside": (("block", placed(0.3, 0.7, 2.2)), placed(0.3, 0.7, 2.2), "none"),
    "inside a tetrahedron": (("cut", (0.3, 0.7, 2.2)), (0.3, 0.7, 2.2), "none"),
    "around a point": (("block", placed(0.9, 1.1, 3.0), 1.2), placed(0.9, 1.1, 3.0), "all"),
    "around a point of a rod": (("rod", placed(0.4, 0.0, 0.0), 0.3), placed(0.4, 0.0, 0.0), "all"),
    "end of a rod": ("rod:end", placed(1.0, 0.0, 0.0), "all"),
    "a whole rod": ("rod:all", placed(0.5, 0.0, 0.0), "all"),
    "on a rod": (("rod", placed(0.4, 0.0, 0.0)), placed(0.4, 0.0, 0.0), "all"),
    "a shell": ("arc:all", None, "all"),
    "two points of a shell": ("arc:two", None, "all"),
    "two points of a block": ("block:two", None, "about a line"),
    "node": ("ecu:2", placed(*FRAME[1]), "none"),
    "node by its place": (("ecu", placed(*FRAME[2])), placed(*FRAME[2]), "none"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(ENDS))
def test_an_end_sees_rigid_motions(layout, name):
    end, place, has = ENDS[name]
    found = motion_of_end(layout, end)
    if place is not None:
        np.testing.assert_allclose(found.point, place, atol=1e-12)
    about = np.array([0.2, -0.7, 0.3])
    rigid = layout.places.rigid_motions(about)
    P = {"all": np.eye(3), "none": np.zeros((3, 3))}.get(has, found.space[3:, 3:])
    np.testing.assert_allclose(found.space[3:, 3:], P, atol=1e-12)
    if has == "about a line":
        assert np.linalg.matrix_rank(P, 1e-6) == 2
        np.testing.assert_allclose(P @ P, P, atol=1e-12)
    for moved in (found, found.at(np.array([1.0, 5.0, 2.0]))):
        arm = moved.point - about
        if has == "all" or moved is found:
            exact = np.hstack([np.eye(3), -skew(arm)])
            np.testing.assert_allclose(moved.displacements @ rigid, exact, atol=1e-11)
        turned = np.hstack([np.zeros((3, 3)), P])
        np.testing.assert_allclose(moved.rotations @ rigid, turned, atol=1e-11)
    assert [found.has(UNIT_MOTIONS[c]) for c in ("x", "ry")] == [True, has == "all"]


@pytest.mark.slow
def test_a_rigid_line_of_a_beam_is_a_rigid_body():
    """Nodes with rotations follow with them: six dofs, the beam's own mass and inertia."""
    rod = ao.Structure(whole(line((0, 0, 0), (0.6, 0, 0), 3)), BEAM)
    at = {"rod": TURNED}
    joint, points = ao.Rigid("rod:all", "hub"), {"hub": placed(0.3, 0, 0)}
    rigid = ao.assemble({"rod": rod}, [joint], at, points=points)
    loose = ao.assemble({"rod": rod}, [], at)
    assert rigid.dofs == 6
    one, two = (np.linalg.eigvalsh(part.rigid_inertia[0].matrix) for part in (rigid, loose))
    assert one[-3:] == pytest.approx(two[-3:], rel=1e-9)
    alone = ao.assemble({"rod": rod}, [ao.Rigid("rod:all")], at)
    assert alone.dofs == 6


def test_a_spin_about_a_row_of_nodes_is_fixed_where_no_node_shows_it():
    """Two points of a solid that are rigid by themselves: five motions of the reference point."""
    mesh = box((0, 0, 0), (1, 1, 1), (1, 1, 1))
    x = mesh.dolfinx.geometry.x[compat.vertex_nodes(mesh.dolfinx, 0)[:, 0]]
    row = np.flatnonzero((x[:, 0] < 0.5) & (x[:, 2] < 0.5)).astype(np.int32)
    mesh = Mesh(mesh.dolfinx, {**mesh.groups, "row": {0: row}}, mesh.name)
    block = ao.Structure(mesh, SOLID, [ao.Support("z1")], order=1)
    part = ao.assemble({"block": block}, [ao.Rigid("block:row")], {"block": TURNED})
    assert part.dofs == 24 - 12 - 6 + 5
    assert part.rigid_modes.shape[1] == 0


RNG = np.random.default_rng(8)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 40.0])
def test_a_placement_is_a_rigid_motion(scale):
    axis = np.array([0.3, -0.5, 0.7])
    place = Placement((1, 2, 3), tuple(scale * axis), 0.8, (0.1, 0.2, 0.3))
    R = place.rotation
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1)
    np.testing.assert_allclose(R @ axis, axis, atol=1e-15)
    assert np.trace(R) == pytest.approx(1 + 2 * np.cos(0.8))
    # by the right hand: the part of a × R a along the axis is positive
    a = np.array([1.0, 0.0, 0.0])
    assert np.cross(a, R @ a) @ axis > 0
    x = RNG.normal(size=(5, 3))
    np.testing.assert_allclose(place.own(place.placed(x)), x, atol=1e-14)
    np.testing.assert_allclose(place.placed(np.array([[0.1, 0.2, 0.3]])), [[1.1, 2.2, 3.3]])
    moved = place.placed(x)
    np.testing.assert_allclose(np.diff(moved, axis=0), np.diff(x, axis=0) @ R.T, atol=1e-14)


@pytest.mark.slow
def test_an_end_with_a_radius_is_the_mean_over_a_disc(layout):
    """u_z = x² + y² on a face: r²/2 at the middle of a disc; faces too large are refused."""
    member = layout.members["cut"]
    radius, field = 0.4, np.zeros(layout.count)
    x = member.nodes - [0.5, 1.0, 3.0]
    field[layout.dofs(member, np.arange(len(x)), "z")] = x[:, 0] ** 2 + x[:, 1] ** 2
    found = motion_of_end(layout, ("cut", (0.5, 1.0, 3.0), radius))
    assert (found.displacements @ field)[2] == pytest.approx(radius**2 / 2, rel=0.1)
    with refused(None, "refine", ao.InputError):
        motion_of_end(layout, ("cut", (0.5, 1.0, 3.0), 0.01))
    with refused(None, "radius", ao.InputError):
        ao.Weld(("cut", (0.5, 1.0, 3.0), -1.0), "hub")
