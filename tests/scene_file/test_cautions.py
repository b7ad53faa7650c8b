"""What is told before the numbers of an impact."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
import sheets
from antiosc.reduce.error import division as divided
from antiosc_app import falls, live, results
from antiosc_app.scene_file.run import error_budget

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]


@pytest.mark.parametrize(("cells", "is_coarse"), [(4, True), (64, False)])
def test_cells_too_large_for_the_contact_are_told_first_and_leave_no_bar(
    cells, is_coarse, monkeypatch
):
    """The waves of the contact of a ball on a sheet of 1 mm have a length of some 60 mm."""
    monkeypatch.setattr(divided, "MOST_DOFS", 1000)  # no sheet is divided for its error
    part = sheets.plate(cells, 0.001, cell="quadrilateral")
    model = ao.extract(part, ao.Site((0.5, 0.5, 0.0), (0, 0, -1)), n=10)
    ball = ao.Sphere(0.01, material="100Cr6", velocity=1.0)
    hit = ao.simulate(model, ball, ao.Hertz(1e9), duration=1e-3)
    budget = error_budget(hit)
    caution = live.caution_of(hit, budget, part)
    assert caution.startswith("There is no error bar") == is_coarse == (budget is None)
    assert is_coarse or budget.footnote.startswith("There is no error bar. The mesh's error")
    assert ("The cell at the site measures" in caution) == is_coarse


@pytest.mark.parametrize(("mass", "duration"), [(0.005, 2e-2), (0.5, 2e-2), (0.02, 4e-2)])
def test_a_contact_time_says_what_it_is_of_where_there_are_several_contacts(mass, duration):
    model = ao.AntiOscillators(m0=0.02, k0=1e5, m=[0.05], omega=[3000.0])
    striker = ao.RigidMass(mass=mass, velocity=1.0)
    hit = ao.simulate(model, striker, ao.Hertz(1e9), duration)
    head = live.headline_of_history(hit, None, None, {})
    assert "contact time" in dict(head.numbers)
    assert "contact time" in dict(results._facts(hit))
    (row,) = (line for line in hit.summary().splitlines() if line.startswith("contact time"))
    told = " ".join([row, *head.sentences])
    first, last = hit.contacts[0][0], hit.contacts[-1][1]
    together = hit.contact_time == pytest.approx(last - first)
    longest = max(end - start for start, end in hit.contacts)  # without a flight
    assert ("flights included" in told) == (hit.contact_time > longest * (1 + 1e-9))
    assert (f"last release at {ao.base.texts.engineering(last, 's')}" in told) == (not together)


@pytest.mark.parametrize(("mass", "apart"), [(0.005, False), (0.1, True)])
def test_contacts_that_are_not_of_the_main_impact_are_counted_apart(mass, apart):
    """A heavy striker touches again after a flight that is longer than the impact up to then."""
    model = ao.AntiOscillators(m0=0.02, k0=1e5, m=[0.05], omega=[3000.0])
    hit = ao.simulate(model, ao.RigidMass(mass, 1.0), ao.Hertz(1e9), duration=2e-2)
    starts, ends = np.transpose(hit.contacts)
    flights = starts[1:] - ends[:-1]
    since = ends[:-1] - starts[0]  # of a main impact that began with the first touch
    assert bool((flights > since).any()) == apart
    told = next(line for line in hit.summary().splitlines() if line.startswith("contacts"))
    assert (" in the main impact" in told) == apart
    assert told.split()[1].rstrip(",") == str(len(hit.contacts))


@pytest.mark.slow
def test_a_force_with_a_wide_bar_says_so_first_and_what_narrows_it_once():
    part = sheets.plate(16, 0.02)
    heads = []
    for n in (1, 60):
        site = ao.Site((0.5, 0.5, 0.0), (0, 0, -1), radius=0.02)
        model = ao.extract(part, site, n=n, error="estimate")
        hit = ao.simulate(model, ao.RigidMass(1e-4, 1.0), ao.Hertz(1e10), duration=1e-3)
        budget = hit.error_budget
        heads.append((budget, live.headline_of_history(hit, part, budget, {})))
    (wide, rough), (narrow, fine) = heads
    assert wide["peak_force"].total > 0.5 > narrow["peak_force"].total
    assert rough.caution.startswith(
        f"The force is a rough one, ± {live.percent(wide['peak_force'].total)}"
    )
    assert "to narrow it, extract more anti-oscillators" in rough.caution
    assert "to narrow it" not in " ".join(rough.sentences)
    assert "rough" not in fine.caution
    assert "to narrow it" in " ".join(fine.sentences)


def test_a_wide_bar_without_that_of_the_law_is_told_first_too():
    """A smaller share of it stood first, where no yield strength is known."""
    bar = SimpleNamespace(law=None, known=12.0, mesh=12.0)
    budgets = type(
        "Budget", (), {"causes": ["mesh"], "no_bar": True, "__getitem__": lambda *_: bar}
    )
    told = live.rough(None, budgets())
    assert told.startswith(
        "The force is a rough one, ± 1200 %, without the error of the contact's law: "
    )
    bar.known = 0.4
    assert live.rough(None, budgets()) == ""


@pytest.mark.parametrize(("strengths", "is_wide"), [((38e6, 46e6), False), ((6e6, 400e6), True)])
@pytest.mark.slow
def test_a_fall_with_a_wide_bar_says_so_first_and_what_narrows_it_once(strengths, is_wide):
    plastic = ao.Solid(E=2.3e9, nu=0.36, rho=1050.0, yield_strength=42e6, yield_range=strengths)
    part = ao.Structure(ao.box_mesh((0.04, 0.03, 0.012), size=0.006), plastic)
    floor = ao.Floor("concrete C30/37")
    fall = ao.drop(part, 0.8, floor=floor, until=1, modes=6, corner="+x-y-z")
    assert (fall.impacts[0].law_error > live.WIDE) == is_wide
    head = falls.headline_of_fall(fall, None)
    share = live.percent(fall.impacts[0].law_error)
    assert head.caution.startswith(f"The force is a rough one, ± {share}: " if is_wide else "")
    assert bool(head.caution) == is_wide
    remedy = "an own material with the yield strength of this part"
    assert (remedy in head.caution) == is_wide
    assert (remedy in " ".join(head.sentences)) != is_wide


def test_a_linear_sheet_tells_its_deflection_over_its_thickness():
    part = sheets.plate(8, 0.002)
    model = ao.extract(part, ao.Site((0.5, 0.5, 0.0), (0, 0, -1), radius=0.02), n=10, stretch=False)
    for speed, told in ((0.005, False), (0.05, True)):
        hit = ao.simulate(model, ao.RigidMass(0.5, speed), ao.Hertz(1e8), duration=0.05)
        ratio = float(np.abs(hit.displacement).max()) / 0.002
        assert (0.04 < ratio < 0.5) == told
        ratios = [
            re.search(r"by ([\d.]+) times its thickness", text)[1] for text in hit.stretch_texts
        ]
        assert list(map(float, ratios)) == pytest.approx([ratio] * told, rel=0.03)


@pytest.mark.parametrize(("speed", "yields"), [(0.05, False), (50.0, True)])
def test_a_part_that_certainly_yields_is_told_before_its_elastic_force(speed, yields):
    mesh = sheets.plate(8, 0.02).mesh
    part = ao.Structure(
        mesh, ao.material("aluminium 5083-O", thickness=0.02), [ao.Support(lambda x: x[0] < 1e-9)]
    )
    model = ao.extract(part, ao.Site((0.5, 0.5, 0.0), (0, 0, -1)), n=20)
    ball = ao.RigidMass(mass=5.0, velocity=speed)
    hit = ao.simulate(model, ball, ao.Hertz(1e9), duration=5e-3)
    peak = ao.peak_field(part, hit)
    head = live.headline_of_history(hit, part, None, {"von_mises": peak})
    assert (peak.margin().bounds[0] >= 1) == yields
    told = re.search(r"The part yields, at (\S+) times (.*?)(\d+) MPa,? or more", head.caution)
    assert (told is not None) == yields
    if told is not None:  # the least stress within its error over the strength that is told
        least, _ = peak.margin().stresses
        assert float(told[1]) * float(told[3]) * 1e6 == pytest.approx(least, rel=0.01)
        assert ("largest" in told[2]) == (peak.margin().strength_range is not None)
    assert ("The part yields" in head.caution) == yields
    assert live.of_elastic_part({"von_mises": peak}, 1.0) == ""  # as the verdict says "may"
    assert "may be reached" in live.judgement(peak, 1e4)
