"""What a scene returns: the forces of its contacts, the motion of its bodies, their balances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks, march
from antiosc.base._types import Array
from antiosc.base.brief import Brief
from antiosc.base.errors import InputError
from antiosc.models.modal import ModalBody
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.assembly import Assembly
from antiosc.simulation.bodies import Placed
from antiosc.simulation.contact_rows import along, find
from antiosc.simulation.energy import Energy
from antiosc.simulation.engine import Run
from antiosc.simulation.history import no_field
from antiosc.simulation.main_impact import contact_time
from antiosc.simulation.results import SceneResults, covered, scene_places
from antiosc.simulation.scene_energy import balance
from antiosc.simulation.scene_states import (
    forces,
    located,
    node_states,
    spans,
    states,
)


@dataclass(frozen=True, eq=False, repr=False)
class ContactHistory(Brief):
    """One contact of a scene, at the times of the history.

    Attributes
    ----------
    time : (n,) [s]; force : (n,) [N], >= 0; indentation : (n,) [m], negative: distance.
    friction : (n, k) tangential forces on b against a [N], one or two; (n, 0) without friction.
    contacts : list of (start, end) [s].
    """

    time: Array
    force: Array
    indentation: Array
    friction: Array
    contacts: list[tuple[float, float]]

    @property
    def peak_force(self) -> float:
        """Largest force [N], of the parabolas between the nodes."""
        return self._pulse[1]

    @property
    def impulse(self) -> float:
        """Time integral of the force [N s]."""
        return self._pulse[0]

    @cached_property
    def _pulse(self) -> tuple[float, float]:
        """Impulse [N s] and largest force [N]."""
        steps = self.time.size // 2
        area, top = march.pulses(self.time, self.force[:, None], 0, np.array([[0, steps]]))[0]
        return float(area), float(top)

    @property
    def contact_time(self) -> float:
        """Time [s] from the first touch to the last release of the main impact; see `History`."""
        f, step = self.force, np.diff(self.time[::2])
        areas = step / 6 * (f[:-2:2] + 4 * f[1:-1:2] + f[2::2])
        given = np.append(0.0, np.cumsum(areas))
        at = np.searchsorted(self.time[::2], np.reshape(self.contacts, (-1, 2)))
        return contact_time(
            (start, end, float(given[last] - given[first]))
            for (start, end), (first, last) in zip(self.contacts, at, strict=True)
        )


@dataclass(frozen=True, eq=False, repr=False)
class BodyHistory(Brief):
    """One body of a scene, at the times of the history.

    Attributes
    ----------
    time : (n,) [s].
    q, v, a : (n, J) modal displacements, velocities and accelerations.
    forces : (n, P) on the columns of its sites, along their directions [N].
    kinetic, strain : (n,) energies [J].
    """

    placed: Placed
    time: Array
    q: Array
    v: Array
    a: Array
    forces: Array
    kinetic: Array
    strain: Array
    _columns: Array

    def displacement(self, site: str = "", direction: ArrayLike | None = None) -> Array:
        """Displacement (n,) [m] of a site, along the direction that the contact pushes it in."""
        return np.asarray(self._columns @ self._row(site, direction))

    def velocity(self, site: str = "", direction: ArrayLike | None = None) -> Array:
        """Velocity (n,) [m/s] of a site, of the part that has inertia."""
        return np.asarray(self.v @ (self.placed.B @ self._row(site, direction)))

    def acceleration(self, site: str = "", direction: ArrayLike | None = None) -> Array:
        """Acceleration (n,) [m/s^2] of a site relative to the ground, of the part with inertia.

        It may jump where a contact touches or parts.
        """
        return np.asarray(self.a @ (self.placed.B @ self._row(site, direction)))

    @property
    def momentum(self) -> Array:
        """Momentum [kg m/s]: (n, 3) of a body that moves in space, else (n,) along its axis."""
        if self.placed.inertia is not None:
            return np.asarray(self.v @ self.placed.inertia.momentum[:, :3])
        if self.placed.weight is None:
            raise InputError(f"the model of {self.placed.name!r} does not know what it carries.")
        return np.asarray(self.v @ self.placed.weight)

    def angular_momentum(self, about: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Angular momentum (n, 3) [kg m^2/s] about a point of the undeformed scene."""
        if self.placed.inertia is None:
            raise InputError(f"the model of {self.placed.name!r} does not know how it turns.")
        inertia = self.placed.inertia
        point = checks.array("about", about, (3,))
        return inertia.moved(self.v @ inertia.momentum, point)[..., 3:]

    @property
    def rotation(self) -> Array:
        """Rotation vector (n, 3) [rad] of the rigid motion, taken as small."""
        return self.placed.rotation(self.q)

    def _row(self, site: str, direction: ArrayLike | None) -> Array:
        checks.instance("site", site, str, "the name of a site")
        name = self.placed.name
        _, found = find(f"{name}:{site}" if site else name, {name: self.placed})
        line = None if direction is None else checks.array("direction", direction, (3,))
        if line is None:
            line = self.placed.pushes.get(found)
        return along(self.placed, found, line, f"{name}:{found}")


