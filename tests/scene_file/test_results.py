"""Results as tables, numbers and files, and the report: one page without network."""

from __future__ import annotations

import pytest

pytest.importorskip("matplotlib")
import base64
import contextlib
import hashlib
import html
import html.parser
import io
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.texts import engineering
from antiosc_app import (
    info,
    live as assets,
    report as output,
    results as shown,
)
from antiosc_app.scene_file.build import Call
from antiosc_app.scene_file.run import SceneResults
from antiosc_app.scene_file.scene import CompiledScene
from antiosc_app.scene_file.schema import Output
from scene_files import BEAM, PROBE, antiosc, numbers, written

RNG = np.random.default_rng(5)
MODEL = ao.AntiOscillators(m0=2e-3, k0=5e5, m=[0.05], omega=[2e3])
HIT = ao.simulate(MODEL, ao.RigidMass(0.2, 1.5), ao.Hertz(1e9), 2e-3)


class Map(SimpleNamespace):
    """A map of four points on one or two surfaces."""

    impactor = contact = peak_stress = exposure = None

    @property
    def models(self) -> Map:
        return self

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


def results(folder, output=None, asked=None, **variables) -> SceneResults:
    document = SimpleNamespace(path=folder / "scene.toml", data={"title": "a title"})
    probes = {name: Call(None, arguments) for name, arguments in (asked or {}).items()}
    wanted = None if output is None else Call(Output, output, result=Output(**output))
    return SceneResults(
        compiled=CompiledScene(document=document, probes=probes, output=wanted), **variables
    )


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
    probe = shown.ProbeResult(results(tmp_path, asked=asked, **given), "eye")
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


@pytest.mark.slow
def test_files_are_those_that_are_asked_for(tmp_path):
    n = HIT.time.size
    probes = {"tip": np.arange(3.0 * n).reshape(n, 3), "speed": np.array([3.0, -4.0])}
    asked = {"tip": {}, "speed": {"quantity": "von_mises", "times": [0.0, 0.5]}}
    given = {"history": HIT, "model": MODEL, "probes": probes, "map": TWO, "asked": asked}
    for name, (options, files) in FILES.items():
        (tmp_path / name).mkdir()
        found = results(tmp_path, options, **given)
        written = output.write_output(found, shown.presentations(found), tmp_path / name)
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


HOSTILE = (
    "</pre><script>document.title='taken'</script><img src=x onerror=alert(1)> $\\\\foo{ & \\u202e"
)


class Page(html.parser.HTMLParser):
    """The elements of a page, its text by element, and whatever it would fetch."""

    VOID = ("meta", "img", "br", "wbr", "input")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.images: list[str] = []
        self.fetched: list[str] = []
        self.handlers: list[str] = []
        self.text: dict[str, list[str]] = {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes) -> None:
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name.startswith("on"):
                self.handlers.append(name)
            if name in ("src", "href", "srcset", "data", "action"):
                (self.images if value.startswith("data:image/") else self.fetched).append(value)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data) -> None:
        for tag in self.open:
            self.text.setdefault(tag, []).append(data)


