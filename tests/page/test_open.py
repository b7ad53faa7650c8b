"""`antiosc open`: a set-up is a scene, which reruns to its numbers when saved; a page drives it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.base import materials, progress
from antiosc.base.errors import NOTE, InputError, by_weight, warn, warnings_to
from antiosc.base.plausible import GRAVITY
from antiosc.base.texts import (
    engineering,
    exceeds,
    percent,
)
from antiosc.extension import Faces
from antiosc.fem.structure.structure import on_mesh
from antiosc.io.reading import CLOSELY
from antiosc.models.doubts import NEAR, NO_RESULT
from antiosc.reduce.extraction import krylov
from antiosc.reduce.site.sites import located
from antiosc_app import (
    guessed_sites,
    headline,
    inspecting,
    inspection,
    new,
    opened as opened_page,
    results,
    set_up,
    until_parted,
)
from antiosc_app.kept import FreeModeCache
from antiosc_app.scene_file.build import Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import read as read_document
from paths import ROOT
from webdriver import MISSING, Browser
from words import python_in

pytestmark = pytest.mark.fem
#: Largest cell of the angle [m]: a sixth of the cells that the page takes by itself, which strike
#: alike within 0.1 % and answer a set-up in a fifth of the time.
SIZE = 6e-3
CLICK = """
const view = document.getElementById("view"), box = view.getBoundingClientRect();
const [x, y] = bench.view.seen(arguments[0]);
const at = {clientX: box.x + x, clientY: box.y + y, pointerId: 1, bubbles: true,
  shiftKey: arguments[1]};
view.setPointerCapture = () => {};
view.dispatchEvent(new PointerEvent("pointerdown", at));
view.dispatchEvent(new PointerEvent("pointerup", at));
"""
DRAG = """
const view = document.getElementById("view"), box = view.getBoundingClientRect();
const [x, y] = bench.view.seen(page.part.tail());
const at = (dx) => ({clientX: box.x + x + dx, clientY: box.y + y, pointerId: 1, bubbles: true});
view.setPointerCapture = () => {};
view.dispatchEvent(new PointerEvent("pointerdown", at(0)));
view.dispatchEvent(new PointerEvent("pointermove", at(30)));
view.dispatchEvent(new PointerEvent("pointerup", at(30)));
"""
SEEN = """
return ["written", "save"].map((id) => {
  const {top, bottom} = document.getElementById(id).getBoundingClientRect();
  return bottom > top && top > -1 && bottom < innerHeight + 1; // browsers scroll by whole pixels
});
"""
CHOOSE = """
const field = document.querySelector(arguments[0]);
field.value = arguments[1];
field.dispatchEvent(new Event("change"));
"""
READ = """
return {data: {...document.documentElement.dataset}, setup: bench.setup,
  peak: page.hit && page.hit.peak_force, bar: page.bar, settled: page.data.part !== undefined,
  width: document.documentElement.scrollWidth,
  written: document.getElementById("written").textContent,
  wrong: document.getElementById("wrong").textContent,
  stress: page.cells.stress ? page.cells.stress[0].textContent : "",
  verdict: document.getElementById("verdict").textContent};
"""


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    """An angle of 60 mm with a hole, as STEP in millimetres."""
    gmsh = pytest.importorskip("gmsh")
    path = tmp_path_factory.mktemp("open") / "angle.step"
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")  # OpenCASCADE keeps the last one
        occ = gmsh.model.occ
        base, wall = occ.addBox(0, 0, 0, 60, 40, 15), occ.addBox(0, 0, 15, 12, 40, 25)
        both = occ.fuse([(3, base)], [(3, wall)])[0]
        occ.cut(both, [(3, occ.addCylinder(40, 20, -1, 0, 0, 30, 5))])
        occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


@pytest.fixture(scope="module")
def opened(step):
    from antiosc_app.opened import Opened

    one = Opened(step, size=SIZE)
    yield one
    one.close()


def asked(opened, **changed):
    first = opened.calls["look"]({})
    return {**json.loads(json.dumps(first["setup"])), **changed}


def call(opened, name, setup, turn=1, **more):
    found = opened.calls[name]({"tab": "one", "turn": turn, "setup": setup, **more})
    assert python_in(found) == []
    return found


def warned(found):
    return [sentence for _, sentence in found["warnings"]]


def test_a_part_shows_its_faces_and_what_holds_it(opened):
    first = opened.calls["look"]({})
    assert "hole 10 mm (1)" in first["faces"]
    tags, count = first["skin"]["tags"], len(first["faces"])
    assert tags.min() == 1
    assert tags.max() == count
    held = [first["faces"].index(name) + 1 for name in first["setup"]["held"]]
    points = first["skin"]["points"].reshape(-1, 3)
    low = points[first["skin"]["faces"].reshape(-1, 3)[tags == held[0]]]
    assert (low[:, :, 2] == points[:, 2].min()).all()  # the face below
    assert "the underside, z = 0 mm" in first["first_held"]
    assert f"The material {first['setup']['material']} is a guess" in first["first_material"]
    hole = first["skin"]["sets"][first["faces"].index("hole 10 mm (1)")]  # "face 7" beside
    step = first["skin"]["half"] / 32767
    corners = points[first["skin"]["faces"].reshape(-1, 3)[hole]] * step + first["skin"]["middle"]
    away = np.hypot(corners[..., 0] - 0.04, corners[..., 1] - 0.02)
    assert away == pytest.approx(0.005, abs=2 * step)


#: Constants of a material of one's own.
PRINTED = {"E": 2.1e9, "nu": 0.37, "rho": 1200, "yield_strength": 40e6, "yield_range": [25e6, 45e6]}


def test_a_material_of_ones_own_is_as_one_of_the_table_with_its_constants(opened):
    """ABS has no law of the strain rate, so that its constants are all that counts."""
    first = opened.calls["look"]({})
    assert set_up.OWN in first["materials"]
    own = json.loads(json.dumps(first["constants"]["ABS"]))
    named, given = (
        call(opened, "settle", asked(opened, material=name, own=own))["blow"]
        for name in ("ABS", set_up.OWN)
    )
    assert given["computed"]["peak_force"] == named["computed"]["peak_force"]
    assert given["bars"]["shares"] == named["bars"]["shares"]  # the range of the yield strength
    own |= {"yield_strength": None, "yield_range": None}  # which are optional
    told = call(opened, "settle", asked(opened, material=set_up.OWN, own=own))
    assert "Whether the contact yields is not known" in told["verdict"][0]


def test_a_striker_may_be_of_a_material_of_ones_own(opened):
    """The tip of a user's hammer, E 20 MPa and nu 0.48, could not be given on the page."""
    own = {"E": 20e6, "nu": 0.48, "rho": 1100.0, "yield_strength": None}
    peaks = {}
    for kind in ("mass", "ball"):
        striker = asked(opened)["striker"] | {"kind": kind, "mass": 0.1, "radius": 6e-3}
        given = striker | {"material": set_up.OWN, "own": own}
        blow = call(opened, "settle", asked(opened, striker=given))["blow"]
        peaks[kind] = blow["computed"]["peak_force"]
        sections = set_up.scene_of(
            opened._opened(), set_up.read(asked(opened, striker=given)), 1e-3
        )
        impactor = sections["impactor"]
        assert (impactor["E"], impactor["nu"]) == (20e6, 0.48)
        assert ("rho" in impactor) == (kind == "ball")
        assert "material" not in impactor
        assert "yield_strength" not in impactor
    rubber = asked(opened)["striker"] | {"kind": "mass", "mass": 0.1, "radius": 6e-3}
    hard = call(opened, "settle", asked(opened, striker=rubber))["blow"]["computed"]["peak_force"]
    assert peaks["ball"] < peaks["mass"] < 0.5 * hard


@pytest.mark.parametrize("kind", ["ball", "mass"])
def test_an_own_material_of_a_striker_has_no_narrower_bar_than_by_name(opened, kind):
    """The softer side decides, and its strength has a range."""
    own = json.loads(json.dumps(opened.calls["look"]({})["constants"]["ABS"]))
    striker = asked(opened)["striker"] | {"kind": kind, "radius": 6e-3, "mass": 0.01}
    blows = [
        call(opened, "settle", asked(opened, striker=striker | {"material": name, "own": own}))
        for name in ("ABS", set_up.OWN)
    ]
    named, given = (blow["blow"] for blow in blows)
    assert given["computed"]["peak_force"] == named["computed"]["peak_force"]
    assert given["bars"]["shares"] == named["bars"]["shares"]


def test_an_own_material_that_begins_as_another_has_no_narrower_bar(opened):
    own = json.loads(json.dumps(opened.calls["look"]({})["constants"]["steel S235"]))
    bars = [
        call(opened, "settle", asked(opened, material=name, own=own))["blow"]["bars"]["shares"]
        for name in ("steel S235", set_up.OWN)
    ]
    assert bars[1] == bars[0]  # with the growth of its strength by the strain rate
    record = materials.record("steel S235")
    stronger = set_up.OwnMaterial(**own | {"yield_strength": 470e6, "yield_range": None})
    assert stronger.table["rate"] == (*record.rate[:2], 2 * record.rate[2])
    assert "rate" not in set_up.OwnMaterial(**PRINTED).table
    assert "rate" in set_up.OwnMaterial(**own | {"E": 1.05 * own["E"]}).table


