"""A composite panel: a ball strikes aluminium, carbon plies and a sandwich of equal mass.

The ball is of rubber, which gives way more than any of the panels; a hard tool would press into the
foam, and a sheet's thickness does not deform here. Deflections stay below half a thickness,
beyond which a sheet stretches.
"""

from __future__ import annotations

from pathlib import Path

import command_line
import compared
import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao
from antiosc import plotting

ROOT = Path(__file__).resolve().parent.parent
FIBRES = {"E1": 135e9, "E2": 9e9, "nu12": 0.3, "G12": 5e9, "G13": 5e9, "G23": 3.5e9}
PLY = ao.Layer(**FIBRES, rho=1600.0, thickness=0.5e-3)
FOAM = ao.Layer.isotropic(E=170e6, nu=0.3, rho=160.0, thickness=20e-3)

CARBON = ao.Laminate([PLY.rotated(a) for a in (0, 45, -45, 90, 90, -45, 45, 0)])
FACE = [PLY.rotated(a) for a in (45, -45)]
SANDWICH = ao.Laminate([*FACE, FOAM, *FACE[::-1]])
ALUMINIUM = "aluminium 6061-T6"
SHEET = ao.material(ALUMINIUM, thickness=CARBON.section.I0 / ao.material(ALUMINIUM).rho)
COLUMNS: compared.Columns = {
    "thick mm": ("thickness", 1e3, ".2f"),
    "mass kg": ("mass", 1.0, ".3f"),
    "D11 N m": ("bending", 1.0, ".1f"),
    "k0 N/m": ("k0", 1.0, ".4g"),
    "first AO Hz": ("first", 1.0, ".0f"),
    "peak N": ("peak_force", 1.0, ".0f"),
    "contact µs": ("contact_time", 1e6, ".0f"),
    "deflection mm": ("deflection", 1e3, ".3f"),
    "restitution": ("restitution", 1.0, ".3f"),
}
PANELS = {"aluminium": SHEET, "carbon": CARBON, "sandwich": SANDWICH}


def main(
    length: float = 0.40,
    width: float = 0.30,
    sphere: float = 30e-3,
    height: float = 0.04,
    elements: int = 16,
    n: int = 60,
    duration: float = 16e-3,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Strike the middle of each panel; return the numbers of each.

    Parameters
    ----------
    length, width : of the panels, m
    sphere, height : radius of the rubber ball, height that it falls from, m
    elements : along the width
    n, duration : anti-oscillators, time simulated (s)
    out : folder of the picture
    """
    out.mkdir(parents=True, exist_ok=True)
    corners, count = [np.zeros(2), np.array([length, width])], round(elements * length / width)
    sheet = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [count, elements])
    mesh = ao.read_mesh(sheet)
    ends = ao.Support(lambda x: np.isclose(x[0], 0) | np.isclose(x[0], length), ("y", "z", "rx"))
    sides = ao.Support(lambda x: np.isclose(x[1], 0) | np.isclose(x[1], width), ("x", "z", "ry"))
    speed = float(np.sqrt(2 * 9.80665 * height))
    striker = ao.Sphere(radius=sphere, material="rubber NR 60 IRHD", velocity=speed)
    site = ao.Site((length / 2, width / 2, 0), (0, 0, -1))
    numbers, hits = {}, {}
    for name, material in PANELS.items():
        part = ao.Structure(mesh, material, [ends, sides])
        model = ao.extract(part, site, n=n)
        hit = hits[name] = ao.simulate(model, striker, duration=duration)
        numbers[name] = {
            **compared.numbers(part, model, hit, striker.mass, striker.velocity),
            "thickness": material.thickness,
            "bending": material.section.D[0, 0],
            "contact_time": hit.contact_time,
            "deflection": float(np.max(hit.displacement)),
            "restitution": hit.restitution,
        }
    compared.table("panel", numbers, COLUMNS)
    compared.plot_hits({"panels of equal mass": hits}, out / "composite_panel.png")
    arrow = {"point": site.point, "direction": site.direction}
    plotting.plot_deformed(part, hit, out / "composite_panel_part.png", **arrow)
    return numbers


if __name__ == "__main__":
    command_line.command(main)
