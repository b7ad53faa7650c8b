"""Checks of computed modes: their residuals, orthogonality and mass."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, AccuracyWarning
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.platform import warn
from antiosc.fem.structure.structure import Structure
from antiosc.reduce.extraction.eigenmodes import Modes, allowed, residuals
from antiosc.reduce.extraction.oscillators import ConstraintModes

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


def check_limit(name: str, value: float, limit: float, comm: MPI.Comm) -> None:
    """Warn of a measured error above `limit`; AccuracyError for one above USABLE times `limit`."""
    if value <= limit:
        return
    reason = (
        "the matrices are ill-conditioned by very slender or thin parts, penalties, very uneven "
        "elements or materials: take fewer elements, more even ones, smaller penalties."
    )
    if not value <= USABLE * limit:
        raise AccuracyError(
            f"the constraint modes fail their own check: {name} {value:.1e}, limit "
            f"{USABLE * limit:.0e}; {reason}"
        )
    warn(
        comm,
        f"the constraint modes satisfy their check only to {value:.1e} ({name}, usually below "
        f"{limit:.0e}): {reason}",
        AccuracyWarning,
    )


def checked_modes(
    structure: Structure, known: ConstraintModes, method: str
) -> tuple[dict[str, float], int]:
    """Check constraint modes in their equations; AccuracyError for errors far above CHECK.

    Ritz pairs may have large residuals, but must be orthogonal in K and in M.

    Returns
    -------
    The measured errors by name, and the number of modes that have converged.
    """
    modes = known.modes
    static = known.static
    comm = structure.comm
    if len(modes.omega) and modes.omega[0] ** 2 < MECHANISM * structure.shift:
        raise AccuracyError(
            f"the structure moves without strain (ω = {modes.omega[0]:.1e} rad/s) but not as a "
            "rigid body: some part is attached by a hinge, a single common point or line; join it "
            "along a face."
        )
    residual_forces = known.off
    scale = np.sqrt(modes.omega**2 + structure.shift)
    projection = (known.stiffnesses - np.diag(modes.omega**2)) / np.outer(scale, scale)
    strain = dot(comm, static.phi, multiply(structure.K, static.phi)) - static.k0
    sites = np.sqrt((static.k0 + structure.shift * static.mass).diagonal())
    equation = {"residual": residual_forces} if method == "modes" else {"projection": projection}
    measured = {
        **{name: float(np.abs(value).max(initial=0.0)) for name, value in equation.items()},
        "orthogonality": float(
            np.abs(known.masses - np.eye(len(residual_forces))).max(initial=0.0)
        ),
        "constraint": _displacement(comm, static.load, modes.phi),
        "mass": _excess(static.mass, known.P),
        "stiffness": float(np.abs(strain / np.outer(sites, sites)).max()),
    }
    for name, value in measured.items():
        check_limit(name, value, FORCES if name == "residual" else CHECK, comm)
    return measured, int(np.sum(residual_forces < CONVERGED))


def _displacement(comm: MPI.Comm, load: Array, phi: Array) -> float:
    """Largest displacement of a site in the modes, relative to the norms of load and mode."""
    squares = [comm.allreduce(np.einsum("ij,ij->j", x, x)) for x in (load, phi)]
    sizes = np.sqrt(np.outer(*squares))
    return float((np.abs(dot(comm, load, phi)) / sizes).max(initial=0.0))


def _excess(mass: Array, P: Array) -> float:
    """Largest relative excess of the modes' masses over the mass of the static shapes."""
    scale = 1 / np.sqrt(np.maximum(mass.diagonal(), np.finfo(float).tiny))
    remaining_mass = (mass - P.T @ P) * scale[:, None] * scale
    return max(0.0, -float(np.linalg.eigvalsh(remaining_mass)[0]))


def check_modes(structure: Structure, modes: Modes) -> None:
    """Measure the modes' M-orthogonality and residual; AccuracyError beyond CHECK, or beyond what
    rounding of K leaves of the residual.
    """
    gram = dot(structure.comm, modes.phi, multiply(structure.M, modes.phi))
    worst = {
        "orthogonality": np.abs(gram - np.eye(len(gram))).max(initial=0.0),
        "residual": CHECK
        * (residuals(structure, modes) / allowed(structure, modes)).max(initial=0.0),
    }
    for name, value in worst.items():
        if not value <= CHECK:
            raise AccuracyError(
                f"the natural modes fail their own check: {name} {value:.1e}, limit {CHECK:.0e};"
                " the matrices may be ill-conditioned (very uneven elements or materials)."
            )
