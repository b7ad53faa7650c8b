"""`drop`: the fall of a part from a height onto a floor, with all its impacts."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf, isfinite, sqrt
from typing import Any

import numpy as np

from antiosc import Many
from antiosc.base import checks, plausible
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.plausible import FASTEST_WAVE, GRAVITY
from antiosc.base.process import one_thread
from antiosc.base.progress import doing
from antiosc.base.texts import engineering
from antiosc_studies.drops.body import MODE_COUNT, MOST_MODES, free_body
from antiosc_studies.drops.ensemble import Tilts, simulate_falls
from antiosc_studies.drops.fall import Fall, fall_of, initial_state
from antiosc_studies.drops.floor import Floor, Setting, as_floor
from antiosc_studies.drops.free_body import FreeBody
from antiosc_studies.drops.orientation import orientation
from antiosc_studies.drops.trajectory import MOST_IMPACTS

#: Longest first flight [s].
LONGEST_FLIGHT = 1e4
#: Least height [m], below which there is no flight.
LEAST_HEIGHT = 1e-9
#: Number of standard deviations within which an ensemble's falls must be plausible.
PLAUSIBLE_SIGMAS = 3.0


@checks.within_range
@one_thread()
def drop(
    part: Any,
    height: float,
    tilt: Sequence[float] = (0.0, 0.0, 0.0),
    floor: Floor | None = None,
    until: str | int | float = "rest",
    *,
    face: str | None = None,
    edge: str | None = None,
    corner: str | None = None,
    toward: Sequence[float] | None = None,
    spin: Sequence[float] = (0.0, 0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    gravity: float = GRAVITY,
    damping: Any = None,
    modes: int = MODE_COUNT,
    corner_radius: float | None = None,
    tol: float = 1e-3,
    ensemble: Tilts | None = None,
    n: int = 100,
    seed: int = 0,
) -> Fall | Many:
    """Drop a part from a height and follow its flights and impacts until it rests.

    Parameters
    ----------
    part : Structure, RigidBody, Sphere or FreeBody
        The part, without supports; z of its mesh points up. A Structure may have a mesh, be an
        assembly, or have matrices with coordinates; a RigidBody touches with its sites. The `body`
        of another fall is accepted too, with its modes, damping and corner_radius.
    height : float
        Height of the lowest point above the floor [m].
    tilt : (a, b, c)
        Rotations [degree] about the x, then the y, then the z axis before the fall, applied after
        the orientation by face, edge, corner or toward.
    floor : Floor, optional
        Default: rigid, without friction.
    until : "rest", int or float
        End of the fall: at rest, after a number of impacts, or at a time [s]. The part is at rest
        if it touches with points around its centre of mass, and the floor can absorb no more
        energy from its rigid motion than a lift by 0.1 % of the height takes: a rolling ball, and
        a part that slides without friction, are at rest. "rest" also ends after 200 impacts or 600
        contacts.
    face, edge, corner : str, optional
        Lowest face, edge or corner, with the centre of mass above it: "-z", "-x-z", "+x-y-z" name
        extremes of the part in the axes of its mesh; a face may also be the name of a group.
    toward : (x, y, z), optional
        Direction in the axes of the mesh that points down.
    spin, velocity : (x, y, z)
        Initial spin [rad/s] and velocity of the centre [m/s], in the axes of the floor.
    gravity : float
        Acceleration of gravity [m/s^2].
    damping : float, sequence or Damping, optional
        Damping of the free modes; default: a ratio of 1 %.
    modes : int
        Number of free modes.
    corner_radius : float, optional
        Radius [m] of sharp corners and edges; default 1 mm, at most a quarter of the part's least
        dimension.
    tol : float
        Relative error of the contact forces in an impact, for all contacts together.
    ensemble : Tilts, optional
        Random variation: n falls are computed, and `Many` is returned.
    n, seed
        For an ensemble: number of falls, seed of the draws.

    Returns
    -------
    Fall, or Many with `ensemble`.

    Raises
    ------
    InputError
        A part with supports, or without points or materials; values out of range; a soft layer
        under a part with edges.

    Warns
    -----
    AccuracyWarning
        A spin above 2 % of the lowest natural frequency, which would stiffen the part; a fall that
        does not come to rest; contact forces that miss `tol` after 50 000 steps; a layer that is
        indented by more than 0.3 of the radius of a round point; falls of an ensemble that failed,
        or to which one of these applies.
    """
    setting = Setting(
        as_floor(floor),
        checks.positive("gravity", gravity, "m/s^2"),
        checks.positive("height", height, "m"),
        *fall_limits(until),
        checks.tolerance(tol),
    )
    motion = {
        name: checks.floats(name, vector, (3,))
        for name, vector in (("spin", spin), ("velocity", velocity))
    }
    count = checks.whole("modes", modes, most=MOST_MODES)
    body = free_body(part, count, damping, corner_radius)
    if setting.floor.layer is not None and not body.ball_radii.all():
        raise InputError(
            "a soft layer takes parts that are round where they land; this one has edges or "
            "corners: give the floor the law of one point of contact."
        )

    if ensemble is not None:
        checks.instance("ensemble", ensemble, Tilts, "Tilts(sigma=...)")
    _check_flight(body, setting, ensemble, **motion)
    arrival = float(np.sqrt(2 * setting.gravity * setting.height))
    plausible.warn_each(plausible.impact_doubts([None], (), arrival, motion["velocity"]))
    R = orientation(body, tilt, face, edge, corner, toward)
    start = initial_state(body, setting, R, **motion)
    if ensemble is None:
        with doing("the fall") as tell:
            fall = fall_of(body, start, setting, lambda *at: tell(_progress_text(setting, *at)))
        fall.warn()
        return fall

    return simulate_falls(body, start, setting, ensemble, checks.whole("n", n), seed)


def fall_limits(until: str | int | float) -> tuple[int, float]:
    """(largest number of impacts, longest time [s]) of a fall; InputError for invalid `until`."""
    if isinstance(until, str):
        if until != "rest":
            raise InputError(f'until is "rest", a number of impacts or a time in s; got {until!r}.')
        return MOST_IMPACTS, inf
    if isinstance(until, int) and not isinstance(until, bool):
        return checks.whole("until", until), inf
    return MOST_IMPACTS, checks.positive("until", until, "s")


def _check_flight(
    body: FreeBody, setting: Setting, ensemble: Tilts | None, spin: Array, velocity: Array
) -> None:
    """Raise InputError if the first flight is implausibly fast or long."""
    fastest_spin = float(np.linalg.norm(spin))
    height = setting.height
    prefix = ""

    if ensemble is not None:
        fastest_spin += PLAUSIBLE_SIGMAS * ensemble.spin
        height *= 1 + PLAUSIBLE_SIGMAS * ensemble.height
        prefix = f"{PLAUSIBLE_SIGMAS:g} standard deviations of the ensemble off, "

    speed = float(np.linalg.norm(velocity)) + body.extent * fastest_spin
    touch_speed = hypot(speed, sqrt(2 * setting.gravity * height))
    flight_time = sqrt(2 * height / setting.gravity)

    if touch_speed > FASTEST_WAVE:
        raise InputError(
            f"{prefix}the part would touch at {touch_speed:.3g} m/s, at most {FASTEST_WAVE:g} "
            "are meant: "
            f"height is in m ({height:g}), gravity in m/s^2 ({setting.gravity:g}), spin in rad/s "
            f"({fastest_spin:g})."
        )

    if setting.height < LEAST_HEIGHT:
        raise InputError(f"height must be at least {LEAST_HEIGHT:g} m; got {setting.height:g}.")
    if flight_time > LONGEST_FLIGHT:
        raise InputError(
            f"{prefix}the part would fall for {flight_time:.3g} s, at most {LONGEST_FLIGHT:g} are "
            "meant: height is "
            f"in m ({height:g}), gravity in m/s^2 ({setting.gravity:g})."
        )


def _progress_text(setting: Setting, impact: int, contact: int, time: float) -> str:
    """Text: the progress of a fall, in this contact of this impact (from 1) at this time [s]."""
    place = f"contact {contact} of impact {impact}"
    if isfinite(setting.duration):
        return f"{1e3 * time:.0f} of {1e3 * setting.duration:.0f} ms, {place}"
    if setting.impacts == MOST_IMPACTS:
        return f"{place}, at {engineering(time, 's')}"
    return f"{place}; impacts done {impact - 1} of {setting.impacts:.0f}"
