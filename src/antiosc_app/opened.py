"""`antiosc open`: a part that is struck on a page, from its file to a scene that is saved.

The page sends its whole set-up with every call: material, supports, site and striker. A set-up is
turned into a scene, and an impact is a run of that scene, so that a saved scene gives the same
numbers. Structures and models are cached; one thread computes.

A click is answered in three steps: by a model from free modes if these are known, which takes one
solve; by the extracted model with its error bars; and with motion and stress for the picture.
"""

from __future__ import annotations

import contextlib
import json
import shlex
import threading
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

import antiosc
from antiosc import AntiOscillators, History, ImpactMap
from antiosc.base import checks, materials, progress
from antiosc.base.errors import (
    AntioscError,
    ChoiceWarning,
    InputError,
    by_weight,
    warn,
    warnings_to,
    weight,
    without_warnings,
)
from antiosc.base.process import one_thread
from antiosc.base.progress import print_text
from antiosc.base.texts import (
    capitalised,
    count_text,
    engineering,
    on_page,
    percent,
    plain,
    rounded_down,
    rounded_up,
)
from antiosc.extension import (
    foreseen_map,
    halvings,
    stress_seconds,
    with_parts,
    with_stresses,
)
from antiosc.models.auto_contact import AUTO
from antiosc.models.body import ModelInfo, coarse_at, info_of
from antiosc.models.doubts import NO_RESULT
from antiosc.reduce.site.map_sites import Radius, Resolved
from antiosc_app import falls, live, live_data, report, results
from antiosc_app.headline import (
    Headline,
    force_bar,
    headline_of_history,
    headline_of_map,
    largest_stress,
    most_stressed,
)
from antiosc_app.inspecting import inspect_part, inspect_structure, of_mesh
from antiosc_app.inspection import (
    CONTACT_TEXTS,
    LONG,
    Forecast,
    Inspection,
)
from antiosc_app.kept import FreeModeCache, ResultCache
from antiosc_app.live import Data
from antiosc_app.scene_file import run
from antiosc_app.scene_file.build import Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import (
    Document,
    Problems,
    SceneFileError,
    read as read_document,
    without_line,
)
from antiosc_app.scene_file.scene import CompiledScene, by_strengths, worst_by_strengths
from antiosc_app.set_up import (
    FINER,
    FIRST,
    FLOOR,
    FLOORS,
    HAMMERS,
    LAYERS,
    MATERIALS,
    MOST_OSCILLATORS,
    MOST_STRESSED,
    NO_LAYER,
    OWN,
    SENSOR,
    SENSOR_OF_FALL,
    STRIKERS,
    InspectedFile,
    SetUp,
    Striker,
    Table,
    constants_of,
    face_of,
    read,
    scene_of,
    toml,
)
from antiosc_app.until_parted import (
    DURATION,
    LONGER,
    Choice,
    duration_of_map,
    expansion_of,
    next_count,
    tell_radius,
    until_parted,
    why_more,
)
from antiosc_studies.drops.body import CORNER, MODES, RATIO, free_body

if TYPE_CHECKING:
    from antiosc import Fall, Mesh, PeakField, Site, Structure
    from antiosc.extension import MapForecast
    from antiosc.io.neutral import Piece
    from antiosc_studies.drops.fall import WorstField
    from antiosc_studies.drops.free_body import FreeBody

#: Share of the sites of a map that may stay without an answer, since their patch is too small for
#: the force; above it the patches grow. On a pin of PLA with cells of 0.15 mm it was a third.
UNANSWERED = 0.02
#: A step of an answer, a function of the set-up and of the other values that the page sends.
Step: TypeAlias = Callable[[SetUp, Table], Data]

#: Number of structures in the cache.
STRUCTURES = 2
#: Number of falls and of impacts in the cache, and of models: with its shapes and those of its
#: stretching one of 77 000 dofs has 85 MB.
FALLS = 10
IMPACTS = 2
MODELS = 12
#: Number of meshes, of 20 to 60 MB each with 60 000 cells of order 2: no model outlives its mesh,
#: and Undo finds it again. If it were made anew it may be another one, since the mesher begins with
#: the attempt that succeeded last.
MESHES = MODELS
#: Number of browser tabs whose latest call is known.
TABS = 100
#: Largest number of improvements of an impact by its error bar.
MOST_IMPROVED = 5
#: Share of the error of the force by mesh and patch from which the page takes smaller cells at the
#: site. A printed bar of 13.6 × 5 × 100 mm in cells of 5 mm had 290 %, and 10 % in finer cells.
MOST_OF_CELLS = 0.3
#: Longest answer [s] with smaller cells of a finished mesh that the page takes by itself.
REFINED_SOON = 60.0
#: Upper end of the bar of the largest stress, most of it by the cells there, from which the page
#: goes on with smaller ones, if that may take less than so many seconds: a knob of STL had +750 %,
#: and +210 % in 110 s more, where the least that was foreseen was above 180 s.
MOST_OF_STRESS, NARROWED_SOON = 1.0, 300.0
#: Beside the first number where better ones follow by themselves.
COARSE = "coarse mesh, refining …"
FEW = "few anti-oscillators, more follow …"
#: The stress of the blows on a map that takes longer [s] is asked for, with as many sites as take
#: so long; at least so many sites.
SOON, FEWEST = 60.0, 10
#: Seconds of stresses over those that were forecast: 0.77 to 1.3 on a plate of 3 mm with 50 modes,
#: and on the bracket with 20, of 0.5 to 5 ms; by a search of random numbers 0.58 to 4.0.
FORECAST = (0.7, 1.5)
#: Seconds of a fall with its free modes and stresses over those of a model with as many
#: anti-oscillators: 1.6 with 339 000 dofs; 7 to 11 with 33 000 to 149 000 beside other work, which
#: left it a third of a core.
OF_FALL = (1.5, 8.0)
#: Most seconds of the site of a map that is struck by itself, over those of its model, as it has
#: error bars.
ALONE = 2.0
#: Words of notes on pieces, which the page lists.
OF_PIECES = ("the others are not", "it falls into", "of its pieces")
#: Finer cell sizes that are offered, and over that of a geometry the next one.
MOST_STEPS, STEP = 4, 1.5
#: Rank that stands for all pieces joined, its words, and what another tab is told.
JOINED, ALL = 0, "all joined"
ANOTHER = "another piece of the file was opened meanwhile: load this page again."
#: Sections of a scene on which the mesh depends, the structure, and its model.
OF_MESH = ("geometry",)
OF_STRUCTURE = ("geometry", "deck", "material", "supports")
#: What is told of a deck where the page holds nothing.
HELD_BY_DECK = "held as in the deck, and what is held here besides"
FREE_DECK = "free: the deck holds it nowhere"
OF_MODEL = (*OF_STRUCTURE, "sites", "extract")


class Overtaken(BaseException):
    """The page no longer waits for the work.

    It is no Exception, so that no computation catches it as one of its errors.
    """


class PageImpact(NamedTuple):
    """An impact with its scene and inputs; `settled`: by the extracted model, with no better one to
    come; `refining`: what a better one has; `file`: name of the part's file, with the piece.
    """

    sections: Table
    scene: CompiledScene
    structure: Structure
    model: AntiOscillators
    hit: History
    settled: bool
    file: str
    refining: str = ""


