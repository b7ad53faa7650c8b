"""The parts of a history: one contact, and one body."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref
from dataclasses import dataclass, replace
from functools import cached_property
from math import isnan
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike, NDArray
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.engine.march import Run
from antiosc.impact.assembly import Assembly
from antiosc.impact.bodies import SceneBody
from antiosc.impact.histories.energy import impulses
from antiosc.impact.scene_parts import find_site, site_row
from antiosc.impact.states import (
    c_record_of,
    contact_intervals,
    modal_start_states,
    with_flight_nodes,
)
from antiosc.models.stretch import Stretch

if TYPE_CHECKING:
    from antiosc.engine.contact.dent import Dent
    from antiosc.impact.enclosure import Enclosure


def contacts_of_main(result: Any) -> int:
    """Number of contacts of the main impact; 0 if it is not known."""
    contacts = np.array(getattr(result, "contacts", ())).reshape(-1, 2)
    if not len(contacts):
        return 0

    lasted = contacts[None, :, 1] - contacts[:, None, 0]
    nearest = int(abs(lasted - result.contact_time).argmin())
    first, last = divmod(nearest, len(contacts))

    return last - first + 1


@dataclass(frozen=True, eq=False)
class SceneRun:
    """A run of a scene, shared by a history and its contacts."""

    assembly: Assembly
    run: Run
    has_flight_nodes: bool  # whether the history has instants between contacts, too
    enclosures: tuple[Enclosure, ...] = ()

    @cached_property
    def nodes(self) -> Run:
        """The run at the instants of the history."""
        if not self.has_flight_nodes:
            return self.run
        return with_flight_nodes(self.run, self.assembly.system)


class OneContact:
    """Force and results of one contact: the row `_row` of the run in `_record`."""

    _record: SceneRun
    _row: int

    @property
    def time(self) -> Array:
        """Time nodes (n,) [s]: starts, middles and ends of the steps."""
        return self._record.nodes.time

    @cached_property
    def force(self) -> Array:
        """Contact force (n,) [N], >= 0, at the time nodes; parabolic in each step."""
        # a release is located to a small share of the depth: a spring may pull by as little
        return np.maximum(self._record.nodes.force[:, self._row], 0.0)

    @property
    def indentation(self) -> Array:
        """Indentation (n,) [m] at the time nodes; negative while the bodies are apart."""
        return self._record.nodes.depth[:, self._row]

    @property
    def law(self) -> ContactLaw:
        """The law of the contact before patch compliances are subtracted."""
        return self._record.assembly.scene.contacts[self._row].law

    @property
    def dent(self) -> Dent | None:
        """The permanent indentation; None for an elastic contact."""
        from antiosc.engine.contact.dent import dent_of  # loaded where it is used

        return dent_of(self.law, self.deepest)

    @property
    def deepest(self) -> float:
        """Largest indentation [m]; patch indentation subtracted from the law is added back."""
        marched = self._record.assembly.laws[self._row]
        compliance = marched.compliance if self.law.compliance == 0.0 else 0.0
        return float(max(self.indentation.max(), 0.0)) + compliance * self.peak_force

    @property
    def contacts(self) -> list[tuple[float, float]]:
        """(start, end) [s] of every contact, in order."""
        touches = self._touch_records[0]
        return list(zip(touches["start"].tolist(), touches["end"].tolist(), strict=True))

    @property
    def peak_force(self) -> float:
        """Largest contact force [N] of the run, also between the time nodes."""
        return float(self._numbers.peak)

    @property
    def impulse(self) -> float:
        """Time integral of the contact force [N s] over the whole run."""
        return float(self._numbers.impulse)

    @property
    def contact_time(self) -> float:
        """Time from the first touch to the last release of the main impact [s]; 0 without contact.

        Successive contacts belong to one impact if the flight between them is shorter than the
        impact before it. The main impact has the largest impulse. A contact that is still closed at
        the end of the run counts up to there (status 3).
        """
        return float(self._numbers.contact_time)

    @property
    def count_text(self) -> str:
        """Text: number of contacts, and number in the main impact if others follow it."""
        of_main = contacts_of_main(self)
        more = f", {of_main} in the main impact" if of_main < len(self.contacts) else ""
        return f"{len(self.contacts)}{more}"

    @property
    def restitution(self) -> float | None:
        """Newton's coefficient of restitution of the rigid-body motions.

        The speed of separation at the contact point after the last release, divided by the speed of
        approach at the first touch. Both are speeds of the rigid-body motions, without vibration. A
        supported structure has no rigid-body motion at its site; the coefficient is then the
        rebound speed of the impactor divided by its speed of approach. If it is negative, these
        motions still approach after the last release, and the bodies will touch again: lengthen the
        duration. None without a contact, with a contact at the end, or without an approach.
        """
        restitution = float(self._numbers.restitution)
        return None if isnan(restitution) else restitution

    @property
    def enclosure(self) -> Enclosure:
        """Proved bounds on the force, with proof=True of `simulate` or `Scene.run`."""
        if not self._record.enclosures:
            raise InputError("the run has no proved bounds: give simulate or Scene.run proof=True.")
        return self._record.enclosures[self._row]

    @cached_property
    def cumulative_impulse(self) -> Array:
        """Time integral of the force from the start up to each time node [N s], (n,)."""
        areas = impulses(self.time, self._record.nodes.force[:, [self._row]])
        return np.append(0.0, np.cumsum(areas))

    # -- inside

    @cached_property
    def _touch_records(self) -> tuple[NDArray[np.void], bool]:
        return contact_intervals(self._record.run, self._record.assembly.system, self._row)

    @cached_property
    def _numbers(self) -> library.CNumbers:
        """Scalar results of the contact and of each of its touches, by the C library."""
        run = self._record.run
        a = self._record.assembly
        touches, goes_on = self._touch_records
        record, arrays = c_record_of(run)
        system = posed = a.system
        size = system.omega.size
        if system.first is not None:  # of a mode it counts alone whether it is damped
            posed = replace(system, decay=(~system.undamped).astype(float), first=None)

        if run.every == 1 and system.first is None:
            arrays.append(np.ascontiguousarray(run.states))
            velocities = library.address(arrays[-1]) + 8 * size
            stride = 2 * size
        else:
            steps = np.column_stack([touches["first"], touches["last"]]).ravel()
            arrays.append(modal_start_states(run, system, steps)[1])
            velocities = library.address(arrays[-1])
            stride = 0

        arguments = self._row, goes_on, touches.size, library.address(touches), velocities, stride
        bodies = byref(posed.packed.system)

        return library.library.aom_read_contact(bodies, byref(record), *arguments)


@dataclass(frozen=True, eq=False, repr=False)
class ContactHistory(OneContact, ReprMixin):
    """One contact of a history: force over time and scalar results.

    Attributes
    ----------
    ends : names of the two sites in contact.
    """

    ends: tuple[str, str]
    _record: SceneRun
    _row: int

    @property
    def friction(self) -> Array:
        """Tangential contact forces [N] on b (opposite on a), (n, 1) or (n, 2); (n, 0) without
        friction."""
        return self._record.nodes.force[:, self._record.assembly.system.friction_rows[self._row]]

    def pulses(self) -> tuple[Array, Array]:
        """(time nodes (n,) [s] of all touches, forces (n,) [N] there)."""
        run = self._record.run
        nodes = [np.zeros(0, dtype=int)]
        steps = zip(self._touch_records[0]["first"], self._touch_records[0]["last"], strict=True)
        nodes += [np.arange(2 * a, 2 * b + 1) for a, b in steps]
        node_numbers = np.concatenate(nodes)
        return run.time[node_numbers], np.maximum(run.force[node_numbers, self._row], 0.0)

    def _facts(self) -> list[tuple[str, str]]:
        return [
            ("ends", " - ".join(self.ends)),
            ("peak force", f"{self.peak_force:.6g} N, impulse {self.impulse:.6g} N s"),
            ("contact", f"{self.contact_time:.4g} s in {len(self.contacts)} contact(s)"),
        ]


@dataclass(frozen=True, eq=False, repr=False)
class BodyHistory(ReprMixin):
    """One body of a scene, at the times of the history.

    Attributes
    ----------
    time : (n,) [s].
    placed : the body as placed in the scene.
    q, v, a : (n, J) modal displacements, velocities and accelerations.
    forces : (n, P) forces on the columns of its sites, along their directions [N].
    springs : (n, J) modal displacements of the spring, for each Maxwell branch of its damping.
    kinetic, strain : (n,) energies [J].
    stretched : second-order forces of the body in this run; None if it is linear.
    """

    placed: SceneBody
    time: Array
    q: Array
    v: Array
    a: Array
    forces: Array
    kinetic: Array
    strain: Array
    _columns: Array  # (n, P) displacements along these directions [m]
    springs: Sequence[Array] = ()
    stretched: Stretch | None = None

    def displacement(self, site: str = "", direction: ArrayLike | None = None) -> Array:
        """Displacement (n,) [m] of a site along `direction`; default: that of contact forces.

        For a supported body it counts from its equilibrium under gravity, without the static
        deflection under its own weight.
        """
        return np.asarray(self._columns @ self._row(site, direction))

    def velocity(self, site: str = "", direction: ArrayLike | None = None) -> Array:
        """Velocity (n,) [m/s] of a site, without the part of its massless residual compliance."""
        return np.asarray(self.v @ (self.placed.modes.B @ self._row(site, direction)))

    def acceleration(self, site: str = "", direction: ArrayLike | None = None) -> Array:
        """Acceleration (n,) [m/s^2] of a site relative to the ground, without residual compliance.

        It may jump at a touch or a release.
        """
        return np.asarray(self.a @ (self.placed.modes.B @ self._row(site, direction)))

    @property
    def momentum(self) -> Array:
        """Momentum [kg m/s]: (n, 3) for a body that moves in space, else (n,) along its axis."""
        if self.placed.inertia is not None:
            return np.asarray(self.v @ self.placed.inertia.momentum[:, :3])
        if self.placed.modes.weight is None:
            raise InputError(f"the model of {self.placed.name!r} does not know what it carries.")
        return np.asarray(self.v @ self.placed.modes.weight)

    def angular_momentum(self, about: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Angular momentum (n, 3) [kg m^2/s] about a point of the undeformed scene."""
        if self.placed.inertia is None:
            raise InputError(f"the model of {self.placed.name!r} does not know how it turns.")
        inertia = self.placed.inertia
        point = checks.floats("about", about, (3,))
        return inertia.moved(self.v @ inertia.momentum, point)[..., 3:]

    @property
    def rotation(self) -> Array:
        """Rotation vector (n, 3) [rad] of the rigid motion, assumed small."""
        return self.placed.rotation(self.q)

    def _row(self, site: str, direction: ArrayLike | None) -> Array:
        checks.instance("site", site, str, "the name of a site")
        name = self.placed.name
        _, site_name = find_site(f"{name}:{site}" if site else name, {name: self.placed})
        line = None if direction is None else checks.floats("direction", direction, (3,))
        if line is None:
            line = self.placed.push_directions.get(site_name)

        return site_row(self.placed, site_name, line, f"{name}:{site_name}")
