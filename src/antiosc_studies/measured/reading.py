"""`read_frf`: measured frequency responses from tables and universal files (data set 58)."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, get_args

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ComplexArray
from antiosc.base.archives import read_arrays
from antiosc.base.errors import AntioscError, InputError, MissingDependencyError
from antiosc.base.files import MAX_READ_BYTES, check_readable
from antiosc_studies.measured.frf import DEFAULT_AVERAGES, FRF, Quantity, checked_quantity
from antiosc_studies.measured.tables import (
    FREQUENCY_UNITS,
    columns_by_name,
    plain_unit,
    response_unit,
    unknown_unit_error,
)

#: Function type of a frequency response in data set 58.
RESPONSE_FUNCTION = 4
#: Function type of a coherence there.
COHERENCE_FUNCTION = 6
#: Data types of the ordinate -> measured quantity; data types of a force in the denominator.
MOTION_DATA_TYPES: dict[int, Quantity] = {8: "receptance", 11: "mobility", 12: "accelerance"}
FORCE_DATA_TYPES = (0, 9, 13)  # unknown, reaction force, excitation force
AXIS_NAMES = "xyz"


#: An end of a function: entity, node, axis.
FunctionEnd: TypeAlias = tuple[str, int, int]
#: Contents of a file by name: fields of a data set as pyuff returns them, or arrays.
DataSet: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class UniversalFunction:
    """One function of a universal file; `sign` is the product of the signs of its directions."""

    response: FunctionEnd
    reference: FunctionEnd
    sign: int
    is_coherence: bool
    quantity: Quantity | None
    factor: float | None
    label: str
    frequency: Array
    values: ComplexArray


def functions_of_file(path: Path) -> list[UniversalFunction]:
    """The frequency responses and coherences of a universal file."""
    try:
        import pyuff
    except ImportError:
        raise MissingDependencyError(
            "universal files are read by pyuff: pip install 'pyuff>=2.5,<2.6'; tables in text and"
            " .npz need no further package."
        ) from None

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            file = pyuff.UFF(str(path))
            types = [int(number) for number in file.get_set_types()]
            sets = [file.read_sets(i) for i, number in enumerate(types) if number in (58, 164)]
        except Exception as error:  # pyuff raises what it likes
            raise InputError(
                f"{path.name} is damaged or no universal file: pyuff cannot read it"
                f" ({' '.join(str(error).split())[:120].rstrip('.') or type(error).__name__})."
            ) from error

    scale = 1.0
    measured = []
    for data_set in sets:
        if data_set["type"] == 164:
            scale = _unit_scale(data_set)
        elif data_set.get("func_type") in (RESPONSE_FUNCTION, COHERENCE_FUNCTION):
            measured.append(_function_of(data_set, scale))

    if all(function.is_coherence for function in measured):
        raise InputError(
            f"{path.name} holds no frequency response (data set 58, function type 4); it has"
            f" {'data sets ' + ', '.join(map(str, sorted(set(types)))) if types else 'none'}."
        )

    return measured


def _unit_scale(data_set: DataSet) -> float:
    """Units of the file for 1 m/N, from its data set 164."""
    length = data_set.get("length")
    force = data_set.get("force")
    if not (length and force and np.isfinite(length) and np.isfinite(force)):
        raise InputError("the units in data set 164 are no positive numbers.")
    return abs(float(force) / float(length))


def _function_of(data_set: DataSet, scale: float) -> UniversalFunction:
    """The function of a data set 58."""
    try:
        count = int(data_set["num_pts"])
        values = np.asarray(data_set["data"])
        f = np.asarray(data_set["x"], dtype=float)
        ends = [_function_end(data_set, side) for side in ("rsp", "ref")]
        labels = [data_set.get(n) for n in ("ordinate_axis_units_lab", "orddenom_axis_units_lab")]
        numerator, denominator = map(plain_unit, labels)
        motion = int(data_set["ordinate_spec_data_type"])
        force = int(data_set["orddenom_spec_data_type"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            "a data set 58 lacks fields of its header: the file is damaged."
        ) from error

    if values.ndim != 1 or len(values) != count or len(f) != count:
        raise InputError(
            f"a data set 58 announces {count} values and holds {len(values)}: the file is cut."
        )
    coherence = data_set["func_type"] == COHERENCE_FUNCTION
    if not coherence and force not in FORCE_DATA_TYPES:
        raise InputError(
            f"a frequency response is per data type {force}, not per force (13): response per"
            " response is no receptance."
        )

    factor, by_label = response_unit(numerator, denominator) if numerator else (scale, None)
    (response, sign), (reference, reference_sign) = ends

    return UniversalFunction(
        response=response,
        reference=reference,
        sign=sign * reference_sign,
        is_coherence=coherence,
        quantity=MOTION_DATA_TYPES.get(motion, by_label),
        factor=factor,
        label=" / ".join(str(unit_label or "").strip() for unit_label in labels),
        frequency=f,
        values=values.astype(complex),
    )


def _function_end(data_set: DataSet, side: str) -> tuple[FunctionEnd, int]:
    """((entity, node, axis), sign of the axis) of a function's response or reference."""
    name = str(data_set.get(f"{side}_ent_name", "")).strip()
    node = int(data_set[f"{side}_node"])
    axis = int(data_set[f"{side}_dir"])
    name = "" if name.upper() == "NONE" else name
    return (name, node, abs(axis)), -1 if axis < 0 else 1


