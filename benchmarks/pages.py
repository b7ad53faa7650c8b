"""Every program of README, docs, demos and scene files, once as it stands and once much finer.

A program runs as printed, with meshes of half the size, with twice the anti-oscillators, and with
the materials of the table at the lowest and at the highest yield strength of their sources. A
headline (peak force, impulse or contact time of a run) that moves by more than its error bar, or
by more than `UNSAID` where the program prints no bar, is printed. Nothing printed: every page shows
numbers that its own mesh and model support.

    python benchmarks/pages.py [NAME …] [--workers 2]

The exit code is 1 where a headline moves too far or a program fails.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
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
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
#: Relative change of a headline that a program without an error bar may show: the accuracy of
#: `strike` by default is 2 %, that of a map 5 %.
UNSAID = 0.05
#: The quantile of a sample that is compared.
LARGE = 0.95
#: Seconds after which a program is stopped.
LONGEST = 1800


class Variant(NamedTuple):
    """Factors on element sizes and on numbers of anti-oscillators; which end of yield strengths."""

    size: float = 1.0
    modes: int = 1
    strength: str = "usual"


VARIANTS = {
    "as printed": Variant(),
    "half the size": Variant(size=0.5),
    "twice the modes": Variant(modes=2),
    "the least yield strength": Variant(strength="least"),
    "the largest yield strength": Variant(strength="largest"),
}
#: Pages whose program reads files of another one; `tests/matrix_files` writes them and runs it.
UNRUN = {"howto/matrices"}
QUANTITIES = ("peak_force", "impulse", "contact_time")


class Headline(NamedTuple):
    """One number that a program found, with its error bar (None: no bar), relative.

    `by_law`: the bar is that of the contact's law alone, as of maps and falls.
    """

    name: str
    value: float
    bar: float | None
    by_law: bool = False


class Moved(NamedTuple):
    """A headline that another variant changes by more than is allowed."""

    program: str
    variant: str
    headline: str
    printed: float
    finer: float
    allowed: float


# --- in the child: run one program, with finer meshes or more anti-oscillators


def recorded(headlines: list[Headline], call: Callable[..., Any]) -> Callable[..., Any]:
    """`call`, whose result is added to the headlines where the program itself calls it."""

    @functools.wraps(call)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        result = call(*args, **kwargs)
        caller = str(sys._getframe(1).f_globals.get("__name__"))
        if not caller.startswith("antiosc"):  # as exports that choose their step by trial
            headlines.extend(headlines_of(f"{call.__name__} {len(headlines)}", result))
        return result

    return wrapper


def sampled(headlines: list[Headline], call: Callable[..., Any]) -> Callable[..., Any]:
    """`monte_carlo`, whose headlines are quantiles with the bars of its sampling, not each run."""

    @functools.wraps(call)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        before = len(headlines)
        many = call(*args, **kwargs)
        del headlines[before:]
        for name in (one for one in QUANTITIES if one in many.values):
            found = many.quantile(name, LARGE)
            bar = max(found.high / found.value - 1, 1 - found.low / found.value, UNSAID)
            headlines.append(Headline(f"{name} at {LARGE:.0%}", found.value, bar))
        return many

    return wrapper


def headlines_of(name: str, result: Any) -> Iterator[Headline]:
    """Peak force, impulse and contact time of a run; the largest peak of many runs."""
    import numpy as np

    peak = getattr(result, "peak_force", None)
    if peak is None:
        return
    if np.ndim(peak):
        doubtful = getattr(result, "doubtful", None)
        known = np.asarray(peak, dtype=float)
        if doubtful is not None:
            known = known[~doubtful]
        bar = max(getattr(result, "law_error", None) or 0.0, UNSAID)
        yield Headline(f"{name} largest peak_force", float(np.nanmax(known)), bar, True)
        return
    for quantity in QUANTITIES:
        value = getattr(result, quantity, None)
        if isinstance(value, int | float):
            by_law = bool(getattr(result, "law_error", None))  # of a fall
            yield Headline(f"{name} {quantity}", float(value), bar_of(result, quantity), by_law)


def bar_of(result: Any, quantity: str) -> float | None:
    """The relative error bar of a run, None where it has none or leaves mesh or truncation out."""
    from antiosc.base.errors import AntioscError

    if law := getattr(result, "law_error", None):  # of a fall
        return max(float(law), UNSAID)
    with contextlib.suppress(AntioscError, AttributeError, KeyError, TypeError):
        budget = result.error_budget
        return None if set(budget.unknown) - {"law"} else float(budget[quantity].total)
    return None


def finer_mesh(factor: float, call: Callable[..., Any]) -> Callable[..., Any]:
    """`read_mesh` or `box_mesh` with all sizes times the factor."""

    @functools.wraps(call)
    def wrapper(source: Any, size: float | None = None, *args: Any, **kwargs: Any) -> Any:
        if "refine" in kwargs:
            kwargs["refine"] = [
                (place, factor * near, *more) for place, near, *more in kwargs["refine"]
            ]
        return call(source, size and factor * size, *args, **kwargs)

    return wrapper


def more_modes(factor: int, call: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose argument n or modes counts anti-oscillators or modes, times the factor."""

    @functools.wraps(call)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        for name in ("n", "modes"):
            if isinstance(kwargs.get(name), int):
                kwargs[name] = min(factor * kwargs[name], getattr(args[0], "dofs", math.inf) - 1)
        return call(*args, **kwargs)

    return wrapper


