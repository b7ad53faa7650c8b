"""Cut, changed and huge Nastran decks are read or refused in one sentence, and nothing else."""

from __future__ import annotations

import random
import re

import pytest

from antiosc.base.errors import AntioscError
from antiosc.io.unit_system import UnitSystem
from antiosc_decks.nastran import mesh as nastran, model as nastran_model

SI = UnitSystem(1.0, 1.0)
#: Every kind of entry that a model takes.
WHOLE = """\
SOL 103
SPC = 1
MPC = 7
BEGIN BULK
GRDSET,,,,,,5
BAROR,,,,,0.,0.,1.
CORD2R,5,,0.,0.,0.,0.,0.,1.,
,.8,.6,0.
CORD2C,6,,0.,0.,0.,0.,0.,1.,
,1.,0.,0.
GRID,1,,0.,0.,0.
=,*1,=,*1.,==
=(2)
GRID    5               0.      1.      0.
GRID    6               1.      1.      0.
GRID    7               2.      1.      0.
GRID*                  8               6             1.0            30.0
*                    1.0
GRID,9,,0.,0.,1.
GRID,10,,1.,0.,1.
GRID,11,,0.,1.,1.
GRID,12,,1.,1.,1.
SPOINT,101,THRU,103
CQUAD4,1,1,1,2,6,5,30.,.01
,,1,.9,1.,1.,1.
CTRIA3,2,2,2,3,6,5
CHEXA,3,3,1,2,6,5,9,10,
,12,11
CBAR,4,4,3,4,,,,GGG
,5,46,0.,0.,.1,0.,.1,.1
CBEAM,5,5,4,7,0.,0.,1.
CROD,6,6,10,12
CONROD,7,9,11,1,.01
CTUBE,8,7,9,12
PSHELL,1,1,.1,1,1.5,1,.8,3.
PCOMP,2,-.1,2.,,,,,SYM
,8,.05,0.,YES,2,.01,45.
PCOMPG,20
,1,8,.05,0.,YES
PSOLID,3,9,5
PBAR,4,1,.01,1.-4,2.-4,1.-5,3.,,
,,,,,,,,,
,.8,.8,1.-5
PBEAM,5,1,.01,1.-4,1.-4,,1.-4,,
,,,,,,,,,
,YES,1.,.005,5.-5,5.-5,,5.-5,,
,,,,,,,,,
PROD,6,1,.01,.001
PTUBE,7,1,.1,.01
MAT1,1,2.+11,,.3,7800.
MAT2,2,2.+11,6.+10,0.,2.+11,0.,7.+10,7800.
MAT8,8,1.+11,1.+10,.3,5.+9,,,1600.
MAT9,9,3.+9,1.+9,1.+9,,,,3.+9,
,1.+9,,,,3.+9,,,,
,1.+9,,,1.+9,,1.+9,1200.
CONM2,21,3,5,2.,.1,.2,.3,,
,1.,.1,1.,.1,.1,1.
CONM1,22,4,,2.,,2.,,,
,2.
CMASS1,23,30,5,3
CMASS2,24,3.,101,,102
CMASS3,25,30,102
CMASS4,26,3.,103
PMASS,30,4.
CELAS1,31,32,101,0,3,2
PELAS,32,1.+5
CELAS2,33,1.+5,4,1
CELAS3,34,32,101,102
CELAS4,35,1.+5,102,103
CBUSH,36,37,7,12,0.,1.,0.
,.3
PBUSH,37,K,1.+5,1.+5,1.+5,1.+3
,,GE,.1
RBE2,41,9,123,10,11
RBE3,42,,12,123,1.,123,9,10
,11,6
RBAR,43,5,11,123456,,,123
MPC,7,12,1,1.,10,1,-1.
,,11,1,.5
SPC1,1,13,1,THRU,2
SPC,1,5,2,0.
SPCADD,9,1
ENDDATA
"""


def tried(path, text: str) -> str:
    """What becomes of a deck: "" or the sentence of its refusal."""
    path.write_text(text, encoding="latin-1")
    try:
        nastran_model.model_of(nastran.read(path, path.name), SI, 7800.0)
    except AntioscError as error:
        return str(error)
    return ""


def damaged(text: str, rng: random.Random) -> str:
    """A cut deck, one with other or huge words, with lines twice, or without some."""
    kind = rng.randrange(6)
    lines = text.splitlines()
    at = rng.randrange(4, len(lines))
    if kind == 0:
        return text[: rng.randrange(len(text))]
    if kind == 1:
        del lines[at]
    elif kind == 2:
        lines.insert(at, lines[rng.randrange(4, len(lines))])
    else:
        words = [m.span() for m in re.finditer(r"[^,\s]+", lines[at])]
        a, b = rng.choice(words or [(0, len(lines[at]))])
        nasty = ("", "0", "-1", "1.+308", "1.-308", "99999999999999999999", "THRU", "1.5", "nan",
                 "inf", "7", "12", "=", "*5", "$", "é", "1_0", "-3.")  # fmt: skip
        lines[at] = lines[at][:a] + rng.choice(nasty) + lines[at][b:]
    return "\n".join(lines) + "\n"


def test_the_whole_deck_is_a_model(tmp_path):
    assert tried(tmp_path / "part.bdf", WHOLE) == ""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("seed", "count"), [(0, 20), *(pytest.param(k, 100, marks=pytest.mark.slow) for k in (7, 14))]
)
def test_damaged_bulk_data(tmp_path, seed, count):
    rng = random.Random(seed)
    told = 0
    for _ in range(count):
        text = damaged(WHOLE, rng)
        sentence = tried(tmp_path / "part.bdf", text)
        assert "\n" not in sentence
        told += bool(sentence)
    assert told > count / 4
