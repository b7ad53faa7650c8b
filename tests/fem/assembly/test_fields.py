"""Fields and reactions of assemblies: one mesh cut in two, statics, and the balance."""

from __future__ import annotations

from functools import cache

import meshio
import numpy as np
import pytest

import antiosc as ao
from antiosc.fields.fields import shapes_of
from antiosc.impact.histories.factors import shape_factors
from assemblies import BEAM, NU, RHO, SOLID, E, box, line
from static_loads import quiet

pytestmark = [
    pytest.mark.filterwarnings("ignore:the compliance under a point"),
    pytest.mark.filterwarnings("ignore:none of the"),
    pytest.mark.filterwarnings("ignore:Z may be off"),
    pytest.mark.filterwarnings("ignore:.* sites are left out"),
    pytest.mark.filterwarnings("ignore:the compliance under a point load"),
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


@pytest.mark.slow
def test_a_series_holds_all_parts_in_their_places(tmp_path):
    path = ao.write_series(cut(), hits()[1], tmp_path / "bar.pvd", times=[5e-4])
    found = meshio.read(path.with_name("bar_0000.vtu"))
    x = found.points
    np.testing.assert_allclose([x.min(axis=0), x.max(axis=0)], [[0, 0, 0], [0.2, 0.02, 0.02]],
                               atol=1e-12)  # fmt: skip
    end = int(np.argmin(np.linalg.norm(x - SITE.point, axis=1)))
    moved = ao.probe(cut(), hits()[1], SITE.point, times=[5e-4])
    np.testing.assert_allclose(found.point_data["displacement"][end], moved[0], rtol=1e-6)


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_turned_part_of_an_anisotropic_material_is_the_part():
    """Its axes turn with it: model, motion, and stresses in global and in local axes."""
    C = np.diag([10.0, 4.0, 3.0, 1.0, 1.5, 2.0]) * 1e9
    C[0, 1] = C[1, 0] = 1e9
    mesh = box((0, 0, 0), (0.1, 0.05, 0.05), (3, 2, 2))
    alone = ao.Structure(mesh, ao.AnisotropicSolid(C, 1500.0), [ao.Support("x0")], order=1)
    place = ao.Placement((1, 2, 3), (0.3, 0.5, -0.8), 1.1, (0.1, 0.2, 0))
    placed, R = ao.assemble({"p": alone}, at={"p": place}), place.rotation
    x, inside, direction = np.array([[0.1, 0.02, 0.05], [0.05, 0.021, 0.022], [0.2, 0.3, -1.0]])
    y, there = place.placed(np.array([x, inside]))
    found = []
    for part, site, point in (
        (alone, ao.Site(tuple(x), tuple(direction)), inside),
        (placed, ao.Site(tuple(y), tuple(R @ direction), part="p"), there),
    ):
        model = ao.extract(part, site, n=4)
        hit = ao.simulate(model, ao.RigidMass(0.05, 1.0), ao.Linear(1e5), 1e-2)
        asked = ("displacement", "global"), ("stress", "global"), ("stress", "local")
        values = [ao.probe(part, hit, point, q, [5e-4], axes=axes)[0] for q, axes in asked]
        found.append((model, *values))
    (own, u, stress, local), (model, moved, turned, same) = found
    assert model.k0 == pytest.approx(own.k0, rel=1e-9)
    assert model.omega == pytest.approx(own.omega, rel=1e-9)
    assert moved == pytest.approx(R @ u, abs=1e-6 * np.abs(u).max())
    assert turned == pytest.approx(R @ stress @ R.T, abs=1e-6 * np.abs(stress).max())
    assert same == pytest.approx(local, abs=1e-6 * np.abs(stress).max())


@pytest.mark.slow
def test_a_map_over_several_parts_is_the_maps_of_each(tmp_path):
    """Groups of both parts, all their surfaces, and points: the models of single extractions."""
    options = {"n": 4, "modes": 12}
    where = ["right:y1", "left:z1"]
    alone = [ao.impact_map(cut(), one, **options) for one in where]
    impact = {"impactor": ao.RigidMass(0.05, 1.0), "contact": ao.Linear(1e6), "duration": 2e-4}
    found = ao.impact_map(cut(), where, **impact, **options)
    assert list(found.names) == [n for n, one in zip(where, alone, strict=True) for _ in one.points]
    for name in ("points", "directions"):
        reference = np.concatenate([getattr(one, name) for one in alone])
        np.testing.assert_allclose(getattr(found, name), reference, atol=1e-12)
    reference = np.concatenate([one.models.k0 for one in alone])
    np.testing.assert_allclose(found.models.k0, reference, rtol=1e-9)
    assert len(found.elements) == sum(len(one.elements) for one in alone)
    assert {str(found.names[t[0]]) for t in found.elements} == set(where)
    assert (found.names[found.elements] == found.names[found.elements[:, :1]]).all()
    rows = found.summary().splitlines()[:-1]  # the last tells that forces have no bar
    assert [row.split()[:2] for row in rows[1:]] == [
        [name, f"{len(one)}"] for name, one in zip(where, alone, strict=True)
    ]
    for row, name in zip(rows[1:], where, strict=True):
        assert f"{found.peak_force[found.names == name].max():.4g} N" in row
    every = ao.impact_map(cut(), n=2, modes=6)
    assert set(every.names) == {"left", "right"}
    assert every.skipped == 9  # the clamped face, whose normals have no other part
    read = meshio.read(every.write(tmp_path / "map.vtu"))
    assert set(read.point_data["surface"]) == {0.0, 1.0}
    assert every.plot(tmp_path / "map.png", "k0").stat().st_size > 5000


BALL, LAW, DURATION = ao.RigidMass(mass=0.05, velocity=1.0), ao.Hertz(1e8), 3e-4
STRUCK = ao.Site((0.06, 0.02, 0.01), (0.1, -1, 0.2))


def struck(part, site=STRUCK, n=12):
    hit = ao.simulate(ao.extract(part, site, n), BALL, LAW, DURATION)
    return hit, ao.reactions(part, hit, site)


def check_balance(found, axes=(0, 1, 2)):
    scale = np.abs(found.applied).max()
    assert scale > 0
    for axis in axes:
        left = (found.total + found.applied - found.inertia)[:, axis]
        assert np.abs(left).max() < 1e-8 * scale
    return scale


@pytest.mark.slow
def test_a_bar_cut_in_two_has_the_reactions_of_one_mesh():
    """Held at both ends and along the bottom of one half: all nodes of the cut match."""
    ends = [ao.Support("x0"), ao.Support("x1", ("x", "y"))]
    edge = ao.Support(lambda x: np.isclose(x[1], 0) & (x[0] > 0.0749), "z")
    one = ao.Structure(box((0, 0, 0), (0.1, 0.02, 0.02), (8, 2, 2)), SOLID, [*ends, edge])
    left = box((0, 0, 0), (0.05, 0.02, 0.02), (4, 2, 2))
    right = box((0, 0, 0), (0.05, 0.02, 0.02), (4, 2, 2))
    two = ao.assemble(
        {
            "left": ao.Structure(left, SOLID, [ao.Support("x0")]),
            "right": ao.Structure(right, SOLID),
        },
        [ao.Tie("left:x1", "right:x0")],
        at={"right": (0.05, 0, 0)},
        supports=[ao.Support("right:x1", ("x", "y")), edge],
    )
    _, whole = struck(one)
    _, halves = struck(two)
    check_balance(whole)
    check_balance(halves)
    assert list(halves.force) == ["left:x0", "right:x1", "support 2"]
    for name, same in zip(halves.force, whole.force, strict=True):
        np.testing.assert_allclose(halves.centre[name], whole.centre[same], atol=1e-12)
        for kind in ("force", "moment"):
            own, other = getattr(halves, kind)[name], getattr(whole, kind)[same]
            np.testing.assert_allclose(own, other, atol=1e-5 * np.abs(other).max())


@pytest.mark.slow
def test_at_rest_forces_and_moments_are_those_of_statics():
    """A beam on a hinge and a roller under F at a third: 2/3 and 1/3 of it, no moment."""
    beam = ao.Structure(line((0, 0, 0), (0.3, 0, 0), 6), BEAM)
    part = ao.assemble(
        {"beam": beam},
        [ao.Weld("beam:start", "hinge")],
        points={"hinge": (0, 0, 0)},
        supports=[
            ao.Support("hinge", ("x", "y", "z", "rx")),
            ao.Support("beam:end", ("y", "z")),
        ],
    )
    site = ao.Site((0.1, 0, 0), (0, 0, 1))
    found = ao.reactions(part, quiet(ao.extract(part, site, 6), 6.0), site, body="part")
    np.testing.assert_allclose(found.force["hinge"][-1], [0, 0, -4], atol=1e-6)
    np.testing.assert_allclose(found.force["beam:end"][-1], [0, 0, -2], atol=1e-6)
    np.testing.assert_allclose(found.moment["hinge"][-1], np.zeros(3), atol=1e-6)


@pytest.mark.slow
def test_a_turned_part_on_points_and_joints():
    """A bar that stands askew, on a hinge to ground, a spider and a bushing to a held point."""
    bar = ao.Structure(box((0, 0, 0), (0.1, 0.02, 0.02), (6, 2, 2)), SOLID, order=1)
    rod = ao.Structure(line((0, 0, 0), (0.05, 0, 0), 4), BEAM, [ao.Support("end")])
    stiff = {c: 1e7 for c in ("x", "y", "z")}
    turned = ao.Placement((0.0, 0.1, 0.0), (1, 1, 0), 0.7)
    middle = turned.placed(np.array([[0.05, 0.01, 0.0]]))[0]
    foot, head = (turned.placed(np.array([[x, 0.01, 0.01]]))[0] for x in (0.0, 0.1))
    part = ao.assemble(
        {"bar": bar, "rod": rod},
        [
            ao.Rigid("bar:x0", "foot"),
            ao.Mean("bar:x1", "head"),
            ao.Bushing("head", "wall", {**stiff, "rx": 1e3, "ry": 1e3, "rz": 1e3}),
            ao.Ball(("bar", tuple(middle)), "rod:start"),
        ],
        at={"bar": turned, "rod": tuple(middle)},
        points={"foot": tuple(foot), "head": tuple(head), "wall": tuple(head)},
        supports=[ao.Support("foot", ("x", "y", "z")), ao.Support("wall")],
        attached=[ao.PointMass("head", 0.02)],
    )
    point = turned.placed(np.array([[0.06, 0.02, 0.01]]))[0]
    site = ao.Site(tuple(point), (0.1, -1, 0.2), part="bar")
    hit, found = struck(part, site)
    scale = check_balance(found)
    assert list(found.force) == ["rod:end", "foot", "wall"]
    np.testing.assert_allclose(found.centre["foot"], foot, atol=1e-12)
    assert np.abs(found.moment["foot"]).max() < 1e-7 * np.abs(found.force["foot"]).max()
    # the rate of the momentum by the forms of the parts and the masses, not by their matrices
    rate = shapes_of(part, hit, "structure").T @ part.uniform_inertia(np.array([0.0, 0, 1]))
    inertia = shape_factors(hit, hit.time, "structure", 2) @ rate
    np.testing.assert_allclose(found.inertia[:, 2], inertia, atol=1e-8 * scale)
