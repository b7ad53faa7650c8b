"""The interface of a body to a simulation, its record `info`, and conversion of foreign bodies.

`ModelInfo` records the origin of a model, its computation, and the data for its error bars.

`LinearBody` is the interface that a user's body must implement; simulations use the interface
`Body`. The bodies of this package are `Body`s; a user's body gets defaults for missing attributes
(`checked_body`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, pi, sqrt
from typing import (
    TYPE_CHECKING,
    Any,
    Literal,
    NamedTuple,
    Protocol,
    TypeAlias,
    TypedDict,
    TypeGuard,
    runtime_checkable,
)

import numpy as np

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.base.texts import CELL_ARGUMENTS, ReprMixin, engineering, point_text
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.curvature import CURVED
from antiosc.engine.contact.surfaces import Surface
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion
from antiosc.models.stretch import Stretch

if TYPE_CHECKING:
    from antiosc.engine.contact.choice import Choice

#: Key of `ModelInfo.surfaces` under which the reason stands if a surface is unknown.
UNKNOWN_SURFACE = "not known"


class MeasuredBodies(TypedDict):
    """Bodies that all fit one measurement, described by free modes (as in `ModalBody`)."""

    top: float  # upper end of the band [rad/s]
    draws: int  # number of the first bodies, which differ by noise, others by modes above the band
    omega: list[list[float]]  # (bodies, modes), as the next two
    decay: list[list[float]]
    b: list[list[float]]
    r: list[float]  # (bodies,)


@dataclass(frozen=True, repr=False)
class ModelInfo(ReprMixin):
    """Data of an extracted model besides its parameters, immutable.

    `info.dofs` and `info["dofs"]` are the same; the latter raises KeyError if the value is unknown,
    and also finds the `notes`.

    Attributes
    ----------
    method : "krylov", "modes", "superposition", "full" or "frf".
    dofs : number of dofs of the structure.
    converged : number of the lowest anti-oscillators that have converged to antiresonances.
    point, direction : place [m] and direction of a site without a name.
    points : places [m] of named sites.
    no_estimate : reason why the mesh error of the part cannot be estimated, if it cannot.
    measured : data of the error bars of a model from measured frequency responses.
    surfaces : site ("" without a name) -> material and curvature as for `Surface.as_dict`, or the
        reason why they are unknown; `contact="auto"` chooses the law by them.
    thickness : least thickness [m] of the sheets, or mean thickness of a thin solid; linear theory
        holds for deflections that are small against it. None for other structures, and for parts
        that are supported along one line only, as a cantilever.
    cells : site ("" without a name) -> (longest edge of the cell there [m]; bar wave speed times
        radius of gyration [m²/s], 0 without bending; bar wave speed [m/s]).
    notes : other data as JSON values: the `structure`, its `doubts`; numbers of modes that were
        computed, unobservable or merged; `seconds` of the steps, the `solver`, the `band` [Hz] with
        its `error_bound`, the `expansion` point [Hz], the meshes of `strike`. On the error
        estimate: whether it is by `divided` cells, and text on what is `not_included`. On the
        `patch`: size of its `faces` [m], whether an edge has `cut` it, `radius` [m] of a second
        patch and its change of `compliance` [m/N]. `second_order`: site of a curved sheet ->
        relative change of the force per metre of displacement [1/m]; < 0: it softens.
    """

    method: str | None = None
    dofs: int | None = None
    converged: int | None = None
    point: Sequence[float] | None = None
    direction: Sequence[float] | None = None
    points: Mapping[str, Sequence[float]] | None = None
    no_estimate: str | None = None
    measured: MeasuredBodies | None = None
    surfaces: Mapping[str, Mapping[str, Any]] | None = None
    thickness: float | None = None
    cells: Mapping[str, Sequence[float]] | None = None
    notes: Mapping[str, object] = field(default_factory=dict)

    @classmethod
    def of(cls, record: ModelInfo | Mapping[str, Any]) -> ModelInfo:
        """`record` as a ModelInfo, or InputError; unknown names of a mapping become `notes`."""
        if isinstance(record, ModelInfo):
            return record
        checks.instance("info", record, Mapping, "a ModelInfo, or a dict of facts")
        known = {name: value for name, value in record.items() if value is not None}
        attributes = {name: known[name] for name in known if name in _ATTRIBUTE_NAMES}
        notes = {name: known[name] for name in known if name not in _ATTRIBUTE_NAMES}
        return cls(**attributes, notes=notes)

    def having(self, **facts: Any) -> ModelInfo:
        """The record with further `facts`; facts that are not attributes go into `notes`."""
        return ModelInfo.of({**self.as_dict(), **facts})

    def __post_init__(self) -> None:
        for name in ("dofs", "converged"):
            if getattr(self, name) is not None:
                count = checks.whole(f"info.{name}", getattr(self, name), least=0)
                checks.store(self, **{name: count})

        for name, (kinds, expected) in _VALUE_TYPES.items():
            if getattr(self, name) is not None:
                checks.instance(f"info.{name}", getattr(self, name), kinds, expected)

        if self.measured is not None:
            for key in MeasuredBodies.__annotations__:
                checks.floats(f"info.measured, {key},", self.measured.get(key), None)

        for site, numbers in (self.cells or {}).items():
            checks.floats(f"info.cells[{site!r}]", numbers, (3,))

    def as_dict(self) -> dict[str, object]:
        """The known data as JSON values."""
        attributes = {name: getattr(self, name) for name in _ATTRIBUTE_NAMES}
        return {n: value for n, value in attributes.items() if value is not None} | dict(self.notes)

    def __getitem__(self, name: str) -> Any:
        return self.as_dict()[name]

    def get(self, name: str, default: object = None) -> Any:
        """`info[name]`, or `default` if it is unknown."""
        return self.as_dict().get(name, default)

    def __contains__(self, name: object) -> bool:
        return name in self.as_dict()


#: Types of the values in a file; with other types a model could fail during a run.
_VALUE_TYPES: dict[str, tuple[tuple[type, ...], str]] = {
    **dict.fromkeys(("method", "no_estimate"), ((str,), "a text")),
    **dict.fromkeys(("points", "surfaces", "cells", "measured"), ((Mapping,), "a dict")),
    "thickness": ((int, float), "a number"),
}
_ATTRIBUTE_NAMES = tuple(
    entry.name for entry in dataclasses.fields(ModelInfo) if entry.name != "notes"
)
#: The record of a body without known data.
UNKNOWN_INFO = ModelInfo()


def info_of(body: object) -> ModelInfo:
    """The record `info` of a body; an empty one if it has none."""
    info = getattr(body, "info", None)
    if isinstance(info, ModelInfo):
        return info
    return UNKNOWN_INFO


def resolved_frequency(source: Any) -> float:
    """Frequency [Hz] up to which a model represents the motion of points far from its site.

    The contact force depends only on the structure's response at its site, for which few
    anti-oscillators are enough. The motion elsewhere depends on every natural mode. The model
    represents the natural modes below its last anti-oscillator that has converged to an
    antiresonance, whose frequency is returned. More anti-oscillators raise this frequency; their
    number must exceed the number of natural modes below it.

    Parameters
    ----------
    source : AntiOscillators, SuperpositionModel, History or BodyHistory
        A model from `extract`, `superposition` or `full`, or the result of an impact on it; for a
        scene `hit.bodies[name]`.

    Returns
    -------
    float
        0.0 if none has converged; inf for a model with all modes of the structure.

    Raises
    ------
    InputError
        A model without these data: made by hand, or read from a file that lacks them.
    """
    model = getattr(source, "model", source)
    scene_body = getattr(source, "placed", None)
    model = model if scene_body is None else scene_body.body
    info = info_of(model)
    if info.converged is None:
        raise InputError(
            "which frequencies a model resolves is known of models that extract, superposition or "
            f"full returned, and of histories of impacts on them; got {checks.shown(source)}."
        )
    if info.method == "full":
        return float("inf")

    omega = np.sort(np.asarray(model.omega, dtype=float))
    count = min(info.converged, omega.size)
    if count:
        return float(omega[count - 1]) / (2 * np.pi)

    return 0.0


@runtime_checkable
class LinearBody(Protocol):
    """The protocol of bodies in an impact: models, impactors and users' own models.

    The `basis` of its `ModalBody` gives the fields of a history. A body may also have `velocity`,
    `gap`, `local_compliance` and `radius` of its patch; they have the same meaning as in `Body`.
    """

    def modal(self) -> ModalBody:
        """The body in free modes, with their displacements at its contact point."""
        ...


class Body:
    """Interface of a linear body for simulations; the defaults describe a structure at rest."""

    #: velocity of an impactor, m/s, > 0 toward the structure; or its `Motion` in space
    velocity: float | Motion = 0.0
    #: distance that the body keeps from the structure at the start, m
    gap: float = 0.0
    #: half-space compliance of its patch, m/N, which its model contains
    local_compliance: float = 0.0
    #: names of several contact points (for a `Scene` only); () for one contact point
    sites: tuple[str, ...] = ()

    @property
    def patch_radius(self) -> float | None:
        """Radius [m] of the patch over which the contact displacement is averaged, None: point."""
        return None

    def surface(self, site: str = "") -> Surface | None:
        """The surface at a site, by which a contact law is chosen; None if unknown."""
        table = (info_of(self).surfaces or {}).get(site) if isinstance(site, str) else None
        return Surface.of(table) if table and UNKNOWN_SURFACE not in table else None

    def modal(self) -> ModalBody:
        """The body in free modes, with their displacements at its contact point."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class ModalModel(Body):
    """A body given by its free modes; `stretch`: second-order forces in these modes."""

    modes: ModalBody
    local_compliance: float = 0.0
    radius: float | None = None  # of its patch [m]
    stretch: Stretch | None = None
    velocity: float | Motion = 0.0
    gap: float = 0.0

    @property
    def patch_radius(self) -> float | None:
        return self.radius

    def modal(self) -> ModalBody:
        return self.modes


