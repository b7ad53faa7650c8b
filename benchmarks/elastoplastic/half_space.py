"""Small-strain elastoplastic finite elements: a sphere on a half-space, axisymmetric, no friction.

Bilinear quadrilaterals on a graded grid of rectangles with the mean dilatation of each element
(T. J. R. Hughes, Int. J. Num. Meth. Eng. 15 (1980) 1413-1418), von Mises' plasticity with isotropic
linear hardening by radial return (J. C. Simo, T. J. R. Hughes, Computational Inelasticity, 1998,
ch. 3). The sphere is the paraboloid r^2/(2 R); it is rigid, or a half-space of its own that stays
elastic and whose surface compliance is condensed from the same grid.

Lengths are over the sphere's radius, stresses over Young's modulus of what yields.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solveh_banded
from scipy.optimize import minimize_scalar

GAUSS = np.array([-1.0, 1.0]) / np.sqrt(3.0)
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def yield_factor(nu: float) -> float:
    """Largest pressure of Hertz's at first yield, over the yield strength: Mises on the axis."""

    def unequal(s: float) -> float:
        along = 1 / (1 + s * s)
        across = (1 + nu) * (1 - s * np.arctan(1 / s)) - 0.5 * along
        return -abs(along - across)

    return 1 / -minimize_scalar(unequal, bounds=(0.05, 1.5), method="bounded").fun


@dataclass
class Case:
    """What is pressed: `sphere` is E of an elastic sphere over that of the half-space, 0 rigid."""

    nu: float = 0.3
    hardening: float = 0.0  # slope of the stress-strain curve beyond yield, over E
    sphere: float = 0.0
    sphere_nu: float = 0.3

    @property
    def modulus(self) -> float:
        other = (1 - self.sphere_nu**2) / self.sphere if self.sphere else 0.0
        return 1 / (1 - self.nu**2 + other)

    def yield_strength(self, depth: float) -> float:
        """Of a half-space that yields at this indentation."""
        return np.sqrt(depth) * 2 * self.modulus / (np.pi * yield_factor(self.nu))


def graded(width: float, cells: int, growth: float, reach: float) -> np.ndarray:
    """Equal cells up to `width`, growing ones beyond."""
    x, step = list(np.linspace(0, width, cells + 1)), width / cells
    while x[-1] < reach:
        step *= growth
        x.append(x[-1] + step)
    return np.array(x)


class Strains:
    """Strains of three normal and some shear components, the latter as angles."""

    def __init__(self, shears: int) -> None:
        normal, shear = np.ones(3), np.ones(shears)
        self.ones = np.append(normal, 0 * shear)
        self.weights = np.append(normal, 2 * shear)  # of stresses in their norm
        self.deviator = np.diag(np.append(normal, 0.5 * shear))
        self.deviator[:3, :3] -= 1 / 3  # the mean of the normal ones taken from each

    def elastic(self, K: float, G: float) -> np.ndarray:
        """Stresses by strains, of bulk and shear modulus."""
        return K * np.outer(self.ones, self.ones) + 2 * G * self.deviator


