"""Joints of decks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from abaqus_decks import column
from antiosc.fem.assembly.layout import Layout
from assemblies import compliances

pytestmark = [
    pytest.mark.filterwarnings("ignore:the direction of the site"),
    pytest.mark.filterwarnings("ignore:the compliance under a point"),
    pytest.mark.filterwarnings("ignore:an edge cuts the patch"),
]


E, A, L = 1e9, 1.0, 2.0
MATERIAL = "*MATERIAL, NAME=M\n*ELASTIC\n1E9, 0.\n*DENSITY\n1000.\n"
SOLID = "*SOLID SECTION, ELSET=ALL, MATERIAL=M\n"


def read(folder: Path, text: str, **options) -> ao.Structure:
    path = folder / "part.inp"
    path.write_text(text)
    return ao.read_model(path, **options)


FOOT = "*BOUNDARY\n1,1,3\n2,1,3\n3,1,3\n4,1,3\n"
#: The top of a column of two bricks moves along z as one.
FLAT = "*EQUATION\n" + "".join(f"2\n{n},3,1.,9,3,-1.\n" for n in (10, 11, 12))


def k0(part: ao.Structure, point=(1, 0, L), direction=(0, 0, 1), of=None) -> float:
    return ao.extract(part, ao.Site(point, direction, part=of), n=2).k0


@pytest.mark.slow
def test_supports_along_directions_of_their_own(tmp_path):
    """A column turned by 30° on rollers of a *TRANSFORM is the one that stands straight."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    upright = [(n, 3) for n in range(1, 5)]
    rollers = "".join(f"{n},{m}\n" for n, m in ((1, 1), (1, 2), (2, 2), *upright))
    straight = read(tmp_path, column() + SOLID + MATERIAL + "*BOUNDARY\n" + rollers)
    turned = column()
    for n in range(1, 13):
        x, y = [(0, 0), (1, 0), (1, 1), (0, 1)][(n - 1) % 4]
        old = f"\n{n},{x},{y},"
        turned = turned.replace(old, f"\n{n},{c * x - s * y},{s * x + c * y},", 1)
    frame = f"*NSET, NSET=FOOT\n1,2,3,4\n*TRANSFORM, NSET=FOOT\n{c},{s},0.,{-s},{c},0.\n"
    other = read(tmp_path, turned + frame + SOLID + MATERIAL + "*BOUNDARY\n" + rollers)
    for d in ((1.0, 0, 0), (0.3, 0.5, 0.8)):
        turned_d = (c * d[0] - s * d[1], s * d[0] + c * d[1], d[2])
        first = k0(straight, (1, 1, L), d)
        assert k0(other, (c - s, s + c, L), turned_d) == pytest.approx(first, rel=1e-8)


@pytest.mark.slow
def test_a_spring_between_two_columns_is_in_series(tmp_path):
    second = column(101, 5.0) + "*EQUATION\n"
    second += "".join(f"2\n{n},3,1.,101,3,-1.\n" for n in (102, 103, 104))
    second += "".join(f"2\n{n},3,1.,109,3,-1.\n" for n in (110, 111, 112))
    guided = "*BOUNDARY\n" + "".join(f"{n},1,2\n" for n in range(101, 113))
    spring = "*ELEMENT, TYPE=SPRING2, ELSET=S\n500, 9, 101\n*SPRING, ELSET=S\n3, 3\n4E8\n"
    part = read(tmp_path, column() + second + SOLID + MATERIAL + FOOT + FLAT + guided + spring)
    exact = 1 / (2 * L / (E * A) + 1 / 4e8)
    assert k0(part, (1, 0, 7), (0, 0, 1)) == pytest.approx(exact, rel=1e-9)


def nastran(folder: Path, *more: str) -> ao.Structure:
    """The column of two bricks as bulk data, with further entries."""
    lines = []
    for k in range(3):
        for n, (x, y) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
            lines.append(f"GRID,{1 + 4 * k + n},,{x}.,{y}.,{k}.")
    for k in range(2):
        nodes = [1 + 4 * k + n for n in range(8)]
        lines.append(f"CHEXA,{k + 1},1," + ",".join(map(str, nodes[:6])))
        lines.append("," + ",".join(map(str, nodes[6:])))
    lines += ["PSOLID,1,1", "MAT1,1,1.+9,,0.,1000.", "SPC1,1,123,1,THRU,4", *more]
    path = folder / "part.bdf"
    path.write_text("\n".join(lines) + "\n")
    return ao.read_model(path)


