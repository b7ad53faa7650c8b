"""The trajectory of a fall: flights and contacts in turn, until it rests or is ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot, nan, sqrt
from typing import NamedTuple

import numpy as np

from antiosc import ContactLaw, Dent, ElasticPlastic, Gonthier, Hertz
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError, without_warnings
from antiosc.base.plausible import GRAVITY
from antiosc.base.texts import FieldsRepr, engineering, percent
from antiosc.engine.contact.choice import Choice
from antiosc.engine.contact.dent import rim_radius
from antiosc.engine.contact.geometry import effective_modulus, hertz_stiffness, relative_curvatures
from antiosc.engine.contact.peak_error import (
    LEAST_STRAIN,
    error_of_peak,
    largest_strain,
    mean_strain_rate,
)
from antiosc.engine.contact.surfaces import Matter
from antiosc.extension import OF_ALL_CONTACTS, HertzContact, YieldingZone
from antiosc_studies.drops.beside import BESIDE, BETWEEN, share_beside, share_between
from antiosc_studies.drops.cylinder import rule
from antiosc_studies.drops.episode import AXES, Episode, OngoingContact, episode
from antiosc_studies.drops.flight import SIDES, Flight
from antiosc_studies.drops.floor import Floor, Setting, law_at
from antiosc_studies.drops.free_body import Blunt, FreeBody, State
from antiosc_studies.drops.layer_error import imprint_of, layer_error
from antiosc_studies.drops.lines import line_error, yielding

#: A part is at rest if its speed would lift it by at most REST times the height, …
REST = 1e-3
#: … and points within CARRIES times the extent over the floor …
CARRIES = 0.01
#: … surround its centre of mass up to AROUND times the extent.
AROUND = 1e-3
#: Rigid motions whose singular value is below this share of the largest are free of contact forces.
STILL = 1e-6
#: A point may lie deeper below the floor than contacts press in by this share of the extent.
SUNK = 2e-3
#: Number of impacts after which a fall without rest is ended.
MOST_IMPACTS = 200
#: Largest number of contacts over that of impacts: on a soft floor without losses successive ones
#: merge into one.
CONTACTS = 3
#: Largest indentation over the radius for which finite strain was measured (`ElasticPlastic`).
DEEP = 0.25
NO_IMPACT = "the fall has no impact; let it last longer (until)."


def initial_state(
    body: FreeBody, setting: Setting, R: Array, spin: Array, velocity: Array
) -> State:
    """The initial state, whose lowest point is at the height of the setting."""
    low = float((body.points @ R[2] - body.reach(R[2])).min())
    zero = np.zeros(body.omega.size)
    ground = setting.floor.ground
    size = 0 if ground is None else ground.modes.omega.size
    centre = np.array([0.0, 0.0, setting.height - low])
    momentum = R @ (body.tensor @ (R.T @ spin))
    return State(0.0, centre, velocity, R, momentum, zero, zero, np.zeros((2, size)))


def trajectory(
    body: FreeBody,
    start: State,
    setting: Setting,
    report: Callable[[int, int, float], None] = lambda *_: None,
) -> tuple[State, list[Episode], list[Flight], list[list[int]], str]:
    """Follow a fall until it rests or ends.

    `report` is called before each contact with the number of its impact and of the contact in it,
    from 1, and its time [s].

    Returns the last state, the contacts, the flights, the indices of the contacts of each impact,
    and why it ended.
    """
    episodes: list[Episode] = []
    flights: list[Flight] = []
    groups: list[list[int]] = []
    state = start
    ongoing = dict[int, OngoingContact]()
    reason = ""
    deepest = 0.0
    contacts = CONTACTS * max(setting.impacts, MOST_IMPACTS)
    while not reason:
        flight = Flight(body, state, setting.gravity, setting.floor.ground)
        remaining = setting.duration - state.time
        touch_time = 0.0
        if not ongoing:
            longest_flight = min(flight.longest(), remaining)
            first_touch = flight.touch(longest_flight)
            touch_time = longest_flight if first_touch is None else first_touch
            flights.append(flight)
            if touch_time >= remaining:
                reason = f"the time {setting.duration:g} s is over"
                state = flight.at(remaining)
                break
        touch = flight.at(touch_time)
        _check_sides(body, touch)
        if episodes:
            _check_depth(body, touch, deepest, setting)
        # flights within one impact are shorter than the longest modal period or its first contact
        same_impact = bool(groups) and touch_time < max(
            body.slowest, episodes[groups[-1][0]].duration
        )
        if not (ongoing or same_impact):
            if len(groups) >= setting.impacts:
                reason = f"{len(groups)} impacts"
                break
            groups.append([])
            deepest = 0.0
        groups[-1].append(len(episodes))
        report(len(groups), len(groups[-1]), touch.time)
        last_duration = episodes[-1].duration if ongoing else np.inf
        episodes.append(contact := episode(body, touch, setting, ongoing, last_duration))
        state = contact.end
        ongoing = contact.held
        deepest = max(deepest, contact.pressed)  # dents of one impact stay when a point parts
        _check_depth(body, state, deepest, setting)
        if _rests(body, contact.body, state, ongoing, setting):
            reason = "at rest"
        elif len(episodes) >= contacts:
            reason = f"not at rest after {contacts:g} contacts"
    return state, episodes, flights, groups, reason


def _check_sides(body: FreeBody, state: State) -> None:
    """Raise InputError if no point that may touch is below the centre of mass."""
    low = float((body.points @ state.R[2] - body.reach(state.R[2])).min())
    if low > SIDES * body.extent:
        raise InputError(
            f"the part would fall through the floor: {state.time:.4g} s after its start the lowest "
            f"point that may touch is {low:.3g} m above the centre of mass; give the RigidBody "
            f"sites on all sides of its centre, or end the fall before (until)."
        )


def _check_depth(body: FreeBody, state: State, pressed: float, setting: Setting) -> None:
    """Raise AccuracyError if a point is further below the floor than contacts press in [m]."""
    depth = -float(state.heights(body, setting.floor.ground).min())
    if body.layer_contact is None and depth > pressed + SUNK * body.extent:
        raise AccuracyError(
            f"the part sank through the floor at {state.time:.4g} s: a point is {depth:.3g} m "
            f"below it, and contacts press it in by {pressed:.3g} m at most; give a smaller "
            f"tol, or end the fall before (until)."
        )


def _rests(
    body: FreeBody,
    pressed: FreeBody,
    state: State,
    ongoing: dict[int, OngoingContact],
    setting: Setting,
) -> bool:
    """Whether the body rests on points around its centre of mass, with negligible motion.

    pressed : the body to which the points of the ongoing contacts belong.
    """
    arms = body.points @ state.R.T - body.reach(state.R[2])[:, None] * AXES[0]
    heights = arms[:, 2]
    if state.centre[2] + heights.min() > CARRIES * body.extent:
        return False
    carrying = arms[heights < heights.min() + CARRIES * body.extent]
    W = body.rigid_modes(state.R)[0]
    energy = _stoppable_energy(body, state, W, carrying, setting.floor.friction > 0)
    energy += _excess_energy(pressed, state, W, ongoing, setting) + _vibration_energy(
        body, state, ongoing, setting
    )
    if energy > REST * body.mass * setting.gravity * setting.height:
        return False
    return _contains_origin(carrying[:, :2], AROUND * body.extent)


def _stoppable_energy(body: FreeBody, state: State, W: Array, arms: Array, sticking: bool) -> float:
    """Kinetic energy [J] of rigid motion that forces at the contact points, at arms (n, 3), could
    stop.

    The forces act upward, or if `sticking` in any direction: rolling of a ball, and sliding without
    friction, do not count. W : (6, 6) rigid modes.
    """
    velocities = W[:, None, :3] + np.cross(W[:, None, 3:], arms)
    U, singular_values, _ = np.linalg.svd(
        velocities.reshape(6, -1) if sticking else velocities[:, :, 2]
    )
    directions = U[:, : singular_values.size][:, singular_values > STILL * singular_values[0]]
    momentum = directions.T @ W @ np.append(body.mass * state.velocity, state.momentum)
    return float(momentum @ momentum / 2)


def _excess_energy(
    body: FreeBody, state: State, W: Array, ongoing: dict[int, OngoingContact], setting: Setting
) -> float:
    """Elastic energy [J] of the contacts above that of their static state under the weight.

    For one contact with force F and approach d it is (F - m g)^2 d/F: twice the energy for a linear
    law, and no less than the energy for a force that grows faster than the approach.
    """
    ongoing = {i: h for i, h in ongoing.items() if h.force[0] > 0}
    if not ongoing:
        return 0.0
    points = list(ongoing)
    arms = state.arms(body, points)
    approaches = np.diag([-h.height / h.force[0] for h in ongoing.values()])
    if setting.floor.ground is not None:
        approaches = approaches + setting.floor.ground.compliance
    forces = np.array([AXES[: h.force.size].T @ h.force for h in ongoing.values()])
    wrench = np.append(forces.sum(axis=0), np.cross(arms, forces).sum(axis=0))
    wrench[2] -= body.mass * setting.gravity
    vertical = W[:, 2:3] + W[:, 3:] @ np.cross(arms, AXES[0]).T
    # up ways^-1 up' is the stiffness against rigid motions
    root = np.linalg.cholesky(np.linalg.inv(approaches))
    impulses = np.linalg.lstsq(vertical @ root, W @ wrench, rcond=STILL)[0]
    return float(impulses @ impulses)


def _vibration_energy(
    body: FreeBody, state: State, ongoing: dict[int, OngoingContact], setting: Setting
) -> float:
    """Kinetic energy [J] that the body has at the speed of the floor's vibration."""
    ground = setting.floor.ground
    if ground is None:
        return 0.0
    speed = ground.speed(state.floor, sum(float(h.force[0]) for h in ongoing.values()))
    return 0.5 * body.mass * speed**2


