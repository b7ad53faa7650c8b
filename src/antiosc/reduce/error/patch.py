"""Change of a part's compliance with the radius of a site's patch.

The compliance of a patch contains that of its half-space, which is subtracted from Hertz's law. The
remainder does not depend on the radius if this is small against the local thickness and resolved by
the mesh. A second radius measures the dependence.
"""

from __future__ import annotations

import numpy as np

from antiosc.fem.linalg.algebra import dot
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.models.body import PatchData
from antiosc.reduce.site import Functional
from antiosc.reduce.site.doubts import WHOLE_PATCH
from antiosc.reduce.site.sites import located

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
    assert site.point is not None
    assert site.direction is not None  # where there is a patch
    place = site.point[None, :], site.direction[None, :]
    patch_sites = located(on_mesh(structure), *place, np.array([site.radius]))
    is_cut = bool(patch_sites.share[0] < WHOLE_PATCH)
    for factor in SMALLER if is_cut else RADII:
        sites = located(on_mesh(structure), *place, np.array([factor * site.radius]))
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
    b = sites.loads[:, 0].toarray().ravel()
    # bᵀA⁻¹b of both is a difference of two squares: one solve, without cancellation
    solution = structure.factorize().solve_checked((b - site.b)[:, None])[:, 0]
    change = float(dot(structure.comm, solution, b + site.b))
    change -= float(sites.local[0]) - site.local_compliance
    return {**facts, "radius": float(sites.radii[0]), "compliance": change}
