"""`Structure`: K and M with supports, and the one factorization that every site and mode uses.

Its `matrices` come from a mesh (`antiosc.fem.structure.meshed`), or the user gives them.
Extraction uses only their common attributes.

An entry K_ij of another code is compared with √(K_ii K_jj), which it cannot exceed in a positive
semidefinite matrix. A norm of the whole matrix is no suitable scale: if supports are penalties,
such as FreeFEM's 1e30 on the diagonal, all other entries are below its rounding.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict, cast, get_args

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike

import antiosc
from antiosc import fem
from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, Box, IntArray, Matrix, SolverChoice
from antiosc.base.checks import MAX_MAGNITUDE, MIN_MAGNITUDE, choice, floats
from antiosc.base.clock import clock
from antiosc.base.errors import InputError, finite_element_packages
from antiosc.base.progress import doing
from antiosc.base.texts import ReprMixin
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import communicator
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.platform import ALONE, collective, done_on_all, is_petsc, raise_on_all, same_ranks
from antiosc.fem.structure import NodalMatrices, StructureMatrices, modes_and_shift
from antiosc.io.matrices import DofMap, dof_map, joined_bodies, read_pair, supported_rows
from antiosc.models.motion import Inertia

if TYPE_CHECKING:
    from mpi4py import MPI

    from antiosc.fem.elements.weak_form import Family
    from antiosc.fem.mesh import Mesh
    from antiosc.fem.prestress import Prestress
    from antiosc.fem.structure.attachments import Attachment
    from antiosc.fem.structure.meshed import MeshedStructure, PartsMatrices
    from antiosc.fem.structure.support import Support

#: Library of the linear algebra: "auto" is PETSc if it is installed.
Backend = Literal["auto", "petsc", "scipy"]
BACKENDS = get_args(Backend)
#: (row, column, value) of entries of a matrix
Entries: TypeAlias = tuple[IntArray, IntArray, Array]

#: Difference of mirrored entries over √(a_ii a_jj) that the other program may leave by rounding.
MIRROR_TOLERANCE = 1e-9
#: Share of the typical diagonal entry below which an entry is rounding.
ENTRY_ROUNDING = 1e-15
#: Diagonal entry of a held dof over its row's others: it moves 1e-14 of what its neighbours do.
PENALTY_OVER_ROW = 1e14
#: Diagonal entry of a held dof over the typical (median) off-diagonal entry of all rows.
PENALTY_OVER_TYPICAL = 1e12
#: A coupling that leaves less than four digits of what is coupled.
DOMINANT_RATIO = 1e12


# -- one matrix


def checked_matrix(name: str, matrix: Matrix, backend: Backend) -> Matrix:
    """A checked copy of a square matrix (SciPy, dense or PETSc) in the chosen library."""
    copy: Matrix

    if is_petsc(matrix) or backend == "petsc" or (backend == "auto" and fem.missing is None):
        with finite_element_packages():
            from antiosc.fem.linalg import petsc_algebra
        if is_petsc(matrix):
            copy = petsc_algebra.copied_matrix(name, matrix)
        else:
            copy = petsc_algebra.from_csr(name, _csr_of_arrays(name, matrix))
        if backend == "scipy":
            if communicator(copy).size > 1:
                raise InputError(f"{name} is spread over MPI ranks, SciPy's back-end needs one.")
            copy = petsc_algebra.csr(copy)
    else:
        copy = _csr_of_arrays(name, matrix)

    rows, columns = copy.shape if algebra.is_scipy(copy) else copy.getSize()
    if rows != columns or not rows:
        raise InputError(f"{name} must be square; got {rows} rows and {columns} columns.")
    done_on_all(communicator(copy), lambda: _check_values(name, algebra.entries(copy)[2]))
    return copy


def _csr_of_arrays(name: str, matrix: Matrix) -> scipy.sparse.csr_matrix:
    """A sorted copy of a SciPy or dense matrix of real numbers; InputError for other objects."""
    sparse = scipy.sparse.issparse(matrix)

    try:
        entries: Matrix = matrix if sparse else np.asarray(matrix)
    except Exception:  # rows of different lengths, or objects that are no arrays at all
        entries = np.zeros(())

    if not sparse and entries.ndim == 0:
        raise InputError(
            f"{name} must be a SciPy sparse, dense or PETSc matrix; got {type(matrix).__name__}."
        )
    if entries.ndim != 2:
        raise InputError(f"{name} must be square; got an array of shape {entries.shape}.")
    if isinstance(matrix, np.ma.MaskedArray) and np.ma.is_masked(matrix):
        raise InputError(f"{name} must be given without masked entries.")
    if entries.dtype.kind not in "iuf":
        raise InputError(f"{name} must hold real numbers; got entries of type {entries.dtype}.")

    with np.errstate(over="ignore"):  # a long double above 1e308 becomes inf, refused later
        result = scipy.sparse.csr_matrix(entries, dtype=float, copy=True)
    result.sum_duplicates()
    result.sort_indices()
    return result


def _check_values(name: str, values: Array) -> None:
    """InputError for entries (n,) that are not finite, too large, or all too small."""
    if not np.isfinite(values).all():
        raise InputError(f"{name} holds NaN or infinite entries; antiosc needs finite matrices.")
    largest = np.abs(values).max(initial=0.0)
    if largest > MAX_MAGNITUDE:
        raise InputError(f"{name} has an entry of {largest:g}; none may exceed {MAX_MAGNITUDE:g}.")
    if 0.0 < largest < MIN_MAGNITUDE:
        raise InputError(f"{name} has no entry above {largest:g}: is it in SI units?")


# -- K and M together


def matrices_of_pair(
    K: Matrix,
    M: Matrix,
    rows: DofMap | None,
    supports: Mapping[int, str | Sequence[str]] | None,
    rigid_modes: ArrayLike | None,
    C: Matrix | None = None,
) -> tuple[StructureMatrices, Solver | None]:
    """(checked matrices with supports and null vectors of K, solver of K or None if singular).
    Arguments as of `Structure.from_matrices`; `rows`: its map, None: none is given."""
    K, M, fixed = with_supports(K, M)

    if supports is not None:
        fixed_rows = supported_rows(supports, rows)
        K = algebra.fix_rows(K, fixed_rows, 1.0)
        M = algebra.fix_rows(M, fixed_rows, 0.0)
        fixed = np.union1d(fixed, fixed_rows)

    null_vectors = None
    if rigid_modes is not None:
        null_vectors = floats("rigid_modes", rigid_modes, (algebra.rows(K), None))
    modes, shift, factor = modes_and_shift(K, M, null_vectors)
    parts = K, M, fixed, modes, shift
    if C is not None:
        C = _checked_damping(C, K, fixed)
    if rows is None:
        return StructureMatrices(*parts, C=C), factor
    return NodalMatrices(*parts, C=C, map=rows), factor


def _checked_damping(C: Matrix, K: Matrix, fixed: IntArray) -> Matrix:
    """C with zero rows and columns at `fixed` dofs (local numbers); InputError if its size is not
    that of K, or it is unsymmetric."""
    if algebra.size(C) != algebra.size(K) or algebra.row_range(C) != algebra.row_range(K):
        raise InputError(
            f"C must have the size of K; got {algebra.size(C)} rows for {algebra.size(K)}."
        )

    _checked_diagonal("C", C)
    first, _ = algebra.row_range(C)
    return algebra.fix_rows(C, fixed[fixed < algebra.rows(C)] + first, 0.0)


def with_supports(K: Matrix, M: Matrix) -> tuple[Matrix, Matrix, IntArray]:
    """(K, M, local numbers of fixed dofs): penalties on K's diagonal are replaced by supports."""
    comm = communicator(K)
    same_rows = algebra.size(K) == algebra.size(M) and same_ranks(comm, communicator(M))
    if not same_rows or not all(comm.allgather(algebra.row_range(K) == algebra.row_range(M))):
        raise InputError(
            f"K and M must be distributed alike; got {algebra.size(K)} and {algebra.size(M)} rows."
        )

    of_K, of_M = (_checked_diagonal(name, matrix) for name, matrix in (("K", K), ("M", M)))
    empty = np.flatnonzero((of_K == 0) & (of_M == 0))
    if len(empty):
        raise InputError(
            f"{len(empty)} dofs have neither stiffness nor mass, as dof {empty[0]}: omit them."
        )

    constrained = _penalised_dofs(K, of_K)
    first, last = algebra.row_range(K)
    of_rank = constrained[(constrained >= first) & (constrained < last)]
    if len(constrained):
        K = algebra.fix_rows(K, of_rank, 1.0)
        M = algebra.fix_rows(M, of_rank, 0.0)

    return K, M, of_rank - first


