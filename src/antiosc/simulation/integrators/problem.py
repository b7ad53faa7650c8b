"""The problem of every integrator: two linear bodies and one contact in modal coordinates.

q contains the modes of the structure and of the impactor. With beta = (-b_structure, b_impactor),

    q'' + 2 decay q' + omega^2 q = load - beta F,      delta = beta.q - gap - r F,

and F = law(delta, delta') when delta is above the law's origin, else 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from antiosc._types import Array
from antiosc.contact import ContactLaw, State
from antiosc.simulation.integrators.propagator import Propagator

MAX_STEPS = 1_000_000


@dataclass(frozen=True, eq=False)
class Problem:
    """One impact, ready to integrate; all arrays of shape (J,).

    Attributes
    ----------
    omega, decay : circular frequencies [rad/s] and decay constants [1/s].
    beta : contribution of each mode to the indentation [kg^-1/2].
    r : residual compliance of both bodies [m/N].
    load : constant modal forces (gravity).
    gap : distance of the surfaces at rest [m].
    q, v : initial state.
    law : contact law.
    resolution : indentation [m] below which contact and no contact are not distinguished.
    stiffness : largest expected contact stiffness [N/m]; 0: not known.
    """

    omega: Array
    decay: Array
    beta: Array
    r: float
    load: Array
    gap: float
    q: Array
    v: Array
    law: ContactLaw
    resolution: float
    stiffness: float = 0.0

    @cached_property
    def propagator(self) -> Propagator:
        """Exact free motion of the modes."""
        return Propagator(self.omega, self.decay)

    @cached_property
    def loaded(self) -> bool:
        """Whether gravity acts."""
        return bool(np.any(self.load))

    def approach(self, q: Array, force: float = 0.0) -> float:
        """Indentation [m]; negative: distance."""
        return float(self.beta @ q) - self.gap - self.r * force

    def free(self, q: Array, v: Array, t: Array | float) -> tuple[Array, Array]:
        """States (..., J) after free motion over times `t` from (q, v)."""
        P, S, W = self.propagator.motion(t)
        qt, vt = P * q + S * v, W * v - self.propagator.square * S * q
        if self.loaded:
            qt, vt = qt + self.propagator.step(t) * self.load, vt + S * self.load
        return qt, vt

    def indentation(self, q: Array, v: Array, t: Array | float) -> Array:
        """Indentation [m] after free motion over times `t` from (q, v), shape of `t`."""
        delta = self.propagator.weighted(t, self.beta * q, self.beta * v) - self.gap
        if self.loaded:
            delta = delta + self.propagator.step(t) @ (self.beta * self.load)
        return np.asarray(delta)

    def forced(
        self, q: Array, v: Array, t: Array | float, f0: Array | float, f1: Array | float
    ) -> tuple[Array, Array]:
        """States (..., J) after times `t` from (q, v) while F goes linearly from f0 to f1."""
        P, S, W, J, R = self.propagator.responses(t)
        slope = np.asarray((f1 - f0) / np.where(np.greater(t, 0), t, 1.0))[..., np.newaxis]
        f0 = np.asarray(f0)[..., np.newaxis]
        q1 = P * q + S * v - self.beta * (f0 * J + slope * R)
        v1 = W * v - self.propagator.square * S * q - self.beta * (f0 * S + slope * J)
        return (q1 + J * self.load, v1 + S * self.load) if self.loaded else (q1, v1)


@dataclass(eq=False)
class Segment:
    """A piece of the run: either free flight or contact.

    Attributes
    ----------
    time, force : (n,) at the nodes; between nodes F is linear.
    indentation : gives the indentation at the nodes, (n,).
    impulse : time integral of the force as the integrator took it [N s].
    states : gives modal displacements and velocities at the nodes, (n, J) each.
    contact : whether the bodies touch.
    """

    time: Array
    force: Array
    indentation: Callable[[], Array]
    impulse: float
    states: Callable[[], tuple[Array, Array]]
    contact: bool


@dataclass(eq=False)
class Phase:
    """Result of one contact: its segments and the state at its end.

    `failure`: why the integration stopped early, if it did; `diverged`: because the energy grew.
    """

    segments: list[Segment]
    time: float
    q: Array
    v: Array
    state: State
    evaluations: int
    released: bool
    failure: str = ""
    diverged: bool = False


def too_many_steps(t: float, max_steps: int) -> str:
    """The failure message of a contact that does not end."""
    return (
        f"stopped at {t:g} s: more than {max_steps} steps in one contact; shorten the duration,"
        f" use a larger step or raise max_steps"
    )


class Integrator(Protocol):
    """Integrates one contact; free flight in between is exact and common to all (`run`)."""

    @property
    def order(self) -> int:
        """Order of convergence in the step."""
        ...

    @property
    def name(self) -> str:
        """Name of the method."""
        ...

    def contact(
        self, problem: Problem, t: float, q: Array, v: Array, state: State, end: float
    ) -> Phase:
        """Integrate from first touch at `t` until the bodies part or `end` is reached."""
        ...
