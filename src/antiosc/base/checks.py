"""Input checks shared by all modules: each returns the value as it is stored, or raises.

A number must be real and finite: complex numbers, strings, bools, NaN and infinity are refused.
"""

from __future__ import annotations

import os
import re
import reprlib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import Field, fields
from functools import cache, wraps
from itertools import accumulate
from math import inf, isfinite, pi
from numbers import Rational, Real
from pathlib import Path
from typing import Any, ClassVar, ParamSpec, TypeVar, overload

import numpy as np

from antiosc.base._types import Array, NDArray, Numbers
from antiosc.base.errors import AccuracyError, InputError
from antiosc.base.process import within_memory
from antiosc.base.texts import FieldsRepr

#: Relative error of a sum whose terms cancel, as of the modes of a model or the entries of a row:
#: the unit of double precision, 2.2e-16, times 5000 terms.
ROUNDING = 1e-12
P = ParamSpec("P")
T = TypeVar("T")
S = TypeVar("S", bound=np.generic)
#: type of the values that a check returns unchanged
C = TypeVar("C")

#: A quantity in SI units is 0 or lies between these in magnitude. Products and powers of a few such
#: numbers stay within double precision (1e±308).
MIN_MAGNITUDE = 1e-60
MAX_MAGNITUDE = 1e60
#: Largest whole number: every one up to it is a float too.
MAX_INTEGER = 2**53

#: Most letters of a name.
MAX_NAME_LENGTH = 200

_BOOLEAN_TYPES = (bool, np.bool_)
#: Types that Python or NumPy counts among the numbers, but that are refused as numbers.
_REFUSED_NUMBERS = (*_BOOLEAN_TYPES, np.timedelta64)


class _Required:
    """The default of a required argument that comes after an optional one."""

    def __repr__(self) -> str:
        return "nothing"


REQUIRED: Any = _Required()

#: strings, TOML comments and all other text that contains no bracket
_NO_BRACKETS = r""""(?:[^"\\\n]|\\.)*"|'[^'\n]*'|\#[^\n]*|[^][{}"'#]+|["'#]"""

_repr = reprlib.Repr()
_repr.maxstring = _repr.maxother = _repr.maxlong = 60
_repr.maxlist = _repr.maxtuple = _repr.maxarray = _repr.maxset = _repr.maxdict = 4


# -- numbers


def number(name: str, value: object, unit: str = "") -> float:
    """`value` as a finite float, 0 or of a magnitude from 1e-60 to 1e60, or InputError."""
    result = value if type(value) is float else _as_float(name, value, unit)
    if not (MIN_MAGNITUDE <= abs(result) <= MAX_MAGNITUDE or result == 0.0):
        if not isfinite(result):
            raise InputError(f"{name} must be finite{_unit_text(unit)}; got {shown(value)}.")
        raise InputError(
            f"{name} must be 0 or between {MIN_MAGNITUDE:g} and {MAX_MAGNITUDE:g} in magnitude"
            f"{_unit_text(unit)}; got {result:g}."
        )

    return result


def _as_float(name: str, value: object, unit: str) -> float:
    """A real number of any type as a float; inf if it is too large for a float."""
    if isinstance(value, np.ndarray) and value.ndim == 0 and not _is_masked(value):
        value = value[()]
    if isinstance(value, _REFUSED_NUMBERS) or not isinstance(value, Real):
        raise InputError(f"{name} must be a number{_unit_text(unit)}; got {shown(value)}.")

    try:
        return float(value)
    except (ValueError, OverflowError):
        return inf


def positive(name: str, value: object, unit: str = "") -> float:
    """`value` as a finite float > 0, or InputError."""
    result = number(name, value, unit)
    if result <= 0:
        raise InputError(f"{name} must be > 0{_unit_text(unit)}; got {result:g}.")
    return result


def band(value: object) -> float:
    """The upper end of a frequency band [Hz] as a circular frequency [rad/s], or InputError."""
    return 2 * pi * positive("band", value, "Hz")


def nonnegative(name: str, value: object, unit: str = "") -> float:
    """`value` as a finite float >= 0, or InputError."""
    result = number(name, value, unit)
    if result < 0:
        raise InputError(f"{name} must be >= 0{_unit_text(unit)}; got {result:g}.")
    return result