@dataclass(frozen=True, eq=False, repr=False)
class SceneHistory(SceneResults):
    """History of a scene: `hit[a, b]` a contact, `hit.bodies[name]` a body.

    Attributes
    ----------
    error : estimated relative errors of the forces: "force" (L2 norm of all) and "peak"; empty for
        a given step.
    status : 0: completed; 1: completed, tol not met; 2: stopped before the end; 3: completed, but
        a contact that touched during the run goes on at its end: its contact time, impulse and
        peak force count up to there.
    message : the status in words.
    """

    assembly: Assembly
    run: Run
    error: dict[str, float]
    status: int
    message: str

    @property
    def time(self) -> Array:
        """Times (n,) [s]: every other one ends a step, over which the forces are parabolas."""
        return self.run.time

    def __getitem__(self, ends: tuple[str, str]) -> ContactHistory:
        pairs = [(c.a, c.b) for c in self.assembly.scene.contacts]
        if ends not in pairs:
            listed = ", ".join(str(pair) for pair in pairs)
            raise InputError(f"there is no contact {ends!r} in the scene; it has {listed}.")
        c = pairs.index(ends)
        first, count = self.assembly.system.tangents[c]
        return ContactHistory(
            time=self.run.time,
            # a release is located to a small share of the depth: a spring may pull by as little
            force=np.maximum(self.run.force[:, c], 0.0),
            indentation=self.run.depth[:, c],
            friction=self.run.force[:, first : first + count],
            contacts=spans(self.run, self.assembly.system, c),
        )

    @cached_property
    def bodies(self) -> dict[str, BodyHistory]:
        """Histories of the bodies by name, at the nodes."""
        return self._bodies_of_steps(0, self.run.time.size // 2)

    def at(self, times: ArrayLike) -> dict[str, BodyHistory]:
        """The bodies by name at any times (n,) [s] of the run, exact between the nodes too.

        The nodes may lie far apart in flight: values are not to be interpolated between them.
        """
        t = self._within(times)
        step, since = located(self.run, t)
        q, v = states(self.run, self.assembly.system, self.assembly.load, step, since)
        return self._bodies(t, q, v, forces(self.run, step, since))

    def _within(self, t: ArrayLike) -> Array:
        """Times (n,) of the run; InputError for others."""
        times = checks.column("t", t)
        end = float(self.time[-1])
        outside = (times < 0) | (times > end * (1 + 1e-12))
        if np.any(outside):
            raise InputError(
                f"t must lie within the run, 0 <= t <= {end:g} s; got {times[outside][0]:g} s."
            )
        return times

    def _bodies(self, time: Array, q: Array, v: Array, force: Array) -> dict[str, BodyHistory]:
        a = self.assembly
        acting = self.assembly.pushes(time) - force @ a.G
        columns = q @ a.B + acting @ a.r
        kinetic, strain = 0.5 * v**2, 0.5 * (a.system.omega * q) ** 2
        load = a.load(time) - force @ a.system.beta
        accelerations = load - a.system.omega**2 * q - 2 * a.system.decay * v
        found = {}
        for name, body in a.bodies.items():
            j, k = a.spans[name], a.columns[name]
            residual = 0.5 * np.einsum("nk,kl,nl->n", acting[:, k], a.r[k, k], acting[:, k])
            found[name] = BodyHistory(
                placed=body,
                time=time,
                q=q[:, j],
                v=v[:, j],
                a=accelerations[:, j],
                forces=acting[:, k],
                kinetic=kinetic[:, j].sum(axis=1),
                strain=strain[:, j].sum(axis=1) + residual,
                _columns=columns[:, k],
            )
        return found

    @cached_property
    def energy(self) -> Energy:
        """Energies of the whole scene; `gravity` is the work of all loads."""
        return balance(self.assembly, self.run)

    def of(self, body: str) -> tuple[Any, ModalBody | SiteModes]:
        """The model of a body of the scene, and its form in free modes.

        "structure", if no body has this name, is the one that has displacement shapes.
        """
        placed = self.assembly.bodies[self.name_of(body)]
        if placed.modes is None:
            raise InputError(f"{body!r} is a {type(placed.body).__name__}, which has no field.")
        return placed.body, placed.modes

    def name_of(self, body: str) -> str:
        """The name in the scene that `body` stands for, see `of`."""
        bodies = self.assembly.bodies
        checks.instance("body", body, str, "the name of a body")
        if body == "structure" and body not in bodies:
            shaped = [n for n, b in bodies.items() if b.modes is not None and b.modes.basis]
            if len(shaped) == 1:
                return shaped[0]
        if body not in bodies:
            raise InputError(
                f"there is no body {body!r} in the scene: name one of {', '.join(bodies)}."
            )
        return body

    def coordinates(self, t: ArrayLike, body: str = "structure") -> Array:
        """The coordinates (n, C) of a body's model at times (n,) [s], (C,) at one time.

        They are those of its form in free modes (`of`).
        """
        times, name = self._within(t), self.name_of(body)
        _, own = self.of(name)
        a, (step, since) = self.assembly, located(self.run, times)
        q, _ = states(self.run, a.system, self.assembly.load, step, since)
        acting = self.assembly.pushes(times) - forces(self.run, step, since) @ a.G
        acting = acting[:, a.columns[name]]
        pushed = acting if isinstance(own, SiteModes) else acting[:, 0]
        found = own.coordinates(q[:, a.spans[name]], pushed)
        return found if np.ndim(t) else found[0]

    def field(self, t: ArrayLike, body: str = "structure") -> Array:
        """Nodal displacements (n_dofs,) of a body at one time, (n, n_dofs) at several [m]."""
        model, own = self.of(body)
        if own.basis is None:
            raise InputError(no_field(model))
        return own.field(self.coordinates(t, body))

    def largest_rotation(self) -> tuple[str, float]:
        """The free body that turned most by a step's end, and how far [rad]; ("", 0) without one.

        Of bodies whose inertia in space is known.
        """
        assert self.run.states is not None
        q = self.run.states[:, 0]
        turned = [
            (name, float(np.linalg.norm(body.rotation(q[:, own]), axis=1).max()))
            for (name, body), own in zip(
                self.assembly.bodies.items(), self.assembly.spans.values(), strict=True
            )
            if body.inertia is not None and not body.omega.all()
        ]
        return max(turned, key=lambda pair: pair[1], default=("", 0.0))

    def summary(self) -> str:
        """The numbers of every contact as a short table."""
        rows = [f"{'contact':<24} {'peak N':>11} {'impulse Ns':>11} {'touches':>7} {'time s':>10}"]
        for contact in self.assembly.scene.contacts:
            h = self[contact.a, contact.b]
            rows.append(
                f"{contact.a + ' - ' + contact.b:<24} {h.peak_force:>11.5g} {h.impulse:>11.5g}"
                f" {len(h.contacts):>7} {h.contact_time:>10.4g}"
            )
        places = scene_places(self).items()
        rows += [f"site {name:<19} {checks.in_words(point)}" for name, point in places]
        rows.append(f"energy drift {self.energy.drift:.1e}; force error {covered(self)}")
        rows.append(self.message)
        return "\n".join(rows)

    # -- inside

    def _bodies_of_steps(self, first: int, last: int) -> dict[str, BodyHistory]:
        """Histories of the bodies at the nodes of the steps `first` to `last`."""
        nodes = slice(2 * first, 2 * last + 1)
        q, v = node_states(self.run, self.assembly.system, self.assembly.load, first, last)
        return self._bodies(self.run.time[nodes], q, v, self.run.force[nodes])
