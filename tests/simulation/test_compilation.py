"""The compiled march: the interpreted one's numbers, and a folder for each state of its source."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation import compilation, march
from antiosc.simulation.assembly import assemble
from antiosc.simulation.compilation import compiled_march
from antiosc.simulation.engine import run
from antiosc.simulation.refinement import start
from scene_cases import LAWS, ball, plate, rod_between_walls, stops


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of the march, and nothing remembered of the folders."""
    copy = tmp_path / "march"
    shutil.copytree(compilation._SOURCE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(compilation, "_SOURCE", copy)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    compilation._folder.cache_clear()
    yield copy
    compilation._folder.cache_clear()


def folder() -> Path | None:
    compilation._folder.cache_clear()
    return compilation._folder()


def test_a_change_of_any_file_has_a_folder_of_its_own(source: Path) -> None:
    before = folder()
    assert before is not None
    assert before.parent == source / "__pycache__"
    assert folder() == before
    with (source / "responses.py").open("a") as file:
        file.write("# changed\n")
    assert folder() != before
    assert not before.exists()  # what no version of the source here can use


def test_the_folder_is_where_numba_is_told(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "cache" / "march-0"
    other.mkdir(parents=True)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(other.parent))
    found = folder()
    assert found is not None
    assert found.parent == other.parent
    assert other.exists()  # other versions share this place


def test_a_place_that_cannot_be_written_is_no_error(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (source / "__pycache__").write_text("a file")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "users"))
    assert folder() == next((tmp_path / "users" / "antiosc").iterdir())
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(source / "__pycache__" / "no"))
    assert folder() is None


def test_threads_go_on_while_another_loads(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is half loaded serves nobody, and nobody waits for it."""
    half = ModuleType("antiosc.simulation.half_march")
    monkeypatch.setattr(compilation, "_COMPILED", half.__name__)
    monkeypatch.setitem(sys.modules, half.__name__, half)
    assert compilation.fitting_march(10**9) is march
    half.WHOLE = True  # type: ignore[attr-defined]
    assert compilation.fitting_march(0) is half
    assert compilation.compiled_march() is half


def test_a_process_waits_for_another_that_compiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fcntl = pytest.importorskip("fcntl")
    waits: list[float] = []
    with (tmp_path / "lock").open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)

        def sleep(seconds: float) -> None:
            waits.append(seconds)
            if len(waits) == 3:
                fcntl.flock(other, fcntl.LOCK_UN)

        monkeypatch.setattr(compilation.time, "sleep", sleep)
        with compilation._alone(tmp_path):
            assert len(waits) == 3
            with pytest.raises(BlockingIOError):
                fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)  # it is free again
        monkeypatch.setattr(compilation, "_PATIENCE", 1)
        with compilation._alone(tmp_path):
            assert len(waits) == 13  # it goes on without it
    with compilation._alone(None), compilation._alone(tmp_path / "none"):
        pass


def test_an_interrupted_compilation_leaves_no_half_module(monkeypatch) -> None:
    pytest.importorskip("numba")
    monkeypatch.setattr(compilation, "_COMPILED", "march_that_is_interrupted")

    def interrupted(path: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(
        compilation.importlib.util, "spec_from_file_location", lambda *a, **k: Spec()
    )

    class Loader:
        create_module = staticmethod(lambda spec: None)
        exec_module = staticmethod(interrupted)

    def Spec() -> ModuleSpec:
        return ModuleSpec("march_that_is_interrupted", Loader())  # type: ignore[arg-type]

    with pytest.raises(KeyboardInterrupt):
        compiled_march()
    assert "march_that_is_interrupted" not in sys.modules


@pytest.mark.slow
def test_the_compiled_march_gives_the_numbers_of_the_interpreted_one() -> None:
    """Those of the loops without compilation: test_march_audit.py."""
    pytest.importorskip("numba")
    other = compiled_march()
    assert other is not None
    mass, body = ao.RigidMass(0.3, 2.0), ao.SiteModes([2e3, 9e3], [[3.0], [4.0]], ["tip"])
    scenes = [ao.Scene({"a": body, "b": mass}, [ao.Contact("a", "b", law)]) for law in LAWS]
    scenes += [plate(ao.Hertz(1e8), 1e-3)[0], rod_between_walls(1.5)[0], stops()[0]]
    scenes.append(ball(5.0, 0.2, ao.Hertz(1e9)))
    for scene in scenes:
        made = assemble(scene, 2e-3)
        start(made)
        a, b = (
            run(made.system, 2e-3, 1e-3, module=m, fine=made.lasting / 200) for m in (march, other)
        )
        assert a.answer == b.answer == march.DONE
        np.testing.assert_allclose(a.time, b.time, rtol=1e-7)
        np.testing.assert_allclose(a.force, b.force, atol=1e-6 * np.abs(a.force).max())


def test_the_march_is_compiled_once_that_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """After 20 000 interpreted steps where an earlier process compiled it, else after 400 000."""
    monkeypatch.setattr(compilation, "_COMPILED", "antiosc.simulation.no_march")
    whole = ModuleType("whole")
    for cached, enough in ((True, 20_000), (False, 400_000)):
        monkeypatch.setattr(compilation, "_interpreted", 0)
        monkeypatch.setattr(compilation, "_cached", lambda cached=cached: cached)
        monkeypatch.setattr(compilation, "compiled_march", lambda: whole)
        assert compilation.fitting_march(enough - 500) is march
        assert compilation.fitting_march(500) is march
        assert compilation.fitting_march(1) is whole
        monkeypatch.setattr(compilation, "compiled_march", lambda: None)
        assert compilation.fitting_march(1) is march  # numba does not work here
