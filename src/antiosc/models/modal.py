"""Every linear body in an impact is a set of free modes with their displacements at its sites.

With mass-normalised free modes q_j, a force F on the contact point along the impact direction
and a gravity g in that direction,

    q_j'' + 2 d_j q_j' + omega_j^2 q_j = b_j F + w_j g,      u = sum_j b_j q_j + r F,

so the receptance is H(omega) = sum_j b_j^2/(omega_j^2 - omega^2) + r when nothing is damped. Any
object whose `modal()` returns a `ModalBody` can take part in an impact (`antiosc.models.body`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike, ComplexArray
from antiosc.base.errors import InputError, warn
from antiosc.base.texts import FieldsRepr, ReprMixin, percent
from antiosc.engine.damping import DampingMatrix
from antiosc.models.motion import Inertia, Motion, unit_vector, unit_vectors

if TYPE_CHECKING:
    from antiosc.engine.first_order import FirstOrder

#: Share of a rigid motion's kinetic energy outside the body's rigid-body modes that is rounding.
MISSED_ENERGY_SHARE = 1e-8
#: Damping ratio above which a warning is given.
UNUSUAL_DAMPING = 0.2
#: Message for a body without a displacement field.
NO_SHAPES_MESSAGE = (
    "this model has no displacement field: it has no shapes (model files do not store them); "
    "extract it again to recover fields."
)


#: a number for one contact point, an array for several
Value: TypeAlias = Any


@dataclass(frozen=True, repr=False)
class Damping(FieldsRepr):
    """Damping of the free modes: decay d_j = ratio_j omega_j + alpha/2 + beta omega_j^2/2 [1/s].

    Parameters
    ----------
    ratio : float or sequence of float
        Damping ratios of the elastic free modes in ascending order, below 1 (0.05 is 5 % of the
        critical damping; above 0.2 there is a warning); the last one applies to all higher modes.
    alpha, beta : float
        Rayleigh coefficients of C = alpha M + beta K [1/s], [s]. beta acts as a dashpot parallel to
        every spring of the model; alpha damps rigid-body motion as well.
    """

    ratio: float | Sequence[float] = 0.0
    alpha: float = 0.0
    beta: float = 0.0

    def __post_init__(self) -> None:
        ratios = checks.column("ratio", self.ratio)
        if not ratios.size or np.any(ratios < 0):
            raise InputError(f"damping ratios must be >= 0; got {checks.shown(self.ratio)}.")

        largest = float(ratios.max())
        if largest >= 1:
            raise InputError(f"a damping ratio must be below 1 (0.05 is 5 %); got {largest:g}.")

        if largest > UNUSUAL_DAMPING:
            warn(
                f"a damping ratio of {largest:g} is {percent(largest)} of the critical damping, "
                f"more than structures have: 0.05 is 5 %."
            )

        checks.store(
            self,
            ratio=float(ratios[0]) if ratios.size == 1 else tuple(ratios.tolist()),
            alpha=checks.nonnegative("alpha", self.alpha, "1/s"),
            beta=checks.nonnegative("beta", self.beta, "s"),
        )

    def decay(self, omega: Array) -> Array:
        """Decay constants d_j [1/s] for ascending circular frequencies, shape (J,)."""
        omega = checks.floats("omega", omega, (None,))
        ratios = checks.column("ratio", self.ratio)
        rigid = int(np.count_nonzero(omega == 0))
        index = np.clip(np.arange(omega.size) - rigid, 0, ratios.size - 1)
        return np.asarray(ratios[index] * omega + self.alpha / 2 + self.beta * omega**2 / 2)

    def as_dict(self) -> dict[str, object]:
        """Constructor arguments as JSON values."""
        return {
            "ratio": np.asarray(self.ratio, dtype=float).tolist(),
            "alpha": float(self.alpha),
            "beta": float(self.beta),
        }


def as_damping(value: float | Sequence[float] | Damping | None) -> Damping | None:
    """`value` as a Damping: from one ratio, a ratio for each mode, a Damping, or None."""
    if value is None or isinstance(value, Damping):
        return value
    return Damping(ratio=value)


@dataclass(frozen=True, init=False, eq=False, repr=False)
class ModalBase(ReprMixin):
    """Common base of bodies with one contact point (`ModalBody`) and with several (`SiteModes`).

    These describe the fields. The arrays of a `ModalBody` have no axis for its one contact point.
    For both, `B`, `R`, `columns` and `axes` are of P >= 1 columns, each one direction at a contact
    point.
    """

    omega: Array
    b: Array
    _: KW_ONLY
    decay: Array | None = None
    weight: Array | None = None
    shape: Array | None = None
    residual: Array | None = None
    basis: tuple[Array, ...] | None = None
    amplitude: Array | None = None
    inertia: Inertia | None = None
    damping: DampingMatrix | None = None

    @property
    def r(self) -> Value:
        """Residual compliance [m/N], (P, P) of several contact points."""
        raise NotImplementedError

    def _check_modes(self, *points: int | None) -> None:
        """Check and store the common attributes; `points`: last axes of `b`, None for any size."""
        omega = checks.floats("omega", self.omega, (None,))
        if np.any(omega < 0):
            raise InputError(f"omega must be >= 0; its least entry is {omega.min():g} rad/s.")

        size = omega.size
        checks.store(self, omega=omega, b=checks.floats("b", self.b, (size, *points)))

        # arrays with their shapes
        self._check("decay", (size,))
        self._check("shape", (None, size))
        count = self._size
        self._check("amplitude", (None, count))
        self._check("residual", (count, *self.b.shape[1:]))
        if self.decay is not None and np.any(self.decay < 0):
            raise InputError("decay must be >= 0: negative damping adds energy.")
        if self.basis is not None:
            checks.store(self, basis=checked_basis(self.basis))

        if self.damping is not None:
            damping = checks.instance("damping", self.damping, DampingMatrix, "a DampingMatrix")
            if damping.n != size or (self.decay is not None and self.decay.any()):
                raise InputError(
                    f"damping needs a matrix of {size} modes and no decay; got one of {damping.n}."
                )

        if self.inertia is not None:
            rows = len(checks.instance("inertia", self.inertia, Inertia, "an Inertia").momentum)
            if rows != size:
                raise InputError(
                    f"inertia.momentum needs one row for each of {size} modes; got {rows}."
                )

    def _check(self, name: str, shape: tuple[int | None, ...]) -> None:
        """Store the attribute `name` as an array of the checked shape; None is kept."""
        if getattr(self, name) is not None:
            checks.store(self, **{name: checks.floats(name, getattr(self, name), shape)})

    @cached_property
    def first_order(self) -> FirstOrder | None:
        """The body in first-order modes if its damping couples the free modes, else None."""
        if self.damping is None:
            return None

        from antiosc.engine.first_order import first_order  # loaded where dampers couple modes

        return first_order(self.omega, self.damping)

    @property
    def _size(self) -> int:
        """Number C of the body's coordinates."""
        if self.shape is None:
            return len(self.omega)
        return len(self.shape)

    @property
    def B(self) -> Array:
        """Displacements (J, P) of the columns in the modes [kg^-1/2]."""
        if self.b.ndim > 1:
            return self.b
        return self.b[:, None]

    @property
    def R(self) -> Array:
        """Residual compliance (P, P) of the columns [m/N]."""
        if self.b.ndim > 1:
            return np.asarray(self.r)
        return np.array([[self.r]])

    @property
    def columns(self) -> dict[str, tuple[int, ...]]:
        """Numbers of the columns of each contact point ("" in a `ModalBody`)."""
        return {"": (0,)}

    @property
    def axes(self) -> Array | None:
        """Unit vectors (P, 3) of the columns; None: unknown."""
        raise NotImplementedError

    def coordinates(self, q: ArrayLike, force: ArrayLike) -> Array:
        """Coordinates (..., C) from modal displacements q (..., J) and column forces (..., P)."""
        q = checks.floats("q", q, None)
        force = checks.floats("force", force, None)
        size, points = self.B.shape
        expected_shape = (*q.shape[:-1], points)
        if q.ndim == 0 or q.shape[-1] != size or force.shape != expected_shape:
            raise InputError(
                f"q must have shape (..., {size}) and force shape (..., {points}); got {q.shape}"
                f" and {force.shape}."
            )

        x = q if self.shape is None else q @ self.shape.T
        if self.residual is None:
            return x
        return np.asarray(x + force @ self.residual.reshape(-1, points).T)

    def amplitudes(self, coordinates: ArrayLike) -> Array:
        """Amplitudes (..., B) of the columns of `basis`, from coordinates (..., C)."""
        x = checks.floats("coordinates", coordinates, None)
        if x.ndim == 0 or x.shape[-1] != self._size:
            raise InputError(f"coordinates must have shape (..., {self._size}); got {x.shape}.")
        if self.amplitude is None:
            return x
        return np.asarray(x @ self.amplitude.T)

    def field(self, coordinates: ArrayLike) -> Array:
        """Displacements (..., n) of the whole body for coordinates (..., C)."""
        if self.basis is None:
            raise InputError(NO_SHAPES_MESSAGE)
        return superposed(self.basis, self.amplitudes(coordinates))

    def receptance(self, omega: ArrayLike) -> ComplexArray:
        """H(omega) = u/F [m/N], damping included; (..., P, P) for several contact points."""
        w = checks.spectrum("omega", omega)[..., np.newaxis]
        first = self.first_order
        if first is None:
            loss = 0.0 if self.decay is None else 2j * self.decay * w
            modal = 1 / (self.omega**2 - w**2 + loss)
            H = np.asarray((self.B.T * modal[..., np.newaxis, :]) @ self.B, dtype=complex)
        else:
            H = first.receptance(self.B, w[..., 0])

        return np.asarray((H if self.b.ndim > 1 else H[..., 0, 0]) + self.r + 0j)

    def rigid_motion(self, velocity: float | Motion) -> Array:
        """Modal velocities (J,) of a rigid-body motion.

        Parameters
        ----------
        velocity : float or Motion
            A number is the velocity of the one column along the impact direction [m/s]. If the
            body is free in this direction, the whole body translates. If supports restrain it, or
            if `inertia` is unknown, the motion is the rigid-body motion of least kinetic energy
            with this velocity of the contact point, phi_CR of the article.

        Raises
        ------
        InputError
            For a body without such a rigid-body motion.
        """
        if isinstance(velocity, Motion):
            return self._rigid_start(velocity)
        velocity = checks.number("velocity", velocity, "m/s")
        if velocity == 0.0:
            return np.zeros(self.omega.size)
        if self.B.shape[1] != 1:
            raise InputError(
                "a number is the velocity of a body of one column; this one has"
                f" {self.B.shape[1]}: give a Motion of velocity and spin."
            )

        rigid_b = np.where(self.omega == 0, self.B[:, 0], 0.0)
        inverse_mass = float(rigid_b @ rigid_b)
        if inverse_mass == 0.0:
            raise InputError(
                f"a velocity of {velocity:g} m/s was asked of a supported body, which has no"
                f" rigid-body motion at its contact point; use 0 or free its supports."
            )

        if self.inertia is not None and self.axes is not None:
            translation = np.concatenate((velocity * self.axes[0], np.zeros(3)))
            start, lost_share = self._rigid_projection(self.inertia, translation)
            if lost_share <= MISSED_ENERGY_SHARE:
                return start

        return np.asarray(velocity * rigid_b / inverse_mass)

    def _rigid_start(self, motion: Motion) -> Array:
        """Modal velocities (J,) of a motion; InputError if supports restrain it."""
        if self.inertia is None:
            raise InputError(
                "this body has no known rigid-body inertia: give its velocity as a number."
            )

        start, lost = self._rigid_projection(self.inertia, motion.at(self.inertia))
        if lost > MISSED_ENERGY_SHARE:
            raise InputError(
                f"the supports restrain the body: the share {lost:.2g} of the kinetic energy of "
                f"{motion} lies outside the rigid-body motions that the supports permit; give a "
                "motion that they permit."
            )

        return start

    def _rigid_projection(self, inertia: Inertia, motion: Array) -> tuple[Array, float]:
        """(modal velocities (J,) of a rigid motion (6,), lost share of its energy)."""
        start = np.where(self.omega == 0, inertia.momentum @ motion, 0.0)
        energy = float(motion @ inertia.matrix @ motion)
        if not np.any(motion):
            return start, 0.0
        return start, abs(1 - float(start @ start) / energy) if energy > 0 else np.inf


