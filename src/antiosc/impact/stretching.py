"""Impacts on parts whose sheets stretch: runs with second-order forces in a few modes.

A linear run comes first. Its motion shows how large the second-order forces are, and which modes
move most. Each of these modes adds a row to the system: a modal displacement, on which its
second-order force acts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import STOPPED, percent
from antiosc.engine.system import stretch_forces
from antiosc.impact.assembly import Assembly
from antiosc.impact.histories import History, bars
from antiosc.impact.histories.linear_theory import largest_deflection, sampled_motion
from antiosc.models.stretch import MOST_MODES, NARROWING_REMEDY, Stretch

H = TypeVar("H", bound=History)
#: Integrates an assembly.
IntegrateAssembly = Callable[[Assembly], H]

#: Relative change of the site's displacement by second-order forces up to which the linear run is
#: kept; the peak force changes by about half of it.
NEGLIGIBLE_SHARE = 3e-3
#: Modes that an automatic choice begins with, and the error that it aims at, at least: the tensors
#: themselves are within 1e-3 of the full second-order strain.
INITIAL_MODE_COUNT, MIN_STRETCH_TOL = 2, 2e-3
#: Modes of the Krylov space whose combinations come first. In one of 20, which holds more of the
#: waves, the motions that move most miss the dent.
KRYLOV_SIZE = 12
#: Steps of two modes that must agree: one may by chance, and had an error of 15 % in one of 25
#: random sheets (measured).
AGREEING_STEP_COUNT = 2
#: Times up to the peak of a force at which energies are compared.
ENERGY_SAMPLES = 200
#: Change by the last modes above which a warning is given (a smaller one is in the error budget
#: only); error above which another program is advised.
WARN_CHANGE, ROUGH_ERROR = 1e-2, 0.5
#: Factor of safety on that change in the error budget, and the least change: 56 of 58 random sheets
#: have bars that cover the error (measured); with 3 and 1e-3 55 of them.
STRETCH_SAFETY, MIN_STRETCH_ERROR = 4.5, 2.5e-3
#: Quantities that decide on the number of modes, and how much more than the force they may change;
#: not the contact time, which may jump by a whole touch.
DECIDING_WEIGHTS = {"peak_force": 1.0, "impulse": 1.0, "deflection": 2.5}


def with_stretch_rows(a: Assembly, by_body: Mapping[str, Stretch]) -> Assembly:
    """The assembly with a further row for each mode in which a body has second-order forces."""
    system = a.system
    count = sum(forces.size for forces in by_body.values())
    rows = np.zeros((count, system.omega.size))
    quadratic = np.zeros((count,) * 3)
    cubic = np.zeros((count,) * 4)
    first_mode = 0

    for name, forces in by_body.items():
        part = np.arange(first_mode, first_mode + forces.size)
        span = a.stacked.spans[name]
        site_rows = system.beta[: len(a.laws), span] @ forces.modes
        scale = float(np.abs(site_rows).max(initial=0.0)) or 1.0
        rows[part, span] = scale * forces.modes.T
        quadratic[np.ix_(part, part, part)] = forces.quadratic / scale**3
        cubic[np.ix_(part, part, part, part)] = forces.cubic / scale**4
        first_mode += forces.size

    G = np.pad(a.G, ((0, count), (0, 0)))

    system = system.with_second_order_rows(rows, quadratic, cubic)
    return replace(a, G=G, system=system, stretch_forces=dict(by_body))


@dataclass(frozen=True)
class StretchedMotion:
    """The motion of a body with second-order forces in a run."""

    stretch: Stretch  # its second-order forces
    omega: Array  # (J,) rad/s, of the free modes
    amplitude: Array  # (m, m) R of A = Q R, A (n, m) the amplitudes of its m modes over time
    #: largest static displacement of a site by second-order forces over its largest displacement
    change: float

    def leading(self, count: int) -> Stretch:
        """Second-order forces in the `count` largest motions, or in as many as the user gave."""
        if self.stretch.count != "auto":
            count = self.stretch.count
        if count >= self.stretch.size:
            return self.stretch

        space = min(max(KRYLOV_SIZE, count), self.stretch.size)
        _, _, rotation = np.linalg.svd(self.amplitude[:, :space])
        turn = np.zeros((self.stretch.size, min(count, space)))
        turn[:space] = rotation.T[:, :count]

        return self.stretch.turned(turn, self.omega)


def motion_of(history: History, name: str) -> StretchedMotion:
    """The motion of a body with second-order forces in a linear run."""
    a = history.assembly
    body = history.assembly.bodies[name]
    forces = body.stretch
    assert forces is not None

    span = a.stacked.spans[name]
    columns = a.stacked.columns[name]
    sites = a.stacked.B[span, columns] @ a.G[: len(a.laws), columns].T
    amplitude = sampled_motion(history, body.omega)[:, span] @ forces.modes
    triangle = np.asarray(np.linalg.qr(amplitude, mode="r"))
    poles = np.where(body.omega > 0, body.omega, np.inf)[:, None] ** 2
    site_displacement = forces.forces(amplitude) @ (forces.modes.T @ (sites / poles))
    largest = max(largest_deflection(history, name), 1e-300)
    change = float(np.abs(site_displacement).max(initial=0.0)) / largest

    return StretchedMotion(forces, body.omega, triangle, change)


def with_stretch(linear: H, integrate: IntegrateAssembly[H], tol: float) -> tuple[H, str]:
    """(the linear run, or a run with second-order forces if they matter; a warning or "")."""
    a = linear.assembly
    stretching = [name for name, body in a.bodies.items() if body.stretch is not None]
    motion_by_body = {name: motion_of(linear, name) for name in stretching}
    force = largest_force(linear)
    fixed = not any(motion.stretch.count == "auto" for motion in motion_by_body.values())
    if not fixed and max(motion.change for motion in motion_by_body.values()) <= NEGLIGIBLE_SHARE:
        return linear, ""

    for name in motion_by_body:
        if a.bodies[name].modes.damping is not None:
            raise InputError(
                f"{name!r} stretches, which does not go with dampers or layers that relax."
            )

    aim = max(tol, MIN_STRETCH_TOL)
    most_modes = min(max(motion.stretch.size for motion in motion_by_body.values()), MOST_MODES)
    count = min(INITIAL_MODE_COUNT, most_modes)
    runs: list[H] = []
    changes: list[dict[str, float]] = []

    while True:
        stretches = {name: motion.leading(count) for name, motion in motion_by_body.items()}
        run = integrate(with_stretch_rows(a, stretches))
        run.assembly.stretch_effect = largest_force(run) / force - 1 if force else 0.0
        if fixed:
            return run, ""
        if run.status != STOPPED:  # else these modes alone have no bounded energy; others may have
            changes += [relative_differences(before, run) for before in runs[-1:]]
            runs.append(run)
        recent = changes[-AGREEING_STEP_COUNT:]
        last = {name: max(change[name] for change in recent) for name in (changes or [{}])[0]}
        unsettled = max(
            (last[name] / x for name, x in DECIDING_WEIGHTS.items() if last), default=np.inf
        )
        if (unsettled <= aim and len(changes) >= AGREEING_STEP_COUNT) or count >= most_modes:
            break
        count = min(count + 2, most_modes)

    found = runs[-1] if runs else run
    found.error.update({f"stretch {name}": value for name, value in last.items()})
    found.assembly.stretch_converged = unsettled <= aim
    if last and unsettled > max(tol, WARN_CHANGE):
        count = max(forces.size for forces in found.assembly.stretch_forces.values())
        return found, _too_few_text(count, stretch_shares_of(found))
    return found, ""


def energy_ratio_before_peak(history: History) -> float:
    """Largest ratio of second-order to linear strain energy up to the last force peak."""
    contacts = [contact for contact in history.contact_histories if contact.contacts]
    peaks = [float(contact.time[int(np.argmax(contact.force))]) for contact in contacts]
    times = np.linspace(0.0, max(peaks, default=0.0), ENERGY_SAMPLES)
    motion = history.states(times)[0]

    a = history.assembly
    most = 0.0

    for name, forces in a.stretch_forces.items():
        q = motion[:, a.stacked.spans[name]]
        linear = float(np.sum((a.bodies[name].omega * q) ** 2, axis=1).max()) / 2 or 1e-300
        amplitude = q @ forces.modes
        quadratic, cubic = stretch_forces(forces.quadratic, forces.cubic, amplitude)
        third = np.abs(np.sum(quadratic * amplitude, axis=1)).max() / 3
        fourth = np.abs(np.sum(cubic * amplitude, axis=1)).max() / 4
        most = max(most, float(third + fourth) / linear)

    return most


def largest_force(history: History) -> float:
    """The largest peak force [N] of the contacts."""
    return max((contact.peak_force for contact in history.contact_histories), default=0.0)


def relative_differences(first: History, second: History) -> dict[str, float]:
    """Largest relative change of each quantity of all contacts, and of the deflections."""
    worst = dict.fromkeys(bars.QUANTITIES, 0.0)
    for a, b in zip(first.contact_histories, second.contact_histories, strict=True):
        if b.contacts:
            changes = bars.relative_changes(a, b)
            worst = {name: max(value, changes[name]) for name, value in worst.items()}

    deflections = [
        [largest_deflection(run, name) for name in run.assembly.stretch_forces]
        for run in (first, second)
    ]
    apart = [abs(a - b) / max(a, b, 1e-300) for a, b in zip(*deflections, strict=True)]

    return {**worst, "deflection": max(apart, default=0.0)}


def stretch_shares(changes: Mapping[str, float], before: float) -> dict[str, float]:
    """Relative errors by omitted modes, from `changes` by two more; `before`: energy ratio."""
    worst = max(changes.get(name, 0.0) for name in DECIDING_WEIGHTS)
    floors = dict.fromkeys(bars.QUANTITIES, bars.MIN_ERROR_SHARE * worst)
    floors[bars.DEFLECTION] = 0.0  # it is among those that make the floors
    floors = {name: max(floor, MIN_STRETCH_ERROR) for name, floor in floors.items()}
    floors["peak_force"] = min(floors["peak_force"], before)

    return {
        name: STRETCH_SAFETY * max(changes.get(name, 0.0), floor) for name, floor in floors.items()
    }


def stretch_shares_of(run: History) -> dict[str, float]:
    """`stretch_shares` of a run whose number of motions was chosen automatically."""
    changes = {name: run.error.get(f"stretch {name}", 0.0) for name in bars.BAR_UNITS}
    return stretch_shares(changes, energy_ratio_before_peak(run))


def _too_few_text(count: int, shares: Mapping[str, float]) -> str:
    """Sentence: the result with `count` second-order motions would change with two more."""
    force, deflection = shares["peak_force"], shares[bars.DEFLECTION]
    advice = f" To narrow it, {NARROWING_REMEDY}." if max(force, deflection) > ROUGH_ERROR else ""
    return (
        f"Second-order forces leave an error of {percent(force)} of the force and of"
        f" {percent(deflection)} of the deflection: it is so large or so local that those of"
        f" {count} motions still change with each two more, and more are not taken.{advice}"
    )
