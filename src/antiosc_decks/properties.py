"""Materials of decks in the decks' units, cross-sections, and directions and sizes of elements."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.io.conversion import Array, Deck, IntArray
from antiosc_decks.entries import DeckItem, DeckPlace


@dataclass
class Material(DeckItem):
    """Linear elasticity and density in the deck's units."""

    name: str
    place: DeckPlace
    #: E1, E2, E3, nu12, nu13, nu23, G12, G13, G23; E3, nu13, nu23 may be nan (a lamina)
    constants: Array | None = None
    #: stiffness (6, 6) in the order 11, 22, 33, 23, 13, 12, if `constants` do not suffice
    stiffness: Array | None = None
    #: plane-stress stiffness (3, 3) in the order 11, 22, 12, of a material for shells alone
    plane_stiffness: Array | None = None
    density: float | None = None
    #: E and G for beams and rods, if they differ from `constants`
    line_moduli: tuple[float, float] | None = None

    def set_isotropic(self, E: float, nu: float) -> None:
        """Set the constants of an isotropic material."""
        self.needs(nu > -1, f"Poisson's ratio lies above -1; it is {nu:g}.")
        self.constants = isotropic(E, nu)

    def elasticity(self) -> Array:
        """The nine constants; MeshError if there are none."""
        fault = f"the material {self.name!r} has no constants of elasticity"
        self.needs(self.constants is not None, f"{fault}: add them, or give modulus in Pa.")
        return np.asarray(self.constants)

    @property
    def modulus(self) -> float:
        """The largest modulus or stiffness."""
        stiffnesses = (self.constants, self.stiffness, self.plane_stiffness)
        return max(float(np.nanmax(numbers)) for numbers in stiffnesses if numbers is not None)

    @property
    def isotropic(self) -> tuple[float, float] | None:
        """(E, nu) if the material is isotropic, else None."""
        if self.constants is None:
            return None
        E1, E2, E3, n12, n13, n23, *G = self.constants
        equal = np.allclose([E2, E3], E1, rtol=1e-4) and np.allclose([n13, n23], n12, atol=1e-4)
        if equal and np.allclose(G, E1 / (2 * (1 + n12)), rtol=1e-4):
            return float(E1), float(n12)
        return None


def isotropic(E: float, nu: float) -> Array:
    """The nine constants of an isotropic material."""
    G = E / (2 * (1 + nu))
    return np.array([E, E, E, nu, nu, nu, G, G, G])


def constants_of_stiffness(D: Array) -> Array:
    """The nine constants of an orthotropic stiffness matrix (6, 6); LinAlgError if singular."""
    S = np.linalg.inv(D)
    E = 1 / np.diag(S)[:3]
    return np.array([*E, -S[0, 1] * E[0], -S[0, 2] * E[0], -S[1, 2] * E[1], *(1 / np.diag(S)[3:])])


#: `np.tril_indices` or `np.triu_indices`
Triangle = Callable[[int], tuple[IntArray, IntArray]]


def symmetric(values: Sequence[float] | Array, triangle: Triangle = np.tril_indices) -> Array:
    """A symmetric matrix from the rows of its lower (or upper) triangle."""
    size = int(math.sqrt(2 * len(values)))
    C = np.zeros((size, size))
    C[triangle(size)] = values
    return C + C.T - np.diag(np.diag(C))


#: Timoshenko's shear coefficients, as in `antiosc.Section`.
RECTANGLE_SHEAR = 5 / 6
CIRCLE_SHEAR = 0.9
TUBE_SHEAR = 0.5
THIN_WALL_SHEAR = 0.5


@dataclass(frozen=True)
class Profile:
    """A cross-section in the deck's units; the height is along its first axis."""

    A: float
    #: second moments for bending along the height, and across it
    I: float  # noqa: E741
    I_side: float
    J: float
    #: shear coefficient along the height
    shear_coefficient: float
    #: outer dimensions along the height and across it, of which offsets are shares
    height: float = 0.0
    width: float = 0.0
    #: product of inertia, of a section that is symmetric about neither axis
    product_moment: float = 0.0
    #: shear coefficient across the height; None: as along it
    side_shear_coefficient: float | None = None

    @property
    def shear_coefficients(self) -> tuple[float, float]:
        """The shear coefficients along the height and across it."""
        along, across = self.shear_coefficient, self.side_shear_coefficient
        return along, along if across is None else across

    def sheared(self, along: float, across: float) -> Profile:
        """This cross-section with other shear coefficients along the height and across it."""
        side = None if math.isclose(across, along) else across
        return replace(self, shear_coefficient=along, side_shear_coefficient=side)

    def section(self, length: float) -> dict[str, float]:
        """Arguments of an `antiosc.Section`; `length` is the deck's unit in m."""
        arguments = {"A": self.A * length**2, "shear": self.shear_coefficient}
        arguments |= {name: getattr(self, name) * length**4 for name in ("I", "I_side", "J")}
        if self.side_shear_coefficient is not None:
            arguments["shear_side"] = self.side_shear_coefficient
        return arguments

    def rotated(self) -> Profile:
        """This cross-section rotated by 90°."""
        moments = {"I": self.I_side, "I_side": self.I, "product_moment": -self.product_moment}
        turned = replace(self, height=self.width, width=self.height, **moments)
        return turned.sheared(*reversed(self.shear_coefficients))


