"""An episode of contact: the body, linear about its orientation, as a scene with the floor.

The points that may touch are sites with a normal and two tangential directions. The modal state of
the flight is that of the scene at its start; at the end, when all has parted, the scene's state
becomes a flight again with the same momentum, angular momentum, kinetic and strain energy. While
the scene runs its axes stand still though the body turns a little; the small rotation that is then
applied would change the energy of the spin: a small turn about the vertical, which moves no height,
restores it. The centre takes the height at which the lowest point lies as in the scene.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import without_warnings
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Inertia, ModalState
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.impactors import Obstacle
from antiosc.simulation.scene import Scene
from antiosc.simulation.scene_history import SceneHistory
from antiosc.simulation.scene_parts import Contact
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor, law_of
from antiosc.studies.drops.rotation import turned

#: Duration of a first run, over the expected time of contact.
LONG = 6.0
#: A body may turn by this angle [rad] in an episode; if it still touches, another one follows.
TURNS = 0.03
#: Longest run, over the first one.
LONGEST = 32.0
#: A gap [m] that is rounding error.
ROUNDING = 1e-18
#: Points that may touch within a run are those lower than this many times its way.
REACH = 3.0
#: Points are one contact that lie closer together than this share of the extent.
APART = 0.04
#: At most so many points touch in one episode: the lowest.
MOST = 12
#: Largest turn [rad] that restores the energy of a spin, and samples of its search on each side.
FARTHEST, SAMPLES = 0.25, 64

BODY, FLOOR = "part", "floor"
#: Directions of the columns of a site: normal to the floor, and along it.
AXES = np.eye(3)[[2, 0, 1]]


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of contact.

    Attributes
    ----------
    start, end : states of the body.
    history : of the scene, whose time begins with `start`; it goes on beyond `end`.
    which : (n,) numbers of the points in contact, sites "0" and on of the scene's body.
    held : number of a point -> its height [m], of contacts that go on at the end.
    corrected : rotation [rad] by which the orientation was corrected.
    """

    start: State
    end: State
    history: SceneHistory
    which: IntArray
    held: dict[int, float]
    corrected: float

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
        own = [self.history[f"{BODY}:{k}", FLOOR] for k in range(len(self.which))]
        keep = self.history.time <= self.duration * (1 + 1e-12)
        return self.history.time[keep], np.column_stack([c.force[keep] for c in own])

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
    duration = LONG * _contact_time(body, start, heights, floor)
    longest = LONGEST * duration
    extra: list[int] = []
    while True:
        which = _candidates(body, start, heights, duration, held, extra)
        gaps = np.array([held.get(i, max(float(heights[i]), 0.0)) for i in which.tolist()])
        with without_warnings():
            history = _scene(body, start, which, gaps, floor, gravity).run(duration, tol=tol)
        end, touching = _end(body, history, len(which))
        longer = touching and end == history.time[-1] and history.status != 2
        if longer and duration < longest:
            duration *= 2
            continue
        state, heights_at_end, corrected = _handed_over(body, start, history, end, which, floor)
        missed = _missed(body, state, which)
        if missed is not None and missed not in extra and len(which) < MOST:
            extra.append(missed)
            continue
        pairs = zip(which.tolist(), heights_at_end.tolist(), strict=True)
        below = {i: h for i, h in pairs if h < 0} if touching else {}
        return Episode(start, state, history, which, below, corrected)


def _contact_time(body: FreeBody, start: State, heights: Array, floor: Floor) -> float:
    """Expected time [s] of a contact of the lowest point with the floor."""
    i = int(np.argmin(heights))
    law = law_of(floor, tuple(body.radii[i].tolist()), body.materials[i])
    arm = _arms(body, start, np.array([i]))[0]
    spin = start.spin(body)
    n = np.array([0.0, 0.0, 1.0])
    turning = np.cross(arm, n)
    tensor = start.R @ body.tensor @ start.R.T
    mass = 1 / (1 / body.mass + turning @ np.linalg.solve(tensor, turning))
    speed = abs(float(start.velocity[2] + np.cross(spin, arm)[2])) + 1e-6
    low, high = 0.0, body.extent
    for _ in range(30):
        middle = 0.5 * (low + high)
        work = law.potential(middle, law.touch(speed))
        low, high = (low, middle) if work > 0.5 * mass * speed**2 else (middle, high)
    return 3 * high / speed


