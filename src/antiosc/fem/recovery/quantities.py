"""The quantities that can be recovered at points of a part, by element family."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

from antiosc._types import Array
from antiosc.fem.recovery import beam, sheet, solid, truss
from antiosc.fem.recovery.place import Place
from antiosc.fem.recovery.shape_slopes import PointsInCells
from antiosc.fem.recovery.sheet import SheetAxes
from antiosc.fem.structure.meshed import MeshedStructure

FAMILIES: dict[str, ModuleType] = {"solid": solid, "beam": beam, "sheet": sheet, "truss": truss}
#: Gives a quantity (P, …, columns) at points.
Evaluate = Callable[[PointsInCells], Array]


def evaluator(part: MeshedStructure, quantity: str, place: Place) -> Evaluate:
    """What gives "strain", "stress", "rotation" or "section_forces"; to be made on all ranks."""
    family = FAMILIES[part.kind.name]
    function = getattr(family, quantity)
    if family is sheet and quantity != "rotation":
        axes = SheetAxes(part)
        return lambda at: function(at, place, axes)
    return lambda at: function(at, place)
