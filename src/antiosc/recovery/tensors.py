"""Strain, stress, rotation and section forces at points of solids, bars, beams and sheets.

In beams the section strains are evaluated at the Gauss points of the stiffness, where they are most
accurate, and interpolated between them.

In sheets the strains are those of the element (`antiosc.fem.elements.shell`): on triangles the
shear strain uses the interpolated rotations; on quadrilaterals it is evaluated at the 2×2 points of
its quadrature and interpolated, as is the membrane strain of curved quadrilaterals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.base.stresses import COMPONENT_AXES, TENSOR_PLACES
from antiosc.fem.elements import Layer, shear_stresses
from antiosc.fem.elements.beam import Beam, height_directions
from antiosc.fem.elements.shell import GivenSheet, Laminate, Sheet
from antiosc.fem.elements.weak_form import Material
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.recovery.place import Place


def rotated_tensors(tensors: Array, R: Array) -> Array:
    """Tensors (P, 3, 3, columns) in the axes that are the rows of R (P, 3, 3)."""
    rows = R @ tensors.reshape(len(R), 3, 3 * tensors.shape[3])
    return np.asarray(R[:, None] @ rows.reshape(tensors.shape))


def from_frame(local: Array, frame: Sequence[Array]) -> Array:
    """Tensors (P, 3, 3, columns) rotated from the axes `frame`, each (P, 3), to the mesh's axes."""
    return rotated_tensors(local, np.stack(list(frame), axis=2))


def column_tensors(six: Array) -> Array:
    """Tensors (P, 3, 3, columns) from components (P, 6, columns), ordered by `COMPONENT_AXES`."""
    return six[:, TENSOR_PLACES]


class PointsInCells:
    """Points X (P, tdim) in `cells` (P,) of this rank, with motions `shapes` (dofs with ghosts,
    columns). With `factors` (P, columns) each point has one motion, Σ factor · shape."""

    def __init__(
        self,
        part: MeshedStructure,
        shapes: Array,
        cells: IntArray,
        X: Array,
        factors: Array | None = None,
    ) -> None:
        self.part = part
        self.cells = np.asarray(cells)
        self.X = np.asarray(X)
        self._shapes = shapes
        self._factors = factors
        self._space = part.form.space
        self._first = next(iter(part.form.components.values()))
        _, self.J = part.mesh.geometry.at(self.cells, self.X)

    def moved(self, X: Array) -> PointsInCells:
        """The same cells with other reference points X (P, tdim), or one X (tdim,) for all."""
        X = np.broadcast_to(X, self.X.shape)
        return PointsInCells(self.part, self._shapes, self.cells, X)

    def one_point_per_cell(self, X: Array) -> tuple[PointsInCells, IntArray]:
        """(one point at X (tdim,) in each cell, index (P,) of that point for each of `cells`)."""
        cells, number = np.unique(self.cells, return_inverse=True)
        X = np.broadcast_to(X, (len(cells), len(X)))
        return PointsInCells(self.part, self._shapes, cells, X), number

    def dofs(self, names: str | tuple[str, ...]) -> Array:
        """Values (P, functions, names, columns) of the cells' dofs; 0 for missing components."""
        components = self.part.form.components
        factors = self._factors
        count = self._shapes.shape[1] if factors is None else 1

        dofs = []
        for name in names:
            if name in components:
                numbers = compat.cell_dofs(self._space, components[name], self.cells)
                of_shapes = self._shapes[numbers]
                dofs.append(of_shapes if factors is None else of_shapes @ factors[:, :, None])
            else:
                dofs.append(np.zeros((len(self.cells), self.functions, count)))

        return np.stack(dofs, axis=2)

    @property
    def functions(self) -> int:
        """Number of basis functions of a cell."""
        return int(compat.cell_dofs(self._space, self._first, self.cells[:0]).shape[1])

    @cached_property
    def _materials(self) -> tuple[list[Material], IntArray]:
        """(materials at the points, number (P,) of each point's material among them)."""
        numbers, index = np.unique(self.part.part_of_cells()[self.cells], return_inverse=True)
        return [self.part.parts[k][0] for k in numbers] or [self.part.parts[0][0]], index.ravel()

    def material_values(self, value: Callable[[Material], ArrayLike]) -> Array:
        """`value(material)` of the material at each point: (P, …)."""
        materials, index = self._materials
        return np.array([value(material) for material in materials])[index]

    def values(self, dofs: Array) -> Array:
        """Values (P, components, columns) at the points, from `dofs` of the basis functions."""
        if not len(self.X):
            return np.zeros((0, *dofs.shape[2:]))
        table = compat.tabulate(self._space, self._first, self.X)
        count, functions, components, columns = dofs.shape
        values = table[:, None] @ dofs.reshape(count, functions, components * columns)
        return np.asarray(values.reshape(count, components, columns))

    def slopes(self, dofs: Array, inverse: Array | None = None) -> Array:
        """Derivatives (P, components, tdim, columns) by X; by x if `inverse`, dX/dx, is given."""
        tdim = self.part.mesh.tdim if inverse is None else inverse.shape[2]
        if not len(self.X):
            return np.zeros((0, dofs.shape[2], tdim, dofs.shape[3]))
        table = compat.tabulate_derivatives(self._space, self._first, self.X)
        along = table if inverse is None else table @ inverse

        # a product of matrices takes a seventh of the time of einsum
        count, functions, *of_dofs = dofs.shape
        slopes = np.swapaxes(along, 1, 2) @ dofs.reshape(count, functions, -1)
        return np.swapaxes(slopes.reshape(count, tdim, *of_dofs), 1, 2)


