"""Rigid-body modes that the supports permit, and the shift that makes a singular K factorable.

On a mesh both come from polynomial displacement fields (with half their curl as the rotations
of beams and shells): the rigid motions among them that vanish on the fixed dofs are exact null
vectors of K, and the lowest Rayleigh–Ritz value of the quadratic ones is of the order of the first
elastic ω², from which the shift is taken. For given matrices inverse iteration is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from antiosc._types import Array, IntArray
from antiosc.errors import AccuracyError, AntioscError, InputError, NotConvergedError
from antiosc.fem import compat
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.linalg.scaling import force_ratios, frequency, norms, roots, softness
from antiosc.fem.linalg.solver_choice import solver_for
from antiosc.fem.linalg.solvers import Solver, by_strains, dot, multiply, norm, sum_of
from antiosc.fem.mpi import bounds

#: scaled coordinates (n, 3) -> (displacement (3, n), rotation (3, n))
_Field = Callable[[Array], tuple[Array, Array]]

#: Force or energy of r over that of the entries (`antiosc.fem.linalg.scaling`) below which r counts
#: as a rigid-body mode; rounding leaves about 1e-16.
RIGID_FORCE = 1e-11
#: Share of a field's square on the fixed dofs below which it vanishes there; rounding: 1e-16.
VANISHING = 1e-13
#: Shift over the estimate of the first elastic ω²: modes converge fast, A stays well conditioned.
SHIFT = 0.1
#: Share of a field that is left without its rigid part, above which it strains; rounding: 1e-15.
STRAINING_SHARE = 1e-9
#: Share of a vector outside the span of others, below which it adds nothing; rounding: 1e-16.
SPANNED = 1e-12
#: Message for matrices that cannot belong to a structure.
INDEFINITE = (
    "K must be positive semidefinite, and no massless dof may move freely: {}; check the supports "
    "and the signs, that no penalty exceeds 1e8 times the usual entries, and that the load in K "
    "is below buckling."
)
#: Share of the largest of some eigenvalues below which rounding makes them up.
DROWNED = 1e-14
#: A first shift that is more than this too high is replaced: Krylov spaces then converge slowly.
FAR = 0.1


def of_mesh(
    form: WeakForm, fixed: IntArray, K: PETSc.Mat, M: PETSc.Mat, springs: Array
) -> tuple[Array, float]:
    """(M-orthonormal rigid-body modes (rows of this rank, r), shift in rad²/s²).

    `springs` (rows of this rank, k): columns b whose motions bᵀu grounded springs hold.
    """
    comm: MPI.Comm = K.getComm().tompi4py()
    fields, n_rigid = _fields(form, comm)
    motions = _vanishing(comm, fields[:, :n_rigid], fixed, springs)
    motions = orthonormal(comm, M, motions)
    if not motions.shape[1]:
        return motions, 0.0
    left = force_ratios(K, motions, multiply(K, motions)).max()
    if left > RIGID_FORCE:
        raise AccuracyError(
            f"a rigid motion strains the structure: ‖K r‖/(‖K‖‖r‖) = {left:.1e} (expected from "
            "rounding: 1e-16); the mesh or the element order cannot represent rigid motions, or a "
            "spring is so stiff that it should be a Support."
        )
    fields = _vanishing(comm, fields, fixed, springs)
    return motions, SHIFT * _first_elastic(comm, K, M, fields, motions)


def motions(form: WeakForm, K: PETSc.Mat) -> Array:
    """Rigid-body motions of the unsupported body (rows of this rank, r)."""
    fields, rigid_count = _fields(form, K.getComm().tompi4py())
    return fields[:, :rigid_count]


def about(form: WeakForm, point: Array) -> Array:
    """The six rigid motions of the unsupported body (rows of this rank, 6).

    Unit translations along x, y and z, unit rotations about the axes through `point` (3,) [m]; a
    plane structure has zeros where it cannot move.
    """
    result = np.zeros((compat.local_size(form.space), 6))
    plane = "z" not in form.components
    for name, path in form.components.items():
        dofs, x = compat.dof_coordinates(form.space, path)
        mine = dofs < len(result)
        axis = "xyz".index(name[-1])
        for motion in (0, 1, 5) if plane else range(6):
            turn = np.eye(3)[motion - 3] if motion > 2 else np.zeros(3)
            if name.startswith("r"):
                result[dofs[mine], motion] = turn[axis]
            elif motion > 2:
                result[dofs[mine], motion] = np.cross(turn, x[mine] - point)[:, axis]
            else:
                result[dofs[mine], motion] = float(axis == motion)
    return result


def of_matrices(K: PETSc.Mat, M: PETSc.Mat, given: Array | None) -> tuple[Array, float]:
    """The same for matrices without a mesh; `given` is a basis of K's null space, if known."""
    comm: MPI.Comm = K.getComm().tompi4py()
    n = K.getLocalSize()[0]
    if given is None and not _singular(comm, K):
        return np.zeros((n, 0)), 0.0
    # Block inverse iteration, first far below the top of the spectrum; then again from the
    # elastic value that it finds, so that the shift sits where the modes are.
    shift = 1e-7 * frequency(K, M)
    rng = np.random.default_rng(comm.rank)
    block = (
        rng.standard_normal((n, 12))
        if given is None
        else np.hstack([given, rng.standard_normal((n, 6))])
    )
    values = np.zeros(0)
    for _ in range(2):
        factor = _positive(K, shift, M)
        for _ in range(8):
            block = orthonormal(comm, M, block)
            block = np.column_stack([factor.solve(c) for c in multiply(M, block).T])
        block = orthonormal(comm, M, block)
        values, turn = np.linalg.eigh(dot(comm, block, multiply(K, block)))
        block = block @ turn
        zero = np.abs(softness(K, block, multiply(K, block))) < _rigid(K)
        if zero.all():
            raise InputError(
                f"K has {len(values)} or more null vectors: the matrices hold several loose bodies."
            )
        lowest = float(values[~zero].min())
        if lowest <= np.finfo(float).eps * values[-1]:
            raise InputError(INDEFINITE.format(f"xᵀK x/xᵀM x = {lowest:.1e} rad²/s² for some x"))
        shift = SHIFT * lowest
    found = block[:, zero]
    if given is not None and given.shape[1] != found.shape[1]:
        raise InputError(
            f"rigid_modes has {given.shape[1]} columns but K has {found.shape[1]} null vectors."
        )
    return orthonormal(comm, M, found), shift


