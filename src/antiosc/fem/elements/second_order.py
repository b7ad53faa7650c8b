"""Second-order strain η(a, b) of solids and of sheets: strains are ε(u) + η(u, u)/2.

Solids have the Green–Lagrange strain, η(a, b) = (∇aᵀ∇b + ∇bᵀ∇a)/2. Sheets have that of the middle
surface, with the tangential derivatives of all three displacements. It also holds on folded and
curved sheets; on a flat one it is von Kármán's. Membrane stretching, prestress and spin use it:
with the internal forces N of a state, the geometric stiffness is K_σ(a, b) = ∫ N : η(a, b).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import ufl

from antiosc.base._types import Array
from antiosc.fem.elements.beam import Beam, Truss, axes_of_beams, halves
from antiosc.fem.elements.shell import Frame, frames, section_fields, strains_of
from antiosc.fem.elements.solid import depth_of, isotropic_stress, voigt_strain
from antiosc.fem.elements.weak_form import Parts, coefficient, measure, tangent
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import compat

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from antiosc.fem.structure.meshed import MeshedStructure


def solid_eta(a: Expr, b: Expr) -> Expr:
    """Second-order strain η(a, b) (gdim, gdim) of two displacement fields of a solid (UFL)."""
    A = ufl.grad(a)
    B = ufl.grad(b)
    return ufl.sym(ufl.dot(ufl.transpose(A), B))


def sheet_eta(frame: Frame, a: Expr, b: Expr) -> Expr:
    """Second-order strain (η11, η22, 2 η12) in a sheet's frame, of motions of six components."""
    (a1, a2), (b1, b2) = (_tangential(frame, motion) for motion in (a, b))
    return ufl.as_vector([ufl.dot(a1, b1), ufl.dot(a2, b2), ufl.dot(a1, b2) + ufl.dot(a2, b1)])


def _tangential(frame: Frame, motion: Expr) -> tuple[Expr, Expr]:
    """Derivatives (3,) of the displacement along e1 and along e2."""
    u = ufl.as_vector([motion[i] for i in range(3)])
    slopes = ufl.dot(ufl.grad(u), ufl.transpose(frame.along))
    first, second = (ufl.as_vector([slopes[i, j] for i in range(3)]) for j in (0, 1))
    return first, second


class SecondOrderStrain(NamedTuple):
    """Second-order strain η of an element family; the total strain is ε(u) + η(u, u)/2.

    `strain` is ε(u), `eta` is η(a, b); `forces` gives N, which is linear in the strain.
    """

    strain: Callable[[Expr], Expr]
    eta: Callable[[Expr, Expr], Expr]
    forces: Callable[[Expr], Expr]
    #: degree of the quadrature
    degree: int

    def energy(self, u: Expr, initial: Expr | None = None) -> Expr:
        """Energy density of u beyond ε:C:ε/2 of linear theory; `initial`: a stress-free strain.

        Its second derivative at u is K_σ plus the change of the elastic stiffness: at u the strain
        of a motion v is ε(v) + η(u, v).
        """
        strain = self.strain(u)
        eta = self.eta(u, u)
        energy = ufl.inner(self.forces(strain), eta) / 2 + ufl.inner(self.forces(eta), eta) / 8
        if initial is not None:
            energy -= ufl.inner(self.forces(initial), strain + eta / 2)
        return energy

    def of_stress(self, u: Expr, initial: Expr | None, v: Expr, w: Expr) -> Expr:
        """Density of the geometric stiffness K_σ at u: N : η(v, w)."""
        strain = self.strain(u) + self.eta(u, u) / 2
        if initial is not None:
            strain = strain - initial
        return ufl.inner(self.forces(strain), self.eta(v, w))


def stretch_of(mesh: Mesh, parts: Parts, order: int) -> SecondOrderStrain:
    """The second-order strain of the family of `parts`, for displacements of degree `order`."""
    material = parts[0][0]
    if material.kind.sheet:
        return _sheet_strain(mesh, parts)
    if isinstance(material, Beam):
        return _beam_strain(mesh, parts, order)
    if isinstance(material, Truss):
        return _bar_strain(mesh, parts)
    return _solid_strain(mesh, parts, order)


def _solid_strain(mesh: Mesh, parts: Parts, order: int) -> SecondOrderStrain:
    """Second-order strain of solids."""
    degree = 4 * (order - 1) + 2 * (mesh.order - 1)
    if mesh.cell in ("quadrilateral", "hexahedron"):
        degree = 2 * order + 1
    if any(not hasattr(material, "plane") for material, _ in parts):  # some have directions
        C = coefficient(mesh, parts, lambda s: s.voigt)

        def voigt_eta(a: Expr, b: Expr) -> Expr:
            return voigt_strain(solid_eta(a, b))

        return SecondOrderStrain(
            lambda u: voigt_strain(ufl.sym(ufl.grad(u))), voigt_eta, lambda e: C * e, degree
        )

    stress = isotropic_stress(mesh, parts)
    depth = depth_of(mesh, parts)
    return SecondOrderStrain(
        lambda u: ufl.sym(ufl.grad(u)), solid_eta, lambda e: depth * stress(e), degree
    )


