"""The mesh's error of solids that are joined, against one mesh and finer ones."""

from __future__ import annotations

import dolfinx
import numpy as np
import pytest

import antiosc as ao
from assemblies import NU, RHO, SOLID, E, at, box

#: A material that a recovery of strains keeps apart from `SOLID`, and no more than that.
BESIDE = ao.Solid(E * (1 + 1e-9), NU, RHO)
SITE = ao.Site((1.5, 0.5, 1.0), (0, 0, -1), 0.4)
HELD = ao.Support("x0")


def cut(n: tuple, m: tuple, cell: str = "tetrahedron") -> ao.Structure:
    """A clamped block in two halves that are tied at x = 1."""
    left = ao.Structure(box((0, 0, 0), (1, 1, 1), n, cell), SOLID, [HELD])
    right = ao.Structure(box((1, 0, 0), (2, 1, 1), m, cell), BESIDE)
    return ao.assemble({"left": left, "right": right}, [ao.Tie("left:x1", "right:x0")])


def whole(n: tuple) -> ao.Structure:
    """The same block as one mesh of two materials."""
    raw = box((0, 0, 0), (2, 1, 1), (2 * n[0], *n[1:]), "hexahedron").dolfinx
    cells = np.arange(raw.topology.index_map(3).size_local, dtype=np.int32)
    right = dolfinx.mesh.compute_midpoints(raw, 3, cells)[:, 0] > 1
    tags = dolfinx.mesh.meshtags(raw, 3, cells, right.astype(np.int32))
    facets = np.sort(dolfinx.mesh.locate_entities_boundary(raw, 2, at(0, 0.0)))
    held = dolfinx.mesh.meshtags(raw, 2, facets, np.ones(len(facets), np.int32))
    mesh = ao.read_mesh(raw, groups={"left": (tags, 0), "right": (tags, 1), "x0": (held, 1)})
    return ao.Structure(mesh, {"left": SOLID, "right": BESIDE}, [HELD])


@pytest.mark.slow
def test_joined_halves_have_the_estimate_of_one_mesh():
    n = (3, 4, 4)
    one, two = (
        ao.extract(part, SITE, n=6, error="estimate")
        for part in (whole(n), cut(n, n, "hexahedron"))
    )
    # shapes of high modes are as exact as the extraction, 1e-5
    assert np.diag(two.strain_error) == pytest.approx(np.diag(one.strain_error), rel=1e-4)
    assert two.info["patch"] == pytest.approx(one.info["patch"], rel=1e-6)
    assert two.info.no_estimate is None


@pytest.mark.slow
def test_the_estimate_is_about_the_error_of_unequal_meshes():
    """The softer model has the compliance of halved cells (0.82 to 0.86 of it on three meshes)."""
    n, m = (2, 2, 2), (3, 3, 3)
    coarse = ao.extract(cut(n, m), SITE, n=4, error="estimate")
    fine = ao.extract(cut((4, 4, 4), (6, 6, 6)), SITE, n=4)
    true = 1 / fine.k0 - 1 / coarse.k0
    estimated = 1 / coarse.corrected().k0 - 1 / coarse.k0
    assert 0.5 < estimated / true < 1.5


@pytest.mark.slow
def test_a_budget_of_joined_solids_has_all_shares():
    part = cut((3, 4, 4), (4, 5, 5))
    model = ao.extract(part, SITE, n=12, error="estimate")
    striker = ao.Sphere(radius=0.2, velocity=1.0, E=E, nu=NU, rho=RHO)
    hit = ao.simulate(model, striker, striker.hertz(E, NU), duration=2e-3)
    budget = hit.error_budget
    assert "mesh" not in budget.unknown
    assert budget["peak_force"].mesh > 0
    assert budget["peak_force"].patch > 0
