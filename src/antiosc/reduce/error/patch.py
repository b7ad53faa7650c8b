"""Change of a part's compliance with the radius of a site's patch.

The compliance of a patch contains that of its half-space, which is subtracted from Hertz's law. The
remainder does not depend on the radius if this is small against the local thickness and resolved by
the mesh. A second radius measures the dependence.
"""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.assembly import MeshedParts, with_parts
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.structure.meshed import Member
from antiosc.fem.structure.structure import Structure
from antiosc.models.body import PatchData
from antiosc.reduce.site import Functional
from antiosc.reduce.site.doubts import WHOLE_PATCH
from antiosc.reduce.site.sites import Sites, located

#: The second radius over the first, and the ratio used instead if the larger patch leaves the face.
RADII = (np.sqrt(2.0), np.sqrt(0.5))
#: Those of a patch that an edge cuts: the first of a whole patch that its faces resolve. At 1.5 mm
#: from an edge, with the radii 3 and 1.5 mm, faces of 2 mm gave a quarter of the change of 1.4 mm.
SMALLER = (np.sqrt(0.5), 0.5, 0.25)
#: Least share of the load of the second patch on its face.
WHOLE_LOAD = 0.99


def patch_of(structure: Structure, site: Functional) -> PatchData | None:
    """Data of a site's patch for an error budget, as JSON values; None for a point.

    "faces" is the size of the faces under it [m], "cut" is 1 if an edge cuts it. Where the patch
    has a half-space, "radius" is that of a second patch [m], and "compliance" the change of the
    part's compliance beyond the half-space [m/N].
    """
    if site.radius is None:
        return None
    matrices = with_parts(structure)
    if matrices.assembled and site.part is None:  # that of a superelement
        return None
    member, *_ = matrices.members(site.part if matrices.assembled else None)
    patch_sites = _on_part(matrices, member, site, site.radius)
    is_cut = bool(patch_sites.share[0] < WHOLE_PATCH)
    for factor in SMALLER if is_cut else RADII:
        sites = _on_part(matrices, member, site, factor * site.radius)
        facts: PatchData = {
            "faces": float((patch_sites if is_cut else sites).size[0]),
            "cut": float(is_cut),
        }
        resolved = not is_cut or sites.size[0] <= factor * site.radius
        if resolved and sites.share[0] >= WHOLE_LOAD:
            break
    if (
        not resolved
        or not site.local_compliance
        or sites.share[0] < WHOLE_LOAD
        or not sites.local[0]
    ):
        return facts
    b = _on_q(matrices, member, sites)
    # bᵀA⁻¹b of both is a difference of two squares: one solve, without cancellation
    solution = structure.factorize().solve_checked((b - site.b)[:, None])[:, 0]
    change = float(dot(structure.comm, solution, b + site.b))
    change -= float(sites.local[0]) - site.local_compliance
    return {**facts, "radius": float(sites.radii[0]), "compliance": change}


def _on_part(matrices: MeshedParts, member: Member, site: Functional, radius: float) -> Sites:
    """The site with a patch of this radius on the part that has it."""
    assert site.point is not None
    assert site.direction is not None  # where there is a patch
    point = member.at.own(site.point[None, :])
    direction = (site.direction @ member.at.rotation)[None, :]
    return matrices.decided(lambda: located(member.part, point, direction, np.array([radius])))


def _on_q(matrices: MeshedParts, member: Member, sites: Sites) -> Array:
    """The load vector of a site on this rank's rows of q."""
    b = sites.loads[:, 0].toarray().ravel()
    return matrices.own(matrices.joined(b, member.rows))
