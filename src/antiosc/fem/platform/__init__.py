"""The ranks of MPI: equal arguments, work on rank 0, errors raised on all ranks.

Without mpi4py there is one process, whose communicator is `SERIAL`.

A fingerprint of the arguments of a call must be equal on all ranks. It excludes data that may
differ by rank: the rows of shapes and the parts of distributed matrices and meshes. Numbers are
rounded to ten digits, so that ranks on different processors agree.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
import numbers
import os
import pickle
import threading
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import nullcontext
from operator import attrgetter
from typing import Any, ParamSpec, TypeVar, cast
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from antiosc.base import errors
from antiosc.base._types import Array
from antiosc.base.checks import shown
from antiosc.base.errors import AntioscWarning, InputError
from antiosc.base.process import within_memory

#: Fields that hold the rows or the times of one rank.
LOCAL = frozenset({"phi", "residual", "seconds", "shape", "shapes"})
#: Greatest depth to which objects inside objects are followed.
MOST_NESTED = 12
#: Most entries of an array in a function's closure that the fingerprint includes: larger arrays may
#: differ by rank.
FEW_ENTRIES = 64

#: Objects that all ranks made together -> their number, which is the same on all ranks.
_together: WeakKeyDictionary[object, int] = WeakKeyDictionary()


def number(created: object, serial: int) -> None:
    """Register `created` as number `serial` of the objects that all ranks made together."""
    for k, item in enumerate(created if isinstance(created, list) else [created]):
        if type(item).__hash__ is object.__hash__ and type(item).__module__.startswith("antiosc"):
            _together[item] = serial + k


def named(value: object) -> str | None:
    """Name, such as "Structure no. 3", of an object that all ranks made together; None for any
    other.
    """
    if type(value).__hash__ is not object.__hash__ or value not in _together:
        return None
    return f"{type(value).__name__} no. {_together[value]}"


def of_petsc(value: object) -> bool:
    """Whether `value` is a PETSc object; petsc4py need not be installed."""
    return any(kind.__module__ == "petsc4py.PETSc" for kind in type(value).__mro__)


def is_void(value: object) -> bool:
    """Whether `value` is a PETSc object that is empty or destroyed.

    Any call of a method of such an object ends the process.
    """
    return of_petsc(value) and not value


def fingerprint(value: object) -> bytes:
    """16 bytes that are equal for equal values; never raises."""
    digest = hashlib.blake2b(digest_size=16)
    try:
        for part in _parts(value, ()):
            digest.update(part)
            digest.update(b"\0")
    except Exception:  # a foreign object may raise what it likes
        digest.update(_kind(value))
    return digest.digest()


def _parts(value: object, above: tuple[int, ...]) -> Iterator[bytes]:
    """Bytes that describe a value, for the digest; `above`: ids of the objects that contain it."""
    if id(value) in above or len(above) > MOST_NESTED:
        return
    containers = (*above, id(value))
    if value is None or isinstance(value, str | bytes | type):
        yield repr(value).encode()
    elif isinstance(value, numbers.Number | np.generic):
        yield from _of_number(value)
    elif isinstance(value, os.PathLike):
        yield os.fsencode(value)
    elif isinstance(value, np.ndarray):
        yield from _of_array(value, containers)
    elif scipy.sparse.issparse(value):
        csr = scipy.sparse.csr_matrix(value)
        for part in (csr.shape, csr.indptr, csr.indices, csr.data):
            yield from _parts(part, containers)
    elif isinstance(value, Mapping):
        yield from _each([*value.keys(), *value.values()], containers)
    elif isinstance(value, set | frozenset):
        yield from sorted(fingerprint(item) for item in value)
    elif isinstance(value, list | tuple | range):
        yield from _each(value, containers)
    else:
        yield _kind(value)
        yield from _of_object(value, containers)


def _each(values: Iterable[object], above: tuple[int, ...]) -> Iterator[bytes]:
    """Bytes that describe each value of a sequence."""
    for count, item in enumerate(values):
        yield b"%d" % count
        yield from _parts(item, above)


def _kind(value: object) -> bytes:
    """Qualified name of the class of a value."""
    return f"{type(value).__module__}.{type(value).__qualname__}".encode()


def _of_number(value: object) -> Iterator[bytes]:
    """Bytes that describe a number; floats are rounded to ten digits."""
    python_number = value.item() if isinstance(value, np.generic) else value
    if isinstance(python_number, float):
        yield f"{python_number + 0.0:.10g}".encode()
    elif isinstance(python_number, complex):
        yield f"{python_number.real + 0.0:.10g} {python_number.imag + 0.0:.10g}".encode()
    else:
        yield repr(python_number).encode()


def _of_array(value: NDArray[np.generic], above: tuple[int, ...]) -> Iterator[bytes]:
    """Bytes that describe an array; floats are rounded to 33 bits."""
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
    """Bytes that describe any other object by its fields."""
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
        fields = {member.name: getattr(value, member.name) for member in dataclasses.fields(value)}
        if "dolfinx" in fields and "groups" in fields:  # a Mesh: the entities are those of one rank
            fields["groups"] = sorted(fields["groups"])
        yield from _each([fields[name] for name in fields if name not in LOCAL], above)
    else:
        attributes = getattr(value, "__dict__", {})
        yield from _each(
            [(k, attributes[k]) for k in sorted(attributes) if _counts(attributes[k])], above
        )


def _counts(value: object) -> bool:
    """Whether a value in a closure or a foreign object is compared between the ranks.

    Counters, caches, open files and the parts of a rank need not be.
    """
    if isinstance(value, np.ndarray):
        return value.size <= FEW_ENTRIES
    if isinstance(value, tuple | frozenset):
        return all(_counts(item) for item in value)
    compared_types = (
        numbers.Number | np.generic | str | bytes | types.FunctionType | functools.partial
    )
    return value is None or isinstance(value, compared_types) or dataclasses.is_dataclass(value)


def _of_function(function: types.FunctionType, above: tuple[int, ...]) -> Iterator[bytes]:
    """The code of a function and the values of its closure, but not its address."""
    yield from _of_code(function.__code__, above)
    closure = inspect.getclosurevars(function)
    names = {**closure.globals, **closure.nonlocals, **(function.__kwdefaults__ or {})}
    values = [*(function.__defaults__ or ()), *(names[name] for name in sorted(names))]
    yield from _each([value for value in values if _counts(value)], above)


def _of_code(code: types.CodeType, above: tuple[int, ...]) -> Iterator[bytes]:
    """Bytes that describe the code of a function, with its nested functions."""
    yield code.co_code
    yield repr(code.co_names).encode()
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _of_code(constant, above)
        else:
            yield from _parts(constant, above)


def _global_facts(value: Any) -> tuple[object, ...]:
    """Properties of a distributed object of PETSc, dolfinx or MPI that are equal on all its
    ranks.
    """
    if is_void(value):
        return ("empty or destroyed",)
    if hasattr(value, "topology"):
        cells = value.topology.index_map(value.topology.dim)
        return value.topology.dim, value.geometry.dim, cells.size_global
    size = getattr(value, "getSize", None)
    if size is not None:
        return (size(),)
    return (getattr(value, "dim", None), getattr(value, "name", None))


P = ParamSpec("P")
T = TypeVar("T")


class Serial:
    """The methods of an MPI communicator that antiosc uses, for one rank."""

    rank = 0
    size = 1

    def allreduce(self, value: T) -> T:
        """The value itself: the sum over one rank."""
        return value

    def allgather(self, value: T) -> list[T]:
        """The values of all ranks."""
        return [value]

    def gather(self, value: T, root: int = 0) -> list[T]:
        """The values of all ranks, on `root`."""
        return [value]

    def bcast(self, value: T, root: int = 0) -> T:
        """The value of rank `root`."""
        return value


SERIAL = Serial()


MPI: Any
try:
    from mpi4py import MPI
except ImportError:  # given matrices need none
    MPI = None

#: Communicators of all processes, and of this process.
WORLD, ALONE = (SERIAL, SERIAL) if MPI is None else (MPI.COMM_WORLD, MPI.COMM_SELF)

#: Lock for PETSc, SLEPc and dolfinx, which only one thread may use; SciPy's matrices need none.
_packages = threading.RLock()

#: The number of the next object that all ranks make together.
_serial = 0


def collective(
    default: MPI.Comm = WORLD, **counts: Callable[..., object]
) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Guard a public function that all ranks must call with the same arguments.

    First the ranks compare fingerprints of their arguments. If these differ, all ranks raise
    InputError; otherwise they would deadlock, or mix two problems. At the end an error of one rank
    is raised on all ranks. On one rank the function is called directly, by one thread at a time.

    Parameters
    ----------
    default : the communicator used if no argument has one.
    counts : argument name -> function of its value; its result must be equal on all ranks.
    """

    def guard(function: Callable[P, T]) -> Callable[P, T]:
        signature = inspect.signature(function)
        guarded_call = within_memory(function)

        @functools.wraps(function)
        def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
            comm = _communicator(_flat([*args, *kwargs.values()]), default)
            if comm.size == 1:
                with nullcontext() if isinstance(comm, Serial) else _packages:
                    return guarded_call(*args, **kwargs)
            arguments = _given(signature, args, kwargs)
            for name in counts.keys() & arguments.keys():
                arguments[name] = _counted(counts[name], arguments[name])
            compare(comm, function.__qualname__, arguments)
            result: T | None = None
            error: Exception | None = None
            try:
                result = guarded_call(*args, **kwargs)
            except Exception as caught:
                error = caught
            _conclude(comm, error, args[0] if function.__name__ == "__init__" else result)
            return cast(T, result)

        return guarded

    return guard