def checked_body(name: str, body: object) -> Body:
    """`body` as a `Body` of one contact point, or InputError; a user's body gets defaults."""
    if isinstance(body, Body):
        if body.sites:
            raise InputError(several_sites_message(name, body.sites))
        return body
    if isinstance(body, LinearBody) and not isinstance(body, type) and callable(body.modal):
        return _with_defaults(name, body)

    raise InputError(
        f"{name} must have a modal() method, as the model that extract(part, site) makes, a "
        f"RigidMass and a Sphere have; got {checks.shown(body)}."
    )


def _with_defaults(name: str, body: LinearBody) -> ModalModel:
    """A user's body with checked attributes, and defaults for missing ones."""
    velocity = getattr(body, "velocity", Body.velocity)
    if not isinstance(velocity, Motion):
        velocity = checks.number(f"the velocity of {name}", velocity, "m/s")

    units = {"gap": "m", "local_compliance": "m/N"}
    known: dict[str, Any] = {
        key: checks.nonnegative(f"the {key} of {name}", getattr(body, key, 0.0), unit)
        for key, unit in units.items()
    }
    radius = getattr(body, "radius", None)
    if radius is not None:
        known["radius"] = checks.positive(f"the radius of {name}", radius, "m")
    return ModalModel(body.modal(), velocity=velocity, **known)


