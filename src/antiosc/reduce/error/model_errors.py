"""What an extraction with error="estimate" adds to its models, gaps of flat faces included.

Gaps between flat faces and the curved surface that they may stand for: the normals at the corners
of a face are those of the surface, means over the faces around (weighted as Max, J. Graphics Tools
4 (1999) 2: exact on spheres, and on circles by the inverse lengths). Along a side of length l with
the normals n, n' at its ends x, x' the curvature times l² is (n' - n)·(x' - x); a linear face is
off the surface by a twelfth of that in the mean over a segment, and by a twenty-fourth of its sum
over the sides of a triangle or a quadrilateral.
"""

from __future__ import annotations

import time
from dataclasses import replace
from math import pi, sqrt

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.beam import Beam, heights
from antiosc.fem.elements.weak_form import Material
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import (
    BeamSection,
    FacetGaps,
    Patch,
    strip_bending_frequency,
    thickness_shear_frequency,
)
from antiosc.reduce.error.bisection import HalvedBeams, inside, polygon
from antiosc.reduce.error.shell import ShellErrors
from antiosc.reduce.error.solid import SolidErrors, refuse_locking
from antiosc.reduce.site import Functional
from antiosc.reduce.site.sites import located

# -- Whether flat faces approximate a curved surface, an error that no recovery of strains detects.


#: Angles in degrees between neighbouring faces of a curved surface: above rounding, and up to those
#: of seven faces around a hole, the fewest that gmsh makes.
LEAST_ANGLE, MOST_ANGLE = 0.2, 52.0
#: Sides of an exterior facet as positions of its corners.
FACET_SIDES: dict[int, list[tuple[int, ...]]] = {
    2: [(0,), (1,)],
    3: [(0, 1), (0, 2), (1, 2)],
    4: [(0, 1), (0, 2), (1, 3), (2, 3)],
}


def faceted(mesh: Mesh) -> str:
    """A sentence if straight cells seem to approximate a curved exterior; else ""."""
    if mesh.order > 1:
        return ""
    facets = compat.exterior_facets(mesh.dolfinx)
    corners = compat.entity_vertices(mesh.dolfinx, mesh.tdim - 1)[facets]
    angles = mesh.comm.allgather(_angles(mesh.dolfinx.geometry.x, corners))
    angle = np.concatenate(angles)
    small = angle[(angle > LEAST_ANGLE) & (angle < MOST_ANGLE)]
    if not len(small):
        return ""
    return (
        f"The flat faces of {mesh.name} that meet at angles of up to {small.max():.2g}° are taken "
        "for a curved surface; read the geometry with order=2 to have it curved."
    )


def _angles(x: Array, corners: IntArray) -> Array:
    """Angles in degrees between facets (n, corners) that share a side."""
    if not len(corners):
        return np.zeros(0)
    points = x[corners]
    if corners.shape[1] == 2:
        along = points[:, 1] - points[:, 0]
        normals = np.column_stack([-along[:, 1], along[:, 0], 0 * along[:, 0]])
    elif corners.shape[1] == 3:
        normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    else:
        normals = np.cross(points[:, 3] - points[:, 0], points[:, 2] - points[:, 1])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    places = FACET_SIDES[corners.shape[1]]
    sides = np.sort(np.concatenate([corners[:, list(place)] for place in places]), axis=1)
    facet = np.tile(np.arange(len(corners)), len(places))
    order = np.lexsort(sides.T)
    same = (np.diff(sides[order], axis=0) == 0).all(axis=1)
    one, other = facet[order[:-1][same]], facet[order[1:][same]]
    cosine = np.abs(np.einsum("nd,nd->n", normals[one], normals[other]))
    return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1.0))))


#: Corners around a face, in order; the ends of a segment.
AROUND = {2: [0, 1], 3: [0, 1, 2], 4: [0, 1, 3, 2]}


def mean_gaps(faces: Faces) -> tuple[Array, Array]:
    """(mean gap [m], area [m²] or, in the plane, length [m]) of this rank's faces, (F,) each.

    A gap is positive where the surface lies outside of the face (it is convex).
    """
    mesh = faces.mesh
    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices)[faces.vertices]
    every = mesh.comm.allgather((numbers, faces.corners, faces.normals))
    first = sum(len(each[0]) for each in every[: mesh.comm.rank])
    vertices, x, normals = (np.concatenate(each) for each in zip(*every, strict=True))
    around = AROUND[vertices.shape[1]]
    gap = _gaps(vertices[:, around], x[:, around], normals)
    area = _areas(faces.corners[:, around])
    return gap[first : first + len(area)], area


