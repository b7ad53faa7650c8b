"""Bolts: straight beams between two ends, with their matrices."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
import scipy.sparse

from antiosc.base._types import Array
from antiosc.base.checks import checked_by, instance
from antiosc.base.errors import InputError
from antiosc.fem.assembly.joint import NAME, TwoEnds, end_text, motion
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.elements.beam import Beam, heights
from antiosc.fem.structure.attachments import ElasticTerm

#: Gauss points for the mass matrix, whose integrands are products of two cubics.
GAUSS_POINTS = 5
#: Dofs of bending along y and along z, and the sign of their rotations: about z bending is along y,
#: about y it is along z with the opposite sign.
PLANES = (((1, 5, 7, 11), 1.0), ((2, 4, 8, 10), -1.0))


@dataclass(frozen=True)
class Bolt(TwoEnds):
    """A straight beam between two ends; a group as an end moves by its mean motion.

    The element has the exact static stiffness of a Timoshenko beam, and its consistent mass.

    Parameters
    ----------
    a, b : ends
        As for `Weld`; the beam goes from the centroid of one to that of the other.
    beam : Beam
        Material and section.
    name : str, optional
        Name of the joint in messages.
    """

    beam: Beam = field(metadata=checked_by(instance, Beam, "a Beam"))
    name: str | None = field(default=None, metadata=NAME)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.beam.offset:
            raise InputError("the beam of a Bolt has no offset: it goes from end to end.")

    def elastic(self, layout: Layout, label: str) -> list[ElasticTerm]:
        """ElasticTerm and mass of the beam."""
        ends = [motion(layout, end) for end in (self.a, self.b)]
        line = ends[1].point - ends[0].point
        length = float(np.linalg.norm(line))
        if length <= 1e-9 * layout.size:
            raise InputError(
                f"{label} has no length: {end_text(self.a)} and {end_text(self.b)} have the same "
                "centre; use a Weld."
            )
        for end, end_motion in zip((self.a, self.b), ends, strict=True):
            if not end_motion.turns(layout.rotations):
                raise InputError(
                    f"{label}: {end_text(end)} has no rotation, and the end of a beam needs "
                    'one: give a group of faces, or a radius, ("part", point, radius).'
                )
        axis = line / length
        middle = (ends[0].point + ends[1].point) / 2
        height = np.array([-axis[1], axis[0], 0.0])  # in the plane of plane parts
        if not layout.plane:
            height = heights(self.beam, axis[None], middle[None])[0]
        y = height - (height @ axis) * axis
        y /= np.linalg.norm(y)
        R = np.vstack([axis, y, np.cross(axis, y)])
        k, m = element(self.beam, length)
        rotation = scipy.sparse.block_diag([scipy.sparse.csr_matrix(R)] * 4, format="csr")
        G = (rotation @ scipy.sparse.vstack([end_motion.six for end_motion in ends])).tocsr()
        mass = self.beam.rho * self.beam.section.A * length
        return [ElasticTerm(G, k, m, mass)]


def element(beam: Beam, length: float) -> tuple[Array, Array]:
    """ElasticTerm and mass (12, 12) of a beam along x, its height along y.

    Dofs: x, y, z, rx, ry, rz of the first end, then of the second.
    """
    section = beam.section
    E = beam.E
    rho = beam.rho
    k = np.zeros((12, 12))
    m = np.zeros((12, 12))
    bar = np.array([[1.0, -1.0], [-1.0, 1.0]])
    line = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    polar = section.I + section.side
    for first, stiffness, inertia in (
        (0, E * section.A, rho * section.A),
        (3, beam.G * section.torsion, rho * polar),
    ):
        pair = np.ix_((first, first + 6), (first, first + 6))
        k[pair] += stiffness / length * bar
        m[pair] += inertia * length * line
    for plane, (dofs, sign) in enumerate(PLANES):
        signs = np.array([1.0, sign, 1.0, sign])
        own_k, own_m = _bending(beam, plane, length)
        k[np.ix_(dofs, dofs)] += own_k * np.outer(signs, signs)
        m[np.ix_(dofs, dofs)] += own_m * np.outer(signs, signs)
    return k, m


def _shear_share(beam: Beam, plane: int, L: float) -> float:
    """Timoshenko's φ = 12 EI/(GκA L²); 0 for a beam without shear deformation."""
    if not beam.shear:
        return 0.0
    I, shear = beam.section.planes[plane]  # noqa: E741
    return 12 * beam.E * I / (beam.G * beam.section.A * shear * L**2)


def _bending(beam: Beam, plane: int, L: float) -> tuple[Array, Array]:
    """Bending stiffness (4, 4) of a Timoshenko beam for the deflection and slope of both ends.

    Przemieniecki, *Theory of Matrix Structural Analysis* (1968), chapters 5 and 11.
    """
    I, _ = beam.section.planes[plane]  # noqa: E741
    EI = beam.E * I
    phi = _shear_share(beam, plane, L)
    k = (
        EI
        / ((1 + phi) * L**3)
        * np.array(
            [
                [12, 6 * L, -12, 6 * L],
                [6 * L, (4 + phi) * L**2, -6 * L, (2 - phi) * L**2],
                [-12, -6 * L, 12, -6 * L],
                [6 * L, (2 - phi) * L**2, -6 * L, (4 + phi) * L**2],
            ]
        )
    )
    x, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    s = (x + 1) / 2
    w = w / 2 * L
    factor = 1 / (1 + phi)
    v = factor * np.stack(
        [
            1 - 3 * s**2 + 2 * s**3 + phi * (1 - s),
            L * (s - 2 * s**2 + s**3 + phi / 2 * (s - s**2)),
            3 * s**2 - 2 * s**3 + phi * s,
            L * (-(s**2) + s**3 - phi / 2 * (s - s**2)),
        ]
    )
    rotation = factor * np.stack(
        [
            6 / L * (-s + s**2),
            1 - 4 * s + 3 * s**2 + phi * (1 - s),
            6 / L * (s - s**2),
            -2 * s + 3 * s**2 + phi * s,
        ]
    )
    rho_A = beam.rho * beam.section.A
    rho_I = beam.rotary_inertia(I)
    m = rho_A * np.einsum("iq,jq,q->ij", v, v, w) + rho_I * np.einsum(
        "iq,jq,q->ij", rotation, rotation, w
    )
    return k, m
