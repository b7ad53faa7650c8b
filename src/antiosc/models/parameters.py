"""The parameters of an anti-oscillator model, which all that is computed from them reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, Index
from antiosc.base.errors import InputError
from antiosc.models.body import Body
from antiosc.models.damping_matrix import DampingMatrix
from antiosc.models.modal import Damping
from antiosc.models.model_info import ModelInfo
from antiosc.models.motion import Inertia


@dataclass(frozen=True, eq=False, repr=False)
class Parameters(Body):
    """The parameters of `AntiOscillators`, which explains and checks them; what follows at once."""

    m0: Any
    k0: Any
    m: Any = None
    omega: Array = ()  # type: ignore[assignment]
    local_compliance: Any = 0.0
    radius: Any = None
    participation: Array | None = None
    shapes: Array | None = None
    direction: Array | None = None
    inertia: Inertia | None = None
    hidden: Array | None = None
    damping: Damping | DampingMatrix | None = None
    info: ModelInfo = field(default_factory=ModelInfo)
    P: Any = None
    sites: tuple[str, ...] = ()
    columns: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    dependence: Array | None = None
    rigid: Array | None = None
    slide: Array | None = None
    strain_error: Array | None = None
    strain_misfit: Array | None = None

    @property
    def n(self) -> int:
        """Number of anti-oscillators N."""
        return int(self.omega.size)

    @property
    def lead(self) -> int:
        """Number of shapes in front of those of the anti-oscillators: of unit displacements."""
        return len(self.k0) if self.sites else 1

    @property
    def hidden_count(self) -> int:
        """Number of hidden rigid-body motions, which do not move the site."""
        if self.slide is not None:
            return int(self.slide.shape[1])
        return 0 if self.inertia is None else len(self.inertia.momentum) - self.n - 1

    @property
    def k(self) -> Array:
        """Stiffnesses k_i = omega_i^2 m_i [N/m], of the shape of m. Article eq. (23)."""
        return np.asarray((self.omega**2 * self.m.T).T)

    @property
    def m_st(self) -> Any:
        """Static mass m0 + sum(m_i) [kg], also of free bodies. Article eq. (15)."""
        return self.m0 + self.m.sum(axis=0)


def in_space(model: Parameters, rows: Index, slides: int | None = None) -> dict[str, Any]:
    """Shapes, momenta and hidden motions as they are stored; InputError where they do not fit.

    `rows` sorts the shapes; the momenta of the hidden motions follow theirs. `slides` is the number
    of hidden motions where the momenta do not tell it.
    """
    found: dict[str, Any] = {}
    in_order = np.array_equal(rows, np.arange(rows.size))
    if model.shapes is not None:
        shapes = checks.array("shapes", model.shapes, (None, rows.size))
        found["shapes"] = shapes if in_order else shapes[:, rows]
    if model.inertia is not None:
        momentum = checks.instance("inertia", model.inertia, Inertia, "an Inertia").momentum
        if len(momentum) < rows.size:
            raise InputError(
                f"inertia.momentum needs a row for each of psi_0 ... psi_{rows.size - 1}, "
                f"{rows.size} shapes, and one for each hidden motion; got {len(momentum)}."
            )
        all_rows = np.concatenate((rows, np.arange(rows.size, len(momentum))))
        found["inertia"] = model.inertia if in_order else model.inertia.along(momentum[all_rows])
    if model.hidden is not None:
        if model.inertia is not None:
            slides = len(model.inertia.momentum) - rows.size
        if slides is None:
            raise InputError("hidden motions need the inertia, which holds their momentum.")
        nodes = None if model.shapes is None else len(model.shapes)
        found["hidden"] = checks.array("hidden", model.hidden, (nodes, slides))
    return found
