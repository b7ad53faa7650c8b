"""The motions of an assembly without strain, checked and reported; see `motions`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from antiosc._types import Array, Matrix
from antiosc.errors import AccuracyError, InputError, warn
from antiosc.fem.assembly import motions
from antiosc.fem.assembly.constraint_rows import Eliminated
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.scaling import force_ratios
from antiosc.fem.structure import rigid_body_modes
from antiosc.fem.structure.member import Member
from antiosc.fem.structure.null_space import SHIFT, orthonormal

#: Share of the largest motion below which a part is at rest, but for rounding.
AT_REST = 1e-6
#: Share of the largest mass of a motion below which it has none.
IDLE_MASS = 1e-12
#: Force of a motion without strain over that of the entries of K; rounding leaves about 1e-15.
STRAINLESS = 1e-9


def modes_of(
    layout: Layout,
    K: Matrix,
    M: Matrix,
    eliminated: Eliminated,
    rigid: Array,
    mechanisms: Array,
    moving: Sequence[motions.Loose],
) -> tuple[Array, float]:
    """(M-orthonormal motions without strain, first shift)."""
    found = eliminated.coordinates(np.hstack([rigid, mechanisms]))
    comm = MPI.COMM_SELF
    modes = orthonormal(comm, M, found)
    if modes.shape[1] < found.shape[1]:
        weight = found.T @ multiply(M, found)
        values, turn = np.linalg.eigh(weight)
        idle = eliminated.T @ found @ turn[:, values <= IDLE_MASS * values[-1]]
        points = [one for one in moving if np.abs(idle[one.rows]).max() > motions.STILL]
        raise InputError(
            "a reference point moves without resistance and without mass: "
            f"{_in_words(idle, points)}; join it, support it, or give it a mass."
        )
    if not modes.shape[1]:
        return modes, 0.0
    u = eliminated.T @ modes
    least = AT_REST * np.abs(u).max()
    left = max(_force_ratio(m, u[m.rows], least) for m in layout.members.values())
    if left > STRAINLESS:
        raise AccuracyError(
            f"a motion that no joint resists strains the assembly (‖K r‖/(‖K‖‖r‖) = {left:.1e}, "
            f"limit {STRAINLESS:.0e}): parts or their distances differ too much in size for double "
            "precision."
        )
    if modes.shape[1] == np.count_nonzero(~eliminated.dependent):
        return modes, 1.0  # any will do
    fields = eliminated.coordinates(motions.fields(layout))
    return modes, SHIFT * rigid_body_modes.first_elastic(comm, K, M, fields, modes)


def _force_ratio(member: Member, u: Array, least: float) -> float:
    """Largest force of motions (rows, k) of a part over that of the entries of its K.

    Motions below `least` are rounding.
    """
    moving = u[:, np.abs(u).max(axis=0) > least]
    if not moving.size:
        return 0.0
    K = member.part.K
    return float(force_ratios(K, moving, multiply(K, moving)).max())


def tell_motions(
    layout: Layout,
    rigid: Array,
    mechanisms: Array,
    moving: Sequence[motions.Loose],
    *,
    supported: bool,
) -> None:
    """Warn of mechanisms, and of rigid motions that supports leave."""
    if mechanisms.shape[1]:
        warn(
            "the joints leave parts free to move without strain: "
            f"{_in_words(mechanisms, moving)}; join or hold them unless it is intended.",
        )
    if supported and rigid.shape[1]:
        whole = motions.whole(layout, (layout.low + layout.high) / 2)
        warn(
            "the supports leave the assembly free to move as a rigid body: "
            f"{motions.described(whole, rigid)}; hold that too unless it is intended.",
        )


def _in_words(mechanisms: Array, moving: Sequence[motions.Loose]) -> str:
    """The motion of each piece in mechanisms."""
    names: dict[str, str] = {}
    for one in moving:
        names.setdefault(one.name, motions.described(one, mechanisms))
    return "; ".join(f"{name!r}: {words}" for name, words in names.items())
