"""BLAS threads: one, unless more pay; a number that the user has set stays."""

from __future__ import annotations

import pytest

from antiosc.base import process

threadpoolctl = pytest.importorskip("threadpoolctl")
if all(pool.get("threading_layer") == "disabled" for pool in process.blas_pools() or ()):
    pytest.skip("this BLAS has no threads", allow_module_level=True)


def now() -> set[int]:
    """Threads of the BLAS libraries at the moment."""
    return {
        p["num_threads"] for p in process.blas_pools() if p.get("threading_layer") != "disabled"
    }


@pytest.fixture
def two_threads(monkeypatch):
    """BLAS has two threads and the environment names no number; there are three cores."""
    for name in process.THREAD_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(process, "core_count", lambda: 3)
    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        yield


def test_a_container_s_quota_counts(monkeypatch):
    monkeypatch.setattr(process.os, "sched_getaffinity", lambda _: set(range(8)))
    for text, count in (("max 100000", 8), ("250000 100000", 2), ("50000 100000", 1), ("", 8)):
        monkeypatch.setattr(process, "_lines", lambda _, text=text: text.splitlines())
        assert process.core_count() == count


def test_one_thread_inside_and_as_before_afterwards(two_threads):
    with process.one_thread():
        assert now() == {1}
        with process.one_thread():
            assert now() == {1}
        assert now() == {1}
    assert now() == {2}

    @process.one_thread()
    def failing() -> None:
        assert now() == {1}
        raise KeyError("also after an error")

    with pytest.raises(KeyError):
        failing()
    assert now() == {2}
