"""Models of nearby structures: how close to extractions, and for how many of them.

Of four parts materials and thicknesses vary; random members of each family are compared with their
own extractions: static stiffness, lowest antiresonances and the peak force of a first touch.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/nearby_models.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import antiosc as ao

MESHES = Path(__file__).resolve().parent.parent / "meshes"
SEED, LOWEST = 1, 4
#: Range of a parameter about 1, of moduli and of lengths.
SOFT, THIN = (0.9, 1.1), (0.9, 1.1)


def bracket() -> tuple[Callable[..., Any], ao.Site, dict[str, Any]]:
    """Moduli and density of a solid."""
    mesh = ao.read_mesh(MESHES / "bracket.msh", order=1)

    def build(E: float, nu: float, rho: float) -> ao.Structure:
        solid = ao.Solid(E=70e9 * E, nu=nu, rho=2700.0 * rho)
        return ao.Structure(mesh, solid, [ao.Support("clamp")], order=1)

    site = ao.Site((0.020, 0.040, 0.075), (-0.2, -0.6, -0.8), radius=4e-3, snap=True)
    return build, site, {"E": SOFT, "nu": (0.31, 0.35), "rho": SOFT}


def plate() -> tuple[Callable[..., Any], ao.Site, dict[str, Any]]:
    """Modulus and thickness of a sheet."""
    mesh = ao.read_mesh(MESHES / "plate.msh")

    def build(E: float, thickness: float) -> ao.Structure:
        sheet = ao.Shell(E=70e9 * E, nu=0.33, rho=2700.0, thickness=2e-3 * thickness)
        return ao.Structure(mesh, sheet, [ao.Support("edges")])

    return build, inside(mesh, "plate"), {"E": SOFT, "thickness": THIN}


def panel() -> tuple[Callable[..., Any], ao.Site, dict[str, Any]]:
    """Thicknesses of the skin and of the stringers."""
    mesh = ao.read_mesh(MESHES / "panel.msh")

    def build(skin: float, stringers: float) -> ao.Structure:
        thick = {"skin": 1.6e-3 * skin, "stringers": 2e-3 * stringers, "frames": 2e-3}
        sheets = {
            name: ao.Shell(E=70e9, nu=0.33, rho=2700.0, thickness=t) for name, t in thick.items()
        }
        return ao.Structure(mesh, sheets, [ao.Support("ends")])

    return build, inside(mesh, "skin"), {"skin": THIN, "stringers": THIN}


def frame() -> tuple[Callable[..., Any], ao.Site, dict[str, Any]]:
    """Widths of the tubes."""
    mesh = ao.read_mesh(MESHES / "frame.msh")

    def build(columns: float, beams: float) -> ao.Structure:
        widths = {"columns": 0.04 * columns, "beams": 0.03 * beams, "braces": 0.02}
        tubes = {
            name: ao.Beam(E=210e9, nu=0.3, rho=7850.0, section=ao.Section.tube(width, 3e-3))
            for name, width in widths.items()
        }
        return ao.Structure(mesh, tubes, [ao.Support("feet")])

    return build, inside(mesh, "beams"), {"columns": THIN, "beams": THIN}


def inside(mesh: Any, group: str) -> ao.Site:
    """A point of a group, off its middle, struck from above."""
    geometry, dim = mesh.dolfinx.geometry, mesh.tdim
    cells = np.asarray(mesh.group(group)[dim])
    links = mesh.dolfinx.geometry.dofmap
    rows = [links.links(c) if hasattr(links, "links") else links[c] for c in cells]
    corners = np.array([geometry.x[row].mean(axis=0) for row in rows])
    place = corners.mean(axis=0) + 0.2 * np.ptp(corners, axis=0)
    at = corners[np.argmin(np.linalg.norm(corners - place, axis=1))]
    return ao.Site(tuple(at.tolist()), (0, 0, -1), radius=5e-3 if dim == 2 else None, snap=True)


FAMILIES = {"bracket": bracket, "plate": plate, "panel": panel, "frame": frame}


def main(parts: tuple[str, ...] = tuple(FAMILIES), members: int = 3, n: int = 20) -> list[Any]:
    """Rows (part, dofs, extractions, assemblies, error, worst differences, ms), printed."""
    rows = []
    print("part       dofs extr. assem.   error      k0   omega    peak     ms   extraction")
    for name in parts:
        build, site, ranges = FAMILIES[name]()
        models = ao.nearby(build, site, ranges, n)
        rng = np.random.default_rng(SEED)
        off, spent, whole = np.zeros(3), 0.0, 0.0
        for _ in range(members):
            given = {key: rng.uniform(*limits) for key, limits in ranges.items()}
            began = time.process_time()
            found = models(**given)
            spent += time.process_time() - began
            began = time.process_time()
            structure = build(**given)
            true = ao.extract(structure, site, n)
            whole += time.process_time() - began
            k = LOWEST
            off = np.maximum(
                off,
                [
                    abs(found.k0 / true.k0 - 1),
                    np.max(np.abs(nearest(found.omega, true.omega[:k]) / true.omega[:k] - 1)),
                    abs(peak(found) / peak(true) - 1),
                ],
            )
        made = (models.extractions, models.assemblies, models.error)
        seconds = (1e3 * spent / members, 1e3 * whole / members)
        rows.append((name, structure.dofs, *made, *off, *seconds))
        print(
            f"{name:<8} {structure.dofs:6} {made[0]:5} {made[1]:6} {made[2]:7.1e} "
            + " ".join(f"{x:7.1e}" for x in off)
            + f" {seconds[0]:6.1f} {seconds[1]:9.0f} ms"
        )
    return rows


def nearest(omega: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The frequencies that are nearest to those wanted: a mode without mass may be one more."""
    return omega[np.argmin(np.abs(omega[:, None] - wanted), axis=0)]


def peak(model: ao.AntiOscillators) -> float:
    """The peak force of the first touch of a small hard mass."""
    hit = ao.simulate(model, ao.RigidMass(0.01, 1.0), ao.Hertz(1e9), 2e-4, tol=1e-5)
    return hit.peak_force


if __name__ == "__main__":
    main()
