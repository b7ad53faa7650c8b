"""The limits that an extraction has to meet in its own check."""

from __future__ import annotations

from typing import TYPE_CHECKING

from antiosc.errors import AccuracyError, AccuracyWarning
from antiosc.fem import mpi

if TYPE_CHECKING:
    from mpi4py import MPI

#: Limits of the self-check, relative: residual, M-orthogonality, constraint, mass balance.
CHECK = 1e-6
#: Up to this many times a limit a result is usable, with a warning; beyond, it is refused.
USABLE = 100
#: Limit of the residual: rounding in K alone is 1e-6 of Kφ for a mode on soft springs, with little
#: strain; the error of ω² is the square of it.
FORCES = 1e-5
#: ω² over the shift below which a mode is a mechanism: the shift has the size of the first elastic.
MECHANISM = 1e-9
#: A Ritz pair with a smaller residual (of forces, relative) is an antiresonance: its frequency is
#: then right to about the square of this.
CONVERGED = 1e-3


def judge(name: str, value: float, limit: float, comm: MPI.Comm) -> None:
    """Accept a measured error, warn of it, or refuse it."""
    if value <= limit:
        return
    why = (
        "the matrices are ill-conditioned by very slender or thin parts, penalties, very uneven "
        "elements or materials: take fewer elements, more even ones, smaller penalties."
    )
    if not value <= USABLE * limit:
        raise AccuracyError(
            f"the constraint modes fail their own check: {name} {value:.1e}, limit "
            f"{USABLE * limit:.0e}; {why}"
        )
    mpi.warn(
        comm,
        f"the constraint modes satisfy their check only to {value:.1e} ({name}, usually below "
        f"{limit:.0e}): {why}",
        AccuracyWarning,
    )
