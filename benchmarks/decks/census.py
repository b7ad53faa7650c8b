"""What a deck of Abaqus or CalculiX holds, by a parser that shares nothing with antiosc's.

It counts elements, says whether the deck is of the class that antiosc models (linear elastic
solids, shells and beams), and measures the mass: by Gauss points of its own in every element.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise, product
from pathlib import Path

import numpy as np

#: Elements of the families that antiosc models.
MODELLED = re.compile(
    r"C3D(4|6|8|10|15|20|27)[A-Z]*$|(S|STRI)(65|[34689])(R5|R)?$|CP[SE][3468][A-Z]*$"
    r"|B[23][123][A-Z]*$"
)
#: Elements without a body of their own, which go with those: masses, springs, couplings.
BESIDE = re.compile(r"(MASS|SPRING[A12]|DCOUP3D)$")
#: Cards that join nodes or surfaces linearly.
JOINTS = {"EQUATION", "MPC", "TIE", "RIGIDBODY", "COUPLING", "DISTRIBUTINGCOUPLING"}
#: Cards whose model is not that of a linear elastic body.
OTHERWISE = {
    "CONTACT": "contact",
    "CONTACTPAIR": "contact",
    "CYCLICSYMMETRYMODEL": "a sector of a whole",
    "SUBMODEL": "a submodel",
    "PRE-TENSIONSECTION": "a pre-tensioned bolt",
    "GAP": "a gap",
    "MODELCHANGE": "elements that vanish",
    "CHANGESOLIDSECTION": "sections that change",
    "DASHPOT": "a dashpot",
    "FLUIDSECTION": "a fluid",
    "FLUIDSECTIONS": "a fluid",
    "CFD": "a fluid",
    "MAGNETICPERMEABILITY": "a magnetic field",
}
#: A point of a beam's section; Gauss points of degree 7 along each direction.
GAUSS = np.polynomial.legendre.leggauss(4)


@dataclass
class Census:
    """A deck's elements, cards and materials, as written."""

    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    #: (number, type, its nodes)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    sets: dict[str, set[int]] = field(default_factory=dict)
    #: name -> {keyword: first numbers}
    materials: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    #: (keyword, options, data lines)
    cards: list[tuple[str, dict[str, str], list[str]]] = field(default_factory=list)

    @property
    def types(self) -> Counter[str]:
        """Elements of each type."""
        return Counter(kind for kind, _ in self.elements.values())

    @property
    def keywords(self) -> set[str]:
        """Names of the cards."""
        return {keyword for keyword, _, _ in self.cards}

    def outside(self) -> str:
        """Why the deck is not one of linear elastic solids, shells and beams; "" if it is one."""
        if not self.elements:
            return "no elements"
        for kind in self.types:
            if not MODELLED.match(kind) and not BESIDE.match(kind):
                return f"{kind} elements"
        if not any(MODELLED.match(kind) for kind in self.types):
            return "no body"
        if not any("SECTION" in keyword for keyword in self.keywords):
            return "a mesh alone"
        for keyword in sorted(self.keywords & OTHERWISE.keys()):
            return OTHERWISE[keyword]
        sections = [(o, lines) for keyword, o, lines in self.cards if "SECTION" in keyword]
        given = [o["MATERIAL"] for o, _ in sections if "MATERIAL" in o]
        layers = [line.split(",") for o, lines in sections if "COMPOSITE" in o for line in lines]
        given += [layer[2].strip() for layer in layers if len(layer) > 2]
        for name in given:
            moduli = self.materials.get(name.upper(), {}).get("ELASTIC")
            if moduli is None:
                return "no linear elasticity"
            if not moduli[0]:
                return "moduli that are zero"
        return "" if self.joined() or self.bodies() == 1 else "bodies that nothing joins"

    def bodies(self) -> int:
        """Pieces that share no node."""
        parent = {number: number for number in self.nodes}

        def root(node: int) -> int:
            while parent[node] != node:
                parent[node] = parent[parent[node]]
                node = parent[node]
            return node

        for _, (first, *more) in self.elements.values():
            for node in more:
                parent[root(node)] = root(first)
        return len({root(nodes[0]) for _, nodes in self.elements.values()})

    def joined(self) -> bool:
        """Whether equations, ties or rigid bodies join parts of it."""
        return bool(self.keywords & JOINTS)

    def mass(self, density: float | None) -> float | None:
        """Mass of solids, plane parts, shells, beams, points; None where sections overlap."""
        total, done = 0.0, set()
        if "NODALTHICKNESS" in self.keywords:
            return None
        for keyword, options, lines in self.cards:
            if keyword == "MASS":
                total += _numbers(lines[0])[0] * len(self.sets[options["ELSET"].upper()])
            if "SECTION" not in keyword or "ELSET" not in options:
                continue
            given = self.materials.get(options.get("MATERIAL", "").upper(), {})
            rho = (given.get("DENSITY") or [density or 0.0])[0] or density or 0.0
            elements = self.sets.get(options["ELSET"].upper(), set())
            if elements & done or "COMPOSITE" in options:
                return None
            done |= elements
            across = _across(keyword, options, lines)
            if across is None:
                return None
            for number in elements:
                kind, nodes = self.elements[number]
                if not MODELLED.match(kind):
                    continue
                solid = kind.startswith("C3D")
                x = np.array([self.nodes[n] for n in nodes])
                total += rho * measure(kind, x) * (1.0 if solid else across)
        return total


