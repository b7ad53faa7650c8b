"""Replaces "auto" in scenes by numbers, by the rules of `antiosc.strikes.defaults`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from antiosc.base.errors import warnings_to
from antiosc.base.texts import STOPPED
from antiosc.models.body import AUTO
from antiosc_app.kept import KeepingEvaluation, Kept
from antiosc_app.scene_file.compiled import Choice, compiled, is_auto, only_site, with_values
from antiosc_app.scene_file.document import Document
from antiosc_app.scene_file.scene import CompiledScene

if TYPE_CHECKING:
    from antiosc import History, Structure

T = TypeVar("T")


class Settled(NamedTuple):
    """A scene with numbers in place of "auto", and the evaluation that knows its results."""

    scene: CompiledScene
    evaluate: KeepingEvaluation


def begin(document: Document, kept: Kept | None = None) -> Settled:
    """The scene of a document with first values for "auto"; `kept`: results of earlier runs."""
    scene = compiled(document)
    return Settled(scene, (kept or Kept()).evaluation(scene.document))


def settled(document: Document, begun: Settled | None = None) -> Settled:
    """The scene of a document with final values for "auto".

    They suit the hardest striker of [sweep] or [monte_carlo]; `begun`: by `begin`, if known.
    """
    begun = begun or begin(document)
    scene, evaluate = begun
    if scene.document is document or scene.history is None:
        return begun

    messages: list[str] = list(scene.warnings)
    with warnings_to(messages.append):  # what was left out of the file
        structure = evaluate(scene.structure)
    hardest = _hardest(document, scene)
    told: list[str] = []
    choice = Choice(radius=_radius(structure, compiled(hardest), document))

    def run(choice: Choice) -> tuple[Settled, History]:
        told.clear()  # of the last run alone
        with warnings_to(told.append):
            one = begin(with_values(hardest, choice), evaluate.kept)
            return one, one.evaluate(one.scene.history)

    grows = is_auto(document, "extract", "n")
    lasts = is_auto(document, "simulate", "duration")
    result, choice = enough(run, choice, grows, lasts)

    if hardest is not document:  # its warnings are not those of the scene's own impact
        told.clear()
        with warnings_to(told.append):
            result = begin(with_values(document, choice), evaluate.kept)
            result.evaluate(result.scene.model)
    result.scene.warnings[:] = list(dict.fromkeys(messages + told))
    return result


def enough(
    run: Callable[[Choice], tuple[T, History]], choice: Choice, grows: bool, lasts: bool
) -> tuple[T, Choice]:
    """Repeat `run` with more oscillators or longer; returns (last result, its values).

    `grows`: until there are enough oscillators; `lasts`: until the bodies have parted.
    """
    from antiosc.extension import LONGER, expansion_of, next_count, parted

    longest = LONGER * choice.duration
    while True:
        result, hit = run(choice)
        if hit.status == STOPPED or hit.assembly.hopeless:
            return result, choice

        more = next_count(hit) if grows else None
        if more is not None:
            choice = choice._replace(n=more, expansion=expansion_of(hit))
        elif lasts and choice.duration < longest and not parted(hit):
            choice = choice._replace(duration=2 * choice.duration)
        else:
            return result, choice


def _radius(structure: Structure | None, scene: CompiledScene, document: Document) -> float | None:
    """Radius [m] of the patch at the only site if it is "auto"; else, or for [strike], None."""
    call = scene.model or scene.history
    if structure is None or call is None or only_site(document).get("radius") != AUTO:
        return None
    from antiosc.extension import patch_radius

    bodies = (scene.impactor, scene.contact)
    striker, law = (None if one is None else one.made for one in bodies)
    site = call.arguments["site"].made
    return None if striker is None else patch_radius(structure, site, striker, law or AUTO)


def _hardest(document: Document, scene: CompiledScene) -> Document:
    """The document with the largest values that [sweep] and [monte_carlo] give the striker."""
    largest: dict[str, Any] = {}
    swept = document.data.get("sweep", {}).get("impactor", {})
    for key, values in swept.items():
        if isinstance(values, list) and all(isinstance(x, int | float) for x in values):
            largest[key] = max(values)

    drawn = {} if scene.sample is None else scene.sample.arguments
    share = 1 - EXCEEDED / drawn.get("n", 1000)
    for name, law in drawn.get("inputs", {}).items():
        section, _, key = name.partition(".")
        if section == "impactor" and hasattr(law.made, "ppf"):
            largest[key] = float(law.made.ppf(share))

    if not largest:
        return document
    striker = {**document.data.get("impactor", {}), **largest}
    return replace(document, data={**document.data, "impactor": striker})


#: Share of the studies in which a draw exceeds the value for which the patch is chosen.
EXCEEDED = 0.01
