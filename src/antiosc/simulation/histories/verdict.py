"""How a run ended: its status, and the message that explains it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from antiosc.base.errors import AccuracyWarning, AntioscWarning, warn

#: status of a run: complete; complete, but not to the tolerance; stopped before the end; complete,
#: but the bodies still touch at the end
COMPLETED, INEXACT, STOPPED, TOUCHING = 0, 1, 2, 3

#: Rotation [rad] of a body above which a warning is given.
SMALL_ROTATION = 0.1
#: Scenes of a batch that a warning names.
_NAMED = 5


@dataclass(frozen=True)
class Verdict:
    """Status and message of a run; `odd`: causes a warning although the status is 0."""

    status: int
    message: str
    odd: bool = False

    def with_shortage(self, shortage: str) -> Verdict:
        """The same verdict for a model with too few anti-oscillators, if there is a `shortage`."""
        if not shortage:
            return self
        worse = self.status if self.status in (INEXACT, STOPPED) else INEXACT
        return Verdict(worse, f"{self.message} {shortage}", self.odd)

    def tell(self) -> None:
        """Warn at the caller's line unless the run completed as requested."""
        if self.status:
            warn(self.message, AccuracyWarning)
        elif self.odd:
            warn(self.message)


def judge(failure: str, untouched: str, inexact: str, cut: str) -> Verdict:
    """The verdict on one run, of an impact or a scene; "" for what does not apply.

    Parameters
    ----------
    failure : why the run stopped before its end.
    untouched : why nothing touched.
    inexact : that the tolerance was not met.
    cut : which contacts go on at the end.
    """
    if failure:
        return Verdict(STOPPED, failure[0].upper() + failure[1:] + ".")
    if inexact:
        return Verdict(INEXACT, " ".join(filter(None, (inexact, cut))))
    if untouched:
        return Verdict(COMPLETED, f"Never touched: {untouched}.", odd=True)
    return Verdict(TOUCHING, cut) if cut else Verdict(COMPLETED, "Completed.")


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
