"""The C library of `csrc` for time integration ("the march"): its structures and functions.

`csrc/antiosc_march.h` is its manual. The library is in the folder of this file; `make` or an
installation builds it. ctypes lets other threads run during a call.
"""

from __future__ import annotations

import ctypes
import hashlib
import sys
from ctypes import (
    POINTER,
    Structure,
    c_char_p,
    c_double,
    c_int,
    c_int64,
    c_size_t,
    c_ssize_t,
    c_uint64,
    c_void_p,
)
from pathlib import Path
from typing import TypeAlias

import numpy as np

from antiosc.base._types import Array, NDArray
from antiosc.base.errors import MissingDependencyError

#: AOM_VERSION that the structures below belong to
VERSION = 13
#: numbers that a contact may remember
CONTACT_MEMORY = 8
#: `aom_touch`
TOUCH_RECORD = np.dtype(
    [*((name, float) for name in ("start", "end", "speed", "impulse", "peak")),
     *((name, np.int64) for name in ("first", "last"))]
)  # fmt: skip

# statuses
DONE, FULL, TOO_MANY_CONTACTS, TOO_MANY_STEPS, GREW, STUCK, PAUSED, LAW_FAILED = range(8)
# kinds of laws
LINEAR, POWER, HERTZ, DAMPED, THORNTON, YANG_SUN, ELASTIC_PLASTIC, TABLE, USER = range(9)
# branches of a law
APART, FORWARD, CUT, BACK = range(4)

FORCE_CALLBACK = ctypes.CFUNCTYPE(
    c_int, c_void_p, c_double, c_double, POINTER(c_double), POINTER(c_double)
)
TOUCH_CALLBACK = ctypes.CFUNCTYPE(
    c_int, c_void_p, c_double, c_int, POINTER(c_double), POINTER(c_double)
)
ADVANCE_CALLBACK = FORCE_CALLBACK
WORK_CALLBACK = ctypes.CFUNCTYPE(c_int, c_void_p, c_double, c_double, POINTER(c_double))


_Scalar: TypeAlias = type[c_int] | type[c_int64] | type[c_double] | type[c_void_p]
_C_TYPES: dict[str, _Scalar] = {
    "int": c_int,
    "int64": c_int64,
    "double": c_double,
    "pointer": c_void_p,
}


def _fields(declarations: str) -> list[tuple[str, _Scalar]]:
    """Fields of a structure, declared as in C: "double time, end; int64 steps"."""
    groups = [group.split(maxsplit=1) for group in declarations.split(";")]
    return [(name.strip(), _C_TYPES[kind]) for kind, names in groups for name in names.split(",")]


# The C structures of these names: `CLaw` is `aom_law`.


class UserLaw(Structure):
    _fields_ = [
        *_fields("pointer context; int n_state, rated"),
        *(
            ("force", FORCE_CALLBACK),
            ("touch", TOUCH_CALLBACK),
            ("advance", ADVANCE_CALLBACK),
            ("work", WORK_CALLBACK),
        ),
    ]


class CLaw(Structure):
    _fields_ = _fields("int kind, n_params; pointer params, user")


class CContact(Structure):
    _fields_ = [
        ("law", CLaw),
        *_fields("double friction, tangential_stiffness; int first_tangential, n_tangential"),
        *_fields("double mass, expected_depth, expected_speed, slowest, preload"),
        *_fields("pointer state; int closed"),
    ]


class CSystem(Structure):
    _fields_ = [
        *_fields("int n_modes, n_rows, n_contacts, n_breaks; pointer omega, decay, beta, residual"),
        *_fields("pointer breaks, loads, offsets, contacts, q, v; double stored; pointer gamma"),
        *_fields("int n_stretch; pointer quadratic, cubic"),
    ]


class COptions(Structure):
    _fields_ = [
        *_fields("double duration, rel_tol, force_scale, step, resolution"),
        *_fields("int64 max_contacts, max_steps, max_runs"),
    ]


class CRecord(Structure):
    _fields_ = [
        *_fields("int64 max_nodes, max_states, max_events, n_nodes, n_states, n_events, every"),
        *_fields("pointer time, force, depth, states, events"),
    ]


class CSummary(Structure):
    _fields_ = _fields(
        "double time, force_scale, highest, gained, work; int64 steps, attempts, touches, refused"
    )


