"""Numbers of whole runs, written to a file that a later state of the code is compared with.

The programs of the documentation are run page by page, and the scene files of the demos; models,
histories, batches and maps that they leave behind give the numbers. A change that moves code and
computes the same leaves them as they are. The numbers prove nothing by themselves.

    .venv/bin/python benchmarks/frozen_numbers.py out/frozen.json --tol 1e-9

compares with the file, or writes it where it is missing.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
ONE_CONTACT = ("peak_force", "impulse", "contact_time", "restitution")
MODEL = ("k0", "m0", "m_st", "m", "omega")


def main(file: Path, tol: float) -> int:
    """Write the numbers, or compare them with those of the file; 1 where one differs."""
    numbers = {"names": sorted(name for name in dir(ao) if name in ao.__all__)}
    numbers |= {page: _page(ROOT / page) for page in _pages()}
    numbers |= {
        f"demos/scenes/{s.name}": _scene(s) for s in sorted(ROOT.glob("demos/scenes/*.toml"))
    }
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(numbers, indent=1))
        print(f"{sum(map(len, numbers.values()))} entries written to {file}")
        return 0
    differences = list(_differences(json.loads(file.read_text()), numbers, tol))
    print(*differences, sep="\n")
    total = sum(map(len, numbers.values()))
    print(f"{len(differences)} of {total} entries differ by more than {tol:g}")
    return int(bool(differences))


def _pages() -> list[str]:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [
        str(p.relative_to(ROOT)) for p in pages if PROGRAM.search(p.read_text(encoding="utf-8"))
    ]


def _page(page: Path) -> dict[str, list[float]]:
    """Numbers of what the programs of a page leave behind; each page is a process of its own."""
    call = [sys.executable, __file__, "--page", str(page)]
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"{page.name}: {done.stderr}", file=sys.stderr)
        return {"failed": [float(done.returncode)]}
    return json.loads(done.stdout.splitlines()[-1])


def run_page(page: Path) -> None:
    """Run the programs of a page and print the numbers as the last line."""
    found: dict[str, list[float]] = {}
    space: dict[str, Any] = {"__name__": "page"}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in ("meshes", "demos", "docs"):
            (Path(folder) / name).symlink_to(ROOT / name)
        (Path(folder) / "out").mkdir()
        os.chdir(folder)
        for k, program in enumerate(PROGRAM.findall(page.read_text(encoding="utf-8"))):
            try:
                with contextlib.redirect_stdout(io.StringIO()):
                    exec(compile(program, f"{page.name}:{k}", "exec"), space)
            except Exception as error:  # a program that is no whole one
                found[f"{k}: {type(error).__name__}"] = []
            for name, value in sorted(space.items()):
                if not name.startswith("_"):
                    for key, values in _harvest(value).items():
                        found[f"{k}.{name}.{key}"] = values
    print(json.dumps(found))


def _harvest(value: Any) -> dict[str, list[float]]:
    """Numbers of a model, a history, a batch, a map, an array; nothing of other objects."""
    if isinstance(value, float | np.ndarray):
        return {"": _numbers(value)}
    if hasattr(value, "omega") and hasattr(value, "m_st"):
        return {name: _numbers(getattr(value, name, None)) for name in MODEL}
    if hasattr(value, "peak_force"):
        return {name: _numbers(getattr(value, name, None)) for name in ONE_CONTACT}
    return {}


def _numbers(value: Any) -> list[float]:
    """Up to six numbers of a value: the first ones and, of more, their norm."""
    try:
        flat = np.asarray(value, dtype=float).ravel()
    except (TypeError, ValueError):
        return []
    few = [float(x) for x in flat[:5]]
    return few if flat.size <= 5 else [*few, float(np.linalg.norm(np.nan_to_num(flat)))]


def _scene(scene: Path) -> dict[str, list[float]]:
    """The result file of a scene file that the command line runs."""
    with tempfile.TemporaryDirectory() as folder:
        call = [str(Path(sys.executable).parent / "antiosc"), "run", str(scene), "--out", folder]
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"{scene.name}: {done.stderr}", file=sys.stderr)
            return {"failed": [float(done.returncode)]}
        (result,) = Path(folder).glob("*.json")
        return dict(_flat(json.loads(result.read_text())))


def _flat(tree: Any, name: str = "") -> list[tuple[str, list[float]]]:
    if isinstance(tree, dict):
        return [each for key, value in tree.items() for each in _flat(value, f"{name}.{key}")]
    numeric = isinstance(tree, int | float | list) and not re.search(
        "seconds|time_of|version", name
    )
    return [(name, _numbers(tree))] if numeric else []


def _differences(old: dict[str, Any], new: dict[str, Any], tol: float) -> list[str]:
    said = []
    for page in old.keys() | new.keys():
        was, now = old.get(page, {}), new.get(page, {})
        if page == "names":
            said += [f"name: {name}" for name in set(was) ^ set(now)]
            continue
        for key in sorted(was.keys() | now.keys()):
            a, b = was.get(key), now.get(key)
            if a is None or b is None or len(a) != len(b):
                said.append(f"{page} {key}: {a} -> {b}")
                continue
            worst = max((_apart(x, y) for x, y in zip(a, b, strict=True)), default=0.0)
            if worst > tol:
                said.append(f"{page} {key}: {worst:.1e}  {a} -> {b}")
    return said


def _apart(a: float, b: float) -> float:
    if a == b or (math.isnan(a) and math.isnan(b)):
        return 0.0
    return abs(a - b) / max(abs(a), abs(b))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, nargs="?", default=ROOT / "out" / "frozen.json")
    parser.add_argument("--tol", type=float, default=1e-12)
    parser.add_argument("--page", type=Path)
    arguments = parser.parse_args()
    if arguments.page:
        run_page(arguments.page)
    else:
        sys.exit(main(arguments.file, arguments.tol))
