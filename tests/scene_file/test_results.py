"""Results as text, tables, numbers and pages: made-up results, and what must stand there."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from antiosc.errors import InputError
from antiosc.scene_file import output, report, result_tables, template
from antiosc.scene_file.outputs import Output
from antiosc.scene_file.problems import Problems, SceneFileError, label, listed, nearest, unknown
from antiosc.scene_file.program import Call
from antiosc.scene_file.run import Results
from antiosc.scene_file.scene import Compiled


class Model(SimpleNamespace):
    """A reduced model of one site."""


MODEL = Model(
    k0=2e6, m0=0.02, m_st=0.5, n=6, omega=2 * np.pi * np.arange(1.0, 7), m=np.arange(1.0, 7),
    k=np.arange(2.0, 8), sites=(), save=lambda path: path.write_bytes(b"saved"),
    plot=lambda path: path.write_bytes(b"drawn"),
)  # fmt: skip
SEVERAL = Model(k0=np.eye(2), n=3, omega=2 * np.pi * np.array([5.0, 6.0, 7.0]), sites=("a", "b"))


def test_rows_of_a_model():
    assert result_tables.model_rows(MODEL) == [
        ("static stiffness k0", "2e+06 N/m"),
        ("static mass m_st", "0.5 kg"),
        ("anti-oscillators", "6"),
        ("captured mass", "96.00% of m_st"),
        ("antiresonances", "1, 2, 3, 4, 5, … Hz"),
    ]
    free = Model(**{**vars(MODEL), "m_st": 0.0, "omega": MODEL.omega[:5]})
    assert [name for name, _ in result_tables.model_rows(free)] == [
        "static stiffness k0", "static mass m_st", "anti-oscillators", "antiresonances",
    ]  # fmt: skip
    assert result_tables.model_rows(free)[-1][1] == "1, 2, 3, 4, 5 Hz"
    assert result_tables.model_rows(SEVERAL) == [
        ("sites", "a, b"), ("anti-oscillators", "3"), ("antiresonances", "5, 6, 7 Hz"),
    ]  # fmt: skip
    none = Model(k0=np.eye(2), n=0, omega=np.zeros(0), sites=("a", "b"))
    assert result_tables.model_rows(none)[-1] == ("antiresonances", "none Hz")


def test_columns_of_names_and_of_tables():
    assert result_tables.lines([("a", "1"), ("long name", "")]) == "a          1\nlong name"
    assert result_tables.lines([]) == ""
    table = {"n": [1, 22], "value": [1.0, 123456.789], "w": ["a", "bcd"]}
    assert result_tables.columns(table) == (
        " n       value    w\n 1           1    a\n22  1.2346e+05  bcd"
    )
    for count, more in ((30, 0), (31, 1), (33, 3)):
        text = result_tables.columns({"n": list(range(count))}).splitlines()
        assert text[30] == "29"
        assert text[31:] == ([f"… and {more} more rows (see sweep.csv)"] if more else [])


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
          k0=np.array([2e6, np.nan, 1e6, 3e6]), peak_force=np.array([10.0, 20.0, 30.0, 5.0]),
          write=lambda path: path, plot=lambda path: path.write_bytes(b"drawn"))  # fmt: skip
ONE = Map(**{**vars(TWO), "names": np.array(["u"] * 4), "skipped": 0})


def test_rows_of_a_map():
    assert result_tables.map_rows(TWO) == [
        ("sites", "4, 3 left out"),
        ("k0 (N/m)", "1e+06 to 3e+06"),
        ("peak_force (N)", "5 to 30"),
        ("u", "2 sites, at most 30 N at (0, 1.25, 0) m"),
        ("v", "2 sites, at most 20 N at (1, 0, 0) m"),
    ]
    assert result_tables.map_rows(ONE)[0] == ("sites", "4")
    assert len(result_tables.map_rows(ONE)) == 3
    units = {"m_st": "kg", "omega_1": "rad/s", "contact_time": "s", "impulse": "N s",
             "peak_deflection": "m"}  # fmt: skip
    for name, unit in units.items():
        assert result_tables.named(name) == f"{name} ({unit})"
    assert result_tables.named("other") == "other"


PROBED = {"tip": {}, "speed": {"quantity": "velocity", "times": [0.0, 0.5]},
          "forces": {"quantity": "section_forces"}, "count": {"quantity": "unknown"}}  # fmt: skip


def results(tmp_path, **variables) -> Results:
    data = {"sweep": {"impactor": {"mass": [1, 2]}}}
    document = SimpleNamespace(path=tmp_path / "scene.toml", data=data)
    probes = {name: Call("ao.probe", asked) for name, asked in PROBED.items()}
    options = variables.pop("output", None)
    scene = Compiled(document, "a title", probes=probes,
                     output=None if options is None else Call("output", options))  # fmt: skip
    found = Results(scene, variables)
    return found


def history(**more) -> SimpleNamespace:
    time = np.linspace(0, 1e-3, 5)
    names = ("force", "indentation", "displacement", "velocity", "impactor_displacement",
             "impactor_velocity")  # fmt: skip
    energies = ("kinetic", "strain", "contact", "dissipated")
    energy = {name: time + 10 * k for k, name in enumerate(energies)}
    return SimpleNamespace(
        time=time, **{name: time * (k + 2) for k, name in enumerate(names)},
        energy=SimpleNamespace(**energy, drift=1e-7), status=0, message="it < ended",
        error={"force": 2e-4, "time": np.nan}, peak_force=123.456789, impulse=0.5,
        contact_time=2e-4, contacts=[(0.0, 1e-4), (2e-4, 3e-4)], restitution=0.87654, step=1e-6,
        summary=lambda: "the summary", **more,
    )  # fmt: skip


VALUES = {"tip": np.arange(15.0).reshape(5, 3) - 20, "speed": np.array([3.0, -4.0]),
          "forces": np.arange(20.0).reshape(5, 4), "count": np.arange(5.0)}  # fmt: skip


def test_probes_by_their_times(tmp_path):
    found = results(tmp_path, history=history(), probes=VALUES)
    assert result_tables.probe_rows(found) == [
        ("probe tip", "at most 20 m"), ("probe speed", "at most 4 m/s"),
        ("probe forces", "at most 19 SI"), ("probe count", "at most 4"),
    ]  # fmt: skip
    (times, first), (others, second) = output.probe_columns(found)
    assert times.tolist() == history().time.tolist()
    assert list(first) == ["tip x (m)", "tip y (m)", "tip z (m)",
                           *(f"forces {k} (SI)" for k in (1, 2, 3, 4)), "count"]  # fmt: skip
    assert first["tip y (m)"].tolist() == VALUES["tip"][:, 1].tolist()
    assert (others.tolist(), list(second)) == ([0.0, 0.5], ["speed (m/s)"])


def test_the_text_of_a_run(tmp_path):
    structure = SimpleNamespace(describe=lambda: "a beam")
    found = results(tmp_path, history=history(), structure=structure, model=MODEL, probes=VALUES)
    pieces = result_tables.text(found).split("\n\n")
    assert pieces[:2] == ["a title", "a beam"]
    assert pieces[2] == result_tables.lines(result_tables.model_rows(MODEL))
    assert pieces[3:] == ["the summary", result_tables.lines(result_tables.probe_rows(found))]
    assert result_tables.text(results(tmp_path)) == "a title"
    batch = SimpleNamespace(
        peak_force=np.array([1.0, 2.0]), impulse=np.array([3.0, 4.0]),
        contact_time=np.array([5.0, 6.0]), restitution=np.array([0.5, np.nan]),
        contacts=np.array([1, 2]), status=np.array([0, 1]),
    )  # fmt: skip
    swept = results(tmp_path, batch=batch)
    assert list(result_tables.sweep_columns(swept)) == [
        "impactor.mass", "peak force (N)", "impulse (N s)", "contact time (s)", "restitution",
        "contacts", "status",
    ]  # fmt: skip
    first = result_tables.text(swept).splitlines()[3].split()
    assert first == ["1", "1", "3", "5", "0.5", "1", "0"]
    assert result_tables.text(results(tmp_path, found=ONE)).splitlines()[2:] == [
        "sites           4", "k0 (N/m)        1e+06 to 3e+06", "peak_force (N)  5 to 30",
    ]  # fmt: skip


def test_files_are_those_that_are_asked_for(tmp_path):
    hit = history()
    hit.plot = lambda path: path.write_bytes(b"drawn")
    given = {"history": hit, "model": MODEL, "probes": VALUES, "found": TWO}
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
    assert content["result"] == {
        "status": 0, "message": "it < ended", "error": {"force": 2e-4, "time": None},
        "error_covers": "time integration",
        "energy_drift": 1e-7, "peak_force": 123.456789, "impulse": 0.5, "contact_time": 2e-4,
        "contacts": [[0.0, 1e-4], [2e-4, 3e-4]], "restitution": 0.87654, "step": 1e-6,
    }  # fmt: skip
    assert content["probes"] == {"tip": 20.0, "speed": 4.0, "forces": 19.0, "count": 4.0}
    assert content["model"]["k0"] == 2e6
    assert content["model"]["P"] is None
    assert content["map"]["surface"] == ["u", "v", "u", "v"]
    assert content["map"]["k0"] == [2e6, None, 1e6, 3e6]
    rows = (tmp_path / "0/history.csv").read_text().splitlines()
    assert rows[0] == (
        "time (s),force (N),indentation (m),displacement (m),velocity (m/s),impactor displacement "
        "(m),impactor velocity (m/s),kinetic energy (J),strain energy (J),contact energy (J),"
        "dissipated energy (J)"
    )
    assert [float(word) for word in rows[2].split(",")] == pytest.approx(
        [2.5e-4 * k for k in range(1, 8)] + [2.5e-4 + 10 * k for k in range(4)]
    )
    alone = tmp_path / "alone"
    alone.mkdir()
    output.write(results(tmp_path, found=ONE, output={"json": False}), alone)
    assert (alone / "map.csv").read_text().startswith("x (m),y (m),z (m),k0 (N/m)")


def test_a_picture_that_cannot_be_drawn_is_told(tmp_path):
    def broken(path):
        raise InputError("no colours.")

    given = {"model": Model(**{**vars(MODEL), "plot": broken}), "found": ONE}
    asked = results(tmp_path, **given, output={"csv": False, "json": False, "plot": "png"})
    assert [path.name for path in output.write(asked, tmp_path)] == ["map.png"]
    assert asked.warnings == ["model.png is not drawn: no colours."]


def test_what_is_written_where_nothing_else_is_asked_for():
    asked = {"csv": True, "json": True, "plot": None, "fields": False, "model": False}
    assert vars(Output()) == asked


def test_a_page_of_made_up_results(tmp_path):
    (tmp_path / "scene.toml").write_text("a < b")
    structure = SimpleNamespace(describe=lambda: "a beam")
    found = results(tmp_path, history=history(), structure=structure, model=MODEL, probes=VALUES)
    found.warnings.append("mind <this>")
    page = report.page(found, [])
    rows = {
        "peak force": "123.457 N", "impulse": "0.5 N s", "contact time": "0.0002 s",
        "contacts": "2", "coefficient of restitution": "0.8765", "probe speed": "at most 4 m/s",
        "time integration: force": "0.0002", "energy drift over the run": "1e-07 of the energy",
        "structure": "a beam", "static mass m_st": "0.5 kg",
    }  # fmt: skip
    for name, value in rows.items():
        assert f"<tr><th>{name}</th><td>{value}</td></tr>" in page, name
    assert '<p class="warning">mind &lt;this&gt;</p>' in page
    assert "<p>it &lt; ended</p>" in page
    assert "<pre>a &lt; b</pre>" in page
    assert "<h1>a title</h1>" in page
    cells = '<td class="number">{}</td>' * 4
    assert f"<tr>{cells.format(1, '1', '1', '2')}</tr>" in page
    assert f"<tr>{cells.format(6, '6', '6', '7')}</tr>" in page
    assert page.index("<h2>Results") < page.index("<h2>Errors") < page.index("<h2>Model")
    assert "script-src" not in page
    swept = report.page(results(tmp_path, found=TWO), [])
    assert "<h2>Map</h2>" in swept
    assert "<tr><th>sites</th><td>4, 3 left out</td></tr>" in swept
    assert "<h2>Model</h2>" not in swept
    assert "<h2>Results</h2>" not in swept
    no_bounce = history()
    no_bounce.restitution = None
    assert "<td>not defined</td>" in report.page(results(tmp_path, history=no_bounce), [])
    (tmp_path / "scene.toml").unlink()
    assert "<pre></pre>" in report.page(found, [])


def test_cells_of_a_page():
    for value, cell in {
        1.23456789: '<td class="number">1.2346</td>', np.nan: '<td class="number">–</td>',
        3: '<td class="number">3</td>', "12 %": '<td class="number">12 %</td>',
        "a<b": "<td>a&lt;b</td>", "-1.5e-3": '<td class="number">-1.5e-3</td>',
        "3 N": "<td>3 N</td>",
    }.items():  # fmt: skip
        assert report._cell(value) == cell
    assert report._table([]) == ""


# --- Mistakes -------------------------------------------------------------------------------------


def test_lists_of_names_have_twenty_at_most():
    assert listed([]) == "none"
    assert listed("ab") == "a, b"
    assert listed(map(str, range(20))) == ", ".join(map(str, range(20)))
    assert listed(map(str, range(21))) == ", ".join(map(str, range(20))) + ", …"
    assert label(()) == "the scene"
    assert label(("a", 2, "b")) == "a[2].b"
    assert nearest("HURTZ", ["Hertz", "Linear"]) == "Hertz"
    assert nearest("xyz", ["Hertz"]) is None
    assert unknown("the part", "b", []) == "the part 'b' does not exist. There is none."
    assert unknown("the part", "ba", ["bar", "x"]) == (
        "the part 'ba' does not exist; did you mean 'bar'? There is bar, x."
    )


def test_mistakes_are_told_by_their_lines():
    found = Problems("s", {("a",): 7, ("b",): 3})
    found.raise_if_any()
    found.add(("a", "x"), "first")
    found.add(("b",), "  second\n one")
    found.add((), "third")
    found.add(("a",), "first")
    with pytest.raises(SceneFileError) as caught:
        found.raise_if_any()
    assert str(caught.value) == "s:1: third\ns:3: second one\ns:7: first"
    assert str(found.error(("b",), "while it ran")) == "s:3: while it ran"
    many = Problems("s", {})
    for k in range(102):
        many.add((), f"{k:03}")
    with pytest.raises(SceneFileError) as caught:
        many.raise_if_any()
    told = str(caught.value).splitlines()
    assert len(told) == 101
    assert told[-2:] == ["s:1: 099", "s: and 2 more."]


@pytest.mark.parametrize(
    ("part", "held", "size"),
    [
        (None, 'source = "part.step"', "size = 5e-3"),
        ("a.STEP", 'source = "a.STEP"', "size = 5e-3"),
        ("a.geo", 'source = "a.geo"', "size = 5e-3"),
        ("a.msh", 'source = "a.msh"', "# size = 5e-3"),
        ('a"b.msh', 'source = "a\\"b.msh"', "# size = 5e-3"),
        ("a.BDF", '[deck]\npath = "a.BDF"', None),
        ("a.inp", '[deck]\npath = "a.inp"', None),
    ],
)
def test_a_new_scene_of_a_part(part, held, size):
    text = template.text("name.toml", part)
    assert held in text
    assert "antiosc check name.toml " in text
    assert ("\nsize = 5e-3" in text) == (size == "size = 5e-3")
    assert ("[geometry]\n" in text) == (size is not None)


def test_names_with_control_characters_are_refused(tmp_path):
    with pytest.raises(InputError, match="has control characters"):
        template.write(tmp_path / "a.toml", tmp_path / "b\x07.msh")
    assert not list(tmp_path.iterdir())
