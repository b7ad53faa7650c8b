"""K and M with their supports applied, the data of their dofs, and the null vectors of K.

Inverse iteration finds the null vectors of a singular K, which are the strain-free motions, and the
lowest elastic ω², from which the shift that makes K + shift M regular is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, ClassVar, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array, Box, IntArray, Matrix, SolverChoice
from antiosc.base.checks import Checked, checked_by, coordinates, floats, number, shown
from antiosc.base.errors import AccuracyError, AntioscError, InputError, NotConvergedError
from antiosc.engine.damping import DampingMatrix, from_factors
from antiosc.fem.linalg import algebra, solver_for
from antiosc.fem.linalg.algebra import (
    communicator,
    diagonal_roots,
    dot,
    energy_ratios,
    force_ratios,
    multiply,
    norm,
    norms,
    sum_of,
    typical_eigenvalue,
    uses_strains,
)
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.prestress import Preload
from antiosc.io.matrices import DofMap
from antiosc.models.motion import Inertia

if TYPE_CHECKING:
    from mpi4py import MPI


def in_space(point: ArrayLike) -> Array:
    """The point with three coordinates; z = 0 if it has two."""
    x = np.asarray(point, dtype=float)
    return np.pad(x, (0, 3 - len(x)))


def _checked_point(name: str, value: object) -> tuple[float, ...]:
    """Two or three checked coordinates as three; z = 0 if it is missing."""
    return tuple(in_space(coordinates(name, value)).tolist())


def checked_axis(name: str, value: object) -> tuple[float, ...]:
    """A direction of three numbers, of any length; InputError for the zero vector."""
    axis = floats(name, value, (3,))
    if not np.linalg.norm(axis):
        raise InputError(f"{name} must not be the zero vector.")
    return tuple(axis.tolist())


def _checked_angle(name: str, value: object) -> float:
    """`value` as an angle [rad]; InputError beyond one turn: degrees are probably meant."""
    angle = number(name, value, "rad")
    if abs(angle) > 2 * np.pi * (1 + 1e-9):
        raise InputError(
            f"{name} = {angle:g} rad is more than a turn (6.283 rad): angles are in radians; if "
            f"degrees are meant, give {np.deg2rad(angle):.6g}."
        )

    return angle


@dataclass(frozen=True)
class Placement(Checked):
    """A rotation about an axis, then a translation: x → c + R (x − c) + shift.

    Parameters
    ----------
    shift : sequence of 2 or 3 floats
        Translation, m.
    axis : sequence of 3 floats
        Direction of the axis of rotation.
    angle : float
        Angle of the rotation, rad, at most one turn; positive by the right-hand rule.
    about : sequence of 2 or 3 floats
        The point c on the axis of rotation, m.
    """

    shift: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_checked_point))
    axis: Sequence[float] = field(default=(0.0, 0.0, 1.0), metadata=checked_by(checked_axis))
    angle: float = field(default=0.0, metadata=checked_by(_checked_angle))
    about: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_checked_point))

    @property
    def rotation(self) -> Array:
        """R (3, 3), by Rodrigues' formula; exact for quarter turns about a coordinate axis."""
        unit = np.array(self.axis) / np.linalg.norm(self.axis)
        cross = skew(unit)
        sine = np.sin(self.angle)
        cosine = np.cos(self.angle)
        R = np.eye(3) + sine * cross + (1 - cosine) * cross @ cross
        rounded = np.round(R)
        return rounded if np.abs(R - rounded).max() < 1e-15 else R

    def placed(self, x: Array) -> Array:
        """Coordinates (n, 3) in the assembly's axes of points (n, 3) in the part's axes."""
        centre = np.array(self.about)
        return centre + (x - centre) @ self.rotation.T + self.shift

    def own(self, x: Array) -> Array:
        """Coordinates (n, 3) in the part's axes of points (n, 3) in the assembly's axes."""
        centre = np.array(self.about)
        return centre + (x - self.shift - centre) @ self.rotation


