"""Parameters of an anti-oscillator model: checks, derived properties, and the mesh correction.

`corrected` softens a model by the energies of the errors of its strains. A displacement element is
too stiff. With the shapes psi of a model, K = diag(k0, k_i) their stiffness and E_ij the energies
of the errors of their strains, the reduced flexibility

    F = K^-1 + K^-1 E K^-1

is that of the exact structure to first order: its loads K q stay, and the strains that the mesh
lacks are added. The anti-oscillators of F and of the unchanged masses are the corrected model. The
off-diagonal terms of E matter: k0 and omega_i changed one by one have even the wrong sign. The
first column of F is the static mode; the part of F that remains with the site fixed belongs to the
constraint modes. With k0 = 0 the first shape is a rigid motion, and only the others soften.

Elements that interpolate strains (shells) are too soft by the work of the section forces on the
strains changed by the interpolation: this `strain_misfit`, of either sign, is added to E.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, Index
from antiosc.base.checks import ROUNDING
from antiosc.base.errors import InputError
from antiosc.engine.damping import DampingMatrix, in_coordinates
from antiosc.models.body import Body, ModelInfo, info_of
from antiosc.models.modal import Damping, Value, columns_of_sites
from antiosc.models.motion import Inertia, unit_vector, unit_vectors
from antiosc.models.recurrence import Recurrence
from antiosc.models.stretch import Stretch

#: Parameters by name, as they are stored.
ParameterDict = dict[str, object]
#: Parameters that only a model of several sites has.
OF_SEVERAL = ("columns", "dependence", "rigid")
#: Asymmetry of a matrix, and negative eigenvalue, over its size (scaled by its diagonal).
ASYMMETRY = 1e-9
#: Negative eigenvalue and asymmetry of unit energies that rounding may leave.
ENERGY_ROUNDING = 1e-8
#: Share of k0 in k0 + s (m0 + P P'), s the lowest omega_i^2, below which a motion is rigid.
RIGID_SHARE = 1e-11


@dataclass(frozen=True, eq=False, repr=False)
class Parameters(Body):
    """The fields of `AntiOscillators`, and properties that follow by one formula."""

    m0: Value
    k0: Value
    m: Array = None  # type: ignore[assignment]
    omega: Array = ()  # type: ignore[assignment]
    local_compliance: Value = 0.0
    radius: Value = None
    participation: Array | None = None
    shapes: Array | None = None
    direction: Array | None = None
    inertia: Inertia | None = None
    hidden: Array | None = None
    damping: Damping | DampingMatrix | None = None
    info: ModelInfo = field(default_factory=ModelInfo)
    P: Array | None = None
    sites: tuple[str, ...] = ()
    columns: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    dependence: Array | None = None
    rigid: Array | None = None
    strain_error: Array | None = None
    strain_misfit: Array | None = None
    stretch: Stretch | None = None
    recurrence: Recurrence | None = None

    @property
    def n(self) -> int:
        """Number of anti-oscillators N."""
        return int(self.omega.size)

    @property
    def n_sites(self) -> int:
        """Number of leading shapes, those of unit displacements of sites."""
        if self.sites:
            return len(self.k0)
        return 1

    @property
    def hidden_count(self) -> int:
        """Number of hidden rigid-body motions, which do not move the site."""
        if self.inertia is None:
            return 0
        return len(self.inertia.momentum) - self.n - self.n_sites

    @property
    def k(self) -> Array:
        """Stiffnesses k_i = omega_i^2 m_i [N/m], in the array shape of m. Article eq. (23)."""
        return np.asarray((self.omega**2 * self.m.T).T)

    @property
    def m_st(self) -> Value:
        """Static mass m0 + sum(m_i) [kg], also of free bodies. Article eq. (15)."""
        return self.m0 + self.m.sum(axis=0)

    @property
    def mass_shares(self) -> Array:
        """Shares (N,) of the anti-oscillators in the static mass, m_i/m_st.

        Several sites: tr(m_st^-1 m_i)/p, whatever combinations of the sites are taken.
        """
        if not self.sites:
            return np.asarray(self.m / self.m_st)
        scale = 1 / np.sqrt(np.maximum(self.m_st.diagonal(), np.finfo(float).tiny))
        unit = self.m_st * scale[:, None] * scale
        P = scale[:, None] * self.P
        return np.asarray(np.sum(P * (np.linalg.pinv(unit, hermitian=True) @ P), axis=0) / len(P))

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the displacements u of several sites, (p,); () for one."""
        if self.dependence is None:
            return ()
        labels = [""] * self.dependence.shape[1]
        for name, columns in self.columns.items():
            for k, column in enumerate(columns):
                sites = np.flatnonzero(self.dependence[column])
                if (
                    sites.size == 1
                    and self.dependence[column, sites[0]] == 1
                    and not labels[sites[0]]
                ):
                    labels[sites[0]] = name if k == 0 else f"{name} across {k}"
        return tuple(labels)


