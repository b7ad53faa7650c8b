"""Strain, stress, rotation and section forces of shells and laminates.

The strains are those of the element (`antiosc.fem.elements.shell`): on triangles the shear strain
has the interpolated rotations, on quadrilaterals it is taken at the 2×2 points of its quadrature
and interpolated, as is the membrane strain of curved quadrilaterals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.fem.elements.material_axes import axes_and_sides
from antiosc.fem.elements.sections import Layer, shear_stresses
from antiosc.fem.elements.shell import GivenSheet, Laminate, Sheet
from antiosc.fem.platform import compat
from antiosc.fem.recovery.place import Place
from antiosc.fem.recovery.points import PointsInCells, gauss_points, in_frame, lagrange_1d
from antiosc.fem.structure.meshed import MeshedStructure

#: Cosine of the angle to the normal from which x is near it.
ALONG = 0.9


class Frame(NamedTuple):
    """Axes (P, 3) at points: 0°, 90° and the normal, which points to the top."""

    e1: Array
    e2: Array
    n: Array


class Strains(NamedTuple):
    """Of the middle surface, in its axes."""

    #: (ε1, ε2, γ12) (P, 3, columns)
    membrane: Array
    #: (κ1, κ2, 2κ12) (P, 3, columns)
    bending: Array
    #: (γ13, γ23) (P, 2, columns)
    shear: Array


class SheetAxes:
    """Directions of 0° and sides of all cells of this rank; to be made on all ranks.

    0° of a sheet without an axis is x along its surface, or y where x is near its normal.
    """

    def __init__(self, part: MeshedStructure) -> None:
        axis, side = axes_and_sides(part.mesh, part.parts)
        self.axis, self.side = axis.x.array.reshape(-1, 3), side.x.array
        given = np.array([material.axis is not None for material, _ in part.parts])
        self.given = given[part.part_of_cells()]

    def frame(self, at: PointsInCells) -> Frame:
        """The axes at points."""
        n = np.cross(at.J[:, :, 0], at.J[:, :, 1])
        n *= (self.side[at.cells] / np.linalg.norm(n, axis=1))[:, None]
        usual = np.where(np.abs(n[:, :1]) < ALONG, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        a = np.where(self.given[at.cells][:, None], self.axis[at.cells], usual)
        e1 = a - np.einsum("pc,pc->p", a, n)[:, None] * n
        e1 /= np.linalg.norm(e1, axis=1)[:, None]
        return Frame(e1, np.cross(n, e1), n)


def middle_strains(at: PointsInCells, axes: SheetAxes) -> Strains:
    """Strains of the middle surface at points, as the energy of the element takes them."""
    own = _raw(at, axes)
    if at.part.mesh.cell == "triangle":
        return own
    g = gauss_points(2)
    table = [lagrange_1d(g, at.X[:, axis]) for axis in (0, 1)]
    shear, membrane = np.zeros_like(own.shear), np.zeros_like(own.membrane)
    for i in (0, 1):
        for j in (0, 1):
            weight = (table[0][:, i] * table[1][:, j])[:, None, None]
            there = _raw(at.moved(np.array([g[i], g[j]])), axes)
            shear += weight * there.shear
            membrane += weight * there.membrane
    curved = at.part.mesh.order > 1
    return Strains(membrane if curved else own.membrane, own.bending, shear)


def section_forces(at: PointsInCells, place: Place, axes: SheetAxes) -> Array:
    """(N1, N2, N12, M1, M2, M12, Q1, Q2) (P, 8, columns) per width, N/m and N, in local axes."""
    strains = middle_strains(at, axes)
    result = np.zeros((len(at.cells), 8, strains.membrane.shape[2]))
    number = at.part.part_of_cells()[at.cells]
    for k, (sheet, _) in enumerate(at.part.parts):
        own, s = number == k, sheet.section
        stretch, bend = strains.membrane[own], strains.bending[own]
        result[own, :3] = _times(s.A, stretch) + _times(s.B, bend)
        result[own, 3:6] = _times(s.B, stretch) + _times(s.D, bend)
        result[own, 6:] = _times(s.S, strains.shear[own])
    return result


def strain(at: PointsInCells, place: Place, axes: SheetAxes) -> Array:
    """Tensors (P, 3, 3, columns)."""
    return _tensors(at, place, axes, of_stress=False)


def stress(at: PointsInCells, place: Place, axes: SheetAxes) -> Array:
    """Tensors (P, 3, 3, columns), Pa; the stress normal to the sheet is zero."""
    return _tensors(at, place, axes, of_stress=True)


def rotation(at: PointsInCells, place: Place) -> Array:
    """Rotation vector of the normal (P, 3, columns), rad."""
    return at.values(at.dofs(("rx", "ry", "rz")))


def _tensors(at: PointsInCells, place: Place, axes: SheetAxes, *, of_stress: bool) -> Array:
    strains, frame = middle_strains(at, axes), axes.frame(at)
    result = np.zeros((len(at.cells), 3, 3, strains.membrane.shape[2]))
    number = at.part.part_of_cells()[at.cells]
    angle = np.zeros(len(at.cells))
    for k, (sheet, _) in enumerate(at.part.parts):
        for up in (1.0, -1.0):
            own = (number == k) & (_toward(place, frame) == up)
            if not own.any():
                continue
            which, z = _height(sheet, place, up)
            layer = _layers(sheet)[which]
            angle[own] = np.deg2rad(layer.angle)
            plane = strains.membrane[own] + (z + sheet.offset) * strains.bending[own]
            # stresses of the shear forces in equilibrium, and the strains that they cause
            f = shear_stresses(_layers(sheet), which, z)
            across = _times(f @ sheet.section.S, strains.shear[own])
            if of_stress:
                plane = _times(layer.plane_stress(), plane)
                half = 1.0
                result[own, 2, 2] = 0.0
            else:
                thin = _times(layer.contraction(), plane)
                across = _times(np.linalg.inv(layer.transverse_shear()), across)
                half = 0.5
                result[own, 2, 2] = thin[:, 0]
            result[own, 0, 0], result[own, 1, 1] = plane[:, 0], plane[:, 1]
            for (i, j), value in (
                ((0, 1), plane[:, 2]),
                ((0, 2), across[:, 0]),
                ((1, 2), across[:, 1]),
            ):
                result[own, i, j] = result[own, j, i] = half * value
    if not place.local:
        return in_frame(result, frame)
    c, s, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    R = np.stack([np.stack([c, s, zero], 1), np.stack([-s, c, zero], 1)], axis=1)
    R = np.concatenate([R, np.broadcast_to([[[0.0, 0.0, 1.0]]], (len(angle), 1, 3))], axis=1)
    return np.einsum("pia,pabk,pjb->pijk", R, result, R, optimize=True)


def _toward(place: Place, frame: Frame) -> Array:
    """±1 (P,): whether the surface of a given side is the top of the sheet."""
    if isinstance(place.surface, str):
        return np.ones(len(frame.n))
    along = frame.n @ np.asarray(place.surface)
    size = float(np.linalg.norm(place.surface))
    if np.any(np.abs(along) < 0.05 * size):
        raise InputError(
            "the direction of surface lies along the sheet there: give one that points away from "
            "its surface, or surface='top' or 'bottom'."
        )
    return np.where(along > 0, 1.0, -1.0)


def _layers(sheet: Sheet) -> list[Layer]:
    if isinstance(sheet, Laminate):
        return list(sheet.layers)
    if isinstance(sheet, GivenSheet):
        raise InputError(
            "the stresses in a shell that is given by its stiffnesses are not known; probe section "
            "forces instead."
        )
    return [Layer.isotropic(sheet.E, sheet.nu, sheet.rho, sheet.thickness)]  # type: ignore[attr-defined]


def _height(sheet: Sheet, place: Place, up: float) -> tuple[int, float]:
    """(number of the layer, distance from the middle surface) that is meant, m."""
    layers = _layers(sheet)
    steps = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
    z = steps - steps[-1] / 2
    surface = place.surface if isinstance(place.surface, str) else ("bottom", "top")[up > 0]
    if place.layer is not None:
        if place.layer >= len(layers):
            raise InputError(
                f"layer must be below {len(layers)}, the number of layers (0 is the lowest); got "
                f"{place.layer}."
            )
        k = place.layer
        low, high = float(z[k]), float(z[k + 1])
        return k, {"top": high, "bottom": low, "middle": (low + high) / 2}[surface]
    if surface == "middle":
        k = int(np.clip(np.searchsorted(z, 0.0, side="right") - 1, 0, len(layers) - 1))
        return k, 0.0
    return (len(layers) - 1, float(z[-1])) if surface == "top" else (0, float(z[0]))


def _raw(at: PointsInCells, axes: SheetAxes) -> Strains:
    frame = axes.frame(at)
    e1, e2, n = frame
    # contravariant tangents: ds along e_α of the reference coordinates
    inverse = np.linalg.pinv(at.J)  # (P, 2, 3)
    along = np.einsum("pdc,pac->pda", inverse, np.stack([e1, e2], axis=1))
    displacements, rotations = at.dofs("xyz"), at.dofs(("rx", "ry", "rz"))
    du = np.einsum("pcdk,pda->pcak", at.slopes(displacements), along, optimize=True)
    dr = np.einsum("pcdk,pda->pcak", at.slopes(rotations), along, optimize=True)

    def dotted(vectors: Array, axis: Array) -> Array:
        return np.einsum("pc...,pc->p...", vectors, axis)

    u1, u2, r1, r2 = dotted(du, e1), dotted(du, e2), dotted(dr, e1), dotted(dr, e2)
    membrane = np.stack([u1[:, 0], u2[:, 1], u1[:, 1] + u2[:, 0]], axis=1)
    # θ × n = (θ·e2) e1 − (θ·e1) e2
    bending = np.stack([r2[:, 0], -r1[:, 1], r2[:, 1] - r1[:, 0]], axis=1)
    lean = _leaning(at, rotations, frame)
    return Strains(membrane, bending, dotted(du, n) + lean)


def _leaning(at: PointsInCells, rotations: Array, frame: Frame) -> Array:
    """(θ×n) along e1 and e2 (P, 2, columns), of triangles interpolated as in `shell_strains`."""
    e1, e2, n = frame
    tangents = np.stack([e1, e2], axis=1)
    if at.part.mesh.cell != "triangle":
        rotated = np.cross(at.values(rotations), n[:, :, None], axis=1)
        return np.einsum("pck,pac->pak", rotated, tangents)
    if not len(at.X):
        return np.zeros((0, 2, rotations.shape[-1]))
    space, path = at.part.form.space, at.part.form.components["rx"]
    table = compat.tabulate(space, path, compat.edge_points())
    # θ×n along the reference directions at the points of the edges: n × J is θ·(n × J_d)
    across = np.cross(n[:, None, :], np.swapaxes(at.J, 1, 2))  # (P, 2, 3)
    covariant = np.einsum("qf,pfck,pdc->pdqk", table, rotations, across, optimize=True)
    near = np.einsum("pabq,pbqk->pak", compat.edge_interpolation(at.X), covariant, optimize=True)
    to_axes = np.einsum("pac,pdc->pad", tangents, np.linalg.pinv(at.J))
    return np.einsum("pad,pdk->pak", to_axes, near)


def _times(matrix: Array, columns: Array) -> Array:
    """Products (P, m, columns) of a matrix (m, n) with vectors (P, n, columns)."""
    return np.einsum("ij,pjk->pik", matrix, columns)
