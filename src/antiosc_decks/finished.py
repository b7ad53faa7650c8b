"""The model of a deck, completed, checked and joined; rods.

Supports, joints and masses on nodes of elements that are not chosen are left out. A support on an
edge fixes the whole edge; a fixed middle node between free ends is fixed by a constraint.

Rods between other elements are springs with masses at their nodes; rods alone form a truss.
"""

from __future__ import annotations

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.io.conversion import Deck, folded
from antiosc.io.neutral import DIMENSION, EDGES, Json, Model, MotionTerm, connected_pieces
from antiosc_decks.builder import MOTION_NAMES, GroupSection, ModelBuilder
from antiosc_decks.constraints import count_pieces
from antiosc_decks.entries import DeckPlace
from antiosc_decks.sources import lines_text

#: Components of a rod's direction below this share of the largest are rounding errors.
DIRECTION_ROUNDING = 1e-8


def replace_rods(builder: ModelBuilder) -> BoolArray:
    """Turn rods outside trusses into springs and masses; mask of these elements."""
    rods = np.zeros(builder.deck.n_elements, dtype=bool)
    deck = builder.deck
    masses: dict[int, tuple[float, DeckPlace]] = {}
    for block, members in deck.numbered():
        if block.role != "rod" or builder.truss:
            continue
        rods[members] = True
        for nodes, number in zip(block.corners.tolist(), builder.of_element[members], strict=True):
            family = builder.families[number]
            volume = _add_rod(builder, nodes, family)
            mass = family.arguments["rho"] / builder.units.density * volume
            for node in nodes:
                masses[node] = masses.get(node, (0.0,))[0] + mass / 2, family.place
        count = f"the {len(block)} {block.type} of {deck.name}"
        deck.remarks.append(f"{count} are springs, with their mass at their ends.")
    for node, (mass, place) in masses.items():
        if mass:
            builder.add_mass(node, mass, [0.0] * 3, place)
    return rods


def fix_unresisted(builder: ModelBuilder) -> None:
    """Fix motions along x, y, z that nothing resists, as AUTOSPC of Nastran does."""
    stiff = np.zeros((len(builder.used), 3))
    for block in builder.deck.blocks:
        extents = np.ptp(builder.deck.points[block.corners], axis=1)
        extents /= np.maximum(extents.max(axis=1, keepdims=True), np.finfo(float).tiny)
        np.add.at(stiff, block.corners, extents[:, None])
    joints = builder.joints
    for terms in (*joints.equations, *(terms for terms, _ in joints.springs)):
        for node, motion, _ in terms:
            if node < len(stiff) and motion < 3:
                stiff[node, motion] = 1.0
    for node, _ in joints.motion_alias:  # motions along axes of its own
        if node < len(stiff):
            stiff[node] = 1.0
    free = builder.used[:, None] & (stiff <= DIRECTION_ROUNDING) & ~builder.fixed[:, :3]
    if free.any():
        builder.fixed[:, :3] |= free
        message = f"{int(free.sum())} motions of nodes of {builder.deck.name} against which no rod"
        builder.deck.remarks.append(f"{message} is stiff are held (AUTOSPC).")


def _add_rod(builder: ModelBuilder, nodes: list[int], section: GroupSection) -> float:
    """Add springs for the elongation and twist of a rod; return its volume in the deck's unit."""
    units = builder.units
    given = section.arguments
    E = given["E"] / units.stress
    area = given["area"] / units.length**2
    twist = E / (2 * (1 + given["nu"])) * given["torsion"] / units.length**4

    a, b = nodes
    terms, length = builder.joints.elongation_terms(a, b, section.place)
    builder.add_link("a rod", "stiffness", terms, E * area / length, section.place)
    if twist and builder.has_rotations[nodes].all():
        terms, _ = builder.joints.elongation_terms(a, b, section.place, 3)
        builder.add_link("a rod", "stiffness", terms, twist / length, section.place)
    return area * length


#: (number of a point of no element, motions that are fixed).
FixedPoints = list[tuple[int, list[str]]]
#: What may be joined in one structure.
JOINABLE_ROLES = {"solid", "shell", "beam"}


