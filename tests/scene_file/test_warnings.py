"""Warnings in the order of their weight, each once, with remedies that exist for the scene."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

import antiosc as ao
import sheets
import stretched
from abaqus_decks import plate_deck, tied_cell
from antiosc.base.errors import (
    AccuracyWarning,
    ChoiceWarning,
    Message,
    NotTakenWarning,
    by_weight,
    labelled,
    warn,
    warnings_to,
)
from antiosc.base.texts import percent
from antiosc.impact import stretching
from antiosc.impact.histories.bars import CAUSES
from antiosc.models.stretch import NARROWED
from antiosc_app import cli, live
from antiosc_app.opened import Opened
from antiosc_app.scene_file import run
from scene_files import antiosc, written

SCENE = """
[deck]
path = "plate.inp"
unit = "m"
{strength}
[sites.middle]
point = [0.5, 0.5, 0.0]
direction = [0, 0, -1]
snap = true
[extract]
n = 10
[impactor]
kind = "Sphere"
radius = 0.005
material = "bearing steel 100Cr6"
velocity = 0.1
[simulate]
duration = 0.1
[stress]
"""
STRENGTH = "yield_strength = 60e6\n"


def test_what_questions_the_numbers_comes_first_and_nothing_twice():
    kinds = [(ChoiceWarning, "taken"), (NotTakenWarning, "file"), (ao.AntioscWarning, "model")]
    kinds.append((AccuracyWarning, "number"))
    collected: list[str] = []
    with warnings_to(collected.append):
        for _ in range(2):
            for category, text in kinds:
                warn(f"{text}  of\nit", category)
    again: list[str] = []
    with warnings_to(again.append):
        for message in collected:
            warn(message)
    in_order = ["number of it", "model of it", "file of it", "taken of it"]
    assert by_weight(again) == in_order
    told = [labelled(one) for one in by_weight(again)]
    assert told == [f"warning: {one}" for one in in_order[:3]] + ["note: taken of it"]
    assert by_weight(again, "Told: Model of it.") == [one for one in in_order if "mod" not in one]
    warning = Message("It is rough. To narrow it, use smaller cells.", AccuracyWarning)
    (rest,) = by_weight([warning], "The bar is wide: to narrow it, use smaller cells.")
    assert (rest, rest.category) == ("It is rough.", AccuracyWarning)
    assert by_weight([warning], "To narrow it, wait.") == [warning]
    with run.collected_warnings(again):
        pass
    assert again == in_order


@pytest.mark.fem
@pytest.mark.parametrize("strength", ["", STRENGTH])
@pytest.mark.slow
def test_a_run_and_its_report_tell_the_doubt_of_the_force_before_it(tmp_path, capsys, strength):
    written(tmp_path, plate_deck(6), "plate.inp")
    scene = written(tmp_path, SCENE.format(strength=strength))
    assert antiosc("run", scene, "--report", tmp_path / "page.html") == 0
    said = capsys.readouterr()
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    for text in (said.out, page):
        force = re.search("[\n>]peak force", text).start()
        first = text.index("There is no error bar")
        assert first < text.index("The cell at the site measures") < force
        assert text.count("The cell at the site measures") == 1
        assert (
            "(refine in [deck], or size in [deck], which halves all cells: each time 4 times as"
            in text
        )
        assert "refine, or size" not in text
        assert "adds to it, and is not known" in text  # the force of the stress
    assert said.err.startswith("warning: of plate.inp are not taken")
    assert "The cell at the site" not in said.err
    assert page.index("are not taken") > force


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
@pytest.mark.slow
def test_a_deck_that_keeps_its_elements_is_not_told_to_compare_two_cell_sizes(tmp_path, capsys):
    tied = tied_cell({49: (1.0, 1.0), 42: (1.0, 5 / 6)}, (0.2, 0.0), "all")
    written(tmp_path, plate_deck(6).replace("*STEP", f"{tied}\n*STEP"), "plate.inp")
    scene = written(tmp_path, SCENE.format(strength=STRENGTH))
    assert antiosc("run", scene, "--report", tmp_path / "page.html") == 0
    for text in (capsys.readouterr().out, (tmp_path / "page.html").read_text(encoding="utf-8")):
        assert live.COMPARED not in text
        assert "size in [deck]" not in text
    part = Opened(tmp_path / "plate.inp", unit="m")
    try:
        setup = json.loads(json.dumps(part.calls["look"]({})["setup"])) | {"n": 10}
        asked = {"tab": "a", "turn": 1, "setup": setup | {"duration": 0.02}}
        about = part.calls["settle"](asked)["about"]
        told = part.calls["verdict"](asked)
        judged = told["judged"]
    finally:
        part.close()
    assert "strikes plate.inp at" in about
    assert "assembly of" not in about
    assert "force not estimated" in judged["stress_note"]
    assert live.COMPARED not in " ".join([judged["stress_note"], *told["verdict"]])


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
@pytest.mark.parametrize("cell", sheets.CELLS)
def test_the_remedy_of_a_bar_that_lacks_the_mesh_is_one_that_exists(cell):
    part = sheets.plate(8, 0.001, cell=cell)
    site = ao.Site((0.5, 0.5, 0.0), (0, 0, -1))
    model = ao.extract(part, site, n=10, stretch="auto")
    hit = ao.simulate(model, ao.RigidMass(0.05, 1.0), ao.Hertz(1e8), 5e-3)
    budget = hit.error_budget
    note = budget.no_mesh
    possible = "extract with stretch and the error 'estimate'" in note
    assert possible == live.has_bars(part)
    assert "compare two sizes of the cells" in note or possible
    headline = live.headline_of_history(hit, part, budget, {})
    assert headline.footnote == f"There is no error bar. {note}"
    assert "±" not in "".join(dict(headline.numbers).values())
    assert note not in " ".join([headline.caution, *headline.sentences])


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
def test_a_force_without_the_mesh_s_error_has_that_of_the_law_where_it_is_known():
    steel = ao.material("steel S235", thickness=0.002)
    part = ao.Structure(sheets.plate(12, 0.002).mesh, steel, sheets.SIMPLE)
    model = ao.extract(part, ao.Site((0.5, 0.45, 0.0), (0, 0, -1)), n=30, stretch="auto")
    ball = ao.Sphere(0.01, material="steel S235", velocity=0.1)
    hit = ao.simulate(model, ball, "auto", 5e-3)
    bar = hit.error_budget["peak_force"]
    assert bar.law > 0
    assert bar.known == pytest.approx(bar.without_law + bar.law)
    assert hit.error_budget.sides("peak_force") == (bar.known, bar.known)
    assert bar.total is None
    told = hit.error_budget.shown("peak_force")
    assert told.endswith(" N (no error bar)")
    assert f"law {percent(bar.law)}" in hit.error_budget.causes_text("peak_force")


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
@pytest.mark.slow
def test_the_force_is_off_by_no_more_than_is_told_for_too_few_second_order_modes(monkeypatch):
    part = sheets.plate(12, 0.001)
    model = ao.extract(part, ao.Site((0.5, 0.45, 0.0), (0, 0, -1)), n=30, stretch="auto")
    striker = ao.RigidMass(0.2, 1.5)
    exact = ao.simulate(model, striker, ao.Hertz(1e7), 1e-2).peak_force
    monkeypatch.setattr(stretching, "MOST", 6)
    messages: list[str] = []
    with warnings_to(messages.append):
        hit = ao.simulate(model, striker, ao.Hertz(1e7), 1e-2)
    (told,) = (message for message in messages if message.startswith("Second-order forces"))
    motions = next(iter(hit.assembly.stretched.values())).size
    assert f"those of {motions} motions" in told
    assert f"second-order forces of {motions} motions" in hit.summary()
    off = abs(hit.peak_force / exact - 1)
    shares = [share for share in range(1, 300) if f"error of {percent(share / 100)} of" in told]
    assert shares
    assert off <= shares[0] / 100


def test_of_second_order_forces_that_is_doubted_which_is_not_settled():
    last = {"peak_force": 2e-4, "impulse": 1e-3, "deflection": 0.05}

    def told(changes, left_out=()):
        share = stretching.stretch_shares(changes, np.inf)["peak_force"]
        return stretching._not_enough(30, changes, share, 0.01, left_out)

    first = told(last)
    assert first.startswith("Second-order forces leave an error of 22 % of the deflection: ")
    assert "The force holds: they change it by 0.02 %" in first
    assert first.endswith("they change it by 0.02 %.")  # a share: of the whole bar it says nothing
    of_both = told({**last, "peak_force": 0.02})
    assert "holds" not in of_both
    assert of_both.endswith("and more are not taken.")
    of_large = told({**last, "peak_force": 0.2})
    share = 'an error of 90 % of the force (the share "stretch" of its bar) and of 22 %'
    assert of_large.startswith(f"Second-order forces leave {share}")
    assert of_large.endswith(f"To narrow it, {NARROWED}.")
    changes = {**last, "peak_force": 0.02, "impulse": 0.5}
    of_three = told(changes)
    share = stretching.stretch_shares(changes, np.inf)["peak_force"]
    assert f"leave an error of {percent(share)} of the force" in of_three  # as in its bar
    assert "of the impulse (in its bar)" in of_three  # which momentum bounds
    assert "of 22 % of the deflection" in of_three
    of_impulse = told({**last, "impulse": 0.2}, left_out=(10, 12))
    assert "leave an error of the impulse (in its bar)" in of_impulse
    assert "Runs of 10 and 12 motions" in of_impulse


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
@pytest.mark.slow
def test_a_peak_before_the_sheet_stretches_has_no_share_of_its_later_deflection():
    """A plate's force peaked after 11 µs of 60 ms; the later change of its deflection by motions
    stood in the bar of the peak, 30 %, beside a change of the peak of 0.01 %.
    """
    part = sheets.plate(12, 0.001)
    model = ao.extract(part, ao.Site((0.5, 0.45, 0.0), (0, 0, -1)), n=100, stretch="auto")
    for law, striker in (
        (ao.Hertz(1e9), ao.RigidMass(0.01, 30.0)),  # peaks after 14 µs
        (ao.Hertz(1e7), ao.RigidMass(0.2, 3.0)),  # after 3.2 ms, as deep as it goes
    ):
        hit = ao.simulate(model, striker, law, 1e-2)
        linear = ao.simulate(replace(model, stretch=None), striker, law, 1e-2)
        before = stretching.before_peak(hit)
        effect = abs(hit.peak_force / linear.peak_force - 1)
        assert effect <= 2 * before
        assert (effect < 1e-6) == (before < 1e-6)
    assert effect > 0.5
    changes = {"peak_force": 1e-4, "impulse": 1e-3, "contact_time": 0.0, "deflection": 0.2}
    early, late = (stretching.stretch_shares(changes, before) for before in (1e-6, 1.0))
    assert early["peak_force"] < 0.01
    assert late["peak_force"] == pytest.approx(stretching.STRETCH_SAFETY * 0.1)
    assert early["impulse"] == late["impulse"]


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
@pytest.mark.parametrize("stretch", [2, "auto"])
def test_more_second_order_modes_are_the_remedy_only_where_there_are_more(stretch):
    part = sheets.plate(12, 0.001)
    site = ao.Site((0.5, 0.45, 0.0), (0, 0, -1))
    model = ao.extract(part, site, n=100, stretch=stretch)
    hit = ao.simulate(model, ao.RigidMass(0.2, 3.0), ao.Hertz(1e7), 1e-2)
    verdict = " ".join(live.headline_of_history(hit, None, hit.error_budget, {}).sentences)
    told = verdict.split("comes from the stretch, ")[1].split(":")[0]
    bar = hit.error_budget["peak_force"]
    large = [share for c in CAUSES if (share := getattr(bar, c)) >= live.LEAST_TOLD]
    assert re.findall(r"\S+ %", told) == [percent(share) for share in sorted(large)[::-1]]
    assert ("larger number of motions" in verdict) == (stretch == 2)
    assert (NARROWED in verdict) == (stretch == "auto")


@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
@pytest.mark.parametrize("tol", [1e-3, 0.5])
def test_a_smaller_tol_is_no_remedy_where_no_more_motions_are_taken(tol, monkeypatch):
    """Those of the last motions have no bounded energy, so that fewer than there are remain."""
    body = stretched.model("auto", size=5)
    marched = stretching.with_rows

    def with_unbounded(a, by_body):
        (forces,) = by_body.values()
        sign = -1e3 if forces.size == body.stretch.size else 1.0
        return marched(a, {"structure": replace(forces, cubic=sign * forces.cubic)})

    monkeypatch.setattr(stretching, "with_rows", with_unbounded)
    law = ao.Power(5e8, 1.5)
    hit = ao.simulate(body, ao.RigidMass(0.3, velocity=1.0), law, 0.008, tol=tol)
    assert hit.assembly.stretched["structure"].size < body.stretch.size
    assert ("smaller tol" in live._remedy_of_stretch(hit)) == (tol == 0.5)
    assert (NARROWED in live._remedy_of_stretch(hit)) == (tol == 1e-3)


def test_a_warning_that_no_command_collects_is_one_line_and_told_once(capsys, monkeypatch):
    def warning(_arguments: object) -> int:
        for _ in range(2):
            warn("The mesh\nis coarse.")
        return 0

    monkeypatch.setattr(cli, "_run", warning)
    assert cli.main([]) == 0
    assert capsys.readouterr().err == "warning: The mesh is coarse.\n"


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")
def test_the_program_of_a_report_is_the_one_that_its_policy_permits(tmp_path):
    """Words of the program are those of advice, too, which a scene has in its own keys."""
    written(tmp_path, plate_deck(6), "plate.inp")
    scene = written(tmp_path, SCENE.format(strength="").replace("[stress]\n", ""))
    assert antiosc("run", scene, "--report", tmp_path / "page.html") == 0
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    (program,) = re.findall(r"<script>(.+?)</script>", html, re.S)
    assert live.ASKED_STRENGTH in program
    digest = hashlib.sha256(program.encode()).digest()
    assert f"'sha256-{base64.b64encode(digest).decode()}'" in unescape(html)
    assert "give yield_strength in [deck]" in html
