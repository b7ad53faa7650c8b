"""An episode of contact: a scene of body and floor, corrected for the body's rotation.

The first run of the scene is linear about the orientation at the touch. The path of each run
changes the lever arms and the gaps; the next run has these changes as given loads and gaps
(`on_path`), until they no longer change. The result is that of the rotating body, and conserves its
energy. The scene starts with the modal state of the flight; its final state starts the next flight
(`handed_over`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from antiosc import SceneHistory
from antiosc.base._types import Array, IntArray
from antiosc.extension import impulses
from antiosc.impact.assembly import Assembly
from antiosc.impact.states import forces, interpolated, locate
from antiosc_studies.drops.flight import rotation_matrices
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.touching import (
    AXES,
    BODY,
    TINY,
    OngoingContact,
    Touch,
    run,
    run_once,
    scene_of,
)

# Measured: an aluminium plate of 120 x 60 x 12 mm with 12 modes, dropped from 0.5 m at the default
# tol = 1e-3, on concrete and on soft springs. The effects of factors of 2 are the largest relative
# changes of a peak force.
#: Number of fixed-point iterations for the orientations on a path: ten change peak forces by 5e-12,
#: two by 3e-4.
SWEEPS = 5
#: Duration of the first run over the expected contact time, and of the longest (2e-5).
LONG, LONGEST = 3.0, 96.0
#: Error of a step of the first run, which only tells how long the contact lasts.
ROUGH = 1e-3
#: Largest rotation [rad] of the body in an episode; if it still touches, another episode follows.
#: With half of it peaks change by 6e-4 on the soft floor, with twice as much by 3e-5.
TURNS = 0.6
#: A later contact belongs to the same episode if the body has turned by less than this [rad].
FOLLOWS = 0.01
#: Candidates for contact lie lower than this many times the motion during a contact time; with
#: less, points that sink are added in a second run.
REACH = 1.5
#: A point that is below the floor by this share of the body's extent sinks in.
SINKS = 1e-4
#: Number of points in one episode: the lowest; points that would sink deeper are added. With six a
#: peak on the soft floor, where more points touch, changes by 11 %; with 24 none does.
MOST = 12
#: Samples of the rotation in an episode (2e-5).
SAMPLES = 64
#: Samples of a contact's path times sqrt(tol) (1e-5 on concrete, 1.4e-3 on the soft floor).
FINE = 2.0
#: Most samples of a contact's path.
MOST_LOOKS = 4096
#: A scene is repeated until its loads and gaps change by less than CLOSE times tol, or by less than
#: NEAR times tol without further decrease.
CLOSE, NEAR = 0.03, 0.3
#: Most runs of a scene on its path; it stalls if FEW runs did not halve the change.
MOST_RUNS, FEW = 12, 4
#: A scene that stalls earlier is cut to half its rotation and half its time, at most so many times.
CUTS = 8
#: After a cut the next episode may last so many times as long.
GROWS = 1.5


class Path(NamedTuple):
    """Modal states q, v (n, 6 + J) and orientations R (n, 3, 3) of the body at times (n,).

    `turns` (n, 3): sum of its rotations so far [rad].
    """

    times: Array
    q: Array
    v: Array
    R: Array
    turns: Array


def path_of(touch: Touch, history: SceneHistory, t: Array) -> Path:
    """The path of the body at times (n,) of a run, the first of which is 0."""
    q, v = (motion[:, history.assembly.spans[BODY]] for motion in history.states(t))
    body, start, W, momentum = touch
    L = v[:, :6] @ momentum[:, 3:]
    frozen = v[:, :6] @ W[:, 3:]
    half = np.diff(t)[:, None] / 2
    linear = np.diff(q[:, :6] @ W[:, 3:], axis=0)

    R = np.broadcast_to(start.R, (len(t), 3, 3))
    for _ in range(SWEEPS):
        spin_change = np.einsum("nab,nb->na", R @ body.inverse @ np.swapaxes(R, 1, 2), L) - frozen
        rotations = linear + half * (spin_change[:-1] + spin_change[1:])
        R = np.concatenate((start.R[None], rotation_matrices(rotations)))
        span = 1
        while span < len(R):  # products of the last 1, 2, 4, ... rotations
            R[span:] = R[span:] @ R[:-span]
            span *= 2

    return Path(t, q, v, R, np.concatenate((np.zeros((1, 3)), np.cumsum(rotations, axis=0))))


def on_path(
    touch: Touch, which: IntArray, base: Assembly, history: SceneHistory, path: Path
) -> tuple[Assembly, float]:
    """(scene `base` with the lever arms of its points on a path, relative change of the scene).

    The additional effect of the run's forces on these arms becomes given loads, the additional
    motion of the points becomes part of the gaps. The change is relative to the scene that has run:
    of gaps over the largest depth, of loads over the largest contact loads.
    """
    body, _, W, _ = touch
    first, previous = base.system, history.assembly.system
    span = base.spans[BODY]
    beta = first.beta[:, span]
    shapes = body.shapes[which]
    balls = body.balls[which, None]
    R = path.R
    displacement = path.q - path.q[0]
    arms = body.points[which] + np.einsum("kjd,nj->nkd", shapes, path.q[:, 6:])
    arms = arms @ np.swapaxes(R, 1, 2) - balls * AXES[0]
    point_motion = arms - arms[0] + (displacement[:, :6] @ W[:, :3])[:, None]
    point_motion -= np.cross(path.turns[:, None], balls * AXES[0])  # a ball rolls
    row_forces = forces(history.run, *locate(history.run, path.times))
    point_forces = np.zeros_like(arms)

    offsets = interpolated(path.times, first.breaks, first.offsets).copy()
    for k, sides in enumerate(first.sides):
        for row, axis in ((k, 2), *zip(range(sides.start, sides.stop), range(2), strict=False)):
            point_forces[:, k, axis] = row_forces[:, row]
            offsets[:, row] += displacement @ beta[row] + point_motion[:, k, axis]

    bending = np.einsum("nkd,kjd->nj", point_forces @ R, shapes)
    total = np.append(point_forces.sum(axis=1), np.cross(arms, point_forces).sum(axis=1), axis=1)
    linear = row_forces @ beta
    loads = interpolated(path.times, first.breaks, first.loads).copy()
    loads[:, span] += linear + np.append(total @ W.T, bending, axis=1)
    depth = history.run.depth[:, : len(which)]
    change = max(
        _share(offsets - interpolated(path.times, previous.breaks, previous.offsets), depth),
        _share(loads - interpolated(path.times, previous.breaks, previous.loads), linear),
    )
    system = replace(first, breaks=path.times, loads=loads, offsets=offsets)

    return replace(base, system=system), change


def _share(change: Array, size: Array) -> float:
    """The largest magnitude of a change over that of what changes."""
    return float(np.abs(change).max()) / max(float(np.abs(size).max()), TINY)


def handed_over(
    touch: Touch, history: SceneHistory, path: Path, which: IntArray
) -> tuple[State, dict[int, OngoingContact]]:
    """The state at the end of a path, and the contacts of the points (n,) that continue.

    Contacts that have parted and left a dent are included. Centre and orientation are those of the
    path; momentum, angular momentum and modes are those of the scene, so that the energy is that of
    the path.
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
        which.tolist(), record.contact_states(a.system, t), a.laws, a.system.sides, strict=True
    )
    for k, (i, contact, law, sides) in enumerate(contacts):
        if contact is not None and (contact.closed or law.has_memory):
            rows = [k, *range(sides.start, sides.stop)]
            slip = float(a.system.slip[k, 1])
            continuing[i] = OngoingContact(
                float(heights[k]), contact.closed * force[rows], slip, contact, law
            )

    if any(ongoing.contact.closed for ongoing in continuing.values()):
        return state, continuing

    return state, {}


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of contact."""

    touch: Touch  # the body as it touches. The scene is linear about this start.
    end: State  # state of the body
    #: history of the scene; its time counts from the start and continues beyond `end`
    history: SceneHistory
    #: (n,) numbers of its points in contact, which are sites "0", "1", … of the scene's body
    which: IntArray
    #: number of a point -> its contact, for contacts that continue after the end
    held: dict[int, OngoingContact]

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
    def stored(self) -> float:
        """Energy of the contacts at the end [J]; > 0 if some are still closed."""
        node = int(np.argmin(np.abs(self.history.time - self.duration)))
        return float(self.history.energy.contact[node])

    @property
    def pressed(self) -> float:
        """Largest approach [m] in a contact, including the patches of part and floor."""
        record = self.history.run
        approaches = record.depth + record.force @ self.history.assembly.system.R.T
        return float(approaches[:, : len(self.which)].max())

    @property
    def error(self) -> float:
        """Estimated relative error of the forces; inf if the march stopped at the end.

        A run that stopped in the flight after the end has no estimate: 0.
        """
        largest = max(self.history.error.values())
        in_flight = self.duration < float(self.history.time[-1]) * (1 - 1e-12)
        return 0.0 if largest == np.inf and in_flight else largest

    def sunk(self) -> Array:
        """Largest indentations (n,) [m] in the laws of the points."""
        record = self.history.run
        return record.depth[record.time <= self.duration * (1 + 1e-12), : len(self.which)].max(
            axis=0
        )

    def motion(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Orientations (n, 3, 3), spins (n, 3), angular accelerations (n, 3) by torques, and modal
        accelerations (n, 6 + J) at times (n,) since the start. Spins and angular accelerations are
        in the axes of the body.
        """
        times = np.union1d(np.linspace(0.0, max(self.duration, t.max(initial=0.0)), SAMPLES + 1), t)
        body = self.body
        path = path_of(self.touch, self.history, times)
        rows = np.searchsorted(times, t)
        R = path.R[rows]
        a = self.history.at(t)[BODY].a
        momentum = self.touch.momenta
        spin, turning = (
            np.einsum("na,nab->nb", values[:, :6] @ momentum[:, 3:], R) @ body.inverse
            for values in (path.v[rows], a)
        )

        return R, spin, turning, a

    def forces(self) -> tuple[Array, Array]:
        """Times (n,) [s] since the start, and normal forces (n, sites) [N], up to the end."""
        record = self.history.run
        within = record.time <= self.duration * (1 + 1e-12)
        return record.time[within], np.maximum(record.force[within, : len(self.which)], 0.0)

    def peak_force(self) -> float:
        """Largest sum of the normal forces [N], from the parabola of each step."""
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


