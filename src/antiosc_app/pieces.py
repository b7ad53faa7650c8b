"""A picture of the pieces of a part as boxes, by which one is chosen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from antiosc.io.neutral import Piece

#: Ending of the picture's name.
ENDING = ".pieces.png"
#: Largest number of pieces that are drawn.
MOST_DRAWN = 12
#: Corners of a box, and pairs of them that an edge joins.
CORNERS = np.array(list(product((0, 1), repeat=3)))
EDGES = [(a, b) for a, b in combinations(range(8), 2) if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1]


def draw(pieces: Sequence[Piece], path: Path, chosen: int | None = None) -> Path:
    """Draw the boxes of pieces with their ranks; `chosen`: rank of the piece that is read."""
    from antiosc.plot.charts import save_figure
    from antiosc.plot.surfaces import LABEL_PAD, axes_in_space, fit_limits

    ends = np.array([[piece.low, piece.high] for piece in pieces[:MOST_DRAWN]])
    ends = np.pad(ends, ((0, 0), (0, 0), (0, 3 - ends.shape[2])))
    figure, axes, scale, unit = axes_in_space(ends.reshape(-1, 3), shown=False)
    ends = scale * ends
    for rank, (low, high) in enumerate(ends, 1):
        corners = low + CORNERS * (high - low)
        colour = "C3" if rank == chosen else f"C{rank % 3}"
        width = 2.0 if rank == chosen else 0.8
        for edge in EDGES:
            axes.plot(*corners[list(edge)].T, color=colour, linewidth=width)
        axes.text(*(low + high) / 2, str(rank), color=colour, weight="bold", ha="center")
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", zlabel=f"z ({unit})")
    fit_limits(axes, ends.reshape(-1, 3))
    axes.zaxis.labelpad = LABEL_PAD
    save_figure(figure, path, dpi=100, bbox_inches="tight", pad_inches=0.2)  # else z is cut
    return path
