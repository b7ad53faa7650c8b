"""Error bars of an impact: their causes, and the budget that adds them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from antiosc.base.texts import MIN_PERCENT_SHARE, engineering, percent, plus_minus, restitution_text
from antiosc.impact.histories.parts import contacts_of_main

#: Quantities of an impact that have bars, and their units.
QUANTITIES = {"peak_force": "N", "impulse": "N s", "contact_time": "s"}
#: Name of the largest displacement of the site, which has a separate error bar.
DEFLECTION = "deflection"
BAR_UNITS = {**QUANTITIES, DEFLECTION: "m"}
#: Errors due to a cause that does not apply.
ZERO_ERRORS = dict.fromkeys(BAR_UNITS, 0.0)
#: Causes of error, in the order in which they are printed.
CAUSES = ("mesh", "truncation", "time", "patch", "noise", "stretch", "law")
#: Why a contact time has no bar.
UNCERTAIN_CONTACTS_TEXT = "no error bar: the number of its contacts is uncertain"
#: Printed instead of a bar that would lack a cause, which may be the largest one.
NO_BAR_TEXT = "no error bar"
#: Printed after a bar if the user gave the law, whose error is unknown here.
GIVEN_LAW_TEXT = " (law as given)"
#: Text of a lower error of 100 %, with which a quantity may be 0; page.js has the same.
WHOLE_SIDE_TEXT = percent(1.0)
#: Causes printed only for measured models, and for bodies with second-order forces.
RARE_CAUSES = ("noise", "stretch")
#: Causes with less than this error and less than this share of the bar are printed as one sum,
#: except those in `ALWAYS_SHOWN_CAUSES`.
SMALL_CAUSE_SHARE, SMALL_CAUSE_ERROR = 5e-3, 0.1
ALWAYS_SHOWN_CAUSES = ("law", *RARE_CAUSES)


@dataclass(frozen=True)
class ErrorBar:
    """The error bar of one quantity: bounds on its relative error due to each cause."""

    value: float  # of the quantity, SI units
    mesh: float = 0.0  # displacements that the mesh cannot represent
    truncation: float = 0.0  # anti-oscillators that the model leaves out
    time: float = 0.0  # time integration
    patch: float = 0.0  # choice of the radius of the patch
    noise: float = 0.0  # of a measured model: noise, and modes above the measured band
    law: float | None = 0.0  # the contact law and its parameters; None: not known
    stretch: float = 0.0  # second-order forces of omitted modes, if a part stretches
    without_mesh: bool = False  # whether the mesh's error is not known, and `mesh` 0

    @property
    def numerical(self) -> float:
        """Sum of all causes except the contact law, whose error no finer model reduces."""
        return sum(getattr(self, cause) for cause in CAUSES if cause != "law")

    @property
    def known(self) -> float:
        """Sum of the causes that are known."""
        return self.numerical + (self.law or 0.0)

    @property
    def total(self) -> float | None:
        """Sum of all causes; None if the error of the law or of the mesh is not known."""
        return None if self.law is None or self.without_mesh else self.known


@dataclass(frozen=True)
class ErrorBudget(Mapping[str, ErrorBar]):
    """The error bars of "peak_force", "impulse" and "contact_time".

    If the error by "mesh" or "law" is unknown, there is no bar. If the user gave the law, the
    bars hold for this law.
    """

    #: quantity -> bar; "deflection" (largest, of a supported site) is not in the mapping
    bars: Mapping[str, ErrorBar]
    energy_error: float  #: share of strain errors in the strain energy, mean over the contact
    notes: tuple[str, ...] = ()  #: errors that the bars do not include, and reasons for doubts
    safety: float = 2.0  #: factor of the mesh's bars over the differences to the corrected model
    #: name of an unknown cause (0 in the bars) or of an incomparable quantity -> reason
    unknown: Mapping[str, str] = field(default_factory=dict)
    #: e of an impact with the impulse m v (1 + e) on a part at rest; None for others and e < 0
    restitution: float | None = None

    def __getitem__(self, name: str) -> ErrorBar:
        return self.bars[name]

    def __iter__(self) -> Iterator[str]:
        return (name for name in self.bars if name != DEFLECTION)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @property
    def deflection(self) -> ErrorBar | None:
        """Error bar of the largest deflection of the site; None for a free part."""
        return self.bars.get(DEFLECTION)

    def of_corrected(self, hit: object) -> ErrorBudget:
        """Error bars of `hit` on the corrected model, from the bars of the uncorrected model.

        With the difference d of both models and the safety factor S >= 2, the error of the
        uncorrected model is at most S d. The corrected model is closer to the truth by d, or beyond
        it by less than d: its error is at most (S - 1) d.
        """
        nearer = 1 - 1 / self.safety
        motion = getattr(hit, "site_motion", None)
        bars = {}
        for name, bar in self.bars.items():
            value = getattr(motion, "largest", bar.value)
            value = value if name == DEFLECTION else getattr(hit, name)
            bars[name] = replace(bar, value=value, mesh=nearer * bar.mesh)
        e = None if self.restitution is None else getattr(hit, "restitution", None)

        return replace(self, bars=bars, restitution=e)

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes of error to print; noise and stretch if present, the law if known."""
        bars = self.values()
        known_causes = (c for c in CAUSES if c not in self.unknown)
        return tuple(
            c for c in known_causes if c not in RARE_CAUSES or any(getattr(b, c) for b in bars)
        )

    @property
    def worst(self) -> float | None:
        """Largest total of the three quantities; None if one is not known."""
        totals = [bar.total for bar in self.values()]
        if None in totals:
            return None
        return max(filter(None, totals), default=0.0)

    @property
    def numerical(self) -> float:
        """Largest error of the three quantities, as the sum of all causes but the contact law."""
        return max(bar.numerical for bar in self.values())

    @property
    def rest_of_force(self) -> float | None:
        """Error bar of the peak force minus its truncation error; None without an error bar."""
        bar = self.bars["peak_force"]
        return None if self.no_bar else bar.known - bar.truncation

    def sides(self, name: str) -> tuple[float, float]:
        """Relative errors (below, above) of a quantity due to the known causes.

        They are limited by physics: no quantity is negative, and the impulse m v (1 + e) of an
        impact on a part at rest is between m v and 2 m v.
        """
        bar = self.bars[name]
        below, above = min(bar.known, 1.0), bar.known
        if name == "impulse" and (e := self.restitution) is not None:
            return min(below, e / (1 + e)), min(above, max(1 - e, 0.0) / (1 + e))
        return below, above

    @property
    def restitution_sides(self) -> tuple[float, float] | None:
        """Errors (below, above) of the restitution e, from errors of the impulse m v (1 + e)."""
        if self.restitution is None or self.no_bar:
            return None

        below, above = self.sides("impulse")
        return (1 + self.restitution) * below, (1 + self.restitution) * above

    def shown(self, name: str, digits: int = 4) -> str:
        """Text: a quantity with its error bar or its upper bound, or that it has no bar."""
        bar = self.bars[name]
        value = engineering(bar.value, BAR_UNITS[name], digits)
        if self.no_bar:
            return f"{value} ({NO_BAR_TEXT})"
        if name in self.unknown:
            return value

        below, above = self.sides(name)
        if percent(below) == WHOLE_SIDE_TEXT:
            most = engineering((1 + above) * bar.value, BAR_UNITS[name], 2)
            return f"{value}, at most {most}{self.condition}"
        return f"{value} {plus_minus((below, above))}{self.condition}"

    @property
    def no_bar(self) -> bool:
        """Whether the error of the law or of the mesh, which may be the largest, is unknown."""
        return "mesh" in self.unknown or any(bar.law is None for bar in self.values())

    @property
    def law(self) -> str:
        """Reason why the bars lack the error of the contact law; "" if they include it."""
        return self.unknown.get("law", "")

    @property
    def condition(self) -> str:
        """Text printed after a bar that excludes the error of the law; "" for other bars."""
        return GIVEN_LAW_TEXT * bool(self.law)

    @property
    def footnote(self) -> str:
        """Sentence on why there are no bars or which errors they lack; "" if complete."""
        reasons = [self.unknown.get("mesh", "")]
        if not reasons[0] or any(bar.law is None for bar in self.values()):
            reasons.append(self.law)
        return " ".join(filter(None, ["There is no error bar." * self.no_bar, *reasons]))

    def shown_restitution(self, e: float | None, digits: int = 3) -> str:
        """A coefficient of restitution as text, with its error if that is known."""
        if e is None:
            return "not defined"

        sides = self.restitution_sides
        if sides is None:
            return restitution_text(e, digits)
        error = plus_minus(sides, partial(engineering, digits=2))
        return f"{restitution_text(e, digits)} {error}{self.condition}"

    def shares(self, name: str) -> dict[str, float | None]:
        """Relative errors (None if unknown) by cause; also "total", "below" and "above"."""
        bar = self.bars[name]
        not_known = CAUSES if name in self.unknown else [c for c in self.unknown if c != "law"]
        shares = {cause: None if cause in not_known else getattr(bar, cause) for cause in CAUSES}
        if self.no_bar or name in self.unknown:
            return {**shares, "total": None, "below": None, "above": None}

        below, above = self.sides(name)

        return {**shares, "total": bar.total, "below": below, "above": above}

    def causes_text(self, name: str) -> str:
        """The shares of the causes in the error of a quantity as text, small ones as one sum."""
        bar = self.bars[name]
        shares = {cause: getattr(bar, cause) for cause in self.causes}
        least = min(SMALL_CAUSE_SHARE, SMALL_CAUSE_ERROR * bar.known)
        told = {
            cause: share
            for cause, share in shares.items()
            if share >= least or cause in ALWAYS_SHOWN_CAUSES
        }
        rest = sum(shares.values()) - sum(told.values())
        if rest > MIN_PERCENT_SHARE:
            told["others"] = rest

        return ", ".join(f"{cause} {percent(share)}" for cause, share in told.items())

    def __str__(self) -> str:
        lines = []
        for name in self:
            reason = self.unknown.get(name) or self.causes_text(name)
            lines.append(f"{name.replace('_', ' ')} {self.shown(name)}: {reason}")

        if self.restitution_sides is not None:
            lines.append(f"restitution {self.shown_restitution(self.restitution)}")
        return "\n".join([*lines, *filter(None, [self.footnote]), *self.notes])


