"""`antiosc open`: answers the calls of the page on which a part is struck.

The page edits a scene of the part. The scene is run in two steps: first the force with its error
bars, then motion, stress and all output of `antiosc run`. Meshes, structures and models are kept
for the next run. One thread does all computations.
"""

from __future__ import annotations

import contextlib
import os
import shlex
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from antiosc.base import checks
from antiosc.base.errors import InputError, sorted_by_weight
from antiosc.base.texts import capitalised, engineering
from antiosc.models.body import info_of
from antiosc_app import cards, falls, live, live_data, report, results
from antiosc_app.cards import MAX_CAUTIONS
from antiosc_app.edited import (
    FLOOR_MATERIALS,
    ISOTROPIC_MATERIALS,
    MATERIALS_THAT_YIELD,
    OWN_MATERIAL,
    STEEL_HAMMERS,
    EditedScene,
    Table,
    toml_text,
)
from antiosc_app.headline import judged_stress_data
from antiosc_app.inspecting import inspect_part, inspect_structure
from antiosc_app.inspection import CONTACT_TEXTS, Inspection
from antiosc_app.kept import PartCache
from antiosc_app.live import Data
from antiosc_app.scene_file import run
from antiosc_app.scene_file.build import Evaluation
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import Document, SceneFileError, read_document
from antiosc_app.scene_file.scene import COMMAND_STUDIES
from antiosc_app.scene_file.settled import SettledScene, begin_settling, settle
from antiosc_app.working import PageWorker

if TYPE_CHECKING:
    from antiosc import Site, Structure
    from antiosc.io.neutral import Piece
    from antiosc_app.skin import PageSkin

#: Rank that stands for all pieces joined, and its words.
JOINED_RANK, JOINED_TEXT = 0, "all joined"
#: What another page is told once a piece was opened.
PIECE_CHANGED_TEXT = "another piece of the file was opened meanwhile: load this page again."
#: Most sites of a map, unless the page asks for another number.
DEFAULT_SITE_COUNT = 200


class SceneAnswer(NamedTuple):
    """Results of a scene with this `scene_text`.

    `has_stresses`: whether it contains stresses, or only the history.
    """

    scene_text: str
    settled: SettledScene
    results: run.SceneResults
    has_stresses: bool


