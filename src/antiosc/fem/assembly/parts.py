"""The parts of an assembly: meshes on one rank, and superelements of a few dofs.

A superelement is an anti-oscillator model of several sites (the form of Craig and Bampton, see
`antiosc.models.model_file`), or given matrices whose nodes have coordinates. Joints act on
the displacements of its sites, or on the dofs of its nodes; its other dofs are amplitudes of modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray
from antiosc.base.checks import coordinates, shown
from antiosc.base.errors import InputError, name_list
from antiosc.engine.damping import DampingMatrix
from antiosc.fem.linalg import algebra
from antiosc.fem.structure import (
    AMPLITUDE,
    MOVE,
    TURN,
    DofPlaces,
    NodalMatrices,
    Placement,
    in_space,
    placement,
)
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh, refuse_prestress
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.model_file import reduced_matrices

#: Most dofs of a superelement: its matrices are dense, 32 MB each.
MOST_SIZE = 2000
#: Fraction of the largest stiffness below which rounding, or the digits of coordinates, made it.
STIFFNESS_ROUNDING = 1e-7
#: Fraction of the largest eigenvalue of K below which one is zero.
ZERO_STIFFNESS = 1e-9


@dataclass(frozen=True, eq=False)
class Interface:
    """A site or node of a superelement, in the axes of the superelement."""

    point: Array  # (3,) [m]
    six: Array  # (6, n) functionals of the displacement, then of the rotation
    space: Array  # (6, 6) projection on those that it has
    radius: float | None = None  # of the patch of a site [m]; None for a point
    local_compliance: float = 0.0  # half-space compliance of the patch [m/N], which 1/K contains


@dataclass(frozen=True, eq=False)
class Superelement:
    """K and M of n dofs, and the meaning of each dof."""

    #: K, M: (n, n)
    K: Array
    M: Array
    places: DofPlaces  # where and what its n dofs are
    ends: Mapping[str, Interface]  # name of a site, or number of a node -> its motion
    fixed: BoolArray  # (n,) dofs that are zero
    rigid: Array  # (n, r) orthonormal rigid motions, on which K is exactly zero
    C: Array | None = None  # (n, n) damping

    @property
    def size(self) -> int:
        """Number of dofs."""
        return len(self.K)


@dataclass(frozen=True, eq=False)
class Condensed:
    """A superelement as a part of an assembly, with its placement and its first dof in u."""

    name: str  # of the part in the assembly
    part: Superelement  # the superelement
    at: Placement  # where it stands
    first: int  # number of its first dof in u

    @cached_property
    def places(self) -> DofPlaces:
        """Node, direction and kind of its dofs in the assembly."""
        return self.part.places.placed(self.at)

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


def model_superelement(name: str, model: AntiOscillators) -> Superelement:
    """The superelement of an anti-oscillator model of several sites; InputError for others."""
    points = model.info.points or {}
    if not model.sites or model.direction is None or set(points) != set(model.sites):
        raise InputError(
            f"the part {name!r} is a model without named sites in space: extract it with "
            "extract(structure, {name: Site(point, direction), ...})."
        )
    if isinstance(model.damping, DampingMatrix):
        raise InputError(
            f"the part {name!r} is a model with dampers or relaxing materials, which a "
            "superelement of K and M leaves out: give the structure itself as the part, or put "
            "the dampers into attached= of the assembly."
        )
    if model.damping is not None:
        raise InputError(
            f"the part {name!r} is a model with damping of its modes, which are not those of the "
            "assembly: take it out, dataclasses.replace(model, m=None, damping=None), and damp the "
            "model of the assembly."
        )
    P = np.asarray(model.P)
    slide = model.slide
    if slide is not None:
        slide = slide[:, slide.any(axis=0)]
    reduced = reduced_matrices(model.k0, model.m_st, P, model.omega, slide, None, 0, None)
    count = len(model.k0)
    size = len(reduced.K)
    columns = len(model.direction)
    dependence = np.eye(columns) if model.dependence is None else np.asarray(model.dependence)
    site_points = np.zeros((columns, 3))
    for site, columns_of_site in model.columns.items():
        site_points[list(columns_of_site)] = points[site]
    # the columns that are dofs: those that equal one of them
    units = [int(np.flatnonzero((dependence == unit).all(axis=1))[0]) for unit in np.eye(count)]
    kind = np.full(size, AMPLITUDE)
    positions = np.zeros((size, 3))
    axes = np.zeros((size, 3))
    kind[:count], positions[:count], axes[:count] = MOVE, site_points[units], model.direction[units]
    positions[count:] = site_points.mean(axis=0)
    ends = {}
    for k, (site, site_columns) in enumerate(model.columns.items()):
        d = model.direction[list(site_columns)]
        functionals = np.zeros((6, size))
        space = np.zeros((6, 6))
        functionals[:3, :count], space[:3, :3] = d.T @ dependence[list(site_columns)], d.T @ d
        patch = model.radius[k], float(model.local_compliance[k])
        ends[site] = Interface(np.array(points[site]), functionals, space, *patch)
    no_supports = np.zeros(size, dtype=bool), np.zeros((size, 0))
    places = DofPlaces(positions, np.arange(size), axes, kind)
    superelement = Superelement(reduced.K, reduced.M, places, ends, *no_supports)
    return _without_rigid_strain(name, superelement, "patches on curved faces turn otherwise")


def matrix_superelement(name: str, matrices: NodalMatrices) -> Superelement:
    """The superelement of given matrices with coordinates of nodes; InputError for others."""
    size = algebra.size(matrices.K)
    if not matrices.located:
        raise InputError(
            f"the part {name!r} has no mesh, and its matrices have no coordinates: give "
            "map= with node, dof, x, y, z of each row."
        )
    if algebra.communicator(matrices.K).size > 1:
        raise InputError(f"the matrices of the part {name!r} are spread over several MPI ranks.")
    if size > MOST_SIZE:
        raise InputError(
            f"the part {name!r} has no mesh and {size} dofs; matrices of a part have at "
            f"most {MOST_SIZE}: condense them to the dofs of their interface (Craig–Bampton), or "
            "extract a model of named sites."
        )
    K, M = (_dense(matrix) for matrix in (matrices.K, matrices.M))
    node = matrices.map.node
    places = matrices.places
    ends = {}
    for number in np.unique(node[places.kind != AMPLITUDE]):
        at_node = node == number
        functionals = np.vstack(
            [np.where(at_node & (places.kind == kind), places.axes.T, 0.0) for kind in (MOVE, TURN)]
        )
        space = np.diag(functionals.any(axis=1).astype(float))
        ends[str(number)] = Interface(matrices.map.points[at_node][0], functionals, space)
    fixed = np.zeros(size, dtype=bool)
    fixed[matrices.fixed] = True
    C = None if matrices.C is None else _dense(matrices.C)
    superelement = Superelement(K, M, places, ends, fixed, np.zeros((size, 0)), C)
    return _without_rigid_strain(name, superelement, "its coordinates may have too few digits")


def _dense(matrix: object) -> Array:
    dense_matrix = algebra.gathered(matrix, 0)
    assert dense_matrix is not None
    return np.asarray(dense_matrix.toarray())


def _without_rigid_strain(name: str, superelement: Superelement, why: str) -> Superelement:
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
    forces = (K @ basis) / scale[:, None]
    sizes = np.linalg.norm(basis * scale[:, None], axis=0).max(initial=1.0)
    _, strain, rotation = np.linalg.svd(forces, full_matrices=False)
    strain = np.concatenate([strain, np.zeros(len(rotation) - len(strain))])
    rigid = np.linalg.qr(basis @ rotation[strain <= STIFFNESS_ROUNDING * sizes].T)[0]
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
    corrected = np.array(superelement.K)
    translations = np.zeros((superelement.size, rigid.shape[1]))
    corrected[np.ix_(free, free)] = (K + K.T) / 2
    translations[free] = rigid
    return replace(superelement, K=corrected, rigid=translations)


def interface(superelement: Condensed, end: Interface, count: int) -> scipy.sparse.csr_matrix:
    """Displacement and rotation (6, count) of an end as functionals of u, in assembly axes."""
    R = superelement.at.rotation
    rotated = scipy.sparse.coo_matrix(np.vstack([R @ end.six[:3], R @ end.six[3:]]))
    indices = rotated.row, rotated.col + superelement.first
    return scipy.sparse.csr_matrix((rotated.data, indices), shape=(6, count))


def checked_parts(parts: object) -> dict[str, MeshedStructure | Superelement]:
    """The parts by name, checked."""
    if not isinstance(parts, Mapping) or not parts:
        raise InputError(f"parts must be a dict: name -> Structure; got {shown(parts)}.")
    for name in parts:
        _check_name("part", name)
    result = {name: _part(name, part) for name, part in parts.items()}
    if all(isinstance(part, Superelement) for part in result.values()):
        raise InputError("an assembly needs a part with a mesh; all parts are superelements.")
    return result


def _check_name(what: str, name: object) -> None:
    """InputError for a name that joints cannot refer to."""
    text = checks.name(f"a {what}'s name", name)
    if not text.strip() or ":" in text:
        raise InputError(f"a {what}'s name must be a text without a colon; got {shown(name)}.")


def _part(name: str, part: object) -> MeshedStructure | Superelement:
    if isinstance(part, AntiOscillators):
        return model_superelement(name, part)
    if not isinstance(part, Structure):
        raise InputError(
            f"the part {name!r} must be a Structure, or a model of several sites; got "
            f"{shown(part)}."
        )
    refuse_prestress(part, f"assemble, of its parts ({name!r}),")
    if part.matrices.assembled:
        raise InputError(
            f"the part {name!r} is an assembly itself: give its parts and joints instead, or a "
            "model of its sites."
        )
    if isinstance(part.matrices, NodalMatrices):
        return matrix_superelement(name, part.matrices)
    text = "the part {!r} has no mesh, and its matrices no map= of nodes, dofs and coordinates."
    meshed = on_mesh(part, text.format(name))
    if meshed.comm.size > 1:
        raise InputError(
            f"an assembly works on one rank, and the part {name!r} is spread over "
            f"{meshed.comm.size}: read its mesh with comm=MPI.COMM_SELF, or start one process."
        )
    return meshed


def checked_places(members: Mapping[str, object], at: object) -> dict[str, Placement]:
    """The placement of each part by name, checked."""
    placements = {} if at is None else at
    if not isinstance(placements, Mapping):
        raise InputError(f"at must be a dict: name -> Placement or (x, y, z); got {shown(at)}.")
    for name in placements:
        if not isinstance(name, str) or name not in members:
            parts = name_list(name, members, "the parts")
            raise InputError(f"at names {shown(name)}, which is no part; {parts}.")
    return {name: placement(name, placements.get(name)) for name in members}


def checked_points(members: Mapping[str, object], points: object) -> dict[str, Array]:
    """The coordinates (3,) [m] of each reference point by name, checked."""
    point_by_name = {} if points is None else points
    if not isinstance(point_by_name, Mapping):
        raise InputError(f"points must be a dict: name -> coordinates; got {shown(points)}.")
    result = {}
    for name, x in point_by_name.items():
        _check_name("point", name)
        if name in members:
            raise InputError(f"{name!r} names both a part and a reference point.")
        result[name] = in_space(coordinates(f"points[{name!r}]", x))
    return result
