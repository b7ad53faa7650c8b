"""Structures: what supports hold, and matrices of other codes beside meshes."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")


import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.site import functional
from antiosc.fem.structure import support
from marks import FREE_ON_PURPOSE

pytestmark = [pytest.mark.fem, FREE_ON_PURPOSE]

SOLID = ao.Solid(**parts.STEEL)


def coordinates(structure: ao.Structure, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Dofs of one component and their coordinates (n, 3)."""
    return compat.dof_coordinates(structure.form.space, structure.form.components[name])


def held(structure: ao.Structure, name: str) -> np.ndarray:
    """Coordinates (n, 3) of the dofs of one component that are fixed."""
    dofs, x = coordinates(structure, name)
    return x[np.isin(dofs, structure.fixed)]


# --- Supports -------------------------------------------------------------------------------------


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_a_named_group_holds_all_motions_of_its_face(cell):
    structure = ao.Structure(parts.box(cell=cell), SOLID, [ao.Support("left")])
    for name in "xyz":
        x = held(structure, name)
        assert len(x) == 25  # 2 × 2 elements of order 2 across
        np.testing.assert_allclose(x[:, 0], 0, atol=1e-15)
    assert structure.dofs == structure.K.getSize()[0] - 75
    assert structure.rigid_modes.shape[1] == 0
    K = csr(structure.K)
    fixed = structure.fixed
    np.testing.assert_array_equal(K[fixed][:, fixed].toarray(), np.eye(75))
    assert csr(structure.M)[fixed].nnz == 0 or not csr(structure.M)[fixed].data.any()
    assert abs(K[fixed]).sum() == 75


def test_reading_never_changes_the_shift(monkeypatch):
    """A first estimate of the shift that is far too high is brought closer before it is read."""
    of_mesh = support.of_mesh

    def rough(*arguments):
        modes, shift = of_mesh(*arguments)
        return modes, 1e3 * shift

    section = ao.Section.rectangle(1e-3, 1e-3)
    bar = ao.Beam(**parts.STEEL, section=section)
    monkeypatch.setattr(support, "of_mesh", rough)
    bar = ao.Structure(parts.line(1.0, 40), bar)
    before = bar.shift
    first = 4.730041**4 * parts.STEEL["E"] * 1e-3**2 / (12 * parts.STEEL["rho"])  # ω², length 1 m
    assert first / 100 < before < first
    factor = bar.factorize()
    assert bar.shift == before
    assert bar.factorize() is factor
    A = csr(bar.K) + before * csr(bar.M)
    assert abs(csr(factor.A) - A).max() <= 1e-14 * abs(A).max()
    with pytest.raises(AttributeError):
        bar.shift = 2 * before


# --- Foreign matrices -----------------------------------------------------------------------------


def test_a_structure_is_one_whether_of_a_mesh_or_of_matrices():
    meshed = ao.Structure(parts.box(), SOLID, [ao.Support("left")])
    given = ao.Structure.from_matrices(meshed.K, meshed.M)
    assert isinstance(meshed, ao.Structure)
    assert isinstance(given, ao.Structure)
    assert not hasattr(given, "mesh")
    assert given.uniform_inertia([0, 0, 1]) is None
    assert given.rigid_inertia is None
    for ask in (lambda: given.mass, lambda: given.dimensions, given.constants):
        with pytest.raises(ao.InputError, match="matrices"):
            ask()


# --- Families -------------------------------------------------------------------------------------


class Rubbery:
    """A material of one's own, with the weak form of a solid and a patch by default."""

    kind = SOLID.kind
    patch_radius = 0.02
    weak_form = SOLID.weak_form
    half_space_compliance = SOLID.half_space_compliance
    dimensions = SOLID.dimensions
    bar_speed = SOLID.bar_speed
    constants = SOLID.constants
    plane, thickness = SOLID.plane, SOLID.thickness
    E, nu, rho = SOLID.E, SOLID.nu, SOLID.rho


@pytest.mark.slow
def test_a_family_of_ones_own_says_what_a_site_takes():
    clamp = [ao.Support("left")]
    own, solid = (ao.Structure(parts.box((16, 4, 4)), m, clamp) for m in (Rubbery(), SOLID))
    at, along = (0.1, 0.025, 0.04), (0, 0, -1)
    given = functional(solid, ao.Site(at, along, radius=0.02))
    taken = functional(own, ao.Site(at, along))
    assert taken.radius == given.radius
    np.testing.assert_allclose(taken.b, given.b, atol=1e-12)
    with pytest.raises(ao.InputError, match="material must be a Solid"):
        ao.Structure(parts.box(), SOLID.weak_form)
