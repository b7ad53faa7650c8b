"""Interface of element families to `Structure`, functions they share, and axes of layers.

A material is a frozen dataclass of its constants that implements the protocol `Family`. Its method
`weak_form(mesh, parts, order)` gets `parts`, a list of (material, cells), where `cells` are the
cells of this rank that the material fills. All materials of one structure are of one `Kind`.

Layers are stacked toward a given `top`. The default is +z on a plane mesh, where the node order is
arbitrary, and otherwise the normal of the cell, which follows from the order of its nodes. If a
stack is not symmetric, neighbouring cells must have their normals on the same side; the energy
would not reveal an error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from importlib import import_module
from math import sqrt
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from antiosc.base._types import Array, BoolArray, Box, IntArray
from antiosc.base.checks import (
    Checked,
    checked_by,
    flag,
    floats,
    instance,
    nonnegative,
    point_text,
    poisson,
    positive,
    positives,
    shown,
)
from antiosc.base.errors import InputError, finite_element_packages
from antiosc.fem.platform import done_on_all, on_root

if TYPE_CHECKING:
    from dolfinx import fem
    from ufl.core.expr import Expr

    from antiosc.fem.mesh import Mesh

#: A vector, or a function of points x (3, n) that returns a vector at each point (3, n)
Direction = Sequence[float] | Callable[[Array], Array]

#: Sine of the least angle between `axis` and the normal, and between `top` and the sheet.
LEAST_SINE = 0.05
#: dolfinx's numbers of the corners of a cell, in order around it.
CORNERS_AROUND = {"triangle": [0, 1, 2], "quadrilateral": [0, 1, 3, 2]}


class _LazyModule:
    """A module that is imported at its first use; MissingDependencyError if it is missing."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        with finite_element_packages():
            return getattr(import_module(self._name), name)


if TYPE_CHECKING:
    import ufl as ufl

    from antiosc.fem.platform import compat as compat
else:
    ufl = _LazyModule("ufl")
    compat = _LazyModule("antiosc.fem.platform.compat")


def checked_direction(name: str, direction: object) -> Direction:
    """`direction` if it is a non-zero vector or a function; otherwise InputError."""
    if callable(direction):
        return direction  # type: ignore[no-any-return]
    vector = floats(name, direction, (3,))
    positive(f"the length of {name}", np.linalg.norm(vector))
    return tuple(vector.tolist())


DIRECTION_CHECK = checked_by(checked_direction)


def axes_and_sides(mesh: Mesh, parts: Parts) -> tuple[fem.Function, fem.Function]:
    """(0° direction, not projected onto the sheet; 1 if the normal points to the top, else -1).

    Both are constant in each cell. Without an axis the direction is the cell's first edge (not of
    unit length), and without a top in space the value is 1. InputError for an axis along a normal,
    a top along the sheet, or opposite normals of neighbours where the layers need one side.
    """
    x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    normals = _normals(mesh, x)
    axes = compat.cellwise_function(mesh.dolfinx, 3)
    sides = compat.cellwise_function(mesh.dolfinx)
    axis = axes.x.array.reshape(-1, 3)
    side = sides.x.array
    axis[:] = x[:, 1] - x[:, 0]
    side[:] = 1.0
    has_sides = np.zeros(len(x), dtype=bool)

    def work() -> None:
        for material, cells in parts:
            n = normals[cells]
            if material.axis is not None:
                axis[cells] = d = _directions_at("axis", material.axis, x[cells])
                sine = np.linalg.norm(np.cross(d[:, None], n), axis=2)
                _refuse_parallel(sine, x[cells], "the axis is normal to the sheet")
            top = (0.0, 0.0, 1.0) if material.top is None and mesh.gdim == 2 else material.top
            if top is not None:
                cosine = np.einsum("ci,cqi->cq", _directions_at("top", top, x[cells]), n)
                side[cells] = np.sign(cosine[:, 0])
                _refuse_parallel(cosine * side[cells, None], x[cells], "top lies along the sheet")
            has_sides[cells] = material.section.has_sides and material.top is None

    done_on_all(mesh.comm, work)
    if any(material.section.has_sides for material, _ in parts):
        _check_neighbours(mesh, x, side, has_sides)
    return axes, sides


def _normals(mesh: Mesh, x: Array) -> Array:
    """Unit normals (cells, nodes, 3) at the nodes of the cells, at `x` (cells, nodes, 3)."""
    slopes = compat.lattice_gradients(mesh.cell, mesh.order, mesh.order)
    J = np.einsum("dqn,cni->dcqi", slopes, x, optimize=True)
    normals = np.cross(J[0], J[1])
    return np.asarray(normals / np.linalg.norm(normals, axis=2, keepdims=True))


