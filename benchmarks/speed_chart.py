"""What an error of the force costs, by method: the chart of README and its sentences.

Read from speed/speed_accuracy.json, which `speed_accuracy.py` writes; nothing is measured here.

    .venv/bin/python benchmarks/speed_chart.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import error_charts
import options
from speed_tables import STYLE

from antiosc import plotting

ROOT = Path(__file__).resolve().parent
FOUND = ROOT / "speed/speed_accuracy.json"
PICTURE = ROOT / "pictures/speed_chart.png"
#: The two blows on the bracket: name in the file -> title; the methods that are drawn.
CASES = {
    "bracket": "a ball, contact 83 µs",
    "bracket, heavy mass": "a falling mass, contact 3.9 ms",
}
METHODS = {
    "Krylov": "anti-oscillators",
    "superposition, static correction": "modes, static correction",
    "superposition": "modes",
    "unreduced, Newmark": "full model, Newmark",
    "unreduced, explicit": "full model, central differences",
}
#: Methods of antiosc and of a contact simulation of the whole part.
REDUCED, WHOLE = "Krylov", "unreduced, Newmark"
#: Error of the force at which the full model is compared.
GOOD = 2e-3


def main(picture: Path = PICTURE) -> None:
    """Draw the chart and print the sentences.

    Parameters
    ----------
    picture : file to draw
    """
    found = cases()
    figure, axes = plotting.panels(1, 2, size=(11, 3.6), sharey="row")
    for ax, (name, title) in zip(axes[0], CASES.items(), strict=True):
        styles = {word: "".join(STYLE[method]) for method, word in METHODS.items()}
        error_charts.plot_errors(curves(found[name]), ax, styles=styles)
        if bounds := found[name].get("proved"):
            cost, width = ([one[key] for one in bounds] for key in ("total", "width"))
            ax.loglog(cost, width, "k^--", ms=4, lw=1.2, label="proved bounds of the peak")
        mesh = found[name].get("mesh error of the peak")
        if mesh:
            ax.axhline(mesh, color="C7", ls=":")
            ax.text(1, mesh, "below: the mesh is the larger error", ha="right", va="bottom",
                    transform=ax.get_yaxis_transform(), fontsize=8)  # fmt: skip
        ax.set(title=title, xlabel="time of the whole computation (s)", ylabel="")
    axes[0, 0].set_ylabel("relative error of the force")
    legend = axes[0, 0].get_legend_handles_labels()
    axes[0, 1].legend(*legend, loc="center left", bbox_to_anchor=(1.02, 0.5))
    plotting.save_figure(figure, picture, dpi=200)
    print(picture, *sentences(found), sep="\n")


def cases() -> dict[str, Any]:
    """The smallest measurement of each case."""
    charts = json.loads(FOUND.read_text(encoding="utf-8"))["charts"]
    return {name: min(_of(charts, name), key=lambda one: one["dofs"]) for name in CASES}


def _of(charts: list[dict[str, Any]], name: str) -> list[dict[str, Any]]:
    return [one for one in charts if one["case"] == name]


def curves(case: dict[str, Any]) -> dict[str, tuple[list[float], list[float]]]:
    """Method in words -> seconds and errors."""
    return {
        word: ([row["total"] for row in own], [row["error force"] for row in own])
        for method, word in METHODS.items()
        if (own := [row for row in case["rows"] if row["method"] == method])
    }


def cheaper(case: dict[str, Any]) -> tuple[float, float, float]:
    """Error of the coarsest run of the full model; seconds of anti-oscillators as good, and its."""
    own, whole = (
        [row for row in case["rows"] if row["method"] == method] for method in (REDUCED, WHOLE)
    )
    coarse = min(
        (row for row in whole if row["error force"] <= GOOD),
        key=lambda row: row["total"],
        default=whole[-1],
    )
    good = [row["total"] for row in own if row["error force"] <= coarse["error force"]]
    return coarse["error force"], min(good), coarse["total"]


def sentences(found: dict[str, Any]) -> list[str]:
    """What README and the page say."""
    short, heavy = (found[name] for name in CASES)
    per_cent = min(
        row["total"]
        for row in short["rows"]
        if row["method"] == REDUCED and row["error force"] <= 0.01
    )
    error, own, whole = cheaper(heavy)
    return [
        f"1 % of the force in {per_cent:.2g} s, assembly to history, for {short['dofs']} dofs",
        f"{100 * error:.1g} % in {own:.2g} s where the full model takes {whole:.3g} s:"
        f" {whole / own:.2g} times cheaper",
    ]


if __name__ == "__main__":
    options.command(main)
