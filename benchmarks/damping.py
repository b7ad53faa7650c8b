"""Damped impacts: errors beside all states of the mesh, and time beside undamped ones.

Beams of finite elements with a dashpot, a layer that relaxes, footings on soil and loss factors are
struck. The reference has every state of the mesh and is integrated by SciPy's DOP853; receptances
are those of harmonic solves with all dofs.

    .venv/bin/python benchmarks/damping.py --help
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse
from scipy.integrate import simpson, solve_ivp

import antiosc as ao
from antiosc.base._types import Array
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.reduce.site import functional

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "demos"))
import tip_damper  # noqa: E402

GEO = (
    "Point(1) = {0, 0, 0}; Point(2) = {0.5, 0, 0}; Point(3) = {1, 0, 0};"
    "Line(1) = {1, 2}; Line(2) = {2, 3}; Transfinite Curve {1, 2} = 6;"
    'Physical Point("start") = {1}; Physical Point("end") = {3};'
    'Physical Curve("root") = {1}; Physical Curve("arm") = {2};'
)
BAR = {
    "E": 70e9, "nu": 0.3, "rho": 2700.0, "section": ao.Section.rectangle(0.01, 0.02),
    "orientation": (0, 0, 1),
}  # fmt: skip
BALL, LAW, END = ao.RigidMass(0.1, velocity=1.0), ao.Hertz(1e8), 4e-3
SITE = ao.Site((1, 0, 0), (0, 0, 1))
#: Circular frequencies of receptances [rad/s]; asked accuracy of Z below the last.
OMEGA, ACCURACY = np.geomspace(30.0, 2e4, 60), 1e-3

PAGE = """# Damped impacts

Written by `benchmarks/damping.py`: impacts on beams of finite elements with {dofs} free dofs. "Z"
is the largest error of the receptance below {band:g} rad/s beside harmonic solves with all dofs,
and the bound that `extract` gives; "force" and "impulse" are errors beside DOP853 with all states;
"time" is the CPU time of an impact over that without damping, the least of twenty, in turn.

| damping | n | Z | bound | force, L2 | impulse | time |
|---|---|---|---|---|---|---|
{table}

A cantilever with a dashpot at its tip, 20 modes (`demos/tip_damper.py`): errors of the impulse
beside exponentials of all states are at most {tip:.1e} for 2, 5, 11, 20 and 100 N s/m.

