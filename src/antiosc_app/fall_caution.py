"""What is said before the numbers of a fall."""

from __future__ import annotations

from collections.abc import Sequence

from antiosc import Fall
from antiosc_app.live import rough_force
from antiosc_studies.drops.impacts import FallImpact

#: What narrows the bar of a force.
REMEDY = "a soft layer on the floor, or a larger corner radius where the corners are blunter,"


def law_bar(impact: FallImpact) -> float:
    """Relative error of the peak force of an impact by its contact law; 0 if unknown."""
    return impact.law_error or 0.0


def caution_of_fall(fall: Fall) -> str:
    """What must be read before the numbers: that the bar of the hardest impact is missing or wide,
    and the remedy, and why bars of others are missing.
    """
    hardest = fall.hardest
    if hardest is None:
        return ""
    reason = fall.no_bar(hardest)
    told = [f"There is no error bar: {reason}."] if reason else []
    if start := rough_force(law_bar(fall.impacts[hardest])):
        told.append(f"{start}{REMEDY} narrows the bar.")
    others = [k for k in range(len(fall.impacts)) if k != hardest]
    return " ".join([*told, *_without_bar(fall, others, reason)])


def _without_bar(fall: Fall, impacts: Sequence[int], told: str) -> list[str]:
    """Sentences on impacts without a bar for another reason than the one that is told."""
    reasons: dict[str, list[int]] = {}
    for k in impacts:
        reasons.setdefault(fall.no_bar(k), []).append(k)
    return [
        f"There is no error bar of the force of {_impacts(numbers)}: {reason}."
        for reason, numbers in reasons.items()
        if reason not in ("", told)
    ]


def _impacts(numbers: Sequence[int]) -> str:
    """Text of impacts with these numbers, from 0: "impact 1", "impacts 1 and 3"."""
    return f"impact{'s' * (len(numbers) > 1)} {' and '.join(f'{k + 1}' for k in numbers)}"
