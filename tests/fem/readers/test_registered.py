"""Readers and formats that other packages register by entry points."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.io import request
from antiosc.io.reading import read
from antiosc.io.table import deck_endings, is_deck
from paths import ROOT

GROUPS = ("antiosc.readers", "antiosc.matrices")
PAGE = (ROOT / "docs" / "howto" / "reader.md").read_text(encoding="utf-8")
PROGRAM, POINT = re.findall(r"```(?:python|toml)\n(.*?)```", PAGE, re.DOTALL)
SHARED = "\nSHARED = FileReader(read, matches=lambda start: not start.startswith(b'*'))\n"


@pytest.fixture
def package(tmp_path, monkeypatch) -> Path:
    """The package of the page, which registers a reader of `.inp` and two broken ones too."""
    folder = tmp_path / "site"
    information = folder / "polylines-1.dist-info"
    information.mkdir(parents=True)
    (folder / "polylines.py").write_text(PROGRAM + SHARED)
    (information / "METADATA").write_text("Name: polylines\nVersion: 1\n")
    points = tomllib.loads(POINT)["project"]["entry-points"]["antiosc.readers"]
    points |= {"inp": "polylines:SHARED", "bad": "polylines:read", "lost": "nowhere:READER"}
    text = "\n".join(f"{name} = {value}" for name, value in points.items())
    (information / "entry_points.txt").write_text(f"[antiosc.readers]\n{text}\n")
    monkeypatch.setattr(sys, "path", [*sys.path, str(folder)])
    return tmp_path


def test_a_package_adds_a_reader(package):
    path = package / "wire.xyz"
    path.write_text("0 0 0\n1 0 0\n1 2 0\n")
    raw = read(path)
    assert raw.cells.tolist() == [[0, 1], [1, 2]]
    assert set(raw.groups) == {"wire"}
    path.with_suffix(".inp").write_text(path.read_text())  # known by its content beside decks
    np.testing.assert_array_equal(read(path.with_suffix(".inp")).points, raw.points)
    assert not is_deck(path.with_suffix(".inp"))
    path.with_suffix(".inp").write_text("*NODE\n1,0,0,0\n2,1,0,0\n*ELEMENT,TYPE=B31\n1,1,2\n")
    assert is_deck(path.with_suffix(".inp"))
    assert len(read(path.with_suffix(".inp")).cells) == 1


def test_a_reader_that_cannot_be_loaded_is_told_for_its_files_alone(package):
    for ending, word in (("bad", "FileReader"), ("lost", "nowhere")):
        path = package / f"a.{ending}"
        path.write_text("0 0 0\n1 0 0\n")
        with pytest.raises(ao.MissingDependencyError, match=word):
            read(path)
    path = package / "wire.xyz"
    path.write_text("0 0 0\n1 0 0\n")
    assert len(read(path).cells) == 1


def test_packages_in_the_working_folder_register_nothing(package, monkeypatch):
    monkeypatch.chdir(package / "site")
    monkeypatch.setattr(sys, "path", ["", *sys.path[:-1]])
    assert "xyz" not in {entry.name for entry in request.registered("antiosc.readers")}


def test_decks_are_found_in_sources_that_are_not_installed(tmp_path):
    script = "from antiosc.io.request import registered as f\n"
    script += "print(*(e.name for g in {} for e in f(g)))"
    done = subprocess.run(
        [sys.executable, "-S", "-c", script.format(GROUPS)],
        cwd=tmp_path, capture_output=True, text=True, check=True,
        env={"PYTHONPATH": f"{ROOT / 'src'}:{Path(np.__file__).parents[1]}"},
    )  # fmt: skip
    here = [entry.name for group in GROUPS for entry in request.registered(group)]
    assert sorted(set(done.stdout.split())) == sorted(here)
    assert {"inp", "bdf", "op4", "dmig", "harwell-boeing"} <= set(here)
    assert deck_endings() == [".bdf", ".fem", ".inp", ".nas"]


def test_decks_know_the_neutral_model_alone_and_the_core_no_decks():
    """What a reader of another package may import, too."""
    ground = {"base", "io", "io.matrices"}
    for path in (ROOT / "src").rglob("*.py"):
        used = set(re.findall(r"^ *(?:from|import) (antiosc\w*)([.\w]*)", path.read_text(), re.M))
        if "antiosc_decks" in path.parts:
            own = {module.lstrip(".") for name, module in used if name == "antiosc"}
            assert not {m for m in own if m not in ground and m.rpartition(".")[0] not in ground}
        else:
            assert "antiosc_decks" not in {name for name, _ in used}
