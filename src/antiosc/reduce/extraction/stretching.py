"""The forces of second-order strain in the modes of a model, by static modal derivatives.

With the motion u = Σ a_i φ_i + v, φ_i motions of unit mass and v their static second-order
response, the energy to fourth order in a is

    ½ aᵀ(φᵀKφ)a + ½ ∫ε(u):C:η(u, u) + ½ vᵀKv + Σ a_i a_j g_ijᵀv + ⅛ ∫η:C:η,
    g_ijᵀw = ½ ∫ η(φ_i, φ_j):C:ε(w) + ε(φ_i):C:η(φ_j, w) + ε(φ_j):C:η(φ_i, w).

v = -Σ a_i a_j K⁻¹g_ij, minus its components along the φ so that φᵀKv = 0: one solve for each pair,
with the existing factor (static modal derivatives: S. Idelsohn, A. Cardona, *Comput. Methods Appl.
Mech. Eng.* 49 (1985) 253; condensed: J. Hollkamp, R. Gordon, *J. Sound Vib.* 318 (2008) 1139). The
quadratic forces are g_ijᵀφ_k, symmetric in all three. About a static state q under a prestress ε(u)
is ε(u) + η(q, u).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations_with_replacement, permutations
from typing import TYPE_CHECKING, cast

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.progress import counting, doing
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.stretch import MOST, MOST_OF_MAP, Count, Stretch

if TYPE_CHECKING:
    from antiosc.fem.elements.second_order_points import PartPoints
    from antiosc.fem.structure.meshed import MeshedStructure

#: Static solves of a pair of modes where rigid-body modes are left: the shift of the factor is that
#: of the lowest elastic mode, and each further solve takes away what it changes.
SOLVES_OF_FREE = 6
#: Size of a new direction over that of its vector, below which it is rounding.
EXHAUSTED = 1e-6
#: Points whose strains are multiplied at once.
AT_ONCE = 20_000
#: What is computed, for who waits.
WORDS = "stretching of the part as it bends"


def part_of(structure: Structure) -> MeshedStructure:
    """The meshed part, if it can stretch; InputError for others."""
    matrices = structure.matrices
    if not matrices.meshed or matrices.assembled:
        raise InputError(
            f"stretch takes a part of one mesh; got {structure.describe()}: leave stretch out."
        )
    return cast("MeshedStructure", matrices)


def _check_model(model: AntiOscillators) -> None:
    """InputError for a model whose modes cannot stretch."""
    if model.shapes is None:
        raise InputError("stretch needs the shapes of the model: extract it with shapes.")
    if model.free_modes.damping is not None:
        raise InputError("stretch does not take dampers, nor layers that relax: leave it out.")


def with_stretch(structure: Structure, model: AntiOscillators, count: Count) -> AntiOscillators:
    """The model with second-order forces of the modes that its sites move most.

    count : number of modes that an impact takes, or "auto". Two more are computed, for the error.
    """
    part_of(structure)
    _check_model(model)
    body = model.free_modes
    assert body.shape is not None
    modes = candidates(body.omega, body.B, MOST if count == "auto" else min(count + 2, MOST))
    phi = body.field((body.shape @ modes).T).T
    return replace(model, stretch=_stretch_of_motions(structure, modes, phi, count))


def stretch_of_map(
    structure: Structure, omega: Array, phi: Array, b: Array, count: Count
) -> Stretch:
    """The second-order forces in free modes phi (rows, J) for sites with displacements b (P, J).

    Several sites share at most `MOST_OF_MAP` motions, the principal directions of all Λ⁻¹b, Λ⁻²b
    and Λ⁻³b. The result has no `shapes`.
    """
    if len(b) == 1:
        modes = candidates(omega, b.T, MOST)
    else:
        flexible = 1 / omega[:, None] ** 2
        blocks = [flexible**power * b.T for power in (1, 2, 3)]
        unit = np.hstack([block / np.linalg.norm(block, axis=0) for block in blocks])
        modes = np.linalg.svd(unit, full_matrices=False)[0][:, :MOST_OF_MAP]
    return replace(_stretch_of_motions(structure, modes, phi @ modes, count), shapes=None)


def _stretch_of_motions(structure: Structure, modes: Array, phi: Array, count: Count) -> Stretch:
    """The `Stretch` of motions phi (rows, m), which are combinations `modes` (J, m) of the free
    modes.
    """
    with doing(WORDS, structure.comm.rank):
        derivatives = tensors(structure, _points(structure), phi)
    quadratic, cubic, shapes = derivatives
    return Stretch(modes, quadratic, cubic, count, shapes)


def _points(structure: Structure) -> PartPoints:
    """The Gauss points of a part, about its static state under a prestress."""
    from antiosc.fem.elements.second_order_points import points_of  # needs dolfinx

    points = points_of(part_of(structure))
    preload = structure.matrices.preload
    if preload is None:
        return points
    return points.about(preload.q)


def candidates(omega: Array, B: Array, count: int) -> Array:
    """Orthonormal combinations (J, m) of the free modes that forces at sites B excite, m <= count.

    They span the Krylov space of the flexibility Λ⁻¹ that starts from the static displacements
    Λ⁻¹b. The first is the local dent of a sheet under its striker, which takes many modes; the
    lowest modes follow.
    """
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
            block = block[:, np.linalg.norm(block, axis=0) > EXHAUSTED * size]
        U, sizes, _ = np.linalg.svd(block / np.linalg.norm(block, axis=0), full_matrices=False)
        block = U[:, sizes > EXHAUSTED * sizes.max(initial=0.0)]
        basis = np.hstack([basis, block])
        block = flexible * block
    return basis[:, :count]


def tensors(structure: Structure, points: PartPoints, phi: Array) -> tuple[Array, Array, Array]:
    """Tensors H (m, m, m), G (m, m, m, m) and second-order displacements (dofs, pairs).

    phi : (dofs, m) motions.
    """
    m = phi.shape[1]
    pairs = list(combinations_with_replacement(range(m), 2))
    slopes = [points.slopes(mode) for mode in phi.T]
    g = _pair_loads(points, slopes, pairs)
    g[points.held] = 0.0
    static_response = -_static(structure, g, phi)
    quartic = _quartic(points, slopes, pairs) + g.T @ static_response / 2
    return _cubic_form(phi.T @ g, pairs, m), 4 * _quartic_form(quartic, pairs, m), static_response


def _pair_loads(points: PartPoints, slopes: list[Array], pairs: list[tuple[int, int]]) -> Array:
    """Second-order loads g_ij (dofs, pairs) of pairs of motions."""
    stresses = [points.stress(slope) for slope in slopes]
    loads: list[Array] = []
    with counting(WORDS, len(pairs)) as done:
        for i, j in pairs:
            strained = points.weighted_stress(points.second(slopes[i], slopes[j])) / 2
            slope_forces = points.along(stresses[i], slopes[j])
            slope_forces = slope_forces + points.along(stresses[j], slopes[i])
            loads.append(points.load(strained, slope_forces / 2))
            done(len(loads))
    return np.column_stack(loads)


def work_on(
    structure: Structure, phi: Array, follows: Array, motions: Array
) -> tuple[Array, Array]:
    """Work of second-order forces on motions w (dofs, R): (P, R) of pairs, (m, P, R) of mode and
    pair.

    phi (dofs, m) and follows (dofs, P) as for `tensors`; to third order in the amplitudes

        w·f = Σ a_i a_j g_ijᵀw + Σ a_k a_i a_j ∫ (C ε(v_ij) + C η(φ_i, φ_j)/2) : η(φ_k, w)
              + ε(φ_k):C:η(v_ij, w) + ε(w):C:η(φ_k, v_ij).
    """
    points = _points(structure)
    pairs = list(combinations_with_replacement(range(phi.shape[1]), 2))
    slopes = [points.slopes(mode) for mode in phi.T]
    three = np.zeros((len(slopes), len(pairs), motions.shape[1]))
    stresses = [points.stress(motion_slopes) for motion_slopes in slopes]
    for p, (i, j) in enumerate(pairs):
        response_slopes = points.slopes(follows[:, p])
        tension = points.weighted_stress(points.second(slopes[i], slopes[j])) / 2
        tension = tension + points.stress(response_slopes)
        for k, slope in enumerate(slopes):
            strained = points.weighted_stress(points.second(slope, response_slopes))
            slope_forces = points.along(tension, slope) + points.along(stresses[k], response_slopes)
            three[k, p] = points.load(strained, slope_forces) @ motions
    return _pair_loads(points, slopes, pairs).T @ motions, three


def _static(structure: Structure, g: Array, phi: Array) -> Array:
    """K⁻¹g minus its components along the motions φ: φᵀK of the result is 0."""
    factor = structure.factorize()
    rigid = structure.rigid_modes
    k_phi = multiply(structure.K, phi)
    m_rigid = multiply(structure.M, rigid)
    g = g - m_rigid @ (rigid.T @ g)
    displacement = np.zeros_like(g)
    for _ in range(SOLVES_OF_FREE if rigid.shape[1] else 1):
        residual = g if not displacement.any() else g - multiply(structure.K, displacement)
        displacement = displacement + factor.solve_block(residual)
        displacement = displacement - rigid @ (m_rigid.T @ displacement)
    return np.asarray(displacement - phi @ np.linalg.solve(phi.T @ k_phi, k_phi.T @ displacement))


def _quartic(points: PartPoints, slopes: list[Array], pairs: list[tuple[int, int]]) -> Array:
    """⅛ ∫η:C:η of all pairs of pairs of motions: (pairs, pairs)."""
    total = np.zeros((len(pairs), len(pairs)))
    for start in range(0, points.weight.size, AT_ONCE):
        span = slice(start, start + AT_ONCE)
        part = [slope[span] for slope in slopes]
        eta = np.stack([points.second(part[i], part[j]) for i, j in pairs], axis=1)
        stress = eta @ (points.stiffness[span] * points.weight[span, None, None])
        total += np.tensordot(stress, eta, axes=([0, 2], [0, 2]))
    return total / 8


def _cubic_form(values: Array, pairs: list[tuple[int, int]], m: int) -> Array:
    """The quadratic tensor H (m, m, m) from φ_kᵀg_ij (m, pairs), exactly symmetric."""
    H = np.zeros((m, m, m))
    for n, (i, j) in enumerate(pairs):
        H[:, i, j] = H[:, j, i] = values[:, n]
    return np.asarray(sum(H.transpose(order) for order in permutations(range(3)))) / 6


def _quartic_form(values: Array, pairs: list[tuple[int, int]], m: int) -> Array:
    """The symmetric part (m, m, m, m) of Q_(ij)(kl) (pairs, pairs)."""
    place = np.zeros((m, m), dtype=int)
    for n, (i, j) in enumerate(pairs):
        place[i, j] = place[j, i] = n
    Q = values[place[:, :, None, None], place[None, None]]
    return np.asarray(sum(Q.transpose(order) for order in permutations(range(4)))) / 24
