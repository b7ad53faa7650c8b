"""Probes, series and maps of assemblies: a bar in one piece against the same bar in two."""

from __future__ import annotations

from functools import cache

import meshio
import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.errors import InputError
from assemblies import NU, RHO, E, box

pytestmark = [
    pytest.mark.fem,
    pytest.mark.filterwarnings("ignore:the compliance under a point"),
    pytest.mark.filterwarnings("ignore:none of the"),
    pytest.mark.filterwarnings("ignore:Z may be off"),
    pytest.mark.filterwarnings("ignore:.* sites are left out"),
]

STEEL = ao.Solid(E, NU, RHO)
#: The right half lies along y in its own mesh, and upside down.
TURNED = ao.Placement((0.1, 0.0, 0.0), (0, 0, 1), -np.pi / 2)
SITE = ao.Site((0.2, 0.02, 0.02), (0, 0.3, -1))


@cache
def uncut() -> ao.Structure:
    return ao.Structure(box((0, 0, 0), (0.2, 0.02, 0.02), (8, 2, 2)), STEEL, [ao.Support("x0")])


@cache
def cut() -> ao.Structure:
    left = ao.Structure(box((0, 0, 0), (0.1, 0.02, 0.02), (4, 2, 2)), STEEL, [ao.Support("x0")])
    right = ao.Structure(box((-0.02, 0, 0), (0.0, 0.1, 0.02), (2, 4, 2)), STEEL)
    return ao.assemble(
        {"left": left, "right": right}, [ao.Tie("left:x1", "right:y0")], {"right": TURNED}
    )


@cache
def hits() -> list[ao.History]:
    return [
        ao.simulate(
            ao.extract(part, SITE, n=12), ao.RigidMass(0.05, 1.0), ao.Linear(1e6), duration=1e-3
        )
        for part in (uncut(), cut())
    ]


@pytest.mark.parametrize("quantity", ["displacement", "acceleration", "rotation", "stress"])
@pytest.mark.parametrize(("point", "name"), [((0.03, 0.004, 0.018), "left"),
                                             ((0.163, 0.017, 0.003), "right")])  # fmt: skip
def test_a_probe_is_that_of_the_uncut_bar(quantity, point, name):
    one, two = hits()
    times = np.linspace(0, 1e-3, 9)
    reference = ao.probe(uncut(), one, point, quantity, times)
    found = ao.probe(cut(), two, point, quantity, times, part=name)
    # the accuracy of both integrations
    np.testing.assert_allclose(found, reference, rtol=0, atol=1e-4 * np.abs(reference).max())


def test_a_series_holds_all_parts_in_their_places(tmp_path):
    path = ao.write_series(cut(), hits()[1], tmp_path / "bar.pvd", times=[5e-4])
    found = meshio.read(path.with_name("bar_0000.vtu"))
    x = found.points
    np.testing.assert_allclose([x.min(axis=0), x.max(axis=0)], [[0, 0, 0], [0.2, 0.02, 0.02]],
                               atol=1e-12)  # fmt: skip
    end = int(np.argmin(np.linalg.norm(x - SITE.point, axis=1)))
    moved = ao.probe(cut(), hits()[1], SITE.point, times=[5e-4])
    np.testing.assert_allclose(found.point_data["displacement"][end], moved[0], rtol=1e-6)


def test_a_map_of_a_part_is_that_of_the_uncut_bar():
    """Every site of a group of the turned half: the same model as the uncut bar has there."""
    options = {"n": 4, "modes": 12, "impactor": ao.RigidMass(0.05, 1.0)}
    options |= {"contact": ao.Linear(1e6), "duration": 1e-3}
    own = ao.impact_map(uncut(), "x1", **options)
    found = ao.impact_map(cut(), "right:y1", **options)
    assert len(found) == len(own) == 9
    one, two = (np.lexsort(m.points.round(6).T) for m in (own, found))
    np.testing.assert_allclose(found.points[two], own.points[one], atol=1e-12)
    np.testing.assert_allclose(found.directions[two], own.directions[one], atol=1e-12)
    for name in ("k0", "m_st", "peak_force", "impulse"):
        values = found.quantities().get(name, getattr(found.models, name, None))
        reference = own.quantities().get(name, getattr(own.models, name, None))
        np.testing.assert_allclose(values[two], reference[one], rtol=1e-5)
    assert len(ao.impact_map(cut(), "right", direction=(0, 0, -1), n=2).points) > 9


def test_a_map_needs_a_surface_of_a_part():
    with pytest.raises(InputError, match="no part 'middle'"):
        ao.impact_map(cut(), "middle:x1")
    with pytest.raises(InputError, match="has no group 'x9'"):
        ao.impact_map(cut(), "left:x9")
    with pytest.raises(InputError, match="supports fix the whole surface"):
        ao.impact_map(cut(), "left:x0")
