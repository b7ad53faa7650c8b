"""An impact of two bodies as a scene: their modes, start, gravity and one contact.

The signs are those of `antiosc.simulation.simulate`. Each body moves along the direction in which
the contact pushes it, whatever the axes of its mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc.contact import ContactLaw
from antiosc.models.body import LinearBody, checked_body
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion
from antiosc.simulation.bodies.bodies import Placed, first_order_of, may_turn, of_one_site
from antiosc.simulation.bodies.impactors import Obstacle
from antiosc.simulation.march.system import System
from antiosc.simulation.problem.assembly import Assembly, Parts
from antiosc.simulation.problem.scales import expected_impact, freed
from antiosc.simulation.problem.scene_parts import LAW, of_two

#: Largest phase of a motion [rad]: rounding leaves some 0.1 rad of it.
LARGEST_PHASE = 1e15
#: The row of the one contact in the displacements of both bodies along their pushes.
_ROW = np.array([[-1.0, -1.0]])
_NO_FRICTION, _NO_TANGENTS = np.zeros((1, 2)), np.array([[1, 0]], dtype=np.int64)


@dataclass(eq=False)
class Pair:
    """Two bodies side by side in their modes, without the contact between them.

    Attributes
    ----------
    bodies : the structure and the impactor, with their modal velocities at the start.
    block : omega, decay, beta, r, the time 0, load, the gap, q and v as a `System` has them.
    omega, decay, beta, v, load : (J,) of both, in the block; `r` [m/N] the residual compliance.
    mobilities : inverse [1/kg] of the inertia that each puts behind the contact.
    local : half-space compliance [m/N] of the patches.
    """

    bodies: tuple[Placed, Placed]
    block: Array
    omega: Array
    decay: Array
    beta: Array
    v: Array
    load: Array
    r: float
    mobilities: tuple[float, float]
    local: float

    @property
    def mass(self) -> float:
        """Inertia [kg] behind the contact."""
        mobility = sum(self.mobilities)
        return 1 / mobility if mobility > 0 else 1.0

    def check_span(self, duration: float) -> None:
        """InputError if nothing can move, AccuracyError if rounding destroys the phase in a
        `duration` [s]."""
        if not self.omega.size:
            raise InputError(
                "nothing can move: neither the model nor the impactor has a mass; give m0 or m > 0,"
                " or an impactor with a mass."
            )
        fastest = float(self.omega[self.omega.argmax()])
        if fastest * duration > LARGEST_PHASE:
            raise AccuracyError(
                f"rounding destroys the phase of the fastest motion, {fastest:.3g} rad/s, over a "
                f"duration of {duration:g} s: shorten it to at most {LARGEST_PHASE / fastest:.2g}"
                " s, or take fewer anti-oscillators."
            )


def pair(
    model: LinearBody,
    impactor: LinearBody,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
) -> Pair:
    """The bodies of an impact in their modes, with their start and gravity."""
    one, other = checked_body("model", model), checked_body("impactor", impactor)
    if one.velocity != 0.0:
        raise InputError(
            f"the model has a velocity of {one.velocity:g} m/s, which only the impactor may have: "
            "the order is simulate(model, impactor, …), and initial_velocity= moves the model."
        )
    structure, striker = one.modal(), other.modal()
    starts = _starts(structure, striker, initial_velocity, other.velocity)
    loads = _loads(structure, striker, gravity)
    count = structure.omega.size
    size, r = count + striker.omega.size, structure.r + striker.r
    block = np.zeros(6 * size + 3)
    rows = block[: 3 * size].reshape(3, size)
    rows[:, :count], rows[:, count:] = structure.closing, striker.closing
    omega, decay, beta = rows
    load, v = block[3 * size + 2 : 4 * size + 2], block[5 * size + 3 :]
    v[:count], v[count:] = starts
    for own, pull in zip((load[:count], load[count:]), loads, strict=True):
        if pull is not None:
            own[...] = pull
    block[3 * size] = r
    return Pair(
        bodies=(
            of_one_site("structure", model, one, structure, starts[0]),
            of_one_site("impactor", impactor, other, striker, starts[1]),
        ),
        block=block,
        omega=omega,
        decay=decay,
        beta=beta,
        v=v,
        load=load,
        r=r,
        mobilities=(structure.mobility, striker.mobility),
        local=one.local_compliance + other.local_compliance,
    )


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
    made = pair(model, impactor, initial_velocity, gravity)
    made.check_span(duration)
    checks.instance("contact", contact, ContactLaw, LAW)
    law, notes = freed(contact, made.local, "structure", "impactor")
    gap = made.bodies[1].gap if gap is None else checks.nonnegative("gap", gap, "m")
    mass = made.mass
    depth, speed, lasting = expected_impact(law, mass, made.beta, made.v, made.load, gap, duration)
    parts = partial(_parts, contact, gap, gravity, made)
    uncoupled = all(body.modes.damping is None for body in made.bodies)
    block, size = made.block, made.omega.size
    block[4 * size + 2] = gap
    scales = np.array([mass, depth, speed, 0.0])
    system = System(
        omega=made.omega,
        decay=made.decay,
        beta=made.beta[None],
        R=block[3 * size : 3 * size + 1, None],
        breaks=block[3 * size + 1 : 3 * size + 2],
        loads=made.load[None],
        offsets=block[4 * size + 2 : 4 * size + 3, None],
        laws=[law],
        slip=_NO_FRICTION,
        tangents=_NO_TANGENTS,
        q=block[4 * size + 3 : 5 * size + 3],
        v=made.v,
        mass=scales[:1],
        depth=scales[1:2],
        speed=scales[2:3],
        pressed=scales[3:],
        first=None if uncoupled else first_order_of(made.bodies),
    )
    system.block = block
    turns = any(map(may_turn, made.bodies))
    return Assembly(parts, _ROW, [law], notes, system, lasting, turns)


def _parts(contact: ContactLaw, gap: float, gravity: float | Sequence[float], made: Pair) -> Parts:
    """The bodies "structure" and "impactor" as a scene has them."""
    bodies = {body.name: body for body in made.bodies}
    model, impactor = (body.body for body in made.bodies)
    return of_two(model, impactor, contact, gap, gravity), bodies


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
) -> tuple[Array | None, Array | None]:
    """Modal forces of gravity on both bodies; None: there are none."""
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
    loads: list[Array | None] = []
    for name, body, sign in (("structure", structure, 1.0), ("impactor", striker, -1.0)):
        if body.inertia is None:
            loads.append(_pull(name, body, sign * along))
        else:
            loads.append(_falling(body, body.inertia.momentum[:, :3] @ vector))
    return loads[0], loads[1]


def _pull(name: str, body: ModalBody, gravity: float) -> Array | None:
    """Modal forces of gravity along the push of the contact."""
    if gravity == 0.0 or not np.any(body.omega == 0):
        return None
    if body.weight is None:
        raise InputError(
            f"gravity on the {name} with a rigid-body mode needs the model's participation;"
            f" extract the model anew, give participation=, or set gravity=0."
        )
    return _falling(body, gravity * body.weight)


def _falling(body: ModalBody, load: Array) -> Array:
    """`load` on free bodies; none on a body with a supported site, measured from its
    equilibrium."""
    rigid = body.omega == 0
    return load if np.any(rigid & (body.b != 0)) else np.where(rigid, load, 0.0)


#: the band of an impact over the circular frequency pi/T of its contact time: a half-sine of length
#: T has its first zero there
BAND_OVER_PULSE = 3.0


@checks.within_range
def impact_band(impactor: LinearBody, contact: ContactLaw) -> float:
    """The highest circular frequency [rad/s] that an impact excites, about 3 pi/T.

    T is the contact time of `impactor` on a rigid wall, the shortest that a single contact with
    the structure can have. Raises InputError for an impactor at rest.
    """
    velocity = checked_body("impactor", impactor).velocity
    if not checks.number("velocity", velocity, "m/s") > 0:
        raise InputError(
            "impact_band needs an impactor with a velocity > 0; with an Obstacle or a body at rest "
            "give the band as a number."
        )
    endless = 1e6  # s
    return BAND_OVER_PULSE * np.pi / pose(Obstacle(), impactor, contact, endless).lasting
