"""An impact of two bodies as a scene, and many impacts as rows for one call of the C library.

Signs are as in `antiosc.impact.scene`. Each body moves along the direction in which the contact
pushes it, independently of the axes of its mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref, c_int64, c_void_p
from typing import NamedTuple, cast

import numpy as np

from antiosc.base import checks, process
from antiosc.base._types import Array, NDArray
from antiosc.base.errors import AccuracyError, InputError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.base import Compiled, is_compiled
from antiosc.engine.system import CONTACT_RECORD, BodyModes, System, system_of_bodies
from antiosc.impact.assembly import Assembly, without_patch
from antiosc.impact.bodies import (
    Obstacle,
    RigidMass,
    SceneBody,
    Sphere,
    single_site_body,
    stacked_first_order,
)
from antiosc.impact.scene_parts import gravity_load, two_body_parts
from antiosc.impact.settings import Settings
from antiosc.models.body import AUTO, LAW_RULE, AnyLaw, LinearBody, checked_body, law_of
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Motion
from antiosc.models.stretch import stretch_of

#: Largest phase of a motion [rad]: rounding leaves some 0.1 rad of it.
MAX_PHASE = 1e15
#: Row that gives the indentation from both bodies' displacements along the forces on them.
_CONTACT_ROW = np.array([[-1.0, -1.0]])


class ModalPair(NamedTuple):
    """Two bodies side by side in their modes, without the contact between them."""

    #: structure, impactor: the bodies as a scene has them, with their motion at the start
    structure: SceneBody
    impactor: SceneBody
    gravity_forces: Sequence[Array | None]  # modal forces of gravity on each; None without gravity

    @property
    def modes(self) -> tuple[ModalBody, ModalBody]:
        """The free modes of both bodies, each with one site."""
        return cast("tuple[ModalBody, ModalBody]", (self.structure.modes, self.impactor.modes))

    @property
    def patch_compliance(self) -> float:
        """Half-space compliance [m/N] of the patches."""
        return self.structure.local_compliance[""] + self.impactor.local_compliance[""]

    @property
    def mass(self) -> float:
        """Effective mass [kg] of both bodies at the contact."""
        inverse_mass = sum(one.inverse_mass for one in self.modes)
        return 1 / inverse_mass if inverse_mass > 0 else 1.0

    def gap(self, gap: float | None) -> float:
        """Checked distance [m] at the start; None: the gap of the obstacle."""
        if gap is None:
            return self.impactor.gap
        return checks.nonnegative("gap", gap, "m")

    def system(self, law: ContactLaw, gap: float) -> System:
        """The system of both bodies with one contact."""
        pair = self.structure, self.impactor
        modes = self.modes
        bodies = [
            BodyModes(one.omega, one.decay, one.closing, body.start_velocities, pull)
            for one, body, pull in zip(modes, pair, self.gravity_forces, strict=True)
        ]
        coupled = any(one.damping is not None for one in modes)
        first = stacked_first_order(pair) if coupled else None
        return system_of_bodies(
            bodies, [law], np.array([[modes[0].r + modes[1].r]]), gap, first=first
        )


def check_span(system: System, duration: float) -> None:
    """InputError if nothing moves; AccuracyError if a duration [s] is too long for the phases."""
    if not system.omega.size:
        raise InputError("nothing can move: give the model or the impactor a mass.")

    fastest = float(system.omega.max())
    if fastest * duration > MAX_PHASE:
        raise AccuracyError(
            f"rounding destroys the phase of the fastest motion, {fastest:.3g} rad/s, over a "
            f"duration of {duration:g} s: shorten it to at most {MAX_PHASE / fastest:.2g}"
            " s, or take fewer anti-oscillators."
        )


class Impact(NamedTuple):
    """Arguments of one impact of two bodies, as for `simulate`."""

    model: LinearBody
    impactor: LinearBody
    contact: ContactLaw
    duration: float  # [s]
    initial_velocity: float | Motion = 0.0  # of `model` [m/s], > 0 toward the impactor
    gravity: float | Sequence[float] = 0.0  # [m/s^2] along the impact, or a vector (3,)
    gap: float | None = None  # [m] at the start; None: that of the impactor

    def group(self) -> tuple[object, ...] | None:
        """Key that is equal for impacts that one C call can solve together; None for others."""
        stretches = stretch_of(self.model) or stretch_of(self.impactor)
        if not is_compiled(self.contact) or stretches is not None:
            return None
        no_gravity = isinstance(self.gravity, int | float) and self.gravity == 0
        rigid = no_gravity and type(self.impactor) in (RigidMass, Sphere)
        velocity = self.initial_velocity
        speed = velocity if isinstance(velocity, int | float) else id(velocity)
        return id(self.model), 0 if rigid else (id(self.impactor), id(self.gravity)), speed


def modal_pair(impact: Impact) -> ModalPair:
    """Two bodies in their modes, with initial velocities and gravity."""
    model, impactor, _, _, initial, gravity, _ = impact
    checked_model = checked_body("model", model)
    checked_impactor = checked_body("impactor", impactor)
    if checked_model.velocity != 0.0:
        raise InputError(
            f"the model has a velocity of {checked_model.velocity:g} m/s, which only the impactor"
            " may have: the order is simulate(model, impactor, …), and initial_velocity= moves the"
            " model."
        )

    structure = checked_model.modal()
    striker = checked_impactor.modal()
    if not isinstance(initial, Motion):
        initial = -checks.number("initial_velocity", initial, "m/s")
    start = structure.rigid_motion(initial)
    strike = striker.rigid_motion(checked_impactor.velocity)
    strike = strike if isinstance(checked_impactor.velocity, Motion) else -strike

    bodies = (
        single_site_body("structure", model, checked_model, structure, start),
        single_site_body("impactor", impactor, checked_impactor, striker, strike),
    )

    return ModalPair(*bodies, _gravity_loads(*bodies, gravity))


def assemble_pair(impact: Impact) -> Assembly:
    """The assembly of the bodies "structure" and "impactor" for time integration."""
    model, impactor, contact, duration, _, gravity, gap = impact
    pair = modal_pair(impact)
    checks.instance("contact", contact, ContactLaw, LAW_RULE)
    law, notes = without_patch(contact, pair.patch_compliance, "structure", "impactor")
    gap = pair.gap(gap)

    system = pair.system(law, gap)
    check_span(system, duration)
    contact_time = system.estimate_contact(pair.mass, duration)

    bodies = {"structure": pair.structure, "impactor": pair.impactor}
    scene = two_body_parts(model, impactor, contact, gap, gravity)

    return Assembly(scene, bodies, _CONTACT_ROW, [law], notes, system, contact_time)


def _gravity_loads(
    structure: SceneBody, impactor: SceneBody, gravity: float | Sequence[float]
) -> list[Array | None]:
    """Modal forces of gravity on both bodies; None for a body without any."""
    vector = None

    if isinstance(gravity, list | tuple) or (isinstance(gravity, np.ndarray) and gravity.ndim):
        vector = checks.floats("gravity", gravity, (3,))
        direction = cast("ModalBody", structure.modes).direction
        if direction is None:
            raise InputError(
                "gravity as a vector needs a model that knows the direction of impact: extract it"
                " from a mesh, or give gravity as a number along the impact."
            )
        component = float(vector @ direction)
    else:
        component = checks.number("gravity", gravity, "m/s^2")
        if component == 0.0:
            return [None, None]

    loads: list[Array | None] = []
    for body, along in ((structure, component), (impactor, -component)):
        known = vector is not None and body.inertia is not None
        loads.append(gravity_load(body, cast("Array", vector) if known else along))
    return loads


#: The band of an impact over the frequency 1/(2T) of its contact time T: a half-sine of length T
#: has its first zero there.
BAND_TIME_PRODUCT = 3.0


@checks.within_range
def impact_band(
    impactor: LinearBody, contact: AnyLaw = AUTO, struck: LinearBody | None = None
) -> float:
    """The highest frequency [Hz] that an impact excites, about 3/(2T).

    T is the contact time of `impactor` on a rigid wall, the shortest possible for a single contact
    with the structure. With "auto" the law is chosen for the model `struck`, or without it for a
    rigid plane. InputError for an impactor at rest.
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
    return BAND_TIME_PRODUCT / (2 * pulse)


