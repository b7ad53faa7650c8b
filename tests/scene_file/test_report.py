"""The report: one page without network, which holds what was computed; seen by a browser."""

from __future__ import annotations

import base64
import hashlib
import html
import html.parser
import re

import numpy as np
import pytest

from antiosc.app import info, live as assets
from antiosc.base.texts import engineering
from browser import BROWSER, browse
from scene_files import BEAM, PROBE, antiosc, numbers, written

pytest.importorskip("matplotlib")

HOSTILE = (
    "</pre><script>document.title='taken'</script><img src=x onerror=alert(1)> $\\\\foo{ & \\u202e"
)


class Page(html.parser.HTMLParser):
    """The elements of a page, its text by element, and whatever it would fetch."""

    VOID = ("meta", "img", "br", "input")

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
    assert page.text["h3"] == [*pictures, "Anti-oscillators", "Dynamic stiffness"]
    cells = page.text["td"]
    result = numbers(folder)
    assert engineering(result["result"]["peak_force"], "N", 4) in cells
    assert f"{result['model']['omega'][0] / (2e3 * np.pi):.5g}" in cells  # in kHz
    assert len(page.images) == len(page.text["h3"]) - 1  # matrices have no surface to draw
    captions = page.text["figcaption"]
    assert all(caption.endswith(f"antiosc {info.version()}.") for caption in captions)
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
    digest = hashlib.sha256(assets.script().encode()).digest()
    own = f"'sha256-{base64.b64encode(digest).decode()}'"
    wanted = f"script-src {own} 'wasm-unsafe-eval'\""
    assert policy.startswith(
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; " + wanted
    )
    assert f"<script>{assets.script()}</script>" in source
    assert not re.search(r"url\(|@import", source)


@pytest.mark.slow
def test_hostile_names_are_text(tmp_path):
    text = BEAM.replace('"a mass on a beam"', f'"{HOSTILE}"')
    text += f'[probes."{HOSTILE}"]\npoint = [0.2, 0, 0]\n'
    _, page = report(tmp_path, text)
    assert page.fetched == page.handlers == []
    assert page.tags.count("script") == 2
    assert page.text["h1"][0].startswith("</pre><script>")
    assert "".join(page.text["pre"]) == text
    assert len(page.images) == 6
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


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_a_browser_shows_the_page(tmp_path):
    import matplotlib.image

    text = BEAM.replace('"a mass on a beam"', f'"{HOSTILE}"')
    source, _ = report(tmp_path, text)
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    # the page as it is: its title has not been taken, and nothing of it was removed
    seen = browse("--disable-gpu", profile, "--dump-dom", f"file://{tmp_path}/report.html")
    assert "<title>taken" not in seen
    assert seen.count("<figure ") == 6
    # a copy that may run one script, which measures what is shown
    probe = """<script>addEventListener("load", () => { document.title = "measured " +
        [...document.images].map(i => i.naturalWidth > 300 && i.getBoundingClientRect().width > 300)
        + " " + (document.documentElement.scrollWidth <= innerWidth) })</script></body>"""
    policy = re.search(r"<meta http-equiv=[^>]*>", source)
    copy = source.replace(policy.group(), "").replace("</body>", probe)
    (tmp_path / "copy.html").write_text(copy, encoding="utf-8")
    seen = browse("--disable-gpu", profile, "--dump-dom", f"file://{tmp_path}/copy.html")
    assert "<title>measured true,true,true,true,true true</title>" in seen
    # and the picture of it: dark text on a white page, with the blue of the curves
    shot = tmp_path / "page.png"
    size = "--window-size=1000,3000"
    browse("--disable-gpu", profile, size, f"--screenshot={shot}", f"file://{tmp_path}/report.html")
    pixels = matplotlib.image.imread(shot)[..., :3]
    assert pixels.shape == (3000, 1000, 3)
    assert np.mean(pixels.min(axis=2) > 0.99) > 0.7
    assert np.mean(pixels.max(axis=2) < 0.3) > 2e-3
    curve = np.array([0x1F, 0x77, 0xB4]) / 255
    assert np.sum(np.abs(pixels - curve).max(axis=2) < 0.02) > 500
