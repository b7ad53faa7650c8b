"""The free modes of a model whose damping couples them, and that damping in them."""

from __future__ import annotations

from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.damping_matrix import DampingMatrix, along
from antiosc.models.parameters import Parameters
from antiosc.models.reduced_modes import ReducedModes, reduced_modes

#: Share of the static mass of a site that has no mass but damping: its least mass.
LEAST_MASS = 1e-8


def checked_size(model: Parameters, damping: DampingMatrix, given: Any) -> DampingMatrix:
    """The damping of a model sorted as its frequencies, which were given in another order."""
    lead, hidden = model.lead, model.hidden_count
    size = lead + model.n + hidden
    if damping.n != size:
        raise InputError(
            f"the damping of this model needs a matrix of its {size} coordinates ({lead} of sites, "
            f"{model.n} anti-oscillators, {hidden} hidden motions); got one of {damping.n}."
        )
    order = np.argsort(np.asarray(given, dtype=float), kind="stable")
    if np.array_equal(order, np.arange(order.size)):
        return damping
    rows = np.concatenate((np.arange(lead), lead + order, np.arange(lead + order.size, size)))
    return along(damping, np.eye(size)[:, rows])


def damped_modes(model: Parameters, k0: Array, m0: Array, P: Array, rigid: Array) -> ReducedModes:
    """The free modes of `reduced_modes`; a damped site without mass gets a little of it."""
    if isinstance(model.damping, DampingMatrix):
        p = len(k0)
        least = LEAST_MASS * (m0 + P @ P.T).diagonal()
        acted = sum(
            (np.sum(L[:, :p] ** 2, axis=0) for L, _ in model.damping.factors),
            np.sum(model.damping.factor[:, :p] ** 2, axis=0),
        )
        m0 = m0 + np.diag(np.where((acted > 0) & (m0.diagonal() < least), least, 0.0))
    return reduced_modes(k0, m0, P, model.omega, rigid)


def damping_of(model: Parameters, omega: Array, shape: Array | None) -> dict[str, Any]:
    """The decay or the damping of the modes (size, J) in u, eta and the hidden motions."""
    damping = model.damping
    if damping is None:
        return {"decay": None}
    if isinstance(damping, DampingMatrix):
        return {} if shape is None else {"damping": along(damping, shape)}
    return {"decay": damping.decay(omega)}