def lagrange_1d(nodes: Array, x: Array) -> Array:
    """Values (points, nodes) of Lagrange's polynomials through `nodes` (n,) at x (points,)."""
    count = len(nodes)
    return np.asarray(np.vander(x, count) @ np.linalg.inv(np.vander(nodes, count)))


def gauss_points(count: int) -> Array:
    """The Gauss points (count,) of the interval from 0 to 1."""
    return np.asarray((np.polynomial.legendre.leggauss(count)[0] + 1) / 2)


def solid_strain(at: PointsInCells, place: Place) -> Array:
    """Strain tensors (P, 3, 3, columns)."""
    gradient = _displacement_gradient(at)
    result = (gradient + np.swapaxes(gradient, 1, 2)) / 2
    if at.part.initial is not None:
        result += np.einsum("pkic,pkjc->pijc", gradient, gradient) / 2

    # in plane stress it contracts freely across the plane
    plane_stress = at.material_values(lambda solid: getattr(solid, "plane", None) == "stress")
    if plane_stress.any():
        ratio = at.material_values(lambda solid: [solid.nu / (1 - solid.nu)])
        contracted = -ratio * (result[:, 0, 0] + result[:, 1, 1])
        result[:, 2, 2] = np.where(plane_stress[:, None], contracted, 0.0)

    return _in_material_axes(at, result, place)


def solid_stress(at: PointsInCells, place: Place) -> Array:
    """Stress tensors (P, 3, 3, columns), Pa."""
    strains = solid_strain(at, Place())
    six = [(1 if i == j else 2) * strains[:, i, j] for i, j in COMPONENT_AXES]
    stresses = at.material_values(lambda solid: solid.voigt) @ np.stack(six, axis=1)
    return _in_material_axes(at, column_tensors(stresses), place)


def solid_rotation(at: PointsInCells, place: Place) -> Array:
    """Half the curl of the displacement (P, 3, columns), rad; (P, 1, columns) on plane parts."""
    g = _displacement_gradient(at)
    if at.part.mesh.gdim == 2:
        return np.asarray((g[:, 1, 0] - g[:, 0, 1])[:, None] / 2)
    pairs = ((2, 1), (0, 2), (1, 0))
    return np.stack([(g[:, i, j] - g[:, j, i]) / 2 for i, j in pairs], axis=1)


