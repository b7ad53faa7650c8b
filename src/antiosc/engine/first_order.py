"""First-order modes: pairs of poles of a body whose damping couples its free modes.

Let q be the undamped free modes, v their rates, D = L0' L0 and G_k = L_k' L_k the damping and the
branches with the states xi_k = L_k z_k. Then

    q' = v,   v' = -(Omega^2 + sum G_k) q - D v + sum L_k' xi_k + f,   xi_k' = (L_k q - xi_k)/tau_k,

or y' = A y + e f. With J = [[D, 1, 0], [1, 0, 0], [0, 0, tau]] both J and J A are symmetric and
J e = (1, 0, 0): the eigenvectors Y of A are orthogonal in J, and with Y'JY = 1 the receptance is
sum Y_q Y_q'/(s - lambda). Two conjugate poles, or a slower real one of positive and a faster one of
negative Y'JY, are one mode of real numbers (a, b),

    a' = b + c_b f,      b' = -w^2 a - 2 d b + (c_a - 2 d c_b) f,      u = c_a a + c_b b,

with the frequency w = sqrt(l1 l2) and the decay 2 d = -(l1 + l2) of an oscillator, and hence its
responses; c_b = 0 for an undamped mode. With T = [[2 d, 1], [1, 0]] of all modes and the shapes S
(c_a, c_b) of all states, S'JS = T, y = S (a, b), (a, b) = T^-1 S'J y. A real pole without a partner
is paired with a pole of zero share.

P. Lancaster, *Lambda-Matrices and Vibrating Systems*, 1966; A. Veletsos, C. Ventura, *Earthquake
Eng. Struct. Dyn.* 14 (1986) 217.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array, BoolArray, ComplexArray, Numbers
from antiosc.base.errors import AccuracyError
from antiosc.engine.damping import DampingMatrix, from_factors, in_coordinates

#: Shares of the largest modal damping below which a mode, or a rigid-body motion, is undamped.
UNDAMPED_SHARE, UNDAMPED_RIGID_SHARE = 1e-24, 1e-12
#: Poles closer than this, relatively, are one repeated pole.
REPEATED_DISTANCE = 1e-10
#: Distance of neighbouring real poles, relatively, below which they are of one cluster.
CLUSTER_DISTANCE = 0.05
#: Relative singular value of a branch's factor below which the direction has no spring.
SPRINGLESS_SHARE = 1e-9
#: Relative error of the receptance of first-order modes up to which they are used as they are, and
#: the largest one that is accepted if no other way has a smaller one.
EXACT_ERROR, MAX_ERROR = 1e-7, 1e-4
#: Relative change of a damping that has a double pole.
DAMPING_CHANGE = 1e-7


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """The first-order modes of a body, with states (a, b) as in this module's docstring."""

    #: omega, decay: (I,) w [rad/s] and d [1/s] of the modes
    omega: Array
    decay: Array
    #: at_q, at_v: (J, 2 I) displacements and rates of the free modes by (a, b)
    at_q: Array
    at_v: Array
    deceleration: Array  # (J, 2 I) decelerations of the free modes by the damping
    #: (2 I, 2 J) the (a, b) of displacements and rates of a body whose branches are relaxed
    state_of_motion: Array
    #: for each branch (J, 2 I): displacements q - z of its spring by (a, b)
    spring_shapes: Sequence[Array]

    def receptance(self, b: Array, omega: Numbers) -> ComplexArray:
        """b'(dynamic stiffness)^-1 b, (..., P, P), for b (J, P) at `omega` (...) [rad/s]."""
        s = 1j * omega[..., None]
        size = self.omega.size
        b_at_q = self.at_q[:, :size].T @ b
        b_at_v = self.at_q[:, size:].T @ b
        receptances = 1 / (s**2 + 2 * self.decay * s + self.omega**2)
        undamped = b_at_q - 2 * self.decay[:, None] * b_at_v
        a = receptances[..., None] * (b_at_v * s[..., None] + b_at_q)
        rate = receptances[..., None] * (
            undamped * s[..., None] - (self.omega**2)[:, None] * b_at_v
        )

        return np.asarray(b_at_q.T @ a + b_at_v.T @ rate)


