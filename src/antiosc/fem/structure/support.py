"""`Support`: displacement components that are fixed, as dofs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import InitVar, dataclass
from typing import Any

import dolfinx
import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.brief import Given
from antiosc.base.checks import array, coordinates, nonnegative, shown, store
from antiosc.base.errors import InputError
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import agree, bounds

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

    def __post_init__(self, near: Any, box: Any, plane: Any) -> None:
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
            return str(self.where)
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
            low, high = (_text(corner) for corner in bounds(mesh.comm, mesh.dolfinx.geometry.x))
            raise InputError(
                f"the support {support.label} fixes nothing: no point of the mesh lies "
                f"there; check the group or the coordinates (the mesh spans {low} to {high} m)."
            )
    return fixed


def _there(mesh: Mesh, form: WeakForm, support: Support, path: tuple[int, ...]) -> IntArray:
    if isinstance(support.where, str):
        return dofs_of_group(mesh, form, support.where, path)
    dofs, x = compat.dof_coordinates(form.space, path)
    mask, error = None, None
    size = {"size": mesh.extent()} if isinstance(support.where, Region) else {}
    try:
        mask = support.selected(x, **size)
    except Exception as caught:
        error = caught
    agree(mesh.comm, error)
    return dofs[mask]


def dofs_of_group(mesh: Mesh, form: WeakForm, group: str, path: tuple[int, ...]) -> IntArray:
    """Dofs of one component on the entities of a group, of this rank, ghosts included."""
    component = compat.subspace(form.space, path)
    parts = mesh.group(group)
    found = [_topological(mesh, component, dim, parts[dim]) for dim in sorted(parts)]
    return np.unique(np.concatenate([NO_DOFS, *found]))


def _topological(mesh: Mesh, component: Any, dim: int, entities: IntArray) -> IntArray:
    mesh.dolfinx.topology.create_connectivity(dim, mesh.tdim)
    return np.asarray(dolfinx.fem.locate_dofs_topological(component, dim, entities))


def _text(point: Array) -> str:
    return "(" + ", ".join(f"{c:.4g}" for c in point) + ")"


#: What lies outside a region by this share of the size of the mesh belongs to it.
AT_FACE = 1e-6


@dataclass(frozen=True)
class Ball:
    """Points that are no further than `radius` (m) from `centre` (m)."""

    centre: tuple[float, ...]
    radius: float

    def __call__(self, x: Array, size: float | None = None) -> BoolArray:
        """Which points x (3, n) belong to it; `size`: of the mesh, m."""
        offset = x - np.reshape(self.centre, (3, 1))
        return np.asarray(np.linalg.norm(offset, axis=0) <= self.radius + _slack(x, size))

    def __str__(self) -> str:
        return f"within {self.radius:g} m of {_point(self.centre)}"


@dataclass(frozen=True)
class Box:
    """Points between `lower` and `upper` (m) in every direction."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def __call__(self, x: Array, size: float | None = None) -> BoolArray:
        """Which points x (3, n) belong to it; `size`: of the mesh, m."""
        slack = _slack(x, size)
        low, high = (np.reshape(corner, (3, 1)) for corner in (self.lower, self.upper))
        return np.asarray(((x >= low - slack) & (x <= high + slack)).all(axis=0))

    def __str__(self) -> str:
        return f"in the box from {_point(self.lower)} to {_point(self.upper)}"


@dataclass(frozen=True)
class Plane:
    """Points of the plane through `point` (m) across the unit vector `normal`."""

    point: tuple[float, ...]
    normal: tuple[float, ...]

    def __call__(self, x: Array, size: float | None = None) -> BoolArray:
        """Which points x (3, n) belong to it; `size`: of the mesh, m."""
        height = np.asarray(self.normal) @ (x - np.reshape(self.point, (3, 1)))
        return np.asarray(np.abs(height) <= _slack(x, size))

    def __str__(self) -> str:
        return f"on the plane through {_point(self.point)} across {_numbers(self.normal)}"


Region = Ball | Box | Plane


def ball(given: Any) -> Ball:
    """near=(point, radius)."""
    centre, radius = _pair("near", given, "(point, radius), as near=((0, 0, 0.1), 5e-3)")
    return Ball(_padded("the point of near", centre), nonnegative("the radius of near", radius))


def _box(given: Any) -> Box:
    """box=(lower, upper)."""
    pair = _pair("box", given, "(lower, upper), as box=((0, 0, 0), (0.1, 0.2, 0.05))")
    lower, upper = (_padded("a corner of box", corner) for corner in pair)
    if any(low > high for low, high in zip(lower, upper, strict=True)):
        raise InputError(
            f"box=(lower, upper) has a lower corner {_numbers(lower)} above the upper corner "
            f"{_numbers(upper)} in some direction: exchange these coordinates."
        )
    return Box(lower, upper)


def _plane(given: Any) -> Plane:
    """plane=(point, normal)."""
    pair = _pair("plane", given, "(point, normal), as plane=((0, 0, 0), (0, 0, 1))")
    point, normal = _padded("the point of plane", pair[0]), array("normal", pair[1], (None,))
    across = np.array(_padded("the normal of plane", normal))
    length = float(np.linalg.norm(across))
    if length == 0:
        raise InputError("the normal of plane must not be the zero vector.")
    return Plane(point, tuple((across / length).tolist()))


def _pair(name: str, given: Any, form: str) -> tuple[Any, Any]:
    if not isinstance(given, list | tuple) or len(given) != 2:
        raise InputError(f"{name} must be a pair {form}; got {shown(given)}.")
    return given[0], given[1]


def _padded(name: str, given: Any) -> tuple[float, ...]:
    """Three coordinates; z = 0 where there are two."""
    point = coordinates(name, given)
    return (*point, 0.0) if len(point) == 2 else tuple(point)


def _slack(x: Array, size: float | None) -> float:
    if size is None:
        size = float(np.linalg.norm(np.ptp(x, axis=1))) if x.shape[1] else 0.0
    return AT_FACE * size


def _point(point: tuple[float, ...]) -> str:
    return f"{_numbers(point)} m"


def _numbers(values: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"
