"""Struck plates on simple supports: in three dimensions (Navier), and as shells with a disc.

Both are sums over wave numbers k of the plate's sines. Of the elastic layer the two lowest waves
(bending and stretching) are modes of one element of high order through the thickness; the others
follow the force at once, with the static layer's compliance (Sneddon) that is left. The half-space
of the contact is not part of it: the contact's law has that.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import pi, sqrt

import numpy as np
from numpy.polynomial import legendre
from scipy.interpolate import CubicSpline

from antiosc.models.body import ModalModel
from antiosc.models.modal import ModalBody

#: kh up to which waves are modes, the least that is solved, waves between, order of the element.
MODES, LEAST, WAVES, ORDER = 4.0, 0.1, 120, 16
#: kh beyond which the layer is a half-space, and the images of the half-space in each direction.
SHORT, IMAGES = 14.0, 30


@dataclass(frozen=True)
class Plate:
    """A plate of sides a and b [m], struck at (x, y)."""

    E: float
    nu: float
    rho: float
    h: float
    a: float
    b: float
    x: float
    y: float

    def waves(self, longest: float) -> tuple[np.ndarray, np.ndarray]:
        """Wave numbers up to `longest` [1/m], and the squares of their unit-norm sines there."""
        m, n = (np.arange(1, int(longest * side / pi) + 2) for side in (self.a, self.b))
        along, across = (
            np.sin(i * pi * p) ** 2 for i, p in ((m, self.x / self.a), (n, self.y / self.b))
        )
        squares = 4 / (self.a * self.b) * np.outer(along, across)
        k = pi * np.hypot(m[:, None] / self.a, n / self.b)
        kept = (k < longest) & (squares > 1e-14 / (self.a * self.b))
        return k[kept], squares[kept]

    @property
    def stiffness(self) -> float:
        return self.E * self.h**3 / (12 * (1 - self.nu**2))


def spread(z: np.ndarray) -> np.ndarray:
    """Transform of Hertz's pressure on a disc, z = k a."""
    large = np.maximum(z, 0.02)
    return np.where(z > 0.02, 3 * (np.sin(large) - large * np.cos(large)) / large**3, 1 - z**2 / 10)


def _body(omega: np.ndarray, squares: np.ndarray, compliance: float) -> ModalModel:
    """The body of these modes and this static compliance."""
    order = np.argsort(omega)
    left = compliance - float(np.sum(squares / omega**2))
    modes = ModalBody(omega[order], np.sqrt(squares[order]), max(left, 0.0))
    return ModalModel(modes, max(-left, 0.0))


def shell(plate: Plate, disc: float = 1.0, local: float = 0.0) -> ModalModel:
    """The Reissner-Mindlin plate, its load on a disc of this radius over the thickness.

    `local`: compliance [m/N] that is subtracted from the contact's.
    """
    k, sines = plate.waves(25 / (disc * plate.h))
    squares = sines * spread(k * disc * plate.h) ** 2
    mass, inertia = plate.rho * plate.h, plate.rho * plate.h**3 / 12
    S, D = 5 / 6 * plate.E / (2 * (1 + plate.nu)) * plate.h, plate.stiffness
    compliance = float(np.sum(squares * (1 / (D * k**4) + 1 / (S * k**2))))
    low = k * plate.h < MODES
    k, squares = k[low], squares[low]
    half = (mass * (D * k**2 + S) + S * k**2 * inertia) / 2
    omega2 = S * D * k**4 / (half + np.sqrt(half**2 - mass * inertia * S * D * k**4))
    turned = (S * k**2 - mass * omega2) / (S * k)
    body = _body(np.sqrt(omega2), squares / (mass + inertia * turned**2), compliance)
    return ModalModel(body.modes, local)


