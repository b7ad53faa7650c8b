"""`RunHistory`: the motion, forces and energies of all bodies of a run.

The motion is in the coordinates of the body's model, with its time derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike
from antiosc.base.errors import InputError
from antiosc.engine.march import Run
from antiosc.impact.assembly import Assembly
from antiosc.impact.bodies import RigidBody, SceneBody
from antiosc.impact.histories.energy import Energy, energy_balance
from antiosc.impact.histories.parts import BodyHistory, ContactHistory, OneContact, SceneRun
from antiosc.impact.states import (
    contact_forces,
    damping_states,
    modal_loads,
    modal_states,
    node_states,
    step_blocks,
    step_end_displacements,
    steps_at,
)
from antiosc.models.modal import ModalBody, SiteModes

if TYPE_CHECKING:
    from antiosc.impact.enclosure import Enclosure


class SeveralContactsError(InputError, AttributeError):
    """A result of a single contact is requested from a history with several contacts."""


@dataclass(frozen=True, init=False, eq=False, repr=False)
class RunHistory(OneContact):
    """Motion, forces and energies of a run: `History` without its tables and texts.

    `assembly`: the scene in modal coordinates; `run`: its integration; others as in `History`.
    """

    assembly: Assembly
    run: Run
    error: dict[str, float]
    status: int
    message: str
    given: float | None = None
    structure: object = None
    enclosures: tuple[Enclosure, ...] = ()

    #: Whether contacts and bodies have names given by the user (a scene).
    named: ClassVar[bool] = False

    # -- at the nodes

    def __getitem__(self, ends: tuple[str, str]) -> ContactHistory:
        for contact in self.contact_histories:
            if contact.ends == ends:
                return contact
        contact_names = ", ".join(str(contact.ends) for contact in self.contact_histories)
        raise InputError(f"there is no contact {ends!r} in the scene; it has {contact_names}.")

    @cached_property
    def contact_histories(self) -> list[ContactHistory]:
        """All contacts in the order of the scene."""
        contacts = self.assembly.scene.contacts
        return [ContactHistory((c.a, c.b), self._record, i) for i, c in enumerate(contacts)]

    @cached_property
    def bodies(self) -> dict[str, BodyHistory]:
        """Histories of the bodies by name, at the time nodes."""
        run = self._record.nodes
        a = self.assembly
        q, v = node_states(run, a.system)
        return self._bodies(run.time, q, v, run.force)

    @cached_property
    def energy(self) -> Energy:
        """Energies of all bodies and contacts, and their drift; `gravity`: work of all loads."""
        return energy_balance(self.assembly, self._record.nodes)

    @property
    def details(self) -> list[str]:
        """Sentences on contact laws from which a patch's compliance was subtracted."""
        return list(self.assembly.notes)

    # -- of one contact: force and numbers are those of `OneContact`

    @property
    def displacement(self) -> Array:
        """Displacement u of the structure's site [m], (n,), along the contact.

        For a supported structure it counts from its equilibrium under gravity, without the static
        deflection under its own weight.
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
        """Time step during contact [s]: the step set by the user, or the mean step."""
        if self.given is not None:
            return self.given

        numbers = self._numbers
        if not numbers.steps:
            return self.assembly.contact_time_estimate
        return float(numbers.closed / numbers.steps)

    @property
    def model(self) -> Any:
        """The body at the first site of the contact: the structure of `simulate`."""
        return self._ends[0].body

    @property
    def impactor(self) -> Any:
        """The body at the second site of the contact."""
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
        """Contact force [N] at times (n,): parabolic between the time nodes."""
        steps = steps_at(self.run, self._times_in_run(t))
        return np.maximum(contact_forces(self.run, *steps)[:, self._row], 0.0)

    # -- at any time

    def at(self, times: ArrayLike) -> dict[str, BodyHistory]:
        """The bodies by name at times (n,) [s] of the run, exact also between the time nodes.

        In flight the nodes may be far apart: do not interpolate between them.
        """
        t = self._times_in_run(times)
        return self._bodies(t, *self.states(t), contact_forces(self.run, *steps_at(self.run, t)))

    def states(self, t: ArrayLike) -> tuple[Array, Array]:
        """Modal displacements and velocities (n, J) of all bodies, concatenated, at times (n,)."""
        steps = steps_at(self.run, self._times_in_run(t))
        return modal_states(self.run, self.assembly.system, *steps)

    def coordinates(self, t: ArrayLike, body: str = "structure") -> Array:
        """The coordinates of a body's model: lambda_0 ... lambda_N for `AntiOscillators`.

        Shape (n, C) for times (n,), (C,) for a single time. Coordinates of hidden rigid-body
        motions of a free body, which move no site, follow lambda.
        """
        _, modes = self.of(body)
        motion = self.at(t)[self.name_of(body)]
        coordinates = modes.coordinates(motion.q, motion.forces)
        if np.ndim(t):
            return coordinates
        return coordinates[0]

    def of(self, body: str) -> tuple[object, ModalBody | SiteModes]:
        """(model of a body, its form in free modes).

        If no body is named "structure", this name means the body with displacement shapes.
        """
        scene_body = self.assembly.bodies[self.name_of(body)]
        if isinstance(scene_body.body, RigidBody):
            raise InputError(f"{body!r} is a RigidBody, which has no field.")
        return scene_body.body, scene_body.modes

    def name_of(self, body: str) -> str:
        """The key in `bodies` for the name `body`; see `of`."""
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
        """(name of the free body with the largest rotation, angle [rad]); ("", 0.0) if unknown."""
        a = self.assembly
        free = [b for b in a.bodies.values() if b.inertia is not None and not b.omega.all()]
        if not free:
            return "", 0.0

        q = step_end_displacements(self.run, a.system)
        angles = {}
        for body in free:
            rotation = body.rotation(q[:, a.stacked.spans[body.name]])
            angles[body.name] = float(np.linalg.norm(rotation, axis=1).max())

        most = max(angles, key=angles.__getitem__)
        return most, angles[most]

    # -- inside

    @cached_property
    def _record(self) -> SceneRun:  # type: ignore[override]
        """The run that all contacts share; for two bodies, with more time nodes in flight."""
        return SceneRun(self.assembly, self.run, not self.named, self.enclosures)

    @property
    def _row(self) -> int:  # type: ignore[override]
        """Row of the only contact in the system."""
        if len(self.assembly.laws) > 1:
            pairs = ", ".join(f"hit{list(c.ends)}" for c in self.contact_histories)
            raise SeveralContactsError(
                f"the scene has several contacts: ask for the force or motion of one, as {pairs}."
            )
        return 0

    @cached_property
    def _ends(self) -> list[SceneBody]:
        """The bodies of the only contact."""
        contact = self.assembly.scene.contacts[self._row]
        return [self.assembly.bodies[end.partition(":")[0]] for end in (contact.a, contact.b)]

    @property
    def _free_structure(self) -> BodyHistory:
        """The structure; InputError if its momentum is not known."""
        structure = self.bodies[self._ends[0].name]
        if structure.placed.inertia is None:
            raise InputError(
                f"the momentum of {type(self.model).__name__} is not known: extract the model from "
                "a mesh whose supports permit a rigid-body motion."
            )

        return structure

    @cached_property
    def _sites(self) -> Array:
        """Displacements and velocities of both sites in contact, along the contact: (4, n)."""
        a = self.assembly
        run = self._record.nodes
        rows = np.zeros((len(a.stacked.r), 2))
        for i, body in enumerate(self._ends):
            columns = a.stacked.columns[body.name]
            rows[columns, i] = (2 * i - 1) * a.G[self._row, columns]

        motion = np.empty((4, run.time.size))
        for first, last in step_blocks(run, a.system.omega.size):
            q, v = node_states(run, a.system, first, last)
            nodes = slice(2 * first, 2 * last + 1)
            motion[::2, nodes] = (q @ (a.stacked.B @ rows)).T
            motion[1::2, nodes] = (v @ (a.stacked.B @ rows)).T

        motion[::2] += ((a.external_forces(run.time) - run.force @ a.G) @ (a.stacked.r @ rows)).T

        return motion

    def _bodies(self, time: Array, q: Array, v: Array, force: Array) -> dict[str, BodyHistory]:
        a = self.assembly
        f = self.assembly.external_forces(time) - force @ a.G
        columns = q @ a.stacked.B + f @ a.stacked.r
        kinetic = 0.5 * v**2
        strain = 0.5 * (a.system.omega * q) ** 2
        load = modal_loads(a.system, time) - force @ a.system.beta
        accelerations = load - a.system.omega**2 * q
        springs: list[list[Array]] = [[] for _ in a.bodies]

        if a.system.first is not None:
            decelerations, springs = damping_states(self.run, a.system, *steps_at(self.run, time))
            accelerations -= decelerations
        elif a.system.has_damping:
            accelerations -= 2 * a.system.decay * v

        histories = {}
        for (name, body), branches in zip(a.bodies.items(), springs, strict=True):
            j = a.stacked.spans[name]
            k = a.stacked.columns[name]
            stretch = a.stretch_forces.get(name)
            stretching = 0.0 if stretch is None else stretch.energy(q[:, j] @ stretch.modes)
            residual = 0.5 * np.einsum("nk,kl,nl->n", f[:, k], a.stacked.r[k, k], f[:, k])
            histories[name] = BodyHistory(
                placed=body,
                time=time,
                q=q[:, j],
                v=v[:, j],
                a=accelerations[:, j],
                forces=f[:, k],
                kinetic=kinetic[:, j].sum(axis=1),
                strain=strain[:, j].sum(axis=1) + residual + stretching,
                _columns=columns[:, k],
                springs=branches,
                stretched=stretch,
            )

        return histories

    def _times_in_run(self, t: ArrayLike) -> Array:
        """Checked times (n,) within the run; InputError for others."""
        times = checks.column("t", t)
        end = float(self.run.time[-1])
        is_outside = (times < 0) | (times > end * (1 + 1e-12))
        if np.any(is_outside):
            raise InputError(
                f"t must lie within the run, 0 <= t <= {end:g} s; got {times[is_outside][0]:g} s."
            )

        return np.minimum(times, end)

    def __getstate__(self) -> dict[str, object]:
        """The fields for pickle, without the structure."""
        return {f.name: getattr(self, f.name) for f in fields(self)} | {"structure": None}
