"""An episode of contact: the body as a scene with the floor, on the path on which it turns.

The points that may touch are sites with a normal and two tangential directions. The scene begins
linear about the orientation at the touch. It runs again, with the change of the lever arms and of
the gaps on the path of the run before as given loads and gaps, until that no longer matters
(`on_path`): the result is that of the body that turns, and its energy is kept. The modal state of
the flight is that of the scene at its start; its state at the end becomes a flight (`handed_over`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import trapezoid
from scipy.linalg import block_diag

from antiosc import Contact, Inertia, ModalState, Obstacle, Scene, SceneHistory, SiteModes
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import AccuracyError, without_warnings
from antiosc.base.texts import COMPLETED, STOPPED
from antiosc.engine.march import FINE as FINEST, Run, run as march_once
from antiosc.engine.system import Kept, System
from antiosc.extension import check_range, impulses, integrate_exact, set_initial_forces as begin
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.states import forces, integrated_states, interpolated, locate
from antiosc_studies.drops.body import FreeBody
from antiosc_studies.drops.flight import State, turned
from antiosc_studies.drops.floor import Setting, law_at
from antiosc_studies.drops.layer import layer_energy, with_layer_laws
from antiosc_studies.drops.lines import STATIONS, landing

BODY, FLOOR = "part", "floor"
#: Directions of the columns of a site: normal to the floor, and along it.
AXES = np.eye(3)[[2, 0, 1]]
#: Most contacts and steps of a scene.
LIMITS = 10_000, 50_000
#: Share of a contact time over which springs of friction are drawn out that go on.
DRAWN = 1e-5
#: Times that an orientation is put right by the spin that it has.
SWEEPS = 5
#: A run that stops before this share of an expected contact time has no forces at its start.
JAMMED = 1e-6
#: Share of a rougher run over that of a finer one; and of their difference the error of the finer,
#: twice 1/(COARSER - 1).
COARSER, LEFT = 4.0, 2 / 3
#: In place of 0 where it divides.
TINY = float(np.finfo(float).tiny)


class OngoingContact(NamedTuple):
    """A contact that goes on from an episode before.

    Its height [m] without force, the forces of its rows (normal, friction) [N], its tangential
    stiffness [N/m], and what its law remembers.
    """

    height: float
    force: Array
    stiffness: float
    kept: Kept


class Path(NamedTuple):
    """Modal states q, v (n, 6 + J) and orientations R (n, 3, 3) of the body at times (n,).

    `turns` (n, 3): the sum of its rotations so far [rad]; `whole` (n, I): displacements of all
    modes of the scene.
    """

    times: Array
    whole: Array
    q: Array
    v: Array
    R: Array
    turns: Array


def scene_of(
    body: FreeBody,
    start: State,
    setting: Setting,
    which: IntArray,
    held: dict[int, OngoingContact],
) -> Assembly:
    """The scene of body and floor from a state, ready to run."""
    floor, slow = setting.floor, float(np.sqrt(body.extent / setting.gravity))
    bodies: dict[str, Any] = {BODY: _standing(body, start, which), FLOOR: Obstacle()}
    rigid = body.rigid_modes(start.R)[0] @ np.append(body.mass * start.velocity, start.momentum)
    motion = {BODY: ModalState(np.append(np.zeros(6), start.q), np.append(rigid, start.p))}
    if floor.ground is not None:
        bodies[FLOOR], motion[FLOOR] = floor.ground.body, floor.ground.start(start.floor)
    on = [held.get(int(i)) for i in which]
    contacts = [
        Contact(
            f"{BODY}:{k}",
            FLOOR,
            law_at(body, floor, i),
            gap=0.0,
            friction=floor.friction,
            tangential_stiffness=one.stiffness if one is not None and floor.friction else None,
        )
        for k, (i, one) in enumerate(zip(which.tolist(), on, strict=True))
    ]
    gravity = (0.0, 0.0, -setting.gravity)
    assembly = assemble_scene(Scene(bodies, contacts, gravity=gravity, motion=motion), slow)
    system, p, heights = assembly.system, len(which), start.heights(body, floor.ground, which)
    gaps = [
        max(h, 0.0) if one is None else h if body.layer_contact and i in body.laws else one.height
        for h, i, one in zip(heights, which.tolist(), on, strict=True)
    ]
    system.offsets[:, :p] = system.beta[:p] @ system.q + gaps
    force, drawn = np.zeros((2, len(system.beta)))
    for k, (one, sides) in enumerate(zip(on, system.sides, strict=True)):
        if one is not None:
            force[k] = one.force[0]
            force[sides] = one.force[1:]
            drawn[sides] = one.force[1:] / one.stiffness
    # springs of friction begin unstrained: what they press is added with them
    drawn += system.R @ force - system.R[:, :p] @ force[:p]
    drawn[p:] += system.R[p:, :p] @ force[:p]
    system.offsets[:, :p] += drawn[:p]
    kept = [None if one is None else one.kept for one in on]
    if body.layer_contact is not None:
        # the damping of a layer is that of the first touch, not that of each of its pieces
        closed = [one is not None and one.closed for one in kept]
        speeds = (one.speed for one in kept if one is not None and one.closed)
        system.least_speed = v = max([body.layer_contact.speed, *speeds])
        kept = [
            Kept(True, v, law.touch(v)) if pressing else None
            for law, pressing in zip(system.laws, closed, strict=True)
        ]
    begin(assembly, (kept, force[:p]) if held else None)
    if drawn.any():
        offsets = system.offsets[:1] - [np.zeros(len(drawn)), drawn]
        breaks, loads = (
            np.array([0.0, DRAWN * assembly.contact_time_estimate]),
            np.repeat(system.loads[:1], 2, axis=0),
        )
        system = replace(system, breaks=breaks, loads=loads, offsets=offsets)
    return replace(assembly, system=system)


def _standing(body: FreeBody, start: State, which: IntArray) -> SiteModes:
    """The body in the axes of the floor, as it stands at the start."""
    (W, momentum), (phi, r) = body.rigid_modes(start.R), body.sites(which)
    turn, size = AXES @ start.R, body.omega.size
    rigid = (W[:, None, :3] + np.cross(W[:, None, 3:], start.arms(body, which))) @ AXES.T
    B = np.concatenate((rigid, np.einsum("ab,njb->jna", turn, phi)))
    residual = turn @ r @ turn.T
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
    """The history of a scene whose forces have converged, and the share of its steps.

    Its status is 2 if it stopped before its end. AccuracyError where a force leaves the range of
    its law, or where friction jams.
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
    """The errors of the forces of all contacts together, by a run with a coarser share.

    The march refines until each contact has its tolerance; of a layer each piece is a contact.
    """
    coarse = run_once(assembly, duration, COARSER * share, {})
    if coarse.status:
        return fine.error
    t, count = np.union1d(fine.time, coarse.time), len(assembly.laws)
    rough, best = (forces(one.run, *locate(one.run, t)) for one in (coarse, fine))
    apart, size = (trapezoid((F**2).sum(axis=1), t) for F in (rough - best, best))
    low, high = (F[:, :count].sum(axis=1).max() for F in (rough, best))
    errors = {"force": np.sqrt(apart / size), "peak": abs(low / high - 1)}
    return {name: max(LEFT * float(e), COARSER * share) for name, e in errors.items()}


