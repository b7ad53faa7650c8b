"""The anti-oscillator model of one site: its checks, and its form in free modes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.damping_matrix import DampingMatrix
from antiosc.models.modal import ModalBody
from antiosc.models.motion import unit_vector
from antiosc.models.parameters import Parameters, in_space
from antiosc.models.reduced_modes import damped_modes, damping_of
from antiosc.models.rigid_share import arrow_modes
from antiosc.models.softened import checked_error, checked_symmetric

#: m0 is negligible if its own free mode lies so far above the last pole (squared frequencies).
MASSLESS_SITE = 1e-15
#: m0 = m_st - sum(m_i) is known only to the rounding of m_st: a relative m0 below this is noise.
MASS_ROUNDING = 1e-12
#: Parameters that only a model of several sites has.
OF_SEVERAL = ("columns", "dependence", "rigid", "slide")


def checked(model: Parameters) -> dict[str, Any]:
    """The parameters of one site as they are stored; InputError for those outside their range.

    They are sorted by frequency.
    """
    for name in OF_SEVERAL:
        given = getattr(model, name)
        empty = name == "columns" and isinstance(given, dict) and not given
        if not (given is None or empty):
            raise InputError(
                f"{name} belongs to a model of several sites: give its P and the names of its "
                "sites too."
            )
    m, omega = checks.positives("m", model.m, "kg"), checks.positives("omega", model.omega, "rad/s")
    if m.shape != omega.shape:
        raise InputError(
            f"m and omega must have one entry per anti-oscillator;"
            f" got {m.size} masses and {omega.size} frequencies."
        )
    order = np.argsort(omega, kind="stable")
    m0 = checks.number("m0", model.m0, "kg")
    total = float(m.sum()) + max(m0, 0.0)
    if m0 < 0 and -m0 <= MASS_ROUNDING * total:
        m0 = 0.0
    k0 = checks.nonnegative("k0", model.k0, "N/m")
    checks.nonnegative("m0", m0, "kg")
    if total == 0 and k0 == 0:
        raise InputError(
            "a model with m0 = 0, k0 = 0 and no anti-oscillator has neither mass nor "
            "stiffness; give it one."
        )
    columns = np.concatenate(([0], 1 + order))
    found: dict[str, Any] = {
        "m0": m0,
        "k0": k0,
        "m": checks.kept(m[order]),
        "omega": checks.kept(omega[order]),
        "local_compliance": checks.nonnegative("local_compliance", model.local_compliance),
    }
    if model.radius is not None:
        found["radius"] = checks.positive("radius", model.radius, "m")
    if model.participation is not None:
        p = checks.array("participation", model.participation, columns.shape)
        found["participation"] = checks.kept(p[columns])
    if model.direction is not None:
        found["direction"] = unit_vector("direction", model.direction)
    if model.strain_error is not None:
        own = checked_error("strain_error", model.strain_error, columns.size)
        found["strain_error"] = checks.kept(own[np.ix_(columns, columns)])
    if model.strain_misfit is not None:
        if model.strain_error is None:
            raise InputError("strain_misfit belongs to a strain_error, which is missing.")
        work = checked_symmetric("strain_misfit", model.strain_misfit, columns.size)
        found["strain_misfit"] = checks.kept(work[np.ix_(columns, columns)])
    return found | in_space(model, columns)


def modal(model: Parameters) -> ModalBody:
    """The free modes of a model of one site, its hidden rigid motions in front."""
    if isinstance(model.damping, DampingMatrix):
        return _coupled(model)
    massless = model.m0 == 0
    if model.n:
        top = float(model.omega[-1]) ** 2
        massless = model.m0 * top <= MASSLESS_SITE * (model.k0 + float(model.k.sum()))
    squares = model.omega**2
    first = np.ones(model.n, dtype=bool)
    first[1:] = squares[1:] > squares[:-1]
    mass = model.m
    if not first.all():  # equal frequencies act at the site as one mode
        group = np.cumsum(first)
        mass = np.asarray(np.bincount(group, weights=mass)[1:], dtype=float)
    x, shape = arrow_modes(model.k0, 0.0 if massless else model.m0, mass, squares[first])
    if mass.size < model.n:
        shape = shape[np.append(0, group)]
    residual = np.zeros(model.n + 1)
    if massless:
        residual[0] = 1.0 / (model.k0 + float(model.k.sum()))
    return _in_space(model, np.sqrt(x), shape, residual)


def _coupled(model: Parameters) -> ModalBody:
    """The free modes of a model whose damping couples them: none is merged with another."""
    k0, m0, root = np.array([[model.k0]]), np.array([[model.m0]]), np.sqrt(model.m)
    rigid = np.full((1, int(model.k0 == 0)), 1 / np.sqrt(model.m_st))
    found = damped_modes(model, k0, m0, root[None], rigid)
    turn = np.eye(model.n + 1)  # lambda_i = lambda_0 + eta_i/sqrt(m_i)
    turn[1:, 0], turn[1:, 1:] = 1.0, np.diag(1 / root)
    size, hidden = len(turn), model.hidden_count
    own = np.zeros((size + hidden, hidden + found.omega.size))
    own[:size, hidden:], own[size:, :hidden] = found.shape, np.eye(hidden)
    omega = np.concatenate((np.zeros(hidden), found.omega))
    body = _in_space(model, found.omega, turn @ found.shape, turn @ found.residual[:, 0])
    return replace(body, **damping_of(model, omega, own))


def _in_space(model: Parameters, omega: Array, shape: Array, residual: Array) -> ModalBody:
    """The free modes (N + 1, J) with the hidden motions in front, so that frequencies ascend.

    Their coordinates follow lambda.
    """
    hidden = model.hidden_count
    none, own = np.zeros(hidden), np.eye(hidden)
    omega = np.concatenate((none, omega))
    residual = np.concatenate((residual, none))
    weight = None if model.participation is None else shape.T @ model.participation
    b = np.concatenate((none, shape[0]))
    amplitude = _relative(model.n)
    if hidden:
        shape = np.roll(block_diag(shape, own), hidden, axis=1)
        amplitude = block_diag(amplitude, own)
    inertia, basis = model.inertia, None
    if inertia is not None:
        inertia = inertia.along((amplitude @ shape).T @ inertia.momentum)
        if model.direction is not None:
            pull = inertia.momentum[:, :3] @ model.direction
            weight = pull if weight is None else np.concatenate((pull[:hidden], weight))
    if model.shapes is not None and not (hidden and model.hidden is None):
        basis = (model.shapes, model.hidden) if hidden else (model.shapes,)
    return ModalBody(
        omega=omega,
        b=b,
        r=float(residual[0]),
        **damping_of(model, omega, None),
        weight=weight,
        shape=shape,
        residual=residual,
        basis=basis,  # type: ignore[arg-type]
        amplitude=amplitude,
        direction=model.direction,
        inertia=inertia,
    )


def _relative(n: int) -> Array:
    """Amplitudes lambda_0 and lambda_i - lambda_0 of psi_0 and psi_i, Article eq. (8)."""
    turn = np.eye(n + 1)
    turn[1:, 0] = -1.0
    return turn
