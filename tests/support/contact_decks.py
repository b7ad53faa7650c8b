"""Decks of a block that is cut in two bodies, each with a mesh of its own, with a contact pair."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np

#: Sides of the block [mm]; it is cut at half its height.
SIDES = np.array([100.0, 20.0, 20.0])
STEEL = ["*MATERIAL, NAME=M", "*ELASTIC", "210e3, 0.3", "*DENSITY", "7.85e-9"]
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


def body(low, high, n, first: int, name: str, numbers: dict | None = None) -> list[str]:
    """Hexahedra between two corners, with the surfaces NAME_LOW and NAME_HIGH across z.

    `numbers`: place -> number of nodes that exist; None: it shares none.
    """
    axes = [np.linspace(a, b, count + 1) for a, b, count in zip(low, high, n, strict=True)]
    node: dict[tuple[int, ...], int] = {}
    lines = ["*NODE"]
    for k, index in enumerate(product(*(range(count + 1) for count in n))):
        x = tuple(round(float(axis[i]), 9) for axis, i in zip(axes, index, strict=True))
        known = numbers.get(x) if numbers else None
        node[index] = known or first + k
        lines += [f"{first + k}, {', '.join(map(repr, x))}"] * (known is None)
    lines.append(f"*ELEMENT, TYPE=C3D8, ELSET={name}")
    sides: dict[str, list[int]] = {"LOW": [], "HIGH": []}
    for k, index in enumerate(product(*map(range, n))):
        around = (node[tuple(int(v) for v in np.add(index, corner))] for corner in CORNERS)
        lines.append(f"{first + k}, {', '.join(map(str, around))}")
        sides["LOW"] += [first + k] * (index[2] == 0)
        sides["HIGH"] += [first + k] * (index[2] == n[2] - 1)
    for side, label in (("LOW", "S1"), ("HIGH", "S2")):
        lines += [f"*SURFACE, NAME={name}_{side}", *(f"{e}, {label}" for e in sides[side])]
    return [*lines, f"*SOLID SECTION, ELSET={name}, MATERIAL=M"]


def whole_block(path: Path, n) -> Path:
    """The block in one mesh."""
    path.write_text("\n".join([*body((0, 0, 0), SIDES, n, 1, "ALL"), *STEEL, ""]))
    return path


def cut_block(path: Path, n, m, *, gap: float = 0.0, shared: bool = False) -> Path:
    """The block in two bodies of n and m elements with a gap [mm] between them.

    `shared`: whether they have the four nodes at the corners of the cut in common.
    """
    middle = SIDES * (1, 1, 0.5)
    corners = product((0.0, SIDES[0]), (0.0, SIDES[1]))
    ends = {(*xy, float(middle[2])): (n[2] + 1) * (j + 1) for j, xy in enumerate(corners)}
    lower = body((0, 0, 0), middle, n, 1, "LOWER")
    for line in lower[1 : lower.index("*ELEMENT, TYPE=C3D8, ELSET=LOWER")]:
        number, *x = line.split(",")
        place = tuple(float(v) for v in x)
        ends |= {place: int(number)} if place in ends else {}
    up = (0, 0, gap)
    upper = body(middle * (0, 0, 1) + up, SIDES + up, m, 10001, "UPPER", ends if shared else None)
    contact = ["*SURFACE INTERACTION, NAME=I", "*CONTACT PAIR, INTERACTION=I"]
    path.write_text("\n".join([*lower, *upper, *STEEL, *contact, "UPPER_LOW, LOWER_HIGH", ""]))
    return path
