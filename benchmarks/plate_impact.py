"""A nylon sphere strikes a supported aluminium plate: how large must a plate be to seem infinite?

First at the centre and off it, on one plate: force, deflection, restitution. Then on ever larger
square plates: the sphere loses what it leaves behind as bending waves, and gets part of it back
when they return from the edges within the contact time. Beyond a size the restitution is Zener's,
who solved the infinite plate. Lengths are counted in the wave's own measure, the distance
(D/ρh)^(1/4) √T that bending waves of one period T, the contact time, need for their spread.

    .venv/bin/python benchmarks/plate_impact.py --help
"""

from __future__ import annotations

from math import sqrt
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI
from options import command
from scipy.optimize import brentq

import antiosc as ao
from antiosc import plotting
from antiosc.models.closed_form import zener
from antiosc.models.closed_form.plates import SupportedPlate

ROOT = Path(__file__).resolve().parent.parent
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
NYLON = {"E": 3e9, "nu": 0.4, "rho": 1150.0}
OFF = (0.35, 0.30)  # the second site, in lengths of the side


def main(
    thickness: float = 2e-3,
    velocity: float = 0.1,
    inelasticities: tuple[float, ...] = (0.1, 0.3, 0.5),
    sizes: tuple[float, ...] = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0),
    elements: int = 32,
    n: int = 60,
    out: Path = ROOT / "out",
) -> dict[str, float]:
    """Return the restitution of every scene: "0.3 8" for λ = 0.3 on a plate of size 8.

    Parameters
    ----------
    thickness : of the plate, m
    velocity : of the sphere, m/s
    inelasticities : Zener's λ, each giving the sphere its radius
    sizes : sides of the square plates over (D/ρh)^(1/4) √T
    elements : along a side
    n : anti-oscillators
    out : folder of the pictures
    """
    numbers: dict[str, float] = {}
    curves = {}
    for lam in inelasticities:
        scene = Scene(lam, thickness, velocity)
        found = [scene.strike(size, elements, n, (0.5, 0.5)) for size in sizes]
        curves[lam] = [hit.restitution for hit in found]
        limit = zener.restitution(lam)
        numbers[f"{lam:g} zener"] = limit
        print(
            f"λ = {lam:g}: sphere of radius {1e3 * scene.sphere.radius:.3g} mm, contact time "
            f"{1e6 * scene.time:.4g} µs, plates of {thickness * 1e3:g} mm"
        )
        print("  side/unit   side (mm)   restitution   over Zener's   peak force (N)   contacts")
        for size, hit in zip(sizes, found, strict=True):
            numbers[f"{lam:g} {size:g}"] = hit.restitution
            print(
                f"  {size:8g} {1e3 * size * scene.unit:11.1f} {hit.restitution:12.4f} "
                f"{hit.restitution / limit:13.4f} {hit.peak_force:14.4f} {len(hit.contacts):9d}"
            )
    scene = Scene(inelasticities[-1], thickness, velocity)
    side = min(sizes, key=lambda s: abs(s - 4))
    pair = [scene.strike(side, elements, n, at, 4.0) for at in ((0.5, 0.5), OFF)]
    for name, hit in zip(("centre", "off-centre"), pair, strict=True):
        numbers[name] = hit.restitution
        print(
            f"{name:10s} of the plate of {side:g} units: peak force {hit.peak_force:.4f} N, "
            f"deflection {1e6 * hit.displacement.max():.3f} µm, restitution {hit.restitution:.4f}"
        )
    out.mkdir(parents=True, exist_ok=True)
    plot(scene, pair, sizes, curves, out / "plate_impact.png")
    print(f"written to {out}: plate_impact.png")
    return numbers