@dataclass(eq=False)
class StackedModes:
    """The modes of several bodies side by side, some of which have first-order modes."""

    #: of each body: omega and decay (J,) of its free modes; its I first-order modes, or None; their
    #: states (a, b) (2, I) at the start, or None: as its displacements and velocities have them
    parts: Sequence[tuple[Array, Array, FirstOrder | None, Array | None]]

    def __post_init__(self) -> None:
        integrated = [
            (w, d) if first is None else (first.omega, first.decay) for w, d, first, _ in self.parts
        ]
        self.omega = np.concatenate([w for w, _ in integrated])
        self.decay = np.concatenate([d for _, d in integrated])
        self.free = sum(w.size for w, *_ in self.parts)

    def _spans(self) -> Iterator[tuple[slice, slice, Array, FirstOrder | None]]:
        """Yield (slice of free modes, slice of states, decays, first-order modes) of each body."""
        j = i = 0
        for w, d, first, _ in self.parts:
            size = w.size if first is None else first.omega.size
            yield slice(j, j + w.size), slice(i, i + size), d, first
            j = j + w.size
            i = i + size

    def rows(self, values: Array) -> Array:
        """Project functionals (n, J) of the displacements on the first-order states: (n, 2 I)."""
        size = self.omega.size
        rows_of_modes = np.zeros((len(values), 2, size))
        for free, span, _, first in self._spans():
            if first is None:
                rows_of_modes[:, 0, span] = values[:, free]
            else:
                projected = values[:, free] @ first.at_q
                rows_of_modes[:, :, span] = projected.reshape(-1, 2, first.omega.size)

        return rows_of_modes.reshape(len(values), 2 * size)

    def state(self, q: Array, v: Array) -> Array:
        """First-order states (2, I) for displacements and velocities (J,) of the free modes."""
        states = np.zeros((2, self.omega.size))
        for (free, span, _, first), (*_, start_state) in zip(
            self._spans(), self.parts, strict=True
        ):
            if start_state is not None:
                states[:, span] = start_state
            elif first is None:
                states[0, span] = q[free]
                states[1, span] = v[free]
            elif q[free].any() or v[free].any():
                state = np.concatenate((q[free], v[free]))
                states[:, span] = (first.state_of_motion @ state).reshape(2, -1)

        return states

    def motion(self, a: Array, b: Array) -> tuple[Array, Array, Array]:
        """Displacements, velocities, damping decelerations (n, J) of free modes; a, b: (n, I)."""
        q, v, deceleration = (np.empty((len(a), self.free)) for _ in range(3))
        for free, span, d, first in self._spans():
            if first is None:
                q[:, free] = a[:, span]
                v[:, free] = b[:, span]
                deceleration[:, free] = 2 * d * b[:, span]
                continue
            states = np.hstack([a[:, span], b[:, span]])
            q[:, free] = states @ first.at_q.T
            v[:, free] = states @ first.at_v.T
            deceleration[:, free] = states @ first.deceleration.T

        return q, v, deceleration

    def springs(self, a: Array, b: Array) -> list[list[Array]]:
        """Displacements (n, J) of the spring of each Maxwell branch, body after body."""
        springs = []
        for _, span, _, first in self._spans():
            states = np.hstack([a[:, span], b[:, span]])
            branches = [] if first is None else first.spring_shapes
            springs.append([states @ at_spring.T for at_spring in branches])
        return springs

    @property
    def undamped(self) -> BoolArray:
        """Whether each free mode (J,) is undamped."""
        undamped = []
        for _, decay, first, _ in self.parts:
            undamped.append(decay == 0 if first is None else ~first.deceleration.any(axis=1))
        return np.concatenate(undamped)


def first_order(omega: Array, damping: DampingMatrix) -> FirstOrder:
    """The first-order modes of a body with free modes (J,) and this damping.

    A double pole has no such modes: the damping is then changed by `DAMPING_CHANGE`. AccuracyError
    if rounding causes an error of their receptance above `MAX_ERROR`.
    """
    worst = np.inf
    best = None
    for change in (0.0, DAMPING_CHANGE, -DAMPING_CHANGE):
        root = np.sqrt(1 + change)
        nudged = from_factors(
            root * damping.factor, [(root * L, tau) for L, tau in damping.factors]
        )
        with np.errstate(all="ignore"):
            modes = _first_order_modes(omega, nudged)
            error = _receptance_error(modes, omega, damping)
        if error < worst:
            worst = error
            best = modes
        if worst <= EXACT_ERROR:
            break

    if best is None or worst > MAX_ERROR:
        raise AccuracyError(
            f"the first-order modes of the damped model are off by {worst:.2g} (limit {MAX_ERROR:g}"
            "): rounding does not tell their poles apart; change the damping by a per cent."
        )

    return best


