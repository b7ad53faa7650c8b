"""How good error budgets are: random solid parts and impacts, against adapted meshes.

Plates and blocks with holes and notches, held or free, struck fast or slowly, with elements of
degree 1 and 2. Each is meshed coarsely, and its error budget is compared with the same impact on a
corrected model of a mesh of degree 2 that is adapted until its own errors of strains are a fiftieth
of the coarse one's. Printed are, by class, the effectivity (estimated over true error) of k0 and of
the worst quantity of the force, how often all three bars hold, the error of the corrected model
over that of the raw one, how often its bars hold, how often `strike` from the geometry has a true
error within its tolerance, and how often its bars hold where a second mesh was needed.

Each part has a number and random numbers of its own. With `--out` every part is written to a file
as soon as it is done; parts that stand there are not done again, so that a long sample can be
stopped and continued, and a histogram is drawn.

    .venv/bin/python benchmarks/error_budget.py --help
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import options
from random_parts import Case, drawn, geometry

import antiosc as ao
from antiosc import plotting
from antiosc.impact.error_budget import amplitude_products
from antiosc.impact.histories.bars import QUANTITIES, relative_differences
from antiosc.reduce.error.division import cell_growth, mesh_source, size_ratios
from antiosc.reduce.error.model_errors import ModelErrors

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
#: Error of a reference over that of the mesh, and its largest one (shares of the energy), by
#: dimension; most dofs of a reference, most of its meshes.
REFERENCE, MOST_SHARE, MOST_DOFS, ROUNDS = 0.02, {2: 5e-4, 3: 5e-3}, {2: 60_000, 3: 60_000}, 4
#: Every so many parts one is a block.
BLOCKS = 6
#: Tolerance of `strike`, and by dimension one for which most parts need a second mesh.
ASKED, FINE = 0.01, {2: 3e-4, 3: 3e-3}
#: Bounds of good effectivities: of k0, by dimension, and of the force.
GOOD_K0, GOOD_FORCE = {2: (0.5, 2.0), 3: (0.4, 2.5)}, (0.5, 3.0)
ANTI_OSCILLATORS, TIME_TOL = 30, 1e-5
#: The same of the truth, whose own errors are no errors of the bars.
TRUE_ANTI_OSCILLATORS, TRUE_TIME_TOL = 60, 1e-6


def main(parts: int = 20, seed: int = 0, dim: int = 0, out: str = "") -> list[Case]:
    """Try `parts` random parts, all of one dimension if that is given.

    Cases are added to the file `out` (a JSON object a line), those that it holds are not tried
    again.
    """
    path = Path(out) if out else None
    known = read(path) if path else {}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        for number in range(parts):
            if number in known:
                continue
            rng = np.random.default_rng([seed, number])
            case = drawn(number, rng, dim or (2, 3)[number % BLOCKS == BLOCKS - 1])
            try:
                tried(case, Path(folder) / "part.geo", rng)
            except ao.AntioscError as error:
                case.refused = str(error)
            known[number] = case
            print(line(case), flush=True)
            if path:
                with path.open("a") as file:
                    file.write(json.dumps(asdict(case)) + "\n")
    cases = [known[number] for number in sorted(known) if number < parts]
    done = [case for case in cases if not case.refused]
    print(table(done))
    if path:
        histogram(done, path.with_suffix(".png"))
    return cases


def read(path: Path) -> dict[int, Case]:
    """The cases of a file by their numbers."""
    if not path.exists():
        return {}
    found = [Case(**json.loads(row)) for row in path.read_text().splitlines()]
    return {case.number: case for case in found}


def line(case: Case) -> str:
    """What was found, for the eye."""
    if case.refused:
        return f"{case.number:4d} refused: {case.refused}"
    left_out = ("all", f"{case.dim}-D", f"{case.dim}-D, patch resolved")
    left_out += (f"order {case.order}, patch resolved",)
    kind = ", ".join(name for name in case.kinds if name not in left_out)
    return (
        f"{case.number:4d} k0 {case.k0:5.2f}  force {case.force:5.2f}  bar "
        f"{'holds' if case.holds else 'FAILS'} ({case.worst_ratio:.2f} of it)  corrected/raw "
        f"{case.corrected:.2f}  {case.dofs} dofs, {kind}"
    )


def tried(case: Case, path: Path, rng: np.random.Generator) -> None:
    """Fill in what is found."""
    length, width, depth = 0.2 * rng.uniform(0.7, 1.3), 0.08, 0.03
    path.write_text(geometry(case, rng, length, width, depth))
    x = length * rng.uniform(0.55, 0.8)
    if case.dim == 2:
        material = ao.Solid(**STEEL, plane="stress", thickness=0.01)
        site = ao.Site((x, width), (0, -1), radius=case.radius)
    else:
        material = ao.Solid(**STEEL)
        point = (x, width * rng.uniform(0.4, 0.6), depth)
        case.radius = min(case.radius, 0.4 * depth)
        site = ao.Site(point, (0, 0, -1), radius=case.radius)
    held = [ao.Support(plane=((0, 0, 0), (1, 0, 0)))] if case.held else []
    refine = [(site.point, case.radius)] if case.resolved else []

    def structure(mesh: ao.Mesh, order: int) -> ao.Structure:
        return ao.Structure(mesh, material, held, order=order)

    impact = ao.RigidMass(case.mass, 1.0), ao.Hertz(2e9)

    def span(model: ao.AntiOscillators) -> float:
        longer = 8 * np.sqrt(case.mass / model.k0) if case.held else 0.0
        return float(8e-4 * case.mass**0.4 + longer)

    def struck(model: ao.AntiOscillators, tol: float = TIME_TOL) -> ao.History:
        return ao.simulate(model, *impact, span(model), tol=tol)

    part = structure(ao.read_mesh(path, case.size, refine=refine, order=case.order), case.order)
    model = ao.extract(part, site, n=ANTI_OSCILLATORS, error="estimate")
    hit, soft = struck(model), struck(model.corrected())
    budget = hit.error_budget
    goal = min(share(model) * REFERENCE, MOST_SHARE[case.dim])
    true_model = reference(case, path, site, structure, struck, goal)
    case.reference = share(true_model) / share(model)
    true_model = true_model.corrected()
    true = struck(true_model, TRUE_TIME_TOL)
    for tol in (ASKED, FINE[case.dim]):
        answer = ao.strike(
            path, site, *impact, span(model), tol=tol, material=material, supports=held
        )  # fmt: skip
        missed = relative_differences(answer, true)
        if tol == ASKED:
            case.strike_true, case.strike_promised = max(missed.values()), answer.error_budget.worst
            case.strike_met = bool(answer.status == 0)
        case.strike_meshes = len(answer.model.info["strike"])
        bars = {name: bar.total - bar.patch for name, bar in answer.error_budget.items()}
        case.strike_ratio = max(missed[name] / bars[name] for name in QUANTITIES)
    case.speed = hit.contact_time * float(model.omega[0]) / (2 * np.pi)
    case.dofs, case.energy_error = part.dofs, budget.energy_error
    case.k0 = effectivity_of_stiffness(model, true_model)
    estimated, actual = relative_differences(hit, soft), relative_differences(hit, true)
    worst = max(actual, key=lambda name: actual[name])
    case.force = estimated[worst] / actual[worst]
    bars = {name: bar.total - bar.patch for name, bar in budget.items()}
    case.worst_ratio = max(actual[name] / bars[name] for name in QUANTITIES)
    case.holds = bool(case.worst_ratio <= 1)
    left = relative_differences(soft, true)
    case.corrected = max(left.values()) / actual[worst]
    bars = {name: bar.total - bar.patch for name, bar in budget.of_corrected(soft).items()}
    case.answer_ratio = max(left[name] / bars[name] for name in QUANTITIES)


def share(model: ao.AntiOscillators) -> float:
    """Error of the first shape with strains over its energy."""
    first = 0 if model.k0 else 1
    energy = model.k0 or model.k[0]
    return float(model.strain_error[first, first] / energy)


def effectivity_of_stiffness(model: ao.AntiOscillators, true: ao.AntiOscillators) -> float:
    """Of k0, or of the first ω² of a free part."""
    raw, soft, exact = (each.k0 or each.omega[0] ** 2 for each in (model, model.corrected(), true))
    return float((raw - soft) / (raw - exact))


def reference(case, path, site, structure, struck, goal):  # type: ignore[no-untyped-def]
    """A model on an adapted mesh of degree 2 with at most this share of errors in its energy."""
    source = mesh_source(path)
    mesh = source.first(case.size, [(site.point, case.radius)])
    for _ in range(ROUNDS):
        part = structure(mesh, 2)
        model = ao.extract(part, site, n=TRUE_ANTI_OSCILLATORS, error="estimate")
        if share(model) <= goal or part.dofs > MOST_DOFS[case.dim] / 2:
            break
        wanted = max(0.5 * goal / share(model), 1e-3)
        most = MOST_DOFS[case.dim] / part.dofs
        ratio = np.minimum(finer(part, model, struck(model), wanted, 2, most), 1.0)
        mesh = source.finer(mesh, ratio)
    return model


def finer(part, model, hit, goal, order, most):  # type: ignore[no-untyped-def]
    """New over old sizes of cells that bring the errors of force and stiffness down to `goal`.

    `most`: largest growth of the number of dofs.
    """
    mesh = part.mesh
    values, vectors = np.linalg.eigh(amplitude_products(hit))
    weights = vectors * np.sqrt(np.maximum(values, 0.0))
    energies = ModelErrors(part).of_cells(model, weights)
    # also the first shape, whose stiffness is compared
    first = ModelErrors(part).of_cells(model, np.eye(len(values))[:, :2])
    energies = energies / energies.sum() + first / first.sum()
    ratio = size_ratios(mesh.comm, energies, goal, order, mesh.tdim)
    grown = cell_growth(mesh.comm, ratio, mesh.tdim)
    return ratio * max(1.0, grown / most) ** (1 / mesh.tdim)


def table(cases: Sequence[Case]) -> str:
    """Figures by class, as a table in Markdown."""
    rows = [
        "| class | parts | k0 within | median | force within | median | bars hold | corrected "
        "| its bars hold | strike | two meshes: bars hold |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for kind in sorted({kind for case in cases for kind in case.kinds}):
        own = [case for case in cases if kind in case.kinds]
        k0, force = (np.array([getattr(c, name) for c in own]) for name in ("k0", "force"))
        good = [GOOD_K0[c.dim][0] <= c.k0 <= GOOD_K0[c.dim][1] for c in own]
        well = [GOOD_FORCE[0] <= c.force <= GOOD_FORCE[1] for c in own]
        rows.append(
            f"| {kind} | {len(own)} | {np.mean(good):.0%} | {np.median(k0):.2f} | "
            f"{np.mean(well):.0%} | {np.median(force):.2f} | "
            f"{np.mean([c.holds for c in own]):.0%} | "
            f"{np.median([c.corrected for c in own]):.2f} | "
            f"{np.mean([c.answer_ratio <= 1 for c in own]):.0%} | "
            f"{np.mean([c.strike_true <= ASKED for c in own]):.0%} | {of_several(own)} |"
        )
    return "\n".join(rows)


def of_several(cases: Sequence[Case]) -> str:
    """How often the bars of `strike` hold where more than one mesh was made, and how many such."""
    some = [case.strike_ratio <= 1 for case in cases if case.strike_meshes > 1]
    return f"{np.mean(some):.0%} of {len(some)}" if some else ""


def histogram(cases: Sequence[Case], path: Path) -> None:
    """Effectivities of k0 and of the force, and true errors over their bars."""
    figure, grid = plotting.panels(1, 2, (9, 3.5))
    bins = np.geomspace(0.1, 10, 31)
    for name, label in (("k0", "k0"), ("force", "worst quantity of the force")):
        values = np.clip([getattr(case, name) for case in cases], bins[0], bins[-1])
        grid[0, 0].hist(values, bins=bins, histtype="step", label=label)
    grid[0, 0].set_xscale("log")
    grid[0, 0].set_xlabel("effectivity: estimated over true error")
    ratios = np.minimum([case.worst_ratio for case in cases], 2.0)
    grid[0, 1].hist(ratios, bins=np.linspace(0, 2, 41), histtype="step", label="worst of the three")
    grid[0, 1].axvline(1.0, color="black", linewidth=1)
    grid[0, 1].set_xlabel("true error over its bar")
    for axes in grid.flat:
        axes.set_ylabel("parts")
        axes.legend(loc="upper left")
    plotting.save_figure(figure, path, dpi=120)


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", type=options.count, default=20, help="random parts")
    parser.add_argument("--seed", type=options.seed, default=0, help="of the random parts")
    dims = "2: plates, 3: blocks, 0: one block in ten"
    parser.add_argument("--dim", type=int, choices=(0, 2, 3), default=0, help=dims)
    parser.add_argument("--out", default="", help="file for the cases, one a line")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
