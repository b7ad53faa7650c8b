"""Assemblies on several ranks are those of one; errors and warnings come on all of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

import every_joint
from abaqus_decks import column
from mpi import START, one_and_several, run_ranks

pytestmark = pytest.mark.mpi

PROGRAM = """
from antiosc.base.errors import AntioscWarning
import every_joint
from assemblies import at, grouped

warnings.simplefilter("ignore", AntioscWarning)
WORLD = MPI.COMM_WORLD

def sheet(n, m):
    corners = [np.zeros(2), np.array([0.1, 0.08])]
    return grouped(dolfinx.mesh.create_rectangle(WORLD, corners, [n, m]), x0=at(0, 0.0))

def block(size, n, comm=WORLD):
    made = dolfinx.mesh.create_box(comm, [np.zeros(3), np.array(size)], n)
    return grouped(made, bottom=at(2, 0.0), top=at(2, size[2]), x0=at(0, 0.0), x1=at(0, size[0]))

def bar(comm=WORLD):
    from antiosc.fem.platform import compat
    x = np.linspace([0, 0, 0], [0.05, 0, 0], 4)
    cells = np.column_stack([np.arange(3), np.arange(1, 4)]).astype(np.int64)
    cells, x = (cells, x) if comm.rank == 0 else (cells[:0], x[:0])
    return grouped(compat.create_mesh(comm, cells, x, "interval", 1), start=at(0, 0.0))

PLASTIC = ao.Solid(3e9, 0.35, 1150.0)
BEAM = ao.Beam(70e9, 0.3, 2700.0, ao.Section.rectangle(1e-3, 2e-3), orientation=(0, 0, 1))

def board():
    # shells on solids with supports of their own, twice the same part, a beam (products by strains)
    shell = ao.Structure(sheet(4, 3), ao.Shell(22e9, 0.15, 1900.0, 1.6e-3))
    foot = ao.Support(lambda x: np.isclose(x[2], 0.0))
    post = ao.Structure(block((6e-3, 6e-3, 10e-3), (1, 1, 2)), PLASTIC, [foot])
    return ao.assemble(
        {"board": shell, "sw": post, "ne": post, "fin": ao.Structure(bar(), BEAM)},
        [
            ao.Weld(("board", (0.01, 0.01, 0.0)), "sw:top"),
            ao.Weld(("board", (0.09, 0.07, 0.0)), "ne:top"),
            ao.Weld(("board", (0.1, 0.04, 0.0)), "fin:start"),
        ],
        at={
            "sw": (0.007, 0.007, -0.01), "ne": (0.087, 0.067, -0.01),
            "fin": ao.Placement((0.1, 0.04, 0.0), (0, 1, 0), np.pi / 6),
        },
        attached=[ao.PointMass((0.06, 0.05, 0.0), 5e-3)],
    ), ao.Site((0.04, 0.03, 0.0), (0, 0, -1), part="board"), ("fin", (0.1346, 0.04, -0.02))

def free():
    # meshes that do not match, tied; nothing is held; a single cell: ranks without any of the part
    left = ao.Structure(block((0.05, 0.02, 0.02), (3, 2, 2)), PLASTIC, order=1)
    right = ao.Structure(block((0.05, 0.02, 0.02), (1, 1, 1)), ao.Solid(70e9, 0.3, 2700.0))
    hub = ao.Structure(block((0.02, 0.02, 0.02), (1, 1, 1), MPI.COMM_SELF), PLASTIC)
    return ao.assemble(
        {"hub": hub, "left": left, "right": right},
        [
            ao.Tie("left:x1", "right:x0"),
            ao.Mean("right:x1", "tip"),
            ao.Bushing("tip", "hub:x0", {c: 1e5 for c in ("x", "y", "z", "rx", "ry", "rz")}),
        ],
        at={"right": (0.05, 0, 0), "hub": (0.12, 0, 0)},
        points={"tip": (0.1, 0.01, 0.01)},
        supports=[],
    ), ao.Site("left:x0", (1, 0.2, 0)), ("hub", (0.14, 0.0, 0.0))

def deck():
    # bricks, shells and beams that share nodes, and equations
    part = ao.read_model(sys.argv[2])
    return part, ao.Site((0.0, 1.0, 2.0), (0, 0, -1), part="solids"), ("beams", (0.5, 0.5, 3.0))

def every():
    # every joint, and a superelement; Z of all of its dofs
    return every_joint.assembly(WORLD), every_joint.SITE, ("f", every_joint.FOOT)

