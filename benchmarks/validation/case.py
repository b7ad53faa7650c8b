"""What the validation book consists of: cases with rows, and how a row is judged and printed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from antiosc import plotting

#: how a reference value came here: read in the source or in a page that quotes it; recalled from
#: memory, so that it is no proof; or the solution of an equation that the source publishes
Known = Literal["read", "recalled", "equation"]


@dataclass(frozen=True)
class Row:
    """One value of a case.

    Attributes
    ----------
    quantity : name and unit.
    reference, found : the published value and ours.
    bound : largest difference that the source allows; relative, or absolute if `absolute`.
    known : how the reference value is known.
    why : explanation of a row that lies outside its bound.
    """

    quantity: str
    reference: float
    found: float
    bound: float
    known: Known = "read"
    absolute: bool = False
    why: str = ""

    @property
    def difference(self) -> float:
        """Ours minus the reference; relative unless `absolute`."""
        change = self.found - self.reference
        return change if self.absolute else change / abs(self.reference)

    @property
    def agrees(self) -> bool:
        """Whether ours lies within the bound."""
        return abs(self.difference) <= self.bound

    def cells(self) -> list[str]:
        """Reference, ours, difference, bound and verdict as texts."""
        if self.absolute:
            difference, bound = f"{self.difference:+.2g}", f"±{self.bound:.2g}"
        else:
            difference, bound = f"{self.difference:+.2%}", f"±{100 * self.bound:.3g} %"
        verdict = "within" if self.agrees else "**outside**"
        values = [f"{value:.5g}" for value in (self.reference, self.found)]
        return [self.quantity, values[0], self.known, values[1], difference, bound, verdict]


@dataclass(frozen=True)
class Case:
    """A published test.

    Attributes
    ----------
    name : short and unique; its picture is `name`.png.
    title : one line.
    given : the data of the source, and what of it is recalled.
    source : where the data and the values stand, and where the bounds come from.
    run : runs the case by the public API, draws its picture at the path, returns its rows.
    measured : whether the reference values were measured.
    """

    name: str
    title: str
    given: str
    source: str
    run: Callable[[Path], list[Row]]
    measured: bool = False


@contextmanager
def drawing(picture: Path, x: str, y: str) -> Iterator[Any]:
    """The axis of a picture with these labels, which is then saved."""
    figure, axes = plotting.panels(1, 1, size=(7, 3.2))
    (axis,) = axes.ravel()
    yield axis
    axis.set(xlabel=x, ylabel=y)
    axis.legend()
    plotting.save_figure(figure, picture, dpi=100)
