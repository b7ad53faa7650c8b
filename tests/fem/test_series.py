"""Series of frames: read again by meshio, and whole whenever the process is killed."""

from __future__ import annotations

import os
import signal
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from antiosc.base import files
from antiosc.fem.fields import series

CHANGES = {"open", "os.rename", "os.link", "os.remove", "os.rmdir", "os.mkdir", "os.chmod"}
POINTS = np.eye(3)
FRAMES = series.Frames(POINTS, [("triangle", np.array([[0, 1, 2]]))])


def write(target, count: int) -> None:
    fields = (np.full((3, 3), 1.0 * count) for _ in range(count))
    series.write_frames(target, FRAMES, np.arange(count), fields)


def killed_at(step: int, target, count: int) -> bool:
    """Write in a process that kills itself before its `step`-th change of the disk."""
    pid = os.fork()
    if pid == 0:
        left = iter(range(step))

        def watch(event: str, _arguments: tuple[object, ...]) -> None:
            if event in CHANGES and next(left, None) is None:
                os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(watch)
        try:
            write(target, count)
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL


def frames(target) -> list[bytes]:
    entries = ElementTree.parse(target).getroot().findall(".//DataSet")
    return [(target.parent / entry.get("file")).read_bytes() for entry in entries]


@pytest.mark.slow
def test_a_killed_process_leaves_the_old_series_or_the_new_one(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_sync", lambda path: None)  # the system lives on
    whole = []
    for count in (3, 2):
        write(tmp_path / f"{count}.pvd", count)
        whole.append(frames(tmp_path / f"{count}.pvd"))
    target, step, found = tmp_path / "run.pvd", 0, []
    while step == 0 or killed_at(step, target, 2):
        if step:
            found.append(whole.index(frames(target)))
        write(target, 3)
        step += 1
    assert found == sorted(found)
    assert set(found) == {0, 1}
    assert frames(target) == whole[1]
    write(target, 3)
    left = [name for name in os.listdir(tmp_path) if name.startswith("run")]
    assert sorted(left) == ["run.pvd", *(f"run_{k:04d}.vtu" for k in range(3))]


def test_a_file_system_without_links_gets_copies(tmp_path, monkeypatch):
    def refuse(*_names: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    for count in (2, 1):
        write(tmp_path / "run.pvd", count)
        assert len(frames(tmp_path / "run.pvd")) == count
    assert sorted(os.listdir(tmp_path)) == ["run.pvd", "run_0000.vtu"]


@pytest.mark.parametrize("exchange", [True, False])
def test_a_folder_takes_the_place_of_another(tmp_path, monkeypatch, exchange):
    if not exchange:
        monkeypatch.setattr(files, "_exchanged", lambda one, other: False)
    for content in ("old", "new"):
        (tmp_path / "staged").mkdir()
        (tmp_path / "staged" / "data").write_text(content)
        files.replace_folder(tmp_path / "staged", tmp_path / "run.bp")
        assert (tmp_path / "run.bp" / "data").read_text() == content
    assert os.listdir(tmp_path) == ["run.bp"]
