"""`strike`: an impact to a tolerance, which chooses mesh, number of anti-oscillators and time step.

Each round meshes, extracts, simulates and computes the error budget. If the mesh error is too large
and can be reduced, the next mesh has the cell sizes that reduce it with the fewest cells
(`antiosc.reduce.error.division`). The shapes' mean amplitudes during the contact weight the errors,
so that cells become small where this impact requires it. On lines the mesh error bar is at least
the change from one mesh to the next. Anti-oscillators and time steps may each use a small share of
the tolerance.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.clock import clock
from antiosc.base.errors import InputError, RangeError, warnings_of_last
from antiosc.base.process import MEMORY_SHARE, free_memory
from antiosc.base.texts import percent, plain_number, rounded_up
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.solid import Solid
from antiosc.fem.elements.weak_form import Family
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import collective, compat, on_root
from antiosc.fem.prestress import Prestress
from antiosc.fem.structure.structure import Structure
from antiosc.fem.structure.support import Support
from antiosc.impact.bodies import RigidMass, Sphere
from antiosc.impact.error_budget import SAFETY, TRIANGLE_FACTOR, amplitude_products
from antiosc.impact.histories import History, with_model
from antiosc.impact.histories.bars import ErrorBudget, relative_changes, with_floor
from antiosc.impact.scene import simulate
from antiosc.io.isolation import Refinement
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import AUTO, AnyLaw, LinearBody
from antiosc.models.motion import Motion
from antiosc.reduce.error import division
from antiosc.reduce.error.division import MeshSource, mesh_source
from antiosc.reduce.error.model_errors import ModelErrors
from antiosc.reduce.extraction.extract import extract
from antiosc.reduce.site.site import Site
from antiosc.strikes import second_order, stress
from antiosc.strikes.advice import advise

#: Goal of the whole budget over the tolerance, as estimates of the next mesh may be low.
AIMED_TOL_SHARE = 0.8
#: Least share of the tolerance that is left for the mesh.
MIN_MESH_SHARE = 0.05
#: Largest goal of a further mesh over the present error: a smaller step is not worth a mesh.
MAX_GOAL_RATIO = 0.8
#: Factor by which the goal of each further mesh is lowered, since the previous one missed it.
GOAL_FACTOR = 0.6
#: Size of the cells of the first mesh over the thickness of the part and the degree.
INITIAL_SIZE_RATIO = 1.5
#: Sizes of the cells of a first mesh of a shell on the diagonal of the part.
CELLS_ALONG_DIAGONAL = 10
#: Most meshes, and largest growth of the number of cells from one to the next: sizes halved.
MAX_MESHES, MAX_CELL_GROWTH = 12, 8.0
#: Power of the number of dofs by which seconds grow, by dimension.
SECONDS_DOF_POWER = {1: 1.0, 2: 1.2, 3: 1.5}
#: Bytes of a factor over a power of the number of dofs, and this power; by dimension.
FACTOR_BYTES = {1: 200.0, 2: 400.0, 3: 240.0}
FACTOR_BYTES_DOF_POWER = {1: 1.0, 2: 1.1, 3: 4 / 3}
#: Shares of the tolerance for the truncation and the time steps; the mesh gets the rest.
TRUNCATION_SHARE, TIME_SHARE = 0.2, 0.05
#: Least and largest tolerance of the time integration.
MIN_TIME_TOL, MAX_TIME_TOL = 1e-6, 1e-3
#: First and largest number of anti-oscillators.
INITIAL_COUNT, MAX_COUNT = 20, 300
#: Amplitude directions with a smaller share of |weights| are left out of the errors of cells.
NEGLIGIBLE_WEIGHT = 1e-8


#: Simulates the impact on a model to a tolerance.
RunFunction: TypeAlias = Callable[[AntiOscillators, float], History]
#: Element family of all cells, or group -> element family.
Material: TypeAlias = Family | Mapping[str, Family]


@collective()
@checks.within_range
def strike(
    source: str | Path | Mesh | Structure,
    site: Site,
    impactor: LinearBody,
    contact: AnyLaw = AUTO,
    duration: float = checks.REQUIRED,
    *,
    tol: float,
    stress_tol: float | None = None,
    material: Family | Mapping[str, Family] | None = None,
    supports: Sequence[Support] = (),
    prestress: Prestress | None = None,
    order: int = 2,
    limit: float | None = None,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
    gap: float | None = None,
) -> History:
    """The impact on a part, with errors of peak force, impulse and contact time of at most tol.

    Parameters
    ----------
    source : path, Mesh or Structure
        A solid, a shell of triangles, or lines with `material=Beam(...)`. A geometry is meshed
        as finely as the impact needs. A mesh of straight triangles or tetrahedra is divided where
        it is too coarse, a mesh of lines everywhere, with a node at the site. Other meshes, and a
        `Structure`, are not refined: the error bar then shows their accuracy.
    site : Site
        If it has no radius, one between the contact radius and half the thickness of the part is
        chosen; beams are struck at a point, shells on a patch of their thickness.
    impactor, contact, duration, initial_velocity, gravity, gap : as for `simulate`.
    tol : float
        Largest relative error of the three quantities according to the error budget.
    stress_tol : float, optional
        Largest relative mesh error of the largest stress. `stresses` of the history has a
        `PeakField` for each criterion, on meshes that are refined where its bounds are wide, with
        the same law, patch and number of anti-oscillators.
    material, supports, prestress : as for `Structure`, for a file or a mesh.
    order : 1 or 2
        Degree of the displacements, and of the faces of a geometry's cells.
    limit : float, optional
        Largest total computing time [s]. A further mesh is made only if it is expected to be
        computed in time; by default only the memory limits the meshes.

    Returns
    -------
    History
        The history on the last mesh, with its corrected model (for shells the uncorrected one) and
        `error_budget`; `model.info["strike"]` lists the meshes. Sheets with a large deflection have
        second-order forces, as for `extract(…, stretch="auto")`. If the budget exceeds `tol`, the
        status is 1 and the message says what it would cost to meet it.

    Raises
    ------
    InputError
        No material, or an element family without an error estimate; arguments that `extract` and
        `simulate` refuse.
    """
    blow: dict[str, Any] = {"initial_velocity": initial_velocity, "gravity": gravity, "gap": gap}

    def run(model: AntiOscillators, error: float) -> History:
        return simulate(model, impactor, contact, duration, tol=error, **blow)

    given = source, site, impactor, run, tol, material, supports, order, limit
    return strike_to_tolerance(*given, prestress=prestress, stress_tol=stress_tol)


def strike_to_tolerance(
    source: str | Path | Mesh | Structure,
    site: Site,
    impactor: LinearBody,
    run: RunFunction,
    tol: float,
    material: Material | None,
    supports: Sequence[Support],
    order: int,
    limit: float | None,
    report: ReportAnswer | None = None,
    prestress: Prestress | None = None,
    asked: float | None = None,
    stress_tol: float | None = None,
) -> History:
    """The result of `strike`; arguments are as for `strike`, except:

    run : the impact, `run(model, error in time)`; report : called with the `MeshAnswer` on each
    mesh and its site; asked : tolerance to name in messages, if it is not `tol`.
    """
    start_time = time.perf_counter()
    tol = checks.tolerance(tol)
    asked = tol if asked is None else asked
    if stress_tol is not None:
        stress_tol = checks.tolerance(stress_tol)
    order = checks.whole("order", order, least=1, most=2)
    if limit is not None:
        limit = checks.positive("limit", limit, "s")
    checks.instance("site", site, Site, "a Site(point, direction)")
    material = _material_of(source, material, supports, prestress)

    if isinstance(source, Structure):
        result = answer_on_mesh(source, site, run, tol, INITIAL_COUNT)
        if report is not None:
            report(result, site)
        reason = ""
        if result.budget.numerical > tol:
            reason = (
                "The structure was used as it is: give mesh, material and supports to refine it."
            )
        hit = _finished_history(result, tol, asked, [mesh_record(result)], reason)
        if stress_tol is None:
            return hit

        divided = partial(stress.divided, source)
        return _with_stresses(hit, source, stress_tol, divided, site, result.n)

    place = mesh_source(
        source if isinstance(source, Mesh) else checks.path("source", source), order
    )
    site, mesh = _first_mesh(place, site, impactor, material, order)
    before: MeshAnswer | None = None
    n = INITIAL_COUNT
    records = []

    with warnings_of_last() as drop:
        while True:
            structure = Structure(mesh, material, supports, order=order, prestress=prestress)
            result = answer_on_mesh(structure, site, run, tol, n)
            if mesh.tdim == 1:
                result = with_change_since(result, before)
            before = result
            if report is not None:
                report(result, site)
            records.append(mesh_record(result))
            reason = place.fixed
            if len(records) == MAX_MESHES:
                reason = reason or f"{MAX_MESHES} meshes were made."
            meets_tol = result.budget.numerical <= tol and (mesh.tdim > 1 or len(records) > 1)
            if meets_tol:
                reason = ""
            elif not reason:
                costs = limit, start_time, len(records)
                ratio, reason = _next_mesh(result, mesh, order, tol, *costs, asked)

            if reason or meets_tol:
                structure.drop_factor()
                hit = _finished_history(result, tol, asked, records, reason)
                break
            drop()
            n = min(2 * result.n, MAX_COUNT) if mesh.tdim == 1 else result.n
            mesh = place.finer(mesh, ratio)

    if stress_tol is None:
        return hit

    def finer(refine: Sequence[Refinement]) -> Structure:
        around = place.around(mesh, refine)
        return Structure(around, material, supports, order=order, prestress=prestress)

    return _with_stresses(hit, structure, stress_tol, finer, site, result.n)


def _with_stresses(
    hit: History, structure: Structure, tol: float, finer: stress.MakeFiner, site: Site, n: int
) -> History:
    """The history with stress fields whose mesh error bars are at most `tol`; on meshes by `finer`
    it is computed anew, with `n` anti-oscillators at the site."""

    def struck(part: Structure) -> History:
        return stress.struck_again(hit, part, extract(part, site, n=n))

    closed = stress.closed(hit, structure, tol, finer, struck, stress.fields_by_strength)
    return replace(hit, stresses=closed.fields)


def _material_of(
    source: object,
    material: Material | None,
    supports: Sequence[Support],
    prestress: Prestress | None,
) -> Material:
    """The material, {} for a Structure; InputError if it is missing or superfluous."""
    if isinstance(source, Structure):
        if material is not None or len(supports) or prestress is not None:
            raise InputError(
                "a Structure has its own material, supports and prestress: leave them out."
            )
        return {}
    if not isinstance(source, str | Path | Mesh):
        raise InputError(
            "source must be a file with a geometry or a mesh, a Mesh or a Structure; got "
            f"{checks.shown(source)}."
        )
    if material is None or (isinstance(material, Mapping) and not material):
        raise InputError("a file or a mesh needs a material.")
    return material


def _first_mesh(
    place: MeshSource, site: Site, impactor: LinearBody, material: Material, order: int
) -> tuple[Site, Mesh]:
    """(site with a radius, first mesh): the coarsest mesh with a reliable error budget."""
    solids = list(material.values()) if isinstance(material, Mapping) else [material]
    sheet = any(getattr(getattr(one, "kind", None), "sheet", False) for one in solids)
    if sheet:  # whose bars do not ask for a patch that is resolved
        return site, place.first(place.extent() / CELLS_ALONG_DIAGONAL, [])
    thickness = place.thickness()
    if site.radius is None and site.point is not None and isinstance(solids[0], Solid):
        half = thickness / 2
        radius = half / 1.5
        if isinstance(impactor, RigidMass | Sphere):
            E, nu, rho = solids[0].constants()
            with suppress(InputError):  # of a striker without a shape or a velocity
                contact = advise((thickness,) * 3, impactor, E=E, nu=nu, rho=rho).contact_radius
                radius = min(math.sqrt(contact * half), half)
        site = replace(site, radius=radius)
    refine: list[tuple[Sequence[float], float]] = []
    has_patch = site.radius is not None or isinstance(solids[0], Beam)
    if has_patch and site.point is not None and not isinstance(site.point, str):
        refine.append((site.point, site.radius or 0.0))
    return site, place.first(INITIAL_SIZE_RATIO * order * thickness, refine)


# -- the answer of one mesh, and what the mesh before tells of it


@dataclass(frozen=True)
class MeshAnswer:
    """The result on one mesh: histories, error budget, number of anti-oscillators and seconds."""

    structure: Structure
    raw: History  # of the raw model
    hit: History  # of the corrected model; for shells `raw`
    budget: ErrorBudget  # of `hit`
    n: int
    seconds: float  # with n anti-oscillators from the start


def answer_on_mesh(
    structure: Structure, site: Site, run: RunFunction, tol: float, n: int
) -> MeshAnswer:
    """The `MeshAnswer` of a mesh; the number of anti-oscillators is doubled until it suffices."""
    accuracy = accuracy_of_steps(tol)
    limit = min(MAX_COUNT, structure.dofs - 1)
    n = min(n, limit)

    with warnings_of_last() as drop:
        while True:
            try:
                result = answer_with_n(structure, site, run, accuracy, n)
            except RangeError:  # of too few, which move too little: their force is larger
                if n >= limit:
                    raise
            else:
                truncation = max(bar.truncation for bar in result.budget.values())
                last = n >= limit or result.raw.model.n < n
                if last or truncation <= _truncation_goal(result.budget, tol):
                    return result
            n = min(2 * n, limit)
            drop()


def answer_with_n(
    structure: Structure, site: Site, run: RunFunction, accuracy: float, n: int
) -> MeshAnswer:
    """The `MeshAnswer` for `n` anti-oscillators, whatever the error; `accuracy`: of the steps."""
    structure.factorize()
    start_time = clock() - structure.seconds["factorization"]
    proof = not structure.matrices.dissipation()
    model = extract(structure, site, n=n, error="estimate", proof=proof)
    raw = second_order.simulated(structure, model, lambda one: run(one, accuracy))

    hit, budget = raw, raw.error_budget

    # a shell's corrected model is not always nearer
    if model.strain_misfit is None and not raw.assembly.theory_warning:
        hit = run(raw.model.corrected(), accuracy)
        hit.assembly.omitted_stretch_ratio = raw.assembly.omitted_stretch_ratio
        budget = budget.of_corrected(hit)

    return MeshAnswer(structure, raw, hit, budget, n, clock() - start_time)


def accuracy_of_steps(tol: float) -> float:
    """Tolerance of the time integration for a tolerance of the whole budget."""
    return float(np.clip(TIME_SHARE * tol, MIN_TIME_TOL, MAX_TIME_TOL))


#: Function that is called with the answer on a mesh and its site.
ReportAnswer: TypeAlias = Callable[[MeshAnswer, Site], None]


def with_change_since(answer: MeshAnswer, before: MeshAnswer | None) -> MeshAnswer:
    """The answer on a mesh of lines, with mesh error bars of at least the change since `before`."""
    if before is None:
        return answer
    change = with_floor(relative_changes(before.hit, answer.hit))
    bars = dict(answer.budget.bars)
    for name, bar in answer.budget.items():
        bars[name] = replace(bar, mesh=max(bar.mesh, change[name]))
    return replace(answer, budget=replace(answer.budget, bars=bars))


def _truncation_goal(budget: ErrorBudget, tol: float) -> float:
    """Truncation error below which an answer needs no further anti-oscillators."""
    share = TRUNCATION_SHARE * tol
    if all(bar.mesh + bar.time + bar.patch + share <= tol for bar in budget.values()):
        return share
    return max(share, *(bar.mesh for bar in budget.values()))


def mesh_record(answer: MeshAnswer) -> dict[str, float]:
    """The record of one mesh, as JSON values: its size, seconds, errors and peak force [N]."""
    return {
        "dofs": answer.structure.dofs,
        "n": answer.n,
        "seconds": answer.seconds,
        "mesh": max(bar.mesh for bar in answer.budget.values()),
        "total": answer.budget.numerical,
        "peak_force": answer.hit.peak_force,
    }


# -- the next mesh


def _next_mesh(
    answer: MeshAnswer,
    mesh: Mesh,
    order: int,
    tol: float,
    limit: float | None,
    start_time: float,
    meshes: int,
    requested: float,
) -> tuple[Array, str]:
    """(ratio of new to old size of each cell for the next mesh, "" or why there is none)."""
    allowed = _room_for_mesh(answer.budget, tol)
    if min(allowed.values()) < MIN_MESH_SHARE * tol:
        return np.ones(0), _no_room_text(answer, requested)

    truncation = max(bar.truncation for bar in answer.budget.values())
    if answer.n >= MAX_COUNT and truncation > TRUNCATION_SHARE * tol:
        return np.ones(0), (
            f"{MAX_COUNT} anti-oscillators, the most that are tried, leave {percent(truncation)} by"
            f" truncation: take a tol of at least {percent(rounded_up(answer.budget.numerical))}."
        )

    # the mesh errors with the usual safety factor over those with the present one
    safety = answer.budget.safety
    usual = (SAFETY - 1) / (safety - 1)
    if answer.raw.model.info.get("divided") == "triangle":
        usual = SAFETY * TRIANGLE_FACTOR / safety
    meshed = [(name, bar.mesh) for name, bar in answer.budget.items() if bar.mesh]
    goal = min(allowed[name] / (usual * error) for name, error in meshed)
    goal *= GOAL_FACTOR ** (meshes - 1)

    structure = answer.structure
    dim = mesh.tdim
    energies = _cell_errors(answer, mesh)
    ratio = division.size_ratios(mesh.comm, energies, min(goal, MAX_GOAL_RATIO), order, dim)

    growth = full_growth = division.cell_growth(mesh.comm, ratio, dim)
    if growth > MAX_CELL_GROWTH:
        goal = goal * (growth / MAX_CELL_GROWTH) ** (2 * order / dim)
        ratio = division.size_ratios(mesh.comm, energies, min(goal, MAX_GOAL_RATIO), order, dim)
        growth = division.cell_growth(mesh.comm, ratio, dim)

    growth = max(growth, 1.0)
    dofs = structure.dofs * max(full_growth, 1.0)
    seconds = answer.seconds * max(full_growth, 1.0) ** SECONDS_DOF_POWER[dim]
    spent = time.perf_counter() - start_time
    expected = spent + answer.seconds * growth ** SECONDS_DOF_POWER[dim]
    required_bytes = FACTOR_BYTES[dim] * (structure.dofs * growth) ** FACTOR_BYTES_DOF_POWER[dim]
    free = free_memory()
    stopped = ""
    if limit is not None and expected > limit:
        stopped = f"Stopped before the limit of {limit:g} s"
    elif required_bytes > MEMORY_SHARE * free:
        stopped = f"Stopped for the next mesh takes more than the {free / 1e9:.2g} GB free"

    cost = f"about {plain_number(dofs)} dofs would meet it, in some {plain_number(seconds)} s more"
    message = f"{stopped}: a mesh of {cost}." if stopped else ""
    return ratio, on_root(structure.comm, lambda: message)


def _cell_errors(answer: MeshAnswer, mesh: Mesh) -> Array:
    """Errors of the cells of this rank, weighted by the shapes' amplitudes during the contact."""
    if mesh.tdim == 1:  # all lines are divided alike
        return np.ones(compat.cell_index_map(mesh.dolfinx).size_local)
    values, vectors = np.linalg.eigh(amplitude_products(answer.raw))
    significant = values > NEGLIGIBLE_WEIGHT * values[-1]
    weights = vectors[:, significant] * np.sqrt(values[significant])
    return ModelErrors(answer.structure).of_cells(answer.raw.model, weights)


