"""A part that is cut at a plane of symmetry is told, with what a blow on it means."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc_app import live
from antiosc_app.symmetry import symmetry_note

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]
STEEL = ao.Solid(**parts.STEEL)
END = ao.Support(plane=((0, 0, 0), (1, 0, 0)))


def cut(*supports: ao.Support) -> ao.Structure:
    return ao.Structure(parts.box((6, 2, 2), (0.12, 0.04, 0.02), "hexahedron"), STEEL, supports)


@pytest.mark.parametrize(
    ("supports", "planes"),
    [
        ([], ""),
        ([END], ""),
        ([ao.Support(plane=((0, 0.02, 0), (0, 1, 0)), fix="y"), END], ""),
        ([ao.Support(plane=((0, 0, 0), (0, 1, 0)), fix="y"), END], "plane y = 0 m"),
        ([ao.Support(plane=((0, 0.04, 0), (0, 1, 0)), fix="y")], "plane y = 40.0 mm"),
        (
            [
                ao.Support(plane=((0, 0, 0), n), fix=f)
                for n, f in (((0, 1, 0), "y"), ((0, 0, 1), "z"))
            ],
            "plane y = 0 m and z = 0 m",
        ),
        (
            [ao.Support(plane=((0, y, 0), (0, 1, 0)), fix="y") for y in (0.0, 0.04)],
            "plane y = 0 m and y = 40.0 mm are held along y alone,",
        ),
    ],
)
def test_planes_held_along_their_normal_alone_are_told(supports, planes):
    told = symmetry_note(cut(*supports))
    assert planes in told
    assert bool(planes) == bool(told)
    assert told.count("along y alone") <= 1
    assert live.caution_of(None, None, cut(*supports)).startswith(told or "There is no error bar")


def test_half_the_mass_and_half_the_contact_on_the_plane_give_half_the_force():
    """What the sentence says, against the whole part."""
    whole = ao.Structure(parts.box((6, 4, 2), (0.12, 0.08, 0.02), "hexahedron"), STEEL, [END])
    half = cut(ao.Support(plane=((0, 0.04, 0), (0, 1, 0)), fix="y"), END)
    forces = []
    for part, share in ((whole, 1.0), (half, 0.5)):
        model = ao.extract(part, ao.Site((0.08, 0.04, 0.02), (0, 0, -1), radius=0.015), n=8)
        hit = ao.simulate(model, ao.RigidMass(share * 0.1, 1.0), ao.Linear(share * 1e7), 1e-3)
        forces.append(hit.force_at(np.linspace(0, 1e-3, 200)))
    np.testing.assert_allclose(2 * forces[1], forces[0], atol=2e-3 * forces[0].max())
