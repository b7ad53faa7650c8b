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
    known = curves()
    x = np.geomspace(0.5, 300, 150)
    law = compare.LAW
    laws: dict[str, ao.Hysteretic] = {
        "ElasticPlastic": law,
        "Thornton, 1.6 Y": ao.Thornton(law.stiffness, law.yield_indentation),
        "Stronge": ao.Stronge(law.stiffness, law.yield_indentation),
    }
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    for name, of in known.items():
        left.plot(of.x, of.ratio, ".", ms=3, label=name)
        tops = sorted(top for top in of.unloading if top <= 300)
        right.plot(tops, [of.restitution(top) for top in tops], "o", ms=4, label=name)
    for name, one in laws.items():
        found = np.array([compare.measured(one, each)[:2] for each in x])
        left.plot(x, found[:, 0] / x**1.5, lw=1, label=name)
        right.plot(x, found[:, 1], lw=1)
    left.set(xscale="log", ylabel="force over Hertz's", xlim=(0.5, 300), ylim=(0, 1.6))
    right.set(xscale="log", ylabel="restitution of a free body", xlim=(0.5, 300))
    for axes in (left, right):
        axes.set_xlabel("indentation over that at yield")
    left.legend(fontsize=7)
    figure.savefig(OUT, dpi=120)


if __name__ == "__main__":
    main()
