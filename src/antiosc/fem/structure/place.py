"""`Place`: a located point on a part with a mesh."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.mesh.surface import ClosestPoint, size_at
from antiosc.fem.structure.meshed import Member

#: Parts are equally near if distances differ by less than this share of the largest part's size.
EQUAL_DISTANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Place:
    """A point of a part and the direction (3,) of an impact there, in the axes of the part."""

    member: Member
    nearest: ClosestPoint  # its cell, and the point there nearest to the given one
    direction: Array  # zero: none is given

    @property
    def point(self) -> Array:
        """Coordinates (3,) in the axes of the part [m]."""
        return self.nearest.x

    @property
    def placed(self) -> Array:
        """Coordinates (3,) in the axes of the structure [m]."""
        return self.member.at.placed(self.point[None])[0]

    @property
    def cell_size(self) -> float:
        """Largest distance [m] between corners of the cell."""
        return size_at(self.member.part.mesh, self.nearest)

    @property
    def material(self) -> Any:
        """The material of the cell."""
        return self.member.part.material_at(self.nearest)


def places_at(
    parts: Iterable[Member], points: Array, directions: Array | None = None
) -> list[Place]:
    """The nearest place of any part to each of points (P, 3) [m]; where parts touch, on the part
    that most faces the impact. `directions` (P, 3): of the impacts, in the structure's axes."""
    members = list(parts)
    nearest = [member.closest(points) for member in members]
    distance = np.array([found.distance for found in nearest])
    size = max(member.part.mesh.extent() for member in members)
    is_near = distance <= distance.min(axis=0) + EQUAL_DISTANCE * size

    places = []
    for k, direction in enumerate(np.zeros_like(points) if directions is None else directions):
        near = [
            Place(member, found[k], direction @ member.at.rotation)
            for member, found, one in zip(members, nearest, is_near[:, k], strict=True)
            if one
        ]
        places.append(near[0] if len(near) == 1 else min(near, key=_facing_cosine))

    return places


def _facing_cosine(place: Place) -> float:
    """Cosine between impact and outward normal; 0 on sheets and beams, and without a direction."""
    part = place.member.part
    if not part.kind.outside or not place.direction.any():
        return 0.0
    contact = part.surface_below(place.point[None], place.direction[None], np.full(1, np.nan))
    return float(contact.normals[0] @ place.direction)
