"""Masses, springs, couplings and supports of Abaqus decks against what their cards say.

A frame of beams in space, in mm, N and t: nodes have all six motions.
"""

from __future__ import annotations

import numpy as np
import pytest

import abaqus_decks as inp
from antiosc.base.errors import MeshError
from motions import matrix, node_at, row_of, stiffness

RNG = np.random.default_rng(29)
X = np.round(RNG.uniform(-1, 1, (6, 3)), 3)
COUNT = len(X)
#: What a motion of a node is in SI units, from mm and radians.
SIZE = np.array([1e-3, 1e-3, 1e-3, 1, 1, 1])


def frame_of_beams() -> str:
    text = "*NODE,NSET=N\n"
    text += "".join(f"{k},{','.join(map(str, x))}\n" for k, x in enumerate(X, 1))
    text += "*ELEMENT,TYPE=B31,ELSET=ALL\n"
    text += "".join(f"{k},{k},{k + 1}\n" for k in range(1, COUNT))
    text += "*MATERIAL,NAME=M\n*ELASTIC\n2E5,.3\n*DENSITY\n8.E-9\n"
    return text + "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=RECT\n.02,.03\n.1,.2,.9\n"


@pytest.fixture
def read(tmp_path):
    def model(cards: str):
        return inp.read(tmp_path, frame_of_beams() + cards)

    return model


def energy_of(K: np.ndarray, u: np.ndarray) -> float:
    """u' K u for motions in mm and radians, N mm."""
    q = (u * SIZE).ravel()
    return 1e3 * float(q @ K @ q)


SPRINGS = {
    "SPRING1": ("SPRING1", "7,2\n", "3\n40.\n", lambda u: 40 * u[1, 2] ** 2),
    "SPRING1, rotation": ("SPRING1", "7,2\n", "5\n40.\n", lambda u: 40 * u[1, 4] ** 2),
    "SPRING2": ("SPRING2", "7,2,5\n", "3,1\n40.\n", lambda u: 40 * (u[1, 2] - u[4, 0]) ** 2),
    "SPRINGA": ("SPRINGA", "7,2,5\n", "\n40.\n", lambda u: 40 * longer(u, 1, 4) ** 2),
}


def longer(u: np.ndarray, a: int, b: int) -> float:
    along = X[b] - X[a]
    return float((u[b, :3] - u[a, :3]) @ along / np.linalg.norm(along))


@pytest.mark.parametrize("case", SPRINGS)
@pytest.mark.parametrize("card", ["SPRING", "DASHPOT"])
def test_springs_have_the_energy_and_dashpots_the_power_of_their_motions(read, case, card):
    kind, ends, lines, energy = SPRINGS[case]
    kind = kind.replace("SPRING", card)
    model, _ = read(f"*ELEMENT,TYPE={kind},ELSET=S\n{ends}*{card},ELSET=S\n{lines}")
    u = RNG.normal(size=(COUNT, 6))
    K, C = stiffness(model, 1e-3 * X), matrix(model["joints"]["dampers"], COUNT)
    own, other = (K, C) if card == "SPRING" else (C, K)
    assert energy_of(own, u) == pytest.approx(energy(u), rel=1e-9)
    assert not other.any()


def test_masses_and_moments_of_inertia(read):
    cards = "*ELEMENT,TYPE=MASS,ELSET=P\n8,2\n9,3\n*MASS,ELSET=P\n2.E-3\n"
    cards += "*ELEMENT,TYPE=ROTARYI,ELSET=R\n10,4\n*ROTARY INERTIA,ELSET=R\n1.,2.,3.\n"
    model, _ = read(cards)
    found = {node_at(1e-3 * X, point): (mass, inertia) for point, mass, inertia in model["masses"]}
    assert sorted(found) == [1, 2, 3]
    for node in (1, 2):
        assert found[node][0] == pytest.approx(2.0)  # kg
        assert not any(found[node][1])
    assert found[3][0] == 0
    assert found[3][1] == pytest.approx([1e-3, 2e-3, 3e-3])  # t mm² in kg m²


def fixed_by_name(deck) -> dict[str, list[int]]:
    return {key.removeprefix("fixed "): rows.tolist() for key, rows in deck.fixed.items()}


