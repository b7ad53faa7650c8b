"""The parts of a scene: bodies, contacts, loads, and the rows that give indentations from motion.

All bodies have one system of axes. A contact between the sites a and b has a direction d: that of
site a, or that of site b if a has none. Its force F >= 0 pushes a along +d and b along -d, and

    delta = (displacement of b - displacement of a) along d - gap.

A body without directions in space (`RigidMass`, `Sphere`, a model made by hand) has one coordinate,
which is its displacement along d: as site b it moves toward a if its velocity is > 0. Its first
contact gives this coordinate the direction d. A later contact along -d takes it with the opposite
sign; a contact along another line is refused. All displacements are relative to the ground;
displacements of a body that is supported at its sites count from its equilibrium under gravity.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, cast

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike
from antiosc.base.checks import Checked, checked_by
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr
from antiosc.engine.contact import ContactLaw
from antiosc.engine.system import consecutive_slices
from antiosc.impact.bodies import PARALLEL_COSINE, Obstacle, RigidBody, SceneBody
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import AUTO, LAW_RULE, checked_body, choice_at_sites, is_auto
from antiosc.models.modal import SiteModes
from antiosc.models.motion import ModalState, Motion


def _checked_contact_law(name: str, law: object) -> object:
    if is_auto(law):
        return law
    return checks.instance(name, law, ContactLaw, LAW_RULE)


@dataclass(frozen=True, eq=False, repr=False)
class Contact(Checked):
    """A contact between two sites, "body" or "body:site".

    Parameters
    ----------
    a, b : str
        The sites; the force pushes a along the direction of its site, and b in the opposite
        direction. If a has no direction (as an obstacle), the force pushes b against b's direction:
        two stops on both sides of a tip are ("tip", "one") and ("other", "tip"). It is not checked
        whether the sites meet.
    law : ContactLaw or "auto"
        Force along the direction of the contact; "auto": as for `simulate`.
    gap : float, optional
        Distance at the start [m], >= 0; default 0, or the obstacle's gap.
    friction : float
        Coulomb's coefficient mu >= 0 of a slider in series with a spring.
    tangential_stiffness : float, optional
        Stiffness k_t [N/m] of this spring; the slider carries at most mu F. Default:
        2 (1 - nu)/(2 - nu) = 0.82 (nu = 0.3, R. D. Mindlin, J. Appl. Mech. 16 (1949) 259-268)
        times the mean normal stiffness of a contact of the expected depth. The compliance of the
        patches is subtracted, as from Hertz's law. Compared with spheres whose contact slips from
        its edge inward (N. Maw et al., Wear 38 (1976) 101-114), the tangential rebound speed
        differs by up to 0.35 mu times the approach speed if the contact sticks at first, and by
        less than 0.1 mu times if it slides at first.
    """

    a: str
    b: str
    law: ContactLaw = field(
        default=cast("ContactLaw", AUTO), metadata=checked_by(_checked_contact_law)
    )
    gap: float | None = field(default=None, metadata=checked_by(checks.nonnegative, "m"))
    friction: float = field(default=0.0, metadata=checked_by(checks.nonnegative))
    tangential_stiffness: float | None = field(
        default=None, metadata=checked_by(checks.positive, "N/m")
    )

    def __post_init__(self) -> None:
        for name in ("a", "b"):
            checks.name(f"end {name}, as 'body' or 'body:site',", getattr(self, name))
        if self.a == self.b:
            raise InputError(f"the ends of a contact must differ; got {self.a!r} twice.")
        super().__post_init__()


@dataclass(frozen=True, eq=False, repr=False)
class Load(FieldsRepr):
    """A force history at a site, along the direction of the site or the body's one coordinate.

    Parameters
    ----------
    end : str
        "body" or "body:site".
    times, forces : array_like, shape (K,)
        Ascending times [s] and forces [N]; linear in between, constant before and after.
    """

    end: str
    times: Array
    forces: Array

    def __post_init__(self) -> None:
        checks.name("end, as 'body' or 'body:site',", self.end)
        times, forces = _checked_series(f"load on {self.end!r}", self.times, self.forces)
        checks.store(self, times=times, forces=checks.floats("forces", forces, (times.size,)))


@dataclass(frozen=True, eq=False, repr=False)
class Base(FieldsRepr):
    """Acceleration of the ground and of all supports and obstacles.

    Parameters
    ----------
    times : array_like, shape (K,)
        Ascending times [s].
    accelerations : array_like, shape (K,) or (K, 3)
        Accelerations [m/s^2], along the direction of the contacts or in the axes of the scene;
        linear in between, constant before and after.

    Notes
    -----
    All motion of the scene is relative to the ground: -acceleration acts as a time-dependent
    gravity on every body, on supported bodies in all their modes.
    """

    times: Array
    accelerations: Array

    def __post_init__(self) -> None:
        times, values = _checked_series("base", self.times, self.accelerations)
        shape = (times.size,) if values.ndim == 1 else (times.size, 3)
        values = checks.floats("accelerations", values, shape)
        checks.store(self, times=times, accelerations=values)


def _checked_series(name: str, times: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    t = checks.nonempty(f"times of {name}", times)
    if np.any(np.diff(t) < checks.MIN_MAGNITUDE):
        raise InputError(f"the times of {name} must ascend.")
    return t, checks.floats(f"values of {name}", values, None)


#: Most bodies, and most contacts: a chain of 800 masses took 6 s of the processor and 0.8 GB.
MAX_PARTS = 1000


@dataclass(frozen=True, init=False, eq=False, repr=False)
class SceneParts(FieldsRepr):
    """The checked bodies, contacts and loads of a `Scene`."""

    bodies: Mapping[str, object]
    contacts: Sequence[Contact]
    gravity: float | Sequence[float] = 0.0  # [m/s^2] along the contacts, or a vector (3,)
    loads: Sequence[Load] = ()
    base: Base | None = None
    #: initial motion; a number is the velocity [m/s] of the body's one coordinate
    motion: Mapping[str, Motion | ModalState | float] = field(default_factory=dict)
    preload: bool = False  # whether it starts from static equilibrium under gravity and loads

    def __post_init__(self) -> None:
        for name in ("bodies", "motion"):
            value = getattr(self, name)
            checks.instance(name, value, Mapping, "a dict with the names of bodies")
            checks.store(self, **{name: dict(value)})

        for name, kind in (("contacts", Contact), ("loads", Load)):
            value = getattr(self, name)
            checks.instance(name, value, (list, tuple), f"a list of {kind.__name__} objects")
            for entry in value:
                checks.instance(name, entry, kind, f"{kind.__name__} objects")
            checks.store(self, **{name: tuple(value)})

        checks.flag("preload", self.preload)
        for name, body in self.bodies.items():
            if ":" in checks.name("a body's name", name):
                raise InputError(f"a body's name is a text without ':'; got {name!r}.")
            has_sites = isinstance(body, AntiOscillators) and len(body.sites) > 0
            if not has_sites and not isinstance(body, RigidBody | SiteModes):
                checked_body(f"body {name!r}", body)

        for name, motion in self.motion.items():
            if not isinstance(motion, Motion | ModalState):
                checks.number(f"motion of {name!r}, if no Motion,", motion, "m/s")
            elif self.preload and isinstance(motion, ModalState) and motion.displacements.any():
                raise InputError(
                    f"motion gives {name!r} displacements, and preload starts from those of the"
                    " equilibrium: leave out preload, or give velocities alone."
                )

        if not self.contacts:
            raise InputError("a scene needs at least one Contact.")

        if (number := max(len(self.bodies), len(self.contacts))) > MAX_PARTS:
            raise InputError(
                f"a scene has at most {MAX_PARTS} bodies and contacts; got {number}: leave out what"
                " the blow does not reach."
            )

        if self.base is not None:
            checks.instance("base", self.base, Base, "a Base")

        if isinstance(self.gravity, Sequence | np.ndarray):
            vector = checks.floats("gravity", self.gravity, (3,))
            checks.store(self, gravity=tuple(vector.tolist()))
        else:
            checks.store(self, gravity=checks.number("gravity", self.gravity, "m/s^2"))

        self._check_pairs()
        checks.store(self, contacts=tuple(map(self._with_law, self.contacts)))
        unknown = set(self.motion) - set(self.bodies)
        if unknown:
            raise InputError(
                f"motion names the bodies {sorted(unknown)}, which are not in the scene:"
                f" {', '.join(self.bodies)}."
            )

    def _check_pairs(self) -> None:
        """InputError for two contacts between the same two sites, in either order."""
        contacts_by_ends: dict[frozenset[str], Contact] = {}
        for contact in self.contacts:
            ends = frozenset(self._site_of(end) for end in (contact.a, contact.b))
            if len(ends) == 1:
                raise InputError(
                    f"the contact {contact.a!r}, {contact.b!r} joins a site to itself; name two."
                )
            first = contacts_by_ends.setdefault(ends, contact)
            if first is not contact:
                raise InputError(
                    f"the contacts {first.a!r}, {first.b!r} and {contact.a!r}, {contact.b!r} have"
                    " the same ends: a stop on the other side is another body or site."
                )

    def _with_law(self, contact: Contact) -> Contact:
        """The contact with its law; for "auto", the law chosen by its surfaces."""
        if not is_auto(contact.law):
            return contact
        ends = [end.partition(":") for end in (contact.a, contact.b)]
        first, second = (self.bodies.get(name) for name, _, _ in ends)
        if first is None or second is None:
            return contact  # which is refused when the scene is assembled

        try:
            return replace(
                contact, law=choice_at_sites(first, second, (ends[0][2], ends[1][2])).law
            )
        except InputError as error:
            raise InputError(f"contact {contact.a!r}, {contact.b!r}: {error}") from None

    def _site_of(self, end: str) -> str:
        """Normal form of a site name: "body" for a body with one site, else "body:site"."""
        name = end.partition(":")[0]
        if len(getattr(self.bodies.get(name), "sites", ())) > 1:
            return end
        return name


def two_body_parts(
    model: object, impactor: object, law: ContactLaw, gap: float, gravity: float | Sequence[float]
) -> SceneParts:
    """The scene of `simulate`, "structure" and "impactor", from checked arguments."""
    parts = SceneParts.__new__(SceneParts)
    contact = Contact.__new__(Contact)
    bodies = {"structure": model, "impactor": impactor}
    vars(contact).update(a="structure", b="impactor", law=law, gap=gap)
    vars(parts).update(bodies=bodies, contacts=(contact,), gravity=gravity, motion={})
    return parts


class StackedBodies(NamedTuple):
    """Modes of all bodies of a scene and directions ("columns") of their sites, side by side."""

    spans: dict[str, slice]  # of the modes of each body
    columns: dict[str, slice]  # of the columns of each body
    B: Array  # (J, P) displacements of all columns
    r: Array  # (P, P) their residual compliance [m/N]
    #: omega, decay, q, v: (J,) [rad/s], [1/s], modal displacements and velocities at the start
    omega: Array
    decay: Array
    q: Array
    v: Array


def stacked_bodies(bodies: Mapping[str, SceneBody]) -> StackedBodies:
    """Put the modes of all bodies and the directions of their sites side by side."""
    modes = consecutive_slices([body.omega.size for body in bodies.values()])
    sites = consecutive_slices([body.modes.B.shape[1] for body in bodies.values()])
    spans, columns = (dict(zip(bodies, slices, strict=True)) for slices in (modes, sites))
    size, total = modes[-1].stop, sites[-1].stop
    B = np.zeros((size, total))
    r = np.zeros((total, total))
    omega, decay, q, v = np.zeros((4, size))
    for name, body in bodies.items():
        span = spans[name]
        B[span, columns[name]] = body.modes.B
        r[columns[name], columns[name]] = body.modes.R
        omega[span] = body.omega
        decay[span] = body.decay
        v[span] = body.start_velocities
        if body.initial_displacements is not None:
            q[span] = body.initial_displacements

    return StackedBodies(spans, columns, B, r, omega, decay, q, v)


ContactEnd = tuple[SceneBody, str]  # a body and the name of its site


def find_site(end: str, bodies: dict[str, SceneBody]) -> tuple[SceneBody, str]:
    """The body and the site that a name "body" or "body:site" denotes."""
    name, _, site = end.partition(":")
    if name not in bodies:
        raise InputError(f"there is no body {name!r} in the scene; it has {', '.join(bodies)}.")

    body = bodies[name]
    if isinstance(body.body, Obstacle):
        return body, ""
    if not site and len(body.sites) == 1:
        site = next(iter(body.sites))
    if site in body.sites:
        return body, site
    if body.sites == {"": (0,)}:  # one site: its name is free
        return body, ""

    site_names = ", ".join(f"{name}:{s}" for s in body.sites)
    raise InputError(f"{end!r} names no site of the body {name!r}; it has {site_names}.")


def set_axes(
    ends: Sequence[tuple[ContactEnd, ContactEnd]], bodies: Mapping[str, SceneBody]
) -> None:
    """Give sites without a direction (`SceneBody.site_axes`) the direction of their contacts."""
    open_ends = [
        [(body.name, at) for body, at in pair if body.sites[at] and body.modes.axes is None]
        for pair in ends
    ]
    links = [pair for pair in open_ends if len(pair) == 2]
    for pair, linked_ends in zip(ends, open_ends, strict=True):
        direction = contact_direction(*pair)
        while direction is not None and linked_ends:
            name, at = linked_ends.pop()
            if at not in bodies[name].site_axes:
                bodies[name].site_axes[at] = direction
                linked_ends += [linked for link in links if (name, at) in link for linked in link]


def site_row(body: SceneBody, site: str, direction: Array | None, end: str) -> Array:
    """Weights (P,) of a body's columns in a site's displacement along `direction` or its own."""
    row = np.zeros(body.modes.B.shape[1])
    columns = list(body.sites[site])
    if not columns:
        return row
    axes = body.site_directions(site)
    if direction is None or axes is None or (len(axes) == 1 and (axes[0] == direction).all()):
        row[columns[0]] = 1.0
        return row

    parts, *_ = np.linalg.lstsq(axes.T, direction, rcond=None)
    direction_sum = axes.T @ parts
    if np.linalg.norm(
        direction_sum
    ) < PARALLEL_COSINE or direction_sum @ direction < PARALLEL_COSINE * np.linalg.norm(
        direction_sum
    ):
        raise InputError(
            f"the contact at {end!r} is along {np.round(direction, 4).tolist()}, but this end moves"
            f" only along {np.round(axes, 4).tolist()}: extract it along the contact, or take a"
            " RigidBody for a body of one coordinate."
        )

    row[columns[: len(axes)]] = parts
    return row


def contact_direction(a: ContactEnd, b: ContactEnd) -> Array | None:
    """Direction (3,) of a contact in space; None if neither site has a direction."""
    return a[0].push_directions.get(a[1], b[0].push_directions.get(b[1]))


def relative_row(
    contact: Contact,
    ends: tuple[ContactEnd, ContactEnd],
    direction: Array | None,
    stacked: StackedBodies,
) -> Array:
    """Weights (P,) of all columns in the displacement of site b relative to site a."""
    row = np.zeros(len(stacked.r))
    a, b = ends
    for (body, site), sign, end in ((b, 1, contact.b), (a, -1, contact.a)):
        row[stacked.columns[body.name]] += sign * site_row(body, site, direction, end)
    return row


def tangential_rows(
    contact: Contact,
    ends: tuple[ContactEnd, ContactEnd],
    direction: Array | None,
    stacked: StackedBodies,
) -> list[Array]:
    """One or two rows (P,), as `relative_row`, for tangential displacement of site b."""
    movable_ends = [(body, site) for body, site in ends if body.sites[site]]
    if direction is None or any(body.modes.axes is None for body, _ in movable_ends):
        raise InputError(
            f"friction between {contact.a!r} and {contact.b!r} needs ends that move along the"
            f" surface too: a RigidBody, or a model with a tangential site."
        )

    across: list[Array] = []
    for body, site in movable_ends:
        axes = body.modes.axes
        assert axes is not None
        for i in body.sites[site]:
            side = axes[i] - (axes[i] @ direction) * direction
            for row in across:
                side = side - (side @ row) * row
            if np.linalg.norm(side) > 0.5:
                across.append(side / np.linalg.norm(side))

    rows = [relative_row(contact, ends, side, stacked) for side in across[:2]]
    if not rows:
        raise InputError(
            f"friction between {contact.a!r} and {contact.b!r} needs a site with tangential"
            f" directions: extract it with a tangential site."
        )

    return rows


def _motion_axis(body: SceneBody) -> Array | None:
    """Direction in space of a body with one coordinate; None for other bodies."""
    if body.modes.axes is not None and len(body.modes.axes):
        if body.inertia is None:
            return body.modes.axes[0]
        return None
    return next(iter(body.site_axes.values()), None)


def external_forces(
    loads: Sequence[Load], bodies: dict[str, SceneBody], stacked: StackedBodies, t: Array
) -> Array:
    """External forces (n, P) [N] along all P site directions at times (n,) [s]."""
    total = np.zeros((t.size, len(stacked.r)))
    for load in loads:
        body, site = find_site(load.end, bodies)
        if isinstance(body.body, Obstacle):
            raise InputError(f"the load on {load.end!r} acts on an obstacle, which does not move.")
        row = site_row(body, site, body.push_directions.get(site), load.end)
        value = np.interp(t, load.times, load.forces)
        total[:, stacked.columns[body.name]] += value[:, None] * row

    return total


def load_series(
    scene: SceneParts,
    bodies: dict[str, SceneBody],
    stacked: StackedBodies,
    G: Array,
    gaps: Array,
    duration: float,
) -> tuple[Array, Array, Array]:
    """Times (K,), modal loads (K, J) and gaps (K, m) due to loads, base motion and gravity."""
    if not scene.loads and scene.base is None and not np.any(scene.gravity):
        return np.zeros(1), np.zeros((1, len(stacked.B))), gaps[None]
    series = [load.times for load in scene.loads]
    if scene.base is not None:
        series.append(scene.base.times)
    inner_times = [t[(t > 0) & (t < duration)] for t in series]
    breaks = np.unique(np.concatenate([np.zeros(1), *inner_times]))
    if len(series) and any(t[-1] >= duration for t in series):
        breaks = np.append(breaks, duration)
    forces = external_forces(scene.loads, bodies, stacked, breaks)
    loads = forces @ stacked.B.T
    gravity = np.asarray(scene.gravity)
    vector = gravity.ndim == 1 or (scene.base is not None and scene.base.accelerations.ndim == 2)

    if np.any(gravity):
        for name, body in bodies.items():
            if (load := gravity_load(body, gravity)) is not None:
                loads[:, stacked.spans[name]] += load

    if scene.base is not None:
        if not any(body.grounded for body in bodies.values()):
            raise InputError(
                "base moves the ground, and no body of the scene stands on it: all are free; leave"
                " base out, or add a support or an Obstacle."
            )
        accelerations = scene.base.accelerations
        accelerations = accelerations if accelerations.ndim == 2 else accelerations[:, None]
        times = scene.base.times
        ground_motion = np.stack(
            [np.interp(breaks, times, column) for column in accelerations.T], 1
        )
        for name, body in bodies.items():
            weights = _unit_loads(body, vector and accelerations.shape[1] == 3)
            if weights.size:
                _check_ground_direction(body, ground_motion)
                loads[:, stacked.spans[name]] -= ground_motion @ weights.T

    return breaks, loads, gaps - forces @ stacked.r @ G.T


def gravity_load(body: SceneBody, gravity: Array | float) -> Array | None:
    """Modal forces (J,) of gravity, only on rigid modes if supported; None without such modes."""
    if not np.any(body.omega == 0):
        return None

    if np.ndim(gravity):
        load = _unit_loads(body, True) @ gravity
    else:
        load = _unit_loads(body, False)[:, 0] * float(gravity)

    return np.where(body.omega == 0, load, 0.0) if body.supported else load


def _check_ground_direction(body: SceneBody, ground_motion: Array) -> None:
    """InputError if the ground (K, 3) moves perpendicular to the only direction of a body."""
    weight = body.modes.weight
    if body.inertia is not None or weight is None or weight.ndim == 2:
        return
    axis = _motion_axis(body)
    if axis is None or ground_motion.shape[1] != 3:
        return
    transverse = np.abs(ground_motion - np.outer(ground_motion @ axis, axis)).max()
    size = np.abs(ground_motion).max()
    if transverse > 1e-6 * size:
        raise InputError(
            f"the ground moves with {transverse:.3g} m/s² across the direction of the site of "
            f"{body.name!r}, the only one that its model knows: extract it with a site that has a "
            "name, or give base along the site's direction."
        )


def _unit_loads(body: SceneBody, vector: bool) -> Array:
    """Modal forces of unit accelerations: (J, 3) along x, y, z if `vector`, else (J, 1)."""
    if isinstance(body.body, Obstacle):
        return np.zeros((0, 3 if vector else 1))
    if vector and body.inertia is not None:
        return body.inertia.momentum[:, :3]

    weight = body.modes.weight
    if weight is not None and weight.ndim == 2:
        if vector:
            return weight
        axes = np.unique(np.round(list(body.push_directions.values()), 9), axis=0)
        if len(axes) == 1:
            return np.asarray(weight @ axes[0])[:, None]
        raise InputError(
            f"{body.name!r} is pushed along several directions: give gravity, or the motion of the "
            "ground, as a vector."
        )

    if weight is None:
        raise InputError(
            f"gravity or the ground's motion on {body.name!r} needs what its motion carries:"
            f" extract the model anew, give its participation or inertia"
            + (", or a vector where the body moves in space." if body.inertia is not None else ".")
        )
    if not vector:
        return weight[:, None]
    axis = _motion_axis(body)
    if axis is None:
        raise InputError(
            f"gravity as a vector needs the direction of {body.name!r}: its contacts must have one"
            f" (an extracted model, a RigidBody); else give gravity as a number."
        )

    return weight[:, None] * axis
