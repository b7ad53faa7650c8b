"""Shell properties of Nastran decks: PSHELL, PCOMP, PCOMPG; offsets and thicknesses of elements."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antiosc.io.deck import Array, IntArray
from antiosc.io.shapes import CORNERS
from antiosc_decks.model.builder import Family
from antiosc_decks.model.geometry import common_direction, everywhere, normals_of, side_of, top_of
from antiosc_decks.model.properties import Material
from antiosc_decks.nastran.cards import Entry
from antiosc_decks.nastran.materials import PropertyReader
from antiosc_decks.nastran.table import CELLS

#: Field of the thickness of the first corner.
OWN_THICKNESS = 10
#: Sine of the angle below which a direction is normal to an element.
NORMAL = 0.05


class Shells:
    """Adds shell properties to the builder of a `PropertyReader`."""

    def __init__(self, whole: PropertyReader) -> None:
        self.whole = whole
        self.found = whole.found
        self.builder = whole.builder

    def shell(self, entry: Entry, name: str, elements: IntArray) -> None:
        """PSHELL."""
        thickness = entry.real(2, 0.0)
        for k, other, what in ((1, 3, "stretching"), (3, 1, "bending")):
            if not entry.text(k) and entry.text(other):
                entry.fields += [""] * (4 - len(entry.fields))
                entry.fields[k] = entry.text(other)
                self.whole.ignored.append(
                    f"that PSHELL {entry.text(0)} has no stiffness against {what} (no "
                    f"MID{(k + 1) // 2}), that of its other material is taken"
                )
        if entry.whole(3) == -1:
            raise entry.place.error("PSHELL in plane strain (MID2 = -1) is not supported.")
        if entry.text(10):
            raise entry.place.error(
                "PSHELL with MID4, which couples stretching with bending, is not "
                "supported; give the layers by PCOMP, or an offset."
            )
        off = entry.real(12) if entry.text(12) else 0.0
        material = self.whole.material(entry, 1)
        ratio = entry.real(4, 1.0)
        plain = material.plane is None and entry.whole(3) == entry.whole(1) and ratio == 1
        shear = (entry.text(5) or entry.text(1)) == entry.text(1) and (
            abs(entry.real(6, 5 / 6) - 5 / 6) <= 1e-3
        )
        if not entry.text(5) and plain:
            self.whole.ignored.append(
                f"the rigid transverse shear of PSHELL {entry.text(0)} (no MID3), its material's "
                "is taken"
            )
        self.whole.tell_beside(entry, entry.real(7))
        for own, offset, some in self._by_thickness(elements, thickness, entry):
            offset += off
            if not plain or not shear:
                self._given(entry, name, some, own, offset)
            elif material.isotropic is None:
                layer = self.builder.layer(material, own, 0.0)
                layer["rho"] += self.whole.beside(entry.real(7), own)
                self._directed(entry, name, some, "Laminate", {"layers": [layer]}, offset)
            else:
                E, nu = self.builder.elastic(material, "shells")
                length = self.builder.units.length
                rho = self.builder.rho(material) + self.whole.beside(entry.real(7), own)
                arguments = {"E": E, "nu": nu, "rho": rho, "thickness": own * length}
                if offset:
                    arguments["offset"] = offset * length
                    arguments |= side_of(self.found.deck, some, length)
                    self._tell_curved(entry, some)
                self.builder.add(name, some, Family("Shell", arguments, entry.place))

    def _by_thickness(
        self, elements: IntArray, thickness: float, entry: Entry
    ) -> list[tuple[float, float, IntArray]]:
        """(thickness, offset, elements) of elements that are alike."""
        apart: dict[tuple[float, float], list[int]] = {}
        varying = 0
        for element in elements:
            own = self.found.elements[element]
            cell = CELLS[own.name]
            factor = thickness if own.whole(cell.flag, 0) == 1 else 1.0
            values = [
                own.real(k) * factor if own.text(k) else thickness
                for k in range(OWN_THICKNESS, OWN_THICKNESS + CORNERS[cell.shape])
            ]
            if min(values) < 0 or max(values) <= 0:
                raise own.place.error(
                    f"{own.name} {own.whole(0)} has no thickness, here or in "
                    f"{entry.name} {entry.text(0)}."
                )
            varying += max(values) - min(values) > 1e-9 * max(values)
            key = (float(np.round(np.mean(values), 12)), own.real(cell.offset))
            apart.setdefault(key, []).append(int(element))
        if varying:
            self.whole.ignored.append(
                f"the variation of the thickness within {varying} elements of {entry.name} "
                f"{entry.text(0)}, the mean of the corners is taken in each"
            )
        return [(t, offset, np.array(some)) for (t, offset), some in apart.items()]

    def _given(
        self, entry: Entry, name: str, elements: IntArray, thickness: float, offset: float
    ) -> None:
        """PSHELL by its stiffnesses: A = T Q1, D = (12I/T³) T³/12 Q2, S = TS G3."""
        membrane, bending = (self.whole.material(entry, k) for k in (1, 3))
        ratio, share = entry.real(4, 1.0), entry.real(6, 5 / 6)
        across = self.whole.material(entry, 5) if entry.text(5) else membrane
        if not entry.text(5):
            self.whole.ignored.append(
                f"the rigid transverse shear of PSHELL {entry.text(0)} (no MID3), that of MID1 "
                "with 5/6 is taken"
            )
            share = 5 / 6
        if min(ratio, share) <= 0:
            raise entry.place.error("12I/T³ and TS/T of PSHELL must be above 0.")
        units = self.builder.units
        t = thickness * units.length
        mass = self.builder.rho(membrane) * t + self.whole.beside(entry.real(7), 1.0) * units.length
        arguments: dict[str, Any] = {
            "A": (_plane(membrane) * units.stress * t).tolist(),
            "D": (_plane(bending) * units.stress * ratio * t**3 / 12).tolist(),
            "S": (_across(across) * units.stress * share * t).tolist(),
            "mass": mass,
            "inertia": mass * ratio * t**2 / 12,
            "thickness": t,
        }
        self._directed(entry, name, elements, "GivenSheet", arguments, offset)

    def laminate(self, entry: Entry, name: str, elements: IntArray) -> None:
        """PCOMP and PCOMPG."""
        plies = []
        material, thickness = "", ""
        step = 8 if entry.name == "PCOMPG" else 4
        for start in range(8, len(entry.fields), step):
            if not any(entry.text(start + k) for k in range(4)):
                continue
            first = start + (entry.name == "PCOMPG")
            material = entry.text(first) or material
            thickness = entry.text(first + 1) or thickness
            ply = Entry(entry.name, entry.place, [material, thickness, entry.text(first + 2)])
            plies.append((self.whole.material(ply, 0), ply.real(1, None), ply.real(2)))
        how = entry.text(7).upper()
        if how not in ("", "SYM") or not plies:
            what = f"LAM={how}" if plies else "no plies"
            raise entry.place.error(f"{entry.name} with {what} is not supported.")
        if how == "SYM":
            plies += plies[::-1]
        total = sum(thickness for _, thickness, _ in plies)
        off = entry.real(1) + total / 2 if entry.text(1) else 0.0
        layers = [self._ply(m, t, angle) for m, t, angle in plies]
        extra = self.whole.beside(entry.real(2), total)
        self.whole.tell_beside(entry, extra)
        for layer in layers:
            layer["rho"] += extra
        for own, offset, some in self._by_thickness(elements, total, entry):
            if not math.isclose(own, total, rel_tol=1e-9):
                first = self.found.elements[some[0]]
                raise first.place.error(
                    f"{first.name} {first.whole(0)} has thicknesses of its own, "
                    f"which do not apply to the plies of {entry.name}."
                )
            offset += off if abs(off) > 1e-9 * total else 0.0
            self._directed(entry, name, some, "Laminate", {"layers": layers}, offset)

    def _ply(self, material: Material, thickness: float, angle: float) -> dict[str, float]:
        if material.plane is not None:
            Q = _plane(material)
            if np.abs(Q[:2, 2]).max() > 1e-9 * np.abs(Q).max():
                raise material.place.error(
                    f"{material.name} couples stretching with shear, which plies "
                    "here do not; give the ply along its fibres by MAT8."
                )
            S = np.linalg.inv(Q)
            G = Q[2, 2]
            nan = np.nan
            constants = [1 / S[0, 0], 1 / S[1, 1], nan, -S[0, 1] / S[0, 0], nan, nan, G, G, G]
            told = f"transverse shear of {material.name}, whose G33 is taken"
            if told not in self.whole.ignored:
                self.whole.ignored.append(told)
            given = Material(material.name, material.place, np.array(constants))
            given.density = material.density
            material = given
        return self.builder.layer(material, thickness, angle)

    def _directed(
        self,
        entry: Entry,
        name: str,
        elements: IntArray,
        kind: str,
        arguments: dict[str, Any],
        offset: float,
    ) -> None:
        """Add a family with directions: one axis, or one in each element."""
        normals = normals_of(self.found.deck, elements)
        axes = np.array([self._axis(k, n) for k, n in zip(elements, normals, strict=True)])
        axis = common_direction(axes, least=1 - 1e-6)
        length = self.builder.units.length
        own = {**arguments, "top": top_of(self.found.deck, elements, length)}
        own["axis"] = axis.tolist() if axis is not None else everywhere(
            self.found.deck, elements, axes, length)  # fmt: skip
        if offset:
            own["offset"] = offset * self.builder.units.length
            self._tell_curved(entry, elements)
        self.builder.add(name, elements, Family(kind, own, entry.place))

    def _tell_curved(self, entry: Entry, elements: IntArray) -> None:
        if common_direction(normals_of(self.found.deck, elements), least=1 - 1e-6) is None:
            self.whole.ignored.append(
                f"the area of the offset surface of {entry.name} {entry.text(0)}, that at the "
                "nodes is taken"
            )

    def _axis(self, element: int, normal: Array) -> Array:
        """Direction of 0° in an element: its first side rotated by THETA, or x of MCID."""
        entry = self.found.elements[element]
        where = CELLS[entry.name].theta
        word = entry.text(where)
        if word.lstrip("+-").isdigit():
            x, y, _ = self.found.systems(int(word), entry.place).axes
            if np.linalg.norm(np.cross(x, normal)) > NORMAL:
                return np.asarray(x)
            self.builder.tell_once(f"x of the system {word} (MCID) where it is normal to elements, "
                                   "its y is taken")  # fmt: skip
            return np.asarray(y)
        nodes = [self.found.row(entry.whole(k), entry.place) for k in (2, 3)]
        side = self.found.deck.points[nodes[1]] - self.found.deck.points[nodes[0]]
        side -= (side @ normal) * normal
        angle = math.radians(entry.real(where))
        rotated = math.cos(angle) * side + math.sin(angle) * np.cross(normal, side)
        return np.asarray(rotated / max(float(np.linalg.norm(rotated)), 1e-300))


def _plane(material: Material) -> Array:
    """Stresses (σ1, σ2, τ12) of plane strains (3, 3)."""
    if material.plane is not None:
        if not np.linalg.eigvalsh(material.plane).min() > 0:
            raise material.place.error(
                f"the stiffness of {material.name} is not positive definite."
            )
        return material.plane
    if material.constants is None:
        raise material.place.error(f"{material.name} is not a material of shells.")
    E1, E2, _, n12, _, _, G12, *_ = material.constants
    n21 = n12 * E2 / E1
    Q = np.array([[E1, n21 * E1, 0], [n21 * E1, E2, 0], [0, 0, (1 - n12 * n21) * G12]])
    return np.asarray(Q / (1 - n12 * n21))


def _across(material: Material) -> Array:
    """Stresses (τ13, τ23) of transverse shear strains (2, 2)."""
    if material.plane is not None:  # G11, G12, G22 of a MAT2
        return np.asarray(material.plane[:2, :2])
    if material.constants is None:
        raise material.place.error(f"{material.name} is not a material of shells.")
    return np.diag(material.constants[7:9])