def take(path: Path) -> Census:
    """The census of a deck; INCLUDEs are followed, parts and generated elements are not."""
    census = Census()
    for keyword, options, lines in _cards(path):
        census.cards.append((keyword, options, lines))
        rows = [_numbers(line) for line in lines]
        match keyword:
            case "NODE":
                for row in rows:
                    if row:
                        census.nodes[int(row[0])] = tuple(((*row[1:], 0.0, 0.0, 0.0))[:3])
            case "ELEMENT":
                _elements(census, options, rows)
            case "ELSET":
                own = census.sets.setdefault(options["ELSET"].upper(), set())
                for line, row in zip(lines, rows, strict=True):
                    if "GENERATE" in options:
                        first, last, *step = (int(v) for v in row)
                        own |= set(range(first, last + 1, *step[:1])) & census.elements.keys()
                        continue
                    for word in line.upper().split(","):
                        word = word.strip()
                        own |= {int(word)} if word.isdigit() else census.sets.get(word, set())
            case "MATERIAL":
                material = census.materials.setdefault(options["NAME"].upper(), {})
            case "ELASTIC" | "DENSITY" if census.materials:
                material[keyword] = rows[0] if rows else []
    return census


def _cards(path: Path) -> list[tuple[str, dict[str, str], list[str]]]:
    found: list[tuple[str, dict[str, str], list[str]]] = []
    lines = path.read_text("latin-1").splitlines()
    while lines:
        line = lines.pop(0).strip()
        if not line or line.startswith("**"):
            continue
        if not line.startswith("*"):
            if found:
                found[-1][2].append(line)
            continue
        while line.endswith(",") and lines:
            line += lines.pop(0).strip()
        keyword, *rest = line[1:].split(",")
        pairs = [part.partition("=")[::2] for part in rest]
        options = {"".join(n.split()).upper(): v.strip().strip('"') for n, v in pairs}
        keyword = "".join(keyword.split()).upper()
        if keyword == "INCLUDE":
            lines = (path.parent / options["INPUT"]).read_text("latin-1").splitlines() + lines
            continue
        found.append((keyword, options, []))
    return found


def _numbers(line: str) -> list[float]:
    values = []
    for word in line.split(","):
        try:
            values.append(float(word))
        except ValueError:
            continue
    return values


def _elements(census: Census, options: dict[str, str], rows: list[list[float]]) -> None:
    """An element begins on a line of its own, and may list more nodes than its type has."""
    kind = options.get("TYPE", "").upper().replace(" ", "")
    count = nodes_of(kind)
    own = census.sets.setdefault(options.get("ELSET", "").upper(), set())
    numbers: list[int] = []
    for row in rows:
        numbers += [int(v) for v in row]
        if len(numbers) > count:
            census.elements[numbers[0]] = (kind, numbers[1 : count + 1])
            own.add(numbers[0])
            numbers = []


def nodes_of(kind: str) -> int:
    """Nodes of an element type."""
    if kind.startswith(("C3D", "F3D", "DC3D", "S", "CP", "CAX", "DCAX", "M3D")) and not (
        kind.startswith("SPRING")
    ):
        digits = int(re.findall(r"\d+", kind.replace("3D", ""))[0])
        return 6 if digits == 65 else digits
    if kind.startswith(("B", "T")):
        return 3 if (kind[2:3] == "2" and kind[0] == "B") or kind.endswith("D3") else 2
    return {"D": 3, "MASS": 1, "SPRING1": 1, "DCOUP3D": 1}.get(kind, 2)


def _across(keyword: str, options: dict[str, str], lines: list[str]) -> float | None:
    """Thickness or area that a section gives; None where it is not read here."""
    d = _numbers(lines[0]) if lines else []
    if keyword == "SOLIDSECTION":
        return (d or [1.0])[0] or 1.0
    if keyword == "SHELLSECTION":
        return d[0] if d else None
    kind = options.get("SECTION", "RECT").upper()
    if kind == "RECT":
        return d[0] * (d[1] if len(d) > 1 else d[0])
    if kind == "CIRC" and len(d) > 1:
        return np.pi * d[0] * d[1] / 4
    if kind == "PIPE":
        return np.pi * (d[0] ** 2 - (d[0] - d[1]) ** 2)
    if kind == "BOX":
        return d[0] * d[1] - (d[0] - d[2] - d[4]) * (d[1] - d[3] - d[5])
    return None


# --- Measures -------------------------------------------------------------------------------------


