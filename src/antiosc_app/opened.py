"""`antiosc open`: a part that is struck on a page, from its file to a scene that is saved.

The page sends its whole set-up with every call: what the part is made of, where it is held and
struck, and by what. A set-up is written as a scene, and a blow is a run of that scene, so that a
saved scene reruns to the same numbers. Structures and models are kept; one thread computes.

A click is answered in three steps: by a model from free modes where these are known, which takes
one solve; by the extracted model, with its error bars; and with motion and stress for the picture.
"""

from __future__ import annotations

import contextlib
import json
import re
import threading
import tomllib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import antiosc
from antiosc import AntiOscillators, History
from antiosc.base import checks, progress
from antiosc.base.errors import AntioscError, InputError, RangeError, warnings_to
from antiosc.base.texts import capitalised
from antiosc.models.auto_contact import AUTO
from antiosc.models.body import info_of
from antiosc_app import falls, live, live_data, new, report, results
from antiosc_app.kept import MODELS, FreeModes, Kept
from antiosc_app.live import Data
from antiosc_app.scene_file import run
from antiosc_app.scene_file.build import Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import (
    Document,
    Problems,
    SceneFileError,
    read as read_document,
)
from antiosc_app.scene_file.scene import Compiled, by_strengths, worst_by_strengths
from antiosc_app.set_up import (
    DURATION,
    FIRST,
    FLOOR,
    FLOORS,
    HAMMERS,
    MATERIALS,
    STRIKERS,
    SetUp,
    Source,
    Table,
    face_of,
    read,
    rounded_up,
    scene_of,
    toml,
)

if TYPE_CHECKING:
    from antiosc import Fall, Site, Structure
    from antiosc.extension import WorstField

#: A step of an answer: the set-up, and what else the page sends.
Step: TypeAlias = Callable[[SetUp, Table], Data]

#: Structures and falls that are kept; tabs whose latest call is known.
STRUCTURES, FALLS, TABS = 2, 10, 100
#: How often the duration is doubled while striker and part still touch at its end.
LONGER = 5
#: The line of a scene before a sentence.
LINE = re.compile(r"^\S+\.toml:\d+: ", re.MULTILINE)
#: Sections of a scene that say what the structure is, and what more its model depends on.
OF_STRUCTURE = ("geometry", "deck", "material", "supports")
OF_MODEL = (*OF_STRUCTURE, "sites", "extract")


class Blow(NamedTuple):
    """A blow, its scene, and what it was computed with; `settled`: by the extracted model."""

    sections: Table
    scene: Compiled
    structure: Structure
    model: AntiOscillators
    hit: History
    settled: bool


class Dropped(NamedTuple):
    """A fall, and the scene that it is of."""

    sections: Table
    scene: Compiled
    fall: Fall

    @property
    def worst(self) -> WorstField | None:
        """The largest stress of the criterion that it exposes most."""
        return None if self.fall.body.structure is None else worst_by_strengths(self.fall)


