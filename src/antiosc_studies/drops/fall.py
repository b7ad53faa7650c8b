"""`Fall`: the impacts of a fall, and the motion of points of the part."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from antiosc import PeakField, ShockSpectrum, peak_field, srs
from antiosc.base import checks
from antiosc.base._types import Array, Figure, IntArray
from antiosc.base.cfc import (
    CLASS_FREQUENCIES,
    SHOCK_FILTER,
    cfc_filter,
    filter_memory,
    sampling_step,
)
from antiosc.base.errors import AccuracyWarning, InputError, warn, without_warnings
from antiosc.base.materials import names, record
from antiosc.base.texts import Result, engineering, exceeds, percent, plain_number
from antiosc.io.isolation import Refinement
from antiosc_studies.drops.body import free_body
from antiosc_studies.drops.episode import Episode
from antiosc_studies.drops.flight import Flight, free_vibration
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.impacts import Impacts, Peak, impact_of
from antiosc_studies.drops.path import RUN_LIMITS
from antiosc_studies.drops.touching import BODY
from antiosc_studies.drops.trajectory import trajectory
from antiosc_studies.drops.yielding import PointContacts

if TYPE_CHECKING:
    from antiosc import Structure

#: Samples of a signal in a period of the highest mode: they miss its peak by at most 3.4 %.
SIGNAL_SAMPLES = 12
#: Most samples of a signal.
MOST_SIGNAL_SAMPLES = 200_000
#: Samples of stresses in a period of the highest mode, whose peak they miss by at most 8 %.
STRESS_SAMPLES = 8
#: Least and largest number of samples of stresses in an episode.
STRESS_SAMPLE_LIMITS = 20, 200
#: Spin over the lowest natural frequency above which stiffening by the spin matters.
STIFFENING_SPIN = 0.02
#: Largest indentation of a layer, over the radius, at which a ball is like a paraboloid.
LARGEST_LAYER_INDENTATION = 0.3
#: Note for a fall whose hardest impact is not the first.
LATER_HARDEST_NOTE = (
    "the hardest impact is not the first: its numbers and bars are those of this attitude alone,"
    " and a degree of tilt may change them by more (falls of drawn tilts tell how much: ensemble)"
)


#: Coordinates [m] of a point, the name of a group, or None: the centre of mass of a rigid part.
Location: TypeAlias = Sequence[float] | str | None


@dataclass(frozen=True, eq=False, repr=False)
class WorstField(PeakField):
    """A `PeakField` over the impacts of a fall; its times are those of the fall.

    impact : (P,) number of the impact, from 0, in which each node has its largest value.
    """

    impact: IntArray = field(default_factory=lambda: np.zeros(0, dtype=int))


#: `Fall.status` of a fall that has not come to rest.
UNSETTLED = 3
NO_IMPACT_ERROR = "the fall has no impact; let it last longer (until)."


@dataclass(frozen=True, eq=False, repr=False)
class Fall(Result):
    """A fall from its start to its end: flights and episodes of contact in turn.

    Attributes
    ----------
    body : the free body of the part; `drop` accepts it instead of the part.
    setting : floor, gravity and tolerances of the fall.
    start, end : position, orientation, velocity and spin at the start and at the end.
    episodes : the episodes of contact in order. Each scene is linear about the orientation at its
        first touch, and corrected for the rotation that follows.
    flights : the motions between the episodes.
    groups : for each impact the indices of its episodes.
    status : 0: at rest, or at the requested end; 1: contact forces miss `tol`; 3: not at rest after
        the largest number of contacts.
    message : why the fall ended.
    """

    body: FreeBody
    setting: Setting
    start: State
    end: State
    episodes: list[Episode]
    flights: list[Flight]
    groups: list[list[int]]
    message: str

    @cached_property
    def impacts(self) -> Impacts:
        """The impacts, as a table."""
        gravity = self.setting.gravity
        return Impacts(impact_of(self.body, gravity, landed) for landed in self._contacts)

    def energy(self) -> tuple[Array, Array]:
        """(times (n,) [s] of all touches and releases, energies (n, 4) [J] there).

        Columns: rigid motion, vibration, height of the centre, contacts.
        """
        rows = [(self.start, 0.0)]
        for contact in self.episodes:
            rows += [(contact.start, rows[-1][1]), (contact.end, contact.contact_energy)]

        rows.append((self.end, rows[-1][1]))
        gravity = self.setting.gravity
        energies = [(*s.energies(self.body, gravity), stored) for s, stored in rows]
        return np.array([s.time for s, _ in rows]), np.array(energies)

    def _episodes_of(self, impact: int) -> list[Episode]:
        """The episodes of an impact."""
        if not self.groups:
            raise InputError(NO_IMPACT_ERROR)
        k = checks.whole("impact", impact, least=0, most=len(self.groups) - 1)
        return [self.episodes[i] for i in self.groups[k]]

    @cached_property
    def _contacts(self) -> list[PointContacts]:
        """The contacts at points of each impact."""
        floor = self.setting.floor
        return [PointContacts(floor, [self.episodes[i] for i in group]) for group in self.groups]

    @property
    def status(self) -> int:
        if self.message.startswith("not at rest"):
            return UNSETTLED
        return 1 if self.missed else 0

    def numbers(self) -> dict[str, object]:
        """The impacts, and the end of the fall and its time, as JSON values by name."""
        ending = {"duration": float(self.end.time), "status": self.status, "message": self.message}
        return {"impacts": self.impacts.numbers(), "peak_force": self.peak_force, **ending}

    @property
    def peak_force(self) -> float:
        """Largest sum of the normal forces of all impacts [N]."""
        return float(max((impact.peak_force for impact in self.impacts), default=0.0))

    @property
    def hardest(self) -> int | None:
        """Number of the impact with the largest force, from 0; None without impacts."""
        forces = [impact.peak_force for impact in self.impacts]
        return int(np.argmax(forces)) if forces else None

    @property
    def fastest_spin(self) -> float:
        """Largest spin [rad/s] in the flights: at the start, and before and after impacts."""
        spins = [impact.spin_before for impact in self.impacts]
        spins += [impact.spin_after for impact in self.impacts]
        return float(max(np.linalg.norm(spin) for spin in [self.start.spin(self.body), *spins]))

    # -- motion of a point

    def signal(
        self,
        at: Location = None,
        impact: int = 0,
        *,
        filter: str | None = None,
        before: float = 0.0,
        after: float = 0.0,
    ) -> tuple[Array, Array]:
        """Reading of an accelerometer at a point in an impact: times (n,) [s], (n, 3) [m/s^2].

        Its axes are those of the mesh and turn with the part. In flight it reads no gravity, but
        the centripetal acceleration of the rotation.

        Parameters
        ----------
        at : coordinates [m] or the name of a group
            None: the centre of mass, as if the part were rigid.
        impact : int
            Number of the impact, from 0.
        filter : "CFC60", "CFC180", "CFC600" or "CFC1000", optional
            Channel frequency class of SAE J211-1.
        before, after : float
            Time before the first touch and after the last release [s]; at least the memory of the
            filter.
        """
        episodes = self._episodes_of(impact)
        memory = 0.0
        steps = [np.inf]
        if filter is not None:
            memory = filter_memory(filter)
            steps = [sampling_step(filter)]

        begin = episodes[0].start.time - max(checks.nonnegative("before", before, "s"), memory)
        end = episodes[-1].end.time + max(checks.nonnegative("after", after, "s"), memory)
        begin = max(begin, 0.0)
        end = min(end, self._last_time)
        steps += [episode.duration / 50 for episode in self.episodes]
        steps += (2 * np.pi / (SIGNAL_SAMPLES * self.body.omega[-1:])).tolist()
        step = max(min(steps), (end - begin) / MOST_SIGNAL_SAMPLES)
        t = begin + step * np.arange(max(int((end - begin) / step), 2))
        a = self.acceleration(t, at)
        return t, a if filter is None else cfc_filter(step, a, filter)

    def acceleration(self, times: ArrayLike, at: Location = None) -> Array:
        """Reading of an accelerometer at a point at times (n,) [s]: (n, 3); see `signal`.

        Beyond its end the fall continues as a flight, for the memory of a filter.
        """
        t = checks.column("times", times)
        if t.size and (t.min() < 0 or t.max() > self._last_time * (1 + 1e-12)):
            raise InputError(f"times must lie within the fall, 0 to {self._last_time:g} s.")

        starts = [0.0]
        parts = list[State | Episode]([self.start])
        for episode in self.episodes:
            starts += [episode.start.time, episode.end.time]
            parts += [episode, episode.end]

        interval = np.searchsorted(starts, t, side="right") - 1
        acceleration = np.zeros((t.size, 3))
        point = self._located_point(at)
        for k in np.unique(interval):
            acceleration[interval == k] = self._specific_force(
                parts[k], t[interval == k] - starts[k], *point
            )

        return acceleration

    @property
    def _last_time(self) -> float:
        """Time [s] up to which the motion is computed: end of the fall plus memory of filters."""
        return self.end.time + max(map(filter_memory, CLASS_FREQUENCIES))

    def _located_point(self, at: Location) -> tuple[Array, Array]:
        """Position (3,) [m] of a point relative to the centre of mass, and shapes (3, J) there."""
        body = self.body
        rigid = np.zeros((3, body.omega.size))
        if at is None:
            return np.zeros(3), rigid
        if body.structure is None or body.basis is None:
            return checks.floats("at", at, (3,)) - body.centre, rigid
        from antiosc.recovery import source
        from antiosc.recovery.place import Reach
        from antiosc.reduce.site.site import located_point

        x, part, _ = located_point(body.structure, at, None)
        reach = Reach("the point", np.inf if isinstance(at, str) else None)
        fields = source(body.structure)
        return x - body.centre, fields.at_point(body.structure, body.basis, x, part, reach)

    def _specific_force(self, phase: State | Episode, times: Array, r: Array, phi: Array) -> Array:
        """Acceleration minus gravity (n, 3) at a point of the body, in the axes of the body.

        phase : the start of a flight, or an episode; times : (n,) since its start [s]; r : position
        (3,) of the point relative to the centre of mass [m]; phi : (3, J) mode shapes there.
        """
        body = self.body
        gravity = self.setting.gravity

        if isinstance(phase, Episode):
            R, spin, angular, a = phase.motion(times)
            linear = np.einsum("nb,nba->na", a[:, :3] / np.sqrt(body.mass) + [0, 0, gravity], R)
            elastic = a[:, 6:]
        else:
            R = Flight(body, phase, gravity).orientation(times)
            spin = phase.angular_momentum @ R @ body.inverse_inertia
            angular = linear = np.zeros(3)
            q, p = free_vibration(body.omega, body.decay, phase.q, phase.p, times)
            elastic = -(body.omega**2) * q - 2 * body.decay * p

        angular = angular - np.cross(spin, spin @ body.inertia) @ body.inverse_inertia
        by_rotation = np.cross(angular, r) + np.cross(spin, np.cross(spin, r))
        return np.asarray(linear + elastic @ phi.T + by_rotation)

    def peak(
        self, quantity: str = "acceleration", at: Location = None, filter: str | None = None
    ) -> Peak:
        """The largest acceleration at a point (`signal`), or the largest "force", of all impacts.

        Returns a `Peak`: `.value` in m/s^2 or N, `.g` in g, `.time` and `.impact`.
        """
        checks.choice("quantity", quantity, ("acceleration", "force"))
        if not self.groups:
            raise InputError(NO_IMPACT_ERROR)

        if quantity == "force":
            peaks = [Peak(one.peak_force, one.time, k) for k, one in enumerate(self.impacts)]
        else:
            peaks = [self._peak_in(k, at, filter) for k in range(len(self.impacts))]

        return max(peaks, key=float)

    def _peak_in(self, k: int, at: Location, filter: str | None) -> Peak:
        """The largest acceleration at a point in impact `k`, between the middles of the flights
        before and after it.
        """
        t, a = self.signal(at, k, filter=filter)
        own = (t >= self._middle_before(k)) & (t <= self._middle_before(k + 1))
        size = np.where(own, np.linalg.norm(a, axis=1), 0.0)
        i = int(np.argmax(size))
        return Peak(float(size[i]), float(t[i]), k)

    def _middle_before(self, k: int) -> float:
        """Middle [s] of the flight before impact `k`; -inf before the first, inf after the last."""
        if k in (0, len(self.groups)):
            return np.inf if k else -np.inf
        return (self._episodes_of(k - 1)[-1].end.time + self._episodes_of(k)[0].start.time) / 2

    @cached_property
    def shocks(self) -> tuple[Peak, ...]:
        """The largest acceleration of the centre of mass in each impact, filtered by CFC1000: the
        sum of forces over the mass, as for a rigid part.
        """
        return tuple(self._peak_in(k, None, SHOCK_FILTER) for k in range(len(self.impacts)))

    @cached_property
    def dents(self) -> Array:
        """Depth (n,) [m] of the deepest dent of each impact; NaN without a dent, or if it is
        unknown.
        """
        return np.array([landed.deepest_dent for landed in self._contacts])

    def srs(
        self,
        at: Location = None,
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
        strongest = a[np.argmax(np.linalg.norm(a, axis=1))]
        direction = strongest if axis is None else checks.floats("axis", axis, (3,))
        size = float(np.linalg.norm(direction))
        if size == 0:
            raise InputError("axis must not be the zero vector.")
        return srs(t, a @ direction / size, frequencies, Q)

    def worst(
        self,
        quantity: str = "von_mises",
        impacts: Sequence[int] | None = None,
        *,
        tol: float | None = None,
        finer: Callable[[Sequence[Refinement]], Structure] | None = None,
        **options: Any,
    ) -> WorstField:
        """The largest value at every node, and its time.

        Parameters
        ----------
        quantity : str
            As for `peak_field`, as are further options.
        impacts : sequence of int, optional
            Numbers of the impacts from 0; default: all, or with `tol` the one of largest force.
        tol : float, optional
            Largest relative mesh error of the stress: cells are refined where it is larger, and the
            fall is repeated up to these impacts, as in `strike(…, stress_tol=…)`.
        finer : callable, optional
            Makes the part with smaller cells at places ((x, y, z), size) [m]; default: straight
            triangles and tetrahedra are bisected.

        Raises
        ------
        InputError
            A rigid part; with `tol` also a fall without an impact.
        """
        if self.body.structure is None:
            raise InputError("a rigid part has no stress: drop a Structure.")
        if impacts is not None:
            impacts = [int(k) for k in checks.column("impacts", impacts)]
            if not impacts:
                raise InputError("impacts must have at least one number; got none.")
        if tol is not None:
            return self._worst_within(quantity, impacts, checks.tolerance(tol), finer, options)
        impact_numbers = list(range(max(len(self.groups), 1)) if impacts is None else impacts)
        periods = self.body.omega.max(initial=0.0) / (2 * np.pi)

        parts = []
        zones = []
        for k in impact_numbers:
            episodes = self._episodes_of(k)
            for episode in episodes:
                samples = STRESS_SAMPLES * periods * episode.duration
                count = int(np.clip(samples, *STRESS_SAMPLE_LIMITS))
                motion = episode.history.at(np.linspace(0.0, episode.duration, count))[BODY]
                parts.append(replace(motion, time=motion.time + episode.start.time))
            zones += [one.zone for one in self._contacts[k].contacts]

        merged = {
            n: np.concatenate([getattr(p, n) for p in parts]) for n in ("time", "q", "v", "a")
        }
        forces = np.zeros((merged["time"].size, parts[0].forces.shape[1]))

        with without_warnings():
            joined_motion = replace(parts[0], forces=forces, **merged)
            options = {"contacts": zones, **options}
            field = peak_field(self.body.structure, joined_motion, quantity, **options)

        starts = [self.episodes[motion[0]].start.time for motion in self.groups]
        impact = np.searchsorted(starts, field.times, side="right") - 1
        field = replace(field, error=None)
        if field._margin is not None:
            margin = field._margin
            k = int(np.searchsorted(starts, margin.time, side="right")) - 1
            verdicts = [self._contacts[j].yield_text for j in impact_numbers]
            yields = margin.criterion == "yield" and any(verdicts)
            errors = [one.law_error or 0.0 for one in self.impacts]
            error = max((errors[j] for j in impact_numbers), default=0.0)
            margin = replace(margin, contact=yields, impact=k + 1, force_error=error)
            field = replace(field, _margin=margin)

        return WorstField(**vars(field), impact=impact)

    def _worst_within(
        self,
        quantity: str,
        impacts: list[int] | None,
        tol: float,
        finer: Callable[[Sequence[Refinement]], Structure] | None,
        options: dict[str, Any],
    ) -> WorstField:
        """`worst` of these impacts (default: largest force), with an error bar of at most `tol`."""
        from antiosc.strikes.stress import closed, divided

        structure: Any = self.body.structure
        if self.hardest is None:
            raise InputError(NO_IMPACT_ERROR)
        chosen = [self.hardest] if impacts is None else impacts

        def again(part: Structure) -> Fall:
            body = free_body(part, len(self.body.omega), None, self.body.corner_radius)
            body = replace(body, decay=self.body.decay)
            return fall_of(body, self.start, replace(self.setting, impacts=max(chosen) + 1))

        def fields(_: Structure, fall: Fall) -> dict[str, PeakField]:
            return {quantity: fall.worst(quantity, chosen, **options)}

        finer = finer or partial(divided, structure)
        field = closed(self, structure, tol, finer, again, fields).fields[quantity]
        return checks.instance("worst", field, WorstField, "a field of a fall")

    @property
    def notes(self) -> list[str]:
        """Assumptions that were made, and a sentence if the contact yields."""
        rigid = "the floor is taken as rigid (floor)" if self.setting.floor.rigid else ""
        friction = f"{self.setting.floor.friction:g}"
        sentences = (
            rigid,
            f"the floor has a coefficient of friction of {friction} (friction)",
            self._shock_note,
            LATER_HARDEST_NOTE * bool(self.hardest),
            self.contact_verdict,
            *PointContacts(self.setting.floor, self.episodes).notes,
            self._breaking_note,
        )
        return [*self.body.notes, *filter(None, sentences)]

    @property
    def flat(self) -> str:
        """Sentence if a face lands flat, for which the method is not valid; else ""."""
        flat = [str(k) for k, landed in enumerate(self._contacts, 1) if landed.lands_flat]
        if not flat:
            return ""
        numbers = ", ".join(flat[:3]) + (", …" if len(flat) > 3 else "")
        return (
            f"a face lands flat in impact {numbers}, which is outside of this method: no force of"
            " it, and no stress by it, is an answer (waves give a prismatic part rho c A v at most;"
            " tilt it, or give the floor a law)"
        )

    @property
    def _shock_note(self) -> str:
        """Sentence on the largest acceleration of the centre of mass; "" without impacts."""
        if not self.groups:
            return ""
        peak = max(self.shocks, key=float)
        by_force = self.impacts[peak.impact].law_error
        bar = " (no error bar: that of the force is not known)"
        if by_force is not None:
            bar = f" ± {percent(by_force)} (the error of the force, which it follows)"

        return (
            f"the centre of mass has at most {plain_number(peak.g, 3)} g{bar} through "
            f"{SHOCK_FILTER}, in"
            f" impact {peak.impact + 1}: all forces over the mass, as of a rigid part; the g of a"
            " point of the part are those of an accelerometer there."
        )

    @property
    def _breaking_note(self) -> str:
        """Sentence on cracking and fracture of the part's materials; "" if nothing is known."""
        known = {name: record(name) for m in self.body.matters if (name := m.name) in names()}
        told = [f"{name}: {one.breaks}" for name, one in known.items() if one.breaks]
        return "; ".join(["whether the part breaks is not computed", *told]) if told else ""

    @property
    def contact_verdict(self) -> str:
        """Sentence on the hardest impact whose contact yields, with its permanent indentation; ""
        if none yields or it is unknown.
        """
        by_force = sorted(range(len(self.groups)), key=lambda k: -self.impacts[k].peak_force)
        for k in by_force:
            if sentence := self._contacts[k].yield_text:
                of_all = ", the hardest," * (k == self.hardest)
                several = len(by_force) > 1
                return f"in impact {k + 1}{of_all} {sentence}" if several else sentence

        return ""

    @property
    def law_error(self) -> float | None:
        """Relative error of the force of the hardest impact by its contact law.

        It contains the range of the yield strength and large strains. None: unknown (`no_bar`).
        """
        return None if self.hardest is None else self.impacts[self.hardest].law_error

    def no_bar(self, impact: int = 0) -> str:
        """Why the impact of this number (from 0) has no error bar, and the remedy; else ""."""
        self._episodes_of(impact)
        return self._contacts[impact].no_error_reason

    @property
    def contact_yields(self) -> bool:
        """Whether a contact is known to yield."""
        return bool(self.contact_verdict)

    @property
    def missed(self) -> int:
        """Number of episodes whose contact forces miss `tol`."""
        return sum(not episode.error <= self.setting.tol for episode in self.episodes)

    # -- text and pictures

    def summary(self) -> str:
        """The impacts as a table, the hardest impact, and the end of the fall."""
        ended = f"{self.message} at {self.end.time:.4g} s"
        hardest = f"the hardest is {self._hardest_text}" if self.impacts else ""
        return "\n".join(filter(None, [self.flat, str(self.impacts), hardest, ended, *self.notes]))

    @property
    def _hardest_text(self) -> str:
        """Text: the hardest impact, its force and the force's error bar."""
        bar = f" ± {percent(self.law_error)}" if self.law_error else ""
        return f"impact {(self.hardest or 0) + 1}, {engineering(self.peak_force, 'N')}{bar}"

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The part at its first touch, its height, the energies and the forces of the impacts."""
        from antiosc_studies.drops.pictures import draw_fall

        return draw_fall(self, path)

    def _facts(self) -> list[tuple[str, str]]:
        hardest = f", the hardest {self._hardest_text}" if self.impacts else ""
        return [
            ("impacts", f"{len(self.impacts)}{hardest}"),
            ("end", f"{self.message} at {self.end.time:.4g} s"),
        ]

    def warn(self) -> None:
        """Warn of fast spin, no rest, forces that miss `tol`, and layers pressed too deep."""
        ratio = self.fastest_spin * self.body.longest_period / (2 * np.pi)
        if exceeds(ratio, STIFFENING_SPIN, 2):
            warn(
                f"the part spins with {self.fastest_spin:.3g} rad/s, {ratio:.2g} of its lowest "
                f"natural frequency: the stiffening by the spin is left out, which matters above "
                f"{STIFFENING_SPIN:g}.",
                AccuracyWarning,
            )

        if self.status == UNSETTLED:
            warn(
                f"the fall is ended {self.message}; give a larger duration or number of impacts "
                "(until).",
                AccuracyWarning,
            )

        if self.missed:
            tol = self.setting.tol
            worst = max(episode.error for episode in self.episodes)
            excess = f"by up to {worst:.2g}" if worst < np.inf else f"within {RUN_LIMITS[1]} steps"
            warn(
                f"the contact forces of {self.missed} of {len(self.episodes)} episodes do not "
                f"reach tol = {tol:g} {excess}: give a larger tol, or fewer modes.",
                AccuracyWarning,
            )

        layer = self.setting.floor.layer
        strains = [one.depths() / one.body.radii[one.indices].min(axis=1) for one in self.episodes]
        strain = max((float(values.max()) for values in strains), default=0.0)
        if layer is not None and exceeds(strain, LARGEST_LAYER_INDENTATION, 3):
            warn(
                f"a point is pressed into the layer by {strain:.3g} of its radius: the law of a "
                f"layer holds up to {LARGEST_LAYER_INDENTATION:g}.",
                AccuracyWarning,
            )


def initial_state(
    body: FreeBody, setting: Setting, R: Array, spin: Array, velocity: Array
) -> State:
    """The initial state: the lowest point is at the height of the setting."""
    low = float((body.points @ R[2] - body.ball_radii).min())
    zero = np.zeros(body.omega.size)
    centre = np.array([0.0, 0.0, setting.height - low])
    momentum = R @ (body.inertia @ (R.T @ spin))
    return State(0.0, centre, velocity, R, momentum, zero, zero)


def fall_of(
    body: FreeBody,
    start: State,
    setting: Setting,
    report: Callable[[int, int, float], None] = lambda *_: None,
) -> Fall:
    """The fall of a body from a state; `report` as for `trajectory`."""
    return Fall(body, setting, start, *trajectory(body, start, setting, report))
