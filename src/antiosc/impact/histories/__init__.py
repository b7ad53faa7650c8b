"""What a simulation returns: `History`, and the motion and energy of its bodies.

The motion is in the coordinates of the body's model, with its time derivatives. The equations of
motion in modal coordinates give the accelerations from the displacements, the velocities and the
forces; nothing is differentiated numerically.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, Index
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin
from antiosc.engine import library
from antiosc.engine.march import Run
from antiosc.impact.assembly import Assembly, given_parts
from antiosc.impact.bodies import RigidBody, SceneBody
from antiosc.impact.histories.energy import Energy, energy_balance
from antiosc.impact.histories.parts import (
    BodyHistory,
    ContactHistory,
    ErrorBudget,
    OneContact,
    Record,
)
from antiosc.impact.histories.results import HistoryResults
from antiosc.impact.states import (
    blocks,
    damping_states,
    forces,
    largest_rotation,
    locate,
    node_states,
    states,
)
from antiosc.models.body import LinearBody
from antiosc.models.modal import ModalBody, SiteModes
from antiosc.models.stretch import Stretch, stretch_of
from antiosc.plot.charts import plot_history

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class SeveralContactsError(InputError, AttributeError):
    """A result of a single contact is asked of a history with several."""


@dataclass(frozen=True, eq=False, repr=False)
class History(HistoryResults, OneContact):
    """History of a simulation; times in s, forces in N, displacements in m.

    `hit[a, b]` is a contact, `hit.bodies[name]` a body; those of `simulate` are "structure" and
    "impactor". Where there is one contact, its force, numbers and motions are also attributes of
    the history. All is computed when it is first asked for.

    Attributes
    ----------
    error : estimated relative errors reached, the largest of a contact: "force" (L2 norm and
        impulse) and "peak"; empty when the step was given. With n="auto" also "truncation
        peak_force", "... impulse", "... contact_time"; "dampers": of the coupling of modes by
        dampers, the largest in these three.
    status : 0: completed; 1: completed, tol not met; 2: stopped before the end; 3: completed, but
        a contact that touched during the run goes on at its end: its contact time, impulse and
        peak force count up to there.
    message : explanation of the status, and changes made to contact laws.
    budget : what makes the `error_budget` of a run of `simulate`.
    given : the step [s] that was given, or None.
    structure : of `strike`, the structure of the last mesh, for `probe` and fields; not pickled.
    """

    assembly: Assembly
    run: Run
    error: dict[str, float]
    status: int
    message: str
    budget: Callable[[History], ErrorBudget] | None = None
    given: float | None = None
    structure: object = None

    # -- at the nodes

    def __getitem__(self, ends: tuple[str, str]) -> ContactHistory:
        for contact in self.contact_histories:
            if contact.ends == ends:
                return contact
        listed = ", ".join(str(contact.ends) for contact in self.contact_histories)
        raise InputError(f"there is no contact {ends!r} in the scene; it has {listed}.")

    @cached_property
    def contact_histories(self) -> list[ContactHistory]:
        """All contacts in the order of the scene."""
        contacts = self.assembly.scene.contacts
        return [ContactHistory((c.a, c.b), self._record, i) for i, c in enumerate(contacts)]

    @cached_property
    def bodies(self) -> dict[str, BodyHistory]:
        """Histories of the bodies by name, at the nodes."""
        run, a = self._nodes, self.assembly
        q, v = node_states(run, a.system)
        return self._bodies(run.time, q, v, run.force)

    @cached_property
    def energy(self) -> Energy:
        """Energies of all bodies and contacts, and their drift; `gravity`: work of all loads."""
        return energy_balance(self.assembly, self._nodes)

    @property
    def details(self) -> list[str]:
        """Changes of contact laws: compliances that the bodies contain already."""
        return list(self.assembly.notes)

    # -- of one contact: force and numbers are those of `OneContact`

    @property
    def displacement(self) -> Array:
        """Displacement u of the structure's site [m], (n,), along the contact.

        Of a structure that supports hold it is that from its equilibrium under gravity: the sag
        under its own weight is not in it.
        """
        return self._sites[0]

    @property
    def velocity(self) -> Array:
        """Velocity of the structure's site [m/s], (n,), without the residual compliance."""
        return self._sites[1]

    @property
    def impactor_displacement(self) -> Array:
        """Displacement w of the impactor's contact point [m], (n,), along the contact."""
        return self._sites[2]

    @property
    def impactor_velocity(self) -> Array:
        """Velocity w' of the impactor's contact point [m/s], (n,)."""
        return self._sites[3]

    @property
    def step(self) -> float:
        """Step during contact [s]: the given one, or the mean."""
        if self.given is not None:
            return self.given
        found = self._numbers
        return (
            float(found.closed / found.steps)
            if found.steps
            else self.assembly.contact_time_estimate
        )

    @cached_property
    def error_budget(self) -> ErrorBudget:
        """Bars of peak force, impulse and contact time: mesh, truncation, time, patch, total.

        Relative errors, as `hit.error_budget["peak_force"].total`; printed, they are a table. When
        this is first asked for the impact is simulated up to eight times more; the result is kept.
        InputError for a model that was extracted without `error="estimate"`.
        """
        if self.budget is None:
            raise InputError("only a History that simulate or strike returned has an error budget.")
        return self.budget(self)

    @property
    def model(self) -> Any:
        """The body at the first end of the contact: the structure of `simulate`."""
        return self._ends[0].body

    @property
    def impactor(self) -> Any:
        """The body at the second end of the contact."""
        return self._ends[1].body

    @property
    def momentum(self) -> Array:
        """Momentum of the structure (n, 3) [kg m/s], in the axes of its mesh."""
        return self._free_structure.momentum

    @property
    def angular_momentum(self) -> Array:
        """Angular momentum of the structure (n, 3) [kg m^2/s] about its centre of mass at rest."""
        inertia = self._free_structure.placed.inertia
        assert inertia is not None
        return self._free_structure.angular_momentum(inertia.centre)

    def force_at(self, t: ArrayLike) -> Array:
        """Contact force [N] at times (n,): the parabolas between the nodes."""
        return np.maximum(forces(self.run, *self._located(t))[:, self._row], 0.0)

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """Force and motions as a matplotlib figure; see `antiosc.plotting.plot_history`.

        With `path` (PNG, PDF, SVG, …) the picture is written, and the path returned.
        """
        own = (getattr(self, field.name) for field in fields(History))
        return plot_history(History(*own) if self.named else self, path)  # with nodes in flights

    # -- at any time

    def at(self, times: ArrayLike) -> dict[str, BodyHistory]:
        """The bodies by name at times (n,) [s] of the run, exact also between the nodes.

        The nodes may lie far apart in flight: values are not to be interpolated between them.
        """
        t = self._times_in_run(times)
        return self._bodies(t, *self.states(t), forces(self.run, *locate(self.run, t)))

    def states(self, t: ArrayLike) -> tuple[Array, Array]:
        """Modal displacements and velocities (n, J) of all bodies, concatenated, at times (n,)."""
        a = self.assembly
        return states(self.run, a.system, *self._located(t))

    def coordinates(self, t: ArrayLike, body: str = "structure") -> Array:
        """The coordinates of a body's model: lambda_0 ... lambda_N for `AntiOscillators`.

        `t` of shape (n,) gives (n, C), a single time (C,). They are those of its form in free modes
        (`of`): one for each hidden rigid-body motion of a free body follows lambda.
        """
        _, own = self.of(body)
        one = self.at(t)[self.name_of(body)]
        found = own.coordinates(one.q, one.forces)
        return found if np.ndim(t) else found[0]

    def field(self, t: ArrayLike, body: str = "structure") -> Array:
        """Nodal displacements (n_dofs,) of a body at one time, (n, n_dofs) at several [m].

        Article eq. (8), without the sag of a held body under its own weight. `body`: of a model
        with shapes.
        """
        model, own = self.of(body)
        if own.basis is None:
            raise InputError(no_field_message(model))
        found = own.field(self.coordinates(t, body))
        forces = self._stretched(self.name_of(body))
        if forces is None:
            return found
        shapes = stretch_shapes(self, body)
        if shapes is None:
            raise InputError(no_field_message(model))
        q = np.atleast_2d(self.at(np.atleast_1d(t))[self.name_of(body)].q)
        more = forces.pairs(q @ forces.modes) @ shapes.T
        return found + (more if np.ndim(t) else more[0])

    def of(self, body: str) -> tuple[object, ModalBody | SiteModes]:
        """(model of a body, its form in free modes).

        For "structure", if no body has this name, it is the body with displacement shapes.
        """
        placed = self.assembly.bodies[self.name_of(body)]
        if isinstance(placed.body, RigidBody):
            raise InputError(f"{body!r} is a RigidBody, which has no field.")
        return placed.body, placed.modes

    def name_of(self, body: str) -> str:
        """The key in `bodies` to which the name `body` refers; see `of`."""
        bodies = self.assembly.bodies
        checks.instance("body", body, str, "the name of a body")
        if body == "structure" and body not in bodies:
            shaped = [n for n, b in bodies.items() if b.modes.basis]
            if len(shaped) == 1:
                return shaped[0]
        if body not in bodies:
            raise InputError(
                f"there is no body {body!r} in the scene: name one of {', '.join(bodies)}."
            )
        return body

    def largest_rotation(self) -> tuple[str, float]:
        """(name of the free body that rotated most, largest angle at a step's end [rad]); ("", 0.0)
        if none.

        Of bodies whose inertia in space is known.
        """
        a = self.assembly
        if not a.may_rotate:
            return "", 0.0
        return largest_rotation(self.run, a.system, a.bodies, a.spans)

    # -- inside

    def _stretched(self, name: str) -> Stretch | None:
        """The second-order forces in the motion of a body; None for a linear motion."""
        return self.assembly.stretched.get(name)

    def _stretch_energy(self, name: str, q: Array) -> Array | float:
        """Second-order energy (n,) [J] of a body at modal displacements q (n, J)."""
        forces = self._stretched(name)
        return 0.0 if forces is None else forces.energy(q @ forces.modes)

    @cached_property
    def _record(self) -> Record:  # type: ignore[override]
        """The record that its contacts share, without a reference to the history itself.

        A single impact has few flights, which get nodes for pictures; a scene may have many.
        """
        return Record(self.assembly, self.run, not self.named)

    @property
    def _nodes(self) -> Run:
        return self._record.nodes

    @property
    def _row(self) -> int:  # type: ignore[override]
        """Row of the only contact in the system."""
        if len(self.assembly.laws) > 1:
            pairs = ", ".join(f"hit{list(c.ends)}" for c in self.contact_histories)
            raise SeveralContactsError(
                f"the scene has several contacts: ask for the force or motion of one, as {pairs}."
            )
        return 0

    @property
    def _ends(self) -> list[SceneBody]:
        """Names of the bodies of the only contact."""
        contact = self.assembly.scene.contacts[self._row]
        return [self.assembly.bodies[end.partition(":")[0]] for end in (contact.a, contact.b)]

    @property
    def _free_structure(self) -> BodyHistory:
        """The structure, if its momentum is known; otherwise an error."""
        found = self.bodies[self._ends[0].name]
        if found.placed.inertia is None:
            raise InputError(
                f"the momentum of {type(self.model).__name__} is not known: extract the model from "
                "a mesh whose supports permit a rigid-body motion."
            )
        return found

    @cached_property
    def _sites(self) -> Array:
        """Displacements and velocities of both ends of the only contact, along it: (4, n)."""
        a, run = self.assembly, self._nodes
        rows = np.zeros((len(a.r), 2))
        for i, body in enumerate(self._ends):
            own = a.columns[body.name]
            rows[own, i] = (2 * i - 1) * a.G[self._row, own]
        found = np.empty((4, run.time.size))
        for first, last in blocks(run, a.system.omega.size):
            q, v = node_states(run, a.system, first, last)
            nodes = slice(2 * first, 2 * last + 1)
            found[::2, nodes], found[1::2, nodes] = (q @ (a.B @ rows)).T, (v @ (a.B @ rows)).T
        found[::2] += ((a.pushes(run.time) - run.force @ a.G) @ (a.r @ rows)).T
        return found

    def _bodies(self, time: Array, q: Array, v: Array, force: Array) -> dict[str, BodyHistory]:
        a = self.assembly
        acting = self.assembly.pushes(time) - force @ a.G
        columns = q @ a.B + acting @ a.r
        kinetic, strain = 0.5 * v**2, 0.5 * (a.system.omega * q) ** 2
        load = a.load(time) - force @ a.system.beta
        accelerations = load - a.system.omega**2 * q
        springs: list[list[Array]] = [[] for _ in a.bodies]
        if a.system.first is not None:
            decelerations, springs = damping_states(self.run, a.system, *locate(self.run, time))
            accelerations -= decelerations
        elif a.system.damped:
            accelerations -= 2 * a.system.decay * v
        found = {}
        for (name, body), branches in zip(a.bodies.items(), springs, strict=True):
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
                strain=strain[:, j].sum(axis=1) + residual + self._stretch_energy(name, q[:, j]),
                _columns=columns[:, k],
                springs=branches,
                stretched=a.stretched.get(name),
            )
        return found

    def _located(self, t: ArrayLike) -> tuple[Index, Array]:
        return locate(self.run, self._times_in_run(t))

    def _times_in_run(self, t: ArrayLike) -> Array:
        """Checked times (n,) within the run; InputError for others."""
        times = checks.column("t", t)
        end = float(self.run.time[-1])
        outside = (times < 0) | (times > end * (1 + 1e-12))
        if np.any(outside):
            raise InputError(
                f"t must lie within the run, 0 <= t <= {end:g} s; got {times[outside][0]:g} s."
            )
        return np.minimum(times, end)

    def __getstate__(self) -> dict[str, object]:
        """Return the fields for pickle, without the structure."""
        return {f.name: getattr(self, f.name) for f in fields(self)} | {"structure": None}


