"""The error estimates that an extraction with error="estimate" adds to its models.

Solids are judged by a recovery of their strains, beams and sheets by the same mesh with each cell
divided.

The compliance of a patch contains that of its half-space, which is subtracted from Hertz's law. The
remainder does not depend on the radius if this is small against the local thickness and resolved by
the mesh. A second radius measures the dependence.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.assembly import MeshedParts, with_parts
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.parameters import JOINTED
from antiosc.reduce.error.division import Division, too_large
from antiosc.reduce.error.recovery import Recovery
from antiosc.reduce.site import Functional
from antiosc.reduce.site.sites import WHOLE_PATCH, Sites, located

if TYPE_CHECKING:
    from antiosc.fem.assembly.assembled import AssembledMatrices


#: Message for matrices.
NO_MESH = "the error of a mesh needs the mesh: given matrices have none."
TRUSS = "the nodes of a truss are hinges, so that no mesh could be finer."
#: What no mesh tells of.
THEORY = "Not included: the error of {} theory itself."
#: Share of an element within which a site is at its end.
AT_NODE = 1e-3
#: Angles in degrees between neighbours, above rounding and below that of a sharp edge, between
#: which straight cells are taken for a curve.
SMOOTH = 0.2, 40.0


def _solids(matrices: MeshedParts) -> bool:
    """Whether a structure consists of solids alone."""
    if matrices.assembled and cast("AssembledMatrices", matrices).layout.condensed:
        return False
    return all(member.part.kind.outside for member in matrices.members())


def refusal(matrices: MeshedParts) -> str:
    """Why the mesh's error of a structure is not estimated; "" if it is."""
    if not matrices.assembled and matrices.members()[0].part.kind.name == "truss":
        return TRUSS
    if _solids(matrices) and not (matrices.assembled and matrices.preload):
        return ""
    if matrices.assembled:
        return JOINTED
    return too_large(matrices)


class ModelErrors:
    """The estimates of the mesh's error for the models of one structure.

    Attributes
    ----------
    skipped : why the models get no estimate, which their bars tell; "" if they get one.
    """

    def __init__(self, structure: Structure, named_sites: int = 0) -> None:
        if named_sites:
            raise InputError(
                "the error 'estimate' is for models of one site: extract each site by itself."
            )
        self._structure = structure
        self._matrices = with_parts(structure, NO_MESH)
        self.skipped = refusal(self._matrices)
        if self.skipped == TRUSS:
            raise InputError(f"the error 'estimate' is of solids, beams and shells: {TRUSS}")
        if not self.skipped:
            estimator = Recovery if _solids(self._matrices) else Division
            self._estimator: Recovery | Division = estimator(structure)

    def added_to(self, model: AntiOscillators, site: Functional) -> AntiOscillators:
        """The model with its `strain_error`, and with the data of the error budget in `info`."""
        if self.skipped:
            return replace(model, info=replace(model.info, no_estimate=self.skipped))
        start_time = time.perf_counter()
        energies, misfit = self._estimator.energies(model)
        struck = self._matrices.members()[0] if site.place is None else site.place.member
        part = struck.part
        spent = model.info.get("seconds", {})
        info = model.info.having(
            divided=part.mesh.cell if self._estimator.divided else None,
            patch=None if self._estimator.divided else patch_of(self._structure, site),
            inside_element=part.mesh.tdim == 1 and _is_inside(part, site),
            not_included=_left_out(part) or None,
            no_estimate=None,
            seconds={**spent, "error": time.perf_counter() - start_time},
        )
        return replace(model, strain_error=energies, strain_misfit=misfit, info=info)

    def of_cells(self, model: AntiOscillators, weights: Array) -> Array:
        """Energy (cells of this rank,) of the errors of the shapes times `weights` (N + 1, k)."""
        return self._estimator.of_cells(model, weights)


def _left_out(part: MeshedStructure) -> str:
    """What the error of the mesh does not include, in words; "" for straight solids."""
    name = "shell" if part.kind.sheet else part.kind.name
    theory = "" if part.kind.outside else THEORY.format(name)
    return " ".join(filter(None, [theory, flat_cells(part)]))


