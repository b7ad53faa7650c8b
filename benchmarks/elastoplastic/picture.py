"""The picture of docs/theory.md: laws of contact that yields against small_strain.csv.

python benchmarks/elastoplastic/picture.py
"""

from __future__ import annotations

from pathlib import Path

import compare
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from curves import curves

import antiosc as ao

OUT = Path(__file__).parents[2] / "docs" / "pictures" / "elastoplastic.png"


def main() -> None:
    mpl.use("Agg")
    x = np.geomspace(0.5, 300, 150)
    law = compare.LAW
    laws: dict[str, ao.Hysteretic] = {
        "ElasticPlastic, rigid ball": law,
        "the same, ball as stiff": compare.law_of("alike"),
        "Thornton, 1.6 Y": ao.Thornton(law.stiffness, law.yield_indentation),
        "Stronge": ao.Stronge(law.stiffness, law.yield_indentation),
    }
    shares = {"width_ratios": (4, 4, 1.7)}
    figure, (left, right, beside) = plt.subplots(
        1, 3, figsize=(11, 4), layout="constrained", gridspec_kw=shares
    )
    colours = plt.get_cmap("tab20").colors
    large = {f"{name}, large strains": of for name, of in curves("finite_strain.csv").items()}
    for (name, of), colour in zip((curves() | large).items(), colours, strict=False):
        mark = "x" if name in large else "."
        left.plot(of.x, of.ratio, mark, ms=4, color=colour)
        tops = sorted(top for top in of.unloading if top <= 300)
        right.plot(
            tops, [of.restitution(top) for top in tops], mark, ms=6, color=colour, label=name
        )
    for name, one in laws.items():
        found = np.array([compare.measured(one, each)[:2] for each in x])
        left.plot(x, found[:, 0] / x**1.5, lw=1)
        right.plot(x, found[:, 1], lw=1, label=name)
    left.set(xscale="log", ylabel="force over Hertz's", xlim=(0.5, 300), ylim=(0, 1.6))
    right.set(xscale="log", ylabel="restitution of a free body", xlim=(0.5, 300))
    handles, labels = right.get_legend_handles_labels()
    for axes in (left, right):
        axes.set_xlabel("indentation over that at yield")
    beside.axis("off")
    beside.legend(handles, labels, fontsize=7, loc="center", frameon=False)
    figure.savefig(OUT, dpi=120)


if __name__ == "__main__":
    main()
