"""Draw random breaks of the source (`breaks.py`) and count how many the quick tests catch.

A first run of the quick tests finds which of them run each of the places (`line_hits.py`), those
that share a value with the test that made it included. Each break is tried by these and by the
tests of its folder; one of a place that is run when its module is imported, by the rest of `make
check` too. Everything happens on a copy of the tree: the sources here are never touched.

    make mutants                     10 breaks
    make mutants COUNT=100 SEED=3    100 others

With `--log FILE` each verdict is kept there, and what it holds is not tried again.

The exit status is 1 where fewer than 95 % are caught.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

import pytest

from breaks import Break, breaks, works
from line_hits import tests_of
from paths import ROOT

#: What is not copied.
IGNORED = (".git", ".venv", "out", "build", "__pycache__", ".*_cache", "*.egg-info")
QUICK = "not slow and not mpi"
#: Seconds after which one test counts as hanging, a break that is caught; a whole run after as many
#: times that.
PATIENCE, RUN = 150.0, 12
#: Most tests that are named in one command.
NAMED = 2000
#: Modules that each run of the tests has anew, and those that are imported once.
OWN = ("antiosc", "antiosc_probe", "place_notes", "breaks", "line_hits", "paths", "__main__")
LONG = (
    *("scipy.integrate", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.signal"),
    *("scipy.sparse.csgraph", "scipy.sparse.linalg", "scipy.spatial", "scipy.special"),
    *("scipy.stats", "petsc4py.PETSc", "slepc4py.SLEPc", "dolfinx.fem.petsc", "dolfinx.io"),
    *("ufl", "basix.ufl", "gmsh", "meshio", "hypothesis", "matplotlib.pyplot"),
)
#: Least share of breaks that must be caught.
LEAST = 0.95

# -- the copy and its tests


def copied(folder: Path) -> Path:
    """A copy of the tree without what was made or measured."""
    return Path(shutil.copytree(ROOT, folder / "tree", ignore=shutil.ignore_patterns(*IGNORED)))


def mirrored(path: Path, tree: Path) -> tuple[list[str], list[str]]:
    """(tests of a source file, tests of its folder), the nearest that there are."""
    part = path.relative_to("src/antiosc")
    folder = tree / "tests" / part.parent
    while not any(folder.glob("test_*.py")):
        folder = folder.parent
    own = [p for p in folder.glob("test_*.py") if p.stem == f"test_{path.stem}"]
    folder = folder.relative_to(tree)
    if folder == Path("tests"):  # the whole suite: its own files alone
        near = [str(p.relative_to(tree)) for p in sorted((tree / folder).glob("test_*.py"))]
    else:
        near = [str(folder)]
    return [str(p.relative_to(tree)) for p in own], near


def first_failure(
    tree: Path,
    tests: Sequence[str],
    without: Sequence[str] = (),
    *,
    patience: float = PATIENCE,
) -> str:
    """The first failure of the quick tests; "" where all pass."""
    options = ["-x", *tests, *(f"--ignore={path}" for path in without)]
    status, output = pytest_run(tree, options, patience=patience)
    if status in (0, 5):  # 5: no test there
        return ""
    told = [line for line in output if line.startswith(("FAILED tests", "ERROR tests"))]
    if told:
        return told[0].split(" - ")[0]
    return "a test that hangs" if status < 0 else f"pytest ended with {status}"


def pytest_run(
    tree: Path, options: Sequence[str], *, patience: float = PATIENCE
) -> tuple[int, list[str]]:
    """(status, lines) of pytest with the quick tests of the copy; ended where a test hangs.

    It runs in a fork of this process, which has imported what takes long, and imports antiosc.
    """
    command = ["-q", "-m", QUICK, "-p", "no:cacheprovider", "--no-header"]
    command += ["-o", f"faulthandler_timeout={patience}", *options]
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(reading)
        _test_and_exit(tree, command, writing)
    os.close(writing)
    limit = threading.Timer(RUN * patience, _kill, (pid,))
    limit.start()
    try:
        with os.fdopen(reading, encoding="utf-8", errors="replace") as lines:
            output = _lines_before_a_hang(lines)
    finally:
        limit.cancel()
        _kill(pid)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return status, output


def _test_and_exit(tree: Path, command: list[str], output: int) -> NoReturn:
    """The tests of the copy in this fork, which ends with pytest's status."""
    status = 70
    try:
        os.setsid()
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for stream in (1, 2):
            os.dup2(output, stream)
        os.close(output)  # what a test leaves running does not hold it open
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.chdir(tree)
        os.environ["PYTHONPATH"] = str(tree / "src")
        for name in [name for name in sys.modules if name.partition(".")[0] in OWN]:
            del sys.modules[name]
        sys.path[:] = [str(tree / "src"), *(p for p in sys.path if p != str(ROOT / "tests"))]
        sys.argv[:] = ["pytest"]
        status = int(pytest.main(command))
    finally:
        sys.stdout.flush()
        os._exit(status)


def _lines_before_a_hang(lines: Iterable[str]) -> list[str]:
    """What pytest printed, until it ended or told that one test takes too long."""
    output = []
    for line in lines:
        output.append(line.rstrip("\n"))
        if line.startswith("Timeout ("):
            break
    return output


def _kill(pid: int) -> None:
    """End the tests and what they started, where they still run."""
    with suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)


#: What is run for a break: (paths or names of tests, paths that are left out) one after the other.
Stages = list[tuple[list[str], list[str]]]