def measure(kind: str, x: np.ndarray) -> float:
    """Length, area or volume of an element with nodes x (n, 3), mapped as the program maps it."""
    if kind.startswith("B"):
        return float(sum(np.linalg.norm(b - a) for a, b in pairwise(x)))
    dim = 3 if kind.startswith("C3D") else 2
    total = 0.0
    for weight, gradients in _points(dim, len(x)):
        J = gradients.T @ x
        total += weight * (np.linalg.det(J) if dim == 3 else np.linalg.norm(np.cross(*J)))
    return abs(float(total))


_TABLES: dict[tuple[int, int], list[tuple[float, np.ndarray]]] = {}
_BRICK = np.array(list(product((0, 1), repeat=3)))[[0, 4, 6, 2, 1, 5, 7, 3]] * 2.0 - 1
_BOTTOM = [(0, 1), (1, 2), (2, 3), (3, 0)]
_EDGES = [*_BOTTOM, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]


def _points(dim: int, n: int) -> list[tuple[float, np.ndarray]]:
    """(weight, gradients (n, dim) of the shape functions) at Gauss points; simplices collapsed."""
    if (dim, n) not in _TABLES:
        table = []
        for index in product(range(4), repeat=dim):
            r = GAUSS[0][list(index)]
            weight = float(np.prod(GAUSS[1][list(index)]))
            place, jacobian = _place(dim, n, r)
            step = 1e-20j
            columns = [
                np.imag(_shapes(dim, n, place + step * np.eye(dim)[k])) / 1e-20 for k in range(dim)
            ]
            table.append((weight * jacobian, np.stack(columns, axis=1)))
        _TABLES[dim, n] = table
    return _TABLES[dim, n]


def _place(dim: int, n: int, r: np.ndarray) -> tuple[np.ndarray, float]:
    """Reference point of a Gauss point of the cube [-1, 1]^dim, and the factor of its weight."""
    if (dim, n) in ((3, 8), (3, 20), (3, 27), (2, 4), (2, 8), (2, 9)):
        return r, 1.0
    a, b = (r[:2] + 1) / 2
    if dim == 2:
        return np.array([a, b * (1 - a)]), (1 - a) / 4
    if n in (6, 15):
        return np.array([a, b * (1 - a), r[2]]), (1 - a) / 4
    c = (r[2] + 1) / 2
    return np.array([a, b * (1 - a), c * (1 - a) * (1 - b)]), (1 - a) ** 2 * (1 - b) / 8


def _shapes(dim: int, n: int, r: np.ndarray) -> np.ndarray:
    """Shape functions of the element with n nodes in Abaqus' order (complex r: gradients)."""
    if (dim, n) in ((3, 8), (3, 20), (2, 4), (2, 8)):
        corners = _BRICK if dim == 3 else _BRICK[:4, :2]
        edges = _EDGES if dim == 3 else _BOTTOM
        values = np.prod(1 + corners * r, axis=1) / 2**dim
        if n in (4, 8) and n == len(corners):
            return values
        middles = np.array([(corners[a] + corners[b]) / 2 for a, b in edges])
        along = np.where(middles == 0, 1 - r**2, 1 + middles * r)
        between = np.prod(along, axis=1) / 2 ** (dim - 1)
        for k, (a, b) in enumerate(edges):
            values[a] = values[a] - between[k] / 2
            values[b] = values[b] - between[k] / 2
        return np.concatenate([values, between])
    if n in (9, 27):
        return _lagrange(dim, r)
    if dim == 3 and n in (6, 15):
        return _wedge(n, r)
    L = np.array([1 - sum(r), *r])
    if n == dim + 1:
        return L
    pairs = [(0, 1), (1, 2), (2, 0), *([(0, 3), (1, 3), (2, 3)] if dim == 3 else [])]
    return np.array([*(L * (2 * L - 1)), *(4 * L[a] * L[b] for a, b in pairs)])


def _lagrange(dim: int, r: np.ndarray) -> np.ndarray:
    corners = _BRICK if dim == 3 else _BRICK[:4, :2]
    edges = _EDGES if dim == 3 else _BOTTOM
    middles = [(corners[a] + corners[b]) / 2 for a, b in edges]
    inner = [np.zeros(dim)]
    if dim == 3:  # the centre, bottom, top, then the four sides
        sides = [(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)]
        inner += [np.array(side, dtype=float) for side in sides]
    nodes = np.array([*corners, *middles, *inner])
    one = np.where(nodes == 0, 1 - r**2, r * (r + nodes) / 2)
    return np.prod(one, axis=1)


def _wedge(n: int, r: np.ndarray) -> np.ndarray:
    L, z = np.array([1 - r[0] - r[1], r[0], r[1]]), r[2]
    ends = [L * (1 - z) / 2, L * (1 + z) / 2]
    if n == 6:
        return np.concatenate(ends)
    pairs = [(0, 1), (1, 2), (2, 0)]
    flat = np.array([2 * L[a] * L[b] for a, b in pairs])
    upright = L * (1 - z**2)
    corners = [L * (2 * L - 1) * (1 + s * z) / 2 - upright / 2 for s in (-1, 1)]
    return np.concatenate([*corners, flat * (1 - z), flat * (1 + z), upright])
