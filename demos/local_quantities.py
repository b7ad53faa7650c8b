"""How many anti-oscillators section forces and accelerations need: against the unreduced model.

A frame of beams is struck by a short blow. The unreduced model is integrated with the contact in
it, by the trapezoidal rule with a sparse LU factor: it knows nothing of antiosc's models and
integrators. At ten points away from the site the demo compares force, displacement, section forces,
acceleration and the shock response spectrum, for growing numbers of anti-oscillators. It writes a
table and a chart to demos/speed.

    .venv/bin/python demos/local_quantities.py --help
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import options
import scipy.sparse
import scipy.sparse.linalg

import antiosc as ao
from antiosc import plotting
from antiosc.fem import mesh_fields
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.recovery.place import Place
from antiosc.fem.site.functionals import functional

ROOT = Path(__file__).resolve().parent.parent
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
#: Highest frequency of the shock response spectra, Hz.
TOP = 1e4
MOTION = ("displacement", "acceleration")


@dataclass
class Case:
    """A part that is struck, and the quantities that are compared."""

    name: str
    part: ao.Structure
    site: ao.Site
    ball: ao.Sphere | ao.RigidMass
    law: ao.Hertz
    quantities: tuple[str, ...]


def frame() -> Case:
    """The frame, struck at the top of a column by a hammer with a soft tip."""
    beam = ao.Beam(**STEEL, section=ao.Section.tube(0.03, 2e-3))
    part = ao.Structure(ao.read_mesh(ROOT / "meshes/frame.msh"), beam, [ao.Support("feet")])
    site = ao.Site((1.0, 0.8, 1.3), (1, 0.5, 0))
    return Case("frame", part, site, ao.RigidMass(0.5, 1.0), ao.Hertz(1e9), ("section_forces",))


def main(
    counts: tuple[int, ...] = (20, 60, 200, 400),
    step: float = 5e-7,
    duration: float = 1.5e-3,
    points: int = 10,
    out: Path = ROOT / "demos" / "speed",
) -> dict[str, float]:
    """Compare; return the errors by "case n quantity", and in dB by "case n srs".

    Parameters
    ----------
    counts : numbers of anti-oscillators
    step : of the unreduced model, s
    duration : simulated time, s
    points : at which the quantities are compared
    out : folder of the table and the chart
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        case = frame()
        print(case.part.describe(), flush=True)
        found = compared(case, counts, step, duration, points)
    write(found, counts, (case.name,), out)
    return found


def compared(
    case: Case, counts: Sequence[int], step: float, duration: float, points: int
) -> dict[str, float]:
    """Errors of one part, relative to the largest value at all points."""
    every = max(1, round(2e-6 / step))
    times, u, a, force = unreduced(case, step, duration, every)
    where = chosen(case, points)
    exact = {"displacement": motion(case, u, where), "acceleration": motion(case, a, where)}
    for quantity in case.quantities:
        columns = [recovered(case, u, x, quantity) for x in where]
        exact[quantity] = np.stack(columns)
    found = {}
    for n in counts:
        model = ao.extract(case.part, case.site, n)
        hit = ao.simulate(model, case.ball, case.law, duration, tol=1e-4)
        own = np.interp(times, hit.time, hit.force)
        found[f"{case.name} {n} force"] = float(np.abs(own - force).max() / force.max())
        for quantity, whole in exact.items():
            got = np.stack([ao.probe(case.part, hit, x, quantity, times) for x in where])
            error = np.abs(got - whole).max() / np.abs(whole).max()
            found[f"{case.name} {n} {quantity}"] = float(error)
            if quantity == "acceleration":
                found[f"{case.name} {n} srs"] = decibels(times, got, whole)
        row = ", ".join(
            f"{key.split()[-1]} {value:.1e}"
            for key, value in found.items()
            if key.startswith(f"{case.name} {n} ")
        )
        print(f"  n = {model.n}: {row}", flush=True)
    return found


