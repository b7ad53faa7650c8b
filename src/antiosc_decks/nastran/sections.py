"""Properties of Nastran decks: solids, rods and beams; shells are in `shells`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import IntArray
from antiosc_decks.model.builder import Family, Rod
from antiosc_decks.model.geometry import tangents_of
from antiosc_decks.model.panels import Panel
from antiosc_decks.nastran.beams import PLAIN, offset_along, orientation
from antiosc_decks.nastran.cards import Entry
from antiosc_decks.nastran.materials import PropertyReader
from antiosc_decks.nastran.mesh import defined_once, property_of
from antiosc_decks.nastran.parts import SCOPE, label
from antiosc_decks.nastran.profiles import BeamProfiles
from antiosc_decks.nastran.shells import Shells
from antiosc_decks.nastran.table import CELLS, PROPERTIES

#: Largest ν of a beam; a smaller G than it gives is in the section.
NU_OF_BEAMS = 0.49
#: Beginnings of properties of springs, dampers and masses, and of loads, which share numbers.
NO_SECTIONS = ("PLOAD", "PELAS", "PDAMP", "PVISC", "PBUSH", "PMASS")


@dataclass
class Properties(PropertyReader):
    """Adds the properties of a deck to its builder."""

    def __post_init__(self) -> None:
        self.roles = [CELLS[block.type].role for block in self.found.deck.blocks]
        numbers = [property_of(entry) for entry in self.found.elements]
        self._numbers = np.array(numbers, dtype=np.int64)

    def read(self) -> None:
        """Set the section of every element."""
        known = defined_once(self.found.named(*PROPERTIES), "property")
        for number in np.unique(self._numbers):
            elements = np.flatnonzero(self._numbers == number)
            first = self.found.elements[elements[0]]
            if number == 0 and first.name == "CONROD":
                for element in elements:
                    self._rods(self.found.elements[element], np.array([element]), 3)
                continue
            entry, name = known.get(int(number)), label(int(number))
            if entry is None:
                raise MeshError(self._unknown(first, int(number) % SCOPE))
            names = sorted({self.found.elements[k].name for k in elements})
            for wrong in (one for one in names if entry.name not in CELLS[one].properties):
                raise entry.place.error(f"{entry.name} is not a property of {wrong}.")
            match entry.name:
                case "PSOLID":
                    self._solid(entry, name, elements)
                case "PCOMPS":
                    self._layered(entry, name, elements)
                case "PSHELL":
                    Shells(self).shell(entry, name, elements)
                case "PCOMP" | "PCOMPG":
                    Shells(self).laminate(entry, name, elements)
                case "PROD" | "PTUBE":
                    self._rods(entry, elements, 1)
                case "PSHEAR":
                    self._panels(entry, elements)
                case _:
                    self._beams(entry, name, elements)

    def _unknown(self, element: Entry, number: int) -> str:
        """Sentence on an element without a property that is read."""
        label = f"{element.place}: {element.name} {element.whole(0)} has the property {number}, "
        others = (
            entry.name
            for entry in self.found.bulk.entries
            if entry.name.startswith("P") and entry.text(0) == str(number)
        )
        kind = next((name for name in others if name not in ("PARAM", "PLOTEL")), None)
        if kind and kind not in PROPERTIES and not kind.startswith(NO_SECTIONS):
            instead = " or ".join(CELLS[element.name].properties)
            return f"{label}a {kind}, which is not supported; give it as {instead}."
        return f"{label}which is none of {', '.join(PROPERTIES)} in the deck."

    def _solid(self, entry: Entry, name: str, elements: IntArray) -> None:
        if entry.text(6) not in ("", "SMECH"):
            raise entry.place.error(f"PSOLID with FCTN={entry.text(6)} is not a solid.")
        material = self.material(entry, 1)
        number = entry.text(2)
        stiffness = self.builder.anisotropic(material)
        if stiffness is not None:
            arguments: dict[str, Any] = {"stiffness": stiffness}
            arguments["rho"] = self.builder.rho(material)
            if not number or number == "-1":
                raise entry.place.error(
                    f"PSOLID with {material.name} has its directions in each "
                    "element's own system (CORDM); give CORDM = 0 or a rectangular system."
                )
            arguments["axes"] = self.found.axes(entry, entry.whole(2))[:2].tolist()
            self.builder.add(name, elements, Family("AnisotropicSolid", arguments, entry.place))
            return
        E, nu = self.builder.elastic(material, "solids")
        arguments = {"E": E, "nu": nu, "rho": self.builder.rho(material)}
        self.builder.add(name, elements, Family("Solid", arguments, entry.place))

    def _layered(self, entry: Entry, name: str, elements: IntArray) -> None:
        """PCOMPS: layers of one isotropic material are a solid of it."""
        numbers = {entry.text(k) for k in range(9, len(entry.fields), 8)} - {""}
        if len(numbers) != 1 or self.material(plain := Entry(
                "PCOMPS", entry.place, [name, *numbers]), 1).isotropic is None:  # fmt: skip
            raise entry.place.error("PCOMPS is read with layers of one isotropic material alone.")
        self._solid(plain, name, elements)

    def _rods(self, entry: Entry, elements: IntArray, k: int) -> None:
        """PROD, PTUBE or CONROD, with the material in field k (from 0)."""
        if entry.name == "PTUBE":
            outer, t = entry.real(2, None), entry.real(3)
            if entry.real(5, outer) != outer:
                raise entry.place.error("tapered tubes (PTUBE with OD2) are not supported.")
            inner = outer - 2 * t if t else 0.0
            area = math.pi * (outer**2 - inner**2) / 4
            torsion, extra = math.pi * (outer**4 - inner**4) / 32, entry.real(4)
        else:
            area, torsion, extra = entry.real(k + 1), entry.real(k + 2), entry.real(k + 4)
        if area <= 0:
            raise entry.place.error(f"{entry.name} needs an area above 0.")
        units = self.builder.units
        material = self.material(entry, k)
        E, nu = (value / u for value, u in zip(self.builder.elastic(material, "rods"),
                 (units.stress, 1.0), strict=True))  # fmt: skip
        density = self.builder.rho(material) / units.density
        per_length = density * area + extra * self.mass_factor
        self.builder.add_rods(elements, Rod(E, nu, area, torsion, per_length, entry.place))

    def _panels(self, entry: Entry, elements: IntArray) -> None:
        """PSHEAR."""
        units = self.builder.units
        material = self.material(entry, 1)
        E, nu = self.builder.elastic(material, "shear panels")
        E /= units.stress
        thickness = entry.real(2, None)
        if thickness <= 0:
            raise entry.place.error("PSHEAR needs a thickness above 0.")
        mass = self.builder.rho(material) / units.density * thickness
        mass += entry.real(3) * self.mass_factor
        effective = (entry.real(4), entry.real(5))
        panel = Panel(E / (2 + 2 * nu), nu, thickness, mass, E, effective, entry.place)
        self.builder.add_rods(elements, panel)

    # --- Beams ------------------------------------------------------------------------------------

    def _beams(self, entry: Entry, name: str, elements: IntArray) -> None:
        """Add the elements of one property, grouped by place, orientation and offset."""
        along = BeamProfiles(entry)
        self.ignored += along.told
        material = self.material(entry, 1)
        E, nu = self.builder.elastic(material, "beams")
        # a G up to E/3 goes into the section: nu lies below 0.5
        share = 1.0 if nu < NU_OF_BEAMS else (1 + NU_OF_BEAMS) / (1 + nu)
        nu = min(nu, NU_OF_BEAMS)
        units = self.builder.units
        density = self.builder.rho(material)
        length = units.length
        tangents = tangents_of(self.found.deck, elements)
        apart: dict[tuple[float, ...], list[int]] = {}
        beams = self.found.beams
        for element, tangent in zip(elements, tangents, strict=True):
            beam = beams.get(int(element), PLAIN)
            own = self.found.elements[element]
            height = orientation(self.found, own, tangent) if beam.height is None else beam.height
            offset = 0.0 if beam.moved else offset_along(self.found, own, height)
            key = (*np.round(height, 9).tolist(), round(offset, 12), beam.middle)
            apart.setdefault(key, []).append(int(element))
        for key, some in apart.items():
            one = along.at(key[4])
            self.tell_beside(entry, one.extra)
            profile = one.profile
            height = np.array(key[:3])
            if one.angle:
                if key[3]:
                    raise entry.place.error(
                        f"{entry.name} with I12 and with offsets of its elements is "
                        "not supported; rotate the section to its principal axes."
                    )
                side = np.cross(tangents_of(self.found.deck, np.array(some[:1]))[0], height)
                height = math.cos(one.angle) * height + math.sin(one.angle) * side
            profile = replace(profile, J=profile.J * share, shear=profile.shear * share)
            arguments: dict[str, Any] = {
                "E": E,
                "nu": nu,
                "rho": density + self.beside(one.extra, profile.A),
                "section": profile.section(length),
                "orientation": height.tolist(),
                "offset": key[3] * length,
                "shear": one.sheared,
            }
            label = name if len(apart) == 1 else f"{name} along {key[:3]}"
            self.builder.add(label, np.array(some), Family("Beam", arguments, entry.place))
