"""Energy of a contact, from its law along the nodes of a run."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from antiosc._types import Array
from antiosc.contact import ContactLaw, State


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