def site_points(body: object) -> dict[str, tuple[float, ...]]:
    """Coordinates [m] of an extracted body's sites, by name ("" if it has none)."""
    info = info_of(body)
    points = {"": info.point} if info.points is None else info.points
    return {
        str(name): tuple(point)
        for name, point in points.items()
        if isinstance(point, list | tuple) and all(isinstance(c, int | float) for c in point)
    }


def several_sites_message(name: str, sites: tuple[str, ...]) -> str:
    """Error message: the body `name` has several sites and one is required."""
    return (
        f"{name} has the sites {', '.join(sites)}: pose its impact as a Scene, with ends such as "
        f'"part:{sites[0]}", or extract a model of one site.'
    )


#: A warning is given if the longest edge of a cell over the length of the waves that a contact
#: sends out exceeds this. A contact of the time T sends out waves of the frequency π/T. Bending
#: waves have the length 2π √(c r/ω), c the speed in a bar and r the radius of gyration, others 2π
#: c/ω (L. Cremer, M. Heckl, *Structure-Borne Sound*, 1988). On an aluminium sheet of 1 mm
#: triangles of 0.2, 0.3, 0.5 and 1 wave changed the peak force by up to 2, 4, 47 and 100 %.
LARGE_CELL_WAVES = 0.5
#: Limit of this ratio if cells of half the size are compared: above, both meshes are too stiff.
LARGE_DIVIDED_CELL_WAVES = 1.0
#: Limit for the width of a patch: the error bar held the true force at 0.6 of a wave, not at 0.86.
LARGE_PATCH_WAVES = 0.75


