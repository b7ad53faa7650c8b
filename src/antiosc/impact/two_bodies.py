"""An impact of two bodies as a scene, and many of them as rows that the march solves in one call.

The signs are those of `antiosc.impact.scene`. Each body moves along the direction in which
the contact pushes it, whatever the axes of its mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from ctypes import byref, c_int64, c_void_p
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from antiosc.base import checks, process
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, AntioscError, InputError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.base import Compiled, is_compiled
from antiosc.engine.system import System
from antiosc.impact.assembly import Assembly, Parts, expected_contact, without_patch
from antiosc.impact.auto_contact import AUTO, LAW, AnyLaw, law_of
from antiosc.impact.bodies import (
    Obstacle,
    RigidMass,
    SceneBody,
    Sphere,
    may_rotate,
    single_site_body,
    stacked_first_order,
)
from antiosc.impact.scene_parts import two_body_parts
from antiosc.models.body import Body, LinearBody, checked_body, is_thin
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion
from antiosc.models.stretch import refuse_stretch, stretch_of

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
    given, checked, modes : the structure and the impactor, as given and as they are read.
    block : omega, decay, beta, r, the time 0, load, the gap, q and v as a `System` has them.
    omega, decay, beta, v, load : (J,) of both, in the block; `r` [m/N] the residual compliance.
    mobilities : inverse [1/kg] of the inertia that each puts behind the contact.
    local : half-space compliance [m/N] of the patches.
    """

    given: tuple[LinearBody, LinearBody]
    checked: tuple[Body, Body]
    modes: tuple[ModalBody, ModalBody]
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
    def bodies(self) -> tuple[SceneBody, SceneBody]:
        """The structure and the impactor as a scene has them, with their motion at the start."""
        count = self.modes[0].omega.size
        structure, striker = zip(self.given, self.checked, self.modes, strict=True)
        return (
            single_site_body("structure", *structure, self.v[:count]),
            single_site_body("impactor", *striker, self.v[count:]),
        )

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


class Impact(NamedTuple):
    """Arguments of one impact of two bodies, as `simulate` takes them."""

    model: LinearBody
    impactor: LinearBody
    contact: ContactLaw
    duration: float
    initial_velocity: float | Motion = 0.0
    gravity: float | Sequence[float] = 0.0
    gap: float | None = None

    def group(self) -> tuple[object, ...] | None:
        """Key that is equal for impacts which one C call can solve together; None for others."""
        if (
            not is_compiled(self.contact)
            or _has_coupled_damping(self.model)
            or _has_coupled_damping(self.impactor)
            or stretch_of(self.model) is not None
            or stretch_of(self.impactor) is not None
        ):
            return None
        still = isinstance(self.gravity, int | float) and self.gravity == 0
        rigid = still and type(self.impactor) in (RigidMass, Sphere)
        moving = self.initial_velocity
        speed = moving if isinstance(moving, int | float) else id(moving)
        return id(self.model), 0 if rigid else (id(self.impactor), id(self.gravity)), speed


