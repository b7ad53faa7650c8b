"""Packages of this installation: versions, BLAS, solvers, and how to get missing ones."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import platform
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from antiosc.base import process
from antiosc.base.process import loading, restored, start_petsc

#: Remark on a package that is installed but cannot be imported.
BROKEN = "fails to load"


@dataclass(frozen=True)
class Package:
    """A package that antiosc can use."""

    name: str  # its usual spelling
    module: str  # the module that is imported
    debian: str  # name of its Debian package
    conda: str  # name on conda-forge
    pypi: str  # name on PyPI; empty: not there for all systems
    version: Callable[[], str]  # called only where the module is installed
    meshes: bool = True  # structures with a mesh need it


def version() -> str:
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
                versions[package] = package.version() if spec else ""
        except Exception as error:  # an installed package can fail in any way: say so and go on
            versions[package] = f"{BROKEN}: {error}"
    return versions


def meshes_work() -> bool:
    """Whether all packages are available that structures with a mesh need."""
    versions = packages_found()
    return all(versions[p] and not versions[p].startswith(BROKEN) for p in versions if p.meshes)


def report() -> str:
    """Text of versions, BLAS, threads, PETSc's solvers, and missing packages with a remedy."""
    rows = [
        ("antiosc", version()),
        ("Python", f"{platform.python_version()}  {sys.executable}"),
    ]
    remarks = []
    for package, version_found in packages_found().items():
        rows.append(
            (
                package.name,
                BROKEN if version_found.startswith(BROKEN) else version_found or "missing",
            )
        )
        if version_found.startswith(BROKEN):
            remarks.append(f"{package.name} is installed but {version_found}")
    absent = [package for package, version_found in packages_found().items() if not version_found]
    rows += [("solvers", ", ".join(solvers()) or "none of CHOLMOD, MUMPS"), ("CHOLMOD", _cholmod())]
    rows += [("threads", _threads())]
    rows.append(("BLAS", blas()))
    if absent:
        names = ", ".join(package.name for package in absent)
        remarks.append(f"Missing: {names}. Remedy: {remedy(absent, installation())}")
    if not meshes_work():
        works = "models, given matrices, measured parts, scenes of these"
        remarks.append(f"Meshes cannot be read or simulated here; {works} work.")
    lines = [f"{name:<15}{text}".rstrip() for name, text in rows]
    return "\n".join(lines + [""] * bool(remarks) + remarks)


def installation() -> str:
    """Kind of this Python: "conda", "debian", "venv" (another Python on Debian) or "pip"."""
    if Path(sys.prefix, "conda-meta").is_dir():
        return "conda"
    if not Path("/etc/debian_version").is_file():
        return "pip"
    is_debian = "/usr/lib/python3/dist-packages" in sys.path
    if sys.base_prefix == "/usr" and is_debian:
        return "debian"
    return "venv"


def remedy(missing: list[Package], kind: str) -> str:
    """The command that installs missing packages in an installation of this kind."""
    if kind == "conda":
        names = sorted({package.conda for package in missing})
        return f"conda install -c conda-forge {' '.join(names)}"
    debian = f"sudo apt install {' '.join(sorted({package.debian for package in missing}))}"
    if kind == "debian":
        return debian
    pip = [package.pypi for package in missing if package.pypi]
    commands = [f"pip install {' '.join(dict.fromkeys(pip))}"] if pip else []
    if len(pip) < len(missing):
        elsewhere = "conda (conda-forge), or the container of packaging/Dockerfile"
        if kind == "venv":
            elsewhere = f"{debian}, and an environment of Debian's Python: "
            elsewhere += "/usr/bin/python3 -m venv --system-site-packages"
        elif sys.platform == "win32":
            elsewhere = "WSL with Debian, or the container of packaging/Dockerfile"
        commands.append(f"for meshes {elsewhere}")
    return "; ".join(commands)


def solvers() -> list[str]:
    """Names of the direct solvers in this PETSc that antiosc uses."""
    try:
        from petsc4py import PETSc
    except ImportError:
        return []
    # Debian 12's PETSc names SuiteSparse as a whole, Debian 13's its parts.
    keys = {"CHOLMOD": ("suitesparse", "cholmod"), "MUMPS": ("mumps",)}
    return [name for name in keys if any(map(PETSc.Sys.hasExternalPackage, keys[name]))]


