"""What damping ratios leave out of the dampers of an assembly: the coupling of the free modes.

In the free modes of a model the dampers are a matrix D, of which `AntiOscillators.damping` has the
diagonal: enough for resonance, but in an impact that is shorter than the beat of two modes the
other entries count as much. The same impact is integrated with D and with its diagonal, in equal
steps that are exact for a force linear in each; the larger difference of impulse, peak force and
contact time is the error of the run, apart from what the modes of the model do not have.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError
from antiosc.models.modal import ModalBody
from antiosc.models.model_info import info_of
from antiosc.simulation.bodies import Placed
from antiosc.simulation.history import History
from antiosc.simulation.main_impact import contact_time
from antiosc.simulation.system import System

#: Steps in all contacts together, and the most in the whole run.
STEPS, MOST_STEPS = 1000, 20_000
#: Differences of times below so many steps are the error of the steps.
TIME_STEPS = 2.0


def refuse_coupling(hit: History, tol: float) -> History:
    """The history with the error by the dampers of its bodies in `error` and `message`, if any.

    AccuracyError if it exceeds `tol`.
    """
    bodies = hit.assembly.bodies
    blocks = {name: _matrix(body) for name, body in bodies.items() if has_dampers(body.body)}
    if all(block is None for block in blocks.values()) or not hit.contacts:
        return hit
    own = np.diag(2 * hit.assembly.system.decay)
    whole = own.copy()
    for name, block in blocks.items():
        if block is not None:
            span = hit.assembly.spans[name]
            whole[span, span] += block - np.diag(np.diag(block))
    off = _difference(hit, own, whole)
    if off > tol:
        raise AccuracyError(
            "the dampers couple the modes of the model, which its damping ratios neglect: impulse, "
            f"peak force or contact time are off by {off:.2g}, more than tol = {tol:g}; take "
            f"weaker dampers or a tol above {off:.2g}."
        )
    told = f"The damping ratios neglect how the dampers couple the modes: an error of {off:.2g}."
    return replace(hit, error={**hit.error, "dampers": off}, message=f"{hit.message} {told}")


def has_dampers(model: Any) -> bool:
    """Whether damping ratios of the model stand for dampers of its assembly."""
    return info_of(model).dampers is not None and model.damping is not None


def _matrix(placed: Placed) -> Array | None:
    """D (J, J) of the dampers of a model in its free modes; None without shapes."""
    body, model = placed.modes, placed.body
    if not isinstance(body, ModalBody) or body.shape is None:
        return None
    facts = info_of(model).dampers
    assert facts is not None
    amplitudes = body.shape if body.amplitude is None else body.amplitude @ body.shape
    moved = np.asarray(facts["ends"])[:, : model.n + 1] @ amplitudes[: model.n + 1]
    return np.asarray(moved.T @ np.asarray(facts["damping"]) @ moved)


def _difference(hit: History, own: Array, whole: Array) -> float:
    """Largest relative difference of the impacts with the damping matrices `own` and `whole`."""
    start, touching = hit.contacts[0][0], sum(end - start for start, end in hit.contacts)
    span = float(hit.run.time[-1]) - start  # a contact may be new, or missing
    h = max(touching / STEPS, span / MOST_STEPS)
    q, v = (each[0] for each in hit.states(start))
    steps = int(np.ceil(span / h))
    one, other = (_impact(hit.assembly.system, D, q, v, h, steps) for D in (own, whole))
    off = np.abs(other - one) / np.maximum(one, np.finfo(float).tiny)
    off[2] -= min(off[2], TIME_STEPS * h / max(one[2], h))
    return float(off.max())


def _impact(system: System, D: Array, q: Array, v: Array, h: float, steps: int) -> Array:
    """(impulse, peak force, contact time) with the damping matrix D and a force linear in steps."""
    law, J, zero = system.laws[0], len(q), np.zeros(len(q))
    beta, r, gap = system.beta[0], system.R[0, 0], system.offsets[0, 0]
    rates = np.zeros((2 * J + 3, 2 * J + 3))  # of y = (q, v, force, its change in the step, 1)
    rates[:J, J : 2 * J] = np.eye(J)
    stiffness = np.diag(system.omega**2)
    rates[J : 2 * J] = np.column_stack([-stiffness, -D, -beta, zero, system.loads[0]])
    rates[2 * J, 2 * J + 1] = 1 / h
    move = scipy.linalg.expm(h * rates)
    pull = move[:, 2 * J + 1].copy()
    move[:, 2 * J] -= pull  # the change is minus the force, for a step that ends without one
    at = np.array([[*beta, *zero, 0, 0, -gap], [*zero, *beta, r / h, 0, 0]])
    alpha, alpha_rate = np.array([r, r / h]) - at[:, : 2 * J] @ pull[: 2 * J]
    y, state, force = np.array([*q, *v, 0, 0, 1]), law.touch(float(beta @ v)), np.zeros(steps + 1)
    for k in range(steps):
        F = float(force[k])
        y1 = move @ y
        y1[2 * J] = F  # of the rate of the residual compliance
        delta, rate = (float(one) for one in at @ y1)
        # without force while the bodies are apart, whatever the law says of the rate
        F1 = law.implicit(delta, alpha, rate, alpha_rate, state, F)
        F1 = F1 if delta > law.origin(state) else 0.0
        y, force[k + 1] = y1 + F1 * pull, F1
        y[2 * J :] = F1, 0, 1
        state = law.advance(delta - alpha * F1, rate - alpha_rate * F1, state)
    edges = np.flatnonzero(np.diff(np.append(0, force > 0), append=0)).reshape(-1, 2)
    time = contact_time((h * a, h * b, h * force[a:b].sum()) for a, b in edges)
    return np.array([h * force.sum(), force.max(), time])
