"""Which tests run the places of some breaks, found by one run of the tests with probes there.

A probe is a call beside the expression or the statement that a break changes, and one at the head
of each function of its file (`place_notes`).
"""

from __future__ import annotations

import ast
import re
import shutil
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import place_notes
from breaks import Break, offsets

#: A file without probes: it runs before modules can be imported.
WITHOUT = "fem/readers/child.py"
#: Number of a file's probes at the heads of its functions, over the numbers of the breaks.
HEADS = 1_000_000


def probed(source: bytes, breaks: Mapping[int, Break], head: int | None = None) -> bytes:
    """The source with a probe at each break where one can stand; breaks do not overlap there.

    `head`: the number of those at the heads of functions.
    """
    places = [(one.start, one.end, _beside(number, one)) for number, one in breaks.items()]
    if head is not None:
        call = _call(head)
        places += [(start, start, f"{call}\n{' ' * column}") for start, column in _heads(source)]
    first = len(source)
    for start, end, text in sorted(places, key=lambda place: (-place[0], -place[1])):
        if end > first:
            continue
        changed = source[:start] + text.encode() + source[end:]
        try:
            ast.parse(changed)
        except SyntaxError:  # a pattern of a match statement, a function on one line
            continue
        source, first = changed, start
    return source


def _call(number: int) -> str:
    return f'__import__("antiosc_probe").hit({number})'


def _beside(number: int, one: Break) -> str:
    call = _call(number)
    return f"{call}; {one.before}" if one.text == "pass" else f"({call} or ({one.before}))"


def _heads(source: bytes) -> list[tuple[int, int]]:
    """(offset, column) of the first statement after the docstring of each function."""
    starts, found = offsets(source), []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            body = node.body[ast.get_docstring(node) is not None :]
            if body:
                found.append((starts[body[0].lineno - 1] + body[0].col_offset, body[0].col_offset))
    return found


def tests_of(
    breaks: Sequence[Break], tree: Path, run: Callable[[], Sequence[str]]
) -> dict[Break, tuple[list[str], bool]]:
    """(tests that run it, the shortest first; whether these are all that can notice it) by break.

    Where a module runs the place when it is imported, or no probe can stand there, they are those
    that call functions of the file; others may notice it too. `run()` runs the tests of the tree
    with the plugin "antiosc_probe" and gives the lines that pytest printed, with durations.
    """
    by_file: dict[Path, dict[int, Break]] = defaultdict(dict)
    for number, one in enumerate(breaks):
        by_file[one.path][number] = one
    whole = {path: (tree / path).read_bytes() for path in by_file}
    probe = tree / "src/antiosc_probe.py"
    shutil.copyfile(Path(place_notes.__file__), probe)
    notes = [probe.with_name(path.name) for path in (place_notes.NOTES, place_notes.NOW)]
    placed: set[int] = set()
    try:
        for k, (path, some) in enumerate(by_file.items()):
            if not path.as_posix().endswith(WITHOUT):
                text = probed(whole[path], some, HEADS + k)
                placed.update(n for n in some if _call(n).encode() in text)
                (tree / path).write_bytes(text)
        seconds = durations(run())
        rows = [line.split("\t") for line in notes[0].read_text(encoding="utf-8").splitlines()]
    finally:
        for path, source in whole.items():
            (tree / path).write_bytes(source)
        for made in (probe, *notes):
            made.unlink(missing_ok=True)
    noted: dict[int, set[str]] = defaultdict(set)
    for number, test in rows:
        noted[int(number)].add(test)
    found = {}
    for k, some in enumerate(by_file.values()):
        for number, one in some.items():
            tests = set(noted[number])
            all_known = number in placed and "" not in tests
            if not all_known:
                tests |= noted[HEADS + k]
            ordered = sorted(tests - {""}, key=lambda test: seconds.get(test, 0.0))
            found[one] = ordered, all_known
    return found


def durations(output: Sequence[str]) -> dict[str, float]:
    """Seconds that each test took, of pytest's lines of `--durations=0`."""
    seconds: dict[str, float] = defaultdict(float)
    for line in output:
        if match := re.match(r"([\d.]+)s (?:setup|call|teardown)\s+(tests/.+)$", line):
            seconds[match[2]] += float(match[1])
    return seconds