class Opened:
    """A part that is open in a browser: what answers the calls of its page.

    Parameters
    ----------
    path : of its file; what is saved goes beside it.
    structure : in place of a file, which has its material and supports; nothing is saved.
    unit : of the file; None: a guess.
    """

    def __init__(
        self, path: Path, structure: Structure | None = None, unit: str | None = None
    ) -> None:
        self._path, self._given, self._unit = path, structure, unit
        self._work = ThreadPoolExecutor(max_workers=1, thread_name_prefix="antiosc")
        self._waiting, self._lock = 0, threading.Lock()
        self._turns: Kept[int] = Kept(TABS)
        self._structures: Kept[Structure] = Kept(STRUCTURES)
        self._models: Kept[AntiOscillators] = Kept(MODELS)
        self._modes: Kept[FreeModes] = Kept(STRUCTURES)
        self._falls: Kept[Dropped] = Kept(FALLS)
        self._source: Source | None = None
        self._first: Data = {}
        self._doing = ""
        #: the last site of the page
        self.site: Site | None = None

    @property
    def calls(self) -> dict[str, Callable[[Table], object]]:
        """Name of a call of the page -> what answers it."""
        steps: dict[str, Step] = {"blow": self._blow, "settle": self._settle}
        steps |= {
            "fields": self._fields,
            "verdict": self._verdict,
            "map": self._map,
            "write": self._write,
        }
        found = {name: partial(self._in_turn, step) for name, step in steps.items()}
        return {
            **found,
            "look": lambda _: self._computed(self._look),
            "save": self._names,
            "progress": lambda _: {"doing": self._doing},
        }

    @property
    def warm(self) -> bool:
        """Whether a click at the last structure is answered from free modes."""
        found = next(reversed(self._modes.values()), None)
        return found is not None and not found.left

    def close(self) -> None:
        """Begin no further work."""
        self._work.shutdown(wait=False, cancel_futures=True)

    # -- one thread computes

    def _computed(self, work: Callable[[], Data]) -> Data:
        """What `work` returns in the thread that computes, with its warnings."""

        def told() -> Data:
            self._count(-1)
            messages: list[str] = []
            with progress.following(self._follow), warnings_to(messages.append):
                try:
                    found = work()
                except SceneFileError as error:  # the page knows no lines
                    raise InputError(LINE.sub("", str(error.__cause__ or error))) from None
            return {**found, "warnings": list(dict.fromkeys(map(capitalised, messages)))}

        self._count(1)
        return self._work.submit(told).result()

    def _count(self, change: int) -> None:
        """Calls of the page that wait for the thread that computes."""
        with self._lock:
            self._waiting += change

    def _follow(self, doing: str) -> None:
        self._doing = doing

    def _in_turn(self, step: Step, values: Table) -> Data:
        """What a step answers; {"stale": true} if a later set-up of its tab has overtaken it.

        `tab` and `turn` are the tab of the browser and the number of its set-up.
        """
        tab = checks.text("tab", values.get("tab"))
        turn = checks.whole("turn", values.get("turn"), least=0)
        self._turns[tab] = max(turn, self._turns.of(tab, lambda: turn))
        asked = read(values.get("setup"))

        def work() -> Data:
            overtaken = self._turns.get(tab, turn) > turn
            return {"stale": True} if overtaken else step(asked, values)

        return self._computed(work)

    def _search_modes(self) -> None:
        """A round of free modes of the last structure, unless the page waits for an answer."""
        if not self._structures or self._waiting:
            return
        key, structure = next(reversed(self._structures.items()))
        modes = self._modes.of(key, lambda: FreeModes(structure))
        with contextlib.suppress(AntioscError):  # then every click is extracted
            if modes.left and modes.search():
                self._work.submit(self._search_modes)

    # -- the part

    def _look(self) -> Data:
        """What the file holds: the skin, its faces, and a set-up to begin with."""
        if self._first:
            return self._first
        from antiosc_app.skin import skin

        look = self._inspected()
        geometry = "size" in look.read and not look.of_deck
        self._source = Source(self._path.name, look, {}, geometry)
        guessed = None if look.family == "Solid" or look.of_deck else look.thickness
        asked = SetUp(
            point=tuple(look.point),
            direction=tuple(look.direction),
            material="" if look.of_deck else FIRST,
            thickness=guessed,
        )
        scene = self._compiled(scene_of(self._source, asked, DURATION))
        shape, faces, held = skin(self._structure(scene), look)
        self._source = self._source._replace(faces=faces)
        self._first = {
            "name": self._path.name,
            "told": _told_of_file(look),
            "skin": shape,
            "faces": list(faces),
            "materials": [] if look.of_deck else MATERIALS,
            "strikers": STRIKERS,
            "striker_materials": MATERIALS,
            "hammers": HAMMERS,
            "floors": FLOORS,
            "geometry": geometry,
            "saves": self._given is None,
            "engine": live.engine(),
            "setup": asdict(replace(asked, held=tuple(held))),
        }
        return self._first

    def _inspected(self) -> new.Inspection:
        if self._given is not None:
            return new.inspect_structure(self._given)
        with progress.doing(f"looking at {self._path.name}"):
            return new.inspect_part(self._path, unit=self._unit)

    # -- a set-up as a scene, and what is made of it

    def _compiled(self, sections: Table) -> Compiled:
        """A scene, compiled as its file would be."""
        text = toml(sections)
        path = self._path.with_suffix(".toml")
        return compiled(Document(path, tomllib.loads(text), Problems(path.name, text)))

    def _structure(self, scene: Compiled) -> Structure:
        key, given = _key(scene, OF_STRUCTURE), self._given
        if given is not None:
            return self._structures.of(key, lambda: given)
        call = scene.structure
        return self._structures.of(key, lambda: Evaluation(scene.document)(call))

    def _extracted(self, scene: Compiled) -> AntiOscillators:
        def extracted() -> AntiOscillators:
            evaluate = _evaluation(scene, structure=self._structure(scene))
            made: AntiOscillators = evaluate(scene.model)
            return made

        return self._models.of(_key(scene, OF_MODEL), extracted)

    def _from_modes(self, scene: Compiled) -> AntiOscillators | None:
        """The model of free modes; None before they are known, and where it was extracted."""
        modes, key = self._modes.get(_key(scene, OF_STRUCTURE)), _key(scene, OF_MODEL)
        if modes is None or key in self._models or scene.model is None:
            return None
        return modes.model(key, scene.model.arguments["site"].made)

    def _struck(self, asked: SetUp, quickly: bool = False) -> Blow:
        """The blow of a set-up, as long as striker and part touch.

        `quickly`: by a model from free modes, if they are known.
        """
        source = self._opened()
        if asked.striker.kind == FLOOR:
            raise InputError("a fall has no map: choose a ball, a mass or a hammer.")
        duration = source.look.duration if source.look.family == "Shell" else DURATION
        for _ in range(LONGER):
            sections = scene_of(source, asked, duration)
            scene = self._compiled(sections)
            structure = self._structure(scene)
            fast = self._from_modes(scene) if quickly else None
            model = fast or self._extracted(scene)
            try:
                known = _evaluation(scene, structure=structure, model=model)
                hit: History = known(scene.history)
            except RangeError as error:
                asked = _with_larger_patch(asked, error)
                continue
            if not hit.contacts or hit.contacts[-1][1] < hit.time[-1]:
                break
            duration *= 2
        assert scene.model is not None
        self.site = scene.model.arguments["site"].made
        return Blow(sections, scene, structure, model, hit, fast is None)

    def _opened(self) -> Source:
        if self._source is None:
            raise InputError("the part is not open yet.")
        return self._source

    def _dropped(self, asked: SetUp) -> Dropped:
        """The fall of a set-up."""
        sections = scene_of(self._opened(), asked, DURATION)

        def dropped() -> Dropped:
            scene = self._compiled(sections)
            evaluate = _evaluation(scene, structure=self._structure(scene))
            return Dropped(sections, scene, evaluate(scene.fall))

        return self._falls.of(toml(sections), dropped)

    # -- the steps of an answer

    def _blow(self, asked: SetUp, _: Table) -> Data:
        if asked.striker.kind == FLOOR:
            return _told_of_fall(self._dropped(asked), None)
        return _told(self._struck(asked, quickly=True))

    def _settle(self, asked: SetUp, _: Table) -> Data:
        if asked.striker.kind == FLOOR:
            one = self._dropped(asked)
            return _told_of_fall(one, one.worst)
        return _told(self._struck(asked))

    def _fields(self, asked: SetUp, _: Table) -> Data:
        """Motion and stress of the part for the picture."""
        from antiosc_app import live_meshes

        blow = self._struck(asked)
        return {"part": live_meshes.of_structure(blow.structure, blow.hit)}

    def _verdict(self, asked: SetUp, _: Table) -> Data:
        """The verdict with the margins of the material's strengths."""
        blow = self._struck(asked)
        self._work.submit(self._search_modes)
        return {"verdict": _headline(blow, _strengths(blow)).sentences}

    def _map(self, asked: SetUp, values: Table) -> Data:
        """The blow of the striker at all points of a face, or of the part."""
        blow, source = self._struck(asked), self._opened()
        where = values.get("where")
        if where is not None:
            where = face_of(source, where).get("where")
        found = antiosc.impact_map(
            blow.structure,
            where,
            blow.hit.impactor,
            AUTO,
            float(blow.hit.run.time[-1]),
            direction=None if source.look.family == "Solid" else asked.direction,
            radius=blow.model.patch_radius,
        )
        data = live_data.data_of_map(found, blow.structure)
        if data is None:
            raise InputError("this map has too many sites for the page: map one face.")
        return {"map": data, "verdict": live.headline_of_map(found).sentences}

    def _names(self, _: Table) -> Data:
        """The files that would be written, and where: the user is asked."""
        return {"folder": str(self._path.resolve().parent), "names": _free_names(self._path)}

    def _write(self, asked: SetUp, values: Table) -> Data:
        """Write scene and report beside the part; the user has agreed to their names."""
        names = _free_names(self._path)
        if self._given is not None or values.get("agreed") != names:
            raise InputError("the files to be written are not those that were agreed to.")
        fell = asked.striker.kind == FLOOR
        one = self._dropped(asked) if fell else self._struck(asked)
        scene, page = (self._path.with_name(name) for name in names)
        try:
            with scene.open("x", encoding="utf-8") as stream:
                stream.write(toml(one.sections))
        except OSError as error:
            raise InputError(f"cannot write {scene.name}: {error.strerror}.") from None
        found = run.Results(compiled=compiled(read_document(scene)), title=one.sections["title"])
        if isinstance(one, Dropped):
            found.structure, found.fall, found.worst = one.fall.body.structure, one.fall, one.worst
        else:
            found.structure, found.model, found.history = one.structure, one.model, one.hit
            found.impactor, found.stresses = one.hit.impactor, _strengths(one)
        report.write_page(found, results.presentations(found), page)
        return {"written": names}