def _first_order_modes(omega: Array, damping: DampingMatrix) -> FirstOrder:
    J = omega.size
    rotation = np.eye(J)
    rigid = np.flatnonzero(omega == 0)
    slow = damping.matrix + sum((t * G for G, t in damping.branches), np.zeros(1))
    values, rotation[np.ix_(rigid, rigid)] = np.linalg.eigh(slow[np.ix_(rigid, rigid)])
    modal_damping = np.sum((damping.factor @ rotation) ** 2, axis=0)
    modal_damping += sum(
        (tau * np.sum((L @ rotation) ** 2, axis=0) for L, tau in damping.factors), np.zeros(J)
    )
    touched = modal_damping > UNDAMPED_SHARE * modal_damping.max(initial=0.0)
    touched[rigid] = values > UNDAMPED_RIGID_SHARE * modal_damping.max(initial=0.0)
    coupled = np.flatnonzero(touched)
    undamped = np.flatnonzero(~touched)
    damping_of_coupled = in_coordinates(damping, rotation[:, coupled])
    w, d, S, JS, braked, stretched = _modes(omega[coupled], damping_of_coupled)
    k = coupled.size
    size = w.size
    free = undamped.size
    total = undamped.size + w.size
    first = np.concatenate((np.arange(free), total + np.arange(free)))
    second = np.concatenate((free + np.arange(size), total + free + np.arange(size)))

    states = np.zeros((2 * J, 2 * total))
    dual = np.zeros((2 * J, 2 * total))
    for half in range(2):  # of undamped modes a is the displacement, b its rate
        states[half * J + undamped, first[half * free : (half + 1) * free]] = 1.0
        dual[half * J + undamped, first[(1 - half) * free : (2 - half) * free]] = 1.0
        states[np.ix_(half * J + coupled, second)] = S[half * k : (half + 1) * k]
        dual[np.ix_(half * J + coupled, second)] = JS[half * k : (half + 1) * k]

    deceleration = np.zeros((J, 2 * total))
    deceleration[np.ix_(coupled, second)] = braked
    springs = []
    row = 0
    for L, _ in damping_of_coupled.factors:
        by_mode = np.zeros((J, 2 * total))
        end = row + len(L)
        by_mode[:, second] = (
            rotation[:, coupled] @ np.linalg.pinv(L, SPRINGLESS_SHARE) @ stretched[row:end]
        )
        springs.append(by_mode)
        row = end

    from scipy.linalg import block_diag  # takes long to load

    shapes = block_diag(rotation, rotation)
    w = np.append(omega[undamped], w)
    d = np.append(np.zeros(free), d)
    states = shapes @ states
    dual = shapes @ dual
    upper, lower = np.split(dual.T, 2)  # T^-1 of them
    inverse = np.vstack([lower, upper - 2 * d[:, None] * lower])
    return FirstOrder(w, d, states[:J], states[J:], rotation @ deceleration, inverse, springs)


