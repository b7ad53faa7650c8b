"""The unreduced model of an impact: time integration of all dofs by Newmark's average acceleration.

A = K + 4 M/h² is factorized once. The displacement of the site is linear in the force, so that a
step takes one solve with A and one scalar equation of the contact law.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar, cast

import numpy as np

from antiosc.base import process
from antiosc.base._types import Array
from antiosc.base.clock import clock
from antiosc.base.errors import AntioscError, InputError
from antiosc.base.texts import plain_number
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.stepping import Contacts, StepEnd
from antiosc.fem.linalg.algebra import dot, multiply, sum_of
from antiosc.fem.linalg.solver import FACTOR_ENTRY_BYTES, Factorization, seconds_of_steps
from antiosc.fem.linalg.solver_choice import factorize, forecast_of
from antiosc.fem.structure.structure import Structure
from antiosc.impact.histories import History
from antiosc.impact.states import main_contact_time
from antiosc.models.modal import ModalBody
from antiosc.reduce.site import functional
from antiosc.reduce.site.site import Site

M = TypeVar("M", float, Array)
UNREDUCED_METHOD = "unreduced"
#: Steps to a contact. Hertz's blow on a block has errors of 1e-4 of the peak with these.
STEPS_PER_CONTACT = 100


@dataclass(frozen=True, eq=False)
class UnreducedImpact:
    """The impact of a rigid body on a part at rest, computed without anti-oscillators."""

    structure: Structure
    load: Array  # load vector of the site
    law: ContactLaw  # without the half-space compliance of the patch
    mass: float  # of the impactor [kg]
    speed: float  # with which it approaches at the start [m/s]
    acceleration: float  # by gravity [m/s²]
    gap: float  # at the start [m]
    step: float  # [s]
    duration: float  # [s]

    @property
    def steps(self) -> int:
        """Number of time steps."""
        return int(np.ceil(self.duration / self.step))


class ContactCurve(NamedTuple):
    """Force history of a computed contact."""

    time: Array  # (n,) [s]
    force: Array  # [N]
    depth: Array  # indentation [m]
    contacts: Sequence[tuple[float, float]]  # start and end of each [s]


class MethodOutcome(NamedTuple):
    """The contact curve of a method, and its cost in seconds and bytes."""

    curve: ContactCurve
    seconds: float
    bytes: float


def unreduced_impact(
    structure: Structure, site: Site, hit: History, duration: float
) -> UnreducedImpact:
    """The impact `hit`, for the unreduced structure; InputError unless it can be repeated there."""
    assembly = hit.assembly
    system = assembly.system
    part, ball = assembly.stacked.spans["structure"], assembly.stacked.spans["impactor"]
    if assembly.stretch_forces:
        raise InputError("the part has second-order forces, and other methods are linear")
    if system.has_damping:
        raise InputError("the part or the impactor is damped, and other methods are not")
    if system.v[part].any() or system.loads[:, part].any():
        raise InputError("the part moves at the start or falls, and other methods begin at rest")
    if not hit.contact_time:
        raise InputError("there is no contact")
    if system.omega[ball].size > 1 or cast("ModalBody", assembly.bodies["impactor"].modes).r:
        raise InputError("the impactor is elastic, and other methods take a rigid one")

    (beta,) = system.beta[0, ball].tolist()

    return UnreducedImpact(
        structure=structure,
        load=functional(structure, site).b,
        law=assembly.laws[0],
        mass=1 / beta**2,
        speed=beta * float(system.v[ball][0]),
        acceleration=beta * float(system.loads[0, ball][0]),
        gap=float(system.offsets[0, 0]),
        step=hit.contact_time / STEPS_PER_CONTACT,
        duration=duration,
    )


def factor_entries(structure: Structure) -> float:
    """Number of entries of the factor of K, or of its symbolic factor if K has another solver."""
    solver = structure.factorize()
    return solver.entries if isinstance(solver, Factorization) else forecast_of(structure.K).entries


def run_unreduced(
    make_blow: Callable[[], UnreducedImpact], seconds: float, report: Callable[[str], None]
) -> MethodOutcome | str:
    """Outcome of the unreduced model, or why there is none (forecast > `seconds`, or an error)."""
    try:
        blow = make_blow()
        expected = blow.structure.seconds["assembly"]
        expected += seconds_of_steps(factor_entries(blow.structure), blow.steps)
        if expected > seconds:
            return (
                f"{UNREDUCED_METHOD}: not run, the forecast of {plain_number(expected)} s for"
                f" {blow.structure.dofs} dofs and {blow.steps} steps exceeds"
                f" compare = {seconds:g} s."
            )
        report(f"{UNREDUCED_METHOD}, about {plain_number(expected)} s")
        return run_newmark(blow)
    except AntioscError as error:
        return f"{UNREDUCED_METHOD}: {str(error).rstrip('.')}."


def run_newmark(blow: UnreducedImpact) -> MethodOutcome:
    """The outcome of Newmark's average acceleration for all dofs, with an implicit force."""
    structure = blow.structure
    start_time = clock() - structure.seconds["assembly"]
    process.require_memory(
        FACTOR_ENTRY_BYTES * factor_entries(structure),
        "a factor of K + 4 M/h²",
        "take a longer step",
    )
    h = blow.step
    A = factorize(sum_of(structure.K, 4 / h**2, structure.M))
    curve = _integrated_curve(blow, A)

    return MethodOutcome(curve, clock() - start_time, FACTOR_ENTRY_BYTES * A.entries)