class OpenPart:
    """A part that is open in a browser; it answers the calls of the page."""

    def __init__(
        self,
        path: Path,
        structure: Structure | None = None,
        unit: str | None = None,
        size: float | None = None,
        piece: int | None = None,
        contact: str | None = None,
    ) -> None:
        self._path = path
        self._given = structure
        self._options: Table = {"unit": unit, "size": size}
        self._choice: Table = {"piece": piece, "contact": contact}
        self._worker = PageWorker()
        self._kept = PartCache(structure)
        self._inspected: Inspection | None = None
        self._whole: Inspection | None = None
        self._scene: EditedScene | None = None
        self._first: Data = {}
        self._opening = 0
        self._answer: SceneAnswer | None = None
        #: name in an address -> report that was written
        self.reports: dict[str, Path] = {}
        #: the site that was struck last
        self.site: Site | None = None

    @property
    def calls(self) -> dict[str, Callable[[Table], object]]:
        """Functions that answer the calls of the page, by name of the call."""
        steps: dict[str, Callable[[Table], Data]] = {
            **{"settle": self._force_with_bars, "show": self._all_results, "map": self._map_data},
            "write": self._write_results,
        }
        answers = {name: self._page_call(step) for name, step in steps.items()}
        return {
            **answers,
            "look": lambda _: self._worker.compute(self._part_and_scene),
            "take": lambda values: self._worker.compute(lambda: self._open_piece(values)),
            "edit": self._edit_scene,
            "stop": lambda _: {"turn": self._worker.next_turn()},
            "names": lambda _: {"folder": self._part_folder, "names": _free_names(self._path)},
            "progress": lambda _: self._worker.progress(),
        }

    def close(self) -> None:
        """Accept no further work; a running computation ends at its next step."""
        self._worker.close()

    def _page_call(self, step: Callable[[Table], Data]) -> Callable[[Table], Data]:
        """A call of the page that computes `step` on the worker thread, for the page's turn."""

        def call(values: Table) -> Data:
            turn = checks.whole("turn", values.get("turn"), least=0)
            return self._worker.compute(lambda: without_line_numbers(lambda: step(values)), turn)

        return call

    # -- the part

    def _part_and_scene(self) -> Data:
        """Data of the part (which is opened if necessary) and of the present scene."""
        if not self._first:
            self._first = self._open_part()
        return {**self._first, **self._edited_scene.page_state(), "turn": self._worker.turn}

    @property
    def _edited_scene(self) -> EditedScene:
        """The edited scene; InputError before the part is open."""
        if self._scene is None:
            raise InputError("the part is not open yet.")
        return self._scene

    def _open_part(self) -> Data:
        """Read the part, begin its scene, and return data of both for the page."""
        from antiosc_app.skin import face_places

        inspected = self._inspected = self._inspect()
        self._scene, (shape, faces, _) = first_scene(
            self._path, inspected, self._kept.cached_evaluation
        )
        self._answer = None
        self._opening += 1
        own = self._given is not None
        return {
            "name": self._path.name,
            "opening": self._opening,
            "pieces": self._piece_rows(inspected),
            "piece": inspected.read_options.get("piece", JOINED_RANK),
            "contact": inspected.read_options.get("contact", ""),
            "contacts": CONTACT_TEXTS if "contact" in inspected.read_options else {},
            "told": _file_sentences(inspected, own),
            "skin": shape,
            "faces": list(faces),
            "places": face_places(shape, list(faces)),
            "materials": [] if inspected.is_deck else [*ISOTROPIC_MATERIALS, OWN_MATERIAL],
            "striker_materials": [*ISOTROPIC_MATERIALS, OWN_MATERIAL],
            "hammers": STEEL_HAMMERS,
            "floors": FLOOR_MATERIALS,
            "family": inspected.family,
            "of_deck": inspected.is_deck and not own,
            "refines": inspected.is_meshed or not own,
            "strengths": MATERIALS_THAT_YIELD if inspected.is_deck and not own else [],
            "saves": not own,
            "engine": live.engine_wasm(),
        }

    def _inspect(self) -> Inspection:
        """Inspect the part or its chosen piece."""
        if self._given is not None:
            return inspect_structure(self._given)
        piece, contact = self._choice["piece"], self._choice["contact"]
        if self._whole is None:
            self._whole = inspect_part(self._path, contact=contact, **self._options)
        if piece in (None, self._whole.read_options.get("piece", JOINED_RANK)):
            return self._whole
        more: Table = {"piece": piece, "contact": contact, "whole": self._whole}
        return inspect_part(self._path, **more, **self._options)

    def _open_piece(self, values: Table) -> Data:
        """Open another `piece` of the part (0: all joined), or its deck with another `contact`.

        After an error the part before stays open.
        """
        before = vars(self).copy()
        if "contact" in values:
            contact = checks.choice("contact", values["contact"], tuple(CONTACT_TEXTS))
            self._choice, self._whole = {"piece": None, "contact": contact}, None
        else:
            piece = checks.whole("piece", values.get("piece"), least=JOINED_RANK)
            if piece == JOINED_RANK and (
                self._whole is None or "piece" in self._whole.read_options
            ):
                raise InputError(f"the pieces of {self._path.name} are not joined.")
            self._choice = {**self._choice, "piece": piece}
        try:
            self._first = self._open_part()
        except BaseException:
            vars(self).update(before)
            raise
        self._worker.next_turn()
        return {}

    def _piece_rows(self, inspected: Inspection) -> list[tuple[int, str]]:
        """(rank, text) of each piece of the part, and of all joined if they can be."""
        joined = (
            []
            if self._whole is None or "piece" in self._whole.read_options
            else [(JOINED_RANK, JOINED_TEXT)]
        )
        told = [(rank, _piece_text(rank, piece)) for rank, piece in enumerate(inspected.pieces, 1)]
        return [*joined, *told] if told else []

    # -- the scene

    def _edit_scene(self, values: Table) -> Data:
        """Change the scene, or undo a change; returns the new scene and its turn."""
        if values.get("opening", self._opening) != self._opening:
            raise InputError(PIECE_CHANGED_TEXT)
        changes = {name: value for name, value in values.items() if name != "opening"}
        if changes == {"undo": True}:
            self._edited_scene.undo()
        else:
            stressed, cells = self._worst_cells() if "finer" in changes else ((), 0.0)
            without_line_numbers(lambda: self._edited_scene.change(changes, stressed, cells))
        return {**self._edited_scene.page_state(), "turn": self._worker.next_turn()}

    def _worst_cells(self) -> tuple[list[float], float]:
        """(place [m] of the last run's largest stress or [], cell size [m] at the site or 0)."""
        if self._answer is None or self._answer.results.history is None:
            return [], 0.0
        made = self._answer.results
        sizes = [size for size, _, _ in (info_of(made.history.model).cells or {}).values()]
        worst = judged_stress_data(made.stresses or {}).get("stress_place")
        return worst or [], min(sizes, default=0.0)

    def _run_scene(self, with_stresses: bool, more_sections: Table | None = None) -> SceneAnswer:
        """Run the scene with `more_sections`, as `antiosc run` does.

        `with_stresses`: with stresses.
        """
        document = self._edited_scene.document(more_sections)
        text = document.mistakes.text
        known = (
            self._answer if self._answer is not None and self._answer.scene_text == text else None
        )
        if known is not None and known.has_stresses >= with_stresses:
            return known
        state = self._settled_scene(document) if known is None else known.settled

        makes = COMMAND_STUDIES["map" if more_sections else "run"].made_fields
        wanted = makes if with_stresses else makes[: makes.index("history") + 1]
        made = run.make_results(state.scene, wanted, state.evaluation)
        before = [] if known is None else known.results.warnings
        made.warnings = sorted_by_weight([*before, *made.warnings])
        answer = SceneAnswer(text, state, made, with_stresses)
        if not more_sections:
            self._answer = answer
            if state.scene.model is not None:
                self.site = state.scene.model.arguments["site"].result
        return answer

    def _settled_scene(self, document: Document) -> SettledScene:
        """The scene of a document with numbers instead of "auto"."""
        begun = begin_settling(document, self._kept)
        first = run.make_results(begun.scene, ("structure",), begun.evaluation)
        begun.scene.warnings[:] = first.warnings
        return settle(document, begun)

    # -- the steps of an answer

    def _force_with_bars(self, _: Table) -> Data:
        """Compute the force with its error bars; {} for a fall, which has no such step."""
        made = self._run_scene(with_stresses=False).results
        return {} if made.history is None else self._impact_data(made)

    def _all_results(self, _: Table) -> Data:
        """Compute all output of `antiosc run`, and motion and stress for the picture."""
        made = self._run_scene(with_stresses=True).results
        if made.history is None:
            told = {**falls.data_of_fall(made.fall, made.worst), "summary": summary_data(made)}
            return told
        from antiosc_app import live_meshes

        told = self._impact_data(made)
        told["part"] = live_meshes.part_data(made.structure, made.history)
        told |= judged_stress_data(made.stresses or {})
        return told

    def _impact_data(self, made: run.SceneResults) -> Data:
        """The data of an impact for the page."""
        hit = made.history
        blow = live.impact_of_history(hit, run.error_budget(hit))
        if blow is None:
            raise InputError("the page cannot repeat this impact.")
        info = info_of(hit.model)
        return {
            "blow": blow,
            "place": live.striker_place(hit, blow),
            "summary": summary_data(made),
            "taken": {
                "sites.radius": hit.model.patch_radius,
                "sites.point": info.point,
                "extract.n": hit.model.n,
                "simulate.duration": float(hit.time[-1]),
            },
            "python": repr(self.site),
        }

    def _map_data(self, values: Table) -> Data:
        """Compute the impact at many points of the face `where`, or of the part."""
        if self._edited_scene.is_fall:
            raise InputError("a fall has no map: choose a ball, a mass or a hammer.")
        hit = self._run_scene(with_stresses=False).results.history
        most = checks.whole("most_sites", values.get("most_sites", DEFAULT_SITE_COUNT))
        of_map: Table = {"most_sites": most, "duration": float(hit.time[-1]), "n": hit.model.n}
        if hit.model.patch_radius:
            of_map["radius"] = float(hit.model.patch_radius)
        if self._inspected is not None and self._inspected.family != "Solid":
            of_map["direction"] = self._edited_scene.site["direction"]
        if values.get("where"):
            of_map["where"] = str(values["where"])

        made = self._run_scene(with_stresses=True, more_sections={"map": of_map}).results
        data = live_data.data_of_map(made.map, made.structure)
        if data is None:
            raise InputError("this map has too many sites for the page: map one face.")
        return {**data, "summary": summary_data(made)}

    # -- files

    @property
    def _part_folder(self) -> str:
        """Path of the part's folder, to which scene and report are written."""
        return str(self._path.resolve().parent)

    def _write_results(self, values: Table) -> Data:
        """Write scene and report beside the part; the user has confirmed their names."""
        names = _free_names(self._path)
        if self._given is not None or values.get("agreed") != names:
            raise InputError("the files to be written are not those that were agreed to.")
        made = self._run_scene(with_stresses=True).results
        scene, page = (self._path.with_name(name) for name in names)
        try:
            with scene.open("x", encoding="utf-8") as stream:
                stream.write(toml_text(self._edited_scene.sections))
        except OSError as error:
            raise InputError(f"cannot write {scene.name}: {error.strerror}.") from None
        made.compiled.document = read_document(scene)
        report.write_page(made, results.presentations(made), page)
        name = f"report_{len(self.reports) + 1}"
        self.reports[name] = page.resolve()
        again = f"antiosc run {shlex.quote(str(scene.resolve()))}"
        return {"folder": self._part_folder, "written": names, "again": again, "report": name}