@dataclass(frozen=True, eq=False, repr=False)
class ModalBody(ModalBase):
    """A linear body in free modes: q'' + 2 d q' + omega² q = b F, displacement b·q + r F.

    Attributes
    ----------
    omega : (J,) circular frequencies [rad/s]; exactly 0 for rigid-body modes.
    b : (J,) displacement of the contact point in each mass-normalised mode [kg^-1/2]; 0 for hidden
        rigid-body motions, which do not move the contact point.
    r : residual compliance [m/N] >= 0 of the contact point, without inertia.
    decay : (J,) decay constants d [1/s]; None: undamped.
    damping : DampingMatrix if the damping couples the modes, else None.
    weight : (J,) modal force of a unit gravity along the impact direction [kg^1/2]; None: unknown.
    shape, residual : (C, J) and (C,) the transformation to the body's own coordinates,
        x = shape q + residual F; None: the modes are the coordinates.
    basis : displacement shapes of the whole body, blocks (n, .) of columns side by side, on the
        rows of this rank; None: unknown.
    amplitude : (B, C) amplitudes of the B columns of `basis` per unit coordinate; None: each
        coordinate is the amplitude of one column.
    direction : (3,) unit vector along which the contact force pushes; None: unknown.
    inertia : momentum (J, 6) of each mode and the mass of the whole body; None: unknown.
    """

    r: float = 0.0
    direction: Array | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        self._check_modes()
        self._check("weight", self.omega.shape)
        checks.store(self, r=checks.nonnegative("r", self.r, "m/N"))
        if self.direction is not None:
            checks.store(self, direction=unit_vector("direction", self.direction))

    @property
    def axes(self) -> Array | None:
        """The direction of the contact point (1, 3); None if unknown."""
        if self.direction is None:
            return None
        return self.direction[None]

    @cached_property
    def inverse_mass(self) -> float:
        """1 / effective mass [1/kg] at the site: of rigid-body modes, else of the static shape."""
        rigid = self.omega == 0
        b = self.b[rigid]
        if b.any():
            return float((b**2).sum())
        x = self.omega[~rigid] ** 2
        b = self.b[~rigid]
        inertia = float(((b / x) ** 2).sum())
        if inertia > 0:
            return (float((b**2 / x).sum()) + self.r) ** 2 / inertia
        return 0.0

    @cached_property
    def closing(self) -> Array:
        """Displacements (J,) of the contact point opposite to its direction: -b."""
        return -self.b


