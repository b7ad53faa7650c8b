"""Pictures of tests: without their layout, which takes most of the time of a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from antiosc.plot import charts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

render = charts.render


def rough(figure: Figure, target: object, **_: object) -> None:
    """`render` without layout and options, which tests/charts and tests of commands have."""
    figure.set_layout_engine()  # none; "none" leaves one, for which a figure is drawn twice
    render(figure, target, dpi=50)
