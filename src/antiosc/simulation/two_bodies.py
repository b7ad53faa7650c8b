"""An impact of two bodies in the coordinates of their modes: start, gravity, contact.

The signs are those of `antiosc.simulation.simulate`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc.contact import ContactLaw, Hertz
from antiosc.models.body import LinearBody, checked_body
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion
from antiosc.simulation.integrators import Problem

#: Largest phase of a motion [rad]: rounding leaves some 0.1 rad of it.
LARGEST_PHASE = 1e15
LAW = "a ContactLaw such as Hertz(stiffness)"


def assemble(
    model: LinearBody,
    impactor: LinearBody,
    law: ContactLaw,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
    gap: float | None = None,
) -> tuple[Problem, tuple[ModalBody, ModalBody]]:
    """The problem an integrator sees, and the two bodies in the order (structure, impactor)."""
    one, other = checked_body("model", model), checked_body("impactor", impactor)
    checks.instance("contact", law, ContactLaw, LAW)
    structure, striker = one.modal(), other.modal()
    decays = [np.zeros(b.omega.size) if b.decay is None else b.decay for b in (structure, striker)]
    size = structure.omega.size + striker.omega.size
    problem = Problem(
        omega=np.concatenate((structure.omega, striker.omega)),
        decay=np.concatenate(decays),
        beta=np.concatenate((-structure.b, striker.b)),
        r=structure.r + striker.r,
        load=np.concatenate(_loads(structure, striker, gravity)),
        gap=other.gap if gap is None else checks.nonnegative("gap", gap, "m"),
        q=np.zeros(size),
        v=np.concatenate(_starts(structure, striker, initial_velocity, other.velocity)),
        law=law,
    )
    return problem, (structure, striker)


# The model of a striking body is made like a structure's: its direction is that in which the
# contact pushes it. Its modal coordinates count here along the impact, against that direction.


def _starts(
    structure: ModalBody, striker: ModalBody, initial: float | Motion, speed: float | Motion
) -> tuple[Array, Array]:
    """Modal velocities of both bodies; numbers are > 0 when they close the gap."""
    if not isinstance(initial, Motion):
        initial = -checks.number("initial_velocity", initial, "m/s")
    own = striker.rigid_motion(speed)
    return structure.rigid_motion(initial), -own if isinstance(speed, Motion) else own


def _loads(
    structure: ModalBody, striker: ModalBody, gravity: float | Sequence[float]
) -> tuple[Array, Array]:
    """Modal forces of gravity on both bodies."""
    listed = isinstance(gravity, list | tuple)
    if not (listed or (isinstance(gravity, np.ndarray) and gravity.ndim)):
        along = checks.number("gravity", gravity, "m/s^2")
        return _pull("structure", structure, along), _pull("impactor", striker, along)
    vector = checks.array("gravity", gravity, (3,))
    if structure.direction is None:
        raise InputError(
            "gravity as a vector needs a model that knows the direction of impact: extract it from"
            " a mesh, or give gravity as a number along the impact."
        )
    along = float(vector @ structure.direction)
    loads = []
    for name, body, sign in (("structure", structure, 1.0), ("impactor", striker, -1.0)):
        if body.inertia is None:
            loads.append(_pull(name, body, along))
        else:
            loads.append(_falling(body, sign * body.inertia.momentum[:, :3] @ vector))
    return loads[0], loads[1]


def _pull(name: str, body: ModalBody, gravity: float) -> Array:
    """Modal forces of gravity along the impact."""
    if gravity == 0.0 or not np.any(body.omega == 0):
        return np.zeros(body.omega.size)
    if body.weight is None:
        raise InputError(
            f"gravity on a {name} with a rigid-body mode needs the model's participation;"
            f" extract the model anew, give participation=, or set gravity=0."
        )
    return _falling(body, gravity * body.weight)


def _falling(body: ModalBody, load: Array) -> Array:
    """`load` on free bodies; none on a body with a supported site, measured from its
    equilibrium."""
    rigid = body.omega == 0
    return load if np.any(rigid & (body.b != 0)) else np.where(rigid, load, 0.0)


def without_patch(
    law: ContactLaw, model: LinearBody, impactor: LinearBody
) -> tuple[ContactLaw, str]:
    """The law minus the half-space compliance of the patches, and a note on it."""
    bodies = checked_body("model", model), checked_body("impactor", impactor)
    local = sum(body.local_compliance for body in bodies)
    if local == 0.0:
        return law, ""
    if not isinstance(law, Hertz):
        return law, (
            f"The patch's half-space compliance {local:.4g} m/N was not subtracted:"
            f" {type(law).__name__} is not Hertz's law."
        )
    if law.compliance > 0.0:
        return law, ""
    return law.without(local), (
        f"The patch's half-space compliance {local:.4g} m/N was subtracted from Hertz's law,"
        f" so that the indentation is counted once."
    )


def check_span(problem: Problem, duration: float) -> None:
    """InputError if nothing can move, AccuracyError if rounding destroys the phase in
    `duration`."""
    if not problem.omega.size:
        raise InputError(
            "nothing can move: neither the model nor the impactor has a mass; give m0 or m > 0, or"
            " an impactor with a mass."
        )
    fastest = float(problem.omega.max())
    if fastest * duration > LARGEST_PHASE:
        raise AccuracyError(
            f"rounding destroys the phase of the fastest motion, {fastest:.3g} rad/s, over a "
            f"duration of {duration:g} s: shorten it to at most {LARGEST_PHASE / fastest:.2g} s, "
            "or take fewer anti-oscillators."
        )
