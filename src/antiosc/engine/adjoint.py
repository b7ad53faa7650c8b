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
    """Derivatives of a goal by the numbers of a `System`, with the shapes of these numbers.

    Attributes
    ----------
    square : (J,) by the squared frequencies omega^2.
    decay : (J,) by the decay constants; 0 without damping.
    residual : (m, m) by the residual compliance R.
    laws : (p, LAW_SLOPES) by the first parameters of the laws.
    friction : (p, 2) by the coefficient of friction and the tangential stiffness.
    pressed : (p,) by the forces at the start, taken as independent of the other numbers.
    gamma : by `System.gamma`; empty if the system has none.
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
    run: Run,
    states: Array,
    readings: NDArray[np.void],
    weights: Array,
    force: Array,
    time: Array,
) -> tuple[Slopes, float, int]:
    """Derivatives of a goal by all numbers of a system, its grazing, and the status of the library.

    The grazing is the least speed at which a contact touches or parts, over the largest.

    Parameters
    ----------
    run : Run
        The run, of n steps.
    states : (n + 1, 2, J) modal states at the start of each step and at the end.
    readings, weights : array of `library.READING`, and (., 2 J + m); see `aom_goal`.
    force : (2 n + 1, m) derivatives of the goal by the forces at the nodes.
    time : (n + 1,) derivatives of the goal by the times at which steps start and end.
    """
    packed = system.packed
    space = take_space(packed)
    options = library.COptions(float(run.time[-1]), 1.0, 0.0, 0.0, 0.0, 0, 0, 1)
    check_status(library.library.aom_start(space.stepper, byref(packed.system), byref(options)))
    arrays = [run.time, run.force, run.depth, states, run.exits, readings, weights, force, time]
    contiguous = [np.ascontiguousarray(array) for array in arrays]
    addresses = [library.address(array) for array in contiguous]
    record = library.CRecord(
        n_nodes=run.time.size,
        n_states=len(states),
        n_exits=len(contiguous[4]),
        every=1,
        time=addresses[0],
        force=addresses[1],
        depth=addresses[2],
        states=addresses[3],
        exits=addresses[4],
    )
    goal = library.CGoal(len(readings), *addresses[5:])
    pointers, slopes = _slopes_of(system)
    if space.work is None:
        space.work = np.empty(library.library.aom_gradient_size(space.stepper) // 8 + 1)
    work = library.address(space.work), space.work.nbytes
    places = byref(record), byref(goal), byref(slopes)
    status = library.library.aom_gradient(space.stepper, *places, *work)
    return_space(packed, space)
    return Slopes(*pointers), slopes.grazing, status


def _slopes_of(system: System) -> tuple[list[Array], library.CSlopes]:
    """Zero arrays of the shapes of `Slopes`, and their addresses for the C library."""
    s = system
    shapes = [s.omega.shape, s.decay.shape, s.beta.shape, s.R.shape, s.loads.shape, s.offsets.shape]
    shapes += [(len(s.laws), library.LAW_SLOPES), s.slip.shape, s.q.shape, s.v.shape]
    shapes += [s.pressed.shape, (0,) if s.gamma is None else s.gamma.shape]
    places = side_by_side([prod(shape) for shape in shapes])
    block = np.zeros(places[-1].stop)
    arrays = [block[place].reshape(shape) for place, shape in zip(places, shapes, strict=True)]
    block_address = library.address(block)
    slopes = library.CSlopes(*[block_address + 8 * place.start for place in places])
    if s.gamma is None:
        slopes.gamma = None
        if not s.decay.any():
            slopes.decay = None
    return arrays, slopes