def skew(a: Array) -> Array:
    """The matrix (3, 3) with skew(a) b = a × b; (n, 3, 3) for vectors (n, 3)."""
    a = np.asarray(a, dtype=float)
    zero = np.zeros(a.shape[:-1])
    x = a[..., 0]
    y = a[..., 1]
    z = a[..., 2]
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def perpendiculars(units: Array) -> Array:
    """Two perpendicular unit vectors (n, 2, 3) normal to each unit vector (n, 3)."""
    first = np.cross(units, np.eye(3)[np.abs(units).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(units, first)], axis=1)


#: What a dof is: the amplitude of a mode, a displacement or a rotation.
AMPLITUDE = 0
MOVE = 1
TURN = 2


@dataclass(frozen=True, eq=False)
class DofPlaces:
    """Node, direction and kind of each of n dofs: of a mesh, a superelement or an assembly."""

    nodes: Array  # (N, 3) coordinates of the nodes [m]
    node: IntArray  # (n,) row in `nodes` of the node of each dof
    axes: Array  # (n, 3) unit direction of each dof; zero for amplitudes
    kind: IntArray  # (n,) AMPLITUDE, MOVE or TURN

    @classmethod
    def joined(cls, several: Sequence[DofPlaces]) -> DofPlaces:
        """The dofs of several bodies, concatenated."""
        starts = np.cumsum([0, *(len(places.nodes) for places in several)])
        nodes = [places.node + k for places, k in zip(several, starts[:-1], strict=True)]
        return cls(
            np.vstack([places.nodes for places in several]),
            np.concatenate(nodes),
            np.vstack([places.axes for places in several]),
            np.concatenate([places.kind for places in several]),
        )

    @property
    def points(self) -> Array:
        """Coordinates (n, 3) of the node of each dof [m]."""
        return self.nodes[self.node]

    def placed(self, at: Placement) -> DofPlaces:
        """The dofs after the body is moved to its placement."""
        return replace(self, nodes=at.placed(self.nodes), axes=self.axes @ at.rotation.T)

    def rigid_motions(self, centre: Array, rows: IntArray | slice = slice(None)) -> Array:
        """Unit translations along x, y, z and unit rotations about `centre` (3,) [m]: (dofs, 6), of
        the dofs `rows`; 0 for amplitudes."""
        axes = self.axes[rows]
        is_translation = self.kind[rows] == MOVE
        arms = self.nodes[self.node[rows][is_translation]] - centre
        result = np.zeros((len(axes), 6))
        result[is_translation, :3] = axes[is_translation]
        result[is_translation, 3:] = np.cross(arms, axes[is_translation])
        result[~is_translation, 3:] = axes[~is_translation]
        return result

    def polynomials(self, comm: MPI.Comm, centre: Array, size: float) -> Array:
        """Displacement fields (dofs, k) of degree <= 2 in (x − `centre`)/`size`, along all axes of
        displacements; rotations are half their curl. `centre` (3,), `size`: m."""
        s = (self.nodes - centre) / size
        axes = np.flatnonzero(comm.allreduce(self.axes[self.kind == MOVE].any(axis=0)))
        powers: list[tuple[int, ...]] = [(), *((j,) for j in axes)]
        powers += [(j, k) for j in axes for k in axes[axes >= j]]
        result = np.empty((len(self.kind), len(axes) * len(powers)), order="F")

        is_rotation = self.kind == TURN
        for column, (axis, factors) in zip(result.T, product(axes, powers), strict=True):
            direction = np.eye(3)[axis]
            gradient = np.zeros((len(s), 3))
            for place, other in enumerate(factors):
                rest = [*factors[:place], *factors[place + 1 :]]
                gradient[:, other] += np.prod(s[:, rest], axis=1)

            column[:] = self.axes[:, axis] * np.prod(s[:, list(factors)], axis=1)[self.node]
            rotation = np.cross(gradient, direction) / (2 * size)
            turned = np.einsum("nc,nc->n", self.axes, rotation[self.node])
            column[is_rotation] = turned[is_rotation]

        return result


