"""A drop: a bracket falls from 0.3 m onto concrete, inclined, and tumbles.

The script prints the table of impacts, the peak acceleration at the eye in g, the worst stress
against yield, and draws the fall. With --falls it also computes falls with random tilts and prints
the bound below which 99 % of their peak forces lie.

    .venv/bin/python demos/drop.py --help
"""

from __future__ import annotations

import time
from pathlib import Path

import command_line

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
ALUMINIUM = ao.material("aluminium 6082-T6")
CONCRETE = ao.material("concrete C30/37")
POINT = (0.0832, 0.0538, 0.01)


def main(
    height: float = 0.3,
    size: float = 6e-3,
    impacts: int = 4,
    falls: int = 1,
    out: Path = ROOT / "out",
) -> dict[str, float]:
    """Drop the bracket; return the main numbers.

    Parameters
    ----------
    height : of the lowest point, m
    size : of the elements, m (6 mm: 37 000 dofs)
    impacts : after which the fall ends
    falls : of the ensemble; 1: none
    out : folder of the results
    """
    started = time.perf_counter()
    part = ao.Structure(ao.read_mesh(ROOT / "meshes/bracket.geo", size=size), ALUMINIUM)
    given = {"floor": ao.Floor(CONCRETE, friction=0.3), "tilt": (10, 5, 0), "corner_radius": 3e-3}
    fall = ao.drop(part, height, until=impacts, **given)
    print(part.describe())
    print(fall.summary())
    peak, stress = fall.peak("acceleration", POINT, "CFC1000"), fall.worst(impacts=(0, 1))
    numbers = {
        "peak force": fall.peak_force,
        "peak g": peak.g,
        "of yield": stress.margin().exposure,
        "seconds": time.perf_counter() - started,
    }
    if falls > 1:
        tilts = ao.Tilts(sigma=2.0)
        many = ao.drop(
            fall.body, height, until=impacts, tol=1e-2, **given, ensemble=tilts, n=falls
        )  # fmt: skip
        print("99 % of the peak forces are below", many.quantile("peak_force", 0.99))
    print(", ".join(f"{name} {value:.4g}" for name, value in numbers.items()))
    out.mkdir(parents=True, exist_ok=True)
    fall.plot(out / "drop.png")
    stress.plot(out / "drop_stress.png")
    print(f"written to {out}: drop.png, drop_stress.png")
    return numbers


if __name__ == "__main__":
    command_line.command(main)
