"""Radius of the patch, anti-oscillators and duration that a scene leaves to its runs ("auto")."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.errors import NOTE, ChoiceWarning, weight
from antiosc.impact.histories.linear_theory import asks_for_stretch
from antiosc_app.scene_file.document import SceneFileError, read
from antiosc_app.scene_file.settled import settled
from antiosc_app.until_parted import (
    DURATION,
    LONGER,
    Choice,
    duration_of_map,
    next_count,
    until_parted,
)

#: A lid of 50 × 40 × 6 mm, held at one end.
LID = """\
[geometry]
source = "lid.geo"
size = 4e-3
[material]
name = "ABS"
[[supports]]
plane = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
[sites.tip]
point = [0.04, 0.02, 0.006]
direction = [0.0, 0.0, -1.0]
radius = RADIUS
snap = true
[extract]
n = 12
[impactor]
kind = "Sphere"
radius = 0.01
material = "bearing steel 100Cr6"
velocity = 1.0
[simulate]
duration = DURATION
"""
BOX = 'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 0.05, 0.04, 0.006};\n'


def scene(folder, radius='"auto"', duration='"auto"', more=""):
    (folder / "lid.geo").write_text(BOX)
    path = folder / "lid.toml"
    path.write_text(LID.replace("RADIUS", radius).replace("DURATION", duration) + more)
    return path


def hit_of(document):
    found = settled(document)
    return found.scene.document.data, found.evaluate(found.scene.history)


@pytest.mark.slow
def test_a_patch_that_nobody_gave_carries_the_largest_force_of_a_sweep(tmp_path):
    alone, first = hit_of(read(scene(tmp_path, duration="4e-4")))
    sweep = "[sweep]\nimpactor.velocity = [1.0, 20.0, 5.0]\n"
    swept, _ = hit_of(read(scene(tmp_path, duration="4e-4", more=sweep)))
    small, large = (data["sites"]["tip"]["radius"] for data in (alone, swept))
    assert small < large
    assert swept["impactor"]["velocity"] == 1.0
    assert np.sqrt(0.01 * first.deepest) < 0.6 * small  # Hertz's radius √(R δ)
    faster = read(scene(tmp_path, str(large), "4e-4"))
    faster.data["impactor"]["velocity"] = 20.0
    _, hit = hit_of(faster)
    assert hit.peak_force > first.peak_force
    faster.data["sites"]["tip"]["radius"] = small  # a number is kept
    with pytest.raises(ao.AccuracyError, match="radius"):
        hit_of(faster)


@pytest.mark.fem
def test_the_warnings_of_the_hardest_blow_of_a_sweep_are_not_those_of_the_scene(tmp_path):
    """A clip was told an error of 25 % beside a bar of 16 %: that of its striker at 2 m/s."""
    found = []
    for sweep in ("", "[sweep]\nimpactor.velocity = [30.0, 0.05]\n"):
        path = scene(tmp_path, duration="4e-4", more=sweep)
        light = 'kind = "RigidMass"\nmass = 0.01\ntip_radius = 0.01\n'
        text = path.read_text().replace('kind = "Sphere"\nradius = 0.01\n', light)
        path.write_text(text.replace("n = 12", "n = 4").replace("y = 1.0", "y = 0.05"))
        told = settled(read(path)).scene.warnings
        found.append([message for message in told if weight(message) != NOTE])
    assert found == [[], []]


@pytest.mark.fem
@pytest.mark.slow
def test_a_patch_that_nobody_gave_carries_the_lowest_yield_strength_too(tmp_path):
    """Else the error of the law is that of a patch that does not carry it."""
    steel = "yield_strength = 400e6\nyield_range = [200e6, 450e6]"
    path = scene(tmp_path, duration="2e-4")
    text = path.read_text().replace("velocity = 1.0", "velocity = 10.0")
    text = text.replace(
        'name = "ABS"', f'kind = "Solid"\nE = 210e9\nnu = 0.3\nrho = 7850.0\n{steel}'
    )
    text = text.replace("size = 4e-3", "size = 4e-3\nrefine = [[[0.04, 0.02, 0.006], 0.7e-3]]")
    path.write_text(text)
    data, hit = hit_of(read(path))
    softest = replace(hit.law, yield_strength=200e6)
    ao.simulate(hit.model, hit.impactor, softest, 2e-4)  # its patch carries it
    smaller = read(path)
    smaller.data["sites"]["tip"]["radius"] = 0.75 * data["sites"]["tip"]["radius"]
    _, other = hit_of(smaller)  # carries the force of the strength alone
    with pytest.raises(ao.AccuracyError, match="radius"):
        ao.simulate(other.model, other.impactor, softest, 2e-4)


@pytest.mark.fem
def test_more_anti_oscillators_are_taken_until_the_probes_that_are_asked_for_have_converged():
    """The force has enough with 20, and the probe with 60; it does not matter which needs more."""
    model = ao.AntiOscillators(m0=0.02, k0=1e5, m=np.full(20, 0.01), omega=3e3 * np.arange(1, 21))
    model = replace(model, info=replace(model.info, dofs=3000))
    taken = []

    def run(choice):
        taken.append(choice.n)
        return ao.simulate(model, ao.RigidMass(0.05, 1.0), ao.Hertz(1e8), 2e-3)

    def probed(_):
        return {"the largest velocity of probe p": 0.8 if taken[-1] == 20 else 0.02}

    first = Choice(None, 2e-3, keeps_radius=True, keeps_duration=True, n=20)
    with pytest.warns(ChoiceWarning, match="change the largest velocity of probe p by 80 %"):
        _, choice = until_parted(run, lambda hit: hit, first, probed=probed)
    assert choice.n == taken[-1] == 60
    _, choice = until_parted(run, lambda hit: hit, first)
    assert choice.n == 20


@pytest.mark.fem
def test_the_probes_of_a_scene_choose_its_anti_oscillators_too(tmp_path):
    """What is left is below a tenth by half of them, or there are no more to take."""
    probe = '[probes.p]\npoint = [0.01, 0.005, 0.0]\nquantity = "velocity"\nsnap = 0.01\n'
    path = scene(tmp_path, "5e-3", "4e-4", probe)
    path.write_text(path.read_text().replace("n = 12", 'n = "auto"'))
    found = settled(read(path))
    hit, structure = found.evaluate(found.scene.history), found.evaluate(found.scene.structure)
    n = found.scene.document.data["extract"]["n"]
    asked = found.scene.probes["p"].arguments
    with contextlib.suppress(ao.AccuracyWarning):
        error = ao.probe_error(structure, hit, asked["point"], "velocity", snap=0.01)
    assert (error.truncation < 0.1) or n == 400
    alone = read(scene(tmp_path, "5e-3", "4e-4"))
    alone.data["extract"]["n"] = "auto"
    assert settled(alone).scene.document.data["extract"]["n"] < n


@pytest.mark.slow
def test_a_patch_of_strike_that_nobody_gave_carries_the_force(tmp_path):
    path = scene(tmp_path, duration="4e-4")
    text = path.read_text().replace("[extract]\nn = 12\n", "")
    text = text.replace("[simulate]", "[strike]\ntol = 0.4")
    path.write_text(text.replace("velocity = 1.0", "velocity = 30.0"))
    data, hit = hit_of(read(path))
    assert 0.01 * hit.deepest < data["sites"]["tip"]["radius"] ** 2  # Hertz's radius √(R δ)
    smaller = read(path)
    smaller.data["sites"]["tip"]["radius"] = 0.5 * data["sites"]["tip"]["radius"]  # is kept
    with pytest.raises(ao.AccuracyError, match="radius"):
        hit_of(smaller)


def test_a_run_that_nobody_limited_goes_on_until_the_largest_deflection_is_past(tmp_path):
    """A small ball leaves a thin lid long before it bends most."""
    path = scene(tmp_path, "5e-3")
    (tmp_path / "lid.geo").write_text(BOX.replace("0.006", "0.003"))
    thin = path.read_text().replace("0.02, 0.006", "0.02, 0.003")
    path.write_text(thin.replace("radius = 0.01", "radius = 0.002"))
    data, hit = hit_of(read(path))
    duration = data["simulate"]["duration"]
    assert hit.run.time[-1] == duration
    assert hit.contacts[-1][1] < 1e-3
    assert duration_of_map(hit) == max(2e-3, duration)  # no longer for a short contact
    # a cantilever's lowest frequency, 3.516 √(E I / m L³) / 2π
    plastic = ao.material("ABS")
    lowest = 3.516 * 0.003 / 0.05**2 * np.sqrt(plastic.E / (12 * plastic.rho)) / (2 * np.pi)
    assert duration - hit.contacts[-1][1] > 0.8 * 0.5 / lowest
    longer = read(path)
    longer.data["simulate"]["duration"] = 3 * duration
    _, whole = hit_of(longer)
    found, largest = (
        np.abs(one.at(np.linspace(0, end, 2000))["structure"].displacement()).max()
        for one, end in ((hit, duration), (whole, 3 * duration))
    )
    assert found == pytest.approx(largest, rel=0.02)


SHEET = ao.AntiOscillators(m0=0.3, k0=1e6, m=[0.2, 0.15], omega=[3e3, 5.2e3])


@pytest.mark.parametrize("mass", [0.02, 0.16, 0.35, 0.45])
def test_a_run_beside_a_sheet_goes_on_until_the_striker_is_out_of_its_reach(mass):
    """By the same rule for quick strikers and for those that it catches up with."""

    def run(choice):
        return ao.simulate(SHEET, ao.RigidMass(mass, 1.0), ao.Hertz(1e8), choice.duration)

    hit, choice = until_parted(run, lambda one: one, Choice(None), is_sheet=True)
    assert DURATION < choice.duration < LONGER * DURATION
    long = run(Choice(None, 8 * choice.duration))
    assert len(long.contacts) == len(hit.contacts)
    assert hit.impactor_displacement[-1] <= -hit.site_motion.later
    lowest = SHEET.modal().omega[0]
    assert choice.duration >= hit.contacts[-1][1] + np.pi / lowest
    assert long.site_motion.largest <= max(hit.site_motion.largest, hit.site_motion.later)


@pytest.mark.parametrize("bends", [True, False])
def test_second_order_forces_are_those_of_the_last_patch(monkeypatch, bends):
    """They take longer than all else, and a patch that is too small deflects too much."""
    radii = iter([2e-3, 3e-3])
    monkeypatch.setattr("antiosc_app.until_parted.enough_radius", lambda hit: next(radii, None))
    monkeypatch.setattr("antiosc.impact.histories.linear_theory.may_stretch", lambda hit: bends)
    monkeypatch.setattr("antiosc_app.until_parted.may_stretch", lambda hit: bends)
    runs = []

    def run(choice):
        hit = ao.simulate(SHEET, ao.RigidMass(0.02, 1.0), ao.Hertz(1e8), choice.duration)
        runs.append((choice.radius, asks_for_stretch(hit)))
        return hit

    until_parted(run, lambda one: one, Choice(1e-3, 1.0, keeps_duration=True))
    stretched = [(3e-3, True)] if bends else []
    assert runs == [(1e-3, False), (2e-3, False), (3e-3, False), *stretched]


#: Masses that fall as those of a thin plate, which flees from a short contact.
PLATE = ao.AntiOscillators(
    m0=1e-4,
    k0=1e5,
    m=0.05 / np.arange(1.0, 501.0) ** 2,
    omega=2 * np.pi * 300 * np.arange(1, 501),
)


@pytest.mark.parametrize(("stiffness", "n"), [(1e8, 20), (1e9, 150), (1e10, 400)])
def test_the_force_has_as_many_anti_oscillators_as_it_needs(stiffness, n):
    ball = ao.RigidMass(0.02, 1.0)

    def run(choice):
        return ao.simulate(
            PLATE.truncated(choice.n), ball, ao.Hertz(stiffness), choice.duration, tol=1e-4
        )

    with pytest.warns(ChoiceWarning) if n > 20 else contextlib.nullcontext():
        hit, choice = until_parted(run, lambda one: one, Choice(None, n=20))
    whole = ao.simulate(PLATE, ball, ao.Hertz(stiffness), choice.duration, tol=1e-4)
    assert hit.model.n == choice.n == n
    assert hit.peak_force == pytest.approx(whole.peak_force, rel=0.1)


def test_more_anti_oscillators_than_a_large_part_can_have_soon_are_not_taken():
    large = replace(PLATE, info=replace(PLATE.info, dofs=2_000_000))
    assert next_count(20, 0.5, large) == 20
    assert next_count(20, 0.5, PLATE) == 60
    assert next_count(20, 0.01, PLATE) == 20
    assert next_count(400, 0.5, PLATE) == 400


def test_a_scene_with_auto_has_the_number_that_its_force_needs(tmp_path):
    document = read(scene(tmp_path, "5e-3", "4e-4"))
    document.data["extract"]["n"] = "auto"
    data, hit = hit_of(document)
    assert data["extract"]["n"] == hit.model.n == 20
    document.data["extract"]["n"] = 20
    assert hit_of(document)[1].peak_force == hit.peak_force


def test_a_slow_contact_is_run_to_its_end(tmp_path):
    path = scene(tmp_path, "5e-3")
    heavy = 'kind = "RigidMass"\nmass = 0.5\ntip_radius = 0.01\n'
    path.write_text(path.read_text().replace('kind = "Sphere"\nradius = 0.01\n', heavy))
    data, hit = hit_of(read(path))
    released = hit.contacts[-1][1]
    assert 1e-3 < released < data["simulate"]["duration"]
    assert duration_of_map(hit) >= 2 * released  # softer sites are touched longer
    assert hit.restitution >= 0


@pytest.mark.parametrize("site", ["", "[sites.other]\npoint = [0.02, 0.02, 0.006]\n"])
def test_auto_that_is_not_taken_is_told_where_it_is(site, tmp_path):
    text = '"auto"' if site else '"Auto"'
    path = scene(tmp_path, text, "1e-3", site)
    with pytest.raises(SceneFileError, match='"auto" stands for') as caught:
        settled(read(path))
    told = [line for line in str(caught.value).splitlines() if "radius" in line]
    assert len(told) == 1
    line = 1 + path.read_text().splitlines().index(f"radius = {text}")
    assert f"lid.toml:{line}: " in told[0]
