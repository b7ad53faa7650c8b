"""`strike` makes meshes of shells until the error budget meets the tolerance."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.mesh.finer import refined
from antiosc.fem.platform import compat
from antiosc.impact.histories.bars import QUANTITIES
from sheets import NU, RHO, SIMPLE, E, edges, flipped, plate, rectangle, sheet

pytestmark = [pytest.mark.fem, pytest.mark.slow]

SHELL = ao.Shell(E, NU, RHO, 0.04)
SOFT = [ao.Support(edges(0, 1), ("x", "y", "z"))]
IMPACT = (ao.RigidMass(5.0, 1.0), ao.Hertz(3e9), 4e-3)
SQUARE = 'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 1, 1};'

SITE = ao.Site((0.41, 0.37, 0.0), (0, 0, -1), radius=0.05)
HELD = {"hard": SIMPLE, "soft": SOFT}


@cache
def reference(ends: str) -> ao.History:
    """On a fine mesh of another element: quadrilaterals."""
    part = plate(14, 0.04, "quadrilateral", HELD[ends])
    return ao.simulate(ao.extract(part, SITE, n=40), *IMPACT, tol=1e-6)


@pytest.mark.parametrize(
    ("given", "tol", "ends"), [("mesh", 2e-3, "hard"), ("geometry", 5e-3, "soft")]
)
def test_the_tolerance_is_met(given, tol, ends, tmp_path):
    source: object = rectangle(4, 1.0, 1.0)
    if given == "geometry":
        source = tmp_path / "plate.geo"
        source.write_text(SQUARE)
    hit = ao.strike(source, SITE, *IMPACT, tol=tol, material=SHELL, supports=HELD[ends])
    true = reference(ends)
    records = hit.model.info["strike"]
    budget = hit.error_budget
    assert budget.numerical <= tol
    assert hit.status == (budget.worst > tol)  # by the share of the law
    assert "shell theory itself" in " ".join(budget.notes)
    for name in QUANTITIES:
        error = abs(getattr(hit, name) / getattr(true, name) - 1)
        assert error <= tol + 1e-5
        assert error <= budget[name].numerical + 1e-5  # the reference is a shell, too
    assert hit.model.strain_misfit is not None  # the raw model
    if given == "mesh":
        assert len(records) > 1
        assert records[-1]["dofs"] > 2 * records[0]["dofs"]


def test_divided_triangles_keep_their_side():
    """Layers lie toward the normals of the cells, which follow from the order of their nodes."""

    def normals(mesh: ao.Mesh) -> np.ndarray:
        x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
        return np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])

    bent = sheet(3, lambda s, t: (s, t, 0.2 * s * (1 - s)))
    up = normals(bent)[:, 2] > 0
    turned = flipped(bent, np.flatnonzero(up))
    assert np.all(normals(turned)[:, 2] < 0)
    ratio = np.where(np.arange(turned.n_cells) < 7, 0.4, 1.0)
    finer = refined(turned, ratio)
    assert finer.n_cells > turned.n_cells
    assert np.all(normals(finer)[:, 2] < 0)
