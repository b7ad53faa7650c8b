"""From derivatives by a reduced model's matrices to derivatives by the part's parameters.

The matrices of the model are those of the part on its shapes V, K_red = V'KV and M_red = V'MV. With
fixed shapes a parameter p of the part changes them by V'(dK/dp)V and V'(dM/dp)V, to first order in
the error of the shapes. This takes no solve, only products with two assembled matrices for each
parameter.

`design_map` does the same for each cell. The contribution of a cell to V'(dK/dp)V is an energy of
the cell. The derivatives by K_red are a quadratic form of the shapes; in its principal axes a few
shapes suffice.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg
import ufl

from antiosc import AntiOscillators, DampingMatrix, Site, Structure, extract
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError, without_warnings
from antiosc.base.process import one_thread
from antiosc.base.texts import Completed, percent
from antiosc.engine import adjoint
from antiosc.engine.damping import in_coordinates
from antiosc.extension import checked_shapes, measure, on_mesh, refuse_prestress
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.reduce.site import functional
from antiosc.reduce.site.sites import located
from antiosc_studies.gradients.changes import ByMatrices, ByModes, Values, by_matrices
from antiosc_studies.gradients.goals import Recorded, Sampled, Seeds
from antiosc_studies.gradients.of_run import by_modes, derived, model_name, shown_goal

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Relative step of a parameter.
CHANGE = 1e-3
#: Step of an angle in degrees.
ROTATED = 0.05
#: Relative step where a model is extracted again: small, as frequencies of close modes are curved
#: functions of it, but far above the 1e-8 at which extractions round.
SMALL = 1e-4
#: Largest ratios of stiffness and of mass of a part and a model that belong to each other.
SAME_PART = 1 + 1e-4, 1 + 1e-4
#: Inputs below this are changed by an absolute step.
LEAST = 1e-200
#: Largest relative difference of the static mass of models that `build` returns close to x.
SAME_MODEL = 1e-2
#: Largest relative difference between the frequencies of a model and of its repeated recurrence. It
#: is 1e-7 at a site that excites all modes. On the symmetry plane of a bar, where unexcited modes
#: grow from rounding, it is 2e-3, and derivatives of the highest frequencies have errors of 100 %.
SAME_STEPS = 1e-5
#: Numbers of materials, sections and layers on which K and M do not depend.
IDLE = {"loss", "yield_strength", "yield_range", "tensile", "rate", "outline"}
#: Numbers of a laminate's layers that are design parameters; the others belong to its materials.
OF_LAYERS = {"thickness", "angle"}

#: Step of the models over `CHANGE`: an extraction in few shapes has small rounding errors.
SHRUNK = 0.1
#: Tolerance `tol` of an extraction that keeps all modes.
EVERY = 1e-30

#: A function that gives the models of two parts.
Ends = Callable[[Structure, Structure], list[AntiOscillators]]
#: A function that gives the first-order change of a goal between two parts.
Slope = Callable[[Structure, Structure], float]
#: Parameters of a design map, and their units.
BY = {"thickness": "m", "E": "Pa", "rho": "kg/m³"}
#: Quadrature degree of energies in cells: exact for strains of cubic elements; kinetic energies of
#: these then have errors of some 1e-4.
DEGREE = 4
#: Largest sum of the shares of neglected principal shapes over the sum of all shares' magnitudes.
LEFT_OUT = 1e-6


@dataclass(frozen=True, eq=False)
class Chain:
    """The derivatives of a goal by the matrices of a part on the shapes (rows, C) of its model.

    by, reduced : derivatives by V'KV and V'MV, and these matrices (C, C).
    by_local : derivative by the half-space compliance of the site's patch.
    motions : pairs of derivatives (C,) by momenta of the shapes, and the rigid motion (6,) with
    these momenta: at the start, and of gravity.
    """

    model: AntiOscillators
    by: ByMatrices
    reduced: ByMatrices
    by_local: float
    shapes: Array
    motions: list[tuple[Array, Array]]

    def change(self, lower: Structure, upper: Structure) -> float:
        """First-order change of the goal from one part to another."""
        total = sum(
            sign * float(np.sum(by * dot(end.comm, self.shapes, multiply(matrix, self.shapes))))
            for sign, end in ((-1, lower), (1, upper))
            for by, matrix in zip(self.by, (end.K, end.M), strict=True)
        )
        for by, motion in self.motions:
            a = lower.rigid_inertia
            b = upper.rigid_inertia
            assert a is not None
            assert b is not None
            total += float(by @ dot(lower.comm, self.shapes, (b[1] - a[1]) @ motion))
        if self.by_local:
            site = site_of(self.model)
            ends = [functional(structure, site).local_compliance for structure in (lower, upper)]
            total += self.by_local * (ends[1] - ends[0])
        return total


def chain(model: AntiOscillators, by: ByModes, local: float) -> Chain:
    """The derivatives of a goal by the matrices K and M of the part, projected on the shapes.

    The coordinates of this projection are the motion of the site, and that of each anti-oscillator
    relative to it.
    """
    assert model.shapes is not None
    identity = np.eye(model.n + 1)
    identity[1:, 0] = -1.0
    motions = []
    hidden = model.hidden_count
    modes = by.modes
    for slope, value in ((by.start, by.v), (by.load, by.g)):
        if modes.inertia is not None and value.any():
            assert modes.shape is not None
            motion = np.linalg.lstsq(modes.inertia.momentum, value, rcond=None)[0]
            by_modes = modes.shape[: model.n + 1, hidden:] @ slope[hidden:]
            motions.append((identity @ by_modes, motion))
    K = np.diag(np.append(model.k0, model.k))
    M = np.diag(np.append(model.m_st, model.m))
    M[0, 1:] = M[1:, 0] = model.m
    of_shapes = ByMatrices(*(identity @ matrix @ identity.T for matrix in by_matrices(model, by)))
    return Chain(model, of_shapes, ByMatrices(K, M), local, model.shapes, motions)


def part_chain(record: Recorded, seeds: Seeds, slopes: adjoint.Slopes, name: str) -> Chain:
    """The derivatives by the matrices of the part of a run's model."""
    mode_derivatives = by_modes(record, seeds, slopes, name)
    if mode_derivatives is None:
        raise InputError(
            "derivatives by the materials of a part need a model of one site, without loads, a"
            " moving ground (and a design map one whose damping does not couple its modes): give a"
            " function of x that builds the part, and x."
        )
    model = record.model(name)
    touching = record.G[:, record.columns[name].start]
    contacts = zip(touching, record.scene.contacts, record.laws, strict=False)
    freed = [
        c for c, (slides, contact, law) in enumerate(contacts) if slides and law is not contact.law
    ]
    local = float(slopes.laws[freed, -1].sum()) if model.local_compliance > 0 else 0.0
    return chain(model, mode_derivatives, local)


