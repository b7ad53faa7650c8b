"""What a fall returns: its impacts, what points of the part feel, and how far it is predictable."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.brief import Brief
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.results.spectra import ShockSpectrum, srs
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.contact_scene import BODY
from antiosc.studies.drops.course import Course, fallen, nudged
from antiosc.studies.drops.episode import Episode
from antiosc.studies.drops.filters import CLASSES, LEAST_RATE, MEMORY, cfc_filter
from antiosc.studies.drops.flight import State, ringing
from antiosc.studies.drops.impacts import Peak

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from antiosc.studies.drops.worst import WorstField

#: Samples of a period of the highest mode, and most samples of a signal.
SAMPLES, MOST = 12, 200_000
#: Spin over the lowest natural frequency above which the stiffening by the spin matters.
STIFFENS = 0.02
#: Nudges of the predictability: angle [rad], and what a peak force may differ by.
NUDGE, SPREAD = 1e-4, 0.05


@dataclass(frozen=True, eq=False, repr=False)
class Fall(Course, Brief):
    """A fall from its start to its end: its course, and what the part feels."""

    @property
    def peak_force(self) -> float:
        """Largest sum of the normal forces of all impacts [N]."""
        return float(max((one.peak_force for one in self.impacts), default=0.0))

    @property
    def fastest_spin(self) -> float:
        """Largest spin [rad/s] before and after the impacts."""
        states = [self.start, *(one.end for one in self.episodes)]
        return float(max(np.linalg.norm(s.spin(self.body)) for s in states))

    # -- what a point feels

    def signal(
        self,
        at: Sequence[float] | str | None = None,
        impact: int = 0,
        *,
        filter: str | None = None,
        before: float = 0.0,
        after: float = 0.0,
    ) -> tuple[Array, Array]:
        """What an accelerometer at a point reads in an impact: times (n,) [s], (n, 3) [m/s^2].

        Its axes are those of the mesh and turn with the part. It feels no gravity in flight, and
        the rotation of the part with its centripetal acceleration.

        Parameters
        ----------
        at : coordinates [m] or the name of a group
            None: the centre of mass, as if the part were rigid.
        impact : int
            Number of the impact, from 0.
        filter : "CFC60", "CFC180", "CFC600" or "CFC1000", optional
            Channel frequency class of SAE J211-1.
        before, after : float
            Time before the first touch and after the last release [s]; at least what the filter
            remembers.
        """
        own = self._episodes_of(impact)
        rest = 0.0
        if filter is not None:
            checks.choice("filter", filter, tuple(CLASSES))
            rest = MEMORY / CLASSES[filter]
        begin = own[0].start.time - max(checks.nonnegative("before", before, "s"), rest)
        end = own[-1].end.time + max(checks.nonnegative("after", after, "s"), rest)
        begin, end = max(begin, 0.0), min(end, self.end.time)
        step = self._step(end - begin, filter)
        t = begin + step * np.arange(max(int((end - begin) / step), 2))
        a = self.acceleration(t, at)
        return t, a if filter is None else cfc_filter(step, a, filter)

    def _episodes_of(self, impact: int) -> list[Episode]:
        if not self.groups:
            raise InputError("the fall has no impact; let it last longer (until=).")
        k = checks.whole("impact", impact, least=0, most=len(self.groups) - 1)
        return [self.episodes[i] for i in self.groups[k]]

    def _step(self, span: float, filter: str | None) -> float:
        """Step [s] that resolves the highest mode, the contacts and the filter."""
        highest = float(self.body.omega.max(initial=0.0)) / (2 * np.pi)
        shortest = min(one.duration for one in self.episodes)
        step = min(shortest / 50, 1 / (SAMPLES * highest) if highest else np.inf)
        if filter is not None:
            step = min(step, 1 / (2 * LEAST_RATE * CLASSES[filter]))
        return max(step, span / MOST)

    def acceleration(self, times: ArrayLike, at: Sequence[float] | str | None = None) -> Array:
        """What an accelerometer at a point reads at times (n,) [s], (n, 3); see `signal`."""
        t = checks.column("times", times)
        if t.size and (t.min() < 0 or t.max() > self.end.time * (1 + 1e-12)):
            raise InputError(f"times must lie within the fall, 0 to {self.end.time:g} s.")
        arm, phi = self._point(at)
        found = np.zeros((t.size, 3))
        ends = np.array([one.end.time for one in self.episodes])
        starts = np.array([one.start.time for one in self.episodes])
        last = np.searchsorted(starts, t, side="right") - 1
        for k in np.unique(last):
            here = np.flatnonzero(last == k)
            touching = here[t[here] <= ends[k]] if k >= 0 else here[:0]
            if len(touching):
                found[touching] = self._in_contact(self.episodes[k], t[touching], arm, phi)
            flying = np.setdiff1d(here, touching)
            if len(flying):
                state = self.start if k < 0 else self.episodes[k].end
                found[flying] = self._in_flight(state, t[flying], arm, phi)
        return found

    def _point(self, at: Sequence[float] | str | None) -> tuple[Array, Array]:
        """Arm (3,) of a point from the centre of mass, and shapes (3, J) of the modes there."""
        body = self.body
        if at is None:
            return np.zeros(3), np.zeros((3, body.omega.size))
        if body.structure is None or body.basis is None:
            x = checks.array("at", at, (3,))
            return x - body.centre, np.zeros((3, body.omega.size))
        from antiosc.fem.fields import source
        from antiosc.fem.site.named_points import point_of
        from antiosc.fem.site.site import Reach

        x, part, _ = point_of(body.structure, at, None)
        reach = Reach("the point", np.inf if isinstance(at, str) else None)
        return x - body.centre, source(body.structure).at_point(
            body.structure, body.basis, x, part, reach
        )

    def _in_flight(self, state: State, t: Array, arm: Array, phi: Array) -> Array:
        body = self.body
        q, p = ringing(body.omega, body.decay, state.q, state.p, t - state.time)
        elastic = -(body.omega**2) * q - 2 * body.decay * p
        # the spin in the axes of the body changes slowly in flight: that at the start is taken
        spin = state.R.T @ state.spin(body)
        return np.asarray(elastic @ phi.T + _carried(body, spin[None], np.zeros((1, 3)), arm))

    def _in_contact(self, one: Episode, t: Array, arm: Array, phi: Array) -> Array:
        body, R = self.body, one.posed.R
        own = one.history.at(np.clip(t - one.start.time, 0.0, one.history.time[-1]))[BODY]
        moments, axes = body.principal
        linear = own.a[:, :3] / np.sqrt(body.mass) + [0.0, 0.0, self.setting.gravity]
        spin, turning = ((m[:, 3:6] / np.sqrt(moments)) @ axes for m in (own.v, own.a))
        return np.asarray(linear @ R + own.a[:, 6:] @ phi.T + _carried(body, spin, turning, arm))

    def peak(
        self,
        quantity: str = "acceleration",
        at: Sequence[float] | str | None = None,
        filter: str | None = None,
    ) -> Peak:
        """The largest acceleration of a point (`signal`), or the largest "force", over all impacts.

        Returns a `Peak`: `.value` in m/s^2 or N, `.g` in g, `.time` and `.impact`.
        """
        checks.choice("quantity", quantity, ("acceleration", "force"))
        found = Peak(0.0, 0.0, 0)
        for k, one in enumerate(self.impacts):
            if quantity == "force":
                best = Peak(one.peak_force, one.time, k)
            else:
                t, a = self.signal(at, k, filter=filter)
                size = np.linalg.norm(a, axis=1)
                i = int(np.argmax(size))
                best = Peak(float(size[i]), float(t[i]), k)
            found = max(found, best, key=float)
        return found

    def srs(
        self,
        at: Sequence[float] | str | None = None,
        impact: int = 0,
        frequencies: ArrayLike | None = None,
        Q: float = 10.0,
        *,
        axis: Sequence[float] | None = None,
        filter: str | None = None,
    ) -> ShockSpectrum:
        """Shock response spectrum of an impact at a point along an axis of the mesh [m/s^2].

        axis: default the direction of the largest acceleration.
        """
        t, a = self.signal(at, impact, filter=filter)
        if axis is None:
            along = a[np.argmax(np.linalg.norm(a, axis=1))]
        else:
            along = checks.array("axis", axis, (3,))
        size = float(np.linalg.norm(along))
        if size == 0:
            raise InputError("axis must not be the zero vector.")
        return srs(t, a @ along / size, frequencies, Q)

    def velocity_change(self, at: Sequence[float] | str | None = None, impact: int = 0) -> float:
        """Length of the change of velocity of a point over an impact, in its own axes [m/s]."""
        from scipy.integrate import trapezoid

        t, a = self.signal(at, impact)
        return float(np.linalg.norm(trapezoid(a, t, axis=0)))

    def half_sine(
        self,
        at: Sequence[float] | str | None = None,
        impact: int = 0,
        filter: str | None = None,
    ) -> tuple[float, float]:
        """Amplitude [m/s^2] and duration [s] of the half-sine of equal peak and velocity change."""
        _, a = self.signal(at, impact, filter=filter)
        peak = float(np.linalg.norm(a, axis=1).max())
        return peak, float(np.pi * self.velocity_change(at, impact) / (2 * peak))

    def worst(
        self, quantity: str = "von_mises", impacts: Sequence[int] | None = None, **options: Any
    ) -> WorstField:
        """The largest value at every node, and its time; options as of `peak_field`.

        impacts: numbers from 0; default: all.
        """
        from antiosc.studies.drops.worst import worst

        return worst(self, quantity, impacts, **options)

    # -- how far it is predictable

    def horizon(self, angle: float = NUDGE, spread: float = SPREAD) -> int:
        """How many impacts can be predicted: their peak forces differ by less than `spread`.

        The fall is repeated with its start turned by +-angle [rad] about two horizontal axes.
        """
        angle, spread = checks.positive("angle", angle, "rad"), checks.positive("spread", spread)
        own, known = self.impacts.column("peak_force"), len(self.impacts)
        for axis in np.eye(3)[:2]:
            for sign in (-1, 1):
                start = nudged(self.start, self.body, self.setting, sign * angle * axis)
                other = fallen(self.body, start, self.setting).impacts.column("peak_force")
                count = min(len(own), len(other))
                off = np.abs(other[:count] / own[:count] - 1) > spread
                known = min(known, int(np.argmax(off)) if off.any() else count)
        return known

    # -- words and pictures

    def summary(self) -> str:
        """The impacts as a table, and how the fall ended."""
        notes = "".join(f"\n{note}" for note in self.body.notes)
        return f"{self.impacts}\n{self.status} at {self.end.time:.4g} s{notes}"

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The part as it first hits, its height, the energies and the forces of the impacts."""
        from antiosc.studies.drops.pictures import overview

        return overview(self, path)

    def animate(self, path: str | os.PathLike[str], seconds: float = 8.0) -> Path:
        """A film of the fall (.mp4 with ffmpeg, or .gif), slowed to `seconds`."""
        from antiosc.studies.drops.pictures import film

        return film(self, path, checks.positive("seconds", seconds, "s"))

    def _facts(self) -> list[tuple[str, str]]:
        return [
            ("impacts", f"{len(self.impacts)}, the strongest {self.peak_force:.4g} N"),
            ("end", f"{self.status} at {self.end.time:.4g} s"),
        ]


def warn_of(fall: Fall) -> None:
    """Warn of a spin that stiffens the part, and of a fall that does not come to rest."""
    ratio = fall.fastest_spin * fall.body.slowest / (2 * np.pi)
    if ratio > STIFFENS:
        warn(
            f"the part spins with {fall.fastest_spin:.3g} rad/s, {ratio:.2g} of its lowest "
            f"natural frequency: the stiffening by the spin is left out, which matters above "
            f"{STIFFENS:g}.",
            AccuracyWarning,
        )
    if "not at rest" in fall.status:
        warn(f"the fall is ended {fall.status}; give until=.", AccuracyWarning)


def _carried(body: FreeBody, spin: Array, turning: Array, arm: Array) -> Array:
    """Acceleration (n, 3) of a point by the spin and its change, all in the axes of the body."""
    gyration = np.cross(spin, spin @ body.tensor)
    turning = turning - gyration @ np.linalg.inv(body.tensor)
    return np.asarray(np.cross(turning, arm) + np.cross(spin, np.cross(spin, arm)))
