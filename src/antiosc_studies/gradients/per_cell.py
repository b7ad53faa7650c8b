"""`design_map`: the derivative of a result by the thickness, E or rho of every cell of a part.

Derivatives by a model's parameters give derivatives by its matrices, which are the part's K and M
projected on the shapes V: the contribution of a cell to V'(dK/dp)V is an energy of the cell. The
derivatives by V'KV are a quadratic form of the shapes, which is summed in its principal axes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import ufl

from antiosc import AntiOscillators, DampingMatrix, Structure
from antiosc.base import checks
from antiosc.base._types import Array, Figure
from antiosc.base.errors import InputError
from antiosc.base.process import one_thread
from antiosc.base.texts import CompletedResult, percent
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import on_mesh
from antiosc.fields.fields import checked_shapes
from antiosc_studies.gradients.gradient import gradient
from antiosc_studies.gradients.of_part import material_numbers, model_name

#: Relative step of a thickness for the change of K and M.
THICKNESS_STEP = 1e-3
#: Largest ratios of stiffness and of mass of a part and a model that belong to each other.
MAX_PART_RATIOS = 1 + 1e-4, 1 + 1e-4
#: Parameters of a design map, and their units.
PARAMETER_UNITS = {"thickness": "m", "E": "Pa", "rho": "kg/m³"}
#: Quadrature degree of energies in cells: exact for strains of cubic elements; kinetic energies of
#: these then have errors of some 1e-4.
QUADRATURE_DEGREE = 4


def matrix_derivatives(
    model: AntiOscillators, parameter_derivatives: Mapping[str, Any]
) -> tuple[Array, Array]:
    """Derivatives (C, C) by K and M on a model's shapes, from derivatives by m0, k0, m and omega.

    A change of both turns the static shape by -dK_0j/omega_j^2 and shape i by
    (dK_ij - omega_i^2 dM_ij)/(omega_i^2 - omega_j^2) of the shapes j, all of unit mass; m_i is the
    square of p_i = phi_0' M phi_i, and m0 = phi_0' M phi_0 minus the sum of the m_i.
    """
    p, x = np.sqrt(model.m), model.omega**2
    by_p = 2 * p * (parameter_derivatives["m"] - parameter_derivatives["m0"])
    differences = x[:, None] - x
    np.fill_diagonal(differences, 1.0)
    turn = by_p[:, None] * p / differences
    np.fill_diagonal(turn, parameter_derivatives["omega"] / (2 * model.omega))

    K, M = np.zeros((2, model.n + 1, model.n + 1))
    K[1:, 1:] = turn
    M[1:, 1:] = -x[:, None] * turn - np.diag(by_p * p / 2)
    K[0, 1:] = -(by_p + 2 * parameter_derivatives["m0"] * p) / x
    M[0, 1:] = by_p
    K[0, 0], M[0, 0] = parameter_derivatives["k0"] or 0.0, parameter_derivatives["m0"]

    scale = 1 / np.append(1.0, p)  # from shapes of unit mass to those of the model
    K, M = (scale[:, None] * matrix * scale for matrix in (K, M))
    return (K + K.T) / 2, (M + M.T) / 2


@dataclass(frozen=True, eq=False, repr=False)
class DesignMap(CompletedResult):
    """The result of `design_map`.

    Attributes
    ----------
    goal : the result; value : its value in the run; by : the parameter.
    slopes : (cells of this rank,) derivative by the parameter of each cell alone; NaN for cells
        whose material does not have it.
    per_mass : (cells of this rank,) change by one more kilogram there [unit of the goal/kg]; by E:
        change by doubling the modulus of one kilogram.
    meshed : the mesh of the part with its data.
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
            ("cells where more lowers it", f"{percent(lowers)}"),
        ]

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """`per_mass` drawn on the part; all ranks call it.

        With `path` (PNG, PDF, SVG, …) the picture is written and the path is returned. Blue: more
        material lowers the goal; red: it raises it.
        """
        from antiosc.plot.surfaces import draw_design

        faces = self.meshed.faces
        gather = self.meshed.comm.allgather
        corners = np.concatenate(gather(faces.corners))
        value = np.concatenate(gather(self.per_mass[faces.cells]))
        return draw_design(corners, value, f"d {self.goal} / kg of {self.by}", path)


