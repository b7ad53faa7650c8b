"""Shells of decks beside their nodes, by their stiffnesses, and with directions of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from assemblies import lowest

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:of part.bdf are not taken")]

E, T, WIDTH, LENGTH = 2e11, 0.02, 0.1, 1.0
MANY = 8


def points() -> list[tuple[int, float, float]]:
    """Nodes of a strip along x, two at each place."""
    steps = [LENGTH * k / MANY for k in range(MANY + 1)]
    return [(2 * k + j + 1, x, j * WIDTH) for k, x in enumerate(steps) for j in (0, 1)]


def quads() -> list[tuple[int, int, int, int]]:
    return [(2 * k + 1, 2 * k + 3, 2 * k + 4, 2 * k + 2) for k in range(MANY)]


def nastran(folder: Path, text: str, element: str = "") -> ao.Structure:
    grids = "".join(f"GRID,{n},,{x},{y},0.\n" for n, x, y in points())
    cells = "".join(
        f"CQUAD4,{k},1,{','.join(map(str, nodes))}{element}\n" for k, nodes in enumerate(quads(), 1)
    )
    path = folder / "part.bdf"
    path.write_text(grids + cells + text)
    return ao.read_model(path)


def abaqus(folder: Path, text: str) -> ao.Structure:
    nodes = "*NODE\n" + "".join(f"{n},{x},{y},0.\n" for n, x, y in points())
    cells = "*ELEMENT,TYPE=S4,ELSET=ALL\n" + "".join(
        f"{k},{','.join(map(str, corners))}\n" for k, corners in enumerate(quads(), 1)
    )
    path = folder / "part.inp"
    path.write_text(nodes + cells + text)
    return ao.read_model(path)


MASS = 1e10
MIDDLE = (MANY + 1, MANY + 2)
ENDS = (1, 2, 2 * MANY + 1, 2 * MANY + 2)


def held(offset: float) -> float:
    """Stiffness in the middle of a beam on pins that lie beside its axis and do not move."""
    EA, EI, GA = E * WIDTH * T, E * WIDTH * T**3 / 12, 5 / 6 * E / 2 * WIDTH * T
    own = LENGTH**3 / (48 * EI) + LENGTH / (4 * GA)
    mixed, axial = offset * LENGTH**2 / (8 * EI), LENGTH / EA + offset**2 * LENGTH / EI
    return 1 / (own - mixed**2 / axial)


@pytest.mark.slow
@pytest.mark.parametrize("share", [pytest.param(0.5, marks=pytest.mark.slow), -0.75])
def test_a_strip_beside_its_pins_is_an_arch(tmp_path, share):
    """A light strip with a mass in its middle: k = ω² m."""
    offset = share * T
    a, b = MIDDLE
    spc = f"SPC1,1,123,{','.join(map(str, ENDS))}\nMPC,1,{a},3,1.,{b},3,-1.\n"
    masses = f"CMASS2,91,{MASS},{a},3\nMAT1,1,{E},,0.,7800.\n"
    by_zoffs = nastran(tmp_path, f"PSHELL,1,1,{T},1,,1\n" + spc + masses, f",,{offset}")
    by_z0 = nastran(tmp_path, f"PCOMP,1,{offset - T / 2},\n,1,{T},0.\n" + spc + masses)
    section = f"*SHELL SECTION,ELSET=ALL,MATERIAL=M,OFFSET={-share}\n{T}\n"
    section += f"*MATERIAL,NAME=M\n*ELASTIC\n{E},0.\n*DENSITY\n7800.\n"
    section += "*BOUNDARY\n" + "".join(f"{n},1,3\n" for n in ENDS) + "999,1,2\n"
    section += f"*EQUATION\n2\n{a},3,1.,{b},3,-1.\n"
    section += f"*NODE\n999,0.,0.,1.\n*EQUATION\n2\n999,3,1.,{a},3,-1.\n"
    section += f"*ELEMENT,TYPE=MASS,ELSET=W\n999,999\n*MASS,ELSET=W\n{MASS}\n"
    by_share = abaqus(tmp_path, section)
    for part in (by_zoffs, by_z0, by_share):
        assert lowest(part)[0] * MASS == pytest.approx(held(offset), rel=1e-3)
    assert abs(held(offset) / held(0) - 1) > 0.1


def test_a_solid_by_its_stresses(tmp_path):
    """MAT9 in a turned system, against the same constants by hand."""
    rng = np.random.default_rng(5)
    C = np.diag([3e9, 2e9, 1e9, 4e8, 5e8, 6e8])  # 11, 22, 33, 23, 13, 12
    C[0, 1] = C[1, 0] = 5e8
    C[0, 4] = C[4, 0] = 1e8
    order = [0, 1, 2, 5, 3, 4]  # 11, 22, 33, 12, 23, 31
    values = C[np.ix_(order, order)][np.triu_indices(6)]
    rows = [values[:7], values[7:15], values[15:]]
    mat = "MAT9,1," + "\n,".join(",".join(f"{v:.9e}" for v in row) for row in rows) + ",1200.\n"
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes[2] = np.cross(axes[0], axes[1])
    system = "CORD2R,5,,0.,0.,0.," + ",".join(f"{c:.12f}" for c in axes[2]) + ",\n,"
    system += ",".join(f"{c:.12f}" for c in axes[0]) + "\n"
    corners = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    grids = "".join(f"GRID,{k},,{x}.,{y}.,{z}.\n" for k, (x, y, z) in enumerate(corners, 1))
    path = tmp_path / "part.bdf"
    text = grids + "CHEXA,1,1,1,2,3,4,5,6,\n,7,8\nPSOLID,1,1,5\nSPC1,1,123,1,THRU,4\n"
    path.write_text(text + mat + system)
    part = ao.read_model(path)
    material = ao.AnisotropicSolid(C, 1200.0, axes)
    by_hand = ao.Structure(part.mesh, material, [ao.Support(lambda x: x[2] < 1e-9)])
    assert lowest(part) == pytest.approx(lowest(by_hand), rel=1e-8)


@pytest.mark.slow
def test_offsets_count_toward_the_normal(tmp_path):
    """A strip and a stiffener, both beside their nodes: their distance counts."""
    bars = "".join(
        f"CBAR,{100 + k},2,{2 * k + 1},{2 * k + 3},0.,0.,1.,,\n,,,0.,0.,{{0}},0.,0.,{{0}}\n"
        for k in range(MANY)
    )
    more = f"PSHELL,1,1,{T},1,,1\nPBARL,2,1,,BAR\n,.01,.03\nMAT1,1,{E},,.3,7800.\n"
    more += "SPC1,1,123456,1,2\n"
    both = lowest(nastran(tmp_path, more + bars.format(0.03), ",,.01"))
    beam = lowest(nastran(tmp_path, more + bars.format(0.02)))
    other = lowest(nastran(tmp_path, more + bars.format(0.04)))
    # bending of the stiffener across its plane is that of its line, wherever it lies
    assert both[:3] == pytest.approx(beam[:3], rel=1e-3)
    assert abs(other / beam - 1)[:3].max() > 0.1


def test_a_sandwich_by_its_bending_ratio(tmp_path):
    """PSHELL with 12I/T³, TS/T and MID3, against the faces and the core in layers."""
    face, core, G, rho = 1e-3, 0.018, 8e7, 2700.0
    t, height = 2 * face, core + face
    D = 12 / t**3 * (2 * face * (height / 2) ** 2 + 2 * face**3 / 12)
    layers = [
        ao.Layer.isotropic(7e10, 0.3, rho, face),
        ao.Layer(1e4, 1e4, 0.0, 1e4, G, G, 1e-3, core),
        ao.Layer.isotropic(7e10, 0.3, rho, face),
    ]
    stack = ao.Laminate(layers)
    share = stack.section.S[0, 0] / (G * t)
    text = f"PSHELL,1,1,{t},1,{D},2,{share}\nMAT1,1,7.+10,,.3,{rho}\nMAT1,2,,{G},0.\n"
    part = nastran(tmp_path, text + "SPC1,1,123456,1,2\n")
    by_hand = ao.Structure(part.mesh, stack, [ao.Support(lambda x: x[0] < 1e-9)])
    assert part.mass == pytest.approx(by_hand.mass, rel=1e-4)
    assert lowest(part, 4) == pytest.approx(lowest(by_hand, 4), rel=2e-3)
