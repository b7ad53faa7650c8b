"""An impact of two bodies as a scene: their modes, start, gravity and one contact.

The signs are those of `antiosc.simulation.simulate`. Each body moves along the direction in which
the contact pushes it, whatever the axes of its mesh.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc.contact import ContactLaw
from antiosc.models.body import LinearBody, checked_body
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion
from antiosc.simulation.assembly import Assembly, freed, side_by_side
from antiosc.simulation.bodies import first_order_of, of_one_site
from antiosc.simulation.expected import expected_impact
from antiosc.simulation.scene_parts import of_two
from antiosc.simulation.system import System

#: Largest phase of a motion [rad]: rounding leaves some 0.1 rad of it.
LARGEST_PHASE = 1e15
LAW = "a ContactLaw such as Hertz(stiffness)"
#: The row of the one contact in the displacements of both bodies along their pushes.
_ROW = np.array([[-1.0, -1.0]])
_NO_FRICTION, _NO_TANGENTS = np.zeros((1, 2)), np.array([[1, 0]], dtype=np.int64)


def pose(
    model: LinearBody,
    impactor: LinearBody,
    contact: ContactLaw,
    duration: float,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
    gap: float | None = None,
) -> Assembly:
    """The bodies "structure" and "impactor", ready to integrate over `duration` [s]."""
    one, other = checked_body("model", model), checked_body("impactor", impactor)
    checks.instance("contact", contact, ContactLaw, LAW)
    law, notes = freed(
        contact, one.local_compliance + other.local_compliance, "structure", "impactor"
    )
    structure, striker = one.modal(), other.modal()
    starts = _starts(structure, striker, initial_velocity, other.velocity)
    bodies = {
        "structure": of_one_site("structure", model, one, structure, starts[0]),
        "impactor": of_one_site("impactor", impactor, other, striker, starts[1]),
    }
    gap = other.gap if gap is None else checks.nonnegative("gap", gap, "m")
    load = np.concatenate(_loads(structure, striker, gravity))
    omega, v = np.concatenate((structure.omega, striker.omega)), np.concatenate(starts)
    beta = -np.concatenate((structure.b, striker.b))
    mobility = structure.mobility + striker.mobility
    mass = 1 / mobility if mobility > 0 else 1.0
    approach = abs(float(beta @ v)), abs(float(beta @ load))
    depth, speed, lasting = expected_impact(law, mass, *approach, gap, duration)
    system = System(
        omega=omega,
        decay=np.concatenate([body.decay for body in bodies.values()]),
        beta=beta[None],
        R=np.array([[structure.r + striker.r]]),
        breaks=np.zeros(1),
        loads=load[None],
        offsets=np.array([[gap]]),
        laws=[law],
        slip=_NO_FRICTION,
        tangents=_NO_TANGENTS,
        q=np.zeros(omega.size),
        v=v,
        mass=np.array([mass]),
        depth=np.array([depth]),
        speed=np.array([speed]),
        pressed=np.zeros(1),
        first=first_order_of(bodies.values()),
    )
    scene = of_two(model, impactor, contact, gap, gravity)
    parts = side_by_side(bodies)
    return Assembly(scene, bodies, *parts, _ROW, [law], notes, system, lasting)


def _starts(
    structure: ModalBody, striker: ModalBody, initial: float | Motion, speed: float | Motion
) -> tuple[Array, Array]:
    """Modal velocities of both bodies; numbers are > 0 when they close the gap."""
    if not isinstance(initial, Motion):
        initial = -checks.number("initial_velocity", initial, "m/s")
    own = striker.rigid_motion(speed)
    return structure.rigid_motion(initial), own if isinstance(speed, Motion) else -own


def _loads(
    structure: ModalBody, striker: ModalBody, gravity: float | Sequence[float]
) -> tuple[Array, Array]:
    """Modal forces of gravity on both bodies."""
    listed = isinstance(gravity, list | tuple)
    if not (listed or (isinstance(gravity, np.ndarray) and gravity.ndim)):
        along = checks.number("gravity", gravity, "m/s^2")
        return _pull("structure", structure, along), _pull("impactor", striker, -along)
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
            loads.append(_pull(name, body, sign * along))
        else:
            loads.append(_falling(body, body.inertia.momentum[:, :3] @ vector))
    return loads[0], loads[1]


def _pull(name: str, body: ModalBody, gravity: float) -> Array:
    """Modal forces of gravity along the push of the contact."""
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


def check_span(assembly: Assembly, duration: float) -> None:
    """InputError if nothing can move, AccuracyError if rounding destroys the phase in
    `duration`."""
    omega = assembly.system.omega
    if not omega.size:
        raise InputError(
            "nothing can move: neither the model nor the impactor has a mass; give m0 or m > 0, or"
            " an impactor with a mass."
        )
    fastest = float(omega.max())
    if fastest * duration > LARGEST_PHASE:
        raise AccuracyError(
            f"rounding destroys the phase of the fastest motion, {fastest:.3g} rad/s, over a "
            f"duration of {duration:g} s: shorten it to at most {LARGEST_PHASE / fastest:.2g} s, "
            "or take fewer anti-oscillators."
        )
