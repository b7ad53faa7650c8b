"""A fingerprint of any argument: equal on all ranks for equal arguments.

Data that differ by rank legitimately are excluded: the rows of shapes, the parts of distributed
matrices and meshes. Numbers count to ten digits, so that ranks on different processors agree.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
import numbers
import os
import types
from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

#: Fields that hold the rows of one rank.
LOCAL = frozenset({"phi", "residual", "shape", "shapes"})
#: Objects inside objects are followed so deep.
MOST_NESTED = 12
#: Entries of an array that a function takes from around it: more may be a rank's own.
FEW_ENTRIES = 64

#: What all ranks made together, and the number they gave it: it is the same on all of them.
_together: WeakKeyDictionary[object, int] = WeakKeyDictionary()


def number(made: object, serial: int) -> None:
    """Register `made` as the `serial`-th object that all ranks made together."""
    for k, one in enumerate(made if isinstance(made, list) else [made]):
        if type(one).__hash__ is object.__hash__ and type(one).__module__.startswith("antiosc."):
            _together[one] = serial + k


def named(value: object) -> str | None:
    """Name of an object that all ranks made together; None for any other."""
    if type(value).__hash__ is not object.__hash__ or value not in _together:
        return None
    return f"{type(value).__name__} no. {_together[value]}"


def of_petsc(value: object) -> bool:
    """Whether `value` is an object of PETSc, which need not be installed."""
    return any(kind.__module__ == "petsc4py.PETSc" for kind in type(value).__mro__)


def is_void(value: object) -> bool:
    """Whether `value` is an object of PETSc that is empty or was destroyed.

    Any question to such an object kills the process.
    """
    return of_petsc(value) and not value


def fingerprint(value: object) -> bytes:
    """16 bytes that distinguish values; never raises."""
    found = hashlib.blake2b(digest_size=16)
    try:
        for part in _parts(value, ()):
            found.update(part)
            found.update(b"\0")
    except Exception:  # a foreign object may raise what it likes
        found.update(_kind(value))
    return found.digest()


def _parts(value: Any, above: tuple[int, ...]) -> Iterator[bytes]:
    if id(value) in above or len(above) > MOST_NESTED:
        return
    inside = (*above, id(value))
    if value is None or isinstance(value, str | bytes | type):
        yield repr(value).encode()
    elif isinstance(value, numbers.Number | np.generic):
        yield from _of_number(value)
    elif isinstance(value, os.PathLike):
        yield os.fsencode(value)
    elif isinstance(value, np.ndarray):
        yield from _of_array(value, inside)
    elif scipy.sparse.issparse(value):
        csr = value.tocsr()
        for part in (csr.shape, csr.indptr, csr.indices, csr.data):
            yield from _parts(part, inside)
    elif isinstance(value, Mapping):
        yield from _each([*value.keys(), *value.values()], inside)
    elif isinstance(value, set | frozenset):
        yield from sorted(fingerprint(one) for one in value)
    elif isinstance(value, list | tuple | range):
        yield from _each(value, inside)
    else:
        yield _kind(value)
        yield from _of_object(value, inside)


def _each(values: Iterable[object], above: tuple[int, ...]) -> Iterator[bytes]:
    for count, one in enumerate(values):
        yield b"%d" % count
        yield from _parts(one, above)


def _kind(value: object) -> bytes:
    return f"{type(value).__module__}.{type(value).__qualname__}".encode()


def _of_number(value: object) -> Iterator[bytes]:
    plain = value.item() if isinstance(value, np.generic) else value
    if isinstance(plain, float):
        yield f"{plain + 0.0:.10g}".encode()
    elif isinstance(plain, complex):
        yield f"{plain.real + 0.0:.10g} {plain.imag + 0.0:.10g}".encode()
    else:
        yield repr(plain).encode()


def _of_array(value: NDArray[np.generic], above: tuple[int, ...]) -> Iterator[bytes]:
    yield repr(value.shape).encode()
    if value.dtype.kind in "fc":
        kind = np.complex128 if value.dtype.kind == "c" else np.float64
        flat = np.ascontiguousarray(value, dtype=kind).reshape(-1).view(np.float64)
        mantissa, exponent = np.frexp(flat)
        yield (np.ldexp(np.rint(np.ldexp(mantissa, 33)), exponent - 33) + 0.0).tobytes()
    elif value.dtype.kind in "biu":
        yield np.ascontiguousarray(value, dtype=np.int64).tobytes()
    else:
        yield from _parts(value.tolist(), above)


def _of_object(value: object, above: tuple[int, ...]) -> Iterator[bytes]:
    module = type(value).__module__.partition(".")[0]
    by_identity = type(value).__hash__ is object.__hash__
    serial = _together.get(value) if by_identity else None
    if serial is not None:
        yield b"%d" % serial
    elif isinstance(value, types.FunctionType):
        yield from _of_function(value, above)
    elif isinstance(value, types.MethodType):
        yield from _each((value.__func__, value.__self__), above)
    elif isinstance(value, types.ModuleType):
        yield value.__name__.encode()
    elif isinstance(value, functools.partial):
        yield from _each((value.func, value.args, value.keywords), above)
    elif isinstance(value, types.BuiltinFunctionType | np.ufunc):
        yield value.__name__.encode()
    elif module in ("dolfinx", "petsc4py", "mpi4py"):
        yield from _parts(_global_facts(value), above)
    elif dataclasses.is_dataclass(value):
        fields = {one.name: getattr(value, one.name) for one in dataclasses.fields(value)}
        if "dolfinx" in fields and "groups" in fields:  # a Mesh: the entities are those of one rank
            fields["groups"] = sorted(fields["groups"])
        yield from _each([fields[name] for name in fields if name not in LOCAL], above)
    else:
        own = getattr(value, "__dict__", {})
        yield from _each([(k, own[k]) for k in sorted(own) if _counts(own[k])], above)


def _counts(value: object) -> bool:
    """Whether a value that a function or a foreign object holds must be the same on all ranks.

    Counters, caches, open files and a rank's own part of something need not.
    """
    if isinstance(value, np.ndarray):
        return value.size <= FEW_ENTRIES
    if isinstance(value, tuple | frozenset):
        return all(_counts(one) for one in value)
    plain = numbers.Number | np.generic | str | bytes | types.FunctionType | functools.partial
    return value is None or isinstance(value, plain) or dataclasses.is_dataclass(value)


def _of_function(function: types.FunctionType, above: tuple[int, ...]) -> Iterator[bytes]:
    """Its code, and the values that it takes from around it; not its address."""
    yield from _of_code(function.__code__, above)
    around = inspect.getclosurevars(function)
    found = {**around.globals, **around.nonlocals, **(function.__kwdefaults__ or {})}
    values = [*(function.__defaults__ or ()), *(found[name] for name in sorted(found))]
    yield from _each([value for value in values if _counts(value)], above)


def _of_code(code: types.CodeType, above: tuple[int, ...]) -> Iterator[bytes]:
    yield code.co_code
    yield repr(code.co_names).encode()
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _of_code(constant, above)
        else:
            yield from _parts(constant, above)


def _global_facts(value: Any) -> tuple[object, ...]:
    """What a distributed object of PETSc, dolfinx or MPI is on all of its ranks."""
    if is_void(value):
        return ("empty or destroyed",)
    if hasattr(value, "topology"):
        cells = value.topology.index_map(value.topology.dim)
        return value.topology.dim, value.geometry.dim, cells.size_global
    size = getattr(value, "getSize", None)
    if size is not None:
        return (size(),)
    return (getattr(value, "dim", None), getattr(value, "name", None))
