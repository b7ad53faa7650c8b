"""Four accelerometers tell where a plate was struck, and how hard.

The signals are made here: a blow of a plastic mallet on a plate with another mesh and another
modulus, with noise. The model that finds it knows neither.

    .venv/bin/python demos/find_blow.py --help
"""

from __future__ import annotations

from pathlib import Path

import command_line
import numpy as np

import antiosc as ao
from antiosc import plotting

ROOT = Path(__file__).resolve().parent.parent
GEO = """SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.4, 0.3};
Physical Surface("skin") = {1}; Physical Curve("rim") = {1, 2, 3, 4};
"""
POINTS = [(0.07, 0.06, 0.0), (0.33, 0.08, 0.0), (0.29, 0.25, 0.0), (0.11, 0.22, 0.0)]
PLACE, DOWN, RATE, START = (0.247, 0.121, 0.0), (0, 0, -1), 25e3, 8e-4
MALLET = ao.RigidMass(0.2, velocity=1.5, tip_radius=0.1, material="PE-HD")


def main(
    size: float = 0.03, noise: float = 0.03, E: float = 1.01, out: Path = ROOT / "out"
) -> dict[str, float]:
    """Strike, measure and find; return the errors.

    Parameters
    ----------
    size : of the elements of the model, m; those of the struck plate are smaller
    noise : standard deviation over the root mean square of each signal
    E : modulus of the struck plate over that of the model
    out : folder of the results
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "plate.geo").write_text(GEO)
    truth = plate(out / "plate.geo", 0.8 * size, E)
    hit = ao.simulate(ao.extract(truth, ao.Site(PLACE, DOWN), n=60), MALLET, duration=0.012)
    t = np.arange(250) / RATE - START
    signals = np.array(
        [ao.probe(truth, hit, p, "acceleration", np.maximum(t, 0))[:, 2] for p in POINTS]
    ).T
    signals[t < 0] = 0.0
    spread = noise * signals.std(axis=0)
    signals += spread * np.random.default_rng(0).standard_normal(signals.shape)

    part = plate(out / "plate.geo", size, 1.0)
    sensors = [ao.Sensor(point, (0, 0, 1)) for point in POINTS]
    found = ao.find_impact(part, sensors, signals, RATE, where="skin", direction=DOWN, modes=40)
    print(found.summary())
    found.plot(out / "find_blow_signals.png")
    plot(found, hit, out / "find_blow.png")
    errors = {
        "place": float(np.linalg.norm(found.place - PLACE)),
        "peak force": found.peak_force / hit.peak_force - 1,
        "mass": found.mass / MALLET.mass - 1,
    }
    print(", ".join(f"{name} {value:.2g}" for name, value in errors.items()))
    print(f"written to {out}: find_blow.png, find_blow_signals.png")
    return errors


def plate(path: Path, size: float, E: float) -> ao.Structure:
    """A plate of steel on its rim."""
    mesh = ao.read_mesh(path, size=size, gdim=3)
    steel = ao.material("steel S235", E=E * 210e9, thickness=4e-3)
    return ao.Structure(mesh, steel, [ao.Support("rim", ("x", "y", "z"))])


def plot(found: ao.FoundImpact, hit: ao.History, path: Path) -> None:
    """What a pulse at each place explains, the place found, and the force."""
    figure, axes = plotting.panels(1, 2, size=(9.5, 3.6))
    left, right = axes[0]
    x, y = 1e3 * found.points[:, :2].T
    shown = left.tricontourf(x, y, found.explained, 20, cmap="Greys")
    figure.colorbar(shown, ax=left, label="share of the signals that a pulse explains")
    left.plot(*(1e3 * np.array(POINTS)[:, :2].T), "s", color="C0", label="sensors")
    left.plot(1e3 * PLACE[0], 1e3 * PLACE[1], "o", ms=12, mfc="none", color="C2", label="struck")
    left.plot(*(1e3 * found.place[:2]), "x", color="C3", label="found")
    left.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    left.legend(fontsize=8, loc="upper left")
    t = np.linspace(0.0, 1.5 * hit.contact_time, 400)
    right.plot(1e3 * t, hit.force_at(t), lw=3, color="0.7", label="struck")
    right.plot(1e3 * t, found.history.force_at(t), color="C3", lw=1.2, label="found")
    right.set(xlabel="time from the touch (ms)", ylabel="contact force (N)", ylim=(0, None))
    right.legend(fontsize=8)
    plotting.save_figure(figure, path, dpi=110)


if __name__ == "__main__":
    command_line.command(main)
