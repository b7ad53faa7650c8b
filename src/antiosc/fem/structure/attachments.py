"""Masses, springs, dampers and footings at points of a structure.

None has dofs of its own: they are sums of m b bᵀ, bᵀu being one displacement component of a point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import scipy.sparse
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import (
    Checked,
    array,
    checked_by,
    choice,
    coordinates,
    in_words,
    nonnegative,
    positive,
    several,
    shown,
)
from antiosc.base.errors import InputError
from antiosc.closed_form.soil import soil_cone
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.mesh.closest_point import ClosestPoint, closest
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.structure.dissipation import Dissipation
from antiosc.fem.structure.placement import in_space
from antiosc.io.dof_map import COMPONENTS

#: A point this share of the size off the structure, as by a curved mesh, is moved onto it.
NEAR = 1e-3


def _checked_where(_: str, where: object) -> str | tuple[float, ...]:
    """A group's name, or coordinates."""
    return where if isinstance(where, str) else coordinates("where, if no group's name,", where)


def _checked_inertia(name: str, value: object) -> float | tuple[float, ...]:
    values = array(name, value, None)
    if values.shape not in ((), (3,)) or (values < 0).any():
        raise InputError(
            f"inertia must be >= 0, one number or three (in kg m²); got {shown(value)}."
        )
    return tuple(values.tolist()) if values.ndim else float(values)


def by_components(
    name: str, given: object, kind: str, allowed: Sequence[str] = COMPONENTS
) -> dict[str, float]:
    """Values > 0 by components, the stiffness or damping of a `kind`, or InputError."""
    if not isinstance(given, Mapping):
        raise InputError(f"the {name} of a {kind} is a dict, as {{'z': 1e6}}; got {shown(given)}.")
    for component in given:
        if component not in allowed:
            raise InputError(
                f"a {kind} acts on {', '.join(allowed)}; {shown(component)} is not one of them."
            )
    return {
        component: positive(f"the {name} along {component}", value)
        for component, value in given.items()
    }


def _some_components(name: str, given: object, kind: str) -> dict[str, float]:
    found = by_components(name, given, kind)
    if not found:
        raise InputError(f"a {kind} needs a {name}, as in {kind}(where, {{'z': 1e5}}).")
    return found


@dataclass(frozen=True)
class PointMass(Checked):
    """A rigid mass at a point, such as a motor on a panel.

    Parameters
    ----------
    where : str or sequence of floats
        A group of points of the mesh (each of them carries one such mass), or coordinates in m
        of any point of the structure.
    mass : float
        kg.
    inertia : float or sequence of 3 floats
        Moments of inertia about x, y and z, kg m²; on beams and shells.
    """

    where: str | Sequence[float] = field(metadata=checked_by(_checked_where))
    mass: float = field(metadata=checked_by(nonnegative, "kg"))
    inertia: float | Sequence[float] = field(default=0.0, metadata=checked_by(_checked_inertia))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mass == 0 and not np.any(self.inertia):
            raise InputError("a PointMass needs a mass or an inertia; both are 0.")

    def values(self) -> dict[str, float]:
        """Component -> mass or inertia."""
        inertia = np.broadcast_to(self.inertia, (3,)).tolist()
        return dict(zip(COMPONENTS, [*[self.mass] * 3, *inertia], strict=True))


@dataclass(frozen=True)
class Spring(Checked):
    """A spring from a point of the structure to the ground.

    Parameters
    ----------
    where : str or sequence of floats
        As for `PointMass`.
    stiffness : dict
        Component -> stiffness: of "x", "y", "z" (N/m), "rx", "ry", "rz" (N m/rad).
    """

    where: str | Sequence[float] = field(metadata=checked_by(_checked_where))
    stiffness: Mapping[str, float] = field(metadata=checked_by(_some_components, "Spring"))


