"""Free bodies struck off-centre: momentum, angular momentum and energy of rigid-body mechanics."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.errors import AntioscWarning
from antiosc.fem import compat
from antiosc.fem.algebra import csr

pytestmark = pytest.mark.fem

SIZE = np.array([0.12, 0.05, 0.04])
SECTION = ao.Section.rectangle(width=0.02, height=0.03)


def block(E: float = 210e9, order: int = 1) -> ao.Structure:
    return ao.Structure(parts.box((4, 2, 2), SIZE), ao.Solid(E=E, nu=0.3, rho=7850.0), order=order)


def space_frame() -> ao.Structure:
    points = [(0, 0, 0), (0.5, 0, 0), (0.2, 0.5, 0), (0.2, 0.2, 0.6), (0.5, 0.4, 0.8)]
    members = [(0, 3), (1, 3), (2, 3), (3, 4)]
    beam = ao.Beam(**parts.STEEL, section=SECTION, orientation=(1, 0.2, 0.1))
    return ao.Structure(parts.frame(points, members, 3), beam)


def plane_frame() -> ao.Structure:
    points = [(0, 0), (0, 0.6), (0.8, 0.7), (0.8, 0)]
    beam = ao.Beam(**parts.STEEL, section=SECTION)
    return ao.Structure(parts.frame(points, [(0, 1), (1, 2), (2, 3)], 4), beam)


CASES = {
    "block": (block, ao.Site((0.11, 0.04, 0.04), (0.2, -0.3, -1))),
    "space frame": (space_frame, ao.Site((0.5, 0.4, 0.8), (-1, 0.5, 0.3))),
    "plane frame": (plane_frame, ao.Site((0.2, 0.625), (0.3, -1))),
}


def extract(structure: ao.Structure, site: ao.Site, n: int, method: str) -> ao.AntiOscillators:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AntioscWarning)
        return ao.extract(structure, site, n=n, method=method)


def rigid_field(structure: ao.Structure, shift, turn, about) -> np.ndarray:
    """Dofs of the rigid motion u = shift + turn × (x − about), rotation dofs too."""
    u = np.zeros(structure.K.getSize()[0])
    for name, path in structure.form.components.items():
        dofs, x = compat.dof_coordinates(structure.form.space, path)
        if name in "xyz":
            moved = shift + np.cross(turn, x - about)
            u[dofs] = moved[:, "xyz".index(name)]
        else:
            u[dofs] = turn["xyz".index(name[1])]
    return u


def centre_and_inertia(structure: ao.Structure) -> tuple[np.ndarray, np.ndarray]:
    """Centre of mass (3,) and inertia tensor (3, 3) about it, by hand from the geometry."""
    if structure.mesh.tdim == 3:
        mass = 7850.0 * np.prod(SIZE)
        squares = SIZE**2
        return SIZE / 2, mass / 12 * np.diag(squares.sum() - squares)
    x = structure.mesh.dolfinx.geometry.x[compat.geometry_nodes(structure.mesh.dolfinx)]
    a, b = x[:, 0], x[:, 1]
    lengths = np.linalg.norm(b - a, axis=1)
    masses = lengths * SECTION.A * parts.STEEL["rho"]
    centre = masses @ ((a + b) / 2) / masses.sum()
    total = np.zeros((3, 3))
    for p, q, length, m in zip(a, b, lengths, masses, strict=True):
        t = (q - p) / length
        middle = (p + q) / 2 - centre
        across = np.eye(3) - np.outer(t, t)
        total += (
            m * (middle @ middle * np.eye(3) - np.outer(middle, middle))
            + m * length**2 / 12 * across
        )
        # rotary inertia of the section
        if structure.mesh.gdim == 2:
            height = np.cross([0, 0, 1], t)
            y, z = height, np.array([0, 0, 1.0])
        else:
            y = across @ np.array([1, 0.2, 0.1])
            y /= np.linalg.norm(y)
            z = np.cross(t, y)
        per_area = m / SECTION.A
        total += per_area * (
            SECTION.I * np.outer(z, z) + SECTION.side * np.outer(y, y)
            + (SECTION.I + SECTION.side) * np.outer(t, t)
        )  # fmt: skip
    return centre, total


def site_vectors(site: ao.Site) -> tuple[np.ndarray, np.ndarray]:
    point, d = np.zeros(3), np.zeros(3)
    point[: len(site.point)] = site.point
    d[: len(site.direction)] = site.direction
    return point, d / np.linalg.norm(d)


def effective_mass(structure: ao.Structure, site: ao.Site) -> float:
    """1/(1/m + (r×d)·I⁻¹(r×d)): the mass that a blow at the site feels."""
    point, d = site_vectors(site)
    centre, inertia = centre_and_inertia(structure)
    lever = np.cross(point - centre, d)
    if structure.mesh.gdim == 2:
        return 1 / (1 / structure.mass + lever[2] ** 2 / inertia[2, 2])
    return 1 / (1 / structure.mass + lever @ np.linalg.solve(inertia, lever))


@pytest.mark.parametrize("name", CASES)
def test_mass_felt_at_the_site(name):
    make, site = CASES[name]
    structure = make()
    model = extract(structure, site, 5, "modes")
    assert model.k0 == 0.0
    assert model.m_st == pytest.approx(effective_mass(structure, site), rel=1e-10)


@pytest.mark.parametrize("method", ["modes", "krylov"])
@pytest.mark.parametrize("name", CASES)
def test_momentum_and_angular_momentum_after_the_impact(name, method):
    make, site = CASES[name]
    structure = make()
    model = extract(structure, site, 8, method)
    striker = ao.RigidMass(mass=0.3 * model.m_st, velocity=1.0)
    hit = ao.simulate(model, striker, ao.Hertz(1e9), duration=6e-3)
    end = hit.contacts[-1][1]
    assert 0 < end < 5e-3
    impulse = striker.mass * (1.0 - hit.impactor_velocity[-1])
    assert hit.impulse == pytest.approx(impulse, rel=1e-6)
    # With no force on it, what the body carries does not change: the mean velocity suffices.
    times = np.array([end + 1e-5, 6e-3])
    velocity = np.diff(hit.field(times), axis=0)[0] / np.diff(times)
    momentum = csr(structure.M) @ velocity
    point, d = site_vectors(site)
    centre, _ = centre_and_inertia(structure)
    moment = np.cross(point - centre, d) * impulse
    axes = [0, 1] if structure.mesh.gdim == 2 else [0, 1, 2]
    for axis in axes:
        e = np.eye(3)[axis]
        along = rigid_field(structure, e, np.zeros(3), centre) @ momentum
        assert along == pytest.approx(impulse * d[axis], rel=1e-6, abs=1e-7 * impulse)
    for axis in [2] if structure.mesh.gdim == 2 else axes:
        e = np.eye(3)[axis]
        about = rigid_field(structure, np.zeros(3), e, centre) @ momentum
        expected = pytest.approx(moment[axis], rel=1e-6, abs=1e-7 * np.linalg.norm(moment))
        assert about == expected


def test_a_stiff_body_parts_as_rigid_ones_do():
    """Hardly any vibration is left behind: J = 2 v/(1/m1 + 1/m2), and e = 1."""
    site = CASES["block"][1]
    structure = block(E=210e12)
    model = extract(structure, site, 5, "modes")
    felt = effective_mass(structure, site)
    striker = ao.RigidMass(mass=0.5, velocity=2.0)
    hit = ao.simulate(model, striker, ao.Hertz(1e8), duration=4e-3)
    assert len(hit.contacts) == 1
    assert hit.impulse == pytest.approx(2 * 2.0 / (1 / 0.5 + 1 / felt), rel=1e-3)
    assert hit.restitution == pytest.approx(1.0, abs=1e-3)
    # and the body has its share of the energy, translation and rotation
    left = 0.5 * 0.5 * 2.0**2 - 0.5 * 0.5 * hit.impactor_velocity[-1] ** 2
    assert left == pytest.approx(hit.impulse**2 / 2 / felt, rel=1e-3)


def test_a_free_body_thrown_at_an_obstacle():
    """Its rigid motion φ_CR at v0 stops at the site: J = m_CR v0 (1 + e)."""
    make, site = CASES["plane frame"]
    structure = make()
    model = extract(structure, site, 10, "modes")
    hit = ao.simulate(model, ao.Obstacle(), ao.Hertz(1e9), duration=60e-3, initial_velocity=1.5)
    felt = effective_mass(structure, site)
    assert hit.restitution is not None
    assert hit.impulse == pytest.approx(felt * 1.5 * (1 + hit.restitution), rel=1e-4)
    assert hit.energy.kinetic[0] == pytest.approx(0.5 * felt * 1.5**2, rel=1e-9)
    assert hit.energy.drift < 1e-3


def test_gravity_pulls_the_whole_body():
    """In free fall nothing touches and the site falls g t²/2: participation is the whole mass."""
    make, site = CASES["block"]
    structure = make()
    model = extract(structure, site, 6, "modes")
    point, d = site_vectors(site)
    assert model.participation.sum() == pytest.approx(
        (rigid_field(structure, d, np.zeros(3), point) @ (csr(structure.M) @ model.shapes[:, 0])),
        rel=1e-10,
    )
    # a uniform acceleration moves the site along d by g t²/2, so φ_CRᵀMe = m_CR
    assert model.participation.sum() == pytest.approx(model.m_st, rel=1e-9)
    np.testing.assert_allclose(model.participation[1:], model.m, rtol=1e-4, atol=1e-9 * model.m_st)