def held(model: AntiOscillators, part: Structure) -> AntiOscillators:
    """The model of a changed part on the shapes of `model`, whose damping couples its modes.

    Its constraint modes are those of V'KV and V'MV; the damping acts along them.
    """
    assert model.shapes is not None
    assert isinstance(model.damping, DampingMatrix)
    if not model.k0 > 0 or model.hidden_count or model.damping.factors:
        raise InputError(
            "derivatives by the materials of a part whose damping couples its modes need supports"
            " that hold it, and no branches (prony=, tau=): give a function of x that builds the"
            " part, and x."
        )
    K, M = _projected(model.shapes, part)
    square, V = scipy.linalg.eigh(K[1:, 1:], M[1:, 1:])
    transformation = scipy.linalg.block_diag(1.0, V)
    transformation[1:, 0] = -V @ ((V.T @ K[1:, 0]) / square)
    P = transformation[:, 0] @ M @ transformation[:, 1:]
    transformation[:, 1:] *= np.sign(P)
    return replace(
        model,
        m0=float(transformation[:, 0] @ M @ transformation[:, 0] - P @ P),
        k0=float(transformation[:, 0] @ K @ transformation[:, 0]),
        m=P**2,
        omega=np.sqrt(square),
        local_compliance=_local(model, part),
        damping=in_coordinates(
            model.damping, np.append(1.0, np.sqrt(model.m))[:, None] * transformation
        ),
        shapes=None,
        strain_error=None,
        strain_misfit=None,
    )