def _told_of_file(look: new.Inspection) -> str:
    """The size of the part, and what was decided while reading its file."""
    side = " × ".join(f"{1e3 * c:.4g}" for c in look.high - look.low)
    unit = look.read.get("unit")
    taken = f", its file in {unit} (antiosc open --unit)" if unit else ""
    return " ".join([f"{side} mm{taken}.", *map(capitalised, look.notes)])


def _key(scene: Compiled, sections: tuple[str, ...]) -> str:
    """The text of what an object of a scene is made from."""
    data = scene.document.data
    return json.dumps({name: data[name] for name in sections if name in data}, sort_keys=True)


def _evaluation(scene: Compiled, **known: object) -> Evaluation:
    """The evaluation of a scene some of whose objects are known, by name."""
    evaluate = Evaluation(scene.document)
    for name, made in known.items():
        evaluate.know(getattr(scene, name), made)
    return evaluate


def _with_larger_patch(asked: SetUp, error: RangeError) -> SetUp:
    """The set-up with a patch that carries the force; the error, where one is given."""
    if error.radius is None or asked.radius is not None:
        raise error
    return replace(asked, radius=rounded_up(error.radius))


def _strengths(blow: Blow) -> dict[str, Any]:
    """The fields by which strengths are judged; {} of a part whose stress is not known."""
    with contextlib.suppress(AntioscError):
        return dict(by_strengths(blow.structure, blow.hit))
    return {}


