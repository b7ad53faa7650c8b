"""Materials and properties of Nastran decks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antiosc.errors import MeshError
from antiosc.fem.readers.decks.deck import Array, IntArray
from antiosc.fem.readers.decks.geometry import common_direction, normals_of, tangents_of
from antiosc.fem.readers.decks.model import Family, Material, ModelBuilder, isotropic
from antiosc.fem.readers.decks.nastran import BEAMS, SHELLS, SOLIDS, NastranDeck, property_of
from antiosc.fem.readers.decks.nastran_beams import PLAIN, offset_along, orientation
from antiosc.fem.readers.decks.nastran_cards import Entry
from antiosc.fem.readers.decks.nastran_profiles import BeamProfiles

PROPERTIES = ("PSOLID", "PSHELL", "PCOMP", "PBAR", "PBARL", "PBEAM", "PBEAML")


def materials_of(found: NastranDeck) -> tuple[dict[int, Material], list[str]]:
    """(materials by number, what is ignored of them)."""
    materials: dict[int, Material] = {}
    ignored: list[str] = []
    for entry in found.named("MAT1", "MAT8"):
        number = entry.whole(0)
        material = Material(f"{entry.name} {number}", entry.place)
        if entry.name == "MAT1":
            E, G, nu = _moduli(entry)
            material.constants = isotropic(E, nu)
            material.density = entry.real(4) or None
            if G and not math.isclose(G, E / (2 * (1 + nu)), rel_tol=0.02):
                ignored.append(f"G of MAT1 {number}, which does not follow from E and NU")
        else:
            E1, E2, n12, G12 = (entry.real(k, None) for k in (1, 2, 3, 4))
            G13, G23 = (entry.real(k) or G12 for k in (5, 6))
            if not (entry.text(5) and entry.text(6)):
                ignored.append(f"rigid transverse shear of MAT8 {number}, whose G12 is taken")
            constants = [E1, E2, np.nan, n12, np.nan, np.nan, G12, G13, G23]
            material.constants = np.array(constants)
            material.density = entry.real(7) or None
        materials[number] = material
    for name in ("MATS1", "MATT1", "CREEP"):
        if entries := found.named(name):
            ignored.append(f"{len(entries)} {name}")
    return materials, ignored


def _moduli(entry: Entry) -> tuple[float, float, float]:
    """(E, G as given, nu); one of the three may be missing."""
    E, G = entry.real(1), entry.real(2)
    nu = entry.real(3) if entry.text(3) else None
    if not E and G and nu is not None:
        E = 2 * G * (1 + nu)
    if nu is None and E and G:
        nu = E / (2 * G) - 1
    if not E:
        raise MeshError(f"{entry.place}: MAT1 needs E, or G and NU.")
    return E, G, nu or 0.0


class Properties:
    """Adds the properties of a deck to a builder."""

    def __init__(
        self,
        found: NastranDeck,
        builder: ModelBuilder,
        materials: dict[int, Material],
        mass_factor: float,
    ) -> None:
        self.mass_factor = mass_factor
        self.found = found
        self.builder = builder
        self.materials = materials
        self.ignored: list[str] = []
        self.roles = [_role(block.type) for block in found.deck.blocks]
        self._numbers = np.array([property_of(entry) for entry in found.elements], dtype=np.int64)

    def read(self) -> None:
        """Set the section of every element."""
        known = {entry.whole(0): entry for entry in self.found.named(*PROPERTIES)}
        for number in np.unique(self._numbers):
            elements = np.flatnonzero(self._numbers == number)
            first = self.found.elements[elements[0]]
            if self.roles[self._block(elements[0])] == "other":
                continue  # refused with its type later
            entry = known.get(int(number))
            if entry is None:
                raise MeshError(
                    f"{first.place}: {first.name} {first.whole(0)} has the property {number}, "
                    f"which is none of {', '.join(PROPERTIES)} in the deck."
                )
            families = {"PSOLID": tuple(SOLIDS), "PSHELL": tuple(SHELLS), "PCOMP": tuple(SHELLS)}
            wanted = families.get(entry.name, BEAMS)
            names = {self.found.elements[k].name for k in elements}
            wrong = sorted(name for name in names if name not in wanted)
            if wrong:
                raise MeshError(f"{entry.place}: {entry.name} is not a property of {wrong[0]}.")
            match entry.name:
                case "PSOLID":
                    self._solid(entry, str(number), elements)
                case "PSHELL":
                    self._shell(entry, str(number), elements)
                case "PCOMP":
                    self._laminate(entry, str(number), elements)
                case _:
                    self._beams(entry, str(number), elements)

    def _block(self, element: int) -> int:
        ends = np.cumsum([len(block) for block in self.found.deck.blocks])
        return int(np.searchsorted(ends, element, side="right"))

    def _material(self, entry: Entry, k: int) -> Material:
        number = entry.whole(k)
        if number not in self.materials:
            raise MeshError(f"{entry.place}: there is no MAT1 or MAT8 with the number {number}.")
        return self.materials[number]

    def _solid(self, entry: Entry, name: str, elements: IntArray) -> None:
        if entry.text(6) not in ("", "SMECH"):
            raise MeshError(f"{entry.place}: PSOLID with FCTN={entry.text(6)} is not a solid.")
        material = self._material(entry, 1)
        E, nu = self.builder.elastic(material, "solids")
        arguments = {"E": E, "nu": nu, "rho": self.builder.rho(material)}
        self.builder.add(name, elements, Family("Solid", arguments, entry.place))

    # --- Shells -----------------------------------------------------------------------------------

    def _check_offsets(self, elements: IntArray, thickness: float) -> None:
        for element in elements:
            entry = self.found.elements[element]
            corners = 3 if "TRIA" in entry.name else 4
            if entry.name == "CTRIA6":
                offset, first = 9, 10
            elif entry.name == "CQUAD8":
                offset, first = 15, 10
            else:
                offset = 3 + corners if entry.name in ("CTRIA3", "CQUAD4") else 99
                first = 10
            own = [entry.real(first + k) for k in range(corners)]
            if entry.real(offset) != 0 or any(t and abs(t - thickness) > 1e-6 * t for t in own):
                raise MeshError(
                    f"{entry.place}: {entry.name} {entry.whole(0)} has an offset or thicknesses "
                    "of its own at its corners, which is not supported."
                )

    def _shell(self, entry: Entry, name: str, elements: IntArray) -> None:
        thickness = entry.real(2, None)
        if not entry.text(3) or entry.whole(3) == -1:
            raise MeshError(
                f"{entry.place}: PSHELL without bending (MID2) is a membrane, which is not "
                "supported."
            )
        if entry.whole(3) != entry.whole(1) or entry.real(4, 1.0) != 1 or entry.text(10):
            raise MeshError(
                f"{entry.place}: PSHELL is read with one material, 12I/T³ = 1 and no MID4."
            )
        self._check_offsets(elements, thickness)
        self._tell_shear(entry)
        material = self._material(entry, 1)
        if material.isotropic is None:
            layers = [self.builder.layer(material, thickness, 0.0)]
            self._stack(entry, name, elements, layers)
            return
        E, nu = self.builder.elastic(material, "shells")
        rho = self.builder.rho(material)
        units = self.builder.units
        rho += self._beside(entry.real(7), thickness)
        self._tell_beside(entry, entry.real(7))
        arguments = {"E": E, "nu": nu, "rho": rho, "thickness": thickness * units.length}
        self.builder.add(name, elements, Family("Shell", arguments, entry.place))

    def _laminate(self, entry: Entry, name: str, elements: IntArray) -> None:
        plies = []
        material, thickness = "", ""
        for start in range(8, len(entry.fields), 4):
            if not any(entry.text(start + k) for k in range(4)):
                continue
            material = entry.text(start) or material
            thickness = entry.text(start + 1) or thickness
            ply = Entry(entry.name, entry.place, [material, thickness, entry.text(start + 2)])
            plies.append((self._material(ply, 0), ply.real(1, None), ply.real(2)))
        how = entry.text(7).upper()
        if how not in ("", "SYM"):
            raise MeshError(f"{entry.place}: PCOMP with LAM={how} is not supported.")
        if how == "SYM":
            plies += plies[::-1]
        total = sum(thickness for _, thickness, _ in plies)
        if entry.text(1) and abs(entry.real(1) + total / 2) > 1e-6 * total:
            raise MeshError(
                f"{entry.place}: PCOMP with Z0 = {entry.real(1):g} lies off its nodes "
                f"(-T/2 = {-total / 2:g}), which is not supported."
            )
        self._check_offsets(elements, total)
        layers = [self.builder.layer(m, t, angle) for m, t, angle in plies]
        extra = self._beside(entry.real(2), total)
        self._tell_beside(entry, extra)
        for layer in layers:
            layer["rho"] += extra
        self._stack(entry, name, elements, layers)

    def _stack(
        self, entry: Entry, name: str, elements: IntArray, layers: list[dict[str, float]]
    ) -> None:
        normals = normals_of(self.found.deck, elements)
        axes = np.array([self._axis(k, n) for k, n in zip(elements, normals, strict=True)])
        axis = common_direction(axes, least=1 - 1e-6)
        if axis is None:
            raise MeshError(
                f"{entry.place}: the elements of {entry.name} {name} have their 0° in different "
                "directions; give each direction a property of its own, or use MCID."
            )
        top = common_direction(normals)
        arguments = {
            "layers": layers,
            "axis": axis.tolist(),
            "top": None if top is None else top.tolist(),
        }
        self.builder.add(name, elements, Family("Laminate", arguments, entry.place))

    def _axis(self, element: int, normal: Array) -> Array:
        """Direction of 0° in an element: its first side rotated by THETA, or x of MCID."""
        entry = self.found.elements[element]
        where = {"CTRIA3": 5, "CTRIAR": 5, "CQUAD4": 6, "CQUADR": 6, "CTRIA6": 8, "CQUAD8": 14}
        word = entry.text(where[entry.name])
        if word.lstrip("+-").isdigit() and self.found.systems is not None:
            return np.asarray(self.found.systems(int(word), entry.place).axes[0])
        nodes = [self.found.row(entry.whole(k), entry.place) for k in (2, 3)]
        side = self.found.deck.points[nodes[1]] - self.found.deck.points[nodes[0]]
        side -= (side @ normal) * normal
        angle = math.radians(entry.real(where[entry.name]))
        rotated = math.cos(angle) * side + math.sin(angle) * np.cross(normal, side)
        return np.asarray(rotated / max(float(np.linalg.norm(rotated)), 1e-300))

    def _tell_shear(self, entry: Entry) -> None:
        """Transverse shear of PSHELL that differs from that of its material's plate."""
        if not entry.text(5):
            self.ignored.append(
                f"the rigid transverse shear of PSHELL {entry.text(0)} (no MID3), its material's "
                "is taken"
            )
        elif entry.whole(5) != entry.whole(1) or abs(entry.real(6, 5 / 6) - 5 / 6) > 1e-3:
            self.ignored.append(
                f"MID3 or TS/T of PSHELL {entry.text(0)}, the shear of MID1 with 5/6 is taken"
            )

    def _tell_beside(self, entry: Entry, extra: float) -> None:
        if extra:
            self.ignored.append(
                f"where the nonstructural mass of {entry.name} {entry.text(0)} lies, it is spread "
                "over the section"
            )

    def _beside(self, extra: float, size: float) -> float:
        """Nonstructural mass per area or length, as density of the thickness or cross-section."""
        return extra * self.mass_factor / size * self.builder.units.density if size else 0.0

    # --- Beams ------------------------------------------------------------------------------------

    def _beams(self, entry: Entry, name: str, elements: IntArray) -> None:
        """Add the elements of one property, grouped by place, orientation and offset."""
        along = BeamProfiles(entry)
        self.ignored += along.told
        material = self._material(entry, 1)
        E, nu = self.builder.elastic(material, "beams")
        units = self.builder.units
        density = self.builder.rho(material)
        length = units.length
        tangents = tangents_of(self.found.deck, elements)
        apart: dict[tuple[float, ...], list[int]] = {}
        beams = self.found.beams
        for element, tangent in zip(elements, tangents, strict=True):
            beam = beams.get(int(element), PLAIN)
            own = self.found.elements[element]
            height = orientation(self.found, own, tangent)
            offset = 0.0 if beam.moved else offset_along(self.found, own, height)
            key = (*np.round(height, 9).tolist(), round(offset, 12), beam.middle)
            apart.setdefault(key, []).append(int(element))
        for key, some in apart.items():
            one = along.at(key[4])
            self._tell_beside(entry, one.extra)
            profile = one.profile
            height = np.array(key[:3])
            if one.angle:
                if key[3]:
                    raise MeshError(
                        f"{entry.place}: {entry.name} with I12 and with offsets of its elements is "
                        "not supported; rotate the section to its principal axes."
                    )
                side = np.cross(tangents_of(self.found.deck, np.array(some[:1]))[0], height)
                height = math.cos(one.angle) * height + math.sin(one.angle) * side
            arguments: dict[str, Any] = {
                "E": E,
                "nu": nu,
                "rho": density + self._beside(one.extra, profile.A),
                "section": {
                    "A": profile.A * length**2,
                    "I": profile.I * length**4,
                    "I_side": profile.I_side * length**4,
                    "J": profile.J * length**4,
                    "shear": profile.shear,
                },
                "orientation": height.tolist(),
                "offset": key[3] * length,
                "shear": one.sheared,
            }
            label = name if len(apart) == 1 else f"{name} along {key[:3]}"
            self.builder.add(label, np.array(some), Family("Beam", arguments, entry.place))


def _role(name: str) -> str:
    if name in SOLIDS:
        return "solid"
    return "shell" if name in SHELLS else "beam" if name in BEAMS else "other"