def unchecked_body(**known: object) -> ModalBody:
    """A `ModalBody` with these attributes, without checks."""
    body = ModalBody.__new__(ModalBody)
    vars(body).update(known)
    return body


def superposed(basis: tuple[Array, ...], amplitudes: Array) -> Array:
    """Displacements (..., n) from amplitudes (..., B) of the columns of `basis`."""
    remaining = amplitudes
    total = np.zeros((*remaining.shape[:-1], len(basis[0])))
    for block in basis:
        size = block.shape[1]
        total += remaining[..., :size] @ block.T
        remaining = remaining[..., size:]

    return total


def checked_basis(basis: object) -> tuple[Array, ...]:
    """`basis` as blocks with equal numbers of rows; large blocks are not copied."""
    blocks = tuple(basis) if isinstance(basis, tuple | list) else ()
    if not blocks or not all(isinstance(b, np.ndarray) and b.ndim == 2 for b in blocks):
        raise InputError(f"basis must list arrays of columns (n, …); got {checks.shown(basis)}.")
    if len({len(b) for b in blocks}) > 1:
        raise InputError("basis must list arrays with one number of rows.")
    return blocks


@dataclass(frozen=True, eq=False, repr=False)
class SiteModes(ModalBase):
    """A linear body in its free modes, with their displacements at several sites.

    With mass-normalised modes q_j and forces f on the columns,

        q_j'' + 2 d_j q_j' + omega_j^2 q_j = sum_c b_jc f_c,      u_c = sum_j b_jc q_j + (r f)_c.

    `omega`, `decay`, `shape`, `basis`, `inertia` and `damping` are those of a `ModalBody`.

    Parameters
    ----------
    b : array_like, shape (J, P)
        Displacement of each column in each mode [kg^-1/2]; 0 for hidden rigid motions.
    sites : mapping or sequence of names
        Columns of each site: first the column along which the contact pushes, then up to two
        tangential columns. With names only, each site has one column, in order.
    r : array_like, shape (P, P), optional
        Residual compliance [m/N], symmetric, positive semidefinite.
    directions : array_like, shape (P, 3), optional
        Unit vectors of the columns, in the axes of the scene.
    weight : array_like, shape (J, 3), optional
        Modal forces of unit gravity along each axis [kg^1/2]; default: from `inertia`.
    residual : array_like, shape (C, P), optional
        Coordinates of the body per force, x = shape q + residual f.
    local_compliance : mapping, optional
        Half-space compliance [m/N] of each site's patch, which the modes contain.

    Raises
    ------
    InputError
        Arrays that do not fit; numbers outside their range.
    """

    sites: Mapping[str, Sequence[int]] | Sequence[str]
    r: Array | None = None
    _: KW_ONLY
    directions: Array | None = None
    local_compliance: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_modes(None)
        modes, count = self.b.shape
        r = np.zeros((count, count)) if self.r is None else self.r
        r = checks.floats("r", r, (count, count))
        size = float(np.abs(r).max(initial=0.0))
        if size and (
            np.abs(r - r.T).max() > 1e-9 * size or np.linalg.eigvalsh(r).min() < -1e-9 * size
        ):
            raise InputError("r must be symmetric and positive semidefinite, as a compliance is.")

        checks.store(self, r=r, sites=columns_of_sites(self.sites, count))
        if self.decay is None:
            checks.store(self, decay=np.zeros(modes))

        if self.directions is not None:
            directions = checks.floats("directions", self.directions, (count, 3))
            checks.store(self, directions=unit_vectors("directions", directions))

        self._check("weight", (modes, 3))
        if self.weight is None and self.inertia is not None:
            checks.store(self, weight=self.inertia.momentum[:, :3])
        if self.basis is not None and sum(shapes.shape[1] for shapes in self.basis) != self._size:
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
        """The directions (P, 3) of the columns; None if unknown."""
        return self.directions


def columns_of_sites(
    sites: Mapping[str, Sequence[int]] | Sequence[str], count: int
) -> dict[str, tuple[int, ...]]:
    """Columns of each site; one column for each if only names are given."""
    kinds = (Mapping, list, tuple)
    checks.instance("sites", sites, kinds, "a list of names, or a dict {name: columns of b}")
    pairs = sites.items() if isinstance(sites, Mapping) else zip(sites, range(count), strict=False)

    columns_by_site = {}
    for name, columns in pairs:
        columns_by_site[checks.name("the name of a site", name)] = tuple(
            checks.whole(f"a column of site {name!r}", i, least=0, most=count - 1)
            for i in checks.column(f"columns of site {name!r}", columns).tolist()
        )

    sizes = {len(columns) for columns in columns_by_site.values()}
    if len(columns_by_site) != len(sites) or not sizes <= {1, 2, 3}:
        raise InputError(
            f"each site has one to three of the {count} columns of b, and a name of its own;"
            f" got {checks.shown(sites)}."
        )

    return columns_by_site
