"""The anti-oscillator model of one site as a picture: springs, masses and the striker.

The residual mass m0 rests on the spring k0. The anti-oscillators stand on m0, and the striker
presses on it through the contact law (Article Eqs. 12, 15, 20, 23).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.texts import engineering

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Most anti-oscillators that are drawn; of the others the sum of masses is stated.
MAX_DRAWN = 6
#: Distance between neighbouring bodies on the residual mass.
BODY_SPACING = 1.6

MASS_STYLE = {"facecolor": "#c9d7ea", "edgecolor": "#1f3552", "lw": 1.2}
LINE_STYLE = {"color": "#1f3552", "lw": 1.2}
STRIKER_COLOUR = "#7a3b00"


def draw_model(
    ax: Axes, m0: float, k0: float, m: Array, omega: Array, shifts: Array | None = None
) -> None:
    """Draw the model of one site: m0 [kg], k0 [N/m], masses m (N,), frequencies omega (N,) [rad/s].

    `shifts` (N + 2,) shifts striker, residual mass and anti-oscillators down, in the picture's
    unit.
    """
    from matplotlib.patches import Rectangle

    drawn = min(MAX_DRAWN, len(m))
    left, right = -1.1, (drawn + 0.6) * BODY_SPACING
    striker, plate, *masses = -(np.zeros(len(m) + 2) if shifts is None else shifts)

    _draw_residual(ax, m0, k0, (left, right), plate)
    _draw_striker(ax, striker, plate)
    sides = np.sqrt(m[:drawn] / np.max(m[:drawn])).clip(0.12)
    for i, side in enumerate(sides):
        x, y = (i + 1) * BODY_SPACING, masses[i] + 1.3
        text = f"{engineering(omega[i] / (2 * np.pi), 'Hz')}\n{engineering(m[i], 'kg')}"
        _draw_spring(ax, x, plate + 0.3, y)
        ax.add_patch(Rectangle((x - side / 2, y), side, side, **MASS_STYLE))
        ax.text(x, y + 1.1, text, ha="center", va="bottom", fontsize=8)

    if len(m) > drawn:
        rest = engineering(float(np.sum(m[drawn:])), "kg")
        ax.text(right + 0.3, 1.7, f"and {len(m) - drawn}\nmore:\n{rest}", va="center", fontsize=8)

    ax.set(xlim=(left - 0.4, right + 1.6), ylim=(-2.5, 4.1), aspect="equal")
    ax.axis("off")


def _draw_residual(ax: Axes, m0: float, k0: float, ends: tuple[float, float], y: float) -> None:
    """Draw the residual mass as a plate and, unless k0 is zero, its spring and the ground."""
    from matplotlib.patches import Rectangle

    left, right = ends
    middle = (left + right) / 2
    ax.add_patch(Rectangle((left, y - 0.3), right - left, 0.6, **MASS_STYLE))
    ax.text(middle, y, f"residual mass {engineering(m0, 'kg')}", ha="center", va="center")

    if k0 == 0:
        ax.text(middle, -0.8, "moves freely", ha="center", va="center")
        return

    _draw_spring(ax, middle, y - 0.3, -1.9)
    ax.plot((middle - 1, middle + 1), (-1.9, -1.9), **LINE_STYLE)
    ax.add_patch(Rectangle((middle - 1, -2.15), 2, 0.25, fill=False, hatch="////", lw=0))
    ax.text(middle + 0.5, -1.1, f"static stiffness {engineering(k0, 'N/m')}", va="center")


def _draw_striker(ax: Axes, y: float, plate: float) -> None:
    """Draw the striker, raised by y, and its contact spring, above the residual mass at `plate`."""
    from matplotlib.patches import Circle

    ax.add_patch(Circle((0, y + 2.1), 0.55, facecolor="#f2c9a1", edgecolor=STRIKER_COLOUR, lw=1.2))
    ax.text(0, y + 3.0, "striker", ha="center", va="center", color=STRIKER_COLOUR)

    foot = max(y + 0.45, plate + 0.3)
    _draw_spring(ax, 0, y + 1.55, foot)
    ax.plot((-0.3, 0.3), (foot, foot), **LINE_STYLE)
    ax.text(-0.35, foot + 0.6, "contact\nlaw", ha="right", va="center", fontsize=8)


def _draw_spring(ax: Axes, x: float, start: float, end: float, turns: int = 4) -> None:
    """Draw a spring along y as a zigzag."""
    y = np.linspace(start, end, 2 * turns + 4)
    zigzag: Any = 0.16 * (-1.0) ** np.arange(2 * turns)
    ax.plot(np.concatenate(([x, x], x + zigzag, [x, x])), y, **LINE_STYLE)