def checked_at_one_site(model: Parameters) -> ParameterDict:
    """Check the parameters of one site and sort them by frequency; else InputError."""
    for name in OF_SEVERAL:
        value = getattr(model, name)
        empty = name == "columns" and isinstance(value, dict) and not value
        if not (value is None or empty):
            raise InputError(
                f"{name} belongs to a model of several sites: give its P and the names of its "
                "sites too."
            )
    m = checks.positives("m", model.m, "kg")
    omega = checks.positives("omega", model.omega, "rad/s")
    if m.shape != omega.shape:
        raise InputError(
            f"m and omega must have one entry per anti-oscillator;"
            f" got {m.size} masses and {omega.size} frequencies."
        )
    order = np.argsort(omega, kind="stable")
    m0 = checks.number("m0", model.m0, "kg")
    total = float(m.sum()) + max(m0, 0.0)
    if m0 < 0 and -m0 <= ROUNDING * total:
        m0 = 0.0
    k0 = checks.nonnegative("k0", model.k0, "N/m")
    checks.nonnegative("m0", m0, "kg")
    if total == 0 and k0 == 0:
        raise InputError(
            "a model with m0 = 0, k0 = 0 and no anti-oscillator has neither mass nor "
            "stiffness; give it one."
        )
    columns = np.concatenate(([0], 1 + order))
    stored: ParameterDict = {
        "m0": m0,
        "k0": k0,
        "m": checks.read_only(m[order]),
        "omega": checks.read_only(omega[order]),
        "local_compliance": checks.nonnegative("local_compliance", model.local_compliance),
    }
    if model.radius is not None:
        stored["radius"] = checks.positive("radius", model.radius, "m")
    if model.strain_error is not None:
        energies = checked_energies("strain_error", model.strain_error, columns.size)
        stored["strain_error"] = checks.read_only(energies[np.ix_(columns, columns)])
    if model.strain_misfit is not None:
        if model.strain_error is None:
            raise InputError("strain_misfit belongs to a strain_error, which is missing.")
        work = checked_energies("strain_misfit", model.strain_misfit, columns.size, False)
        stored["strain_misfit"] = checks.read_only(work[np.ix_(columns, columns)])
    return (
        stored | _direction_parameters(model, columns, (), ()) | spatial_parameters(model, columns)
    )


def checked_energies(name: str, energies: Array, size: int, semidefinite: bool = True) -> Array:
    """`energies` (size, size), symmetric, and positive semidefinite if asked; else InputError."""
    E = checks.floats(name, energies, (size, size))
    if semidefinite:
        unit, uneven = checks.scaled_symmetric(E, np.sqrt(np.maximum(np.diag(E), 0.0)))
        smallest_eigenvalue = np.linalg.eigvalsh(unit).min(initial=0.0)
        if uneven > ENERGY_ROUNDING or smallest_eigenvalue < -ENERGY_ROUNDING * size:
            raise InputError(
                f"{name} must be symmetric and positive semidefinite: it holds energies."
            )
    elif np.abs(E - E.T).max(initial=0.0) > ENERGY_ROUNDING * np.abs(E).max(initial=0.0):
        raise InputError(f"{name} must be symmetric.")
    return checks.read_only((E + E.T) / 2)


