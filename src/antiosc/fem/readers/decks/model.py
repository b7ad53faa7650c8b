"""Materials, sections, supports, masses and springs of a deck, in SI units.

The result consists of numbers, texts and lists, because the reading process returns it as JSON;
`antiosc.fem.assembly.from_deck` builds the structure from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antiosc.errors import MeshError
from antiosc.fem.readers.decks.choice import chosen_elements, keep, nodes_of_block, some_rows
from antiosc.fem.readers.decks.constraints import Constraints, Term
from antiosc.fem.readers.decks.deck import Array, Deck, IntArray, Place
from antiosc.fem.readers.decks.material import Material
from antiosc.fem.readers.decks.middles import hold_middles
from antiosc.fem.readers.decks.rods import Rods
from antiosc.fem.readers.shapes import EDGES
from antiosc.fem.readers.unit_system import UnitSystem

MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
#: Direction cosines below this are rounding.
LEAST_TERM = 1e-12
#: What may be joined in one structure.
JOINED = {"solid", "shell", "beam"}


@dataclass
class Family:
    """The section of a group of elements, as a class of antiosc and its arguments."""

    kind: str
    arguments: dict[str, Any]
    place: Place


@dataclass
class ModelBuilder:
    """Collects a model; `finished` returns it."""

    deck: Deck
    units: UnitSystem
    #: kg/m³, of materials without one
    density: float | None = None
    families: list[Family] = field(default_factory=list)
    #: number of the family of each element, -1 without one
    of_element: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    #: name of each family's group of elements
    names: list[str] = field(default_factory=list)
    #: (node, place, kg, [kg m²])
    masses: list[tuple[int, Place, float, list[float]]] = field(default_factory=list)
    #: (node, place, {motion: stiffness}), to the ground
    springs: list[tuple[int, Place, dict[str, float]]] = field(default_factory=list)
    #: what is ignored of joints
    joint_told: list[str] = field(default_factory=list)
    #: nodes that stay apart from others in their place
    apart: list[int] = field(default_factory=list)
    #: what is ignored, in the deck's terms
    ignored: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.of_element = np.full(self.deck.n_elements, -1, dtype=np.int64)
        self.fixed = np.zeros((len(self.deck.points), 6), dtype=bool)
        self.used = np.zeros(len(self.deck.points), dtype=bool)
        self.turning = np.zeros(len(self.deck.points), dtype=bool)
        self.joints = Constraints(self.deck, self.used, self.turning)
        self.rods = Rods(self.deck)
        self.chosen = chosen_elements(self.deck)
        self.gone = np.zeros(len(self.deck.points), dtype=bool)

    def with_roles(self, roles: Sequence[str]) -> None:
        """What the blocks of the deck are; nodes of shells and beams have rotations."""
        start = 0
        every = np.zeros(len(self.used), dtype=bool)
        for role, block in zip(roles, self.deck.blocks, strict=True):
            every[nodes_of_block(block)] = True
            own = nodes_of_block(some_rows(block, self.chosen[start : start + len(block)]))
            start += len(block)
            if role != "rod":
                self.used[own] = True
            else:
                every[own] = False
            if role in ("shell", "beam"):
                self.turning[own] = True
        #: nodes of elements that are not chosen alone
        self.gone = every & ~self.used

    def rho(self, material: Material) -> float:
        """Density in kg/m³."""
        if material.density:
            return material.density * self.units.density
        if self.density is not None:
            return self.density
        raise MeshError(
            f"{material.place}: the material {material.name!r} has no density, without which "
            "nothing can be struck; add it to the deck, or give read_model(..., density=…), kg/m³."
        )

    def elastic(self, material: Material, what: str) -> tuple[float, float]:
        """(E in Pa, nu) of a material that must be isotropic."""
        if material.constants is None:
            raise MeshError(
                f"{material.place}: the material {material.name!r} has no linear elasticity."
            )
        found = material.isotropic
        if found is None:
            raise MeshError(
                f"{material.place}: the material {material.name!r} is not isotropic, but {what} "
                "must be; only layers of shells may be orthotropic."
            )
        return found[0] * self.units.stress, found[1]

    def anisotropic(self, material: Material) -> list[list[float]] | None:
        """The stiffness of a solid with directions, Pa; None of an isotropic one."""
        if material.stiffness is not None:
            return (material.stiffness * self.units.stress).tolist()  # type: ignore[no-any-return]
        if material.constants is None or material.isotropic is not None:
            return None
        if not np.isfinite(material.constants).all():
            raise MeshError(
                f"{material.place}: the material {material.name!r} is given for layers alone, in "
                "plane stress, and cannot fill solids; give all nine constants."
            )
        E1, E2, E3, n12, n13, n23, G12, G13, G23 = material.constants
        S = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / G23, 1 / G13, 1 / G12])
        S[0, 1] = S[1, 0] = -n12 / E1
        S[0, 2] = S[2, 0] = -n13 / E1
        S[1, 2] = S[2, 1] = -n23 / E2
        C = np.linalg.inv(S)
        return ((C + C.T) / 2 * self.units.stress).tolist()  # type: ignore[no-any-return]

    def layer(self, material: Material, thickness: float, angle: float) -> dict[str, float]:
        """Arguments of a `Layer`; the thickness is in the deck's units."""
        if material.constants is None:
            raise MeshError(
                f"{material.place}: the material {material.name!r} has no linear elasticity."
            )
        E1, E2, _, nu12, _, _, *G = (float(c) for c in material.constants)
        G12, G13, G23 = (value * self.units.stress for value in G)
        return {
            "E1": E1 * self.units.stress,
            "E2": E2 * self.units.stress,
            "nu12": nu12,
            "G12": G12,
            "G13": G13,
            "G23": G23,
            "rho": self.rho(material),
            "thickness": thickness * self.units.length,
            "angle": angle,
        }

    def add(self, name: str, elements: IntArray, family: Family) -> None:
        """Set the section of elements; a later one replaces an earlier one."""
        self.of_element[elements] = len(self.families)
        self.families.append(family)
        self.names.append(name)

    def fix(self, nodes: IntArray, motions: Sequence[int]) -> None:
        """Fix motions (0 to 5) of nodes."""
        self.fixed[nodes[:, None], np.array(motions, dtype=np.int64)] = True

    def mass(self, node: int, mass: float, inertia: list[float], place: Place) -> None:
        """A point mass in the deck's units."""
        scaled = [value * self.units.mass * self.units.length**2 for value in inertia]
        self.masses.append((node, place, mass * self.units.mass, scaled))

    def body(self, node: int, matrix: Array, mass: float, place: Place) -> None:
        """A mass matrix (6, 6) of the motions of a node along the axes, in the deck's units.

        A node of solids has no rotations: its rotary inertia stays at rest.
        """
        size = np.array([1.0] * 3 + [self.units.length] * 3)
        M = matrix * np.outer(size, size) * self.units.mass
        own = [self.joints.alias.get((node, c), (node, c)) for c in range(6)]
        point = own[0][0]
        if point < len(self.used) and self.used[point] and not self.turning[point]:
            if M[3:, 3:].any():
                self.ignored.append(f"inertia ({place}) on a node of solids, which does not turn")
            M = np.where(np.add.outer(np.arange(6) >= 3, np.arange(6) >= 3), 0.0, M)
        kept = np.flatnonzero(M.any(axis=1))
        rows: list[list[Term]] = [[(*own[c], 1.0)] for c in kept]
        if rows:
            self.joints.masses.append((rows, M[np.ix_(kept, kept)], mass * self.units.mass))

    def scalar_mass(self, terms: list[Term], value: float, mass: float) -> None:
        """A mass on a sum of motions, of which `mass` counts, in the deck's units."""
        unit = self.units.mass
        alias = self.joints.alias
        own = [(*alias.get((n, m), (n, m)), c) for n, m, c in terms]
        if any(n >= len(self.used) or self.used[n] or not self.fixed[n, m] for n, m, _ in own):
            self.joints.masses.append(([own], np.array([[value * unit]]), mass * unit))

    def spring(self, node: int, motion: int, stiffness: float, place: Place) -> None:
        """A grounded spring in the deck's units."""
        unit = self.units.force / self.units.length
        if motion >= 3:
            unit = self.units.force * self.units.length
        self.springs.append((node, place, {MOTIONS[motion]: stiffness * unit}))

    def sprung(self, terms: Sequence[Term], stiffness: float, place: Place) -> None:
        """A spring against the sum of terms, in the deck's units; fixed motions drop out."""
        points = len(self.fixed)
        moving = [
            t for t in terms if abs(t[2]) > LEAST_TERM and not (t[0] < points and self.fixed[t[:2]])
        ]
        if len(moving) == 1:
            ((node, motion, coefficient),) = moving
            self.spring(node, motion, stiffness * coefficient**2, place)
        elif moving:
            self.joints.springs.append((moving, stiffness))

    def _drop_held_masses(self) -> None:
        """Masses on nodes of no element that do not move, as at the far ends of rods."""
        kept = []
        for one in self.masses:
            node, place = one[:2]
            if not self.used[node] and self.fixed[node, :3].all():
                self.ignored.append(f"a mass on a held node of no element ({place})")
            else:
                kept.append(one)
        self.masses = kept

    def _attach(self) -> None:
        """Masses and grounded springs as those between numbered nodes."""
        masses, self.masses = self.masses, []
        springs, self.springs = self.springs, []
        size = self.units.length
        for node, place, mass, inertia in masses:
            self._check(node, "a mass", place)
            own = np.diag([mass] * 3 + [value / size**2 for value in inertia])
            self.body(node, own / self.units.mass, mass / self.units.mass, place)
        for node, place, stiffness in springs:
            self._check(node, "a spring", place)
            for name, value in stiffness.items():
                motion = MOTIONS.index(name)
                unit = self.units.force * (size if motion >= 3 else 1 / size)
                end = self.joints.alias.get((node, motion), (node, motion))
                self.joints.springs.append(([(*end, 1.0)], value / unit))

    def _check(self, node: int, what: str, place: Place) -> None:
        """MeshError for a node that nothing holds."""
        node = self.joints.alias.get((node, 0), (node, 0))[0]
        if not (node < len(self.used) and self.used[node]) and node not in self.joints.loose():
            raise MeshError(
                f"{place}: {what} acts on a node of no element with a section; add the section."
            )

    def _point(self, node: int, what: str, place: Place) -> list[float]:
        """Coordinates of a node in m."""
        self._check(node, what, place)
        return [float(c) * self.units.length for c in self.deck.points[node]]

    def finished(self, roles: Sequence[str]) -> dict[str, Any]:
        """The model; `roles` of the deck's blocks: "solid", "shell", "beam", …

        Raises
        ------
        MeshError
            Elements without a section, or families that cannot be combined in a structure.
        """
        roles = list(roles)
        rods = self.rods.join(self, roles, self.chosen)
        roles = keep(self, self.chosen & ~rods, roles)
        self._refuse_uncovered(roles)
        present = {role for role, block in zip(roles, self.deck.blocks, strict=True) if len(block)}
        if len(present) > 1 and not present <= JOINED:
            raise MeshError(
                f"{self.deck.name} has {' and '.join(sorted(present))} elements in one structure; "
                "plane elements are read alone: give each kind a deck of its own."
            )
        hold_middles(self)
        stiffened = present == {"shell", "beam"} and not self.joints.every() and self._on_edges()
        several = len(present) > 1 and not stiffened
        joined = several or bool(self.joints.every())
        self._drop_held_masses()
        if joined:
            self._attach()
        joints = self.joints.finished(self.units)
        groups = []
        for number, (name, family) in enumerate(zip(self.names, self.families, strict=True)):
            elements = np.flatnonzero(self.of_element == number)
            if not len(elements):
                continue
            given = self.deck.element_sets.get(name)
            if given is None or not np.array_equal(given, elements):
                name = f"{name} ({family.place})"
                if name in self.deck.element_sets:
                    name = f"{name} {number}"
                self.deck.element_sets[name] = elements
            groups.append([name, family.kind, family.arguments, str(family.place)])
        count = 2 if not present <= JOINED else 3 if present == {"solid"} else 6
        return {
            "families": groups,
            "supports": self._supports(count),
            "masses": [[self._point(n, "a mass", at), *own] for n, at, *own in self.masses],
            "springs": [[self._point(n, "a spring", at), own] for n, at, own in self.springs],
            "ignored": self.ignored,
            "gdim": 2 if count == 2 else 3,
            "halve": "beam" in present and not stiffened,
            "joined": joined,
            "joints": joints,
            "apart": self.apart,
            "held_points": self._held_points(count == 2),
        }

    def _on_edges(self) -> bool:
        """Whether all lines are edges of faces."""
        edges: list[IntArray] = []
        lines: list[IntArray] = []
        for block in self.deck.blocks:
            ends = block.corners[:, np.array(EDGES[block.shape])].reshape(-1, 2)
            (lines if block.shape == "line" else edges).append(np.sort(ends, axis=1))
        sides = {(int(a), int(b)) for a, b in np.vstack(edges)}
        return all((int(a), int(b)) in sides for a, b in np.vstack(lines))

    def _held_points(self, plane: bool) -> list[Any]:
        """[[number of a point of no element, motions]] that are fixed, or that nothing acts on."""
        loose = self.joints.loose()
        acting = {(n, m) for terms in self.joints.every() for n, m, _ in terms}
        found: dict[int, set[str]] = {}
        for k, node in enumerate(loose):
            found[-1 - k] = {MOTIONS[m] for m in range(6) if (node, m) not in acting}
        for node, motion in zip(*np.nonzero(self.fixed), strict=True):
            own, turned = self.joints.alias.get((int(node), int(motion)), (int(node), int(motion)))
            if own in loose:
                found[-1 - loose.index(own)].add(MOTIONS[turned])
        known = {"x", "y", "rz"} if plane else set(MOTIONS)
        return [[n, sorted(held & known)] for n, held in found.items() if held & known]

    def _refuse_uncovered(self, roles: Sequence[str]) -> None:
        start = 0
        for role, block in zip(roles, self.deck.blocks, strict=True):
            if role == "other":
                raise MeshError(
                    f"{self.deck.name} has {len(block)} {block.type} elements, which no element "
                    "family here carries (solids, plane stress and strain, shells, beams)."
                )
            bare = int((self.of_element[start : start + len(block)] < 0).sum())
            if bare:
                raise MeshError(
                    f"{self.deck.name}: {bare} of {len(block)} {block.type} elements have no "
                    "section, so their material is not known."
                )
            start += len(block)

    def _supports(self, count: int) -> list[Any]:
        """[[group, motions]], one for each motion: an entity between nodes needs all of them."""
        fixed = self.fixed[:, :count] & self.used[:, None]
        supports = []
        for k in range(count):
            nodes = np.flatnonzero(fixed[:, k])
            if len(nodes):
                name = f"fixed {MOTIONS[k]}"
                self.deck.fixed[name] = nodes
                supports.append([name, [MOTIONS[k]]])
        return supports