def complete_model(builder: ModelBuilder) -> Model:
    """Complete the model of a deck."""
    _keep_elements(builder, builder.chosen)
    _refuse_uncovered(builder)
    if builder.truss and any([one.arguments.pop("torsion", 0.0) for one in builder.families]):
        builder.ignored.append("the torsion of rods, whose ends are hinges in a truss")
    _keep_elements(builder, ~replace_rods(builder))
    roles = {block.role for block in builder.deck.blocks if len(block)}

    if len(roles) > 1 and not roles <= JOINABLE_ROLES:
        kinds = " and ".join(sorted(roles))
        remedy = "plane elements are read alone: give each kind a deck of its own."
        raise MeshError(f"{builder.deck.name} has {kinds} elements in one structure; {remedy}")

    _fix_middle_nodes(builder)
    _drop_free_followers(builder)
    _drop_unconnected(builder)
    joints = builder.joints
    grounded = [element for element in joints.springs if len(element[0]) == 1]
    joins_nodes = len(joints.all_terms()) > len(grounded)  # anything that joins nodes

    mixed = "shell" in roles and _needs_two_meshes(builder.deck)
    stiffened = roles == {"shell", "beam"} and not mixed and not joins_nodes
    stiffened = stiffened and _are_beams_on_edges(builder)
    has_parts = mixed or (len(roles) > 1 and not stiffened)

    attached = [element[0] for element in builder.masses] + [terms[0][0] for terms, _ in grounded]
    off_elements = any(not builder.used[node] for node in attached)
    is_assembly = has_parts or off_elements or joins_nodes
    if is_assembly:
        _convert_masses(builder)
    if stiffened:
        _add_beam_shear(builder)

    plane = not builder.truss and not roles <= JOINABLE_ROLES
    count = 2 if plane else 3 if builder.truss or roles == {"solid"} else 6
    fixed_points = _fixed_points(builder, plane)
    pieces, supported = _pieces_and_supports(builder, count, fixed_points)
    if not is_assembly:
        joints.springs = []

    # N/m, and N m of rotations
    units = builder.units
    values = [units.force * units.length ** (1 if m > 2 else -1) for m in range(6)]
    alone = [] if is_assembly else grounded
    springs = [
        (_place_in_metres(builder, n), {MOTION_NAMES[m]: k * values[m]})
        for ((n, m, _),), k in alone
    ]

    groups: list[tuple[str, str, Json, str]] = []
    for number in np.unique(builder.of_element).tolist():
        name = builder.names[number]
        family = builder.families[number]
        elements = np.flatnonzero(builder.of_element == number)
        sets = builder.deck.element_sets
        if name not in sets or not np.array_equal(sets[name], elements):
            name = f"{name} ({family.place})"
            name = f"{name} {number}" if name in sets else name
            sets[name] = elements
        groups.append((name, family.kind, family.arguments, str(family.place)))

    return {
        "families": groups,
        "supports": _support_groups(builder, count),
        "masses": [(_place_in_metres(builder, n), mass, J) for n, _, mass, J in builder.masses],
        "springs": springs,
        "ignored": builder.ignored_texts(),
        "gdim": 2 if count == 2 else 3,
        "halve": "beam" in roles and not stiffened,
        "joined": is_assembly,
        "mixed": mixed,
        "joints": builder.joints.joints_in_si(builder.units),
        "apart": builder.apart,
        "fixed_points": fixed_points,
        "pieces": pieces,
        "held": supported,
    }


def _pieces_and_supports(
    builder: ModelBuilder, motion_count: int, fixed_points: FixedPoints
) -> tuple[int, bool]:
    """(number of pieces of the deck, whether there are several and each is supported).

    `motion_count`: motions of a node, 2, 3 or 6; `fixed_points`: fixed motions of points of no
    element.
    """
    joints = builder.joints
    nodes = len(builder.deck.points)
    x = np.vstack([builder.deck.points, *joints.added_points])
    has_motion, fixed = np.zeros((2, len(x), 6), dtype=bool)
    has_motion[:nodes, :motion_count] = True
    has_motion[:nodes, 3:] &= builder.has_rotations[:, None]
    fixed[:nodes] = builder.fixed
    loose = joints.loose_nodes()
    has_motion[loose] = True
    for number, motions in fixed_points:
        fixed[loose[-1 - number], [MOTION_NAMES.index(name) for name in motions]] = True
    rows = [*joints.equations, *(terms for terms, _ in joints.springs)]
    return count_pieces(builder.deck, x, has_motion, fixed, rows)