def _projected(shapes: Array, part: Structure) -> ByMatrices:
    """V'KV and V'MV of a part, for shapes V (rows, C)."""
    return ByMatrices(
        *(dot(part.comm, shapes, multiply(matrix, shapes)) for matrix in (part.K, part.M))
    )


def _local(model: AntiOscillators, part: Structure) -> float:
    """Local compliance of the site's patch on a changed part."""
    return model.local_compliance and functional(part, site_of(model)).local_compliance


def recurrence(model: AntiOscillators, part: Structure) -> Ends | None:
    """A function that gives the models of two nearby parts by the Krylov recurrence.

    A model of k steps matches 2k moments of its part, which depend on K and M through the first 2k
    vectors of the recurrence. The recurrence is repeated in the space of these vectors, which
    contains all changes of the moments; the k shapes of the model would lose half of them. Returns
    None for parts without supports, on several ranks, and if rounding has brought modes into the
    model that its site does not excite. A model's distance from this one is SHRUNK times that of
    its part.
    """
    steps = model.info.modes_computed
    if (
        (model.info.method, part.comm.size) != ("krylov", 1)
        or not (steps and model.k0 > 0 and model.info.point)
        or isinstance(model.damping, DampingMatrix)
    ):
        return None
    with without_warnings():
        shapes = extract(part, site_of(model), 2 * steps, tol=EVERY).shapes
    assert shapes is not None
    stiffness = _projected(shapes, part).K.diagonal()
    # all of equal energy, and added to the static shape: a diagonal K looks like supports
    scaling = np.diag(np.sqrt(stiffness[0] / stiffness))
    scaling[0] = 1.0
    shapes = shapes @ scaling
    site_vector = Site(vector=scaling[0])
    reduced = _projected(shapes, part)

    def model_of(matrices: ByMatrices, local: float) -> AntiOscillators:
        with without_warnings():
            reduced_model = extract(Structure.from_matrices(*matrices), site_vector, model.n)
        numbers = {name: getattr(reduced_model, name) for name in ("m0", "k0", "m", "omega")}
        return replace(model, **numbers, local_compliance=local, shapes=None)

    try:
        repeated = model_of(reduced, model.local_compliance)
    except AccuracyError:  # directions of rounding spoil the modes
        return None
    if repeated.n != model.n or np.abs(repeated.omega / model.omega - 1).max() > SAME_STEPS:
        return None

    def ends(lower: Structure, upper: Structure) -> list[AntiOscillators]:
        differences = [
            (b - a) / 2
            for a, b in zip(_projected(shapes, lower), _projected(shapes, upper), strict=True)
        ]
        local = (_local(model, upper) - _local(model, lower)) / 2
        return [
            model_of(
                ByMatrices(
                    *(x + sign * move for x, move in zip(reduced, differences, strict=True))
                ),
                model.local_compliance + sign * local,
            )
            for sign in (-SHRUNK, SHRUNK)
        ]

    return ends


