"""The result of a simulation: force, motion, energy and momentum."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, Index
from antiosc.base.errors import InputError
from antiosc.charts.histories import plot_history
from antiosc.models.body import places_of
from antiosc.models.modal import ModalBody
from antiosc.simulation.contact_energy import replay, stored_alone
from antiosc.simulation.energy import Energy
from antiosc.simulation.error_bars import ErrorBudget
from antiosc.simulation.integrators import Problem, Trajectory
from antiosc.simulation.results import HistoryResults, covered

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Body = Literal["structure", "impactor"]
#: Modal states up to this size are kept; larger ones are computed anew at each use.
KEPT_BYTES = 1 << 26


@dataclass(frozen=True, eq=False, repr=False)
class History(HistoryResults):
    """History of an impact; times in s, forces in N, displacements in m along the direction d.

    Attributes
    ----------
    status : 0: completed; 1: completed, tol not met; 2: stopped before the end; 3: completed, but
        the bodies are in contact at the end: contact time, impulse and peak force count up to the
        end.
    message : explanation of the status, and changes made to the contact law.
    step : the step used during contact [s].
    error : estimated relative errors reached: "force" (L2 norm) and "peak"; empty when the step
        was given. With n="auto" also "truncation peak_force", "... impulse", "... contact_time";
        "dampers": of the coupling of modes by dampers, the largest in these three.
    budget : what makes the `error_budget` of a run of `simulate`.
    structure : of `strike`, the structure of the last mesh, for `probe` and fields; not pickled.
    """

    problem: Problem
    bodies: tuple[ModalBody, ModalBody]
    model: Any
    impactor: Any
    trajectory: Trajectory
    step: float
    error: dict[str, float]
    status: int
    message: str
    budget: Callable[[History], ErrorBudget] | None = None
    structure: Any = None

    # -- at the nodes

    @cached_property
    def time(self) -> Array:
        """Nodes [s], ascending from 0, (n,). Two segments share their common node."""
        return self._joined([s.time for s in self.trajectory.segments])

    @cached_property
    def force(self) -> Array:
        """Contact force [N], >= 0, (n,).

        Under contact the exact method takes the parabola through the nodes at 0, h/2 and h of a
        step, which `force_at`, impulse, peak, fields and states follow.
        """
        return self._joined([s.force for s in self.trajectory.segments])

    @cached_property
    def indentation(self) -> Array:
        """w - u - gap [m], (n,); negative: distance."""
        return self._joined([s.indentation() for s in self.trajectory.segments])

    @cached_property
    def displacement(self) -> Array:
        """Displacement u of the structure's site [m], (n,)."""
        s, b = self._size, self.bodies[0].b
        (moved,) = self._reduced(lambda q, v: (q[:, :s] @ b,))
        return np.asarray(moved + self.bodies[0].r * self.force)

    @cached_property
    def velocity(self) -> Array:
        """Velocity of the structure's site [m/s], (n,), without the residual compliance."""
        s, b = self._size, self.bodies[0].b
        return self._reduced(lambda q, v: (v[:, :s] @ b,))[0]

    @cached_property
    def impactor_displacement(self) -> Array:
        """Displacement w of the impactor's contact point [m], (n,)."""
        s, b = self._size, self.bodies[1].b
        (moved,) = self._reduced(lambda q, v: (q[:, s:] @ b,))
        return np.asarray(moved - self.bodies[1].r * self.force)

    @cached_property
    def impactor_velocity(self) -> Array:
        """Velocity w' of the impactor's contact point [m/s], (n,)."""
        s, b = self._size, self.bodies[1].b
        return self._reduced(lambda q, v: (v[:, s:] @ b,))[0]

    # -- numbers

    @property
    def peak_force(self) -> float:
        """Largest contact force [N], also between the nodes."""
        return self.trajectory.peak_force

    @property
    def impulse(self) -> float:
        """Time integral of the contact force [N s]."""
        return self.trajectory.impulse

    @cached_property
    def cumulative_impulse(self) -> Array:
        """Time integral of the force from the start up to each node [N s], (n,)."""
        step, force = np.diff(self.time), self.force
        areas = step * (force[1:] + force[:-1]) / 2 - self._bend[:-1] * step**3 / 12
        return np.append(0.0, np.cumsum(areas))

    @property
    def contacts(self) -> list[tuple[float, float]]:
        """(start, end) [s] of every contact, in order."""
        return [(c.start, c.end) for c in self.trajectory.contacts]

    @property
    def contact_time(self) -> float:
        """Time from the first touch to the last release of the main impact [s]; 0 without contact.

        Successive contacts belong to one impact if the flight between them is shorter than the
        impact up to then. The main impact is the one with the largest impulse. A contact that goes
        on at the end of the run counts up to there (status 3).
        """
        return self.trajectory.contact_time

    @property
    def restitution(self) -> float | None:
        """Newton's coefficient of restitution of the rigid-body motions.

        The speed of separation at the contact point after the last release, divided by the speed of
        approach at the first touch. Both are speeds of the rigid-body motions, without vibration. A
        supported structure has no rigid-body motion at its site; the coefficient is then the
        rebound speed of the impactor over its speed of approach. None without a contact, if the
        bodies are in contact at the end, or if they did not approach each other.
        """
        return self.trajectory.restitution

    @cached_property
    def error_budget(self) -> ErrorBudget:
        """Bars of peak force, impulse and contact time: mesh, truncation, time, patch, total.

        Relative errors, as `hit.error_budget["peak_force"].total`; printed, they are a table. The
        impact is simulated some more times when this is first asked for. InputError for a model
        that was extracted without `error="estimate"`.
        """
        if self.budget is None:
            raise InputError("only a History that simulate or strike returned has an error budget.")
        return self.budget(self)

    @cached_property
    def momentum(self) -> Array:
        """Momentum of the structure (n, 3) [kg m/s], in the axes of its mesh."""
        return self._momenta[:, :3]

    @cached_property
    def angular_momentum(self) -> Array:
        """Angular momentum of the structure (n, 3) [kg m^2/s] about its centre of mass at rest."""
        return self._momenta[:, 3:]

    @cached_property
    def energy(self) -> Energy:
        """Energies of both whole bodies, and their drift."""
        p = self.problem
        stored, lost = self._contact_energy
        kinetic, strain, power, work = self._reduced(
            lambda q, v: (
                0.5 * np.sum(v**2, axis=1),
                0.5 * np.sum((p.omega * q) ** 2, axis=1),
                np.sum(2 * p.decay * v**2, axis=1),
                (q - p.q) @ p.load,
            )
        )
        braked = np.append(0.0, np.cumsum(np.diff(self.time) * (power[:-1] + power[1:]) / 2))
        return Energy(
            kinetic=kinetic,
            strain=strain + 0.5 * p.r * self.force**2,
            contact=stored,
            dissipated=lost + braked,
            gravity=work,
        )

    # -- at any time

    def states(self, t: ArrayLike) -> tuple[Array, Array]:
        """Modal displacements and velocities (n, J) of both bodies at times (n,).

        Between two nodes the motion is the exact response to the force there.
        """
        times, index = self._locate(t)
        q, v = self._at_nodes(index)
        since, before = times - self.time[index], self.force[index]
        now, bend = self.force_at(times), self._bend[index]
        return self.problem.forced(q, v, since, before, now, bend)

    def force_at(self, t: ArrayLike) -> Array:
        """Contact force [N] at times (n,), as the method takes it between the nodes."""
        return self.trajectory.force_at(self._locate(t)[0])

    def of(self, body: Body) -> tuple[Any, ModalBody]:
        """The model of the "structure" or the "impactor", and its modal form."""
        checks.choice("body", body, get_args(Body))
        return ((self.model, self.bodies[0]), (self.impactor, self.bodies[1]))[body == "impactor"]

    def coordinates(self, t: ArrayLike, body: Body = "structure") -> Array:
        """The coordinates of a body's model: lambda_0 ... lambda_N for `AntiOscillators`.

        `t` of shape (n,) gives (n, N + 1), a single time (N + 1,). One coordinate for each hidden
        rigid-body motion of a free body follows lambda.
        """
        q, _ = self.states(t)
        force = self.force_at(t)
        own = self.of(body)[1].coordinates(self._part(q, body), force)
        return own if np.ndim(t) else own[0]

    def field(self, t: ArrayLike, body: Body = "structure") -> Array:
        """Nodal displacements (n_dofs,) at one time, (n, n_dofs) at several. Article eq. (8).

        `body`: "structure", or "impactor" if that is a model with shapes.
        """
        model, own = self.of(body)
        if own.basis is None:
            raise InputError(no_field(model))
        return own.field(self.coordinates(t, body))

    def summary(self) -> str:
        """The numbers of the impact as a short table."""
        e = self.restitution
        rows = [
            *(("site", checks.in_words(point)) for point in places_of(self.model).values()),
            ("peak force", f"{self.peak_force:.6g} N"),
            ("impulse", f"{self.impulse:.6g} N s"),
            ("contacts", f"{len(self.contacts)}"),
            ("contact time", f"{self.contact_time:.6g} s"),
            ("restitution", "-" if e is None else f"{e:.4f}"),
            ("energy drift", f"{self.energy.drift:.1e}"),
            ("step", f"{self.step:.3g} s"),
            ("force error", covered(self)),
            ("status", self.message),
        ]
        return "\n".join(f"{name:<13} {value}" for name, value in rows)

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """Force and motions as a matplotlib figure; see `antiosc.plotting.plot_history`.

        With `path` (PNG, PDF, SVG, …) the picture is written, and the path returned.
        """
        return plot_history(self, path)

    # -- inside

    @property
    def _size(self) -> int:
        return int(self.bodies[0].omega.size)

    def _part(self, q: Array, body: Body) -> Array:
        """A body's own modal states among those of both.

        Those of the impactor are along the impact, opposite to the direction of force in its model.
        """
        return q[:, : self._size] if body == "structure" else -q[:, self._size :]

    @cached_property
    def _momenta(self) -> Array:
        inertia = self.bodies[0].inertia
        if inertia is None:
            raise InputError(
                f"the momentum of {type(self.model).__name__} is not known: extract the model from "
                "a mesh whose supports permit a rigid-body motion."
            )
        (moved,) = self._reduced(lambda q, v: (self._part(v, "structure") @ inertia.momentum,))
        return inertia.moved(moved, inertia.centre)

    def _joined(self, pieces: Sequence[Array]) -> Array:
        """Segments end to end, the common nodes once."""
        return np.concatenate([pieces[0], *(p[1:] for p in pieces[1:])])

    @cached_property
    def _bend(self) -> Array:
        """Second derivative of the force behind each node (n,)."""
        segments = self.trajectory.segments
        return np.append(self._joined([np.append(0.0, s.bends) for s in segments])[1:], 0.0)

    @cached_property
    def _modal_states(self) -> tuple[Array, Array] | None:
        """Modal displacements and velocities (n, J) at the nodes; None where they are large."""
        if 8 * self.time.size * self.problem.omega.size > KEPT_BYTES:
            return None
        states = [s.states() for s in self.trajectory.segments]
        return self._joined([q for q, _ in states]), self._joined([v for _, v in states])

    def _reduced(self, of: Callable[[Array, Array], tuple[Array, ...]]) -> tuple[Array, ...]:
        """What `of` gives of modal states (n, J) at the nodes, segment by segment where they are
        large."""
        if self._modal_states is not None:
            return of(*self._modal_states)
        parts = [of(*s.states()) for s in self.trajectory.segments]
        return tuple(self._joined(each) for each in zip(*parts, strict=True))

    def _at_nodes(self, index: Index) -> tuple[Array, Array]:
        """Modal states (., J) at some nodes."""
        if self._modal_states is not None:
            return self._modal_states[0][index], self._modal_states[1][index]
        q, v = (np.empty((index.size, self.problem.omega.size)) for _ in range(2))
        first = 0
        for segment in self.trajectory.segments:
            last = first + segment.time.size - 1
            here = np.flatnonzero((index >= first) & (index <= last))
            if here.size:
                q[here], v[here] = (each[index[here] - first] for each in segment.states())
            first = last
        return q, v

    def _locate(self, t: ArrayLike) -> tuple[Array, Index]:
        times = checks.column("t", t)
        end = float(self.time[-1])
        outside = (times < 0) | (times > end * (1 + 1e-12))
        if np.any(outside):
            raise InputError(
                f"t must lie within the run, 0 <= t <= {end:g} s; got {times[outside][0]:g} s."
            )
        times = np.minimum(times, end)
        return times, np.searchsorted(self.time, times, side="right") - 1

    @cached_property
    def _contact_energy(self) -> tuple[Array, Array]:
        """Recoverable and lost energy of the contact law, along the nodes."""
        law, contacts = self.problem.law, self.trajectory.contacts
        if not (law.has_memory or law.rate_dependent):
            return stored_alone(law, self.force, self.indentation), np.zeros(self.time.size)
        sizes = [s.time.size - 1 for s in self.trajectory.segments]
        first = np.concatenate(([0], np.cumsum(sizes)))
        spans = [(int(first[c.segments[0]]), int(first[c.segments[1]])) for c in contacts]
        stored, lost, damping = replay(
            law, self.force, self.indentation, spans, [c.speed for c in contacts]
        )
        if law.rate_dependent:
            work = 0.5 * (damping[1:] + damping[:-1]) * np.diff(self.indentation)
            lost = lost + np.append(0.0, np.cumsum(work))
        return stored, lost


def no_field(model: Any) -> str:
    """Why a model has no displacement field, and the remedy."""
    name = type(getattr(model, "body", model)).__name__
    return (
        f"{name} has no displacement field: it has no shapes (model files do not store them); "
        "extract the model again to recover fields."
    )
