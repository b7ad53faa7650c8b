"""Second-order strain η(a, b) of solids and of sheets: strains are ε(u) + η(u, u)/2.

Solids have the Green–Lagrange strain, η(a, b) = (∇aᵀ∇b + ∇bᵀ∇a)/2. Sheets have the Green–Lagrange
strain of the middle surface, with tangential derivatives of all three displacements. It also holds
on folded and curved sheets; on a flat sheet it is von Kármán's. Membrane stretching, prestress and
spin use it: with internal forces N, the geometric stiffness is K_σ(a, b) = ∫ N : η(a, b).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.sparse
import ufl
from numpy.typing import ArrayLike

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.beam import Beam, Truss, axes_of_beams
from antiosc.fem.elements.shell import (
    Frame,
    Sheet,
    frames,
    section_fields,
    strains_of,
    tangential_slopes,
)
from antiosc.fem.elements.solid import (
    VOIGT_PAIRS,
    AnisotropicSolid,
    Solid,
    isotropic_stress,
    thickness_of,
    voigt_stiffness,
    voigt_strain,
)
from antiosc.fem.elements.weak_form import Material, Parts, coefficient, split_motion, tangent
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
    (a1, a2), (b1, b2) = (tangential_slopes(frame, split_motion(motion)[0]) for motion in (a, b))
    return ufl.as_vector([ufl.dot(a1, b1), ufl.dot(a2, b2), ufl.dot(a1, b2) + ufl.dot(a2, b1)])


class SecondOrderStrain(NamedTuple):
    """UFL functions ε, η and internal forces N(strain) of a family with strain ε(u) + η(u, u)/2.
    Strains are tensors of isotropic solids, vectors of other solids and sheets, scalars of
    lines."""

    strain: Callable[[Expr], Expr]
    eta: Callable[[Expr, Expr], Expr]
    forces: Callable[[Expr], Expr]
    #: degree of the quadrature
    degree: int

    def energy(self, u: Expr, initial: Expr | None = None) -> Expr:
        """Energy density of u in addition to the linear ε:C:ε/2; `initial`: stress-free strain. The
        energy's second derivative at u is K_σ plus the change of the elastic stiffness."""
        strain = self.strain(u)
        eta = self.eta(u, u)
        energy = ufl.inner(self.forces(strain), eta) / 2 + ufl.inner(self.forces(eta), eta) / 8
        if initial is not None:
            energy -= ufl.inner(self.forces(initial), strain + eta / 2)
        return energy

    def geometric_stiffness(self, u: Expr, initial: Expr | None, v: Expr, w: Expr) -> Expr:
        """Density N : η(v, w) of the geometric stiffness at u; `initial`: stress-free strain."""
        strain = self.strain(u) + self.eta(u, u) / 2
        if initial is not None:
            strain = strain - initial
        return ufl.inner(self.forces(strain), self.eta(v, w))


def second_order_strain(mesh: Mesh, parts: Parts, order: int) -> SecondOrderStrain:
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
        return SecondOrderStrain(
            lambda u: voigt_strain(ufl.sym(ufl.grad(u))),
            lambda a, b: voigt_strain(solid_eta(a, b)),
            lambda e: C * e,
            degree,
        )

    stress = isotropic_stress(mesh, parts)
    depth = thickness_of(mesh, parts)
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
        return split_motion(ufl.dot(ufl.grad(q), tangent(mesh)))

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
FLATNESS = 1e-3
#: Degree of the quadrature for the share of second-order forces.
SHARE_DEGREE = 6