def _checked_diagonal(name: str, matrix: Matrix) -> Array:
    """The whole diagonal (n,) on every rank; InputError if the matrix is unsymmetric, zero on the
    diagonal, or negative there."""
    comm = communicator(matrix)
    diagonal = np.concatenate(comm.allgather(algebra.diagonal(matrix)))
    if not diagonal.any():
        raise InputError(f"{name} is zero on its diagonal: a structure needs stiffness and mass.")
    noise = ENTRY_ROUNDING * np.median(np.abs(diagonal[diagonal != 0]))
    if diagonal.min() < -noise:
        k = int(np.argmin(diagonal))
        raise InputError(
            f"{name} must be positive semidefinite; its diagonal has {diagonal[k]:g} in row {k}."
        )

    row, column, value = _entries(algebra.skew(matrix))
    root = np.sqrt(np.maximum(diagonal, 0.0))
    bad = np.abs(value) > MIRROR_TOLERANCE * root[row] * root[column] + noise
    text = (
        f"{name} must be symmetric (to {MIRROR_TOLERANCE:g} of √(a_ii a_jj)); its entries "
        f"({{0}}, {{1}}) "
        "and ({1}, {0}) differ by {2:g}."
    )
    _refuse_entries(comm, bad, (row, column, value), text)
    return diagonal


