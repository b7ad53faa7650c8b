"""Derivatives of a run's result by the numbers of its march, and by the modes of its bodies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from antiosc import AntiOscillators, ModalBody
from antiosc.base import checks
from antiosc.base.errors import InputError, NotDifferentiableError
from antiosc.engine import adjoint, library
from antiosc.engine.contact.base import is_compiled
from antiosc_studies.gradients.changes import ByModes, Taken, first_order_weights, through_start
from antiosc_studies.gradients.goals import Recorded, Sampled, Seeds, next_peak, recorded, seeds

#: Speed of a touch or release, over the fastest, below which it grazes.
GRAZING = 1e-6


def shown_goal(goal: str | Callable[[Sampled], float]) -> str:
    """The name of a goal, or of a function."""
    if isinstance(goal, str):
        return goal
    return str(getattr(goal, "__name__", "goal"))


def derived(
    hit: Any,
    goal: str | Callable[[Sampled], float],
    contact: tuple[str, str] | None = None,
    time: float | None = None,
) -> Taken:
    """(recorded run, goal, derivatives by all numbers of the system); see `gradient`."""
    found = recorded(hit)
    _refuse(found)
    return _derived(found, seeds(found, goal, contact_number(found, contact), time))


def second_peak(found: Recorded, contact: tuple[str, str] | None) -> Taken | None:
    """As `derived` for the second largest peak; None if it is not near the largest."""
    wanted = next_peak(found, contact_number(found, contact))
    if wanted is None:
        return None
    return _derived(found, wanted)


def _derived(found: Recorded, wanted: Seeds) -> Taken:
    places, weights = wanted.arrays(2 * found.system.omega.size + len(found.system.beta))
    weights = first_order_weights(found, weights)
    s = found.system.marched
    slopes, grazing, answer = adjoint.gradient(
        s, found.run, found.states(), places, weights, wanted.force, wanted.time
    )
    if answer == library.TOO_MANY_STEPS:
        raise NotDifferentiableError(
            "a contact lasts so long that its steps pass over the vibrations of the bodies, of"
            " which no derivatives are known: give simulate a step."
        )
    if answer != library.DONE or not grazing > GRAZING:
        raise NotDifferentiableError(
            f"a contact grazes: it touches or parts at {max(grazing, 0.0):.1g} of the"
            f" fastest speed, and the goal has no derivative there; change an input slightly."
        )
    if found.system.first is None:
        slopes = settled(found, slopes)
    return found, wanted, slopes


def settled(found: Recorded, slopes: adjoint.Slopes) -> adjoint.Slopes:
    """The derivatives including those through the initial forces and state."""
    closed = found.scene.preload or found.system.pressed.any()
    if closed:
        return through_start(found, slopes)
    return slopes


def _refuse(found: Recorded) -> None:
    for law in found.laws:
        if not is_compiled(law):
            raise InputError(
                f"{type(law).__name__} is a law made elsewhere, whose derivatives are not known:"
                f" use a law of antiosc, or Tabulated."
            )


def contact_number(found: Recorded, contact: tuple[str, str] | None) -> int:
    """Number of the contact; it need not be given if there is only one."""
    ends = contact_ends(found)
    if contact is None and len(ends) == 1:
        return 0
    for i, pair in enumerate(ends):
        if isinstance(contact, tuple | list) and [*pair] == [str(end) for end in contact]:
            return i
    listed = ", ".join(map(str, ends))
    raise InputError(f"contact must be one of {listed}; got {checks.shown(contact)}.")


def contact_ends(found: Recorded) -> list[tuple[str, str]]:
    """The names of the ends of each contact."""
    return [(contact.a, contact.b) for contact in found.scene.contacts]


def by_modes(found: Recorded, wanted: Seeds, slopes: adjoint.Slopes, name: str) -> ByModes | None:
    """Derivatives by the modes of a body of one site; None for other bodies."""
    s = found.system
    span = found.spans[name]
    columns = found.columns[name]
    at = found.places[name]
    k = columns.start
    one_site = columns.stop - columns.start == 1
    modes = found.bodies[name].modes
    if found.coupled(name) or found.driven or not one_site or not isinstance(modes, ModalBody):
        return None
    return ByModes(
        modes=modes,
        square=slopes.square[at],
        decay=slopes.decay[at],
        site=slopes.beta[:, at].T @ found.G[:, k] + wanted.B[span, k],
        r=float(found.G[:, k] @ slopes.residual @ found.G[:, k] + wanted.r[k, k]),
        load=slopes.loads[:, at].sum(axis=0),
        start=slopes.v[at],
        v=s.v[span],
        g=s.loads[0, span],
    )


def model_name(found: Recorded) -> str:
    """The name of the only body that is an extracted model."""
    models = [n for n, each in found.bodies.items() if isinstance(each.body, AntiOscillators)]
    if len(models) != 1:
        raise InputError(
            f"part needs a run with one extracted model; this one has {len(models)} models."
        )
    return models[0]
