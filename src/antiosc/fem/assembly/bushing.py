"""`Bushing` and `Bolt`: springs, dampers or a beam between two ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse

from antiosc.base._types import Array
from antiosc.base.checks import checked_by, coordinates, instance, positive, shown
from antiosc.base.errors import InputError
from antiosc.fem.assembly.ends import End, Motion, end_text, motion, tell_gap
from antiosc.fem.assembly.joint import NAME, Between, Stiffness
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.assembly.pins import COINCIDENT, carried
from antiosc.fem.elements.beam import Beam, heights
from antiosc.fem.structure.attachments import by_components
from antiosc.fem.structure.placement import in_space
from antiosc.io.dof_map import COMPONENTS

AXES = (*COMPONENTS, "axial")
OF_AXES = checked_by(by_components, "Bushing", AXES)


def _branches(_: str, given: object) -> tuple[tuple[dict[str, float], float], ...]:
    """Stiffnesses by components and relaxation times."""
    if not isinstance(given, list | tuple) or any(
        not isinstance(one, list | tuple) or len(one) != 2 for one in given
    ):
        raise InputError(
            f"branches must list pairs ({{'z': 1e6}}, relaxation time in s); got {shown(given)}."
        )
    return tuple(
        (
            by_components("stiffness of a branch", own, "Bushing", AXES),
            positive("a relaxation time", tau, "s"),
        )
        for own, tau in given
    )


@dataclass(frozen=True)
class Bushing(Between):
    """Springs and dampers between two ends (CBUSH).

    Parameters
    ----------
    a, b : ends
        As for `Weld`.
    stiffness : dict
        Component -> stiffness: of "x", "y", "z" (N/m), "rx", "ry", "rz" (N m/rad) in the axes of
        the assembly, and "axial" (N/m) along the line between the ends. It may be empty beside
        dampers.
    point : sequence of floats, optional
        Where the springs of x … rz lie, m; default: at `a`. Ends that lie elsewhere are connected
        to it rigidly.
    name : str, optional
        What messages call the joint.
    damping : dict, optional
        Component -> N s/m or N m s/rad of a damper. Models have it exactly, however strong it is.
    branches : sequence of (dict, float), optional
        Maxwell branches beside both: component -> stiffness, and the relaxation time, s. The
        complex stiffness at ω is k + iωc + Σ k_b iωτ/(1 + iωτ).
    """

    stiffness: Mapping[str, float] = field(default_factory=dict, metadata=OF_AXES)
    point: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    name: str | None = field(default=None, metadata=NAME)
    damping: Mapping[str, float] = field(default_factory=dict, metadata=OF_AXES)
    branches: Sequence[tuple[Mapping[str, float], float]] = field(
        default=(), metadata=checked_by(_branches)
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.stiffness and not self.damping and not self.branches:
            raise InputError(
                f"a Bushing needs a stiffness, as {{'z': 1e6}}, or a damping; got "
                f"{shown(self.stiffness)}."
            )

    def elastic(self, layout: Layout, label: str) -> list[Stiffness]:
        """k (b − a)² of each component."""
        a, b = (motion(layout, end, partly=True) for end in (self.a, self.b))
        given = [self.stiffness, self.damping, *(own for own, _ in self.branches)]
        names = list(dict.fromkeys(name for own in given for name in own))
        found = []
        if "axial" in names:
            line = b.point - a.point
            length = float(np.linalg.norm(line))
            if length <= COINCIDENT * layout.size:
                raise InputError(f"{label} has no length: an axial spring needs two places.")
            _check_moves(label, "axial", line / length, (self.a, a), (self.b, b))
            found.append(
                scipy.sparse.csr_matrix(line / length) @ (b.displacements - a.displacements)
            )
        others = [name for name in names if name != "axial"]
        if others:
            x = a.point if self.point is None else in_space(self.point)
            here = [carried(layout, label, e, m, x) for e, m in ((self.a, a), (self.b, b))]
            for name in others:
                axis = COMPONENTS.index(name)
                if axis < 3:
                    _check_moves(label, name, np.eye(3)[axis], (self.a, here[0]), (self.b, here[1]))
                    continue
                for end, one in zip((self.a, self.b), here, strict=True):
                    if not one.has(name):
                        raise InputError(
                            f"{label} acts on {name}, a rotation that {end_text(end)} does not "
                            "have."
                        )
            found.append(here[1].components(others) - here[0].components(others))
        G = scipy.sparse.vstack(found).tocsr()
        if not G.nnz:
            raise InputError(f"{label} joins nothing: none of its components can move.")
        order = (["axial"] if "axial" in names else []) + others
        k, c, *more = (np.diag([own.get(name, 0.0) for name in order]) for own in given)
        branches = [(own, tau) for own, (_, tau) in zip(more, self.branches, strict=True)]
        return [Stiffness(G, k, np.zeros_like(k), c=c if self.damping else None, branches=branches)]


def _check_moves(label: str, name: str, direction: Array, *ends: tuple[End, Motion]) -> None:
    """InputError where an end does not move along the direction of a spring."""
    for end, one in ends:
        if one.displacements.nnz and not one.along(one.displacement_space, direction):
            raise InputError(
                f"{label} acts on {name}, a displacement that {end_text(end)} does not have."
            )


#: Points of the rule for the mass matrix: products of two cubics.
GAUSS_POINTS = 5


@dataclass(frozen=True)
class Bolt(Between):
    """A straight beam between two ends: of groups their mean motions, so that its forces spread.

    The element has the exact static stiffness of a Timoshenko beam, and its consistent mass.

    Parameters
    ----------
    a, b : ends
        As for `Weld`; the beam goes from the centroid of one to that of the other.
    beam : Beam
        Material and section.
    name : str, optional
        What messages call the joint.
    """

    beam: Beam = field(metadata=checked_by(instance, Beam, "a Beam"))
    name: str | None = field(default=None, metadata=NAME)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.beam.offset:
            raise InputError("the beam of a Bolt has no offset: it goes from end to end.")

    def elastic(self, layout: Layout, label: str) -> list[Stiffness]:
        """Stiffness and mass of the beam."""
        ends = [motion(layout, end) for end in (self.a, self.b)]
        tell_gap(layout, label, list(zip((self.a, self.b), ends, strict=True)))
        line = ends[1].point - ends[0].point
        length = float(np.linalg.norm(line))
        if length <= 1e-9 * layout.size:
            raise InputError(
                f"{label} has no length: {end_text(self.a)} and {end_text(self.b)} have the same "
                "centre; use a Weld."
            )
        for end, one in zip((self.a, self.b), ends, strict=True):
            if not one.turns(layout.rotations):
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
        turn = scipy.sparse.block_diag([R] * 4, format="csr")
        G = (turn @ scipy.sparse.vstack([one.components() for one in ends])).tocsr()
        mass = self.beam.rho * self.beam.section.A * length
        return [Stiffness(G, k, m, mass)]


def element(beam: Beam, length: float) -> tuple[Array, Array]:
    """Stiffness and mass (12, 12) of a beam along x, its height along y.

    Dofs: x, y, z, rx, ry, rz of the first end, then of the second.
    """
    section, E, rho = beam.section, beam.E, beam.rho
    k, m = np.zeros((12, 12)), np.zeros((12, 12))
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
    # rotation about z bends along y; about y it bends along z with the opposite sign
    for dofs, sign, I in (((1, 5, 7, 11), 1.0, section.I), ((2, 4, 8, 10), -1.0, section.side)):  # noqa: E741
        signs = np.array([1.0, sign, 1.0, sign])
        own_k, own_m = _bending(beam, I, length)
        k[np.ix_(dofs, dofs)] += own_k * np.outer(signs, signs)
        m[np.ix_(dofs, dofs)] += own_m * np.outer(signs, signs)
    return k, m


def _bending(beam: Beam, I: float, L: float) -> tuple[Array, Array]:  # noqa: E741
    """(4, 4) of (deflection, slope) of both ends of a Timoshenko beam.

    Przemieniecki, *Theory of Matrix Structural Analysis* (1968), chapters 5 and 11.
    """
    EI = beam.E * I
    phi = 12 * EI / (beam.G * beam.section.A * beam.section.shear * L**2) if beam.shear else 0.0
    k = EI / ((1 + phi) * L**3) * np.array([
        [12, 6 * L, -12, 6 * L],
        [6 * L, (4 + phi) * L**2, -6 * L, (2 - phi) * L**2],
        [-12, -6 * L, 12, -6 * L],
        [6 * L, (2 - phi) * L**2, -6 * L, (4 + phi) * L**2],
    ])  # fmt: skip
    x, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    s, w = (x + 1) / 2, w / 2 * L
    one = 1 / (1 + phi)
    v = one * np.stack([
        1 - 3 * s**2 + 2 * s**3 + phi * (1 - s),
        L * (s - 2 * s**2 + s**3 + phi / 2 * (s - s**2)),
        3 * s**2 - 2 * s**3 + phi * s,
        L * (-(s**2) + s**3 - phi / 2 * (s - s**2)),
    ])  # fmt: skip
    turn = one * np.stack([
        6 / L * (-s + s**2),
        1 - 4 * s + 3 * s**2 + phi * (1 - s),
        6 / L * (s - s**2),
        -2 * s + 3 * s**2 + phi * s,
    ])  # fmt: skip
    rho_A, rho_I = beam.rho * beam.section.A, beam.rotary_inertia(I)
    m = rho_A * np.einsum("iq,jq,q->ij", v, v, w) + rho_I * np.einsum("iq,jq,q->ij", turn, turn, w)
    return k, m