def _directions_at(name: str, direction: Direction, x: Array) -> Array:
    """Unit vectors (cells, 3) of the direction at the middle of every cell. `x` (cells, nodes, 3):
    nodes of the cells; `name`: of the direction, for messages."""
    at_cells = direction(x.mean(axis=1).T) if callable(direction) else np.reshape(direction, (3, 1))
    vectors = floats(f"{name}, as a function of x (3, n),", at_cells, (3, None)).T
    vectors = np.broadcast_to(vectors, (len(x), 3))
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    _refuse_parallel(np.sign(lengths), x, f"{name} has no length")
    return np.asarray(vectors / lengths)


def _refuse_parallel(sine: Array, x: Array, what: str) -> None:
    """InputError if `sine` (cells, points) is below LEAST_SINE at a point of a cell; `x` (cells,
    nodes, 3): nodes of the cells; `what`: the fault, for the message."""
    bad = sine.min(axis=1) < LEAST_SINE
    if bad.any():
        raise InputError(
            f"{what} in {int(bad.sum())} cells, one at {point_text(x[np.argmax(bad)].mean(axis=0))}"
            ": choose another direction, a function of x, or a separate laminate for these cells."
        )


def shown_direction(direction: Direction) -> str:
    """A vector as text for a message; "" for a function."""
    return "" if callable(direction) else f" ({', '.join(f'{c:g}' for c in direction)})"


def _check_neighbours(mesh: Mesh, x: Array, side: Array, has_sides: BoolArray) -> None:
    """InputError if neighbouring cells, both marked in `has_sides`, have opposite tops. For the
    cells of this rank with ghosts: `x` (cells, nodes, 3) their nodes, `side` (cells,) ±1 as from
    `axes_and_sides`, `has_sides` (cells,) whether the layers are unsymmetric and have no top."""
    owned = compat.cell_index_map(mesh.dolfinx).size_local
    in_turn = CORNERS_AROUND[mesh.cell]
    number = np.asarray(mesh.dolfinx.geometry.input_global_indices)
    corners = number[compat.geometry_nodes(mesh.dolfinx)[:owned][:, in_turn]]
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)

    # cells that agree go along their edge in opposite directions
    sign = np.where(ends[..., 0] < ends[..., 1], 1, -1) * side[:owned, None]
    compared = np.broadcast_to(has_sides[:owned, None], sign.shape)
    table = np.sort(ends.reshape(-1, 2), axis=1), sign.ravel(), compared.ravel(), x[:owned, in_turn]
    tables = mesh.comm.gather(table, root=0) or []

    def work() -> None:
        edges, sign, compared, points = map(np.concatenate, zip(*tables, strict=True))
        _, edge, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
        edge = edge.ravel()

        bad = (count == 2) & (np.bincount(edge, compared) == 2) & (np.bincount(edge, sign) != 0)
        if bad.any():
            place = point_text(points.reshape(-1, 3)[np.argmax(bad[edge])])
            raise InputError(
                f"neighbouring cells have opposite normals at {int(bad.sum())} edges, one at "
                f"{place}, so that the top of the sheet would change sides: reverse the nodes of "
                "these cells, or give Laminate or Shell a top, a direction on its side."
            )

    on_root(mesh.comm, work)


@dataclass(frozen=True)
class WeakForm:
    """The function space of an element family on a mesh and its bilinear forms."""

    #: the dolfinx function space
    space: fem.FunctionSpace
    #: bilinear forms whose sum is K; one quadrature degree each
    stiffness: Sequence[ufl.Form]
    #: bilinear forms whose sum is M
    mass: Sequence[ufl.Form]
    #: component ("x", …, "rz") -> path of the scalar subspace in `space`, in UFL's flat order
    components: Mapping[str, tuple[int, ...]]
    #: mass per unit of cell measure, a UFL expression (total mass = its integral)
    density: Expr
    #: first moment (3,) of the mass about the mesh per cell measure, a vector along the normal of
    #: the sheet or the height of the beam (UFL); None: the centre of mass is on the mesh
    mass_moment: Expr | None = None
    #: whether twist moves the centroids of beams, which lie off the line of the mesh
    twist_moves_centroid: bool = False
    #: (strains × √stiffness (UFL) whose squares give K, quadrature degree); None: not used
    strains: tuple[Expr, int] | None = None

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        (path, *_) = self.components.values()
        return int(compat.subspace(self.space, path).element.basix_element.degree)

    def along(self, direction: Sequence[float] | Expr) -> Expr:
        """The test function's displacement along `direction` (UFL)."""
        return self._contracted("xyz", direction)

    def momentum(self, direction: Sequence[float] | Expr) -> Expr:
        """Momentum density along `direction` (UFL), with the test function as the velocity."""
        linear = self.density * self.along(direction)
        if self.mass_moment is None:
            return linear
        # (θ × m)·d
        return linear + self._contracted(("rx", "ry", "rz"), ufl.cross(self.mass_moment, direction))

    def _contracted(self, names: Sequence[str], vector: Sequence[float] | Expr) -> Expr:
        """Σ vector[i] × the test function's component names[i] (UFL)."""
        v = ufl.TestFunction(self.space)
        flat = list(self.components)
        return sum(vector[i] * v[flat.index(n)] for i, n in enumerate(names) if n in flat)