def _arms(body: FreeBody, state: State, which: IntArray) -> Array:
    """Arms (n, 3) [m] of the lowest points of the balls at points from the centre of mass."""
    arms = body.points[which] @ state.R.T
    arms[:, 2] -= body.balls[which]
    return arms


def _candidates(
    body: FreeBody,
    start: State,
    heights: Array,
    duration: float,
    held: dict[int, float],
    extra: list[int],
) -> IntArray:
    """The points that may touch: low ones, apart from each other, the lowest first."""
    arms = _arms(body, start, np.arange(len(body.points)))
    speeds = np.linalg.norm(start.velocity + np.cross(start.spin(body), arms), axis=1)
    way = REACH * float(speeds.max(initial=0.0)) * duration
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


def _scene(
    body: FreeBody, start: State, which: IntArray, gaps: Array, floor: Floor, gravity: float
) -> Scene:
    """The scene of body and floor from a state; `gaps` (n,): heights of the points [m]."""
    modes, shapes = _posed(body, start, which)
    spin = start.spin(body)
    moments, axes = body.principal
    # displacements are measured from the state without vibration, lowered so that all gaps are >= 0
    lifted = gaps - shapes[:, 0] @ start.q if start.q.size else gaps
    bodies: dict[str, object] = {BODY: modes, FLOOR: Obstacle()}
    motion = {}
    if floor.model is not None:
        own = floor.model.modal()
        bodies[FLOOR] = _ground(own)
        lifted = lifted - own.b @ start.floor[0]
        motion[FLOOR] = ModalState(*start.floor)
    lower = min(float(lifted.min()), 0.0)
    q = np.concatenate(([0.0, 0.0, lower * np.sqrt(body.mass), 0.0, 0.0, 0.0], start.q))
    turning = np.sqrt(moments) * (axes @ start.R.T @ spin)
    v = np.concatenate((start.velocity * np.sqrt(body.mass), turning, start.p))
    motion[BODY] = ModalState(q, v)
    contacts = [
        Contact(
            f"{BODY}:{k}",
            FLOOR,
            law_of(floor, tuple(body.radii[i].tolist()), body.materials[i]),
            gap=float(lifted[k] - lower) if lifted[k] - lower > ROUNDING else 0.0,
            friction=floor.friction,
        )
        for k, i in enumerate(which.tolist())
    ]
    return Scene(bodies, contacts, gravity=(0.0, 0.0, -gravity), motion=motion)


def _ground(own: ModalBody) -> SiteModes:
    """An elastic floor as a body of a scene, which the contact pushes down."""
    return SiteModes(
        own.omega,
        -own.b[:, None],
        ["top"],
        r=np.array([[own.r]]),
        directions=np.array([[0.0, 0.0, 1.0]]),
        decay=own.decay,
        weight=np.zeros((own.omega.size, 3)),
    )


