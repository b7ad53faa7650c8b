"""Second-order strain η(a, b) of solids and of sheets: strains are ε(u) + η(u, u)/2.

Solids have the Green–Lagrange strain, η(a, b) = (∇aᵀ∇b + ∇bᵀ∇a)/2. Sheets have that of the middle
surface, with the tangential derivatives of all three displacements. It also holds on folded and
curved sheets; on a flat one it is von Kármán's. Membrane stretching, prestress and spin use it:
with the internal forces N of a state, the geometric stiffness is K_σ(a, b) = ∫ N : η(a, b).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse
import ufl

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.beam import Beam, Truss, axes_of_beams, halves
from antiosc.fem.elements.shell import Frame, Sheet, frames, section_fields, strains_of
from antiosc.fem.elements.solid import (
    VOIGT,
    AnisotropicSolid,
    Solid,
    depth_of,
    isotropic_stress,
    voigt_in,
    voigt_strain,
)
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
    (a1, a2), (b1, b2) = (tangential(frame, motion) for motion in (a, b))
    return ufl.as_vector([ufl.dot(a1, b1), ufl.dot(a2, b2), ufl.dot(a1, b2) + ufl.dot(a2, b1)])


def tangential(frame: Frame, motion: Expr) -> tuple[Expr, Expr]:
    """Derivatives (3,) of the displacement along e1 and along e2."""
    u = ufl.as_vector([motion[i] for i in range(3)])
    slopes = ufl.dot(ufl.grad(u), ufl.transpose(frame.along))
    first, second = (ufl.as_vector([slopes[i, j] for i in range(3)]) for j in (0, 1))
    return first, second


class SecondOrderStrain(NamedTuple):
    """ε(u), η(a, b) and forces N, linear in the strain, of a family with ε(u) + η(u, u)/2."""

    strain: Callable[[Expr], Expr]
    eta: Callable[[Expr, Expr], Expr]
    forces: Callable[[Expr], Expr]
    #: degree of the quadrature
    degree: int

    def energy(self, u: Expr, initial: Expr | None = None) -> Expr:
        """Energy density of u beyond ε:C:ε/2 of linear theory; `initial`: a stress-free strain.

        Its second derivative at u is K_σ plus the change of the elastic stiffness.
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
    """Second-order strain of the neutral surface; 2×2 points on curved quadrilaterals."""
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
    """Relative change [1/m] of the force on a sheet per metre; 0 of a flat one without prestress.

    The energy of q × shape is k q²/2 + g q³/2, with k its `stiffness` [N/m], g = ∫ N : η and N the
    membrane forces of the shape: the force is k q (1 + 3 g q/(2 k)), negative if it softens.
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


# -- The same at Gauss points, as arrays, for membrane stretching.
#
# Each of the n points has the derivatives L (d, b) of the b components of a motion along d
# directions (axes of a solid, tangents of a sheet, the line of a beam). The linear strain is
# T : L. The second-order strain is η(a, b) = V : (L_a L_bᵀ), from the displacements only.


#: Degrees of the rules: the quartic energy of cubic triangles and of straight quadratic simplices
#: exactly, full Gauss rules elsewhere.
DEGREES = {"triangle": 8, "tetrahedron": 4}
OTHERS = 5  # full Gauss rules
#: Pairs of directions of the components of η in a plane: 11, 22, 12 + 21.
IN_PLANE = ((0, 0), (1, 1), (0, 1))


@dataclass(eq=False)
class PartPoints:
    """The Gauss points of a part."""

    gradient: scipy.sparse.csr_matrix  # (n d, nodes) derivatives of functions on the nodes
    weight: Array  # (n,)
    strain: Array  # T (n, s, d, b), or (1, s, d, b) where all points have one
    square: Array  # V (s, d, d)
    stiffness: Array  # C (n, s, s)
    components: int  # number b of components of a node; the first `moved` of them are displacements
    moved: int
    held: IntArray  # dofs that are fixed
    #: derivatives (n, d, b) of the reference state; the linear strain is ε + η(base, ·)
    base: Array | None = None
    _turned: scipy.sparse.csr_matrix = field(init=False)

    def __post_init__(self) -> None:
        self._turned = self.gradient.T.tocsr()

    def about(self, state: Array) -> PartPoints:
        """The same points for motions about a static state (dofs,)."""
        return replace(self, base=self.slopes(state))

    def slopes(self, motion: Array) -> Array:
        """Derivatives (n, d, b) of a motion (dofs,) at the points."""
        derivatives = self.gradient @ motion.reshape(-1, self.components)
        return np.asarray(derivatives.reshape(self.weight.size, -1, self.components))

    def stress(self, slopes: Array) -> Array:
        """Weighted stresses C ε (n, s) of a motion with these derivatives (n, d, b)."""
        every = np.broadcast_to(self.strain, (self.weight.size, *self.strain.shape[1:]))
        strain = np.einsum("nsdb,ndb->ns", every, slopes, optimize=True)
        if self.base is not None:
            strain += self.second(self.base, slopes)
        return self.weighted_stress(strain)

    def weighted_stress(self, strain: Array) -> Array:
        """weight × C × strain at every point, for a strain (n, s)."""
        return np.einsum("nst,nt->ns", self.stiffness, strain) * self.weight[:, None]

    def second(self, a: Array, b: Array) -> Array:
        """η (n, s) of two motions with derivatives a and b (n, d, b)."""
        u = a[:, :, : self.moved]
        v = b[:, :, : self.moved]
        product = u @ v.transpose(0, 2, 1)
        return np.asarray(product.reshape(len(a), -1) @ self._both().T)

    def load(self, strained: Array, pushed: Array) -> Array:
        """Nodal forces (dofs,), also on fixed dofs, of the work Σ strained·ε(w) + pushed·∇w."""
        if len(self.strain) == 1:
            stress = (strained @ self.strain[0].reshape(strained.shape[1], -1)).reshape(
                pushed.shape
            )
        else:
            stress = np.einsum("nsdb,ns->ndb", self.strain, strained, optimize=True)
        stress += pushed
        if self.base is not None:
            stress += self.along(strained, self.base)
        return np.asarray((self._turned @ stress.reshape(-1, self.components)).reshape(-1))

    def along(self, stress: Array, slopes: Array) -> Array:
        """A (n, d, b) with stress·η(a, w) = A·∇w for every w; `slopes` are derivatives of a."""
        result = np.zeros_like(slopes)
        direction_count = slopes.shape[1]
        tension = (stress @ self._both()).reshape(-1, direction_count, direction_count)
        result[:, :, : self.moved] = tension @ slopes[:, :, : self.moved]
        return result

    def _both(self) -> Array:
        """The symmetrized V as a matrix (s, d d): η from the products of derivatives."""
        symmetric = (self.square + self.square.transpose(0, 2, 1)) / 2
        return np.asarray(symmetric.reshape(len(symmetric), -1))


def points_of(part: MeshedStructure) -> PartPoints:
    """The Gauss points of a part; InputError for a family without second-order strain."""
    if part.stiffeners:
        raise InputError("stretch does not take a sheet with stiffeners on its edges.")
    material = part.parts[0][0]  # all are of one family
    for family, points in _FAMILIES:
        if isinstance(material, family):
            return points(part)
    raise InputError(
        f"stretch takes Shell, Laminate, Solid, AnisotropicSolid and Beam; got"
        f" {type(material).__name__}."
    )


def _points(
    part: MeshedStructure,
    ways: Callable[[Expr], Expr],
    count: int,
    strain: Callable[[compat.GaussPoints], Array],
    square: Array,
    stiffness: Callable[[compat.GaussPoints], Array],
    displacement_count: int,
) -> PartPoints:
    """The Gauss points; `ways` is the UFL vector of `count` directional derivatives of a scalar."""
    mesh = part.mesh
    space = part.form.space
    gauss_points = compat.GaussPoints(mesh.dolfinx, DEGREES.get(mesh.cell, OTHERS))
    return PartPoints(
        gradient=gauss_points.derivatives(ways, count, space),
        weight=gauss_points.weight,
        strain=strain(gauss_points),
        square=square,
        stiffness=stiffness(gauss_points),
        components=int(space.dofmap.index_map_bs),
        moved=displacement_count,
        held=part.fixed,
    )


def _sheet_points(part: MeshedStructure) -> PartPoints:
    """Gauss points of sheets."""
    frame = frames(part.mesh, part.parts)
    section = section_fields(part.mesh, part.parts)
    square = np.zeros((3, 2, 2))
    for s, (d, e) in enumerate(IN_PLANE):
        square[s, d, e] = square[s, e, d] = 1.0

    def matrix(at: compat.GaussPoints, value: Expr) -> Array:
        rows = [value[i, j] for i in range(3) for j in range(3)]
        return at.values(ufl.as_vector(rows), 9).reshape(-1, 3, 3)

    def strain(at: compat.GaussPoints) -> Array:
        e = at.values(ufl.as_vector([x[i] for x in (frame.e1, frame.e2) for i in range(3)]), 6)
        e1 = e[:, :3]
        e2 = e[:, 3:]
        stretch, bending = np.zeros((2, at.weight.size, 3, 2, 6))
        stretch[:, 0, 0, :3] = e1
        stretch[:, 1, 1, :3] = e2
        stretch[:, 2, 0, :3] = e2
        stretch[:, 2, 1, :3] = e1
        bending[:, 0, 0, 3:] = e2
        bending[:, 1, 1, 3:] = -e1
        bending[:, 2, 0, 3:] = -e1
        bending[:, 2, 1, 3:] = e2
        if section.coupling is None:
            return stretch
        coupling = matrix(at, section.coupling)
        return stretch + np.einsum("nst,ntdb->nsdb", coupling, bending)

    def grad(u: Expr) -> Expr:
        return ufl.dot(frame.along, ufl.grad(u))

    return _points(part, grad, 2, strain, square, lambda at: matrix(at, section.A), 3)


def _solid_points(part: MeshedStructure) -> PartPoints:
    """Gauss points of solids."""
    d = part.mesh.gdim
    pairs = VOIGT if d == 3 else IN_PLANE
    size = len(pairs)
    square = np.zeros((size, d, d))
    strain = np.zeros((1, size, d, d))
    for s, (i, j) in enumerate(pairs):
        square[s, i, j] = square[s, j, i] = 1.0
        strain[0, s, i, j] = strain[0, s, j, i] = 1.0

    C = coefficient(part.mesh, part.parts, lambda solid: voigt_in(solid, d))

    def stiffness(at: compat.GaussPoints) -> Array:
        rows = [C[i, j] for i in range(size) for j in range(size)]
        return at.values(ufl.as_vector(rows), size**2).reshape(-1, size, size)

    return _points(part, ufl.grad, d, lambda at: strain, square, stiffness, d)


def _beam_points(part: MeshedStructure) -> PartPoints:
    """Gauss points of beams without offset."""
    if any(beam.offset for beam, _ in part.parts):
        raise InputError("stretch does not take beams with an offset.")
    t = tangent(part.mesh)
    displacement_count = part.mesh.gdim
    components = int(part.form.space.dofmap.index_map_bs)

    def strain(at: compat.GaussPoints) -> Array:
        axial = np.zeros((at.weight.size, 1, 1, components))
        axial[:, 0, 0, :displacement_count] = at.values(t, displacement_count)
        return axial

    def stiffness(at: compat.GaussPoints) -> Array:
        EA = coefficient(part.mesh, part.parts, lambda beam: beam.E * beam.section.A)
        return at.values(ufl.as_vector([EA]), 1)[:, :, None]

    def grad(u: Expr) -> Expr:
        return ufl.as_vector([ufl.dot(ufl.grad(u), t)])

    return _points(part, grad, 1, strain, np.ones((1, 1, 1)), stiffness, displacement_count)


_FAMILIES = (
    (Sheet, _sheet_points),
    ((Solid, AnisotropicSolid), _solid_points),
    (Beam, _beam_points),
)