class Dropped(NamedTuple):
    """A fall and its scene."""

    sections: Table
    scene: CompiledScene
    fall: Fall

    @property
    def worst(self) -> WorstField | None:
        """The largest stress by the criterion nearest to its limit; None if no strength is
        known.
        """
        if self.fall.body.structure is None:
            return None
        return worst_by_strengths(self.fall)


def never() -> bool:
    """Never stop."""
    return False


class Opened:
    """A part that is open in a browser; it answers the calls of the page.

    Parameters
    ----------
    path : path of its file; results are saved beside it.
    structure : instead of a file, with its material and supports; nothing is saved.
    unit : unit of the file; None: it is guessed.
    timeout : limit [s] of reading the file; None: by its kind and size.
    size : largest cell [m]; None: as `antiosc new` takes it.
    piece : rank of the piece that is opened; None: as `antiosc new` takes them.
    contact : what becomes of the contact of a deck, "tied" or "apart"; None: likewise.
    """

    def __init__(
        self,
        path: Path,
        structure: Structure | None = None,
        unit: str | None = None,
        timeout: float | None = None,
        size: float | None = None,
        piece: int | None = None,
        contact: str | None = None,
    ) -> None:
        self._path = path
        self._given = structure
        self._unit = unit
        self._timeout = timeout
        self._size = size
        self._work = ThreadPoolExecutor(max_workers=1, thread_name_prefix="antiosc")
        self._waiting = 0
        self._lock = threading.Lock()
        self._turns: ResultCache[int] = ResultCache(TABS)
        self._structures: ResultCache[Structure] = ResultCache(STRUCTURES)
        self._meshes: ResultCache[Mesh] = ResultCache(MESHES)
        self._models: ResultCache[AntiOscillators] = ResultCache(MODELS)
        self._impacts: ResultCache[PageImpact] = ResultCache(IMPACTS)
        #: the stresses of the last impact
        self._stresses: ResultCache[dict[str, PeakField]] = ResultCache(1)
        self._modes: ResultCache[FreeModeCache] = ResultCache(STRUCTURES)
        self._bodies: ResultCache[FreeBody] = ResultCache(STRUCTURES)
        #: key of a mesh, and the last free body on it, whose modes others may take
        self._falls: ResultCache[Dropped] = ResultCache(FALLS)
        self._mapped: ResultCache[ImpactMap] = ResultCache(1)
        self._map_costs: ResultCache[MapForecast] = ResultCache(TABS)
        self._sites: ResultCache[Site | None] = ResultCache(TABS)
        self._source: InspectedFile | None = None
        self._first: Data = {}
        #: the answer to `look`, of the opening that it names
        self._seen: Data = {}
        #: the part as its file was read first, the piece that was taken then, and the number of
        #: parts that were opened
        self._whole: Inspection | None = None
        self._piece = piece
        self._contact = contact
        self._opening = 0
        self._doing = ""
        #: when the present answer may end [s], when it began, and the scene that it has written
        self._ends: Sequence[float] = ()
        self._began = time.monotonic()
        self._written = ""
        #: whether a structure is being built: it is completed, the next set-up mostly has the same
        self._building = False
        #: whether the last answer is whole: free modes are not searched between its steps
        self._is_whole = False
        self._closed = False
        #: name in an address -> report that was written
        self.reports: dict[str, Path] = {}
        #: the site that was struck last
        self.site: Site | None = None

    @property
    def calls(self) -> dict[str, Callable[[Table], object]]:
        """Name of a call of the page -> the function that answers it."""
        steps: dict[str, Step] = {"blow": self._blow, "settle": self._settle}
        steps |= {
            "fields": self._fields,
            "verdict": self._verdict,
            "speeds": self._speeds,
            "map": self._map,
            "map_forecast": self._foreseen_map,
            "write": self._write,
        }
        answers = {name: partial(self._in_turn, step) for name, step in steps.items()}
        return {
            **answers,
            "stop": self._stop,
            "look": self._looked,
            "take": lambda values: self._computed(partial(self._take, values)),
            "save": self._names,
            "forecast": self._forecast,
            "progress": self._progress,
        }

    @property
    def warm(self) -> bool:
        """Whether all free modes of the last structure are known, so that a click is answered from
        them.
        """
        modes = next(reversed(self._modes.values()), None)
        return modes is not None and not modes.left

    def close(self) -> None:
        """Accept no further work; what is being computed ends at its next step."""
        self._closed = True
        self._work.shutdown(wait=False, cancel_futures=True)

    # -- one thread computes

    def _progress(self, _: Table) -> Data:
        """What is done, for how long [s] the answer is computed, and what is expected of that."""
        lasted = time.monotonic() - self._began
        takes = progress.foreseen_text(self._ends, lasted)
        return {"doing": self._doing, "lasted": lasted, "takes": takes, "written": self._written}

    def _computed(
        self,
        work: Callable[[], Data],
        stops: Callable[[], bool] = never,
        finer: bool = False,
        goes_on: bool = False,
    ) -> Data:
        """The result of `work` in the computing thread, with its warnings and their weights.

        {"stale": True} where `stops` has become true during the work. `finer`: whether its mesh is
        refined at the site already; `goes_on`: whether it belongs to the answer before.
        """

        def stop_if_asked(doing: str) -> None:
            self._doing = doing
            if doing and (self._closed or (not self._building and stops())):
                raise Overtaken

        def run_work() -> Data:
            self._count(-1)
            if not goes_on:
                self._began = time.monotonic()
            messages: list[str] = []
            with progress.following(stop_if_asked), warnings_to(messages.append):
                try:
                    result = work()
                except Overtaken:
                    return {"stale": True}
                except SceneFileError as error:  # the page knows no lines
                    raise InputError(without_line(error)) from None
                finally:
                    self._ends, self._written = (), ""
            caution, verdict = result.get("caution", ""), result.get("verdict", ())
            source = self._source
            notes = [] if source is None else source.look.lasting_notes
            warnings = by_weight(messages, " ".join([caution, *verdict, *notes]))
            texts = [[weight(one), capitalised(on_page(str(one)))] for one in warnings]
            return result | {"warnings": texts}

        self._count(1)
        try:
            return self._work.submit(run_work).result()
        except CancelledError:  # the program ends
            return {"stale": True}

    def _count(self, change: int) -> None:
        """Change the number of calls that wait for the computing thread."""
        with self._lock:
            self._waiting += change

    def _turn(self, values: Table) -> tuple[str, int]:
        """(tab, number) of a call: the browser tab, and the number of its set-up."""
        tab = checks.text("tab", values.get("tab"))
        turn = checks.whole("turn", values.get("turn"), least=0)
        self._turns[tab] = max(turn, self._turns.of(tab, lambda: turn))
        return tab, turn

    def _stop(self, values: Table) -> Data:
        """Stop the work of earlier turns of a tab, whose page shows the answer to `setup` again."""
        self._turn(values)
        if "setup" in values:
            self.site = self._sites.get(repr(read(values["setup"])), self.site)
        return {}

    def _in_turn(self, step: Step, values: Table) -> Data:
        """The answer of a step; {"stale": true} if a later request of the same tab has replaced it,
        before the step or during it. Files that are being written are completed.
        """
        tab, turn = self._turn(values)
        if values.get("opening", self._opening) != self._opening:
            raise InputError(ANOTHER)
        set_up = read(values.get("setup"))

        def overtaken() -> bool:
            return self._turns.get(tab, turn) > turn

        writes = step == self._write

        def work() -> Data:
            if overtaken():
                return {"stale": True}
            if step not in (self._map, self._foreseen_map):
                self._ends = self._saving(set_up) if writes else self._answering(set_up)
            return step(set_up, values)

        stops = never if writes else overtaken
        goes_on = step in (self._settle, self._fields, self._verdict, self._speeds)
        return self._computed(work, stops, set_up.is_finer, goes_on)

    def _search_modes(self) -> None:
        """Compute a round of free modes of the last structure, unless the page waits or its answer
        has steps to come: of a bracket of 174 000 dofs that took 111 s with rounds between these,
        and 52 s without.

        A call that comes meanwhile waits for its end, and is told so.
        """

        def tell(doing: str) -> None:
            self._doing = doing and f"completing what later clicks need: {doing}"

        if not self._structures or self._waiting or not self._is_whole:
            return
        self._began = time.monotonic()
        key, structure = next(reversed(self._structures.items()))
        modes = self._modes.of(key, lambda: FreeModeCache(structure))
        # without them every click is extracted
        with contextlib.suppress(AntioscError), progress.following(tell):
            if modes.left and modes.search() and not self._closed:
                self._work.submit(self._search_modes)

    # -- the part

    def _looked(self, _: Table) -> Data:
        """The content of the file, at once where it is known: a page that is loaded again waits
        for no computation.
        """
        if self._seen.get("opening") != self._opening:
            self._seen = self._computed(self._look)
        return self._seen

    def _look(self) -> Data:
        """The content of the file: the skin, its faces, and an initial set-up."""
        if self._first:
            return self._first
        from antiosc_app.skin import over_half, places, skin

        inspection = self._inspected()
        if self._size is not None:
            print_text(f"{self._path.name}: {inspection.cells}, {inspection.forecast().text()}")
        self._source = InspectedFile(self._path.name, inspection, {})
        self._opening += 1
        thickness = (
            None if inspection.family == "Solid" or inspection.of_deck else inspection.thickness
        )
        set_up = SetUp(
            point=tuple(inspection.point),
            direction=tuple(inspection.direction),
            material="" if inspection.of_deck else FIRST,
            thickness=thickness,
            striker=Striker(radius=inspection.ball, mass=inspection.heaviest_striker(Striker.mass)),
            finer=True if inspection.plate and inspection.meshed else None,
        )
        scene = self._compiled(scene_of(self._source, set_up, DURATION))
        structure = self._structure(scene)
        shape, faces, faces_held = skin(structure, inspection)
        self._source = self._source._replace(faces=faces)
        self._first = {
            "name": self._path.name,
            "opening": self._opening,
            "pieces": self._pieces(inspection),
            "piece": inspection.read.get("piece", JOINED),
            "contact": inspection.read.get("contact", ""),
            "contacts": CONTACT_TEXTS if "contact" in inspection.read else {},
            "told": _told_of_file(inspection, self._path.name),
            "mass": _mass(inspection),
            "first_striker": f"The first striker is a {inspection.ball_text()}.",
            "first_held": _first_held(inspection),
            "first_material": _first_material(inspection),
            "skin": shape,
            "faces": list(faces),
            "large_faces": over_half(shape, list(faces)),
            "places": places(shape, list(faces)),
            "materials": [] if inspection.of_deck else [*MATERIALS, OWN],
            "constants": {name: asdict(constants_of(name)) for name in MATERIALS},
            "same_kind": materials.SAME_KIND,
            "strikers": STRIKERS,
            "striker_materials": [*MATERIALS, OWN],
            "hammers": HAMMERS,
            "floors": FLOORS,
            "layers": [NO_LAYER, *LAYERS],
            "moduli": {name: modulus for name, (modulus, *_) in LAYERS.items()},
            "fall": {"damping": RATIO, "corner_radius": _corner(inspection)},
            "family": inspection.family,
            "geometry": inspection.meshed,
            "refines": inspection.meshed or (inspection.divides and self._given is None),
            "size": 0.0 if self._given or inspection.kept else inspection.size,
            "sizes": [] if self._given or inspection.kept else _finer_sizes(inspection),
            "most_n": MOST_OSCILLATORS,
            "most_stressed": MOST_STRESSED,
            "unstated": {key: inspection.read[key] for key in inspection.unstated()},
            "unheld": self._unheld(inspection),
            "n": inspection.count,
            "saves": self._given is None,
            "yields": _may_yield(structure),
            "strengths": inspection.strengths if self._given is None else [],
            "engine": live.engine(),
            "setup": asdict(replace(set_up, held=tuple(faces_held))),
        }
        return self._first

    def _inspected(self) -> Inspection:
        """The inspected part, or the piece of it that was taken."""
        if self._given is not None:
            return inspect_structure(self._given)
        look = partial(
            inspect_part,
            self._path,
            unit=self._unit,
            timeout=self._timeout,
            size=self._size,
        )
        with progress.doing(f"looking at {self._path.name}"):
            if self._whole is None:
                self._whole = look(contact=self._contact)
            if self._piece in (None, self._whole.read.get("piece", JOINED)):
                return self._whole
            return look(piece=self._piece, contact=self._contact, whole=self._whole)

    def _take(self, values: Table) -> Data:
        """Open another piece of the part, or all of them joined, or with another choice of its
        contact; the page then looks anew.
        """
        if "contact" in values:
            contact = checks.choice("contact", values["contact"], tuple(CONTACT_TEXTS))
            self._open_anew(None, contact, None)
            return {}
        piece = checks.whole("piece", values.get("piece"), least=JOINED)
        if piece == JOINED and (self._whole is None or "piece" in self._whole.read):
            raise InputError(f"the pieces of {self._path.name} are not joined.")
        self._open_anew(piece, self._contact, self._whole)
        return {}

    def _open_anew(self, piece: int | None, contact: str | None, whole: Inspection | None) -> None:
        """Look at the part anew; if that fails, the one before stays."""
        before = self._piece, self._contact, self._whole, self._first, self._source
        self._piece, self._contact, self._whole, self._first = piece, contact, whole, {}
        try:
            self._look()
        except BaseException:
            self._piece, self._contact, self._whole, self._first, self._source = before
            raise
        for known in (self._impacts, self._stresses):  # of the part before
            known.clear()

    def _pieces(self, look: Inspection) -> list[tuple[int, str]]:
        """The pieces of the part by their ranks, in words, with all joined if they were so."""
        joined = [] if self._whole is None or "piece" in self._whole.read else [(JOINED, ALL)]
        told = [(rank, _piece_text(rank, piece)) for rank, piece in enumerate(look.pieces, 1)]
        return [*joined, *told] if told else []

    def _unheld(self, look: Inspection) -> str:
        """What is told where the page holds nothing."""
        if self._given is not None or not look.of_deck:
            return "free: no face is held"
        return FREE_DECK if look.free_deck else HELD_BY_DECK

    # -- a set-up as a scene, and its objects

    def _compiled(self, sections: Table) -> CompiledScene:
        """A scene compiled as if it were read from its file."""
        text = toml(sections)
        path = self._path.with_suffix(".toml")
        return compiled(Document(path, tomllib.loads(text), Problems(path.name, text)))

    def _structure(self, scene: CompiledScene) -> Structure:
        """The structure of a scene."""
        key = _key(scene, OF_STRUCTURE)
        structure = self._given
        if structure is not None:
            return self._structures.of(key, lambda: structure)
        call = scene.structure
        self._building = True
        try:
            evaluate = self._of_mesh(scene)  # it is used, and stays as long as its structures
            return self._structures.of(key, lambda: evaluate(call))
        finally:
            self._building = False

    def _of_mesh(self, scene: CompiledScene) -> Evaluation:
        """The evaluation of a scene whose mesh is known: other supports keep it."""
        evaluate = Evaluation(scene.document)
        assert scene.structure is not None
        call = scene.structure.arguments.get("mesh")
        if call is not None:  # a deck has none
            mesh = self._meshes.of(_key(scene, OF_MESH), lambda: Evaluation(scene.document)(call))
            evaluate.register(call, mesh)
        return evaluate

    def _extracted(self, scene: CompiledScene) -> AntiOscillators:
        """The extracted model of a scene."""

        def extracted() -> AntiOscillators:
            evaluate = _evaluation(scene, structure=self._structure(scene))
            model: AntiOscillators = evaluate(scene.model)
            return model

        return self._models.of(_key(scene, OF_MODEL), extracted)

    def _from_modes(self, scene: CompiledScene) -> AntiOscillators | None:
        """The model from free modes; None if these are unknown, or the model was extracted."""
        modes = self._modes.get(_key(scene, OF_STRUCTURE))
        key = _key(scene, OF_MODEL)
        if modes is None or key in self._models or scene.model is None:
            return None
        return modes.model(key, scene.model.arguments["site"].made)

    def _struck(self, set_up: SetUp, quickly: bool = False) -> PageImpact:
        """The impact of a set-up, run for its duration or until striker and part have parted.

        `quickly`: by a model from free modes, if they are known.
        """
        if set_up.striker.kind == FLOOR:
            raise InputError("a fall has no map: choose a ball, a mass or a hammer.")
        key = repr(set_up)
        known = self._impacts.get(key)
        if known is not None and not (known.settled or quickly):
            del self._impacts[key]
        blow = self._impacts.of(key, partial(self._until_parted, set_up, quickly))
        assert blow.scene.model is not None
        self.site = blow.scene.model.arguments["site"].made
        self._sites[key] = self.site
        return blow

    def _until_parted(self, set_up: SetUp, quickly: bool) -> PageImpact:
        """The impact of a set-up that is not known yet; `quickly` as in `_struck`."""
        if set_up.finer and set_up.near is None and self._opened().look.divides:
            with without_warnings():  # those of its large cells
                before = self._struck(replace(set_up, finer=False, stressed=()), quickly=True)
            set_up = replace(set_up, near=_near(before))
        source = self._in_cells_of(set_up)
        is_sheet = source.look.family == "Shell"
        longest = max(LONGER * DURATION, source.look.duration if is_sheet else 0.0)
        asked = set_up
        choice = Choice(
            asked.radius,
            asked.duration or DURATION,
            asked.radius is not None,
            asked.duration is not None,
        )

        def run(choice: Choice) -> PageImpact:
            chosen = replace(set_up, radius=choice.radius)
            return self._run(scene_of(source, chosen, choice.duration), quickly)

        reasons: dict[str, str] = {}  # the last one of each kind
        for _ in range(MOST_IMPROVED):
            messages: list[str] = []  # of the impact that is shown
            with warnings_to(messages.append):
                blow, choice = until_parted(
                    run, lambda blow: blow.hit, choice, longest=longest, is_sheet=is_sheet
                )
            set_up = replace(set_up, radius=choice.radius)
            if not blow.settled:
                break
            stays = self._given is not None
            better, why = _with_less_error(asked, set_up, blow, source.look, stays)
            if better == set_up:
                break
            if quickly:
                blow = blow._replace(settled=False, refining=COARSE if "cells" in why else FEW)
                break
            set_up = better
            source = self._in_cells_of(set_up)
            reasons |= why
        tell_radius(asked.radius, set_up.radius)
        for reason in reasons.values():
            warn(reason, ChoiceWarning)
        for message in messages:
            warn(message)
        return blow

    def _run(self, sections: Table, quickly: bool) -> PageImpact:
        """The impact of a scene; `quickly` as in `_struck`."""
        scene = self._compiled(sections)
        structure = self._structure(scene)
        approximate = self._from_modes(scene) if quickly else None
        model = approximate or self._extracted(scene)
        evaluate = _evaluation(scene, structure=structure, model=model)
        hit: History = evaluate(scene.history)
        settled = approximate is None
        return PageImpact(sections, scene, structure, model, hit, settled, self._file())

    def _file(self) -> str:
        """Name of the opened file, with its piece; "" of a structure that was given."""
        return "" if self._given is not None else self._opened().told

    def _opened(self) -> InspectedFile:
        """The opened part; InputError before that."""
        if self._source is None:
            raise InputError("the part is not open yet.")
        return self._source

    def _in_cells_of(self, set_up: SetUp) -> InspectedFile:
        """The opened part with the skin of its mesh in the size of a set-up."""
        source = self._opened()
        if set_up.size is None or source.look.family != "Solid":
            return source
        scene = self._compiled(scene_of(source, replace(set_up, finer=False), DURATION))
        mesh = self._structure(scene).mesh
        return source._replace(look=of_mesh(source.look, mesh))

    def _dropped(self, set_up: SetUp) -> Dropped:
        """The fall of a set-up."""
        sections = scene_of(self._opened(), set_up, DURATION)

        def dropped() -> Dropped:
            scene = self._compiled(sections)
            evaluate = _evaluation(scene, structure=self._body(scene, set_up))
            return Dropped(sections, scene, evaluate(scene.fall))

        return self._falls.of(toml(sections), dropped)

    def _body(self, scene: CompiledScene, set_up: SetUp) -> FreeBody:
        """The free body of a fall's part, for all floors, heights and orientations."""
        structure = self._structure(scene)
        options = set_up.damping, set_up.striker.corner_radius

        def body() -> FreeBody:
            with one_thread(), progress.doing("computing the free modes"):
                return free_body(structure, MODES, *options)

        return self._bodies.of(_key_of_body(scene, set_up), body)

    # -- the steps of an answer

    def _blow(self, set_up: SetUp, _: Table) -> Data:
        """First answer to a click: the impact, by free modes if they are known."""
        self._is_whole = False
        if set_up.striker.kind == FLOOR:
            return _told_of_fall(self._dropped(set_up), None)
        return _told(self._struck(set_up, quickly=True))

    def _settle(self, set_up: SetUp, _: Table) -> Data:
        """Second answer: the impact by the extracted model, or the stresses of a fall."""
        if set_up.striker.kind == FLOOR:
            dropped = self._dropped(set_up)
            return _told_of_fall(dropped, dropped.worst)
        blow = self._struck(set_up)
        told = _told(blow)
        return {**told, "caution": _joined(told["caution"], self._coarse(blow))}

    def _fields(self, set_up: SetUp, _: Table) -> Data:
        """Motion and stress of the part for the picture."""
        from antiosc_app import live_meshes

        blow = self._struck(set_up)
        edges = self._opened().look.of_deck
        return {"part": live_meshes.of_structure(blow.structure, blow.hit, edges)}

    def _verdict(self, set_up: SetUp, _: Table) -> Data:
        """The verdict with the margins of the material's strengths, and the stress that decides."""
        return self._judged(set_up, self._strengths_of(set_up))

    def _speeds(self, set_up: SetUp, _: Table) -> Data:
        """The same; the answer is whole, and free modes may be searched."""
        self._is_whole = True
        self._work.submit(self._search_modes)
        return self._verdict(set_up, {})

    def _strengths_of(self, set_up: SetUp) -> dict[str, PeakField]:
        """The stress fields of the impact of a set-up."""
        return self._stresses.of(repr(set_up), lambda: _strengths(self._struck(set_up)))

    def _judged(self, set_up: SetUp, stresses: Mapping[str, PeakField]) -> Data:
        """The verdict by stress fields."""
        blow = self._struck(set_up)
        force = force_bar(run.error_budget(blow.hit))
        judged = largest_stress(stresses, force)
        head = _headline(blow, stresses)
        caution = _joined(head.caution, self._coarse(blow))
        told: Data = {"verdict": head.sentences, "caution": caution}
        narrows = self._narrows(set_up, judged)
        return {**told, "judged": judged, "taken": _taken(blow), "narrows": narrows}

    def _narrows(self, set_up: SetUp, judged: Data) -> bool:
        """Whether the page goes on with smaller cells at the largest stress."""
        source = self._opened()
        bar = judged.get("stress_bar")
        asked = set_up.finer is False or set_up.stressed
        if asked or not source.look.meshed or not bar or not judged["of_cells"]:
            return False
        if bar[1] <= MOST_OF_STRESS or not _stressed_elsewhere(source, set_up, judged):
            return False
        finer = replace(set_up, finer=True, stressed=(judged["stress_place"],))
        forecast = self._foreseen(finer)
        return min(forecast.told(forecast.answer), default=0.0) <= NARROWED_SOON

    def _map(self, set_up: SetUp, values: Table) -> Data:
        """Impacts of the striker at all points of a face, or of the part."""
        blow, group, most = self._map_of(set_up, values)
        stress = checks.whole("stress", values.get("stress", 0), least=0)
        key = repr((set_up, group, most))
        if key not in self._mapped:
            ends = self._map_cost(set_up, blow, group, most).ends
            self._ends = ends if ends[-1] > LONG else ()
        work = partial(self._impact_map, set_up, blow, group, most)
        impact_map = self._mapped.of(key, work)
        if stress:
            options = {"sharp_edges": False, "worst": True}
            impact_map = with_stresses(blow.structure, impact_map, stress, **options)
        return self._told_of_map(impact_map, blow.structure, values)

    def _map_of(self, set_up: SetUp, values: Table) -> tuple[PageImpact, str | None, int | None]:
        """(impact of the site, group of faces, most sites) of a map."""
        with without_warnings():  # those of one site
            blow = self._struck(set_up)
        group, most = values.get("where"), values.get("most_sites")
        if group is not None:
            group = face_of(self._opened(), group).get("where")
        return blow, group, None if most is None else checks.whole("sites", most)

    def _foreseen_map(self, set_up: SetUp, values: Table) -> Data:
        """The number of sites of a map, and its seconds: `fixed`, and for `each` site; `known`: the
        most sites that were asked for in maps that are known.
        """
        blow, group, _ = self._map_of(set_up, values)
        cost = self._map_cost(set_up, blow, group, None)
        known = [
            most
            for most in (None, values.get("most_sites"))
            if repr((set_up, group, most)) in self._mapped
        ]
        return {**cost._asdict(), "known": known}

    def _map_cost(
        self, set_up: SetUp, blow: PageImpact, group: str | None, most: int | None
    ) -> MapForecast:
        """The forecast of a map."""
        solid = self._opened().look.family == "Solid"
        radius = set_up.radius or (Resolved() if solid else blow.model.patch_radius)
        direction = None if solid else set_up.direction
        key = f"{_key(blow.scene, OF_STRUCTURE)} {group} {radius}"

        def foreseen() -> MapForecast:
            of_map = foreseen_map(blow.structure, group, direction, radius)
            # the site with the largest force is struck by itself
            alone = self._opened().look.forecast(set_up.size, blow.sections["extract"]["n"])
            least, most = of_map.fixed
            return of_map._replace(fixed=[least + alone.seconds, most + ALONE * alone.seconds])

        cost = self._map_costs.of(key, foreseen)
        return cost if most is None else cost._replace(sites=min(most, cost.sites))

    def _impact_map(
        self, set_up: SetUp, blow: PageImpact, group: str | None, most: int | None
    ) -> ImpactMap:
        """The impacts of a set-up at points of a group of faces."""
        map_with = partial(self._map_with, set_up, blow, group, most)
        if self._opened().look.family != "Solid" or set_up.radius:
            return map_with(set_up.radius or blow.model.patch_radius)
        own = float(blow.model.patch_radius or 0.0)
        for least in dict.fromkeys((0.0, own, 2 * own, 4 * own)):
            messages: list[str] = []
            with warnings_to(messages.append):
                result = map_with(Resolved(least))
            if np.mean(result.reasons == NO_RESULT) <= UNANSWERED:
                break
        for message in messages:
            warn(message)
        return result

    def _map_with(
        self,
        set_up: SetUp,
        blow: PageImpact,
        group: str | None,
        most: int | None,
        radius: Radius,
    ) -> ImpactMap:
        """The map with patches of a radius."""
        is_solid = self._opened().look.family == "Solid"
        duration = set_up.duration or duration_of_map(blow.hit)
        return antiosc.impact_map(
            blow.structure,
            group,
            blow.hit.impactor,
            AUTO,
            duration,
            direction=None if is_solid else set_up.direction,
            radius=radius,
            n=set_up.n,
            longest=None if set_up.duration else max(duration, LONGER * DURATION),
            most_sites=most,
        )

    def _told_of_map(
        self,
        impact_map: ImpactMap,
        structure: Structure,
        values: Table,
    ) -> Data:
        """A map as data for the page, with headline and the offer of stresses."""
        data = live_data.data_of_map(impact_map, structure)
        if data is None:
            raise InputError("this map has too many sites for the page: map one face.")
        headline = headline_of_map(impact_map, structure, self._file())
        where = "the part" if values.get("where") is None else str(values["where"])
        about = f"{headline.about} {len(impact_map)} sites of {where}, {_lasting(impact_map)}."
        return {
            "map": data,
            "worst": most_stressed(impact_map),
            "about": about,
            "caution": headline.caution,
            "verdict": [*headline.sentences, *_with_stress(impact_map)],
            "offer": _offer(impact_map, structure, 0.0),
        }

    def _forecast(self, values: Table) -> Data:
        """The cost of the cell size of a set-up, before its mesh is made, as a question; "" if the
        mesh is small, and all cells are halved once at most. `larger`: a size of one halving less
        or, where a model does not fit into the free memory (not `fits`), the finest that does.
        """
        set_up = read(values.get("setup"))
        look = self._opened().look
        if checks.flag("finer", values.get("finer", False)):
            return self._forecast_near(set_up)
        forecast = look.forecast(set_up.size, set_up.n)
        count = 0 if set_up.size is None or look.meshed else halvings(look.largest, set_up.size)
        if set_up.size is None or not (forecast.is_long or count > 1):
            return {"question": ""}
        times = plain(forecast.cells / look.n_cells, 3)
        size = 1e3 * set_up.size
        cells = f"{count_text(forecast.cells)} cells, {times} times as many as at first"
        text = f"With a cell size of {size:.4g} mm the mesh has {cells}, and {forecast.text()}."
        if not forecast.fits:
            finest = _finest_size(look, set_up.n)
            told = {"question": f"{text} {_too_large(finest)}", "fits": False}
            return told if finest is None else {**told, "larger": finest}
        if count > 1:
            longest = f"{1e3 * look.largest / 2**count:.3g} mm"
            text += f" All cells are halved {count} times, the longest is {longest} then."
            return {"question": text, "larger": look.halved(count - 1)}
        return {"question": text}

    def _forecast_near(self, set_up: SetUp) -> Data:
        """The cost of smaller cells around the site of a finished mesh, as `_forecast`, once the
        impact is known.
        """
        look = self._opened().look
        blow = self._impacts.get(repr(set_up))
        if blow is None or not look.divides or set_up.size is not None:
            return {"question": ""}
        size = _near(blow)
        near = [(place, size) for place in (set_up.point, *set_up.stressed)]
        forecast = look.forecast(n=set_up.n, grows=set_up.n is None, near=near)
        if not forecast.is_long:
            return {"question": ""}
        text = (
            f"With cells of {_in_mm(size)} around the site the mesh has"
            f" {count_text(forecast.cells)} cells, {look.n_cells} before, and {forecast.text()}."
        )
        return {"question": text, "fits": forecast.fits}

    def _coarse(self, blow: PageImpact) -> str:
        """Sentences, after those on cells too large for the contact, where such smaller ones do not
        fit into the free memory; else "".
        """
        look = self._opened().look
        cell = coarse_at(blow.model, "", blow.hit.assembly.contact_time_estimate)
        if cell is None or look.meshed or look.kept or self._given is not None or look.divides:
            return ""
        n = blow.sections["extract"]["n"]
        forecast = look.forecast(cell.allowed, n)
        if forecast.fits:
            return ""
        size = engineering(cell.allowed, "m")
        cost = f"On this page all cells become smaller, and with {size} a model takes"
        return f"{cost} {forecast.memory}. {_too_large(_finest_size(look, n))}"

    def _answering(self, set_up: SetUp) -> Sequence[float]:
        """When the whole answer to a set-up may end [s]: with as many anti-oscillators as the
        impact before needed, if there is one; none if not long.
        """
        if set_up.striker.kind == FLOOR:
            return self._landing(set_up)
        forecast = self._foreseen(set_up)
        ends = forecast.told(forecast.answer)
        before = next((one for one in reversed(self._impacts.values()) if one.settled), None)
        if before is None or len(ends) < 2:
            return ends
        enough = [count <= before.sections["extract"]["n"] for count in forecast.counts]
        return [ends[max(sum(enough), 1) - 1]]

    def _foreseen(self, set_up: SetUp) -> Forecast:
        """Forecast of the models of a set-up."""
        near = self._smaller_at(set_up)
        return self._opened().look.forecast(set_up.size, set_up.n, set_up.n is None, near)

    def _smaller_at(self, set_up: SetUp) -> Sequence[tuple[Sequence[float], float]]:
        """(point, size) of the smaller cells of a set-up, of a finished mesh if that without them
        was struck.
        """
        source = self._opened()
        if not source.look.divides:
            return scene_of(source, set_up, DURATION).get("geometry", {}).get("refine", ())
        before = [repr(replace(set_up, finer=finer, stressed=())) for finer in (None, False)]
        blow = next((self._impacts[key] for key in before if key in self._impacts), None)
        if blow is None or not set_up.finer:
            return ()
        return [(place, _near(blow)) for place in (set_up.point, *set_up.stressed)]

    def _landing(self, set_up: SetUp) -> Sequence[float]:
        """When a fall may end, as `_answering`; none where the modes of the part are known."""
        scene = self._compiled(scene_of(self._opened(), set_up, DURATION))
        seconds = self._opened().look.forecast(set_up.size, MODES).seconds
        ends = [share * seconds for share in OF_FALL]
        return [] if _key_of_body(scene, set_up) in self._bodies or ends[0] < LONG else ends

    def _saving(self, set_up: SetUp) -> Sequence[float]:
        """When the report may end, as `_answering`: all but the model, which is known."""
        blow = self._impacts.get(repr(set_up))
        if blow is None:
            return self._answering(set_up)
        forecast = self._opened().look.forecast(set_up.size, blow.sections["extract"]["n"])
        return forecast.told(forecast.answer - forecast.seconds)

    def _names(self, values: Table) -> Data:
        """The names of the scene and the report that would be written, their folder, and how long
        the report takes, to be confirmed.
        """
        ends = self._saving(read(values.get("setup")))
        takes = progress.range_text(ends) if len(ends) else ""
        return {"folder": self._folder, "names": _free_names(self._path), "takes": takes}

    @property
    def _folder(self) -> str:
        """The folder of the part, where scene and report are written."""
        return str(self._path.resolve().parent)

    def _write(self, set_up: SetUp, values: Table) -> Data:
        """Write scene and report beside the part; the user has confirmed their names."""
        names = _free_names(self._path)
        if self._given is not None or values.get("agreed") != names:
            raise InputError("the files to be written are not those that were agreed to.")
        is_fall = set_up.striker.kind == FLOOR
        messages: list[str] = []
        with warnings_to(messages.append):
            result = self._dropped(set_up) if is_fall else self._struck(set_up)
        scene, page = (self._path.with_name(name) for name in names)
        try:
            with scene.open("x", encoding="utf-8") as stream:
                stream.write(toml(result.sections) + (SENSOR_OF_FALL if is_fall else SENSOR))
        except OSError as error:
            raise InputError(f"cannot write {scene.name}: {error.strerror}.") from None
        self._written = scene.name
        page_results = run.SceneResults(
            compiled=compiled(read_document(scene)),
            title=result.sections["title"],
            warnings=by_weight(messages),
        )
        if isinstance(result, Dropped):
            page_results.structure = result.fall.body.structure
            page_results.fall = result.fall
            page_results.worst = result.worst
        else:
            page_results.structure = result.structure
            page_results.model = result.model
            page_results.history = result.hit
            page_results.impactor = result.hit.impactor
            page_results.stresses = self._strengths_of(set_up)
        report.write_page(page_results, results.presentations(page_results), page)
        name = f"report_{len(self.reports) + 1}"
        self.reports[name] = page.resolve()
        again = f"antiosc run {shlex.quote(str(scene.resolve()))}"
        return {"folder": self._folder, "written": names, "again": again, "report": name}