class CoarseLength(NamedTuple):
    """A length at a site [m], and the wavelength [m] that it does not resolve."""

    size: float
    wavelength: float

    @property
    def allowed(self) -> float:
        """Recommended edge length of cells [m]: half of the longest accepted length."""
        return LARGE_CELL_WAVES * self.wavelength / 2


def coarse_cell(model: object, site: str, contact_time: float) -> CoarseLength | None:
    """The cell at a site if it is too long for the waves of a contact of this time [s], or None."""
    info = info_of(model)
    is_estimated = getattr(model, "strain_error", None) is not None
    cell = (info.cells or {}).get(site)
    if cell is None or (is_estimated and not info.get("divided")):  # its budget tells it
        return None

    limit = LARGE_DIVIDED_CELL_WAVES if is_estimated else LARGE_CELL_WAVES

    return _too_long(cell[0], limit, cell, contact_time)


def wide_patch(model: object, site: str, contact_time: float) -> CoarseLength | None:
    """The patch at a site if it is too wide for the bending waves of a contact, or None."""
    cell = (info_of(model).cells or {}).get(site)
    radius = getattr(model, "patch_radius", None)
    if cell is None or radius is None or not cell[1]:
        return None
    return _too_long(2 * radius, LARGE_PATCH_WAVES, cell, contact_time)


def _too_long(
    size: float, limit: float, cell: Sequence[float], contact_time: float
) -> CoarseLength | None:
    """The length `size` [m] if it exceeds `limit` wavelengths of a contact, or None."""
    _, bending, speed = cell
    omega = pi / contact_time
    wave = min(2 * pi * sqrt(bending / omega) if bending else inf, 2 * pi * speed / omega)
    return CoarseLength(size, wave) if size > limit * wave else None


def coarse_cell_warning(model: object, site: str, contact_time: float) -> str:
    """Warning that a cell does not resolve the waves of a contact; "" if it does."""
    cell = coarse_cell(model, site, contact_time)
    if cell is None:
        return ""

    place = f"the site {site!r}" if site else "the site"
    return (
        f"The cell at {place} measures {engineering(cell.size, 'm')}, and the wave that a"
        f" contact of {engineering(contact_time, 's')} sends out"
        f" {engineering(cell.wavelength, 'm')}: forces come out too large; take cells of at most"
        f" {engineering(cell.allowed, 'm')} there ({CELL_ARGUMENTS})."
    )


#: Reasons why a site of a map is doubtful.
CUT_PATCH = "an edge cuts the patch"
NEAR_SUPPORT = "a support is within two radii of the patch"
EDGE_STRUCK = "an edge or a corner is struck"
NARROW_HOLLOW = "a hollow is too narrow for the striker"
PIERCED_PART = "the striker pierces the part elsewhere"
NO_RESULT = "the impact has no result"
BEYOND_WALL = "the force exceeds that on a wall"
#: Reason -> advice that leaves fewer doubtful sites.
REMEDIES = {
    CUT_PATCH: "take a smaller radius of the patch, on cells not larger than it"
    f" ({CELL_ARGUMENTS})",
    NEAR_SUPPORT: "hold the part elsewhere, or map another face",
    EDGE_STRUCK: "map one face (where)",
    NARROW_HOLLOW: "take a smaller striker",
    PIERCED_PART: "take a smaller striker",
    BEYOND_WALL: f"take cells smaller than the radius of the patch ({CELL_ARGUMENTS})",
}


