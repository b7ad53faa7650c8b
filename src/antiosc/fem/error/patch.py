"""What another radius of a site's patch would change in the compliance of the part.

The patch's compliance holds that of its half-space, which is subtracted from Hertz's law. What
remains does not depend on the radius, as long as it is small against the local thickness and
resolved by the mesh; a second radius measures how far that holds.
"""

from __future__ import annotations

import numpy as np

from antiosc.fem.linalg.algebra import dot
from antiosc.fem.site.site import Functional
from antiosc.fem.site.sites import located
from antiosc.fem.structure.structure import Structure, on_mesh

#: The second radius over the first; the other one where the larger patch leaves the face.
RADII = (np.sqrt(2.0), np.sqrt(0.5))
#: Least share of the load of the second patch on its face.
WHOLE = 0.99


def second_radius(structure: Structure, site: Functional) -> dict[str, float] | None:
    """{"radius": of a second patch [m], "compliance": change of the compliance [m/N]}.

    The change is that of the part beyond the half-space. None for a site without a half-space.
    """
    if site.radius is None or not site.local_compliance:
        return None
    assert site.point is not None
    assert site.direction is not None  # where there is a patch
    count = len(RADII)
    points, directions = (np.tile(v, (count, 1)) for v in (site.point, site.direction))
    found = located(on_mesh(structure), points, directions, site.radius * np.array(RADII))
    whole = np.flatnonzero((found.share >= WHOLE) & (found.local > 0))
    if not len(whole):
        return None
    at = int(whole[0])
    b = found.loads[:, at].toarray().ravel()
    # bᵀA⁻¹b of both is a difference of two squares: one solve, without cancellation
    apart = structure.factorize().solve_checked((b - site.b)[:, None])[:, 0]
    change = float(dot(structure.comm, apart, b + site.b))
    change -= float(found.local[at]) - site.local_compliance
    return {"radius": float(found.radii[at]), "compliance": change}