def _key_of_body(scene: CompiledScene, set_up: SetUp) -> str:
    """The key of the free body of a fall's part, for all floors, heights and orientations."""
    return f"{_key(scene, OF_STRUCTURE)} {(set_up.damping, set_up.striker.corner_radius)}"


def _lasting(impact_map: ImpactMap) -> str:
    """How long the impacts of a map are followed, in words."""
    assert impact_map.durations is not None
    ends = impact_map.durations.min(), impact_map.durations.max()
    shortest, longest = (engineering(float(end), "s") for end in ends)
    if shortest == longest:
        return f"each for {longest}"
    return f"each until the bodies part, {shortest} to {longest}"


def _sought(impact_map: ImpactMap) -> int:
    """Number of the sites of a map with the stress of their blow."""
    stress = impact_map.peak_stress
    return 0 if stress is None else int(np.isfinite(stress).sum())


def _sound(impact_map: ImpactMap) -> int:
    """Number of the sites of a map whose stress may be sought."""
    return int(len(impact_map) - impact_map.doubtful.sum()) or len(impact_map)


def _with_stress(impact_map: ImpactMap) -> list[str]:
    """The sentence that only some sites of a map have a stress, and which; none if all have."""
    sought, sound = _sought(impact_map), _sound(impact_map)
    if not 0 < sought < sound:
        return []
    return [
        f"Stresses are known of the blows at {sought} of {sound} sites, those with the largest"
        " forces and the largest deflections: another may cause a larger one."
    ]


