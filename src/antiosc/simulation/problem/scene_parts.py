"""The parts of a scene: bodies, the contacts between their sites, and what acts on them.

All bodies stand in one system of axes. A contact of the ends a and b has a direction d, that of
a's site (of b's, where a's is not known); its force F >= 0 pushes a along +d and b along -d, and

    delta = (displacement of b - displacement of a) along d - gap.

A body that knows no directions in space (`RigidMass`, `Sphere`, a model made by hand) has one
coordinate, which takes the place of the displacement along d: as b it moves toward a when its
velocity is > 0. The d of its first contact is the direction of this coordinate; a later contact
along -d takes it with the opposite sign, and one along another line is refused. Everything is
measured relative to the ground, and a body that its supports hold at its sites from its own
equilibrium under gravity.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.checks import Checked, checked_by
from antiosc.base.errors import InputError
from antiosc.base.texts import Given
from antiosc.contact import ContactLaw
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import checked_body
from antiosc.models.motion import ModalState, Motion
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.bodies.bodies import RigidBody

LAW = "a ContactLaw such as Hertz(stiffness)"


@dataclass(frozen=True, eq=False)
class Contact(Checked):
    """A contact between two sites, "body" or "body:site".

    Parameters
    ----------
    a, b : str
        The ends; the force pushes a along the direction of its site and b against it. Where a has
        no direction, as an obstacle, the force pushes b against its own: two stops on either side
        of a tip are ("tip", "one") and ("other", "tip"). The history's message says so.
    law : ContactLaw
        Force along the direction of the contact.
    gap : float, optional
        Distance at the start [m], >= 0; default 0, or the obstacle's own.
    friction : float
        Coulomb's coefficient mu >= 0 (`tangential_stiffness` says how it is met).
    tangential_stiffness : float, optional
        k_t [N/m] of the spring in series with the slider that carries mu F at most; default
        2 (1 - nu)/(2 - nu) = 0.82 (nu = 0.3, R. D. Mindlin, J. Appl. Mech. 16 (1949) 259-268)
        times the mean normal stiffness of a contact as deep as expected. It is that of the contact
        as a whole: what the patches of the sites give way is taken out, as from Hertz's law. A blow
        that slides all
        along does not depend on it. Beside spheres whose contact slips from its edge inward (N.
        Maw, J. R. Barber, J. N. Fawcett, Wear 38 (1976) 101-114) the tangential speed of rebound
        differs by up to 0.35 mu times the speed of approach where the contact begins to stick, and
        by less than 0.1 mu times it where it begins to slide.
    """

    a: str
    b: str
    law: ContactLaw = field(metadata=checked_by(checks.instance, ContactLaw, LAW))
    gap: float | None = field(default=None, metadata=checked_by(checks.nonnegative, "m"))
    friction: float = field(default=0.0, metadata=checked_by(checks.nonnegative))
    tangential_stiffness: float | None = field(
        default=None, metadata=checked_by(checks.positive, "N/m")
    )

    def __post_init__(self) -> None:
        for name in ("a", "b"):
            checks.text(f"end {name}, as 'body' or 'body:site',", getattr(self, name))
        if self.a == self.b:
            raise InputError(f"the ends of a contact must differ; got {self.a!r} twice.")
        super().__post_init__()


@dataclass(frozen=True, eq=False)
class Load(Given):
    """A force in time at a site, along the direction of the site (the body's one coordinate).

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
        checks.text("end, as 'body' or 'body:site',", self.end)
        times, forces = _series(f"load on {self.end!r}", self.times, self.forces)
        checks.store(self, times=times, forces=checks.array("forces", forces, (times.size,)))


@dataclass(frozen=True, eq=False)
class Base(Given):
    """Acceleration of the ground, with all supports and obstacles on it.

    Parameters
    ----------
    times : array_like, shape (K,)
        Ascending times [s].
    accelerations : array_like, shape (K,) or (K, 3)
        [m/s^2], along the direction of the contacts or in the axes of the scene; linear in
        between, constant before and after.

    Notes
    -----
    All motion of the scene is relative to the ground, so that every body feels -acceleration as a
    gravity that changes in time, supported bodies in all their modes.
    """

    times: Array
    accelerations: Array

    def __post_init__(self) -> None:
        times, values = _series("base", self.times, self.accelerations)
        shape = (times.size,) if values.ndim == 1 else (times.size, 3)
        values = checks.array("accelerations", values, shape)
        checks.store(self, times=times, accelerations=values)


def _series(name: str, times: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    t = checks.filled(f"times of {name}", times)
    if np.any(np.diff(t) < checks.SMALLEST):
        raise InputError(f"the times of {name} must ascend.")
    return t, checks.array(f"values of {name}", values, None)


@dataclass(frozen=True, eq=False)
class SceneParts(Given):
    """What a `Scene` consists of, checked."""

    bodies: Mapping[str, object]
    contacts: Sequence[Contact]
    gravity: float | Sequence[float] = 0.0
    loads: Sequence[Load] = ()
    base: Base | None = None
    motion: Mapping[str, Motion | ModalState | float] = field(default_factory=dict)
    preload: bool = False

    def __post_init__(self) -> None:
        for each in ("bodies", "motion"):
            value = getattr(self, each)
            checks.instance(each, value, Mapping, "a dict with the names of bodies")
            checks.store(self, **{each: dict(value)})
        for each, kind in (("contacts", Contact), ("loads", Load)):
            value = getattr(self, each)
            checks.instance(each, value, (list, tuple), f"a list of {kind.__name__} objects")
            for entry in value:
                checks.instance(each, entry, kind, f"{kind.__name__} objects")
            checks.store(self, **{each: tuple(value)})
        checks.flag("preload", self.preload)
        for name, body in self.bodies.items():
            if ":" in checks.text("a body's name", name):
                raise InputError(f"a body's name is a text without ':'; got {name!r}.")
            several = isinstance(body, AntiOscillators) and len(body.sites) > 0
            if not several and not isinstance(body, RigidBody | SiteModes):
                checked_body(f"body {name!r}", body)
        for name, motion in self.motion.items():
            if not isinstance(motion, Motion | ModalState):
                checks.number(f"motion of {name!r}, if no Motion,", motion, "m/s")
        if not self.contacts:
            raise InputError("a scene needs at least one Contact.")
        if self.base is not None:
            checks.instance("base", self.base, Base, "a Base")
        if isinstance(self.gravity, Sequence | np.ndarray):
            vector = checks.array("gravity", self.gravity, (3,))
            checks.store(self, gravity=tuple(vector.tolist()))
        else:
            checks.store(self, gravity=checks.number("gravity", self.gravity, "m/s^2"))
        self._check_pairs()
        unknown = set(self.motion) - set(self.bodies)
        if unknown:
            raise InputError(
                f"motion names the bodies {sorted(unknown)}, which are not in the scene:"
                f" {', '.join(self.bodies)}."
            )

    def _check_pairs(self) -> None:
        """InputError for two contacts between the same two sites, in either order."""
        seen: dict[frozenset[str], Contact] = {}
        for contact in self.contacts:
            ends = frozenset(self._site_of(end) for end in (contact.a, contact.b))
            if len(ends) == 1:
                raise InputError(
                    f"the contact {contact.a!r}, {contact.b!r} joins a site to itself; name two."
                )
            other = seen.setdefault(ends, contact)
            if other is not contact:
                raise InputError(
                    f"the contacts {other.a!r}, {other.b!r} and {contact.a!r}, {contact.b!r} have"
                    f" the same ends; give each pair of sites once (a stop on the other side is"
                    f" another body or site)."
                )

    def _site_of(self, end: str) -> str:
        """An end under one name: the site of a body that has no more than one may have any."""
        name = end.partition(":")[0]
        return end if len(getattr(self.bodies.get(name), "sites", ())) > 1 else name


def of_two(
    model: object, impactor: object, law: ContactLaw, gap: float, gravity: float | Sequence[float]
) -> SceneParts:
    """The bodies "structure" and "impactor" of `simulate`, which has checked them."""
    parts, contact = SceneParts.__new__(SceneParts), Contact.__new__(Contact)
    checks.store(contact, a="structure", b="impactor", law=law, gap=gap)
    bodies = {"structure": model, "impactor": impactor}
    checks.store(parts, bodies=bodies, contacts=(contact,), gravity=gravity, motion={})
    return parts