@pytest.mark.parametrize("plastic", [{"E": 2.1e9}, {"rho": 1270.0}])
def test_a_plastic_that_begins_as_steel_does_not_grow_as_steel(opened, plastic):
    """By a page, by name, and as a striker's material; a steel of other constants does."""
    own = json.loads(json.dumps(opened.calls["look"]({})["constants"]["steel S235"]))
    assert "rate" not in set_up.OwnMaterial(**own | plastic).table
    assert ao.material("steel S235", **plastic).rate is None
    striker = ao.RigidMass(0.1, 1.0, tip_radius=0.01, material="steel S235", E=2.1e9)
    assert striker.material.rate is None
    alloy = ao.material("steel S235", E=205e9, rho=7800, yield_strength=300e6)
    assert alloy.rate == materials.record("steel S235").rate[:2]  # of this strength, not of S235's


@pytest.mark.parametrize(
    ("changed", "label"),
    [
        ({"own": PRINTED | {"yield_strength": 50e6}}, "range of the yield strength"),
        ({"own": PRINTED | {"nu": 0.5}}, "Poisson's ratio"),
        ({"own": PRINTED | {"E": 0}}, "Young's modulus"),
        ({"own": PRINTED | {"rho": -1}}, "density"),
        ({"striker": {"layer_thickness": 0}}, "layer thickness"),
        ({"striker": {"corner_radius": "x"}}, "corner radius"),
        ({"striker": {"friction": -0.1}}, "friction"),
        ({"striker": {"down": [0, 0, "a"]}}, "what points down"),
        ({"n": 0}, "anti-oscillators"),
        ({"yield_strength": 0}, "yield strength"),
    ],
)
def test_a_refusal_names_the_fields_of_the_page(opened, changed, label):
    with pytest.raises(InputError, match=label) as error:
        call(opened, "settle", asked(opened, **changed))
    assert not re.search(r"[a-z]_[a-z]|\b(E|nu|rho|n)\b", str(error.value))


def test_other_supports_keep_the_mesh_and_a_set_up_is_simulated_once(opened):
    setup = asked(opened)
    held = opened._struck(set_up.read(setup))
    assert opened._struck(set_up.read(setup)) is held
    free = opened._struck(set_up.read(setup | {"held": []}))
    assert free.structure.mesh is held.structure.mesh
    assert free.hit.peak_force != held.hit.peak_force


def test_cells_that_are_undone_are_those_of_before(opened):
    """Of the same mesh, although the structures on it were forgotten: another would differ."""
    setups = [set_up.read(asked(opened, size=size)) for size in (8e-3, 9e-3, 1e-2, 1.1e-2)]
    scenes = [opened._compiled(set_up.scene_of(opened._opened(), one, 1e-3)) for one in setups]
    first = opened._structure(scenes[0])
    for scene in scenes[1:]:
        opened._structure(scene)
    again = opened._structure(scenes[0])
    assert again is not first
    assert again.mesh is first.mesh


def test_the_page_tells_its_work_without_the_names_of_sections(step):
    from antiosc_app.opened import Opened

    one, told = Opened(step, size=SIZE), []
    setup = set_up.read(asked(one))
    one._meshes.clear()
    one._structures.clear()
    with progress.following(told.append):
        one._struck(setup)
    assert any("assembling the part" in text for text in told)
    assert not any("[" in text for text in told)
    one.close()


def test_a_site_whose_patch_an_edge_cuts_comes_last():
    part = ao.Structure(parts.box((8, 6, 2), (0.08, 0.06, 0.02)), ao.material("ABS"), [])
    mesh, down = on_mesh(part).mesh, np.array([0.0, 0.0, -1.0])
    outer = Faces(mesh, False)
    x, faces = mesh.dolfinx.geometry.x, guessed_sites.nodes_around(outer)
    places = [np.array([a, 0.035, 0.02]) for a in (0.077, 0.045, 0.003, 0.035)]
    sites = guessed_sites.clear_of_edges(
        outer, x, faces, iter([(p, down, None) for p in places]), False
    )
    order = [site[0][0] for site in sites]
    assert order == [0.045, 0.035, 0.077, 0.003]
    for a in order:
        radius = guessed_sites.RESOLVED * guessed_sites.facet_size_at(x, faces, (a, 0.035, 0.02))
        place = np.array([[a, 0.035, 0.02]]), down[None], np.array([radius])
        assert (located(on_mesh(part), *place).share[0] < 0.9) == (a in (0.077, 0.003))