def _offer(impact_map: ImpactMap, structure: Structure, alone: float) -> Data | None:
    """The offer of the stress at each site: sites, the least and the largest number of seconds, and
    the number of sites that takes `SOON`; None where all have it. `alone`: seconds of an impact
    alone.

    Seconds are forecast, or of stresses of fewer sites measured.
    """
    count, sought = _sound(impact_map), _sought(impact_map)
    if sought >= count:
        return None
    begins, at_site = stress_seconds(structure, impact_map)
    begins += alone
    all_sites = begins + count * at_site
    if sought:
        all_sites = alone + impact_map.info["seconds"]["stresses"] * count / sought
    least, most = (all_sites * factor for factor in FORECAST)
    fewer = max(FEWEST, int(count * (SOON - begins) / max(most - begins, 1e-9)))
    return {"sites": count, "seconds": [least, most], "fewer": min(fewer, count)}


def _piece_text(rank: int, piece: Piece) -> str:
    """A piece in words: its rank, its size and its name."""
    size = " × ".join(f"{1e3 * side:.3g}" for side in piece.high - piece.low)
    return f"{rank}: {size} mm{f', {piece.name}' if piece.name else ''}"


#: Most sizes that are tried for the finest that fits, and each over the one before, of a geometry.
MOST_TRIED, TRIED = 60, 0.9