def rectangle(height: float, width: float) -> Profile:
    """A solid rectangle (Timoshenko & Goodier, *Theory of Elasticity*, §109)."""
    a = max(height, width)
    b = min(height, width)
    n = np.arange(1, 40, 2)
    series = float(np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5))
    torsion = a * b**3 / 3 * (1 - 192 / np.pi**5 * b / a * series)
    second = width * height**3 / 12, height * width**3 / 12
    return Profile(height * width, *second, torsion, RECTANGLE_SHEAR, height, width)


def ellipse(height: float, width: float) -> Profile:
    """A solid ellipse with axes `height` and `width`."""
    area = math.pi * height * width / 4
    torsion = math.pi * height**3 * width**3 / (16 * (height**2 + width**2))
    second = area * height**2 / 16, area * width**2 / 16
    return Profile(area, *second, torsion, CIRCLE_SHEAR, height, width)


def tube(radius: float, wall: float) -> Profile:
    """A round tube with this outer radius."""
    inner = max(radius - wall, 0.0)
    second = math.pi * (radius**4 - inner**4) / 4
    area = math.pi * (radius**2 - inner**2)
    return Profile(area, second, second, 2 * second, TUBE_SHEAR, 2 * radius, 2 * radius)


def box(height: float, width: float, side: float, top: float) -> Profile:
    """A rectangular tube by its outer sides and the thicknesses of its walls; torsion by Bredt."""
    h = height - 2 * side
    w = width - 2 * top
    second = (width * height**3 - w * h**3) / 12, (height * width**3 - h * w**3) / 12
    torsion = box_torsion(height, width, top, top, side, side)
    return Profile(height * width - h * w, *second, torsion, THIN_WALL_SHEAR, height, width)


#: A rectangle: its start and end along the height, its start and end across it.
Wall = tuple[float, float, float, float]


def profile_of_walls(walls: Sequence[Wall], torsion: float | None = None) -> Profile:
    """A section of touching rectangles; torsion of thin open walls, Σ l t³/3, unless given.

    Raises ValueError if a wall has no width.
    """
    low, high, left, right = np.array(walls, dtype=float).T
    h = high - low
    w = right - left
    if min(h.min(), w.min()) <= 0:
        raise ValueError("a wall without a width")
    A = h * w
    y, z = np.stack([low + high, left + right]) / 2 - centroid(walls)[:, None]
    first, second = (float(np.sum(t)) for t in (w * h**3 / 12 + A * y**2, h * w**3 / 12 + A * z**2))
    torsion = torsion or float(np.sum(np.maximum(h, w) * np.minimum(h, w) ** 3) / 3)
    height = float(high.max() - low.min())
    width = float(right.max() - left.min())
    mixed = float(A @ (y * z))
    return Profile(float(A.sum()), first, second, torsion, THIN_WALL_SHEAR, height, width, mixed)


def centroid(walls: Sequence[Wall]) -> Array:
    """Centroid (along the height, across it) of rectangles."""
    low, high, left, right = np.array(walls, dtype=float).T
    A = (high - low) * (right - left)
    return np.array([A @ (low + high), A @ (left + right)]) / 2 / A.sum()


def box_torsion(
    width: float, height: float, top: float, bottom: float, left: float, right: float
) -> float:
    """Bredt's torsion constant of a rectangular tube with four walls."""
    w = width - (left + right) / 2
    h = height - (top + bottom) / 2
    return 4 * (w * h) ** 2 / (w / top + w / bottom + h / left + h / right)


