"""Superelements: parts that are K and M of a few dofs, without a mesh.

They are anti-oscillator models of several sites (the form of Craig and Bampton), or given matrices
whose nodes have coordinates. Joints act on the displacements of the sites, or on the dofs of the
nodes; other dofs are amplitudes of modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import InputError
from antiosc.fem.linalg import algebra
from antiosc.fem.structure import AMPLITUDE, MOVE, TURN, DofPlaces, NodalMatrices, Placement
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.model_file import reduced_matrices

#: Most dofs: the matrices are dense, 32 MB each.
MOST_SIZE = 2000
#: Fraction of the largest stiffness below which rounding, or the digits of coordinates, made it.
STIFFNESS_ROUNDING = 1e-7
#: Fraction of the largest eigenvalue of K below which one is zero.
ZERO_STIFFNESS = 1e-9


@dataclass(frozen=True, eq=False)
class Interface:
    """A site or node of a superelement."""

    point: Array  # (3,) [m]
    six: Array  # (6, n) functionals of the displacement, then of the rotation
    space: Array  # (6, 6) projection on those that it has
    radius: float | None = None  # of its patch [m]; None: a point
    local_compliance: float = 0.0  # half-space compliance of the patch [m/N]

    def placed(self, at: Placement) -> Interface:
        """The same in the axes of the assembly."""
        R = scipy.linalg.block_diag(at.rotation, at.rotation)
        point = at.placed(self.point[None])[0]
        return replace(self, point=point, six=R @ self.six, space=R @ self.space @ R.T)


@dataclass(frozen=True, eq=False)
class Superelement:
    """K and M of n dofs, and the meaning of each dof."""

    #: K, M: (n, n)
    K: Array
    M: Array
    places: DofPlaces  # where and what its n dofs are
    ends: Mapping[str, Interface]  # name of a site, or number of a node -> its motion
    fixed: BoolArray  # (n,) dofs that are zero
    C: Array | None = None  # (n, n) damping
    rigid: Array | None = None  # (n, r) orthonormal rigid motions, on which K is exactly zero
    first: int = 0  # number of its first dof in u

    @property
    def size(self) -> int:
        """Number of dofs."""
        return len(self.K)

    @property
    def rows(self) -> slice:
        """Its dofs in u."""
        return slice(self.first, self.first + self.size)

    @property
    def points(self) -> Array:
        """Coordinates (m, 3) of its sites or nodes [m]."""
        return np.array([end.point for end in self.ends.values()])

    def placed(self, at: Placement, first: int) -> Superelement:
        """The same at its place in an assembly."""
        ends = {name: end.placed(at) for name, end in self.ends.items()}
        return replace(self, places=self.places.placed(at), ends=ends, first=first)


def model_superelement(name: str, model: AntiOscillators) -> Superelement:
    """The superelement of an anti-oscillator model of several sites; InputError for others."""
    points = model.info.points or {}
    if not model.sites or model.direction is None or set(points) != set(model.sites):
        raise InputError(
            f"the part {name!r} is a model without named sites in space: extract it with "
            "extract(structure, {name: Site(point, direction), ...})."
        )
    if model.damping is not None:
        raise InputError(
            f"the part {name!r} is a model with damping, which a superelement of K and M leaves "
            "out: damp the model of the assembly (damping=), or put dampers into its attached=."
        )

    P = np.asarray(model.P)
    reduced = reduced_matrices(model.k0, model.m_st, P, model.omega)
    count = len(model.k0)
    size = len(reduced.K)
    columns = len(model.direction)
    dependence = np.eye(columns) if model.dependence is None else np.asarray(model.dependence)

    ends = {}
    site_points = np.zeros((columns, 3))
    for k, (site, site_columns) in enumerate(model.columns.items()):
        of_site = list(site_columns)
        site_points[of_site] = points[site]
        d = model.direction[of_site]
        six = np.zeros((6, size))
        space = np.zeros((6, 6))
        six[:3, :count] = d.T @ dependence[of_site]
        space[:3, :3] = d.T @ d
        patch = model.radius[k], float(model.local_compliance[k])
        ends[site] = Interface(np.array(points[site]), six, space, *patch)

    # the columns that are dofs: those that equal one of them
    units = [int(np.flatnonzero((dependence == unit).all(axis=1))[0]) for unit in np.eye(count)]
    positions = np.tile(site_points.mean(axis=0), (size, 1))
    positions[:count] = site_points[units]
    axes = np.zeros((size, 3))
    axes[:count] = model.direction[units]
    kind = np.where(np.arange(size) < count, MOVE, AMPLITUDE)
    places = DofPlaces(positions, np.arange(size), axes, kind)

    superelement = Superelement(reduced.K, reduced.M, places, ends, np.zeros(size, dtype=bool))
    return _without_rigid_strain(name, superelement)


def matrix_superelement(name: str, matrices: NodalMatrices) -> Superelement:
    """The superelement of given matrices with coordinates of nodes; InputError for others."""
    size = algebra.size(matrices.K)
    if not matrices.located:
        raise InputError(
            f"the part {name!r} has no mesh, and its matrices have no coordinates: give "
            "map= with node, dof, x, y, z of each row."
        )
    if size > MOST_SIZE:
        raise InputError(
            f"the part {name!r} has no mesh and {size} dofs; matrices of a part have at "
            f"most {MOST_SIZE}: condense them to the dofs of their interface (Craig–Bampton), or "
            "extract a model of named sites."
        )

    node = matrices.map.node
    places = matrices.places
    ends = {}
    for number in np.unique(node[places.kind != AMPLITUDE]):
        at_node = node == number
        six = np.vstack(
            [np.where(at_node & (places.kind == kind), places.axes.T, 0.0) for kind in (MOVE, TURN)]
        )
        space = np.diag(six.any(axis=1).astype(float))
        ends[str(number)] = Interface(matrices.map.points[at_node][0], six, space)

    fixed = np.zeros(size, dtype=bool)
    fixed[matrices.fixed] = True
    K, M = (_dense(matrix) for matrix in (matrices.K, matrices.M))
    C = None if matrices.C is None else _dense(matrices.C)
    return _without_rigid_strain(name, Superelement(K, M, places, ends, fixed, C))


def _dense(matrix: object) -> Array:
    dense_matrix = algebra.gathered(matrix, 0)
    assert dense_matrix is not None
    return np.asarray(dense_matrix.toarray())


def _without_rigid_strain(name: str, superelement: Superelement) -> Superelement:
    """The superelement with K exactly zero on the rigid motions that its supports permit.

    InputError where its null vectors are not such motions.
    """
    free = ~superelement.fixed
    K = superelement.K[np.ix_(free, free)]
    K = (K + K.T) / 2
    motions = superelement.places.rigid_motions(superelement.places.points.mean(axis=0))[free]
    motions /= np.maximum(np.linalg.norm(motions, axis=0), np.finfo(float).tiny)
    basis, values, _ = np.linalg.svd(motions, full_matrices=False)
    basis = basis[:, values > STIFFNESS_ROUNDING]

    # in units in which the entries of K are alike: rotations, displacements and amplitudes are not
    scale = np.sqrt(np.maximum(K.diagonal(), np.finfo(float).tiny))
    sizes = np.linalg.norm(basis * scale[:, None], axis=0).max(initial=1.0)
    _, strain, rotation = np.linalg.svd((K @ basis) / scale[:, None], full_matrices=False)
    strain = np.pad(strain, (0, len(rotation) - len(strain)))
    rigid = np.linalg.qr(basis @ rotation[strain <= STIFFNESS_ROUNDING * sizes].T)[0]

    stiffness = np.linalg.eigvalsh(K / np.outer(scale, scale))
    null = int(np.sum(stiffness <= ZERO_STIFFNESS * stiffness[-1]))
    if null != rigid.shape[1]:
        raise InputError(
            f"the stiffness of the part {name!r} has {null} null vectors, and {rigid.shape[1]} "
            "rigid motions of its sites are without strain (patches on curved faces turn "
            "otherwise, coordinates may have too few digits): give sites that are points "
            "(radius=None), or hold the part."
        )

    K = K - rigid @ (rigid.T @ K)
    K = K - (K @ rigid) @ rigid.T
    corrected = np.array(superelement.K)
    corrected[np.ix_(free, free)] = (K + K.T) / 2
    motions = np.zeros((superelement.size, rigid.shape[1]))
    motions[free] = rigid
    return replace(superelement, K=corrected, rigid=motions)
