"""What becomes of a folder of files by others: `antiosc new`, then `antiosc run --report`.

`python benchmarks/foreign_files.py FOLDER` prints a line for each file. A file is "clean" if both
commands end with 0 and the report is written; "told" if `new` ends with 1 and says why; "late" if a
command was ended at its limit; "wrong" if only the run fails; "aborted" if a process died of a
signal. `--only new` leaves the run out.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

#: Endings of files that are looked at.
ENDINGS = {
    *(".step", ".stp", ".iges", ".igs", ".brep", ".geo", ".stl", ".obj", ".ply", ".off"),
    *(".inp", ".bdf", ".nas", ".fem", ".dat", ".cdb", ".unv", ".med", ".msh", ".vtu", ".vtk"),
    *(".e", ".exo", ".ex2", ".g", ".mphtxt", ".k", ".rad", ".sldprt"),
}
#: Exit code of a command that was ended at its limit.
LATE = 124
#: Width of the column of names, and of the sentences.
NAME, SENTENCE = 44, 150


@dataclass
class Outcome:
    """What became of one file."""

    verdict: str
    seconds: float
    sentence: str


def command(arguments: list[str], folder: str, limit: float) -> tuple[int, str]:
    """(exit code, what it printed) of `antiosc` with these arguments."""
    line = [sys.executable, "-m", "antiosc", *arguments]
    process = subprocess.Popen(
        line,
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )
    try:
        said, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)  # compilers too, which hold the pipe open
        process.communicate()
        return LATE, f"longer than {limit:g} s"
    return process.returncode, said.strip()


def outcome(file: Path, limit: float, only_new: bool) -> Outcome:
    """Look at a file and strike it, in an empty folder."""
    started = _seconds()
    with tempfile.TemporaryDirectory() as folder:
        code, text = command(["new", "scene.toml", str(file)], folder, limit)
        verdict = "clean" if code == 0 else "told" if code == 1 and _why(text) else "wrong"
        if code == 0 and not only_new:
            run = ["run", "scene.toml", "--report", "report.html"]
            code, text = command(run, folder, limit)
            if code or not Path(folder, "report.html").exists():
                verdict = "wrong"
    if code == LATE:
        verdict = "late"
    elif code < 0 or "Traceback" in text:
        verdict = "aborted"
    return Outcome(verdict, _seconds() - started, _said(text))


def _why(text: str) -> list[str]:
    """The lines by which the command says why it ended."""
    said = ("antiosc:", "Fatal", "scene.toml:")
    return [line for line in text.splitlines() if line.startswith(said)]


def _said(text: str) -> str:
    """The line that says what happened."""
    lines = [line for line in text.splitlines() if line.strip()]
    return (_why(text) or lines or ["nothing said"])[-1][:SENTENCE]


def _seconds() -> float:
    """Processor time of all children, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def files(folder: Path) -> Iterator[Path]:
    """The files to be looked at, in the order of their names."""
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.suffix.lower() in ENDINGS:
            yield path


def main() -> None:
    """Print what became of each file, and how many of each outcome there are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--limit", type=float, default=300.0, help="of each command, s")
    parser.add_argument("--only", choices=("new",), help="leave the run out")
    asked = parser.parse_args()
    count: Counter[str] = Counter()
    for file in files(asked.folder):
        found = outcome(file.resolve(), asked.limit, asked.only == "new")
        count[found.verdict] += 1
        name = str(file.relative_to(asked.folder))[-NAME:]
        print(
            f"{found.verdict:8}{found.seconds:7.1f} s  {name:{NAME}}  {found.sentence}", flush=True
        )
    print(", ".join(f"{number} {verdict}" for verdict, number in count.most_common()))


if __name__ == "__main__":
    main()
