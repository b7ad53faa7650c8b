"""The trajectory of a fall: flights and contacts in turn, until it rests or is ended."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc_studies.drops.episode import Episode, episode
from antiosc_studies.drops.flight import SIDE_HEIGHT, Flight
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.touching import AXES, TINY, OngoingContact

#: A part is at rest if its speed would lift it by at most REST_ENERGY times the height, …
REST_ENERGY = 1e-3
#: … and points within CARRYING_HEIGHT times the extent over the floor …
CARRYING_HEIGHT = 0.01
#: … surround its centre of mass up to SUPPORT_MARGIN times the extent.
SUPPORT_MARGIN = 1e-3
#: Rigid motions whose singular value is below this share of the largest are free of contact forces.
FREE_MOTION = 1e-6
#: A point may lie deeper below the floor than contacts press in by this share of the extent.
MOST_SUNK = 2e-3
#: Number of impacts after which a fall without rest is ended.
MOST_IMPACTS = 200
#: Largest number of contacts over that of impacts: on a soft floor without losses successive ones
#: merge into one.
CONTACTS_PER_IMPACT = 3


def trajectory(
    body: FreeBody,
    start: State,
    setting: Setting,
    report: Callable[[int, int, float], None] = lambda *_: None,
) -> tuple[State, list[Episode], list[Flight], list[list[int]], str]:
    """Follow a fall to its end.

    report : called with the numbers of the impact and of its contact, from 1, and the time [s].
    Returns the last state, the episodes, the flights, the numbers of the episodes of each impact,
    and why the fall ended.
    """
    episodes: list[Episode] = []
    flights: list[Flight] = []
    groups: list[list[int]] = []
    state = start
    ongoing = dict[int, OngoingContact]()
    reason = ""
    deepest = 0.0

    contacts = CONTACTS_PER_IMPACT * max(setting.impacts, MOST_IMPACTS)
    while not reason:
        flight = Flight(body, state, setting.gravity)
        remaining = setting.duration - state.time
        touch_time = 0.0

        if not ongoing:
            longest_flight = min(flight.longest(), remaining)
            first_touch = flight.touch(longest_flight)
            touch_time = longest_flight if first_touch is None else first_touch
            flights.append(flight)
            if touch_time >= remaining:
                reason = f"the time {setting.duration:g} s is over"
                state = flight.at(remaining)
                break

        touch = flight.at(touch_time)
        _check_sides(body, touch)
        if episodes:
            _check_depth(body, touch, deepest, setting)

        # flights within one impact are shorter than the longest modal period or its first contact
        same_impact = bool(groups) and touch_time < max(
            body.slowest, episodes[groups[-1][0]].duration
        )
        if not (ongoing or same_impact):
            if len(groups) >= setting.impacts:
                reason = f"{len(groups)} impacts"
                break
            groups.append([])
            deepest = 0.0
        groups[-1].append(len(episodes))
        report(len(groups), len(groups[-1]), touch.time)
        last_duration = episodes[-1].duration if ongoing else np.inf
        episodes.append(contact := episode(body, touch, setting, ongoing, last_duration))
        state = contact.end
        ongoing = contact.held
        deepest = max(deepest, contact.pressed)  # dents of one impact stay when a point parts
        _check_depth(body, state, deepest, setting)
        if _rests(body, state, ongoing, setting):
            reason = "at rest"
        elif len(episodes) >= contacts:
            reason = f"not at rest after {contacts:g} contacts"

    return state, episodes, flights, groups, reason


def _check_sides(body: FreeBody, state: State) -> None:
    """Raise InputError if no point that may touch is below the centre of mass."""
    low = float((body.points @ state.R[2] - body.balls).min())
    if low > SIDE_HEIGHT * body.extent:
        raise InputError(
            f"the part would fall through the floor: {state.time:.4g} s after its start the lowest "
            f"point that may touch is {low:.3g} m above the centre of mass; give the RigidBody "
            f"sites on all sides of its centre, or end the fall before (until)."
        )


def _check_depth(body: FreeBody, state: State, pressed: float, setting: Setting) -> None:
    """AccuracyError if a point is deeper below the floor than contacts press in, `pressed` [m]."""
    depth = -float(state.heights(body).min())
    if depth > pressed + MOST_SUNK * body.extent:
        raise AccuracyError(
            f"the part sank through the floor at {state.time:.4g} s: a point is {depth:.3g} m "
            f"below it, and contacts press it in by {pressed:.3g} m at most; give a smaller "
            f"tol, or end the fall before (until)."
        )


def _rests(
    body: FreeBody, state: State, ongoing: dict[int, OngoingContact], setting: Setting
) -> bool:
    """Whether the body rests on points around its centre of mass, with negligible motion."""
    arms = state.arms(body)
    heights = arms[:, 2]
    if state.centre[2] + heights.min() > CARRYING_HEIGHT * body.extent:
        return False

    carrying = arms[heights <= heights.min() + CARRYING_HEIGHT * body.extent]
    W = body.rigid_modes(state.R)[0]
    energy = _stoppable_energy(body, state, W, carrying, setting.floor.friction > 0)
    pressed = {i: contact for i, contact in ongoing.items() if contact.force[0] > 0}
    if pressed:
        weight = body.mass * setting.gravity
        energy += _excess_energy(W, arms[list(pressed)], [*pressed.values()], weight)
    if energy > REST_ENERGY * body.mass * setting.gravity * setting.height:
        return False

    return _contains_origin(carrying[:, :2], SUPPORT_MARGIN * body.extent)


def _stoppable_energy(body: FreeBody, state: State, W: Array, arms: Array, sticking: bool) -> float:
    """Kinetic energy [J] of the rigid motion that forces at points with arms (n, 3) can take.

    The forces act upward, or if `sticking` in any direction: rolling of a ball, and sliding without
    friction, do not count. W : (6, 6) rigid modes.
    """
    velocities = W[:, None, :3] + np.cross(W[:, None, 3:], arms)
    U, singular_values, _ = np.linalg.svd(
        velocities.reshape(6, -1) if sticking else velocities[:, :, 2]
    )
    directions = U[:, : singular_values.size][:, singular_values > FREE_MOTION * singular_values[0]]
    momentum = directions.T @ W @ np.append(body.mass * state.velocity, state.momentum)
    return float(momentum @ momentum / 2)


def _excess_energy(W: Array, arms: Array, pressed: list[OngoingContact], weight: float) -> float:
    """Elastic energy [J] of contacts at arms (n, 3) above that of their static state.

    For one contact with force F and approach d it is (F - m g)^2 d/F: twice the energy for a linear
    law, and no less than the energy for a force that grows faster than the approach. Friction may
    lift a point that sticks: the magnitude of its approach counts. `weight` [N] of the body.
    """
    compliances = np.array([abs(h.height) / h.force[0] for h in pressed])
    compliances = np.maximum(compliances, FREE_MOTION * compliances.max() + TINY)

    forces = np.array([AXES[: h.force.size].T @ h.force for h in pressed])
    wrench = np.append(forces.sum(axis=0), np.cross(arms, forces).sum(axis=0))
    wrench[2] -= weight
    vertical = W[:, 2:3] + W[:, 3:] @ np.cross(arms, AXES[0]).T

    # with up' their product is the stiffness against rigid motions
    up = vertical / np.sqrt(compliances)
    impulses = np.linalg.lstsq(up, W @ wrench, rcond=FREE_MOTION)[0]
    return float(impulses @ impulses)


def _contains_origin(points: Array, close: float) -> bool:
    """Whether the hull of points (n, 2) contains the origin, up to a distance `close`."""
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    if np.linalg.norm(points, axis=1).min() <= close:
        return True
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    return bool(gaps.max(initial=2 * np.pi if len(points) < 2 else 0.0) <= np.pi + 1e-9)