def whole(name: str, value: object, least: int = 1, most: int = MAX_INTEGER) -> int:
    """`value` as an int from `least` to `most`, or InputError; 2.0 is taken as 2."""
    if isinstance(value, np.ndarray) and value.ndim == 0 and not _is_masked(value):
        value = value[()]

    sound = type(value) is int or (
        isinstance(value, Real)
        and not isinstance(value, _REFUSED_NUMBERS)
        and (value.denominator == 1 if isinstance(value, Rational) else float(value).is_integer())
    )
    if not sound or (result := int(value)) < least:  # type: ignore[call-overload]
        raise InputError(f"{name} must be a whole number >= {least}; got {shown(value)}.")
    if result > most:
        raise InputError(f"{name} must be at most {most}; got {shown(value)}.")

    return result


def is_infinite(value: object) -> bool:
    """Whether `value` is +inf or -inf, which a radius may be (a plane)."""
    return isinstance(value, float | np.floating) and bool(np.isinf(value))


def is_rigid(value: object) -> bool:
    """Whether `value` is +inf, which a modulus or a stiffness may be (rigid); -inf is not."""
    return is_infinite(value) and value == inf


def poisson(value: object) -> float:
    """Poisson's ratio of a stable isotropic material, -1 < nu < 0.5, or InputError."""
    result = number("nu", value)
    if not -1 < result < 0.5:
        raise InputError(
            f"nu must lie in -1 < nu < 0.5 (0.5 is incompressible, without a finite stiffness);"
            f" got {result:g}."
        )

    return result


def tolerance(value: object, name: str = "tol") -> float:
    """A relative error 0 < tol < 1, or InputError."""
    result = positive(name, value)
    if result >= 1:
        raise InputError(f"{name} is a relative error, 0 < {name} < 1; got {result:g}.")
    return result


# -- arrays of numbers


def floats(name: str, value: object, shape: tuple[int | None, ...] | None) -> Array:
    """`value` as a finite float array of `shape`, without a copy if it is one; else InputError."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        result = value
    else:
        result = _array_of_kinds(name, value, "iuf")
        with np.errstate(over="ignore"):  # a long double above 1e308 becomes inf, refused below
            result = np.asarray(result, dtype=float)

    if shape is not None:
        _check_shape(name, result, shape)

    # NaN, too; |result| would be another array as large as the shapes of a model
    if result.size and not max(float(result.max()), -float(result.min())) <= MAX_MAGNITUDE:
        bad = np.count_nonzero(~np.isfinite(result))
        if bad:
            raise InputError(f"{name} must be finite; {bad} of its {result.size} entries are not.")
        raise InputError(
            f"{name} must not exceed {MAX_MAGNITUDE:g} in magnitude; its largest entry is "
            f"{np.abs(result).max():g}."
        )

    return result


def nonempty(name: str, value: object) -> Array:
    """A sequence of one number or more as an array (n,), or InputError."""
    result = floats(name, value, (None,))
    if not result.size:
        raise InputError(f"{name} must hold one number or more; got none.")
    return result


def strength_range(value: object, strength: float | None) -> tuple[float, float]:
    """(lowest, highest) yield strength [Pa], with `strength` between them, or InputError."""
    low, high = floats("yield_range", value, (2,)).tolist()
    if not 0 < low <= (strength or 0.0) <= high:
        raise InputError("yield_range needs yield_strength within it.")
    return low, high


def positives(name: str, value: object, unit: str = "") -> Array:
    """Numbers > 0, each of a magnitude from 1e-60 to 1e60, as an array (n,), or InputError."""
    result = column(name, value)
    if result.size and not result.min() >= MIN_MAGNITUDE:
        worst = int(np.argmin(result))
        raise InputError(
            f"every {name} must be > 0; {name}[{worst}] = {result[worst]:g} is below"
            f" {MIN_MAGNITUDE:g}{_unit_text(unit)}."
        )

    return result


def column(name: str, value: object, size: int | None = None) -> Array:
    """One number or a sequence of them as an array (n,), or InputError."""
    result = floats(name, value, None)
    result = result.reshape(1) if result.ndim == 0 else result
    _check_shape(name, result, (size,))
    return result


def spectrum(name: str, value: object) -> Numbers:
    """Finite numbers, real or complex, as an array of any shape, or InputError."""
    result = _array_of_kinds(name, value, "iufc")
    floats = np.array(result, complex) if result.dtype.kind == "c" else np.array(result, float)
    if floats.size and not np.abs(floats).max() <= MAX_MAGNITUDE:  # catches NaN too
        raise InputError(f"{name} must be finite and at most {MAX_MAGNITUDE:g} in magnitude.")
    return floats


def coordinates(name: str, value: object, unit: str = "m") -> tuple[float, ...]:
    """`value` as 2 or 3 floats, or InputError."""
    result = floats(name, value, None)
    if result.shape not in ((2,), (3,)):
        raise InputError(f"{name} must be 2 or 3 numbers{_unit_text(unit)}; got {shown(value)}.")
    return tuple(result.tolist())


def scaled_symmetric(matrix: Array, scale: Array) -> tuple[Array, float]:
    """(symmetric part, largest asymmetry) of a matrix with rows and columns divided by `scale`."""
    scale = np.where(scale > 0, scale, 1.0)
    unit = matrix / scale[:, None] / scale
    return (unit + unit.T) / 2, float(np.abs(unit - unit.T).max(initial=0.0))


def read_only(values: NDArray[S]) -> NDArray[S]:
    """A read-only copy: later changes of the caller's array do not change the stored one."""
    floats = np.array(values)
    floats.setflags(write=False)
    return floats


