"""Element families; here the cross-sections of beams, and the sections of shells."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import (
    ROUNDING,
    Checked,
    array,
    checked_by,
    instance,
    number,
    poisson,
    positive,
    shown,
    within_range,
)
from antiosc.base.errors import InputError
from antiosc.base.stresses import Strengths

#: Points of the outline of a circle: the largest stress between two of them is 0.5 % larger.
ON_CIRCLE = 32


def _points(name: str, value: object) -> tuple[tuple[float, float], ...]:
    """Points (y, z), or InputError."""
    if isinstance(value, Sequence) and not len(value):
        return ()
    rows = array(name, value, (None, 2))
    return tuple((float(y), float(z)) for y, z in rows)


def _circle(d: float) -> list[tuple[float, float]]:
    """Points of the outline of a circle of diameter d."""
    angles = 2 * math.pi * np.arange(ON_CIRCLE) / ON_CIRCLE
    return [(d / 2 * math.cos(a), d / 2 * math.sin(a)) for a in angles]


@dataclass(frozen=True)
class Section(Checked):
    """A cross-section in its principal axes y (the "height") and z, SI units.

    `I` is the second moment of area for bending in the plane of the height (sufficient for a plane
    frame), `I_side` for bending in the other plane (default: `I`), `J` Saint-Venant's torsion
    constant (default: the polar moment `I + I_side`, correct for circular sections only), `shear`
    Timoshenko's shear coefficient κ. `outline` has points (y, z) on the edge of the section, m,
    along the height and across it, at which `peak_field` takes stresses; the shapes below know it.
    """

    A: float = field(metadata=checked_by(positive, "m²"))
    I: float = field(metadata=checked_by(positive, "m⁴"))  # noqa: E741  (the field's own name for it)
    I_side: float | None = field(default=None, metadata=checked_by(positive, "m⁴"))
    J: float | None = field(default=None, metadata=checked_by(positive, "m⁴"))
    shear: float = field(default=5 / 6, metadata=checked_by(positive))
    outline: Sequence[tuple[float, float]] = field(
        default=(), kw_only=True, repr=False, metadata=checked_by(_points)
    )

    @property
    def side(self) -> float:
        """Second moment of area for bending across the height, m⁴."""
        return self.I if self.I_side is None else self.I_side

    @property
    def torsion(self) -> float:
        """Torsion constant, m⁴."""
        return self.I + self.side if self.J is None else self.J

    @property
    def isotropic(self) -> bool:
        """Whether every axis is a principal one, so that no orientation is needed."""
        return math.isclose(self.I, self.side, rel_tol=1e-9)

    @classmethod
    @within_range
    def rectangle(cls, width: float, height: float, shear: float = 5 / 6) -> Section:
        """A full rectangle, sides in m; κ = 5/6 (Reissner)."""
        width, height = positive("width", width, "m"), positive("height", height, "m")
        return cls(
            A=width * height,
            I=width * height**3 / 12,
            I_side=height * width**3 / 12,
            J=_rectangle_torsion(width, height),
            shear=shear,
            outline=[(a * height / 2, b * width / 2) for a in (1, -1) for b in (1, -1)],
        )

    @classmethod
    def circle(cls, d: float, shear: float = 0.9) -> Section:
        """A full circle of diameter `d` in m (not its radius); κ = 9/10."""
        d = positive("d", d, "m")
        A, I = math.pi * d**2 / 4, math.pi * d**4 / 64  # noqa: E741
        return cls(A=A, I=I, shear=shear, outline=_circle(d))

    @classmethod
    def tube(cls, d: float, t: float, shear: float = 0.5) -> Section:
        """A round tube of outer diameter `d` and wall `t` in m; κ = 1/2 (thin wall)."""
        d, t = positive("d", d, "m"), positive("t", t, "m")
        if t >= d / 2:
            raise InputError(f"the wall t must be thinner than d/2 = {d / 2:g} m; got {t:g}.")
        inner = d - 2 * t
        A, I = math.pi * (d**2 - inner**2) / 4, math.pi * (d**4 - inner**4) / 64  # noqa: E741
        return cls(A=A, I=I, shear=shear, outline=_circle(d))


def _rectangle_torsion(width: float, height: float) -> float:
    """Saint-Venant's series (Timoshenko & Goodier, *Theory of Elasticity*, §109)."""
    a, b = max(width, height), min(width, height)
    n = np.arange(1, 40, 2)
    series = np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5)
    return float(a * b**3 / 3 * (1 - 192 / np.pi**5 * b / a * series))


