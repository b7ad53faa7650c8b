"""The methods that `speed_accuracy.py` compares: model, seconds and errors of each.

Besides those of antiosc, what an engineer writes with SciPy on the same matrices.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.integrate
import scipy.sparse
import scipy.sparse.linalg
from speed_cases import Case

import antiosc as ao
from antiosc.fem.linalg.algebra import dot, multiply, sum_of
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.linalg.solver_choice import factorize
from antiosc.impact.assembly import without_patch
from antiosc.reduce.site import functional

#: steps a contact of the integrators with a fixed step; the beam's contact has many sub-impacts
STEPS = {
    "beam": (1000, 4000),
    "plate": (25, 100),
    "bracket": (6, 25, 100),
    "bracket, heavy mass": (100, 500, 2000),
}
#: Share of the stable step that explicit integration takes, as LS-DYNA and Radioss do.
STABLE_SHARE = 0.9


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


def proved(case: Case, counts: Sequence[int]) -> list[dict[str, Any]]:
    """The widths of the proved bounds on the peak of the first contact, over the peak.

    The part keeps the factor at the expansion: its seconds, those by which a first extraction is
    slower than a second one, are counted for each row.
    """
    contact = case.hit.contact_time

    def extracted(n: int) -> tuple[float, ao.AntiOscillators]:
        started = time.perf_counter()
        model = ao.extract(case.part, case.site, n=n, proof=contact)
        return time.perf_counter() - started, model

    before = case.before + extracted(1)[0] - extracted(1)[0]

    rows = []
    for n in counts:
        made, model = extracted(n)
        started = time.perf_counter()
        hit = ao.simulate(model, *case.impact[:2], 1.3 * contact, proof=True)
        total = before + made + time.perf_counter() - started
        low, high = hit.enclosure.peak
        rows.append({"n": n, "total": total, "width": (high - low) / hit.peak_force})

    return rows


def unreduced(case: Case, steps: int) -> dict[str, Any]:
    """All dofs in time: Newmark's average acceleration, `steps` to one contact."""
    structure, (striker, law, duration) = case.part, case.impact
    h = case.hit.contact_time / steps
    law, _ = without_patch(law, case.reference.local_compliance, "part", "striker")
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


def explicit(case: Case) -> dict[str, Any]:
    """All dofs in time by central differences; masses lumped in the ratio of the diagonal of M."""
    K, M, b, mass = matrices(case)
    law, _ = without_patch(case.impact[1], case.reference.local_compliance, "part", "striker")
    started = time.perf_counter()
    lumped = M.diagonal() * M.sum() / M.diagonal().sum()
    scale = scipy.sparse.diags(lumped**-0.5)
    highest = scipy.sparse.linalg.eigsh(scale @ K @ scale, 1, return_eigenvectors=False, tol=1e-2)
    h = STABLE_SHARE * 2 / float(np.sqrt(highest[0]))
    made = time.perf_counter() - started

    u, v = np.zeros(len(b)), np.zeros(len(b))
    w, speed = 0.0, case.impact[0].velocity
    times = h * np.arange(int(case.impact[2] / h))
    forces = np.zeros(len(times))
    started = time.perf_counter()
    for k in range(len(times)):
        F = forces[k] = law.force(w - float(b @ u), 0.0, ())
        v += h * (F * b - K @ u) / lumped
        speed -= h * F / mass
        u += h * v
        w += h * speed
    spent = time.perf_counter() - started
    return measured(case, "unreduced, explicit", len(b), made, spent, times, forces)


def matrices(case: Case) -> tuple[Any, Any, Any, float]:
    """K, M and b without the fixed dofs, and the impactor's mass."""
    free = np.setdiff1d(np.arange(case.part.K.getSize()[0]), case.part.fixed)
    K, M = (csr(matrix)[free][:, free] for matrix in (case.part.K, case.part.M))
    b = functional(case.part, case.site).b[free]
    return K, M, b, 1 / float(np.sum(case.impact[0].modal().b ** 2))


def peer_scipy(case: Case, n: int) -> dict[str, Any]:
    """What an engineer writes: eigsh for n free modes, solve_ivp for their superposition."""
    K, M, b, mass = matrices(case)
    law, _ = without_patch(case.impact[1], case.reference.local_compliance, "part", "striker")
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
    return measured(case, "SciPy: eigsh, solve_ivp", n, made, simulated, case.time, force)


def measured(
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