@one_thread()
def design_map(
    part: Structure,
    hit: Any,
    goal: str | Callable[[Any], float],
    by: str = "thickness",
    *,
    contact: tuple[str, str] | None = None,
    time: float | None = None,
) -> DesignMap:
    """Derivative of a result by the thickness of every cell, which shows where material is useful.

    Derivatives by E do not include the compliance of the contact patch, which belongs to the law.

    Parameters
    ----------
    part : Structure
        Structure of one mesh, from which the run's model was extracted.
    hit, goal, contact, time
        As for `gradient`.
    by : "thickness", "E" or "rho"
        Parameter of the cells' materials; stiffeners of a sheet are left out.

    Raises
    ------
    InputError
        A part that is not the run's, whose materials do not have `by`, or that `gradient` refuses.
    NotDifferentiableError
        As for `gradient`.
    """
    checks.choice("by", by, tuple(PARAMETER_UNITS))
    checks.instance("part", part, Structure, "a Structure")
    meshed = on_mesh(part)
    name = model_name(hit)
    checked_shapes(part, hit, name, MAX_PART_RATIOS)
    model: Any = hit.assembly.scene.bodies[name]
    g = gradient(hit, goal, contact=contact, time=time)
    by_model = g.bodies.get(name, {})
    if by_model.get("m0") is None or isinstance(model.damping, DampingMatrix):
        raise InputError(
            "a design map needs a model of one site with a mass there, whose damping does not"
            " couple its modes: give gradient a function of x that builds the part, and x."
        )

    by_cell = [float(material_numbers(material).get(by, np.nan)) for material, _ in meshed.parts]
    if not np.isfinite(by_cell).any():
        raise InputError(f"no material of the part has a {by} [{PARAMETER_UNITS[by]}] of its own.")
    relative = np.zeros(compat.cell_index_map(meshed.mesh.dolfinx).size_local)
    changes = _derivative_forms(part, meshed, by)
    size = np.sqrt(np.append(model.m_st, model.m))  # so that all shapes count alike
    for change, matrix in zip(changes, matrix_derivatives(model, by_model), strict=True):
        if change:
            shares, axes = np.linalg.eigh(size[:, None] * matrix * size)
            vectors = model.shapes @ (axes / size[:, None])
            space = meshed.form.space
            relative += compat.cell_energies(change, space, vectors, shares, QUADRATURE_DEGREE)

    value = np.array(by_cell)[meshed.part_of_cells()[: relative.size]]
    per_mass = np.where(np.isfinite(value), relative / _cell_masses(meshed), np.nan)
    return DesignMap(g.goal, g.value, by, relative / value, per_mass, meshed)


def _derivative_forms(
    part: Structure, meshed: MeshedStructure, by: str
) -> tuple[Sequence[ufl.Form], Sequence[ufl.Form]]:
    """UFL forms of the derivatives of K and M by a relative change of the parameter `by`."""
    if by == "E":  # to which they are proportional
        return meshed.form.stiffness, []
    if by == "rho":
        return [], meshed.form.mass

    assert part.made_of is not None
    K = []
    M = []
    for sign in (1, -1):
        changed_parts: list[Any] = []
        for material, cells in meshed.parts:
            value = material_numbers(material).get(by)
            scaled = {} if value is None else {by: value * (1 + sign * THICKNESS_STEP)}
            changed_parts.append((replace(material, **scaled), cells))
        form = changed_parts[0][0].weak_form(meshed.mesh, changed_parts, part.made_of[2]["order"])
        factor = compat.constant(meshed.mesh.dolfinx, sign / (2 * THICKNESS_STEP))
        K += [factor * part_form for part_form in form.stiffness]
        M += [factor * part_form for part_form in form.mass]

    return K, M


def _cell_masses(meshed: MeshedStructure) -> Array:
    """Mass [kg] of each cell of this rank."""
    space = compat.cellwise_function(meshed.mesh.dolfinx).function_space
    mass = meshed.form.density * ufl.TestFunction(space) * measure(meshed.mesh, 5)
    return compat.assemble_functional(mass, space)