def modal_pair(impact: Impact) -> Pair:
    """Two bodies in their modes, with start velocities and gravity."""
    model, impactor, _, _, initial, gravity, _ = impact
    one, other = checked_body("model", model), checked_body("impactor", impactor)
    if one.velocity != 0.0:
        raise InputError(
            f"the model has a velocity of {one.velocity:g} m/s, which only the impactor may have: "
            "the order is simulate(model, impactor, …), and initial_velocity= moves the model."
        )
    structure, striker = one.modal(), other.modal()
    if not isinstance(initial, Motion):
        initial = -checks.number("initial_velocity", initial, "m/s")
    start, strike = structure.rigid_motion(initial), striker.rigid_motion(other.velocity)
    loads = _gravity_loads(structure, striker, gravity)
    count = structure.omega.size
    size, r = count + striker.omega.size, structure.r + striker.r
    block = np.zeros(6 * size + 3)
    rows = block[: 3 * size].reshape(3, size)
    rows[:, :count], rows[:, count:] = structure.closing, striker.closing
    omega, decay, beta = rows
    load, v = block[3 * size + 2 : 4 * size + 2], block[5 * size + 3 :]
    v[:count], v[count:] = start, strike if isinstance(other.velocity, Motion) else -strike
    for own, pull in zip((load[:count], load[count:]), loads, strict=True):
        if pull is not None:
            own[...] = pull
    block[3 * size] = r
    return Pair(
        given=(model, impactor),
        checked=(one, other),
        modes=(structure, striker),
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


def assemble_pair(impact: Impact, stretch: bool = False) -> Assembly:
    """Assemble "structure" and "impactor" for integration over the duration.

    stretch : whether they may stretch; the assembly is that of their linear motion.
    """
    if not stretch:
        refuse_stretch({"structure": impact.model, "impactor": impact.impactor})
    model, impactor, contact, duration, _, gravity, gap = impact
    made = modal_pair(impact)
    made.check_span(duration)
    checks.instance("contact", contact, ContactLaw, LAW)
    law, notes = without_patch(contact, made.local, "structure", "impactor")
    gap = made.checked[1].gap if gap is None else checks.nonnegative("gap", gap, "m")
    mass = made.mass
    depth, speed, contact_time_estimate = expected_contact(
        law, mass, made.beta, made.v, made.load, gap, duration
    )
    parts = partial(_parts, contact, gap, gravity, made)
    one, other = made.modes
    coupled = one.damping is not None or other.damping is not None
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
        first=stacked_first_order(made.bodies) if coupled else None,
    )
    system.block = block
    turns, thin = may_rotate(one) or may_rotate(other), is_thin(model) or is_thin(impactor)
    return Assembly(parts, _ROW, [law], notes, system, contact_time_estimate, turns, thin)


def _parts(contact: ContactLaw, gap: float, gravity: float | Sequence[float], pair: Pair) -> Parts:
    """The bodies "structure" and "impactor" as a scene has them."""
    bodies = {body.name: body for body in pair.bodies}
    return two_body_parts(*pair.given, contact, gap, gravity), bodies


def _gravity_loads(
    structure: ModalBody, striker: ModalBody, gravity: float | Sequence[float]
) -> list[Array | None]:
    """Modal forces of gravity on both bodies; None: there are none."""
    vector = None
    if isinstance(gravity, list | tuple) or (isinstance(gravity, np.ndarray) and gravity.ndim):
        vector = checks.array("gravity", gravity, (3,))
        if structure.direction is None:
            raise InputError(
                "gravity as a vector needs a model that knows the direction of impact: extract it"
                " from a mesh, or give gravity as a number along the impact."
            )
        along = float(vector @ structure.direction)
    else:
        along = checks.number("gravity", gravity, "m/s^2")
    loads: list[Array | None] = []
    for name, body, sign in (("structure", structure, 1.0), ("impactor", striker, -1.0)):
        if vector is None or body.inertia is None:
            loads.append(_gravity_load(name, body, sign * along))
        else:
            loads.append(_free_body_load(body, body.inertia.momentum[:, :3] @ vector))
    return loads


def _gravity_load(name: str, body: ModalBody, gravity: float) -> Array | None:
    """Modal forces of gravity along the push of the contact."""
    if gravity == 0.0 or not np.any(body.omega == 0):
        return None
    if body.weight is None:
        raise InputError(
            f"gravity on the {name} with a rigid-body mode needs the model's participation;"
            f" extract the model anew, give participation=, or set gravity=0."
        )
    return _free_body_load(body, gravity * body.weight)


def _free_body_load(body: ModalBody, load: Array) -> Array:
    """Return `load`; zero in elastic modes of a body whose site is supported.

    Displacements of such a body are measured from its equilibrium.
    """
    rigid = body.omega == 0
    return load if np.any(rigid & (body.b != 0)) else np.where(rigid, load, 0.0)


#: The band of an impact over the frequency 1/(2T) of its contact time T: a half-sine of length T
#: has its first zero there.
BAND_OVER_PULSE = 3.0