NAMES = {
    "ENCASTRE": "xyzXYZ", "PINNED": "xyz", "XSYMM": "xYZ", "YSYMM": "yXZ", "ZSYMM": "zXY",
    "XASYMM": "yzX", "YASYMM": "xzY", "ZASYMM": "xyZ",
    "2": "y", "2,4": "yzX", "5,6": "YZ",
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_supports_fix_what_their_names_and_numbers_say(read, name):
    _, deck = read(f"*BOUNDARY\n3,{name}\n")
    fixed = fixed_by_name(deck)
    expected = {key: [2] for key in (m if m in "xyz" else f"r{m.lower()}" for m in NAMES[name])}
    assert fixed == expected


def test_supports_in_axes_of_their_own(read):
    """*TRANSFORM by a point on x and one near y."""
    a, b = np.round(RNG.uniform(-1, 1, (2, 3)), 3)
    x, z = a, np.cross(a, b)
    z = z / np.linalg.norm(z)
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    axes = np.stack([x, np.cross(z, x), z])
    values = ",".join(map(str, (*a, *b)))
    cards = f"*NSET,NSET=T\n3\n*TRANSFORM,NSET=T,TYPE=R\n{values}\n"
    model, deck = read(cards + "*BOUNDARY\n3,2\n3,6\n")
    assert not deck.fixed
    rows = np.array([row_of(terms, COUNT).ravel() for terms in model["joints"]["equations"]])
    expected = np.zeros((2, COUNT, 6))
    expected[0, 2, :3], expected[1, 2, 3:] = axes[1], axes[2]
    assert np.linalg.matrix_rank(rows) == len(rows) == 2
    for row, one in zip(rows, expected.reshape(2, -1), strict=True):
        np.testing.assert_allclose(np.abs(row @ one), np.linalg.norm(row), rtol=1e-9)


WRONG = {
    "*ELEMENT,TYPE=SPRING1,ELSET=S\n7,2\n*SPRING,ELSET=S\n7\n4.\n": (3, "motions from 1 to 6"),
    "*ELEMENT,TYPE=SPRINGA,ELSET=S\n7,2,2\n*SPRING,ELSET=S\n\n4.\n": (2, "coincide"),
    "*ELEMENT,TYPE=SPRING1,ELSET=S\n7,2\n*SPRING,ELSET=S\n": (2, "without a value"),
    "*ELEMENT,TYPE=ROTARYI,ELSET=P\n8,2\n*ROTARYINERTIA,ELSET=P\n1,2,3,4\n": (2, "products"),
    "*NSET,NSET=T\n3\n*TRANSFORM,NSET=T\n1,0,0,2,0,0\n": (2, "gives no axes"),
    "*ELEMENT,TYPE=SPRINGA,ELSET=S\n7,2,3\n*SPRING,ELSET=S\n\n1.\n2.\n": (2, "it has 2"),
    "*ELEMENT,TYPE=DASHPOTA,ELSET=S\n7,2,3\n*DASHPOT,ELSET=S\n\n-4.\n": (4, "coefficient, -4"),
    "*ELEMENT,TYPE=DCOUP3D,ELSET=D\n7,6\n*DISTRIBUTING COUPLING,ELSET=D\n": (2, "no nodes with w"),
}


@pytest.mark.parametrize("cards", WRONG)
def test_what_is_wrong_is_told_with_its_line(read, cards):
    beyond, message = WRONG[cards]
    line = frame_of_beams().count("\n") + 1 + beyond
    with pytest.raises(MeshError, match=f"line {line} of .*{message}"):
        read(cards)


TWO_CUBES = "*NODE\n"
for first, at in ((1, 0), (11, 30)):
    for k, (x, y, z) in enumerate(np.ndindex(2, 2, 2)):
        TWO_CUBES += f"{first + k},{at + 10 * x},{10 * y},{10 * z}\n"
TWO_CUBES += "*ELEMENT,TYPE=C3D8,ELSET=ALL\n1,1,5,7,3,2,6,8,4\n2,11,15,17,13,12,16,18,14\n"
