"""What is refused: the class of the error, its line in a file, and a word of its one sentence."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import antiosc as ao


@contextmanager
def refused(
    line: int | None, word: str, error: type[Exception] = ao.AntioscError
) -> Iterator[None]:
    """The block must raise `error` with one sentence that names the line and holds the word."""
    with pytest.raises(error) as caught:
        yield
    told = str(caught.value)
    assert word in told, told
    assert "\n" not in told, told
    assert line is None or re.search(rf"\bline {line}\b", told), told
