"""Histories in files, tables and pickles; what objects say of themselves."""

from __future__ import annotations

import csv
import pickle

import numpy as np
import pytest

import antiosc as ao

MODEL = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3, 0.1], omega=[2e3, 9e3])
BALL = ao.RigidMass(0.05, 1.0)


@pytest.fixture(scope="module")
def hit():
    return ao.simulate(MODEL, BALL, ao.HuntCrossley(1e9, 0.8), 1e-3)


@pytest.fixture(scope="module")
def landed():
    scene = ao.Scene({"a": MODEL, 'b,"c"': BALL}, [ao.Contact("a", 'b,"c"', ao.Hertz(1e9))])
    return scene.run(1e-3)


def test_a_pickled_law_refers_to_no_memory_of_its_process():
    law = ao.Hertz(1e9)
    assert law.force(1e-6, 0.0, ()) > 0
    assert not {"kernel", "_address"} & vars(pickle.loads(pickle.dumps(law))).keys()


def test_a_pickled_history_is_the_same(hit):
    again = pickle.loads(pickle.dumps(hit))
    times = np.linspace(0, 1e-3, 50)
    for name in ("force", "indentation", "displacement", "velocity", "impactor_velocity"):
        np.testing.assert_array_equal(getattr(again, name), getattr(hit, name))
    np.testing.assert_array_equal(again.coordinates(times), hit.coordinates(times))
    np.testing.assert_array_equal(again.energy.dissipated, hit.energy.dissipated)
    assert again.restitution == hit.restitution
    assert again.summary() == hit.summary()
    assert pickle.loads(pickle.dumps(again)).peak_force == hit.peak_force


@pytest.mark.parametrize("which", ["hit", "landed"])
def test_a_saved_history_comes_back(which, request, tmp_path):
    history = request.getfixturevalue(which)
    saved = type(history).load(history.save(tmp_path / "run.npz"))
    for name, values in history.columns().items():
        np.testing.assert_array_equal(saved.columns()[name], values)
    assert saved.numbers() == history.numbers()
    assert saved.kind == type(history).__name__
    np.testing.assert_array_equal(saved.time, history.time)
    again = saved.load(saved.save(tmp_path / "again.npz"))
    assert again.results == saved.results
    with pytest.raises(AttributeError, match="has no 'nothing'"):
        _ = saved.nothing


@pytest.mark.parametrize("name", ["=cmd|'/C calc'!A0", "+1", "-a", "@SUM(1)", "＝1"])
def test_no_name_is_a_formula_of_a_spreadsheet(name, tmp_path):
    bodies = {name: ao.RigidMass(0.1, 1.0), "b": ao.Obstacle()}
    run = ao.Scene(bodies, [ao.Contact(name, "b", ao.Linear(1e6))]).run(1e-5)
    with run.to_csv(tmp_path / "run.csv").open(encoding="utf-8", newline="") as stream:
        head = next(csv.reader(stream))
    assert head[1] == f"'{name} - b force (N)"
    assert not any(cell.strip()[:1] in ("=", "+", "-", "@", "＝") for cell in head)
    assert head[0] == "time (s)"


def test_files_that_are_no_history_are_refused(hit, tmp_path):
    MODEL.save(tmp_path / "model.npz")
    (tmp_path / "text.npz").write_text("nothing", encoding="utf-8")
    np.savez(tmp_path / "other.npz", table=np.ones(3))
    for name in ("model.npz", "text.npz", "other.npz", "absent.npz"):
        with pytest.raises(ao.InputError):
            ao.History.load(tmp_path / name)
    hit.save(tmp_path / "run.npz")
    with pytest.raises(ao.InputError, match="antiosc-history"):
        ao.AntiOscillators.load(tmp_path / "run.npz")
    with pytest.raises(ao.InputError, match="cannot write"):
        hit.to_csv(tmp_path / "no folder" / "run.csv")


HIT = ao.simulate(
    ao.AntiOscillators(m0=2e-3, k0=5e5, m=[0.05], omega=[2e3]),
    ao.RigidMass(0.2, 1.5),
    ao.Hertz(1e9),
    2e-3,
)


def test_a_summary_is_in_engineering_units_and_files_in_si(tmp_path):
    told = HIT.summary()
    assert f"{1e3 * HIT.contact_time:.3f} ms" in told
    assert "e-0" not in told.replace(f"{HIT.energy.drift:.1e}", "").split("force error")[0]
    HIT.to_json(tmp_path / "hit.json")
    assert repr(HIT.contact_time) in (tmp_path / "hit.json").read_text()