def _contains_origin(points: Array, close: float) -> bool:
    """Whether the hull of points (n, 2) contains the origin, up to a distance `close`."""
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    if np.linalg.norm(points, axis=1).min() <= close:
        return True
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    return bool(gaps.max(initial=2 * np.pi if len(points) < 2 else 0.0) <= np.pi + 1e-9)


@dataclass(frozen=True, eq=False)
class FallImpact:
    """One impact: contacts that follow within the longest modal period or the first's duration.

    Attributes
    ----------
    time : time of the first touch [s]; contact_time : from there to the last release [s].
    touches : number of times that the part touches in the contact time, with flights in between.
    hardest_touch : duration [s] of the touch with the largest force.
    place : (3,) point that takes the largest impulse, in the axes of the mesh [m].
    contacts : number of points that touched.
    peak_force : largest sum of the normal forces [N]; impulse : sum of the normal impulses [N s].
    speed_before, speed_after : speeds of that point along the normal [m/s], > 0 toward the floor
        before and away from it after, without vibrations.
    spin_before, spin_after : (3,) spins in the axes of the floor [rad/s].
    lost : energy dissipated by contacts and damping [J].
    law_error : relative error of the largest force at a point by its contact law, and by the
        surface beside it; None: unknown.
    """

    time: float
    contact_time: float
    touches: int
    hardest_touch: float
    place: Array
    contacts: int
    peak_force: float
    impulse: float
    speed_before: float
    speed_after: float
    spin_before: Array
    spin_after: Array
    lost: float
    law_error: float | None

    @property
    def contact_time_note(self) -> str:
        """What the contact time is of, where the part touches several times; "" of once."""
        if self.touches < 2:
            return ""
        return f"{OF_ALL_CONTACTS}; the hardest touch takes {engineering(self.hardest_touch, 's')}"


