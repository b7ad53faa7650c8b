"""The result of inspecting a part: its sizes, its guesses, and the words that tell them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import floor, inf, log, log10, pi, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antiosc import Sphere, impact_band
from antiosc.base import materials, progress
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.process import free_memory
from antiosc.base.texts import count_text, engineering, plain, rounded_down, rounded_up
from antiosc.io.reading import HOW_MADE
from antiosc_app.foreign import STEEL, Read
from antiosc_app.scene_file.outline import Outline
from antiosc_app.until_parted import OSCILLATORS, counts_from

if TYPE_CHECKING:
    from antiosc import Structure
    from antiosc.io.neutral import Piece

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
#: Radius of the ball of a new scene over that of the largest one that touches the site alone.
BALL_OVER_ROOM = 0.9
#: Distance over the size of the part below which two nodes are one.
SAME_PLACE = 1e-6
#: Number of rigid motions of a part that is free.
RIGID = 6
#: Largest number of groups that are named for a plane.
MOST_NAMED = 4
#: Largest number of groups that are named on the terminal.
MOST_NAMES = 12
#: Guessed thickness of a sheet over the longest side.
THICKNESS_RATIO = 0.005
#: Guessed diameter of a bar over the longest side.
DIAMETER_RATIO = 0.03
#: Tetrahedra in a cube whose side is the size that is asked of them, besides those that details
#: of the part ask for: 5.0 to 7.7 in six printed parts, at a half and a third of the first size.
CELLS_IN_CUBE = 7.5
#: Cells that a site on a face adds, and for each factor of e by which its cells are smaller: of a
#: block in cells of 5 and of 3 mm 2100, 2900, 3500, 4300 where they are 2, 4, 8, 20 times smaller.
#: All cells of six parts (6500 to 56 000 before) were 0.96 to 1.03 of the forecast.
CELLS_AT_SITE, CELLS_OF_GRADING = 1440, 955
#: Longest run of a new scene in periods of its impact's highest frequency: stresses are evaluated
#: at most 40 000 times, 13 in a period. With 2 s for a sheet of 6 m the largest stress was 297 %
#: off.
LONGEST_RUN = 3000
#: Floor of a fall of a new scene and of the page, and its coefficient of friction.
FLOOR_MATERIAL = "concrete C30/37"
FRICTION = 0.3
#: Height [m] of a fall of a new scene and of the page.
FALL_HEIGHT = 1.0
#: Tilt [degree] of the part, so that not all vertices of a face touch at once.
TILT: tuple[float, ...] = (10.0, 5.0, 0.0)
#: What a deck says of the strength of its materials.
NO_YIELD = "none is read of a deck: nothing is said of yield"
#: What becomes of the contact of a deck.
CONTACT_TEXTS = {"tied": "tied where closed", "apart": "left out"}
#: Lowest frequency of a plate of length L clamped at one end, over √(D/ρh)/L².
LOWEST_FREQUENCY = 0.56
#: Dimension of the cells of a family.
DIMENSIONS = {"Beam": 1, "Shell": 2, "Solid": 3}
#: Seconds of a model, or of a step of the page, from which they are told, and share of the free
#: memory from which a mesh is said to be large.
LONG, LARGE = 20.0, 0.5
#: Seconds of a whole answer of the page over those of its model, by the dimension of the cells:
#: mesh, impacts of the error bars, stresses and picture. Runs of curved panels of quadratic shells
#: took 3.9 times the forecast of the model (28 674 dofs, 41 s of one core) and 3.1 times (191 754
#: dofs, 217 s); a deck of 57 400 dofs, whose error is that to cells of half the size, 4.7 times its
#: models of 150 and 400 anti-oscillators (96 s); a block 2.8 times (55 000 dofs, 21 s).
ANSWER = {1: 3.0, 2: 4.7, 3: 3.0}


class Forecast(NamedTuple):
    """Rough numbers of cells and dofs of a mesh, and the cost of models on it, one after the other
    until the force has enough anti-oscillators.

    counts : number of anti-oscillators of each model, those after the first where the force needs
        more.
    ends : seconds until the end of each model.
    bytes, iterative : memory of the last model, and whether the solver iterates.
    answer : seconds until the page has shown all, or a run has written it.
    """

    counts: Sequence[int]
    cells: float
    dofs: float
    ends: Array
    bytes: float
    iterative: bool
    answer: float

    @property
    def seconds(self) -> float:
        """Seconds of all models."""
        return float(self.ends[-1])

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

    def lasting(self, seconds: float) -> str:
        """The shares of `seconds` in which the models end, in words: one of them is the time."""
        return progress.range_text([*(seconds / self.seconds * self.ends)])

    def told(self, seconds: float) -> Sequence[float]:
        """These shares, the shortest first; none of what does not take long."""
        return [*(seconds / self.seconds * self.ends)] if seconds > LONG else []

    def brief(self) -> str:
        """Cells, seconds of the whole answer, and memory in few words."""
        seconds = self.lasting(self.answer)
        solver = " (iterative solver)" if self.iterative else ""
        cells = float(f"{self.cells:.2g}")
        return f"{cells:.0f} cells, {seconds}, {plain(self.bytes / 1e9)} GB{solver}"

    def text(self) -> str:
        """The numbers in words."""
        models = "a model takes"
        if len(self.counts) > 1:
            numbers = ", ".join(map(str, self.counts))
            models = f"models of {numbers} anti-oscillators, until the force has enough, take"
        return (
            f"some {count_text(float(plain(self.dofs)))} dofs: {models} about"
            f" {self.lasting(self.seconds)} and {self.memory}; with mesh, error bars, stresses and"
            f" picture it is about {self.lasting(self.answer)}, and second-order forces come on top"
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
    material : name of the material; unused for a deck; asked : whether it was asked for.
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
    asked: bool = False
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

    @property
    def lasting_notes(self) -> list[str]:
        """The notes without those on how its mesh was made: one with other cells has its own."""
        return [note for note in self.notes if not any(words in note for words in HOW_MADE)]

    @property
    def divides(self) -> bool:
        """Whether the cells of a finished mesh become smaller around a point: no solids, no bars
        with hinges.
        """
        is_truss = self.kept and self.shape == "interval"
        return not self.meshed and self.family != "Solid" and not is_truss

    def forecast(
        self,
        size: float | None = None,
        n: int | None = None,
        grows: bool = False,
        near: Sequence[tuple[Sequence[float], float]] = (),
    ) -> Forecast:
        """Forecast of a model of `n` anti-oscillators with cells of another size [m]; `grows`: and
        of those with more that the force may need; `near`: (point, size) of smaller cells.

        Those of a finished mesh are halved, all of them; a geometry is meshed again, and has
        smaller cells near the points too.
        """
        from antiosc.extension import added_cells, halvings

        dim = DIMENSIONS[self.family]
        cells = float(self.n_cells)
        if size is not None and self.meshed and dim == 3:
            cubes, first = (self.measure / length**3 for length in (size, self.size))
            cells += CELLS_IN_CUBE * max(cubes - first, 0.0)
        elif size is not None:
            finer = self.size / size if self.meshed else 2.0 ** halvings(self.largest, size)
            cells *= finer**dim
        if near and self.structure is not None:
            cells += added_cells(self.structure, near)
        elif self.meshed and dim == 3:
            cells += sum(_cells_at_site((size or self.size) / local) for _, local in near)
        n = n or self.count
        one = forecast_of(self.shape, dim, cells, [n], self.dofs / self.n_cells)
        if not grows:
            return one
        return forecast_of(self.shape, dim, cells, counts_from(n, one.dofs), one.dofs / cells)

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

    def halved(self, count: int) -> float:
        """The cell size [m] that halves the cells of a finished mesh so many times."""
        return rounded_up(self.largest / 2**count)

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

    def heaviest_striker(self, mass: float) -> float:
        """A mass [kg], or the largest one beside the part's, to two digits."""
        heaviest = HEAVIEST * self.mass
        return min(mass, rounded_down(heaviest)) if heaviest > 0 else mass

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
        return float(f"{min(periods, LONGEST_RUN / impact_frequency(self.ball)):.1g}")

    def sentences(self, name: str, drop: bool = False) -> list[str]:
        """Text lines for the terminal; without the impact if the part is dropped."""
        kind = "materials are those of its deck" if self.of_deck else f"taken as {self.family}"
        outline = Outline(name, self.groups, self.low, self.high, 0.0)
        near = [(self.point, self.finest)] if self.finest and not drop else []
        forecast = self.forecast(n=OSCILLATORS[0], grows=True, near=near)
        cost = f" It has {forecast.text()}." if forecast.is_long else ""
        with_site = count_text(float(plain(forecast.cells)))
        cells = f"{self.cells}, some {with_site} with those at the site" if near else self.cells
        sentences = [f"{name}: {cells}, {self.sides_text()}; {kind}.{cost}"]
        sentences += [
            *(self.lasting_notes if near else self.notes),
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
            return f"{text}{self._thick(self.structure)}"
        return (
            f"{text}, taken as {1e3 * thickness:.4g} mm thick at first: the file has no thickness"
        )

    def _thick(self, structure: Structure) -> str:
        """Text: the thicknesses of the sheets of a deck, and that at the site."""
        from antiosc.extension import source
        from antiosc.reduce.site.surface import material_at

        parts = source(structure).materials_of(structure, None)
        known = [1e3 * one.thickness for one in parts if hasattr(one, "thickness")]
        if not known:
            return ""
        least, most = f"{min(known):.4g}", f"{max(known):.4g}"
        if least == most:
            return f", {least} mm thick"
        struck = material_at(structure, np.array(self.point), np.array(self.direction))
        at_site = f"{1e3 * struck.thickness:.4g} mm at the first site"
        return f", {least} to {most} mm thick ({at_site})"

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

    @property
    def strengths(self) -> list[str]:
        """Names of materials with a yield strength that are like one of a deck."""
        if self.structure is None:
            return []
        from antiosc.extension import source

        parts = source(self.structure).materials_of(self.structure, None)
        known = {(one.E, one.rho) for one in parts if hasattr(one, "yield_strength")}
        strong = [one for one in map(materials.record, materials.names()) if one.yield_strength]
        alike = materials.same_kind
        of_deck = (m for m in strong if any(alike((E, m.E), (rho, m.rho)) for E, rho in known))
        return [one.name for one in of_deck]

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
            alike = self.strengths
            like = f" ({alike[0]!r} and others are like it)" if alike else ""
            rows.append(("yield strength", NO_YIELD + like, "[deck] yield_strength"))
        else:
            guess = "" if self.asked else ", a guess: the file has none"
            rows.append(("material", f"{self.material}{guess}", "[material] name"))
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
            floor = f"{FLOOR_MATERIAL}, coefficient of friction {FRICTION:g}"
            return [
                *rows,
                ("fall", fall, "[drop] height, tilt"),
                ("floor", floor, "[drop.floor] material, friction"),
            ]
        rows.append(("held", self._held(), "[[supports]]"))
        site = f"{rounded_to(self.point)} m along {self.direction}"
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

    def plane_text(self) -> str:
        """Text of the plane whose nodes are held: "the underside, z = 0 mm"; "" without one."""
        if self.plane is None:
            return ""
        point, normal = self.plane
        axis = normal.index(1.0)
        side = "the side"
        if axis == 2:
            is_low = 2 * point[axis] < self.low[axis] + self.high[axis]
            side = "the underside" if is_low else "the top"
        return f"{side}, {'xyz'[axis]} = {1e3 * point[axis]:g} mm"

    def _held(self) -> str:
        """Text of the support."""
        if self.of_deck and not self.free_deck:
            return "as in the deck"
        if len(self.where) == 1:
            return f"at the group {self.where[0]!r}"
        if self.where:
            return f"at {len(self.where)} groups, {self.where[0]!r} to {self.where[-1]!r}"
        if self.plane:
            plane = self.plane_text()
            if self.foot:
                plane += ", a small foot of the part: hold what holds it in use"
            if not self.on_plane:
                return f"at the nodes on {plane}"
            return f"{', '.join(self.on_plane[:MOST_NAMED])}: the nodes on {plane}"
        return "nowhere: it is free"


def forecast_of(
    shape: str, dim: int, cells: float, counts: Sequence[int], of_cell: float
) -> Forecast:
    """Forecast of models in turn; the arguments are those of `before_meshing`."""
    from antiosc.extension import before_meshing

    until = [counts[: k + 1] for k in range(len(counts))]
    costs = [before_meshing(shape, dim, cells, some, of_cell) for some in until]
    dofs, cost = costs[-1]
    ends = np.array([cost.seconds for _, cost in costs])
    answer = ANSWER[dim] * float(ends[-1])
    return Forecast(counts, cells, dofs, ends, cost.bytes, cost.iterative, answer)


def forecast_of_parts(structure: Structure, counts: Sequence[int]) -> Forecast | None:
    """Forecast of models of so many anti-oscillators, in turn; None where no part has a mesh.

    With several ranks, of the time and memory of this one.
    """
    from antiosc.extension import with_parts

    if not (structure.matrices.meshed or structure.matrices.assembled):
        return None
    meshes = [(member.part.mesh, member.part.rows) for member in with_parts(structure).members()]
    if not meshes:  # of superelements
        return None
    forecasts = [
        forecast_of(mesh.cell, mesh.tdim, float(mesh.n_cells), counts, rows / mesh.n_cells)
        for mesh, rows in meshes
    ]
    _, *numbers = zip(*forecasts, strict=True)
    return Forecast._make((counts, *map(sum, numbers)))


def _cells_at_site(finer: float) -> float:
    """Cells that a site on a face adds whose cells are `finer` times smaller; 0 of no smaller."""
    return CELLS_AT_SITE + CELLS_OF_GRADING * log(finer) if finer > 1 else 0.0


def _in_mm(length: float) -> str:
    """A length [m] in millimetres, with four digits or those before its point."""
    text = np.format_float_positional(1e3 * length, 4, unique=False, fractional=False, trim="-")
    return str(text)


def _ball_density() -> float:
    """Density [kg/m³] of the ball of a new scene."""
    return materials.record(BALL_MATERIAL).rho


def largest_ball_on(length: float) -> float:
    """Largest radius [m] of the ball for a part whose longest side is `length` [m]."""
    return max(LARGEST_BALL, float(f"{BALL_OVER_SIZE * length:.1g}"))


def aligned(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """Rows of a table as lines of text with aligned columns."""
    first, second = (max(len(row[k]) for row in rows) for k in (0, 1))
    return [f"  {a:<{first}}  {b:<{second}}  {c}" for a, b, c in rows]


def rounded_to(values: Sequence[float] | Array, size: float = 1.0) -> list[float]:
    """Numbers rounded to a hundred-thousandth of a size."""
    return [float(c) + 0.0 for c in np.round(values, 5 - floor(log10(size)))]


def impact_frequency(radius: float) -> float:
    """Highest frequency [Hz] that the impact of the scene excites, to two digits."""
    ball = Sphere(radius=radius, **STEEL, velocity=1.0)
    return float(f"{impact_band(ball, ball.hertz(STEEL['E'], STEEL['nu'])):.1e}")
