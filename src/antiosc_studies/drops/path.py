"""Runs of a scene of body and floor that account for the rotation of the body.

The first run of the scene is linear about the orientation at the touch. The path of the body in a
run changes the lever arms and the gaps; the next run has these changes as given loads and gaps
(`scene_on_path`), until they no longer change. The result is that of the rotating body, and its
energy is conserved.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from antiosc import SceneHistory
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import AccuracyError, without_warnings
from antiosc.base.texts import COMPLETED, STOPPED
from antiosc.engine.march import TOUCH_RESOLUTION, Run, run as march_once
from antiosc.engine.system import System
from antiosc.impact.assembly import Assembly
from antiosc.impact.scene import check_range, integrate_exact
from antiosc.impact.states import contact_forces, linear_interpolation, steps_at
from antiosc_studies.drops.flight import rotation_matrices
from antiosc_studies.drops.touching import BODY, SITE_AXES, TINY, Touch

# Measured as in `episode`.
#: Number of fixed-point iterations for the orientations on a path: ten change peak forces by 5e-12,
#: two by 3e-4.
ROTATION_ITERATIONS = 5
#: Error of a step of the first run, which only tells how long the contact lasts.
FIRST_STEP_ERROR = 1e-3
#: A later contact belongs to the same episode if the body has turned by less than this [rad].
SAME_EPISODE_ROTATION = 0.01
#: Samples of the rotation in an episode (2e-5).
ROTATION_SAMPLES = 64
#: Samples of a contact's path times sqrt(tol) (1e-5 on concrete, 1.4e-3 on the soft floor).
PATH_SAMPLES = 2.0
#: Most samples of a contact's path.
MOST_PATH_SAMPLES = 4096
#: Runs are repeated until loads and gaps change by less than CONVERGED_CHANGE times tol, or by less
#: than ACCEPTED_CHANGE times tol without further decrease.
CONVERGED_CHANGE, ACCEPTED_CHANGE = 0.03, 0.3
#: Most runs of a scene on its path; it stalls if STALLED_RUNS runs did not halve the change.
MOST_RUNS, STALLED_RUNS = 12, 4
#: Largest number of contacts and of steps of a scene.
RUN_LIMITS = 10_000, 50_000
#: If a run stops before this share of the expected contact time, no contact forces fit at its
#: start.
JAMMED_SHARE = 1e-6


class Path(NamedTuple):
    """Modal states q, v (n, 6 + J) and orientations R (n, 3, 3) of the body at times (n,).

    `rotations` (n, 3): sum of its rotations so far [rad].
    """

    times: Array
    q: Array
    v: Array
    R: Array
    rotations: Array


def path_of(touch: Touch, history: SceneHistory, t: Array) -> Path:
    """The path of the body in a run, at times (n,) [s] from 0."""
    q, v = (motion[:, history.assembly.stacked.spans[BODY]] for motion in history.states(t))
    body, start, W, momentum = touch
    L = v[:, :6] @ momentum[:, 3:]
    frozen = v[:, :6] @ W[:, 3:]
    half = np.diff(t)[:, None] / 2
    linear = np.diff(q[:, :6] @ W[:, 3:], axis=0)

    R = np.broadcast_to(start.R, (len(t), 3, 3))
    for _ in range(ROTATION_ITERATIONS):
        inverse = R @ body.inverse_inertia @ np.swapaxes(R, 1, 2)
        spin_change = np.einsum("nab,nb->na", inverse, L) - frozen
        rotations = linear + half * (spin_change[:-1] + spin_change[1:])
        R = np.concatenate((start.R[None], rotation_matrices(rotations)))
        span = 1
        while span < len(R):  # products of the last 1, 2, 4, ... rotations
            R[span:] = R[span:] @ R[:-span]
            span *= 2

    return Path(t, q, v, R, np.concatenate((np.zeros((1, 3)), np.cumsum(rotations, axis=0))))


def scene_on_path(
    touch: Touch, indices: IntArray, base: Assembly, history: SceneHistory, path: Path
) -> tuple[Assembly, float]:
    """(scene `base` with the lever arms of its points on a path, its relative change).

    The forces of the run at these lever arms become additional given loads; the additional motion
    of the points becomes additional gaps. The change is relative to the scene of `history`: gaps
    over the largest depth, loads over the largest contact loads. indices : of the points.
    """
    body, _, W, _ = touch
    first, previous = base.system, history.assembly.system
    span = base.stacked.spans[BODY]
    beta = first.beta[:, span]
    shapes = body.shapes[indices]
    balls = body.ball_radii[indices, None]
    R = path.R
    displacement = path.q - path.q[0]
    arms = body.points[indices] + np.einsum("kjd,nj->nkd", shapes, path.q[:, 6:])
    arms = arms @ np.swapaxes(R, 1, 2) - balls * SITE_AXES[0]
    point_motion = arms - arms[0] + (displacement[:, :6] @ W[:, :3])[:, None]
    point_motion -= np.cross(path.rotations[:, None], balls * SITE_AXES[0])  # a ball rolls
    row_forces = contact_forces(history.run, *steps_at(history.run, path.times))
    point_forces = np.zeros_like(arms)

    offsets = linear_interpolation(path.times, first.breaks, first.offsets).copy()
    for k, sides in enumerate(first.friction_rows):
        for row, axis in ((k, 2), *zip(range(sides.start, sides.stop), range(2), strict=False)):
            point_forces[:, k, axis] = row_forces[:, row]
            offsets[:, row] += displacement @ beta[row] + point_motion[:, k, axis]

    bending = np.einsum("nkd,kjd->nj", point_forces @ R, shapes)
    total = np.append(point_forces.sum(axis=1), np.cross(arms, point_forces).sum(axis=1), axis=1)
    linear = row_forces @ beta
    loads = linear_interpolation(path.times, first.breaks, first.loads).copy()
    loads[:, span] += linear + np.append(total @ W.T, bending, axis=1)
    depth = history.run.depth[:, : len(indices)]
    change = max(
        _ratio(
            offsets - linear_interpolation(path.times, previous.breaks, previous.offsets), depth
        ),
        _ratio(loads - linear_interpolation(path.times, previous.breaks, previous.loads), linear),
    )
    system = replace(first, breaks=path.times, loads=loads, offsets=offsets)

    return replace(base, system=system), change


def _ratio(change: Array, size: Array) -> float:
    """Largest |change| over the largest |size|."""
    return float(np.abs(change).max()) / max(float(np.abs(size).max()), TINY)


class PathRun(NamedTuple):
    """A run of a scene, and the path of the body in it.

    change : relative change by the last correction; end : time [s] at which the episode ends;
    touching : whether the body still touches then.
    """

    history: SceneHistory
    path: Path
    change: float
    end: float
    touching: bool


def sufficient_duration(
    touch: Touch, base: Assembly, first: float, longest: float, rotation: float
) -> float:
    """A duration [s] in which the contact ends: `first`, doubled until it ends, or `longest`.

    rotation : rotation [rad] at which the episode is cut.
    """
    duration = first
    while duration < longest:
        history = run_once(base, duration, FIRST_STEP_ERROR, {})
        end, touching = _episode_end(touch, history, rotation)
        if not touching or end < history.time[-1] or history.status:
            break
        duration = min(2 * duration, longest)

    return duration


def run_converged(
    touch: Touch, indices: IntArray, base: Assembly, duration: float, rotation: float, tol: float
) -> PathRun:
    """Repeat the scene `base` on the path of the previous run until the paths converge."""
    history: SceneHistory | None = None
    corrected, share = base, 0.0
    changes: list[float] = []
    while True:
        if history is None or history.status or len(changes) == 1:
            history, share = run_scene(corrected, duration, tol)
        else:
            scale = float(history.run.force[:, : len(indices)].max())
            history = run_once(corrected, duration, share, history.error, scale)

        end, touching = _episode_end(touch, history, rotation)
        path = path_of(touch, history, _path_times(base, history, end, tol))
        corrected, change = scene_on_path(touch, indices, base, history, path)
        changes.append(change)
        count = len(changes)
        stalls = count == MOST_RUNS or (count >= STALLED_RUNS and change > changes[-3] / 2)
        if change <= CONVERGED_CHANGE * tol or stalls:
            return PathRun(history, path, change, end, touching)


def _path_times(base: Assembly, history: SceneHistory, end: float, tol: float) -> Array:
    """Times (n,) up to `end` at which the path is evaluated."""
    count = 1 + int(min(np.ceil(PATH_SAMPLES / np.sqrt(tol)), MOST_PATH_SAMPLES))
    spans = [span for c in history.contact_histories for span in c.contacts]
    t = [np.linspace(*span, count) for span in [(0.0, end), *spans]]
    return np.unique(np.clip(np.concatenate([base.system.breaks, *t]), 0.0, end))


def _episode_end(touch: Touch, history: SceneHistory, rotation: float) -> tuple[float, bool]:
    """Time at which the episode ends [s], and whether the body still touches.

    It ends when all contacts are open and the next touch does not follow soon. A longer contact is
    cut when the body has rotated by `rotation` [rad].
    """
    last = float(history.time[-1])
    times = np.linspace(0.0, last, ROTATION_SAMPLES + 1)
    nodes = history.time[::2]
    q = history.states(times)[0][:, history.assembly.stacked.spans[BODY]]
    angle = np.linalg.norm((q - q[0])[:, :6] @ touch.modes[:, 3:], axis=1)
    too_far = nodes[np.searchsorted(nodes, np.append(times[angle > rotation], last)[0])]

    end = 0.0
    for first, parting in sorted(s for c in history.contact_histories for s in c.contacts):
        if first > end > 0 and np.interp(first, times, angle) > SAME_EPISODE_ROTATION:
            break
        end = max(end, parting)

    if end == 0.0:
        return last, False

    continues = end > too_far or end >= last * (1 - 1e-12)

    return float(too_far if continues else end), bool(continues)


def run_scene(assembly: Assembly, duration: float, tol: float) -> tuple[SceneHistory, float]:
    """(converged history of a scene, its error per step relative to the force, for `run_once`).

    AccuracyError if a force leaves the range of its law, or friction jams a contact.
    """
    with without_warnings():
        converged = integrate_exact(assembly, duration, tol, None, *RUN_LIMITS)
    ended = converged.run
    friction, wedge = _worst_wedging(assembly.system)
    at_start = ended.time[-1] <= JAMMED_SHARE * assembly.contact_time_estimate
    presses = (ended.force[-1, : len(assembly.system.friction_rows)] > 0).any()
    if at_start or (ended.answer and presses and friction * wedge > 1):
        raise _jam_error(friction, wedge)

    history = _history(
        assembly, converged.run, {"force": converged.force_error, "peak": converged.peak_error}
    )
    check_range(history)
    return history, converged.step_tol


def run_once(
    assembly: Assembly, duration: float, rtol: float, error: dict[str, float], scale: float = 0.0
) -> SceneHistory:
    """The history of one run.

    rtol : largest error of the forces in a step, relative to `scale` [N] or, if it is 0, to the
    largest force so far; error : estimated errors for the history.
    """
    record = march_once(
        assembly.system,
        duration,
        rtol,
        scale=scale,
        fine=assembly.contact_time_estimate / TOUCH_RESOLUTION,
        max_contacts=RUN_LIMITS[0],
        max_steps=RUN_LIMITS[1],
    )
    return _history(assembly, record, error)


def _history(assembly: Assembly, record: Run, error: dict[str, float]) -> SceneHistory:
    """The history of a recorded run."""
    return SceneHistory(assembly, record, error, STOPPED if record.answer else COMPLETED, "")


def _worst_wedging(system: System) -> tuple[float, float]:
    """(friction coefficient of the contact that is nearest to jamming, its wedging ratio: normal
    displacement due to a unit tangential force over that due to a unit normal force).
    """
    friction, wedge = 0.0, 0.0
    for k, sides in enumerate(system.friction_rows):
        tangential = float(np.linalg.norm(system.R[k, sides]))
        tangential /= max(float(system.R[k, k]), TINY)

        coefficient = float(system.contacts["friction"][k])
        if coefficient * tangential > friction * wedge:
            friction, wedge = coefficient, tangential

    return friction, wedge


def _jam_error(friction: float, wedging: float) -> AccuracyError:
    """The error of a scene that friction jams or, without friction, whose contacts no forces
    satisfy; `wedging` from `_worst_wedging`.
    """
    if friction == 0:
        return AccuracyError(
            "no contact forces fit where a contact goes on; take a smaller tol, or more modes."
        )

    return AccuracyError(
        f"friction of {friction:.3g} jams a point at its contact: sliding presses it in by "
        f"{friction * wedging:.3g} times what its normal force lifts it, by the compliance of the "
        f"modes that are left out, which must stay well below 1; take more modes, or less "
        f"friction."
    )
