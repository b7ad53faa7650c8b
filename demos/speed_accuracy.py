"""Speed against accuracy: error of the impact force and of Z against seconds and against N.

Cases: a steel sphere's worth of mass on the article's pinned beam, a sphere on a thin clamped
plate, a sphere on the bracket at three sizes, a heavy mass on the bracket. Methods:
anti-oscillators by Krylov and by modes, mode superposition with and without static correction, the
unreduced model, and, where they are installed, other people's tools on the same matrices (SciPy,
pyYeti, Exudyn). Besides: how time and memory grow with the size, what an extraction spends its time
on, maps of every point of the bracket and of a stiffened panel, two ranks against one.

Written: speed_accuracy.json, speed_accuracy.md (the tables) and a PNG for each case.

    make bench        or        .venv/bin/python demos/speed_accuracy.py --help
"""

from __future__ import annotations

import argparse
import cProfile
import importlib.util
import json
import logging
import pstats
import resource
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from math import cos, pi, radians, sin
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
import options
import scipy.integrate
import scipy.sparse
import scipy.sparse.linalg
from mpi4py import MPI

import antiosc as ao
from antiosc import files, plotting
from antiosc.fem.linalg.algebra import dot, multiply, sum_of
from antiosc.fem.linalg.compliance import compliances
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.linalg.solver_choice import factorize
from antiosc.fem.site.functionals import functional
from antiosc.fem.site.map_sites import sites_of
from antiosc.models.driving_point import stiffness_error
from antiosc.simulation.simulate import without_patch

#: A measurement in a process of its own.
_apart = partial(options.apart, __file__)

ROOT = Path(__file__).resolve().parent.parent
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}

#: largest elements of the bracket, m: about 40 000, 100 000 and 220 000 dofs
SIZES = (6e-3, 3.2e-3, 2.2e-3)
COUNTS = {
    "Krylov": (2, 4, 6, 8, 10, 14, 17, 20, 30, 50),
    "modes": (4, 8, 20, 60),
    "superposition": (4, 8, 20, 60),
    "superposition, static correction": (4, 8, 20, 60),
}
#: steps a contact of the integrators with a fixed step; the beam's contact has many sub-impacts
STEPS = {
    "beam": (1000, 4000),
    "plate": (25, 100),
    "bracket": (25, 100),
    "bracket, heavy mass": (2000, 8000),
}
#: elements of the panel whose map is drawn, m; the finer one has more than 10 000 vertices
PANELS = (20e-3, 9.1e-3)
#: dofs up to which the unreduced model is run, and from which only every other count is
SMALL, LARGE = 60_000, 150_000
REFERENCE = 120  # Krylov anti-oscillators of the reference


