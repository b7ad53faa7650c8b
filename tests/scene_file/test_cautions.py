"""What is told before the numbers of an impact."""

from __future__ import annotations

import pytest

import antiosc as ao
import sheets
from antiosc_app import live
from antiosc_app.scene_file.run import error_budget

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]


@pytest.mark.parametrize(("cells", "is_coarse"), [(4, True), (64, False)])
def test_cells_too_large_for_the_contact_are_told_first_and_leave_no_bar(cells, is_coarse):
    """The waves of the contact of a ball on a sheet of 1 mm have a length of some 60 mm."""
    part = sheets.plate(cells, 0.001, cell="quadrilateral")
    model = ao.extract(part, ao.Site((0.5, 0.5, 0.0), (0, 0, -1)), n=10)
    ball = ao.Sphere(0.01, material="100Cr6", velocity=1.0)
    hit = ao.simulate(model, ball, ao.Hertz(1e9), duration=1e-3)
    caution = live.caution_of(hit, error_budget(hit), part)
    assert caution.startswith("There is no error bar")
    assert ("The cell at the site measures" in caution) == is_coarse


@pytest.mark.parametrize(("mass", "label"), [(0.005, "contact time"), (0.5, live.FIRST_TO_LAST)])
def test_a_time_that_contains_flights_is_not_called_the_time_of_the_contact(mass, label):
    model = ao.AntiOscillators(m0=0.02, k0=1e5, m=[0.05], omega=[3000.0])
    striker = ao.RigidMass(mass=mass, velocity=1.0)
    hit = ao.simulate(model, striker, ao.Hertz(1e9), duration=2e-2)
    numbers = dict(live.headline_of_history(hit, None, None, {}, None).numbers)
    assert label in numbers
    in_contact = sum(end - start for start, end in hit.contacts)
    assert (in_contact < 0.9 * hit.contact_time) == (label == live.FIRST_TO_LAST)
