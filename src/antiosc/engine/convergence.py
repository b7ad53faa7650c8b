"""Runs whose steps are refined until their forces converge, and what stopped one before its end."""

from __future__ import annotations

from dataclasses import dataclass

from antiosc.engine import library
from antiosc.engine.march import Run, solve
from antiosc.engine.system import System

FINE = 200  # touches closer than the expected contact time over this count as one


@dataclass(eq=False)
class Converged:
    """The finest run, estimated relative errors, and the time [s] up to which two runs agree.

    `share`: what its steps were chosen by, or the step [s]. The errors are infinite where no finer
    run reached the end.
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
    contact_time_estimate: float,
    duration: float,
    tol: float,
    max_contacts: int,
    max_steps: int,
) -> Converged:
    """Refine a run until the forces of two runs agree to the tolerance, by `aom_solve`.

    `contact_time_estimate`: expected time of a contact [s], the shortest.
    """
    fine = contact_time_estimate / FINE
    options = library.Options(duration, tol, 0.0, 0.0, fine, max_contacts, max_steps, 0)
    run, found = solve(system, options)
    return Converged(run, found.share, found.force, found.peak, found.certain)


def stopped(answer: int, t: float, max_contacts: int, max_steps: int) -> str:
    """Why the integration stopped at t before the end; "" if it did not."""
    if answer == library.DONE:
        return ""
    return {
        library.TOO_MANY_CONTACTS: (
            f"stopped at {t:g} s: more than {max_contacts} contacts (chatter); shorten the duration"
            f" or raise max_contacts"
        ),
        library.TOO_MANY_STEPS: (
            f"stopped at {t:g} s: more than {max_steps} steps; shorten the duration, use a larger"
            f" step or tol, or raise max_steps"
        ),
        library.GREW: f"stopped at {t:g} s: the bodies gained energy; use a smaller step or tol",
        library.STUCK: (
            f"stopped at {t:g} s: no step is small enough for the contact forces there; check the"
            f" laws' stiffness against the bodies' masses"
        ),
    }.get(answer, "")


def difference(coarse: Run, fine: Run, tol: float) -> tuple[float, float, float]:
    """Relative differences of force (L2 norm, impulse) and peak; the time up to which they are
    small.

    Up to the end of the shorter run.
    """
    return library.compare(coarse.time, coarse.force, fine.time, fine.force, tol)