# -- other arguments


def flag(name: str, value: object) -> bool:
    """`value` as a bool, or InputError."""
    if not isinstance(value, _BOOLEAN_TYPES):
        raise InputError(f"{name} must be true or false; got {shown(value)}.")
    return bool(value)


def choice(name: str, value: object, options: Collection[C]) -> C:
    """`value` if it is one of `options`, or InputError."""
    if value is None or (isinstance(value, str | int) and not isinstance(value, bool)):
        for option in options:
            if option == value:
                return option
    *options_before, last = map(repr, options)
    raise InputError(f"{name} must be {', '.join(options_before)} or {last}; got {shown(value)}.")


def text(name: str, value: object) -> str:
    """`value` as a string that is not empty, or InputError."""
    if not isinstance(value, str) or not value:
        raise InputError(f"{name} must be a name in quotes; got {shown(value)}.")
    return str(value)


def name(what: str, value: object) -> str:
    """`value` as a short, printable name of a body, a site or a part, or InputError."""
    result = text(what, value)
    if not result.isprintable():
        raise InputError(f"{what} must be printable, on one line; got {ascii(result)[:60]}.")
    if len(result) > MAX_NAME_LENGTH:
        raise InputError(
            f"{what} must have at most {MAX_NAME_LENGTH} letters; {shown(result)} has "
            f"{len(result)}."
        )

    return result


def path(name: str, value: object) -> Path:
    """`value` as a path, or InputError."""
    if not isinstance(value, str | os.PathLike) or not isinstance(os.fspath(value), str):
        raise InputError(f"{name} must be a file name; got {shown(value)}.")
    name_of_file = os.fspath(value)
    if not name_of_file or "\0" in name_of_file:
        raise InputError(f"{name} must be the name of a file; got {shown(name_of_file)}.")
    return Path(name_of_file)


def what_and_path(what: Any, path: Any) -> tuple[Any, Any]:
    """(object to write, its path), also if the caller gave the path first."""
    if isinstance(what, str | os.PathLike):
        return (path, what)
    return (what, path)


def new_file(name: str, value: object) -> Path:
    """`value` as the path of a file to be written; InputError for folders such as "." and "/"."""
    target = path(name, value)
    if target.name in ("", ".."):
        raise InputError(
            f"{name} must be the name of a file; {shown(str(target))} is a folder: give a "
            "name in it."
        )

    return target


def function(name: str, value: object, what: str = "a function") -> Callable[..., Any]:
    """`value` if it can be called, or InputError; `what` describes it."""
    if not callable(value):
        raise InputError(f"{name} must be {what}; got {shown(value)}.")
    return value


@overload
def instance(name: str, value: object, kind: type[C], what: str) -> C: ...
@overload
def instance(name: str, value: object, kind: tuple[type, ...], what: str) -> Any: ...
def instance(name: str, value: object, kind: type | tuple[type, ...], what: str) -> object:
    """`value` if it is of `kind`, or InputError; `what` names the kind and how to get one."""
    if not isinstance(value, kind):
        kind_given = "" if value is None else f"{type(value).__name__} "
        raise InputError(f"{name} must be {what}; got {kind_given}{shown(value)}.")
    return value


