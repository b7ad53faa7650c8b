"""`tradeoff`: its bars hold, its members are those of a direct calculation, the best is chosen."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.impact.histories.bars import QUANTITIES, ErrorBar, ErrorBudget
from antiosc.strikes.tradeoff import (
    BRACKETING_SHARE,
    ComputedMember,
    Tradeoff,
    TradeoffMember,
)
from antiosc_app.cli import main
from antiosc_app.commands import with_strike
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import read_document
from parts import STEEL, plate

pytestmark = [
    pytest.mark.fem,
    pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning"),
]
SHEET = ao.Solid(**STEEL, plane="stress", thickness=0.01)
HELD = [ao.Support("left")]
SITE = ao.Site((0.25, 0.1), (0, -1), radius=0.012)
IMPACT = (ao.RigidMass(0.5, 1.0), ao.Hertz(1e10), 1e-3)
TOL = 0.02


@pytest.fixture(scope="module")
def tried() -> Tradeoff:
    mesh = plate((6, 2), (0.3, 0.1), "triangle")
    return ao.tradeoff(mesh, SITE, *IMPACT, tol=TOL, material=SHEET, supports=HELD, order=1)


@pytest.mark.slow
def test_bars_hold_against_another_mesh(tried):
    part = ao.Structure(plate((48, 16), (0.3, 0.1)), SHEET, HELD)
    true = ao.simulate(ao.extract(part, SITE, n=60), *IMPACT, tol=1e-6)
    dofs = [one.dofs for one in tried.table]
    assert dofs == sorted(dofs)
    assert len(set(dofs)) > 1
    finest = tried.table[-1]
    assert finest.bar <= BRACKETING_SHARE * TOL
    assert "for tol = 2 %" in tried.hit.message  # what was asked for, not the half
    assert finest.difference == 0.0
    for one in tried.table:
        error = abs(one.peak_force / true.peak_force - 1)
        assert error <= one.bar
        assert error <= one.difference + finest.bar


@pytest.mark.slow
def test_members_are_what_extract_and_simulate_give():
    part = ao.Structure(plate((12, 4), (0.3, 0.1)), SHEET, HELD)
    found = ao.tradeoff(part, SITE, *IMPACT, tol=TOL)
    assert len({one.n for one in found.table}) == len(found.table) > 1
    assert "Only one mesh was tried, that of the given structure." in found.summary()
    for one in found.table:
        model = ao.extract(part, SITE, n=one.n, error="estimate").corrected()
        hit = ao.simulate(model, *IMPACT, tol=1e-4)
        assert hit.peak_force == pytest.approx(one.peak_force, rel=2e-3)
        assert one.dofs == part.dofs
        assert one.size == pytest.approx(np.sqrt(0.03 / 48))


def ended(*notes: str) -> SimpleNamespace:
    """A history with these notes."""
    bars = {name: ErrorBar(1.0, 0.0, 0.0, 0.0, 0.0, law=0.0) for name in QUANTITIES}
    return SimpleNamespace(error_budget=ErrorBudget(bars, 0.0, notes))


def some(*each: tuple[float, float]) -> Tradeoff:
    """Members with these seconds and bars."""
    one = TradeoffMember("Solid", 1e-3, 2, 100, 20, 1e-6, 1.0, 0.1, 1.0, 0.1)
    table = tuple(replace(one, seconds=seconds, bar=bar) for seconds, bar in each)
    return Tradeoff(table, 0.01, ended())  # type: ignore[arg-type]


def test_the_best_and_the_front():
    found = some((1.0, 0.1), (2.0, 0.2), (3.0, 0.04), (4.0, 0.01), (9.0, 0.02))
    assert found.best(tol=0.05).seconds == 3.0
    assert found.best(seconds=3.5).bar == 0.04
    assert [one.seconds for one in found.front] == [1.0, 3.0, 4.0]
    assert (found.status, found.message.partition(";")[0]) == (
        0,
        "The cheapest within 1 %: N = 20, 100 dofs, 4.00 s",
    )
    missed = replace(found, tol=0.005, hit=ended("A doubt.", "No room."))
    assert missed.message == "The least bar is 1 %, tol 0.5 %. No room."
    with pytest.raises(ao.InputError, match="no member has a bar"):
        found.best(tol=0.001)
    with pytest.raises(ao.InputError, match="no member takes"):
        found.best(seconds=0.5)
    for given in ({}, {"tol": 0.1, "seconds": 1.0}):
        with pytest.raises(ao.InputError, match="one of tol and seconds"):
            found.best(**given)


@pytest.mark.parametrize(("peak", "bar"), [(0.996, 0.005), (0.99, 0.012)])
def test_a_bar_below_the_difference_covers_it(peak, bar):
    def member(peak_force, own):
        hit = SimpleNamespace(peak_force=peak_force, impulse=1.0, contact_time=1.0)
        return ComputedMember(SimpleNamespace(hit=hit), SITE, replace(some((1.0, own)).table[0]))

    finest = member(1.0, 0.002)
    one = member(peak, 0.005).compared_with(finest)
    assert one.difference == pytest.approx(1 - peak)
    assert one.bar == pytest.approx(bar)
    assert repr(finest.compared_with(finest)) == repr(finest.member)  # it has NaN


@pytest.mark.slow
def test_other_methods_stand_beside_the_table(tried):
    part = ao.Structure(plate((12, 4), (0.3, 0.1)), SHEET, HELD)
    found = ao.tradeoff(part, SITE, *IMPACT, tol=TOL, compare=60.0)
    other = found.others[0]
    assert other.method == "unreduced"
    assert other.dofs == part.dofs
    true = ao.simulate(ao.extract(part, SITE, n=80), *IMPACT, tol=1e-6)
    for name in ("peak_force", "impulse", "contact_time"):
        assert getattr(other, name) == pytest.approx(getattr(true, name), rel=1e-3)
    last = found.table[-1]
    apart = abs(other.peak_force / last.peak_force - 1)
    assert apart * (1 - apart) <= other.difference
    lines = [*found.table, *found.others, *found.notes]
    assert len(found.summary().splitlines()) == 1 + len(lines)
    assert "unreduced" in [line.get_label() for line in found.plot().axes[0].lines]
    assert found.best(tol=TOL) in found.table
    assert found.numbers()["others"][0]["bar"] is None


def test_the_mesh_of_a_scene_of_one_simulation_is_varied(tmp_path):
    (tmp_path / "scene.toml").write_text(
        SCENE.replace("PLATE", "bracket.step")
        + "\n[extract]\nn = 20\n[simulate]\nduration = 2e-4\n[output]\ncsv = true\n"
    )
    data = with_strike(read_document(tmp_path / "scene.toml")).data
    assert data["strike"] == {"tol": 0.02, "duration": 2e-4}
    assert not {"extract", "simulate"} & set(data)
    assert {"material", "supports", "sites", "impactor", "contact"} <= set(data)


@pytest.mark.parametrize("kind", ["step", "msh"])
def test_strike_meshes_a_geometry_whatever_its_size_says(tmp_path, kind):
    source = str(Path(__file__).parents[1] / "meshes" / f"bracket.{kind}")
    sized = f'source = "{source}"\nsize = 0.01\n'
    text = (
        SCENE.replace('source = "PLATE"\nsize = 14e-3\n', sized)
        + "\n[strike]\ntol = 0.05\nduration = 2e-4\n"
    )
    (tmp_path / "scene.toml").write_text(text)
    given = compile_document(read_document(tmp_path / "scene.toml")).history.arguments["source"]
    assert (given == source) == (kind == "step")  # a finished mesh is read in that size


@pytest.mark.slow
def test_picture_and_table(tried, tmp_path):
    assert tried.plot(tmp_path / "chart.png").stat().st_size > 1000
    assert len(tried.summary().splitlines()) == len(tried.table) + 1


BLOCK = """SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0.035, 0.04, 0.08, 0.04};
Physical Volume("part") = {1}; Physical Surface("clamp") = {5};
"""
SCENE = """
[geometry]
source = "PLATE"
size = 14e-3

