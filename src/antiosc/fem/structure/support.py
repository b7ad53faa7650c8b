"""`Support`: fixed displacement components; remaining rigid-body motions.

On a mesh, polynomial displacement fields give the rigid-body motions and, for a free body, the
spectral shift s of K + sM; rotations of beams and shells are half the curl of the field. Rigid
motions among the fields that vanish on the fixed dofs are exact null vectors of K. The lowest
Rayleigh–Ritz value of the quadratic fields estimates the first elastic ω², which gives s.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import InitVar, dataclass
from functools import partial
from typing import cast

import dolfinx
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import coordinates, nonnegative, point_text, shown, store, whole
from antiosc.base.errors import AccuracyError, InputError
from antiosc.base.texts import FieldsRepr
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.linalg.algebra import dot, force_ratios, multiply, norms, typical_eigenvalue
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import bounds, compat, done_on_all
from antiosc.fem.structure import (
    MOVE,
    RIGID_FORCE,
    SHIFT_RATIO,
    TURN,
    DofPlaces,
    in_space,
    orthonormal_basis,
)

Where = str | Callable[[Array], BoolArray]

NO_DOFS = np.zeros(0, dtype=np.int32)


@dataclass(frozen=True)
class Support(FieldsRepr):
    """Displacements and rotations fixed (set to zero) on a part of the mesh.

    Parameters
    ----------
    where
        Name of a group of the mesh or of a side of its bounding box ("-x", "+x", "-y", …), or a
        function that maps coordinates x of shape (3, n) to a mask (n,) of the fixed points. If
        straight cells approximate a curved outline, points between their corners are off the curve
        and stay free, unless the function has a tolerance or a group is named. Give either `where`
        or one of `near`, `box` and `plane`, which select nodes by their coordinates, with a
        tolerance of a millionth of the mesh's size.
    fix
        "all", or the fixed components: of "x", "y", "z" (displacements) and, for beams and shells,
        "rx", "ry", "rz" (rotations); one name or several.
    near
        (point, radius): nodes in a ball, m.
    box
        (lower, upper): nodes between two corners, m.
    plane
        (point, normal): nodes on a plane, m.
    nodes
        Numbers of nodes in the mesh's file; the edges and faces between them are fixed too.

    Raises
    ------
    InputError
        None or several of `where`, `near`, `box`, `plane` and `nodes`; when a structure is made: a
        support that selects no node.
    """

    where: Where = None  # type: ignore[assignment]  # where near, box or plane says it
    fix: str | Iterable[str] = "all"
    near: InitVar[tuple[Sequence[float], float] | None] = None
    box: InitVar[tuple[Sequence[float], Sequence[float]] | None] = None
    plane: InitVar[tuple[Sequence[float], Sequence[float]] | None] = None
    nodes: InitVar[Sequence[int] | None] = None

    def __post_init__(self, near: object, box: object, plane: object, nodes: object) -> None:
        places = {"where": self.where, "near": near, "box": box, "plane": plane, "nodes": nodes}
        given_places = [name for name, value in places.items() if value is not None]
        if len(given_places) > 1:
            raise InputError(f"a Support takes one of {', '.join(places)}; got {given_places}.")
        regions: dict[str, Callable[[object], Region | NumberedNodes]]
        regions = {"near": ball_region, "box": box_region, "plane": plane_region}
        regions["nodes"] = NumberedNodes.of
        if given_places and given_places[0] in regions:
            store(self, where=regions[given_places[0]](places[given_places[0]]))

        if not isinstance(self.where, str) and not callable(self.where):
            raise InputError(
                "where must be the name of a group or a function of coordinates x (3, n), or near, "
                f"box or plane be given; got {shown(self.where)}."
            )

        names = self.fix
        if not isinstance(names, str):
            if isinstance(names, set | frozenset):  # each rank has an order of its own of it
                names = sorted(names, key=str)
            names = tuple(names) if isinstance(names, list | tuple) else ()
            if not names or not all(isinstance(name, str) for name in names):
                raise InputError(
                    f"fix {shown(self.fix)} is not a component: it must be 'all' or such names as "
                    "'x', 'rz' or ('x', 'y')."
                )

        store(self, fix=names)

    def components(self, known: Iterable[str]) -> list[str]:
        """The fixed components; InputError if one is not among the structure's (`known`)."""
        names = list(known)
        if self.fix == "all":
            return names
        fixed = [self.fix] if isinstance(self.fix, str) else list(self.fix)
        if not set(fixed) <= set(names):
            raise InputError(
                f"fix {self.fix!r} is no component here; these are {', '.join(map(repr, names))}."
            )

        return fixed

    def selected(self, x: Array, **size: float) -> BoolArray:
        """Mask (n,) of the points x (n, 3) that the function `where` selects; `size`: extent of the
        mesh [m], for a `Region`. InputError if the function returns another shape."""
        assert callable(self.where)
        mask = np.asarray(self.where(x.T, **size), dtype=bool)
        if mask.shape != (len(x),):
            raise InputError(
                f"a support's function returns bools, shape ({len(x)},); got {mask.shape}."
            )

        return mask

    @property
    def label(self) -> str:
        """Text for messages that says where the support is."""
        if isinstance(self.where, str):
            return f"on group {self.where!r}"
        if isinstance(self.where, Region | NumberedNodes):
            return self.where.words
        return f"by function {getattr(self.where, '__name__', repr(self.where))!r}"