@pytest.mark.slow
def test_an_rbe3_spreads_a_spring_over_its_nodes(tmp_path):
    """A spring k on the mean of four nodes: by the compliances c of these, 1/k + c̄, at one node."""
    k = 1e9
    bare = nastran(tmp_path)
    spread = ["RBE3,50,,100,123456,1.,123,9,10", ",11,12"]
    part = nastran(tmp_path, "GRID,100,,.5,.5,2.", *spread, f"CELAS2,60,{k},100,3")
    corners = [(x, y, L) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    C = compliances(bare, *(ao.Site(x, (0, 0, 1)) for x in corners))
    mean = np.full(4, 0.25)
    c = C @ mean
    expected = C - np.outer(c, c) / (1 / k + mean @ c)
    assert 1 / k0(part, corners[0]) == pytest.approx(expected[0, 0], rel=1e-9)


def rows_of_bricks(count: int, tied: bool) -> str:
    """Two rows of unit bricks, one on the other: their nodes coincide, and are `tied` or not."""
    x = [(i, j, k) for k in (0, 1, 1, 2) for i in range(count + 1) for j in (0, 1)]
    level = 2 * (count + 1)
    lines = ["*NODE", *(f"{n},{i},{j},{k}" for n, (i, j, k) in enumerate(x, 1))]
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=ALL")
    for first in (1, 1 + 2 * level):
        for i in range(count):
            side = [first + 2 * i + n for n in (0, 2, 3, 1)]
            corners = ",".join(map(str, [*side, *(n + level for n in side)]))
            lines.append(f"{first + i},{corners}")
    lines.append("*BOUNDARY")
    lines += [f"{n},1,3" for n in range(1, level + 1)]
    upper = range(2 * level + 1, 3 * level + 1) if tied else ()
    ties = [f"2\n{n},{m},1.,{n - level},{m},-1." for n in upper for m in (1, 2, 3)]
    return "\n".join([*lines, *["*EQUATION"] * tied, *ties, ""]) + SOLID + MATERIAL


@pytest.mark.slow
def test_meshes_tied_at_their_nodes_are_one_mesh_in_a_few_calls(tmp_path, monkeypatch):
    """As if they shared nodes; motions between nodes are evaluated once for each mesh."""
    calls = []
    evaluate = Layout.at_points

    def counted(*args):
        calls.append(args)
        return evaluate(*args)

    monkeypatch.setattr(Layout, "at_points", counted)
    numbers = []
    for count in (1, 4):
        calls.clear()
        part = read(tmp_path, rows_of_bricks(count, tied=True))
        numbers.append(len(calls))
    assert numbers[0] == numbers[1]
    one = read(tmp_path, rows_of_bricks(4, tied=False), merge=1e-6)
    for direction in ((0, 0, 1), (0.6, 0, 0.8)):
        softness = k0(part, (0, 0, 2.0), direction)
        assert softness == pytest.approx(k0(one, (0, 0, 2.0), direction), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("turning", ["", ", ROT NODE=200"])
def test_a_rigid_body_is_that_of_an_assembly(tmp_path, turning):
    nodes = "*NODE\n100, .5, .5, 3.\n200, 0., 0., 0.\n"
    rigid = f"*NSET, NSET=TOP\n9, 10, 11, 12\n*RIGID BODY, NSET=TOP, REF NODE=100{turning}\n"
    part = read(tmp_path, column() + nodes + SOLID + MATERIAL + FOOT + rigid)
    mesh = ao.read_mesh(tmp_path / "part.inp")
    bare = ao.Structure(mesh, ao.Solid(E, 0.0, 1000.0), ao.Support(plane=((0, 0, 0), (0, 0, 1))))
    joint = ao.Rigid("part:TOP", "reference")
    by_hand = ao.assemble({"part": bare}, [joint], points={"reference": (0.5, 0.5, 3)})
    for direction in ((1, 0, 0), (0, 0, 1), (1, 2, 3)):
        site = (1, 0, L), direction
        assert k0(part, *site) == pytest.approx(k0(by_hand, *site), rel=1e-9)


STEEL, NU, RHO, R, LENGTH, COUNT, C = 2e11, 0.3, 7800.0, 0.02, 1.0, 4, 3.0
TIP = ao.Site((LENGTH, 0, 0), (0, 0, 1))


def bars(*more: str) -> str:
    """A cantilever along x, in SI units."""
    grids = [f"GRID,{k + 1},,{k * LENGTH / COUNT},0.,0." for k in range(COUNT + 1)]
    bars = [f"CBAR,{k + 1},1,{k + 1},{k + 2},0.,0.,1." for k in range(COUNT)]
    rest = ["PBARL,1,1,,ROD", f",{R}", f"MAT1,1,{STEEL},,{NU},{RHO}", "SPC1,1,123456,1"]
    return "\n".join(["BEGIN BULK", *grids, *bars, *rest, *more, "ENDDATA", ""])


def abaqus(more: str) -> str:
    """The same in mm, N and t."""
    nodes = "".join(f"{k + 1},{1e3 * k * LENGTH / COUNT},0.,0.\n" for k in range(COUNT + 1))
    beams = "".join(f"{k + 1},{k + 1},{k + 2}\n" for k in range(COUNT))
    return (
        f"*NODE\n{nodes}*ELEMENT,TYPE=B31,ELSET=ALL\n{beams}"
        f"*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=CIRC\n{1e3 * R}\n0.,0.,1.\n"
        f"*MATERIAL,NAME=M\n*ELASTIC\n{1e-6 * STEEL},{NU}\n*DENSITY\n{1e-12 * RHO}\n"
        f"*BOUNDARY\n1,ENCASTRE\n{more}"
    )


DECKS = {
    "CDAMP2": bars(f"CDAMP2,9,{C},{COUNT + 1},3"),
    "CDAMP1": bars(f"CDAMP1,9,7,{COUNT + 1},3", f"PDAMP,5,1.,7,{C}"),
    "CBUSH": bars(f"CBUSH,9,9,{COUNT + 1},,,,,0", f"PBUSH,9,B,,,{C}"),
    "DASHPOT1": abaqus(
        f"*ELEMENT,TYPE=DASHPOT1,ELSET=D\n9,{COUNT + 1}\n*DASHPOT,ELSET=D\n3\n{1e-3 * C}\n"
    ),
    "DASHPOTA": abaqus(
        f"*NODE\n9,{1e3 * LENGTH},0.,1000.\n*BOUNDARY\n9,1,6\n"
        f"*ELEMENT,TYPE=DASHPOTA,ELSET=D\n9,9,{COUNT + 1}\n*DASHPOT,ELSET=D\n\n{1e-3 * C}\n"
    ),
}


def structure(folder, text: str) -> ao.Structure:
    path = folder / ("part.inp" if text.startswith("*") else "part.bdf")
    path.write_text(text)
    return ao.read_model(path, "mm" if text.startswith("*") else "m")


@pytest.mark.filterwarnings("ignore:.*the one number of SECTION=CIRC")
@pytest.mark.slow
@pytest.mark.parametrize("case", DECKS)
def test_a_damper_to_the_ground_gives_its_ratios(case, tmp_path):
    text = DECKS[case]
    damped = ao.extract(structure(tmp_path, text), TIP, n=6, error=None)
    body = ao.superposition(structure(tmp_path, bars()), TIP, 4).modal()
    expected = C * body.b**2 / (2 * body.omega)
    found = damped.modal()
    assert found.damping is not None
    ratio = found.damping.matrix.diagonal() / (2 * found.omega)
    np.testing.assert_allclose(found.omega[:2], body.omega[:2], rtol=2e-3)
    np.testing.assert_allclose(ratio[:2], expected[:2], rtol=1e-2)
    assert expected[0] > 1e-3