@dataclass(frozen=True)
class Damper(Checked):
    """A damper from a point of the structure to the ground, or to another point of it.

    Models have it exactly, however strong it is: their damping is a `DampingMatrix`.

    Parameters
    ----------
    where : str or sequence of floats
        As for `PointMass`.
    damping : dict
        Component -> damping: of "x", "y", "z" (N s/m), "rx", "ry", "rz" (N m s/rad).
    to : sequence of floats, optional
        The other end, m; None: the ground.
    tau : float, optional
        The damper is in series with a spring of stiffness damping/tau (N/m), so that it relaxes in
        this time, s (Maxwell).
    """

    where: str | Sequence[float] = field(metadata=checked_by(_checked_where))
    damping: Mapping[str, float] = field(metadata=checked_by(_some_components, "Damper"))
    to: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    tau: float | None = field(default=None, metadata=checked_by(positive, "s"))

    @property
    def values(self) -> dict[str, float]:
        """Component -> damping, or stiffness of what relaxes."""
        return {name: c / (self.tau or 1.0) for name, c in self.damping.items()}


@dataclass(frozen=True)
class Footing:
    """A rigid round footing on soil under a point: springs, dashpots and mass of `soil_cone`.

    Soil does not pull: the support is right where the weight keeps the footing on the ground.

    Parameters
    ----------
    where : str or sequence of floats
        As for `PointMass`.
    radius, G, nu, rho : float
        As for `soil_cone`.
    mass : float
        Of the footing, kg; of soil that moves with it (nu > 1/3) there is more.
    up : "x", "y" or "z"
        Normal of the ground. Along it the soil has its vertical stiffness.
    along : sequence of "x", "y" and "z"
        Directions in which the soil holds the footing.
    """

    where: str | Sequence[float]
    radius: float
    G: float
    nu: float
    rho: float
    mass: float = 0.0
    up: Literal["x", "y", "z"] = "z"
    along: Sequence[str] = ("x", "y", "z")

    def __post_init__(self) -> None:
        self._parts()

    def _parts(self) -> list[PointMass | Spring | Damper]:
        """What it adds to a structure."""
        choice("up", self.up, ("x", "y", "z"))
        soil = {
            choice("along", axis, ("x", "y", "z")): soil_cone(
                self.radius, self.G, self.nu, self.rho,
                "vertical" if axis == self.up else "horizontal",
            )
            for axis in several("along", self.along, str, "directions as \"x\"")
        }  # fmt: skip
        mass = nonnegative("mass", self.mass, "kg") + sum(cone.mass for cone in soil.values())
        return [
            Spring(self.where, {axis: cone.stiffness for axis, cone in soil.items()}),
            Damper(self.where, {axis: cone.damping for axis, cone in soil.items()}),
            *([PointMass(self.where, mass)] if mass else []),
        ]


#: What a structure carries at points.
Attachment = PointMass | Spring | Damper | Footing


def attachments_of(given: object) -> list[PointMass | Spring | Damper]:
    """Checked attachments, a footing by its parts."""
    known = (PointMass, Spring, Damper, Footing)
    found: list[Attachment] = several(
        "attached", given, known, "PointMass, Spring, Damper and Footing objects"
    )
    return [part for one in found for part in (one._parts() if isinstance(one, Footing) else [one])]


def values_of(one: PointMass | Spring | Damper, plane: bool) -> dict[str, float]:
    """Component -> mass, stiffness or damping; a damper that relaxes has a stiffness.

    A mass on a `plane` structure has none along z, nor about x and y.
    """
    if isinstance(one, Spring):
        return dict(one.stiffness)
    if isinstance(one, Damper):
        return one.values
    names = ("x", "y", "rz") if plane else COMPONENTS
    return {name: value for name, value in one.values().items() if value and name in names}


@dataclass(frozen=True)
class Matrices:
    """The matrices of a structure, and data with which attachments change them in place."""

    mesh: Mesh
    form: WeakForm
    K: PETSc.Mat
    M: PETSc.Mat
    #: dofs of this rank, ghosts included, that the supports hold
    fixed: IntArray


