"""An impact whose patch, number of anti-oscillators and duration nobody gave.

It is repeated with a larger patch until that carries the force, by the lowest yield strength too,
with more anti-oscillators until what they leave out hardly changes the force, and longer until the
bodies have parted and the largest deflection is past.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from math import floor, inf, log2
from typing import NamedTuple, TypeVar

from antiosc import AntiOscillators, History, truncation_error
from antiosc.base.errors import ChoiceWarning, RangeError, warn, warnings_to
from antiosc.base.texts import engineering, percent, rounded_up
from antiosc.extension import (
    enough_radius,
    is_far,
    may_stretch,
    out_of_reach,
    taken_as_linear,
)
from antiosc.models.body import half_period

T = TypeVar("T")
#: First duration of an impact [s].
DURATION = 1e-3
#: Largest duration over it, and the largest number of runs.
LONGER, MOST_RUNS = 32, 12
#: Of a striker that is not known to be out of a sheet's reach: one that leaves it with less of its
#: speed may meet it again: one sheet returned 0.0113 within 2 ms and 0.841 within 8 ms, with the
#: largest force in between.
LEAST_RETURN = 0.2
#: Duration of the impacts of a map over the contact at the site that is struck: softer sites are
#: touched longer. Of 1282 sites of a flanged ring 613 were still touched at the end without it,
#: none with.
LONGER_OF_MAP = 2.0
#: Numbers of anti-oscillators, and the share of the error of the force by truncation from which the
#: next one is taken. A printed bar of 13.6 × 5 × 100 mm: 40 % with 20, 0.05 % with 80. A sheet of
#: 85 572 dofs under a ball of 20 mm: 1205, 521, 416 and 407 N with 20, 150, 400 and 800.
OSCILLATORS = (20, 60, 150, 400)
#: Expansion points are at this share of the inverse of the contact time, or down to half of it. Of
#: 1 mm of aluminium under a ball for 41 µs the force was 120 and 36 % off with 60 and 150
#: anti-oscillators about the static point, 2.5 and 0.2 % with a share of 0.67. With twice as much
#: later impacts on it were 25 % off at an estimate of 8 % (measured).
EXPANSION = 0.7
MOST_TRUNCATION = 0.1
#: Largest product of dofs and anti-oscillators: 3.4e7 took 85 s for this sheet, beside other work.
MOST_WORK = 8e7


class Choice(NamedTuple):
    """The radius [m] of a patch, None for that of the mesh, and the duration [s] of an impact.

    `keeps_radius`, `keeps_duration`: whether they were given. `n`: number of anti-oscillators; None
    if it was given. `expansion`: frequency of their expansion point [Hz]; None: static, or given.
    """

    radius: float | None
    duration: float = DURATION
    keeps_radius: bool = False
    keeps_duration: bool = False
    n: int | None = None
    expansion: float | None = None


def until_parted(
    run: Callable[[Choice], T],
    hit_of: Callable[[T], History],
    first: Choice,
    *,
    longest: float = LONGER * DURATION,
    is_sheet: bool = False,
    probed: Callable[[T], Mapping[str, float]] = lambda _: {},
) -> tuple[T, Choice]:
    """(result of the last run, its values), with the warnings of that run and why it has more
    anti-oscillators than the first.

    `longest`: largest duration [s]; `probed`: the errors of further quantities of a result by
    truncation, by their names, which more anti-oscillators reduce too.

    Raises
    ------
    RangeError
        The patch is too small for the force, and was given, or a larger one is no remedy.
    """
    choice = first
    reason = ""
    # a patch that is too small deflects too much, and second-order forces take most of the time
    linear = choice.n is not None or not choice.keeps_radius
    for number in range(MOST_RUNS):
        messages: list[str] = []  # of the run that is kept
        try:
            with warnings_to(messages.append), taken_as_linear() if linear else nullcontext():
                result = run(choice)
        except RangeError as error:
            if error.radius is None or choice.keeps_radius or number == MOST_RUNS - 1:
                raise
            choice = choice._replace(radius=rounded_up(error.radius))
            continue
        hit = hit_of(result)
        if hit.assembly.hopeless:
            if choice.keeps_duration or choice.duration >= longest or parted(hit):
                break
            choice = choice._replace(duration=min(2 * choice.duration, longest))
            continue
        radius = None if choice.keeps_radius else enough_radius(hit)
        if radius is not None and number < MOST_RUNS - 1:
            choice = choice._replace(radius=rounded_up(radius))
            continue
        if choice.n is not None and hit.rerun is not None:
            force = truncation_error(hit.model, hit.rerun).peak_force
            errors = {"the peak force": force, **probed(result)}
            worst = max(errors, key=errors.__getitem__)
            more = next_count(choice.n, errors[worst], hit.model)
            if more > choice.n:
                reason = why_more(choice.n, more, errors[worst], worst)
                choice = choice._replace(n=more, expansion=expansion_of(hit))
                continue
        enough = _enough(hit, is_sheet)
        short = not choice.keeps_duration and choice.duration < min(enough, longest)
        # one that is far off at the end of a short run may be hopeless at that of a longer one
        waits = short and not parted(hit) and is_far(hit)
        if linear and may_stretch(hit) and not waits and number < MOST_RUNS - 1:
            linear = False
            continue
        if not short:
            break
        choice = choice._replace(duration=min(rounded_up(enough), longest))
    if reason:
        warn(reason, ChoiceWarning)
    for message in messages:
        warn(message)
    return result, choice


def next_count(n: int, truncation: float, model: AntiOscillators) -> int:
    """The next larger number of anti-oscillators; n itself if its share of the error of the force
    by truncation allows it, or more would take too long.
    """
    _, *larger = counts_from(n, model.info.dofs or 0)
    return n if truncation <= MOST_TRUNCATION or not larger or model.n < n else larger[0]


def expansion_of(hit: History) -> float:
    """Frequency [Hz] about which more anti-oscillators converge first, by the contact time; a power
    of two, so that blows that are alike share a factor.
    """
    return float(2.0 ** floor(log2(EXPANSION / hit.assembly.contact_time_estimate)))


def counts_from(n: int, dofs: float) -> list[int]:
    """n, and the larger numbers of anti-oscillators that the force may need and that do not take
    too long on a part of so many dofs.
    """
    return [n, *(count for count in OSCILLATORS if n < count and count * dofs <= MOST_WORK)]


def why_more(n: int, more: int, truncation: float, of: str = "the peak force") -> str:
    """Why more than n anti-oscillators were taken."""
    return (
        f"{more} anti-oscillators were taken: with {n}, those left out were estimated to change"
        f" {of} by {percent(truncation)}."
    )


def tell_radius(first: float | None, taken: float | None) -> None:
    """A note of the radius [m] of a patch that has grown from the first one."""
    if taken is not None and taken != first:
        text = f"The patch has grown to a radius of {engineering(taken, 'm')}, which carries"
        warn(f"{text} the force.", ChoiceWarning)


def _enough(hit: History, is_sheet: bool) -> float:
    """Duration [s] in which the bodies part, and the slowest mode of the part moves to its largest
    deflection and back: a half of its period after the contact.

    A sheet may swing after its striker: that must be out of reach.
    """
    end = float(hit.run.time[-1])
    if not parted(hit):
        return 2 * end
    away = out_of_reach(hit) if is_sheet else end
    if away is None:
        away = end if parted(hit, LEAST_RETURN) else inf
    half = half_period(hit.assembly.bodies["structure"].omega)
    released = hit.contacts[-1][1] if hit.contacts else 0.0
    swing = released + half if half else end
    return max(swing, min(away, 2 * end))


def parted(hit: History, least: float = 0.0) -> bool:
    """Whether striker and part neither touch nor approach at the end, as far as is known.

    `least`: restitution from which they do not meet again.
    """
    contacts = hit.contacts
    touching = bool(contacts) and contacts[-1][1] >= hit.time[-1]
    return not touching and (hit.restitution is None or hit.restitution >= least)


def duration_of_map(hit: History) -> float:
    """Duration [s] of the impacts of a map around the site of `hit`: that of `hit`, or longer."""
    released = hit.contacts[-1][1] if hit.contacts else 0.0
    contact = LONGER_OF_MAP * max(released, DURATION)
    return max(contact, float(hit.run.time[-1]))
