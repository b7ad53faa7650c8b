"""The trajectory of a fall: flight, contact, flight, until it rests or is ended."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from antiosc import ContactLaw, Dent, ElasticPlastic, Gonthier, Hertz
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError, without_warnings
from antiosc.base.texts import FieldsRepr, engineering
from antiosc.engine.contact.choice import Choice
from antiosc.engine.contact.geometry import effective_modulus, hertz_stiffness, relative_curvatures
from antiosc.engine.contact.peak_error import LARGEST_STRAIN, LEAST_STRAIN, error_of_peak
from antiosc.engine.contact.surfaces import Matter
from antiosc.extension import HertzContact
from antiosc.models.body import GRAVITY
from antiosc_studies.drops.body import FreeBody
from antiosc_studies.drops.episode import AXES, Episode, OngoingContact, episode
from antiosc_studies.drops.flight import SIDES, Flight, State
from antiosc_studies.drops.floor import Floor, Setting, law_at
from antiosc_studies.drops.lines import yielding

#: A fall is at rest whose speed would lift it by this share of the height at most, on points that
#: lie within a share of the extent over the floor and around its centre of mass, up to a distance.
REST, CARRIES, AROUND = 1e-3, 0.01, 1e-3
#: Motions that forces at the points move less than this share of others are free of them.
STILL = 1e-6
#: A point may be below the floor by this share of the extent deeper than contacts press in.
SUNK = 2e-3
#: Impacts at which a fall that does not come to rest is ended, and contacts, over the impacts that
#: are asked for or these: on a soft floor without losses, impacts follow each other as one.
MOST_IMPACTS, CONTACTS = 200, 3
#: Indentation over the radius up to which finite strain was measured (`ElasticPlastic`).
DEEP = 0.25
NO_IMPACT = "the fall has no impact; let it last longer (until=)."


def initial_state(
    body: FreeBody, setting: Setting, R: Array, spin: Array, velocity: Array
) -> State:
    """The initial state, with the lowest point at its height."""
    low = float((body.points @ R[2] - body.reach(R[2])).min())
    none = np.zeros(body.omega.size)
    ground = setting.floor.ground
    size = 0 if ground is None else ground.modes.omega.size
    centre = np.array([0.0, 0.0, setting.height - low])
    momentum = R @ (body.tensor @ (R.T @ spin))
    return State(0.0, centre, velocity, R, momentum, none, none, np.zeros((2, size)))


def trajectory(
    body: FreeBody, start: State, setting: Setting
) -> tuple[State, list[Episode], list[Flight], list[list[int]], str]:
    """A fall from a state until it rests, or ends.

    The last state, the contacts, the flights, the contacts of each impact, and why it ended.
    """
    episodes: list[Episode] = []
    flights: list[Flight] = []
    groups: list[list[int]] = []
    state, held, status, pressed = start, dict[int, OngoingContact](), "", 0.0
    contacts = CONTACTS * max(setting.impacts, MOST_IMPACTS)
    while not status:
        flight = Flight(body, state, setting.gravity, setting.floor.ground)
        remaining = setting.duration - state.time
        touch_time = 0.0
        if not held:
            most = min(flight.longest(), remaining)
            met = flight.touch(most)
            touch_time = most if met is None else met
            flights.append(flight)
            if touch_time >= remaining:
                status = f"the time {setting.duration:g} s is over"
                state = flight.at(remaining)
                break
        touch = flight.at(touch_time)
        _check_sides(body, touch)
        if episodes:
            _check_depth(body, touch, pressed, setting)
        # one impact: its flights are shorter than the longest period of the modes, or its contact
        soon = bool(groups) and touch_time < max(body.slowest, episodes[groups[-1][0]].duration)
        if not (held or soon):
            if len(groups) >= setting.impacts:
                status = f"{len(groups)} impacts"
                break
            groups.append([])
            pressed = 0.0
        groups[-1].append(len(episodes))
        before = episodes[-1].duration if held else np.inf
        episodes.append(one := episode(body, touch, setting, held, before))
        state, held = one.end, one.held
        pressed = max(pressed, one.pressed)  # dents of one impact stay when a point parts
        _check_depth(body, state, pressed, setting)
        if _rests(body, one.body, state, held, setting):
            status = "at rest"
        elif len(episodes) >= contacts:
            status = f"not at rest after {contacts:g} contacts"
    return state, episodes, flights, groups, status


def _check_sides(body: FreeBody, state: State) -> None:
    """InputError if no point that may touch is below the centre of mass, so that it would sink."""
    low = float((body.points @ state.R[2] - body.reach(state.R[2])).min())
    if low > SIDES * body.extent:
        raise InputError(
            f"the part would fall through the floor: {state.time:.4g} s after its start the lowest "
            f"point that may touch is {low:.3g} m above the centre of mass; give the RigidBody "
            f"sites on all sides of its centre, or end the fall before (until=)."
        )


def _check_depth(body: FreeBody, state: State, pressed: float, setting: Setting) -> None:
    """AccuracyError if a point is below the floor by more than contacts press it in [m]."""
    deep = -float(state.heights(body, setting.floor.ground).min())
    if body.layer_contact is None and deep > pressed + SUNK * body.extent:
        raise AccuracyError(
            f"the part sank through the floor at {state.time:.4g} s: a point is {deep:.3g} m "
            f"below it, and contacts press it in by {pressed:.3g} m at most; give a smaller "
            f"tol, or end the fall before (until=)."
        )


def _rests(
    body: FreeBody,
    pressed: FreeBody,
    state: State,
    held: dict[int, OngoingContact],
    setting: Setting,
) -> bool:
    """Whether the body rests on points around its centre of mass, with negligible motion.

    pressed : the body whose points are the contacts that are held.
    """
    arms = body.points @ state.R.T - body.reach(state.R[2])[:, None] * AXES[0]
    low = arms[:, 2]
    if state.centre[2] + low.min() > CARRIES * body.extent:
        return False
    carrying = arms[low < low.min() + CARRIES * body.extent]
    moving = _hindered(body, state, carrying, setting.floor.friction > 0)
    moving += _pushed(pressed, state, held, setting) + _shaken(body, state, held, setting)
    if moving > REST * body.mass * setting.gravity * setting.height:
        return False
    return _around(carrying[:, :2], AROUND * body.extent)


def _hindered(body: FreeBody, state: State, arms: Array, sticking: bool) -> float:
    """Kinetic energy [J] of the rigid motions that forces at arms (n, 3) could stop.

    The forces act upward, or in any direction if they are `sticking`: rolling of a ball, and
    sliding without friction, do not count.
    """
    W = body.rigid_modes(state.R)[0]
    moved = W[:, None, :3] + np.cross(W[:, None, 3:], arms)
    across, singular_values, _ = np.linalg.svd(moved.reshape(6, -1) if sticking else moved[:, :, 2])
    directions = across[:, : singular_values.size][:, singular_values > STILL * singular_values[0]]
    taken = directions.T @ W @ np.append(body.mass * state.velocity, state.momentum)
    return float(taken @ taken / 2)


def _pushed(
    body: FreeBody, state: State, held: dict[int, OngoingContact], setting: Setting
) -> float:
    """Energy [J] of the contacts in excess of that which carries the weight.

    Of one contact with the force F and the way d it is (F - m g)^2 d/F: of a linear law twice the
    energy, and no less than it of a force that grows faster than the way.
    """
    held = {i: h for i, h in held.items() if h.force[0] > 0}
    if not held:
        return 0.0
    W, points = body.rigid_modes(state.R)[0], list(held)
    arms, ways = state.arms(body, points), np.diag([-h.height / h.force[0] for h in held.values()])
    if setting.floor.ground is not None:
        ways = ways + setting.floor.ground.compliance
    forces = np.array([AXES[: h.force.size].T @ h.force for h in held.values()])
    wrench = np.append(forces.sum(axis=0), np.cross(arms, forces).sum(axis=0))
    wrench[2] -= body.mass * setting.gravity
    up = W[:, 2:3] + W[:, 3:] @ np.cross(arms, AXES[0]).T
    # up ways^-1 up' is the stiffness against rigid motions
    root = np.linalg.cholesky(np.linalg.inv(ways))
    impulses = np.linalg.lstsq(up @ root, W @ wrench, rcond=STILL)[0]
    return float(impulses @ impulses)


def _shaken(
    body: FreeBody, state: State, held: dict[int, OngoingContact], setting: Setting
) -> float:
    """Kinetic energy [J] of the body at the speed of the floor's vibration."""
    ground = setting.floor.ground
    if ground is None:
        return 0.0
    speed = ground.speed(state.floor, sum(float(h.force[0]) for h in held.values()))
    return 0.5 * body.mass * speed**2


