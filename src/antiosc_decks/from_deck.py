"""`read_model`: a deck of Abaqus, CalculiX or Nastran as a structure that is ready to be struck."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from inspect import signature
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike

from antiosc import (
    AnisotropicSolid,
    Beam,
    Damper,
    Laminate,
    Layer,
    PointMass,
    Section,
    Shell,
    Solid,
    Spring,
    Structure,
    Support,
    Truss,
)
from antiosc.base import process
from antiosc.base._types import Array, IntArray, SolverChoice
from antiosc.base.checks import (
    choice,
    flag,
    instance,
    list_of,
    path as checked_path,
    positive,
    shown,
    strength_range,
    whole,
)
from antiosc.base.errors import InputError, NotTakenWarning
from antiosc.base.materials import MaterialRecord, growth_like, same_kind, yielding
from antiosc.base.texts import count_text, engineering
from antiosc.extension import (
    AssembledMatrices,
    Attachment,
    Family,
    GivenSheet,
    assemble_checked,
    attachments_of,
    before_meshing,
    check_refinements,
    distributed,
    flattened,
    halved,
    numbered_elements,
    sound,
    with_cells_near,
    with_cells_of,
)
from antiosc.fem.assembly.joint import Joint
from antiosc.fem.platform import collective, on_root, warn
from antiosc.io.neutral import Model, Piece, RawMesh, Term, UnitSystem
from antiosc.io.reading import NumberedElements, pieces_error, positions, read_parts
from antiosc.io.request import Refinement
from antiosc_decks.shared_nodes import SAME_PLACE, TIED_NEAR, NodeConstraints, SharedNodes


@dataclass(frozen=True, eq=False)
class Nearest:
    """Function that gives each cell the direction of the nearest of n places.

    Both `places` [m] and `directions` are (n, 3).
    """

    places: ArrayLike
    directions: Sequence[Sequence[float]]

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Directions (3, n) at points (3, n)."""
        from scipy.spatial import cKDTree

        nearest = cKDTree(np.asarray(self.places)).query(x.T)[1]
        return np.asarray(self.directions)[nearest].T


def point_name(number: int) -> str:
    """Name of a reference point, whose number is negative."""
    return f"point {-number}"


def attachments(model: Model) -> list[PointMass | Spring | Damper]:
    """The masses and springs of a deck."""
    masses = [PointMass(point, mass, inertia) for point, mass, inertia in model["masses"]]
    return [*masses, *(Spring(at, stiffness) for at, stiffness in model["springs"])]


def joined(
    parts: Mapping[str, Structure],
    numbers: Mapping[str, IntArray],
    model: Model,
    supports: Sequence[Support],
    attached: Sequence[PointMass | Spring | Damper],
    solver: SolverChoice,
) -> Structure:
    """Assemble the parts of a deck with its joints; `supports` may name groups of any part."""
    joints = model["joints"]
    points = {point_name(-1 - k): x for k, x in enumerate(joints["points"])}
    deck_joints: list[Joint] = [
        NodeConstraints(
            joints["equations"],
            joints["springs"],
            list(points),
            numbers,
            joints["masses"],
            dict(joints.get("among", [])),
            joints["dampers"],
        )
    ]
    if len(parts) > 1:
        deck_joints.insert(0, SharedNodes(numbers))
    point_supports = [Support(point_name(point), fix) for point, fix in model["fixed_points"]]
    for name, part in parts.items():
        point_supports += [
            Support(f"{name}:{group}", fix)
            for group, fix in model["supports"]
            if part.mesh.groups.get(group) and set(fix) <= set(part.form.components)
        ]
    return assemble_checked(
        parts,
        deck_joints,
        points=points,
        supports=[*point_supports, *_of_parts(parts, supports)],
        attached=[*attachments(model), *attached],
        solver=solver,
        apart=model["held"],
    )


def _of_parts(parts: Mapping[str, Structure], supports: Sequence[Support]) -> list[Support]:
    """Supports whose group is replaced by the group of this name in each part that has it."""
    of_parts = []
    for support in supports:
        group = support.where
        owners: list[str] = []
        if isinstance(group, str):
            owners = [name for name, part in parts.items() if group in part.mesh.groups]
        of_parts += [replace(support, where=f"{name}:{group}") for name in owners] or [support]
    return of_parts