def first_scene(
    path: Path, inspected: Inspection, evaluation: Callable[[Document], Evaluation] = Evaluation
) -> tuple[EditedScene, PageSkin]:
    """(first scene of a part, its skin); `evaluation` makes the structure of the scene."""
    from antiosc_app.skin import page_skin

    scene = compile_document(EditedScene(path, inspected, {}, ()).document())
    shown = page_skin(evaluation(scene.document)(scene.structure), inspected)
    return EditedScene(path, inspected, shown.faces, shown.held_faces), shown


def without_line_numbers(work: Callable[[], Any]) -> Any:
    """The result of `work`; mistakes in the scene are raised without file name and line."""
    try:
        return work()
    except SceneFileError as error:
        raise InputError(str(error.__cause__ or error.sentence)) from None


def summary_data(made: run.SceneResults) -> Data:
    """Data of a run for the page: cards, rows, cautions, and the text of `antiosc run`."""
    parts = results.presentations(made)
    first = parts[1]
    told = cards.listed_cautions(first.caution, made.warnings)
    return {
        "cards": first.cards,
        "rows": first.rows,
        "cautions": told[:MAX_CAUTIONS],
        "more": told[MAX_CAUTIONS:],
        "sentences": first.sentences if made.map is not None else [],
        "text": results.long_text(made, parts),
    }