#: The value of `contact` for which the law is chosen.
AUTO: Literal["auto"] = "auto"
#: A law, or "auto".
AnyLaw: TypeAlias = ContactLaw | Literal["auto"]
LAW_RULE = 'a ContactLaw such as Hertz(stiffness), or "auto"'


def is_auto(contact: object) -> TypeGuard[Literal["auto"]]:
    """Whether a contact is the text "auto"; safe for arrays, which cannot be compared with it."""
    return isinstance(contact, str) and contact == AUTO


def choice_at_sites(first: object, second: object, sites: tuple[str, str] = ("", "")) -> Choice:
    """The contact law chosen by the surfaces of two bodies; InputError if one is unknown."""
    from antiosc.engine.contact.choice import choose_law  # loaded where it is used

    return choose_law(_surface(first, sites[0]), _surface(second, sites[1]))


def piercing_warning(first: object, second: object, sites: tuple[str, str] = ("", "")) -> str:
    """Warning if a round striker also touches the part beside its site; otherwise ""."""
    bodies = first, second
    surfaces = [
        body.surface(site) if isinstance(body, Body) else None
        for body, site in zip(bodies, sites, strict=True)
    ]
    for k in (0, 1):
        part, striker = surfaces[k], surfaces[1 - k]
        if part is None or striker is None or info_of(bodies[1 - k]).surfaces is not None:
            continue
        touched = second_contact_of(part, striker)
        if touched:
            return (
                f"The striker, round with a radius of {engineering(1 / striker.curvatures[0], 'm')}"
                f", pierces the part at {point_text(touched)} as it touches the site: the largest"
                f" that touches there alone has {engineering(part.largest_ball, 'm')}; take a"
                " smaller radius or another site."
            )

    return ""


def second_contact_of(part: Surface, striker: Surface) -> tuple[float, float, float] | None:
    """Point of the part beside the site that a round striker touches; None if there is none."""
    low, high = striker.curvatures
    round_tip = striker.kind == CURVED and low == high and low > 0
    if round_tip and 1 / low > part.largest_ball:
        return part.meets
    return None


def _surface(body: object, site: str) -> Surface:
    """The surface of a body at a site; InputError if it is unknown."""
    linear_body = body if isinstance(body, Body) else checked_body("a body in contact", body)
    surface = linear_body.surface(site)
    if surface is None:
        known = (info_of(linear_body).surfaces or {}).get(site, {})
        reason = known.get(UNKNOWN_SURFACE, "")
        if reason:
            raise InputError(
                'the contact "auto" finds no law, give one, such as Hertz: nothing is known of '
                f"the surface of the {type(body).__name__}, for {reason}"
            )
        raise InputError(
            f'the contact "auto" needs the material and the curvature of both surfaces, and '
            f"those of the {type(body).__name__} are not known: extract it from a mesh, give "
            "the model its material (with_surface, or [surface] of a scene), the striker a"
            " material and a tip_radius, or give the law, such as Hertz."
        )

    return surface


def law_of(contact: object, first: object, second: object) -> ContactLaw:
    """`contact` itself; for "auto" the law chosen by the surfaces of the two bodies."""
    if is_auto(contact):
        return choice_at_sites(first, second).law
    return checks.instance("contact", contact, ContactLaw, LAW_RULE)


def choice_of(law: ContactLaw, first: object, second: object) -> Choice | None:
    """The choice that "auto" would make if its law equals `law`, else None."""
    try:
        choice = choice_at_sites(first, second)
    except InputError:
        return None
    return choice if choice.law == law else None