def layer(plate: Plate) -> ModalModel:
    """The plate in three dimensions, pushed at a point of one face."""
    nu, h = plate.nu, plate.h
    k, sines = plate.waves(SHORT / h)
    G = plate.E / (2 * (1 + nu))
    compliance = float(np.sum(sines * _beyond_half_space(k * h, nu))) * h / plate.E
    compliance += (1 - nu) / (2 * pi * G) * _images(plate)
    kh = np.linspace(LEAST, MODES * 1.02, WAVES)
    bending, flexed, stretching, pinched = np.array([_waves(each, nu) for each in kh]).T
    low = k * h < MODES
    at, sines = (k * h)[low], sines[low]

    def smooth(values: np.ndarray, limit: float) -> np.ndarray:
        """Values at all modes, of which the limit for long waves is known."""
        return CubicSpline(np.append(0.0, kh**2), np.append(limit, values))(at**2)

    thin = sqrt(12 * (1 - nu**2))
    omega = [
        smooth(bending / kh**2 * np.sqrt(1 + kh**2), 1 / thin) * at**2 / np.sqrt(1 + at**2),
        smooth(stretching / kh, 1 / sqrt(1 - nu**2)) * at,
    ]
    squares = [smooth(flexed, 1.0), smooth(pinched / kh**2, (nu / 2 / (1 - nu)) ** 2) * at**2]
    unit = sqrt(plate.E / plate.rho) / h
    masses = sines / (plate.rho * h)
    return _body(
        unit * np.concatenate(omega),
        np.concatenate([masses * part for part in squares]),
        compliance,
    )


def _beyond_half_space(kh: np.ndarray, nu: float) -> np.ndarray:
    """Displacement of the pushed face of a layer that is more than a half-space's (E = h = 1)."""
    x = kh / 2
    shares = np.cosh(x) ** 2 / (np.sinh(kh) - kh) + np.sinh(x) ** 2 / (np.sinh(kh) + kh) - 1
    return 2 * (1 - nu**2) / kh * shares


def _images(plate: Plate) -> float:
    """Sum of ±1/r over the images of the point in the edges [1/m]."""
    i, j = np.meshgrid(*2 * [np.arange(-IMAGES, IMAGES + 1)], indexing="ij")
    total = 0.0
    for sx in (1, -1):
        for sy in (1, -1):
            dx = 2 * i * plate.a + (sx - 1) * plate.x
            r = np.hypot(dx, 2 * j * plate.b + (sy - 1) * plate.y)
            total += sx * sy * float(np.sum(1 / np.where(r > 0, r, np.inf)))
    return total


def _waves(kh: float, nu: float) -> tuple[float, ...]:
    """ω and b² of the lowest bending and stretching waves of a layer with E = rho = h = 1.

    The motion is U(z) sin kx and W(z) cos kx, pushed by a pressure cos kx on the upper face.
    """
    z, weights, slope = _lobatto()
    size = z.size
    one, none, mass = np.eye(size), np.zeros((size, size)), np.tile(weights, 2)
    along, across = np.hstack([kh * one, none]), np.hstack([none, slope])
    shear = np.hstack([slope, -kh * one])
    lame, G = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))
    K = sum(
        factor * strain.T @ (weights[:, None] * strain)
        for factor, strain in ((lame, along + across), (2 * G, along), (2 * G, across), (G, shear))
    )
    scale = 1 / np.sqrt(mass)
    omega2, modes = np.linalg.eigh(scale[:, None] * K * scale)
    upper, lower = (modes * scale[:, None])[[2 * size - 1, size]]
    bends = upper * lower > 0
    first = [np.flatnonzero(kind)[0] for kind in (bends, ~bends)]
    return tuple(number for i in first for number in (sqrt(omega2[i]), upper[i] ** 2))


@cache
def _lobatto() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of −1/2 to 1/2, weights and the matrix of derivatives of Lobatto's rule."""
    last = np.append(np.zeros(ORDER), 1.0)
    inner = legendre.legroots(legendre.legder(last)).real
    x = np.concatenate([[-1.0], np.sort(inner), [1.0]])
    values = legendre.legval(x, last)
    distance = np.subtract.outer(x, x) + np.eye(x.size)
    slope = values[:, None] / values / distance
    np.fill_diagonal(slope, 0.0)
    slope[0, 0] = -ORDER * (ORDER + 1) / 4
    slope[-1, -1] = -slope[0, 0]
    return x / 2, 1 / (ORDER * (ORDER + 1) * values**2), 2 * slope
