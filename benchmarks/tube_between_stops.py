"""A tube of a heat exchanger rattles between the plates that it passes through with play.

The tube is a beam, clamped at one end; at each quarter of its length a plate leaves it a gap on
both sides. A force of 40 Hz shakes its spans in turn. The data are those of code_aster's test
SDNL301, the load lumped at the spans' middles. One model with eight sites serves all gaps. The
script prints the impacts and the root mean square of the forces on each plate, and draws the motion
of the free end. Where rattling makes the forces uncertain, it says until when they are certain.

    .venv/bin/python benchmarks/tube_between_stops.py --help
"""

from __future__ import annotations

import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from options import command, compared

import antiosc as ao
from antiosc import plotting

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parent.parent
LENGTH = 2.436
TUBE = ao.Beam(E=2.07e11, nu=0.3, rho=7870.0, section=ao.Section.tube(d=15.9e-3, t=1.15e-3))
STIFFNESS = 1e5  # of a plate, N/m
DAMPING = ao.Damping(alpha=0.1526, beta=1.79e-5)  # of the tube: alpha M + beta K
FORCE, FREQUENCY = 11 * 4.138, 251.2 / (2 * np.pi)  # on each span, N, Hz
PLATES = {"a": 0.25, "b": 0.5, "c": 0.75, "end": 1.0}
COLUMNS: compared.Columns = {
    "impacts": ("impacts", 1.0, ".0f"),
    "peak N": ("peak force", 1.0, ".1f"),
    **{f"rms {plate} N": (f"rms {plate}", 1.0, ".1f") for plate in PLATES},
    **compared.SECONDS,
}
SPANS = {"span 1": 0.125, "span 2": 0.375, "span 3": 0.625, "span 4": 0.875}


