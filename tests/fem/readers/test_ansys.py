"""Archives of Ansys: meshes with components, and models."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao

pytestmark = pytest.mark.fem

HEAD = "/PREP7\nET,        1,{element}\n"
MATERIAL = (
    "MPTEMP,R5.0, 1, 1,  0.0,\n"
    "MPDATA,R5.0, 1,EX  ,       1, 1,  210000.0,\n"
    "MPDATA,R5.0, 1,NUXY,       1, 1, 0.3,\n"
    "MPDATA,R5.0, 1,DENS,       1, 1, 7.85E-09,\n"
)


def nblock(points) -> str:
    lines = ["NBLOCK,6,SOLID", "(3i9,6e21.13e3)"]
    for number, x in enumerate(points, 10):
        values = list(x)
        while values and values[-1] == 0:  # as Ansys writes them
            values.pop()
        lines.append(f"{number:9d}{0:9d}{0:9d}" + "".join(f"{c:21.13E}" for c in values))
    return "\n".join([*lines, "N,R5.3,LOC,       -1,", ""])


def eblock(elements, section: int = 1) -> str:
    lines = ["EBLOCK,19,SOLID", "(19i8)"]
    for number, nodes in enumerate(elements, 1):
        head = [1, 1, 1, section, 0, 0, 0, 0, len(nodes), 0, number, *nodes[:8]]
        lines.append("".join(f"{one:8d}" for one in head))
        if len(nodes) > 8:
            lines.append("".join(f"{one:8d}" for one in nodes[8:]))
    return "\n".join([*lines, f"{-1:8d}", ""])


def brick() -> tuple[list[tuple[float, ...]], list[int]]:
    """Points and nodes of one element of 20 nodes, 100 x 20 x 10 mm, in Ansys' order."""
    low = [(0, 0), (100, 0), (100, 20), (0, 20)]
    x = np.array([(*p, z) for z in (0, 10) for p in low], dtype=float)
    ends = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
    ends += [(k, k + 4) for k in range(4)]
    points = [tuple(one) for one in (*x, *((x[a] + x[b]) / 2 for a, b in ends))]
    return points, list(range(10, 30))


COMPONENT = "CMBLOCK,CLAMP   ,NODE,       4\n(8i10)\n" + "".join(
    f"{n:10d}" for n in (10, 13, 14, 17)
)


@pytest.mark.parametrize("element", [186, 95])
def test_a_brick_is_a_model_with_its_mass_and_component(tmp_path, element):
    points, nodes = brick()
    held = "".join(f"D,{n},ALL  ,  0.0,\n" for n in (10, 13, 14, 17, 21, 25, 26, 29))
    path = tmp_path / "a.cdb"
    text = HEAD.format(element=element) + nblock(points) + eblock([nodes])
    path.write_text(text + COMPONENT + "\n" + MATERIAL + held)
    part = ao.read_model(path, unit="mm")
    assert part.mass == pytest.approx(7850 * 0.1 * 0.02 * 0.01)
    assert part.mesh.node(11) == pytest.approx([0.1, 0, 0])
    assert len(part.mesh.groups["CLAMP"][2]) == 1
    tip = ao.Site((0.1, 0.01, 0.005), (-1, 0, 0))
    with pytest.warns(ao.AccuracyWarning):
        held_by_deck = ao.extract(part, tip, n=2).k0
    steel = ao.Solid(210e9, 0.3, 7850.0)
    other = ao.Structure(ao.read_mesh(path, unit="mm"), steel, [ao.Support("CLAMP")])
    with pytest.warns(ao.AccuracyWarning):
        assert ao.extract(other, tip, n=2).k0 == pytest.approx(held_by_deck)


@pytest.mark.parametrize(
    "thickness",
    [
        "SECTYPE,1,SHELL\nSECBLOCK, 2\n 1.5, 1, 0\n 0.5, 1, 0\n",
        "SECTYPE,1,SHELL\nSECDATA,2.0,1\n",
        "R,1,2.0\n",
        "RLBLOCK,       1,       1,       6,       7\n(2i8,6g16.9)\n(7g16.9)\n"
        + f"{1:8d}{1:8d}{2.0:16.9f}\n",
    ],
)
def test_shells_have_the_thickness_of_their_section_or_constants(tmp_path, thickness):
    points = [(0, 0, 0), (100, 0, 0), (100, 50, 0), (0, 50, 0), (150, 25, 0)]
    quads = [[10, 11, 12, 13], [11, 14, 12, 12]]
    path = tmp_path / "a.cdb"
    head = HEAD.format(element=181)
    path.write_text(head + thickness + nblock(points) + eblock(quads) + MATERIAL)
    part = ao.read_model(path, unit="mm")
    assert part.mass == pytest.approx(7850 * 2e-3 * (0.1 * 0.05 + 0.05 * 0.05 / 2))


def test_an_input_of_workbench_is_read_as_an_archive(tmp_path):
    points, nodes = brick()
    text = "/batch\n" + HEAD.format(element=186) + nblock(points) + eblock([nodes]) + MATERIAL
    (tmp_path / "ds.dat").write_text(text)
    assert ao.read_model(tmp_path / "ds.dat", unit="mm").mass == pytest.approx(0.157)


REFUSED = {
    "contact": (HEAD.format(element=174), MATERIAL, "no elements"),
    "no modulus": (HEAD.format(element=186), "", "no constants of elasticity"),
    "orthotropic": (HEAD.format(element=186), MATERIAL + "MP,EY,1,1e5\n", "orthotropic"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_model_is_refused(tmp_path, case):
    head, material, said = REFUSED[case]
    points, nodes = brick()
    path = tmp_path / "a.cdb"
    path.write_text(head + nblock(points) + eblock([nodes[:8]]) + material)
    with pytest.raises(ao.MeshError, match=said):
        ao.read_model(path)


def test_programs_without_a_reader_are_named(tmp_path):
    for ending, program in ((".k", "LS-PrePost"), (".mphtxt", "COMSOL"), (".sldprt", "STEP")):
        path = tmp_path / f"a{ending}"
        path.write_text("something")
        with pytest.raises(ao.MeshError, match=program):
            ao.read_mesh(path)