@pytest.mark.slow
def test_a_saved_scene_reruns_to_the_numbers_of_the_page(opened, step):
    setup = asked(opened, material=set_up.OWN, own=PRINTED, damping=0.01)
    setup["striker"] |= {"kind": "mass", "mass": 0.2, "radius": 0.02, "speed": 2.0}
    setup["point"], setup["direction"] = [0.0, 0.021, 0.035], [1.0, 0.0, -0.1]
    blow = call(opened, "settle", setup)
    names = opened.calls["save"]({"setup": setup})["names"]
    assert not any(step.with_name(name).exists() for name in names)  # the user is asked first
    with pytest.raises(InputError, match="agreed"):
        call(opened, "write", setup, agreed=["../angle.toml", "angle.html"])
    assert call(opened, "write", setup, agreed=names)["written"] == names
    scene, page = (step.with_name(name) for name in names)
    assert "<script" in page.read_text(encoding="utf-8")
    out = subprocess.run(
        [sys.executable, "-m", "antiosc", "run", scene.name, "--out", "out"],
        cwd=step.parent, capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    assert "peak force" in out.stdout
    again = list((step.parent / "out").glob("*.json"))
    numbers = json.loads(again[0].read_text(encoding="utf-8")) if again else {}
    for name in ("peak_force", "impulse", "contact_time"):
        computed = blow["blow"]["computed"][name]
        assert found_in(numbers, name) == pytest.approx(computed, rel=1e-6), name
    assert opened.calls["save"]({"setup": setup})["names"] == ["angle_2.toml", "angle_2.html"]
    for path in (scene, page):
        path.unlink()


@pytest.mark.slow
def test_warnings_stay_with_the_set_up_that_they_concern(opened):
    setup = asked(opened, point=[0.03, 0.001, 0.015], direction=[0, 0, -1], radius=4e-3)
    for step in ("blow", "settle", "fields", "verdict"):  # later steps take the model of the first
        assert "edge cuts" in " ".join(warned(call(opened, step, setup))), step
    faces = opened.calls["look"]({})["faces"]
    free = next(name for name in faces if name not in setup["held"])
    forces = call(opened, "map", setup, where=free)
    assert not any(sentence.startswith("An edge cuts") for sentence in warned(forces))
    assert f"sites of {free}, each" in forces["about"]  # not the site that was struck before
    offer = forces["offer"]
    assert 0 < offer["fewer"] <= offer["sites"]
    assert 0 < offer["seconds"][0] < offer["seconds"][1]
    some = call(opened, "map", setup, where=free, stress=offer["sites"] - 1)
    assert f"at {offer['sites'] - 1} of {offer['sites']} sites" in " ".join(some["verdict"])
    assert some["offer"]["seconds"][0] > 0  # by the rate of these
    stressed = call(opened, "map", setup, where=free, stress=offer["sites"])
    assert stressed["offer"] is None
    sites = stressed["map"]["sites"]
    assert "exposure" not in forces["map"]["sites"]["names"]
    most = np.nanmax(sites["quantities"]["exposure"])
    told = next(
        sentence for sentence in stressed["verdict"] if "stresses the part most" in sentence
    )
    assert f"{most:.3g} of the yield strength" in told
    assert sites["quantities"]["exposure"][stressed["worst"]] == most  # it is chosen
    sure = ~np.array(sites["doubtful"])
    sought = np.isfinite(sites["quantities"]["exposure"])
    assert np.array_equal(sure, sought)  # doubtful sites count in nothing


def test_patches_of_a_map_grow_until_they_carry_its_forces(opened, monkeypatch):
    """A third of 305 sites of a pin with cells of 0.15 mm had none that carried its force."""
    asked_for = []

    def struck(set_up, blow, group, most, radius):
        assert most == 9
        asked_for.append(radius.least)
        reason = "" if radius.least > 5e-4 else NO_RESULT
        return SimpleNamespace(reasons=np.array(50 * [NEAR] + 50 * [reason]))

    monkeypatch.setattr(opened, "_map_with", struck)
    blow = SimpleNamespace(model=SimpleNamespace(patch_radius=3e-4))
    found = opened._impact_map(set_up.read(asked(opened)), blow, None, 9)
    assert NO_RESULT not in found.reasons
    assert asked_for == pytest.approx([0.0, 3e-4, 6e-4])
    asked_for.clear()
    blow.model.patch_radius = None  # of a point load: there is no patch that could grow
    opened._impact_map(set_up.read(asked(opened)), blow, None, 9)
    assert asked_for == [0.0]


def test_anti_oscillators_of_the_page_are_those_of_its_map_too(opened, monkeypatch):
    """A wide bar by truncation names this field."""
    asked_for = []
    monkeypatch.setattr(opened_page.antiosc, "impact_map", lambda *_, n, **__: asked_for.append(n))
    hit = SimpleNamespace(impactor=None, duration=1e-3)
    monkeypatch.setattr(opened_page, "duration_of_map", lambda hit: hit.duration)
    blow = SimpleNamespace(structure=None, hit=hit)
    for n in (None, 80):
        opened._map_with(set_up.read(asked(opened, n=n)), blow, None, None, None)
    assert asked_for == [None, 80]


@pytest.mark.slow
def test_the_stress_has_the_errors_of_mesh_and_force(opened):
    setup = asked(opened)
    # The contact stays elastic: near one that yields Hertz's stress counts.
    setup["striker"]["speed"] = 1e-3
    found = call(opened, "verdict", setup)
    blow = opened._struck(set_up.read(setup))
    peak = ao.peak_field(blow.structure, blow.hit, sharp_edges=False)
    value, error = peak.values[peak.judged], peak.largest_mesh_error
    least, largest = peak.margin().others  # that another place has within its own error
    force = blow.hit.error_budget["peak_force"].total  # which the stress follows
    low, high = max(value - error, least) / value, max(value + error, largest) / value
    ends = low * (1 - force), high * (1 + force)
    assert found["judged"]["stress_bar"] == pytest.approx((1 - ends[0], ends[1] - 1))
    assert found["judged"]["scope"] == peak.margin().scope
    told = rf"that stress [±+] ?{re.escape(percent(ends[1] - 1))}"
    assert any(re.search(told, sentence) for sentence in found["verdict"])


def test_a_run_that_the_page_makes_longer_leaves_no_warning(opened):
    setup = asked(opened)
    setup["striker"] |= {"kind": "mass", "mass": 0.5, "material": "PE-HD", "speed": 1.0}
    told = call(opened, "settle", setup)
    contact_time = told["blow"]["computed"]["contact_time"]
    assert until_parted.DURATION < contact_time < told["blow"]["duration"]
    assert "duration" not in " ".join(warned(told))
    assert told["place"]["radius"] == setup["striker"]["radius"]  # the tip, not a ball of its mass


@pytest.mark.slow
def test_a_run_goes_on_until_the_bodies_part_or_says_that_they_approach(tmp_path):
    from antiosc_app.opened import Opened

    mesh = ao.box_mesh((0.2, 0.02, 0.004), size=0.01)
    part = ao.Structure(mesh, ao.material("steel S235"), [ao.Support("-x")])
    path = tmp_path / "tongue"
    path.touch()
    one = Opened(path, part)
    try:
        setup = asked(one, point=[0.195, 0.01, 0.004], direction=[0, 0, -1])
        setup["striker"] |= {"kind": "mass", "mass": 0.1, "radius": 0.02, "speed": 0.5}
        short = call(one, "settle", setup | {"duration": 1e-3})
        assert short["blow"]["computed"]["restitution"] < 0
        assert ", still approaching" in " ".join(short["verdict"])
        assert "After the last release the bodies still approach" in short["caution"]
        assert short["blow"]["duration"] == 1e-3
        parted = call(one, "settle", setup)
        assert parted["blow"]["computed"]["restitution"] > 0
        assert "approach" not in parted["caution"]
        told = engineering(parted["blow"]["duration"], "s")
        assert parted["about"].endswith(f"Computed for {told}.")
    finally:
        one.close()


@pytest.mark.filterwarnings("ignore")  # a rod that ends without a support across
def test_a_deck_without_a_density_tells_the_one_that_is_taken(tmp_path):
    from antiosc_app.opened import Opened

    deck = (ROOT / "demos/scenes/bar.inp").read_text(encoding="utf-8")
    path = tmp_path / "bar.inp"
    path.write_text(re.sub(r"\*DENSITY\n.*\n", "", deck), encoding="utf-8")
    one = Opened(path)
    try:
        first = one.calls["look"]({})
        assert "density 7850 kg/m³, for the deck has none; a field" in first["told"]
        assert first["unstated"] == {"density": 7850}
        setup = asked(one)
        masses = [
            one._struck(set_up.read(setup | {"density": rho})).structure.mass
            for rho in (None, 15700)
        ]
        assert masses[1] == pytest.approx(2 * masses[0])
    finally:
        one.close()


@pytest.mark.slow
def test_the_size_of_the_cells_is_that_of_a_set_up(opened, step):
    """Of the mesh, of the patch, which has a size by the mesh, and of the scene that is saved."""
    first = opened.calls["look"]({})
    size = first["size"]
    setups = [asked(opened, size=part) for part in (None, size, size / 2)]
    meshes = [opened._struck(set_up.read(setup)).structure.mesh for setup in setups]
    assert meshes[0].n_cells == meshes[1].n_cells
    assert meshes[2].n_cells > 4 * meshes[1].n_cells
    found = [call(opened, "blow", setup) for setup in setups[1:]]
    assert found[1]["site"]["radius"] < 0.8 * found[0]["site"]["radius"]
    names = opened.calls["save"]({"setup": setups[2]})["names"]
    assert call(opened, "write", setups[2], agreed=names)["written"] == names
    scene, page = (step.with_name(name) for name in names)
    text = scene.read_text(encoding="utf-8")
    assert tomllib.loads(text)["geometry"]["size"] == size / 2
    sensor = re.sub(r"(?m)^# (?=\[probes|point|quantity|filter|srs)", "", text)
    scene.write_text(sensor, encoding="utf-8")
    assert compiled(read_document(scene)).spectra
    for path in (scene, page):
        path.unlink()


@pytest.mark.filterwarnings("ignore")  # of sections that are guessed
@pytest.mark.parametrize("name", ["meshes/beam.msh", "demos/scenes/bar.inp", "tests/decks/mpc.inp"])
def test_finished_meshes_and_decks_have_a_size_unless_constraints_join_their_nodes(name):
    from antiosc_app.opened import Opened

    one = Opened(ROOT / name)
    try:
        first = one.calls["look"]({})
        size = first["size"]
        keeps = name.endswith("mpc.inp")
        assert (size == 0) == keeps == ("keeps its elements" in first["told"])
        if keeps:
            with pytest.raises(InputError, match="keeps its elements"):
                call(one, "blow", asked(one, size=1e-3))
            return
        counts = [
            one._struck(set_up.read(asked(one, size=part))).structure.mesh.n_cells
            for part in (None, size / 2)
        ]
        assert counts[1] in (2 * counts[0], 8 * counts[0])
        assert len(call(one, "settle", asked(one, size=size / 2))["verdict"]) > 0
    finally:
        one.close()


def found_in(table, name):
    """The first number of a name in nested tables."""
    for key, value in table.items():
        if key == name:
            return value
        if isinstance(value, dict) and (inner := found_in(value, name)) is not None:
            return inner
    return None


@pytest.mark.slow
def test_free_modes_answer_a_click_as_the_extracted_model_does(opened):
    setup = asked(opened, point=[0.05, 0.03, 0.015], direction=[0, 0, -1])
    settled = call(opened, "settle", setup)
    call(opened, "speeds", setup)
    for _ in range(300):
        if opened.warm:
            break
        time.sleep(0.2)
    opened._models.clear()
    opened._impacts.clear()
    quick = call(opened, "blow", setup)
    assert (quick["settled"], settled["settled"]) == (False, True)
    one, other = (each["blow"]["computed"]["peak_force"] for each in (quick, settled))
    assert one == pytest.approx(other, rel=0.01)
    assert quick["blow"]["bars"]["shares"] == {}
    assert not any("error bar" in sentence for sentence in [*quick["verdict"], quick["caution"]])
    assert settled["blow"]["bars"]["shares"]["peak_force"]["mesh"] > 0


@pytest.mark.slow
def test_free_modes_are_searched_once_an_answer_is_whole(opened, monkeypatch):
    """Between its steps a round of the search would delay the next one."""
    rounds = []
    monkeypatch.setattr(FreeModeCache, "search", lambda self: rounds.append(self))
    setup = asked(opened, size=0.9 * SIZE)  # of other cells, whose modes are not known
    for name in ("blow", "settle", "fields", "verdict"):
        call(opened, name, setup)
        opened._work.submit(opened._search_modes).result()
        assert rounds == []
    call(opened, "speeds", setup)
    opened._work.submit(len, "").result()
    assert len(rounds) == 1


def test_a_call_that_is_overtaken_is_not_computed(opened):
    setup = asked(opened)
    opened._turns["two"] = 7
    late = opened.calls["settle"]({"tab": "two", "turn": 6, "setup": setup})
    assert late["stale"]
    assert "blow" not in late


def test_work_that_is_stopped_ends_at_its_next_step(opened, monkeypatch):
    setup = asked(opened)
    first = call(opened, "settle", setup)
    models = list(opened._models)

    @contextmanager
    def doing(text, rank=0):  # the user stops while the model is extracted
        opened.calls["stop"]({"tab": "three", "turn": 5})
        with progress.doing(text, rank) as further:
            yield further

    moved = setup | {"point": [0.05, 0.01, 0.015], "direction": [0.0, 0.0, -1.0]}
    with monkeypatch.context() as patched:
        patched.setattr(krylov, "doing", doing)
        late = opened.calls["settle"]({"tab": "three", "turn": 4, "setup": moved})
    assert late == {"stale": True}
    assert list(opened._models) == models
    again = opened.calls["settle"]({"tab": "three", "turn": 5, "setup": setup})
    assert again["blow"]["computed"]["peak_force"] == first["blow"]["computed"]["peak_force"]
    assert opened.calls["settle"]({"tab": "three", "turn": 6, "setup": moved})["settled"]


def test_work_ends_at_its_next_step_when_the_page_is_closed(step):
    """The end of the process waits for the thread that computes."""
    from antiosc_app.opened import Opened

    one, begun = Opened(step), threading.Event()

    def endless():
        while True:
            with progress.doing("a step"):
                begun.set()
                time.sleep(0.01)

    with ThreadPoolExecutor(2) as pool:
        answer = pool.submit(one._computed, endless)
        assert begun.wait(10)
        waits = pool.submit(one._computed, endless)
        while one._work._work_queue.empty():
            time.sleep(0.01)
        one.close()
        for answered in (answer, waits):
            assert answered.result(timeout=10) == {"stale": True}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of parts whose sections are guessed
@pytest.mark.parametrize("name", ["meshes/beam.msh", "meshes/plate.msh", "demos/scenes/bar.inp"])
def test_beams_sheets_and_decks_are_struck(name):
    from antiosc_app.opened import Opened

    one = Opened(ROOT / name)
    try:
        first = one.calls["look"]({})
        setup = json.loads(json.dumps(first["setup"])) | {"duration": 1e-2, "n": 10}
        assert len(first["skin"]["tags"]) == len(first["skin"]["faces"])
        assert (setup["material"] == "") == name.endswith(".inp")
        found = call(one, "settle", setup)
        assert found["blow"]["computed"]["peak_force"] > 0
        assert call(one, "fields", setup)["part"] is not None
        if not setup["material"]:  # a deck has a field for what it does not state
            weak = call(one, "blow", setup | {"yield_strength": 5e6}, turn=2)
            assert "It yields from" in " ".join(weak["verdict"])
            assert "It yields from" not in " ".join(found["verdict"])
    finally:
        one.close()


@pytest.mark.slow
@pytest.mark.parametrize("striker", ["ball", "mass", "hammer"])
def test_every_striker_strikes(opened, striker):
    setup = asked(opened)
    setup["striker"] |= {"kind": striker}
    assert call(opened, "blow", setup)["blow"]["computed"]["peak_force"] > 0


def test_a_patch_that_is_too_small_for_the_force_grows(opened):
    setup = asked(opened)
    small = call(opened, "blow", setup)["site"]["radius"]
    setup["striker"] |= {"kind": "hammer", "name": "IK10"}
    grown = call(opened, "blow", setup)
    assert grown["site"]["radius"] > small
    weights = [weight for weight, told in grown["warnings"] if "The patch has grown to" in told]
    assert weights == [NOTE]  # a choice, no caution
    with pytest.raises(ao.AccuracyError) as told:  # one that is given is kept
        call(opened, "blow", {**setup, "radius": small})
    told_radius = re.search(r"patch radius of at least (\S+) mm", str(told.value))[1]
    assert call(opened, "blow", {**setup, "radius": 1e-3 * float(told_radius)})["blow"]


@pytest.fixture
def block(tmp_path):
    """A block of few elements, as a mesh file in metres."""
    gmsh = pytest.importorskip("gmsh")
    path = tmp_path / "block.msh"
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, 0, 0.06, 0.04, 0.02)
        gmsh.model.occ.synchronize()
        for name in ("MeshSizeMin", "MeshSizeMax"):
            gmsh.option.setNumber(f"Mesh.{name}", 0.02)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of a mesh that is coarse
