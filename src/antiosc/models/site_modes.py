"""A linear body in its free modes, seen from several sites: what a scene takes of a body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc import checks
from antiosc._types import Array, ComplexArray
from antiosc.brief import Brief
from antiosc.errors import InputError
from antiosc.models.modal import NO_SHAPES, checked_basis, combined
from antiosc.models.motion import Inertia


@dataclass(frozen=True, eq=False, repr=False)
class SiteModes(Brief):
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

    def __post_init__(self) -> None:
        omega = checks.array("omega", self.omega, (None,))
        if np.any(omega < 0):
            raise InputError(f"omega must be >= 0; its least entry is {omega.min():g} rad/s.")
        b = checks.array("b", self.b, (omega.size, None))
        count = b.shape[1]
        r = np.zeros((count, count)) if self.r is None else self.r
        r = checks.array("r", r, (count, count))
        size = float(np.abs(r).max(initial=0.0))
        if size and (
            np.abs(r - r.T).max() > 1e-9 * size or np.linalg.eigvalsh(r).min() < -1e-9 * size
        ):
            raise InputError("r must be symmetric and positive semidefinite, as a compliance is.")
        decay = np.zeros(omega.size) if self.decay is None else self.decay
        decay = checks.array("decay", decay, (omega.size,))
        if np.any(decay < 0):
            raise InputError("decay must be >= 0: negative damping feeds energy in.")
        sites = columns_of_sites(self.sites, count)
        for name, value in (("omega", omega), ("b", b), ("r", r), ("decay", decay)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "sites", sites)
        if self.directions is not None:
            directions = checks.array("directions", self.directions, (count, 3))
            object.__setattr__(self, "directions", unit_vectors("directions", directions))
        if self.inertia is not None:
            checks.instance("inertia", self.inertia, Inertia, "an Inertia")
        if self.inertia is not None and len(self.inertia.momentum) != omega.size:
            raise InputError(
                f"inertia.momentum needs one row for each of the {omega.size} modes;"
                f" got {len(self.inertia.momentum)}."
            )
        self._check_shapes(omega.size, count)

    def _check_shapes(self, modes: int, count: int) -> None:
        """Check what belongs to fields, gravity and patches."""
        if self.weight is not None:
            checks.store(self, weight=checks.array("weight", self.weight, (modes, 3)))
        elif self.inertia is not None:
            checks.store(self, weight=self.inertia.momentum[:, :3])
        if self.shape is not None:
            checks.store(self, shape=checks.array("shape", self.shape, (None, modes)))
        own = modes if self.shape is None else len(self.shape)
        if self.residual is not None:
            checks.store(self, residual=checks.array("residual", self.residual, (own, count)))
        if self.basis is not None:
            basis = checked_basis(self.basis)
            if sum(block.shape[1] for block in basis) != own:
                raise InputError(f"basis needs one column for each of the {own} coordinates.")
            checks.store(self, basis=basis)
        local = self.local_compliance
        checks.instance("local_compliance", local, Mapping, "a dict {name of a site: m/N}")
        unknown = set(local) - set(self.sites)
        if unknown:
            raise InputError(f"local_compliance names {checks.shown(unknown)}, no site.")
        local = {name: checks.nonnegative("local_compliance", local[name], "m/N") for name in local}
        checks.store(self, local_compliance=local)

    def coordinates(self, q: ArrayLike, forces: ArrayLike) -> Array:
        """Own coordinates (..., C) for modal ones (..., J) and forces on the columns (..., P)."""
        q, forces = checks.array("q", q, None), checks.array("forces", forces, None)
        sizes = self.b.shape
        if q.ndim == 0 or q.shape[-1] != sizes[0] or forces.shape != (*q.shape[:-1], sizes[1]):
            raise InputError(
                f"q must have shape (..., {sizes[0]}) and forces (..., {sizes[1]}); got {q.shape} "
                f"and {forces.shape}."
            )
        x = q if self.shape is None else q @ self.shape.T
        return x if self.residual is None else np.asarray(x + forces @ self.residual.T)

    def amplitudes(self, coordinates: ArrayLike) -> Array:
        """Amplitudes (..., C) of the columns of `basis`: the coordinates themselves."""
        return checks.array("coordinates", coordinates, None)

    def field(self, coordinates: ArrayLike) -> Array:
        """Displacements (..., n) of the whole body for own coordinates (..., C)."""
        if self.basis is None:
            raise InputError(NO_SHAPES)
        x = checks.array("coordinates", coordinates, None)
        own = sum(block.shape[1] for block in self.basis)
        if x.ndim == 0 or x.shape[-1] != own:
            raise InputError(f"coordinates must have shape (..., {own}); got {x.shape}.")
        return combined(self.basis, x)

    def receptance(self, omega: ArrayLike) -> ComplexArray:
        """H(omega) (..., P, P) [m/N]: displacements of the columns per force on them, damped."""
        assert self.decay is not None
        assert self.r is not None
        w = checks.spectrum("omega", omega)[..., np.newaxis]
        modal = 1 / (self.omega**2 - w**2 + 2j * self.decay * w)
        return np.asarray((self.b.T * modal[..., np.newaxis, :]) @ self.b + self.r)


def columns_of_sites(sites: Any, count: int) -> dict[str, tuple[int, ...]]:
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


def unit_vectors(name: str, vectors: Array) -> Array:
    """Rows of `vectors` (n, 3) scaled to length 1; InputError for a zero one."""
    length = np.linalg.norm(vectors, axis=1)
    if np.any(length == 0):
        raise InputError(f"{name} must not be a zero vector.")
    return np.asarray(vectors / length[:, None])
