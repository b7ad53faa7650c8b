"""Which sets of SPC, MPC and NSM a Nastran deck uses: those that its first subcase selects."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from antiosc.errors import MeshError

if TYPE_CHECKING:
    from antiosc_decks.nastran.cards import Entry

#: What the case control selects -> the entries of these sets, and the one that adds them.
SETS = {
    "SPC": (("SPC", "SPC1"), "SPCADD"),
    "MPC": (("MPC",), "MPCADD"),
    "NSM": (("NSM", "NSM1", "NSML", "NSML1"), "NSMADD"),
}
_SUBCASE = re.compile(r"\s*(SUBCASE|SUBCOM|SYM|SYMCOM|REPCASE)\b", re.IGNORECASE)
_SELECTED = re.compile(r"\s*(SPC|MPC|NSM)\s*=\s*(\d+)\s*$", re.IGNORECASE)


@dataclass
class CaseControl:
    """What the lines before the bulk data select."""

    #: whether there are such lines
    given: bool = False
    subcase: int = 0
    #: (what, number of the subcase; 0: above all) -> set
    sets: dict[tuple[str, int], int] = field(default_factory=dict)

    def read(self, line: str) -> None:
        """One line."""
        self.given = True
        self.subcase += bool(_SUBCASE.match(line))
        if match := _SELECTED.match(line):
            self.sets[match[1].upper(), self.subcase] = int(match[2][:18])

    def of_first(self, what: str) -> int | None:
        """The set of the first subcase, by default that above all subcases."""
        return self.sets.get((what, 1), self.sets.get((what, 0)))


def used_sets(
    entries: Sequence[Entry], control: CaseControl, name: str, what: str
) -> tuple[set[int], list[str]]:
    """(numbers of the sets that are used, sentences on the choice) of the deck `name`.

    Without case control all of them are used.

    Raises
    ------
    MeshError
        The case control selects supports that there are not.
    """
    names, adding = SETS[what]
    present = {entry.whole(0) for entry in entries if entry.name in names}
    if not control.given:
        some = f"{name} has no case control: its {what} {_sets(present)} are all taken."
        return present, [some] if len(present) > 1 else []
    first = control.of_first(what)
    used = set() if first is None else {first}
    for entry in entries:
        if entry.name == adding and entry.whole(0) == first:
            parts = {entry.whole(k) for k in range(1, len(entry.fields)) if entry.text(k)}
            used = parts | used & present
    told = []
    lost, others = used - present, present - used
    if lost == used and what == "SPC" and used:
        raise MeshError(f"the case control of {name} selects SPC = {first}, which is not there.")
    if lost:
        told.append(f"{what} = {first} of {name} needs the {_sets(lost)}, not there.")
    if others:
        told.append(
            f"not used of {name}: {what} {_sets(others)}, which the first subcase does not select."
        )
    return used & present, told


def _sets(numbers: set[int]) -> str:
    shown = ", ".join(map(str, sorted(numbers)[:8])) + ", …" * (len(numbers) > 8)
    return f"set{'s' * (len(numbers) > 1)} {shown}"