def _gaps(vertices: IntArray, x: Array, normals: Array) -> Array:
    """Mean gaps (F,) of faces with corners x (F, v, 3) around them, at `vertices` (F, v)."""
    corners = vertices.shape[1]
    ahead, back = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    size = np.linalg.norm(ahead, axis=2)
    weight = 1 / size
    if corners > 2:
        other = np.linalg.norm(back, axis=2)
        weight = np.linalg.norm(np.cross(ahead, back), axis=2) / (size * other) ** 2
    n = _normals(vertices.ravel(), np.repeat(normals, corners, axis=0), weight.ravel())
    n = n.reshape(x.shape)
    bent = np.einsum("fvd,fvd->f", np.roll(n, -1, axis=1) - n, ahead)
    return np.asarray(bent / 24)  # a segment is gone along twice


def _normals(vertex: IntArray, normals: Array, weights: Array) -> Array:
    """The normal at each corner (C, 3): mean over the vertex's faces on one smooth surface."""
    count = len(vertex)
    _, number = np.unique(vertex, return_inverse=True)
    at = scipy.sparse.csr_matrix((np.ones(count), (np.arange(count), number.ravel())))
    pairs = (at @ at.T).tocoo()
    cosine = np.einsum("nd,nd->n", normals[pairs.row], normals[pairs.col])
    smooth = cosine > np.cos(np.radians(MOST_ANGLE))
    share = weights[pairs.col] * smooth
    mean = scipy.sparse.csr_matrix((share, (pairs.row, pairs.col)), shape=(count, count)) @ normals
    return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))


def _areas(x: Array) -> Array:
    """Areas of faces (F, v, 3); lengths of segments."""
    if x.shape[1] == 2:
        return np.asarray(np.linalg.norm(x[:, 1] - x[:, 0], axis=1))
    one, other = x[:, 1] - x[:, 0], x[:, -1] - x[:, 0]
    if x.shape[1] == 4:
        one, other = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
    return np.asarray(np.linalg.norm(np.cross(one, other), axis=1) / 2)


# -- What the share "model" of an error budget must know of a struck beam.
#
# It is known for straight bars of full rectangular section with a site away from their ends
# (`antiosc.impact.error_budget`), since only these were measured against solids.


#: A section is a full rectangle if 144 I_y I_z is A⁴ within this.
FULL = 0.05
#: Least length and least distance of the site from the ends, over the larger side; largest ratio of
#: the sides; Poisson's ratios.
LENGTH, FROM_ENDS, SIDES, NU = 5.0, 2.0, 2.5, (0.2, 0.4)
#: Largest share of a direction across the one that is meant, and deviation from a straight line
#: over the length.
ALONG, STRAIGHT = 0.02, 1e-6
#: Message where there is no figure.
UNKNOWN = "Not included: the error of the beam model itself, for {}."


def beam_facts(part: MeshedStructure, site: Functional) -> BeamSection | str:
    """Data for the error of beam theory as JSON values, or a sentence why there are none.

    "compliance" is 1/(E √A) [m/N], "omega" the circular frequency at which the section deforms
    [rad/s], "clamps" the number of held ends times the larger side over the length.
    """
    try:
        return _facts(part, site)
    except _Unknown as reason:
        return UNKNOWN.format(reason)


class _Unknown(Exception):
    """Raised with the reason why an error cannot be estimated."""


def _facts(part: MeshedStructure, site: Functional) -> BeamSection:
    assert site.point is not None
    assert site.direction is not None  # or HalvedBeams refuses it
    beam = part.parts[0][0]
    _need(len(part.parts) == 1 and isinstance(beam, Beam), "the part has several sections")
    _need(beam.shear and not beam.offset, "it is measured for Timoshenko's beam on its axis alone")
    section = beam.section
    _need(
        abs(144 * section.I * section.side / section.A**4 - 1) <= FULL,
        "it is measured for full rectangular sections alone (Section.rectangle)",
    )
    axis, ends = _line(part)
    _need(abs(float(site.direction @ axis)) <= ALONG, "the beam is not struck across its axis")
    height = sqrt(12 * section.I / section.A)
    width = section.A / height
    if not _along_height(part, beam, axis, site.direction):
        height, width = width, height
    side, length = max(height, width), float(ends[1] - ends[0])
    _need(length >= LENGTH * side, f"the beam is shorter than {LENGTH:g} times its larger side")
    _need(side <= SIDES * min(height, width), f"one side is more than {SIDES:g} times the other")
    at = float(site.point @ axis)
    _need(
        min(at - ends[0], ends[1] - at) >= FROM_ENDS * side,
        f"the site is nearer to an end than {FROM_ENDS:g} times the larger side",
    )
    _need(NU[0] <= beam.nu <= NU[1], f"it is measured for Poisson's ratios of {NU[0]} to {NU[1]}")
    material = beam.E, beam.nu, beam.rho
    fails = min(
        strip_bending_frequency(width, height, *material),
        thickness_shear_frequency(height, *material),
    )
    return {
        "compliance": 1 / (beam.E * sqrt(section.A)),
        "omega": 2 * pi * fails,
        "clamps": 2.0 * bool(len(part.fixed)) * side / length,
    }


