"""An episode of contact: the body and the floor as a scene, corrected for the body's rotation.

The points that may touch are sites with a normal and two tangential directions. The first run of
the scene is linear about the orientation at the touch. The path of each run changes the lever arms
and the gaps; the next run has these changes as given loads and gaps (`on_path`), until they no
longer change. The result is that of the rotating body, and conserves its energy. The scene starts
with the modal state of the flight; its final state starts the next flight (`handed_over`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import trapezoid
from scipy.linalg import block_diag
from scipy.spatial import cKDTree

from antiosc import Contact, Inertia, ModalState, Obstacle, Scene, SceneHistory, SiteModes
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AccuracyError, without_warnings
from antiosc.base.texts import COMPLETED, STOPPED
from antiosc.engine.march import FINE as FINEST, Run, run as march_once
from antiosc.engine.system import ContactState, System
from antiosc.extension import check_range, impulses, integrate_exact, set_initial_forces as begin
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.states import forces, integrated_states, interpolated, locate
from antiosc_studies.drops.blunt import flatten
from antiosc_studies.drops.flight import rotation_matrices
from antiosc_studies.drops.floor import Setting, law_at
from antiosc_studies.drops.free_body import Blunt, FreeBody, State
from antiosc_studies.drops.layer import layer_energy, with_layer_laws
from antiosc_studies.drops.lines import STATIONS, landing

BODY = "part"
FLOOR = "floor"
#: Directions of the columns of a site: normal to the floor, and along it.
AXES = np.eye(3)[[2, 0, 1]]
#: Largest number of contacts and of steps of a scene.
LIMITS = 10_000, 50_000
#: Duration over which friction springs of an ongoing contact are extended, over the contact time.
DRAWN = 1e-5
#: Number of fixed-point iterations for the orientations on a path: ten change peak forces by 5e-12,
#: two by 3e-4 (falls as below).
SWEEPS = 5
#: If a run stops before this share of the expected contact time, no contact forces fit at its
#: start.
JAMMED = 1e-6
#: Error tolerance of the coarser over that of the finer run, whose difference is an error estimate.
COARSER = 4.0
#: Error of the finer run over this difference: 1/(COARSER - 1) where errors are proportional to
#: tolerances, and a factor of 2.
LEFT = 2 / 3
#: Least length over the width of what a contact along a line presses into the floor.
SLENDER = 2.0
#: Replaces 0 in denominators.
TINY = float(np.finfo(float).tiny)


class Touch(NamedTuple):
    """The body at the start of an episode, with its rigid modes in that state and their momenta."""

    body: FreeBody
    start: State
    modes: Array
    momenta: Array
    works: Mapping[int, float]

    @classmethod
    def of(cls, body: FreeBody, start: State, works: Mapping[int, float]) -> Touch:
        """The body in a state; `works`: number of a point -> its work [J] in a run before."""
        return cls(body, start, *body.rigid_modes(start.R), works)


class OngoingContact(NamedTuple):
    """A contact that continues from the previous episode.

    Its height [m] at zero force, the forces of its rows (normal, friction) [N], its tangential
    stiffness [N/m], its state, and the ball as which a sharp vertex touches.
    """

    height: float
    force: Array
    stiffness: float
    contact: ContactState
    blunt: Blunt | None = None


class RoughLine(NamedTuple):
    """A line without a law that is pressed into the floor: length, radius [m] and a point on it."""

    length: float
    radius: float
    point: int


class Path(NamedTuple):
    """Modal states q, v (n, 6 + J) and orientations R (n, 3, 3) of the body at times (n,).

    `turns` (n, 3): sum of its rotations so far [rad]; `whole` (n, I): displacements of all modes of
    the scene.
    """

    times: Array
    whole: Array
    q: Array
    v: Array
    R: Array
    turns: Array


def scene_of(
    touch: Touch,
    setting: Setting,
    which: IntArray,
    held: dict[int, OngoingContact],
) -> Assembly:
    """The scene of body and floor from a state, ready to run.

    `which`: numbers of the points that may touch; `held`: the ongoing contacts by point.
    """
    body = touch.body
    start = touch.start
    floor = setting.floor
    body.blunt.update({i: one.blunt for i, one in held.items() if one.blunt is not None})
    body.cut.update(body.blunt)
    flatten(body, start, floor, which, touch.works)
    time_scale = float(np.sqrt(body.extent / setting.gravity))
    bodies: dict[str, Any] = {BODY: _body_in_scene(touch, which), FLOOR: Obstacle()}
    rigid = touch.modes @ np.append(body.mass * start.velocity, start.momentum)
    motion = {BODY: ModalState(np.append(np.zeros(6), start.q), np.append(rigid, start.p))}
    if floor.ground is not None:
        bodies[FLOOR] = floor.ground.body
        motion[FLOOR] = floor.ground.start(start.floor)
    ongoing = [held.get(int(i)) for i in which]
    contacts = [
        Contact(
            f"{BODY}:{k}",
            FLOOR,
            law_at(body, floor, i),
            gap=0.0,
            friction=floor.friction,
            tangential_stiffness=contact.stiffness
            if contact is not None and floor.friction
            else None,
        )
        for k, (i, contact) in enumerate(zip(which.tolist(), ongoing, strict=True))
    ]
    gravity = (0.0, 0.0, -setting.gravity)
    assembly = assemble_scene(Scene(bodies, contacts, gravity=gravity, motion=motion), time_scale)
    system = assembly.system
    p = len(which)
    heights = start.heights(body, floor.ground, which)
    gaps = [
        max(h, 0.0)
        if contact is None
        else h
        if body.layer_contact and i in body.laws
        else contact.height
        for h, i, contact in zip(heights, which.tolist(), ongoing, strict=True)
    ]
    system.offsets[:, :p] = system.beta[:p] @ system.q + gaps
    force, extension = np.zeros((2, len(system.beta)))
    for k, (contact, sides) in enumerate(zip(ongoing, system.sides, strict=True)):
        if contact is not None:
            force[k] = contact.force[0]
            force[sides] = contact.force[1:]
            extension[sides] = contact.force[1:] / contact.stiffness
    # friction springs start unstrained: the displacement by their forces is added to the offsets
    extension += system.R @ force - system.R[:, :p] @ force[:p]
    extension[p:] += system.R[p:, :p] @ force[:p]
    system.offsets[:, :p] += extension[:p]
    states = [None if continued is None else continued.contact for continued in ongoing]
    if body.layer_contact is not None:
        # the damping of a layer follows from its first touch, not from the touch of each piece
        closed = [contact is not None and contact.closed for contact in states]
        speeds = (contact.speed for contact in states if contact is not None and contact.closed)
        system.least_speed = v = max([body.layer_contact.speed, *speeds])
        states = [
            ContactState(True, v, law.touch(v)) if pressing else None
            for law, pressing in zip(system.laws, closed, strict=True)
        ]
    begin(assembly, (states, force[:p]) if held else None)
    if extension.any():
        offsets = system.offsets[:1] - [np.zeros(len(extension)), extension]
        breaks = np.array([0.0, DRAWN * assembly.contact_time_estimate])
        loads = np.repeat(system.loads[:1], 2, axis=0)
        system = replace(system, breaks=breaks, loads=loads, offsets=offsets)
    return replace(assembly, system=system)


def _body_in_scene(touch: Touch, which: IntArray) -> SiteModes:
    """The body in the floor's axes at the start of the episode."""
    body, start, W, momentum, _ = touch
    phi, r = body.sites(which)
    rotation = AXES @ start.R
    size = body.omega.size
    rigid = (W[:, None, :3] + np.cross(W[:, None, 3:], start.arms(body, which))) @ AXES.T
    B = np.concatenate((rigid, np.einsum("ab,njb->jna", rotation, phi)))
    residual = rotation @ r @ rotation.T
    elastic: Any = {}
    if body.basis is not None:
        elastic = {"basis": (body.basis,), "shape": np.eye(6 + size)[6:]}
    S = momentum.T @ momentum
    return SiteModes(
        np.append(np.zeros(6), body.omega),
        B.reshape(6 + size, -1),
        {f"{k}": (3 * k, 3 * k + 1, 3 * k + 2) for k in range(len(which))},
        r=block_diag(*(residual + residual.transpose(0, 2, 1)) / 2),
        directions=np.tile(AXES, (len(which), 1)),
        decay=np.append(np.zeros(6), body.decay),
        inertia=Inertia(np.zeros(3), S, np.concatenate((momentum, np.zeros((size, 6))))),
        **elastic,
    )


