"""Cross-sections of beams, and layers and sections of shells."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import (
    ROUNDING,
    Checked,
    checked_by,
    floats,
    instance,
    number,
    poisson,
    positive,
    shown,
    within_range,
)
from antiosc.base.errors import InputError
from antiosc.base.stresses import Strengths

#: Points on the outline of a circle; the stress between two of them is up to 0.5 % larger.
CIRCLE_POINTS = 32


def _checked_outline(name: str, value: object) -> tuple[tuple[float, float], ...]:
    """The outline as a tuple of points (y, z); InputError if `value` is not a list of points."""
    if isinstance(value, Sequence) and not len(value):
        return ()
    rows = floats(name, value, (None, 2))
    return tuple((float(y), float(z)) for y, z in rows)


def _circle_outline(d: float) -> list[tuple[float, float]]:
    """Points (y, z) on the outline of a circle of diameter d."""
    angles = 2 * math.pi * np.arange(CIRCLE_POINTS) / CIRCLE_POINTS
    return [(d / 2 * math.cos(a), d / 2 * math.sin(a)) for a in angles]


@dataclass(frozen=True)
class Section(Checked):
    """A cross-section in its principal axes y (the "height") and z, SI units.

    `A` is the area, `I` the second moment of area for bending in the plane of the height
    (sufficient for a plane frame), `I_side` that for bending in the other plane (default: `I`), `J`
    Saint-Venant's torsion constant (default: the polar moment `I + I_side`, correct for circular
    sections only), `shear` Timoshenko's shear coefficient κ along the height and `shear_side` that
    across it (default: `shear`). `outline` has points (y, z) [m] on the edge of the section, y
    along the height and z across it. `peak_field` evaluates the stresses at these points;
    `rectangle`, `circle` and `tube` set them.
    """

    A: float = field(metadata=checked_by(positive, "m²"))
    I: float = field(metadata=checked_by(positive, "m⁴"))  # noqa: E741  (the field's own name for it)
    I_side: float | None = field(default=None, metadata=checked_by(positive, "m⁴"))
    J: float | None = field(default=None, metadata=checked_by(positive, "m⁴"))
    shear: float = field(default=5 / 6, metadata=checked_by(positive))
    shear_side: float | None = field(default=None, kw_only=True, metadata=checked_by(positive))
    outline: Sequence[tuple[float, float]] = field(
        default=(), kw_only=True, repr=False, metadata=checked_by(_checked_outline)
    )

    @property
    def side(self) -> float:
        """Second moment of area for bending across the height, m⁴."""
        if self.I_side is None:
            return self.I
        return self.I_side

    @property
    def planes(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(second moment [m⁴], shear coefficient) of bending along the height, and across it."""
        across = self.shear if self.shear_side is None else self.shear_side
        return (self.I, self.shear), (self.side, across)

    @property
    def torsion(self) -> float:
        """Torsion constant, m⁴."""
        if self.J is None:
            return self.I + self.side
        return self.J

    @property
    def isotropic(self) -> bool:
        """Whether every axis is a principal one, so that no orientation is required."""
        along, across = self.planes
        return all(math.isclose(a, b, rel_tol=1e-9) for a, b in zip(along, across, strict=True))

    @classmethod
    @within_range
    def rectangle(cls, width: float, height: float, shear: float = 5 / 6) -> Section:
        """A solid rectangle with sides in m; κ = 5/6 (Reissner)."""
        width = positive("width", width, "m")
        height = positive("height", height, "m")
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
        """A solid circle of diameter `d` in m (not its radius); κ = 9/10."""
        d = positive("d", d, "m")
        A, I = math.pi * d**2 / 4, math.pi * d**4 / 64  # noqa: E741
        return cls(A=A, I=I, shear=shear, outline=_circle_outline(d))

    @classmethod
    def tube(cls, d: float, t: float, shear: float = 0.5) -> Section:
        """A round tube of outer diameter `d` and wall `t` in m; κ = 1/2 (thin wall)."""
        d = positive("d", d, "m")
        t = positive("t", t, "m")
        if t >= d / 2:
            raise InputError(f"the wall t must be thinner than d/2 = {d / 2:g} m; got {t:g}.")

        inner = d - 2 * t
        A, I = math.pi * (d**2 - inner**2) / 4, math.pi * (d**4 - inner**4) / 64  # noqa: E741

        return cls(A=A, I=I, shear=shear, outline=_circle_outline(d))


