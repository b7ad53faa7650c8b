"""What small_strain.csv and finite_strain.csv hold, as curves of x = indentation/that at yield."""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator, UnivariateSpline

HERE = Path(__file__).parent


class Curves:
    """Loading and unloading of a case; forces over that at first yield."""

    def __init__(self, loading: np.ndarray, unloading: dict[float, np.ndarray]) -> None:
        self.unloading = unloading
        self.x, self.ratio = loading[:, 0], loading[:, 1] / loading[:, 0] ** 1.5
        #: the grid's own error, from forces below yield, where Hertz's law is exact
        below = self.ratio[self.x <= 1]
        self.bias = float(np.mean(below)) if below.size else 1.0
        self.ratio = self.ratio / self.bias
        # over the logarithm of x; 0.6 % is the scatter of an edge that goes from node to node
        self._smooth = UnivariateSpline(
            np.log(self.x), np.log(self.ratio), k=4, w=np.full(len(self.x), 1 / 0.006)
        )
        grid = np.geomspace(1e-2, self.x[-1], 4000)
        steps = np.diff(grid) * (self.force(grid[1:]) + self.force(grid[:-1])) / 2
        self._work = grid, np.append(0.0, np.cumsum(steps))

    def force(self, x: np.ndarray) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        inside = np.clip(x, self.x[0], self.x[-1])
        ratio = np.exp(self._smooth(np.log(inside)))
        return x**1.5 * np.where(x < 1.0, 1.0, ratio)

    def work(self, x: float) -> float:
        return float(np.interp(x, *self._work))

    def unload(self, top: float) -> tuple[np.ndarray, np.ndarray]:
        """x and force of unloading, from the dent up; the last points go down by a power of 1.3."""
        x, force = self.unloading[top][:, 0], self.unloading[top][:, 1] / self.bias
        x, force = np.append(top, x), np.append(self.force(top), force)
        low = force <= max(0.2 * force[0], np.sort(force)[2])
        shift = np.polyfit(force[low] ** (1 / 1.3), x[low], 1)[1]
        return np.append(x, shift)[::-1], np.append(force, 0.0)[::-1]

    def dent(self, top: float) -> float:
        return float(self.unload(top)[0][0])

    def work_back(self, top: float) -> float:
        return float(PchipInterpolator(*self.unload(top)).integrate(self.dent(top), top))

    def restitution(self, top: float) -> float:
        return float(np.sqrt(self.work_back(top) / self.work(top)))


def curves(name: str = "small_strain.csv") -> dict[str, Curves]:
    loading: dict[str, list[tuple[float, ...]]] = defaultdict(list)
    unloading: dict[str, dict[float, list[tuple[float, ...]]]]
    unloading = defaultdict(lambda: defaultdict(list))
    with (HERE / name).open() as file:
        for row in csv.DictReader(file):
            point = tuple(float(row[key]) for key in ("x", "force"))
            if row["row"] == "load":
                loading[row["case"]].append(point)
            else:
                unloading[row["case"]][float(row["from_x"])].append(point)
    return {
        case: Curves(
            np.array(sorted(points)),
            {top: np.array(back) for top, back in unloading[case].items()},
        )
        for case, points in loading.items()
    }
