"""Factors by which a body's shapes add up to its motion, and their time derivatives.

The equations of motion in modal coordinates give the accelerations from the displacements, the
velocities and the forces; nothing is differentiated numerically.
"""

from __future__ import annotations

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike
from antiosc.base.errors import InputError
from antiosc.impact.histories.motion import RunHistory
from antiosc.impact.histories.parts import BodyHistory
from antiosc.models.modal import ModalBody, SiteModes
from antiosc.models.stretch import Stretch, stretch_of

#: Objects from which the motion of a body is evaluated.
AnyHistory = RunHistory | BodyHistory
#: Number of times whose motion is in memory at once.
TIMES_AT_ONCE = 2000


def no_field_message(model: object) -> str:
    """Message on why a model has no displacement field, with the remedy."""
    name = type(getattr(model, "body", model)).__name__
    return (
        f"{name} has no displacement field: it has no shapes (model files do not store them); "
        "extract the model again to recover fields."
    )


def _model_modes_stretch(
    history: AnyHistory, body: str
) -> tuple[object, ModalBody | SiteModes, Stretch | None]:
    """(model of a body, its free modes, its second-order forces or None)."""
    if isinstance(history, BodyHistory):
        return history.placed.body, history.placed.modes, history.stretched
    return *history.of(body), history.assembly.stretch_forces.get(history.name_of(body))


def modes_with_shapes(history: AnyHistory, body: str) -> ModalBody | SiteModes:
    """The free modes of a body with its shapes; InputError for a body without shapes."""
    model, modes, _ = _model_modes_stretch(history, body)
    if modes.basis is None:
        raise InputError(no_field_message(model))
    return modes


def checked_times(history: AnyHistory, times: ArrayLike | None) -> Array:
    """Checked times (n,); default: the times of the history."""
    if times is None:
        return history.time
    if isinstance(history, BodyHistory):
        raise InputError(
            "the motion of a body of a scene is known at its own times: probe "
            "hit.at(times)[name], or the scene's history with body=name."
        )

    return checks.nonempty("times", times)


def _motion_at(history: AnyHistory, times: Array, body: str) -> BodyHistory:
    """Motion of a body at `times`; a BodyHistory is returned as it is, at its own times."""
    if isinstance(history, BodyHistory):
        return history
    return history.at(times)[history.name_of(body)]


def stretch_of_motion(history: AnyHistory, body: str) -> Stretch | None:
    """The second-order forces in the motion of a body; None for a linear motion."""
    return _model_modes_stretch(history, body)[2]


def stretch_shapes(history: AnyHistory, body: str) -> Array | None:
    """Second-order displacements (n_dofs, P) of a body's pairs of modes; None if it is linear."""
    model, _, forces = _model_modes_stretch(history, body)
    stretch = stretch_of(model)
    if forces is None or stretch is None or (shapes := stretch.shapes_in(forces.modes)) is None:
        return None

    modes = modes_with_shapes(history, body)
    turn = stretch.modes.T @ forces.modes
    rows, columns = np.triu_indices(forces.size)
    following = stretch.modes @ stretch.following(turn, modes.omega)[:, rows, columns]

    return shapes + modes.field((modes.shape @ following).T).T


def shape_factors(history: AnyHistory, times: Array, body: str, derivative: int = 0) -> Array:
    """Factors (n, B) of the body's shapes at `times`, or their first or second derivatives.

    With second-order forces, factors of pairs of modes follow: (n, B + m (m + 1)/2). Velocities and
    accelerations are of the modes only, without the residual compliance, which follows the force.
    """
    modes = modes_with_shapes(history, body)
    motion = _motion_at(history, times, body)
    q = (motion.q, motion.v, motion.a)[derivative]
    linear = _factors_of_displacements(modes, q, None if derivative else motion.forces)
    forces = stretch_of_motion(history, body)
    if forces is None:
        return linear

    a, v, w = (values @ forces.modes for values in (motion.q, motion.v, motion.a))
    return np.hstack([linear, forces.pair_motion(a, v, w, derivative)])


def stretch_factors(history: AnyHistory, body: str) -> Array:
    """Factors (m, B) of the body's shapes for the modes with second-order forces."""
    modes = modes_with_shapes(history, body)
    forces = stretch_of_motion(history, body)
    assert forces is not None
    return _factors_of_displacements(modes, forces.modes.T)


def spring_amplitudes(history: AnyHistory, times: Array, body: str) -> list[Array]:
    """Factors (n, B) of the shapes for the spring of each Maxwell branch, at `times`."""
    modes = modes_with_shapes(history, body)
    return [_factors_of_displacements(modes, q) for q in _motion_at(history, times, body).springs]


def unit_energy_factors(modes: ModalBody | SiteModes) -> tuple[Array, int]:
    """(factors (2, B) of shapes in a sum of elastic modes of q'Kq = 1, q'Mq = 1; their number)."""
    elastic = modes.omega > 0
    q = np.vstack([np.where(elastic, 1 / np.where(elastic, modes.omega, 1.0), 0.0), elastic])
    return _factors_of_displacements(modes, q), int(elastic.sum())


def _factors_of_displacements(
    modes: ModalBody | SiteModes, q: Array, forces: Array | None = None
) -> Array:
    """Factors (n, B) of the body's shapes for modal displacements (n, J) and forces (n, P)."""
    if forces is None:
        forces = np.zeros((len(q), modes.B.shape[1]))
    return modes.amplitudes(modes.coordinates(q, forces))


def modal_amplitudes(
    history: RunHistory, times: Array, body: str, derivative: int
) -> tuple[Array, Array, Array]:
    """(frequencies (J,) of a body's modes, their factors (J, B), largest amplitudes (J,) of the
    `derivative` without the quasi-static response; 0 for rigid-body modes)."""
    modes = modes_with_shapes(history, body)
    omega = modes.omega

    swing = np.zeros(modes.omega.size)
    sizes = np.zeros(modes.omega.size)
    for block in np.array_split(times, -(-len(times) // TIMES_AT_ONCE)):
        motion = _motion_at(history, block, body)
        # of the oscillation x: x' = v and x'' = a
        swing = np.maximum(swing, np.hypot(omega * motion.v, motion.a).max(axis=0))

    np.divide(swing, omega ** (2 - derivative), out=sizes, where=omega > 0)
    return omega, _factors_of_displacements(modes, np.eye(omega.size)), sizes


def column_forces(history: AnyHistory, times: Array, body: str) -> Array:
    """Forces (n, P) [N] of contacts and loads along the P site directions of a body."""
    modes_with_shapes(history, body)
    return _motion_at(history, times, body).forces
