"""Hail on a roof sheet: a ball of ice strikes one flange of a steel sheet, of several thicknesses.

Forces and deflections with and without second-order strain, and the dent by the contact law. Hail
crushes, which no law here describes: the ice stays elastic, so that force and dent are on the safe
side. Where the modes do not suffice,
"told" is 1: an explicit code is right there.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import command_line
import compared
import numpy as np

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
COLUMNS: compared.Columns = {
    "peak N": ("peak_force", 1.0, ".0f"),
    "mm": ("deflection", 1e3, ".3f"),
    "linear mm": ("linear", 1e3, ".3f"),
    "w/h": ("ratio", 1.0, ".2f"),
    "modes": ("modes", 1.0, ".0f"),
    "left, %": ("left", 1e2, ".2f"),
    "dent µm": ("dent", 1e6, ".1f"),
    "told": ("told", 1.0, ".0f"),
}


def main(
    thicknesses: tuple[float, ...] = (0.63e-3, 0.8e-3, 1.25e-3, 1.5e-3),
    length: float = 0.15,
    width: float = 0.12,
    diameter: float = 20e-3,
    velocity: float = 15.0,
    size: float = 7.5e-3,
    n: int = 80,
    duration: float = 0.8e-3,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float | None]]:
    """Strike the middle of a flange of each thickness; return the numbers of each.

    Parameters
    ----------
    thicknesses : of the sheet, m
    length, width : of the flange, held all around by webs and purlins, m
    diameter, velocity : of the ball of ice, m and m/s
    size : of the elements, m
    n, duration : anti-oscillators, time simulated (s)
    out : folder of the picture
    """
    out.mkdir(parents=True, exist_ok=True)
    ball = ao.Sphere(radius=diameter / 2, material="ice", velocity=velocity)
    site = ao.Site((length / 2, width / 2, 0), (0, 0, -1))
    numbers, hits = {}, {}
    for thickness in thicknesses:
        part = flange(thickness, length, width, size)
        model = ao.extract(part, site, n=n, stretch="auto")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AccuracyWarning)  # the table says so
            linear = ao.simulate(replace(model, stretch=None), ball, duration=duration)
            hit = ao.simulate(model, ball, duration=duration)
        name = f"{1e3 * thickness:.2f} mm"
        hits[name] = {"linear": linear, "stretched": hit}
        moved = float(np.abs(hit.displacement).max())
        numbers[name] = {
            "peak_force": hit.peak_force,
            "deflection": moved,
            "linear": float(np.abs(linear.displacement).max()),
            "ratio": moved / thickness,
            "modes": sum(one.size for one in hit.assembly.stretch_forces.values()),
            "left": max(hit.error_budget[each].stretch for each in ("peak_force", "impulse")),
            "dent": None if hit.dent is None else hit.dent.depth,
            "told": float("explicit finite element" in hit.message),
        }
    compared.table("sheet", numbers, COLUMNS)
    compared.plot_hits(hits, out / "roof_hail.png")
    return numbers


def flange(thickness: float, length: float, width: float, size: float) -> ao.Structure:
    """A flat sheet of steel that webs and purlins hold."""
    mesh = ao.box_mesh((length, width), size=size)
    edges = [ao.Support(side) for side in ("-x", "+x", "-y", "+y")]
    return ao.Structure(mesh, ao.material("steel S275", thickness=thickness), edges)


if __name__ == "__main__":
    command_line.command(main)
