"""Static equilibrium of a scene: where it rests before anything moves.

With F(delta) the forces of the laws at rest, the equilibrium is the minimum of the potential

    sum omega^2 q^2/2 - load q + W(beta q - gap),

W convex: the contacts' potentials in series with the residual compliance. Newton's method with a
regularisation that vanishes (Levenberg) finds it, or diverges where there is none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.system import ContactState, System

#: Steps of the search for rest: the scenes of the quick tests need 10 at most.
_ITERATIONS = 400


def _resting_state(system: System) -> tuple[Array, Array]:
    """Modal displacements (J,) and contact forces (p,) at rest under the loads at t = 0."""
    laws = system.laws
    p = len(laws)
    states = _states(laws, [None] * p)
    beta = system.beta[:p]
    load = system.loads[0]
    gap = system.offsets[0, :p]
    square = system.omega**2
    rigid = square == 0
    q = np.zeros(load.size)
    force = np.zeros(p)
    size = float(np.abs(load).max())
    if size == 0.0 and not np.any(-gap > 0):
        return q, force

    # an elastic mode's own deflection is the first guess
    q[~rigid] = load[~rigid] / square[~rigid]
    typical = np.abs(beta).max() ** 2
    stiff = max(float(square.max(initial=0.0)), typical)
    damp = 1e-6 * stiff
    W, force, slope = _closed_contacts(laws, states, beta @ q - gap, system.R[:p, :p], force)

    value = 0.5 * square @ q**2 - load @ q + W
    for _ in range(_ITERATIONS):
        residual = load - square * q - beta.T @ force
        scale = size + float(np.abs(beta.T @ force).max())
        if np.abs(residual).max() <= 1e-12 * scale:
            return q, force
        H = np.diag(square) + beta.T @ slope @ beta
        while True:
            step = np.linalg.solve(H + damp * np.eye(q.size), residual)
            new = q + step
            W, new_force, stiffness = _closed_contacts(
                laws, states, beta @ new - gap, system.R[:p, :p], force
            )
            new_potential = 0.5 * square @ new**2 - load @ new + W
            if new_potential <= value + 1e-14 * abs(value):
                break
            damp *= 10
            if damp > 1e30 * stiff:
                break

        stalled = np.abs(step).max() <= 1e-15 * np.abs(new).max()
        q = new
        force = new_force
        slope = stiffness
        value = new_potential
        if stalled and np.abs(residual).max() <= 1e-8 * scale:
            return q, force
        damp = max(damp / 10, 1e-18 * stiff)
        if np.abs(q).max() > 1e12:
            break

    free = np.flatnonzero(np.abs(residual) > 1e-9 * scale)
    raise InputError(
        f"the scene has no static equilibrium to start from: {free.size} of its motions stay out of"
        f" balance under gravity and loads, no contact or support holds them. Support the bodies,"
        f" add contacts, or start without preload."
    )


def set_initial_forces(
    system: System,
    preload: bool = False,
    cut: tuple[Sequence[ContactState | None], Array] | None = None,
) -> None:
    """Set the forces of the contacts that are closed at the start.

    cut : states of contacts at the end of an earlier run, and their forces (p,) [N].
    """
    laws = system.laws
    p = len(laws)
    R = system.R[:p, :p]
    contacts: list[ContactState | None] = [None] * p if cut is None else list(cut[0])
    system.contact_states = None if cut is None else contacts
    if preload:
        system.q[:], system.pressed[:] = _resting_state(system)

    free = system.beta[:p] @ system.q - system.offsets[0, :p]
    if not preload and (free > 0).any():
        system.pressed[:] = _closed_contacts(laws, _states(laws, contacts), free, R, np.zeros(p))[1]
    if cut is not None:
        goes_on = [contact is not None and contact.closed for contact in contacts]
        system.pressed[:] = np.where(goes_on, np.maximum(cut[1], 0.0), system.pressed)
    if not system.pressed.any():
        return

    delta = np.maximum(free - R @ system.pressed, 0.0)
    system.depth[:] = np.maximum(system.depth, delta)

    if cut is not None:  # it may lie between two nodes
        rate = _row_rates(system).tolist()
        for c, contact in enumerate(contacts):
            if contact is not None and contact.closed:
                state = laws[c].advance(float(delta[c]), rate[c], contact.state)
                contacts[c] = contact._replace(state=state)

    energy = 0.5 * float(system.pressed @ R @ system.pressed)
    for law, d, state in zip(laws, delta.tolist(), _states(laws, contacts), strict=True):
        energy += law.energy(d, state) if cut is not None else law.potential(d, state)
    system.contact_energy = energy


def _states(laws: Sequence[ContactLaw], contacts: Sequence[ContactState | None]) -> list[State]:
    """State of each law at the start: that of its contact, or of a touch without speed."""
    return [
        law.touch(0.0) if contact is None else contact.state
        for law, contact in zip(laws, contacts, strict=True)
    ]


def _row_rates(system: System) -> Array:
    """Rates (m,) of the rows at the start, without what the forces contribute."""
    rate = system.beta @ system.v
    if system.gamma is None:
        return rate
    pull = system.omega**2 * system.q + 2 * system.decay * system.v
    return rate - system.gamma @ pull


def _closed_contacts(
    laws: Sequence[ContactLaw], states: list[State], free: Array, R: Array, guess: Array
) -> tuple[float, Array, Array]:
    """Potential [J] of all contacts, forces (p,) [N], and their derivatives (p, p) [N/m].

    free : (p,) indentations without forces; R : (p, p) residual compliance; guess : (p,) forces.
    """
    p = len(laws)
    force = guess.copy() if np.any(R) else np.zeros(p)
    for _ in range(1000):
        change = 0.0
        for c, law in enumerate(laws):
            free_depth = float(free[c] - R[c] @ force + R[c, c] * force[c])
            new = law.implicit(free_depth, float(R[c, c]), 0.0, 0.0, states[c], float(force[c]))
            change = max(change, abs(new - force[c]))
            force[c] = new
        if change <= 1e-14 * float(np.abs(force).max()) or not np.any(R):
            break

    delta = free - R @ force
    slopes = np.array(
        [law.tangent(float(delta[c]), 0.0, states[c])[0] for c, law in enumerate(laws)]
    )
    W = sum(law.potential(float(delta[c]), states[c]) for c, law in enumerate(laws))
    W += 0.5 * float(force @ R @ force)
    D = np.diag(slopes)
    return float(W), force, np.linalg.solve(np.eye(p) + D @ R, D)