def unreduced(
    case: Case, step: float, duration: float, every: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times (T,), u and u'' (rows, T) of the whole model, and the force (T,), by trapezoids."""
    target = functional(case.part, case.site)
    b = target.b
    free = np.setdiff1d(np.arange(len(b)), case.part.fixed)
    K, M = (scipy.sparse.csc_matrix(csr(A)[free][:, free]) for A in (case.part.K, case.part.M))
    law = case.law.without(target.local_compliance)
    push, mass, quarter = b[free], case.ball.mass, step**2 / 4
    factor = scipy.sparse.linalg.splu(
        M + quarter * K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01,
        options={"SymmetricMode": True},
    )  # fmt: skip
    pushed = factor.solve(push)
    give = quarter * (push @ pushed + 1 / mass)  # indentation that a unit force takes back
    u, v, a = (np.zeros(len(free)) for _ in range(3))
    w, speed, pull = 0.0, case.ball.velocity, 0.0
    kept: list[tuple[np.ndarray, np.ndarray, float]] = [(u, a, 0.0)]
    count = round(duration / step)
    for k in range(1, count + 1):
        ahead, other = u + step * v + quarter * a, w + step * speed + quarter * pull
        still = -factor.solve(K @ ahead)
        depth = other - push @ (ahead + quarter * still)
        force = solved(law, depth, give)
        new = still + pushed * force
        u, v, a = ahead + quarter * new, v + step / 2 * (a + new), new
        w, speed = other - quarter * force / mass, speed + step / 2 * (pull - force / mass)
        pull = -force / mass
        if k % every == 0:
            kept.append((u, a, force))
    whole_u, whole_a = (np.zeros((len(b), len(kept))) for _ in range(2))
    whole_u[free] = np.array([one[0] for one in kept]).T
    whole_a[free] = np.array([one[1] for one in kept]).T
    times = step * every * np.arange(len(kept))
    return times, whole_u, whole_a, np.array([one[2] for one in kept])


def solved(law: ao.Hertz, depth: float, give: float) -> float:
    """Force F of the law at the indentation depth − give F, by bisection."""
    if depth <= 0:
        return 0.0
    low, high = 0.0, depth / give
    for _ in range(60):
        middle = 0.5 * (low + high)
        if law.force(depth - give * middle, 0.0, None) > middle:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def chosen(case: Case, count: int) -> list[tuple[float, ...]]:
    """Points of the mesh, away from the site and from the supports."""
    x = case.part.mesh.dolfinx.geometry.x
    size = float(np.ptp(x, axis=0).max())
    away = np.linalg.norm(x - np.array(case.site.point), axis=1) > 0.15 * size
    inner = np.flatnonzero(away)
    picked = np.random.default_rng(4).choice(inner, count, replace=False)
    # inside a cell: on a face between cells the strain has several values
    cells = case.part.mesh.geometry.nodes
    middles = cells.mean(axis=1)
    near = [int(np.argmin(np.linalg.norm(middles - x[i], axis=1))) for i in picked]
    return [tuple(middles[i]) for i in near]


def motion(case: Case, field: np.ndarray, where: list[tuple[float, ...]]) -> np.ndarray:
    """Motion (points, T, 3) of the points."""
    found = [mesh_fields.at_point(case.part, field, np.array(x), None).T for x in where]
    return np.stack(found)


def recovered(case: Case, u: np.ndarray, x: tuple[float, ...], quantity: str) -> np.ndarray:
    """A quantity (T, …) at one point of displacements u (rows, T)."""
    values = mesh_fields.recovered(case.part, u, np.array([x]), None, quantity, Place(), None)[0]
    return np.moveaxis(values, -1, 0)


def decibels(times: np.ndarray, got: np.ndarray, whole: np.ndarray) -> float:
    """Largest difference in dB of the shock response spectra along the strongest direction."""
    frequencies = np.geomspace(2 / times[-1], TOP, 40)
    worst = 0.0
    for one, exact in zip(got, whole, strict=True):
        axis = int(np.abs(exact).max(axis=0).argmax())
        spectra = [ao.srs(times, s[:, axis], frequencies).maximax for s in (one, exact)]
        worst = max(worst, float(np.abs(20 * np.log10(spectra[0] / spectra[1])).max()))
    return worst


def write(found: dict[str, float], counts: Sequence[int], cases: Sequence[str], out: Path) -> None:
    """The table and the chart."""
    out.mkdir(parents=True, exist_ok=True)
    lines = [
        "# Section forces and accelerations against the number of anti-oscillators",
        "",
        "Made by `demos/local_quantities.py`: largest error at ten points over the largest value "
        "there, against the unreduced model integrated with its contact. The last column is the "
        f"largest difference of shock response spectra (Q = 10) up to {TOP / 1e3:g} kHz.",
        "",
        options.code_state(),
    ]
    figure, axes = plotting.panels(1, len(cases), size=(4.2 * len(cases), 3.6), sharey=True)
    for ax, case in zip(axes[0], cases, strict=True):
        names = [k.split()[2] for k in found if k.startswith(f"{case} {counts[0]} ")]
        shown = [name for name in names if name != "srs"]
        lines += ["", f"## {case}", "", f"| n | {' | '.join(shown)} | SRS (dB) |"]
        lines.append("|---" * (len(shown) + 2) + "|")
        for n in counts:
            row = [f"{found[f'{case} {n} {name}']:.1e}" for name in shown]
            lines.append(f"| {n} | {' | '.join(row)} | {found[f'{case} {n} srs']:.2f} |")
        for name in shown:
            style = {"lw": 2.5} if name == "force" else {"marker": "o", "ms": 4}
            values = [found[f"{case} {n} {name}"] for n in counts]
            ax.loglog(counts, values, label=name.replace("_", " "), **style)
        ax.set_xlabel("anti-oscillators")
        ax.set_title(case)
        ax.set_xticks(counts, [str(n) for n in counts])
        ax.minorticks_off()
    axes[0, 0].set_ylabel("largest error")
    plotting.legend_beside(axes[0, -1])
    plotting.save_figure(figure, out / "local_quantities.png", dpi=110)
    (out / "local_quantities.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument(
        "--counts", type=options.listed(options.count), default=(20, 60, 200, 400),
        help="numbers of anti-oscillators",
    )  # fmt: skip
    parser.add_argument("--step", type=options.positive, default=5e-7, help="s")
    parser.add_argument("--duration", type=options.positive, default=1.5e-3, help="s")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "demos" / "speed", help="folder of table and chart"
    )
    options.run(parser, main)