def fixed_dofs(
    mesh: Mesh, form: WeakForm, supports: Sequence[Support]
) -> dict[tuple[int, ...], IntArray]:
    """Fixed dofs of this rank, ghosts included, by path of the component in the space."""
    fixed: dict[tuple[int, ...], IntArray] = {}
    for support in supports:
        count = 0
        for name in support.components(form.components):
            path = form.components[name]
            dofs = _dofs_of_support(mesh, form, support, path)
            count += mesh.comm.allreduce(len(dofs))
            fixed[path] = np.union1d(fixed.get(path, NO_DOFS), dofs).astype(np.int32)
        if not count:
            low, high = map(point_text, mesh.box)
            raise InputError(
                f"the support {support.label} fixes nothing: no point of the mesh lies "
                f"there; check the group or the coordinates (the mesh spans {low} to {high})."
            )

    return fixed


def _dofs_of_support(
    mesh: Mesh, form: WeakForm, support: Support, path: tuple[int, ...]
) -> IntArray:
    """This rank's dofs, ghosts included, of the component `path` that a support selects."""
    if isinstance(support.where, str):
        return dofs_of_entities(mesh, form, mesh.group(support.where), path)
    if isinstance(support.where, NumberedNodes):
        return dofs_of_entities(mesh, form, support.where.entities(mesh), path)

    dofs, x = compat.dof_coordinates(form.space, path)
    size = {"size": mesh.extent()} if isinstance(support.where, Region) else {}
    return dofs[done_on_all(mesh.comm, lambda: support.selected(x, **size))]


def dofs_of_entities(
    mesh: Mesh, form: WeakForm, parts: Mapping[int, IntArray], path: tuple[int, ...]
) -> IntArray:
    """This rank's dofs, ghosts included, of one component on `parts`, entities by dimension."""
    component = compat.subspace(form.space, path)
    dofs = [NO_DOFS]
    for dim in sorted(parts):
        mesh.dolfinx.topology.create_connectivity(dim, mesh.tdim)
        dofs.append(dolfinx.fem.locate_dofs_topological(component, dim, parts[dim]))
    return np.unique(np.concatenate(dofs))


@dataclass(frozen=True)
class NumberedNodes:
    """Nodes selected by their numbers in the file."""

    numbers: tuple[int, ...]

    @classmethod
    def of(cls, numbers: object) -> NumberedNodes:
        """The selection of these node numbers; InputError unless they are whole numbers."""
        is_list = isinstance(numbers, list | tuple | range | np.ndarray) and len(numbers) > 0
        if not is_list:
            raise InputError(f"nodes must be a list of numbers of nodes; got {shown(numbers)}.")
        listed = cast("list[int]", numbers)
        return cls(tuple(whole("a number of nodes", number) for number in listed))

    @property
    def words(self) -> str:
        """The selected nodes in words."""
        shown_first = ", ".join(map(str, self.numbers[:6]))
        return f"on nodes {shown_first}{', …' * (len(self.numbers) > 6)}"

    def __call__(self, x: Array) -> BoolArray:
        """Raise InputError, as points x (3, n) have no node numbers."""
        raise InputError("nodes needs a mesh whose file has numbers of nodes.")

    def entities(self, mesh: Mesh) -> dict[int, IntArray]:
        """Vertices, edges and faces of this rank all of whose nodes are selected."""
        is_selected = mesh.numbered(self.numbers)
        entities: dict[int, IntArray] = {}
        for dim in range(mesh.tdim):
            selected = is_selected[compat.vertex_nodes(mesh.dolfinx, dim)].all(axis=1)
            entities[dim] = np.flatnonzero(selected).astype(np.int32)
        return entities