def _piece_text(rank: int, piece: Piece) -> str:
    """Text of a piece: its rank, its size [mm] and its name."""
    size = " × ".join(f"{1e3 * side:.3g}" for side in piece.high - piece.low)
    return f"{rank}: {size} mm{f', {piece.name}' if piece.name else ''}"


def _file_sentences(inspected: Inspection, is_given: bool) -> list[str]:
    """Sentences on the part: size, mass, unit, and decisions made while its file was read.

    `is_given`: whether the caller gave a structure instead of a file.
    """
    told = [f"{inspected.sides_text()}, {inspected.cells_text}"]
    with contextlib.suppress(InputError):
        told.append(f"mass {engineering(inspected.mass, 'kg')}")
    if "unit" in inspected.read_options:
        told.append(f"unit of the file: {inspected.unit_text()}; antiosc open --unit changes it")
    if inspected.is_deck and inspected.is_free_deck and not is_given:
        told.append("the deck holds it nowhere")
    return [f"{'; '.join(told)}.", *map(capitalised, inspected.notes)]


def _free_names(part: Path) -> list[str]:
    """Names of a scene file and a report that do not exist beside the part, not even as links."""
    for number in count(1):
        stem = part.stem if number == 1 else f"{part.stem}_{number}"
        names = [f"{stem}.toml", f"{stem}.html"]
        if not any(os.path.lexists(part.with_name(name)) for name in names):
            break
    return names
