"""Reactions of an assembly: one mesh cut in two, joints and supports by hand, and the balance."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse

import antiosc as ao
from antiosc.fem.assembly.assemble import eliminate
from antiosc.fem.assembly.joint import Rows
from antiosc.results.fields import shapes_of
from antiosc.simulation.histories import amplitudes
from assemblies import BEAM, SOLID, box, line

pytestmark = pytest.mark.filterwarnings("ignore:the compliance under a point load")

BALL, LAW, DURATION = ao.RigidMass(mass=0.05, velocity=1.0), ao.Hertz(1e8), 3e-4
SITE = ao.Site((0.06, 0.02, 0.01), (0.1, -1, 0.2))


def struck(part, site=SITE, n=12):
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
    scene = ao.Scene(
        {"part": ao.extract(part, site, 6), "far": ao.Obstacle()},
        [ao.Contact("part", "far", ao.Linear(1.0), gap=1.0)],
        loads=[ao.Load("part", [0.0, 1.0], [6.0, 6.0])],
        preload=True,
    )
    found = ao.reactions(part, scene.run(1e-6), site, body="part")
    np.testing.assert_allclose(found.force["hinge"][-1], [0, 0, -4], atol=1e-6)
    np.testing.assert_allclose(found.force["beam:end"][-1], [0, 0, -2], atol=1e-6)
    np.testing.assert_allclose(found.moment["hinge"][-1], np.zeros(3), atol=1e-6)


def test_prescribed_values_of_constraints_that_overlap():
    """Rows of any size, one twice, two of a chain: all but the repeated one take their values."""
    rng = np.random.default_rng(4)
    C = np.zeros((7, 12))
    C[:4, :8] = 10.0 ** rng.uniform(-2, 2, (4, 1)) * rng.standard_normal((4, 8))
    C[4] = C[:4].T @ [1, 2, 3, 4]
    C[5, 8:10], C[6, 9:11] = (2, -3), (5, 1)
    held = np.zeros(12, dtype=bool)
    held[11] = True
    values = rng.standard_normal((7, 3))
    rows = [Rows.free(scipy.sparse.csr_matrix(C), "rows")]
    found = eliminate(rows, held, np.ones(12), prescribed=values)
    same = eliminate(rows, held, np.ones(12))
    kept = [0, 1, 2, 3, 5, 6]
    np.testing.assert_allclose(C[kept] @ found.particular, values[kept], atol=1e-10)
    np.testing.assert_allclose(C @ found.T.toarray(), 0, atol=1e-10)
    assert (found.T != same.T).nnz == 0
    assert same.particular is None


def test_supports_on_both_sides_of_a_joint():
    """The tied faces are held along their lower edge on either side: the balance holds still."""
    held = [ao.Support("y0")]
    a = ao.Structure(box((0, 0, 0), (0.05, 0.02, 0.02), (3, 2, 2)), SOLID, held)
    b = ao.Structure(box((0, 0, 0), (0.05, 0.02, 0.02), (2, 1, 3)), SOLID, held)
    part = ao.assemble({"a": a, "b": b}, [ao.Tie("a:x1", "b:x0")], at={"b": (0.05, 0, 0)})
    hit, found = struck(part)
    check_balance(found)
    assert list(found.force) == ["a:y0", "b:y0"]
    assert all(np.abs(f[:, 1]).max() > 0.1 * hit.peak_force for f in found.force.values())


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
    inertia = amplitudes(hit, hit.time, "structure", 2) @ rate
    np.testing.assert_allclose(found.inertia[:, 2], inertia, atol=1e-8 * scale)
