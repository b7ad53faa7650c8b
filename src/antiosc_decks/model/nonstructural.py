"""Nonstructural mass: spread over elements, as density of their sections.

*NONSTRUCTURAL MASS of Abaqus; NSM, NSM1, NSML and NSML1 of Nastran.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from antiosc.io.deck import Array, IntArray, Place
from antiosc_decks.model.builder import Arguments, Family, ModelBuilder
from antiosc_decks.model.geometry import measures_of

#: Section -> the dimension of what it spreads its mass over: a length, an area, a volume.
DIMENSION = {"Beam": 1, "Shell": 2, "Laminate": 2, "GivenSheet": 2}
DIMENSION |= {"Solid": 3, "AnisotropicSolid": 3}
UNITS = {"MASSPERLENGTH": 1, "MASSPERAREA": 2, "MASSPERVOLUME": 3}


def add_mass(
    builder: ModelBuilder, elements: IntArray, value: float, dimension: int, place: Place
) -> None:
    """A mass per length, area or volume (1, 2, 3) of elements; 0: of what each has."""
    own, across, _ = _sections(builder, elements, place)
    if dimension in (1, 2) and (own != dimension).any():
        what = "length" if dimension == 1 else "area"
        raise place.error(f"a mass per {what} on elements that have none.")
    _spread(builder, elements, np.where((own < 3) & (dimension < 3), value / across, value))


def add_total(
    builder: ModelBuilder, elements: IntArray, value: float, place: Place, by: str
) -> None:
    """A mass spread over elements by their "measure" (length or area), "volume" or "mass"."""
    dimension, across, density = _sections(builder, elements, place)
    if by == "measure" and len(set(dimension.tolist())) > 1:
        raise place.error("one mass is spread over lines, areas or volumes alone.")
    measure = measures_of(builder.deck, elements)
    share = {"measure": 1 / across, "volume": np.ones(len(across)), "mass": density}[by]
    total = float((share * across * measure).sum())
    place.needs(total > 0, f"the elements of the nonstructural mass have no {by}.")
    _spread(builder, elements, value / total * share)


def _sections(
    builder: ModelBuilder, elements: IntArray, place: Place
) -> tuple[IntArray, Array, Array]:
    """(dimension, thickness or area across it, density) of elements, in the deck's units."""
    place.needs(len(elements), "the nonstructural mass is on no element with a section.")
    found = [_section(builder, int(element), place) for element in elements]
    dimension, across, density = (np.array(column) for column in zip(*found, strict=True))
    return dimension, across, density


def _section(builder: ModelBuilder, element: int, place: Place) -> tuple[int, float, float]:
    if element in builder.rods:
        rod = builder.rods[element]
        return 1 if rod.effective is None else 2, rod.across, rod.mass / rod.across
    number = builder.of_element[element]
    place.needs(number >= 0, "the nonstructural mass is on an element without a section.")
    family = builder.families[number]
    units, a = builder.units, family.arguments
    across = 1.0
    density = a.get("rho", 0.0)
    if family.kind == "Beam":
        across = a["section"]["A"] / units.length**2
    elif family.kind == "Laminate":
        thick = [layer["thickness"] for layer in a["layers"]]
        across = sum(thick) / units.length
        density = sum(t * layer["rho"] for t, layer in zip(thick, a["layers"], strict=True))
        density /= sum(thick)
    elif "thickness" in a:
        across = a["thickness"] / units.length
        density = a.get("rho", a.get("mass", 0.0) / a["thickness"])
    return DIMENSION[family.kind], across, density / units.density


def _spread(builder: ModelBuilder, elements: IntArray, density: Array) -> None:
    rods = np.array([int(element) in builder.rods for element in elements])
    for element, more in zip(elements[rods].tolist(), density[rods].tolist(), strict=True):
        rod = builder.rods[element]
        builder.rods[element] = replace(rod, mass=rod.mass + more * rod.across)
    numbers = builder.of_element[elements]
    for number in np.unique(numbers[~rods]):
        family, name = builder.families[number], builder.names[number]
        mine = (numbers == number) & ~rods
        for value in np.unique(density[mine]):
            more = float(value) * builder.units.density
            own = Family(family.kind, _heavier(family.arguments, more), family.place)
            builder.add(name, elements[mine & (density == value)], own)


def _heavier(arguments: Arguments, density: float) -> Arguments:
    """Arguments of a section with more density, kg/m³."""
    own = dict(arguments)
    if "layers" in own:
        own["layers"] = [{**layer, "rho": layer["rho"] + density} for layer in own["layers"]]
    elif "rho" in own:
        own["rho"] += density
    else:  # stiffnesses and masses of a sheet
        share = own["inertia"] / own["mass"]
        own["mass"] += density * own["thickness"]
        own["inertia"] = share * own["mass"]
    return own