def _finest_size(look: Inspection, n: int | None) -> float | None:
    """The finest cell size [m] whose model fits into the free memory; None where none does."""
    finest = None
    for k in range(1, MOST_TRIED):
        size = rounded_up(look.size * TRIED**k) if look.meshed else look.halved(k)
        if not look.forecast(size, n).fits:
            break
        finest = size
    return finest


def _too_large(finest: float | None) -> str:
    """Sentences that cells do not fit into the memory, and what does."""
    unknown = "the error that they leave is not known"
    if finest is None:
        return (
            "That does not fit, and no finer mesh than the present one does: the error of its cells"
            " is not known; a machine with more memory, or a deck with smaller cells at the site"
            " alone, has it."
        )
    return f"That does not fit: the finest cells that do are of {_in_mm(finest)}; {unknown}."


def _joined(*sentences: str) -> str:
    """The sentences that there are, as one text."""
    return " ".join(filter(None, sentences))


def _in_mm(size: float) -> str:
    """A cell size in mm as the page shows it."""
    return f"{1e3 * size:.4g} mm"


def _near(blow: PageImpact) -> float:
    """Size [m] of the cells around the site of a finished mesh that the waves of the contact need,
    or a third of those that are there.
    """
    needed = coarse_at(blow.model, "", blow.hit.assembly.contact_time_estimate)
    there = min(size for size, _, _ in (info_of(blow.model).cells or {}).values())
    return rounded_down(min(needed.allowed if needed else np.inf, there / FINER))


