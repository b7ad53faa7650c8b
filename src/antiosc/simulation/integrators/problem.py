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

from antiosc.base._types import Array
from antiosc.contact import ContactLaw, State
from antiosc.simulation.modal_response import responses

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
    depth, speed : expected indentation [m] and closing speed [m/s], roughly.
    mass : inertia [kg] behind the contact, roughly.
    farthest : indentation [m] that the bodies could reach without contact force.
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
    depth: float = 1e-300
    speed: float = 1e-300
    mass: float = 1.0
    farthest: float = 0.0

    @cached_property
    def square(self) -> Array:
        """omega^2 [rad^2/s^2]."""
        return self.omega**2

    @cached_property
    def rigid(self) -> Array:
        """beta of the rigid-body modes, 0 for the others."""
        return np.where(self.omega == 0, self.beta, 0.0)

    @cached_property
    def freest(self) -> int:
        """The undamped rigid-body mode that moves most at the contact, if there is one."""
        return int(np.argmax(abs(self.rigid) * (self.decay == 0)))

    @cached_property
    def loaded(self) -> bool:
        """Whether gravity acts."""
        return bool(np.any(self.load))

    def approach(self, q: Array, force: float = 0.0) -> float:
        """Indentation [m]; negative: distance."""
        return float(self.beta @ q) - self.gap - self.r * force

    def free(self, q: Array, v: Array, t: Array | float) -> tuple[Array, Array]:
        """States (..., J) after free motion over times `t` from (q, v)."""
        P, W, S, J0, _, _ = responses(self.omega, self.decay, t)
        qt, vt = P * q + S * v, W * v - self.square * S * q
        return (qt + J0 * self.load, vt + S * self.load) if self.loaded else (qt, vt)

    def forced(
        self,
        q: Array,
        v: Array,
        t: Array | float,
        f0: Array | float,
        f1: Array | float,
        bend: Array | float = 0.0,
    ) -> tuple[Array, Array]:
        """States (..., J) after times `t` from (q, v) while F goes from f0 to f1.

        F is a parabola with the second derivative `bend` [N/s^2].
        """
        P, W, S, J0, J1, J2 = responses(self.omega, self.decay, t)
        slope = (f1 - f0) / np.maximum(t, 1e-300) - 0.5 * np.multiply(bend, t)
        a, b, c = (np.asarray(each)[..., np.newaxis] for each in (f0, slope, bend))
        q1 = P * q + S * v - self.beta * (a * J0 + b * J1 + c * J2)
        v1 = W * v - self.square * S * q - self.beta * (a * S + b * J0 + c * J1)
        return (q1 + J0 * self.load, v1 + S * self.load) if self.loaded else (q1, v1)


@dataclass(eq=False)
class Segment:
    """A piece of the run: either free flight or contact.

    Attributes
    ----------
    time, force : (n,) at the nodes.
    indentation : gives the indentation at the nodes, (n,).
    states : gives modal displacements and velocities at the nodes, (n, J) each.
    bend : (n - 1,) second derivative of the force between the nodes [N/s^2]; None where it is
        linear there.
    """

    time: Array
    force: Array
    indentation: Callable[[], Array]
    states: Callable[[], tuple[Array, Array]]
    bend: Array | None = None

    @property
    def bends(self) -> Array:
        """`bend`, 0 where the force is linear."""
        return np.zeros(self.time.size - 1) if self.bend is None else self.bend

    @property
    def peak(self) -> float:
        """Largest force [N], also between the nodes."""
        top = float(self.force.max())
        if self.bend is None:
            return top
        time, force = self.time, self.force
        half, rise = 0.5 * (time[1:] - time[:-1]), force[1:] - force[:-1]
        drop = -self.bend * half * half  # of the chord below the parabola, twice
        inside = abs(rise) < 2 * drop
        if not inside.any():
            return top
        middle = 0.5 * (self.force[1:] + self.force[:-1])[inside] + 0.5 * drop[inside]
        return max(top, float((middle + rise[inside] ** 2 / (8 * drop[inside])).max()))


@dataclass(eq=False)
class Phase:
    """Result of one contact: its segments, the state at its end, and its impulse [N s].

    `failure`: why the integration stopped early, if it did; `diverged`: because the energy grew.
    """

    segments: list[Segment]
    time: float
    q: Array
    v: Array
    state: State
    evaluations: int
    released: bool
    impulse: float
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
