"""An episode of contact: the body as a scene with the floor, on the path on which it turns.

The points that may touch are sites with a normal and two tangential directions. The scene begins
linear about the orientation at the touch. It runs again, with the change of the lever arms and of
the gaps on the path of the run before as given loads and gaps, until that no longer matters
(`on_path`): the result is that of the body that turns, and its energy is kept. The modal state of
the flight is that of the scene at its start; its state at the end becomes a flight (`handed_over`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.simulation.assembly import Assembly
from antiosc.simulation.histories import SceneHistory
from antiosc.simulation.histories.energy import impulses
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.contact_scene import (
    BODY,
    Held,
    Path,
    handed_over,
    on_path,
    path_of,
    run,
    scene_of,
)
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Setting

#: Duration of a first run over the expected time of contact, and of the longest over the first.
LONG, LONGEST = 3.0, 32.0
#: A body may turn by this angle [rad] in an episode; if it still touches, another one follows.
TURNS = 0.6
#: A contact belongs to the episode before if the body has not turned by more until it begins [rad].
FOLLOWS = 0.01
#: Points that may touch are first those lower than this many times the way in a time of contact.
REACH = 1.5
#: A point sinks into the floor that is below it by this share of the extent.
SINKS = 1e-4
#: So many points touch in one episode, the lowest, and those that would sink deeper than these.
MOST = 12
#: Looks at the rotation in an episode; at the path in a contact this over sqrt(tol), and the most.
LOOKS, FINE, MOST_LOOKS = 64, 2.0, 4096
#: A scene runs again until its loads and gaps change by less than this times tol, or by less than
#: NEAR times tol and no longer less from run to run. One that stalls before is cut at half the turn
#: and half the time, CUTS times at most; one that goes on after a cut lasts GROWS times as long.
CLOSE, NEAR, CUTS, GROWS = 0.03, 0.3, 3, 1.5
#: Runs from which on a scene stalls if its change is more than half of that two runs before, and
#: most runs.
FEW_RUNS, MOST_RUNS = 4, 12


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of contact.

    Attributes
    ----------
    start, end : states of the body; the scene is linear about that at the start.
    history : of the scene, whose time begins with `start`; it goes on beyond `end`.
    which : (n,) numbers of the points in contact, sites "0" and on of the scene's body.
    held : number of a point -> its contact, of those that go on at the end.
    """

    start: State
    end: State
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

    @property
    def pressed(self) -> float:
        """Largest way [m] that a contact gives, with the patches of the part and of the floor."""
        run, R = self.history.run, self.history.assembly.system.R
        return float((run.depth + run.force @ R.T)[:, : len(self.which)].max())

    @property
    def error(self) -> float:
        """Estimated relative error of the forces; inf of a march that stopped at the end.

        One that stopped in the flight after the end, without an estimate, has none: 0.
        """
        found, last = max(self.history.error.values()), float(self.history.time[-1])
        after = self.duration < last * (1 - 1e-12)
        return 0.0 if found == np.inf and after else found

    def sunk(self) -> Array:
        """Largest indentations (n,) [m] of the laws of the points."""
        run = self.history.run
        return run.depth[run.time <= self.duration * (1 + 1e-12), : len(self.which)].max(axis=0)

    def motion(self, body: FreeBody, t: Array) -> tuple[Array, Array, Array, Array]:
        """Orientations (n, 3, 3), and in the axes of the body spins and torques over the inertia
        (n, 3), at times (n,) since the start; modal accelerations (n, 6 + J)."""
        times = np.union1d(np.linspace(0.0, max(self.duration, t.max(initial=0.0)), LOOKS + 1), t)
        path, at = path_of(body, self.start, self.history, times), np.searchsorted(times, t)
        R, a, momentum = path.R[at], self.history.at(t)[BODY].a, body.rigid_modes(self.start.R)[1]
        spin, turning = (
            np.einsum("na,nab->nb", each[:, :6] @ momentum[:, 3:], R) @ body.inverse
            for each in (path.v[at], a)
        )
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
    body: FreeBody, start: State, setting: Setting, held: dict[int, Held], before: float = np.inf
) -> Episode:
    """The contact that begins at `start`.

    held : number of a point -> its contact, of those that go on from an episode before; `before`:
        how long that lasted [s].
    """
    tol, heights = setting.tol, start.heights(body, setting.floor.ground)
    which = np.array([np.argmin(heights)])
    base = scene_of(body, start, setting, which, held)
    time, turns, cuts = base.lasting, TURNS, 0
    longest = min(LONGEST * LONG * time, GROWS * before)
    duration = min(LONG * time, longest)
    touched = _candidates(body, start, heights, time, [*held])
    while True:
        if not np.array_equal(which, touched):
            which = touched
            base = scene_of(body, start, setting, which, held)
        history = run(base, duration, tol)
        end, touching = _end(body, start, history, turns)
        if touching and end == history.time[-1] < longest and not history.status:
            duration = min(2 * duration, longest)
            continue
        changes: list[float] = []
        while True:
            path = path_of(body, start, history, _times(base, history, end, tol))
            following, change = on_path(body, start, which, base, history, path)
            changes.append(change)
            if change <= CLOSE * tol or _stalls(changes):
                break
            history = run(following, duration, tol)
            end, touching = _end(body, start, history, turns)
        if change > NEAR * tol and cuts < CUTS:
            turns, cuts = turns / 2, cuts + 1
            duration = longest = end / 2
            continue
        missed = _missed(body, heights, path, which)
        if not len(missed):
            break
        touched = np.append(which, missed)
    state, below = handed_over(body, start, history, path, which)
    return Episode(start, state, history, which, below if touching else {})


