"""`monte_carlo`: runs with inputs drawn from distributions, and their storage in a file."""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from antiosc import ImpactMap, simulate_many
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import (
    AccuracyWarning,
    AntioscError,
    InputError,
    check_signature,
    warn,
    without_warnings,
)
from antiosc.base.files import atomic_file, check_readable
from antiosc.base.progress import counting
from antiosc.base.texts import STOPPED
from antiosc.extension import check_executor, completed_calls, rows_of
from antiosc_studies.chance.sample import QUANTILES, Sample, checked_levels

#: Runs are computed, stored and sent to an executor in chunks of at least this many runs, so that
#: writing a chunk costs little beside its runs, …
TOGETHER = 100
#: … and in at most this many chunks: an interrupted study loses at most one per cent of its runs.
PARTS = 100
#: First runs, computed before all others: if all of them fail alike, the study ends. Of runs of
#: which a half fails, that is a chance of 0.1 %.
TRIED = 10
#: Most runs of a study.
MOST = 10_000_000
#: Results of an impact that are kept.
QUANTITIES = ("peak_force", "impulse", "contact_time", "restitution")
#: Columns of a stored campaign: number of the run, and why it failed.
NUMBER = "run"
ERROR = "error"
#: Results of a run by name, or the message of its failure.
Row = dict[str, float] | str


def normal(mean: float, sigma: float | None = None, *, variation: float | None = None) -> Any:
    """The normal distribution of this mean and standard deviation, both in the input's unit.

    `variation`, in place of `sigma`: the standard deviation over the mean, as of `lognormal`.
    Returns a frozen distribution of scipy.stats, as do `lognormal` and `uniform`.
    """
    from scipy.stats import norm

    mean = checks.number("mean", mean)
    if (sigma is None) == (variation is None):
        raise InputError("sigma, or variation (sigma over the mean): normal takes one of them.")
    if variation is not None:
        sigma = checks.positive("variation", variation) * abs(mean)
    return norm(mean, checks.positive("sigma", sigma))


def lognormal(mean: float, variation: float) -> Any:
    """The lognormal distribution of this mean and coefficient of variation.

    `variation` is the standard deviation over the mean: lognormal(70e9, 0.03) is 70 GPa ± 3 %.
    """
    from scipy.stats import lognorm

    mean = checks.positive("mean", mean)
    variation = checks.positive("variation", variation)
    sigma = np.sqrt(np.log1p(variation**2))
    return lognorm(sigma, scale=mean * np.exp(-(sigma**2) / 2))


def uniform(low: float, high: float) -> Any:
    """The uniform distribution between `low` and `high`."""
    from scipy.stats import uniform as between

    low = checks.number("low", low)
    high = checks.number("high", high)
    if not low < high:
        raise InputError(f"low must be below high; got {low:g} and {high:g}.")
    return between(low, high - low)


def is_name(name: object) -> bool:
    """Whether `name` can name an argument: "mass", "impactor.mass"."""
    return isinstance(name, str) and all(part.isidentifier() for part in name.split("."))


def checked(inputs: object) -> dict[str, Any]:
    """The inputs of a study by name, each a distribution or a sequence of values; InputError if
    not.
    """
    kind = 'a dict, such as {"velocity": normal(2.0, 0.1)}'
    by_name = dict(checks.instance("inputs", inputs, Mapping, kind))
    if not by_name:
        raise InputError("inputs is empty: name at least one input and its distribution.")
    for name, distribution in by_name.items():
        if not is_name(name):
            raise InputError(f"{checks.shown(name)} is no name of an argument.")
        is_sequence = isinstance(
            distribution, Sequence | np.ndarray | ImpactMap
        ) and not isinstance(distribution, str)
        if not (is_sequence and len(distribution)) and not hasattr(distribution, "ppf"):
            raise InputError(
                f"{name} must be a distribution with `ppf`, such as normal(2.0, 0.1) or one of"
                " scipy.stats, a sequence of values, or an ImpactMap; got"
                f" {checks.shown(distribution)}."
            )
    return by_name


def draws(inputs: Mapping[str, Any], n: int, seed: int) -> dict[str, np.ndarray]:
    """`n` independent draws of each input: numbers, or indices into a sequence of values.

    Sites of an `ImpactMap` are drawn by their areas. Draw i of an input depends only on `seed`, on
    i and on the position of the input, so that a larger `n` begins with the draws of a smaller one.
    """
    draws_by_name = {}
    streams = np.random.SeedSequence(seed).spawn(len(inputs))
    for stream, (name, distribution) in zip(streams, inputs.items(), strict=True):
        shares = np.random.default_rng(stream).random(n)
        if hasattr(distribution, "ppf"):
            draws_by_name[name] = quantiles(name, distribution, shares)
        else:
            weights = (
                distribution.areas
                if isinstance(distribution, ImpactMap)
                else np.ones(len(distribution))
            )
            ends = np.cumsum(weights) / np.sum(weights)
            draws_by_name[name] = np.searchsorted(ends[:-1], shares, side="right")
    return draws_by_name


