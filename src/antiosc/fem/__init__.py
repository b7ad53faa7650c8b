"""Finite elements (gmsh, dolfinx, PETSc, SLEPc): from a mesh to anti-oscillators and fields."""

from antiosc.errors import MissingDependencyError
from antiosc.isolation import restored, start_petsc

try:
    with restored():
        start_petsc()
        import dolfinx.fem.petsc  # noqa: F401
        import slepc4py.SLEPc  # noqa: F401
except ImportError as error:
    raise MissingDependencyError(
        f"{error.name} is not installed: meshes and structures need Debian's python3-dolfinx-real, "
        "python3-petsc4py-real, python3-slepc4py-real and python3-gmsh (sudo apt install …); "
        "models, contact laws and simulate work without them."
    ) from error
