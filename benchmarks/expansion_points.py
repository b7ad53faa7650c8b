"""Errors of peak forces by the expansion point of the Krylov space, on plates under balls.

Simply supported plates of aluminium, 0.5 × 0.33 m, are struck by steel balls for 2 ms, later
impacts included. The errors are those to 400 anti-oscillators about the point of the scene
(`expansion_of`), whose own estimate stands beside; the other estimates are those of
`truncation_error`.

    .venv/bin/python benchmarks/expansion_points.py --help
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import options

import antiosc as ao
from antiosc_app.until_parted import expansion_of

LENGTH = 0.5
PLATE = (
    'SetFactory("OpenCASCADE"); Rectangle(1) = {{0, 0, 0, {a}, {b}}}; Physical Surface("plate") ='
    ' {{1}}; Physical Curve("edges") = {{1, 2, 3, 4}};'
)
#: Radius [m] and speed [m/s] of the balls.
BALLS = ((0.005, 3.0), (0.015, 2.0), (0.03, 1.0))


def main(
    thicknesses: Sequence[float] = (1e-3, 3e-3), counts: Sequence[int] = (20, 60, 150)
) -> None:
    """Print the errors and estimates of all plates, balls, numbers and points.

    Parameters
    ----------
    thicknesses : of the plates, m
    counts : numbers of anti-oscillators
    """
    x = (0.53 * LENGTH, 0.37 * 0.66 * LENGTH, 0.0)
    site = ao.Site(x, (0, 0, -1))
    print("| plate, ball | n | static | half | as chosen | twice |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        path = Path(folder) / "plate.geo"
        path.write_text(PLATE.format(a=LENGTH, b=0.66 * LENGTH))
        for thickness in thicknesses:
            mesh = ao.read_mesh(path, size=0.03 * LENGTH, refine=[(x, 0.012 * LENGTH)])
            sheet = ao.material("aluminium 7075-T6", thickness=thickness)
            part = ao.Structure(mesh, sheet, [ao.Support("edges", ("x", "y", "z"))])
            for radius, speed in BALLS:
                ball = ao.Sphere(radius, material="bearing steel 100Cr6", velocity=speed)
                struck(part, site, ball, counts, f"{1e3 * thickness:g} mm, {1e3 * radius:g} mm")


def struck(
    part: ao.Structure, site: ao.Site, ball: ao.Sphere, counts: Sequence[int], name: str
) -> None:
    """Print the rows of a plate and a ball."""

    def run(n: int, point: float | None) -> tuple[ao.History, float]:
        hit = ao.simulate(ao.extract(part, site, n=n, expansion=point), ball, duration=2e-3)
        assert hit.rerun is not None
        return hit, ao.truncation_error(hit.model, hit.rerun).peak_force

    point = expansion_of(run(20, None)[0])
    true, left = run(400, point)
    print(f"| {name}: {true.peak_force:.1f} N ± {left:.1%}, {point:.0f} Hz |||||")
    for n in counts:
        cells = []
        for each in (None, point / 2, point, 2 * point):
            hit, estimate = run(n, each)
            cells.append(f"{hit.peak_force / true.peak_force - 1:+.1%} ({estimate:.1%})")
        print(f"| | {n} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    options.command(main)
