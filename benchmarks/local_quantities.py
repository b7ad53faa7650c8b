"""How many anti-oscillators stresses, accelerations and shock spectra need: against all modes.

A bracket (solid), a stiffened panel (shells) and a frame (beams) are struck. The unreduced model of
the same mesh is all its natural modes, by LAPACK, and the force between them and the impactor,
linear in short steps: it knows nothing of antiosc's models and integrators, and its own error is
that of twice the step. At ten points away from site and supports the script compares force,
displacement, strain, stress (of the frame: section forces), acceleration, the same through CFC1000
with the bars of `ao.probe_error`, and shock response spectra from the first natural frequency to
10 kHz. The table and the chart go to benchmarks/speed.

    .venv/bin/python benchmarks/local_quantities.py --help
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import options
import scipy.linalg
from scipy.spatial import cKDTree

import antiosc as ao
from antiosc import plotting
from antiosc.base.cfc import memory_of
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.reach import Reach
from antiosc.recovery import mesh_fields
from antiosc.recovery.place import Place
from antiosc.reduce.site import functional

ROOT = Path(__file__).resolve().parent.parent
#: The points that are compared lie on the part.
NEAR = Reach("the point")
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
#: Highest frequency of the shock response spectra, Hz; they are compared at a point where they are
#: above this share of the largest one of all points at that frequency.
TOP, AUDIBLE = 1e4, 0.01
#: Filter of the accelerations, and its name in the table.
FILTER, FILTERED = "CFC1000", "acceleration CFC1000"
#: Time between the samples that are compared, s.
SAMPLE = 2e-6
#: Least distances of the points from the site and from the supports, over the size of the part.
FROM_SITE, FROM_SUPPORTS = 0.15, 0.1
#: Steps whose states are kept at a time.
BLOCK = 250
#: Lines of the chart.
STYLES = {
    "force": {"color": "C0", "lw": 2.5},
    "displacement": {"color": "C2", "marker": "o", "ms": 4},
    "strain": {"color": "C1", "marker": "o", "ms": 6, "mfc": "none", "ls": "--"},
    "stress": {"color": "C1", "marker": "o", "ms": 3},
    "section_forces": {"color": "C4", "marker": "o", "ms": 4},
    "acceleration": {"color": "C3", "marker": "o", "ms": 4},
    FILTERED: {"color": "C5", "marker": "o", "ms": 4},
}


@dataclass(frozen=True)
class Case:
    """A part that is struck, the quantities that are compared, and the time integration."""

    name: str
    part: ao.Structure
    site: ao.Site
    ball: ao.Sphere | ao.RigidMass
    law: ao.Hertz
    quantities: tuple[str, ...]
    counts: tuple[int, ...]
    step: float
    duration: float


@dataclass(frozen=True)
class Signals:
    """What is compared: at `times`, quantity -> (points, T, …); spectra (points, f)."""

    times: np.ndarray
    force: np.ndarray
    values: dict[str, np.ndarray]
    spectra: np.ndarray


def bracket() -> Case:
    """The bracket, struck on its eye by a steel ball."""
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", order=1)
    part = ao.Structure(mesh, ao.Solid(**ALUMINIUM), [ao.Support("clamp")], order=1)
    site = ao.Site((0.020, 0.040, 0.075), (-0.2, -0.6, -0.8), radius=5e-3, snap=True)
    ball = ao.Sphere(0.015, **STEEL, velocity=1.0)
    law = ball.hertz(ALUMINIUM["E"], ALUMINIUM["nu"])
    quantities = ("strain", "stress")
    return Case("bracket", part, site, ball, law, quantities, (5, 10, 20, 40, 80), 2e-7, 4e-3)


def panel(size: float = 0.16) -> Case:
    """The stiffened panel with elements of `size` m, struck on its skin by a steel ball."""
    sys.path.append(str(ROOT / "meshes"))
    import make_panel

    with tempfile.TemporaryDirectory() as folder:
        make_panel.main(Path(folder), size)
        mesh = ao.read_mesh(Path(folder) / "panel.msh")
    sheets = {"skin": 2e-3, "stringers": 3e-3, "frames": 3e-3}
    material = {name: ao.Shell(**ALUMINIUM, thickness=t) for name, t in sheets.items()}
    part = ao.Structure(mesh, material, [ao.Support("ends")])
    normal = np.array([0, np.sin(np.deg2rad(5)), np.cos(np.deg2rad(5))])
    point = np.array([0.45, 0, 0]) + 1.2 * normal
    site = ao.Site(tuple(point), tuple(-normal), radius=0.03, snap=True)
    ball = ao.Sphere(0.008, **STEEL, velocity=2.0)
    law = ball.hertz(ALUMINIUM["E"], ALUMINIUM["nu"])
    quantities, counts = ("strain", "stress"), (100, 200, 400, 600, 800)
    return Case("panel", part, site, ball, law, quantities, counts, 2.5e-7, 4e-3)


def frame() -> Case:
    """The frame, struck at the top of a column by a hammer with a soft tip."""
    beam = ao.Beam(**STEEL, section=ao.Section.tube(0.03, 2e-3))
    part = ao.Structure(ao.read_mesh(ROOT / "meshes/frame.msh"), beam, [ao.Support("feet")])
    site, hammer = ao.Site((1.0, 0.8, 1.3), (1, 0.5, 0)), ao.RigidMass(0.5, 1.0)
    quantities, counts = ("section_forces",), (100, 200, 400, 600, 800)
    return Case("frame", part, site, hammer, ao.Hertz(1e9), quantities, counts, 1e-6, 8e-3)


CASES: dict[str, Callable[[], Case]] = {"bracket": bracket, "panel": panel, "frame": frame}


def main(
    cases: Sequence[str] = tuple(CASES),
    counts: tuple[int, ...] = (),
    duration: float | None = None,
    points: int = 10,
    out: Path = ROOT / "benchmarks" / "speed",
) -> dict[str, dict[str, float]]:
    """Compare; return "case n" -> the error of each quantity, "srs" in dB, "resolved" in Hz.

    The entry "case reference" has the errors of the reference with twice its step.

    Parameters
    ----------
    cases : names of the parts
    counts : numbers of anti-oscillators; default: those of each part
    duration : simulated time, s, more than 2 ms for the filter; default: that of each part
    points : at which the quantities are compared
    out : folder of the table and the chart
    """
    found: dict[str, dict[str, float]] = {}
    told: dict[str, str] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        for name in cases:
            case = CASES[name]()
            case = replace(case, counts=counts or case.counts, duration=duration or case.duration)
            print(case.part.describe(), flush=True)
            found |= compared(case, points, told)
    write(found, told, out)
    return found


def compared(case: Case, points: int, told: dict[str, str]) -> dict[str, dict[str, float]]:
    """The errors of one part; a sentence on it goes to `told`."""
    where = chosen(case, points)
    whole = Unreduced(case, where)
    exact, again = whole.signals(case.step), whole.signals(2 * case.step)
    count = int((whole.omega < 2 * np.pi * TOP).sum())
    told[case.name] = (
        f"{case.part.describe()}; {count} natural frequencies below {TOP / 1e3:g} kHz, the first "
        f"{whole.omega[0] / 2 / np.pi:.0f} Hz; {case.duration * 1e3:g} ms."
    )
    print("  " + told[case.name], flush=True)
    found = {f"{case.name} reference": errors(again, exact)}
    for n in case.counts:
        model = ao.extract(case.part, case.site, n)
        hit = ao.simulate(model, case.ball, case.law, case.duration, tol=1e-5)
        own = probed(case, hit, where, exact.times, whole)
        row = errors(own, exact) | {"resolved": ao.resolved_frequency(model)}
        row |= bars(case, hit, where, own, exact)
        found[f"{case.name} {n}"] = row
        print(f"  n = {n}: " + ", ".join(f"{k} {v:.2g}" for k, v in row.items()), flush=True)
    return found


def errors(own: Signals, exact: Signals) -> dict[str, float]:
    """Largest errors over the largest values at all points; of spectra in dB."""
    found = {"force": np.abs(own.force - exact.force).max() / exact.force.max()}
    for name, values in exact.values.items():
        found[name] = np.abs(own.values[name] - values).max() / np.abs(values).max()
    heard = exact.spectra > AUDIBLE * exact.spectra.max(axis=0)
    found["srs"] = np.abs(20 * np.log10(own.spectra / exact.spectra))[heard].max()
    return {name: float(value) for name, value in found.items()}


def bars(
    case: Case, hit: ao.History, where: list[tuple[float, ...]], own: Signals, exact: Signals
) -> dict[str, float]:
    """Of the peak accelerations through the filter: how many are in their bars, the largest error
    over its bar, and the smallest and the largest bar.
    """
    seen = exact.times[: exact.values[FILTERED].shape[1]]
    options = {"quantity": "acceleration", "times": seen, "filter": FILTER}
    found = np.array([ao.probe_error(case.part, hit, x, **options).truncation for x in where])
    peaks, right = (
        np.linalg.norm(one.values[FILTERED], axis=2).max(axis=1) for one in (own, exact)
    )
    shares = abs(peaks - right) / peaks / found
    held = {"held": float((shares <= 1).sum()), "of bar": float(shares.max())}
    return held | {"least": float(found.min()), "most": float(found.max())}


class Unreduced:
    """All natural modes of a part, and the quantities of each at the points."""

    def __init__(self, case: Case, where: list[tuple[float, ...]]) -> None:
        target = functional(case.part, case.site)
        free = np.setdiff1d(np.arange(len(target.b)), case.part.fixed)
        K, M = (csr(A)[free][:, free].toarray() for A in (case.part.K, case.part.M))
        square, phi = scipy.linalg.eigh(K, M, overwrite_a=True, overwrite_b=True)
        self.case, self.omega = case, np.sqrt(square)
        self.beta = phi.T @ target.b[free]
        self.law = case.law.without(target.local_compliance)
        shapes = np.zeros((len(target.b), len(self.omega)))
        shapes[free] = phi
        #: (points, …, modes)
        self.columns = {name: recovered(case, shapes, where, name) for name in case.quantities}
        self.columns["displacement"] = recovered(case, shapes, where, "displacement")
        first = max(self.omega[0] / (2 * np.pi), 2 / case.duration)
        self.frequencies = np.geomspace(first, TOP, 40)
        #: direction of the largest acceleration at each point, once it is known
        self.axes = np.zeros(len(where), dtype=int)

    def signals(self, step: float) -> Signals:
        """The motion in steps of `step` s; the spectra have the accelerations of each step."""
        every = round(SAMPLE / step)
        count = round(self.case.duration / step)
        moves = self.columns["displacement"].reshape(-1, len(self.omega))
        force, states = np.zeros(count + 1), [np.zeros_like(self.omega)]
        a = np.zeros((len(moves), count + 1))
        block: list[np.ndarray] = []
        for k, (q, f) in enumerate(self.steps(step, count), 1):
            force[k] = f
            block.append(q)
            if k % every == 0:
                states.append(q)
            if len(block) == BLOCK or k == count:
                past = slice(k + 1 - len(block), k + 1)
                push = np.outer(self.beta, force[past])
                a[:, past] = moves @ (push - self.omega[:, None] ** 2 * np.array(block).T)
                block = []
        Q = np.array(states).T
        values = {n: np.moveaxis(c @ Q, -1, 1) for n, c in self.columns.items()}
        accelerations = np.moveaxis(a.reshape(len(self.axes), -1, count + 1), -1, 1)
        values["acceleration"] = accelerations[:, ::every]
        before = np.pad(accelerations, ((0, 0), (round(memory_of(FILTER) / step), 0), (0, 0)))
        smooth = np.stack([ao.cfc_filter(step, one, FILTER) for one in before])
        smooth = smooth[:, -count - 1 :: every]
        values[FILTERED] = smooth[:, : known(self.case, smooth.shape[1])]
        if not self.axes.any():
            self.axes = np.abs(accelerations).max(axis=1).argmax(axis=1)
        t = step * np.arange(count + 1)
        spectra = [
            ao.srs(t, one[:, axis], self.frequencies).maximax
            for one, axis in zip(accelerations, self.axes, strict=True)
        ]
        return Signals(t[::every], force[::every], values, np.array(spectra))

    def steps(self, h: float, count: int) -> Iterator[tuple[np.ndarray, float]]:
        """Modal displacements and force after each step, in which the force is linear."""
        w, ball = self.omega, self.case.ball
        c, s = np.cos(w * h), np.sin(w * h)
        late = (1 - s / (w * h)) / w**2 * self.beta  # response to a force that grows to 1
        early = (1 - c) / w**2 * self.beta - late
        late_v = (1 - c) / (w**2 * h) * self.beta
        early_v = s / w * self.beta - late_v
        give = self.beta @ late + h * h / 6 / ball.mass
        q, v, x, speed, force = np.zeros_like(w), np.zeros_like(w), 0.0, ball.velocity, 0.0
        for _ in range(count):
            free, ahead = c * q + s / w * v + early * force, x + h * speed
            ahead -= h * h / 3 * force / ball.mass
            new = solved(self.law, ahead - self.beta @ free, give)
            v = c * v - w * s * q + early_v * force + late_v * new
            q = free + late * new
            x = ahead - h * h / 6 * new / ball.mass
            speed -= h * (force + new) / 2 / ball.mass
            force = new
            yield q, force


def known(case: Case, count: int) -> int:
    """How many of `count` samples the filter knows from the motion before and after them."""
    return int(count * (1 - memory_of(FILTER) / case.duration))


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


def probed(
    case: Case,
    hit: ao.History,
    where: list[tuple[float, ...]],
    times: np.ndarray,
    whole: Unreduced,
) -> Signals:
    """The same of the reduced model."""
    names = ("displacement", *case.quantities, "acceleration")
    values = {
        name: np.stack([ao.probe(case.part, hit, x, name, times) for x in where]) for name in names
    }
    seen = times[: known(case, len(times))]
    values[FILTERED] = np.stack([
        ao.probe(case.part, hit, x, "acceleration", seen, filter=FILTER) for x in where
    ])  # fmt: skip
    spectra = []
    for x, axis in zip(where, whole.axes, strict=True):
        v = ao.probe(case.part, hit, x, "velocity", times)[:, axis]
        spectra.append(ao.srs(times, v, whole.frequencies, signal="velocity").maximax)
    return Signals(times, hit.force_at(times), values, np.array(spectra))


def recovered(
    case: Case, u: np.ndarray, where: list[tuple[float, ...]], quantity: str
) -> np.ndarray:
    """A quantity (points, …, columns) of displacements u (rows, columns)."""
    if quantity == "displacement":
        return np.stack(
            [mesh_fields.at_point(case.part, u, np.array(x), None, NEAR) for x in where]
        )
    points = np.array(where)
    return mesh_fields.recovered(case.part, u, points, None, quantity, Place(), NEAR)


def chosen(case: Case, count: int) -> list[tuple[float, ...]]:
    """Middles of cells away from the site and from the supports: between cells strains jump."""
    mesh = case.part.mesh
    middles = mesh.geometry.nodes.mean(axis=1)
    size = float(np.ptp(mesh.dolfinx.geometry.x, axis=0).max())
    fixed = np.zeros((case.part.rows, 1))
    fixed[case.part.fixed] = 1.0
    nodes, _, held = mesh_fields.at_nodes(case.part, fixed)
    supports = cKDTree(nodes[np.abs(held).max(axis=(1, 2)) > 0])
    away = np.linalg.norm(middles - np.array(case.site.point), axis=1) > FROM_SITE * size
    away &= supports.query(middles)[0] > FROM_SUPPORTS * size
    picked = np.random.default_rng(4).choice(np.flatnonzero(away), count, replace=False)
    return [tuple(middles[i]) for i in picked]


#: Columns on the bars of filtered peaks.
BARS = ("bars of CFC1000 peaks", "peaks within them", "largest error over its bar")


def write(found: dict[str, dict[str, float]], told: dict[str, str], out: Path) -> None:
    """The table and the chart."""
    out.mkdir(parents=True, exist_ok=True)
    lines = [
        "# Stresses, accelerations and shock spectra against the number of anti-oscillators",
        "",
        "Made by `benchmarks/local_quantities.py`: largest error at ten points over the largest "
        "value there, against all natural modes of the same mesh. SRS: largest difference of shock "
        f"response spectra (Q = 10) from the first natural frequency to {TOP / 1e3:g} kHz, where "
        f"they are above {AUDIBLE:.0%} of the largest of the ten. The first row is the reference "
        "with twice its step. Resolved is `ao.resolved_frequency`. The bars are `.truncation` of "
        f"`ao.probe_error` of the peak acceleration through {FILTER} at the ten points.",
        "",
        options.code_state(),
    ]
    figure, axes = plotting.panels(2, len(told), size=(8, 6.4), sharey="row")
    for k, (case, about) in enumerate(told.items()):
        rows = {key.split()[1]: row for key, row in found.items() if key.split()[0] == case}
        counts = [int(n) for n in rows if n != "reference"]
        shown = [name for name in rows["reference"] if name != "srs"]
        heads = [name.replace("_", " ") for name in shown]
        lines += ["", f"## {case}", "", about, ""]
        lines += [f"| n | {' | '.join(heads)} | SRS (dB) | resolved (kHz) | {' | '.join(BARS)} |"]
        lines.append("|---" * (len(shown) + 3 + len(BARS)) + "|")
        for n, row in rows.items():
            cells = [f"{row[name]:.1e}" for name in shown] + [f"{row['srs']:.2f}"]
            cells.append(f"{row['resolved'] / 1e3:.1f}" if "resolved" in row else "")
            if "held" in row:
                cells += [f"{row['least']:.1e} to {row['most']:.1e}", f"{row['held']:.0f}"]
                cells.append(f"{row['of bar']:.2f}")
            lines.append(f"| {n} | {' | '.join(cells)} |")
        upper, lower = axes[0, k], axes[1, k]
        for name, head in zip(shown, heads, strict=True):
            values = [rows[str(n)][name] for n in counts]
            upper.loglog(counts, values, label=head, **STYLES[name])
        lower.loglog(counts, [rows[str(n)]["srs"] for n in counts], "k-s", ms=4)
        lower.axhline(0.5, color="0.6", lw=1, ls="--")
        upper.set_title(case)
        lower.set_xlabel("anti-oscillators")
        for ax in (upper, lower):
            ax.set_xticks(counts, [str(n) for n in counts])
            ax.minorticks_off()
    axes[0, 0].set_ylabel("largest error")
    axes[1, 0].set_ylabel("error of shock spectra (dB)")
    curves = {line.get_label(): line for ax in axes[0] for line in ax.lines}
    plotting.legend_below(figure, curves, 3)
    plotting.save_figure(figure, out / "local_quantities.png", dpi=120)
    (out / "local_quantities.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--cases", nargs="+", choices=tuple(CASES), default=tuple(CASES))
    parser.add_argument(
        "--counts", type=options.listed(options.count), default=(),
        help="numbers of anti-oscillators",
    )  # fmt: skip
    parser.add_argument("--duration", type=options.positive, help="s, more than 2 ms (filter)")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "benchmarks" / "speed", help="folder of table and chart"
    )
    options.run(parser, main)
