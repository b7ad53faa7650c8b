"""How well a mesh resolves the largest stress of a part: the jumps between cells, and corners.

At a hole (P2 triangles of a half, a quarter and an eighth of its radius) the jumps were 4.6, 1.3
and 0.4 % of the stress, its error 3.2, 0.8 and 0.2 %; in a re-entrant corner of 270° they were 78,
77 and 65 % on three meshes, each of half the size of the one before, and the stress grew by 34 and
44 %.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.structure.structure import Structure
from antiosc.simulation.histories.body_motion import amplitudes

#: Jumps over the largest stress from which the mesh does not resolve it.
UNRESOLVED_JUMP = 0.2
#: Interior angle in degrees from which a corner is re-entrant; fillets of three cells have 210.
RE_ENTRANT = 215.0


def mesh_error(
    structure: Structure, shapes: Array, part: str | None, history: Any, times: Array, body: str
) -> Array | None:
    """Estimated errors [Pa] of the von Mises stress at all points at `times` (P,); on rank 0."""
    from antiosc.fem.fields.stress_errors import stress_jumps  # needs dolfinx

    at, number = np.unique(times, return_inverse=True)
    factors = amplitudes(history, at, body)[number.ravel()]
    return stress_jumps(structure, shapes, factors, part)


def doubt(structure: Structure, shapes: Array, part: str | None, x: Array, share: float) -> str:
    """A sentence on the largest stress at x (3,), whose error is this share of it; "" if none."""
    from antiosc.fem.fields.stress_errors import corner_at  # needs dolfinx

    angle, held = corner_at(structure, shapes, x, part)
    if angle >= RE_ENTRANT:
        return (
            f"the largest stress lies in a re-entrant corner of {angle:.0f} degrees, where it grows"
            " with every refinement of the mesh: model the fillet, or judge it at a distance"
        )
    if held:
        return (
            "the largest stress lies at a support that holds the part rigidly, where it grows with"
            " refinements of the mesh: judge it at a distance, or model what holds the part"
        )
    if share >= UNRESOLVED_JUMP:
        return (
            f"the cells at the largest stress differ by {share:.0%} of it: the mesh does not"
            " resolve it; make the cells there smaller"
        )
    return ""


def not_known(structure: Structure, shapes: Array, part: str | None) -> str:
    """That the error of the stresses of a part without solids is not known, if it has sheets."""
    from antiosc.fem.fields.stress_errors import families  # needs dolfinx

    if "sheet" not in families(structure, shapes, part):
        return ""
    return (
        "the error by the mesh is not estimated for shells, and under a point load or in the disc"
        " of the site the stress grows with refinements: compare with cells of half the size"
    )