corners = {
    "every": ao.Site(every_joint.CORNER, (0.3, 0, 1), part="g"),
    "board": ao.Site((0.1, 0.08, 0.0), (0, 0, -1), part="board"),
    "free": ao.Site((0.0, 0.0, 0.0), (0, 1, 0), part="left"),
    "deck": ao.Site((2.0, 1.0, 2.0), (0, 0, -1), part="faces"),
}
named = {"board": "ne:top", "free": "tip", "deck": (0.5, 0.5, 3.0), "every": "ecu:4"}
found = {}
for make in (board, free, deck, every):
    part, site, (name, point) = make()
    model = ao.extract(part, site, n=40 if make is every else 6)
    hit = ao.simulate(model, ao.RigidMass(mass=2e-3, velocity=0.3), ao.Linear(1e5), duration=1e-3)
    moved = ao.probe(part, hit, point, times=[0.5e-3, 1e-3], part=name)
    several = ao.extract(part, {"a": site, "b": corners[make.__name__]}, n=8)
    path = ao.write_series(part, hit, sys.argv[1], times=[1e-3])
    omega = 180.0 if make is every else 3e3
    where = {"board": ["sw:x0", "ne:x0"], "free": ["left:x0", "right:x1"]}.get(make.__name__)
    struck = ao.impact_map(part, where, n=2, modes=8) if where else None
    found[make.__name__] = {
        "dofs": part.dofs, "rigid": part.rigid_modes.shape[1],
        "mass": 0.0 if make is every else part.mass,
        "k0": model.k0, "m_st": model.m_st, "omega": model.omega[:4].tolist(),
        "Z": float(model.dynamic_stiffness(omega)),
        "several": np.asarray(several.dynamic_stiffness(omega)).real.ravel().tolist(),
        "map": struck.models.m_st.tolist() if struck else [0.0],
        "named": ao.probe(part, hit, named[make.__name__], times=[1e-3]).ravel().tolist(),
        "held": ao.reactions(part, hit, site, [2e-4]).total.ravel().tolist()
        if make in (board, deck) else [0.0],
        "peak": hit.peak_force, "moved": moved.ravel().tolist(),
        "inertia": part.rigid_inertia[0].matrix.ravel().tolist() if part.rigid_inertia else [0.0],
    }
said = []
wrong = [
    lambda: ao.assemble({"a": board()[0]}),
    lambda: ao.assemble({"a": ao.Structure(block((1, 1, 1), (1, 1, 1)), PLASTIC),
                         "b": ao.Structure(block((1, 1, 1), (1, 1, 1)), PLASTIC)}),
    lambda: ao.assemble({"a": ao.Structure(block((1, 1, 1), (1, 1, 1)), PLASTIC)},
                        [ao.Rigid("a:nowhere", "hub")], points={"hub": (0, 0, 0)}),
    lambda: ao.extract(free()[0], ao.Site((9, 9, 9), (1, 0, 0)), n=2),
]
for call in wrong:
    try:
        call()
        said.append("passed")
    except ao.AntioscError as error:
        said.append(str(error))
print(json.dumps([found, said]))
"""


#: A column of two bricks with a shell and a beam on top; two of its nodes move as one.
DECK = column(elset="BRICKS") + """*NODE
13,2,0,2
14,2,1,2
15,.5,.5,3.
*ELEMENT, TYPE=S4, ELSET=SKIN
3,10,13,14,11
*ELEMENT, TYPE=S3, ELSET=SKIN
4,9,10,11
*ELEMENT, TYPE=B31, ELSET=POLE
5,9,15
*SOLID SECTION, ELSET=BRICKS, MATERIAL=M
*SHELL SECTION, ELSET=SKIN, MATERIAL=M
.1
*BEAM SECTION, ELSET=POLE, MATERIAL=M, SECTION=RECT
.1,.2
0.,1.,0.
*MATERIAL, NAME=M
*ELASTIC
1E9, .2
*DENSITY
1000.
*BOUNDARY
1,1,3\n2,1,3\n3,1,3\n4,1,3
*EQUATION
2
13,3,1.,14,3,-1.
"""  # fmt: skip


def test_several_ranks_give_the_assembly_of_one(tmp_path):
    (tmp_path / "deck.inp").write_text(DECK)
    files = str(tmp_path / "series.pvd"), str(tmp_path / "deck.inp")
    (alone, told), (found, said) = one_and_several(START + PROGRAM, *files)
    assert said == told
    assert not any("passed" in sentence for sentence in said)
    for name, values in alone.items():
        for key, value in values.items():
            scale = np.abs(value).max()
            limit = 1e-9 if key in ("k0", "Z", "several") else 1e-6
            np.testing.assert_allclose(
                *(found[name][key], value), rtol=limit, atol=1e-8 * scale, err_msg=f"{name}: {key}"
            )
    K, M, b = every_joint.dense(every_joint.parts())
    exact = 1 / (b @ np.linalg.solve(K - 180.0**2 * M, b))
    assert found["every"]["Z"] == pytest.approx(exact, rel=1e-9)


def test_parts_that_each_rank_has_for_itself_are_joined_by_each():
    """Even by one rank alone, which must not wait for the others."""
    script = """