def relative_stiffening(part: MeshedStructure, shape: Array, stiffness: float) -> float:
    """Relative change [1/m] of a sheet's secant stiffness per metre of deflection, < 0 if it
    softens. With k = `stiffness` and g = ∫ N : η, q × `shape` has the energy k q²/2 + g q³/2 and
    the force k q (1 + 3 g q/(2 k)).

    `shape` (dofs that this rank owns,); `stiffness`: that of `shape` [N/m].
    """
    if is_flat(part) and part.preload is None:
        return 0.0
    points = _points_by_rule(part, SHARE_DEGREE)
    if part.preload is not None:
        points = points.about(_with_ghosts(part, part.preload.q))
    slopes = points.slopes(_with_ghosts(part, shape))
    of_rank = np.sum(points.stress(slopes) * points.second(slopes, slopes))
    return 1.5 * float(part.comm.allreduce(of_rank)) / stiffness


def _with_ghosts(part: MeshedStructure, motion: Array) -> Array:
    """The motion (dofs that this rank owns,) followed by the values of the ghosts."""
    return compat.with_ghosts(part.form.space, motion[:, None])[:, 0]


def is_flat(part: MeshedStructure) -> bool:
    """Whether all nodes of a part made of sheets lie in one plane."""
    if part.mesh.gdim == 2:
        return True
    x = np.vstack(part.comm.allgather(part.mesh.dolfinx.geometry.x))
    x = x - x.mean(axis=0)
    normal = np.linalg.svd(x, full_matrices=False)[2][2]  # of the plane fitted to them
    thickness = min(material.section.thickness for material, _ in part.parts)
    return bool(np.abs(x @ normal).max(initial=0.0) <= FLATNESS * thickness)


# -- The same at Gauss points, as arrays, for membrane stretching.
#
# Each of the n points has the derivatives L (d, b) of the b components of a motion along d
# directions (axes of a solid, tangents of a sheet, the line of a beam). The linear strain is
# T : L. The second-order strain is η(a, b) = V : (L_a L_bᵀ), from the displacements only.


#: Degrees that integrate the quartic energy exactly; full Gauss rules elsewhere.
RULE_DEGREES = {"triangle": 8, "tetrahedron": 4}
GAUSS_DEGREE = 5  # full Gauss rules
#: Pairs of directions of the components of η in a plane: 11, 22, 12 + 21.
PLANE_PAIRS = ((0, 0), (1, 1), (0, 1))


@dataclass(eq=False)
class PartPoints:
    """Strain operators at the n Gauss points of the cells that this rank owns; its dofs and nodes
    include ghosts. Of d, b and s see above: directions, components of a node, strains."""

    gradient: scipy.sparse.csr_matrix  # (n d, nodes) derivatives of functions on the nodes
    weight: Array  # (n,) quadrature weight times size of the cell [m, m² or m³]
    strain: Array  # T (n, s, d, b), or (1, s, d, b) where all points have one
    square: Array  # V (s, d d), symmetric: η from the products of derivatives
    stiffness: Array  # C (n, s, s): internal force per strain
    components: int  # number b of components of a node; the first `moved` of them are displacements
    moved: int
    held: IntArray  # local numbers of the fixed dofs
    #: derivatives (n, d, b) of the reference state; the linear strain is ε + η(base, ·)
    base: Array | None = None
    _turned: scipy.sparse.csr_matrix = field(init=False)  # transpose of `gradient`

    def __post_init__(self) -> None:
        self._turned = self.gradient.T.tocsr()

    def about(self, state: Array) -> PartPoints:
        """These points for motions about the static state (dofs,)."""
        return replace(self, base=self.slopes(state))

    def slopes(self, motion: Array) -> Array:
        """Derivatives (points, directions, components) of a motion (dofs,)."""
        derivatives = self.gradient @ motion.reshape(-1, self.components)
        return np.asarray(derivatives.reshape(self.weight.size, -1, self.components))

    def stress(self, slopes: Array) -> Array:
        """weight × stress C ε (points, s) of a motion with derivatives `slopes` (points, d, b)."""
        every = np.broadcast_to(self.strain, (self.weight.size, *self.strain.shape[1:]))
        strain = np.einsum("nsdb,ndb->ns", every, slopes, optimize=True)
        if self.base is not None:
            strain += self.second(self.base, slopes)
        return self.weighted_stress(strain)

    def weighted_stress(self, strain: Array) -> Array:
        """weight × C × strain at every point, for a strain (n, s)."""
        return np.einsum("nst,nt->ns", self.stiffness, strain) * self.weight[:, None]

    def second(self, a: Array, b: Array) -> Array:
        """Second-order strain η (points, s) of motions with derivatives a, b."""
        u = a[:, :, : self.moved]
        v = b[:, :, : self.moved]
        product = u @ v.transpose(0, 2, 1)
        return np.asarray(product.reshape(len(a), -1) @ self.square.T)

    def load(self, strained: Array, pushed: Array) -> Array:
        """Nodal forces (dofs,), also at fixed ones, of stresses `strained` (points, s) and `pushed`
        (points, d, b): virtual work Σ strained·ε(w) + pushed·∇w."""
        if len(self.strain) == 1:
            strain = self.strain[0].reshape(strained.shape[1], -1)
            stress = (strained @ strain).reshape(pushed.shape)
        else:
            stress = np.einsum("nsdb,ns->ndb", self.strain, strained, optimize=True)
        stress += pushed
        if self.base is not None:
            stress += self.along(strained, self.base)
        return np.asarray((self._turned @ stress.reshape(-1, self.components)).reshape(-1))

    def along(self, stress: Array, slopes: Array) -> Array:
        """The array A (n, d, b) with stress·η(a, w) = A·∇w for every w; `slopes` = ∇a."""
        result = np.zeros_like(slopes)
        direction_count = slopes.shape[1]
        tension = (stress @ self.square).reshape(-1, direction_count, direction_count)
        result[:, :, : self.moved] = tension @ slopes[:, :, : self.moved]
        return result


