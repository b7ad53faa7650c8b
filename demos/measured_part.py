"""A measured structure: a hammer, an accelerometer and no mesh.

The measurements are made here: accelerance at the struck point of a steel bar with all its modes,
with the mass of the sensor and noise, and the force of a blow. The model knows the first file.

    .venv/bin/python demos/measured_part.py --help
"""

from __future__ import annotations

from pathlib import Path

import command_line
import numpy as np

import antiosc as ao
from antiosc import closed_form, plotting

ROOT = Path(__file__).resolve().parent.parent
BEAM = closed_form.UniformBeam.timoshenko(
    E=210e9, nu=0.3, rho=7850.0, area=4e-4, inertia=1.33e-8, length=0.5
)
SENSOR, DAMPING = 2e-3, 0.006
BALL = ao.RigidMass(0.05, velocity=1.0, tip_radius=0.01, material="POM")
STEEL, END = "steel S355", 6e-4


def main(
    top: float = 12.8e3, noise: float = 0.01, lines: int = 1600, out: Path = ROOT / "out"
) -> dict[str, float]:
    """Measure, fit, strike and compare; return the main numbers.

    Parameters
    ----------
    top : of the measured band, Hz
    noise : standard deviation over the magnitude
    lines : frequencies
    out : folder of the results
    """
    out.mkdir(parents=True, exist_ok=True)
    modes = closed_form.cantilever(BEAM, 0.37).anti_oscillators(79).modal()
    part = ao.SiteModes(modes.omega, modes.b[:, None], ["eye"], decay=DAMPING * modes.omega)
    measure(part, top, noise, lines, out)
    contact = ao.Contact("bar:eye", "ball", ao.contact_between(BALL, STEEL))
    scene = ao.Scene({"bar": part, "ball": BALL}, [contact])
    true = scene.run(END, tol=1e-5)["bar:eye", "ball"]
    t, spread = np.linspace(0.0, END, 400), np.random.default_rng(1).standard_normal(400)
    force = np.interp(t, true.time, true.force) + 0.01 * true.peak_force * spread
    np.savetxt(out / "force.csv", np.column_stack([t, force]), header="time, force", delimiter=",")

    frf = ao.read_frf(out / "hammer.csv", quantity="accelerance")
    model = ao.from_frf(frf, band=(20, top), sensor_mass=SENSOR).with_surface(STEEL)
    hit = ao.simulate(model, BALL, duration=END)
    over = ao.compare(hit, out / "force.csv")
    print(hit.summary())
    print(hit.error_budget)
    over.plot(out / "measured_force.png")
    plot(frf, model, over, out / "measured_part.png")
    numbers = {
        "peak error": hit.peak_force / true.peak_force - 1,
        "bar": hit.error_budget["peak_force"].total,
        "L2": over.L2,
    }
    print(", ".join(f"{name} {value:.3%}" for name, value in numbers.items()))
    print(f"written to {out}: measured_part.png, measured_force.png")
    return numbers


def measure(part: ao.SiteModes, top: float, noise: float, lines: int, out: Path) -> None:
    """Write the accelerance with the sensor at the struck point."""
    f = top * np.arange(1, lines + 1) / lines
    w = 2 * np.pi * f
    Z = 1 / part.receptance(w)[:, 0, 0] - w**2 * SENSOR
    random = np.random.default_rng(0).standard_normal((lines, 2)) @ [1, 1j] / np.sqrt(2)
    A = -(w**2) / Z * (1 + noise * random)
    table = np.column_stack([f, A.real, A.imag])
    np.savetxt(out / "hammer.csv", table, header="frequency (Hz), real, imag", delimiter=",")


def plot(frf: ao.FRF, model: ao.AntiOscillators, over: ao.ForceComparison, path: Path) -> None:
    """Measured and fitted accelerance; measured and computed force."""
    figure, axes = plotting.panels(2, 1, size=(7.5, 6.0))
    above, below = axes[:, 0]
    f = np.geomspace(20, 4 * frf.frequency[-1], 6000)
    H = model.modal().receptance(2 * np.pi * f) * (2 * np.pi * f) ** 2
    above.loglog(frf.frequency, np.abs(frf.values), ".", ms=4, color="0.7", label="measured")
    above.loglog(f, np.abs(H), lw=1, label="model, without the sensor")
    above.axvspan(frf.frequency[-1], f[-1], color="0.93", zorder=0, label="above the band")
    above.set(xlabel="frequency (Hz)", ylabel="accelerance (m/s² per N)")
    below.plot(1e3 * over.time, over.measured, ".", ms=4, color="0.7", label="measured")
    below.plot(1e3 * over.time, over.computed, lw=1.3, label=f"computed, L2 {over.L2:.2%}")
    below.set(xlabel="time (ms)", ylabel="contact force (N)")
    above.legend(loc="lower right")
    below.legend(loc="upper right")
    plotting.save_figure(figure, path, dpi=110)


if __name__ == "__main__":
    command_line.command(main)