def _singular(comm: MPI.Comm, K: PETSc.Mat) -> bool:
    """Whether K has a null vector: then it does not factor, or a solve blows up along it."""
    n = K.getLocalSize()[0]
    try:
        factor = _solver(K)
        x = np.random.default_rng(comm.rank).standard_normal(n)
        for _ in range(3):
            x = factor.solve_checked(x / norm(comm, x))
    except AntioscError:
        return True
    X = x[:, None]
    return bool(softness(K, X, multiply(K, X))[0] < _rigid(K) * 1e-3)


def _rigid(K: PETSc.Mat) -> float:
    """Share of the entries' energy below which a motion is rigid; by strains it is a square."""
    return RIGID_FORCE**2 if by_strains(K) else RIGID_FORCE


def _positive(K: PETSc.Mat, shift: float, M: PETSc.Mat) -> Solver:
    """A solver of K + shift M; InputError where that is not positive definite."""
    try:
        return _solver(sum_of(K, shift, M))
    except NotConvergedError as error:
        raise InputError(
            INDEFINITE.format(f"K + {shift:.1e} M rad²/s² has no Cholesky factor")
        ) from error


def _solver(A: PETSc.Mat) -> Solver:
    return solver_for(A, "auto", lambda: np.zeros((A.getLocalSize()[0], 0)))


def orthonormal(comm: MPI.Comm, M: PETSc.Mat, block: Array) -> Array:
    """An M-orthonormal basis of the columns, those that others span dropped (Gram–Schmidt)."""
    basis, loads = np.zeros((len(block), 0)), np.zeros((len(block), 0))
    for column in block.T:
        before = np.sqrt(float(dot(comm, column, multiply(M, column))))
        for _ in range(2):  # twice is enough (Kahan)
            column = column - basis @ dot(comm, loads, column)
        load = multiply(M, column)
        left = np.sqrt(max(float(dot(comm, column, load)), 0.0))
        if left > SPANNED * before:
            basis = np.column_stack([basis, column / left])
            loads = np.column_stack([loads, load / left])
    return basis


def _vanishing(comm: MPI.Comm, fields: Array, fixed: IntArray, springs: Array) -> Array:
    """The combinations of the columns that are zero on the fixed dofs and stretch no spring."""
    scale = np.sqrt(comm.allreduce(np.einsum("ij,ij->j", fields, fields)))
    fields, scale = fields[:, scale > 0], scale[scale > 0]  # y and z are zero on a line along x
    owned = fixed[fixed < len(fields)]
    at_fixed = fields[owned]
    stretch = dot(comm, springs, fields)
    gram = comm.allreduce(at_fixed.T @ at_fixed) + stretch.T @ stretch
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    combinations = (vectors / scale[:, None])[:, values < VANISHING]
    result = fields @ combinations
    result[owned] = 0.0
    return result