def _posed(body: FreeBody, start: State, which: IntArray) -> tuple[SiteModes, Array]:
    """The body in the axes of the floor; elastic shapes (n, 3, J) of its sites."""
    moments, axes = body.principal
    axes = axes @ start.R.T
    arms = _arms(body, start, which)
    phi, r = body.sites(which)
    size = body.omega.size
    shapes = np.einsum("ab,njb->naj", AXES @ start.R, phi) if size else np.zeros((len(which), 3, 0))
    turning = np.cross(axes[None], arms[:, None]) / np.sqrt(moments)[:, None]  # (n, 3 axes, 3)
    rigid = np.concatenate(
        (np.broadcast_to(AXES.T / np.sqrt(body.mass), (len(which), 3, 3)), turning @ AXES.T), axis=1
    )
    B = np.concatenate((rigid, shapes.transpose(0, 2, 1)), axis=1)
    residual = np.zeros((3 * len(which), 3 * len(which)))
    turn = AXES @ start.R
    for k in range(len(which)):
        own = slice(3 * k, 3 * k + 3)
        residual[own, own] = turn @ r[k] @ turn.T
    matrix, momentum = np.zeros((6, 6)), np.zeros((6 + size, 6))
    matrix[:3, :3] = body.mass * np.eye(3)
    matrix[3:, 3:] = (axes.T * moments) @ axes
    momentum[:3, :3] = np.sqrt(body.mass) * np.eye(3)
    momentum[3:6, 3:] = np.sqrt(moments)[:, None] * axes
    elastic = {}
    if body.basis is not None:
        elastic = {"basis": (body.basis,), "shape": np.eye(6 + size)[6:]}
    modes = SiteModes(
        np.concatenate((np.zeros(6), body.omega)),
        B.transpose(1, 0, 2).reshape(6 + size, -1),
        {f"{k}": (3 * k, 3 * k + 1, 3 * k + 2) for k in range(len(which))},
        r=(residual + residual.T) / 2,
        directions=np.tile(AXES, (len(which), 1)),
        decay=np.concatenate((np.zeros(6), body.decay)),
        inertia=Inertia(np.zeros(3), (matrix + matrix.T) / 2, momentum),
        **elastic,  # type: ignore[arg-type]
    )
    return modes, shapes


def _end(body: FreeBody, history: SceneHistory, count: int) -> tuple[float, bool]:
    """Time at which the episode ends [s], and whether the body still touches.

    It ends when all has parted for good, or until the body has turned too far: contacts that follow
    within a third of `TURNS` belong to it. A contact that lasts is cut where it has turned by it.
    """
    last = float(history.time[-1])
    spans: list[tuple[float, float]] = []
    for start, end in sorted(
        span for k in range(count) for span in history[f"{BODY}:{k}", FLOOR].contacts
    ):
        if spans and start <= spans[-1][1]:
            spans[-1] = spans[-1][0], max(spans[-1][1], end)
        else:
            spans.append((start, end))
    if not spans:
        return last, False
    times = np.linspace(0.0, last, SAMPLES + 1)
    turn = history.at(times)[BODY].q[:, 3:6] / np.sqrt(body.principal[0])
    angle = np.linalg.norm(turn - turn[0], axis=1)
    nodes = history.time[::2]
    too_far = nodes[np.searchsorted(nodes, np.append(times[angle > TURNS], last)[0])]
    for (_, end), (following, _) in zip(spans, [*spans[1:], (np.inf, 0.0)], strict=True):
        if end > too_far or end >= last * (1 - 1e-12):
            return float(too_far), True
        if following > last or np.interp(following, times, angle) > TURNS / 3:
            return end, False
    return last, True


def _handed_over(
    body: FreeBody,
    start: State,
    history: SceneHistory,
    t: float,
    which: IntArray,
    own_floor: Floor,
) -> tuple[State, Array, float]:
    """The state at a time of the scene, the heights (n,) of its contacts, and the correction."""
    moments, axes = body.principal
    axes = axes @ start.R.T
    found = history.at([0.0, t])
    (q0, q), v = found[BODY].q, found[BODY].v[1]
    moved = (q - q0)[:3] / np.sqrt(body.mass)
    angle = ((q - q0)[3:6] / np.sqrt(moments)) @ axes
    spin = (v[3:6] / np.sqrt(moments)) @ axes
    L = start.R @ (body.tensor @ (start.R.T @ spin))
    node = int(np.argmin(np.abs(history.time - t)))
    heights = -history.run.depth[node, : len(which)]
    R, corrected = _of_equal_energy(body, start.R, turned(angle) @ start.R, L)
    floor = start.floor
    if floor.size:
        floor = np.array([found[FLOOR].q[1], found[FLOOR].v[1]])
    state = State(
        start.time + t, start.centre + moved, v[:3] / np.sqrt(body.mass), R, L, q[6:], v[6:], floor
    )
    return _fitted(body, state, which, heights, own_floor), heights, corrected


