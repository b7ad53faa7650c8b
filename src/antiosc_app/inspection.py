"""The result of inspecting a part: its sizes, the assumptions for a scene, and their texts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import floor, log10, pi
from typing import TYPE_CHECKING

import numpy as np

from antiosc import Sphere
from antiosc.base import materials
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.texts import engineering, rounded_down
from antiosc_app.foreign import STEEL_CONSTANTS, ReadOptions
from antiosc_app.scene_file.document import names_text

if TYPE_CHECKING:
    from antiosc import Structure
    from antiosc.io.neutral import Piece

#: Default materials of a part, of the ball, and of the floor of a fall with its friction.
DEFAULT_MATERIAL = "steel S235"
BALL_MATERIAL = "bearing steel 100Cr6"
FLOOR_MATERIAL = "concrete C30/37"
FLOOR_FRICTION = 0.3
#: Height [m] of a fall, and tilt [degree], so that not all vertices of a face touch at once.
FALL_HEIGHT = 1.0
FALL_TILT: tuple[float, ...] = (10.0, 5.0, 0.0)
#: Largest mass of a striker over the part's: far heavier ones move it beyond linear theory.
MAX_MASS_RATIO = 10.0
#: Distance over the size of the part below which it has no extent.
PLACE_TOLERANCE = 1e-6
#: Number of rigid motions of a part that is free.
RIGID_MOTION_COUNT = 6
#: Guessed thickness of a sheet, and diameter of a bar, over the longest side.
THICKNESS_RATIO, DIAMETER_RATIO = 0.005, 0.03
#: What becomes of the contact of a deck.
CONTACT_TEXTS = {"tied": "tied where closed", "apart": "left out"}
#: Dimension of the cells of a family.
FAMILY_DIMENSIONS = {"Beam": 1, "Shell": 2, "Solid": 3}


@dataclass(frozen=True)
class Inspection:
    """The result of inspecting a part; lengths in m."""

    family: str  # "Solid", "Shell" or "Beam"
    read_options: ReadOptions  # arguments of `read_mesh` or `read_model` besides the file
    box_low: Array  # (3,) corners of its box
    box_high: Array
    groups: list[str]
    shape: str  # of the cells of its largest mesh
    n_cells: int
    held_groups: tuple[str, ...]  # groups that are held
    held_plane: list[list[float]] | None  # (point, normal) of held nodes; neither: it is free
    point: list[float]  # of the site
    direction: list[float]
    site_cell_size: float | None  # size of the cells at the site of a solid that is meshed here
    oscillator_count: int  # of anti-oscillators, at most a quarter of the dofs
    points: Array = field(repr=False)  # nodes (P, 3), corners (F, k), fixed nodes: the picture
    faces: IntArray = field(repr=False)
    held: BoolArray = field(repr=False)
    cell_measure: float  # volume [m³], area [m²] or length [m] of its cells
    structure: Structure | None = field(repr=False)  # of a deck
    flat_contact: (
        tuple[float, float] | None
    )  # E [Pa] and nu of a flat face in place of an unknown surface
    has_error_bars: bool  # whether its models have error bars of mesh and truncation
    is_meshed: bool  # whether its file is a geometry that is meshed here
    longest_cell: float  # longest distance between two corners of a cell
    notes: tuple[str, ...] = ()  # decisions made while reading, one sentence each
    pieces: Sequence[Piece] = ()  # the largest first, joined or not
    unit_is_inferred: bool = False  # whether the unit of a deck is inferred from its materials
    radius: float | None = None  # of the patch of a plane part, which facets do not tell
    material: str = DEFAULT_MATERIAL  # unused for a deck
    material_is_given: bool = False  # whether the material was asked for

    @property
    def is_deck(self) -> bool:
        """Whether the part is a deck, which has supports and materials."""
        return self.structure is not None

    @property
    def length(self) -> float:
        """The longest side [m] of the part's box."""
        return float((self.box_high - self.box_low).max())

    @property
    def size(self) -> float:
        """Requested cell size [m], else the longest cell of the file."""
        return float(self.read_options.get("size", self.longest_cell))

    @property
    def is_divisible(self) -> bool:
        """Whether cells of a finished mesh can be divided around a point: no solids, no decks."""
        return not self.is_meshed and self.family != "Solid" and not self.is_deck

    @property
    def thickness(self) -> float:
        """Guessed thickness [m] of a sheet, or diameter of a bar."""
        ratio = DIAMETER_RATIO if self.family == "Beam" else THICKNESS_RATIO
        return float(f"{ratio * self.length:.1g}")

    @property
    def is_free_deck(self) -> bool:
        """Whether the part is a deck without supports."""
        return (
            self.structure is not None and self.structure.rigid_modes.shape[1] == RIGID_MOTION_COUNT
        )

    @property
    def mass(self) -> float:
        """Mass [kg] of the part, with a guessed material and thickness unless a deck has them."""
        if self.structure is not None:
            return self.structure.mass
        across = {"Solid": 1.0, "Shell": self.thickness, "Beam": pi / 4 * self.thickness**2}
        return materials.record(self.material).rho * across[self.family] * self.cell_measure

    @property
    def ball_radius(self) -> float:
        """Guessed radius [m] of the striking ball."""
        from antiosc.strikes.defaults import default_ball_radius

        return default_ball_radius(self.length)

    def heaviest_striker(self, mass: float) -> float:
        """The smaller of `mass` and the largest mass [kg] for which linear theory holds."""
        heaviest = MAX_MASS_RATIO * self.mass
        return min(mass, rounded_down(heaviest)) if heaviest > 0 else mass

    @property
    def hertz_stiffness(self) -> float | None:
        """Hertz's stiffness [N/m^1.5] of the ball on a flat face; None if curvatures are known."""
        if self.flat_contact is None:
            return None
        ball = Sphere(radius=self.ball_radius, **STEEL_CONSTANTS, velocity=1.0)
        return float(f"{ball.hertz(*self.flat_contact).stiffness:.3g}")

    # -- in words

    @property
    def cells_text(self) -> str:
        """Text of the number and kind of cells."""
        return f"{self.n_cells} cells of kind {self.shape}"

    def sentences(self, name: str, drop: bool = False) -> list[str]:
        """Lines for the terminal on the part `name`; `drop`: for a fall instead of an impact."""
        first = (
            f"{name}: {self.cells_text}, {self.sides_text()}; groups: {names_text(self.groups)}."
        )
        return [
            first,
            *self.notes,
            "taken, and what changes it:",
            *aligned_lines(self.assumption_rows(drop)),
        ]

    def sides_text(self) -> str:
        """Text of the sides [mm] of the part's box, without those that are 0."""
        sides = self.box_high - self.box_low
        sides = sides[sides > PLACE_TOLERANCE * self.length]
        return " × ".join(_millimetre_text(side) for side in sides) + " mm"

    def unit_text(self) -> str:
        """Text of the unit of the file and the reason for it."""
        unit = str(self.read_options["unit"])
        if self.is_deck and not self.unit_is_inferred:
            return unit
        why = "its materials and size" if self.is_deck else "its size"
        return f"{unit}, by {why}: the file states none"

    def assumption_rows(self, drop: bool) -> list[tuple[str, str, str]]:
        """Assumptions as rows (name, value, key of the scene that changes it)."""
        section = "[deck]" if self.is_deck else "[geometry]"
        rows = []
        if "unit" in self.read_options:
            rows.append(("unit of the file", self.unit_text(), f"{section} unit"))
        for key, unit in (("density", "kg/m³"), ("modulus", "Pa")):
            if key in self.read_options:
                told = f"{self.read_options[key]:g} {unit}, for the deck has none"
                rows.append((key, told, f"{section} {key}"))
        if "contact" in self.read_options:
            rows.append(
                ("contact pairs", CONTACT_TEXTS[self.read_options["contact"]], "[deck] contact")
            )

        finer = (
            f", {self.site_cell_size:g} m at the site" if self.site_cell_size and not drop else ""
        )
        at_most = "" if "size" in self.read_options else "up to "
        cells = f"{at_most}{self.size:.3g} m{finer}"
        if not self.is_deck:
            rows.append(("elements", cells, f"{section} size, refine"))
        if self.is_deck:
            told = "none: nothing is said of yield"
            rows.append(("yield strength", told, "[deck] yield_strength"))
        else:
            guess = "" if self.material_is_given else ", a guess: the file has none"
            rows.append(("material", f"{self.material}{guess}", "[material] name"))
        if self.family == "Shell" and not self.is_deck:
            rows.append(("thickness", f"{self.thickness:g} m", "[material] thickness"))
        elif self.family == "Beam" and not self.is_deck:
            rows.append(("section", f"a bar of {self.thickness:g} m", "[material] section"))
        mass = engineering(self.mass, "kg", 4)
        if self.is_deck:
            rows.append(("mass", mass, "[deck] unit"))
        else:
            rows.append(("mass", f"{mass}, if it is of {self.material}", "[material] name"))

        if drop:
            fall = f"from {FALL_HEIGHT:g} m, without supports, z up, tilted by {list(FALL_TILT)}°"
            floor = f"{FLOOR_MATERIAL}, coefficient of friction {FLOOR_FRICTION:g}"
            floor_key = "[drop.floor] material, friction"
            return [*rows, ("fall", fall, "[drop] height, tilt"), ("floor", floor, floor_key)]
        site = f"{rounded_to(self.point)} m along {self.direction}"
        kind = (
            "by materials and curvatures"
            if self.flat_contact is None
            else "Hertz, as on a flat face"
        )
        mass = engineering(
            4 / 3 * pi * materials.record(BALL_MATERIAL).rho * self.ball_radius**3, "kg"
        )
        striker = f"steel ball, radius {1e3 * self.ball_radius:g} mm ({mass}), 1 m/s"
        return [
            *rows,
            ("held", self._support_text(), "[[supports]]"),
            ("struck", site, "[sites.tip] point, direction"),
            ("striker", striker, "[impactor]"),
            ("contact", kind, "[contact] kind"),
        ]

    def _support_text(self) -> str:
        """Text on the place where the part is held."""
        if self.is_deck and not self.is_free_deck:
            return "as in the deck"
        if self.held_groups:
            return f"at the group {self.held_groups[0]!r}"
        if self.held_plane is None:
            return "nowhere: it is free"
        point, normal = self.held_plane
        axis = normal.index(1.0)
        side = "the underside" if axis == 2 else "the side"
        return f"the nodes on {side}, {'xyz'[axis]} = {1e3 * point[axis]:g} mm"


def _millimetre_text(length: float) -> str:
    """Text of a length [m] in millimetres, to four digits."""
    text = np.format_float_positional(1e3 * length, 4, unique=False, fractional=False, trim="-")
    return str(text)


def aligned_lines(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """Rows of a table as lines of text with aligned columns."""
    first, second = (max(len(row[k]) for row in rows) for k in (0, 1))
    return [f"  {a:<{first}}  {b:<{second}}  {c}" for a, b, c in rows]


def rounded_to(values: Sequence[float] | Array, size: float = 1.0) -> list[float]:
    """Numbers rounded to about 1e-5 of `size`."""
    return [float(c) + 0.0 for c in np.round(values, 5 - floor(log10(size)))]
