"""Dampers of decks in the damping ratios of models, against c φ²/(2ω) of the beam without them."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao

pytestmark = pytest.mark.filterwarnings("ignore:.*the one number of SECTION=CIRC")

E, NU, RHO, R, L, COUNT, C = 2e11, 0.3, 7800.0, 0.02, 1.0, 4, 3.0
TIP = ao.Site((L, 0, 0), (0, 0, 1))


def nastran(*more: str) -> str:
    """A cantilever along x, in SI units."""
    grids = [f"GRID,{k + 1},,{k * L / COUNT},0.,0." for k in range(COUNT + 1)]
    bars = [f"CBAR,{k + 1},1,{k + 1},{k + 2},0.,0.,1." for k in range(COUNT)]
    rest = ["PBARL,1,1,,ROD", f",{R}", f"MAT1,1,{E},,{NU},{RHO}", "SPC1,1,123456,1"]
    return "\n".join(["BEGIN BULK", *grids, *bars, *rest, *more, "ENDDATA", ""])


def abaqus(more: str) -> str:
    """The same in mm, N and t."""
    nodes = "".join(f"{k + 1},{1e3 * k * L / COUNT},0.,0.\n" for k in range(COUNT + 1))
    beams = "".join(f"{k + 1},{k + 1},{k + 2}\n" for k in range(COUNT))
    return (
        f"*NODE\n{nodes}*ELEMENT,TYPE=B31,ELSET=ALL\n{beams}"
        f"*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=CIRC\n{1e3 * R}\n0.,0.,1.\n"
        f"*MATERIAL,NAME=M\n*ELASTIC\n{1e-6 * E},{NU}\n*DENSITY\n{1e-12 * RHO}\n"
        f"*BOUNDARY\n1,ENCASTRE\n{more}"
    )


DECKS = {
    "CDAMP2": nastran(f"CDAMP2,9,{C},{COUNT + 1},3"),
    "CDAMP1": nastran(f"CDAMP1,9,7,{COUNT + 1},3", f"PDAMP,5,1.,7,{C}"),
    "CBUSH": nastran(f"CBUSH,9,9,{COUNT + 1},,,,,0", f"PBUSH,9,B,,,{C}"),
    "CVISC": nastran(f"GRID,9,,{L},0.,1.,,123456", f"CVISC,9,9,9,{COUNT + 1}", f"PVISC,9,{C}"),
    "DASHPOT1": abaqus(
        f"*ELEMENT,TYPE=DASHPOT1,ELSET=D\n9,{COUNT + 1}\n*DASHPOT,ELSET=D\n3\n{1e-3 * C}\n"
    ),
    "DASHPOTA": abaqus(
        f"*NODE\n9,{1e3 * L},0.,1000.\n*BOUNDARY\n9,1,6\n"
        f"*ELEMENT,TYPE=DASHPOTA,ELSET=D\n9,9,{COUNT + 1}\n*DASHPOT,ELSET=D\n\n{1e-3 * C}\n"
    ),
}


def structure(folder, text: str) -> ao.Structure:
    path = folder / ("part.inp" if text.startswith("*") else "part.bdf")
    path.write_text(text)
    return ao.read_model(path, "mm" if text.startswith("*") else "m")


@pytest.mark.slow
@pytest.mark.parametrize("case", DECKS)
def test_a_damper_to_the_ground_gives_its_ratios(case, tmp_path):
    text = DECKS[case]
    damped = ao.extract(structure(tmp_path, text), TIP, n=6, error=None)
    body = ao.superposition(structure(tmp_path, nastran()), TIP, 4).modal()
    expected = C * body.b**2 / (2 * body.omega)
    found = damped.modal()
    assert found.damping is not None
    ratio = found.damping.matrix.diagonal() / (2 * found.omega)
    np.testing.assert_allclose(found.omega[:2], body.omega[:2], rtol=2e-3)
    np.testing.assert_allclose(ratio[:2], expected[:2], rtol=1e-2)
    assert expected[0] > 1e-3
