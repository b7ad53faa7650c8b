"""Finite elements: from a mesh (gmsh, dolfinx, PETSc, SLEPc), or matrices (SciPy), to models."""

from antiosc.base.errors import MissingDependencyError
from antiosc.base.packages import loading, restored, start_mpi, start_petsc

#: The package without which only given matrices can be extracted; None with all packages.
missing: str | None = None

try:
    with loading(), restored():
        start_mpi()
        start_petsc()
        import dolfinx.fem.petsc  # noqa: F401
        import slepc4py.SLEPc  # noqa: F401
except MissingDependencyError:
    raise
except ImportError as error:
    missing = error.name or str(error)