def _drop_free_followers(builder: ModelBuilder) -> None:
    """Remove the equations of a point on which nothing else acts, if it can satisfy them all."""
    joints = builder.joints
    other = [terms for terms, _ in [*joints.springs, *joints.dampers]]
    other += [terms for rows, _, _ in joints.masses for terms in rows]
    loaded = {n for terms in other for n, _, _ in terms} | {entry[0] for entry in builder.masses}
    loaded |= set(np.flatnonzero(builder.used | builder.fixed.any(axis=1)).tolist())
    equations: dict[int, list[list[MotionTerm]]] = {}
    for terms in joints.equations:
        nodes = {n for n, _, _ in terms}
        points = nodes - loaded
        alone = len(points) == 1 and nodes.isdisjoint(builder.apart)  # ends of beams have releases
        for point in points:
            equations.setdefault(point, []).append(terms if alone else [])

    for point, rows in equations.items():
        C = np.zeros((len(rows), 6))
        for row, terms in zip(C, rows, strict=True):
            for n, m, c in terms:
                row[m] += c * (n == point)
        if C.any(axis=1).all() and len(rows) == np.linalg.matrix_rank(C) < C.any(axis=0).sum():
            joints.equations = [terms for terms in joints.equations if terms not in rows]


def _drop_unconnected(builder: ModelBuilder) -> None:
    """Remove masses and joints joined to no element, and dampers with a massless end."""
    joints = builder.joints
    used = builder.used
    node_rows = [np.array([[n for n, *_ in terms]]) for terms in joints.all_terms() if terms]
    label = connected_pieces(node_rows, len(used) + len(joints.added_points))
    is_connected = np.isin(label, label[: len(used)][used])

    def moves(node: int) -> bool:
        return bool(is_connected[joints.actual(node, 0)[0]])

    held = [e for e in builder.masses if not used[e[0]] and builder.fixed[e[0], :3].all()]
    builder.ignored += [f"a mass on a held node of no element ({entry[1]})" for entry in held]
    if unjoined := [entry[1] for entry in builder.masses if not moves(entry[0])]:
        builder.ignored.append(f"masses that nothing joins to an element ({lines_text(unjoined)})")
    builder.masses = [e for e in builder.masses if moves(e[0]) and e not in held]

    count = joints.keep_terms(lambda terms: any(moves(n) for n, _, _ in terms))
    loaded = {(n, m) for terms in joints.all_terms(dampers=False) for n, m, _ in terms}
    for node, _, mass, inertia in builder.masses:
        loaded |= {(node, c) for c, m in enumerate([mass] * 3 + inertia) if m}

    # the ends of a damper have mass, or a spring or constraint acts on them
    on_elements = set(np.flatnonzero(used).tolist())
    dampers = [
        entry
        for entry in joints.dampers
        if all(n in on_elements or (n, m) in loaded for n, m, _ in entry[0])
    ]
    count += len(joints.dampers) - len(dampers)
    joints.dampers = dampers
    if count:
        what = "springs, dampers, masses and constraints that nothing joins to an element"
        builder.ignored.append(f"{count} {what}")


def _convert_masses(builder: ModelBuilder) -> None:
    """Convert point masses to mass matrices at numbered nodes."""
    units = builder.units
    masses, builder.masses = builder.masses, []
    for node, place, mass, inertia in masses:
        M = np.diag([mass] * 3 + [value / units.length**2 for value in inertia]) / units.mass
        builder.add_mass_matrix(node, M, mass / units.mass, place)


def _place_in_metres(builder: ModelBuilder, node: int) -> list[float]:
    """Coordinates of a node in m."""
    return [float(c) * builder.units.length for c in builder.deck.points[node]]


def _are_beams_on_edges(builder: ModelBuilder) -> bool:
    """Whether all beams lie on edges of shells."""
    edges: dict[bool, set[tuple[int, int]]] = {True: set(), False: set()}
    for block in builder.deck.blocks:
        ends = block.corners[:, np.array(EDGES[block.shape])].reshape(-1, 2)
        edges[block.shape == "line"].update(map(tuple, np.sort(ends, axis=1).tolist()))
    return edges[True] <= edges[False]


def _add_beam_shear(builder: ModelBuilder) -> None:
    """Let beams on edges of shells deform in shear, as the shells do."""
    for family in builder.families:
        if family.kind == "Beam" and not family.arguments.get("shear", True):
            family.arguments["shear"] = True
            told = f"the rigidity in shear of beams on edges of shells ({family.place})"
            builder.ignored.append(told)