def _displacement_gradient(at: PointsInCells) -> Array:
    """Displacement gradients ∂u_i/∂x_j (P, 3, 3, columns)."""
    gdim = at.part.mesh.gdim
    inverse = np.linalg.inv(at.J[:, :gdim, :])
    slopes = at.slopes(at.dofs("xyz"[:gdim]), inverse)
    result = np.zeros((len(at.cells), 3, 3, slopes.shape[-1]))
    result[:, :gdim, :gdim] = slopes
    return result


def _in_material_axes(at: PointsInCells, tensors: Array, place: Place) -> Array:
    """`tensors`, rotated to the axes of an anisotropic material if `place` is local."""
    if not place.local:
        return tensors
    axes = at.material_values(lambda solid: getattr(solid, "axes", np.eye(3)))
    return rotated_tensors(tensors, axes)


def truss_section_forces(at: PointsInCells, place: Place) -> Array:
    """Axial forces (P, 1, columns), N."""
    stiffness = at.material_values(lambda bar: [bar.E * bar.area])
    return np.asarray((stiffness * _axial_strain(at))[:, None])


def _axial_strain(at: PointsInCells) -> Array:
    """Axial strains (P, columns); to second order if the part has initial strains."""
    length = np.linalg.norm(at.J[:, :, 0], axis=1)[:, None]
    slope = at.slopes(at.dofs("xyz"))[:, :, 0] / length[:, :, None]
    axial_strain = np.einsum("pck,pc->pk", slope, at.J[:, :, 0] / length)
    return np.asarray(axial_strain + _second_order_strain(at, slope))


def _second_order_strain(at: PointsInCells, slope: Array) -> Array:
    """Second-order axial strains (P, columns) of the gradient `slope`, minus initial strains."""
    if at.part.initial is None:
        return np.zeros(slope[:, 0].shape)
    return np.sum(slope**2, axis=1) / 2 - at.part.initial[at.cells][:, None]


def truss_tensors(
    at: PointsInCells, place: Place, sizes_of: Callable[[Material], list[float]]
) -> Array:
    """Tensors (P, 3, 3, columns) of bars: axial strain × `sizes_of(material)`, (along, across)."""
    if place.local:
        axial_tensor = np.broadcast_to(np.diag([1.0, 0, 0]), (len(at.cells), 3, 3))
    else:
        t = at.J[:, :, 0] / np.linalg.norm(at.J[:, :, 0], axis=1)[:, None]
        axial_tensor = np.einsum("pi,pj->pij", t, t)

    sizes = at.material_values(sizes_of)
    shape = sizes[:, :1, None] * axial_tensor + sizes[:, 1:, None] * (np.eye(3) - axial_tensor)
    return np.asarray(shape[..., None] * _axial_strain(at)[:, None, None])


class BeamFrame(NamedTuple):
    """Axes (P, 3) of beams at points: tangent t, height y, and z = t × y."""

    t: Array
    y: Array
    z: Array


def section_strains(at: PointsInCells) -> tuple[Array, BeamFrame]:
    """((ε, γy, γz, twist, κy, κz) (P, 6, columns) at the centroid, axes of the beam)."""
    frame = _beam_axes(at)
    nodes = gauss_points(at.part.form.space.element.basix_element.degree)
    mean = 0.0
    for x, weight in zip(nodes, lagrange_1d(nodes, at.X[:, 0]).T, strict=True):
        mean = mean + weight[:, None, None] * _section_strains_at(at.moved(np.array([x])), frame)
    return np.asarray(mean), frame


