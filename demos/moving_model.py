"""The model at work: a mass strikes the tip of a cantilever, and the anti-oscillators move.

One animation shows the beam, its model and the force. The beam holds all that the model leaves
out, since `probe` puts its shapes together again.

    .venv/bin/python demos/moving_model.py --help
"""

from __future__ import annotations

from pathlib import Path

import command_line
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import antiosc as ao
from antiosc.plot.model_picture import draw_model

ROOT = Path(__file__).resolve().parent.parent
LENGTH, DOWN = 0.5, (0, 0, -1)
BEAM = ao.Beam(
    E=70e9,
    nu=0.33,
    rho=2700.0,
    section=ao.Section.rectangle(width=0.02, height=0.01),
    orientation=(0, 0, 1),
)


def main(
    n: int = 5, speed: float = 1.0, frames: int = 72, out: Path = ROOT / "out"
) -> dict[str, float]:
    """Strike the cantilever and draw the run; return its main numbers.

    Parameters
    ----------
    n : anti-oscillators
    speed : of the mass, m/s
    frames : of the animation
    out : folder of the results
    """
    part = ao.Structure(ao.box_mesh((LENGTH,), size=LENGTH / 50), BEAM, [ao.Support("-x")])
    model = ao.extract(part, ao.Site((LENGTH, 0, 0), DOWN), n=n)
    mass = ao.RigidMass(0.1, velocity=speed)
    hit = ao.simulate(model, mass, ao.Linear(2e5), duration=20e-3)
    print(hit.summary())

    out.mkdir(parents=True, exist_ok=True)
    path = out / "moving_model.gif"
    animate(part, model, hit, np.linspace(0, hit.time[-1], frames), path)
    print(f"written to {path}")
    rebound = -float(hit.impactor_velocity[-1])
    return {"peak force": hit.peak_force, "impulse": hit.impulse, "rebound": rebound}


def animate(
    part: ao.Structure, model: ao.AntiOscillators, hit: ao.History, times: np.ndarray, path: Path
) -> None:
    """Write the run at these times as a picture that moves."""
    x = np.linspace(0, LENGTH, 26)
    shape = np.array([ao.probe(part, hit, (at, 0, 0), times=times)[:, 2] for at in x])
    striker = np.interp(times, hit.time, hit.impactor_displacement)
    moved = np.column_stack((striker, hit.coordinates(times)))
    scale = 1.1 / np.abs(moved[:, 1:]).max()

    figure = Figure(figsize=(7.6, 4.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.5), height_ratios=(1.6, 1))
    beam, picture = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    force = figure.add_subplot(grid[1, :])
    force.plot(hit.time * 1e3, hit.force, color="C0")
    force.set(xlabel="time (ms)", ylabel="contact force (N)", xlim=(0, hit.time[-1] * 1e3))
    (now,) = force.plot([], [], "o", color="C3")

    def draw(k: int) -> None:
        draw_beam(beam, x, shape[:, k], striker[k], np.abs(shape).max())
        picture.clear()
        draw_model(picture, model.m0, model.k0, model.m, model.omega, moved[k] * scale)
        now.set_data([times[k] * 1e3], [np.interp(times[k], hit.time, hit.force)])

    FuncAnimation(figure, draw, frames=len(times), init_func=lambda: None).save(
        path, writer=PillowWriter(fps=15), dpi=80
    )


def draw_beam(ax: Axes, x: np.ndarray, z: np.ndarray, striker: float, largest: float) -> None:
    """The deflected beam [m], enlarged, with the mass above its tip."""
    ax.clear()
    ax.plot(x, z, color="#1f3552", lw=3)
    ax.plot([0, 0], [-0.3 * largest, 0.3 * largest], color="k", lw=5)
    ax.plot([LENGTH], [-striker + 0.15 * largest], "o", ms=14, color="#f2c9a1", mec="#7a3b00")
    ax.set(xlim=(-0.03, LENGTH + 0.05), ylim=(-1.6 * largest, 1.6 * largest))
    ax.set_title("the structure (deflection enlarged)", fontsize=9)
    ax.axis("off")


if __name__ == "__main__":
    command_line.command(main)
