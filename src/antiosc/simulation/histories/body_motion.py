"""Motion and energy of one body of a history.

The motion is in the coordinates of the body's model, with its time derivatives. The equations of
motion in modal coordinates give the accelerations from the displacements, the velocities and the
forces; nothing is differentiated numerically.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.brief import Brief
from antiosc.base.errors import InputError
from antiosc.models.modal import ModalBody
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.histories.history import History, no_field
from antiosc.simulation.histories.scene_history import BodyHistory

#: What knows the motion of a body.
Motions = History | BodyHistory


def modes_of(history: Motions, body: str) -> ModalBody | SiteModes:
    """The free modes of a body with its shapes; InputError for a body without shapes."""
    if isinstance(history, BodyHistory):
        model, own = history.placed.body, history.placed.modes
        if own is None:
            raise InputError(no_field(model))
    else:
        model, own = history.of(body)
    if own.basis is None:
        raise InputError(no_field(model))
    return own


def times_of(history: Motions, times: Any) -> Array:
    """The times (n,) that are asked; those of the history for None."""
    if times is None:
        return history.time
    if isinstance(history, BodyHistory):
        raise InputError(
            "the motion of a body of a scene is known at its own times: probe "
            "hit.at(times)[name], or the scene's history with body=name."
        )
    return checks.filled("times", times)


def amplitudes(history: Motions, times: Array, body: str, derivative: int = 0) -> Array:
    """Factors (n, B) of the body's shapes at `times`, or their first or second derivatives.

    Velocities and accelerations are those of the modes: what a residual compliance adds to the
    displacement has no inertia, and follows the force.
    """
    own = modes_of(history, body)
    if derivative == 0 and not isinstance(history, BodyHistory):
        x = history.coordinates(times, body)
        return own.amplitudes(x)
    q, forces = _modal(history, times, body, derivative)
    return _factors(own, q, np.zeros_like(forces) if derivative else forces)


def _factors(own: ModalBody | SiteModes, q: Array, forces: Array) -> Array:
    """Factors (n, B) of the body's shapes for modal displacements (n, J) and forces (n, P)."""
    loads = forces if isinstance(own, SiteModes) else forces[:, 0]
    return own.amplitudes(own.coordinates(q, loads))


def modal_sizes(
    history: Motions, times: Array, body: str, derivative: int
) -> tuple[Array, Array, Array]:
    """Frequencies (J,) of a body's modes, their factors (J, B), and their largest amplitudes (J,).

    The amplitudes are those of the oscillations at `times`, or of their derivatives, without what
    follows the forces slowly; those of rigid-body modes are zero.
    """
    own = modes_of(history, body)
    (v, forces), (a, _) = (_modal(history, times, body, k) for k in (1, 2))
    omega = own.omega
    # of the oscillation x: x' = v and x'' = a
    swing = np.hypot(omega * v, a).max(axis=0)
    sizes = np.zeros(omega.size)
    np.divide(swing, omega ** (2 - derivative), out=sizes, where=omega > 0)
    shapes = _factors(own, np.eye(omega.size), np.zeros((omega.size, forces.shape[1])))
    return omega, shapes, sizes


def _modal(history: Motions, times: Array, body: str, derivative: int) -> tuple[Array, Array]:
    """Modal displacements, velocities or accelerations (n, J), and the forces (n, P)."""
    one = history if isinstance(history, BodyHistory) else history.at(times)[history.name_of(body)]
    return (one.q, one.v, one.a)[derivative], one.forces


def forces_of(history: Motions, times: Array, body: str) -> Array:
    """Forces (n, P) on the columns of the body's model: of contacts and of loads, N."""
    modes_of(history, body)
    return _modal(history, times, body, 0)[1]


@dataclass(frozen=True, eq=False, repr=False)
class BodyEnergy(Brief):
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
    """Energies of one body: "structure" or "impactor"; of a scene its name.

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
    """Share of the kinetic energy at the start that vibrates in all bodies at the end.

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
