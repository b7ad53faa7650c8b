"""Strain, stress, rotation and section forces of beams.

The strains of the section are taken at the Gauss points of the stiffness, where they are most
accurate, and interpolated between them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.elements.beam import Beam, heights
from antiosc.fem.recovery.place import Place
from antiosc.fem.recovery.points import PointsInCells, gauss_points, in_frame, lagrange_1d


class Frame(NamedTuple):
    """Axes (P, 3) of the beam at points: its tangent, its height y and z = t × y."""

    t: Array
    y: Array
    z: Array


def section_strains(at: PointsInCells) -> tuple[Array, Frame]:
    """(ε, γy, γz, twist, κy, κz) (P, 6, columns) of the centroid, and the axes."""
    frame = _frame(at)
    nodes = gauss_points(at.part.form.space.element.basix_element.degree)
    found = 0.0
    for x, weight in zip(nodes, lagrange_1d(nodes, at.X[:, 0]).T, strict=True):
        found = found + weight[:, None, None] * _strains(at.moved(np.array([x])), frame)
    return np.asarray(found), frame


def section_forces(at: PointsInCells, place: Place) -> Array:
    """(N, Vy, Vz, T, My, Mz) (P, 6, columns) of beams in space, (N, V, M) of plane ones; N, N m."""
    strains, _ = section_strains(at)
    size = at.part.mesh.extent()

    def stiffness(beam: Beam) -> list[float]:
        s = beam.section
        shear = [beam.shear_stiffness(s.I, size), beam.shear_stiffness(s.side, size)]
        return [beam.E * s.A, *shear, beam.G * s.torsion, beam.E * s.side, beam.E * s.I]

    forces = strains * at.each(stiffness)[:, :, None]
    return forces if at.part.mesh.gdim == 3 else forces[:, [0, 1, 5]]


def strain(at: PointsInCells, place: Place) -> Array:
    """Tensors (P, 3, 3, columns) of a fibre: along it, and its contraction across."""
    strains, frame = section_strains(at)
    y, z = at.each(lambda beam: _fibre(beam, place)).T[:, :, None]
    along = strains[:, 0] - y * strains[:, 5] + z * strains[:, 4]
    nu = at.each(lambda beam: [beam.nu])
    local = np.zeros((len(at.cells), 3, 3, along.shape[1]))
    local[:, 0, 0] = along
    local[:, 1, 1] = local[:, 2, 2] = -nu * along
    return local if place.local else in_frame(local, frame)


def stress(at: PointsInCells, place: Place) -> Array:
    """Tensors (P, 3, 3, columns) of a fibre, Pa: the normal stress of N, My and Mz alone."""
    strains = strain(at, Place(fibre=place.fibre, local=True))
    local = np.zeros_like(strains)
    local[:, 0, 0] = at.each(lambda beam: [beam.E]) * strains[:, 0, 0]
    return local if place.local else in_frame(local, _frame(at))


def rotation(at: PointsInCells, place: Place) -> Array:
    """Rotation of the section (P, 3, columns), rad; (P, 1, columns) of plane beams."""
    names = ("rx", "ry", "rz") if at.part.mesh.gdim == 3 else ("rz",)
    return at.values(at.dofs(names))


def _fibre(beam: Beam, place: Place) -> list[float]:
    """(y, z) of the fibre in the section of a beam, m."""
    if isinstance(place.fibre, int):
        outline = beam.section.outline
        return list(outline[place.fibre % len(outline)])
    return list(place.fibre or (0.0, 0.0))


def _strains(at: PointsInCells, frame: Frame) -> Array:
    length = np.linalg.norm(at.J[:, :, 0], axis=1)[:, None, None]
    displacements, rotations = at.dofs("xyz"), at.dofs(("rx", "ry", "rz"))
    slope = at.slopes(displacements)[:, :, 0] / length
    bend = at.slopes(rotations)[:, :, 0] / length
    turn = at.values(rotations)
    offset = at.each(lambda beam: [beam.offset])

    def along(vectors: Array, axis: Array) -> Array:
        return np.einsum("pck,pc->pk", vectors, axis)

    stretch = -offset * along(bend, frame.z)
    swerve = offset * along(bend, frame.t) if at.part.form.swerves else 0.0
    # −(θ × t)·y = −θ·z, −(θ × t)·z = θ·y
    forces = [
        along(slope, frame.t) + stretch,
        along(slope, frame.y) - along(turn, frame.z),
        along(slope, frame.z) + along(turn, frame.y) + swerve,
    ]
    return np.stack([*forces, *(along(bend, axis) for axis in frame)], axis=1)


def _frame(at: PointsInCells) -> Frame:
    t = at.J[:, :, 0] / np.linalg.norm(at.J[:, :, 0], axis=1)[:, None]
    if at.part.mesh.gdim == 2:
        z = np.broadcast_to([0.0, 0.0, 1.0], t.shape)
        return Frame(t, np.cross(z, t), z)
    middle = at.part.mesh.geometry.nodes[at.cells].mean(axis=1)
    number = at.part.part_of_cells()[at.cells]
    height = np.zeros_like(t)
    for k, (beam, _) in enumerate(at.part.parts):
        own = number == k
        if own.any():
            height[own] = heights(beam, t[own], middle[own])
    y = height - np.einsum("pc,pc->p", height, t)[:, None] * t
    y /= np.linalg.norm(y, axis=1)[:, None]
    return Frame(t, y, np.cross(t, y))
