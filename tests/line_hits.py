"""Which tests run the places of some breaks, found by one run of the tests with probes there.

A probe is a call beside the expression or the statement that a break changes. It notes its number
with the test that runs, which pytest names in the environment.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from breaks import Break

#: Files with these in their paths have no probes: numba, which compiles them, knows none, and the
#: process that reads meshes serves several tests.
WITHOUT = ("march", "fem/readers")
NOTES = "probe_notes.txt"
PROBE = f'''"""Notes which test runs a place."""

import os
from pathlib import Path

notes = Path(__file__).with_name("{NOTES}")
noted = set()


def hit(number):
    """Note a place once for each test; None."""
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0]
    if (number, test) not in noted:
        noted.add((number, test))
        with notes.open("a", encoding="utf-8") as file:
            file.write(f"{{number}}\\t{{test}}\\n")
'''


def probed(source: bytes, breaks: Mapping[int, Break]) -> bytes:
    """The source with a probe at each break where one can stand; breaks do not overlap there."""
    first = len(source)
    for number, one in sorted(breaks.items(), key=lambda item: -item[1].start):
        if one.end > first:
            continue
        call = f'__import__("antiosc_probe").hit({number})'
        text = f"{call}; {one.before}" if one.text == "pass" else f"({call} or ({one.before}))"
        changed = source[: one.start] + text.encode() + source[one.end :]
        try:
            ast.parse(changed)
        except SyntaxError:  # a pattern of a match statement
            continue
        source, first = changed, one.start
    return source


def tests_of(
    breaks: Sequence[Break], tree: Path, run: Callable[[], Sequence[str]]
) -> dict[Break, list[str]]:
    """The tests that run each break of the tree, the shortest first.

    `run()` runs the tests of the tree and gives the lines that pytest printed, with durations.
    """
    by_file: dict[Path, dict[int, Break]] = defaultdict(dict)
    for number, one in enumerate(breaks):
        if not any(part in one.path.as_posix() for part in WITHOUT):
            by_file[one.path][number] = one
    whole = {path: (tree / path).read_bytes() for path in by_file}
    probe, notes = tree / "src/antiosc_probe.py", tree / "src" / NOTES
    probe.write_text(PROBE, encoding="utf-8")
    notes.touch()
    try:
        for path, some in by_file.items():
            (tree / path).write_bytes(probed(whole[path], some))
        seconds = durations(run())
        noted = [line.split("\t") for line in notes.read_text(encoding="utf-8").splitlines()]
    finally:
        for path, source in whole.items():
            (tree / path).write_bytes(source)
        probe.unlink()
        notes.unlink()
    found: dict[Break, set[str]] = {one: set() for one in breaks}
    for number, test in noted:
        if test.startswith("tests/"):
            found[breaks[int(number)]].add(test)
    return {one: sorted(t, key=lambda test: seconds.get(test, 0.0)) for one, t in found.items()}


def durations(output: Sequence[str]) -> dict[str, float]:
    """Seconds that each test took, of pytest's lines of `--durations=0`."""
    seconds: dict[str, float] = defaultdict(float)
    for line in output:
        if match := re.match(r"([\d.]+)s (?:setup|call|teardown)\s+(tests/.+)$", line):
            seconds[match[2]] += float(match[1])
    return seconds
