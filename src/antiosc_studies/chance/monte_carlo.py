"""`monte_carlo`: runs with inputs drawn from distributions, and their storage in a file."""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
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
from antiosc_studies.chance.sample import Sample

#: Least number of runs that are made, stored and, with an executor, sent together; and the largest
#: number of such parts.
TOGETHER, PARTS = 100, 100
#: Most runs of a study.
MOST = 10_000_000
#: What is kept of an impact.
QUANTITIES = ("peak_force", "impulse", "contact_time", "restitution")
#: Columns of a stored campaign: number of the run, and why it failed.
NUMBER, ERROR = "run", "error"
#: Results of a run by name, or the message of its failure.
Row = dict[str, float] | str


def normal(mean: float, sigma: float) -> Any:
    """The normal distribution of this mean and standard deviation, both in the input's unit.

    Returns a frozen distribution of scipy.stats, as do `lognormal` and `uniform`.
    """
    from scipy.stats import norm

    return norm(checks.number("mean", mean), checks.positive("sigma", sigma))


def lognormal(mean: float, variation: float) -> Any:
    """The lognormal distribution of this mean and coefficient of variation.

    `variation` is the standard deviation over the mean: lognormal(70e9, 0.03) is 70 GPa ± 3 %.
    """
    from scipy.stats import lognorm

    mean, variation = checks.positive("mean", mean), checks.positive("variation", variation)
    spread = np.sqrt(np.log1p(variation**2))
    return lognorm(spread, scale=mean * np.exp(-(spread**2) / 2))


def uniform(low: float, high: float) -> Any:
    """The uniform distribution between `low` and `high`."""
    from scipy.stats import uniform as between

    low, high = checks.number("low", low), checks.number("high", high)
    if not low < high:
        raise InputError(f"low must be below high; got {low:g} and {high:g}.")
    return between(low, high - low)


def is_name(name: object) -> bool:
    """Whether the text can name an argument: "mass", "impactor.mass"."""
    return isinstance(name, str) and all(part.isidentifier() for part in name.split("."))


def checked(inputs: object) -> dict[str, Any]:
    """The inputs of a study, each a distribution or a sequence of values; InputError if not."""
    kind = 'a dict, such as {"velocity": normal(2.0, 0.1)}'
    given = dict(checks.instance("inputs", inputs, Mapping, kind))
    if not given:
        raise InputError("inputs is empty: name at least one input and its distribution.")
    for name, what in given.items():
        if not is_name(name):
            raise InputError(f"{checks.shown(name)} is no name of an argument.")
        many = isinstance(what, Sequence | np.ndarray | ImpactMap) and not isinstance(what, str)
        if not (many and len(what)) and not hasattr(what, "ppf"):
            raise InputError(
                f"{name} must be a distribution with `ppf`, such as normal(2.0, 0.1) or one of"
                " scipy.stats, a sequence of values, or an ImpactMap; got"
                f" {checks.shown(what)}."
            )
    return given


def draws(inputs: Mapping[str, Any], n: int, seed: int) -> dict[str, np.ndarray]:
    """`n` independent draws of each input: numbers, or indices of values (of sites, by area).

    Draw i of an input depends on `seed`, on i and on the place of the input alone, so that a
    larger `n` begins with the draws of a smaller one.
    """
    found = {}
    streams = np.random.SeedSequence(seed).spawn(len(inputs))
    for stream, (name, what) in zip(streams, inputs.items(), strict=True):
        shares = np.random.default_rng(stream).random(n)
        if hasattr(what, "ppf"):
            found[name] = quantiles(name, what, shares)
        else:
            weights = what.areas if isinstance(what, ImpactMap) else np.ones(len(what))
            ends = np.cumsum(weights) / np.sum(weights)
            found[name] = np.searchsorted(ends[:-1], shares, side="right")
    return found


def quantiles(name: str, what: Any, shares: np.ndarray) -> np.ndarray:
    """The quantiles of an input at shares (n,), checked; InputError for invalid ones."""
    try:
        found = what.ppf(shares)
    except Exception as error:  # of any package
        said = f"{type(error).__name__}: {error}"
        raise InputError(
            f"ppf of {name} must take an array of shares; it failed ({said})."
        ) from error
    return checks.array(f"what ppf of {name} returns", found, shares.shape)


