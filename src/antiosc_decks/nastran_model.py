"""Nastran decks as whole models, with the supports of the first subcase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc.io.conversion import Array
from antiosc.io.neutral import Model, MotionTerm, UnitSystem
from antiosc_decks import nastran_beams as beams
from antiosc_decks.builder import MaterialDefaults, ModelBuilder
from antiosc_decks.constraints import Motions, axis_terms, lever_matrix
from antiosc_decks.entries import DeckPlace, real_number
from antiosc_decks.finished import complete_model, fix_unresisted
from antiosc_decks.nastran_beams import plane_1_vector
from antiosc_decks.nastran_cards import (
    CONTACT_ENTRIES,
    Entry,
    motions_of,
    report_damping,
    thru_ranges,
)
from antiosc_decks.nastran_mesh import NastranDeck
from antiosc_decks.nastran_properties import Properties
from antiosc_decks.properties import symmetric
from antiosc_decks.sources import lines_text

#: The motions of a node: three displacements, three rotations.
ALL_MOTIONS = (0, 1, 2, 3, 4, 5)
#: A lever arm below this share of the distance counts as zero.
ROUNDING_ARM = 1e-9
#: A negative moment of inertia down to this share of the largest is rounding.
INERTIA_ROUNDING = 1e-6
#: Scalar element -> (its property, the quantity that it gives).
SCALAR_PROPERTIES = {"CELAS": ("PELAS", "stiffness"), "CDAMP": ("PDAMP", "damping")}
SCALAR_PROPERTIES |= {"CMASS": ("PMASS", "mass")}
#: Elements with springs along axes -> their property.
BUSH_PROPERTIES = {"CBUSH1D": "PBUSH1D", "CBUSH": "PBUSH"}
#: Entries that give masses.
MASS_ENTRIES = ("CONM2", "CMASS1", "CMASS2", "CMASS3", "CMASS4")
#: Stiffnesses and dampings of the six motions.
BushConstants = tuple[list[float], list[float]]


@dataclass
class NastranJoints:
    """Adds joints and masses of entries to a builder; `mass_factor` (PARAM,WTMASS) scales them."""

    nastran: NastranDeck
    builder: ModelBuilder
    mass_factor: float

    def read(self) -> None:
        """Add rigid elements, constraints, springs and dampers."""
        deck = self.nastran
        for name, rigid in RIGID_READERS.items():
            for entry in deck.entries_named(name):
                rigid(self, entry)
        mpc_sets = deck.used_sets("MPC")
        for entry in deck.entries_named("MPC"):
            if entry.integer(0) in mpc_sets:
                self._mpc(entry)
        for kind in ("CELAS", "CDAMP"):
            self._add_scalars(kind)
        for kind, name in BUSH_PROPERTIES.items():
            properties = deck.properties(name)
            for entry in deck.entries_named(kind):
                self._add_bush(entry, entry.find_property(name, properties))

    def read_masses(self) -> None:
        """Add masses at nodes."""
        for entry in self.nastran.entries_named("CONM2"):
            self._conm2(entry)
        self._add_scalars("CMASS")

    def _add_rigid(self, rows: list[int], node: int, motions: Motions, entry: Entry) -> None:
        """Let motions of some nodes follow another node as a rigid body."""
        entry.needs(node not in rows, f"a GRID of {entry.name} cannot follow itself.")
        leader = self.builder.joints.leader_point(node)
        followers = np.array(rows, dtype=np.int64)
        self.builder.joints.add_rigid(followers, leader, motions, self.builder.joints.motion_axes)

    def _listed_rows(self, entry: Entry, grid_words: list[str]) -> list[int]:
        """Rows of a list of grid points; those inside a THRU range may be missing."""
        rows: list[int] = []
        for first, last in thru_ranges(grid_words, entry.place):
            rows.append(self.nastran.row(first, entry.place))
            rows += self.nastran.nodes.rows_between(first + 1, last).tolist()
        return rows

    def _rbe2(self, entry: Entry) -> None:
        """RBE2: nodes that follow one node."""
        motions = _motions(entry, entry.text(2))
        words = entry.words(3)
        if words and "." in words[-1]:
            words.pop()  # the coefficient of thermal expansion
        rows = self._listed_rows(entry, words)
        self._add_rigid(rows, self.nastran.node_in(entry, 1), motions, entry)

    def _rbar(self, entry: Entry) -> None:
        """RBAR: one node follows another."""
        first = self.nastran.node_in(entry, 1)
        second = self.nastran.node_in(entry, 2)
        masters, dependents, dependent = (entry.text(k) for k in (3, 4, 6))
        if not masters and dependents:
            first, second, masters, dependents = second, first, dependents, masters
            dependent = entry.text(5)
        is_rigid = set(masters) - {" "} == set("123456") and not dependents
        entry.needs(is_rigid, "RBAR is read with CNA or CNB = 123456 only.")
        motions = _motions(entry, dependent) if dependent else ALL_MOTIONS
        self._add_rigid([second], first, motions, entry)

    def _rbe3(self, entry: Entry) -> None:
        """RBE3: a node follows the weighted mean motion of others."""
        reference = self.nastran.node_in(entry, 2)
        motions = _motions(entry, entry.text(3))
        rows: list[int] = []
        weights: list[float] = []
        turning: list[bool] = []
        words = entry.words(4)
        joints = self.builder.joints
        turns = joints.used_nodes & joints.has_rotations

        k = 0
        while k < len(words) and words[k].upper() not in ("UM", "ALPHA"):
            weight = real_number(words[k], entry.place)
            components = words[k + 1] if k + 1 < len(words) else "nothing"
            with_rotations = set("456") <= set(components)
            if set(components) & set("456") and not with_rotations:
                message = f"the weight of rotations (components 456) of RBE3 {entry.text(0)}"
                self.builder.report_once(message)
            is_mean = set(components) - set("456 ") == set("123")
            entry.needs(is_mean, f"independent nodes of RBE3 move by 123; got {components!r}.")
            start = k = k + 2
            while k < len(words) and "." not in words[k] and words[k][:1].isdigit():
                k += 1
                k += k < len(words) and words[k].upper() == "THRU"
            nodes = self._listed_rows(entry, words[start:k])
            rows += nodes
            weights += [weight] * len(nodes)
            turning += [with_rotations and bool(turns[n]) for n in nodes]

        entry.needs(rows and sum(weights) > 0, "RBE3 names no nodes with weights.")
        entry.needs(reference not in rows, "a GRID of RBE3 cannot follow itself.")
        table = np.array(rows, dtype=np.int64)
        leader = joints.leader_point(reference)
        joints.mean(leader, motions, table, np.array(weights), entry.place, np.array(turning))

    def _mpc(self, entry: Entry) -> None:
        """MPC: a linear constraint between motions."""
        terms: list[MotionTerm] = []
        for start in range(1, len(entry.fields), 8):
            for k in (start, start + 3):
                if entry.text(k):
                    row = self.nastran.node_in(entry, k)
                    motion = 0 if row in self.nastran.scalar_points else entry.integer(k + 1, 1) - 1
                    entry.needs(0 <= motion < 6, "MPC acts on components from 1 to 6.")
                    terms.append((row, motion, entry.real(k + 2)))
        entry.needs(terms and terms[0][2], "the first term of MPC needs a coefficient.")
        self.builder.joints.add_equation(terms, entry.place)

    def _add_scalars(self, element_kind: str) -> None:
        """Add springs, dampers or masses between two motions, or between one and the ground."""
        name, quantity = SCALAR_PROPERTIES[element_kind]
        properties = self.nastran.properties(name)
        builder = self.builder
        for entry in self.nastran.entries_named(*(f"{element_kind}{k}" for k in (1, 2, 3, 4))):
            if entry.name[-1] in "24":
                value = entry.real(1, None)
            else:
                property_entry = entry.find_property(name, properties)
                value = property_entry.real(1, None)
                if name == "PELAS" and property_entry.real(2):
                    builder.report_once(f"GE of PELAS {property_entry.text(0)}")
            ends = self.nastran.scalar_ends(entry)
            terms: list[MotionTerm] = []
            for (row, motion), sign in zip(ends, (1.0, -1.0), strict=False):
                axis = self.nastran.frame(row, entry.place)[motion % 3]
                first = 3 * (motion // 3)
                unit = builder.units.length if first and quantity == "mass" else 1.0
                terms += axis_terms(row, axis, first, sign * unit)
            if quantity != "mass":
                builder.add_link(entry.name, quantity, terms, value, entry.place)
                continue
            entry.needs(value >= 0, f"{entry.name} has a negative mass.")
            if value:
                # three of them, one along each axis, are one mass
                share = value / 3 if len(ends) == 1 and ends[0][1] < 3 else 0.0
                builder.add_scalar_mass(terms, value * self.mass_factor, share * self.mass_factor)

    def _add_bush(self, entry: Entry, prop: Entry) -> None:
        """Add springs and dampers at one place; CBUSH has rigid arms."""
        constants = self._bush_constants(entry.name, prop)
        on_line = entry.name == "CBUSH1D"  # between its nodes, without lever arms
        if on_line:  # the system is in another field
            fields = [*entry.fields[:4], "", "", "", entry.text(4)]
            entry = Entry(entry.name, entry.place, fields)
        is_active = [bool(k or c) for k, c in zip(*constants, strict=True)]
        rows = [self.nastran.node_in(entry, k) for k in (2, 3) if entry.text(k)]
        entry.needs(rows, f"{entry.name} acts on no node.")

        x = self.nastran.deck.points[rows]
        distant = len(rows) == 2 and np.linalg.norm(x[1] - x[0]) > 0
        is_bush = entry.name == "CBUSH"
        share = entry.real(8, 0.5) if is_bush else 0.5
        place = x[0] + share * (x[1] - x[0]) if distant else x[0]

        if is_bush and entry.integer(9, -1) >= 0:
            offset = np.array(entry.reals(10, 13))
            place = self.nastran.systems(entry.integer(9), entry.place).point(offset)
        axes = self._bush_axes(entry, is_active, x if distant else x[:1], place)
        for k in np.flatnonzero(is_active):
            axis = axes[k % 3]
            first = 3 * (int(k) // 3)
            terms: list[MotionTerm] = []
            for row, end_point, sign in zip(rows, x, (1.0, -1.0), strict=False):
                arm = np.cross(place - end_point, axis) if not first else np.zeros(3)
                distance = float(np.linalg.norm(place - end_point))
                if not on_line and np.linalg.norm(arm) > ROUNDING_ARM * distance:
                    row = self.builder.joints.leader_point(row)
                    terms += axis_terms(row, arm, 3, sign)
                terms += axis_terms(row, axis, first, sign)
            stiffness, damping = (values[k] for values in constants)
            for quantity, value in (("stiffness", stiffness), ("damping", damping)):
                if value:
                    self.builder.add_link(entry.name, quantity, terms, value, entry.place)

    def _bush_constants(self, name: str, prop: Entry) -> BushConstants:
        """(stiffnesses, dampings) of the six motions; ignored fields are reported."""
        report = self.builder.report_once
        values = {"K": [0.0] * 6, "B": [0.0] * 6}
        if name == "CBUSH1D":
            values["K"][0] = prop.real(1)
            values["B"][0] = prop.real(2)
            if prop.words(3):
                report(f"what of PBUSH1D {prop.text(0)} is not K or C")
        else:
            for start in range(0, len(prop.fields), 8):
                kind = prop.text(start + 1).upper()
                if kind in values:
                    values[kind] = prop.reals(start + 2, start + 8)
                elif kind == "GE":
                    report(f"GE of PBUSH {prop.text(0)}")
                elif kind != "RCV":
                    empty = not kind and not prop.words(start + 2, start + 8)
                    fault = f"PBUSH has K and B alone; its line {kind} would change the result."
                    prop.needs(empty, fault)
        return values["K"], values["B"]

    def _bush_axes(self, entry: Entry, acts: list[bool], x: Array, place: Array) -> Array:
        """Axes (3, 3), as rows: the system CID, axes of the line between the nodes, or the deck's.

        `acts` (6,): motions with a spring; `x`: the ends (1 or 2, 3); `place` (3,): of the springs.
        """
        if entry.text(7):
            return self.nastran.systems(entry.integer(7), entry.place).frame(place)
        acts_transversely = any(acts[k] for k in (1, 2, 4, 5))
        oriented = any(entry.text(k) for k in (4, 5, 6))
        if len(x) == 1 and not oriented and not (entry.name == "CBUSH1D" and entry.text(3)):
            return np.eye(3)
        has_axes = len(x) > 1 and (oriented or not acts_transversely)
        need = f"{entry.name} needs the system CID, or an orientation between nodes apart."
        entry.needs(has_axes, need)
        line = (x[1] - x[0]) / np.linalg.norm(x[1] - x[0])
        v = np.eye(3)[int(np.argmin(np.abs(line)))]
        if oriented:
            v = plane_1_vector(self.nastran, entry, line)
        y = v - (v @ line) * line
        y /= np.linalg.norm(y)
        return np.stack([line, y, np.cross(line, y)])

    def _conm2(self, entry: Entry) -> None:
        """CONM2: a rigid body whose centre of mass may be offset from its node."""
        row = self.nastran.node_in(entry, 1)
        mass = entry.real(3) * self.mass_factor
        offset = np.array(entry.reals(4, 7))
        J = symmetric(np.array(entry.reals(8, 14)) * self.mass_factor)
        J = 2 * np.diag(np.diag(J)) - J
        number = entry.integer(2, 0)

        if number == -1:  # the place of the mass
            offset = offset - self.nastran.deck.points[row] if entry.words(4, 7) else np.zeros(3)
        elif number:
            axes = self.nastran.axes(entry, number)
            offset = offset @ axes
            J = axes.T @ J @ axes
        negative = mass < 0 or np.linalg.eigvalsh(J).min() < -INERTIA_ROUNDING * np.abs(J).max()
        entry.needs(not negative, "the mass or the inertia of CONM2 is negative.")
        is_simple = not offset.any() and not (J - np.diag(np.diag(J))).any()

        if is_simple and (self.builder.has_rotations[row] or not J.any()):
            if mass or J.any():
                self.builder.add_mass(row, mass, np.diag(J).tolist(), entry.place)
            return
        arm_map = np.hstack([np.eye(3), lever_matrix(offset)])
        M = mass * arm_map.T @ arm_map
        M[3:, 3:] += J
        self.builder.add_mass_matrix(row, M, mass, entry.place)


#: Rigid elements, in the order in which they are read.
RIGID_READERS = {
    "RBE2": NastranJoints._rbe2,
    "RBAR": NastranJoints._rbar,
    "RBE3": NastranJoints._rbe3,
}


def _motions(entry: Entry, text: str) -> tuple[int, ...]:
    """Motions (0 to 5) of the component digits 1 to 6 in a text; MeshError if it has none."""
    motions = motions_of(text, entry.place)
    entry.needs(motions and "0" not in text, f"{text!r} are not components from 1 to 6.")
    return tuple(motions)


def model_of(deck: NastranDeck, units: UnitSystem, defaults: MaterialDefaults) -> Model:
    """The deck's model in SI units; its groups and fixed nodes are added to the deck."""
    deck.account.refuse(CONTACT_ENTRIES, deck.deck)
    report_damping(deck.account, deck.bulk.entries)
    weight_to_mass = deck.parameter("WTMASS")
    factor = weight_to_mass.real(1, None) if weight_to_mass else 1.0

    ends = beams.separate_ends(deck)
    lumped = bool(deck.entries_named(*MASS_ENTRIES))
    builder = ModelBuilder(deck.deck, units, defaults, lumped)
    deck.set_groups()
    Properties(deck, builder, factor).read()
    builder.mark_nodes()
    _fix_supports(deck, builder)

    joints = NastranJoints(deck, builder, factor)
    joints.read()
    beams.join_ends(builder, ends)
    joints.read_masses()

    autospc = deck.parameter("AUTOSPC")
    if builder.truss and not (autospc and autospc.text(1).upper() == "NO"):
        fix_unresisted(builder)
    deck.deck.skipped.clear()
    builder.ignored += deck.account.ignored()
    return complete_model(builder)


def _fix_supports(deck: NastranDeck, builder: ModelBuilder) -> None:
    """Fix the motions of SPC, SPC1 and GRID, along the nodes' local axes."""
    for row in deck.systems_of:
        builder.joints.motion_axes[row] = deck.frame(row, deck.bulk.entries[0].place)
    grids = ((row, grid) for row, grid in enumerate(deck.grids) if grid.text(6))
    fixed = [(np.array([row]), grid.text(6), grid) for row, grid in grids]
    prescribed: list[DeckPlace] = []
    for number in sorted(deck.used_sets("SPC")):
        for rows, components, entry in deck.spc_constraints(number):
            entry.needs(len(rows), f"SPC1 {number} fixes a GRID that there is not.")
            fixed.append((rows, components, entry))
            if entry.name == "SPC" and (entry.real(3) or entry.real(6)):
                prescribed.append(entry.place)
    for rows, components, entry in fixed:
        scalar = np.isin(rows, list(deck.scalar_points))
        builder.fix(rows[scalar], [0])
        builder.fix(rows[~scalar], motions_of(components, entry.place))
    builder.apply_local_supports()
    if prescribed:
        builder.ignored.append(f"the motion of SPC ({lines_text(prescribed)}), fixed instead")
