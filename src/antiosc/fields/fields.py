"""Displacement fields of a body, computed from its model after an impact, and support reactions.

The displacement is a sum of the body's shapes (`ModalBody`); for anti-oscillators, by Article (8),
w(x, t) = λ0 ψ0(x) + Σ (λi − λ0) ψi(x). `write_series` evaluates it at all nodes for some times, in
files for ParaView; `antiosc.fields.probe` evaluates it at one point for all times.

The reaction of a support follows from a motion g of the whole mesh: a unit rigid motion of the dofs
of this support, zero on the dofs of other supports, and static equilibrium elsewhere (K_ff g_f =
−K_fs g_s). Elastic forces do no work on g, so that the reaction is the work of all other forces,

    R = gᵀM u'' − gᵀb F.

This mode-acceleration form contains the whole quasi-static reaction, whatever the number of modes
in u''. The motions g of all supports add up to a rigid motion, so that the reactions, the force and
the inertia of the reduced motion balance to rounding. Dampers and Maxwell branches add the work
gᵀ(C u' + G ε).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.checks import floats, instance, nonempty
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.base.process import one_thread
from antiosc.base.texts import ReprMixin, percent
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.platform import collective, on_root
from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.impact.histories import History
from antiosc.impact.histories.factors import (
    AnyHistory,
    checked_times,
    column_forces,
    modes_with_shapes,
    shape_factors,
    spring_amplitudes,
    stretch_factors,
    stretch_of_motion,
    stretch_shapes,
    unit_energy_factors,
)
from antiosc.impact.histories.parts import BodyHistory
from antiosc.io.neutral import CELL_TYPES, CORNERS, DIMENSION, FACES, outer_facets
from antiosc.models.modal import superposed
from antiosc.recovery import source
from antiosc.recovery.place import NodeTensors
from antiosc.recovery.series import with_pvd, write_frames
from antiosc.reduce.extraction import elastic_response
from antiosc.reduce.site.site import Site

#: Share of the mass shaken by the ground that shapes must represent without a warning.
MIN_MASS_SHARE = 0.5

#: Largest ratio of stiffness (a corrected model is softer) and of mass of structure and model.
MAX_PART_RATIOS = 1.5, 1.01


def without_unused_nodes(
    blocks: Sequence[tuple[str, IntArray]],
) -> tuple[IntArray, list[tuple[str, IntArray]]]:
    """(numbers of the nodes that have cells, blocks of cells renumbered to these nodes)."""
    used = np.unique(np.concatenate([cells.ravel() for _, cells in blocks]))
    return used, [(kind, np.searchsorted(used, cells)) for kind, cells in blocks]


def outer_faces(blocks: Sequence[tuple[str, IntArray]]) -> IntArray:
    """Corners of the outer faces of cells (F, 3 or 4), of lines (F, 2) or single nodes (F, 1)."""
    faces: list[IntArray] = []
    for kind, cells in blocks:
        shape = CELL_TYPES[kind][0]
        if DIMENSION[shape] == 3:
            faces.append(outer_facets(cells, FACES[shape]))
        else:
            faces.append(cells[:, : CORNERS[shape]])

    most = max(f.shape[1] for f in faces)

    visible = [f for f in faces if f.shape[1] >= min(most, 3)]
    if len({f.shape[1] for f in visible}) > 1:  # quadrilaterals as triangles
        visible = [
            np.vstack([f[:, [0, 1, 2]], f[:, [0, 2, 3]]]) if f.shape[1] == 4 else f for f in visible
        ]

    return np.vstack(visible)


@collective()
@one_thread()
def write_series(
    structure: Structure,
    history: History,
    path: str | Path,
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Path:
    """Write the displacement field as a series that ParaView opens.

    The static deflection of a supported body under its own weight is not included.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History
    path : str or Path
        The `.pvd` file (the ending is added if missing); the frames are written to the same folder
        as `<name>_0000.vtu`, `<name>_0001.vtu`, ….
    times : array_like (n,), optional
        Times in s; default: 40 times, evenly spaced over the history.
    body : str
        The body whose structure is `structure`: "structure" or "impactor"; for a scene its name
        (default: the only one that has shapes).

    Returns
    -------
    Path
        Path of the `.pvd` file. If the process is killed, the file is absent or lists a complete
        series.
    """
    target = with_pvd(path)
    shapes_of_body = shapes_of(structure, history, body)
    if times is None:
        times = np.linspace(history.time[0], history.time[-1], 40)
    times_checked = nonempty("times", times)
    points, cells, shapes = source(structure).at_nodes(structure, shapes_of_body)
    factors = shape_factors(history, times_checked, body)

    frames = (shapes @ a for a in factors)
    on_root(structure.comm, partial(write_frames, target, points, cells, times_checked, frames))
    return target


def nodal_motion(
    structure: Structure, history: History, time: float, *, body: str = "structure"
) -> tuple[Array, list[tuple[str, IntArray]], Array]:
    """(nodes (P, 3) [m], blocks of cells, displacements (P, 3) [m] at `time` [s]), on all ranks."""
    points, cells, shapes = source(structure).at_nodes(
        structure, shapes_of(structure, history, body)
    )
    used, numbered = without_unused_nodes(cells)
    moved = shapes[used] @ shape_factors(history, floats("time", [time], (1,)), body)[0]
    of_root: tuple[Array, list[tuple[str, IntArray]], Array] = structure.comm.bcast(
        (points[used], numbered, moved), root=0
    )

    return of_root


def shapes_of(structure: Structure, history: AnyHistory, body: str) -> Array:
    """Shapes of the body as columns (rows of this rank, B).

    For a model with `stretch`, second-order displacements of pairs of modes follow as columns.
    """
    shapes = np.column_stack(checked_shapes(structure, history, body, MAX_PART_RATIOS))
    second = stretch_shapes(history, body)
    if second is not None:
        shapes = np.column_stack([shapes, second])
    if isinstance(history, History) and history.assembly.scene.base is not None:
        _warn_if_mass_missing(structure, history, body)
    return shapes


def _warn_if_mass_missing(structure: Structure, history: History, body: str) -> None:
    """Warn if the ground shakes a mass of which the model's shapes represent only a small part."""
    weight = modes_with_shapes(history, body).weight
    base = history.assembly.scene.base
    if base is None or base.accelerations.ndim == 1 or structure.rigid_modes.shape[1]:
        return
    if weight is None or weight.ndim == 1:  # one direction, along which the ground moves
        return
    motion = np.abs(base.accelerations).max(axis=0)
    for i in np.flatnonzero(motion > 0.01 * motion.max()):
        load = structure.uniform_inertia(np.eye(3)[i])
        if load is None:
            return

        # the inertia of rigid motions of the free dofs, which the ground shakes
        motions = structure.matrices.rigid_motions
        modal_loads = dot(structure.comm, motions, load)
        inertia = dot(structure.comm, motions, multiply(structure.M, motions))
        moved = float(modal_loads @ np.linalg.lstsq(inertia, modal_loads, rcond=None)[0])
        represented = float(np.sum(weight[:, i] ** 2))
        if represented < MIN_MASS_SHARE * moved:
            axis = "xyz"[i]
            message = (
                f"the ground shakes {moved:.3g} kg along {axis}, and the model carries "
                f"{percent(represented / moved)} of it: contact forces are right, fields far from "
                f"the sites are not; name a site whose direction is {axis} as well, or raise n."
            )
            on_root(structure.comm, partial(warn, message, AccuracyWarning))


