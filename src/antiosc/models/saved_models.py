"""What of a model of anti-oscillators is written to its file (`model_file`), and read again."""

from __future__ import annotations

import os
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, without_warnings
from antiosc.models import model_file
from antiosc.models.damping_matrix import DampingMatrix, of_factors
from antiosc.models.modal import Damping
from antiosc.models.model_info import ModelInfo
from antiosc.models.motion import Inertia
from antiosc.models.parameters import Parameters

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
#: version of the files of models of several sites; those of one site are of version 1
_SEVERAL = 2


def save(model: Parameters, path: str | os.PathLike[str]) -> None:
    """Write a model, completely or not at all; see `AntiOscillators.save`."""
    several = len(model.sites) > 0
    arrays = {
        name: np.asarray(getattr(model, name))
        for name in _ARRAYS
        if getattr(model, name) is not None and not (several and name == "m")
    }
    if model.inertia is not None:
        arrays |= {name: attrgetter(name)(model) for name in _INERTIA}
    header = {
        "format": model_file.FORMAT,
        "version": _SEVERAL if several else 1,
        "units": {name: unit for name, (unit, _) in _EVERY.items()},
        "meaning": {name: meaning for name, (_, meaning) in _EVERY.items()},
        **{name: _plain(getattr(model, name)) for name in _SCALARS},
        "damping": None if model.damping is None else model.damping.as_dict(),
        "info": model.info.as_dict(),
    }
    if several:
        header["sites"] = list(model.sites)
        header["columns"] = {name: list(own) for name, own in model.columns.items()}
    model_file.write(path, header, arrays)


def arguments(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The arguments of the `AntiOscillators` in a model file; InputError when it is not one."""
    header, arrays = model_file.read(path, {"m0", "k0", "omega"})
    try:
        damping = header.get("damping")
        return {
            "m": None,
            **{name: arrays[name] for name in _ARRAYS if name in arrays},
            "inertia": _inertia(arrays),
            "damping": _damping(damping),
            "info": ModelInfo.of(header.get("info", {})),
            "sites": tuple(header.get("sites", ())),
            "columns": dict(header.get("columns", {})),
            **{name: header[name] for name in _SCALARS},
        }
    except (InputError, KeyError, TypeError, ValueError) as error:
        raise damaged(path, error) from error


def damaged(path: str | os.PathLike[str], error: Exception) -> InputError:
    """The error for a file whose numbers are no model."""
    return InputError(
        f"{path} contains no valid model; its numbers are damaged or edited: "
        f"{str(error).rstrip('.')}."
    )


def _damping(given: dict[str, Any] | None) -> Damping | DampingMatrix | None:
    """The damping of a model file."""
    if given is None:
        return None
    if "factor" not in given:
        with without_warnings():  # a file has what was told before
            return Damping(**given)
    size = int(given["n"])

    def factor(rows: ArrayLike) -> Array:
        return checks.array("factor", np.reshape(rows, (-1, size)), (None, size))

    branches = [(factor(L), checks.positive("tau", tau, "s")) for L, tau in given["branches"]]
    return of_factors(factor(given["factor"]), branches)


def _plain(value: object) -> object:
    """A number, or those of several sites, as JSON values."""
    return value.tolist() if isinstance(value, np.ndarray) else value


def _inertia(arrays: model_file.Arrays) -> Inertia | None:
    """The inertia in a model file, if it holds one."""
    return Inertia(*map(arrays.__getitem__, _INERTIA)) if arrays.keys() >= _INERTIA.keys() else None