def _around(points: Array, close: float) -> bool:
    """Whether the hull of points (n, 2) contains the origin, within a distance."""
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    if np.linalg.norm(points, axis=1).min() <= close:
        return True
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    return bool(gaps.max(initial=2 * np.pi if len(points) < 2 else 0.0) <= np.pi + 1e-9)


@dataclass(frozen=True, eq=False)
class Impact:
    """One impact: all contacts with less than a period of the slowest mode between them.

    Attributes
    ----------
    time : of the first touch [s]; contact_time : from there to the last release [s].
    place : (3,) point that takes most of the impulse, in the axes of the mesh [m].
    contacts : number of points that touched.
    peak_force : largest sum of the normal forces [N]; impulse : of the normal forces [N s].
    speed_before, speed_after : of that point along the normal, > 0 toward the floor before and
        away from it after [m/s], without vibrations.
    spin_before, spin_after : (3,) in the axes of the floor [rad/s].
    lost : energy that contacts and damping took [J].
    """

    time: float
    contact_time: float
    place: Array
    contacts: int
    peak_force: float
    impulse: float
    speed_before: float
    speed_after: float
    spin_before: Array
    spin_after: Array
    lost: float


#: Scalars of an impact, and their units.
UNITS = (
    ("time", "s"), ("peak_force", "N"), ("impulse", "N s"), ("contact_time", "s"),
    ("speed_before", "m/s"), ("speed_after", "m/s"), ("lost", "J"),
)  # fmt: skip