def by_part(changes: Sequence[Slope], part: Structure) -> list[Values]:
    """Derivatives by the parameters of a part's materials, one result for each of `changes`.

    For several materials they are {group: …}.
    """
    if part.made_of is None:
        raise InputError(
            "the materials of an assembly, or of matrices, are not known: give a function of x that"
            " builds the part, and x."
        )
    refuse_prestress(part, "a gradient by the numbers of a part")
    mesh, materials, options = part.made_of
    is_grouped = isinstance(materials, Mapping)
    groups = dict(materials) if isinstance(materials, Mapping) else {"": materials}
    derivatives: list[Values] = [{} for _ in changes]
    for group, material in groups.items():
        for name, step, varied in _varied(material):
            ends = []
            for sign in (-1, 1):
                changed_materials = {**groups, group: varied(sign)}
                with without_warnings():
                    varied_materials = changed_materials if is_grouped else changed_materials[""]
                    ends.append(Structure(mesh, varied_materials, part.supports, **options))
            for values, change in zip(derivatives, changes, strict=True):
                slope = change(ends[0], ends[1]) / step
                of_material = values.setdefault(name, {}) if is_grouped else values
                key = group if is_grouped else name
                layered = hasattr(material, "layers")
                of_material[key] = np.append(of_material.get(key, ()), slope) if layered else slope
    return derivatives


def _varied(
    item: Any, wanted: Container[str] = ()
) -> Iterator[tuple[str, float, Callable[[int], Any]]]:
    """Yields (name, difference of the two values, function) for each parameter of a material.

    The function of +1 or -1 returns the material with the larger or smaller value. `wanted`: only
    these names, if given.
    """
    for name, value in values_of(item).items():
        if wanted and name not in wanted:
            continue
        if is_dataclass(value) and name == "section":
            for inner, step, vary in _varied(value):
                yield inner, step, lambda s, n=name, m=vary: replace(item, **{n: m(s)})  # type: ignore[misc]
        elif name == "layers":
            for k, layer in enumerate(value):
                for inner, step, vary in _varied(layer, OF_LAYERS):
                    yield (
                        inner,
                        step,
                        lambda s, k=k, m=vary: replace(  # type: ignore[misc]
                            item, layers=(*item.layers[:k], m(s), *item.layers[k + 1 :])
                        ),
                    )
        elif isinstance(value, float) and (value or name == "angle"):
            h = ROTATED if name == "angle" else CHANGE * abs(value)
            yield name, 2 * h, lambda s, n=name, v=value, h=h: replace(item, **{n: v + s * h})  # type: ignore[misc]


def values_of(material: Any) -> dict[str, Any]:
    """The numbers of a material, a section or a layer on which K and M depend, by name."""
    unused_names = IDLE if getattr(material, "plane", "") is not None else IDLE | {"thickness"}
    names = {item.name for item in fields(material) if item.init} - unused_names
    return {name: getattr(material, name) for name in sorted(names)}


def by_shape(
    build: Callable[[Array], Any],
    x: Array,
    model: AntiOscillators,
    changes: Sequence[Callable[..., float]],
) -> list[Values]:
    """Derivatives by the argument x (n,) of a function that builds the part or its model.

    Each of `changes` is a function (before, after) of two models: the first-order change of a goal.
    """
    slopes = np.empty((len(changes), x.size))
    for i in range(x.size):
        h = SMALL * (abs(x[i]) if abs(x[i]) > LEAST else 1.0)
        ends = [_extracted(build(x + s * h * np.eye(x.size)[i]), model) for s in (-1, 1)]
        size = np.abs(model.m_st).max()
        if np.abs(ends[0].m_st + ends[1].m_st - 2 * model.m_st).max() > SAME_MODEL * size:
            raise InputError(
                "build(x) must give the part, or the model, of this run: its mass at the site is"
                " another."
            )
        slopes[:, i] = [change(*ends) / (2 * h) for change in changes]
    return [{"x": slope} for slope in slopes]