#: Scalars of an impact, and their units.
UNITS = (
    ("time", "s"), ("peak_force", "N"), ("impulse", "N s"), ("contact_time", "s"),
    ("speed_before", "m/s"), ("speed_after", "m/s"), ("lost", "J"),
)  # fmt: skip


class Impacts(tuple[FallImpact, ...]):
    """The impacts of a fall; its text is a table."""

    def column(self, name: str) -> Array:
        """One quantity of all impacts: (n,) or (n, 3); NaN where it is unknown."""
        values = (getattr(impact, name) for impact in self)
        return np.array([np.nan if value is None else value for value in values])

    def columns(self) -> dict[str, Array]:
        """Name with unit -> (n,) values."""
        place = self.column("place").reshape(-1, 3)
        table = {f"{name.replace('_', ' ')} ({unit})": self.column(name) for name, unit in UNITS}
        table["touches"] = self.column("touches")
        table |= {f"place {axis} (m)": place[:, k] for k, axis in enumerate("xyz")}
        for name in ("spin_before", "spin_after"):
            spin = self.column(name).reshape(-1, 3)
            table[f"{name.replace('_', ' ')} (rad/s)"] = np.linalg.norm(spin, axis=1)
        return table | {"law error (%)": 100 * self.column("law_error")}

    def numbers(self) -> dict[str, object]:
        """The table as JSON values: name with unit -> values of all impacts, None where unknown."""
        columns = {name: values.tolist() for name, values in self.columns().items()}
        return {name: [None if v != v else v for v in values] for name, values in columns.items()}

    @property
    def touch_again(self) -> bool:
        """Whether the part touches several times in an impact."""
        return any(impact.touches > 1 for impact in self)

    def __str__(self) -> str:
        names = (
            *("no.", "time", "place", "peak", "± law", "impulse", "contact", "touches"),
            *("speed before", "speed after", "spin after", "lost"),
        )
        units = ("", "s", "m", "N", "", "N s", "s", "", "m/s", "m/s", "rad/s", "J")
        rows: list[tuple[str, ...]] = [names, units]
        for k, impact in enumerate(self):
            by_law = "–" if impact.law_error is None else percent(impact.law_error)
            spin = np.linalg.norm(impact.spin_after)
            values = (impact.speed_before, impact.speed_after, spin)
            rows.append((
                f"{k + 1}", f"{impact.time:.5f}", ", ".join(f"{c:.3g}" for c in impact.place),
                f"{impact.peak_force:.4g}", by_law,
                f"{impact.impulse:.4g}", f"{impact.contact_time:.4g}", f"{impact.touches}",
                *(f"{value:.4g}" for value in values), f"{impact.lost:.3g}",
            ))  # fmt: skip
        columns = list(zip(*rows, strict=True))
        if not self.touch_again:
            del columns[names.index("touches")]
        aligned = [[cell.rjust(max(map(len, column))) for cell in column] for column in columns]
        lines = ["  ".join(row) for row in zip(*aligned, strict=True)]
        if self.touch_again:
            lines.append(f"contact: {OF_ALL_CONTACTS}")
        return "\n".join(lines)


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


