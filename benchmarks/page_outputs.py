"""What the programs of the pages print, in a block of text beside each of them.

    python benchmarks/page_outputs.py [NAME …]

runs the programs of all pages, or of those named, and writes anew what they print, and the pictures
that they draw and the page shows. The tests run the same programs and compare the figures.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
import textwrap
import warnings
from pathlib import Path
from typing import Any

import pages
import pictures_drawn

#: A program of a page, and what it prints.
BLOCK = re.compile(r"```python\n(.*?)```\n(?:\n```text\n(.*?)```\n)?", re.DOTALL)
#: The program of `matrices` reads files of another one.
SILENT = {*pages.UNRUN}
#: Programs of these pages call all that is public, with numbers of no part.
REFERENCE = "api/"
#: Longer lines are wrapped, unless they are rows of a table; so many blanks begin what goes on.
LONGEST, WIDTH, BLANKS = 110, 96, 14
#: Figures of lines with these words are those of the machine, or rounding; rows of `tradeoff` have
#: seconds, and which is the cheapest follows from them.
NOISE = re.compile(r"seconds|energy drift|force error|^step |^antiosc  |^cheapest: ")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
#: Relative difference of figures of two kinds of processor.
SAME = 0.02
#: The release of gmsh with which the pages were printed: 4.15 makes other meshes, and figures
#: of ten pages differ there by 2 to 13 %.
GMSH = "4.8"


def told() -> list[str]:
    """Names of the pages that show what their programs print."""
    return [n for n in pages.pages() if n not in SILENT and not n.startswith(REFERENCE)]


def printed(name: str, folder: Path) -> list[str]:
    """What each program of a page prints, run in the folder, where the meshes are.

    Parameters
    ----------
    name : of the page, such as "howto/map"
    folder : the working folder of this process
    """
    names: dict[str, Any] = {}
    found = []
    for block in pages.blocks_of(pages.pages()[name]):
        text, names = said(block, folder, names)
        found.append(text)
    return found


def said(program: str, folder: Path, names: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """What a program prints that goes on from these names, and the names after it."""
    path = folder / "program.py"
    path.write_text(program, encoding="utf-8")
    kept = {name: value for name, value in names.items() if not name.startswith("__")}
    with contextlib.redirect_stdout(io.StringIO()) as out:
        after = runpy.run_path(str(path), kept)
    return "\n".join(map(wrapped, out.getvalue().strip().splitlines())), after


def wrapped(line: str) -> str:
    """A line in a width that a page shows."""
    if len(line) <= LONGEST:
        return line.rstrip()
    return textwrap.fill(line, WIDTH, subsequent_indent=BLANKS * " ", break_on_hyphens=False)


def lines_of(text: str) -> list[str]:
    """The lines of an output as they were printed."""
    return re.sub(rf"\n {{{BLANKS}}}(?=\S)", " ", text).splitlines()


def shown(name: str) -> list[str]:
    """The blocks of text beside the programs of a page, "" where there is none."""
    text = pages.pages()[name].read_text(encoding="utf-8")
    return [block.strip() for _, block in BLOCK.findall(text)]


def with_outputs(text: str, outputs: list[str]) -> str:
    """A page with these blocks beside its programs."""
    left = iter(outputs)

    def beside(found: re.Match[str]) -> str:
        output = next(left)
        block = f"\n```text\n{output}\n```\n" if output else ""
        return f"```python\n{found[1]}```\n{block}"

    return BLOCK.sub(beside, text)


def comparable() -> bool:
    """Whether the pages were printed with this release of gmsh."""
    try:
        import gmsh
    except (ImportError, OSError):
        return False
    return bool(gmsh.__version__.startswith(f"{GMSH}."))


def changes(name: str, outputs: list[str]) -> list[str]:
    """Lines of a page that its programs print otherwise."""
    pairs = zip(shown(name), outputs, strict=True)
    return [line for pair in pairs for line in differences(*pair)]


def differences(before: str, after: str) -> list[str]:
    """Lines of what is shown that another run prints otherwise, by more than rounding."""
    old, new = lines_of(before), lines_of(after)
    if len(old) != len(new):
        return [f"{len(new)} lines for {len(old)}"]
    pairs = zip(old, new, strict=True)
    return [f"{a} -> {b}" for a, b in pairs if not (NOISE.search(a) or same(a, b))]


def same(one: str, other: str) -> bool:
    """Whether two lines have the same words and nearly the same figures."""
    if NUMBER.sub("", one).split() != NUMBER.sub("", other).split():
        return False
    figures = zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=SAME, abs_tol=unit(a)) for a, b in figures)


def unit(figure: str) -> float:
    """One unit of the last digit of a figure."""
    digits, _, exponent = figure.partition("e")
    return 1.01 * 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))


def unsaid(text: str) -> list[str]:
    """Lines with an error bar, of an output that does not tell what the bar holds.

    A bar holds the error of the contact's law, or is called numerical; those of a blow that was
    found from signals are of what the signals tell.
    """
    if re.search(r"\blaw\W+\d|± law\b|numerical|the signals determine", text):
        return []
    return [line for line in text.splitlines() if re.search(r"± *\d", line)]


def refreshed(name: str) -> str:
    """Run a page in a process of its own and write its outputs; what to tell of it."""
    here = Path(__file__).resolve()
    environment = os.environ | {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, str(here), "--child", name]
        (Path(folder) / "meshes").symlink_to(pages.ROOT / "meshes")
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        if done.returncode:
            return f"{name}: {done.stderr.strip()[-500:]}"
        drawn = pictures_drawn.on_page(name)
        for picture, kept in drawn.items():
            shutil.copyfile(Path(folder) / picture, kept)
    if drawn:
        pictures_drawn.store(name, pictures_drawn.of_page(name))
    outputs = json.loads(done.stdout.splitlines()[-1])
    page = pages.pages()[name]
    changed = changes(name, outputs)
    page.write_text(with_outputs(page.read_text(encoding="utf-8"), outputs), encoding="utf-8")
    return "\n  ".join([name, *changed])


def main(names: list[str]) -> None:
    """Refresh the named pages, or all."""
    for name in told():
        if not names or name in names:
            print(refreshed(name), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="README, howto/map, …")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        warnings.simplefilter("ignore")
        print(json.dumps(printed(options.child, Path.cwd())))
    else:
        main(options.names)