def episode(
    body: FreeBody,
    start: State,
    setting: Setting,
    ongoing: dict[int, OngoingContact],
    before: float = np.inf,
) -> Episode:
    """The contact that begins at `start`, with those that go on from the previous episode."""
    touch = Touch.of(body, start)
    heights = start.heights(body)
    base = scene_of(touch, setting, np.array([np.argmin(heights)]), ongoing)
    time = base.contact_time_estimate
    longest = min(LONGEST * time, GROWS * before)
    turns = TURNS
    which = _candidates(touch, heights, time, [*ongoing])

    cuts = 0
    while True:
        base = scene_of(touch, setting, which, ongoing)
        duration = _duration(touch, base, min(LONG * time, longest), longest, turns)
        found = _converged(touch, which, base, duration, turns, setting.tol)
        if found.change > NEAR * setting.tol and cuts < CUTS:
            turns, cuts, longest = turns / 2, cuts + 1, found.end / 2
            continue
        sinking = _sinking(touch, heights, found.path, which)
        if not len(sinking):
            state, held = handed_over(touch, found.history, found.path, which)
            return Episode(touch, state, found.history, which, held if found.touching else {})
        which = np.append(which, sinking)


class Followed(NamedTuple):
    """A run on its own path up to its end, the relative change of the last correction, and whether
    the body still touches.
    """

    history: SceneHistory
    path: Path
    change: float
    end: float
    touching: bool


