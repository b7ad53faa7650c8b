"""The rules that every contact law satisfies.

`delta` [m] is the indentation, `rate` [m/s] its time derivative. A law is a frozen dataclass of
parameters, so that one object can be used in any number of simulations at once. The history of a
contact (the deepest indentation, the speed of approach) is stored in `state`, a tuple of floats.

1.  `touch(speed, state)` gives the state at first touch (`state` None) or when separated bodies
    touch again; `speed` >= 0 is the closing speed.
2.  `force` is >= 0 [N] and 0 for delta <= `origin(state)`. At a given state it does not decrease
    with delta at a fixed rate, or with the rate at a fixed delta: an implicit step has one root.
3.  `tangent` gives the partial derivatives of `force` by delta [N/m] and rate [N s/m].
4.  `advance` is called after each accepted step, in order of time, and returns the new state.
5.  `origin(state)` [m] is the indentation at which unloading ends and contact starts again: 0, or
    the permanent indentation.
6.  `energy(delta, state)` [J] is the recoverable energy of the contact; `lost(state)` [J] is the
    plastic work so far. Over a closed cycle the work done on the contact equals `lost` plus the
    work of the rate-dependent part of the force.
7.  `implicit` solves the law together with a linear relation between force and motion. The base
    class does it for any law that keeps rules 2 and 3; a law may override it by a closed form.

`Compiled` is the base of laws whose functions are kernels of the C library (`csrc/laws.c`): a
subclass gives the kind and the parameters; the formulas are in C only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Callable
from ctypes import addressof, byref, c_double
from dataclasses import fields
from functools import cached_property
from typing import ClassVar, TypeGuard

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import Checked
from antiosc.base.errors import NotConvergedError
from antiosc.base.texts import PATCH_ARGUMENT, engineering, rounded_up
from antiosc.engine import library

State = tuple[float, ...]

#: Relative change of a force by the last iteration up to which it counts as converged.
FORCE_ROUNDING = 1e-9
#: Ratio of successive trial radii of a patch, and number of larger radii that are tried.
RADIUS_RATIO, MOST_RADIUS_STEPS = 1.05, 150
#: Force that such a patch must carry over that of too small a one, whose law ends in a line: in 60
#: impacts on a spring, up to 790 times the range, the force grew by up to 21 %.
FORCE_MARGIN = 1.25


class ContactLaw(ABC):
    """Base of all contact laws; see the seven rules in the module."""

    #: the force depends on the rate of indentation
    rate_dependent: ClassVar[bool] = False
    #: the force depends on the path, so that `advance` matters
    has_memory: ClassVar[bool] = False
    #: compliance [m/N] of a patch that the law leaves to the structure
    compliance: float = 0.0

    @cached_property
    def valid_force(self) -> float:
        """Largest force [N] for which the theory of the law holds."""
        return float("inf")

    def without(self, compliance: float) -> ContactLaw:
        """This law minus `compliance` [m/N], if the law contains the bodies' half-space compliance.

        Hertz's law and laws based on it contain it, and so does the compliance of a structure with
        a patch. Other laws are not changed: they return themselves.
        """
        return self

    @abstractmethod
    def force(self, delta: float, rate: float, state: State) -> float:
        """Contact force [N], >= 0."""

    @abstractmethod
    def tangent(self, delta: float, rate: float, state: State) -> tuple[float, float]:
        """Partial derivatives of the force by delta [N/m] and by rate [N s/m]."""

    @abstractmethod
    def energy(self, delta: float, state: State) -> float:
        """Recoverable energy [J] of the contact at this indentation."""

    def energies(self, delta: Array, state: State) -> Array:
        """`energy` at many indentations (n,) of one state."""
        return np.array([self.energy(d, state) for d in delta.tolist()])

    def touch(self, speed: float, state: State | None = None) -> State:
        """State after a touch at a closing `speed` [m/s]; `state` None: the first touch."""
        return () if state is None else state

    def advance(self, delta: float, rate: float, state: State) -> State:
        """State after a step that ends with this indentation and rate."""
        return state

    def origin(self, state: State) -> float:
        """Indentation [m] at which the bodies separate and touch again."""
        return 0.0

    def lost(self, state: State) -> float:
        """Energy [J] lost by hysteresis since the first touch."""
        return 0.0

    def out_of_range(self, peak: float, radius: float | None) -> str:
        """Sentence on why a peak force [N] above `valid_force` is doubtful, and on the remedy.

        radius : radius of the patch [m]; None for a point.
        """
        if not self.compliance:
            return (
                f"the peak force {peak:.4g} N exceeds {self.valid_force:.4g} N, where the law ends"
            )

        needed_radius = self.enough_radius(peak, radius)
        if radius is None or needed_radius is None:
            size, remedy = "the patch of the contact", "use a larger patch radius"
        else:
            size = f"the patch radius of {engineering(radius, 'm')}"
            least = engineering(rounded_up(needed_radius), "m", 2)
            remedy = f"take a patch radius of at least {least} ({PATCH_ARGUMENT})"

        return (
            f"{size} is too small for the peak force of {engineering(peak, 'N')}: it holds up to"
            f" {engineering(self.valid_force, 'N')}, where the radius of the contact reaches 0.58"
            f" of it; {remedy}"
        )

    def enough_radius(self, peak: float, radius: float | None) -> float | None:
        """Least patch radius [m] at which `valid_force` exceeds a peak force [N]; None if unknown.

        radius : radius of the present patch [m].
        """
        if radius is None or not self.compliance:
            return None

        def carries(power: int) -> bool:
            law = self.without(self.compliance / RADIUS_RATIO**power)
            return bool(law.valid_force > FORCE_MARGIN * peak)

        powers = range(-MOST_RADIUS_STEPS, MOST_RADIUS_STEPS)
        first = bisect_left(powers, x=True, key=carries)

        return None if first == len(powers) else float(RADIUS_RATIO ** powers[first] * radius)

    @property
    def theory(self) -> str:
        """Name of the law, for use in a sentence."""
        return f"{type(self).__name__}'s law"

    def potential(self, delta: float, state: State) -> float:
        """Work [J] of the rate-independent force from the origin, up to a constant of the state.

        The work along a step that starts in `state` is the difference of two potentials, also if
        the step ends on the virgin loading curve.
        """
        new_state = self.advance(delta, 0.0, state)
        return self.energy(delta, new_state) + self.lost(new_state)

    def implicit(
        self,
        delta: float,
        alpha: float,
        rate: float,
        alpha_rate: float,
        state: State,
        guess: float = 0.0,
    ) -> float:
        """The force F [N] that satisfies F = force(delta - alpha F, rate - alpha_rate F).

        `delta` and `rate` are the values without force; `alpha` [m/N] and `alpha_rate` [m/(N s)]
        >= 0 are their decrease per unit force. `guess` is an initial guess of the force.
        """
        high = self.force(delta, rate, state)
        if high <= 0.0 or (alpha == 0.0 and alpha_rate == 0.0):
            return max(high, 0.0)

        low = 0.0
        trial = min(max(guess, 0.0), high)
        step = high
        for _ in range(200):
            d = delta - alpha * trial
            r = rate - alpha_rate * trial
            excess = trial - self.force(d, r, state)
            if excess == 0.0:
                return trial
            if excess > 0.0:
                high = trial
            else:
                low = trial

            by_delta, by_rate = self.tangent(d, r, state)
            new = trial - excess / (1.0 + alpha * by_delta + alpha_rate * by_rate)
            if not low < new < high:
                new = 0.5 * (low + high)
            if abs(new - trial) <= 2e-15 * abs(new) or new in (low, high):
                return new
            step = abs(new - trial)
            trial = new

        if step > FORCE_ROUNDING * abs(trial):
            raise NotConvergedError(
                f"the force at the indentation {delta:g} m has not converged after 200 steps:"
                f" {low:g} to {high:g} N remain; check that the law rises with the indentation."
            )

        return trial


#: Largest ratio of the subtracted patch compliance to the flexibility of the law.
LARGEST_PATCH_SHARE = 0.7

_ThreeDoubles = c_double * 3


class Compiled(Checked, ContactLaw):
    """Base of the contact laws that the C library evaluates."""

    #: the library's number of the law
    kind: ClassVar[int]
    #: number of floats in the state
    size: ClassVar[int] = 0
    #: parameters for the C library without compliance, if they differ from the fields
    _parameters: list[float] | None = None

    def parameters(self) -> list[float]:
        """Parameters in the order of the C library; the last is the compliance of a patch."""
        # a subclass of the caller may have more fields
        law = next(base for base in type(self).__mro__ if "kind" in vars(base))
        names = [parameter.name for parameter in fields(law) if parameter.name != "compliance"]
        values = self._parameters or [getattr(self, name) for name in names]
        return [*values, self.compliance]

    @cached_property
    def valid_force(self) -> float:
        if self.compliance:
            return float(library.library.aom_law_reach(self._address))
        return float("inf")

    @cached_property
    def kernel(self) -> tuple[library.CLaw, Array]:
        """(the law as a structure of the C library, arrays to which it refers)."""
        numbers = np.array(self.parameters(), dtype=float)
        return library.CLaw(self.kind, numbers.size, library.address(numbers), None), numbers

    @cached_property
    def _address(self) -> int:
        return addressof(self.kernel[0])

    def __getstate__(self) -> dict[str, object]:
        return {k: v for k, v in self.__dict__.items() if k not in ("kernel", "_address")}

    def _force(self, delta: float, rate: float, state: State) -> list[float]:
        """[force [N], derivative by delta, derivative by rate]."""
        values = _ThreeDoubles()
        begun = _ThreeDoubles(*(state or ())[:3])
        library.library.aom_law_force(self._address, delta, rate, begun, values)
        return values[:]

    def force(self, delta: float, rate: float, state: State) -> float:
        return self._force(delta, rate, state)[0]

    def tangent(self, delta: float, rate: float, state: State) -> tuple[float, float]:
        _, by_delta, by_rate = self._force(delta, rate, state)
        return by_delta, by_rate

    def energy(self, delta: float, state: State) -> float:
        energy = c_double()
        pointers = byref(c_double(delta)), _ThreeDoubles(*state[:3]), byref(energy)
        library.library.aom_law_energies(self._address, 1, *pointers)
        return energy.value

    def potential(self, delta: float, state: State) -> float:
        if self.has_memory:
            return super().potential(delta, state)
        return self.energy(delta, state)

    def energies(self, delta: Array, state: State) -> Array:
        return self._values_at(library.library.aom_law_energies, delta, state)

    def forces_at_rest(self, delta: Array, state: State) -> Array:
        """Forces (n,) [N] at constant indentations (n,) [m]."""
        return self._values_at(library.library.aom_law_forces, delta, state)

    def _values_at(self, function: Callable[..., None], delta: Array, state: State) -> Array:
        """Values (n,) of a function of the C library at indentations (n,) [m] of one state."""
        depth = np.ascontiguousarray(delta, dtype=float)
        values = np.empty(len(delta))
        begun = _ThreeDoubles(*state[:3])
        function(self._address, depth.size, library.address(depth), begun, library.address(values))
        return values

    def loading_work(self, delta: float) -> float:
        """Work [J] of loading a new contact up to delta."""
        return float(library.library.aom_law_loading_work(self._address, delta))

    def touch(self, speed: float, state: State | None = None) -> State:
        if not self.size:
            return ()
        state_values = _ThreeDoubles(*(state or ())[:3])
        library.library.aom_law_touch(self._address, speed, state is None, state_values)
        return tuple(state_values[: self.size])

    def advance(self, delta: float, rate: float, state: State) -> State:
        if not self.has_memory:
            return state
        state_values = _ThreeDoubles(*state[:3])
        library.library.aom_law_advance(self._address, delta, state_values)
        return tuple(state_values)

    def origin(self, state: State) -> float:
        if not self.has_memory:
            return 0.0
        return float(library.library.aom_law_origin(self._address, _ThreeDoubles(*state[:3])))

    def lost(self, state: State) -> float:
        if self.has_memory:
            return state[2]
        return 0.0


def is_compiled(law: ContactLaw) -> TypeGuard[Compiled]:
    """Whether the C library has this law; False for user subclasses: they may override methods."""
    module = type(law).__module__
    return isinstance(law, Compiled) and module.startswith("antiosc.engine.contact.")
