"""A linear body in its free modes, seen from several sites: what a scene takes of a body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.damping_matrix import DampingMatrix
from antiosc.models.modal import FreeModes
from antiosc.models.motion import Inertia, unit_vectors


@dataclass(frozen=True, eq=False, repr=False)
class SiteModes(FreeModes):
    """A linear body in its free modes, seen from several sites.

    With mass-normalised modes q_j and forces f on the columns,

        q_j'' + 2 d_j q_j' + omega_j^2 q_j = sum_c b_jc f_c,      u_c = sum_j b_jc q_j + (r f)_c.

    Parameters
    ----------
    omega : array_like, shape (J,)
        Circular frequencies [rad/s]; exactly 0 for rigid-body modes.
    b : array_like, shape (J, P)
        Displacement of each column in each mode [kg^-1/2]; 0 for hidden rigid motions.
    sites : mapping or sequence of names
        Columns of each site, the one along which the contact pushes first, then up to two
        tangential ones; names alone: one column each, in order.
    r : array_like, shape (P, P), optional
        Residual compliance [m/N], symmetric, positive semidefinite.
    directions : array_like, shape (P, 3), optional
        Unit vectors of the columns, in the axes of the scene.
    decay : array_like, shape (J,), optional
        Decay constants [1/s].
    inertia : Inertia, optional
        Momentum (J, 6) of each mode: for gravity, `Motion` and momentum.
    weight : array_like, shape (J, 3), optional
        Modal forces of unit gravities along the axes [kg^1/2]; default: those of the inertia.
    shape, residual : array_like, shapes (C, J) and (C, P), optional
        The transformation to the body's own coordinates, x = shape q + residual f; None: the modes
        are the coordinates.
    basis : sequence of arrays (n, .), optional
        Displacement shapes of the whole body on the rows of this rank, one column for each
        coordinate.
    local_compliance : mapping, optional
        Half-space compliance [m/N] of the patch of each site, which the modes contain.
    damping : DampingMatrix, optional
        Of the modes, in place of `decay`, where the damping couples them.

    Raises
    ------
    InputError
        For shapes that do not fit and numbers outside their range.
    """

    omega: Array
    b: Array
    sites: Mapping[str, Sequence[int]] | Sequence[str]
    r: Array | None = None
    directions: Array | None = None
    decay: Array | None = None
    inertia: Inertia | None = None
    weight: Array | None = None
    shape: Array | None = None
    residual: Array | None = None
    basis: tuple[Array, ...] | None = None
    local_compliance: Mapping[str, float] = field(default_factory=dict)
    damping: DampingMatrix | None = None

    def __post_init__(self) -> None:
        self._check_modes(None)
        modes, count = self.b.shape
        r = np.zeros((count, count)) if self.r is None else self.r
        r = checks.array("r", r, (count, count))
        size = float(np.abs(r).max(initial=0.0))
        if size and (
            np.abs(r - r.T).max() > 1e-9 * size or np.linalg.eigvalsh(r).min() < -1e-9 * size
        ):
            raise InputError("r must be symmetric and positive semidefinite, as a compliance is.")
        checks.store(self, r=r, sites=columns_of_sites(self.sites, count))
        if self.decay is None:
            checks.store(self, decay=np.zeros(modes))
        if self.directions is not None:
            directions = checks.array("directions", self.directions, (count, 3))
            checks.store(self, directions=unit_vectors("directions", directions))
        if self.weight is not None:
            checks.store(self, weight=checks.array("weight", self.weight, (modes, 3)))
        elif self.inertia is not None:
            checks.store(self, weight=self.inertia.momentum[:, :3])
        if self.basis is not None and sum(each.shape[1] for each in self.basis) != self._size:
            raise InputError(f"basis needs one column for each of the {self._size} coordinates.")
        local = self.local_compliance
        checks.instance("local_compliance", local, Mapping, "a dict {name of a site: m/N}")
        unknown = set(local) - set(self.sites)
        if unknown:
            raise InputError(f"local_compliance names {checks.shown(unknown)}, no site.")
        local = {name: checks.nonnegative("local_compliance", local[name], "m/N") for name in local}
        checks.store(self, local_compliance=local)

    @property
    def columns(self) -> dict[str, tuple[int, ...]]:
        """The columns of each site."""
        return dict(self.sites)  # type: ignore[arg-type]

    @property
    def axes(self) -> Array | None:
        """The directions, (P, 3)."""
        return self.directions


def columns_of_sites(
    sites: Mapping[str, Sequence[int]] | Sequence[str], count: int
) -> dict[str, tuple[int, ...]]:
    """Columns of each site; one column each where names alone are given."""
    kinds = (Mapping, list, tuple)
    checks.instance("sites", sites, kinds, "a list of names, or a dict {name: columns of b}")
    named = sites.items() if isinstance(sites, Mapping) else zip(sites, range(count), strict=False)
    found = {}
    for name, columns in named:
        found[checks.text("the name of a site", name)] = tuple(
            checks.whole(f"a column of site {name!r}", i, least=0, most=count - 1)
            for i in checks.column(f"columns of site {name!r}", columns).tolist()
        )
    if len(found) != len(sites) or any(not 1 <= len(c) <= 3 for c in found.values()):
        raise InputError(
            f"each site has one to three of the {count} columns of b, and a name of its own;"
            f" got {checks.shown(sites)}."
        )
    return found
