"""The parts of meshes/: their groups, and their measures against closed forms.

Read with gmsh itself, so that nothing here depends on antiosc's own reader.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from math import hypot, pi
from pathlib import Path

import numpy as np
import pytest

from paths import MESHES

pytestmark = pytest.mark.fem

FOLDER = MESHES
MM, MM2, MM3 = 1e-3, 1e-6, 1e-9

# Measure of each group: number of points, or length, area, volume in SI units.
SEATS = 2 * (2 * pi * 9 * 3 + pi * (9**2 - 4.5**2) + 2 * pi * 4.5 * 7)
UNDERSIDE = 84 * 60 - 2 * (10**2 - pi * 10**2 / 4) - 2 * pi * 4.5**2
LEVER = 135 * 30 + pi * 15**2 / 2 + 65 * 30 + (12**2 - pi * 12**2 / 4) - pi * 8**2
PARTS = {
    "bracket": {
        "body": (3, None),  # held against the STEP file below
        "clamp": (2, SEATS * MM2),
        "base": (2, UNDERSIDE * MM2),
        "eye": (2, 2 * pi * 18 * (28 - 15) * MM2),
        "bore": (2, 2 * pi * 11 * 28 * MM2),
        "front": (2, pi * (18**2 - 11**2) * MM2),
    },
    "lever": {
        "body": (2, LEVER * MM2),
        "clamp": (1, 2 * pi * 8 * MM),
        "edge": (1, pi * 15 * MM),
        "end": (1, 30 * MM),
    },
    "arch": {
        "body": (2, pi / 2 * (100**2 - 80**2) * MM2),
        "clamp": (1, 2 * 20 * MM),
        "edge": (1, pi * 100 * MM),
    },
    "beam": {"beam": (1, 1.0), "left": (0, 1), "middle": (0, 1), "right": (0, 1)},
    "frame": {
        "columns": (1, 4 * 1.3),
        "beams": (1, 2 * 2 * (1.0 + 0.8)),
        "braces": (1, sum(2 * hypot(width, h) for width in (1.0, 0.8) for h in (0.7, 0.6))),
        "feet": (0, 4),
        "top": (0, 4),
    },
}


@contextmanager
def opened(path: Path | None = None) -> Iterator:
    """gmsh, with the file at `path` open in it."""
    import gmsh

    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 1)
        if path is not None:
            gmsh.open(str(path))
        yield gmsh
    finally:
        gmsh.finalize()


def groups(gmsh) -> dict[str, tuple[int, list[int]]]:
    """Dimension and entities of each physical group, by name."""
    return {
        gmsh.model.getPhysicalName(dim, tag): (
            dim,
            list(gmsh.model.getEntitiesForPhysicalGroup(dim, tag)),
        )
        for dim, tag in gmsh.model.getPhysicalGroups()
    }


def jacobians(gmsh, dim: int, entity: int) -> Iterator[tuple[np.ndarray, ...]]:
    """Weights (q,), determinants (cells, q), points (cells, q, 3) per element type of an entity."""
    for kind in gmsh.model.mesh.getElementTypes(dim, entity):
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss6")
        _, determinants, x = gmsh.model.mesh.getJacobians(kind, points, entity)
        q = len(weights)
        yield np.array(weights), np.reshape(determinants, (-1, q)), np.reshape(x, (-1, q, 3))


def moments(gmsh, dim: int, entities: list[int]) -> np.ndarray:
    """Measure of the elements on `entities` (points: their number), then their centroid."""
    sums = np.zeros(4)
    for tag in entities:
        if dim == 0:
            sums += (1, *gmsh.model.mesh.getNodes(0, tag)[1])
            continue
        for weights, determinants, x in jacobians(gmsh, dim, tag):
            parts = determinants * weights
            sums += (parts.sum(), *np.einsum("cq,cqi->i", parts, x))
    return np.array([sums[0], *sums[1:] / sums[0]])


def measures(gmsh) -> dict[str, tuple[int, float]]:
    """Dimension and measure of each physical group, by name."""
    return {
        name: (dim, moments(gmsh, dim, entities)[0])
        for name, (dim, entities) in groups(gmsh).items()
    }


def elements(gmsh) -> set[str]:
    """The types of element in the mesh, in gmsh's words."""
    kinds = gmsh.model.mesh.getElementTypes()
    return {gmsh.model.mesh.getElementProperties(kind)[0] for kind in kinds}


def solid(path: Path) -> tuple[float, np.ndarray, int]:
    """Volume (mm³), centre of mass (mm) and number of faces of the one solid in a STEP file."""
    with opened() as gmsh:
        # Said each time: OpenCASCADE keeps the unit of the file before, even through finalize.
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.open(str(path))
        ((_, tag),) = gmsh.model.getEntities(3)
        centre = gmsh.model.occ.getCenterOfMass(3, tag)
        return gmsh.model.occ.getMass(3, tag), np.array(centre), len(gmsh.model.getEntities(2))


def script(part: str):
    """The script of meshes/ that makes a part."""
    spec = importlib.util.spec_from_file_location(f"make_{part}", FOLDER / f"make_{part}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A folder with what the scripts of meshes/ make."""
    folder = tmp_path_factory.mktemp("meshes")
    for part in PARTS:
        script(part).main(folder)
    return folder


@pytest.mark.parametrize("part", PARTS)
def test_groups_have_their_names_and_closed_form_measures(part):
    with opened(FOLDER / f"{part}.msh") as gmsh:
        found = measures(gmsh)
    assert found.keys() == PARTS[part].keys()
    for name, (dim, expected) in PARTS[part].items():
        assert found[name][0] == dim, name
        assert found[name][1] > 0, name
        if expected is not None:
            assert found[name][1] == pytest.approx(expected, rel=2e-4), name
