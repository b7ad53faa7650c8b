"""What a run of the march gives at its nodes: states between the steps, impulses and works."""

from __future__ import annotations

import numpy as np

from antiosc._types import Array
from antiosc.simulation.engine import Run, System
from antiosc.simulation.scene_states import between, states


def node_states(
    run: Run, system: System, first: int = 0, last: int | None = None
) -> tuple[Array, Array]:
    """Modal displacements and velocities (2 n + 1, J) from the start of step `first` to `last`."""
    assert run.states is not None
    last = len(run.states) - 1 if last is None else last
    ends = run.states[first : last + 1]
    q = np.empty((2 * (last - first) + 1, system.omega.size))
    v = np.empty_like(q)
    q[::2], v[::2] = ends[:, 0], ends[:, 1]
    if last > first:
        since = run.time[2 * first + 1 : 2 * last : 2] - run.time[2 * first : 2 * last : 2]

        def load(t: Array) -> Array:
            return between(t, system.breaks, system.loads)

        q[1::2], v[1::2] = states(run, system, load, np.arange(first, last), since)
    return q, v


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