def run(assembly: Assembly, duration: float, tol: float) -> tuple[SceneHistory, float]:
    """The converged history of a scene, and the error tolerance of its steps.

    Its status is 2 if it stopped before its end. AccuracyError if a force leaves the range of its
    law, or friction jams.
    """
    with without_warnings():
        converged, _ = integrate_exact(assembly, duration, tol, None, *LIMITS)
    if converged.run.time[-1] <= JAMMED * assembly.contact_time_estimate:
        raise _jam(assembly.system)
    history = _history(assembly, converged.run, {"force": converged.force, "peak": converged.peak})
    check_range(history)
    if tol < converged.worst < np.inf:
        history = replace(history, error=_together(assembly, duration, history, converged.share))
    return history, converged.share


def _together(
    assembly: Assembly, duration: float, fine: SceneHistory, share: float
) -> dict[str, float]:
    """Relative errors of the sum of all contact forces, from a run with a coarser tolerance.

    The march refines until each contact reaches the tolerance; on a layer each piece is a contact.
    """
    coarse = run_once(assembly, duration, COARSER * share, {})
    if coarse.status:
        return fine.error
    t = np.union1d(fine.time, coarse.time)
    count = len(assembly.laws)
    coarse_forces, fine_forces = (
        forces(history.run, *locate(history.run, t)) for history in (coarse, fine)
    )
    difference, size = (
        trapezoid((F**2).sum(axis=1), t) for F in (coarse_forces - fine_forces, fine_forces)
    )
    low, high = (F[:, :count].sum(axis=1).max() for F in (coarse_forces, fine_forces))
    errors = {"force": np.sqrt(difference / size), "peak": abs(low / high - 1)}
    return {name: max(LEFT * float(e), COARSER * share) for name, e in errors.items()}


