"""Probes, series and maps of assemblies: a bar in one piece against the same bar in two."""

from __future__ import annotations

from functools import cache

import meshio
import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.base.errors import InputError
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


def test_a_series_holds_all_parts_in_their_places(tmp_path):
    path = ao.write_series(cut(), hits()[1], tmp_path / "bar.pvd", times=[5e-4])
    found = meshio.read(path.with_name("bar_0000.vtu"))
    x = found.points
    np.testing.assert_allclose([x.min(axis=0), x.max(axis=0)], [[0, 0, 0], [0.2, 0.02, 0.02]],
                               atol=1e-12)  # fmt: skip
    end = int(np.argmin(np.linalg.norm(x - SITE.point, axis=1)))
    moved = ao.probe(cut(), hits()[1], SITE.point, times=[5e-4])
    np.testing.assert_allclose(found.point_data["displacement"][end], moved[0], rtol=1e-6)


def test_a_group_names_the_point_of_a_probe():
    """The middle of the group, on a part and in one mesh; a site of that name lies there too."""
    one, two = hits()
    times = np.linspace(0, 1e-3, 7)
    for quantity in ("displacement", "acceleration"):
        found = ao.probe(cut(), two, "right:y1", quantity, times)
        own = ao.probe(cut(), two, (0.2, 0.01, 0.01), quantity, times, part="right")
        np.testing.assert_allclose(found, own, rtol=1e-9, atol=1e-12 * np.abs(own).max())
        reference = ao.probe(uncut(), one, "x1", quantity, times)
        np.testing.assert_allclose(found, reference, rtol=0, atol=1e-4 * np.abs(reference).max())
    site = ao.Site("right:y1", (0, 0, -1))
    hit = ao.simulate(
        ao.extract(cut(), site, n=4), ao.RigidMass(0.05, 1.0), ao.Linear(1e6), duration=1e-4
    )
    struck = -ao.probe(cut(), hit, "right:y1")[:, 2]
    np.testing.assert_allclose(struck, hit.displacement, atol=1e-9 * np.abs(struck).max())
    gauge = ao.strain_gauge(cut(), two, "right:x1", (1, 0, 0), 4e-3, times)
    by_point = ao.strain_gauge(uncut(), one, (0.15, 0.0, 0.01), (1, 0, 0), 4e-3, times)
    np.testing.assert_allclose(gauge, by_point, rtol=0, atol=1e-4 * np.abs(by_point).max())


def test_a_reference_point_is_struck_and_probed():
    """A point on an arm, fixed to the end of the left half: rigid, and as the model tells."""
    left = ao.Structure(box((0, 0, 0), (0.1, 0.02, 0.02), (4, 1, 1)), STEEL, [ao.Support("x0")])
    joints = [ao.Rigid("left:x1", "tip")]
    part = ao.assemble({"left": left}, joints, points={"tip": (0.15, 0.01, 0.01)})
    model = ao.extract(part, ao.Site("tip", (0, 0, -1)), n=4)
    hit = ao.simulate(model, ao.RigidMass(0.05, 1.0), ao.Linear(1e6), duration=5e-4)
    tip, turn = (ao.probe(part, hit, "tip", q) for q in ("displacement", "rotation"))
    size = np.abs(tip).max()
    np.testing.assert_allclose(-tip[:, 2], hit.displacement, atol=1e-9 * size)
    end = ao.probe(part, hit, "left:x1")
    np.testing.assert_allclose(tip[:, 2], end[:, 2] - 0.05 * turn[:, 1], atol=1e-9 * size)
    longer = ao.extract(part, ao.Site("tip", (0, 0, -2)), n=4)
    assert (longer.k0, longer.m_st) == pytest.approx((model.k0, model.m_st), rel=1e-9)
    with pytest.raises(InputError, match="'tip' is a point without a mesh and has no stress"):
        ao.probe(part, hit, "tip", "stress")
    with pytest.raises(InputError, match="'tip' is a point without a mesh: a gauge needs"):
        ao.strain_gauge(part, hit, "tip", (1, 0, 0), 1e-3)
    with pytest.raises(InputError, match="'tip' has no surface: leave radius"):
        ao.extract(part, ao.Site("tip", (0, 0, -1), radius=1e-3))
