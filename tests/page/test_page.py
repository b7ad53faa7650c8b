"""The live report in a browser: the numbers of `simulate`; nothing is fetched, no name runs."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.texts import engineering, plain_number
from antiosc_app import live as assets
from antiosc_app.cards import cards_of_history
from webdriver import MISSING, Browser

pytestmark = pytest.mark.skipif(bool(MISSING), reason=MISSING)

MODEL = ao.AntiOscillators(m0=2e-3, k0=5e5, m=[0.05, 0.03, 0.01], omega=[2e3, 7e3, 1.9e4])
STRIKER, LAW, DURATION = ao.RigidMass(0.2, 1.5), ao.Hertz(1e9), 3e-3
HOSTILE = "</script><script>document.title='taken'</script><img src=x onerror=alert(1)> {{ 1 }} &"
WIDTHS = (1300, 390)
NAMES = ("peak_force", "impulse", "contact_time", "restitution")
#: The numbers of the page, its sliders' values, and how wide it is.
READ = """
const rows = document.querySelectorAll("#numbers tr");
const cells = Object.fromEntries([...rows].map((row) =>
  [row.cells[0].textContent.replace(" ", "_"), Number(row.cells[1].dataset.value)]));
const sliders = Object.fromEntries([...document.querySelectorAll("#sliders label")].map((row) =>
  [row.querySelector("input").name, Number(row.querySelector("output").dataset.value)]));
return {cells, sliders, width: document.documentElement.scrollWidth, title: document.title,
  marked: document.getElementById("case").textContent, took: document.documentElement.dataset.took};
"""
MOVE = """
for (const [name, place] of Object.entries(arguments[0])) {
  const input = document.querySelector(`#sliders input[name=${name}]`);
  input.value = place;
  input.dispatchEvent(new Event("input"));
}
"""
#: The share of the picture of the part that is not white.
DRAWN = """
const gl = document.getElementById("view").getContext("webgl2");
const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
const read = new Uint8Array(4 * w * h);
gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, read);
let dark = 0;
for (let i = 0; i < read.length; i += 4) dark += read[i] < 250;
return dark / (w * h);
"""
#: Numbers of dark and of light pixels without a hue: the stripes of doubtful sites alone have them.
HATCHED = """
const gl = document.getElementById("view").getContext("webgl2");
const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
const read = new Uint8Array(4 * w * h), count = [0, 0];
gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, read);
for (let i = 0; i < read.length; i += 4) {
  const own = Array.from(read.subarray(i, i + 3)), most = Math.max(...own);
  if (most - Math.min(...own) > 2) continue;
  count[0] += most < 30;
  count[1] += most > 150 && most < 255;
}
return count;
"""
#: What the legend of a map says: the quantity, and names of colours that are not on the scale.
MAP_LEGEND = """
page.picture();
return ["what", "doubtful", "without"].map((id) => {
  const one = document.getElementById(id);
  return one.offsetParent ? one.textContent.trim() : "";
});"""


@pytest.fixture(scope="module")
def browser():
    with Browser() as one:
        yield one


@pytest.mark.slow
def test_nothing_in_a_title_is_markup(tmp_path):
    hit = ao.simulate(MODEL, STRIKER, LAW, DURATION)
    page = ao.write_report(hit, tmp_path / "a.html", title="z_motor/<b>rhs-2.stl")
    assert "<h1>z_motor/&lt;b&gt;rhs-2.stl</h1>" in page.read_text(encoding="utf-8")


def opened(browser, page, width=1300):
    """Open a page, and wait until it has struck; what the page before asked for is forgotten."""
    browser.requested()
    browser.open(page, width)
    for _ in range(300):
        if browser.run("return document.documentElement.dataset.ready"):
            return browser.run(READ)
        time.sleep(0.05)
    raise AssertionError(browser.said())


def simulated(sliders, model=MODEL, law=LAW):
    damped = replace(model, damping=ao.Damping(sliders["damping"]))
    striker = ao.RigidMass(sliders["mass"], sliders["speed"])
    law = ao.Hertz(sliders["stiffness"])
    return ao.simulate(damped, striker, law, DURATION, gap=sliders["gap"], tol=1e-6)


def same(cells, hit):
    for name in NAMES:
        assert cells[name] == pytest.approx(getattr(hit, name), rel=1e-6), name


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_sliders_move_what_simulate_computes(browser, tmp_path, width):
    hit = ao.simulate(MODEL, STRIKER, LAW, DURATION, tol=1e-6)
    page = ao.write_report(tmp_path / "report.html", hit, title=HOSTILE)
    before = opened(browser, page, width)
    same(before["cells"], hit)
    assert before["title"] == HOSTILE  # text, not elements
    assert before["width"] <= width
    assert "computed" in before["marked"]
    browser.run(MOVE, {"mass": 60, "speed": 120, "stiffness": 140, "gap": 3, "damping": 40})
    moved = browser.run(READ)
    assert moved["sliders"]["mass"] < 0.2
    assert moved["sliders"]["speed"] > 1.5
    same(moved["cells"], simulated(moved["sliders"]))
    assert moved["marked"] != before["marked"]
    browser.run("document.getElementById('back').click()")
    assert browser.run(READ)["cells"] == before["cells"]
    asked = [one for one in browser.requested() if not one.startswith("data:")]
    assert set(asked) <= {page.resolve().as_uri()}
    assert browser.said() == []


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A small plate, its model, and a map of it."""
    pytest.importorskip("dolfinx")
    geo = tmp_path_factory.mktemp("plate") / "plate.geo"
    geo.write_text(
        'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.2, 0.15};\n'
        'Physical Surface("plate") = {1}; Physical Curve("rim") = {1, 2, 3, 4};\n'
    )
    mesh = ao.read_mesh(geo, size=0.02, gdim=3)
    material = ao.Shell(E=70e9, nu=0.33, rho=2700.0, thickness=4e-3, yield_strength=2e8)
    part = ao.Structure(mesh, material, [ao.Support("rim")])
    site = ao.Site((0.08, 0.07, 0.0), (0, 0, -1), radius=2e-3)
    return part, ao.extract(part, site, n=12, error="estimate")


