"""Materials of decks in the decks' units, cross-sections, and directions and sizes of elements."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.io.deck import Array, Deck, IntArray, Place, Placed


@dataclass
class Material(Placed):
    """Linear elasticity and density in the deck's units."""

    name: str
    place: Place
    #: E1, E2, E3, nu12, nu13, nu23, G12, G13, G23; E3, nu13, nu23 may be nan (a lamina)
    constants: Array | None = None
    #: stresses (11, 22, 33, 23, 13, 12) of strains (6, 6), where `constants` do not say it all
    stiffness: Array | None = None
    #: stresses (11, 22, 12) of plane strains (3, 3), of a material of shells alone
    plane: Array | None = None
    density: float | None = None
    #: E and G of beams and rods, where they do not follow from `constants`
    of_lines: tuple[float, float] | None = None

    def set_isotropic(self, E: float, nu: float) -> None:
        """Give it the constants of an isotropic material."""
        self.needs(nu > -1, f"Poisson's ratio lies above -1; it is {nu:g}.")
        self.constants = isotropic(E, nu)

    def elasticity(self) -> Array:
        """The constants; MeshError without such."""
        constants = self.constants
        self.needs(
            constants is not None, f"the material {self.name!r} has no constants of elasticity."
        )
        return np.asarray(constants)

    @property
    def modulus(self) -> float:
        """The largest modulus."""
        stated = (self.constants, self.stiffness, self.plane)
        return max(float(np.nanmax(one)) for one in stated if one is not None)

    @property
    def isotropic(self) -> tuple[float, float] | None:
        """(E, nu) if the material is isotropic."""
        if self.constants is None:
            return None
        E1, E2, E3, n12, n13, n23, *G = self.constants
        alike = np.allclose([E2, E3], E1, rtol=1e-4) and np.allclose([n13, n23], n12, atol=1e-4)
        if alike and np.allclose(G, E1 / (2 * (1 + n12)), rtol=1e-4):
            return float(E1), float(n12)
        return None


def isotropic(E: float, nu: float) -> Array:
    """Constants of an isotropic material."""
    G = E / (2 * (1 + nu))
    return np.array([E, E, E, nu, nu, nu, G, G, G])


def of_stiffness(D: Array) -> Array:
    """Constants of an orthotropic stiffness matrix (6, 6); LinAlgError if it is singular."""
    S = np.linalg.inv(D)
    E = 1 / np.diag(S)[:3]
    return np.array([*E, -S[0, 1] * E[0], -S[0, 2] * E[0], -S[1, 2] * E[1], *(1 / np.diag(S)[3:])])


#: `np.tril_indices` or `np.triu_indices`
Triangle = Callable[[int], tuple[IntArray, IntArray]]


def symmetric(values: Sequence[float] | Array, triangle: Triangle = np.tril_indices) -> Array:
    """A symmetric matrix by the rows of its lower, or its upper triangle (`np.triu_indices`)."""
    size = int(math.sqrt(2 * len(values)))
    C = np.zeros((size, size))
    C[triangle(size)] = values
    return np.asarray(C + C.T - np.diag(np.diag(C)))


#: Timoshenko's shear coefficients, as in `antiosc.Section`.
RECTANGLE, CIRCLE, TUBE, THIN = 5 / 6, 0.9, 0.5, 0.5


@dataclass(frozen=True)
class Profile:
    """A cross-section in the deck's units; the height is along its first axis."""

    A: float
    #: about the axis across the height, and about the height
    I: float  # noqa: E741
    I_side: float
    J: float
    shear: float
    #: along the height and across it, for offsets in shares of them
    height: float = 0.0
    width: float = 0.0
    #: of an area that is symmetric about neither axis
    mixed: float = 0.0

    def section(self, length: float) -> dict[str, float]:
        """Arguments of an `antiosc.Section`; `length` is the deck's unit in m."""
        second = {name: getattr(self, name) * length**4 for name in ("I", "I_side", "J")}
        return {"A": self.A * length**2, **second, "shear": self.shear}

    def rotated(self) -> Profile:
        """The same cross-section rotated by 90°."""
        sides = self.width, self.height
        return Profile(self.A, self.I_side, self.I, self.J, self.shear, *sides, -self.mixed)