def value(what: Any, drawn: Any) -> Any:
    """The value passed to the function of a study for a draw of an input."""
    if hasattr(what, "ppf"):
        return float(drawn)
    return what.model(int(drawn)) if isinstance(what, ImpactMap) else what[int(drawn)]


def monte_carlo(
    run: Callable[..., Any],
    inputs: Mapping[str, Any],
    n: int = 1000,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    store: str | os.PathLike[str] | None = None,
) -> Sample:
    """Runs with independent random inputs: the distribution of what comes out.

    Parameters
    ----------
    run : callable
        A function of the inputs' names. It returns the arguments of `simulate`, (model, impactor,
        contact, duration), and the impacts are then simulated in batches; or a `History`; or
        numbers by name; or one number. Make once, outside, what no input changes: a model above
        all. AntioscErrors that it raises are kept as the failure of that run.
    inputs : dict
        Name -> distribution: `normal`, `lognormal`, `uniform`, any frozen one of scipy.stats; a
        sequence of values that are equally probable (points, models, laws); or an `ImpactMap`: the
        function is given the model at a site of its surface, drawn by area.
    n : int
        Number of runs.
    seed : int
        Of the draws; more runs of the same seed begin with those of fewer.
    executor : concurrent.futures.Executor, optional
        What makes the runs, 100 at a time: processes, `mpi4py.futures`, dask.distributed's
        `Client.get_executor()`. What it loses is recorded as failed.
    store : path, optional
        A CSV file to which finished runs are added as they come. If it exists, its runs are taken
        and only the others are made, those that failed included: a broken campaign goes on. Not on
        several MPI ranks that all make the same calls: give an executor on one of them.

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
        If all runs fail.
    """
    checks.function("run", run, "a function of the inputs")
    given, size = checked(inputs), checks.whole("n", n, most=MOST)
    check_signature("run", run, given)
    check_executor(executor)
    drawn = draws(given, size, checks.whole("seed", seed, least=0))
    mpi = sys.modules.get("mpi4py.MPI")
    if store is not None and executor is None and mpi is not None and mpi.COMM_WORLD.size > 1:
        raise InputError(
            f"store is one file, and {mpi.COMM_WORLD.size} MPI ranks would all write it: run the"
            " campaign on one, with executor=mpi4py.futures.MPIPoolExecutor()."
        )
    path = None if store is None else checks.new_file("store", store)
    rows = {} if path is None else _stored(path, drawn)
    todo = [i for i in range(size) if isinstance(rows.get(i, ""), str)]
    together = max(TOGETHER, -(-len(todo) // PARTS))
    parts = [todo[k : k + together] for k in range(0, len(todo), together)]
    given_of = [[_values(given, drawn, i) for i in part] for part in parts]
    with counting("runs", len(todo)) as ready, _storing(path, drawn, rows) as keep:
        done = 0
        for k, found in made(run, given_of, executor):
            part = dict(zip(parts[k], found, strict=True))
            rows.update(part)
            keep(part)
            done += len(found)
            ready(done)
    return sample_of("runs", drawn, [rows[i] for i in range(size)])


def _values(inputs: Mapping[str, Any], drawn: Mapping[str, Array], i: int) -> dict[str, Any]:
    """The arguments of run `i`."""
    return {name: value(what, drawn[name][i]) for name, what in inputs.items()}


def made(
    run: Callable[..., Any], given: list[list[dict[str, Any]]], executor: Executor | None
) -> Iterator[tuple[int, list[Row]]]:
    """(numbers of the runs, their rows) chunk by chunk; lost chunks are failures."""
    if executor is None:
        yield from ((k, _rows(run, part)) for k, part in enumerate(given))
        return
    for k, found in completed_calls(executor, _rows, [((run, part), {}) for part in given]):
        rows = rows_of(found, len(given[k]))
        if isinstance(rows, InputError):
            raise rows
        yield k, [str(rows)] * len(given[k]) if isinstance(rows, AntioscError) else rows


def _rows(run: Callable[..., Any], given: list[dict[str, Any]]) -> list[Row]:
    """Rows of one chunk of runs; impacts that `run` only describes are simulated as one batch."""
    rows: list[Row] = [""] * len(given)
    scenes: dict[int, tuple[object, ...]] = {}
    with without_warnings():
        for i, values in enumerate(given):
            try:
                found = run(**values)
            except AntioscError as error:
                rows[i] = f"{type(error).__name__}: {error}"
                continue
            if isinstance(found, tuple):
                scenes[i] = found
            else:
                rows[i] = _numbers(found)
        if scenes:
            rows_of_scenes = _simulated(list(scenes.values()))
            for i, row in zip(scenes, rows_of_scenes, strict=True):
                rows[i] = row
    return rows


def _simulated(scenes: list[tuple[object, ...]]) -> list[Row]:
    """The impacts of (model, impactor, contact, duration) in one batch."""
    if any(len(scene) != 4 for scene in scenes):
        raise InputError("a tuple that `run` returns must be (model, impactor, contact, duration).")
    models, impactors, contacts, durations = map(list, zip(*scenes, strict=True))
    try:
        batch = simulate_many(models, impactors, contacts, durations)
    except AntioscError as error:  # of one scene, or of all
        return [str(error)] if len(scenes) == 1 else [r for s in scenes for r in _simulated([s])]
    return [
        {name: float(getattr(batch, name)[i]) for name in QUANTITIES}
        if batch.status[i] != STOPPED
        else batch.message[i]
        for i in range(len(scenes))
    ]


def _numbers(found: object) -> Row:
    """The results of one run by name."""
    if isinstance(found, Mapping):
        return {str(name): _result(str(name), value) for name, value in found.items()}
    if all(hasattr(found, name) for name in QUANTITIES):
        values = {name: getattr(found, name) for name in QUANTITIES}
        return {name: np.nan if v is None else float(v) for name, v in values.items()}
    return {"value": _result("what `run` returns", found)}


def _result(name: str, value: object) -> float:
    """A result as a float, NaN for None and what is not finite."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return np.nan
    return checks.number(name, value)


def sample_of(what: str, drawn: dict[str, Array], rows: list[Row]) -> Sample:
    """The sample of the rows of all runs or falls (`what`), with the number of failures."""
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
    shown, rows = checks.shown(str(path)), dict[int, Row]()
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
    except OSError as error:
        raise InputError(f"{shown} cannot be read ({error.strerror}): name a new file.") from error
    whole = [line for line in lines if line.endswith("\n")]  # the last may be cut
    table = csv.DictReader(whole, strict=True)
    try:
        lacking = {NUMBER, *drawn, ERROR} - set(table.fieldnames or ())
        if lines and lacking:
            raise InputError(
                f"{shown} is no stored campaign (it has no column {min(lacking)}): name a new file."
            )
        for line in table:
            rows.update([_run_of(line, drawn)])
    except (ValueError, csv.Error) as error:
        raise InputError(
            f"line {table.line_num} of {shown} is no run of this campaign ({error}): remove the"
            " line, and its run is made again, or name a new file."
        ) from error
    return rows


def _run_of(line: dict[Any, Any], drawn: Mapping[str, Array]) -> tuple[int, Row]:
    """(number of a run, its results) from a line; ValueError for other inputs."""
    if None in line or None in line.values():
        raise ValueError("it has not as many cells as the first line")
    i, failure = int(line.pop(NUMBER)), line.pop(ERROR)
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
    """Context with a function that appends runs to the file; at the end all are sorted."""
    if path is None:
        yield lambda _: None
        return
    columns: list[str] = []

    def store(part: dict[int, Row]) -> None:
        if set(_columns(drawn, part)) <= set(columns):
            with path.open("a", encoding="utf-8", newline="") as file:
                _write(file, columns, drawn, part)
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
    """The columns of the file, replaced by one with all runs."""
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
    """Write a line for each run.

    Messages are written without line ends, so that a truncated line is recognised by its missing
    end.
    """
    table = csv.DictWriter(file, columns, restval="")
    for i, row in sorted(rows.items()):
        results = {ERROR: " ".join(row.split())} if isinstance(row, str) else row
        given = {name: draw[i].item() for name, draw in drawn.items()}
        table.writerow({NUMBER: i, **given, **results})