@dataclass
class Grid:
    """Elements up to `reach` radii of the contact; `cells` of them under its radius."""

    radius: float
    cells: int = 30
    growth: float = 1.5
    reach: float = 2000.0
    points: np.ndarray = field(init=False)
    strains: Strains = field(init=False, default_factory=lambda: Strains(1))

    def __post_init__(self) -> None:
        wide = 1.25 * self.radius
        many = round(1.25 * self.cells)
        self.r = graded(wide, many, self.growth, self.reach * self.radius)
        self.z = graded(wide, many, self.growth, self.reach * self.radius)
        nr, nz = len(self.r), len(self.z)
        index = np.arange(nr * nz).reshape(nr, nz).T
        self.surface = index[0, : many + 1]
        self.fixed = np.concatenate([2 * index[:, 0], 2 * index[-1], 2 * index[-1] + 1])
        self.fixed = np.concatenate([self.fixed, 2 * index[:, -1], 2 * index[:, -1] + 1])
        # corners against the clock, z downwards
        nodes = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1)
        self.nodes = nodes.reshape(-1, 4)
        self.dofs = np.stack([2 * self.nodes, 2 * self.nodes + 1], -1).reshape(-1, 8)
        self.size = 2 * nr * nz
        self._strains()

    def _strains(self) -> None:
        dr, dz = np.diff(self.r), np.diff(self.z)
        h = np.stack(np.broadcast_arrays(dr[None, :], dz[:, None]), -1).reshape(-1, 2)
        start = np.broadcast_to(self.r[None, :-1], (len(dz), len(dr))).reshape(-1)
        B = np.zeros((len(h), 4, 4, 8))
        volume = np.zeros((len(h), 4))
        for g, (s, t) in enumerate((s, t) for t in GAUSS for s in GAUSS):
            shape = 0.25 * (1 + CORNERS[:, 0] * s) * (1 + CORNERS[:, 1] * t)
            by_s = 0.25 * CORNERS[:, 0] * (1 + CORNERS[:, 1] * t)
            by_t = 0.25 * CORNERS[:, 1] * (1 + CORNERS[:, 0] * s)
            r = start + 0.5 * (1 + s) * h[:, 0]
            by_r, by_z = 2 * by_s / h[:, :1], 2 * by_t / h[:, 1:]
            B[:, g, 0, 0::2] = by_r
            B[:, g, 1, 1::2] = by_z
            B[:, g, 2, 0::2] = shape / r[:, None]
            B[:, g, 3, 0::2] = by_z
            B[:, g, 3, 1::2] = by_r
            volume[:, g] = 2 * np.pi * r * 0.25 * h[:, 0] * h[:, 1]
        dilatation = B[:, :, :3].sum(axis=2)
        mean = (dilatation * volume[..., None]).sum(axis=1) / volume.sum(axis=1)[:, None]
        B[:, :, :3] += (mean[:, None] - dilatation)[:, :, None] / 3
        self.B, self.volume = B, volume
        rows = np.repeat(self.dofs, 8, axis=1).ravel()
        columns = np.tile(self.dofs, (1, 8)).ravel()
        free = np.ones(self.size, dtype=bool)
        free[self.fixed] = False
        self.free = np.flatnonzero(free)
        place = np.cumsum(free) - 1
        self.keep = free[rows] & free[columns] & (rows >= columns)
        rows, columns = place[rows[self.keep]], place[columns[self.keep]]
        self.band = int((rows - columns).max()) + 1
        self.place = (rows - columns) * len(self.free) + columns
        self.down = place[2 * self.surface + 1]  # degrees of freedom of the surface
        self.gap = 0.5 * self.r[: len(self.down)] ** 2  # to a sphere

    def matrix(self, tangents: np.ndarray) -> np.ndarray:
        """Lower band of the stiffness of tangents (elements, 4, 4, 4)."""
        weighed = np.matmul(tangents * self.volume[:, :, None, None], self.B)
        count = len(self.B)
        left = self.B.reshape(count, 16, 8).transpose(0, 2, 1)
        K = np.matmul(left, weighed.reshape(count, 16, 8))
        size = self.band * len(self.free)
        return np.bincount(self.place, K.ravel()[self.keep], size).reshape(self.band, -1)

    def solve(
        self, tangents: np.ndarray, nodes: np.ndarray, springs: np.ndarray, loads: np.ndarray
    ) -> np.ndarray:
        """Displacements by loads (n, k); springs at some nodes of the surface."""
        band = self.matrix(tangents)
        band[0, nodes] += springs
        try:
            return solveh_banded(band, loads, lower=True, overwrite_ab=True, check_finite=False)
        except np.linalg.LinAlgError as error:
            raise ArithmeticError("the tangent is not definite") from error

    def forces(self, stress: np.ndarray) -> np.ndarray:
        each = np.einsum("egij,egi,eg->ej", self.B, stress, self.volume, optimize=True)
        return np.bincount(self.dofs.ravel(), each.ravel(), self.size)[self.free]

    def strain(self, u: np.ndarray) -> np.ndarray:
        whole = np.zeros(self.size)
        whole[self.free] = u
        return np.einsum("egij,ej->egi", self.B, whole[self.dofs], optimize=True)