class SceneHistory(History):
    """History of `Scene.run`: its tables name every contact and body of the scene."""

    named = True


def with_model(hit: History, model: object) -> History:
    """The same history with another record of the structure's model."""
    own = hit._ends[0]
    bodies = {**hit.assembly.bodies, own.name: replace(own, body=model)}
    return replace(
        hit, assembly=replace(hit.assembly, parts=given_parts(hit.assembly.scene, bodies))
    )


def no_field_message(model: object) -> str:
    """Why a model has no displacement field, with the remedy."""
    name = type(getattr(model, "body", model)).__name__
    return (
        f"{name} has no displacement field: it has no shapes (model files do not store them); "
        "extract the model again to recover fields."
    )


#: What knows the motion of a body.
AnyHistory = History | BodyHistory


def modes_of(history: AnyHistory, body: str) -> ModalBody | SiteModes:
    """The free modes of a body with its shapes; InputError for a body without shapes."""
    if isinstance(history, BodyHistory):
        model, own = history.placed.body, history.placed.modes
    else:
        model, own = history.of(body)
    if own.basis is None:
        raise InputError(no_field_message(model))
    return own


def times_of(history: AnyHistory, times: ArrayLike | None) -> Array:
    """Checked times (n,), by default those of the history."""
    if times is None:
        return history.time
    if isinstance(history, BodyHistory):
        raise InputError(
            "the motion of a body of a scene is known at its own times: probe "
            "hit.at(times)[name], or the scene's history with body=name."
        )
    return checks.nonempty("times", times)


