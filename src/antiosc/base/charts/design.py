"""A design map as a picture: blue where more material lowers the goal, red where it raises it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array
from antiosc.base.charts.figures import finished
from antiosc.base.charts.surfaces import draw_faces, draw_lines, frame, space

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Share of the faces whose values are within the colours: a few at the site are far larger.
SHOWN = 0.98


def draw_design(
    corners: Array, value: Array, label: str, path: str | os.PathLike[str] | None
) -> Figure | Path:
    """Faces (F, 2 to 4, 3) [m] coloured by `value` (F,) about zero; NaN is grey."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    top = float(np.nanquantile(np.abs(value), SHOWN)) or 1.0
    scale = ScalarMappable(Normalize(-top, top), "RdBu_r")
    figure, axes, unit, name = space(corners.reshape(-1, 3), shown=path is None)
    around = [0, 1, 3, 2] if corners.shape[1] == 4 else list(range(corners.shape[1]))
    draw = draw_lines if corners.shape[1] < 3 else draw_faces
    draw(figure, axes, unit * corners[:, around], value, label, scale)
    frame(axes, unit * corners.reshape(-1, 3))
    axes.set(xlabel=f"x ({name})", ylabel=f"y ({name})", zlabel=f"z ({name})")
    if np.ptp(corners[..., 2]) == 0.0:  # a plane part is seen from above
        axes.view_init(elev=90, azim=-90)
        axes.set(zticks=[], zlabel="")
    return finished(figure, path)