def main(
    gaps: tuple[float, ...] = (0.2e-3, 0.406e-3, 0.8e-3),
    n: int = 40,
    duration: float = 0.25,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Shake the tube between plates of each gap; return the numbers of each.

    Parameters
    ----------
    gaps : to each side, m
    n : anti-oscillators
    duration : simulated time, s
    out : folder of the results
    """
    mesh = ao.read_mesh(ROOT / "meshes/tube.geo", gdim=3)
    in_plane = [ao.Support("clamp"), ao.Support(lambda x: x[0] > -1, fix=("x", "z", "rx", "ry"))]
    part = ao.Structure(mesh, TUBE, in_plane)
    places = {**PLATES, **SPANS}
    sites = {s: ao.Site((x * LENGTH, 0, 0), (0, 1, 0)) for s, x in places.items()}
    model = ao.extract(part, sites, n=n)
    body = model.site_modes()
    decay = np.where(body.omega > 0, (DAMPING.alpha + DAMPING.beta * body.omega**2) / 2, 0.0)
    body = ao.SiteModes(
        body.omega, body.b, body.sites, r=body.r, directions=body.directions, decay=decay
    )
    print(f"{part.describe()}; {body.omega.size} modes")
    numbers, hits = {}, {}
    for gap in gaps:
        started = time.perf_counter()
        name = f"{gap * 1e3:g} mm"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AccuracyWarning)  # the status is printed
            hits[name] = between_plates(body, gap, duration).run(duration, tol=1e-2)
        numbers[name] = figures(hits[name], duration)
        numbers[name]["seconds"] = time.perf_counter() - started
    compared.table("gap", numbers, COLUMNS)
    for name, hit in hits.items():
        if hit.status:
            print(f"{name}: {hit.message}")
    out.mkdir(parents=True, exist_ok=True)
    plot(hits, duration, out / "tube_between_stops.png")
    print(f"written to {out}: tube_between_stops.png")
    return numbers


def between_plates(body: ao.SiteModes, gap: float, duration: float) -> ao.Scene:
    """Two stops at each plate, one to each side, and the shaking force on the spans in turn."""
    plates = {f"{side} {s}": ao.Obstacle() for s in PLATES for side in ("above", "below")}
    contacts = []
    for s in PLATES:
        for ends in ((f"above {s}", f"tube:{s}"), (f"tube:{s}", f"below {s}")):
            contacts.append(ao.Contact(*ends, ao.Linear(STIFFNESS), gap=gap))
    t = np.linspace(0, duration, 1 + round(duration * FREQUENCY * 50))
    wave = FORCE * np.sin(2 * np.pi * FREQUENCY * t)
    loads = [ao.Load(f"tube:{s}", t, (-1) ** i * wave) for i, s in enumerate(SPANS)]
    return ao.Scene({"tube": body, **plates}, contacts, loads=loads)


def plate_force(hit: ao.SceneHistory, plate: str, t: Array) -> Array:
    """Force (n,) of the tube on a plate, at times (n,)."""
    up, down = hit[f"above {plate}", f"tube:{plate}"], hit[f"tube:{plate}", f"below {plate}"]
    return np.interp(t, up.time, up.force) - np.interp(t, down.time, down.force)


def figures(hit: ao.SceneHistory, duration: float) -> dict[str, float]:
    """Numbers of one gap; the forces of the last two thirds, without the start."""
    t = np.linspace(duration / 3, duration, 40_001)
    found = {f"rms {s}": float(np.sqrt(np.mean(plate_force(hit, s, t) ** 2))) for s in PLATES}
    contacts = [hit[c.a, c.b] for c in hit.assembly.scene.contacts]
    found["peak force"] = max(one.peak_force for one in contacts)
    found["impacts"] = float(sum(len(one.contacts) for one in contacts))
    found["drift"] = hit.energy.drift
    found["status"] = float(hit.status)
    moved = hit.at(t)["tube"]
    found["end"] = float(np.abs(moved.displacement("end")).max())
    return found


def plot(hits: dict[str, ao.SceneHistory], duration: float, path: Path) -> None:
    """The tube; motion of the free end, and the force on its plate: a row for each gap."""
    figure, axes = plotting.panels(len(hits) + 1, 2, size=(8, 2.0 * len(hits) + 1.6), sharex="row")
    whole = figure.add_subplot(axes[0, 0].get_gridspec()[0, :])
    for ax in axes[0]:
        ax.remove()
    sketch(whole)
    axes = axes[1:]
    t = np.linspace(0, duration, 5000)
    for (name, hit), (motion, force) in zip(hits.items(), axes, strict=True):
        motion.plot(t, hit.at(t)["tube"].displacement("end") * 1e3, lw=1)
        force.plot(t, plate_force(hit, "end", t), lw=1)
        motion.set_ylabel("motion (mm)")
        motion.set_title(f"free end, gap {name}", fontsize=10)
        force.set_ylabel("force (N)")
        force.set_title(f"last plate, gap {name}", fontsize=10)
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    plotting.save_figure(figure, path, dpi=120)


def sketch(ax: Axes) -> None:
    """The tube, its plates and the forces on its spans."""
    ax.plot([0, LENGTH], [0, 0], lw=5, color="0.6", solid_capstyle="butt")
    ax.plot([0, 0], [-0.6, 0.6], lw=6, color="k")
    for name, place in PLATES.items():
        for side in (-1, 1):
            ax.plot(2 * [place * LENGTH], [0.25 * side, 0.8 * side], lw=4, color="C0")
        ax.text(place * LENGTH, 0.9, f"plate {name}", ha="center")
    for i, place in enumerate(SPANS.values()):
        tail, tip = (place * LENGTH, -0.7 * (-1) ** i), (place * LENGTH, -0.1 * (-1) ** i)
        ax.annotate("", tip, tail, arrowprops={"arrowstyle": "->", "color": "C3", "lw": 2})
    ax.set(xlim=(-0.1, LENGTH + 0.15), ylim=(-0.9, 1.3))
    ax.set_axis_off()


if __name__ == "__main__":
    command(main)
