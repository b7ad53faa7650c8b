"""Static equilibrium of a scene before it moves.

With the forces F(delta) of the laws at rest, the equilibrium is the minimum of the potential

    sum omega^2 q^2/2 - load q + W(beta q - gap),

where the convex W contains the contacts' potentials in series with the residual compliance.
Newton's method with a vanishing (Levenberg) regularisation finds it, or diverges if there is none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.system import ContactState, System

#: Largest number of steps of the search for equilibrium; quick tests need 10 at most.
_MOST_ITERATIONS = 400


def _resting_state(system: System) -> tuple[Array, Array]:
    """Modal displacements (J,) and contact forces (p,) at rest under the loads at t = 0."""
    laws = system.laws
    p = len(laws)
    states = _states(laws, [None] * p)
    beta = system.beta[:p]
    R = system.R[:p, :p]
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

    def contact_state(q: Array, guess: Array) -> tuple[Array, Array, float]:
        """(contact forces (p,), indentations (p,), potential of the scene)."""
        free = beta @ q - gap
        force = _closing_forces(laws, states, free, R, guess)
        delta = free - R @ force
        W = _potential(laws, states, delta, R, force)
        return force, delta, float(0.5 * square @ q**2 - load @ q + W)

    force, delta, value = contact_state(q, force)
    for _ in range(_MOST_ITERATIONS):
        residual = load - square * q - beta.T @ force
        scale = size + float(np.abs(beta.T @ force).max())
        if np.abs(residual).max() <= 1e-12 * scale:
            return q, force
        H = np.diag(square) + beta.T @ _stiffness(laws, states, delta, R) @ beta
        while True:
            step = np.linalg.solve(H + damp * np.eye(q.size), residual)
            new = q + step
            new_force, new_delta, new_value = contact_state(new, force)
            if new_value <= value + 1e-14 * abs(value):
                break
            damp *= 10
            if damp > 1e30 * stiff:
                break

        stalled = np.abs(step).max() <= 1e-15 * np.abs(new).max()
        q, force, delta, value = new, new_force, new_delta, new_value
        if stalled and np.abs(residual).max() <= 1e-8 * scale:
            return q, force
        damp = max(damp / 10, 1e-18 * stiff)
        if np.abs(q).max() > 1e12:
            break

    free = np.flatnonzero(np.abs(residual) > 1e-9 * scale)
    raise InputError(
        f"the scene has no static equilibrium to start from: nothing holds {free.size} of its"
        " motions. Support the bodies, add contacts, or start without preload."
    )


def set_initial_forces(system: System, preload: bool = False) -> None:
    """Set the contact forces at the start; with `preload` also q, to static equilibrium."""
    p = len(system.laws)
    R = system.R[:p, :p]
    if preload:
        system.q[:], force = _resting_state(system)

    free = system.beta[:p] @ system.q - system.offsets[0, :p]
    if not preload and not (free > 0).any():
        return

    states = _states(system.laws, [None] * p)  # of laws that may touch: one may need a speed
    if not preload:
        force = _closing_forces(system.laws, states, free, R, np.zeros(p))

    system.start_forces[:] = force
    if force.any():
        delta = np.maximum(free - R @ force, 0.0)
        system.contacts["expected_depth"] = np.maximum(system.contacts["expected_depth"], delta)
        system.contact_energy = _potential(system.laws, states, delta, R, force)


def continue_contacts(
    system: System, contacts: Sequence[ContactState | None], forces: Array
) -> None:
    """Set the contact forces at the start: contacts that continue from an earlier run have its last
    `forces` (p,) [N], new ones (None) are in equilibrium."""
    laws = system.laws
    p = len(laws)
    R = system.R[:p, :p]
    free = system.beta[:p] @ system.q - system.offsets[0, :p]
    rates = system.beta @ system.v
    if system.gamma is not None:
        rates -= system.gamma @ (system.omega**2 * system.q + 2 * system.decay * system.v)
    new = np.zeros(p)
    if (free > 0).any():
        new = _closing_forces(laws, _states(laws, contacts), free, R, new)

    goes_on = [contact is not None and contact.closed for contact in contacts]
    system.start_forces[:] = np.where(goes_on, np.maximum(forces, 0.0), new)
    system.contact_states = contacts = list(contacts)
    if not system.start_forces.any():
        return

    delta = np.maximum(free - R @ system.start_forces, 0.0)
    system.contacts["expected_depth"] = np.maximum(system.contacts["expected_depth"], delta)
    energy = 0.5 * float(system.start_forces @ R @ system.start_forces)

    states = _states(laws, contacts)
    for c, (law, contact, d) in enumerate(zip(laws, contacts, delta.tolist(), strict=True)):
        state = states[c]
        if contact is not None and contact.closed:
            state = law.advance(d, float(rates[c]), state)
            contacts[c] = contact._replace(state=state)
        energy += law.energy(d, state)

    system.contact_energy = energy


def _states(laws: Sequence[ContactLaw], contacts: Sequence[ContactState | None]) -> list[State]:
    """State of each law at the start: that of its contact, or of a touch at zero speed."""
    return [
        law.touch(0.0) if contact is None else contact.state
        for law, contact in zip(laws, contacts, strict=True)
    ]


def _closing_forces(
    laws: Sequence[ContactLaw], states: list[State], free: Array, R: Array, guess: Array
) -> Array:
    """Contact forces (p,) [N], iterated from `guess`; `free` (p,) [m]: indentations without
    forces."""
    force = guess.copy() if np.any(R) else np.zeros(len(laws))
    for _ in range(1000):
        change = 0.0
        for c, law in enumerate(laws):
            free_depth = float(free[c] - R[c] @ force + R[c, c] * force[c])
            new = law.implicit(free_depth, float(R[c, c]), 0.0, 0.0, states[c], float(force[c]))
            change = max(change, abs(new - force[c]))
            force[c] = new
        if change <= 1e-14 * float(np.abs(force).max()) or not np.any(R):
            break

    return force


def _potential(
    laws: Sequence[ContactLaw], states: list[State], delta: Array, R: Array, force: Array
) -> float:
    """Potential [J] of contacts at indentations (p,) and of the residual compliance."""
    W = sum(law.potential(d, s) for law, d, s in zip(laws, delta.tolist(), states, strict=True))
    return W + 0.5 * float(force @ R @ force)


def _stiffness(laws: Sequence[ContactLaw], states: list[State], delta: Array, R: Array) -> Array:
    """Derivatives (p, p) [N/m] of the forces of contacts by their indentations without forces."""
    at_rest = zip(laws, delta.tolist(), states, strict=True)
    D = np.diag([law.tangent(d, 0.0, state)[0] for law, d, state in at_rest])
    return np.linalg.solve(np.eye(len(laws)) + D @ R, D)