def run_once(
    assembly: Assembly, duration: float, share: float, error: dict[str, float], scale: float = 0.0
) -> SceneHistory:
    """The history of one run with step error `share`; `scale` [N] of its forces if known.

    `error`: the errors of an almost equal run with this share, which the history takes over.
    """
    record = march_once(
        assembly.system,
        duration,
        share,
        scale=scale,
        fine=assembly.contact_time_estimate / FINEST,
        max_contacts=LIMITS[0],
        max_steps=LIMITS[1],
    )
    return _history(assembly, record, error)


def _history(assembly: Assembly, record: Run, error: dict[str, float]) -> SceneHistory:
    """The history of a recorded run."""
    return SceneHistory(assembly, record, error, STOPPED if record.answer else COMPLETED, "")


def _jam(system: System) -> AccuracyError:
    """The error of a scene that stopped at its start, as friction jams or no forces fit."""
    friction = 0.0
    wedge = 0.0
    for k, sides in enumerate(system.sides):
        tangential = float(np.linalg.norm(system.R[k, sides]))
        tangential /= max(float(system.R[k, k]), TINY)
        if system.slip[k, 0] * tangential > friction * wedge:
            friction = float(system.slip[k, 0])
            wedge = tangential
    if friction == 0:
        return AccuracyError(
            "no contact forces fit where a contact goes on; take a smaller tol, or more modes."
        )
    return AccuracyError(
        f"friction of {friction:.3g} jams a point at its contact: sliding presses it in by "
        f"{friction * wedge:.3g} times what its normal force lifts it, by the compliance of the "
        f"modes that are left out, which must stay well below 1; take more modes, or less "
        f"friction."
    )


def path_of(touch: Touch, history: SceneHistory, t: Array) -> Path:
    """The path of the body at times (n,) of a run, the first of which is 0.

    The spin is linear in time between them.
    """
    displacements, speeds = history.states(t)
    q, v = (motion[:, history.assembly.spans[BODY]] for motion in (displacements, speeds))
    body, start, W, momentum, _ = touch
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
    return Path(
        t, displacements, q, v, R, np.concatenate((np.zeros((1, 3)), np.cumsum(rotations, axis=0)))
    )