def checked_at_sites(model: Parameters) -> ParameterDict:
    """Check the parameters of several sites and sort them by frequency; else InputError."""
    if model.m is not None and np.ndim(model.m) != 3:
        raise InputError("with several sites the inertias are given as P, not as m.")
    if model.P is None:
        raise InputError("several sites need P (p, N), the inertias of the constraint modes.")
    k0 = checks.floats("k0", model.k0, (None, None))
    p = len(k0)
    if k0.shape != (p, p):
        raise InputError(f"k0 must be square (p, p); got shape {k0.shape}.")
    m0 = checks.floats("m0", model.m0, (p, p))
    omega = checks.positives("omega", model.omega, "rad/s")
    P = checks.floats("P", model.P, (p, omega.size))
    order = np.argsort(omega, kind="stable")
    omega = omega[order]
    P = P[:, order]
    m0 = _semidefinite("m0", m0, np.sqrt(np.abs(m0.diagonal()) + np.sum(P**2, axis=1)))
    k0 = _semidefinite("k0", k0, 1 / stiffness_scale(k0, m0 + P @ P.T, omega))
    if p == 0 or np.any((k0.diagonal() == 0) & (m0.diagonal() == 0) & ~P.any(axis=1)):
        raise InputError("each of the sites needs stiffness or mass, in k0, m0 or P.")
    dependence = np.eye(p) if model.dependence is None else model.dependence
    dependence = checks.floats("dependence", dependence, (None, p))
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
    rigid = checks.floats("rigid", rigid, (p, None))
    return {
        "k0": checks.read_only(k0),
        "m0": checks.read_only(m0),
        "m": checks.read_only(P.T[:, :, None] * P.T[:, None, :]),
        "omega": checks.read_only(omega),
        "P": checks.read_only(P),
        "sites": tuple(columns),
        "columns": columns,
        "dependence": checks.read_only(dependence),
        "rigid": checks.read_only(rigid),
        **_patch_parameters(model, len(columns)),
        **_direction_parameters(model, rows, (len(dependence),), (3,)),
        **spatial_parameters(model, rows),
    }


def _semidefinite(name: str, matrix: Array, size: Array) -> Array:
    """Symmetrise `matrix`; InputError unless it is symmetric and positive semidefinite.

    The square roots `size` (p,) of its usual diagonal scale the rounding that is accepted.
    """
    unit, uneven = checks.scaled_symmetric(matrix, size)
    if uneven > ASYMMETRY or np.linalg.eigvalsh(unit).min(initial=0.0) < -ASYMMETRY:
        raise InputError(f"{name} must be symmetric and positive semidefinite.")
    free = matrix.diagonal() <= 0  # but for rounding
    return np.asarray(np.where(free[:, None] | free, 0.0, (matrix + matrix.T) / 2))


def _patch_parameters(model: Parameters, count: int) -> ParameterDict:
    """(compliance, radius) of the patch of each of `count` sites."""
    local = checks.floats("local_compliance", model.local_compliance, None)
    if local.shape not in ((), (count,)) or np.any(local < 0):
        raise InputError(f"local_compliance must be {count} numbers >= 0, one for each site.")
    local = np.broadcast_to(local, (count,))
    radii = model.radius if isinstance(model.radius, list | tuple) else [model.radius] * count
    if len(radii) != count:
        raise InputError(f"radius needs one entry for each of {count} sites; got {len(radii)}.")
    radius = tuple(None if r is None else checks.positive("radius", r, "m") for r in radii)
    return {"local_compliance": checks.read_only(local), "radius": radius}


def _direction_parameters(
    model: Parameters, rows: Index, columns: tuple[int, ...], axes: tuple[int, ...]
) -> ParameterDict:
    """Directions (*columns, 3) and sorted weights (rows, *axes) of the shapes."""
    stored: ParameterDict = {}
    if model.direction is not None:
        directions = checks.floats("direction", model.direction, (*columns, 3))
        unit = unit_vectors if columns else unit_vector
        stored["direction"] = checks.read_only(unit("direction", directions))
    if model.participation is not None:
        weight = checks.floats("participation", model.participation, (rows.size, *axes))
        stored["participation"] = checks.read_only(weight[rows])
    return stored