@dataclass(frozen=True)
class Kind:
    """Properties that all materials of one element family share."""

    #: "solid", "sheet", "beam" or "truss"
    name: str
    #: True: an impactor touches the exterior facets of the mesh; False: it touches the cells
    outside: bool
    #: whether the compliance under a point load is finite, so that a site needs no patch
    point_load: bool
    #: whether beams along the edges of the cells may stiffen them
    sheet: bool = False


@runtime_checkable
class Family(Protocol):
    """Protocol of a material that a structure accepts."""

    @property
    def kind(self) -> Kind:
        """The properties of the family, the same for all materials of a structure."""
        ...

    @property
    def patch_radius(self) -> float | None:
        """Default radius [m] of a site's patch; None: the site is a point."""
        ...

    def weak_form(self, mesh: Mesh, parts: Parts, order: int) -> WeakForm:
        """The space and forms of `parts` on `mesh` with displacements of degree `order`."""
        ...

    def half_space_compliance(self, cosine: float) -> float:
        """Compliance times radius [m²/N] of a patch on a half-space; 0 if the family has none.

        `cosine` is that of the angle between load and surface normal.
        """
        ...

    def dimensions(self, box: Box, materials: Sequence[Material]) -> Box:
        """(length, width, thickness) [m] of a part with these materials and the bounding `box`.

        The part bends across its thickness.
        """
        ...

    def bar_speed(self) -> float:
        """Speed √(E/ρ) of waves in a bar, m/s."""
        ...

    def constants(self) -> tuple[float, float, float]:
        """(E [Pa], nu, rho [kg/m³]); InputError for an anisotropic material."""
        ...


#: A `Family`, whose own constants are read by those who know its kind.
Material: TypeAlias = Any
#: (material, local numbers of the cells that it fills, ghosts included), …
Parts = Sequence[tuple[Material, IntArray]]


def _checked_prony(name: str, value: object) -> tuple[tuple[float, float], ...]:
    """Checked pairs (stiffness ratio, relaxation time [s])."""
    pairs = floats(name, list(value) if isinstance(value, list | tuple) else value, None)
    if not pairs.size:
        return ()
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not (pairs > 0).all():
        raise InputError(f"prony lists pairs (stiffness ratio, time), all > 0; got {shown(value)}.")

    return tuple((ratio, tau) for ratio, tau in pairs.tolist())


def _checked_range(name: str, value: object) -> tuple[float, float]:
    """Two ascending stresses > 0 [Pa]."""
    low, high = floats(name, value, (2,)).tolist()
    if positive(f"the lower end of {name}", low, "Pa") > high:
        raise InputError(f"{name} must ascend; got {low:g} to {high:g}.")
    return low, high


def _checked_rate(name: str, value: object) -> tuple[float, ...]:
    """Checked constants of Cowper and Symonds: D [1/s], q and, optionally, a strength [Pa]."""
    numbers = tuple(positives(name, value).tolist())
    if len(numbers) not in (2, 3):
        raise InputError(
            f"{name} must be D in 1/s and q, and the strength in Pa if it is not the yield "
            f"strength that grows so; got {len(numbers)} numbers."
        )

    return numbers


_RANGE_CHECK = checked_by(_checked_range)
_TEXT_CHECK = checked_by(instance, str, "a text")


