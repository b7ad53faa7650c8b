"""Radius of the patch, anti-oscillators and duration that a scene leaves to its runs ("auto")."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.impact.histories.site_motion import INITIAL_DURATION, LONGER
from antiosc_app.scene_file.compiled import AutoValues
from antiosc_app.scene_file.document import read_document
from antiosc_app.scene_file.settled import repeat_until_enough, settle

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
    found = settle(document)
    return found.scene.document.data, found.evaluation(found.scene.history)


@pytest.mark.slow
def test_a_patch_that_nobody_gave_carries_the_largest_force_of_a_sweep(tmp_path):
    alone, first = hit_of(read_document(scene(tmp_path, duration="4e-4")))
    sweep = "[sweep]\nimpactor.velocity = [1.0, 20.0, 5.0]\n"
    swept, _ = hit_of(read_document(scene(tmp_path, duration="4e-4", more=sweep)))
    small, large = (data["sites"]["tip"]["radius"] for data in (alone, swept))
    assert small < large
    assert swept["impactor"]["velocity"] == 1.0
    assert np.sqrt(0.01 * first.deepest) < 0.6 * small  # Hertz's radius √(R δ)
    faster = read_document(scene(tmp_path, str(large), "4e-4"))
    faster.data["impactor"]["velocity"] = 20.0
    _, hit = hit_of(faster)
    assert hit.peak_force > first.peak_force
    faster.data["sites"]["tip"]["radius"] = small  # a number is kept
    with pytest.raises(ao.AccuracyError, match="radius"):
        hit_of(faster)


SHEET = ao.AntiOscillators(m0=0.3, k0=1e6, m=[0.2, 0.15], omega=[3e3, 5.2e3])


@pytest.mark.parametrize("mass", [0.02, 0.16, 0.35, 0.45])
def test_a_run_beside_a_sheet_goes_on_until_the_striker_is_out_of_its_reach(mass):
    """By the same rule for quick strikers and for those that it catches up with."""

    def run(choice):
        hit = ao.simulate(SHEET, ao.RigidMass(mass, 1.0), ao.Hertz(1e8), choice.duration)
        return hit, hit

    hit, choice = repeat_until_enough(
        run, AutoValues(), add_oscillators=False, extend_duration=True
    )
    assert INITIAL_DURATION <= choice.duration < LONGER * INITIAL_DURATION
    long, _ = run(AutoValues(duration=8 * choice.duration))
    assert len(long.contacts) == len(hit.contacts)


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
        model = PLATE.truncated(choice.oscillator_count)
        hit = ao.simulate(model, ball, ao.Hertz(stiffness), choice.duration, tol=1e-4)
        return hit, hit

    hit, choice = repeat_until_enough(run, AutoValues(), add_oscillators=True, extend_duration=True)
    whole = ao.simulate(PLATE, ball, ao.Hertz(stiffness), choice.duration, tol=1e-4)
    assert hit.model.n == choice.oscillator_count == n
    assert hit.peak_force == pytest.approx(whole.peak_force, rel=0.1)


def test_a_part_that_has_no_more_anti_oscillators_is_run_as_it_is():
    ball = ao.RigidMass(0.02, 1.0)
    asked = []

    def run(choice):
        asked.append(choice.oscillator_count)
        assert len(asked) < 9
        model = PLATE.truncated(min(choice.oscillator_count, 70))
        return None, ao.simulate(model, ball, ao.Hertz(1e10), choice.duration, tol=1e-4)

    repeat_until_enough(run, AutoValues(), add_oscillators=True, extend_duration=False)
    assert asked == [20, 60, 150]


@pytest.mark.slow
def test_a_scene_with_auto_has_the_number_that_its_force_needs(tmp_path):
    document = read_document(scene(tmp_path, "5e-3", "4e-4"))
    document.data["extract"]["n"] = "auto"
    data, hit = hit_of(document)
    assert data["extract"]["n"] == hit.model.n == 20
    document.data["extract"]["n"] = 20
    assert hit_of(document)[1].peak_force == hit.peak_force


@pytest.mark.slow
def test_a_slow_contact_is_run_to_its_end(tmp_path):
    path = scene(tmp_path, "5e-3")
    heavy = 'kind = "RigidMass"\nmass = 0.5\ntip_radius = 0.01\n'
    path.write_text(path.read_text().replace('kind = "Sphere"\nradius = 0.01\n', heavy))
    data, hit = hit_of(read_document(path))
    released = hit.contacts[-1][1]
    assert 1e-3 < released < data["simulate"]["duration"]
    assert hit.restitution >= 0