def _stalls(changes: list[float]) -> bool:
    """Whether runs no longer come closer to each other."""
    count = len(changes)
    return count == MOST_RUNS or (count >= FEW_RUNS and changes[-1] > changes[-3] / 2)


def _times(base: Assembly, history: SceneHistory, end: float, tol: float) -> Array:
    """Times (n,) up to an end at which the path is looked at; it is straight between them."""
    count = 1 + int(min(np.ceil(FINE / np.sqrt(tol)), MOST_LOOKS))
    spans = [span for c in history.contact_histories for span in c.contacts]
    t = [np.linspace(*span, count) for span in [(0.0, end), *spans]]
    return np.unique(np.clip(np.concatenate([base.system.breaks, *t]), 0.0, end))


def _candidates(
    body: FreeBody, start: State, heights: Array, time: float, held: list[int]
) -> IntArray:
    """The points that may touch: low ones, apart from each other, the lowest first.

    time : of the contact, as expected [s].
    """
    arms = start.arms(body)
    speeds = np.linalg.norm(start.velocity + np.cross(start.spin(body), arms), axis=1)
    way, chosen = REACH * float(speeds.max()) * time, [*held]
    taken = body.touching_as(chosen)
    for i in np.argsort(heights, kind="stable").tolist():
        if chosen and (heights[i] > way or len(chosen) >= MOST):
            break
        if not taken[i]:
            chosen.append(i)
            taken |= body.touching_as([i])
    return np.array(chosen)


def _end(body: FreeBody, start: State, history: SceneHistory, turns: float) -> tuple[float, bool]:
    """Time at which the episode ends [s], and whether the body still touches.

    It ends when all has parted, but for contacts that follow soon; one that lasts is cut where the
    body has turned by `turns` [rad].
    """
    last = float(history.time[-1])
    times, nodes = np.linspace(0.0, last, LOOKS + 1), history.time[::2]
    q = history.states(times)[0][:, history.assembly.spans[BODY]]
    angle = np.linalg.norm((q - q[0])[:, :6] @ body.rigid_modes(start.R)[0][:, 3:], axis=1)
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


def _missed(body: FreeBody, heights: Array, path: Path, which: IntArray) -> IntArray:
    """The point that sinks deepest into the floor on a path though it is no contact; or none.

    heights : (V,) of all points at the start [m].
    """
    up = path.R[:, 2]
    found = np.einsum("nd,vjd,nj->nv", up, body.shapes, path.q[:, 6:], optimize=True)
    found += path.q[:, 2:3] / np.sqrt(body.mass) + up @ body.points.T
    lowest = heights + (found - found[0]).min(axis=0)
    # what a contact presses in, points next to it may sink too; and all points between many
    deepest = min(float(lowest[which].min()), 0.0)
    pressed = body.touching_as(which.tolist()) | (len(which) >= MOST)
    lowest = lowest - np.where(pressed, deepest, 0.0)
    lowest[which] = np.inf
    worst = int(np.argmin(lowest))
    return np.array([worst] if lowest[worst] < -SINKS * body.extent else [], dtype=int)