def impact_of(body: FreeBody, setting: Setting, episodes: Sequence[Episode]) -> FallImpact:
    """The impact that consists of the given episodes."""
    by_law = law_error(body, setting.floor, episodes)
    impulses: dict[int, float] = {}
    peak = 0.0
    # a point above its dent begins an episode without force, which counts as flight
    episodes = [current for current in episodes if current.forces()[1].any()] or episodes
    for current in episodes:
        peak = max(peak, current.peak_force())
        for i, value in zip(current.which.tolist(), current.impulses().tolist(), strict=True):
            impulses[i] = impulses.get(i, 0.0) + value
    strongest = max(impulses, key=lambda i: impulses[i])
    body = next(current.body for current in episodes if strongest in current.which)
    first_state = episodes[0].start
    final_state = episodes[-1].end
    energies = [sum(s.energies(body, setting.gravity)) for s in (first_state, final_state)]
    return FallImpact(
        time=first_state.time,
        contact_time=final_state.time - first_state.time,
        touches=_touches(force_of(episodes)[1]),
        hardest_touch=_hardest_touch(*force_of(episodes)),
        place=body.points[strongest] - body.balls[strongest] * first_state.R[2] + body.centre,
        contacts=sum(value > 0 for value in impulses.values()),
        peak_force=peak,
        impulse=sum(impulses.values()),
        speed_before=-_rising(body, first_state, strongest),
        speed_after=_rising(body, final_state, strongest),
        spin_before=first_state.spin(body),
        spin_after=final_state.spin(body),
        lost=energies[0] - energies[1],
        law_error=by_law,
    )


def force_of(episodes: Sequence[Episode]) -> tuple[Array, Array]:
    """Times (n,) [s] since the start of the first episode, and the sum of the normal forces [N]."""
    first = episodes[0].start.time
    records = [(episode.start.time - first, *episode.forces()) for episode in episodes]
    time = np.concatenate([offset + t for offset, t, _ in records])
    return time, np.concatenate([force.sum(axis=1) for _, _, force in records])


def _touches(force: Array) -> int:
    """How many times a force (n,) begins."""
    touching = np.append(False, force > 0)
    return int(np.sum(touching[1:] & ~touching[:-1]))


