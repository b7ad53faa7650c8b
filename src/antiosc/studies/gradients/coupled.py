"""Bodies whose damping couples their modes: by differences of the modes, not of runs.

The march gives the derivatives by its first-order modes (`antiosc.models.damping`). These are
found anew at a small change of each parameter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import NotDifferentiableError
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.damping import DampingMatrix, of_factors
from antiosc.simulation.assembly import Assembly
from antiosc.simulation.march.engine import Slopes
from antiosc.simulation.states import marched_states
from antiosc.studies.gradients.goals import Seeds
from antiosc.studies.gradients.parameters import Values
from antiosc.studies.gradients.recorded import Recorded

#: Relative changes of a parameter on either side: the first in which no modes turn into others.
STEPS = (1e-4, 1e-5, 1e-6)
#: Relative change of a mode above which it is another one.
OTHER = 1e-2
#: Share of the largest below which a mode of other size is none to tell by.
VISIBLE = 1e-3


def first_order_weights(found: Recorded, weights: Array) -> Array:
    """Weights (n, 2 I + m) of readings in the modes of the march, from those (n, 2 J + m)."""
    first, J = found.system.first, found.system.omega.size
    if first is None:
        return weights
    return np.hstack([first.seen(weights[:, :J], weights[:, J : 2 * J]), weights[:, 2 * J :]])


def by_coupled(
    found: Recorded,
    by: Slopes,
    name: str,
    closing: float,
    change: Callable[[AntiOscillators, AntiOscillators], float],
) -> Values:
    """Derivatives by the parameters of a model of one site; its damping matrix stays.

    `damping`: by a factor of the whole damping. None: by m0 = 0 and k0 = 0, the ends of a range,
    and where two poles nearly fall together.
    `change` of the goal from one model to another; `closing` as in `by_body`.
    """
    model = found.parts[name].body
    if not isinstance(model, AntiOscillators) or model.sites or found.driven:
        return {}
    result: Values = {"m0": None, "k0": None, "m": np.zeros(model.n), "omega": np.zeros(model.n)}
    for key, place in _parameters(model):
        slope = _slope(model, key, place, change)
        if place is None or slope is None:
            result[key] = slope
        elif result[key] is not None:
            result[key][place] = slope
    at, s = found.places[name], found.system.marched
    if closing and not found.system.q[found.parts[name].span].any():
        result["initial_velocity"] = float(by.q[at] @ s.q[at] + by.v[at] @ s.v[at]) / closing
    return result


def _parameters(model: AntiOscillators) -> Iterator[tuple[str, int | None]]:
    """Name and place in its array of each parameter."""
    yield from ((name, None) for name in ("m0", "k0") if getattr(model, name) > 0)
    yield from ((name, i) for name in ("m", "omega") for i in range(model.n))
    yield "damping", None


def _slope(
    model: AntiOscillators,
    name: str,
    place: int | None,
    change: Callable[[AntiOscillators, AntiOscillators], float],
) -> float | None:
    """The derivative by a parameter; None where two modes turn into each other at once."""
    given = getattr(model, name)
    size = 1.0 if name == "damping" else float(given if place is None else given[place])
    for step in STEPS:
        with suppress(NotDifferentiableError):
            ends = (_changed(model, name, place, by) for by in (-step, step))
            return change(*ends) / (2 * step * size)
    return None


def _changed(model: AntiOscillators, name: str, place: int | None, by: float) -> AntiOscillators:
    """The model with another value of a parameter, relatively."""
    given: Any = getattr(model, name)
    if isinstance(given, DampingMatrix):
        root = np.sqrt(1 + by)
        scaled = of_factors(root * given.factor, [(root * L, tau) for L, tau in given.factors])
        return replace(model, damping=scaled)
    share = 1.0 if place is None else np.eye(model.n)[place]
    changes: dict[str, Any] = {name: given * (1 + by * share)}
    return replace(model, **changes)


def changed_coupled(
    found: Recorded, wanted: Seeds, by: Slopes, before: Assembly, after: Assembly
) -> float:
    """Change of the goal by the modes of one set of bodies to another, to first order."""
    here = _of_march(found)
    one, other = (_as_here(here, _of_march(bodies)) for bodies in (before, after))
    change = {n: other[n] - one[n] for n in one}
    squares = (other["omega"] ** 2 - one["omega"] ** 2)[0]
    total = float(by.square @ squares + by.decay @ change["decay"][0])
    total += float(np.sum(np.hstack([by.beta, by.gamma]) * change["beta"]))
    total += float(np.sum(by.loads * change["loads"]))
    total += float(np.append(by.q, by.v) @ change["state"][0])
    for (step, u, _), _, own in wanted.readings:
        since = u * float(found.edges[step + 1] - found.edges[step])
        at = np.array([step]), np.array([since])
        state = np.hstack(marched_states(found.run, found.system, *at))[0]
        moved = np.stack([change[n] @ state for n in ("B", "V", "rigid")])
        total += float(np.sum(own * moved))
    return total


def _of_march(bodies: Assembly | Recorded) -> dict[str, Array]:
    """What the march takes of the modes, and how these move the sites, rows (n, I) or (n, 2 I)."""
    s, first = bodies.system.marched, bodies.system.first
    assert first is not None
    assert s.gamma is not None
    zero = np.zeros(bodies.B.T.shape)
    return {
        "omega": s.omega[None], "decay": s.decay[None], "beta": np.hstack([s.beta, s.gamma]),
        "loads": s.loads, "state": np.append(s.q, s.v)[None],
        "B": first.seen(bodies.B.T, zero), "V": first.seen(zero, bodies.B.T),
        "rigid": first.seen(zero, np.where(bodies.system.omega == 0, bodies.B.T, 0.0)),
    }  # fmt: skip


def _as_here(one: dict[str, Array], other: dict[str, Array]) -> dict[str, Array]:
    """The others with the signs of the modes here; NotDifferentiableError for other modes."""
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
