"""From derivatives by the numbers of the march to derivatives by the bodies.

`by_body` gives derivatives by a body's parameters; `changed` the first-order change of a goal
between two sets of bodies. If damping couples the modes, the march gives derivatives by its
first-order modes (`antiosc.engine.damping`); these modes are computed again at a small change of
each parameter, so that only modes are differenced, not runs.
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
#: Error tolerance of the comparison runs over that of the run.
FINER = 0.1
#: Least relative tolerance of these runs.
LEAST = 1e-7
#: Share of the anti-oscillators that the comparison run for the truncation error omits.
FEWER = 0.25
#: Modes whose frequencies differ by less than this share are a group: they mix under small changes.
CLOSE = 1e-2
#: Modal quantities that rotate with the modes of a group.
TURNING_POINT = ("beta", "loads", "q", "v", "B")
#: (recorded run, goal, derivatives of the goal by all numbers of the march).
Taken = tuple[Recorded, Seeds, Slopes]
#: A function that changes a model.
Turn = Callable[[AntiOscillators], AntiOscillators]
#: Relative steps of a parameter; the first one without a change of the kind of modes is used.
STEPS = (1e-4, 1e-5, 1e-6)
#: A mode that changes by more than this share is another mode.
OTHER = 1e-2
#: Modal quantities below this share of the largest are not compared.
VISIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class ByModes:
    """Derivatives of a goal by the modes of a body with one site, by their loads and initial
    motion.

    All have shape (J,): `square` by omega^2, `decay` by the decay constants, `site` by the
    displacements of the site, `load`, `start`; `r` is by the residual compliance. `v`, `g` (J,):
    modal velocities at the start, and loads.
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
    """Derivatives by the parameters of a body with one site; empty for other kinds of bodies.

    `closing`: the initial speed [m/s] with which the body closes its contact.
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
    """Derivatives by the matrices K and M of a model in its coordinates, both symmetric (C, C)."""

    K: Array
    M: Array


def by_matrices(model: AntiOscillators, by: ByModes) -> ByMatrices:
    """Derivatives by the matrices of a model of one site with coordinates lambda.

    The modes solve K phi = x M phi, phi' M phi = 1. A massless site (m0 = 0) follows the
    anti-oscillators; its compliance r is the mode without inertia.
    """
    hidden = model.hidden_count
    modes = by.modes
    assert modes.shape is not None
    phi = modes.shape[: model.n + 1, hidden:]
    x = modes.omega[hidden:] ** 2
    square, site, load, start, v, g, decay = (
        values[hidden:] for values in (by.square, by.site, by.load, by.start, by.v, by.g, by.decay)
    )
    if isinstance(model.damping, Damping):
        square = square + decay * _decay_slopes(model, modes.omega)[hidden:]
    rigid = (x == 0) & (phi[0] != 0)
    free = modes.inertia is not None
    if not free and rigid.any() and v.any():  # V b/(b b) of the one rigid mode that moves the site
        site = site.copy()
        site[rigid] -= start[rigid] * v[rigid] / phi[0, rigid]
    # loads and starts are phi' p with a given p: what the participations say; phi' M phi = 1
    first, coupling = site.copy(), np.outer(phi[0], site)  # coupling of mode k into mode j
    for slope, value in ((load, g), (start, v))[: 1 + free]:
        if value.any():
            coupling += np.outer(value, slope)
            first += model.m0 * float(phi[0] @ value) * slope
    differences = x - x[:, None]
    differences.flat[:: x.size + 1] = 1.0
    mode_matrix = coupling / differences
    mode_matrix.flat[:: x.size + 1] = square
    K = phi @ mode_matrix @ phi.T
    M = -phi @ (mode_matrix * x + np.diag(coupling.diagonal() / 2)) @ phi.T
    K[0] -= modes.r * (phi @ first)
    K[0, 0] -= modes.r**2 * by.r
    M[0] += modes.r * (phi @ (x * first))
    return ByMatrices((K + K.T) / 2, (M + M.T) / 2)


def _decay_slopes(model: AntiOscillators, omega: Array) -> Array:
    """Derivatives (J,) of the decay constants of free modes by omega^2."""
    d = model.damping
    assert isinstance(d, Damping)
    ratio = d.decay(omega) - d.alpha / 2 - d.beta * omega**2 / 2  # ratio_j omega_j
    slope = np.divide(ratio, 2 * omega**2, out=np.zeros_like(omega), where=omega > 0)
    return np.asarray(slope + d.beta / 2)


def through_start(record: Recorded, by: Slopes) -> Slopes:
    """Convert derivatives by initial forces and rest state to those by the data that determine
    them.

    The initial forces are F = law(beta q - gap - R F). With preload q is the equilibrium, omega^2 q
    = load - beta' F. Bodies whose damping couples the modes are left to `changed_coupled`.
    """
    by = deepcopy(by)
    s = record.system
    p = len(s.laws)
    beta = s.beta[:p]
    R = s.R[:p, :p]
    F = s.pressed
    depth = beta @ s.q - s.offsets[0, :p] - R @ F
    law_slopes = [_slopes(law, float(d)) for law, d in zip(s.laws, depth, strict=True)]
    stiffness = np.array([slope for slope, _ in law_slopes])
    force_slopes = np.linalg.solve(
        np.eye(p) + stiffness[:, None] * R, np.diag(stiffness)
    )  # dF/d(beta q)
    by_force = by.pressed.copy()
    spans = [(record.spans[n], record.places[n], record.coupled(n)) for n in record.bodies]
    mu = np.zeros(s.omega.size)
    if record.scene.preload:
        by_q = by.q if s.first is None else s.first.begun(by.q, by.v)
        H = np.diag(s.omega**2) + beta.T @ force_slopes @ beta
        scale = 1 / np.sqrt(np.where(H.diagonal() > 0, H.diagonal(), 1.0))
        right_side = scale * (by_q + beta.T @ force_slopes @ by_force)
        mu = scale * np.linalg.lstsq(scale[:, None] * H * scale, right_side, rcond=None)[0]
        by_force -= beta @ mu
    by_depth = force_slopes @ by_force
    for free, place, coupled in spans:
        if not coupled:
            by.loads[0, place] += mu[free]
            by.square[place] -= mu[free] * s.q[free]
            by.beta[:p, place] += np.outer(by_depth, s.q[free]) - np.outer(F, mu[free])
    if record.scene.preload:
        by.q[:] = 0.0
    by.offsets[0, :p] -= by_depth
    by.residual[:p, :p] -= np.outer(by_depth, F)
    by_law = np.linalg.solve(np.eye(p) + R * stiffness, by_force)
    by.laws += by_law[:, None] * np.array([slopes for _, slopes in law_slopes])
    by.pressed[:] = 0.0
    return by


def _slopes(law: Any, depth: float) -> tuple[float, Array]:
    """Derivatives of the force of a new contact at rest, by indentation and by law parameters."""
    by_parameters = np.zeros(library.LAW_SLOPES)
    library.library.aom_law_slopes(addressof(law.kernel[0]), depth, library.address(by_parameters))
    return float(law.tangent(depth, 0.0, law.touch(0.0))[0]), by_parameters


def changed(record: Recorded, seeds: Seeds, by: Slopes, before: Assembly, after: Assembly) -> float:
    """First-order change of the goal from one set of bodies to another.

    Modes of nearly equal frequencies mix under small changes. The squares of their frequencies are
    taken as a matrix X in the Krylov basis of the group and its site displacement; X and the
    displacements in that basis change smoothly.
    """
    a = before.system
    b = after.system
    if record.system.first is not None:
        return changed_coupled(record, seeds, by, before, after) + _beside_modes(
            seeds, by, before, after
        )
    if a.omega.shape != b.omega.shape or record.system.omega.shape != a.omega.shape:
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
        "B": seeds.B.T,
    }
    run_modes = _mode_data(record)
    modes_before = _mode_data(before)
    modes_after = _mode_data(after)
    total = 0.0
    for group, column in _groups(record):
        x = run_modes["square"][group]
        run_basis = _krylov(run_modes, group, column)
        # the goal does not depend on the axes of a group: hence its derivatives beside X's diagonal
        rotation_slope = np.sum(
            [run_modes[n][..., group].T @ slopes[n][..., group] for n in TURNING_POINT], axis=0
        )
        by_matrix = (rotation_slope.T - rotation_slope) / (2 * (x[:, None] - x + np.eye(x.size)))
        for values, sign in ((modes_before, -1), (modes_after, 1)):
            rotation = run_basis @ _krylov(values, group, column).T
            matrix = (rotation * values["square"][group]) @ rotation.T
            total += sign * float(np.sum(by_matrix * matrix))
            for name in ("square", "decay"):
                values[name][group] = rotation**2 @ values[name][group]
            for name in TURNING_POINT:
                values[name][..., group] = values[name][..., group] @ rotation.T
    total += sum(
        float(np.sum(slope * (modes_after[n] - modes_before[n]))) for n, slope in slopes.items()
    )
    return total + _beside_modes(seeds, by, before, after)


def _beside_modes(seeds: Seeds, by: Slopes, before: Assembly, after: Assembly) -> float:
    """The part of `changed` that residual compliances, gaps, friction and laws contribute."""
    a = before.system
    b = after.system
    pairs = [
        (by.residual, b.R - a.R),
        (by.offsets, b.offsets - a.offsets),
        (by.friction, b.slip - a.slip),
        (seeds.r, after.r - before.r),
    ]
    total = sum(float(np.sum(slope * change)) for slope, change in pairs)
    for slope, old_law, new_law in zip(by.laws, a.laws, b.laws, strict=True):
        total += float(slope @ (leading(new_law) - leading(old_law)))
        if old_law.kernel[0].kind == library.TABLE and old_law is not new_law:  # type: ignore[attr-defined]
            raise NotDifferentiableError(
                "there are no derivatives by the curves of a table: make it outside of build."
            )
    return total


def _mode_data(bodies: Assembly) -> dict[str, Array]:
    """Copies (…, J) of the modal data of some bodies."""
    s = bodies.system
    data = {
        "square": s.omega**2,
        "decay": s.decay,
        "beta": s.beta,
        "loads": s.loads,
        "q": s.q[None],
        "v": s.v[None],
        "B": bodies.B.T,
    }
    return {name: value.copy() for name, value in data.items()}


def _groups(record: Recorded) -> Iterator[tuple[slice, int]]:
    """Yields (modes of nearly equal frequency, column of the site) of bodies with one site."""
    for name, span in record.spans.items():
        omega = record.system.omega[span]
        column = record.columns[name].start
        if record.columns[name].stop != column + 1 or not omega.size:
            continue
        ends = np.flatnonzero(np.diff(omega) > CLOSE * omega[:-1]) + 1
        for start, end in zip([0, *ends], [*ends, omega.size], strict=True):
            if omega[end - 1] > omega[start] > 0:
                yield slice(span.start + start, span.start + end), column


def _krylov(values: dict[str, Array], group: slice, column: int) -> Array:
    """Orthonormal Krylov basis of a group: its squared frequencies and its site displacements."""
    x = values["square"][group]
    powers = np.vander((x - x.mean()) / np.ptp(x), increasing=True).T * values["B"][column, group]
    basis, R = np.linalg.qr(powers.T)
    return np.asarray(basis * np.where(R.diagonal() < 0, -1.0, 1.0))


def leading(law: ContactLaw) -> Array:
    """The parameters by which the C library has derivatives, padded with 0."""
    kind, values = law.kernel[0].kind, law.parameters()  # type: ignore[attr-defined]
    count = {library.TABLE: 0, library.HERTZ: 1}.get(kind, library.LAW_SLOPES - 1)
    first = values[: min(count, len(values) - 1)]
    slopes = np.zeros(library.LAW_SLOPES)
    slopes[: len(first)] = first
    slopes[-1] = law.compliance  # type: ignore[attr-defined]
    return slopes


def impact_of(hit: History) -> Impact | None:
    """The arguments of the `simulate` call of a run; None for a scene."""
    rerun = hit.budget.keywords["rerun"] if isinstance(hit.budget, partial) else None
    if rerun is None:
        return None
    return rerun.args[0]


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
    hit: History, derivatives: Taken, name: str, before: AntiOscillators, after: AntiOscillators
) -> float:
    """First-order change of the goal from one model of the body `name` to another."""
    return changed(*derivatives, *(assembly_with(hit, name, model) for model in (before, after)))


def by_springs(
    hit: History, by: Slopes, bodies: dict[str, Values], contacts: dict[tuple[str, str], Values]
) -> None:
    """Add the effect of friction springs to the derivatives by contacts and by speeds.

    Their stiffness follows from the contact law, the closing speed and the patches; it is
    differenced between scenes, not runs. Parameters of value 0 are kept fixed.
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
    """The scene with one field of a contact, or of its law, changed."""
    change: dict[str, Any] = {name: value}
    if not hasattr(contact, name):
        change = {"law": replace(contact.law, **change)}  # type: ignore[type-var]
    changed_contact = replace(contact, **change)
    return replace(scene, contacts=[changed_contact if c is contact else c for c in scene.contacts])