def test_a_part_falls_on_the_face_that_is_clicked_and_its_scene_falls_alike(block):
    from antiosc_app.opened import Opened

    opened = Opened(block)
    setup = asked(opened)
    setup["striker"] |= {"kind": "floor", "height": 0.2, "down": [1, 0, 0], "tilt": [2, 1, 0]}
    told = call(opened, "settle", setup)
    impacts = told["fall"]["impacts"]
    first = told["fall"]["turns"][impacts[0]["frame"]]
    assert first @ [1, 0, 0] == pytest.approx([0, 0, -1], abs=0.05)  # the base's end is below
    assert impacts[0]["place"][2] == pytest.approx(0, abs=1e-4)
    assert impacts[0]["curve"]["force"].max() == pytest.approx(impacts[0]["peak_force"], rel=1e-3)
    worst = opened._dropped(set_up.read(setup)).worst
    spans = worst.margin().spans
    stresses = told["fall"]["stresses"]
    assert [one["stress"] for one in stresses] == [span.stress for span in spans]
    assert max(one["stress"] for one in stresses) == pytest.approx(worst.margin().stress)
    forces = [one["peak_force"] for one in impacts]
    assert f"The hardest is impact {forces.index(max(forces)) + 1}, with " in told["about"]
    strongest = impacts[worst.margin().impact - 1]
    bar = results.bar_of_fall(opened._dropped(set_up.read(setup)).fall, worst)
    assert bar == strongest["bar"] > 0
    assert stresses[worst.margin().impact - 1]["bar"] == headline.stress_bar(worst, bar)
    names = opened.calls["save"]({"setup": setup})["names"]
    call(opened, "write", setup, agreed=names)
    scene, page = (block.with_name(name) for name in names)
    again = compiled(read_document(scene))
    fall = Evaluation(again.document)(again.fall)
    peaks = fall.impacts.column("peak_force")
    assert peaks == pytest.approx([one["peak_force"] for one in impacts], rel=1e-6)
    text = page.read_text(encoding="utf-8")
    assert "falls from" in text
    with pytest.raises(InputError, match="no map"):
        call(opened, "map", setup)
    opened.close()


def test_finer_mesh_of_a_fall_is_where_its_impacts_strike(opened):
    setup = asked(opened)
    places = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]]
    setup["striker"] |= {"kind": "floor", "finer": places}
    geometry = set_up.scene_of(opened._opened(), set_up.read(setup), 1e-3)["geometry"]
    assert [place for place, _ in geometry["refine"]] == places
    assert all(0 < size < opened._opened().look.size for _, size in geometry["refine"])
    setup["striker"]["kind"] = "ball"
    struck = set_up.scene_of(opened._opened(), set_up.read(setup), 1e-3)
    assert "refine" not in struck["geometry"]


@pytest.mark.slow
def test_a_fall_tells_where_its_stress_is_largest_for_a_finer_mesh_there(block):
    from antiosc_app.opened import Opened

    opened = Opened(block)
    setup = asked(opened, material="ABS")
    setup["striker"] |= {"kind": "floor", "height": 0.5}
    found = call(opened, "settle", setup)["fall"]
    worst = opened._dropped(set_up.read(setup)).worst
    (at,) = np.flatnonzero((worst.points == found["stressed"]).all(axis=1))
    outside = [
        np.linalg.norm(worst.points - zone[:3], axis=1) > zone[3] for zone in worst.margin().beyond
    ]
    assert worst.values[at] == pytest.approx(worst.values[np.all(outside, axis=0)].max())
    opened.close()


@pytest.mark.slow
@pytest.mark.parametrize("unresolved", [False, True])
def test_a_wide_bar_takes_more_anti_oscillators_and_finer_cells(unresolved, step, monkeypatch):
    """Once, where the page leaves both open; what is asked for stays."""
    from antiosc_app import opened as page
    from antiosc_app.opened import Opened

    class Budget(dict):
        """That of cells too large for the wave has no share of the mesh."""

    Budget.unresolved = unresolved

    def budget(hit):
        few = 0.4 if hit.model.n < 100 else 0.01
        of_cells = {"mesh": 0.0, "patch": None} if unresolved else {"mesh": 0.2, "patch": 0.15}
        return Budget(peak_force=SimpleNamespace(truncation=few, total=0.8, **of_cells))

    monkeypatch.setattr(page.run, "error_budget", budget)
    opened = Opened(step)
    setup = asked(opened, size=0.02, duration=1e-4)
    assert setup["finer"] is None
    first = opened._struck(set_up.read(setup), quickly=True)  # shown while the better one is made
    assert (first.settled, first.refining) == (False, page.COARSE)
    assert page._taken(first) == {"n": 20, "size": 0.02, "finer": False}
    for given, told, taken in (
        ({}, 2, {"n": 150, "size": 0.02, "finer": True}),
        ({"n": 8, "finer": False}, 0, {"n": 8, "size": 0.02, "finer": False}),
    ):
        messages = []
        with warnings_to(messages.append):
            blow = opened._struck(set_up.read({**setup, **given}))
        assert page._taken(blow) == taken
        texts = [m for m in messages if m.startswith(("150 anti-oscillators", "The cells around"))]
        assert len(texts) == told
        if told:
            assert "change the peak force by 40 %" in texts[0]
            assert ("had no error bar" if unresolved else "35 % of error") in texts[1]
            # thirds of the cells were not enough: thirds of these, and a patch that they resolve
            ((_, size),) = blow.sections["geometry"]["refine"]
            coarse, fine = (one.sections["sites"]["struck"]["radius"] for one in (first, blow))
            assert fine == pytest.approx(coarse / set_up.FINER**2, rel=0.1)
            assert fine == pytest.approx(guessed_sites.RESOLVED * size, rel=0.1)
    opened.close()


def test_finer_mesh_is_at_the_site_and_at_the_largest_stress(opened):
    setup = asked(opened)
    place = [0.01, 0.0, 0.0]
    for finer, places in ((False, None), (True, [setup["point"], place])):
        chosen = set_up.read({**setup, "finer": finer, "stressed": [place]})
        geometry = set_up.scene_of(opened._opened(), chosen, 1e-3)["geometry"]
        refined = geometry.get("refine")
        assert (refined and [point for point, _ in refined]) == places
    with pytest.raises(InputError, match="stressed lists at most"):
        set_up.read({**setup, "stressed": 4 * [place]})