def beam_section_forces(at: PointsInCells, place: Place) -> Array:
    """(N, Vy, Vz, T, My, Mz) (P, 6, columns) [N, N m] of beams; (N, V, M) of plane beams."""
    strains, _ = section_strains(at)
    size = at.part.mesh.extent()

    def stiffness(beam: Beam) -> list[float]:
        """Factors of the six section strains: EA, shear stiffnesses, GJ, EIy, EIz."""
        s = beam.section
        shear = [beam.shear_stiffness(plane, size) for plane in (0, 1)]
        return [beam.E * s.A, *shear, beam.G * s.torsion, beam.E * s.side, beam.E * s.I]

    forces = strains * at.material_values(stiffness)[:, :, None]
    if at.part.mesh.gdim == 3:
        return forces
    return forces[:, [0, 1, 5]]


def beam_strain(at: PointsInCells, place: Place) -> Array:
    """Strain tensors (P, 3, 3, columns) at a fibre: axial strain and transverse contraction."""
    strains, frame = section_strains(at)
    y, z = at.material_values(lambda beam: _fibre_position(beam, place)).T[:, :, None]
    fibre_strain = strains[:, 0] - y * strains[:, 5] + z * strains[:, 4]
    nu = at.material_values(lambda beam: [beam.nu])
    local = np.zeros((len(at.cells), 3, 3, fibre_strain.shape[1]))
    local[:, 0, 0] = fibre_strain
    local[:, 1, 1] = local[:, 2, 2] = -nu * fibre_strain
    if place.local:
        return local
    return from_frame(local, frame)


def beam_stress(at: PointsInCells, place: Place) -> Array:
    """Stress tensors (P, 3, 3, columns) [Pa] at a fibre: only the normal stress of N, My, Mz."""
    strains = beam_strain(at, Place(fibre=place.fibre, local=True))
    local = np.zeros_like(strains)
    local[:, 0, 0] = at.material_values(lambda beam: [beam.E]) * strains[:, 0, 0]
    if place.local:
        return local
    return from_frame(local, _beam_axes(at))


def _fibre_position(beam: Beam, place: Place) -> list[float]:
    """(y, z) of the fibre in the section of a beam, m."""
    if isinstance(place.fibre, int):
        outline = beam.section.outline
        return list(outline[place.fibre % len(outline)])
    return list(place.fibre or (0.0, 0.0))


def _section_strains_at(at: PointsInCells, frame: BeamFrame) -> Array:
    """Section strains (ε, γy, γz, twist, κy, κz) (P, 6, columns), evaluated at the points."""
    length = np.linalg.norm(at.J[:, :, 0], axis=1)[:, None, None]
    displacements = at.dofs("xyz")
    rotations = at.dofs(("rx", "ry", "rz"))
    slope = at.slopes(displacements)[:, :, 0] / length
    curvature = at.slopes(rotations)[:, :, 0] / length
    rotation = at.values(rotations)
    offset = at.material_values(lambda beam: [beam.offset])

    def component(vectors: Array, axis: Array) -> Array:
        """Components (P, columns) of vectors (P, 3, columns) along an axis (P, 3)."""
        return np.einsum("pck,pc->pk", vectors, axis)

    stretch = -offset * component(curvature, frame.z)
    sideways = offset * component(curvature, frame.t) if at.part.form.twist_moves_centroid else 0.0

    # −(θ × t)·y = −θ·z, −(θ × t)·z = θ·y
    forces = [
        component(slope, frame.t) + stretch + _second_order_strain(at, slope),
        component(slope, frame.y) - component(rotation, frame.z),
        component(slope, frame.z) + component(rotation, frame.y) + sideways,
    ]

    return np.stack([*forces, *(component(curvature, axis) for axis in frame)], axis=1)


def _beam_axes(at: PointsInCells) -> BeamFrame:
    """Axes of the beams at the points."""
    t = at.J[:, :, 0] / np.linalg.norm(at.J[:, :, 0], axis=1)[:, None]
    if at.part.mesh.gdim == 2:
        z = np.broadcast_to([0.0, 0.0, 1.0], t.shape)
        return BeamFrame(t, np.cross(z, t), z)
    middle = at.part.mesh.geometry.nodes[at.cells].mean(axis=1)
    number = at.part.part_of_cells()[at.cells]
    height = np.zeros_like(t)
    for k, (beam, _) in enumerate(at.part.parts):
        of_part = number == k
        if of_part.any():
            height[of_part] = height_directions(beam, t[of_part], middle[of_part])

    y = height - np.einsum("pc,pc->p", height, t)[:, None] * t
    y /= np.linalg.norm(y, axis=1)[:, None]
    return BeamFrame(t, y, np.cross(t, y))


