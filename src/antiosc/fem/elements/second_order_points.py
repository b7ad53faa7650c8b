"""Second-order strain η at Gauss points, as arrays, for membrane stretching.

Each of the n points has the derivatives L (d, b) of the b components of a motion along d directions
(the axes of a solid, the tangents of a sheet, the line of a beam). The linear strain is T : L. The
second-order strain is η(a, b) = V : (L_a L_bᵀ), from the displacements only. Stresses are C ε.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse
import ufl

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.beam import Beam, tangent
from antiosc.fem.elements.shell import Sheet, frames, section_fields
from antiosc.fem.elements.solid import VOIGT, AnisotropicSolid, Solid
from antiosc.fem.elements.weak_form import coefficient
from antiosc.fem.platform import compat

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from antiosc.fem.structure.meshed import MeshedStructure

#: Degrees of the rules: the quartic energy of cubic triangles and of straight quadratic simplices
#: exactly, full Gauss rules elsewhere.
DEGREES = {"triangle": 8, "tetrahedron": 4}
OTHERS = 5  # full Gauss rules
#: Pairs of directions of the components of η in a plane: 11, 22, 12 + 21.
IN_PLANE = ((0, 0), (1, 1), (0, 1))


@dataclass(eq=False)
class PartPoints:
    """The Gauss points of a part.

    Attributes
    ----------
    gradient : (n d, nodes) derivatives of functions on the nodes.
    weight : (n,).
    strain : T (n, s, d, b), or (1, s, d, b) where all points have one.
    square : V (s, d, d).
    stiffness : C (n, s, s).
    components : number b of components of a node; the first `moved` of them are displacements.
    held : dofs that are fixed.
    base : derivatives (n, d, b) of the reference state; the linear strain is ε + η(base, ·).
    """

    gradient: scipy.sparse.csr_matrix
    weight: Array
    strain: Array
    square: Array
    stiffness: Array
    components: int
    moved: int
    held: IntArray
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
        strain = np.einsum("nsdb,ndb->ns", self._every(), slopes, optimize=True)
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
        """Nodal forces (dofs,) whose work on any motion w is Σ strained·ε(w) + pushed·∇w.

        `strained` (n, s) are weighted stresses, `pushed` (n, d, b). Forces on fixed dofs are
        included.
        """
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
        """Array A (n, d, b) with stress·η(a, w) = A·∇w for every w; `slopes` are the derivatives of
        a.
        """
        result = np.zeros_like(slopes)
        direction_count = slopes.shape[1]
        tension = (stress @ self._both()).reshape(-1, direction_count, direction_count)
        result[:, :, : self.moved] = tension @ slopes[:, :, : self.moved]
        return result

    def _both(self) -> Array:
        """The symmetrized V as a matrix (s, d d): η of two motions from the products of their
        derivatives.
        """
        symmetric = (self.square + self.square.transpose(0, 2, 1)) / 2
        return np.asarray(symmetric.reshape(len(symmetric), -1))

    def _every(self) -> Array:
        """The strain operators T (n, s, d, b) of all points, broadcast if they share one."""
        return np.broadcast_to(self.strain, (self.weight.size, *self.strain.shape[1:]))


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

    def voigt(solid: Any) -> Array:
        return np.asarray(solid.voigt if d == 3 else _in_plane(solid))

    C = coefficient(part.mesh, part.parts, voigt)

    def stiffness(at: compat.GaussPoints) -> Array:
        rows = [C[i, j] for i in range(size) for j in range(size)]
        return at.values(ufl.as_vector(rows), size**2).reshape(-1, size, size)

    return _points(part, ufl.grad, d, lambda at: strain, square, stiffness, d)


def _in_plane(solid: Solid) -> Array:
    """Matrix C (3, 3): forces per width (σ11, σ22, σ12) t = C (ε11, ε22, γ12)."""
    nu = solid.nu
    if solid.plane == "strain":
        scale = solid.E / ((1 + nu) * (1 - 2 * nu))
        C = scale * np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, (1 - 2 * nu) / 2]])
    else:
        C = solid.E / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    return solid.thickness * C


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