class CDifference(Structure):
    _fields_ = _fields("double force, peak, until")


class CSolution(Structure):
    _fields_ = [
        *_fields("int best, answer; double force, peak, certain, share"),
        ("summary", CSummary),
        *_fields("int present, before, runs, worse, failed, scaled; int64 used; double finer"),
        ("earlier", CSummary),
    ]


class CNumbers(Structure):
    _fields_ = _fields("double peak, impulse, contact_time, restitution, closed; int64 steps")


class CImpact(Structure):
    _fields_ = (("system", CSystem), ("options", COptions))


class CExpectedContact(Structure):
    _fields_ = _fields("double depth, speed, time")


class COutcome(Structure):
    _fields_ = [
        *_fields("int64 status, contacts, touches, open, n_nodes"),
        ("numbers", CNumbers),
        *_fields("double force_error, peak_error, certain, time, lasting, gained, highest"),
    ]


class CPulseNodes(Structure):
    _fields_ = _fields("int64 max_nodes, n_nodes; pointer time, force")


class CEnclosure(Structure):
    _fields_ = [
        *_fields("int n_modes, n_channels, n_losses, n_contacts; pointer omega, decay, load, v"),
        *_fields("pointer beta, gap, rows, brake, lag; int n_rates; pointer rates, compliances"),
        *_fields("pointer laws; double longest"),
        *_fields("int64 n_nodes; pointer time, force, clock, lower, upper, peak, impulse, reached"),
    ]


class CModel(Structure):
    """The C structure `axm_model` of `csrc/export/antiosc_model.h`."""

    _fields_ = [
        *(("system", CSystem), ("options", COptions)),
        *_fields("int n_sites; pointer site_modes, site_forces, site_shifts; int n_parameters"),
        *_fields("pointer parameters, start; int n_outputs; pointer outputs"),
    ]


_PACKAGE = Path(__file__).parents[1]
_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
LIBRARY_FILE = _PACKAGE / f"libantiosc_march{_SUFFIX}"
SOURCE_FOLDER = _PACKAGE.parent.parent / "csrc"
_REMEDY = "build it with `make` in the source folder, or install antiosc anew"

_SIGNATURES: dict[str, tuple[object, ...]] = {  # result, arguments
    "aom_version": (c_int,),
    "aom_source_hash": (c_char_p,),
    "aom_status_name": (c_char_p, c_int),
    "aom_law_force": (None, c_void_p, c_double, c_double, c_void_p, c_void_p),
    "aom_law_forces": (None, c_void_p, c_int64, c_void_p, c_void_p, c_void_p),
    "aom_law_energies": (None, c_void_p, c_int64, c_void_p, c_void_p, c_void_p),
    "aom_law_loading_work": (c_double, c_void_p, c_double),
    "aom_law_touch": (None, c_void_p, c_double, c_int, c_void_p),
    "aom_law_advance": (None, c_void_p, c_double, c_void_p),
    "aom_law_origin": (c_double, c_void_p, c_void_p),
    "aom_law_reach": (c_double, c_void_p),
    "aom_memory_size": (c_size_t, c_void_p),
    "aom_create": (c_int, c_void_p, c_void_p, c_size_t, c_void_p),
    "aom_solve": (c_int, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_int64),
    "aom_responses": (None, c_int64, c_void_p, c_void_p, c_void_p, c_int, c_void_p),
    "aom_compare": (
        CDifference, c_int, c_int64, c_void_p, c_void_p, c_int64, c_void_p, c_void_p, c_double,
        c_void_p,
    ),
    "axm_size": (c_size_t, c_void_p),
    "axm_checksum": (c_uint64, c_char_p, c_size_t),
    "aom_pulses": (None, c_void_p, c_void_p, c_int, c_int, c_int64, c_void_p, c_void_p),
    "aom_touches": (c_int64, c_void_p, c_int, c_int, c_void_p, c_void_p),
    "aom_read_contact": (
        CNumbers, c_void_p, c_void_p, c_int, c_int, c_int64, c_void_p, c_void_p, c_ssize_t,
    ),
    "aom_arrow_modes": (c_int, c_double, c_double, c_int, c_void_p, c_void_p, c_void_p, c_void_p),
    "aom_main_impact": (c_double, c_int64, c_void_p),
    "aom_expect": (CExpectedContact, c_void_p, c_int, c_double),
    "aom_law_deepest": (c_double, c_void_p, c_double, c_double, c_double, c_double, c_double),
    "aom_enclosure_size": (c_size_t, c_void_p),
    "aom_enclose": (c_int, c_void_p, c_void_p),
    "aom_batch_size": (c_size_t, c_int),
    "aom_batch_nodes": (c_int64, c_int),
    "aom_batch_create": (c_int, c_int, c_void_p, c_size_t, c_void_p),
    "aom_batch_solve": (
        c_int, c_void_p, c_int64, c_void_p, c_void_p, c_void_p, c_int64, c_void_p,
    ),
}  # fmt: skip
#: Functions that take long: other threads run meanwhile. Others keep the interpreter's lock, which
#: threads would otherwise pass on several times in each impact.
_LONG_FUNCTIONS = ("aom_solve", "aom_batch_solve")


