"""Parts of an assembly that are known by K and M of a few dofs alone: superelements.

An anti-oscillator model of several sites is one (the form of Craig and Bampton, see
`antiosc.models.model_file`), and so are given matrices whose nodes have coordinates. Joints
act on the displacements of its sites, or on the dofs of its nodes; its other dofs are amplitudes of
modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.linalg import algebra
from antiosc.fem.structure.matrices import NodalMatrices
from antiosc.fem.structure.placement import Placement, rigid_motions
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.model_file import reduced_matrices

#: Most dofs: its matrices are dense.
MOST_SIZE = 2000
#: Share of the largest stiffness below which rounding, or the digits of coordinates, made it.
STIFFNESS_ROUNDING = 1e-7
#: Share of the largest eigenvalue of K below which one is zero.
ZERO_STIFFNESS = 1e-9
#: What a dof is: the amplitude of a mode, a displacement or a rotation.
AMPLITUDE, MOVE, TURN = 0, 1, 2
#: Dofs are added, and held, until their number is a multiple of those of a node.
NODE_DOFS = 6


@dataclass(frozen=True, eq=False)
class Interface:
    """A site or a node of a superelement, in its own axes."""

    point: Array  # (3,) [m]
    #: displacements, rotations: (3, n) functionals of the displacement and the rotation
    displacements: Array
    rotations: Array
    #: displacement_space, rotation_space: (3, 3) projections on those that it has
    displacement_space: Array
    rotation_space: Array
    radius: float | None = None  # of the patch of a site [m]; None for a point
    local_compliance: float = 0.0  # half-space compliance of the patch [m/N], which 1/K contains


@dataclass(frozen=True, eq=False)
class Superelement:
    """K and M of n dofs, and what each of these is."""

    #: K, M: (n, n)
    K: Array
    M: Array
    kind: IntArray  # (n,) AMPLITUDE, MOVE or TURN
    #: positions, axes: (n, 3) where each displacement or rotation is [m], and its direction
    positions: Array
    axes: Array
    ends: Mapping[str, Interface]  # name of a site, or number of a node -> its motion
    fixed: BoolArray  # (n,) dofs that are zero
    rigid: Array  # (n, r) orthonormal rigid motions, on which K is exactly zero

    @property
    def size(self) -> int:
        """Number of dofs."""
        return len(self.K)


@dataclass(frozen=True, eq=False)
class Condensed:
    """A superelement in its place."""

    name: str  # of the part in the assembly
    part: Superelement  # the superelement
    at: Placement  # where it stands
    first: int  # number of its first dof in u

    @cached_property
    def positions(self) -> Array:
        """Places (n, 3) of its dofs in the assembly [m]."""
        return self.at.placed(self.part.positions)

    @cached_property
    def axes(self) -> Array:
        """Directions (n, 3) of its dofs in the assembly."""
        return self.part.axes @ self.at.rotation.T

    @property
    def size(self) -> int:
        """Number of dofs."""
        return self.part.size

    @property
    def rows(self) -> slice:
        """Its dofs in u."""
        return slice(self.first, self.first + self.size)

    @property
    def points(self) -> Array:
        """Coordinates (m, 3) of its sites or nodes in the assembly [m]."""
        return self.at.placed(np.array([end.point for end in self.part.ends.values()]))

    def motions(self, point: Array) -> Array:
        """Six rigid motions (n, 6): translations, and rotations about `point` (3,)."""
        return rigid_motions(self.positions, self.axes, self.part.kind == MOVE, point)


def of_model(name: str, model: AntiOscillators) -> Superelement:
    """The superelement of an anti-oscillator model of several sites; InputError for others."""
    points = model.info.points or {}
    if not model.sites or model.direction is None or set(points) != set(model.sites):
        raise InputError(
            f"the part {name!r} is a model without named sites in space: extract it with "
            "extract(structure, {name: Site(point, direction), ...})."
        )
    if model.damping is not None:
        raise InputError(
            f"the part {name!r} is a model with damping of its modes, which are not those of the "
            "assembly: take it out, dataclasses.replace(model, m=None, damping=None), and damp the "
            "model of the assembly."
        )
    P, slide = np.asarray(model.P), model.slide
    if slide is not None:
        slide = slide[:, slide.any(axis=0)]
    both = reduced_matrices(model.k0, model.m_st, P, model.omega, slide, None, 0, None)
    count, size = len(model.k0), len(both.K)
    columns = len(model.direction)
    follows = np.eye(columns) if model.dependence is None else np.asarray(model.dependence)
    where = np.zeros((columns, 3))
    for site, own in model.columns.items():
        where[list(own)] = points[site]
    # the columns that are dofs: those that equal one of them
    leads = [int(np.flatnonzero((follows == unit).all(axis=1))[0]) for unit in np.eye(count)]
    kind, positions, axes = np.full(size, AMPLITUDE), np.zeros((size, 3)), np.zeros((size, 3))
    kind[:count], positions[:count], axes[:count] = MOVE, where[leads], model.direction[leads]
    positions[count:] = where.mean(axis=0)
    ends = {}
    for k, (site, some) in enumerate(model.columns.items()):
        along = model.direction[list(some)]
        displacements = np.zeros((3, size))
        displacements[:, :count] = along.T @ follows[list(some)]
        ends[site] = Interface(
            np.array(points[site]),
            displacements,
            np.zeros((3, size)),
            along.T @ along,
            np.zeros((3, 3)),
            model.radius[k],
            float(model.local_compliance[k]),
        )
    none = np.zeros(size, dtype=bool), np.zeros((size, 0))
    found = Superelement(both.K, both.M, kind, positions, axes, ends, *none)
    return _padded(_without_rigid_strain(name, found, "patches on curved faces turn otherwise"))


def of_matrices(name: str, given: NodalMatrices) -> Superelement:
    """The superelement of given matrices with coordinates of nodes; InputError for others."""
    size = algebra.size(given.K)
    if not given.located:
        raise InputError(
            f"the part {name!r} has no mesh, and its matrices have no coordinates: give "
            "map= with node, dof, x, y, z of each row."
        )
    if algebra.communicator(given.K).size > 1:
        raise InputError(f"the matrices of the part {name!r} are spread over several MPI ranks.")
    if size > MOST_SIZE:
        raise InputError(
            f"the part {name!r} has no mesh and {size} dofs; matrices of a part have at "
            f"most {MOST_SIZE}: condense them to the dofs of their interface (Craig–Bampton), or "
            "extract a model of named sites."
        )
    K, M = (_dense(matrix) for matrix in (given.K, given.M))
    component, node, points = given.map.component, given.map.node, given.map.points
    placed = np.isfinite(points).all(axis=1)
    kind = np.where(component > 3, TURN, MOVE)
    kind[~placed | (component < 1) | (component > 6)] = AMPLITUDE
    positions = np.where(placed[:, None], points, points[placed].mean(axis=0))
    axes = np.where(kind[:, None] > 0, np.eye(3)[(component - 1) % 3], 0.0)
    ends = {}
    for number in np.unique(node[kind > 0]):
        motion = np.zeros((2, 3, size))
        for row in np.flatnonzero((node == number) & (kind > 0)):
            motion[int(kind[row] == TURN), (component[row] - 1) % 3, row] = 1.0
        displacement_space, rotation_space = (
            np.diag(one.any(axis=1).astype(float)) for one in motion
        )
        place = points[node == number][0]
        ends[str(number)] = Interface(
            place, motion[0], motion[1], displacement_space, rotation_space
        )
    fixed = np.zeros(size, dtype=bool)
    fixed[given.fixed] = True
    found = Superelement(K, M, kind, positions, axes, ends, fixed, np.zeros((size, 0)))
    return _padded(_without_rigid_strain(name, found, "its coordinates may have too few digits"))


def _dense(matrix: object) -> Array:
    whole = algebra.gathered(matrix, 0)
    assert whole is not None
    return np.asarray(whole.toarray())


def _without_rigid_strain(name: str, one: Superelement, why: str) -> Superelement:
    """The same with K exactly zero on the rigid motions that it leaves free.

    InputError where its null vectors are not such motions.
    """
    free = ~one.fixed
    K = one.K[np.ix_(free, free)]
    K = (K + K.T) / 2
    own = Condensed(name, one, Placement(), 0)
    motions = own.motions(one.positions.mean(axis=0))[free]
    motions /= np.maximum(np.linalg.norm(motions, axis=0), np.finfo(float).tiny)
    basis, values, _ = np.linalg.svd(motions, full_matrices=False)
    basis = basis[:, values > STIFFNESS_ROUNDING]
    # in units in which the entries of K are alike: rotations, displacements and amplitudes are not
    scale = np.sqrt(np.maximum(K.diagonal(), np.finfo(float).tiny))
    forces = (K @ basis) / scale[:, None]
    sizes = np.linalg.norm(basis * scale[:, None], axis=0).max(initial=1.0)
    _, strain, turn = np.linalg.svd(forces, full_matrices=False)
    strain = np.concatenate([strain, np.zeros(len(turn) - len(strain))])
    rigid = np.linalg.qr(basis @ turn[strain <= STIFFNESS_ROUNDING * sizes].T)[0]
    stiffness = np.linalg.eigvalsh(K / np.outer(scale, scale))
    null = int(np.sum(stiffness <= ZERO_STIFFNESS * stiffness[-1]))
    if null != rigid.shape[1]:
        raise InputError(
            f"the stiffness of the part {name!r} has {null} null vectors, and {rigid.shape[1]} "
            f"rigid motions of its sites are without strain: {why}; give sites that are points "
            "(radius=None), or hold the part."
        )
    if rigid.shape[1]:
        K = K - rigid @ (rigid.T @ K)
        K = K - (K @ rigid) @ rigid.T
    whole, moved = np.array(one.K), np.zeros((one.size, rigid.shape[1]))
    whole[np.ix_(free, free)] = (K + K.T) / 2
    moved[free] = rigid
    return replace(one, K=whole, rigid=moved)


def _padded(one: Superelement) -> Superelement:
    """The same with fixed dofs added, so that the nodes of the parts behind it stay blocks."""
    more = -one.size % NODE_DOFS
    right, below = ((0, 0), (0, more)), ((0, more), (0, 0))
    ends = {
        name: replace(
            end,
            displacements=np.pad(end.displacements, right),
            rotations=np.pad(end.rotations, right),
        )
        for name, end in one.ends.items()
    }
    return Superelement(
        np.pad(one.K, (0, more)),
        np.pad(one.M, (0, more)),
        np.pad(one.kind, (0, more)),
        np.pad(one.positions, below, mode="edge"),
        np.pad(one.axes, below),
        ends,
        np.pad(one.fixed, (0, more), constant_values=True),
        np.pad(one.rigid, below),
    )


def interface(one: Condensed, end: Interface, count: int) -> tuple[scipy.sparse.csr_matrix, ...]:
    """(displacements, rotations) of an end (3, count) of u, in the axes of the assembly."""
    found = []
    for own in (end.displacements, end.rotations):
        rotated = scipy.sparse.coo_matrix(one.at.rotation @ own)
        where = rotated.row, rotated.col + one.first
        found.append(scipy.sparse.csr_matrix((rotated.data, where), shape=(3, count)))
    return tuple(found)
