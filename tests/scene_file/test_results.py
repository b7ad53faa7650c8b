"""Results as text, tables, numbers and pages: made-up results, and what must stand there."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from antiosc.app.scene_file import output, template
from antiosc.app.scene_file.build import Call
from antiosc.app.scene_file.outputs import Output
from antiosc.app.scene_file.problems import Problems, SceneFileError
from antiosc.app.scene_file.run import Results
from antiosc.app.scene_file.scene import Compiled
from antiosc.base.errors import InputError


class Model(SimpleNamespace):
    """A reduced model of one site."""


MODEL = Model(
    k0=2e6, m0=0.02, m_st=0.5, n=6, omega=2 * np.pi * np.arange(1.0, 7), m=np.arange(1.0, 7),
    k=np.arange(2.0, 8), sites=(), save=lambda path: path.write_bytes(b"saved"),
    plot=lambda path: path.write_bytes(b"drawn"),
)  # fmt: skip


class Map(SimpleNamespace):
    """A map of four points on one or two surfaces."""

    def __len__(self) -> int:
        return len(self.points)

    def surfaces(self) -> dict[str, np.ndarray]:
        return {str(n): np.flatnonzero(self.names == n) for n in np.unique(self.names)}

    def quantities(self) -> dict[str, np.ndarray]:
        return {"k0": self.k0, "peak_force": self.peak_force, "nothing": np.full(4, np.nan)}


POINTS = np.array([(0, 0, 0), (1, 0, 0), (0, 1.25, 0), (1, 1, 2.0)])
TWO = Map(points=POINTS, names=np.array(["u", "v", "u", "v"]), skipped=3,
          doubtful=np.zeros(4, bool), k0=np.array([2e6, np.nan, 1e6, 3e6]),
          peak_force=np.array([10.0, 20.0, 30.0, 5.0]),
          write=lambda path: path, plot=lambda path: path.write_bytes(b"drawn"))  # fmt: skip
ONE = Map(**{**vars(TWO), "names": np.array(["u"] * 4), "skipped": 0})


PROBED = {"tip": {}, "speed": {"quantity": "velocity", "times": [0.0, 0.5]},
          "forces": {"quantity": "section_forces"}, "count": {"quantity": "unknown"}}  # fmt: skip


def results(tmp_path, **variables) -> Results:
    data = {"title": "a title", "sweep": {"impactor": {"mass": [1, 2]}}}
    document = SimpleNamespace(path=tmp_path / "scene.toml", data=data)
    probes = {name: Call(None, asked) for name, asked in PROBED.items()}
    options = variables.pop("output", None)
    asked = None if options is None else Call(Output, options, made=Output(**options))
    return Results(Compiled(document, probes=probes, output=asked), **variables)


def history(**more) -> SimpleNamespace:
    time = np.linspace(0, 1e-3, 5)
    energies = ("kinetic", "strain", "contact", "dissipated")
    energy = {name: time + 10 * k for k, name in enumerate(energies)}
    return SimpleNamespace(
        time=time, columns=lambda: {"time [s]": time, "force [N]": 2 * time},
        numbers=lambda: {"step": np.nan, "contacts": [(0.0, 1e-4)]},
        energy=SimpleNamespace(**energy), summary=lambda: "the summary", **more,
    )  # fmt: skip


VALUES = {"tip": np.arange(15.0).reshape(5, 3) - 20, "speed": np.array([3.0, -4.0]),
          "forces": np.arange(30.0).reshape(5, 6), "count": np.arange(5.0)}  # fmt: skip


def test_files_are_those_that_are_asked_for(tmp_path):
    hit = history()
    hit.plot = lambda path: path.write_bytes(b"drawn")
    given = {"history": hit, "model": MODEL, "probes": VALUES, "map": TWO}
    for k, (options, names) in enumerate({
        "plain": (None, ["history.csv", "probes.csv", "probes_2.csv", "map.csv", "result.json"]),
        "no tables": ({"csv": False}, ["result.json"]),
        "model": ({"csv": False, "json": False, "model": True}, ["model.npz"]),
        "pictures": ({"csv": False, "json": False, "plot": "svg"},
                     ["force.svg", "model.svg", "map.svg"]),
        "fields": ({"csv": False, "json": False, "fields": True}, ["map.vtu"]),
    }.values()):  # fmt: skip
        target = tmp_path / str(k)
        target.mkdir()
        written = output.write(results(tmp_path, **given, output=options), target)
        assert [path.name for path in written] == names
    map_table = (tmp_path / "0/map.csv").read_text().splitlines()
    assert map_table[0] == "surface,x (m),y (m),z (m),k0 (N/m),peak_force (N),nothing"
    assert map_table[3] == "u,0.0,1.25,0.0,1000000.0,30.0,"
    assert (tmp_path / "0/probes_2.csv").read_text() == "time (s),speed (m/s)\n0.0,3.0\n0.5,-4.0\n"
    content = json.loads((tmp_path / "0/result.json").read_text())
    assert content["units"] == "SI"
    assert content["title"] == "a title"
    assert content["warnings"] == []
    assert content["result"] == {"step": None, "contacts": [[0.0, 1e-4]]}
    peaks = {name: peak["value"] for name, peak in content["probes"].items()}
    magnitude = pytest.approx((20**2 + 19**2 + 18**2) ** 0.5)
    assert peaks == {"tip": magnitude, "speed": -4.0, "forces": 29.0, "count": 4.0}
    assert content["model"]["k0"] == 2e6
    assert content["model"]["P"] is None
    assert content["map"]["surface"] == ["u", "v", "u", "v"]
    assert content["map"]["k0"] == [2e6, None, 1e6, 3e6]
    rows = (tmp_path / "0/history.csv").read_text().splitlines()
    names = rows[0].split(",")
    assert names[:3] == ["time (s)", "force (N)", "kinetic energy (J)"]
    assert list(map(float, rows[2].split(","))) == pytest.approx(
        [2.5e-4, 5e-4, *(2.5e-4 + 10 * k for k in range(4))]
    )
    alone = tmp_path / "alone"
    alone.mkdir()
    output.write(results(tmp_path, map=ONE, output={"json": False}), alone)
    assert (alone / "map.csv").read_text().startswith("x (m),y (m),z (m),k0 (N/m)")


def test_a_picture_that_cannot_be_drawn_is_told(tmp_path):
    def broken(path):
        raise InputError("no colours.")

    given = {"model": Model(**{**vars(MODEL), "plot": broken}), "map": ONE}
    asked = results(tmp_path, **given, output={"csv": False, "json": False, "plot": "png"})
    assert [path.name for path in output.write(asked, tmp_path)] == ["map.png"]
    assert asked.warnings == ["model.png is not drawn: no colours."]


# --- Mistakes -------------------------------------------------------------------------------------


def test_mistakes_are_told_by_their_lines():
    found = Problems("s", "\n\nb = 1\n\n\n\n[a]")
    found.raise_if_any()
    found.add(("a", "x"), "first")
    found.add(("b",), "  second\n one")
    found.add((), "third")
    found.add(("a",), "first")
    with pytest.raises(SceneFileError) as caught:
        found.raise_if_any()
    assert str(caught.value) == "s:1: third\ns:3: second one\ns:7: first"
    assert str(found.error(("b",), "while it ran")) == "s:3: while it ran"
    many = Problems("s", "")
    for k in range(102):
        many.add((), f"{k:03}")
    with pytest.raises(SceneFileError) as caught:
        many.raise_if_any()
    told = str(caught.value).splitlines()
    assert len(told) == 101
    assert told[-1].endswith("2 more.")


def test_names_with_control_characters_are_refused(tmp_path):
    with pytest.raises(InputError, match="has control characters"):
        template.write(tmp_path / "a.toml", tmp_path / "b\x07.msh")
    assert not list(tmp_path.iterdir())
