"""Two libraries of the march on the same random scenes: how far their runs differ.

The other library is that of another checkout, such as the one before a change in csrc. Bits are
equal where the arithmetic is; where it is not, times and forces are compared at equal steps. The
free modes of the models are those of this checkout's library.

    .venv/bin/python benchmarks/equal_marches.py ../main/src/antiosc/libantiosc_march.so
"""

from __future__ import annotations

import argparse
import inspect
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import fuzz
import fuzz_scenes
import numpy as np
import options

import antiosc as ao
from antiosc.base import march
from antiosc.simulation import two_bodies
from antiosc.simulation.march import engine

CLOSE = 1e-9  # of the largest time, force, indentation


def main(other: Path, scenes: int = 1000, first: int = 0) -> dict[str, Any]:
    """Run the scenes `first` to `first + scenes - 1` by both; count the kinds of agreement.

    Parameters
    ----------
    other : the library to compare with
    scenes : of impacts, and as many of several bodies
    first : number of the first scene, which is the seed of its random numbers
    """
    libraries = march.library, march.load(other, Path("no sources"))
    counts: Counter[str] = Counter()
    worst, differ = 0.0, []
    for number in range(first, first + scenes):
        march.library = libraries[0]
        for kind, run in (("impact", impact(number)), ("scene", scene(number))):
            mine, theirs = (of(library, run) for library in libraries)
            off = difference(mine, theirs)
            counts["equal" if off == 0 else "close" if off <= CLOSE else "different"] += 1
            if off > CLOSE:
                differ.append(f"{kind} {number}: {off:.2g}")
            elif np.isfinite(off):
                worst = max(worst, off)
    march.library = libraries[0]
    return {"counts": dict(counts), "worst": worst, "different": differ}


def of(library: Any, run: Callable[[], ao.History]) -> Any:
    """The run of a scene by a library, or the sentence of its error."""
    march.library = library
    engine._kept.clear()
    two_bodies._idle_workspaces.clear()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return run().run
        except ao.AntioscError as error:
            return str(error)


def impact(number: int) -> Callable[[], ao.History]:
    drawn = fuzz.draw(np.random.default_rng(number))
    return lambda: ao.simulate(**drawn)


def scene(number: int) -> Callable[[], ao.History]:
    drawn = fuzz_scenes.draw(number)
    return lambda: drawn.run(fuzz_scenes.DURATION)


def difference(mine: Any, theirs: Any) -> float:
    """Largest relative difference of times, forces and indentations; inf for other steps."""
    if isinstance(mine, str) or isinstance(theirs, str):
        return 0.0 if mine == theirs else np.inf
    if mine.time.size != theirs.time.size:
        return np.inf
    pairs = [(getattr(mine, name), getattr(theirs, name)) for name in ("time", "force", "depth")]
    return max(float(np.abs(a - b).max() / (np.abs(b).max() or 1.0)) for a, b in pairs)


def report(result: dict[str, Any]) -> None:
    print(f"{result['counts']}, worst of the close ones {result['worst']:.2g}")
    print(*result["different"], sep="\n")


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("other", type=Path)
    parser.add_argument("--scenes", type=options.count, default=1000)
    parser.add_argument("--first", type=int, default=0)
    report(options.run(parser, main, arguments))


if __name__ == "__main__":
    command()
