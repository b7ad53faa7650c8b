"""Nothing of a deck is dropped without a word: its cards, counted by a parser of its own.

    python benchmarks/decks/audit.py FOLDER... --out audit.jsonl [--pattern '*.bdf'] ...

Cards in = read + harmless + ignored and named + unknown and named + refused. Of the cards that are
read, those in which nothing looks at a field after the number are listed by their names: nothing
of them can be in the model.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import collection

#: Entries that are read as lists of words.
BY_LISTS = ("PARAM", "SPOINT")


def nastran_cards(path: Path) -> Counter[str]:
    """Entries of the bulk data by name, with copies (=, and =(n) of n)."""
    found: Counter[str] = Counter()
    name = ""
    started = not any(
        line.split("$")[0].upper().split()[:2] == ["BEGIN", "BULK"] for line in _lines(path)
    )
    for line in _followed(path):
        line = line.split("$")[0].rstrip().expandtabs(8)
        words = line.upper().replace(",", " ").split()
        if not words:
            continue
        if words[:2] == ["BEGIN", "BULK"] and "SUPER" not in line.upper():
            started = True
        elif words[0].startswith("ENDDATA") and started:
            break
        elif started and words[0] == "BEGIN":
            found["BEGIN SUPER" if "SUPER" in line.upper() else "BEGIN"] += 1
        elif started and words[0][0] == "=":
            found[name] += int(words[0][1:].strip("()") or 1)
        elif started and _named(line) and not (name == "DEQATN" and line[0] == " "):
            name = words[0] if "," in line else line[:8].strip().upper().split()[0]
            name = "DEQATN" if name.startswith("DEQATN") else name.rstrip("*")
            found[name] += 1
    return found


def _named(line: str) -> bool:
    """Whether the first field of a line that begins with blanks is a name."""
    first = line.split(",")[0] if "," in line else line[:8]
    return first.strip()[:1].isalpha()


def abaqus_cards(path: Path) -> Counter[str]:
    """Keyword cards by name; *INCLUDE is followed; surfaces as cgx of Debian writes them."""
    found: Counter[str] = Counter()
    above = ""
    for line in _followed(path):
        line = line.strip()
        found["*SURFACE"] += above.startswith("** Surfaces based on ") and line[:1] not in "*"
        above = line
        if line.startswith("*") and not line.startswith("**"):
            found["*" + "".join(line[1:].split(",")[0].split()).upper()] += 1
    return +found


def _lines(path: Path) -> list[str]:
    return path.read_text("latin-1").replace("\r", "\n").split("\n")


def _followed(path: Path, top: Path | None = None) -> Any:
    """Lines of a file and of those that it includes."""
    top = top or path.parent
    lines = iter(_lines(path))
    for line in lines:
        plain = line.strip()
        nastran = plain.upper().startswith("INCLUDE") and plain[7:8] in (" ", "'", '"', "\t")
        abaqus = plain.upper().replace(" ", "").startswith("*INCLUDE,") and "=" in plain
        if not (nastran or abaqus):
            yield line
            continue
        named = plain.split("=", 1)[1] if abaqus else plain[7:].split("$")[0].strip()
        while nastran and named[:1] in "'\"" and named.count(named[0]) < 2:
            named += next(lines).strip()
        name = named.split(",")[0].strip().strip("'\"").strip().replace("\\", "/")
        for folder in (top, path.parent):
            if (folder / name).is_file():
                yield from _followed(folder / name, top)
                break
        else:
            yield line


def tried(path: Path) -> dict[str, Any]:
    """Counts of one file."""
    from antiosc.base.errors import AntioscError
    from antiosc.io.neutral import UnitSystem
    from antiosc_decks import (
        abaqus_assembly as assembly,
        abaqus_cards as abaqus,
        abaqus_model,
        nastran_cards as nastran,
        nastran_mesh as mesh,
        nastran_model,
    )
    from antiosc_decks.builder import Unstated
    from antiosc_decks.sources import Sources

    seen: set[int] = set()

    def noting(kind: type, name: str) -> None:
        own = getattr(kind, name)

        def noted(self: Any, *arguments: Any) -> Any:
            if not arguments or arguments[0] != 0:  # the number alone says nothing
                seen.add(id(self))
            return own(self, *arguments)

        setattr(kind, name, noted)

    flat = path.suffix.lower() == ".inp"
    saved = nastran.Entry.text, abaqus.Card.rows, abaqus.Card.first, abaqus.Card.option
    noting(nastran.Entry, "text")
    noting(abaqus.Card, "rows")
    noting(abaqus.Card, "first")
    noting(abaqus.Card, "option")
    result: dict[str, Any] = {}
    try:
        found: Any = (assembly if flat else mesh).read(Sources(path, path.name))
        fates = Counter(fate.kind for _, _, fate in found.account.cards)
        counted = Counter(name for name, _, _ in found.account.cards)
        own = (abaqus_cards if flat else nastran_cards)(path)
        result |= {"fates": fates, "cards": sum(own.values())}
        names = {*own, *counted} - {"ENDDATA"}
        differ = {n: (own[n], counted[n]) for n in names if own[n] != counted[n]}
        result["differ"] = differ
        model_of = abaqus_model.model_of if flat else nastran_model.model_of
        model_of(found, UnitSystem.of("m"), Unstated(collection.DENSITY))
        entries = found.cards if flat else found.bulk.entries
        kinds = dict((name, fate.kind) for name, _, fate in found.account.cards)
        star = "*" if flat else ""
        result["unseen"] = Counter(
            name
            for entry in entries
            if id(entry) not in seen
            and (entry.lines or entry.options if flat else len([f for f in entry.fields if f]) > 1)
            and (flat or entry.name not in BY_LISTS)
            and kinds.get(name := star + (entry.keyword if flat else entry.name)) == "read"
        )
    except AntioscError as error:
        result["refused"] = str(error)
    finally:
        nastran.Entry.text, abaqus.Card.rows, abaqus.Card.first, abaqus.Card.option = saved
    return result


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--out", type=Path, default=Path("audit.jsonl"))
    parser.add_argument("--pattern", action="append", default=[])
    parser.add_argument("--without", action="append", default=[])
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        collection.work(tried)
        return 0
    paths, _ = collection.decks(given.folders, given.pattern, given.without)
    given.out.write_text("")
    done: dict[str, Any] = {}
    collection.read_all(paths, done, given.out, __file__)
    fates: Counter[str] = Counter()
    unseen: Counter[str] = Counter()
    cards, lost = 0, []
    for one in done.values():
        fates += Counter(one.get("fates", {}))
        unseen += Counter(one.get("unseen", {}))
        cards += one.get("cards", 0)
        if one.get("differ") or "died" in one:
            lost.append(f"{Path(one['path']).name}: {one.get('died') or one['differ']}")
    counted = sum("cards" in one for one in done.values())
    print(
        f"{len(done)} files, {counted} of them parsed: {cards} cards in, {sum(fates.values())} out"
    )
    print(", ".join(f"{count} {kind}" for kind, count in fates.most_common()))
    print("read, but nothing looks at them:", dict(unseen.most_common()) or "none")
    print(f"{len(lost)} files with other counts:", *lost, sep="\n  ")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
