"""`antiosc open`: the page edits a scene, and shows what a run of the saved scene prints."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor

import pytest

import antiosc as ao
from abaqus_decks import plate_deck
from antiosc.base import progress
from antiosc.base.errors import InputError
from antiosc_app import edited
from antiosc_app.cli import main
from antiosc_app.opened import OpenPart
from antiosc_app.working import STALE_ANSWER, PageWorker
from webdriver import MISSING, Browser

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]
#: Largest cell of the block [m]: coarse, that a set-up is answered soon.
SIZE = 10e-3
CLICK = """
const view = document.getElementById("view"), box = view.getBoundingClientRect();
const [x, y] = bench.view.seen(arguments[0]);
const at = {clientX: box.x + x, clientY: box.y + y, pointerId: 1, bubbles: true,
  shiftKey: arguments[1]};
view.setPointerCapture = () => {};
view.dispatchEvent(new PointerEvent("pointerdown", at));
view.dispatchEvent(new PointerEvent("pointerup", at));
"""
READ = """
return {data: {...document.documentElement.dataset}, scene: bench.scene, held: bench.held,
  cards: [...document.querySelectorAll("#cards dd")].map((one) => one.textContent),
  tone: document.querySelector(".card").className, kind: document.getElementById("kind").value,
  rows: document.querySelectorAll("#rows tr").length, width: document.documentElement.scrollWidth,
  written: document.getElementById("written").textContent,
  cautions: document.querySelectorAll("#wrong > p").length};
"""
#: A bar that moves keeps a browser without graphics hardware at work.
STILL = "document.getElementById('bar').style.appearance = 'none';"
#: The words that are seen outside of folded boxes and lists.
WORDS = """
const seen = (one) => one.checkVisibility() && (!one.closest("details") || one.closest("summary"))
  && !one.closest("select, script, style, noscript, dialog");
return [...document.querySelectorAll("body *")].filter(seen).flatMap((one) => [...one.childNodes])
  .filter((node) => node.nodeType === 3).map((node) => node.textContent).join(" ");
