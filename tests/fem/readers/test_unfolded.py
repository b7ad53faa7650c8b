"""Sectors of cyclic symmetry, unfolded, against the whole ring written out and closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csr_matrix

import antiosc as ao
from antiosc.base.errors import MeshError
from refusals import refused

pytestmark = pytest.mark.filterwarnings("ignore::antiosc.errors.AntioscWarning")
E, NU, RHO = 210e9, 0.3, 7850.0
INNER, OUTER, HEIGHT = 0.02, 0.05, 0.004
SECTORS, ALONG, ACROSS = 5, 2, 2
#: Origin and axis of the ring, which lie along no coordinate axis.
CENTRE = np.array([0.1, -0.2, 0.3])
AXES = np.array([[2.0, 2.0, 1.0], [-2.0, 1.0, 2.0], [1.0, -2.0, 2.0]]) / 3  # radial, …, axial
STEEL = f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{E}, {NU}\n*DENSITY\n{RHO}\n"
SECTION = "*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL\n"


def grid(columns: int, inner: float, closed: bool) -> str:
    """Nodes and elements of `columns` columns around the axis; sets START, END, INNER."""
    step = 2 * np.pi / (SECTORS * ALONG)
    count = columns if closed else columns + 1
    label: dict[tuple[int, int, int], int] = {}
    text = "*NODE\n"
    for i in range(count):
        for j in range(ACROSS + 1):
            for k in range(2):
                if j == 0 and inner == 0 and i:
                    label[i, j, k] = label[0, j, k]
                    continue
                label[i, j, k] = len(set(label.values())) + 1
                radius = inner + (OUTER - inner) * j / ACROSS
                local = radius * np.cos(i * step), radius * np.sin(i * step), HEIGHT * k
                x = CENTRE + np.array(local) @ AXES
                text += f"{label[i, j, k]}, {x[0]:.15g}, {x[1]:.15g}, {x[2]:.15g}\n"
    solids: dict[str, list[list[int]]] = {"C3D8": [], "C3D6": []}
    for i in range(columns):
        for j in range(ACROSS):
            sides = [(i, j), (i, j + 1), ((i + 1) % count, j + 1), ((i + 1) % count, j)]
            corners = [[label[*side, k] for side in sides] for k in range(2)]
            if j == 0 and inner == 0:
                solids["C3D6"].append([n for face in corners for n in face[:3]])
            else:
                solids["C3D8"].append([n for face in corners for n in face])
    number = 0
    for kind, cells in solids.items():
        text += f"*ELEMENT, TYPE={kind}, ELSET=ALL\n" if cells else ""
        for cell in cells:
            number += 1
            text += f"{number}, {', '.join(map(str, cell))}\n"
    sets = {
        "START": {n for (i, _, _), n in label.items() if i == 0},
        "END": {n for (i, j, _), n in label.items() if i == count - 1 or (j == 0 and inner == 0)},
        "INNER": {n for (_, j, _), n in label.items() if j == 0},
    }
    for name, members in sets.items():
        text += f"*NSET, NSET={name}\n" + "".join(f"{n},\n" for n in sorted(members))
    return text + STEEL + SECTION


def cyclic(sectors: int = SECTORS, sides: str = "START, END") -> str:
    ends = np.stack([CENTRE, CENTRE + 0.7 * AXES[2]]).ravel()
    text = "".join(f"*SURFACE, NAME={name}, TYPE=NODE\n{name}\n" for name in ("START", "END"))
    text += f"*TIE, CYCLIC SYMMETRY, NAME=T, POSITION TOLERANCE=1.\n{sides}\n"
    return (
        f"{text}*CYCLIC SYMMETRY MODEL, N={sectors}, TIE=T\n{', '.join(map(repr, ends.tolist()))}\n"
    )


def part_of(folder: Path, name: str, text: str) -> ao.Structure:
    path = folder / f"{name}.inp"
    path.write_text(text)
    return ao.read_model(path, unit="m")


def frequencies(part: ao.Structure) -> np.ndarray:
    """All natural frequencies [Hz], ascending, of the motions that are not held."""
    K, M = (csr_matrix(A.getValuesCSR()[::-1]).toarray() for A in (part.K, part.M))
    free = np.setdiff1d(np.arange(len(K)), part.fixed)
    squares = eigh(K[np.ix_(free, free)], M[np.ix_(free, free)], eigvals_only=True)
    return np.sqrt(squares.clip(min=0.0)) / (2 * np.pi)


def radially(set_name: str) -> str:
    ends = np.stack([CENTRE, CENTRE + AXES[2]]).ravel()
    line = ", ".join(map(repr, ends.tolist()))
    return f"*TRANSFORM, NSET={set_name}, TYPE=C\n{line}\n*BOUNDARY\n{set_name}, 1\n"


@pytest.mark.parametrize("held", ["", "INNER"])
@pytest.mark.parametrize("inner", [INNER, 0.0])
def test_an_unfolded_sector_vibrates_as_the_whole_ring(tmp_path, inner, held):
    support = radially(held) if held and inner else ""
    sector = part_of(tmp_path, "sector", grid(ALONG, inner, False) + cyclic() + support)
    whole = part_of(tmp_path, "whole", grid(ALONG * SECTORS, inner, True) + support)
    n = SECTORS * ALONG
    area = n * np.sin(2 * np.pi / n) / 2 * (OUTER**2 - inner**2)  # of polygons
    assert sector.mass == pytest.approx(RHO * area * HEIGHT, rel=1e-9)
    found, exact = frequencies(sector), frequencies(whole)
    assert len(found) == len(exact)
    largest = exact.max()
    assert found == pytest.approx(exact, rel=1e-7, abs=1e-6 * largest)
    assert sector.rigid_modes.shape[1] == whole.rigid_modes.shape[1]


def test_the_sides_may_be_given_in_either_order(tmp_path):
    text = grid(ALONG, INNER, False)
    first, second = (
        part_of(tmp_path, name, text + cyclic(sides=sides))
        for name, sides in (("ab", "START, END"), ("ba", "END, START"))
    )
    assert frequencies(first)[6:] == pytest.approx(frequencies(second)[6:], rel=1e-7)


def test_sets_and_supports_of_a_sector_are_those_of_all(tmp_path):
    text = grid(ALONG, INNER, False) + cyclic() + "*BOUNDARY\nINNER, 1, 3\n"
    part = part_of(tmp_path, "held", text)
    x = part.form.space.tabulate_dof_coordinates() - CENTRE
    radius = np.linalg.norm(x - np.outer(x @ AXES[2], AXES[2]), axis=1)
    inside = np.flatnonzero(radius < 1.0001 * INNER)
    assert sorted(part.fixed) == sorted((3 * inside[:, None] + np.arange(3)).ravel())
    assert len(part.mesh.groups["ALL"][3]) == ALONG * ACROSS * SECTORS


@pytest.mark.parametrize(
    ("more", "word"),
    [
        (cyclic(sectors=7), "do not match"),
        (cyclic(sectors=1), "number of sectors"),
        (cyclic().split("*CYCLIC")[0], "the whole ring"),
        (cyclic() + "*EQUATION\n2\n1, 1, 1., 2, 1, -1.\n", "*EQUATION"),
        (cyclic() + "*ELEMENT, TYPE=MASS, ELSET=M\n900, 1\n*MASS, ELSET=M\n1.\n", "MASS"),
    ],
)
def test_what_cannot_be_unfolded_is_refused(tmp_path, more, word):
    with refused(None, word, MeshError):
        part_of(tmp_path, "odd", grid(ALONG, INNER, False) + more)
