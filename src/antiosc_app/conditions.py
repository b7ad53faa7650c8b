"""What strikes a part, along which direction, and what holds it: rows of the table of an impact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from math import acos, degrees, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc import AntiOscillators, LinearBody, SceneHistory
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError
from antiosc.base.texts import engineering, point_text
from antiosc.models.body import info_of
from antiosc_app.live import striker_text
from antiosc_app.symmetry import held_motions

if TYPE_CHECKING:
    from antiosc import Structure
    from antiosc_app.scene_file.run import SceneResults

#: Angle between direction and normal [°] from which a row has the direction.
OBLIQUE = 1.0
#: Most supports that are named.
MOST_NAMED = 4


def conditions(results: SceneResults) -> list[tuple[str, str]]:
    """Rows (name, value) on the striker, the direction of an oblique impact, and the supports; []
    of several bodies. All ranks must call it.
    """
    hit = results.history
    if isinstance(hit, SceneHistory):
        return []
    structure = results.structure
    if structure is not None and not (structure.matrices.meshed or structure.matrices.assembled):
        structure = None  # given matrices lack motions that nothing holds
    scene = {} if results.compiled is None else results.compiled.document.data
    rows = [
        ("striker", ", ".join([striker_text(hit.impactor), *tip_texts(hit.impactor)])),
        ("direction", _oblique(structure, results.model)),
        ("held", _held(structure, scene)),
    ]
    return [row for row in rows if row[1]]


def beside_headline(results: SceneResults, rows: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """The rows without kind, mass and speed of the striker, which a headline has."""
    if not rows:
        return []
    (name, _), *others = rows
    tip = ", ".join(tip_texts(results.history.impactor))
    return [(name, tip), *others] if tip else others


def tip_texts(body: LinearBody | None) -> list[str]:
    """Radius and material of the striker's tip, as far as they are known."""
    lengths = {"radius": "radius", "tip_radius": "tip radius"}
    known = ((word, getattr(body, name, None)) for name, word in lengths.items())
    told = [f"{word} {engineering(a, 'm')}" for word, a in known if isinstance(a, float)]
    name = getattr(getattr(body, "material", None), "name", "")
    modulus = getattr(body, "E", None)
    if not name and isinstance(modulus, float):
        name = f"E = {engineering(modulus, 'Pa')}" if isfinite(modulus) else "rigid"
    return [*told, *filter(None, [name])]


def _oblique(structure: Structure | None, model: AntiOscillators | None) -> str:
    """The direction of a single site and its angle with the normal; "" along it, or if one of them
    is unknown.
    """
    info = info_of(model)
    if structure is None or info.point is None or info.direction is None:
        return ""
    from antiosc.reduce.site.surface import curvature_at  # it needs the finite elements

    with suppress(AntioscError):
        direction = np.asarray(info.direction)
        normal = curvature_at(structure, info.point, info.direction, lengths=False).normal
        angle = degrees(acos(min(abs(float(normal @ direction)), 1.0)))
        if angle >= OBLIQUE:
            return f"{_vector(direction)}, {angle:.2g}° from the normal"
    return ""


def _vector(direction: Array) -> str:
    """A direction as text, "(-0.2, -0.6, -0.775)"."""
    return f"({', '.join(f'{c:.3g}' for c in direction.round(9) + 0.0)})"


def _held(structure: Structure | None, scene: Mapping[str, Any]) -> str:
    """The supports with the number of their nodes, or that nothing is held; "" if it is unknown."""
    if structure is None:
        return ""
    _, motion = held_motions(structure)
    count = int((motion == 0).any(axis=1).sum())
    if not count:
        return "nothing: free" if structure.rigid_modes.shape[1] else "no node: springs hold it"
    noun = "1 node" if count == 1 else f"{count} nodes"
    names = list(_names(scene, {"": structure} | _parts(structure)))
    named = ", ".join(names[:MOST_NAMED])
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"{named}{more}: {noun}" if names else noun


def _parts(structure: Structure) -> dict[str, Any]:
    """The parts of an assembly by their names."""
    from antiosc.extension import with_parts

    return {member.name: member.part for member in with_parts(structure).members()}


def _names(scene: Mapping[str, Any], parts: Mapping[str, Any], name: str = "") -> Iterator[str]:
    """The supports of a scene and of its parts in words; `parts`: their structures, the scene's
    own with the name "".
    """
    given = scene.get("supports", ())
    if "deck" in scene and _holds(parts.get(name), given):
        yield "as in the deck"
    yield from map(_support, given)
    for inner, part in scene.get("parts", {}).items():
        yield from (f"{inner}:{text}" for text in _names(part, parts, inner))


def _holds(structure: Any, given: Sequence[Mapping[str, Any]]) -> bool:
    """Whether a deck holds its structure by supports of its own, which come before the given ones
    of the scene; a support of a group in several parts of a deck is one in each.
    """
    supports = getattr(structure, "supports", ())
    if not (supports and given):
        return bool(supports)
    first, group = supports[0].where, given[0].get("where")
    if not isinstance(first, str):  # those of a deck have groups
        return False
    return not isinstance(group, str) or _group(first) != _group(group)


def _group(name: str) -> str:
    """The name of a group without that of its part."""
    return name.rpartition(":")[2]


def _support(given: Mapping[str, Any]) -> str:
    """One support in words: its group or place, and its components if it holds some only."""
    fix = given.get("fix", "all")
    along = "" if fix == "all" else f" along {fix if isinstance(fix, str) else ', '.join(fix)}"
    return f"{_place(given)}{along}"


def _place(given: Mapping[str, Any]) -> str:
    """The group of a support, or where its nodes are."""
    if "near" in given:
        point, radius = given["near"]
        return f"within {engineering(radius, 'm')} of {point_text(point)}"
    if "plane" in given:
        point, normal = (np.asarray(vector, float) for vector in given["plane"])
        axis = int(np.abs(normal).argmax())
        across = np.count_nonzero(normal) == 1
        at = f"{'xyz'[axis]} = {engineering(point[axis], 'm')}"
        return f"plane {at}" if across else f"plane through {point_text(point)}"
    if "box" in given:
        return f"box {' to '.join(map(point_text, given['box']))}"
    return str(given.get("where", "numbered nodes"))
