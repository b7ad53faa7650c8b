"""Scenes that are drawn at random, of a measurement, and on two ranks."""

from __future__ import annotations

import json

import numpy as np
import pytest

import antiosc as ao
from antiosc_app.cli import main as command
from mpi import run_ranks
from scene_files import BEAM, BRACKET, HIT, MASS, antiosc, numbers, objects, table, written

SPEED = 'impactor.velocity = {kind = "normal", mean = 1.0, sigma = 0.1}\n'
LAW = 'contact.stiffness = {kind = "lognormal", mean = 5e8, variation = 0.2}\n'
DRAWN = f"[monte_carlo]\nn = 40\nseed = 3\n{SPEED}{LAW}"


@pytest.mark.slow
def test_a_scene_is_drawn_as_by_a_program(tmp_path, capsys):
    path = written(tmp_path, BEAM + DRAWN)
    assert antiosc("monte-carlo", path, "--out", tmp_path / "out") == 0
    told = capsys.readouterr().out
    assert "0.95" in told
    assert "0.99" not in told
    model = objects(path, "run").model

    def run(velocity, stiffness):
        return model, ao.RigidMass(0.05, velocity), ao.Hertz(stiffness), 2e-3

    inputs = {"velocity": ao.normal(1.0, 0.1), "stiffness": ao.lognormal(5e8, 0.2)}
    many = ao.monte_carlo(run, inputs, 40, seed=3)
    columns = table(tmp_path / "out/monte_carlo.csv")
    assert np.array_equal(columns["impactor.velocity"], many.inputs["velocity"])
    assert np.array_equal(columns["peak_force"], many.values["peak_force"])
    found = numbers(tmp_path / "out")["monte_carlo"]
    assert found["value"][:3] == [many.quantile("peak_force", q).value for q in (0.05, 0.5, 0.95)]


@pytest.mark.parametrize(
    ("drawn", "held"),
    [
        ("n = 5", "draws nothing"),
        ("impactor.velocity = 3.0", "table"),
        ('impactor.velocity = {kind = "gamma", mean = 1.0}', "normal"),
        ('impactor.velocity = {kind = "normal", mean = 1.0, sigma = -1.0}', "sigma"),
        ('impactor.speed = {kind = "normal", mean = 1.0, sigma = 0.1}', "velocity"),
        ('material.E = {kind = "normal", mean = 1.0, sigma = 0.1}', "impactor"),
        ('point = {where = "skin"}', "point"),
        (f"store = 'a.csv'\n{SPEED}", "store"),
    ],
)
def test_mistakes_have_their_lines(tmp_path, capsys, drawn, held):
    assert antiosc("check", written(tmp_path, f"{BEAM}[monte_carlo]\n{drawn}\n")) == 1
    told = capsys.readouterr().err
    assert held in told
    line = len(BEAM.splitlines()) + 1
    assert any(f":{line + k}:" in told for k in (0, 1))


SCENE = f"""\
[frf]
path = "hammer.csv"
quantity = "receptance"
[from_frf]
band = [5.0, 400.0]
damping = "viscous"
{HIT.replace("5e8", "1e6").replace("2e-3", "2e-2")}[output]
json = true
"""


@pytest.fixture
def measurement(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    f = np.linspace(2.0, 400.0, 200)
    w = 2 * np.pi * f
    H = 1 / (1e5 + 6j * w - 0.5 * w**2) + 1e-7
    rows = np.column_stack([f, H.real, H.imag])
    np.savetxt("hammer.csv", rows, delimiter=",", header="frequency (Hz),real,imag", comments="")


@pytest.mark.slow
def test_a_measurement_is_struck(tmp_path, capsys, measurement):
    (tmp_path / "scene.toml").write_text(SCENE)
    assert command(["run", "scene.toml", "--verbose"]) == 0
    assert "noise" in capsys.readouterr().out
    result = json.loads((tmp_path / "scene_out" / "result.json").read_text())
    assert {"noise", "total"} <= set(result["result"]["error_budget"]["peak_force"])


SPHERE = (
    '[impactor]\nkind = "Sphere"\nradius = 0.01\nE = 210e9\nnu = 0.3\nrho = 7850\nvelocity = 2.0\n'
)
LEVER = f"""\
{BRACKET}[extract]
n = 8
{HIT.replace("2e-3", "5e-4").replace(MASS, SPHERE)}[probes.corner]
point = [0.0, 0.030, 0.086]
quantity = "velocity"
[output]
fields = true
"""
SCRIPT = """
import sys
from antiosc_app.cli import main
print("ended with", main(sys.argv[1:]))
"""


@pytest.mark.mpi
@pytest.mark.fem
@pytest.mark.slow
def test_two_ranks_give_the_serial_answer_once(tmp_path, capsys):
    path = written(tmp_path, LEVER)
    assert antiosc("run", path, "--out", tmp_path / "one", "--report", tmp_path / "one.html") == 0
    serial = capsys.readouterr().out
    files = ("--out", str(tmp_path / "two"), "--report", str(tmp_path / "two.html"))
    first, second = run_ranks(2, SCRIPT, "run", str(path), "--verbose", *files, timeout=200)
    told = [line.split("  ")[0] for line in first.replace("/two", "/one").splitlines()]
    assert told == [*(line.split("  ")[0] for line in serial.splitlines()), "ended with 0"]
    assert second == "ended with 0\n"
    one, two = numbers(tmp_path / "one"), numbers(tmp_path / "two")
    assert two["result"]["peak_force"] == pytest.approx(one["result"]["peak_force"], rel=1e-8)
    assert two["model"]["k0"] == pytest.approx(one["model"]["k0"], rel=1e-8)
    error = one["probes"]["corner"]["error"]
    # None where a mesh has no bar there
    assert two["probes"]["corner"]["error"] == (error and pytest.approx(error, rel=1e-6))
    pages = [(tmp_path / name).read_text(encoding="utf-8") for name in ("one.html", "two.html")]
    drawn = [page.count("<img ") for page in pages]
    assert drawn[0] == drawn[1] > 3
    names = sorted(p.name for p in (tmp_path / "one").iterdir())
    assert sorted(p.name for p in (tmp_path / "two").iterdir()) == names
    assert {"history.csv", "probes.csv", "result.json", "series.pvd"} <= set(names)
