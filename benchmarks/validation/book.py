"""The validation book: every published case is run, and one page with pictures is written.

    .venv/bin/python benchmarks/validation/book.py --help

Rows that lie outside the bound of their source stay and must be explained: without an explanation
the program ends with exit code 1.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "support"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import forced
import frequencies
import masses
import options
import rebounds
import rods
import rubbing
import spheres
import stops
import tube
from case import Case, Row

ROOT = Path(__file__).resolve().parents[2]
CASES: list[Case] = [
    *masses.CASES,
    *rubbing.CASES,
    *rods.CASES,
    *stops.CASES,
    *tube.CASES,
    *spheres.CASES,
    *rebounds.CASES,
    *frequencies.CASES,
    *forced.CASES,
]
INTRODUCTION = """# Validation

Published tests, run by the public API in one go (`make bench-validate` writes this page and its
pictures; the scripts are in `benchmarks/validation/`). Each row gives the published value, ours,
their difference and the bound of the source. *How known* says whether the value was **read** in
the source or in a page that quotes it, is **recalled** (and is then no proof), or is the solution
of an **equation** that the source prints. Rows outside their bound stay; the reason stands below
the table.
"""
MISSING = """
## Tests whose values could not be had

Of these, stored copies of public pages hold titles, abstracts or introductions, but no values:

- spheres on beams: Timoshenko 1913, Goldsmith 1960, Schwieger 1970, Seifried and others, doi
  10.1177/1687814016668089 and 10.1177/1687814016683351, J. Appl. Mech. 91 (2024) 011011;
- balls on plates: Raman 1920, Karas 1939, Koller and Busenhart 1986, Sondergaard 1990, Gugan 2000,
  Appl. Sci. 16 (2026) 89; on laminates: Sun and Chen 1985;
- bars on a block: Stoianovici and Hurmuzlu 1996; boards that fall: JEDEC JESD22-B111;
- rebounds: Lifshitz and Kolsky 1964, Kharaz and Gorham 2000, Minamoto and Kawamura 2009;
- blocks of Sierra/SD, alone and tied: no public copy of their matrices was found.

The slip of SDND106 and modelling B of SDND108 need what antiosc's contacts do not have: a second
coefficient of friction, and a dashpot.
"""
HEAD = ["quantity", "published", "how known", "antiosc", "difference", "bound", "verdict"]


def main(only: tuple[str, ...] = (), out: Path = ROOT / "docs") -> dict[str, list[Row]]:
    """Run the cases, all unless some are named; write `out`/validation.md and its pictures.

    Parameters
    ----------
    only : names of cases
    out : folder of the page; pictures go to `pictures/` in it
    """
    chosen = [case for case in CASES if not only or case.name in only]
    pictures = out / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    found: dict[str, list[Row]] = {}
    seconds = {}
    for case in chosen:
        started = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # bodies that fly are meant to be free
            found[case.name] = case.run(pictures / f"validation_{case.name}.png")
        seconds[case.name] = time.perf_counter() - started
        outside = sum(not row.agrees for row in found[case.name])
        print(
            f"{case.name:<18}{len(found[case.name]):3d} rows, {outside} outside, "
            f"{seconds[case.name]:.1f} s",
            flush=True,
        )
    text = page(chosen, found)
    (out / "validation.md").write_text(text, encoding="utf-8")
    print(f"written to {out}: validation.md and pictures")
    return found


def page(cases: list[Case], found: dict[str, list[Row]]) -> str:
    """The page in Markdown."""
    rows = [row for case in cases for row in found[case.name]]
    within = sum(row.agrees for row in rows)
    parts = [
        INTRODUCTION,
        f"{len(cases)} cases, {len(rows)} rows, {within} within the bound of their source. "
        + options.code_state(),
        "",
        "## All rows",
        "",
        line(["case", *HEAD]),
        line(["---"] * (len(HEAD) + 1)),
    ]
    for case in cases:
        link = f"[{case.name}](#{anchor(case.title)})"
        parts += [line([link, *row.cells()]) for row in found[case.name]]
    for kind, measured in (("Published solutions", False), ("Measured", True)):
        chosen = [case for case in cases if case.measured == measured]
        if chosen:
            parts += ["", f"## {kind}"]
        for case in chosen:
            parts += ["", *section(case, found[case.name])]
    return "\n".join([*parts, MISSING])


def section(case: Case, rows: list[Row]) -> list[str]:
    """One case: data, source, picture, and reasons for rows outside."""
    parts = [
        f"### {case.title}",
        "",
        f"*Given:* {case.given}.",
        "",
        f"*Source:* {case.source}.",
        "",
        f"![{case.title}](pictures/validation_{case.name}.png)",
    ]
    reasons: dict[str, list[str]] = {}
    for row in rows:
        if not row.agrees:
            reasons.setdefault(row.why, []).append(row.quantity)
    for why, quantities in reasons.items():
        parts += ["", f"*Outside the bound:* {'; '.join(quantities)}. {why or 'Not explained.'}"]
    return parts


def line(cells: list[str]) -> str:
    """A row of a table."""
    return "| " + " | ".join(cells) + " |"


def anchor(title: str) -> str:
    """The anchor that Markdown readers give a heading."""
    kept = "".join(c for c in title.lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


def command(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = [case.name for case in CASES]
    parser.add_argument("--only", nargs="+", choices=names, default=(), help="names of cases")
    parser.add_argument("--out", type=Path, default=ROOT / "docs")
    found = options.run(parser, main, arguments)
    unexplained = [
        f"{name}: {row.quantity}"
        for name, rows in found.items()
        for row in rows
        if not row.agrees and not row.why
    ]
    for text in unexplained:
        print(f"outside its bound and not explained: {text}", file=sys.stderr)
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(command())
