"""Results as tables, numbers, files and shown."""

from __future__ import annotations

import base64
import json
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

import antiosc as ao
from antiosc.app import report as output, results as shown
from antiosc.app.new import write_scene
from antiosc.app.scene_file.build import Call
from antiosc.app.scene_file.run import Results
from antiosc.app.scene_file.scene import Compiled
from antiosc.app.scene_file.schema import Output
from antiosc.base.errors import InputError

RNG = np.random.default_rng(5)
MODEL = ao.AntiOscillators(m0=2e-3, k0=5e5, m=[0.05], omega=[2e3])
HIT = ao.simulate(MODEL, ao.RigidMass(0.2, 1.5), ao.Hertz(1e9), 2e-3)


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


def results(folder, output=None, asked=None, **variables) -> Results:
    document = SimpleNamespace(path=folder / "scene.toml", data={"title": "a title"})
    probes = {name: Call(None, arguments) for name, arguments in (asked or {}).items()}
    wanted = None if output is None else Call(Output, output, made=Output(**output))
    return Results(compiled=Compiled(document=document, probes=probes, output=wanted), **variables)


@pytest.mark.parametrize(
    ("quantity", "shape", "names"),
    [
        ("von_mises", (), [" (Pa)"]),
        ("velocity", (2,), [" x (m/s)", " y (m/s)"]),
        ("acceleration", (3,), [" x (m/s²)", " y (m/s²)", " z (m/s²)"]),
        ("rotation", (1,), [" z (rad)"]),
        ("section_forces", (3,), [" N (N)", " V (N)", " M (N m)"]),
        ("strain", (3, 3), [" xx", " xy", " xz", " yy", " yz", " zz"]),
        ("stress", (2, 2), [" xx (Pa)", " xy (Pa)", " yy (Pa)"]),
    ],
)
def test_every_component_of_a_probe_is_a_column_and_the_largest_is_told(
    tmp_path, quantity, shape, names
):
    values = RNG.normal(size=(7, *shape))
    tensor = len(shape) == 2
    if tensor:
        values = values + values.swapaxes(1, 2)
    asked = {"eye": {"quantity": quantity, "times": np.arange(7.0)}}
    given = {"history": HIT, "probes": {"eye": values}}
    probe = shown.Probe(results(tmp_path, asked=asked, **given), "eye")
    found = probe.table()
    assert list(found) == [f"eye{name}" for name in names]
    components = values[:, *np.triu_indices(shape[0])] if tensor else values.reshape(7, -1)
    np.testing.assert_array_equal(np.column_stack(list(found.values())), components)
    peak = probe.peak()
    size = np.linalg.norm(values, axis=1) if quantity in ("velocity", "acceleration") else values
    assert abs(peak["value"]) == np.abs(size).max()
    assert f" {peak['component']}" in (" magnitude", " ", *(n.partition(" (")[0] for n in names))
    g = peak["value"] / 9.80665 if quantity == "acceleration" else 0
    assert peak.get("g", 0) == pytest.approx(g)
    assert np.abs(probe.signal()[2]).max() == np.abs(components).max()


FILES = {
    "plain": (None, {"history.csv", "probes.csv", "probes_2.csv", "map.csv", "result.json"}),
    "no tables": ({"csv": False}, {"result.json"}),
    "model": ({"csv": False, "json": False, "model": True}, {"model.npz"}),
    "pictures": (
        {"csv": False, "json": False, "plot": "svg"}, {"force.svg", "model.svg", "map.svg"}),
    "fields": ({"csv": False, "json": False, "fields": True}, {"map.vtu"}),
}  # fmt: skip


def test_files_are_those_that_are_asked_for(tmp_path):
    n = HIT.time.size
    probes = {"tip": np.arange(3.0 * n).reshape(n, 3), "speed": np.array([3.0, -4.0])}
    asked = {"tip": {}, "speed": {"quantity": "von_mises", "times": [0.0, 0.5]}}
    given = {"history": HIT, "model": MODEL, "probes": probes, "map": TWO, "asked": asked}
    for name, (options, files) in FILES.items():
        (tmp_path / name).mkdir()
        written = output.write_output(results(tmp_path, options, **given), tmp_path / name)
        assert {path.name for path in written} == files
    rows = (tmp_path / "plain/map.csv").read_text().splitlines()
    assert rows[0] == "surface,x (m),y (m),z (m),k0 (N/m),peak_force (N),nothing"
    assert rows[3] == "u,0.0,1.25,0.0,1000000.0,30.0,"
    two = (tmp_path / "plain/probes_2.csv").read_text()
    assert two == "time (s),speed (Pa)\n0.0,3.0\n0.5,-4.0\n"
    content = json.loads((tmp_path / "plain/result.json").read_text())
    assert (content["units"], content["title"], content["warnings"]) == ("SI", "a title", [])
    assert content["result"]["peak_force"] == HIT.peak_force
    assert content["probes"]["speed"]["value"] == -4.0
    assert content["model"]["k0"] == 5e5
    assert content["map"]["k0"] == [2e6, None, 1e6, 3e6]
    table = np.genfromtxt(tmp_path / "plain/history.csv", delimiter=",", skip_header=1)
    assert np.array_equal(table[:, -1], HIT.energy.dissipated)


def test_a_picture_that_cannot_be_drawn_is_told(tmp_path):
    def broken(path):
        raise InputError("no colours.")

    asked = {"csv": False, "json": False, "plot": "png"}
    found = results(tmp_path, asked, map=Map(**{**vars(TWO), "plot": broken}))
    assert output.write_output(found, tmp_path) == []
    assert found.warnings == ["map.png is not drawn: no colours."]
    write = shown.Picture("a", "b", lambda path: path.write_bytes(b"png"))
    fails, behind = (shown.Picture("c", "d", broken, same_view=k) for k in (False, True))
    one, two = shown.drawn([write, fails, behind])
    assert one == ("a", "b", f"data:image/png;base64,{base64.b64encode(b'png').decode()}")
    assert two == ("c", "Not drawn: no colours.", "")


def test_names_in_pictures_are_no_formulas():
    assert shown.escaped("$a$\n") == r"\$a\$?"
    assert shown.escaped("x" * 61) == "x" * 57 + "…"


def test_names_with_control_characters_are_refused(tmp_path):
    with pytest.raises(InputError, match="control"):
        write_scene(tmp_path / "a.toml", tmp_path / "b\x07.msh")
    assert not list(tmp_path.iterdir())