def on_path(
    touch: Touch, which: IntArray, base: Assembly, history: SceneHistory, path: Path
) -> tuple[Assembly, float]:
    """(scene `base` with the lever arms of its points on a path, relative change of the scene).

    The additional effect of the run's forces on these arms becomes given loads, the additional
    motion of the points becomes part of the gaps. The change is relative to the scene that has run:
    of gaps over the largest depth, of loads over the largest contact loads.
    """
    body = touch.body
    start_system = base.system
    previous = history.assembly.system
    span = base.spans[BODY]
    R = path.R
    displacement = path.q - path.q[0]
    beta = start_system.beta[:, span]
    W = touch.modes
    shapes = body.shapes[which]
    balls = body.balls[which, None]
    arms = body.points[which] + np.einsum("kjd,nj->nkd", shapes, path.q[:, 6:])
    arms = arms @ np.swapaxes(R, 1, 2) - balls * AXES[0]
    point_motion = arms - arms[0] + (displacement[:, :6] @ W[:, :3])[:, None]
    point_motion -= np.cross(path.turns[:, None], balls * AXES[0])  # a ball rolls
    row_forces = forces(history.run, *locate(history.run, path.times))
    point_forces = np.zeros_like(arms)
    linear = row_forces @ beta
    offsets = interpolated(path.times, start_system.breaks, start_system.offsets).copy()
    for k, sides in enumerate(start_system.sides):
        for row, axis in ((k, 2), *zip(range(sides.start, sides.stop), range(2), strict=False)):
            point_forces[:, k, axis] = row_forces[:, row]
            offsets[:, row] += displacement @ beta[row] + point_motion[:, k, axis]
    bending = np.einsum("nkd,kjd->nj", point_forces @ R, shapes)
    gap_change = offsets - (last := interpolated(path.times, previous.breaks, previous.offsets))
    if body.layer_contact is not None:
        z = _heights(touch, path)
        surface = body.layer_contact
        # the depth is free - gap; the part that is not the body's motion is the floor's
        free = path.whole @ start_system.beta.T - row_forces @ start_system.R.T
        ground = (path.whole - path.whole[0]) @ start_system.beta[
            0
        ] - displacement @ start_system.beta[0, span]
        floor_motion = ground - row_forces @ start_system.R[0]
        on_layer = np.flatnonzero(which >= surface.first)
        pieces = which[on_layer] - surface.first
        volume, low, place = surface.pressed(pieces, R[:, 2], path.q[:, 6:], z - floor_motion)
        offsets[:, on_layer] = free[:, on_layer] - surface.depth(pieces, volume, low)
        place_shapes = place[..., 3:].reshape(len(R), len(on_layer), *shapes.shape[1:])
        displaced = place[..., :3] + np.einsum("nj,nkjd->nkd", path.q[:, 6:], place_shapes)
        arms[:, on_layer] = displaced @ np.swapaxes(R, 1, 2)
        bending += np.einsum(
            "nkd,nkjd->nj", point_forces[:, on_layer] @ R, place_shapes - shapes[on_layer]
        )
        sliding = (
            _displaced(R, path.q[:, 6:], displaced, place_shapes)
            + (displacement[:, :6] @ W[:, :3])[:, None]
        )
        for k, piece in enumerate(on_layer.tolist()):
            sides = start_system.sides[piece]
            correction = (sliding[:, k] - point_motion[:, piece])[:, : sides.stop - sides.start]
            offsets[:, sides] += correction
            gap_change[:, sides] += correction
        # for pieces the change is that of the force, over the force of all pieces
        largest = float(np.abs(history.run.depth[:, : len(which)]).max())
        gap_change[:, on_layer] = (
            surface.volume(pieces, free[:, on_layer] - last[:, on_layer]) - volume
        )
        gap_change[:, on_layer] *= largest / max(float(volume.sum(axis=1).max()), TINY)
    total = np.append(point_forces.sum(axis=1), np.cross(arms, point_forces).sum(axis=1), axis=1)
    loads = interpolated(path.times, start_system.breaks, start_system.loads).copy()
    loads[:, span] += linear + np.append(total @ W.T, bending, axis=1)
    change = 0.0
    for changed, size in (
        (gap_change, history.run.depth[:, : len(which)]),
        (loads - interpolated(path.times, previous.breaks, previous.loads), linear),
    ):
        change = max(change, float(np.abs(changed).max()) / max(float(np.abs(size).max()), TINY))
    return replace(
        base, system=replace(start_system, breaks=path.times, loads=loads, offsets=offsets)
    ), change


def _displaced(R: Array, q: Array, places: Array, shapes: Array) -> Array:
    """Displacements (n, k, 3) [m] of the material at places (n, k, 3) that move through a body.

    They are the integral of the velocity of the material that is at the place at each time.
    Friction acts on them: the motion of the place itself through the body does no work. R : (n, 3,
    3) orientations; q : (n, J) modal displacements; shapes : (n, k, J, 3) mode shapes at the
    places.
    """
    place = (places[1:] + places[:-1]) / 2
    shape = (shapes[1:] + shapes[:-1]) / 2
    steps = np.einsum("nab,nkb->nka", np.diff(R, axis=0), place)
    steps += np.einsum("nab,nkjb,nj->nka", (R[1:] + R[:-1]) / 2, shape, np.diff(q, axis=0))
    return np.concatenate((np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)))


def _heights(touch: Touch, path: Path) -> Array:
    """Heights (n,) [m] of the centre of mass on a path, over the floor's initial position."""
    assert touch.body.layer_contact is not None
    displacements = (path.q - path.q[0])[:, :6] @ touch.modes[:, 2]
    return np.asarray(touch.body.layer_contact.height + displacements)


def handed_over(
    touch: Touch, history: SceneHistory, path: Path, which: IntArray
) -> tuple[State, dict[int, OngoingContact]]:
    """The state at the end of a path, and the contacts of the points (n,) that continue.

    Contacts that have parted and left a dent are included. Centre and orientation are those of the
    path; momentum, angular momentum and modes are those of the scene, so that the energy is that of
    the path.
    """
    a = history.assembly
    run = history.run
    t = float(path.times[-1])
    body, start, W, momentum, _ = touch
    displacements = (path.q[-1] - path.q[0])[:6] @ W
    P = path.v[-1, :6] @ momentum
    all_modes = np.array(integrated_states(run, a.system, *locate(run, path.times[-1:])))[:, 0]
    state = State(
        start.time + t,
        start.centre + displacements[:3],
        P[:3] / body.mass,
        path.R[-1],
        P[3:],
        path.q[-1, 6:],
        path.v[-1, 6:],
        all_modes[:, a.spans[BODY].stop :],
    )
    node = int(np.argmin(np.abs(run.time - t)))
    force = run.force[node]
    contacts = run.contact_states(a.system, t)
    heights = -(run.depth[node] + a.system.R @ force)
    continuing = {}
    contacts_data = zip(which.tolist(), contacts, a.laws, a.system.sides, strict=True)
    for k, (i, contact, law, sides) in enumerate(contacts_data):
        if contact is not None and (contact.closed or law.has_memory):
            rows = [k, *range(sides.start, sides.stop)]
            slip = float(a.system.slip[k, 1])
            forces = contact.closed * force[rows]
            continuing[i] = OngoingContact(
                float(heights[k]), forces, slip, contact, body.blunt.get(i)
            )
    if any(ongoing.contact.closed for ongoing in continuing.values()):
        return state, continuing
    return state, {}


