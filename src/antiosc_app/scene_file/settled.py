"""Values of a scene that are "auto": the radius of its patch, its anti-oscillators, its duration.

Runs of the scene choose them, as those of `antiosc open` do; all commands take the scene with the
chosen values.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from antiosc.base.errors import (
    NOTE,
    AntioscError,
    warn,
    warnings_to,
    weight,
    without_warnings,
)
from antiosc.base.texts import rounded_up
from antiosc.models.auto_contact import AUTO
from antiosc_app.scene_file.automatic import only_site, with_values
from antiosc_app.scene_file.build import Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import Document
from antiosc_app.scene_file.run import has_sheets
from antiosc_app.scene_file.scene import MESHED, CompiledScene
from antiosc_app.until_parted import OSCILLATORS, Choice, tell_radius, until_parted

if TYPE_CHECKING:
    from antiosc import History, Structure


class Settled(NamedTuple):
    """A scene with numbers in place of "auto", and the evaluation of its known objects."""

    scene: CompiledScene
    evaluate: Evaluation


class Known:
    """Structure and last model of a scene, for its runs with other values; None for a structure
    that [strike] makes.
    """

    def __init__(self, structure: Structure | None) -> None:
        self.structure = structure
        #: radius, number of anti-oscillators and their expansion point, model and the warnings of
        #: its extraction
        self._model: tuple[tuple[float | None, ...], object, list[str]] | None = None

    def scene(self, document: Document, choice: Choice) -> Settled:
        """A document with the values; the model is that of this radius."""
        scene = compiled(with_values(document, choice))
        evaluate = Evaluation(scene.document)
        if scene.structure is not None:
            evaluate.register(scene.structure, self.structure)
        if scene.model is None:  # [strike] makes it
            return Settled(scene, evaluate)
        values = choice.radius, choice.n, choice.expansion
        if self._model is None or self._model[0] != values:
            messages: list[str] = []
            with warnings_to(messages.append):
                model = evaluate(scene.model)
            self._model = values, model, messages
        for message in self._model[2]:
            warn(message)
        evaluate.register(scene.model, self._model[1])
        return Settled(scene, evaluate)


def settled(document: Document, begun: Settled | None = None) -> Settled:
    """The scene of a document; if values are "auto", impacts of it choose them first, with the
    hardest striker of its sweep.

    `begun`: the scene before that, where some of its objects are made already.
    """
    if begun is None:
        scene = compiled(document)
        begun = Settled(scene, Evaluation(scene.document))
    scene, evaluate = begun
    known_parts = scene.striking or None not in (scene.structure, scene.model)
    if scene.document is document or scene.history is None or not known_parts:
        return begun
    messages: list[str] = list(scene.warnings)
    with warnings_to(messages.append):  # what was left out of the file
        structure = evaluate(scene.structure)
    first = Choice(None, keeps_radius=True)
    if only_site(document).get("radius") == AUTO:
        first = Choice(_smallest(structure, scene))
    duration = document.data.get("simulate", {}).get("duration")
    if scene.striking:
        first = first._replace(keeps_duration=True)
    elif duration != AUTO:
        first = first._replace(duration=duration, keeps_duration=True)
    if document.data.get("extract", {}).get("n") == AUTO:
        first = first._replace(n=OSCILLATORS[0])
    known = Known(structure)
    hardest = _hardest(document)

    def run(choice: Choice) -> Settled:
        one = known.scene(hardest, choice)
        one.evaluate(one.scene.history)
        return one

    told: list[str] = []
    with warnings_to(told.append):
        sheet = has_sheets(structure)
        result, choice = until_parted(run, _hit, first, is_sheet=sheet, probed=_probed)
        tell_radius(first.radius, choice.radius)
        if hardest is not document:
            result = known.scene(document, choice)
    if hardest is not document:  # its warnings are not those of the scene's own impact
        told = [message for message in told if weight(message) == NOTE]
    messages += told
    result.scene.warnings[:] = list(dict.fromkeys(messages))
    return result


def _hit(one: Settled) -> History:
    """The impact of a scene that was run."""
    hit: History = one.evaluate(one.scene.history)
    return hit


def _probed(one: Settled) -> dict[str, float]:
    """The errors of the probes of a scene by the number of anti-oscillators; without those of
    accelerations that no filter smooths, which may never converge.
    """
    from antiosc import probe_error  # it needs the finite elements

    errors = {}
    for name, call in one.scene.probes.items():
        arguments = {} if call is None else call.arguments
        if call is None or (
            arguments.get("quantity") == "acceleration" and not arguments.get("filter")
        ):
            continue
        with suppress(AntioscError), without_warnings():
            error = one.evaluate(replace(call, make=probe_error))
            errors[f"the largest {arguments.get('quantity', 'displacement')} of probe {name}"] = (
                error.truncation
            )
    return errors


def _hardest(document: Document) -> Document:
    """The document with the largest values of its sweep for the striker; itself without any."""
    striker = document.data.get("impactor", {})
    swept = document.data.get("sweep", {}).get("impactor", {})
    largest = {
        key: max(values)
        for key, values in swept.items()
        if isinstance(values, list) and all(isinstance(value, int | float) for value in values)
    }
    if not largest:
        return document
    return replace(document, data={**document.data, "impactor": {**striker, **largest}})


def _smallest(structure: Structure | None, scene: CompiledScene) -> float | None:
    """Radius [m] of the smallest patch that the facets resolve at the site; None for a point, and
    where [strike] makes the mesh and chooses it.
    """
    from antiosc.extension import with_parts
    from antiosc.reduce.site.map_sites import resolved_radius

    call = scene.model or scene.history
    if structure is None or call is None or not set(MESHED.split()) & set(scene.document.data):
        return None
    site = call.arguments["site"].made
    if (site.point, site.face, site.node) == (None, None, None):
        return None
    radius = resolved_radius(with_parts(structure), site)
    return None if radius is None else rounded_up(radius)
