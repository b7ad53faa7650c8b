"""Corners that the floor presses flat: closed forms of their cuts, and what their bar holds."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc_studies.drops.crushed import crushed_law, cut_area_factor, tip_height

pytestmark = pytest.mark.fem
PLASTIC = ao.Solid(E=2.3e9, nu=0.36, rho=1050.0, yield_strength=42e6, yield_range=(38e6, 46e6))
SIZE, LOW = (0.12, 0.06, 0.02), (0.12, 0.0, 0.0)
#: Edges from a cube's corner along the sides of its three faces, which face outward.
CUBE = np.array([np.roll(np.eye(3)[[1, 0]], k, axis=1) for k in range(3)])
DIAGONAL = np.ones(3) / np.sqrt(3)


def at_work(law: ao.ContactLaw, work: float) -> float:
    """Force [N] of a law after a work [J]."""
    low, high = 0.0, 1.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if law.loading_work(middle) < work else (low, middle)
    return law.force(low, 0.0, law.touch(1.0))


def test_the_cut_of_a_cube_on_its_corner_and_the_ball_in_it() -> None:
    """An equilateral triangle, 3√3/2 d²; a ball of radius R lies (√3 - 1) R above the corner."""
    assert cut_area_factor(CUBE, DIAGONAL) == pytest.approx(1.5 * np.sqrt(3))
    assert tip_height(CUBE, DIAGONAL, 2.0) == pytest.approx(2 * (np.sqrt(3) - 1))
    finer = np.concatenate([[[a, a + b], [a + b, b]] for a, b in CUBE])  # each face of two facets
    assert cut_area_factor(finer, DIAGONAL) == pytest.approx(1.5 * np.sqrt(3))
    assert cut_area_factor(CUBE, np.array([0.0, 0.0, 1.0])) is None  # lies on a face


@pytest.mark.parametrize("work", [1e-3, 0.05])
def test_a_deep_corner_carries_the_pressure_on_its_pyramid(work: float) -> None:
    """F = p k d², after the work F d/3: F³ = 9 W² p k."""
    ball, k = ao.ElasticPlastic(1e13, 1e-6, 42e6, 0.36), 1.5 * np.sqrt(3)
    law = crushed_law(ball, k, 0.0, work)
    assert at_work(law, work) == pytest.approx(np.cbrt(9 * work**2 * 2.4 * 42e6 * k), rel=5e-3)


def test_a_shallow_dent_is_that_of_the_ball() -> None:
    ball = ao.ElasticPlastic(2.5e9, 4e-3, 42e6, 0.36)
    assert crushed_law(ball, 2.6, tip_height(CUBE, DIAGONAL, 4e-3), 1e-5) is ball


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [(25, 30, 0)])
def test_the_bar_of_a_corner_holds_coarse_cells_and_other_radii(tilt) -> None:
    """Cells of 12 and 2 mm at the corner; half and double the radius that nobody gave."""
    floor = ao.Floor("concrete C30/37")
    coarse = ao.Structure(ao.box_mesh(SIZE, 0.012), PLASTIC)
    fine = ao.Structure(ao.box_mesh(SIZE, 0.012, refine=[(LOW, 0.002)]), PLASTIC)
    told = ao.drop(coarse, 1.0, tilt, floor, until=1, modes=12)
    assert told.law_error is not None
    assert told.law_error >= 0.4
    for part, radius in ((fine, None), (coarse, 0.4e-3), (coarse, 2.5e-3)):
        other = ao.drop(part, 1.0, tilt, floor, until=1, modes=12, corner_radius=radius)
        assert abs(other.peak_force / told.peak_force - 1) < told.law_error


@pytest.mark.slow
def test_the_force_of_the_law_is_that_of_the_work_of_a_stiff_block() -> None:
    """A block that hardly bends gives the energy of its corner to the law."""
    stiff = ao.Solid(E=2e11, nu=0.3, rho=1050.0, yield_strength=20e6)
    part = ao.Structure(ao.box_mesh((0.03, 0.03, 0.03), 0.01), stiff)
    floor = ao.Floor(ao.Solid(E=2e12, nu=0.3, rho=8000.0, yield_strength=1e9))
    fall = ao.drop(part, 1.0, corner="-x-y-z", floor=floor, until=1, modes=3, corner_radius=1e-5)
    energy = part.mass * 9.80665 * 1.0
    known = np.cbrt(9 * energy**2 * 2.4 * 20e6 * 1.5 * np.sqrt(3))
    assert fall.peak_force == pytest.approx(known, rel=0.02)
    assert fall.law_error == pytest.approx(0.4)
    assert "the contact yields" in fall.summary()
