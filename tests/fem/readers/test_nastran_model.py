"""Cards and properties of Nastran decks as arguments of the families in SI units, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

import antiosc as ao
from abaqus_decks import alike
from antiosc_decks import nastran_mesh as nastran
from antiosc_decks.nastran_cards import BulkData
from antiosc_decks.sources import Sources
from nastran_decks import CYCLIC, GRIDS, HEXA, MAT1, NU, RHO, E, groups, line, read
from refusals import refused


@pytest.mark.parametrize(("system", "axes"), [("0", np.eye(3)), ("5", np.eye(3)[[1, 2, 0]])])
def test_a_solid_of_21_constants(tmp_path, system, axes):
    """MAT9 counts 11, 22, 33, 12, 23, 31; the result 11, 22, 33, 23, 13, 12."""
    C = np.array([[10.0 * min(i, j) + max(i, j) for j in range(1, 7)] for i in range(1, 7)])
    C += 100 * np.eye(6)
    words = [f"{C[i, j]:g}." for i in range(6) for j in range(i, 6)] + ["9.-9"]
    mat9 = "MAT9,2," + ",".join(words[:7]) + ",\n"
    for k in range(7, len(words), 8):
        mat9 += "," + ",".join(words[k : k + 8]) + "\n"
    text = GRIDS + HEXA + f"PSOLID,7,2,{system}\n" + mat9 + CYCLIC
    model, _ = read(tmp_path, text)
    order = [0, 1, 2, 4, 5, 3]
    expected = {"stiffness": (1e6 * C[np.ix_(order, order)]).tolist(), "rho": 9e3,
                "axes": axes[:2].tolist()}  # fmt: skip
    alike(model["families"], [["7", "AnisotropicSolid", expected, line(text, "PSOLID")]])
    for number, message in (("", "CORDM"), ("-1", "CORDM"), ("6", "CORD")):
        wrong = text.replace(f"PSOLID,7,2,{system}", f"PSOLID,7,2,{number}")
        with pytest.raises(ao.MeshError, match=rf"^{line(text, 'PSOLID')}: .*{message}"):
            read(tmp_path, wrong + CYCLIC.replace("CORD2R,5", "CORD2C,6"))


TUBE = math.pi / 4 * (4.0**2 - 3.0**2)
RODS = {
    # cards after the nodes 1, 2 and 7: name of the section's card, area, torsion, mass beside it
    "CROD,1,7,1,2\nCROD,2,7,2,7\nPROD,7,1,3.,2.,,4.-9\n": ("PROD", 3.0, 2.0, 4e-9),
    "CTUBE,1,7,1,2\nCTUBE,2,7,2,7\nPTUBE,7,1,4.,.5,4.-9\n": (
        "PTUBE", TUBE, math.pi / 32 * (4**4 - 3**4), 4e-9,
    ),
    "CTUBE,1,7,1,2\nCTUBE,2,7,2,7\nPTUBE,7,1,4.,,,4.\n": (
        "PTUBE", 4 * math.pi, math.pi / 32 * 4**4, 0.0,
    ),
    "CONROD,1,1,2,1,3.,2.,,4.-9\nCONROD,2,2,7,1,3.,2.,,4.-9\n": ("CONROD", 3.0, 2.0, 4e-9),
}  # fmt: skip
THREE = "".join(row for row in GRIDS.splitlines(True) if row[5] in "127")


@pytest.mark.parametrize("cards", RODS)
@pytest.mark.parametrize("factor", ["", "PARAM,WTMASS,.5\n"])
def test_rods_alone_are_a_truss(tmp_path, cards, factor):
    """A·E of the card; the mass per length is that of the material and NSM."""
    name, A, _, beside = RODS[cards]
    text = THREE + cards + MAT1 + "PARAM,AUTOSPC,NO\n" + factor
    model, _ = read(tmp_path, text)
    scale = 0.5 if factor else 1.0
    given = {"E": E, "nu": NU, "rho": scale * (8e-9 + beside / A) * 1e12, "area": A * 1e-6}
    found = groups(model)
    cards = ("CONROD,1", "CONROD,2") if name == "CONROD" else (name,)
    places = [line(text, card) for card in cards]
    alike(found, [["rods", "Truss", given, place] for place in places], rel=1e-7)
    assert "the torsion of rods, whose ends are hinges in a truss" in model["ignored"]
    assert not model["supports"]


BAR = "PBAR,7,1,6.,5.,3.,4.,2.-9\n"
SECTION = {"A": 6e-6, "I": 5e-12, "I_side": 3e-12, "J": 4e-12, "shear": 5 / 6}
HALF = math.sqrt(0.5)
ORIENTED = {
    "CBAR,1,7,1,2,0.,3.,3.": (0.0, HALF, HALF),
    "CBAR,1,7,1,2,5.,3.,0.": (0.0, 1.0, 0.0),
    "CBAR,1,7,1,2,8": (0.0, HALF, HALF),
    "CBAR,1,7,1,2,5.,,3.": (0.0, 0.0, 1.0),
    # node 4 moves along y, z and x of the deck
    "CBAR,1,7,4,3,0.,1.,0.": (0.0, 0.0, 1.0),
    "CBAR,1,7,4,3,0.,1.,0.,BGG": (0.0, 1.0, 0.0),
    "CBAR,1,7,4,3,0.,1.,0.,GGG": (0.0, 0.0, 1.0),
}


@pytest.mark.parametrize("card", ORIENTED)
@pytest.mark.parametrize("default", [False, True])
def test_orientations_of_bars(tmp_path, card, default):
    """By a vector, in the system of the first node or the basic one, or by a node; by BAROR."""
    text = GRIDS.replace("0.,10.,0.\n", "0.,10.,0.,5\n") + CYCLIC + BAR + MAT1
    if default:
        words = card.split(",")
        text += ",".join([words[0], "1", "", *words[3:5]]) + "\n"
        text += ",".join(["BAROR", "", "7", "", "", *words[5:]])
    model, _ = read(tmp_path, text + ("" if default else card) + "\n")
    expected = {"E": E, "nu": NU, "rho": RHO + 2e-9 / 6 * 1e12, "section": SECTION,
                "orientation": list(ORIENTED[card]), "offset": 0.0, "shear": False}  # fmt: skip
    alike(model["families"], [["7", "Beam", expected, line(text, "PBAR")]], rel=1e-8)
    assert "nonstructural mass of PBAR 7" in model["ignored"][0]


def test_a_section_is_turned_to_its_principal_axes(tmp_path):
    """The largest second moment 7 lies 30° from plane 1 toward the direction across."""
    I1, I2, I12 = 7 * 0.75 + 3 * 0.25, 7 * 0.25 + 3 * 0.75, 4 * HALF**2 * math.sqrt(3) / 2
    pbar = f"PBAR,7,1,6.,{I1},{I2},4.\n,,,,,,,,,\n,,,{I12:.15f}\n"
    bar = "CBAR,1,7,1,2,0.,1.,0.\n"
    model, _ = read(tmp_path, GRIDS + bar + pbar + MAT1)
    found = model["families"][0][2]
    alike(found["section"], {**SECTION, "I": 7e-12, "I_side": 3e-12})
    np.testing.assert_allclose(found["orientation"], [0, math.sqrt(0.75), 0.5], atol=1e-9)
    off = bar.replace("1.,0.\n", "1.,0.,,\n,,,0.,.1,0.,0.,.1,0.\n")
    with pytest.raises(ao.MeshError, match="with I12 and offsets"):
        read(tmp_path, GRIDS + off + pbar + MAT1)


#: Names and fields of entries of one to four lines.
ENTRIES = [
    ("GRID", ["1", "", "1.5", "-2.", "3.+1", "", "123"]),
    ("SPC1", ["7", "123456", "1", "2", "3", "4", "5", "6", "7", "8", "9"]),
    ("PBEAM", ["7", "1", "6.", *[""] * 7, "2.", *[""] * 5, ".8", ".9"]),
    ("MAT9", [*"1234567", "8.", *(f"{k}." for k in range(9, 24))]),
    ("CHEXA", ["1", "7", *map(str, range(1, 21))]),
    ("PARAM", ["POST", "-1"]),
]


def small(name: str, fields: list[str], mark: str = "", tab: bool = False) -> str:
    """Fields of eight characters; `mark` names the continuations in the field after them."""
    lines = []
    for k in range(0, len(fields), 8):
        head = name if k == 0 else mark
        own = [*fields[k : k + 8], *[""] * 8][:8]
        tail = mark if mark and k + 8 < len(fields) else ""
        row = [head, *own, tail]
        lines.append("\t".join(row) if tab else "".join(f"{word:<8}" for word in row))
    return "\n".join(row.rstrip() for row in lines) + "\n"


def large(name: str, fields: list[str], mark: str = "*") -> str:
    """Fields of sixteen characters, four in a line."""
    lines = []
    for k in range(0, len(fields), 4):
        head = f"{name}*" if k == 0 else mark
        lines.append(f"{head:<8}" + "".join(f"{word:>16}" for word in fields[k : k + 4]))
    return "\n".join(lines) + "\n"


def free(name: str, fields: list[str], mark: str = "", wide: bool = False) -> str:
    count = 4 if wide else 8
    lines = []
    for k in range(0, len(fields), count):
        head = f"{name}{'*' if wide else ''}" if k == 0 else ("*" if wide else mark)
        row = [head, *fields[k : k + count]]
        if mark and k + count < len(fields):
            row += [""] * (count + 1 - len(row)) + [mark]
        lines.append(" , ".join(row))
    return "\n".join(lines) + "\n"


FORMS = {
    "small": small,
    "small, marked": lambda n, f: small(n, f, "+A1"),
    "tabs": lambda n, f: small(n, f, tab=True),
    "large": large,
    "large, marked": lambda n, f: large(n, f, "*A1"),
    "free": free,
    "free, marked": lambda n, f: free(n, f, "+"),
    "free, wide": lambda n, f: free(n, f, wide=True),
    "lower case": lambda n, f: small(n.lower(), f),
    "comments": lambda n, f: "$ a comment\n\n" + small(n, f).replace("\n", "  $ of a line\n"),
}


def faults(folder, text: str) -> str:
    return " ".join(str(entry.fault) for entry in bulk(folder, text).entries if entry.fault)


def bulk(folder, text: str):
    path = folder / "part.bdf"
    path.write_text(text)
    return BulkData(Sources(path, path.name, lambda size: None))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("control", ["", "SOL 103\nCEND\nTITLE = a, b\nbegin  bulk\n"])
def test_every_form_has_the_same_fields(tmp_path, form, control):
    text = "".join(FORMS[form](name, fields) for name, fields in ENTRIES)
    found = bulk(tmp_path, control + text + ("ENDDATA,\nno more\n" if control else ""))
    assert (found.selected is not None) == bool(control)
    assert [entry.name for entry in found.entries] == [name for name, _ in ENTRIES]
    for entry, (_, fields) in zip(found.entries, ENTRIES, strict=True):
        assert [entry.text(k) for k in range(len(fields) + 9)] == [*fields, *[""] * 9]
    start = (control + text).splitlines()
    first = next(k for k, row in enumerate(start, 1) if row.upper().startswith("GRID"))
    assert str(found.entries[0].place) == f"line {first} of part.bdf"


def test_case_control_and_names_in_comments(tmp_path):
    text = "SPC = 3\n  mpc=4\nSUBCASE 2\nSPC=5\nMPC = 6\nSPC(PLOT) = ALL\nBEGIN BULK\n"
    text += '$HMNAME PROP           7"skin"\n$ANSA_NAME;8;PSHELL;a rib;\n'
    text += "$ANSA_NAME_COMMENT;9;PSOLID;block;no\n$ Femap Property 10 : web \n"
    text += "$ Femap with NX Nastran Property 11 : flange\nGRID,1\nBEGIN BULK\nGRID,2\n"
    found = bulk(tmp_path, text)
    assert found.selected == {("SPC", 0): 3, ("MPC", 0): 4, ("SPC", 1): 5, ("MPC", 1): 6}
    assert found.names == {7: "skin", 8: "a rib", 9: "block", 10: "web", 11: "flange"}
    assert [entry.integer(0) for entry in found.entries] == [1, 2]


LIST = [str(k) for k in (1, 123, *range(10, 22))]
FIRST, SECOND = LIST[:8], LIST[8:]
#: A parent with its mark, another entry, the continuation; and whether that is found.
APART = {
    "small": ("SPC1    " + "".join(f"{w:8}" for w in FIRST) + "+AB",
              "+AB     " + "".join(f"{w:8}" for w in SECOND), True),
    "a letter for the sign": ("SPC1    " + "".join(f"{w:8}" for w in FIRST) + "XAB",
                              "+AB     " + "".join(f"{w:8}" for w in SECOND), True),
    "free": (f"SPC1,{','.join(FIRST)},+AB", f"+AB,{','.join(SECOND)}", True),
    "another mark": (f"SPC1,{','.join(FIRST)},+AB", f"+AC,{','.join(SECOND)}", False),
}  # fmt: skip


@pytest.mark.parametrize("case", APART)
@pytest.mark.parametrize("between", ["SPC1,2,1,3,4,5,6,7,8,+CD\n+CD,9\n", "SPC1,2,1,3,,,,,,+E\n"])
def test_a_continuation_goes_to_the_entry_of_its_mark(tmp_path, case, between):
    first, second, found = APART[case]
    text = f"{first}\n{between}{second}\n"
    if not found:
        assert "does not follow its entry" in faults(tmp_path, text)
        return
    one, other = bulk(tmp_path, text).entries
    assert [word for word in one.fields if word] == LIST
    assert "10" not in other.fields
    assert [word for word in other.fields if word][:3] == ["2", "1", "3"]


ROW = "".join(f"GRID,{k},,{k}.,0.,0.\n" for k in range(1, 9))


WRONG = {
    ROW + "=,*1,==\n=(0)\n": (10, "repeats"),
    ROW + "SPOINT,99,3\n": (None, "SPOINT"),
    ROW + "CBAR,1,7,1\n": (9, "field"),
    ROW + "CBAR,,7,1,2\n": (9, "field"),
    ROW + "CBAR,1,7,1,2\n\n+,1\nCBAR,1,7,3,4\n": (12, "element"),
    ROW + "=,*1,==\n=(X)\n": (10, "integer"),
    "1GRID,2\n": (1, "data"),
    "+,2\n": (1, "continuation"),
    "$\nINCLUDE 'no\n": (2, "beside"),
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_told_with_its_line(tmp_path, text):
    path = tmp_path / "part.bdf"
    path.write_text(text)
    with refused(*WRONG[text], ao.MeshError):
        nastran.read_deck(Sources(path, path.name))
