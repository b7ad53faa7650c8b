"""Natural modes: closed forms, sum rules, published plates; shapes in a file."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr

pytestmark = [pytest.mark.fem, pytest.mark.slow]


def test_a_pinned_beam_by_its_closed_form():
    """ω = (kπ/l)²√(EI/ρA) in both planes; effective masses 8/(kπ)² of the mass for odd k."""
    beam = ao.Beam(
        **parts.STEEL, section=ao.Section.rectangle(0.01, 0.01), orientation=(0, 0, 1), shear=False
    )
    ends = [ao.Support(name, ("x", "y", "z", "rx")) for name in ("left", "right")]
    part = ao.Structure(parts.line(1.0, 40, (1.0, 0, 0)), beam, ends)
    modes = part.natural_modes(8)
    k = np.repeat([1, 2, 3, 4], 2)
    exact = (k * np.pi) ** 2 * np.sqrt(210e9 * 0.01**2 / 12 / 7850)
    np.testing.assert_allclose(modes.omega, exact, rtol=5e-5)
    np.testing.assert_array_equal(modes.multiplicity, 2)
    np.testing.assert_allclose(modes.frequency, modes.omega / 6.283185307179586, rtol=1e-12)
    shares = modes.effective_mass[:, 1:].sum(axis=1) / modes.mass
    pairs = shares[::2] + shares[1::2]  # in the two planes together
    np.testing.assert_allclose(pairs, 2 * np.array([8, 0, 8 / 9, 0]) / np.pi**2, atol=1e-5)
    assert np.abs(modes.participation[:, 0]).max() < 1e-6


@pytest.mark.parametrize("held", [True, False])
def test_effective_masses_sum_to_the_mass_that_moves(held):
    """Over all modes: rᵀM⁻¹r with r = M e on the free dofs; of a free part the total mass."""
    solid = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
    supports = [ao.Support("left")] if held else []
    part = ao.Structure(parts.plate((4, 2), (0.2, 0.06)), solid, supports)
    modes = ao.natural_modes(part, part.dofs)
    assert modes.n == part.dofs
    total = modes.effective_mass.sum(axis=0)
    free = np.setdiff1d(np.arange(part.rows), part.fixed)
    M = csr(part.M)[free][:, free].toarray()
    for axis in (0, 1):
        r = part.uniform_inertia(np.eye(3)[axis])[free]
        assert total[axis] == pytest.approx(r @ np.linalg.solve(M, r), rel=1e-9)
    assert total[2] == 0
    if held:
        assert np.all(total[:2] < modes.mass)
        assert np.all(total[:2] > 0.8 * modes.mass)
    else:
        np.testing.assert_allclose(total[:2], modes.mass, rtol=1e-9)
        np.testing.assert_allclose(modes.effective_mass[:3, :2].sum(axis=0), modes.mass, rtol=1e-9)
        np.testing.assert_array_equal(modes.omega[:3], 0)
        np.testing.assert_array_equal(modes.multiplicity[:3], 3)


def square(supports, thickness, n=8, points=((0, 0), (10, 0), (10, 10), (0, 10))):
    """A quadrilateral plate of n × n cells of NAFEMS's material."""
    import dolfinx
    from mpi4py import MPI

    mesh = dolfinx.mesh.create_unit_square(
        MPI.COMM_WORLD, n, n, dolfinx.mesh.CellType.triangle, diagonal=diagonal(points)
    )
    s, t = mesh.geometry.x[:, 0].copy(), mesh.geometry.x[:, 1].copy()
    corners = np.array(points, dtype=float)
    mesh.geometry.x[:, :2] = (
        corners[0] + np.outer(s, corners[1] - corners[0]) + np.outer(t, corners[3] - corners[0])
    )
    shell = ao.Shell(E=200e9, nu=0.3, rho=8000.0, thickness=thickness)
    return ao.Structure(ao.read_mesh(mesh), shell, supports)


def diagonal(points):
    import dolfinx

    kind = getattr(dolfinx.mesh, "DiagonalType", None) or dolfinx.cpp.mesh.DiagonalType
    return kind.crossed if points[1][0] == points[2][0] else kind.right


@pytest.mark.slow
def test_nafems_fv12_free_thin_square_plate():
    """NAFEMS R0015, values recalled: 1.622, 2.360, 2.922, 4.233 (twice), 7.416 Hz after 6 rigid.

    They come from series that lie up to 1 % high (see test_shell).
    """
    modes = square([], 0.05).natural_modes(12)
    np.testing.assert_array_equal(modes.multiplicity[:6], 6)
    np.testing.assert_allclose(
        modes.frequency[6:], [1.622, 2.360, 2.922, 4.233, 4.233, 7.416], rtol=1.2e-2
    )
    assert list(modes.multiplicity[6:]) == [1, 1, 1, 2, 2, 2]