def _motion_at(history: AnyHistory, times: Array, body: str) -> BodyHistory:
    """Motion of a body at `times`; a BodyHistory has its own times."""
    if isinstance(history, BodyHistory):
        return history
    return history.at(times)[history.name_of(body)]


def stretch_in(history: AnyHistory, body: str) -> Stretch | None:
    """The second-order forces in the motion of a body; None for a linear motion."""
    if isinstance(history, BodyHistory):
        return history.stretched
    return history.assembly.stretched.get(history.name_of(body))


def stretch_shapes(history: AnyHistory, body: str) -> Array | None:
    """Second-order displacements (n_dofs, P) of pairs of the modes in which a body stretches."""
    forces = stretch_in(history, body)
    of_body = history.placed.body if isinstance(history, BodyHistory) else history.of(body)[0]
    given = stretch_of(of_body)
    return None if forces is None or given is None else given.shapes_in(forces.modes)


def amplitudes(history: AnyHistory, times: Array, body: str, derivative: int = 0) -> Array:
    """Factors (n, B) of the body's shapes at `times`, or their first or second derivatives.

    Of a body that stretches those of the pairs of its modes follow, (n, B + m (m + 1)/2).

    Velocities and accelerations are those of the modes: what a residual compliance adds to the
    displacement has no inertia, and follows the force.
    """
    own, one = modes_of(history, body), _motion_at(history, times, body)
    q = (one.q, one.v, one.a)[derivative]
    found = _factors(own, q, np.zeros_like(one.forces) if derivative else one.forces)
    forces = stretch_in(history, body)
    if forces is None:
        return found
    a, v, w = (each @ forces.modes for each in (one.q, one.v, one.a))
    return np.hstack([found, forces.pair_motion(a, v, w, derivative)])