@pytest.mark.fem
@pytest.mark.slow
def test_a_slider_through_yield_moves_numbers_and_keeps_sentences(browser, plate, tmp_path):
    part, model = plate
    ball = ao.Sphere(0.01, material="bearing steel 100Cr6", velocity=1.0)
    hit = ao.simulate(model, ball, duration=DURATION)
    page = ao.write_report(hit, tmp_path / "report.html", part)
    before = opened(browser, page)
    cards = """return [...document.querySelectorAll("#cards dd")].map((one) =>
      [one.textContent, one.classList.contains("before")]);"""
    first = browser.run(cards)
    peaks = {"von_mises": ao.peak_field(part, hit)}
    answers = cards_of_history(hit, hit.error_budget, peaks)
    assert [text for text, _ in first] == [card.text for card in answers]
    assert before["cells"]["dent"] == pytest.approx(hit.dent.depth, rel=1e-4)
    assert hit.error_budget.shown("peak_force", 3) == browser.run(
        "return page.cells.peak_force[0].textContent"
    )
    browser.run(MOVE, {"speed": 20})
    time.sleep(0.6)
    slow, told = browser.run(READ), browser.run(cards)
    other = ao.simulate(model, replace(ball, velocity=slow["sliders"]["speed"]), duration=DURATION)
    dent = 0.0 if other.dent is None else other.dent.depth
    assert slow["cells"]["dent"] == pytest.approx(dent, rel=1e-3)
    assert told[0] == [first[0][0], True]  # it is of the computed case, and grey
    assert told[1] == [engineering(other.peak_force, "N"), False]  # without a bar
    peak = ao.peak_field(part, other).margin().value
    assert slow["cells"]["largest_stress"] == pytest.approx(peak, rel=0.25)
    browser.run("document.getElementById('back').click()")
    assert browser.run(cards) == first
    assert browser.said() == []