def _extracted(built: object, model: AntiOscillators) -> AntiOscillators:
    """The model of a part, extracted with the options of `model`."""
    if isinstance(built, AntiOscillators):
        return built
    part = checks.instance("build(x)", built, Structure, "a Structure, or the model of one")
    with without_warnings():
        if model.info.method == "modes":
            model_of_part = extract(part, site_of(model), model.n, "modes")
        else:
            has_estimate = model.strain_error is not None
            model_of_part = extract(
                part, site_of(model), model.n, error="estimate" if has_estimate else None
            )
    # dampers of the part are in the coordinates of its own model
    coupled = isinstance(model_of_part.damping, DampingMatrix)
    if coupled:
        return model_of_part
    return replace(model_of_part, damping=model.damping)


def site_of(model: AntiOscillators) -> Site:
    """The site of an extracted model; InputError if it is unknown."""
    info = model.info
    if model.sites or info.point is None or info.direction is None:
        raise InputError(
            "the place of the site is not known: let build(x) return the model, extracted there."
        )
    return Site(info.point, info.direction, model.patch_radius, snap=True)


@dataclass(frozen=True, eq=False, repr=False)
class DesignMap(Completed):
    """The result of `design_map`.

    Attributes
    ----------
    goal : the result; value : its value in the run; by : the parameter.
    slopes : (cells of this rank,) derivative by the parameter of each cell alone; NaN for cells
        whose material does not have it.
    per_mass : (cells of this rank,) change by one more kilogram there [unit of the goal/kg]; by E:
        change by doubling the modulus of one kilogram.
    meshed : the mesh of the part with its data.
    """

    goal: str
    value: float
    by: str
    slopes: Array
    per_mass: Array
    meshed: MeshedStructure

    def _facts(self) -> list[tuple[str, str]]:
        lowers = float(np.mean(self.slopes < 0))
        return [
            (self.goal, f"{self.value:.6g}"),
            (f"d/d {self.by}", f"{np.nansum(self.slopes):.6g} of all {self.slopes.size} cells"),
            ("cells where more lowers it", f"{percent(lowers)}"),
        ]

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """`per_mass` drawn on the part; all ranks call it.

        With `path` (PNG, PDF, SVG, …) the picture is written, and the path returned. Blue: more
        material lowers the goal; red: it raises it.
        """
        from antiosc.plot.surfaces import draw_design

        faces = self.meshed.faces
        gather = self.meshed.comm.allgather
        corners = np.concatenate(gather(faces.corners))
        value = np.concatenate(gather(self.per_mass[faces.cells]))
        return draw_design(corners, value, f"d {self.goal} / kg of {self.by}", path)


@one_thread()
def design_map(
    part: Structure,
    hit: Any,
    goal: str | Callable[[Sampled], float],
    by: str = "thickness",
    *,
    contact: tuple[str, str] | None = None,
    time: float | None = None,
) -> DesignMap:
    """Derivative of a result by the thickness of every cell: it shows where material is useful.

    For E, the compliance of the contact's patch is attributed to the cells under the patch.

    Parameters
    ----------
    part : Structure
        Structure of one mesh, from which the run's model was extracted.
    hit, goal, contact, time
        As for `gradient`.
    by : "thickness", "E" or "rho"
        Parameter of the cells' materials; stiffeners of a sheet are left out.

    Raises
    ------
    InputError
        For a part that is not the run's, or whose materials do not have `by`; or that `gradient`
        refuses.
    NotDifferentiableError
        As for `gradient`.
    """
    checks.choice("by", by, tuple(BY))
    checks.instance("part", part, Structure, "a Structure")
    meshed = on_mesh(part)
    record, goal_seeds, slopes = derived(hit, goal, contact, time)
    name = model_name(record)
    checked_shapes(part, hit, name, SAME_PART)
    chain_of_part = part_chain(record, goal_seeds, slopes, name)
    by_cell = [float(values_of(material).get(by, np.nan)) for material, _ in meshed.parts]
    if not np.isfinite(by_cell).any():
        raise InputError(f"no material of the part has a {by} [{BY[by]}] of its own.")
    relative = np.zeros(compat.cell_map(meshed.mesh.dolfinx).size_local)
    changes = _relative(part, meshed, by)
    for change, by_reduced, reduced in zip(
        changes, chain_of_part.by, chain_of_part.reduced, strict=True
    ):
        if change:
            shares, combination = _principal(by_reduced, reduced)
            vectors = chain_of_part.shapes @ combination
            relative += compat.quadratic(change, meshed.form.space, vectors, shares, DEGREE)
    if by == "E" and chain_of_part.by_local:
        relative += _patch_share(meshed, chain_of_part, relative.size)
    size = np.array(by_cell)[meshed.part_of_cells()[: relative.size]]
    per_mass = np.where(np.isfinite(size), relative / _masses(meshed), np.nan)
    return DesignMap(shown_goal(goal), goal_seeds.value, by, relative / size, per_mass, meshed)


