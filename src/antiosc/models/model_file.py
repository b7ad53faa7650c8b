"""Models as files: NumPy's `.npz` with a header in JSON, and reduced matrices for other programs.

A model file is untrusted data: it is read without pickles, and no array is larger than the bytes
that are stored of it.

With u (p,) the displacements of the sites and η (N,) the amplitudes of the constraint modes of unit
mass (Craig and Bampton, AIAA J. 6 (1968) 1313), the matrices of a reduced model are

    K = diag(k0, ω_i²),    M = [[m_st, P], [Pᵀ, 1]],    P_i Pᵀ_i = m_i,

so that eliminating η gives Z(ω). One site has P_i = √m_i.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import scipy.io
from numpy.typing import ArrayLike
from scipy.linalg import block_diag
from scipy.sparse import coo_matrix

from antiosc.base import archives, checks, files
from antiosc.base._types import Array, IntArray
from antiosc.base.archives import Arrays
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.texts import FieldsRepr
from antiosc.engine.damping import DampingMatrix, from_factors
from antiosc.io.matrices import component_of
from antiosc.models.body import ModelInfo
from antiosc.models.modal import Damping
from antiosc.models.motion import Inertia
from antiosc.models.parameters import Parameters
from antiosc.models.recurrence import Recurrence
from antiosc.models.stretch import Stretch

FORMAT = "antiosc-model"
#: the only version that is read
VERSION = 4

#: Most bytes of a file's arrays. Each of a million anti-oscillators takes 8 MB.
_LARGEST = 2**27
#: Deepest brackets of a header: half of what Python's parser takes.
_DEEPEST = 400

#: what JSON has by name
Named: TypeAlias = dict[str, Any]


def write(path: str | os.PathLike[str], header: Mapping[str, object], arrays: Arrays) -> None:
    """Write header and arrays, completely or not at all."""
    try:
        text = json.dumps(header)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"model.info must hold JSON values only: {error}.") from None
    if checks.nests_deeper(text, _DEEPEST):
        raise InputError(f"model.info must nest at most {_DEEPEST - 1} levels; flatten it.")
    archives.write_arrays(path, {"header": np.array(text), **arrays}, "the model")


def read(
    path: str | os.PathLike[str],
    needed: set[str],
    expected: str = FORMAT,
    largest: int = _LARGEST,
) -> tuple[Named, Arrays]:
    """(header, arrays) of a file of format `expected` with the arrays `needed`.

    InputError for another file, or one with more than `largest` bytes of arrays.
    """
    source = checks.path("path", path)
    files.check_readable(source, "a model")
    file_text = f"an {expected} file"
    arrays = archives.read_arrays(source, largest, file_text)
    try:
        text = str(arrays.pop("header"))
        if checks.nests_deeper(text, _DEEPEST):
            raise InputError(f"{path} is not {file_text}, or it is damaged.")
        header = json.loads(text)
        found = header["format"], header["version"]
    except (KeyError, TypeError, ValueError, RecursionError):
        raise InputError(f"{path} is not {file_text}, or it is damaged.") from None
    if found != (expected, VERSION):
        raise InputError(
            f"{path} has the format {checks.shown(found[0])} of version {checks.shown(found[1])}; "
            f"{expected!r} of version {VERSION} is read: write it again."
        )
    missing_names = needed - arrays.keys()
    if missing_names:
        raise InputError(f"{path} lacks {', '.join(sorted(missing_names))}; write it again.")
    return header, arrays


#: Arrays of a model, those of its inertia and of its second-order forces.
_ARRAYS = (
    *("m0", "k0", "m", "omega", "P", "participation", "direction", "dependence", "rigid"),
    *("strain_error", "strain_misfit"),
)
_PARTS = {
    "inertia": ("point", "matrix", "momentum"),
    "stretch": ("modes", "quadratic", "cubic"),
    "recurrence": ("k0", "mass", "start", "H", "scalars"),
}


def save(model: Parameters, path: str | os.PathLike[str]) -> None:
    """Write a model, completely or not at all; see `AntiOscillators.save`."""
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    if model.sites:  # of which it follows
        del arrays["m"]
    for part, names in _PARTS.items():
        arrays |= {f"{part}.{name}": getattr(getattr(model, part), name, None) for name in names}
    local = np.asarray(model.local_compliance).tolist()
    header = {
        "format": FORMAT,
        "version": VERSION,
        "local_compliance": local,
        "radius": model.radius,
        "stretch": None if model.stretch is None else model.stretch.count,
        "damping": None if model.damping is None else model.damping.as_dict(),
        "info": model.info.as_dict(),
        "sites": list(model.sites),
        "columns": {name: list(columns) for name, columns in model.columns.items()},
    }
    known = {name: np.asarray(values) for name, values in arrays.items() if values is not None}
    write(path, header, known)


def arguments(path: str | os.PathLike[str]) -> Named:
    """The arguments of `AntiOscillators` in a model file; InputError for other files."""
    header, arrays = read(path, {"m0", "k0", "omega"})
    try:
        inertia, stretch, recurrence = (_part(arrays, part) for part in _PARTS)
        return {
            **{name: arrays.get(name) for name in _ARRAYS},
            "inertia": Inertia(*inertia) if inertia else None,
            "stretch": Stretch(*[*stretch, header["stretch"]]) if stretch else None,
            "recurrence": _recurrence(*recurrence) if recurrence else None,
            "damping": _damping(header["damping"]),
            "info": ModelInfo.of(header["info"]),
            "sites": tuple(header["sites"]),
            "columns": dict(header["columns"]),
            "local_compliance": header["local_compliance"],
            "radius": header["radius"],
        }
    except (InputError, KeyError, TypeError, ValueError) as error:
        raise damaged_file(path, error) from error


def _recurrence(k0: Array, mass: Array, start: Array, H: Array, scalars: Array) -> Recurrence:
    """The recurrence of a model file."""
    n, shift = checks.floats("scalars", scalars, (2,)).tolist()
    return Recurrence(k0, mass, start, H, int(n), shift)


def _part(arrays: Arrays, part: str) -> list[Any]:
    """The arrays of the inertia or of the second-order forces; none if the file has none."""
    names = (f"{part}.{name}" for name in _PARTS[part])
    return [arrays[name] for name in names if name in arrays]


def damaged_file(path: str | os.PathLike[str], error: Exception) -> InputError:
    """The error for a file whose values are inconsistent."""
    return InputError(
        f"{path} contains no valid model; its numbers are damaged or edited: "
        f"{str(error).rstrip('.')}."
    )


def _damping(values: Named | None) -> Damping | DampingMatrix | None:
    """The damping of a model file."""
    if values is None:
        return None
    if "factor" not in values:
        with without_warnings():  # a file has what was told before
            return Damping(**values)
    size = int(values["n"])

    def factor(rows: ArrayLike) -> Array:
        return checks.floats("factor", np.reshape(rows, (-1, size)), (None, size))

    branches = [(factor(L), checks.positive("tau", tau, "s")) for L, tau in values["branches"]]
    return from_factors(factor(values["factor"]), branches)


@dataclass(frozen=True, eq=False)
class ReducedMatrices(FieldsRepr):
    """K and M of a reduced model.

    Attributes
    ----------
    K, M : (n, n) N/m and kg, the dofs of the sites first, then one for each anti-oscillator.
    labels : (n, 2) node and dof (1 to 6; 0 for scalar points) of each row.
    """

    K: Array
    M: Array
    labels: IntArray

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write K and M as Matrix Market, two files `<name>_K.mtx` and `<name>_M.mtx`.

        `path`: `<name>.mtx`. Beside them `<name>.map` lists node and dof of each row, which
        `Structure.from_files(K, M, map=…)` reads. The files written are returned, each complete
        or absent; InputError for another ending, or a file that cannot be written.
        """
        target = checks.path("path", path)
        if target.suffix.lower() != ".mtx":
            raise InputError(f"matrices are written to .mtx; got {target.name!r}.")

        written = []
        for letter, matrix in (("K", self.K), ("M", self.M)):
            file = target.with_name(f"{target.stem}_{letter}.mtx")
            with files.atomic_file(file, "the matrices") as part, part.open("wb") as stream:
                scipy.io.mmwrite(stream, coo_matrix(matrix), precision=17, symmetry="symmetric")
            written.append(file)

        rows = "".join(f"{node} {component}\n" for node, component in self.labels)
        files.write_text(target.with_suffix(".map"), "# node dof\n" + rows, "the map")
        return [*written, target.with_suffix(".map")]


