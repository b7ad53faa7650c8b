"""An episode of contact: the body, linear about one orientation, as a scene with the floor.

The points that may touch are sites with a normal and two tangential directions. The scene has the
body as it is expected to be in the middle of the contact, turned and bent by the first point that
touches. It runs again, with the change of the lever arms and of the gaps on the path of the run
before as given loads and gaps, until that no longer matters (`path.bent_back`): the result is that
of the body that turns, and its energy is kept as the tolerance demands. The modal state of the
flight is that of the scene at its start; its state at the end becomes a flight (`handed_over`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.simulation.histories.energy import impulses
from antiosc.simulation.histories.history import SceneHistory
from antiosc.simulation.problem.assembly import Assembly
from antiosc.simulation.problem.scales import deepest
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.contact_scene import BODY, Held, arms_of, run, scene_of
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor, law_of
from antiosc.studies.drops.path import Path, bent_back, handed_over, path_of
from antiosc.studies.drops.rotation import turned

#: Duration of a first run, over the expected time of contact.
LONG = 3.0
#: A body may turn by this angle [rad] in an episode; if it still touches, another one follows.
TURNS = 0.6
#: A contact belongs to the episode before if the body has not turned by more until it begins [rad].
FOLLOWS = 0.01
#: Longest run, over the first one.
LONGEST = 32.0
#: Points that may touch are first those lower than this many times the way in a time of contact.
REACH = 1.5
#: Points are one contact that lie closer together than this share of the extent.
APART = 0.04
#: At most so many points touch in one episode: the lowest.
MOST = 12
#: Looks at the rotation in an episode, and the most at its path in a contact.
LOOKS, MOST_LOOKS = 64, 4096
#: A body that turns by less than this times tol [rad] keeps its lever arms.
FROZEN = 4.0
#: A scene runs again until its loads and gaps change by less than this times tol; after so many
#: runs it is cut at half the turn.
CLOSE, MOST_RUNS = 0.3, 12
#: Relative error of an expected depth.
DEPTH_ERROR = 1e-9


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of contact.

    Attributes
    ----------
    start, end : states of the body; `posed` that which the scene is linear about.
    history : of the scene, whose time begins with `start`; it goes on beyond `end`.
    which : (n,) numbers of the points in contact, sites "0" and on of the scene's body.
    held : number of a point -> its contact, of those that go on at the end.
    """

    start: State
    end: State
    posed: State
    history: SceneHistory
    which: IntArray
    held: dict[int, Held]

    @property
    def duration(self) -> float:
        """Time from the first touch to the end [s]."""
        return self.end.time - self.start.time

    @property
    def stored(self) -> float:
        """Energy of the contacts at the end [J]: > 0 of those that go on."""
        node = int(np.argmin(np.abs(self.history.time - self.duration)))
        return float(self.history.energy.contact[node])

    def motion(self, body: FreeBody, t: Array) -> tuple[Array, Array, Array, Array]:
        """Orientations (n, 3, 3), and in the axes of the body spins and torques over the inertia
        (n, 3), at times (n,) since the start; modal accelerations (n, 6 + J)."""
        times = np.union1d(np.linspace(0.0, max(self.duration, t.max(initial=0.0)), LOOKS + 1), t)
        path = path_of(body, self.start, self.posed, self.history, times)
        at, axes = np.searchsorted(times, t), body.principal[1] @ self.posed.R.T
        R, roots, a = path.R[at], np.sqrt(body.principal[0]), self.history.at(t)[BODY].a
        L, torque = ((m[:, 3:6] * roots) @ axes for m in (path.v[at], a))
        spin, turning = (np.einsum("na,nab->nb", m, R) @ body.inverse for m in (L, torque))
        return R, spin, turning, a

    def forces(self) -> tuple[Array, Array]:
        """Times (n,) [s] since the start, and normal forces (n, sites) [N], up to the end."""
        run = self.history.run
        keep = run.time <= self.duration * (1 + 1e-12)
        return run.time[keep], np.maximum(run.force[keep, : len(self.which)], 0.0)

    def impulses(self) -> Array:
        """Normal impulses (sites,) [N s]."""
        t, f = self.forces()
        last = 2 * ((t.size - 1) // 2) + 1
        return np.asarray(impulses(t[:last], f[:last]).sum(axis=0))


def episode(
    body: FreeBody,
    start: State,
    heights: Array,
    floor: Floor,
    gravity: float,
    tol: float,
    held: dict[int, Held] | None = None,
) -> Episode:
    """The contact that begins at `start`.

    Parameters
    ----------
    heights : (V,) of all points over the floor [m].
    held : number of a point -> its contact, of those that go on from an episode before.
    """
    held = held or {}
    time, posed, bent = _expected(body, start, heights, floor)
    duration, longest = LONG * time, LONGEST * LONG * time
    extra: list[int] = []
    turns = TURNS
    while True:
        which = _candidates(body, start, heights, time, held, extra)
        given = body, start, posed, bent, which, heights, held, floor, gravity
        base = scene_of(*given, duration)
        history = run(base, duration, tol)
        end, touching = _end(body, history, turns)
        if touching and end == history.time[-1] < longest and not history.status:
            duration *= 2
            continue
        for _ in range(MOST_RUNS):
            path = path_of(body, start, posed, history, _times(base, history, end, tol))
            if path.angles.max() <= FROZEN * tol:
                break
            on_arms, change = bent_back(body, posed, which, base, history, path)
            if change <= CLOSE * tol:
                break
            history = run(on_arms, duration, tol)
            end, touching = _end(body, history, turns)
        else:
            if turns > TURNS / 8:
                turns /= 2
                continue
            path = path_of(body, start, posed, history, _times(base, history, end, tol))
        missed = _missed(body, heights, path, which)
        if missed is None or missed in extra or len(which) >= MOST:
            break
        extra.append(missed)
    state, below = handed_over(body, start, posed, history, path, which, floor)
    return Episode(start, state, posed, history, which, below if touching else {})


def _times(base: Assembly, history: SceneHistory, end: float, tol: float) -> Array:
    """Times (n,) up to an end at which the path is looked at; it is straight between them."""
    count = 1 + int(min(np.ceil(1 / np.sqrt(tol)), MOST_LOOKS))
    spans = [span for c in history.contact_histories for span in c.contacts]
    t = [np.linspace(*span, count) for span in [(0.0, end), *spans]]
    return np.unique(np.clip(np.concatenate([base.system.breaks, *t]), 0.0, end))


def _expected(
    body: FreeBody, start: State, heights: Array, floor: Floor
) -> tuple[float, State, Array]:
    """Time [s] of a contact of the lowest point, and the body in its middle.

    That is a state, and modal displacements (J,). The force is taken as half a sine of a rigid,
    elastic impact; turn and bend are means that it weighs.
    """
    i = int(np.argmin(heights))
    law = law_of(floor, tuple(body.radii[i].tolist()), body.materials[i])
    x, y, _ = arms_of(body, start, np.array([i]))[0].tolist()
    spin, lever = start.spin(body), np.array([y, -x, 0.0])  # of a force that points up
    turning = start.R @ (body.inverse @ (start.R.T @ lever))
    mass = 1 / (1 / body.mass + float(turning @ lever))
    falling = -float(start.velocity[2] + spin @ lever)
    speed = abs(falling) + 1e-6
    depth = deepest(law, speed, 0.5 * mass * speed**2, 0.0, body.extent, DEPTH_ERROR)
    time = 3 * depth / speed
    impulse = 2 * mass * max(falling, 0.0)
    angle = spin * time / 2 + turning * impulse * time / 8
    angle *= min(1.0, 0.5 * TURNS / max(float(np.linalg.norm(angle)), 1e-300))
    R = turned(angle) @ start.R
    pushed = body.shapes[i] @ R[2] * (np.pi**2 / 8 * impulse / time)
    return time, replace(start, R=R), pushed / (body.omega**2 + (np.pi / time) ** 2)


def _candidates(
    body: FreeBody,
    start: State,
    heights: Array,
    time: float,
    held: dict[int, Held],
    extra: list[int],
) -> IntArray:
    """The points that may touch: low ones, apart from each other, the lowest first.

    time : of the contact, as expected [s].
    """
    arms = arms_of(body, start, np.arange(len(body.points)))
    speeds = np.linalg.norm(start.velocity + np.cross(start.spin(body), arms), axis=1)
    way = REACH * float(speeds.max(initial=0.0)) * time
    chosen: list[int] = [*held, *extra]
    for i in np.argsort(heights, kind="stable"):
        if heights[i] > way and chosen:
            break
        if len(chosen) >= MOST:
            break
        off = np.linalg.norm(arms[chosen] - arms[i], axis=1) if chosen else np.array([np.inf])
        if off.min() > APART * body.extent:
            chosen.append(int(i))
    return np.array(chosen)


def _end(body: FreeBody, history: SceneHistory, turns: float) -> tuple[float, bool]:
    """Time at which the episode ends [s], and whether the body still touches.

    It ends when all has parted, but for contacts that follow soon; one that lasts is cut where the
    body has turned by `turns` [rad].
    """
    last = float(history.time[-1])
    times, nodes = np.linspace(0.0, last, LOOKS + 1), history.time[::2]
    q = history.states(times)[0][:, history.assembly.spans[BODY]]
    turn = q[:, 3:6] / np.sqrt(body.principal[0])
    angle = np.linalg.norm(turn - turn[0], axis=1)
    too_far = nodes[np.searchsorted(nodes, np.append(times[angle > turns], last)[0])]
    end = 0.0
    for first, parts in sorted(s for c in history.contact_histories for s in c.contacts):
        if first > end > 0 and np.interp(first, times, angle) > FOLLOWS:
            break
        end = max(end, parts)
    if end == 0.0:
        return last, False
    lasts = end > too_far or end >= last * (1 - 1e-12)
    return float(too_far if lasts else end), bool(lasts)


def _missed(body: FreeBody, heights: Array, path: Path, which: IntArray) -> int | None:
    """The point that sinks deepest into the floor on a path though it is no contact.

    heights : (V,) of all points at the start [m].
    """
    up = path.R[:, 2]
    found = np.einsum("nd,vjd,nj->nv", up, body.shapes, path.q[:, 6:], optimize=True)
    found += path.q[:, 2:3] / np.sqrt(body.mass) + up @ body.points.T
    lowest = heights + (found - found[0]).min(axis=0)
    off = np.linalg.norm(body.points[:, None] - body.points[which], axis=2).min(axis=1)
    lowest[off <= APART * body.extent] = np.inf
    deepest = int(np.argmin(lowest))
    return deepest if lowest[deepest] < -1e-4 * body.extent else None
