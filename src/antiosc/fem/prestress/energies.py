"""Energies (UFL) of pressures and of spin on a mesh; measures of its groups."""

from __future__ import annotations

from typing import TYPE_CHECKING

import dolfinx
import numpy as np
import ufl

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.beam import Beam, axes_of_beams
from antiosc.fem.elements.shell import frames, section_fields
from antiosc.fem.elements.solid import depth_of
from antiosc.fem.elements.weak_form import Parts, axes_and_sides, coefficient, measure
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat
from antiosc.fem.prestress import Spin

if TYPE_CHECKING:
    from ufl.core.expr import Expr

#: Degree of the quadrature of loads: products of P2 displacements, slopes and normals.
DEGREE = 5


def measure_on(mesh: Mesh, dim: int, entities: IntArray) -> tuple[Expr, ufl.Measure]:
    """(factor, UFL measure) of cells or of outer facets of this rank."""
    if dim == mesh.tdim:
        indicator = compat.cellwise(mesh.dolfinx)
        indicator.x.array[entities] = 1.0
        return indicator, measure(mesh, DEGREE)
    marks = np.ones(len(entities), dtype=np.int32)
    order = np.argsort(entities)
    tags = dolfinx.mesh.meshtags(mesh.dolfinx, dim, entities[order].astype(np.int32), marks)
    metadata = {"quadrature_degree": DEGREE}
    ds = ufl.Measure("ds", domain=mesh.dolfinx, subdomain_data=tags, metadata=metadata)
    return compat.constant(mesh.dolfinx, 1.0), ds(1)


def pressure_energy(
    mesh: Mesh, parts: Parts, u: Expr, where: tuple[str, int, IntArray]
) -> ufl.Form:
    """Work of a unit pressure to second order in u; `where`: a group, its dimension, its
    entities.
    """
    group, dim, entities = where
    sheet = parts[0][0].kind.sheet
    if dim != (mesh.tdim if sheet else mesh.tdim - 1) or mesh.tdim == 1:
        raise InputError(
            f"pressure acts on faces of solids and on cells of sheets; group {group!r} holds "
            f"entities of dimension {dim}: give force={{{group!r}: (x, y, z)}} there."
        )
    factor, dx = measure_on(mesh, dim, entities)
    if not sheet:
        n = ufl.FacetNormal(mesh.dolfinx)
        slope = ufl.grad(u)
        normal_change = ufl.tr(slope) * n - ufl.dot(ufl.transpose(slope), n)
        against = -depth_of(mesh, parts) * factor
        return against * (ufl.dot(u, n) + ufl.dot(u, normal_change) / 2) * dx
    frame = frames(mesh, parts)
    _, side = axes_and_sides(mesh, parts)
    J = ufl.Jacobian(mesh.dolfinx)
    a, b = (_in_space([J[i, j] for i in range(mesh.gdim)]) for j in (0, 1))
    normal = ufl.cross(a, b)
    to_top = side * ufl.sign(ufl.dot(normal, frame.n))
    displacement = ufl.as_vector([u[i] for i in range(3)])
    slopes = ufl.dot(ufl.grad(displacement), ufl.transpose(frame.along))
    u1, u2 = (ufl.as_vector([slopes[i, j] for i in range(3)]) for j in (0, 1))
    normal_change = ufl.cross(u1, frame.e2) + ufl.cross(frame.e1, u2)
    work = ufl.dot(displacement, frame.n) + ufl.dot(displacement, normal_change) / 2
    return factor * to_top * work * dx


def _in_space(components: list[Expr]) -> Expr:
    """The components as a vector (3,), with zeros where they are missing."""
    return ufl.as_vector([*components, *[0] * (3 - len(components))])


def spin_energy(mesh: Mesh, parts: Parts, u: Expr, spin: Spin, density: Expr) -> ufl.Form:
    """Σ ρ a·a/2 over all mass of the cells, a = Ω P (x + u), to second order in the rotations."""
    S = ufl.as_matrix(spin.stiffness.tolist())
    spin_origin = np.array(spin.about)
    x = ufl.SpatialCoordinate(mesh.dolfinx)
    position = _in_space([x[i] - float(spin_origin[i]) + u[i] for i in range(mesh.gdim)])
    dx = measure(mesh, DEGREE + 1)
    energy = density * ufl.dot(position, S * position) / 2
    for direction, first, second in _fibres(mesh, parts):
        rotation = ufl.as_vector([u[i] for i in range(3, 6)])
        rotated = ufl.cross(rotation, direction)
        arm = direction + rotated + ufl.cross(rotation, rotated) / 2
        energy += first * ufl.dot(position, S * arm) + second * ufl.dot(arm, S * arm) / 2
    return energy * dx


def _fibres(mesh: Mesh, parts: Parts) -> list[tuple[Expr, Expr, Expr]]:
    """Triples (direction, ∫ρ z, ∫ρ z²) across the sections or the thickness of elements with
    rotations.
    """
    material = parts[0][0]
    if material.kind.sheet:
        section = section_fields(mesh, parts)
        n = frames(mesh, parts).n
        return [(n, 0.0 if section.I1 is None else section.I1, section.I2)]
    if not isinstance(material, Beam) or mesh.gdim == 2:
        return []
    axes = axes_of_beams(mesh, parts)

    def of(value: str) -> Expr:
        return coefficient(mesh, parts, lambda b: b.rho * getattr(b.section, value))

    offset = coefficient(mesh, parts, lambda b: b.offset)
    first = of("A") * offset
    return [(axes.y, first, of("I") + first * offset), (axes.z, 0.0, of("side"))]


def total_of(mesh: Mesh, group: str, dim: int, entities: IntArray) -> float:
    """Length, area or volume of a group; InputError if it is 0."""
    factor, dx = measure_on(mesh, dim, entities)
    size = compat.integrate(factor * dx, mesh.dolfinx)
    if size <= 0:
        raise InputError(f"the group {group!r} holds no outer faces, on which loads act.")
    return size


def spread(mesh: Mesh, v: Expr, force: Array, where: tuple[str, int, IntArray]) -> ufl.Form:
    """Work of a force (3,), distributed evenly over a group, on the test function v."""
    group, dim, entities = where
    factor, dx = measure_on(mesh, dim, entities)
    density = (force / total_of(mesh, group, dim, entities)).tolist()
    return factor * sum(density[i] * v[i] for i in range(mesh.gdim)) * dx