def _rectangle_torsion(width: float, height: float) -> float:
    """Torsion constant of a rectangle [m⁴] (Timoshenko & Goodier, *Elasticity*, §109)."""
    a = max(width, height)
    b = min(width, height)
    n = np.arange(1, 40, 2)
    series = np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5)
    return float(a * b**3 / 3 * (1 - 192 / np.pi**5 * b / a * series))


_MODULUS_CHECK = checked_by(positive, "Pa")


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

    E1: float = field(metadata=_MODULUS_CHECK)
    E2: float = field(metadata=_MODULUS_CHECK)
    nu12: float = field(metadata=checked_by(number))
    G12: float = field(metadata=_MODULUS_CHECK)
    G13: float = field(metadata=_MODULUS_CHECK)
    G23: float = field(metadata=_MODULUS_CHECK)
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
        """Q̄ (3, 3) [Pa] in the laminate's axes: (σ1, σ2, τ12) = Q̄ (ε1, ε2, γ12)."""
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
        """Matrix (1, 3): strain ε3 across the layer from (ε1, ε2, γ12), in plane stress. The axes
        1, 2 are the laminate's. The layer is assumed isotropic across its fibres: ν13 = nu12, and
        ν23 = E2/(2 G23) − 1, at most 0.5."""
        nu23 = min(self.E2 / (2 * self.G23) - 1, 0.5)
        s3 = np.array([-self.nu12 / self.E1, -nu23 / self.E2])
        c, s = _cosine_sine(self.angle)
        # normal stresses in the axes of the fibres, of those in the laminate's
        T = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s]])
        return np.asarray((s3 @ T @ self.plane_stress())[None])

    def transverse_shear(self) -> Array:
        """Shear stiffness G (2, 2) [Pa] in the laminate's axes: (τ13, τ23) = G (γ13, γ23)."""
        c, s = _cosine_sine(self.angle)
        R = np.array([[c, s], [-s, c]])
        return np.asarray(R.T @ np.diag([self.G13, self.G23]) @ R)


def _cosine_sine(degrees: float) -> tuple[float, float]:
    """Cosine and sine, exact up to a common sign at multiples of 90°: cross-plies do not couple."""
    if degrees % 90 == 0:
        if degrees % 180 == 0:
            return (1.0, 0.0)
        return (0.0, 1.0)
    return float(np.cos(np.deg2rad(degrees))), float(np.sin(np.deg2rad(degrees)))


@dataclass(frozen=True, eq=False)
class PlateSection:
    """Stiffness and mass of a shell, per area of its reference surface z = 0 (that of the mesh)."""

    #: of the sheet, m
    thickness: float
    #: in the axes 1, 2 of the sheet: in-plane (3, 3), N/m; coupling (3, 3), N; bending (3, 3), N m
    A: Array
    B: Array
    D: Array
    #: transverse shear (2, 2) of (γ13, γ23), N/m
    S: Array
    #: ∫ G12 dz [N/m]: penalty that ties the rotation about the normal to the in-plane rotation
    drilling: float
    #: ∫ ρ (1, z, z²) dz: kg/m², kg/m, kg
    I0: float
    I1: float
    I2: float
    #: z of the middle of the section, m; z points to the top
    middle: float = 0.0

    @property
    def bending(self) -> Array:
        """D − B A⁻¹ B (3, 3), the bending stiffness without in-plane forces, N m."""
        return np.asarray(self.D - self.B @ np.linalg.solve(self.A, self.B))

    @property
    def t2_of_shear(self) -> float:
        """t² (m²) of an isotropic plate with the same ratio of bending to shear stiffness."""
        return 20 * _mean_shear_stiffness(self.bending) / float(np.trace(self.S))

    @property
    def t2_of_stretch(self) -> float:
        """t² (m²) of an isotropic plate with the same ratio of bending to membrane stiffness."""
        return 12 * _mean_shear_stiffness(self.bending) / _mean_shear_stiffness(self.A)

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
        """Rotary inertia ∫ ρ (z − z_m)² dz per area, kg, about the centre of mass z_m."""
        return self.I2 - self.I1**2 / self.I0

    @property
    def has_sides(self) -> bool:
        """Whether turning the section over changes its constants: then the normal's sign counts."""
        changed = [  # by a flip their signs change
            *((M[:2, 2], np.abs(M).max()) for M in (self.A, self.D)),
            (self.S[0, 1], np.abs(self.S).max()),
            (self.B[:2, :2], np.abs(self.A).max() * self.thickness),
            (self.B[2, 2], np.abs(self.A).max() * self.thickness),
        ]
        return self.I1 != 0 or any(np.abs(M).max() > 1e-9 * size for M, size in changed)