@dataclass(frozen=True)
class Isotropic(Checked):
    """The constants of an isotropic material, as `Family` requires them.

    Attributes
    ----------
    E, nu, rho : Young's modulus (Pa), Poisson's ratio, density (kg/m³).
    yield_strength : Pa; margins of safety (`peak_field`) and contact laws need it.
    yield_range : (Pa, Pa), scatter of the yield strength between batches.
    rate : (D in 1/s, q) of Cowper and Symonds: the strength grows with the strain rate; a third
        number (Pa) is the strength to which they apply, if not `yield_strength`.
    brittle : whether the material cracks or crushes before it yields.
    tensile : (Pa, Pa), range of the tensile strength, as in bending tests; for margins.
    loss : loss factor, for damping ratios by modal strain energy.
    prony : pairs (share of E, time in s) of its relaxation, E(t) = E (1 + Σ share exp(-t/time)).
    name, source : name of the material and source of its numbers, if given by name.
    """

    E: float = field(metadata=checked_by(positive, "Pa"))
    nu: float = field(metadata=checked_by(lambda _, nu: poisson(nu)))
    rho: float = field(metadata=checked_by(positive, "kg/m³"))
    _: KW_ONLY
    yield_strength: float | None = field(default=None, metadata=checked_by(positive, "Pa"))
    loss: float = field(default=0.0, metadata=checked_by(nonnegative))
    prony: Sequence[tuple[float, float]] = field(default=(), metadata=checked_by(_checked_prony))
    yield_range: tuple[float, float] | None = field(default=None, metadata=_RANGE_CHECK)
    rate: tuple[float, ...] | None = field(default=None, metadata=checked_by(_checked_rate))
    brittle: bool = field(default=False, metadata=checked_by(flag))
    tensile: tuple[float, float] | None = field(default=None, metadata=_RANGE_CHECK)
    name: str = field(default="", metadata=_TEXT_CHECK)
    source: str = field(default="", repr=False, metadata=_TEXT_CHECK)

    @property
    def G(self) -> float:
        """Shear modulus, Pa."""
        return self.E / (2 * (1 + self.nu))

    def half_space_compliance(self, cosine: float) -> float:
        """0: in this family, only the contact law describes the local indentation."""
        return 0.0

    def bar_speed(self) -> float:
        """Speed √(E/ρ) of waves in a bar, m/s."""
        return sqrt(self.E / self.rho)

    def constants(self) -> tuple[float, float, float]:
        """(E [Pa], nu, rho [kg/m³])."""
        return self.E, self.nu, self.rho


def coefficient(mesh: Mesh, parts: Parts, value: Callable[[Material], float | Array]) -> Expr:
    """`value(material)`, a number or a matrix, in each cell (UFL)."""
    if len(parts) == 1:  # kernels read it once, not of every cell
        return compat.constant(mesh.dolfinx, value(parts[0][0]))
    shape = np.shape(value(parts[0][0]))
    size = int(np.prod(shape, dtype=int))
    function = compat.cellwise_function(mesh.dolfinx, size if shape else 0)
    values = function.x.array.reshape(-1, size)
    for material, cells in parts:
        values[cells] = np.ravel(value(material))

    if not shape:
        return function
    rows, columns = shape
    return ufl.as_matrix([[function[columns * i + j] for j in range(columns)] for i in range(rows)])


def restricted_forms(forms: Sequence[ufl.Form], mesh: Mesh, cells: IntArray) -> list[ufl.Form]:
    """The forms restricted to `cells`, local numbers; ghosts among them are left out."""
    from dolfinx.mesh import meshtags

    own = np.unique(cells[cells < compat.cell_index_map(mesh.dolfinx).size_local]).astype(np.int32)
    tags = meshtags(mesh.dolfinx, mesh.tdim, own, np.ones_like(own))

    def integrals(form: ufl.Form) -> list[ufl.Integral]:
        return [one.reconstruct(subdomain_id=1, subdomain_data=tags) for one in form.integrals()]

    return [ufl.Form(integrals(form)) for form in forms]


def measure(mesh: Mesh, degree: int | None) -> ufl.Measure:
    """UFL measure over the cells with a fixed quadrature degree (None: UFL's estimate)."""
    metadata = {} if degree is None else {"quadrature_degree": degree}
    return ufl.Measure("dx", domain=mesh.dolfinx, metadata=metadata)


def in_space(components: Sequence[Expr]) -> Expr:
    """The components as a vector (3,), with zeros where they are missing (UFL)."""
    return ufl.as_vector([*components, *[0] * (3 - len(components))])


def jacobian_columns(mesh: Mesh) -> list[Expr]:
    """Derivatives (3,) of the points of a mesh of faces along the two reference axes (UFL)."""
    J = ufl.Jacobian(mesh.dolfinx)
    return [in_space([J[i, axis] for i in range(mesh.gdim)]) for axis in (0, 1)]


def split_motion(q: Expr) -> tuple[Expr, Expr]:
    """(displacement (3,), rotation (3,)) of a motion of beams or sheets, or of its slope (UFL)."""
    if len(q) == 3:  # of beams in a plane
        return ufl.as_vector([q[0], q[1], 0]), ufl.as_vector([0, 0, q[2]])
    return ufl.as_vector([q[i] for i in range(3)]), ufl.as_vector([q[i] for i in range(3, 6)])


def tangent(mesh: Mesh) -> Expr:
    """Unit vector along the cells of a mesh of lines (UFL)."""
    J = ufl.Jacobian(mesh.dolfinx)
    t = ufl.as_vector([J[i, 0] for i in range(mesh.gdim)])
    return t / ufl.sqrt(ufl.dot(t, t))
