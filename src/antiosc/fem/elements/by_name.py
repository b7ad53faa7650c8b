"""`material`: a material by its name, as a solid, a sheet or a bar."""

from __future__ import annotations

from typing import Any

from antiosc.base import materials
from antiosc.base.errors import InputError
from antiosc.fem.elements import Section
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.shell import Shell
from antiosc.fem.elements.solid import AnisotropicSolid, Solid
from antiosc.fem.elements.weak_form import Direction


def material(
    name: str,
    *,
    E: float | None = None,
    nu: float | None = None,
    rho: float | None = None,
    yield_strength: float | None = None,
    yield_range: tuple[float, float] | None = None,
    loss: float | bool = False,
    thickness: float | None = None,
    section: Section | None = None,
    orientation: Direction | None = None,
) -> Solid | Shell | Beam | AnisotropicSolid:
    """A material from the table of sourced values (`antiosc materials`); any value may be
    overridden.

    Parameters
    ----------
    name : str
        As `antiosc materials` lists them, or a part of it that only one name has: "6061".
    E, nu, rho, yield_strength, yield_range : optional
        In place of the table's: Pa, 1, kg/m³, Pa, (Pa, Pa). A yield strength without a range is
        taken as exact.
    loss : float or bool
        Loss factor, which damps the modes of the part; True: the table's. Default: none.
    thickness : float, optional
        Of a sheet [m]: a Shell is returned.
    section : Section, optional
        Of a bar: a Beam is returned.
    orientation : sequence of 3 floats or function, optional
        Of the bar's section, as of `Beam`.

    Returns
    -------
    Solid, Shell or Beam
        With `source`; of wood an AnisotropicSolid, along the grain, radial, tangential.

    Raises
    ------
    InputError
        An unknown name, with the nearest ones; constants of wood.
    """
    found = materials.record(name)
    given = {
        "E": E, "nu": nu, "rho": rho, "yield_strength": yield_strength,
        "yield_range": yield_range, "loss": loss if loss is not False else None,
    }  # fmt: skip
    if loss is True:
        given["loss"] = found.loss
    changed = {key: value for key, value in given.items() if value is not None}
    if found.G is not None:
        if changed or thickness is not None or section is not None:
            raise InputError(
                f"{found.name} has directions: give its constants to AnisotropicSolid.orthotropic, "
                "or those of a ply to Layer."
            )
        return AnisotropicSolid.orthotropic(found.E, found.nu, found.G, found.rho)
    constants: dict[str, Any] = {
        "E": found.E, "nu": found.nu, "rho": found.rho, "yield_strength": found.yield_strength,
        "yield_range": found.yield_range, "rate": found.rate, "brittle": found.brittle,
        "name": found.name, "source": found.source,
    }  # fmt: skip
    if "yield_strength" in changed:
        constants |= {"yield_range": None, "brittle": False}
    constants |= changed
    if thickness is not None:
        return Shell(**constants, thickness=thickness)
    if section is None:
        return Solid(**constants)
    return Beam(**constants, section=section, orientation=orientation)
