"""Natural modes: closed forms, sum rules, published plates; shapes in a file."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr

pytestmark = pytest.mark.slow


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
