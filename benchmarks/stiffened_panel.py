"""A steel sphere strikes a stiffened panel with a motor on it, modelled in two ways.

The curved aluminium skin stands on stringers and frames. Once these are blades, shells that share
edges with the skin; once they are beams on the lines of the skin. Its curved ends are held, a motor
sits on it as a point mass, and two mounts hold its straight sides as springs. Struck are the skin
between two stringers, and the skin over a stringer.

    .venv/bin/python benchmarks/stiffened_panel.py --help
"""

from __future__ import annotations

import time
from math import cos, radians, sin
from pathlib import Path

import numpy as np
from options import command, compared

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
RADIUS, LENGTH, ARC = 1.2, 0.9, 36.0  # of the skin, as in meshes/make_panel.py
HEIGHT, DEPTH = 0.025, 0.040  # of stringers and frames
SITES = {"between stringers": (0.45, 5.0), "over a stringer": (0.45, 0.0)}  # x in m, degrees
MOTOR = (0.15, -5.0)


def main(
    skin: float = 2e-3,
    blade: float = 3e-3,
    sphere: float = 15e-3,
    velocity: float = 2.0,
    n: int = 40,
    duration: float = 4e-3,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Strike both models at both sites; return the numbers of each.

    Parameters
    ----------
    skin, blade : thicknesses, m
    sphere : radius of the steel sphere, m
    velocity : of the sphere, m/s
    n : anti-oscillators
    duration : simulated time, s
    out : folder of the results
    """
    out.mkdir(parents=True, exist_ok=True)
    striker = ao.Sphere(radius=sphere, **STEEL, velocity=velocity)
    contact = striker.hertz(ALUMINIUM["E"], ALUMINIUM["nu"], radii=(RADIUS, float("inf")))
    numbers = {}
    hits: dict[str, dict[str, ao.History]] = {place: {} for place in SITES}
    for name, build in (("shells", with_blades), ("beams", with_beams)):
        started = time.perf_counter()
        part = build(skin, blade)
        for place, at in SITES.items():
            site = ao.Site(surface(*at), inward(at[1]), snap=True)
            model = ao.extract(part, site, n=n)
            hit = ao.simulate(model, striker, contact, duration=duration)
            hits[place][f"stiffeners as {name}"] = hit
            numbers[f"{name}, {place}"] = {
                **compared.numbers(part, model, hit, striker.mass, velocity),
                "contact_time": hit.contact_time,
                "restitution": hit.restitution,
                "seconds": time.perf_counter() - started,
            }
            started = time.perf_counter()
        if name == "shells":
            frames = np.linspace(0, duration, 30)
            ao.write_series(part, hit, out / "stiffened_panel.pvd", frames)
    own = {"contact µs": ("contact_time", 1e6, ".1f"), "restitution": ("restitution", 1.0, ".3f")}
    compared.print_table("model, site", numbers, {**own, **compared.SECONDS})
    compared.plot_hits(hits, out / "stiffened_panel.png")
    print(f"written to {out}: stiffened_panel.png, stiffened_panel.pvd")
    return numbers


def with_blades(skin: float, blade: float) -> ao.Structure:
    """Skin, stringers and frames as shells."""
    mesh = ao.read_mesh(ROOT / "meshes/panel.msh")
    stiff = ao.Shell(**ALUMINIUM, thickness=blade)
    materials = {
        "skin": ao.Shell(**ALUMINIUM, thickness=skin),
        "stringers": stiff,
        "frames": stiff,
    }
    return ao.Structure(mesh, materials, [ao.Support("ends")], attached=attached())


def with_beams(skin: float, blade: float) -> ao.Structure:
    """The skin as a shell, stringers and frames as beams below it."""
    mesh = ao.read_mesh(ROOT / "meshes/skin.msh")
    materials: dict[str, ao.Shell | ao.Beam] = {"skin": ao.Shell(**ALUMINIUM, thickness=skin)}
    for name, height in (("stringers", HEIGHT), ("frames", DEPTH)):
        section = ao.Section.rectangle(width=blade, height=height)
        materials[name] = ao.Beam(
            **ALUMINIUM, section=section, orientation=toward_axis, offset=height / 2
        )
    return ao.Structure(mesh, materials, [ao.Support("ends")], attached=attached())


def attached() -> list[ao.PointMass | ao.Spring]:
    """A motor of 1.5 kg, and a mount amid each straight side."""
    mounts = [ao.Spring(surface(LENGTH / 2, side * ARC / 2), {"z": 2e5}) for side in (-1, 1)]
    return [ao.PointMass(surface(*MOTOR), mass=1.5, inertia=2e-3), *mounts]


def surface(x: float, angle: float) -> tuple[float, float, float]:
    """A point of the skin."""
    return x, RADIUS * sin(radians(angle)), RADIUS * cos(radians(angle))


def inward(angle: float) -> tuple[float, float, float]:
    """The direction toward the axis."""
    return 0.0, -sin(radians(angle)), -cos(radians(angle))


def toward_axis(x: np.ndarray) -> np.ndarray:
    """The height direction of stringers and frames at points x (3, n)."""
    return np.stack([0 * x[0], -x[1], -x[2]])


if __name__ == "__main__":
    command(main)
