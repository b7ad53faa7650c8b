"""Fields, continuations, copies, cells and groups of Nastran decks, each written by hand."""

from __future__ import annotations

import pytest

from antiosc.base.errors import MeshError
from antiosc_decks import nastran_mesh as nastran
from antiosc_decks.nastran_cards import Bulk
from antiosc_decks.sources import Sources
from refusals import refused

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
    return "\n".join(line.rstrip() for line in lines) + "\n"


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
    return Bulk(Sources(path, path.name, lambda size: None))


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
    first = next(k for k, line in enumerate(start, 1) if line.upper().startswith("GRID"))
    assert str(found.entries[0].place) == f"line {first} of part.bdf"


def test_a_line_in_large_fields_after_one_in_small_fields(tmp_path):
    """Each line of large fields is half a line of small ones."""
    text = large("MAT9", list("abcd")) + small("", list("ABCDEFGH"))
    (entry,) = bulk(tmp_path, text).entries
    assert [entry.text(k) for k in range(16)] == [*"abcd", *[""] * 4, *"ABCDEFGH"]
    text = small("MAT9", list("ABCDEFGH")) + large("", list("abcdefgh")).replace("*   ", "*A  ", 1)
    (entry,) = bulk(tmp_path, text).entries
    assert [entry.text(k) for k in range(16)] == [*"ABCDEFGH", *"abcdefgh"]


def test_case_control_and_names_in_comments(tmp_path):
    text = "SPC = 3\n  mpc=4\nSUBCASE 2\nSPC=5\nMPC = 6\nSPC(PLOT) = ALL\nBEGIN BULK\n"
    text += '$HMNAME PROP           7"skin"\n$ANSA_NAME;8;PSHELL;a rib;\n'
    text += "$ANSA_NAME_COMMENT;9;PSOLID;block;no\n$ Femap Property 10 : web \n"
    text += "$ Femap with NX Nastran Property 11 : flange\nGRID,1\nBEGIN BULK\nGRID,2\n"
    found = bulk(tmp_path, text)
    assert found.selected == {("SPC", 0): 3, ("MPC", 0): 4, ("SPC", 1): 5, ("MPC", 1): 6}
    assert found.names == {7: "skin", 8: "a rib", 9: "block", 10: "web", 11: "flange"}
    assert [entry.whole(0) for entry in found.entries] == [1, 2]


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


@pytest.mark.parametrize("line", ["+AB,1", "        404, 405", "{},1,2,3,4,5,6,7,8,+A,9"])
@pytest.mark.parametrize(("name", "read"), [("CAERO7", True), ("SPC1", False)])
def test_faults_of_entries_that_are_not_read_are_none(tmp_path, line, name, read):
    """Continuations, numbers and fields that do not fit."""
    path = tmp_path / "a.bdf"
    path.write_text(f"GRID,1\n{name},1,1,1,,,,,,+CD\n{line.format(name)}\nENDDATA\n")
    if read:
        assert nastran.read(Sources(path, path.name)).account.cards
        return
    with pytest.raises(MeshError, match="line 3 of"):
        nastran.read(Sources(path, path.name))


def test_equations_are_texts(tmp_path):
    """DEQATN has commas that divide no fields."""
    found = bulk(tmp_path, "DEQATN  1       F(A,B,C,D,E,G,H,I,J,K,L)=A+B\n        +C,1\nGRID,1\n")
    assert [entry.name for entry in found.entries] == ["DEQATN", "GRID"]


GRIDS = "".join(f"GRID,{k},,{k}.,0.,0.\n" for k in range(1, 9))


def test_groups_by_property_and_by_support(tmp_path):
    text = '$HMNAME PROP           7"skin"\n' + GRIDS + "CQUAD4,1,7,1,2,3,4\nCBAR,2,,1,2\n"
    text += "CONROD,3,1,2,9,.1\nCTRIA3,4,7,5,6,7\nSPOINT,20,THRU,22\nSPOINT,30,40\n"
    text += "SPC,5,1,123,,3,4\nSPC1,5,12,4,THRU,6\nSPC1,6,1,8,7,99\n"
    text += "CELAS2,70,1.,1,1\nRBE2,71,1,1,2\n"
    path = tmp_path / "part.bdf"
    path.write_text(text)
    found = nastran.read(Sources(path, path.name))
    assert {name: rows.tolist() for name, rows in found.deck.element_sets.items()} == {
        "2": [1], "7": [0, 3], "skin": [0, 3],
    }  # fmt: skip
    assert {name: rows.tolist() for name, rows in found.deck.node_sets.items()} == {
        "SPC 5": [0, 2, 3, 4, 5], "SPC 6": [6, 7],
    }  # fmt: skip
    assert found.scalar == {8: 20, 9: 21, 10: 22, 11: 30, 12: 40}
    assert found.deck.left == {"CELAS2": 1, "RBE2": 1}
    assert found.deck.points.shape == (13, 3)
    assert not found.deck.points[8:].any()


WRONG = {
    GRIDS + "=,*1,==\n=(0)\n": (10, "repeats"),
    GRIDS + "SPOINT,99,3\n": (None, "SPOINT"),
    GRIDS + "CBAR,1,7,1\n": (9, "field"),
    GRIDS + "CBAR,,7,1,2\n": (9, "field"),
    GRIDS + "CBAR,1,7,1,2\n\n+,1\nCBAR,1,7,3,4\n": (12, "element"),
    GRIDS + "=,*1,==\n=(X)\n": (10, "integer"),
    "1GRID,2\n": (1, "data"),
    "+,2\n": (1, "continuation"),
    "$\nINCLUDE 'no\n": (2, "beside"),
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_told_with_its_line(tmp_path, text):
    path = tmp_path / "part.bdf"
    path.write_text(text)
    with refused(*WRONG[text], MeshError):
        nastran.read(Sources(path, path.name))
