"""Placements are rigid motions, and ends of joints see those of what they hold."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import every_joint
from antiosc.fem.assembly.joint import motion
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.assembly.parts import checked_parts, checked_places, checked_points
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.structure import Placement
from assemblies import BEAM, NU, RHO, SOLID, E, box, line
from refusals import refused
from sheets import sheet

pytestmark = pytest.mark.fem

TURNED = Placement((0.3, -0.2, 0.4), (1, 2, -1), 1.1, about=(0.1, 0.0, 0.2))


def whole(mesh: Mesh) -> Mesh:
    """The mesh with a group of all cells, and of two points."""
    count = compat.cell_map(mesh.dolfinx).size_local
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


def test_degrees_are_not_taken_for_radians():
    with pytest.raises(ao.InputError, match=r"angle = -90 rad .* radians; .* give -1\.5708\."):
        Placement(angle=-90)
    assert Placement(angle=2 * np.pi).angle == 2 * np.pi


@pytest.mark.slow
def test_an_end_with_a_radius_is_the_mean_over_a_disc(layout):
    """u_z = x² + y² on a face: r²/2 at the middle of a disc; faces too large are refused."""
    member = layout.members["cut"]
    radius, field = 0.4, np.zeros(layout.count)
    x = member.nodes - [0.5, 1.0, 3.0]
    field[layout.dofs(member, np.arange(len(x)), "z")] = x[:, 0] ** 2 + x[:, 1] ** 2
    found = motion(layout, ("cut", (0.5, 1.0, 3.0), radius))
    assert (found.displacements @ field)[2] == pytest.approx(radius**2 / 2, rel=0.1)
    with refused(None, "refine", ao.InputError):
        motion(layout, ("cut", (0.5, 1.0, 3.0), 0.01))
    with refused(None, "radius", ao.InputError):
        ao.Weld(("cut", (0.5, 1.0, 3.0), -1.0), "hub")