def _need(fact: bool, otherwise: str) -> None:
    if not fact:
        raise _Unknown(otherwise)


def _line(part: MeshedStructure) -> tuple[Array, Array]:
    """(unit vector, places of the ends) along a beam; InputError unless it is one straight line."""
    x = part.mesh.dolfinx.geometry.x
    _, sizes, directions = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)
    _need(sizes[1] <= STRAIGHT * sizes[0], "the beams are not one straight line (joints count)")
    reach = x @ directions[0]
    return directions[0], np.array([reach.min(), reach.max()])


def _along_height(part: MeshedStructure, beam: Beam, axis: Array, direction: Array) -> bool:
    """Whether the section's height lies along the impact; otherwise its width must do so."""
    if part.mesh.gdim == 2 or beam.section.isotropic:
        return True
    nodes = compat.geometry_nodes(part.mesh.dolfinx)[:1]
    middle = part.mesh.dolfinx.geometry.x[nodes].mean(axis=1)
    height = heights(beam, axis[None, :], middle)[0]
    height = height - (height @ axis) * axis
    share = abs(float(height @ direction)) / float(np.linalg.norm(height))
    _need(share <= ALONG or share >= sqrt(1 - ALONG**2), "the impact is not along a side")
    return share > ALONG


#: Message for matrices.
NO_MESH = "the error of a mesh needs the mesh: given matrices have none, so leave error=None."
#: Why the recovery of strains does not tell the errors of other families.
WHY = {
    "beam": (
        "which are compared with a finer mesh: leave error=None and compare two element sizes"
    ),
    "truss": "whose nodes are hinges, so that no mesh could be finer: leave error=None",
}


def estimator(structure: Structure) -> SolidErrors | ShellErrors:
    """The estimator for the structure's element family; InputError if there is none."""
    matrices = on_mesh(structure, NO_MESH)
    if matrices.kind.name in WHY:
        raise InputError(
            f"error='estimate' holds for solids, beams and shells; {matrices.mesh.name} is made of "
            f"{matrices.kind.name} elements, {WHY[matrices.kind.name]}."
        )
    if matrices.mesh.n_cells < 2:
        raise InputError(
            "error='estimate' compares the strains of neighbouring cells, and the mesh has one: "
            "give a smaller size."
        )
    if matrices.kind.sheet:
        return ShellErrors(matrices)
    return SolidErrors(matrices)


# -- What another radius of a site's patch would change in the compliance of the part.
#
# The patch's compliance holds that of its half-space, which is subtracted from Hertz's law. What
# remains does not depend on the radius, as long as it is small against the local thickness and
# resolved by the mesh; a second radius measures how far that holds.


#: The second radius over the first; the other one where the larger patch leaves the face.
RADII = (np.sqrt(2.0), np.sqrt(0.5))
#: Least share of the load of the second patch on its face.
WHOLE_LOAD = 0.99


def patch_of(structure: Structure, site: Functional) -> Patch | None:
    """Data of a site's patch for a budget, as JSON values; None for a point.

    "faces" is the size of the faces under it [m]. Where the patch has a half-space, "radius" is
    that of a second patch [m], and "compliance" the change of the part's compliance beyond the
    half-space [m/N].
    """
    if site.radius is None:
        return None
    assert site.point is not None
    assert site.direction is not None  # where there is a patch
    for factor in RADII:
        place = site.point[None, :], site.direction[None, :], np.array([factor * site.radius])
        found = located(on_mesh(structure), *place)
        facts: Patch = {"faces": float(found.size[0])}
        if found.share[0] >= WHOLE_LOAD:
            break
    if not site.local_compliance or found.share[0] < WHOLE_LOAD or not found.local[0]:
        return facts
    b = found.loads[:, 0].toarray().ravel()
    # bᵀA⁻¹b of both is a difference of two squares: one solve, without cancellation
    apart = structure.factorize().solve_checked((b - site.b)[:, None])[:, 0]
    change = float(dot(structure.comm, apart, b + site.b))
    change -= float(found.local[0]) - site.local_compliance
    return {**facts, "radius": float(found.radii[0]), "compliance": change}