def rigid_motions(k0: Array, m_st: Array, omega: Array) -> Array:
    """Displacements (p, q) of the sites in the rigid-body modes of unit mass that k0 permits."""
    scale = stiffness_scale(k0, m_st, omega)
    stiff = k0 * scale[:, None] * scale
    values, vectors = np.linalg.eigh((stiff + stiff.T) / 2)
    free = scale[:, None] * vectors[:, np.abs(values) < RIGID_SHARE]
    mass = free.T @ m_st @ free
    root = np.linalg.cholesky(mass) if mass.size else mass
    return np.asarray(np.linalg.solve(root, free.T).T)


def stiffness_scale(k0: Array, m_st: Array, omega: Array) -> Array:
    """1/sqrt (p,) of the diagonal of k0 + s m_st, s the lowest omega^2 of the model."""
    mass = np.abs(m_st.diagonal())
    stiffness = np.abs(k0.diagonal())
    s = float(omega[0]) ** 2 if omega.size else 0.0
    if s == 0.0 and np.any(mass > 0):
        s = float(np.max(stiffness[mass > 0] / mass[mass > 0]))
    return np.asarray(1 / np.sqrt(np.maximum(stiffness + s * mass, np.finfo(float).tiny)))


def spatial_parameters(model: Parameters, rows: Index) -> ParameterDict:
    """Check shapes, momenta and hidden motions and sort the shapes by `rows`; else InputError.

    The momenta of the hidden motions follow those of the shapes.
    """
    stored: ParameterDict = {}
    in_order = np.array_equal(rows, np.arange(rows.size))
    if model.shapes is not None:
        shapes = checks.floats("shapes", model.shapes, (None, rows.size))
        stored["shapes"] = shapes if in_order else shapes[:, rows]
    if model.inertia is not None:
        momentum = checks.instance("inertia", model.inertia, Inertia, "an Inertia").momentum
        if len(momentum) < rows.size:
            raise InputError(
                f"inertia.momentum needs a row for each of psi_0 ... psi_{rows.size - 1}, "
                f"{rows.size} shapes, and one for each hidden motion; got {len(momentum)}."
            )
        all_rows = np.concatenate((rows, np.arange(rows.size, len(momentum))))
        stored["inertia"] = model.inertia if in_order else model.inertia.along(momentum[all_rows])
    if model.hidden is not None:
        if model.inertia is None:
            raise InputError("hidden motions need the inertia, which holds their momentum.")
        slides = len(model.inertia.momentum) - rows.size
        nodes = None if model.shapes is None else len(model.shapes)
        stored["hidden"] = checks.floats("hidden", model.hidden, (nodes, slides))
    return stored


def sorted_damping(model: Parameters, damping: DampingMatrix, omega: ArrayLike) -> DampingMatrix:
    """The damping matrix with the modes in the order in which a model sorts its frequencies."""
    n_sites = model.n_sites
    hidden = model.hidden_count
    size = n_sites + model.n + hidden
    if damping.n != size:
        raise InputError(
            f"the damping of this model needs a matrix of its {size} coordinates ({n_sites} of "
            f"sites, {model.n} anti-oscillators, {hidden} hidden motions); got one of {damping.n}."
        )
    if not model.sites and not model.m_st > 0:
        raise InputError(
            "a model without mass has no motions that a DampingMatrix could brake: give it a mass,"
            " m0 or m."
        )
    order = np.argsort(np.asarray(omega, dtype=float), kind="stable")
    if np.array_equal(order, np.arange(order.size)):
        return damping
    rows = np.concatenate(
        (
            np.arange(n_sites),
            n_sites + order,
            np.arange(n_sites + order.size, size),
        )
    )
    return in_coordinates(damping, np.eye(size)[:, rows])


ModelType = TypeVar("ModelType", bound=Parameters)

#: Least change of the flexibility of any combination of loads, a share of it.
LEAST_CHANGE = -0.5
#: Share of an anti-oscillator in the static mass below which its mass is rounding.
MASSLESS_SHARE = 1e-12
#: Message for assemblies.
JOINTED = (
    "the mesh's error is estimated of one mesh and of joined solids, and this is another assembly:"
    " compare with smaller cells, or with a finer deck."
)
#: Message for a model without the errors of its strains.
NO_ESTIMATE = (
    "the error of the mesh is not known: extract the model from its mesh with the error 'estimate'."
)


