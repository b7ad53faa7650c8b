"""Error control of a scene: the march is repeated with a finer share until its forces converge."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, sqrt

import numpy as np
from numpy.typing import NDArray

from antiosc import checks
from antiosc.errors import AccuracyError, AccuracyWarning, InputError, warn
from antiosc.simulation import march
from antiosc.simulation.assembly import Assembly, assemble
from antiosc.simulation.engine import Run, fitting_march, run
from antiosc.simulation.equilibrium import closed, settle
from antiosc.simulation.laws import forget
from antiosc.simulation.scene import Scene
from antiosc.simulation.scene_energy import GAIN, gained
from antiosc.simulation.scene_history import SceneHistory

Array = NDArray[np.float64]

# Of the tolerance, the share of the first run; by what the second run divides it, and a third:
# by MORE if the estimate was at most NEAR times the tolerance, else by MOST.
FIRST, SECOND, MORE, MOST, NEAR = 0.5, 4.0, 4.0, 8.0, 1.5
# Error left in the finer run, of the difference of two whose shares have the ratio f, is
# 1/(f - 1) where errors follow the share, times this margin; where a law depends on the rate of
# what has no mass the order is 1 in the step, f^(1/3).
MARGIN = 1.5
REFINEMENTS = 12  # runs
PATIENCE = 3  # runs without gain after which a scene counts as not convergent
# a finer run may take so many times the steps of the one before, twice being the rule, and so many
# at least: one that takes more is stopped
DEARER, CHEAP = 50, 50_000


@dataclass(eq=False)
class Converged:
    """The finest run, its estimated relative errors, and until when [s] two runs agreed.

    The errors are infinite where no finer run reached the end.
    """

    run: Run
    share: float
    force: float
    peak: float
    certain: float


def integrate(
    scene: Scene,
    duration: float,
    tol: float,
    max_contacts: int,
    max_steps: int,
    method: str = "exact",
    step: float | None = None,
) -> SceneHistory:
    """The history of a scene; see `Scene.run`."""
    duration = checks.positive("duration", duration, "s")
    tol = checks.positive("tol", tol)
    if tol >= 1:
        raise InputError(f"tol is a relative error, 0 < tol < 1; got {tol:g}.")
    checks.whole("max_contacts", max_contacts)
    checks.whole("max_steps", max_steps)
    checks.instance("method", method, str, "'exact' or the name of an integrator")
    assembly = assemble(scene, duration)
    start(assembly)
    try:
        if method == "exact":
            if step is not None:
                raise InputError("method='exact' finds its own steps; give tol instead of step.")
            found = converge(assembly, duration, tol, max_contacts, max_steps)
        else:
            from antiosc.simulation.comparison import compared  # which is seldom needed

            found = compared(assembly, duration, method, tol, step, max_contacts, max_steps)
    finally:
        for kind, parameters in zip(assembly.system.kinds, assembly.system.params, strict=True):
            forget(int(kind), parameters)
    error = {} if step is not None else {"force": found.force, "peak": found.peak}
    status, message = verdict(found, tol, max_contacts, max_steps)
    if status == 0:
        gain = gained(assembly, found.run)
        if gain > GAIN:
            status, message = (
                1,
                (
                    f"The scene gained energy, {gain:.2g} of the highest that it had; use a smaller"
                    f" tol."
                ),
            )
    notes = " ".join([message, *never_touched(assembly, found.run), *assembly.notes])
    history = SceneHistory(assembly, found.run, error, status, notes)
    turned = history.largest_rotation()
    if turned[1] > 0.1:
        warn(
            f"{turned[0]!r} turned by {turned[1]:.2g} rad; rotations are taken as small, below"
            f" 0.1 rad.",
            AccuracyWarning,
        )
    if status:
        warn(message, AccuracyWarning)
    for contact, law in zip(scene.contacts, assembly.laws, strict=True):
        if law.valid_force == np.inf:
            continue
        peak = history[contact.a, contact.b].peak_force
        if peak > law.valid_force:
            raise AccuracyError(
                f"contact {contact.a!r}, {contact.b!r}: {law.out_of_range(peak, None)}."
            )
    return history


def start(assembly: Assembly) -> None:
    """Forces of the contacts that are closed at the start, at rest if the scene asks for it.

    Without preload only a load on a site without mass closes a contact at once.
    """
    system, laws = assembly.system, assembly.laws
    if assembly.scene.preload:
        system.q, system.pressed = settle(system, laws)
    else:
        system.pressed = closed(system, laws)
    if system.pressed.any():
        p = len(laws)
        delta = system.beta[:p] @ system.q - system.offsets[0, :p]
        delta = np.maximum(delta - system.R[:p, :p] @ system.pressed, 0.0)
        system.depth = np.maximum(system.depth, delta)
        system.given = sum(
            law.potential(float(d), law.touch(0.0)) for law, d in zip(laws, delta, strict=True)
        )
        system.given += 0.5 * float(system.pressed @ system.R[:p, :p] @ system.pressed)


def converge(
    assembly: Assembly, duration: float, tol: float, max_contacts: int, max_steps: int
) -> Converged:
    """Finer runs until the forces of two agree to the tolerance."""
    share, scale = FIRST * tol, 0.0
    fine = assembly.lasting / 200
    p = len(assembly.laws)
    massless = (assembly.system.R.diagonal()[:p] > 0).tolist()
    rated = any(
        law.rate_dependent and bare for law, bare in zip(assembly.laws, massless, strict=True)
    )
    finer = MOST if rated else SECOND
    best: Converged | None = None
    before: Run | None = None
    worse, failed, used = 0, 0, 0
    for _ in range(REFINEMENTS):
        room = max_steps - used
        if before is not None:
            room = min(room, max(DEARER * before.attempts, CHEAP))
        now = run(
            assembly.system,
            duration,
            share,
            scale=scale,
            fine=fine,
            max_contacts=max_contacts,
            max_steps=room,
        )
        used += now.attempts
        failed = failed + 1 if now.answer in (march.GREW, march.STUCK) else 0
        scale = max(float(abs(now.force[:, :p]).max()), 1e-300) if now.force.size else 0.0
        if not isfinite(scale):
            scale = 0.0
        if before is not None and now.answer == march.TOO_MANY_STEPS:
            if best is None:
                certain = difference(before, now, tol / left(finer, rated))[2]
                best = Converged(before, share * finer, np.inf, np.inf, certain)
            break
        if now.answer in (march.GREW, march.STUCK):
            finer = MOST
        elif before is not None:
            part = left(finer, rated)
            force, peak, certain = difference(before, now, tol / part)
            found = Converged(now, share, part * force, part * peak, certain)
            better = best is None or found.force < 0.7 * best.force
            worse = 0 if better else worse + 1
            if best is None or found.force <= best.force or found.force <= tol:
                best = found
            error = max(found.force, found.peak)
            if error <= tol or worse >= PATIENCE:
                return found if error <= tol else best
            finer = MORE if error <= NEAR * tol and not rated else MOST
        if now.answer in (march.TOO_MANY_CONTACTS, march.TOO_MANY_STEPS) or failed >= PATIENCE:
            break
        before = now if now.answer == march.DONE else None
        share /= finer
        if 2 * now.attempts > max_steps - used:
            break
    if best is None:
        best = Converged(now, share, np.inf, np.inf, 0.0)
    return best


def left(finer: float, rated: bool) -> float:
    """Error left in the finer of two runs, of their difference; `finer`: ratio of their shares."""
    ratio = finer ** (1 / 3) if rated else finer
    return MARGIN / (ratio - 1)


def verdict(found: Converged, tol: float, max_contacts: int, max_steps: int) -> tuple[int, str]:
    """Status and message of a run: 0 completed, 1 tolerance not met, 2 stopped before the end."""
    answer, t = found.run.answer, float(found.run.time[-1])
    if answer == march.TOO_MANY_CONTACTS:
        return 2, (
            f"Stopped at {t:g} s: more than {max_contacts} contacts (chatter); shorten the duration"
            f" or raise max_contacts."
        )
    if answer == march.TOO_MANY_STEPS:
        return 2, (
            f"Stopped at {t:g} s: more than {max_steps} steps; shorten the duration, use a larger"
            f" tol or raise max_steps."
        )
    if answer == march.GREW:
        return 2, f"Stopped at {t:g} s: the bodies gained energy; use a smaller tol."
    if answer == march.STUCK:
        return 2, (
            f"Stopped at {t:g} s: no step is small enough for the contact forces there; check the"
            f" laws' stiffness against the bodies' masses."
        )
    worst = max(found.force, found.peak)
    if worst == np.inf:
        if found.certain > 0:
            return 1, (
                f"The error is not known: a finer run takes too many steps. Up to"
                f" {found.certain:.4g} s the two agree; shorten the duration to that."
            )
        return 1, (
            f"The error is not known: max_steps = {max_steps} leaves no finer run to compare with;"
            f" raise it or shorten the duration."
        )
    if not worst <= tol:
        return 1, (
            f"The contact forces did not converge: finer runs differ by {worst:.2g}, not"
            f" tol = {tol:g} (they rattle, so that small errors grow). Up to {found.certain:.4g} s"
            f" they agree; shorten the duration to that."
        )
    return 0, "Completed."


def never_touched(assembly: Assembly, run: Run) -> list[str]:
    """A note on a run without any contact, which may come from a wrong sign."""
    system = assembly.system
    if run.touches or np.any(system.pressed):
        return []
    p = len(assembly.laws)
    speed = system.beta[:p] @ system.v
    if np.all(speed <= 0) and np.any(speed < 0):
        c = assembly.scene.contacts[int(np.argmin(speed))]
        return [
            f"No contact touched: {c.a!r}, {c.b!r} opens at {-speed.min():g} m/s at first; if it"
            f" should close, reverse the velocity or, for bodies of one coordinate, the ends."
        ]
    return [f"No contact touched within {run.time[-1]:g} s."]


def difference(coarse: Run, fine: Run, tol: float) -> tuple[float, float, float]:
    """Relative difference of the forces in the L2 norm and of their peak; until when they agree.

    Up to the end of the shorter run.
    """
    end = min(float(coarse.time[-1]), float(fine.time[-1]))
    gap, size, until, peaks = _apart(coarse, fine, end, np.inf)
    if size == 0.0:
        return (0.0, 0.0, end) if gap == 0.0 else (1.0, 1.0, 0.0)
    force, top = sqrt(gap / size), float(peaks[1].max())
    if force > tol:
        until = _apart(coarse, fine, end, tol**2 * size)[2]
    return force, float(abs(peaks[0] - peaks[1]).max()) / top, until


def _apart(a: Run, b: Run, end: float, limit: float) -> tuple[float, float, float, Array]:
    """Integrals of |F_a - F_b|^2 and |F_b|^2, when the first reaches a limit, peaks (2, m)."""
    m = a.force.shape[1]
    module = fitting_march(0)
    if module is not march and min(a.time.size, b.time.size) > 2:
        peaks = np.zeros((2, m))
        return (*module.compare(a.time, a.force, b.time, b.force, end, limit, peaks), peaks)
    time = np.concatenate((a.time, b.time))
    time.sort()
    time = time[time <= end]
    one, other = parabolas(a, time, m), parabolas(b, time, m)
    half = 0.5 * np.diff(time)
    apart, size = ((one - other) ** 2).sum(axis=1), (other**2).sum(axis=1)
    used = np.cumsum(half * (apart[:-1] + apart[1:]))
    beyond = np.flatnonzero(used > limit)
    until = float(time[1 + beyond[0]]) if beyond.size else end
    peaks = np.array([abs(one).max(axis=0), abs(other).max(axis=0)])
    return float(used[-1]), float(half @ (size[:-1] + size[1:])), until, peaks


def parabolas(run: Run, time: Array, p: int) -> Array:
    """Forces (n, p) of a run at times (n,)."""
    starts = run.time[::2]
    if starts.size < 2:
        return np.zeros((time.size, p))
    i = np.searchsorted(starts[1:-1], time, side="right")
    since, span = time - starts[i], np.diff(starts)[i]
    u = np.divide(since, span, out=np.zeros(time.size), where=span > 0)[:, None]
    u = np.minimum(np.maximum(u, 0.0), 1.0)
    f0, f1, f2 = (run.force[k::2, :p][i] for k in range(3))
    return np.asarray(f0 + u * ((4 * f1 - 3 * f0 - f2) + 2 * u * (f0 - 2 * f1 + f2)))
