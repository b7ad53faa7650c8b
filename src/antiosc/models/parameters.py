"""Parameters of an anti-oscillator model: checks, derived properties, and the mesh correction.

Displacement elements are too stiff. `softened_model` softens a model by the energies of its strain
errors. Let psi be the shapes of the model, K = diag(k0, k_i) their stiffness and E_ij the energies
of their strain errors. The reduced flexibility

    F = K^-1 + K^-1 E K^-1

equals that of the exact structure to first order: the loads K q are the same, and the strains that
the mesh lacks are added. The corrected model has the anti-oscillators of F with unchanged masses.
The off-diagonal terms of E matter: changing k0 and omega_i one by one gives even the wrong sign.
The first column of F is the static mode; the part of F that remains with the site fixed belongs to
the constraint modes. With k0 = 0 the first shape is a rigid motion, and only the others soften.

Elements that interpolate strains (shells) may be too soft: the work of the section forces on the
change of strains by the interpolation, `strain_misfit` of either sign, is added to E.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike, Index
from antiosc.base.checks import ROUNDING
from antiosc.base.errors import InputError
from antiosc.engine.damping import DampingMatrix, in_coordinates
from antiosc.models.body import Body, ModelInfo
from antiosc.models.modal import Damping, Value, columns_of_sites
from antiosc.models.motion import Inertia, unit_vector, unit_vectors
from antiosc.models.stretch import Stretch

if TYPE_CHECKING:
    from antiosc.models.recurrence import Recurrence

#: Parameters by name, as they are stored.
ParameterDict = dict[str, Any]
#: Parameters that only a model of several sites has, and those of each site.
SEVERAL_SITES_ONLY = ("columns", "dependence", "rigid")
SITE_PARAMETERS = ("direction", "local_compliance", "radius")
#: Asymmetry of a matrix, and negative eigenvalue, over its size (scaled by its diagonal).
LARGEST_ASYMMETRY = 1e-9
#: Negative eigenvalue and asymmetry of unit energies that rounding may leave.
ENERGY_ROUNDING = 1e-8
#: Share of k0 in k0 + s (m0 + P P'), s the lowest omega_i^2, below which a motion is rigid.
RIGID_SHARE = 1e-11


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Parameters(Body):
    """Fields, as `AntiOscillators` describes them, and properties computed by one formula each."""

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
        """Number p of unit-displacement shapes, which come first."""
        return 1 if self.P is None else len(self.P)

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

    # -- of any number of sites p >= 1, in motions of unit mass

    @property
    def k0_matrix(self) -> Array:
        """k0 as a matrix (p, p), also for one site."""
        return np.atleast_2d(self.k0)

    @property
    def m0_matrix(self) -> Array:
        """m0 as a matrix (p, p), also for one site."""
        return np.atleast_2d(self.m0)

    @property
    def inertias(self) -> Array:
        """Inertial couplings P (p, N) [kg^1/2]; √m for one site without a name."""
        if self.P is None:
            return np.sqrt(self.m)[None]
        return self.P

    @property
    def rigid_modes(self) -> Array:
        """Displacements (p, q) of the sites in the rigid-body modes of unit mass that move them."""
        if self.rigid is not None:
            return self.rigid
        return np.full((1, int(self.k0 == 0)), max(self.m_st, np.finfo(float).tiny) ** -0.5)

    @property
    def unit(self) -> Array:
        """Factors (p + N,) that scale `shapes` to unit modal mass; 1 for the p static shapes."""
        if self.P is None:
            return np.append(1.0, 1 / self.inertias[0])
        return np.ones(self.n_sites + self.n)

    @property
    def stiffness(self) -> Array:
        """Stiffness (p + N, p + N) of the `shapes` [N/m]: block_diag(k0, k)."""
        K = np.diag(np.append(np.zeros(self.n_sites), self.omega**2) / self.unit**2)
        K[: self.n_sites, : self.n_sites] = self.k0_matrix
        return K

    @property
    def mass_shares(self) -> Array:
        """Shares m_i/m_st (N,) of the anti-oscillators; tr(m_st^-1 m_i)/p for several sites."""
        P = self.inertias
        static = self.m0_matrix + P @ P.T
        scale = 1 / np.sqrt(np.maximum(static.diagonal(), np.finfo(float).tiny))
        unit = static * scale[:, None] * scale
        P = scale[:, None] * P
        return np.asarray(np.sum(P * (np.linalg.pinv(unit, hermitian=True) @ P), axis=0) / len(P))

    @property
    def labels(self) -> tuple[str, ...]:
        """Names (p,) of the displacements u of several sites; () for one site without a name."""
        if self.dependence is None:
            return ()
        labels: dict[tuple[float, ...], str] = {}
        for name, columns in self.columns.items():
            for k, row in enumerate(self.dependence[list(columns)].tolist()):
                labels.setdefault(tuple(row), f"{name} across {k}" if k else name)
        return tuple(labels.get(tuple(row), "") for row in np.eye(self.n_sites).tolist())


def converted_participation(
    values: Array | None, sites: Sequence[str], sign: float
) -> Array | None:
    """Participation of shapes psi from that of lambda, Article eq. (8); `sign` -1: the reverse."""
    if values is None or sites:
        return values
    values = np.array(values)
    values[0] += sign * values[1:].sum()
    return values


def parameters_by_name(
    sites: Sequence[str], *, k0: Array, m0: Array, P: Array, **of_sites: Any
) -> Any:
    """Parameters of `AntiOscillators` by name. Without `sites` the model has one unnamed site: m
    replaces P, matrices become numbers, and values along axes become values along `direction`."""
    if sites:
        return {"sites": sites, "k0": k0, "m0": m0, "P": P, **of_sites}

    known = {"k0": float(k0[0, 0]), "m0": float(m0[0, 0]), "m": P[0] ** 2}
    one = {name: of_sites[name] for name in SITE_PARAMETERS if of_sites.get(name) is not None}
    weights = of_sites.get("participation")
    if weights is not None:
        known["participation"] = converted_participation(weights @ one["direction"][0], sites, -1.0)
    return known | {name: values[0] for name, values in one.items()}


def checked_parameters(model: Parameters) -> ParameterDict:
    """All parameters of a model, checked and sorted by frequency; InputError for invalid ones."""
    omega = checks.positives("omega", model.omega, "rad/s")
    order = np.argsort(omega, kind="stable")
    several = model.P is not None or len(model.sites) > 0
    stored = (_checked_at_sites if several else _checked_at_one_site)(model, omega, order)
    p = np.atleast_2d(stored["k0"]).shape[0]
    rows = np.concatenate((np.arange(p), p + order))

    # errors of the strains
    if model.strain_misfit is not None and model.strain_error is None:
        raise InputError("strain_misfit belongs to a strain_error, which is missing.")

    for name in ("strain_error", "strain_misfit"):
        value = getattr(model, name)
        if value is not None:
            E = checks.floats(name, value, (rows.size, rows.size))
            sizes, least = np.sqrt(np.abs(E.diagonal())), -ENERGY_ROUNDING * rows.size
            if name == "strain_misfit":  # of either sign
                sizes, least = np.full_like(sizes, np.sqrt(np.abs(E).max())), -np.inf
            E = _checked_symmetric(name, E, sizes, ENERGY_ROUNDING, least)
            stored[name] = checks.read_only(E[np.ix_(rows, rows)])

    # directions, and weights of the shapes along them
    columns = np.shape(stored["dependence"])[:1] if several else ()
    if model.direction is not None:
        directions = checks.floats("direction", model.direction, (*columns, 3))
        unit = unit_vectors if columns else unit_vector
        stored["direction"] = checks.read_only(unit("direction", directions))

    if model.participation is not None:
        axes = (3,) if several else ()
        weight = checks.floats("participation", model.participation, (rows.size, *axes))
        stored["participation"] = checks.read_only(weight[rows])

    return {"omega": checks.read_only(omega[order]), **stored, **_spatial(model, rows)}


def _checked_at_one_site(model: Parameters, omega: Array, order: Index) -> ParameterDict:
    """Checked parameters in the form of one unnamed site; `order`: indices by frequency."""
    for name in SEVERAL_SITES_ONLY:
        value = getattr(model, name)
        if not (value is None or (isinstance(value, dict) and not value)):
            raise InputError(f"{name} belongs to several sites: give P and the names of sites too.")

    m = checks.positives("m", model.m, "kg")
    if m.shape != omega.shape:
        raise InputError(f"m and omega need one length; got {m.size} and {omega.size}.")

    m0 = checks.number("m0", model.m0, "kg")
    total = float(m.sum()) + max(m0, 0.0)
    if m0 < 0 and -m0 <= ROUNDING * total:
        m0 = 0.0
    k0 = checks.nonnegative("k0", model.k0, "N/m")
    checks.nonnegative("m0", m0, "kg")
    if total == 0 and k0 == 0:
        raise InputError(
            "a model with m0 = 0, k0 = 0 and no anti-oscillator has neither mass nor stiffness:"
            " give it one."
        )

    radius = None if model.radius is None else checks.positive("radius", model.radius, "m")

    return {
        "m0": m0,
        "k0": k0,
        "m": checks.read_only(m[order]),
        "local_compliance": checks.nonnegative("local_compliance", model.local_compliance),
        "radius": radius,
    }


def _checked_at_sites(model: Parameters, omega: Array, order: Index) -> ParameterDict:
    """Checked parameters in the form of named sites; `order`: indices by frequency."""
    if model.m is not None and np.ndim(model.m) != 3:
        raise InputError("with several sites the inertias are given as P, not as m.")
    if model.P is None:
        raise InputError("several sites need P (p, N), the inertias of the constraint modes.")
    k0 = checks.floats("k0", model.k0, (None, None))
    p = len(k0)
    if k0.shape != (p, p):
        raise InputError(f"k0 must be square (p, p); got shape {k0.shape}.")
    m0 = checks.floats("m0", model.m0, (p, p))
    P = checks.floats("P", model.P, (p, omega.size))[:, order]
    omega = omega[order]
    sizes = np.sqrt(np.abs(m0.diagonal()) + np.sum(P**2, axis=1))
    m0 = _checked_symmetric("m0", m0, sizes, LARGEST_ASYMMETRY, -LARGEST_ASYMMETRY)
    sizes = 1 / stiffness_scale(k0, m0 + P @ P.T, omega)
    k0 = _checked_symmetric("k0", k0, sizes, LARGEST_ASYMMETRY, -LARGEST_ASYMMETRY)
    if p == 0 or np.any((k0.diagonal() == 0) & (m0.diagonal() == 0) & ~P.any(axis=1)):
        raise InputError("each of the sites needs stiffness or mass, in k0, m0 or P.")

    # names
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

    rigid = rigid_motions(k0, m0 + P @ P.T, omega) if model.rigid is None else model.rigid

    return {
        "k0": checks.read_only(k0),
        "m0": checks.read_only(m0),
        "m": checks.read_only(P.T[:, :, None] * P.T[:, None, :]),
        "P": checks.read_only(P),
        "sites": tuple(columns),
        "columns": columns,
        "dependence": checks.read_only(dependence),
        "rigid": checks.read_only(checks.floats("rigid", rigid, (p, None))),
        **_patch_parameters(model, len(columns)),
    }


def _checked_symmetric(
    name: str, matrix: Array, sizes: Array, asymmetry: float, least: float
) -> Array:
    """Symmetric part of `matrix`; InputError if it is unsymmetric or has an eigenvalue below
    `least`, both after scaling by `sizes` (p,), square roots of its typical diagonal."""
    unit, uneven = checks.scaled_symmetric(matrix, sizes)
    if uneven > asymmetry:
        raise InputError(f"{name} must be symmetric.")
    if np.linalg.eigvalsh(unit).min(initial=0.0) < least:
        raise InputError(f"{name} must be symmetric and positive semidefinite.")
    free = (matrix.diagonal() <= 0) & (least > -np.inf)  # but for rounding
    return np.asarray(np.where(free[:, None] | free, 0.0, (matrix + matrix.T) / 2))


def _patch_parameters(model: Parameters, count: int) -> ParameterDict:
    """`local_compliance` and `radius` by name, checked to be a number for each of `count` sites."""
    local = checks.floats("local_compliance", model.local_compliance, None)
    if local.shape not in ((), (count,)) or np.any(local < 0):
        raise InputError(f"local_compliance must be {count} numbers >= 0, one for each site.")
    local = np.broadcast_to(local, (count,))
    radii = model.radius if isinstance(model.radius, list | tuple) else [model.radius] * count
    if len(radii) != count:
        raise InputError(f"radius needs one entry for each of {count} sites; got {len(radii)}.")
    radius = tuple(None if r is None else checks.positive("radius", r, "m") for r in radii)
    return {"local_compliance": checks.read_only(local), "radius": radius}


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
    """Inverse square roots (p,) of the diagonal of k0 + s m_st; s: lowest omega^2 of the model."""
    mass = np.abs(m_st.diagonal())
    stiffness = np.abs(k0.diagonal())
    s = float(omega[0]) ** 2 if omega.size else 0.0
    if s == 0.0 and np.any(mass > 0):
        s = float(np.max(stiffness[mass > 0] / mass[mass > 0]))
    return np.asarray(1 / np.sqrt(np.maximum(stiffness + s * mass, np.finfo(float).tiny)))


def _spatial(model: Parameters, rows: Index) -> ParameterDict:
    """Checked shapes (in the order `rows`), momenta and hidden motions; InputError if invalid."""
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
    """The damping matrix with anti-oscillators sorted by `omega`, as in a model."""
    n_sites = model.n_sites
    hidden = model.hidden_count
    size = n_sites + model.n + hidden
    if damping.n != size:
        raise InputError(
            f"the damping of this model needs a matrix of its {size} coordinates ({n_sites} of "
            f"sites, {model.n} anti-oscillators, {hidden} hidden motions); got one of {damping.n}."
        )
    if not model.sites and not model.m_st > 0:
        raise InputError("a model without mass has no use for a DampingMatrix: give m0 or m.")

    order = np.argsort(np.asarray(omega, dtype=float), kind="stable")
    if np.array_equal(order, np.arange(order.size)):
        return damping

    of_hidden = np.arange(n_sites + order.size, size)
    rows = np.concatenate((np.arange(n_sites), n_sites + order, of_hidden))

    return in_coordinates(damping, np.eye(size)[:, rows])


ModelType = TypeVar("ModelType", bound=Parameters)

#: Least change of the flexibility of any combination of loads, a share of it.
LEAST_FLEXIBILITY_CHANGE = -0.5
#: Share of an anti-oscillator in the static mass below which its mass is rounding.
MASSLESS_SHARE = 1e-12
#: Message for assemblies whose mesh error is not estimated.
JOINTED_MESSAGE = (
    "the mesh's error is estimated of one mesh and of joined solids, and this is another assembly:"
    " compare with smaller cells, or with a finer deck."
)
#: Message for a model without the errors of its strains.
NO_ESTIMATE_MESSAGE = (
    "the error of the mesh is not known: extract the model from its mesh with the error 'estimate'."
)


def has_error_bars(model: object) -> bool:
    """Whether `strain_error`, `stretch`, `info.measured` or `info.no_estimate` give error bars."""
    if not isinstance(model, Parameters):
        return False
    info = model.info
    known = model.strain_error is not None or model.stretch is not None
    return known or bool(info.measured or info.no_estimate)


def softened_model(model: ModelType) -> ModelType:
    """The model softened by its `strain_error`, as for `AntiOscillators.corrected`."""
    E = model.strain_error
    if E is None:
        reason = model.info.no_estimate
        told = f"the error of the mesh is not known: {reason}"
        raise InputError(told if reason else NO_ESTIMATE_MESSAGE)
    if model.strain_misfit is not None:
        E = E + model.strain_misfit

    # new motions in terms of the old ones; they span the same shapes, so the residual mass stays
    p, unit, P = model.n_sites, model.unit, model.inertias
    E = unit[:, None] * E * unit
    k0, static, omega, Q = _softened(model.k0_matrix, model.rigid_modes.shape[1], model.omega, E)
    static_mass = (model.m0_matrix + P @ P.T).diagonal()
    P = (P + static.T) @ Q
    massive = (MASSLESS_SHARE * static_mass[:, None] < P**2).any(axis=0)
    left_out, P = P[:, ~massive], P[:, massive]
    m0 = model.m0_matrix + left_out @ left_out.T
    motions = np.eye(p + model.n, p + len(P.T))
    motions[p:] = np.hstack([static, Q[:, massive]])

    # the same of the shapes
    transform = unit[:, None] * motions
    if not model.sites:
        transform[:, 1:] *= P[0]
    weights, inertia = converted_participation(model.participation, model.sites, 1.0), model.inertia
    if weights is not None:
        weights = converted_participation(transform.T @ weights, model.sites, -1.0)
    if inertia is not None:
        of_model, hidden = np.split(inertia.momentum, [p + model.n])
        inertia = inertia.along(np.vstack((transform.T @ of_model, hidden)))

    return replace(
        model,
        **parameters_by_name(model.sites, k0=k0, m0=m0, P=P),
        omega=omega[massive],
        participation=weights,
        shapes=None if model.shapes is None else model.shapes @ transform,
        inertia=inertia,
        strain_error=None,
        strain_misfit=None,
        recurrence=None,
    )


def _softened(k0: Array, rigid: int, omega: Array, E: Array) -> tuple[Array, Array, Array, Array]:
    """(k0 (p, p), static shapes in the modes (N, p), omega (N,), modes (N, N)) of a model softened
    by strain error energies E (p + N, p + N), except for `rigid` rigid motions of the sites."""
    from scipy.linalg import block_diag  # takes long to load

    p = len(k0)
    values, vectors = np.linalg.eigh(k0)
    V = vectors[:, rigid:]
    root = block_diag(V / np.sqrt(values[rigid:]), np.diag(1 / omega))

    # the error relative to the energy
    values, vectors = np.linalg.eigh(root.T @ E @ root)
    softened = (vectors * np.maximum(values, LEAST_FLEXIBILITY_CHANGE)) @ vectors.T
    F = root @ (np.eye(len(softened)) + softened) @ root.T
    at_sites = V @ np.linalg.inv(V.T @ F[:p, :p] @ V) @ V.T
    static = F[p:, :p] @ at_sites
    theta, Q = np.linalg.eigh(F[p:, p:] - static @ F[:p, p:])
    return (at_sites + at_sites.T) / 2, static, theta[::-1] ** -0.5, Q[:, ::-1]


def energy_error(model: Parameters, E: Array, weights: Array) -> float:
    """Error energy over strain energy; E: error energies of the shapes, `weights`: Σ a aᵀ with
    their amplitudes a."""
    energy = float(np.sum(weights * model.stiffness))
    if energy > 0:
        return float(np.sum(weights * E)) / energy
    return 0.0