def _entries(matrix: Matrix) -> Entries:
    """(row, column, value) of the off-diagonal entries on this rank, in global numbers."""
    pointers, column, value = algebra.entries(matrix)
    row = algebra.row_range(matrix)[0] + np.repeat(np.arange(len(pointers) - 1), np.diff(pointers))
    off_diagonal = (row != column) & (value != 0)
    return row[off_diagonal], column[off_diagonal], value[off_diagonal]


def _refuse_entries(comm: MPI.Comm, bad: BoolArray, entries: Entries, text: str) -> None:
    """Raise InputError on all ranks if an entry is `bad`; `text` takes its row, column, size."""
    error = None
    if bad.any():
        row, column, value = (part[bad][0] for part in entries)
        error = InputError(text.format(row, column, abs(value)))
    raise_on_all(comm, error)


def _penalised_dofs(K: Matrix, diagonal: Array) -> IntArray:
    """Dofs, by global number, that penalties on K's `diagonal` (n,) fix; InputError for a penalty
    that couples two dofs."""
    comm = communicator(K)
    row, column, value = _entries(K)
    size = np.abs(value)
    sums = comm.allreduce(np.bincount(row, size, len(diagonal)))
    told = size > ENTRY_ROUNDING * np.minimum(diagonal[row], diagonal[column])
    sizes = np.concatenate(comm.allgather(size[told]))
    if not len(sizes):
        return np.zeros(0, dtype=int)

    # a few penalties do not change the median
    typical = np.median(sizes)
    is_fixed = (diagonal > PENALTY_OVER_ROW * sums) & (diagonal > PENALTY_OVER_TYPICAL * typical)
    drowns = (size > DOMINANT_RATIO * typical) & ~is_fixed[row] & ~is_fixed[column]
    text = (
        "K couples dofs {0} and {1} by a penalty of {2:g}, which leaves less than four digits of "
        "their own stiffness: take a penalty of at most 1e8 times the usual entries."
    )
    _refuse_entries(comm, drowns, (row, column, value), text)
    return np.flatnonzero(is_fixed)


