"""Joints of ends: welds, balls, hinges, sliders, bushings, bolts; points of groups; equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy.linalg
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import checked_by, coordinates, instance, number, positive, shown, store
from antiosc.base.errors import InputError
from antiosc.fem.assembly.joint import (
    COLLINEAR,
    END,
    NAME,
    UNIT,
    Between,
    End,
    HeldDofs,
    Joint,
    Motion,
    Rows,
    Stiffness,
    checked_end,
    end_text,
    following,
    group_end,
    mean,
    motion,
    warn_of_gap,
)
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.elements.beam import Beam, heights
from antiosc.fem.structure import checked_axis, in_space
from antiosc.fem.structure.attachments import by_components
from antiosc.fem.structure.meshed import Member
from antiosc.io.dof_map import COMPONENTS, DISPLACEMENTS, ROTATIONS

#: Points this share of the size of the assembly apart are one; coefficients this share apart too.
COINCIDENT = 1e-9
#: The motions of plane parts among the six of an end.
IN_PLANE = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True)
class _Pin(Between):
    point: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    name: str | None = field(default=None, metadata=NAME)

    def constraints(self, layout: Layout, held: HeldDofs, label: str) -> list[Rows]:
        """Equal displacements and rotations of both ends, in the constrained directions."""
        ends = motion(layout, self.a), motion(layout, self.b)
        warn_of_gap(layout, label, [(self.a, ends[0]), (self.b, ends[1])])
        x = ends[0].point if self.point is None else in_space(self.point)
        a, b = (
            carried(layout, label, end, one, x)
            for end, one in zip((self.a, self.b), ends, strict=True)
        )
        directions = self._constrained()
        if layout.plane:
            directions = directions * IN_PLANE
            directions = directions[np.abs(directions).max(axis=1) > 1e-9]
        _check_rotations(label, self, directions, a, b)
        rows = _apart(directions, a.six, b.six)
        rows.eliminate_zeros()
        if not rows.nnz:
            raise InputError(f"{label} joins nothing: both of its ends are the same point.")
        return [Rows.free(rows, label)]

    def _constrained(self) -> Array:
        """Directions (k, 6) in which displacements and rotations are equal."""
        raise NotImplementedError


@dataclass(frozen=True)
class Weld(_Pin):
    """Two ends that have the same displacement and rotation at a point.

    Parameters
    ----------
    a, b : ends
        "part:group" (of several nodes: their mean motion), ("part", (x, y, z)), ("part", (x, y, z),
        radius): the mean motion of the surface within the radius of a point, as under a screw's
        head, or the name of a reference point.
    point : sequence of floats, optional
        Where they are joined, m; default: the point, or the centroid, of `a`. Ends that lie
        elsewhere are connected to it rigidly.
    name : str, optional
        What messages call the joint.
    """

    def _constrained(self) -> Array:
        return np.eye(6)


@dataclass(frozen=True)
class Ball(_Pin):
    """Two ends that have the same displacement at a point and rotate freely.

    Parameters as for `Weld`.
    """

    def _constrained(self) -> Array:
        return np.eye(3, 6)


@dataclass(frozen=True)
class _Axis(_Pin):
    axis: Sequence[float] = field(default=(0.0, 0.0, 1.0), metadata=checked_by(checked_axis))

    #: whether the axis is that of a rotation
    _turns_about_axis: ClassVar[bool] = True

    def constraints(self, layout: Layout, held: HeldDofs, label: str) -> list[Rows]:
        """As `Weld.constraints`; InputError in a plane structure for an axis that its motions
        exclude.
        """
        rotated = abs(self.axis[2]) / float(np.linalg.norm(self.axis))
        across = self._turns_about_axis
        if layout.plane and abs(rotated - across) > COINCIDENT:
            raise InputError(
                f"{label}: plane parts rotate about z and slide along x and y; the axis "
                f"{tuple(self.axis)} allows neither."
            )
        return super().constraints(layout, held, label)

    def _across(self) -> Array:
        """Two unit vectors (2, 3) perpendicular to the axis."""
        unit = np.array(self.axis) / np.linalg.norm(self.axis)
        first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
        first /= np.linalg.norm(first)
        return np.vstack([first, np.cross(unit, first)])


@dataclass(frozen=True)
class Hinge(_Axis):
    """Two ends that can only rotate relative to each other about an axis through a point.

    Parameters as for `Weld`, and

    axis : sequence of 3 floats
        Direction of the axis in the assembly, default z.
    """

    def _constrained(self) -> Array:
        return scipy.linalg.block_diag(np.eye(3), self._across())


@dataclass(frozen=True)
class Slider(_Axis):
    """Two ends that can only move relative to each other along an axis.

    Parameters as for `Hinge`.
    """

    _turns_about_axis: ClassVar[bool] = False

    def _constrained(self) -> Array:
        return scipy.linalg.block_diag(self._across(), np.eye(3))


def carried(layout: Layout, label: str, end: End, own: Motion, x: Array) -> Motion:
    """The motion at point x, rigidly connected to an end."""
    arm = x - own.point
    length = float(np.linalg.norm(arm))
    if length <= COINCIDENT * layout.size:
        return replace(own, point=x)
    unit = arm / length
    across = np.eye(3) - np.outer(unit, unit)
    if layout.plane:
        across = layout.rotations
    if not own.turns(across):
        raise InputError(
            f"{label} lies {length:.3g} m away from {end_text(end)}, which has no rotation to "
            "carry it there: points of solids do not rotate; give a group of faces, or a point "
            "where the joint is."
        )
    return own.at(x)


def _apart(directions: Array, a: Sparse, b: Sparse) -> Sparse:
    """b − a along directions (k, 6), without entries that are rounding of equal coefficients."""
    along = scipy.sparse.csr_matrix(directions)
    found = (along @ (b - a)).tocsr()
    distinct = abs(found) > COINCIDENT * (abs(along) @ (abs(a) + abs(b)))
    return found.multiply(distinct).tocsr()


def _check_rotations(label: str, joint: _Pin, directions: Array, a: Motion, b: Motion) -> None:
    """InputError if an end lacks a rotation that the joint constrains."""
    rotations = directions[directions[:, 3:].any(axis=1)]
    for end, one in ((joint.a, a), (joint.b, b)):
        for direction in rotations:
            if not one.has(direction / np.linalg.norm(direction)):
                raise InputError(
                    f"{label} holds a rotation that {end_text(end)} does not have: a point of a "
                    "solid, or a straight row of them, does not rotate; give a group of faces, a "
                    'radius, ("part", point, radius), or use a Ball.'
                )


@dataclass(frozen=True)
class Equation(Joint):
    """Σ coefficient · component = 0 of displacements (m) and rotations (rad).

    Parameters
    ----------
    terms : sequence of (end, component, coefficient)
        `end` as for `Weld`; `component` is "x", "y", "z", "rx", "ry" or "rz" in the axes of the
        assembly.
    name : str, optional
        What messages call the equation.
    """

    terms: Sequence[tuple[End, str, float]]
    name: str | None = field(default=None, metadata=NAME)

    def __post_init__(self) -> None:
        if not isinstance(self.terms, Sequence) or isinstance(self.terms, str) or not self.terms:
            raise InputError(
                f"terms must list (end, component, coefficient); got {shown(self.terms)}."
            )
        terms = tuple(_checked_term(term) for term in self.terms)
        if not any(coefficient for _, _, coefficient in terms):
            raise InputError("an Equation needs a coefficient that is not 0.")
        store(self, terms=terms)
        super().__post_init__()

    def constraints(self, layout: Layout, held: HeldDofs, label: str) -> list[Rows]:
        """The single row of the equation."""
        total = layout.nothing(1)
        for end, component, coefficient in self.terms:
            own = motion(layout, end, partly=True)
            row = own.components([component])
            if own.lacking([component]):
                raise InputError(
                    f"{label}: {end_text(end)} has no component {component!r}; points of solids "
                    "have no rotations, plane parts move along x and y, a site of a model along "
                    "its direction."
                )
            total = total + coefficient * row
        total = total.tocsr()
        total.eliminate_zeros()
        if not total.nnz:
            raise InputError(f"{label} says 0 = 0: its terms cancel.")
        return [Rows(total, np.full(1, -1), label)]


def _checked_term(term: object) -> tuple[End, str, float]:
    if not isinstance(term, tuple | list) or len(term) != 3:
        raise InputError(
            f"a term must be (end, component, coefficient), as (('plate', (0, 0, 0)), 'z', 1.0); "
            f"got {shown(term)}."
        )
    end, component, coefficient = term
    if not isinstance(component, str) or component not in DISPLACEMENTS + ROTATIONS:
        raise InputError(
            f"a component must be one of {', '.join(DISPLACEMENTS + ROTATIONS)}; "
            f"got {shown(component)}."
        )
    return checked_end("end", end), component, number("a coefficient", coefficient)


AXES = (*COMPONENTS, "axial")
OF_AXES = checked_by(by_components, "Bushing", AXES)


def _branches(_: str, given: object) -> tuple[tuple[dict[str, float], float], ...]:
    """Checked stiffnesses by component, and relaxation times."""
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
        """A spring k (b − a)²/2 for each component."""
        a, b = (motion(layout, end, partly=True) for end in (self.a, self.b))
        given = [self.stiffness, self.damping, *(own for own, _ in self.branches)]
        names = list(dict.fromkeys(name for own in given for name in own))
        found = []
        if "axial" in names:
            line = b.point - a.point
            length = float(np.linalg.norm(line))
            if length <= COINCIDENT * layout.size:
                raise InputError(f"{label} has no length: an axial spring needs two places.")
            along = np.append(line / length, np.zeros(3))
            _check_has(label, "axial", along, (self.a, a), (self.b, b))
            found.append(
                scipy.sparse.csr_matrix(line / length) @ (b.displacements - a.displacements)
            )
        others = [name for name in names if name != "axial"]
        if others:
            x = a.point if self.point is None else in_space(self.point)
            here = [carried(layout, label, e, m, x) for e, m in ((self.a, a), (self.b, b))]
            for name in others:
                _check_has(label, name, UNIT[name], (self.a, here[0]), (self.b, here[1]))
            found.append(here[1].components(others) - here[0].components(others))
        G = scipy.sparse.vstack(found).tocsr()
        if not G.nnz:
            raise InputError(f"{label} joins nothing: none of its components can move.")
        order = (["axial"] if "axial" in names else []) + others
        k, c, *more = (np.diag([own.get(name, 0.0) for name in order]) for own in given)
        branches = [(own, tau) for own, (_, tau) in zip(more, self.branches, strict=True)]
        return [Stiffness(G, k, np.zeros_like(k), c=c if self.damping else None, branches=branches)]


def _check_has(label: str, name: str, direction: Array, *ends: tuple[End, Motion]) -> None:
    """InputError where an end does not move along the direction (6,) of a spring."""
    rotation = direction[3:].any()
    for end, one in ends:
        if (rotation or one.displacements.nnz) and not one.has(direction):
            kind = "rotation" if rotation else "displacement"
            raise InputError(
                f"{label} acts on {name}, a {kind} that {end_text(end)} does not have."
            )


#: Points of the rule for the mass matrix: products of two cubics.
GAUSS_POINTS = 5


@dataclass(frozen=True)
class Bolt(Between):
    """A straight beam between two ends; a group as an end moves by its mean motion.

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

    def _reach(self, layout: Layout) -> float:
        """Distance between its ends, m."""
        a, b = (motion(layout, end).point for end in (self.a, self.b))
        return float(np.linalg.norm(b - a))

    def elastic(self, layout: Layout, label: str) -> list[Stiffness]:
        """Stiffness and mass of the beam."""
        ends = [motion(layout, end) for end in (self.a, self.b)]
        warn_of_gap(layout, label, list(zip((self.a, self.b), ends, strict=True)))
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
        G = (turn @ scipy.sparse.vstack([one.six for one in ends])).tocsr()
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