def _with_speed(scene: SceneParts, name: str, speed: float) -> SceneParts:
    """The scene with the speed of one body changed."""
    body: Any = scene.bodies[name]
    return replace(scene, bodies={**scene.bodies, name: replace(body, velocity=speed)})


def compared_runs(hit: History) -> list[tuple[History, Turn]]:
    """Runs whose differences give the error bars of a gradient, and how each changes the model.

    Finer steps; then fewer anti-oscillators, the residual mass on its softest possible spring
    (`antiosc.impact.truncation`), and the model corrected for its mesh.
    """
    budget = hit.budget if isinstance(hit, History) else None
    model = hit.assembly.scene.bodies.get("structure") if budget is not None else None
    if not isinstance(budget, partial) or not isinstance(model, AntiOscillators) or not model.n:
        raise InputError(
            "bars of a gradient need a run of simulate on anti-oscillators, one or more; leave"
            " error= out."
        )
    rerun = budget.keywords["rerun"]
    run_error = max(hit.error.values(), default=1e-3)
    tol = max(FINER * run_error, LEAST)
    fewer = model.n - max(1, round(FEWER * model.n))
    changes: list[Turn] = [lambda one: one, lambda one: one.truncated(fewer), softest_model]
    if model.strain_error is not None:
        changes.append(AntiOscillators.corrected)
    return [(rerun(change(model), tol), change) for change in changes]


