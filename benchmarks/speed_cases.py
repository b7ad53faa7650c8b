"""The structures and impacts of `speed_accuracy.py`."""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Callable
from math import cos, pi, radians, sin
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao
from antiosc.models.free_modes import stiffness_error

ROOT = Path(__file__).resolve().parent.parent
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}

REFERENCE = 120  # Krylov anti-oscillators of the reference


class Case:
    """A structure, its impact, the reference, and the band in which Z is compared."""

    def __init__(self, name: str, size: float | None = None) -> None:
        self.name = name
        started = time.perf_counter()
        mesh, material, supports, site, self.impact = CASES[name](size)
        self.seconds = {"mesh": time.perf_counter() - started}
        started = time.process_time()
        self.part = ao.Structure(mesh, material, supports)
        self.site = site
        self.part.factorize()
        #: CPU seconds of assembly and factorization; `before`: those of the clock
        self.worked_before = time.process_time() - started
        self.seconds |= self.part.seconds
        self.memory_factored = memory()
        self.before = self.seconds["assembly"] + self.seconds["factorization"]

    def prepare(self) -> None:
        """The reference: many Krylov anti-oscillators, and the impact on them, well converged."""
        n = min(REFERENCE, self.part.dofs // 3)
        self.reference = ao.extract(self.part, self.site, n=n, shapes=False)
        self.hit = ao.simulate(self.reference, *self.impact, tol=1e-6)
        # up to the first zero in the spectrum of a half-sine of the contact's length
        self.band = 3 * pi / self.hit.contact_time
        self.time = np.linspace(0, self.impact[2], 4001)
        self.force = np.interp(self.time, self.hit.time, self.hit.force)

    def error_of_z(self, model: Any) -> float:
        """Largest |dZ|/|Z| over the band."""
        body = model.modal()

        def Z(omega: Any) -> Any:
            return 1 / body.receptance(omega)

        if isinstance(model, ao.AntiOscillators):
            Z = model.dynamic_stiffness
        first = float(self.reference.omega[0])
        return stiffness_error(Z, self.reference.dynamic_stiffness, self.band, first)

    def error_of_force(self, time_: Any, force: Any) -> float:
        """Relative error of the force history in the L2 norm."""
        off = np.interp(self.time, time_, force) - self.force
        return float(np.linalg.norm(off) / np.linalg.norm(self.force))


def beam(_: float | None) -> tuple[Any, ...]:
    """The article's case 2 at 1 m/s: a mass of half the beam's at mid-span."""
    mesh = ao.read_mesh(ROOT / "meshes/beam.msh", gdim=2)
    section = ao.Section.rectangle(2e-4**0.5, 2e-4**0.5)
    material = ao.Beam(E=67e9, nu=0.3, rho=2400, section=section)
    pins = [ao.Support(end, ("x", "y")) for end in ("left", "right")]
    impact = ao.RigidMass(mass=0.24, velocity=1.0), ao.Hertz(1.55e10), 4e-3
    return mesh, material, pins, ao.Site(point=(0.5, 0.0), direction=(0, -1)), impact


def plate(_: float | None) -> tuple[Any, ...]:
    """A steel sphere of 20 mm on a clamped steel plate of 200 x 200 x 8 mm, off its centre."""
    kind = dolfinx.mesh.CellType.quadrilateral
    corners = [np.zeros(2), np.full(2, 0.2)]
    mesh = ao.read_mesh(dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [32, 32], kind))
    edge = ao.Support(lambda x: np.isclose(np.abs(x[:2] - 0.1).max(axis=0), 0.1))
    site = ao.Site(point=(0.083, 0.117, 0.0), direction=(0, 0, -1))
    ball = ao.Sphere(radius=0.01, **STEEL, velocity=1.0)
    impact = ball, ball.hertz(STEEL["E"], STEEL["nu"]), 4e-4
    return mesh, ao.Shell(**STEEL, thickness=8e-3), [edge], site, impact


def bracket(size: float | None) -> tuple[Any, ...]:
    """A steel sphere of 20 mm on the eye of the bracket, obliquely."""
    angle = radians(35)
    point = (19.3e-3, 30e-3 + 18e-3 * sin(angle), 60e-3 + 18e-3 * cos(angle))
    where = ROOT / "meshes/bracket.geo"
    mesh = ao.read_mesh(where, size=size, refine=[(point, 2e-3)])
    site = ao.Site(point=point, direction=(-0.25, -sin(angle), -cos(angle)), radius=2e-3, snap=True)
    ball = ao.Sphere(radius=10e-3, **STEEL, velocity=2.0)
    law = ball.hertz(ALUMINIUM["E"], ALUMINIUM["nu"], radii=(18e-3, float("inf")))
    return mesh, ao.Solid(**ALUMINIUM), [ao.Support("clamp")], site, (ball, law, 4e-4)


def heavy(size: float | None) -> tuple[Any, ...]:
    """A mass of 10 kg falls on the bracket at 0.3 m/s: a contact of milliseconds that rings."""
    *part, (_, law, _) = bracket(size)
    return *part, (ao.RigidMass(mass=10.0, velocity=0.3), law, 8e-3)


def panel(size: float | None) -> tuple[Any, ...]:
    """A steel sphere of 30 mm on the stiffened panel, skin and blades as shells."""
    sys.path.insert(0, str(ROOT / "meshes"))
    import make_panel
    import stiffened_panel as demo

    with tempfile.TemporaryDirectory() as folder:
        make_panel.main(Path(folder), size or make_panel.SIZE)
        mesh = ao.read_mesh(Path(folder) / "panel.msh")
    skin, blade = (ao.Shell(**ALUMINIUM, thickness=t) for t in (2e-3, 3e-3))
    site = ao.Site(demo.surface(0.45, 5.0), demo.inward(5.0), snap=True)
    ball = ao.Sphere(radius=15e-3, **STEEL, velocity=2.0)
    law = ball.hertz(ALUMINIUM["E"], ALUMINIUM["nu"])
    materials = {"skin": skin, "stringers": blade, "frames": blade}
    return mesh, materials, [ao.Support("ends")], site, (ball, law, 4e-3)


CASES: dict[str, Callable[[float | None], tuple[Any, ...]]] = {
    "beam": beam,
    "plate": plate,
    "bracket": bracket,
    "bracket, heavy mass": heavy,
    "panel": panel,
}


def memory() -> float:
    """Peak memory of this process, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