class Case:
    """A structure, its impact, the reference, and the band in which Z is compared."""

    def __init__(self, name: str, size: float | None = None) -> None:
        self.name = name
        started = time.perf_counter()
        mesh, material, supports, site, self.impact = CASES[name](size)
        self.seconds = {"mesh": time.perf_counter() - started}
        self.part = ao.Structure(mesh, material, supports)
        self.site = site
        self.part.factorize()
        self.seconds |= self.part.seconds
        self.memory_factored = _memory()
        self.before = self.seconds["assembly"] + self.seconds["factorization"]

    def prepare(self) -> None:
        """The reference: many Krylov anti-oscillators, and the impact on them, well converged."""
        n = min(REFERENCE, self.part.dofs // 3)
        self.reference = ao.extract(self.part, self.site, n=n, shapes=False)
        self.hit = ao.simulate(self.reference, *self.impact, tol=1e-6)
        # up to the first zero in the spectrum of a half-sine of the contact's length
        self.band = 3 * pi / self.hit.contact_time
        self.time = np.linspace(0, self.impact[2], 4001)
        self.force = np.interp(self.time, self.hit.time, self.hit.force)

    def error_of_z(self, model: Any) -> float:
        """Largest |dZ|/|Z| over the band."""
        body = model.modal()

        def Z(omega: Any) -> Any:
            return 1 / body.receptance(omega)

        if isinstance(model, ao.AntiOscillators):
            Z = model.dynamic_stiffness
        first = float(self.reference.omega[0])
        return stiffness_error(Z, self.reference.dynamic_stiffness, self.band, first)

    def error_of_force(self, time_: Any, force: Any) -> float:
        """Relative error of the force history in the L2 norm."""
        off = np.interp(self.time, time_, force) - self.force
        return float(np.linalg.norm(off) / np.linalg.norm(self.force))


# --- The three structures -------------------------------------------------------------------------


def beam(_: float | None) -> tuple[Any, ...]:
    """The article's case 2 at 1 m/s: a mass of half the beam's at mid-span."""
    mesh = ao.read_mesh(ROOT / "meshes/beam.msh", gdim=2)
    section = ao.Section.rectangle(2e-4**0.5, 2e-4**0.5)
    material = ao.Beam(E=67e9, nu=0.3, rho=2400, section=section)
    pins = [ao.Support(end, ("x", "y")) for end in ("left", "right")]
    impact = ao.RigidMass(mass=0.24, velocity=1.0), ao.Hertz(1.55e10), 4e-3
    return mesh, material, pins, ao.Site(point=(0.5, 0.0), direction=(0, -1)), impact


def plate(_: float | None) -> tuple[Any, ...]:
    """A steel sphere of 20 mm on a clamped steel plate of 200 x 200 x 8 mm, off its centre."""
    kind = dolfinx.mesh.CellType.quadrilateral
    corners = [np.zeros(2), np.full(2, 0.2)]
    mesh = ao.read_mesh(dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [32, 32], kind))
    edge = ao.Support(lambda x: np.isclose(np.abs(x[:2] - 0.1).max(axis=0), 0.1))
    site = ao.Site(point=(0.083, 0.117, 0.0), direction=(0, 0, -1))
    ball = ao.Sphere(radius=0.01, **STEEL, velocity=1.0)
    impact = ball, ball.hertz(STEEL["E"], STEEL["nu"]), 4e-4
    return mesh, ao.Shell(**STEEL, thickness=8e-3), [edge], site, impact


def bracket(size: float | None) -> tuple[Any, ...]:
    """A steel sphere of 20 mm on the eye of the bracket, obliquely."""
    angle = radians(35)
    point = (19.3e-3, 30e-3 + 18e-3 * sin(angle), 60e-3 + 18e-3 * cos(angle))
    where = ROOT / "meshes/bracket.geo"
    mesh = ao.read_mesh(where, size=size, refine=[(point, 2e-3)])
    site = ao.Site(point=point, direction=(-0.25, -sin(angle), -cos(angle)), radius=2e-3, snap=True)
    ball = ao.Sphere(radius=10e-3, **STEEL, velocity=2.0)
    law = ball.hertz(ALUMINIUM["E"], ALUMINIUM["nu"], radii=(18e-3, float("inf")))
    return mesh, ao.Solid(**ALUMINIUM), [ao.Support("clamp")], site, (ball, law, 4e-4)


def heavy(size: float | None) -> tuple[Any, ...]:
    """A mass of 10 kg falls on the bracket at 0.3 m/s: a contact of milliseconds that rings."""
    *part, (_, law, _) = bracket(size)
    return *part, (ao.RigidMass(mass=10.0, velocity=0.3), law, 8e-3)


def panel(size: float | None) -> tuple[Any, ...]:
    """A steel sphere of 30 mm on the stiffened panel, skin and blades as shells."""
    sys.path.insert(0, str(ROOT / "meshes"))
    import make_panel
    import stiffened_panel as demo

    with tempfile.TemporaryDirectory() as folder:
        make_panel.main(Path(folder), size or make_panel.SIZE)
        mesh = ao.read_mesh(Path(folder) / "panel.msh")
    skin, blade = (ao.Shell(**ALUMINIUM, thickness=t) for t in (2e-3, 3e-3))
    site = ao.Site(demo.surface(0.45, 5.0), demo.inward(5.0), snap=True)
    ball = ao.Sphere(radius=15e-3, **STEEL, velocity=2.0)
    law = ball.hertz(ALUMINIUM["E"], ALUMINIUM["nu"])
    materials = {"skin": skin, "stringers": blade, "frames": blade}
    return mesh, materials, [ao.Support("ends")], site, (ball, law, 4e-3)


