"""The forces of second-order strain in the modes of a model, by static modal derivatives.

With the motion u = Σ a_i φ_i + v, φ_i motions of unit mass and v their static second-order
response, the energy to fourth order in a is

    ½ aᵀ(φᵀKφ)a + ½ ∫ε(u):C:η(u, u) + ½ vᵀKv + Σ a_i a_j g_ijᵀv + ⅛ ∫η:C:η,
    g_ijᵀw = ½ ∫ η(φ_i, φ_j):C:ε(w) + ε(φ_i):C:η(φ_j, w) + ε(φ_j):C:η(φ_i, w).

v = -Σ a_i a_j K⁻¹g_ij, minus its components along the φ so that φᵀKv = 0: one solve for each pair,
with the existing factor (static modal derivatives: S. Idelsohn, A. Cardona, *Comput. Methods Appl.
Mech. Eng.* 49 (1985) 253; condensed: J. Hollkamp, R. Gordon, *J. Sound Vib.* 318 (2008) 1139). The
quadratic forces are g_ijᵀφ_k, which are symmetric in i, j and k. About a static state q under a
prestress, ε(u) + η(q, u) replaces ε(u).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations_with_replacement, permutations
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.progress import counting, doing
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.stretch import MOST_MODES, Count, Stretch
from antiosc.reduce.extraction import elastic_response

if TYPE_CHECKING:
    from antiosc.fem.assembly.assembled import AssembledMatrices
    from antiosc.fem.elements.second_order import PartPoints
    from antiosc.fem.structure.meshed import PartsMatrices

#: Size of a new direction over that of its vector, below which it is rounding.
EXHAUSTED_SIZE = 1e-6
#: Points whose strains are multiplied at once.
POINTS_AT_ONCE = 20_000
#: Text that names this computation in progress messages.
PROGRESS_TEXT = "stretching of the part as it bends"


def pair_count(count: Count) -> int:
    """Number of pairs of modes; each pair takes one solve."""
    modes = MOST_MODES if count == "auto" else min(count + 2, MOST_MODES)
    return modes * (modes + 1) // 2


def with_stretch(
    structure: Structure, solver: Solver, model: AntiOscillators, count: Count
) -> AntiOscillators:
    """The model with second-order forces of the `count` + 2 modes that its sites excite most."""
    if model.shapes is None:
        raise InputError("stretch needs the shapes of the model: extract it with shapes.")
    body = model.free_modes
    if body.damping is not None:
        raise InputError("stretch does not take dampers, nor layers that relax: leave it out.")

    assert body.shape is not None
    modes = excited_motions(
        body.omega, body.B, MOST_MODES if count == "auto" else min(count + 2, MOST_MODES)
    )
    phi = body.field((body.shape @ modes).T).T

    with doing(PROGRESS_TEXT):
        quadratic, cubic, shapes = second_order_tensors(structure, solver, phi)
    return replace(model, stretch=Stretch(modes, quadratic, cubic, count, shapes))


class _PartMotions(NamedTuple):
    """A part's Gauss points, the rows of its dofs, derivatives (points, d, b) of each motion.

    d: directions (axes, tangents, or a beam's line); b: displacements and rotations of a node.
    """

    points: PartPoints
    rows: slice
    slopes: list[Array]


def _second_order(
    structure: Structure, motions: Array, pairs: list[tuple[int, int]]
) -> tuple[list[_PartMotions], Array]:
    """(parts with their motions, second-order loads g_ij (dofs, pairs), zero on fixed dofs) for
    `motions` (dofs, k). InputError for several ranks, superelements and matrices."""
    from antiosc.fem.elements.second_order import points_of  # needs dolfinx

    if not structure.matrices.meshed:
        raise InputError(f"stretch needs a mesh; got {structure.describe()}.")
    if structure.comm.size > 1:
        raise InputError("stretch works in one process: extract the model without mpirun.")
    matrices = cast("PartsMatrices", structure.matrices)
    if matrices.assembled and cast("AssembledMatrices", matrices).layout.condensed:
        raise InputError("stretch does not take superelements: leave stretch out.")

    # the parts
    fields = matrices.fields(motions)
    points = [points_of(member.part) for member, _ in fields]
    preload = matrices.preload
    if preload is not None:
        states = matrices.fields(preload.q[:, None])
        points = [at.about(q[:, 0]) for at, (_, q) in zip(points, states, strict=True)]

    pieces = [
        _PartMotions(at, member.rows, [at.slopes(shape) for shape in shapes.T])
        for at, (member, shapes) in zip(points, fields, strict=True)
    ]

    # their loads
    total = np.zeros((structure.rows, len(pairs)))
    for piece in pieces:
        loads = _loads_of(piece, pairs)
        loads[piece.points.held] = 0.0
        total += matrices.joined(loads, piece.rows)
    return pieces, total


def excited_motions(omega: Array, B: Array, count: int) -> Array:
    """Orthonormal combinations (J, m) of the elastic free modes that span ω⁻²B, ω⁻⁴B, ω⁻⁶B, …"""
    elastic = omega > 0
    if not elastic.any():
        raise InputError("stretch needs a model with elastic modes: raise n.")
    flexible = np.where(elastic, 1 / np.where(elastic, omega, 1.0) ** 2, 0.0)[:, None]
    basis = np.zeros((len(omega), 0))
    block = flexible * B
    while block.shape[1] and basis.shape[1] < count:
        for _ in range(2):
            size = np.linalg.norm(block, axis=0)
            block = block - basis @ (basis.T @ block)
            block = block[:, np.linalg.norm(block, axis=0) > EXHAUSTED_SIZE * size]
        U, sizes, _ = np.linalg.svd(block / np.linalg.norm(block, axis=0), full_matrices=False)
        block = U[:, sizes > EXHAUSTED_SIZE * sizes.max(initial=0.0)]
        basis = np.hstack([basis, block])
        block = flexible * block

    return basis[:, :count]


def second_order_energies(structure: Structure, motions: Array) -> Array:
    """Second-order energy over linear energy (k,) of motions (dofs, k)."""
    pairs = [(i, i) for i in range(motions.shape[1])]
    pieces, g = _second_order(structure, motions, pairs)
    solver = structure.factorize()
    third = np.sum(motions * g, axis=0) / 3
    fourth = np.diag(sum(_quartic_energies(piece, pairs) for piece in pieces)).copy()
    for i in range(len(fourth)):
        one = slice(i, i + 1)
        response = _static_response(structure, solver, g[:, one], motions[:, one])
        fourth[i] -= g[:, i] @ response[:, 0] / 2
    linear = np.sum(motions * multiply(structure.K, motions), axis=0) / 2
    return np.asarray((np.abs(third) + np.abs(fourth)) / linear)


def second_order_tensors(
    structure: Structure, solver: Solver, phi: Array
) -> tuple[Array, Array, Array]:
    """(quadratic forces H (m, m, m), cubic G (m, m, m, m), static displacements (dofs, pairs))."""
    m = phi.shape[1]
    pairs = list(combinations_with_replacement(range(m), 2))
    pieces, g = _second_order(structure, phi, pairs)
    static_response = -_static_response(structure, solver, g, phi)
    quartic = sum(_quartic_energies(piece, pairs) for piece in pieces) + g.T @ static_response / 2

    # as tensors, symmetric without rounding
    cubic = np.zeros((m, m, m))
    place = np.zeros((m, m), dtype=int)
    for n, (i, j) in enumerate(pairs):
        cubic[:, i, j] = cubic[:, j, i] = phi.T @ g[:, n]
        place[i, j] = place[j, i] = n
    H = sum(cubic.transpose(order) for order in permutations(range(3)))
    fourth = quartic[place[:, :, None, None], place[None, None]]
    G = sum(fourth.transpose(order) for order in permutations(range(4)))
    return np.asarray(H) / 6, np.asarray(G) / 6, static_response


def _loads_of(piece: _PartMotions, pairs: list[tuple[int, int]]) -> Array:
    """Second-order loads g_ij (rows, pairs) of a part."""
    points = piece.points
    slopes = piece.slopes
    stresses = [points.stress(slope) for slope in slopes]
    loads: list[Array] = []

    with counting(PROGRESS_TEXT, len(pairs)) as done:
        for i, j in pairs:
            strained = points.weighted_stress(points.second(slopes[i], slopes[j])) / 2
            slope_forces = points.along(stresses[i], slopes[j])
            slope_forces = slope_forces + points.along(stresses[j], slopes[i])
            loads.append(points.load(strained, slope_forces / 2))
            done(len(loads))

    return np.column_stack(loads)


def _static_response(structure: Structure, solver: Solver, g: Array, phi: Array) -> Array:
    """Displacements v = K⁻¹g (dofs, pairs), minus components along the motions φ: φᵀKv = 0."""
    k_phi = multiply(structure.K, phi)
    displacement = elastic_response(structure, solver, g)
    return np.asarray(displacement - phi @ np.linalg.solve(phi.T @ k_phi, k_phi.T @ displacement))


def _quartic_energies(piece: _PartMotions, pairs: list[tuple[int, int]]) -> Array:
    """Energies ⅛ ∫η_a:C:η_b (pairs, pairs) of a part, a and b pairs of motions."""
    points = piece.points
    slopes = piece.slopes

    total = np.zeros((len(pairs), len(pairs)))
    for start in range(0, points.weight.size, POINTS_AT_ONCE):
        span = slice(start, start + POINTS_AT_ONCE)
        part = [slope[span] for slope in slopes]
        eta = np.stack([points.second(part[i], part[j]) for i, j in pairs], axis=1)
        stress = eta @ (points.stiffness[span] * points.weight[span, None, None])
        total += np.tensordot(stress, eta, axes=([0, 2], [0, 2]))
    return total / 8
