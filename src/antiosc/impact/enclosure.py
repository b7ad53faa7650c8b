"""Bounds on the contact forces of the assembled structure with all modes that a model leaves out.

The displacements ũ of a Krylov model with the shift s leave the residual -(K + sM) w f(t) in the
structure, w being the next Krylov vector (`antiosc.models.recurrence`). With z = -w f, which does
not move the site, the error e = u - ũ - z of a run is driven by Mw (∂² - s) f and by the residual
of the damping. The relative energy of e and of the contacts' potentials bounds the difference of
the indentations, and hence the forces; it is integrated as one scalar along the run
(`csrc/enclosure.c`). Only the contact forces are taken from the run; the bounds include their
errors in the contact laws.

The difference D of two indentations with relative energy below E satisfies, for every x > 0,
D²/Y(x) + 2 H(D) <= 2E + xP² with P = ∫√(2E) dt. Y(x) is the sum of bᵀ(K + xM)⁻¹b of all bodies, and
H the relative energy of the law.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import POINTER, addressof, byref, c_double, cast
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr, engineering
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.laws import Hertz
from antiosc.engine.law_tables import packed_law
from antiosc.engine.march import Run
from antiosc.engine.system import consecutive_slices
from antiosc.impact.assembly import Assembly
from antiosc.impact.bodies import Obstacle, RigidBody, RigidMass, SceneBody, Sphere
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import Damping
from antiosc.models.recurrence import ReferenceModes

#: Shares of the largest force: width of the bounds that ends the horizon; rounding.
UNPREDICTED_WIDTH, FORCE_ROUNDING = 0.2, 1e-8
#: Least number of time intervals in a contact.
MIN_TIME_PIECES = 100
#: x of the bounds on differences of indentations, over the inverse square of the run's time.
RATE_RATIOS = 2.0 ** np.arange(-6, 25)
#: Relative error of k0 and mass above which a recurrence belongs to another structure; relative
#: rounding of a modal amplitude.
RECURRENCE_TOL, AMPLITUDE_ROUNDING = 1e-6, 1e-9
NO_DAMPING = Damping()
#: Largest elastic share for which the curvature of the loading curve decreases.
MAX_ELASTIC_SHARE = 0.6
PROVED_LAWS = (library.LINEAR, library.HERTZ, library.POWER, library.ELASTIC_PLASTIC)
#: Laws that are Hertz's until they yield: stiffness and yield indentation come first.
YIELDING_LAWS = (library.THORNTON, library.YANG_SUN)


@dataclass(frozen=True, eq=False, repr=False)
class Enclosure(FieldsRepr):
    """Proved bounds on one contact force of the assembled structure.

    Attributes
    ----------
    time : (n,) instants [s] of the run.
    lower, upper : (n,) bounds on the force [N]; infinite where no bound is known.
    peak, impulse : bounds on the peak force [N] and on the impulse [N s], (lower, upper).
    horizon : time [s] from which the bounds are wider than a fifth of the largest force.
    n : number of Krylov vectors on which the bounds are based.
    """

    time: Array
    lower: Array
    upper: Array
    peak: tuple[float, float]
    impulse: tuple[float, float]
    horizon: float
    n: int

    @property
    def text(self) -> str:
        """The bounds in one sentence."""
        low, high = self.peak
        between = f"between {engineering(low, 'N', 4)} and {engineering(high, 'N', 4)}"
        if not np.isfinite(high):
            between = f"above {engineering(low, 'N', 4)}"
        sentence = f"proved {between} for the assembled structure"
        if self.horizon < self.time[-1]:
            end = engineering(self.horizon, "s")
            sentence += f"; nothing after {end} can be predicted by {self.n} oscillators"
        return sentence


def proved_error(proof: Enclosure, quantity: str, value: float) -> float:
    """Proved relative error of the `value` of a `quantity`, "peak" or "impulse"."""
    low, high = getattr(proof, quantity)
    return float(max(high - value, value - low) / value)


class _ReferenceBody(NamedTuple):
    """J modes of one body in the reference motion of the proof, with load and start velocity."""

    #: omega, decay: (J,) frequencies [rad/s] and decay constants [1/s]
    omega: Array
    decay: Array
    lag: Array  # (J,) [s] of modes that follow their force; 0 for other modes
    beta: Array  # (m, J) indentation of the m contacts in each mode
    load: Array  # (J,) modal forces
    v: Array  # (J,) modal velocities
    modes: ReferenceModes | None = None  # None for a rigid body
    damping: Damping = NO_DAMPING
    compliance: Array | None = None  # (m,) [m/N] under a constant force, if it is finite


def enclosures(assembly: Assembly, run: Run, tol: float = 0.0) -> tuple[Enclosure, ...]:
    """Narrowest bounds on forces, or those by the fewest Krylov vectors of peak width <= `tol`."""
    _check_run(assembly, run)
    bodies = assembly.bodies.values()
    sizes = consecutive_slices([body.omega.size for body in bodies])
    laws = [_proof_law(law) for law in assembly.laws]
    most = [_max_vectors(body) for body in bodies]

    longest = max(most)
    counts = [n for n in VECTOR_COUNTS if n < longest] if tol else []

    best: tuple[Enclosure, ...] = ()
    for count in [*counts, longest]:
        parts = [
            _reference_body(assembly, body, span, min(count, n))
            for body, span, n in zip(bodies, sizes, most, strict=True)
        ]
        found = _enclosures_of_run(assembly, run, parts, [law for law, _ in laws], count)
        if not best or max_peak_width(found) < max_peak_width(best):
            best = found
        if max_peak_width(best) <= tol:
            break

    for one, (law, limit) in zip(best, laws, strict=True):
        if one.peak[1] > limit:
            raise InputError(
                f"the proof needs a law without memory: the force may reach "
                f"{engineering(one.peak[1], 'N', 4)}, above the {engineering(limit, 'N', 4)} at "
                f"which {type(law).__name__} yields."
            )
    return best


#: Phase in a contact beyond which a mode of the reference may follow its force (25 and 50 made the
#: bounds of six parts wider), and the momentum that its ringing would give the error in this time,
#: over its own. Decay of such a mode over its frequency: 0.3 and 0.8 made them wider.
FOLLOWING_PHASE = 30.0
FOLLOWING_SHARE = 4.0
FOLLOWING_DECAY_RATIO = 0.5
#: Numbers of Krylov vectors that are tried in turn until the tolerance is met.
VECTOR_COUNTS = (4, 6, 8, 11, 15, 20, 27, 36, 48, 64, 85, 113, 150, 200, 266)


def max_peak_width(found: Sequence[Enclosure]) -> float:
    """Largest width of the bounds on a peak force, relative to the largest force."""
    peak = max(one.peak[0] for one in found)
    return max(one.peak[1] - one.peak[0] for one in found) / max(peak, 1e-300)


def _refusal_of(assumption: str) -> InputError:
    """The error for a run that does not satisfy an assumption of the proof."""
    return InputError(f"the proof assumes {assumption}")


def _check_run(assembly: Assembly, run: Run) -> None:
    """InputError for a run whose bodies, loads or contacts do not satisfy the assumptions."""
    system = assembly.system
    if assembly.stretches:
        raise _refusal_of("linear bodies, and one of these stretches: extract it without stretch.")
    if system.first is not None:
        raise _refusal_of(
            "one damping ratio of all modes or Rayleigh's damping, and one of these bodies has"
            " dampers or materials with losses."
        )
    if system.breaks.size > 1:
        raise _refusal_of("loads that do not change, and this scene has some that do.")
    if len(system.R) > len(assembly.laws):
        raise _refusal_of("contacts without friction, and this scene has some with it.")
    if system.closed.any() or system.q.any() or run.force[0].any():
        raise _refusal_of("contacts that are open at the start, and bodies without deformation.")
    halves = np.diff(run.time)
    rounding = 4 * np.spacing(run.time[-1])
    even = halves.size % 2 == 0 and np.allclose(halves[::2], halves[1::2], 1e-6, rounding)
    if halves.size < 2 or not even:
        raise _refusal_of('steps with a force in their middle: take the method "exact".')
    jumps = np.abs(np.diff(run.force, axis=0)).max(axis=1)[halves == 0]
    if jumps.max(initial=0.0) > FORCE_ROUNDING * run.force.max():
        raise _refusal_of("forces without jumps, and one of this run jumps.")


def _proof_law(law: ContactLaw) -> tuple[ContactLaw, float]:
    """(law that replaces a contact law in the proof, force [N] up to which both agree)."""
    kernel = packed_law(law)[0]
    if getattr(law, "elastic_share", 0.0) > MAX_ELASTIC_SHARE:
        raise _refusal_of(
            f"a side that stays elastic with at most {MAX_ELASTIC_SHARE} of the flexibility."
        )
    if kernel.kind in PROVED_LAWS:
        return law, np.inf
    if kernel.kind in YIELDING_LAWS:
        k, limit = cast(kernel.params, POINTER(c_double))[:2]
        return Hertz(k, law.compliance), k * limit**1.5
    raise _refusal_of(
        f"a convex law without damping (Hertz, Linear, Power, ElasticPlastic), and"
        f" {type(law).__name__} is none."
    )


def _max_vectors(body: SceneBody) -> int:
    """Largest number of Krylov vectors of a model, 0 for a rigid body; else InputError."""
    model = body.body
    inner = getattr(model, "body", model)  # of an `Impactor`
    if isinstance(inner, AntiOscillators):
        known = inner.recurrence
        if known is None:
            raise _refusal_of(
                f"a model whose residual is known, and that of {body.name!r} is not: extract it"
                " with proof=True, by Krylov's method and a direct solver."
            )
        pairs = (inner.k0, known.k0), (inner.m_st, known.mass)
        if any(np.abs(a - b).max() > RECURRENCE_TOL * np.abs(b).max() for a, b in pairs):
            raise _refusal_of(f"the stiffness and mass of the extraction of {body.name!r}.")
        if isinstance(inner.damping, Damping) and np.ndim(inner.damping.ratio):
            raise _refusal_of(
                "one damping ratio of all modes or Rayleigh's damping, and the ratios of"
                f" {body.name!r} are those of single modes of the model."
            )
        return known.n
    if isinstance(inner, RigidMass | Sphere | Obstacle | RigidBody) and not body.omega.any():
        return 0
    raise _refusal_of(
        f"rigid bodies and models that extract made with proof=True, and {body.name!r} is a"
        f" {type(inner).__name__}."
    )


def _reference_body(assembly: Assembly, body: SceneBody, span: slice, n: int) -> _ReferenceBody:
    """The body of the modes `span` of the run, in the Galerkin modes of `n` Krylov vectors."""
    system = assembly.system
    beta, v, load = system.beta[:, span], system.v[span], system.loads[0, span]
    inner = getattr(body.body, "body", body.body)
    if not isinstance(inner, AntiOscillators):
        return _ReferenceBody(body.omega, 0 * body.omega, 0 * body.omega, beta, load, v)

    assert inner.recurrence is not None
    B = body.modes.B
    if B.shape[1] != len(inner.recurrence.k0):
        raise _refusal_of(f"sites that move independently, and those of {body.name!r} do not.")
    elastic = body.omega > 0
    for name, values in (("start without vibration", v), ("bear no loads", load)):
        if np.abs(values[elastic]).max(initial=0.0) > AMPLITUDE_ROUNDING * np.abs(values).max(
            initial=0.0
        ):
            raise _refusal_of(f"bodies that {name}, and {body.name!r} does not.")
    modes = inner.recurrence.modes(n)
    damping = inner.damping if isinstance(inner.damping, Damping) else NO_DAMPING
    scale = np.linalg.lstsq(B, beta.T, rcond=None)[0].T  # of the contacts in the sites

    rigid = modes.omega == 0

    def of_rigid(values: Array) -> Array:
        """Rigid-body amplitudes in the Galerkin modes, from the modal `values` of the run."""
        moved = np.zeros(rigid.size)
        motion = B[~elastic].T @ values[~elastic]
        moved[rigid] = np.linalg.lstsq(modes.b[rigid].T, motion, rcond=None)[0]
        return moved

    # the modes that would ring, and drive the error by it
    time = assembly.contact_time_estimate
    driving = np.linalg.norm(modes.drive(NO_DAMPING, 0 * modes.omega)[:, 0], axis=0)
    follows = driving * time > FOLLOWING_SHARE * modes.omega
    follows &= modes.omega * time > FOLLOWING_PHASE

    decay = damping.decay(modes.omega)
    braked = np.maximum(FOLLOWING_DECAY_RATIO * modes.omega, decay)
    held = np.where(follows, braked, decay)
    supported = None if rigid.any() else np.linalg.solve(inner.recurrence.k0, scale.T)
    return _ReferenceBody(
        modes.omega,
        held,
        2 * (held - decay) / np.where(rigid, 1.0, modes.omega) ** 2,
        scale @ modes.b.T,
        of_rigid(load),
        of_rigid(v),
        modes,
        damping,
        None if supported is None else np.sum(scale.T * supported, axis=0),
    )


def _compliances(bodies: Sequence[_ReferenceBody], x: Array) -> Array:
    """Upper bounds (m, n) [m/N] of Σ bᵀ(K + xM)⁻¹b for m contacts and x (n,) [rad²/s²]."""
    H = np.zeros((len(bodies[0].beta), x.size))
    for body in bodies:
        if body.modes is None:
            H += (body.beta**2).sum(axis=1)[:, None] / x
            continue
        own = np.array([body.modes.receptance(x, row) for row in body.beta])
        if body.compliance is not None:
            own = np.minimum(own, body.compliance[:, None])
        H += own
    return H


def _residual_channels(bodies: Sequence[_ReferenceBody]) -> tuple[Array, Array, Array]:
    """Factors (k, 5, J) from `ReferenceModes.drive` and (l, 5, J) from `losses`, bounds (J,) from
    `brake`, on the J modes of all bodies, for csrc/enclosure.c."""
    size = sum(body.omega.size for body in bodies)
    places = consecutive_slices([body.omega.size for body in bodies])
    rows, losses, brake = [np.zeros((0, 5, size))], [np.zeros((0, 5, size))], np.zeros(size)

    def padded(place: slice, own: Array) -> Array:
        """Coefficients `own` of one body, padded by zeros to the modes of all bodies."""
        return np.pad(own, ((0, 0), (0, 0), (place.start, size - place.stop)))

    for body, place in zip(bodies, places, strict=True):
        if body.modes is None:
            continue
        rows.append(padded(place, body.modes.drive(body.damping, body.lag)))
        if body.damping.decay(body.omega).any():
            losses.append(padded(place, body.modes.losses(body.damping)))
            brake[place] = body.modes.brake(body.damping)

    # of the force that a mode feels, with its lag times its rate
    channels = np.concatenate([*rows, *losses])
    lag = np.concatenate([body.lag for body in bodies])
    channels[:, 4] -= lag * (channels[:, 3] - lag * channels[:, 2])
    channels[:, 3] -= lag * channels[:, 2]
    drives = sum(len(own) for own in rows)
    return channels[:drives], channels[drives:], brake


def _enclosures_of_run(
    assembly: Assembly,
    run: Run,
    bodies: Sequence[_ReferenceBody],
    laws: Sequence[ContactLaw],
    n: int,
) -> tuple[Enclosure, ...]:
    """The bounds on the forces of a run, from `n` Krylov vectors of its bodies."""
    m = len(laws)
    omega, decay, lag, load, v = (
        np.concatenate([getattr(body, name) for body in bodies])
        for name in ("omega", "decay", "lag", "load", "v")
    )
    beta = np.ascontiguousarray(np.hstack([body.beta for body in bodies]))
    rates = RATE_RATIOS / float(run.time[-1]) ** 2
    compliances = np.ascontiguousarray(_compliances(bodies, rates)) * (1 + FORCE_ROUNDING)

    rows, losses, brake = _residual_channels(bodies)
    kernels = (library.CLaw * m)(*[packed_law(law)[0] for law in laws])
    nodes = run.time.size
    lower = np.zeros((nodes, m))
    upper = np.full((nodes, m), np.inf)
    time, peak, impulse = np.array(run.time), np.zeros((m, 2)), np.zeros((m, 2))
    reached = np.zeros(1, dtype=np.int64)
    inputs = [omega, decay, load, v, beta]
    inputs += [assembly.system.offsets[0, :m].copy(), np.concatenate([rows, losses]), brake, lag]
    times, forces = np.ascontiguousarray(run.time), np.ascontiguousarray(run.force[:, :m])
    outputs = [time, lower, upper, peak, impulse, reached]

    problem = library.CEnclosure(
        omega.size,
        len(rows),
        len(losses),
        m,
        *map(library.address, inputs),
        rates.size,
        library.address(rates),
        library.address(compliances),
        addressof(kernels),
        assembly.contact_time_estimate / MIN_TIME_PIECES,
        nodes,
        *map(library.address, [times, forces, *outputs]),
    )
    memory = np.empty(library.library.aom_enclosure_size(byref(problem)) // 8 + 1)
    library.library.aom_enclose(byref(problem), library.address(memory))
    if reached[0] < nodes - 1:
        peak[:, 1] = impulse[:, 1] = np.inf

    largest = float(peak[:, 0].max(initial=0.0))
    margin = FORCE_ROUNDING * largest
    lower = np.maximum(lower - margin, 0.0)
    upper += margin
    width = upper - lower
    results = []
    for c in range(m):
        wide = np.flatnonzero(width[:, c] > UNPREDICTED_WIDTH * largest)
        horizon = float(time[wide[0]]) if wide.size else float(time[-1])
        J, error = impulse[c]
        results.append(
            Enclosure(
                time,
                lower[:, c],
                upper[:, c],
                (max(float(peak[c, 0]) - margin, 0.0), float(peak[c, 1]) + margin),
                (max(float(J - error), 0.0), float(J + error)),
                horizon,
                n,
            )
        )
    return tuple(results)