def compare(comm: MPI.Comm, name: str, arguments: Mapping[str, object]) -> None:
    """InputError on all ranks unless they call `name` with the same arguments."""
    call = name, {key: fingerprint(value) for key, value in arguments.items()}
    ranks = comm.allgather(call)
    if all(fingerprint == ranks[0] for fingerprint in ranks):
        return
    texts = comm.allgather({key: named(value) or shown(value) for key, value in arguments.items()})
    rank = next(k for k, fingerprint in enumerate(ranks) if fingerprint != ranks[0])
    arguments_first, first = ranks[0]
    arguments_other, other = ranks[rank]
    if arguments_first != arguments_other:
        raise InputError(
            f"rank 0 calls {_public(arguments_first)} where rank {rank} calls "
            f"{_public(arguments_other)}: all "
            "ranks must make the same calls."
        )
    key = next(k for k in [*first, *other] if first.get(k) != other.get(k))
    values = [texts[k].get(key, "nothing") for k in (0, rank)]
    message = f"{values[0]} on rank 0, {values[1]} on rank {rank}"
    if values[0] == values[1]:
        message = f"on rank {rank} not what it is on rank 0, {values[0]}"
    raise InputError(
        f"{_public(name)} needs the same arguments on every MPI rank; {key} differs: {message}; "
        "compute it on one rank and broadcast it."
    )


