"""The way from a mesh to an answer on one screen: what is given and what is computed.

.venv/bin/python demos/flow.py --help
"""

from __future__ import annotations

from pathlib import Path

import command_line
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from antiosc import plotting

ROOT = Path(__file__).resolve().parent.parent
#: Steps in their order: what the user gives, what is computed from it, the call.
STEPS = (
    ("mesh, material,\nsupports", "K, M", "Structure"),
    ("site,\ndirection", "m0, k0 and\nanti-oscillators", "extract"),
    ("striker,\nspeed", "force, motion,\nerror bars", "simulate"),
    ("point or\nsurface", "displacement,\nstress", "probe, peak_field"),
)
GIVEN, COMPUTED = "#f2c9a1", "#c9d7ea"


def main(out: Path = ROOT / "out") -> dict[str, float]:
    """Draw the picture.

    Parameters
    ----------
    out : folder of the results
    """
    figure = Figure(figsize=(9, 3.1), layout="constrained")
    ax = figure.add_subplot()

    for k, (given, computed, call) in enumerate(STEPS):
        x = 3.0 * k
        box(ax, x, 1.6, given, GIVEN)
        box(ax, x, 0.0, computed, COMPUTED)
        arrow(ax, (x, 1.6 - 0.35), (x, 0.35))
        ax.text(x + 0.12, 0.8, call, va="center", family="monospace", fontsize=9)
        if k:
            arrow(ax, (x - 3.0 + 1.05, 0), (x - 1.05, 0))

    ax.text(-2.0, 1.6, "given", va="center", ha="center")
    ax.text(-2.0, 0.0, "computed", va="center", ha="center")
    ax.set(xlim=(-2.7, 10.3), ylim=(-0.6, 2.2))
    ax.axis("off")

    out.mkdir(parents=True, exist_ok=True)
    plotting.save_figure(figure, out / "flow.png")
    return {"steps": float(len(STEPS))}


def box(ax: Axes, x: float, y: float, text: str, color: str) -> None:
    """A box around its text."""
    around = {"boxstyle": "round,pad=0.35", "facecolor": color, "edgecolor": "#1f3552"}
    ax.text(x, y, text, ha="center", va="center", bbox=around)


def arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """An arrow from one point to another."""
    ax.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "#1f3552"})


if __name__ == "__main__":
    command_line.command(main)
