"""`Structure`: K and M with supports, and the one factor of them that every site and mode uses.

Its `matrices` are those of a mesh (`antiosc.fem.structure.meshed`), which know their geometry, or
given ones. Extraction uses only their common attributes.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypedDict, cast

from numpy.typing import ArrayLike

import antiosc
from antiosc.base import checks
from antiosc.base._types import Array, Box, Matrix, SolverChoice
from antiosc.base.checks import choice
from antiosc.base.clock import clock
from antiosc.base.errors import InputError, finite_element_packages
from antiosc.base.progress import doing
from antiosc.base.texts import ReprMixin
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.platform import ALONE, collective
from antiosc.fem.structure import StructureMatrices
from antiosc.fem.structure.given_matrices import BACKENDS, Backend, copied, matrices_of_pair
from antiosc.io.matrices import DofMap, dof_map, read_pair, tied
from antiosc.models.motion import Inertia

if TYPE_CHECKING:
    from mpi4py import MPI

    from antiosc.fem.elements.weak_form import Family
    from antiosc.fem.mesh import Mesh
    from antiosc.fem.prestress import Prestress
    from antiosc.fem.structure.attachments import Attachment
    from antiosc.fem.structure.meshed import MeshedStructure
    from antiosc.fem.structure.support import Support


class Options(TypedDict):
    """Arguments of a `Structure` of a mesh other than its material and its supports."""

    order: int
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
        Solver for K: a Cholesky factor, or conjugate gradients with multigrid. "auto" is the
        faster one of those that fit in memory, by a forecast (`antiosc.fem.linalg.forecast`).
    prestress : Prestress, optional
        Permanent loads: spin, gravity, pressure, tensions, forces. K is the
        tangent stiffness of their static equilibrium.

    Attributes
    ----------
    prestress : PrestressedState or None
        Reserve to buckling, displacement and stress under the prestress.
    K, M : PETSc.Mat or scipy.sparse.csr_matrix
        Stiffness (N/m) and mass (kg). Fixed dofs keep their rows: 1 on K's diagonal, 0 in M.
        Those of 20 000 or more dofs of quadratic isotropic tetrahedra are of
        PETSc's type python: products are taken from the cells, entries are made by
        `petsc_algebra.with_entries`.
    dofs : int
        Dofs that are not fixed, on all ranks.
    fixed : ndarray of int
        Dofs of this rank that supports fix; for a mesh, ghosts included.
    supports : tuple of Support
    mass : float
        Total mass, kg.
    dimensions : (float, float, float)
        Length, width and thickness of the part, m, as `antiosc.strikes.advice` wants them.
    rigid_modes : ndarray (rows of this rank, r)
        M-orthonormal rigid-body modes that the supports permit.
    shift : float
        s of K + sM, the matrix that `factorize` factors, rad²/s²; 0 without rigid-body modes.
    matrices : StructureMatrices
        K and M with the data of their dofs.
    seconds : dict
        Times [s] of assembly and of factorization (its forecast of memory included).

    Raises
    ------
    InputError
        Unknown group, support that selects nothing, cells without a material, family and mesh
        that do not fit.
    """

    matrices: StructureMatrices
    # of the matrices, by `__getattr__`; their docstrings stand there
    mass: float
    dimensions: Box
    rigid_inertia: tuple[Inertia, Array] | None

    seconds: dict[str, float]
    supports: tuple[Support, ...] = ()
    #: mesh, material and options of a structure of one mesh
    made_of: tuple[Mesh, Family | Mapping[str, Family], Options] | None = None
    #: (the solver of K + shift·M, shift) once it is made
    _factored: tuple[Solver, float] | None = None
    #: the same of the last expansion point
    _expanded: tuple[Solver, float] | None = None
    _prestressed: antiosc.PrestressedState | None = None

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
            from antiosc.fem.structure.meshed import assembled
        options: Options = {
            "order": order, "attached": attached, "solver": solver, "prestress": prestress,
        }  # fmt: skip
        matrices = assembled(
            mesh, material, supports, order=order, attached=attached, solver=solver
        )
        if prestress is not None:
            matrices = with_prestress(matrices, prestress)
        self._hold(matrices, start_time)
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
            Symmetric; K positive semidefinite, M too. SI units. Penalties on K's diagonal, 1e14
            times the rest of their rows or more, become supports.
        C : matrix (n, n), optional
            Damping [N s/m], symmetric and positive semidefinite, however strong: models take it
            as a `DampingMatrix`.
        rigid_modes : array_like (n, r), optional
            A basis of K's null space; computed by default where K is singular.
        map : array_like or path, optional
            For each row of the matrices node, dof (1 to 6), or node, dof, x, y, z in m; or a tuple
            of columns, (nodes, dofs) or (nodes, dofs, points), with dofs "x" … "rz" too. With it
            sites are nodes, and with coordinates points and patches; `probe` and `write_series`
            give the motion of the nodes.
        supports : {node: "all" or names of dofs}, optional
            Additional fixed dofs: {12: "all", 7: ["x", "z"]}; needs a map.
        backend : "auto", "petsc" or "scipy"
            Library of the linear algebra. "auto" is PETSc where the finite-element packages are
            installed; "scipy" needs NumPy and SciPy alone, on one rank.
        """
        start_time = clock()
        choice("backend", backend, BACKENDS)
        pair = copied("K", K, backend), copied("M", M, backend)
        if map is not None and algebra.communicator(pair[0]).size > 1:
            raise InputError("matrices with a map must be on one rank, not spread over several.")
        rows = dof_map(map, None, algebra.size(pair[0]))
        damping = None if C is None else copied("C", C, backend)
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
            MATLAB; recognised by their content. Both may be one file. SI units. Lists of files, and
            of maps, are of several bodies, which share the dofs of nodes of the same number.
        map : array_like or path, optional
            As in `from_matrices`; a file may also have rows of row, node, dof, and name the dofs
            (UX), as Ansys's mapping files. Abaqus and DMIG files name nodes and dofs themselves:
            then rows of node, x, y, z add coordinates. Of Sierra/SD two files, (gid, ASetMap).
        names : (str, str), optional
            Names of K and M in OP4 and DMIG files that hold several matrices; by default the ones
            that begin with K and M.
        supports, backend
            As in `from_matrices`.

        Raises
        ------
        InputError
            A file that cannot be read, with its line or byte; matrices that do not fit together.
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

        stiffness, mass, rows = bodies[0] if len(bodies) == 1 else tied(bodies)
        pair = copied("K", stiffness, backend), copied("M", mass, backend)
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
        matrices, factor = matrices_of_pair(*pair, rows, supports, rigid_modes, damping)
        self = holding(matrices, start_time)
        if factor is not None:  # it has shown that K is regular
            self._factored = factor, 0.0
            self.seconds["assembly"] -= factor.seconds
            self.seconds["factorization"] = factor.seconds
        return self

    def _hold(self, matrices: StructureMatrices, start_time: float) -> None:
        """Set the attributes from matrices whose assembly began at the time `start_time`."""
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
        sides of one call; inf requires a direct factor. If a call asks for more columns than the
        solver was chosen for, a solver is chosen anew.
        """
        columns = columns if checks.is_rigid(columns) else checks.positive("columns", columns)
        if self._factored is not None and self._factored[0].columns < columns:
            self._factored = None
        if self._factored is None:
            start_time = clock()
            with doing(f"factorization of {self.dofs} dofs", self.comm.rank):
                factor, shift = self.matrices.factored(columns)
            self.seconds["factorization"] = clock() - start_time
            self._factored = factor, shift
        return self._factored[0]

    def factorize_at(self, shift: float, columns: float = 1.0) -> Solver:
        """A solver of K + shift·M [rad²/s²] for `columns` loads; the last one is kept."""
        shift = checks.positive("shift", shift, "rad²/s²")
        columns = columns if checks.is_rigid(columns) else checks.positive("columns", columns)
        if self._expanded is None or self._expanded[1] != shift:
            self._expanded = None  # there may be no room for two
            start_time = clock()
            with doing(f"factorization of {self.dofs} dofs", self.comm.rank):
                self._expanded = self.matrices.solver_of(shift, columns), shift
            self.seconds["expansion"] = clock() - start_time
        return self._expanded[0]

    def drop_factor(self) -> None:
        """Free the memory of the factors; they are computed again when needed."""
        self._factored = self._expanded = None

    @property
    def shift(self) -> float:
        """s of the factor of K + sM, rad²/s²; factorizes if rigid-body modes remain."""
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
        """Other attributes of the matrices: those of a mesh have `parts` and `layout`, too."""
        if name == "matrices" or name.startswith("__"):
            raise AttributeError(name)
        try:
            return getattr(self.matrices, name)
        except AttributeError as error:
            raise AttributeError(f"the structure has no {name!r}: {error}") from None


