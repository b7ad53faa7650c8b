"""The article's beam, and how two force histories are compared: shared by its two cases.

Table 1 and 2 of the article: E = 67 GPa, rho = 2400 kg/m^3, S = 2 cm^2, I = 0.33 cm^4, L = 1 m.
Poisson's ratio and the shear coefficient are not given; 0.3 and 5/6 are taken, and both are varied
where it could matter.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import error_charts
import numpy as np
from beam_modes import modes
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, trapezoid

import antiosc as ao
from antiosc import plotting
from antiosc.models.body import ModalModel
from antiosc.models.closed_form import StruckBeam, UniformBeam

Floats = NDArray[np.float64]

E, RHO, AREA, INERTIA, LENGTH = 67e9, 2400.0, 2e-4, 0.33e-8, 1.0
NU, SHEAR = 0.3, 5 / 6
MASS = RHO * AREA * LENGTH
HERTZ = 1.55e10  # N m^-3/2: given for case 1, not for case 2
PICTURES = Path(__file__).resolve().parent / "pictures"

GEO = """
Point(1) = {{0, 0, 0}}; Point(2) = {{{length}, 0, 0}}; Line(1) = {{1, 2}};
Transfinite Curve {{1}} = {nodes};
Physical Point("left") = {{1}}; Physical Point("right") = {{2}}; Physical Curve("beam") = {{1}};
"""


class Errors(NamedTuple):
    """Of a force history against another, all relative to the latter."""

    force: float  # L2 norm of the difference
    peak: float
    impulse: float
    contact_time: float
    momentum: float  # largest difference of the running impulse, over the whole impulse


def analytic(inertia: float = INERTIA, nu: float = NU, shear: float = SHEAR) -> UniformBeam:
    """The beam without a mesh, Timoshenko's theory."""
    return UniformBeam.timoshenko(
        E=E,
        nu=nu,
        rho=RHO,
        area=AREA,
        inertia=inertia,
        length=LENGTH,
        shear_coefficient=shear,
    )


def euler_bernoulli() -> UniformBeam:
    """The beam without shear and rotary inertia."""
    return UniformBeam.euler_bernoulli(E=E, rho=RHO, area=AREA, inertia=INERTIA, length=LENGTH)


def meshed(elements: int, pinned: Sequence[str], order: int = 1) -> ao.Structure:
    """The beam in Timoshenko elements; order 1 are the article's (linear, one-point shear)."""
    material = ao.Beam(E, NU, RHO, ao.Section(A=AREA, I=INERTIA, shear=SHEAR))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "beam.geo"
        path.write_text(GEO.format(length=LENGTH, nodes=elements + 1))
        mesh = ao.read_mesh(path, size=LENGTH, gdim=2)
    supports = [ao.Support("left", ("x", "y")), *(ao.Support(end, "y") for end in pinned)]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "the supports leave")  # it may turn about its pin
        return ao.Structure(mesh, material, supports=supports, order=order)


def site(x: float) -> ao.Site:
    """A point of the meshed beam, struck across."""
    return ao.Site(point=(x, 0.0), direction=(0.0, 1.0))


def early(hit: ao.History, reference: ao.History, until: float) -> float:
    """Difference of two force histories in L2 up to a time in s, relative to the latter."""
    time = np.union1d(hit.time, reference.time)
    time = time[time <= until]
    ours, theirs = (h.force_at(time) for h in (hit, reference))
    return float(np.sqrt(trapezoid((ours - theirs) ** 2, time) / trapezoid(theirs**2, time)))


def compare(hit: ao.History, reference: ao.History) -> Errors:
    """How far a force history is from another."""
    time = np.union1d(hit.time, reference.time)
    ours, theirs = (h.force_at(time) for h in (hit, reference))
    run = cumulative_trapezoid(ours - theirs, time)
    return Errors(
        early(hit, reference, float(time[-1])),
        abs(hit.peak_force / reference.peak_force - 1),
        abs(hit.impulse / reference.impulse - 1),
        abs(lasted(hit) / lasted(reference) - 1),
        float(np.abs(run).max() / reference.impulse),
    )