def checked_placement(name: str, at: Placement | Sequence[float] | None) -> Placement:
    """`at` as a Placement of the part `name`; 2 or 3 numbers are a translation, None is none."""
    if at is None:
        return Placement()
    if isinstance(at, Placement):
        return at

    try:
        return Placement(shift=at)
    except InputError as error:
        raise InputError(
            f"at[{name!r}] must be a translation (x, y, z) in m or a Placement; got {shown(at)}."
        ) from error


#: Negative eigenvalues of a damping matrix over the largest that are rounding.
NEGATIVE_SHARE = 1e-8
#: Eigenvalues of a projected matrix over the largest that are rounding.
LEAST_EIGENVALUE = 1e-14


@dataclass(frozen=True, eq=False)
class Dissipation:
    """One term Gᵀ c G of the damping matrix, or one Maxwell branch."""

    G: Matrix = None  # (j, rows of this rank) functionals; None: `matrix` stands for Gᵀ c G
    c: Array | None = None  # (j, j) [N s/m], or of a branch [N/m]
    tau: float | None = None  # relaxation time [s] of a branch; None: dashpots
    matrix: Matrix | None = None  # of all dofs; `factor` times it is the term
    factor: float = 1.0  # of a relaxing material: share of its stiffness `matrix` that relaxes
    #: of a relaxing material: (part, index of the material in its `parts` or stiffener's group)
    owner: tuple[str, int | str] | None = None

    def projected(self, comm: MPI.Comm, V: Array) -> Array:
        """L (r, k) with LᵀL = Vᵀ C V for motions V (rows of this rank, k); C: this term."""
        if self.matrix is None:
            assert self.c is not None
            return np.asarray(_square_root(self.c) @ comm.allreduce(np.asarray(self.G @ V)))
        return _square_root(self.factor * dot(comm, V, multiply(self.matrix, V)))


def _square_root(matrix: Array) -> Array:
    """L with LᵀL = `matrix`, which is positive semidefinite."""
    symmetric = (matrix + matrix.T) / 2
    ends = np.linalg.eigvalsh(symmetric)
    if ends.min(initial=0.0) < -NEGATIVE_SHARE * ends.max(initial=0.0):
        raise InputError("C must be positive semidefinite, and has a negative eigenvalue.")

    diagonal = matrix.diagonal()
    floor = max(LEAST_EIGENVALUE * float(diagonal.max(initial=0.0)), float(np.finfo(float).tiny))
    scale = np.sqrt(np.maximum(diagonal, floor))  # what lies below is rounding
    values, vectors = np.linalg.eigh(symmetric / np.outer(scale, scale))
    is_positive = values > LEAST_EIGENVALUE * values.max(initial=0.0)
    return np.asarray((vectors[:, is_positive] * np.sqrt(values[is_positive])).T * scale)


def dashpot_patterns(terms: Sequence[Dissipation]) -> Array | None:
    """Force patterns Gᵀ (rows of this rank, k) of dashpots and Maxwell branches; None without."""
    loads = [np.asarray(term.G.T.toarray()) for term in terms if term.matrix is None]
    return np.hstack(loads) if loads else None


def projected(comm: MPI.Comm, terms: Sequence[Dissipation], V: Array) -> DampingMatrix:
    """The damping matrix VᵀCV of all `terms` for the motions V (rows of this rank, k)."""
    no_terms = np.zeros((0, V.shape[1]))
    factors = [(term.projected(comm, V), term.tau) for term in terms]
    viscous = np.vstack([no_terms, *(L for L, tau in factors if tau is None)])
    return from_factors(viscous, [(L, tau) for L, tau in factors if tau is not None])


