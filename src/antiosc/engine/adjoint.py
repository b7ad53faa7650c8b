"""Derivatives of a goal by all numbers of a system: the adjoint of a run."""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array
from antiosc.engine import library
from antiosc.engine.march import Run, check_status, return_space, take_space
from antiosc.engine.system import System, side_by_side


@dataclass(eq=False)
class Slopes:
    """Derivatives of a goal by the numbers of a `System`, of the same shapes.

    `square` (J,): by omega^2; `decay`: 0 without damping; `laws` (p, 3): by the first parameters
    of the laws; `friction` (p, 2) by its coefficient and the tangential stiffness; `pressed` (p,):
    by the forces at the start, as if these followed from nothing; `gamma`: of size 0 without it.
    """

    square: Array
    decay: Array
    beta: Array
    residual: Array
    loads: Array
    offsets: Array
    laws: Array
    friction: Array
    q: Array
    v: Array
    pressed: Array
    gamma: Array


def gradient(
    system: System,
    found: Run,
    states: Array,
    readings: NDArray[np.void],
    weights: Array,
    force: Array,
    time: Array,
) -> tuple[Slopes, float, int]:
    """Derivatives of a goal by all numbers of a system, the grazing, and the status.

    The grazing is the least speed at which a contact touches or parts, over the largest.

    Parameters
    ----------
    states : (n + 1, 2, J) at the edges of all steps of the run.
    readings, weights : of `library.READING`, and (., 2 J + m): `aom_goal`.
    force, time : (2 n + 1, m), (n + 1,) derivatives by the forces at nodes and the times of edges.
    """
    given = system.packed
    space = take_space(given)
    options = library.Options(float(found.time[-1]), 1.0, 0.0, 0.0, 0.0, 0, 0, 1)
    check_status(library.library.aom_start(space.stepper, byref(given.system), byref(options)))
    arrays = [found.time, found.force, found.depth, states, found.exits, readings, weights, force]
    given_arrays = [np.ascontiguousarray(each) for each in (*arrays, time)]
    at = [library.address(each) for each in given_arrays]
    run = library.Record(
        n_nodes=found.time.size,
        n_states=len(states),
        n_exits=len(given_arrays[4]),
        every=1,
        time=at[0],
        force=at[1],
        depth=at[2],
        states=at[3],
        exits=at[4],
    )
    goal = library.Goal(len(readings), *at[5:])
    out, slopes = _slopes_of(system)
    if space.work is None:
        space.work = np.empty(library.library.aom_gradient_size(space.stepper) // 8 + 1)
    work = library.address(space.work), space.work.nbytes
    places = byref(run), byref(goal), byref(slopes)
    answer = library.library.aom_gradient(space.stepper, *places, *work)
    return_space(given, space)
    return Slopes(*out), slopes.grazing, answer


def _slopes_of(system: System) -> tuple[list[Array], library.Slopes]:
    """Zeros of the shapes of `Slopes`, and where the C library finds them."""
    s = system
    shapes = [s.omega.shape, s.decay.shape, s.beta.shape, s.R.shape, s.loads.shape, s.offsets.shape]
    shapes += [(len(s.laws), library.LAW_SLOPES), s.slip.shape, s.q.shape, s.v.shape]
    shapes += [s.pressed.shape, (0,) if s.gamma is None else s.gamma.shape]
    places = side_by_side([prod(shape) for shape in shapes])
    block = np.zeros(places[-1].stop)
    out = [block[own].reshape(shape) for own, shape in zip(places, shapes, strict=True)]
    begin = library.address(block)
    slopes = library.Slopes(*[begin + 8 * own.start for own in places])
    if s.gamma is None:
        slopes.gamma = None
        if not s.decay.any():
            slopes.decay = None
    return out, slopes
