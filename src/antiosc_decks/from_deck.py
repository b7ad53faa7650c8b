"""`read_model`: a deck of Abaqus, CalculiX or Nastran as a structure that is ready to be struck."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from inspect import signature
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

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
    assemble,
)
from antiosc.base import checks
from antiosc.base._types import IntArray, SolverChoice
from antiosc.base.errors import InputError, NotTakenWarning
from antiosc.base.materials import yielding_record
from antiosc.base.texts import engineering
from antiosc.fem.assembly.joint import Joint
from antiosc.fem.elements.shell import GivenSheet
from antiosc.fem.elements.weak_form import Family
from antiosc.fem.mesh import distributed
from antiosc.fem.mesh.reading import flattened, sound
from antiosc.fem.platform import collective, on_root, warn
from antiosc.fem.structure.attachments import Attachment, attachments_of
from antiosc.io.neutral import (
    CELL_TYPES,
    DIMENSION,
    FileMesh,
    Model,
    Piece,
    RawMesh,
    UnitSystem,
    fixed_group_name,
)
from antiosc.io.reading import file_content, pieces_error, selected_mesh
from antiosc_decks.shared_nodes import NodeConstraints, SharedNodes


@dataclass(frozen=True, eq=False)
class NearestDirection:
    """Function that gives each cell the direction of the nearest of n places, both (n, 3)."""

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


def join_parts(
    parts: Mapping[str, Structure],
    numbers: Mapping[str, IntArray],
    model: Model,
    supports: Sequence[Support],
    attached: Sequence[PointMass | Spring | Damper],
    solver: SolverChoice,
) -> Structure:
    """Assemble the parts of a deck with its joints.

    `numbers`: the deck's node numbers by part; `supports` may name groups of any part.
    """
    joints = model["joints"]
    points = {point_name(-1 - k): x for k, x in enumerate(joints["points"])}
    constraints = NodeConstraints(joints, list(points), numbers)
    shared: list[Joint] = [SharedNodes(numbers)] if len(parts) > 1 else []

    own_supports = [Support(point_name(point), fix) for point, fix in model["fixed_points"]]
    own_supports += [
        Support(f"{name}:{group}", fix)
        for name, part in parts.items()
        for group, fix in model["supports"]
        if part.mesh.groups.get(group) and set(fix) <= set(part.form.components)
    ]

    return assemble(
        parts,
        [*shared, constraints],
        points=points,
        supports=[*own_supports, *_part_supports(parts, supports)],
        attached=[*attachments(model), *attached],
        solver=solver,
    )


def _part_supports(parts: Mapping[str, Structure], supports: Sequence[Support]) -> list[Support]:
    """Supports whose group is replaced by the group of this name in each part that has it."""
    of_parts = []
    for support in supports:
        group = support.where
        named = [name for name, part in parts.items() if group in part.mesh.groups]
        owners = named if isinstance(group, str) else []
        of_parts += [replace(support, where=f"{name}:{group}") for name in owners] or [support]
    return of_parts


#: What may become of the contact of a deck.
ContactChoice: TypeAlias = Literal["tied", "apart"]
CONTACT_CHOICES: tuple[ContactChoice, ...] = ("tied", "apart")
#: Names of the parts of a deck whose cells are joined, by their dimension.
PART_NAMES = {3: "solids", 2: "faces", 1: "beams"}
#: Name of the part with the triangles, if there are quadrilaterals too.
TRIANGLE_PART = "triangles"
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
    merge: float | None = None,
    parts: Sequence[str] | None = None,
    piece: int | None = None,
    contact: ContactChoice = "tied",
    free: bool = False,
    root: str | Path | None = None,
    solver: SolverChoice = "auto",
    timeout: float | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Structure:
    """The structure that a deck describes, with its supports, masses, springs and dampers.

    Parameters
    ----------
    path
        A deck of Abaqus or CalculiX (`.inp`), or of Nastran (`.bdf`, `.nas`, `.fem`).
    unit
        Units of the deck: "m" (SI), "mm" (mm, N, t, MPa), "mm-kg" (mm, mN, kg, kPa), "mm-kgf"
        (mm, kgf, kgf/mm²), "cm" (cm, N), "in" (inch, pound-force, psi), "ft" (foot, pound-force,
        slug), or metres per unit of length (forces in N). Masses and densities follow: force =
        mass × length / s².
    supports, attached
        Supports and attachments in addition to the deck's.
    density
        Density in kg/m³ of materials without a density.
    modulus
        Young's modulus in Pa of materials without elasticity, such as in thermal analyses; their
        Poisson's ratio is 0.3.
    yield_strength
        Yield strength in Pa of all isotropic materials, which decks do not state; margins and
        yielding contacts need it. In the error of the contact law it grows with the strain rate as
        for the material of the table with similar E and density. Or the name of a material of the
        table (`antiosc materials`), which gives strength and range.
    yield_range
        Lowest and highest yield strength of batches of these materials, Pa; default for a name:
        its own range.
    merge, timeout, comm
        As for `read_mesh`. The elements are not changed.
    parts
        Names of parts, instances or sets of elements: only these are read. Constraints, springs
        and masses that act only on nodes of other elements are left out; a warning counts them.
    piece
        Number of the piece to be read, if the elements form pieces without a common node: 1 for
        the largest, 2 for the next; the others are left out. Without it, several pieces are read
        if each of them is supported.
    contact
        For contact pairs of an Abaqus or CalculiX deck: "tied" joins pairs that touch at first, as
        the card TIE does; "apart" leaves all contact out. A joint that stays pressed together is
        closer to "tied"; a joint that opens or slides is between both. Contact of a single piece
        that is read is left out.
    free
        Whether to leave out the supports of the deck, as for a fall or an impact in flight.
    root
        Folder of the files that the deck may include; default: the folder of the deck, or its
        parent if the user owns both.
    solver
        As for `Structure`.

    The mesh's groups are the deck's sets; supports fix the motions that the deck fixes in its model
    and in its first step. A B32 element becomes two straight `Beam` elements. A layered or
    orthotropic shell becomes a `Laminate`, with layers of one isotropic material a `Shell`.

    Solids, shells and beams with common nodes, and elements joined by equations, multi-point
    constraints, rigid bodies, couplings, ties and springs, become one assembly of up to four parts:
    "solids", "faces", "triangles" (a few in a mesh of quadrilaterals) and "beams" (`Site(...,
    part=...)`). Constraints are linear, for small motions. If they determine all nodes of an edge
    or a face of an element, the whole edge or face follows by the element's shape functions; if
    they tie these nodes to one element at the same place, it follows this element's displacement.

    Raises
    ------
    MeshError
        As `read_mesh`; elements without a section, materials without elasticity or density,
        undefined nodes, elements and sets, and unsupported content that would change the result:
        general contact, unsupported element types. The message names the line.

    Warns
    -----
    AntioscWarning
        Ignored content of the deck, with counts and lines: loads, steps, nonlinear materials;
        unknown cards and options; sets with missing members; sets of supports that are not
        selected.
    """
    checks.instance("comm", comm, MPI.Comm, "an MPI communicator (mpi4py)")
    file = checks.path("path", path)
    chosen = density, modulus, merge, parts, piece, contact, free, root, timeout
    read = _reader(file, unit, *chosen)

    strength = Strength.of(yield_strength, yield_range)
    added_supports = checks.list_of("supports", supports, Support, "Support objects")
    added_attachments = attachments_of(attached)
    raws = on_root(comm, read)
    first = next(iter(raws.values()))
    model = _model_read(first)
    for sentence in first.remarks:
        warn(comm, sentence)

    if model["ignored"]:
        ignored = ", ".join(model["ignored"])
        warn(comm, f"of {file.name} are not taken: {ignored}.", NotTakenWarning)
    if told := _one_strength_text(raws.values(), strength, file.name):
        warn(comm, told)

    shared = MPI.COMM_SELF if model["joined"] else comm  # each rank has the whole of an assembly
    structures = {
        name: _part_structure(
            raw, file.name, shared, solver, added_supports, added_attachments, strength
        )
        for name, raw in raws.items()
    }
    if not model["joined"]:
        return next(iter(structures.values()))
    numbers = {name: raw.numbers for name, raw in raws.items()}

    return join_parts(structures, numbers, model, added_supports, added_attachments, solver)


class DeckFacts(NamedTuple):
    """The families of a deck, its length and its pieces."""

    families: list[Family]
    #: of the longest side of its largest part [m]
    length: float
    #: those of which one is read, the largest first; none if all are
    pieces: Sequence[Piece]


def facts_of_deck(path: str | Path, unit: str | float = "m", **options: Any) -> DeckFacts:
    """Families, length and pieces of a deck; materials without a density are massless.

    `options` are arguments of `read_model`.
    """
    raws = _reader(checks.path("path", path), unit, **options, massless=True)()
    groups = [_families_of_groups(raw, Strength()) for raw in raws.values()]
    families = [family for group in groups for family in group.values()]
    longest = max(float(np.ptp(raw.points, axis=0).max()) for raw in raws.values())
    return DeckFacts(families, longest, next(iter(raws.values())).pieces)


def _families_of_groups(raw: RawMesh, strength: Strength) -> dict[str, Family]:
    """The family of each group of a part's cells."""
    model = _model_read(raw)
    return {
        group: _family_of_section(kind, arguments, place, strength)
        for group, kind, arguments, place in model["families"]
        if not model["joined"] or raw.groups.get(group)
    }