def _finer_sizes(look: Inspection) -> list[tuple[float, str]]:
    """Smaller cell sizes [m] and what a model with them takes, as far as it has room."""
    steps = range(1, MOST_STEPS + 1)
    if look.meshed:
        sizes = [float(f"{look.size / STEP**k:.2g}") for k in steps]
    else:
        sizes = [look.halved(k) for k in steps]
    costs = {size: look.forecast(size) for size in sizes}
    return [(size, cost.brief()) for size, cost in costs.items() if cost.fits]


def _told_of_file(look: Inspection, name: str) -> str:
    """Sentences on the part's size, and on the choices made while reading its file."""
    choices = ""
    if "unit" in look.read:
        choices = f"; unit of its file: {look.unit_text()}; antiosc open --unit changes it"
    for key, taken in look.unstated().items():
        choices += f"; {key} {taken}; a field changes it"
    if look.of_deck:
        choices += f"; mass {look.mass_text()}"
    if look.kept:
        choices += f"; the deck {look.kept}"
    notes = [note.removeprefix(f"{name}: ") for note in look.lasting_notes]
    told = [note for note in notes if not any(words in note for words in OF_PIECES)]
    return " ".join([f"{look.sides_text()}{choices}.", *map(capitalised, told)])


def _mass(look: Inspection) -> float:
    """Mass [kg] of the part with its first material; 0 if it is not known."""
    with contextlib.suppress(InputError):
        return look.mass
    return 0.0