box = dolfinx.mesh.create_box(MPI.COMM_SELF, [np.zeros(3), np.ones(3)], [2, 1, 1])
block = ao.Structure(ao.read_mesh(box), ao.Solid(70e9, 0.3, 2700.0), order=1)
if MPI.COMM_WORLD.rank == 1:
    made = ao.assemble({"a": block}, attached=[ao.PointMass((1, 1, 1), 2.0)])
    print(made.mass)
"""
    printed = run_ranks(2, START + script, timeout=100)
    assert float(printed[1]) == pytest.approx(2702.0, rel=1e-12)


SUPERELEMENT = """
from antiosc.base.errors import AntioscWarning
from assemblies import SOLID, at, grouped

warnings.simplefilter("ignore", AntioscWarning)

def block(size, n):
    corners = [np.zeros(3), np.array(size)]
    kind = dolfinx.mesh.CellType.hexahedron
    made = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, n, kind)
    return grouped(made, x0=at(0, 0.0), z1=at(2, size[2]))

feet = {"a": (0, 0), "b": (0.06, 0), "c": (0.06, 0.04), "d": (0, 0.04)}
ecu = ao.Structure(block((0.06, 0.04, 0.02), (2, 2, 1)), ao.Solid(3e9, 0.3, 1500.0))
sites = {k: ao.Site((*xy, 0), (0, 0, -1), tangential=True) for k, xy in feet.items()}
plate = ao.Structure(block((0.2, 0.12, 0.005), (5, 4, 1)), SOLID, [ao.Support("x0")])
place = (0.05, 0.03, 0.005)
joints = [
    ao.Ball(("plate", tuple(np.array([x, y, 0.0]) + place)), f"ecu:{k}")
    for k, (x, y) in feet.items()
]
part = ao.assemble(
    {"plate": plate, "ecu": ao.extract(ecu, sites, n=12)},
    [*joints, ao.Mean("plate:z1", "tip"), ao.Bushing("tip", "ground", damping={"z": 0.5})],
    {"ecu": place},
    points={"tip": (0.1, 0.06, 0.005), "ground": (0.1, 0.06, 0.005)},
    supports=[ao.Support("ground")],
)
model = ao.extract(part, ao.Site((0.2, 0.12, 0.005), (0, 0, -1), part="plate"), n=30)
moved = model.modal().receptance(0.9 * model.omega[:3])
print(json.dumps([model.k0, *model.omega[:3], *moved.real, *moved.imag]))
"""


def test_superelements_and_dampers_on_two_ranks():
    alone, two = one_and_several(START + SUPERELEMENT)
    np.testing.assert_allclose(two, alone, rtol=1e-6)


SHARES = """
from antiosc.base.errors import AntioscWarning
from assemblies import SOLID, at, grouped

warnings.simplefilter("ignore", AntioscWarning)
kinds = dolfinx.mesh.CellType

def block(kind, n, order, comm=MPI.COMM_WORLD):
    made = dolfinx.mesh.create_box(comm, [np.zeros(3), np.array([0.2, 0.1, 0.1])], n, kind)
    return ao.Structure(grouped(made, x0=at(0, 0.0), x1=at(0, 0.2)), SOLID, order=order)

parts = {
    "a": block(kinds.tetrahedron, (8, 3, 2), 2),
    "b": block(kinds.hexahedron, (2, 2, 2), 1),
    "c": block(kinds.hexahedron, (3, 2, 2), 2),
    "d": block(kinds.tetrahedron, (2, 1, 1), 2, MPI.COMM_SELF),
}
joints = [ao.Tie(f"{a}:x1", f"{b}:x0") for a, b in ("ab", "bc", "cd")]
places = {name: (0.2 * k, 0, 0) for k, name in enumerate(parts)}
whole = ao.assemble(parts, joints, places)
u, local = whole.matrices.places, whole.matrices.local
off = 0.0
for name, share in local.of.items():
    own = share.part.places.placed(ao.Placement(places[name]))
    off = max(off, np.abs(own.points - u.points[share.rows]).max(initial=0.0))
    off = max(off, np.abs(own.axes - u.axes[share.rows]).max(initial=0.0))
rows = np.concatenate([share.rows[share.counted] for share in local.of.values()])
counted = MPI.COMM_WORLD.allreduce(np.bincount(rows, minlength=whole.size))
bare = [member.part.bare for member in whole.matrices.members()]
entries = len(whole.K.getValuesCSR()[1])
most = MPI.COMM_WORLD.allreduce(entries, MPI.MAX) / MPI.COMM_WORLD.allreduce(entries)
print(json.dumps([off, bool((counted == 1).all()), bare, bool(most < 0.6)]))
"""


def test_a_rank_has_matrices_of_its_own_rows_alone():
    """And each row of a part on several ranks stands where the layout of the whole has it."""
    printed = run_ranks(2, START + SHARES)
    off, once, bare, half = json.loads(printed[0])
    assert off < 1e-12
    assert once
    assert bare == [True, True, True, False]
    assert half
