"""Motion and energy of one body of a history, and peak displacements of many from their forces.

The motion is in the coordinates of the body's model, with its time derivatives. The equations of
motion in modal coordinates give the accelerations from the displacements, the velocities and the
forces; nothing is differentiated numerically.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks, march
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import Brief
from antiosc.models.body import LinearBody
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
    else:
        model, own = history.of(body)
    if own.basis is None:
        raise InputError(no_field(model))
    return own


def times_of(history: Motions, times: ArrayLike | None) -> Array:
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
        return own.amplitudes(history.coordinates(times, body))
    q, forces = _modal(history, times, body, derivative)
    return _factors(own, q, np.zeros_like(forces) if derivative else forces)


def of_unit_energies(own: ModalBody | SiteModes) -> tuple[Array, int]:
    """Factors (2, B) of the body's shapes, and the number of its elastic modes.

    They make q'Kq, and q'Mq, of each of these modes 1.
    """
    elastic = own.omega > 0
    q = np.vstack([np.where(elastic, 1 / np.where(elastic, own.omega, 1.0), 0.0), elastic])
    return _factors(own, q, np.zeros((2, own.B.shape[1]))), int(elastic.sum())


def _factors(own: ModalBody | SiteModes, q: Array, forces: Array) -> Array:
    """Factors (n, B) of the body's shapes for modal displacements (n, J) and forces (n, P)."""
    return own.amplitudes(own.coordinates(q, forces))


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


#: Bodies processed together, and times at which u is evaluated in addition to those of the force:
#: at least, at most, and in a period of the first mode.
BODIES_AT_ONCE, SAMPLES, MOST_SAMPLES, A_PERIOD = 200, 200, 20_000, 40
#: Times [s] and the force [N] at them, linear between them and zero outside.
Force = tuple[Array, Array]


def peak_deflections(
    bodies: Sequence[LinearBody], forces: Sequence[Force], duration: float
) -> Array:
    """Largest displacement u [m] of each body's site along the impact, up to `duration` [s].

    Parameters
    ----------
    bodies : sequence of LinearBody
        At rest at the start.
    forces : sequence of (time, force)
        The force [N] on each, linear between its times [s] and zero outside them.
    duration : float
        [s].

    Returns
    -------
    ndarray, shape (S,)
        Exact at the times of the force, and at 200 times over the duration or more: 40 a period of
        the first mode.
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
        _padded([m.omega for m in modal], 0.0),
        _padded([m.b for m in modal], 0.0),
        _padded([np.zeros(m.b.size) if m.decay is None else m.decay for m in modal], 0.0),
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
    """Of bodies at rest: (time (S,), modal displacements (S, J), force (S,)), for time after time.

    At the times of each force [s] and at `samples` over the duration; the last one is repeated
    where a body has fewer than another. `omega`, `b`, `decay`: (S, J) of the modes.
    """
    even = np.linspace(0, duration, samples)
    times = [np.union1d(even, time) for time, _ in forces]
    steps = zip(times, forces, strict=True)
    force = [
        np.interp(at, t, F, left=0.0, right=0.0) if t.size else np.zeros_like(at)
        for at, (t, F) in steps
    ]
    time, F = _padded(times, None), _padded(force, 0.0)
    q, v = np.zeros_like(b), np.zeros_like(b)
    for k in range(time.shape[1] - 1):
        h = time[:, k + 1] - time[:, k]
        P, W, S, J0, J1, _ = march.responses(omega, decay, h[:, None])
        rise = (b.T * ((F[:, k + 1] - F[:, k]) / np.where(h > 0, h, 1.0))).T
        push = b * F[:, k, None]
        q, v = (
            P * q + S * v + push * J0 + rise * J1,
            W * v - omega**2 * S * q + push * S + rise * J0,
        )
        yield time[:, k + 1], q, F[:, k + 1]


def _padded(rows: Sequence[Array], filler: float | None) -> Array:
    """Rows of different length as one array; None repeats the last value."""
    size = max(row.size for row in rows)
    return np.array(
        [
            np.pad(row, (0, size - row.size), constant_values=row[-1] if filler is None else filler)
            for row in rows
        ]
    )
