"""`Support`: displacement components that are fixed, as dofs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import InitVar, dataclass
from functools import partial

import dolfinx
import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import coordinates, in_words, nonnegative, shown, store
from antiosc.base.errors import InputError
from antiosc.base.texts import Given
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import agreed, bounds
from antiosc.fem.structure.placement import in_space

Where = str | Callable[[Array], BoolArray]

NO_DOFS = np.zeros(0, dtype=np.int32)


@dataclass(frozen=True)
class Support(Given):
    """Displacements and rotations fixed (set to zero) on a part of the mesh.

    Parameters
    ----------
    where
        Name of a group of the mesh, or a function that maps coordinates x of shape (3, n) to a
        mask (n,) of the fixed points. Give either `where` or one of `near`, `box` and `plane`,
        which select nodes by their coordinates, with a tolerance of a millionth of the mesh's size.
    fix
        "all", or the fixed components: of "x", "y", "z" (displacements) and, for beams,
        "rx", "ry", "rz" (rotations); one name or several.
    near
        (point, radius): nodes in a ball, m.
    box
        (lower, upper): nodes between two corners, m.
    plane
        (point, normal): nodes on a plane, m.

    Raises
    ------
    InputError
        None or several of `where`, `near`, `box`, `plane`; with a mesh: a support that selects no
        node.
    """

    where: Where = None  # type: ignore[assignment]  # where near, box or plane says it
    fix: str | Iterable[str] = "all"
    near: InitVar[tuple[Sequence[float], float] | None] = None
    box: InitVar[tuple[Sequence[float], Sequence[float]] | None] = None
    plane: InitVar[tuple[Sequence[float], Sequence[float]] | None] = None

    def __post_init__(self, near: object, box: object, plane: object) -> None:
        given = {"where": self.where, "near": near, "box": box, "plane": plane}
        named = [name for name, value in given.items() if value is not None]
        if len(named) > 1:
            raise InputError(f"a Support takes one of where, near, box, plane; got {named}.")
        make = {"near": ball, "box": _box, "plane": _plane}
        if named and named[0] in make:
            store(self, where=make[named[0]](given[named[0]]))
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
                    f"fix={shown(self.fix)} is not a component: it must be 'all' or such names as "
                    "'x', 'rz' or ('x', 'y')."
                )
        store(self, fix=names)

    def components(self, known: Iterable[str]) -> list[str]:
        """The names that are fixed, of those that a structure has; InputError for others."""
        names = list(known)
        if self.fix == "all":
            return names
        fixed = [self.fix] if isinstance(self.fix, str) else list(self.fix)
        if not set(fixed) <= set(names):
            raise InputError(
                f"fix={self.fix!r} is not a component of this structure: it must be 'all' or of "
                f"{', '.join(map(repr, names))}."
            )
        return fixed

    def selected(self, x: Array, **size: float) -> BoolArray:
        """Which of the points x (n, 3) the function `where` selects."""
        assert callable(self.where)
        mask = np.asarray(self.where(x.T, **size), dtype=bool)
        if mask.shape != (len(x),):
            raise InputError(
                f"a support's function must return one bool per point: shape ({len(x)},); "
                f"got {mask.shape}."
            )
        return mask

    @property
    def label(self) -> str:
        """Where it is, in a sentence."""
        if isinstance(self.where, str):
            return f"on group {self.where!r}"
        if isinstance(self.where, Region):
            return self.where.words
        return f"by function {getattr(self.where, '__name__', repr(self.where))!r}"


def fixed_dofs(
    mesh: Mesh, form: WeakForm, supports: Sequence[Support]
) -> dict[tuple[int, ...], IntArray]:
    """Path of each component -> its fixed dofs of this rank, ghosts included."""
    fixed: dict[tuple[int, ...], IntArray] = {}
    for support in supports:
        count = 0
        for name in support.components(form.components):
            path = form.components[name]
            dofs = _there(mesh, form, support, path)
            count += mesh.comm.allreduce(len(dofs))
            fixed[path] = np.union1d(fixed.get(path, NO_DOFS), dofs).astype(np.int32)
        if not count:
            low, high = map(in_words, bounds(mesh.comm, mesh.dolfinx.geometry.x))
            raise InputError(
                f"the support {support.label} fixes nothing: no point of the mesh lies "
                f"there; check the group or the coordinates (the mesh spans {low} to {high})."
            )
    return fixed


def _there(mesh: Mesh, form: WeakForm, support: Support, path: tuple[int, ...]) -> IntArray:
    if isinstance(support.where, str):
        return dofs_of_group(mesh, form, support.where, path)
    dofs, x = compat.dof_coordinates(form.space, path)
    size = {"size": mesh.extent()} if isinstance(support.where, Region) else {}
    return dofs[agreed(mesh.comm, lambda: support.selected(x, **size))]


def dofs_of_group(mesh: Mesh, form: WeakForm, group: str, path: tuple[int, ...]) -> IntArray:
    """Dofs of one component on the entities of a group, of this rank, ghosts included."""
    component = compat.subspace(form.space, path)
    parts = mesh.group(group)
    found = [NO_DOFS]
    for dim in sorted(parts):
        mesh.dolfinx.topology.create_connectivity(dim, mesh.tdim)
        found.append(dolfinx.fem.locate_dofs_topological(component, dim, parts[dim]))
    return np.unique(np.concatenate(found))


#: What lies outside a region by this share of the size of the mesh belongs to it.
AT_FACE = 1e-6


@dataclass(frozen=True)
class Region:
    """Points selected by their coordinates."""

    words: str  # where it is, in a sentence
    outside: Callable[[Array], Array]  # how far points x (3, n) lie outside of it [m] (n,)

    def __call__(self, x: Array, size: float | None = None) -> BoolArray:
        """Which points x (3, n) belong to it; `size`: of the mesh, m."""
        if size is None:
            size = float(np.linalg.norm(np.ptp(x, axis=1))) if x.shape[1] else 0.0
        return np.asarray(self.outside(x) <= AT_FACE * size)


def ball(given: object) -> Region:
    """near=(point, radius)."""
    point, radius = _pair("near", given, "(point, radius), as near=((0, 0, 0.1), 5e-3)")
    centre = in_space(coordinates("the point of near", point))
    radius = nonnegative("the radius of near", radius)
    return Region(f"within {radius:g} m of {in_words(centre)}", partial(_off_ball, centre, radius))


def _off_ball(centre: Array, radius: float, x: Array) -> Array:
    return np.asarray(np.linalg.norm(x - centre[:, None], axis=0) - radius)


def _box(given: object) -> Region:
    """box=(lower, upper)."""
    pair = _pair("box", given, "(lower, upper), as box=((0, 0, 0), (0.1, 0.2, 0.05))")
    lower, upper = (in_space(coordinates("a corner of box", corner)) for corner in pair)
    if (lower > upper).any():
        raise InputError(
            f"box=(lower, upper) has a lower corner {in_words(lower)} above the upper corner "
            f"{in_words(upper)} in some direction: exchange these coordinates."
        )
    words = f"in the box from {in_words(lower)} to {in_words(upper)}"
    return Region(words, partial(_off_box, lower, upper))


def _off_box(lower: Array, upper: Array, x: Array) -> Array:
    return np.asarray(np.maximum(lower[:, None] - x, x - upper[:, None]).max(axis=0))


def _plane(given: object) -> Region:
    """plane=(point, normal)."""
    pair = _pair("plane", given, "(point, normal), as plane=((0, 0, 0), (0, 0, 1))")
    point, normal = (
        in_space(coordinates(f"the {name} of plane", one))
        for name, one in zip(("point", "normal"), pair, strict=True)
    )
    length = float(np.linalg.norm(normal))
    if length == 0:
        raise InputError("the normal of plane must not be the zero vector.")
    across = ", ".join(f"{c:g}" for c in normal / length)
    words = f"on the plane through {in_words(point)} across ({across})"
    return Region(words, partial(_off_plane, point, normal / length))


def _off_plane(point: Array, normal: Array, x: Array) -> Array:
    return np.asarray(np.abs(normal @ (x - point[:, None])))


def _pair(name: str, given: object, form: str) -> tuple[object, object]:
    if not isinstance(given, list | tuple) or len(given) != 2:
        raise InputError(f"{name} must be a pair {form}; got {shown(given)}.")
    return given[0], given[1]