_MODULUS = checked_by(positive, "Pa")


@dataclass(frozen=True)
class Layer(Checked):
    """A layer of an orthotropic material: a ply, or a core.

    Parameters
    ----------
    E1, E2 : float
        Young's moduli along and across the fibres, Pa.
    nu12 : float
        Poisson's ratio: contraction along 2 under stress along 1.
    G12, G13, G23 : float
        Shear moduli, Pa; 3 is the normal of the sheet.
    rho : float
        Density, kg/m³.
    thickness : float
        m.
    angle : float
        From the laminate's axis to direction 1 in degrees, counted about the normal.
    strength : Strengths, optional
        For the failure criteria of `peak_field`.

    Raises
    ------
    InputError
        Constants that are not positive, or nu12 for which the energy is not positive: nu12² ≥
        E1/E2.
    """

    E1: float = field(metadata=_MODULUS)
    E2: float = field(metadata=_MODULUS)
    nu12: float = field(metadata=checked_by(number))
    G12: float = field(metadata=_MODULUS)
    G13: float = field(metadata=_MODULUS)
    G23: float = field(metadata=_MODULUS)
    rho: float = field(metadata=checked_by(positive, "kg/m³"))
    thickness: float = field(metadata=checked_by(positive, "m"))
    angle: float = field(default=0.0, metadata=checked_by(number, "degrees"))
    strength: Strengths | None = field(
        default=None, metadata=checked_by(instance, Strengths, "a Strengths")
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.nu12**2 * self.E2 >= self.E1:
            raise InputError(
                f"nu12² must be < E1/E2 = {self.E1 / self.E2:g}, else the strain energy is not "
                f"positive; got nu12 = {self.nu12:g} (is it nu21?)."
            )

    @classmethod
    def isotropic(cls, E: float, nu: float, rho: float, thickness: float) -> Layer:
        """An isotropic layer: Young's modulus (Pa), Poisson's ratio, kg/m³, thickness (m)."""
        E = positive("E", E, "Pa")
        G = E / (2 * (1 + poisson(nu)))
        return cls(E, E, nu, G, G, G, rho, thickness)

    def rotated(self, angle: float) -> Layer:
        """The same layer at another angle (degrees)."""
        return replace(self, angle=angle)

    def plane_stress(self) -> Array:
        """Q̄ (3, 3) in the laminate's axes: stresses (σ1, σ2, τ12) of strains (ε1, ε2, γ12), Pa."""
        nu21 = self.nu12 * self.E2 / self.E1
        Q = np.array([[self.E1, nu21 * self.E1, 0], [nu21 * self.E1, self.E2, 0], [0, 0, 0]])
        Q /= 1 - self.nu12 * nu21
        Q[2, 2] = self.G12
        c, s = _cosine_sine(self.angle)
        # strains in the axes of the fibres, of strains in the laminate's
        shear = [-2 * c * s, 2 * c * s, c * c - s * s]
        T = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], shear])
        return np.asarray(T.T @ Q @ T)

    def contraction(self) -> Array:
        """Strain ε3 (1, 3) across the layer of unit strains (ε1, ε2, γ12) in plane stress.

        Across the fibres the layer is taken as isotropic, of Poisson's ratio nu12 along them and
        ν23 = E2/(2 G23) − 1, at most 0.5.
        """
        nu23 = min(self.E2 / (2 * self.G23) - 1, 0.5)
        s3 = np.array([-self.nu12 / self.E1, -nu23 / self.E2])
        c, s = _cosine_sine(self.angle)
        # normal stresses in the axes of the fibres, of those in the laminate's
        T = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s]])
        return np.asarray((s3 @ T @ self.plane_stress())[None])

    def transverse_shear(self) -> Array:
        """G (2, 2) in the laminate's axes: stresses (τ13, τ23) of strains (γ13, γ23), Pa."""
        c, s = _cosine_sine(self.angle)
        R = np.array([[c, s], [-s, c]])
        return np.asarray(R.T @ np.diag([self.G13, self.G23]) @ R)