class _FamilyAtPoints(NamedTuple):
    """Strain operators of an element family at n points."""

    along: Array  # (n, d, 3) directions of the derivatives
    strain: Array  # T, as of `PartPoints`
    pairs: Sequence[tuple[int, int]]  # the two directions of each of the s components of η
    stiffness: Callable[[Material], ArrayLike]  # C (s, s) of a material


def points_of(part: MeshedStructure) -> PartPoints:
    """The Gauss points of a part; InputError for a sheet with stiffeners, beams with an offset, and
    families that stretching does not take (`Truss`)."""
    if part.stiffeners:
        raise InputError("stretch does not take a sheet with stiffeners on its edges.")
    return _points_by_rule(part, RULE_DEGREES.get(part.mesh.cell, GAUSS_DEGREE))


def _points_by_rule(part: MeshedStructure, degree: int) -> PartPoints:
    """The points of the quadrature of this degree in the cells that this rank owns."""
    mesh, space = part.mesh, part.form.space
    X, weights = compat.quadrature(mesh.cell, degree)
    count = compat.cell_index_map(mesh.dolfinx).size_local
    cells = np.repeat(np.arange(count), len(weights))
    _, J = mesh.geometry.at(cells, np.tile(X, (count, 1)))
    area = np.sqrt(np.linalg.det(J.swapaxes(1, 2) @ J))

    material = part.parts[0][0]  # all are of one family
    number = part.part_of_cells()[cells]
    for family, local_of in _FAMILY_OPERATORS:
        if isinstance(material, family):
            local: _FamilyAtPoints = local_of(part, cells, J)
            break
    else:
        raise InputError("stretch is of Shell, Laminate, Solid, AnisotropicSolid, Beam alone.")

    # derivatives (n, d, functions) of the functions of the nodes along the directions
    slopes = np.tile(compat.tabulate_derivatives(space, (0,), X), (count, 1, 1))
    derivatives = local.along @ np.swapaxes(slopes @ np.linalg.pinv(J), 1, 2)
    n, d, functions = derivatives.shape
    nodes = compat.cell_dofs(space, (0,), cells) // part.block
    rows = functions * np.arange(n * d + 1)
    gradient = scipy.sparse.csr_matrix(
        (derivatives.ravel(), np.repeat(nodes, d, axis=0).ravel(), rows),
        shape=(n * d, len(space.tabulate_dof_coordinates())),
    )

    square = np.zeros((len(local.pairs), d, d))
    for s, (i, j) in enumerate(local.pairs):
        square[s, i, j] = square[s, j, i] = 1.0

    return PartPoints(
        gradient=gradient,
        weight=area * np.tile(weights, count),
        strain=local.strain,
        square=square.reshape(len(square), -1),
        stiffness=np.array([local.stiffness(entry) for entry, _ in part.parts])[number],
        components=part.block,
        moved=3 if part.kind.sheet else mesh.gdim,
        held=part.fixed,
    )


