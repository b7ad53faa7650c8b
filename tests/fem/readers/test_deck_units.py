"""One deck of each program in metres, millimetres and inches: the same model in SI units.

Decks are written with SI numbers in brackets and the kind of each quantity, as <length 0.5>.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

from abaqus_decks import alike
from antiosc.io.unit_system import UnitSystem
from antiosc_decks.abaqus import assembly as abaqus_assembly, model as abaqus_model
from antiosc_decks.nastran import mesh as nastran, model as nastran_model

#: Quantity -> powers of length, force and mass, where mass is force / length.
QUANTITIES = {
    "length": (1, 0), "area": (2, 0), "second": (4, 0), "stress": (-2, 1), "mass": (-1, 1),
    "density": (-4, 1), "per_length": (-2, 1), "per_area": (-3, 1), "spring": (-1, 1),
    "torsion": (1, 1), "inertia": (1, 1), "moment": (0, 1), "force": (0, 1),
}  # fmt: skip


def deck_in(text: str, unit: str) -> tuple[str, UnitSystem]:
    """The deck with numbers in one system of units."""
    units = UnitSystem.of(unit)

    def number(match: re.Match[str]) -> str:
        of_length, of_force = QUANTITIES[match[1]]
        return repr(float(match[2]) / (units.length**of_length * units.force**of_force))

    return re.sub(r"<(\w+) ([^>]+)>", number, text), units


NASTRAN = """\
GRDSET,,5
CORD2R,5,,<length 0.1>,<length 0.2>,<length 0.3>,<length 0.1>,<length 0.4>,<length 0.3>,
,<length 0.5>,<length 0.2>,<length 0.3>
CORD2C,6,5,<length 0.>,<length 0.>,<length 0.>,<length 0.>,<length 0.>,<length 1.>,
,<length 1.>,<length 0.>,<length 0.>
GRID,1,0,<length 0.>,<length 0.>,<length 0.>
GRID,2,0,<length 1.>,<length 0.>,<length 0.>,6
GRID,3,0,<length 1.>,<length 1.>,<length 0.>
GRID,4,0,<length 0.>,<length 1.>,<length 0.>
GRID,5,0,<length 0.>,<length 0.>,<length 1.>
GRID,6,0,<length 1.>,<length 0.>,<length 1.>
GRID,7,0,<length 1.>,<length 1.>,<length 1.>
GRID,8,0,<length 0.>,<length 1.>,<length 1.>
GRID,9,6,<length 0.5>,30.,<length 0.2>
GRID,10,,<length 0.5>,<length 0.3>,<length 0.2>
CHEXA,1,1,1,2,3,4,5,6,
,7,8
CQUAD4,2,2,5,6,7,8,20.,<length 0.01>
,,,<length 0.02>,<length 0.02>,<length 0.02>,<length 0.02>
CQUAD4,3,3,1,2,6,5,,<length 0.02>
CQUAD4,4,4,2,3,7,6
CBAR,5,5,3,9,0.,0.,1.
,,45,<length 0.02>,0.,<length 0.03>,0.,<length 0.01>,0.
CBEAM,6,6,4,10,0.,1.,0.
CBAR,12,12,4,9,0.,0.,1.
CROD,7,7,9,10
CTUBE,8,8,4,9
CONROD,9,3,10,1,<area 0.002>,<second 3.e-6>,,<per_length 4.>
PSOLID,1,1
PSHELL,2,1,<length 0.03>,1,1.,1,,<per_area 5.>
PSHELL,3,1,<length 0.03>,1,1.5,1,.7,<per_area 5.>
PCOMP,4,<length -0.01>,<per_area 3.>,,,,,SYM
,8,<length 0.004>,0.,,2,<length 0.003>,45.
PBAR,5,1,<area 0.01>,<second 4.e-5>,<second 2.e-5>,<second 3.e-5>,<per_length 6.>,,
,,,,,,,,,
,.8,.8,<second 1.e-5>
PBEAM,6,1,<area 0.01>,<second 4.e-5>,<second 2.e-5>,,<second 3.e-5>,<per_length 6.>,
,,,,,,,,,
,NO,1.,<area 0.005>,<second 2.e-5>,<second 1.e-5>,,<second 2.e-5>,<per_length 3.>
PBARL,12,1,,HAT
,<length 0.05>,<length 0.004>,<length 0.03>,<length 0.02>,<per_length 2.>
PROD,7,1,<area 0.002>,<second 3.e-6>,,<per_length 4.>
PTUBE,8,1,<length 0.05>,<length 0.004>,<per_length 2.>
MAT1,1,<stress 2.e11>,,.3,<density 7800.>
MAT2,2,<stress 2.e11>,<stress 6.e10>,,<stress 2.1e11>,,<stress 7.e10>,<density 7000.>
MAT8,8,<stress 1.e11>,<stress 1.e10>,.3,<stress 5.e9>,,,<density 1600.>
CONM2,21,9,5,<mass 2.>,<length .1>,<length .2>,<length .3>,,
,<inertia 1.>,<inertia .1>,<inertia 1.>,<inertia .1>,<inertia .1>,<inertia 1.>
CONM2,22,10,,<mass 3.>,,,,,
,<inertia 1.>,,<inertia 2.>,,,<inertia 3.>
CONM2,28,3,-1,<mass 3.>,<length .4>,<length .2>,<length .3>
CONM1,23,10,,<mass 2.>,,<mass 2.>,,,
,<mass 2.>,,<moment .1>,,<inertia 1.>,,,
,,<inertia 1.>,,,,,,<inertia 1.>
CMASS2,24,<mass 3.>,9,1,10,2
CMASS2,25,<inertia 3.>,9,4,10,5
CMASS4,26,<mass 3.>,103
CMASS2,27,<mass 6.>,10,1
CELAS2,31,<spring 1.e5>,9,1,10,3
CELAS2,32,<torsion 1.e4>,9,4,10,6
CELAS2,33,<spring 1.e5>,10,2
CELAS2,34,<torsion 1.e4>,10,5
CDAMP2,35,<spring 1.e2>,9,1,10,3
CELAS4,36,<spring 1.e5>,103,104
CBUSH,37,37,9,10,0.,1.,0.,
,.3
CBUSH,38,38,10
PBUSH,37,K,<spring 1.e5>,<spring 2.e5>,<spring 3.e5>,<torsion 1.e3>,<torsion 2.e3>,<torsion 3.e3>
,,B,<spring 1.e2>,<spring 2.e2>,<spring 3.e2>,<torsion 1.>,<torsion 2.>,<torsion 3.>
PBUSH,38,K,<spring 1.e5>,,,,<torsion 1.e3>
SPOINT,103,104
GRID,11,0,<length 1.5>,<length 0.5>,<length 0.5>
GRID,12,0,<length 1.5>,<length 0.7>,<length 0.9>
RBE2,41,11,123456,6,7
RBE3,42,,12,123456,1.,123,2,3
,6,7
RBAR,43,9,4,123456,,,12
MPC,7,9,1,1.,10,1,-1.
,,10,5,<length .5>
SPC1,1,13,1,THRU,2
"""

ABAQUS = """\
*NODE,NSET=N
1,<length 0.>,<length 0.>,<length 0.>
2,<length 1.>,<length 0.>,<length 0.>
3,<length 1.>,<length 1.>,<length 0.>
4,<length 0.>,<length 1.>,<length 0.>
5,<length 0.>,<length 0.>,<length 1.>
6,<length 1.>,<length 0.>,<length 1.>
7,<length 1.>,<length 1.>,<length 1.>
8,<length 0.>,<length 1.>,<length 1.>
9,<length 0.5>,<length .4>,<length 1.6>
10,<length 0.2>,<length .4>,<length 1.7>
11,<length 1.5>,<length .4>,<length .3>
12,<length 1.6>,<length .4>,<length .5>
13,<length .3>,<length .3>,<length 1.0001>
*ELEMENT,TYPE=C3D8,ELSET=BODY
1,1,2,3,4,5,6,7,8
*ELEMENT,TYPE=S4,ELSET=LID
2,5,6,7,8
*ELEMENT,TYPE=S4,ELSET=SIDE
3,1,2,6,5
*ELEMENT,TYPE=B31,ELSET=POLE
4,5,9
*ELEMENT,TYPE=B31,ELSET=PIPE
5,9,10
6,10,13
*ELEMENT,TYPE=T3D2,ELSET=ROD
7,4,10
*ELEMENT,TYPE=MASS,ELSET=Q
21,9
22,2
*ELEMENT,TYPE=ROTARYI,ELSET=R
23,10
*ELEMENT,TYPE=SPRING1,ELSET=K1
31,9
*ELEMENT,TYPE=SPRING2,ELSET=K2
32,9,10
*ELEMENT,TYPE=SPRINGA,ELSET=K3
33,2,10
*ELEMENT,TYPE=DASHPOTA,ELSET=C
34,2,10
*ELEMENT,TYPE=DCOUP3D,ELSET=D
35,12
*SOLID SECTION,ELSET=BODY,MATERIAL=ORTHO,ORIENTATION=O
*SOLID SECTION,ELSET=ROD,MATERIAL=STEEL
<area 0.002>
*SHELL SECTION,ELSET=LID,MATERIAL=STEEL,OFFSET=.3
<length 0.02>
*SHELL SECTION,ELSET=SIDE,COMPOSITE,OFFSET=SPOS
<length 0.002>,3,PLY,30.
<length 0.001>,3,PLY,0.
*BEAM SECTION,ELSET=POLE,MATERIAL=STEEL,SECTION=RECT,OFFSET1=.5
<length 0.03>,<length 0.02>
0,1,0
*BEAM SECTION,ELSET=PIPE,MATERIAL=STEEL,SECTION=PIPE
<length 0.03>,<length 0.002>
0,1,0
*MATERIAL,NAME=STEEL
*ELASTIC
<stress 2.1e11>,.3
*DENSITY
<density 7800.>
*MATERIAL,NAME=ORTHO
*ELASTIC,TYPE=ENGINEERING CONSTANTS
<stress 9.e10>,<stress 4.e10>,<stress 2.e10>,.3,.2,.4,<stress 7.e9>,<stress 6.e9>,
<stress 5.e9>
*DENSITY
<density 1800.>
*MATERIAL,NAME=PLY
*ELASTIC,TYPE=LAMINA
<stress 9.e10>,<stress 4.e10>,.3,<stress 7.e9>,<stress 6.e9>,<stress 5.e9>
*DENSITY
<density 1600.>
*ORIENTATION,NAME=O
0,1,0,1,1,0
*MASS,ELSET=Q
<mass 3.>
*ROTARY INERTIA,ELSET=R
<inertia 1.>,<inertia 2.>,<inertia 3.>
*SPRING,ELSET=K1
5
<torsion 4.>
*SPRING,ELSET=K2
1,2
<spring 4.>
*SPRING,ELSET=K3