def reduced_matrices(
    stiffness: Array,
    static_mass: Array,
    P: Array,
    omega: Array,
    nodes: int | Sequence[int] | None = None,
    dofs: int | str | Sequence[int | str] = 0,
) -> ReducedMatrices:
    """The matrices of k0, m_st (p, p), P (p, N) and omega (N,), as `to_matrices` gives them."""
    K = block_diag(stiffness, np.diag(omega**2))
    M = np.block([[static_mass, P], [P.T, np.eye(len(omega))]])
    sites = len(stiffness)

    # the sites
    of_sites = _as_list(range(1, sites + 1) if nodes is None else nodes)
    numbers = [checks.whole("nodes", node, least=1) for node in of_sites]
    components = [component_of(dof) for dof in _as_list(dofs)]
    components = components * sites if len(components) == 1 else components
    if len(numbers) != sites or len(components) != sites:
        raise InputError(
            f"nodes and dofs must name the {sites} site dofs; got {len(numbers)} nodes and "
            f"{len(components)} dofs."
        )

    # scalar points after the last of them
    last = max(numbers)
    if last + len(omega) >= 2**31:
        raise InputError(f"numbers of nodes must be below 2^31; got {last}.")
    scalars = [(last + k, 0) for k in range(1, len(omega) + 1)]
    labels = np.array([*zip(numbers, components, strict=True), *scalars], dtype=np.int64)
    if len(np.unique(labels, axis=0)) < len(K):
        raise InputError("nodes and dofs name one dof twice.")
    return ReducedMatrices(K, M, labels)


def _as_list(value: object) -> list[object]:
    """A list, tuple or range as a list; any other value as its only element."""
    if isinstance(value, list | tuple | range):
        return list(value)
    return [value]
