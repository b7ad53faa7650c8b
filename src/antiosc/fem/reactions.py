"""Reactions of the supports after an impact, and their balance with force and inertia.

A motion g of the whole mesh that is a unit rigid motion on the dofs of one support, zero on those
of the others, and in static equilibrium elsewhere (K_ff g_f = −K_fs g_s) does no work on the
stiffness. The virtual work of all forces on it is the reaction of that support,

    R = gᵀM u'' − gᵀb F,

the mode-acceleration form: it contains the whole quasi-static reaction, whatever the number of
modes in u''. Over all supports the motions g add up to a rigid one, so that the reactions, the
force and the inertia of the reduced motion balance to rounding.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc import checks
from antiosc._types import Array, IntArray
from antiosc.brief import Brief
from antiosc.errors import AntioscWarning, InputError
from antiosc.fem.extraction.static_mode import beside_rigid
from antiosc.fem.fields import counted, shapes_of
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.mpi import collective
from antiosc.fem.site.functionals import functionals
from antiosc.fem.site.site import Site
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.simulation.body_motion import amplitudes, forces_of, times_of
from antiosc.simulation.history import History
from antiosc.simulation.scene_history import SceneHistory
from antiosc.threads import one_thread


@dataclass(frozen=True, eq=False, repr=False)
class Reactions(Brief):
    """Forces and moments of the supports on a part.

    Attributes
    ----------
    time : (n,) s.
    force : support -> (n, 3) N, along x, y, z.
    moment : support -> (n, 3) N m about `centre`.
    centre : support -> (3,) mean of its nodes, m.
    applied : (n, 3) contact forces and loads on the part, N.
    inertia : (n, 3) rate of the momentum of the part, N.

    The names of the supports are their groups, or "support 1" and on, in the order of the
    structure's list. A dof that two supports hold is counted with the first.
    """

    time: Array
    force: dict[str, Array]
    moment: dict[str, Array]
    centre: dict[str, Array]
    applied: Array
    inertia: Array

    @property
    def total(self) -> Array:
        """(n, 3) sum of the forces of all supports, N: inertia − applied where they hold it."""
        return np.asarray(sum(self.force.values()))


@collective(history=counted)
@one_thread()
def reactions(
    structure: Structure,
    history: History | SceneHistory,
    site: Site | Mapping[str, Site],
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Reactions:
    """Reactions of every support: of the contact forces, the loads and the inertia.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted, from a mesh.
    history : History or SceneHistory
    site : Site or mapping of names to Site
        With which the model was extracted.
    times : array_like (n,), optional
        Times in s; default: those of the history.
    body : str
        As in `probe`.

    Notes
    -----
    They are the changes due to the impact: the weight that the supports carry at rest is not in
    them. Damping forces are not part of them: those of `Damping(alpha=…)` act on the ground without
    the supports.

    Raises
    ------
    InputError
        A structure without supports, of several parts or of given matrices; sites that are not
        those of the model; a moving ground; gravity on a part that its supports let slide.
    """
    checks.instance("structure", structure, Structure, "a Structure")
    kinds = (History, SceneHistory)
    checks.instance("history", history, kinds, "a History, which simulate and Scene.run return")
    shapes = shapes_of(structure, history, body)
    at = times_of(history, times)
    _check(structure, history, body)
    forces = forces_of(history, at, body)
    free = _unsupported(structure)
    loads = _loads(free, site, forces.shape[1])
    held = _held(structure)
    columns, centres = _motions(structure, held)
    whole = _extended(structure, free, columns)
    comm = structure.comm
    accelerations = amplitudes(history, at, body, 2)
    inertial = accelerations @ dot(comm, shapes, multiply(free.M, whole))
    found = inertial - forces @ dot(comm, loads, whole)
    rigid = _uniform(free)
    names = list(held)
    return Reactions(
        time=at,
        force={name: found[:, 6 * i : 6 * i + 3] for i, name in enumerate(names)},
        moment={name: found[:, 6 * i + 3 : 6 * i + 6] for i, name in enumerate(names)},
        centre=dict(zip(names, centres, strict=True)),
        applied=forces @ dot(comm, loads, rigid),
        inertia=accelerations @ dot(comm, shapes, multiply(free.M, rigid)),
    )


def _check(structure: Structure, history: Any, body: str) -> None:
    on_mesh(structure, "given matrices have lost the dofs of their supports.")
    if not structure.supports:
        raise InputError("the structure has no supports: it has no reactions.")
    if isinstance(history, History):
        pulled = bool(np.any(history.problem.load)) and body == "structure"
        moved = False
    else:
        scene = history.assembly.scene
        pulled, moved = bool(np.any(scene.gravity)), scene.base is not None
    if moved:
        raise InputError("reactions under a moving ground (Base) are not implemented.")
    if pulled and structure.rigid_modes.shape[1]:
        raise InputError(
            "reactions under gravity of a part that its supports let slide are not implemented."
        )


def _unsupported(structure: Structure) -> Structure:
    """The same structure without its supports."""
    assert structure.made_of is not None
    mesh, material, options = structure.made_of
    with warnings.catch_warnings():  # it was warned of when the structure was made
        warnings.simplefilter("ignore", AntioscWarning)
        return Structure(mesh, material, **options)


def _loads(free: Structure, site: Any, count: int) -> Array:
    """b (rows, P) of the columns of the model, with what lies on the supports."""
    named = site if isinstance(site, Mapping) else {"": site}
    for one in named.values():
        checks.instance("site", one, Site, "a Site, or a dict {name: Site}")
    with warnings.catch_warnings():  # as above
        warnings.simplefilter("ignore", AntioscWarning)
        found = functionals(free, list(named.values()))
    columns = [each.b for one in found for each in (one, *one.across)]
    if len(columns) != count:
        raise InputError(
            f"the model has {count} directions of contact, the sites given {len(columns)}: give "
            "the sites with which it was extracted, in their order."
        )
    return np.column_stack(columns)


def _held(structure: Structure) -> dict[str, dict[str, IntArray]]:
    """Support -> component -> dofs of this rank that it holds first."""
    from antiosc.fem.structure.support import fixed_dofs

    part = on_mesh(structure)
    taken: dict[str, IntArray] = {}
    result: dict[str, dict[str, IntArray]] = {}
    for number, support in enumerate(structure.supports, start=1):
        name = support.where if isinstance(support.where, str) else f"support {number}"
        name = f"{name} ({number})" if name in result else name
        paths = fixed_dofs(part.mesh, part.form, [support])
        own = {}
        for component, path in part.form.components.items():
            dofs = np.setdiff1d(paths.get(path, []), taken.get(component, []))
            dofs = dofs[dofs < structure.rows].astype(np.int32)
            taken[component] = np.union1d(taken.get(component, []), dofs).astype(np.int32)
            own[component] = dofs
        result[name] = own
    return result


def _motions(
    structure: Structure, held: dict[str, dict[str, IntArray]]
) -> tuple[Array, list[Array]]:
    """Six unit rigid motions of the held dofs of each support (rows, 6 S), and their centres."""
    from antiosc.fem import compat
    from antiosc.fem.structure.rigid_body_modes import about

    part = on_mesh(structure)
    columns, centres = [], []
    for dofs in held.values():
        total, count = np.zeros(3), 0
        for component, own in dofs.items():
            numbers, x = compat.dof_coordinates(part.form.space, part.form.components[component])
            there = x[np.isin(numbers, own)]
            total, count = total + there.sum(axis=0), count + len(there)
        centre = structure.comm.allreduce(total) / max(structure.comm.allreduce(count), 1)
        rigid = about(part.form, centre)
        motion = np.zeros_like(rigid)
        for own in dofs.values():
            motion[own] = rigid[own]
        columns.append(motion)
        centres.append(centre)
    return np.hstack(columns), centres


def _extended(structure: Structure, free: Structure, columns: Array) -> Array:
    """The motions (rows, k) of held dofs, with the free ones in static equilibrium."""
    fixed = structure.fixed[structure.fixed < structure.rows]
    pulled = -multiply(free.K, columns)
    pulled[fixed] = 0.0
    solver = structure.factorize()
    found = np.zeros_like(pulled)
    moving = structure.comm.allreduce(np.einsum("ij,ij->j", pulled, pulled)) > 0
    if structure.rigid_modes.shape[1]:
        for k in np.flatnonzero(moving):
            found[:, k] = beside_rigid(structure, solver, pulled[:, k])
    elif moving.any():
        found[:, moving] = solver.solve_checked(pulled[:, moving])
    found[fixed] = 0.0
    return np.asarray(columns + found)


def _uniform(free: Structure) -> Array:
    """Unit translations (rows, 3) of the whole part."""
    from antiosc.fem.structure.rigid_body_modes import about

    return about(on_mesh(free).form, np.zeros(3))[:, :3]
