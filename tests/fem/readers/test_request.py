"""Limits of the process that reads: what the kernel is asked for, written down instead."""

from __future__ import annotations

import resource
import signal
import time

import pytest

from antiosc.io import isolation
from antiosc.io.request import Request


@pytest.fixture
def asked(monkeypatch) -> list[tuple]:
    found: list[tuple] = []
    monkeypatch.setattr(resource, "setrlimit", lambda *one: found.append(("limit", *one)))
    monkeypatch.setattr(signal, "signal", lambda *one: found.append(("signal", *one)))
    monkeypatch.setattr(signal, "setitimer", lambda *one: found.append(("timer", *one)))
    return found


def test_time_is_that_of_the_file_or_of_the_caller(asked):
    Request("/a/b", "b").allow(12.5)
    assert ("signal", signal.SIGPROF, signal.SIG_DFL) in asked
    assert ("timer", signal.ITIMER_PROF, 12.5) in asked  # a busy machine takes longer
    ((_, _, waiting),) = [one for one in asked if one[:2] == ("timer", signal.ITIMER_REAL)]
    assert waiting > 100.0
    begun = time.monotonic()
    Request("/a/b", "b", timeout=100.0, started=begun - 40.0).allow(12.5)
    assert asked[-1][2] == pytest.approx(60.0, abs=5.0)
    Request("/a/b", "b", timeout=100.0, started=begun - 400.0).allow(12.5)
    assert asked[-1][2] == 1e-3


def test_files_are_limited_but_for_those_of_trust(asked):
    Request("/a/b", "b", trust=True).seal()
    assert asked == []
    Request("/a/b", "b").seal()
    assert asked == [("signal", signal.SIGXFSZ, signal.SIG_IGN),
                     ("limit", resource.RLIMIT_FSIZE, (2**20, 2**20))]  # fmt: skip


def test_a_file_larger_than_the_memory_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "part.msh"
    path.write_bytes(b"x" * 1000)
    monkeypatch.setattr(isolation, "_machine_memory", lambda: 1112)
    assert isolation._size(path) == 1000
    monkeypatch.setattr(isolation, "_machine_memory", lambda: 1111)
    with pytest.raises(isolation.MeshError, match=r"part.msh has 9.31e-07 GiB, more than this mac"):
        isolation._size(path)