def _cells_of_kind(content: FileMesh, part: str) -> FileMesh:
    """A deck with only the cells of one part, their groups and the supports on them."""
    mark = fixed_group_name("", part)
    groups = {n: {part: parts[part]} for n, parts in content.groups.items() if part in parts}
    fixed = {n.removesuffix(mark): e for n, e in content.fixed.items() if n.endswith(mark)}
    return replace(content, cells={part: content.cells[part]}, groups=groups, fixed=fixed)


def _reader(
    file: Path,
    unit: str | float,
    density: float | None = None,
    modulus: float | None = None,
    merge: float | None = None,
    parts: Sequence[str] | None = None,
    piece: int | None = None,
    contact: ContactChoice = "tied",
    free: bool = False,
    root: str | Path | None = None,
    timeout: float | None = None,
    massless: bool = False,
) -> Callable[[], dict[str, RawMesh]]:
    """A function that reads the deck into cells by part; checks the caller's arguments."""
    units = UnitSystem.of(unit)

    numbers = {"merge": (merge, "m"), "density": (density, "kg/m³"), "modulus": (modulus, "Pa")}
    numbers["timeout"] = timeout, "s"
    merge, density, modulus, timeout = (
        None if value is None else checks.positive(name, value, of)
        for name, (value, of) in numbers.items()
    )

    if parts is not None:
        parts = checks.list_of("parts", parts, str, "names of parts")
        if not parts:
            raise InputError("parts must be a list of names; got [].")
    if piece is not None:
        piece = checks.whole("piece", piece, least=1)
    if root is not None:
        root = str(Path(checks.path("root", root)).resolve())
        if not os.path.isdir(root):
            raise InputError(f"root must be a folder; there is none at {checks.shown(root)}.")

    options: dict[str, Any] = {"unstated": (density, modulus, massless), "parts": parts}
    options |= {"piece": piece, "root": root, "free": checks.flag("free", free)}
    options["contact"] = checks.choice("contact", contact, CONTACT_CHOICES)

    def read_parts() -> dict[str, RawMesh]:
        meshes: dict[str, RawMesh] = {}
        content = file_content(file, timeout, units, merge, model=options)
        whole = [content]
        if content.model is not None and content.model["joined"]:
            labels = sorted(content.cells, key=lambda label: -DIMENSION[CELL_TYPES[label][0]])
            whole = [_cells_of_kind(content, label) for label in labels]

        for raw in (selected_mesh(one, None, None, file.name) for one in whole):
            model = _model_read(raw)
            flat = flattened(raw, model["gdim"], file.name)
            choices = _choices_text(flat)
            if model["joined"] and model["pieces"] > 1 and not model["held"] and merge is None:
                fault = f"{file.name} falls into {model['pieces']} pieces that nothing joins, and "
                fault += "supports do not hold each"
                remedy = f"join, merge or hold them, or read one of them ({choices})."
                raise pieces_error(flat, fault, remedy)
            pieces = model["joined"] or model["held"]
            part = TRIANGLE_PART if PART_NAMES[raw.kind.dim] in meshes else PART_NAMES[raw.kind.dim]
            meshes[part] = sound(flat, file.name, made_here=False, pieces=pieces, by=choices)

        return meshes

    return read_parts


