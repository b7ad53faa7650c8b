"""Error control: the march is repeated with a finer share until its forces converge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, sqrt

import numpy as np

from antiosc import march
from antiosc.contact import ContactLaw
from antiosc.simulation.engine import Run, run
from antiosc.simulation.system import System

# Of the tolerance, the share of the first run; by what the second run divides it, and a third:
# by MORE if the estimate was at most NEAR times the tolerance, else by MOST.
FIRST, SECOND, MORE, MOST, NEAR = 0.5, 4.0, 4.0, 8.0, 1.5
FINEST = 1e-6  # share of the first run, at least: what the bound on steps permits is then known
# Error left in the finer run, of the difference of two whose shares have the ratio f, is
# 1/(f - 1) where errors follow the share, times this margin; where a law depends on the rate of
# what has no mass the order is 1 in the step, f^(1/3).
MARGIN = 2.0
# Error at least, over the share of the finer run: two runs with common steps differ by nothing.
FLOOR = 1.25
REFINEMENTS = 12  # runs
PATIENCE = 3  # runs without gain after which a scene counts as not convergent
# a finer run may take so many times the steps of the one before, twice being the rule, and so many
# at least: one that takes more is stopped
DEARER, CHEAP = 50, 50_000
FINE = 200  # touches closer than the expected contact time over this count as one


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
    laws: Sequence[ContactLaw],
    lasting: float,
    duration: float,
    tol: float,
    max_contacts: int,
    max_steps: int,
) -> Converged:
    """Finer runs until the forces of two agree to the tolerance.

    `lasting`: expected time of a contact [s], the shortest.
    """
    share, scale = max(FIRST * tol, FINEST), 0.0
    p = len(laws)
    massless = (system.R.diagonal()[:p] > 0).tolist()
    rated = any(law.rate_dependent and bare for law, bare in zip(laws, massless, strict=True))
    finer = MOST if rated else SECOND
    best: Converged | None = None
    before: Run | None = None
    worse, failed, used = 0, 0, 0
    for _ in range(REFINEMENTS):
        room = max_steps - used
        if before is not None:
            room = min(room, max(DEARER * before.attempts, CHEAP))
        now = run(
            system,
            duration,
            share,
            scale=scale,
            fine=lasting / FINE,
            max_contacts=max_contacts,
            max_steps=room,
        )
        used += now.attempts
        failed = failed + 1 if now.answer in (march.GREW, march.STUCK) else 0
        scale = max(float(now.force[:, :p].max()), 1e-300) if now.force.size else 0.0
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
            force = max(part * force, FLOOR * share)
            # the peak is one value, whose differences change sign from run to run
            found = Converged(now, share, force, max(force, part * peak), certain)
            better = best is None or found.force < 0.7 * best.force
            worse = 0 if better else worse + 1
            if best is None or found.force <= best.force or found.force <= tol:
                best = found
            if found.worst <= tol or worse >= PATIENCE:
                return found if found.worst <= tol else best
            finer = MORE if found.worst <= NEAR * tol and not rated else MOST
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


def difference(coarse: Run, fine: Run, tol: float) -> tuple[float, float, float]:
    """Relative difference of the forces in the L2 norm and of their peak; until when they agree.

    Up to the end of the shorter run.
    """
    end = min(float(coarse.time[-1]), float(fine.time[-1]))
    if min(coarse.time.size, fine.time.size) < 3:  # one stopped at once
        return 0.0, 0.0, end
    both = coarse.time, coarse.force, fine.time, fine.force, end
    gap, size, until, peaks = march.compare(*both, np.inf)
    if size == 0.0:
        return (0.0, 0.0, end) if gap == 0.0 else (1.0, 1.0, 0.0)
    force, (one, other) = sqrt(gap / size), peaks.tolist()
    if force > tol:
        until = march.compare(*both, tol**2 * size)[2]
    apart = max(abs(a - b) for a, b in zip(one, other, strict=True))
    return force, apart / max(other), until
