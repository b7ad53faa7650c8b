"""The anti-oscillator model of several sites: its checks, and its form in free modes."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import block_diag

from antiosc.base import checks
from antiosc.base._types import Array, Index, Numbers
from antiosc.base.errors import InputError
from antiosc.models.parameters import Parameters, in_space
from antiosc.models.reduced_modes import damped_modes, damping_of, rigid_motions, stiffness_scale
from antiosc.models.site_modes import SiteModes, columns_of_sites, unit_vectors

#: Asymmetry of a matrix, and negative eigenvalue, over its size (scaled by its diagonal).
ASYMMETRY = 1e-9


def checked(model: Parameters) -> dict[str, Any]:
    """The parameters of several sites as they are stored; InputError for those outside their range.

    They are sorted by frequency.
    """
    if model.m is not None and np.ndim(model.m) != 3:
        raise InputError("with several sites the inertias are given as P, not as m.")
    if model.P is None:
        raise InputError("several sites need P (p, N), the inertias of the constraint modes.")
    k0 = checks.array("k0", model.k0, (None, None))
    p = len(k0)
    if k0.shape != (p, p):
        raise InputError(f"k0 must be square (p, p); got shape {k0.shape}.")
    m0 = checks.array("m0", model.m0, (p, p))
    omega = checks.positives("omega", model.omega, "rad/s")
    P = checks.array("P", model.P, (p, omega.size))
    order = np.argsort(omega, kind="stable")
    omega, P = omega[order], P[:, order]
    m0 = _semidefinite("m0", m0, np.sqrt(np.abs(m0.diagonal()) + np.sum(P**2, axis=1)))
    k0 = _semidefinite("k0", k0, 1 / stiffness_scale(k0, m0 + P @ P.T, omega))
    if p == 0 or np.any((k0.diagonal() == 0) & (m0.diagonal() == 0) & ~P.any(axis=1)):
        raise InputError("each of the sites needs stiffness or mass, in k0, m0 or P.")
    dependence = np.eye(p) if model.dependence is None else model.dependence
    dependence = checks.array("dependence", dependence, (None, p))
    if not model.columns and len(model.sites) != len(dependence):
        raise InputError(
            f"sites must name the {len(dependence)} columns, or columns say which site has which; "
            f"got {checks.shown(model.sites)}."
        )
    columns = columns_of_sites(model.columns or list(model.sites), len(dependence))
    if tuple(columns) != tuple(model.sites):
        raise InputError(
            f"sites and columns must name the same sites; got {checks.shown(model.sites)} and "
            f"{checks.shown(list(columns))}."
        )
    rows = np.concatenate((np.arange(p), p + order))
    rigid = rigid_motions(k0, m0 + P @ P.T, omega) if model.rigid is None else model.rigid
    rigid = checks.array("rigid", rigid, (p, None))
    hidden = 0 if model.inertia is None else max(0, len(model.inertia.momentum) - rows.size)
    slide = np.zeros((p, hidden)) if model.slide is None else model.slide
    slide = checks.array("slide", slide, (p, None if model.inertia is None else hidden))
    return {
        "k0": checks.kept(k0),
        "m0": checks.kept(m0),
        "m": checks.kept(P.T[:, :, None] * P.T[:, None, :]),
        "omega": checks.kept(omega),
        "P": checks.kept(P),
        "sites": tuple(columns),
        "columns": columns,
        "dependence": checks.kept(dependence),
        "rigid": checks.kept(rigid),
        "slide": checks.kept(slide),
        **_of_sites(model, len(columns)),
        **_directed(model, rows, len(dependence)),
        **in_space(model, rows, slide.shape[1]),
    }


def _semidefinite(name: str, matrix: Array, size: Array) -> Array:
    """`matrix` made symmetric; InputError unless it is symmetric and positive semidefinite.

    Rounding is judged against the square roots `size` (p,) of its usual diagonal.
    """
    unit = matrix / np.where(size > 0, size, 1.0)[:, None] / np.where(size > 0, size, 1.0)
    lowest = np.linalg.eigvalsh((unit + unit.T) / 2).min(initial=0.0)
    if lowest < -ASYMMETRY or np.any(np.abs(unit - unit.T) > ASYMMETRY):
        raise InputError(f"{name} must be symmetric and positive semidefinite.")
    free = matrix.diagonal() <= 0  # but for rounding
    return np.asarray(np.where(free[:, None] | free, 0.0, (matrix + matrix.T) / 2))


def _of_sites(model: Parameters, count: int) -> dict[str, Any]:
    """What each site has of its own: the compliance and the radius of its patch."""
    local = checks.array("local_compliance", model.local_compliance, None)
    if local.shape not in ((), (count,)) or np.any(local < 0):
        raise InputError(f"local_compliance must be {count} numbers >= 0, one for each site.")
    local = np.broadcast_to(local, (count,))
    radii = model.radius if isinstance(model.radius, list | tuple) else [model.radius] * count
    if len(radii) != count:
        raise InputError(f"radius needs one entry for each of {count} sites; got {len(radii)}.")
    radius = tuple(None if r is None else checks.positive("radius", r, "m") for r in radii)
    return {"local_compliance": checks.kept(local), "radius": radius}


def _directed(model: Parameters, rows: Index, columns: int) -> dict[str, Any]:
    """The directions of the columns, and the weights of the shapes, sorted by `rows`."""
    found: dict[str, Any] = {}
    if model.direction is not None:
        directions = checks.array("direction", model.direction, (columns, 3))
        found["direction"] = checks.kept(unit_vectors("direction", directions))
    if model.participation is not None:
        weight = checks.array("participation", model.participation, (rows.size, 3))
        found["participation"] = checks.kept(weight[rows])
    return found


def site_modes(model: Parameters) -> SiteModes:
    """The free modes of a model of several sites, its hidden rigid motions in front."""
    assert model.dependence is not None
    assert model.rigid is not None
    assert model.slide is not None
    p, hidden = model.slide.shape
    found = damped_modes(model, model.k0, model.m0, model.P, model.rigid)
    omega = np.concatenate((np.zeros(hidden), found.omega))
    shape = np.roll(block_diag(found.shape, np.eye(hidden)), hidden, axis=1)
    seen = shape[:p] + np.hstack([model.slide, np.zeros((p, found.omega.size))])
    b = seen.T @ model.dependence.T
    residual = np.vstack((found.residual, np.zeros((hidden, p)))) @ model.dependence.T
    r = model.dependence @ residual[:p]
    inertia = weight = basis = None
    if model.inertia is not None:
        inertia = model.inertia.along(shape.T @ model.inertia.momentum)
    elif model.participation is not None:
        weight = shape[: len(model.participation)].T @ model.participation
    if model.shapes is not None and not (hidden and model.hidden is None):
        basis = (model.shapes, model.hidden) if hidden else (model.shapes,)
    local = dict(zip(model.sites, model.local_compliance.tolist(), strict=True))
    return SiteModes(
        omega=omega,
        b=b,
        sites=model.columns,
        r=(r + r.T) / 2,
        directions=model.direction,
        **damping_of(model, omega, shape),
        inertia=inertia,
        weight=weight,
        shape=shape,
        residual=residual,
        basis=basis,  # type: ignore[arg-type]
        local_compliance={name: value for name, value in local.items() if value},
    )


def with_slide(Z: Numbers, x: Numbers, slide: Array) -> Numbers:
    """Z (..., p, p) at x = omega^2 with the rigid-body motions a = `slide` (p, h) beside.

    That is the inverse of Z^-1 - a a'/x; x has the shape (..., 1, 1).
    """
    if not slide.any():
        return Z
    own = slide[:, slide.any(axis=0)]
    pushed = Z @ own
    small = x * np.eye(own.shape[1]) - own.T @ pushed
    return np.asarray(Z + pushed @ np.linalg.solve(small, np.swapaxes(pushed, -1, -2)))


def mass_shares(model: Parameters) -> Array:
    """tr(m_st^-1 m_i)/p (N,) of a model of several sites."""
    scale = 1 / np.sqrt(np.maximum(model.m_st.diagonal(), np.finfo(float).tiny))
    unit = model.m_st * scale[:, None] * scale
    P = scale[:, None] * model.P
    return np.asarray(np.sum(P * (np.linalg.pinv(unit, hermitian=True) @ P), axis=0) / len(P))


def labels(model: Parameters) -> tuple[str, ...]:
    """Names of the displacements u: of their sites, and which of the directions across it."""
    assert model.dependence is not None
    found = [""] * model.dependence.shape[1]
    for name, columns in model.columns.items():
        for which, column in enumerate(columns):
            own = np.flatnonzero(model.dependence[column])
            if own.size == 1 and model.dependence[column, own[0]] == 1 and not found[own[0]]:
                found[own[0]] = name if which == 0 else f"{name} across {which}"
    return tuple(found)