"""


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    """A block of 30 mm, as STEP in millimetres."""
    gmsh = pytest.importorskip("gmsh")
    path = tmp_path_factory.mktemp("open") / "block.step"
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")  # OpenCASCADE keeps the last one
        occ = gmsh.model.occ
        occ.addBox(0, 0, 0, 30, 20, 10)
        occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


@pytest.fixture(scope="module")
def opened(step):
    one = OpenPart(step, size=SIZE)
    one.calls["look"]({})
    yield one
    one.close()


@pytest.fixture
def deck(tmp_path):
    path = tmp_path / "plate.inp"
    path.write_text(plate_deck(6), encoding="utf-8")
    one = OpenPart(path, unit="m")
    yield one
    one.close()


def edit(one, **changes):
    return one.calls["edit"](changes)


def answer(one, step="show"):
    return one.calls[step]({"turn": one._worker.turn})


def quick(one, duration=2e-4, n=8):
    """The scene with a short run of few anti-oscillators."""
    return edit(one, set={"simulate.duration": duration, "extract.n": n})


def timeless(text: str) -> str:
    """A text without the seconds that the machine took."""
    return re.sub(r"\d+ s:", "", text.strip())


def saved_and_run(one, capsys):
    """(text of the page, what `antiosc run` of the saved scene prints, the scene)."""
    text = answer(one)["summary"]["text"]
    names = one.calls["names"]({})["names"]
    written = one.calls["write"]({"turn": one._worker.turn, "agreed": names})
    scene = one._path.with_name(written["written"][0])
    capsys.readouterr()
    assert main(["run", str(scene), "--out", str(scene.parent / "out"), "--verbose"]) == 0
    return text, capsys.readouterr().out.split("\nwrote ")[0], tomllib.loads(scene.read_text())


@pytest.mark.slow
def test_a_fall_shows_what_a_run_of_its_saved_scene_prints(tmp_path, capsys):
    geo = tmp_path / "block.geo"
    geo.write_text(
        'SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.06, 0.04, 0.02};\n'
        'Physical Volume("block") = {1};\n'
    )
    one = OpenPart(geo, size=0.02)
    try:
        one.calls["look"]({})
        told = edit(one, striker="floor")
        assert told["falls"]
        assert set(told["scene"]) >= {"drop", "geometry", "material"}
        edit(one, set={"drop.toward": [1.0, 0.0, 0.0], "drop.height": 0.3}, onto="steel S235")
        assert answer(one, "settle") == {}
        page, printed, scene = saved_and_run(one, capsys)
        assert timeless(page) == timeless(printed)
        assert scene["drop"]["floor"]["material"] == "steel S235"
        shown = answer(one)
        assert len(shown["fall"]["impacts"]) == 3
        assert shown["summary"]["cards"][1].name == "largest force"
    finally:
        one.close()


# -- the scene


def test_a_field_changes_the_scene_and_undo_takes_it_back(opened):
    first = opened.calls["look"]({})
    told = edit(opened, set={"impactor.velocity": 2.5})
    assert told["scene"]["impactor"]["velocity"] == 2.5
    assert told["turn"] > first["turn"]
    held = edit(opened, hold="face 3")["held"]
    assert held == [*first["held"], "face 3"]
    assert edit(opened, hold="face 3")["held"] == first["held"]
    for _ in range(3):
        told = edit(opened, undo=True)
    assert told["scene"] == first["scene"]
    assert not told["undo"]
    edit(opened, undo=True)


def test_what_is_left_empty_is_chosen_by_the_run(opened):
    given = edit(opened, set={"sites.radius": 2e-3, "extract.n": 30, "extract.damping": 0.01})
    assert given["scene"]["sites"]["radius"] == 2e-3
    left = edit(opened, set={"sites.radius": None, "extract.n": None, "extract.damping": None})
    assert left["scene"]["sites"]["radius"] == left["scene"]["extract"]["n"] == "auto"
    assert "damping" not in left["scene"]["extract"]
    for _ in range(2):
        edit(opened, undo=True)


WRONG = [
    {"extra": 1}, {"set": 3}, {"set": {"geometry.source": "/etc/passwd"}},
    {"set": {"deck.path": "x"}}, {"set": {"output.csv": True}}, {"set": {"__class__.a": 1}},
    {"set": {"sites.point": [0, 0]}}, {"set": {"sites.point": "here"}},
    {"set": {"sites.direction": [0, 0, 0]}}, {"set": {"sites.radius": -1.0}},
    {"set": {"extract.damping": 2.0}}, {"set": {"extract.n": 1.5}},
    {"set": {"impactor.radius": {"kind": "Sphere"}}}, {"set": {"impactor.velocity": "fast"}},
    {"set": {"geometry.size": 0}}, {"set": {"drop.height": 0}}, {"hold": "../../etc"}, {"hold": 1},
    {"striker": "bomb"}, {"material": "unobtainium"}, {"material": 3}, {"of": "/etc/passwd"},
    {"onto": "lava"}, {"opening": 77},
]  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_change_is_refused_in_one_sentence_and_changes_nothing(opened, wrong):
    before = opened.calls["look"]({})
    falls = "drop.height" in str(wrong)
    if falls:
        edit(opened, striker="floor")
    with pytest.raises(InputError) as refused:
        edit(opened, **wrong)
    assert "block.toml:" not in str(refused.value)  # the page has no lines
    if falls:
        edit(opened, undo=True)
    assert opened.calls["look"]({})["scene"] == before["scene"]


def test_what_is_written_is_toml():
    table = {
        "title": 'a "b" \\ ü \x7f', "x": {"flag": True, "n": 3, "list": [1.5e-9, [2, 3]]},
        "many": [{"where": "face 1"}, {"plane": [[0.0, 0.0, 0.0], [0, 0, 1]]}],
        "sites": {"struck": {"inner": {"kind": "a", "d": 1e20}}},
    }  # fmt: skip
    assert tomllib.loads(edited.toml_text(table)) == table


# -- the answers


@pytest.mark.slow
def test_another_striker_keeps_mesh_structure_and_model(deck, monkeypatch):
    deck.calls["look"]({})
    quick(deck)
    first = answer(deck)["blow"]["computed"]["peak_force"]
    kept = deck._kept
    before = {name: list(cache) for name, cache in kept.results.items()}
    edit(deck, set={"impactor.velocity": 2.0})
    assert answer(deck)["blow"]["computed"]["peak_force"] > first
    assert {name: list(cache) for name, cache in kept.results.items()} == before
    assert before["extract"]
    assert before["read_model"]


def test_the_latest_set_up_wins():
    worker, begun = PageWorker(), threading.Event()

    def endless():
        while True:
            with progress.doing("a step"):
                begun.set()
                time.sleep(0.01)

    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(worker.compute, endless, 0)
        assert begun.wait(10)
        assert worker.progress()["doing"] == "a step"
        worker.next_turn()
        assert first.result(timeout=10) == STALE_ANSWER
        assert worker.compute(lambda: {"done": 1}, 0) == STALE_ANSWER
        assert worker.compute(lambda: {"done": 1}, 1) == {"done": 1}
        begun.clear()
        last = pool.submit(worker.compute, endless, 1)
        assert begun.wait(10)
        worker.close()  # as the program ends
        assert last.result(timeout=10) == STALE_ANSWER


@pytest.mark.slow
def test_a_map_is_that_of_the_scene(deck):
    deck.calls["look"]({})
    quick(deck)
    found = deck.calls["map"]({"turn": deck._worker.turn, "most_sites": 20})
    assert 1 < len(found["sites"]["start"]) - 1 <= 20
    assert "sites" in dict(found["summary"]["rows"])
    with pytest.raises(InputError, match="no group"):
        deck.calls["map"]({"turn": deck._worker.turn, "where": "nowhere"})
    edit(deck, striker="floor")
    with pytest.raises(InputError, match="map"):
        deck.calls["map"]({"turn": deck._worker.turn})


@pytest.mark.slow
def test_nothing_is_written_through_a_link_that_leads_nowhere(deck, tmp_path):
    deck.calls["look"]({})
    (tmp_path / "plate.html").symlink_to(tmp_path / "elsewhere.html")
    assert deck.calls["names"]({})["names"] == ["plate_2.toml", "plate_2.html"]
    with pytest.raises(InputError, match="agreed"):
        deck.calls["write"]({"turn": 0, "agreed": ["plate.toml", "plate.html"]})


@pytest.mark.slow
def test_view_shows_a_structure_in_a_frame(step):
    mesh = ao.read_mesh(step, size=SIZE)
    part = ao.Structure(mesh, ao.Solid(E=70e9, nu=0.33, rho=2700.0), [ao.Support("face 1")])
    shown = ao.view(part)
    one = shown._opened
    try:
        assert shown.site is None
        assert f'<iframe src="{shown.address}"' in shown._repr_html_()
        assert "frame-ancestors 'self'" in shown._server.policy
        look = one.calls["look"]({})
        quick(one)
        answer(one, "settle")
        assert isinstance(shown.site, ao.Site)
        assert shown.site.point == tuple(look["scene"]["sites"]["point"])
        with pytest.raises(InputError, match="agreed"):
            one.calls["write"]({"turn": one._worker.turn})
    finally:
        shown.close()


@pytest.mark.parametrize("part", [3, None, "missing.step"])
def test_what_is_no_part_is_not_shown(part):
    with pytest.raises(InputError):
        ao.view(part)


# -- in a browser


@pytest.fixture
def command(step):
    """The address of `antiosc open`."""
    arguments = [sys.executable, "-m", "antiosc", "open", step.name, "--no-browser"]
    arguments += ["--size", str(SIZE)]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        arguments, cwd=step.parent, stdout=subprocess.PIPE, text=True, env=environment
    )
    assert process.stdout is not None
    try:
        yield re.search(r"http://127\S+", process.stdout.readline())[0]
    finally:
        process.terminate()
        process.communicate(timeout=60)


def edited_once(browser, before=None):
    """The scene of the page and what it holds, once they are there, or are not as before."""
    for _ in range(600):
        now = browser.run("return bench.view && {scene: bench.scene, held: bench.held}")
        if now and now != before:
            return now
        time.sleep(0.1)
    raise AssertionError([browser.said(), browser.run("return document.body.innerText")[:3000]])


def reached(browser, turn):
    """The state of the page once the answer to a set-up is complete."""
    for _ in range(2400):
        data = browser.run("return {...document.documentElement.dataset}")
        assert "failed" not in data, data
        if int(data.get("complete", -1)) >= turn:
            return browser.run(READ)
        time.sleep(0.25)
    raise AssertionError((data, browser.said()))


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_from_a_file_to_a_saved_scene_in_a_browser(command, step, capsys):
    with Browser() as browser:
        browser.address(command, 390)
        browser.run(STILL)
        first = edited_once(browser)
        browser.run("bench.edit({ set: { 'simulate.duration': 2e-4, 'extract.n': 8 } })")
        short = edited_once(browser, first)
        browser.run(CLICK, [0.0225, 0.01, 0.01], False)
        clicked = edited_once(browser, short)
        assert clicked["scene"]["sites"]["point"] == pytest.approx([0.0225, 0.01, 0.01], abs=3e-4)
        assert clicked["scene"]["sites"]["direction"] == pytest.approx([0, 0, -1], abs=1e-6)
        browser.run(CLICK, [0.015, 0.0, 0.005], True)  # holds a side
        held = edited_once(browser, clicked)
        assert len(held["held"]) == len(first["held"]) + 1
        browser.run("bench.edit({ set: { 'sites.direction': [0.3, 0, -1] } })")
        turned = edited_once(browser, held)
        assert turned["scene"]["sites"]["direction"] != held["scene"]["sites"]["direction"]
        browser.run("document.getElementById('undo').click()")
        undone = reached(browser, 5)  # of the set-ups before, none was waited for
        assert undone["scene"] == held["scene"]
        assert undone["width"] <= 390
        assert len(undone["cards"]) == 4
        assert undone["tone"] in ("card safe", "card dent", "card bends", "card unknown")
        assert undone["kind"] == "stress"  # the coloured part comes first
        assert undone["rows"] <= 8
        assert undone["cautions"] <= 3
        assert len(re.findall(r"[^\W\d_]\w+", browser.run(WORDS))) <= 120

        field = "document.querySelector('#setup input[name=\"impactor.radius\"]')"
        typed = f"const one = {field}; one.value = arguments[0];"
        browser.run(typed + "one.dispatchEvent(new Event('change'))", "-3")
        time.sleep(1)
        told = browser.run(f"return [{field}.getAttribute('aria-invalid'), {field}.value]")
        assert told == ["true", "-3"]  # it stays to be mended
        browser.run("delete document.documentElement.dataset.failed")
        assert browser.run(READ)["scene"] == held["scene"]
        browser.run(typed + "one.dispatchEvent(new Event('change'))", "8")
        larger = reached(browser, 6)
        assert larger["scene"]["impactor"]["radius"] == 0.008
        assert larger["cards"] != undone["cards"]

        browser.resize(1300)
        browser.run("save.click()")
        time.sleep(1)
        browser.run("document.getElementById('yes').click()")
        for _ in range(600):
            if "Written" in browser.run(READ)["written"]:
                break
            time.sleep(0.1)
        assert f"antiosc run {step}".removesuffix(".step") in browser.run(READ)["written"]
        text = browser.run("return document.getElementById('text').textContent")
        peak = browser.run("return page.hit.peak_force")
        report = browser.run("return document.querySelector('#written a').href")
        assert browser.run(READ)["width"] <= 1300

        browser.address(command, 1300)  # the scene is the server's: a reload keeps it
        browser.run(STILL)
        again = reached(browser, 6)
        assert again["scene"] == larger["scene"]
        browser.run("document.getElementById('most-sites').value = 5")
        browser.run("document.getElementById('map').click()")
        for _ in range(1200):
            if browser.run("return Boolean(bench.page && bench.page.sites) && !bench.pending"):
                break
            time.sleep(0.1)
        assert browser.run("return map.textContent") == "Strike this site"
        choose = "const s = document.querySelector('[name=striker]'); s.value = arguments[0];"
        browser.run(choose + "s.dispatchEvent(new Event('change'))", "floor")
        for _ in range(100):
            if browser.run("return bench.falls"):
                break
            time.sleep(0.1)
        assert browser.run("return 'drop' in bench.scene")
        browser.address(report, 1300)
        assert browser.run("return document.title") == "An impact on block.step"
        assert browser.run("return document.querySelector('#numbers').rows.length") > 3  # it runs
        assert browser.said() == []
    scene = step.with_suffix(".toml")
    assert main(["run", str(scene), "--out", str(step.parent / "out"), "--verbose"]) == 0
    assert timeless(capsys.readouterr().out.split("\nwrote ")[0]) == timeless(text)
    result = (step.parent / "out" / "result.json").read_text()
    assert float(re.search(r'"peak_force": ([\d.]+)', result)[1]) == pytest.approx(peak, rel=1e-6)
    for path in step.parent.glob("block*.[th]*ml"):
        path.unlink()