#: Each error is at least this share of the largest of the three.
MIN_ERROR_SHARE = 0.5


def relative_differences(first: object, second: object) -> dict[str, float]:
    """Relative differences of peak force, impulse and contact time between two results."""
    return {
        name: _relative_difference(getattr(first, name), getattr(second, name))
        for name in QUANTITIES
    }


def are_comparable(first: Any, second: Any) -> bool:
    """Whether the main impacts of two results have the same number of contacts.

    An unknown number counts as 0. The main impact is the one with the largest impulse; contacts
    belong to one impact if the flight between them is shorter than the impact before it.
    """
    return contacts_of_main(first) == contacts_of_main(second)


#: Text on a contact time, if all of several contacts belong to the main impact.
OF_ALL_CONTACTS = "of all contacts, flights included"


def contact_time_note(result: Any) -> str:
    """Text: which contacts the contact time covers, if there are several; "" for one."""
    count = len(result.contacts)
    if count < 2:
        return ""
    if contacts_of_main(result) == count:
        return OF_ALL_CONTACTS

    last = engineering(result.contacts[-1][1], "s")
    return f"of the main impact; last release at {last}"


def relative_changes(first: Any, second: Any) -> dict[str, float]:
    """`relative_differences`; for incomparable contact times the larger of the other two."""
    found = relative_differences(first, second)
    if not are_comparable(first, second):
        found["contact_time"] = max(found["peak_force"], found["impulse"])
    return found


def relative_changes_with_site(first: Any, second: Any) -> dict[str, float]:
    """`relative_changes`, and the change of the site's displacement (0 if unknown)."""
    moved = [getattr(one, "site_motion", None) for one in (first, second)]
    largest = [0.0 if one is None else one.largest_displacement for one in moved]
    return {**relative_changes(first, second), DEFLECTION: _relative_difference(*largest)}


def with_floor(errors: Mapping[str, float]) -> dict[str, float]:
    """The errors, each at least `MIN_ERROR_SHARE` times the largest of the `QUANTITIES`."""
    worst = max(errors[name] for name in QUANTITIES)
    return {name: max(error, MIN_ERROR_SHARE * worst) for name, error in errors.items()}


def _relative_difference(a: float, b: float) -> float:
    if a != b:
        return abs(a - b) / max(abs(a), abs(b))
    return 0.0