def _first_held(look: Inspection) -> str:
    """Sentence where the faces lie that are held at first; "" if they are not those of a plane."""
    plane = look.plane_text()
    return f"Held at first: {plane}, a guess." if plane else ""


def _first_material(look: Inspection) -> str:
    """Sentence that the first material is a guess; "" for a deck, which has its own."""
    return "" if look.of_deck else f"The material {FIRST} is a guess: the file has none."


def _may_yield(structure: Structure) -> bool:
    """Whether a material can have a yield strength; layers of fibres have none."""
    members = with_parts(structure).members()
    materials_of = (material for member in members for material, _ in member.part.parts)
    return any(hasattr(material, "yield_strength") for material in materials_of)


def _stressed_elsewhere(source: InspectedFile, set_up: SetUp, judged: Data) -> bool:
    """Whether the page offers smaller cells at the place of the judged stress."""
    place = judged.get("stress_place")
    if place is None or len(set_up.stressed) >= MOST_STRESSED:
        return False
    near = source.look.size / 2
    return all(np.linalg.norm(np.subtract(one, place)) >= near for one in set_up.stressed)


def _corner(look: Inspection) -> float:
    """Radius [m] that a fall takes for sharp corners."""
    sides = look.high - look.low
    return float(min(CORNER, sides[sides > 0].min() / 4))


