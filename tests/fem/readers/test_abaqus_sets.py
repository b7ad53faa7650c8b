"""Cards, sets, generated meshes and assemblies of Abaqus decks: every node and element by hand."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.base.errors import MeshError
from antiosc_decks import abaqus_assembly
from antiosc_decks.abaqus_assembly import FIRST_NON_CELL_ROW
from antiosc_decks.sources import Sources
from refusals import refused


@pytest.fixture
def read(tmp_path):
    def of(text: str, **others: str):
        for name, content in others.items():
            (tmp_path / f"{name}.inp").write_text(content)
        path = tmp_path / "part.inp"
        path.write_text(text)
        return abaqus_assembly.read_deck(Sources(path, path.name))

    return of


def lists(sets) -> dict[str, list[int]]:
    return {name: rows.tolist() for name, rows in sets.items()}


#: Nodes 1, 3, 5, … in two rows of five, and four quadrilaterals between them.
ROWS = "".join(f"{2 * k + 1},{k % 5},{k // 5}\n" for k in range(10))
QUADS = "".join(
    f"{10 * (k + 1)},{2 * k + 1},{2 * k + 3},{2 * k + 13},{2 * k + 11}\n" for k in range(4)
)
SHEET = f"*NODE\n{ROWS}*ELEMENT,TYPE=S4\n{QUADS}"

NODE_SETS = {
    "3,1,\n19\n": [0, 1, 9],
    "1,2,99\n": [0],
    "\n 5 \n": [2],
    ",GENERATE\n1,7\n": [0, 1, 2, 3],
    ",GENERATE\n3,19,4\n": [1, 3, 5, 7, 9],
    ",GENERATE\n1,3,1\n17,50,1\n": [0, 1, 8, 9],
    ",GENERATE\n5,5,0\n": [2],
    ",GENERATE\n2,2\n": [],
    ",ELSET=PAIR\n": [1, 2, 3, 6, 7, 8],
    ",ELSET=pair\n1\n": [0, 1, 2, 3, 6, 7, 8],
    ",ELSET=NONE\n": [],
    ",UNSORTED\nONE,5,ONE\n": [0, 2],
    "one,Two\n": [0, 8, 9],
}


@pytest.mark.parametrize("lines", NODE_SETS)
def test_sets_of_nodes(read, lines):
    """By numbers, ranges, other sets and the elements of a set; case does not count."""
    text = SHEET + "*ELSET,ELSET=PAIR\n20,30\n*NSET,NSET=One\n1\n*NSET,NSET=TWO\n17,19\n"
    option, _, rest = lines.partition("\n")
    line = lines if not option.startswith(",") or option[1:2].isdigit() else f"{option}\n{rest}"
    text += "*NSET,NSET=A" + (line if line.startswith(",") else f"\n{line}")
    deck = read(text).deck
    assert lists(deck.node_sets) == {"One": [0], "TWO": [8, 9], "A": NODE_SETS[lines]}
    assert lists(deck.element_sets) == {"PAIR": [1, 2]}


def test_sets_of_elements_and_of_those_that_are_no_cells(read):
    text = SHEET + "*ELEMENT,TYPE=SPRINGA,ELSET=K\n7,1,3\n8,3,5\n*ELEMENT,TYPE=MASS\n9,1\n"
    text += "*ELSET,ELSET=A\n10,7,9,99\n*ELSET,ELSET=A\n40,K\n*ELSET,ELSET=B,GENERATE\n15,40,10\n"
    whole = read(text + "*ELSET,ELSET=B,GENERATE\n10,40,10\n*NODE,NSET=N\n1,9,9,9\n21,1,1,1\n")
    assert lists(whole.deck.element_sets) == {"A": [0, 3], "B": [0, 1, 2, 3]}
    assert whole.deck.points[whole.deck.node_sets["N"]].tolist() == [[9, 9, 9], [1, 1, 1]]
    assert whole.deck.skipped == {"SPRINGA": 2, "MASS": 1}
    others = [(kind, row.fields) for kind, row, _ in whole.non_cells]
    assert others == [("SPRINGA", [*"713"]), ("SPRINGA", [*"835"]), ("MASS", [*"91"])]
    beside = {
        name: (rows[rows >= FIRST_NON_CELL_ROW] - FIRST_NON_CELL_ROW).tolist()
        for (_, name), rows in whole.sets.items()
    }
    assert (beside["K"], beside["A"]) == ([0, 1], [0, 1, 2])


PART = f"*PART,NAME=P\n{SHEET}*ELSET,ELSET=All,GENERATE\n10,40,10\n*NSET,NSET=end\n9,19\n"
PART += "*END PART\n"
TOP = """\
*ASSEMBLY,NAME=A
*INSTANCE,NAME=I-1,PART=p
*END INSTANCE
*INSTANCE,NAME=I-2,PART=P
0,0,5
0,0,5,0,0,6,90
*END INSTANCE
*NODE
1,7,7,7
*NSET,NSET=Ref
1
*NSET,NSET=tips
I-1.end,i-2.END
*NSET,NSET=some,INSTANCE=I-2
1,END
*NSET,NSET=range,INSTANCE=i-1,GENERATE
1,5,2
*ELSET,ELSET=some,INSTANCE=I-2
20
*ELSET,ELSET=both
I-1.10,I-2.all
*ELSET,ELSET=range,INSTANCE=I-2,GENERATE
20,40,10
*NSET,NSET=again
tips
*END ASSEMBLY
"""


def test_sets_of_an_assembly(read):
    """The node of the assembly has row 0, those of the instances follow."""
    whole = read(PART + TOP)
    deck = whole.deck
    assert deck.points[0].tolist() == [7, 7, 7]
    own = np.array([(k % 5, k // 5, 0.0) for k in range(10)])
    np.testing.assert_allclose(deck.points[1:11], own)
    # a quarter turn about z, after the shift along it
    turned = np.stack([-own[:, 1], own[:, 0], own[:, 2] + 5], axis=1)
    np.testing.assert_allclose(deck.points[11:], turned, atol=1e-12)
    assert [len(block) for block in deck.blocks] == [4, 4]
    assert (deck.blocks[1].corners - deck.blocks[0].corners == 10).all()
    assert lists(deck.node_sets) == {
        "Ref": [0], "tips": [5, 10, 15, 20], "some": [11, 15, 20], "range": [1, 2, 3],
        "again": [5, 10, 15, 20], "I-1.end": [5, 10], "I-2.end": [15, 20],
    }  # fmt: skip
    assert lists(deck.element_sets) == {
        "I-1.All": [0, 1, 2, 3], "I-1": [0, 1, 2, 3], "I-2.All": [4, 5, 6, 7], "I-2": [4, 5, 6, 7],
        "some": [5], "both": [0, 4, 5, 6, 7], "range": [5, 6, 7],
    }  # fmt: skip
    assert list(whole.instances) == ["", "I-1", "I-2"]
    second = whole.instances["I-2"]
    assert (second.first_node_row, second.first_element_row) == (11, 4)


def test_cards_in_files_and_over_lines(read):
    """Includes, INPUT=, a card that goes on after a comma, quotes, comments and empty fields."""
    text = '** a comment\n*Heading\nwords, of any kind\n*NODE, NSET = "A, B" ,\n  INPUT=nodes.inp\n'
    text += "\n*ELEMENT,\n**\nTYPE=S4,ELSET=E\n*INCLUDE,INPUT=more.inp\n*NSET,NSET=C,\n1,3\n"
    more = "10,1,3,13,\n11\n*ELEMENT,TYPE=S3\n** not this\n11,1,3,5\n"
    with pytest.raises(MeshError):
        read(text, nodes=ROWS, more=more)
    text = text.replace("*ELEMENT,\n**\nTYPE", "*ELEMENT, TYPE")
    deck = read(text.replace("NSET=C,\n", "NSET=C\n"), nodes=ROWS, more=more).deck
    assert lists(deck.node_sets) == {"A, B": list(range(10)), "C": [0, 1]}
    assert lists(deck.element_sets) == {"E": [0]}
    assert [block.type for block in deck.blocks] == ["S4", "S3"]
    assert deck.blocks[0].corners.tolist() == [[0, 1, 6, 5]]


def test_nodes_in_a_system_of_their_own(read):
    """x of the system is y of the deck, y is -x; 2, 90° is 2 along its y."""
    text = "*SYSTEM\n10,0,5,10,3,5\n4,7,5\n*NODE\n1,1,2,3\n*NODE,SYSTEM=C\n2,2,90,3\n"
    text += "*SYSTEM\n10,0,5,10,3,5\n*NODE\n3,1,2,3\n*SYSTEM\n1,1,1\n*NODE\n4,1,2,3\n"
    points = read(f"{text}*SYSTEM\n*NODE\n5,1,2,3\n*ELEMENT,TYPE=S3\n1,1,2,5\n").deck.points
    assert points == pytest.approx(
        np.array([[8, 1, 8], [8, 0, 8], [8, 1, 8], [2, 3, 4], [1, 2, 3]])
    )


ASSEMBLED = PART + TOP
WRONG = {
    "** words\n": (None, "contains"),
    SHEET + "*ELEMENT,TYPE=S3\n50,1,3,6\n51,1,3,8\n": (18, "such"),
    SHEET + "*ELEMENT,TYPE=S3\n50,1,3,5\n51,1\n": (19, "program"),
    SHEET + "*NSET,NSET=A,GENERATE\n1,9,0\n": (18, "selects"),
    "*NODE\n*INCLUDE,INPUT=" + 300 * "x" + "\n": (2, "beside"),
    "*NODE,SYSTEM=S\n1,2,3\n": (1, "rectangular"),
    "*SYSTEM\n1,2,3,1,2,3\n" + SHEET: (1, "no axes"),
    "*SYSTEM\n1,2,3,1,3,4\n" + SHEET: (1, "third point"),
    SHEET + "*NGEN\n1,19,4\n": (17, "write"),
    SHEET + f"*ELEMENT,TYPE=S3\n{2**63},1,3,5\n": (18, "large"),
    SHEET + f"*NSET,NSET=A\n1\n*NODE\n{2**63},1\n": (20, "large"),
    SHEET + "*NSET,NSET=A,GENERATE\n1\n": (18, "last"),
    ASSEMBLED.replace("PART=p", "PART=q"): (24, "part"),
    ASSEMBLED.replace("INSTANCE=I-2\n1", "INSTANCE=I-3\n1"): (36, "no instance"),
    ASSEMBLED.replace("0,0,5,0,0,6,90", "0,0,5,0,0,6"): (28, "angle"),
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_told_with_its_line(read, text):
    with refused(*WRONG[text], MeshError):
        read(text)