def _relative(
    part: Structure, meshed: MeshedStructure, by: str
) -> tuple[Sequence[ufl.Form], Sequence[ufl.Form]]:
    """UFL forms of the changes of K and M by a relative change of a parameter."""
    if by != "thickness":  # to which they are proportional
        if by == "E":
            return (meshed.form.stiffness, [])
        return ([], meshed.form.mass)
    assert part.made_of is not None
    K = []
    M = []
    for sign in (1, -1):
        changed_parts: list[Any] = []
        for material, cells in meshed.parts:
            value = values_of(material).get(by)
            scaled = {} if value is None else {by: value * (1 + sign * CHANGE)}
            changed_parts.append((replace(material, **scaled), cells))
        form = changed_parts[0][0].weak_form(meshed.mesh, changed_parts, part.made_of[2]["order"])
        factor = compat.constant(meshed.mesh.dolfinx, sign / (2 * CHANGE))
        K += [factor * part_form for part_form in form.stiffness]
        M += [factor * part_form for part_form in form.mass]
    return K, M


def _patch_share(meshed: MeshedStructure, chain_of_part: Chain, cells: int) -> Array:
    """(cells,) change of the goal by the patch's compliance, divided among the cells under it."""
    site = site_of(chain_of_part.model)
    point = np.array([site.point])
    d = np.array([site.direction], dtype=float)
    found_at = located(meshed, point, d / np.linalg.norm(d), np.array([site.radius]))
    assert found_at.weighted is not None
    on_rank = found_at.weighted.cell < cells
    shares = np.bincount(found_at.weighted.cell[on_rank], found_at.weighted.weight[on_rank], cells)
    return np.asarray(-chain_of_part.by_local * found_at.local[0] * shares)


def _principal(by: Array, reduced: Array) -> tuple[Array, Array]:
    """Weights w (R,) and shapes C (C, R) with C diag(w) Cᵀ = `by` and Cᵀ `reduced` C = 1.

    The smallest are omitted: together at most `LEFT_OUT` of the sum of absolute weights.
    """
    values, vectors = np.linalg.eigh(reduced)
    nonzero = values > 1e-14 * values[-1]
    root = vectors[:, nonzero] * np.sqrt(values[nonzero])
    shares, directions = np.linalg.eigh(root.T @ by @ root)
    order = np.argsort(-np.abs(shares))
    neglected = 1 - np.cumsum(np.abs(shares[order])) / np.abs(shares).sum()
    largest = order[: 1 + int(np.argmax(neglected <= LEFT_OUT))]
    return shares[largest], (vectors[:, nonzero] / np.sqrt(values[nonzero])) @ directions[
        :, largest
    ]


def _masses(meshed: MeshedStructure) -> Array:
    """Mass [kg] of each cell of this rank."""
    cell = compat.cellwise(meshed.mesh.dolfinx)
    q = ufl.TestFunction(cell.function_space)
    return compat.assemble_functional(
        meshed.form.density * q * measure(meshed.mesh, 5), cell.function_space
    )