def _cosine_sine(degrees: float) -> tuple[float, float]:
    """Cosine and sine of an angle; exact at right angles, so that a cross-ply has no coupling."""
    if degrees % 90 == 0:
        return (1.0, 0.0) if degrees % 180 == 0 else (0.0, 1.0)
    return float(np.cos(np.deg2rad(degrees))), float(np.sin(np.deg2rad(degrees)))


@dataclass(frozen=True, eq=False)
class PlateSection:
    """Stiffness and mass of a shell per area of its middle surface."""

    #: m
    thickness: float
    #: in-plane (3, 3), N/m; coupling (3, 3), N; bending (3, 3), N m
    A: Array
    B: Array
    D: Array
    #: transverse shear (2, 2) of (γ13, γ23), N/m
    S: Array
    #: ∫ G12 dz, what holds the rotation about the normal to the sheet's own, N/m
    drilling: float
    #: ∫ ρ (1, z, z²) dz: kg/m², kg/m, kg
    I0: float
    I1: float
    I2: float
    #: z of the middle of the section, m
    middle: float = 0.0

    @property
    def bending(self) -> Array:
        """D − B A⁻¹ B (3, 3), the bending stiffness without in-plane forces, N m."""
        return np.asarray(self.D - self.B @ np.linalg.solve(self.A, self.B))

    @property
    def t2_of_shear(self) -> float:
        """t² of the isotropic plate with the same ratio of bending to shear stiffness, m²."""
        return 20 * _over_angles(self.bending) / float(np.trace(self.S))

    @property
    def t2_of_stretch(self) -> float:
        """t² of the isotropic plate with the same ratio of bending to membrane stiffness, m²."""
        return 12 * _over_angles(self.bending) / _over_angles(self.A)

    @property
    def flipped(self) -> PlateSection:
        """The section with its normal reversed and the same 0° direction."""
        flip = np.diag([1.0, 1.0, -1.0])
        S = self.S * np.array([[1, -1], [-1, 1]])
        return replace(
            self,
            A=flip @ self.A @ flip,
            B=-flip @ self.B @ flip,
            D=flip @ self.D @ flip,
            S=S,
            I1=-self.I1,
            middle=-self.middle,
        )

    def shifted(self, offset: float) -> PlateSection:
        """The section with its middle at z = `offset` (m) instead of 0."""
        if not offset:
            return self
        return replace(
            self,
            B=self.B + offset * self.A,
            D=self.D + 2 * offset * self.B + offset**2 * self.A,
            I1=self.I1 + offset * self.I0,
            I2=self.I2 + 2 * offset * self.I1 + offset**2 * self.I0,
            middle=self.middle + offset,
        )

    @property
    def spin(self) -> float:
        """∫ ρ (z − z_m)² dz about the middle z_m of the mass, kg."""
        return self.I2 - self.I1**2 / self.I0

    @property
    def has_sides(self) -> bool:
        """Whether top and bottom differ, so that the sign of the normal matters."""
        over = self.flipped
        scale = {"A": self.A, "B": self.A * self.thickness, "D": self.D, "S": self.S}
        differ = [
            np.abs(getattr(self, name) - getattr(over, name)).max() > 1e-9 * np.abs(size).max()
            for name, size in scale.items()
        ]
        return any(differ) or self.I1 != 0


def _over_angles(stiffness: Array) -> float:
    """Mean of entry 66 over all angles: G if Q is isotropic."""
    m = stiffness
    return float(m[0, 0] + m[1, 1] - 2 * m[0, 1] + 4 * m[2, 2]) / 8


