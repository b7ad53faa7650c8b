"""Edges of shells and ends of beams on solids, against solids throughout."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.errors import InputError
from assemblies import NU, SOLID, E, box, eigenfrequencies, line
from marks import FREE_ON_PURPOSE

pytestmark = FREE_ON_PURPOSE

T, WIDTH = 0.01, 0.06
CLAMP = ao.Support("x0")
SHEET = ao.Shell(E, NU, 2700.0, T)


def root(n: int, cell: str = "hexahedron") -> ao.Structure:
    """The clamped half of a strip, as a solid."""
    mesh = box((0, 0, -T / 2), (0.1, WIDTH, T / 2), (6 * n, 3 * n, n), cell)
    return ao.Structure(mesh, SOLID, [CLAMP])


def sheet() -> ao.Structure:
    return ao.Structure(box((0, 0), (0.1, WIDTH), (6, 4), "triangle"), SHEET)


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_shell_edge_on_a_solid_against_the_solid_throughout(cell):
    """A cantilever strip, half solid and half shell: k0 and the bending frequencies."""
    strip = ao.Structure(
        box((0, 0, -T / 2), (0.2, WIDTH, T / 2), (24, 6, 2)), SOLID, [CLAMP], order=2
    )
    top = ao.Site((0.17, 0.02, T / 2), (0, 0, -1), radius=5e-3)
    with pytest.warns(ao.AccuracyWarning):  # the patch is as large as the faces
        whole = ao.extract(strip, top, n=16)
    exact = 1 / (1 / whole.k0 - whole.local_compliance)
    joined = ao.assemble(
        {"root": root(2, cell), "sheet": sheet()}, [ao.Tie("root:x1", "sheet:x0")],
        {"sheet": (0.1, 0, 0)},
    )  # fmt: skip
    ours = ao.extract(joined, ao.Site((0.17, 0.02, 0.0), (0, 0, -1), radius=5e-3), n=16)
    assert ours.k0 == pytest.approx(exact, rel=5e-3)
    # an uneven mesh gives a mode in the plane of the strip 6e-6 of the mass
    for omega in ours.omega[ours.m > 1e-4 * ours.m_st][:2]:
        assert np.abs(whole.omega / omega - 1).min() < 5e-3


@pytest.mark.sample
@pytest.mark.parametrize("angle", [0.0, np.pi / 6])
def test_a_shell_edge_on_a_solid_keeps_rigid_motions(angle):
    """A free block with a fin: six motions without strain, whatever way the fin stands."""
    block = ao.Structure(box((0, 0, 0), (0.1, 0.1, 0.1), (2, 2, 2)), SOLID, order=1)
    fin = ao.Structure(box((0, 0), (0.1, 0.05), (2, 2), "triangle"), SHEET)
    place = ao.Placement(shift=(0.1, 0.03, 0.04), axis=(1, 0, 0), angle=angle)
    both = ao.assemble({"block": block, "fin": fin}, [ao.Tie("block:x1", "fin:x0")], {"fin": place})
    low = eigenfrequencies(both, 7)
    assert (low[:6] < 1e-4 * low[6]).all()
    assert both.mass == pytest.approx(2.7 + 2700.0 * T * 0.1 * 0.05, rel=1e-12)


def test_a_shell_edge_beside_the_face_is_refused():
    """The sheet ends on the rim of the block: half of its thickness is over nothing."""
    with pytest.raises(InputError, match="too little of the shell's thickness"):
        ao.assemble(
            {"root": root(1), "sheet": sheet()}, [ao.Tie("root:x1", "sheet:x0", gap=5e-3)],
            {"sheet": (0.1, 0, T / 2 + 3e-3)},
        )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("joint", [ao.Rigid, ao.Mean])
def test_a_beam_end_on_a_solid_against_the_solid_throughout(joint):
    """A cantilever of a square section, half solid and half beam; errors against mesh size."""
    side = 0.02
    section = ao.Section.rectangle(side, side)
    beam = ao.Beam(E, NU, 2700.0, section, orientation=(0, 0, 1))
    whole = ao.Structure(box((0, 0, 0), (0.3, side, side), (30, 2, 2)), SOLID, [CLAMP])
    pulled = ao.assemble({"bar": whole}, [ao.Mean("bar:x1", "hub")],
                         points={"hub": (0.3, side / 2, side / 2)})  # fmt: skip
    exact = ao.extract(pulled, ao.Site(vector=_unit(pulled)), n=0).k0
    errors = []
    for n in (1, 2):
        solid = ao.Structure(box((0, 0, 0), (0.15, side, side), (7 * n, n, n)), SOLID, [CLAMP])
        outer = ao.Structure(line((0.15, side / 2, side / 2), (0.3, side / 2, side / 2), 6), beam)
        joined = ao.assemble({"solid": solid, "outer": outer}, [joint("solid:x1", "outer:start")])
        tip = ao.Site((0.3, side / 2, side / 2), (0, 0, -1), part="outer")
        errors.append(abs(ao.extract(joined, tip, n=0).k0 / exact - 1))
    assert errors[-1] < 5e-3
    assert errors[-1] <= errors[0] + 1e-3


def _unit(structure: ao.Structure) -> np.ndarray:
    """The functional of q that is the deflection of the hub."""
    z = structure.layout.of_point("hub")[2]
    return structure.T.T[:, z].toarray().ravel()
