"""The natural modes of a uniform beam in closed form, which benchmarks and tests compare with."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array
from antiosc.models.body import ModalModel
from antiosc.models.closed_form import ACROSS, StruckBeam
from antiosc.models.modal import ModalBody


def modes(
    struck: StruckBeam, n: int, x: ArrayLike = (), *, static_correction: bool = False
) -> ModalModel:
    """The first n natural modes that move the site, the rigid-body one included.

    Rigid-body motions that leave the site at rest are before them, with b = 0. The coordinates
    are the deflections at x [m]. With `static_correction` the static deflection of the
    truncated modes is included.
    """
    points = struck._points_on(x)
    rigid = min(struck.rigid_modes, 1)
    solved, omega, phi, b = struck._observable(n - rigid, held=False)
    if rigid:
        swing = solved.static / math.sqrt(solved.m_st)
        phi = np.column_stack((swing, phi))
        omega, b = np.append(0.0, omega), np.append(solved.at_site @ swing, b)

    mass = struck.beam.mass
    hidden = solved.hidden.shape[1]
    phi = np.column_stack((solved.hidden, phi * np.sign(b))) / math.sqrt(mass)
    b = np.append(np.zeros(hidden), np.abs(b)) / math.sqrt(mass)
    omega = np.append(np.zeros(hidden), omega * struck.beam.omega_unit)
    at_points = solved.motions(points / struck.beam.length)[0]
    r, residual = 0.0, np.zeros(solved.size)
    if static_correction:
        elastic = omega > 0
        modal = b[elastic] / omega[elastic] ** 2
        flexibility = struck.beam.length**3 / struck.beam.EI
        residual = flexibility * solved.deflection - phi[:, elastic] @ modal
        r = max(float(solved.at_site @ residual), 0.0)

    momenta = mass * solved.moved @ phi
    return ModalModel(
        ModalBody(
            omega,
            b,
            r,
            weight=momenta[0],
            shape=at_points @ phi,
            residual=at_points @ residual,
            basis=(np.eye(points.size),),
            direction=ACROSS,
            inertia=struck._inertia_of(momenta),
        )
    )


def frequencies(struck: StruckBeam, n: int, *, held: bool = False) -> Array:
    """The first n frequencies > 0 in rad/s, with the site `held` the antiresonances, those that the
    site does not see included.
    """
    return struck._in_polynomials(n).lowest(n, held=held)[0] * struck.beam.omega_unit
