"""Derivatives by E, rho and thickness of parts, against extracting them again.

OMP_NUM_THREADS=1 .venv/bin/python benchmarks/gradients_of_parts.py
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import antiosc as ao

MESHES = Path(__file__).resolve().parent.parent / "meshes"
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
ZONES = MESHES / "panel_zones.geo"
#: name, mesh, element size, material, held group, site, anti-oscillators
PARTS: Sequence[tuple[str, Path, float | None, Any, str, ao.Site, int]] = (
    ("plate", ZONES, 0.1, ao.Shell(**STEEL, thickness=3e-3), "held",
     ao.Site((0, 0, 0), (0, 0, -1), radius=6e-3), 40),
    ("panel", MESHES / "panel.msh", None, ao.Shell(**STEEL, thickness=3e-3), "",
     ao.Site((0.45, 0.0, 1.2), (0, 0, -1), radius=6e-3, snap=True), 40),
    ("bracket", MESHES / "bracket.geo", 8e-3, ao.Solid(70e9, 0.33, 2700.0), "",
     ao.Site((0.010, 0.030, 0.050), (-1, 0, 0), radius=6e-3, snap=True), 20),
    ("frame", MESHES / "frame.msh", None,
     ao.Beam(**STEEL, section=ao.Section.circle(0.02)), "feet",
     ao.Site((0.134228, 0.0, 0.0939597), (0, -1, 0), snap=True), 20),
)  # fmt: skip


def main(names: Sequence[str] = ("plate", "panel", "bracket", "frame")) -> dict[str, float]:
    """Largest difference over the goal for each part and number, printed."""
    found = {}
    for name, path, size, material, held, site, n in PARTS:
        if name not in names:
            continue
        mesh = ao.read_mesh(path, size=size) if size else ao.read_mesh(path)
        supports = [ao.Support(held or low(mesh))]

        def build(x: np.ndarray, mesh: Any = mesh, material: Any = material,
                  supports: Any = supports) -> ao.Structure:  # fmt: skip
            scales = dict(zip(numbers(material), x, strict=True))
            changed = {each: getattr(material, each) * s for each, s in scales.items()}
            return ao.Structure(mesh, replace(material, **changed), supports)

        x = np.ones(len(numbers(material)))
        part = build(x)
        model = ao.extract(part, site, n=n)
        mass = 0.2 * part.mass
        hit = ao.simulate(model, ao.RigidMass(mass, 1.0), ao.Linear(0.3 * model.k0), 5e-3, tol=1e-6)
        for goal in ("peak_force", "impulse"):
            g = ao.gradient(hit, goal, part=part)
            again = ao.gradient(hit, goal, part=build, x=x)
            for each, slope in zip(numbers(material), again.x, strict=True):
                off = abs(getattr(g, each) * getattr(material, each) - slope) / g.value
                found[f"{name} {goal} {each}"] = off
                print(
                    f"{name:8} {goal:10} {each:9} {slope / g.value:+.4f} off {off:.1e}", flush=True
                )
    return found


def numbers(material: Any) -> list[str]:
    """The numbers of a material that are compared."""
    return ["E", "rho", *(["thickness"] if isinstance(material, ao.Shell) else [])]


def low(mesh: Any) -> Callable[[np.ndarray], np.ndarray]:
    """The end of a mesh at its least first coordinate."""
    x = mesh.dolfinx.geometry.x[:, 0]
    least, span = float(x.min()), float(np.ptp(x))
    return lambda points: points[0] < least + 1e-3 * span


if __name__ == "__main__":
    warnings.simplefilter("ignore", ao.AntioscWarning)
    main()
