"""The motion of a fall: flights and contacts in turn, until rest or a limit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc_studies.drops.episode import Episode, run_episode
from antiosc_studies.drops.flight import LOWEST_HEIGHT, Flight
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.touching import SITE_AXES, TINY, OngoingContact

#: A part is at rest if its speed would lift it by at most REST_ENERGY times the height, …
REST_ENERGY = 1e-3
#: … and points within SUPPORT_HEIGHT times the extent over the floor …
SUPPORT_HEIGHT = 0.01
#: … surround its centre of mass up to SUPPORT_MARGIN times the extent.
SUPPORT_MARGIN = 1e-3
#: Contact forces do not act on rigid motions with singular values below this share of the largest.
FREE_SHARE = 1e-6
#: Largest depth of a point below the floor beyond the approach of contacts, over the extent.
LARGEST_SINKING = 2e-3
#: Number of impacts after which a fall ends without rest.
MOST_IMPACTS = 200
#: Largest number of contacts over that of impacts: on a soft floor without losses successive ones
#: merge into one.
EPISODES_PER_IMPACT = 3


def trajectory(
    body: FreeBody,
    start: State,
    setting: Setting,
    report: Callable[[int, int, float], None],
) -> tuple[State, list[Episode], list[Flight], list[list[int]], str]:
    """Follow a fall to its end.

    report : called with the numbers of the impact and of its contact, from 1, and the time [s].
    Returns (last state, episodes, flights, numbers of the episodes of each impact, reason for the
    end).
    """
    episodes: list[Episode] = []
    flights: list[Flight] = []
    groups: list[list[int]] = []
    state = start
    ongoing = dict[int, OngoingContact]()
    reason = ""
    deepest = 0.0

    contacts = EPISODES_PER_IMPACT * max(setting.impacts, MOST_IMPACTS)
    while not reason:
        flight = Flight(body, state, setting.gravity)
        remaining = setting.duration - state.time
        touch_time = 0.0

        if not ongoing:
            longest_flight = min(flight.longest_duration(), remaining)
            first_touch = flight.first_touch(longest_flight)
            touch_time = longest_flight if first_touch is None else first_touch
            flights.append(flight)
            if touch_time >= remaining:
                reason = f"the time {setting.duration:g} s is over"
                state = flight.state_at(remaining)
                break

        touch = flight.state_at(touch_time)
        _check_lowest_point(body, touch)
        if episodes:
            _check_depth(body, touch, deepest)

        # flights within one impact are shorter than the longest modal period or its first contact
        same_impact = bool(groups) and touch_time < max(
            body.longest_period, episodes[groups[-1][0]].duration
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
        episodes.append(contact := run_episode(body, touch, setting, ongoing, last_duration))
        state = contact.end
        ongoing = contact.ongoing
        # dents of one impact stay when a point parts
        deepest = max(deepest, contact.largest_approach)
        _check_depth(body, state, deepest)
        if _is_at_rest(body, state, ongoing, setting):
            reason = "at rest"
        elif len(episodes) >= contacts:
            reason = f"not at rest after {contacts:g} contacts"

    return state, episodes, flights, groups, reason


def _check_lowest_point(body: FreeBody, state: State) -> None:
    """Raise InputError if no point that may touch is below the centre of mass."""
    low = float((body.points @ state.R[2] - body.ball_radii).min())
    if low > LOWEST_HEIGHT * body.extent:
        raise InputError(
            f"the part would fall through the floor: {state.time:.4g} s after its start the lowest "
            f"point that may touch is {low:.3g} m above the centre of mass; give the RigidBody "
            f"sites on all sides of its centre, or end the fall before (until)."
        )


def _check_depth(body: FreeBody, state: State, approach: float) -> None:
    """AccuracyError if a point lies deeper below the floor than the largest approach [m] allows."""
    depth = -float(state.heights(body).min())
    if not depth <= approach + LARGEST_SINKING * body.extent:  # not a number is refused too
        raise AccuracyError(
            f"the part sank through the floor at {state.time:.4g} s: a point is {depth:.3g} m "
            f"below it, and contacts press it in by {approach:.3g} m at most; give a smaller "
            f"tol, or end the fall before (until)."
        )


def _is_at_rest(
    body: FreeBody, state: State, ongoing: dict[int, OngoingContact], setting: Setting
) -> bool:
    """Whether the body rests on points around its centre of mass, with negligible motion."""
    arms = state.positions(body)
    heights = arms[:, 2]
    if state.centre[2] + heights.min() > SUPPORT_HEIGHT * body.extent:
        return False

    carrying = arms[heights <= heights.min() + SUPPORT_HEIGHT * body.extent]
    W = body.rigid_modes(state.R)[0]
    energy = _absorbable_energy(body, state, W, carrying, setting.floor.friction > 0)
    pressed = {i: contact for i, contact in ongoing.items() if contact.force[0] > 0}
    if pressed:
        weight = body.mass * setting.gravity
        energy += _excess_energy(W, arms[list(pressed)], [*pressed.values()], weight)
    if energy > REST_ENERGY * body.mass * setting.gravity * setting.height:
        return False

    return _contains_origin(carrying[:, :2], SUPPORT_MARGIN * body.extent)


def _absorbable_energy(body: FreeBody, state: State, W: Array, r: Array, sticks: bool) -> float:
    """Kinetic energy [J] of the rigid motion that contact forces at points r (n, 3) can absorb.

    The forces are vertical or, if `sticks`, in any direction: a rolling ball, and sliding without
    friction, keep their energy. W : (6, 6) rigid modes; r : from the centre of mass [m].
    """
    velocities = W[:, None, :3] + np.cross(W[:, None, 3:], r)
    U, singular_values, _ = np.linalg.svd(
        velocities.reshape(6, -1) if sticks else velocities[:, :, 2]
    )
    directions = U[:, : singular_values.size][:, singular_values > FREE_SHARE * singular_values[0]]
    momentum = directions.T @ W @ np.append(body.mass * state.velocity, state.angular_momentum)
    return float(momentum @ momentum / 2)


def _excess_energy(W: Array, r: Array, contacts: list[OngoingContact], weight: float) -> float:
    """Elastic energy [J] of contacts at points r (n, 3) above that of their static state.

    For one contact with force F and approach d, (F - m g)^2 d/F is used: twice the energy for a
    linear law, and at least the energy for a force that grows faster than the approach. The
    magnitude of the approach is used, since friction may lift a sticking point. `weight` : weight
    of the body [N].
    """
    compliances = np.array([abs(h.height) / h.force[0] for h in contacts])
    compliances = np.maximum(compliances, FREE_SHARE * compliances.max() + TINY)

    forces = np.array([SITE_AXES[: h.force.size].T @ h.force for h in contacts])
    wrench = np.append(forces.sum(axis=0), np.cross(r, forces).sum(axis=0))
    wrench[2] -= weight
    vertical = W[:, 2:3] + W[:, 3:] @ np.cross(r, SITE_AXES[0]).T

    # with up' their product is the stiffness against rigid motions
    up = vertical / np.sqrt(compliances)
    impulses = np.linalg.lstsq(up, W @ wrench, rcond=FREE_SHARE)[0]
    return float(impulses @ impulses)


def _contains_origin(points: Array, tolerance: float) -> bool:
    """Whether the hull of points (n, 2) contains the origin, or a point is within `tolerance`."""
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    if np.linalg.norm(points, axis=1).min() <= tolerance:
        return True
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    return bool(gaps.max(initial=2 * np.pi if len(points) < 2 else 0.0) <= np.pi + 1e-9)