def _choices_text(raw: RawMesh) -> str:
    """Text on the arguments of `read_model` that choose a part of a deck."""
    sets = {name: len(members.get(raw.kind.dim, ())) for name, members in raw.groups.items()}
    names = [repr(name) for name, count in sets.items() if 0 < count < len(raw.cells)]
    sets_text = f"; parts names sets: {', '.join(names[:8])}{', …' * (len(names) > 8)}"
    return f"piece 1 is the largest{sets_text * bool(names)}"


def _model_read(raw: RawMesh) -> Model:
    """The model that is read with the cells."""
    assert raw.model is not None
    return raw.model


def _part_structure(
    raw: RawMesh,
    name: str,
    comm: MPI.Comm,
    solver: SolverChoice,
    added_supports: Sequence[Support],
    added_attachments: Sequence[Attachment],
    strength: Strength,
) -> Structure:
    """The structure of one part; parts that will be joined get no supports here."""
    model = _model_read(raw)
    mesh = distributed(raw, name, comm)
    families = _families_of_groups(raw, strength)
    if model["joined"]:
        return Structure(mesh, families, solver=solver)
    supports = [Support(group, fix) for group, fix in model["supports"] if raw.groups.get(group)]
    attached = [*attachments(model), *added_attachments]
    return Structure(mesh, families, [*supports, *added_supports], attached=attached, solver=solver)


