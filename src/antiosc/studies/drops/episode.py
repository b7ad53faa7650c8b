"""An episode of contact: the body, linear about one orientation, as a scene with the floor.

The points that may touch are sites with a normal and two tangential directions. The scene has the
body as it is expected to be in the middle of the contact, turned and bent by the first point that
touches. Where it turns more than the tolerance permits, the scene runs once more, with the change
of the lever arms and of the spin that the first run shows as given loads and gaps: the error is
then of the second order in the turn (`turning`). The modal state of the flight is that of the scene
at its start; at the end, when all has parted, the scene's state becomes a flight (`hand_over`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import without_warnings
from antiosc.simulation.expected import deepest
from antiosc.simulation.history import SceneHistory
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.contact_scene import BODY, arms_of, integrated, run, scene_of, turning
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor, law_of
from antiosc.studies.drops.hand_over import handed_over
from antiosc.studies.drops.rotation import turned

#: Duration of a first run, over the expected time of contact.
LONG = 3.0
#: A body may turn by this angle [rad] in an episode; if it still touches, another one follows.
TURNS = 0.03
#: Longest run, over the first one.
LONGEST = 32.0
#: Points that may touch are first those lower than this many times the way in a time of contact.
REACH = 1.5
#: Points are one contact that lie closer together than this share of the extent.
APART = 0.04
#: At most so many points touch in one episode: the lowest.
MOST = 12
#: Looks at the rotation in an episode.
LOOKS = 64
#: An episode in which the body turns by more than this times tol [rad] runs twice (`turning`).
FROZEN = 4.0
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
    held : number of a point -> its height [m], of contacts that go on at the end.
    """

    start: State
    end: State
    posed: State
    history: SceneHistory
    which: IntArray
    held: dict[int, float]

    @property
    def duration(self) -> float:
        """Time from the first touch to the end [s]."""
        return self.end.time - self.start.time

    @property
    def stored(self) -> tuple[float, float]:
        """Energy of the contacts at the start and at the end [J]: > 0 of those that go on."""
        contact = self.history.energy.contact
        return float(contact[0]), float(contact[self._node])

    @property
    def _node(self) -> int:
        return int(np.argmin(np.abs(self.history.time - self.duration)))

    def forces(self) -> tuple[Array, Array]:
        """Times (n,) [s] since the start, and normal forces (n, sites) [N], up to the end."""
        run = self.history.run
        keep = run.time <= self.duration * (1 + 1e-12)
        return run.time[keep], np.maximum(run.force[keep, : len(self.which)], 0.0)

    def impulses(self) -> Array:
        """Normal impulses (sites,) [N s]."""
        t, f = self.forces()
        last = 2 * ((t.size - 1) // 2) + 1
        f, h = f[:last], np.diff(t[:last:2])
        return np.asarray((h[:, None] / 6 * (f[:-2:2] + 4 * f[1:-1:2] + f[2::2])).sum(axis=0))


def episode(
    body: FreeBody,
    start: State,
    heights: Array,
    floor: Floor,
    gravity: float,
    tol: float,
    held: dict[int, float] | None = None,
) -> Episode:
    """The contact that begins at `start`.

    Parameters
    ----------
    heights : (V,) of all points over the floor [m].
    held : number of a point -> its height, of contacts that go on from an episode before.
    """
    held = held or {}
    time, posed, bent = _expected(body, start, heights, floor)
    duration = LONG * time
    longest = LONGEST * duration
    extra: list[int] = []
    again = True
    while again:
        which = _candidates(body, start, heights, time, held, extra)
        gaps = np.array([held.get(i, max(float(heights[i]), 0.0)) for i in which.tolist()])
        with without_warnings():
            scene = scene_of(body, posed, bent, which, gaps, floor, gravity)
            history = run(scene, duration, tol)
        looks = np.linspace(0.0, float(history.time[-1]), LOOKS + 1)
        q = history.states(looks)[0][:, history.assembly.spans[BODY]]
        end, touching = _end(body, history, looks, q)
        cut = touching and end == history.time[-1] and not history.status
        if again := cut and duration < longest:
            duration *= 2
            continue
        missed = _missed(body, posed, heights, q[looks <= end], which)
        if again := missed is not None and missed not in extra and len(which) < MOST:
            extra.append(missed)
    if float(_turns(body, q[looks <= end]).max()) > FROZEN * tol:
        with without_warnings():
            turned_by = turning(body, start, posed, which, history, end)
            history = integrated(turned_by, duration, tol)
        looks = np.minimum(looks, history.time[-1])
        end, touching = _end(body, history, looks, history.states(looks)[0])
    state, heights_at_end = handed_over(body, start, posed, history, end, which, floor)
    pairs = zip(which.tolist(), heights_at_end.tolist(), strict=True)
    below = {i: h for i, h in pairs if h < 0} if touching else {}
    return Episode(start, state, posed, history, which, below)


def _turns(body: FreeBody, q: Array) -> Array:
    """Angles (n,) [rad] by which the body has turned at displacements q (n, 6 + J), or more."""
    turn = q[:, 3:6] / np.sqrt(body.principal[0])
    return np.asarray(np.linalg.norm(turn - turn[0], axis=1))


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
    held: dict[int, float],
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


def _end(body: FreeBody, history: SceneHistory, times: Array, q: Array) -> tuple[float, bool]:
    """Time at which the episode ends [s], and whether the body still touches.

    q : (n, 6 + J) modal displacements of the body at times (n,).

    It ends when all has parted for good, or until the body has turned too far: contacts that follow
    within a third of `TURNS` belong to it. A contact that lasts is cut where it has turned by it.
    """
    last = float(history.time[-1])
    spans: list[tuple[float, float]] = []
    for start, end in sorted(
        span for contact in history.contact_histories for span in contact.contacts
    ):
        if spans and start <= spans[-1][1]:
            spans[-1] = spans[-1][0], max(spans[-1][1], end)
        else:
            spans.append((start, end))
    if not spans:
        return last, False
    angle = _turns(body, q)
    nodes = history.time[::2]
    too_far = nodes[np.searchsorted(nodes, np.append(times[angle > TURNS], last)[0])]
    for (_, end), (following, _) in zip(spans, [*spans[1:], (np.inf, 0.0)], strict=True):
        if end > too_far or end >= last * (1 - 1e-12):
            return float(too_far), True
        if following > last or np.interp(following, times, angle) > TURNS / 3:
            return end, False
    return last, True


def _missed(body: FreeBody, posed: State, heights: Array, q: Array, which: IntArray) -> int | None:
    """The point that sinks deepest into the floor during the scene though it is no contact.

    heights : (V,) of all points at the start [m]; q : (n, 6 + J) modal displacements of the body.
    """
    moments, axes = body.principal
    moved = q - q[0]
    arms = arms_of(body, posed, np.arange(len(body.points)))
    turned_by = (moved[:, 3:6] / np.sqrt(moments)) @ (axes @ posed.R.T)
    rises = np.column_stack((moved[:, 2] / np.sqrt(body.mass), turned_by[:, :2], moved[:, 6:]))
    rows = np.column_stack((np.ones(len(arms)), arms[:, 1], -arms[:, 0], body.shapes @ posed.R[2]))
    lowest = (heights + rises @ rows.T).min(axis=0)
    apart = np.linalg.norm(arms[:, None] - arms[which], axis=2).min(axis=1) > APART * body.extent
    lowest[~apart] = np.inf
    deepest = int(np.argmin(lowest))
    return deepest if lowest[deepest] < -1e-4 * body.extent else None
