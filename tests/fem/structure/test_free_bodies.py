"""What supports leave free: told in words, and struck as rigid-body mechanics has it."""

from __future__ import annotations

import warnings

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from free_bodies import (
    CASES,
    centre_and_inertia,
    effective_mass,
    extract,
    rigid_field,
    site_vectors,
)
from marks import FREE_ON_PURPOSE, TURNS_FAR
from scenes import finely

pytestmark = FREE_ON_PURPOSE


ROUND = ao.Section.circle(0.03)
BAR = ao.Beam(**parts.STEEL, section=ROUND)


def bar() -> ao.Structure:
    """A straight bar in space."""
    return ao.Structure(parts.line(0.8, 6, (1, 2, -2)), BAR)


def stick() -> ao.Structure:
    """A bar in the plane, of several elements."""
    return ao.Structure(parts.frame([(0.1, 0.3), (0.7, 0.5)], [(0, 1)], 5), BAR)


THROWN = {
    "bar": (bar, ao.Site(0.8 * np.array([1, 2, -2]) / 3, (2, 1, 2))),
    "bar in a plane": (stick, ao.Site((0.55, 0.45), (-0.3, 1))),
    "box": CASES["block"],
}
#: velocity of the centre of mass, spin and gravity; in a plane their parts in it
VELOCITY, SPIN, GRAVITY = np.array([0.3, -0.2, 0.4]), np.array([2.0, -3.0, 5.0]), (1.0, 2.0, -9.0)
ROOM, THROW = 2e-4, 4e-3


def planar(structure: ao.Structure, vector, normal: bool = False) -> np.ndarray:
    """The part of a vector that a plane structure can have; `normal`: an axis of rotation."""
    vector = np.array(vector)
    if structure.mesh.gdim == 2:
        vector[[0, 1] if normal else [2]] = 0.0
    return vector


def centred(structure: ao.Structure) -> tuple[np.ndarray, np.ndarray]:
    """Centre of mass and inertia tensor, of a box or bars."""
    if structure.mesh.tdim == 3:
        return centre_and_inertia(structure)
    x = structure.mesh.dolfinx.geometry.x
    a, b = x[np.argmin(x @ [1, 1, 0])], x[np.argmax(x @ [1, 1, 0])]
    length = np.linalg.norm(b - a)
    t = (b - a) / length
    along, across = np.outer(t, t), np.eye(3) - np.outer(t, t)
    per_length = ROUND.A * length**2 / 12 * across + ROUND.I * (across + 2 * along)
    return (a + b) / 2, parts.STEEL["rho"] * length * per_length


def model_of(kind: str, structure: ao.Structure, site: ao.Site):
    with warnings.catch_warnings(action="ignore", category=ao.AntioscWarning):
        if kind == "superposition":
            return ao.superposition(structure, site, 6)
        if kind == "corrected":
            return ao.superposition(structure, site, 6, static_correction=True)
        if kind == "full":
            return ao.full(structure, site)
        return ao.extract(structure, site, n=8, method=kind)


