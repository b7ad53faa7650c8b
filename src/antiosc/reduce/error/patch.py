"""Change of a part's compliance with the radius of a site's patch.

The compliance of a patch contains that of its half-space, which is subtracted from Hertz's law. The
remainder does not depend on the radius if this is small against the local thickness and resolved by
the mesh. A second radius measures the dependence.
"""

from __future__ import annotations

import numpy as np

from antiosc.fem.assembly import with_parts
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.structure.structure import Structure
from antiosc.models.body import PatchData
from antiosc.reduce.site import Functional
from antiosc.reduce.site.doubts import WHOLE_PATCH
from antiosc.reduce.site.sites import Sites, located

#: The second radius over the first, and the ratio used instead if the larger patch leaves the face.
RADII = (np.sqrt(2.0), np.sqrt(0.5))
#: Least share of the load of the second patch on its face.
WHOLE_LOAD = 0.99


def patch_of(structure: Structure, site: Functional) -> PatchData | None:
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
    facts: PatchData = {"faces": float(first.size[0]), "cut": float(first.share[0] < WHOLE_PATCH)}
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