def hexagon(height: float, width: float, tip: float) -> Profile:
    """A rectangle between two triangles of height `tip`; ValueError if they are too wide."""
    flat = width - 2 * tip
    if flat < 0:
        raise ValueError("the tips are wider than the hexagon")
    area = height * (flat + tip)
    upright = flat * height**3 / 12 + tip * height**3 / 24
    # ∫ z² over the rectangle, and over two triangles of which the base lies at flat/2
    arm = flat / 2 + tip / 3
    moment = height * flat**3 / 12 + 2 * (height * tip**3 / 36 + height * tip / 2 * arm**2)
    polar = upright + moment
    return Profile(area, upright, moment, area**4 / (40 * polar), RECTANGLE_SHEAR, height, width)


#: "places" [m] and the "directions" at these, both (n, 3).
DirectionField = dict[str, list[list[float]]]
#: A direction whose cosine with an axis is above this counts as along the axis.
AXIS_COSINE = 1 - 1e-9


def corners_of(deck: Deck, elements: IntArray) -> list[Array]:
    """Coordinates (k, 3) of the corners of each element."""
    return [x for block, _ in deck.blocks_of(elements) for x in deck.points[block.corners]]


def unit_rows(v: Array) -> Array:
    """Rows scaled to length 1; zero rows stay zero."""
    length = np.linalg.norm(v, axis=1, keepdims=True)
    return v / np.where(length > 0, length, 1.0)


def axes_of(first: Array, second: Array) -> Array:
    """Unit vectors as rows: along `first`, towards `second` (0: parallel), normal to both."""
    x, z = unit_rows(np.stack([first, np.cross(first, second)]))
    return np.stack([x, np.cross(z, x), z])


def rotated_about(v: Array, axis: Array, degrees: float) -> Array:
    """Vectors perpendicular to the unit vectors `axis`, rotated about these."""
    angle = math.radians(degrees)
    return math.cos(angle) * v + math.sin(angle) * np.cross(axis, v)


def tangents_of(deck: Deck, elements: IntArray) -> Array:
    """Unit vectors (n, 3) along lines from their first to their last node."""
    return unit_rows(np.array([x[1] - x[0] for x in corners_of(deck, elements)]).reshape(-1, 3))


def normals_of(deck: Deck, elements: IntArray) -> Array:
    """Unit normals (n, 3) of triangles and quadrilaterals by the order of their corners."""
    normals = np.zeros((len(elements), 3))
    for block, positions in deck.blocks_of(elements):
        x = deck.points[block.corners]
        normals[positions] = np.cross(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1])
    return unit_rows(normals)


def common_direction(vectors: Array, least_cosine: float = 0.3) -> Array | None:
    """The mean unit vector if its cosine with each vector is at least `least_cosine`, else None."""
    (mean,) = unit_rows(vectors.mean(axis=0)[None])
    return mean if (vectors @ mean).min() >= least_cosine else None


def is_curved(deck: Deck, elements: IntArray) -> bool:
    """Whether the normals of the shells differ."""
    return common_direction(normals_of(deck, elements), least_cosine=1 - 1e-6) is None


def directions_at_centres(
    deck: Deck, elements: IntArray, vectors: Array, length: float
) -> DirectionField:
    """Each element's vector at its centre [m], and at the centres of a quadrilateral's triangles.

    `vectors` (n, 3); `length`: metres per unit of the deck.
    """
    places = []
    directions = []
    for x, vector in zip(corners_of(deck, elements), vectors.tolist(), strict=True):
        thirds = range(4) if len(x) == 4 else ()
        centres = [x.mean(axis=0), *(np.delete(x, k, axis=0).mean(axis=0) for k in thirds)]
        places += [(c * length).tolist() for c in centres]
        directions += [vector] * len(centres)
    return {"places": places, "directions": directions}


def top_directions(deck: Deck, elements: IntArray, length: float) -> DirectionField | list[float]:
    """The normals of shells: one direction if they are similar, else one for each element."""
    normals = normals_of(deck, elements)
    top = common_direction(normals)
    return directions_at_centres(deck, elements, normals, length) if top is None else top.tolist()


def fixed_along_axes(fixed: BoolArray, frame: Array) -> BoolArray | None:
    """Mask (3,) of x, y, z fixed if the rows `fixed` of `frame` are; None if these are inclined."""
    if fixed.all() or not fixed.any():
        return fixed
    cosines = np.abs(frame)
    for rows, value in ((fixed, True), (~fixed, False)):  # second: a plane between two axes
        if (cosines[rows].max(axis=1) > AXIS_COSINE).all():
            result = np.full(3, not value)
            result[cosines[rows].argmax(axis=1)] = value
            return result
    return None
