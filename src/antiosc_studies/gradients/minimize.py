"""`minimize`: inputs of an impact that minimise a result, by SciPy's optimizer."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc import History, simulate
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import Result
from antiosc.extension import Impact, assemble_pair
from antiosc.models.auto_contact import law_of
from antiosc_studies.gradients.changes import changed
from antiosc_studies.gradients.goals import GOALS, Sampled
from antiosc_studies.gradients.of_run import derived

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Relative step of an input in differences of the bodies.
CHANGE = 1e-4
#: Error tolerance of the runs.
TOL = 1e-5
#: Relative change of the goal at which the search ends.
ENOUGH = 1e-7
MOST_STEPS = 100  # the quick tests need 7 at most
#: The values that `build` returns, in this order.
ARGUMENTS = ("model", "impactor", "contact", "duration")


@dataclass(frozen=True, eq=False, repr=False)
class Optimum(Result):
    """The result of `minimize`.

    Attributes
    ----------
    x : (n,) the inputs; value : the goal there; hit : the run with them.
    runs : number of impacts that were simulated.
    converged : whether the optimizer reached its tolerance; message : from the optimizer.
    """

    x: Array
    value: float
    hit: History
    runs: int
    converged: bool
    message: str

    @property
    def status(self) -> int:
        """0 if the optimizer reached its tolerance, else 1."""
        return 0 if self.converged else 1

    def numbers(self) -> dict[str, object]:
        """The optimal inputs and goal: name -> JSON value."""
        return {**super().numbers(), "x": self.x.tolist()}

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """Plot the run at the optimum, as `History.plot`."""
        return self.hit.plot(path)


def minimize(
    build: Callable[[Array], Sequence[Any]],
    goal: str | Callable[[Sampled], float],
    x0: ArrayLike,
    bounds: Sequence[tuple[float | None, float | None]] | None = None,
    constraints: Any = (),
    tol: float = ENOUGH,
) -> Optimum:
    """Inputs of an impact that minimise a result.

    SciPy's sequential quadratic programming with gradients: the derivative of the run is exact
    (`gradient`); the bodies are built, but not simulated, at a small change of each input.

    Parameters
    ----------
    build : callable
        Inputs (n,) -> the arguments (model, impactor, contact, duration) of `simulate`.
    goal : str or callable
        As for `gradient`: "peak_force", "impulse", "contact_time", "restitution",
        "peak_displacement", or a function of the run.
    x0 : array_like, shape (n,)
        Start of the search; the magnitudes of its entries are the scales of the inputs.
    bounds : sequence of (low, high), optional
        None: no bound.
    constraints : dict or sequence of dict, optional
        As for `scipy.optimize.minimize`: {"type": "ineq", "fun": f} for f(x) >= 0, "eq" for = 0.
    tol : float
        Change of the goal, over its first value, at which the search ends. The peak force of
        several sub-impacts has many shallow local minima, for which 1e-2 saves most of the runs.

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        For input that breaks a rule, or that `simulate` and `gradient` refuse.
    NotDifferentiableError
        If the search meets inputs at which the result has no derivative.
    """
    from scipy import optimize  # loaded where it is used: it takes long

    if not callable(goal) or isinstance(goal, type):
        checks.choice("goal", goal, tuple(GOALS))
    start = checks.column("x0", x0)
    tol = checks.tolerance(tol)
    if not callable(build) or isinstance(build, type) or not start.size:
        raise InputError("build must be a function of x, and x0 one number or more.")
    checks.function("build", build, "a function of x that returns what simulate takes", 1)
    scale = np.where(start != 0, abs(start), 1.0)
    search = _Search(build, goal, scale)
    limits = _scaled(bounds, start, scale)
    constraint_list = constraints if isinstance(constraints, list | tuple) else [constraints]
    rules = [_rule(constraint, scale) for constraint in constraint_list]
    first = abs(search.value(start / scale)) or 1.0
    optimum = optimize.minimize(
        lambda y: search.value(y) / first,
        start / scale,
        jac=lambda y: search.slopes(y) / first,
        bounds=limits,
        constraints=rules,
        method="SLSQP",
        options={"maxiter": MOST_STEPS, "ftol": tol},
    )
    value = search.value(optimum.x)
    hit = search.hit
    return Optimum(
        optimum.x * scale, value, hit, search.runs, bool(optimum.success), optimum.message
    )


class _Search:
    """Values and derivatives of the goal at scaled inputs; the last run is kept for both."""

    def __init__(self, build: Callable[[Array], Sequence[Any]], goal: Any, scale: Array) -> None:
        self.build = build
        self.goal = goal
        self.scale = scale
        self.runs = 0
        self.at = np.full(scale.size, np.nan)
        self.hit: Any = None

    def value(self, y: Array) -> float:
        """The goal at scaled inputs."""
        if not np.array_equal(y, self.at):
            self.hit = simulate(*self._arguments(y), tol=TOL)
            self.at = np.array(y)
            self.runs += 1
            self.record, self.wanted, self.by = derived(self.hit, self.goal)
        return self.wanted.value

    def slopes(self, y: Array) -> Array:
        """The derivatives by scaled inputs."""
        self.value(y)
        slopes = np.empty(y.size)
        for i in range(y.size):
            ends = []
            for sign in (-1, 1):
                shifted = np.array(y)
                shifted[i] += sign * CHANGE
                ends.append(assemble_pair(Impact(*self._arguments(shifted))))
            slopes[i] = changed(self.record, self.wanted, self.by, *ends) / (2 * CHANGE)
        return slopes

    def _arguments(self, y: Array) -> tuple[Any, ...]:
        """The arguments of `simulate` at scaled inputs."""
        arguments = self.build(y * self.scale)
        if not isinstance(arguments, tuple | list) or len(arguments) != len(ARGUMENTS):
            raise InputError(
                f"build must return the {len(ARGUMENTS)} arguments {', '.join(ARGUMENTS)} of"
                f" simulate; got {checks.shown(arguments)}."
            )
        model, impactor, contact, duration = arguments
        return model, impactor, law_of(contact, model, impactor), duration


def _scaled(bounds: object, start: Array, scale: Array) -> list[tuple[float, float]] | None:
    """Bounds of the scaled inputs; InputError if `start` is outside."""
    if bounds is None:
        return None
    if not isinstance(bounds, list | tuple) or len(bounds) != scale.size:
        raise InputError(f"bounds needs one pair (low, high) for each of {scale.size} inputs.")
    limits = []
    for pair, x, unit in zip(bounds, start.tolist(), scale.tolist(), strict=True):
        if not isinstance(pair, list | tuple) or len(pair) != 2:
            raise InputError(f"bounds must be pairs (low, high); got {checks.shown(pair)}.")
        low = -inf if pair[0] is None else checks.number("a bound", pair[0])
        high = inf if pair[1] is None else checks.number("a bound", pair[1])
        if low > high:
            raise InputError(f"bounds must have low <= high; got {low:g} and {high:g}.")
        if not low <= x <= high:
            raise InputError(f"x0 must lie within its bounds, {low:g} to {high:g}; got {x:g}.")
        limits.append((low / unit, high / unit))
    return limits


def _rule(rule: Any, scale: Array) -> dict[str, Any]:
    """A constraint on the scaled inputs."""
    sound = isinstance(rule, dict) and rule.get("type") in ("eq", "ineq")
    if not sound or not callable(rule.get("fun")) or set(rule) != {"type", "fun"}:
        raise InputError(
            'a constraint must be {"type": "eq" or "ineq", "fun": f}, a function of x that is 0 or'
            f" >= 0; got {checks.shown(rule)}."
        )
    function = checks.function("fun of a constraint", rule["fun"], "a function of x", 1)

    def scaled(y: Array) -> Array:
        return np.atleast_1d(checks.floats("what a constraint returns", function(y * scale), None))

    return {"type": rule["type"], "fun": scaled}