def _sheet_operators(part: MeshedStructure, cells: IntArray, J: Array) -> _FamilyAtPoints:
    """Operators of sheets, with derivatives along the frame of `frames`. `cells` (n,): cell of each
    point; `J` (n, 3, 2): Jacobians at the points."""
    axis, side = part.axes_and_sides
    n = np.cross(J[:, :, 0], J[:, :, 1])
    n *= (side[cells] / np.linalg.norm(n, axis=1))[:, None]
    e1 = axis[cells] - np.einsum("nc,nc->n", axis[cells], n)[:, None] * n
    e1 /= np.linalg.norm(e1, axis=1)[:, None]
    e2 = np.cross(n, e1)

    stretch, bending = np.zeros((2, len(cells), 3, 2, 6))
    stretch[:, 0, 0, :3] = e1
    stretch[:, 1, 1, :3] = e2
    stretch[:, 2, 0, :3] = e2
    stretch[:, 2, 1, :3] = e1
    bending[:, 0, 0, 3:] = e2
    bending[:, 1, 1, 3:] = -e1
    bending[:, 2, 0, 3:] = -e1
    bending[:, 2, 1, 3:] = e2

    sections = [material.section for material, _ in part.parts]
    coupling = np.array([np.linalg.solve(section.A, section.B) for section in sections])
    of_points = coupling[part.part_of_cells()[cells]]
    strain = stretch + np.einsum("nst,ntdb->nsdb", of_points, bending)
    return _FamilyAtPoints(
        np.stack([e1, e2], axis=1), strain, PLANE_PAIRS, lambda sheet: sheet.section.A
    )


def _solid_operators(part: MeshedStructure, cells: IntArray, J: Array) -> _FamilyAtPoints:
    """Operators of solids, with derivatives along x, y, z; `cells` (n,): cell of each point."""
    d = part.mesh.gdim
    pairs = VOIGT_PAIRS if d == 3 else PLANE_PAIRS
    strain = np.zeros((1, len(pairs), d, d))
    for s, (i, j) in enumerate(pairs):
        strain[0, s, i, j] = strain[0, s, j, i] = 1.0
    along = np.broadcast_to(np.eye(3)[:d], (len(cells), d, 3))
    return _FamilyAtPoints(along, strain, pairs, lambda solid: voigt_stiffness(solid, d))


def _beam_operators(part: MeshedStructure, cells: IntArray, J: Array) -> _FamilyAtPoints:
    """Operators of beams, with derivatives along the axis; InputError for beams with an offset.
    `cells` (n,): cell of each point; `J` (n, 3, 1): Jacobians at the points."""
    if any(beam.offset for beam, _ in part.parts):
        raise InputError("stretch does not take beams with an offset.")
    t = J[:, :, 0] / np.linalg.norm(J[:, :, 0], axis=1)[:, None]
    axial = np.zeros((len(cells), 1, 1, part.block))
    axial[:, 0, 0, : part.mesh.gdim] = t[:, : part.mesh.gdim]
    return _FamilyAtPoints(t[:, None], axial, ((0, 0),), lambda beam: [[beam.E * beam.section.A]])


_FAMILY_OPERATORS: tuple[tuple[Any, Callable[..., _FamilyAtPoints]], ...] = (
    (Sheet, _sheet_operators),
    ((Solid, AnisotropicSolid), _solid_operators),
    (Beam, _beam_operators),
)
