"""The change of a goal between two sets of bodies, to first order."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.base.errors import NotDifferentiableError
from antiosc.contact import ContactLaw
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.simulation.assembly import Assembly, assemble
from antiosc.simulation.engine import Slopes
from antiosc.simulation.history import History
from antiosc.simulation.two_bodies import pose
from antiosc.studies.gradients.goals import Seeds
from antiosc.studies.gradients.recorded import Recorded

#: Options of `simulate` that its error control reads.
LIMITS = ("max_contacts", "max_steps")


def changed(found: Recorded, wanted: Seeds, by: Slopes, before: Assembly, after: Assembly) -> float:
    """Change of the goal from one set of bodies to another, to first order."""
    a, b = before.system, after.system
    if a.omega.shape != b.omega.shape or found.system.omega.shape != a.omega.shape:
        raise NotDifferentiableError(
            "the number of modes changes with an input: build models with as many anti-oscillators."
        )
    pairs = [
        (by.square, b.omega**2 - a.omega**2), (by.decay, b.decay - a.decay),
        (by.beta, b.beta - a.beta), (by.residual, b.R - a.R), (by.loads, b.loads - a.loads),
        (by.offsets, b.offsets - a.offsets), (by.q, b.q - a.q), (by.v, b.v - a.v),
        (wanted.B, after.B - before.B), (wanted.r, after.r - before.r),
    ]  # fmt: skip
    total = sum(float(np.sum(slope * change)) for slope, change in pairs)
    for slope, old, new in zip(by.laws, a.laws, b.laws, strict=True):
        total += float(slope @ (_leading(new) - _leading(old)))
        if old.kernel[0].kind == march.TABLE and old is not new:  # type: ignore[attr-defined]
            raise NotDifferentiableError(
                "there are no derivatives by the curves of a table: make it outside of build."
            )
    return total


def _leading(law: ContactLaw) -> Array:
    """The parameters that the march has derivatives by, then 0."""
    kind, values = law.kernel[0].kind, law.parameters()  # type: ignore[attr-defined]
    count = {march.TABLE: 0, march.HERTZ: 2}.get(kind, march.LAW_SLOPES)
    found = np.zeros(march.LAW_SLOPES)
    found[: min(count, len(values))] = values[:count]
    return found


def options_of(hit: History) -> dict[str, Any] | None:
    """The arguments of `simulate` of a run, beside the model; None of a scene."""
    again = hit.budget.keywords["again"] if isinstance(hit.budget, partial) else None
    return None if again is None else dict(again.keywords["options"])


def with_model(hit: History, name: str, model: AntiOscillators) -> Assembly:
    """The bodies of a run, ready to integrate, with another model in place of the body `name`."""
    options = options_of(hit)
    if options is not None:
        return pose(model, **{n: v for n, v in options.items() if n not in LIMITS})
    scene = hit.assembly.scene
    return assemble(replace(scene, bodies={**scene.bodies, name: model}), float(hit.run.time[-1]))
