"""The line of the terminal that tells of long work."""

from __future__ import annotations

import io
from types import SimpleNamespace

import pytest

from antiosc import progress


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch) -> Terminal:
    stream = Terminal()
    monkeypatch.setattr(progress, "sys", SimpleNamespace(stderr=stream))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "60")
    return stream


def lines(stream: Terminal) -> list[str]:
    return stream.getvalue().split(progress.CLEAR)[1:]


def test_the_innermost_work_is_shown_and_goes_away(terminal):
    with progress.doing("outer") as further:
        further("1 of 2")
        with progress.doing("inner"):
            pass
        further("2 of 2")
    texts = ["outer", "outer: 1 of 2", "inner", "outer: 1 of 2", "outer: 2 of 2"]
    assert lines(terminal) == [*(f"antiosc: {text} …" for text in texts), ""]


def test_the_line_goes_away_after_an_error_and_never_wraps(terminal):
    with pytest.raises(ValueError, match="wrong"), progress.doing("long " * 40):
        raise ValueError("wrong")
    first, last = lines(terminal)
    assert len(first) < 60
    assert last == ""


@pytest.mark.parametrize("case", ["pipe", "rank", "dumb", "none", "closed"])
def test_it_is_quiet_elsewhere(terminal, monkeypatch, case):
    if case == "pipe":
        monkeypatch.setattr(terminal, "isatty", lambda: False)
    elif case == "dumb":
        monkeypatch.setenv("TERM", "dumb")
    elif case == "none":
        monkeypatch.setattr(progress.sys, "stderr", None)
    elif case == "closed":
        monkeypatch.setattr(progress.sys, "stderr", closed := Terminal())
        closed.close()
    with progress.doing("work", rank=1 if case == "rank" else 0) as further:
        further("more")
    assert terminal.getvalue() == ""


@pytest.mark.fem
def test_a_model_tells_what_it_waits_for(terminal):
    pytest.importorskip("dolfinx")
    import antiosc as ao
    import parts

    part = ao.Structure(parts.box(), ao.Solid(70e9, 0.33, 2700.0), ao.Support("left"))
    tip = part.mesh.dolfinx.geometry.x.max(axis=0)
    with pytest.warns(ao.AccuracyWarning):
        ao.extract(part, ao.Site(tip, (0, 0, 1)), n=3)
    told = lines(terminal)
    for start in ("assembly of", f"factorization of {part.dofs} dofs", "extracting anti-oscill"):
        assert any(line.startswith(f"antiosc: {start}") for line in told)
    assert told[-1] == ""
