"""Position in the thickness of a sheet or the section of a beam at which a quantity is evaluated;
largest distance from the structure of a point that is moved onto it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.checks import point_text
from antiosc.base.errors import InputError
from antiosc.base.stresses import Strengths, TensileStrength
from antiosc.fem.elements import Layer, Section

if TYPE_CHECKING:
    from antiosc.fem.structure.place import Place as PartPlace

#: Default limit for moving a point: this share of the part's size, or one element.
SNAP_SHARE = 0.02
#: Why beams of a section without an outline have no stress on it.
NO_OUTLINE_REASON = (
    "a section given by A and I has no outline; give fibre, the distances (y, z) of the point from"
    " its centroid, or the Section an outline"
)

SHEET_SURFACES = ("top", "bottom", "middle")


@dataclass(frozen=True)
class Reach:
    """Largest distance from which a point off the structure is moved onto the structure."""

    what: str  # the point in words, for messages
    #: largest distance [m]; None: `SNAP_SHARE` of the part's size, or one element
    snap: float | None = None
    #: the remedy for messages
    remedy: str = "give a point on it, or the length that it may be moved (snap)"

    def check(
        self, point: Array, nearest: Array, size: float, element: Callable[[], float]
    ) -> None:
        """InputError if `nearest` is too far from `point`; `size` [m] of the part."""
        distance = float(np.linalg.norm(point - nearest))
        limit = SNAP_SHARE * size if self.snap is None else self.snap
        if distance > limit and self.snap is None:
            limit = max(limit, element())
        if distance <= limit:
            return

        rule = "2 % of the part's size, or one element" if self.snap is None else "the length given"
        units = f"; coordinates are in metres, and the part measures {size:.3g} m"
        raise InputError(
            f"{self.what} {point_text(point)} is {distance:.3g} m off the structure, whose nearest "
            f"point is {point_text(nearest)}: farther than {limit:.3g} m, {rule}"
            f"{units if distance > size else ''}; {self.remedy}."
        )

    def check_at(self, point: Array, place: PartPlace) -> None:
        """`check` for a `point` (3,) in the structure's axes and its nearest `place` on a part."""
        extent = place.member.part.mesh.extent()
        self.check(point, place.placed, extent, lambda: place.cell_size)


def check_reach(reach: Reach, point: Array, points: Array, nearest: int) -> None:
    """`Reach.check` for node `nearest` of `points` (P, 3); element size: distance to next node."""
    x = points[nearest]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    reach.check(
        point, x, size, lambda: float(np.sort(np.linalg.norm(points - x, axis=1))[:2].max())
    )


@dataclass(frozen=True)
class Place:
    """A position in the thickness of a sheet or the section of a beam, as in `probe`."""

    surface: str = "top"  # "top", "bottom" or "middle" of a sheet or of its `layer`
    #: number of a layer, from the bottom, 0 the first; None: the whole thickness
    layer: int | None = None
    #: (y, z) [m] from the centroid in a beam's axes, number of an outline point, None: all
    fibre: tuple[float, float] | int | None = (0.0, 0.0)
    local: bool = False  # whether tensors are in local axes instead of the mesh's axes
    #: group of beams on edges of a sheet that are evaluated; None: the cells are
    stiffener: str | None = None


def on_outlines(sections: Sequence[Section], place: Place) -> list[Place]:
    """Positions at all points of the sections' outlines; [] if a section has no outline."""
    sizes = [len(section.outline) for section in sections]
    if min(sizes):
        return [replace(place, fibre=k) for k in range(max(sizes))]
    return []


#: A yield strength, what cracks in tension, or strengths of a ply; None: not known.
AnyStrength: TypeAlias = float | TensileStrength | Strengths | None


class Origin(NamedTuple):
    """Origin of tensors: the strength of their material, and their place in the sheet."""

    strength: AnyStrength
    place: Place


class NodeTensors(NamedTuple):
    """Tensors at nodes, on rank 0; a node may have several, for instance of two materials."""

    nodes: IntArray  # (S,) node of each tensor
    columns: Array  # (S, 6, columns) components 11, 22, 33, 23, 13, 12 for each shape
    origin: IntArray  # (S,) index of each tensor in `origins`
    origins: list[Origin]


def layers_of(material: object) -> Sequence[Layer]:
    """Layers of a laminate; () for any other material."""
    return getattr(material, "layers", ())


def strength_of(material: object, place: Place) -> AnyStrength:
    """Strength at a place: yield strength, `TensileStrength` or a layer's strength; None if it is
    unknown."""
    layers = layers_of(material)
    if not layers:
        tensile = getattr(material, "tensile", None)
        if tensile is not None:
            return TensileStrength(*tensile)
        return getattr(material, "yield_strength", None)
    return None if place.layer is None else layers[place.layer].strength


def place(
    surface: object, layer: object, fibre: object, axes: object, stiffener: str | None = None
) -> Place:
    """The position given by arguments of `probe`; InputError for invalid arguments."""
    surface = checks.choice("surface", surface, SHEET_SURFACES)
    if layer is not None:
        layer = checks.whole("layer", layer, least=0)

    if fibre is not None:
        y, z = checks.floats("fibre", fibre, (2,)).tolist()
        fibre = (y, z)

    local = checks.choice("axes", axes, ("global", "local")) == "local"
    if stiffener is not None:
        checks.text("stiffener", stiffener)

    return Place(surface, layer, fibre, local, stiffener)