def test_nafems_fv16_cantilevered_thin_square_plate():
    """NAFEMS R0015, values recalled: 0.421, 1.029, 2.582, 3.306, 3.753, 6.555 Hz."""
    modes = square([ao.Support(lambda x: np.isclose(x[0], 0))], 0.05).natural_modes(6)
    np.testing.assert_allclose(
        modes.frequency, [0.421, 1.029, 2.582, 3.306, 3.753, 6.555], rtol=1.2e-2
    )


def test_nafems_fv22_clamped_thick_rhombic_plate():
    """NAFEMS R0015, as Altair's verification OS-V: 0435 lists it.

    Sides of 10 m at 45°, 1 m thick; 133.95, 201.41, 265.81, 283.68, 334.45 Hz.
    """
    run = 10 / np.sqrt(2)
    points = ((0, 0), (10, 0), (10 + run, run), (run, run))
    edge = ao.Support(
        lambda x: (
            np.isclose(x[1], 0)
            | np.isclose(x[1], run)
            | np.isclose(x[0], x[1])
            | np.isclose(x[0], 10 + x[1])
        )
    )
    part = square([edge, ao.Support(lambda x: x[0] > -1, ("x", "y", "rz"))], 1.0, 8, points)
    modes = part.natural_modes(5)
    np.testing.assert_allclose(
        modes.frequency, [133.95, 201.41, 265.81, 283.68, 334.45], rtol=1.5e-2
    )


def test_nafems_fv52_simply_supported_solid_square_plate():
    """NAFEMS R0015, values recalled: 3 rigid, 45.897, 109.44 (twice), 167.89, 193.59 Hz.

    10 × 10 × 1 m; z held on the four sides, as MathWorks's example of it has them (held on their
    lower edges alone the plate is softer, 43.96 Hz). The frequencies are those of Mindlin's plate
    whose edges also do not twist: the solid is softer, by 2.8 % in the first.
    """
    sides = ao.Support(lambda x: np.isclose(abs(x[0] - 5), 5) | np.isclose(abs(x[1] - 5), 5), "z")
    mesh = parts.box((8, 8, 1), (10.0, 10.0, 1.0))
    with pytest.warns(ao.AntioscWarning, match="free to move"):
        part = ao.Structure(mesh, ao.Solid(E=200e9, nu=0.3, rho=8000.0), [sides])
    modes = part.natural_modes(8)
    np.testing.assert_array_equal(modes.omega[:3], 0)
    np.testing.assert_allclose(
        modes.frequency[3:], [45.897, 109.44, 109.44, 167.89, 193.59], rtol=3e-2
    )
    assert list(modes.multiplicity[3:7]) == [1, 2, 2, 1]


def test_shapes_are_written_with_their_names(tmp_path):
    part = ao.Structure(parts.box((3, 2, 1)), ao.Solid(**parts.STEEL), [ao.Support("left")])
    modes = part.natural_modes(3)
    found = meshio.read(modes.write(tmp_path / "modes"))
    assert sorted(found.point_data) == ["mode 1", "mode 2", "mode 3"]
    for field in found.point_data.values():
        assert np.linalg.norm(field, axis=1).max() == pytest.approx(1)
    rows = [row.split() for row in modes.summary().splitlines()]
    assert len(rows) == 5
    shares = 100 * modes.effective_mass / modes.mass
    for i, row in enumerate(rows[1:4]):
        assert [int(row[0]), float(row[1]), int(row[2])] == pytest.approx(
            [i + 1, modes.frequency[i], modes.multiplicity[i]], rel=1e-5
        )
        assert [float(v.strip("%")) for v in row[3:]] == pytest.approx(shares[i], abs=0.006)
    total = [float(v.strip("%")) for v in rows[4][1:]]
    assert total == pytest.approx(shares.sum(axis=0), abs=0.006)
    with pytest.raises(ao.InputError, match="at most"):
        part.natural_modes(part.dofs + 1)


def test_given_matrices_have_frequencies_alone():
    K = np.diag([2.0, 2.0, 1.0]) - np.diag([1.0, 1.0], 1) - np.diag([1.0, 1.0], -1)
    modes = ao.Structure.from_matrices(1e6 * K, np.eye(3)).natural_modes(3)
    np.testing.assert_allclose(modes.omega, np.sqrt(np.linalg.eigvalsh(1e6 * K)), rtol=1e-9)
    assert modes.participation is None
    assert modes.mass is None
    with pytest.raises(ao.InputError, match=r"no mesh|coordinates"):
        modes.write("none")
