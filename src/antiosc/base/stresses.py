"""Scalars and directions of stress and strain tensors, and the strengths of a ply.

A tensor is an array (..., 3, 3), as `probe` returns it. Six numbers (..., 6) are the components 11,
22, 33, 23, 13, 12 of a stress. The exposure of a ply (`Strengths`) is the inverse of the strength
ratio R, the factor by which all stresses may grow until failure. It is proportional to the load, so
that 1/exposure − 1 is a margin of safety.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike
from antiosc.base.checks import Checked, checked_by, positive, within_range
from antiosc.base.errors import InputError

#: Axes of the six components of a symmetric tensor: 11, 22, 33, 23, 13, 12.
COMPONENT_AXES = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
#: Number of the component (3, 3) at each place of a tensor.
TENSOR_PLACES = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
#: Asymmetry of a tensor, over its largest entry, that is rounding.
ASYMMETRY_TOLERANCE = 1e-9


@checks.within_range
def von_mises(stress: ArrayLike) -> Array:
    """Von Mises equivalent stress (...,) [Pa] of stresses (..., 3, 3) or (..., 6).

    Raises
    ------
    InputError
        Arrays that are not symmetric tensors.
    """
    return von_mises_of_components(components("stress", stress))


@checks.within_range
def principal(tensor: ArrayLike) -> Array:
    """Principal values (..., 3) of stresses or strains (..., 3, 3) or (..., 6), largest first.

    Six numbers are components of a tensor: a shear strain is then half the angle γ.
    """
    return np.asarray(np.linalg.eigvalsh(tensors("tensor", tensor))[..., ::-1])


@checks.within_range
def delamination_load(D: float, G: float) -> float:
    """Static load [N] at which a delamination in the middle of a plate grows, π √(32 D G/3).

    A circular delamination of radius a halves the thickness, so that two plates of stiffness D/8
    deflect by F a²/(4 π D) at their centre, instead of F a²/(16 π D) before. The energy release
    rate F²/2 dC/d(π a²) = 3 F²/(32 π² D) does not depend on a: delaminations of any size begin to
    grow at this load. It holds for a quasi-isotropic laminate in small deflection under a point
    load, without shear deformation. Compare it with `peak_force`; a factor for short impacts, in
    which the plate does not reach its static shape, is not included.

    Parameters
    ----------
    D : float
        Bending stiffness of the plate, N m: E h³/(12 (1 - nu²)), or about √(D11 D22) of a laminate.
    G : float
        Critical energy release rate in mode II, J/m².
    """
    D = checks.positive("D", D, "N m")
    G = checks.positive("G", G, "J/m²")
    return float(np.pi * np.sqrt(32 * D * G / 3))


def tensors(name: str, value: object) -> Array:
    """Symmetric tensors (..., 3, 3) from tensors, or from six components (..., 6)."""
    array = checks.floats(name, value, None)
    if array.shape[-2:] == (3, 3):
        size = np.abs(array).max(initial=0.0)
        if np.abs(array - np.swapaxes(array, -1, -2)).max(initial=0.0) > ASYMMETRY_TOLERANCE * size:
            raise InputError(f"{name} must be symmetric.")
        return array
    if array.ndim and array.shape[-1] == 6:
        return tensors_of_components(array)

    raise InputError(
        f"{name} must hold tensors (..., 3, 3), as probe returns them, or six components "
        f"(..., 6) in the order 11, 22, 33, 23, 13, 12; got shape {array.shape}."
    )


def components(name: str, value: object) -> Array:
    """The components 11, 22, 33, 23, 13, 12 (..., 6), from symmetric tensors or components."""
    s = tensors(name, value)
    return np.stack([s[..., i, j] for i, j in COMPONENT_AXES], axis=-1)


def von_mises_of_components(components: Array) -> Array:
    """Von Mises's stress (...,) of components 11, 22, 33, 23, 13, 12 (..., 6)."""
    normal = components[..., :3]
    shear = components[..., 3:]
    mean = normal.mean(axis=-1, keepdims=True)
    squares = np.sum((normal - mean) ** 2, axis=-1) + 2 * np.sum(shear**2, axis=-1)
    return np.asarray(np.sqrt(1.5 * squares))


def vector_length(vectors: Array) -> Array:
    """Lengths (...,) of vectors (..., c)."""
    return np.asarray(np.sqrt(np.einsum("...c,...c->...", vectors, vectors)))


#: Matrix (5, 6) from stress components 11, 22, 33, 23, 13, 12 to five numbers, the sum of whose
#: squares is the squared von Mises stress.
VON_MISES_ROOT = np.zeros((5, 6))
VON_MISES_ROOT[0, :3] = np.sqrt(0.75) * np.array([1.0, -1.0, 0.0])
VON_MISES_ROOT[1, :3] = 0.5 * np.array([1.0, 1.0, -2.0])
VON_MISES_ROOT[2:, 3:] = np.sqrt(3.0) * np.eye(3)


class TensileStrength(NamedTuple):
    """Lowest and highest tensile strength [Pa] of a material that cracks."""

    low: float
    high: float


def extreme_principal(components: Array) -> Array:
    """Largest absolute principal value (...,) of components (..., 6)."""
    highest, lowest = principal_ends(components)
    return np.maximum(np.abs(highest), np.abs(lowest))