def _mean_shear_stiffness(stiffness: Array) -> float:
    """Shear entry of a plane stiffness (3, 3), averaged over all rotations about the normal."""
    m = stiffness
    return float(m[0, 0] + m[1, 1] - 2 * m[0, 1] + 4 * m[2, 2]) / 8


@within_range
def section_of_layers(layers: Sequence[Layer]) -> PlateSection:
    """The section of layers from the bottom to the top; z = 0 is in the middle. InputError unless
    `layers` is a sequence of one `Layer` or more."""
    is_list = isinstance(layers, Sequence) and len(layers) > 0
    if not is_list or not all(isinstance(ply, Layer) for ply in layers):
        raise InputError(f"layers lists one Layer or more, bottom first; got {shown(layers)}.")

    z, powers, Q = _layer_integrals(layers)
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
    """Transverse shear stiffness S (2, 2) [N/m], by the energy of equilibrium shear stresses. `z`,
    `Q`: heights and Q̄ as from `_layer_integrals`; `A`, `B`, `D`: as of a `PlateSection`."""
    shear_at = _equilibrium(z, Q, A, B, D)

    # f is quadratic in z within a layer, its energy of degree four: three Gauss points
    points, weights = np.polynomial.legendre.leggauss(3)

    compliance = np.zeros((2, 2))
    for k, (layer, low, high) in enumerate(zip(layers, z[:-1], z[1:], strict=True)):
        for x, w in zip(points, weights, strict=True):
            f = shear_at(k, (low + high) / 2 + x * (high - low) / 2)
            energy = f.T @ np.linalg.solve(layer.transverse_shear(), f)
            compliance += w * (high - low) / 2 * energy

    return np.asarray(np.linalg.inv((compliance + compliance.T) / 2))


def shear_stresses(layers: Sequence[Layer], which: int, z: float) -> Array:
    """Matrix f (2, 2) [1/m] with (τ13, τ23) = f (Q1, Q2) at height z [m] in layer `which`."""
    levels, powers, Q = _layer_integrals(layers)
    A, B, D = np.einsum("pl,lij->pij", powers, Q)
    return _equilibrium(levels, Q, A, B, D)(which, z)


def _layer_integrals(layers: Sequence[Layer]) -> tuple[Array, Array, Array]:
    """(z of the interfaces (L + 1,), ∫ (1, z, z²) dz (3, L), Q̄ (L, 3, 3)) of L layers."""
    z = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
    z -= z[-1] / 2
    powers = np.array([np.diff(z), np.diff(z**2) / 2, np.diff(z**3) / 3])
    return z, powers, np.array([layer.plane_stress() for layer in layers])


def _equilibrium(z: Array, Q: Array, A: Array, B: Array, D: Array) -> Callable[[int, float], Array]:
    """Function (layer, height [m]) -> f (2, 2) [1/m]: (τ13, τ23) = f (Q1, Q2), by equilibrium. `z`,
    `Q`: heights and Q̄ as from `_layer_integrals`; `A`, `B`, `D`: as of a `PlateSection`."""
    coupling = -np.linalg.solve(A, B)
    d = np.linalg.inv(D + B @ coupling)
    b = coupling @ d
    sums = [np.zeros((3, 3))]  # −∫ Q̄ (b + z d) dz up to the layer
    for q, low, high in zip(Q, z[:-1], z[1:], strict=True):
        sums.append(sums[-1] - q @ (b * (high - low) + d * (high**2 - low**2) / 2))

    def at(k: int, height: float) -> Array:
        F = sums[k] - Q[k] @ (b * (height - z[k]) + d * (height**2 - z[k] ** 2) / 2)
        # slopes M1,1 = Q1 and M2,2 = Q2 alone
        return np.array([[F[0, 0], F[2, 1]], [F[2, 0], F[1, 1]]])

    return at