def _room_for_mesh(budget: ErrorBudget, tol: float) -> dict[str, float]:
    """Relative error that the tolerance leaves for the mesh, for each quantity."""
    return {
        name: AIMED_TOL_SHARE * (tol - bar.time - bar.patch - bar.stretch)
        - min(bar.truncation, TRUNCATION_SHARE * tol)
        for name, bar in budget.items()
    }


def _no_room_text(answer: MeshAnswer, tol: float) -> str:
    """Sentence on why no finer mesh brings the budget within the tolerance, and on the remedy."""
    budget = answer.budget
    bar = max(budget.values(), key=lambda one: one.time + one.patch + one.stretch)
    shares = {"time steps": bar.time, "patch": bar.patch, "second-order forces": bar.stretch}
    words = [f"{name} {percent(share)}" for name, share in shares.items() if share]

    return (
        f"A finer mesh does not help: what does not depend on it ({', '.join(words)}) leaves too"
        f" little of {percent(tol)} for mesh and truncation; take a smaller radius of the site, or"
        f" a tol of at least {percent(rounded_up(budget.numerical))}."
    )


def _finished_history(
    answer: MeshAnswer, aim: float, tol: float, records: list[dict[str, float]], reason: str
) -> History:
    """The history with its budget; `aim`: numerical tolerance, `reason`: why no mesh follows."""
    hit = answer.hit
    budget = answer.budget
    model = replace(hit.model, info=hit.model.info.having(strike=records))
    dofs = ", ".join(str(record["dofs"]) for record in records)
    worst = budget.numerical
    if aim < tol and worst <= tol:
        reason = ""
    story = f"Meshes of {dofs} dofs; bar without law {100 * worst:.2g} % for tol = {100 * tol:g} %."
    reason = reason or budget.unknown.get("mesh", "") or _missed_by_law(budget, tol)
    if reason:
        budget = replace(budget, notes=(*budget.notes, reason))

    return replace(
        with_model(hit, model),
        status=1 if reason and hit.status == 0 else hit.status,
        message=" ".join(filter(None, (hit.message, story, reason))),
        budget=budget,
        structure=answer.structure,
    )


def _missed_by_law(budget: ErrorBudget, tol: float) -> str:
    """Sentence if only the error of the contact law raises a bar above the tolerance; else ""."""
    worst = budget.worst
    if worst is None or worst <= tol:
        return ""
    law = max(bar.law or 0.0 for bar in budget.values())
    return (
        f"The contact law is known to {percent(law)}: the bar with it is {percent(worst)}, above"
        f" tol = {percent(tol)}, and no finer mesh helps; a measured law or measured strengths of"
        " both bodies would."
    )
