"""Tables of elliptic contacts that yield, by small-strain finite elements in space.

A rigid paraboloid A x^2 + B y^2 on a half-space, a quarter of it: trilinear hexahedra on a graded
grid of boxes with the mean dilatation of each element, the plasticity and the contact of
`half_space.py`. Writes `ellipse.csv`, with columns of `small_strain.csv`: forces over that at first
yield of the circle that stands for the ellipse. A grid is as fine over the semi-axes of an ellipse
as over the radius of a circle, so that a circle, B/A = 1, tells what it is off by. A case
takes some minutes.

    python benchmarks/elastoplastic/ellipse.py [B/A ...]
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.sparse
from half_space import Case, Pressed, Strains, graded
from truth import DEPTH, HEAD, replaced, widest

import antiosc as ao
from antiosc.engine.contact.geometry import _ellipse, equivalent_circle
from antiosc.fem.linalg.cholmod import Cholesky, NotPositiveDefiniteError

PATH = Path(__file__).parent / "ellipse.csv"
NU, A = 0.3, 0.5
RATIOS = (1.0, 3.0, 10.0)
#: the deepest x of each grid
DEEPEST = (10.0, 100.0)
#: Steps begin at `START` of it, where few cells touch; from `FROM` on they are in the table.
START, FROM, STEPS = 0.03, 0.25, 1.19
CELLS, GROWTH, REACH = 10, 1.8, 60.0
CORNERS = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)])
POINTS = CORNERS / np.sqrt(3.0)
#: rows of the strains xx, yy, zz, xy, yz, zx: which displacement by which place
PARTS = (
    (0, 0, 0), (1, 1, 1), (2, 2, 2),
    (3, 0, 1), (3, 1, 0), (4, 1, 2), (4, 2, 1), (5, 2, 0), (5, 0, 2),
)  # fmt: skip


class Boxes:
    """A grid for `Pressed`: a quarter of a half-space over semi-axes, z downwards."""

    def __init__(self, axes: tuple[float, float], bent: tuple[float, float], cells: int) -> None:
        sides = (*axes, min(axes))
        x, y, z = (graded(1.25 * w, round(1.25 * cells), GROWTH, REACH * w) for w in sides)
        self.strains, self.radius = Strains(3), min(axes)
        index = np.arange(len(z) * len(y) * len(x)).reshape(len(z), len(y), len(x))
        self.dofs = (3 * corners(index)[:, :, None] + np.arange(3)).reshape(-1, 24)
        self.size = 3 * index.size
        h = np.stack(np.meshgrid(np.diff(z), np.diff(y), np.diff(x), indexing="ij"), -1)
        self._strains(h.reshape(-1, 3)[:, ::-1])
        near = round(1.25 * cells) + 1
        self._place(index, 3 * index[0, :near, :near].ravel() + 2)
        high, wide = np.meshgrid(y[:near], x[:near], indexing="ij")
        self.gap = (bent[0] * wide**2 + bent[1] * high**2).ravel()

    def _place(self, index: np.ndarray, down: np.ndarray) -> None:
        """Where entries of elements are in the matrix; what is far does not move."""
        free = np.ones((*index.shape, 3), dtype=bool)
        free[-1] = free[:, -1] = free[:, :, -1] = False
        free[:, :, 0, 0] = free[:, 0, :, 1] = False
        free = free.ravel()
        self.free, self.order = np.flatnonzero(free), None
        place = np.cumsum(free) - 1
        rows = np.repeat(self.dofs, 24, axis=1).ravel()
        columns = np.tile(self.dofs, (1, 24)).ravel()
        self.keep = free[rows] & free[columns] & (rows >= columns)
        self.at = place[rows[self.keep]], place[columns[self.keep]]
        self.down = place[down]

    def _strains(self, h: np.ndarray) -> None:
        B = np.zeros((len(h), 8, 6, 24))
        for g, point in enumerate(POINTS):
            shape = 0.5 * (1 + CORNERS * point)
            for row, part, by in PARTS:
                others = np.prod(np.delete(shape, by, axis=1), axis=1)
                B[:, g, row, part::3] = CORNERS[:, by] * others / h[:, by, None]
        dilatation = B[:, :, :3].sum(axis=2)
        B[:, :, :3] += (dilatation.mean(axis=1)[:, None] - dilatation)[:, :, None] / 3
        self.B, self.volume = B, np.repeat(h.prod(axis=1)[:, None] / 8, 8, axis=1)
        self.columns = B.reshape(-1, 48, 24)

    def solve(
        self, tangents: np.ndarray, nodes: np.ndarray, springs: np.ndarray, loads: np.ndarray
    ) -> np.ndarray:
        """Displacements by loads (n, k); springs at some nodes of the surface."""
        n = len(self.free)
        weighed = np.matmul(tangents * self.volume[:, :, None, None], self.B)
        K = np.matmul(self.columns.transpose(0, 2, 1), weighed.reshape(-1, 48, 24))
        entries = np.append(K.ravel()[self.keep], springs)
        rows, columns = (np.append(each, nodes) for each in self.at)
        matrix = scipy.sparse.coo_matrix((entries, (rows, columns)), (n, n)).tocsr()
        try:
            factor = Cholesky(matrix, permutation=self.order)
        except NotPositiveDefiniteError as error:
            raise ArithmeticError("the tangent is not definite") from error
        self.order = factor.permutation
        return factor.solve(loads)

    def forces(self, stress: np.ndarray) -> np.ndarray:
        weighed = (stress * self.volume[..., None]).reshape(-1, 1, 48)
        each = np.matmul(weighed, self.columns)
        return np.bincount(self.dofs.ravel(), each.ravel(), self.size)[self.free]

    def strain(self, u: np.ndarray) -> np.ndarray:
        whole = np.zeros(self.size)
        whole[self.free] = u
        return np.matmul(self.columns, whole[self.dofs][..., None]).reshape(-1, 8, 6)


def corners(index: np.ndarray) -> np.ndarray:
    """The eight corners of each box of a grid of nodes, in the order of `CORNERS`."""
    low = [np.arange(n - 1) for n in index.shape]
    at = [[n + k for n, k in zip(low, corner, strict=True)] for corner in np.ndindex(2, 2, 2)]
    return np.stack([index[np.ix_(*each)].ravel() for each in at], axis=1)


def axes(ratio: float, depth: float) -> tuple[float, float]:
    """Semi-axes of the contact, a little above what is found: Hertz's, or of a plastic one."""
    m1, D, K = _ellipse(ratio)
    grows = 0.5 * widest(depth / DEPTH)
    long = np.sqrt(depth / A * max(D / K, grows))
    return long, max(long * np.sqrt(m1), np.sqrt(grows * depth / (A * ratio)))