[material]
kind = "Solid"
E = 70e9
nu = 0.33
rho = 2700.0

[[supports]]
where = "clamp"

[sites.tip]
point = [0.020, 0.040, 0.075]
direction = [0, -0.6, -0.8]
radius = 12e-3
snap = true

[impactor]
kind = "RigidMass"
mass = 0.5
velocity = 1.0

[contact]
kind = "Linear"
stiffness = 1e6
"""


@pytest.mark.slow
def test_of_a_scene_file(tmp_path, capsys):
    (tmp_path / "block.geo").write_text(BLOCK)
    text = SCENE.replace("PLATE", "block.geo") + "\n[simulate]\nduration = 2e-4\n"
    (tmp_path / "scene.toml").write_text(text)
    chart = tmp_path / "chart.png"
    given = ["tradeoff", str(tmp_path / "scene.toml"), "--tol", "0.9", "--chart", str(chart)]
    given += ["--compare", "1e-9"]
    start = time.perf_counter()
    assert main([*given, "--report", str(tmp_path / "page.html")]) == 0
    elapsed = time.perf_counter() - start
    assert chart.exists()
    assert "<h2>Speed against accuracy</h2>" in (tmp_path / "page.html").read_text()
    page = (tmp_path / "page.html").read_text()
    assert "unreduced: not run" in page
    assert "<h2>Scene</h2>" in page
    assert "scene.toml, antiosc" in page  # the origin
    printed = capsys.readouterr().out
    assert "all, to finest: the largest of those of peak force" in printed
    assert "The contact's law was given: its error is not in these bars." in printed
    assert "unreduced: not run" in printed
    told = re.search(r"In all (\S+) s, of which the methods took (\S+) s", printed)
    assert told is not None
    whole, methods = map(float, told.groups())
    assert methods <= whole <= 1.01 * elapsed


def test_a_scene_without_one_impact_is_refused(tmp_path, capsys):
    bracket = Path(__file__).parents[1] / "meshes" / "bracket.geo"
    text = SCENE.partition("[impactor]")[0].replace("PLATE", str(bracket))
    (tmp_path / "scene.toml").write_text(text + "[extract]\nn = 3\n")
    assert main(["tradeoff", str(tmp_path / "scene.toml")]) == 1
    assert "needs [strike], or [simulate]" in capsys.readouterr().err