def closer_shift(factor: Solver, K: PETSc.Mat, M: PETSc.Mat, motions: Array) -> float:
    """The shift again, from block inverse iteration with a first one.

    The polynomial fields of the first shift do not represent slender members, whose frequencies may
    be ten times lower.
    """
    comm = factor.comm
    x = np.random.default_rng(comm.rank).standard_normal((len(motions), 3))
    blocks = []
    for _ in range(4):
        x = factor.solve_block(multiply(M, x))
        x = orthonormal(comm, M, x - motions @ dot(comm, motions, multiply(M, x)))
        blocks.append(x)
    # a small structure exhausts the blocks: what rounding leaves of them must not be rigid
    basis = orthonormal(comm, M, np.hstack([motions, *blocks]))[:, motions.shape[1] :]
    if not basis.shape[1]:  # all motions are rigid
        return float("inf")
    values, turn = np.linalg.eigh(dot(comm, basis, multiply(K, basis)))
    # xᵀK x is a sum of terms of the size of xᵀD x, known to ε of that.
    softest = basis @ turn[:, :1]
    cancelled = 0.0 if by_strains(K) else norms(comm, roots(K)[:, None] * softest)[0] ** 2
    rounding = np.finfo(float).eps * (cancelled + values[-1])
    if values[0] <= rounding:
        raise AccuracyError(
            f"the lowest elastic frequency is hidden by rounding, ω² = {values[0]:.1e} ± "
            f"{rounding:.1e} rad²/s²: some part is attached by a hinge, a single common point or "
            "line (join it along a face), or is too slender for double precision (use fewer "
            "elements)."
        )
    return SHIFT * float(values[0])


def _first_elastic(
    comm: MPI.Comm, K: PETSc.Mat, M: PETSc.Mat, fields: Array, motions: Array
) -> float:
    """A Rayleigh–Ritz value of the size of the lowest elastic ω²."""
    elastic = fields - motions @ dot(comm, motions, multiply(M, fields))
    before, after = (comm.allreduce(np.einsum("ij,ij->j", x, x)) for x in (fields, elastic))
    # A rigid field leaves rounding only, which must not be scaled up to a field of its own.
    basis = orthonormal(comm, M, elastic[:, after > STRAINING_SHARE**2 * before])
    values = np.linalg.eigvalsh(dot(comm, basis, multiply(K, basis)))
    if not len(values):
        return frequency(K, M)
    # Below the rounding of the largest nothing is told: `closer_shift` comes after.
    return float(max(values[0], DROWNED * values[-1]))


def _fields(form: WeakForm, comm: MPI.Comm) -> tuple[Array, int]:
    """(polynomial fields on the dofs of this rank (rows, k), how many of them are rigid)."""
    located = {name: compat.dof_coordinates(form.space, p) for name, p in form.components.items()}
    dim = 3 if "z" in located else 2
    low, high = bounds(comm, located["x"][1])
    rows = compat.local_size(form.space)
    columns = []
    rigid_count = 0
    for rigid, field in _polynomials(dim):
        column = np.zeros(rows)
        for name, (dofs, x) in located.items():
            mine = dofs < rows
            s = (x[mine] - (low + high) / 2) / (high - low).max()
            displacement, rotation = field(s)
            if name in "xyz":
                column[dofs[mine]] = displacement["xyz".index(name)]
            else:  # the displacement was given per unit of the scaled coordinates
                column[dofs[mine]] = rotation["xyz".index(name[1])] / (high - low).max()
        columns.append(column)
        rigid_count += rigid
    return np.column_stack(columns), rigid_count


def _polynomials(dim: int) -> Iterator[tuple[bool, _Field]]:
    """(is rigid, s -> (displacement (3, n), rotation (3, n))): rigid motions, then the others."""
    axes = range(dim)
    for i in axes:
        yield True, _field(i, ())
    for i, j in [(0, 1)] if dim == 2 else [(0, 1), (1, 2), (2, 0)]:
        yield True, _difference(_field(i, (j,)), _field(j, (i,)))
    for i in axes:
        for j in axes:
            yield False, _field(i, (j,))
            for k in range(j, dim):
                yield False, _field(i, (j, k))


def _field(component: int, powers: tuple[int, ...]) -> _Field:
    """u_component = Π s_j over `powers`, and half its curl."""

    def value(s: Array) -> tuple[Array, Array]:
        displacement, rotation = np.zeros((3, len(s))), np.zeros((3, len(s)))
        displacement[component] = np.prod(s[:, list(powers)], axis=1)
        for axis in range(3):
            if axis == component or axis not in powers:
                continue
            rest = list(powers)
            rest.remove(axis)
            slope = powers.count(axis) * np.prod(s[:, rest], axis=1)
            # curl of u e_c: component k gets ε_{k,axis,c} ∂u/∂axis
            k = 3 - axis - component
            sign = 1.0 if (k, axis, component) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
            rotation[k] += 0.5 * sign * slope
        return displacement, rotation

    return value


def _difference(a: _Field, b: _Field) -> _Field:
    def value(s: Array) -> tuple[Array, Array]:
        (u, r), (v, q) = a(s), b(s)
        return u - v, r - q

    return value