class Impacts(tuple[Impact, ...]):
    """The impacts of a fall; as text a table."""

    def column(self, name: str) -> Array:
        """One value of all impacts: (n,) or (n, 3)."""
        return np.array([getattr(one, name) for one in self])

    def columns(self) -> dict[str, Array]:
        """Name with unit -> (n,) values."""
        place = self.column("place").reshape(-1, 3)
        table = {f"{name.replace('_', ' ')} ({unit})": self.column(name) for name, unit in UNITS}
        table |= {f"place {axis} (m)": place[:, k] for k, axis in enumerate("xyz")}
        for name in ("spin_before", "spin_after"):
            spin = self.column(name).reshape(-1, 3)
            table[f"{name.replace('_', ' ')} (rad/s)"] = np.linalg.norm(spin, axis=1)
        return table

    def numbers(self) -> dict[str, object]:
        """The table as JSON values: name with unit -> values of all impacts."""
        return {name: values.tolist() for name, values in self.columns().items()}

    def __str__(self) -> str:
        rows = [
            f"{'':>3} {'time s':>10} {'place m':>26} {'peak N':>10} {'impulse Ns':>10} "
            f"{'contact s':>9} {'before m/s':>10} {'after m/s':>9} {'spin rad/s':>10} {'lost J':>9}"
        ]
        for k, one in enumerate(self):
            place = ", ".join(f"{c:.3g}" for c in one.place)
            rows.append(
                f"{k + 1:>3} {one.time:>10.5f} {place:>26} {one.peak_force:>10.4g} "
                f"{one.impulse:>10.4g} {one.contact_time:>9.3g} {one.speed_before:>10.4g} "
                f"{one.speed_after:>9.4g} {np.linalg.norm(one.spin_after):>10.4g} {one.lost:>9.3g}"
            )
        return "\n".join(rows)


@dataclass(frozen=True)
class Peak(FieldsRepr):
    """The largest value of a signal, as `Fall.peak` finds it.

    Attributes
    ----------
    value : in SI units.
    time : [s].
    impact : number of the impact, from 0.
    """

    value: float
    time: float
    impact: int

    @property
    def g(self) -> float:
        """The value of an acceleration in g."""
        return self.value / GRAVITY

    def __float__(self) -> float:
        return self.value


