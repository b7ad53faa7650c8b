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
        if is_compiled(law) and not law.has_memory:  # the state lasts as long as the contact
            assert isinstance(law, Compiled)
            span = slice(a, b + 1)
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


def simpson(time: Array, force: Array) -> Array:
    """Integral of the force over each step, exact for its parabola."""
    step = time[2::2] - time[:-2:2]
    return np.asarray(step / 6 * (force[:-2:2] + 4 * force[1:-1:2] + force[2::2]))
