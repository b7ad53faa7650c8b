"""Superelements: parts that are K and M of a few dofs, without a mesh.

They are models of several sites (the form of Craig and Bampton), or given matrices whose nodes have
coordinates. Joints act on the sites or nodes; other dofs are amplitudes of modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse

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


@dataclass(frozen=True, eq=False)
class Interface:
    """A site or node of a superelement: its point, its motion, its patch."""

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
    """K and M (n, n), and the meaning of each dof."""

    K: Array
    M: Array
    places: DofPlaces  # where and what its n dofs are
    ends: Mapping[str, Interface]  # name of a site, or number of a node -> its motion
    fixed: BoolArray  # (n,) dofs that are zero
    rigid: Array | None = None  # (n, r) orthonormal rigid motions, on which K is exactly zero
    first: int = 0  # number of its first dof in u

    @property
    def rows(self) -> slice:
        """Its dofs in u."""
        return slice(self.first, self.first + len(self.K))

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
    direction = model.direction
    named = bool(model.sites) and set(points) == set(model.sites)
    if not named or direction is None or model.damping is not None:
        raise InputError(
            f"the part {name!r} must be a model of named sites in space without damping: extract "
            "it with extract(structure, {name: Site(point, direction), ...}), and damp the model "
            "of the assembly (damping=)."
        )

    reduced = reduced_matrices(model.k0, model.m_st, np.asarray(model.P), model.omega)
    size, count = len(reduced.K), len(model.k0)
    dependence = np.eye(count) if model.dependence is None else np.asarray(model.dependence)
    is_dof = (dependence == 1.0).any(axis=1) & (np.count_nonzero(dependence, axis=1) == 1)
    ends = {}
    positions, axes = np.zeros((2, size, 3))
    for k, (site, columns) in enumerate(model.columns.items()):
        own = np.array(columns)
        d = direction[own]
        six, space = np.zeros((6, size)), np.zeros((6, 6))
        six[:3, :count], space[:3, :3] = d.T @ dependence[own], d.T @ d
        patch = model.radius[k], float(model.local_compliance[k])
        ends[site] = Interface(np.array(points[site]), six, space, *patch)

        dofs = dependence[own[is_dof[own]]].argmax(axis=1)
        positions[dofs], axes[dofs] = points[site], d[is_dof[own]]

    kind = np.where(np.arange(size) < count, MOVE, AMPLITUDE)
    places = DofPlaces(positions, np.arange(size), axes, kind)
    fixed = np.zeros(size, dtype=bool)
    return _without_rigid_strain(Superelement(reduced.K, reduced.M, places, ends, fixed))


def matrix_superelement(name: str, matrices: NodalMatrices) -> Superelement:
    """The superelement of given matrices with coordinates of nodes; InputError for others."""
    size = algebra.size(matrices.K)
    if not matrices.located or size > MOST_SIZE or matrices.C is not None:
        raise InputError(
            f"the part {name!r} has no mesh: its matrices, of {size} dofs, need coordinates (map= "
            f"with node, dof, x, y, z of each row), at most {MOST_SIZE} dofs, and no C (damp the "
            "model of the assembly)."
        )

    node, places, ends = matrices.map.node, matrices.places, {}
    for number in np.unique(node[places.kind != AMPLITUDE]):
        kinds = [(node == number) & (places.kind == kind) for kind in (MOVE, TURN)]
        six = np.vstack([np.where(at_node, places.axes.T, 0.0) for at_node in kinds])
        space = np.diag(six.any(axis=1).astype(float))
        ends[str(number)] = Interface(matrices.map.points[node == number][0], six, space)

    fixed = np.zeros(size, dtype=bool)
    fixed[matrices.fixed] = True
    K, M = (_dense(matrix) for matrix in (matrices.K, matrices.M))
    return _without_rigid_strain(Superelement(K, M, places, ends, fixed))


def _dense(matrix: object) -> Array:
    return np.asarray(scipy.sparse.csr_matrix(algebra.gathered(matrix, 0)).toarray())


def _without_rigid_strain(part: Superelement) -> Superelement:
    """The superelement with K exactly zero on the rigid motions that its supports permit."""
    motions = part.places.rigid_motions(part.places.points.mean(axis=0))
    motions[part.fixed] = 0.0
    motions /= np.maximum(np.linalg.norm(motions, axis=0), np.finfo(float).tiny)
    basis, values, _ = np.linalg.svd(motions, full_matrices=False)
    basis = basis[:, values > STIFFNESS_ROUNDING]

    # in units in which the entries of K are alike: rotations, displacements and amplitudes are not
    K = (part.K + part.K.T) / 2
    scale = np.sqrt(np.maximum(K.diagonal(), np.finfo(float).tiny))[:, None]
    forces = np.where(part.fixed[:, None], 0.0, K @ basis / scale)
    _, strain, rotation = np.linalg.svd(forces, full_matrices=False)
    largest = np.linalg.norm(basis * scale, axis=0).max(initial=1.0)
    rigid = np.linalg.qr(basis @ rotation[strain <= STIFFNESS_ROUNDING * largest].T)[0]

    K = K - rigid @ (rigid.T @ K)
    return replace(part, K=K - (K @ rigid) @ rigid.T, rigid=rigid)