IMPACT_DTYPE = cast("np.dtype[np.void]", np.dtype(library.CImpact))
OUTCOME_DTYPE = cast("np.dtype[np.void]", np.dtype(library.COutcome))

#: Modes times attempted steps between two checks for an interrupt: some 0.05 s.
_MODE_STEPS_PER_CALL = 4_000_000
#: Least number of nodes for which a call has space.
_MIN_NODES = 200_000


def _copies_of(structure: object, kind: np.dtype[np.void], count: int) -> NDArray[np.void]:
    """`count` copies of a C structure as one array."""
    return np.repeat(np.frombuffer(cast("bytes", structure), kind), count)


class ImpactRows:
    """Impacts on one model that differ in rigid impactor, law, gap or duration, as rows for C."""

    def __init__(self, impacts: Sequence[Impact], settings: Settings) -> None:
        self.pair = modal_pair(impacts[0])
        count = len(impacts)
        laws = {id(impact.contact): impact.contact for impact in impacts}  # equal ones stay equal
        local = self.pair.patch_compliance
        own = {k: without_patch(law, local, "structure", "impactor")[0] for k, law in laws.items()}
        self.laws = [cast("Compiled", own[id(impact.contact)]) for impact in impacts]
        gaps = np.array([self.pair.gap(impact.gap) for impact in impacts])
        durations = [checks.positive("duration", impact.duration, "s") for impact in impacts]
        system = self.pair.system(self.laws[0], gaps[0])
        if system.first is not None:
            raise InputError("damping that couples modes is integrated one by one.")
        check_span(system, max(durations))

        contacts = _copies_of(system.packed.contacts, CONTACT_RECORD, count)
        contacts["mass"] = self.pair.mass

        if any(law is not self.laws[0] for law in self.laws):
            kernels = [law.kernel[0] for law in self.laws]
            for name in ("kind", "n_params", "params"):
                contacts["law"][name] = [getattr(kernel, name) for kernel in kernels]

        rows = {"offsets": gaps, "contacts": contacts}
        if any(impact.impactor is not impacts[0].impactor for impact in impacts):
            rows["beta"], rows["v"], contacts["mass"] = self._strikers(impacts, system)

        limits = settings.max_contacts, settings.max_steps
        options = library.COptions(0.0, settings.tol, 0.0, 0.0, 0.0, *limits, 0)
        example = library.CImpact(system.packed.system, options)
        self.rows = _copies_of(example, IMPACT_DTYPE, count)
        self.rows["options"]["duration"] = durations
        bodies = self.rows["system"]
        number = np.arange(count)
        for name, values in rows.items():
            bodies[name] = library.address(values) + values.strides[0] * number
        self._held = system, rows

    def _strikers(self, impacts: Sequence[Impact], system: System) -> tuple[Array, Array, Array]:
        """(contact rows, initial velocities (S, J), effective masses (S,) [kg] at the contacts)."""
        count = len(impacts)
        strikers = [cast("RigidMass", striker.impactor) for striker in impacts]
        beta, v = (np.repeat(row.reshape(1, -1), count, axis=0) for row in (system.beta, system.v))
        b = 1 / np.sqrt(np.array([striker.mass for striker in strikers]))
        beta[:, -1] = -b
        v[:, -1] = -(np.array([striker.velocity for striker in strikers]) * b / (b * b))
        return beta, v, 1 / (self.pair.modes[0].inverse_mass + b * b)

    def solve(self) -> tuple[NDArray[np.void], list[tuple[Array, Array]]]:
        """(outcomes (`aom_outcome`), (times [s], forces [N]) of each impact during contact)."""
        rows = self.rows
        size = self._held[0].omega.size
        space = _Workspace(size)
        outcomes = np.zeros(len(rows), OUTCOME_DTYPE)
        count = c_int64()
        pulses: list[tuple[Array, Array]] = []
        arguments = (
            space.batch,
            len(rows),
            library.address(rows),
            library.address(outcomes),
            byref(space.nodes),
            max(_MODE_STEPS_PER_CALL // (size + 20), 16),
            byref(count),
        )

        status = library.PAUSED
        while status in (library.PAUSED, library.FULL):
            status = library.library.aom_batch_solve(*arguments)
            pulses += space.read_pulses(outcomes["n_nodes"][len(pulses) : count.value])

        return outcomes, pulses


class _Workspace:
    """Workspace of the C library for impacts with one number of modes."""

    def __init__(self, size: int) -> None:
        need = library.library.aom_batch_size(size)
        process.require_memory(need, f"an impact with {size} modes", "use fewer of them")
        self.memory = np.empty(-(-need // 16), dtype=np.complex128)
        node_count = max(library.library.aom_batch_nodes(size), _MIN_NODES)
        self.time = np.empty(node_count)
        self.force = np.empty(node_count)
        self.nodes = library.CPulseNodes(
            node_count, 0, *map(library.address, (self.time, self.force))
        )
        self.batch = c_void_p()
        arguments = library.address(self.memory), self.memory.nbytes, byref(self.batch)
        library.library.aom_batch_create(size, *arguments)

    def read_pulses(self, counts: NDArray[np.int64]) -> list[tuple[Array, Array]]:
        """(times, forces) of each impact, copied from the buffers, which are emptied."""
        time, force = (array[: self.nodes.n_nodes].copy() for array in (self.time, self.force))
        self.nodes.n_nodes = 0
        ends = np.cumsum(counts).tolist()
        starts = [0, *ends[:-1]]
        return [(time[a:b], force[a:b]) for a, b in zip(starts, ends, strict=True)]