@pytest.mark.fem
@pytest.mark.slow
def test_a_part_is_drawn_turned_and_played(browser, plate, tmp_path):
    part, model = plate
    hit = ao.simulate(model, STRIKER, LAW, DURATION)
    page = ao.write_report(tmp_path / "part.html", hit, part)
    opened(browser, page)
    still = browser.run(DRAWN)
    assert still > 0.05
    browser.run("page.part.view.turn += 1; page.part.view.draw()")
    assert browser.run(DRAWN) != still
    kinds = browser.run("return [...document.querySelectorAll('#kind option')].map((o) => o.value)")
    assert kinds == ["stress", "motion", ""]  # the coloured part comes first
    # stresses are means of the cells here, and the largest of them in `peak_field`
    for kind, quantity, rel in (("motion", "displacement", 0.02), ("stress", "von_mises", 0.3)):
        largest = browser.run(
            """Object.assign(page, {kind: arguments[0], frame: 30});
            page.picture();
            return Math.max(...page.part.sizes(page.kind, page.part.states[30].x));""",
            kind,
        )
        time = browser.run("return page.part.times[30]")
        field = ao.peak_field(part, hit, quantity, times=[time])
        assert largest == pytest.approx(field.values.max(), rel=rel)
    # the stress below the striker is seen through it; the set-up shows it as it is
    cover = """page.kind = arguments[0];
        page.picture();
        return page.part.view.meshes.get("ball").cover;"""
    assert [browser.run(cover, kind) for kind in ("", "stress")] == [1, pytest.approx(0.15)]
    # the bar is that of the computed case
    bar = browser.run("return page.bar")
    assert bar == pytest.approx(hit.error_budget["peak_force"].total, rel=1e-9)
    browser.run(MOVE, {"stiffness": 190})
    assert browser.run("return page.bar") == 0


@pytest.fixture(scope="module")
def mapped(plate, tmp_path_factory):
    """A map of the plate, and its report."""
    part, _ = plate
    points = [(x, y, 0.0) for x in (0.03, 0.07, 0.11, 0.15) for y in (0.04, 0.08, 0.12)]
    found = ao.impact_map(
        part, points, STRIKER, LAW, DURATION, direction=(0, 0, -1), radius=2e-3, accuracy=1.0,
        stress=True,
    )  # fmt: skip
    return found, ao.write_report(tmp_path_factory.mktemp("map") / "map.html", found, part)


@pytest.mark.fem
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*times the radius")  # of a coarse plate
@pytest.mark.parametrize("width", WIDTHS)
def test_a_click_on_a_map_strikes_the_model_there(browser, mapped, width):
    found, page = mapped
    assert page.stat().st_size < 1e6
    assert opened(browser, page, width)["width"] <= width
    assert browser.run(DRAWN) > 0.05
    i = 7
    browser.run(
        """const view = document.getElementById("view"), {sites} = page;
        const [x, y] = sites.view.seen(sites.at(arguments[0]));
        const box = view.getBoundingClientRect(), at = {clientX: box.x + x, clientY: box.y + y,
          pointerId: 1, bubbles: true};
        view.setPointerCapture = () => {};
        view.dispatchEvent(new PointerEvent("pointerdown", at));
        view.dispatchEvent(new PointerEvent("pointerup", at));""",
        i,
    )
    assert browser.run("return page.site") == i
    read = browser.run(READ)
    same(read["cells"], ao.simulate(found.model(i), STRIKER, LAW, DURATION, tol=1e-6))
    forces = browser.run(
        """page.sites.strike(page.engine, page.set, page.blow);
        return Array.from(page.sites.values.peak_force);"""
    )
    assert forces == pytest.approx(found.peak_force, rel=3e-3)
    browser.run(
        """const kind = document.getElementById("kind");
        kind.value = "exposure";
        kind.dispatchEvent(new Event("change"));"""
    )
    assert "yield strength" in browser.run("return document.getElementById('what').textContent")
    high = browser.run("return document.getElementById('high').textContent")
    assert float(high) == pytest.approx(found.exposure.max(), rel=5e-3)
    assert browser.run(f"page.data.sites.doubtful.fill(false); {MAP_LEGEND}")[1:] == ["", ""]
    some = "const {exposure} = page.data.sites.quantities; exposure[0] = exposure[1] = NaN;"
    assert browser.run(some + MAP_LEGEND)[1:] == ["", "no result"]
    first = "page.data.sites.doubtful[0] = true;"
    plain = browser.run(HATCHED)
    assert browser.run(first + MAP_LEGEND)[1:] == ["doubtful", "no result"]
    assert plain == [0, 0]
    assert min(browser.run(HATCHED)) > 3
    every = browser.run("page.data.sites.doubtful.fill(true);" + MAP_LEGEND)
    assert "all sites doubtful" in every[0]
    assert every[1] == ""  # none is hatched
    low, high = browser.run("return page.sites.range('exposure')")
    assert (low, high) == pytest.approx((found.exposure[2:].min(), found.exposure[2:].max()))
    colours = browser.run("return Array.from(page.sites.view.meshes.get('dots').values)")
    assert {-1, 0, 1} <= set(colours)
    dots = browser.run(
        """const faces = Uint32Array.of(0, 1, 2, 1, 2, 3, 3, 4, 5), alone = [6];
        const shade = Float32Array.of(0, 1, 1, -1, 1, -3, -1);
        return page.sites.bare.call({data: {faces, alone}}, shade);"""
    )
    assert dots == [4, 6]  # in no triangle that has colours
    told = browser.run(
        """const {quantities} = page.data.sites;
        quantities.k0 = quantities.k0.map((_, i) => 10 ** (i / 5));
        page.data.sites.doubtful.fill(false);
        const kind = document.getElementById("kind");
        kind.value = "k0";
        kind.dispatchEvent(new Event("change"));
        const colours = page.sites.view.meshes.get("dots").values;
        return [document.getElementById("what").textContent, Array.from(new Set(colours))];"""
    )
    assert "logarithmic: in the middle 12.6 N/m" in told[0]  # of 1 to 158
    assert np.diff(told[1][:12]) == pytest.approx(1 / 11, rel=1e-4)


