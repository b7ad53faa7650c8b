"""Models as files: NumPy's `.npz` with a header in JSON, and reduced matrices for other programs.

A model file is untrusted data: it is read without pickles, and no array is larger than the bytes
that are stored of it.

Matrices of a reduced model, in the form in which another program takes it as a superelement.

With u (p,) the displacements of the sites and η (N,) the amplitudes of the constraint modes of unit
mass (Craig and Bampton, AIAA J. 6 (1968) 1313)

    K = diag(k0, ω_i²),    M = [[m_st, P], [Pᵀ, 1]],    P_i Pᵀ_i = m_i,

so that eliminating η gives Z(ω). One site has P_i = √m_i.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from operator import attrgetter
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from antiosc.base import archives, checks, files
from antiosc.base._types import Array, IntArray
from antiosc.base.archives import Arrays
from antiosc.base.errors import InputError, without_warnings
from antiosc.base.texts import FieldsRepr
from antiosc.engine.damping import DampingMatrix, from_factors
from antiosc.io.dof_map import component_of
from antiosc.io.matrices import write_matrix_market
from antiosc.models.body import ModelInfo
from antiosc.models.modal import Damping
from antiosc.models.motion import Inertia
from antiosc.models.parameters import Parameters
from antiosc.models.stretch import Count, Stretch

FORMAT = "antiosc-model"
#: the newest version that is read
VERSION = 3

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
    _check_regular(source)
    file_text = f"an {expected} file"
    arrays = archives.read_arrays(source, largest, file_text)
    try:
        text = str(arrays.pop("header"))
        if checks.nests_deeper(text, _DEEPEST):
            raise InputError(f"{path} is not {file_text}, or it is damaged.")
        header = json.loads(text)
        version = header["version"] if header.get("format") == expected else VERSION
        newer = bool(version > VERSION)
    except (KeyError, TypeError, ValueError, RecursionError, AttributeError):
        raise InputError(f"{path} is not {file_text}, or it is damaged.") from None
    if header.get("format") != expected:
        raise InputError(
            f"{path} has format {checks.shown(header.get('format'))}, expected {expected!r}."
        )
    if newer:
        raise InputError(f"{path} has version {version}; this antiosc reads up to {VERSION}.")
    missing_names = needed - arrays.keys()
    if missing_names:
        raise InputError(f"{path} lacks {', '.join(sorted(missing_names))}; write it again.")
    return header, arrays


def _check_regular(path: Path) -> None:
    """InputError unless `path` is a regular file: opening a pipe could block."""
    try:
        mode = path.stat().st_mode
    except OSError as error:
        reason = "" if isinstance(error, FileNotFoundError) else f" ({error.strerror})"
        raise InputError(f"there is no model file {path}{reason}.") from None
    if not stat.S_ISREG(mode):
        raise InputError(f"there is no model file {path}: it is a folder or a device.")


_HERTZ = "Hz"
#: Arrays of a file -> their unit and meaning.
_ARRAYS = {
    "m0": ("kg", "residual mass, Article eq. (15)"),
    "k0": ("N/m", "static stiffness at the site, Article eq. (20); 0 with a rigid-body mode"),
    "m": ("kg", "masses of the anti-oscillators, Article eq. (12)"),
    "omega": ("rad/s", "antiresonant circular frequencies, ascending"),
    "participation": (
        "kg", "generalised mass of a unit uniform acceleration along the impact direction"),
    "direction": ("1", "unit vector of the impact in the axes of the mesh"),
    "P": (
        "kg^1/2", "inertias of the constraint modes of unit mass at several sites; m_i = P_i P_i'"),
    "dependence": ("1", "displacements of all columns per unit ones of the independent columns"),
    "rigid": ("kg^-1/2", "displacements of several sites in the rigid-body modes of unit mass"),
    "slide": ("kg^-1/2", "the same in the hidden rigid-body motions"),
    "strain_error": (
        "N/m", "energies of the errors of the strains of phi_st and psi_i: the mesh's error"),
    "strain_misfit": (
        "N/m", "work of section forces on what interpolation changes in the strains"),
}  # fmt: skip
_INERTIA = {
    "inertia.point": ("m", "reference point of all moments"),
    "inertia.matrix": (
        "kg, kg m, kg m^2", "momentum and angular momentum of the whole body's six rigid motions"),
    "inertia.momentum": (
        "kg, kg m", "those of phi_st, psi_i and the hidden rigid-body motions"),
}  # fmt: skip
#: What stands in the header, likewise.
_SCALARS = {
    "local_compliance": ("m/N", "half-space compliance of the patch, contained in 1/k0"),
    "radius": ("m", "radius of the patch over which the site's displacement is averaged"),
}
_EVERY = {**_ARRAYS, **_INERTIA, **_SCALARS}
_STRETCH = {
    "modes": ("1", "motions that stretch the part, of the free modes of unit mass"),
    "quadratic": ("SI", "second-order forces f_k = H_kij a_i a_j of modes of unit mass"),
    "cubic": ("SI", "third-order forces f_k = G_kijl a_i a_j a_l of modes of unit mass"),
}
#: version of the files of models of several sites, and of those that stretch; those of one site are
#: of version 1
_SEVERAL = 2
_STRETCHES = 3


def save(model: Parameters, path: str | os.PathLike[str]) -> None:
    """Write a model, completely or not at all; see `AntiOscillators.save`."""
    has_sites = len(model.sites) > 0
    arrays = {
        name: np.asarray(getattr(model, name))
        for name in _ARRAYS
        if getattr(model, name) is not None and not (has_sites and name == "m")
    }
    if model.inertia is not None:
        arrays |= {name: attrgetter(name)(model) for name in _INERTIA}
    if model.stretch is not None:
        arrays |= {f"stretch.{name}": getattr(model.stretch, name) for name in _STRETCH}
    stretch = None if model.stretch is None else model.stretch.count
    header = {
        "format": FORMAT,
        "version": _STRETCHES if model.stretch is not None else _SEVERAL if has_sites else 1,
        **({} if stretch is None else {"stretch": stretch}),
        "units": {name: unit for name, (unit, _) in _EVERY.items()},
        "meaning": {name: meaning for name, (_, meaning) in _EVERY.items()},
        **{name: _plain(getattr(model, name)) for name in _SCALARS},
        "damping": None if model.damping is None else model.damping.as_dict(),
        "info": model.info.as_dict(),
        "band_unit": _HERTZ,
    }
    if has_sites:
        header["sites"] = list(model.sites)
        header["columns"] = {name: list(columns) for name, columns in model.columns.items()}
    write(path, header, arrays)


def _info(header: Named) -> ModelInfo:
    """The data of a file's model; its band is in rad/s unless the header says Hz."""
    facts = header.get("info", {})
    band = facts.get("band") if isinstance(facts, Mapping) else None
    if isinstance(band, Mapping) and header.get("band_unit") != _HERTZ:
        ends = {name: band[name] / (2 * pi) for name in ("bottom", "top") if name in band}
        facts = {**facts, "band": {**band, **ends}}
    return ModelInfo.of(facts)


