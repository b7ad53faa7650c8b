"""Curvature of a surface at a site against closed forms: a fit to nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine.contact.curvature import CURVED, EDGE, LINE, PLANE
from antiosc.fem.mesh.surface import Faces
from antiosc.reduce.site.surface import curvature, curvature_at
from parts import STEEL
from sheets import sheet

pytestmark = pytest.mark.fem

#: shape for gmsh, site [m], principal curvatures [1/m], kind
SHAPES = {
    "its end": ("Cylinder(1) = {0, 0, 0, 0, 0, 0.05, 0.01};", (0.003, 0, 0.05), (0, 0), PLANE),
    "outside of a torus": ("Torus(1) = {0, 0, 0, 0.03, 0.01};", (0.04, 0, 0), (25, 100), CURVED),
    "tip of an ellipsoid": (
        "Sphere(1) = {0, 0, 0, 1}; Dilate{{0, 0, 0}, {0.03, 0.02, 0.01}}{Volume{1};}",
        (0, 0, 0.01), (0.01 / 0.03**2, 0.01 / 0.02**2), CURVED,
    ),
    "fillet of 4 mm": (
        "Box(1) = {0, 0, 0, 0.02, 0.02, 0.02}; v() = Fillet{1}{1}{0.004};",
        (0.004 - 0.004 / 2**0.5, 0.004 - 0.004 / 2**0.5, 0.01), (0, 250), LINE,
    ),
    "hole": (
        "Box(1) = {-0.02, -0.02, 0, 0.04, 0.04, 0.02}; Cylinder(2) = {0, 0, 0, 0, 0, 0.02, 0.01};"
        "BooleanDifference(3) = {Volume{1}; Delete;}{Volume{2}; Delete;};",
        (0.01, 0, 0.01), (-100, 0), LINE,
    ),
}  # fmt: skip


def meshed(folder: Path, shape: str, size: float, order: int) -> ao.Mesh:
    (folder / "part.geo").write_text(f'SetFactory("OpenCASCADE"); {shape}')
    return ao.read_mesh(folder / "part.geo", size=size, order=order)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_a_fit_to_nodes_is_within_its_spread(tmp_path: Path, name: str) -> None:
    shape, site, known, kind = SHAPES[name]
    size = {"fillet of 4 mm": 0.002, "tip of an ellipsoid": 0.004}.get(name, 0.003)
    mesh = meshed(tmp_path, shape, size, 2)
    found = curvature(mesh, Faces(mesh, sheet=False), np.array(site, dtype=float))
    assert found.kind == kind
    assert np.abs(found.values - known).max() <= found.error
    assert found.error <= (0.15 if name == "fillet of 4 mm" else 0.08) * max(np.abs(known))


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize("order", [1, 2])
def test_a_shell_is_struck_half_a_thickness_off_its_middle(cell: str, order: int) -> None:
    R, h = 0.05, 0.002

    def arch(s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, ...]:
        angle = 2 * (s - 0.5)
        return R * np.sin(angle), 0.1 * t, R * np.cos(angle)

    part = ao.Structure(sheet(16, arch, cell, order), ao.Shell(70e9, 0.3, 2700.0, h))
    for way, radius in ((-1, R + h / 2), (1, -(R - h / 2))):
        found = curvature_at(part, (0, 0.05, R), (0, 0, way))
        bent = found.values[np.argmax(np.abs(found.values))]
        assert found.kind == LINE
        assert bent == pytest.approx(1 / radius, abs=found.error)
        assert found.error < 0.05 * abs(bent)
        assert found.point[2] == pytest.approx(R - way * h / 2)
    assert curvature_at(part, (0, 0, R), (0, 1, 0)).kind == EDGE


@pytest.mark.slow
def test_a_part_of_an_assembly_is_curved_where_it_lies(tmp_path: Path) -> None:
    shape = SHAPES["tip of an ellipsoid"][0]
    part = ao.Structure(meshed(tmp_path, shape, 0.005, 1), ao.Solid(**STEEL))
    at = ao.Placement(shift=(0.1, 0.2, 0.3), axis=(0, 1, 0), angle=np.pi / 2)
    pair = ao.assemble({"a": part}, at={"a": at})
    found = curvature_at(pair, at.placed(np.array([[0, 0, 0.01]]))[0])
    known = (0.01 / 0.03**2, 0.01 / 0.02**2)
    np.testing.assert_allclose(found.values, known, atol=found.error)
    assert found.error < 0.2 * known[1]
    np.testing.assert_allclose(found.normal, (1, 0, 0), atol=1e-2)
    np.testing.assert_allclose(np.abs(found.directions), [[0, 0, 1], [0, 1, 0]], atol=0.1)