def rectangle(height: float, width: float) -> Profile:
    """A solid rectangle (Timoshenko & Goodier, *Theory of Elasticity*, §109)."""
    a, b = max(height, width), min(height, width)
    n = np.arange(1, 40, 2)
    series = float(np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5))
    torsion = a * b**3 / 3 * (1 - 192 / np.pi**5 * b / a * series)
    second = width * height**3 / 12, height * width**3 / 12
    return Profile(height * width, *second, torsion, RECTANGLE, height, width)


def ellipse(height: float, width: float) -> Profile:
    """A solid ellipse with these axes."""
    area = math.pi * height * width / 4
    torsion = math.pi * height**3 * width**3 / (16 * (height**2 + width**2))
    second = area * height**2 / 16, area * width**2 / 16
    return Profile(area, *second, torsion, CIRCLE, height, width)


def tube(radius: float, wall: float) -> Profile:
    """A round tube of this outer radius."""
    inner = max(radius - wall, 0.0)
    second = math.pi * (radius**4 - inner**4) / 4
    area = math.pi * (radius**2 - inner**2)
    return Profile(area, second, second, 2 * second, TUBE, 2 * radius, 2 * radius)


def box(height: float, width: float, right: float, top: float) -> Profile:
    """A rectangular tube by its walls across the height and along the width; torsion by Bredt."""
    h, w = height - 2 * right, width - 2 * top
    second = (width * height**3 - w * h**3) / 12, (height * width**3 - h * w**3) / 12
    torsion = box_torsion(height, width, top, top, right, right)
    return Profile(height * width - h * w, *second, torsion, THIN, height, width)


#: A rectangle: from and to along the height, from and to across it
Wall = tuple[float, float, float, float]


def walled(walls: Sequence[Wall], torsion: float | None = None) -> Profile:
    """Rectangles that touch; torsion of thin open walls, Σ l t³/3. ValueError: no width."""
    low, high, left, right = np.array(walls, dtype=float).T
    h, w = high - low, right - left
    if min(h.min(), w.min()) <= 0:
        raise ValueError("a wall without a width")
    A = h * w
    y, z = (low + high) / 2, (left + right) / 2
    y, z = y - A @ y / A.sum(), z - A @ z / A.sum()
    first, second = (float(np.sum(t)) for t in (w * h**3 / 12 + A * y**2, h * w**3 / 12 + A * z**2))
    torsion = torsion or float(np.sum(np.maximum(h, w) * np.minimum(h, w) ** 3) / 3)
    height, width = float(high.max() - low.min()), float(right.max() - left.min())
    mixed = float(A @ (y * z))
    return Profile(float(A.sum()), first, second, torsion, THIN, height, width, mixed)


def centroid(walls: Sequence[Wall]) -> Array:
    """Place (along the height, across it) of the centroid of rectangles."""
    low, high, left, right = np.array(walls, dtype=float).T
    A = (high - low) * (right - left)
    return np.array([A @ (low + high), A @ (left + right)]) / 2 / A.sum()


def box_torsion(
    width: float, height: float, top: float, bottom: float, left: float, right: float
) -> float:
    """Bredt's torsion constant of a rectangular tube with four walls."""
    w, h = width - (left + right) / 2, height - (top + bottom) / 2
    return 4 * (w * h) ** 2 / (w / top + w / bottom + h / left + h / right)


def hexagon(height: float, width: float, tip: float) -> Profile:
    """A hexagon: a rectangle between two triangles with these tips. ValueError: they fill it."""
    flat = width - 2 * tip
    if flat < 0:
        raise ValueError("the tips are wider than the hexagon")
    area = height * (flat + tip)
    upright = flat * height**3 / 12 + tip * height**3 / 24
    # ∫ z² over the rectangle, and over two triangles of which the base lies at flat/2
    away = flat / 2 + tip / 3
    across = height * flat**3 / 12 + 2 * (height * tip**3 / 36 + height * tip / 2 * away**2)
    polar = upright + across
    return Profile(area, upright, across, area**4 / (40 * polar), RECTANGLE, height, width)


#: "places" and "directions" there, both (n, 3).
Everywhere = dict[str, list[list[float]]]
#: Cosine from which a direction is that of an axis.
AXIS_COSINE = 1 - 1e-9
#: Corners of a cell as those of a hexahedron or a quadrilateral, some of them twice or more.
FULL = {"triangle": (0, 1, 2, 2), "tetra": (0, 1, 2, 2, 3, 3, 3, 3)}
FULL |= {"pyramid": (0, 1, 2, 3, 4, 4, 4, 4), "wedge": (0, 1, 2, 2, 3, 4, 5, 5)}