CASES: dict[str, Callable[[float | None], tuple[Any, ...]]] = {
    "beam": beam,
    "plate": plate,
    "bracket": bracket,
    "bracket, heavy mass": heavy,
    "panel": panel,
}


# --- Methods: model and seconds after the factorization -------------------------------------------


def reduced(case: Case, method: str, n: int, tol: float | None = None) -> dict[str, Any]:
    """One model: its errors, the seconds to make it, and those to simulate with it."""
    started = time.perf_counter()
    if method in ("Krylov", "modes"):
        model = ao.extract(case.part, case.site, n=n, method=method.lower())
    else:
        model = ao.superposition(case.part, case.site, n, static_correction="static" in method)
    made = time.perf_counter() - started
    started = time.perf_counter()
    hit = ao.simulate(model, *case.impact, tol=tol)
    simulated = time.perf_counter() - started
    return {
        "method": method,
        "n": int(model.n),
        "seconds": made,
        "simulation": simulated,
        "total": case.before + made + simulated,
        "error Z": case.error_of_z(model),
        "error force": case.error_of_force(hit.time, hit.force),
    }


def unreduced(case: Case, steps: int) -> dict[str, Any]:
    """All dofs in time: Newmark's average acceleration, `steps` to one contact."""
    structure, (striker, law, duration) = case.part, case.impact
    h = case.hit.contact_time / steps
    law, _ = without_patch(law, case.reference, striker)
    mass = 1 / float(np.sum(striker.modal().b ** 2))
    comm, b = structure.comm, functional(structure, case.site).b
    started = time.perf_counter()
    A = factorize(sum_of(structure.K, 4 / h**2, structure.M))
    flexibility = A.solve(b)
    factored = time.perf_counter() - started
    alpha = float(dot(comm, b, flexibility)) + h**2 / (4 * mass)
    u, v, a = (np.zeros_like(b) for _ in range(3))
    w, speed, pull = 0.0, striker.velocity, 0.0
    times, forces, state = [0.0], [0.0], law.touch(speed)
    started = time.perf_counter()
    for k in range(int(duration / h)):
        rest = 4 / h**2 * u + 4 / h * v + a
        new = A.solve(multiply(structure.M, rest))
        trial = w + h * speed + h**2 / 4 * pull
        F = law.implicit(trial - float(dot(comm, b, new)), alpha, 0.0, 0.0, state, forces[-1])
        new += F * flexibility
        after = 4 / h**2 * new - rest
        v += h / 2 * (a + after)
        u, a = new, after
        w, speed, pull = trial - h**2 / 4 * F / mass, speed + h / 2 * (pull - F / mass), -F / mass
        times.append((k + 1) * h)
        forces.append(F)
    stepped = time.perf_counter() - started
    return {
        "method": "unreduced, Newmark",
        "n": structure.dofs,
        "steps a contact": steps,
        "seconds": factored,
        "simulation": stepped,
        "total": case.before + factored + stepped,
        "error Z": None,
        "error force": case.error_of_force(times, forces),
    }


# --- Other people's tools on the same matrices ----------------------------------------------------


def matrices(case: Case) -> tuple[Any, Any, Any, float]:
    """K, M and b without the fixed dofs, and the impactor's mass."""
    free = np.setdiff1d(np.arange(case.part.K.getSize()[0]), case.part.fixed)
    K, M = (csr(matrix)[free][:, free] for matrix in (case.part.K, case.part.M))
    b = functional(case.part, case.site).b[free]
    return K, M, b, 1 / float(np.sum(case.impact[0].modal().b ** 2))


def peer_scipy(case: Case, n: int) -> dict[str, Any]:
    """What an engineer writes: eigsh for n free modes, solve_ivp for their superposition."""
    K, M, b, mass = matrices(case)
    law, _ = without_patch(case.impact[1], case.reference, case.impact[0])
    started = time.perf_counter()
    x, phi = scipy.sparse.linalg.eigsh(K.tocsc(), n, M.tocsc(), sigma=0.0)
    made = time.perf_counter() - started
    modal = phi.T @ b

    def rate(_: float, y: Any) -> Any:
        q, w = y[:n], y[n]
        F = law.force(float(w - modal @ q), 0.0, ())
        return np.concatenate([y[n + 1 :], modal * F - x * q, [-F / mass]])

    start = np.zeros(2 * n + 2)
    start[-1] = case.impact[0].velocity
    started = time.perf_counter()
    run = scipy.integrate.solve_ivp(
        rate, (0, case.impact[2]), start, "DOP853", rtol=1e-6, atol=1e-12, dense_output=True
    )
    y = run.sol(case.time)
    force = [law.force(float(d), 0.0, ()) for d in y[n] - modal @ y[:n]]
    simulated = time.perf_counter() - started
    return _peer(case, "SciPy: eigsh, solve_ivp", n, made, simulated, case.time, force)


