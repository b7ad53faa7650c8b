"""All code that depends on the version of dolfinx: it is written for 0.11, with exceptions for 0.5
of Debian 12, 0.9 of Debian 13 and 0.10 of conda-forge.

Every function here is short and returns the same on every version; there is no mechanics here. A
new version of dolfinx needs changes in this file only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import basix
import dolfinx
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import ROUNDING
from antiosc.base.errors import MeshError
from antiosc.fem.platform.compiled_forms import quiet_compiler

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from ufl.core.expr import Expr
    from ufl.integral import Integral

import dolfinx.fem.petsc  # isort: skip  (0.9 and later do not import it by themselves)

DOLFINX_VERSION = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])
#: dolfinx 0.5, whose elements are UFL's own
OLD_DOLFINX = DOLFINX_VERSION < (0, 9)

# --- Meshes ---------------------------------------------------------------------------------


def create_mesh(
    comm: MPI.Comm, cells: IntArray, x: Array, cell: str, degree: int
) -> dolfinx.mesh.Mesh:
    """A mesh from `cells` (n, nodes) in dolfinx's order and `x` (nodes, gdim) of rank 0, empty on
    other ranks; MeshError if dolfinx would abort."""
    gdim = x.shape[1]
    corners, inner_nodes = np.split(cells, [CORNER_COUNT[cell]], axis=1)
    double_nodes = comm.allreduce(int(np.isin(inner_nodes, corners).sum()))
    if double_nodes:
        raise MeshError(
            f"{double_nodes} nodes inside sides of cells are corners of cells too: merge nodes "
            "within a smaller distance, or mesh the part anew."
        )

    domain = ufl.Mesh(_element("Lagrange", cell, degree, gdim, gdim))
    if OLD_DOLFINX:
        return dolfinx.mesh.create_mesh(comm, cells, x, domain)

    # more than two cells at a side would be separated when the mesh is partitioned
    joints = {"interval": 1, "triangle": 2, "quadrilateral": 2}.get(cell, 3) < gdim
    options: Mapping[str, object] = {}
    if comm.size > 1 and (joints or cell == "interval"):
        many = {"max_facet_to_cell_links": 64}
        options = many if DOLFINX_VERSION >= (0, 10) else {"partitioner": _all_on_root}

    return dolfinx.mesh.create_mesh(comm, cells=cells, x=x, e=domain, **options)


def _element(family: str, cell: str, degree: int, size: int, gdim: int) -> object:
    """UFL's element with `size` components on a cell in space of `gdim`; scalar if `size` is 0."""
    if not OLD_DOLFINX and family == "Quadrature":
        return basix.ufl.quadrature_element(cell, value_shape=(size,), degree=degree)
    if not OLD_DOLFINX:
        return basix.ufl.element(family, cell, degree, shape=(size,) if size else None)

    scheme = "default" if family == "Quadrature" else None
    scalar = ufl.FiniteElement(family, ufl.Cell(cell, gdim), degree, quad_scheme=scheme)

    return ufl.VectorElement(scalar, dim=size) if size else scalar


#: Number of corners of the cells.
CORNER_COUNT = {"interval": 2, "triangle": 3, "quadrilateral": 4, "tetrahedron": 4, "hexahedron": 8}


def _all_on_root(
    comm: MPI.Comm, n_parts: int, kinds: Sequence[dolfinx.mesh.CellType], cells: list[IntArray]
) -> dolfinx.graph.AdjacencyList:
    """A partition for dolfinx 0.9 that leaves all `cells` (flat array of vertices) on rank 0."""
    n_cells = len(cells[0]) // dolfinx.cpp.mesh.cell_num_vertices(kinds[0])
    return dolfinx.graph.adjacencylist(np.zeros((n_cells, 1), dtype=np.int32))


def node_order(cell: str, n_nodes: int, convention: str) -> IntArray:
    """Permutation p such that dolfinx_nodes = nodes[p], for `convention` "gmsh" or "vtk"."""
    permutation = getattr(dolfinx.cpp.io, f"perm_{convention}")
    return np.asarray(permutation(getattr(dolfinx.mesh.CellType, cell), n_nodes))


