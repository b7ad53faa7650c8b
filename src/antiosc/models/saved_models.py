"""What of a model of anti-oscillators is written to its file (`model_file`), and read again."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models import model_file
from antiosc.models.damping_matrix import DampingMatrix, of_factors
from antiosc.models.modal import Damping
from antiosc.models.model_info import ModelInfo
from antiosc.models.motion import Inertia
from antiosc.models.parameters import Parameters

_ARRAYS = {
    "m0": "kg",
    "k0": "N/m",
    "m": "kg",
    "omega": "rad/s",
    "participation": "kg",
    "direction": "1",
    "P": "kg^1/2",
    "dependence": "1",
    "rigid": "kg^-1/2",
    "slide": "kg^-1/2",
    "strain_error": "N/m",
    "strain_misfit": "N/m",
}
_INERTIA = {"point": "m", "matrix": "kg, kg m, kg m^2", "momentum": "kg, kg m"}
_SCALARS = {"local_compliance": "m/N", "radius": "m"}
#: version of the files of models of several sites; those of one site are of version 1
_SEVERAL = 2
_MEANING = {
    "m0": "residual mass, Article eq. (15)",
    "k0": "static stiffness at the site, Article eq. (20); 0 with a rigid-body mode",
    "m": "masses of the anti-oscillators, Article eq. (12)",
    "omega": "antiresonant circular frequencies, ascending",
    "participation": "generalised mass of a unit uniform acceleration along the impact direction",
    "direction": "unit vector of the impact in the axes of the mesh",
    "inertia.point": "reference point of all moments",
    "inertia.matrix": "momentum and angular momentum of the whole body's six rigid motions",
    "inertia.momentum": "those of phi_st, psi_i and the hidden rigid-body motions",
    "P": "inertias of the constraint modes of unit mass at several sites; m_i = P_i P_i'",
    "dependence": "displacements of all columns per unit ones of the independent columns",
    "rigid": "displacements of several sites in the rigid-body modes of unit mass",
    "slide": "the same in the hidden rigid-body motions",
    "strain_error": "energies of the errors of the strains of phi_st and psi_i: the mesh's error",
    "strain_misfit": "work of section forces on what interpolation changes in the strains",
    "local_compliance": "half-space compliance of the patch, contained in 1/k0",
    "radius": "radius of the patch over which the site's displacement is averaged",
}


def save(model: Parameters, path: str | os.PathLike[str]) -> None:
    """Write a model, completely or not at all; see `AntiOscillators.save`."""
    several = len(model.sites) > 0
    arrays = {
        name: np.asarray(getattr(model, name))
        for name in _ARRAYS
        if getattr(model, name) is not None and not (several and name == "m")
    }
    units = {**_ARRAYS, **_SCALARS}
    if model.inertia is not None:
        for name, unit in _INERTIA.items():
            arrays[f"inertia.{name}"] = getattr(model.inertia, name)
            units[f"inertia.{name}"] = unit
    header = {
        "format": model_file.FORMAT,
        "version": _SEVERAL if several else 1,
        "units": units,
        "meaning": _MEANING,
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
        return Damping(**given)
    size = int(given["n"])

    def factor(rows: Any) -> Array:
        return checks.array("factor", np.reshape(rows, (-1, size)), (None, size))

    branches = [(factor(L), checks.positive("tau", tau, "s")) for L, tau in given["branches"]]
    return of_factors(factor(given["factor"]), branches)


def _plain(value: Any) -> Any:
    """A number, or those of several sites, as JSON values."""
    return value.tolist() if isinstance(value, np.ndarray) else value


def _inertia(arrays: dict[str, NDArray[Any]]) -> Inertia | None:
    """The inertia in a model file, if it holds one."""
    found = [arrays.get(f"inertia.{name}") for name in _INERTIA]
    if any(value is None for value in found):
        return None
    return Inertia(*found)  # type: ignore[arg-type]