def checked_shapes(
    structure: Structure, history: AnyHistory, body: str, limits: tuple[float, float]
) -> tuple[Array, ...]:
    """Blocks of the body's shapes; InputError if they do not belong to the structure.

    `limits`: largest ratio of the stiffness of structure and model, and of their mass.
    """
    instance("structure", structure, Structure, "a Structure")
    kinds = (History, BodyHistory)
    instance("history", history, kinds, "a History, which simulate and Scene.run return")
    modes = modes_with_shapes(history, body)
    assert modes.basis is not None
    rows = structure.rows
    fits = all(len(block) == rows for block in modes.basis)
    if not all(structure.comm.allgather(fits)):  # on some rank they may fit by chance
        raise InputError(
            f"the model's shapes have {len(modes.basis[0])} rows, the structure {rows}: the model "
            "was extracted from another structure."
        )

    factors, count = unit_energy_factors(modes)
    of_kinds = zip((structure.K, structure.M), ("stiff", "heavy"), limits, strict=True)
    for x, (matrix, noun, limit) in zip(superposed(modes.basis, factors), of_kinds, strict=True):
        ratio = float(dot(structure.comm, x, multiply(matrix, x))) / max(count, 1)
        if count and not 1 / limit < ratio < limit:
            raise InputError(
                f"the structure is {ratio:.6g} times as {noun} on the shapes of the model as the"
                " model: the model was extracted from another structure; give that of this run."
            )

    return modes.basis