def quantiles(name: str, distribution: Any, shares: np.ndarray) -> np.ndarray:
    """Quantiles (n,) of an input at probabilities `shares`; InputError if `ppf` returns invalid
    ones.
    """
    try:
        values = distribution.ppf(shares)
    except Exception as error:  # of any package
        cause = f"{type(error).__name__}: {error}"
        raise InputError(
            f"ppf of {name} must take an array of shares; it failed ({cause})."
        ) from error
    return checks.floats(f"what ppf of {name} returns", values, shares.shape)


def value(distribution: Any, draw: Any) -> Any:
    """The argument that the run function gets for one draw of an input."""
    if hasattr(distribution, "ppf"):
        return float(draw)
    if isinstance(distribution, ImpactMap):
        return distribution.model(int(draw))
    return distribution[int(draw)]


def monte_carlo(
    run: Callable[..., Any],
    inputs: Mapping[str, Any],
    n: int = 1000,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    store: str | os.PathLike[str] | None = None,
    quantiles: Sequence[float] = QUANTILES,
) -> Sample:
    """Repeat a run with independent random inputs: the distribution of its results.

    Parameters
    ----------
    run : callable
        A function of the inputs' names. It returns the arguments of `simulate`, (model, impactor,
        contact, duration), and the impacts are then simulated in batches; or a `History`; or
        numbers by name; or one number. Create objects that no input changes, such as a model, once
        outside of it. An AntioscError that it raises is stored as the failure of that run.
    inputs : dict
        Name -> distribution: `normal`, `lognormal`, `uniform`, any frozen one of scipy.stats; a
        sequence of values that are equally probable (points, models, laws); or an `ImpactMap`: the
        function is given the model at a site of its surface, drawn by area.
    n : int
        Number of runs.
    seed : int
        Seed of the draws. With the same seed and a larger n, the first runs stay the same.
    executor : concurrent.futures.Executor, optional
        Computes the runs, 100 at a time: processes, `mpi4py.futures`, dask.distributed's
        `Client.get_executor()`. Runs that it loses count as failed.
    store : path, optional
        A CSV file to which finished runs are added as they come. If it exists, its runs are reused
        and only the missing and failed ones are computed, so that an interrupted campaign
        continues. On several MPI ranks that all make the same calls it is refused: give an
        executor on one of them.
    quantiles : sequence of floats
        Shares of the results below the quantiles that tables and pictures tell: by default the
        median and the ends of the middle 90 %; 0.99 has 1 % of the results above it.

    Returns
    -------
    Sample

    Warns
    -----
    AccuracyWarning
        Some runs failed.

    Raises
    ------
    InputError
        For inputs that are no distributions, a `store` of another campaign, and a `run` that
        returns something else.
    AntioscError
        If all runs fail; without an executor, if the first ten fail with one message.
    """
    checks.function("run", run, "a function of the inputs")
    by_name = checked(inputs)
    levels = checked_levels(quantiles)
    size = checks.whole("n", n, most=MOST)
    check_signature("run", run, by_name)
    check_executor(executor)
    inputs_drawn = draws(by_name, size, checks.whole("seed", seed, least=0))
    mpi = sys.modules.get("mpi4py.MPI")
    if store is not None and executor is None and mpi is not None and mpi.COMM_WORLD.size > 1:
        raise InputError(
            f"store is one file, and {mpi.COMM_WORLD.size} MPI ranks would all write it: run the"
            " campaign on one, with executor=mpi4py.futures.MPIPoolExecutor()."
        )
    path = None if store is None else checks.new_file("store", store)
    rows = {} if path is None else _stored(path, inputs_drawn)
    open_runs = [i for i in range(size) if isinstance(rows.get(i, ""), str)]
    chunk_size = max(TOGETHER, -(-len(open_runs) // PARTS))
    # runs that are made again may be those that failed
    tried = TRIED if executor is None and len(open_runs) == size else 0
    starts = range(tried, len(open_runs), chunk_size)
    others = [open_runs[k : k + chunk_size] for k in starts]
    chunks = [open_runs[:tried], *others] if tried else others
    arguments_of_chunks = [[_values(by_name, inputs_drawn, i) for i in part] for part in chunks]
    with counting("runs", len(open_runs)) as report, _storing(path, inputs_drawn, rows) as keep:
        count = 0
        for k, chunk_rows in chunk_results(run, arguments_of_chunks, executor):
            part = dict(zip(chunks[k], chunk_rows, strict=True))
            rows.update(part)
            keep(part)
            count += len(chunk_rows)
            report(count)
            if count == tried < size:
                _refuse_if_alike(chunk_rows, size)
    sample = sample_of("runs", inputs_drawn, [rows[i] for i in range(size)])
    return replace(sample, quantiles=levels)


def _refuse_if_alike(first: list[Row], size: int) -> None:
    """AntioscError if all of the first of `size` runs have failed with one message."""
    if isinstance(first[0], str) and first.count(first[0]) == len(first):
        raise AntioscError(
            f"the first {len(first)} of {size} runs failed alike, and the others were not begun:"
            f" {first[0]}"
        )


def _values(inputs: Mapping[str, Any], drawn: Mapping[str, Array], i: int) -> dict[str, Any]:
    """The arguments of run `i` by name."""
    return {name: value(distribution, drawn[name][i]) for name, distribution in inputs.items()}


def chunk_results(
    run: Callable[..., Any],
    arguments_of_chunks: list[list[dict[str, Any]]],
    executor: Executor | None,
) -> Iterator[tuple[int, list[Row]]]:
    """Yield (number of a chunk, results of its runs); if a chunk is lost, all of its runs have
    failed.
    """
    if executor is None:
        yield from ((k, _rows(run, part)) for k, part in enumerate(arguments_of_chunks))
        return
    for k, returned in completed_calls(
        executor, _rows, [((run, part), {}) for part in arguments_of_chunks]
    ):
        rows = rows_of(returned, len(arguments_of_chunks[k]))
        if isinstance(rows, InputError):
            raise rows
        yield (
            k,
            [str(rows)] * len(arguments_of_chunks[k]) if isinstance(rows, AntioscError) else rows,
        )


def _rows(run: Callable[..., Any], arguments: list[dict[str, Any]]) -> list[Row]:
    """Results of one chunk of runs; impacts that `run` returns as arguments are simulated as one
    batch.
    """
    rows: list[Row] = [""] * len(arguments)
    scenes: dict[int, tuple[object, ...]] = {}
    with without_warnings():
        for i, values in enumerate(arguments):
            try:
                outcome = run(**values)
            except AntioscError as error:
                rows[i] = f"{type(error).__name__}: {error}"
                continue
            if isinstance(outcome, tuple):
                scenes[i] = outcome
            else:
                rows[i] = _numbers(outcome)
        if scenes:
            rows_of_scenes = _simulated(list(scenes.values()))
            for i, row in zip(scenes, rows_of_scenes, strict=True):
                rows[i] = row
    return rows


def _simulated(scenes: list[tuple[object, ...]]) -> list[Row]:
    """Results of impacts (model, impactor, contact, duration), simulated as one batch."""
    if any(len(scene) != 4 for scene in scenes):
        raise InputError("a tuple that `run` returns must be (model, impactor, contact, duration).")
    models, impactors, contacts, durations = map(list, zip(*scenes, strict=True))
    try:
        batch = simulate_many(models, impactors, contacts, durations)
    except AntioscError as error:  # of one scene, or of all
        if len(scenes) == 1:
            return [str(error)]
        return [r for s in scenes for r in _simulated([s])]
    return [
        {name: float(getattr(batch, name)[i]) for name in QUANTITIES}
        if batch.status[i] != STOPPED
        else batch.message[i]
        for i in range(len(scenes))
    ]


def _numbers(outcome: object) -> Row:
    """The results of one run by name."""
    if isinstance(outcome, Mapping):
        return {str(name): _result(str(name), value) for name, value in outcome.items()}
    if all(hasattr(outcome, name) for name in QUANTITIES):
        values = {name: getattr(outcome, name) for name in QUANTITIES}
        return {name: np.nan if v is None else float(v) for name, v in values.items()}
    return {"value": _result("what `run` returns", outcome)}


def _result(name: str, value: object) -> float:
    """A result as a float; NaN for None and for numbers that are not finite."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return np.nan
    return checks.number(name, value)


def sample_of(what: str, drawn: dict[str, Array], rows: list[Row]) -> Sample:
    """The sample of all runs (or falls: `what`); warns of failures, AntioscError if all failed."""
    failed = {i: row for i, row in enumerate(rows) if isinstance(row, str)}
    if len(failed) == len(rows):
        raise AntioscError(f"all {len(rows)} {what} failed, the first one so: {failed[0]}")
    if failed:
        warn(
            f"{len(failed)} of {len(rows)} {what} failed and are left out of what is said of the"
            f" others (see .failed); the first one: {next(iter(failed.values()))}",
            AccuracyWarning,
        )
    names = list(dict.fromkeys(name for row in rows if not isinstance(row, str) for name in row))
    values = {
        name: np.array([np.nan if isinstance(r, str) else r.get(name, np.nan) for r in rows])
        for name in names
    }
    return Sample(drawn, values, failed)


def _stored(path: Path, drawn: Mapping[str, Array]) -> dict[int, Row]:
    """The runs of a stored campaign; InputError if it cannot be read or has other inputs."""
    if not os.path.lexists(path):
        return {}
    check_readable(path, "a campaign")
    file = checks.shown(str(path))
    rows = dict[int, Row]()
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
    except OSError as error:
        raise InputError(f"{file} cannot be read ({error.strerror}): name a new file.") from error
    complete_lines = [line for line in lines if line.endswith("\n")]  # the last may be cut
    table = csv.DictReader(complete_lines, strict=True)
    try:
        lacking = {NUMBER, *drawn, ERROR} - set(table.fieldnames or ())
        if lines and lacking:
            raise InputError(
                f"{file} is no stored campaign (it has no column {min(lacking)}): name a new file."
            )
        for line in table:
            rows.update([_run_of(line, drawn)])
    except (ValueError, csv.Error) as error:
        raise InputError(
            f"line {table.line_num} of {file} is no run of this campaign ({error}): remove the"
            " line, and its run is computed again, or name a new file."
        ) from error
    return rows


def _run_of(line: dict[Any, Any], drawn: Mapping[str, Array]) -> tuple[int, Row]:
    """(number of a run, its results) from one line; ValueError if its inputs differ from
    `drawn`.
    """
    if None in line or None in line.values():
        raise ValueError("it has not as many cells as the first line")
    i = int(line.pop(NUMBER))
    failure = line.pop(ERROR)
    for name, draw in drawn.items():
        text = line.pop(name)
        if not 0 <= i < len(draw):
            raise ValueError(f"it has a run {i}, more than n = {len(draw)}")
        if float(text) != draw[i]:
            raise ValueError(f"run {i} has {name} = {text}, not {draw[i]:.17g}")
    return i, failure or {name: float(x) for name, x in line.items() if x}


@contextmanager
def _storing(
    path: Path | None, drawn: Mapping[str, Array], rows: Mapping[int, Row]
) -> Iterator[Callable[[dict[int, Row]], None]]:
    """Context that gives a function to append runs to the file; on exit the file is sorted."""
    if path is None:
        yield lambda _: None
        return
    columns: list[str] = []

    def store(chunk: dict[int, Row]) -> None:
        if set(_columns(drawn, chunk)) <= set(columns):
            with path.open("a", encoding="utf-8", newline="") as file:
                _write(file, columns, drawn, chunk)
        else:
            columns[:] = _stored_anew(path, drawn, rows)

    columns[:] = _stored_anew(path, drawn, rows)  # an error now if it cannot be written
    try:
        yield store
    finally:
        _stored_anew(path, drawn, rows)


def _columns(drawn: Mapping[str, Array], rows: Mapping[int, Row]) -> list[str]:
    """The columns of a file with these runs."""
    names = dict.fromkeys(name for row in rows.values() if not isinstance(row, str) for name in row)
    return [NUMBER, *drawn, *names, ERROR]


def _stored_anew(path: Path, drawn: Mapping[str, Array], rows: Mapping[int, Row]) -> list[str]:
    """Write the file again with all runs; returns its columns."""
    columns = _columns(drawn, rows)
    if len(set(columns)) < len(columns):
        raise InputError(
            f"the columns of {path.name} must have different names; they are {', '.join(columns)}:"
            " name the results otherwise than the inputs."
        )
    with (
        atomic_file(path, "the campaign") as part,
        part.open("w", encoding="utf-8", newline="") as file,
    ):
        csv.writer(file).writerow(columns)
        _write(file, columns, drawn, rows)
    return columns


def _write(
    file: TextIO, columns: list[str], drawn: Mapping[str, Array], rows: Mapping[int, Row]
) -> None:
    """Write one line for each run.

    Messages are written without line breaks, so that a line without its end is a truncated one.
    """
    table = csv.DictWriter(file, columns, restval="")
    for i, row in sorted(rows.items()):
        results = {ERROR: " ".join(row.split())} if isinstance(row, str) else row
        inputs = {name: draw[i].item() for name, draw in drawn.items()}
        table.writerow({NUMBER: i, **inputs, **results})