def _public(name: str) -> str:
    """The name of the class for `__init__` and `__new__`; otherwise the name itself."""
    return name.removesuffix(".__init__").removesuffix(".__new__")


def _given(
    signature: inspect.Signature, args: Iterable[object], kwargs: Mapping[str, object]
) -> dict[str, object]:
    """Argument name -> value of a call; positions are the names if the call does not fit the
    signature.
    """
    try:
        arguments = dict(signature.bind_partial(*args, **kwargs).arguments)
    except TypeError:
        arguments = {**{f"argument {k + 1}": value for k, value in enumerate(args)}, **kwargs}
    return {name: value for name, value in arguments.items() if name not in ("self", "cls")}


def _counted(count: Callable[..., object], value: object) -> object:
    """`count(value)`, or the value itself where `count` fails, so that the callee reports the
    fault.
    """
    try:
        return count(value)
    except Exception:  # the function called will say what is wrong with it
        return value


def _flat(values: Iterable[object]) -> list[object]:
    """The values as a list; a mapping is replaced by its values, those shared by most ranks
    first.
    """
    flat: list[object] = []
    for value in values:
        nested = value.values() if isinstance(value, Mapping) else [value]
        flat += sorted(nested, key=_ranks, reverse=True)
    return flat


def _ranks(value: object) -> int:
    """Number of ranks that share a value; 0 for a value without communicator."""
    if is_void(value):
        return 0  # to ask for its communicator kills the process
    try:
        return int(attrgetter("comm.size")(value))
    except Exception:
        return 0