def test_forecasts_count_the_smaller_cells_at_the_site(opened):
    """Those of the mesh that is made, on the page and in a new scene."""
    setup = set_up.read(asked(opened, finer=True))
    scene = opened._compiled(set_up.scene_of(opened._opened(), setup, 1e-3))
    look = opened._opened().look
    foreseen = look.forecast(near=opened._smaller_at(setup)).cells
    assert foreseen == pytest.approx(opened._structure(scene).mesh.n_cells, rel=0.15)
    assert foreseen > 1.3 * look.n_cells
    first = replace(look, point=list(setup.point), cell=SIZE / 4, radius=None)
    there = re.search(r"some ([\d ]+) with those at the site", first.sentences("a.step")[0])
    foreseen = look.forecast(near=[(setup.point, SIZE / 4)]).cells
    assert float(there[1].replace(" ", "")) == pytest.approx(foreseen, rel=0.05)
    assert "at the site" not in first.sentences("a.step", drop=True)[0]
    made = replace(first, notes=(f"a.step {CLOSELY} with flat facets.",))
    assert CLOSELY not in " ".join(made.sentences("a.step"))  # of another mesh


def test_a_note_of_the_set_up_is_no_warning_beside_it(opened, monkeypatch):
    asked(opened)
    source = opened._opened()
    note = "gmsh's mesh is 0.34 % off the surface of the file."
    noted = source._replace(look=replace(source.look, notes=(*source.look.notes, note)))
    monkeypatch.setattr(opened, "_source", noted)

    def work():
        warn(note)
        warn("Another warning.")
        return {}

    assert warned(opened._computed(work)) == ["Another warning."]


def test_the_page_goes_on_with_smaller_cells_where_they_narrow_a_wide_stress(opened, monkeypatch):
    """Unless the user has decided on cells, other causes are larger, or it takes long."""
    wide = {"stress_bar": (0.5, 1.5), "of_cells": True, "stress_place": [0.01, 0.0, 0.0]}

    def narrows(judged, **changed):
        return opened._narrows(set_up.read(asked(opened, **changed)), judged)

    assert narrows(wide)
    assert narrows(wide, finer=True)  # at the site alone
    assert not narrows({**wide, "stress_bar": (0.5, 0.9)})
    assert not narrows({**wide, "stress_bar": None})
    assert not narrows({**wide, "of_cells": False})
    assert not narrows({**wide, "stress_place": None})
    assert not narrows({})
    assert not narrows(wide, finer=False)
    assert not narrows(wide, finer=True, stressed=[[0.0, 0.0, 0.0]])
    slow = inspection.forecast_of("tetrahedron", 3, 1e7, [20, 150], 4.0)
    assert slow.told(slow.answer)[0] > opened_page.NARROWED_SOON
    monkeypatch.setattr(opened, "_foreseen", lambda _: slow)
    assert not narrows(wide)


def test_a_later_answer_is_foreseen_with_the_anti_oscillators_that_the_first_needed(
    opened, monkeypatch
):
    """Of a part of 143 000 dofs "64 s to 10 min" stood beside each answer of about 50 s."""
    monkeypatch.setattr(inspection, "LONG", 0.0)
    asked_set_up = asked(opened)
    growing = opened._foreseen(set_up.read(asked_set_up))
    assert len(growing.counts) == len(growing.told(growing.answer)) > 1
    n = call(opened, "settle", asked_set_up, tab="foreseen")["taken"]["n"]
    later = set_up.read(asked(opened, damping=0.02))
    (foreseen,) = opened._answering(later)
    models = sum(count <= n for count in growing.counts)
    assert foreseen == pytest.approx(growing.told(growing.answer)[models - 1])


def test_how_a_mesh_was_made_is_told_of_the_mesh_that_is_shown(opened, monkeypatch):
    """Beside its answer, not of the first mesh; and a note of the file has its name no more."""
    opened.calls["look"]({})
    source = opened._opened()
    made = [f"a.stl {CLOSELY} with {how}." for how in ("all edges", "flat facets")]
    look = replace(source.look, notes=("a.stl: small holes that are closed: 1.", made[0]))
    told = opened_page._told_of_file(look, "a.stl")
    assert told.endswith(". Small holes that are closed: 1.")
    monkeypatch.setattr(opened, "_source", source._replace(look=look))
    for sentence in made:

        def work(sentence=sentence):
            warn(sentence)
            return {}

        assert warned(opened._computed(work)) == [sentence]


def test_a_warning_that_is_among_the_sentences_is_shown_once():
    sentence, warning = "In 1 of 3 impacts it lands askew.", "in 1 of 3 impacts it lands askew"
    assert by_weight([warning, "another", "another"], sentence) == ["another"]


@pytest.mark.slow
def test_page_and_new_scene_begin_with_the_same_striker_and_the_same_fall(opened, step):
    path = step.with_name("written.toml")
    setup = asked(opened)
    for drop in (False, True):
        new.write_scene(path, step, drop=drop, size=SIZE)
        written = tomllib.loads(path.read_text(encoding="utf-8"))
        setup["striker"]["kind"] = "floor" if drop else "ball"
        shown = set_up.scene_of(opened._opened(), set_up.read(setup), 1e-3)
        assert shown.get("impactor") == written.get("impactor")
        assert shown.get("drop", {}) | shown["geometry"] == written.get("drop", {}) | {
            name: value for name, value in written["geometry"].items() if name != "refine"
        }
        for ending in (".toml", ".png"):
            path.with_suffix(ending).unlink()


def test_a_soft_layer_takes_the_place_of_the_material_of_the_floor(opened):
    setup = asked(opened)
    setup["striker"] |= {"kind": "floor", "layer": "cork", "layer_thickness": 0.03}
    floor = set_up.scene_of(opened._opened(), set_up.read(setup), 1e-3)["drop"]["floor"]
    assert "material" not in floor
    layer = ao.SoftLayer(**floor["layer"])
    assert layer.thickness == 0.03
    assert layer.range[0] < layer.E < layer.range[1]
    assert floor["friction"] == set_up.Striker().friction > 0
    setup["striker"]["friction"] = 0.6
    setup["striker"]["layer_modulus"] = 7e6  # one's own has no range
    floor = set_up.scene_of(opened._opened(), set_up.read(setup), 1e-3)["drop"]["floor"]
    assert ao.SoftLayer(**floor["layer"]).E == 7e6
    assert "range" not in floor["layer"]
    assert floor["friction"] == 0.6


@pytest.mark.slow
def test_falls_onto_other_floors_share_the_body_and_do_not_depend_on_each_other(
    tmp_path, monkeypatch
):
    from antiosc_app import opened as module

    def counted(*given):
        built.append(given)
        return free_body(*given)

    built, free_body = [], module.free_body
    monkeypatch.setattr(module, "free_body", counted)
    mesh = ao.box_mesh((0.1, 0.06, 0.02), size=0.02)
    part = ao.Structure(mesh, ao.material("steel S235"))
    (tmp_path / "block").touch()
    page, alone = (module.Opened(tmp_path / "block", part) for _ in range(2))
    for one in (page, alone):
        setup = asked(one)
    setup["striker"] |= {"kind": "floor", "height": 0.05, "tilt": [30, 20, 0]}
    monkeypatch.setattr(module, "LONG", 0.0)
    shortest, longest = page._answering(set_up.read(setup))
    assert 0 < shortest < longest
    peaks = []
    for layer in ("none", "cork"):
        setup["striker"] |= {"layer": layer, "layer_thickness": 0.003}
        peaks.append(peaks_of(call(page, "blow", setup)))
    assert len(built) == 1
    assert page._answering(set_up.read(setup)) == []  # the modes, which take the time, are known
    assert peaks_of(call(alone, "blow", setup)) == pytest.approx(peaks[1], rel=1e-9)
    for one in (page, alone):
        one.close()


def peaks_of(told):
    return [impact["peak_force"] for impact in told["fall"]["impacts"]]


def test_a_limit_is_compared_as_it_is_printed():
    assert not exceeds(0.0204, 0.02, 2)
    assert exceeds(0.0206, 0.02, 2)
    assert exceeds(0.0204, 0.02, 3)


WRONG = [
    {"extra": 1}, {"point": [0, 0]}, {"point": "here"}, {"point": [0, 0, "a"]}, {"held": "face 1"},
    {"held": ["../../etc"]}, {"held": [1]}, {"direction": [0, 0, 0]}, {"radius": -1.0},
    {"radius": "big"}, {"material": "unobtainium"}, {"material": "/etc/passwd"}, {"material": 3},
    {"damping": 2.0}, {"finer": "yes"}, {"thickness": 0}, {"striker": {"kind": "bomb"}},
    {"size": 0}, {"size": "small"},
    {"striker": {"mass": 0.0}}, {"striker": {"path": "x"}}, {"striker": []}, {"point": [9, 9, 9]},
    {"striker": {"tilt": 3}}, {"striker": {"down": [0, 0, "a"]}},
    {"striker": {"kind": "floor", "height": 0}}, {"striker": {"floor": "lava"}},
    {"striker": {"layer": "lava"}}, {"striker": {"layer_thickness": 0}},
    {"material": set_up.OWN}, {"own": 3}, {"own": {"E": 1e9}}, {"own": PRINTED | {"path": "x"}},
    {"own": PRINTED | {"E": {"x = 1\n[output]": 1}}}, {"own": PRINTED | {"nu": 0.5}},
    {"own": PRINTED | {"rho": "heavy"}}, {"own": PRINTED | {"yield_range": [1e6, 2e6]}},
    {"own": PRINTED | {"yield_range": "x"}}, {"own": PRINTED | {"yield_strength": None}},
    {"material": set_up.OWN, "own": PRINTED | {"E": 1e40}},
    {"striker": {"material": set_up.OWN}}, {"striker": {"own": {"E": 1e9}}},
    {"striker": {"own": PRINTED | {"path": "x"}}}, {"striker": {"own": PRINTED | {"nu": 0.5}}},
]  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_a_wrong_set_up_is_refused_in_one_sentence(opened, wrong):
    with pytest.raises(InputError) as error:
        call(opened, "settle", asked(opened, **wrong))
    assert ".toml" not in str(error.value)
    assert python_in(str(error.value)) == []