#: Cosine of the angle to the normal from which x is near it.
NEAR_NORMAL_COSINE = 0.9


class SheetFrame(NamedTuple):
    """Axes (P, 3) of a sheet at points: 0°, 90°, and the normal n to the top."""

    e1: Array
    e2: Array
    n: Array


class Strains(NamedTuple):
    """Strains, curvatures of a sheet's middle surface at P points, in its axes; columns: shapes."""

    #: (ε1, ε2, γ12) (P, 3, columns)
    membrane: Array
    #: (κ1, κ2, 2κ12) (P, 3, columns)
    bending: Array
    #: (γ13, γ23) (P, 2, columns)
    shear: Array


class SheetAxes:
    """0° direction (default: x, or y if x is near the normal) and top of each cell; collective."""

    def __init__(self, part: MeshedStructure) -> None:
        self.axis, self.side = part.axes_and_sides
        oriented = np.array([material.axis is not None for material, _ in part.parts])
        self.given = oriented[part.part_of_cells()]

    def frame(self, at: PointsInCells) -> SheetFrame:
        """Axes of the sheet at points."""
        n = np.cross(at.J[:, :, 0], at.J[:, :, 1])
        n *= (self.side[at.cells] / np.linalg.norm(n, axis=1))[:, None]
        default_axis = np.where(
            np.abs(n[:, :1]) < NEAR_NORMAL_COSINE, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]
        )
        a = np.where(self.given[at.cells][:, None], self.axis[at.cells], default_axis)
        e1 = a - np.einsum("pc,pc->p", a, n)[:, None] * n
        e1 /= np.linalg.norm(e1, axis=1)[:, None]
        return SheetFrame(e1, np.cross(n, e1), n)


def middle_strains(at: PointsInCells, axes: SheetAxes) -> Strains:
    """Strains of the middle surface at points, interpolated as in the element's strain energy."""
    strains = _strains_at_points(at, axes)
    if at.part.mesh.cell == "triangle":
        return strains
    g = gauss_points(2)
    table = [lagrange_1d(g, at.X[:, axis]) for axis in (0, 1)]
    shear = np.zeros_like(strains.shear)
    membrane = np.zeros_like(strains.membrane)
    for i, j in np.ndindex(2, 2):
        weight = (table[0][:, i] * table[1][:, j])[:, None, None]
        at_gauss, number = at.one_point_per_cell(np.array([g[i], g[j]]))
        corner_strains = _strains_at_points(at_gauss, axes)
        shear += weight * corner_strains.shear[number]
        membrane += weight * corner_strains.membrane[number]

    curved = at.part.mesh.order > 1
    return Strains(membrane if curved else strains.membrane, strains.bending, shear)


def sheet_section_forces(at: PointsInCells, place: Place, axes: SheetAxes) -> Array:
    """(N1, N2, N12, M1, M2, M12, Q1, Q2) (P, 8, columns) per width in local axes; N/m, N, N/m."""
    membrane, bending, shear = middle_strains(at, axes)
    A, B, D, S = (at.material_values(attrgetter(f"section.{name}")) for name in "ABDS")
    forces = [A @ membrane + B @ bending, B @ membrane + D @ bending, S @ shear]
    return np.concatenate(forces, axis=1)