def _fitted(body: FreeBody, state: State, which: IntArray, heights: Array, floor: Floor) -> State:
    """The state moved so that points have the heights (n,) that they have in the scene.

    Their difference is of the second order in the rotation during the episode. Points in contact
    (heights < 0) are fitted by a small rotation too; the lowest one takes its height exactly.
    """
    R, z = state.R, state.centre[2]

    def off(R: Array, z: float) -> Array:
        own = z + body.points[which] @ R[2] - body.balls[which]
        own = own + (body.shapes[which] @ R[2]) @ state.q if state.q.size else own
        if floor.model is not None:
            own = own + floor.model.modal().b @ state.floor[0]
        return np.asarray(heights - own)

    held = heights < 0
    if held.sum() > 1:
        arms = body.points[which[held]] @ R.T
        rows = np.column_stack((np.full(len(arms), body.extent), arms[:, 1], -arms[:, 0]))
        found = np.linalg.lstsq(rows, off(R, z)[held], rcond=1e-6)[0]
        R = turned(np.array([found[1], found[2], 0.0])) @ R
    z = z + float(off(R, z)[np.argmin(heights)])
    return replace(state, R=R, centre=np.array([*state.centre[:2], z]))


def _of_equal_energy(body: FreeBody, before: Array, after: Array, L: Array) -> tuple[Array, float]:
    """`after`, turned about the vertical so that the angular momentum L has the energy it had.

    That is its energy in the orientation `before`, of the scene. The turn, by the smallest angle
    that does it, leaves all heights; torques on a horizontal floor are horizontal, and the energy
    of a spin about a horizontal axis depends on it to first order. Where no angle gives the energy,
    the one that comes closest is taken.
    """
    from scipy.optimize import brentq

    inverse = np.linalg.inv(body.tensor)
    wanted = float(L @ before @ inverse @ before.T @ L)
    if wanted == 0.0:
        return after, 0.0
    own = after @ inverse @ after.T

    def excess(angle: Array | float) -> Array:
        # the momentum turned the other way has the same energy as the turned body
        c, s = np.cos(angle), np.sin(angle)
        x, y = c * L[0] + s * L[1], c * L[1] - s * L[0]
        turned_L = np.stack([x, y, L[2] + 0 * x], axis=-1)
        return np.asarray(np.einsum("...i,ij,...j", turned_L, own, turned_L) / wanted - 1)

    angles = np.linspace(-FARTHEST, FARTHEST, 2 * SAMPLES + 1)
    values = excess(angles)
    crossing = np.flatnonzero(values[:-1] * values[1:] <= 0)
    if len(crossing):
        k = crossing[np.argmin(np.abs(angles[crossing] + angles[crossing + 1]))]
        angle = float(brentq(lambda a: float(excess(a)), angles[k], angles[k + 1], xtol=1e-15))
    else:
        angle = float(angles[np.argmin(np.abs(values))])
    return turned(np.array([0.0, 0.0, angle])) @ after, abs(angle)


def _missed(body: FreeBody, state: State, which: IntArray) -> int | None:
    """A point that is below the floor at the end though it was no contact."""
    shapes = body.shapes @ state.R[2] if body.omega.size else np.zeros((len(body.points), 0))
    z = state.centre[2] + body.points @ state.R[2] - body.balls + shapes @ state.q
    arms = _arms(body, state, np.arange(len(body.points)))
    low = np.flatnonzero(z < -1e-4 * body.extent)
    for i in low.tolist():
        if np.linalg.norm(arms[which] - arms[i], axis=1).min() > APART * body.extent:
            return i
    return None