@checks.within_range
def impact_band(
    impactor: LinearBody, contact: AnyLaw = AUTO, struck: LinearBody | None = None
) -> float:
    """The highest frequency [Hz] that an impact excites, about 3/(2T).

    T is the contact time of `impactor` on a rigid wall, the shortest that a single contact with
    the structure can have. With "auto" the law is that of a contact with `struck`, a model; None:
    with a rigid plane. Raises InputError for an impactor at rest.
    """
    law = law_of(contact, Obstacle() if struck is None else struck, impactor)
    velocity = checked_body("impactor", impactor).velocity
    if not checks.number("velocity", velocity, "m/s") > 0:
        raise InputError(
            "impact_band needs an impactor with a velocity > 0; with an Obstacle or a body at rest "
            "give the band as a number."
        )
    endless = 1e6  # s
    pulse = assemble_pair(Impact(Obstacle(), impactor, law, endless)).contact_time_estimate
    return BAND_OVER_PULSE / (2 * pulse)


IMPACT = cast("np.dtype[np.void]", np.dtype(library.Impact))
OUTCOME = cast("np.dtype[np.void]", np.dtype(library.Outcome))

#: Modes times attempted steps between two looks for an interrupt: some 0.05 s.
_WORK_PER_CALL = 4_000_000
#: Least nodes that a call may write.
_NODES = 200_000


def _has_coupled_damping(body: LinearBody) -> bool:
    """Whether damping couples the modes of a body; False for what is none."""
    if type(body) in (RigidMass, Sphere) or not callable(getattr(body, "modal", None)):
        return False
    try:
        return getattr(body.modal(), "damping", None) is not None
    except AntioscError:
        return False