#: Force or energy of rigid r over that of the entries; rounding leaves about 1e-16.
RIGID_FORCE = 1e-11
#: Shift over the estimate of the first elastic ω²: modes converge fast, A stays well conditioned.
SHIFT_RATIO = 0.1
#: Share of a vector outside the span of others, below which it adds nothing; rounding: 1e-16.
INDEPENDENT_SHARE = 1e-12
#: Message for matrices that cannot belong to a structure.
INDEFINITE_MESSAGE = (
    "K must be positive semidefinite, and no massless dof may move freely: {}; check the supports "
    "and the signs, that no penalty exceeds 1e8 times the usual entries, and that the load in K "
    "is below buckling."
)
#: Steps of refinement of K's null vectors, whose error is rounding of solves, each a tenth of it.
REFINEMENT_STEPS = 4
#: A shift is replaced if a closer one is below this share of it: Krylov spaces converge slowly.
SHIFT_EXCESS = 0.1


def modes_and_shift(
    K: Matrix, M: Matrix, null_vectors: Array | None
) -> tuple[Array, float, Solver | None]:
    """(M-orthonormal null vectors of K (rows, r), shift [rad²/s²], solver of K or None).

    A regular K gives (r = 0, shift 0, its solver), a singular one the shift 0.1 × first elastic ω²
    and None. `null_vectors` (rows, r): a basis of the null space; None: it is not known. InputError
    for an indefinite K, and if `null_vectors` are not as many as K has.
    """
    comm = communicator(K)
    n = algebra.rows(K)
    regular = _solver_unless_singular(comm, K) if null_vectors is None else None
    if regular is not None:
        return np.zeros((n, 0)), 0.0, regular

    # inverse iteration far below the top of the spectrum, then from the elastic value it finds
    shift = 1e-7 * typical_eigenvalue(K, M)
    rng = np.random.default_rng(comm.rank)
    block = (
        rng.standard_normal((n, 12))
        if null_vectors is None
        else np.hstack([null_vectors, rng.standard_normal((n, 6))])
    )

    values = np.zeros(0)
    for _ in range(2):
        try:
            factor = _solver(sum_of(K, shift, M))
        except NotConvergedError as error:
            raise InputError(
                INDEFINITE_MESSAGE.format(f"K + {shift:.1e} M rad²/s² has no Cholesky factor")
            ) from error

        for _ in range(8):
            block = orthonormal_basis(comm, M, block)
            block = np.column_stack([factor.solve(c) for c in multiply(M, block).T])
        block = orthonormal_basis(comm, M, block)
        values, rotation = np.linalg.eigh(dot(comm, block, multiply(K, block)))
        block = block @ rotation
        zero = np.abs(energy_ratios(K, block)) < _rigid_energy_limit(K)
        if zero.all():
            raise InputError(
                f"K has {len(values)} or more null vectors: the matrices hold several loose bodies."
            )
        lowest = float(values[~zero].min())
        if lowest <= np.finfo(float).eps * values[-1]:
            raise InputError(
                INDEFINITE_MESSAGE.format(f"xᵀK x/xᵀM x = {lowest:.1e} rad²/s² for some x")
            )
        shift = SHIFT_RATIO * lowest

    null_space = block[:, zero]
    if null_vectors is not None and null_vectors.shape[1] != null_space.shape[1]:
        raise InputError(
            f"rigid_modes has {null_vectors.shape[1]} columns, K {null_space.shape[1]} null"
            " vectors."
        )

    for _ in range(REFINEMENT_STEPS):
        null_space = null_space - factor.solve_block(multiply(K, null_space))

    return orthonormal_basis(comm, M, null_space), shift, None


def _solver_unless_singular(comm: MPI.Comm, K: Matrix) -> Solver | None:
    """A solver of K; None if a failing factorization or a large solution shows K singular."""
    n = algebra.rows(K)

    try:
        factor = _solver(K)
        x = np.random.default_rng(comm.rank).standard_normal(n)
        for _ in range(3):
            x = factor.solve_checked(x / norm(comm, x))
    except AntioscError:
        return None

    (ratio,) = energy_ratios(K, x[:, None])
    return None if ratio < _rigid_energy_limit(K) * 1e-3 else factor


