"""CHOLMOD's library as loaded by PETSc: its structures, its version, its status codes.

The structures are those of `cholmod.h`; they are the same from CHOLMOD 3.0 (SuiteSparse 5) to 5.3
(SuiteSparse 7.10) as far as they are declared here. `library` compares the version, and every
default that CHOLMOD sets at its start, before anything else is called.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import POINTER, byref, c_double, c_int, c_int64, c_size_t, c_void_p
from functools import cache
from typing import Any

from petsc4py import PETSc

from antiosc.base.errors import AntioscError, MissingDependencyError, NotConvergedError
from antiosc.base.process import SMALLER, ran_out

#: First numbers of the versions whose structures are those below.
VERSIONS = (3, 4, 5)
#: Bytes for `cholmod_common`, of which the library uses less than a tenth.
COMMON = 1 << 16
#: CHOLMOD's numbers: 64-bit integers, real numbers, the upper triangle, A x = b, supernodal only.
LONG, REAL, UPPER, SUPERNODAL = 2, 1, 1, 2
#: `Common.status` where there was no memory, and what its other codes below zero mean.
NO_MEMORY = -2
FAILURES = {
    -1: "it is built without a part that this needs",
    -3: "the sizes exceed its integers, or those of its BLAS",
    -4: "it finds the input invalid",
    -5: "its GPU part failed",
}
#: What `openblas_get_parallel` returns where OpenBLAS itself runs on OpenMP.
ON_OPENMP = 2


class _Method(ctypes.Structure):
    _fields_ = [
        *((name, c_double) for name in ("lnz", "fl", "prune_dense", "prune_dense2", "nd_oksep")),
        ("other_1", c_double * 4),
        ("nd_small", c_size_t),
        ("other_2", c_double * 4),
        *((name, c_int) for name in ("aggressive", "order_for_lu", "nd_compress", "nd_camd")),
        *((name, c_int) for name in ("nd_components", "ordering")),
        ("other_3", c_size_t * 4),
    ]


class Common(ctypes.Structure):
    """`cholmod_common`: settings, workspace and the status of the last call."""

    _fields_ = [
        *((name, c_double) for name in ("dbound", "grow0", "grow1")),
        *((name, c_size_t) for name in ("grow2", "maxrank")),
        ("supernodal_switch", c_double),
        ("supernodal", c_int),
        *((f"final_{k}", c_int) for k in ("asis", "super", "ll", "pack", "monotonic", "resymbol")),
        ("zrelax", c_double * 3),
        ("nrelax", c_size_t * 3),
        *((f"prefer_{k}", c_int) for k in ("zomplex", "upper")),
        *((name, c_int) for name in ("quick_return_if_not_posdef", "prefer_binary")),
        *((name, c_int) for name in ("print_level", "precise", "try_catch")),
        ("error_handler", c_void_p),
        *((name, c_int) for name in ("nmethods", "current", "selected")),
        ("method", _Method * 10),
        *((name, c_int) for name in ("postorder", "default_nesdis")),
        *((name, c_double) for name in ("metis_memory", "metis_dswitch")),
        *((name, c_size_t) for name in ("metis_nswitch", "nrow")),
        ("mark", c_int64),
        *((name, c_size_t) for name in ("iworksize", "xworksize")),
        *((name, c_void_p) for name in ("Flag", "Head", "Xwork", "Iwork")),
        *((name, c_int) for name in ("itype", "dtype", "no_workspace_reallocate", "status")),
        *((name, c_double) for name in ("fl", "lnz")),
        ("rest", ctypes.c_char * COMMON),
    ]


#: What `cholmod_l_start` sets in every known version; it tells whether `Common` is laid out so.
DEFAULTS: dict[str, Any] = {
    **{"grow0": 1.2, "grow1": 1.2, "grow2": 5, "maxrank": 8, "supernodal_switch": 40.0},
    **{"supernodal": 1, "final_asis": 1, "final_super": 1, "final_ll": 0, "final_pack": 1},
    **{"final_monotonic": 1, "zrelax": (0.8, 0.1, 0.05), "nrelax": (4, 16, 48)},
    **{"prefer_upper": 1, "quick_return_if_not_posdef": 0, "print_level": 3, "error_handler": None},
    **{"nmethods": 0, "postorder": 1, "metis_dswitch": 0.66, "metis_nswitch": 3000, "mark": -1},
    **{"itype": LONG, "status": 0, "fl": -1.0, "lnz": -1.0},
}


class Sparse(ctypes.Structure):
    """`cholmod_sparse`: a matrix by columns."""

    _fields_ = [
        *((name, c_size_t) for name in ("nrow", "ncol", "nzmax")),
        *((name, c_void_p) for name in ("p", "i", "nz", "x", "z")),
        *((name, c_int) for name in ("stype", "itype", "xtype", "dtype", "sorted", "packed")),
    ]


class Dense(ctypes.Structure):
    """`cholmod_dense`: a block of vectors, column by column."""

    _fields_ = [
        *((name, c_size_t) for name in ("nrow", "ncol", "nzmax", "d")),
        *((name, c_void_p) for name in ("x", "z")),
        *((name, c_int) for name in ("xtype", "dtype")),
    ]


class Factor(ctypes.Structure):
    """`cholmod_factor`: a symbolic or numeric factor."""

    _fields_ = [
        *((name, c_size_t) for name in ("n", "minor")),
        *((name, c_void_p) for name in ("Perm", "ColCount", "IPerm")),
        ("nzmax", c_size_t),
        *((name, c_void_p) for name in ("p", "i", "x", "z", "nz", "next", "prev")),
        *((name, c_size_t) for name in ("nsuper", "ssize", "xsize", "maxcsize", "maxesize")),
        *((name, c_void_p) for name in ("super", "pi", "px", "s")),
        *((name, c_int) for name in ("ordering", "is_ll", "is_super", "is_monotonic")),
        *((name, c_int) for name in ("itype", "xtype", "dtype", "useGPU")),
    ]


@cache
def library() -> Any:
    """CHOLMOD's functions; MissingDependencyError if its version is not known here."""
    lib = ctypes.CDLL(PETSc.__file__)  # symbols are looked up in what it links, too
    if not hasattr(lib, "cholmod_l_analyze_p") or not hasattr(lib, "cholmod_l_version"):
        raise MissingDependencyError(
            "this PETSc is built without CHOLMOD (SuiteSparse), which antiosc needs for "
            "factorizations: install a PETSc with it, such as Debian's."
        )
    lib.cholmod_l_analyze_p.restype = POINTER(Factor)
    lib.cholmod_l_analyze_p.argtypes = [c_void_p, c_void_p, c_void_p, c_size_t, c_void_p]
    lib.cholmod_l_factorize.argtypes = [c_void_p, POINTER(Factor), c_void_p]
    lib.cholmod_l_solve2.argtypes = [c_int, POINTER(Factor), *([c_void_p] * 7)]
    lib.cholmod_l_ensure_dense.restype = c_void_p
    lib.cholmod_l_ensure_dense.argtypes = [c_void_p, *([c_size_t] * 3), c_int, c_void_p]
    found = version(lib)
    text = ".".join(map(str, found))
    if found[0] not in VERSIONS:
        raise MissingDependencyError(
            f"CHOLMOD {text} is not known to antiosc (3.0 to 5.x are): its structures may differ."
        )
    odd = _unlike_defaults(lib)
    if odd:
        raise MissingDependencyError(
            f"CHOLMOD {text} starts with other defaults ({odd}) than the versions known to antiosc."
        )
    return lib


