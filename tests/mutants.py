"""Draw random breaks of the source (`breaks.py`) and count how many the quick tests catch.

A first run of the quick tests finds which of them run each of the places (`line_hits.py`). Each
break is tried by these; those that are not caught, by the tests of the file, of the folder that
mirrors it and by the rest of `make check`. Everything happens on a copy of the tree: the sources
here are never touched.

    make mutants                     10 breaks
    make mutants COUNT=100 SEED=3    100 others

With `--log FILE` each verdict is kept there, and what it holds is not tried again.

The exit status is 1 where fewer than 95 % are caught.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

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
#: Folders whose code numba compiles: only there does a break need a compilation of its own.
COMPILED = ("simulation", "contact")
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
    compiled: bool = True,
    patience: float = PATIENCE,
) -> str:
    """The first failure of the quick tests; "" where all pass.

    With `compiled`, what numba compiled for another break is not used.
    """
    options = ["-x", *tests, *(f"--ignore={path}" for path in without)]
    status, output = pytest_run(tree, options, compiled=compiled, patience=patience)
    if status in (0, 5):  # 5: no test there
        return ""
    told = [line for line in output if line.startswith(("FAILED tests", "ERROR tests"))]
    if told:
        return told[0].split(" - ")[0]
    return "a test that hangs" if status < 0 else f"pytest ended with {status}"


def pytest_run(
    tree: Path, options: Sequence[str], *, compiled: bool = False, patience: float = PATIENCE
) -> tuple[int, list[str]]:
    """(status, lines) of pytest with the quick tests of the copy; ended where a test hangs."""
    command = [sys.executable, "-m", "pytest", "-q", "-m", QUICK, "-p", "no:cacheprovider"]
    command += ["-o", f"faulthandler_timeout={patience}", "--no-header", *options]
    folder = Path(tempfile.mkdtemp(dir=tree.parent)) if compiled else tree.parent / "numba"
    environment = {
        **os.environ,
        "PYTHONPATH": str(tree / "src"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_CACHE_DIR": str(folder),
    }
    with subprocess.Popen(
        command,
        cwd=tree,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as run:
        limit = threading.Timer(RUN * patience, _killed, (run,))
        limit.start()
        try:
            output = _lines_before_a_hang(run)
        finally:
            limit.cancel()
            _killed(run)
            if compiled:
                shutil.rmtree(folder, ignore_errors=True)
    return run.returncode, output


def _lines_before_a_hang(run: subprocess.Popen[str]) -> list[str]:
    """What pytest printed, until it ended or told that one test takes too long."""
    assert run.stdout is not None
    output = []
    for line in run.stdout:
        output.append(line.rstrip("\n"))
        if line.startswith("Timeout ("):
            return output
    run.wait()
    return output


def _killed(run: subprocess.Popen[str]) -> None:
    """End the tests and what they started, if they still run."""
    if run.poll() is None:
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()


#: What is run for a break: (paths or names of tests, paths that are left out) one after the other.
Stages = list[tuple[list[str], list[str]]]


def those_that_run_it(one: Break, tree: Path, runs: list[str]) -> Stages:
    """The tests that run the place of the break; where none is known, those of its folder."""
    own, near = mirrored(one.path, tree)
    return [(runs[:NAMED], [])] if runs else [(own, []), (near, own)]


def all_tests(one: Break, tree: Path, runs: list[str]) -> Stages:
    """Those of the file, of its folder, and the rest: others may use what a first one has made."""
    own, near = mirrored(one.path, tree)
    return [(own, []), (near, own), (["tests"], [*own, *near])]


def catch(one: Break, tree: Path, stages: Stages, patience: float) -> str:
    """The test that catches the break, "" if none does; the copy is whole afterwards."""
    target = tree / one.path
    source = target.read_bytes()
    compiled = one.path.parts[2] in COMPILED
    try:
        target.write_bytes(one.apply(source))
        for tests, without in stages:
            caught = tests and first_failure(
                tree, tests, without, compiled=compiled, patience=patience
            )
            if caught:
                return caught
        return ""
    finally:
        target.write_bytes(source)


def drawn(count: int, seed: int, only: str) -> list[Break]:
    """`count` random breaks of the files whose path contains `only`."""
    files = [p.relative_to(ROOT) for p in sorted((ROOT / "src").rglob("*.py")) if only in str(p)]
    every = [one for path in files for one in breaks(path)]
    random.Random(seed).shuffle(every)
    found = list(islice(filter(works, every), count))
    print(f"{len(every)} breaks in {len(files)} files; {len(found)} drawn with seed {seed}")
    return found


def main(chosen: Sequence[Break], log: Path | None, patience: float) -> float:
    """Try the breaks; the share that was caught.

    All are tried by the tests that run them, then by all tests where those did not catch them.
    """
    verdicts = _logged(log)
    with tempfile.TemporaryDirectory(prefix="antiosc-mutants-") as folder:
        tree = copied(Path(folder))
        check_the_copy(tree)
        runs = _runs(chosen, tree, log, patience)
        chosen = sorted(chosen, key=lambda one: not runs[one])  # whole folders of tests come last
        sound: set[str] = set()
        for stages in (those_that_run_it, all_tests):
            for one in chosen:
                caught, after = verdicts.get(_name(one), ("", ""))
                if caught or after in (stages.__name__, all_tests.__name__):
                    continue
                started = time.perf_counter()
                caught = catch(one, tree, stages(one, tree, runs[one]), patience)
                _check_the_test(caught, tree, sound, patience)
                verdicts[_name(one)] = caught, stages.__name__
                _tell(one, *verdicts[_name(one)], time.perf_counter() - started, log)
    count = sum(bool(verdicts[_name(one)][0]) for one in chosen)
    share = count / len(chosen) if chosen else 1.0
    print(f"{count} of {len(chosen)} breaks caught, {share:.0%}")
    return share


def _runs(
    chosen: Sequence[Break], tree: Path, log: Path | None, patience: float
) -> dict[Break, list[str]]:
    """The tests that run each break, kept beside the log."""
    kept = None if log is None else log.with_suffix(".runs.json")
    if kept is not None and kept.exists():
        known = json.loads(kept.read_text(encoding="utf-8"))
        return {one: known[_name(one)] for one in chosen}
    options = ["--durations=0", "-vv", "tests"]
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


def _tell(one: Break, caught: str, after: str, seconds: float, log: Path | None) -> None:
    if log is not None:
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps([_name(one), [caught, after]]) + "\n")
    last = after == all_tests.__name__
    verdict = f"caught by {caught}" if caught else "SURVIVED" if last else "not caught yet"
    print(f"{seconds:6.1f} s  {one}\n          {verdict}", flush=True)


def _name(one: Break) -> str:
    """The break in one line that no other has."""
    return f"{one} at {one.start}"


def _logged(log: Path | None) -> dict[str, tuple[str, str]]:
    """(the test that caught it, the last stage) of breaks of an earlier run, by their names."""
    if log is None or not log.exists():
        return {}
    rows = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    return {name: (caught, after) for name, (caught, after) in rows}


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
    parser.add_argument("--only", default="", help="draw from files whose path contains this")
    parser.add_argument("--log", type=Path, help="file of verdicts, to go on with later")
    parser.add_argument(
        "--patience", type=float, default=PATIENCE, help="seconds after which a test hangs"
    )
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, ended)
    share = main(drawn(given.count, given.seed, given.only), given.log, given.patience)
    sys.exit(0 if share >= LEAST else 1)
