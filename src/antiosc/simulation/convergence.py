"""Error control: the march is repeated with smaller steps until its forces have converged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc._types import Array
from antiosc.simulation import march
from antiosc.simulation.engine import Run, System, run

# the share of the first run over the tolerance: so that three runs tell the rate of convergence;
# with chords, whose error asks for short steps anyway, so that the difference of two suffices
START, START_WITH_CHORDS = 8.0, 0.5
FINER = 8.0  # the share from one run to the next: steps half as long
FINEST = 512.0  # the largest factor between two runs
# error left in the finer of two runs, of their difference: at least an eighth, where the forces
# converge as they should; by the rate of convergence that three runs show, with a margin; all of it
# where they show none
LEFT, MARGIN, SLOWEST_RATE = 0.125, 1.5, 0.5
MOST = 12  # runs
PATIENCE = 3  # runs without gain after which a scene counts as not convergent
# a finer run may take so many times the steps of the one before, twice being the rule, and so many
# at least: one that takes more is stopped
DEARER, CHEAP = 50, 150_000
FINE = 200  # touches that are closer than the expected contact time over this count as one
COARSEST = 0.1  # share of the first run, at most
SAFETY = 1.2  # on the sum of the errors
AIM = 0.7  # share of the tolerance that the nodes of the next run are aimed at


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

    @property
    def worst(self) -> float:
        """The larger of the two errors."""
        return max(self.force, self.peak)


def converge(
    system: System,
    duration: float,
    tol: float,
    max_contacts: int,
    max_steps: int,
    *,
    fine: float,
    chords: bool = False,
) -> Converged:
    """Finer runs until the forces of two agree to the tolerance.

    Parameters
    ----------
    system, duration : what moves, and for how long [s].
    tol : relative error of the forces in the L2 norm, and of their peak.
    max_contacts, max_steps : limits of the computing effort.
    fine : time [s] below which two touches are not distinguished.
    chords : the result is read as linear between the nodes, whose error counts too.
    """
    p, m = system.kinds.size, len(system.beta)
    start = START_WITH_CHORDS if chords else START
    share, scale, factor = min(start * tol, COARSEST), 0.0, FINER
    best: Converged | None = None
    before: Run | None = None
    apart = 0.0  # difference of the last two runs
    worse, failed, used = 0, 0, 0
    for _ in range(MOST):
        room = max_steps - used
        if before is not None:
            room = min(room, max(DEARER * before.attempts, CHEAP))
        now = run(
            system,
            duration,
            share,
            scale=scale,
            fine=fine,
            max_contacts=max_contacts,
            max_steps=room,
        )
        used += now.attempts
        failed = failed + 1 if now.answer in (march.GREW, march.STUCK) else 0
        scale = max(float(np.abs(now.force[:, :p]).max()), 1e-300) if now.force.size else 0.0
        if not np.isfinite(scale):
            scale = 0.0
        if before is not None and now.answer == march.TOO_MANY_STEPS:
            if best is None:
                certain = difference(before, now, m, tol)[2]
                best = Converged(before, share * factor, np.inf, np.inf, certain)
            break
        bent = chord_error(now) if chords else (0.0, 0.0)
        if before is not None and now.answer not in (march.GREW, march.STUCK):
            force, peak, certain = difference(before, now, m, tol)
            left = error_left(force, apart)
            found = estimated(now, share, left * force, left * peak, bent, certain)
            apart = force
            better = best is None or found.force < 0.7 * best.force
            worse = 0 if better else worse + 1
            if best is None or found.force <= best.force or found.force <= tol:
                best = found
            if found.worst <= tol or worse >= PATIENCE:
                return found if found.worst <= tol else best
        if now.answer in (march.TOO_MANY_CONTACTS, march.TOO_MANY_STEPS) or failed >= PATIENCE:
            break
        before = now if now.answer == march.DONE else None
        if 2 * now.attempts > max_steps - used:
            break
        # the error of chords falls with the square of the step
        factor = max(FINER, min((max(bent) / (AIM * tol)) ** 1.5, FINEST))
        share /= factor
    if best is None:
        best = Converged(now, share, np.inf, np.inf, 0.0)
    return best


def estimated(
    run: Run, share: float, force: float, peak: float, bent: tuple[float, float], certain: float
) -> Converged:
    """The run with its errors: of the march and of the chords, whose sum may be a little more.

    The peak is one value of the force, and its differences change sign from run to run; its error
    is never taken below that of the force.
    """
    force = SAFETY * (force + bent[0])
    return Converged(run, share, force, max(force, SAFETY * (peak + bent[1])), certain)


def error_left(apart: float, before: float) -> float:
    """Share of the difference of two runs that is left as error in the finer one.

    `before` is the difference of the two runs before, 0 if there is none: then nothing is known of
    the rate, and the difference itself is the error.
    """
    if before == 0.0:
        return 1.0
    rate = apart / before
    return max(LEFT, MARGIN * rate / (1 - rate)) if rate < SLOWEST_RATE else MARGIN


def stopped(answer: int, t: float, max_contacts: int, max_steps: int) -> str:
    """Why the march stopped at t before the end; empty if it did not."""
    return {
        march.TOO_MANY_CONTACTS: (
            f"stopped at {t:g} s: more than {max_contacts} contacts (chatter); shorten the duration"
            f" or raise max_contacts"
        ),
        march.TOO_MANY_STEPS: (
            f"stopped at {t:g} s: more than {max_steps} steps; shorten the duration, use a larger"
            f" tol or raise max_steps"
        ),
        march.GREW: f"stopped at {t:g} s: the bodies gained energy; use a smaller tol",
        march.STUCK: (
            f"stopped at {t:g} s: no step is small enough for the contact forces there; check the"
            f" laws' stiffness against the bodies' masses"
        ),
    }.get(answer, "")


def difference(coarse: Run, fine: Run, p: int, tol: float) -> tuple[float, float, float]:
    """Relative difference of the forces in the L2 norm and of their peak; until when they agree.

    Up to the end of the shorter run.
    """
    time = np.union1d(coarse.time, fine.time)
    time = time[time <= min(coarse.time[-1], fine.time[-1])]
    a, b = parabolas(coarse, time, p), parabolas(fine, time, p)
    weight = np.zeros(time.size)
    step = np.diff(time)
    weight[:-1] += step / 2
    weight[1:] += step / 2
    gap = weight @ (a - b) ** 2
    size = float((weight @ b**2).sum())
    if size == 0.0:
        same = not np.any(a)
        return (0.0, 0.0, float(time[-1])) if same else (1.0, 1.0, 0.0)
    top = float(np.abs(b).max())
    # how much of the norm the difference has used up as time goes on
    used = np.cumsum(weight * ((a - b) ** 2).sum(axis=1))
    beyond = np.flatnonzero(np.sqrt(used / size) > tol)
    certain = float(time[beyond[0]]) if beyond.size else float(time[-1])
    return (
        float(np.sqrt(gap.sum() / size)),
        float(np.max(np.abs(np.abs(a).max(axis=0) - np.abs(b).max(axis=0)))) / top,
        certain,
    )


def parabolas(run: Run, time: Array, p: int) -> Array:
    """Forces (n, p) of a run at times (n,)."""
    starts = run.time[::2]
    if starts.size < 2:
        return np.zeros((time.size, p))
    i = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, starts.size - 2)
    span = starts[i + 1] - starts[i]
    u = (np.clip((time - starts[i]) / np.where(span > 0, span, 1.0), 0.0, 1.0))[:, None]
    f0, f1, f2 = (run.force[2 * i + k, :p] for k in range(3))
    return np.asarray(f0 * (1 - u) * (1 - 2 * u) + 4 * f1 * u * (1 - u) + f2 * u * (2 * u - 1))


def chord_error(run: Run) -> tuple[float, float]:
    """Relative error of forces that are read as linear between the nodes: L2 norm and peak."""
    f0, f1, f2 = run.force[:-2:2], run.force[1:-1:2], run.force[2::2]
    h = (run.time[2::2] - run.time[:-2:2])[:, None]
    top = float(np.abs(run.force).max(initial=0.0))
    if top == 0.0:
        return 0.0, 0.0
    bend = f0 - 2 * f1 + f2
    # of the parabola through three values: integral of its square, and of the gap to its chords
    size = (h / 15 * (2 * f0**2 + 2 * f2**2 + 8 * f1**2 + 2 * f1 * (f0 + f2) - f0 * f2)).sum()
    gap = (h / 120 * bend**2).sum()
    slope = f2 - f0
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = np.where(np.abs(slope) < 2 * np.abs(bend), slope**2 / (8 * np.abs(bend)), 0.0)
    peak = np.where(np.abs(f1) + beyond > np.abs(run.force).max(axis=0), beyond, 0.0)
    return float(np.sqrt(gap / size)), float(peak.max()) / top