def bar(values: Sequence[Any]) -> Any:
    """Error bars of derivatives, by name, from the values in the run and in the runs of
    `compared_runs`.

    A bar is None if it is unknown: m and omega of models of different sizes cannot be compared.
    """
    if isinstance(values[0], dict):
        return {n: bar([(derivatives or {}).get(n) for derivatives in values]) for n in values[0]}
    base, finer, *coarser_runs = (
        None
        if derivative is None or np.shape(derivative) != np.shape(values[0])
        else np.asarray(derivative)
        for derivative in values
    )
    if base is None or finer is None or (coarser_runs[0] is None and coarser_runs[1] is None):
        return None
    weights = (TRUNCATION_SAFETY, TRUNCATION_SAFETY, SAFETY)
    truncation, softest, mesh = (
        np.zeros(np.shape(base)) if derivative is None else weight * abs(derivative - finer)
        for weight, derivative in zip(weights, (*coarser_runs, None)[:3], strict=True)
    )
    total = abs(finer - base) + np.maximum(truncation, softest) + mesh
    if np.ndim(total):
        return total
    return float(total)


def first_order_weights(record: Recorded, weights: Array) -> Array:
    """Weights (n, 2 I + m) of readings for first-order modes, from (n, 2 J + m) for free modes."""
    first = record.system.first
    J = record.system.omega.size
    if first is None:
        return weights
    return np.hstack(
        [first.state_gradient(weights[:, :J], weights[:, J : 2 * J]), weights[:, 2 * J :]]
    )


