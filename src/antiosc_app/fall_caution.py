"""What is said before the numbers of a fall, and of what the bar of its force is made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees, hypot

from antiosc import Fall
from antiosc.base.errors import AntioscError
from antiosc.base.texts import SMALLER_CELLS, engineering, percent
from antiosc_app.live import rough_force
from antiosc_studies.drops.beside import BESIDE
from antiosc_studies.drops.blunt import FACETS, RADIUS, STRENGTH
from antiosc_studies.drops.flat import ANGLE, is_flat, range_over_tilt
from antiosc_studies.drops.trajectory import FallImpact

#: Least share of the bar of a force that is told.
TOLD = 0.02
#: Cause of an error of the force -> what of the same fall takes it away.
REMEDIES = {
    RADIUS: "the corner radius of the part in place of the assumed one",
    STRENGTH: "an own material with the yield strength of this part, without a range",
}
#: Causes that come from the mesh. What smaller cells leave is not known before: they touch at other
#: vertices.
OF_MESH = (BESIDE, FACETS)


def law_bar(impact: FallImpact) -> float:
    """Relative error of the peak force of an impact by its contact law; 0 if unknown."""
    return impact.law_error or 0.0


def caution_of_fall(fall: Fall) -> str:
    """What must be read before the numbers: that the bar of the hardest impact is missing or wide,
    and the remedy, and why bars of others are missing; of a part that lands flat first the range of
    the force over small tilts.
    """
    hardest = fall.hardest
    if hardest is None:
        return ""
    over_tilt = ""
    reason = fall.no_bar(hardest)
    told = [f"There is no error bar: {reason}."] if reason else []
    if start := rough_force(law_bar(fall.impacts[hardest])):
        over_tilt = _over_tilt(fall) if hardest == 0 and is_flat(fall) else ""
        told.append(f"{start}{_narrows(fall, hardest)}.")
    others = [k for k in range(len(fall.impacts)) if k != hardest]
    return over_tilt + " ".join([*told, *_without_bar(fall, others, reason)])


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


def _over_tilt(fall: Fall) -> str:
    """Sentence on the range of the force of a part that lands on an edge or a face."""
    try:
        least, largest = range_over_tilt(fall)
    except AntioscError:  # a start that cannot be computed
        return ""
    return (
        "The part lands on an edge or a face: with up to"
        f" {degrees(ANGLE):.2g}° more or less of tilt the force lies between"
        f" {engineering(least, 'N')} and {engineering(largest, 'N')}. "
    )


def _narrows(fall: Fall, hardest: int) -> str:
    """The end of a sentence on a wide bar: of what it is made, and what narrows it."""
    if shares := _shares(fall, hardest):
        return f"the bar is made of {shares}"
    remedy = "a soft layer on the floor, or a larger corner radius where the corners are blunter,"
    if fall.setting.floor.layer is not None:
        remedy = "a stiffer layer, whose modulus is known,"
    return f"{remedy} narrows the bar"


def made_of(fall: Fall, hardest: int) -> str:
    """Sentence on the shares of the bar of a sharp corner, if it is not told before."""
    bar = law_bar(fall.impacts[hardest])
    shares = _shares(fall, hardest)
    if not shares or rough_force(bar):
        return ""
    return f"the bar of the force, ± {percent(bar)}, is made of {shares}"


def _shares(fall: Fall, hardest: int) -> str:
    """The shares of the bar of a sharp corner, and what narrows it; "" if unknown."""
    shares = fall.error_shares(hardest)
    told = sorted(((error, cause) for cause, error in shares.items() if error > TOLD), reverse=True)
    if not told:
        return ""
    squared = ", ".join(f"{cause} {percent(error)}" for error, cause in told if cause != BESIDE)
    parts = [f"{squared} (root of the squares)"] * bool(squared)
    if shares.get(BESIDE, 0.0) > TOLD:
        parts.append(f"{BESIDE}, {percent(shares[BESIDE])}")
    return f"{', and '.join(parts)}: {_remedies(shares, told)}"


def _remedies(shares: Mapping[str, float], told: Sequence[tuple[float, str]]) -> str:
    """What takes the largest shares away, the largest first, with the bar that remains."""
    remaining = dict(shares)
    before = percent(_bar(remaining))
    steps = [f"smaller cells ({SMALLER_CELLS}) narrow it"] if told[0][1] in OF_MESH else []
    for cause in [cause for _, cause in told if cause in REMEDIES]:
        remaining.pop(cause)
        bar = percent(_bar(remaining))
        if bar != before:
            steps.append(f"{REMEDIES[cause]} leaves ± {bar}")
        before = bar
    return ", then ".join(steps) or "design for its upper end"


def _bar(shares: Mapping[str, float]) -> float:
    """The bar that shares make: what lies beside the corner is added to the root of the squares."""
    squared = (error for cause, error in shares.items() if cause != BESIDE)
    return hypot(*squared) + shares.get(BESIDE, 0.0)