@TURNS_FAR
@pytest.mark.parametrize("kind", ["krylov", "modes", "superposition", "corrected", "full"])
@pytest.mark.parametrize("name", THROWN)
def test_a_falling_spinning_struck_body_moves_as_mechanics_says(name, kind):
    """Closed forms: rigid motion before the blow; with the force known, P, L and the mean motion.

    P = m (V + g t) + d J(t), L = I W + (p - c) x d J(t) about the centre c at rest, and the mass's
    mean displacement and rotation are their time integrals over m and I.
    """
    make, site = THROWN[name]
    structure = make()
    model = model_of(kind, structure, site)
    (centre, tensor), (point, d) = centred(structure), site_vectors(site)
    V, W = planar(structure, VELOCITY), planar(structure, SPIN, normal=True)
    g = planar(structure, GRAVITY)
    striker = ao.RigidMass(mass=0.3 * structure.mass, velocity=3.0)
    hit = ao.simulate(
        model, striker, ao.Hertz(1e9), THROW, gap=ROOM, gravity=g, tol=1e-4,
        initial_velocity=ao.Motion(V, W),
    )  # fmt: skip
    start, end = hit.contacts[0]
    assert 0 < start < end < THROW
    mass = structure.mass
    lever = np.cross(point - centre, d)
    t = hit.time
    # ∫F dt and ∫∫F dt dt at the nodes, F linear between times that are closer than these
    every = 32
    close, F = finely(hit, every)
    h = np.diff(close)
    J = np.concatenate(([0], np.cumsum(h * (F[1:] + F[:-1]) / 2)))
    JJ = np.concatenate(([0], np.cumsum(h * J[:-1] + h**2 * (2 * F[:-1] + F[1:]) / 6)))
    J, JJ = J[::every], JJ[::every]
    P = mass * (V + np.outer(t, g)) + np.outer(J, d)
    L = tensor @ W + np.outer(J, lever)
    axes = slice(None) if structure.mesh.gdim == 3 else slice(2, 3)
    scale = np.linalg.norm(P, axis=1).max()
    np.testing.assert_allclose(hit.momentum, P, atol=1e-6 * scale)
    scale = np.linalg.norm(L[:, axes], axis=1).max()
    np.testing.assert_allclose(hit.angular_momentum[:, axes], L[:, axes], atol=1e-6 * scale)
    # the energy it was given is that of the whole body, and none is lost
    given = mass * V @ V / 2 + W @ tensor @ W / 2 + striker.mass * 3.0**2 / 2
    assert hit.energy.kinetic[0] == pytest.approx(given, rel=1e-6)
    assert hit.energy.drift < 1e-3
    # fields: before the blow a rigid motion; later the mean of all mass moves as a rigid body
    M = csr(structure.M)
    e = [rigid_field(structure, np.eye(3)[i], np.zeros(3), centre) for i in range(3)]
    e += [rigid_field(structure, np.zeros(3), np.eye(3)[i], centre) for i in range(3)]
    before = start * np.array([0.3, 1.0])
    for time, field in zip(before, hit.field(before), strict=True):
        fallen = rigid_field(structure, V * time + g * time**2 / 2, W * time, centre)
        assert np.abs(field - fallen).max() < 1e-6 * np.abs(fallen).max()
    for node in np.flatnonzero(t >= start)[:: max(1, t.size // 40)]:
        moved = M @ hit.field(t[node])
        mean = mass * (V * t[node] + g * t[node] ** 2 / 2) + d * JJ[node]
        turned = tensor @ W * t[node] + lever * JJ[node]
        flat = structure.mesh.gdim == 2
        for i in (0, 1) if flat else range(3):
            assert e[i] @ moved == pytest.approx(mean[i], abs=1e-6 * np.linalg.norm(mean))
        for i in (5,) if flat else range(3, 6):
            expected = pytest.approx(turned[i - 3], abs=1e-6 * np.linalg.norm(turned))
            assert e[i] @ moved == expected


@TURNS_FAR
def test_a_beam_on_a_pin_turns_about_it():
    """Only the rotation is left: a number defines it at the site, a Motion must leave the pin."""
    mesh = parts.frame([(0.0, 0.0), (0.8, 0.6)], [(0, 1)], 6)
    pin = ao.Support(lambda x: np.isclose(x[0], 0.0), fix=("x", "y"))
    structure = ao.Structure(mesh, BAR, [pin])
    across = np.array([-0.6, 0.8, 0.0])
    model = ao.extract(structure, ao.Site((0.8, 0.6), across[:2]), n=6)
    spin = -1.5  # rad/s: the tip, 1 m from the pin, moves at 1.5 m/s against the impact
    stop = ao.Obstacle(gap=1e-3)
    hit = ao.simulate(model, stop, ao.Hertz(1e9), 5e-4, initial_velocity=1.5, gap=1e-2)
    turned = rigid_field(structure, np.zeros(3), [0, 0, spin * 4e-4], np.zeros(3))
    assert np.abs(hit.field(4e-4) - turned).max() < 1e-9 * np.abs(turned).max()
    tensor = ROUND.A / 3 + ROUND.I  # rho and the length 1
    energy = parts.STEEL["rho"] * tensor * spin**2 / 2
    assert hit.energy.kinetic[0] == pytest.approx(energy, rel=1e-9)
    # all its mass turns, that of the held dofs included
    assert model.inertia.mass == pytest.approx(structure.mass, rel=1e-12)
    drawn = structure.mass * spin * np.array([-0.3, 0.4, 0.0])
    np.testing.assert_allclose(hit.momentum[0], drawn, atol=1e-9 * structure.mass)
    same = ao.simulate(
        model, stop, ao.Hertz(1e9), 5e-4, gap=1e-2,
        initial_velocity=ao.Motion(spin=(0, 0, spin), about=(0, 0, 0)),
    )  # fmt: skip
    np.testing.assert_allclose(same.displacement, hit.displacement, atol=1e-12)
    for motion in (ao.Motion(spin=(0, 0, spin)), ao.Motion(velocity=(0, 1, 0))):
        with pytest.raises(ao.InputError, match="supports restrain the body"):
            ao.simulate(model, stop, ao.Hertz(1e9), 1e-3, initial_velocity=motion)
    with pytest.raises(ao.InputError, match="about x"):
        ao.simulate(model, stop, ao.Hertz(1e9), 1e-3, initial_velocity=ao.Motion(spin=(1, 0, 0)))


@TURNS_FAR
@pytest.mark.parametrize("name", CASES)
def test_mass_felt_at_the_site(name):
    make, site = CASES[name]
    structure = make()
    model = extract(structure, site, 5, "modes")
    assert model.k0 == 0.0
    assert model.m_st == pytest.approx(effective_mass(structure, site), rel=1e-10)


SOLID = ao.Solid(70e9, 0.3, 2700.0)
LONG = (0.4, 0.1, 0.2)


def box() -> ao.Mesh:
    return ao.read_mesh(dolfinx.mesh.create_box(MPI.COMM_WORLD, [np.zeros(3), LONG], [3, 1, 2]))


def at(**where: float):
    """Points with these coordinates."""
    return lambda x: np.all([np.isclose(x["xyz".index(k)], v) for k, v in where.items()], axis=0)


def told(mesh, material, supports) -> int:
    with warnings.catch_warnings(record=True, action="always") as said:
        ao.Structure(mesh, material, supports)
    found = [str(one.message) for one in said if "as a rigid body" in str(one.message)]
    assert all(issubclass(one.category, ao.AntioscWarning) for one in said)
    assert len(found) <= 1
    return int(found[0].split("(")[1].split()[0]) if found else 0


CORNER = at(x=0.0, y=0.0, z=0.0)
OTHER = at(x=0.4, y=0.1, z=0.2)
EDGE = at(x=0.0, z=0.0)


@pytest.mark.parametrize(
    ("supports", "count"),
    [
        ([], 0),
        ([ao.Support(at(x=0.0))], 0),
        ([ao.Support(CORNER), ao.Support(OTHER), ao.Support(EDGE)], 0),
        # a roller under a face: it slides along the face and turns about the normal
        (
            [ao.Support(at(x=0.0), "x")],
            3,
        ),
        ([ao.Support(at(x=0.0), ("x", "y"))], 1),
        # a hinge along an edge that lies in y
        ([ao.Support(EDGE)], 1),
        (
            [ao.Support(EDGE, ("x", "z"))],
            2,
        ),
        # two ball joints: it turns about the line between them
        (
            [ao.Support(CORNER), ao.Support(OTHER)],
            1,
        ),
    ],
)
def test_a_box(supports, count):
    assert told(box(), SOLID, supports) == count


BODY = ao.Solid(70e9, 0.33, 2700.0)


def fixed(**where) -> np.ndarray:
    return ao.Structure(parts.box(), BODY, [ao.Support(**where)]).fixed


@pytest.fixture(scope="module")
def x() -> np.ndarray:
    return parts.box().dolfinx.geometry.x


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ({}, "near, box or plane be given; got None"),
        ({"where": "left", "near": ((0, 0, 0), 1)}, "takes one of where, near, box, plane"),
        ({"near": (0, 0, 0)}, r"near must be a pair \(point, radius\)"),
        ({"near": ((0, 0, 0), -1)}, "the radius of near must be >= 0"),
        ({"box": ((0, 0, 1), (1, 1, 0))}, "lower corner .* above the upper"),
        ({"plane": ((0, 0, 0), (0, 0, 0))}, "must not be the zero vector"),
        ({"plane": ((0, 0, 0), "z")}, "normal"),
        ({"near": ((9, 9, 9), 1e-3)}, r"within 0.001 m of \(9, 9, 9\) m fixes nothing.*spans \(0"),
        ({"box": ((5, 5, 5), (6, 6, 6))}, r"in the box from \(5, 5, 5\) m to"),
        ({"plane": ((0, 0, 7), (0, 0, 1))}, r"on the plane through \(0, 0, 7\) m across"),
    ],
)
def test_bad_regions_are_refused_in_words(where, message):
    with pytest.raises(ao.InputError, match=message):
        fixed(**where)