#: What lies outside a region by this share of the size of the mesh belongs to it.
REGION_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Region:
    """Points selected by their coordinates."""

    words: str  # where it is, in a sentence
    outside: Callable[[Array], Array]  # how far points x (3, n) lie outside of it [m] (n,)

    def __call__(self, x: Array, size: float | None = None) -> BoolArray:
        """Mask of the points x (3, n) in the region; `size`: size of the mesh, m."""
        if size is None:
            size = float(np.linalg.norm(np.ptp(x, axis=1))) if x.shape[1] else 0.0
        return np.asarray(self.outside(x) <= REGION_TOLERANCE * size)


def ball_region(value: object) -> Region:
    """The region near=(point, radius)."""
    point, radius = _pair("near", value, "(point, radius), as ((0, 0, 0.1), 5e-3)")
    centre = in_space(coordinates("the point of near", point))
    radius = nonnegative("the radius of near", radius)
    words = f"within {radius:g} m of {point_text(centre)}"
    return Region(words, partial(_outside_ball, centre, radius))


def _outside_ball(centre: Array, radius: float, x: Array) -> Array:
    """Distance (n,) [m] of points x (3, n) from a ball; negative inside."""
    return np.asarray(np.linalg.norm(x - centre[:, None], axis=0) - radius)


def box_region(value: object) -> Region:
    """The region box=(lower, upper)."""
    pair = _pair("box", value, "(lower, upper), as ((0, 0, 0), (0.1, 0.2, 0.05))")
    lower, upper = (in_space(coordinates("a corner of box", corner)) for corner in pair)
    if (lower > upper).any():
        raise InputError(
            f"the lower corner {point_text(lower)} of box is above the upper {point_text(upper)}."
        )

    words = f"in the box from {point_text(lower)} to {point_text(upper)}"
    return Region(words, partial(_outside_box, lower, upper))


def _outside_box(lower: Array, upper: Array, x: Array) -> Array:
    """Distance (n,) [m] along an axis by which points x (3, n) lie outside; negative inside."""
    return np.asarray(np.maximum(lower[:, None] - x, x - upper[:, None]).max(axis=0))


def plane_region(value: object) -> Region:
    """The region plane=(point, normal)."""
    pair = _pair("plane", value, "(point, normal), as ((0, 0, 0), (0, 0, 1))")
    point, normal = (
        in_space(coordinates(f"the {name} of plane", entry))
        for name, entry in zip(("point", "normal"), pair, strict=True)
    )
    length = float(np.linalg.norm(normal))
    if length == 0:
        raise InputError("the normal of plane must not be the zero vector.")

    normal_text = ", ".join(f"{c:g}" for c in normal / length)
    words = f"on the plane through {point_text(point)} across ({normal_text})"
    return Region(words, partial(_outside_plane, point, normal / length))


def _outside_plane(point: Array, normal: Array, x: Array) -> Array:
    """Distance (n,) [m] of points x (3, n) from a plane with a unit normal."""
    return np.asarray(np.abs(normal @ (x - point[:, None])))


def _pair(name: str, value: object, form: str) -> tuple[object, object]:
    """The two items of `value`; InputError, with the expected `form`, unless it has two."""
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise InputError(f"{name} must be a pair {form}; got {shown(value)}.")
    return value[0], value[1]


#: Share of a field's square on the fixed dofs below which it vanishes there; rounding: 1e-16.
VANISHING_SHARE = 1e-13
#: Share of a field that is left without its rigid part, above which it strains; rounding: 1e-15.
STRAINING_SHARE = 1e-9
#: Share of the largest of some eigenvalues below which rounding makes them up.
DOMINATED_SHARE = 1e-14


