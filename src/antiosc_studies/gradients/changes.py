"""From derivatives by the numbers of the march to those by bodies.

By the parameters that a body was given; by the bodies themselves, the change of a goal between two
sets of them to first order. Where damping couples the modes, the march gives the derivatives by its
first-order modes (`antiosc.engine.damping`), and these are found anew at a small change of each
parameter: differences of the modes, not of runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from copy import deepcopy
from ctypes import addressof
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from antiosc import (
    AntiOscillators,
    Contact,
    ContactLaw,
    Damping,
    DampingMatrix,
    History,
    Impactor,
    ModalBody,
    Motion,
    RigidMass,
    Sphere,
)
from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotDifferentiableError
from antiosc.engine import library
from antiosc.engine.adjoint import Slopes
from antiosc.engine.damping import from_factors
from antiosc.extension import (
    SAFETY,
    TRUNCATION_SAFETY,
    Impact,
    SceneParts,
    assemble_pair,
    set_initial_forces,
    softest_model,
)
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.states import integrated_states
from antiosc_studies.gradients.goals import Recorded, Seeds

Values = dict[str, Any]
#: Relative error of the forces of the runs that are compared, over that of the run; the least.
FINER, LEAST = 0.1, 1e-7
#: Share of the anti-oscillators without which a run shows what truncation changes.
FEWER = 0.25
#: Frequencies that differ by less, relatively, are of one group: modes that turn into each other.
CLOSE = 1e-2
#: What the modes of a group have that turns with them.
TURNING = ("beta", "loads", "q", "v", "B")
#: A run, a goal and its derivatives by all numbers of the march.
Taken = tuple[Recorded, Seeds, Slopes]
#: Another model for a model.
Turn = Callable[[AntiOscillators], AntiOscillators]
#: Relative changes of a parameter on either side: the first in which no modes turn into others.
STEPS = (1e-4, 1e-5, 1e-6)
#: Relative change of a mode above which it is another one.
OTHER = 1e-2
#: Share of the largest below which a mode of other size is none to tell by.
VISIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class ByModes:
    """Derivatives by the modes of one body, by their loads and initial motion.

    square, decay, load, start (J,); site (J,) by the displacement of its one site, r by its
    residual compliance. `v`, `g` (J,): modal velocities at the start and loads.
    """

    modes: ModalBody
    square: Array
    decay: Array
    site: Array
    r: float
    load: Array
    start: Array
    v: Array
    g: Array


def by_body(body: Any, by: ByModes, closing: float) -> Values:
    """Derivatives by the parameters of a body with one site; empty for another kind of body.

    `closing`: the speed [m/s] at the start with which the body closes its contact.
    """
    values: Values = {}
    if isinstance(body, Impactor):
        values = by_body(body.body, by, closing)
        values.pop("initial_velocity", None)
    elif isinstance(body, RigidMass | Sphere):
        mass = body.mass
        values["mass"] = float(by.start @ by.v + by.load @ by.g - by.site @ by.modes.b) / (2 * mass)
    elif isinstance(body, AntiOscillators):
        K, M = by_matrices(body, by)
        springs = K[0, 0] + K.diagonal()[1:] - 2 * K[0, 1:]
        values = {
            "m0": None if by.modes.r > 0 else float(M[0, 0]),  # a massless site has none
            "k0": float(K[0, 0]),
            "m": M.diagonal()[1:] + body.omega**2 * springs,
            "omega": 2 * body.omega * body.m * springs,
        }
    else:
        return {}
    velocity = getattr(body, "velocity", 0.0)
    name = "velocity" if isinstance(body, RigidMass | Sphere | Impactor) else "initial_velocity"
    if isinstance(velocity, Motion):
        return values
    speed = velocity or closing
    if speed:
        values[name] = float(by.start @ by.v) / speed
    return values


class ByMatrices(NamedTuple):
    """Derivatives by the matrices K and M of a model in its coordinates, symmetric (C, C)."""

    K: Array
    M: Array


def by_matrices(model: AntiOscillators, by: ByModes) -> ByMatrices:
    """Derivatives by the matrices of a model of one site, coordinates lambda.

    The modes solve K phi = x M phi, phi' M phi = 1. With a massless site (m0 = 0) the site follows
    the others, and its compliance r is the mode without inertia.
    """
    hidden = model.hidden_count
    modes = by.modes
    assert modes.shape is not None
    phi = modes.shape[: model.n + 1, hidden:]
    x = modes.omega[hidden:] ** 2
    square, site, load, start, v, g, decay = (
        each[hidden:] for each in (by.square, by.site, by.load, by.start, by.v, by.g, by.decay)
    )
    if isinstance(model.damping, Damping):
        square = square + decay * _decay_slopes(model, modes.omega)[hidden:]
    rigid = (x == 0) & (phi[0] != 0)
    moving = modes.inertia is not None
    if (
        not moving and rigid.any() and v.any()
    ):  # V b/(b b) of the one rigid mode that moves the site
        site = site.copy()
        site[rigid] -= start[rigid] * v[rigid] / phi[0, rigid]
    # loads and starts are phi' p with a given p: what the participations say; phi' M phi = 1
    first, coupling = site.copy(), np.outer(phi[0], site)  # coupling of mode k into mode j
    for slope, value in ((load, g), (start, v))[: 1 + moving]:
        if value.any():
            coupling += np.outer(value, slope)
            first += model.m0 * float(phi[0] @ value) * slope
    apart = x - x[:, None]
    apart.flat[:: x.size + 1] = 1.0
    within = coupling / apart
    within.flat[:: x.size + 1] = square
    K = phi @ within @ phi.T
    M = -phi @ (within * x + np.diag(coupling.diagonal() / 2)) @ phi.T
    K[0] -= modes.r * (phi @ first)
    K[0, 0] -= modes.r**2 * by.r
    M[0] += modes.r * (phi @ (x * first))
    return ByMatrices((K + K.T) / 2, (M + M.T) / 2)


def _decay_slopes(model: AntiOscillators, omega: Array) -> Array:
    """Derivatives (J,) of the decays of free modes by their omega^2."""
    d = model.damping
    assert isinstance(d, Damping)
    ratio = d.decay(omega) - d.alpha / 2 - d.beta * omega**2 / 2  # ratio_j omega_j
    slope = np.divide(ratio, 2 * omega**2, out=np.zeros_like(omega), where=omega > 0)
    return np.asarray(slope + d.beta / 2)


def through_start(found: Recorded, by: Slopes) -> Slopes:
    """Convert derivatives by initial forces and a state of rest into derivatives by the other data.

    The forces are F = law(beta q - gap - R F). With preload q is the equilibrium, omega^2 q = load
    - beta' F. Of bodies whose damping couples the modes, `changed_coupled` takes it itself.
    """
    by = deepcopy(by)
    s = found.system
    p = len(s.laws)
    beta = s.beta[:p]
    R = s.R[:p, :p]
    F = s.pressed
    depth = beta @ s.q - s.offsets[0, :p] - R @ F
    each = [_slopes(law, float(d)) for law, d in zip(s.laws, depth, strict=True)]
    stiffness = np.array([slope for slope, _ in each])
    held = np.linalg.solve(np.eye(p) + stiffness[:, None] * R, np.diag(stiffness))  # dF/d(beta q)
    by_force = by.pressed.copy()
    spans = [(found.spans[n], found.places[n], found.coupled(n)) for n in found.bodies]
    mu = np.zeros(s.omega.size)
    if found.scene.preload:
        by_q = by.q if s.first is None else s.first.begun(by.q, by.v)
        H = np.diag(s.omega**2) + beta.T @ held @ beta
        scale = 1 / np.sqrt(np.where(H.diagonal() > 0, H.diagonal(), 1.0))
        wanted = scale * (by_q + beta.T @ held @ by_force)
        mu = scale * np.linalg.lstsq(scale[:, None] * H * scale, wanted, rcond=None)[0]
        by_force -= beta @ mu
    push = held @ by_force
    for free, own, coupled in spans:
        if not coupled:
            by.loads[0, own] += mu[free]
            by.square[own] -= mu[free] * s.q[free]
            by.beta[:p, own] += np.outer(push, s.q[free]) - np.outer(F, mu[free])
    if found.scene.preload:
        by.q[:] = 0.0
    by.offsets[0, :p] -= push
    by.residual[:p, :p] -= np.outer(push, F)
    by_law = np.linalg.solve(np.eye(p) + R * stiffness, by_force)
    by.laws += by_law[:, None] * np.array([slopes for _, slopes in each])
    by.pressed[:] = 0.0
    return by


def _slopes(law: Any, depth: float) -> tuple[float, Array]:
    """Derivatives of the force of a new contact at rest, by indentation and by parameters."""
    by_parameters = np.zeros(library.LAW_SLOPES)
    library.library.aom_law_slopes(addressof(law.kernel[0]), depth, library.address(by_parameters))
    return float(law.tangent(depth, 0.0, law.touch(0.0))[0]), by_parameters


def changed(found: Recorded, wanted: Seeds, by: Slopes, before: Assembly, after: Assembly) -> float:
    """First-order change of the goal from one set of bodies to another.

    Modes of nearly equal frequencies turn into each other within small changes. The squares of
    their frequencies are a matrix X with such a group, and what changes evenly is X beside the
    displacements of the site in the Krylov basis of both.
    """
    a = before.system
    b = after.system
    if found.system.first is not None:
        return changed_coupled(found, wanted, by, before, after) + _beside_modes(
            wanted, by, before, after
        )
    if a.omega.shape != b.omega.shape or found.system.omega.shape != a.omega.shape:
        raise NotDifferentiableError(
            "the number of modes changes with an input: build models with as many anti-oscillators."
        )
    slopes: dict[str, Array] = {
        "square": by.square,
        "decay": by.decay,
        "beta": by.beta,
        "loads": by.loads,
        "q": by.q[None],
        "v": by.v[None],
        "B": wanted.B.T,
    }
    here = _of_modes(found)
    one = _of_modes(before)
    other = _of_modes(after)
    total = 0.0
    for group, column in _groups(found):
        x = here["square"][group]
        base = _krylov(here, group, column)
        # the goal does not depend on the axes of a group: hence its derivatives beside X's diagonal
        twist = np.sum([here[n][..., group].T @ slopes[n][..., group] for n in TURNING], axis=0)
        by_matrix = (twist.T - twist) / (2 * (x[:, None] - x + np.eye(x.size)))
        for values, sign in ((one, -1), (other, 1)):
            turn = base @ _krylov(values, group, column).T
            matrix = (turn * values["square"][group]) @ turn.T
            total += sign * float(np.sum(by_matrix * matrix))
            for name in ("square", "decay"):
                values[name][group] = turn**2 @ values[name][group]
            for name in TURNING:
                values[name][..., group] = values[name][..., group] @ turn.T
    total += sum(float(np.sum(slope * (other[n] - one[n]))) for n, slope in slopes.items())
    return total + _beside_modes(wanted, by, before, after)


def _beside_modes(wanted: Seeds, by: Slopes, before: Assembly, after: Assembly) -> float:
    """The part of `changed` due to residual compliances, gaps, friction and laws."""
    a = before.system
    b = after.system
    pairs = [
        (by.residual, b.R - a.R),
        (by.offsets, b.offsets - a.offsets),
        (by.friction, b.slip - a.slip),
        (wanted.r, after.r - before.r),
    ]
    total = sum(float(np.sum(slope * change)) for slope, change in pairs)
    for slope, old, new in zip(by.laws, a.laws, b.laws, strict=True):
        total += float(slope @ (leading(new) - leading(old)))
        if old.kernel[0].kind == library.TABLE and old is not new:  # type: ignore[attr-defined]
            raise NotDifferentiableError(
                "there are no derivatives by the curves of a table: make it outside of build."
            )
    return total


def _of_modes(bodies: Assembly) -> dict[str, Array]:
    """Data of each mode, copies (…, J)."""
    s = bodies.system
    found = {
        "square": s.omega**2,
        "decay": s.decay,
        "beta": s.beta,
        "loads": s.loads,
        "q": s.q[None],
        "v": s.v[None],
        "B": bodies.B.T,
    }
    return {name: value.copy() for name, value in found.items()}


def _groups(found: Recorded) -> Iterator[tuple[slice, int]]:
    """Groups of nearly equal frequencies of bodies of one site, and the column of the site."""
    for name, span in found.spans.items():
        omega = found.system.omega[span]
        column = found.columns[name].start
        if found.columns[name].stop != column + 1 or not omega.size:
            continue
        ends = np.flatnonzero(np.diff(omega) > CLOSE * omega[:-1]) + 1
        for begin, end in zip([0, *ends], [*ends, omega.size], strict=True):
            if omega[end - 1] > omega[begin] > 0:
                yield slice(span.start + begin, span.start + end), column


def _krylov(values: dict[str, Array], group: slice, column: int) -> Array:
    """Orthonormal Krylov basis of the squared frequencies of a group and its site displacements."""
    x = values["square"][group]
    powers = np.vander((x - x.mean()) / np.ptp(x), increasing=True).T * values["B"][column, group]
    basis, R = np.linalg.qr(powers.T)
    return np.asarray(basis * np.where(R.diagonal() < 0, -1.0, 1.0))


def leading(law: ContactLaw) -> Array:
    """The parameters by which the C library has derivatives, padded by 0."""
    kind, values = law.kernel[0].kind, law.parameters()  # type: ignore[attr-defined]
    count = {library.TABLE: 0, library.HERTZ: 1}.get(kind, library.LAW_SLOPES - 1)
    first = values[: min(count, len(values) - 1)]
    slopes = np.zeros(library.LAW_SLOPES)
    slopes[: len(first)] = first
    slopes[-1] = law.compliance  # type: ignore[attr-defined]
    return slopes


def impact_of(hit: History) -> Impact | None:
    """The arguments of `simulate` of a run; None for a scene."""
    again = hit.budget.keywords["rerun"] if isinstance(hit.budget, partial) else None
    if again is None:
        return None
    return again.args[0]


def assembly_with(hit: History, name: str, model: AntiOscillators) -> Assembly:
    """The assembly of a run with another model for the body `name`."""
    impact = impact_of(hit)
    if impact is not None:
        return assemble_pair(impact._replace(model=model))
    scene = hit.assembly.scene
    return assemble_scene(
        replace(scene, bodies={**scene.bodies, name: model}), float(hit.run.time[-1])
    )


def changed_model(
    hit: History, taken: Taken, name: str, before: AntiOscillators, after: AntiOscillators
) -> float:
    """First-order change of the goal from one model of the body `name` to another."""
    return changed(*taken, *(assembly_with(hit, name, each) for each in (before, after)))


def by_springs(
    hit: History, by: Slopes, bodies: dict[str, Values], contacts: dict[tuple[str, str], Values]
) -> None:
    """Add the effect of friction springs to the derivatives by contacts and by speeds.

    The stiffness of such a spring follows from the law of its contact, how fast it closes, and the
    patches: differences of scenes, not of runs. What is 0 is held.
    """
    if not by.friction[:, 1].any():
        return
    scene = hit.assembly.scene
    end = float(hit.run.time[-1])

    def slope(size: float, other: Callable[[float], SceneParts]) -> float:
        step = STEPS[0] * size
        below, above = (assemble_scene(other(size + e), end).system.slip for e in (-step, step))
        return float(by.friction[:, 1] @ (above - below)[:, 1]) / (2 * step)

    for contact in scene.contacts:
        values = contacts[contact.a, contact.b]
        if contact.friction > 0 and contact.tangential_stiffness is not None:
            values["tangential_stiffness"] = 0.0
        for name in values:
            owner = contact if hasattr(contact, name) else contact.law
            if size := getattr(owner, name):
                values[name] += slope(size, partial(_with_contact, scene, contact, name))
    for key, values in bodies.items():
        speed = getattr(scene.bodies[key], "velocity", 0.0)
        if "velocity" in values and speed:
            values["velocity"] += slope(speed, partial(_with_speed, scene, key))


def _with_contact(scene: SceneParts, contact: Contact, name: str, value: float) -> SceneParts:
    """The scene with another value of a field of a contact, or of its law."""
    change: dict[str, Any] = {name: value}
    if not hasattr(contact, name):
        change = {"law": replace(contact.law, **change)}  # type: ignore[type-var]
    other = replace(contact, **change)
    return replace(scene, contacts=[other if c is contact else c for c in scene.contacts])


def _with_speed(scene: SceneParts, name: str, speed: float) -> SceneParts:
    """The scene with another speed of a body."""
    body: Any = scene.bodies[name]
    return replace(scene, bodies={**scene.bodies, name: replace(body, velocity=speed)})


def compared_runs(hit: History) -> list[tuple[History, Turn]]:
    """Runs whose differences show the errors of a gradient, and how each changes the model.

    Finer steps; with these fewer anti-oscillators, the residual mass on the softest spring that it
    may have (`antiosc.impact.truncation`), and the model corrected for its mesh.
    """
    budget = hit.budget if isinstance(hit, History) else None
    model = hit.assembly.scene.bodies.get("structure") if budget is not None else None
    if not isinstance(budget, partial) or not isinstance(model, AntiOscillators) or not model.n:
        raise InputError(
            "bars of a gradient need a run of simulate on anti-oscillators, one or more; leave"
            " error= out."
        )
    again = budget.keywords["rerun"]
    known = max(hit.error.values(), default=1e-3)
    tol = max(FINER * known, LEAST)
    less = model.n - max(1, round(FEWER * model.n))
    turns: list[Turn] = [lambda one: one, lambda one: one.truncated(less), softest_model]
    if model.strain_error is not None:
        turns.append(AntiOscillators.corrected)
    return [(again(turned(model), tol), turned) for turned in turns]


def bar(values: Sequence[Any]) -> Any:
    """Error bar of a derivative, from the run and from `compared_runs`, name by name.

    None where it is not known: m and omega of models of other sizes are not compared.
    """
    if isinstance(values[0], dict):
        return {n: bar([(each or {}).get(n) for each in values]) for n in values[0]}
    base, finer, *others = (
        None if one is None or np.shape(one) != np.shape(values[0]) else np.asarray(one)
        for one in values
    )
    if base is None or finer is None or (others[0] is None and others[1] is None):
        return None
    weights = (TRUNCATION_SAFETY, TRUNCATION_SAFETY, SAFETY)
    less, soft, mesh = (
        np.zeros(np.shape(base)) if one is None else weight * abs(one - finer)
        for weight, one in zip(weights, (*others, None)[:3], strict=True)
    )
    total = abs(finer - base) + np.maximum(less, soft) + mesh
    if np.ndim(total):
        return total
    return float(total)


def first_order_weights(found: Recorded, weights: Array) -> Array:
    """Readings (n, 2 I + m) in first-order modes, from those (n, 2 J + m) in free modes."""
    first = found.system.first
    J = found.system.omega.size
    if first is None:
        return weights
    return np.hstack(
        [first.state_gradient(weights[:, :J], weights[:, J : 2 * J]), weights[:, 2 * J :]]
    )


def by_coupled(
    found: Recorded,
    by: Slopes,
    name: str,
    closing: float,
    change: Callable[[AntiOscillators, AntiOscillators], float],
) -> Values:
    """Derivatives by the parameters of a model of one site with constant damping matrix.

    That by `damping` is by a factor of the whole damping. None by m0 = 0 and k0 = 0, which cannot
    decrease, and where two poles are nearly equal. `change`: that of the goal from one model to
    another; `closing` as in `by_body`.
    """
    model = found.bodies[name].body
    if not isinstance(model, AntiOscillators) or model.sites or found.driven:
        return {}
    result: Values = {}
    for key in ("m0", "k0", "m", "omega", "damping"):
        size = np.asarray(1.0 if key == "damping" else getattr(model, key))
        shares = np.eye(size.size).reshape(size.size, *size.shape)
        slopes = [_slope(model, key, share, change) for share in shares] if size.all() else [None]
        matrix = None if None in slopes else np.array(slopes, float).reshape(size.shape) / size
        result[key] = matrix if matrix is None or matrix.ndim else float(matrix)
    at = found.places[name]
    s = found.system.marched
    if closing and not found.system.q[found.spans[name]].any():
        result["initial_velocity"] = float(by.q[at] @ s.q[at] + by.v[at] @ s.v[at]) / closing
    return result


def _slope(
    model: AntiOscillators,
    name: str,
    share: Array,
    change: Callable[[AntiOscillators, AntiOscillators], float],
) -> float | None:
    """Derivative by a relative change of a parameter; `share` selects its entries.

    None where two modes turn into each other at once.
    """
    for step in STEPS:
        with suppress(NotDifferentiableError):
            ends = (_changed(model, name, by * share) for by in (-step, step))
            return change(*ends) / (2 * step)
    return None


def _changed(model: AntiOscillators, name: str, by: Array) -> AntiOscillators:
    """The model with a parameter changed relatively."""
    given: Any = getattr(model, name)
    if isinstance(given, DampingMatrix):
        root = np.sqrt(1 + by)
        factors = [(root * L, tau) for L, tau in given.factors]
        return replace(model, damping=from_factors(root * given.factor, factors))
    changes: dict[str, Any] = {name: given * (1 + by)}
    return replace(model, **changes)


def changed_coupled(
    found: Recorded, wanted: Seeds, by: Slopes, before: Assembly, after: Assembly
) -> float:
    """First-order change of the goal due to the modes, from one set of bodies to another."""
    for bodies in (before, after):
        set_initial_forces(bodies)
    here = _of_march(found)
    one, other = (_as_here(here, _of_march(bodies)) for bodies in (before, after))
    change = {n: other[n] - one[n] for n in one}
    squares = (other["omega"] ** 2 - one["omega"] ** 2)[0]
    total = float(by.square @ squares + by.decay @ change["decay"][0])
    total += float(np.sum(np.hstack([by.beta, by.gamma]) * change["beta"]))
    total += float(np.sum(by.loads * change["loads"]))
    total += float(np.append(by.q, by.v) @ change["state"][0])
    total += float(by.pressed @ (after.system.pressed - before.system.pressed))
    for (step, u, _), _, weights in wanted.readings:
        since = u * float(found.edges[step + 1] - found.edges[step])
        at = np.array([step]), np.array([since])
        state = np.hstack(integrated_states(found.run, found.system, *at))[0]
        moved = np.stack([change[n] @ state for n in ("B", "V", "rigid")])
        total += float(np.sum(weights * moved))
    return total


def _of_march(bodies: Assembly) -> dict[str, Array]:
    """Data of the integrated modes, and rows (n, I) or (n, 2 I) by which they move the sites."""
    s = bodies.system.marched
    first = bodies.system.first
    assert first is not None
    assert s.gamma is not None
    zero = np.zeros(bodies.B.T.shape)
    return {
        "omega": s.omega[None],
        "decay": s.decay[None],
        "beta": np.hstack([s.beta, s.gamma]),
        "loads": s.loads,
        "state": np.append(s.q, s.v)[None],
        "B": first.state_gradient(bodies.B.T, zero),
        "V": first.state_gradient(zero, bodies.B.T),
        "rigid": first.state_gradient(zero, np.where(bodies.system.omega == 0, bodies.B.T, 0.0)),
    }


def _as_here(one: dict[str, Array], other: dict[str, Array]) -> dict[str, Array]:
    """The `other` modes with signs matched; NotDifferentiableError if they differ in kind."""
    size = one["omega"].size
    if any(one[n].shape != other[n].shape for n in one):
        raise NotDifferentiableError(
            "the number of modes of the damped bodies changes with a parameter: change its damping"
            " by a per cent."
        )
    seen = [np.concatenate([v["B"], v["loads"]]).reshape(-1, 2, size) for v in (one, other)]
    scale = np.stack([np.ones(size), one["omega"][0]])  # of a and of b
    turn = np.where(np.sum(seen[0] * seen[1] * scale**2, axis=(0, 1)) < 0, -1.0, 1.0)
    for n in ("B", "V", "rigid", "beta", "loads", "state"):
        other[n] = (other[n].reshape(-1, 2, size) * turn).reshape(other[n].shape)
    pairs = [(one[n], other[n]) for n in ("omega", "decay")]
    pairs.append((one["B"][:, :size], other["B"][:, :size]))
    for a, b in pairs:
        off = np.abs(b - a) / np.maximum(
            np.abs(a).max(axis=0), VISIBLE * np.abs(a).max(initial=1e-300)
        )
        if off.max(initial=0.0) > OTHER:
            raise NotDifferentiableError(
                "two poles of the damped bodies nearly fall together: their modes turn into each"
                " other within a small change; change the damping by a per cent."
            )
    return other