def _cholmod() -> str:
    """CHOLMOD's version if it is called directly; else why it is called through PETSc."""
    try:
        from antiosc.extension import cholmod
    except Exception as error:  # whatever an installed package may raise
        return f"not called directly, as its binding cannot be loaded ({error})"
    refusal = cholmod.refusal()
    if refusal:
        return f"through PETSc: {refusal}"
    numbers = cholmod.version(cholmod.loaded_cholmod())
    return f"{'.'.join(map(str, numbers))}  called directly"


def blas() -> str:
    """The BLAS that NumPy loads, by threadpoolctl; "unknown" of one without threads."""
    importlib.import_module("numpy.linalg")
    pools = process.pools() or ()
    return next((f"{pool['internal_api']}  {pool['filepath']}" for pool in pools), "unknown")


def _threads() -> str:
    """Text of the number of threads."""
    count = f"{process.cores()} cores"
    user_choice = process.user_threads()
    if user_choice:
        variable, number = user_choice
        return f"{number} ({variable}), {count}"
    if process.pools() is None:
        return f"as many as BLAS takes (threadpoolctl is missing), {count}"
    return f"1, more for large factors while cores are free; {count}, {process.free_cores()} free"


def _petsc() -> str:
    """Version of PETSc."""
    start_petsc()
    from petsc4py import PETSc

    return ".".join(map(str, PETSc.Sys.getVersion()))


def _slepc() -> str:
    """Version of SLEPc."""
    from slepc4py import SLEPc

    return ".".join(map(str, SLEPc.Sys.getVersion()))


def _mpi() -> str:
    """Version of MPI."""
    from mpi4py import MPI

    return MPI.Get_library_version().split(",")[0]


def _gmsh() -> str:
    # Its __version__ is that of the interface, not of the program, which would have to be
    # initialised: not in this process, where it changes the locale and may be in use.
    """Version of gmsh."""
    code = (
        "import gmsh; gmsh.initialize(readConfigFiles=False);"
        "gmsh.option.setNumber('General.Terminal', 0);"
        "print(gmsh.option.getString('General.Version'))"
    )
    program = [sys.executable, "-P", "-c", code]
    completed = subprocess.run(program, capture_output=True, text=True, timeout=60, cwd="/")
    if completed.returncode:
        raise ImportError(
            " ".join(completed.stderr.split()[-20:]) or f"it ends with {completed.returncode}"
        )
    return completed.stdout.split()[-1]


def _package(
    name: str, module: str = "", version: Callable[[], str] | None = None, *, meshes: bool = True
) -> Package:
    """A package; its names on Debian, conda-forge and PyPI follow from the module's name."""
    module = module or name
    version = version or (lambda: importlib.import_module(module).__version__)
    suffix = "-real" if module in ("dolfinx", "petsc4py", "slepc4py") else ""
    pypi = "" if suffix or module == "mpi4py" else module
    conda = {"gmsh": "python-gmsh", "dolfinx": "fenics-dolfinx", "matplotlib": "matplotlib-base"}
    petsc = {"petsc4py": '"petsc=*=real_*" petsc4py'}
    packaged_name = (conda | petsc).get(module, module)
    return Package(name, module, f"python3-{module}{suffix}", packaged_name, pypi, version, meshes)


PACKAGES = [
    _package("NumPy", "numpy", meshes=False),
    _package("SciPy", "scipy", meshes=False),
    _package("matplotlib", meshes=False),
    _package("jinja2", meshes=False),
    _package("MPI", "mpi4py", _mpi),
    _package("mpi4py"),
    _package("PETSc", "petsc4py", _petsc),
    _package("petsc4py"),
    _package("SLEPc", "slepc4py", _slepc),
    _package("slepc4py"),
    _package("dolfinx"),
    _package("gmsh", version=_gmsh),
    _package("threadpoolctl", meshes=False),
    _package("meshio"),
    _package("h5py"),
]
