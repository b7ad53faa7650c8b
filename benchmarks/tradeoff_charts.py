"""Speed against accuracy of four parts by `tradeoff`: a solid, a plate, a beam, a plane part.

Seconds are those of the processor, on one thread, for assembly, factor, extraction with error
estimates, and runs; the time of meshing is left out. The unreduced model, and CalculiX where it is
installed, stand beside them if each is forecast to take at most `compare` seconds.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/tradeoff_charts.py
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gmsh
import options

import antiosc as ao
from antiosc import plotting

ROOT = Path(__file__).resolve().parent
MESHES = ROOT.parent / "meshes"
sys.path.insert(0, str(MESHES))
import make_lever  # noqa: E402
import make_plate  # noqa: E402

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
COARSE = 4.0  # of the cells of a first mesh
BALL = {"radius": 0.01, "material": "bearing steel 100Cr6", "velocity": 1.0}


def main(
    picture: Path = ROOT / "pictures/tradeoff.png", tol: float = 0.02, compare: float = 300.0
) -> None:
    """Draw the four charts and print the tables.

    Parameters
    ----------
    picture : file to draw
    tol : relative error that is asked for
    compare : seconds that each other method may take
    """
    time.perf_counter = time.process_time
    figure, axes = plotting.panels(2, 2, size=(9, 6.4))
    for ax, (name, case) in zip(axes.flat, CASES.items(), strict=True):
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = ao.tradeoff(**case(Path(folder)), tol=tol, compare=compare)
        print(name, found.summary(), found.message, sep="\n", flush=True)
        found.draw(ax)
        last = found.table[-1]
        ax.set_title(f"{name}, up to {last.dofs} dofs")
    for ax in axes[:, 1]:
        ax.set_ylabel("")
    for ax in axes[0]:
        ax.set_xlabel("")
    axes[0, 0].legend(fontsize="small")
    plotting.save_figure(figure, picture, dpi=200)


def bracket(_folder: Path) -> dict[str, Any]:
    """A bracket of aluminium, bolted down, struck on its eye."""
    return {
        "source": MESHES / "bracket.geo",
        "material": ao.material("aluminium 6061-T6"),
        "supports": [ao.Support("clamp")],
        "site": ao.Site(
            point=(0.020, 0.040, 0.075), direction=(-0.2, -0.6, -0.8), radius=2e-3, snap=True
        ),
        "impactor": ao.Sphere(**BALL),
        "duration": 3e-4,
    }


def plate(folder: Path) -> dict[str, Any]:
    """A perforated sheet of steel, held on its edges, struck across."""
    return {
        "source": ao.read_mesh(_made(make_plate.model, folder / "plate.msh"), gdim=3),
        "material": ao.Shell(**STEEL, thickness=4e-3),
        "supports": [ao.Support("edges")],
        "site": ao.Site(point=(0.16, 0.09, 0.0), direction=(0, 0, -1), radius=4e-3),
        "impactor": ao.Sphere(**BALL),
        "duration": 1e-3,
    }


def beam(_folder: Path) -> dict[str, Any]:
    """A beam that is clamped at both ends, struck off its middle."""
    section = ao.Section.circle(0.016)
    return {
        "source": options.line((0, 0, 0), (1, 0, 0), 10),
        "material": ao.Beam(**STEEL, section=section),
        "supports": [ao.Support(lambda x: (x[0] < 1e-6) | (x[0] > 1 - 1e-6))],
        "site": ao.Site(point=(0.4, 0, 0), direction=(0, 0, -1)),
        "impactor": ao.Sphere(**BALL),
        "contact": ao.Hertz(1.5e10),
        "duration": 2e-3,
    }


def lever(folder: Path) -> dict[str, Any]:
    """A lever of sheet steel in its plane, struck on its nose."""
    return {
        "source": _made(make_lever.model, folder / "lever.geo_unrolled").rename(
            folder / "lever.geo"
        ),
        "material": ao.Solid(**STEEL, plane="stress", thickness=8e-3),
        "supports": [ao.Support("clamp")],
        "site": ao.Site(point=(0.135, 0.0), direction=(-0.3, -1.0), radius=4e-3, snap=True),
        "impactor": ao.RigidMass(mass=0.1, velocity=1.0),
        "contact": ao.Hertz(1e10),
        "duration": 5e-4,
    }


def _made(model: Callable[[], None], path: Path) -> Path:
    """A model of gmsh in a file: its geometry, or a mesh of straight triangles."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 2)
        model()
        if path.suffix == ".msh":
            gmsh.option.setNumber("Mesh.MeshSizeFactor", COARSE)
            gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


CASES = {"bracket": bracket, "plate": plate, "beam": beam, "lever": lever}


if __name__ == "__main__":
    options.command(main)
