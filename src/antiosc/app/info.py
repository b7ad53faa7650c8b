"""Packages on this machine: versions, BLAS, solvers, and how to install missing ones."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import platform
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from antiosc.base import threads
from antiosc.base.isolation import loading, restored, start_petsc

#: Fast BLAS libraries, as threadpoolctl and as people call them.
BLAS_NAMES = {"openblas": "OpenBLAS", "blis": "BLIS", "mkl": "MKL"}


@dataclass(frozen=True)
class Package:
    """A package that antiosc can use."""

    name: str  # as its makers write it
    module: str  # what is imported
    debian: str  # the Debian package that brings it
    version: Callable[[], str]  # called only where the module is installed


@dataclass(frozen=True)
class Blas:
    """The BLAS that this process has loaded."""

    name: str
    path: str
    slow: bool  # the reference implementation


def version() -> str:
    """The version of antiosc, or "unknown" if it is not installed."""
    try:
        return importlib.metadata.version("antiosc")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def report() -> str:
    """Versions, BLAS, threads, PETSc's solvers, and missing packages with the remedy, as text."""
    rows = [
        ("antiosc", version()),
        ("Python", f"{platform.python_version()}  {sys.executable}"),
    ]
    missing = []
    remarks = []
    for package in PACKAGES:
        try:
            with loading(), restored():
                found = package.version() if importlib.util.find_spec(package.module) else ""
        except Exception as error:  # an installed package can fail in any way: say so and go on
            found = "fails to load"
            remarks.append(f"{package.name} is installed but fails to load: {error}")
        rows.append((package.name, found or "missing"))
        if not found:
            missing.append(package)
    rows += [("solvers", ", ".join(solvers()) or "none of CHOLMOD, MUMPS"), ("CHOLMOD", _cholmod())]
    rows += [("threads", _threads())]

    used = blas()
    rows.append(("BLAS", f"{used.name}  {used.path}"))
    if used.slow:
        remarks.append(
            "WARNING: this is the reference BLAS, which makes every factorization and solve slow."
            " Remedy: sudo apt install libopenblas0-pthread"
        )
    if missing:
        names = ", ".join(package.name for package in missing)
        debian = " ".join(sorted({package.debian for package in missing}))
        remarks.append(f"Missing: {names}. Remedy: sudo apt install {debian}")

    lines = [f"{name:<15}{text}".rstrip() for name, text in rows]
    return "\n".join(lines + [""] * bool(remarks) + remarks)


def solvers() -> list[str]:
    """The direct solvers, of those antiosc uses, that PETSc was built with here."""
    try:
        from petsc4py import PETSc
    except ImportError:
        return []
    # Debian 12's PETSc names SuiteSparse as a whole, Debian 13's its parts.
    keys = {"CHOLMOD": ("suitesparse", "cholmod"), "MUMPS": ("mumps",)}
    return [name for name in keys if any(map(PETSc.Sys.hasExternalPackage, keys[name]))]


def _cholmod() -> str:
    """CHOLMOD's version and whether it is called directly, or through PETSc and why."""
    try:
        from antiosc.fem.linalg import cholmod, cholmod_library
    except Exception as error:  # whatever an installed package may raise
        return f"not tried: {error}"
    refusal = cholmod.refusal()
    if refusal:
        return f"through PETSc: {refusal}"
    numbers = cholmod_library.version(cholmod_library.library())
    return f"{'.'.join(map(str, numbers))}  called directly"


def blas() -> Blas:
    """The BLAS in use, as threadpoolctl finds it among the libraries that are loaded with NumPy.

    Debian's packages all ask for libblas.so.3 and the `alternatives` links choose what that is;
    a NumPy from PyPI brings an OpenBLAS of its own. threadpoolctl does not know those without
    threads, the reference implementation above all, beside which OpenBLAS may serve LAPACK alone.
    """
    importlib.import_module("numpy.linalg")
    path = _mapped("libblas.so")
    if path and not any(name in path for name in BLAS_NAMES):
        return Blas("ATLAS", path, slow=False) if "atlas" in path else Blas("reference", path, True)
    for pool in threads.pools() or ():
        kind = pool["internal_api"]
        return Blas(BLAS_NAMES.get(kind, kind), str(Path(pool["filepath"]).resolve()), slow=False)
    return Blas("unknown", path, slow=False)


def _mapped(name: str) -> str:
    """Path of a library of this process; empty where it has none or where /proc is missing."""
    try:
        lines = Path("/proc/self/maps").read_text().splitlines()
    except OSError:
        return ""
    paths = (line.split(maxsplit=5)[-1] for line in lines)
    return next((path for path in paths if Path(path).name.startswith(name)), "")


def _threads() -> str:
    count = f"{threads.cores()} cores"
    chosen = threads.chosen()
    if chosen:
        variable, number = chosen
        return f"{number} ({variable}), {count}"
    if threads.pools() is None:
        return f"as many as BLAS takes (threadpoolctl is missing), {count}"
    return f"1, more for large factors while cores are free; {count}, {threads.free_cores()} free"


def _attribute(module: str) -> Callable[[], str]:
    return lambda: importlib.import_module(module).__version__


def _petsc() -> str:
    start_petsc()
    from petsc4py import PETSc

    return ".".join(map(str, PETSc.Sys.getVersion()))


def _slepc() -> str:
    from slepc4py import SLEPc

    return ".".join(map(str, SLEPc.Sys.getVersion()))


def _mpi() -> str:
    from mpi4py import MPI

    return MPI.Get_library_version().split(",")[0]


def _gmsh() -> str:
    # Its __version__ is that of the interface, not of the program, which would have to be
    # initialised: not in this process, where it changes the locale and may be in use.
    code = (
        "import gmsh; gmsh.initialize(readConfigFiles=False);"
        "gmsh.option.setNumber('General.Terminal', 0);"
        "print(gmsh.option.getString('General.Version'))"
    )
    program = [sys.executable, "-P", "-c", code]
    done = subprocess.run(program, capture_output=True, text=True, timeout=60, cwd="/")
    if done.returncode:
        raise ImportError(" ".join(done.stderr.split()[-20:]) or f"it ends with {done.returncode}")
    return done.stdout.split()[-1]


PACKAGES = [
    Package("NumPy", "numpy", "python3-numpy", _attribute("numpy")),
    Package("SciPy", "scipy", "python3-scipy", _attribute("scipy")),
    Package("matplotlib", "matplotlib", "python3-matplotlib", _attribute("matplotlib")),
    Package("jinja2", "jinja2", "python3-jinja2", _attribute("jinja2")),
    Package("MPI", "mpi4py", "python3-mpi4py", _mpi),
    Package("mpi4py", "mpi4py", "python3-mpi4py", _attribute("mpi4py")),
    Package("PETSc", "petsc4py", "python3-petsc4py-real", _petsc),
    Package("petsc4py", "petsc4py", "python3-petsc4py-real", _attribute("petsc4py")),
    Package("SLEPc", "slepc4py", "python3-slepc4py-real", _slepc),
    Package("slepc4py", "slepc4py", "python3-slepc4py-real", _attribute("slepc4py")),
    Package("dolfinx", "dolfinx", "python3-dolfinx-real", _attribute("dolfinx")),
    Package("gmsh", "gmsh", "python3-gmsh", _gmsh),
    Package("threadpoolctl", "threadpoolctl", "python3-threadpoolctl", _attribute("threadpoolctl")),
    Package("meshio", "meshio", "python3-meshio", _attribute("meshio")),
    Package("h5py", "h5py", "python3-h5py", _attribute("h5py")),
]