def stretch_amplitudes(history: AnyHistory, times: Array, body: str) -> Array:
    """Amplitudes (n, m), at times, of the modes with second-order forces."""
    forces = stretch_in(history, body)
    assert forces is not None
    return np.asarray(_motion_at(history, times, body).q @ forces.modes)


def stretch_factors(history: AnyHistory, body: str) -> Array:
    """Factors (m, B) of the body's shapes for the modes with second-order forces."""
    own, forces = modes_of(history, body), stretch_in(history, body)
    assert forces is not None
    return _factors(own, forces.modes.T, np.zeros((forces.size, own.B.shape[1])))


def spring_amplitudes(history: AnyHistory, times: Array, body: str) -> list[Array]:
    """Factors (n, B) of the shapes for the spring of each Maxwell branch, at `times`."""
    own, one = modes_of(history, body), _motion_at(history, times, body)
    none = np.zeros_like(one.forces)
    return [_factors(own, each, none) for each in one.springs]


def unit_energy_factors(own: ModalBody | SiteModes) -> tuple[Array, int]:
    """Factors (2, B) that scale the shapes of each elastic mode to q'Kq = 1, and to q'Mq = 1.

    The second result is the number of elastic modes.
    """
    elastic = own.omega > 0
    q = np.vstack([np.where(elastic, 1 / np.where(elastic, own.omega, 1.0), 0.0), elastic])
    return _factors(own, q, np.zeros((2, own.B.shape[1]))), int(elastic.sum())


