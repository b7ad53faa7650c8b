"""A map: the peak force of a blow anywhere on a bracket.

One eigenproblem and two factors serve every vertex of the surface: each gets anti-oscillators of
its own and an impact of its own. The map tells where a dropped tool loads the part most, and how
much the answer depends on where it falls; a few sites are extracted by themselves to compare.

    .venv/bin/python demos/impact_map.py --help
"""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import command_line
import numpy as np

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
DOWN = (0.0, 0.0, -1.0)
#: Places on top of the base and of the eye, m, that are the same on every mesh.
BASE, EYE = ((40, 30), (52, 30), (62, 30), (76, 30)), (0.0215, 0.03, 0.078)
CHECKED = [EYE, *((x / 1e3, y / 1e3, 0.01) for x, y in BASE)]


def main(
    size: float = 5e-3,
    radius: float = 3e-3,
    velocity: float = 1.0,
    check: int = 5,
    most_sites: int = 100_000,
    out: Path = ROOT / "out",
) -> tuple[ao.ImpactMap, float]:
    """Map the bracket and write it; return it with the worst peak force of a map of `check` places,
    as the relative difference from single impacts.

    Parameters
    ----------
    size : largest elements, m
    radius : of the patches, m
    velocity : of the sphere, m/s, against the surface
    check : places, at most 5, to extract and simulate by themselves
    most_sites : sites of the map at most
    out : folder of the results
    """
    out.mkdir(parents=True, exist_ok=True)
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=size)
    part = ao.Structure(mesh, ao.material("aluminium 6061-T6"), supports=[ao.Support("clamp")])
    sphere = ao.Sphere(radius=10e-3, material="bearing steel 100Cr6", velocity=velocity)
    started = time.perf_counter()
    found = ao.impact_map(part, None, sphere, duration=3e-4, radius=radius, most_sites=most_sites)
    spent = time.perf_counter() - started
    print(f"{part.describe()}\n{len(found)} sites in {spent:.1f} s")
    for name, value in found.quantities().items():
        if np.isfinite(value).all():
            known = np.flatnonzero(~found.doubtful)
            low, high = known[value[known].argmin()], known[value[known].argmax()]
            print(
                f"{name:15s} {value[low]:10.4g} at {_text(found.points[low])}, "
                f"{value[high]:10.4g} at {_text(found.points[high])}"
            )
    given = {"duration": 3e-4, "direction": DOWN, "radius": radius}
    places = ao.impact_map(part, CHECKED[:check], sphere, **given)
    worst = max(_off(part, places, i, sphere) for i in range(len(places)))
    found.write(out / "bracket_map.vtu")
    found.plot(out / "bracket_map.png", "peak_force")
    print(f"written to {out}: bracket_map.vtu, bracket_map.png")
    return found, worst


def _off(part: ao.Structure, found: ao.ImpactMap, i: int, sphere: ao.Sphere) -> float:
    """How far off the peak force of a site is from that of many more anti-oscillators."""
    site = ao.Site(found.points[i], found.directions[i], radius=float(found.radius[i]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of patches that an edge cuts: the map told
        hit = ao.simulate(ao.extract(part, site, n=60), sphere, duration=3e-4)
    print(
        f"at {_text(found.points[i])}: peak force {found.peak_force[i]:.1f} N by the map, "
        f"{hit.peak_force:.1f} N by itself"
    )
    return abs(float(found.peak_force[i]) / hit.peak_force - 1)


def _text(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{1e3 * c:.1f}" for c in point) + ") mm"


if __name__ == "__main__":
    command_line.command(main)
