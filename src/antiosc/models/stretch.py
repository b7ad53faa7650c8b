"""Forces of second-order strain in the modes of a model, for sheets that stretch as they bend.

Strains are ε(u) + η(u, u)/2. With the amplitudes a of some free modes of unit mass, and a static
response of all other motions, the energy in addition to the linear energy is

    U(a) = Σ H_kij a_k a_i a_j/3 + Σ G_kijl a_k a_i a_j a_l/4,
    f_k = Σ H_kij a_i a_j + Σ G_kijl a_i a_j a_l,

where H and G are symmetric in all indices (computed in `antiosc.reduce.extraction.stretching`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin
from antiosc.engine.system import stretch_energy, stretch_forces

Count = int | Literal["auto"]

#: Most second-order modes of an impact: 30 of 58 random sheets need more than 12, 1 than 20.
MOST_MODES = 20
#: Most modes that a user may request: two more estimate their error.
MOST_REQUESTED_MODES = MOST_MODES - 2
#: Advice for second-order error bars: with smaller cells four of four bars were wider.
NARROWING_REMEDY = "use an explicit finite element program: smaller elements do not narrow it"
#: Asymmetry of the tensors over their size.
LARGEST_ASYMMETRY = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Stretch(ReprMixin):
    """Second-order forces of a part in m motions ("modes") excited at its sites.

    Attributes
    ----------
    modes : (J, m) the motions, orthonormal combinations of the J free modes of unit mass.
    quadratic, cubic : H (m, m, m) and G (m, m, m, m), of unit modal masses.
    count : number of modes that an impact uses (the modes with the largest motion); "auto": as
        many as needed.
    shapes : (n_dofs, m (m + 1)/2) second-order displacements v_ij of the pairs (0, 0), (0, 1) … of
        modes: u = Σ a_i φ_i + Σ a_i a_j v_ij; not saved to files.
    """

    modes: Array
    quadratic: Array
    cubic: Array
    count: Count = "auto"
    shapes: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        modes = checks.floats("modes", self.modes, (None, None))
        m = modes.shape[1]
        if m > MOST_MODES or not m:
            raise InputError(f"a Stretch has 1 to {MOST_MODES} modes; got {m}.")
        if np.abs(modes.T @ modes - np.eye(m)).max() > LARGEST_ASYMMETRY:
            raise InputError("the modes of a Stretch must be orthonormal.")

        for name, rank in (("quadratic", 3), ("cubic", 4)):
            tensor = checks.floats(name, getattr(self, name), (m,) * rank)
            permuted = np.moveaxis(tensor, 0, -1)
            size = np.abs(tensor).max(initial=0.0)
            if np.abs(tensor - permuted).max() > LARGEST_ASYMMETRY * size:
                raise InputError(f"{name} must be symmetric in all its indices.")
            checks.store(self, **{name: checks.read_only(tensor)})

        if self.count != "auto":
            checks.store(self, count=checks.whole("count", self.count, least=1))

        if self.shapes is not None:
            columns = m * (m + 1) // 2
            checks.store(self, shapes=checks.floats("shapes", self.shapes, (None, columns)))

        checks.store(self, modes=checks.read_only(modes))

    def _facts(self) -> list[tuple[str, str]]:
        return [("modes", str(self.modes.shape[1])), ("taken", str(self.count))]

    @property
    def size(self) -> int:
        """Number m of the modes."""
        return int(self.modes.shape[1])

    def forces(self, a: Array) -> Array:
        """Modal forces (n, m) [N/kg^1/2] at amplitudes (n, m) [m kg^1/2]."""
        quadratic_force, cubic_force = stretch_forces(self.quadratic, self.cubic, a)
        return quadratic_force + cubic_force

    def energy(self, a: Array) -> Array:
        """Energies (n,) [J] at amplitudes (n, m)."""
        return stretch_energy(self.quadratic, self.cubic, a)

    def pairs(self, a: Array, b: Array | None = None) -> Array:
        """Products (n, m (m + 1)/2) a_i a_j (or a_i b_j, symmetrised), i <= j; doubled if i < j."""
        i, j = np.triu_indices(self.size)
        b = a if b is None else b
        products = (a[:, i] * b[:, j] + a[:, j] * b[:, i]) / 2
        return np.asarray(np.where(i == j, 1, 2) * products)

    def pair_motion(self, a: Array, v: Array, w: Array, derivative: int) -> Array:
        """`pairs(a)` for derivative 0, else its 1st or 2nd time derivative; v = a', w = a''."""
        if derivative == 0:
            return self.pairs(a)
        if derivative == 1:
            return 2 * self.pairs(a, v)
        return 2 * (self.pairs(a, w) + self.pairs(v))

    def turned(self, turn: Array, omega: Array) -> Stretch:
        """Forces in k combinations `turn` (m, k) of the modes; other modes respond statically."""
        k = turn.shape[1]
        quadratic = _transformed(self.quadratic, turn).reshape((k,) * 3)
        cubic = _transformed(self.cubic, turn).reshape((k,) * 4)
        work = np.tensordot(self._pair_forces(turn), self.following(turn, omega), axes=(0, 0))
        ways = (work, work.transpose(0, 2, 1, 3), work.transpose(0, 2, 3, 1))
        cubic = cubic + 2 / 3 * sum((way + way.transpose(2, 3, 0, 1)) / 2 for way in ways)
        return Stretch(self.modes @ turn, quadratic, cubic, k)

    def _pair_forces(self, turn: Array) -> Array:
        """Quadratic forces (m, k, k) on modes for products of two amplitudes of `turn` (m, k)."""
        return np.asarray(np.einsum("mij,ik,jl->mkl", self.quadratic, turn, turn, optimize=True))

    def following(self, turn: Array, omega: Array) -> Array:
        """Static response (m, k, k) of all other modes to products of the amplitudes of `turn`."""
        stiffness = self.modes.T @ (omega[:, None] ** 2 * self.modes)
        forces = self._pair_forces(turn)
        columns = forces.reshape(self.size, -1)
        taken = turn @ np.linalg.solve(turn.T @ stiffness @ turn, turn.T @ columns)
        return np.asarray((taken - np.linalg.solve(stiffness, columns)).reshape(forces.shape))

    def shapes_in(self, modes: Array) -> Array | None:
        """Second-order displacements (n_dofs, pairs) of other `modes` (J, k); None if unknown."""
        if self.shapes is None:
            return None

        rotation = self.modes.T @ modes
        rows, columns = np.triu_indices(self.size)
        first, second = np.triu_indices(rotation.shape[1])
        pairs = rotation[rows][:, first] * rotation[columns][:, second]
        pairs = pairs + rotation[columns][:, first] * rotation[rows][:, second]
        return np.asarray(self.shapes @ (pairs / np.where(rows == columns, 2, 1)[:, None]))