#: Structures of decks that keep their elements -> why.
_kept: WeakKeyDictionary[Structure, str] = WeakKeyDictionary()


def kept_elements(structure: Structure) -> str:
    """Why the elements of the deck of a structure cannot be halved; "" if they can, or without a
    deck.
    """
    return _kept.get(structure, "")


#: What may become of the contact of a deck.
ContactChoice: TypeAlias = Literal["tied", "apart"]
CONTACT_CHOICES: tuple[ContactChoice | None, ...] = ("tied", "apart", None)
#: Names of the parts of a deck whose cells are joined, by their dimension.
PARTS = {3: "solids", 2: "faces", 1: "beams"}
#: The family of bars with hinges, and why their elements stay.
TRUSS = Truss.__name__
HINGES = "its bars have hinges at their ends, which parts of them must not have"
#: Name of the part with the triangles, if there are quadrilaterals too.
TRIANGLES = "triangles"
FAMILIES: dict[str, Callable[..., Family]] = {
    family.__name__: family
    for family in (Solid, AnisotropicSolid, Shell, Truss, GivenSheet, Laminate, Beam)
}


@collective()
def read_model(
    path: str | Path,
    unit: str | float = "m",
    *,
    supports: Sequence[Support] = (),
    attached: Sequence[Attachment] = (),
    density: float | None = None,
    modulus: float | None = None,
    yield_strength: float | str | None = None,
    yield_range: tuple[float, float] | None = None,
    size: float | None = None,
    refine: Sequence[Refinement] = (),
    merge: float | None = None,
    parts: Sequence[str] | None = None,
    piece: int | None = None,
    contact: ContactChoice | None = None,
    free: bool = False,
    elements: NumberedElements | None = None,
    root: str | Path | None = None,
    solver: SolverChoice = "auto",
    timeout: float | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Structure:
    """The structure that a deck describes, with its supports, masses, springs and dampers.

    Parameters
    ----------
    path
        A deck of Abaqus or CalculiX (`.inp`), of Nastran (`.bdf`, `.nas`, `.fem`), or of
        Ansys (`.cdb`).
    unit
        Units of the deck: "m" (SI), "mm" (mm, N, t, MPa), "mm-kg" (mm, mN, kg, kPa), "mm-kgf"
        (mm, kgf, kgf/mm²), "cm" (cm, N), "in" (inch, pound-force, psi), "ft" (foot, pound-force,
        slug), or metres per unit of length (forces in N). Masses and densities follow: force =
        mass × length / s².
    supports, attached
        Added to those of the deck.
    density
        Density in kg/m³ of materials that state none.
    modulus
        Young's modulus in Pa of materials that state no elasticity, as those of thermal analyses;
        their Poisson's ratio is 0.3.
    yield_strength
        Yield strength in Pa of all isotropic materials, which decks do not state; margins and
        contacts that yield need it. It grows with the strain rate, in the error of the contact's
        law, as that of the material of the table with like E and density. Or the name of a material
        of the table (`antiosc materials`), whose strength, range and growth those get whose E and
        density differ from its own by 10 % or less.
    yield_range
        Lowest and highest yield strength of batches of these materials, Pa; of a name its own.
    size, refine, merge, timeout, comm
        As for `read_mesh`: materials, sections and supports follow the divided elements; a new node
        between nodes that a rigid body or an equation holds follows them. `size` halves no elements
        of decks that tie nodes to others in their place; `refine` keeps the edges between these.
    parts
        Names of parts, instances or sets of elements: only these are read. Constraints, springs
        and masses on nodes of other elements alone are left out; a warning counts them.
    piece
        Number of the piece to be read, if the elements form pieces without a common node: 1 for
        the largest, 2 for the next; the others are left out. Without it, several pieces are read
        if each of them is supported.
    contact
        Of the contact pairs of an Abaqus or CalculiX deck: "tied" joins those that are closed at
        first, as the card TIE does, "apart" leaves all contact out. A joint that stays pressed
        together is nearer to the first, one that opens or slides is between both. Without it a deck
        with contact is refused, unless one piece is read, whose contact is left out.
    free
        Whether to leave out the supports of the deck, as for a fall or an impact in flight.
    elements
        Further groups: name -> numbers of elements in the deck, in all of its instances.
    root
        Folder of the files that the deck may include; by default that of the deck, or the one above
        it where both are the user's own.
    solver
        As for `Structure`.

    The mesh's groups are the deck's sets; supports fix the motions that the deck fixes in its model
    and in its first step. B32 become two straight `Beam` elements each; a layered or orthotropic
    shell becomes a `Laminate`, one whose layers are of one isotropic material a `Shell`.

    Solids, shells and beams with common nodes, and elements joined by equations, multi-point
    constraints, rigid bodies, couplings, ties and springs, become one assembly of up to four parts:
    "solids", "faces", "triangles" (the few beside quadrilaterals) and "beams" (`Site(...,
    part=...)`). Constraints are linear, for small motions. If they determine all nodes of an edge
    or a face of an element, the whole edge or face follows by the element's shape functions; if
    they tie these nodes to one element at the same place, it follows that element's displacement.

    Raises
    ------
    MeshError
        As `read_mesh`; elements without a section, materials without elasticity or density, names
        of nodes, elements and sets that the deck does not define, and unsupported content that
        would change the result: contact without a choice (`contact`), element types
        that no family carries. The message names the line.

    Warns
    -----
    AntioscWarning
        Content of the deck that is ignored: loads, steps, nonlinear materials; cards and options
        that are unknown here; sets with missing members; sets of supports that are not selected.
        Each with its count and its lines.
    """
    instance("comm", comm, MPI.Comm, "an MPI communicator (mpi4py)")
    file = checked_path("path", path)
    read = _reader(
        file,
        unit,
        density=density,
        modulus=modulus,
        size=size,
        refine=refine,
        merge=merge,
        parts=parts,
        piece=piece,
        contact=contact,
        free=free,
        elements=elements,
        root=root,
        timeout=timeout,
    )
    strengths = Strengths.given(yield_strength, yield_range)
    added_supports = list_of("supports", supports, Support, "Support objects")
    added_attachments = attachments_of(attached)
    raws = on_root(comm, read)
    first = next(iter(raws.values()))
    model = _model(first)
    for sentence in first.remarks:
        warn(comm, sentence)
    if model["ignored"]:
        ignored = ", ".join(model["ignored"])
        warn(comm, f"of {file.name} are not taken: {ignored}.", NotTakenWarning)
    if told := _told_of_strength(raws.values(), strengths, file.name):
        warn(comm, told)

    def of_meshes(raws: Mapping[str, RawMesh]) -> Structure:
        structures = {
            name: _part(raw, file.name, comm, solver, added_supports, added_attachments, strengths)
            for name, raw in raws.items()
        }
        if not model["joined"]:
            return next(iter(structures.values()))
        numbers = {name: raw.numbers for name, raw in raws.items()}
        of_raws = _model(next(iter(raws.values())))
        return joined(structures, numbers, of_raws, added_supports, added_attachments, solver)

    structure = of_meshes(raws)
    if reason := not_halved(raws.values()):
        _kept[structure] = reason
    elif isinstance(structure.matrices, AssembledMatrices):
        structure.matrices.halved = lambda: of_meshes(_halved(raws))
    return structure


def outline_of_deck(
    path: str | Path, unit: str | float = "m", **options: Any
) -> tuple[list[str], list[RawMesh]]:
    """(group names, as supports and sites use them; cells by kind) of a deck.

    Nothing is assembled. `options` are those of `read_model`; the ones that reading does not need
    are ignored.
    """
    option_names = (
        "density",
        "modulus",
        "size",
        "refine",
        "merge",
        "parts",
        "piece",
        "contact",
        "free",
        "elements",
        "root",
        "timeout",
    )
    given_options = {name: options[name] for name in option_names if name in options}
    raws = _reader(checked_path("path", path), unit, **given_options)()
    names = dict.fromkeys(group for raw in raws.values() for group in raw.groups)
    if _model(next(iter(raws.values())))["joined"]:
        inner = [f"{name}:{group}" for name, raw in raws.items() for group in raw.groups]
        names |= dict.fromkeys(inner)
    return list(names), list(raws.values())


class DeckFacts(NamedTuple):
    """Facts of a deck.

    length : of the longest side of its largest part [m].
    not_halved : why its elements cannot be halved; "" if they can.
    divided : its elements that are divided into simplices, in words; "" if none are.
    pieces : those of which one is read, the largest first; none if all are.
    """

    families: list[Family]
    length: float
    not_halved: str
    divided: str
    pieces: Sequence[Piece]


#: Shapes of elements in words.
SHAPES = {
    "quad": "quadrilaterals",
    "hexahedron": "hexahedra",
    "wedge": "wedges",
    "pyramid": "pyramids",
}


def materials_of_deck(path: str | Path, unit: str | float = "m", **options: Any) -> DeckFacts:
    """The families of a deck, and facts about it.

    Nothing is assembled. Materials without a density are massless. `options` are those of
    `read_model` for its reader.
    """
    raws = _reader(checked_path("path", path), unit, **options, massless=True)()
    families = [family for raw in raws.values() for family in _families(raw, Strengths()).values()]
    longest = max(float(np.ptp(raw.points, axis=0).max()) for raw in raws.values())
    first = next(iter(raws.values()))
    model = _model(first)
    counts = model.get("divided", {}).items()
    words = (f"{count} {SHAPES[shape] if count > 1 else shape}" for shape, count in counts)
    divided = " and ".join(words)
    return DeckFacts(families, longest, not_halved(raws.values()), divided, first.pieces)


def _families(raw: RawMesh, strengths: Strengths) -> dict[str, Family]:
    """The family of each group of a part's cells."""
    model = _model(raw)
    return {
        group: _family(kind, arguments, place, strengths)
        for group, kind, arguments, place in model["families"]
        if not model["joined"] or raw.groups.get(group)
    }


def _reader(
    file: Path,
    unit: str | float,
    *,
    density: float | None = None,
    modulus: float | None = None,
    size: float | None = None,
    refine: Sequence[Refinement] = (),
    merge: float | None = None,
    parts: Sequence[str] | None = None,
    piece: int | None = None,
    contact: ContactChoice | None = None,
    free: bool = False,
    elements: NumberedElements | None = None,
    root: str | Path | None = None,
    timeout: float | None = None,
    massless: bool = False,
) -> Callable[[], dict[str, RawMesh]]:
    """A function that reads the deck into cells by part; checks the caller's arguments."""
    units = UnitSystem.of(unit)
    size, merge, density, modulus, timeout = (
        None if value is None else positive(name, value, unit_name)
        for name, value, unit_name in (
            ("size", size, "m"),
            ("merge", merge, "m"),
            ("density", density, "kg/m³"),
            ("modulus", modulus, "Pa"),
            ("timeout", timeout, "s"),
        )
    )
    if parts is not None:
        are_names = isinstance(parts, list | tuple) and all(
            isinstance(name_of_part, str) for name_of_part in parts
        )
        if not are_names or not parts:
            raise InputError(f"parts must be a list of names; got {shown(parts)}.")
        parts = list(parts)
    free = flag("free", free)
    contact = choice("contact", contact, CONTACT_CHOICES)
    check_refinements(refine)
    numbered = numbered_elements(elements)
    if piece is not None:
        piece = whole("piece", piece, least=1)
    if root is not None:
        folder = Path(checked_path("root", root)).resolve()
        if not os.path.isdir(folder):
            raise InputError(f"root must be a folder; there is none at {shown(str(root))}.")
        root = str(folder)

    def work() -> dict[str, RawMesh]:
        unstated = (density, modulus, massless)
        options = {"unstated": unstated, "parts": parts, "piece": piece, "root": root}
        options |= {"free": free, "contact": contact}
        meshes: dict[str, RawMesh] = {}
        by_shape = read_parts(
            file, unit=units, merge=merge, timeout=timeout, model=options, elements=numbered
        )
        for raw in by_shape.values():
            model = _model(raw)
            flat = flattened(raw, model["gdim"], file.name)
            if model["joined"] and model["pieces"] > 1 and not model["held"] and merge is None:
                raise pieces_error(
                    flat,
                    f"{file.name} falls into {model['pieces']} pieces that nothing joins, and "
                    "supports do not hold each",
                    "join or hold them (nodes that coincide: merge) or read one of them "
                    f"({_choices(flat)}).",
                )
            pieces = model["joined"] or model["held"]
            part = TRIANGLES if PARTS[raw.kind.dim] in meshes else PARTS[raw.kind.dim]
            meshes[part] = sound(flat, file.name, made_here=False, pieces=pieces, by=_choices(flat))
        raws = list(meshes.values())
        if size is not None:
            raws = _with_cells_of(size, raws, file.name)
        if refine:
            raws = _near(refine, raws, file.name)
        if size is not None or refine:
            _require_room(raws, file.name)
        return dict(zip(meshes, raws, strict=True))

    return work


def _with_cells_of(size: float, raws: Sequence[RawMesh], name: str) -> list[RawMesh]:
    """The parts of a deck with cells of at most `size` [m], and with the directions in each."""
    if reason := not_halved(raws):
        raise InputError(
            f"{name} keeps its elements, for {reason}: read it without a size, or mesh it in the"
            " program that made it."
        )
    return with_cells_of(size, raws, name, _finer)


def _require_room(raws: Sequence[RawMesh], name: str) -> None:
    """OutOfMemoryError unless matrices and factor of the divided parts fit in the free memory."""
    costs = [before_meshing(raw.kind.shape, raw.kind.dim, len(raw.cells), [0]) for raw in raws]
    cells = sum(len(raw.cells) for raw in raws)
    dofs = sum(count for count, _ in costs)
    process.require(
        sum(cost.bytes for _, cost in costs),
        f"{name} with {cells} cells, some {count_text(float(f'{dofs:.2g}'))} dofs,",
        "choose a larger size, or make cells smaller around the site alone (refine)",
    )


def _near(refine: Sequence[Refinement], raws: Sequence[RawMesh], name: str) -> list[RawMesh]:
    """The parts of a deck with smaller cells around points, but for edges between tied nodes."""
    model = _model(raws[0])
    if TRUSS in {kind for _, kind, _, _ in model["families"]}:
        raise InputError(f"{name} keeps its elements, for {HINGES}: read it without refine.")
    tied = [node for terms in _ties(model, raws) for node, _, _ in terms]
    return with_cells_near(refine, raws, name, tied, _finer)


def _halved(raws: Mapping[str, RawMesh]) -> dict[str, RawMesh]:
    """The parts of a deck with each element halved."""
    meshes = list(raws.values())
    return dict(zip(raws, _finer(meshes, halved(meshes)), strict=True))


def _finer(raws: Sequence[RawMesh], finer: Sequence[RawMesh]) -> list[RawMesh]:
    """Meshes `finer` with the model of the parts, and the directions in each of their cells."""
    model = _model(raws[0])
    families = [
        (group, kind, _in_each_cell(arguments, group, raws, finer), place)
        for group, kind, arguments, place in model["families"]
    ]
    return [replace(raw, model={**_model(raw), "families": families}) for raw in finer]


def not_halved(raws: Collection[RawMesh]) -> str:
    """Why the elements of a deck cannot be halved; "" if they can."""
    model = _model(next(iter(raws)))
    if tied := _ties(model, raws):
        count = len(tied)
        return f"{count} equations tie nodes to others in their place, and none those between them"
    if any(kind == TRUSS for _, kind, _, _ in model["families"]):
        return HINGES
    return ""


def _ties(model: Model, raws: Collection[RawMesh]) -> list[list[Term]]:
    """The equations by which a node follows others in its place."""
    equations = model["joints"]["equations"]
    places: dict[int, Array] = {}
    for raw in raws if equations else ():
        places |= dict(zip(raw.numbers.tolist(), raw.points, strict=True))
    size = max(float(np.ptp(raw.points, axis=0).max()) for raw in raws)
    tied = []
    for terms in equations:
        (node, motion, first), *others = terms
        shares = {n: -c / first for n, m, c in others if m == motion and n in places}
        if node not in places or not shares or len(shares) < len(others):
            continue
        leaders = np.array([places[n] for n in shares])
        weights = np.array([*shares.values()])
        off = np.linalg.norm(weights @ leaders - places[node])
        near = max(TIED_NEAR * np.ptp(leaders, axis=0).max(), SAME_PLACE * size)
        if abs(weights.sum() - 1) < TIED_NEAR and off < near:
            tied.append(terms)
    return tied


def _in_each_cell(
    arguments: dict[str, Any], group: str, raws: Sequence[RawMesh], finer: Sequence[RawMesh]
) -> dict[str, Any]:
    """Arguments of a section whose directions in elements are given in the cells of `finer`."""
    new = dict(arguments)
    for name in ("axis", "top"):
        if not isinstance(arguments.get(name), dict):
            continue
        of_old = Nearest(**arguments[name])
        places, directions = [], []
        for old, halves in zip(raws, finer, strict=True):
            rows = old.groups.get(group, {}).get(old.kind.dim)
            if rows is None:
                continue
            cells = halves.groups[group][old.kind.dim]
            vectors = of_old(old.points[rows].mean(axis=1).T).T
            parts = np.bincount(halves.parents, minlength=len(old.cells))
            counts = parts[positions(rows, old.cells[:, : old.kind.vertices])]
            directions += np.repeat(vectors, counts, axis=0).tolist()
            places += halves.points[cells].mean(axis=1).tolist()
        new[name] = {"places": places, "directions": directions}
    return new


def _choices(raw: RawMesh) -> str:
    """Text that names the arguments of `read_model` which choose a part of a deck."""
    sets = {name: len(members.get(raw.kind.dim, ())) for name, members in raw.groups.items()}
    names = [repr(name) for name, count in sets.items() if 0 < count < len(raw.cells)]
    sets_text = f"; parts names sets: {', '.join(names[:8])}{', …' * (len(names) > 8)}"
    return f"piece 1 is the largest{sets_text * bool(names)}"


def _model(raw: RawMesh) -> Model:
    """The model that `read_parts` reads with the cells."""
    assert raw.model is not None
    return raw.model


def _part(
    raw: RawMesh,
    name: str,
    comm: MPI.Comm,
    solver: SolverChoice,
    added_supports: Sequence[Support],
    added_attachments: Sequence[Attachment],
    strengths: Strengths,
) -> Structure:
    """The structure of one part's cells; parts to be joined get their supports later."""
    model = _model(raw)
    mesh = distributed(raw, name, comm)
    families = _families(raw, strengths)
    if model["joined"]:
        return Structure(mesh, families, solver=solver)
    supported = [Support(group, fix) for group, fix in model["supports"] if raw.groups.get(group)]
    attached = [*attachments(model), *added_attachments]
    return Structure(
        mesh, families, [*supported, *added_supports], attached=attached, solver=solver
    )


class Strengths(NamedTuple):
    """The yield strength that is given for the isotropic materials of a deck.

    strength, range : Pa; None: unknown, or exact.
    of : material of the table whose strength it is, of materials of its kind alone.
    """

    strength: float | None = None
    range: tuple[float, float] | None = None
    of: MaterialRecord | None = None

    @classmethod
    def given(cls, strength: float | str | None, ends: tuple[float, float] | None) -> Strengths:
        """Those of the arguments `yield_strength` and `yield_range` of `read_model`."""
        named = None
        if isinstance(strength, str):
            named = yielding(strength)
            strength, ends = named.yield_strength, ends or named.yield_range
        if strength is not None:
            strength = positive("yield_strength", strength, "Pa")
        if ends is not None:
            ends = strength_range(ends, strength)
        return cls(strength, ends, named)

    def suits(self, E: float, rho: float) -> bool:
        """Whether the strength is that of a material with this modulus [Pa] and density [kg/m³]."""
        return self.of is None or same_kind((E, self.of.E), (rho, self.of.rho))

    def options(self, family: Callable[..., Family], E: float, rho: float) -> dict[str, object]:
        """The arguments of a family that state the strength of its material; {}: it has none."""
        if self.strength is None or not self.suits(E, rho):
            return {}
        rate = self.of.rate if self.of else growth_like(E, rho, self.strength)
        options = {"yield_strength": self.strength, "yield_range": self.range, "rate": rate}
        known = signature(family).parameters
        return {name: value for name, value in options.items() if name in known}


#: What is told of a strength of several materials.
EACH_STRENGTH = (
    "what is said of yield, and contacts that yield, hold where this is the own strength of the"
    " material; the name of a material (yield_strength) is for those of its kind alone; to give"
    " each its own, read the mesh alone (read_mesh; in a scene [geometry] source) with a material"
    " for each group ([material.GROUP]), and the supports"
)


def _told_of_strength(raws: Iterable[RawMesh], given: Strengths, name: str) -> str:
    """Sentence that several materials of a deck have the strength that is given, or that some have
    none; "" of one material, or without a strength. InputError if none has it.
    """
    if given.strength is None:
        return ""
    families: list[Any] = [one for raw in raws for one in _families(raw, given).values()]
    able = sorted({(one.E, one.rho) for one in families if hasattr(one, "yield_strength")})
    strong, weak = ([one for one in able if given.suits(*one) is suits] for suits in (True, False))
    if given.of is None:
        value = engineering(given.strength, "Pa")
        told = (
            f"the yield strength {value} is taken for all {len(strong)} materials ({_told(strong)})"
        )
        return f"{told} of {name}: {EACH_STRENGTH}." if len(strong) > 1 else ""
    of_kind = f"a material like {given.of.name} ({given.of.line})"
    if not strong:
        raise InputError(f"{name} has not {of_kind}: {_told(weak)}; give yield_strength in Pa.")
    if not weak:
        return ""
    return f"some materials of {name} have no yield strength, as none is {of_kind}: {_told(weak)}."


def _told(materials: Sequence[tuple[float, float]]) -> str:
    """Young's moduli [Pa] and densities [kg/m³] of materials in words."""
    return ", ".join(f"E = {engineering(E, 'Pa')}, {rho:.4g} kg/m³" for E, rho in materials)


def _of_one_material(kind: str, values: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """(family, arguments) of a layered shell: those of a `Shell` if its layers are of one isotropic
    material, which then has a yield strength and a contact that yields.
    """
    first, *others = (replace(layer, thickness=1.0, angle=0.0) for layer in values["layers"])
    plain = Layer.isotropic(first.E1, first.nu12, first.rho, 1.0)
    moduli, wanted = ([entry.E2, entry.G12, entry.G13, entry.G23] for entry in (first, plain))
    if kind != "Laminate" or any(layer != first for layer in others) or first.strength is not None:
        return kind, values
    if not np.allclose(moduli, wanted, rtol=1e-6):
        return kind, values
    shell: dict[str, Any] = {"E": first.E1, "nu": first.nu12, "rho": first.rho}
    shell["thickness"] = sum(layer.thickness for layer in values["layers"])
    kept: dict[str, Any] = {name: values[name] for name in ("offset", "top") if name in values}
    return "Shell", {**shell, **kept}


def _family(kind: str, arguments: dict[str, Any], place: str, strengths: Strengths) -> Family:
    """The family of a section; InputError with the deck's line if its arguments are refused."""
    try:
        values = dict(arguments)
        for name in ("axis", "top"):  # one direction, or one in each element
            if isinstance(values.get(name), dict):
                values[name] = Nearest(**values[name])
        if "layers" in values:
            values["layers"] = [Layer(**layer) for layer in values["layers"]]
            kind, values = _of_one_material(kind, values)
        if "section" in values:
            values["section"] = Section(**values["section"])
        family = FAMILIES[kind]
        given = strengths.options(family, values["E"], values["rho"]) if "E" in values else {}
        return family(**values, **given)
    except InputError as error:
        raise InputError(f"{place}: {error}") from error
