"""Size of the code and its structure: lines, files, rooms, imports between rooms, circles.

A room is a folder or a file of the place that is looked at; an arrow is an import from one room to
another, however often; a floor is a longest path of arrows down to a room that imports nothing.

    .venv/bin/python benchmarks/house.py [TREE …]

prints one column a tree (a folder with a checkout), by default this one.
"""

from __future__ import annotations

import argparse
import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import scipy.sparse
import scipy.sparse.csgraph

HERE = Path(__file__).resolve().parents[1]
#: Where rooms are counted -> the folders that are one place there.
PLACES = {
    "all": (
        *("src/antiosc", "src/antiosc_app", "src/antiosc_decks", "src/antiosc_studies"),
        *("benchmarks", "demos"),
    ),
    "antiosc/": ("src/antiosc",),
    "fem/": ("src/antiosc/fem",),
    "impact/": ("src/antiosc/impact",),
}


def lines(tree: Path, *patterns: str) -> int:
    """Lines of all files that match."""
    files = [path for pattern in patterns for path in tree.glob(pattern)]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def imports(path: Path) -> Iterator[str]:
    """Full names of what a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def room(path: Path, place: tuple[str, ...]) -> str:
    """The room of a place in which a file stands; "" for another place."""
    for folder in place:
        if path.is_relative_to(folder):
            inside = path.relative_to(folder).parts
            whole = len(place) > 1 and folder != "src/antiosc"
            return folder if whole else "".join(inside[:1]).removesuffix(".py")
    return ""


def structure(tree: Path, place: tuple[str, ...]) -> str:
    """Rooms, arrows, floors and circles of a place."""
    arrows, rooms = set(), set()
    for folder in place:
        for path in (tree / folder).rglob("*.py"):
            own = room(path.relative_to(tree), place)
            if own == "__init__":
                continue
            rooms.add(own)
            for name in imports(path):
                to = room(Path("src", *name.split(".")), place)
                if to not in ("", own) and (to in rooms or _stands(tree, place, to)):
                    arrows.add((own, to))
    below = {one: [b for a, b in arrows if a == one] for one in rooms}
    names = sorted(rooms | {b for _, b in arrows})
    at = [names.index(a) for a, _ in arrows], [names.index(b) for _, b in arrows]
    graph = scipy.sparse.coo_matrix(([1] * len(arrows), at), shape=(len(names), len(names)))
    loops = len(names) - scipy.sparse.csgraph.connected_components(graph, connection="strong")[0]

    @cache
    def floor(one: str) -> int:
        return 1 + max(map(floor, below.get(one, [])), default=0)

    floors = "–" if loops else max(map(floor, names))
    return f"{len(names)} rooms, {len(arrows)} arrows, {floors} floors, {loops} rooms in circles"


def _stands(tree: Path, place: tuple[str, ...], name: str) -> bool:
    return any((tree / folder / end).exists() for folder in place for end in (name, f"{name}.py"))


def table(tree: Path) -> dict[str, str]:
    """What is measured of a tree."""
    files = [p for p in (tree / "src").rglob("*.py") if p.stat().st_size]
    text = "\n".join(path.read_text(encoding="utf-8") for path in files)
    code = re.sub(r"^\s*(from|import) .*$", "", text, flags=re.MULTILINE)
    return {
        "Python in src": str(lines(tree, "src/**/*.py", "src/**/*.pyi")),
        **{
            f"of it {name}": str(lines(tree, f"src/{name}/**/*.py"))
            for name in ("antiosc", "antiosc_app", "antiosc_decks", "antiosc_studies")
        },
        "files": str(len(files)),
        "`Any`": str(len(re.findall(r"\bAny\b", code))),
        "tests": str(lines(tree, "tests/**/*.py")),
        "csrc, march": str(lines(tree, "csrc/*.[ch]")),
        "csrc, exports and page": str(lines(tree, "csrc/export/*.[ch]", "csrc/page/**/*.[ch]")),
        **{f"structure, {name}": structure(tree, place) for name, place in PLACES.items()},
    }


def main() -> None:
    """The table of the trees that the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("trees", nargs="*", type=Path, default=[HERE])
    trees = parser.parse_args().trees
    columns = [table(tree.resolve()) for tree in trees]
    print("| |", " | ".join(tree.resolve().name for tree in trees), "|")
    print("|---" * (len(trees) + 1) + "|")
    for name in columns[0]:
        print(f"| {name} |", " | ".join(column[name] for column in columns), "|")


if __name__ == "__main__":
    main()
