"""`antiosc new`: inspect a part by its mesh, and write a commented scene for it.

Family, unit, supports and site are guessed, so that the scene runs without changes.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, combinations, islice
from math import floor, inf, log10, pi, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from antiosc import Sphere, impact_band
from antiosc.base import checks, files, materials, progress
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AntioscError, InputError, RangeError, SiteError, warnings_to
from antiosc.base.process import free_memory, require
from antiosc.base.texts import count_text, engineering, plain
from antiosc.models.body import coarse_at
from antiosc_app import pieces
from antiosc_app.foreign import (
    DECK_ENDINGS,
    STEEL,
    Read,
    foreign_part,
    is_deck,
    usual_size,
    way_of,
    way_of_piece,
)
from antiosc_app.live import has_bars
from antiosc_app.report import rendered
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import read, without_line
from antiosc_app.scene_file.outline import Outline, check_size
from antiosc_app.symmetry import held_motions, symmetry_note

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.extension import Faces
    from antiosc.io.neutral import Piece

T = TypeVar("T")

#: Words in the names of groups that are supports, the likeliest first.
SUPPORT_WORDS = (
    *("clamp", "fix", "held", "hold", "support", "encastre", "mount", "bolt", "feet", "foot"),
    *("base", "ground", "root", "rim", "ends", "left", "bottom", "edges"),
)
#: Words in the names of groups that are struck.
SITE_WORDS = ("impact", "struck", "strike", "hit", "eye", "tip", "nose", "top", "front", "middle")
#: A name that the reader of CAD files gives to a hole: its diameter and its number.
HOLE = re.compile(r"hole \S+ mm \(\d+\)")
#: A name with a number at its end, which may stand in brackets.
ENDING_NUMBER = re.compile(r"(.*?)(\d+)\)?")
#: Cosine between neighbouring faces of one side of a part.
SAME_SIDE_COSINE = np.cos(np.radians(15.0))
#: A supporting plane contains at most these shares of the nodes, and of the surface of a solid. A
#: side of a cube has 1/6, the underside of a plate 1/2: held there a plate is a layer on a rigid
#: floor, and one of 599 x 639 x 4.76 mm had its first antiresonance at 168 kHz.
LARGEST_PLANE, LARGEST_SIDE = 0.6, 0.3
#: A plane with less of the surface of a solid than this, or from which the solid reaches farther to
#: a side than this many times what is held to that side, is a small foot. A mount of 83 mm on one
#: of 6 mm at its end had 75 N +- 180 % and 54 contacts.
SMALLEST_SIDE, LARGEST_OVERHANG = 0.002, 4.0
#: Radius of a patch over the size of the faces there.
RESOLVED = 1.05
#: Radius of a site over the distance to the edge of its face.
RADIUS = 0.4
#: Largest radius of a site on a given mesh over that distance, if the facets need as much: at 1.2
#: 89 % of the load lie on a square face, and from 90 % on the patch counts as whole.
BEYOND_FACE = 1.1
#: Distance, over the edge of a facet, within which facets lie under a patch of 1.05 edges.
UNDER_PATCH = 2.0
#: Largest radius of a site over the longest side of the part. A solid's mean thickness is another
#: limit: on a plate of 4.76 mm, patches of 27, 13 and 3 mm gave 1029, 895 and 835 N.
LARGEST_RADIUS = 0.02
#: Default material of a part.
MATERIAL = "steel S235"
#: Material of the ball of a new scene.
BALL_MATERIAL = "bearing steel 100Cr6"
#: Largest radius of the ball of a new scene [m] for parts of up to 0.5 m; over the longest side of
#: larger ones.
LARGEST_BALL = 0.01
BALL_OVER_SIZE = 0.02
#: Largest radius of the ball over that of the patch, for steel and for a deck, whose materials may
#: be soft: at 1 m/s a steel ball touches steel over 0.05 of its radius, plastics over 0.11, as the
#: fifth root of the compliance of both, and the patch must be 1.7 times as wide.
BALL_OVER_PATCH, BALL_OVER_PATCH_OF_DECK = 10.0, 5.0
#: Largest radius of the ball over the longest side of a sheet or a bar.
BALL_OVER_LENGTH = 0.1
#: Largest mass of the ball over the part's: with 430 times a clip of 39 mg moved far beyond linear
#: theory.
HEAVIEST = 10.0
#: A site is in a hollow if its concave curvature exceeds this share of the ball's curvature.
HOLLOW = 0.5
#: Distance over the longest side of the part below which a face before a site is the site's own.
GRAZING = 1e-3
#: Radius of the ball of a new scene over that of the largest one that touches the site alone.
BALL_OVER_ROOM = 0.9
#: Sites nearer to held nodes than this share of the longest side are tried last.
AWAY = 0.2
#: Distance over the size of the part below which two nodes are one.
SAME_PLACE = 1e-6
#: Upward direction of a sheet in any plane.
UP = np.array([0.1, 0.2, 1.0])
#: Distance from the edge of a face, over the size of the part, beyond which sites rate almost
#: equal.
ROOM = 0.1
#: Number of sites that are tried first, and then among the others; words of the warning about a
#: partly held patch.
MOST_TRIED = 40
PARTLY_HELD = "supports fix"
#: Number of rigid motions of a part that is free.
RIGID = 6
#: Largest number of groups that are named for a plane.
MOST_NAMED = 4
#: Largest number of groups that are named on the terminal.
MOST_NAMES = 12
#: Width of the comment of a scene that lists the groups, and most of its lines.
WIDTH, MOST_LINES = 96, 10
#: Nodes lie on a plane if their distance is below this share of the part's size.
ON_PLANE = 1e-6
#: Guessed thickness of a sheet over the longest side.
THICKNESS_RATIO = 0.005
#: Guessed diameter of a bar over the longest side.
DIAMETER_RATIO = 0.03
#: Anti-oscillators of a new scene, by family.
COUNTS = {"Beam": 20, "Shell": 150, "Solid": 20}
#: A solid has as many as a shell if its longest side exceeds its mean thickness by this factor. A
#: plate of 599 x 639 x 4.76 mm (134) under a ball of 10 mm at 2 m/s: 1.95 kN +- 160 % with 20, and
#: 1.81 kN +- 24 % with 150; a bracket (12) needs no more than 20.
LIKE_A_PLATE = 40.0
#: Tetrahedra in a cube whose side is the size that is asked of them, besides those that details
#: of the part ask for: 5.0 to 7.7 in six printed parts, at a half and a third of the first size.
CELLS_IN_CUBE = 7.5
#: A part of at most so many nodes is struck before its scene is written: this took 5.7 s of
#: processor time for 5394 nodes of a solid (99 201 dofs), 65 s for 8200 nodes of a sheet.
MOST_NODES = 6000
#: Duration [s] of that impact, and on a patch, which must carry the largest force; the largest
#: number of its anti-oscillators. A vessel of 7166 shells took 32 s of processor time with 20; with
#: 150, two extractions took most of 78 s.
MOMENT, TO_PEAK, MOST_OSCILLATORS = 2e-4, 2e-3, 20
#: Number of other sites that are tried where the first is in a hollow or supported.
OTHERS = 3
#: Each other site is so many places further on in the list, because the next ones lie beside the
#: first.
APART = 12
#: Least number of dofs for one anti-oscillator.
DOFS_FOR_EACH = 4
#: Longest run of a new scene in periods of its impact's highest frequency: stresses are evaluated
#: at most 40 000 times, 13 in a period. With 2 s for a sheet of 6 m the largest stress was 297 %
#: off.
LONGEST_RUN = 3000
#: Height [m] of a fall of a new scene and of the page.
FALL_HEIGHT = 1.0
#: Tilt [degree] of the part, so that not all vertices of a face touch at once.
TILT: tuple[float, ...] = (10.0, 5.0, 0.0)
#: Number of impacts of the fall.
IMPACTS = 3
#: Coefficient of friction of the floor.
FRICTION = 0.3
#: What a deck says of the strength of its materials.
NO_YIELD = "none is read of a deck: nothing is said of yield"
#: What becomes of the contact of a deck.
CONTACT_TEXTS = {"tied": "tied where they are closed at first", "apart": "left out"}
FLOOR_MATERIAL = "concrete C30/37"
#: Lowest frequency of a plate of length L clamped at one end, over √(D/ρh)/L².
LOWEST_FREQUENCY = 0.56


#: Dimension of the cells of a family.
DIMENSIONS = {"Beam": 1, "Shell": 2, "Solid": 3}
#: Seconds of a model, and share of the free memory, from which a mesh is said to be large.
LONG, LARGE = 20.0, 0.5


#: Remedy for a part whose model does not fit into the free memory.
TOO_LARGE = (
    "give larger elements (size), a mesh of fewer cells, or a closed surface, which is filled as a "
    "solid; or use a machine with more memory"
)


#: Seconds of a whole answer of the page over those of its model, by the dimension of the cells:
#: mesh, impacts of the error bars, stresses and picture. Two sheets took 5 times as long, a wing of
#: shells 6 times (43 000 dofs, 97 s), a block 2.8 times (55 000 dofs, 21 s).
ANSWER = {1: 3.0, 2: 6.0, 3: 3.0}


class Forecast(NamedTuple):
    """Rough numbers of cells and dofs of a mesh, and the cost of a model on it: seconds, bytes, and
    whether its solver iterates; `answer`: seconds until the page has shown all.
    """

    cells: float
    dofs: float
    seconds: float
    bytes: float
    iterative: bool
    answer: float

    @property
    def is_long(self) -> bool:
        """Whether a model takes long, or much of the memory that is free."""
        return self.seconds > LONG or self.bytes > LARGE * free_memory()

    @property
    def fits(self) -> bool:
        """Whether a model has room in the memory that is free."""
        return self.bytes < free_memory()

    @property
    def memory(self) -> str:
        """The memory of a model, and that which is free."""
        return f"{plain(self.bytes / 1e9)} GB of memory ({plain(free_memory() / 1e9)} GB are free)"

    def brief(self) -> str:
        """Cells, seconds of the whole answer, and memory in few words."""
        seconds = progress.seconds_text(max(self.answer, 1.0))
        solver = " (iterative solver)" if self.iterative else ""
        cells = float(f"{self.cells:.2g}")
        return f"{cells:.0f} cells, {seconds}, {plain(self.bytes / 1e9)} GB{solver}"

    def text(self) -> str:
        """The numbers in words."""
        model, answer = map(progress.seconds_text, (self.seconds, self.answer))
        return (
            f"some {count_text(float(plain(self.dofs)))} dofs: a model takes about {model} and"
            f" {self.memory}; with mesh, error bars, stresses and picture it is about {answer}, and"
            " second-order forces come on top"
        )


@dataclass(frozen=True)
class Inspection:
    """The result of inspecting a part; lengths in m.

    Attributes
    ----------
    family : "Solid", "Shell" or "Beam".
    read : arguments of `read_mesh` besides the file.
    low, high : (3,) corners of its box.
    groups : names of its groups.
    shape, n_cells : shape of its largest mesh, and the number of cells of that dimension.
    kinds : shape -> number of cells, of all parts of a deck; {}: `shape` alone.
    where : groups that are held; plane : (point, normal) of supported nodes; neither: free.
    on_plane : names of the groups that lie on that plane; foot : whether it holds the part at a
        small foot.
    point, direction : those of the site; radius : radius of its patch, None for beams and sheets.
    room : radius of the largest ball that touches the site and nothing else [m].
    others : tuples (point, direction, radius, room) of sites to try if the first cannot be struck.
    count : number of anti-oscillators, at most a quarter of the number of dofs.
    cell : largest allowed cell at the site [m] of a part meshed here; None if `size` suffices.
    material : name of the material; unused for a deck.
    bars : whether its models have error bars of mesh and truncation.
    plate : whether it is a solid as thin as a plate.
    measure : volume [m³], area [m²] or length [m] of its cells.
    meshed : whether its file is a geometry that is meshed here.
    largest : largest distance between two corners of a cell of its mesh.
    kept : as of a `ForeignPart`.
    dofs : of its structure, where they are counted; 0: not.
    points, faces, held : nodes (P, 3), corners (F, k), mask of fixed nodes: for the picture.
    of_deck : whether supports and materials are those of a deck.
    notes : decisions made while reading, one sentence each.
    flat : (modulus [Pa], Poisson's ratio) of a flat face that replaces an unknown surface.
    pieces : those of a part in several pieces, the largest first, joined or not.
    structure : that of a deck as it was read.
    inferred, modulus : as of a `ForeignPart`.
    of_size : whether site and ball are chosen on cells of a size that was asked for.
    """

    family: str
    read: Read
    low: Array
    high: Array
    groups: list[str]
    shape: str
    n_cells: int
    where: tuple[str, ...]
    plane: list[list[float]] | None
    point: list[float]
    direction: list[float]
    radius: float | None
    count: int
    points: Array = field(repr=False)
    faces: IntArray = field(repr=False)
    held: BoolArray = field(repr=False)
    measure: float = 0.0
    of_deck: bool = False
    on_plane: tuple[str, ...] = ()
    foot: bool = False
    notes: tuple[str, ...] = ()
    flat: tuple[float, float] | None = None
    room: float = inf
    others: Sequence[tuple[list[float], list[float], float | None, float]] = ()
    pieces: Sequence[Piece] = ()
    structure: Structure | None = field(default=None, repr=False)
    inferred: bool = False
    modulus: float | None = None
    cell: float | None = None
    material: str = MATERIAL
    bars: bool = True
    plate: bool = False
    meshed: bool = False
    largest: float = 0.0
    kept: str = ""
    divided: str = ""
    dofs: int = 0
    kinds: dict[str, int] = field(default_factory=dict)
    of_size: bool = False

    @property
    def cells(self) -> str:
        """The number and kind of its cells in words."""
        divided = f" ({self.divided}, divided)" if self.divided else ""
        (shape, count), *others = (self.kinds or {self.shape: self.n_cells}).items()
        besides = "".join(f", {number} of kind {other}" for other, number in others)
        return f"{count} cells of kind {shape}{besides}{divided}"

    def forecast(self, size: float | None = None, n: int | None = None) -> Forecast:
        """Forecast of a model of `n` anti-oscillators with cells of another size [m].

        Those of a finished mesh are halved, all of them; a geometry is meshed again.
        """
        from antiosc.extension import before_meshing, halvings

        dim = DIMENSIONS[self.family]
        cells = float(self.n_cells)
        if size is not None and self.meshed and dim == 3:
            cubes, first = (self.measure / length**3 for length in (size, self.size))
            cells += CELLS_IN_CUBE * max(cubes - first, 0.0)
        elif size is not None:
            finer = self.size / size if self.meshed else 2.0 ** halvings(self.largest, size)
            cells *= finer**dim
        of_cell = self.dofs / self.n_cells
        dofs, cost = before_meshing(self.shape, dim, cells, n or self.count, of_cell)
        seconds = cost.seconds or 0.0
        answer = ANSWER[dim] * seconds
        return Forecast(cells, dofs, seconds, cost.bytes, cost.iterative, answer)

    @property
    def length(self) -> float:
        """The longest side of the box."""
        return float((self.high - self.low).max())

    @property
    def finest(self) -> float | None:
        """Size [m] of the cells at the site of a part that is meshed here; None: as elsewhere."""
        if self.meshed:
            return self.radius or self.cell
        return None

    @property
    def size(self) -> float:
        """The size that is asked of its cells, or the largest length of a cell of its file [m]."""
        return float(self.read.get("size", self.largest))

    @property
    def thickness(self) -> float:
        """Guessed thickness of a sheet, or diameter of a bar."""
        return float(
            f"{(DIAMETER_RATIO if self.family == 'Beam' else THICKNESS_RATIO) * self.length:.1g}"
        )

    @property
    def free_deck(self) -> bool:
        """Whether a deck holds its part nowhere."""
        return self.structure is not None and self.structure.rigid_modes.shape[1] == RIGID

    @property
    def ball(self) -> float:
        """Radius [m] of the striking ball, small enough for the patch to carry its force, and of
        little mass beside the part.
        """
        return min(self._ball_by_size, self._ball_by_mass)

    @property
    def _ball_by_mass(self) -> float:
        """Radius [m] of the ball with the largest mass beside the part's, to two digits."""
        heaviest = HEAVIEST * self.mass
        if heaviest <= 0:
            return inf
        return rounded_down(float(np.cbrt(heaviest / (4 / 3 * pi * _ball_density()))))

    @property
    def _ball_by_size(self) -> float:
        """Radius [m] of the ball by the sizes of the part and of the patch."""
        if self.radius is None:
            largest = BALL_OVER_LENGTH * self.length
        else:
            largest = self._ball_over_patch * self.radius
        digit = 10.0 ** floor(log10(largest))
        rounded = float(f"{floor(largest / digit + 0.05) * digit:.1g}")
        preferred = min(largest_ball_on(self.length), rounded)
        return min(preferred, float(f"{BALL_OVER_ROOM * self.room:.2g}"))

    @property
    def _ball_over_patch(self) -> float:
        """Largest radius of the ball over that of the patch, which must carry its force."""
        if self.of_deck:
            return BALL_OVER_PATCH_OF_DECK
        both = (materials.record(name) for name in (self.material, BALL_MATERIAL))
        compliance = sum((1 - one.nu**2) / one.E for one in both)
        of_steel = 2 * (1 - STEEL["nu"] ** 2) / STEEL["E"]
        return BALL_OVER_PATCH * min(of_steel / compliance, 1.0) ** 0.2

    @property
    def stiffness(self) -> float | None:
        """Hertz's stiffness [N/m^1.5] of the ball on a flat face; None if the surface is known."""
        if self.flat is None:
            return None
        ball = Sphere(radius=self.ball, **STEEL, velocity=1.0)
        return float(f"{ball.hertz(*self.flat).stiffness:.3g}")

    @property
    def duration(self) -> float:
        """Three half periods [s] of a sheet's lowest bending vibration, as if clamped at one end.

        At most `LONGEST_RUN` periods of the impact.
        """
        E = STEEL["E"]
        nu = STEEL["nu"]
        rho = STEEL["rho"]
        bending = self.thickness * sqrt(E / (12 * (1 - nu**2) * rho))
        periods = 1.5 * self.length**2 / (LOWEST_FREQUENCY * bending)
        return float(f"{min(periods, LONGEST_RUN / _band(self.ball)):.1g}")

    def sentences(self, name: str, drop: bool = False) -> list[str]:
        """Text lines for the terminal; without the impact if the part is dropped."""
        kind = "materials are those of its deck" if self.of_deck else f"taken as {self.family}"
        outline = Outline(name, self.groups, self.low, self.high, 0.0)
        forecast = self.forecast()
        cost = f" It has {forecast.text()}." if forecast.is_long else ""
        sentences = [f"{name}: {self.cells}, {self.sides_text()}; {kind}.{cost}"]
        sentences += [
            *self.notes,
            f"it reaches {outline.text(MOST_NAMES)}.",
            "taken, and what changes it:",
        ]
        return [*sentences, *aligned(self.taken(drop))]

    def sides_text(self) -> str:
        """The sides of the part's box; of a sheet those that are not 0, and its thickness."""
        sides = self.high - self.low
        sides = sides[sides > SAME_PLACE * self.length]
        text = " × ".join(_in_mm(side) for side in sides) + " mm"
        if self.family != "Shell":
            return text
        thickness = self.thickness
        if self.structure is not None:
            from antiosc.extension import source

            parts = source(self.structure).materials_of(self.structure, None)
            thickness = min(getattr(material, "thickness", thickness) for material in parts)
            return f"{text}, {1e3 * thickness:.4g} mm thick"
        return (
            f"{text}, taken as {1e3 * thickness:.4g} mm thick at first: the file has no thickness"
        )

    def unit_text(self) -> str:
        """The unit of the file and why it is taken, with the part's size in other units."""
        from antiosc.io.neutral import UnitSystem

        unit = str(self.read["unit"])
        if self.of_deck and not self.inferred:
            return unit
        others = [other for other in ("mm", "in", "m") if other != unit]
        systems = {name: UnitSystem.of(name) for name in (unit, *others)}
        longest = self.length / systems[unit].length
        sizes = {name: engineering(longest * systems[name].length, "m") for name in systems}
        if self.modulus is None:
            words = {"mm": "millimetres", "in": "inches", "m": "metres"}
            size_texts = [f"{sizes[name]} in {words[name]}" for name in others]
            return f"{unit}, not stated there (it would measure {' or '.join(size_texts)})"
        texts = [
            f"{name}: {sizes[name]}, E = {engineering(self.modulus * system.stress, 'Pa')}"
            for name, system in systems.items()
        ]
        return f"{unit}, inferred from its materials ({'; '.join(texts)})"

    def unstated(self) -> dict[str, str]:
        """Key -> what is taken for it because the deck does not state it."""
        units = {"density": "kg/m³", "modulus": "Pa"}
        return {
            key: f"{self.read[key]:g} {unit}, for the deck has none"
            for key, unit in units.items()
            if key in self.read
        }

    @property
    def mass(self) -> float:
        """Mass [kg] of the part with its materials, or with the guessed ones."""
        if self.structure is not None:
            return self.structure.mass
        across = {"Solid": 1.0, "Shell": self.thickness, "Beam": pi / 4 * self.thickness**2}
        return materials.record(self.material).rho * across[self.family] * self.measure

    def mass_text(self) -> str:
        """The mass, and whether its density is guessed."""
        mass = engineering(self.mass, "kg", 4)
        if "density" in self.read:
            return f"{mass}, with {self.read['density']:g} kg/m³ where the deck states no density"
        if not self.of_deck:
            return f"{mass}, if it is of {self.material}"
        return mass

    def ball_text(self) -> str:
        """The ball and its mass, chosen by the size of the part."""
        mass = engineering(4 / 3 * pi * _ball_density() * self.ball**3, "kg")
        by = "size"
        if self._ball_by_mass < self._ball_by_size:
            by = f"mass, of which it has at most {HEAVIEST:g} times"
        return f"steel ball, radius {1e3 * self.ball:g} mm ({mass}), by the part's {by}"

    def taken(self, drop: bool) -> list[tuple[str, str, str]]:
        """The guesses: (name, value, key of the scene that changes it)."""
        section = "[deck]" if self.of_deck else "[geometry]"
        rows = []
        if "unit" in self.read:
            rows.append(("unit of the file", self.unit_text(), f"{section} unit"))
        finer = f", {self.finest:g} m at the site" if self.finest and not drop else ""
        key = f"{section} size, refine" if finer else f"{section} size"
        if not self.kept:
            at_most = "" if "size" in self.read else "up to "
            rows.append(("elements", f"{at_most}{self.size:.3g} m{finer}", key))
        rows += [(key, taken, f"{section} {key}") for key, taken in self.unstated().items()]
        if self.of_deck:
            rows.append(("yield strength", NO_YIELD, "[deck] yield_strength"))
        else:
            rows.append(("material", self.material, "[material] name"))
        if self.family == "Shell" and not self.of_deck:
            rows.append(("thickness", f"{self.thickness:g} m", "[material] thickness"))
        elif self.family == "Beam" and not self.of_deck:
            rows.append(("section", f"a bar of {self.thickness:g} m", "[material] section"))
        key = "[deck] unit" if self.of_deck else "[material] name"
        rows.append(("mass", self.mass_text(), key))
        if "contact" in self.read:
            told = CONTACT_TEXTS[self.read["contact"]]
            rows.append(("contact pairs", told, "[deck] contact"))
        if drop:
            fall = f"from {FALL_HEIGHT:g} m, without supports, z up, tilted by {list(TILT)}°"
            return [*rows, ("fall", fall, "[drop] height, tilt")]
        rows.append(("held", self._held(), "[[supports]]"))
        site = f"{_rounded(self.point)} m along {self.direction}"
        rows.append(("struck", site, "[sites.tip] point, direction"))
        if self.radius is not None:
            rows.append(("patch", self._patch_text(), "[sites.tip] radius"))
        rows.append(("striker", f"{self.ball_text()}, 1 m/s", "[impactor]"))
        kind = "Hertz, as on a flat face: of the surface nothing is known"
        if self.flat is None:
            kind = "a law by curvatures and yield strengths: ElasticPlastic, Hertz, …"
        rows.append(("contact", kind, "[contact] kind"))
        return rows

    def _patch_text(self) -> str:
        """Text of the radius of the patch."""
        if self.family != "Solid":
            return f"radius {self.radius:g} m"
        return "as small as the mesh resolves, larger if the force needs it"

    def _held(self) -> str:
        """Text of the support."""
        if self.of_deck and not self.free_deck:
            return "as in the deck"
        if len(self.where) == 1:
            return f"at the group {self.where[0]!r}"
        if self.where:
            return f"at {len(self.where)} groups, {self.where[0]!r} to {self.where[-1]!r}"
        if self.plane:
            point, normal = self.plane
            axis = normal.index(1.0)
            plane = f"the plane {'xyz'[axis]} = {1e3 * point[axis]:g} mm"
            if self.foot:
                plane += ", a small foot of the part: hold what holds it in use"
            if not self.on_plane:
                return f"at the nodes on {plane}"
            return f"{', '.join(self.on_plane[:MOST_NAMED])}: the nodes on {plane}"
        return "nowhere: it is free"


def _in_mm(length: float) -> str:
    """A length [m] in millimetres, with four digits or those before its point."""
    text = np.format_float_positional(1e3 * length, 4, unique=False, fractional=False, trim="-")
    return str(text)


def _ball_density() -> float:
    """Density [kg/m³] of the ball of a new scene."""
    return materials.record(BALL_MATERIAL).rho


def rounded_down(value: float) -> float:
    """A number with two digits, not above it."""
    digit = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{floor(value / digit * (1 + 1e-9)) * digit:.2g}")


def largest_ball_on(length: float) -> float:
    """Largest radius [m] of the ball for a part whose longest side is `length` [m]."""
    return max(LARGEST_BALL, float(f"{BALL_OVER_SIZE * length:.1g}"))


def aligned(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """Rows of a table as lines of text with aligned columns."""
    first, second = (max(len(row[k]) for row in rows) for k in (0, 1))
    return [f"  {a:<{first}}  {b:<{second}}  {c}" for a, b, c in rows]


def inspect_part(
    path: Path,
    free: bool = False,
    unit: str | None = None,
    timeout: float | None = None,
    size: float | None = None,
    piece: int | None = None,
    contact: str | None = None,
    whole: Inspection | None = None,
) -> Inspection:
    """Read or mesh the file of a part and inspect it, or one of its pieces.

    `free`: whether to ignore the supports of a deck; `unit`: unit of the file, if known;
    `timeout` [s]: limit of each reading; None: by kind and size of the file; `size` [m]: largest
    cell, if it is asked for; `piece`: rank among those of the inspection without it, which is
    `whole`, if it was made; `contact`: what becomes of the contact of a deck, if that is asked for.

    Raises
    ------
    AntioscError
        It cannot be read or meshed, has no such piece, or is too large to be looked at, or a model
        of it needs more than the free memory.
    """
    check_size(path)
    options = free, unit, timeout, size, contact
    if piece is None:
        part = foreign_part(path, *options)
    elif whole is None and is_deck(path):  # one reading of it lists all pieces
        part = foreign_part(path, *options, alone={"piece": piece})
        _require_piece(path, piece, part.pieces)
    else:
        first = whole or foreign_part(path, *options)
        _require_piece(path, piece, first.pieces)
        part = foreign_part(path, *options, alone=way_of_piece(first.read, piece))
        part = replace(part, pieces=first.pieces)
    inspection = _inspect_mesh(part.mesh, part.read, part.structure, part.meshed)
    if size is not None:
        inspection = _struck_as_usual(inspection, path, (free, unit, timeout), size)
    forecast = inspection.forecast()
    what = f"a model of {path.name} on {inspection.cells}, some {forecast.dofs:.2g} dofs,"
    require(forecast.bytes, what, TOO_LARGE, free_memory())
    notes = (*part.notes, *filter(None, [symmetry_note(part.structure)]))
    return replace(
        inspection,
        notes=notes,
        pieces=part.pieces,
        inferred=part.inferred,
        modulus=part.modulus,
        kept=part.kept,
        divided=part.divided,
    )


#: What a place and its ball are of an inspection.
OF_SITE = ("point", "direction", "radius", "room", "others", "flat")


def _struck_as_usual(
    inspection: Inspection,
    path: Path,
    options: tuple[bool, str | None, float | None],
    size: float,
) -> Inspection:
    """The inspection of a part in cells of a size [m], struck as in those of the usual size.

    `of_size` where these are no fewer, or cannot be made, and of decks, which take long to read.
    `options` of `foreign_part` before the size.
    """
    of_size = replace(inspection, of_size=True)
    if inspection.of_deck or (inspection.meshed and size >= usual_size(inspection.length)):
        return of_size
    try:
        with progress.doing(f"looking where to strike {path.name}"):
            part = foreign_part(path, *options, alone=way_of(inspection.read))
        usual = _inspect_mesh(part.mesh, part.read, None, part.meshed)
    except AntioscError:
        return of_size
    return replace(inspection, **{name: getattr(usual, name) for name in OF_SITE})


def _require_piece(path: Path, piece: int, pieces: Sequence[Piece]) -> None:
    """InputError unless a file has a piece of this rank."""
    if not 0 < piece <= len(pieces):
        raise InputError(f"{path.name} has {_pieces_text(pieces)}: no piece {piece}.")


def _pieces_text(pieces: Sequence[Piece]) -> str:
    """The number of pieces in words."""
    return f"{len(pieces)} pieces" if pieces else "one piece alone"


def inspect_structure(part: Structure) -> Inspection:
    """Inspect the largest mesh of a structure."""
    from antiosc.extension import with_parts

    meshes = [member.part.mesh for member in with_parts(part).members()]
    return _inspect_mesh(max(meshes, key=lambda mesh: (mesh.tdim, mesh.n_cells)), {}, part)


def _inspect_mesh(
    mesh: Mesh, read: Read, structure: Structure | None, meshed: bool = False
) -> Inspection:
    """Inspect a mesh; `structure`: that of a deck with its supports; `meshed`: of a geometry."""
    from antiosc.extension import Faces, longest_cell, measure
    from antiosc.fem.platform import compat

    x = np.array(mesh.dolfinx.geometry.x)
    nodes = compat.geometry_nodes(mesh.dolfinx)
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    low, high = (np.array(_rounded(corner, size)) for corner in (x.min(axis=0), x.max(axis=0)))
    outer = Faces(mesh, mesh.tdim < 3)
    faces = _around(outer)
    where = () if structure is not None else _groups_with(mesh, SUPPORT_WORDS)[:1]
    site_nodes = _nodes_of(mesh, _groups_with(mesh, SITE_WORDS)[:1])
    supported = np.zeros(len(x), dtype=bool)
    plane = None
    foot = False
    if where:
        supported[_nodes_of(mesh, where)] = True
    elif structure is None:
        supported, plane, foot = _plane(x, low, high, size, faces if mesh.tdim == 3 else None)
        holes = _equal_holes(mesh) if plane is None or foot else ()
        if holes:
            where, plane, foot = holes, None, False
            supported = np.zeros(len(x), dtype=bool)
            supported[_nodes_of(mesh, where)] = True
    else:
        supported = _held_nodes(structure, x, size)
    family = next(name for name, dim in DIMENSIONS.items() if dim == mesh.tdim)
    longest = float((high - low).max())
    thickness = _mean_thickness(x[faces], outer.normals) if family == "Solid" else 0.0
    sites: Iterator[tuple[Array, Array, float | None]]
    if family == "Beam":
        sites = _on_lines(x, nodes, supported, site_nodes)
    elif mesh.gdim == 2:
        sites = _on_rim(x, faces, supported)
    else:
        candidates = _on_faces(x, faces, outer, supported, site_nodes, size)
        largest = LARGEST_RADIUS * longest
        if family == "Solid":
            largest = min(largest, thickness)
        sites = (
            (point, direction, _radius(edge_distance, edge, largest, meshed))
            for point, direction, edge_distance, edge in candidates
        )
    sites = _spread(sites)
    if not len(site_nodes):
        sites = _far_from(x[supported], AWAY * float(np.ptp(x, axis=0).max()), sites)
    if family == "Solid":
        sites = _outside_hollows(mesh, outer, sites, largest_ball_on(longest))
        if not len(site_nodes):
            sites = _clear_of_edges(outer, x, faces, sites, meshed)
    if family != "Beam" and mesh.gdim == 3:
        sites = _with_room(outer, sites, largest_ball_on(longest))
        if not len(site_nodes):
            sites = _in_sight(x[faces], sites, GRAZING * longest)
    point, direction, radius = next(sites)
    radius = radius if family == "Solid" or mesh.gdim == 2 else None
    if structure is not None:
        point, direction, radius = _movable(structure, (point, direction, radius), sites)
    flat = _flat(mesh, outer, structure, (point, direction, radius))
    other_sites = []
    if mesh.tdim > 1 and structure is None:
        spaced_sites = islice(sites, APART - 1, OTHERS * APART, APART)
        other_sites = [
            (_rounded(p, size), _rounded(d), patch, _room(outer, (p, d, patch)))
            for p, d, patch in spaced_sites
        ]
    # each node that is not held has three dofs or more
    dofs = 3 * int((~supported).sum()) if structure is None else structure.dofs
    plate = family == "Solid" and longest > LIKE_A_PLATE * thickness
    kinds, n_cells = ({}, mesh.n_cells) if structure is None else _cells_of(structure, mesh.tdim)
    count = min(COUNTS["Shell" if plate else family], dofs // DOFS_FOR_EACH)
    return Inspection(
        family,
        read,
        low,
        high,
        list(mesh.groups),
        mesh.cell,
        n_cells,
        where,
        plane,
        _rounded(point, size),
        _rounded(direction),
        radius,
        count,
        x,
        faces,
        supported,
        measure=compat.integrate(1 * measure(mesh, None), mesh.dolfinx),
        of_deck=structure is not None,
        structure=structure,
        on_plane=_groups_on(mesh, supported) if plane else (),
        foot=foot,
        flat=flat,
        room=_room(outer, (point, direction, radius)),
        others=other_sites,
        plate=plate,
        bars=_has_bars(structure),
        meshed=meshed,
        largest=longest_cell(x[nodes[:, : len(mesh.geometry.corners)]]),
        dofs=_counted(mesh) if structure is None else structure.dofs,
        kinds=kinds,
    )


def _cells_of(structure: Structure, dim: int) -> tuple[dict[str, int], int]:
    """(shape -> number of its cells in all parts, the most first; number of those of dimension
    `dim`).
    """
    from antiosc.extension import with_parts

    meshes = [member.part.mesh for member in with_parts(structure).members()]
    counts: Counter[str] = Counter()
    for mesh in meshes:
        counts[mesh.cell] += mesh.n_cells
    of_dim = sum(mesh.n_cells for mesh in meshes if mesh.tdim == dim)
    return dict(counts.most_common()), of_dim


def _counted(mesh: Mesh) -> int:
    """Number of dofs of solids that are no tetrahedra, of which few lie through a thickness often;
    0 for others.
    """
    from antiosc.fem.platform import compat

    if mesh.tdim < 3 or mesh.cell == "tetrahedron":
        return 0
    space = compat.lagrange(mesh.dolfinx, 2, 0)
    return 3 * int(space.dofmap.index_map.size_global)


def _areas(corners: Array) -> Array:
    """Area vectors (n, 3) of plane faces with corners (n, k, 3): parallelograms or, doubled,
    triangles.
    """
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _mean_thickness(corners: Array, normals: Array) -> float:
    """Twice the volume over the surface of a solid with these faces (n, k, 3), m."""
    area = np.linalg.norm(_areas(corners), axis=1) * (0.5 if corners.shape[1] == 3 else 1.0)
    heights = np.einsum("ij,ij->i", normals, corners.mean(axis=1))
    return float(2 / 3 * abs(area @ heights) / area.sum())


def _has_bars(structure: Structure | None) -> bool:
    """Whether `extract(…, error="estimate")` accepts the part, as it does any mesh."""
    return structure is None or has_bars(structure)


def _flat(
    mesh: Mesh, outer: Faces, structure: Structure | None, site: tuple[Array, Array, float | None]
) -> tuple[float, float] | None:
    """(modulus [Pa], Poisson's ratio) of a flat face if the surface at a site is unknown; else
    None.
    """
    from antiosc.extension import curvature
    from antiosc.reduce.site.surface import material_at, surface_at

    point, direction, radius = site
    try:
        if structure is not None:
            surface_at(structure, point, direction, radius, lengths=False)
        elif mesh.tdim > 1:
            curvature(mesh, outer, point, direction, lengths=False)
    except InputError:
        material = None if structure is None else material_at(structure, point, direction)
        E, nu = (getattr(material, name, None) for name in ("E", "nu"))
        if isinstance(E, float) and isinstance(nu, float):
            return E, nu
        return STEEL["E"], STEEL["nu"]
    return None


def _held_nodes(structure: Structure, x: Array, size: float) -> BoolArray:
    """Mask of the nodes x (N, 3) that do not move where all free dofs of a structure do."""
    nodes, motion = held_motions(structure)
    fixed = ~motion.any(axis=1)
    if not fixed.any():
        return np.zeros(len(x), dtype=bool)
    distance = cKDTree(nodes[fixed]).query(x)[0]
    return np.asarray(distance < SAME_PLACE * size)


def _far_from(
    fixed_points: Array, least: float, sites: Iterator[tuple[Array, Array, float | None]]
) -> Iterator[tuple[Array, Array, float | None]]:
    """The sites; those nearer than `least` [m] to fixed points (n, 3) come last."""
    if not len(fixed_points):
        yield from sites
        return
    tree = cKDTree(fixed_points)
    near_sites = []
    for site in sites:
        if tree.query(site[0])[0] < least:
            near_sites.append(site)
        else:
            yield site
    yield from near_sites


def _outside_hollows(
    mesh: Mesh, outer: Faces, sites: Iterator[tuple[Array, Array, float | None]], ball: float
) -> Iterator[tuple[Array, Array, float | None]]:
    """Yield the sites of a solid; those in hollows into which a ball of a radius [m] does not fit
    come last.
    """
    from antiosc.extension import curvature

    hollow = []
    for site in sites:
        try:
            curvature_there = float(np.min(curvature(mesh, outer, *site[:2], lengths=False).values))
        except InputError:  # not known
            curvature_there = 0.0
        if curvature_there < -HOLLOW / ball:  # nan of edges is not
            hollow.append(site)
        else:
            yield site
    yield from hollow


def _clear_of_edges(
    outer: Faces,
    x: Array,
    faces: IntArray,
    sites: Iterator[tuple[Array, Array, float | None]],
    meshed: bool,
) -> Iterator[tuple[Array, Array, float | None]]:
    """The sites of a solid; those where an edge cuts the smallest patch that the facets resolve
    come later, and last those where it cuts the own patch of the site, for which a geometry is
    meshed again (`meshed`).
    """
    later, cut = [], []
    for site in sites:
        if not _cuts_edge(outer, site, RESOLVED * facet_size_at(x, faces, site[0])):
            yield site
        elif meshed and site[2] and not _cuts_edge(outer, site, site[2]):
            later.append(site)
        else:
            cut.append(site)
    yield from later
    yield from cut


def _cuts_edge(outer: Faces, site: tuple[Array, Array, float | None], radius: float) -> bool:
    """Whether an edge of its face cuts the patch of a radius [m] at a site."""
    from antiosc.reduce.site.doubts import WHOLE_PATCH
    from antiosc.reduce.site.sites import patches

    place, radii = site[0][None], np.array([radius])
    contact = outer.contact(place, site[1][None], radii, np.zeros(len(outer), dtype=int))
    return bool(patches(outer, place, radii, contact)[1][0] < WHOLE_PATCH)


def facet_size_at(x: Array, faces: IntArray, point: Sequence[float] | Array) -> float:
    """Size [m] of the facets under the patch that they resolve at a point, as a site measures it:
    the largest mean side of the facets within its radius that face alike.
    """
    from antiosc.extension import SAME_FACE

    corners = x[faces]
    centres = corners.mean(axis=1)
    away = np.linalg.norm(centres - point, axis=1)
    gap = away - np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    nearest = int(np.argmin(away))
    alike = np.ones(len(corners), dtype=bool)
    if corners.shape[1] > 2:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        alike = normals @ normals[nearest] > SAME_FACE
    sizes = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    size = 0.0
    largest = float(sizes[nearest])
    while largest > size:
        size = largest
        largest = float(sizes[alike & (gap <= RESOLVED * size)].max(initial=size))
    return size


def _with_room(
    outer: Faces, sites: Iterator[tuple[Array, Array, float | None]], ball: float
) -> Iterator[tuple[Array, Array, float | None]]:
    """The sites; those where a ball of a radius [m] meets the part elsewhere come last."""
    narrow_sites = []
    for site in sites:
        if _room(outer, site) * BALL_OVER_ROOM < ball:
            narrow_sites.append(site)
        else:
            yield site
    yield from sorted(narrow_sites, key=lambda site: -_room(outer, site))


def _in_sight(
    corners: Array, sites: Iterator[tuple[Array, Array, float | None]], gap: float
) -> Iterator[tuple[Array, Array, float | None]]:
    """The sites; those that the part itself hides, as the inside of a box, come last.

    Parameters
    ----------
    corners : (F, k, 3), in cyclic order
    gap : distance [m] below which a face before the site is that of the site
    """
    triangles = np.concatenate([corners[:, [0, i, i + 1]] for i in range(1, corners.shape[1] - 1)])
    hidden = []
    for site in sites:
        point, direction, _ = site
        if _meets(triangles, point, -direction, gap):
            hidden.append(site)
        else:
            yield site
    yield from hidden


def _meets(triangles: Array, point: Array, direction: Array, least: float) -> bool:
    """Whether a ray from a point meets one of the triangles (F, 3, 3) beyond a distance (Möller and
    Trumbore).
    """
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    start = point - triangles[:, 0]
    across = np.cross(direction, second)
    turned = np.cross(start, first)
    volume = np.einsum("fi,fi->f", first, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("fi,fi->f", start, across) / volume
        v = turned @ direction / volume
        distance = np.einsum("fi,fi->f", second, turned) / volume
        # an edge belongs to both its triangles; nan of a triangle along the ray is no place in it
        inside = np.minimum(np.minimum(u, v), 1 - u - v) > -1e-9
    return bool((inside & (distance > least)).any())


def _room(outer: Faces, site: tuple[Array, Array, float | None]) -> float:
    """Radius [m] of the largest ball that touches a site of solids and sheets alone."""
    from antiosc.extension import largest_ball

    point, direction, radius = site
    if outer.mesh.tdim == 1 or outer.mesh.gdim < 3:
        return inf
    return largest_ball(outer, np.asarray(point), -np.asarray(direction), radius or 0.0)[0]


def _movable(
    structure: Structure,
    first: tuple[Array, Array, float | None],
    others: Iterator[tuple[Array, Array, float | None]],
) -> tuple[Array, Array, float | None]:
    """The first site that no support fixes, with a patch; else the first that is partly fixed."""
    from antiosc import Site
    from antiosc.reduce.site import functional

    partly_held = None
    for point, normal, radius in chain([first], others):
        attempts = [(normal, radius), (normal, None), *((-axis, None) for axis in np.eye(3)[::-1])]
        for direction, patch_radius in attempts:
            warnings_given: list[str] = []
            with contextlib.suppress(InputError), warnings_to(warnings_given.append):
                functional(
                    structure, Site(point.tolist(), direction.tolist(), patch_radius, snap=True)
                )
                if not any(PARTLY_HELD in warning for warning in warnings_given):
                    return point, direction, patch_radius
                partly_held = partly_held or (point, direction, patch_radius)
    return partly_held or first


def _spread(sites: Iterator[T]) -> Iterator[T]:
    """Yield the first sites, then a sample of the others."""
    yield from islice(sites, MOST_TRIED)
    remaining = list(sites)
    yield from remaining[:: 1 + len(remaining) // MOST_TRIED]


def _groups_with(mesh: Mesh, words: Sequence[str]) -> tuple[str, ...]:
    """Groups of facets, edges or nodes named with one of these words; the first word first."""
    lower = {
        n: n.lower()
        for n, parts in mesh.groups.items()
        if min(parts, default=mesh.tdim) < mesh.tdim
    }
    return tuple(n for word in words for n, low in lower.items() if word in low)


def _equal_holes(mesh: Mesh) -> tuple[str, ...]:
    """The holes of the diameter of which there are most, two or more: bolts hold the part there."""
    holes = [name for name in mesh.groups if HOLE.fullmatch(name)]
    counts = Counter(name.rpartition(" ")[0] for name in holes)
    common_diameter, count = counts.most_common(1)[0] if counts else ("", 0)
    return tuple(name for name in holes if count > 1 and name.rpartition(" ")[0] == common_diameter)


def _nodes_of(mesh: Mesh, groups: Sequence[str]) -> IntArray:
    """Nodes of groups."""
    from antiosc.fem.platform import compat

    vertices = [
        compat.entity_vertices(mesh.dolfinx, dim)[entities].ravel()
        for group in groups
        for dim, entities in mesh.groups[group].items()
    ]
    return np.unique(np.concatenate([np.zeros(0, dtype=int), *vertices]))


def _groups_on(mesh: Mesh, nodes: BoolArray) -> tuple[str, ...]:
    """Names of the groups of facets or edges with all their vertices among these nodes."""
    names = (name for name, parts in mesh.groups.items() if max(parts, default=3) < mesh.tdim)
    return tuple(name for name in names if nodes[_nodes_of(mesh, [name])].all())


def _plane(
    x: Array, low: Array, high: Array, size: float, faces: IntArray | None
) -> tuple[BoolArray, list[list[float]] | None, bool]:
    """(mask of nodes on a side of the box, plane, whether it is a small foot of the part).

    An empty mask and None where no side serves. `faces`: corners (F, k) of the surface of a solid,
    None of another part. The first side that is no small foot; else that with the least overhang.
    """
    sides = [(2, low), (0, low), (1, low), (0, high), (1, high)]
    feet: list[tuple[float, int, BoolArray, list[list[float]]]] = []
    sides += [(2, high)] if faces is not None else []
    for axis, corner in sides:
        on_plane = np.abs(x[:, axis] - corner[axis]) < ON_PLANE * size
        is_plausible = min(3, len(x) // 4) <= on_plane.sum() <= max(1.0, LARGEST_PLANE * len(x))
        share = 1.0 if faces is None else _share(x[faces], on_plane[faces])
        plane = [_rounded(corner, size), np.eye(3)[axis].tolist()]
        if not is_plausible or (faces is not None and not 0 < share <= LARGEST_SIDE):
            continue
        overhang = 0.0 if faces is None else _overhang(x[on_plane], low, high, axis)
        if share >= SMALLEST_SIDE and overhang <= LARGEST_OVERHANG:
            return on_plane, plane, False
        feet.append((overhang, len(feet), on_plane, plane))
    if feet:
        least = min(feet, key=lambda foot: foot[:2])
        return least[2], least[3], least[0] > LARGEST_OVERHANG
    return np.zeros(len(x), dtype=bool), None, False


def _overhang(held: Array, low: Array, high: Array, axis: int) -> float:
    """Largest distance of the part from the middle of held nodes, along their plane, over how far
    these reach to either side.
    """
    across = [k for k in range(3) if k != axis]
    middle = (held.max(axis=0) + held.min(axis=0))[across] / 2
    reach = np.maximum(high[across] - middle, middle - low[across])
    half = np.ptp(held, axis=0)[across] / 2
    return float((reach / np.maximum(half, 1e-9 * reach.max())).max())


def _share(corners: Array, chosen: BoolArray) -> float:
    """Share of the area of faces (F, k, 3) all of whose corners are chosen (F, k)."""
    area = np.linalg.norm(_areas(corners), axis=1)
    return float(area[chosen.all(axis=1)].sum() / area.sum())


def _on_faces(
    x: Array, faces: IntArray, outer: Faces, supported: BoolArray, struck: IntArray, size: float
) -> Iterator[tuple[Array, Array, float, float]]:
    """Yields candidate sites: point, inward direction, distance to the face's edge, edge length of
    the facets around.

    First the middle of the largest face, preferably far from supports and on top; then other
    places, those with most room first. Held faces are none, unless all are held.
    """
    corners = x[faces]
    middle = corners.mean(axis=1)
    area = np.linalg.norm(_areas(corners), axis=1)
    fixed = supported[faces].all(axis=1)
    area[fixed] = 0.0
    normal = outer.normals
    if outer.sheet:
        normal = _outward(x, faces, normal)
    side, edge_points = _sides(x, faces, normal)
    support_distance = _from_supports(x, supported, middle)
    total = np.maximum(np.bincount(side, area), np.finfo(float).tiny)
    mean_distance = np.bincount(side, area * (support_distance + 0.2 * size)) / total
    mean_height = np.bincount(side, area * normal[:, 2]) / total
    rating = total * mean_distance * (1.5 + mean_height)
    chosen = side == np.argmax(rating)
    if len(struck):
        in_group = np.isin(faces, struck).all(axis=1)
        chosen = in_group if in_group.any() else chosen
    edge_distance = np.full(len(faces), size)
    for number in np.unique(side[chosen]):
        if len(edge_points[number]):
            on_side = side == number
            edge_distance[on_side] = cKDTree(edge_points[number]).query(middle[on_side])[0]
    clearance = (np.minimum(edge_distance, ROOM * size) + ROOM * edge_distance) * (
        support_distance + ROOM * size
    )
    clearance[supported[faces].any(axis=1)] = 0.0
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    tree = cKDTree(middle)
    ranked = np.lexsort((-clearance, -rating[side], ~chosen, fixed))
    for best in ranked[: (~fixed).sum() or None]:
        if not chosen[best] and len(edge_points[side[best]]):
            edge_distance[best] = cKDTree(edge_points[side[best]]).query(middle[best])[0]
        neighbours = np.array(tree.query_ball_point(middle[best], UNDER_PATCH * lengths[best]))
        longest = float(lengths[neighbours[side[neighbours] == side[best]]].max())
        yield middle[best], -normal[best], float(edge_distance[best]), longest


def _outward(x: Array, faces: IntArray, normal: Array) -> Array:
    """Normals of a sheet, outward if it is closed, else upward."""
    from antiosc.io.facets import SIDES, oriented

    triangles = faces[:, :3]
    ends = np.sort(np.concatenate([triangles[:, list(side)] for side in SIDES]), axis=1)
    closed = (np.unique(ends, axis=0, return_counts=True)[1] == 2).all()
    if faces.shape[1] == 3 and closed:
        a, b, c = x[oriented(x, faces)[0]].transpose(1, 0, 2)
        volumes = np.einsum("ni,ni->n", np.cross(b - a, c - a), normal)
    else:
        volumes = normal @ UP
    return np.asarray(normal * np.where(volumes < 0, -1.0, 1.0)[:, None])


def _from_supports(x: Array, supported: BoolArray, points: Array) -> Array:
    """Distances of points (n, 3) from the nearest fixed node; all equal for a free part."""
    if not supported.any():
        return np.ones(len(points))
    return np.asarray(cKDTree(x[supported]).query(points)[0])


def of_mesh(inspection: Inspection, mesh: Mesh) -> Inspection:
    """The inspection with the skin of another mesh of the part."""
    from antiosc.extension import Faces

    points = np.array(mesh.dolfinx.geometry.x)
    return replace(inspection, points=points, faces=_around(Faces(mesh, mesh.tdim < 3)))


def _around(outer: Faces) -> IntArray:
    """Corners of faces in cyclic order."""
    return outer.vertices[:, [0, 1, 3, 2] if outer.vertices.shape[1] == 4 else slice(None)]


def sides_of(x: Array, outer: Faces) -> IntArray:
    """Number of the smooth side of the part to which each outer face belongs."""
    return _sides(x, _around(outer), outer.normals)[0]


def _sides(x: Array, faces: IntArray, normal: Array) -> tuple[IntArray, dict[int, Array]]:
    """Number of the smooth side of each face; points on the edges of each side."""
    k = faces.shape[1]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), k)
    _, edge, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    starts = np.cumsum(count) - count
    pairs = [np.zeros((0, 2), dtype=int)]
    for first, second in combinations(range(4), 2):  # sheets join where three or four meet
        starts_of_edge = starts[count > second]
        pairs.append(
            np.stack([order[starts_of_edge + first], order[starts_of_edge + second]], axis=1)
        )
    neighbours = np.vstack(pairs)
    a, b = owner[neighbours].T
    neighbours = neighbours[np.abs(np.einsum("ij,ij->i", normal[a], normal[b])) > SAME_SIDE_COSINE]
    links = coo_matrix((np.ones(len(neighbours)), owner[neighbours].T), shape=(len(faces),) * 2)
    side = connected_components(links, directed=False)[1]
    at_edge = np.ones(len(owner), dtype=bool)
    at_edge[neighbours.ravel()] = False
    points = np.concatenate([x[ends[:, 0]], x[ends].mean(axis=1), x[ends[:, 1]]])
    of_side = np.tile(np.where(at_edge, side[owner], -1), 3)
    return side, {int(s): points[of_side == s] for s in np.unique(side)}


def _on_lines(
    x: Array, nodes: IntArray, supported: BoolArray, struck: IntArray
) -> Iterator[tuple[Array, Array, None]]:
    """Yields candidate sites of beams: nodes of the struck group or far from supports, across."""
    candidates = struck if len(struck) else np.unique(nodes)
    for best in candidates[np.argsort(-_from_supports(x, supported, x[candidates]), kind="stable")]:
        rows = nodes[(nodes == best).any(axis=1)]
        extents = np.abs(x[rows[:, 1]] - x[rows[:, 0]]).sum(axis=0)
        axis = int(np.argmin(extents[::-1]))  # z before y before x
        yield x[best], -np.eye(3)[2 - axis], None


def _on_rim(
    x: Array, faces: IntArray, supported: BoolArray
) -> Iterator[tuple[Array, Array, float]]:
    """Yields candidate sites of a plane part: edge middle, inward direction, radius; farthest
    first.
    """
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), faces.shape[1])
    edge, count = np.unique(np.sort(ends), axis=0, return_inverse=True, return_counts=True)[1:]
    outer = count[edge.ravel()] == 1
    a, b = x[ends[outer].T]
    middle = (a + b) / 2
    length = np.linalg.norm(b - a, axis=1)
    across = np.cross([0.0, 0.0, 1.0], b - a) / length[:, None]
    inward = x[faces[owner[outer]]].mean(axis=1) - middle
    across *= np.sign(np.einsum("ni,ni->n", across, inward))[:, None]
    support_distance = _from_supports(x, supported, middle)
    offset = np.abs(middle[:, 0] - x[:, 0].mean())
    for best in np.lexsort((offset, -np.round(middle[:, 1], 9), -support_distance)):
        yield middle[best], across[best], float(f"{1.05 * length[best]:.2g}")


def _radius(inscribed: float, edge: float, largest: float, meshed: bool) -> float:
    """Radius of the patch: inside its face, and on a given mesh at least the edges if they fit."""
    radius = min(RADIUS * inscribed, largest)
    if not meshed:
        largest_share = BEYOND_FACE if 1.05 * edge <= BEYOND_FACE * inscribed else 0.9
        radius = min(max(radius, 1.05 * edge), largest_share * inscribed)
    return float(f"{radius:.2g}")


def _rounded(values: Sequence[float] | Array, size: float = 1.0) -> list[float]:
    """Numbers rounded to a hundred-thousandth of a size."""
    return [float(c) + 0.0 for c in np.round(values, 5 - floor(log10(size)))]


#: Views (elevation, azimuth) [degrees] from which a part is drawn: the first that sees the struck
#: face well, by this least cosine, or the one that sees it best.
VIEWS = [
    (elevation, azimuth) for elevation in (24.0, -24.0) for azimuth in (-52.0, 128.0, 38.0, -142.0)
]
WELL_SEEN = 0.3


def _view(direction: Array) -> Array:
    """The view of a part that is struck in a direction (3,)."""
    elevation, azimuth = np.radians(VIEWS).T
    level = np.cos(elevation)
    towards = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
    cosines = -(direction @ np.array(towards)) / np.linalg.norm(direction)
    seen = cosines >= WELL_SEEN
    return np.array(VIEWS[int(np.argmax(seen if seen.any() else cosines))])


def draw(inspection: Inspection, path: Path, *, drop: bool = False) -> None:
    """Draw the part: its outer faces, and its supports and impact unless it is dropped."""
    from antiosc.plot.charts import save_figure
    from antiosc.plot.surfaces import Deformed, deformed_figure

    height = 1e3 * (inspection.points[:, 2] - inspection.points[:, 2].min())
    points, faces = inspection.points, inspection.faces
    if drop:
        label = "height over its lowest point (mm)"
        part = Deformed(points, points, faces, height, label, float(height.max()))
        figure = deformed_figure(part, whole_scale=True)
    else:  # each face has points of its own, so that it is held (yellow) or not (nan, grey)
        count = faces.shape[1]
        fixed = np.repeat(inspection.held[faces].any(axis=1), count)
        points = points[faces.ravel()]
        faces = np.arange(len(points)).reshape(-1, count)
        arrow = np.array(inspection.point), np.array(inspection.direction)
        shade = np.where(fixed, 1.0, np.nan)
        part = Deformed(points, points, faces, shade, "", 1.0)
        figure = deformed_figure(part, arrow=arrow, view=_view(arrow[1]), whole_scale=True)
        held_text = "yellow: held; " if fixed.any() else ""
        figure.text(0.02, 0.02, f"{held_text}red: where and how it is struck")
    save_figure(figure, path, dpi=100)


#: The geometry of a scene without a given part.
PLATE = """\
// A plate of 300 x 200 mm, held at one end; its size of elements is that of the scene.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.2};
Physical Surface("plate") = {1};
Physical Curve("clamp") = {4};
"""


def text(name: str, source: str, inspection: Inspection | None, drop: bool = False) -> str:
    """The scene as text; `source` is the part's file as the scene names it.

    `inspection`: that of the part, if it exists. `drop`: whether the part falls.
    """
    ending = Path(source).suffix.lower()
    deck = ending in DECK_ENDINGS if inspection is None else inspection.of_deck
    keys = (
        "unit",
        "size",
        "gdim",
        "merge",
        "density",
        "modulus",
        "piece",
        "contact",
        "fragments",
        "solid",
        "cells",
        "order",
        "timeout",
    )
    return rendered(
        Path(__file__).with_name("page") / "scene.toml",
        name=name,
        source=json.dumps(source, ensure_ascii=False),
        part=Path(source).name,
        deck=deck,
        closed=ending == ".stl",
        look=inspection,
        read=dict.fromkeys((*keys, "free", "order")) | dict(inspection.read if inspection else {}),
        family="Solid" if inspection is None else inspection.family,
        count=COUNTS["Solid"] if inspection is None else inspection.count,
        material=MATERIAL if inspection is None else inspection.material,
        point=[0.0, 0.0, 0.1] if inspection is None else inspection.point,
        direction=[0.0, 0.0, -1.0] if inspection is None else inspection.direction,
        band=_band(LARGEST_BALL if inspection is None else inspection.ball),
        ball=LARGEST_BALL if inspection is None else inspection.ball,
        ball_material=json.dumps(BALL_MATERIAL),
        drop=drop,
        groups=[] if inspection is None else _listed(inspection.groups),
        fall={
            "height": FALL_HEIGHT,
            "tilt": list(TILT),
            "until": IMPACTS,
            "friction": FRICTION,
            "floor": FLOOR_MATERIAL,
        },
        json=json.dumps,
    )


def _listed(groups: Sequence[str]) -> list[str]:
    """The names of groups as lines of a comment; of many lines the first."""
    blank = "\0"  # in place of a space in a name, at which no line may end
    quote = partial(json.dumps, ensure_ascii=False)
    runs = [[*map(quote, run)] for run in runs_of(groups)]
    words = [f"{run[0]} … {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs]
    names = ", ".join(word.replace(" ", blank).replace(f",{blank}", ", ") for word in words)
    lines = textwrap.wrap(names, WIDTH, break_long_words=False, break_on_hyphens=False)
    told = [line.replace(blank, " ") for line in lines[:MOST_LINES]]
    if len(lines) <= MOST_LINES:
        return told
    return [*told, f"… of {len(groups)} in all, which antiosc open shows: hold a face by name"]


def runs_of(groups: Sequence[str]) -> list[list[str]]:
    """Names of groups that differ in a number at their end alone as lists, if this counts on or
    stands in brackets, as in "face 7" and "hole 6 mm (2)".
    """
    runs: list[list[str]] = []
    last = ("", -1)
    for name in groups:
        found = ENDING_NUMBER.fullmatch(name)
        stem, number = (found[1], int(found[2])) if found else (name, -1)
        follows = stem == last[0] and number >= 0
        if follows and (stem.endswith("(") or number == last[1] + 1):
            runs[-1].append(name)
        else:
            runs.append([name])
        last = stem, number
    return runs


def _band(radius: float) -> float:
    """Highest frequency [Hz] that the impact of the scene excites, to two digits."""
    ball = Sphere(radius=radius, **STEEL, velocity=1.0)
    return float(f"{impact_band(ball, ball.hertz(STEEL['E'], STEEL['nu'])):.1e}")


def _picture(path: Path, about: str, draw_it: Callable[[Path], object]) -> list[str]:
    """The sentence that names a picture, after drawing it, or that an existing file is kept."""
    if path.exists():
        return [
            f"{path} exists already, and is left as it is: it does not show this scene; to have its"
            " picture, remove both, then write the scene anew."
        ]
    try:
        with progress.doing(f"drawing {path.name}"):
            draw_it(path)
    except AntioscError as error:
        return [f"{path.name} is not drawn: {error}"]
    return [f"{about}: {path}"]


def write_scene(
    path: str | os.PathLike[str],
    part: str | None = None,
    drop: bool = False,
    material: str | None = None,
    unit: str | None = None,
    timeout: float | None = None,
    size: float | None = None,
    piece: int | None = None,
    contact: str | None = None,
) -> tuple[Path, list[str]]:
    """Write a new scene file, complete or absent; returns its path and sentences on the part.

    `material`: name of the material of a part that is no deck; `unit`: unit of the file;
    `timeout` [s]: limit of each reading of the file; `size` [m]: largest cell, if it is asked for;
    `piece`: rank of the piece of the part that is read alone; `contact`: what becomes of the
    contact of a deck, "tied" or "apart".

    Raises
    ------
    AntioscError
        The file exists, the part cannot be read, or the material is unknown: nothing is written.
    """
    metal = materials.record(MATERIAL if material is None else material)
    if metal.G is not None:
        raise InputError(
            f"{metal.name} is not isotropic: write the scene with another material, then give "
            "its orientation with the name in [material]."
        )
    target = checks.new_file("the scene file", path)
    _absent(target)
    sentences: list[str] = []
    source = target.with_suffix(".geo") if part is None else Path(part)
    if part is None:
        _absent(source)
        files.write_text(source, PLATE, "the geometry")
        sentences.append(f"{source} is a plate to begin with; put your own part in its place.")
    else:
        checks.path("the file of the part", part)
    part = os.path.relpath(source, target.parent)
    if not f"{target.name}{part or ''}".isprintable():
        raise InputError(f"the name {checks.shown(part or target.name)} has control characters.")
    try:
        with progress.doing(f"looking at {source.name}"):
            inspection = inspect_part(source, drop, unit, timeout, size, piece, contact)
    except OSError as error:
        raise InputError(f"{source.name} could not be looked at: {error.strerror}.") from None
    if not inspection.of_deck:
        flat = None if inspection.flat is None else (metal.E, metal.nu)
        inspection = replace(inspection, material=metal.name, flat=flat)
    elif material is not None:
        raise InputError(
            f"{source.name} is a deck with materials of its own: leave --material away."
        )
    content = text(target.name, part, inspection, drop)
    temporary = files.part_name(target, ".toml")
    try:
        with temporary.open("x", encoding="utf-8") as stream:
            stream.write(content)
        try:
            if len(inspection.points) <= MOST_NODES:
                inspection = _tried(temporary, target.name, part, inspection, drop)
                temporary.write_text(text(target.name, part, inspection, drop), encoding="utf-8")
            os.link(temporary, target)  # fails if the target exists; a rename would replace it
        finally:
            temporary.unlink()
        files.clear_parts(target)
    except FileExistsError:
        _absent(target)
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {error.strerror}.") from None
    if inspection.of_size and not drop:
        inspection = replace(inspection, notes=(*inspection.notes, _of_this_size(inspection)))
    sentences += inspection.sentences(source.name, drop)
    pictures: dict[str, tuple[str, Callable[[Path], object]]] = {
        ".png": ("a picture of it", partial(draw, inspection, drop=drop))
    }
    if "piece" in inspection.read and inspection.pieces:
        boxes = partial(pieces.draw, inspection.pieces, chosen=inspection.read.get("piece"))
        pictures[pieces.ENDING] = ("its pieces, of which piece = 2 is the second", boxes)
    for ending, (caption, draw_it) in pictures.items():
        sentences += _picture(target.with_suffix(ending), caption, draw_it)
    return target, sentences


def _of_this_size(inspection: Inspection) -> str:
    """Sentence on what depends on a size of the cells that was asked for, which is no smaller than
    the usual one.
    """
    section = "[deck]" if inspection.of_deck else "[geometry]"
    return (
        "its site and its striker are chosen on cells of this size (size), and differ with another"
        f" one: to compare sizes, change size in {section} of one scene, which keeps both."
    )


def _tried(scene: Path, name: str, part: str, inspection: Inspection, drop: bool) -> Inspection:
    """The inspection after a trial impact, at another site if the first fails; InputError if all
    fail.
    """
    reason: AntioscError | None = None
    first = inspection.point, inspection.direction, inspection.radius, inspection.room
    for point, direction, radius, edge_distance in (first, *inspection.others):
        trial = replace(
            inspection, point=point, direction=direction, radius=radius, room=edge_distance
        )
        try:
            try:
                return _tried_at(scene, name, part, trial, drop)
            except RangeError as error:  # the contact of a smaller ball is smaller in proportion
                if radius is None or error.radius is None:
                    raise
                smaller = replace(trial, room=trial.ball * radius / error.radius)
                return _tried_at(scene, name, part, smaller, drop)
        except SiteError as error:
            reason = reason or error
        except (InputError, RangeError) as error:
            reason = reason or error
            break
    raise InputError(f"the part can be read, but not struck as it is: {reason}")


def _tried_at(scene: Path, name: str, part: str, inspection: Inspection, drop: bool) -> Inspection:
    """The inspection after a trial impact at its site, without error bars if these fail."""
    reason: InputError | None = None
    for bars in (True, False)[not inspection.bars :]:
        trial = replace(inspection, bars=bars)
        short_trial = replace(trial, count=min(trial.count, MOST_OSCILLATORS))
        scene.write_text(text(name, part, short_trial, drop), encoding="utf-8")
        try:
            trial = replace(trial, cell=_try(scene, inspection))
        except SiteError:
            raise
        except InputError as error:
            reason = reason or error
            continue
        if reason is None:
            return trial
        message = f"it is struck without error bars, for otherwise {reason}"
        return replace(trial, notes=(*trial.notes, message))
    assert reason is not None
    raise reason


def _try(scene: Path, inspection: Inspection) -> float | None:
    """Strike the part for a moment, or drop it once; InputError if that is refused.

    Returns the largest allowed cell [m] at the site, if the present cells there are larger.
    The structure of its deck is not read again.
    """
    document = read(scene)
    structure = inspection.structure
    for site in document.data.get("sites", {}).values():
        if inspection.radius is not None:
            site["radius"] = inspection.radius
    if "extract" in document.data:  # second-order forces take longer, and are those of the run
        document.data["extract"]["stretch"] = False
    on_patch = any("radius" in site for site in document.data.get("sites", {}).values())
    calls = compiled(document)
    evaluate = Evaluation(calls.document)
    if structure is not None and calls.structure is not None:
        evaluate.register(calls.structure, structure)
    hit = None
    try:
        with warnings_to(list[str]().append), progress.doing("a trial of the new scene"):
            if calls.history is not None:
                moment = TO_PEAK if on_patch else MOMENT
                hit = evaluate(_with(calls.history, duration=moment))
            if calls.fall is not None:
                evaluate(_with(calls.fall, until=1))
    except AntioscError as error:
        if isinstance(error, RangeError):
            raise
        kind = SiteError if isinstance(error.__cause__, SiteError) else InputError
        raise kind(without_line(error)) from None
    if hit is None:
        return None
    without_bars = replace(hit.model, strain_error=None, strain_misfit=None)
    cell = coarse_at(without_bars, "", hit.assembly.contact_time_estimate)
    return float(f"{cell.allowed:.1g}") if cell else None


def _with(call: Call, **options: object) -> Call:
    """A call with other arguments."""
    return replace(call, arguments={**call.arguments, **options})


def _absent(target: Path) -> None:
    """Raise InputError if a file exists."""
    if os.path.lexists(target):  # `exists` raises for a name that no system takes
        raise InputError(
            f"{str(target)!r} exists already, and is left as it is; choose another name."
        )
