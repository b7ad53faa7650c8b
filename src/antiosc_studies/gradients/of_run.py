"""Derivatives of a run's result by the numbers of its march, and by its bodies' modes."""

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

#: A touch or release grazes if its speed is below this share of the fastest one.
GRAZING = 1e-6


def shown_goal(goal: str | Callable[[Sampled], float]) -> str:
    """The name of a goal or of a goal function."""
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
    record = recorded(hit)
    _refuse(record)
    return _derived(record, seeds(record, goal, contact_number(record, contact), time))


def second_peak(record: Recorded, contact: tuple[str, str] | None) -> Taken | None:
    """As `derived` for the second largest peak; None if it is not near the largest."""
    peak = next_peak(record, contact_number(record, contact))
    if peak is None:
        return None
    return _derived(record, peak)


def _derived(record: Recorded, goal_seeds: Seeds) -> Taken:
    """The backward pass for a goal; NotDifferentiableError for a grazing contact."""
    places, weights = goal_seeds.arrays(2 * record.system.omega.size + len(record.system.beta))
    weights = first_order_weights(record, weights)
    s = record.system.marched
    slopes, grazing, status = adjoint.gradient(
        s, record.run, record.states(), places, weights, goal_seeds.force, goal_seeds.time
    )
    if status == library.TOO_MANY_STEPS:
        raise NotDifferentiableError(
            "a contact lasts so long that its steps pass over the vibrations of the bodies, of"
            " which no derivatives are known: give simulate a step."
        )
    if status != library.DONE or not grazing > GRAZING:
        raise NotDifferentiableError(
            f"a contact grazes: it touches or parts at {max(grazing, 0.0):.1g} of the"
            f" fastest speed, and the goal has no derivative there; change an input slightly."
        )
    if record.system.first is None:
        slopes = settled(record, slopes)
    return record, goal_seeds, slopes


def settled(record: Recorded, slopes: adjoint.Slopes) -> adjoint.Slopes:
    """The derivatives `slopes` with those through the initial forces and the initial state
    added.
    """
    closed = record.scene.preload or record.system.pressed.any()
    if closed:
        return through_start(record, slopes)
    return slopes


def _refuse(record: Recorded) -> None:
    """Raise InputError for user-defined laws."""
    for law in record.laws:
        if not is_compiled(law):
            raise InputError(
                f"{type(law).__name__} is a law made elsewhere, whose derivatives are not known:"
                f" use a law of antiosc, or Tabulated."
            )


def contact_number(record: Recorded, contact: tuple[str, str] | None) -> int:
    """Number of the contact; it may be omitted if there is only one."""
    ends = contact_ends(record)
    if contact is None and len(ends) == 1:
        return 0
    for i, pair in enumerate(ends):
        if isinstance(contact, tuple | list) and [*pair] == [str(end) for end in contact]:
            return i
    contact_names = ", ".join(map(str, ends))
    raise InputError(f"contact must be one of {contact_names}; got {checks.shown(contact)}.")


def contact_ends(record: Recorded) -> list[tuple[str, str]]:
    """The names of the ends of each contact."""
    return [(contact.a, contact.b) for contact in record.scene.contacts]


def by_modes(
    record: Recorded, goal_seeds: Seeds, slopes: adjoint.Slopes, name: str
) -> ByModes | None:
    """Derivatives by the modes of a body with one site; None for other bodies."""
    s = record.system
    span = record.spans[name]
    columns = record.columns[name]
    place = record.places[name]
    k = columns.start
    one_site = columns.stop - columns.start == 1
    modes = record.bodies[name].modes
    if record.coupled(name) or record.driven or not one_site or not isinstance(modes, ModalBody):
        return None
    return ByModes(
        modes=modes,
        square=slopes.square[place],
        decay=slopes.decay[place],
        site=slopes.beta[:, place].T @ record.G[:, k] + goal_seeds.B[span, k],
        r=float(record.G[:, k] @ slopes.residual @ record.G[:, k] + goal_seeds.r[k, k]),
        load=slopes.loads[:, place].sum(axis=0),
        start=slopes.v[place],
        v=s.v[span],
        g=s.loads[0, span],
    )


def model_name(record: Recorded) -> str:
    """The name of the only body that is an extracted model."""
    models = [n for n, body in record.bodies.items() if isinstance(body.body, AntiOscillators)]
    if len(models) != 1:
        raise InputError(
            f"part needs a run with one extracted model; this one has {len(models)} models."
        )
    return models[0]