def _factors(own: ModalBody | SiteModes, q: Array, forces: Array) -> Array:
    """Factors (n, B) of the body's shapes for modal displacements (n, J) and forces (n, P)."""
    return own.amplitudes(own.coordinates(q, forces))


def modal_amplitudes(
    history: AnyHistory, times: Array, body: str, derivative: int
) -> tuple[Array, Array, Array]:
    """Frequencies (J,) of a body's modes, their factors (J, B) and largest amplitudes (J,).

    Amplitudes of the oscillations at `times`, or of their derivatives, without what follows the
    forces slowly; 0 of rigid-body modes.
    """
    own, one = modes_of(history, body), _motion_at(history, times, body)
    omega = own.omega
    # of the oscillation x: x' = v and x'' = a
    swing = np.hypot(omega * one.v, one.a).max(axis=0)
    sizes = np.zeros(omega.size)
    np.divide(swing, omega ** (2 - derivative), out=sizes, where=omega > 0)
    shapes = _factors(own, np.eye(omega.size), np.zeros((omega.size, one.forces.shape[1])))
    return omega, shapes, sizes


def forces_of(history: AnyHistory, times: Array, body: str) -> Array:
    """Forces (n, P) [N] of contacts and loads on the columns of the body's model."""
    modes_of(history, body)
    return _motion_at(history, times, body).forces


@dataclass(frozen=True, eq=False, repr=False)
class BodyEnergy(ReprMixin):
    """Energies [J] of one body, at the times (n,) of the history.

    Attributes
    ----------
    time : s.
    rigid : kinetic energy of the rigid-body motion.
    kinetic : of the vibration.
    strain : of the vibration and of the residual compliance.
    """

    time: Array
    rigid: Array
    kinetic: Array
    strain: Array

    @property
    def vibration(self) -> Array:
        """Energy of the vibration, (n,): what the modes keep when the contact is over."""
        return self.kinetic + self.strain

    @property
    def total(self) -> Array:
        """All energy of the body, (n,)."""
        return self.rigid + self.vibration


def body_energy(history: History, body: str) -> BodyEnergy:
    """Energies of one body by its name; of `simulate`: "structure" or "impactor".

    Raises
    ------
    InputError
        For another name.
    """
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    one = history.bodies[history.name_of(body)]
    omega, v = one.placed.omega, one.v
    still = omega == 0
    return BodyEnergy(
        time=history.time,
        rigid=0.5 * np.sum(v[:, still] ** 2, axis=1),
        kinetic=0.5 * np.sum(v[:, ~still] ** 2, axis=1),
        strain=one.strain,
    )


