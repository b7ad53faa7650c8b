"""Parts, sites and dense references on which extractions are tried."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.base.errors import AntioscWarning
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.reduce.site import functional

SOLID = ao.Solid(**parts.STEEL)
PLANE = ao.Solid(**parts.STEEL, plane="strain", thickness=0.02)
RECTANGLE = ao.Section.rectangle(width=0.02, height=0.03)


def quiet(work, *arguments, **options):
    """The result of `work`, without the warning that a point load on a solid diverges."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AntioscWarning)
        return work(*arguments, **options)


def extract(structure: ao.Structure, site: ao.Site, n: int, **options) -> ao.AntiOscillators:
    return quiet(ao.extract, structure, site, n=n, method="modes", **options)


def load(structure: ao.Structure, site: ao.Site) -> np.ndarray:
    return quiet(functional, structure, site).b


def free_part(structure: ao.Structure, b: np.ndarray):
    """Dense K, M and b without the fixed dofs."""
    free = np.setdiff1d(np.arange(len(b)), structure.fixed)
    K, M = (csr(A)[free][:, free].toarray() for A in (structure.K, structure.M))
    return K, M, b[free]


def block(cell: str, supports=(), order: int = 1) -> ao.Structure:
    return ao.Structure(
        parts.box((3, 2, 2), (0.12, 0.05, 0.04), cell), SOLID, supports, order=order
    )


def sheet(cell: str, supports=()) -> ao.Structure:
    return ao.Structure(parts.plate((6, 3), (0.2, 0.06), cell), PLANE, supports)


def tripod(supports=()) -> ao.Structure:
    """Three members in space on one joint, with a fourth on top."""
    points = [(0, 0, 0), (0.5, 0, 0), (0.2, 0.5, 0), (0.2, 0.2, 0.6), (0.5, 0.4, 0.8)]
    mesh = parts.frame(
        points, [(0, 3), (1, 3), (2, 3), (3, 4)], 3,
        groups={"feet": (0, lambda x: np.isclose(x[2], 0))},
    )  # fmt: skip
    beam = ao.Beam(**parts.STEEL, section=RECTANGLE, orientation=(1, 0.2, 0.1))
    return ao.Structure(mesh, beam, supports)


def portal(supports=()) -> ao.Structure:
    points = [(0, 0), (0, 0.6), (0.8, 0.7), (0.8, 0)]
    mesh = parts.frame(
        points, [(0, 1), (1, 2), (2, 3)], 4, groups={"feet": (0, lambda x: np.isclose(x[1], 0))}
    )
    return ao.Structure(mesh, ao.Beam(**parts.STEEL, section=RECTANGLE), supports)


LEFT = [ao.Support("left")]
ON_TOP = ao.Site((0.071, 0.031, 0.04), (0.3, -0.2, -1))
ON_EDGE = ao.Site((0.127, 0.06), (0.2, -1))
ON_FRAME = ao.Site((0.4, 0.333333333333333, 0.733333333333333), (0.4, 1, -0.3), snap=True)
ON_BEAM = ao.Site((0.3, 0.6375), (0.3, -1))

CASES = {
    "tetrahedra": lambda: (block("tetrahedron", LEFT), ON_TOP, 0),
    "hexahedra": lambda: (block("hexahedron", LEFT), ON_TOP, 0),
    "hexahedra of order 2, a patch": lambda: (
        block("hexahedron", LEFT, 2), ao.Site((0.08, 0.025, 0.04), (0, 0.2, -1), radius=0.024), 0
    ),
    "free in space": lambda: (block("tetrahedron"), ON_TOP, 6),
    "free in space, a patch": lambda: (
        block("hexahedron"), ao.Site((0.08, 0.025, 0.04), (0, 0.2, -1), radius=0.024), 6
    ),
    "triangles": lambda: (sheet("triangle", LEFT), ON_EDGE, 0),
    "quadrilaterals": lambda: (sheet("quadrilateral", LEFT), ON_EDGE, 0),
    "free in the plane": lambda: (sheet("quadrilateral"), ON_EDGE, 3),
    "on a hinge line": lambda: (block("hexahedron", [ao.Support("left", ("x", "z"))]), ON_TOP, 1),
    "one rotation left": lambda: (
        sheet("quadrilateral", [ao.Support(lambda x: np.hypot(x[0], x[1]) < 1e-9)]), ON_EDGE, 1
    ),
    "slides and turns": lambda: (sheet("triangle", [ao.Support("left", "y")]), ON_EDGE, 2),
    "slides, hit along": lambda: (
        sheet("triangle", [ao.Support("left", "y"), ao.Support("right", "y")]), ON_EDGE, 1
    ),
    "slides, hit across": lambda: (
        sheet("triangle", [ao.Support("left", "y"), ao.Support("right", "y")]),
        ao.Site((0.127, 0.06), (0, -1)), 1
    ),
    "space frame": lambda: (tripod([ao.Support("feet")]), ON_FRAME, 0),
    "space frame on pins": lambda: (tripod([ao.Support("feet", ("x", "y", "z"))]), ON_FRAME, 0),
    "free space frame": lambda: (tripod(), ON_FRAME, 6),
    "plane frame": lambda: (portal([ao.Support("feet")]), ON_BEAM, 0),
    "free plane frame": lambda: (portal(), ON_BEAM, 3),
}  # fmt: skip
