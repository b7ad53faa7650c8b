"""The page of a deck: what a finer mesh costs before it is made, doubts before the numbers."""

from __future__ import annotations

import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
from abaqus_decks import plate_deck
from antiosc.base import materials
from antiosc.base.progress import seconds_text
from antiosc.extension import halvings
from antiosc.fem.linalg.forecast import OF_SHELLS, before_meshing, of_factor
from antiosc.fem.linalg.solver_choice import Plan
from antiosc.reduce.error import division as divided
from antiosc_app import inspection, live_meshes, opened as page, report, set_up
from antiosc_app.inspecting import inspect_part
from antiosc_app.opened import Opened
from antiosc_app.until_parted import OSCILLATORS
from antiosc_app.view import View
from paths import MESHES
from quick_pages import quick
from webdriver import MISSING, Browser

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]
NOTICES = """
const shown = (id) => [...document.getElementById(id).children].filter((e) => e.tagName === "P");
return {complete: document.documentElement.dataset.complete,
  failed: document.documentElement.dataset.failed || "",
  shown: shown("wrong").map((e) => e.textContent),
  folded: [...document.querySelectorAll("details p")].map((e) => e.textContent),
  stress: page.remarks && page.remarks.stress ? page.remarks.stress.textContent : "",
  asks: document.getElementById("ask").open, size: bench.setup.size};
"""


@pytest.fixture(scope="module")
def deck(tmp_path_factory):
    path = tmp_path_factory.mktemp("deck") / "plate.inp"
    path.write_text(plate_deck(6), encoding="utf-8")
    return path


@pytest.fixture
def opened(deck):
    one = Opened(deck, unit="m")
    yield one
    one.close()


@pytest.mark.slow
def test_long_work_tells_its_time_and_the_scene_that_is_written_before_its_report(
    opened, deck, monkeypatch
):
    """An answer of all models that it may need, a report without the model, which is known."""
    setup = json.loads(json.dumps(opened.calls["look"]({})["setup"])) | {"duration": 2e-4}
    told = []

    def write(_results, _parts, path):
        told.append(opened.calls["progress"]({}) | {"scene": deck.with_suffix(".toml").exists()})
        path.write_text("the report", encoding="utf-8")

    def struck(*arguments):
        told.append(opened.calls["progress"]({}))
        return Opened._struck(opened, *arguments)

    monkeypatch.setattr(inspection, "LONG", 0.0)
    monkeypatch.setitem(inspection.ANSWER, 2, 1000.0)  # of the model's seconds, which are few
    monkeypatch.setattr(opened, "_struck", struck)
    monkeypatch.setattr(report, "write_page", write)
    blow = opened.calls["settle"]({"tab": "a", "turn": 1, "setup": setup})
    look, n = opened._opened().look, blow["taken"]["n"]
    models = look.forecast(n=look.count), look.forecast(n=n)
    growing = look.forecast(grows=True)
    assert growing.counts == [look.count, *(count for count in OSCILLATORS if count > look.count)]
    assert told[0]["takes"] == f"of about {growing.lasting(growing.answer)}"
    assert told[0]["takes"].startswith(f"of about {seconds_text(1000 * models[0].seconds)}")
    asked = opened.calls["save"]({"setup": setup})
    assert asked["takes"] == seconds_text(999 * models[1].seconds)
    try:
        agreed = {"tab": "a", "turn": 1, "setup": setup, "agreed": asked["names"]}
        opened.calls["write"](agreed)
        assert told[-1]["takes"] == f"of about {asked['takes']}"
        assert told[-1]["scene"]
        assert told[-1]["written"] == asked["names"][0]
        assert opened.calls["progress"]({})["takes"] == ""
        opened.calls["map"]({"tab": "a", "turn": 1, "setup": setup})
        assert told[-1]["takes"] == ""  # an answer's time is not that of a map
        monkeypatch.setattr(inspection, "LONG", 1e9)
        assert opened.calls["save"]({"setup": setup})["takes"] == ""
    finally:
        for name in asked["names"]:
            deck.with_name(name).unlink(missing_ok=True)


