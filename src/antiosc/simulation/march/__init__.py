"""The march: modes under contact forces that are quadratic over a step. One source, two packages.

State: modal displacements and velocities x = (q, v) of all bodies side by side. With m rows beta,
one a contact and one or two more for its friction,

    q'' + 2 d q' + omega^2 q = load - beta^T F,      delta = beta q - gap - R F.

Over a step h each row's force is the parabola through its values at 0, h/2 and h, and the motion
under it is exact. The force law is met at h/2 and h (collocation at Lobatto's nodes: order 4 for a
smooth force, order 3 between the nodes; a massless contact point, R > 0, is nothing special). The
error of the parabola is estimated from its third divided difference with the step before and
decides on the step, a power of two, so that the responses of a step are found once.

A law is smooth in pieces: within bounds of indentation and rate (`piece`). A step that leaves the
piece of a contact ends where it does: touch, release, turn, cut and the kinks of loading curves
are located. While nothing touches the motion is free, and no touch is stepped over: what a chord
can miss is bounded by the amplitudes of the modes.

`antiosc.simulation.compilation` loads this package a second time, compiled by numba, where that
pays; its modules import each other by relative names, so that each copy has its own.
"""

from .course import march
from .curves import LAWS, change
from .layout import (
    APART,
    CAP,
    DAMPED,
    DEPTH,
    DONE,
    DURATION,
    EVENTS,
    FINE,
    FORCE,
    FORCE_SCALE,
    FRESH,
    FULL,
    GIVEN,
    GREW,
    HERTZ,
    HIGH,
    HIGHEST,
    KEEP,
    KNOWN,
    LEVEL,
    LEVELS,
    LINEAR,
    LOADED,
    LONGEST,
    MOST_STEPS,
    MOST_TOUCHES,
    NODES,
    POWER,
    RATE,
    REFUSED,
    RETRIES,
    ROOF,
    SHARE,
    SHIFTED,
    STATES,
    STEPS,
    STRONGE,
    STUCK,
    SURPLUS,
    TABLE,
    TAN_SUN,
    THORNTON,
    TOO_MANY_CONTACTS,
    TOO_MANY_STEPS,
    TOUCHES,
    USER,
    WORKED,
    YANG_SUN,
)
from .responses import response, responses
from .runs import compare, energies, mechanical, pulse

__all__ = [
    "APART", "CAP", "DAMPED", "DEPTH", "DONE", "DURATION", "EVENTS", "FINE", "FORCE",
    "FORCE_SCALE", "FRESH", "FULL", "GIVEN", "GREW", "HERTZ", "HIGH", "HIGHEST", "KEEP", "KNOWN",
    "LAWS", "LEVEL", "LEVELS", "LINEAR", "LOADED", "LONGEST", "MOST_STEPS", "MOST_TOUCHES",
    "NODES", "POWER", "RATE", "REFUSED", "RETRIES", "ROOF", "SHARE", "SHIFTED", "STATES", "STEPS",
    "STRONGE", "STUCK", "SURPLUS", "TABLE", "TAN_SUN", "THORNTON", "TOO_MANY_CONTACTS",
    "TOO_MANY_STEPS", "TOUCHES", "USER", "WORKED", "YANG_SUN", "change", "compare", "energies",
    "march", "mechanical", "pulse", "response", "responses",
]  # fmt: skip
