"""`antiosc info`: versions of packages, solvers, and commands that install missing ones."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

from antiosc.base import process
from antiosc.base.errors import MissingDependencyError
from antiosc.base.packages import loading, restored, start_mpi

#: Remark on a package that is installed but cannot be imported.
BROKEN_REMARK = "fails to load"


class Package(NamedTuple):
    """A package that antiosc can use.

    `for_meshes`: whether structures with a mesh need it; `version`: function that loads it and
    returns its version; if None, the version is read from the records of pip or Debian.
    """

    name: str
    module: str
    for_meshes: bool
    version: Callable[[], str] | None = None

    @property
    def debian(self) -> str:
        """Name of its Debian package."""
        return f"python3-{self.module}{'-real' if self.module in REAL_SOLVER_PACKAGES else ''}"

    @property
    def conda(self) -> str:
        """Name on conda-forge."""
        return CONDA_NAMES.get(self.module, self.module)

    @property
    def pypi(self) -> str:
        """Name on PyPI."""
        return SOLVER_WHEEL if self.module in (*REAL_SOLVER_PACKAGES, "mpi4py") else self.module


#: Packages in the name of whose Debian package is that of the real numbers, the wheel of these for
#: Linux on PyPI, and names on conda-forge that differ from the module.
REAL_SOLVER_PACKAGES = ("dolfinx", "petsc4py", "slepc4py")
SOLVER_WHEEL = "dolfinx-solver-real"
CONDA_NAMES = {
    "gmsh": "python-gmsh",
    "dolfinx": "fenics-dolfinx",
    "matplotlib": "matplotlib-base",
    "petsc4py": '"petsc=*=real_*" petsc4py',
}


def antiosc_version() -> str:
    """The version of antiosc, or "unknown" if it is not installed."""
    try:
        return importlib.metadata.version("antiosc")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


@cache
def packages_found() -> dict[Package, str]:
    """Version of each package; "" if it is missing, "fails to load: reason" if it is broken."""
    versions = {}
    for package in PACKAGES:
        try:
            with loading(), restored():
                spec = importlib.util.find_spec(package.module)
                versions[package] = _version_of(package) if spec else ""
        except (
            MissingDependencyError
        ):  # started by the mpirun of another MPI, which PETSc would end
            raise
        except Exception as error:  # an installed package can fail in any way: say so and go on
            versions[package] = f"{BROKEN_REMARK}: {error}"
    return versions


def _version_of(package: Package) -> str:
    """The version of a package that is installed."""
    return (
        importlib.metadata.version(package.module) if package.version is None else package.version()
    )


def c_compiler() -> str:
    """The C compiler that FFCx calls for finite elements; "" without one."""
    command = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    return shutil.which(command.split()[0]) or ""


def meshing_works() -> bool:
    """Whether all packages for structures with a mesh are installed and can be loaded."""
    versions = packages_found()
    return bool(c_compiler()) and all(
        versions[p] and not versions[p].startswith(BROKEN_REMARK) for p in versions if p.for_meshes
    )


def info_text() -> str:
    """Text of versions, BLAS, threads, PETSc's solvers, and missing packages with a remedy."""
    rows = [
        ("antiosc", antiosc_version()),
        ("Python", f"{platform.python_version()}  {sys.executable}"),
    ]
    remarks = []
    for package, found in packages_found().items():
        is_broken = found.startswith(BROKEN_REMARK)
        rows.append((package.name, BROKEN_REMARK if is_broken else found or "missing"))
        if is_broken:
            remarks.append(f"{package.name} is installed but {found}")

    loaded = ", ".join(package.name for package in PACKAGES if package.version is not None)
    rows.append(("loaded", f"{loaded}; of the others the version is read"))
    rows.append(("C compiler", c_compiler() or "missing"))
    if not c_compiler():
        remarks.append("Missing: C compiler, for meshes. Remedy: install gcc, or set CC to another")
    rows.append(("solvers", ", ".join(petsc_solvers()) or "none of CHOLMOD, MUMPS"))
    rows += [("CHOLMOD", _cholmod_text()), ("BLAS", blas_text())]
    rows.append(("threads", f"{process.core_count()} cores"))

    absent = [package for package, found in packages_found().items() if not found]
    if absent:
        names = ", ".join(package.name for package in absent)
        remarks.append(f"Missing: {names}. Remedy: {install_command(absent, installation_kind())}")
    meshes = "meshes, " if meshing_works() else ""
    without = "" if meshes else "; meshes cannot be read or simulated here"
    rows.append(("works", f"{meshes}models, given matrices, measured parts, scenes{without}"))
    lines = [f"{name:<15}{text}".rstrip() for name, text in rows]
    return "\n".join(lines + [""] * bool(remarks) + remarks)