# -- selection of functions


def _end_text(end: FunctionEnd) -> str:
    """An end as text: node and axis."""
    name, node, axis = end
    return f"{name or node}{AXIS_NAMES[axis - 1] if 1 <= axis <= 3 and not name else ''}"


def _only_driving_point(measured: list[UniversalFunction]) -> FunctionEnd:
    """The only driving point of a file; InputError if there are none or several."""
    ends = {function.response for function in measured if function.response == function.reference}
    if len(ends) == 1:
        return ends.pop()
    names = {_end_text(e) for function in measured for e in (function.response, function.reference)}
    raise InputError(
        f"the file has {len(ends) or 'no'} driving points; give site= one of"
        f" {checks.shown(', '.join(sorted(names)))}."
    )


def _end_of(measured: list[UniversalFunction], name: str | int) -> FunctionEnd:
    """The end in a file named by `name`: an entity, a node, or node and axis ("12z")."""
    wanted_name = str(name).strip().lower()
    ends = {end for function in measured for end in (function.response, function.reference)}
    fits = []
    for end in ends:
        if wanted_name in (end[0].lower(), str(end[1]), _end_text(("", *end[1:]))):
            fits.append(end)

    if len(fits) == 1:
        return fits[0]
    end_names = ", ".join(sorted(map(_end_text, fits or ends)))
    reason = "is ambiguous" if fits else "is no site of the file"
    raise InputError(f"site {checks.shown(name)} {reason}; choose one of {end_names[:200]}.")


def selected_responses(
    functions: list[UniversalFunction],
    site: str | int | Mapping[str, str | int] | None,
    quantity: Quantity | None,
    unit: float | None,
    averages: int,
) -> FRF:
    """The responses of all sites, to forces on the sites for which all responses were measured.

    Arguments as for `read_frf`.
    """
    measured = [function for function in functions if not function.is_coherence]

    if site is None:
        ends = {"": _only_driving_point(measured)}
    elif isinstance(site, str | int) and not isinstance(site, bool):
        ends = {"": _end_of(measured, site)}
    else:
        kind = "a name, a node, or a dict {name: name or node}"
        sites = checks.instance("site", site, Mapping, kind).items()
        ends = {checks.name("the name of a site", n): _end_of(measured, one) for n, one in sites}

    if not ends or any(end[2] > 3 for end in ends.values()):
        raise InputError("a site is a displacement; rotations (directions 4 to 6) are not taken.")

    places = list(ends.values())
    pairs: dict[tuple[FunctionEnd, FunctionEnd, bool], UniversalFunction] = {}
    for function in functions:
        key = (function.response, function.reference, function.is_coherence)
        if key in pairs and function.response in places and function.reference in places:
            raise InputError(
                f"the file has the response {_end_text(function.response)} per force at"
                f" {_end_text(function.reference)} twice: leave one measurement in it."
            )
        pairs[key] = function

    forced = [n for n, end in ends.items() if all((m, end, False) in pairs for m in places)]
    if not forced:
        raise InputError(
            "the file has no force whose responses at all of the sites were measured: "
            f"{checks.shown(', '.join(map(_end_text, places)))}."
        )

    cells = [pairs[m, ends[n], False] for m in places for n in forced]
    f = cells[0].frequency
    for cell in cells:
        if len(cell.frequency) != len(f) or not np.allclose(cell.frequency, f):
            raise InputError("the responses have different frequencies: measure all with one set.")
        if unit is None and cell.factor is None:
            raise InputError(
                f"the unit {cell.label!r} is not known: give unit=, the factor to m/N, m/(s N) or"
                " m/(s^2 N)."
            )

    kinds = {quantity or cell.quantity for cell in cells}
    arrays = [cell.sign * (unit or cell.factor or 1.0) * cell.values for cell in cells]
    coherences = [pairs.get((m, ends[n], True)) for m in places for n in forced]
    shape = (len(f), len(places), len(forced)) if list(ends) != [""] else (len(f),)
    coherence = None
    if all(one is not None and len(one.frequency) == len(f) for one in coherences):
        known = [one.values.real for one in coherences if one is not None]
        coherence = np.transpose(known).reshape(shape)
    names: Any = {"sites": tuple(ends), "references": tuple(forced)} if len(shape) > 1 else {}

    return FRF(
        f,
        np.transpose(arrays).reshape(shape),
        checked_quantity(kinds.pop() if len(kinds) == 1 else None),
        coherence,
        averages,
        **names,
    )


