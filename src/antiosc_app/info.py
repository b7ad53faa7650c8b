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

#: Of a package that is installed and cannot be imported.
BROKEN = "fails to load"
#: Fast BLAS libraries, as threadpoolctl and as people call them.
BLAS_NAMES = {"openblas": "OpenBLAS", "blis": "BLIS", "mkl": "MKL"}


@dataclass(frozen=True)
class Package:
    """A package that antiosc can use."""

    name: str  # as its makers write it
    module: str  # what is imported
    debian: str  # the Debian package that brings it
    conda: str  # that of conda-forge
    pypi: str  # that of PyPI; empty: it has none for all systems
    version: Callable[[], str]  # called only where the module is installed
    meshes: bool = True  # structures with a mesh need it


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


@cache
def packages_found() -> dict[Package, str]:
    """Version of each package; "" if it is missing, "fails to load: why" if it is broken."""
    found = {}
    for package in PACKAGES:
        try:
            with loading(), restored():
                there = importlib.util.find_spec(package.module)
                found[package] = package.version() if there else ""
        except Exception as error:  # an installed package can fail in any way: say so and go on
            found[package] = f"{BROKEN}: {error}"
    return found


def meshes_work() -> bool:
    """Whether every package is there that structures with a mesh need."""
    found = packages_found()
    return all(found[p] and not found[p].startswith(BROKEN) for p in found if p.meshes)


def report() -> str:
    """Versions, BLAS, threads, PETSc's solvers, and missing packages with the remedy, as text."""
    rows = [
        ("antiosc", version()),
        ("Python", f"{platform.python_version()}  {sys.executable}"),
    ]
    remarks = []
    for package, found in packages_found().items():
        rows.append((package.name, BROKEN if found.startswith(BROKEN) else found or "missing"))
        if found.startswith(BROKEN):
            remarks.append(f"{package.name} is installed but {found}")
    missing = [package for package, found in packages_found().items() if not found]
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
        remarks.append(f"Missing: {names}. Remedy: {remedy(missing, installation())}")
    if not meshes_work():
        works = "models, given matrices, measured parts, scenes of these"
        remarks.append(f"Meshes cannot be read or simulated here; {works} work.")
    lines = [f"{name:<15}{text}".rstrip() for name, text in rows]
    return "\n".join(lines + [""] * bool(remarks) + remarks)


def installation() -> str:
    """What brought this Python: "conda", "debian", "venv" of another Python on Debian, or "pip"."""
    if Path(sys.prefix, "conda-meta").is_dir():
        return "conda"
    if not Path("/etc/debian_version").is_file():
        return "pip"
    shared = "/usr/lib/python3/dist-packages" in sys.path
    return "debian" if sys.base_prefix == "/usr" and shared else "venv"


def remedy(missing: list[Package], kind: str) -> str:
    """The command that gets packages into an installation of a kind."""
    if kind == "conda":
        names = sorted({package.conda for package in missing})
        return f"conda install -c conda-forge {' '.join(names)}"
    debian = f"sudo apt install {' '.join(sorted({package.debian for package in missing}))}"
    if kind == "debian":
        return debian
    pip = [package.pypi for package in missing if package.pypi]
    said = [f"pip install {' '.join(dict.fromkeys(pip))}"] if pip else []
    if len(pip) < len(missing):
        elsewhere = "conda (conda-forge), or the container of packaging/Dockerfile"
        if kind == "venv":
            elsewhere = f"{debian}, and an environment of Debian's Python: "
            elsewhere += "/usr/bin/python3 -m venv --system-site-packages"
        elif sys.platform == "win32":
            elsewhere = "WSL with Debian, or the container of packaging/Dockerfile"
        said.append(f"for meshes {elsewhere}")
    return "; ".join(said)


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
        from antiosc.extension import cholmod
    except Exception as error:  # whatever an installed package may raise
        return f"not tried: {error}"
    refusal = cholmod.refusal()
    if refusal:
        return f"through PETSc: {refusal}"
    numbers = cholmod.version(cholmod.loaded_cholmod())
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
    for pool in process.pools() or ():
        kind = str(pool["internal_api"])
        return Blas(
            BLAS_NAMES.get(kind, kind), str(Path(str(pool["filepath"])).resolve()), slow=False
        )
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
    count = f"{process.cores()} cores"
    chosen = process.user_threads()
    if chosen:
        variable, number = chosen
        return f"{number} ({variable}), {count}"
    if process.pools() is None:
        return f"as many as BLAS takes (threadpoolctl is missing), {count}"
    return f"1, more for large factors while cores are free; {count}, {process.free_cores()} free"


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


def _package(
    name: str, module: str = "", version: Callable[[], str] | None = None, *, meshes: bool = True
) -> Package:
    """A package whose names elsewhere follow from its module, which is named as it by default."""
    module = module or name
    version = version or (lambda: importlib.import_module(module).__version__)
    real = "-real" if module in ("dolfinx", "petsc4py", "slepc4py") else ""
    pypi = "" if real or module == "mpi4py" else module
    conda = {"gmsh": "python-gmsh", "dolfinx": "fenics-dolfinx", "matplotlib": "matplotlib-base"}
    petsc = {"petsc4py": '"petsc=*=real_*" petsc4py'}
    known = (conda | petsc).get(module, module)
    return Package(name, module, f"python3-{module}{real}", known, pypi, version, meshes)


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