def corners_of(deck: Deck, elements: IntArray) -> list[Array]:
    """Coordinates (k, 3) of the corners of each element."""
    return [x for block, _ in deck.blocks_of(elements) for x in deck.points[block.corners]]


def unit(v: Array) -> Array:
    """Rows as vectors of length 1; zero stays zero."""
    length = np.linalg.norm(v, axis=1, keepdims=True)
    return np.asarray(v / np.where(length > 0, length, 1.0))


def turned(v: Array, axis: Array, degrees: float) -> Array:
    """Vectors across unit vectors, rotated about these."""
    angle = math.radians(degrees)
    return np.asarray(math.cos(angle) * v + math.sin(angle) * np.cross(axis, v))


def tangents_of(deck: Deck, elements: IntArray) -> Array:
    """Unit vectors (n, 3) along lines, from their first node to their last."""
    return unit(np.array([x[1] - x[0] for x in corners_of(deck, elements)]).reshape(-1, 3))


def normals_of(deck: Deck, elements: IntArray) -> Array:
    """Unit normals (n, 3) of triangles and quadrilaterals, by the order of their corners."""
    normals = np.zeros((len(elements), 3))
    for block, mine in deck.blocks_of(elements):
        x = deck.points[block.corners]
        normals[mine] = np.cross(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1])
    return unit(normals)


def measures_of(deck: Deck, elements: IntArray) -> Array:
    """Lengths, areas or volumes of elements with straight edges."""
    measures = np.zeros(len(elements))
    for block, mine in deck.blocks_of(elements):
        corners = FULL.get(block.shape, range(block.corners.shape[1]))
        measures[mine] = _measure(deck.points[block.corners[:, list(corners)]])
    return measures


def _measure(x: Array) -> Array:
    """Of lines, quadrilaterals or hexahedra x (n, corners, 3), by two Gauss points a direction."""
    dim = x.shape[1].bit_length() - 1
    total = np.zeros(len(x))
    signs = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]])
    signs = np.vstack([signs, signs * [1, 1, -1]])[: x.shape[1], :dim]
    for point in np.ndindex(*[2] * dim):
        values = (1 + signs * (2 * np.array(point) - 1) / np.sqrt(3)) / 2
        others = [np.prod(np.delete(values, k, axis=1), axis=1) for k in range(dim)]
        J = np.einsum("kc,nci->nki", np.array(others) * signs.T / 2, x)
        total += np.sqrt(np.linalg.det(J @ np.swapaxes(J, 1, 2)).clip(min=0.0))
    return total


def common_direction(vectors: Array, least: float = 0.3) -> Array | None:
    """The mean unit vector if every one has at least this cosine with it, else None."""
    mean = vectors.mean(axis=0)
    length = float(np.linalg.norm(mean))
    if length == 0 or (vectors @ (mean / length)).min() < least:
        return None
    return np.asarray(mean / length)


def curved(deck: Deck, elements: IntArray) -> bool:
    """Whether the normals of some shells differ."""
    return common_direction(normals_of(deck, elements), least=1 - 1e-6) is None


def everywhere(deck: Deck, elements: IntArray, vectors: Array, length: float) -> Everywhere:
    """One vector per element at its middle [m], and at those of a quadrilateral's triangles."""
    places, directions = [], []
    for x, vector in zip(corners_of(deck, elements), vectors.tolist(), strict=True):
        thirds = range(4) if len(x) == 4 else ()
        cut = [x.mean(axis=0), *(np.delete(x, k, axis=0).mean(axis=0) for k in thirds)]
        places += [(c * length).tolist() for c in cut]
        directions += [vector] * len(cut)
    return {"places": places, "directions": directions}


def top_of(deck: Deck, elements: IntArray, length: float) -> Everywhere | list[float]:
    """The side of the normals of shells: one direction, or one in each element."""
    normals = normals_of(deck, elements)
    top = common_direction(normals)
    return everywhere(deck, elements, normals, length) if top is None else top.tolist()


def fixed_along_axes(fixed: BoolArray, frame: Array) -> BoolArray | None:
    """The motions along x, y, z (3,) that are fixed with those along rows; None: askew to these."""
    if fixed.all() or not fixed.any():
        return fixed
    cosines = np.abs(frame)
    for some, value in ((fixed, True), (~fixed, False)):  # second: a plane between two axes
        if (cosines[some].max(axis=1) > AXIS_COSINE).all():
            result = np.full(3, not value)
            result[cosines[some].argmax(axis=1)] = value
            return result
    return None