def lattice_gradients(cell: str, degree: int, n: int) -> Array:
    """Derivatives (dim, points, nodes) of Lagrange functions at a lattice of n steps per side."""
    kind = getattr(basix.CellType, cell)
    variant = basix.LagrangeVariant.equispaced
    element = basix.create_element(basix.ElementFamily.P, kind, degree, variant)
    X = basix.create_lattice(kind, n, basix.LatticeType.equispaced, True)
    return np.asarray(element.tabulate(1, X))[1:, :, :, 0]


def nodes_between(cell: str) -> list[tuple[list[int], int]]:
    """Pairs (vertices of an edge, face or cell; its node of order 2), in dolfinx's order."""
    kind = getattr(basix.CellType, cell)
    dofs = basix.create_element(basix.ElementFamily.P, kind, 2).entity_dofs
    return [
        (list(vertices), inner_node[0])
        for entities, nodes in zip(basix.topology(kind)[1:], dofs[1:], strict=True)
        for vertices, inner_node in zip(entities, nodes, strict=True)
        if inner_node
    ]


def set_coordinate_element(mesh: dolfinx.mesh.Mesh) -> None:
    """Give a mesh the coordinate element that FFCx 0.5 would set at its first form. All forms of
    the mesh then have the same signature and are compiled once."""
    if OLD_DOLFINX:
        domain = mesh.ufl_domain()
        (points, *_) = domain.ufl_coordinate_element().sub_elements()
        domain._ufl_coordinate_element = ufl.VectorElement(points.reconstruct(variant="equispaced"))


def geometry_nodes(mesh: dolfinx.mesh.Mesh) -> IntArray:
    """Nodes of every cell of this rank, ghosts included: (cells, nodes)."""
    geometry = mesh.geometry
    if OLD_DOLFINX:
        return _table(geometry.dofmap, geometry.cmap.create_dof_layout().num_dofs)
    return geometry.dofmap if DOLFINX_VERSION < (0, 11) else geometry.dofmaps[0]


def _table(connections: dolfinx.graph.AdjacencyList | IntArray, width: int) -> IntArray:
    """Connections as an array (rows, `width`); dolfinx 0.5 gives an AdjacencyList."""
    return np.asarray(getattr(connections, "array", connections)).reshape(-1, width)


def vertex_nodes(mesh: dolfinx.mesh.Mesh, dim: int) -> IntArray:
    """Geometry nodes (entities, v) at the vertices of this rank's entities of dimension `dim`."""
    mesh.topology.create_entities(dim)
    mesh.topology.create_connectivity(dim, mesh.topology.dim)
    mesh.topology.create_connectivity(dim, 0)
    mesh.topology.create_connectivity(mesh.topology.dim, 0)
    imap = mesh.topology.index_map(dim)
    entities = np.arange(imap.size_local + imap.num_ghosts, dtype=np.int32)
    kind = dolfinx.cpp.mesh.cell_entity_type(mesh.topology.cell_type, dim, 0)
    vertices = dolfinx.cpp.mesh.cell_num_vertices(kind)
    if not len(entities):  # 0.9 would divide by their number
        return np.zeros((0, vertices), dtype=np.int32)

    cpp_mesh = mesh._mesh if OLD_DOLFINX else mesh._cpp_object
    nodes = dolfinx.cpp.mesh.entities_to_geometry(cpp_mesh, dim, entities, False)

    # From 0.9 on the nodes inside edges and faces of curved cells follow those at the vertices.
    return np.asarray(nodes).reshape(len(entities), -1)[:, :vertices]


def communicator(mesh: dolfinx.mesh.Mesh) -> MPI.Comm:
    """The mesh's communicator; COMM_WORLD or COMM_SELF if of the same ranks (for dolfinx 0.9)."""
    for permanent in (MPI.COMM_WORLD, MPI.COMM_SELF):
        if MPI.Comm.Compare(mesh.comm, permanent) in (MPI.IDENT, MPI.CONGRUENT):
            return permanent
    return mesh.comm


def cell_index_map(mesh: dolfinx.mesh.Mesh) -> dolfinx.common.IndexMap:
    """Index map of the cells."""
    return mesh.topology.index_map(mesh.topology.dim)


def cell_name(mesh: dolfinx.mesh.Mesh) -> str:
    """The shape of the cells, one of `CORNER_COUNT`."""
    return str(mesh.ufl_cell().cellname() if DOLFINX_VERSION < (0, 10) else mesh.basix_cell().name)


