"""Planes on which a part is held as on a plane of symmetry: the part may be cut there."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from antiosc import Structure
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError
from antiosc.base.texts import engineering

#: Distance from a plane, over the size of the part, at which a node lies on it.
ON_PLANE = 1e-6
#: Fewest nodes of such a plane.
FEWEST = 4
#: A number of which no two multiples have a common part behind the point.
GOLDEN = 0.6180339887498949
#: Largest rounding of a motion of 1 to 2: 1e-15 at the middles of edges of triangles.
ROUNDING = 1e-9
#: The sentences of structures: 0.03 to 0.1 s for 43 000 dofs, at every click of a page.
_notes: WeakKeyDictionary[Structure, str] = WeakKeyDictionary()


def symmetry_note(structure: Structure | None) -> str:
    """Sentence on the planes at the ends of a part that are held along their normals alone.

    "" without such a plane. All ranks must call it.
    """
    if structure is None:
        return ""
    if structure not in _notes:
        _notes[structure] = _note(_planes(structure))
    return _notes[structure]


def _note(planes: list[tuple[str, float]]) -> str:
    """The sentence on planes (axis, coordinate [m]); "" without one."""
    if not planes:
        return ""
    named = " and ".join(f"{axis} = {engineering(place, 'm')}" for axis, place in planes)
    held = " and ".join(f"along {axis} alone" for axis in dict(planes))
    return (
        f"The nodes on the plane {named} are held {held}, as on a plane of symmetry. If the part is"
        " cut there, striker and force count for the cut part: a blow beside the plane is computed"
        " together with its mirror image, so give the whole part; on the plane take half the"
        " striker's mass and half the contact stiffness, and the whole part has twice the force"
    )


def held_motions(structure: Structure) -> tuple[Array, Array]:
    """(nodes (N, 3) of a structure, motion (N, 3) of each if all free dofs move, each by another
    number: 0 where it is held); empty for matrices alone.
    """
    from antiosc.extension import source

    motion = 1.0 + (np.arange(structure.rows)[:, None] * GOLDEN) % 1.0  # none cancels another
    motion[structure.fixed[structure.fixed < structure.rows]] = 0.0
    try:
        nodes, _, displacements = source(structure).at_nodes(structure, motion)
    except AntioscError:
        return np.zeros((0, 3)), np.zeros((0, 3))
    moved = displacements[:, :, 0]
    return nodes, np.where(np.abs(moved) > ROUNDING, moved, 0.0)


def _planes(structure: Structure) -> list[tuple[str, float]]:
    """(axis, coordinate [m]) of the planes at the ends of a part whose nodes are held along their
    normals, most of them along nothing else.
    """
    nodes, motion = held_motions(structure)
    if motion.shape[1] < 3 or len(nodes) < FEWEST:
        return []
    fixed = motion == 0
    size = float(np.ptp(nodes, axis=0).max())
    found = []
    for axis, name in enumerate("xyz"):
        x = nodes[:, axis]
        alone = fixed[:, axis] & (fixed.sum(axis=1) == 1)
        for place in {float(x.min()), float(x.max())}:
            on_plane = np.abs(x - place) <= ON_PLANE * size
            held = fixed[on_plane, axis].all() and not fixed[~on_plane, axis].all()
            if held and alone[on_plane].sum() > max(FEWEST, on_plane.sum() / 2):
                found.append((name, place))
    return found