def _rigid_energy_limit(K: Matrix) -> float:
    """Largest xᵀKx/xᵀDx, D = diag(K), of a rigid motion x; smaller if K x is from strains."""
    return RIGID_FORCE**2 if uses_strains(K) else RIGID_FORCE


def _solver(A: Matrix) -> Solver:
    """A solver of A for inverse iteration, without rigid motions or a coarser space."""
    return solver_for(A, "auto", lambda: np.zeros((algebra.rows(A), 0)))


def orthonormal_basis(comm: MPI.Comm, M: Matrix, block: Array, into: Array | None = None) -> Array:
    """M-orthonormal basis (rows, r) of the columns of `block` (rows, k), in `into` if given."""
    basis = np.empty(block.shape, order="F") if into is None else into
    count = 0
    for column in block.T:
        load = multiply(M, column)
        size = np.sqrt(max(float(dot(comm, column, load)), 0.0))  # by round-off below 0
        for _ in range(2 if count else 0):  # twice is enough (Kahan)
            column = column - basis[:, :count] @ dot(comm, basis[:, :count], load)
            load = multiply(M, column)
        remaining = np.sqrt(max(float(dot(comm, column, load)), 0.0))
        if remaining > INDEPENDENT_SHARE * size:
            basis[:, count] = column / remaining
            count += 1

    return basis[:, :count]


def closer_shift(factor: Solver, K: Matrix, M: Matrix, motions: Array) -> float:
    """Shift [rad²/s²]: 0.1 × first elastic ω², by inverse iteration; inf if all is rigid. `factor`:
    solver of K + s M at some s > 0; `motions` (rows, r): M-orthonormal rigid motions. AccuracyError
    if rounding hides the first elastic ω²."""
    comm = factor.comm
    x = np.random.default_rng(comm.rank).standard_normal((len(motions), 3))

    blocks = []
    for _ in range(4):
        x = factor.solve_block(multiply(M, x))
        x = orthonormal_basis(comm, M, x - motions @ dot(comm, motions, multiply(M, x)))
        blocks.append(x)

    # a small structure exhausts the blocks: what rounding leaves of them must not be rigid
    basis = orthonormal_basis(comm, M, np.hstack([motions, *blocks]))[:, motions.shape[1] :]
    if not basis.shape[1]:  # all motions are rigid
        return float("inf")

    values, rotation = np.linalg.eigh(dot(comm, basis, multiply(K, basis)))

    # xᵀK x is a sum of terms of the size of xᵀD x, known to ε of that.
    softest = basis @ rotation[:, :1]
    cancelled = (
        0.0 if uses_strains(K) else norms(comm, diagonal_roots(K)[:, None] * softest)[0] ** 2
    )

    rounding = np.finfo(float).eps * (cancelled + values[-1])
    if values[0] <= rounding:
        raise AccuracyError(
            f"the lowest elastic ω² = {values[0]:.1e} ± {rounding:.1e} rad²/s² is hidden by "
            "rounding: join parts along faces, not by a hinge or a point, or use fewer elements."
        )

    return SHIFT_RATIO * float(values[0])


#: Most times that the shift of a free body is brought closer to its first elastic ω².
MOST_SHIFT_STEPS = 6


class Plausibility(TypedDict, total=False):
    """Doubts as sentences, largest bar wave speed [m/s] and least thickness [m] of a part."""

    doubts: list[str]
    wave_speed: float
    thickness: float