def coordinate_map(mesh: dolfinx.mesh.Mesh) -> dolfinx.fem.CoordinateElement:
    """The mesh's coordinate element: push_forward(X, nodes), pull_back(x, nodes), degree."""
    return mesh.geometry.cmap if DOLFINX_VERSION < (0, 11) else mesh.geometry.cmaps[0]


def exterior_facets(mesh: dolfinx.mesh.Mesh) -> IntArray:
    """Local numbers of the facets that have one cell and are owned by this rank."""
    dim = mesh.topology.dim
    mesh.topology.create_entities(dim - 1)
    mesh.topology.create_connectivity(dim - 1, dim)
    return np.asarray(dolfinx.mesh.exterior_facet_indices(mesh.topology))


def refined(mesh: dolfinx.mesh.Mesh, edges: IntArray) -> dolfinx.mesh.Mesh:
    """A mesh of straight simplices with `edges`, local numbers, halved, and others to conform."""
    refinement = dolfinx.mesh.refine(mesh, np.asarray(edges, dtype=np.int32))
    return refinement if OLD_DOLFINX else refinement[0]


def cell_entities(mesh: dolfinx.mesh.Mesh, dim: int) -> IntArray:
    """Entities of dimension `dim` of every cell of this rank: (cells, entities per cell)."""
    topology = mesh.topology
    topology.create_entities(dim)
    topology.create_connectivity(topology.dim, dim)
    count = dolfinx.cpp.mesh.cell_num_entities(topology.cell_type, dim)
    return _table(topology.connectivity(topology.dim, dim), count)


# --- Function spaces and forms ----------------------------------------------------------------


def lagrange_space(mesh: dolfinx.mesh.Mesh, degree: int, size: int) -> fem.FunctionSpace:
    """A blocked continuous Lagrange space with `size` components."""
    return _space(mesh, "Lagrange", degree, size)