Loss factors of 4 % of half of the cantilever: |H| at its first four peaks differs by at most
{peaks:.2%} from that of the complex stiffness; in time, the impulse with their damping ratios
differs by {ratios:.1e} from that of DOP853.
"""


def structure(mesh: ao.Mesh, held: str = "all", attached: Any = (), **root: Any) -> ao.Structure:
    """The beam; `root`: more of the material of its first half."""
    material = {"root": ao.Beam(**BAR, **root), "arm": ao.Beam(**BAR)}
    return ao.Structure(mesh, material, [ao.Support("start", held)], attached=list(attached))


def cases(mesh: ao.Mesh) -> dict[str, ao.Structure]:
    """The damped structures."""
    dashpots = {f"dashpot {c:g} N s/m": [ao.Damper("end", {"z": c})] for c in (2.0, 20.0, 200.0)}
    branch = [ao.Damper("end", {"z": 20.0}, tau=1e-3)]
    soil = ao.soil_cone(radius=0.1, G=20e6, nu=0.4, rho=1800.0)
    footing = [
        part for end in ("start", "end") for part in (
            ao.Spring(end, {"z": soil.stiffness}), ao.Damper(end, {"z": soil.damping}),
            ao.PointMass(end, soil.mass + 1.0),
        )
    ]  # fmt: skip
    return {
        **{name: structure(mesh, attached=one) for name, one in dashpots.items()},
        "spring and dashpot in series": structure(mesh, attached=branch),
        "layer, Prony series": structure(mesh, prony=[(0.8, 1e-3), (0.5, 1e-4)]),
        "two footings on soil": structure(mesh, ("x", "y", "rx", "rz"), footing),
    }


class Whole:
    """Every state of the mesh of a structure."""

    def __init__(self, part: ao.Structure) -> None:
        self.free = np.setdiff1d(np.arange(part.size), part.fixed)
        self.K, self.M = (self._free(csr(matrix)) for matrix in (part.K, part.M))
        self.b = functional(part, SITE).b[self.free]
        self.C = np.zeros_like(self.K)
        self.branches: list[tuple[Array, float]] = []
        for one in part.matrices.dissipation():
            whole = csr(one.matrix) if one.matrix is not None else one.G.T @ one.c @ one.G
            matrix = one.factor * self._free(whole)
            if one.tau is None:
                self.C += matrix
            else:
                self.branches.append((matrix, one.tau))

    def _free(self, matrix: Any) -> Array:
        return scipy.sparse.csr_matrix(matrix)[self.free][:, self.free].toarray()

    def receptance(self, omega: Array) -> Array:
        """By one solve for each frequency."""
        found = []
        for w in omega:
            A = self.K - w**2 * self.M + 1j * w * self.C
            for k, tau in self.branches:
                A = A + k * (1j * w * tau / (1 + 1j * w * tau))
            found.append(self.b @ np.linalg.solve(A, self.b))
        return np.array(found)

    def force(self, t: Array) -> Array:
        """Contact force at times t by DOP853."""
        n, inverse = len(self.b), np.linalg.inv(self.M)
        moved = [inverse @ k for k, _ in self.branches]
        stiff, damped, push = inverse @ self.K, inverse @ self.C, inverse @ self.b

        def slope(_: float, y: Array) -> Array:
            u, v, x, w = y[:n], y[n : 2 * n], y[2 * n], y[2 * n + 1]
            F = LAW.stiffness * max(x - self.b @ u, 0.0) ** 1.5
            a = push * F - stiff @ u - damped @ v
            rest = []
            for i, (k, (_, tau)) in enumerate(zip(moved, self.branches, strict=True)):
                z = y[2 * n + 2 + i * n :][:n]
                a -= k @ (u - z)
                rest.append((u - z) / tau)
            return np.concatenate([v, a, [w, -F / BALL.mass], *rest])

        y = np.zeros(2 * n + 2 + n * len(moved))
        y[2 * n + 1] = BALL.velocity
        run = solve_ivp(slope, (0, END), y, "DOP853", t, rtol=1e-8, atol=1e-12)
        depth = run.y[2 * n] - self.b @ run.y[:n]
        return np.asarray(LAW.stiffness * np.maximum(depth, 0.0) ** 1.5)


def least(calls: dict[str, Callable[[], Any]], runs: int = 20) -> dict[str, float]:
    """Least CPU seconds of each call, in turn."""
    found = dict.fromkeys(calls, np.inf)
    for _ in range(runs):
        for name, call in calls.items():
            start = time.process_time()
            call()
            found[name] = min(found[name], time.process_time() - start)
    return found


def row(name: str, part: ao.Structure) -> tuple[str, int]:
    """A line of the table, and the number of free dofs."""
    whole, t = Whole(part), np.linspace(0, 0.999 * END, 4000)
    model = ao.extract(part, SITE, band=float(OMEGA[-1]) / (2 * np.pi), accuracy=ACCURACY, n=45)
    bare = replace(model, damping=None)
    off = np.abs(model.modal().receptance(OMEGA) / whole.receptance(OMEGA) - 1).max()
    hit, force = ao.simulate(model, BALL, LAW, END, tol=1e-6), whole.force(t)
    L2 = np.linalg.norm(hit.force_at(t) - force) / np.linalg.norm(force)
    impulse = hit.impulse / simpson(force, x=t) - 1
    seconds = least({
        key: lambda one=one: ao.simulate(one, BALL, LAW, END)
        for key, one in (("damped", model), ("bare", bare))
    })  # fmt: skip
    ratio = seconds["damped"] / seconds["bare"]
    bound = model.info.band["error_bound"]
    cells = (f"{off:.1e}", f"{bound:.1e}", f"{L2:.1e}", f"{abs(impulse):.1e}", f"{ratio:.2f}")
    return f"| {name} | {model.n} | {' | '.join(cells)} |", len(whole.b)


def losses(mesh: ao.Mesh) -> tuple[float, float]:
    """Errors of |H| at four peaks, and of the impulse beside DOP853 of the same modes."""
    part = structure(mesh, loss=0.04)
    model, whole = ao.extract(part, SITE, n=20), Whole(part)
    share = whole._free(csr(part.matrices._losses[0][1]))
    peaks = model.modal().omega[:4]
    exact = [
        whole.b @ np.linalg.solve(whole.K + 0.04j * share - w**2 * whole.M, whole.b) for w in peaks
    ]
    off = float(np.abs(np.abs(model.modal().receptance(peaks)) / np.abs(exact) - 1).max())
    one, other = (
        ao.simulate(model, BALL, LAW, END, tol=1e-7, method=method).impulse
        for method in ("exact", "DOP853")
    )
    return off, abs(one / other - 1)


def main(page: str = "") -> str:
    """Print the tables; write them to `page`."""
    warnings.simplefilter("ignore", ao.AntioscWarning)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "beam.geo"
        path.write_text(GEO)
        mesh = ao.read_mesh(path, gdim=3)
        rows = [row(name, part) for name, part in cases(mesh).items()]
        peaks, ratios = losses(mesh)
        tip = tip_damper.main(out=Path(folder))["error"]
    text = PAGE.format(
        table="\n".join(line for line, _ in rows), dofs=max(n for _, n in rows),
        band=OMEGA[-1], peaks=peaks, ratios=ratios, tip=tip,
    )  # fmt: skip
    print(text)
    if page:
        Path(page).write_text(text, encoding="utf-8")
    return text


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--page", default="", help="Markdown to write")
    main(parser.parse_args().page)