def _hardest_touch(time: Array, force: Array) -> float:
    """Duration [s] of the touch with the largest of the forces (n,) at these times."""
    top = int(np.argmax(force))
    off = np.flatnonzero(force <= 0)
    before, after = off[off < top], off[off > top]
    first = before[-1] if len(before) else 0
    last = after[0] if len(after) else len(time) - 1
    return float(time[last] - time[first])


def _rising(body: FreeBody, state: State, point: int) -> float:
    """Upward velocity [m/s] of a point of the rigid body."""
    (arm,) = state.arms(body, [point])
    return float((state.velocity + np.cross(state.spin(body), arm))[2])


def contact_yield(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> str:
    """Sentence that a contact yields, with its permanent indentation; "" if not, or if unknown."""
    if floor.layer is not None:
        return ""
    if note := _line_yield(body, floor, episodes):
        return note
    pressures = []
    for current in episodes:
        part = current.body
        for i, force in zip(
            current.which.tolist(), current.forces()[1].max(axis=0).tolist(), strict=True
        ):
            contact = (
                _elastic_contact(part, law_at(part, floor, i), i, force) if force > 0 else None
            )
            pressures += [] if contact is None else [contact]
    points = list(point_contacts(body, floor, episodes))
    dents = {current.dent: current for current in points if current.dent is not None}
    if dents:
        worst = max(dents, key=lambda dent: dent.depth)
        deepest = dents[worst]
        side = deepest.side(body, floor)
        text = f"the contact yields: {worst.text}, in {side}{_crushed(deepest)}"
        if len({point.which for point in points}) > 1:
            own = engineering(deepest.force, "N")
            text += f" (the dent of one of the places that touch, under {own} of the force)"
        bar = law_error(body, floor, episodes)
        note = unknown_error(body, floor, episodes) or _law_error(deepest, body, floor, bar)
        return f"{text}; {note}"
    if pressures:
        return max(pressures, key=lambda current: current.share).warning()
    return ""


def deepest_dent(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> float:
    """Depth of the deepest dent [m]; NaN without one, and where it is not known."""
    if floor.layer is not None or _line_yield(body, floor, episodes):
        return nan
    dents = (contact.dent for contact in point_contacts(body, floor, episodes))
    return max((dent.depth for dent in dents if dent is not None), default=nan)


def _crushed(contact: PointContact) -> str:
    """What it means that a dent is larger than the corner that makes it; "" if it is smaller."""
    dent = contact.dent
    if dent is None or max(dent.depth, dent.radius or 0.0) < contact.radius_of_surface:
        return ""
    radius = engineering(contact.radius_of_surface, "m")
    sharp = contact.radius_of_surface == contact.part.corner
    whose = f"the corner's radius of {radius}" if sharp else f"the mesh's radius there, {radius}"
    return f", wider than twice {whose}: the corner is crushed, with what is behind it"


def _line_yield(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> str:
    """Sentence that a contact along a line yields; "" if none does."""
    for current in episodes:
        for line, forces in current.strongest().items():
            if note := yielding(body, floor, line, float(forces.sum())):
                return note
    return ""


def yielding_zones(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> list[YieldingZone]:
    """The zones about the points that yield, in the axes of the mesh.

    The result is empty if a line yields, since the extent of its zone is not known.
    """
    if floor.layer is not None or _line_yield(body, floor, episodes):
        return []
    contacts = point_contacts(body, floor, episodes)
    return [contact.zone(body) for contact in contacts if contact.yields(body)]


class PointContact(NamedTuple):
    """A contact at a point and its largest force.

    It has a place (3,) in the axes of the mesh [m], a law, a relative curvature [1/m], a largest
    force [N] and indentation [m], a duration [s], a dent if it yielded, the body that touches, and
    the ball as which a sharp vertex does.
    """

    which: int
    place: Array
    law: ElasticPlastic | Hertz | Gonthier
    curvature: float
    force: float
    depth: float
    contact_time: float
    dent: Dent | None
    part: FreeBody
    blunt: Blunt | None

    def yields(self, body: FreeBody) -> bool:
        """Whether it yields, by its law or by the pressure of its elastic law."""
        elastic = _elastic_contact(self.part, self.law, self.which, self.force)
        return self.dent is not None or (elastic is not None and elastic.share > 1)

    @property
    def radius(self) -> float:
        """Radius [m] of the contact at its largest indentation."""
        if isinstance(self.law, ElasticPlastic):
            return rim_radius(self.law, self.depth)
        return sqrt(self.depth / self.curvature)

    @property
    def radius_of_surface(self) -> float:
        """Radius [m] of the undeformed surface: of a flattened corner not that of its ball."""
        if self.blunt is not None:
            return float(self.blunt.corner.law.radius)
        return 1 / self.curvature

    def zone(self, body: FreeBody) -> YieldingZone:
        """The zone outside the margin, in the axes of the mesh."""
        nu = float(body.materials[self.which][1])
        return YieldingZone(self.place, None, (self.radius, 0.0), self.force, nu)

    def side(self, body: FreeBody, floor: Floor) -> str:
        """The side whose strength a law that yields has, with its material if that has a name."""
        assert isinstance(self.law, ElasticPlastic)
        strength = self.law.yield_strength
        sides = (("part", body.matters), ("floor", (floor.face.matter,)))
        names = {
            name: next((m.name for m in matters if m.yield_strength == strength), None)
            for name, matters in sides
        }
        weaker = [
            f"the {side}" + (f" ({name})" if name else "")
            for side, name in names.items()
            if name is not None
        ]
        return " and ".join(weaker) or "the part"

    def error(self, body: FreeBody, floor: Floor) -> float | None:
        """Relative error of the force by its law; None if unknown."""
        if self.blunt is not None:
            return hypot(*self.shares(floor).values())
        return error_of_peak(self.choice(body, floor), self.force, self.contact_time)

    def choice(self, body: FreeBody, floor: Floor) -> Choice:
        """The law with what its error depends on."""
        return Choice(
            self.law,
            "",
            self._soft(floor),
            _unknown(body, floor, self.which),
            curvature=self.curvature,
            soft_ball=bool(body.materials[self.which][0] <= floor.face.matter.E),
        )

    def shares(self, floor: Floor) -> dict[str, float]:
        """Relative errors of the force of a sharp vertex by their causes; {} of other contacts."""
        soft = self._soft(floor)
        if self.blunt is None or soft is None or not isinstance(self.law, ElasticPlastic):
            return {}
        rate = mean_strain_rate(self.law, self.depth, self.contact_time)
        strengths = soft.strengths_at(rate)
        return self.blunt.corner.shares(self.law, self.depth, strengths, self.part.assumed)

    def _soft(self, floor: Floor) -> Matter | None:
        """The side that yields by a law that does."""
        if not isinstance(self.law, ElasticPlastic):
            return None
        strength = self.law.yield_strength
        matters = (*self.part.matters, floor.face.matter)
        soft = next((m for m in matters if m.yield_strength == strength), None)
        return soft or Matter(self.law.modulus, yield_strength=strength)


def point_contacts(
    body: FreeBody, floor: Floor, episodes: Sequence[Episode]
) -> Iterator[PointContact]:
    """Yields the contacts at points whose law follows from both surfaces."""
    for current in episodes:
        peaks = current.forces()[1].max(axis=0).tolist()
        depths = current.sunk().tolist()
        arms = current.start.arms(body, current.which)
        for k, (i, force) in enumerate(zip(current.which.tolist(), peaks, strict=True)):
            law = law_at(current.body, floor, i)
            history = current.history.contact_histories[k]
            if not isinstance(law, ElasticPlastic | Hertz | Gonthier) or not history.contacts:
                continue
            if (
                depths[k] <= 0
            ):  # it touches after the end of the episode, up to which its run goes on
                continue
            yields = isinstance(law, ElasticPlastic) and force > law.yield_force
            dent = history.dent if yields else None
            start, end = max(history.contacts, key=lambda span: span[1] - span[0])
            curvature = 1 / float(current.body.radii[i].min())
            place = body.centre + arms[k] @ current.start.R
            blunt = current.body.blunt.get(i)
            yield PointContact(
                i, place, law, curvature, force, depths[k], end - start, dent, current.body, blunt
            )


def largest_contact(
    body: FreeBody, floor: Floor, episodes: Sequence[Episode]
) -> PointContact | None:
    """The contact at a point with the largest force, if its law follows from materials."""
    if floor.law is not None or floor.layer is not None:
        return None
    contacts = point_contacts(body, floor, episodes)
    return max(contacts, key=lambda contact: contact.force, default=None)


#: Share of the largest force from which on a contact whose error is unknown leaves the bar unknown:
#: the bar of a smaller one adds a tenth at most.
COUNTS = 0.1


def law_error(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> float | None:
    """Relative error of the largest force of a contact by its law; None if unknown.

    Contacts with a smaller force count with the share that their error has of the largest force.
    """
    if floor.law is not None:
        return None
    errors = [pair for current in episodes for pair in _errors(body, floor, current)]
    largest = max((force for _, force in errors), default=0.0)
    if not largest or any(e is None for e, force in errors if force >= COUNTS * largest):
        return None
    return max((error or 0.0) * force for error, force in errors) / largest


def error_shares(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> dict[str, float]:
    """The shares of `law_error` by their causes, if a sharp vertex decides it; else {}."""
    if floor.law is not None or floor.layer is not None:
        return {}
    contacts = [one for current in episodes for one in _with_beside(body, floor, current)]
    if not contacts:
        return {}
    contact, beside, between = max(
        contacts, key=lambda one: one[0].force * (_bar(body, floor, *one) or 0.0)
    )
    shares = contact.shares(floor)
    if not shares:
        return {}
    scale = contact.force / max(one.force for one, *_ in contacts)
    shares |= {BETWEEN: between, BESIDE: beside}
    return {cause: scale * share for cause, share in shares.items()}


def unknown_error(body: FreeBody, floor: Floor, episodes: Sequence[Episode]) -> str:
    """Why `law_error` is unknown, and the remedy; "" if it is known."""
    if law_error(body, floor, episodes) is not None or not episodes:
        return ""
    if floor.law is not None:
        return "the error of a given law of the contact is not known"
    if floor.layer is not None:
        deepest = max(imprint_of(current).depth for current in episodes)
        return (
            f"the layer is pressed in by {engineering(deepest, 'm')}, and is "
            f"{engineering(floor.layer.thickness, 'm')} thick: take a thicker or a stiffer one"
        )
    contacts = list(point_contacts(body, floor, episodes))
    unknown = [contact for contact in contacts if contact.error(body, floor) is None]
    largest = max(unknown, key=lambda contact: contact.force, default=None)
    if largest is None:
        return "the error of that force is not known: give the part a yield strength"
    note = _law_error(largest, body, floor)
    if _unknown(body, floor, largest.which):
        return note
    strain = largest.depth * largest.curvature
    return f"the contact is pressed in by {strain:.2g} of its radius; {note}"


def _errors(body: FreeBody, floor: Floor, current: Episode) -> Iterator[tuple[float | None, float]]:
    """Yields (relative error by the law, largest force [N]) of the contacts of an episode."""
    if floor.layer is not None:
        if peak := current.peak_force():
            yield layer_error(current, floor.layer), peak
        return
    for contact, *more in _with_beside(body, floor, current):
        yield _bar(body, floor, contact, *more), contact.force
    weights = rule()[1]
    for line, forces in current.strongest().items():
        stations = current.which[current.lines[line]] - current.body.stations[line][0]
        carried = float(weights[stations][forces > 0].sum())
        force = float(forces.sum())
        if force > 0:
            yield line_error(current.body, floor, line, force, carried), force


def _bar(
    body: FreeBody, floor: Floor, contact: PointContact, beside: float, between: float
) -> float | None:
    """Relative error of the force of a contact, with what lies beside it and between the points."""
    error = contact.error(body, floor)
    return None if error is None else hypot(error, between) + beside


def _with_beside(
    body: FreeBody, floor: Floor, current: Episode
) -> Iterator[tuple[PointContact, float, float]]:
    """Yields (contact at a point, `share_beside`, `share_between`)."""
    contacts = list(point_contacts(body, floor, [current]))
    beside = share_beside(floor, current) if contacts else 0.0
    between = share_between(current) if contacts else 0.0
    for contact in contacts:
        has_all = contact.which in contact.part.cut and current.rough_line is None
        yield contact, 0.0 if has_all else beside, between


def _unknown(body: FreeBody, floor: Floor, which: int) -> str:
    """Name of the unknown property on which the error of a law depends; empty if all are known."""
    E = float(body.materials[which][0])
    strength_known = body.strengths is not None and np.isfinite(body.strengths[which])
    unknown_names = (
        strength_known
        or np.isnan(E)
        or any(m.known and m.E == E for m in (*body.matters, floor.face.matter))
    )
    if unknown_names and floor.face.matter.known:
        return ""
    return "yield_strength"


def strained(contact: PointContact, body: FreeBody, floor: Floor, bar: float | None) -> str:
    """Sentence on the force of an elastic contact with large strains; "" if it has none.

    `bar`: relative error of the force of its impact; None: unknown.
    """
    if contact.dent is not None or contact.depth * contact.curvature < LEAST_STRAIN:
        return ""
    note = _law_error(contact, body, floor, bar)
    return (
        f"the contact is pressed in by {contact.depth * contact.curvature:.2g} of its radius; "
        f"{note}"
    )


def _law_error(
    contact: PointContact, body: FreeBody, floor: Floor, bar: float | None = None
) -> str:
    """Sentence on the error of a force by its law: the bar of its impact where that is known."""
    if _unknown(body, floor, contact.which):
        return "the error of that force is not known: give part and floor a yield strength"
    error = contact.error(body, floor) if bar is None else bar
    if error is None:
        largest = largest_strain(contact.choice(body, floor))
        return (
            f"the force's error is known up to {largest:g} of it: take a larger corner radius, or a"
            " soft layer on the floor"
        )
    if contact.blunt is not None:
        return f"that force may be off by {percent(error)}"
    cause = (
        "large strains" if contact.dent is None else "the law and the range of the yield strength"
    )
    message = f"by {cause} that force may be off by {percent(error)}"
    if contact.dent is None or contact.depth * contact.curvature < DEEP:
        return message
    return (
        f"{message}, since it is pressed in by {engineering(contact.depth, 'm')} where the "
        "radius is "
        f"{engineering(1 / contact.curvature, 'm')}: a larger corner radius, where corners "
        "are blunter, narrows it"
    )


def _elastic_contact(
    body: FreeBody, law: ContactLaw, which: int, force: float
) -> HertzContact | None:
    """The contact by Hertz's law, if the strength is known; else None."""
    strength = 0.0 if body.strengths is None else float(body.strengths[which])
    stiffness = _stiffness(law)
    radii = tuple(body.radii[which].tolist())
    if not strength > 0 or stiffness is None:
        return None
    with without_warnings():
        modulus = _modulus(stiffness, radii, body.materials[which])
    return HertzContact(stiffness, modulus, force, strength)


def _stiffness(law: ContactLaw) -> float | None:
    """Stiffness k_H [N m^-3/2] of Hertz's law, damped or not; None for other laws."""
    stiffness, exponent = (getattr(law, name, None) for name in ("stiffness", "exponent"))
    if isinstance(law, Hertz) or exponent == 1.5:
        return stiffness
    return None


def _modulus(stiffness: float, radii: tuple[float, float], material: Array) -> float:
    """E* [Pa] of a law on a plane, from the radii; at most that of the part on a rigid floor.

    A given law that is stiffer stands for larger radii.
    """
    flat = relative_curvatures(radii, (np.inf, np.inf), 0.0)
    E, nu = material.tolist()
    return min(stiffness / hertz_stiffness(1.0, *flat), effective_modulus(E, nu, None, None))


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """The flights and the episodes of contact of a body from its start to its end.

    Attributes
    ----------
    body, setting : the falling body, and the conditions of the fall.
    start, end : position, orientation, velocity and spin at the start and at the end.
    episodes, flights : in the order of time.
    groups : for each impact the indices of its episodes.
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
        numbers = range(len(self.groups))
        return Impacts(impact_of(self.body, self.setting, self._episodes(k)) for k in numbers)

    def energy(self) -> tuple[Array, Array]:
        """Times (n,) [s] of all touches and partings, and energies (n, 4) [J] there.

        The columns: rigid motion, vibration, height of the centre, contacts.
        """
        rows = [(self.start, 0.0)]
        for contact in self.episodes:
            rows += [(contact.start, rows[-1][1]), (contact.end, contact.stored)]
        rows.append((self.end, rows[-1][1]))
        gravity = self.setting.gravity
        energies = [(*s.energies(self.body, gravity), stored) for s, stored in rows]
        return np.array([s.time for s, _ in rows]), np.array(energies)

    def _episodes(self, impact: int) -> list[Episode]:
        """The episodes of an impact."""
        if not self.groups:
            raise InputError(NO_IMPACT)
        k = checks.whole("impact", impact, least=0, most=len(self.groups) - 1)
        return [self.episodes[i] for i in self.groups[k]]