# Measured: an aluminium plate of 120 x 60 x 12 mm with 12 modes, dropped from 0.5 m at the default
# tol = 1e-3: on concrete (nine impacts of three falls, with and without friction and spin) and on
# soft springs (four impacts, contacts of some 10 ms). The effects of factors of 2 are the largest
# relative changes of a peak force; later impacts magnify those of earlier ones. Constants without a
# figure changed nothing there.
#: Duration of the first run over the expected contact time (2e-5 with half or twice as much).
LONG = 3.0
#: Duration of the longest run over that of the first.
LONGEST = 32.0
#: Most runs of an episode until the balls of its sharp vertices stand for their work.
BALLS = 3
#: Largest rotation [rad] of the body in an episode; if it still touches, another episode follows.
#: With half of it peaks change by 6e-4 on the soft floor, and the fall takes 1.4 times as long;
#: with twice as much they change by 3e-5.
TURNS = 0.6
#: A later contact belongs to the same episode if the body has turned by less than this [rad].
FOLLOWS = 0.01
#: Candidates for contact lie lower than this many times the motion during a contact time. Twice as
#: much takes 1.4 times as long; with less, points that sink are added in a second run.
REACH = 1.5
#: A point that is below the floor by this share of the body's extent sinks in.
SINKS = 1e-4
#: Number of points in one episode: the lowest; points that would sink deeper are added. With six a
#: peak on the soft floor, where more points touch, changes by 11 %; with 24 none does.
MOST = 12
#: Samples of the rotation in an episode (2e-5 with half or twice as many).
SAMPLES = 64
#: Samples of a contact's path times sqrt(tol). With half as many peaks change by 5e-5 on concrete
#: and by 5e-3 on the soft floor; with twice as many by 1e-5 and by 1.4e-3. The third impact with
#: spin magnifies this to 2e-2 and 1e-2.
FINE = 2.0
#: Most samples of a contact's path.
MOST_LOOKS = 4096
#: A scene is repeated until its loads and gaps change by less than CLOSE times tol …
CLOSE = 0.03
#: … or by less than NEAR times tol without further decrease.
NEAR = 0.3
#: A scene that stalls earlier is cut to half its rotation and half its time, at most so many times.
CUTS = 8
#: After a cut the next episode may last so many times as long.
GROWS = 1.5
#: A scene stalls after this many runs if its change exceeds half of that two runs earlier.
FEW_RUNS = 4
#: Most runs of a scene.
MOST_RUNS = 12
#: Runs are coarse until the change is less than SWITCH times tol. Their accuracy is at first this
#: (3e-7 with half of it, 9e-5 with twice as much), …
ROUGH = 1e-2
#: … then GAIN times the change (4e-4 with half or twice as much: in the last of three impacts); …
GAIN = 0.1
#: … the error of a step is SHARE times the accuracy (4e-6 with twice as much).
SHARE = 0.1
#: See `ROUGH` (8e-6 with twice as much).
SWITCH = 0.1