def test_what_is_written_is_toml():
    table = {
        "title": 'a "b" \\ ü \x7f', "x": {"flag": True, "n": 3, "list": [1.5e-9, [2, 3]]},
        "many": [{"where": "face 1"}, {"plane": [[0.0, 0.0, 0.0], [0, 0, 1]]}],
        "sites": {"struck": {"inner": {"kind": "a", "d": 1e20}}},
    }  # fmt: skip

    assert tomllib.loads(set_up.toml(table)) == table


@pytest.mark.slow
def test_view_shows_a_structure_in_a_frame(step):
    mesh = ao.read_mesh(step, size=8e-3)
    part = ao.Structure(mesh, ao.Solid(E=70e9, nu=0.33, rho=2700.0), [ao.Support("face 1")])
    shown = ao.view(part)
    try:
        assert shown.site is None
        assert f'<iframe src="{shown.address}"' in shown._repr_html_()
        assert "frame-ancestors 'self'" in shown._server.policy
        setup = shown._opened.calls["look"]({})["setup"]
        setup = json.loads(json.dumps(setup))
        shown._opened.calls["settle"]({"tab": "a", "turn": 1, "setup": setup})
        assert isinstance(shown.site, ao.Site)
        assert shown.site.point == tuple(setup["point"])
        with pytest.raises(InputError, match="agreed"):
            shown._opened.calls["write"]({"tab": "a", "turn": 1, "setup": setup})
    finally:
        shown.close()


@pytest.mark.parametrize("part", [3, None, "missing.step"])
def test_what_is_no_part_is_not_shown(part):
    with pytest.raises(InputError):
        ao.view(part)


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


def reached(browser, name, turn):
    """The state of the page once the answer to a set-up has come so far."""
    for _ in range(1200):
        data = browser.run("return {...document.documentElement.dataset}")
        assert "failed" not in data, data
        if int(data.get(name, 0)) >= turn:
            return browser.run(READ)
        time.sleep(0.1)
    raise AssertionError((data, browser.said()))


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_from_a_file_to_a_saved_scene_in_a_browser(command, step):
    with Browser() as browser:
        browser.address(command, 390)
        playing = "return getComputedStyle(document.getElementById('play')).visibility"
        assert browser.run(playing) == "hidden"  # there is nothing yet
        first = reached(browser, "complete", 1)
        assert browser.run(playing) == "visible"
        assert first["bar"] > 0
        assert first["width"] <= 390
        browser.run(CLICK, [0.05, 0.03, 0.015], False)  # on the base
        clicked = reached(browser, "settled", 2)
        assert clicked["setup"]["point"] == pytest.approx([0.05, 0.03, 0.015], abs=5e-4)
        assert clicked["setup"]["direction"] == pytest.approx([0, 0, -1], abs=1e-6)
        browser.run(CLICK, [0.006, 0.02, 0.04], True)  # holds the top of the wall
        held = reached(browser, "drawn", 3)
        assert len(held["setup"]["held"]) == len(first["setup"]["held"]) + 1
        assert held["peak"] != clicked["peak"]
        browser.run(DRAG)
        turned = reached(browser, "settled", 4)
        assert turned["setup"]["direction"] != held["setup"]["direction"]
        browser.run("document.getElementById('undo').click()")
        undone = reached(browser, "complete", 5)
        assert undone["setup"] == held["setup"]
        assert undone["peak"] == pytest.approx(held["peak"], rel=1e-9)
        assert "ield" in undone["verdict"]
        browser.run(
            "bench.change({point: [0.03, 0.001, 0.015], direction: [0, 0, -1], radius: 0.004})"
        )
        at_edge = reached(browser, "complete", 6)
        # by Hertz's pressure, not of the mesh
        assert re.search(r"MPa \+\d+ % −\d+ %", at_edge["stress"])
        assert "edge cuts the patch" in at_edge["wrong"]
        for width, name in ((1300, "angle"), (390, "angle_2")):
            browser.resize(width)
            browser.run("document.getElementById('written').textContent = ''; save.click()")
            time.sleep(1)
            browser.run("document.getElementById('yes').click()")
            for _ in range(600):
                if "Written" in browser.run(READ)["written"]:
                    break
                time.sleep(0.1)
            told = browser.run(READ)["written"]
            assert f"antiosc run {step.with_name(name).resolve()}.toml" in told
            assert browser.run(SEEN) == [True, True]  # the message, and the button beside it
            assert browser.run(READ)["width"] <= width
        report = browser.run("return document.querySelector('#written a').href")
        dimmed = "return [document.body.classList.contains('outdated'), save.disabled]"
        shown = "return [page.hit.peak_force, document.body.classList.contains('outdated')]"
        at_once = browser.run(f"document.getElementById('undo').click(); {shown}")
        assert at_once == [pytest.approx(held["peak"], rel=1e-9), False]  # its answer is known
        assert browser.run(READ)["written"] == ""  # what was written is another set-up
        reached(browser, "complete", 7)
        assert browser.run(dimmed) == [False, False]
        change = "bench.change({point: [9, 9, 9]});"  # no place of the part
        assert browser.run(change + dimmed) == [True, True]  # at once
        assert failed(browser)
        assert browser.run(dimmed) == [True, True]  # the numbers are of the set-up before
        browser.run("document.getElementById('undo').click()")
        stayed = reached(browser, "complete", 9)
        assert stayed["setup"]["point"] != [9, 9, 9]
        assert browser.run(dimmed) == [False, False]
        browser.run("bench.strike(); setTimeout(() => bench.map(), 300)")  # it waits for no picture
        for _ in range(1200):
            if browser.run("return Boolean(bench.page.sites) && !bench.pending"):
                break
            time.sleep(0.1)
        assert browser.run("return [Boolean(bench.page.sites), bench.turn]") == [True, 11]
        time.sleep(2)  # numbers without an answer would be dimmed by now
        assert browser.run(dimmed) == [False, False]
        browser.address(report, 1300)
        assert browser.run("return document.title") == "An impact on angle.step"
        assert browser.run("return document.querySelector('#numbers').rows.length") > 3  # it runs
        assert browser.said() == []
    scene = step.with_suffix(".toml")
    assert scene.exists()
    for path in step.parent.glob("angle*.[th]*ml"):
        path.unlink()


def test_a_structure_is_struck_where_its_supports_leave_it_free():
    mesh = ao.box_mesh((0.1, 0.08, 0.01), size=0.01)
    part = ao.Structure(mesh, ao.material("steel S235"), [ao.Support("+z")])  # the preferred side
    look = inspecting.inspect_structure(part)
    assert look.point[2] < 0.01
    assert look.radius is not None


def test_a_face_that_goes_on_beyond_the_lowest_plane_is_not_held():
    from antiosc_app.skin import skin

    mesh = ao.box_mesh((0.1, 0.08, 0.06), size=0.02)
    both = np.union1d(mesh.groups["-z"][2], mesh.groups["+z"][2]).astype(np.int32)
    one = replace(mesh, groups={"both": {2: both}})
    part = ao.Structure(one, ao.material("steel S235"), [])
    assert skin(part, inspecting._inspect_mesh(one, {}, None)).held == ["side -z of the box, below"]


def test_a_face_of_more_than_half_of_the_surface_is_told():
    """Of a box of 0.1 x 0.08 x 0.06 m the sides along y and z have 28 of the 37.6 parts."""
    from antiosc_app.skin import over_half, places, skin

    mesh = ao.box_mesh((0.1, 0.08, 0.06), size=0.02)
    sides = [mesh.groups[name][2] for name in ("-y", "+y", "-z", "+z")]
    large = replace(mesh, groups={**mesh.groups, "large": {2: np.sort(np.concatenate(sides))}})
    part = ao.Structure(large, ao.material("steel S235"), [])
    shown = skin(part, inspecting._inspect_mesh(large, {}, None))
    told = over_half(shown.data, list(shown.faces))
    assert told == {"large": "large is 74 % of the surface: it holds most of the part."}
    where = places(shown.data, list(shown.faces))
    ends = {"-x": "x = 0 mm", "+x": "x = 100 mm", "+y": "y = 80 mm", "+z": "z = 60 mm"}
    assert {name: where[name] for name in ends} == ends
    assert where["large"] == "50, 40, 30"


def test_a_group_without_parts_is_no_face_to_be_held():
    """As a face whose nodes are merged when the mesh is read."""
    from antiosc_app.skin import skin

    mesh = ao.box_mesh((0.1, 0.08, 0.06), size=0.02)
    with_gone = replace(mesh, groups={**mesh.groups, "gone": {}})
    part = ao.Structure(with_gone, ao.material("steel S235"), [])
    faces = skin(part, inspecting._inspect_mesh(with_gone, {}, None)).faces
    assert {"-x", "+z"} <= {*faces}
    assert "gone" not in faces


