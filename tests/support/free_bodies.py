"""Free bodies that are struck, thrown and spun."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.base.errors import AntioscWarning
from antiosc.fem.platform import compat

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
