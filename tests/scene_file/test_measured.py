"""A scene of a measurement: checked without a fit, run as any other."""

from __future__ import annotations

import json

import numpy as np
import pytest

from antiosc.app.cli import main as command

SCENE = """
[frf]
path = "hammer.csv"
quantity = "receptance"
[from_frf]
band = [5.0, 400.0]
damping = "viscous"
[impactor]
kind = "RigidMass"
mass = 0.1
velocity = 1.0
[contact]
kind = "Hertz"
stiffness = 1e6
[simulate]
duration = 2e-2
[output]
json = true
"""


@pytest.fixture(autouse=True)
def _measurement(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    f = np.linspace(2.0, 400.0, 200)
    w = 2 * np.pi * f
    H = 1 / (1e5 + 6j * w - 0.5 * w**2) + 1e-7
    np.savetxt("hammer.csv", np.column_stack([f, H.real, H.imag]))


@pytest.mark.slow
def test_a_measurement_is_struck(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(SCENE)
    assert command(["run", "scene.toml"]) == 0
    assert "noise" in capsys.readouterr().out
    result = json.loads((tmp_path / "scene_out" / "result.json").read_text())
    assert {"noise", "band", "total"} <= set(result["result"]["error_budget"]["peak_force"])