def modes_and_shift(
    form: WeakForm, fixed: IntArray, K: PETSc.Mat, M: PETSc.Mat, springs: Array
) -> tuple[Array, float]:
    """(M-orthonormal rigid-body modes (rows, r) that no spring resists, shift [rad²/s²]). Without
    such modes the shift is 0. `fixed`: local numbers of dofs; `springs` (rows, s): force patterns
    of springs to the ground. AccuracyError if a rigid motion strains the structure."""
    comm: MPI.Comm = K.getComm().tompi4py()
    modes = _vanishing_combinations(comm, rigid_motions(form, K), fixed, springs)
    modes = orthonormal_basis(comm, M, modes)
    if not modes.shape[1]:
        return modes, 0.0

    largest_ratio = force_ratios(K, modes).max()
    if largest_ratio > RIGID_FORCE:
        raise AccuracyError(
            f"a rigid motion strains the structure, ‖K r‖/(‖K‖‖r‖) = {largest_ratio:.1e}: the mesh "
            "or its order cannot represent it, or a stiff spring should be a Support."
        )

    low, high = bounds(comm, form.space.tabulate_dof_coordinates())
    fields = places_of(form).polynomials(comm, (low + high) / 2, float((high - low).max()))
    fields = _vanishing_combinations(comm, fields, fixed, springs)
    return modes, SHIFT_RATIO * first_elastic_estimate(comm, K, M, fields, modes)


def rigid_motions(form: WeakForm, K: PETSc.Mat) -> Array:
    """Rigid-body motions (rows of this rank, r) of the unsupported body, of similar size."""
    low, high = bounds(K.getComm().tompi4py(), form.space.tabulate_dof_coordinates())
    rigid = places_of(form).rigid_motions((low + high) / 2)
    rigid[:, 3:] /= float((high - low).max())
    return rigid if "z" in form.components else rigid[:, [0, 1, 5]]


def places_of(form: WeakForm) -> DofPlaces:
    """Node, direction and kind of the dofs of this rank, in the axes of the mesh."""
    rows, names = compat.local_size(form.space), list(form.components)  # in the order of a node
    nodes = form.space.tabulate_dof_coordinates()[: rows // len(names)]
    axes = np.eye(3)[["xyz".index(name[-1]) for name in names]]
    kind = np.array([TURN if name[0] == "r" else MOVE for name in names])
    node = np.repeat(np.arange(len(nodes)), len(names))
    return DofPlaces(nodes, node, np.tile(axes, (len(nodes), 1)), np.tile(kind, len(nodes)))


def _vanishing_combinations(
    comm: MPI.Comm, fields: Array, fixed: IntArray, springs: Array
) -> Array:
    """Combinations (rows, r) of `fields` (rows, k), zero at `fixed` dofs, that strain none of the
    `springs` (rows, s)."""
    scale = norms(comm, fields)
    if not scale.all():
        fields, scale = fields[:, scale > 0], scale[scale > 0]  # y and z are zero on a line along x

    owned_fixed = fixed[fixed < len(fields)]
    at_fixed = fields[owned_fixed]
    stretch = dot(comm, springs, fields)
    gram = comm.allreduce(at_fixed.T @ at_fixed) + stretch.T @ stretch
    if not gram.any():
        return fields

    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    combinations = (vectors / scale[:, None])[:, values < VANISHING_SHARE]
    result = fields @ combinations
    result[owned_fixed] = 0.0
    return result


def first_elastic_estimate(
    comm: MPI.Comm, K: PETSc.Mat, M: PETSc.Mat, fields: Array, motions: Array
) -> float:
    """Rayleigh–Ritz estimate of the lowest elastic ω² [rad²/s²] from `fields` (rows, k), which are
    overwritten; `motions` (rows, r): M-orthonormal rigid motions."""
    shares = dot(comm, multiply(M, motions), fields)
    count = 0
    for column, share in zip(fields.T, shares.T, strict=True):
        elastic = column - motions @ share
        full_norm, elastic_norm = comm.allreduce(np.array([column @ column, elastic @ elastic]))

        # A rigid field leaves rounding only, which must not be scaled up to a field of its own.
        if elastic_norm > STRAINING_SHARE**2 * full_norm:
            fields[:, count] = elastic
            count += 1

    basis = orthonormal_basis(comm, M, fields[:, :count], into=fields)
    stiffness = [dot(comm, basis, multiply(K, column)) for column in basis.T]
    values = np.linalg.eigvalsh(np.array(stiffness).reshape(len(stiffness), -1))
    if not len(values):
        return typical_eigenvalue(K, M)

    # Below the rounding of the largest nothing is told: `closer_shift` comes after.
    return float(max(values[0], DOMINATED_SHARE * values[-1]))
