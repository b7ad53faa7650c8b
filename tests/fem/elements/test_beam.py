"""Beams and rods: patches, frames, closed forms of trusses."""

from __future__ import annotations

from dataclasses import replace

import dolfinx
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat

FLAT = ao.Section.rectangle(width=0.02, height=0.05)


def beam(section: ao.Section = FLAT, **extra) -> ao.Beam:
    return ao.Beam(**parts.ALUMINIUM, section=section, **extra)


def dofs_at(structure: ao.Structure, point, names) -> list[int]:
    """The dofs of the components `names` at the node nearest to `point`."""
    found = []
    for name in names:
        dofs, x = compat.dof_coordinates(structure.form.space, structure.form.components[name])
        target = np.zeros(3)
        target[: len(point)] = point
        found.append(int(dofs[np.argmin(np.linalg.norm(x - target, axis=1))]))
    return found


def solve(structure: ao.Structure, point, loads: dict[str, float]) -> dict[str, float]:
    """Motions at `point` under forces and moments there."""
    f = np.zeros(structure.K.getSize()[0])
    f[dofs_at(structure, point, loads)] = list(loads.values())
    u = scipy.sparse.linalg.spsolve(csr(structure.K).tocsc(), f)
    return {n: u[dofs_at(structure, point, [n])[0]] for n in structure.form.components}


def test_sections_by_their_definitions():
    r = ao.Section.rectangle(0.02, 0.05)
    assert (r.A, r.I, r.side) == pytest.approx((1e-3, 0.02 * 0.05**3 / 12, 0.05 * 0.02**3 / 12))
    square = ao.Section.rectangle(0.1, 0.1)
    assert square.torsion == pytest.approx(0.140577 * 1e-4, rel=1e-5)  # Timoshenko & Goodier, §109
    strip = ao.Section.rectangle(1.0, 1e-3)
    assert strip.torsion == pytest.approx(1e-9 / 3 * (1 - 0.630249e-3), rel=1e-6)
    d = ao.Section.circle(0.04)
    np.testing.assert_allclose([d.A, d.I], [np.pi * 0.02**2, np.pi * 0.02**4 / 4])
    assert d.torsion == pytest.approx(np.pi * 0.02**4 / 2)
    tube = ao.Section.tube(0.04, 0.001)
    thin = np.pi * 0.039 * 0.001
    np.testing.assert_allclose(tube.A, thin, rtol=1e-12)
    np.testing.assert_allclose(tube.I, thin * 0.0195**2 / 2, rtol=1e-3)
    full = ao.Section.tube(0.04, 0.02 * (1 - 1e-9))
    np.testing.assert_allclose(full.I, d.I, rtol=1e-8)