@pytest.mark.slow
def test_the_page_lives_without_webgl(browser, tmp_path, monkeypatch):
    script = assets.page_script().replace('.getContext("webgl2"', '.getContext("none"')
    monkeypatch.setattr(assets, "page_script", lambda: script)
    hit = ao.simulate(MODEL, STRIKER, LAW, DURATION, tol=1e-6)
    page = ao.write_report(tmp_path / "flat.html", hit)
    same(opened(browser, page)["cells"], hit)
    assert browser.run("return document.body.className") == "live flat"


@pytest.fixture(scope="module")
def fallen(tmp_path_factory):
    """The fall of a box, and its report."""
    ends = [(x, y, z) for x in (-0.06, 0.06) for y in (-0.03, 0.03) for z in (-0.01, 0.01)]
    sites = {f"corner{k}": (end, (0, 0, 1)) for k, end in enumerate(ends)}
    box = ao.RigidBody(0.2, (1e-4, 2e-4, 3e-4), sites)
    steel = ao.Solid(E=210e9, nu=0.3, rho=7850.0)
    fall = ao.drop(box, 0.3, tilt=(10, 5, 0), floor=ao.Floor(steel), until=3)
    return fall, ao.write_report(tmp_path_factory.mktemp("fall") / "fall.html", fall)


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_a_fall_is_shown_on_its_path_and_each_impact_can_be_chosen(browser, fallen, width):
    fall, page = fallen
    assert opened(browser, page, width)["width"] <= width
    assert browser.run(DRAWN) > 0.05
    peaks = fall.impacts.column("peak_force")
    assert browser.run("return page.impact") == peaks.argmax()
    told = browser.run(
        """return [...document.querySelectorAll("#numbers tr")].map((row) =>
          [...row.querySelectorAll("td")].map((cell) => cell.textContent));"""
    )
    for cells, peak, shock in zip(told, peaks, fall.shocks, strict=True):
        assert cells[0].startswith(engineering(peak, "N"))
        assert cells[2] == f"{plain_number(shock.g, 3)} g"
    for k, one in enumerate(fall.impacts):
        low = browser.run(
            """document.querySelectorAll("#numbers button")[arguments[0]].click();
            const points = page.view.meshes.get("part").points;
            const heights = Array.from(points).filter((_, i) => i % 3 === 2);
            return [page.data.time[page.frame], Math.min(...heights)];""",
            k,
        )
        assert low == pytest.approx([one.time, 0.0], abs=1e-4)  # it stands on the floor there
    browser.run(
        """const kind = document.getElementById("kind");
        kind.value = "whole";
        kind.dispatchEvent(new Event("change"));
        page.pick(...page.view.seen(page.data.impacts[0].place).slice(0, 2));"""
    )
    assert browser.run("return page.impact") == 0
    assert browser.said() == []