def at_end(strength: str) -> None:
    """Give the materials of the table the yield strength at one end of their range."""
    from antiosc.base import materials

    read = materials._record_of_row

    def other(*row: Any) -> materials.MaterialRecord:
        found = read(*row)
        low, high = found.yield_range or (found.yield_strength,) * 2
        return replace(found, yield_strength=low if strength == "least" else high)

    if strength != "usual":
        materials._record_of_row = other


def patched(size: float, modes: int) -> list[Headline]:
    """Make the public functions finer and record what they find."""
    import antiosc as ao

    headlines: list[Headline] = []
    for name in ("read_mesh", "box_mesh"):
        setattr(ao, name, finer_mesh(size, getattr(ao, name)))
    for name in ("extract", "natural_modes", "superposition", "impact_map"):
        setattr(ao, name, more_modes(modes, getattr(ao, name)))
    for name in ("simulate", "simulate_many", "strike", "drop", "impact_map"):
        setattr(ao, name, recorded(headlines, getattr(ao, name)))
    ao.monte_carlo = sampled(headlines, ao.monte_carlo)
    ao.Scene.run = recorded(headlines, ao.Scene.run)  # type: ignore[method-assign]
    return headlines


def finer_scene(text: str, size: float, modes: int) -> str:
    """A scene file with its sizes and its number of anti-oscillators times the factors."""

    def scaled(match: re.Match[str]) -> str:
        return f"{match[1]}{size * float(match[2]):.9g}"

    def more(match: re.Match[str]) -> str:
        return f"{match[1]}{modes * int(match[2])}"

    text = re.sub(r"(?m)^(size = )([0-9.e+-]+)", scaled, text)
    return re.sub(r"(?m)^(n = )([0-9]+)$", more, text)


def run_scene(path: Path, size: float, modes: int) -> list[Headline]:
    """Run a scene file by the command, and read its results."""
    from antiosc_app.cli import main

    path.write_text(finer_scene(path.read_text(encoding="utf-8"), size, modes), encoding="utf-8")
    if code := main(["run", str(path), "--out", "results"]):
        raise SystemExit(code)
    headlines = []
    for found in sorted(Path("results").rglob("*.json")):
        result = json.loads(found.read_text(encoding="utf-8")).get("result", {})
        for quantity in QUANTITIES:
            if isinstance(result.get(quantity), int | float):
                bar = result.get("error_budget", {}).get(quantity, {}).get("total")
                headlines.append(Headline(f"{found.stem} {quantity}", result[quantity], bar))
    return headlines


def child(program: str, size: float, modes: int, strength: str) -> None:
    """Run one program here, in a folder of its own, and print its headlines as the last line."""
    warnings.simplefilter("ignore")
    at_end(strength)
    out = sys.stdout
    sys.argv = [program]
    sys.path.insert(0, str(Path(program).resolve().parent))
    with contextlib.redirect_stdout(io.StringIO()):
        if program.endswith(".toml"):
            headlines = run_scene(Path(program).resolve(), size, modes)
        else:
            headlines = patched(size, modes)
            with contextlib.suppress(SystemExit):
                runpy.run_path(program, run_name="__main__")
    print(json.dumps(headlines), file=out)


# --- in the parent: collect the programs, run their variants, compare


def programs() -> dict[str, Callable[[Path], str]]:
    """Name of each program -> what writes it into a folder and gives its path there."""
    found: dict[str, Callable[[Path], str]] = {}
    for name, page in pages().items():
        if name in UNRUN:
            continue
        blocks = blocks_of(page)
        found[name] = functools.partial(write_program, "\n".join(blocks))
    for script in sorted((ROOT / "demos").glob("*.py")):
        found[f"demos/{script.stem}"] = functools.partial(copy_demos, f"demos/{script.name}")
    for scene in sorted((ROOT / "demos/scenes").glob("*.toml")):
        found[f"scenes/{scene.stem}"] = functools.partial(copy_demos, f"demos/scenes/{scene.name}")
    return found