@pytest.mark.slow
def test_linear_element_is_the_classical_one():
    """One-point shear: 2-node Timoshenko element, e.g. Hughes, The FEM (1987), §5.4."""
    L = 0.3
    structure = ao.Structure(parts.line(L, 1), beam(), order=1)
    order = [dofs_at(structure, p, [n])[0] for p in [(0, 0), (L, 0)] for n in ("x", "y", "rz")]
    K, M = (csr(A)[order][:, order].toarray() for A in (structure.K, structure.M))
    b = beam()
    EA, GA, EI = b.E * FLAT.A, b.G * FLAT.A * FLAT.shear, b.E * FLAT.I
    s = GA / L
    expected = np.array([
        [EA / L, 0, 0, -EA / L, 0, 0],
        [0, s, s * L / 2, 0, -s, s * L / 2],
        [0, s * L / 2, s * L**2 / 4 + EI / L, 0, -s * L / 2, s * L**2 / 4 - EI / L],
        [-EA / L, 0, 0, EA / L, 0, 0],
        [0, -s, -s * L / 2, 0, s, -s * L / 2],
        [0, s * L / 2, s * L**2 / 4 - EI / L, 0, -s * L / 2, s * L**2 / 4 + EI / L],
    ])  # fmt: skip
    np.testing.assert_allclose(K, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    line = np.array([[2, 1], [1, 2]]) * L / 6
    weights = np.diag([b.rho * FLAT.A] * 2 + [b.rho * FLAT.I])
    np.testing.assert_allclose(M, np.kron(line, weights), rtol=0, atol=1e-14)


FRAMES = {
    "plane": ([(0, 0), (0.3, 1.0), (1.2, 0.8), (0.5, 0.4)], [(0, 1), (1, 2), (1, 3)], None),
    "space": (
        [(0, 0, 0), (0.3, 0.1, 1.0), (1.2, 0.8, 0.9), (0.5, -0.4, 0.7), (0.3, 0.1, 2.0)],
        [(0, 1), (1, 2), (1, 3), (1, 4), (3, 4)], (0.3, 1.0, 0.1)),
}  # fmt: skip


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", FRAMES)
def test_mass_and_rigid_motions_of_a_frame(name, order):
    points, members, orientation = FRAMES[name]
    structure = ao.Structure(
        parts.frame(points, members, 2), beam(orientation=orientation), order=order
    )
    lengths = [np.linalg.norm(np.subtract(points[a], points[b])) for a, b in members]
    mass = sum(lengths) * FLAT.A * parts.ALUMINIUM["rho"]
    assert structure.mass == pytest.approx(mass, rel=1e-13)
    K, M, R = csr(structure.K), csr(structure.M), structure.rigid_modes
    count = 3 if name == "plane" else 6
    assert R.shape[1] == count
    np.testing.assert_allclose(R.T @ (M @ R), np.eye(count), atol=1e-11)
    assert np.abs(K @ R).max() < 1e-12 * abs(K).max() * np.abs(R).max()
    # No other null vector: nothing is loose at the joints.
    values = scipy.linalg.eigvalsh(K.toarray(), M.toarray())
    assert values[count] > 1e-3 * structure.shift
    assert abs(values[count - 1]) < 1e-6 * values[count]


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0, 1), (1, 2, -2)])
def test_a_straight_line_has_all_six_rigid_motions(direction):
    """Along an axis too, where two coordinates are zero everywhere."""
    L = 0.8
    mesh = parts.line(L, 4, direction)
    structure = ao.Structure(mesh, beam(ao.Section.circle(0.03)))
    assert structure.rigid_modes.shape[1] == 6
    R, M = structure.rigid_modes, csr(structure.M)
    # spin about its own axis: the polar inertia rho (I + I) L
    along = np.asarray(direction) / np.linalg.norm(direction)
    spin = np.zeros(len(R))
    for axis, name in enumerate(("rx", "ry", "rz")):
        spin[compat.dof_coordinates(structure.form.space, structure.form.components[name])[0]] = (
            along[axis]
        )
    section = structure.parts[0][0].section
    polar = 2 * parts.ALUMINIUM["rho"] * section.I * L
    assert spin @ (M @ spin) == pytest.approx(polar, rel=1e-12)
    assert np.linalg.norm(spin - R @ (R.T @ (M @ spin))) < 1e-9 * np.linalg.norm(spin)


@pytest.mark.parametrize("n", [1, 4])
def test_cantilever_with_quadratic_elements_is_exact_at_the_tip(n):
    """F L³/3EI + F L/κGA and M L/EI: cubic deflections, quadratic ones at two-point shear."""
    L = 0.7
    structure = ao.Structure(parts.line(L, n), beam(), [ao.Support("left")])
    EI, GA = beam().E * FLAT.I, beam().G * FLAT.A * FLAT.shear
    under_force = solve(structure, (L, 0), {"y": 1.0})
    assert under_force["y"] == pytest.approx(L**3 / 3 / EI + L / GA, rel=1e-9)
    assert under_force["rz"] == pytest.approx(L**2 / 2 / EI, rel=1e-9)
    under_moment = solve(structure, (L, 0), {"rz": 1.0})
    assert under_moment["rz"] == pytest.approx(L / EI, rel=1e-9)
    assert solve(structure, (L, 0), {"x": 1.0})["x"] == pytest.approx(
        L / beam().E / FLAT.A, rel=1e-10
    )


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0, 1), (2, -1, 2)])
@pytest.mark.parametrize("order", [1, 2])
def test_orientation_in_space(direction, order):
    """Forces along and across the height, a torque and a pull, on a cantilever in space.

    Its shear coefficients along the height and across it differ.
    """
    L = 0.6
    t = np.asarray(direction) / np.linalg.norm(direction)
    tilted = np.array([0.2, 1.0, 0.3])
    y = tilted - tilted @ t * t
    y /= np.linalg.norm(y)
    z = np.cross(t, y)
    b = beam(replace(FLAT, shear_side=0.3), orientation=tuple(tilted))
    n = 4 if order == 2 else 40
    structure = ao.Structure(parts.line(L, n, direction), b, [ao.Support("left")], order=order)
    tip = L * t
    A, G, E = FLAT.A, b.G, b.E
    # the classical element's only error is known: see test_linear_elements_do_not_lock
    lack = 0 if order == 2 else (L / n) ** 2 / 12
    for axis, compliance in [
        (t, L / E / A),
        (y, L**3 / 3 / E / FLAT.I + L / G / A / FLAT.shear - L * lack / E / FLAT.I),
        (z, L**3 / 3 / E / FLAT.side + L / G / A / 0.3 - L * lack / E / FLAT.side),
    ]:
        u = solve(structure, tip, dict(zip("xyz", axis, strict=True)))
        moved = np.array([u[c] for c in "xyz"])
        np.testing.assert_allclose(moved, compliance * axis, rtol=0, atol=2e-8 * compliance)
    twisted = solve(structure, tip, dict(zip(("rx", "ry", "rz"), t, strict=True)))
    turn = np.array([twisted[c] for c in ("rx", "ry", "rz")])
    np.testing.assert_allclose(
        turn, L / G / FLAT.torsion * t, rtol=1e-8, atol=1e-12 * np.abs(turn).max()
    )


