"""Replaces "auto" in scenes by numbers, with the rules of `antiosc.strikes.defaults`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from antiosc.base.errors import warnings_to
from antiosc.base.texts import STOPPED
from antiosc.models.body import AUTO
from antiosc_app.kept import CachedEvaluation, PartCache
from antiosc_app.scene_file.compiled import (
    AutoValues,
    compile_document,
    is_auto,
    only_site_table,
    with_auto_values,
)
from antiosc_app.scene_file.document import Document
from antiosc_app.scene_file.scene import CompiledScene

if TYPE_CHECKING:
    from antiosc import History, Structure

T = TypeVar("T")


class SettledScene(NamedTuple):
    """A scene with numbers instead of "auto", and the evaluation with its results."""

    scene: CompiledScene
    evaluation: CachedEvaluation


def begin_settling(document: Document, cache: PartCache | None = None) -> SettledScene:
    """The scene of a document with first values for "auto"; `cache`: results of earlier runs."""
    scene = compile_document(document)
    return SettledScene(scene, (cache or PartCache()).cached_evaluation(scene.document))


def settle(document: Document, begun: SettledScene | None = None) -> SettledScene:
    """The scene of a document with final values for "auto".

    They suit the hardest striker of [sweep] or [monte_carlo]; `begun`: result of `begin_settling`,
    if known.
    """
    begun = begun or begin_settling(document)
    scene, evaluate = begun
    if scene.document is document or scene.history is None:
        return begun

    messages: list[str] = list(scene.warnings)
    with warnings_to(messages.append):  # what was left out of the file
        structure = evaluate(scene.structure)
    hardest = _with_hardest_striker(document, scene)
    told: list[str] = []
    choice = AutoValues(radius=_patch_radius(structure, compile_document(hardest), document))

    def run_choice(choice: AutoValues) -> tuple[SettledScene, History]:
        told.clear()  # of the last run alone
        with warnings_to(told.append):
            one = begin_settling(with_auto_values(hardest, choice), evaluate.kept)
            return one, one.evaluation(one.scene.history)

    grows = is_auto(document, "extract", "n")
    lasts = is_auto(document, "simulate", "duration")
    result, choice = repeat_until_enough(run_choice, choice, grows, lasts)

    if hardest is not document:  # its warnings are not those of the scene's own impact
        told.clear()
        with warnings_to(told.append):
            result = begin_settling(with_auto_values(document, choice), evaluate.kept)
            result.evaluation(result.scene.model)
    result.scene.warnings[:] = list(dict.fromkeys(messages + told))
    return result


def repeat_until_enough(
    run: Callable[[AutoValues], tuple[T, History]],
    choice: AutoValues,
    add_oscillators: bool,
    extend_duration: bool,
) -> tuple[T, AutoValues]:
    """Repeat `run` with more oscillators or longer; returns (last result, its values).

    `add_oscillators`: until there are enough oscillators; `extend_duration`: until the bodies have
    separated.
    """
    from antiosc.impact.histories.site_motion import LONGER, parted
    from antiosc.strikes.defaults import expansion_frequency, next_count

    longest = LONGER * choice.duration
    while True:
        result, hit = run(choice)
        if hit.status == STOPPED or hit.assembly.theory_warning:
            return result, choice

        more = next_count(hit) if add_oscillators else None
        if more is not None and more > choice.oscillator_count:  # else the part has no more
            choice = choice._replace(oscillator_count=more, expansion=expansion_frequency(hit))
        elif extend_duration and choice.duration < longest and not parted(hit):
            choice = choice._replace(duration=2 * choice.duration)
        else:
            return result, choice


def _patch_radius(
    structure: Structure | None, scene: CompiledScene, document: Document
) -> float | None:
    """Radius [m] of the patch at the only site if it is "auto"; else, or for [strike], None."""
    call = scene.model or scene.history
    if structure is None or call is None or only_site_table(document).get("radius") != AUTO:
        return None
    from antiosc.strikes.defaults import patch_radius

    bodies = (scene.impactor, scene.contact)
    striker, law = (None if one is None else one.result for one in bodies)
    site = call.arguments["site"].result
    return None if striker is None else patch_radius(structure, site, striker, law or AUTO)


def _with_hardest_striker(document: Document, scene: CompiledScene) -> Document:
    """The document with the largest values that [sweep] and [monte_carlo] give the striker."""
    largest: dict[str, Any] = {}
    swept = document.data.get("sweep", {}).get("impactor", {})
    for key, values in swept.items():
        if isinstance(values, list) and all(isinstance(x, int | float) for x in values):
            largest[key] = max(values)

    drawn = {} if scene.sample is None else scene.sample.arguments
    share = 1 - EXCEEDED_SHARE / drawn.get("n", 1000)
    for name, law in drawn.get("inputs", {}).items():
        section, _, key = name.partition(".")
        if section == "impactor" and hasattr(law.result, "ppf"):
            largest[key] = float(law.result.ppf(share))

    if not largest:
        return document
    striker = {**document.data.get("impactor", {}), **largest}
    return replace(document, data={**document.data, "impactor": striker})


#: Share of the studies in which a draw exceeds the value for which the patch is chosen.
EXCEEDED_SHARE = 0.01