class ImpactRows:
    """Impacts of one group: the two bodies of the first, and what the march takes.

    Attributes
    ----------
    pair : the bodies of the first impact; those of the others differ in a rigid impactor alone.
    laws : without the half-space compliance of the patches.
    given : (S,) `aom_impact`.
    """

    def __init__(
        self, impacts: Sequence[Impact], tol: float, max_contacts: int, max_steps: int
    ) -> None:
        first = impacts[0].impactor
        self.pair = made = modal_pair(impacts[0])
        count, size = len(impacts), made.omega.size
        beta, v = np.tile(made.beta, (count, 1)), np.tile(made.v, (count, 1))
        mobility = np.full(count, sum(made.mobilities))
        if any(each.impactor is not first for each in impacts):  # rigid ones, see `group`
            strikers = [cast("RigidMass | Sphere", each.impactor) for each in impacts]
            b = 1 / np.sqrt(np.array([each.mass for each in strikers]))
            beta[:, -1] = -b
            v[:, -1] = -(np.array([each.velocity for each in strikers]) * b / (b * b))
            mobility = made.mobilities[0] + b * b
        self.laws = cast(
            "list[Compiled]", _laws_without_patch([each.contact for each in impacts], made.local)
        )
        self.given = given = np.zeros(count, IMPACT)
        self._held = [made.omega, made.decay, beta, v, made.load, *_rotation_rows(made)]
        omega, decay, rows, speeds, load, *turning = map(library.address, self._held)
        each = 8 * size * np.arange(count, dtype=np.uintp)
        given["n_modes"], given["omega"], given["decay"] = size, omega, decay
        given["beta"], given["v"], given["load"] = rows + each, speeds + each, load
        if turning:
            given["n_turning"], given["turning"] = len(self._held[-1]), turning[0]
        kernels = [law.kernel[0] for law in self.laws]
        for name in ("kind", "n_params", "params"):
            given["law"][name] = [getattr(kernel, name) for kernel in kernels]
        given["residual"] = made.r
        given["mass"] = np.where(mobility > 0, 1 / np.where(mobility > 0, mobility, 1.0), 1.0)
        own = made.checked[1].gap
        given["gap"] = [
            own if each.gap is None else checks.nonnegative("gap", each.gap, "m")
            for each in impacts
        ]
        given["duration"] = [checks.positive("duration", each.duration, "s") for each in impacts]
        made.check_span(float(given["duration"].max()))
        given["rel_tol"], given["max_contacts"], given["max_steps"] = tol, max_contacts, max_steps

    def solved(
        self, done: Callable[[int], None]
    ) -> tuple[NDArray[np.void], list[tuple[Array, Array]]]:
        """The outcomes (`aom_outcome`), and nodes [s] and forces [N] of the contacts of each.

        `done` is told how many are solved, now and then.
        """
        given, size = self.given, self.pair.omega.size
        space = _workspace(size)
        outcomes, count = np.zeros(len(given), OUTCOME), c_int64()
        pulses: list[tuple[Array, Array]] = []
        arguments = (
            space.batch, len(given), library.address(given), library.address(outcomes),
            byref(space.nodes), max(_WORK_PER_CALL // (size + 20), 16), byref(count),
        )  # fmt: skip
        answer = library.PAUSED
        while answer in (library.PAUSED, library.FULL):
            answer = library.library.aom_batch_solve(*arguments)
            pulses += space.take_pulses(outcomes["n_nodes"][len(pulses) : count.value])
            done(count.value)
        _idle_workspaces.append(space)
        return outcomes, pulses


def _laws_without_patch(contacts: Iterable[ContactLaw], local: float) -> list[ContactLaw]:
    """The laws as the march takes them."""
    found: dict[int, ContactLaw] = {}
    laws = []
    for contact in contacts:
        if id(contact) not in found:
            checks.instance("contact", contact, ContactLaw, LAW)
            found[id(contact)] = without_patch(contact, local, "structure", "impactor")[0]
        laws.append(found[id(contact)])
    return laws


def _rotation_rows(made: Pair) -> list[Array]:
    """Rotation vectors (n, 3, J) by the modes of the bodies that may turn, [] without one."""
    found, begin = [], 0
    for body in made.bodies:
        span = slice(begin, begin + body.omega.size)
        begin = span.stop
        if may_rotate(body):
            turning = np.zeros((3, made.omega.size))
            turning[:, span] = body.rotation(np.eye(body.omega.size)).T
            found.append(turning)
    return [np.array(found)] if found else []


class _Workspace:
    """Memory that the march solves impacts with so many modes in."""

    def __init__(self, size: int) -> None:
        need = library.library.aom_batch_size(size)
        process.require(need, f"an impact with {size} modes", "use fewer of them")
        self.memory = np.empty(-(-need // 16), dtype=np.complex128)
        room = max(library.library.aom_batch_nodes(size), _NODES)
        self.time, self.force = np.empty(room), np.empty(room)
        self.nodes = library.PulseNodes(room, 0, *map(library.address, (self.time, self.force)))
        self.batch, self.size = c_void_p(), -1

    def reset(self, size: int) -> bool:
        """Prepare for impacts with `size` modes; False if the memory is too small.

        With the same number of modes the march reuses its responses.
        """
        at = library.address(self.memory), self.memory.nbytes, byref(self.batch)
        self.nodes.n_nodes = 0
        if size != self.size:
            room = int(library.library.aom_batch_nodes(size)) <= self.time.size
            made = room and library.library.aom_batch_create(size, *at) == library.DONE
            self.size = size if made else -1
        return size == self.size

    def take_pulses(self, counts: NDArray[np.int64]) -> list[tuple[Array, Array]]:
        """Copy the nodes of all impacts and empty the buffers."""
        time, force = (each[: self.nodes.n_nodes].copy() for each in (self.time, self.force))
        self.nodes.n_nodes = 0
        ends = np.cumsum(counts).tolist()
        begins = [0, *ends[:-1]]
        return [(time[a:b], force[a:b]) for a, b in zip(begins, ends, strict=True)]


_idle_workspaces: list[_Workspace] = []


def _workspace(size: int) -> _Workspace:
    """Take an idle workspace that is large enough, or create one; no other thread has it."""
    while _idle_workspaces:
        try:
            found = _idle_workspaces.pop()
        except IndexError:  # another thread took it
            break
        if found.reset(size):
            return found
    found = _Workspace(size)
    found.reset(size)
    return found