def arguments(path: str | os.PathLike[str]) -> Named:
    """The arguments of `AntiOscillators` in a model file; InputError for other files."""
    header, arrays = read(path, {"m0", "k0", "omega"})
    try:
        damping = header.get("damping")
        return {
            "m": None,
            **{name: arrays[name] for name in _ARRAYS if name in arrays},
            "inertia": _inertia(arrays),
            "stretch": _stretch(arrays, header.get("stretch")),
            "damping": _damping(damping),
            "info": _info(header),
            "sites": tuple(header.get("sites", ())),
            "columns": dict(header.get("columns", {})),
            **{name: header[name] for name in _SCALARS},
        }
    except (InputError, KeyError, TypeError, ValueError) as error:
        raise damaged_file(path, error) from error


def _stretch(arrays: Arrays, count: Count | None) -> Stretch | None:
    """The second-order forces in a model file; None if it has none."""
    if count is None:
        return None
    modes, quadratic, cubic = (arrays[f"stretch.{name}"] for name in _STRETCH)
    return Stretch(modes, quadratic, cubic, count)


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


def _plain(value: object) -> object:
    """A value, or one for each of several sites, as JSON."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value


def _inertia(arrays: Arrays) -> Inertia | None:
    """The inertia in a model file; None if it has none."""
    if arrays.keys() >= _INERTIA.keys():
        return Inertia(*map(arrays.__getitem__, _INERTIA))
    return None


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

    def __post_init__(self) -> None:
        size = len(checks.floats("K", self.K, (None, None)))
        labels = checks.floats("labels", self.labels, (size, 2))
        if (labels != np.floor(labels)).any() or (labels < 0).any() or (labels >= 2**31).any():
            raise InputError("labels must be numbers of nodes and of their dofs.")
        for name in ("K", "M"):
            matrix = checks.floats(name, getattr(self, name), (size, size))
            if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0):
                raise InputError(f"{name} must be symmetric.")
            checks.store(self, **{name: checks.read_only(matrix)})
        checks.store(self, labels=checks.read_only(labels.astype(np.int64)))

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write K and M as Matrix Market, two files `<name>_K.mtx` and `<name>_M.mtx`.

        `path`: `<name>.mtx`. Beside them `<name>.map` lists node and dof of each row, which
        `Structure.from_files(K, M, map=…)` reads.

        Returns
        -------
        list of Path
            The files written, each complete or absent.

        Raises
        ------
        InputError
            Another ending, or a file that cannot be written.
        """
        target = checks.path("path", path)
        if target.suffix.lower() != ".mtx":
            raise InputError(f"matrices are written to .mtx; got {target.name!r}.")

        written = []
        for letter, matrix in (("K", self.K), ("M", self.M)):
            file = target.with_name(f"{target.stem}_{letter}.mtx")
            with files.atomic_file(file, "the matrices") as part, part.open("w") as file_stream:
                write_matrix_market(file_stream, matrix)
            written.append(file)
        return [*written, self._map(target)]

    def _map(self, target: Path) -> Path:
        path = target.with_suffix(".map")
        rows = "".join(f"{node} {component}\n" for node, component in self.labels)
        files.write_text(path, "# node dof\n" + rows, "the map")
        return path


