"""An episode of contact: a scene of the body and the floor, with the points that may touch.

The scene starts with the modal state of the flight and is integrated along the path of the rotating
body (see `path`). The next flight starts from the final state of the episode (`final_state`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc import SceneHistory
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.impact.histories.energy import impulses
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.path import (
    ACCEPTED_CHANGE,
    ROTATION_SAMPLES,
    Path,
    path_of,
    run_converged,
    sufficient_duration,
)
from antiosc_studies.drops.skin import SMOOTH_COSINE
from antiosc_studies.drops.touching import BODY, OngoingContact, Touch, scene_of

# Measured: an aluminium plate of 120 x 60 x 12 mm with 12 modes, dropped from 0.5 m at the default
# tol = 1e-3, on concrete and on soft springs. The effects of factors of 2 are the largest relative
# changes of a peak force.
#: Duration of the first run over the expected contact time, and of the longest (2e-5).
FIRST_SPAN, LONGEST_SPAN = 3.0, 96.0
#: Largest rotation [rad] of the body in an episode; if it still touches, another episode follows.
#: With half of it peaks change by 6e-4 on the soft floor, with twice as much by 3e-5.
LARGEST_ROTATION = 0.6
#: Points may touch if their height is less than this many times the motion during a contact time;
#: points that are missed and sink are added in a second run.
CANDIDATE_REACH = 1.5
#: A point that is below the floor by this share of the body's extent sinks in.
SINKING_SHARE = 1e-4
#: Number of points in one episode: the lowest; points that would sink deeper are added. With six a
#: peak on the soft floor, where more points touch, changes by 11 %; with 24 none does.
MOST_POINTS = 12
#: A scene that stalls earlier is cut to half its rotation and half its time, at most so many times.
MOST_CUTS = 8
#: Points of a solid that are closer together than this share of the extent are one contact.
MERGE_DISTANCE = 0.04
#: Largest duration of an episode after a cut, over that of the previous one.
DURATION_GROWTH = 1.5


def final_state(
    touch: Touch, history: SceneHistory, path: Path, indices: IntArray
) -> tuple[State, dict[int, OngoingContact]]:
    """(state at the end of a path, contacts that continue by index of their point).

    Open contacts with a dent are included, unless all contacts are open. Centre and orientation are
    taken from the path, momentum, angular momentum and modes from the scene, so that the energy is
    that of the path.
    """
    a = history.assembly
    record = history.run
    t = float(path.times[-1])
    body, start, W, momentum = touch
    displacements = (path.q[-1] - path.q[0])[:6] @ W
    P = path.v[-1, :6] @ momentum
    state = State(
        start.time + t,
        start.centre + displacements[:3],
        P[:3] / body.mass,
        path.R[-1],
        P[3:],
        path.q[-1, 6:],
        path.v[-1, 6:],
    )
    node = int(np.argmin(np.abs(record.time - t)))
    force = record.force[node]
    heights = -(record.depth[node] + a.system.R @ force)
    continuing = {}

    contacts = zip(
        indices, record.contact_states(a.system, t), a.laws, a.system.friction_rows, strict=True
    )
    for k, (i, contact, law, sides) in enumerate(contacts):
        if contact is not None and (contact.closed or law.has_memory):
            rows = [k, *range(sides.start, sides.stop)]
            slip = float(a.system.contacts["tangential_stiffness"][k])
            continuing[int(i)] = OngoingContact(
                float(heights[k]), contact.closed * force[rows], slip, contact, law
            )

    if any(ongoing.state.closed for ongoing in continuing.values()):
        return state, continuing

    return state, {}


@dataclass(frozen=True, eq=False)
class Episode:
    """A time of contact with the floor, computed as one scene."""

    touch: Touch  # the body as it touches. The scene is linear about this start.
    end: State  # state of the body
    #: history of the scene; its time counts from the start and continues beyond `end`
    history: SceneHistory
    #: (n,) indices of the body's points that may touch: sites "0", "1", … of the scene
    indices: IntArray
    #: index of a point -> its contact, if that continues after the end
    ongoing: dict[int, OngoingContact]

    @property
    def start(self) -> State:
        """The state of the body as it touches."""
        return self.touch.start

    @property
    def body(self) -> FreeBody:
        """The body as it touches."""
        return self.touch.body

    @property
    def duration(self) -> float:
        """Time from the first touch to the end [s]."""
        return self.end.time - self.start.time

    @property
    def contact_energy(self) -> float:
        """Energy of the contacts at the end [J]; > 0 if some are still closed."""
        node = int(np.argmin(np.abs(self.history.time - self.duration)))
        return float(self.history.energy.contact[node])

    @property
    def largest_approach(self) -> float:
        """Largest approach [m] of a contact, including the compliance of the patches."""
        record = self.history.run
        approaches = record.depth + record.force @ self.history.assembly.system.R.T
        return float(approaches[:, : len(self.indices)].max())

    @property
    def error(self) -> float:
        """Estimated relative error of the forces; inf if the integration stopped before the end.

        A run that stopped in the flight after the end has no estimate; the error is then 0.
        """
        largest = max(self.history.error.values())
        in_flight = self.duration < float(self.history.time[-1]) * (1 - 1e-12)
        return 0.0 if largest == np.inf and in_flight else largest

    def depths(self) -> Array:
        """Largest indentations (n,) [m] by the contact laws, without the patches' compliance."""
        record = self.history.run
        return record.depth[record.time <= self.duration * (1 + 1e-12), : len(self.indices)].max(
            axis=0
        )

    def motion(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """(orientations (n, 3, 3), spins (n, 3), angular accelerations (n, 3) due to torques, modal
        accelerations (n, 6 + J)) at times (n,) since the start; spins and angular accelerations in
        the axes of the body.
        """
        end = max(self.duration, t.max(initial=0.0))
        times = np.union1d(np.linspace(0.0, end, ROTATION_SAMPLES + 1), t)
        body = self.body
        path = path_of(self.touch, self.history, times)
        rows = np.searchsorted(times, t)
        R = path.R[rows]
        a = self.history.at(t)[BODY].a
        momentum = self.touch.momenta
        spin, turning = (
            np.einsum("na,nab->nb", values[:, :6] @ momentum[:, 3:], R) @ body.inverse_inertia
            for values in (path.v[rows], a)
        )

        return R, spin, turning, a

    def forces(self) -> tuple[Array, Array]:
        """(times (n,) [s] since the start, normal forces (n, sites) [N]), up to the end."""
        record = self.history.run
        within = record.time <= self.duration * (1 + 1e-12)
        return record.time[within], np.maximum(record.force[within, : len(self.indices)], 0.0)

    def peak_force(self) -> float:
        """Largest sum of the normal forces [N], by the parabolas through the nodes of the steps."""
        total = self.forces()[1].sum(axis=1)
        first, middle, last = total[:-2:2], total[1:-1:2], total[2::2]
        slope = 4 * middle - 3 * first - last
        curvature = 2 * (first - 2 * middle + last)
        inside = (slope > 0) & (slope < -2 * curvature)
        tops = first[inside] - slope[inside] ** 2 / (4 * curvature[inside])
        return float(max(total.max(initial=0.0), tops.max(initial=0.0)))

    def impulses(self) -> Array:
        """Normal impulses (sites,) [N s]."""
        t, f = self.forces()
        last = 2 * ((t.size - 1) // 2) + 1
        return np.asarray(impulses(t[:last], f[:last]).sum(axis=0))


def run_episode(
    body: FreeBody,
    start: State,
    setting: Setting,
    ongoing: dict[int, OngoingContact],
    previous_duration: float = np.inf,
) -> Episode:
    """The episode that begins at `start`, with the contacts that continue from the previous one.

    ongoing : contacts by index of the point; previous_duration : previous episode's duration [s].
    """
    touch = Touch.of(body, start)
    heights = start.heights(body)
    base = scene_of(touch, setting, np.array([np.argmin(heights)]), ongoing)
    time = base.contact_time_estimate
    longest = min(LONGEST_SPAN * time, DURATION_GROWTH * previous_duration)
    turns = LARGEST_ROTATION
    which = _candidates(touch, heights, time, [*ongoing])

    cuts = 0
    while True:
        base = scene_of(touch, setting, which, ongoing)
        duration = sufficient_duration(touch, base, min(FIRST_SPAN * time, longest), longest, turns)
        found = run_converged(touch, which, base, duration, turns, setting.tol)
        if found.change > ACCEPTED_CHANGE * setting.tol and cuts < MOST_CUTS:
            turns, cuts, longest = turns / 2, cuts + 1, found.end / 2
            continue
        sinking = _sinking_point(touch, heights, found.path, which)
        if not len(sinking):
            state, held = final_state(touch, found.history, found.path, which)
            return Episode(touch, state, found.history, which, held if found.touching else {})
        which = np.append(which, sinking)


def _candidates(touch: Touch, heights: Array, duration: float, ongoing: list[int]) -> IntArray:
    """Indices of points that may touch within a duration [s]: `ongoing`, then the lowest points.

    Points that share a contact with a chosen point are left out.
    """
    body, start, *_ = touch
    arms = start.positions(body)
    speeds = np.linalg.norm(start.velocity + np.cross(start.spin(body), arms), axis=1)
    distance = CANDIDATE_REACH * float(speeds.max()) * duration
    candidates = [*ongoing]

    covered = _sharing_contact(body, candidates)
    for i in np.argsort(heights, kind="stable").tolist():
        if candidates and (heights[i] > distance or len(candidates) >= MOST_POINTS):
            break
        if not covered[i]:
            candidates.append(i)
            covered |= _sharing_contact(body, [i])

    return np.array(candidates)


def _sharing_contact(body: FreeBody, indices: list[int]) -> BoolArray:
    """Mask (V,) of the points that share a contact with a point in `indices`.

    Points of a solid share a contact if they are close together and face the same direction (as on
    a round edge), belong to one ball, or lie on one rounded corner. Two corners of a slender bar
    are two contacts.
    """
    touching = np.zeros(len(body.points), dtype=bool)
    touching[indices] = True

    if body.normals is not None:
        places = body.vertices
        for i in indices:
            apart = body.points - body.points[i], places - places[i]  # one ball, one place
            distance = np.linalg.norm(apart, axis=2).min(axis=0)
            alike = (body.normals @ body.normals[i] >= SMOOTH_COSINE) | (body.ball_radii > 0)
            close = distance <= MERGE_DISTANCE * body.extent
            touching |= close & alike | (distance < body.corner_radius)

    return touching


def _sinking_point(touch: Touch, heights: Array, path: Path, indices: IntArray) -> IntArray:
    """Index (1,) of the point without a contact that is deepest below the floor, or (0,)."""
    body = touch.body
    vertical = path.R[:, 2]
    lifts = np.einsum("nd,vjd,nj->nv", vertical, body.shapes, path.q[:, 6:], optimize=True)
    lifts += path.q[:, 2:3] / np.sqrt(body.mass) + vertical @ body.points.T
    lowest = heights + (lifts - lifts[0]).min(axis=0)

    # what a contact presses in, points next to it may sink too; and all points between many
    deepest = min(float(lowest[indices].min()), 0.0)
    has_contact = _sharing_contact(body, indices.tolist()) | (len(indices) >= MOST_POINTS)
    lowest = lowest - np.where(has_contact, deepest, 0.0)
    lowest[indices] = np.inf
    i = int(np.argmin(lowest))
    return np.array([i] if lowest[i] < -SINKING_SHARE * body.extent else [], dtype=int)