def elastic(E: float, nu: float) -> tuple[float, float]:
    """Bulk and shear modulus."""
    return E / (3 * (1 - 2 * nu)), E / (2 * (1 + nu))


@dataclass
class State:
    u: np.ndarray
    plastic: np.ndarray  # strains (elements, 4, 4)
    hardened: np.ndarray  # equivalent plastic strains
    pressing: np.ndarray  # nodes of the surface in contact


class Pressed:
    """A case on a grid, pressed to given depths."""

    def __init__(self, case: Case, grid: Grid, strength: float) -> None:
        self.grid, self.strength = grid, strength
        self.depth = self.force = 0.0
        self.K, self.G = elastic(1.0, case.nu)
        self.H = case.hardening / (1 - case.hardening)
        # the surface of a half-space has no other compliance than that by its own modulus
        self.D = grid.strains.elastic(self.K, self.G)
        self.stiff = 1e4
        self.other = None
        n = grid.B.shape[:2]
        if case.sphere:
            D = grid.strains.elastic(*elastic(case.sphere, case.sphere_nu))
            band = grid.matrix(np.broadcast_to(D, (*n, 4, 4)))
            self.other = solveh_banded(band, self._loads(grid.down), lower=True)[grid.down]
        self.state = State(
            np.zeros(len(grid.free)),
            np.zeros((*n, len(self.D))),
            np.zeros(n),
            np.zeros(len(grid.down), dtype=bool),
        )
        self.state.pressing[0] = True

    def material(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Stresses, tangents, plastic strains and hardening by radial return."""
        old, G, K, kind = self.state, self.G, self.K, self.grid.strains
        strain = self.grid.strain(u) - old.plastic
        pressure = K * strain[..., :3].sum(axis=-1)
        trial = 2 * G * (strain @ kind.deviator)
        size = np.sqrt((trial**2 * kind.weights).sum(axis=-1))
        limit = np.sqrt(2 / 3) * (self.strength + self.H * old.hardened)
        excess = np.maximum(size - limit, 0.0)
        more = excess / (2 * G + 2 / 3 * self.H)
        size = np.maximum(size, 1e-300)
        way = trial / size[..., None]
        stress = trial - (2 * G * more)[..., None] * way + pressure[..., None] * kind.ones
        plastic = old.plastic + more[..., None] * way * kind.weights
        tangent = np.broadcast_to(self.D, (*size.shape, *self.D.shape)).copy()
        at = excess > 0
        kept = 1 - 2 * G * more[at] / size[at]
        turn = 1 / (1 + self.H / (3 * G)) - (1 - kept)
        tangent[at] = (
            kind.elastic(K, 0.0)
            + 2 * G * kept[:, None, None] * kind.deviator
            - 2 * G * turn[:, None, None] * way[at][:, :, None] * way[at][:, None, :]
        )
        return stress, tangent, plastic, old.hardened + np.sqrt(2 / 3) * more

    def _contact(self, pressing: np.ndarray) -> np.ndarray:
        """Stiffness of the nodes in contact against the sphere."""
        if self.other is None:
            return self.stiff * self.grid.radius * np.eye(int(pressing.sum()))
        return np.linalg.inv(self.other[np.ix_(pressing, pressing)])

    def press(self, depth: float, halvings: int = 5) -> float:
        """The force at an indentation, reached from the last one; in smaller steps if needed."""
        try:
            force = self._press(depth)
        except ArithmeticError:
            if halvings == 0:
                raise
            self.press(0.5 * (self.depth + depth), halvings - 1)
            return self.press(depth, halvings - 1)
        self.depth = depth
        return force

    def _press(self, depth: float) -> float:
        """Newton's method; the nodes in contact are found along with it."""
        grid = self.grid
        wanted = depth - grid.gap
        u, pressing = self.state.u, self.state.pressing
        step, last, share = np.zeros_like(u), np.inf, 1.0
        for tries in range(60):
            trial = u + share * step
            stress, tangent, *changed = self.material(trial)
            stiff = self._contact(pressing)
            force = stiff @ (wanted - trial[grid.down])[pressing]
            rest = grid.forces(stress)
            rest[grid.down[pressing]] -= force
            size = np.abs(rest).sum()
            scale = max(np.abs(force).sum(), 1e-3 * self.force, 1e-30)
            if not size <= 3 * last and share > 0.1:
                share *= 0.5
                continue
            u, last, share = trial, size, 1.0
            close = size <= 1e-6 * scale or (tries > 20 and size <= 1e-5 * scale)
            if tries and (close or tries % 3 == 2):
                found = self._touching(u, pressing, wanted, force)
                if (found != pressing).any():
                    pressing, last = found, np.inf
                    force = self._contact(pressing) @ (wanted - u[grid.down])[pressing]
                    rest = grid.forces(stress)
                    rest[grid.down[pressing]] -= force
                elif close:
                    self.state = State(u, *changed, pressing)
                    self.force = float(force.sum())
                    return self.force
            step = self._step(tangent, pressing, rest)
        raise ArithmeticError("no equilibrium")

    def _touching(
        self, u: np.ndarray, pressing: np.ndarray, wanted: np.ndarray, force: np.ndarray
    ) -> np.ndarray:
        gap = wanted - u[self.grid.down]
        if self.other is not None:
            gap = gap - self.other[:, pressing] @ force
        found = ~pressing & (gap > 1e-9 * abs(self.depth))
        found[pressing] = force >= 0
        return found

    def _loads(self, nodes: np.ndarray) -> np.ndarray:
        loads = np.zeros((len(self.grid.free), len(nodes)))
        loads[nodes, np.arange(len(nodes))] = 1.0
        return loads

    def _step(self, tangent: np.ndarray, pressing: np.ndarray, rest: np.ndarray) -> np.ndarray:
        nodes, stiff = self.grid.down[pressing], self._contact(pressing)
        springs, loads = stiff.diagonal(), rest[:, None]
        if self.other is not None:
            springs, loads = 0 * springs, np.hstack([loads, self._loads(nodes)])
        found = self.grid.solve(tangent, nodes, springs, loads)
        step = -found[:, 0]
        if self.other is not None:  # the sphere's springs join the nodes of the surface
            both = np.eye(len(nodes)) + stiff @ found[nodes, 1:]
            step -= found[:, 1:] @ np.linalg.solve(both, stiff @ step[nodes])
        if not np.isfinite(step).all():
            raise ArithmeticError("not finite")
        return step

    def crater(self) -> tuple[float, float]:
        """Radius to which the surface lies below its place, and the volume there."""
        r, down = self.grid.r[: len(self.grid.down)], self.state.u[self.grid.down]
        above = np.flatnonzero(down <= 0)
        end = int(above[0]) if above.size else len(r) - 1
        fall = down[end - 1] - min(down[end], 0)
        edge = r[end - 1] + (r[end] - r[end - 1]) * down[end - 1] / fall
        x, y = np.append(r[:end], edge), np.append(down[:end], 0.0)
        volume = 2 * np.pi * np.sum(np.diff(x) * (x[1:] * y[1:] + x[:-1] * y[:-1]) / 2)
        return float(edge), float(volume)