def _modes(omega: Array, damping: DampingMatrix) -> tuple[Array, ...]:
    """First-order modes of a body whose free modes all have damping.

    Returns w, d (I,), S and J S (2 k, 2 I) of the module, for relaxed branches; the decelerations
    (k, 2 I) due to damping; and L q - xi of the branches.

    The eigenproblem is solved for (Omega q, v, L q - xi), whose squares are energies: its matrix is
    skew without damping. Y'JY is (v'v - (Omega q)'(Omega q) - (L q - xi)'(L q - xi))/lambda.
    """
    k = omega.size
    elastic_modes = np.flatnonzero(omega)
    L = np.vstack([np.zeros((0, k)), *(factor for factor, _ in damping.factors)])
    times = [np.full(len(factor), t) for factor, t in damping.factors]
    tau = np.concatenate([np.zeros(0), *times])
    e = elastic_modes.size
    q = slice(0, e)
    v = slice(e, e + k)
    y = slice(e + k, e + k + tau.size)
    A = np.zeros((y.stop, y.stop))
    A[q, v] = np.diag(omega)[elastic_modes]
    A[v, q] = -A[q, v].T
    A[v, v] = -damping.matrix
    A[v, y] = -L.T
    A[y, v] = L
    A[y, y] = -np.diag(1 / tau)
    sign = np.concatenate((-np.ones(e), np.ones(k), -np.ones(tau.size)))
    poles, Z = np.linalg.eig(A) if len(A) else (np.zeros(0), A)
    poles = poles.astype(complex)
    Z = Z.astype(complex)
    for cluster in _real_clusters(poles):
        poles[cluster], Z[:, cluster] = _in_subspace(A, sign, poles[cluster], Z[:, cluster])

    Y = np.zeros((2 * k + tau.size, len(A)), dtype=complex)
    Y[:k] = Z[v] / poles
    Y[k : 2 * k] = Z[v]
    Y[elastic_modes] = Z[q] / omega[elastic_modes, None]
    Y[2 * k :] = L @ Y[:k] - Z[y]

    pairs: list[tuple[float, float, Array, Array]] = []
    plus: list[tuple[float, Array]] = []
    minus: list[tuple[float, Array]] = []
    for group in _equal_poles(poles):
        pole = poles[group].mean()
        gram = Z[:, group].T @ (sign[:, None] * Z[:, group]) / pole

        if pole.imag > 0:
            root = _square_root(gram)
            for z, column in zip(poles[group], (Y[:, group] @ np.linalg.inv(root)).T, strict=True):
                scaled = column * np.sqrt(2j * z.imag)
                rate = scaled.imag / z.imag
                real = min(float(z.real), 0.0)
                pairs.append((abs(z), -real, scaled.real - real * rate, rate))
        elif pole.imag == 0:
            values, vectors = np.linalg.eigh(gram.real)
            vectors_of_group = Y[:, group].real @ (vectors / np.sqrt(np.abs(values)))
            for value, column in zip(values, vectors_of_group.T, strict=True):
                (plus if value > 0 else minus).append((min(float(pole.real), 0.0), column))

    for j in np.flatnonzero(omega == 0):  # a braked motion comes to rest anywhere
        column = np.zeros(len(Y))
        column[j] = 1.0
        column[2 * k :] = L[:, j]
        deceleration = damping.matrix[j, j] + float(tau @ L[:, j] ** 2)
        plus.append((0.0, column / np.sqrt(deceleration)))

    pairs += _paired_poles(plus, minus, float(np.abs(poles).max(initial=1.0)))
    w = np.array([pair[0] for pair in pairs])
    d = np.array([pair[1] for pair in pairs])
    shapes = [pair[2] for pair in pairs] + [pair[3] for pair in pairs]
    S = np.array(shapes).reshape(2 * w.size, len(Y)).T
    relaxed = damping.matrix @ S[:k] + S[k : 2 * k] + L.T @ (tau[:, None] * S[2 * k :])
    JS = np.vstack([relaxed, S[:k]])  # xi = L q
    stretched = L @ S[:k] - S[2 * k :]
    deceleration = damping.matrix @ S[k : 2 * k] + L.T @ stretched
    return w, d, S[: 2 * k], JS, deceleration, stretched


def _square_root(gram: ComplexArray) -> ComplexArray:
    from scipy.linalg import sqrtm

    # that of SciPy before 1.11 may return long doubles, which inv refuses
    return sqrtm(gram).astype(complex) if len(gram) > 1 else np.sqrt(gram)


def _real_clusters(poles: Numbers) -> list[list[int]]:
    """Groups of real poles that are so close that rounding mixes their modes."""
    real = np.flatnonzero(np.abs(poles.imag) <= CLUSTER_DISTANCE * np.abs(poles))
    order = real[np.argsort(poles[real].real)]
    value = poles[order].real
    ends = np.flatnonzero(np.diff(value) > CLUSTER_DISTANCE * np.abs(value[:-1])) + 1
    return [cluster.tolist() for cluster in np.split(order, ends) if cluster.size > 1]


