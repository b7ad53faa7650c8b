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

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.process import one_thread
from antiosc.base.texts import Brief
from antiosc.fem.assembly import with_parts
from antiosc.fem.extraction import beside_rigid
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.platform import collective
from antiosc.fem.site import Site
from antiosc.fem.structure.structure import Structure
from antiosc.results.fields import counted, shapes_of
from antiosc.simulation.histories.body_motion import amplitudes, forces_of, times_of
from antiosc.simulation.histories.history import History


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
    structure's list; in an assembly those of the parts come first, as "part:group" and
    "part:support 1". A dof that two supports hold is counted with the first.
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
    history: History,
    site: Site | Mapping[str, Site],
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Reactions:
    """Reactions of every support: of the contact forces, the loads and the inertia.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted: of a mesh, or an assembly.
    history : History
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
    the supports. Where several supports hold the two sides of a joint, the joint carries no force
    there: each support carries what its own part brings.

    Raises
    ------
    InputError
        A structure without supports, of given matrices or with superelements; sites that are not
        those of the model; a moving ground; gravity on a part that its supports let slide.
    """
    checks.instance("structure", structure, Structure, "a Structure")
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    shapes = shapes_of(structure, history, body)
    at = times_of(history, times)
    sites = _named(site)
    matrices = with_parts(structure, "given matrices have lost the dofs of their supports.")
    from antiosc.fem.site.at_points import Released  # needs dolfinx

    released = Released(matrices, structure.supports)
    _check(structure, history)
    following = _following(structure, released.pulled)
    rigid = released.rigid()
    moved, carried = released.inertia(following, rigid)
    work, applied = released.applied(sites, rigid)
    forces = forces_of(history, at, body)
    if len(work) != forces.shape[1]:
        raise InputError(
            f"the model has {forces.shape[1]} directions of contact, the sites given {len(work)}: "
            "give the sites with which it was extracted, in their order."
        )
    comm = structure.comm
    accelerations = amplitudes(history, at, body, 2)
    found = accelerations @ dot(comm, shapes, moved) - forces @ work
    names = list(released.centres)
    return Reactions(
        time=at,
        force={name: found[:, 6 * i : 6 * i + 3] for i, name in enumerate(names)},
        moment={name: found[:, 6 * i + 3 : 6 * i + 6] for i, name in enumerate(names)},
        centre=released.centres,
        applied=forces @ applied,
        inertia=accelerations @ dot(comm, shapes, carried),
    )


def _check(structure: Structure, history: History) -> None:
    scene = history.assembly.scene
    pulled = bool(np.any(scene.gravity))
    if scene.base is not None:
        raise InputError("reactions under a moving ground (Base) are not implemented.")
    if pulled and structure.rigid_modes.shape[1]:
        raise InputError(
            "reactions under gravity of a part that its supports let slide are not implemented."
        )


def _named(site: Site | Mapping[str, Site]) -> list[Site]:
    sites = list(site.values()) if isinstance(site, Mapping) else [site]
    if not sites:
        raise InputError("site must name at least one Site; got an empty dict.")
    for one in sites:
        checks.instance("site", one, Site, "a Site, or a dict {name: Site}")
    return sites


def _following(structure: Structure, pulled: Array) -> Array:
    """Static equilibrium (rows, k) of the free dofs under forces (rows, k)."""
    fixed = structure.fixed[structure.fixed < structure.rows]
    solver = structure.factorize()
    found = np.zeros_like(pulled)
    moving = structure.comm.allreduce(np.einsum("ij,ij->j", pulled, pulled)) > 0
    if structure.rigid_modes.shape[1]:
        for k in np.flatnonzero(moving):
            found[:, k] = beside_rigid(structure, solver, pulled[:, k])
    elif moving.any():
        found[:, moving] = solver.solve_checked(pulled[:, moving])
    found[fixed] = 0.0
    return found
