"""The course of a fall: flight, contact, flight, until it rests or is ended."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.contact_scene import AXES, Held
from antiosc.studies.drops.episode import Episode, episode
from antiosc.studies.drops.flight import SIDES, Flight, State
from antiosc.studies.drops.floor import Setting

#: A fall is at rest whose speed would lift it by this share of the height at most, on points that
#: lie within a share of the extent over the floor and around its centre of mass, up to a distance.
REST, CARRIES, AROUND = 1e-3, 0.01, 1e-3
#: Motions that forces at the points move less than this share of others are free of them.
STILL = 1e-6
#: A point may be below the floor by this share of the extent deeper than contacts press in.
SUNK = 2e-3
#: Impacts at which a fall that does not come to rest is ended, and contacts, over the impacts that
#: are asked for or these: on a soft floor without losses, impacts follow each other as one.
MOST_IMPACTS, CONTACTS = 200, 3


def hung(body: FreeBody, setting: Setting, R: Array, spin: Array, velocity: Array) -> State:
    """The state at the start: the lowest point at its height."""
    low = float((body.points @ R[2] - body.balls).min())
    none = np.zeros(body.omega.size)
    ground = setting.floor.ground
    size = 0 if ground is None else ground.modes.omega.size
    centre = np.array([0.0, 0.0, setting.height - low])
    momentum = R @ (body.tensor @ (R.T @ spin))
    return State(0.0, centre, velocity, R, momentum, none, none, np.zeros((2, size)))


def course(
    body: FreeBody, start: State, setting: Setting
) -> tuple[State, list[Episode], list[Flight], list[list[int]], str]:
    """A fall from a state until it rests, or ends.

    The last state, the contacts, the flights, the contacts of each impact, and why it ended.
    """
    episodes: list[Episode] = []
    flights: list[Flight] = []
    groups: list[list[int]] = []
    state, held, status, pressed = start, dict[int, Held](), "", 0.0
    contacts = CONTACTS * max(setting.impacts, MOST_IMPACTS)
    while not status:
        flight = Flight(body, state, setting.gravity, setting.floor.ground)
        left = setting.duration - state.time
        found = 0.0
        if not held:
            most = min(flight.longest(), left)
            met = flight.touch(most)
            found = most if met is None else met
            flights.append(flight)
            if found >= left:
                status = f"the time {setting.duration:g} s is over"
                state = flight.at(left)
                break
        touch = flight.at(found)
        _check_sides(body, touch)
        if episodes:
            _check_depth(body, touch, pressed, setting)
        # one impact: its flights are shorter than the longest period of the modes, or its contact
        soon = bool(groups) and found < max(body.slowest, episodes[groups[-1][0]].duration)
        if not (held or soon):
            if len(groups) >= setting.impacts:
                status = f"{len(groups)} impacts"
                break
            groups.append([])
            pressed = 0.0
        groups[-1].append(len(episodes))
        before = episodes[-1].duration if held else np.inf
        episodes.append(one := episode(body, touch, setting, held, before))
        state, held = one.end, one.held
        pressed = max(pressed, one.pressed)  # dents of one impact stay when a point parts
        _check_depth(body, state, pressed, setting)
        if _rests(body, state, held, setting):
            status = "at rest"
        elif len(episodes) >= contacts:
            status = f"not at rest after {contacts:g} contacts"
    return state, episodes, flights, groups, status


def _check_sides(body: FreeBody, state: State) -> None:
    """InputError where no point that may touch is below the centre of mass, which would sink."""
    low = float((body.points @ state.R[2] - body.balls).min())
    if low > SIDES * body.extent:
        raise InputError(
            f"the part would fall through the floor: {state.time:.4g} s after its start the lowest "
            f"point that may touch is {low:.3g} m above the centre of mass; give the RigidBody "
            f"sites on all sides of its centre, or end the fall before (until=)."
        )


def _check_depth(body: FreeBody, state: State, pressed: float, setting: Setting) -> None:
    """AccuracyError where a point is deeper in the floor than contacts have pressed one [m]."""
    deep = -float(state.heights(body, setting.floor.ground).min())
    if deep > pressed + SUNK * body.extent:
        raise AccuracyError(
            f"the part sank through the floor at {state.time:.4g} s: a point is {deep:.3g} m "
            f"below it, and contacts press it in by {pressed:.3g} m at most; give a smaller "
            f"tol, or end the fall before (until=)."
        )


def _rests(body: FreeBody, state: State, held: dict[int, Held], setting: Setting) -> bool:
    """Whether the body stands on points around its centre of mass that hardly move, nor will."""
    arms = body.points @ state.R.T - body.balls[:, None] * AXES[0]
    low = arms[:, 2]
    if state.centre[2] + low.min() > CARRIES * body.extent:
        return False
    carrying = arms[low < low.min() + CARRIES * body.extent]
    moving = _hindered(body, state, carrying, setting.floor.friction > 0)
    moving += _pushed(body, state, held, setting) + _shaken(body, state, held, setting)
    if moving > REST * body.mass * setting.gravity * setting.height:
        return False
    return _around(carrying[:, :2], AROUND * body.extent)


def _hindered(body: FreeBody, state: State, arms: Array, sticking: bool) -> float:
    """Energy [J] of the rigid motion that forces at arms (n, 3) could take, upward or of any
    direction (`sticking`): not of a ball that rolls, or of a part that slides without friction."""
    W = body.rigid_modes(state.R)[0]
    moved = W[:, None, :3] + np.cross(W[:, None, 3:], arms)
    across, size, _ = np.linalg.svd(moved.reshape(6, -1) if sticking else moved[:, :, 2])
    own = across[:, : size.size][:, size > STILL * size[0]]
    taken = own.T @ W @ np.append(body.mass * state.velocity, state.momentum)
    return float(taken @ taken / 2)


def _pushed(body: FreeBody, state: State, held: dict[int, Held], setting: Setting) -> float:
    """Energy [J] of the contacts beyond what carries the weight.

    Of one contact with the force F and the way d it is (F - m g)^2 d/F: of a linear law twice the
    energy, and no less than it of a force that grows faster than the way.
    """
    if not held:
        return 0.0
    W, points = body.rigid_modes(state.R)[0], list(held)
    arms, ways = state.arms(body, points), np.diag([-h.height / h.force[0] for h in held.values()])
    if setting.floor.ground is not None:
        ways = ways + setting.floor.ground.compliance
    forces = np.array([AXES[: h.force.size].T @ h.force for h in held.values()])
    wrench = np.append(forces.sum(axis=0), np.cross(arms, forces).sum(axis=0))
    wrench[2] -= body.mass * setting.gravity
    up = W[:, 2:3] + W[:, 3:] @ np.cross(arms, AXES[0]).T
    # up ways^-1 up' is the stiffness against rigid motions
    root = np.linalg.cholesky(np.linalg.inv(ways))
    found = np.linalg.lstsq(up @ root, W @ wrench, rcond=STILL)[0]
    return float(found @ found)


def _shaken(body: FreeBody, state: State, held: dict[int, Held], setting: Setting) -> float:
    """Energy [J] of the body at the speed of the floor as it vibrates about its displacement."""
    ground = setting.floor.ground
    if ground is None:
        return 0.0
    speed = ground.speed(state.floor, sum(float(h.force[0]) for h in held.values()))
    return 0.5 * body.mass * speed**2


def _around(points: Array, close: float) -> bool:
    """Whether the hull of points (n, 2) contains the origin, up to a distance."""
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    if np.linalg.norm(points, axis=1).min() <= close:
        return True
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    return bool(gaps.max(initial=2 * np.pi if len(points) < 2 else 0.0) <= np.pi + 1e-9)
