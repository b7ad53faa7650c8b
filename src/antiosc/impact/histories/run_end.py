"""The end of a run: status, message and warnings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from antiosc.base import errors
from antiosc.base._types import Array
from antiosc.base.checks import ROUNDING
from antiosc.base.texts import COMPLETED, INEXACT, STOPPED, TOUCHING
from antiosc.engine import library
from antiosc.engine.march import Converged, Run, stop_text
from antiosc.engine.system import System
from antiosc.impact.assembly import Assembly

#: Messages of a run that was completed, and of a run without contact.
COMPLETED_MESSAGE, UNTOUCHED_MESSAGE = "Completed.", "Never touched"
#: Largest number of contacts, and of scenes of a batch, that a message names.
_MAX_NAMED = 5


class RunEnd(NamedTuple):
    """Data on the end of a run, from which `status_of` makes status and message."""

    answer: int  # status of the C library
    time: float  # time reached [s]
    touches: int  # number of touches
    closed_contacts: Sequence[int]  # numbers of the contacts still closed
    force_error: float  # relative, as of `Converged`
    peak_error: float  # the same
    agreed_until: float  # time [s] up to which two runs agree


def open_contacts(run: Run, system: System) -> list[int]:
    """Contacts that touched during the run and are closed at its end."""
    if len(system.laws) == 1 and (not len(run.events) or run.events[-1, 2] == library.APART):
        return []

    events = run.events.tolist()
    last = {contact: piece for _, contact, piece, _ in events}
    touching = sorted(int(c) for c, piece in last.items() if piece != library.APART)
    parted = (
        {contact for _, contact, piece, _ in events if piece == library.APART} if touching else ()
    )

    return [c for c in touching if c in parted or not system.closed[c]]


def status_of(
    assembly: Assembly, ended: RunEnd, tol: float, limits: tuple[int, int]
) -> tuple[int, str]:
    """(status, message) of a run to a tolerance; limits : max_contacts, max_steps."""
    if failure := stop_text(ended.answer, ended.time, *limits):
        return STOPPED, failure[0].upper() + failure[1:] + "."

    message = cut_short_message(assembly, ended)
    if doubt := inexact_message(ended, tol, limits[1]):
        return INEXACT, f"{doubt} {message}".rstrip()
    if untouched := no_contact_message(assembly, ended):
        return COMPLETED, f"{UNTOUCHED_MESSAGE}: {untouched}."
    return (TOUCHING, message) if message else (COMPLETED, COMPLETED_MESSAGE)


def warn_unless_completed(status: int, message: str) -> None:
    """Warn at the caller's line with the message of a run whose status is not 0."""
    if message == COMPLETED_MESSAGE:
        return

    expected = not status and message.startswith(UNTOUCHED_MESSAGE)
    text = message.removeprefix(COMPLETED_MESSAGE).lstrip()
    errors.warn(text, None if expected else errors.AccuracyWarning)


def inexact_message(ended: RunEnd | Converged, tol: float, max_steps: int) -> str:
    """Reason why a complete run does not meet the tolerance; "" if it does."""
    worst = max(ended.force_error, ended.peak_error)
    if worst <= tol:
        return ""

    told = (
        f"The contact forces did not converge: finer runs within max_steps = {max_steps} differ by"
        f" {worst:.2g}, not tol = {tol:g} (if they rattle, small errors grow)."
    )
    if worst == np.inf:
        told = f"The error is not known: max_steps = {max_steps} leaves no finer run to the end."
    agreement = ""
    if ended.agreed_until > 0:
        agreement = f" Up to {ended.agreed_until:.4g} s runs agree."
    return f"{told}{agreement} Raise max_steps, or shorten the duration."


def cut_short_message(assembly: Assembly, ended: RunEnd) -> str:
    """Warning of contacts that are still closed at the end; "" if there are none."""
    contacts = [assembly.scene.contacts[c] for c in ended.closed_contacts]
    if not contacts:
        return ""

    names = ", ".join(f"{c.a!r} - {c.b!r}" for c in contacts[:_MAX_NAMED])
    ellipsis = ", ..." if len(contacts) > _MAX_NAMED else ""

    return (
        f"The run ends during contact of {names}{ellipsis}: contact time, impulse and peak force"
        f" are those up to {ended.time:g} s; lengthen the duration."
    )


def no_contact_message(assembly: Assembly, ended: RunEnd) -> str:
    """Reason why nothing touched, such as a wrong sign; "" if something touched."""
    system = assembly.system
    if ended.touches or np.any(system.start_forces):
        return ""

    p = len(assembly.laws)
    speed = _without_rounding(system.beta[:p], system.v)
    acceleration = _without_rounding(system.beta[:p], system.loads[0])

    for motion, unit in ((speed, "m/s"), (acceleration, "m/s^2")):
        c = int(np.argmax(motion))
        contact = assembly.scene.contacts[c]
        rate = float(motion[c])
        gap = f"the gap of {system.offsets[0, c]:g} m of {contact.a!r}, {contact.b!r}"
        if rate > 0:
            return (
                f"{gap} closes at {rate:g} {unit} at first and was not closed within"
                f" {ended.time:g} s; lengthen the duration"
            )
        if np.any(motion < 0):
            return (
                f"{gap} opens at {-rate:g} {unit} at first; if it should close, reverse the sign of"
                " the velocity or gravity or, in a scene, the ends"
            )

    return (
        "nothing moves the bodies toward each other at the start; give one a velocity > 0, or"
        " gravity, or lengthen the duration"
    )


def _without_rounding(beta: Array, modal: Array) -> Array:
    """The product beta · modal (p,), with 0 for values that consist of rounding."""
    product = beta @ modal
    return np.where(abs(product) > ROUNDING * (abs(beta) @ abs(modal)), product, 0.0)


def scenes_text(scenes: Sequence[int], size: int, worst: int) -> str:
    """Text: number of the `scenes` out of `size`, the first of their numbers, the worst scene."""
    more = ", ..." * (len(scenes) > _MAX_NAMED)
    numbers = ", ".join(map(str, scenes[:_MAX_NAMED]))
    return f"{len(scenes)} of {size} scenes ({numbers}{more}), as scene {worst}"


def warn_of_batch(results: Sequence[tuple[int, str]], needed_radii: Sequence[float]) -> None:
    """Warn once per status, with the message of the scene that needs the largest radius [m]."""
    kinds: dict[int, list[int]] = {}
    for i, (status, message) in enumerate(results):
        if message != COMPLETED_MESSAGE:
            kinds.setdefault(status, []).append(i)

    for status, scenes in kinds.items():
        worst = max(scenes, key=needed_radii.__getitem__)
        errors.warn(
            f"{scenes_text(scenes, len(results), worst)}: {results[worst][1]}",
            errors.AccuracyWarning if status else errors.AntioscWarning,
        )
