"""What cannot be computed is refused in one sentence, on every rank, and leaves no file behind."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts
from mesh_files import refused, write
from mpi import run_ranks

SOLID = ao.Solid(**parts.STEEL)
CIRCLE = ao.Section.circle(0.02)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


# --- Materials ------------------------------------------------------------------------------------


def test_plane_parts():
    with refused("plane"):
        ao.Solid(**parts.STEEL, plane="flat")
    with refused(r"thickness must be > 0"):
        ao.Solid(**parts.STEEL, plane="stress", thickness=0.0)
    with refused(r"Solid on a 2-D mesh needs plane='stress' or plane='strain'"):
        ao.Structure(parts.plate(), SOLID)
    with refused(r"plane='stress' applies to 2-D meshes"):
        ao.Structure(parts.box(), ao.Solid(**parts.STEEL, plane="stress"))


def test_sections():
    with refused(r"the wall t must be thinner than d/2 = 0.02 m; got 0.02"):
        ao.Section.tube(0.04, 0.02)
    with refused(r"width must be > 0"):
        ao.Section.rectangle(-0.1, 0.1)
    with refused(r"A must be > 0"):
        ao.Section(A=0.0, I=1.0)
    with refused("section"):
        ao.Beam(**parts.STEEL, section=0.1)


def test_materials_and_meshes_that_do_not_fit():
    beam = ao.Beam(**parts.STEEL, section=CIRCLE)
    with refused("hexahedron"):
        ao.Structure(parts.box(), beam)
    with refused("dimension"):
        ao.Structure(parts.line(1.0, 2), SOLID)
    with refused(r"displacements of order 1 on cells of geometric order 2"):
        ao.Structure(
            ao.read_mesh("meshes/lever.msh"), ao.Solid(**parts.STEEL, plane="stress"), order=1
        )
    with refused(r"order must be 1 or 2; got 3"):
        ao.Structure(parts.box(), SOLID, order=3)
    with refused("read_mesh"):
        ao.Structure("meshes/lever.msh", SOLID)
    with refused("material"):
        ao.Structure(parts.box(), 210e9)


def test_orientation_of_sections():
    mesh = parts.line(1.0, 2, (0, 0, 1))
    flat = ao.Section.rectangle(0.01, 0.03)
    with refused("orientation"):
        ao.Structure(mesh, ao.Beam(**parts.STEEL, section=flat))
    with refused(r"orientation \(0, 0, 2\) is parallel to the axis of 2 beam elements"):
        ao.Structure(mesh, ao.Beam(**parts.STEEL, section=flat, orientation=(0, 0, 2)))
    with refused(r"the length of orientation must be > 0"):
        ao.Beam(**parts.STEEL, section=flat, orientation=(0, 0, 0))


def test_every_cell_needs_one_material():
    halves = {
        "low": (3, lambda x: x[0] <= 0.1 + 1e-9),
        "high": (3, lambda x: x[0] >= 0.1 - 1e-9),
        "all": (3, lambda x: x[0] > -1),
        "skin": (2, lambda x: np.isclose(x[0], 0)),
    }
    mesh = parts.box(groups=halves)
    with refused(r"of 16 cells 8 have none and 0 more than one; the groups named are 'low'"):
        ao.Structure(mesh, {"low": SOLID})
    with refused(r"of 16 cells 0 have none and 8 more than one"):
        ao.Structure(mesh, {"all": SOLID, "high": SOLID})
    with refused("middle"):
        ao.Structure(mesh, {"middle": SOLID})
    with refused("skin"):
        ao.Structure(mesh, {"skin": SOLID})
    with refused(r"empty dict"):
        ao.Structure(mesh, {})
    with refused("materials"):
        ao.Structure(mesh, {"low": SOLID, "high": ao.Beam(**parts.STEEL, section=CIRCLE)})


# --- Supports -------------------------------------------------------------------------------------


def test_supports():
    mesh = parts.box()
    with refused("foot"):
        ao.Structure(mesh, SOLID, [ao.Support("foot")])
    with refused("mesh"):
        ao.Structure(mesh, SOLID, [ao.Support(lambda x: x[0] > 1)])
    with refused("component"):
        ao.Structure(mesh, SOLID, [ao.Support("left", "rx")])
    with refused("component"):
        ao.Structure(mesh, SOLID, [ao.Support("left", ())])
    with refused(r"must return one bool per point: shape \(225,\); got \(\)"):
        ao.Structure(mesh, SOLID, [ao.Support(lambda x: True)])
    with refused("left"):
        ao.Structure(mesh, SOLID, ["left"])
    with refused("structure"):
        ao.Structure(mesh, SOLID, [ao.Support(lambda x: x[0] > -1)])


def test_a_function_that_fails_says_its_own_error():
    with pytest.raises(ZeroDivisionError):
        ao.Structure(parts.box(), SOLID, [ao.Support(lambda x: 1 / 0)])


def test_extract_tells_what_it_was_given():
    line = ao.Structure(parts.line(1.0, 4), ao.Beam(**parts.STEEL, section=ao.Section.circle(0.01)))
    with pytest.raises(ao.InputError, match="direction"):
        ao.extract(line, (0, 0, 0))
    with pytest.raises(ao.InputError, match="structure"):
        ao.extract(parts.line(1.0, 4), ao.Site((0.5, 0), (0, 1)))


RANKS = r"""
import sys, warnings
import numpy as np
folder = sys.argv[1]
import antiosc as ao
import parts
from antiosc.base.errors import AntioscWarning
from mpi4py import MPI

