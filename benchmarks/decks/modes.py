"""First natural frequencies and masses of decks beside those that their own solvers state.

    python benchmarks/decks/modes.py DECK F06 [DECK F06 ...]    Nastran, as the .f06 file states
    python benchmarks/decks/modes.py --ccx DECK [DECK ...]      Abaqus, as CalculiX computes

CalculiX solves the model and the supports of the first step of a deck (`apt install calculix-ccx`).

Frequencies are those of the same set of elastic modes; frequencies and masses are in the deck's
units. One line a deck: mass, the first frequencies of both, their largest difference.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np

#: Modes that are compared.
COUNT = 3
#: Frequencies below this share of the next are those of rigid motions.
RIGID = 1e-3
NUMBER = r"\s+(-?\d\.\d+E[+-]\d+)"
MODE = re.compile(rf"^0?\s*(\d+)\s+\d+{NUMBER}{NUMBER}{NUMBER}", re.MULTILINE)
#: Of the grid point weight generator: mass along x; of MYSTRAN: all mass.
MASS = re.compile(rf"(?:MASS AXIS SYSTEM \(S\).*\n\s+X|Total mass =){NUMBER}")


def stated(f06: Path) -> tuple[np.ndarray, float]:
    """(frequencies in Hz, mass or nan) of a result file."""
    text = f06.read_text("latin-1")
    start = max(text.find("R E A L   E I G E N V A L U E S"), 0)
    tables: list[list[float]] = [[]]
    for match in MODE.finditer(text, start):
        if int(match[1]) == 1 and tables[-1]:
            tables.append([])
        if int(match[1]) == len(tables[-1]) + 1:
            tables[-1].append(float(match[4]))
    # of superelements, the whole comes last
    found = tables[-1 if "SUPERELEMENT 1" in text else 0]
    mass = MASS.search(text)
    return np.array(found), float(mass[1]) if mass else float("nan")


def solved(deck: Path) -> tuple[np.ndarray, float]:
    """The same by CalculiX, of an Abaqus deck."""
    lines = deck.read_text("latin-1").replace("\r", "").split("\n")
    starts = [k for k, line in enumerate(lines) if re.match(r"\s*\*step\b", line, re.I)]
    ends = [k for k, line in enumerate(lines) if re.match(r"\s*\*end\s*step", line, re.I)]
    model, step = (lines[: starts[0]], lines[starts[0] : ends[0]]) if starts else (lines, [])
    kept, on = [], False
    for line in step:
        if line.lstrip().startswith("*") and not line.lstrip().startswith("**"):
            on = line.strip().upper().startswith("*BOUNDARY")
        kept += [line] * on
    free = not re.search(r"^\s*\*boundary", "\n".join(model + kept), re.I | re.M)
    model += [*kept, "*ELSET, ELSET=ALLOFIT, GENERATE", "1, 9999999"]
    rows: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for file in deck.parent.iterdir():
            if file.is_file() and file.stat().st_size < 1e7 and file.suffix != ".inp":
                shutil.copy(file, folder)
        printed = ["*EL PRINT, ELSET=ALLOFIT, TOTALS=ONLY", "EMAS"]
        # small models have no more modes, and then say zero or nothing; the print may end it
        for count, also in ((3 * COUNT, printed), (COUNT, printed), (3 * COUNT, [])):
            asked = ["*STEP", "*FREQUENCY", str(count + 6 * free), *also, "*END STEP", ""]
            Path(folder, "a.inp").write_text("\n".join([*model, *asked]))
            told = subprocess.run(["ccx", "a"], cwd=folder, capture_output=True, text=True)
            text = Path(folder, "a.dat").read_text() if Path(folder, "a.dat").exists() else ""
            table = text.partition("P A R T I C I P")[0]
            rows = re.findall(r"^ +\d+((?: +\S+){4})$", table, re.M)
            if any(float(row.split()[2]) for row in rows):
                break
    if not rows:
        raise ValueError("CalculiX: " + " ".join(told.stdout.split("*ERROR")[1:])[:100])
    total = re.search(r"total mass for set.*\n\s*(\S+)", text)
    return np.array([float(row.split()[2]) for row in rows]), float(total[1]) if total else np.nan


def computed(deck: Path) -> tuple[np.ndarray, float]:
    """The same by antiosc."""
    import antiosc as ao

    for unit in ("m", 1e3, 1e-3, 1e6, 1e-6):  # plausible speeds of waves; the frequencies are alike
        try:
            part = ao.read_model(deck, unit)
        except ao.AntioscError as error:
            if "wave speed" not in str(error):
                raise
            continue
        factor = unit if isinstance(unit, float) else 1.0
        for count in (4 * COUNT, 2 * COUNT, COUNT):  # small models have no more
            with suppress(ao.AntioscError):
                return np.array(ao.natural_modes(part, count).frequency), part.mass * factor
        return np.zeros(0), part.mass * factor
    raise ValueError("no unit of length makes the speed of waves plausible")


def elastic(frequency: np.ndarray) -> np.ndarray:
    """The first ones that are not of rigid motions."""
    kept = frequency[frequency > RIGID * np.nanmax(frequency[: 2 * COUNT + 3], initial=0.0)]
    return kept[:COUNT]


def main() -> int:
    """The command line."""
    warnings.simplefilter("ignore")
    by_ccx = sys.argv[1:2] == ["--ccx"]
    paths = list(map(Path, sys.argv[2 if by_ccx else 1 :]))
    pairs = [(p, p) for p in paths] if by_ccx else zip(paths[::2], paths[1::2], strict=True)
    for deck, f06 in pairs:
        name = "/".join(deck.parts[-2:])
        try:
            theirs, their_mass = solved(deck) if by_ccx else stated(f06)
            ours, mass = computed(deck)
        except Exception as error:
            print(f"{name}: {type(error).__name__}: {error}"[:200])
            continue
        both = [elastic(ours), elastic(theirs)]
        count = min(map(len, both))
        off = np.abs(both[0][:count] / both[1][:count] - 1).max(initial=0.0)
        shown = [", ".join(f"{f:.6g}" for f in one) for one in both]
        print(f"{name}: mass {mass:.6g} ({their_mass:.6g}); f {shown[0]} ({shown[1]}): {off:.1e}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
