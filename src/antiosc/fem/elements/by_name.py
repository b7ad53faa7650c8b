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

#: Constants that a material takes from its record, by the same names.
CONSTANTS = (
    *("name", "source", "E", "nu", "rho"),
    *("yield_strength", "yield_range", "rate", "brittle", "tensile"),
)


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
    """A material from the table of sourced values (`antiosc materials`); arguments replace values.

    Parameters
    ----------
    name : str
        A name of the list `antiosc materials`, or a text that only one of them contains: "6061".
    E, nu, rho, yield_strength, yield_range : optional
        Values instead of the table's: Pa, 1, kg/m³, Pa, (Pa, Pa). A yield strength without a range
        is taken as exact, and its material as one that yields (not `brittle`).
    loss : float or bool
        Loss factor, which damps the modes of the part; True: the table's value. Default: none.
    thickness : float, optional
        Thickness of a sheet [m]; a Shell is returned.
    section : Section, optional
        Cross-section of a bar; a Beam is returned.
    orientation : sequence of 3 floats or function, optional
        Orientation of the section of the bar, as for `Beam`.

    Returns
    -------
    Solid, Shell or Beam
        The material with its `source`; for wood an AnisotropicSolid with the axes along the grain,
        radial and tangential.

    Raises
    ------
    InputError
        An unknown name (the message lists all names); a sheet that is also a bar; an orientation
        without a section; of wood: a value, a thickness or a section.
    """
    record = materials.record(name)
    constants_given = {
        "E": E,
        "nu": nu,
        "rho": rho,
        "yield_strength": yield_strength,
        "yield_range": yield_range,
        "loss": loss if loss is not False else None,
    }
    if loss is True:
        constants_given["loss"] = record.loss

    overrides = {key: value for key, value in constants_given.items() if value is not None}
    if record.G is not None:
        if overrides or thickness is not None or section is not None:
            raise InputError(f"{record.name} has directions: AnisotropicSolid or Layer take it.")
        return AnisotropicSolid.orthotropic(record.E, record.nu, record.G, record.rho)

    constants: dict[str, Any] = {key: getattr(record, key) for key in CONSTANTS}
    if "yield_strength" in overrides:
        constants |= {"yield_range": None, "brittle": False, "tensile": None}
        constants["rate"] = record.rate and record.rate[:2]  # in proportion to this strength

    constants |= overrides
    if orientation is not None and section is None:
        raise InputError("orientation is of the section of a bar: give a section too.")
    if thickness is not None and section is not None:
        raise InputError("a part is a sheet or a bar: give thickness or section, not both.")
    if thickness is not None:
        return Shell(**constants, thickness=thickness)
    if section is None:
        return Solid(**constants)

    return Beam(**constants, section=section, orientation=orientation)