# --- Strains and stresses of parts that stretch --------------------------------------------------
#
# With amplitudes x of the shapes and a of the modes φ in which a part stretches its motion is
# u = Σ x_s ψ_s + Σ a_i a_j v_ij (`antiosc.models.stretch`), and its strain to second order
#
#     ε(u) + η(u, u)/2 = Σ x_s ε(ψ_s) + Σ a_i a_j (ε(v_ij) + η(φ_i, φ_j)/2).
#
# A function that evaluates whole strains ε(s) + η(s, s)/2 gives η of two modes from the strains of
# their sum. About the static state q under a prestress, ε(s) is ε(s) + η(q, s).


#: What gives columns (…, B) of shapes (rows, B); True: with the strain η(s, s)/2 of each.
ColumnFunction = Callable[[Array, bool], Array]


def _static_state_strain(at: ColumnFunction, structure: Structure, shapes: Array) -> Array:
    """Second-order strains η(q, s) (…, B) of the static state q with each shape s (rows, B), from
    the function `at(shapes, second_order)` of strains or stresses."""
    preload = structure.matrices.preload
    if preload is None or not structure.comm.allreduce(preload.q.any()):
        return np.zeros(shapes.shape[1])
    q = preload.q[:, None]
    largest_of_rank = np.abs(np.hstack([q, shapes])).max(axis=0, initial=0.0)
    largest = np.max(structure.comm.allgather(largest_of_rank), axis=0)
    scale = largest[0] / np.where(largest[1:] > 0, largest[1:], 1.0)
    small = shapes * scale
    return np.asarray((at(q + small, True) - at(q, True) - at(small, True)) / scale)


def with_pair_columns(
    at: ColumnFunction, structure: Structure, history: AnyHistory, body: str, shapes: Array
) -> Array:
    """Strains or stresses (…, B) of `shapes` by `at`, to second order; pairs of modes come last."""
    forces = stretch_of_motion(history, body)
    if forces is None:
        linear = at(shapes, False)
        of_state = _static_state_strain(at, structure, shapes)
        return linear + of_state if linear.size else linear  # empty on other ranks than the first

    pairs = forces.size * (forces.size + 1) // 2
    count = shapes.shape[1] - pairs
    modes = stretch_factors(history, body).T
    i, j = np.triu_indices(forces.size)
    sums = modes[:, i] + np.where(i == j, 0.0, modes[:, j])
    linear = at(shapes, False)
    square = at(shapes[:, :count] @ sums, True) - linear[..., :count] @ sums  # η(s, s)/2 of each
    squares = square[..., i == j]
    products = (square - squares[..., i] - squares[..., j]) / 2
    linear += _static_state_strain(at, structure, shapes)
    linear[..., count:] += np.where(i == j, square, products)
    return linear


def tensors_at_nodes(
    structure: Structure, history: AnyHistory, body: str, shapes: Array, *selection: Any
) -> tuple[Any, Any, NodeTensors]:
    """Tensors of a body's shapes at the nodes, on rank 0: (points (P, 3) [m], [(meshio's cell type,
    point numbers (cells, v))] by part, strains or stresses at the points).

    Columns of second-order pairs come last (`with_pair_columns`). `selection`: quantity, places and
    further arguments of `mesh_fields.tensors_at_nodes`.
    """
    results: list[Any] = []

    def at(columns: Array, second_order: bool) -> Array:
        """Components of the tensors of `columns`; other parts of the result are stored."""
        result = source(structure).tensors_at_nodes(
            structure, columns, *selection, second_order=second_order
        )
        results.append(result)
        return np.asarray(result[2].columns)

    columns = with_pair_columns(at, structure, history, body, shapes)
    points, cells, tensors = results[0]
    return points, cells, tensors._replace(columns=columns)