def report(tmp_path, text: str, command: str = "run") -> tuple[str, Page]:
    """The text and the elements of the report of a scene."""
    path = tmp_path / "report.html"
    assert antiosc(command, written(tmp_path, text), "--report", path, "--out", tmp_path) == 0
    source = path.read_text(encoding="utf-8")
    return source, Page(source)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder, text and elements of one report."""
    folder = tmp_path_factory.mktemp("report")
    return folder, *report(folder, BEAM + PROBE)


@pytest.mark.slow
def test_the_page_holds_scene_model_errors_tables_and_pictures(made):
    folder, _, page = made
    assert "".join(page.text["pre"]) == BEAM + PROBE
    headings = ["Results", "Errors", "Pictures", "Model", "Origin", "Scene"]
    assert page.text["h2"] == headings
    pictures = ["Contact force", "Displacements", "Energies", "Probes", "Deformed structure"]
    assert page.text["h3"] == [*pictures, "Dynamic stiffness"]
    cells = page.text["td"]
    result = numbers(folder)
    assert any(engineering(result["result"]["contact_time"], "s") in cell for cell in cells)
    assert any(f"{result['model']['omega'][0] / (2 * np.pi):.5g}" in cell for cell in cells)
    assert len(page.images) == len(page.text["h3"]) - 1  # matrices have no surface to draw
    captions = page.text["figcaption"]
    assert all(caption.endswith(f"antiosc {info.antiosc_version()}.") for caption in captions)
    assert sum("Not drawn" in caption for caption in captions) == 1
    units = ("(N)", "(J)", "(Hz)", "(N/m)")
    assert all(any(unit in caption for caption in captions) for unit in units)


@pytest.mark.slow
def test_the_page_is_one_file_that_fetches_nothing_and_runs_its_own_program(made):
    _, source, page = made
    assert page.fetched == page.handlers == []
    assert page.tags.count("script") == 2  # its data, and its program
    assert {"link", "iframe", "object", "embed", "base", "form"}.isdisjoint(page.tags)
    policy = html.unescape(source.split('http-equiv="Content-Security-Policy" content="')[1])
    digest = hashlib.sha256(assets.page_script().encode()).digest()
    own = f"'sha256-{base64.b64encode(digest).decode()}'"
    wanted = f"script-src {own} 'wasm-unsafe-eval'\""
    assert policy.startswith(
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; " + wanted
    )
    assert f"<script>{assets.page_script()}</script>" in source
    assert not re.search(r"url\(|@import", source)


@pytest.mark.slow
def test_hostile_names_are_text(tmp_path):
    text = BEAM.replace('"a mass on a beam"', f'"{HOSTILE}"')
    text += f'[probes."{HOSTILE}"]\npoint = [0.2, 0, 0]\n'
    _, page = report(tmp_path, text)
    assert page.fetched == page.handlers == []
    assert page.tags.count("script") == 2
    assert "".join(page.text["h1"]).startswith("</pre><script>")
    assert "".join(page.text["pre"]) == text
    assert len(page.images) == 5
    assert (tmp_path / "probes.csv").read_text().startswith("time (s),")


@pytest.mark.parametrize(
    ("name", "held"), [("report.txt", "named .html"), ("none/report.html", "no folder")]
)
def test_a_wrong_name_is_told_before_the_run(tmp_path, capsys, name, held):
    scene = written(tmp_path, BEAM)
    assert antiosc("run", scene, "--report", tmp_path / name) == 1
    told = capsys.readouterr()
    assert held in told.err
    assert told.out == ""
    assert [p.name for p in tmp_path.iterdir()] == ["scene.toml"]


#: A beam of two spans, held at its ends, that a mass with a round tip strikes in the middle.
LINE = """\
Point(1) = {0, 0, 0, 0.02}; Point(2) = {0.75, 0, 0, 0.02}; Point(3) = {1.5, 0, 0, 0.02};
Line(1) = {1, 2}; Line(2) = {2, 3};
Physical Point("left") = {1}; Physical Point("right") = {3}; Physical Line("beam") = {1, 2};
"""
STRUCK_BEAM = """\
[geometry]
source = "line.geo"
unit = "m"
size = 0.05
[material]
name = "steel S235"
section = {kind = "Section.rectangle", width = 0.04, height = 0.04}
[[supports]]
where = "left"
fix = ["x", "y", "z", "rx"]
[[supports]]
where = "right"
fix = ["y", "z"]
[sites.tip]
point = [0.75, 0.0, 0.0]
direction = [0.0, 0.0, -1.0]
[extract]
n = 16
error = "estimate"
[impactor]
kind = "RigidMass"
mass = 5.0
tip_radius = 0.05
material = "steel S235"
velocity = 2.0
[contact]
kind = "auto"
[simulate]
duration = 0.02
[output]
json = true
"""


@pytest.fixture(scope="module")
def struck_beam(tmp_path_factory):
    """(text of a run, its numbers, its report as text)."""
    folder = tmp_path_factory.mktemp("beam")
    (folder / "line.geo").write_text(LINE)
    probe = "[probes.p]\npoint = [0.3, 0.012, 0.005]\nsnap = 0.02\n"
    path = written(folder, STRUCK_BEAM + probe)
    told = io.StringIO()
    with contextlib.redirect_stdout(told):
        assert antiosc("run", path, "--out", folder / "out", "--report", folder / "r.html") == 0
    return told.getvalue(), numbers(folder / "out"), (folder / "r.html").read_text()


@pytest.mark.slow
def test_a_sweep_has_the_verdict_of_the_scenes_own_impact(struck_beam, tmp_path):
    """A clip had a table of forces up to ten times those at which it yields, without a word."""
    (tmp_path / "line.geo").write_text(LINE)
    sweep = "[sweep]\nimpactor.velocity = [1.0, 4.0]\n"
    path = written(tmp_path, STRUCK_BEAM + sweep)
    told = io.StringIO()
    with contextlib.redirect_stdout(told):
        assert antiosc("sweep", path, "--out", tmp_path, "--report", tmp_path / "r.html") == 0
    page = html.unescape((tmp_path / "r.html").read_text())
    for text in (told.getvalue(), page):
        assert shown.OWN_IMPACT_SENTENCE in text
        assert "yield" in text
    stress = numbers(tmp_path)["nominal"]["stress"]
    assert stress == struck_beam[1]["stress"]


@pytest.mark.slow
def test_a_study_has_the_errors_and_verdicts_of_the_run_without_random_values(
    struck_beam, tmp_path
):
    """They are those of `antiosc run`; the table has the quantiles of the key."""
    (tmp_path / "line.geo").write_text(LINE)
    drawn = 'impactor.velocity = {kind = "normal", mean = 2.0, variation = 0.1}\n'
    study = f"{STRUCK_BEAM}[monte_carlo]\nn = 12\nquantiles = [0.95, 0.5, 0.99]\n{drawn}"
    path = written(tmp_path, study)
    told = io.StringIO()
    with contextlib.redirect_stdout(told):
        assert antiosc("monte-carlo", path, "--out", tmp_path / "out") == 0
    of_study = " ".join(
        told.getvalue().partition(shown.OWN_IMPACT_SENTENCE)[2].split("wrote ")[0].split()
    )
    of_run = [" ".join(line.split()) for line in struck_beam[0].splitlines() if line]
    for start in ("does it break", "largest force", "largest stress", "The contact yields"):
        (line,) = (one for one in of_run if one.startswith(start))
        assert line in of_study
    found = numbers(tmp_path / "out")
    assert found["monte_carlo"]["quantile"][:3] == [0.5, 0.95, 0.99]
    assert found["nominal"]["result"]["peak_force"] == struck_beam[1]["result"]["peak_force"]