def sheet_tensors(at: PointsInCells, place: Place, axes: SheetAxes, *, of_stress: bool) -> Array:
    """Strain or stress tensors (P, 3, 3, columns), Pa; the stress normal to the sheet is zero."""
    membrane, bending, shear = middle_strains(at, axes)
    if not len(at.cells):  # the first material may have no such layer
        return np.zeros((0, 3, 3, membrane.shape[2]))

    def sheet_values(value: Callable[[Sheet, int, float], ArrayLike]) -> Array:
        """`value(sheet, layer number, height above the middle surface [m])` at each point."""
        return at.material_values(lambda sheet: value(sheet, *_layer_and_height(sheet, place)))

    # stresses of the shear forces in equilibrium, and the strains that they cause
    plane = membrane + sheet_values(lambda sheet, _, z: [[z + sheet.offset]]) * bending
    f = sheet_values(lambda sheet, k, z: shear_stresses(_layers(sheet), k, z) @ sheet.section.S)
    across = f @ shear
    if of_stress:
        plane = sheet_values(lambda sheet, k, _: _layers(sheet)[k].plane_stress()) @ plane
        normal = np.zeros_like(plane[:, 0])
        half = 1.0
    else:
        normal = (sheet_values(lambda sheet, k, _: _layers(sheet)[k].contraction()) @ plane)[:, 0]
        G = sheet_values(lambda sheet, k, _: _layers(sheet)[k].transverse_shear())
        across = np.linalg.solve(G, across)
        half = 0.5

    shears = half * across[:, 1], half * across[:, 0], half * plane[:, 2]
    result = column_tensors(np.stack([plane[:, 0], plane[:, 1], normal, *shears], axis=1))
    if not place.local:
        return from_frame(result, axes.frame(at))
    angle = sheet_values(lambda sheet, k, _: _layers(sheet)[k].angle)
    return rotated_tensors(result, Rotation.from_euler("z", -angle, degrees=True).as_matrix())


def _layers(sheet: Sheet) -> list[Layer]:
    """The layers of a sheet; a shell has one."""
    if isinstance(sheet, Laminate):
        return list(sheet.layers)
    if isinstance(sheet, GivenSheet):
        raise InputError(
            "the stresses of a shell that is given by its stiffnesses are not known: probe"
            " section forces."
        )

    return [Layer.isotropic(sheet.E, sheet.nu, sheet.rho, sheet.thickness)]  # type: ignore[attr-defined]


def _layer_and_height(sheet: Sheet, place: Place) -> tuple[int, float]:
    """(number of the layer, height above the middle surface [m]) of a place."""
    layers = _layers(sheet)
    steps = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
    z = steps - steps[-1] / 2

    if place.layer is not None:
        if place.layer >= len(layers):
            raise InputError(f"layer must be below {len(layers)} (0: lowest); got {place.layer}.")
        k = place.layer
        low = float(z[k])
        high = float(z[k + 1])
        return k, {"top": high, "bottom": low, "middle": (low + high) / 2}[place.surface]

    if place.surface == "middle":
        k = int(np.clip(np.searchsorted(z, 0.0, side="right") - 1, 0, len(layers) - 1))
        return k, 0.0
    if place.surface == "top":
        return (len(layers) - 1, float(z[-1]))
    return (0, float(z[0]))


def _strains_at_points(at: PointsInCells, axes: SheetAxes) -> Strains:
    """Strains evaluated at the points, without the interpolation of the element."""
    frame = axes.frame(at)
    in_axes = np.stack(frame, axis=1)  # (P, 3, 3), the axes as rows
    gradients = np.linalg.pinv(at.J) @ in_axes[:, :2].swapaxes(1, 2)  # reference by e1, e2
    displacements = at.dofs("xyz")
    rotations = at.dofs(("rx", "ry", "rz"))

    def local_slopes(dofs: Array) -> Array:
        """Slopes (P, 3, 2, columns) along e1 and e2 of the components along e1, e2 and n."""
        slopes = at.slopes(dofs, gradients)
        rows = in_axes @ slopes.reshape(len(slopes), 3, 2 * slopes.shape[3])
        return np.asarray(rows.reshape(slopes.shape))

    du = local_slopes(displacements)
    dr = local_slopes(rotations)
    membrane = np.stack([du[:, 0, 0], du[:, 1, 1], du[:, 0, 1] + du[:, 1, 0]], axis=1)

    if at.part.initial is not None:
        products = np.einsum("pcak,pcbk->pabk", du, du)
        second = [products[:, 0, 0] / 2, products[:, 1, 1] / 2, products[:, 0, 1]]
        membrane += np.stack(second, axis=1)

    # θ × n = (θ·e2) e1 − (θ·e1) e2
    bending = np.stack([dr[:, 1, 0], -dr[:, 0, 1], dr[:, 1, 1] - dr[:, 0, 0]], axis=1)
    return Strains(membrane, bending, du[:, 2] + _shear_rotations(at, rotations, frame))