def lengthening(beam: Beam, length: float) -> tuple[Array, Array]:
    """(a (12,), B (12, 12)): a beam with the dofs g of `element` elongates by a·g + gᵀBg/2.

    B has the slopes of its deflections, and the twist by which fibres off the axis lengthen.
    """
    a, B = np.zeros(12), np.zeros((12, 12))
    a[[0, 6]] = -1.0, 1.0
    bar = np.array([[1.0, -1.0], [-1.0, 1.0]])
    section = beam.section
    radius2 = (section.I + section.side) / section.A
    B[np.ix_((3, 9), (3, 9))] = radius2 / length * bar
    x, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    s, w = (x + 1) / 2, w / 2 * length
    for dofs, sign, I in (((1, 5, 7, 11), 1.0, section.I), ((2, 4, 8, 10), -1.0, section.side)):  # noqa: E741
        signs = np.array([1.0, sign, 1.0, sign])
        slopes = _slopes(_shear_share(beam, I, length), length, s)
        own = np.einsum("iq,jq,q->ij", slopes, slopes, w)
        B[np.ix_(dofs, dofs)] += own * np.outer(signs, signs)
    return a, B


def _shear_share(beam: Beam, I: float, L: float) -> float:  # noqa: E741
    """φ = 12 EI/(GκA L²); 0 for a beam that is rigid in shear."""
    if not beam.shear:
        return 0.0
    return 12 * beam.E * I / (beam.G * beam.section.A * beam.section.shear * L**2)