class Scene:
    """A sphere whose inelasticity against the plate is λ."""

    def __init__(self, lam: float, thickness: float, velocity: float) -> None:
        self.lam, self.thickness = lam, thickness
        self.plate = SupportedPlate(**ALUMINIUM, thickness=thickness, a=1.0, b=1.0)

        def excess(radius: float) -> float:
            return self._inelasticity(ao.Sphere(radius, **NYLON, velocity=velocity)) - lam

        self.sphere = ao.Sphere(brentq(excess, 1e-5, 5.0), **NYLON, velocity=velocity)
        self.contact = self.sphere.hertz(ALUMINIUM["E"], ALUMINIUM["nu"])
        unit = zener.time_unit(self.sphere.mass, velocity, self.contact.stiffness)
        #: contact time on the infinite plate, s
        self.time = zener.contact_time(lam) * unit
        #: the bending wave's measure of length, m
        self.unit = (self.plate.D / self.plate.surface_density) ** 0.25 * sqrt(self.time)

    def _inelasticity(self, sphere: ao.Sphere) -> float:
        stiffness = sphere.hertz(ALUMINIUM["E"], ALUMINIUM["nu"]).stiffness
        D, density = self.plate.D, self.plate.surface_density
        return zener.inelasticity(sphere.mass, sphere.velocity, stiffness, D, density)

    def strike(
        self, size: float, elements: int, n: int, at: tuple[float, float], times: float = 1.5
    ) -> ao.History:
        """The impact on a plate of side `size` units, at the point `at` in lengths of the side."""
        side = size * self.unit
        mesh = ao.read_mesh(graded_square(side, elements, at))
        edges = ao.Support(lambda x: on_edges(x, side), ("x", "y", "z"))
        part = ao.Structure(mesh, ao.Shell(**ALUMINIUM, thickness=self.thickness), [edges])
        site = ao.Site((at[0] * side, at[1] * side, 0.0), (0, 0, -1))
        model = ao.extract(part, site, n=n)
        return ao.simulate(model, self.sphere, self.contact, duration=times * self.time)


def graded_square(side: float, elements: int, at: tuple[float, float]) -> dolfinx.mesh.Mesh:
    """Squares that become smaller toward the struck point, where the moments vary fastest."""
    kind = dolfinx.mesh.CellType.quadrilateral
    corners = [np.zeros(2), np.ones(2)]
    mesh = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [elements, elements], kind)
    for axis, centre in enumerate(at):
        s = mesh.geometry.x[:, axis]
        half = np.where(s < 0.5, centre, 1 - centre)
        s[:] = side * (centre + np.sign(s - 0.5) * half * np.abs(2 * s - 1) ** 1.3)
    return mesh


def on_edges(x: np.ndarray, side: float) -> np.ndarray:
    """Whether points x (3, n) lie on the edges of the square."""
    near = np.isclose(x[:2], 0, atol=1e-6 * side) | np.isclose(x[:2], side)
    return np.asarray(near.any(axis=0))


def plot(
    scene: Scene,
    pair: list[ao.History],
    sizes: tuple[float, ...],
    curves: dict[float, list[float]],
    path: Path,
) -> None:
    """Force and deflection at two sites; restitution against size."""
    figure, axes = plotting.panels(1, 3, size=(9.5, 3.6))
    force, motion, limit = axes[0]
    named = dict(zip(("centre", "off-centre"), pair, strict=True))
    plotting.plot_force(named, force)
    plotting.plot_motion(named, motion)
    for colour, (lam, restitution) in enumerate(curves.items()):
        limit.plot(sizes, restitution, "o-", color=f"C{colour}", label=f"λ = {lam:g}")
        limit.axhline(zener.restitution(lam), color=f"C{colour}", linestyle=":")
    limit.set(xlabel="side of the plate / (D/ρh)$^{1/4}$√T", ylabel="restitution", ylim=(0, 1))
    limit.legend(title="dotted: Zener")
    figure.suptitle(
        f"A nylon sphere of radius {1e3 * scene.sphere.radius:.3g} mm strikes a supported\n"
        f"aluminium plate of {1e3 * scene.thickness:g} mm (left and middle: λ = {scene.lam:g})"
    )
    plotting.save_figure(figure, path, dpi=120)


if __name__ == "__main__":
    command(main)
