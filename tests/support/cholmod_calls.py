"""Every call to CHOLMOD, with results that are read to the last entry; for `.ci/memcheck`."""

from __future__ import annotations

import gc
import importlib
import sys
import types

import numpy as np
import scipy.sparse

import antiosc
from antiosc.base.errors import NotConvergedError

# The package's door would load dolfinx and gmsh, which are none of this script's business.
door = types.ModuleType("antiosc.fem")
door.__path__ = [f"{antiosc.__path__[0]}/fem"]
sys.modules["antiosc.fem"] = door
cholmod = importlib.import_module("antiosc.fem.linalg.cholmod")


def matrix(n: int, block: int) -> scipy.sparse.csr_matrix:
    """A grid of n² nodes with `block` unknowns each, positive definite."""
    line = scipy.sparse.diags([-1.0, 2.1, -1.0], [-1, 0, 1], shape=(n, n))
    plane = scipy.sparse.kron(line, np.eye(n)) + scipy.sparse.kron(np.eye(n), line)
    return scipy.sparse.kron(plane, np.eye(block) + 0.1).tocsr()


def used(factor: cholmod.Cholesky, n: int) -> float:
    """A number that all of the factor and of its solves goes into."""
    total = 0.0
    for columns in (1, 5, 2, 0):
        B = np.ones((n, columns))
        total += factor.solve(B).sum()
    return total + factor.solve(np.ones(n)).sum() + sum(part.sum() for part in factor.supernodes)


def main() -> None:
    assert cholmod.refusal() == "", cholmod.refusal()
    for block in (1, 3):
        A = matrix(7, block)
        n = A.shape[0]
        whole = cholmod.Cholesky(A, block)
        again = cholmod.Cholesky(A, permutation=whole.permutation)
        assert np.isclose(used(whole, n), used(again, n))
        values = whole.supernodes.values
        del whole, again  # `values` outlives them
        gc.collect()
        assert np.isfinite(values.sum())
        for wrong in (A - 10 * scipy.sparse.identity(n), -A):
            try:
                cholmod.Cholesky(wrong.tocsr(), block)
            except NotConvergedError:
                continue
            raise AssertionError("an indefinite matrix was factored")
    try:
        cholmod.Cholesky(matrix(3, 1)).solve(np.ones(4))
    except NotConvergedError:
        print("all calls made")


if __name__ == "__main__":
    main()
