"""The thickness of a guard by its gradients: a softer blow at the same mass.

A thrown part with a round end of nylon strikes the middle of a steel panel. Where does material
raise the contact force, where does it lower it? `design_map` says it cell by cell after one impact;
SciPy's optimizer then finds the thicknesses of three zones with the least peak force at the mass of
the uniform panel.

    .venv/bin/python demos/guard_thickness.py --help
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import command_line
import numpy as np
from scipy.optimize import minimize

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
STEEL = "steel S235"
#: Areas of the zones of meshes/panel_zones.geo, m².
ZONES = {"middle": 0.2 * 0.14, "ring": 0.4 * 0.28 - 0.2 * 0.14, "rim": 0.6 * 0.4 - 0.4 * 0.28}
SITE = ao.Site((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), radius=4e-3)


def main(
    size: float = 0.03,
    thickness: float = 3e-3,
    mass: float = 0.3,
    velocity: float = 1.0,
    n: int = 40,
    out: Path = ROOT / "out",
) -> dict[str, float]:
    """Map the panel, then find its best zones; return forces, thicknesses and the number of runs.

    Parameters
    ----------
    size : of the elements, m
    thickness : of the uniform panel, m; the zones may have 0.6 to 2 times as much
    mass, velocity : of the thrown part, kg and m/s
    n : anti-oscillators
    out : folder of the picture
    """
    mesh = ao.read_mesh(ROOT / "meshes/panel_zones.geo", size=size)
    striker = ao.RigidMass(mass, velocity, tip_radius=0.03, material="PA66 dry")

    def part(x: np.ndarray) -> ao.Structure:
        zones = {name: ao.material(STEEL, thickness=t) for name, t in zip(ZONES, x, strict=True)}
        return ao.Structure(mesh, zones, [ao.Support("held")])

    def build(x: np.ndarray) -> tuple[Any, ...]:
        return ao.extract(part(x), SITE, n=n), striker, "auto", 8e-3

    first = np.full(len(ZONES), thickness)
    uniform, areas = part(first), np.array(list(ZONES.values()))
    hit = ao.simulate(*build(first), tol=1e-5)
    g = ao.gradient(hit, "peak_force", part=part, x=first, error="estimate")
    for zone, slope, bar in zip(ZONES, 1e-3 * g.x, 1e-3 * g.error.x, strict=True):
        print(f"{zone:6}: {slope:+8.1f} N per mm, bar {bar:.1f} N")
    found = ao.design_map(uniform, hit, "peak_force")
    out.mkdir(parents=True, exist_ok=True)
    found.plot(out / "guard_thickness.png")

    def force(x: np.ndarray) -> float:
        """Peak force over that of the uniform panel, by relative thicknesses."""
        return ao.simulate(*build(x * thickness)).peak_force / hit.peak_force

    best = minimize(
        force,
        np.ones(len(ZONES)),
        method="SLSQP",
        bounds=[(0.6, 2.0)] * len(ZONES),
        constraints={"type": "eq", "fun": lambda x: areas @ (x - 1) / areas.sum()},
        options={"maxiter": 3, "eps": 1e-2},
    )
    numbers = {
        "uniform": hit.peak_force,
        "best": best.fun * hit.peak_force,
        "runs": float(best.nfev),
        "mass": float(areas @ best.x / areas.sum()),
        **{zone: float(t) * thickness for zone, t in zip(ZONES, best.x, strict=True)},
    }
    print(
        f"peak force {hit.peak_force:.0f} N, {numbers['best']:.0f} N after {best.nfev} runs, with"
    )
    print(", ".join(f"{1e3 * numbers[zone]:.2f} mm in the {zone}" for zone in ZONES))
    return numbers


if __name__ == "__main__":
    command_line.command(main)