@dataclass(eq=False)
class StructureMatrices:
    """K and M of a structure; subclasses add data of a mesh or of nodes."""

    #: fixed dofs keep their rows: 1 on K's diagonal, 0 in M
    K: Matrix
    M: Matrix
    #: local numbers of the dofs that the supports hold; of a mesh, ghosts included; of an assembly
    #: also those that joints make dependent
    fixed: IntArray
    #: M-orthonormal rigid-body modes that the supports leave (rows of this rank, r)
    rigid_modes: Array
    #: first estimate of the shift s of K + sM, rad²/s²; 0 without rigid-body modes
    first_shift: float
    solver: SolverChoice = "auto"  # for K + sM
    C: Matrix | None = field(default=None, kw_only=True)  # damping [N s/m], of given matrices
    #: the static state at which K is the tangent stiffness; None: no prestress
    preload: Preload | None = field(default=None, kw_only=True)
    #: a solver of this K, if one exists already
    solver_of_K: Solver | None = field(default=None, kw_only=True)

    #: whether the matrices are of parts with meshes, and whether of an assembly of parts
    meshed: ClassVar[bool] = False
    assembled: ClassVar[bool] = False
    #: whether the node and direction of each row are known
    nodal: ClassVar[bool] = False

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator that shares the matrices; `SERIAL` for SciPy matrices."""
        return communicator(self.K)

    @property
    def has_loss_factor(self) -> bool:
        """Whether a material has a loss factor."""
        return False

    @property
    def plausibility(self) -> Plausibility:
        """Data that models keep, for checks whether an impact is plausible."""
        return {}

    @property
    def located(self) -> bool:
        """Whether K and M come without a mesh but with coordinates of their nodes."""
        return False

    @property
    def rigid_motions(self) -> Array:
        """Rigid-body motions (rows, r) of the unsupported body; r = 0 if they are not known."""
        return np.zeros((algebra.rows(self.K), 0))

    def prolongation(self) -> Matrix | None:
        """Interpolation matrix from a coarser space to the dofs; None if there is none."""
        return None

    def factored(self, columns: float = 1.0) -> tuple[Solver, float]:
        """(solver of K + sM, s), s: about 0.1 × first elastic ω²; 0 without rigid-body modes."""
        shift = self.first_shift
        if self.solver_of_K is not None:
            factor, self.solver_of_K = self.solver_of_K, None  # held by one alone
            return factor, shift

        factor = self.solver_of(shift, columns)
        for _ in range(MOST_SHIFT_STEPS if self.rigid_modes.shape[1] else 0):
            new_shift = closer_shift(factor, self.K, self.M, self.rigid_modes)
            if new_shift >= SHIFT_EXCESS * shift:
                break
            shift = new_shift
            del factor  # there may be no room for two
            factor = self.solver_of(shift, columns)

        return factor, shift

    def solver_of(self, shift: float, columns: float) -> Solver:
        """A solver of K + shift·M for `columns` right-hand sides at once; `shift` in rad²/s²."""
        A = algebra.sum_of(self.K, shift, self.M)
        algebra.free_when_dropped(A)
        return solver_for(A, self.solver, lambda: self.rigid_motions, self.prolongation, columns)

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        raise InputError("matrices do not tell the total mass; build the Structure from a mesh.")

    @property
    def dimensions(self) -> Box:
        """Length, width and thickness of the part, m, from its box, sheets and sections."""
        raise InputError("matrices have no dimensions: give length, width and thickness.")

    def constants(self) -> tuple[float, float, float]:
        """(E [Pa], nu, rho [kg/m³]) of the first material; InputError if it is anisotropic."""
        raise InputError("matrices have no material: give E, nu and rho.")

    def uniform_inertia(self, direction: Array) -> Array | None:
        """M e (rows,) of the translation e by the vector `direction` (3,); None if the mass of some
        dofs is not known."""
        floats("direction", direction, (3,))
        return None

    @property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:
        """(inertia, M r (rows, 6) for rigid motions r) of a body with rigid-body modes; None for
        others, and if the mass of some dofs is not known."""
        return None

    def dissipation(self) -> list[Dissipation]:
        """Damping terms of dashpots, Maxwell branches and relaxing materials."""
        return [] if self.C is None else [Dissipation(matrix=self.C)]

    def loss_stiffness(self, V: Array) -> Array | None:
        """Σ η VᵀKV (k, k) over the materials with loss factors η, for motions V (rows of this rank,
        k); None without loss factors."""
        return None

    @property
    def prestress_text(self) -> str:
        """Text on the prestress, after a comma, for descriptions; "" without one."""
        return "" if self.preload is None else f", {self.preload.words}"

    def describe(self, dofs: int) -> str:
        """One line: the kind of model and its number of dofs."""
        return f"given matrices, {dofs} dofs"


#: Digits of coordinates in a file, as a share of the part's size: motions are rigid up to them.
COORDINATE_ROUNDING = 1e-4


@dataclass(eq=False)
class NodalMatrices(StructureMatrices):
    """K and M from another program, with the node and direction of each row."""

    map: DofMap = field(kw_only=True)  # of the n rows of K and M

    nodal: ClassVar[bool] = True

    @property
    def located(self) -> bool:
        return self.map.located

    def nodes(self) -> tuple[Array, IntArray]:
        """(coordinates (P, 3), rows (P, 3) of x, y, z, -1 if missing) of nodes with coordinates."""
        valid = np.isfinite(self.map.points).all(axis=1)
        _, first, index = np.unique(self.map.node[valid], return_index=True, return_inverse=True)
        located = np.flatnonzero(valid)
        rows = np.full((len(first), 3), -1)
        for axis in range(3):
            on_axis = self.map.component[located] == axis + 1
            rows[index.ravel()[on_axis], axis] = located[on_axis]

        return self.map.points[located[first]], rows

    @property
    def places(self) -> DofPlaces:
        """Node, direction and kind of each row; AMPLITUDE without coordinates or direction."""
        component = self.map.component
        points = self.map.points
        located = np.isfinite(points).all(axis=1)
        kind = np.where(component > 3, TURN, MOVE)
        kind[~located | (component < 1) | (component > 6)] = AMPLITUDE
        nodes = np.where(located[:, None], points, points[located].mean(axis=0))
        axes = np.where(kind[:, None] != AMPLITUDE, np.eye(3)[(component - 1) % 3], 0.0)
        return DofPlaces(nodes, np.arange(len(nodes)), axes, kind)

    @cached_property
    def _motions(self) -> tuple[Array, Array] | None:
        """(reference point (3,) [m], rigid motions r (rows, 6)); None unless K r = 0, and if a row
        lacks direction or coordinates."""
        component = self.map.component
        points = self.map.points
        is_motion = (component >= 1) & (component <= 6)
        if not self.rigid_modes.shape[1] or not is_motion.all() or not np.isfinite(points).all():
            return None
        point = (points.min(axis=0) + points.max(axis=0)) / 2
        motions = self.places.rigid_motions(point)
        is_possible = motions.any(axis=0)
        forces = force_ratios(self.K, motions[:, is_possible])
        limits = np.where(np.flatnonzero(is_possible) < 3, RIGID_FORCE**0.5, COORDINATE_ROUNDING)
        return (point, motions) if (forces < limits).all() else None

    @property
    def mass(self) -> float:
        inertia = self.rigid_inertia
        if inertia is None:
            raise InputError(
                "the total mass is known only of free bodies with coordinates: matrices lack the"
                " mass of fixed dofs."
            )

        return inertia[0].mass

    def uniform_inertia(self, direction: Array) -> Array | None:
        direction = floats("direction", direction, (3,))
        inertia = self.rigid_inertia
        return None if inertia is None else np.asarray(inertia[1][:, :3] @ direction)

    @cached_property
    def rigid_inertia(self) -> tuple[Inertia, Array] | None:  # type: ignore[override]
        if self._motions is None:
            return None
        point, motions = self._motions
        loads = multiply(self.M, motions)
        S = motions.T @ loads
        return Inertia(point, (S + S.T) / 2, np.zeros((0, 6))), loads

    def describe(self, dofs: int) -> str:
        return f"given matrices, {len(np.unique(self.map.node))} nodes, {dofs} dofs"
