"""Nastran decks as whole models: the model, and the supports of the first subcase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.io.deck import Array, Place, real_number, whole_number
from antiosc.io.neutral import Model, Term, UnitSystem
from antiosc_decks import nastran_beams as beams
from antiosc_decks.builder import ModelBuilder, add_mass, add_total
from antiosc_decks.constraints import along, lever
from antiosc_decks.finished import finished, hold_without_stiffness
from antiosc_decks.nastran_beams import orientation
from antiosc_decks.nastran_cards import Entry, motions_of, tell_damping, through
from antiosc_decks.nastran_mesh import SETS, NastranDeck, place_in
from antiosc_decks.nastran_properties import Properties
from antiosc_decks.properties import symmetric
from antiosc_decks.sources import lines

#: The motions of a node: three displacements, three rotations.
ALL = (0, 1, 2, 3, 4, 5)
#: Share of an arm below which it lies along the spring.
ROUNDING_ARM = 1e-9
#: Share of the largest moment of inertia that a negative one may have by rounding.
INERTIA_ROUNDING = 1e-6
#: Element -> its property, and what it gives.
SCALAR = {
    "CELAS": ("PELAS", "stiffness"),
    "CDAMP": ("PDAMP", "damping"),
    "CMASS": ("PMASS", "mass"),
}
#: Elements along axes at their place -> their property.
BUSHES = {"CVISC": "PVISC", "CBUSH1D": "PBUSH1D", "CBUSH": "PBUSH", "CGAP": "PGAP"}
#: Those of them that act along their line, without arms.
ON_LINE = ("CVISC", "CBUSH1D")
#: Entries that give masses.
MASSES = ("CONM1", "CONM2", "CMASS1", "CMASS2", "CMASS3", "CMASS4")
#: Stiffnesses and dampings of the six motions.
Constants = tuple[list[float], list[float]]


@dataclass
class Joints:
    """Gives the builder what entries join; masses times `factor` (PARAM,WTMASS)."""

    found: NastranDeck
    builder: ModelBuilder
    factor: float

    def read(self) -> None:
        """Rigid elements, constraints, springs and dampers."""
        deck = self.found
        for name, rigid in RIGID.items():
            for entry in deck.named(name):
                rigid(self, entry)
        for follower, node in deck.coincident():
            self._follow([follower], node, ALL, deck.grids[follower], own=False)
        used = deck.used_sets("MPC")
        for entry in deck.named("MPC"):
            if entry.whole(0) in used:
                self._mpc(entry)
        for kind in ("CELAS", "CDAMP"):
            self._scalars(kind)
        for kind, name in BUSHES.items():
            known = deck.properties(name)
            for entry in deck.named(kind):
                self._bush(entry, entry.its_property(name, known))

    def read_masses(self) -> None:
        """Masses at nodes, and those spread over elements."""
        for entry in self.found.named("CONM2"):
            self._at_a_point(entry)
        for entry in self.found.named("CONM1"):
            self._matrix(entry)
        self._scalars("CMASS")
        used = self.found.used_sets("NSM")
        for entry in self.found.named(*SETS["NSM"]):
            if entry.whole(0) in used:
                self._nonstructural(entry)

    def _follow(
        self, rows: list[int], node: int, motions: tuple[int, ...], entry: Entry, own: bool = True
    ) -> None:
        """Motions of nodes follow another node as a rigid body."""
        entry.needs(node not in rows, f"a GRID of {entry.name} cannot follow itself.")
        leader = self.builder.joints.leader(node)
        followers = np.array(rows, dtype=np.int64)
        frames = self.builder.joints.frames if own else {}
        self.builder.joints.rigid(followers, leader, motions, frames)

    def _nodes(self, entry: Entry, words: list[str]) -> list[int]:
        """Rows of a list of GRIDs, with THRU, of which those within need not exist."""
        rows: list[int] = []
        for first, last in through(words, entry.place):
            rows.append(self.found.row(first, entry.place))
            some = first + entry.place.scope + 1, last + entry.place.scope
            rows += map(int, self.found.nodes.between(*some) if last > first else ())
        return rows

    def _rbe2(self, entry: Entry) -> None:
        motions = _motions(entry, entry.text(2))
        words = entry.words(3)
        if words and "." in words[-1]:
            words.pop()  # the coefficient of thermal expansion
        self._follow(self._nodes(entry, words), self.found.at(entry, 1), motions, entry)

    def _seconct(self, entry: Entry) -> None:
        """Pairs of nodes of two superelements that SECONCT makes one node."""
        words = entry.words(8)
        plain = "THRU" not in map(str.upper, words) and len(words) % 2 == 0
        entry.needs(plain, "SECONCT is read as pairs of nodes.")
        places = [place_in(self.found.bulk.entries, entry, k) for k in (0, 1)]
        for pair in zip(words[::2], words[1::2], strict=True):
            both = zip(pair, places, strict=True)
            follower, leader = (self.found.row(whole_number(word, at), at) for word, at in both)
            if follower != leader:
                self._follow([follower], leader, ALL, entry, own=False)

    def _rbar(self, entry: Entry) -> None:
        first, second = self.found.at(entry, 1), self.found.at(entry, 2)
        leads, follows, dependent = (entry.text(k) for k in (3, 4, 6))
        if not leads and follows:
            first, second, leads, follows = second, first, follows, leads
            dependent = entry.text(5)
        plain = set(leads) - {" "} == set("123456") and not follows
        entry.needs(plain, "RBAR is read with CNA or CNB = 123456 only.")
        motions = _motions(entry, dependent) if dependent else ALL
        self._follow([second], first, motions, entry)

    def _rbe3(self, entry: Entry) -> None:
        reference = self.found.at(entry, 2)
        motions = _motions(entry, entry.text(3))
        rows: list[int] = []
        weights: list[float] = []
        turning: list[bool] = []
        words = entry.words(4)
        k = 0
        while k < len(words) and words[k].upper() not in ("UM", "ALPHA"):
            weight = real_number(words[k], entry.place)
            components = words[k + 1] if k + 1 < len(words) else "nothing"
            turn = set("456") <= set(components)
            if set(components) & set("456") and not turn:
                message = f"the weight of rotations (components 456) of RBE3 {entry.text(0)}"
                self.builder.tell_once(message)
            plain = set(components) - set("456 ") == set("123")
            entry.needs(plain, "RBE3 is read where the independent nodes move by 123; got "
                        f"{components!r}.")  # fmt: skip
            start = k = k + 2
            while k < len(words) and "." not in words[k] and words[k][:1].isdigit():
                k += 1
                k += k < len(words) and words[k].upper() == "THRU"
            nodes = self._nodes(entry, words[start:k])
            rows += nodes
            weights += [weight] * len(nodes)
            joints = self.builder.joints
            turning += [turn and joints.used[n] and joints.has_rotations[n] for n in nodes]
        entry.needs(rows and sum(weights) > 0, "RBE3 names no nodes with weights.")
        entry.needs(reference not in rows, "a GRID of RBE3 cannot follow itself.")
        joints, table = self.builder.joints, np.array(rows, dtype=np.int64)
        leader = joints.leader(reference)
        joints.mean(leader, motions, table, np.array(weights), entry.place, np.array(turning))

    def _mpc(self, entry: Entry) -> None:
        terms: list[Term] = []
        for start in range(1, len(entry.fields), 8):
            for k in (start, start + 3):
                if entry.text(k):
                    row = self.found.at(entry, k)
                    motion = 0 if row in self.found.scalar else entry.whole(k + 1, 1) - 1
                    entry.needs(0 <= motion < 6, "MPC acts on components from 1 to 6.")
                    terms.append((row, motion, entry.real(k + 2)))
        entry.needs(terms and terms[0][2], "the first term of MPC needs a coefficient.")
        self.builder.joints.equation(terms, entry.place)

    def _scalars(self, kind: str) -> None:
        """Springs, dampers or masses between two motions, or of one against the ground."""
        name, what = SCALAR[kind]
        known, builder = self.found.properties(name), self.builder
        for entry in self.found.named(*(f"{kind}{k}" for k in (1, 2, 3, 4))):
            if entry.name[-1] in "24":
                value = entry.real(1, None)
            else:
                property_entry = entry.its_property(name, known)
                value = property_entry.real(1, None)
                if name == "PELAS" and property_entry.real(2):
                    builder.tell_once(f"GE of PELAS {property_entry.text(0)}")
            ends = self.found.scalar_ends(entry)
            terms: list[Term] = []
            for (row, motion), sign in zip(ends, (1.0, -1.0), strict=False):
                axis = self.found.frame(row, entry.place)[motion % 3]
                first = 3 * (motion // 3)
                unit = builder.units.length if first and what == "mass" else 1.0
                terms += along(row, axis, first, sign * unit)
            if what != "mass":
                builder.link(entry.name, what, terms, value, entry.place)
                continue
            entry.needs(value >= 0, f"{entry.name} has a negative mass.")
            if value:
                # three of them, one along each axis, are one mass
                share = value / 3 if len(ends) == 1 and ends[0][1] < 3 else 0.0
                builder.scalar_mass(terms, value * self.factor, share * self.factor)

    def _bush(self, entry: Entry, own: Entry) -> None:
        """Springs and dampers at one place, of CBUSH on rigid arms."""
        constants = self._constants(entry.name, own)
        if entry.name in ON_LINE:  # the system is in another field
            fields = [*entry.fields[:4], "", "", "", entry.text(4)]
            entry = Entry(entry.name, entry.place, fields)
        acts = [bool(k or c) for k, c in zip(*constants, strict=True)]
        rows = [self.found.at(entry, k) for k in (2, 3) if entry.text(k)]
        entry.needs(rows, f"{entry.name} acts on no node.")
        x = self.found.deck.points[rows]
        apart = len(rows) == 2 and np.linalg.norm(x[1] - x[0]) > 0
        own_place = entry.name == "CBUSH"
        share = entry.real(8, 0.5) if own_place else 0.5
        place = x[0] + share * (x[1] - x[0]) if apart else x[0]
        if own_place and entry.whole(9, -1) >= 0:
            offset = np.array(entry.reals(10, 13))
            place = self.found.systems(entry.whole(9), entry.place).point(offset)
        axes = self._bush_axes(entry, acts, x if apart else x[:1], place)
        for k in np.flatnonzero(acts):
            axis, first = axes[k % 3], 3 * (int(k) // 3)
            terms: list[Term] = []
            for row, where, sign in zip(rows, x, (1.0, -1.0), strict=False):
                arm = np.cross(place - where, axis) if not first else np.zeros(3)
                armed = entry.name not in ON_LINE
                if armed and np.linalg.norm(arm) > ROUNDING_ARM * np.linalg.norm(place - where):
                    row = self.builder.joints.leader(row)
                    terms += along(row, arm, 3, sign)
                terms += along(row, axis, first, sign)
            stiffness, damping = (values[k] for values in constants)
            for what, value in (("stiffness", stiffness), ("damping", damping)):
                if value:
                    self.builder.link(entry.name, what, terms, value, entry.place)

    def _constants(self, name: str, own: Entry) -> Constants:
        """(stiffnesses, dampings) of the six motions; what is not taken is told."""
        tell = self.builder.tell_once
        values = {"K": [0.0] * 6, "B": [0.0] * 6}
        if name == "CVISC":  # along the line, and against the twist about it
            values["B"][0], values["B"][3] = own.real(1), own.real(2)
        elif name == "CBUSH1D":
            values["K"][0], values["B"][0] = own.real(1), own.real(2)
            if own.words(3):
                tell(f"what of PBUSH1D {own.text(0)} is not K or C")
        elif name == "CGAP":
            # a spring by its first state in linear solutions: Altair OptiStruct 2021, CGAP,
            # comment 1; Autodesk Nastran Reference Guide, CGAP, remark 1; KT = MU1 KA: PGAP of both
            is_open = own.real(1) > 0
            normal = own.real(4) if is_open else own.real(3, 1e8)
            across = 0.0 if is_open else own.real(5, own.real(6) * normal)
            values["K"][:3] = normal, across, across
            tell(f"the contact in CGAP of PGAP {own.text(0)}, which stay "
                 f"{'open' if is_open else 'closed'}, as at first")  # fmt: skip
        else:
            for start in range(0, len(own.fields), 8):
                kind = own.text(start + 1).upper()
                if kind in values:
                    values[kind] = own.reals(start + 2, start + 8)
                elif kind == "GE":
                    tell(f"GE of PBUSH {own.text(0)}")
                elif kind != "RCV":
                    none = not kind and not own.words(start + 2, start + 8)
                    own.needs(none, "PBUSH is read with stiffnesses (K) and dampers (B) alone; its "
                              f"line {kind or '(?)'} would change the result.")  # fmt: skip
        return values["K"], values["B"]

    def _bush_axes(self, entry: Entry, acts: list[bool], x: Array, place: Array) -> Array:
        """Axes as rows: of a system, by a line and a vector, or of the deck; `acts`: of the six."""
        if entry.text(7):
            return self.found.systems(entry.whole(7), entry.place).frame(place)
        across = any(acts[k] for k in (1, 2, 4, 5))
        oriented = any(entry.text(k) for k in (4, 5, 6))
        if len(x) == 1 and not oriented and not (entry.name in ON_LINE and entry.text(3)):
            return np.eye(3)
        known = len(x) > 1 and (oriented or not across)
        entry.needs(known, f"{entry.name} needs the system CID at coincident nodes or to the "
                    "ground, and CID or an orientation between nodes apart, unless it acts along "
                    "their line alone.")  # fmt: skip
        line = (x[1] - x[0]) / np.linalg.norm(x[1] - x[0])
        v = np.eye(3)[int(np.argmin(np.abs(line)))]
        if oriented:
            v = orientation(self.found, entry, line)
        y = v - (v @ line) * line
        y /= np.linalg.norm(y)
        return np.stack([line, y, np.cross(line, y)])

    def _at_a_point(self, entry: Entry) -> None:
        """CONM2: a rigid body, whose centre of mass may lie beside its node."""
        row = self.found.at(entry, 1)
        mass = entry.real(3) * self.factor
        offset = np.array(entry.reals(4, 7))
        J = symmetric(np.array(entry.reals(8, 14)) * self.factor)
        J = 2 * np.diag(np.diag(J)) - J
        number = entry.whole(2, 0)
        if number == -1:  # the place of the mass
            offset = offset - self.found.deck.points[row] if entry.words(4, 7) else np.zeros(3)
        elif number:
            axes = self.found.axes(entry, number)
            offset, J = offset @ axes, axes.T @ J @ axes
        small = mass < 0 or np.linalg.eigvalsh(J).min() < -INERTIA_ROUNDING * np.abs(J).max()
        entry.needs(not small, "the mass or the inertia of CONM2 is negative.")
        plain = not offset.any() and not (J - np.diag(np.diag(J))).any()
        if plain and (self.builder.has_rotations[row] or not J.any()):
            if mass or J.any():
                self.builder.mass(row, mass, np.diag(J).tolist(), entry.place)
            return
        moved = np.hstack([np.eye(3), lever(offset)])
        M = mass * moved.T @ moved
        M[3:, 3:] += J
        self.builder.body(row, M, mass, entry.place)

    def _matrix(self, entry: Entry) -> None:
        """CONM1: a mass matrix of one node."""
        M = symmetric(np.array(entry.reals(3, 24)) * self.factor)
        if entry.whole(2, 0):
            six = np.kron(np.eye(2), self.found.axes(entry, entry.whole(2)))
            M = six.T @ M @ six
        small = np.linalg.eigvalsh(M).min() < -INERTIA_ROUNDING * np.abs(M).max()
        entry.needs(not small, "the matrix of CONM1 is not that of a mass: it has a negative "
                    "eigenvalue.")  # fmt: skip
        self.builder.body(self.found.at(entry, 1), M, float(np.trace(M[:3, :3])) / 3, entry.place)

    def _nonstructural(self, entry: Entry) -> None:
        """NSM and NSML: pairs of a number and a mass; NSM1 and NSML1: one mass of several."""
        words = [entry.text(k).upper() for k in range(2, len(entry.fields))]
        if entry.name in ("NSM1", "NSML1"):
            shared = [([word for word in words[1:] if word], words[0])]
        else:
            shared = [([words[k]], words[k + 1]) for k in range(0, len(words) - 1, 2) if words[k]]
        for numbers, mass in shared:
            elements = np.flatnonzero(self._named(entry, numbers))
            value = real_number(mass, entry.place) * self.factor
            if entry.name.startswith("NSML"):
                add_total(self.builder, elements, value, entry.place, "measure")
            else:
                add_mass(self.builder, elements, value, 0, entry.place)

    def _named(self, entry: Entry, words: list[str]) -> BoolArray:
        """The elements that a list of numbers of elements or properties names."""
        kind = entry.text(1).upper()
        of_element, of_property = kind in ("ELEMENT", "CONROD"), kind.startswith("P")
        entry.needs(of_element or of_property,
                    f"{entry.name} is read of properties and elements; got {kind!r}.")  # fmt: skip
        properties = self.found.property_numbers()
        if of_element:
            properties = np.array([one.whole(0) for one in self.found.elements], dtype=np.int64)
        if words == ["ALL"]:
            numbers = {one.whole(0) for one in self.found.named(kind)}
            return (
                np.isin(properties, list(numbers))
                if of_property
                else np.ones(len(properties), dtype=bool)
            )
        entry.needs("BY" not in words, f"{entry.name} is read without BY; list the numbers.")
        chosen = np.zeros(len(properties), dtype=bool)
        for first, last in through(words, entry.place):
            some = (properties >= first) & (properties <= last)
            entry.needs(some.any(), f"{entry.name} names {kind} {first}, of no element.")
            chosen |= some
        return chosen


#: Rigid elements, in the order in which they are read.
RIGID = {"RBE2": Joints._rbe2, "RBAR": Joints._rbar, "RBE3": Joints._rbe3}
RIGID["SECONCT"] = Joints._seconct


def _motions(entry: Entry, text: str) -> tuple[int, ...]:
    motions = motions_of(text, entry.place)
    entry.needs(motions and "0" not in text, f"{text!r} are not components from 1 to 6.")
    return tuple(motions)


def model_of(found: NastranDeck, units: UnitSystem, density: float | None) -> Model:
    """The deck's model in SI units; its groups and fixed nodes go into the deck."""
    found.account.refuse()
    tell_damping(found.account, found.bulk.entries)
    weight_to_mass = found.parameter("WTMASS")
    factor = weight_to_mass.real(1, None) if weight_to_mass else 1.0
    ends = beams.divide(found)
    builder = ModelBuilder(found.deck, units, density, lumped=bool(found.named(*MASSES)))
    found.set_groups()
    Properties(found, builder, factor).read()
    builder.find_nodes()
    _supports(found, builder)
    joints = Joints(found, builder, factor)
    joints.read()
    beams.join(builder, ends)
    joints.read_masses()
    autospc = found.parameter("AUTOSPC")
    if builder.truss and not (autospc and autospc.text(1).upper() == "NO"):
        hold_without_stiffness(builder)
    found.deck.left.clear()
    builder.ignored += found.account.ignored()
    return finished(builder)


def _supports(found: NastranDeck, builder: ModelBuilder) -> None:
    for row in found.systems_of:
        builder.joints.frames[row] = found.frame(row, found.bulk.entries[0].place)
    fixed = [(np.array([row]), text, grid)
             for row, grid in enumerate(found.grids) if (text := grid.text(6))]  # fmt: skip
    moved: list[Place] = []
    for number in sorted(found.used_sets("SPC")):
        for rows, components, entry in found.constraints(number):
            entry.needs(len(rows), f"SPC1 {number} fixes a GRID that there is not.")
            fixed.append((rows, components, entry))
            if entry.name == "SPC" and (entry.real(3) or entry.real(6)):
                moved.append(entry.place)
    for rows, components, entry in fixed:
        scalar = np.isin(rows, list(found.scalar))
        builder.fix(rows[scalar], [0])
        builder.fix(rows[~scalar], motions_of(components, entry.place))
    builder.hold()
    if moved:
        builder.ignored.append(f"the motion of SPC ({lines(moved)}), fixed instead")
