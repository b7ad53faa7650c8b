"""Small parts for the tests of the FE side: meshes with named groups, and direct solves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
import scipy.sparse.linalg
import ufl
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.platform.compiled_forms import quiet_compiler
from antiosc.reduce.site import functional

Array = NDArray[np.float64]
Marker = Callable[[Array], NDArray[np.bool_]]

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}

CELLS = ("triangle", "quadrilateral", "tetrahedron", "hexahedron")


def named(mesh: dolfinx.mesh.Mesh, groups: Mapping[str, tuple[int, Marker]]) -> ao.Mesh:
    """A dolfinx mesh with groups: name -> (dimension, function of the coordinates)."""
    tags = {}
    for name, (dim, marker) in groups.items():
        entities = dolfinx.mesh.locate_entities(mesh, dim, marker)
        values = np.ones(len(entities), dtype=np.int32)
        tags[name] = (dolfinx.mesh.meshtags(mesh, dim, entities, values), 1)
    return ao.read_mesh(mesh, groups=tags)


def box(
    n: Sequence[int] = (4, 2, 2),
    size: Sequence[float] = (0.2, 0.05, 0.04),
    cell: str = "hexahedron",
    comm: MPI.Comm = MPI.COMM_WORLD,
    groups: Mapping[str, tuple[int, Marker]] | None = None,
) -> ao.Mesh:
    """A block with the groups "left" (x = 0) and "right", or those given."""
    kind = getattr(dolfinx.mesh.CellType, cell)
    corners = [np.zeros(len(n)), np.asarray(size, dtype=float)]
    make = dolfinx.mesh.create_box if len(n) == 3 else dolfinx.mesh.create_rectangle
    mesh = make(comm, corners, list(n), cell_type=kind)
    sides = {
        "left": (len(n) - 1, lambda x: np.isclose(x[0], 0)),
        "right": (len(n) - 1, lambda x: np.isclose(x[0], size[0])),
    }
    return named(mesh, sides if groups is None else groups)


def plate(
    n: Sequence[int] = (8, 4),
    size: Sequence[float] = (0.2, 0.06),
    cell: str = "quadrilateral",
    comm: MPI.Comm = MPI.COMM_WORLD,
    groups: Mapping[str, tuple[int, Marker]] | None = None,
) -> ao.Mesh:
    """A rectangle in the plane, as `box`."""
    return box(n, size, cell, comm, groups)


def held_sheet(cell: str = "quadrilateral", cells: tuple[int, int] = (6, 3)) -> ao.Structure:
    """A sheet of steel in plane stress, 0.2 × 0.06 m, held at its left side."""
    steel = ao.Solid(**STEEL, plane="stress", thickness=0.01)
    return ao.Structure(plate(cells, (0.2, 0.06), cell), steel, [ao.Support("left")])


def nodal(structure: ao.Structure, field: Callable[[Array], Array]) -> Array:
    """Dofs of the displacement field x (3, n) -> (gdim, n)."""
    u = np.zeros(structure.K.getSize()[0])
    for axis, name in enumerate("xyz"):
        if name in structure.form.components:
            dofs, x = compat.dof_coordinates(structure.form.space, structure.form.components[name])
            u[dofs] = field(x.T)[axis]
    return u


def frame(
    points: Sequence[Sequence[float]],
    members: Sequence[tuple[int, int]],
    n: int,
    groups: Mapping[str, tuple[int, Marker]] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> ao.Mesh:
    """Straight members of `n` line elements each between `points` of 2 or 3 coordinates."""
    x = [np.asarray(p, dtype=float) for p in points]
    cells = []
    for a, b in members:
        inner = range(len(x), len(x) + n - 1)
        x += [x[a] + (x[b] - x[a]) * k / n for k in range(1, n)]
        chain = [a, *inner, b]
        cells += list(pairwise(chain))
    nodes, lines = np.array(x), np.array(cells, dtype=np.int64)
    if comm.rank:
        nodes, lines = nodes[:0], lines[:0]
    return named(compat.create_mesh(comm, lines, nodes, "interval", 1), groups or {})


def line(length: float, n: int, direction: Sequence[float] = (1.0, 0.0), **options: Any) -> ao.Mesh:
    """A straight line from the origin, with the end nodes as groups "left" and "right"."""
    along = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    end = length * along
    groups = {
        "left": (0, lambda x: np.linalg.norm(x, axis=0) < 1e-9 * length),
        "right": (
            0,
            lambda x: np.linalg.norm(x.T - np.resize(end, 3) * _mask(end), axis=1) < 1e-9 * length,
        ),
    }
    return frame([0 * end, end], [(0, 1)], n, groups=groups, **options)


def _mask(end: Array) -> Array:
    return np.arange(3) < len(end)


def bend(x: Array) -> Array:
    """A quadratic, volume-preserving map of points (n, 3): cells of order 2 follow it exactly."""
    bent = x.copy()
    bent[:, 0] += 0.2 * x[:, 1] ** 2
    bent[:, 2] += 0.3 * x[:, 0] * x[:, 1]
    return bent


def bend_plane(x: Array) -> Array:
    """The same in the plane."""
    bent = x.copy()
    bent[:, 0] += 0.3 * x[:, 1] ** 2
    return bent


@contextmanager
def gmsh_session() -> Iterator[Any]:
    """A quiet gmsh session of this process."""
    import gmsh

    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh
    finally:
        gmsh.finalize()


def gmsh_cube(
    path: Path,
    cell: str,
    order: int = 1,
    *,
    bent: bool = False,
    version: float = 4.1,
    binary: bool = False,
    n: int = 2,
) -> Path:
    """Write the unit cube or square as a mesh file by gmsh, its cells of one kind.

    Groups: "body"; in `.msh` files also "clamp", on x = 0 before bending, and the point "corner".
    """
    space = cell in ("tetrahedron", "hexahedron")
    with gmsh_session() as gmsh:
        gmsh.model.add("cube")
        geo = gmsh.model.geo
        corner = geo.addPoint(0, 0, 0)
        edge = geo.extrude([(0, corner)], 0, 1, 0, [n])[1]
        recombine = cell in ("quadrilateral", "hexahedron")
        swept = geo.extrude([edge], 1, 0, 0, [n], recombine=recombine)
        body, clamp = swept[1], edge
        if space:
            raised = geo.extrude([body], 0, 0, 1, [n], recombine=recombine)
            body = raised[1]
            geo.synchronize()
            clamp = next(
                (2, tag)
                for dim, tag in gmsh.model.getEntities(2)
                if np.allclose(np.array(gmsh.model.getBoundingBox(dim, tag))[[0, 3]], 0, atol=1e-6)
            )
        geo.synchronize()
        for name, (dim, tag) in {"body": body, "clamp": clamp, "corner": (0, corner)}.items():
            if name == "body" or path.suffix == ".msh":
                gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, [tag]), name)
        gmsh.model.mesh.generate(3 if space else 2)
        gmsh.model.mesh.setOrder(order)
        if bent:
            tags, x, _ = gmsh.model.mesh.getNodes()
            moved = (bend if space else bend_plane)(np.array(x).reshape(-1, 3))
            for node, place in zip(tags, moved, strict=True):
                gmsh.model.mesh.setNode(node, place, [])
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(path))
    return path


def direct_stiffness(K: Any, M: Any, b: Array, omega: Array) -> Array:
    """1/bᵀ(K − ω²M)⁻¹b by a sparse LU for every ω: knows nothing of anti-oscillators."""
    K, M = (csr(A) if hasattr(A, "getValuesCSR") else A for A in (K, M))
    values = []
    for w in omega:
        factor = scipy.sparse.linalg.splu(
            scipy.sparse.csc_matrix(K - w**2 * M),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.01,
            options={"SymmetricMode": True},
        )
        x = factor.solve(b)
        x += factor.solve(b - K @ x + w**2 * (M @ x))  # one step of refinement
        values.append(1 / (b @ x))
    return np.array(values)


def unreduced(part, site, times, ball, law, decay=0.0):
    """u, u', u'' (times, dofs) and F of the whole model and the mass, by DOP853."""
    b = functional(part, site).b
    free = np.setdiff1d(np.arange(len(b)), part.fixed)
    K, M = (csr(A)[free][:, free].toarray() for A in (part.K, part.M))
    inverse, own = np.linalg.inv(M), b[free]
    A, push = inverse @ K, inverse @ own
    n = len(free)

    def force(y):
        return law.stiffness * max(y[2 * n] - own @ y[:n], 0.0) ** 1.5

    def slope(t, y):
        F = force(y)
        pulled = push * F - A @ y[:n] - 2 * decay * y[n : 2 * n]
        return np.concatenate([y[n : 2 * n], pulled, [y[2 * n + 1], -F / ball.mass]])

    start = np.zeros(2 * n + 2)
    start[-1] = ball.velocity
    y = solve_ivp(
        slope, (0, times[-1]), start, "DOP853", times, rtol=1e-8, atol=1e-12, max_step=1e-5
    ).y
    F = np.array([force(row) for row in y.T])
    u, v, a = (np.zeros((len(times), len(b))) for _ in range(3))
    u[:, free], v[:, free] = y[:n].T, y[n : 2 * n].T
    a[:, free] = np.outer(F, push) - u[:, free] @ A.T - 2 * decay * v[:, free]
    return u, v, a, F