def impact_of(body: FreeBody, gravity: float, own: Sequence[Episode]) -> Impact:
    """The impact that consists of some episodes."""
    impulses: dict[int, float] = {}
    peak = 0.0
    # a point above its dent begins an episode in which nothing pushes: flight
    own = [one for one in own if one.forces()[1].any()] or own
    for one in own:
        peak = max(peak, one.peak_force())
        for i, value in zip(one.which.tolist(), one.impulses().tolist(), strict=True):
            impulses[i] = impulses.get(i, 0.0) + value
    most = max(impulses, key=lambda i: impulses[i])
    body = next(one.body for one in own if most in one.which)
    before, after = own[0].start, own[-1].end
    energies = [sum(s.energies(body, gravity)) for s in (before, after)]
    return Impact(
        time=before.time,
        contact_time=after.time - before.time,
        place=body.points[most] - body.balls[most] * before.R[2] + body.centre,
        contacts=sum(value > 0 for value in impulses.values()),
        peak_force=peak,
        impulse=sum(impulses.values()),
        speed_before=-_rising(body, before, most),
        speed_after=_rising(body, after, most),
        spin_before=before.spin(body),
        spin_after=after.spin(body),
        lost=energies[0] - energies[1],
    )


def _rising(body: FreeBody, state: State, point: int) -> float:
    """Speed [m/s] at which a point of the rigid body rises."""
    (arm,) = state.arms(body, [point])
    return float((state.velocity + np.cross(state.spin(body), arm))[2])


