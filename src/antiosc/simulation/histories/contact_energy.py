"""Energy of a contact, from its law along the nodes of a run."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from antiosc.base._types import Array
from antiosc.contact import ContactLaw, State
from antiosc.contact.compiled import Compiled, is_compiled


def stored_alone(law: ContactLaw, force: Array, depth: Array) -> Array:
    """Energy (n,) of a contact whose law knows its indentation alone."""
    return np.where(force != 0.0, law.energies(depth, law.touch(0.0)), 0.0)


def replay(
    law: ContactLaw,
    force: Array,
    depth: Array,
    spans: Iterable[tuple[int, int]],
    speeds: Iterable[float],
) -> tuple[Array, Array, Array]:
    """What one contact can give back and has lost by plasticity [J], and its damping force [N].

    Parameters
    ----------
    law : the contact's.
    force, depth : (n,) at the nodes.
    spans, speeds : first and last node of each contact, and its closing speed [m/s].

    Returns
    -------
    stored, plastic, damping : (n,) each; `plastic` up to the node.
    """
    stored, plastic, damping = (np.zeros(depth.size) for _ in range(3))
    state: State | None = None
    for (a, b), speed in zip(spans, speeds, strict=False):
        state = law.touch(speed, state)
        span = slice(a, b + 1)
        if is_compiled(law):
            assert isinstance(law, Compiled)
            if law.has_memory:
                stored[span], lost, state = _remembered(law, depth[span], state)
                plastic[span] += lost
            else:  # the state lasts as long as the contact
                stored[span] = law.energies(depth[span], state)
            if law.rate_dependent:
                damping[span] = force[span] - law.forces_at_rest(depth[span], state)
            if b < depth.size - 1:
                stored[b] = damping[b] = 0.0
            continue
        before = law.lost(state)
        for n in range(a, b + 1):
            delta = float(depth[n])
            if n > a:
                state = law.advance(delta, 0.0, state)
            if law.rate_dependent:
                damping[n] = float(force[n]) - law.force(delta, 0.0, state)
            stored[n] = law.energy(delta, state)
            plastic[n] += law.lost(state) - before
            before = law.lost(state)
        if b < depth.size - 1:
            stored[b] = damping[b] = 0.0
    return stored, np.cumsum(plastic), damping


def _remembered(law: Compiled, depth: Array, state: State) -> tuple[Array, Array, State]:
    """Stored energy (n,) of one contact of a law with memory, what each node loses, and its end.

    The state changes where the indentation exceeds its turning point and all before it, and is
    there the same whatever the nodes in between.
    """
    before = np.maximum.accumulate(np.append(state[1], depth[1:-1]))
    deeper = np.append(False, depth[1:] > before)
    stored, lost = law.energies(depth, state), np.zeros(depth.size)
    at = np.flatnonzero(deeper)
    if not at.size:
        return stored, lost, state
    states = [law.advance(delta, 0.0, state) for delta in depth[at].tolist()]
    lost[at] = np.diff([state[2], *(one[2] for one in states)])
    returns = np.flatnonzero(np.diff(at, append=depth.size) > 1)
    for k in returns.tolist():
        back = slice(at[k] + 1, at[k + 1] if k + 1 < at.size else None)
        stored[back] = law.energies(depth[back], states[k])
    return stored, lost, states[-1]


def path_work(force: Array, way: Array) -> Array:
    """Work (n, k) of forces along ways, both parabolas over every step, at its middle and end."""
    f0, f1, f2 = force[:-2:2], force[1:-1:2], force[2::2]
    w0, w1, w2 = way[:-2:2], way[1:-1:2], way[2::2]
    b, c = 4 * f1 - 3 * f0 - f2, 2 * (f0 - 2 * f1 + f2)
    d, e = 4 * w1 - 3 * w0 - w2, 4 * (w0 - 2 * w1 + w2)

    def until(u: float) -> Array:
        return np.asarray(
            f0 * d * u + (f0 * e + b * d) * u**2 / 2 + (b * e + c * d) * u**3 / 3 + c * e * u**4 / 4
        )

    whole = until(1.0)
    total = np.zeros_like(way)
    total[2::2] = np.cumsum(whole, axis=0)
    total[1::2] = total[:-1:2] + until(0.5)
    return total


def impulses(time: Array, force: Array) -> Array:
    """Integrals (n - 1, m) from node to node of forces (n, m) that are parabolas over steps."""
    f0, f1, f2 = force[:-2:2], force[1:-1:2], force[2::2]
    span, found = np.diff(time)[:, None], np.empty((time.size - 1, force.shape[1]))
    found[::2] = span[::2] * (5 * f0 + 8 * f1 - f2) / 12
    found[1::2] = span[1::2] * (5 * f2 + 8 * f1 - f0) / 12
    return found