def installation_kind() -> str:
    """How packages are installed here: "conda", "debian", "wheels" (PyPI has all) or "pip"."""
    if Path(sys.prefix, "conda-meta").is_dir():
        return "conda"
    on_debian = Path("/etc/debian_version").is_file()
    if on_debian and sys.base_prefix == "/usr" and "/usr/lib/python3/dist-packages" in sys.path:
        return "debian"
    system = platform.system(), platform.machine()
    if system == ("Linux", "x86_64") and sys.version_info >= (3, 12):
        return "wheels"
    return "pip"


def install_command(missing: Sequence[Package], kind: str) -> str:
    """The command that installs missing packages; `kind`: result of `installation_kind`."""
    if kind == "conda":
        names = sorted({package.conda for package in missing})
        return f"conda install -c conda-forge {' '.join(names)}"
    debian = f"sudo apt install {' '.join(sorted({package.debian for package in missing}))}"
    if kind == "debian":
        return debian

    names = list(dict.fromkeys(package.pypi for package in missing))
    pip = [name for name in names if name != SOLVER_WHEEL or kind == "wheels"]
    commands = [f"pip install {' '.join(pip)}"] if pip else []
    if len(pip) < len(names):
        commands.append(
            f"for meshes {debian}, and an environment of Debian's Python: "
            "/usr/bin/python3 -m venv --system-site-packages; or Python 3.12 or newer on Linux, "
            "conda (conda-forge), WSL with Debian, or the container of packaging/Dockerfile"
        )
    return "; ".join(commands)


def petsc_solvers() -> list[str]:
    """Names of the direct solvers in this PETSc that antiosc uses."""
    try:
        from petsc4py import PETSc
    except ImportError:
        return []
    # Debian 12's PETSc names SuiteSparse as a whole, Debian 13's its parts.
    keys = {"CHOLMOD": ("suitesparse", "cholmod"), "MUMPS": ("mumps",)}
    return [name for name in keys if any(map(PETSc.Sys.hasExternalPackage, keys[name]))]


def _cholmod_text() -> str:
    """Text: CHOLMOD's version if antiosc calls it directly, else the reason why it does not."""
    try:
        from antiosc.fem.linalg import cholmod
    except Exception as error:  # whatever an installed package may raise
        return f"not called directly, as its binding cannot be loaded ({error})"
    if refusal := cholmod.refusal():
        return f"not called, MUMPS factors: {refusal}"
    return f"{cholmod.version(cholmod.loaded_cholmod())}  called directly"


def blas_text() -> str:
    """Kind, processor and path of NumPy's BLAS; "unknown" if threadpoolctl does not find it."""
    importlib.import_module("numpy.linalg")

    for pool in process.blas_pools() or ():
        kernels = pool.get("architecture", "")
        return f"{pool['internal_api']} {kernels}".rstrip() + f"  {pool['filepath']}"
    return "unknown"


def _loaded_version(module: str) -> str:
    """Version of a package; this loads the package."""
    return str(importlib.import_module(module).__version__)


def _mpi_version() -> str:
    """Version of MPI."""
    start_mpi()
    from mpi4py import MPI

    name, numbers = MPI.get_vendor()
    return f"{name} {'.'.join(map(str, numbers))}"


def _gmsh_version() -> str:
    """Version of gmsh, from another process, since gmsh would change this one's locale."""
    code = (
        "from antiosc.io.by_gmsh import quiet_session;"
        "print(quiet_session().option.getString('General.Version'))"
    )
    program = [sys.executable, "-P", "-c", code]
    done = subprocess.run(program, capture_output=True, text=True, timeout=60, cwd="/")
    if done.returncode:
        reason = done.stderr.strip().rpartition("\n")[2]
        raise ImportError(reason.partition(": ")[2] or f"it ends with {done.returncode}")
    return done.stdout.split()[-1]


PACKAGES = [
    Package("NumPy", "numpy", False, partial(_loaded_version, "numpy")),
    Package("SciPy", "scipy", False),
    Package("matplotlib", "matplotlib", False),
    Package("jinja2", "jinja2", False),
    Package("MPI", "mpi4py", True, _mpi_version),
    Package("mpi4py", "mpi4py", True),
    Package("petsc4py", "petsc4py", True, partial(_loaded_version, "petsc4py")),
    Package("slepc4py", "slepc4py", True, partial(_loaded_version, "slepc4py")),
    Package("dolfinx", "dolfinx", True, partial(_loaded_version, "dolfinx")),
    Package("gmsh", "gmsh", True, _gmsh_version),
    Package("threadpoolctl", "threadpoolctl", False),
    Package("meshio", "meshio", True),
    Package("h5py", "h5py", True, partial(_loaded_version, "h5py")),
]