def peer_pyyeti(case: Case, steps: int) -> dict[str, Any]:
    """pyYeti's SolveNewmark (Nastran's scheme) on all dofs, contact explicit."""
    from pyyeti import ode

    K, M, b, mass = matrices(case)
    law, _ = without_patch(case.impact[1], case.reference, case.impact[0])
    size = len(b)
    m = scipy.sparse.block_diag([M, [[mass]]]).toarray()
    k = scipy.sparse.block_diag([K, [[0.0]]]).toarray()
    push = np.append(b, -1.0)
    h = case.hit.contact_time / steps
    count = int(case.impact[2] / h)
    forces = np.zeros(count)

    def contact(d: Any, j: int, _: float) -> Any:
        forces[j] = law.force(float(-push @ d[:, j]), 0.0, ())
        return forces[j : j + 1]

    started = time.perf_counter()
    solver = ode.SolveNewmark(m, np.zeros_like(m), k, h)
    solver.def_nonlin({"contact": (contact, push[:, None])})
    start = np.zeros(size + 1)
    start[-1] = case.impact[0].velocity
    solver.tsolve(np.zeros((size + 1, count)), d0=np.zeros(size + 1), v0=start)
    spent = time.perf_counter() - started
    return _peer(case, "pyYeti: SolveNewmark", size, 0.0, spent, h * np.arange(count), forces)


def peer_exudyn(case: Case, steps: int) -> dict[str, Any]:
    """Exudyn's GenericODE2 on all dofs, its trapezoidal rule."""
    import exudyn as exu
    from exudyn.utilities import NodeGenericODE2, ObjectGenericODE2, SensorNode

    K, M, b, mass = matrices(case)
    law, _ = without_patch(case.impact[1], case.reference, case.impact[0])
    size = len(b) + 1
    push = np.append(b, -1.0)
    system = exu.SystemContainer().AddSystem()
    start = np.zeros(size)
    start[-1] = case.impact[0].velocity
    node = system.AddNode(
        NodeGenericODE2(
            referenceCoordinates=[0.0] * size,
            initialCoordinates=[0.0] * size,
            initialCoordinates_t=list(start),
            numberOfODE2Coordinates=size,
        )
    )

    def contact(_mbs: Any, _t: float, _item: int, q: Any, _q_t: Any) -> Any:
        return push * law.force(float(-push @ np.asarray(q)), 0.0, ())

    system.AddObject(
        ObjectGenericODE2(
            nodeNumbers=[node],
            massMatrix=scipy.sparse.block_diag([M, [[mass]]]).toarray(),
            stiffnessMatrix=scipy.sparse.block_diag([K, [[0.0]]]).toarray(),
            forceUserFunction=contact,
        )
    )
    sensor = system.AddSensor(
        SensorNode(
            nodeNumber=node,
            storeInternal=True,
            outputVariableType=exu.OutputVariableType.Coordinates,
        )
    )
    system.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime = case.impact[2]
    settings.timeIntegration.numberOfSteps = int(case.impact[2] * steps / case.hit.contact_time)
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = case.hit.contact_time / steps
    started = time.perf_counter()
    system.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    spent = time.perf_counter() - started
    data = system.GetSensorStoredData(sensor)
    force = [law.force(float(-push @ row[1:]), 0.0, ()) for row in data]
    return _peer(case, "Exudyn: GenericODE2", size - 1, 0.0, spent, data[:, 0], force)


def _peer(
    case: Case, name: str, n: int, made: float, simulated: float, times: Any, force: Any
) -> dict[str, Any]:
    return {
        "method": name,
        "n": n,
        "seconds": made,
        "simulation": simulated,
        "total": case.seconds["assembly"] + made + simulated,
        "error Z": None,
        "error force": case.error_of_force(times, force),
    }


