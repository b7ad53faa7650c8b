"""`drop`: a part falls from a height onto a floor, and what comes after."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from math import hypot, inf, sqrt
from typing import Any

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base.errors import InputError
from antiosc.base.plausible import FASTEST_WAVE
from antiosc.base.threads import one_thread
from antiosc.simulation.batch import check_executor
from antiosc.studies.drops.body import MODES, free_body
from antiosc.studies.drops.course import MOST_IMPACTS, hung
from antiosc.studies.drops.ensemble import Drops, Tilts, tumbles
from antiosc.studies.drops.fall import Fall, fall_of
from antiosc.studies.drops.floor import Floor, Setting, as_floor
from antiosc.studies.drops.orientation import orientation

#: Of the floor [m/s^2].
GRAVITY = 9.81
#: Longest first flight [s], and least height [m]: below it there is no flight.
LONGEST, LEAST_HEIGHT = 1e4, 1e-9


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
    modes: int = MODES,
    corner_radius: float | None = None,
    tol: float = 1e-3,
    ensemble: Tilts | None = None,
    n: int = 100,
    seed: int = 0,
    executor: Executor | None = None,
) -> Fall | Drops:
    """Drop a part from a height: flight, impacts, flight, and so on until it rests.

    Parameters
    ----------
    part : Structure, RigidBody, Sphere or FreeBody
        Free in space, without supports: of a mesh, an assembly, or matrices with coordinates. Of a
        RigidBody the sites are the points that may touch. z of its mesh points up. The `body` of
        another fall has its modes, damping and corner_radius already.
    height : float
        Of the lowest point over the floor [m].
    tilt : (a, b, c)
        Rotations [degree] about the x, then the y, then the z axis before the fall, after what
        face, edge, corner or toward say.
    floor : Floor, optional
        Default: rigid, without friction.
    until : "rest", int or float
        Its rest, a number of impacts, or a time [s]. It rests on points around its centre of mass
        when the energy that the floor could still take of its rigid motion would lift it by 0.1 %
        of the height: a ball that rolls and a part that slides without friction are at rest.
        Also "rest" ends after 200 impacts or 600 contacts.
    face, edge, corner : str, optional
        What is lowest: "-z", "-x-z", "+x-y-z", the extremes of the part in the axes of its mesh,
        its centre of mass above them; a face may also be the name of a group.
    toward : (x, y, z), optional
        Direction in the axes of the mesh that points down.
    spin, velocity : (x, y, z)
        At the start, of the centre, in the axes of the floor [rad/s], [m/s].
    gravity : float
        [m/s^2].
    damping : float, sequence or Damping, optional
        Of the free modes; default: a ratio of 1 %.
    modes : int
        Number of free modes.
    corner_radius : float, optional
        Radius [m] of sharp corners and edges; default 1 mm, at most a quarter of the part's least
        dimension.
    tol : float
        Relative error of the contact forces in an impact.
    ensemble : Tilts, optional
        What varies: n falls are computed, and `Drops` are returned.
    n, seed, executor
        Of the ensemble: number of falls, seed of the draws, and who computes them.

    Returns
    -------
    Fall, or Drops with `ensemble`.

    Raises
    ------
    InputError
        A part that supports hold, one without points or materials, and values out of range.

    Warns
    -----
    AccuracyWarning
        A spin above 2 % of the lowest natural frequency, which stiffens the part; a fall that
        does not come to rest; contact forces that do not reach `tol` in 50 000 steps; a layer that
        is pressed in deeper than its thickness or than 0.3 of the radius of a point; falls of an
        ensemble that failed.
    """
    setting = Setting(
        as_floor(floor),
        checks.positive("gravity", gravity, "m/s^2"),
        checks.positive("height", height, "m"),
        *end_of(until),
        checks.tolerance(tol),
    )
    moving = {
        name: checks.array(name, given, (3,))
        for name, given in (("spin", spin), ("velocity", velocity))
    }
    body = free_body(part, modes, damping, corner_radius)
    whirl = body.extent * float(np.linalg.norm(moving["spin"]))
    _check_flight(setting, float(np.linalg.norm(moving["velocity"])) + whirl)
    arrival = float(np.sqrt(2 * setting.gravity * setting.height))
    plausible.tell([plausible.of_blow(None, (), arrival, moving["velocity"])])
    R = orientation(body, tilt, face, edge, corner, toward)
    start = hung(body, setting, R, **moving)
    if ensemble is None:
        if executor is not None:
            raise InputError("an executor computes an ensemble: give ensemble=Tilts(...).")
        fall = fall_of(body, start, setting)
        fall.warn()
        return fall
    checks.instance("ensemble", ensemble, Tilts, "Tilts(sigma=...)")
    check_executor(executor)
    return tumbles(body, start, setting, ensemble, checks.whole("n", n), seed, executor)


def end_of(until: str | int | float) -> tuple[int, float]:
    """Most impacts and longest time [s] of a fall; InputError for what is neither nor "rest"."""
    if isinstance(until, str):
        if until != "rest":
            raise InputError(f'until is "rest", a number of impacts or a time in s; got {until!r}.')
        return MOST_IMPACTS, inf
    if isinstance(until, int) and not isinstance(until, bool):
        return checks.whole("until", until), inf
    return MOST_IMPACTS, checks.positive("until", until, "s")


def _check_flight(setting: Setting, speed: float) -> None:
    """InputError for a first flight that is too fast or too long to be meant."""
    fast = hypot(speed, sqrt(2 * setting.gravity * setting.height))
    long = sqrt(2 * setting.height / setting.gravity)
    if fast > FASTEST_WAVE:
        raise InputError(
            f"the part would touch at {fast:.3g} m/s, at most {FASTEST_WAVE:g} are meant: height is"
            f" in m (got {setting.height:g}), gravity in m/s^2 ({setting.gravity:g}), spin in"
            f" rad/s."
        )
    if setting.height < LEAST_HEIGHT:
        raise InputError(f"height must be at least {LEAST_HEIGHT:g} m; got {setting.height:g}.")
    if long > LONGEST:
        raise InputError(
            f"the part would fall for {long:.3g} s, at most {LONGEST:g} are meant: height is in m "
            f"(got {setting.height:g}), gravity in m/s^2 ({setting.gravity:g})."
        )
