"""What is expected of the modes above a measured band: they go on as the last ones in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from antiosc.studies.measured.modes import Modes, Tail

#: The lowest mode above the band lies at least this share above its top.
BEYOND = 0.02
#: Damping ratio where no mode is seen; least square of a displacement over the expected one.
TYPICAL, LEAST_SQUARE = 0.01, 1e-3
#: Modes above the band: the highest over its top, the least distance over the frequency, and the
#: modes in the band whose mean distance and mean square go on.
TAIL_END, TAIL_STEP, GOING_ON = 5.0, 0.15, 6
#: Standard deviations: of a frequency over the distance, of a square over the mean.
SPREAD, DOUBT = 0.5, 1.0
#: Variance of the relative mean square times the number of modes that it is taken of.
FEW = 2.0
#: Standard deviation of the logarithm of all distances.
STRETCH = 0.3


def expected_tail(modes: Modes, top: float) -> Tail:
    """Modes that go on above `top` [rad/s] as the last ones in the band, in growing distances.

    Where the distances grow beyond those of the part, each stands for several modes.
    """
    seen = modes.seen
    omega, last = modes.omega[:seen], slice(max(seen - GOING_ON, 0), seen)
    own = np.append(0.0, omega)[-GOING_ON - 1 :]
    gap = max(float(own[-1] - own[0]) / max(len(own) - 1, 1), 0.01 * top) if seen else top
    rigid = modes.root if modes.rigid is None else modes.rigid
    least = np.sum(rigid**2, axis=1) * (top**2 if modes.rigid is None else 0.5)
    mean = np.sum(modes.b[last] ** 2, axis=0) / max(min(seen, GOING_ON), 1)
    b2 = np.maximum(mean, least) + np.finfo(float).tiny
    at = [max((float(omega[-1]) if seen else 0.0) + gap, (1 + 2 * BEYOND) * top)]
    steps = []
    while at[-1] < TAIL_END * top or len(at) < 3:
        steps.append(max(gap, TAIL_STEP * at[-1]))
        at.append(at[-1] + steps[-1])
    step = np.array([*steps, steps[-1]])
    many = np.maximum(step / gap, 1.0)
    doubt = np.sqrt(DOUBT**2 / many + FEW / max(seen, 0.5))
    return Tail(np.array(at), SPREAD * step / np.array(at), many[:, None] * b2, doubt)


def with_tail(modes: Modes, tail: Tail) -> Modes:
    """The body with a tail as it is expected; the signs of its displacements are drawn."""
    seen, U = modes.seen, len(tail.omega)
    typical = float(np.median(modes.zeta[:seen])) if seen else TYPICAL
    signs = np.random.default_rng(0).choice((-1.0, 1.0), tail.b2.shape)
    signs[:, 0] = 1.0
    return replace(
        modes,
        omega=np.append(modes.omega[:seen], tail.omega),
        zeta=np.append(modes.zeta[:seen], np.full(U, typical)),
        b=np.vstack((modes.b[:seen], signs * np.sqrt(tail.b2))),
        tail=tail,
    )


def drawn(tail: Tail, top: float, random: np.random.Generator) -> Tail:
    """Another tail as probable: all its modes nearer or farther, then each."""
    U = len(tail.omega)
    stretch = np.exp(STRETCH * random.standard_normal())
    omega = top + stretch * (tail.omega - top)
    omega = omega * np.exp(tail.spread * random.standard_normal(U))
    b2 = stretch * tail.b2 * np.abs(1 + tail.doubt[:, None] * random.standard_normal(tail.b2.shape))
    omega = np.maximum(np.sort(omega), (1 + BEYOND) * top)
    return replace(tail, omega=omega, b2=np.maximum(b2, LEAST_SQUARE * tail.b2))
