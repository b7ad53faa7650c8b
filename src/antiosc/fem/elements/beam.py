"""`Beam` (Timoshenko or Euler–Bernoulli) and `Truss`, on line meshes in a plane or in space."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import sqrt
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from antiosc.base._types import Array, Box
from antiosc.base.checks import checked_by, flag, floats, instance, number, positive
from antiosc.base.errors import InputError
from antiosc.fem.elements import Section
from antiosc.fem.elements.weak_form import (
    DIRECTION_CHECK,
    Direction,
    Isotropic,
    Kind,
    Parts,
    WeakForm,
    coefficient,
    compat,
    measure,
    shown_direction,
    split_motion,
    tangent,
    ufl,
)
from antiosc.fem.platform import done_on_all

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from antiosc.fem.mesh import Mesh

#: Shear stiffness of an Euler–Bernoulli beam over EI/L²: deflections are 3e-10 (L/l)² too large.
SHEAR_PENALTY = 1e10


@dataclass(frozen=True)
class Beam(Isotropic):
    """A beam on a mesh of lines with straight elements, after Timoshenko or Euler and Bernoulli.

    Parameters
    ----------
    E, nu, rho : float
        Young's modulus (Pa), Poisson's ratio, density (kg/m³).
    section : Section
        The cross-section.
    orientation : sequence of 3 floats or function, optional
        A vector whose component normal to the axis is the direction of the section's height (y).
        Required in space unless both second moments and both shear coefficients are equal; in a
        plane frame the height lies in the plane. A function of points x (3, n) returns such vectors
        (3, n), for instance for rings.
    offset : float
        In space: distance in m of the centroid from the line of the mesh, along `orientation`, for
        instance of a stiffener on the edges of a shell.
    shear : bool
        False: rigid in shear and without rotary inertia in bending (Euler–Bernoulli). Not for
        stiffeners of a shell.
    yield_strength : float, optional
        For the margin of safety (`peak_field`), Pa.

    Components in space: x, y, z (displacements) and rx, ry, rz (rotations); in a plane: x, y, rz.
    Elements are quadratic by default (`Structure(..., order=2)`), with K integrated at two points;
    order=1 is the classical element, with one point, as in the article.
    """

    kind: ClassVar[Kind] = Kind("beam", outside=False, point_load=True)
    patch_radius: ClassVar[None] = None

    section: Section = field(metadata=checked_by(instance, Section, "a Section"))
    orientation: Direction | None = field(default=None, metadata=DIRECTION_CHECK)
    offset: float = field(default=0.0, metadata=checked_by(number, "m"))
    shear: bool = field(default=True, metadata=checked_by(flag))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.offset and self.orientation is None:
            raise InputError(f"offset = {self.offset:g} m needs an orientation, as (0, 0, 1).")

    def shear_stiffness(self, plane: int, size: float) -> float:
        """G κ A [N] along the height (`plane` 0) or across it (1); `SHEAR_PENALTY` × EI/size² of a
        beam that is rigid in shear, where `size` [m] is the extent of the mesh."""
        I, shear = self.section.planes[plane]  # noqa: E741
        if self.shear:
            return self.G * self.section.A * shear
        return SHEAR_PENALTY * self.E * I / size**2

    def rotary_inertia(self, I: float) -> float:  # noqa: E741
        """Rotary inertia per length [kg m] for bending with second moment `I`."""
        return self.rho * I if self.shear else 0.0

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Weak form of beams; InputError for a mesh that does not suit them."""
        if mesh.tdim != 1:
            raise InputError(f"Beam needs a mesh of lines; {mesh.name} is of {mesh.cell}s (Solid).")
        if mesh.order != 1:
            raise InputError("Beam elements are straight; read the mesh with order 1, finer.")
        if mesh.gdim == 2 and any(beam.offset for beam, _ in parts):
            raise InputError("offset applies to beams in space: read the mesh with gdim 3.")
        return line_weak_form(mesh, parts, order)

    def dimensions(self, box: Box, materials: Sequence[Beam]) -> Box:
        """(length, width, thickness) [m] of a beam, from rectangles with the sections' A and I.

        The thickness is the least height; the width is the largest A over the thickness.
        """
        sections = [material.section for material in materials]
        thickness = min((12 * section.I / section.A) ** 0.5 for section in sections)
        return box[0], max(section.A for section in sections) / thickness, thickness


