"""The one door to gmsh, dolfinx, PETSc and SLEPc: from a mesh to anti-oscillators and fields."""

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

from antiosc.fem.attached import PointMass, Spring
from antiosc.fem.beam import Beam, Section
from antiosc.fem.extract import extract
from antiosc.fem.fields import probe, write_series
from antiosc.fem.full import NaturalModes, full, superposition
from antiosc.fem.impact_map import ImpactMap, impact_map
from antiosc.fem.laminate import Layer
from antiosc.fem.mesh import Mesh, read_mesh
from antiosc.fem.shell import Laminate, Shell
from antiosc.fem.site import Site
from antiosc.fem.solid import Solid
from antiosc.fem.structure import Structure, Support

__all__ = [
    "Beam",
    "ImpactMap",
    "Laminate",
    "Layer",
    "Mesh",
    "NaturalModes",
    "PointMass",
    "Section",
    "Shell",
    "Site",
    "Solid",
    "Spring",
    "Structure",
    "Support",
    "extract",
    "full",
    "impact_map",
    "probe",
    "read_mesh",
    "superposition",
    "write_series",
]