def _slopes(phi: float, L: float, s: Array) -> Array:
    """Slopes (4, points) of the deflection at s in [0, 1], for each unit dof of bending."""
    return np.stack([
        (-6 * s + 6 * s**2 - phi) / L,
        1 - 4 * s + 3 * s**2 + phi / 2 * (1 - 2 * s),
        (6 * s - 6 * s**2 + phi) / L,
        -2 * s + 3 * s**2 - phi / 2 * (1 - 2 * s),
    ]) / (1 + phi)  # fmt: skip


def _bending(beam: Beam, I: float, L: float) -> tuple[Array, Array]:  # noqa: E741
    """Bending stiffness (4, 4) of a Timoshenko beam for the deflection and slope of both ends.

    Przemieniecki, *Theory of Matrix Structural Analysis* (1968), chapters 5 and 11.
    """
    EI = beam.E * I
    phi = _shear_share(beam, I, L)
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


@dataclass(frozen=True)
class Rigid(Joint):
    """All nodes of a group follow the motion of a point as a rigid body (RBE2).

    Parameters
    ----------
    group : str
        "part:group".
    point : end, optional
        The point that is followed: the name of a reference point, ("part", (x, y, z)) of a beam
        or shell, or a group of one point. None: the group is rigid and follows nothing else.
    name : str, optional
        What messages call the joint.
    """

    group: str = field(metadata=END)
    point: End | None = field(default=None, metadata=END)
    name: str | None = field(default=None, metadata=NAME)

    def prepare(self, layout: Layout, label: str) -> None:
        """Add a reference point to the layout if the group follows no point of the user."""
        if self.point is None:
            member, group = group_end(layout, "group", self.group)
            nodes = member.nodes_of(group)
            if len(nodes) < 2:
                raise InputError(f"{label}: {self.group!r} is a single point, which is rigid.")
            layout.points[label] = member.nodes[nodes].mean(axis=0)

    def constraints(self, layout: Layout, held: HeldDofs, label: str) -> list[Rows]:
        """Every dof of the group equals the rigid motion of the point."""
        member, group = group_end(layout, "group", self.group)
        nodes = member.nodes_of(group)
        if self.point is None:
            leader = motion(layout, label)
            rows = _as_rigid_body(layout, member, nodes, leader, label)
            return [rows, *_undetermined(member, nodes, leader)]
        leader = motion(layout, self.point)
        columns = np.unique(leader.six.indices)
        block = (columns - member.first) // member.block
        inside = (columns >= member.rows.start) & (columns < member.rows.stop)
        nodes = nodes[~np.isin(nodes, block[inside])]  # the point itself may be in the group
        if not leader.turns(layout.rotations):
            raise InputError(
                f"{label}: the point {end_text(self.point)} does not rotate, so that nothing can "
                "follow its rotation: take a reference point (points={...}), or a point of a beam "
                "or a shell."
            )
        if not len(nodes):
            raise InputError(f"{label}: {self.group!r} holds nothing but the point it follows.")
        return [_as_rigid_body(layout, member, nodes, leader, label)]