def contact_yield(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> str:
    """Sentence that a contact yields, with its permanent indentation; "" if not, or unknown."""
    if floor.layer is not None:
        return ""
    pressures = []
    for one in episodes:
        for line, forces in one.strongest().items():
            if note := yielding(body, floor, line, float(forces.sum())):
                return note
        for i, force in zip(one.which.tolist(), one.forces()[1].max(axis=0).tolist(), strict=True):
            known = _elastic_contact(body, law_at(body, floor, i), i, force) if force > 0 else None
            pressures += [] if known is None else [known]
    dents = {one.dent: one for one in point_contacts(body, floor, episodes) if one.dent is not None}
    if dents:
        worst = max(dents, key=lambda dent: dent.depth)
        return f"the contact yields: {worst.text}; {_law_error(dents[worst], body, floor)}"
    return max(pressures, key=lambda one: one.share).warning() if pressures else ""


class PointContact(NamedTuple):
    """A contact at a point: its law and relative curvature [1/m], largest force [N] and indentation
    [m], its time [s], and the dent if it yielded.
    """

    which: int
    law: ElasticPlastic | Hertz | Gonthier
    curvature: float
    force: float
    depth: float
    contact_time: float
    dent: Dent | None

    def error(self, body: FreeBody, floor: Floor) -> float | None:
        """Relative error of the force by its law; None where it is not known."""
        soft, unknown = None, _unknown(body, floor, self.which)
        if isinstance(law := self.law, ElasticPlastic):
            strength = law.yield_strength
            soft = next(
                (m for m in (*body.matters, floor.face.matter) if m.yield_strength == strength),
                None,
            )
            soft = soft or Matter(law.modulus, yield_strength=strength)
        choice = Choice(self.law, "", soft, unknown, curvature=self.curvature)
        return error_of_peak(choice, self.force, self.contact_time)


def point_contacts(
    body: FreeBody, floor: Floor, episodes: Sequence[Episode]
) -> Iterator[PointContact]:
    """The contacts at points with a law of both surfaces."""
    for one in episodes:
        peaks, depths = one.forces()[1].max(axis=0).tolist(), one.sunk().tolist()
        for k, (i, force) in enumerate(zip(one.which.tolist(), peaks, strict=True)):
            law, history = law_at(body, floor, i), one.history.contact_histories[k]
            if not isinstance(law, ElasticPlastic | Hertz | Gonthier) or not history.contacts:
                continue
            yields = isinstance(law, ElasticPlastic) and force > law.yield_force
            dent = history.dent if yields else None
            start, end = max(history.contacts, key=lambda each: each[1] - each[0])
            bent = 1 / float(body.radii[i].min())
            yield PointContact(i, law, bent, force, depths[k], end - start, dent)


def _unknown(body: FreeBody, floor: Floor, which: int) -> str:
    """The property on which the error of a law depends and that is not known; "" if all is."""
    E = float(body.materials[which][0])
    strong = body.strengths is not None and np.isfinite(body.strengths[which])
    known = (
        strong
        or np.isnan(E)
        or any(m.known and m.E == E for m in (*body.matters, floor.face.matter))
    )
    return "" if known and floor.face.matter.known else "yield_strength"


def strained(one: PointContact, body: FreeBody, floor: Floor) -> str:
    """Sentence on the force of an elastic contact of large strains; "" if there is none."""
    if one.dent is not None or one.depth * one.curvature < LEAST_STRAIN:
        return ""
    note = _law_error(one, body, floor)
    return f"the contact is pressed in by {one.depth * one.curvature:.2g} of its radius; {note}"


def _law_error(worst: PointContact, body: FreeBody, floor: Floor) -> str:
    """Sentence on the error of a force by its law."""
    if _unknown(body, floor, worst.which):
        return "the error of that force is not known: give part and floor a yield strength"
    error = worst.error(body, floor)
    if error is None:
        return f"the force's error is known up to {LARGEST_STRAIN:g} of it: take a blunter part"
    cause = "large strains" if worst.dent is None else "the law and the range of the yield strength"
    message = f"by {cause} that force may be off by {error:.0%}"
    if worst.dent is None or worst.depth * worst.curvature < DEEP:
        return message
    return (
        f"{message}, since it is pressed in by {engineering(worst.depth, 'm')} where the radius is "
        f"{engineering(1 / worst.curvature, 'm')}: give corner_radius= of corners that are blunter"
    )


def _elastic_contact(
    body: FreeBody, law: ContactLaw, which: int, force: float
) -> HertzContact | None:
    """A contact by Hertz's law with known strength; None for others."""
    strength = 0.0 if body.strengths is None else float(body.strengths[which])
    stiffness, radii = _stiffness(law), tuple(body.radii[which].tolist())
    if not strength > 0 or stiffness is None:
        return None
    with without_warnings():
        modulus = _modulus(stiffness, radii, body.materials[which])
    return HertzContact(stiffness, modulus, force, strength)


def _stiffness(law: ContactLaw) -> float | None:
    """k_H [N m^-3/2] of Hertz's law, damped or not; None for other laws."""
    stiffness, exponent = (getattr(law, name, None) for name in ("stiffness", "exponent"))
    return stiffness if isinstance(law, Hertz) or exponent == 1.5 else None


def _modulus(stiffness: float, radii: tuple[float, float], material: Array) -> float:
    """E* [Pa] of a law on a plane, from the radii; at most that of the part on a rigid floor.

    A stiffer law that is given is one of larger radii.
    """
    flat = relative_curvatures(radii, (np.inf, np.inf), 0.0)
    E, nu = material.tolist()
    return min(stiffness / hertz_stiffness(1.0, *flat), effective_modulus(E, nu, None, None))


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """The flights and the episodes of contact of a body from its start to its end.

    Attributes
    ----------
    body, setting : what falls, and on what.
    start, end : position, orientation, velocity and spin at the start and at the end.
    episodes, flights : in the order of time.
    groups : of each impact the indices of its episodes.
    message : why it ended.
    """

    body: FreeBody
    setting: Setting
    start: State
    end: State
    episodes: list[Episode]
    flights: list[Flight]
    groups: list[list[int]]
    message: str

    @cached_property
    def impacts(self) -> Impacts:
        """The impacts, as a table."""
        gravity = self.setting.gravity
        numbers = range(len(self.groups))
        return Impacts(impact_of(self.body, gravity, self._episodes(k)) for k in numbers)

    def energy(self) -> tuple[Array, Array]:
        """Times (n,) [s] of all touches and partings, and energies (n, 4) [J] there.

        Of the rigid motion, of the vibration, of the height of the centre, and of the contacts.
        """
        rows = [(self.start, 0.0)]
        for one in self.episodes:
            rows += [(one.start, rows[-1][1]), (one.end, one.stored)]
        rows.append((self.end, rows[-1][1]))
        gravity = self.setting.gravity
        energies = [(*s.energies(self.body, gravity), stored) for s, stored in rows]
        return np.array([s.time for s, _ in rows]), np.array(energies)

    def _episodes(self, impact: int) -> list[Episode]:
        if not self.groups:
            raise InputError(NO_IMPACT)
        k = checks.whole("impact", impact, least=0, most=len(self.groups) - 1)
        return [self.episodes[i] for i in self.groups[k]]