def line_weak_form(mesh: Mesh, parts: Parts, order: int, on_sheet: bool = False) -> WeakForm:
    """Weak form of beams; `on_sheet`: stiffeners of a shell, whose twist moves no centroid."""
    names = ("x", "y", "rz") if mesh.gdim == 2 else ("x", "y", "z", "rx", "ry", "rz")
    space = compat.lagrange_space(mesh.dolfinx, order, len(names))
    w = ufl.TrialFunction(space)
    v = ufl.TestFunction(space)
    t, y, z = axes_of_beams(mesh, parts)
    offset = coefficient(mesh, parts, lambda b: b.offset)

    # A stiffener follows the twist of its sheet by warping, without shear.
    twist_shifts = not on_sheet and any(b.offset for b, _ in parts)

    size = mesh.extent()

    def root(stiffness: Callable[[Beam], float]) -> Expr:
        return coefficient(mesh, parts, lambda beam: sqrt(stiffness(beam)))

    of_force = [
        (root(lambda b: b.E * b.section.A), t),
        (root(lambda b: b.shear_stiffness(0, size)), y),
        (root(lambda b: b.shear_stiffness(1, size)), z),
    ]
    of_moment = [
        (root(lambda b: b.G * b.section.torsion), t),
        (root(lambda b: b.E * b.section.side), y),
        (root(lambda b: b.E * b.section.I), z),
    ]
    if mesh.gdim == 2:
        of_force, of_moment = of_force[:2], of_moment[2:]

    def strains(q: Expr) -> Expr:  # times √stiffness
        _, rotation = split_motion(q)
        slope_u, slope_turn = split_motion(ufl.dot(ufl.grad(q), tangent(mesh)))

        # Bending stretches a centroid that is off the line, and twist shifts it sideways.
        shift = -offset * ufl.dot(slope_turn, z) * t
        if twist_shifts:
            shift = shift + offset * ufl.dot(slope_turn, t) * z
        stretch = slope_u + shift - ufl.cross(rotation, t)
        forces = [factor * ufl.dot(stretch, axis) for factor, axis in of_force]
        moments = [factor * ufl.dot(slope_turn, axis) for factor, axis in of_moment]
        return ufl.as_vector(forces + moments)

    rhoA = coefficient(mesh, parts, lambda b: b.rho * b.section.A)
    inertias = [
        (coefficient(mesh, parts, lambda b: b.rho * (b.section.I + b.section.side)), t),
        (coefficient(mesh, parts, lambda b: b.rotary_inertia(b.section.side)), y),
        (coefficient(mesh, parts, lambda b: b.rotary_inertia(b.section.I)), z),
    ]

    u, rotation = split_motion(w)
    u_v, turn_v = split_motion(v)
    centroid = u + offset * ufl.cross(rotation, y)
    centroid_v = u_v + offset * ufl.cross(turn_v, y)
    motion = rhoA * ufl.dot(centroid, centroid_v)
    for inertia, axis in inertias:
        motion += inertia * ufl.dot(rotation, axis) * ufl.dot(turn_v, axis)

    degree = 2 * order - 1  # `order` Gauss points, with which shear does not lock

    return WeakForm(
        space=space,
        stiffness=[ufl.dot(strains(w), strains(v)) * measure(mesh, degree)],
        mass=[motion * measure(mesh, 2 * order)],
        components={name: (i,) for i, name in enumerate(names)},
        density=rhoA,
        mass_moment=rhoA * offset * y if any(b.offset for b, _ in parts) else None,
        twist_moves_centroid=twist_shifts,
        strains=(strains(w), degree),
    )


class BeamAxes(NamedTuple):
    """Unit vectors (3,) (UFL): the tangent t, the height y, and z = t × y."""

    t: Expr
    y: Expr
    z: Expr


def axes_of_beams(mesh: Mesh, parts: Parts) -> BeamAxes:
    """Section axes of beams, as UFL expressions; in a plane frame the height is in the plane."""
    t = tangent(mesh)
    if mesh.gdim == 2:
        along = ufl.as_vector([t[0], t[1], 0])
        height = ufl.as_vector([-t[1], t[0], 0])
        return BeamAxes(along, height, ufl.as_vector([0, 0, 1]))

    height = _height_coefficient(mesh, parts)
    y = height - ufl.dot(height, t) * t
    y = y / ufl.sqrt(ufl.dot(y, y))
    return BeamAxes(t, y, ufl.cross(t, y))


