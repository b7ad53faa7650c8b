"""The surface that is turned by hand: a page of its own, and its place in a report."""

from __future__ import annotations

import base64
import hashlib
import html
import importlib.util
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import antiosc as ao
from antiosc.charts import turning
from browser import BROWSER, browse

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [5, 5, 5]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
#: The browser's clock waits for the last timer, until the surface is drawn.
WAIT = "<script>setTimeout(() => {}, 9000)</script></body>"
installed = pytest.mark.skipif(not turning.available(), reason="PyVista or trame is missing")


def page() -> str:
    arrow = np.array([[0, 0, 2.0], [0, 0, 1.0]])
    return turning.turning_page(CORNERS, FACES, np.arange(5.0), "size (mm)", arrow)


def test_what_is_missing_is_told(monkeypatch):
    monkeypatch.setattr(turning, "available", lambda: False)
    with pytest.raises(ao.MissingDependencyError, match=r"pip install 'pyvista\[jupyter\]'"):
        page()


@pytest.mark.parametrize(
    ("program", "told"),
    [
        ("import os; os.abort()", "ended with code -6: without a word"),
        ("raise OSError('no screen')", "ended with code 1: OSError: no screen"),
        ("import time; time.sleep(20)", "more than 0.5 s"),
    ],
)
def test_a_drawing_process_that_dies_is_told(monkeypatch, program, told):
    monkeypatch.setattr(turning, "available", lambda: True)
    monkeypatch.setattr(turning, "LIMIT", 0.5 if "sleep" in program else 60.0)
    run = subprocess.run

    def dies(command, **options):
        assert command[:2] == [sys.executable, "-P"]  # the working folder has no packages
        assert options["cwd"] == os.path.dirname(command[-1])
        return run([sys.executable, "-c", program], **options)

    monkeypatch.setattr(turning.subprocess, "run", dies)
    with pytest.raises(ao.AntioscError, match=told):
        page()


def test_a_report_executes_the_scripts_of_its_views_alone():
    """Each script by its hash, in a frame that may do nothing else."""
    pytest.importorskip("matplotlib")
    from antiosc.scene_file.report import page_of
    from antiosc.scene_file.report_pictures import Picture

    script = "\nlet a = '<b>' && \"c\";\n"
    inner = f'<p>{{}}</p><script type="module">{script}</script><script>0</script>'
    shown = page_of("a title", ["<h2>Pictures</h2>"], [Picture("Turned", "It turns.", "", inner)])
    allowed = re.search(r'Content-Security-Policy" content="([^"]*)"', shown)[1]
    hashes = [hashlib.sha256(text.encode()).digest() for text in (script, "0")]
    named = " ".join(f"'sha256-{base64.b64encode(one).decode()}'" for one in hashes)
    assert allowed.endswith(f"; script-src {named}")
    assert "unsafe-inline'; script" in allowed
    frame = re.search(r'<iframe sandbox="allow-scripts" title="Turned" srcdoc="([^"]*)">', shown)
    assert html.unescape(frame[1]) == inner
    assert "<script" not in shown
    still = page_of("a title", [], [Picture("Still", "It stands.", "data:image/png;base64,AA")])
    assert "script-src" not in still


@pytest.mark.slow
@installed
def test_the_page_names_no_address_that_it_fetches():
    text = page()
    assert text.startswith("<!doctype html>")
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=", text)
    assert turning.ICONS not in text


@pytest.mark.slow
@installed
@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_a_browser_shows_the_surface_in_a_report(tmp_path):
    """By the report's policy its scripts run: without their hashes the frame stays white."""
    pytest.importorskip("matplotlib")
    from antiosc.scene_file.report import page_of
    from antiosc.scene_file.report_pictures import Picture

    text = page_of("turned", [], [Picture("", "", "", page().replace("</body>", WAIT))])
    assert np.mean(seen(tmp_path, text)) > 0.02
    changed = re.sub("sha256-...", "sha256-AAA", text)
    assert np.mean(seen(tmp_path, changed)) == 0


def seen(folder, text: str) -> np.ndarray:
    """Where a page of 1000 × 800 pixels has colours, without the scale at its right."""
    import matplotlib.image

    (folder / "page.html").write_text(text, encoding="utf-8")
    options = (
        *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1000,800"),
        # one process, whose clock is the browser's
        *("--virtual-time-budget=20000", "--disable-features=IsolateSandboxedIframes"),
        *(f"--user-data-dir={folder / 'profile'}", f"--screenshot={folder / 'page.png'}"),
    )
    browse(*options, f"file://{folder}/page.html")
    pixels = matplotlib.image.imread(folder / "page.png")[100:600, 30:800, :3]
    return np.ptp(pixels, axis=2) > 0.2


@pytest.mark.parametrize("there", [False, True])
def test_without_pyvista_or_a_screen_matplotlib_draws(there, monkeypatch, tmp_path):
    """PyVista is tried once: a process that dies leaves the picture to matplotlib."""
    pytest.importorskip("matplotlib")
    from antiosc.charts.deformed import Deformed, draw_deformed

    calls = []

    def dies(command, **_):
        calls.append(command)
        return subprocess.CompletedProcess(command, -11, "", "")

    monkeypatch.setattr(turning, "_draws", there)
    monkeypatch.setattr(turning.subprocess, "run", dies)
    found = Deformed.of(CORNERS, FACES, 0.01 * CORNERS, 0.1)
    for name in ("a.png", "b.png", "c.svg"):
        assert draw_deformed(found, tmp_path / name).stat().st_size > 1000
    assert len(calls) == int(there)
    assert not turning._draws


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("pyvista") is None, reason="PyVista is missing")
def test_a_picture_by_pyvista(tmp_path):
    pytest.importorskip("matplotlib")
    import matplotlib.image

    from antiosc.charts.deformed import Deformed, draw_deformed

    found = Deformed.of(CORNERS, FACES, 0.01 * CORNERS, 0.1)
    seen = []
    for view in (None, np.array([75.0, 10.0])):
        arrow = np.array([0, 0, 1.0]), np.array([0, 0, -1.0])
        path = draw_deformed(found, tmp_path / "a.png", arrow=arrow, view=view)
        seen.append(matplotlib.image.imread(path)[..., :3])
    assert turning._draws
    assert all(shot.shape == (600, 780, 3) for shot in seen)
    assert all(np.mean(np.ptp(shot, axis=2) > 0.2) > 0.02 for shot in seen)
    assert np.mean(np.abs(seen[0] - seen[1]).max(axis=2) > 0.1) > 0.02
    red = [(shot[..., 0] > 0.3) & (shot[..., 1] < 0.2) & (shot[..., 2] < 0.2) for shot in seen]
    assert all(each.sum() > 100 for each in red)