@dataclass(frozen=True)
class Added:
    """Contributions of attachments other than to K and M, summed by the structure."""

    #: kg
    mass: float
    #: M e for unit accelerations e along x, y, z, of the attachment alone (rows of this rank, 3)
    inertia: Array
    #: b of every component on which a spring acts (rows of this rank, k)
    springs: Array
    dampers: Sequence[Dissipation] = ()


def add_at_points(to: Matrices, one: PointMass | Spring | Damper) -> Added:
    """Add a mass or a spring at its points; K and M know nothing of dampers."""
    values = values_of(one, plane="z" not in to.form.components)
    foreign = [component for component in values if component not in to.form.components]
    if foreign:
        raise InputError(
            f"{type(one).__name__} at {one.where!r} acts on {', '.join(foreign)}, but the "
            f"components of this structure are {', '.join(to.form.components)}."
        )
    matrix = to.M if isinstance(one, PointMass) else to.K if isinstance(one, Spring) else None
    points = _attachment_points(to.mesh, one.where)
    rows = compat.local_size(to.form.space)
    mass, inertia, springs = 0.0, np.zeros((rows, 3)), np.zeros((rows, 0))
    found = [
        (component, value, _add_component(to, matrix, component, nearest, value))
        for nearest in points
        for component, value in values.items()
    ]
    if matrix is not None:
        matrix.assemble()
    if isinstance(one, Damper):
        ground = [] if one.to is None else _attachment_points(to.mesh, one.to)
        ends = {c: _add_component(to, None, c, end, 0.0) for end in ground for c in values}
        G = np.array([b - ends[c] if ends else b for c, _, b in found]).reshape(-1, rows)
        c = np.diag([value for _, value, _ in found])
        damper = Dissipation(scipy.sparse.csr_matrix(G), c, one.tau)
        return Added(mass, inertia, springs, [damper])
    if isinstance(one, Spring):
        return Added(mass, inertia, np.column_stack([springs, *(b for _, _, b in found)]))
    for component, value, b in found:
        if component in "xyz":
            inertia[:, "xyz".index(component)] += value * b
    return Added(one.mass * len(points), inertia, springs)


def _add_component(
    to: Matrices, matrix: PETSc.Mat | None, component: str, nearest: ClosestPoint, value: float
) -> Array:
    """Add value·b bᵀ for one displacement component bᵀu of a point; b (rows of this rank)."""
    path = to.form.components[component]
    vector = to.K.createVecRight()
    if to.mesh.comm.rank == nearest.rank:
        dofs = compat.subspace(to.form.space, path).dofmap.cell_dofs(nearest.cell)
        weights = compat.tabulate(to.form.space, path, nearest.X.reshape(1, -1))[0]
        weights = np.where(np.isin(dofs, to.fixed), 0.0, weights)
        rows = compat.global_dofs(to.form.space, dofs)
        add = PETSc.InsertMode.ADD_VALUES
        if matrix is not None:
            matrix.setValues(rows, rows, value * np.outer(weights, weights), addv=add)
        vector.setValues(rows, weights, addv=add)
    vector.assemble()
    b = np.array(vector.array_r)
    vector.destroy()
    return b


def _attachment_points(mesh: Mesh, where: str | Sequence[float]) -> list[ClosestPoint]:
    if not isinstance(where, str):
        nearest = closest(mesh, in_space(where))
        if nearest.distance > NEAR * mesh.extent():
            raise InputError(
                f"the point {in_words(where)} is {nearest.distance:.3g} m off the structure; its "
                f"nearest point is {in_words(nearest.x)}."
            )
        return [nearest]
    group = mesh.group(where)
    if set(group) != {0}:
        raise InputError(
            f"group {where!r} must hold points alone to carry masses or springs; it holds "
            f"entities of dimension {', '.join(str(dim) for dim in sorted(group))}."
        )
    owned = mesh.dolfinx.topology.index_map(0).size_local
    mine = group[0][group[0] < owned]
    x = mesh.dolfinx.geometry.x[compat.entity_vertices(mesh.dolfinx, 0)[mine, 0]]
    points = np.vstack(mesh.comm.allgather(x))
    return [closest(mesh, point) for point in points]