NO_MESH = "matrices have no mesh: build the Structure from a mesh for this."


def holding(matrices: StructureMatrices, start_time: float) -> Structure:
    """The structure of matrices whose assembly began at the time `start_time`."""
    self = object.__new__(Structure)
    self._hold(matrices, start_time)
    return self


def on_mesh(structure: Structure, otherwise: str = NO_MESH) -> MeshedStructure:
    """The matrices of `structure` with their mesh; without one InputError says `otherwise`."""
    if structure.matrices.assembled:
        raise InputError("this takes a structure of one mesh; an assembly has one for each part.")
    if not structure.matrices.meshed:
        raise InputError(otherwise)
    return cast("MeshedStructure", structure.matrices)


def refuse_prestress(structure: Structure, what: str) -> None:
    """InputError for a prestressed structure, which the function `what` does not support."""
    if structure.matrices.preload is not None:
        raise InputError(
            f"{what} does not take a structure with a prestress: leave prestress out of it."
        )


def refuse_dampers(structure: Structure, what: str) -> None:
    """InputError for a structure with dampers, which the function `what` does not support."""
    if structure.matrices.dissipation() or structure.matrices.lossy:
        raise InputError(
            f"{what} does not take dampers, nor materials with loss or prony: leave them out;"
            " extract takes them, without damping."
        )