def _transformed(tensor: Array, turn: Array) -> Array:
    """`tensor` with `turn` (m, k) applied to each of its axes."""
    for _ in range(tensor.ndim):
        tensor = tensor.reshape(len(turn), -1).T @ turn
    return tensor


def checked_count(stretch: object) -> Count | Literal[False]:
    """The checked argument `stretch` of `extract`."""
    if stretch is False or stretch is None:
        return False
    if isinstance(stretch, str) and stretch == "auto":
        return "auto"
    if isinstance(stretch, bool | str):
        raise InputError(f"stretch is a number, 'auto' or False; got {checks.shown(stretch)}.")

    count = checks.whole("stretch", stretch, least=1)
    if count > MOST_REQUESTED_MODES:
        raise InputError(f"stretch takes at most {MOST_REQUESTED_MODES} modes; got {count}.")

    return count


def stretch_of(body: object) -> Stretch | None:
    """The second-order forces of a body, also inside an `Impactor`; None if it has none."""
    inner = getattr(body, "body", None)
    stretch = getattr(body, "stretch", None) or getattr(inner, "stretch", None)
    if isinstance(stretch, Stretch):
        return stretch
    return None


def refuse_stretch(bodies: Mapping[str, object]) -> None:
    """InputError if one of the bodies has second-order forces."""
    for name, body in bodies.items():
        if stretch_of(body) is not None:
            raise InputError(
                f"{name!r} stretches, for simulate and Scene.run alone: extract it without stretch."
            )