def stages(one: Break, tree: Path, runs: list[str], all_known: bool) -> Stages:
    """The tests that run the place of the break, those of its folder, and, where others may notice
    it, the rest."""
    own, near = mirrored(one.path, tree)
    those: Stages = [(runs[:NAMED], []), (own, []), (near, own)]
    if not all_known or len(runs) > NAMED:
        those.append((["tests"], [*own, *near]))
    return those


def catch(one: Break, tree: Path, tests_of_it: Stages, patience: float) -> str:
    """The test that catches the break, "" if none does; the copy is whole afterwards."""
    target = tree / one.path
    source = target.read_bytes()
    try:
        _write(target, one.apply(source))
        for tests, without in tests_of_it:
            caught = tests and first_failure(tree, tests, without, patience=patience)
            if caught:
                return caught
        return ""
    finally:
        _write(target, source)


def _write(target: Path, source: bytes) -> None:
    """Write a source a second later than before: Python keeps what it compiled by that time."""
    later = int(target.stat().st_mtime) + 1
    target.write_bytes(source)
    os.utime(target, (later, later))


def drawn(count: int, seed: int, only: str) -> list[Break]:
    """`count` random breaks of the files whose path matches `only`, a regular expression."""
    files = [p.relative_to(ROOT) for p in sorted((ROOT / "src").rglob("*.py"))]
    files = [p for p in files if re.search(only, p.as_posix())]
    every = [one for path in files for one in breaks(path)]
    random.Random(seed).shuffle(every)
    found = list(islice(filter(works, every), count))
    print(f"{len(every)} breaks in {len(files)} files; {len(found)} drawn with seed {seed}")
    return found


def main(chosen: Sequence[Break], log: Path | None, patience: float) -> float:
    """Try the breaks by the tests that run them; the share that was caught."""
    verdicts = _logged(log)
    import_what_takes_long()
    with tempfile.TemporaryDirectory(prefix="antiosc-mutants-") as folder:
        tree = copied(Path(folder))
        check_the_copy(tree)
        runs = _runs(chosen, tree, log, patience)
        chosen = sorted(chosen, key=lambda one: not runs[one][1])  # those of all tests come last
        sound: set[str] = set()
        for one in chosen:
            if _name(one) in verdicts:
                continue
            started = time.perf_counter()
            caught = catch(one, tree, stages(one, tree, *runs[one]), patience)
            _check_the_test(caught, tree, sound, patience)
            verdicts[_name(one)] = caught
            _tell(one, caught, time.perf_counter() - started, log)
    count = sum(bool(verdicts[_name(one)]) for one in chosen)
    share = count / len(chosen) if chosen else 1.0
    print(f"{count} of {len(chosen)} breaks caught, {share:.0%}")
    return share


def import_what_takes_long() -> None:
    """Import what antiosc imports, for the forks of this process."""
    for name in LONG:
        with suppress(ImportError):
            importlib.import_module(name)


def _runs(
    chosen: Sequence[Break], tree: Path, log: Path | None, patience: float
) -> dict[Break, tuple[list[str], bool]]:
    """The tests that run each break (`tests_of`), kept beside the log."""
    kept = None if log is None else log.with_suffix(".runs.json")
    if kept is not None and kept.exists():
        known = json.loads(kept.read_text(encoding="utf-8"))
        return {one: known[_name(one)] for one in chosen}
    options = ["--durations=0", "-vv", "-p", "antiosc_probe", "tests"]
    found = tests_of(chosen, tree, lambda: pytest_run(tree, options, patience=patience)[1])
    if kept is not None:
        kept.write_text(json.dumps({_name(one): t for one, t in found.items()}), encoding="utf-8")
    return found


def _check_the_test(caught: str, tree: Path, sound: set[str], patience: float) -> None:
    """The test that caught a break must pass without it."""
    test = caught.partition(" ")[2]
    if "::" in test and test not in sound:
        if first_failure(tree, [test], patience=patience):
            raise SystemExit(f"{test} fails without any break: mend it first")
        sound.add(test)


def _tell(one: Break, caught: str, seconds: float, log: Path | None) -> None:
    if log is not None:
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps([_name(one), caught]) + "\n")
    verdict = f"caught by {caught}" if caught else "SURVIVED"
    print(f"{seconds:6.1f} s  {one}\n          {verdict}", flush=True)


def _name(one: Break) -> str:
    """The break in one line that no other has."""
    return f"{one} at {one.start}"


def _logged(log: Path | None) -> dict[str, str]:
    """The tests that caught breaks in an earlier run, by their names."""
    if log is None or not log.exists():
        return {}
    return dict(json.loads(line) for line in log.read_text(encoding="utf-8").splitlines())


def check_the_copy(tree: Path) -> None:
    """The tests of the copy must import its own package."""
    found = subprocess.run(
        [sys.executable, "-c", "import antiosc; print(antiosc.__file__)"],
        env={**os.environ, "PYTHONPATH": str(tree / "src")},
        cwd=tree,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    if not Path(found).is_relative_to(tree):
        raise SystemExit(f"the copy would test {found}, not its own sources")


def ended(*_: Any) -> None:
    """A killed run ends like one that raises, so that its copy and its tests end with it."""
    raise SystemExit("ended by a signal")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10, help="breaks to draw (default: 10)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (default: 0)")
    parser.add_argument("--only", default="", help="regular expression of the files to draw from")
    parser.add_argument("--log", type=Path, help="file of verdicts, to go on with later")
    parser.add_argument(
        "--patience", type=float, default=PATIENCE, help="seconds after which a test hangs"
    )
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, ended)
    share = main(drawn(given.count, given.seed, given.only), given.log, given.patience)
    sys.exit(0 if share >= LEAST else 1)