def interpolation_from_linear(
    space: fem.FunctionSpace, linear: fem.FunctionSpace | None = None
) -> PETSc.Mat:
    """Interpolation matrix from the `linear` Lagrange space (None: one is made) to the blocked
    `space` on its mesh; rows and columns are unrolled dofs."""
    size = space.dofmap.index_map_bs
    linear = linear or lagrange_space(space.mesh, 1, size)
    cells = np.arange(cell_index_map(space.mesh).size_local + cell_index_map(space.mesh).num_ghosts)
    fine, coarse = (cell_dofs(space_here, (0,), cells) // size for space_here in (space, linear))
    points = space.element.interpolation_points
    weights = tabulate(linear, (0,), np.asarray(points() if callable(points) else points))

    # one cell of each node, and its place in this cell
    nodes, places = np.unique(fine, return_index=True)
    owned_nodes = space.dofmap.index_map.size_local
    cell, place = np.divmod(places[nodes < owned_nodes], fine.shape[1])
    from_nodes = np.abs(weights) > ROUNDING
    ends = np.insert(np.cumsum(np.repeat(from_nodes.sum(axis=1)[place], size)), 0, 0)
    values = np.repeat(weights[place], size, axis=0)
    coarse_columns = np.repeat(from_nodes[place], size, axis=0)
    component = np.tile(np.arange(size), owned_nodes)[:, None]
    columns = size * np.repeat(coarse[cell], size, axis=0) + component
    numbers = global_dofs(linear, columns[coarse_columns])
    rows = ends.astype(PETSc.IntType), numbers, values[coarse_columns]
    sizes = [(local_size(space_here), None) for space_here in (space, linear)]
    matrix = PETSc.Mat().createAIJ(sizes, bsize=size, csr=rows, comm=communicator(space.mesh))
    matrix.assemble()
    matrix.setAttr("keep", (linear, space))

    return matrix


def cellwise_function(mesh: dolfinx.mesh.Mesh, size: int = 0) -> fem.Function:
    """A function with one value (`size` = 0) or vector (`size` components) per cell."""
    return fem.Function(_space(mesh, "DG", 0, size))


def reference_coordinates(mesh: dolfinx.mesh.Mesh) -> fem.Function:
    """The reference coordinates (ξ, η) in triangles, as a function."""
    function = fem.Function(_space(mesh, "DG", 1, 2))
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    function.x.array.reshape(-1, 3, 2)[:] = corners
    return function


def _space(mesh: dolfinx.mesh.Mesh, family: str, degree: int, size: int) -> fem.FunctionSpace:
    """A space with `size` components; scalar if `size` is 0."""
    element = _element(family, cell_name(mesh), degree, size, mesh.geometry.dim)
    with quiet_compiler():  # dolfinx 0.5 compiles the element here
        return (fem.FunctionSpace if OLD_DOLFINX else fem.functionspace)(mesh, element)


def _compiled(form: ufl.Form) -> fem.Form:
    """The compiled form."""
    with quiet_compiler():
        return fem.form(form)


class _PulledBack(ufl.classes.ReferenceValue):  # type: ignore[misc]
    """A function on the reference cell, to which UFL applies no pull-back."""

    __slots__ = ()

    def _ufl_expr_reconstruct_(self, *operands: Expr) -> _PulledBack:
        # an argument may be replaced by a function; its pull-back is what this already is
        plain = isinstance(operands[0], ufl.classes.FormArgument)
        return _PulledBack(*operands) if plain else self


def reference_derivatives(argument: Expr, n: int) -> Expr:
    """n-th derivatives of a test or trial function along the reference directions."""
    result = _PulledBack(argument)
    for _ in range(n):
        result = ufl.classes.ReferenceGrad(result)
    return result


def _edge_element() -> basix.finite_element.FiniteElement:
    """Nédélec's second edge element of degree 2 on the triangle."""
    legendre = basix.LagrangeVariant.legendre, basix.DPCVariant.legendre
    return basix.create_element(basix.ElementFamily.N2E, basix.CellType.triangle, 2, *legendre)


def edge_points() -> Array:
    """Points (n, 2) of the reference triangle at which `edge_interpolation` needs values."""
    return np.asarray(_edge_element().points)


def edge_interpolation(X: Array) -> Array:
    """Matrix (P, 2, 2, n) from vectors at n `edge_points` to Nédélec's field at X (P, 2)."""
    element = _edge_element()
    to_moments = np.asarray(element.interpolation_matrix).reshape(element.dim, 2, -1)
    tables = np.asarray(element.tabulate(0, X)[0])  # (points, dofs, 2)
    return np.einsum("pdc,dbn->pcbn", tables, to_moments)


def subspace(space: fem.FunctionSpace, path: Sequence[int]) -> fem.FunctionSpace:
    """`space` itself, or its component with this path."""
    for index in path:
        space = space.sub(index)
    return space


def dof_coordinates(space: fem.FunctionSpace, path: Sequence[int]) -> tuple[IntArray, Array]:
    """(dofs of this rank with ghosts, their coordinates (n, 3)) of a component of a space."""
    (component,) = path
    x = space.tabulate_dof_coordinates()
    dofs = component + space.dofmap.index_map_bs * np.arange(len(x))
    return dofs.astype(np.int32), x


def tabulate(space: fem.FunctionSpace, path: Sequence[int], X: Array) -> Array:
    """Basis functions of one scalar component at reference points X: (points, functions)."""
    element = subspace(space, path).element.basix_element
    return np.asarray(element.tabulate(0, X))[0].reshape(len(X), -1)


def tabulate_derivatives(space: fem.FunctionSpace, path: Sequence[int], X: Array) -> Array:
    """Derivatives of the basis functions along the reference axes: (points, functions, axes)."""
    element = subspace(space, path).element.basix_element
    tables = np.asarray(element.tabulate(1, X))[1:]
    return np.moveaxis(tables.reshape(len(tables), len(X), -1), 0, 2)


def quadrature(cell: str, degree: int) -> tuple[Array, Array]:
    """Points (n, tdim) and weights (n,) on the reference cell."""
    X, weights = basix.make_quadrature(getattr(basix.CellType, cell), degree)
    return np.asarray(X), np.asarray(weights)


def local_size(space: fem.FunctionSpace) -> int:
    """Number of dofs owned by this rank."""
    return int(space.dofmap.index_map.size_local * space.dofmap.index_map_bs)


def assemble(
    forms: Sequence[ufl.Form],
    space: fem.FunctionSpace,
    fixed: Mapping[tuple[int, ...], IntArray],
    diagonal: float,
) -> PETSc.Mat:
    """Matrix of the sum of bilinear `forms`; fixed dofs have only `diagonal` in row and column.

    `fixed`: dofs on this rank, ghosts included, by the path of their scalar component.
    """
    zero = np.zeros((), dtype=PETSc.ScalarType)
    bcs = []
    for path, dofs in fixed.items():
        component = subspace(space, path)
        # dolfinx 0.5 would first try the Python object, and write all dofs into the error
        component = component._cpp_object if OLD_DOLFINX else component
        bcs.append(fem.dirichletbc(zero, dofs, component))

    total = None
    for form in forms:
        compiled = _compiled(form)
        try:
            matrix = fem.petsc.assemble_matrix(compiled, bcs, diagonal if total is None else 0.0)
            matrix.assemble()
        except RuntimeError as error:
            # dolfinx formats the text of PETSc's error, which is missing when memory is short
            if "basic_string" in str(error):
                raise MemoryError("PETSc has no memory for a matrix") from error
            raise

        # From 0.9 the layouts of the matrix point into the mesh: they must not die first.
        matrix.setAttr("keep", (compiled, space))
        if total is None:
            total = matrix
        else:
            total.axpy(1.0, matrix, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)

    if total is None:
        raise ValueError("no form to assemble")

    return total


def strain_matrix(
    strains: Expr, degree: int, space: fem.FunctionSpace, fixed: Mapping[tuple[int, ...], IntArray]
) -> PETSc.Mat:
    """Matrix S with |S u|² = ∫ |strains(u)|², one row for each strain component and Gauss point.
    `strains`: vector (UFL) of the trial function; `fixed`: as for `assemble`, with zero columns."""
    mesh = space.mesh
    size = len(strains)
    points = _space(mesh, "Quadrature", degree, size)
    v = ufl.TestFunction(points)
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": degree})
    S = assemble([ufl.dot(strains, v) * dx], space, fixed, 0.0)
    weights = assemble_functional(sum(v[i] for i in range(size)) * dx, points)
    scale = S.createVecLeft()
    scale.setArray(1 / np.sqrt(weights))
    S.diagonalScale(scale, None)

    return S


def assemble_functional(form: ufl.Form, space: fem.FunctionSpace) -> Array:
    """A linear form as an array over the dofs that this rank owns, summed over the ranks."""
    return _assembled(_compiled(form), local_size(space))


def _assembled(form: fem.Form, rows: int) -> Array:
    """A compiled linear form as an array over the first `rows` dofs, those of this rank."""
    vector = fem.assemble_vector(form)
    vector.scatter_reverse(ADD_GHOSTS)
    return np.array(vector.array[:rows])


def cell_energies(
    forms: Sequence[ufl.Form], space: fem.FunctionSpace, vectors: Array, weights: Array, degree: int
) -> Array:
    """Σ weight × xᵀ A_c x, (cells that this rank owns,), over the columns x of `vectors` (rows of
    this rank, k) and `weights` (k,); A_c: cell matrix of `forms`, by quadrature of at most
    `degree`."""
    x = fem.Function(space)
    cell = cellwise_function(space.mesh)
    q = ufl.TestFunction(cell.function_space)

    def of_cells(integral: Integral) -> Integral:
        lower_degree = min(degree, integral.metadata().get("quadrature_degree", degree))
        metadata = {**integral.metadata(), "quadrature_degree": lower_degree}
        return integral.reconstruct(integrand=q * integral.integrand(), metadata=metadata)

    integrals = [of_cells(integral) for form in forms for integral in form.integrals()]
    replacements = {argument: x for form in forms for argument in form.arguments()}
    compiled = _compiled(ufl.replace(ufl.Form(integrals), replacements))

    total = np.zeros(cell_index_map(space.mesh).size_local)
    for vector, weight in zip(vectors.T, weights, strict=True):
        x.x.array[: len(vector)] = vector
        x.x.scatter_forward()
        total += weight * _assembled(compiled, len(total))

    return total


def integrate(form: ufl.Form, mesh: dolfinx.mesh.Mesh) -> float:
    """The value of a UFL form without arguments, summed over all ranks."""
    return float(communicator(mesh).allreduce(fem.assemble_scalar(_compiled(form))))


def constant(mesh: dolfinx.mesh.Mesh, value: ArrayLike) -> fem.Constant:
    """A UFL constant of any rank; forms that differ only in its value are compiled once."""
    return fem.Constant(mesh, np.array(value, dtype=PETSc.ScalarType, order="C"))


def global_dofs(space: fem.FunctionSpace, local: IntArray) -> IntArray:
    """Global numbers of unrolled dofs of this rank."""
    bs = space.dofmap.index_map_bs
    local = np.asarray(local, dtype=np.int32)
    blocks = space.dofmap.index_map.local_to_global(local // bs)
    return (np.asarray(blocks) * bs + local % bs).astype(np.int32)


def cell_dofs(space: fem.FunctionSpace, path: Sequence[int], cells: IntArray) -> IntArray:
    """Unrolled dofs of this rank of one scalar component in cells: (cells, functions)."""
    (component,) = path  # of a blocked space, whose components share their nodes
    nodes = _nodes(space)[np.asarray(cells, dtype=np.intp)]
    return np.asarray(space.dofmap.index_map_bs * nodes + component, dtype=np.int32)


def _nodes(space: fem.FunctionSpace) -> IntArray:
    """Numbers of the dof blocks of every cell of this rank: (cells, nodes)."""
    return _table(space.dofmap.list, space.dofmap.dof_layout.num_dofs)


#: Addition of what the ghosts have to the values of the owners
ADD_GHOSTS = dolfinx.la.ScatterMode.add if OLD_DOLFINX else dolfinx.la.InsertMode.add


class Exchange:
    """Exchange of values between the owner of a dof and the ranks where it is a ghost."""

    def __init__(self, space: fem.FunctionSpace) -> None:
        self._map = space.dofmap.index_map
        self._bs = space.dofmap.index_map_bs
        self._alone = communicator(space.mesh).size == 1
        self._owned = self._bs * self._map.size_local
        self._vectors: dict[tuple[int, np.dtype], dolfinx.la.Vector] = {}

    def fetch(self, values: Array) -> None:
        """Copy the owners' values to the ghosts in `values` (dofs with ghosts[, columns])."""
        if not self._alone:
            vector, copies = self._vector(values)
            copies[self._shared] = values[self._shared]
            vector.scatter_forward()
            values[self._owned :] = copies[self._owned :]

    def add(self, values: Array) -> None:
        """Add the values at the ghosts to those of their owners, in `values` as in `fetch`."""
        if not self._alone:
            vector, copies = self._vector(values)
            copies[self._shared] = values[self._shared]
            copies[self._owned :] = values[self._owned :]
            vector.scatter_reverse(ADD_GHOSTS)
            values[self._shared] = copies[self._shared]

    def _vector(self, values: Array) -> tuple[dolfinx.la.Vector, Array]:
        """dolfinx's vector for values of one or several columns, and its array in their shape."""
        kind = math.prod(values.shape[1:]), values.dtype
        if kind not in self._vectors:
            self._vectors[kind] = dolfinx.la.vector(self._map, self._bs * kind[0], kind[1])
        vector = self._vectors[kind]
        return vector, vector.array.reshape(values.shape)

    @cached_property
    def _shared(self) -> IntArray:
        """The dofs of this rank that are ghosts on others."""
        marks = dolfinx.la.vector(self._map, self._bs)
        marks.array[self._owned :] = 1.0
        marks.scatter_reverse(ADD_GHOSTS)
        return np.flatnonzero(marks.array[: self._owned])


def with_ghosts(space: fem.FunctionSpace, block: Array) -> Array:
    """`block` (owned dofs of this rank, k), extended by the values of the ghosts below."""
    if communicator(space.mesh).size == 1:
        return block

    imap = space.dofmap.index_map
    rows = (imap.size_local + imap.num_ghosts) * space.dofmap.index_map_bs
    result = np.empty((rows, block.shape[1]))
    result[: len(block)] = block
    Exchange(space).fetch(result)

    return result


def ghosts_added(space: fem.FunctionSpace, block: Array) -> Array:
    """(owned dofs, k): `block` (dofs of this rank with ghosts, k), with the values at the ghosts on
    other ranks added."""
    result = np.array(block, dtype=float)
    Exchange(space).add(result)
    return result[: local_size(space)]
