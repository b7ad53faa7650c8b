"""What is told of patches: which site of several, its numbers, and from where on."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.site.sites import located, tell
from antiosc.fem.structure.structure import on_mesh
from parts import STEEL, box

pytestmark = pytest.mark.fem


@pytest.fixture(scope="module")
def part():
    return on_mesh(ao.Structure(box((2, 1, 1), (0.2, 0.1, 0.1)), ao.Solid(**STEEL), order=1))


def told(part, **facts) -> list[str]:
    """The warnings of three sites with patches that are sound but for these facts."""
    points = np.tile([0.1, 0.05, 0.1], (3, 1))
    places = located(part, points, np.tile([0.0, 0.0, -1.0], (3, 1)), np.full(3, 0.04))
    sound = {"size": 0.01, "share": 1.0, "moving": 1.0, "local": 1e-9, "radii": 0.04}
    arrays = {name: np.full(3, value) for name, value in sound.items()}
    arrays |= {name: np.array(values) for name, values in facts.items()}
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        tell(part, replace(places, **arrays))
    return [str(one.message) for one in found]


def test_the_worst_of_the_doubtful_patches_is_told(part):
    (text,) = told(part, size=[0.0401, 0.01, 0.06], radii=[0.04, 0.04, 0.045])
    assert "the site at 2 of 3 sites measure 0.06 m, more than the radius 0.045" in text
    (text,) = told(part, share=[0.89, 1.0, 0.5])
    assert "cuts the patch at 2 of 3 sites: only 50% of its load area" in text
    (text,) = told(part, moving=[1.0, 0.89, 0.25])
    assert "supports fix 75% of the patch at 2 of 3 sites" in text
    (text,) = told(part, radii=[np.nan, 0.04, 0.04])
    assert "the element there measures 0.17 m" in text


def test_a_sheet_is_told_whose_cells_are_far_larger_than_the_radius():
    """Thick sheets become some per cent too stiff; of thin ones bending hides it: not told."""
    site = ao.Site((0.07, 0.08, 0.0), (0, 0, -1), radius=5e-4)
    stiffness = {}
    for thickness, size, count in ((16e-3, 4e-3, 0), (16e-3, 0.04, 1), (2e-3, 0.04, 0)):
        mesh = ao.box_mesh((0.2, 0.2), size=0.04, refine=[(site.point, size)])
        plate = ao.Structure(mesh, ao.Shell(**STEEL, thickness=thickness), [ao.Support("rim")])
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            stiffness[thickness, size] = ao.extract(plate, site, n=5).k0
        assert len(found) == count
        assert all("8 times the radius 0.0005" in str(one.message) for one in found)
    assert 0.02 < stiffness[16e-3, 0.04] / stiffness[16e-3, 4e-3] - 1 < 0.15


def test_a_blow_along_the_surface_is_told(part):
    points = np.tile([0.1, 0.05, 0.1], (2, 1))
    directions = np.array([[0.0, 0.0, -1.0], [0.999, 0.0, -0.0447]])
    places = located(part, points, directions, np.full(2, 0.04))
    with pytest.warns(ao.AccuracyWarning, match="1 of 2 sites lies along .*, 2.6°") as all_:
        tell(part, replace(places, size=np.full(2, 0.01)))
    assert len(all_) == 1
    assert "against the normal (0, 0, 1)" in str(all_[0].message)