def source_hash(folder: Path) -> str:
    """Hash of the C sources in a folder, as the build writes it into the library."""
    text = hashlib.sha256()
    for path in sorted(folder.rglob("*.[ch]")):
        text.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return text.hexdigest()[:16]


def load(path: Path = LIBRARY_FILE, source: Path = SOURCE_FOLDER) -> ctypes.CDLL:
    """Load the library; MissingDependencyError if it is missing, damaged or from other sources."""
    if not path.is_file():
        raise MissingDependencyError(f"the library {path.name} is missing: {_REMEDY}.")
    try:
        loaded = ctypes.PyDLL(str(path))
        unlocked = ctypes.CDLL(str(path))
        for name, (result, *arguments) in _SIGNATURES.items():
            function = getattr(unlocked if name in _LONG_FUNCTIONS else loaded, name)
            function.restype = result
            function.argtypes = arguments
            setattr(loaded, name, function)
    except (OSError, AttributeError) as error:
        raise MissingDependencyError(
            f"the library {path.name} cannot be loaded ({error}): {_REMEDY}."
        ) from error
    version = loaded.aom_version()
    built = loaded.aom_source_hash().decode()
    if version != VERSION:
        raise MissingDependencyError(
            f"the library {path.name} has version {version} of its interface, not {VERSION}:"
            f" {_REMEDY}."
        )
    if (source / "antiosc_march.h").is_file() and built != source_hash(source):
        raise MissingDependencyError(
            f"the library {path.name} was built from other sources than those in csrc: run `make`."
        )
    return loaded


def platform() -> str:
    """The platform of the library, as FMI 3 names it."""
    from platform import machine  # takes long to load

    names = {"AMD64": "x86_64", "arm64": "aarch64", "ARM64": "aarch64"}
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    return f"{names.get(machine(), machine())}-{system}"


library = load()


def address(values: NDArray[np.generic]) -> int:
    """Memory address of an array's numbers; three times as fast as NumPy's `ctypes`."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(values))  # type: ignore[arg-type]
    except (TypeError, ValueError):  # read-only, empty
        return values.ctypes.data


def responses(omega: Array, decay: Array | float, t: Array | float) -> Array:
    """Responses P, W, S, J0, J1, J2 (6, ...) of modes after times [s]; arguments are broadcast.

    q = P q0 + S v0 + J0 f, v = W v0 - omega^2 S q0 + S f; J1 and J2 are the displacements under
    modal forces that grow as t and as t^2/2. Small omega t and decay t cause no cancellation.
    """
    same = np.broadcast_arrays(omega, decay, t)
    arrays = [np.ascontiguousarray(array, dtype=float) for array in same]
    responses_out = np.empty((6, *arrays[0].shape))
    library.aom_responses(arrays[0].size, *map(address, arrays), 1, address(responses_out))
    return responses_out


def pulses(time: Array, force: Array, row: int, spans: NDArray[np.intp]) -> Array:
    """Integral [N s] and peak [N], (C, 2), of column `row` of forces in spans (C, 2) of steps."""
    time, force = (np.ascontiguousarray(array, dtype=float) for array in (time, force))
    steps = np.ascontiguousarray(spans, dtype=np.int64)
    peaks_out = np.empty((len(spans), 2))
    addresses = (address(array) for array in (steps, peaks_out))
    library.aom_pulses(address(time), address(force), force.shape[1], row, len(spans), *addresses)
    return peaks_out
