"""Speed against accuracy: error of the impact force and of Z against seconds and against N.

Cases: a steel sphere's worth of mass on the article's pinned beam, a sphere on a thin clamped
plate, a sphere on the bracket at three sizes, a heavy mass on the bracket. Methods:
anti-oscillators by Krylov and by modes, mode superposition with and without static correction, the
unreduced model, and what an engineer writes with SciPy. Besides: how time and memory grow with the
size, maps of every point of the bracket and of a stiffened panel, two ranks against one.

Written: speed_accuracy.json, speed_accuracy.md (the tables) and a PNG for each case.

    make bench-speed        or        .venv/bin/python benchmarks/speed_accuracy.py --help
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import time
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import options
from mpi4py import MPI
from speed_cases import ROOT, Case, memory
from speed_methods import STEPS, explicit, measured, peer_scipy, proved, reduced, unreduced
from speed_tables import plot, tables

import antiosc as ao
from antiosc.base import files
from antiosc.models.free_modes import stiffness_error
from antiosc.reduce.site.map_sites import sites_of

#: A measurement in a process of its own.
_apart = partial(options.apart, __file__)

#: largest elements of the bracket, m: about 40 000, 100 000 and 220 000 dofs
SIZES = (6e-3, 3.2e-3, 2.2e-3)
#: a finer one, about 500 000 dofs, for the growth of time and memory alone
FINEST = 1.65e-3
COUNTS = {
    "Krylov": (2, 4, 6, 8, 10, 14, 17, 20, 30, 50),
    "modes": (4, 8, 20, 60),
    "superposition": (4, 8, 20, 60),
    "superposition, static correction": (4, 8, 20, 60),
}
#: mesh that tells the error of the coarsest mesh of a case
FINER = {"bracket": SIZES[-1], "bracket, heavy mass": SIZES[1]}
#: methods whose memory is measured
REMEMBERED = ("Krylov", "superposition, static correction", "unreduced, Newmark")
#: elements of the panel whose map is drawn, m; the finer one has more than 10 000 vertices
PANELS = (20e-3, 9.1e-3)
#: dofs up to which the unreduced model is run, and from which only every other count is
SMALL, LARGE = 60_000, 150_000


# --- Parts of the benchmark, each in a process of its own -----------------------------------------


def chart(name: str, size: float | None, quick: bool) -> dict[str, Any]:
    """Every method on one case."""
    case = Case(name, size)
    case.prepare()
    rows = []
    for method, counts in COUNTS.items():
        few = quick or (case.part.dofs > LARGE and method != "Krylov")
        for n in counts[:: 2 if few else 1]:
            if n < case.part.dofs // 2:
                rows.append(reduced(case, method, n))
    if name == "beam":
        started = time.perf_counter()
        model = ao.full(case.part, case.site)
        made = time.perf_counter() - started
        started = time.perf_counter()
        hit = ao.simulate(model, *case.impact, tol=1e-5)
        spent = time.perf_counter() - started
        error = case.error_of_force(hit.time, hit.force)
        label = "unreduced, all modes"
        rows.append(measured(case, label, model.n, made, spent, hit.time, hit.force))
        rows[-1] |= {"error Z": case.error_of_z(model), "error force": error}
    if case.part.dofs < SMALL:
        rows += [unreduced(case, steps) for steps in STEPS[name][: 1 if quick else None]]
        if name == "bracket" and not quick:
            rows.append(explicit(case))
        rows += [peer_scipy(case, n) for n in (15, 60) if n < case.part.dofs // 2]
    made = _chart(case, rows)
    if name == "bracket":
        made["proved"] = proved(case, (20, 30, 50, 80))
    return made


def _chart(case: Case, rows: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "case": case.name,
        "made": options.code_state(),
        "dofs": case.part.dofs,
        "band": case.band,
        "antiresonances in the band": int(np.sum(case.reference.omega < case.band)),
        "contact time": case.hit.contact_time,
        "peak force": case.hit.peak_force,
        "seconds": case.seconds,
        "rows": rows,
    }


def growth(size: float) -> dict[str, Any]:
    """Times and memory of a whole extraction of 20 anti-oscillators."""
    case = Case("bracket", size)
    started = time.perf_counter()
    ao.extract(case.part, case.site, n=20)
    krylov = time.perf_counter() - started
    return {
        "dofs": case.part.dofs,
        "ranks": case.part.comm.size,
        "seconds": {**case.seconds, "20 anti-oscillators": krylov},
        "over the floor": (case.before + krylov) / case.before,
        "mesh over the floor": case.seconds["mesh"] / case.before,
        "whole": case.before + krylov,
        "memory factored": case.memory_factored,
        "memory": memory(),
    }


def heavy_mass(size: float) -> dict[str, Any]:
    """The longer contact: reduced and unreduced at equal error."""
    case = Case("bracket, heavy mass", size)
    case.prepare()
    rows = [reduced(case, "Krylov", n, tol=1e-4) for n in (4, 10, 20, 30, 50)]
    for method in ("superposition", "superposition, static correction"):
        rows += [reduced(case, method, n, tol=1e-4) for n in COUNTS[method]]
    rows += [unreduced(case, steps) for steps in STEPS[case.name]]
    return _chart(case, rows)


def peak(name: str, size: float) -> float:
    """Peak force of a case on another mesh, N."""
    case = Case(name, size)
    model = ao.extract(case.part, case.site, n=30, shapes=False)
    return float(ao.simulate(model, *case.impact, tol=1e-4).peak_force)


def memory_of(name: str, size: float, method: str) -> float:
    """Peak memory of a process that makes the case and one run by a method, GB."""
    case = Case(name, size)
    case.reference = ao.extract(case.part, case.site, n=20, shapes=False)
    case.hit = ao.simulate(case.reference, *case.impact)
    case.time, case.force = case.hit.time, case.hit.force
    if method == "Krylov":
        return memory()
    if method == "unreduced, Newmark":
        unreduced(case, 6)
    else:
        ao.superposition(case.part, case.site, 20, static_correction=True)
    return memory()


def mapped(name: str, size: float, group: str | None) -> dict[str, Any]:
    """Every point of a surface, in CPU seconds, and some of them by direct extraction."""
    case = Case(name, size)
    started = time.process_time()
    ao.extract(case.part, case.site, n=12, shapes=False)
    alone = case.worked_before + time.process_time() - started
    options: dict[str, Any] = {"radius": 3e-3} if name == "bracket" else {"direction": (0, 0, -1)}
    started = time.process_time()
    found = ao.impact_map(case.part, group, **options)
    spent = time.process_time() - started
    some = 50 if case.part.dofs < LARGE else 20
    which = np.random.default_rng(0).choice(len(found), some, replace=False)
    sites = sites_of(case.part, group, options.get("direction"), options.get("radius")).sites
    loads = sites.loads
    direct = ao.extract(
        case.part,
        [ao.Site(vector=b) for b in loads[:, which].toarray().T],
        n=60,
        band=found.band,
        shapes=False,
    )
    off = [abs(found.models.k0[i] / one.k0 - 1) for i, one in zip(which, direct, strict=True)]
    Z = [
        stiffness_error(
            found.model(i).dynamic_stiffness,
            one.dynamic_stiffness,
            2 * np.pi * found.band,
            one.omega[0],
        )
        for i, one in zip(which, direct, strict=True)
    ]
    return {
        "part": name,
        "dofs": case.part.dofs,
        "sites": len(found),
        "skipped": found.skipped,
        "one extraction of 12 anti-oscillators, assembly and factor included": alone,
        "map": spent,
        "map over that": spent / alone,
        "assembly, factor and map over that": (case.worked_before + spent) / alone,
        "milliseconds for one more site": 1e3 * (spent - alone) / len(found),
        f"error of k0 at {some} sites, median and largest": [
            float(np.median(off)),
            float(max(off)),
        ],
        "error of Z there, median and largest": [float(np.median(Z)), float(max(Z))],
        "bound of Z of all, median and largest": [
            float(np.median(found.error)),
            float(found.error.max()),
        ],
    }


# --- The whole ------------------------------------------------------------------------------------


def main(
    out: Path = ROOT / "benchmarks/speed",
    sizes: tuple[float, ...] = SIZES,
    quick: bool = False,
    readme: bool = False,
) -> dict[str, Any]:
    """Run everything; write JSON, tables and pictures to `out`.

    Parameters
    ----------
    out : folder of the results
    sizes : largest elements of the bracket, m, from coarse to fine
    quick : fewer counts, and the coarsest bracket alone
    readme : the two cases of README's chart alone; the others stay as `out` has them
    """
    out.mkdir(parents=True, exist_ok=True)
    if readme:
        return _two_cases(out, sizes[0])
    if quick:
        sizes = sizes[:1]
    result: dict[str, Any] = {"charts": [], "growth": [], "ranks": [], "maps": []}
    for name, size in [("beam", None), ("plate", None), *(("bracket", s) for s in sizes)]:
        result["charts"].append(_apart("chart", name, size, quick))
        plot(result["charts"][-1], out)
        _report(result, out)
    result["charts"].append(_apart("heavy_mass", sizes[0]))
    for found in result["charts"]:
        if found["case"] in FINER and found["dofs"] < SMALL:
            _add_mesh_and_memory(found, sizes[0])
    plot(result["charts"][-1], out)
    for size in sizes if quick else (*sizes, FINEST):
        result["growth"].append(_apart("growth", size))
    result["ranks"] = [_apart("growth", sizes[-1], ranks=2)]
    _report(result, out)
    middle = sizes[min(1, len(sizes) - 1)]
    result["maps"] = [_apart("mapped", "bracket", middle, None)]
    if not quick:
        result["maps"] += [_apart("mapped", "panel", size, "skin") for size in PANELS]
    print(_report(result, out))
    return result


def _two_cases(out: Path, size: float) -> dict[str, Any]:
    """The two blows on the coarsest bracket, in place of those that `out` has."""
    result: dict[str, Any] = json.loads((out / "speed_accuracy.json").read_text(encoding="utf-8"))
    for found in (_apart("chart", "bracket", size, False), _apart("heavy_mass", size)):
        _add_mesh_and_memory(found, size)
        plot(found, out)
        names = [(one["case"], one["dofs"] < SMALL) for one in result["charts"]]
        result["charts"][names.index((found["case"], True))] = found
        _report(result, out)
    return result


def _add_mesh_and_memory(found: dict[str, Any], size: float) -> None:
    """Add the error of the peak by the mesh, and the memory of some methods, to a case."""
    finer = _apart("peak", found["case"], FINER[found["case"]])
    found["mesh error of the peak"] = abs(found["peak force"] / finer - 1)
    found["GB"] = {m: _apart("memory_of", found["case"], size, m) for m in REMEMBERED}


def _report(result: dict[str, Any], out: Path) -> str:
    """What there is so far, written to `out`."""
    files.write_text(out / "speed_accuracy.json", json.dumps(result, indent=1))
    text = tables(result)
    files.write_text(out / "speed_accuracy.md", text)
    return text


def _task(text: str) -> None:
    """A part of the benchmark, asked for by `options.apart`: its result as the last line."""
    logging.disable(logging.INFO)
    warnings.simplefilter("ignore")
    name, *arguments = json.loads(text)
    tasks = (chart, heavy_mass, growth, peak, memory_of, mapped)
    result = {task.__name__: task for task in tasks}[name](*arguments)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(result))


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks/speed")
    parser.add_argument("--sizes", type=options.positive, nargs="+", default=SIZES)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--readme", action="store_true")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--task"]:  # a process of its own for one measurement, see `options.apart`
        _task(sys.argv[2])
    else:
        command()
