"""Ends of beams, masses beside their nodes and scalar points of Nastran decks as structures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao

pytestmark = [pytest.mark.fem, pytest.mark.slow]

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


# --- Pins, offsets, taper -------------------------------------------------------------------------

CLAMPED = "SPC1,1,123456,1,3\n"
TIP = L**3 / (3 * E * I) + L / GA  # of a cantilever


@pytest.mark.sample
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


@pytest.mark.sample
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


# --- Masses ---------------------------------------------------------------------------------------


# --- Rods -----------------------------------------------------------------------------------------