def peers(case: Case, small: bool) -> list[dict[str, Any]]:
    """What is installed, on what it can carry."""
    rows = [peer_scipy(case, n) for n in (15, 60) if n < case.part.dofs // 2]
    if small:
        for module, run in (("pyyeti", peer_pyyeti), ("exudyn", peer_exudyn)):
            if importlib.util.find_spec(module) is not None:
                rows += [run(case, steps) for steps in STEPS[case.name]]
    return rows


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
        rows.append(_peer(case, "unreduced, all modes", model.n, made, spent, hit.time, hit.force))
        rows[-1] |= {"error Z": case.error_of_z(model), "error force": error}
    if case.part.dofs < SMALL:
        rows += [unreduced(case, steps) for steps in STEPS[name][: 1 if quick else 2]]
        rows += peers(case, name == "beam")
    return _chart(case, rows)


def _chart(case: Case, rows: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "case": case.name,
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
        "whole": case.before + krylov,
        "memory factored": case.memory_factored,
        "memory": _memory(),
    }


def heavy_mass(size: float) -> dict[str, Any]:
    """The longer contact: reduced and unreduced at equal error."""
    case = Case("bracket, heavy mass", size)
    case.prepare()
    rows = [reduced(case, "Krylov", n, tol=1e-4) for n in (10, 20, 30, 50)]
    rows += [unreduced(case, steps) for steps in STEPS[case.name]]
    return _chart(case, rows)


def profile(size: float) -> dict[str, Any]:
    """What a whole extraction of 20 anti-oscillators spends its time on, seconds."""
    case = Case("bracket", size)
    run = cProfile.Profile()
    started = time.perf_counter()
    run.runcall(ao.extract, case.part, case.site, n=20)
    spent = time.perf_counter() - started
    found: dict[str, float] = {}
    calls = 0
    for (_, _, name), (count, _, _, total, _) in pstats.Stats(run).stats.items():  # type: ignore
        if name in PROFILED:
            found[PROFILED[name]] = found.get(PROFILED[name], 0.0) + total
            calls += count if name == "solve_block" else 0
    found["the rest"] = spent - sum(found.values())
    return {
        "dofs": case.part.dofs,
        "assembly": case.seconds["assembly"],
        "factorization": case.seconds["factorization"],
        **found,
        "number of solves": calls,
    }


#: functions whose time is told apart, none of which calls another
PROFILED = {
    "functional": "load of the site",
    "solve_block": "solves",
    "multiply": "products with K and M",
    "dot": "inner products of the basis",
}


def mapped(name: str, size: float, group: str | None) -> dict[str, Any]:
    """Every point of a surface, and some of them by direct extraction."""
    case = Case(name, size)
    started = time.perf_counter()
    ao.extract(case.part, case.site, n=12, shapes=False)
    alone = case.before + time.perf_counter() - started
    options: dict[str, Any] = {"radius": 3e-3} if name == "bracket" else {"direction": (0, 0, -1)}
    started = time.perf_counter()
    found = ao.impact_map(case.part, group, **options)
    spent = time.perf_counter() - started
    seconds = found.info["seconds"]
    some = 50 if case.part.dofs < LARGE else 20
    which = np.random.default_rng(0).choice(len(found), some, replace=False)
    sites = sites_of(case.part, group, options.get("direction"), options.get("radius")).sites
    loads = sites.loads
    started = time.perf_counter()
    compliances(case.part.factorize().cholesky, loads)
    each = seconds["sites"] + 2 * (time.perf_counter() - started) + seconds["models"]
    each /= len(found)
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
            found.model(i).dynamic_stiffness, one.dynamic_stiffness, found.band, one.omega[0]
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
        "assembly, factor and map over that": (case.before + spent) / alone,
        "seconds": seconds,
        "milliseconds for one more site": 1e3 * each,
        f"error of k0 at {some} sites, median and largest": [
            float(np.median(off)),
            float(max(off)),
        ],
        "error of Z there, median and largest": [float(np.median(Z)), float(max(Z))],
        "bound of Z of all, median and largest": [
            float(np.median(found.error)),
            float(found.error.max()),
        ],
        "sites extracted directly": int(found.direct.sum()),
    }


