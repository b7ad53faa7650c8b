"""`design_map`: where on a part material helps, the derivative of a result cell by cell.

A cell's share in V'(dK/dp)V is an energy of its own. The derivatives by K_red are a quadratic form
of the shapes; in its principal shapes, those with the largest shares first, few energies do.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import Brief
from antiosc.fem.elements.weak_form import WeakForm, measure
from antiosc.fem.platform import compat
from antiosc.fem.site.sites import located
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.results.fields import checked_shapes
from antiosc.studies.gradients.goals import Sampled
from antiosc.studies.gradients.gradient import derived, model_name, part_chain, shown_goal
from antiosc.studies.gradients.of_part import CHANGE, SAME_PART, Chain, site_of, values_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Units of what a map is by.
BY = {"thickness": "m", "E": "Pa", "rho": "kg/m³"}
#: Degree of the quadrature of energies in cells: that of the strains of cubics, with which
#: those of their motions are off by some 1e-4.
DEGREE = 4
#: Share of the principal shapes that are left out, of the sum of all: shares of either sign cancel.
LEFT_OUT = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class DesignMap(Brief):
    """What `design_map` returns.

    Attributes
    ----------
    goal : the result; value : of the run; by : the parameter.
    slopes : (cells of this rank,) derivative by the parameter of each cell alone; NaN for cells
        whose material does not have it.
    per_mass : (cells of this rank,) what one kilogram more changes, there [unit of the goal/kg]; by
        E: what the double modulus of one kilogram changes.
    meshed : the mesh of the part, and what is on it.
    """

    goal: str
    value: float
    by: str
    slopes: Array
    per_mass: Array
    meshed: MeshedStructure

    def _facts(self) -> list[tuple[str, str]]:
        lowers = float(np.mean(self.slopes < 0))
        return [
            (self.goal, f"{self.value:.6g}"),
            (f"d/d {self.by}", f"{np.nansum(self.slopes):.6g} of all {self.slopes.size} cells"),
            ("cells where more lowers it", f"{lowers:.0%}"),
        ]

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """`per_mass` on the part; all ranks call it.

        With `path` (PNG, PDF, SVG, …) the picture is written, and the path returned. Blue: more
        material lowers the goal, red: it raises it.
        """
        from antiosc.base.surfaces import draw_design

        faces, gather = self.meshed.faces, self.meshed.comm.allgather
        corners = np.concatenate(gather(faces.corners))
        value = np.concatenate(gather(self.per_mass[faces.cells]))
        return draw_design(corners, value, f"d {self.goal} / kg of {self.by}", path)


def design_map(
    part: Structure,
    hit: Any,
    goal: str | Callable[[Sampled], float],
    by: str = "thickness",
    *,
    contact: tuple[str, str] | None = None,
    time: float | None = None,
) -> DesignMap:
    """Where material helps: the derivative of a result by the thickness of every cell.

    By E the compliance of the contact's patch belongs to the cells under the patch.

    Parameters
    ----------
    part : Structure
        Of one mesh, from which the model of the run was extracted.
    hit, goal, contact, time
        As of `gradient`.
    by : "thickness", "E" or "rho"
        Of the cells' materials; stiffeners of a sheet are left out.

    Raises
    ------
    InputError
        For a part that is not that of the run, or whose materials do not have `by`; and what
        `gradient` refuses.
    NotDifferentiableError
        As of `gradient`.
    """
    checks.choice("by", by, tuple(BY))
    checks.instance("part", part, Structure, "a Structure")
    meshed = on_mesh(part)
    found, wanted, slopes = derived(hit, goal, contact, time)
    name = model_name(found)
    checked_shapes(part, hit, name, SAME_PART)
    to = part_chain(found, wanted, slopes, name)
    upper, lower = (_form(part, meshed, by, s) for s in (1, -1))
    total = np.zeros(compat.cell_map(meshed.mesh.dolfinx).size_local)
    for name, by_reduced, reduced in zip(("stiffness", "mass"), to.by, to.reduced, strict=True):
        if by == {"stiffness": "rho", "mass": "E"}[name]:
            continue
        shares, turn = _principal(by_reduced, reduced)
        change = [*getattr(upper, name), *(-1 * form for form in getattr(lower, name))]
        total += compat.quadratic(change, upper.space, turn.T @ to.shapes.T, shares, DEGREE)
    own = [float(values_of(one).get(by, np.nan)) for one, _ in meshed.parts]
    relative = total / (2 * CHANGE)
    if by == "E" and to.by_local:
        relative += _of_patch(meshed, to, total.size)
    size = np.array(own)[meshed.part_of_cells()[: total.size]]
    per_mass = np.where(np.isfinite(size), relative / _masses(meshed), np.nan)
    return DesignMap(shown_goal(goal), wanted.value, by, relative / size, per_mass, meshed)


def _form(part: Structure, meshed: MeshedStructure, by: str, sign: int) -> WeakForm:
    """The weak form of the part with a parameter of all materials changed."""
    assert part.made_of is not None
    changed: list[Any] = []
    for material, cells in meshed.parts:
        value = values_of(material).get(by)
        scaled = (
            material if value is None else replace(material, **{by: value * (1 + sign * CHANGE)})
        )
        changed.append((scaled, cells))
    if all(new is old for (new, _), (old, _) in zip(changed, meshed.parts, strict=True)):
        raise InputError(f"no material of the part has a {by} [{BY[by]}] of its own.")
    form: WeakForm = changed[0][0].weak_form(meshed.mesh, changed, part.made_of[2]["order"])
    return form


def _of_patch(meshed: MeshedStructure, to: Chain, cells: int) -> Array:
    """(cells,) what the compliance of the site's patch, as 1/E, gives to the cells under it."""
    site = site_of(to.model)
    point, along = np.array([site.point]), np.array([site.direction], dtype=float)
    at = located(meshed, point, along / np.linalg.norm(along), np.array([site.radius]))
    assert at.weighted is not None
    own = at.weighted.cell < cells
    shares = np.bincount(at.weighted.cell[own], at.weighted.weight[own], cells)
    return np.asarray(-to.by_local * at.local[0] * shares)


def _principal(by: Array, reduced: Array) -> tuple[Array, Array]:
    """Shares (R,) and shapes (C, R) of unit energy whose energies add up to sum(by * change)."""
    values, vectors = np.linalg.eigh(reduced)
    kept = values > 1e-14 * values[-1]
    root = vectors[:, kept] * np.sqrt(values[kept])
    shares, own = np.linalg.eigh(root.T @ by @ root)
    order = np.argsort(-np.abs(shares))
    left = 1 - np.cumsum(np.abs(shares[order])) / np.abs(shares).sum()
    most = order[: 1 + int(np.argmax(left <= LEFT_OUT))]
    return shares[most], (vectors[:, kept] / np.sqrt(values[kept])) @ own[:, most]


def _masses(meshed: MeshedStructure) -> Array:
    """Mass [kg] of each cell of this rank."""
    cell = compat.cellwise(meshed.mesh.dolfinx)
    q = ufl.TestFunction(cell.function_space)
    return compat.assemble_functional(
        meshed.form.density * q * measure(meshed.mesh, 5), cell.function_space
    )