def by_coupled(
    record: Recorded,
    by: Slopes,
    name: str,
    closing: float,
    change: Callable[[AntiOscillators, AntiOscillators], float],
) -> Values:
    """Derivatives by the parameters of a model of one site with a constant damping matrix.

    The derivative by `damping` is that by a common factor of the damping. None for m0 = 0 and k0 =
    0, which cannot decrease, and if two poles are nearly equal. `change` gives the change of the
    goal between two models; `closing` as in `by_body`.
    """
    model = record.bodies[name].body
    if not isinstance(model, AntiOscillators) or model.sites or record.driven:
        return {}
    result: Values = {}
    for key in ("m0", "k0", "m", "omega", "damping"):
        size = np.asarray(1.0 if key == "damping" else getattr(model, key))
        shares = np.eye(size.size).reshape(size.size, *size.shape)
        slopes = [_slope(model, key, share, change) for share in shares] if size.all() else [None]
        matrix = None if None in slopes else np.array(slopes, float).reshape(size.shape) / size
        result[key] = matrix if matrix is None or matrix.ndim else float(matrix)
    place = record.places[name]
    s = record.system.marched
    if closing and not record.system.q[record.spans[name]].any():
        result["initial_velocity"] = (
            float(by.q[place] @ s.q[place] + by.v[place] @ s.v[place]) / closing
        )
    return result