def list_of(name: str, value: object, kind: type[C] | tuple[type[C], ...], what: str) -> list[C]:
    """One object of `kind`, or a sequence of them, as a list, or InputError."""
    items = [value] if isinstance(value, kind) else value
    if not isinstance(items, Sequence) or isinstance(items, str):
        items = [value]

    for item in items:
        if not isinstance(item, kind):
            raise InputError(
                f"{name} must be a list of {what}; got {type(item).__name__} {shown(item)} in it."
            )

    return list(items)


def store(target: object, **values: object) -> None:
    """Set attributes of a frozen dataclass; call it only from `__post_init__`."""
    for name, value in values.items():
        object.__setattr__(target, name, value)


# -- results


def within_range(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator: overflow, division by 0 and NaN raise AccuracyError.

    Lack of memory raises OutOfMemoryError, as by `within_memory`.
    """

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                return function(*args, **kwargs)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            if isinstance(error, AccuracyError):
                raise
            name = function.__qualname__.removesuffix(".__post_init__")
            raise AccuracyError(
                f"{name}: the magnitudes of the arguments differ too much for double precision "
                f"({error}); check their units, which are SI."
            ) from error

    return within_memory(guarded)


def shown(value: object) -> str:
    """`value` as one short line for a message."""
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape} and type {value.dtype}"

    try:
        line = " ".join(_repr.repr(value).split())
    except Exception:  # a foreign object's repr, or an int of more than 4300 digits
        return f"an object of type {type(value).__name__}"

    if len(line) <= 80:
        return line

    return f"an object of type {type(value).__name__}"


def nests_deeper(text: str, max_depth: int) -> bool:
    """Whether the brackets of a text in JSON or TOML nest deeper than `max_depth`."""
    brackets = re.sub(_NO_BRACKETS, "", text)
    depths = accumulate(1 if bracket in "[{" else -1 for bracket in brackets)
    return max(depths, default=0) > max_depth


def point_text(point: Iterable[float]) -> str:
    """A point (n,) [m] as text for a message."""
    rounding = 1e-9 * max(map(abs, point), default=0.0)
    return "(" + ", ".join(f"{c if abs(c) > rounding else 0.0:.6g}" for c in point) + ") m"


# -- helpers


def _array_of_kinds(name: str, value: object, kinds: str) -> NDArray[np.generic]:
    """`value` as an array whose dtype is of one of NumPy's `kinds`, or InputError."""
    expected = "an array of numbers" if "c" in kinds else "an array of real numbers"
    if _is_masked(value):
        raise InputError(f"{name} must be {expected}; got {shown(value)}.")

    try:
        result = np.asarray(value)
    except Exception:  # ragged lists, and foreign objects whose __array__ raises what it likes
        raise InputError(f"{name} must be {expected}; got {shown(value)}.") from None

    if result.dtype.kind not in kinds:
        raise InputError(f"{name} must be {expected}; got {shown(value)}.")
    return result


def _is_masked(value: object) -> bool:
    return isinstance(value, np.ma.MaskedArray)


def _check_shape(name: str, value: NDArray[np.generic], shape: tuple[int | None, ...]) -> None:
    fits = value.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, value.shape, strict=True)
    )
    if not fits:
        shape_text = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ")"
        raise InputError(f"{name} must have shape {shape_text}; got {value.shape}.")


def _unit_text(unit: str) -> str:
    return f" (in {unit})" if unit else ""


#: (name, value) -> the value as it is stored
Check = Callable[[str, object], object]


def checked_by(check: Callable[..., object], *others: object) -> Mapping[str, Check]:
    """Metadata of a field that stores the result of `check(name, value, *others)`."""
    return {"check": (lambda name, value: check(name, value, *others)) if others else check}


class Checked(FieldsRepr):
    """Base of frozen dataclasses whose fields have checks; a default None is not checked."""

    __dataclass_fields__: ClassVar[dict[str, Field[object]]]

    def __post_init__(self) -> None:
        for name, check, may_be_none in _checks_of(type(self)):  # type: ignore[arg-type]
            value = getattr(self, name, None)
            if not (value is None and may_be_none):
                object.__setattr__(self, name, check(name, value))


@cache
def _checks_of(kind: type[Checked]) -> list[tuple[str, Check, bool]]:
    """(name, check, whether None is allowed) of each field of a class that has a check."""
    entries = [entry for entry in fields(kind) if "check" in entry.metadata]
    return [(entry.name, entry.metadata["check"], entry.default is None) for entry in entries]
