"""The impacts of `benchmarks/strike_or_uniform.py`, each from its geometry."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import antiosc as ao

BRACKET = Path(__file__).parent.parent / "meshes" / "bracket.geo"
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
OPEN_CASCADE = 'SetFactory("OpenCASCADE");\n'


@dataclass(frozen=True)
class Scene:
    """A part and an impact.

    Attributes
    ----------
    geometry : a file, or the text of a gmsh script.
    size : of the elements of a uniform mesh that is neither coarse nor fine, m.
    """

    geometry: Path | str
    material: ao.Solid
    held: ao.Support
    site: ao.Site
    impact: tuple[Any, ...]
    duration: float
    size: float
    options: dict[str, float] = field(default_factory=dict)

    def path(self, folder: Path) -> Path:
        """The geometry as a file."""
        if isinstance(self.geometry, Path):
            return self.geometry
        path = folder / "part.geo"
        path.write_text(OPEN_CASCADE + self.geometry)
        return path

    def struck(self, model: ao.AntiOscillators, tol: float = 1e-5) -> ao.History:
        """The impact on a model."""
        return ao.simulate(model, *self.impact, self.duration, tol=tol)

    def structure(self, mesh: ao.Mesh, order: int = 2) -> ao.Structure:
        """The part on a mesh."""
        return ao.Structure(mesh, self.material, [self.held], order=order)


def sphere(radius: float, velocity: float, part: dict[str, float], **more: Any) -> tuple[Any, ...]:
    """A steel sphere on a part of this material."""
    striker = ao.Sphere(radius=radius, **STEEL, velocity=velocity)
    return striker, striker.hertz(part["E"], part["nu"], **more)


def _scenes() -> dict[str, Scene]:
    light = sphere(0.010, 2.0, ALUMINIUM, radii=(0.018, float("inf")))
    on_bracket = ao.Site((0.020, 0.040, 0.075), (-0.2, -0.6, -0.8), radius=2e-3, snap=True)
    bracket = BRACKET, ao.Solid(**ALUMINIUM), ao.Support("clamp"), on_bracket
    left = ao.Support(plane=((0, 0, 0), (1, 0, 0)))
    steel = ao.Solid(**STEEL)
    plane = ao.Solid(**STEEL, plane="stress", thickness=0.01)
    plate = "Box(1) = {0, 0, 0, 0.12, 0.08, 0.006};"
    holed = (
        "Rectangle(1) = {0, 0, 0, 0.3, 0.1}; Disk(2) = {0.12, 0.05, 0, 0.02};"
        "BooleanDifference(3) = {Surface{1}; Delete;}{Surface{2}; Delete;};"
    )
    panel = (
        "Box(1) = {0, 0, 0, 0.12, 0.09, 0.004}; Box(2) = {0, 0.027, -0.012, 0.12, 0.004, 0.012};"
        "Box(3) = {0, 0.059, -0.012, 0.12, 0.004, 0.012};"
        "BooleanUnion(4) = {Volume{1}; Delete;}{Volume{2, 3}; Delete;};"
    )
    block = "Box(1) = {0, 0, 0, 0.06, 0.06, 0.04};"
    short = ao.RigidMass(0.02, 1.0), ao.Hertz(2e10)
    return {
        "bracket, light sphere": Scene(*bracket, light, 1e-3, 0.008),
        "bracket, heavy mass": Scene(*bracket, (ao.RigidMass(0.5, 0.5), light[1]), 6e-3, 0.008),
        "plate": Scene(
            plate, steel, left, ao.Site((0.08, 0.045, 0.006), (0, 0, -1), radius=2.5e-3),
            sphere(0.010, 1.0, STEEL), 1e-3, 0.006,
        ),
        "plane part": Scene(
            holed, plane, left, ao.Site((0.25, 0.1), (0, -1), radius=0.012),
            (ao.RigidMass(0.5, 1.0), ao.Hertz(1e10)), 1e-3, 0.012,
        ),
        "stiffened panel": Scene(
            panel, steel, left, ao.Site((0.07, 0.045, 0.004), (0, 0, -1), radius=1.8e-3),
            sphere(0.008, 1.0, STEEL), 1e-3, 0.006,
        ),
        "block, short blow": Scene(
            block, steel, ao.Support(plane=((0, 0, 0), (0, 0, 1))),
            ao.Site((0.032, 0.028, 0.04), (0, 0, -1), radius=3e-3), short, 3e-4, 0.008,
        ),
    }  # fmt: skip


SCENES = _scenes()
