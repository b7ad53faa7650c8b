"""The largest stress anywhere for a blow at each site: that of the impact at the site by itself."""

from __future__ import annotations

import functools

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.app import live as verdict, live_meshes as sites
from antiosc.base.texts import engineering

pytestmark = [
    pytest.mark.fem,
    pytest.mark.filterwarnings("ignore::antiosc.AccuracyWarning"),  # a coarse mesh, few modes
]

SIZE, YIELD = (0.12, 0.08, 0.01), 50e6
STRIKER, LAW, DURATION = ao.RigidMass(0.05, 1.0), ao.Hertz(1e9), 4e-4
POINTS = [(0.03, 0.02, 0.01), (0.07, 0.05, 0.01), (0.09, 0.03, 0.01)]


@functools.cache
def struck(supports, **options) -> tuple[ao.Structure, ao.ImpactMap]:
    groups = {"left": (2, lambda x: np.isclose(x[0], 0))}
    mesh = parts.box((6, 4, 1), SIZE, "hexahedron", groups=groups)
    steel = ao.Solid(**parts.STEEL, **options)
    part = ao.Structure(mesh, steel, [ao.Support("left")] if supports else [])
    found = ao.impact_map(
        part, POINTS, STRIKER, LAW, DURATION, direction=(0, 0, -1), radius=0.02, n=16, modes=30,
        band=4e4, accuracy=1.0, stress=True,
    )  # fmt: skip
    return part, found


@pytest.mark.slow
@pytest.mark.parametrize("supports", [True, False])
def test_the_largest_stress_is_that_of_the_impact_by_itself(supports):
    part, found = struck(supports, yield_strength=YIELD)
    for i, point in enumerate(POINTS):
        site = ao.Site(point, (0, 0, -1), radius=0.02)
        hit = ao.simulate(ao.extract(part, site, n=40), STRIKER, LAW, DURATION)
        field = ao.peak_field(part, hit, "yield", times=np.linspace(0, DURATION, 150))
        value, place, _ = field.largest(1)[0]
        assert found.exposure[i] == pytest.approx(value, rel=0.03)
        assert found.peak_stress[i] == pytest.approx(value * YIELD, rel=0.03)
        assert found.stress_points[i] == pytest.approx(place, abs=1e-9)


def test_a_map_colours_by_danger():
    part, found = struck(supports=True, yield_strength=YIELD)
    own = sites.sites_of_map(found, part)[1]
    assert own["units"]["peak_stress"] == "Pa"
    assert own["quantities"]["exposure"] is found.exposure
    worst = int(found.exposure.argmax())
    told = found.summary().splitlines()[-1]
    assert engineering(found.peak_stress[worst], "Pa", 3) in told
    assert "refine" in told
    assert f"{found.exposure[worst]:.3g}" in " ".join(verdict.headline_of_map(found).sentences)


def test_stress_needs_impacts_and_no_strength():
    part, found = struck(supports=True)
    assert found.exposure is None
    assert "exposure" not in found.quantities()
    with pytest.raises(ao.InputError):
        ao.impact_map(part, POINTS, direction=(0, 0, -1), radius=0.02, stress=True)