def lasted(hit: ao.History) -> float:
    """From the first touch to the last release, s: sub-impacts and what lies between included."""
    return hit.contacts[-1][1] - hit.contacts[0][0]


class Family(NamedTuple):
    """One way to truncate: a name, and the model with n degrees of freedom."""

    name: str
    model: Callable[[int], ao.LinearBody]


def analytic_families(beam: StruckBeam) -> list[Family]:
    """Anti-oscillators, mode superposition, and that with static correction, of a beam."""
    return [
        Family("anti-oscillators", beam.anti_oscillators),
        Family("modes", lambda n: modes(beam, n)),
        Family("modes, static correction", lambda n: corrected(beam, n)),
    ]


def meshed_families(part: ao.Structure, where: ao.Site) -> list[Family]:
    """The same from the finite elements."""
    return [
        Family("anti-oscillators", lambda n: ao.extract(part, where, n=n, method="modes")),
        Family("modes", lambda n: ao.superposition(part, where, n)),
        Family(
            "modes, static correction",
            lambda n: ao.superposition(part, where, n, static_correction=True),
        ),
    ]


def corrected(beam: StruckBeam, n: int, x: Sequence[float] = ()) -> ModalModel:
    """Natural modes with static correction."""
    return modes(beam, n, x, static_correction=True)


def convergence(
    families: Iterable[Family],
    counts: Sequence[int],
    simulate: Callable[[ao.LinearBody], ao.History],
    reference: ao.History,
) -> dict[str, list[Errors]]:
    """Errors of each family at each count."""
    return {
        family.name: [compare(simulate(family.model(n)), reference) for n in counts]
        for family in families
    }


def order(counts: Sequence[int], errors: Sequence[Errors], floor: float = 2e-5) -> float:
    """Observed order p of the force error ~ n^-p, over the points that have begun to converge."""
    x, y = np.log(counts), np.log([e.force for e in errors])
    tail = (y < np.log(0.5)) & (y > np.log(floor))
    return float(-np.polyfit(x[tail], y[tail], 1)[0]) if tail.sum() > 2 else float("nan")


class Panel(NamedTuple):
    """One picture of a convergence study: a measure of the errors of some families."""

    title: str
    table: Mapping[str, Sequence[Errors]]
    measure: str = "force"


def norms(table: Mapping[str, Sequence[Errors]]) -> list[Panel]:
    """A panel for each measure of one study."""
    titles = {"force": "force, L2", "peak": "peak", "impulse": "impulse"}
    titles["contact_time"] = "contact time"
    return [Panel(title, table, measure) for measure, title in titles.items()]


def plot_convergence(counts: Sequence[int], panels: Sequence[Panel], path: Path) -> None:
    """Relative errors against the number of degrees of freedom, a panel for each."""
    rows = (len(panels) + 1) // 2
    figure, axes = plotting.panels(rows, 2, size=(8, 3 * rows), sharex=True, sharey=True)
    styles = ("C0o-", "C1s--", "C2^:")
    for axis, panel in zip(axes.flat, panels, strict=False):
        series = {
            name: (counts, [max(getattr(e, panel.measure), 1e-6) for e in errors])
            for name, errors in panel.table.items()
        }
        error_charts.plot_errors(series, axis, styles=dict(zip(series, styles, strict=True)))
        axis.set_title(panel.title)
    for below in axes[-1]:
        below.set_xlabel("anti-oscillators, or modes")
    for beside in axes[:, 0]:
        beside.set_ylabel("relative error")
    axes[0, 0].legend(fontsize=8)
    save(figure, path)


def save(figure: object, path: Path) -> None:
    """A small PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    plotting.save_figure(figure, path, dpi=100, bbox_inches="tight")