def version(lib: Any) -> tuple[int, int, int]:
    """CHOLMOD's version: SuiteSparse 5.12 has 3.0.14, SuiteSparse 7.10 has 5.3.1."""
    numbers = (c_int * 3)()
    lib.cholmod_l_version(numbers)
    return tuple(numbers)  # type: ignore[return-value]


def _unlike_defaults(lib: Any) -> str:
    """The settings that differ from the known defaults, as text."""
    common = Common()
    lib.cholmod_l_start(byref(common))
    found = {}
    for name in DEFAULTS:
        value = getattr(common, name)
        found[name] = tuple(value) if isinstance(value, ctypes.Array) else value
    lib.cholmod_l_finish(byref(common))
    return ", ".join(f"{k} = {v}" for k, v in found.items() if v != DEFAULTS[k])


def failure(common: Common, what: str, size: float | None = None) -> AntioscError:
    """The error for CHOLMOD's status after a call that failed at `what` (of `size` bytes)."""
    if common.status == NO_MEMORY:
        need = "" if size is None else f" of {size / 1e9:.3g} GB"
        return ran_out(f"{what}{need}", remedy=f"use solver='iterative', {SMALLER[4:]}")
    reason = FAILURES.get(common.status, "it gives no reason")
    return NotConvergedError(f"CHOLMOD failed during {what}: {reason} (status {common.status}).")


@contextmanager
def without_openmp() -> Iterator[None]:
    """Keep CHOLMOD's own OpenMP loops on one thread.

    Up to SuiteSparse 5 they use four threads, independent of the environment. The loops are short,
    and threads that wait for the next loop slow down those of BLAS and of other ranks: up to half
    of the time of a factorization on two cores was lost. BLAS keeps its threads, unless it is built
    on OpenMP.
    """
    openmp, blas = _loaded("libgomp.so.1"), _loaded("libopenblas.so.0")
    if openmp is None or blas is None or blas.openblas_get_parallel() == ON_OPENMP:
        yield
        return
    levels = openmp.omp_get_max_active_levels()
    if not levels:  # another thread has set it, and puts it back
        yield
        return
    openmp.omp_set_max_active_levels(0)
    try:
        yield
    finally:
        openmp.omp_set_max_active_levels(levels)


@cache
def _loaded(name: str) -> Any:
    """A library that this process has already loaded, or None."""
    try:
        return ctypes.CDLL(name, mode=os.RTLD_NOW | getattr(os, "RTLD_NOLOAD", 0))
    except OSError:
        return None