def _integrated_curve(blow: UnreducedImpact, A: Factorization) -> ContactCurve:
    """The contact curve after all steps, with the factor A of K + 4 M/h²."""
    h = blow.step
    mass_matrix = blow.structure.M
    comm = blow.structure.comm
    flexibility = A.solve(blow.load)
    by_force = h**2 / (4 * blow.mass)  # displacement of the impactor at the end of a step
    alpha = np.array([[float(dot(comm, blow.load, flexibility)) + by_force]])
    alpha_rate = 2 / h * alpha
    contacts = Contacts([blow.law], np.zeros((1, 1)), [False], [0.0])
    end = StepEnd(np.zeros(1), np.array([-blow.gap]), np.array([blow.speed]))
    ends = [end]

    u, v, a = np.zeros((3, len(blow.load)))
    x, speed, acceleration = 0.0, blow.speed, blow.acceleration
    for k in range(blow.steps):
        inertia_terms = 4 / h**2 * u + 4 / h * v + a
        of_impactor = 4 / h**2 * x + 4 / h * speed + acceleration
        u = A.solve(multiply(mass_matrix, inertia_terms))
        x = h**2 / 4 * (of_impactor + blow.acceleration)

        free = np.array([x - float(dot(comm, blow.load, u)) - blow.gap])
        rate = 2 / h * (free - end.delta) - end.rate
        end = contacts.end_of_step(k * h, h, end, free, rate, alpha, alpha_rate)
        ends.append(end)
        (force,) = end.force.tolist()
        u += force * flexibility
        x -= force * by_force
        v, a = _end_rates(h, u, inertia_terms, v, a)
        speed, acceleration = _end_rates(h, x, of_impactor, speed, acceleration)

    time = h * np.arange(blow.steps + 1)
    times = [t for t, *_ in contacts.events]
    lasts = zip(times[::2], [*times[1::2], float(time[-1])], strict=False)
    force, depth = (np.array([getattr(e, name)[0] for e in ends]) for name in ("force", "delta"))

    return ContactCurve(time, force, depth, list(lasts))


def _end_rates(h: float, new: M, inertia_terms: M, v: M, a: M) -> tuple[M, M]:
    """Velocity and acceleration at the end of a step of h [s], at the displacement `new`."""
    new_acceleration = 4 / h**2 * new - inertia_terms
    return v + h / 2 * (a + new_acceleration), new_acceleration


@dataclass(frozen=True)
class CurveResults:
    """Peak force [N], impulse [N s] and contact time [s] of a curve, as in a `History`."""

    peak_force: float
    impulse: float
    contact_time: float


def curve_results(curve: ContactCurve) -> CurveResults:
    """Peak force by a parabola, impulse by trapezoids, and contact time of a curve."""
    time, force, *_ = curve
    impulses = np.append(0.0, np.cumsum(np.diff(time) * (force[1:] + force[:-1]) / 2))
    contacts = np.reshape(curve.contacts, (-1, 2))
    gains = np.diff(np.interp(contacts, time, impulses), axis=1)
    main_time = main_contact_time(np.hstack([contacts, gains]).tolist())
    return CurveResults(_parabola_peak(force), float(impulses[-1]), main_time)


def _parabola_peak(force: Array) -> float:
    """Highest value of the parabola through the largest sample and its neighbours."""
    k = int(np.argmax(force))
    if not 0 < k < len(force) - 1:
        return float(force[k])

    last_force, peak, next_force = force[k - 1 : k + 2].tolist()
    curvature = last_force - 2 * peak + next_force
    slope = (next_force - last_force) / 2

    return float(peak - slope**2 / (2 * curvature)) if curvature else float(peak)