def test_the_size_at_a_point_is_that_of_the_facets_under_its_patch():
    """As a site measures it, which warns of facets larger than the patch; those of other sides of
    an edge do not count.
    """
    part = ao.Structure(parts.box((4, 3, 2), (0.08, 0.06, 0.1)), ao.Solid(**parts.STEEL))
    look = inspecting.inspect_structure(part)
    source = set_up.InspectedFile("box", look, {})
    for x in ((0.03, 0.03, 0.1), (0.075, 0.05, 0.1), (0.01, 0.055, 0.1)):
        size = source.size_at(x)
        at = np.array([x]), np.array([[0.0, 0.0, -1.0]]), np.array([set_up.RESOLVED * size])
        assert located(on_mesh(part), *at).size[0] == pytest.approx(size)
        assert size < 0.03 < source.size_at((x[0], 0.0, 0.05))


WHERE = "const {x, y, width, height} = view.getBoundingClientRect(); return [x, y, width, height]"
RED = """
const {gl, canvas} = bench.view, seen = new Uint8Array(4 * canvas.width * canvas.height);
gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, seen);
let count = 0;
for (let i = 0; i < seen.length; i += 4) count += seen[i] > 1.4 * seen[i + 2];
return count;
"""
NAME = "[...document.querySelectorAll('#hold button')].find((one) => one.value === arguments[0])"


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=MISSING)
@pytest.mark.parametrize("width", [1300, 390])
def test_the_picture_stays_where_it_is_and_a_reload_keeps_the_set_up(command, width):
    with Browser() as browser:
        browser.address(command, width)
        for _ in range(300):
            if browser.run("return Boolean(bench.view && bench.view.meshes.has('part'))"):
                break
            time.sleep(0.1)
        places, scale = [browser.run(WHERE)], browser.run("return bench.view.scale()")
        first = reached(browser, "complete", 1)
        places.append(browser.run(WHERE))
        after = browser.run("return bench.view.scale()")
        assert after == pytest.approx(scale, rel=1e-3)  # with the striker from the start
        browser.run(
            "bench.change({point: [0.03, 0.001, 0.015], direction: [0, 0, -1], radius: 4e-3})"
        )
        browser.run(  # the longest that a line may have, with the button of long work
            "bench.busy(1); bench.tell_progress('x '.repeat(200));"
            "document.getElementById('stop').hidden = false"
        )
        places.append(browser.run(WHERE))
        browser.run("bench.busy(-1)")
        changed = reached(browser, "complete", 2)
        assert "edge cuts the patch" in changed["wrong"]
        places.append(browser.run(WHERE))
        assert places == [places[0]] * len(places)

        name = next(name for name in browser.run("return bench.facts.faces") if "hole" in name)
        plain = browser.run(RED)
        for begins, ends in (("mouseenter", "mouseleave"), ("focus", "blur")):
            browser.run(f"{NAME}.dispatchEvent(new Event(arguments[1]))", name, begins)
            assert browser.run(RED) > plain + 50
            browser.run(f"{NAME}.dispatchEvent(new Event(arguments[1]))", name, ends)
            assert browser.run(RED) == plain
        browser.run(f"{NAME}.click()", name)
        held = reached(browser, "settled", 3)
        assert held["setup"]["held"] == [*first["setup"]["held"], name]

        browser.address(command, width)
        again = reached(browser, "settled", 1)
        assert again["setup"] == held["setup"]
        assert "before the page was loaded again" in again["written"]
        browser.run("undo.click()")
        undone = reached(browser, "settled", 2)
        assert undone["setup"] == changed["setup"]

        names = browser.run(
            "return [...document.querySelectorAll('#hold button')].map((one) => one.textContent)"
        )
        assert "hole" in names[0]
        assert names[-1].startswith("face ")
        others = ["face 10", "face 2", "bolt", "hole 12 mm (1)", "hole 5 mm (1)"]
        ordered = browser.run("return bench.in_order(arguments[0])", others)
        assert ordered == ["hole 5 mm (1)", "hole 12 mm (1)", "bolt", "face 2", "face 10"]

        browser.run(CHOOSE, "select[name=material]", set_up.OWN)
        own = reached(browser, "settled", 3)
        assert own["setup"]["own"]["E"] == 210e9  # that of the material before
        browser.run(CHOOSE, "input[name=E]", "70")
        softer = reached(browser, "settled", 4)
        assert softer["setup"]["own"] == {**own["setup"]["own"], "E": 70e9}
        assert softer["peak"] < own["peak"]
        assert softer["width"] <= width
        for changed in ({}, {"E": 1.05 * 210e9}, {"E": 70e9}, {"rho": 1270.0}):
            mine = own["setup"]["own"] | changed
            lent = browser.run("return bench.lent_text(...arguments)", mine, "steel S235")
            assert ("does not grow" in lent) == ("rate" not in set_up.OwnMaterial(**mine).table)
        browser.run(CHOOSE, "input[name=nu]", "0.6")
        rule = "return document.querySelector('input[name=nu]').closest('label').innerText"
        assert "between -1 and 0.5" in browser.run(rule)
        browser.run("undo.click()")
        assert reached(browser, "settled", 5)["setup"] == own["setup"]

        browser.run(CHOOSE, "select[name=of]", set_up.OWN)
        striker = reached(browser, "settled", 6)["setup"]["striker"]
        assert striker["own"]["E"] == 207e9  # that of the bearing steel before
        browser.run(CHOOSE, 'input[name="striker\'s E"]', "0.02")
        rubber = reached(browser, "settled", 7)
        assert rubber["setup"]["striker"]["own"] == {**striker["own"], "E": 2e7}
        assert rubber["setup"]["own"] == own["setup"]["own"]
        assert rubber["peak"] < 0.5 * own["peak"]
        assert browser.said() == []


MAP_BUTTONS = """
return [map, document.getElementById("map-all")].filter((one) => !one.hidden)
  .map((one) => one.textContent);
"""
#: Labels of the fields whose value is the user's where the page could choose it.
OWN_VALUES = """
return [...document.querySelectorAll("#setup .own-value:not([hidden])")]
  .filter((one) => one.offsetParent).map((one) => one.parentElement.firstChild.textContent);
"""
#: The number fields that are shown, each emptied and then given what it cannot be: whether it keeps
#: the text, is marked, has a rule beside it and stays; and what the set-up has then.
TYPED = """
const refused = {}, past = bench.past.length, before = JSON.stringify(bench.setup);
const fields = [...document.querySelectorAll("#setup input[type=number]")];
for (const field of fields.filter((one) => one.name && one.offsetParent)) { // of the set-up
  const row = field.closest("label"), kept = field.value;
  for (const text of field.name === "size" ? ["-1e9"] : ["", "-1e9"]) {
    const signed = row.classList.contains("triple");
    if (text && signed) continue;
    field.value = text;
    field.dispatchEvent(new Event("change"));
    const rule = row.querySelector(".rule"), told = rule && !rule.hidden ? rule.textContent : "";
    const marked = field.getAttribute("aria-invalid") === "true";
    const open = text === "" && bench.past.length > past;
    if (open) bench.undo(bench.past, bench.future);
    else refused[`${field.ariaLabel} ${text}`] = [field.value === text, marked, told, row.hidden];
    field.value = kept;
    field.setAttribute("aria-invalid", false);
    if (rule) rule.hidden = true;
  }
}
return [refused, JSON.stringify(bench.setup) === before];
"""


def failed(browser):
    """The refusal that the page tells."""
    for _ in range(600):
        if wrong := browser.run("return document.documentElement.dataset.failed"):
            return wrong
        time.sleep(0.1)
    raise AssertionError(browser.said())


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_a_refused_set_up_keeps_all_that_was_typed(command):
    with Browser() as browser:
        browser.address(command, 1300)
        first = reached(browser, "complete", 1)
        turn = 1
        for kind in ("ball", "mass", "floor"):
            browser.run(CHOOSE, "select[name=kind]", kind)
            if kind == "floor":
                browser.run(CHOOSE, "select[name='soft layer']", "cork")
            else:
                browser.run(CHOOSE, "select[name=material]", set_up.OWN)
            refused, same = browser.run(TYPED)
            assert same
            assert len(refused) > 12
            for field, (kept, marked, rule, hidden) in refused.items():
                assert (kept, marked, hidden) == (True, True, False), field
                assert "number" in rule or "both ends" in rule, field
        # refused by the server: the set-up stays, and one field of it is mended
        browser.run("bench.change({striker: {...bench.setup.striker, kind: 'ball'}})")
        turn = browser.run("return bench.turn")
        reached(browser, "complete", turn)
        browser.run(CHOOSE, "input[name='direction x']", "0")
        browser.run(CHOOSE, "input[name='direction y']", "0")
        turn = browser.run("return bench.turn")
        reached(browser, "complete", turn)
        browser.run(CHOOSE, "input[name='direction z']", "0")
        assert "direction" in failed(browser)
        assert browser.run("return bench.setup.direction") == [0, 0, 0]
        rule = "return document.querySelector('[name=\"direction z\"]').closest('label').innerText"
        assert "direction" in browser.run(rule).split("\n", 1)[1]
        assert "direction" in browser.run("return document.getElementById('wrong').textContent")
        assert browser.run("return document.body.classList.contains('outdated')") is True
        browser.run(CHOOSE, "input[name='direction z']", "-1")
        again = reached(browser, "complete", turn + 2)
        assert again["setup"]["direction"] == [0, 0, -1]
        assert "direction" not in browser.run(rule).split("\n", 1)[-1].partition("\n")[2]
        assert browser.run("return document.body.classList.contains('outdated')") is False
        browser.run(CHOOSE, "input[name=speed]", "2")
        faster = reached(browser, "complete", turn + 3)
        assert faster["peak"] > again["peak"]
        browser.run("undo.click()")
        assert reached(browser, "complete", turn + 4)["peak"] == pytest.approx(again["peak"])
        # a range goes with the yield strength
        browser.run(CHOOSE, "input[name=yield_strength]", "470")
        doubled = reached(browser, "complete", turn + 5)
        assert doubled["setup"]["own"]["yield_range"] == pytest.approx([470e6, 720e6])
        # a striker that is much heavier than the part, told before it strikes
        browser.run("bench.strike = () => {}; bench.setup.striker.kind = 'mass'")
        over = "return [0.9, 1.1].map((f) => { const s = bench.setup.striker;"
        over += " s.mass = 1000 * f * bench.facts.mass; bench.warn(''); return bench.caution; })"
        below, above = browser.run(over)
        assert below == ""
        assert "has 1100 times the mass of the part" in above
        assert above in browser.run("return document.getElementById('wrong').textContent")
        # smaller cells at the largest stress follow once, and Undo takes them away
        goes_on = "bench.page.data.stress_place = [0.01, 0, 0]; bench.narrow();"
        chosen = "return [bench.setup.finer, bench.setup.stressed]"
        assert browser.run(f"{goes_on} {chosen}") == [True, [[0.01, 0, 0]]]
        assert "follow" in browser.run("return document.getElementById('case').textContent")
        browser.run("undo.click()")
        assert browser.run(f"{goes_on} {chosen}") == [None, []]
        # a typed place turns the direction, and says so
        told = "return document.getElementById('how').textContent"
        assert "has turned" not in browser.run(told)
        browser.run("bench.turned = null; bench.move_to([0, 0.02, 0.03], [])")
        assert browser.run("return bench.setup.direction") == pytest.approx([1, 0, 0], abs=1e-6)
        assert "has turned into the surface" in browser.run(told)
        browser.run("undo.click()")
        assert "has turned" not in browser.run(told)
        assert first["setup"]["own"] is None
        assert browser.said() == []


