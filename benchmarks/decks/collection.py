"""Decks of public collections: how many are read, and the others by the sentence that refuses them.

    python benchmarks/decks/collection.py FOLDER... --out results.jsonl [--pattern '*.bdf'] ...

Each file is read (`read_model`) in a child process with limits of time and memory. Where the error
asks for an option, it is read again with that: a density, a unit, the largest piece, a root. Files
without nodes of their own (parts that others include, loads, sets) are counted apart. Results that
the output file holds are kept, so that a run can be continued; `--again TEXT` repeats those whose
sentence contains TEXT.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import os
import re
import resource
import select
import subprocess
import sys
import time
import warnings
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

DENSITY = 7800.0
#: Tried in this order where moduli and densities are implausible in SI units.
UNITS = ("in", "mm", "cm", 1e3)
#: Seconds and bytes that one file may take.
PATIENCE, MEMORY = 300.0, 8 * 2**30
#: What a file of nodes contains.
NODES = re.compile(rb"^\s*(GRID[ *,]|\*\s*NODE\s*(,|$)|\*\s*INCLUDE|INCLUDE\s|\*PART)", re.I | re.M)


def decks(
    folders: list[Path], patterns: list[str], without: list[str]
) -> tuple[list[Path], list[Path]]:
    """(decks below some folders, files without nodes of their own)."""
    patterns = patterns or ["*.inp", "*.bdf", "*.dat", "*.nas"]
    paths = sorted(
        path
        for folder in folders
        for path in folder.rglob("*")
        if path.is_file()
        and any(fnmatch.fnmatch(path.name.lower(), one) for one in patterns)
        and not any(part in str(path) for part in without)
    )
    whole = {path for path in paths if NODES.search(path.read_bytes())}
    return [p for p in paths if p in whole], [p for p in paths if p not in whole]


def tried(path: Path) -> dict[str, Any]:
    """What becomes of one file, with the options that the errors ask for one after the other."""
    import antiosc as ao

    options: dict[str, Any] = {}
    units = iter(UNITS)
    roots = map(str, path.parents[2:6])
    while True:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                part = ao.read_model(path, **options)
            except ao.AntioscError as error:
                text = str(error)
            else:
                found = {"options": options, "mass": part.mass, "dofs": part.dofs}
                return found | {"told": [str(one.message) for one in told]}
        if "no density" in text and "density" not in options:
            options["density"] = DENSITY
        elif "wave speed" in text and (unit := next(units, None)) is not None:
            options["unit"] = unit
        elif "piece=1" in text and "piece" not in options:
            options["piece"] = 1
        elif "by root=" in text and (root := next(roots, None)) is not None:
            options["root"] = root
        else:
            return {"options": options, "refused": text}


def work(tried: Callable[[Path], dict[str, Any]]) -> None:
    """Answer each path on standard input by a line of JSON."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    os.nice(10)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is no answer
    for line in sys.stdin:
        try:
            result = tried(Path(line.rstrip("\n")))
        except BaseException as error:
            result = {"died": f"{type(error).__name__}: {error}"}
        answers.write(json.dumps(result) + "\n")
        answers.flush()


def read_all(paths: list[Path], done: dict[str, Any], out: Path, script: str = __file__) -> None:
    """Results of all paths by the processes of a script, each appended to the output file."""
    process = None
    for k, path in enumerate(paths):
        if str(path) in done:
            continue
        if process is None:
            process = subprocess.Popen(
                [sys.executable, script, "--work"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        assert process.stdin is not None
        assert process.stdout is not None
        begin = time.perf_counter()
        process.stdin.write(f"{path}\n".encode())
        process.stdin.flush()
        ready = select.select([process.stdout], [], [], PATIENCE)[0]
        line = process.stdout.readline() if ready else b""
        if line:
            result = json.loads(line)
        else:
            process.kill()
            process.communicate()
            result = {"died": f"exit {process.returncode}" if ready else f"over {PATIENCE:g} s"}
            process = None
        result |= {"path": str(path), "seconds": round(time.perf_counter() - begin, 2)}
        done[str(path)] = result
        with out.open("a") as file:
            file.write(json.dumps(result) + "\n")
        print(f"{k + 1}/{len(paths)} {path.name}", file=sys.stderr)
    if process is not None:
        process.communicate()


def sentence(text: str, name: str) -> str:
    """A refusal without what differs from file to file."""
    text = re.sub(r"line \d+ of \S+?(?=[:);, ]|$)", "line …", text).replace(name, "the deck")
    text = re.sub(r"'[^']*'", "'…'", text)
    return re.sub(r"(?<![A-Za-z\d])-?\d[\d.]*(e[+-]?\d+)?(?![A-Za-z\d])", "#", text)


def table(results: list[dict[str, Any]], examples: int) -> str:
    """Counts, and the refusals by their sentences."""
    classes: dict[str, list[str]] = defaultdict(list)
    for one in results:
        if "mass" in one:
            label = " ".join(["read", *(f"{k}=" for k in sorted(one["options"]))])
        else:
            label = sentence(one.get("refused") or one["died"], Path(one["path"]).name)
            label = ("DIED " if "died" in one else "") + label
        classes[label].append(one["path"])
    lines = [f"{len(results)} files"]
    for label, paths in sorted(classes.items(), key=lambda one: -len(one[1])):
        lines.append(f"{len(paths):5d}  {label}")
        if examples and not label.startswith("read"):
            lines.append("       " + ", ".join(Path(path).name for path in paths[:examples]))
    return "\n".join(lines)


def by_class(results: list[dict[str, Any]]) -> str:
    """How many are read of the class (`census`), and of decks outside it by the reason."""
    import census

    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for one in results:
        try:
            outside = census.take(Path(one["path"])).outside()
        except Exception:  # the parser follows no parts, and no files that are not there
            outside = "not parsed: parts, generated nodes, files or nodes that are not there"
        count = counts[outside or "complete, linear, without contact"]
        count[0] += 1
        count[1] += "mass" in one
    rows = sorted(counts.items(), key=lambda one: -one[1][0])
    return "\n".join(f"{read:5d} of {every:4d}  {label}" for label, (every, read) in rows)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--out", type=Path, default=Path("collection.jsonl"))
    parser.add_argument("--pattern", action="append", default=[], help="default: *.inp *.bdf *.dat")
    parser.add_argument("--without", action="append", default=[], help="parts of paths left out")
    parser.add_argument("--again", help="repeat those whose sentence contains this text")
    parser.add_argument("--examples", type=int, default=3)
    parser.add_argument("--classes", action="store_true", help="of Abaqus decks, by `census`")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        work(tried)
        return 0
    paths, fragments = decks(given.folders, given.pattern, given.without)
    done: dict[str, Any] = {}
    if given.out.exists():
        some = map(json.loads, given.out.read_text().splitlines())
        done = {one["path"]: one for one in some}
        if given.again is not None:
            done = {
                k: v
                for k, v in done.items()
                if given.again not in v.get("refused", v.get("died", ""))
            }
    read_all(paths, done, given.out)
    print(table([done[str(path)] for path in paths], given.examples))
    print(f"{len(fragments)} files without nodes")
    if given.classes:
        print(by_class([done[str(path)] for path in paths]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