def _fixed_points(builder: ModelBuilder, plane: bool) -> FixedPoints:
    """[(number of a point of no element, its motions that are fixed or free of forces)]."""
    joints = builder.joints
    loose = {node: -1 - k for k, node in enumerate(joints.loose_nodes())}
    loaded = {(n, m) for terms in joints.all_terms() for n, m, _ in terms}
    held = {(n, m) for n in loose for m in range(6) if (n, m) not in loaded}
    fixed = zip(*(axis.tolist() for axis in np.nonzero(builder.fixed)), strict=True)
    held |= {joints.actual(*motion) for motion in fixed}

    motions = (0, 1, 5) if plane else range(6)
    points = []
    for node, number in loose.items():
        names = sorted(MOTION_NAMES[m] for m in motions if (node, m) in held)
        if names:
            points.append((number, names))
    return points


def _refuse_uncovered(builder: ModelBuilder) -> None:
    """Raise MeshError for elements without a section or without a family."""
    for block, rows in builder.deck.numbered():
        label = f"{len(block)} {block.type} elements"
        if block.role == "other":
            raise MeshError(f"{builder.deck.name} has {label}, which no family here carries.")
        if uncovered := int((builder.of_element[rows] < 0).sum()):
            message = "have no section, so their material is not known."
            raise MeshError(f"{builder.deck.name}: {uncovered} of {label} {message}")


def _support_groups(builder: ModelBuilder, motion_count: int) -> list[tuple[str, list[str]]]:
    """[(group, [motion])], one group of fixed nodes for each motion of a node.

    Motions have separate groups, since an edge is fixed where all its nodes are.
    """
    fixed = builder.fixed[:, :motion_count] & builder.used[:, None]
    motions = [k for k in range(motion_count) if fixed[:, k].any()]
    for k in motions:
        builder.deck.fixed[f"fixed {MOTION_NAMES[k]}"] = np.flatnonzero(fixed[:, k])
    return [(f"fixed {MOTION_NAMES[k]}", [MOTION_NAMES[k]]) for k in motions]


def _keep_elements(builder: ModelBuilder, mask: BoolArray) -> None:
    """Keep the elements of `mask`; remove the others, and joints and masses only on their nodes."""
    if mask.all():
        return
    deck = builder.deck
    blocks = [block[mask[rows]] for block, rows in deck.numbered()]
    deck.blocks = [block for block in blocks if len(block)]
    number = np.cumsum(mask) - 1
    sets = deck.element_sets.items()
    deck.element_sets = {name: number[members[mask[members]]] for name, members in sets}
    builder.of_element = builder.of_element[mask]

    gone = set(np.flatnonzero(builder.gone).tolist())
    count = builder.joints.keep_terms(lambda terms: not any(n in gone for n, *_ in terms))
    masses = [entry for entry in builder.masses if entry[0] not in gone]
    count += len(builder.masses) - len(masses)
    builder.masses = masses
    if count:
        what = "constraints, springs, dampers or masses on parts that are left out"
        builder.ignored.append(f"{count} {what}")


def _fix_middle_nodes(builder: ModelBuilder) -> None:
    """Add constraints for fixed middle nodes of edges whose ends are not both fixed."""
    fixed = builder.fixed
    constrained: set[tuple[int, int]] = set()
    for block in builder.deck.blocks:
        if not block.mids.shape[1] or block.shape == "line":
            continue
        ends = block.corners[:, np.array(EDGES[block.shape])]  # (n, edges, 2)
        for motion in range(6):
            fixed_alone = (block.mids >= 0) & fixed[block.mids, motion]
            fixed_alone &= ~fixed[ends, motion].all(axis=2)
            constrained.update((int(node), motion) for node in np.unique(block.mids[fixed_alone]))
    for node, motion in sorted(constrained):
        if motion < 3 or builder.has_rotations[node]:
            builder.joints.equations.append([(node, motion, 1.0)])


def _needs_two_meshes(deck: Deck) -> bool:
    """Whether quadrilaterals and the few triangles beside them become two meshes.

    They do if there are no solids.
    """
    if any(DIMENSION[block.shape] == 3 for block in deck.blocks):
        return False
    sheets = [b for b in deck.blocks if DIMENSION[b.shape] == 2]
    triangles = sum(len(b) if b.shape == "triangle" else int(folded(b).sum()) for b in sheets)
    return 0 < 2 * triangles <= sum(map(len, sheets))