def pages() -> dict[str, Path]:
    """Name -> file of each page with a whole program."""
    paths = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    names = [str(path.relative_to(ROOT).with_suffix("")).removeprefix("docs/") for path in paths]
    found = zip(names, paths, strict=True)
    return {n: path for n, path in found if any("import antiosc" in b for b in blocks_of(path))}


def blocks_of(page: Path) -> list[str]:
    """The programs of a page, in their order."""
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def write_program(text: str, folder: Path) -> str:
    """The programs of a page as one script, beside the meshes."""
    shutil.copytree(ROOT / "meshes", folder / "meshes")
    (folder / "program.py").write_text(text, encoding="utf-8")
    return "program.py"


def copy_demos(path: str, folder: Path) -> str:
    """All demos with their scenes, beside the meshes."""
    shutil.copytree(ROOT / "meshes", folder / "meshes")
    shutil.copytree(ROOT / "demos", folder / "demos", ignore=shutil.ignore_patterns("pictures"))
    return path


def run(write: Callable[[Path], str], variant: Variant) -> list[Headline]:
    """The headlines of one variant of a program, or RuntimeError with the end of what it said."""
    with tempfile.TemporaryDirectory() as folder:
        program = write(Path(folder))
        command = [sys.executable, str(Path(__file__).resolve()), "--child", program]
        for name, value in variant._asdict().items():
            command += [f"--{name}", str(value)]
        environment = os.environ | {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=LONGEST
        )
    if done.returncode:
        raise RuntimeError(done.stderr.strip()[-500:])
    return [Headline(*entry) for entry in json.loads(done.stdout.strip().splitlines()[-1])]


def compared(name: str, write: Callable[[Path], str]) -> tuple[list[Moved], list[str]]:
    """Headlines of a program that its variants move too far, and what went wrong."""
    moved: list[Moved] = []
    troubles: list[str] = []
    printed: list[Headline] = []
    for variant, factors in VARIANTS.items():
        try:
            headlines = run(write, factors)
        except (RuntimeError, subprocess.TimeoutExpired) as error:
            troubles.append(f"{name}, {variant}: {error}")
            continue
        if variant == "as printed":
            printed = headlines
        elif len(headlines) != len(printed):
            troubles.append(f"{name}, {variant}: {len(headlines)} headlines for {len(printed)}")
        else:
            moved += differences(name, variant, printed, headlines)
    return moved, troubles


def differences(
    name: str, variant: str, printed: list[Headline], finer: list[Headline]
) -> list[Moved]:
    """The headlines that differ by more than their bars allow."""
    moved = []
    for before, after in zip(printed, finer, strict=True):
        known = before.bar is not None and math.isfinite(before.bar)
        # a bar of the law says nothing of the mesh and the modes
        known = known and (not before.by_law or VARIANTS[variant].strength != "usual")
        allowed = before.bar if known and before.bar else UNSAID
        if not abs(after.value - before.value) <= allowed * abs(before.value):  # NaN too
            moved.append(Moved(name, variant, before.name, before.value, after.value, allowed))
    return moved


def main(names: list[str], workers: int = 1) -> int:
    """Compare the named programs, or all; print what moves; the number of lines printed."""
    chosen = {name: write for name, write in programs().items() if not names or name in names}
    lines = 0
    with ThreadPoolExecutor(workers) as pool:
        for moved, troubles in pool.map(compared, chosen, chosen.values()):
            for row in moved:
                change = row.finer / row.printed - 1 if row.printed else math.inf
                print(
                    f"{row.program}: {row.headline} {row.printed:.5g} -> {row.finer:.5g} with"
                    f" {row.variant} ({change:+.1%}, allowed {row.allowed:.1%})",
                    flush=True,
                )
            for trouble in troubles:
                print(trouble, flush=True)
            lines += len(moved) + len(troubles)
    return lines


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="README, howto/map, demos/drop, scenes/step, …")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--size", type=float, default=1.0, help=argparse.SUPPRESS)
    parser.add_argument("--modes", type=int, default=1, help=argparse.SUPPRESS)
    parser.add_argument("--strength", default="usual", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.child, options.size, options.modes, options.strength)
    else:
        sys.exit(bool(main(options.names, options.workers)))