class ModelErrors:
    """The estimators for models of one structure; InputError if there are none."""

    def __init__(self, structure: Structure, named_sites: int = 0) -> None:
        if named_sites:
            raise InputError(
                "error='estimate' is for models of one site: extract each site by itself, or leave "
                "error=None."
            )
        part = on_mesh(structure, NO_MESH)
        self._structure = structure
        self._errors = HalvedBeams(part) if part.kind.name == "beam" else estimator(structure)
        self._geometry, self._layers, self._mass = "", np.zeros(0), 0.0
        self._not_included = ""
        if isinstance(self._errors, HalvedBeams):
            self._not_included = polygon(part.mesh)
        elif isinstance(self._errors, ShellErrors):
            self._not_included = self._errors.faceted
        else:
            refuse_locking(part)
            self._geometry = faceted(part.mesh)
            if self._geometry:
                self._layers, self._mass = layers(part)

    def added_to(self, model: AntiOscillators, site: Functional) -> AntiOscillators:
        """The model with its `strain_error`; `info` gets the further data of the budget."""
        started = time.perf_counter()
        misfit = None
        info = replace(model.info, not_included=self._not_included or None)
        if isinstance(self._errors, HalvedBeams):
            E = self._errors.gram(model, site)
            assert site.point is not None  # or `gram` refuses it
            part = on_mesh(self._structure)
            info = replace(
                info, inside_element=inside(part.mesh, site.point), model=beam_facts(part, site)
            )
        elif isinstance(self._errors, ShellErrors):
            E, misfit = self._errors.gram_and_misfit(_shapes(model))
        else:
            E, outside = self._errors.gram_and_layers(_shapes(model), self._layers)
            info = replace(
                info,
                patch=patch_of(self._structure, site),
                geometry=self._gaps(outside, model.k0 == 0),
            )
        if not isinstance(self._errors, HalvedBeams):
            E = E + _of_state(self._structure, self._errors, _shapes(model), E)
        seconds = {**(info.seconds or {}), "error": time.perf_counter() - started}
        info = replace(info, seconds=seconds)
        return replace(model, strain_error=E, strain_misfit=misfit, info=info)

    def _gaps(self, outside: Array, rigid: bool) -> FacetGaps | None:
        """The energies `outside` of the layers; the first shape may be a rigid motion, without
        energy.
        """
        if not self._geometry:
            return None
        if rigid:
            outside[0] = 0.0
        return {"note": self._geometry, "stiffness": outside.tolist(), "mass": self._mass}


def _of_state(
    structure: Structure, errors: SolidErrors | ShellErrors, shapes: Array, E: Array
) -> Array:
    """Energies by which the error of the static state under a prestress may change those of shapes.

    What the loads add to the stiffness is ∫ N : η(ψ, ψ), a functional of the state q. Its error is
    that of q times that of its dual solution in energy (Becker and Rannacher, Acta Numerica 10
    (2001) 1), whose relative errors are taken to be those of q and of the shape, the larger one.
    """
    preload = structure.matrices.preload
    if preload is None or not preload.q.any():
        return np.zeros_like(E)
    comm, q = structure.comm, preload.q[:, None]
    part = on_mesh(structure).unloaded
    assert part is not None  # of a prestress
    stiffness = dot(comm, shapes, multiply(part.K, shapes))
    added = dot(comm, shapes, multiply(structure.K, shapes)) - stiffness
    off = float(errors.gram(q)[0, 0]) / float(dot(comm, q, multiply(part.K, q))[0, 0])
    own = np.diag(E) / np.maximum(np.diag(stiffness), np.finfo(float).tiny)
    share = (off * np.clip(own, off, 1.0)) ** 0.25
    values, vectors = np.linalg.eigh((added + added.T) / 2)
    return np.asarray(share[:, None] * ((vectors * np.abs(values)) @ vectors.T) * share)


def _shapes(model: AntiOscillators) -> Array:
    assert model.shapes is not None  # of an extraction
    return model.shapes


def layers(part: MeshedStructure) -> tuple[Array, float]:
    """The layers between the faces of this rank and the curved surface that they approximate.

    (volumes (F,) [m³], in the plane areas, negative where the mesh has too much; their mass over
    that of the structure)
    """
    gap, area = mean_gaps(part.faces)
    volumes = gap * area
    heaviness = [material.rho * depth(material) for material, _ in part.parts]
    number = part.part_of_cells()[part.faces.cells]
    mass = part.comm.allreduce(float(volumes @ np.array(heaviness)[number]))
    return volumes, mass / part.total_mass


def depth(material: Material) -> float:
    """Thickness of a plane part; 1 for others, since volumes contain it."""
    return float(material.thickness) if getattr(material, "plane", None) else 1.0