def _duration(touch: Touch, base: Assembly, first: float, longest: float, turns: float) -> float:
    """A duration [s] in which the contact ends, if it does within the longest."""
    duration = first
    while duration < longest:
        history = run_once(base, duration, ROUGH, {})
        end, touching = _end(touch, history, turns)
        if not touching or end < history.time[-1] or history.status:
            break
        duration = min(2 * duration, longest)

    return duration


def _converged(
    touch: Touch, which: IntArray, base: Assembly, duration: float, turns: float, tol: float
) -> Followed:
    """Repeat the scene `base` on the path of the previous run until the paths no longer change."""
    history, share = run(base, duration, tol)
    changes: list[float] = []
    while True:
        end, touching = _end(touch, history, turns)
        path = path_of(touch, history, _times(base, history, end, tol))
        corrected, change = on_path(touch, which, base, history, path)
        changes.append(change)
        count = len(changes)
        stalls = count == MOST_RUNS or (count >= FEW and change > changes[-3] / 2)
        if change <= CLOSE * tol or stalls:
            return Followed(history, path, change, end, touching)
        if history.status or len(changes) == 1:
            history, share = run(corrected, duration, tol)
        else:
            scale = float(history.run.force[:, : len(which)].max())
            history = run_once(corrected, duration, share, history.error, scale)


