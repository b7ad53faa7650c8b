"""Plane assemblies beside the same ones in space, whose motion out of the plane is held."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from assemblies import NU, RHO, E, box, line

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:[0-9]+ constraint:antiosc.base.errors.AntioscWarning"),
]

DEPTH = 0.03
BEAM = {"E": E, "nu": NU, "rho": RHO, "section": ao.Section.rectangle(width=0.01, height=0.02)}
SPRINGS = {"x": 2e5, "y": 3e5, "rz": 40.0}
PLACES = {
    "b": ao.Placement((0.2, 0.0), (0, 0, 1), np.pi / 2),
    "d": ao.Placement((0.35, 0.25), (0, 0, 1), 0.2),
}
POINTS = {"hub": (0.35, 0.05), "foot": (0.6, 0.04), "ground": (0.5, 0.3), "arm": (0.58, 0.33)}
CORNER = (0.6, -0.15)


def block(low: tuple, high: tuple, n: tuple, held: bool, space: bool) -> ao.Structure:
    """A rectangle of plane strain, or a slab one cell deep around the plane."""
    supports = [ao.Support("x0")] if held else []
    if not space:
        solid = ao.Solid(E, NU, RHO, plane="strain", thickness=DEPTH)
        return ao.Structure(box(low, high, n, "quadrilateral"), solid, supports, order=1)
    mesh = box((*low, -DEPTH / 2), (*high, DEPTH / 2), (*n, 1))
    return ao.Structure(mesh, ao.Solid(E, NU, RHO), supports, order=1)


def beam(start: tuple, end: tuple, space: bool) -> ao.Structure:
    """A beam whose height lies in the plane."""
    if not space:
        return ao.Structure(line(start, end, 2), ao.Beam(**BEAM), order=1)
    x, y = np.subtract(end, start)
    mesh = line((*start, 0.0), (*end, 0.0), 2)
    return ao.Structure(mesh, ao.Beam(**BEAM, orientation=(-y, x, 0.0)), order=1)


def assembly(space: bool) -> ao.Structure:
    """Every joint that plane parts can have, held to the ground and braced."""
    parts = {
        "a": block((0.0, 0.0), (0.2, 0.1), (2, 2), True, space),
        "b": block((0.0, -0.15), (0.1, 0.0), (3, 1), False, space),
        "c": beam((0.35, 0.05), (0.35, 0.25), space),
        "d": beam((0.0, 0.0), (0.2, 0.05), space),
        "f": beam((0.6, 0.3), (0.6, 0.04), space),
        "g": block((0.5, -0.15), (0.6, -0.05), (2, 2), False, space),
    }
    joints = [
        ao.Tie("a:x1", "b:y1"),
        ao.Rigid("b:y0", "hub"),
        ao.Weld("hub", "c:start"),
        ao.Hinge("c:end", "d:start"),
        ao.Ball("d:end", "arm"),
        ao.Weld("arm", "f:start", point=(0.5, 0.31)),
        ao.Slider("f:end", "foot", axis=(0.6, 0.8, 0.0)),
        ao.Mean("g:y1", "foot"),
    ]
    joints += [
        ao.Bolt("a:y0", "g:x0", ao.Beam(**BEAM, orientation=(0.1, 1.0, 0.0))),
        ao.Bushing(("b", (0.35, 0.1)), ("g", (0.5, -0.05)), {"axial": 7e5}),
        ao.Equation([(("g", CORNER), "y", 2.0), ("c:end", "x", 1.0), ("hub", "rz", -0.5)]),
        ao.Bushing("f:start", "ground", SPRINGS, point=(0.55, 0.28)),
    ]
    supports = [ao.Support("ground")]
    if space:
        still = ("z", "rx", "ry")
        supports.append(ao.Support(lambda x: np.full(x.shape[1], True), still))
        supports += [ao.Support(name, still) for name in POINTS if name != "ground"]
    attached = [
        ao.PointMass("hub", 0.3, (1e-3, 2e-3, 3e-3)),
        ao.PointMass((*CORNER, 0.0) if space else CORNER, 0.1),
        ao.Spring("c:end", {"y": 5e4}),
    ]
    return ao.assemble(parts, joints, PLACES, points=POINTS, supports=supports, attached=attached)


SITE = ao.Site((0.6, 0.23), (0.6, -0.8), part="f")


def check_alike(flat: ao.AntiOscillators, deep: ao.AntiOscillators) -> None:
    """Z(ω) of both is one, up to the rules of the tie on edges and on faces."""
    omega = np.array([0.3, 0.77, 1.4, 2.5]) * flat.omega[0]
    Z = [each.dynamic_stiffness(omega).real for each in (flat, deep)]
    assert flat.k0 == pytest.approx(deep.k0, rel=1e-6)
    assert Z[0] == pytest.approx(Z[1], rel=1e-5)


def test_every_joint_in_the_plane_is_the_one_in_space():
    """Z(ω), and in a run the motions of parts and points, and the reactions."""
    found: list = []
    for space in (False, True):
        part = assembly(space)
        model = ao.extract(part, SITE, n=16)
        hit = ao.simulate(model, ao.RigidMass(0.05, 1.0), ao.Linear(1e6), 1e-3)
        times = np.linspace(0.0, 1e-3, 5)
        places = ("hub", "foot", "arm", "g:y0", "b:x1")
        moved = [ao.probe(part, hit, name, times=times) for name in places]
        turned = [ao.probe(part, hit, name, "rotation", times) for name in ("hub", "arm", "d:end")]
        held = ao.reactions(part, hit, SITE)
        found.append((model, np.array(moved)[..., :2], np.array(turned)[..., -1], held, part.mass))
    (flat, moved, turned, held, mass), (deep, same, alike, reference, other) = found
    check_alike(flat, deep)
    np.testing.assert_allclose(moved, same, rtol=0, atol=1e-5 * np.abs(same).max())
    np.testing.assert_allclose(turned, alike, rtol=0, atol=1e-5 * np.abs(alike).max())
    assert mass == pytest.approx(other, rel=1e-12)
    for name in ("a:x0", "ground"):
        for kind in ("force", "moment"):
            own, there = (getattr(each, kind)[name] for each in (held, reference))
            np.testing.assert_allclose(own, there, rtol=0, atol=1e-3 * np.abs(there).max())