def _in_subspace(A: Array, sign: Array, poles: Numbers, Z: Numbers) -> tuple[Numbers, Numbers]:
    """(poles, modes Z) of a cluster, recomputed in their subspace if it is invariant."""
    low = poles.real.min() * (1 + CLUSTER_DISTANCE / 2)
    high = poles.real.max() * (1 - CLUSTER_DISTANCE / 2)

    def in_cluster(re: complex, im: float = 0.0) -> bool:
        pole = re + 1j * im
        return bool(abs(pole.imag) <= CLUSTER_DISTANCE * abs(pole) and low <= pole.real <= high)

    from scipy.linalg import schur

    T, basis, size = schur(A, sort=in_cluster)
    basis = basis[:, :size]
    values, rotation = np.linalg.eigh(basis.T @ (sign[:, None] * basis))
    if size != poles.size or values[0] * values[-1] <= 0:
        return poles, Z

    scale = np.sqrt(np.abs(values))
    reduced = rotation.T @ T[:size, :size] @ rotation * scale[:, None] / scale
    eigenvalues, vectors = np.linalg.eigh((reduced + reduced.T) / 2)
    return eigenvalues + 0j, basis @ (rotation / scale @ vectors) + 0j


def _equal_poles(poles: Numbers) -> list[list[int]]:
    """Groups of equal poles, real and complex ones separately."""
    groups: list[list[int]] = []
    for i in np.lexsort((poles.imag, np.abs(poles))).tolist():
        for group in reversed(groups[-8:]):
            same_pole = abs(poles[i] - poles[group[0]]) <= REPEATED_DISTANCE * abs(poles[i])
            if same_pole and (poles[i].imag == 0) == (poles[group[0]].imag == 0):
                group.append(i)
                break
        else:
            groups.append([i])

    return groups


def _paired_poles(
    plus: list[tuple[float, Array]], minus: list[tuple[float, Array]], fastest: float
) -> list[tuple[float, float, Array, Array]]:
    """Real modes (w, d, c_a, c_b) of pairs of real poles, each pole as (pole, eigenvector).

    A pole of negative Y'JY (`minus`) is paired with the nearest slower pole of positive Y'JY
    (`plus`); a pole without a partner, with a pole of zero share. fastest : rate [1/s] of a pole
    of zero share that is paired with a pole at 0.
    """
    pairs: list[tuple[float, float, Array, Array]] = []
    unpaired = sorted(plus, key=lambda pole: pole[0])  # the fastest first

    def add(slow: float, fast: float, slow_shape: Array, fast_shape: Array) -> None:
        root = np.sqrt(slow - fast)
        sign = -1.0 if slow_shape @ fast_shape < 0 else 1.0
        rate = (slow_shape - sign * fast_shape) * root / (slow - fast)
        displacement = slow_shape * root - slow * rate
        pairs.append((np.sqrt(slow * fast), -(slow + fast) / 2, displacement, rate))

    for fast, column in sorted(minus, key=lambda pole: -pole[0]):  # the slowest first
        slower = next((i for i, (pole, _) in enumerate(unpaired) if pole > fast), None)
        if slower is None:
            add(fast / 2, fast, np.zeros(column.size), column)
        else:
            slow, slow_shape = unpaired.pop(slower)
            add(slow, fast, slow_shape, column)

    for slow, column in unpaired:
        add(slow, 2 * slow if slow < 0 else -fastest, column, np.zeros(column.size))

    return pairs


def _receptance_error(modes: FirstOrder, omega: Array, damping: DampingMatrix) -> float:
    """Relative error of the modes' receptance at a real s; inf if it is not finite."""
    positive = modes.omega[modes.omega > 0]
    s = float(np.exp(np.mean(np.log(positive)))) if positive.size else 1.0
    frequency = np.array(-1j * s)
    exact = np.linalg.inv(np.diag(omega**2 + s**2) + damping.stiffness(frequency).real)
    receptance = modes.receptance(np.eye(omega.size), frequency).real
    scale = np.sqrt(exact.diagonal())
    error = float(np.abs((receptance - exact) / np.outer(scale, scale)).max(initial=0.0))
    if np.isfinite(error):
        return error

    return np.inf