def _communicator(values: Iterable[object], default: MPI.Comm) -> MPI.Comm:
    """The communicator of the first value that has one.

    dolfinx and PETSc work on copies of their communicators. Ranks that got different objects still
    use this one to compare them.
    """
    for value in values:
        if is_void(value):
            default = WORLD  # it may be a real one on other ranks
            continue  # to ask for its communicator kills the process
        if MPI is not None and isinstance(value, MPI.Comm) and value == MPI.COMM_NULL:
            raise InputError(
                "comm is MPI.COMM_NULL, of which no process is a part: call this on the ranks of a "
                "communicator alone."
            )
        try:
            comm = getattr(value, "comm", None)
            if isinstance(comm, Serial):
                return comm
            if MPI is None:
                continue
            if isinstance(value, MPI.Comm):
                comm = value
            if comm is not None and not isinstance(comm, MPI.Comm):
                comm = comm.tompi4py()  # one of PETSc's
        except Exception:
            continue
        if isinstance(comm, MPI.Comm) and comm != MPI.COMM_NULL:
            if alike(comm, WORLD):
                return WORLD
            return comm
    return default


def alike(first: MPI.Comm, second: MPI.Comm) -> bool:
    """Whether two communicators have the same ranks in the same order."""
    if isinstance(first, Serial) or isinstance(second, Serial):
        return first is second
    return MPI.Comm.Compare(first, second) in (MPI.IDENT, MPI.CONGRUENT)


def _conclude(comm: MPI.Comm, error: Exception | None, created: object) -> None:
    """Raise the error of any rank on all ranks; otherwise number the objects that they made
    together.
    """
    global _serial
    reports = comm.allgather((_portable(error), _serial))
    _raise_first([problem for problem, _ in reports], error)
    serial = max(count for _, count in reports)
    number(created, serial)
    _serial = serial + (len(created) if isinstance(created, list) else 1)


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of `work()` done on rank 0, on all ranks; its error is raised on all of them."""
    if comm.size == 1:
        return work()
    result: T | None = None
    error: Exception | None = None
    if comm.rank == 0:
        try:
            result = work()
        except Exception as caught:
            error = caught
    result, problem = comm.bcast((result, _portable(error)), root=0)
    _raise_first([problem], error)
    return result  # type: ignore[return-value]


def agree(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise the first error of any rank on every rank; return if there is none."""
    _raise_first(comm.allgather(_portable(error)), error)


def agreed(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of `work()` on each rank; the first error of any rank is raised on all of them."""
    result: T | None = None
    error: Exception | None = None
    try:
        result = work()
    except Exception as caught:
        error = caught
    agree(comm, error)
    return result  # type: ignore[return-value]


def warn(comm: MPI.Comm, message: str, category: type[Warning] = AntioscWarning) -> None:
    """Warn once, on rank 0.

    If the caller's filters turn the warning into an error, all ranks raise it.
    """
    on_root(comm, lambda: errors.warn(message, category))


def _portable(error: Exception | None) -> Exception | None:
    """The error, or a substitute that can be pickled: otherwise the other ranks would wait
    forever.
    """
    if error is None:
        return None
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _raise_first(errors: list[Exception | None], local_error: Exception | None) -> None:
    """Raise the first error of all ranks, if any; `local_error` is that of this rank."""
    first = next((error for error in errors if error is not None), None)
    if first is None:
        return
    if local_error is not None and str(_portable(local_error)) == str(first):
        raise local_error  # the same, with its traceback
    raise first


def bounds(comm: MPI.Comm, x: Array) -> tuple[Array, Array]:
    """(lowest, highest) coordinates (dim,) of points x (n, dim) over all ranks."""
    dim = x.shape[1]
    low = x.min(axis=0) if len(x) else np.full(dim, np.inf)
    high = x.max(axis=0) if len(x) else np.full(dim, -np.inf)
    return np.min(comm.allgather(low), axis=0), np.max(comm.allgather(high), axis=0)
