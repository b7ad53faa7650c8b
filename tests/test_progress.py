"""The line that tells of long work, in a terminal and in a notebook, and the notebook's figures."""

from __future__ import annotations

import io
from types import SimpleNamespace

import pytest

from antiosc.base import progress


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch) -> Terminal:
    stream = Terminal()
    monkeypatch.setattr(progress, "sys", SimpleNamespace(stderr=stream, modules={}))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "60")
    return stream


def lines(stream: Terminal) -> list[str]:
    return stream.getvalue().split(progress.CLEAR_LINE)[1:]


def test_the_innermost_work_is_shown_behind_the_count_around_it_and_goes_away(terminal):
    with progress.doing("outer") as further:
        further("1 of 2")
        with progress.doing("inner"):
            pass
        further("2 of 2")
    both = "outer: 1 of 2 – inner"
    texts = ["outer", "outer: 1 of 2", both, "outer: 1 of 2", "outer: 2 of 2"]
    assert lines(terminal) == [*(f"antiosc: {text} …" for text in texts), ""]


@pytest.mark.parametrize("case", ["pipe", "rank", "dumb", "none", "closed"])
def test_it_is_quiet_elsewhere(terminal, monkeypatch, case):
    if case == "pipe":
        monkeypatch.setattr(terminal, "isatty", lambda: False)
    elif case == "rank":
        monkeypatch.setenv(progress.RANK_VARIABLES[0], "1")
    elif case == "dumb":
        monkeypatch.setenv("TERM", "dumb")
    elif case == "none":
        monkeypatch.setattr(progress.sys, "stderr", None)
    elif case == "closed":
        monkeypatch.setattr(progress.sys, "stderr", closed := Terminal())
        closed.close()
    with progress.doing("work") as further:
        further("more")
    assert terminal.getvalue() == ""