# --- Reactions ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class Reactions(ReprMixin):
    """Forces and moments of the supports on a part.

    Attributes
    ----------
    time : (n,) s.
    force : support -> (n, 3) N, along x, y, z.
    moment : support -> (n, 3) N m about `centre`.
    centre : support -> (3,) mean of its nodes, m.
    applied : (n, 3) contact forces and loads on the part, N.
    inertia : (n, 3) rate of the momentum of the part, N.

    Supports are named by their groups, or "support 1", "support 2", … in the order of the
    structure's list; in an assembly the supports of parts come first, as "part:group" and
    "part:support 1". A dof that two supports fix belongs to the first. Springs and dampers to the
    ground are not included: `probe` their points for their forces.
    """

    time: Array
    force: dict[str, Array]
    moment: dict[str, Array]
    centre: dict[str, Array]
    applied: Array
    inertia: Array

    @property
    def total(self) -> Array:
        """(n, 3) sum of the forces, N: inertia − applied − forces of springs and dampers."""
        return np.asarray(sum(self.force.values()))


@collective()
@one_thread()
def reactions(
    structure: Structure,
    history: History,
    site: Site | Mapping[str, Site],
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Reactions:
    """Reactions of every support, due to contact forces, loads and inertia.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted: a mesh, or an assembly.
    history : History
    site : Site or mapping of names to Site
        The sites with which the model was extracted.
    times : array_like (n,), optional
        Times in s; default: those of the history.
    body : str
        As in `probe`.

    Notes
    -----
    The reactions are changes due to the impact, without the weight that the supports carry at rest.
    The forces of dampers and Maxwell branches follow from the velocities and states of the model.
    Modal damping ratios (`Damping`) contribute nothing; the forces of `Damping(alpha=…)` act on the
    ground, not on the supports. If supports fix both sides of a joint, the joint carries no force
    there and each support carries the load of its own part.

    Raises
    ------
    InputError
        A structure without supports, of given matrices or with superelements; sites that differ
        from the model's; a model with other damping than the structure; a moving ground; gravity on
        a part that can slide on its supports; a part that stretches.
    """
    checks.instance("structure", structure, Structure, "a Structure")
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    shapes = shapes_of(structure, history, body)
    times_checked = checked_times(history, times)
    sites = list(site.values()) if isinstance(site, Mapping) else [site]
    if not sites:
        raise InputError("site must name at least one Site; got an empty dict.")
    for each_site in sites:
        instance("site", each_site, Site, "a Site, or a dict {name: Site}")
    matrices = with_parts(structure, "given matrices have lost the dofs of their supports.")
    from antiosc.reduce.site.at_points import ReleasedSupports  # needs dolfinx

    released = ReleasedSupports(matrices, structure.supports)
    scene = history.assembly.scene
    if stretch_of_motion(history, body) is not None:
        raise InputError(
            "the reactions of a part that stretches are not computed: extract it without stretch."
        )
    if scene.base is not None:
        raise InputError("reactions under a moving ground (Base) are not implemented.")
    if np.any(scene.gravity) and structure.rigid_modes.shape[1]:
        raise InputError(
            "the reactions under gravity of a part that can slide on its supports are not"
            " computed: leave gravity out, or hold the part."
        )

    solver = structure.factorize(released.pulled.shape[1])
    support_motions = elastic_response(structure, solver, released.pulled)
    support_motions[structure.fixed[structure.fixed < structure.rows]] = 0.0
    support_inertia, rigid_inertia = released.inertia(support_motions)
    work, applied = released.applied(sites)
    forces = column_forces(history, times_checked, body)
    if len(work) != forces.shape[1]:
        raise InputError(
            f"the model has {forces.shape[1]} directions of contact, the sites given {len(work)}: "
            "give the sites with which it was extracted, in their order."
        )

    comm = structure.comm
    accelerations = shape_factors(history, times_checked, body, 2)
    forces_of_supports = accelerations @ dot(comm, shapes, support_inertia) - forces @ work
    velocities = shape_factors(history, times_checked, body, 1)
    springs = spring_amplitudes(history, times_checked, body)
    terms = released.damping(shapes)
    undamped = modes_with_shapes(history, body).damping is None
    if sum(tau is not None for tau, _ in terms) != len(springs) or (terms and undamped):
        raise InputError("the damping is not that of the structure: take the model of `extract`.")

    for tau, by_motion in terms:
        forces_of_supports += (velocities if tau is None else springs.pop(0)) @ by_motion.T
    names = list(released.centres)

    return Reactions(
        time=times_checked,
        force={name: forces_of_supports[:, 6 * i : 6 * i + 3] for i, name in enumerate(names)},
        moment={name: forces_of_supports[:, 6 * i + 3 : 6 * i + 6] for i, name in enumerate(names)},
        centre=released.centres,
        applied=forces @ applied,
        inertia=accelerations @ dot(comm, shapes, rigid_inertia),
    )