def _headline(blow: Blow, stresses: dict[str, Any]) -> live.Headline:
    budget = results.error_budget(blow.hit)
    return live.headline_of_history(blow.hit, blow.structure, budget, stresses, None)


def _told(blow: Blow) -> Data:
    """A blow as the live page takes it, with its headline and its site."""
    found = live.blow_of_history(blow.hit, results.error_budget(blow.hit))
    if found is None:
        raise InputError("the page cannot repeat this impact.")
    head, info = _headline(blow, {}), info_of(blow.model)
    assert blow.scene.model is not None
    site = blow.scene.model.arguments["site"].made
    return {
        "blow": found,
        "place": live.striker_place(blow.hit, found),
        "settled": blow.settled,
        "about": head.about,
        "verdict": head.sentences,
        "dofs": blow.structure.dofs,
        "site": {"point": info.point, "direction": info.direction, "radius": site.radius},
        "python": repr(site),
    }


def _told_of_fall(one: Dropped, worst: WorstField | None) -> Data:
    """A fall as the page takes it, with its headline."""
    head = falls.headline_of_fall(one.fall, worst)
    return {
        **falls.data_of_fall(one.fall, worst),
        "settled": worst is not None,
        "about": head.about,
        "verdict": head.sentences,
    }


def _free_names(part: Path) -> list[str]:
    """Names of a scene and a report beside a part that do not exist yet."""
    for number in count(1):
        stem = part.stem if number == 1 else f"{part.stem}_{number}"
        names = [f"{stem}.toml", f"{stem}.html"]
        if not any(part.with_name(name).exists() for name in names):
            break
    return names