#: Number fields of all kinds: a constant, a range, the cells, a slider, a coordinate, the striker.
TYPED_INTO = ["E", "yield_range", "size", "damping", "point x", "speed"]
SELECT = """
const fields = document.querySelectorAll(`input[name="${arguments[0]}"][type=number]`);
const last = [...fields].at(-1);
last.focus();
last.select();
return last.value;
"""
FOCUSED = "return [document.activeElement.name, document.activeElement.value]"
ENTER = {"key": "Enter", "windowsVirtualKeyCode": 13, "text": "\r"}


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_a_text_that_is_not_yet_confirmed_outlasts_the_answers_of_the_server(command):
    with Browser() as browser:
        browser.address(command, 1300)
        reached(browser, "settled", 1)
        browser.run(CHOOSE, "select[name=material]", set_up.OWN)
        asked = reached(browser, "settled", 2)["setup"]
        for turn, name in enumerate(TYPED_INTO, 3):
            before = browser.run(SELECT, name)
            browser.command("Input.insertText", text="1.250")
            browser.run("bench.change({duration: 1e-4 * bench.turn})")
            answered = reached(browser, "settled" if turn > 3 else "complete", turn)["setup"]
            assert browser.run(FOCUSED) == [name, "1.250"]
            assert answered == {**asked, "duration": answered["duration"]}  # nor does it count
            browser.run("document.activeElement.value = arguments[0]", before)
        browser.run(SELECT, "speed")
        browser.command("Input.insertText", text="1.250")
        browser.command("Input.dispatchKeyEvent", type="keyDown", **ENTER)  # confirmed, and shown
        assert browser.run("return bench.setup.striker.speed") == 1.25
        assert browser.run(FOCUSED) == ["speed", "1.25"]
        browser.run(SELECT, "speed")
        browser.command("Input.insertText", text="2")
        browser.run("document.activeElement.blur()")  # confirms as well
        assert browser.run("return bench.setup.striker.speed") == 2
        # a height is the speed of a fall from there, in one value
        fallen = 2**2 / (2 * GRAVITY)
        assert float(browser.run(SELECT, "from_height")) == pytest.approx(fallen, rel=1e-3)
        names = browser.run("return Object.keys(bench.setup.striker)")
        browser.run(CHOOSE, "input[name=from_height][type=number]", "0.5")
        assert browser.run("return bench.setup.striker.speed") == pytest.approx(GRAVITY**0.5)
        assert browser.run(SELECT, "speed") == "3.132"
        assert browser.run(SELECT, "from_height") == "0.5"
        assert browser.run("return Object.keys(bench.setup.striker)") == names
        assert browser.said() == []


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_coordinates_that_are_typed_beside_a_map_are_struck():
    mesh = ao.box_mesh((0.06, 0.04, 0.015), size=0.01)
    shown = ao.view(ao.Structure(mesh, ao.material("steel S235"), [ao.Support("-x")]))
    try:
        with Browser() as browser:
            browser.address(shown.address, 1300)
            reached(browser, "complete", 1)
            assert browser.run(MAP_BUTTONS) == ["Map the part"]
            browser.run("bench.face = '+z'; bench.name_map()")
            assert browser.run(MAP_BUTTONS) == ["Map +z", "Map the part"]
            browser.run(CHOOSE, "#most-sites", "9")
            for _ in range(100):
                if takes := browser.run("return document.getElementById('map-takes').textContent"):
                    break
                time.sleep(0.1)
            assert takes.startswith("9 sites, ")  # of the whole part, which was forecast
            browser.run(CHOOSE, "#most-sites", "")
            browser.run("bench.page = null; bench.map()")  # before any answer
            for _ in range(600):
                if browser.run("return Boolean(bench.page && bench.page.sites) && !bench.pending"):
                    break
                time.sleep(0.1)
            assert browser.run(MAP_BUTTONS) == ["Strike this site"]
            assert "sites of +z" in browser.run("return about.textContent")
            hardest = "const {site, sites} = page, of = sites.data.quantities.peak_force, sure ="
            hardest += " of.filter((_, i) => !sites.data.doubtful[i]);"
            assert browser.run(f"{hardest} return of[site] === Math.max(...sure)")
            browser.run("page.choose((page.site + 1) % page.sites.count)")
            told = "return page.remarks.peak_force.textContent"
            assert browser.run(told).startswith("no error bar at this site")
            radius = browser.run("return page.sites.data.radii[page.site]")
            assert browser.run(f"map.click(); {OWN_VALUES}") == []  # before the answer too
            assert browser.run("return python.value") == ""
            there = reached(browser, "settled", browser.run("return bench.turn"))["setup"]
            assert there["radius"] == pytest.approx(radius)  # the patch that the map judged
            assert browser.run(OWN_VALUES) == []
            assert browser.run("return python.value").startswith("Site(")
            browser.run("bench.map()")
            for _ in range(600):
                if browser.run("return Boolean(bench.page.sites) && !bench.pending"):
                    break
                time.sleep(0.1)
            chosen = browser.run("return bench.chosen")
            for axis, value in (("x", "31"), ("y", "17")):  # the second before the first answer
                browser.run(CHOOSE, f"input[name='point {axis}']", value)
            struck = reached(browser, "complete", browser.run("return bench.turn"))["setup"]
            assert struck["point"] == [0.031, 0.017, chosen["point"][2]]
            assert struck["direction"] == chosen["direction"]
            browser.run(CLICK, [0.04, 0.02, 0.015], False)  # on the part, no longer on the map
            turn = browser.run("return bench.turn")
            clicked = reached(browser, "settled", turn)["setup"]
            assert clicked["point"] == pytest.approx([0.04, 0.02, 0.015], abs=5e-4)
            assert clicked["radius"] is None
            assert browser.run(OWN_VALUES) == []
            browser.run("bench.change({radius: 0.004})")  # it stays, says so, and is given back
            browser.run(CLICK, [0.03, 0.015, 0.015], False)
            reached(browser, "complete", browser.run("return bench.turn"))
            assert browser.run(OWN_VALUES) == ["patch radius"]
            browser.run("document.querySelector('.own-value:not([hidden]) button').click()")
            again = reached(browser, "complete", browser.run("return bench.turn"))
            assert again["setup"]["radius"] is None
            assert browser.run(OWN_VALUES) == []
            browser.run("bench.called = 'write'; bench.tell_progress('drawing: Energies')")
            written = browser.run(READ)["written"]
            assert re.search(r"written: drawing: Energies( \(\d+ s\))?$", written)
            told = "{takes: 'of about 3 min', lasted: 125.7, written: 'a.toml'}"
            browser.run(f"bench.tell_progress('drawing', {told})")
            follows = r"^a.toml is written and may be used; its report follows: drawing \("
            assert re.search(rf"{follows}2 min 5 s of about 3 min\)$", browser.run(READ)["written"])
            assert browser.said() == []
    finally:
        shown.close()


@pytest.mark.parametrize(("beside", "cuts"), [(0.58, True), (0.65, False)])
def test_an_edge_that_takes_a_tenth_of_the_load_cuts_a_patch_also_on_small_facets(beside, cuts):
    """The share of Hertz's load on the face up to an edge at d radii is (2 + 3 d - d^3) / 4: 0.886
    and 0.919.
    """
    from antiosc_app import guessed_sites

    outer = Faces(ao.box_mesh((0.1, 0.1, 0.01), size=0.005), sheet=False)
    site = np.array([beside * 0.03, 0.05, 0.01]), np.array([0.0, 0.0, -1.0]), None
    assert (2 + 3 * beside - beside**3) / 4 == pytest.approx(0.9025, abs=0.02)
    assert guessed_sites._cuts_edge(outer, site, 0.03) == cuts
