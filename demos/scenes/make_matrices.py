"""Writes beam_K.mtx, beam_M.mtx and beam_nodes.txt, the matrices of scenes/matrices.toml.

A steel beam of 0.8 m, 30 mm wide and 10 mm high, simply supported at both ends, in 16 elements of
Euler and Bernoulli; each node has the dofs z and ry, without those that the supports hold.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import mmwrite
from scipy.sparse import coo_matrix

LENGTH, WIDTH, HEIGHT = 0.8, 0.03, 0.01
E, RHO = 210e9, 7850.0
ELEMENTS = 16


def matrices() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K, M and rows (node, dof, x, y, z) of the dofs that are free."""
    h = LENGTH / ELEMENTS
    # u = (w, -w'): a positive rotation about y lowers the end at x > 0
    bending = np.array(
        [[12, -6 * h, -12, -6 * h], [-6 * h, 4 * h * h, 6 * h, 2 * h * h],
         [-12, 6 * h, 12, 6 * h], [-6 * h, 2 * h * h, 6 * h, 4 * h * h]]
    ) * E * WIDTH * HEIGHT**3 / 12 / h**3  # fmt: skip
    inertia = np.array(
        [[156, -22 * h, 54, 13 * h], [-22 * h, 4 * h * h, -13 * h, -3 * h * h],
         [54, -13 * h, 156, 22 * h], [13 * h, -3 * h * h, 22 * h, 4 * h * h]]
    ) * RHO * WIDTH * HEIGHT * h / 420  # fmt: skip
    size = 2 * (ELEMENTS + 1)
    K, M = np.zeros((size, size)), np.zeros((size, size))
    for e in range(ELEMENTS):
        own = slice(2 * e, 2 * e + 4)
        K[own, own] += bending
        M[own, own] += inertia
    rows = [(i + 1, dof, i * h, 0.0, 0.0) for i in range(ELEMENTS + 1) for dof in (3, 5)]
    free = [r for r, (node, dof, *_) in enumerate(rows) if dof == 5 or 1 < node <= ELEMENTS]
    return K[np.ix_(free, free)], M[np.ix_(free, free)], np.array(rows)[free]


def main(folder: Path = Path(__file__).parent) -> None:
    """Write the three files."""
    K, M, rows = matrices()
    mmwrite(folder / "beam_K.mtx", coo_matrix(K), symmetry="symmetric", precision=16)
    mmwrite(folder / "beam_M.mtx", coo_matrix(M), symmetry="symmetric", precision=16)
    np.savetxt(folder / "beam_nodes.txt", rows, fmt=["%d", "%d", "%g", "%g", "%g"])


if __name__ == "__main__":
    main()