def largest_tension(components: Array) -> Array:
    """The largest principal value (...,) of components (..., 6), 0 where all are negative."""
    return np.maximum(principal_ends(components)[0], 0.0)


def principal_ends(components: Array) -> tuple[Array, Array]:
    """Highest and lowest principal value (...,) of components (..., 6) (Smith, CACM 4, 168)."""
    normal = components[..., :3]
    s23, s13, s12 = np.moveaxis(components[..., 3:], -1, 0)
    mean = normal.mean(axis=-1)
    d1, d2, d3 = np.moveaxis(normal - mean[..., None], -1, 0)
    size = np.sqrt((d1**2 + d2**2 + d3**2 + 2 * (s23**2 + s13**2 + s12**2)) / 6)
    scale = np.where(size > 0, size, 1.0)
    d1, d2, d3, s23, s13, s12 = (x / scale for x in (d1, d2, d3, s23, s13, s12))
    determinant = d1 * (d2 * d3 - s23**2) - s12 * (s12 * d3 - s23 * s13)
    determinant = determinant + s13 * (s12 * s23 - d2 * s13)
    angle = np.arccos(np.clip(determinant / 2, -1, 1)) / 3
    highest = mean + 2 * size * np.cos(angle)
    lowest = mean + 2 * size * np.cos(angle + 2 * np.pi / 3)

    return highest, lowest


def tensors_of_components(components: Array) -> Array:
    """Tensors (..., 3, 3) of their components 11, 22, 33, 23, 13, 12 (..., 6)."""
    return components[..., TENSOR_PLACES]


_PRESSURE_CHECK = checked_by(positive, "Pa")


@dataclass(frozen=True)
class Strengths(Checked):
    """Strengths of a unidirectional layer in its axes (1 along the fibres), all positive, Pa.

    Parameters
    ----------
    X_t, X_c : float
        Strengths along the fibres in tension and in compression, Pa.
    Y_t, Y_c : float
        Strengths across the fibres in tension and in compression, Pa.
    S : float
        In-plane shear strength, Pa.
    interlaminar : float, optional
        Interlaminar shear strength (ILSS), Pa; delamination is assessed if it is given.
    """

    X_t: float = field(metadata=_PRESSURE_CHECK)
    X_c: float = field(metadata=_PRESSURE_CHECK)
    Y_t: float = field(metadata=_PRESSURE_CHECK)
    Y_c: float = field(metadata=_PRESSURE_CHECK)
    S: float = field(metadata=_PRESSURE_CHECK)
    interlaminar: float | None = field(default=None, metadata=_PRESSURE_CHECK)

    @within_range
    def tsai_hill(self, stress: ArrayLike) -> Array:
        """Exposure (...,), 1 at failure: √index of Tsai and Hill (NASA CR-224, 1965).

        `stress` (..., 3, 3) or (..., 6) in the axes of the layer, Pa; compressive strengths apply
        to negative σ1 and σ2.
        """
        return exposure("tsai_hill", self, components("stress", stress))

    @within_range
    def tsai_wu(self, stress: ArrayLike) -> Array:
        """Exposure (...,) after Tsai and Wu, with F12 = −√(F11 F22)/2.

        1/R, R the positive root of (F11 σ1² + F22 σ2² + F66 τ12² + 2 F12 σ1 σ2) R² + (F1 σ1 +
        F2 σ2) R = 1; F1 = 1/X_t − 1/X_c, F11 = 1/(X_t X_c), F66 = 1/S². S. W. Tsai, E. M. Wu, J.
        Compos. Mater. 5 (1971) 58.
        """
        return exposure("tsai_wu", self, components("stress", stress))

    @within_range
    def delamination(self, stress: ArrayLike) -> Array:
        """Exposure (...,) of the interface: √(τ13² + τ23²) divided by the interlaminar strength.

        Raises
        ------
        InputError
            The interlaminar strength is not given.
        """
        return exposure("delamination", self, components("stress", stress))


def exposure(criterion: str, strengths: Strengths, s: Array) -> Array:
    """Exposure (...,), 1 at failure, to stresses s (..., 6) [Pa] by a method of `Strengths`."""
    sigma1 = s[..., 0]
    sigma2 = s[..., 1]
    shear = s[..., 5]
    if criterion == "delamination":
        if strengths.interlaminar is None:
            raise InputError("delamination needs the interlaminar strength, in Pa.")
        return np.asarray(np.hypot(s[..., 4], s[..., 3]) / strengths.interlaminar)
    if criterion == "tsai_hill":
        X = np.where(sigma1 < 0, strengths.X_c, strengths.X_t)
        Y = np.where(sigma2 < 0, strengths.Y_c, strengths.Y_t)
        index = (sigma1 / X) ** 2 - sigma1 * sigma2 / X**2 + (sigma2 / Y) ** 2
        return np.asarray(np.sqrt(np.maximum(index + (shear / strengths.S) ** 2, 0.0)))

    a = sigma1 / np.sqrt(strengths.X_t * strengths.X_c)
    b = sigma2 / np.sqrt(strengths.Y_t * strengths.Y_c)
    square = a**2 + b**2 - a * b + (shear / strengths.S) ** 2
    linear = sigma1 * (1 / strengths.X_t - 1 / strengths.X_c) + sigma2 * (
        1 / strengths.Y_t - 1 / strengths.Y_c
    )

    return np.asarray(linear / 2 + np.sqrt(linear**2 / 4 + square))