def _memory() -> float:
    """Peak memory of this process, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


# --- The whole ------------------------------------------------------------------------------------


def main(
    out: Path = ROOT / "demos/speed", sizes: tuple[float, ...] = SIZES, quick: bool = False
) -> dict[str, Any]:
    """Run everything; write JSON, tables and pictures to `out`.

    Parameters
    ----------
    out : folder of the results
    sizes : largest elements of the bracket, m, from coarse to fine
    quick : fewer counts, and the coarsest bracket alone
    """
    out.mkdir(parents=True, exist_ok=True)
    if quick:
        sizes = sizes[:1]
    result: dict[str, Any] = {"charts": [], "growth": [], "ranks": [], "profile": {}, "maps": []}
    for name, size in [("beam", None), ("plate", None), *(("bracket", s) for s in sizes)]:
        result["charts"].append(_apart("chart", name, size, quick))
        _plot(result["charts"][-1], out)
        _report(result, out)
    result["charts"].append(_apart("heavy_mass", sizes[0]))
    _plot(result["charts"][-1], out)
    for size in sizes:
        result["growth"].append(_apart("growth", size))
    result["ranks"] = [_apart("growth", sizes[-1], ranks=2)]
    result["profile"] = _apart("profile", sizes[-1])
    _report(result, out)
    middle = sizes[min(1, len(sizes) - 1)]
    result["maps"] = [_apart("mapped", "bracket", middle, None)]
    if not quick:
        result["maps"] += [_apart("mapped", "panel", size, "skin") for size in PANELS]
    print(_report(result, out))
    return result


def _report(result: dict[str, Any], out: Path) -> str:
    """What there is so far, written to `out`."""
    text = tables(result)
    files.write_text(out / "speed_accuracy.json", json.dumps(result, indent=1))
    files.write_text(out / "speed_accuracy.md", text)
    return text


STYLE = {
    "Krylov": ("C3", "o-"),
    "modes": ("C0", "s-"),
    "superposition": ("C7", "^-"),
    "superposition, static correction": ("C2", "v-"),
    "unreduced, Newmark": ("k", "D"),
    "unreduced, all modes": ("k", "*"),
    "SciPy: eigsh, solve_ivp": ("C1", "P"),
    "pyYeti: SolveNewmark": ("C4", "X"),
    "Exudyn: GenericODE2": ("C5", "p"),
}


def _plot(found: dict[str, Any], out: Path) -> None:
    """Errors of force and Z against total seconds and against N."""
    figure, axes = plotting.panels(2, 2, size=(12, 7), sharey="row")
    styles = {method: color + style for method, (color, style) in STYLE.items()}
    for row, error in enumerate(("error force", "error Z")):
        for column, key in enumerate(("total", "n")):
            series = {}
            for method in STYLE:
                rows = [r for r in found["rows"] if r["method"] == method and r[error] and r[key]]
                series[method] = [r[key] for r in rows], [r[error] for r in rows]
            ax = plotting.plot_errors(series, axes[row, column], styles=styles)
            ax.set_xlabel("seconds, all told" if key == "total" else "N")
        axes[row, 0].set_ylabel("error of the force (L2)" if row == 0 else "error of Z, band")
    plotting.legend_beside(axes[0, 1])
    figure.suptitle(f"{found['case']}, {found['dofs']} dofs")
    name = found["case"].replace(", ", "_").replace(" ", "_")
    path = out / f"speed_accuracy_{name}_{found['dofs']}.png"
    plotting.save_figure(figure, path, dpi=130)


def ratios(found: dict[str, Any]) -> dict[str, float]:
    """Krylov against modes at equal error of Z, reduced against unreduced at equal force error."""
    rows = found["rows"]
    krylov, modes = ([r for r in rows if r["method"] == m] for m in ("Krylov", "modes"))
    answer = {}
    best = min(modes, key=lambda r: r["error Z"], default=None)
    equal = [r for r in krylov if best and r["error Z"] <= best["error Z"]]
    if best and equal:
        answer["modes over Krylov, seconds"] = best["seconds"] / min(r["seconds"] for r in equal)
        answer["at an error of Z of"] = best["error Z"]
    whole = [r for r in rows if r["method"] == "unreduced, Newmark"]
    if whole:
        fine = min(whole, key=lambda r: r["error force"])
        good = [r for r in krylov if r["error force"] <= fine["error force"]]
        if good:
            quick = min(good, key=lambda r: r["total"])
            answer["unreduced over Krylov, integration"] = fine["simulation"] / quick["simulation"]
            answer["unreduced over Krylov, whole job"] = fine["total"] / quick["total"]
            answer["at an error of the force of"] = fine["error force"]
    return answer


def tables(result: dict[str, Any]) -> str:
    """All results as Markdown."""
    lines = ["# Speed against accuracy", "", options.code_state(), ""]
    for found in result["charts"]:
        lines += [
            f"## {found['case']}, {found['dofs']} dofs",
            "",
            f"Peak force {found['peak force']:.4g} N, contact {found['contact time'] * 1e6:.4g} us;"
            f" band {found['band'] / 2e3 / pi:.3g} kHz with"
            f" {found['antiresonances in the band']} antiresonances; assembly"
            f" {found['seconds']['assembly']:.2g} s, factorization"
            f" {found['seconds']['factorization']:.2g} s.",
            "",
            "| method | N | seconds after factorization | simulation | total |"
            " error of force | error of Z |",
            "|---|---|---|---|---|---|---|",
        ]
        for r in found["rows"]:
            Z = "" if r["error Z"] is None else f"{r['error Z']:.1e}"
            lines.append(
                f"| {r['method']} | {r['n']} | {r['seconds']:.3g} | {r['simulation']:.2g} |"
                f" {r['total']:.3g} | {r['error force']:.1e} | {Z} |"
            )
        lines += ["", *(f"- {k}: {v:.3g}" for k, v in ratios(found).items()), ""]
    lines += ["## Growth with the size: bracket, 20 anti-oscillators", ""]
    lines += [
        "| dofs | ranks | assembly | factorization | 20 anti-oscillators | whole / floor |"
        " peak GB | peak / factored |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for g in [*result["growth"], *result["ranks"]]:
        s = g["seconds"]
        lines.append(
            f"| {g['dofs']} | {g['ranks']} | {s['assembly']:.3g} | {s['factorization']:.3g} |"
            f" {s['20 anti-oscillators']:.3g} | {g['over the floor']:.2f} | {g['memory']:.2f} |"
            f" {g['memory'] / g['memory factored']:.2f} |"
        )
    if len(result["growth"]) > 1:
        dofs = np.log([g["dofs"] for g in result["growth"]])
        for key in ("whole", "memory"):
            slope = np.polyfit(dofs, np.log([g[key] for g in result["growth"]]), 1)[0]
            lines.append(f"\n{key} grows as dofs^{slope:.2f}")
    for two in result["ranks"]:
        faster = result["growth"][-1]["whole"] / two["whole"]
        lines.append(f"\ntwo ranks against one: {faster:.2f} times as fast")
    lines += ["", "## What the largest extraction spends its time on", ""]
    lines += [f"- {k}: {v:.3g}" for k, v in result["profile"].items()]
    for one in result["maps"]:
        lines += ["", f"## Map of the {one['part']}", ""]
        lines += [f"- {k}: {_short(v)}" for k, v in one.items()]
    return "\n".join(lines) + "\n"


def _short(value: Any) -> str:
    """Numbers to three digits, in lists and dicts too."""
    if isinstance(value, dict):
        return ", ".join(f"{k} {_short(v)}" for k, v in value.items())
    if isinstance(value, list):
        return ", ".join(map(_short, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _task(text: str) -> None:
    """A part of the benchmark, asked for by `options.apart`: its result as the last line."""
    logging.disable(logging.INFO)
    warnings.simplefilter("ignore")
    name, *arguments = json.loads(text)
    tasks = (chart, heavy_mass, growth, profile, mapped)
    result = {task.__name__: task for task in tasks}[name](*arguments)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(result))


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "demos/speed")
    parser.add_argument("--sizes", type=options.positive, nargs="+", default=SIZES)
    parser.add_argument("--quick", action="store_true")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--task"]:  # a process of its own for one measurement, see `options.apart`
        _task(sys.argv[2])
    else:
        command()
