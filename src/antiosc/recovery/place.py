"""Position in the thickness of a sheet or the section of a beam at which a quantity is taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.base.stresses import Strengths, Tensile
from antiosc.fem.elements import Layer, Section

#: Why beams of a section without an outline have no stress on it.
NO_OUTLINE = (
    "a section given by A and I has no outline; give fibre, the distances (y, z) of the point from"
    " its centroid, or the Section an outline"
)

SURFACES = ("top", "bottom", "middle")


@dataclass(frozen=True)
class Place:
    """A position within the thickness or the section, from the arguments of `probe`.

    Attributes
    ----------
    surface : "top", "bottom" or "middle" of a sheet or of its `layer`, or a direction (3,): the
        outer surface on this side.
    layer : number of a layer, from the bottom, 0 the first; None: the whole thickness.
    fibre : (y, z) distances from the centroid of a beam's section along its axes, m, or the number
        of a point of its outline; None: not given.
    local : whether tensors are in the local axes, not in those of the mesh.
    stiffener : group of beams on edges of a sheet whose quantity is taken; None: that of the cells.
    """

    surface: str | tuple[float, ...] = "top"
    layer: int | None = None
    fibre: tuple[float, float] | int | None = (0.0, 0.0)
    local: bool = False
    stiffener: str | None = None

    def within(self, R: Array) -> Place:
        """The position in the axes of a part that its placement rotates by R (3, 3)."""
        if isinstance(self.surface, str):
            return self
        return replace(self, surface=tuple((np.asarray(self.surface) @ R).tolist()))


def on_outlines(sections: Sequence[Section], place: Place) -> list[Place]:
    """The position at each outline point of the sections; none if a section has no outline."""
    sizes = [len(section.outline) for section in sections]
    if min(sizes):
        return [replace(place, fibre=k) for k in range(max(sizes))]
    return []


#: A yield strength, what cracks in tension, or strengths of a ply; None: not known.
AnyStrength: TypeAlias = float | Tensile | Strengths | None


class Origin(NamedTuple):
    """Origin of some tensors: strength of the material, and position in a sheet."""

    strength: AnyStrength
    place: Place


class NodeTensors(NamedTuple):
    """Tensors at nodes, on rank 0; a node may have several.

    Attributes
    ----------
    nodes : (S,) node of each tensor.
    columns : (S, 6, columns) components.
    origin : (S,) index of each tensor in `origins`.
    """

    nodes: IntArray
    columns: Array
    origin: IntArray
    origins: list[Origin]


def layers_of(material: object) -> Sequence[Layer]:
    """The layers of a laminate; () for other materials."""
    layers: Sequence[Layer] = getattr(material, "layers", ())
    return layers


def strength_of(material: object, place: Place) -> AnyStrength:
    """Yield strength of a material, its strength in tension if it cracks, or strengths of a
    laminate's layer; None if unknown.
    """
    layers = layers_of(material)
    if not layers:
        tensile = getattr(material, "tensile", None)
        return getattr(material, "yield_strength", None) if tensile is None else Tensile(*tensile)
    strength: Strengths | None = None if place.layer is None else layers[place.layer].strength
    return strength


def place(
    surface: object, layer: object, fibre: object, axes: object, stiffener: str | None = None
) -> Place:
    """The position from checked arguments of `probe`; InputError for invalid ones."""
    if isinstance(surface, str):
        checks.choice("surface", surface, SURFACES)
    elif isinstance(surface, Sequence) or hasattr(surface, "shape"):
        vector = checks.floats("surface", surface, (3,))
        if not np.linalg.norm(vector):
            raise InputError("surface must not be the zero vector: it is the side of the sheet.")
        surface = tuple(vector.tolist())
    else:
        raise InputError(
            f"surface must be 'top', 'bottom', 'middle' or a direction (x, y, z); got "
            f"{checks.shown(surface)}."
        )
    if layer is not None:
        layer = checks.whole("layer", layer, least=0)
    if fibre is not None:
        y, z = checks.floats("fibre", fibre, (2,)).tolist()
        fibre = (y, z)
    local = checks.choice("axes", axes, ("global", "local")) == "local"
    if stiffener is not None:
        checks.text("stiffener", stiffener)
    return Place(surface, layer, fibre, local, stiffener)
