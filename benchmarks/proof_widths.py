"""Widths of proved bounds by the number of Krylov vectors, and what they cost: a picture and rows.

    python benchmarks/proof_widths.py [--picture docs/pictures/proof.png]

Parts under a ball of 33 g at 0.5 m/s, Hertz' law of 1e10 N/m^1.5, and a bracket under softer ones.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao
from antiosc import plotting
from antiosc.impact.enclosure import enclosures
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


def bracket():
    point = (0.020, 0.040, 0.075)
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=6e-3, refine=[(point, 2e-3)])
    part = ao.Structure(mesh, ao.Solid(70e9, 0.33, 2700.0), [ao.Support("clamp")])
    return part, ao.Site(point, (-0.2, -0.6, -0.8), radius=2e-3, snap=True)


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


def ring():
    """A hub of 80 x 30 mm, held in its bore of 30 mm."""
    point = (0.0275, 0.0, 0.03)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ring.geo"
        path.write_text(RING)
        mesh = ao.read_mesh(path, size=6e-3, refine=[(point, 1.5e-3)])
    bore = ao.Support(lambda x: np.hypot(x[0], x[1]) < 0.0155)
    return ao.Structure(mesh, ao.Solid(**STEEL), [bore]), ao.Site(
        point, (0, 0, -1), radius=3e-3, snap=True
    )


RING = """SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, 0, 0, 0, 0.03, 0.04};
Cylinder(2) = {0, 0, -0.01, 0, 0, 0.05, 0.015};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
"""
#: a part, and the stiffness of Hertz' law [N/m^1.5]
PARTS = {
    "block": (block, 1e10),
    "ring": (ring, 1e10),
    "lever": (lever, 1e10),
    "bracket": (bracket, 1e10),
    "bracket, 4e8": (bracket, 4e8),
    "bracket, 2.5e7": (bracket, 2.5e7),
    "clamped plate": (plate, 1e10),
    "beam": (beam, 1e10),
}


def cpu(call, *arguments, **options):
    """(seconds of this process, what a call gives)."""
    start = time.process_time()
    found = call(*arguments, **options)
    return time.process_time() - start, found


def widths(name):
    """Rows (n, width, cost over the run's, cost of the extraction over the same) of a part."""
    make, stiffness = PARTS[name]
    part, site = make()
    blow = ao.RigidMass(0.0327, 0.5), ao.Hertz(stiffness)
    first = ao.simulate(ao.extract(part, site, n=60), *blow, "auto")
    contact = first.contact_time
    omega = first.model.free_modes.omega
    lowest = contact * omega[omega > 0][0] / (2 * np.pi)
    print(f"{name}: {part.dofs} dofs, {first.peak_force:.5g} N, {contact:.3g} s, f1 T {lowest:.2g}")
    rows = []
    for n in NUMBERS:
        plain, _ = cpu(ao.extract, part, site, n=n, expansion=PERIODS_IN_CONTACT / contact)
        whole, model = cpu(ao.extract, part, site, n=n, proof=contact)
        hit = ao.simulate(model, *blow, 1.3 * contact)
        if model.recurrence is None:
            print(f"  n {n}: no recurrence")
            continue
        least = min(cpu(ao.simulate, model, *blow, 1.3 * contact)[0] for _ in range(5))
        march = min(cpu(enclosures, hit.assembly, hit.run)[0] for _ in range(5))
        (bounds,) = enclosures(hit.assembly, hit.run)
        width = (bounds.peak[1] - bounds.peak[0]) / first.peak_force
        rows.append((n, 100 * width, march / least, whole / plain))
        print("  n {}: {:.3g} %, march {:.2f}, extraction {:.3f}".format(*rows[-1]), flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--picture", type=Path, default=ROOT / "docs/pictures/proof.png")
    picture = parser.parse_args().picture
    warnings.simplefilter("ignore")

    figure, axes = plotting.panels(1, 1, size=(5.4, 3.4))
    ax = axes[0, 0]
    for name in PARTS:
        n, width, *_ = np.array(widths(name)).T
        known = np.isfinite(width) & (width < 1000)
        ax.semilogy(n[known], width[known], ".-", label=name)
    ax.set(xlabel="Krylov vectors", ylabel="width of the peak's bounds (%)")
    ax.legend()
    plotting.save_figure(figure, picture, dpi=150)


if __name__ == "__main__":
    main()
