"""Speeds of a striker from which a part yields outside the contact, by impacts at other speeds.

Place, mesh and patch are those of one impact; force, contact and errors those of each speed. The
stress at the place is that of the motion there, no share of the force: the longer a contact takes,
the more of its force arrives.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from math import exp, log, trunc
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from antiosc.base._types import Array
from antiosc.base.errors import AntioscError, InputError, RangeError
from antiosc.base.stresses import length
from antiosc.base.texts import engineering, plain
from antiosc.fem.structure.structure import Structure
from antiosc.fields.fields import shapes_of, stress_amplitudes
from antiosc.fields.margin import Margin, Zones, zones_of, zones_on
from antiosc.impact.histories import History
from antiosc.impact.histories.verdict import yield_share

#: Largest ratio of the speeds to that of the impact, either way.
FURTHEST = 30.0
#: Longest step in the logarithm of a speed, and its error.
STEP, CLOSE = log(1.5), 0.01
#: Share by which a step goes beyond the root of a line, and the least power of the speed with which
#: a stress grows in it.
BEYOND, SLOWEST = 1.05, 0.25
#: Power of the speed with which the force of an elastic sphere grows.
ELASTIC = 1.2
#: Time that an impact at another speed is followed, over that of the stress and of the largest
#: force, or the end of their touch: at a thirtieth of the speed a contact takes twice as long.
AS_LONG = 3.0
#: Logarithm that stands for an exposure of 0.
NOTHING = -50.0
#: Largest ratio of a speed to that of the impact, where the patch is too small for the contact, so
#: that the growth of the exposure from half the speed of the impact to it is extrapolated.
EXTRAPOLATED = 3.0
#: Most places that larger contacts cover one after the other, and the ratio of two speeds that are
#: the same. An idler of PETG yielded from 2.1 m/s on at the place of 1 m/s, which the contact of
#: 2.1 m/s covers, and from 4 m/s on in a run at that speed.
MOST_PLACES, SAME = 5, 1.05
#: Times at which a stress is evaluated besides those of the history, and the most of these: all of
#: 110 000 steps with 152 motions took 8 s at each speed.
TIMES, MOST_TIMES = 2000, 10_000
#: Times at which it is evaluated at once: a rattling run of 536 000 steps with 152 motions took
#: 15 GB in one piece.
AT_ONCE = 8192
#: Steps of a run up to which its speeds are sought, each by several runs: of 536 000 steps, a thin
#: tongue that rattles for 30 ms, they took more than 4 minutes beside 30 s of the impact. No run at
#: another speed has more.
MOST_STEPS = 200_000
#: Speed [m/s] up to which that of the contact is told: that of a rubber tip is thousands.
FASTEST = 300.0
#: Name of the struck part of an impact of two bodies.
PART = "structure"


#: What is told of the speed that was not found beside the other one.
NOT_FOUND = {
    "may be reached": "; from which lower speed on it may be reached was not found",
    "is certain": "; no speed was found from which it is certain",
}


class YieldSpeeds(NamedTuple):
    """Speeds of the striker [m/s] from which yield may be reached, and is reached for certain,
    within the errors of the stress and the range of the strength; None: not found.

    `contact`: that from which the contact itself yields, by the strength of its law.
    `extrapolated`: those that are extrapolated, since the patch is too small for their contacts.
    `left_out`: names of the sharp edges and supports that the place is away from.
    `sought`: whether the speeds of the place were sought; `steps`: of a run that has too many.
    """

    possible: float | None
    certain: float | None
    extrapolated: tuple[float | None, ...] = ()
    contact: float | None = None
    left_out: str = ""
    sought: bool = False
    steps: int = 0

    @property
    def sentence(self) -> str:
        """The speeds of the place and that of the contact; "" without any."""
        sentences = [self._of_place, self._of_contact]
        return "; ".join(filter(None, sentences))

    @property
    def _of_contact(self) -> str:
        """The speed of the contact itself as text; "" where it is not known."""
        if self.contact is None or self.contact > FASTEST:
            return ""
        speed = engineering(self.contact, "m/s", 2)
        told = f"the contact itself yields, and a dent remains, from about {speed} on"
        return f"{told}{self._how(self.contact)}"

    @property
    def _of_place(self) -> str:
        """The speeds of the place with what is held; "" without any."""
        if self.steps:
            return (
                "the speeds from which the part yields are not sought, as the run has"
                f" {plain(self.steps)} steps: damping or a shorter duration takes fewer"
            )
        ends = {"may be reached": self.possible, "is certain": self.certain}
        told = [
            f"{what} from about {engineering(speed, 'm/s', 2)} on{self._how(speed)}"
            for what, speed in ends.items()
            if speed is not None
        ]
        away = f", and away from {self.left_out}," * bool(self.left_out)
        if not told:
            missed = f"no speed was found from which yield outside the contact{away} may be reached"
            return missed * self.sought
        held = "the same striker, mesh and patch at other speeds"
        missing = [what for what, speed in ends.items() if speed is None]
        other = "".join(NOT_FOUND[what] for what in missing)
        return f"yield outside the contact{away} {', and '.join(told)}{other}: {held}"

    def _how(self, speed: float) -> str:
        """Text: that a speed is extrapolated; "" of others."""
        return " (extrapolated, as the patch is too small for it)" * (speed in self.extrapolated)


def yield_speeds(
    structure: Structure,
    hit: History,
    worst: Margin,
    force: Callable[[History], float],
    beyond: Callable[[Array], Margin | None] = lambda _: None,
) -> YieldSpeeds:
    """The speeds of the striker from which the worst point of an impact yields.

    `force`: relative error of the force of an impact; `beyond`: the margin of the impact without
    the stresses in balls (n, 4). A faster striker has a larger contact, which may cover the worst
    point: the place is then the worst one beyond. All ranks must call it.
    """
    speed, simulated = getattr(hit.impactor, "velocity", None), hit.at_speed
    if not (isinstance(speed, float) and speed > 0 and hit.contacts):
        return YieldSpeeds(None, None)
    if simulated is None or worst.columns is None:
        return YieldSpeeds(None, None)
    if hit.time.size > MOST_STEPS:
        return YieldSpeeds(None, None, steps=hit.time.size)
    touching = _as_long(hit, 0.0)

    def at_speed(other: float) -> History:
        """The contact at another speed."""
        return simulated(other, touching)

    contact = _speed_of_contact(hit, at_speed, speed)
    error = _force_errors(hit, force, _as_long(hit, worst.time))
    speeds = _of_place(structure, hit, worst, error, contact)
    for _ in range(MOST_PLACES):
        before = speeds.possible
        if before is None or before in speeds.extrapolated:
            break
        farther = beyond(zones_of(at_speed(before), PART).balls)
        if farther is None:
            break
        found = _of_place(structure, hit, farther, error, contact)
        if found.possible is None or found.possible < SAME * before:
            break
        speeds = found
    return speeds


def _of_place(
    structure: Structure,
    hit: History,
    worst: Margin,
    error: Callable[[float], float],
    contact: _Found,
) -> YieldSpeeds:
    """The speeds from which one point yields, beside that of the `contact`; `error`: that of the
    force at the speed exp(x).
    """
    columns, simulated = worst.columns, hit.at_speed
    if columns is None or simulated is None:
        return YieldSpeeds(None, None, contact=contact.speed)
    speed = hit.impactor.velocity
    shapes = shapes_of(structure, hit, PART)
    until = _as_long(hit, worst.time)
    here = _largest(structure, hit, columns)
    if not (here and hit.peak_force):  # nothing grows with the speed
        return YieldSpeeds(None, None, contact=contact.speed)

    @cache
    def bounds(x: float) -> tuple[float, float]:
        """Logarithms of the bounds of the exposure at the speed exp(x)."""
        run = _short(simulated(exp(x), until))
        zones = zones_on(structure, shapes, None, zones_of(run, PART), run, PART)
        factors = _largest(structure, run, columns) / here, run.peak_force / hit.peak_force
        least, most = _scaled(worst, factors, zones, error(x)).bounds
        return _log(least), _log(most)

    certain, possible = (_speed_of(partial(_end, bounds, end), speed) for end in (0, 1))
    extrapolated = (one.speed for one in (possible, certain, contact) if one.extrapolated)
    left_out = worst.away.names if worst.away else ""
    found = possible.speed, certain.speed, tuple(extrapolated), contact.speed
    return YieldSpeeds(*found, left_out, sought=True)


def _force_errors(
    hit: History, force: Callable[[History], float], until: float
) -> Callable[[float], float]:
    """The relative error of the force at the speed exp(x), between those at steps of the speed from
    that of an impact: each takes several runs, and changes slowly.
    """
    simulated, start = hit.at_speed, log(hit.impactor.velocity)
    assert simulated is not None

    @cache
    def after(steps: int) -> float:
        """The error that many steps away."""
        return force(_short(simulated(exp(start + steps * STEP), until)) if steps else hit)

    def error(x: float) -> float:
        place = (x - start) / STEP
        near = trunc(place)
        share = abs(place - near)
        if not share:
            return after(near)
        try:
            beyond = after(near + (1 if place > 0 else -1))
        except AntioscError:  # the patch is too small for that speed, or its run too long
            return after(near)
        return (1 - share) * after(near) + share * beyond

    return error


def _short(run: History) -> History:
    """A run at another speed; AntioscError if it has too many steps for its speeds to be sought."""
    if run.time.size > MOST_STEPS:
        raise AntioscError(f"at this speed the run has {run.time.size} steps.")
    return run


def _as_long(hit: History, time: float) -> float:
    """How long impacts at other speeds are followed [s], for what happens at a time in this one, or
    at its largest force.
    """
    contact = hit.contact_histories[0]
    time = max(time, float(contact.time[int(np.argmax(contact.force))]))
    ends = [end for start, end in hit.contacts if start <= time]
    return min(AS_LONG * max(time, *ends), float(hit.time[-1]))


def _speed_of_contact(hit: History, at_speed: Callable[[float], History], speed: float) -> _Found:
    """The speed from which the contact itself yields, near that of an elastic contact."""
    share = yield_share(hit.contact_histories[0])
    if not share:
        return _Found(None)

    def of_log(x: float) -> float:
        return _log(yield_share(at_speed(exp(x)).contact_histories[0]) or 0.0)

    return _speed_of(of_log, speed * share ** (-1 / ELASTIC))


def _log(exposure: float) -> float:
    """The logarithm of an exposure, of none a finite one."""
    return log(exposure) if exposure > 0 else NOTHING


class _Found(NamedTuple):
    """A speed [m/s], None if it was not found, and whether it is extrapolated."""

    speed: float | None
    extrapolated: bool = False


def _end(bounds: Callable[[float], tuple[float, float]], end: int, x: float) -> float:
    """One of two bounds at x."""
    return bounds(x)[end]


def _speed_of(of_log: Callable[[float], float], speed: float) -> _Found:
    """The speed at which a logarithm is 0, from that of an impact."""
    with suppress(AntioscError):
        try:
            return _Found(_root(of_log, log(speed)))
        except RangeError:  # the patch is too small for a contact at that speed
            before, here = (of_log(log(share * speed)) for share in (0.5, 1.0))
            return _Found(_extrapolated(before, here, speed), True)
    return _Found(None)


def _extrapolated(before: float, here: float, speed: float) -> float | None:
    """The speed at which a logarithm is 0, from those at half a speed and at it; None: too far, or
    nothing at one of them.
    """
    if min(before, here) <= NOTHING:
        return None
    growth = (here - before) / log(2)
    if not -here < growth * log(EXTRAPOLATED):
        return None
    return speed * exp(-here / growth)


def _largest(structure: Structure, hit: History, columns: Array) -> float:
    """Largest stress over a run from the stress of each coordinate, with that of a prestress."""
    steps = hit.time[:: -(-hit.time.size // MOST_TIMES)]
    times = np.union1d(steps, np.linspace(0.0, hit.time[-1], TIMES))
    static = int(structure.matrices.preload is not None)
    largest = 0.0
    for at_once in np.array_split(times, -(-times.size // AT_ONCE)):
        factors = stress_amplitudes(structure, hit, at_once, PART)
        factors = np.pad(factors, ((0, 0), (0, static)), constant_values=1.0)
        if factors.shape[1] != columns.shape[1]:
            raise InputError("the part stretches in other motions at this speed.")
        largest = max(largest, float(length(factors @ columns.T).max()))
    return largest


def _scaled(worst: Margin, factors: tuple[float, float], zones: Zones, force: float) -> Margin:
    """A margin in which the stresses of the mesh, and the forces, are so many times as large.

    The stress beside a hollow grows with the force: under a smaller contact, which zones would take
    as a column down to the hollow, the load has spread there to that of the larger one.
    """
    factor, of_force = factors
    low, high = worst.others
    return replace(
        worst,
        value=factor * worst.value,
        mesh_error=factor * worst.mesh_error,
        others=(factor * low, factor * high),
        spread=float(zones.spread_error(worst.point[None])[0]),
        edge_stress=zones.edge_stress,
        thin_stress=zones.thin_stress,
        hollow_stress=min(zones.hollow_stress, of_force * worst.hollow_stress),
        force_error=force,
    )


def _root(of_log: Callable[[float], float], start: float) -> float | None:
    """The speed at which a logarithm is 0, from that of a speed; None: too far from it.

    Each step follows the line through the last two values, a little beyond its root, until the sign
    changes; at first stresses are taken to grow like the speed. No step is longer than STEP: a
    larger contact may cover the place, whose stress falls then.
    """
    at = cache(of_log)
    x, growth = start, 1.0
    while abs(x - start) < log(FURTHEST):
        if abs(at(x)) <= CLOSE * SLOWEST:
            return exp(x)
        following = x + min(max(-BEYOND * at(x) / growth, -STEP), STEP)
        if at(x) * at(following) <= 0:
            return exp(float(brentq(at, *sorted((x, following)), xtol=CLOSE)))
        growth = max((at(following) - at(x)) / (following - x), SLOWEST)
        x = following
    return None