def _shear_rotations(at: PointsInCells, rotations: Array, frame: SheetFrame) -> Array:
    """θ×n along e1 and e2 (P, 2, columns); in triangles interpolated as in the strain energy."""
    e1, e2, n = frame
    if at.part.mesh.cell != "triangle":
        return np.asarray(np.stack([e2, -e1], axis=1) @ at.values(rotations))
    count, functions, components, columns = rotations.shape
    if not count:
        return np.zeros((0, 2, columns))
    space = at.part.form.space
    path = at.part.form.components["rx"]
    table = compat.tabulate(space, path, compat.edge_points())

    # θ×n along the reference directions at the points of the edges: n × J is θ·(n × J_d)
    turned = np.cross(n[:, None, :], np.swapaxes(at.J, 1, 2))  # (P, 2, 3)
    to_axes = np.stack([e1, e2], axis=1) @ np.linalg.pinv(at.J).swapaxes(1, 2)
    along_edges = to_axes[:, None] @ np.moveaxis(compat.edge_interpolation(at.X) @ table, 2, 1)
    weights = np.einsum("pbaf,pbc->pafc", along_edges, turned)
    weights = weights.reshape(count, 2, functions * components)
    return np.asarray(weights @ rotations.reshape(count, functions * components, columns))


def displacement(at: PointsInCells, place: Place) -> Array:
    """Displacements (P, 3, columns), m."""
    return at.values(at.dofs("xyz"))


def rotation(at: PointsInCells, place: Place) -> Array:
    """Rotation of the section or normal (P, 3, columns), rad; (P, 1, columns) of plane beams."""
    plane = at.part.kind.name == "beam" and at.part.mesh.gdim == 2
    return at.values(at.dofs(("rz",) if plane else ("rx", "ry", "rz")))


#: Quantity -> {kind of part: function that evaluates it}.
QUANTITIES: dict[str, dict[str, Callable[..., Array]]] = {
    "displacement": dict.fromkeys(("solid", "truss", "beam", "sheet"), displacement),
    "strain": {
        "solid": solid_strain,
        "truss": partial(truss_tensors, sizes_of=lambda bar: [1.0, -bar.nu]),
        "beam": beam_strain,
        "sheet": partial(sheet_tensors, of_stress=False),
    },
    "stress": {
        "solid": solid_stress,
        "truss": partial(truss_tensors, sizes_of=lambda bar: [bar.E, 0.0]),
        "beam": beam_stress,
        "sheet": partial(sheet_tensors, of_stress=True),
    },
    "rotation": {"solid": solid_rotation, "beam": rotation, "sheet": rotation},
    "section_forces": {
        "truss": truss_section_forces,
        "beam": beam_section_forces,
        "sheet": sheet_section_forces,
    },
}


def evaluator(
    part: MeshedStructure, quantity: str, place: Place
) -> Callable[[PointsInCells], Array]:
    """A function that evaluates `quantity` at points in cells; all ranks must call it."""
    function = QUANTITIES[quantity].get(part.kind.name)
    if function is None:
        raise InputError(f"a {part.kind.name} has no {quantity.replace('_', ' ')}.")
    if part.kind.name == "sheet" and quantity not in ("displacement", "rotation"):
        axes = SheetAxes(part)
        return lambda at: function(at, place, axes)
    return lambda at: function(at, place)
