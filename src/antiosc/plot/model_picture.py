"""The anti-oscillator model of one site as a picture: springs, masses and the striker.

The residual mass m0 rests on the spring k0. The anti-oscillators stand on m0, and the striker
presses on it through the contact law (Article Fig. 1, Eqs. 21 and 22).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.texts import engineering

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Anti-oscillators that are drawn; the others are told as a sum.
DRAWN = 6
#: Distance between neighbouring bodies on the residual mass.
PITCH = 1.6

MASS = {"facecolor": "#c9d7ea", "edgecolor": "#1f3552", "lw": 1.2}
LINE = {"color": "#1f3552", "lw": 1.2}


def draw_model(ax: Axes, m0: float, k0: float, m: Array, omega: Array) -> None:
    """Draw the model of one site: m0 [kg], k0 [N/m], masses m (N,), frequencies omega (N,) [rad/s].

    The areas of the anti-oscillators are in the ratio of their masses.
    """
    drawn = min(DRAWN, len(m))
    left, right = -1.1, (drawn + 0.6) * PITCH

    _draw_residual(ax, m0, k0, left, right)
    _draw_striker(ax)
    for i in range(drawn):
        side = np.sqrt(m[i] / np.max(m[:drawn]))
        text = f"{engineering(omega[i] / (2 * np.pi), 'Hz')}\n{engineering(m[i], 'kg')}"
        _draw_oscillator(ax, (i + 1) * PITCH, max(side, 0.12), text)

    if len(m) > drawn:
        rest = engineering(float(np.sum(m[drawn:])), "kg")
        ax.text(right + 0.3, 1.7, f"and {len(m) - drawn}\nmore:\n{rest}", va="center", fontsize=8)

    ax.set(xlim=(left - 0.4, right + 1.6), ylim=(-2.5, 4.1), aspect="equal")
    ax.axis("off")


def _draw_residual(ax: Axes, m0: float, k0: float, left: float, right: float) -> None:
    """The residual mass as a plate; below it its spring and the ground, unless k0 is zero."""
    from matplotlib.patches import Rectangle

    ax.add_patch(Rectangle((left, -0.3), right - left, 0.6, **MASS))
    ax.text(
        (left + right) / 2, 0, f"residual mass {engineering(m0, 'kg')}", ha="center", va="center"
    )

    if k0 == 0:
        ax.text((left + right) / 2, -0.8, "moves freely", ha="center", va="center")
        return

    middle = (left + right) / 2
    _spring(ax, middle, -0.3, -1.9)
    ax.plot((middle - 1, middle + 1), (-1.9, -1.9), **LINE)
    ax.add_patch(Rectangle((middle - 1, -2.15), 2, 0.25, fill=False, hatch="////", lw=0))
    ax.text(middle + 0.5, -1.1, f"static stiffness {engineering(k0, 'N/m')}", va="center")


def _draw_striker(ax: Axes) -> None:
    """The striker above the site, with the spring of the contact law below it."""
    from matplotlib.patches import Circle

    ax.add_patch(Circle((0, 2.1), 0.55, facecolor="#f2c9a1", edgecolor="#7a3b00", lw=1.2))
    ax.text(0, 3.75, "striker", ha="center", va="center")
    ax.annotate("", (0, 2.75), (0, 3.5), arrowprops={"arrowstyle": "->", "color": "#7a3b00"})
    _spring(ax, 0, 1.55, 0.45)
    ax.text(-0.35, 1.0, "contact\nlaw", ha="right", va="center", fontsize=8)
    ax.plot((-0.3, 0.3), (0.45, 0.45), **LINE)


def _draw_oscillator(ax: Axes, x: float, side: float, text: str) -> None:
    """One anti-oscillator: a mass of that side on its spring, and its frequency and mass."""
    from matplotlib.patches import Rectangle

    _spring(ax, x, 0.3, 1.3)
    ax.add_patch(Rectangle((x - side / 2, 1.3), side, side, **MASS))
    ax.text(x, 2.45, text, ha="center", va="bottom", fontsize=8)


def _spring(ax: Axes, x: float, start: float, end: float, turns: int = 4) -> None:
    """A spring along y as a zigzag."""
    y = np.linspace(start, end, 2 * turns + 4)
    zigzag: Any = 0.16 * (-1.0) ** np.arange(2 * turns)
    ax.plot(np.concatenate(([x, x], x + zigzag, [x, x])), y, **LINE)
