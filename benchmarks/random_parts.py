"""Random solid parts and impacts, as `benchmarks/error_budget.py` tries them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Case:
    """One random part and impact, and what was found.

    `worst_ratio` is the true error over its bar, `answer_ratio` the same of the corrected model, as
    `strike` answers; `speed` the contact time over the longest period of the part with its site
    held, `reference` the errors of strains of the reference over those of the part. `strike_true`
    and `strike_promised` are the errors of `strike` from the geometry with a tolerance of 1 %;
    `strike_ratio` and `strike_meshes` the true error over its bar and the number of meshes with a
    finer tolerance.
    """

    number: int
    dim: int
    order: int
    holes: int
    notch: bool
    held: bool
    resolved: bool
    mass: float
    size: float
    radius: float
    dofs: int = 0
    energy_error: float = 0.0
    k0: float = 0.0
    force: float = 0.0
    holds: bool = False
    worst_ratio: float = 0.0
    corrected: float = 0.0
    speed: float = 0.0
    reference: float = 0.0
    answer_ratio: float = 0.0
    strike_true: float = 0.0
    strike_promised: float = 0.0
    strike_met: bool = False
    strike_ratio: float = 0.0
    strike_meshes: int = 0
    refused: str = ""

    @property
    def kinds(self) -> list[str]:
        """Classes of the case."""
        return [
            "all",
            f"{self.dim}-D",
            f"{self.dim}-D, order {self.order}",
            *([f"{self.dim}-D, patch resolved"] if self.resolved else []),
            *([f"order {self.order}, patch resolved"] if self.resolved else []),
            "patch resolved" if self.resolved else "patch not resolved",
            "holes" if self.holes else "no holes",
            *(["holes, flat faces"] if self.holes and self.order == 1 else []),
            *(["notch"] if self.notch else []),
            "held" if self.held else "free",
            "contact shorter than the period" if self.speed < 1 else "contact longer",
            *(["energy error above 0.1"] if self.energy_error > 0.1 else []),
        ]


def drawn(number: int, rng: np.random.Generator, dim: int) -> Case:
    """A random case."""
    order = int(rng.integers(1, 3))
    size = 0.02 * rng.uniform(0.6, 1.5)
    resolved = bool(rng.random() < 0.8)
    return Case(
        number=number,
        dim=dim,
        order=order,
        holes=int(rng.integers(0, 3)),
        notch=bool(rng.random() < 0.3),
        held=bool(rng.random() < 0.7),
        resolved=resolved,
        mass=float(10 ** rng.uniform(-2, 0.5)),
        size=float(size),
        radius=float(size * (rng.uniform(0.3, 0.8) if resolved else rng.uniform(0.2, 0.4))),
    )


def geometry(
    case: Case, rng: np.random.Generator, length: float, width: float, depth: float
) -> str:
    """A gmsh script: a plate or a block with holes and a notch."""
    plane = case.dim == 2
    lines = ['SetFactory("OpenCASCADE");']
    if plane:
        lines.append(f"Rectangle(1) = {{0, 0, 0, {length}, {width}}};")
    else:
        lines.append(f"Box(1) = {{0, 0, 0, {length}, {width}, {depth}}};")
    kind = "Surface" if plane else "Volume"
    cuts = []
    for k in range(case.holes):
        r = width * rng.uniform(0.08, 0.15)
        x, y = length * (0.25 + 0.22 * k), width * rng.uniform(0.3, 0.45)
        cuts.append(10 + k)
        if plane:
            lines.append(f"Disk({10 + k}) = {{{x}, {y}, 0, {r}}};")
        else:
            lines.append(f"Cylinder({10 + k}) = {{{x}, {y}, -1, 0, 0, 3, {r}}};")
    if case.notch:
        x, w, h = length * 0.4, width * 0.08, width * rng.uniform(0.1, 0.2)
        cuts.append(20)
        if plane:
            lines.append(f"Rectangle(20) = {{{x}, -1, 0, {w}, {1 + h}}};")
        else:
            lines.append(f"Box(20) = {{{x}, -1, -1, {w}, {1 + h}, 3}};")
    if cuts:
        tags = ", ".join(map(str, cuts))
        lines.append(f"BooleanDifference{{{kind}{{1}}; Delete;}}{{{kind}{{{tags}}}; Delete;}}")
    return "\n".join(lines) + "\n"
