"""Motions of a uniform beam in closed form, which benchmarks and tests compare with."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import ModalModel
from antiosc.models.closed_form import PolynomialBeam, StruckBeam
from antiosc.models.modal import ModalBody
from antiosc.models.motion import Inertia

#: Direction of the impact, the beam on x.
ACROSS = np.array([0.0, 1.0, 0.0])


@functools.cache
def _gauss_points() -> tuple[Array, Array]:
    """Points and weights on [-1, 1] for the moments of any shape here."""
    return np.polynomial.legendre.leggauss(300)


def inertia_of(struck: StruckBeam, solved: PolynomialBeam, shapes: Array) -> Inertia | None:
    """The inertia of a free beam along x that moves along y; None for a supported one."""
    if not solved.rigid.shape[1]:
        return None
    beam, length = struck.beam, struck.beam.length
    nodes, rule = _gauss_points()
    w, theta = solved.motions((nodes + 1) / 2)
    rule = rule / 2
    turning = (rule * nodes / 2) @ w + beam.alpha * (rule @ theta)
    momentum = np.zeros((shapes.shape[1], 6))
    momentum[:, 1] = beam.mass * solved.moved @ shapes
    momentum[:, 5] = beam.mass * length * (turning @ shapes)
    matrix = np.zeros((6, 6))
    matrix[1, 1] = beam.mass
    matrix[5, 5] = beam.mass * length**2 * (1 / 12 + beam.alpha)
    return Inertia(np.array([length / 2, 0, 0]), matrix, momentum)


def anti_oscillators(struck: StruckBeam, n: int, x: ArrayLike = ()) -> AntiOscillators:
    """The beam's model with its shapes at the points x [m], Article (8), and its rigid motions."""
    solved, _, phi, c = struck._observable(n)
    shapes = np.column_stack((solved.static, c * phi))
    hidden = solved.hidden / math.sqrt(struck.beam.mass)
    inertia = inertia_of(struck, solved, np.column_stack((shapes, hidden)))
    points = np.asarray(x, dtype=float)
    w = solved.motions(np.atleast_1d(points) / struck.beam.length)[0]

    return replace(
        struck.anti_oscillators(n),
        shapes=w @ shapes if points.size else None,
        hidden=w @ hidden if points.size and inertia else None,
        direction=ACROSS,
        inertia=inertia,
    )


def modes(
    struck: StruckBeam, n: int, x: ArrayLike = (), *, static_correction: bool = False
) -> ModalModel:
    """The first n natural modes that move the site, the rigid-body one included.

    Rigid-body motions that leave the site at rest are before them, with b = 0. The coordinates
    are the deflections at x [m]. With `static_correction` the static deflection of the
    truncated modes is included.
    """
    points = np.atleast_1d(np.asarray(x, dtype=float))
    rigid = min(struck._in_polynomials(0).rigid.shape[1], 1)
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

    return ModalModel(
        ModalBody(
            omega,
            b,
            r,
            weight=mass * solved.moved @ phi,
            shape=at_points @ phi,
            residual=at_points @ residual,
            basis=(np.eye(points.size),),
            direction=ACROSS,
            inertia=inertia_of(struck, solved, phi),
        )
    )


def frequencies(struck: StruckBeam, n: int, *, held: bool = False) -> Array:
    """The first n frequencies > 0 in rad/s, with the site `held` the antiresonances, those that the
    site does not see included.
    """
    return struck._in_polynomials(n).lowest(n, held=held)[0] * struck.beam.omega_unit
