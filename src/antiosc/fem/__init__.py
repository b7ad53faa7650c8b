"""Finite elements: from a mesh (gmsh, dolfinx, PETSc, SLEPc), or matrices (SciPy), to models."""

from collections.abc import Iterator
from contextlib import contextmanager

from antiosc.errors import MissingDependencyError
from antiosc.isolation import restored, start_petsc

#: The package without which only given matrices can be extracted; None with all packages.
missing: str | None = None

try:
    with restored():
        start_petsc()
        import dolfinx.fem.petsc  # noqa: F401
        import slepc4py.SLEPc  # noqa: F401
except ImportError as error:
    missing = error.name or str(error)


@contextmanager
def stack() -> Iterator[None]:
    """Around imports of modules that need the packages: MissingDependencyError says which."""
    try:
        yield
    except MissingDependencyError:
        raise
    except ImportError as error:
        raise MissingDependencyError(
            f"{error.name or error} is not installed: meshes and their structures need Debian's "
            "python3-dolfinx-real, python3-petsc4py-real, python3-slepc4py-real and python3-gmsh "
            "(sudo apt install …); Structure.from_matrices, extract, models, contact laws and "
            "simulate work without them."
        ) from error