EXPONENTS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 0)]


def moments(mesh: ao.Mesh) -> np.ndarray:
    """∫ x^i y^j z^k over the mesh, for all EXPONENTS of its dimension; one compiled form."""
    domain = mesh.dolfinx
    x = ufl.SpatialCoordinate(domain)
    weights = compat.constant(domain, np.zeros(len(EXPONENTS)))
    monomials = [np.prod([x[a] ** p for a, p in enumerate(e[: mesh.gdim])]) for e in EXPONENTS]
    dx = ufl.Measure("dx", domain=domain, metadata={"quadrature_degree": 7})
    with quiet_compiler():
        form = dolfinx.fem.form(sum(w * m for w, m in zip(weights, monomials, strict=True)) * dx)
    result = []
    for row in np.eye(len(EXPONENTS)):
        weights.value[:] = row
        result.append(domain.comm.allreduce(dolfinx.fem.assemble_scalar(form)))
    return np.array([m for e, m in zip(EXPONENTS, result, strict=True) if not any(e[mesh.gdim :])])


#: A unit square for gmsh: groups "sheet", "foot" and 17.
SHEET_SCRIPT = """\
Point(1) = {0, 0, 0, 0.25}; Point(2) = {1, 0, 0, 0.25};
Point(3) = {1, 1, 0, 0.25}; Point(4) = {0, 1, 0, 0.25};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Physical Surface("sheet") = {1}; Physical Curve("foot") = {1}; Physical Curve(17) = {3};
"""


def group_points(mesh: ao.Mesh, name: str, dim: int) -> np.ndarray:
    """Vertices (n, 3) of the entities of a group."""
    entities = mesh.group(name)[dim]
    return mesh.dolfinx.geometry.x[compat.vertex_nodes(mesh.dolfinx, dim)[entities]]
