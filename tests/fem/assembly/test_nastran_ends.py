"""Ends of beams, masses beside their nodes and scalar points of Nastran decks as structures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao

pytestmark = pytest.mark.slow

E, NU, RHO, R, L = 2e11, 0.3, 7800.0, 0.05, 1.0
A, I = np.pi * R**2, np.pi * R**4 / 4  # noqa: E741
GA = 0.9 * E / 2.6 * A
BAR = f"PBARL,1,1,,ROD\n,{R}\n"
MATERIAL = f"MAT1,1,{E},,{NU},{RHO}\n"


def read(folder: Path, text: str, **options) -> ao.Structure:
    path = folder / "part.bdf"
    path.write_text(text)
    return ao.read_model(path, **options)


def line(count: int, more: str = "", name: str = "CBAR") -> str:
    """Beams along x over the length L each, plane 1 upright."""
    grids = "".join(f"GRID,{k + 1},,{k * L},0.,0.\n" for k in range(count + 1))
    bars = "".join(f"{name},{k + 1},1,{k + 1},{k + 2},0.,0.,1.{more}\n" for k in range(count))
    return grids + bars + MATERIAL


def k0(part: ao.Structure, point, direction) -> float:
    return ao.extract(part, ao.Site(point, direction), n=2).k0


CLAMPED = "SPC1,1,123456,1,3\n"
TIP = L**3 / (3 * E * I) + L / GA  # of a cantilever


@pytest.mark.parametrize("pins", ["56,", ",56"])
def test_a_hinge_between_two_bars(tmp_path, pins):
    """Moments are released at one end in the middle: two cantilevers beside each other."""
    own = line(2).replace("CBAR,2,1,2,3,0.,0.,1.", "CBAR,2,1,2,3,0.,0.,1.,,\n,56")
    if pins == ",56":
        own = line(2).replace("CBAR,1,1,1,2,0.,0.,1.", "CBAR,1,1,1,2,0.,0.,1.,,\n,,56")
    part = read(tmp_path, own + BAR + CLAMPED)
    assert part.mass == pytest.approx(RHO * A * 2 * L, rel=1e-12)
    for direction in ((0, 0, 1), (0, 1, 0)):
        assert k0(part, (L, 0, 0), direction) == pytest.approx(2 / TIP, rel=1e-8)
    assert k0(part, (L, 0, 0), (1, 0, 0)) == pytest.approx(2 * E * A / L, rel=1e-8)


@pytest.mark.parametrize("name", ["CBAR", "CBEAM"])
def test_a_bar_off_its_nodes_bends_under_an_axial_force(tmp_path, name):
    """Offsets askew to the orientation; a spring k at the node, e beside the end that is struck."""
    e, k = 0.2, 1e8
    spring = f"CELAS2,9,{k},2,1\nSPC1,1,123456,1\n"
    own = line(1, f",,\n,,,0.,{e},0.,0.,{e},0.", name) + BAR + spring
    part = read(tmp_path, own if name == "CBAR" else own.replace("PBARL", "PBEAML"))
    along, turned = L / (E * A), L / (E * I)
    compliance = along - along**2 / (1 / k + along + e**2 * turned)
    assert k0(part, (L, e, 0), (1, 0, 0)) == pytest.approx(1 / compliance, rel=1e-8)


@pytest.mark.slow
def test_an_rbe2_follows_the_directions_of_its_nodes(tmp_path):
    """One direction of a node's own, askew to the axes: held there, the tip is a roller."""
    system = "CORD2R,5,,0.,0.,0.,0.,0.,1.,\n,.8,.6,0.\n"
    text = line(2).replace(f"GRID,3,,{2 * L},0.,0.", f"GRID,3,,{2 * L},0.,0.,5")
    held = "GRID,9,,2.,0.,0.\nSPC1,1,123456,1,9\n"
    both = [
        read(tmp_path, system + text + BAR + held + f"RBE2,8,9,{own},3\n")
        for own in ("2", "13", "456")
    ]
    spc = [
        read(tmp_path, system + text + BAR + f"SPC1,1,123456,1\nSPC1,1,{own},3\n")
        for own in ("2", "13", "456")
    ]
    for first, second in zip(both, spc, strict=True):
        for direction in ((0.3, 1, 0.2), (0, 0, 1)):
            assert k0(first, (L, 0, 0), direction) == pytest.approx(
                k0(second, (L, 0, 0), direction), rel=1e-8
            )


@pytest.mark.parametrize("orientation", [",,,", "0.,1.,0.,", ",,,5"])
def test_a_bushing_between_nodes_apart_has_rigid_arms(tmp_path, orientation):
    """CBUSH at a third of its line, against one between coincident nodes on arms by RBE2."""
    free = orientation == ",,,"  # along the line alone
    constants = "4.+6,,,2.+5" if free else "4.+6,3.+6,2.+6,2.+5,3.+5,1.+5"
    grids = "GRID,9,,1.,.6,.3\nSPC1,1,123456,1,9\n"
    turned = "CORD2R,5,,0.,0.,0.,.1,-.9,.2,\n,0.,.6,.3\n"
    root = line(1) + BAR + grids + turned
    own = f"CBUSH,7,7,2,9,{orientation},\n,.3333333333333\nPBUSH,7,K,{constants}\n"
    between = "GRID,21,,1.,.2,.1\nGRID,22,,1.,.2,.1\nRBE2,31,2,123456,21\nRBE2,32,9,123456,22\n"
    system = "5"
    if orientation != ",,,5":
        x = np.array([0, 0.6, 0.3])
        z = np.cross(x, (1, 0, 0) if free else (0, 1, 0))
        between += f"CORD2R,6,,0.,0.,0.,{z[0]},{z[1]},{z[2]},\n,{x[0]},{x[1]},{x[2]}\n"
        system = "6"
    arms = between + f"CBUSH,7,7,21,22,,,,{system}\nPBUSH,7,K,{constants}\n"
    first, second = read(tmp_path, root + own), read(tmp_path, root + arms)
    for direction in ((1, 0, 0), (0, 1, 0), (0.2, 0.3, 1)):
        site = (L, 0, 0), direction
        assert k0(first, *site) == pytest.approx(k0(second, *site), rel=1e-8)
