"""The change of a goal between two sets of bodies, to first order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotDifferentiableError
from antiosc.contact import ContactLaw
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.simulation.assembly import Assembly, assemble
from antiosc.simulation.error_budget import SAFETY
from antiosc.simulation.histories import History
from antiosc.simulation.march.engine import Slopes
from antiosc.simulation.truncation import TRUNCATION_SAFETY, softest
from antiosc.simulation.two_bodies import Impact, pose
from antiosc.studies.gradients.coupled import changed_coupled
from antiosc.studies.gradients.goals import Seeds
from antiosc.studies.gradients.recorded import Recorded

#: Relative error of the forces of the runs that are compared, over that of the run; the least.
FINER, LEAST = 0.1, 1e-7
#: Share of the anti-oscillators without which a run shows what truncation changes.
FEWER = 0.25
#: Frequencies that differ by less, relatively, are of one group: modes that turn into each other.
CLOSE = 1e-2
#: What the modes of a group have that turns with them.
TURNING = ("beta", "loads", "q", "v", "B")

#: A run, a goal and its derivatives by all numbers of the march.
Taken = tuple[Recorded, Seeds, Slopes]


def changed(found: Recorded, wanted: Seeds, by: Slopes, before: Assembly, after: Assembly) -> float:
    """Change of the goal from one set of bodies to another, to first order.

    Modes of nearly equal frequencies turn into each other within small changes. The squares of
    their frequencies are a matrix X with such a group, and what changes evenly is X beside the
    displacements of the site in the Krylov basis of both.
    """
    a, b = before.system, after.system
    if found.system.first is not None:
        return changed_coupled(found, wanted, by, before, after) + _beside_modes(
            wanted, by, before, after
        )
    if a.omega.shape != b.omega.shape or found.system.omega.shape != a.omega.shape:
        raise NotDifferentiableError(
            "the number of modes changes with an input: build models with as many anti-oscillators."
        )
    slopes: dict[str, Array] = {
        "square": by.square, "decay": by.decay, "beta": by.beta, "loads": by.loads,
        "q": by.q[None], "v": by.v[None], "B": wanted.B.T,
    }  # fmt: skip
    here, one, other = _of_modes(found), _of_modes(before), _of_modes(after)
    total = 0.0
    for group, column in _groups(found):
        x, base = here["square"][group], _krylov(here, group, column)
        # the goal does not depend on the axes of a group: hence its derivatives beside X's diagonal
        twist = np.sum([here[n][..., group].T @ slopes[n][..., group] for n in TURNING], axis=0)
        by_matrix = (twist.T - twist) / (2 * (x[:, None] - x + np.eye(x.size)))
        for values, sign in ((one, -1), (other, 1)):
            turn = base @ _krylov(values, group, column).T
            matrix = (turn * values["square"][group]) @ turn.T
            total += sign * float(np.sum(by_matrix * matrix))
            for name in ("square", "decay"):
                values[name][group] = turn**2 @ values[name][group]
            for name in TURNING:
                values[name][..., group] = values[name][..., group] @ turn.T
    total += sum(float(np.sum(slope * (other[n] - one[n]))) for n, slope in slopes.items())
    return total + _beside_modes(wanted, by, before, after)


def _beside_modes(wanted: Seeds, by: Slopes, before: Assembly, after: Assembly) -> float:
    """The share of `changed` of residual compliances, gaps and laws."""
    a, b = before.system, after.system
    pairs = [(by.residual, b.R - a.R), (by.offsets, b.offsets - a.offsets),
             (wanted.r, after.r - before.r)]  # fmt: skip
    total = sum(float(np.sum(slope * change)) for slope, change in pairs)
    for slope, old, new in zip(by.laws, a.laws, b.laws, strict=True):
        total += float(slope @ (_leading(new) - _leading(old)))
        if old.kernel[0].kind == march.TABLE and old is not new:  # type: ignore[attr-defined]
            raise NotDifferentiableError(
                "there are no derivatives by the curves of a table: make it outside of build."
            )
    return total


def _of_modes(bodies: Assembly | Recorded) -> dict[str, Array]:
    """What each mode has, copies (…, J)."""
    s = bodies.system
    found = {"square": s.omega**2, "decay": s.decay, "beta": s.beta, "loads": s.loads,
             "q": s.q[None], "v": s.v[None], "B": bodies.B.T}  # fmt: skip
    return {name: value.copy() for name, value in found.items()}


def _groups(found: Recorded) -> Iterator[tuple[slice, int]]:
    """Modes of nearly equal frequencies of bodies of one site, and the column of the site."""
    for part in found.parts.values():
        omega, column = found.system.omega[part.span], part.columns.start
        if part.columns.stop != column + 1 or not omega.size:
            continue
        ends = np.flatnonzero(np.diff(omega) > CLOSE * omega[:-1]) + 1
        for begin, end in zip([0, *ends], [*ends, omega.size], strict=True):
            if omega[end - 1] > omega[begin] > 0:
                yield slice(part.span.start + begin, part.span.start + end), column


def _krylov(values: dict[str, Array], group: slice, column: int) -> Array:
    """The orthonormal Krylov basis of the squares of a group and its displacements of the site."""
    x = values["square"][group]
    powers = np.vander((x - x.mean()) / np.ptp(x), increasing=True).T * values["B"][column, group]
    basis, R = np.linalg.qr(powers.T)
    return np.asarray(basis * np.where(R.diagonal() < 0, -1.0, 1.0))


def _leading(law: ContactLaw) -> Array:
    """The parameters that the march has derivatives by, then 0."""
    kind, values = law.kernel[0].kind, law.parameters()  # type: ignore[attr-defined]
    count = {march.TABLE: 0, march.HERTZ: 2}.get(kind, march.LAW_SLOPES)
    found = np.zeros(march.LAW_SLOPES)
    found[: min(count, len(values))] = values[:count]
    return found


def impact_of(hit: History) -> Impact | None:
    """The arguments of `simulate` of a run; None of a scene."""
    again = hit.budget.keywords["again"] if isinstance(hit.budget, partial) else None
    return None if again is None else again.args[0]


def assembly_with(hit: History, name: str, model: AntiOscillators) -> Assembly:
    """The bodies of a run, ready to integrate, with another model in place of the body `name`."""
    impact = impact_of(hit)
    if impact is not None:
        return pose(*impact._replace(model=model))
    scene = hit.assembly.scene
    return assemble(replace(scene, bodies={**scene.bodies, name: model}), float(hit.run.time[-1]))


def changed_model(
    hit: History, taken: Taken, name: str, before: AntiOscillators, after: AntiOscillators
) -> float:
    """Change of the goal from one model of the body `name` to another, to first order."""
    return changed(*taken, *(assembly_with(hit, name, each) for each in (before, after)))


def as_it_is(model: AntiOscillators) -> AntiOscillators:
    """The model itself."""
    return model


def fewer(model: AntiOscillators) -> AntiOscillators:
    """The model with a quarter of its anti-oscillators less, at least one."""
    return model.truncated(model.n - max(1, round(FEWER * model.n)))


def compared_runs(
    hit: History,
) -> list[tuple[History, Callable[[AntiOscillators], AntiOscillators]]]:
    """Runs beside which a gradient shows its errors, and what each makes of the model.

    Finer steps; with these fewer anti-oscillators, the residual mass on the softest spring that it
    may have (`antiosc.simulation.truncation`), and the model corrected for its mesh.
    """
    budget = hit.budget if isinstance(hit, History) else None
    model = hit.assembly.scene.bodies.get("structure") if budget is not None else None
    if not isinstance(budget, partial) or not isinstance(model, AntiOscillators) or not model.n:
        raise InputError(
            "bars of a gradient need a run of simulate on anti-oscillators, one or more; leave"
            " error= out."
        )
    again, known = budget.keywords["again"], max(hit.error.values(), default=1e-3)
    tol = max(FINER * known, LEAST)
    turns: list[Callable[[AntiOscillators], AntiOscillators]] = [as_it_is, fewer, softest]
    if model.strain_error is not None:
        turns.append(AntiOscillators.corrected)
    return [(again(turned(model), tol), turned) for turned in turns]


def bar(values: Sequence[Any]) -> Any:
    """The bar of a derivative from those of the run and of `compared_runs`, name by name.

    None where it is not known, as of m and omega, of which another model has others.
    """
    if isinstance(values[0], dict):
        return {n: bar([(each or {}).get(n) for each in values]) for n in values[0]}
    base, finer, *others = (
        None if one is None or np.shape(one) != np.shape(values[0]) else np.asarray(one)
        for one in values
    )
    if base is None or finer is None or (others[0] is None and others[1] is None):
        return None
    weights = (TRUNCATION_SAFETY, TRUNCATION_SAFETY, SAFETY)
    less, soft, mesh = (
        np.zeros(np.shape(base)) if one is None else weight * abs(one - finer)
        for weight, one in zip(weights, (*others, None)[:3], strict=True)
    )
    total = abs(finer - base) + np.maximum(less, soft) + mesh
    return total if np.ndim(total) else float(total)