@dataclass(frozen=True)
class Mean(Joint):
    """A point follows the mean motion of a group (RBE3), and its loads spread over the group.

    The group is not stiffened. Faces, edges and cells count with their areas and lengths, points
    equally.

    Parameters
    ----------
    group : str
        "part:group".
    point : end
        What follows: the name of a reference point, ("part", (x, y, z)), or a group of one point,
        for instance the end of a beam.
    name : str, optional
        What messages call the joint.
    """

    group: str = field(metadata=END)
    point: End = field(metadata=END)
    name: str | None = field(default=None, metadata=NAME)

    def constraints(self, layout: Layout, held: HeldDofs, label: str) -> list[Rows]:
        """Displacement and rotation of the point equal the mean ones of the group."""
        member, group = group_end(layout, "group", self.group)
        nodes = member.nodes_of(group)
        follower = motion(layout, self.point)
        if len(nodes) == 1:
            raise InputError(
                f"{label}: {self.group!r} is a single point; a Mean needs several (use Weld)."
            )
        leader = mean(layout, member, member.points_of(group))
        if set(leader.displacements.indices) & set(follower.displacements.indices):
            raise InputError(
                f"{label}: the point {end_text(self.point)} is one of the group {self.group!r} "
                "whose mean it should follow; take a group without it."
            )
        led = leader.at(follower.point)
        both = leader.space[3:, 3:] @ follower.space[3:, 3:]
        directions = scipy.linalg.block_diag(np.eye(3), _rows_of(both))
        rows = (scipy.sparse.csr_matrix(directions) @ (follower.six - led.six)).tocsr()
        rows.eliminate_zeros()
        return [Rows(rows, _single(follower, rows.shape[0]), label)]