def _key(scene: CompiledScene, sections: tuple[str, ...]) -> str:
    """Text of the sections that an object depends on."""
    data = scene.document.data
    return json.dumps({name: data[name] for name in sections if name in data}, sort_keys=True)


def _evaluation(scene: CompiledScene, **known: object) -> Evaluation:
    """The evaluation of a scene in which some objects are already known, by name."""
    evaluate = Evaluation(scene.document)
    for name, value in known.items():
        evaluate.register(getattr(scene, name), value)
    return evaluate


def _with_less_error(
    asked: SetUp, set_up: SetUp, blow: PageImpact, look: Inspection, stays: bool
) -> tuple[SetUp, dict[str, str]]:
    """(set-up with more anti-oscillators or smaller cells at the site, why these were taken by
    "n", "cells"); the set-up itself where they do not help, or were asked for. `stays`: whether the
    mesh is that of a structure that was given.
    """
    budget = run.error_budget(blow.hit)
    reasons: dict[str, str] = {}
    if budget is None:
        return set_up, reasons
    bar = budget["peak_force"]
    n = blow.sections["extract"]["n"]
    more = next_count(n, bar.truncation, blow.model) if asked.n is None else n
    if more > n:
        reasons["n"] = why_more(n, more, bar.truncation)
        set_up = replace(set_up, n=more, expansion=expansion_of(blow.hit))
    of_cells = bar.mesh + (bar.patch or 0.0)
    if stays or (of_cells <= MOST_OF_CELLS and not budget.unresolved):
        return set_up, reasons
    finer = _in_finer_cells(asked, set_up, blow, look)
    if finer == set_up:
        return set_up, reasons
    error = f"{percent(of_cells)} of error by mesh and patch"
    where = "All cells are half as long as those of the file"
    if finer.finer:
        where = "The cells around the site are smaller than those of the part"
    reasons["cells"] = (
        f"{where}: without it the force had {'no error bar' if budget.unresolved else error}."
    )
    return finer, reasons


def _in_finer_cells(asked: SetUp, set_up: SetUp, blow: PageImpact, look: Inspection) -> SetUp:
    """The set-up with smaller cells at the site, or everywhere in solids of a finished mesh, whose
    cells are halved once; the set-up itself where they were asked for or take long.
    """
    if look.meshed:
        if asked.finer is None and not set_up.finer:
            return replace(set_up, finer=True)
        again = set_up.finer and set_up.near is None and asked.radius is None
        if not again or look.family != "Solid":
            return set_up
        (_, size), *_ = blow.sections["geometry"]["refine"]
        return replace(set_up, near=rounded_up(size / FINER))
    if asked.finer is not None or set_up.finer or set_up.size is not None or look.kept:
        return set_up
    finer = replace(set_up, size=look.halved(1))
    if look.divides and info_of(blow.model).cells:
        finer = replace(set_up, finer=True, near=_near(blow))
    near = [(set_up.point, finer.near)] if finer.near else ()
    forecast = look.forecast(finer.size, set_up.n, near=near)
    return finer if forecast.fits and forecast.answer <= REFINED_SOON else set_up


def _strengths(blow: PageImpact) -> dict[str, PeakField]:
    """The stress fields for which strengths are known; {} if the stress is unknown."""
    with contextlib.suppress(AntioscError):
        return dict(by_strengths(blow.structure, blow.hit))
    return {}


def _headline(blow: PageImpact, stresses: Mapping[str, PeakField]) -> Headline:
    """The headline of an impact."""
    budget = run.error_budget(blow.hit)
    return headline_of_history(blow.hit, blow.structure, budget, stresses, blow.file)


def _told(blow: PageImpact) -> Data:
    """An impact as data for the page, with headline and site."""
    blow_data = live.blow_of_history(blow.hit, run.error_budget(blow.hit))
    if blow_data is None:
        raise InputError("the page cannot repeat this impact.")
    headline = _headline(blow, {})
    info = info_of(blow.model)
    assert blow.scene.model is not None
    site = blow.scene.model.arguments["site"].made
    return {
        "blow": blow_data,
        "place": live.striker_place(blow.hit, blow_data),
        "settled": blow.settled,
        "refining": blow.refining,
        "about": _joined(
            headline.about,
            _cell_at(info) if run.has_sheets(blow.structure) else "",
            f"Computed for {engineering(blow_data['duration'], 's')}.",
        ),
        "caution": headline.caution if blow.settled else blow.hit.unfinished,
        "verdict": _said(headline, blow.settled),
        "dofs": blow.structure.dofs,
        "site": {"point": info.point, "direction": info.direction, "radius": site.radius},
        "taken": _taken(blow),
        "python": repr(site),
    }


def _cell_at(info: ModelInfo) -> str:
    """Sentence on the size of the cell at the site of a sheet, and its thickness there; "" of
    others.
    """
    if not info.cells or info.thickness is None:
        return ""
    ((size, bending, _),) = info.cells.values()
    if not bending:
        return ""
    thickness = engineering(info.thickness, "m")
    length = engineering(size, "m")
    return f"The sheet is {thickness} thick at the site, and its cell there {length} long."


def _taken(blow: PageImpact) -> Data:
    """The number of anti-oscillators, the size of the cells, null as in the file, and whether the
    mesh is refined at the site.
    """
    read = blow.sections.get("geometry") or blow.sections.get("deck") or {}
    return {
        "n": blow.sections["extract"]["n"],
        "size": read.get("size"),
        "finer": "refine" in read,
    }


def _said(head: Headline, settled: bool) -> list[str]:
    """The sentences of a headline that the table lacks; that on the bars once they are known."""
    told = {"contacts"} if settled else {"contacts", "accuracy"}
    pairs = zip(head.kinds, head.sentences, strict=True)
    return [sentence for kind, sentence in pairs if kind not in told]


def _told_of_fall(dropped: Dropped, worst: WorstField | None) -> Data:
    """A fall as data for the page, with headline."""
    headline = falls.headline_of_fall(dropped.fall, worst)
    numbers = dict(headline.numbers)
    hardest = f"The hardest is {numbers.get('hardest')}, with {numbers.get('peak force')}."
    return {
        **falls.data_of_fall(dropped.fall, worst),
        "settled": worst is not None,
        "about": _joined(headline.about, hardest * bool(dropped.fall.impacts)),
        "caution": headline.caution,
        "verdict": headline.sentences,
    }


def _free_names(part: Path) -> list[str]:
    """Names of a scene and a report beside a part that do not exist yet."""
    for number in count(1):
        stem = part.stem if number == 1 else f"{part.stem}_{number}"
        names = [f"{stem}.toml", f"{stem}.html"]
        if not any(part.with_name(name).exists() for name in names):
            break
    return names