class Options(TypedDict):
    """Arguments of a `Structure` of a mesh other than its material and its supports."""

    order: int  # degree of the displacements, 1 or 2
    attached: Sequence[Attachment]
    solver: SolverChoice
    prestress: Prestress | None


class Structure(ReprMixin):
    """M and K of a part, with its supports applied.

    Parameters
    ----------
    mesh : Mesh
        From `read_mesh`.
    material : Solid, Shell, Laminate, Beam, Truss or dict
        One material, or {group name: material} that covers every cell once. On a shell's mesh
        groups of edges may also carry a `Beam`: a stiffener that moves with the sheet.
    supports : sequence of Support
        None: a free body.
    order : 1 or 2
        Degree of the displacements.
    attached : sequence of PointMass, Spring and Damper
        Masses, springs and dampers at points of the structure.
    solver : "auto", "direct" or "iterative"
        Solver for K: a Cholesky factor, or conjugate gradients with multigrid. "auto" chooses, by
        a forecast, the faster one that fits in memory (`antiosc.fem.linalg.solver`).
    prestress : Prestress, optional
        Permanent loads: spin, gravity, pressure, tensions, forces. K is the
        tangent stiffness of their static equilibrium.

    Attributes
    ----------
    prestress : PrestressedState or None
        Reserve to buckling, displacement and stress under the prestress.
    K, M : PETSc.Mat or scipy.sparse.csr_matrix
        Stiffness (N/m) and mass (kg). Fixed dofs keep their rows: 1 on K's diagonal, 0 in M. From
        20 000 dofs of quadratic isotropic tetrahedra on, K and M are of PETSc's type python:
        products are computed from the cells; `petsc_algebra.with_entries` makes entries.
    dofs : int
        Number of dofs that are not `fixed`, on all ranks.
    fixed : ndarray of int
        Local numbers of the dofs that supports fix; for a mesh, ghosts included; for an assembly
        also those that its joints make dependent.
    supports : tuple of Support
    mass : float
        Total mass, kg.
    dimensions : (float, float, float)
        Length, width and thickness of the part, m, as `antiosc.strikes.advice` requires them.
    rigid_modes : ndarray (rows of this rank, r)
        M-orthonormal rigid-body modes that the supports permit.
    shift : float
        s of K + sM, the matrix that `factorize` factors, rad²/s²; 0 without rigid-body modes.
    matrices : StructureMatrices
        K and M with the data of their dofs.
    seconds : dict
        Times [s] of assembly and of factorization (including its memory forecast), and of the last
        solver by `factorize_at` ("expansion").

    Raises
    ------
    InputError
        Unknown group, support that selects nothing, cells without a material, element family that
        does not fit the mesh.
    """

    matrices: StructureMatrices
    # of the matrices, by `__getattr__`; their docstrings stand there
    mass: float
    dimensions: Box
    rigid_inertia: tuple[Inertia, Array] | None  # (inertia, M r for rigid motions r (rows, 6))

    seconds: dict[str, float]
    supports: tuple[Support, ...] = ()
    #: mesh, material and options of a structure of one mesh
    made_of: tuple[Mesh, Family | Mapping[str, Family], Options] | None = None
    #: (the solver of K + shift·M, shift [rad²/s²]) once it is made
    _factored: tuple[Solver, float] | None = None
    #: (solver, shift) of the last expansion point, a shift that `factorize_at` was given
    _expanded: tuple[Solver, float] | None = None
    _prestressed: antiosc.PrestressedState | None = None  # of `prestress`, once it is made

    @collective()
    def __init__(
        self,
        mesh: Mesh,
        material: Family | Mapping[str, Family],
        supports: Sequence[Support] = (),
        *,
        order: int = 2,
        attached: Sequence[Attachment] = (),
        solver: SolverChoice = "auto",
        prestress: Prestress | None = None,
    ) -> None:
        """Assemble the structure of a mesh."""
        start_time = clock()
        with finite_element_packages():
            from antiosc.fem.prestress.state import with_prestress
            from antiosc.fem.structure.meshed import assembled_part

        options = Options(order=order, attached=attached, solver=solver, prestress=prestress)
        matrices = assembled_part(
            mesh, material, supports, order=order, attached=attached, solver=solver
        )
        if prestress is not None:
            matrices = with_prestress(matrices, prestress)
        self._set_matrices(matrices, start_time)
        self.supports = tuple(matrices.supports)
        self.made_of = mesh, material, options

    @classmethod
    @collective(ALONE)
    def from_matrices(
        cls,
        K: Matrix,
        M: Matrix,
        *,
        C: Matrix | None = None,
        rigid_modes: ArrayLike | None = None,
        map: object = None,
        supports: Mapping[int, str | Sequence[str]] | None = None,
        backend: Backend = "auto",
    ) -> Structure:
        """A structure from the matrices of any finite-element code, supports already applied.

        Parameters
        ----------
        K, M : SciPy sparse, dense or PETSc matrix (n, n)
            Symmetric and positive semidefinite, in SI units. Diagonal entries of K above 1e14 times
            the rest of their rows, and 1e12 times the typical off-diagonal entry, are penalties:
            their dofs are fixed.
        C : matrix (n, n), optional
            Damping [N s/m], symmetric and positive semidefinite, of any strength: models contain
            it as a `DampingMatrix`.
        rigid_modes : array_like (n, r), optional
            A basis of K's null space; computed by default if K is singular.
        map : array_like or path, optional
            For each row of the matrices: node, dof (1 to 6), or node, dof, x, y, z in m; or a tuple
            of columns, (nodes, dofs) or (nodes, dofs, points), in which dofs may be "x" … "rz".
            Sites may then be nodes; with coordinates, `probe` and `write_series` give the motion
            of the nodes.
        supports : {node: "all" or names of dofs}, optional
            Additional fixed dofs: {12: "all", 7: ["x", "z"]}; needs a map.
        backend : "auto", "petsc" or "scipy"
            Library of the linear algebra. "auto" is PETSc if the finite-element packages are
            installed; "scipy" needs only NumPy and SciPy, and runs on one rank.
        """
        start_time = clock()
        choice("backend", backend, BACKENDS)
        pair = checked_matrix("K", K, backend), checked_matrix("M", M, backend)
        if map is not None and algebra.communicator(pair[0]).size > 1:
            raise InputError("matrices with a map must be on one rank, not spread over several.")
        rows = dof_map(map, None, algebra.size(pair[0]))
        damping = None if C is None else checked_matrix("C", C, backend)
        return cls._of_pair(pair, rows, supports, rigid_modes, start_time, damping)

    @classmethod
    @collective(ALONE)
    def from_files(
        cls,
        K: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
        M: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
        *,
        map: object = None,
        names: tuple[str, str] | None = None,
        supports: Mapping[int, str | Sequence[str]] | None = None,
        backend: Backend = "auto",
    ) -> Structure:
        """A structure from files of matrices that other programs write, supports already applied.

        Parameters
        ----------
        K, M : paths
            Matrix Market, Abaqus `*MATRIX GENERATE` (matrix input, labels or coordinate),
            Harwell–Boeing (Ansys HBMAT), Nastran OP4 (text or binary) or DMIG, Sierra/SD's text for
            MATLAB; recognised by their content. Both may be one file. SI units. Lists of files (and
            of maps) give several bodies, which share the dofs of nodes with the same number.
        map : array_like or path, optional
            As in `from_matrices`. A file may also have rows of row, node, dof, with names of dofs
            (UX), as Ansys's mapping files. Abaqus and DMIG files name nodes and dofs themselves;
            rows of node, x, y, z then add coordinates. For Sierra/SD: two files, (gid, ASetMap).
        names : (str, str), optional
            Names of K and M in OP4 and DMIG files that hold several matrices; default: the names
            that begin with K and M.
        supports, backend
            As in `from_matrices`.

        Raises
        ------
        InputError
            An unreadable file (the message gives line or byte); matrices that do not fit together.
        """
        start_time = clock()
        choice("backend", backend, BACKENDS)
        files: list[tuple[Any, Any, object]] = [(K, M, map)]

        if isinstance(K, list):
            maps = [None] * len(K) if map is None else map
            if not all(isinstance(each, list) and len(each) == len(K) for each in (M, maps)):
                raise InputError(f"K is a list of {len(K)}: M and map must be lists as long.")
            files = list(zip(K, cast(list[Any], M), cast(list[Any], maps), strict=True))

        bodies = []
        for stiffness, mass, of_rows in files:
            read = read_pair(stiffness, mass, names)
            rows = dof_map(of_rows, read.labels, read.K.shape[0])
            bodies.append((read.K, read.M, rows))

        stiffness, mass, rows = bodies[0] if len(bodies) == 1 else joined_bodies(bodies)
        pair = checked_matrix("K", stiffness, backend), checked_matrix("M", mass, backend)
        return cls._of_pair(pair, rows, supports, None, start_time)

    @classmethod
    def _of_pair(
        cls,
        pair: tuple[Matrix, Matrix],
        rows: DofMap | None,
        supports: Mapping[int, str | Sequence[str]] | None,
        rigid_modes: ArrayLike | None,
        start_time: float,
        damping: Matrix | None = None,
    ) -> Structure:
        """The structure of checked K, M and C; `start_time` [s]: time at which reading began."""
        matrices, factor = matrices_of_pair(*pair, rows, supports, rigid_modes, damping)
        self = structure_with(matrices, start_time)

        if factor is not None:  # it has shown that K is regular
            self._factored = factor, 0.0
            self.seconds["assembly"] -= factor.seconds
            self.seconds["factorization"] = factor.seconds

        return self

    def _set_matrices(self, matrices: StructureMatrices, start_time: float) -> None:
        """Set the attributes from matrices; `start_time` [s]: time at which assembly began."""
        self.matrices = matrices
        self.K = matrices.K
        self.M = matrices.M
        algebra.free_when_dropped(self.K, self.M)
        self.fixed = matrices.fixed
        self.rigid_modes = matrices.rigid_modes
        owned_fixed = int((self.fixed < self.rows).sum())
        self.dofs = self.size - self.comm.allreduce(owned_fixed)
        self.seconds = {"assembly": clock() - start_time}

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator that shares the matrices; `SERIAL` for SciPy matrices."""
        return algebra.communicator(self.K)

    @property
    def rows(self) -> int:
        """Number of rows of this rank, fixed dofs included."""
        return algebra.rows(self.K)

    @property
    def size(self) -> int:
        """Number of rows of all ranks, fixed dofs included."""
        return algebra.size(self.K)

    def factorize(self, columns: float = 1.0) -> Solver:
        """The one solver of K + shift·M that every site and every mode of this structure uses.

        The first call makes it, and later calls return it. `columns` is the number of right-hand
        sides of one solve; with inf the solver "auto" is a factor wherever it fits in memory. If a
        call requests more columns than the solver was chosen for, a solver is chosen anew.
        """
        columns = columns if checks.is_rigid(columns) else checks.positive("columns", columns)
        if self._factored is not None and self._factored[0].columns < columns:
            self._factored = None

        if self._factored is None:
            start_time = clock()
            with doing(f"factorization of {self.dofs} dofs"):
                factor, shift = self.matrices.factored(columns)
            self.seconds["factorization"] = clock() - start_time
            self._factored = factor, shift

        return self._factored[0]

    def factorize_at(self, shift: float, columns: float = 1.0) -> Solver:
        """A solver of K + shift·M for `columns` loads at once, `shift` > 0 in rad²/s². The last one
        is kept and returned for the same shift and no more columns."""
        shift = checks.positive("shift", shift, "rad²/s²")
        columns = columns if checks.is_rigid(columns) else checks.positive("columns", columns)

        kept = self._expanded
        if kept is not None and (kept[1] != shift or kept[0].columns < columns):
            kept = self._expanded = None  # there may be no room for two

        if kept is None:
            start_time = clock()
            with doing(f"factorization of {self.dofs} dofs"):
                kept = self._expanded = self.matrices.solver_of(shift, columns), shift
            self.seconds["expansion"] = clock() - start_time

        return kept[0]

    def drop_factor(self) -> None:
        """Free the memory of the factors; they are computed again when needed."""
        self._factored = self._expanded = None

    @property
    def shift(self) -> float:
        """s [rad²/s²] of the factored matrix K + sM; factorizes if rigid-body modes remain."""
        if not self.rigid_modes.shape[1]:
            return 0.0
        self.factorize()
        assert self._factored is not None
        return self._factored[1]

    def describe(self) -> str:
        """One line: the kind of model and its number of dofs."""
        return self.matrices.describe(self.dofs)

    def _facts(self) -> list[tuple[str, str]]:
        facts = [("of", self.describe())]
        if self.made_of is not None:
            facts.append(("supports", f"{len(self.supports)}"))
        with suppress(InputError):  # matrices do not know it
            facts.append(("mass", f"{self.mass:.6g} kg"))
        return facts

    @property
    def prestress(self) -> antiosc.PrestressedState | None:
        """The static state under its prestress; None without one."""
        if self._prestressed is None and self.matrices.preload is not None:
            self._prestressed = antiosc.PrestressedState(self)  # public, it reads a structure
        return self._prestressed

    def natural_modes(self, n: int = 10) -> antiosc.StructureModes:
        """The n lowest natural modes on its supports; see `antiosc.natural_modes`."""
        return antiosc.natural_modes(self, n)  # the public function, which reads a structure

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *dir(self.matrices)})

    def __getattr__(self, name: str) -> Any:
        """Other attributes of `matrices`, such as `parts` of a mesh or `layout` of an assembly."""
        if name == "matrices" or name.startswith("__"):
            raise AttributeError(name)
        try:
            return getattr(self.matrices, name)
        except AttributeError as error:
            raise AttributeError(f"the structure has no {name!r}: {error}") from None


NO_MESH = "matrices have no mesh: build the Structure from a mesh for this."


def structure_with(matrices: StructureMatrices, start_time: float) -> Structure:
    """A `Structure` with these matrices; `start_time` [s]: time at which assembly began."""
    self = object.__new__(Structure)
    self._set_matrices(matrices, start_time)
    return self


def with_parts(structure: Structure, otherwise: str = NO_MESH) -> PartsMatrices:
    """Matrices of a structure of meshed parts; InputError with `otherwise` if it has no mesh."""
    if not structure.matrices.meshed:
        raise InputError(otherwise)
    return cast("PartsMatrices", structure.matrices)


def on_mesh(structure: Structure, otherwise: str = NO_MESH) -> MeshedStructure:
    """The matrices of `structure` and their mesh; InputError with `otherwise` if it has none."""
    if structure.matrices.assembled:
        raise InputError("this takes a structure of one mesh; an assembly has one for each part.")
    return cast("MeshedStructure", with_parts(structure, otherwise))


def refuse_prestress(structure: Structure, what: str) -> None:
    """Raise InputError for a prestressed structure; `what` names the function that refuses it."""
    if structure.matrices.preload is not None:
        raise InputError(f"{what} does not take a prestress: leave it out.")


def refuse_dampers(structure: Structure, what: str) -> None:
    """Raise InputError for a structure with dampers; `what` names the refusing function."""
    if structure.matrices.dissipation() or structure.matrices.has_loss_factor:
        raise InputError(
            f"{what} takes no dampers, loss or prony: leave them out; extract without damping does."
        )