@checks.within_range
def read_frf(
    path: str | os.PathLike[str],
    site: str | int | Mapping[str, str | int] | None = None,
    *,
    quantity: Quantity | None = None,
    unit: float | None = None,
    averages: int = DEFAULT_AVERAGES,
) -> FRF:
    """Measured frequency response functions from a file.

    Parameters
    ----------
    path : str or Path
        ``.uff``, ``.unv`` or ``.58``: universal files, data sets 58 and 58b (needs pyuff).
        ``.npz``: arrays `frequency`, `values`, and perhaps `coherence`, `sigma`, `quantity`.
        Other endings: a text table, separated by commas, whose first line names its columns:
        frequency, real and imag, and optionally coherence and sigma. Units are in brackets after a
        name, ``frequency [kHz], real [(mm/s²)/N]``; without a unit a column is in Hz or SI units.
    site : str, int or {name: str or int}, optional
        For universal files: the site by entity name, node, or node and axis ("12", "12z"); for
        several sites a dict with names of your choice. None: the only driving point in the file.
    quantity : "receptance", "mobility" or "accelerance", optional
        Quantity of tables and arrays; universal files state it.
    unit : float, optional
        Factor of the values to m/N, m/(s N) or m/(s^2 N); default: from the labels or data set
        164 of universal files, from the headers of tables, else 1.
    averages : int
        Number of averages of the coherence.

    Returns
    -------
    FRF

    Raises
    ------
    InputError
        A file that is missing, truncated or damaged, or that contains no such measurement.
    MissingDependencyError
        A universal file without pyuff.
    """
    file = checks.path("path", path)
    if quantity is not None:
        checks.choice("quantity", quantity, get_args(Quantity))
    factor = None if unit is None else checks.positive("unit", unit)
    averages = checks.whole("averages", averages)
    ending = file.suffix.lower()

    try:
        check_readable(file, "a measurement")
        if ending in (".uff", ".unv", ".58"):
            frfs = functions_of_file(file)
            return selected_responses(frfs, site, quantity, unit, averages)
        if site is not None:
            raise InputError("site belongs to universal files; a table has one driving point.")
        arrays = _arrays_of_file(file) if ending == ".npz" else _arrays_of_table(file, factor)
        return _frf_of_arrays(arrays, quantity, factor or 1.0, averages)
    except AntioscError as error:
        if file.name in str(error):
            raise
        raise type(error)(f"{file.name}: {error}") from error


def _arrays_of_table(path: Path, factor: float | None) -> DataSet:
    """The arrays of a table in SI units; responses are unchanged if their `factor` is given."""
    columns = columns_by_name(path, "frequency", "real", "imag")
    quantities: set[Quantity] = set()

    def response(name: str) -> Array:
        column = columns[name]
        if factor is not None or not column.unit:
            return column.values
        scale, quantity = response_unit(plain_unit(column.unit))
        if scale is None or quantity is None:
            raise unknown_unit_error(column, "m/N, (m/s)/N, (m/s²)/N, mm/N, g/N, or give unit=")
        quantities.add(quantity)
        return scale * column.values

    arrays: dict[str, Any] = {
        "frequency": columns["frequency"].in_si(FREQUENCY_UNITS),
        "values": response("real") + 1j * response("imag"),
    }
    if "sigma" in columns:
        arrays["sigma"] = response("sigma")
    if "coherence" in columns:
        arrays["coherence"] = columns["coherence"].in_si({"-": 1.0})
    if len(quantities) > 1:
        raise InputError("the units in the header are those of different quantities.")
    return {**arrays, "told": next(iter(quantities), None)}


def _frf_of_arrays(arrays: DataSet, quantity: Quantity | None, factor: float, averages: int) -> FRF:
    """An FRF from named arrays."""
    told = arrays.get("told")
    if quantity and told not in (None, quantity):
        raise InputError(f"quantity={quantity!r} is not what the units in the header tell: {told}.")
    quantity = checked_quantity(quantity or arrays.get("quantity", told))
    if not {"frequency", "values"} <= set(arrays):
        raise InputError(
            "a measurement needs frequencies and values: the columns frequency, real and imag of a"
            " table; frequency and values of an .npz."
        )

    values: ComplexArray = np.multiply(factor, checks.spectrum("values", arrays["values"]))
    optional: dict[str, Any] = {
        name: scale * checks.floats(name, arrays[name], None)
        for name, scale in (("coherence", 1.0), ("sigma", factor))
        if name in arrays
    }
    return FRF(arrays["frequency"], values, quantity, averages=averages, **optional)


def _arrays_of_file(path: Path) -> DataSet:
    """The arrays of a NumPy file."""
    expected = "a NumPy file of arrays (.npz)"
    arrays: dict[str, Any] = dict(read_arrays(path, MAX_READ_BYTES, expected, "fiucU"))
    if "quantity" in arrays:
        arrays["quantity"] = str(arrays["quantity"])
    return {name: array for name, array in arrays.items() if name != "told"}
