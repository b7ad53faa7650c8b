"""A blow to be found, in a scene file: what a run writes, and mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.app import cli
from scene_files import BLOW

pytestmark = pytest.mark.fem

PLATE = """\
SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.4, 0.3};
Physical Surface("skin") = {1}; Physical Curve("rim") = {1, 2, 3, 4};
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plate.geo").write_text(PLATE)
    values = np.random.default_rng(0).standard_normal((64, 2))
    table = np.column_stack([np.arange(64) / 16e3, values])
    np.savetxt(tmp_path / "signals.csv", table, header="time, left, right", delimiter=",")
    return tmp_path


@pytest.mark.slow
def test_the_blow_is_that_of_find_impact(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "find.toml").write_text(BLOW)
    assert cli.main(["check", "find.toml"]) == 0
    shell = ao.Shell(210e9, 0.3, 7850.0, 4e-3)
    mesh = ao.read_mesh("plate.geo", size=0.15, gdim=3)
    sensors = [
        ao.Sensor((0.07, 0.06, 0.0), (0, 0, 1)),
        ao.Sensor((0.33, 0.08, 0.0), (0, 0, 1), "velocity"),
    ]
    part = ao.Structure(mesh, shell, [ao.Support("rim")])
    with pytest.warns(ao.AccuracyWarning):  # noise has no blow
        found = ao.find_impact(
            part, sensors,
            np.loadtxt("signals.csv", delimiter=",")[:, 1:], 16e3,
            [(0.1, 0.1, 0.0), (0.3, 0.2, 0.0)], ["place"], direction=(0, 0, -1), modes=5,
            impactor=ao.RigidMass(0.3, 2.0), contact=ao.Hertz(4e7),
        )  # fmt: skip
    assert cli.main(["run", "find.toml", "--out", "out", "--report", "page.html"]) == 0
    assert f"{found.peak_force:.5g} N" in capsys.readouterr().out
    told = json.loads((folder / "out/result.json").read_text())["found"]
    assert told["place"] == pytest.approx(found.place.tolist())
    assert told["impulse"] == pytest.approx(found.impulse, rel=1e-9)
    force = np.loadtxt("out/force.csv", delimiter=",", skiprows=1)
    assert force[:, 1] == pytest.approx(found.force)
    assert "<img" in (folder / "page.html").read_text()


def test_groups_and_sensors_must_exist(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = BLOW.replace("[[0.1, 0.1, 0.0], [0.3, 0.2, 0.0]]", '["skin", "top"]')
    (folder / "wrong.toml").write_text(wrong.replace("0.33", "33"))
    assert cli.main(["check", "wrong.toml"]) == 1
    told = capsys.readouterr().err
    assert "wrong.toml:29:" in told
    assert "wrong.toml:17:" in told
