"""How a run ended: its status, and the message that explains it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyWarning, AntioscWarning, warn
from antiosc.simulation.histories.energy import GAIN
from antiosc.simulation.march.convergence import Converged, stopped
from antiosc.simulation.march.engine import Run
from antiosc.simulation.march.system import System
from antiosc.simulation.problem.assembly import Assembly

#: status of a run: complete; complete, but not to the tolerance; stopped before the end; complete,
#: but the bodies still touch at the end
COMPLETED, INEXACT, STOPPED, TOUCHING = 0, 1, 2, 3

#: Rotation [rad] of a body above which a warning is given.
SMALL_ROTATION = 0.1
#: Contacts and scenes of a batch that a message names.
_NAMED = 5
#: A closing speed below this share of the modal contributions is rounding error.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Verdict:
    """Status and message of a run; `odd`: causes a warning although the status is 0."""

    status: int
    message: str
    odd: bool = False

    def with_shortage(self, shortage: str) -> Verdict:
        """The same verdict for a model with too few anti-oscillators."""
        worse = self.status if self.status in (INEXACT, STOPPED) else INEXACT
        return Verdict(worse, f"{self.message} {shortage}", self.odd)

    def tell(self) -> None:
        """Warn at the caller's line unless the run completed as requested."""
        if self.status:
            warn(self.message, AccuracyWarning)
        elif self.odd:
            warn(self.message)


class Ended(NamedTuple):
    """How a run ended: what its verdict is made of.

    `time` [s] reached, `touches` their number, `open` the contacts that go on, and the errors.
    """

    answer: int
    time: float
    touches: int
    open: Sequence[int]
    force: float
    peak: float
    certain: float


def touching(run: Run, system: System) -> list[int]:
    """The contacts that touched during the run and go on at its end."""
    if len(system.laws) == 1 and (not len(run.events) or run.events[-1, 2] == march.APART):
        return []
    events = run.events.tolist()
    last = {which: piece for _, which, piece, _ in events}
    on = sorted(int(c) for c, piece in last.items() if piece != march.APART)
    parted = {which for _, which, piece, _ in events if piece == march.APART} if on else ()
    return [c for c in on if c in parted or not system.closed[c]]


def verdict_of(
    assembly: Assembly,
    ended: Ended,
    tol: float,
    limits: tuple[int, int],
    failure: str = "",
    gain: Callable[[], float] = lambda: 0.0,
) -> Verdict:
    """The verdict on a run; `limits`: max_contacts, max_steps; `gain`: relative, of energy."""
    failure = failure or stopped(ended.answer, ended.time, *limits)
    if failure:
        return Verdict(STOPPED, failure[0].upper() + failure[1:] + ".")
    cut = cut_short(assembly, ended)
    if doubt := inexact(ended, tol, limits[1], gain):
        return Verdict(INEXACT, f"{doubt} {cut}".rstrip())
    if untouched := never_touched(assembly, ended):
        return Verdict(COMPLETED, f"Never touched: {untouched}.", odd=True)
    return Verdict(TOUCHING, cut) if cut else Verdict(COMPLETED, "Completed.")


def inexact(ended: Ended | Converged, tol: float, max_steps: int, gain: Callable[[], float]) -> str:
    """Why a run that reached its end does not meet the tolerance; "" if it does."""
    worst = max(ended.force, ended.peak)
    if worst == np.inf:
        if ended.certain > 0:
            return (
                f"The error is not known: a finer run takes too many steps. Up to"
                f" {ended.certain:.4g} s the two agree; shorten the duration to that."
            )
        return (
            f"The error is not known: max_steps = {max_steps} leaves no finer run to compare with;"
            f" raise it or shorten the duration."
        )
    if not worst <= tol:
        return (
            f"The contact forces did not converge: finer runs within max_steps = {max_steps} differ"
            f" by {worst:.2g}, not tol = {tol:g} (if they rattle, small errors grow). Up to"
            f" {ended.certain:.4g} s they agree; raise max_steps, or shorten the duration to that."
        )
    share = gain()
    if share > GAIN:
        return (
            f"The scene gained energy, {share:.2g} of the highest that it had; use a smaller tol or"
            f" step."
        )
    return ""


def cut_short(assembly: Assembly, ended: Ended) -> str:
    """Which contacts go on at the end of the run; those that rest since its start do not count."""
    contacts = [assembly.scene.contacts[c] for c in ended.open]
    if not contacts:
        return ""
    named = ", ".join(f"{c.a!r} - {c.b!r}" for c in contacts[:_NAMED])
    more = ", ..." if len(contacts) > _NAMED else ""
    return (
        f"The run ends during contact of {named}{more}: contact time, impulse and peak force are"
        f" those up to {ended.time:g} s; lengthen the duration."
    )


def never_touched(assembly: Assembly, ended: Ended) -> str:
    """Why no contact touched, which may come from a wrong sign; "" if one did."""
    system = assembly.system
    if ended.touches or np.any(system.pressed):
        return ""
    p = len(assembly.laws)
    speed, push = _felt(system.beta[:p], system.v), _felt(system.beta[:p], system.loads[0])
    for motion, unit in ((speed, "m/s"), (push, "m/s^2")):
        c = int(np.argmax(motion))
        contact, most = assembly.scene.contacts[c], float(motion[c])
        if most > 0:
            return (
                f"the gap of {system.offsets[0, c]:g} m of {contact.a!r}, {contact.b!r} closes at"
                f" {most:g} {unit} at first and was not closed within {ended.time:g} s; lengthen"
                f" the duration"
            )
        if np.any(motion < 0):
            return (
                f"the gap of {contact.a!r}, {contact.b!r} opens at {-most:g} {unit} at first; if it"
                f" should close, reverse the sign of the velocity or gravity or, in a scene, the"
                f" ends"
            )
    if system.breaks.size > 1:  # what acts changes in time
        return f"no contact closed within {ended.time:g} s; lengthen the duration"
    return "nothing moves the bodies toward each other; give one a velocity > 0, or gravity"


def _felt(beta: Array, modal: Array) -> Array:
    """beta modal (p,), 0 where it is rounding."""
    felt = beta @ modal
    return np.where(abs(felt) > ROUNDING * (abs(beta) @ abs(modal)), felt, 0.0)


def tell_rotation(name: str, angle: float) -> None:
    """Warn of a body that turned so far that its rotation is not small."""
    if angle > SMALL_ROTATION:
        warn(
            f"{name!r} turned by {angle:.2g} rad; rotations are taken as small, below"
            f" {SMALL_ROTATION:g} rad.",
            AccuracyWarning,
        )


def tell_all(verdicts: Sequence[Verdict]) -> None:
    """One warning for each kind of failure in a batch of runs, with the scenes that have it."""
    kinds: dict[tuple[int, bool], list[int]] = {}
    for i, one in enumerate(verdicts):
        if one.status or one.odd:
            kinds.setdefault((one.status, one.odd), []).append(i)
    for (status, _), scenes in kinds.items():
        named = ", ".join(map(str, scenes[:_NAMED])) + (", ..." if len(scenes) > _NAMED else "")
        warn(
            f"{len(scenes)} of {len(verdicts)} scenes ({named}), as scene {scenes[0]}:"
            f" {verdicts[scenes[0]].message}",
            AccuracyWarning if status else AntioscWarning,
        )
