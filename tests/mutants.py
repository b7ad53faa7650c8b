"""Draw random breaks of the source and count how many of them the quick tests catch.

Each break changes one place of `src/`: an operator, a comparison, a constant (× 1.1, 0, negated; a
whole number + 1), a condition, a statement that is left out, or the first two arguments of a call,
swapped. The tests of the folder that mirrors the file run first, then the rest of `make check`.
Everything happens on a copy of the tree: the sources here are never touched, whatever happens.

    make mutants                     10 breaks
    make mutants COUNT=100 SEED=3    100 others

The exit status is 1 where fewer than 95 % are caught.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TypeGuard

from antiosc.fem.compat import DOLFINX
from antiosc.fem.compiler import FFCX

ROOT = Path(__file__).resolve().parent.parent
#: What is not copied.
IGNORED = (".git", ".venv", "out", "build", "__pycache__", ".*_cache", "*.egg-info")
QUICK = "not slow and not mpi"
#: Seconds after which one test, or a whole run, counts as hanging: a break that is caught.
TEST_PATIENCE = 150.0
PATIENCE = 1800.0
#: Folders whose code numba compiles: only there does a break need a compilation of its own.
COMPILED = ("simulation", "contact")
#: Least share of breaks that must be caught.
LEAST = 0.95

OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.MatMult: ast.Mult,
}
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
# Changes that change nothing are not drawn: -0.0 for 0.0, the order of the arguments of SYMMETRIC
# functions, a tenth more of a threshold that only has to lie above rounding or of a length in
# PICTURES, code for other VERSIONS of the libraries than those installed here.
SYMMETRIC = (
    *("max", "min", "np.maximum", "np.minimum", "np.array_equal"),
    *("math.hypot", "np.hypot", "math.isclose"),
)
ROUNDING_THRESHOLD = 1e-6
PICTURES = ("charts", "plotting")
VERSIONS: dict[str, tuple[int, ...]] = {"DOLFINX": DOLFINX, "FFCX": FFCX}


@dataclass(frozen=True)
class Break:
    """One change of one file: bytes `start` to `end` become `text`."""

    path: Path
    line: int
    start: int
    end: int
    before: str
    text: str

    def apply(self, source: bytes) -> bytes:
        """The file with the change."""
        return source[: self.start] + self.text.encode() + source[self.end :]

    def __str__(self) -> str:
        before, after = (" ".join(text.split()) for text in (self.before, self.text))
        return f"{self.path}:{self.line}: {before[:60]}  ->  {after[:60]}"


# -- what can be broken


def breaks(path: Path) -> list[Break]:
    """All breaks of one file, relative to the root of the repository."""
    source = (ROOT / path).read_bytes()
    starts = [0]
    for row in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(row))
    found = []
    for node, text in changes(ast.parse(source)):
        if path.parts[2] in PICTURES and _is_a_tenth_more(node, text):
            continue
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + node.end_col_offset
        found.append(Break(path, node.lineno, start, end, source[start:end].decode(), text))
    return found


def _is_a_tenth_more(node: ast.AST, text: str) -> bool:
    if not isinstance(node, ast.Constant) or not isinstance(node.value, float):
        return False
    return text == f"({1.1 * node.value!r})"


def works(one: Break) -> bool:
    """Whether the break leaves a program, and another one."""
    source = (ROOT / one.path).read_bytes()
    try:
        return ast.dump(ast.parse(one.apply(source))) != ast.dump(ast.parse(source))
    except SyntaxError:
        return False


def changes(node: ast.AST) -> Iterator[tuple[Any, str]]:
    """(node, text that takes its place) below and including `node`, in the order of the source."""
    if _is_text(node) or _is_typing(node):
        return
    if _is_of_versions(node):
        yield from _for_this_version(node)
        return
    if isinstance(node, ast.expr):
        yield from ((node, f"({ast.unparse(new)})") for new in expressions(node))
    elif left_out(node):
        yield node, "pass"
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "exc"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from changes(child)


def expressions(node: ast.expr) -> Iterator[ast.expr]:
    """What may stand for an expression."""
    match node:
        case ast.BinOp(left, operator, right) if type(operator) in OPERATORS:
            yield ast.BinOp(left, OPERATORS[type(operator)](), right)
        case ast.Compare(left, [operator], right):
            yield ast.Compare(left, [COMPARISONS[type(operator)]()], right)
        case ast.BoolOp(operator, values):
            other = ast.And() if isinstance(operator, ast.Or) else ast.Or()
            yield ast.BoolOp(other, values)
        case ast.UnaryOp(ast.Not() | ast.USub(), operand):
            yield operand
        case ast.Constant(bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(float(value)) if abs(value) < ROUNDING_THRESHOLD:
            yield ast.Constant(1.0 if value == 0 else 0.0)
            yield from [ast.Constant(-value)] if value else []
        case ast.Constant(float(value)):
            yield from (ast.Constant(new) for new in (1.1 * value, 0.0, -value))
        case ast.Constant(int(value)):
            yield from (ast.Constant(new) for new in (value + 1, -value))
        case ast.Call(function, [first, second, *rest], keywords):
            starred = isinstance(first, ast.Starred) or isinstance(second, ast.Starred)
            same = ast.dump(first) == ast.dump(second) or ast.unparse(function) in SYMMETRIC
            if not starred and not same:
                yield ast.Call(function, [second, first, *rest], keywords)


def left_out(node: ast.AST) -> bool:
    """Whether the statement may be dropped: a call, x += y, raise; not what only tells."""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Call) and not ast.unparse(node).startswith("log.")
    return isinstance(node, ast.AugAssign | ast.Raise)


def _is_text(node: ast.AST) -> bool:
    """Docstrings, strings and what they are made of."""
    if isinstance(node, ast.Expr):
        node = node.value
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
    )


def _is_typing(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _is_of_versions(node: ast.AST) -> TypeGuard[ast.If | ast.IfExp]:
    """Whether the version of a library decides what runs."""
    if not isinstance(node, ast.If | ast.IfExp) or not isinstance(node.test, ast.Compare):
        return False
    return isinstance(node.test.left, ast.Name) and node.test.left.id in VERSIONS


def _for_this_version(node: ast.If | ast.IfExp) -> Iterator[tuple[Any, str]]:
    """The changes of what runs with the library that is installed here."""
    runs = eval(ast.unparse(node.test), {}, VERSIONS)
    part = node.body if runs else node.orelse
    for child in part if isinstance(part, list) else [part]:
        yield from changes(child)


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
    tree: Path, tests: Sequence[str], without: Sequence[str] = (), *, compiled: bool = True
) -> str:
    """The first failure of the quick tests; "" where all pass.

    With `compiled`, what numba compiled for another break is not used.
    """
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-m", QUICK, "-p", "no:cacheprovider"]
    command += ["-o", f"faulthandler_timeout={TEST_PATIENCE}", "--no-header", *tests]
    command += [f"--ignore={path}" for path in without]
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
        limit = threading.Timer(PATIENCE, _killed, (run,))
        limit.start()
        try:
            output = _lines_before_a_hang(run)
        finally:
            limit.cancel()
            _killed(run)
            if compiled:
                shutil.rmtree(folder, ignore_errors=True)
    if run.returncode in (0, 5):  # 5: no test there
        return ""
    told = [line for line in output if line.startswith(("FAILED tests", "ERROR tests"))]
    if told:
        return told[0].split(" - ")[0]
    return "a test that hangs" if run.returncode < 0 else f"pytest ended with {run.returncode}"


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


def catch(one: Break, tree: Path) -> str:
    """The test that catches the break, "" if none does; the copy is whole afterwards."""
    target = tree / one.path
    source = target.read_bytes()
    own, near = mirrored(one.path, tree)
    compiled = one.path.parts[2] in COMPILED
    try:
        target.write_bytes(one.apply(source))
        for tests, without in ((own, []), (near, own), (["tests"], [*own, *near])):
            caught = tests and first_failure(tree, tests, without, compiled=compiled)
            if caught:
                return caught
        return ""
    finally:
        target.write_bytes(source)


def main(count: int, seed: int, only: str) -> float:
    """Try `count` breaks of the files whose path contains `only`; the share that was caught."""
    files = [p.relative_to(ROOT) for p in sorted((ROOT / "src").rglob("*.py")) if only in str(p)]
    every = [one for path in files for one in breaks(path)]
    random.Random(seed).shuffle(every)
    drawn = list(islice(filter(works, every), count))
    print(f"{len(every)} breaks in {len(files)} files; {len(drawn)} drawn with seed {seed}")
    rows = []
    with tempfile.TemporaryDirectory(prefix="antiosc-mutants-") as folder:
        tree = copied(Path(folder))
        check_the_copy(tree)
        sound: set[str] = set()
        for one in drawn:
            started = time.perf_counter()
            caught = catch(one, tree)
            test = caught.partition(" ")[2]
            if "::" in test and test not in sound:  # without the break it must pass
                if first_failure(tree, [test]):
                    raise SystemExit(f"{test} fails without any break: mend it first")
                sound.add(test)
            rows.append(caught)
            verdict = f"caught by {caught}" if caught else "SURVIVED"
            print(f"{time.perf_counter() - started:6.1f} s  {one}\n          {verdict}", flush=True)
    share = sum(map(bool, rows)) / len(rows) if rows else 1.0
    print(f"{sum(map(bool, rows))} of {len(rows)} breaks caught, {share:.0%}")
    return share


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
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, ended)
    share = main(arguments.count, arguments.seed, arguments.only)
    sys.exit(0 if share >= LEAST else 1)
