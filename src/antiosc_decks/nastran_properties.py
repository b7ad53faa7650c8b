"""Materials and properties of Nastran decks: solids, rods, beams and shells."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import Array, IntArray
from antiosc.io.neutral import CORNERS, Json
from antiosc_decks import properties as geometry
from antiosc_decks.builder import GroupSection, ModelBuilder
from antiosc_decks.nastran_beams import BeamProfiles, offsets_of, plane_1_vector
from antiosc_decks.nastran_cards import CELL_FORMATS, SECTION_PROPERTIES, Entry
from antiosc_decks.nastran_mesh import NastranDeck, defined_once
from antiosc_decks.properties import Material, symmetric, tube

#: Material -> the field of its density.
DENSITY_FIELDS = {"MAT1": 4, "MAT2": 7, "MAT8": 7, "MAT9": 22, "MAT11": 10}
#: Largest ν of a beam; if G is smaller than E/(2(1 + ν)), the section is reduced instead.
MAX_BEAM_POISSON = 0.49
#: Beginnings of entries that may share a number with a property of cells: springs, loads, …
NON_SECTION_ENTRIES = ("PLOAD", "PELAS", "PDAMP", "PBUSH", "PMASS", "PARAM", "PLOTEL")
#: Field of the thickness of the first corner.
CORNER_THICKNESS_FIELD = 10
#: Sine of the angle below which a direction is normal to an element.
NORMAL_SINE = 0.05


@dataclass
class Properties:
    """Adds the property cards of a deck to its builder; masses are multiplied by `mass_factor`."""

    nastran: NastranDeck
    builder: ModelBuilder
    mass_factor: float

    def read(self) -> None:
        """Set the section of every element."""
        entries = defined_once(self.nastran.entries_named(*DENSITY_FIELDS), "material")
        self._materials = {number: self._material_of(entry) for number, entry in entries.items()}
        properties = defined_once(self.nastran.entries_named(*SECTION_PROPERTIES), "property")
        every = self.nastran.elements
        numbers = self.nastran.property_numbers()
        for number in np.unique(numbers):
            elements = np.flatnonzero(numbers == number)
            names = {every[k].name for k in elements}
            if number == 0 and "CONROD" in names:
                for element in elements:
                    self._add_rods(every[element], "", np.array([element]))
                continue
            entry = properties.get(int(number))
            if entry is None:
                raise self._unknown_property(every[elements[0]], int(number))
            for name in sorted(names):
                fits = entry.name in CELL_FORMATS[name].properties
                entry.needs(fits, f"{entry.name} is not a property of {name}.")
            add = PROPERTY_READERS.get(entry.name, Properties._add_beams)
            add(self, entry, str(number), elements)

    def _unknown_property(self, element: Entry, number: int) -> MeshError:
        """The error of an element whose property is missing or not supported."""
        named = (e.name for e in self.nastran.bulk.entries if e.text(0) == str(number))
        kinds = (name for name in named if name.startswith("P") and name not in SECTION_PROPERTIES)
        kind = next((name for name in kinds if not name.startswith(NON_SECTION_ENTRIES)), "")
        reason = f"which is none of {', '.join(SECTION_PROPERTIES)} in the deck."
        if kind:
            instead = " or ".join(CELL_FORMATS[element.name].properties)
            reason = f"a {kind}, which is not supported; give it as {instead}."
        label = f"{element.name} {element.integer(0)}"
        return element.place.error(f"{label} has the property {number}, {reason}")

    def _material_of(self, entry: Entry) -> Material:
        """The material of an entry."""
        number = entry.integer(0)
        material = Material(f"{entry.name} {number}", entry.place)
        density = entry.real(DENSITY_FIELDS[entry.name])
        material.density = density * self.mass_factor if density else None
        if entry.name == "MAT1":
            E, G, nu = _moduli(entry)
            if E:
                material.set_isotropic(E, nu)
            if E and G is not None and not math.isclose(G, E / (2 * (1 + nu)), rel_tol=0.02):
                material.line_moduli = E, G
                message = f"G of MAT1 {number}, which does not follow from E and NU"
                self.builder.report_once(f"{message}, of solids and shells")
        elif entry.name == "MAT2":
            material.plane_stiffness = symmetric(entry.reals(1, 7), np.triu_indices)
        elif entry.name == "MAT9":
            # Nastran's order of the shear stresses is 12, 23, 31
            order = [0, 1, 2, 4, 5, 3]
            C = symmetric(entry.reals(1, 22), np.triu_indices)
            material.stiffness = C[np.ix_(order, order)]
        elif entry.name == "MAT11":
            material.constants = np.array([entry.real(k, None) for k in range(1, 10)])
        else:
            E1, E2, n12, G12 = (entry.real(k, None) for k in (1, 2, 3, 4))
            G13, G23 = (entry.real(k) or G12 for k in (5, 6))
            if not (entry.real(5) and entry.real(6)):
                message = f"rigid transverse shear of MAT8 {number}, whose G12 is taken"
                self.builder.report_once(message)
            nan = np.nan
            material.constants = np.array([E1, E2, nan, n12, nan, nan, G12, G13, G23])
        self.builder.complete_elasticity(material)

        return material

    def _material_in_field(self, entry: Entry, k: int) -> Material:
        """The material whose number is in field `k` (from 0)."""
        number = entry.integer(k)
        message = f"there is no MAT1, MAT2, MAT8, MAT9 or MAT11 with the number {number}."
        return entry.place.look_up(self._materials, number, message)

    def _nonstructural_density(self, nonstructural_mass: float, size: float) -> float:
        """Density [kg/m³] to add for `nonstructural_mass` per area or length.

        `size`: thickness or cross-section, in the deck's units.
        """
        if size:
            return nonstructural_mass * self.mass_factor / size * self.builder.units.density
        return 0.0

    def _report_nonstructural(self, entry: Entry, nonstructural_mass: float) -> None:
        """Report that nonstructural mass is spread over the section."""
        if nonstructural_mass:
            told = "the place of the nonstructural mass of {}, spread evenly"
            self.builder.report_once(told, f"{entry.name} {entry.text(0)}")

    def _add_solids(self, entry: Entry, name: str, elements: IntArray) -> None:
        """Add the solids of a PSOLID entry."""
        material = self._material_in_field(entry, 1)
        number = entry.text(2)
        stiffness = self.builder.anisotropic_stiffness(material)
        if stiffness is None:
            family = GroupSection("Solid", self.builder.isotropic(material, "solids"), entry.place)
        else:
            has_axes = number not in ("", "-1")
            entry.needs(has_axes, f"PSOLID with {material.name} needs a rectangular CORDM.")
            axes = self.nastran.axes(entry, entry.integer(2))[:2].tolist()
            arguments = {"stiffness": stiffness, "rho": self.builder.rho(material), "axes": axes}
            family = GroupSection("AnisotropicSolid", arguments, entry.place)
        self.builder.add_section(name, elements, family)

    def _add_layered_solid(self, entry: Entry, name: str, elements: IntArray) -> None:
        """Add the solid of a PCOMPS entry, whose layers must be of one isotropic material."""
        numbers = {entry.text(k) for k in range(9, len(entry.fields), 8)} - {""}
        pcomps = Entry("PCOMPS", entry.place, [name, *numbers])
        isotropic = len(numbers) == 1 and self._material_in_field(pcomps, 1).isotropic
        entry.needs(isotropic, "PCOMPS is read with layers of one isotropic material alone.")
        self._add_solids(pcomps, name, elements)

    def _add_rods(self, entry: Entry, name: str, elements: IntArray) -> None:
        """Add the rods of a PROD, PTUBE or CONROD entry."""
        k = 3 if entry.name == "CONROD" else 1
        if entry.name == "PTUBE":
            outer = entry.real(2, None)
            uniform = entry.real(5, outer) == outer
            entry.needs(uniform, "tapered tubes (PTUBE with OD2) are not supported.")
            pipe = tube(outer / 2, entry.real(3) or outer / 2)
            area, torsion, extra = pipe.A, pipe.J, entry.real(4)
        else:
            area, torsion, extra = (entry.real(k + n) for n in (1, 2, 4))
        entry.needs(area > 0, f"{entry.name} needs an area above 0.")
        length = self.builder.units.length
        arguments = self.builder.isotropic(self._material_in_field(entry, k), "rods")
        arguments |= {"area": area * length**2, "torsion": torsion * length**4}
        arguments["rho"] += self._nonstructural_density(extra, area)
        self.builder.add_section("rods", elements, GroupSection("Truss", arguments, entry.place))

    def _add_beams(self, entry: Entry, name: str, elements: IntArray) -> None:
        """Add the beams of one property, grouped by place, orientation and offset."""
        profiles = BeamProfiles(entry)
        for note in profiles.remarks:
            self.builder.report_once(note)
        material = self._material_in_field(entry, 1)
        E, nu = self.builder.elastic_constants(material, "beams")
        # a G up to E/3 goes into the section: nu lies below 0.5
        share = 1.0 if nu < MAX_BEAM_POISSON else (1 + MAX_BEAM_POISSON) / (1 + nu)
        density = self.builder.rho(material)
        length = self.builder.units.length
        tangents = geometry.tangents_of(self.nastran.deck, elements)

        groups: dict[tuple[float, ...], list[int]] = {}
        for k, (element, tangent) in enumerate(zip(elements, tangents, strict=True)):
            entry_of = self.nastran.elements[element]
            height = plane_1_vector(self.nastran, entry_of, tangent)
            moved = int(element) in self.nastran.beams_with_own_ends
            offset = 0.0 if moved else float(offsets_of(self.nastran, entry_of)[0] @ height)
            key = (*np.round(height, 9).tolist(), round(offset, 12))
            groups.setdefault(key, []).append(k)

        section = profiles.mean()
        self._report_nonstructural(entry, section.nonstructural_mass)
        for key, members in groups.items():
            profile = section.profile
            height = np.array(key[:3])
            if section.angle:
                fault = f"{entry.name} with I12 and offsets: turn it to principal axes."
                entry.needs(not key[3], fault)
                side = np.cross(tangents[members[0]], height)
                height = math.cos(section.angle) * height + math.sin(section.angle) * side
            shears = (share * shear for shear in profile.shear_coefficients)
            profile = replace(profile, J=profile.J * share).sheared(*shears)
            arguments: Json = {
                "E": E,
                "nu": min(nu, MAX_BEAM_POISSON),
                "rho": density + self._nonstructural_density(section.nonstructural_mass, profile.A),
                "section": profile.section(length),
                "orientation": height.tolist(),
                "offset": key[3] * length,
                "shear": section.sheared,
            }
            group = name if len(groups) == 1 else f"{name} along {key[:3]}"
            family = GroupSection("Beam", arguments, entry.place)
            self.builder.add_section(group, elements[members], family)

    def _add_shells(self, entry: Entry, name: str, elements: IntArray) -> None:
        """Add the shells of a PSHELL entry."""
        number = entry.text(0)
        for k, other, action in ((1, 3, "stretching (no MID1)"), (3, 1, "bending (no MID2)")):
            if not entry.text(k) and entry.text(other):
                entry.fields += [""] * (4 - len(entry.fields))
                entry.fields[k] = entry.text(other)
                told = f"that PSHELL {number} has no stiffness against {action}"
                self.builder.report_once(f"{told}, that of its other material is taken")

        strained = entry.integer(3) == -1
        entry.needs(not strained, "PSHELL in plane strain (MID2 = -1) is not supported.")
        entry.needs(not entry.text(10), "PSHELL with MID4: give the layers by PCOMP, or an offset.")
        alike = entry.integer(3) == entry.integer(1)
        entry.needs(alike, "PSHELL that bends by another material (MID2): give PCOMP.")
        material = self._material_in_field(entry, 1)
        plain = material.plane_stiffness is None and entry.real(4, 1.0) == 1
        plain &= entry.text(5) in ("", entry.text(1))
        share = entry.real(6, 5 / 6)

        if not entry.text(5):
            share = 5 / 6
            message = f"the rigid transverse shear of PSHELL {number} (no MID3), its material's"
            self.builder.report_once(f"{message} is taken")
        plain &= abs(share - 5 / 6) <= 1e-3
        self._report_nonstructural(entry, entry.real(7))
        length = self.builder.units.length

        for thickness, offset, members in self._by_thickness(elements, entry.real(2), entry):
            offset += entry.real(12)
            extra = self._nonstructural_density(entry.real(7), thickness)
            if not plain:
                given = self._given_sheet(entry, material, thickness, share)
                self._add_directed_shells(entry, name, members, "GivenSheet", given, offset)
            elif material.isotropic is None:
                layer = self.builder.layer_arguments(material, thickness, 0.0)
                layer["rho"] += extra
                layers = {"layers": [layer]}
                self._add_directed_shells(entry, name, members, "Laminate", layers, offset)
            else:
                arguments = self.builder.isotropic(material, "shells")
                arguments |= {"thickness": thickness * length, "rho": arguments["rho"] + extra}
                family = GroupSection("Shell", arguments, entry.place)
                self.builder.add_shells(name, members, family, offset)

    def _by_thickness(
        self, elements: IntArray, thickness: float, entry: Entry
    ) -> Iterator[tuple[float, float, IntArray]]:
        """Yields (thickness, offset, elements) for elements with equal thickness and offset."""
        groups: dict[tuple[float, float], list[int]] = {}
        varying = 0
        label = f"{entry.name} {entry.text(0)}"
        for element in elements:
            shell = self.nastran.elements[element]
            cell = CELL_FORMATS[shell.name]
            factor = thickness if shell.integer(cell.flag, 0) == 1 else 1.0
            corners = range(CORNER_THICKNESS_FIELD, CORNER_THICKNESS_FIELD + CORNERS[cell.shape])
            values = [shell.real(k) * factor if shell.text(k) else thickness for k in corners]
            thick = min(values) >= 0 and max(values) > 0
            shell.needs(thick, f"{shell.name} {shell.text(0)} has no thickness.")
            varying += max(values) - min(values) > 1e-9 * max(values)
            key = (float(np.round(np.mean(values), 12)), shell.real(cell.offset))
            groups.setdefault(key, []).append(int(element))

        if varying:
            message = f"the variation of the thickness within {varying} elements of {label}"
            self.builder.report_once(f"{message}, the mean of the corners is taken in each")
        return ((t, offset, np.array(members)) for (t, offset), members in groups.items())

    def _given_sheet(
        self, entry: Entry, material: Material, thickness: float, share: float
    ) -> Json:
        """Arguments of `GivenSheet` for a PSHELL; `share` is TS/T.

        A = T Q, D = (12I/T³) T³/12 Q, S = TS G, where Q is the plane-stress stiffness.
        """
        ratio = entry.real(4, 1.0)
        core = self._material_in_field(entry, 5) if entry.text(5) else material
        entry.needs(min(ratio, share) > 0, "12I/T³ and TS/T of PSHELL must be above 0.")
        units = self.builder.units
        t = thickness * units.length
        mass = self.builder.rho(material) * t
        mass += self._nonstructural_density(entry.real(7), 1.0) * units.length
        return {
            "A": (_plane_stress_stiffness(material) * units.stress * t).tolist(),
            "D": (_plane_stress_stiffness(material) * units.stress * ratio * t**3 / 12).tolist(),
            "S": (_transverse_shear_stiffness(core) * units.stress * share * t).tolist(),
            **{"mass": mass, "inertia": mass * ratio * t**2 / 12, "thickness": t},
        }

    def _add_laminates(self, entry: Entry, name: str, elements: IntArray) -> None:
        """Add the laminates of a PCOMP or PCOMPG entry."""
        plies = []
        material = ""
        thickness = ""
        step, first = (8, 9) if entry.name == "PCOMPG" else (4, 8)
        for start in range(8, len(entry.fields), step):
            if not entry.words(start, start + 4):
                continue
            k = start + first - 8
            material = entry.text(k) or material
            thickness = entry.text(k + 1) or thickness
            ply = Entry(entry.name, entry.place, [material, thickness, entry.text(k + 2)])
            plies.append((self._material_in_field(ply, 0), ply.real(1, None), ply.real(2)))

        lam_option = entry.text(7).upper()
        fault = f"LAM={lam_option}" if plies else "no plies"
        read = lam_option in ("", "SYM") and plies
        entry.needs(read, f"{entry.name} with {fault} is not supported.")
        plies += plies[::-1] if lam_option == "SYM" else []
        total = sum(thickness for _, thickness, _ in plies)
        own_offset = entry.real(1) + total / 2 if entry.text(1) else 0.0
        layers = [self._ply_arguments(*ply) for ply in plies]
        extra = self._nonstructural_density(entry.real(2), total)
        self._report_nonstructural(entry, extra)
        for layer in layers:
            layer["rho"] += extra

        for thickness_there, offset, members in self._by_thickness(elements, total, entry):
            element = self.nastran.elements[members[0]]
            alike = math.isclose(thickness_there, total, rel_tol=1e-9)
            label = f"{element.name} {element.text(0)}"
            element.needs(alike, f"{label} has thicknesses beside its plies.")
            offset += own_offset if abs(own_offset) > 1e-9 * total else 0.0
            self._add_directed_shells(entry, name, members, "Laminate", {"layers": layers}, offset)

    def _ply_arguments(self, material: Material, thickness: float, angle: float) -> Json:
        """Arguments of a layer."""
        if material.plane_stiffness is not None:
            Q = _plane_stress_stiffness(material)
            uncoupled = np.abs(Q[:2, 2]).max() <= 1e-9 * np.abs(Q).max()
            fault = f"{material.name} couples stretching with shear; give the ply by MAT8."
            material.needs(uncoupled, fault)
            S = np.linalg.inv(Q)
            G, nan = Q[2, 2], np.nan
            constants = [1 / S[0, 0], 1 / S[1, 1], nan, -S[0, 1] / S[0, 0], nan, nan, G, G, G]
            self.builder.report_once(f"transverse shear of {material.name}, whose G33 is taken")
            material = replace(material, constants=np.array(constants), plane_stiffness=None)
        return self.builder.layer_arguments(material, thickness, angle)

    def _add_directed_shells(
        self, entry: Entry, name: str, elements: IntArray, kind: str, arguments: Json, offset: float
    ) -> None:
        """Add shells with a direction of 0°: one for all, or one for each element."""
        normals = geometry.normals_of(self.nastran.deck, elements)
        pairs = zip(elements, normals, strict=True)
        axes = np.array([self._zero_direction(*pair) for pair in pairs])
        family = GroupSection(kind, arguments, entry.place)
        self.builder.add_shells(name, elements, family, offset, axes)

    def _zero_direction(self, element: int, normal: Array) -> Array:
        """Direction of 0° in an element: its first side rotated by THETA, or the x axis of MCID."""
        entry = self.nastran.elements[element]
        theta_field = CELL_FORMATS[entry.name].theta
        word = entry.text(theta_field)
        if word.lstrip("+-").isdigit():
            x, y, _ = self.nastran.systems(int(word), entry.place).axes
            if np.linalg.norm(np.cross(x, normal)) > NORMAL_SINE:
                return x
            told = f"x of the system {word} (MCID) where it is normal to elements"
            self.builder.report_once(f"{told}, its y is taken")
            return y
        nodes = [self.nastran.node_in(entry, k) for k in (2, 3)]
        side = np.diff(self.nastran.deck.points[nodes], axis=0)[0]
        side -= (side @ normal) * normal
        rotated = geometry.rotated_about(side, normal, entry.real(theta_field))
        return rotated / max(float(np.linalg.norm(rotated)), 1e-300)


#: Property -> the method that reads it; all others are of beams.
PROPERTY_READERS = {
    "PSOLID": Properties._add_solids,
    "PCOMPS": Properties._add_layered_solid,
    "PSHELL": Properties._add_shells,
    **dict.fromkeys(("PCOMP", "PCOMPG"), Properties._add_laminates),
    **dict.fromkeys(("PROD", "PTUBE"), Properties._add_rods),
}


def _moduli(entry: Entry) -> tuple[float, float | None, float]:
    """(E, G as given, nu) of MAT1; one of the three may be blank. E is 0 if it is not known."""
    E, G, nu = (entry.real(k) if entry.text(k) else None for k in (1, 2, 3))
    if E is None and G is not None and nu is not None:
        E = 2 * G * (1 + nu)
    if nu is None and E and G:
        nu = E / (2 * G) - 1
    return E or 0.0, G, nu or 0.0


def _plane_stress_stiffness(material: Material) -> Array:
    """Plane-stress stiffness (3, 3): stresses (σ1, σ2, τ12) from strains."""
    if material.plane_stiffness is not None:
        sound = np.linalg.eigvalsh(material.plane_stiffness).min() > 0
        material.needs(sound, f"the stiffness of {material.name} is not positive definite.")
        return material.plane_stiffness
    E1, E2, _, n12, _, _, G12, *_ = material.elasticity()
    n21 = n12 * E2 / E1
    Q = np.array([[E1, n21 * E1, 0], [n21 * E1, E2, 0], [0, 0, (1 - n12 * n21) * G12]])
    return Q / (1 - n12 * n21)


def _transverse_shear_stiffness(material: Material) -> Array:
    """Transverse shear stiffness (2, 2): stresses (τ13, τ23) from strains."""
    if material.plane_stiffness is not None:  # G11, G12, G22 of a MAT2
        return material.plane_stiffness[:2, :2]
    return np.diag(material.elasticity()[7:9])
