"""What a simulation returns: forces of contacts, motions of bodies, energies, status."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, Index
from antiosc.base.charts import plot_history
from antiosc.base.errors import InputError
from antiosc.models.modal import ModalBody
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.bodies.bodies import Placed, RigidBody
from antiosc.simulation.histories.energy import Energy, balance
from antiosc.simulation.histories.error_bars import ErrorBudget
from antiosc.simulation.histories.results import HistoryResults
from antiosc.simulation.histories.scene_history import (
    BodyHistory,
    ContactHistory,
    OneContact,
    Record,
)
from antiosc.simulation.march.engine import Run
from antiosc.simulation.problem.assembly import Assembly, known
from antiosc.simulation.problem.scene_states import (
    blocks,
    braked,
    forces,
    largest_rotation,
    located,
    node_states,
    states,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class SeveralContactsError(InputError, AttributeError):
    """What one contact has was asked of a history of several."""


@dataclass(frozen=True, eq=False, repr=False)
class History(HistoryResults, OneContact):
    """History of a simulation; times in s, forces in N, displacements in m.

    `hit[a, b]` is a contact, `hit.bodies[name]` a body; those of `simulate` are "structure" and
    "impactor". Where there is one contact, its force, numbers and motions are also attributes of
    the history. All is computed when it is first asked for.

    Attributes
    ----------
    error : estimated relative errors reached, of the forces: "force" (L2 norm of all) and "peak";
        empty when the step was given. With n="auto" also "truncation peak_force", "... impulse",
        "... contact_time"; "dampers": of the coupling of modes by dampers, the largest in these
        three.
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
    structure: Any = None

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
        return balance(self.assembly, self._nodes)

    # -- of one contact: force and numbers are those of `OneContact`

    @property
    def displacement(self) -> Array:
        """Displacement u of the structure's site [m], (n,), along the contact."""
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
        """The step used during contact [s]: the one given, or the mean."""
        if self.given is not None:
            return self.given
        found = self._numbers
        return float(found.closed / found.steps) if found.steps else self.assembly.lasting

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
        return self._moving.momentum

    @property
    def angular_momentum(self) -> Array:
        """Angular momentum of the structure (n, 3) [kg m^2/s] about its centre of mass at rest."""
        inertia = self._moving.placed.inertia
        assert inertia is not None
        return self._moving.angular_momentum(inertia.centre)

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
        """The bodies by name at any times (n,) [s] of the run, exact between the nodes too.

        The nodes may lie far apart in flight: values are not to be interpolated between them.
        """
        t = self._within(times)
        return self._bodies(t, *self.states(t), forces(self.run, *located(self.run, t)))

    def states(self, t: ArrayLike) -> tuple[Array, Array]:
        """Modal displacements and velocities (n, J) of all bodies, one after the other, at times
        (n,); exact between the nodes too."""
        a = self.assembly
        return states(self.run, a.system, *self._located(t))

    def coordinates(self, t: ArrayLike, body: str = "structure") -> Array:
        """The coordinates of a body's model: lambda_0 ... lambda_N for `AntiOscillators`.

        `t` of shape (n,) gives (n, C), a single time (C,). They are those of its form in free modes
        (`of`): one for each hidden rigid-body motion of a free body follows lambda.
        """
        name, times = self.name_of(body), self._within(t)
        _, own = self.of(name)
        a = self.assembly
        q, _ = self.states(times)
        acting = a.pushes(times) - forces(self.run, *located(self.run, times)) @ a.G
        acting = acting[:, a.columns[name]]
        found = own.coordinates(q[:, a.spans[name]], acting)
        return found if np.ndim(t) else found[0]

    def field(self, t: ArrayLike, body: str = "structure") -> Array:
        """Nodal displacements (n_dofs,) of a body at one time, (n, n_dofs) at several [m].

        Article eq. (8). `body`: of a model with shapes.
        """
        model, own = self.of(body)
        if own.basis is None:
            raise InputError(no_field(model))
        return own.field(self.coordinates(t, body))

    def of(self, body: str) -> tuple[Any, ModalBody | SiteModes]:
        """The model of a body, and its form in free modes.

        "structure", if no body has this name, is the one that has displacement shapes.
        """
        placed = self.assembly.bodies[self.name_of(body)]
        if isinstance(placed.body, RigidBody):
            raise InputError(f"{body!r} is a RigidBody, which has no field.")
        return placed.body, placed.modes

    def name_of(self, body: str) -> str:
        """The name among `bodies` that `body` stands for, see `of`."""
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
        """The free body that turned most by a step's end, and how far [rad]; ("", 0.0) without one.

        Of bodies whose inertia in space is known.
        """
        a = self.assembly
        if not a.turns:
            return "", 0.0
        return largest_rotation(self.run, a.system, a.bodies, a.spans)

    # -- inside

    @cached_property
    def _record(self) -> Record:  # type: ignore[override]
        """What its contacts share with it, and not the history itself: it goes without a cycle.

        The few flights of an impact have nodes for a picture; a scene may have many.
        """
        return Record(self.assembly, self.run, not self.named)

    @property
    def _nodes(self) -> Run:
        return self._record.nodes

    @property
    def _row(self) -> int:  # type: ignore[override]
        """That of the one contact."""
        if len(self.assembly.laws) > 1:
            pairs = ", ".join(f"hit{list(c.ends)}" for c in self.contact_histories)
            raise SeveralContactsError(
                f"the scene has several contacts: ask for the force or motion of one, as {pairs}."
            )
        return 0

    @property
    def _ends(self) -> list[Placed]:
        """The bodies of the one contact."""
        contact = self.assembly.scene.contacts[self._row]
        return [self.assembly.bodies[end.partition(":")[0]] for end in (contact.a, contact.b)]

    @property
    def _moving(self) -> BodyHistory:
        """The structure, if its momentum is known."""
        found = self.bodies[self._ends[0].name]
        if found.placed.inertia is None:
            raise InputError(
                f"the momentum of {type(self.model).__name__} is not known: extract the model from "
                "a mesh whose supports permit a rigid-body motion."
            )
        return found

    @cached_property
    def _sites(self) -> Array:
        """Displacement and velocity of both ends of the one contact along it, (4, n)."""
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
        if a.system.first is not None:
            accelerations -= braked(self.run, a.system, *located(self.run, time))
        elif a.system.damped:
            accelerations -= 2 * a.system.decay * v
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

    def _located(self, t: ArrayLike) -> tuple[Index, Array]:
        return located(self.run, self._within(t))

    def _within(self, t: ArrayLike) -> Array:
        """Times (n,) of the run; InputError for others."""
        times = checks.column("t", t)
        end = float(self.run.time[-1])
        outside = (times < 0) | (times > end * (1 + 1e-12))
        if np.any(outside):
            raise InputError(
                f"t must lie within the run, 0 <= t <= {end:g} s; got {times[outside][0]:g} s."
            )
        return np.minimum(times, end)

    def __getstate__(self) -> dict[str, Any]:
        """The fields, for pickle; a structure stays behind."""
        return {f.name: getattr(self, f.name) for f in fields(self)} | {"structure": None}


class SceneHistory(History):
    """History of `Scene.run`: its tables name every contact and body of the scene."""

    named = True


def with_model(hit: History, model: Any, **changes: Any) -> History:
    """The same history with the structure's model told more of itself, and other `changes`."""
    own = hit._ends[0]
    bodies = {**hit.assembly.bodies, own.name: replace(own, body=model)}
    assembly = replace(hit.assembly, parts=known(hit.assembly.scene, bodies))
    return replace(hit, assembly=assembly, **changes)


def no_field(model: object) -> str:
    """Why a model has no displacement field, and the remedy."""
    name = type(getattr(model, "body", model)).__name__
    return (
        f"{name} has no displacement field: it has no shapes (model files do not store them); "
        "extract the model again to recover fields."
    )