#: The ten-bar truss: points over its bay and pairs of them.
POINTS = np.array([[2, 1], [2, 0], [1, 1], [1, 0], [0, 1], [0, 0]]) * 9.144
BARS = np.array([(4, 2), (2, 0), (5, 3), (3, 1), (2, 3), (0, 1), (4, 3), (5, 2), (2, 1), (3, 0)])
E, RHO, AREAS = 69e9, 2770.0, (1e-3, 3e-3)
SECOND = np.arange(10) >= 6  # the diagonals are thicker


@pytest.fixture(scope="module")
def truss() -> ao.Structure:
    mesh = parts.frame(POINTS, BARS, 1).dolfinx
    ends = mesh.geometry.x[compat.geometry_nodes(mesh)]
    slanted = np.all(np.ptp(ends, axis=1)[:, :2] > 1, axis=1)
    groups = {}
    for name, own in (("thin", ~slanted), ("thick", slanted)):
        cells = np.flatnonzero(own).astype(np.int32)
        groups[name] = dolfinx.mesh.meshtags(mesh, 1, cells, np.ones_like(cells)), 1
    families = {k: ao.Truss(E, 0.3, RHO, a) for k, a in zip(groups, AREAS, strict=True)}
    wall = ao.Support(lambda x: np.isclose(x[0], 0))
    return ao.Structure(ao.read_mesh(mesh, groups=groups), families, [wall])


@pytest.mark.slow
def test_axial_forces_and_stresses(truss):
    """Of a blow, from the displacements of the ends of the bars."""
    site = ao.Site(tuple(POINTS[1]), (0, -1))
    hit = ao.simulate(ao.extract(truss, site, n=7), ao.RigidMass(5.0, 2.0), ao.Linear(1e7), 0.01)
    times = np.array([3e-3, 8e-3])
    for pair, thick in zip(BARS, SECOND, strict=True):
        area = AREAS[int(thick)]
        along = np.diff(POINTS[pair], axis=0)[0]
        length = np.linalg.norm(along)
        t = along / length
        a, b = (ao.probe(truss, hit, tuple(POINTS[n]), times=times) for n in pair)
        force = E * area / length * (b - a) @ t
        point = tuple(POINTS[pair[0]] + 0.45 * along)  # the diagonals cross at their middles
        assert np.abs(force).max() > 10
        found = ao.probe(truss, hit, point, "section_forces", times)
        np.testing.assert_allclose(found[:, 0], force, rtol=1e-9, atol=1e-9)
        stress = ao.probe(truss, hit, point, "stress", times)
        exact = (force / area)[:, None, None] * np.outer(t, t)
        np.testing.assert_allclose(stress[:, :2, :2], exact, rtol=1e-9, atol=1e-4)
        strain = ao.probe(truss, hit, point, "strain", times, axes="local")
        exact = (force / (E * area))[:, None, None] * np.diag([1, -0.3, -0.3])
        np.testing.assert_allclose(strain, exact, rtol=1e-9, atol=1e-15)
    with pytest.raises(ao.InputError, match="rotation"):
        ao.probe(truss, hit, tuple(POINTS[1]), "rotation", times)
