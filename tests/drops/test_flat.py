"""Landings on a face: the range of the force within a small angle of the start."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import antiosc as ao
from antiosc.base.texts import engineering
from antiosc_app import falls, results
from antiosc_app.fall_caution import caution_of_fall
from antiosc_studies.drops.flat import is_flat, range_over_tilt

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]


@pytest.fixture(scope="module")
def block():
    """The free modes of an aluminium block of 60 x 40 x 20 mm."""
    part = ao.Structure(
        ao.box_mesh((0.06, 0.04, 0.02), size=0.01), ao.material("aluminium 6082-T6")
    )
    floor = ao.Floor(ao.material("concrete C30/37"))

    def dropped(tilt):
        return ao.drop(
            part, height=0.2, tilt=tilt, until=1, modes=8, corner_radius=1e-3, floor=floor
        )

    return dropped


@pytest.mark.slow
def test_the_range_holds_the_flat_landing_and_those_a_degree_beside(block):
    """Each force by a fall of its own: flat, and turned about one axis as the range turns it."""
    inclined = block((0.4, 0.0, 0.0))
    assert is_flat(inclined)
    least, largest = range_over_tilt(inclined)
    flat, beside = (block((tilt, 0.0, 0.0)).impacts[0].peak_force for tilt in (0.0, 1.4))
    assert largest == pytest.approx(flat, rel=0.02)
    assert least < 1.001 * beside
    assert least < inclined.impacts[0].peak_force < largest
    assert least < 0.6 * largest


def test_a_landing_on_a_corner_is_not_flat(block):
    fall = block((30.0, 20.0, 0.0))
    assert not is_flat(fall)
    assert "tilt the force lies" not in caution_of_fall(fall)


@pytest.mark.slow
def test_a_flat_landing_tells_the_range_before_the_bar_also_on_the_terminal(block):
    fall = block((0.0, 0.0, 0.0))
    ends = [engineering(force, "N") for force in range_over_tilt(fall)]
    told = f"the force lies between {ends[0]} and {ends[1]}. The force is a rough one"
    assert told in falls.headline_of_fall(fall, None).caution
    assert told in results._fall(SimpleNamespace(fall=fall, worst=None, peaks=None)).caution
