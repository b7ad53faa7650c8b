"""Signals of a run through the filter of a channel frequency class."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array
from antiosc.base.cfc import cfc_filter, memory_of, sampled
from antiosc.base.errors import AccuracyWarning, AntioscError, InputError, warn, without_warnings
from antiosc.base.texts import engineering
from antiosc.fem.platform import on_root
from antiosc.impact.histories import History
from antiosc.impact.histories.factors import AT_ONCE, AnyHistory, modes_of
from antiosc.impact.histories.motion import RunHistory

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

#: Samples in a period of the highest mode, and in the shortest contact; at most MOST of a signal.
#: On a bracket the peak acceleration through CFC1000 and CFC600 is within 6e-5 of that of 12
#: samples in a period (n = 20, 40 and 160).
OF_A_MODE, OF_A_CONTACT, MOST = 3, 50, 200_000
#: Least number of samples, in a run of a few microseconds.
FEW = 50


def filtered(
    history: RunHistory,
    body: str,
    times: Array,
    name: str,
    signal: Callable[[RunHistory, Array], Array],
    derivative: int,
) -> Array:
    """A derivative by time of a signal (n, …) of a run at `times` [s], through the filter `name`.

    `signal(history, t)` is the signal of a history at times. Before the start and after the end of
    the run, which is `long_enough`, the signal is what it is there.
    """
    memory = memory_of(name)
    begin = max(times.min() - memory, 0.0)
    end = min(times.max() + memory, history.time[-1])
    of_modes = OF_A_MODE * modes_of(history, body).omega.max(initial=0.0) / (2 * np.pi)
    of_contact = OF_A_CONTACT / history.assembly.contact_time_estimate
    rate = min(max(of_modes, of_contact), MOST / (end - begin))
    count = max(ceil(max(rate, 1 / sampled(name)) * (end - begin)), FEW)
    t, step = np.linspace(begin, end, count, retstep=True)
    values = np.concatenate(
        [signal(history, block) for block in np.array_split(t, ceil(count / AT_ONCE))]
    )
    margin = ceil(memory / step)
    columns = np.pad(values.reshape(count, -1), ((margin, margin), (0, 0)), "edge")
    smooth = cfc_filter(step, columns, name)[margin:-margin]
    from scipy.interpolate import CubicSpline  # which takes long to load

    at_times = CubicSpline(t, smooth)(times, derivative)
    return np.asarray(at_times).reshape(len(times), *values.shape[1:])


def long_enough(history: AnyHistory, times: Array, name: str, comm: Comm) -> RunHistory:
    """The history with the memory of the filter `name` after `times` [s]: the run is repeated for
    longer if it ends earlier.
    """
    if not isinstance(history, RunHistory):
        raise InputError(
            "a filter needs the motion before and after the times: probe the history of the scene,"
            " and name the body."
        )
    end = times.max() + memory_of(name)
    if history.time[-1] < end and isinstance(history, History) and history.source is not None:
        with suppress(AntioscError), without_warnings():  # the law may end its range
            history = history.again(duration=end)
    run_end = history.time[-1]
    if run_end < end * (1 - 1e-9):
        sentence = (
            f"The run ends at {engineering(run_end, 's')}, and values through {name} depend on the"
            f" motion up to {engineering(memory_of(name), 's')} later: those near the end are not"
            f" reliable. Simulate for {engineering(end, 's')}."
        )
        on_root(comm, partial(warn, sentence, AccuracyWarning))
    return history