def _is_inside(part: MeshedStructure, site: Functional) -> bool:
    """Whether a site lies within an element of a beam and not at a node."""
    assert site.point is not None  # lines have no other sites

    ends = part.mesh.geometry.nodes[:, :2]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    distances = np.linalg.norm(ends - site.point, axis=2) / lengths[:, None]
    return bool(distances.min() > AT_NODE)


def flat_cells(part: MeshedStructure) -> str:
    """A sentence if straight cells seem to stand for a curved line or surface; otherwise empty."""
    mesh = part.mesh
    if mesh.order > 1:
        return ""
    dim = mesh.tdim - 1 if part.kind.outside else mesh.tdim
    entities = (
        compat.exterior_facets(mesh.dolfinx)
        if part.kind.outside
        else np.arange(compat.cell_map(mesh.dolfinx).size_local)
    )
    angles = _angles(mesh.dolfinx.geometry.x, compat.entity_vertices(mesh.dolfinx, dim)[entities])
    small = angles[(angles > SMOOTH[0]) & (angles < SMOOTH[1])]
    largest = max(mesh.comm.allgather(float(small.max(initial=0.0))))
    if not largest:
        return ""
    return (
        f"Not included: the straight cells of {mesh.name}, which meet at angles of up to"
        f" {largest:.2g}°, if they stand for a curve; cells of order 2 have it curved."
    )


def _angles(x: Array, corners: IntArray) -> Array:
    """Angles in degrees between lines or faces with these corners (n, v) that share a side, which
    no third one has.
    """
    points = x[corners]
    along = points[:, -1] - points[:, 0]
    if corners.shape[1] > 2:
        along = np.cross(
            along if corners.shape[1] == 4 else points[:, 1] - points[:, 0],
            points[:, 2] - points[:, 1 if corners.shape[1] == 4 else 0],
        )
    unit = along / np.linalg.norm(along, axis=1, keepdims=True)
    places = {2: [[0], [1]], 3: [[0, 1], [0, 2], [1, 2]], 4: [[0, 1], [0, 2], [1, 3], [2, 3]]}
    sides = [corners[:, place] for place in places[corners.shape[1]]]
    keys = np.sort(np.concatenate(sides), axis=1)
    owner = np.tile(np.arange(len(corners)), len(sides))
    _, side, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(side.ravel(), kind="stable")
    pairs = owner[order][np.repeat(count == 2, count)].reshape(-1, 2)
    cosine = np.abs(np.einsum("nd,nd->n", *unit[pairs.T]))
    return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1.0))))


#: The second radius over the first, and the ratio used instead if the larger patch leaves the face.
RADII = (np.sqrt(2.0), np.sqrt(0.5))
#: Least share of the load of the second patch on its face.
WHOLE_LOAD = 0.99


def patch_of(structure: Structure, site: Functional) -> dict[str, float] | None:
    """Data of a site's patch for an error budget, as JSON values; None for a point.

    "faces" is the size of the faces under it [m], "cut" is 1 if an edge cuts it. Of a whole patch
    on a half-space, "radius" is that of a second patch [m], and "compliance" the change of the
    part's compliance beyond the half-space [m/N].
    """
    place = site.place
    if site.radius is None or place is None:
        return None
    matrices = with_parts(structure)
    member = place.member

    def of_radius(radius: float) -> Sites:
        radii = np.array([radius])
        return located(member.part, place.point[None], place.direction[None], radii)

    first = of_radius(site.radius)
    facts = {"faces": float(first.size[0]), "cut": float(first.share[0] < WHOLE_PATCH)}
    if facts["cut"] or not site.local_compliance:
        return facts
    for factor in RADII:
        second = of_radius(factor * site.radius)
        if second.share[0] >= WHOLE_LOAD:
            break
    else:
        return facts
    b = matrices.joined(second.loads[:, 0].toarray().ravel(), member.rows)
    # bᵀA⁻¹b of both is a difference of two squares: one solve, without cancellation
    solution = structure.factorize().solve_checked((b - site.b)[:, None])[:, 0]
    change = float(dot(structure.comm, solution, b + site.b))
    change -= float(second.local[0]) - site.local_compliance
    return {**facts, "radius": float(second.radii[0]), "compliance": change}