def run_once(
    assembly: Assembly, duration: float, share: float, error: dict[str, float], scale: float = 0.0
) -> SceneHistory:
    """The history of one run with a share of the error, of forces of a scale [N] if it is known.

    error: that of a run with this share that is hardly another.
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


def _history(assembly: Assembly, found: Run, error: dict[str, float]) -> SceneHistory:
    return SceneHistory(assembly, found, error, STOPPED if found.answer else COMPLETED, "")


def _jam(system: System) -> AccuracyError:
    """Why no forces fit: sliding presses a point in by more than its normal force lifts it."""
    friction, wedge = 0.0, 0.0
    for k, sides in enumerate(system.sides):
        across = float(np.linalg.norm(system.R[k, sides]))
        across /= max(float(system.R[k, k]), TINY)
        if system.slip[k, 0] * across > friction * wedge:
            friction, wedge = float(system.slip[k, 0]), across
    if friction == 0:
        return AccuracyError(
            "no contact forces fit where a contact goes on; take a smaller tol, or more modes."
        )
    return AccuracyError(
        f"friction of {friction:.3g} jams a point at its contact: sliding presses it in by "
        f"{friction * wedge:.3g} times what its normal force lifts it, by the compliance of the "
        f"modes that are left out, which must stay well below 1; take more modes (modes=), or less "
        f"friction."
    )


def path_of(body: FreeBody, start: State, history: SceneHistory, t: Array) -> Path:
    """The path of the body at times (n,) of a run, whose first is 0.

    Between two of them the spin changes evenly.
    """
    whole, speeds = history.states(t)
    q, v = (each[:, history.assembly.spans[BODY]] for each in (whole, speeds))
    W, momentum = body.rigid_modes(start.R)
    L, frozen = v[:, :6] @ momentum[:, 3:], v[:, :6] @ W[:, 3:]
    half, linear = np.diff(t)[:, None] / 2, np.diff(q[:, :6] @ W[:, 3:], axis=0)
    R = np.broadcast_to(start.R, (len(t), 3, 3))
    for _ in range(SWEEPS):
        more = np.einsum("nab,nb->na", R @ body.inverse @ np.swapaxes(R, 1, 2), L) - frozen
        turns = linear + half * (more[:-1] + more[1:])
        R = np.concatenate((start.R[None], turned(turns)))
        span = 1
        while span < len(R):  # products of the last 1, 2, 4, ... rotations
            R[span:] = R[span:] @ R[:-span]
            span *= 2
    return Path(t, whole, q, v, R, np.concatenate((np.zeros((1, 3)), np.cumsum(turns, axis=0))))


def on_path(
    body: FreeBody, start: State, which: IntArray, base: Assembly, history: SceneHistory, path: Path
) -> tuple[Assembly, float]:
    """The scene `base` on the lever arms that its points have on a path, and what that changes.

    What the forces of the run do in addition, on these arms, becomes given loads, and what the
    points move in addition a part of the gaps. The change is that against the scene that has run:
    of gaps over the largest depth, of loads over the largest ones of the contacts.
    """
    old, ran, span = base.system, history.assembly.system, base.spans[BODY]
    R, moved, beta = path.R, path.q - path.q[0], old.beta[:, span]
    W, shapes, balls = body.rigid_modes(start.R)[0], body.shapes[which], body.balls[which, None]
    arms = body.points[which] + np.einsum("kjd,nj->nkd", shapes, path.q[:, 6:])
    arms = arms @ np.swapaxes(R, 1, 2) - balls * AXES[0]
    ways = arms - arms[0] + (moved[:, :6] @ W[:, :3])[:, None]
    ways -= np.cross(path.turns[:, None], balls * AXES[0])  # a ball rolls
    acting = forces(history.run, *locate(history.run, path.times))
    pushes, linear = np.zeros_like(arms), acting @ beta
    offsets = interpolated(path.times, old.breaks, old.offsets).copy()
    for k, sides in enumerate(old.sides):
        for row, axis in ((k, 2), *zip(range(sides.start, sides.stop), range(2), strict=False)):
            pushes[:, k, axis] = acting[:, row]
            offsets[:, row] += moved @ beta[row] + ways[:, k, axis]
    bending = np.einsum("nkd,kjd->nj", pushes @ R, shapes)
    off = offsets - (last := interpolated(path.times, ran.breaks, ran.offsets))
    if body.layer_contact is not None:
        z, surface = _heights(body, start, path), body.layer_contact
        # the depth is free - gap; what is not of the body is of the floor
        free = path.whole @ old.beta.T - acting @ old.R.T
        ground = (path.whole - path.whole[0]) @ old.beta[0] - moved @ old.beta[0, span]
        deeper = ground - acting @ old.R[0]
        at = np.flatnonzero(which >= surface.first)
        pieces = which[at] - surface.first
        volume, low, place = surface.pressed(pieces, R[:, 2], path.q[:, 6:], z - deeper)
        offsets[:, at] = free[:, at] - surface.depth(pieces, volume, low)
        moving = place[..., 3:].reshape(len(R), len(at), *shapes.shape[1:])
        bent = place[..., :3] + np.einsum("nj,nkjd->nkd", path.q[:, 6:], moving)
        arms[:, at] = bent @ np.swapaxes(R, 1, 2)
        bending += np.einsum("nkd,nkjd->nj", pushes[:, at] @ R, moving - shapes[at])
        slid = _displaced(R, path.q[:, 6:], bent, moving) + (moved[:, :6] @ W[:, :3])[:, None]
        for k, piece in enumerate(at.tolist()):
            sides = old.sides[piece]
            more = (slid[:, k] - ways[:, piece])[:, : sides.stop - sides.start]
            offsets[:, sides] += more
            off[:, sides] += more
        # of a piece the force counts, over that of all pieces
        largest = float(np.abs(history.run.depth[:, : len(which)]).max())
        off[:, at] = surface.volume(pieces, free[:, at] - last[:, at]) - volume
        off[:, at] *= largest / max(float(volume.sum(axis=1).max()), TINY)
    total = np.append(pushes.sum(axis=1), np.cross(arms, pushes).sum(axis=1), axis=1)
    loads = interpolated(path.times, old.breaks, old.loads).copy()
    loads[:, span] += linear + np.append(total @ W.T, bending, axis=1)
    change = 0.0
    for each, size in (
        (off, history.run.depth[:, : len(which)]),
        (loads - interpolated(path.times, ran.breaks, ran.loads), linear),
    ):
        change = max(change, float(np.abs(each).max()) / max(float(np.abs(size).max()), TINY))
    return replace(
        base, system=replace(old, breaks=path.times, loads=loads, offsets=offsets)
    ), change


def _displaced(R: Array, q: Array, places: Array, shapes: Array) -> Array:
    """Displacements (n, k, 3) [m] of the material at places (n, k, 3) that move through a body.

    Friction there acts against these, and not against those of one material point: it would do work
    on the way by which the centre of pressure moves.

    R : (n, 3, 3) orientations; q : (n, J) of the modes; shapes : (n, k, J, 3) of the modes there.
    """
    place, shape = (places[1:] + places[:-1]) / 2, (shapes[1:] + shapes[:-1]) / 2
    steps = np.einsum("nab,nkb->nka", np.diff(R, axis=0), place)
    steps += np.einsum("nab,nkjb,nj->nka", (R[1:] + R[:-1]) / 2, shape, np.diff(q, axis=0))
    return np.concatenate((np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)))


def _heights(body: FreeBody, start: State, path: Path) -> Array:
    """Heights (n,) [m] of the centre of mass on a path over the floor as it is at the start."""
    assert body.layer_contact is not None
    moved = (path.q - path.q[0])[:, :6] @ body.rigid_modes(start.R)[0][:, 2]
    return np.asarray(body.layer_contact.height + moved)


def handed_over(
    body: FreeBody, start: State, history: SceneHistory, path: Path, which: IntArray
) -> tuple[State, dict[int, OngoingContact]]:
    """The state at the end of a path, and the contacts of the points (n,) that go on.

    With them go those that have parted and left a dent.
    The centre and the orientation are those of the path; momentum, angular momentum and the modes
    are those of the scene: the energy is that of the path.
    """
    a, run, t = history.assembly, history.run, float(path.times[-1])
    W, momentum = body.rigid_modes(start.R)
    moved, P = (path.q[-1] - path.q[0])[:6] @ W, path.v[-1, :6] @ momentum
    whole = np.array(integrated_states(run, a.system, *locate(run, path.times[-1:])))[:, 0]
    state = State(
        start.time + t,
        start.centre + moved[:3],
        P[:3] / body.mass,
        path.R[-1],
        P[3:],
        path.q[-1, 6:],
        path.v[-1, 6:],
        whole[:, a.spans[BODY].stop :],
    )
    node = int(np.argmin(np.abs(run.time - t)))
    force, kept = run.force[node], run.kept(a.system, t)
    heights, held = -(run.depth[node] + a.system.R @ force), {}
    each = zip(which.tolist(), kept, a.laws, a.system.sides, strict=True)
    for k, (i, one, law, sides) in enumerate(each):
        if one is not None and (one.closed or law.has_memory):
            rows, slip = [k, *range(sides.start, sides.stop)], float(a.system.slip[k, 1])
            held[i] = OngoingContact(float(heights[k]), one.closed * force[rows], slip, one)
    return state, held if any(one.kept.closed for one in held.values()) else {}


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
CLOSE, NEAR, CUTS, GROWS = 0.03, 0.3, 8, 1.5
#: Runs from which on a scene stalls if its change is more than half of that two runs before, and
#: most runs.
FEW_RUNS, MOST_RUNS = 4, 12
#: Runs are rough until the change is less than SWITCH times tol. Their accuracy is ROUGH at first,
#: then GAIN times the change; SHARE of it is the error of a step.
ROUGH, GAIN, SHARE, SWITCH = 1e-2, 0.1, 0.1, 0.1


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of contact.

    Attributes
    ----------
    start, end : states of the body; the scene is linear about that at the start.
    history : of the scene, whose time begins with `start`; it goes on beyond `end`.
    body : as it touches: on a layer its points are pieces of its surface.
    which : (n,) numbers of its points in contact, sites "0" and on of the scene's body.
    held : number of a point -> its contact, of those that go on at the end.
    layer : energy of the layer under pieces at the end [J].
    """

    start: State
    end: State
    history: SceneHistory
    body: FreeBody
    which: IntArray
    held: dict[int, OngoingContact]
    layer: float = 0.0

    @property
    def duration(self) -> float:
        """Time from the first touch to the end [s]."""
        return self.end.time - self.start.time

    @property
    def stored(self) -> float:
        """Energy of the contacts at the end [J]; > 0 where some are still closed."""
        if self.body.layer_contact is not None:
            closed = (one for one in self.held.values() if one.kept.closed and one.stiffness > 0)
            return self.layer + sum(
                float(one.force[1:] @ one.force[1:]) / (2 * one.stiffness) for one in closed
            )
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
        largest, last = max(self.history.error.values()), float(self.history.time[-1])
        after = self.duration < last * (1 - 1e-12)
        return 0.0 if largest == np.inf and after else largest

    def sunk(self) -> Array:
        """Largest indentations (n,) [m] of the laws of the points."""
        run = self.history.run
        return run.depth[run.time <= self.duration * (1 + 1e-12), : len(self.which)].max(axis=0)

    @property
    def deepest(self) -> float:
        """Largest depth [m] of the laws, or of the vertices of a rigid body on a layer."""
        last, body = min(self.duration, float(self.history.time[-1])), self.body
        times = np.linspace(0.0, last, LOOKS + 1)
        if body.layer_contact is None:
            return float(self.sunk().max())
        path = path_of(body, self.start, self.history, times)
        low = (path.R[:, 2] @ body.points.T - body.balls)[:, : len(body.layer_contact.round)].min(
            axis=1
        )
        return -float((_heights(body, self.start, path) + low).min())

    def along_line(self) -> bool:
        """Whether it lands along a line of its surface that has no law of its own.

        Of a layer the pieces of the surface are such contacts, without an error.
        """
        body = self.body
        if body.layer_contact is not None or not len(body.lines) or self.lines:
            return False
        times = np.linspace(0.0, min(self.duration, float(self.history.time[-1])), LOOKS + 1)
        up = path_of(body, self.start, self.history, times).R[:, 2]
        lowest = (up @ body.points[self.which].T - body.balls[self.which]).min(axis=1)
        return bool(((up @ body.lines.T).min(axis=1) - lowest).min() < self.pressed)

    @property
    def lines(self) -> dict[int, IntArray]:
        """Number of each line along which it lands -> which contacts are its stations."""
        contacts_of_station = [
            np.flatnonzero(np.isin(self.which, one)) for one in self.body.stations
        ]
        return {k: one for k, one in enumerate(contacts_of_station) if len(one)}

    def strongest(self) -> dict[int, Array]:
        """Number of each line -> forces of its stations where their sum is largest [N]."""
        forces = self.forces()[1]
        each = {k: forces[:, one] for k, one in self.lines.items()}
        return {k: one[np.argmax(one.sum(axis=1))] for k, one in each.items()}

    def inclined(self) -> bool:
        """Whether a line carries its largest force with a part of its length."""
        forces = self.strongest().values()
        return any((one > 0).any() and (one > 0).sum() < STATIONS for one in forces)

    def motion(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Orientations (n, 3, 3), and in the axes of the body spins and torques over the inertia
        (n, 3), at times (n,) since the start; modal accelerations (n, 6 + J)."""
        times = np.union1d(np.linspace(0.0, max(self.duration, t.max(initial=0.0)), LOOKS + 1), t)
        body = self.body
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

    def peak_force(self) -> float:
        """Largest sum of the normal forces [N]: of the parabola of each step, not of its nodes."""
        total = self.forces()[1].sum(axis=1)
        first, middle, last = total[:-2:2], total[1:-1:2], total[2::2]
        slope, bend = 4 * middle - 3 * first - last, 2 * (first - 2 * middle + last)
        inside = (slope > 0) & (slope < -2 * bend)
        vertices = first[inside] - slope[inside] ** 2 / (4 * bend[inside])
        return float(max(total.max(initial=0.0), vertices.max(initial=0.0)))

    def impulses(self) -> Array:
        """Normal impulses (sites,) [N s]."""
        t, f = self.forces()
        last = 2 * ((t.size - 1) // 2) + 1
        return np.asarray(impulses(t[:last], f[:last]).sum(axis=0))


def episode(
    body: FreeBody,
    start: State,
    setting: Setting,
    held: dict[int, OngoingContact],
    before: float = np.inf,
) -> Episode:
    """The contact that begins at `start`.

    held : number of a point -> its contact, of those that go on from an episode before; `before`:
        how long that lasted [s].
    """
    body = landing(with_layer_laws(body, start, setting), start)
    tol, heights = setting.tol, start.heights(body, setting.floor.ground)
    if body.idle is not None:
        heights[body.idle] = np.inf
    which = np.array([np.argmin(heights)])
    base = scene_of(body, start, setting, which, held)
    time, turns, cuts = base.contact_time_estimate, TURNS, 0
    longest = min(LONGEST * LONG * time, GROWS * before)
    duration = min(LONG * time, longest)
    touched = _candidates(body, start, heights, time, [*held])
    while True:
        if not np.array_equal(which, touched):
            which = touched
            base = scene_of(body, start, setting, which, held)
        history, share = run_once(base, duration, SHARE * max(ROUGH, tol), {}), 0.0
        if history.status:
            history, share = run(base, duration, tol)
        end, touching = _end(body, start, history, turns)
        if touching and end == history.time[-1] < longest and not history.status:
            duration = min(2 * duration, longest)
            continue
        arguments = body, start, which, base, duration, turns, tol
        ended = _followed(*arguments, history, share)
        wide = ended.change > NEAR * tol and cuts < CUTS
        if not (share or wide or len(_missed(body, start, heights, ended.path, which))):
            ended = _followed(*arguments, *run(ended.following, duration, tol))
        if ended.change > NEAR * tol and cuts < CUTS:
            turns, cuts = turns / 2, cuts + 1
            duration = longest = ended.end / 2
            continue
        missed = _missed(body, start, heights, ended.path, which)
        if not len(missed):
            break
        touched = np.append(which, missed)
    history, path, end, touching = ended.history, ended.path, ended.end, ended.touching
    state, below = handed_over(body, start, history, path, which)
    in_layer = layer_energy(body, state, setting) if touching else 0.0
    return Episode(start, state, history, body, which, below if touching else {}, in_layer)


class Followed(NamedTuple):
    """A run, its path up to its end, and the scene on that path, which differs by a change."""

    history: SceneHistory
    path: Path
    following: Assembly
    change: float
    end: float
    touching: bool


def _followed(
    body: FreeBody,
    start: State,
    which: IntArray,
    base: Assembly,
    duration: float,
    turns: float,
    tol: float,
    history: SceneHistory,
    share: float,
) -> Followed:
    """Run the scene `base` on the paths of the runs before until they no longer change.

    share: of the first run, whose forces have converged, and of all that follow; 0: of rough runs,
    which become finer as their paths come closer to each other.
    """
    changes: list[float] = []
    close, accuracy = (CLOSE * tol, tol) if share else (SWITCH * tol, max(ROUGH, tol))
    while True:
        end, touching = _end(body, start, history, turns)
        path = path_of(body, start, history, _times(body, base, history, end, accuracy))
        following, change = on_path(body, start, which, base, history, path)
        changes.append(change)
        if change <= close or _stalls(changes) or (history.status and not share):
            return Followed(history, path, following, change, end, touching)
        if share and history.status:
            history, share = run(following, duration, tol)
        elif share:
            scale = float(history.run.force[:, : len(which)].max())
            history = run_once(following, duration, share, history.error, scale)
        else:
            if (finer := max(GAIN * change, tol)) <= accuracy / 2:
                accuracy, changes = finer, []
            history = run_once(following, duration, SHARE * accuracy, {})


def _stalls(changes: list[float]) -> bool:
    """Whether runs no longer come closer to each other."""
    count = len(changes)
    return count == MOST_RUNS or (count >= FEW_RUNS and changes[-1] > changes[-3] / 2)


def _times(body: FreeBody, base: Assembly, history: SceneHistory, end: float, tol: float) -> Array:
    """Times (n,) up to an end at which the path is looked at; it is straight between them."""
    count = 1 + int(min(np.ceil(FINE / np.sqrt(tol)), MOST_LOOKS))
    if (
        body.layer_contact is not None
    ):  # the pieces of its surface on a layer share the time of their contact
        t = [np.linspace(0.0, end, 2 * count)]
    else:
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
    distance, chosen = REACH * float(speeds.max()) * time, [*held]
    taken = body.touching_as(chosen)
    for i in np.argsort(heights, kind="stable").tolist():
        if chosen and (heights[i] > distance or len(chosen) >= MOST + len(body.laws)):
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


def _missed(body: FreeBody, start: State, heights: Array, path: Path, which: IntArray) -> IntArray:
    """The point that sinks deepest into the floor on a path though it is no contact; or none.

    On a layer all that do.

    heights : (V,) of all points at the start [m].
    """
    up = path.R[:, 2]
    found = np.einsum("nd,vjd,nj->nv", up, body.shapes, path.q[:, 6:], optimize=True)
    found += path.q[:, 2:3] / np.sqrt(body.mass) + up @ body.points.T
    lowest = heights + (found - found[0]).min(axis=0)
    # what a contact presses in, points next to it may sink too; and all points between many
    deepest = min(float(lowest[which].min()), 0.0)
    pressed = body.touching_as(which.tolist()) | (len(which) >= MOST + len(body.laws))
    lowest = lowest - np.where(pressed, deepest, 0.0)
    lowest[which] = np.inf
    if body.layer_contact is not None:
        motion = path.R[:, 2], path.q[:, 6:], _heights(body, start, path)
        other = np.setdiff1d(list(body.laws), which)
        volume, low, _ = body.layer_contact.pressed(other - body.layer_contact.first, *motion)
        lowest[other] = np.where(volume > 0, low, 0.0).min(axis=0)
    sinking = np.flatnonzero(lowest < -SINKS * body.extent)
    return sinking if body.layer_contact is not None else sinking[np.argsort(lowest[sinking])[:1]]
