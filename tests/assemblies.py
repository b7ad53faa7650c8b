"""Parts and dense solutions for tests of assemblies."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse.linalg

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.site.functionals import functional


def free_dofs(structure: ao.Structure) -> np.ndarray:
    """Dofs that are not held and do not depend on others."""
    return np.setdiff1d(np.arange(structure.K.getSize()[0]), structure.fixed)


def eigenfrequencies(structure: ao.Structure, n: int) -> np.ndarray:
    """The lowest n circular frequencies, from dense matrices."""
    free = free_dofs(structure)
    K, M = (csr(A)[free][:, free].toarray() for A in (structure.K, structure.M))
    values = scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=[0, n - 1])
    return np.sqrt(np.abs(values))


def static(structure: ao.Structure, site: ao.Site) -> np.ndarray:
    """q under a unit force at a site."""
    free = free_dofs(structure)
    q = np.zeros(structure.K.getSize()[0])
    b = functional(structure, site).b
    q[free] = scipy.sparse.linalg.spsolve(csr(structure.K)[free][:, free].tocsc(), b[free])
    return q