def _as_rigid_body(
    layout: Layout, member: Member, nodes: IntArray, leader: Motion, label: str
) -> Rows:
    """The constraints by which nodes of a part follow the rigid motion of a point."""
    rotations = scipy.sparse.vstack([leader.rotations] * len(nodes)).tocsr()
    led = leader.displacements_at(member.nodes[nodes])
    return following(layout, member, nodes, [(DISPLACEMENTS, led), (ROTATIONS, rotations)], label)


def _undetermined(member: Member, nodes: IntArray, leader: Motion) -> list[Rows]:
    """Rotations of a point that move no follower, and are therefore fixed."""
    if member.has_rotations:
        return []
    arm = member.nodes[nodes] - leader.point
    J = np.einsum("pi,pi->", arm, arm) * np.eye(3) - arm.T @ arm
    values, axes = np.linalg.eigh(J)
    idle = axes[:, values <= COLLINEAR * values[-1]].T
    return [Rows.free((scipy.sparse.csr_matrix(idle) @ leader.rotations).tocsr(), "")]


def _rows_of(projection: Array) -> Array:
    """Orthonormal rows (k, 3) that span the image of a projection."""
    present = np.flatnonzero(np.abs(np.diag(projection) - 1) < 1e-9)
    if len(present) == round(float(np.trace(projection))):
        return np.eye(3)[present]
    values, vectors = np.linalg.eigh(projection)
    return np.asarray(vectors[:, values > 0.5].T)


def _single(follower: Motion, count: int) -> IntArray:
    """The single follower dof for which each row is solved; -1 if there are several."""
    pivots = np.full(count, -1)
    alone = np.flatnonzero(np.diff(follower.displacements.indptr) == 1)
    pivots[alone] = follower.displacements.indices[follower.displacements.indptr[alone]]
    if count == 6 and (np.diff(follower.rotations.indptr) == 1).all():
        pivots[3:] = follower.rotations.indices
    return pivots