class AtPeak(NamedTuple):
    """The points that press at the largest force, the strongest first, the work [J] of the contacts
    up to then, alone and with the patches, and the vertical (3,) in the axes of the part.
    """

    points: IntArray
    work: float
    with_patches: float
    up: Array


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of contact.

    Attributes
    ----------
    touch : the body as it touches; on a layer, pieces of its surface are among its points. The
        scene is linear about this start.
    end : state of the body.
    history : history of the scene; its time counts from the start and continues beyond `end`.
    which : (n,) numbers of its points in contact, which are sites "0", "1", … of the scene's body.
    held : number of a point -> its contact, for contacts that continue after the end.
    layer : energy of the layer under the pieces at the end [J].
    """

    touch: Touch
    end: State
    history: SceneHistory
    which: IntArray
    held: dict[int, OngoingContact]
    layer: float = 0.0

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
        if self.body.layer_contact is not None:
            closed = (
                contact
                for contact in self.held.values()
                if contact.contact.closed and contact.stiffness > 0
            )
            return self.layer + sum(
                float(contact.force[1:] @ contact.force[1:]) / (2 * contact.stiffness)
                for contact in closed
            )
        node = int(np.argmin(np.abs(self.history.time - self.duration)))
        return float(self.history.energy.contact[node])

    @property
    def pressed(self) -> float:
        """Largest approach [m] in a contact, including the patches of part and floor."""
        return float(self._approaches.max())

    @property
    def _approaches(self) -> Array:
        """Approaches (n, sites) [m] of all contacts at the times of the run."""
        run = self.history.run
        R = self.history.assembly.system.R
        return np.asarray((run.depth + run.force @ R.T)[:, : len(self.which)])

    @cached_property
    def at_peak(self) -> AtPeak:
        """The episode at its largest force."""
        times, forces = self.forces()
        peak = int(np.argmax(forces.sum(axis=1)))
        depths = self.history.run.depth[:, : len(self.which)]
        work, with_patches = (
            float(trapezoid(forces[: peak + 1], way[: peak + 1], axis=0).sum())
            for way in (depths, self._approaches)
        )
        path = path_of(self.touch, self.history, np.linspace(0.0, times[peak], SAMPLES + 1))
        strongest = np.argsort(-forces[peak])
        pressing = strongest[forces[peak][strongest] > 0]
        return AtPeak(self.which[pressing], work, with_patches, path.R[-1, 2])

    @property
    def error(self) -> float:
        """Estimated relative error of the forces; inf if the march stopped at the end.

        A run that stopped in the flight after the end has no estimate: 0.
        """
        largest = max(self.history.error.values())
        last = float(self.history.time[-1])
        in_flight = self.duration < last * (1 - 1e-12)
        if largest == np.inf and in_flight:
            return 0.0
        return largest

    @property
    def misjudged(self) -> dict[int, float]:
        """Number of a sharp vertex -> its work [J], where its ball stands for another one."""
        laws = self.history.assembly.laws
        works = {}
        for k, depth in enumerate(self.sunk().tolist()):
            blunt = self.body.blunt.get(int(self.which[k]))
            if blunt is not None and depth > 0:
                law: Any = laws[k]
                work = float(law.loading_work(depth))
                if blunt.corner.differs(law, work):
                    works[int(self.which[k])] = work
        return works

    def sunk(self) -> Array:
        """Largest indentations (n,) [m] in the laws of the points."""
        run = self.history.run
        return run.depth[run.time <= self.duration * (1 + 1e-12), : len(self.which)].max(axis=0)

    def complete(self, pressing: BoolArray) -> bool:
        """Whether those of its points that press stand for all of the surface there.

        They are balls, or have what the floor cuts of the part.
        """
        return all(i in self.body.cut or self.body.balls[i] for i in self.which[pressing].tolist())

    @property
    def deepest(self) -> float:
        """Largest depth [m] in the laws, or on a layer the depth of the body's lowest vertex."""
        last = min(self.duration, float(self.history.time[-1]))
        body = self.body
        times = np.linspace(0.0, last, SAMPLES + 1)
        if body.layer_contact is None:
            return float(self.sunk().max())
        path = path_of(self.touch, self.history, times)
        low = (path.R[:, 2] @ body.points.T - body.balls)[:, : len(body.layer_contact.round)].min(
            axis=1
        )
        return -float((_heights(self.touch, path) + low).min())

    def along_line(self) -> bool:
        """Whether the body lands along a line of its surface for which there is no line law.

        On a layer the pieces of the surface are such contacts, without an error.
        """
        return self.rough_line is not None

    @cached_property
    def rough_line(self) -> RoughLine | None:
        """What is pressed into the floor of lines without a law; None: nothing.

        It is longer than wide: a line that is inclined touches with its end, as a point does.
        """
        body = self.body
        if body.layer_contact is not None or not len(body.lines) or self.lines:
            return None
        times = np.linspace(0.0, min(self.duration, float(self.history.time[-1])), SAMPLES + 1)
        vertical = path_of(self.touch, self.history, times).R[:, 2]
        lowest = (vertical @ body.points[self.which].T - body.balls[self.which]).min(axis=1)
        heights = vertical @ body.lines.T - lowest[:, None]
        spacing = float(np.median(cKDTree(body.lines).query(body.lines, 2)[0][:, -1]))
        # between two vertices the surface is lower
        depths = np.interp(times, self.history.run.time, self._approaches.max(axis=1))
        depths = depths.clip(0.0)[:, None]
        depths = depths + spacing**2 / (8 * body.line_radii)
        extents = [_extent(body.lines[below]) for below in heights < depths]
        k = int(np.argmax(extents))
        vertex = int(np.argmin(heights[k]))
        radius = float(body.line_radii[vertex])
        width = 2 * float(np.sqrt(2 * radius * depths[k, vertex]))
        if extents[k] < SLENDER * width:
            return None
        length = extents[k] + 2 * spacing  # to the next vertices
        point = int(np.argmin(np.linalg.norm(body.points - body.lines[vertex], axis=1)))
        return RoughLine(length, radius, point)

    @property
    def lines(self) -> dict[int, IntArray]:
        """Number of each line along which the body lands -> indices of the contacts at its
        stations.
        """
        contacts_of_line = [
            np.flatnonzero(np.isin(self.which, stations)) for stations in self.body.stations
        ]
        return {k: stations for k, stations in enumerate(contacts_of_line) if len(stations)}

    def strongest(self) -> dict[int, Array]:
        """Number of each line -> forces [N] at its stations when their sum is largest."""
        forces = self.forces()[1]
        forces_of_line = {k: forces[:, stations] for k, stations in self.lines.items()}
        return {k: force[np.argmax(force.sum(axis=1))] for k, force in forces_of_line.items()}

    def inclined(self) -> bool:
        """Whether only some stations of a line carry its largest force."""
        forces = self.strongest().values()
        return any((force > 0).any() and (force > 0).sum() < STATIONS for force in forces)

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
        run = self.history.run
        in_episode = run.time <= self.duration * (1 + 1e-12)
        return run.time[in_episode], np.maximum(run.force[in_episode, : len(self.which)], 0.0)

    def peak_force(self) -> float:
        """Largest sum of the normal forces [N], from the parabola of each step."""
        total = self.forces()[1].sum(axis=1)
        first = total[:-2:2]
        middle = total[1:-1:2]
        last = total[2::2]
        slope = 4 * middle - 3 * first - last
        curvature = 2 * (first - 2 * middle + last)
        peak_in_step = (slope > 0) & (slope < -2 * curvature)
        vertices = first[peak_in_step] - slope[peak_in_step] ** 2 / (4 * curvature[peak_in_step])
        return float(max(total.max(initial=0.0), vertices.max(initial=0.0)))

    def impulses(self) -> Array:
        """Normal impulses (sites,) [N s]."""
        t, f = self.forces()
        last = 2 * ((t.size - 1) // 2) + 1
        return np.asarray(impulses(t[:last], f[:last]).sum(axis=0))


def _extent(points: Array) -> float:
    """Diagonal [m] of the box around points (n, 3); 0 without points."""
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0


def episode(
    body: FreeBody,
    start: State,
    setting: Setting,
    ongoing: dict[int, OngoingContact],
    before: float = np.inf,
) -> Episode:
    """The contact that begins at `start`; the arguments are those of `_episode`.

    It is repeated until the balls of sharp vertices stand for the work that they take.
    """
    works: dict[int, float] = {}
    for _ in range(BALLS):
        contact = _episode(body.sharp(), start, setting, ongoing, before, works)
        if not contact.misjudged:
            break
        works = works | contact.misjudged
    return contact


def _episode(
    body: FreeBody,
    start: State,
    setting: Setting,
    ongoing: dict[int, OngoingContact],
    before: float,
    works: Mapping[int, float],
) -> Episode:
    """The contact that begins at `start`.

    ongoing : number of a point -> its contact, for those that continue from the previous episode;
    `before`: duration of the previous episode [s]; `works`: number of a point -> its work [J] in a
    run before.
    """
    body = landing(with_layer_laws(body, start, setting), start)
    touch = Touch.of(body, start, works)
    tol = setting.tol
    heights = start.heights(body, setting.floor.ground)
    if body.idle is not None:
        heights[body.idle] = np.inf
    points = np.array([np.argmin(heights)])
    base = scene_of(touch, setting, points, ongoing)
    time = base.contact_time_estimate
    largest_turn = TURNS
    cuts = 0
    longest = min(LONGEST * LONG * time, GROWS * before)
    duration = min(LONG * time, longest)
    touched = _candidates(touch, heights, time, [*ongoing])
    while True:
        if not np.array_equal(points, touched):
            points = touched
            base = scene_of(touch, setting, points, ongoing)
        history = run_once(base, duration, SHARE * max(ROUGH, tol), {})
        share = 0.0
        if history.status:
            history, share = run(base, duration, tol)
        end, touching = _end(touch, history, largest_turn)
        if touching and end == history.time[-1] < longest and not history.status:
            duration = min(2 * duration, longest)
            continue
        arguments = touch, points, base, duration, largest_turn, tol
        converged = _converged_on_path(*arguments, history, share)
        is_rough = converged.change > NEAR * tol and cuts < CUTS
        if not (share or is_rough or len(_untouched_point(touch, heights, converged.path, points))):
            converged = _converged_on_path(*arguments, *run(converged.following, duration, tol))
        if converged.change > NEAR * tol and cuts < CUTS:
            largest_turn = largest_turn / 2
            cuts = cuts + 1
            duration = longest = converged.end / 2
            continue
        sinking = _untouched_point(touch, heights, converged.path, points)
        if not len(sinking):
            break
        touched = np.append(points, sinking)
    history = converged.history
    path = converged.path
    end = converged.end
    touching = converged.touching
    state, end_contacts = handed_over(touch, history, path, points)
    in_layer = layer_energy(body, state, setting) if touching else 0.0
    return Episode(touch, state, history, points, end_contacts if touching else {}, in_layer)


class Followed(NamedTuple):
    """A run, its path up to its end, the scene corrected for that path, and the relative change."""

    history: SceneHistory
    path: Path
    following: Assembly
    change: float
    end: float
    touching: bool


def _converged_on_path(
    touch: Touch,
    which: IntArray,
    base: Assembly,
    duration: float,
    turns: float,
    tol: float,
    history: SceneHistory,
    share: float,
) -> Followed:
    """Repeat the scene `base` on the path of the previous run until the paths no longer change.

    share: error tolerance of the first run, whose forces have converged, and of the following ones.
    With 0 the runs start coarse and become finer as their paths converge.
    """
    changes: list[float] = []
    path_tol, accuracy = (CLOSE * tol, tol) if share else (SWITCH * tol, max(ROUGH, tol))
    while True:
        end, touching = _end(touch, history, turns)
        path = path_of(touch, history, _times(touch.body, base, history, end, accuracy))
        corrected, change = on_path(touch, which, base, history, path)
        changes.append(change)
        if change <= path_tol or _stalls(changes) or (history.status and not share):
            return Followed(history, path, corrected, change, end, touching)
        if share and history.status:
            history, share = run(corrected, duration, tol)
        elif share:
            scale = float(history.run.force[:, : len(which)].max())
            history = run_once(corrected, duration, share, history.error, scale)
        else:
            if (finer := max(GAIN * change, tol)) <= accuracy / 2:
                accuracy = finer
                changes = []
            history = run_once(corrected, duration, SHARE * accuracy, {})


def _stalls(changes: list[float]) -> bool:
    """Whether the change has not halved in two runs, or the runs are used up."""
    count = len(changes)
    return count == MOST_RUNS or (count >= FEW_RUNS and changes[-1] > changes[-3] / 2)


def _times(body: FreeBody, base: Assembly, history: SceneHistory, end: float, tol: float) -> Array:
    """Times (n,) up to `end` at which the path is evaluated."""
    count = 1 + int(min(np.ceil(FINE / np.sqrt(tol)), MOST_LOOKS))
    if (
        body.layer_contact is not None
    ):  # the pieces of its surface on a layer share the time of their contact
        t = [np.linspace(0.0, end, 2 * count)]
    else:
        spans = [span for c in history.contact_histories for span in c.contacts]
        t = [np.linspace(*span, count) for span in [(0.0, end), *spans]]
    return np.unique(np.clip(np.concatenate([base.system.breaks, *t]), 0.0, end))


def _candidates(touch: Touch, heights: Array, time: float, ongoing: list[int]) -> IntArray:
    """The points that may touch: low ones, apart from each other, the lowest first.

    time : expected duration of the contact [s].
    """
    body = touch.body
    start = touch.start
    arms = start.arms(body)
    speeds = np.linalg.norm(start.velocity + np.cross(start.spin(body), arms), axis=1)
    distance = REACH * float(speeds.max()) * time
    candidates = [*ongoing]
    covered = body.touching_as(candidates)
    for i in np.argsort(heights, kind="stable").tolist():
        if candidates and (heights[i] > distance or len(candidates) >= MOST + len(body.laws)):
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


def _untouched_point(touch: Touch, heights: Array, path: Path, which: IntArray) -> IntArray:
    """Number, as an array, of the point that sinks deepest without a contact; empty if there is
    none.

    On a layer: all such points. heights : (V,) of all points at the start [m].
    """
    body = touch.body
    vertical = path.R[:, 2]
    lifts = np.einsum("nd,vjd,nj->nv", vertical, body.shapes, path.q[:, 6:], optimize=True)
    lifts += path.q[:, 2:3] / np.sqrt(body.mass) + vertical @ body.points.T
    lowest = heights + (lifts - lifts[0]).min(axis=0)
    # what a contact presses in, points next to it may sink too; and all points between many
    deepest = min(float(lowest[which].min()), 0.0)
    has_contact = body.touching_as(which.tolist()) | (len(which) >= MOST + len(body.laws))
    lowest = lowest - np.where(has_contact, deepest, 0.0)
    lowest[which] = np.inf
    if body.layer_contact is not None:
        motion = path.R[:, 2], path.q[:, 6:], _heights(touch, path)
        without_contact = np.setdiff1d(list(body.laws), which)
        volume, low, _ = body.layer_contact.pressed(
            without_contact - body.layer_contact.first, *motion
        )
        lowest[without_contact] = np.where(volume > 0, low, 0.0).min(axis=0)
    sinking = np.flatnonzero(lowest < -SINKS * body.extent)
    if body.layer_contact is not None:
        return sinking
    return sinking[np.argsort(lowest[sinking])[:1]]