warnings.simplefilter("ignore", AntioscWarning)
world = MPI.COMM_WORLD
solid = ao.Solid(**parts.STEEL)
mesh = parts.box(groups={
    "left": (2, lambda x: np.isclose(x[0], 0)), "low": (3, lambda x: x[0] <= 0.1 + 1e-9)
})
part = ao.Structure(mesh, solid, [ao.Support("left")])
top = ao.Site((0.2, 0.02, 0.04), (0, 0, -1))
rod = ao.Section.rectangle(0.01, 0.03)

def one_rank_fails(x):
    if world.rank == world.size - 1:
        raise ValueError("only here")
    return x[0] < 0

cases = [
    lambda: ao.read_mesh(folder + "/nowhere.msh"),
    lambda: ao.read_mesh(folder + "/garbage.msh"),
    lambda: ao.read_mesh(folder + "/garbage.vtu"),
    lambda: ao.read_mesh(folder + "/pieces.vtu", cells="nowhere"),
    lambda: ao.read_mesh(folder + "/pieces.vtu"),
    lambda: mesh.group("foot"),
    lambda: ao.Structure(mesh, solid, [ao.Support("foot")]),
    lambda: ao.Structure(mesh, solid, [ao.Support(lambda x: x[0] > 1)]),
    lambda: ao.Structure(mesh, solid, [ao.Support(lambda x: x[0] > -1)]),
    lambda: ao.Structure(mesh, solid, [ao.Support(one_rank_fails)]),
    lambda: ao.Structure(mesh, {"low": solid}),
    lambda: ao.Structure(mesh, ao.Solid(**parts.STEEL, plane="stress")),
    lambda: ao.Structure(parts.frame([(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 1), (1, 2)], 3),
                         ao.Beam(**parts.STEEL, section=rod, orientation=(0, 1, 0))),
    lambda: ao.extract(part, ao.Site((0.2, 0.02, 0.1), (0, 0, -1))),
    lambda: ao.extract(part, ao.Site((0.0, 0.02, 0.01), (0, 0, -1))),
    lambda: ao.extract(part, ao.Site((0.1, 0.025, 0.02), (0, 0, -1), radius=1e-3)),
    lambda: ao.extract(part, top, n=part.dofs),
    lambda: ao.extract(part, top, n=3, method="magic"),
    lambda: ao.impact_map(part, "nowhere"),
    lambda: ao.impact_map(part, "left"),
]
for k, case in enumerate(cases):
    try:
        case()
    except Exception as error:
        print(k, type(error).__name__, error)
    else:
        print(k, "nothing was raised")
"""


@pytest.mark.mpi
def test_every_rank_raises_the_same_error(tmp_path):
    for suffix in ("msh", "vtu"):
        (tmp_path / f"garbage.{suffix}").write_text("Dear reader,\nthis is no mesh.\n")
    quads = ("quad", [[0, 1, 2, 3], [4, 5, 6, 7]])
    write(tmp_path / "pieces.vtu", [*SQUARE, *(SQUARE + 2)], quads)
    one = run_ranks(1, RANKS, str(tmp_path))[0]
    two = run_ranks(2, RANKS, str(tmp_path))
    assert "nothing was raised" not in one
    assert two == [one, one]
    assert len(one.splitlines()) == 20