def has_bars(model: object) -> bool:
    """Whether impacts on a model have error bars: a known error of the mesh, or the reason why it
    is not known, noise of a measurement, or second-order modes.
    """
    if not isinstance(model, Parameters):
        return False
    info = model.info
    known = model.strain_error is not None or model.stretch is not None
    return known or bool(info.measured or info.no_estimate)


def no_estimate(model: object) -> str:
    """Message for a model without an estimate of its mesh error, with the remedy that works."""
    reason = info_of(model).no_estimate
    return f"the error of the mesh is not known: {reason}" if reason else NO_ESTIMATE


def corrected(model: ModelType) -> ModelType:
    """The softened model; see `AntiOscillators.corrected`."""
    E = model.strain_error
    if E is None:
        raise InputError(no_estimate(model))
    if model.strain_misfit is not None:
        E = E + model.strain_misfit
    k0, static, omega, Q = _softened(model.k0, model.m, model.omega, E)
    # amplitudes of the modes of unit mass, and their inertia against the static mode; they span the
    # same shapes, and so the residual mass stays
    unit = Q / np.sqrt(model.m)[:, None]
    c = unit.T @ (model.m * static)
    transform = np.zeros((model.n + 1, model.n + 1))  # the new shapes in terms of the old ones
    transform[0, 0] = 1.0
    transform[1:, 0] = static - 1
    transform[1:, 1:] = unit * c
    massive = c**2 > MASSLESS_SHARE * (model.m0 + model.m.sum())
    transform = transform[:, np.append(True, massive)]
    p = model.participation
    inertia = model.inertia
    if p is not None:  # psi_0 is what moves with m0 and all psi_i
        p = transform.T @ np.append(p.sum(), p[1:])
        p[0] -= p[1:].sum()
    if inertia is not None:
        of_model, hidden = np.split(inertia.momentum, [model.n + 1])
        inertia = inertia.along(np.vstack((transform.T @ of_model, hidden)))
    return replace(
        model,
        m0=model.m0 + float(np.sum(c[~massive] ** 2)),
        k0=k0,
        m=c[massive] ** 2,
        omega=omega[massive],
        participation=p,
        shapes=None if model.shapes is None else model.shapes @ transform,
        inertia=inertia,
        strain_error=None,
        strain_misfit=None,
        recurrence=None,
    )


def _softened(k0: float, m: Array, omega: Array, E: Array) -> tuple[float, Array, Array, Array]:
    """(k0, 1 + amplitudes of psi_i in the static mode (N,), omega (N,), modes (N, N)) after
    softening.

    The modes are columns of unit length, of amplitudes times sqrt(m_i).
    """
    scale = np.append(0.0, 1 / (omega * np.sqrt(m)))
    if k0 > 0:
        scale[0] = k0**-0.5
    values, vectors = np.linalg.eigh(scale[:, None] * E * scale)
    # the error relative to the energy
    softened = (vectors * np.maximum(values, LEAST_CHANGE)) @ vectors.T
    F = scale[:, None] * (np.eye(len(scale)) + softened) * scale
    static = np.zeros(len(m))
    constrained = F[1:, 1:]
    if k0 > 0:
        static = F[1:, 0] / F[0, 0]
        constrained = constrained - np.outer(F[1:, 0], static)
        k0 = 1 / float(F[0, 0])
    root = np.sqrt(m)
    theta, Q = np.linalg.eigh(root[:, None] * constrained * root)
    return k0, 1 + static, theta[::-1] ** -0.5, Q[:, ::-1]


def energy_error(model: Parameters, E: Array, weights: Array) -> float:
    """Share of the strain energy that is due to the strain errors E (N + 1, N + 1).

    weights : (N + 1, N + 1), sum of a aᵀ of the amplitudes a of psi_0 ... psi_N.
    """
    energy = float(np.diag(weights) @ np.append(model.k0, model.k))
    if energy > 0:
        return float(np.sum(weights * E)) / energy
    return 0.0