#: Young's modulus [Pa] above which a strength without a name is that of a steel; D [1/s] and q of
#: mild steel at its tensile strength, which grows most, and that over its yield strength (S275).
MIN_STEEL_MODULUS, MILD_STEEL_RATE, TENSILE_RATIO = 150e9, (6844.0, 3.91), 430 / 275


class Strength(NamedTuple):
    """The yield strength of all isotropic materials of a deck, its range [Pa], its rate."""

    value: float | None = None
    range: tuple[float, float] | None = None
    rate: tuple[float, ...] | None = None

    @classmethod
    def of(cls, value: float | str | None, ends: tuple[float, float] | None) -> Strength:
        """The strength from the arguments `yield_strength` and `yield_range` of `read_model`."""
        rate = None
        if isinstance(value, str):
            named = yielding_record(value)
            value, ends, rate = named.yield_strength, ends or named.yield_range, named.rate
        if value is not None:
            value = checks.positive("yield_strength", value, "Pa")
        return cls(value, None if ends is None else checks.strength_range(ends, value), rate)

    def options(self, family: Callable[..., Family], E: float) -> dict[str, object]:
        """The arguments of a family that give the strength of its material."""
        if self.value is None or "yield_strength" not in signature(family).parameters:
            return {}
        rate = self.rate
        if rate is None and E > MIN_STEEL_MODULUS:
            rate = (*MILD_STEEL_RATE, TENSILE_RATIO * self.value)
        return {"yield_strength": self.value, "yield_range": self.range, "rate": rate}


def _one_strength_text(raws: Iterable[RawMesh], strength: Strength, name: str) -> str:
    """Sentence if several materials of a deck get the same given strength; else ""."""
    groups: list[dict[str, Any]] = [_families_of_groups(raw, strength) for raw in raws]
    families = [family for group in groups for family in group.values()]
    strong = {(one.E, one.rho) for one in families if getattr(one, "yield_strength", None)}
    if strength.value is None or len(strong) < 2:
        return ""
    listed = ", ".join(f"E = {engineering(E, 'Pa')}, {rho:.4g} kg/m³" for E, rho in sorted(strong))
    return (
        f"the yield strength {engineering(strength.value, 'Pa')} is taken for all {len(strong)}"
        f" materials of {name} ({listed}); to give each its own, read the mesh alone (read_mesh)."
    )


def _laminate_or_shell(values: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """(family, arguments) of layers: a `Shell` if they are of one isotropic material."""
    first, *others = (replace(layer, thickness=1.0, angle=0.0) for layer in values["layers"])
    plain = Layer.isotropic(first.E1, first.nu12, first.rho, 1.0)
    moduli, wanted = ([one.E2, one.G12, one.G13, one.G23] for one in (first, plain))
    alike = all(layer == first for layer in others) and first.strength is None
    if not alike or not np.allclose(moduli, wanted, rtol=1e-6):
        return "Laminate", values
    shell: dict[str, Any] = {name: values[name] for name in ("offset", "top") if name in values}
    shell |= {"E": first.E1, "nu": first.nu12, "rho": first.rho}
    return "Shell", shell | {"thickness": sum(layer.thickness for layer in values["layers"])}


def _family_of_section(
    family_name: str, arguments: dict[str, Any], place: str, strength: Strength
) -> Family:
    """The family of a section; InputError with the deck's line if its arguments are refused."""
    try:
        values = dict(arguments)
        for name in ("axis", "top"):  # one direction, or one in each element
            if isinstance(values.get(name), dict):
                values[name] = NearestDirection(**values[name])
        if "layers" in values:
            values["layers"] = [Layer(**layer) for layer in values["layers"]]
            family_name, values = _laminate_or_shell(values)
        if "section" in values:
            values["section"] = Section(**values["section"])
        family = FAMILIES[family_name]
        given = strength.options(family, values["E"]) if "E" in values else {}
        return family(**values, **given)
    except InputError as error:
        raise InputError(f"{place}: {error}") from error