def _slope(
    model: AntiOscillators,
    name: str,
    share: Array,
    change: Callable[[AntiOscillators, AntiOscillators], float],
) -> float | None:
    """Derivative by a relative change of the entries `share` of a parameter; None if modes mix."""
    for step in STEPS:
        with suppress(NotDifferentiableError):
            ends = (
                _changed(model, name, relative_change * share) for relative_change in (-step, step)
            )
            return change(*ends) / (2 * step)
    return None


def _changed(model: AntiOscillators, name: str, by: Array) -> AntiOscillators:
    """The model with a parameter changed by a relative amount."""
    current: Any = getattr(model, name)
    if isinstance(current, DampingMatrix):
        root = np.sqrt(1 + by)
        factors = [(root * L, tau) for L, tau in current.factors]
        return replace(model, damping=from_factors(root * current.factor, factors))
    changes: dict[str, Any] = {name: current * (1 + by)}
    return replace(model, **changes)


def changed_coupled(
    record: Recorded, seeds: Seeds, by: Slopes, before: Assembly, after: Assembly
) -> float:
    """First-order change of the goal by the modes, from one set of bodies to another."""
    for bodies in (before, after):
        set_initial_forces(bodies)
    run_modes = _march_data(record)
    modes_before, modes_after = (
        _matched(run_modes, _march_data(bodies)) for bodies in (before, after)
    )
    change = {n: modes_after[n] - modes_before[n] for n in modes_before}
    squares = (modes_after["omega"] ** 2 - modes_before["omega"] ** 2)[0]
    total = float(by.square @ squares + by.decay @ change["decay"][0])
    total += float(np.sum(np.hstack([by.beta, by.gamma]) * change["beta"]))
    total += float(np.sum(by.loads * change["loads"]))
    total += float(np.append(by.q, by.v) @ change["state"][0])
    total += float(by.pressed @ (after.system.pressed - before.system.pressed))
    for (step, u, _), _, weights in seeds.readings:
        time_in_step = u * float(record.edges[step + 1] - record.edges[step])
        place = np.array([step]), np.array([time_in_step])
        state = np.hstack(integrated_states(record.run, record.system, *place))[0]
        modal_change = np.stack([change[n] @ state for n in ("B", "V", "rigid")])
        total += float(np.sum(weights * modal_change))
    return total


def _march_data(bodies: Assembly) -> dict[str, Array]:
    """Data of the integrated modes, and rows (n, I) or (n, 2 I) that map them to site motions."""
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


def _matched(first: dict[str, Array], second: dict[str, Array]) -> dict[str, Array]:
    """The modes `second` with their signs matched to `first`; NotDifferentiableError if they
    differ.
    """
    size = first["omega"].size
    if any(first[n].shape != second[n].shape for n in first):
        raise NotDifferentiableError(
            "the number of modes of the damped bodies changes with a parameter: change its damping"
            " by a per cent."
        )
    signatures = [
        np.concatenate([v["B"], v["loads"]]).reshape(-1, 2, size) for v in (first, second)
    ]
    scale = np.stack([np.ones(size), first["omega"][0]])  # of a and of b
    signs = np.where(np.sum(signatures[0] * signatures[1] * scale**2, axis=(0, 1)) < 0, -1.0, 1.0)
    for n in ("B", "V", "rigid", "beta", "loads", "state"):
        second[n] = (second[n].reshape(-1, 2, size) * signs).reshape(second[n].shape)
    pairs = [(first[n], second[n]) for n in ("omega", "decay")]
    pairs.append((first["B"][:, :size], second["B"][:, :size]))
    for a, b in pairs:
        deviation = np.abs(b - a) / np.maximum(
            np.abs(a).max(axis=0), VISIBLE * np.abs(a).max(initial=1e-300)
        )
        if deviation.max(initial=0.0) > OTHER:
            raise NotDifferentiableError(
                "two poles of the damped bodies nearly fall together: their modes turn into each"
                " other within a small change; change the damping by a per cent."
            )
    return second