def law_of(ratio: float) -> ao.ElasticPlastic:
    """The law of the circle that stands for the ellipse; it yields at `DEPTH`."""
    circle = equivalent_circle(Case(NU).modulus, A, A * ratio)
    law = ao.ElasticPlastic(circle.modulus, circle.radius, 1e-4)
    return replace(law, yield_strength=1e-4 * np.sqrt(DEPTH / law.yield_indentation))


def rows(ratio: float, deepest: float, cells: int = CELLS) -> list[tuple[object, ...]]:
    """x, and the force over that of the law at first yield."""
    law, name, found = law_of(ratio), f"B/A {ratio:g}", []
    grid = Boxes(axes(ratio, deepest * DEPTH), (A, A * ratio), cells)
    body = Pressed(Case(NU), grid, law.yield_strength)
    low = max(0.7, START * deepest)
    for x in np.geomspace(low, deepest, int(np.log(deepest / low) / np.log(STEPS)) + 1):
        force = 4 * body.press(x * DEPTH) / law.yield_force
        if x >= FROM * deepest:
            found.append((name, "load", *(f"{each:.5g}" for each in (x, x, force))))
    print(name, deepest, f"{time.process_time():.0f} s", flush=True)
    return found


def main(ratios: list[float]) -> None:
    for ratio in ratios:
        found = [row for deepest in DEEPEST for row in rows(ratio, deepest)]
        replaced(f"B/A {ratio:g}", found, PATH, HEAD[:5])


if __name__ == "__main__":
    main([float(each) for each in sys.argv[1:]] or list(RATIOS))