<spring 5.>
*DASHPOT,ELSET=C

<spring 6.>
*DISTRIBUTING COUPLING,ELSET=D
2,1.
3,2.
6,1.
*RIGID BODY,NSET=FACE,REF NODE=11
*NSET,NSET=FACE
1,4
*SURFACE,NAME=TOP
LID,SPOS
*SURFACE,NAME=FOOT,TYPE=NODE
13,
*TIE,NAME=T,POSITION TOLERANCE=<length 0.001>
FOOT,TOP
*EQUATION
3
9,1,1.,10,1,-1.,10,5,<length 0.5>
*NSET,NSET=TURNED
10
*TRANSFORM,NSET=TURNED,TYPE=C
<length 0.>,<length 0.>,<length 0.>,<length 0.>,<length 1.>,<length 1.>
*BOUNDARY
2,1,2
10,1
11,4
"""


@pytest.mark.parametrize("unit", ["mm", "in"])
def test_a_nastran_deck_is_the_same_in_other_units(tmp_path, unit):
    models, decks = [], []
    for one in ("m", unit):
        text, units = deck_in(NASTRAN, one)
        path = tmp_path / "part.bdf"
        path.write_text(text)
        found = nastran.read(path, path.name)
        models.append(nastran_model.model_of(found, units, None))
        decks.append(found.deck.points * units.length)
        names = [name for name, *_ in models[-1]["families"]]
        models[-1]["families"] = [family[1:] for family in models[-1]["families"]]
    assert len(names) > 20
    check(models, decks)


@pytest.mark.parametrize("unit", ["mm", "in"])
def test_an_abaqus_deck_is_the_same_in_other_units(tmp_path, unit):
    models, decks = [], []
    for one in ("m", unit):
        text, units = deck_in(ABAQUS, one)
        path = tmp_path / "part.inp"
        path.write_text(text)
        whole = abaqus_assembly.read(path, path.name)
        models.append(abaqus_model.model_of(whole, units, None))
        decks.append(whole.deck.points * units.length)
        models[-1]["families"] = [family[1:] for family in models[-1]["families"]]
        assert whole.deck.told == [
            "the 1 T3D2 of part.inp are springs, with their mass at their ends."
        ]
    check(models, decks)


def check(models: list, decks: list) -> None:
    np.testing.assert_allclose(decks[1], decks[0], rtol=1e-9, atol=1e-12)
    joints = [model["joints"] for model in models]
    for key, scaled in SCALED.items():
        found = [[numbers(scaled(one)) for one in some.pop(key)] for some in joints]
        assert len(found[0]) == len(found[1]) > 0
        for one, other in zip(*found, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-12)
    alike(models[1], models[0], rel=1e-7)


def sum_of_one(terms: list) -> tuple[list, float]:
    """A sum of motions whose first large coefficient is 1, and that coefficient."""
    most = max(abs(c) for _, _, c in terms)
    largest = next(c for _, _, c in terms if abs(c) > 0.9 * most)
    return [[node, motion, c / largest] for node, motion, c in terms], largest


def spring(one: list) -> tuple:
    terms, factor = sum_of_one(one[0])
    return terms, one[1] * factor**2


def mass(one: list) -> tuple:
    rows, factors = zip(*map(sum_of_one, one[0]), strict=True)
    return rows, (np.array(one[1]) * np.outer(factors, factors)).tolist(), one[2]


#: What is joined, so that the units in which the reader keeps it do not count.
SCALED = {
    "springs": spring, "dampers": spring, "masses": mass,
    "equations": lambda terms: sum_of_one(terms)[0],
}  # fmt: skip


def numbers(value) -> list[float]:
    """All numbers of nested lists, in order."""
    if isinstance(value, list | tuple):
        return [number for one in value for number in numbers(one)]
    return [float(value)]