def _times(base: Assembly, history: SceneHistory, end: float, tol: float) -> Array:
    """Times (n,) up to `end` at which the path is evaluated."""
    count = 1 + int(min(np.ceil(FINE / np.sqrt(tol)), MOST_LOOKS))
    spans = [span for c in history.contact_histories for span in c.contacts]
    t = [np.linspace(*span, count) for span in [(0.0, end), *spans]]
    return np.unique(np.clip(np.concatenate([base.system.breaks, *t]), 0.0, end))


def _candidates(touch: Touch, heights: Array, time: float, ongoing: list[int]) -> IntArray:
    """The points that may touch in a time [s]: low ones, apart, the lowest first."""
    body, start, *_ = touch
    arms = start.arms(body)
    speeds = np.linalg.norm(start.velocity + np.cross(start.spin(body), arms), axis=1)
    distance = REACH * float(speeds.max()) * time
    candidates = [*ongoing]

    covered = body.touching_as(candidates)
    for i in np.argsort(heights, kind="stable").tolist():
        if candidates and (heights[i] > distance or len(candidates) >= MOST):
            break
        if not covered[i]:
            candidates.append(i)
            covered |= body.touching_as([i])

    return np.array(candidates)


def _end(touch: Touch, history: SceneHistory, turns: float) -> tuple[float, bool]:
    """Time at which the episode ends [s], and whether the body still touches.

    It ends when all contacts have parted, except those that follow soon; a longer contact is cut
    when the body has turned by `turns` [rad].
    """
    last = float(history.time[-1])
    times = np.linspace(0.0, last, SAMPLES + 1)
    nodes = history.time[::2]
    q = history.states(times)[0][:, history.assembly.spans[BODY]]
    angle = np.linalg.norm((q - q[0])[:, :6] @ touch.modes[:, 3:], axis=1)
    too_far = nodes[np.searchsorted(nodes, np.append(times[angle > turns], last)[0])]

    end = 0.0
    for first, parting in sorted(s for c in history.contact_histories for s in c.contacts):
        if first > end > 0 and np.interp(first, times, angle) > FOLLOWS:
            break
        end = max(end, parting)

    if end == 0.0:
        return last, False

    continues = end > too_far or end >= last * (1 - 1e-12)

    return float(too_far if continues else end), bool(continues)


def _sinking(touch: Touch, heights: Array, path: Path, which: IntArray) -> IntArray:
    """The point that sinks deepest without a contact, as an array; empty if there is none."""
    body = touch.body
    vertical = path.R[:, 2]
    lifts = np.einsum("nd,vjd,nj->nv", vertical, body.shapes, path.q[:, 6:], optimize=True)
    lifts += path.q[:, 2:3] / np.sqrt(body.mass) + vertical @ body.points.T
    lowest = heights + (lifts - lifts[0]).min(axis=0)

    # what a contact presses in, points next to it may sink too; and all points between many
    deepest = min(float(lowest[which].min()), 0.0)
    has_contact = body.touching_as(which.tolist()) | (len(which) >= MOST)
    lowest = lowest - np.where(has_contact, deepest, 0.0)
    lowest[which] = np.inf
    i = int(np.argmin(lowest))
    return np.array([i] if lowest[i] < -SINKS * body.extent else [], dtype=int)