def vibration_share(history: History) -> float:
    """Share of the initial kinetic energy that remains as vibration of all bodies.

    After a contact without losses of its own it is Zener's loss, by which a sphere rebounds more
    slowly from a plate than it came (C. Zener, Phys. Rev. 59 (1941) 669-673).

    Raises
    ------
    InputError
        Bodies at rest at the start.
    """
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    energies = [body_energy(history, name) for name in history.bodies]
    start = sum(float(e.rigid[0] + e.kinetic[0]) for e in energies)
    if start == 0:
        raise InputError("all bodies are at rest at the start: there is no share of their energy.")
    return sum(float(e.vibration[-1]) for e in energies) / start


#: Bodies processed together, and times at which u is evaluated in addition to those of the force:
#: at least, at most, and in a period of the first mode.
BODIES_AT_ONCE, SAMPLES, MOST_SAMPLES, A_PERIOD = 200, 200, 20_000, 40
#: Times [s] and the force [N] at them, linear between them and zero outside.
Force = tuple[Array, Array]


def peak_deflections(
    bodies: Sequence[LinearBody], forces: Sequence[Force], duration: float
) -> Array:
    """Largest displacement u (S,) [m] of each body's site along the impact, up to `duration` [s].

    The bodies are at rest at the start. forces : times [s] and the force [N] on each body, linear
    between the times and zero outside. The result is exact at the times of the force, and at 200
    times over the duration or more: 40 a period of the first mode.
    """
    duration = checks.positive("duration", duration, "s")
    peaks = [
        _peaks(bodies[i : i + BODIES_AT_ONCE], forces[i : i + BODIES_AT_ONCE], duration)
        for i in range(0, len(bodies), BODIES_AT_ONCE)
    ]
    return np.concatenate([np.zeros(0), *peaks])


def _peaks(bodies: Sequence[LinearBody], forces: Sequence[Force], duration: float) -> Array:
    modal = [body.modal() for body in bodies]
    omega, b, decay = (
        _padded_rows([m.omega for m in modal], 0.0),
        _padded_rows([m.b for m in modal], 0.0),
        _padded_rows([np.zeros(m.b.size) if m.decay is None else m.decay for m in modal], 0.0),
    )
    r = np.array([m.r for m in modal])
    peak = np.zeros(len(modal))
    first = max((w[w > 0].min() for w in omega if (w > 0).any()), default=0.0)
    samples = int(np.clip(A_PERIOD * duration * first / (2 * np.pi), SAMPLES, MOST_SAMPLES))
    for _, q, F in motions(omega, b, decay, forces, duration, samples):
        peak = np.maximum(peak, np.sum(b * q, axis=1) + r * F)
    return peak


def motions(
    omega: Array, b: Array, decay: Array, forces: Sequence[Force], duration: float, samples: int
) -> Iterator[tuple[Array, Array, Array]]:
    """Motions of bodies from rest: times, modal displacements (S, J), forces, step by step.

    At the times of each force [s] and at `samples` over the duration; the last one is repeated
    where a body has fewer than another. omega, b, decay : (S, J) of the modes.
    """
    even = np.linspace(0, duration, samples)
    times = [np.union1d(even, time) for time, _ in forces]
    steps = zip(times, forces, strict=True)
    force = [
        np.interp(at, t, F, left=0.0, right=0.0) if t.size else np.zeros_like(at)
        for at, (t, F) in steps
    ]
    time, F = _padded_rows(times, None), _padded_rows(force, 0.0)
    q, v = np.zeros_like(b), np.zeros_like(b)
    for k in range(time.shape[1] - 1):
        h = time[:, k + 1] - time[:, k]
        P, W, S, J0, J1, _ = library.responses(omega, decay, h[:, None])
        rise = (b.T * ((F[:, k + 1] - F[:, k]) / np.where(h > 0, h, 1.0))).T
        push = b * F[:, k, None]
        q, v = (
            P * q + S * v + push * J0 + rise * J1,
            W * v - omega**2 * S * q + push * S + rise * J0,
        )
        yield time[:, k + 1], q, F[:, k + 1]


def _padded_rows(rows: Sequence[Array], filler: float | None) -> Array:
    """Rows of different length as one array; None repeats the last value."""
    size = max(row.size for row in rows)
    return np.array(
        [
            np.pad(row, (0, size - row.size), constant_values=row[-1] if filler is None else filler)
            for row in rows
        ]
    )