def _sheet_strain(mesh: Mesh, parts: Parts) -> SecondOrderStrain:
    """Second-order strain of sheets, on the neutral surface; curved quadrilaterals use 2×2
    points.
    """
    frame = frames(mesh, parts)
    section = section_fields(mesh, parts)

    def strain(u: Expr) -> Expr:
        strains = strains_of(frame, u, section.middle)
        if section.coupling is None:
            return strains.membrane
        return strains.membrane + section.coupling * strains.bending

    degree = 6 + 2 * (mesh.order - 1)
    if mesh.cell == "quadrilateral":
        degree = 5 if mesh.order == 1 else 3
    return SecondOrderStrain(
        strain, lambda a, b: sheet_eta(frame, a, b), lambda e: section.A * e, degree
    )


def _beam_strain(mesh: Mesh, parts: Parts, order: int) -> SecondOrderStrain:
    """Second-order strain of beams along the axis; η contains the squared twist × polar radius²."""
    EA = coefficient(mesh, parts, lambda b: b.E * b.section.A)
    radius2 = coefficient(mesh, parts, lambda b: (b.section.I + b.section.side) / b.section.A)
    offset = coefficient(mesh, parts, lambda b: b.offset)
    axes = axes_of_beams(mesh, parts)

    def slopes(q: Expr) -> tuple[Expr, Expr]:
        return halves(mesh, ufl.dot(ufl.grad(q), tangent(mesh)))

    def strain(q: Expr) -> Expr:
        u, rotation = slopes(q)
        return ufl.dot(u, axes.t) - offset * ufl.dot(rotation, axes.z)

    def eta(a: Expr, b: Expr) -> Expr:
        u, rotation = slopes(a)
        v, twist = slopes(b)
        return ufl.dot(u, v) + radius2 * ufl.dot(rotation, axes.t) * ufl.dot(twist, axes.t)

    return SecondOrderStrain(strain, eta, lambda e: EA * e, 2 * order - 1)


def _bar_strain(mesh: Mesh, parts: Parts) -> SecondOrderStrain:
    """Second-order strain of truss bars."""
    EA = coefficient(mesh, parts, lambda bar: bar.E * bar.area)
    t = tangent(mesh)

    def slope(u: Expr) -> Expr:
        return ufl.dot(ufl.grad(u), t)

    return SecondOrderStrain(
        lambda u: ufl.dot(slope(u), t),
        lambda a, b: ufl.dot(slope(a), slope(b)),
        lambda e: EA * e,
        0,
    )


#: Distance of nodes from a plane, over the thickness, up to which a sheet is flat.
FLAT = 1e-3


def quadratic_share(part: MeshedStructure, shape: Array, stiffness: float) -> float:
    """Relative change [1/m] of the static force on a sheet per metre of displacement.

    The reference is the static state under a prestress, if there is one. `shape` (rows of this
    rank): displacements and rotations for 1 m of displacement at the site, which takes the static
    force `stiffness` [N/m]. The strain energy of the motion q × shape is k q²/2 + g q³/2 + …, with
    g = ∫ N : η and N the membrane forces of the shape; the force is k q (1 + 3 g q/(2 k)). The
    result is 0 for a flat sheet without prestress, and negative if the sheet softens. Quartic
    terms, which stiffen every sheet, are not included.
    """
    if is_flat(part) and part.preload is None:
        return 0.0
    frame = frames(part.mesh, part.parts)
    section = section_fields(part.mesh, part.parts)
    motion = compat.function_of(part.form.space, shape)
    strains = strains_of(frame, motion, section.middle)
    stretch = strains.membrane
    if section.coupling is not None:
        stretch = stretch + section.coupling * strains.bending
    if part.preload is not None:
        state = compat.function_of(part.form.space, part.preload.q)
        stretch = stretch + sheet_eta(frame, state, motion)
    energy = ufl.inner(section.A * stretch, sheet_eta(frame, motion, motion))
    g = compat.integrate(energy * measure(part.mesh, 6), part.mesh.dolfinx)
    return 1.5 * g / stiffness


def is_flat(part: MeshedStructure) -> bool:
    """Whether all nodes of a part made of sheets lie in one plane."""
    x = part.mesh.dolfinx.geometry.x
    thickness = min(material.section.thickness for material, _ in part.parts)
    return part.mesh.gdim == 2 or _out_of_plane(part.comm.allgather(x)) <= FLAT * thickness


def _out_of_plane(points: list[Array]) -> float:
    """Largest distance [m] of points from the plane fitted to them."""
    x = np.vstack(points)
    x = x - x.mean(axis=0)
    normal = np.linalg.svd(x, full_matrices=False)[2][2]
    return float(np.abs(x @ normal).max(initial=0.0))