def _height_coefficient(mesh: Mesh, parts: Parts) -> Expr:
    """Height direction of the section in each cell, as a cell-wise constant function."""
    nodes = compat.geometry_nodes(mesh.dolfinx)
    x = mesh.dolfinx.geometry.x
    axis = x[nodes[:, 1]] - x[nodes[:, 0]]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    middle = x[nodes].mean(axis=1)
    function = compat.cellwise_function(mesh.dolfinx, 3)
    values = function.x.array.reshape(-1, 3)

    def work() -> None:
        for beam, cells in parts:
            values[cells] = height_directions(beam, axis[cells], middle[cells])

    done_on_all(mesh.comm, work)
    return function


def height_directions(beam: Beam, axis: Array, middle: Array) -> Array:
    """Unit orientation vectors (n, 3) of n cells; their components across `axis` are the heights.
    `axis` (n, 3): unit vectors along the cells; `middle` (n, 3): midpoints [m]. InputError if an
    orientation is missing or parallel to an axis."""
    if beam.orientation is None:
        if not beam.section.isotropic:
            raise InputError(
                "a section with two different second moments of area or shear coefficients needs "
                "an orientation in space; the orientation (0, 0, 1) puts its height along z."
            )
        # Any direction across the axis will do: the unit vector least aligned with it.
        return np.eye(3)[np.argmin(np.abs(axis), axis=1)]
    directions = beam.orientation(middle.T).T if callable(beam.orientation) else beam.orientation
    height = floats("orientation", np.broadcast_to(directions, axis.shape), (len(axis), 3))
    length = np.linalg.norm(height, axis=1, keepdims=True)
    parallel = np.linalg.norm(np.cross(axis, height), axis=1) <= 1e-4 * length[:, 0]
    if parallel.any():
        direction_text = shown_direction(beam.orientation)
        raise InputError(
            f"the orientation{direction_text} is parallel to {int(parallel.sum())} beam elements: "
            "choose another direction, or give these a separate material."
        )
    return np.asarray(height / length)


@dataclass(frozen=True)
class Truss(Isotropic):
    """Bars of a truss: each cell of a mesh of lines is a bar between two hinges.

    Parameters
    ----------
    E, nu, rho : float
        Young's modulus (Pa), Poisson's ratio, density (kg/m³).
    area : float
        Area of the cross-section, m².
    yield_strength : float, optional
        For the margin of safety (`peak_field`), Pa.

    Components: x, y, z, or x, y in a plane. The elements are linear whatever the `order` of
    `Structure`, with half of the mass of a bar at each end. A node that joins only collinear bars
    is a mechanism: a bar divided into several cells needs supports or other bars there.
    """

    kind: ClassVar[Kind] = Kind("truss", outside=False, point_load=True)
    patch_radius: ClassVar[None] = None

    area: float = field(metadata=checked_by(positive, "m²"))

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """Axial strain energy of the bars; half of a bar's mass is at each of its ends. `order` has
        no effect; InputError for a mesh that is not of straight lines."""
        if mesh.tdim != 1:
            raise InputError(
                f"Truss needs a mesh of lines; {mesh.name} has {mesh.cell} cells (use Solid)."
            )
        if mesh.order != 1:
            raise InputError("the bars of a Truss are straight; read the mesh with order 1.")
        space = compat.lagrange_space(mesh.dolfinx, 1, mesh.gdim)
        w = ufl.TrialFunction(space)
        v = ufl.TestFunction(space)
        t = tangent(mesh)
        EA = coefficient(mesh, parts, lambda truss: truss.E * truss.area)
        density = coefficient(mesh, parts, lambda truss: truss.rho * truss.area)

        def strain(u: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
            return ufl.dot(ufl.dot(ufl.grad(u), t), t)

        at_ends = {"quadrature_rule": "GLL", "quadrature_degree": 1}
        return WeakForm(
            space=space,
            stiffness=[EA * strain(w) * strain(v) * measure(mesh, 0)],
            mass=[density * ufl.dot(w, v) * ufl.dx(domain=mesh.dolfinx, metadata=at_ends)],
            components={name: (i,) for i, name in enumerate("xyz"[: mesh.gdim])},
            density=density,
        )

    def dimensions(self, box: Box, materials: Sequence[Truss]) -> Box:
        """(length, largest side, least side) [m], as if the bars' sections were squares."""
        areas = [material.area for material in materials]
        return box[0], sqrt(max(areas)), sqrt(min(areas))