@within_range
def stacked(layers: Sequence[Layer]) -> PlateSection:
    """The section of layers from the bottom to the top, the reference in the middle."""
    listed = isinstance(layers, Sequence) and len(layers) > 0
    if not listed or not all(isinstance(one, Layer) for one in layers):
        raise InputError(
            "layers lists the Layer objects of the stack, at least one, from the bottom to the "
            f"top; got {shown(layers)}."
        )
    z, powers, Q = _levels(layers)
    h = float(sum(layer.thickness for layer in layers))
    A, B, D = np.einsum("pl,lij->pij", powers, Q)
    rho = np.array([layer.rho for layer in layers])
    I0, I1, I2 = (float(value) for value in powers @ rho)
    B = np.where(np.abs(B) > ROUNDING * h * np.abs(A).max(), B, 0.0)
    return PlateSection(
        thickness=h,
        A=A,
        B=B,
        D=D,
        S=_transverse_shear(layers, z, Q, A, B, D),
        drilling=float(sum(layer.G12 * layer.thickness for layer in layers)),
        I0=I0,
        I1=I1 if abs(I1) > ROUNDING * h * I0 else 0.0,
        I2=I2,
    )


def _transverse_shear(
    layers: Sequence[Layer], z: Array, Q: Array, A: Array, B: Array, D: Array
) -> Array:
    """S (2, 2) by the energy of the shear stresses in equilibrium, N/m."""
    at = _equilibrium(z, Q, A, B, D)
    # f is quadratic in z within a layer, its energy of degree four: three Gauss points
    points, weights = np.polynomial.legendre.leggauss(3)
    compliance = np.zeros((2, 2))
    for k, (layer, low, high) in enumerate(zip(layers, z[:-1], z[1:], strict=True)):
        for x, w in zip(points, weights, strict=True):
            f = at(k, (low + high) / 2 + x * (high - low) / 2)
            energy = f.T @ np.linalg.solve(layer.transverse_shear(), f)
            compliance += w * (high - low) / 2 * energy
    return np.asarray(np.linalg.inv((compliance + compliance.T) / 2))


def shear_stresses(layers: Sequence[Layer], which: int, z: float) -> Array:
    """f (2, 2): stresses (τ13, τ23) at z in the layer `which` of unit forces (Q1, Q2), 1/m."""
    levels, powers, Q = _levels(layers)
    A, B, D = np.einsum("pl,lij->pij", powers, Q)
    return _equilibrium(levels, Q, A, B, D)(which, z)


def _levels(layers: Sequence[Layer]) -> tuple[Array, Array, Array]:
    """Bounds of the layers (L + 1,), ∫ (1, z, z²) dz (3, L) and Q̄ (L, 3, 3) of each."""
    z = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
    z -= z[-1] / 2
    powers = np.array([np.diff(z), np.diff(z**2) / 2, np.diff(z**3) / 3])
    return z, powers, np.array([layer.plane_stress() for layer in layers])


def _equilibrium(z: Array, Q: Array, A: Array, B: Array, D: Array) -> Callable[[int, float], Array]:
    """f (2, 2) of a layer and a height: stresses in equilibrium with unit shear forces."""
    coupling = -np.linalg.solve(A, B)
    d = np.linalg.inv(D + B @ coupling)
    b = coupling @ d
    below = [np.zeros((3, 3))]  # −∫ Q̄ (b + z d) dz up to the layer
    for q, low, high in zip(Q, z[:-1], z[1:], strict=True):
        below.append(below[-1] - q @ (b * (high - low) + d * (high**2 - low**2) / 2))

    def at(k: int, height: float) -> Array:
        F = below[k] - Q[k] @ (b * (height - z[k]) + d * (height**2 - z[k] ** 2) / 2)
        # slopes M1,1 = Q1 and M2,2 = Q2 alone
        return np.array([[F[0, 0], F[2, 1]], [F[2, 0], F[1, 1]]])

    return at
