"""The parameters of an anti-oscillator model, which all that is computed from them reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antiosc._types import Array
from antiosc.models.body import Body
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
    damping: Damping | None = None
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
        """Static mass m0 + sum(m_i) [kg], or the rigid-body mass m_CR. Article eq. (15)."""
        return self.m0 + self.m.sum(axis=0)
