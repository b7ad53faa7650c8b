"""Widths of proved bounds by the number of Krylov vectors, and what they cost: a picture and rows.

    python benchmarks/proof_widths.py [--picture docs/pictures/proof.png]

Parts under a ball of 33 g at 0.5 m/s, Hertz' law of 1e10 N/m^1.5, and a bracket under softer ones.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao
from antiosc import plotting
from antiosc.impact.enclosure import enclosures
from antiosc.impact.settings import PROOF_TOL
from antiosc.reduce.extraction.extract import PERIODS_IN_CONTACT

ROOT = Path(__file__).resolve().parent.parent
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
NUMBERS = (5, 10, 15, 20, 30, 40, 60, 80)


def box(sides, cells, face, place, radius):
    """A box with one held face (axis), struck on its top."""
    hexahedra = dolfinx.mesh.CellType.hexahedron
    mesh = dolfinx.mesh.create_box(MPI.COMM_WORLD, [np.zeros(3), np.array(sides)], cells, hexahedra)
    held = ao.Support(lambda x: np.isclose(x[face], 0.0))
    site = ao.Site((*place, sides[2]), (0, 0, -1), radius=radius)
    return ao.Structure(ao.read_mesh(mesh), ao.Solid(**STEEL), [held]), site


def block():
    return box((0.04, 0.04, 0.02), (6, 6, 3), 2, (0.02, 0.02), 6e-3)


def lever():
    return box((0.12, 0.02, 0.01), (18, 3, 2), 0, (0.096, 0.01), 4e-3)


def bracket(radius):
    point = (0.020, 0.040, 0.075)
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=6e-3, refine=[(point, 2e-3)])
    part = ao.Structure(mesh, ao.Solid(70e9, 0.33, 2700.0), [ao.Support("clamp")])
    return part, ao.Site(point, (-0.2, -0.6, -0.8), radius=radius, snap=True)


def plate():
    """A clamped plate of 200 x 200 x 8 mm."""
    kind = dolfinx.mesh.CellType.quadrilateral
    corners = [np.zeros(2), np.full(2, 0.2)]
    mesh = ao.read_mesh(dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [32, 32], kind))
    edge = ao.Support(lambda x: np.isclose(np.abs(x[:2] - 0.1).max(axis=0), 0.1))
    part = ao.Structure(mesh, ao.Shell(**STEEL, thickness=8e-3), [edge])
    return part, ao.Site((0.083, 0.117, 0.0), (0, 0, -1))


def beam():
    """A pinned beam of 300 x 20 x 10 mm, struck off its middle."""
    mesh = ao.box_mesh([0.3], 0.3 / 400, gdim=2)
    material = ao.Beam(**STEEL, section=ao.Section.rectangle(0.02, 0.01))
    ends = ao.Support(lambda x: np.isclose(np.abs(x[0] - 0.15), 0.15), ("x", "y"))
    return ao.Structure(mesh, material, [ends]), ao.Site((0.12, 0.0), (0, -1))


def hub(radius):
    """A hub of 80 x 30 mm, held in its bore of 30 mm."""
    point = (0.0275, 0.0, 0.03)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hub.geo"
        path.write_text(HUB)
        mesh = ao.read_mesh(path, size=6e-3, refine=[(point, 1.5e-3)])
    bore = ao.Support(lambda x: np.hypot(x[0], x[1]) < 0.0155)
    site = ao.Site(point, (0, 0, -1), radius=radius, snap=True)
    return ao.Structure(mesh, ao.Solid(**STEEL), [bore]), site


HUB = """SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, 0, 0, 0, 0.03, 0.04};
Cylinder(2) = {0, 0, -0.01, 0, 0, 0.05, 0.015};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
"""
#: a part, and the stiffness of Hertz' law [N/m^1.5]
PARTS = {
    "block": (block, 1e10),
    "hub, patch of 6 mm": (partial(hub, 6e-3), 1e10),
    "hub, patch of 3 mm": (partial(hub, 3e-3), 1e10),
    "lever": (lever, 1e10),
    "bracket": (partial(bracket, 2e-3), 1e10),
    "bracket, patch of 4.5 mm": (partial(bracket, 4.5e-3), 1e10),
    "bracket, patch of 4.5 mm, 4e8": (partial(bracket, 4.5e-3), 4e8),
    "clamped plate": (plate, 1e10),
    "beam": (beam, 1e10),
}


def cpu(call, *arguments, **options):
    """(seconds of this process, what a call gives)."""
    start = time.process_time()
    found = call(*arguments, **options)
    return time.process_time() - start, found


def widths(name):
    """Rows (n, width in %) of a part, of the first n vectors of one model; prints costs, too."""
    make, stiffness = PARTS[name]
    part, site = make()
    blow = ao.RigidMass(0.0327, 0.5), ao.Hertz(stiffness)
    first = ao.simulate(ao.extract(part, site, n=60), *blow, "auto")
    contact = first.contact_time
    omega = first.model.free_modes.omega
    lowest = contact * omega[omega > 0][0] / (2 * np.pi)
    print(f"{name}: {part.dofs} dofs, {first.peak_force:.5g} N, {contact:.3g} s, f1 T {lowest:.2g}")

    plain, _ = cpu(ao.extract, *make(), n=20, expansion=PERIODS_IN_CONTACT / contact)
    whole, model = cpu(ao.extract, *make(), n=20, proof=contact)
    run = partial(ao.simulate, model, *blow, 1.3 * contact, tol=PROOF_TOL)
    hit = run()
    least = min(cpu(run)[0] for _ in range(5))
    march = min(cpu(enclosures, hit.assembly, hit.run)[0] for _ in range(5))
    print(f"  n 20: march {march / least:.2f}, extraction {whole / plain:.3f}")

    model = ao.extract(part, site, n=max(NUMBERS), proof=contact)
    rows = []
    for n in NUMBERS:
        known = model.recurrence
        if known is None or n > known.n:
            break
        fewer = replace(model, recurrence=replace(known, n=n))
        bounds = ao.simulate(fewer, *blow, 1.3 * contact, proof=True).enclosure
        width = (bounds.peak[1] - bounds.peak[0]) / first.peak_force
        rows.append((n, 100 * width))
        print("  n {}: {:.3g} %".format(*rows[-1]), flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--picture", type=Path, default=ROOT / "docs/pictures/proof.png")
    picture = parser.parse_args().picture
    warnings.simplefilter("ignore")

    figure, axes = plotting.panels(1, 1, size=(5.4, 3.4))
    ax = axes[0, 0]
    for name in PARTS:
        n, width = np.array(widths(name)).T
        known = np.isfinite(width) & (width < 1000)
        ax.semilogy(n[known], width[known], ".-", label=name)
    ax.set(xlabel="Krylov vectors", ylabel="width of the peak's bounds (%)")
    ax.legend()
    plotting.save_figure(figure, picture, dpi=150)


if __name__ == "__main__":
    main()
