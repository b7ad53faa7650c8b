"""Names that an error message lists: all of a few, of many those written most alike."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

#: Most names that are all listed.
FEW = 12
#: Of more, so many of the nearest.
NEAREST = 5


def known(asked: object, names: Iterable[str], what: str) -> str:
    """ "its groups are: 'a', 'b'", or of many "the nearest of its groups (90) are: 'a', 'b'".

    `what` : the noun, as "its groups".
    """
    listed = sorted(names)
    if len(listed) <= FEW:
        return f"{what} are: {', '.join(map(repr, listed)) or 'none'}"
    lowered = {name.lower(): name for name in listed}
    alike = difflib.get_close_matches(str(asked).lower(), lowered, NEAREST, cutoff=0.0)
    nearest = ", ".join(repr(lowered[name]) for name in alike)
    return f"the nearest of {what} ({len(listed)}) are: {nearest}"