def reduced_matrices(
    stiffness: Array,
    static_mass: Array,
    P: Array,
    omega: Array,
    slide: Array | None,
    nodes: int | Sequence[int] | None,
    dofs: int | str | Sequence[int | str],
    first: int | None,
) -> ReducedMatrices:
    """The matrices of k0, m_st (p, p), P (p, N) and omega (N,).

    slide : (p, s) rigid motions q of unit mass that hardly move the sites: u = u_e + slide q.
    The others: see `AntiOscillators.to_matrices`.
    """
    count = len(stiffness)
    K = block_diag(stiffness, np.diag(omega**2))
    M = np.block([[static_mass, P], [P.T, np.eye(len(omega))]])
    if slide is not None and slide.size:
        rigid = slide.shape[1]
        K = block_diag(K, np.zeros((rigid, rigid)))
        M = block_diag(M, np.eye(rigid))
        T = np.eye(len(K))
        T[:count, -rigid:] = -slide
        K = T.T @ K @ T
        M = T.T @ M @ T
    return ReducedMatrices(K, M, _labels(count, len(K), nodes, dofs, first))


def _labels(
    sites: int,
    size: int,
    nodes: int | Sequence[int] | None,
    dofs: int | str | Sequence[int | str],
    first: int | None,
) -> IntArray:
    of_sites = list(range(1, sites + 1)) if nodes is None else _as_list(nodes)
    numbers = [checks.whole("nodes", node, least=1) for node in of_sites]
    of_columns = _as_list(dofs)
    of_columns = of_columns * sites if len(of_columns) == 1 else of_columns
    if len(numbers) != sites or len(of_columns) != sites:
        raise InputError(
            f"nodes and dofs must name the {sites} site dofs; got {len(numbers)} nodes and "
            f"{len(of_columns)} dofs."
        )
    start = max(numbers) + 1 if first is None else checks.whole("first", first, least=1)
    scalars = range(start, start + size - sites)
    if scalars.stop > 2**31:
        raise InputError(f"numbers of nodes must be below 2^31; got {max(numbers)} and {start}.")
    if set(scalars) & set(numbers):
        raise InputError(f"the scalar points from first = {start} on meet the nodes of the sites.")
    rows = [(n, component_of(d)) for n, d in zip(numbers, of_columns, strict=True)]
    labels = np.array([*rows, *((number, 0) for number in scalars)], dtype=np.int64)
    if len(np.unique(labels, axis=0)) < size:
        raise InputError("nodes and dofs name one dof twice.")
    return labels.reshape(-1, 2)


def _as_list(value: object) -> list[object]:
    """A list, tuple or range as a list; any other value as its only element."""
    if isinstance(value, list | tuple | range):
        return list(value)
    return [value]