@pytest.mark.slow
def test_the_clock_of_an_answer_is_that_of_the_server_over_all_its_steps(opened, monkeypatch):
    """Each blow lasts 10 s by a clock of the test; one that begins anew has a clock of its own."""
    setup = json.loads(json.dumps(opened.calls["look"]({})["setup"])) | {"duration": 2e-4}
    now, lasted = [1000.0], []

    def struck(*arguments, **options):
        now[0] += 10.0
        lasted.append(opened.calls["progress"]({})["lasted"])
        return Opened._struck(opened, *arguments, **options)

    monkeypatch.setattr(page, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(opened, "_struck", struck)
    for name, turn in (("blow", 1), ("settle", 1), ("fields", 1), ("blow", 2)):
        opened.calls[name]({"tab": "a", "turn": turn, "setup": setup})
    assert lasted == [10.0, 20.0, 30.0, 10.0]


def test_cells_that_do_not_fit_are_told_with_the_finest_that_do(opened, monkeypatch):
    setup = json.loads(json.dumps(opened.calls["look"]({})["setup"])) | {"duration": 0.02, "n": 10}
    look = opened._opened().look

    def asked(size):
        return opened.calls["forecast"]({"setup": setup | {"size": size}})

    room = 1.01 * look.forecast(look.largest / 4, 10).bytes  # of two halvings, not of three
    monkeypatch.setattr(inspection, "free_memory", lambda: room)
    told = asked(look.largest / 64)
    assert told["fits"] is False
    assert halvings(look.largest, told["larger"]) == 2
    assert "the finest cells that do are of" in told["question"]
    assert f"{1e3 * told['larger']:.4g} mm" in told["question"]
    assert "e+" not in told["question"]
    answer = {"setup": setup | {"size": told["larger"]}}
    assert opened.calls["forecast"](answer).get("fits", True)
    monkeypatch.setattr(inspection, "free_memory", lambda: 1.0)
    alone = asked(look.largest / 64)
    assert alone["fits"] is False
    assert "larger" not in alone
    assert "no finer mesh" in alone["question"]


@pytest.mark.parametrize("fixed", ["rim, 1, 6", "rim, 3, 3", ""])
def test_a_deck_that_holds_nothing_is_told_to_be_free(fixed, tmp_path):
    path = tmp_path / "plate.inp"
    path.write_text(plate_deck(6).replace("*BOUNDARY\nrim, 1, 6", fixed and f"*BOUNDARY\n{fixed}"))
    opened = Opened(path, unit="m")
    try:
        told = opened.calls["look"]({})["unheld"]
        (held,) = (row for row in opened._opened().look.taken(False) if row[0] == "held")
    finally:
        opened.close()
    for words in (told, held[1]):
        assert ("free" in words) == (not fixed)
        assert ("as in the deck" in words) == bool(fixed)


@pytest.mark.slow
def test_a_yield_strength_with_its_range_is_typed_for_a_deck_of_plies_of_one_material(
    deck, tmp_path
):
    """Ten plies of it are one sheet: the verdict is that of the deck without plies."""
    plies = "*SHELL SECTION, ELSET=all, COMPOSITE\n" + 10 * "2e-4, 3, m\n"
    text = deck.read_text().replace("*SHELL SECTION, ELSET=all, MATERIAL=m\n2e-3\n", plies)
    (tmp_path / "plies.inp").write_text(text)
    told = []
    for path in (deck, tmp_path / "plies.inp"):
        page = Opened(path, unit="m")
        setup = json.loads(json.dumps(page.calls["look"]({})["setup"]))
        setup |= {"duration": 0.01, "n": 10, "yield_strength": 2e6, "yield_range": [1.5e6, 3e6]}
        asked = {"tab": "a", "turn": 1, "setup": setup}
        settled = page.calls["settle"](asked)
        assert settled["blow"]["law"]["yields"]["unknown"] == ""
        told.append(page.calls["verdict"](asked)["verdict"])
        page.close()
    assert told[0] == told[1]
    assert "yield strength 2.00 MPa (1.50 MPa to 3.00 MPa)" in " ".join(told[0])


@pytest.mark.slow
def test_a_yield_strength_is_named_by_a_material_like_that_of_the_deck(opened):
    """The plate has 3 GPa and 1200 kg/m³; its answer is that of the numbers of the name."""
    look = json.loads(json.dumps(opened.calls["look"]({}), default=str))
    known = [materials.record(name) for name in materials.names() if "wood" not in name]
    like = [m.name for m in known if abs(3e9 / m.E - 1) <= 0.1 and abs(1200 / m.rho - 1) <= 0.1]
    assert look["strengths"] == [name for name in like if materials.record(name).yield_strength]
    named = materials.record("PMMA")
    numbers = {"yield_strength": named.yield_strength, "yield_range": list(named.yield_range)}
    told = []
    for turn, given in enumerate(({"yield_strength": "PMMA"}, numbers), start=20):
        setup = look["setup"] | {"duration": 0.01, "n": 10} | given
        asked = {"tab": "named", "turn": turn, "setup": setup}
        assert opened.calls["settle"](asked)["blow"]["law"]["yields"]["unknown"] == ""
        told.append(opened.calls["verdict"](asked)["verdict"])
    assert told[0] == told[1]
    assert "yield strength 72.0 MPa (53.8 MPa to 73.1 MPa)" in " ".join(told[0])
    by_name = look["setup"] | {"yield_strength": "PMMA"}
    scene = set_up.scene_of(opened._opened(), set_up.read(by_name), 0.01)
    assert 'yield_strength = "PMMA"' in set_up.toml(scene)


def test_the_edges_of_the_cells_of_a_deck_are_drawn(opened):
    """6 × 6 squares have 2 × 6 × 7 edges along x and y, in the set-up and under its fields."""
    look = opened.calls["look"]({})
    setup = json.loads(json.dumps(look["setup"])) | {"duration": 0.01, "n": 10}
    part = opened.calls["fields"]({"tab": "edges", "turn": 1, "setup": setup})["part"]
    for skin in (look["skin"], part):
        ends = skin["points"].reshape(-1, 3)[skin["edges"]] * skin["half"] / live_meshes.STEPS
        sides = np.sort(np.abs(ends[:, 1] - ends[:, 0]), axis=1)
        np.testing.assert_allclose(sides, 84 * [[0, 0, 1 / 6]], atol=1e-4)
        assert len(np.unique(ends.mean(axis=1).round(3), axis=0)) == 84
        assert len(skin["seams"]) == 0


def test_a_rib_under_a_skin_is_drawn_where_it_meets_it():
    """Two squares of a skin and one of a rib, with nodes of its own at the same places."""
    x = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    rib = [(1, 0, 0), (1, 1, 0), (1, 1, -1), (1, 0, -1)]
    cells = [np.array([[0, 1, 4, 3], [1, 2, 5, 4]]), np.array([[6, 7, 8, 9]])]
    lines = live_meshes.edges_of(np.array(x + rib, dtype=float), cells, np.arange(10))
    assert len(lines["edges"]) == 7 + 3
    assert [sorted(pair) for pair in lines["seams"].tolist()] in ([[1, 4]], [[6, 7]])


@pytest.mark.parametrize("thick", [["2e-3", "2e-3"], ["2e-3", "8e-3"]])
def test_the_thicknesses_of_a_deck_are_told(thick, tmp_path):
    """Its right half may be thicker; the site lies somewhere in one of both."""
    deck = tmp_path / "plate.inp"
    halves = [
        [str(1 + i + 6 * j) for j in range(6) for i in range(6) if (i > 2) == k] for k in (0, 1)
    ]
    sets = "".join(f"*ELSET, ELSET=e{k}\n" + ",\n".join(one) + "\n" for k, one in enumerate(halves))
    section = "*SHELL SECTION, ELSET=all, MATERIAL=m\n2e-3\n"
    sections = "".join(
        section.replace("all", f"e{k}").replace("2e-3", t) for k, t in enumerate(thick)
    )
    deck.write_text(
        plate_deck(6).replace("*MATERIAL", sets + "*MATERIAL").replace(section, sections)
    )
    look = inspect_part(deck, unit="m")
    at_site = 2 if thick[1] == "2e-3" or look.point[0] < 0.5 else 8
    told = {"2e-3": "2 mm thick", "8e-3": f"2 to 8 mm thick ({at_site} mm at the first site)"}
    assert look.sides_text().endswith(f"1000 × 1000 mm, {told[thick[1]]}")


@pytest.mark.parametrize("wrong", [[3e6, 4e6], [1e6], [0.0, 3e6]])
def test_a_range_of_a_deck_holds_its_yield_strength(wrong, opened):
    setup = json.loads(json.dumps(opened.calls["look"]({})["setup"]))
    setup |= {"yield_strength": 2e6, "yield_range": wrong}
    with pytest.raises(ao.InputError, match="range of the yield strength"):
        opened.calls["blow"]({"tab": "a", "turn": 1, "setup": setup})


def test_an_edge_of_a_deck_is_held_besides_what_the_deck_holds(tmp_path):
    """A plate on one hinged edge turns about it; with the opposite edge held it does not."""
    deck = tmp_path / "hinged.inp"
    rim = plate_deck(6)
    edge = ", ".join(str(1 + 7 * j) for j in range(7))
    deck.write_text(rim.replace("rim, 1, 6", "edge, 1, 3").replace(
        "*MATERIAL", f"*NSET, NSET=edge\n{edge}\n*MATERIAL"))  # fmt: skip
    page = Opened(deck, unit="m")
    try:
        look = page.calls["look"]({})
        assert {"edges at +x", "edges at -y", "rim", "edge"} <= set(look["faces"])
        triangles = dict(zip(look["faces"], look["skin"]["sets"], strict=True))
        assert len(triangles["edges at +x"]) == 2 * 6  # of the cells at it
        setup = json.loads(json.dumps(look["setup"])) | {"duration": 0.01, "n": 10}
        free, held = (
            page.calls["settle"]({"tab": "a", "turn": 1 + k, "setup": setup | {"held": names}})
            for k, names in enumerate([[], ["edges at +x"]])
        )
        hinge = "free to move as a rigid body: rotation about y"
        assert hinge in look["told"]  # once: it is no warning too
        assert not any(hinge in text for one in (free, held) for _, text in one["warnings"])
        lowest = [one["blow"]["body"]["omega"][0] for one in (free, held)]
        assert lowest[0] == 0.0 < lowest[1]
    finally:
        page.close()


@pytest.mark.parametrize("family", ["sheet", "solid"])
def test_the_size_and_memory_of_a_factor_are_forecast_from_the_cells_alone(family):
    if family == "sheet":
        mesh = ao.box_mesh((0.3, 0.2), size=0.01, gdim=3)
        part = ao.Structure(mesh, ao.Shell(70e9, 0.3, 2700.0, thickness=1e-3), [ao.Support("-x")])
    else:
        mesh = ao.box_mesh((0.06, 0.05, 0.04), size=0.006)
        part = ao.Structure(mesh, ao.Solid(70e9, 0.3, 2700.0), [ao.Support("-x")])
    dofs, cost = before_meshing(mesh.cell, mesh.tdim, mesh.n_cells, [0])
    assert dofs == pytest.approx(part.dofs, rel=0.25)
    of_solver = cost.bytes - (OF_SHELLS * dofs if family == "sheet" else 0.0)
    assert 0.4 < of_solver / of_factor(Plan(part.K).entries, 1.0).bytes < 2.5


#: A finer mesh that the page asks about and nobody answers.
ASKED = "bench.call = async () => ({ question: 'Fine?', fits: true }); bench.resize(0.004)"


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_the_page_shows_what_questions_the_number_and_folds_the_rest(opened, monkeypatch):
    monkeypatch.setattr(divided, "MOST_DOFS", 0)  # without an error bar
    page = View(quick(opened, 0.02), "plate", "'none'")
    try:
        with Browser() as browser:
            browser.address(page.address, 1300)
            for _ in range(1200):
                state = browser.run("return globalThis.page ? 1 : 0") and browser.run(NOTICES)
                if state and (state["complete"] or state["failed"]):
                    break
                time.sleep(0.1)
            assert not state["failed"]
            assert any("The cell at the site measures" in text for text in state["shown"])
            assert not any("plate.inp are not taken" in text for text in state["shown"])
            assert any("plate.inp are not taken" in text for text in state["folded"])
            browser.run("bench.resize(0.004)")
            for _ in range(600):
                asked = browser.run(NOTICES)
                if asked["asks"]:
                    break
                time.sleep(0.1)
            assert (asked["asks"], asked["size"]) == (True, None)
            browser.run("document.getElementById('no').click()")
            assert browser.run(NOTICES)["size"] is None
            browser.run(ASKED)  # of a mesh that fits too
            time.sleep(0.5)
            assert browser.run(NOTICES)["size"] is None
            browser.run("document.getElementById('no').click(); delete bench.call")
            look = opened._opened().look
            room = 1.01 * look.forecast(look.largest / 2).bytes
            monkeypatch.setattr(inspection, "free_memory", lambda: room)
            browser.run("bench.resize(0.004)")
            for _ in range(600):
                if browser.run(NOTICES)["asks"]:
                    break
                time.sleep(0.1)
            focused = "const one = document.activeElement; return [one.id, one.textContent]"
            told = browser.run(focused)
            assert told[0] == "other"  # not "Make it"
            assert told[1].startswith("Rather ")
            assert browser.said() == []
    finally:
        page.close()


PLACES = """
const names = (row) => [...row.querySelectorAll("input")].map((one) => one.name);
const rows = [...document.querySelectorAll("#part label")].filter((one) => !one.hidden);
const top = (id) => document.getElementById(id).getBoundingClientRect().top;
const x = [...bench.rest].filter((_, k) => k % 3 === 0);
return {fields: rows.map((row) => names(row)[0]), held: [...bench.held()], x,
  shades: [...page.part.shades],
  verdict: top("verdict"), setup: top("setup")};
"""
SHOWN = "return globalThis.page && globalThis.page.hit ? {...document.documentElement.dataset} : {}"


def shown(browser, name, turn):
    """Wait until the page has shown an answer so far."""
    for _ in range(1200):
        state = browser.run(SHOWN)
        assert "failed" not in state, state
        if int(state.get(name, 0)) >= turn:
            return
        time.sleep(0.1)
    raise AssertionError(state)


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_fields_held_edges_and_the_blow_before_on_the_page_of_a_deck(tmp_path):
    """Of one without a density, whose field stands among the others."""
    path = tmp_path / "plate.inp"
    path.write_text(plate_deck(6).replace("*DENSITY\n1200.\n", ""), encoding="utf-8")
    page = View(quick(Opened(path, unit="m"), 0.02), "plate", "'none'")
    try:
        with Browser() as browser:
            browser.address(page.address, 390)
            shown(browser, "settled", 1)
            browser.run("bench.change({yield_strength: 2e8, held: ['edges at +x']})")
            shown(browser, "settled", 2)
            places = browser.run(PLACES)
            at = places["fields"].index("yield_strength")
            assert places["fields"][at + 1] == "yield_range"
            assert "density" in places["fields"]
            at_edge = [value > max(places["x"]) - 1e-4 for value in places["x"]]
            assert [bool(one) for one in places["held"]] == at_edge  # no triangle beside it
            chosen = "select[name='yields like']"
            assert browser.run("return document.querySelector(arguments[0]).value", chosen) == ""
            triangles = [at_edge[k : k + 3] for k in range(0, len(at_edge), 3)]
            assert not any(all(one) for one in triangles)
            assert {round(one, 2) for one in places["shades"]} == {-1.0, -2.4}
            assert places["verdict"] < places["setup"]
            browser.run("bench.map()")
            for _ in range(1200):
                if browser.run("return Boolean(page.sites)"):
                    break
                time.sleep(0.1)
            mapped = browser.run("page.choose(3); return page.hit.peak_force")
            browser.run("bench.map()")  # strikes this site
            shown(browser, "settled", 4)
            assert browser.run("return page.data.before.peak_force") == mapped
            told = browser.run("return page.cells.peak_force[1].textContent")
            assert told.endswith("N")
            assert browser.said() == []
    finally:
        page.close()


@pytest.mark.slow
def test_a_page_that_is_loaded_again_waits_for_no_computation():
    opened = Opened(MESHES / "bracket.msh")
    first = opened.calls["look"]({})
    busy = threading.Event()
    opened._work.submit(busy.wait)  # as a search of modes, which takes minutes
    again = ThreadPoolExecutor(1).submit(opened.calls["look"], {})
    try:
        assert again.result(timeout=20) == first
    finally:
        busy.set()


def test_a_part_of_fibres_is_asked_for_no_yield_strength():
    mesh = ao.box_mesh((0.1, 0.1), size=0.05)
    ply = ao.Layer(E1=140e9, E2=9e9, nu12=0.3, G12=5e9, G13=5e9, G23=3e9, rho=1600, thickness=1e-3)
    steel = ao.material("steel S235", thickness=1e-3)
    assert not page._may_yield(ao.Structure(mesh, ao.Laminate([ply])))
    assert page._may_yield(ao.Structure(mesh, steel))


def strip_deck(path):
    """A strip of 40 × 6 × 1 mm in cells of 4 × 6 mm, so that a patch of one reaches its edges."""
    x, y, z = np.meshgrid(np.arange(0.0, 44, 4), [0.0, 6.0], [0.0, 1.0], indexing="ij")
    nodes = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    lines = ["*NODE", *(f"{k}, {a}, {b}, {c}" for k, (a, b, c) in enumerate(nodes.tolist(), 1))]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=ALL"]
    for k in range(10):
        low, high = 4 * k + 1, 4 * k + 5
        ends = [low, high, high + 2, low + 2, low + 1, high + 1, high + 3, low + 3]
        lines.append(", ".join(map(str, [k + 1, *ends])))
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", "210e3, 0.3", "*DENSITY", "7.85e-9"]
    lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=M", "*BOUNDARY"]
    lines += [f"{node}, 1, 3" for node in (1, 2, 3, 4, 41, 42, 43, 44)]
    path.write_text("\n".join([*lines, ""]))
    return path
